"""The exact scan of an atlas against its opponents, in one run: the ten best windows of a requested rotation.

``python -m benchmarks.retrieval [--atlas FILE] [--requests 60] [--hard 200]`` prints tables, writes
``benchmarks/results/retrieval.json`` and the part between the ``retrieval`` markers of ``docs/scaling.md``; ``--redraw``
does the latter from the stored result. It ends with 1 if any answer differs from that of the plain scan.

Opponents (the last two are in `opponents`):

- *plain scan*: the same scan without its cells, which bounds every window of the atlas. Its answers must be identical.
- *flat index* (faiss): a table of all windows of one span, centred, float32. It answers that span alone, and only requests of
  its very crank angles. Single queries are what a service gets; a batch of all queries is what the index is best at.
- *stumpy mass*: the distance profile over each curve, z-normalised: another measure, so an opponent in speed only.

Times are wall clock on all cores; of each scan the best of two, taken alternately. Preparation is not counted.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from benchmarks import scaling
from benchmarks.classes import SAMPLES, base_order, generator
from benchmarks.opponents import flat_index, stumpy_mass
from benchmarks.service import machine
from synthesis.atlas.file import Atlas, load_atlas
from synthesis.atlas.scan import TIE, Scan, Windows
from synthesis.fourbar.kinematics import TURN, coupler_angle
from synthesis.target import MIN_SPAN, Target, make_target

Floats = NDArray[np.float64]

RESULT = Path(__file__).parent / "results" / "retrieval.json"
PAGE = Path(__file__).parents[1] / "docs" / "scaling.md"

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


def duel(kind: str, seed: int, target: Target, ours: Scan, plain: Scan) -> Duel:
    """Seconds of both, each the best of two, and whether their answers are identical."""
    seconds, answers = {ours: np.inf, plain: np.inf}, {}
    for order in ((ours, plain), (plain, ours)):
        for scan in order:
            begin = time.perf_counter()
            answers[scan] = scan.best(target, TOP)
            seconds[scan] = min(seconds[scan], time.perf_counter() - begin)
    (windows, report), (wanted, wanted_report) = answers[ours], answers[plain]
    same = report.exhaustive and all(np.array_equal(*pair) for pair in zip(windows[:3], wanted[:3]))
    # a fit of positions is a matrix product, whose last bits depend on how many windows are evaluated at a time
    unlike = np.abs(windows.error - wanted.error) > (0 if target.position is None else TIE) if same else np.ones(1)
    same = same and not unlike.any()
    done = Duel(kind, seed, seconds[ours], seconds[plain], report.evaluated, wanted_report.evaluated, same, windows)
    if not same:
        print(f"DIFFERS: {kind} {seed}: {windows} by the scan, {wanted} by the plain scan")
    return done


def spread(values: Sequence[float]) -> dict[str, float]:
    """Least, median, 99th percentile, largest."""
    quantiles = np.quantile(values, [0, 0.5, 0.99, 1])
    return {name: float(f"{value:.5g}") for name, value in zip(("min", "median", "p99", "max"), quantiles)}


def summary(duels: Sequence[Duel]) -> dict[str, Any]:
    """What is told of some requests: seconds of both, their ratio, and windows evaluated exactly."""
    columns = ("ours", "plain", "ratio", "evaluated", "evaluated_plain")
    told = {column: spread([getattr(done, column) for done in duels]) for column in columns}
    return {"requests": len(duels), "differ": sum(not done.same for done in duels), **told}


# -- report -----------------------------------------------------------------------------------------------------------


def tables(told: dict[str, Any]) -> str:
    """The result as markdown: by span, the other opponents, hard requests."""

    def ms(seconds: float) -> str:
        return f"{1000 * seconds:,.1f}"

    def table(name: str, parts: dict[str, Any]) -> str:
        lines = [
            f"| {name} | requests | ms | max | plain ms | max | plain / ours | least | evaluated | differ |",
            "|---|" + "--:|" * 9,
        ]
        for key, part in parts.items():
            cells = [str(part["requests"])]
            cells += [ms(part[who][column]) for who in ("ours", "plain") for column in ("median", "max")]
            cells += [f"{part['ratio'][column]:.2f}" for column in ("median", "min")]
            cells += [f"{part['evaluated']['median']:,.0f}", str(part["differ"])]
            lines.append(f"| {key} | {' | '.join(cells)} |")
        return "\n".join(lines)

    flat, mass, worst = told["flat_index"], told["stumpy_mass"], told["worst"]
    same = ""
    others = [f"| scan | {ms(told['flat_requests']['ours']['median'])} | any span, any crank angles |"]
    if flat:
        part = "" if flat["every_nth_start"] == 1 else f", from every {flat['every_nth_start']}th start"
        held = f"this span only, a table of {flat['bytes'] / 1e9:.1f} GB{part}"
        others.append(f"| flat index, single query | {ms(flat['single_s']['median'])} | {held} |")
        others.append(f"| flat index, all in one batch | {ms(flat['batch_s_each'])} | {held} |")
        if flat["every_nth_start"] == 1:
            same = (
                f"\nIn single precision, the flat index finds the {TOP} windows of the scan for {flat['same_windows']} of"
                f" {flat['requests']} single queries, for {flat['same_windows_in_batch']} in a batch.\n"
            )
    if mass:
        held = f"another measure; from {mass['curves']:,} curves"
        others.append(f"| stumpy mass | {ms(mass['seconds']['median'])} | {held} |")
    size = f"{told['types']:,} types, {told['windows']:,} windows"
    return f"""{size}, the best {TOP}; wall clock on {told["machine"]["cores"]} cores, each request the best of two runs.
