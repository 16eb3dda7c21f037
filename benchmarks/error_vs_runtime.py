"""Error against run time: this service, its parts and its opponents, on the same seeded cases in the same run (`make report`).

Measured is processor time of one core, so that other work on the machine does not count. Every method sees the same
objective J of the mounted linkage; preparation that a service does once at its start is not counted.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks import opponents
from benchmarks.acceptance import REACHED, target_of
from benchmarks.classes import EXACT, NAMES, UNREACHABLE, make_case
from synthesis.atlas.best import best_rows
from synthesis.atlas.file import Atlas, AtlasRule, generator_versions
from synthesis.atlas.rows import compute_rows
from synthesis.atlas.scan import Scan
from synthesis.fourbar.charts import FullCrankChart
from synthesis.fourbar.dimension_types import OrderRule, TypeRule, enumerate_types
from synthesis.fourbar.kinematics import TURN, coupler_angle
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.pose import objective
from synthesis.fourbar.solution import make_solutions
from synthesis.search.refine import Problem, refine
from synthesis.search.search import DEFAULT_TOLERANCE, Levels, mirrored, search
from synthesis.target import Target

ROOT = Path(__file__).parents[1]
RESULT = ROOT / "benchmarks" / "results" / "error_vs_runtime.json"
PAGE = ROOT / "docs" / "error_vs_runtime.md"
FIGURE = ROOT / "docs" / "img" / "error_vs_runtime.png"
CLASSES_FIGURE = ROOT / "docs" / "img" / "error_vs_runtime_classes.png"

SERVICE = "this service"
REFINED = "atlas rows, refined"
ROWS = "atlas rows as they are"
PUBLISHED = "published method"
EVOLUTION = "differential evolution"
PYLINKAGE = "pylinkage"
PYLINKAGE_UNTIMED = "pylinkage, any crank angle"
METHODS = (SERVICE, REFINED, ROWS, PUBLISHED, EVOLUTION, PYLINKAGE)

PERIMETERS = (24, 40, 64, 100)
STARTS = (18, 36, 72)
SEEDS = (1, 8, 64)
BUDGETS_MS = (2, 5, 10, 20, 50, 100, 300, 1000)
STEPS = 60
FLOOR = 1e-16
"""Below this a J is rounding: it is drawn here."""


class Point(NamedTuple):
    """One method at one setting on one case."""

    kind: str
    seed: int
    method: str
    setting: str
    milliseconds: float
    objective: float


class Grid:
    """A coarse atlas of all full-crank four-bars of a perimeter, screened at evenly spaced starts."""

    def __init__(self, perimeter: int, starts: int) -> None:
        rule = AtlasRule(TypeRule(perimeter, 1, OrderRule.FULL_CRANK), 64)
        lengths = enumerate_types(rule.types)
        atlas = _atlas(rule, lengths)
        self.name = f"perimeter {perimeter}, step {360 // starts} deg"
        self.scan = Scan(atlas, starts, 1e-3, (8, 20))
        self.unknowns = FullCrankChart().unknowns(lengths)

    def rows(self, target: Target) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Types, branches and starts, the best start of each type and branch, by approximate error."""
        error = self.scan.error_table(target)
        start = error.argmin(axis=2)
        least = np.take_along_axis(error, start[:, :, None], 2)[:, :, 0]
        order = np.argsort(least, axis=None, kind="stable")
        row, side = np.divmod(order, 2)
        return row, 1.0 - 2.0 * side, start[row, side] * (TURN / self.scan.starts)


def _atlas(rule: AtlasRule, lengths: np.ndarray) -> Atlas:
    rows = compute_rows(lengths, rule.samples)
    return Atlas(rule, lengths.astype("<u2"), generator=generator_versions(), **rows._asdict())


def published_scan() -> Scan:
    """The atlas of the paper: 101,408 types of perimeter 400, every whole degree of start."""
    rule = AtlasRule(TypeRule(), 128)
    return Scan(_atlas(rule, enumerate_types(rule.types)))


def clock_ms() -> float:
    """Processor time of this process."""
    return 1000 * time.process_time()


def spread_out(unknowns: np.ndarray, count: int) -> np.ndarray:
    """The first ``count`` places, in the given order, that lie in different cells of the chart."""
    cells = np.floor(unknowns / np.array([0.7, 1.0, 1.0, 0.6]))
    _, first = np.unique(cells, axis=0, return_index=True)
    return np.sort(first)[:count]


