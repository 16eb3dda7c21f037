"""The documents show the committed results, and every result names its origin.

A table that was edited by hand, or a result without commit and machine, would show here.
"""

from __future__ import annotations

import importlib
import re

import pytest

from benchmarks import figures, report

NAMES = report.names()


@pytest.fixture(scope="module")
def parts() -> dict[str, dict[str, str]]:
    return {name: report.parts(name) for name in NAMES}


# -- the documents ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", report.DOCUMENTS, ids=lambda path: path.name)
def test_every_marker_holds_what_its_result_renders_to(path, parts) -> None:
    text = path.read_text()
    assert text == report.fill(text, parts), "python -m benchmarks.report writes it anew"


def test_every_marker_has_a_result_and_every_result_of_a_block_a_marker(parts) -> None:
    all_cases = "".join(path.read_text() for path in report.DOCUMENTS)
    placed = {found[:2] for found in report.MARKER.findall(all_cases)}
    assert {name for name, _ in placed} <= set(NAMES)
    missing = {(name, block) for name in NAMES for block in parts[name] if block != "made"} - placed
    assert not missing, "blocks that no document shows"
    unplaced = re.findall(r"<!--(?! /?\w+\.\w+ -->).*", all_cases)
    assert not unplaced, "comments that are no markers"


@pytest.mark.parametrize("name", NAMES)
def test_a_result_says_where_it_comes_from(name) -> None:
    results = report.load(name)
    for built in (results["made"], *(part["made"] for part in results.get("parts", {}).values() if "made" in part)):
        assert {"processor", "cores"} <= set(built["machine"])
        assert re.fullmatch(r"[0-9a-f]{40}", built["commit"])
        assert re.search(rf"python -m benchmarks\.{name}|^make [a-z]+$", built["command"])


@pytest.mark.parametrize("name", NAMES)
def test_a_benchmark_is_found_by_the_name_of_its_result(name) -> None:
    module = importlib.import_module(f"benchmarks.{name}")
    assert module.__doc__ and callable(module.measure) and callable(module.blocks)


def test_a_picture_is_the_same_every_time(tmp_path, monkeypatch) -> None:
    pytest.importorskip("matplotlib")
    for name in ("first", "second"):
        monkeypatch.setattr(figures, "IMAGES", tmp_path / name)
        with figures.figure("line.svg") as (_, (axes,)):
            axes.plot([1, 2], [3, 4])
    first, second = ((tmp_path / name / "line.svg").read_bytes() for name in ("first", "second"))
    assert first == second and b"<dc:date>" not in first


# -- results ----------------------------------------------------------------------------------------------------------
