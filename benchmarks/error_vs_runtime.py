"""Error against run time: the service, its parts and its baselines, on the same seeded cases in the same run (`make report`).

Measured is processor time of one core, so that other work on the machine does not count. Every method sees the same
objective J of the mounted linkage; preparation that a service does once at its start is not counted. The slow baselines take
the first cases of each class only.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks import baselines, report
from benchmarks.product import (
    DEFAULT_TOLERANCE,
    FOURBAR,
    TURN,
    FullCrankChart,
    Limits,
    OrderRule,
    ProjectedProblem,
    Scan,
    SeedTables,
    Target,
    TypeRule,
    Work,
    best_rows,
    counter_clockwise,
    coupler_angle,
    objective,
    refine,
    search,
    solved,
    table_of,
    target_of,
)
from benchmarks.report import BLUE, BROWN, GREEN, GREY, ORANGE, PURPLE, power, significant
from tests.oracles.classes import EXACT, NAMES, UNREACHABLE, make_case
from tests.oracles.recompute import REACHED

SERVICE, REFINED, ROWS, PUBLISHED = (
    "this service",
    "atlas rows, refined",
    "atlas rows as they are",
    "published method",
)
EVOLUTION, PYLINKAGE, UNTIMED = "differential evolution", "pylinkage", "pylinkage, any crank angle"
LOOK = {
    SERVICE: (GREEN, "o", "this service (search until 1e-10)"),
    REFINED: (BLUE, "s", "coarse atlas + refinement, best settings"),
    ROWS: (ORANGE, "^", "coarse atlas alone, best settings"),
    PUBLISHED: (BROWN, "*", "published method (101,408 types, every degree)"),
    EVOLUTION: (PURPLE, "D", "scipy differential evolution"),
    PYLINKAGE: (GREY, "v", "pylinkage motion generation"),
}
"""Colour, marker and words of each method that is drawn."""
GRIDS, SLOW = (ROWS, REFINED), (EVOLUTION, PYLINKAGE, UNTIMED)

PERIMETERS, STARTS = (24, 40, 64, 100), (18, 36, 72)
SEEDS, STEPS = (1, 8, 64), 60
"""Seeds a branch of the refined rows, and steps of their refinement."""
BUDGETS_MS = (2, 5, 10, 20, 50, 100, 300, 1000)
FLOOR = 1e-16
"""Below this a J is rounding: it is drawn here."""

# -- measurement ------------------------------------------------------------------------------------------------------

Measured = Iterator[tuple[str, str, float, float]]
"""Method, setting, seconds of the processor, J."""


class Grid:
    """A coarse atlas of all full-crank four-bars of a perimeter, screened at evenly spaced starts."""

    def __init__(self, perimeter: int, starts: int) -> None:
        self.name = f"perimeter {perimeter}, step {360 // starts} deg"
        self.scan = Scan(table_of(TypeRule(perimeter, 1, OrderRule.FULL_CRANK), 64), starts, 1e-3, (8, 20))
        self.unknowns = FullCrankChart().unknowns(self.scan.lengths)

    def rows(self, target: Target) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Types, branches and starts, the best start of each type and branch, by approximate error."""
        error = self.scan.error_table(target)
        start = error.argmin(axis=2)
        least = np.take_along_axis(error, start[:, :, None], 2)[:, :, 0]
        row, side = np.divmod(np.argsort(least, axis=None, kind="stable"), 2)
        return row, 1.0 - 2.0 * side, start[row, side] * (TURN / self.scan.starts)


def spread_out(unknowns: np.ndarray, count: int) -> np.ndarray:
    """The first ``count`` places, in the given order, that lie in different cells of the chart."""
    cells = np.floor(unknowns / np.array([0.7, 1.0, 1.0, 0.6]))
    _, first = np.unique(cells, axis=0, return_index=True)
    return np.sort(first)[:count]


