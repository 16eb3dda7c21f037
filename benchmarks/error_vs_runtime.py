"""Error against run time of the service, its parts and its baselines, on the same seeded cases (`make report`).

The processor time of a single core is measured, so that other work on the machine does not count. Every method has
the same objective, the error J of the mounted linkage. Preparation that a service does once at its start is not
counted.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import chain
from typing import Annotated, Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks import baselines, product, report
from benchmarks.figures import BLUE, BROWN, GREEN, GREY, ORANGE, PURPLE, figure
from benchmarks.report import Times, power, significant
from tests.oracles.classes import EXACT, NAMES, UNREACHABLE, make_case
from tests.oracles.recompute import REACHED

SERVICE, PUBLISHED, ROWS, REFINED = (
    "this service",
    "published method",
    "atlas rows as they are",
    "atlas rows, refined",
)
EVOLUTION, PYLINKAGE, UNTIMED = "differential evolution", "pylinkage", "pylinkage, any crank angle"
LOOK = {
    SERVICE: (GREEN, "o", "this service (search until 1e-10)"),
    REFINED: (BLUE, "s", "coarse atlas + refinement, best settings"),
    ROWS: (ORANGE, "^", "coarse atlas alone, best settings"),
    PUBLISHED: (BROWN, "*", "published table (101,408 types, every degree), our matching"),
    EVOLUTION: (PURPLE, "D", "scipy differential evolution"),
    PYLINKAGE: (GREY, "v", "pylinkage motion generation"),
}
"""Colour, marker and label of each method in the pictures."""
GRIDS = (ROWS, REFINED)

PERIMETERS, STARTS = (24, 40, 64, 100), (18, 36, 72)
SEEDS, STEPS = (1, 8, 64), 60
"""Numbers of seeds per branch of the refined rows, and number of steps of their refinement."""
BUDGETS_MS = (2, 5, 10, 20, 50, 100, 300, 1000)
STRONGEST = REFINED, "perimeter 24, step 20 deg, 8 seeds a branch"
"""Baseline that is best for short times."""
HEADLINE = (
    *((SERVICE, f"budget {budget} ms") for budget in (10, 100, 1000)),
    STRONGEST,
    (PUBLISHED, "perimeter 400, step 1 deg"),
    (EVOLUTION, "at most 1280 generations"),
    (PYLINKAGE, "9 subsets of poses"),
)
"""Values for README.md."""
FLOOR = 1e-16
"""Smallest J in the pictures; smaller values are rounding errors."""

Measured = tuple[str, str, float, float]
"""Method, setting, processor time in seconds, J."""


class Grid:
    """Coarse atlas of all full-crank four-bars of a perimeter, screened at evenly spaced starts."""

    def __init__(self, perimeter: int, starts: int) -> None:
        self.name = f"perimeter {perimeter}, step {360 // starts} deg"
        lengths = product.enumerate_types(product.TypeRule(perimeter, 1, product.OrderRule.FULL_CRANK)).astype(float)
        self.scan = product.ErrorTable(lengths, starts, 64, 20)
        self.unknowns = product.GrashofChart().unknowns(self.scan.lengths)

    def rows(self, target: product.Target) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return types, branches and starts: the best start of each type and branch, in order of the approximate error."""
        error = self.scan.squared(target)
        start = error.argmin(axis=2)
        smallest = np.take_along_axis(error, start[:, :, None], 2)[:, :, 0]
        row, side = np.divmod(np.argsort(smallest, axis=None, kind="stable"), 2)
        return row, 1.0 - 2.0 * side, start[row, side] * (product.TURN / self.scan.starts)


def spread_out(unknowns: np.ndarray, count: int) -> np.ndarray:
    """Return the first ``count`` indices, in the given order, that lie in different cells of the chart."""
    cells = np.floor(unknowns / np.array([0.7, 1.0, 1.0, 0.6]))
    _, first = np.unique(cells, axis=0, return_index=True)
    return np.sort(first)[:count]


def as_they_are(
    grid: Grid, target: product.Target, row: np.ndarray, branch: np.ndarray, start: np.ndarray
) -> list[product.Solution]:
    """Return the best row of a grid, computed exactly among the first screened rows."""
    lengths = grid.scan.lengths[row[:128]]
    angle = product.coupler_angle(lengths, branch[:128], start[:128, None] + target.crank)
    best = np.argmin(product.objective(target, angle), keepdims=True)
    return product.solved(target, lengths[best], branch[best], start[best])


