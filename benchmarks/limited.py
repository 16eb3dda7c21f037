"""Requests within limits that no linkage satisfies exactly: error against run time, beside general optimisers.

The best known J of a request is the smallest J of all methods and of a heavy search (`heavy`).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np
from scipy.optimize import differential_evolution, minimize
from threadpoolctl import threadpool_limits

from benchmarks import product, report
from benchmarks.heavy import heavy_within
from benchmarks.report import Times
from tests.oracles.classes import UNREACHABLE, make_case
from tests.oracles.limited_classes import make_limited
from tests.oracles.recompute import REACHED, broken_limits, recompute

KINDS = ("broken", "boxed", "machine", UNREACHABLE)
BUDGETS = (50, 100, 300)
CLOSE, LOOSE = 1.01, 1.05
SLSQP_STARTS = 20
GENERATIONS, POPULATION = 300, 60


class General:
    """A request in the form of general optimisers: J squared, constraints and their gradients, at a point or many points.

    The unknowns are those of the chart, the start and, if limits concern the pose, pivot A, the ground angle and
    z2.
    """

    def __init__(self, target: product.Target, limits: product.Limits) -> None:
        self.target, self.limits = target, limits
        bounded = product.search_spaces(target, limits)[0]
        self.problem, self.constraints = product.problem_of(target, bounded), bounded.constraints
        self.posed = bounded.boxes is not None
        size = 10 if self.posed else 5
        low, high = np.full(size, -3.0), np.full(size, 3.0)
        low[:4], high[:4] = 1e-6, 4.0 if self.posed else 1.0
        high[4], low[4] = product.TURN, 0.0
        self.bounds = np.column_stack([low, high])

    def timed(self, points: np.ndarray, branch: np.ndarray) -> product.Timed:
        """Return candidates at points; the offset of a rotation is optimal."""
        pose = None
        if self.posed:
            crank = self.problem.chart.shape(points[:, :4]).lengths[:, 0]
            a, turned, z2 = points[:, 5] + 1j * points[:, 6], points[:, 7], points[:, 8] + 1j * points[:, 9]
            pose = np.stack([a, crank * np.exp(1j * turned), z2], axis=1)
        timed = product.candidates_at(points[:, :4], branch, points[:, 4], pose)
        return self.problem.descended(timed, [product.Stage(0)]).timed

    def constrained(self, points: np.ndarray, branch: np.ndarray) -> Any:
        """Return the constraints at points."""
        lengths = self.problem.chart.shape(points[:, :4]).lengths
        used, pose = self.target.interval.after(points[:, 4]), points[:, 5:].T
        pose_parts = (pose[0] + 1j * pose[1], pose[2], pose[3] + 1j * pose[4]) if self.posed else ()
        return self.constraints(product.Placed(lengths, branch, used, *pose_parts))

    def cost(self, point: np.ndarray, branch: float, family: int) -> tuple[float, np.ndarray]:
        """Return J squared and its gradient at a point."""
        at = point[None] * np.concatenate([[family], np.ones(point.size - 1)])
        linearised = self.problem.linearised(self.timed(at, np.array([branch])), 1.0)[0]
        if linearised is None:
            return 1e6, np.zeros(point.size)
        rows = linearised["rows"][:, : linearised["turn"].size]
        slope, residual = 2 * rows[:-1] @ rows[-1], rows[-1]
        gradient = slope[-5:]
        if self.posed:  # z1 = L1 e^{i turned}
            by_crank = complex(slope[2], -slope[3]) * np.exp(1j * at[0, 7])
            shape = self.problem.chart.shape(at[:, :4])
            gradient[:4] += by_crank.real * shape.jacobian[0, 0]
            by_turn = -by_crank.imag * shape.lengths[0, 0]
            gradient = np.concatenate([gradient, slope[:2], [by_turn], slope[4:6]])
        gradient[0] *= family
        return float(residual @ residual), gradient

    def slack(self, point: np.ndarray, branch: float, family: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the constraints and their derivatives at a point."""
        at = point[None] * np.concatenate([[family], np.ones(point.size - 1)])
        found, by = self.constrained(at, np.array([branch])), self.problem.chart.shape(at[:, :4]).jacobian[0]
        slopes = found.slopes[0]
        columns = [slopes[:, :4] @ by, slopes[:, 4:6].sum(axis=1, keepdims=True), slopes[:, 6:]]
        slopes = np.hstack(columns if self.posed else columns[:2])
        slopes[:, 0] *= family
        return found.values[0] - 1e-7, slopes

    def penalised(self, points: np.ndarray) -> np.ndarray:
        """Return J squared plus 10 times the violations, at points whose last two entries select branch and family."""
        at, branch = points[:-2].T.copy(), np.where(points[-2] > 0, 1.0, -1.0)
        at[:, 0] *= np.where(points[-1] > 0, 1.0, -1.0)
        cost = self.problem.measured(self.timed(at, branch), posed=not self.posed).cost
        lacking = np.maximum(1e-6 - self.constrained(at, branch).values, 0.0)
        return np.where(np.isfinite(cost), cost + 10 * np.sum(lacking, axis=1), 1e6)

    def objective(self, point: np.ndarray, branch: float, family: int) -> float:
        """Return J of the linkage at a point; infinite outside the limits."""
        at = point[None] * np.concatenate([[family], np.ones(point.size - 1)])
        pool = self.problem.measured(self.timed(at, np.array([branch])), posed=not self.posed)
        linkages = self.problem.linkages(pool)
        found = product.within(self.target, self.limits, product.assess(self.target, linkages))
        return found[0].errors.objective if found else np.inf


