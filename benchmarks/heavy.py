"""A search that spares no effort, to hold the software's answers against: many random seeds, each refined to convergence.

It shares the local refinement with the software, but none of its atlas, screening, thinning or stopping. Target and limits
are those of a crank that turns counter-clockwise.
"""

from __future__ import annotations

import numpy as np

from benchmarks import product

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
