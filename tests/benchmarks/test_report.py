"""The documents show what the committed results say, and every result says where it comes from."""

from __future__ import annotations

import importlib
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest

from benchmarks import engine, figures, report

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
    every = "".join(path.read_text() for path in report.DOCUMENTS)
    placed = {found[:2] for found in report.MARKER.findall(every)}
    assert {name for name, _ in placed} <= set(NAMES)
    missing = {(name, block) for name in NAMES for block in parts[name] if block != "made"} - placed
    assert not missing, "blocks that no document shows"
    unplaced = re.findall(r"<!--(?! /?\w+\.\w+ -->).*", every)
    assert not unplaced, "comments that are no markers"


@pytest.mark.parametrize("name", NAMES)
def test_a_result_says_where_it_comes_from(name) -> None:
    results = report.load(name)
    for made in (results["made"], *(part["made"] for part in results.get("parts", {}).values() if "made" in part)):
        assert {"processor", "cores"} <= set(made["machine"])
        assert re.fullmatch(r"[0-9a-f]{40}", made["commit"])
        assert re.search(rf"python -m benchmarks\.{name}|^make [a-z]+$", made["command"])


@pytest.mark.parametrize("name", NAMES)
def test_a_benchmark_is_found_by_the_name_of_its_result(name) -> None:
    module = importlib.import_module(f"benchmarks.{name}")
    assert module.__doc__ and callable(module.measure) and callable(module.blocks)


def test_a_marker_without_block_or_end_is_an_error() -> None:
    text = "a <!-- x.y -->1<!-- /x.y --> b\n<!-- x.z -->\nold\nold\n<!-- /x.z -->\n<!-- u.v -->kept<!-- /u.v -->\n"
    wanted = text.replace("-->1<", r"-->\1 7<").replace("old\nold", "| t |")
    assert report.fill(text, {"x": {"y": r"\1 7", "z": "| t |"}}) == wanted
    assert report.fill("<!-- x.y -->\n<!-- /x.y -->", {"x": {"y": "new"}}) == "<!-- x.y -->\nnew\n<!-- /x.y -->"
    for broken, wrong in (
        ("<!-- x.y -->", "alone"),
        ("<!-- /x.y -->", "alone"),
        ("<!-- x.y -->1<!-- /x.z -->", "alone"),
        ("<!-- x.w -->1<!-- /x.w -->", "no block x.w"),
    ):
        with pytest.raises(ValueError, match=wrong):
            report.fill(broken, {"x": {"y": "new", "z": "new"}})


def test_a_picture_is_the_same_every_time(tmp_path, monkeypatch) -> None:
    pytest.importorskip("matplotlib")
    for name in ("first", "second"):
        monkeypatch.setattr(figures, "IMAGES", tmp_path / name)
        engine.draw(report.load("engine"))
        with figures.figure("line.png") as (_, (axes,)):
            axes.plot([1, 2], [3, 4])
    for picture in ("engine.svg", "line.png"):
        first, second = ((tmp_path / name / picture).read_bytes() for name in ("first", "second"))
        assert first == second and b"<dc:date>" not in first


# -- results ----------------------------------------------------------------------------------------------------------