def slsqp(target: product.Target, limits: product.Limits) -> float:
    """Return the smallest J of scipy's SLSQP from random starts, with exact derivatives."""
    general, random, best = General(target, limits), np.random.default_rng(3), np.inf
    low, high = general.bounds.T
    for _ in range(SLSQP_STARTS):
        branch, family = float(random.choice([-1, 1])), int(random.choice([-1, 1]))
        rules = []
        if not limits.only_family:
            rules = [
                {
                    "type": "ineq",
                    "fun": lambda x, b=branch, f=family: general.slack(x, b, f)[0],
                    "jac": lambda x, b=branch, f=family: general.slack(x, b, f)[1],
                }
            ]
        found = minimize(
            general.cost,
            random.uniform(low, high),
            (branch, family),
            "SLSQP",
            True,
            bounds=general.bounds,
            constraints=rules,
            options={"maxiter": 150},
        )
        best = min(best, general.objective(np.clip(found.x, low, high), branch, family))
    return best


def evolution(target: product.Target, limits: product.Limits) -> float:
    """Return the smallest J of scipy's differential evolution, with limits as penalties."""
    general = General(target, limits)
    bounds = np.vstack([general.bounds, [[-1, 1], [-1, 1]]])
    found = differential_evolution(
        general.penalised,
        bounds,
        maxiter=GENERATIONS,
        popsize=max(1, POPULATION // len(bounds)),
        rng=3,
        polish=False,
        vectorized=True,
        updating="deferred",
    )
    branch, family = (1.0 if value > 0 else -1.0 for value in found.x[-2:])
    return general.objective(found.x[:-2], branch, int(family))


def measure_kind(kind: str, cases: int) -> list[dict[str, Any]]:
    """Return the rows of a kind: fraction near the best known J and times of each method."""
    tables = product.SeedTables()
    tables.windows("full_crank")
    methods: dict[str, tuple[list[float], Times]] = {}
    first: list[float] = []
    broken = 0

    def note(name: str, value: float) -> None:
        methods[name][0].append(value)

    for seed in range(cases):
        case = make_case(UNREACHABLE, 400 + seed) if kind == UNREACHABLE else make_limited(kind, seed)
        request = case.request if "limits" in case.request else {**case.request, "limits": {}}
        target, limits = product.counter_clockwise(product.target_of(request), product.limits_of(request))
        for name, budget in (*((f"linkage-atlas, {ms} ms", ms / 1000) for ms in BUDGETS), ("linkage-atlas", None)):
            _, times = methods.setdefault(name, ([], Times()))
            solutions, search_report = times.run(
                product.search, tables, target, limits, 10, 1e-10, product.ProcessorWork(budget)
            )
            note(name, solutions[0].errors.objective if solutions else np.inf)
        first.append(1000 * search_report.trace[0][0] if search_report.trace else np.inf)
        reply = product.la.synthesize(**request, top=3).to_dict()
        broken += any(broken_limits(request, solution) for solution in reply["solutions"])
        for name, method in (
            (f"SLSQP, {SLSQP_STARTS} starts", slsqp),
            ("differential evolution", evolution),
            ("heavy search", heavy_within),
        ):
            _, times = methods.setdefault(name, ([], Times()))
            value = times.run(method, target, limits)
            note(name, np.inf if value is None else value)
    best = np.maximum(np.min([values for values, _ in methods.values()], axis=0), REACHED)
    rows = []
    for name, (values, times) in methods.items():
        over = np.maximum(values, REACHED) / best
        rows.append({"kind": kind, "method": name, "cases": cases, **times.summary()})
        rows[-1] |= {
            "near": float(np.mean(over < CLOSE)),
            "not_far": float(np.mean(over < LOOSE)),
            "worst": report.finite(over.max()),
            "none": int(np.sum(~np.isfinite(values))),
        }
    rows[len(BUDGETS)] |= {"first_ms": report.finite(np.median(first)), "broken": broken}
    return rows


def measure_kept(cases: int) -> dict[str, Any]:
    """Measure motions of linkages that satisfy their limits narrowly; count exact answers."""
    times, reached = Times(), 0
    for seed in range(cases):
        request = make_limited("kept", seed).request
        reply = times.run(product.la.synthesize, **request, top=1).to_dict()
        within = reply["solutions"] and not broken_limits(request, reply["solutions"][0])
        reached += bool(within and recompute(request, reply["solutions"][0]).objective < REACHED)
    return {"cases": cases, "reached": reached / cases, **times.summary()}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """Return the tables of docs/background/measurements.md."""
    rows = [row for part in results["parts"].values() for row in part]
    first_rows, exact = [row for row in rows if "first_ms" in row], results["kept"]
    shown = [row for row in rows if not row["method"].endswith(" ms")]
    return report.tables("limited", {"methods": shown}) | {
        "ours": f"{report.ends([row['first_ms'] for row in first_rows])} ms at the median of each kind; of "
        f"{sum(row['cases'] for row in first_rows)} replies {sum(row['broken'] for row in first_rows)} broke a limit",
        "kept": f"{report.percent(exact['reached'], 3)} of {exact['cases']} below 1e-9, "
        f"{report.significant(exact['median_processor_ms'])} ms at the median",
    }


def measure(
    cases: Annotated[int, "of each kind"] = 60, kept: Annotated[int, "exact cases that just keep their limits"] = 200
) -> Iterator[dict[str, Any]]:
    """Measure the exact cases, then the kinds in turn."""
    threadpool_limits(1, "blas")
    product.la.prepare()
    stamp, parts, exact_result = report.stamp(), {}, measure_kept(kept)
    for kind in KINDS:
        parts[kind] = measure_kind(kind, cases)
        for row in parts[kind]:
            print(row, flush=True)
        yield {"made": stamp, "parts": parts, "kept": exact_result}


if __name__ == "__main__":
    report.run(measure)