def measure_grid(grid: Grid, target: Target) -> Iterator[tuple[str, str, float, float]]:
    """The rows of a grid as they are, and refined from several numbers of seeds; screening is part of each time."""
    begin = clock_ms()
    row, branch, start = grid.rows(target)
    screened = clock_ms()
    few = slice(0, 128)
    crank = start[few, None] + target.crank
    angle = coupler_angle(grid.scan.lengths[row[few]], branch[few], crank)
    error = objective(target, angle)
    best = int(np.argmin(error))
    lengths = grid.scan.lengths[row[best : best + 1]]
    make_solutions(target, lengths, branch[best : best + 1], start[best : best + 1])
    yield ROWS, grid.name, clock_ms() - begin, float(error[best])
    problem = Problem(target, FullCrankChart())
    for seeds in SEEDS:
        again = clock_ms()
        all_unknowns = np.column_stack([grid.unknowns[row], start])
        chosen = [
            (places := np.flatnonzero(branch == side))[spread_out(all_unknowns[places], seeds)]
            for side in (1.0, -1.0)
        ]
        seed = np.concatenate(chosen)
        done = refine(problem, all_unknowns[seed], branch[seed], STEPS, 0.3 * DEFAULT_TOLERANCE)
        best = int(np.argmin(done.cost))
        if np.isfinite(done.cost[best]):
            one = slice(best, best + 1)
            lengths = FullCrankChart().shape(done.unknowns[one, :3]).lengths
            found = make_solutions(target, lengths, done.branch[one], done.unknowns[one, 3])[0].errors.objective
        else:
            found = np.inf
        elapsed = clock_ms() - again + screened - begin
        yield REFINED, f"{grid.name}, {seeds} seeds a branch", elapsed, found


def measure_service(levels: Levels, target: Target) -> Iterator[tuple[str, str, float, float]]:
    """The search of the service under budgets of processor time."""
    for budget in BUDGETS_MS:
        begin = clock_ms()
        solutions, _ = search(levels, target, Limits(), 1, DEFAULT_TOLERANCE, time.process_time, budget / 1000)
        found = solutions[0].errors.objective if solutions else np.inf
        yield SERVICE, f"budget {budget} ms", clock_ms() - begin, found


def measure_published(scan: Scan, target: Target) -> Iterator[tuple[str, str, float, float]]:
    """The best row of the paper's atlas, found exactly and mounted."""
    begin = clock_ms()
    solutions, _ = best_rows(scan, target, Limits(), 1)
    found = solutions[0].errors.objective if solutions else np.inf
    yield PUBLISHED, "perimeter 400, step 1 deg", clock_ms() - begin, found


def measure_evolution(target: Target, seed: int) -> Iterator[tuple[str, str, float, float]]:
    """scipy's differential evolution at several numbers of generations."""
    for generations in opponents.EVOLUTION_GENERATIONS:
        begin = clock_ms()
        found = opponents.evolve(target, generations, seed)
        yield EVOLUTION, f"{generations} generations", clock_ms() - begin, found


def measure_pylinkage(target: Target, seed: int) -> Iterator[tuple[str, str, float, float]]:
    """pylinkage's motion generation on more and more subsets of poses."""
    for subsets, seconds, timed, untimed in opponents.generate_motion(target, seed):
        yield PYLINKAGE, f"{subsets} subsets of poses", 1000 * seconds, timed
        yield PYLINKAGE_UNTIMED, f"{subsets} subsets of poses", 1000 * seconds, untimed


def measure(cases: int, missing: dict[str, str], kinds: Sequence[str] = NAMES) -> list[Point]:
    """All methods on all cases."""
    grids = [Grid(perimeter, starts) for perimeter in PERIMETERS for starts in STARTS]
    levels, scan = Levels(), published_scan()
    points = []
    warm = target_of(make_case("plain", 999).request)
    for _ in (list(measure_service(levels, warm)), list(measure_grid(grids[0], warm))):
        pass
    for kind in kinds:
        for seed in range(cases):
            target = target_of(make_case(kind, seed).request)
            target = mirrored(target) if target.span < 0 else target
            runs = [measure_service(levels, target), measure_published(scan, target)]
            runs += [measure_grid(grid, target) for grid in grids]
            if "scipy" not in missing:
                runs.append(measure_evolution(target, seed))
            if "pylinkage" not in missing and target.rotation is not None and target.position is not None:
                runs.append(measure_pylinkage(target, seed))
            points += [Point(kind, seed, *measured) for run in runs for measured in run]
        print(f"{kind}: {len(points)} points", flush=True)
    return points


# -- summary ----------------------------------------------------------------------------------------------------------