def test_what_is_saved_can_be_loaded_and_bears_its_stamp(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(report, "RESULTS", tmp_path)
    results = {"rows": [{"ms": [1.5, None], "name": "[\n 1\n]"}], "one": np.float64(2.5), "many": np.arange(3)}
    report.save(results, "some")
    found = report.load("some")
    assert found["rows"] == results["rows"] and found["one"] == 2.5 and found["many"] == [0, 1, 2]
    assert found["made"]["machine"]["cores"] and found["made"]["command"].count("python")
    assert '"many": [0, 1, 2]' in (tmp_path / "some.json").read_text()
    report.save({"made": {"commit": "earlier"}}, "some")
    assert report.load("some") == {"made": {"commit": "earlier"}}
    with pytest.raises(ValueError, match="JSON"):
        report.save({"one": float("nan")}, "some")


def test_a_command_names_no_folder_of_the_machine(monkeypatch) -> None:
    monkeypatch.setattr(
        "sys.orig_argv", ["/a/bin/python", "-m", "benchmarks.retrieval", "--atlas", "/some/where/atlas.h5"]
    )
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    assert report.command() == "OMP_NUM_THREADS=1 python -m benchmarks.retrieval --atlas atlas.h5"


def test_a_source_is_told_once() -> None:
    stamps = [{"machine": {"processor": "P", "cores": 2}, "commit": 40 * c, "command": "python -m x"} for c in "aab"]
    text = report.made_text(stamps)
    many = report.made_text([{**stamps[0], "command": f"python -m benchmarks.x --part {k}"} for k in range(3)])
    assert many.startswith("Measured by 3 runs of `python -m benchmarks.x` at commits aaaaaaaaa; P")
    assert text.count("P, 2 cores") == 1 and text.count("aaaaaaaaa,") == 1 and text.count("`python -m x`") == 2
    assert "aaaaaaaaa+changes;" in report.made_text([{**stamps[0], "commit": 40 * "a" + "+changes"}])


def test_what_a_benchmark_yields_is_published_with_options_from_its_signature(monkeypatch) -> None:
    published: list[tuple[str, dict]] = []
    monkeypatch.setattr(report, "save", lambda results, name: published.append((name, results)))
    monkeypatch.setattr(report, "commit", lambda: "c" * 40)
    monkeypatch.setattr(report, "render", lambda names: published.append((names[0], {})))

    def measure(
        slow_cases: Annotated[int, "of each"] = 3,
        kinds: Annotated[str, "some", ("a", "b")] = ("a", "b"),
        atlas: Annotated[Path | None, "built if not given"] = None,
        quick: Annotated[bool, "soon"] = False,
    ) -> Iterator[dict]:
        yield {"cases": slow_cases, "kinds": kinds, **({"quick": True} if quick else {})}
        yield {"atlas": atlas}

    def shown() -> list[tuple[str, dict]]:
        return [(name, {key: value for key, value in found.items() if key != "made"}) for name, found in published]

    report.run(measure, ["--slow-cases", "7", "--kinds", "b"])
    assert shown() == [
        ("test_report", {"cases": 7, "kinds": ["b"]}),
        ("test_report", {}),
        ("test_report", {"atlas": None}),
        ("test_report", {}),
    ]
    report.run(measure, ["--atlas", "x.h5"])
    assert shown()[-4][1] == {"cases": 3, "kinds": ("a", "b")} and shown()[-2][1] == {"atlas": Path("x.h5")}
    report.run(measure, ["--quick"])
    assert shown()[-4][1] == {"cases": 3, "kinds": ("a", "b"), "quick": True}
    count = len(published)
    monkeypatch.setattr(report, "commit", lambda: "c" * 40 + "+changes")
    with pytest.raises(SystemExit):
        report.run(measure, [])
    assert len(published) == count, "nothing is published from a tree with changes"
    with pytest.raises(SystemExit):
        report.run(measure, ["--kinds", "c"])


def test_what_is_short_of_its_goal_is_stored_too_and_told(monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(report, "RESULTS", tmp_path)
    monkeypatch.setattr(report, "commit", lambda: "c" * 40)
    monkeypatch.setattr(report, "render", lambda names: None)

    def measure() -> Iterator[dict]:
        yield {"found": 1}
        raise SystemExit("short")

    with pytest.raises(SystemExit, match="short"):
        report.run(measure, [])
    assert report.load("test_report")["found"] == 1


# -- time and words ---------------------------------------------------------------------------------------------------


def test_times_are_of_the_runs_alone() -> None:
    calls: list[str] = []
    times = report.repeat(lambda: calls.append("a"), runs=4, warm_up=2)
    assert len(calls) == 6 and len(times.wall) == len(times.processor) == 4
    assert times.run(lambda x: x + 1, 1) == 2 and len(times.wall) == 5
    assert 0 < times.least.wall <= times.median.wall <= times.percentile(100).wall
    assert times.summary()["median_ms"] == pytest.approx(1000 * times.median.wall)
    assert times.summary()["p99_processor_ms"] == pytest.approx(1000 * times.percentile(99).processor)


def test_pairs_alternate() -> None:
    calls: list[str] = []
    ours, theirs = report.paired([lambda: calls.append("a"), lambda: calls.append("b")], rounds=3, warm_up=0)
    assert "".join(calls) == "abbaab" and len(ours.wall) == len(theirs.wall) == 3
    found = report.ratio(report.Times([2.0, 9.0], [4.0, 6.0]), report.Times([1.0, 3.0], [1.0, 2.0]))
    assert (found["min"], found["max"]) == (3.0, 4.0)


def test_a_table_is_made_by_columns() -> None:
    rows = [{"name": "a", "at": {"x": 2.5}}, {"name": "b", "at": {"x": 12}}]
    columns = "what: {name}\nx: rounded: {at[x]:.1f}\nthree, two: {at[x]:significant}, {at[x]:significant 2}"
    wanted = (
        "| what | x: rounded | three, two |\n| --- | --: | --: |\n| a | 2.5 | 2.50, 2.5 |\n| b | 12.0 | 12.0, 12 |"
    )
    assert report.table(rows, columns) == wanted


@pytest.mark.parametrize(
    ("value", "text"), [(12345.6, "12,300"), (1.0, "1.00"), (0.01234, "0.0123"), (0, "0"), (None, "-"), (np.nan, "-")]
)
def test_numbers_are_rounded_to_three_digits(value, text) -> None:
    assert report.significant(value) == text


def test_sizes_and_durations_have_units() -> None:
    wanted = ["0.00100 kB", "1.00 kB", "1.00 MB", "1.00 GB", "1.00 TB"]
    assert [report.size(10.0**k) for k in (0, 3, 6, 9, 12)] == wanted
    assert [report.duration(s) for s in (0.5, 90, 600, 36000)] == ["500 ms", "90.0 s", "10.0 minutes", "10.0 hours"]
    assert report.duration(float("nan")).startswith("-")
    assert [report.power(value) for value in (1.23e-15, None, np.inf)] == ["1.2e-15", "no answer", "no answer"]
    assert (
        json.dumps([report.finite(value) for value in (1, np.float64(2), np.inf, np.nan)]) == "[1.0, 2.0, null, null]"
    )
