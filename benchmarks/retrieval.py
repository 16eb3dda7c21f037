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

import argparse
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from benchmarks import report
from benchmarks.baselines import flat_index, stumpy_mass
from benchmarks.product import (
    MIN_SPAN,
    TIE,
    TURN,
    Atlas,
    Scan,
    Target,
    Windows,
    coupler_angle,
    load_atlas,
    make_target,
)
from benchmarks.report import paired, spread
from benchmarks.service import build
from tests.oracles.classes import SAMPLES, base_order, generator

Floats = NDArray[np.float64]

TOP = 10
WIDE_REQUESTS = 16
"""Requests to the wide atlas, of which the plain scan takes seconds each."""
SPANS = (20, 30, 60, 100, 150, 200, 250, 300)
FLAT_SPAN = 60
MASS_REQUESTS = 3


# -- requests ---------------------------------------------------------------------------------------------------------


def atlas_lengths(random: Generator, smallest: float) -> Floats:
    """Lengths of a crank-rocker of perimeter 1 with ``smallest`` <= L1 < L2 < L3 < L4, uniform: on no lattice."""
    while (lengths := base_order(random))[0] < smallest:
        pass
    return lengths


def folding_lengths(random: Generator) -> Floats:
    """Lengths of a crank-rocker that almost folds: L1 + L4 is below L2 + L3 by 1e-9 to 1e-3 of the perimeter."""
    while True:
        l1, l2, l3, _ = base_order(random)
        l4 = l2 + l3 - l1 - 10.0 ** random.uniform(-9, -3)
        if l4 > l3:
            return np.array([l1, l2, l3, l4])


def crank_angles(random: Generator, span_deg: float, samples: int = SAMPLES, uneven: bool = False) -> Floats:
    """Crank increments (samples,) in radians, from 0 on; uneven steps differ by up to a factor of nine."""
    steps = random.uniform(0.2, 1.8, samples - 1) if uneven else np.ones(samples - 1)
    crank = np.concatenate([[0.0], np.cumsum(steps)])
    return crank / crank[-1] * np.deg2rad(span_deg)


def any_order(random: Generator, smallest: float) -> Floats:
    """Lengths as by `atlas_lengths`, the crank or the ground the shortest, the other three in any order."""
    shortest, *others = atlas_lengths(random, smallest)
    others = random.permutation(others)
    return np.array([shortest, *others] if random.random() < 0.5 else [*others, shortest])


def motion_of(
    random: Generator, lengths: Floats, crank: Floats, start: float | None = None, positions: bool = False
) -> Target:
    """The motion of a linkage's coupler, from a random start and on a random branch unless told."""
    start = random.uniform(0, TURN) if start is None else start
    angle = coupler_angle(lengths, random.choice([-1, 1]), start + crank)
    rotation = angle + random.uniform(-9, 9)
    if not positions:
        return make_target(rotation, crank_angle=crank)
    arm = random.uniform(0.2, 2) * lengths[1] * np.exp(1j * random.uniform(0, TURN))
    point = lengths[0] * np.exp(1j * (start + crank)) + arm * np.exp(1j * angle)
    return make_target(rotation, point, crank_angle=crank)


def _waves(random: Generator, share: Floats) -> Floats:
    number = np.arange(1, 7)[:, None]
    wave = random.standard_normal(6) @ np.cos(np.pi * number * share + random.uniform(0, TURN, (6, 1)))
    return wave / np.max(np.abs(wave))


SHAPES: dict[str, Callable[[Generator, Floats], Floats]] = {
    "cosines": lambda random, x: random.uniform(0.1, 5) * _waves(random, x),
    "steps": lambda random, x: (
        random.uniform(0.1, 5) * np.searchsorted(np.sort(random.uniform(0, 1, random.integers(1, 5))), x)
    ),
    "saw teeth": lambda random, x: random.uniform(0.1, 5) * (random.integers(1, 9) * x % 1.0),
    "constant": lambda random, x: np.full(x.size, random.uniform(-9, 9)),
    "noise": lambda random, x: random.uniform(0.1, 5) * random.standard_normal(x.size),
    "huge": lambda random, x: 10.0 ** random.uniform(3, 5) * _waves(random, x),
    "line": lambda random, x: random.uniform(-5, 5) * x,
}
"""Rotations that come from no linkage, in radians over the share of the span."""
KINDS = (*SHAPES, "change point", "tiny span", "full turn", "almost full turn", "3 samples", "1,000 samples")


