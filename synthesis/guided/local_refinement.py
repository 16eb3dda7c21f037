"""Refinement of a given linkage with rails or slots: the nearest optimum for a motion that lies within the limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from synthesis.arrays import Floats
from synthesis.guided.search import PairSearch
from synthesis.guided.seeds import Drive
from synthesis.limits import Limits
from synthesis.linkage import Linkage
from synthesis.poses import Poses
from synthesis.ranking import Status
from synthesis.search.report import SearchReport, StoppedBy
from synthesis.solution import Solution, assess
from synthesis.studies.rounding import nearest_travel, squared_errors
from synthesis.target import TURN
from synthesis.violations import within
from synthesis.work import Work

GRID = 241
"""Number of drive positions at which a linkage is compared with the samples."""
REACH = 3.0
"""Travel of a slide on either side of its start that is compared with the samples, in length scales of the motion."""


def refine_guided(
    poses: Poses, limits: Limits, linkage: Linkage, tolerance: float, work: Work, drive: Floats | None = None
) -> tuple[list[Solution], SearchReport]:
    """Find the best linkage by descents from a given linkage.

    Parameters
    ----------
    poses : Poses
        Motion with positions.
    limits : Limits
    linkage : Linkage
        Mounted, with at least one rail or slot.
    tolerance : float
        Objective below which a linkage is exact.
    work : Work
        If it has expired, the best linkage found is returned.
    drive : ndarray, shape (N,), optional
        Given travel of the drive from the first sample, in radians or in the unit of length.

    Returns
    -------
    solutions : list of Solution
        At most a single linkage, within the limits; empty if no descent led into them.
        Law: if the given linkage satisfies the limits, the error of the solution is no larger than its error.
    report : SearchReport
    """
    travel = fitting_travel(poses, linkage) if drive is None else drive
    if travel is None:
        return [], SearchReport(StoppedBy.CONVERGED, [], seeds=0)
    begin = _assessed(poses, limits, linkage, travel, drive is not None)
    turned = None
    if poses.rotation is None or poses.rotation_weights is not None:
        turned = linkage.body(linkage.start + travel).rotation
    driven_pair = Drive(linkage.kind, type(linkage.guides[0]), type(linkage.guides[1]), linkage.driver)
    search = PairSearch(poses, limits, [driven_pair], tolerance, work, drive, turned)
    search.refine(linkage)
    found = sorted([*begin, *search.solutions()], key=lambda solution: solution.errors.objective)[:1]
    trace = [(work.elapsed, found[0].errors.objective)] if found else []
    reached = Status.of(found, tolerance) is Status.REACHED
    ended = StoppedBy.BUDGET if work.expired() else StoppedBy.CONVERGED
    return found, SearchReport(StoppedBy.TOLERANCE if reached else ended, trace, seeds=1)


def fitting_travel(poses: Poses, linkage: Linkage) -> Floats | None:
    """Return the travel (N,) at which the body comes nearest to each sample; None if the loop closes nowhere on the grid."""
    turns = linkage.driver.turns
    reach = TURN / 2 if turns else REACH * poses.length_scale
    grid = np.linspace(-reach, reach, GRID)
    closing = grid[np.isfinite(linkage.body(linkage.start + grid).position)]
    if not closing.size:
        return None
    errors = np.array([squared_errors(poses, linkage, np.full(poses.samples, travel)) for travel in closing])
    travel = nearest_travel(poses, linkage, closing[np.argmin(errors, axis=0)])
    return np.unwrap(travel) if turns else travel


def _assessed(poses: Poses, limits: Limits, linkage: Linkage, travel: Floats, is_given: bool) -> list[Solution]:
    """Return the given linkage if it passes the samples in their order within the limits."""
    steps = np.diff(travel)
    if poses.ordered and not is_given and not (np.all(steps > 0) or np.all(steps < 0)):
        return []
    if poses.closed and not linkage.turns_fully:
        return []
    complete = poses.whole(travel) if linkage.driver.turns else travel
    (solution,) = assess(poses, [replace(linkage)], complete)
    if not np.isfinite(solution.errors.objective) or not solution.transmission_angle_min > 0:
        return []
    return within(poses, limits, [solution])