class Setting(NamedTuple):
    """A method at a setting, over many cases: medians, quartiles, share that reached the tolerance."""

    method: str
    setting: str
    milliseconds: float
    low: float
    median: float
    high: float
    reached: float
    cases: int
    fast: float
    slow: float
    """Quartile and 95th percentile of the time."""


def summarise(points: list[Point]) -> list[Setting]:
    """One row a method and setting, in order of effort."""
    groups: dict[tuple[str, str], list[Point]] = {}
    for point in points:
        groups.setdefault((point.method, point.setting), []).append(point)
    rows = []
    for (method, setting), group in groups.items():
        found = np.sort([max(point.objective, FLOOR) for point in group])
        # by rank, not interpolated: a case without an answer counts as infinitely bad
        low, median, high = (float(found[int(share * (len(found) - 1))]) for share in (0.25, 0.5, 0.75))
        fast, elapsed, slow = np.percentile([point.milliseconds for point in group], [25, 50, 95]).tolist()
        rows.append(
            Setting(
                method, setting, elapsed, low, median, high, float(np.mean(found < REACHED)), len(found), fast, slow
            )
        )
    order = (*METHODS, PYLINKAGE_UNTIMED)
    grids = (ROWS, REFINED)  # of the others the settings are in order of effort already
    return sorted(rows, key=lambda row: (order.index(row.method), row.milliseconds if row.method in grids else 0.0))


def frontier(rows: list[Setting]) -> list[Setting]:
    """Settings that no other setting of the method beats in both time and median error."""
    kept: list[Setting] = []
    for row in sorted(rows, key=lambda row: (row.milliseconds, row.median)):
        if not kept or row.median < kept[-1].median:
            kept.append(row)
    return kept


# -- figures ----------------------------------------------------------------------------------------------------------

COLOURS = {
    SERVICE: "#0b6e4f",
    REFINED: "#3a86c8",
    ROWS: "#b8860b",
    PUBLISHED: "#7a4a00",
    EVOLUTION: "#a23b72",
    PYLINKAGE: "#666666",
}
MARKERS = {SERVICE: "o", REFINED: "s", ROWS: "^", PUBLISHED: "*", EVOLUTION: "D", PYLINKAGE: "v"}
LABELS = {
    SERVICE: "this service (search until 1e-10)",
    REFINED: "coarse atlas + refinement, best settings",
    ROWS: "coarse atlas alone, best settings",
    PUBLISHED: "published method (101,408 types, every degree)",
    EVOLUTION: "scipy differential evolution",
    PYLINKAGE: "pylinkage motion generation",
}
STYLE = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
}


def curve_of(method: str, rows: list[Setting]) -> list[Setting]:
    """What is drawn of a method: the settings that no other setting of it beats."""
    own = [row for row in rows if row.method == method]
    if method != PYLINKAGE:
        own = frontier(own)
    return [row for row in own if np.isfinite(row.median)]


def draw_curves(axes: mpl.axes.Axes, rows: list[Setting], small: bool) -> None:
    """One curve a method: median, and the band between the quartiles."""
    for method in reversed(METHODS):
        curve = curve_of(method, rows)
        if not curve:
            continue
        x = np.array([row.milliseconds for row in curve])
        low, median, high = (np.array([getattr(row, name) for row in curve]) for name in ("low", "median", "high"))
        high = np.minimum(high, 10.0)
        size = {PUBLISHED: 11}.get(method, 5) * (0.75 if small else 1)
        colour = COLOURS[method]
        axes.plot(
            x,
            median,
            color=colour,
            marker=MARKERS[method],
            markersize=size,
            linewidth=2.2 if method == SERVICE else 1.5,
            label=LABELS[method],
            zorder=4 if method == SERVICE else 3,
        )
        if small:
            continue
        if len(curve) > 2:
            axes.fill_between(x, low, high, color=colour, alpha=0.13, linewidth=0)
        else:
            axes.vlines(x, low, high, color=colour, alpha=0.5)
        if method == SERVICE:  # its time is its own choice: from the quartile to the 95th percentile
            axes.hlines(median[-1], curve[-1].fast, curve[-1].slow, color=colour, linewidth=1.2, zorder=4)
    axes.axhline(REACHED, color="#999999", linewidth=0.9, linestyle=(0, (4, 3)), zorder=1)
    axes.set(xscale="log", yscale="log", ylim=(3e-17, 3.0), xlim=(0.4, 5000))
    axes.yaxis.set_major_locator(mpl.ticker.LogLocator(numticks=7 if small else 10))
    axes.minorticks_off()