def hard_target(kind: str, seed: int, smallest: float) -> Target:
    """A request that is far from every row, or near what makes a scan inexact; the same for the same arguments."""
    random = generator(f"retrieval {kind}", seed)
    span, samples = float(random.choice(SPANS)) * random.choice([-1, 1]), SAMPLES
    if kind == "tiny span":
        span = np.exp(random.uniform(np.log(1.001 * np.rad2deg(MIN_SPAN)), np.log(5)))
    elif kind in ("full turn", "almost full turn"):
        span = 360.0 if kind == "full turn" else 359.9
    elif kind in ("3 samples", "1,000 samples"):
        samples = 3 if kind == "3 samples" else 1000
    crank = crank_angles(random, span, samples, uneven=bool(seed % 3 == 2))
    if kind in SHAPES:
        return make_target(SHAPES[kind](random, crank / crank[-1]), crank_angle=crank)
    if kind == "change point":  # with the fold, at theta1 = pi, inside the span
        return motion_of(random, folding_lengths(random), crank, np.pi - random.uniform(0, 1) * crank[-1])
    if seed % 2:
        return make_target(SHAPES["cosines"](random, crank / crank[-1]), crank_angle=crank)
    return motion_of(random, atlas_lengths(random, smallest), crank)


# -- scans ------------------------------------------------------------------------------------------------------------


class Duel(NamedTuple):
    """One request asked of both scans."""

    kind: str
    seed: int
    ours: float
    plain: float
    evaluated: int
    evaluated_plain: int
    same: bool
    windows: Windows

    @property
    def ratio(self) -> float:
        """How many times the plain scan takes."""
        return self.plain / self.ours


class Scans(NamedTuple):
    """The scan and the plain scan of one atlas."""

    atlas: Atlas
    ours: Scan
    plain: Scan

    @classmethod
    def of(cls, file: Path, cores: int) -> Scans:
        atlas = load_atlas(file)
        return cls(atlas, Scan(atlas, threads=cores), Scan(atlas, threads=cores, cells=False))

    @property
    def smallest(self) -> float:
        """The shortest link of the atlas over the perimeter."""
        return self.atlas.rule.types.smallest / self.atlas.rule.types.perimeter

    def duel(self, kind: str, seed: int, target: Target) -> Duel:
        """Seconds of both, each the best of two, and whether their answers are identical."""
        answers = {}

        def ask(scan: Scan) -> None:
            answers[scan] = scan.best(target, TOP)

        ours, plain = paired([lambda: ask(self.ours), lambda: ask(self.plain)], rounds=2, warm_up=0)
        (windows, told), (wanted, wanted_told) = answers[self.ours], answers[self.plain]
        same = told.exhaustive and all(np.array_equal(*pair) for pair in zip(windows[:3], wanted[:3]))
        # a fit of positions is a matrix product, whose last bits depend on how many windows are evaluated at a time
        near = 0 if target.position is None else TIE
        same = same and bool(np.all(np.abs(windows.error - wanted.error) <= near))
        if not same:
            print(f"DIFFERS: {kind} {seed}: {windows} by the scan, {wanted} by the plain scan")
        seconds = ours.least.wall, plain.least.wall
        return Duel(kind, seed, *seconds, told.evaluated, wanted_told.evaluated, same, windows)

    def by(self, name: str, requests: Iterator[tuple[str, int, Target]]) -> dict[str, list[Duel]]:
        """Duels over requests (key, seed, target), by key."""
        found: dict[str, list[Duel]] = {}
        for key, seed, target in requests:
            found.setdefault(key, []).append(self.duel(name or key, seed, target))
        return found


def summary(duels: Sequence[Duel]) -> dict[str, Any]:
    """What is told of some requests: seconds of both, their ratio, and windows evaluated exactly."""
    columns = ("ours", "plain", "ratio", "evaluated", "evaluated_plain")
    told = {column: spread([getattr(done, column) for done in duels]) for column in columns}
    return {"requests": len(duels), "differ": sum(not done.same for done in duels), **told}


