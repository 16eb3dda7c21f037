"""The index of windows of short spans beside the cells of types alone: the same answers, and the processor's time of each.

``python -m benchmarks.short_spans [--atlas FILE] [--requests 400] [--hard 200] [--wide 6]`` ends with 1 if any answer differs.
Both scans hold the same series and cells; one of them has the index too. Every request goes to both, twice, in alternating order,
and the better time of each counts: processor time of one thread, which other work on the machine stretches little.
The requests to the default atlas are also given to the plain scan, which has neither index nor cells. ``--wide`` requests a
span go to the wider atlas (crank or ground the shortest, the others in all orders); 0 leaves it out, and its figures as they
were.
"""

from __future__ import annotations

import gc
import os
import tempfile
from collections.abc import Iterator, Sequence
from copy import copy
from itertools import cycle
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks import report
from benchmarks.index import NO_LIMIT
from benchmarks.product import Scan, Target, Work, la, load_atlas, make_target
from benchmarks.report import Times
from benchmarks.service import build
from tests.oracles.classes import generator
from tests.oracles.rotations import KINDS, SHAPES, crank_angles, hard_target, reachable

TOP = 10
SPANS = (5, 10, 15, 20, 30, 45, 60, 75, 90)
WIDE_SPANS = (10, 20, 30, 45, 60, 75, 90)
OTHERS = (3, 110, 180, 360)
"""Spans that the index does not serve."""

Request = tuple[str, int, Target]


def some(count: int, smallest: float) -> Iterator[Request]:
    """Motions of crank-rockers on no lattice, spans in turn, every third with uneven samples, some clockwise."""
    for number, span in zip(range(count), cycle((*SPANS, *OTHERS))):
        sign = -1 if number % 4 == 3 else 1
        samples = (32, 32, 32, 5, 100)[number % 5]
        uneven = number % 3 == 2
        yield str(span), number, reachable("short", number, sign * span, smallest, samples=samples, uneven=uneven)


def hard(count: int, smallest: float) -> Iterator[Request]:
    """Requests far from every row, or numerically hard, most of them over short spans."""
    for number, kind in zip(range(count), cycle(KINDS)):
        if kind in SHAPES:
            random = generator(f"short {kind}", number)
            crank = crank_angles(random, random.choice(SPANS) * random.choice([-1, 1]), uneven=bool(number % 3 == 2))
            yield kind, number, make_target(SHAPES[kind](random, crank / crank[-1]), crank_angle=crank)
        else:
            yield kind, number, hard_target(kind, 1000 + number, smallest)


def ties() -> Iterator[Request]:
    """Requests that many windows meet nearly alike, or two of a type exactly."""
    for number, span in enumerate((5, 20, 20.5, 60, 61, 99.9, 100)):
        crank = np.deg2rad(span) * np.linspace(0, 1, 3 + number)
        for slope in (0.0, 0.01, 0.2, -0.2, 1.0):
            yield "tie", number, make_target(slope * crank + 7, crank_angle=crank)
            yield "tie", number, make_target(slope * crank - 1e4, crank_angle=-crank)


def duels(
    ours: Scan, cells: Scan, requests: Iterator[Request], plain: Scan | None = None, twice: bool = True
) -> list[dict[str, Any]]:
    """Of each request: processor seconds of both, whether the index answered, and whether the answers are the same."""
    done = []
    for key, number, target in requests:
        times, answers = {ours: Times(), cells: Times()}, {}
        for scan in (ours, cells, cells, ours) if twice else (ours, cells):
            answers[scan] = times[scan].run(scan.best, target, TOP)
        wanted = [answers[cells]]
        if plain is not None:
            wanted.append(plain.best(target, TOP))
        windows, told = answers[ours]
        same = told.exhaustive and all(np.array_equal(*pair) for other, _ in wanted for pair in zip(windows, other))
        if not same:
            print(f"DIFFERS: {key} {number}: {windows} with the index, {wanted} without")
        new, old = times[ours].least.processor, times[cells].least.processor
        row = {"key": key, "same": same, "new": new, "old": old, "ratio": old / new, "plain": len(wanted) - 1}
        done.append(row | {"evaluated": told.evaluated, "limit": float(windows.error[-1])})
    return done


