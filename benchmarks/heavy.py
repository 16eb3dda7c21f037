"""A search that spares no effort, to hold the software's answers against: many random seeds, each refined to convergence.

It shares the local refinement with the software, but none of its atlas, screening, thinning or stopping. Target and limits
are those of a crank that turns counter-clockwise.
"""

from __future__ import annotations

import numpy as np

from benchmarks import product

STAGES = [product.Stage(15, weight=weight) for weight in (0.3, 1.0, 3.0, 10.0, 10.0, 17.0, 30.0, 100.0)]
FAMILIES = {-1: ["crank_rocker"], 1: ["double_crank"], 0: ["crank_rocker", "double_crank"]}


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
        seeds = product.GivenProblem(target, way.chart).measured(
            product.given(way.chart.unknowns(lengths), branch, start)
        )
        best = np.argsort(seeds.cost, kind="stable")[: np.isfinite(seeds.cost).sum()]
        chosen = np.concatenate([best[: starts // 2], random.permutation(best)[: starts // 2]])
        found = problem.descended(seeds.timed.take(chosen), STAGES)
        found, _ = problem.moved_onto(found.timed)
        found = found.take(np.isfinite(found.cost))
        linkages = problem.linkages(product.FOURBAR, found)
        kept = product.FOURBAR.within(target, limits, product.FOURBAR.assess(target, linkages))
        least = min([least, *(one.errors.objective for one in kept)])
    return float(least) if np.isfinite(least) else None