def refined(
    grid: Grid, target: product.Target, row: np.ndarray, branch: np.ndarray, start: np.ndarray, seeds: int
) -> list[product.Solution]:
    """Refine the best seeds of each branch."""
    chart = product.GrashofChart()
    unknowns = np.column_stack([grid.unknowns[row], start])
    sides = [np.flatnonzero(branch == side) for side in (1.0, -1.0)]
    seed = np.concatenate([side_rows[spread_out(unknowns[side_rows], seeds)] for side_rows in sides])
    problem, tolerance = product.GivenProblem(target, chart), 0.3 * product.DEFAULT_TOLERANCE
    done = product.refine(
        problem, product.candidates_at(grid.unknowns[row[seed]], branch[seed], start[seed]), STEPS, tolerance
    )
    best = done.take(np.argmin(done.cost, keepdims=True))
    if not np.isfinite(best.cost[0]):
        return []
    lengths = chart.shape(best.timed.shape).lengths
    return product.solved(target, lengths, best.timed.branch, best.timed.angles[:, 0])


def clocked(method: str, setting: str, solve: Callable[..., Any], *arguments: Any, before: float = 0.0) -> Measured:
    """Time a call that returns a J, solutions, or solutions and a report; add the time of its preparation."""
    times = Times()
    found = times.run(solve, *arguments)
    found = found[0] if isinstance(found, tuple) else found
    if isinstance(found, list):
        found = found[0].errors.objective if found else np.inf
    return method, setting, before + times.processor[0], found


def fast_methods(
    tables: product.SeedTables, published: product.Scan, grids: Sequence[Grid], target: product.Target
) -> Iterator[Measured]:
    """Run the search with budgets of processor time, the atlas of the paper, and the grids, whose time includes the screening."""
    limits = product.Limits()
    for budget in BUDGETS_MS:
        work = product.Work(budget / 1000, clock=time.process_time)
        arguments = tables, target, limits, 1, product.DEFAULT_TOLERANCE, work
        yield clocked(SERVICE, f"budget {budget} ms", product.search, *arguments)
    yield clocked(PUBLISHED, "perimeter 400, step 1 deg", product.best_rows, published, target, limits, 1)
    for grid in grids:
        times = Times()
        rows = grid, target, *times.run(grid.rows, target)
        yield clocked(ROWS, grid.name, as_they_are, *rows, before=times.processor[0])
        for seeds in SEEDS:
            setting = f"{grid.name}, {seeds} seeds a branch"
            yield clocked(REFINED, setting, refined, *rows, seeds, before=times.processor[0])


def slow_methods(target: product.Target, seed: int) -> Iterator[Measured]:
    """Run the baselines of other libraries."""
    for generations in baselines.EVOLUTION_GENERATIONS:
        setting = f"at most {generations} generations"
        yield clocked(EVOLUTION, setting, baselines.evolve, target, generations, seed)
    if target.rotation is not None and target.position is not None:
        for subsets, seconds, timed, untimed in baselines.generate_motion(target, seed):
            yield PYLINKAGE, f"{subsets} subsets of poses", seconds, timed
            yield UNTIMED, f"{subsets} subsets of poses", seconds, untimed


def summarise(runs: dict[str, Any], kinds: Sequence[str]) -> list[dict[str, Any]]:
    """Return a row for each method and setting over all cases of some classes, in order of effort."""
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
        # by rank, without interpolation: a case without an answer is infinitely bad
        low, median, high = (float(found[int(share * (len(found) - 1))]) for share in (0.25, 0.5, 0.75))
        fast, ms, slow = np.percentile(both["ms"], [25, 50, 95]).tolist()
        share = 100 * float(np.mean(found < REACHED))
        row = {"method": method, "setting": setting, "cases": len(found), "share": share}
        rows.append(row | {"fast": fast, "ms": ms, "slow": slow, "low": low, "median": median, "high": high})
    order = (
        *LOOK,
        UNTIMED,
    )  # the settings of the grids by time; the settings of the other methods are already in order of effort
    return sorted(rows, key=lambda row: (order.index(row["method"]), row["ms"] if row["method"] in GRIDS else 0.0))


