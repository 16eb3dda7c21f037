"""Scores of four-bars: whether they can be used, and the measures by which `synthesis.ranking` compares them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from synthesis.arrays import Flags, Floats
from synthesis.defects import LEAVES_SAMPLES, shared_positions, size_of, verdict
from synthesis.excursions import excursions
from synthesis.four_bar import coupler_angle
from synthesis.fourbar.solution import Solution
from synthesis.free.poses import Poses
from synthesis.linkage import Linkage
from synthesis.ranking import Score
from synthesis.target import Samples, Target

NEAR_CHANGE_POINT = np.deg2rad(10.0)
"""Transmission angle below which a linkage with a change point, such as a parallelogram, is said to come near it."""
_AT_ONCE = 8
"""Number of linkages whose paths are measured at once, which bounds the memory."""


def exact_below(samples: Samples, tolerance: float) -> float:
    """Return J below which a linkage is exact: the tolerance, or the rounding error of positions far from the origin."""
    if samples.position is None:
        return tolerance
    return max(tolerance, 2 * float(np.finfo(float).eps * np.abs(samples.position).max() / samples.length_scale))


def four_bar_proportions(solution: Solution, samples: Poses | Target) -> dict[str, float]:
    """Return size, swing and ratio of a four-bar."""
    size, ratio = size_of(solution.linkage, samples), solution.linkage.link_ratio
    crank = samples.crank if isinstance(samples, Target) else solution.crank
    assert crank is not None
    return {"size": ratio if size is None else size, "swing": float(np.ptp(crank)), "ratio": ratio}


def four_bar_scores(found: Sequence[Solution], poses: Poses, tolerance: float) -> list[Score]:
    """Measure four-bars with free crank angles; each counts as accurate."""
    usable = usable_four_bars(found, poses) & ~np.array(
        [shares_positions(solution, poses) for solution in found], bool
    )
    exact = exact_below(poses, tolerance)
    return [
        Score(
            usable=bool(usable[k]),
            error=0.0 if solution.errors.objective < exact else solution.errors.objective,
            transmission=solution.transmission_angle_min,
            **four_bar_proportions(solution, poses),  # type: ignore[arg-type]
        )
        for k, solution in enumerate(found)
    ]


def passing(samples: Poses | Target) -> dict[str, bool]:
    """Return how the samples are passed, as arguments of `verdicts`."""
    return {"ordered": samples.ordered, "closed": samples.closed} if isinstance(samples, Poses) else {"timed": True}


def usable_four_bars(found: Sequence[Solution], samples: Poses | Target) -> Flags:
    """Check which four-bars have no defect and stay on their path between samples, (n,)."""
    if not found:
        return np.ones(0, dtype=bool)
    linkages = [solution.linkage for solution in found]
    own = [samples.crank if isinstance(samples, Target) else solution.crank for solution in found]
    crank = np.array([[linkage.start] for linkage in linkages]) + np.array(own)
    rows = zip(linkages, crank, found)
    usable = np.array([is_driven(linkage, row, solution, samples) for linkage, row, solution in rows], dtype=bool)
    if isinstance(samples, Poses) and samples.position is not None:
        for first in range(0, len(found), _AT_ONCE):
            few = slice(first, first + _AT_ONCE)
            usable[few] &= ~leaves_path(found[few], samples)
    return usable


def is_driven(linkage: Linkage, coordinate: Floats, solution: Any, samples: Poses | Target) -> bool:
    """Check that the drive takes a linkage through the samples, and not near a change point."""
    passed = verdict(linkage, coordinate, **passing(samples))
    near_change = passed.uncertain and solution.transmission_angle_min < NEAR_CHANGE_POINT
    return passed.order and passed.branch and passed.circuit and not near_change


def shares_positions(solution: Solution, poses: Poses) -> bool:
    """Check whether samples that differ lie at one position of the crank."""
    assert solution.crank is not None
    whole = poses if poses.asked is None else poses.asked
    return bool(shared_positions(poses.timed(solution.crank, whole.rotation)))


def leaves_path(found: Sequence[Solution], poses: Poses) -> Flags:
    """Check whether the body point of each leaves the path between samples, or the body turns otherwise than asked for, (n,)."""
    if not found:
        return np.zeros(0, dtype=bool)
    linkages = [solution.linkage for solution in found]
    crank = np.array([[linkage.start] for linkage in linkages]) + np.array([solution.crank for solution in found])
    side = np.broadcast_to(np.array([[linkage.branch] for linkage in linkages]), crank.shape)
    detours = excursions(linkages, crank, side, poses.extent, ordered=poses.ordered, closed=poses.closed)
    spins = poses.turned_otherwise(rotations_of(found, poses))
    return spins | np.array([detour is not None and detour > LEAVES_SAMPLES for detour in detours], dtype=bool)


def rotations_of(found: Sequence[Solution], poses: Poses) -> Floats:
    """Return the body's rotations (n, M) at the crank angles of `Poses.there_and_back`, but for their offsets."""
    linkages = [solution.linkage for solution in found]
    crank: Any = np.array([linkage.start for linkage in linkages])[:, None]
    crank = crank + np.array([solution.crank for solution in found])
    return coupler_angle(
        np.array([linkage.links for linkage in linkages]),
        np.array([linkage.branch for linkage in linkages]),
        poses.there_and_back(crank),
    )
