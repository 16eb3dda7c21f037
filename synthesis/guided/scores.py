"""Scores of linkages of any kind: whether they can be used, and the measures by which `synthesis.ranking` compares them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from synthesis.arrays import Flags
from synthesis.defects import shared_positions
from synthesis.fourbar import solution as fourbar
from synthesis.free.poses import Poses
from synthesis.free.scores import exact_below, four_bar_proportions, is_driven, shares_positions, usable_four_bars
from synthesis.guided import solution as guided
from synthesis.ranking import Score
from synthesis.target import Target

Solution = fourbar.Solution | guided.GuidedSolution


def scores_of(
    found: Sequence[Solution],
    samples: Poses | Target,
    tolerance: float,
    usable: Sequence[bool] | Flags,
    accurate: Sequence[bool] | Flags | None = None,
    longest: float = np.inf,
) -> list[Score]:
    """Measure linkages.

    Parameters
    ----------
    found : sequence of Solution
        Each with its own crank angles or travel if the samples have none.
    samples : Poses or Target
    tolerance : float
        Objective below which a linkage is exact.
    usable : sequence of bool
        See `usable_linkages`.
    accurate : sequence of bool, optional
        Whether the error of each is small enough for the preference to count; default: all.
    longest : float
        Largest proportion up to which a linkage counts with its own error.

    Returns
    -------
    list of Score
    """
    exact = exact_below(samples, tolerance)
    return [
        Score(
            usable=bool(usable[k]),
            accurate=accurate is None or bool(accurate[k]),
            error=0.0 if solution.errors.objective < exact else solution.errors.objective,
            transmission=solution.transmission_angle_min,
            longest=longest,
            size=proportions["size"],
            swing=proportions["swing"],
            ratio=proportions["ratio"],
        )
        for k, solution in enumerate(found)
        if (proportions := proportions_of(solution, samples))
    ]


def proportions_of(solution: Solution, samples: Poses | Target) -> dict[str, float]:
    """Return size, swing and ratio of a linkage."""
    if isinstance(solution, fourbar.Solution):
        return four_bar_proportions(solution, samples)
    lengths = list(solution.linkage.lengths.values())
    ratio = max(lengths) / min(lengths) if lengths and min(lengths) > 0 else 1.0
    size, turns = guided.size_of(solution, samples), solution.linkage.driver.turns
    swing = float(np.ptp(solution.travel)) if turns else np.inf
    return {"size": ratio if size is None else size, "swing": swing, "ratio": ratio}


def usable_linkages(
    found: Sequence[Solution], samples: Poses | Target, within_tolerances: Sequence[bool] | None = None
) -> Flags:
    """Check which linkages can be used, (n,): see the first criterion of `synthesis.ranking.CRITERIA`.

    ``within_tolerances``: two samples may share a position of the drive in a linkage that keeps the tolerances there.
    """
    usable = np.ones(len(found), dtype=bool)
    four_bars = {k: solution for k, solution in enumerate(found) if isinstance(solution, fourbar.Solution)}
    usable[list(four_bars)] = usable_four_bars(list(four_bars.values()), samples)
    for k, solution in enumerate(found):
        if isinstance(solution, guided.GuidedSolution):
            usable[k] = _usable_guided(solution, samples)
        tolerated = within_tolerances is not None and within_tolerances[k]
        if usable[k] and isinstance(samples, Poses) and not tolerated:
            usable[k] = not _shares_positions(solution, samples)
    return usable


def _usable_guided(solution: guided.GuidedSolution, samples: Poses | Target) -> bool:
    target = guided.as_target(samples, solution.linkage, solution.travel)
    if not is_driven(solution.linkage, solution.linkage.start + target.crank, solution, samples):
        return False
    return not (isinstance(samples, Poses) and samples.position is not None and guided.goes_astray(solution, samples))


def _shares_positions(solution: Solution, samples: Poses) -> bool:
    """Check whether samples that differ lie at one position of the drive."""
    if isinstance(solution, fourbar.Solution):
        return shares_positions(solution, samples)
    target = guided.as_target(samples, solution.linkage, solution.travel)
    return bool(shared_positions(target, solution.linkage.driver.turns))