def draw_shares(axes: mpl.axes.Axes, rows: list[Setting]) -> None:
    """Share of cases below 1e-9 against time, one curve a method."""
    for method in reversed(METHODS):
        best: list[Setting] = []
        for row in sorted((row for row in rows if row.method == method), key=lambda row: row.milliseconds):
            if not best or row.reached > best[-1].reached or method == PYLINKAGE:
                best.append(row)
        x, y = [row.milliseconds for row in best], [100 * row.reached for row in best]
        size = 11 if method == PUBLISHED else 5
        top = 4 if method == SERVICE else 3
        width = 2.2 if method == SERVICE else 1.5
        axes.plot(x, y, color=COLOURS[method], marker=MARKERS[method], markersize=size, linewidth=width, zorder=top)
    axes.set(xscale="log", ylim=(-4, 104), xlim=(0.4, 5000))
    axes.set_ylabel("cases that reach J < 1e-9 (%)")
    axes.minorticks_off()


def draw(points: list[Point]) -> None:
    """Both figures."""
    exact = [point for point in points if point.kind in EXACT]
    with mpl.rc_context(STYLE):
        figure, (axes, shares) = plt.subplots(1, 2, figsize=(11.5, 5.8), layout="constrained", width_ratios=(1.7, 1))
        rows = summarise(exact)
        for method in (ROWS, REFINED):
            every = [row for row in rows if row.method == method and np.isfinite(row.median)]
            x = [row.milliseconds for row in every]
            axes.scatter(
                x, [row.median for row in every], s=9, color=COLOURS[method], alpha=0.35, linewidth=0, zorder=2
            )
        draw_curves(axes, rows, small=False)
        axes.set_ylabel("error J of the mounted linkage: median, quartiles")
        axes.text(0.45, 1.4e-9, "J = 1e-9", color="#777777", fontsize=8.5)
        draw_shares(shares, rows)
        cases = len({(point.kind, point.seed) for point in exact})
        figure.suptitle(
            f"Error against run time: {cases} random motions that some four-bar performs exactly, "
            f"{len({point.kind for point in exact})} classes",
            fontsize=12,
        )
        for one in (axes, shares):
            one.set_xlabel("processor time of a request, one core (ms)")
        handles, labels = axes.get_legend_handles_labels()
        figure.legend(handles[::-1], labels[::-1], loc="outside lower center", ncols=3, frameon=False, fontsize=9.5)
        FIGURE.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(FIGURE, dpi=150)
        plt.close(figure)

        figure, grid = plt.subplots(4, 4, figsize=(11, 10), sharex=True, layout="constrained")
        for axes, kind in zip(grid.flat, NAMES):
            own = [point for point in points if point.kind == kind]
            if own:
                draw_curves(axes, summarise(own), small=True)
            if kind not in EXACT:  # nothing falls below the noise: look closer
                axes.set_ylim(*((8e-4, 0.3) if kind == "noise" else (0.05, 3.0)))
                axes.yaxis.set_major_locator(mpl.ticker.LogLocator())
            elif axes not in grid[:, 0]:
                axes.tick_params(labelleft=False)
            note = {"noise": " of 1e-3", UNREACHABLE: "  (no exact answer)"}.get(kind, "")
            axes.set_title(kind + note, loc="left", fontsize=10)
        figure.supxlabel("processor time of a request, one core (ms)", fontsize=10)
        figure.supylabel("error J, median", fontsize=10)
        handles, labels = grid.flat[0].get_legend_handles_labels()
        figure.legend(handles[::-1], labels[::-1], loc="outside upper center", ncols=3, frameon=False, fontsize=9)
        figure.savefig(CLASSES_FIGURE, dpi=130)
        plt.close(figure)


# -- page -------------------------------------------------------------------------------------------------------------


def number(value: float) -> str:
    """A J for the table."""
    return f"{value:.1e}" if np.isfinite(value) else "no answer"


def table(rows: list[Setting]) -> str:
    """Markdown rows."""
    lines = [
        "| method | setting | median ms | 95 % ms | J: quartile | J: median | J: quartile | J < 1e-9 |",
        "|---|---|--:|--:|--:|--:|--:|--:|",
    ]
    for row in rows:
        errors = " | ".join(number(value) for value in (row.low, row.median, row.high))
        milliseconds = f"{row.milliseconds:.3g} | {row.slow:.3g}"
        lines.append(f"| {row.method} | {row.setting} | {milliseconds} | {errors} | {100 * row.reached:.0f} % |")
    return "\n".join(lines)