"evaluated" counts the windows whose error was computed from the lengths, after a first look at 64 or more (median); "differ"
the answers that are not those of the plain scan: the same windows in the same order, and the same errors, of rotations bit for
bit, with positions to 1e-12.

{table("span", told["spans"])}

With positions too (`effort: "atlas"`):

{table("span", told["joint"])}

All six orders and the double-cranks, {told["wide"]["types"]:,} types, {told["wide"]["windows"]:,} windows:

{table("span", told["wide"]["spans"])}

Opponents at {FLAT_SPAN} degrees:

| | ms a request | |
|---|--:|---|
{chr(10).join(others)}
{same}
Hard requests:

{table("kind", told["hard"])}

The worst: {worst["kind"]} (number {worst["seed"]}), {ms(worst["ours"])} ms, the plain scan {ms(worst["plain"])} ms.
"""


def _window_ids(windows: Windows) -> set[tuple[int, int, int]]:
    return {(int(row), int(start), int(branch)) for row, start, branch, _ in zip(*windows)}


def measure_wide(cores: int, samples: int = 128) -> dict[str, Any]:
    """The same duel on the wider atlas: crank or ground the shortest, the others in all orders; built for it."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "wide.h5"
        words = ["--order", "full_crank", "--samples", str(samples), "--out", str(file)]
        subprocess.run([sys.executable, "-m", "data_build", *words], check=True, capture_output=True)
        atlas = load_atlas(file)
    ours, plain = Scan(atlas, threads=cores), Scan(atlas, threads=cores, cells=False)
    smallest = atlas.rule.types.smallest / atlas.rule.types.perimeter
    by_span: dict[str, list[Duel]] = {}
    with threadpool_limits(1, "blas"):
        for seed in range(WIDE_REQUESTS):
            random = generator("retrieval wide", seed)
            span = SPANS[seed % len(SPANS)]
            target = motion_of(random, any_order(random, smallest), crank_angles(random, span))
            by_span.setdefault(str(span), []).append(duel("wide", seed, target, ours, plain))
    return {
        "types": len(atlas),
        "windows": ours.windows,
        "scan_bytes": ours.nbytes,
        "spans": {span: summary(by_span[span]) for span in sorted(by_span, key=int)},
    }


