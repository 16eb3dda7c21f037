"""Exhaustive search for references: many random seeds, each refined to convergence.

It shares the local refinement with the product, but not its atlas, screening, thinning or stopping. Target and
limits are those of a crank that turns counter-clockwise.
"""

from __future__ import annotations

import numpy as np

from benchmarks import product

STAGES = [product.Stage(15, weight=weight) for weight in (0.3, 1.0, 3.0, 10.0, 10.0, 17.0, 30.0, 100.0)]
FAMILIES = {-1: ["crank_rocker"], 1: ["double_crank"], 0: ["crank_rocker", "double_crank"]}


def heavy_within(
    target: product.Target, limits: product.Limits, starts: int = 300, draws: int = 4000, seed: int = 6
) -> float | None:
    """Return the smallest J of a linkage within limits that a heavy search finds; None if it finds none.

    Seeds are random shapes in their best pose, regardless of the limits; half of the refined seeds are the best
    seeds, and half are random.
    """
    random, smallest = np.random.default_rng(seed), np.inf
    for bounded in product.search_spaces(target, limits):
        problem = product.problem_of(target, bounded)
        families = FAMILIES[{"crank_rocker": -1, "double_crank": 1}.get(limits.family, 0)]
        lengths = random.dirichlet(np.ones(4), size=8 * draws)
        if limits.family != "any":
            lengths = lengths[np.isin(product.family(lengths).astype(str), families)]
        lengths = lengths[:draws]
        start, branch = random.uniform(0, product.TURN, len(lengths)), random.choice([-1.0, 1.0], len(lengths))
        seeds = product.GivenProblem(target, bounded.chart).measured(
            product.candidates_at(bounded.chart.unknowns(lengths), branch, start)
        )
        best = np.argsort(seeds.cost, kind="stable")[: np.isfinite(seeds.cost).sum()]
        chosen = np.concatenate([best[: starts // 2], random.permutation(best)[: starts // 2]])
        found = problem.descended(seeds.timed.take(chosen), STAGES)
        found, _ = problem.moved_onto(found.timed)
        found = found.take(np.isfinite(found.cost))
        linkages = problem.linkages(found)
        within = product.within(target, limits, product.assess(target, linkages))
        smallest = min([smallest, *(linkage.errors.objective for linkage in within)])
    return float(smallest) if np.isfinite(smallest) else None
