"""The everyday questions, sent to ``linkage-atlas serve`` with its defaults: none ends in an error or worsens with more time."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

import benchmarks
from benchmarks.battery import BUDGETS, KINDS, rows
from benchmarks.everyday import faults, late, replies_to
from benchmarks.service import Service, running, serve_command
from tests.conftest import some_of

ROWS = {row.name: row for row in rows()}
GOOD = tomllib.loads((Path(benchmarks.__file__).parent / "good.toml").read_text())
SHOWN = ["rectangle, 24 points by hand", "oval, 12 points", "bonnet, every second angle"]
SHOWN += ["wave, 24 points", "eight, 60 points by hand", "x^1.5", "casement in step with a motor"]
SHOWN += ["bucket", "walking foot"]
"""A question of each kind."""


@pytest.fixture(scope="module")
def service(atlas_path: Path) -> Iterator[Service]:
    """The service with its defaults; the default atlas is there already."""
    with running(serve_command, atlas=atlas_path) as running_service:
        yield running_service


@pytest.mark.parametrize("name", some_of(SHOWN, 1))
def test_an_everyday_question_has_an_answer_that_more_time_does_not_worsen(name: str, service: Service) -> None:
    replies = replies_to(
        service, ROWS[name], ["preset"], [100, None]
    )  # by the clock: the time of the first answer is unknown
    assert not faults(replies) and replies[1].objective is not None


@pytest.mark.parametrize("name", some_of(["oval, 5 points", "pairs, falling", "knee"], 1))
def test_a_good_answer_is_found(name: str, service: Service) -> None:
    replies = replies_to(service, ROWS[name], ["preset", "any"], [None])
    assert not faults(replies)
    assert replies[0].error <= GOOD[name]


@pytest.mark.wide
@pytest.mark.parametrize("name", ROWS)
def test_every_everyday_question(name: str, service: Service) -> None:
    replies = replies_to(service, ROWS[name])
    assert not faults(replies)
    assert next(reply for reply in replies if reply.kind == "preset" and reply.budget is None).error <= GOOD[name]


@pytest.mark.timed
@pytest.mark.parametrize("name", ROWS)
def test_an_answer_takes_no_longer_than_its_budget_allows(name: str, service: Service) -> None:
    assert not late(replies_to(service, ROWS[name], KINDS, BUDGETS[:-1]))