def run_grid(grid: Grid, target: Target) -> Measured:
    """The rows of a grid as they are, and refined from several numbers of seeds; screening is part of each time."""
    clock, chart = time.process_time, FullCrankChart()
    begin = clock()
    row, branch, start = grid.rows(target)
    screened = clock() - begin
    few = slice(0, 128)
    error = objective(
        target, coupler_angle(grid.scan.lengths[row[few]], branch[few], start[few, None] + target.crank)
    )
    best = np.argmin(error, keepdims=True)
    solved(target, grid.scan.lengths[row[best]], branch[best], start[best])
    yield ROWS, grid.name, clock() - begin, error[best[0]]
    for seeds in SEEDS:
        begin = clock()
        unknowns = np.column_stack([grid.unknowns[row], start])
        sides = [np.flatnonzero(branch == side) for side in (1.0, -1.0)]
        seed = np.concatenate([places[spread_out(unknowns[places], seeds)] for places in sides])
        done = refine(ProjectedProblem(target, chart), unknowns[seed], branch[seed], STEPS, 0.3 * DEFAULT_TOLERANCE)
        one = np.argmin(done.cost, keepdims=True)
        found = np.inf
        if np.isfinite(done.cost[one[0]]):
            lengths = chart.shape(done.unknowns[one, :3]).lengths
            found = solved(target, lengths, branch[seed][one], done.unknowns[one, 3])[0].errors.objective
        yield REFINED, f"{grid.name}, {seeds} seeds a branch", clock() - begin + screened, found


def run_service(tables: SeedTables, target: Target) -> Measured:
    """The search of the service under budgets of processor time."""
    for budget in BUDGETS_MS:
        begin = time.process_time()
        solutions, _ = search(
            tables, target, Limits(), 1, DEFAULT_TOLERANCE, Work(budget / 1000, clock=time.process_time)
        )
        found = solutions[0].errors.objective if solutions else np.inf
        yield SERVICE, f"budget {budget} ms", time.process_time() - begin, found


def run_published(scan: Scan, target: Target) -> Measured:
    """The best row of the paper's atlas, found exactly and mounted."""
    begin = time.process_time()
    solutions, _ = best_rows(scan, target, Limits(), 1)
    found = solutions[0].errors.objective if solutions else np.inf
    yield PUBLISHED, "perimeter 400, step 1 deg", time.process_time() - begin, found


def run_slow(target: Target, seed: int, missing: dict[str, str]) -> Measured:
    """The baselines of other libraries."""
    for generations in baselines.EVOLUTION_GENERATIONS if "scipy" not in missing else ():
        begin = time.process_time()
        found = baselines.evolve(target, generations, seed)
        yield EVOLUTION, f"at most {generations} generations", time.process_time() - begin, found
    if "pylinkage" not in missing and target.rotation is not None and target.position is not None:
        for subsets, seconds, timed, untimed in baselines.generate_motion(target, seed):
            yield PYLINKAGE, f"{subsets} subsets of poses", seconds, timed
            yield UNTIMED, f"{subsets} subsets of poses", seconds, untimed


def measure(cases: int, slow_cases: int) -> dict[str, Any]:
    """All methods: of each class, method and setting the milliseconds and the J of its cases, in the order of their seeds."""
    begin, missing = time.perf_counter(), baselines.missing()
    tables, published = SeedTables(FOURBAR), Scan(table_of(TypeRule(), 128))
    grids = [Grid(perimeter, starts) for perimeter in PERIMETERS for starts in STARTS]
    warm = target_of(make_case("plain", 999).request)
    for run in (
        run_service(tables, warm),
        run_grid(grids[0], warm),
        run_published(published, warm),
        run_slow(warm, 0, missing),
    ):
        list(run)
    runs: dict[str, Any] = {}
    for kind in NAMES:
        for seed in range(cases):
            target = counter_clockwise(target_of(make_case(kind, seed).request))
            parts = [run_service(tables, target), run_published(published, target)]
            parts += [run_grid(grid, target) for grid in grids]
            parts += [run_slow(target, seed, missing)] if seed < slow_cases else []
            for method, setting, seconds, found in (one for part in parts for one in part):
                lists = runs.setdefault(kind, {}).setdefault(method, {}).setdefault(setting, {"ms": [], "J": []})
                lists["ms"].append(float(f"{1000 * seconds:.4g}"))
                lists["J"].append(report.finite(float(f"{found:.3g}")))
        print(f"{kind}: {(time.perf_counter() - begin) / 60:.1f} minutes", flush=True)
    minutes = round((time.perf_counter() - begin) / 60, 1)
    return {"cases": cases, "slow_cases": slow_cases, "minutes": minutes, "skipped": missing, "runs": runs}


# -- summary ----------------------------------------------------------------------------------------------------------