def summaries(duels: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Medians and 90 % of each key, in the order in which they occur."""
    found = []
    for key in dict.fromkeys(done["key"] for done in duels):
        rows = [done for done in duels if done["key"] == key]
        row: dict[str, Any] = {"key": key, "requests": len(rows), "differ": sum(not done["same"] for done in rows)}
        for column in ("new", "old", "ratio"):
            values = [done[column] for done in rows]
            row[column] = float(np.median(values))
            row[f"{column}_least"], row[f"{column}_90"] = float(min(values)), float(np.quantile(values, 0.9))
        row["at_90"] = row["old_90"] / row["new_90"]
        row["error"] = float(np.median([done["limit"] for done in rows]))
        found.append(row)
    return found


def prepared(file: Path, index: Path) -> tuple[Scan, Scan, dict[str, Any]]:
    """The scan with the index, that with cells alone, and what the index takes; all arrays mapped from files."""
    opened = la.load_atlas(file, max_types=NO_LIMIT, index=index)
    ours, times = opened.scan, Times()
    known = bool(ours.prepared.short_spans)
    times.run(ours.prepare_short_spans, Work())
    ours.threads = 1
    without = copy(ours.prepared)
    without.short_spans = []
    told = {"types": ours.types, "index": _sizes(ours.prepared.short_spans, ours.types)}
    told["index_s"] = None if known else times.median.processor
    return ours, Scan(without), told


def _sizes(indexes: list[Any], types: int) -> list[dict[str, Any]]:
    return [
        {
            "top": float(np.rad2deg(one.intervals.largest_span)),
            "intervals": one.intervals.number,
            "terms": one.intervals.terms,
        }
        | {"bytes": one.nbytes, "bytes_a_type": one.nbytes / types}
        for one in indexes
    ]


def measure_wide(file: Path | None, requests: int, smallest: float) -> dict[str, Any]:
    """The duels on the wider atlas, which is built unless it is there."""
    with tempfile.TemporaryDirectory() as folder:
        if file is None:
            file = Path(folder) / "wide.h5"
            build(file, order="full_crank", samples=128)
        ours, cells, told = prepared(file, file.with_name(f"{file.name}.index"))
        some = (
            (str(span), number, reachable("short wide", number, span, smallest, orders=number % 2 == 1))
            for span in WIDE_SPANS
            for number in range(requests)
        )
        rows = duels(ours, cells, some)
    return told | {"spans": summaries(rows), "made": report.stamp()}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The figures of docs/scaling.md."""
    served = [row for row in results["spans"] if 5 <= int(row["key"]) <= 90]
    wide = results["wide"]
    told = {
        "spans": f"{report.ends([1000 * row['new'] for row in served])} ms, by cells alone "
        f"{report.ends([1000 * row['old'] for row in served])} ms",
        "hard": f"{report.ends([row['ratio'] for row in results['hard']])} times as fast",
        "wide": f"{report.ends([row['ratio'] for row in wide['spans']])} times as fast" if wide else "not measured",
        "checked": f"Of {results['requests']:,} requests {results['differ']} answers differ from the plain scan's in a window, "
        "its place or a bit of its error",
    }
    told["stamps"] = report.made_text([part["made"] for part in (results, wide) if part])
    return told


def measure_default(atlas: Path, requests: int, hard_ones: int, smallest: float) -> dict[str, Any]:
    """The duels on the default atlas; all of its requests go to the plain scan too."""
    with tempfile.TemporaryDirectory() as folder:
        ours, cells, told = prepared(atlas, Path(folder) / "atlas.index")
        plain = Scan(load_atlas(atlas), cells=False, threads=os.cpu_count() or 1)
        done = {
            "spans": duels(ours, cells, some(requests, smallest), plain),
            "hard": duels(ours, cells, hard(hard_ones, smallest), plain),
            "ties": duels(ours, cells, ties(), plain),
        }
    everything = [one for part in done.values() for one in part]
    counted = {"requests": len(everything), "plain": sum(one["plain"] for one in everything)}
    counted["differ"] = sum(not one["same"] for one in everything)
    hard_rows = summaries(done["hard"]) + summaries(done["ties"])
    return {**told, **counted, "spans": summaries(done["spans"]), "hard": hard_rows, "made": report.stamp()}


def measure(
    atlas: Annotated[Path, "file of the default atlas"] = Path("atlas.h5"),
    requests: Annotated[int, "motions of linkages; 0: leave out the default atlas"] = 400,
    hard_ones: Annotated[int, "requests far from every row, or numerically hard"] = 200,
    wide: Annotated[int, "requests a span on the wider atlas; 0: leave it out"] = 6,
    wide_atlas: Annotated[Path | None, "its file, with its index beside it; default: build both"] = None,
) -> Iterator[dict[str, Any]]:
    """Both scans on one atlas, and on the wider one; exit code 1 if an answer differs. What is left out keeps its figures."""
    known = report.known("short_spans")
    rule = load_atlas(atlas).rule.types
    smallest = rule.smallest / rule.perimeter
    with threadpool_limits(1, "blas"):
        results = measure_default(atlas, requests, hard_ones, smallest) if requests else known
        gc.collect()
        on_wide = measure_wide(wide_atlas, wide, smallest) if wide else known.get("wide")
    yield {**results, "wide": on_wide}
    if results["differ"] + sum(row["differ"] for row in (on_wide or {"spans": []})["spans"]):
        raise SystemExit("answers differ")


if __name__ == "__main__":
    report.run(measure)
