"""The search without crank angles: which way a request goes, and what comes back.

Data flow of a request::

    poses --(three and more samples with rotation and position, or only such)--> dyads and their pairs: `motion`
          --(otherwise, or where that is not exact and samples lack a part, or is far off)--> guessed timings: `path`
      -> candidates with crank angles -> within the limits, ranked, different from one another: `answers`
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError
from synthesis.fourbar.charts import FullCrankChart
from synthesis.fourbar.dimension_types import OrderRule, TypeRule, enumerate_types
from synthesis.fourbar.grashof_chart import GrashofChart
from synthesis.fourbar.limits import Limits, in_family
from synthesis.fourbar.mechanism import FOURBAR
from synthesis.fourbar.solution import Solution
from synthesis.free.answers import solutions_of
from synthesis.free.limited import within_limits
from synthesis.free.motion import FEW, chart_of, search_motion
from synthesis.free.path import search_path
from synthesis.free.pool import Pool
from synthesis.free.poses import Poses
from synthesis.free.schedule import GUESSED, PATH
from synthesis.free.screen import COARSE, FINE, PathScreen
from synthesis.mechanism import Chart
from synthesis.ranking import Status
from synthesis.search.search import DEFAULT_TOLERANCE, SearchReport, StoppedBy
from synthesis.search.windows import Windows
from synthesis.work import Work


def bounded_windows(family: str) -> Windows:
    """The windows that a search within limits begins with."""
    return Windows(FOURBAR, FOURBAR.bounded_types(family))


Screens = Callable[[str], Sequence[PathScreen]]
"""Gives the screens of a family; made once by whoever keeps them."""
_COARSE_PERIMETER, _FINE_PERIMETER, _FINE_SEEDS = 28, 44, 1000
_FEWEST_FULL = 3
"""Samples with rotation and position from which on dyads lead to four-bars that fit the others too."""

_FAR = 0.01
"""J from which on poses are no four-bar's with some noise."""


def path_screens(family: str) -> tuple[PathScreen, ...]:
    """The coarse and the fine screen for paths, of the types of a family whose crank turns fully (6 MB)."""

    def types(perimeter: int) -> NDArray[np.float64]:
        lengths = enumerate_types(TypeRule(perimeter, 1, OrderRule.FULL_CRANK)).astype(float)
        return lengths[in_family(family, lengths)]

    spread = FullCrankChart()
    coarse = PathScreen(FOURBAR, types(_COARSE_PERIMETER), spread, COARSE)
    return coarse, PathScreen(FOURBAR, types(_FINE_PERIMETER), spread, FINE, _FINE_SEEDS)


def search_free(
    poses: Poses,
    limits: Limits,
    top: int,
    tolerance: float = DEFAULT_TOLERANCE,
    work: Work | None = None,
    screens: Screens = path_screens,
    windows: Callable[[str], Windows] = bounded_windows,
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
    screens, windows : callable
        For paths, and for limits, by family; made once by whoever keeps them.

    Returns
    -------
    solutions : list of Solution
        Within the limits, each with its crank angles.
    report : SearchReport

    Raises
    ------
    FieldError
        For a path in any order.
    """
    work = work or Work()
    trace: list[tuple[float, float]] = []

    def note(objective: float) -> None:
        if np.isfinite(objective) and (not trace or objective < trace[-1][1]):
            trace.append((work.elapsed, objective))

    def note_free(objective: float) -> None:
        if limits.only_family:  # otherwise what is found may lie outside of the limits
            note(objective)

    chart, solutions, pool = chart_of(limits.family), list[Solution](), None
    ended, seeds, unfinished = True, 0, True
    if poses.full.size >= _FEWEST_FULL or poses.full.size == poses.samples:
        pool, ended = search_motion(poses, limits.family, tolerance, work, note_free)
        seeds = pool.cost.size
        # dyads that fit alone are far from fitting together where the motion is far from any four-bar's; the search within
        # limits has beginnings of its own
        unfinished = limits.only_family and poses.ordered and poses.samples > FEW and pool.least > _FAR
        if not unfinished or work.expired():
            solutions = _within(poses, pool, chart, limits, top, tolerance, work, windows)
            note(min((one.errors.objective for one in solutions), default=np.inf))
            mixed = poses.full.size < poses.samples
            unfinished = not solutions or (mixed and Status.of(solutions, tolerance) is not Status.REACHED)
    elif not poses.ordered:
        raise FieldError("/order", "'any' needs rotation and position at three samples or more: a path has an order")
    if pool is None or (unfinished and poses.ordered and not work.expired()):
        begin, schedule = work.elapsed, GUESSED if poses.full.size == poses.samples else PATH
        found = search_path(poses, GrashofChart(), screens(limits.family), tolerance, work, schedule)
        for seconds, objective in found.trace if limits.only_family else ():
            if seconds >= begin and (not trace or objective < trace[-1][1]):
                trace.append((seconds, objective))
        others = _in_chart(chart, Pool.of(found.pool))
        ended, seeds = not work.expired(), seeds + others.cost.size
        others = others if pool is None or solutions else others.joined(pool)
        more = _within(poses, others, chart, limits, top, tolerance, work, windows)
        solutions = sorted(solutions + more, key=lambda one: max(one.errors.objective, tolerance))[:top]
    reached = Status.of(solutions, tolerance) is Status.REACHED
    note(min((one.errors.objective for one in solutions), default=np.inf))
    ended = ended and not work.expired()  # what ran out may have been the search within the limits
    stopped = StoppedBy.TOLERANCE if reached else StoppedBy.CONVERGED if ended else StoppedBy.BUDGET
    return solutions, SearchReport(stopped, trace, 0.0, seeds)


def _in_chart(chart: Chart, pool: Pool) -> Pool:
    """Candidates of paths, which lie in a `GrashofChart`, in another chart."""
    if isinstance(chart, GrashofChart):
        return pool
    shape = chart.unknowns(GrashofChart().shape(pool.timed.shape).lengths)
    return Pool(pool.timed._replace(shape=shape), pool.cost)


def _within(
    poses: Poses,
    pool: Pool,
    chart: Chart,
    limits: Limits,
    top: int,
    tolerance: float,
    work: Work,
    windows: Callable[[str], Windows],
) -> list[Solution]:
    """The best of a pool within the limits: as they are where that is enough, otherwise refined within them."""
    solutions = solutions_of(poses, pool, chart, limits, top, tolerance)
    if limits.only_family or Status.of(solutions, tolerance) is Status.REACHED or work.expired():
        return solutions
    inside = within_limits(poses, limits, pool, windows(limits.family), work)
    return solutions_of(poses, inside.joined(pool), chart, limits, top, tolerance)