def write_page(points: list[Point], missing: dict[str, str], cases: int, minutes: float) -> None:
    """The report."""
    exact = summarise([point for point in points if point.kind in EXACT])
    main = [row for row in exact if row.method in (SERVICE, PUBLISHED, EVOLUTION, PYLINKAGE, PYLINKAGE_UNTIMED)]
    main += frontier([row for row in exact if row.method == ROWS])
    main += frontier([row for row in exact if row.method == REFINED])
    others = [row for row in exact if row.method in (ROWS, REFINED)]
    skipped = "\n".join(f"- {line}" for line in missing.values())
    by_class = []
    for kind in NAMES:
        rows = {(row.method, row.setting): row for row in summarise([p for p in points if p.kind == kind])}
        last = {method: [row for (name, _), row in rows.items() if name == method] for method in METHODS}
        cells = []
        for method in METHODS:
            best = min(last[method], key=lambda row: (row.median, row.milliseconds), default=None)
            cells.append(f"{number(best.median)} in {best.milliseconds:.3g} ms" if best else "-")
        by_class.append(f"| {kind} | " + " | ".join(cells) + " |")
    text = f"""# Error against run time

Written by `make report`; do not edit. {cases} seeded cases of each of {len(NAMES)} classes (`benchmarks/classes.py`),
{len(points)} measurements, {minutes:.0f} minutes. Times are processor time of one core, all methods in one run: compare
them with each other, not with another machine. Preparation at the start of a service is not counted. J is the error of the
mounted linkage: rms rotation error in radians and rms position error over the motion's size, together.

![Error against run time, all exact classes](img/error_vs_runtime.png)

The curve of a method joins those of its settings that no other one beats (dots: all settings of the coarse atlases). Bands
lie between the quartiles of the cases. On the right, how many cases each reaches: a small median is not yet a promise.

- **This service**: the search of `/v1/synthesize` under a budget of 2 ms to 1 s. It ends by itself below 1e-10.
- **Atlas rows**: coarse atlases of all full-crank four-bars, screened at evenly spaced starts; the best row as it is,
  or {STEPS} steps of refinement from 1 to 64 seeds a branch.
- **Published method**: the best of 101,408 types and 360 starts by an exact scan over rotation and position, mounted, not
  refined. Its atlas holds crank-rockers with L1 < L2 < L3 < L4 only, the service's also the other orders and the
  double-cranks.
- **Differential evolution** (scipy, with its own polishing at the end) searches the same four unknowns, everything linear
  projected out as in the service: it is given our formulation.
- **pylinkage**: motion generation through 3, 4 and 5 precision poses, on 1 to 9 subsets of the 32 poses, the best of all
  its answers; it cannot take rotation or position alone. Precision poses say nothing about crank angles, so the second
  line counts each pose by the nearest one of the motion at any crank angle. In the first the offset and the pose are fitted
  anew, in its favour.
{skipped}

## All exact classes

{table(main)}

## Best median of each class

Each cell is the setting with the smallest median J of that class, and its median time.

| class | {" | ".join(METHODS)} |
|---|{"--:|" * len(METHODS)}
{chr(10).join(by_class)}

![Error against run time by class](img/error_vs_runtime_classes.png)

## All settings of the coarse atlases

{table(others)}
"""
    PAGE.write_text(text)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure (or read what was measured), draw, write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=3, help="cases of each class")
    parser.add_argument("--redraw", action="store_true", help="from the result file, without measuring")
    options = parser.parse_args(arguments)
    if options.redraw:
        stored = json.loads(RESULT.read_text())
        missing, cases, minutes = stored["skipped"], stored["cases"], stored["minutes"]
        points = [Point(*values[:5], np.inf if values[5] is None else values[5]) for values in stored["points"]]
    else:
        missing = opponents.missing()
        for line in missing.values():
            print(line)
        begin, cases = time.perf_counter(), options.cases
        with threadpool_limits(1, "blas"):
            points = measure(cases, missing)
        minutes = (time.perf_counter() - begin) / 60
        stored = {
            "machine": {"processor": platform.processor() or platform.machine(), "cores": os.cpu_count()},
            "cases": cases,
            "minutes": round(minutes, 1),
            "skipped": missing,
            "columns": list(Point._fields),
            "points": [
                [*point[:4], round(point[4], 4), float(f"{point[5]:.4g}") if np.isfinite(point[5]) else None]
                for point in points
            ],
        }
        RESULT.parent.mkdir(parents=True, exist_ok=True)
        RESULT.write_text(json.dumps(stored).replace("], [", "],\n [") + "\n")
    draw(points)
    write_page(points, missing, cases, minutes)
    for row in summarise([point for point in points if point.kind in EXACT]):
        if row.method not in (ROWS, REFINED):
            print(f"{row.method:28s} {row.setting:28s} {row.milliseconds:9.1f} ms  {number(row.median)}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