def measure(atlas: Atlas, requests: int, hard: int, cores: int) -> dict[str, Any]:
    """All of it."""
    smallest = atlas.rule.types.smallest / atlas.rule.types.perimeter
    ours, plain = Scan(atlas, threads=cores), Scan(atlas, threads=cores, cells=False)

    def reachable(kind: str, seed: int, span: float, samples: int = SAMPLES, uneven: bool = False) -> Target:
        random = generator(f"retrieval {kind}", seed)
        return motion_of(random, atlas_lengths(random, smallest), crank_angles(random, span, samples, uneven))

    flat_targets = [reachable("flat", seed, FLAT_SPAN) for seed in range(requests)]
    mass_targets = [reachable("mass", seed, FLAT_SPAN, FLAT_SPAN + 1) for seed in range(MASS_REQUESTS)]
    by_span: dict[str, list[Duel]] = {}
    by_kind: dict[str, list[Duel]] = {}
    joint: dict[str, list[Duel]] = {}
    with threadpool_limits(1, "blas"):  # as the service does: threads are the scan's own
        for seed in range(requests):
            span = SPANS[seed % len(SPANS)]
            target = reachable("span", seed, span, uneven=seed // len(SPANS) % 3 == 2)
            by_span.setdefault(str(span), []).append(duel("reachable", seed, target, ours, plain))
            random = generator("retrieval joint", seed)
            target = motion_of(random, atlas_lengths(random, smallest), crank_angles(random, span), positions=True)
            joint.setdefault(str(span), []).append(duel("joint", seed, target, ours, plain))
        flat = [duel("flat", seed, target, ours, plain) for seed, target in enumerate(flat_targets)]
        for number in range(hard):
            seed, place = divmod(number, len(KINDS))
            target = hard_target(KINDS[place], seed, smallest)
            by_kind.setdefault(KINDS[place], []).append(duel(KINDS[place], seed, target, ours, plain))
    everything = [done for part in (*by_span.values(), *joint.values(), flat, *by_kind.values()) for done in part]
    worst = min(everything, key=lambda done: done.ratio)
    if indexed := flat_index(atlas, flat_targets, TOP, cores):
        indexed["single_s"] = spread(indexed["single_s"])
        for found, same in (("found", "same_windows"), ("found_in_batch", "same_windows_in_batch")):
            pairs = zip(indexed.pop(found), flat)
            indexed[same] = sum(ids == _window_ids(done.windows) for ids, done in pairs)
    if profiled := stumpy_mass(atlas, [target.rotation for target in mass_targets], cores):
        profiled["seconds"] = spread(profiled["seconds"])
    return {
        "machine": machine(),
        "numpy": np.__version__,
        "types": len(atlas),
        "windows": ours.windows,
        "scan_bytes": ours.nbytes,
        "plain_scan_bytes": plain.nbytes,
        "differ": sum(not done.same for done in everything),
        "spans": {span: summary(by_span[span]) for span in sorted(by_span, key=int)},
        "joint": {span: summary(joint[span]) for span in sorted(joint, key=int)},
        "flat_requests": summary(flat),
        "flat_index": indexed,
        "stumpy_mass": profiled,
        "hard": {kind: summary(duels) for kind, duels in by_kind.items()},
        "worst": {name: getattr(worst, name) for name in ("kind", "seed", "ours", "plain", "evaluated")},
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure (or read what was measured), print, write; 1 if an answer differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--atlas", type=Path, default=Path("atlas.h5"))
    parser.add_argument("--requests", type=int, default=60, help="reachable ones, and as many for the flat index")
    parser.add_argument("--hard", type=int, default=200, help="requests far from every row, or numerically hard")
    parser.add_argument("--out", type=Path, default=RESULT)
    parser.add_argument("--page", type=Path, default=PAGE)
    parser.add_argument("--redraw", action="store_true", help="from the result file, without measuring")
    options = parser.parse_args(arguments)
    if not options.redraw:
        cores = os.cpu_count() or 1
        told = measure(load_atlas(options.atlas), options.requests, options.hard, cores)
        told["wide"] = measure_wide(cores)
        told["differ"] += sum(part["differ"] for part in told["wide"]["spans"].values())
        options.out.parent.mkdir(exist_ok=True)
        options.out.write_text(json.dumps(told, indent=1) + "\n")
    told = json.loads(options.out.read_text())
    print(tables(told))
    options.page.write_text(scaling.fill(options.page.read_text(), {"retrieval": f"\n{tables(told)}"}))
    print(f"{told['differ']} answers differ from those of the plain scan")
    return 1 if told["differ"] else 0


if __name__ == "__main__":
    raise SystemExit(main())
