"""Searches that spare no effort, to hold the software's answers against: many random seeds, each refined to convergence.

They share the local refinement with the software, but none of its atlas, screening, thinning or stopping.
"""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from synthesis.fourbar.charts import AnyChart, Chart, FullCrankChart
from synthesis.fourbar.kinematics import TURN, family
from synthesis.fourbar.limits import Limits
from synthesis.search.refine import LimitedProblem, Problem, refine
from synthesis.search.search import mirrored
from synthesis.target import Target

SHEETS = {"crank_rocker": -1, "double_crank": 1}


def random_seeds(random: Generator, chart: Chart, sheet: int, count: int) -> np.ndarray:
    """Unknowns (count, 4): lengths uniform on the simplex among those of the family, starts uniform over the turn."""
    parts: list[np.ndarray] = []
    held = 0
    while held < count:
        lengths = random.dirichlet(np.ones(4), size=4 * count)
        if not isinstance(chart, AnyChart):
            names = family(lengths)
            keep = {-1: ["crank_rocker"], 1: ["double_crank"], 0: ["crank_rocker", "double_crank"]}[sheet]
            lengths = lengths[np.isin(names.astype(str), keep)]
        parts.append(lengths)
        held += len(lengths)
    lengths = np.concatenate(parts)[:count]
    return np.column_stack([chart.unknowns(lengths), random.uniform(0, TURN, count)])


def heavy_objective(
    target: Target, starts: int = 300, draws: int = 6000, seed: int = 5, iterations: int = 150
) -> float:
    """The least J that a heavy search finds among all four-bars whose crank turns fully.

    Parameters
    ----------
    target : Target
    starts : int
        Seeds refined for each branch, the better part of ``draws`` random ones.
    draws, seed, iterations : int
    """
    canonical = mirrored(target) if target.span < 0 else target
    random = np.random.default_rng(seed)
    chart = FullCrankChart()
    problem = Problem(canonical, chart)
    ends, branches, costs = [], [], []
    for branch in (1.0, -1.0):
        unknowns = np.concatenate([random_seeds(random, chart, sheet, draws // 2) for sheet in (-1, 1)])
        side = np.full(len(unknowns), branch)
        cost = problem.evaluate(unknowns, side, derivatives=False).cost
        best = np.argsort(cost, kind="stable")
        # two thirds the best of all, one third at random: neither one valley nor hopeless seeds alone
        chosen = np.concatenate([best[: 2 * starts // 3], random.choice(best[2 * starts // 3 : 3000], starts // 3)])
        done = refine(problem, unknowns[chosen], side[: len(chosen)], iterations)
        ends.append(done.unknowns)
        branches.append(done.branch)
        costs.append(done.cost)
    unknowns, branch, cost = (np.concatenate(parts) for parts in (ends, branches, costs))
    best = np.argsort(cost, kind="stable")[:40]
    return float(np.sqrt(refine(problem, unknowns[best], branch[best], 2000).cost.min()))


def heavy_within(
    target: Target, limits: Limits, starts: int = 300, draws: int = 20000, seed: int = 6
) -> float | None:
    """The least J of a linkage within limits that a heavy search finds; None where it finds none.

    Feasibility is looked for first at random, then by refinement of the penalty alone from the seeds that violate least.
    """
    clockwise = target.span < 0
    canonical = mirrored(target) if clockwise else target
    box = limits.pivot_box
    if clockwise and box is not None:
        limits = Limits(
            limits.family,
            limits.transmission_angle_min,
            (box[0], -box[3], box[2], -box[1]),
            limits.link_min,
            limits.link_max,
        )
    random = np.random.default_rng(seed)
    sheet = SHEETS.get(limits.family, 0)
    charts: list[Chart] = [FullCrankChart()] + ([AnyChart()] if limits.family == "any" else [])
    least = np.inf
    for chart in charts:
        sheets = (-1, 1) if sheet == 0 and not isinstance(chart, AnyChart) else (sheet,)
        unknowns = np.concatenate([random_seeds(random, chart, part, draws // len(sheets)) for part in sheets])
        for branch in (1.0, -1.0):
            side = np.full(len(unknowns), branch)
            problems = [LimitedProblem(canonical, chart, sheet, limits, weight) for weight in (0.3, 10.0, 1e3, 1e5)]
            free = LimitedProblem(canonical, chart, sheet, limits, 0.0)
            cost = Problem(canonical, chart, sheet).evaluate(unknowns, side, derivatives=False).cost
            lifted = free.lift(unknowns, side)
            slacks = np.nan_to_num(free.slacks(lifted), nan=-1e3, neginf=-1e3)
            violation = np.where(np.isfinite(cost), np.sum(np.minimum(slacks, 0.0) ** 2, axis=1), np.inf)
            least = min(least, cost[violation == 0].min(initial=np.inf))
            chosen = np.unique(
                np.concatenate([np.argsort(violation)[: starts // 2], np.argsort(cost)[: starts // 2]])
            )
            chosen = chosen[np.isfinite(cost[chosen])]
            seeds, side = lifted[chosen], side[chosen]
            for problem in problems:
                done = refine(problem, seeds, side, 60)
                seeds = done.unknowns
                cost = free.evaluate(seeds, side).cost
                inside = np.all(free.slacks(seeds) >= 0, axis=1)
                least = min(least, cost[inside].min(initial=np.inf))
    return float(np.sqrt(least)) if np.isfinite(least) else None
