"""The search without crank angles: which way a request goes, and what comes back."""

from __future__ import annotations

import numpy as np

from synthesis.fourbar.limits import Limits
from synthesis.fourbar.solution import Solution
from synthesis.free.answers import solutions_of
from synthesis.free.motion import chart_of, search_motion
from synthesis.free.poses import Poses
from synthesis.ranking import Status
from synthesis.search.search import DEFAULT_TOLERANCE, SearchReport, StoppedBy
from synthesis.work import Work


def search_free(
    poses: Poses, limits: Limits, top: int, tolerance: float = DEFAULT_TOLERANCE, work: Work | None = None
) -> tuple[list[Solution], SearchReport]:
    """The best four-bars for samples whose crank angles are free.

    Parameters
    ----------
    poses : Poses
    limits : Limits
    top : int
        At most this many solutions, different from one another, best first.
    tolerance : float
        Stop the search when the objective is below it.
    work : Work, optional
        Once it has expired the best found so far is returned.

    Returns
    -------
    solutions : list of Solution
        Within the limits, each with its crank angles.
    report : SearchReport
    """
    work = work or Work()
    trace: list[tuple[float, float]] = []

    def note(objective: float) -> None:
        if np.isfinite(objective) and (not trace or objective < trace[-1][1]):
            trace.append((work.elapsed, objective))

    pool, ended = search_motion(poses, limits.family, tolerance, work, note)
    solutions = solutions_of(poses, pool, chart_of(limits.family), limits, top, tolerance)
    if Status.of(solutions, tolerance) is Status.REACHED:
        stopped = StoppedBy.TOLERANCE
    else:
        stopped = StoppedBy.CONVERGED if ended else StoppedBy.BUDGET
    return solutions, SearchReport(stopped, trace, 0.0, pool.cost.size)
