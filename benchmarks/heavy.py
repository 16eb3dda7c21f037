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


def heavy_poses(rotation: np.ndarray, position: np.ndarray, starts: int = 1500, seed: int = 7) -> float:
    """The least J that a heavy search finds for poses without crank angles, passed in their order by a crank that turns fully.

    Shapes, crank angles, directions and branches are random; all descend together over lengths, pose and angles.

    Parameters
    ----------
    rotation : ndarray, shape (N,)
        Radians.
    position : ndarray, shape (N,), complex
    starts, seed : int
    """
    random, chart = np.random.default_rng(seed), product.GrashofChart()
    problem = product.JointProblem(product.make_poses(rotation, position), chart)
    seeds = random_seeds(random, product.FullCrankChart(), 0, starts)
    gaps = random.dirichlet(np.ones(position.size - 1), size=starts) * random.uniform(0.3, 6.2, (starts, 1))
    way = np.concatenate([np.zeros((starts, 1)), np.cumsum(gaps, axis=1)], axis=1)
    timed = product.Timed(
        chart.unknowns(product.FullCrankChart().shape(seeds[:, :-1]).lengths),
        np.zeros((starts, 3), dtype=complex),
        np.zeros(starts),
        seeds[:, -1:] + random.choice([-1, 1], (starts, 1)) * way,
        random.choice(BRANCHES, starts),
    )
    found = problem.descended(problem.facing(timed), [product.Stage(150)])
    best = np.argsort(found.cost, kind="stable")[:40]
    return float(np.sqrt(problem.descended(found.timed.take(best), [product.Stage(500)]).cost.min()))


def heavy_within(
    target: product.Target, limits: product.Limits, starts: int = 300, draws: int = 4000, seed: int = 6
) -> float | None:
    """The least J of a linkage within limits that a heavy search finds; None where it finds none.

    Seeds are random shapes in their best pose, whatever the limits; half of those that descend are the best, half any.
    """
    random, least = np.random.default_rng(seed), np.inf
    for way in product.FOURBAR.bounded(target, limits):
        problem = product.problem_of(target, way)
        families = FAMILIES[{"crank_rocker": -1, "double_crank": 1}.get(limits.family, 0)]
        lengths = random.dirichlet(np.ones(4), size=8 * draws)
        if limits.family != "any":
            lengths = lengths[np.isin(product.family(lengths).astype(str), families)]
        lengths = lengths[:draws]
        start, branch = random.uniform(0, product.TURN, len(lengths)), random.choice([-1.0, 1.0], len(lengths))
        angle = product.coupler_angle(lengths, branch, start[:, None] + target.crank)
        closes = np.isfinite(angle).all(axis=1)
        lengths, start, branch, angle = lengths[closes], start[closes], branch[closes], angle[closes]
        if way.boxes is None:
            seeds = np.column_stack([way.chart.unknowns(lengths), start])
        else:
            fit, scale = product.fit_positions(target, angle), target.length_scale
            size = np.abs(fit.crank_vector) / scale / lengths[:, 0]
            size = np.clip(size, 1e-3, 1e3)
            pose = product.Poses(
                (fit.pivot - problem.middle) / scale, np.angle(fit.crank_vector) - start, fit.coupler_vector / scale
            )
            seeds = problem.posed(way.chart.unknowns(lengths * size[:, None]), start, pose)
        cost = problem.evaluate(seeds, branch).cost
        best = np.argsort(cost, kind="stable")
        chosen = np.concatenate([best[: starts // 2], random.permutation(best)[: starts // 2]])
        for plan in ((60, (0.1, 1.0, 10.0, 100.0), 15), (60, (100.0, 300.0, 1000.0), 15)):
            found = product.descend(problem, seeds[chosen], branch[chosen], product.Plan(*plan), product.Work())
            seeds[chosen] = found.unknowns
        found = product.restored(problem, found)
        linkages = problem.linkages(product.FOURBAR, found.unknowns, found.branch, target)
        kept = product.FOURBAR.within(target, limits, product.FOURBAR.assess(target, linkages))
        least = min([least, *(one.errors.objective for one in kept)])
    return float(least) if np.isfinite(least) else None
