"""The exact scan of an atlas against the plain scan, in one run: the ten best windows of a requested rotation.

``python -m benchmarks.retrieval [--atlas FILE] [--requests 60] [--hard 200]`` ends with 1 if any answer differs. The plain scan
has neither cells nor the index of short spans: it bounds every window of the atlas.

Times are wall clock on all cores; of each scan the best of two, taken alternately. Preparation is not counted.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks import report
from benchmarks.product import STARTS, TIE, Scan, Target, Windows, Work, load_atlas, make_target
from benchmarks.report import Times, repeat, significant, size, spread
from tests.oracles import rotations
from tests.oracles.rotations import KINDS, hard_target, reachable

TOP = 10
SPANS = (5, 10, *rotations.SPANS)
NAIVE_SPAN, NAIVE_TYPES = 60, 500
POSITION_SPANS = (20, 100, 300)


Requests = Iterator[tuple[str, int, Target]]
"""What a request is counted with (a span or a kind), its number, the request."""


def duels(ours: Scan, plain: Scan, requests: Requests) -> list[dict[str, Any]]:
    """Of each request: seconds of both scans, the best of two, windows evaluated, and whether the answers are the same."""
    done = []
    for key, seed, target in requests:
        times, answers = {ours: Times(), plain: Times()}, {}
        for scan in (ours, plain, plain, ours):
            answers[scan] = times[scan].run(scan.best, target, TOP)
        (windows, told), (wanted, wanted_told) = answers[ours], answers[plain]
        same = told.exhaustive and all(np.array_equal(*pair) for pair in zip(windows[:3], wanted[:3]))
        # a fit of positions is a matrix product, whose last bits depend on how many windows are evaluated at a time
        near = 0 if target.position is None else TIE
        same = same and bool(np.all(np.abs(windows.error - wanted.error) <= near))
        if not same:
            print(f"DIFFERS: {key} {seed}: {windows} by the scan, {wanted} by the plain scan")
        mine, other = times[ours].least.wall, times[plain].least.wall
        row = {"key": key, "seed": seed, "same": same, "windows": windows, "ours": mine, "plain": other}
        row |= {"ratio": other / mine, "evaluated": told.evaluated, "evaluated_plain": wanted_told.evaluated}
        done.append(row)
    return done


def summary(duels: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """What is told of some requests."""
    columns = ("ours", "plain", "ratio", "evaluated", "evaluated_plain")
    told = {column: spread([done[column] for done in duels]) for column in columns}
    return {"requests": len(duels), "differ": sum(not done["same"] for done in duels), **told}


def summaries(duels: Sequence[dict[str, Any]], keys: Sequence[Any]) -> dict[str, Any]:
    """`summary` of each key that occurs."""
    groups = {str(key): [done for done in duels if done["key"] == str(key)] for key in keys}
    return {key: summary(group) for key, group in groups.items() if group}


def measure_atlas(file: Path, smallest: float, cores: int) -> dict[str, Any]:
    """Loading and preparing; requests of positions alone; how many times the processor works for each window one by one."""
    atlas = load_atlas(file)
    found = {
        "load_s": repeat(lambda: load_atlas(file)).median.wall,
        "prepare_s": repeat(lambda: Scan(atlas), 3, warm_up=0).median.wall,
        "details_bytes": atlas.details.nbytes,
    }
    scan = Scan(atlas, threads=cores)
    found["scan_bytes"] = scan.nbytes
    for span in POSITION_SPANS:
        target = reachable("position", span, span, smallest, positions=True)
        target = make_target(None, target.position, crank_angle=target.crank)
        seconds = repeat(lambda target=target: scan.best(target, TOP), 3).median.wall
        found.setdefault("position_only", {})[str(span)] = seconds
    found["positions_bytes"] = scan.nbytes - found["scan_bytes"]  # prepared by the first request with positions
    rows = np.linspace(0, len(atlas) - 1, NAIVE_TYPES).astype(int)
    row, start, branch = (v.ravel() for v in np.meshgrid(rows, np.arange(STARTS), [1, -1], indexing="ij"))
    windows, target = Windows(row, start, branch, np.zeros(row.size)), reachable("naive", 0, NAIVE_SPAN, smallest)
    naive = repeat(lambda: scan.errors(target, windows), 1, warm_up=0).median.processor
    ours = repeat(lambda: scan.best(target, TOP)).median.processor
    return found | {"one_by_one_ratio": naive * len(atlas) / NAIVE_TYPES / ours}


def file_figures(results: dict[str, Any]) -> str:
    """The table of docs/file_format.md: what no table of docs/scaling.md has."""
    atlas = results["parts"]["atlas"]

    def between(seconds: Sequence[float]) -> str:
        ends = dict.fromkeys(significant(1000 * value, 2) for value in (min(seconds), max(seconds)))
        return " to ".join(ends) + " ms"

    joint = [part["ours"]["median"] for part in results["joint"].values()]
    rows = [
        ["load and verify", report.duration(atlas["load_s"])],
        [
            "prepare the scan, one thread",
            f"{significant(atlas['prepare_s'], 2)} s, {size(atlas['scan_bytes'])}; "
            f"the details stay in memory with {size(atlas['details_bytes'])}",
        ],
        ["the series for requests with positions, behind the readiness", f"{size(atlas['positions_bytes'])} more"],
        [f"scan with positions, exact, spans {SPANS[0]}..{SPANS[-1]} degrees", between(joint)],
        ["positions only", between(list(atlas["position_only"].values()))],
    ]
    if "one_by_one_ratio" in atlas:
        rows.append(
            ["one window at a time", f"{significant(atlas['one_by_one_ratio'], 1)} times the work of the scan"]
        )
    return report.lines(["what", "figure"], rows, 2)


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """By span, hard requests (docs/scaling.md); and figures of docs/file_format.md."""

    def between(parts: dict[str, Any], column: str = "ours") -> str:
        medians = [part[column]["median"] * (1 if column == "ratio" else 1000) for part in parts.values()]
        return report.ends(medians, 0)

    cores = results["made"]["machine"]["cores"]
    return {
        "sizes": f"{results['types']:,} types, {results['windows']:,} windows, the best {TOP}; wall clock on {cores} cores.",
        **report.tables("retrieval", {"spans": [{"key": key, **part} for key, part in results["spans"].items()]}),
        "hard": f"{between(results['hard'])} ms, {between(results['hard'], 'ratio')} times faster",
        "file": file_figures(results),
    }


def measure(
    atlas: Annotated[Path, "file of the default atlas"] = Path("atlas.h5"),
    requests: Annotated[int, "reachable ones"] = 60,
    hard: Annotated[int, "requests far from every row, or numerically hard"] = 200,
) -> Iterator[dict[str, Any]]:
    """Both scans on one atlas; exit code 1 if an answer differs."""
    file, cores = atlas, os.cpu_count() or 1
    atlas = load_atlas(file)
    smallest = atlas.rule.types.smallest / atlas.rule.types.perimeter
    ours, plain = Scan(atlas, threads=cores), Scan(atlas, threads=cores, cells=False)
    ours.prepare_short_spans(Work())
    turns = [(seed, SPANS[seed % len(SPANS)]) for seed in range(requests)]
    hard_ones = [(KINDS[number % len(KINDS)], number // len(KINDS)) for number in range(hard)]
    groups: dict[str, Requests] = {
        "spans": ((str(s), n, reachable("span", n, s, smallest, uneven=n // len(SPANS) % 3 == 2)) for n, s in turns),
        "joint": ((str(s), n, reachable("joint", n, s, smallest, positions=True)) for n, s in turns),
        "hard": ((kind, n, hard_target(kind, n, smallest)) for kind, n in hard_ones),
    }
    with threadpool_limits(1, "blas"):  # as the service does: threads are the scan's own
        done = {name: duels(ours, plain, some) for name, some in groups.items()}
        parts = {"atlas": measure_atlas(file, smallest, cores)}
    everything = [one for part in done.values() for one in part]
    worst = min(everything, key=lambda one: one["ratio"])
    differ = sum(not one["same"] for one in everything)
    yield {
        "types": len(atlas),
        "windows": ours.windows,
        "scan_bytes": ours.nbytes,
        "plain_scan_bytes": plain.nbytes,
        "differ": differ,
        "spans": summaries(done["spans"], SPANS),
        "joint": summaries(done["joint"], SPANS),
        "hard": summaries(done["hard"], KINDS),
        "worst": {name: worst[name] for name in ("key", "seed", "ours", "plain", "evaluated")},
        "parts": parts,
    }
    if differ:
        raise SystemExit(f"{differ} answers differ from those of the plain scan")


if __name__ == "__main__":
    report.run(measure)
