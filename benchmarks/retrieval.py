"""The exact scan of an atlas against its baselines, in one run: the ten best windows of a requested rotation.

``python -m benchmarks.retrieval [--atlas FILE] [--requests 60] [--hard 200]`` ends with 1 if any answer differs from that of
the plain scan. Baselines (the last two are in `baselines`):

- *plain scan*: the same scan without its cells, which bounds every window of the atlas. Its answers must be identical.
- *flat index* (faiss): a table of all windows of one span, centred, float32. It answers that span alone, and only requests of
  its very crank angles. Single queries are what a service gets; a batch of all queries is what the index is best at.
- *stumpy mass*: the distance profile over each curve, z-normalised: another measure, so a baseline in speed only.

Times are wall clock on all cores; of each scan the best of two, taken alternately. Preparation is not counted.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks import report
from benchmarks.baselines import flat_index, stumpy_mass
from benchmarks.product import STARTS, TIE, Scan, Target, Windows, load_atlas, make_target
from benchmarks.report import Times, ms, repeat, significant, size, spread
from benchmarks.service import build
from tests.oracles.rotations import KINDS, SPANS, hard_target, reachable

TOP = 10
FLAT_SPAN, MASS_REQUESTS = 60, 3
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


def measure_wide(smallest: float, cores: int) -> tuple[dict[str, Any], int]:
    """The duels on the wider atlas (crank or ground the shortest, the others in all orders), and how many answers differ."""
    with tempfile.TemporaryDirectory() as folder:
        build(Path(folder) / "wide.h5", order="full_crank", samples=128)
        atlas = load_atlas(Path(folder) / "wide.h5")
    ours, plain = Scan(atlas, threads=cores), Scan(atlas, threads=cores, cells=False)
    some = ((str(s), n, reachable("wide", n, s, smallest, orders=True)) for n, s in enumerate(2 * SPANS))
    done = duels(ours, plain, some)
    told = {"types": len(atlas), "windows": ours.windows, "scan_bytes": ours.nbytes, "spans": summaries(done, SPANS)}
    return told, sum(not one["same"] for one in done)


def file_figures(results: dict[str, Any]) -> str:
    """The table of docs/file_format.md; what concerns build and service comes from `growth` and `throughput`."""
    built = next(row for row in report.load("growth")["rows"] if row["types"] == results["types"])
    loaded = report.load("throughput")["services"][0]
    atlas = results["parts"]["atlas"]

    def between(seconds: Sequence[float]) -> str:
        ends = dict.fromkeys(significant(1000 * value, 2) for value in (min(seconds), max(seconds)))
        return " to ".join(ends) + " ms"

    faster = ""
    if "one_by_one_ratio" in atlas:
        faster = f"; {significant(atlas['one_by_one_ratio'], 1)} times less work than one window at a time"
    medians = {name: [part["ours"]["median"] for part in results[name].values()] for name in ("spans", "joint")}
    million = f"scan of {results['windows'] / 1e6:.0f} million windows, exact, spans {SPANS[0]}..{SPANS[-1]} degrees"
    rows = [
        ["build", f"{significant(built['build_s'], 2)} s, largest process {size(built['build_peak_bytes'])}"],
        ["file", size(built["file_bytes"])],
        ["load and verify", report.duration(atlas["load_s"])],
        [
            "prepare the scan, one thread",
            f"{significant(atlas['prepare_s'], 2)} s, {size(atlas['scan_bytes'])}; "
            f"the details stay in memory with {size(atlas['details_bytes'])}",
        ],
        ["the series for requests with positions, behind the readiness", f"{size(atlas['positions_bytes'])} more"],
        [
            "service with an index: start until ready",
            f"{significant(built['ready_s'], 2)} s; {size(built['resident_bytes'])} then, "
            f"{size(built['asked_bytes'])} after requests; {size(loaded['bytes'])} with positions",
        ],
        [million, between(medians["spans"]) + faster],
        ["the same with positions", between(medians["joint"])],
        ["positions only", between(list(atlas["position_only"].values()))],
    ]
    return report.lines(["what", "figure"], rows, 2)


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """By span, the other baselines, hard requests (docs/scaling.md); and figures of docs/file_format.md."""

    def between(parts: dict[str, Any], column: str = "ours") -> str:
        medians = [part[column]["median"] * (1 if column == "ratio" else 1000) for part in parts.values()]
        return report.ends(medians, 0)

    flat, mass, wide = (results[name] for name in ("flat_index", "stumpy_mass", "wide"))
    ours = results["flat_requests"]["ours"]["median"]
    cores = results["made"]["machine"]["cores"]
    others = [f"the scan takes {ms(ours)} ms"]
    if flat:
        part = "" if flat["every_nth_start"] == 1 else f" from every {flat['every_nth_start']}th start"
        single, batch = ms(flat["single_s"]["median"]), ms(flat["batch_s_each"])
        others.append(
            f"a flat index of this span alone ({flat['bytes'] / 1e9:.1f} GB{part}) {single} ms a query, {batch} ms in a batch"
        )
    if mass:
        others.append(
            f"stumpy's mass over {mass['curves']:,} curves, by another measure, {ms(mass['seconds']['median'])} ms"
        )
    return {
        "sizes": f"{results['types']:,} types, {results['windows']:,} windows, the best {TOP}; wall clock on {cores} cores.",
        **report.tables("retrieval", {"spans": [{"key": key, **part} for key, part in results["spans"].items()]}),
        "wide": f"{wide['types']:,} types in {between(wide['spans'])} ms, {between(wide['spans'], 'ratio')} times faster",
        "others": ", ".join(others),
        "hard": f"{between(results['hard'])} ms, {between(results['hard'], 'ratio')} times faster",
        "file": file_figures(results),
        "file_made": report.made_text([results["made"], results["parts"]["atlas"].get("made", results["made"])]),
    }


def measure(
    atlas: Annotated[Path, "file of the default atlas"] = Path("atlas.h5"),
    requests: Annotated[int, "reachable ones, and as many for the flat index"] = 60,
    hard: Annotated[int, "requests far from every row, or numerically hard"] = 200,
) -> Iterator[dict[str, Any]]:
    """All scans and indices on one atlas, and the scans on the wider one; exit code 1 if an answer differs."""
    file, cores = atlas, os.cpu_count() or 1
    atlas = load_atlas(file)
    smallest = atlas.rule.types.smallest / atlas.rule.types.perimeter
    ours, plain = Scan(atlas, threads=cores), Scan(atlas, threads=cores, cells=False)
    turns = [(seed, SPANS[seed % len(SPANS)]) for seed in range(requests)]
    flat = [reachable("flat", seed, FLAT_SPAN, smallest) for seed in range(requests)]
    hard_ones = [(KINDS[number % len(KINDS)], number // len(KINDS)) for number in range(hard)]
    groups: dict[str, Requests] = {
        "spans": ((str(s), n, reachable("span", n, s, smallest, uneven=n // len(SPANS) % 3 == 2)) for n, s in turns),
        "joint": ((str(s), n, reachable("joint", n, s, smallest, positions=True)) for n, s in turns),
        "flat": (("flat", n, target) for n, target in enumerate(flat)),
        "hard": ((kind, n, hard_target(kind, n, smallest)) for kind, n in hard_ones),
    }
    with threadpool_limits(1, "blas"):  # as the service does: threads are the scan's own
        done = {name: duels(ours, plain, some) for name, some in groups.items()}
        parts = {"atlas": measure_atlas(file, smallest, cores)}
        wide, differ_wide = measure_wide(smallest, cores)
    everything = [one for part in done.values() for one in part]
    worst = min(everything, key=lambda one: one["ratio"])
    if indexed := flat_index(atlas, flat, TOP, cores):
        indexed["single_s"] = spread(indexed["single_s"])
        ids = [set(zip(*(column.tolist() for column in one["windows"][:3]))) for one in done["flat"]]
        for found, same in (("found", "same_windows"), ("found_in_batch", "same_windows_in_batch")):
            indexed[same] = sum(one == two for one, two in zip(indexed.pop(found), ids))
    motions = [reachable("mass", seed, FLAT_SPAN, smallest, samples=FLAT_SPAN + 1) for seed in range(MASS_REQUESTS)]
    if profiled := stumpy_mass(atlas, [target.rotation for target in motions], cores):
        profiled["seconds"] = spread(profiled["seconds"])
    differ = sum(not one["same"] for one in everything) + differ_wide
    yield {
        "types": len(atlas),
        "windows": ours.windows,
        "scan_bytes": ours.nbytes,
        "plain_scan_bytes": plain.nbytes,
        "differ": differ,
        "spans": summaries(done["spans"], SPANS),
        "joint": summaries(done["joint"], SPANS),
        "hard": summaries(done["hard"], KINDS),
        "flat_requests": summary(done["flat"]),
        "flat_index": indexed,
        "stumpy_mass": profiled,
        "worst": {name: worst[name] for name in ("key", "seed", "ours", "plain", "evaluated")},
        "wide": wide,
        "parts": parts,
    }
    if differ:
        raise SystemExit(f"{differ} answers differ from those of the plain scan")


if __name__ == "__main__":
    report.run(measure)