def summarise(runs: dict[str, Any], kinds: Sequence[str]) -> list[dict[str, Any]]:
    """A row a method and setting over all cases of some classes, in order of effort."""
    lists: dict[tuple[str, str], dict[str, list[Any]]] = {}
    for kind in kinds:
        for method, settings in runs[kind].items():
            for setting, found in settings.items():
                both = lists.setdefault((method, setting), {"ms": [], "J": []})
                for name, values in found.items():
                    both[name] += values
    rows = []
    for (method, setting), both in lists.items():
        found = np.sort([np.inf if value is None else max(value, FLOOR) for value in both["J"]])
        # by rank, not interpolated: a case without an answer counts as infinitely bad
        low, median, high = (float(found[int(share * (len(found) - 1))]) for share in (0.25, 0.5, 0.75))
        fast, ms, slow = np.percentile(both["ms"], [25, 50, 95]).tolist()
        row = {"method": method, "setting": setting, "cases": len(found), "reached": float(np.mean(found < REACHED))}
        rows.append(row | {"fast": fast, "ms": ms, "slow": slow, "low": low, "median": median, "high": high})
    order = (*LOOK, UNTIMED)  # the settings of the grids by time; of the others they are in order of effort already
    return sorted(rows, key=lambda row: (order.index(row["method"]), row["ms"] if row["method"] in GRIDS else 0.0))


