"""Scores of solutions: whether they can be used, and the measures by which `synthesis.ranking` compares them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from synthesis.arrays import Flags, Floats
from synthesis.defects import passage, shared_positions
from synthesis.excursions import LEAVES_SAMPLES, excursions_of
from synthesis.guides import Circle
from synthesis.linkage import Linkage
from synthesis.linkages import body_motions
from synthesis.poses import Poses
from synthesis.ranking import Score
from synthesis.solution import Solution
from synthesis.target import Interval, Samples, Target

NEAR_CHANGE_POINT = np.deg2rad(10.0)
"""Transmission angle below which a linkage with a change point, such as a parallelogram, is said to come near it."""
_AT_ONCE = 8
"""Number of linkages whose paths are measured at once, which bounds the memory."""


def exact_below(samples: Samples, tolerance: float) -> float:
    """Return J below which a linkage is exact: the tolerance, or the rounding error of positions far from the origin."""
    if samples.position is None:
        return tolerance
    return max(tolerance, 2 * float(np.finfo(float).eps * np.abs(samples.position).max() / samples.length_scale))


def scores_of(
    found: Sequence[Solution],
    samples: Poses | Target,
    tolerance: float,
    within_tolerances: Sequence[bool] | None = None,
) -> list[Score]:
    """Measure solutions, all of which count as accurate.

    Parameters
    ----------
    found : sequence of Solution
    samples : Poses or Target
    tolerance : float
        Objective below which a linkage is exact.
    within_tolerances : sequence of bool, optional
        See `usable_solutions`.
    """
    exact, strays = exact_below(samples, tolerance), straying(found, samples)
    usable = usable_solutions(found, samples, strays, within_tolerances)
    return [
        Score(
            usable=bool(can_be_used),
            strays=bool(leaves),
            error=0.0 if solution.errors.objective < exact else solution.errors.objective,
            transmission=solution.transmission_angle_min,
            size=relative_size(solution, samples),
            swing=swing_of(solution),
            ratio=solution.linkage.link_ratio,
        )
        for solution, can_be_used, leaves in zip(found, usable, strays)
    ]


# -- proportions ----------------------------------------------------------------------------------------------------------


def swing_of(solution: Solution) -> float:
    """Return the angle between the extreme positions of the drive at the samples; infinity for a drive that slides."""
    return float(np.ptp(solution.travel)) if solution.linkage.driver.turns else np.inf


def relative_size(solution: Solution, samples: Samples) -> float:
    """Return the size over the motion's extent; without positions the ratio of the links."""
    size = size_of(solution.linkage, samples, solution.interval)
    return solution.linkage.link_ratio if size is None else size


def size_of(linkage: Linkage, samples: Samples, interval: Interval | None = None) -> float | None:
    """Return the largest length of a mounted linkage over the motion's extent; None without positions.

    Lengths are links, distances of the body point from its joints, distances of fixed pivots, pins and used rails from the
    motion's middle, and used slots. The body point of a four-bar counts with its distance from the crank pin only.

    ``interval``: travel that the motion uses, which rails and slots need.
    """
    if samples.position is None or not linkage.mounted:
        return None
    middle = samples.middle
    if linkage.is_four_bar:
        pivots = abs(linkage.pivot_a - middle), abs(linkage.pivot_b - middle)
        return float(max(*linkage.links, abs(linkage.arm), *pivots)) / samples.extent
    assert interval is not None
    lengths = [length for name, length in linkage.lengths.items() if name == "coupler"]
    for index, guide in enumerate(linkage.guides):
        if isinstance(guide, Circle):
            lengths += [guide.radius, abs(guide.pivot - middle), abs(guide.body_point)]
            continue
        ends = np.array(linkage.used(index, interval))
        lengths.append(float(np.ptp(ends)))
        lengths += [float(np.max(np.abs(guide.ground_at(ends) - middle))), float(np.max(np.abs(guide.body_at(ends))))]
    return max(lengths) / samples.extent


def proportion(linkage: Linkage, samples: Samples) -> float:
    """Return the longest part of a four-bar over the motion's extent, or over the shortest link, whichever is larger."""
    return max(linkage.link_ratio, size_of(linkage, samples) or 0.0)


# -- use ------------------------------------------------------------------------------------------------------------------


def usable_solutions(
    found: Sequence[Solution], samples: Poses | Target, strays: Flags, within_tolerances: Sequence[bool] | None = None
) -> Flags:
    """Check which solutions can be used, (n,): see the first criterion of `synthesis.ranking.CRITERIA`.

    ``within_tolerances``: two samples may share a position of the drive in a linkage that satisfies the tolerances there.
    """
    usable = ~strays & np.array([_is_driven(solution, samples) for solution in found], dtype=bool)
    if not isinstance(samples, Poses):
        return usable
    rotation = (samples.requested or samples).rotation
    for k, solution in enumerate(found):
        tolerated = within_tolerances is not None and within_tolerances[k]
        if usable[k] and not tolerated:
            usable[k] = not shared_positions(samples.timed(solution.travel, rotation), solution.linkage.driver.turns)
    return usable


def straying(found: Sequence[Solution], samples: Poses | Target) -> Flags:
    """Check whether each body point leaves the path between samples, or the body turns differently from the request, (n,)."""
    strays = np.zeros(len(found), dtype=bool)
    if isinstance(samples, Poses) and samples.position is not None:
        for first in range(0, len(found), _AT_ONCE):
            strays[first : first + _AT_ONCE] = _leaves_path(found[first : first + _AT_ONCE], samples)
    return strays


def passing(samples: Poses | Target) -> dict[str, bool]:
    """Return the order of passage as arguments of `synthesis.defects.passage`."""
    return {"ordered": samples.ordered, "closed": samples.closed} if isinstance(samples, Poses) else {"timed": True}


def _is_driven(solution: Solution, samples: Poses | Target) -> bool:
    """Check that the drive moves a linkage through the samples, and not near a change point."""
    linkage = solution.linkage
    passed = passage(linkage, linkage.start + solution.travel, linkage.branch, **passing(samples))
    near_change = passed.uncertain and solution.transmission_angle_min < NEAR_CHANGE_POINT
    return passed.driven and not near_change


def _leaves_path(found: Sequence[Solution], poses: Poses) -> Flags:
    """Check whether each body point leaves the path between samples, or the body turns differently from the request, (n,)."""
    spins = [bool(poses.turned_otherwise(rotation)) for rotation in rotations_of(found, poses)]
    return np.array(
        [
            spin or (excursion is not None and excursion > LEAVES_SAMPLES)
            for spin, excursion in zip(spins, excursions_of(found, poses))
        ],
        dtype=bool,
    )


def rotations_of(found: Sequence[Solution], poses: Poses) -> list[Floats]:
    """Return the rotations of each body, continuous, at the travel of `Poses.there_and_back`; drives that slide do not return."""
    rotations: list[Floats] = [np.empty(0)] * len(found)
    for turns in (True, False):
        rows = [k for k, solution in enumerate(found) if solution.linkage.driver.turns == turns]
        if rows:
            travel = np.array([found[k].travel for k in rows])
            travel = poses.there_and_back(travel) if turns else travel
            for k, rotation in zip(rows, body_motions([found[k].linkage for k in rows], travel).rotation):
                rotations[k] = rotation
    return rotations
