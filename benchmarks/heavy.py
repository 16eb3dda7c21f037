"""Searches that spare no effort, to hold the software's answers against: many random seeds, each refined to convergence.

They share the local refinement with the software, but none of its atlas, screening, thinning or stopping. Targets and limits
are those of a crank that turns counter-clockwise.
"""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from benchmarks import product

BRANCHES = (1.0, -1.0)
FAMILIES = {-1: ["crank_rocker"], 1: ["double_crank"], 0: ["crank_rocker", "double_crank"]}


def random_seeds(random: Generator, chart: product.Chart, sheet: int, count: int) -> np.ndarray:
    """Unknowns (count, 4): lengths uniform on the simplex among those of the family, starts uniform over the turn."""
    lengths = np.empty((0, 4))
    while len(lengths) < count:
        more = random.dirichlet(np.ones(4), size=4 * count)
        if not isinstance(chart, product.AnyChart):
            more = more[np.isin(product.family(more).astype(str), FAMILIES[sheet])]
        lengths = np.concatenate([lengths, more])
    return np.column_stack([chart.unknowns(lengths[:count]), random.uniform(0, product.TURN, count)])


def heavy_objective(
    target: product.Target, starts: int = 300, draws: int = 6000, seed: int = 5, iterations: int = 150
) -> float:
    """The least J that a heavy search finds among all four-bars whose crank turns fully.

    Parameters
    ----------
    target : product.Target
    starts : int
        Seeds refined for each branch, the better part of ``draws`` random ones.
    draws, seed, iterations : int
    """
    random, chart = np.random.default_rng(seed), product.FullCrankChart()
    problem = product.ProjectedProblem(target, chart)
    ends = []
    for branch in BRANCHES:
        unknowns = np.concatenate([random_seeds(random, chart, sheet, draws // 2) for sheet in (-1, 1)])
        side = np.full(len(unknowns), branch)
        best = np.argsort(problem.evaluate(unknowns, side, derivatives=False).cost, kind="stable")
        # two thirds the best of all, one third at random: neither one valley nor hopeless seeds alone
        chosen = np.concatenate([best[: 2 * starts // 3], random.choice(best[2 * starts // 3 : 3000], starts // 3)])
        done = product.refine(problem, unknowns[chosen], side[: len(chosen)], iterations)
        ends.append((done.unknowns, side[: len(chosen)], done.cost))
    unknowns, branch, cost = map(np.concatenate, zip(*ends))
    best = np.argsort(cost, kind="stable")[:40]
    return float(np.sqrt(product.refine(problem, unknowns[best], branch[best], 2000).cost.min()))


def heavy_within(
    target: product.Target, limits: product.Limits, starts: int = 300, draws: int = 20000, seed: int = 6
) -> float | None:
    """The least J of a linkage within limits that a heavy search finds; None where it finds none.

    Feasibility is looked for first at random, then by refinement of the penalty alone from the seeds that violate least.
    """
    random = np.random.default_rng(seed)
    least = np.inf
    for chart in product.FOURBAR.charts(limits.family):
        sheets = (-1, 1) if chart.sheet == 0 and not isinstance(chart, product.AnyChart) else (chart.sheet,)
        unknowns = np.concatenate([random_seeds(random, chart, part, draws // len(sheets)) for part in sheets])
        for branch in BRANCHES:
            side = np.full(len(unknowns), branch)
            free = product.LimitedProblem(product.FOURBAR, target, chart, limits, 0.0)
            cost = product.ProjectedProblem(target, chart).evaluate(unknowns, side, derivatives=False).cost
            seeds = free.with_pose(unknowns, side)
            slacks = np.nan_to_num(free.slacks(seeds), nan=-1e3, neginf=-1e3)
            violation = np.where(np.isfinite(cost), np.sum(np.minimum(slacks, 0.0) ** 2, axis=1), np.inf)
            least = min(least, cost[violation == 0].min(initial=np.inf))
            chosen = np.union1d(np.argsort(violation)[: starts // 2], np.argsort(cost)[: starts // 2])
            chosen = chosen[np.isfinite(cost[chosen])]
            seeds, side = seeds[chosen], side[chosen]
            for weight in (0.3, 10.0, 1e3, 1e5):
                seeds = product.refine(
                    product.LimitedProblem(product.FOURBAR, target, chart, limits, weight), seeds, side, 60
                ).unknowns
                cost = free.evaluate(seeds, side).cost
                least = min(least, cost[np.all(free.slacks(seeds) >= 0, axis=1)].min(initial=np.inf))
    return float(np.sqrt(least)) if np.isfinite(least) else None
