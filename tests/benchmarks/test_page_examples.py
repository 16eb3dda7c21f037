"""The examples of the page are those that their script makes."""

from __future__ import annotations

from benchmarks import page_examples


def test_the_examples_are_made_by_their_script() -> None:
    assert page_examples.FILE.read_text() == page_examples.text()