def frontier(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the settings that no setting of the same method surpasses in both time and median error."""
    best_rows: list[dict[str, Any]] = []
    for row in sorted(rows, key=lambda row: (row["ms"], row["median"])):
        if not best_rows or row["median"] < best_rows[-1]["median"]:
            best_rows.append(row)
    return best_rows


def solved_within(runs: dict[str, Any], method: str, setting: str, within_ms: np.ndarray) -> np.ndarray:
    """Return the percentage of the exact cases that a setting has brought below 1e-9 within each time."""
    cases = [settings[setting] for kind in EXACT if setting in (settings := runs[kind].get(method, {}))]
    ms = np.array([value for case in cases for value in case["ms"]])
    found = np.array([np.inf if value is None else value for case in cases for value in case["J"]])
    return 100 * np.mean((ms <= within_ms[:, None]) & (found < REACHED), axis=1)


def lead(runs: dict[str, Any]) -> str:
    """Describe the time until which the strongest baseline has solved more cases than the service."""
    at = np.arange(1, 301)
    service, rows = (
        solved_within(runs, *setting, at) for setting in ((SERVICE, f"budget {BUDGETS_MS[-1]} ms"), STRONGEST)
    )
    if not np.any(rows > service):
        return "it is never ahead of the service"
    until, widest = int(np.max(np.flatnonzero(rows > service))), int(np.argmax(rows - service))
    return (
        f"it has solved more cases than the service until {at[until]} ms of each case's own time ({rows[widest]:.0f} % against "
        f"{service[widest]:.0f} % within {at[widest]} ms), and within {at[-1]} ms has solved {rows[-1]:.0f} % against "
        f"{service[-1]:.0f} %"
    )


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """Return the tables of docs/background/measurements.md and README.md."""
    runs = results["runs"]
    exact, columns = summarise(runs, EXACT), report.TABLES["error_vs_runtime"]["runs"]
    best = []
    for kind in NAMES:
        rows = sorted(summarise(runs, [kind]), key=lambda row: (-row["median"], -row["ms"]))
        best_rows = {row["method"]: row for row in rows}  # the best row is written last
        cells = {"class": kind, **dict.fromkeys(LOOK, "-")}
        for method, row in best_rows.items():
            times = significant(row["ms"] / best_rows[SERVICE]["ms"], 2)
            cells[method] = power(row["median"]) + ("" if method == SERVICE else f" in {times}")
        best.append(cells)
    points = sum(len(run["J"]) for kind in runs.values() for settings in kind.values() for run in settings.values())
    heads = ["class", *(method for method in LOOK if method != "atlas rows as they are")]
    tables = {
        "classes": report.table(best, "\n".join(f"{head}: {{{head}}}" for head in heads)),
        "headline": report.table([row for row in exact if (row["method"], row["setting"]) in HEADLINE], **columns),
    }
    # the assignment of its answers to the samples is ours
    tables = {name: text.replace(PUBLISHED, "published table") for name, text in tables.items()}
    return tables | {
        "cases": f"{results['cases']} seeded cases of each of {len(runs)} classes, {points:,} measurements in "
        f"{results['minutes']:.0f} minutes.",
        "lead": lead(runs),
    }


def look(method: str, small: bool = False) -> dict[str, Any]:
    """Return the line style of a method: the service on top of the others, the published table as a star."""
    colour, marker, _ = LOOK[method]
    first = method == SERVICE
    marks = {"marker": marker, "markersize": (11 if method == PUBLISHED else 5) * (0.75 if small else 1)}
    return marks | {"color": colour, "linewidth": 2.2 if first else 1.5, "zorder": 4 if first else 3}


def draw_curves(axes: Any, rows: Sequence[dict[str, Any]], small: bool) -> None:
    """Draw a curve for each method through its best settings: the median, and the band between the quartiles."""
    for method, (colour, _, label) in reversed(LOOK.items()):
        own = [row for row in rows if row["method"] == method]
        curve = [row for row in (own if method == PYLINKAGE else frontier(own)) if np.isfinite(row["median"])]
        if not curve:
            continue
        x, low, median, high = (np.array([row[name] for row in curve]) for name in ("ms", "low", "median", "high"))
        axes.plot(x, median, label=label, **look(method, small))
        if small:
            continue
        if len(curve) > 2:
            axes.fill_between(x, low, np.minimum(high, 10.0), color=colour, alpha=0.13, linewidth=0)
        else:
            axes.vlines(x, low, np.minimum(high, 10.0), color=colour, alpha=0.5)
        if method == SERVICE:  # the service chooses its time: from the quartile to the 95th percentile
            axes.hlines(median[-1], curve[-1]["fast"], curve[-1]["slow"], color=colour, linewidth=1.2, zorder=4)
        if method in GRIDS:
            dots = zip(*((row["ms"], row["median"]) for row in own if np.isfinite(row["median"])))
            axes.scatter(*dots, s=9, color=colour, alpha=0.35, linewidth=0, zorder=2)
    axes.axhline(REACHED, color=GREY, linewidth=0.9, linestyle=(0, (4, 3)), zorder=1)
    axes.set(xscale="log", yscale="log", ylim=(3e-17, 3.0), xlim=(0.4, 5000))
    axes.minorticks_off()


def draw_shares(axes: Any, runs: dict[str, Any], rows: Sequence[dict[str, Any]]) -> None:
    """Draw the fraction of cases below 1e-9 within each time, a curve for each method with its strongest setting."""
    within, strongest = np.geomspace(0.4, 5000, 200), dict([STRONGEST])
    for method in reversed(LOOK):
        shares = {row["setting"]: row["share"] for row in rows if row["method"] == method}
        if shares:
            setting = strongest.get(method) or max(shares, key=lambda key: shares[key])
            axes.plot(within, solved_within(runs, method, setting, within), **{**look(method), "marker": ""})
    axes.set(xscale="log", ylim=(-4, 104), xlim=(0.4, 5000), ylabel="cases brought below J = 1e-9 (%)")
    axes.minorticks_off()


def curves_of(axes: Any) -> Iterator[list[Any]]:
    """Return the lines and labels of a legend with the service first, although it is drawn last."""
    return (part[::-1] for part in axes.get_legend_handles_labels())


def draw(results: dict[str, Any]) -> None:
    """Draw all exact classes together, and each class separately."""
    runs, clock = results["runs"], "processor time of a request, one core (ms)"
    rows = summarise(runs, EXACT)
    with figure("error_vs_runtime.png", 1, 2, (11.5, 5.8), width_ratios=(1.7, 1)) as (drawing, (axes, shares)):
        draw_curves(axes, rows, small=False)
        draw_shares(shares, runs, rows)
        axes.set(ylabel="error J of the mounted linkage: median, quartiles", xlabel=clock)
        axes.text(0.45, 1.4e-9, "J = 1e-9", color=GREY, fontsize=8.5)
        shares.set(xlabel="processor time of each case (ms)")
        drawing.suptitle(
            f"Error against run time: {results['cases'] * len(EXACT)} random motions that some four-bar performs exactly, "
            f"{len(EXACT)} classes"
        )
        drawing.legend(*curves_of(axes), loc="outside lower center", ncols=3)
    with figure("error_vs_runtime_classes.png", 4, 4, (11, 10), sharex=True) as (drawing, grid):
        for axes, kind in zip(grid, NAMES):
            draw_curves(axes, summarise(runs, [kind]), small=True)
            if kind not in EXACT:  # no error falls below the noise, so enlarge this range
                axes.set_ylim(*((8e-4, 0.3) if kind == "noise" else (0.05, 3.0)))
            note = {"noise": " of 1e-3", UNREACHABLE: "  (no exact answer)"}.get(kind, "")
            axes.set_title(kind + note, fontsize=10)
        drawing.supxlabel(clock, fontsize=10)
        drawing.supylabel("error J, median", fontsize=10)
        drawing.legend(*curves_of(grid[0]), loc="outside upper center", ncols=3)


def measure(cases: Annotated[int, "of each class"] = 30) -> Iterator[dict[str, Any]]:
    """Run all methods on a single core; return milliseconds and J of the cases of each class, method and setting."""
    threadpool_limits(1, "blas")
    baselines.need()
    begin = time.perf_counter()
    grids = [Grid(perimeter, starts) for perimeter in PERIMETERS for starts in STARTS]
    fast = partial(fast_methods, product.SeedTables(), product.scan_of(product.TypeRule()))
    warm = product.target_of(make_case("plain", 999).request)
    list(fast(grids[:1], warm)), list(slow_methods(warm, 0))
    runs: dict[str, Any] = {}
    for kind in NAMES:
        for seed in range(cases):
            target = product.counter_clockwise(product.target_of(make_case(kind, seed).request))
            for method, setting, seconds, found in chain(fast(grids, target), slow_methods(target, seed)):
                lists = runs.setdefault(kind, {}).setdefault(method, {}).setdefault(setting, {"ms": [], "J": []})
                lists["ms"].append(float(f"{1000 * seconds:.4g}"))
                lists["J"].append(report.finite(float(f"{found:.3g}")))
        print(f"{kind}: {(time.perf_counter() - begin) / 60:.1f} minutes", flush=True)
    minutes = round((time.perf_counter() - begin) / 60, 1)
    yield {"cases": cases, "minutes": minutes, "runs": runs}


if __name__ == "__main__":
    report.run(measure)