def summaries(duels: dict[str, list[Duel]]) -> dict[str, Any]:
    """`summary` of each key; spans in order."""
    keys = sorted(duels, key=int) if all(key.isdigit() for key in duels) else duels
    return {key: summary(duels[key]) for key in keys}


def spans(
    requests: int, name: str, make: Callable[[Generator, int, int], Target]
) -> Iterator[tuple[str, int, Target]]:
    """Requests over `SPANS` in turn."""
    for seed in range(requests):
        span = SPANS[seed % len(SPANS)]
        yield str(span), seed, make(generator(f"retrieval {name}", seed), span, seed)


def measure_wide(cores: int) -> dict[str, Any]:
    """The same duel on the wider atlas: crank or ground the shortest, the others in all orders; built for it."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "wide.h5"
        build(file, order="full_crank", samples=128)
        both = Scans.of(file, cores)

    def motion(random: Generator, span: int, seed: int) -> Target:
        return motion_of(random, any_order(random, both.smallest), crank_angles(random, span))

    with threadpool_limits(1, "blas"):
        duels = both.by("wide", spans(WIDE_REQUESTS, "wide", motion))
    return {
        "types": len(both.atlas),
        "windows": both.ours.windows,
        "scan_bytes": both.ours.nbytes,
        "spans": summaries(duels),
    }


def measure(file: Path, requests: int, hard: int, cores: int) -> dict[str, Any]:
    """All of it."""
    both = Scans.of(file, cores)

    def motion(random: Generator, span: int, seed: int) -> Target:
        uneven = seed // len(SPANS) % 3 == 2
        return motion_of(random, atlas_lengths(random, both.smallest), crank_angles(random, span, uneven=uneven))

    def with_positions(random: Generator, span: int, seed: int) -> Target:
        lengths = atlas_lengths(random, both.smallest)
        return motion_of(random, lengths, crank_angles(random, span), positions=True)

    def at_flat_span(name: str, seed: int, samples: int) -> Target:
        random = generator(f"retrieval {name}", seed)
        return motion_of(random, atlas_lengths(random, both.smallest), crank_angles(random, FLAT_SPAN, samples))

    flat_targets = [at_flat_span("flat", seed, SAMPLES) for seed in range(requests)]
    mass_targets = [at_flat_span("mass", seed, FLAT_SPAN + 1) for seed in range(MASS_REQUESTS)]
    places = (divmod(number, len(KINDS)) for number in range(hard))
    hard_ones = ((KINDS[place], seed, hard_target(KINDS[place], seed, both.smallest)) for seed, place in places)
    with threadpool_limits(1, "blas"):  # as the service does: threads are the scan's own
        by_span = both.by("reachable", spans(requests, "span", motion))
        joint = both.by("joint", spans(requests, "joint", with_positions))
        flat = both.by("flat", (("flat", seed, target) for seed, target in enumerate(flat_targets)))["flat"]
        by_kind = both.by("", hard_ones)
    everything = [done for part in (*by_span.values(), *joint.values(), flat, *by_kind.values()) for done in part]
    worst = min(everything, key=lambda done: done.ratio)
    if indexed := flat_index(both.atlas, flat_targets, TOP, cores):
        indexed["single_s"] = spread(indexed["single_s"])
        for found, same in (("found", "same_windows"), ("found_in_batch", "same_windows_in_batch")):
            pairs = zip(indexed.pop(found), flat)
            indexed[same] = sum(ids == _window_ids(done.windows) for ids, done in pairs)
    if profiled := stumpy_mass(both.atlas, [target.rotation for target in mass_targets], cores):
        profiled["seconds"] = spread(profiled["seconds"])
    wide = measure_wide(cores)
    return {
        "types": len(both.atlas),
        "windows": both.ours.windows,
        "scan_bytes": both.ours.nbytes,
        "plain_scan_bytes": both.plain.nbytes,
        "differ": sum(not done.same for done in everything) + sum(part["differ"] for part in wide["spans"].values()),
        "spans": summaries(by_span),
        "joint": summaries(joint),
        "flat_requests": summary(flat),
        "flat_index": indexed,
        "stumpy_mass": profiled,
        "hard": summaries(by_kind),
        "worst": {name: getattr(worst, name) for name in ("kind", "seed", "ours", "plain", "evaluated")},
        "wide": wide,
    }


def _window_ids(windows: Windows) -> set[tuple[int, int, int]]:
    return {(int(row), int(start), int(branch)) for row, start, branch, _ in zip(*windows)}


# -- document ---------------------------------------------------------------------------------------------------------


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """By span, the other baselines, hard requests (docs/scaling.md), and the headline of README.md."""

    def ms(seconds: float) -> str:
        return f"{1000 * seconds:,.1f}"

    def duels(name: str, parts: dict[str, Any]) -> str:
        columns = {
            name: "{key}",
            "requests": "{requests}",
            "ms": lambda row: ms(row["ours"]["median"]),
            "max": lambda row: ms(row["ours"]["max"]),
            "plain ms": lambda row: ms(row["plain"]["median"]),
            "plain max": lambda row: ms(row["plain"]["max"]),
            "plain / ours": "{ratio[median]:.2f}",
            "least": "{ratio[min]:.2f}",
            "evaluated": "{evaluated[median]:,.0f}",
            "differ": "{differ}",
        }
        return report.table([{"key": key, **part} for key, part in parts.items()], columns)

    flat, mass, worst, wide = (results[name] for name in ("flat_index", "stumpy_mass", "worst", "wide"))
    ours = results["flat_requests"]["ours"]["median"]
    cores = results["made"]["machine"]["cores"]
    others, same = [["scan", ms(ours), "any span, any crank angles"]], ""
    if flat:
        part = "" if flat["every_nth_start"] == 1 else f", from every {flat['every_nth_start']}th start"
        held = f"this span only, a table of {flat['bytes'] / 1e9:.1f} GB{part}"
        others.append(["flat index, single query", ms(flat["single_s"]["median"]), held])
        others.append(["flat index, all in one batch", ms(flat["batch_s_each"]), held])
        if flat["every_nth_start"] == 1:
            same = (
                f"\n\nIn single precision, the flat index finds the {TOP} windows of the scan for {flat['same_windows']} of"
                f" {flat['requests']} single queries, for {flat['same_windows_in_batch']} in a batch."
            )
    if mass:
        others.append(
            ["stumpy mass", ms(mass["seconds"]["median"]), f"another measure; from {mass['curves']:,} curves"]
        )
    medians = [part["ours"]["median"] for part in results["spans"].values()]
    ratios = [part["ratio"]["median"] for part in results["spans"].values()]
    headline = (
        f"{results['types']:,} types at 720 starts each, for any span, in {1000 * min(medians):.0f} to "
        f"{1000 * max(medians):.0f} ms on {cores} cores: {min(ratios):.0f} to {max(ratios):.0f} times faster than bounding "
        "all windows by matrix products"
    )
    if flat:
        times = report.significant(flat["single_s"]["median"] / ours, 2)
        headline += f", {times} times faster than a single query of a flat index made for one span"
    return {
        "sizes": f"{results['types']:,} types, {results['windows']:,} windows, the best {TOP}; wall clock on {cores} cores.",
        "spans": duels("span", results["spans"]),
        "joint": duels("span", results["joint"]),
        "wide_sizes": f"{wide['types']:,} types, {wide['windows']:,} windows",
        "wide": duels("span", wide["spans"]),
        "others": report.lines([f"at {FLAT_SPAN} degrees", "ms a request", "what it answers"], others) + same,
        "hard": duels("kind", results["hard"]),
        "worst": f"The worst: {worst['kind']} (number {worst['seed']}), {ms(worst['ours'])} ms, "
        f"the plain scan {ms(worst['plain'])} ms.",
        "headline": headline,
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and publish; 1 if an answer differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--atlas", type=Path, default=Path("atlas.h5"))
    parser.add_argument("--requests", type=int, default=60, help="reachable ones, and as many for the flat index")
    parser.add_argument("--hard", type=int, default=200, help="requests far from every row, or numerically hard")
    options = parser.parse_args(arguments)
    results = measure(options.atlas, options.requests, options.hard, os.cpu_count() or 1)
    report.publish("retrieval", results)
    print(f"{results['differ']} answers differ from those of the plain scan")
    return 1 if results["differ"] else 0


if __name__ == "__main__":
    raise SystemExit(main())