def frontier(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Settings that no other setting of the method beats in both time and median error."""
    kept: list[dict[str, Any]] = []
    for row in sorted(rows, key=lambda row: (row["ms"], row["median"])):
        if not kept or row["median"] < kept[-1]["median"]:
            kept.append(row)
    return kept


# -- document ---------------------------------------------------------------------------------------------------------


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The tables of docs/error_vs_runtime.md, and the median of the published method for README.md."""
    runs = results["runs"]
    exact = summarise(runs, EXACT)
    columns = {
        "method": "{method}",
        "setting": "{setting}",
        "cases": "{cases}",
        "median ms": lambda row: significant(row["ms"]),
        "95 % ms": lambda row: significant(row["slow"]),
        **{
            f"J: {name}": lambda row, key=key: power(row[key])
            for name, key in (("quartile", "low"), ("median", "median"), ("upper quartile", "high"))
        },
        "J < 1e-9": lambda row: f"{100 * row['reached']:.0f} %",
    }
    shown = [row for row in exact if row["method"] not in GRIDS]
    shown += [row for method in GRIDS for row in frontier([row for row in exact if row["method"] == method])]
    best = []
    for kind in NAMES:
        rows = summarise(runs, [kind])
        cells = {"class": kind, **dict.fromkeys(LOOK, "-")}
        for row in sorted(rows, key=lambda row: (-row["median"], -row["ms"])):  # the best is written last
            cells[row["method"]] = f"{power(row['median'])} in {significant(row['ms'])} ms"
        best.append(cells)
    points = sum(len(one["J"]) for kind in runs.values() for settings in kind.values() for one in settings.values())
    slow = f"{EVOLUTION} and {PYLINKAGE} on the first {results['slow_cases']} of them"
    return {
        "cases": f"{results['cases']} seeded cases of each of {len(runs)} classes, {slow}; {points:,} measurements in "
        f"{results['minutes']:.0f} minutes. {' '.join(results['skipped'].values())}".strip(),
        "exact": report.table(shown, columns, 2),
        "classes": report.table(best, {"class": "{class}", **{method: f"{{{method}}}" for method in LOOK}}),
        "grids": report.table([row for row in exact if row["method"] in GRIDS], columns, 2),
        "search": ", ".join(
            f"{100 * row['reached']:.0f} % of {row['cases']} cases within {row['setting'].removeprefix('budget ')}"
            for row in exact
            if row["setting"] in ("budget 10 ms", "budget 100 ms", "budget 1000 ms")
        ),
        "published": power(next(row["median"] for row in exact if row["method"] == PUBLISHED)),
    }


def look(method: str, small: bool = False) -> dict[str, Any]:
    """How a method's curve is drawn: the service's over the others', the published method as a star."""
    colour, marker, _ = LOOK[method]
    first = method == SERVICE
    marks = {"marker": marker, "markersize": (11 if method == PUBLISHED else 5) * (0.75 if small else 1)}
    return marks | {"color": colour, "linewidth": 2.2 if first else 1.5, "zorder": 4 if first else 3}


def draw_curves(axes: Any, rows: Sequence[dict[str, Any]], small: bool) -> None:
    """One curve a method through its best settings: median, and the band between the quartiles."""
    for method, (colour, _, label) in reversed(LOOK.items()):
        own = [row for row in rows if row["method"] == method]
        curve = [row for row in (own if method == PYLINKAGE else frontier(own)) if np.isfinite(row["median"])]
        if not curve:
            continue
        if method in SLOW:
            label += f" ({curve[0]['cases']} cases)"
        x, low, median, high = (np.array([row[name] for row in curve]) for name in ("ms", "low", "median", "high"))
        axes.plot(x, median, label=label, **look(method, small))
        if small:
            continue
        if len(curve) > 2:
            axes.fill_between(x, low, np.minimum(high, 10.0), color=colour, alpha=0.13, linewidth=0)
        else:
            axes.vlines(x, low, np.minimum(high, 10.0), color=colour, alpha=0.5)
        if method == SERVICE:  # its time is its own choice: from the quartile to the 95th percentile
            axes.hlines(median[-1], curve[-1]["fast"], curve[-1]["slow"], color=colour, linewidth=1.2, zorder=4)
        if method in GRIDS:
            every = [row for row in own if np.isfinite(row["median"])]
            dots = [row["ms"] for row in every], [row["median"] for row in every]
            axes.scatter(*dots, s=9, color=colour, alpha=0.35, linewidth=0, zorder=2)
    axes.axhline(REACHED, color=GREY, linewidth=0.9, linestyle=(0, (4, 3)), zorder=1)
    axes.set(xscale="log", yscale="log", ylim=(3e-17, 3.0), xlim=(0.4, 5000))
    axes.minorticks_off()


def draw_shares(axes: Any, rows: Sequence[dict[str, Any]]) -> None:
    """Share of cases below 1e-9 against time, one curve a method."""
    for method in reversed(LOOK):
        best: list[dict[str, Any]] = []
        for row in sorted((row for row in rows if row["method"] == method), key=lambda row: row["ms"]):
            if not best or row["reached"] > best[-1]["reached"] or method == PYLINKAGE:
                best.append(row)
        axes.plot([row["ms"] for row in best], [100 * row["reached"] for row in best], **look(method))
    axes.set(xscale="log", ylim=(-4, 104), xlim=(0.4, 5000), ylabel="cases that reach J < 1e-9 (%)")
    axes.minorticks_off()


def draw(results: dict[str, Any]) -> None:
    """All exact classes together, and every class for itself."""
    runs, clock = results["runs"], "processor time of a request, one core (ms)"
    rows = summarise(runs, EXACT)
    with report.figure("error_vs_runtime.png", 1, 2, (11.5, 5.8), width_ratios=(1.7, 1)) as (drawing, (axes, shares)):
        draw_curves(axes, rows, small=False)
        draw_shares(shares, rows)
        axes.set(ylabel="error J of the mounted linkage: median, quartiles", xlabel=clock)
        axes.text(0.45, 1.4e-9, "J = 1e-9", color=GREY, fontsize=8.5)
        shares.set(xlabel=clock)
        drawing.suptitle(
            f"Error against run time: {results['cases'] * len(EXACT)} random motions that some four-bar performs exactly, "
            f"{len(EXACT)} classes"
        )
        drawing.legend(
            *(part[::-1] for part in axes.get_legend_handles_labels()), loc="outside lower center", ncols=3
        )
    with report.figure("error_vs_runtime_classes.png", 4, 4, (11, 10), sharex=True) as (drawing, grid):
        for axes, kind in zip(grid, NAMES):
            draw_curves(axes, summarise(runs, [kind]), small=True)
            if kind not in EXACT:  # nothing falls below the noise: look closer
                axes.set_ylim(*((8e-4, 0.3) if kind == "noise" else (0.05, 3.0)))
            note = {"noise": " of 1e-3", UNREACHABLE: "  (no exact answer)"}.get(kind, "")
            axes.set_title(kind + note, fontsize=10)
        drawing.supxlabel(clock, fontsize=10)
        drawing.supylabel("error J, median", fontsize=10)
        drawing.legend(
            *(part[::-1] for part in grid[0].get_legend_handles_labels()), loc="outside upper center", ncols=3
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and publish."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=30, help="cases of each class (%(default)s)")
    parser.add_argument("--slow-cases", type=int, default=10, help="of them for the slow baselines (%(default)s)")
    options = parser.parse_args(arguments)
    with threadpool_limits(1, "blas"):
        results = measure(options.cases, min(options.slow_cases, options.cases))
    report.publish("error_vs_runtime", results)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
