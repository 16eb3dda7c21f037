"""The search without crank angles: which way a request goes, and what comes back.

Data flow of a request::

    poses --(three and more samples with rotation and position, or only such)--> dyads and their pairs: `motion`
          --(else, or where limits hold, samples lack a part, or no linkage is near)--> guessed crank angles: `screen`
      -> where an exact answer may lie: all seeds to their end, on a few samples  }  round by round in turn,
      -> within the limits: few candidates to their end                           }  until rounds gain nothing: `rounds`
      -> for any family the same once more among all four-bars
      -> answers within the limits, ranked, different from one another: `answers`
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import chain, islice

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError
from synthesis.fourbar.charts import FullCrankChart
from synthesis.fourbar.dimension_types import OrderRule, TypeRule, enumerate_types
from synthesis.fourbar.kinematics import transmission_angle_over
from synthesis.fourbar.limits import Limits, in_family
from synthesis.fourbar.mechanism import FOURBAR, ways
from synthesis.fourbar.solution import Solution
from synthesis.free.answers import solutions_of
from synthesis.free.limited import LimitedJoint, guessed_windows, placed_within
from synthesis.free.motion import FEW, chart_of, search_motion
from synthesis.free.pool import Pool
from synthesis.free.poses import Poses
from synthesis.free.rounds import FEW_TO_THEIR_END, Found, Plan, Rounds, Stage
from synthesis.free.rows import JointProblem, Timed
from synthesis.free.schedule import EXACT, EXACT_SAMPLES, Best, Fresh, Hops
from synthesis.free.screen import COARSE, FINE, PathScreen
from synthesis.mechanism import Chart
from synthesis.ranking import APART, Status, distinct
from synthesis.search.search import DEFAULT_TOLERANCE, SearchReport, StoppedBy
from synthesis.search.windows import Windows
from synthesis.target import Interval
from synthesis.work import Work

Floats = NDArray[np.float64]


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
_SAMPLES, _FEWER = 40, 20
"""Samples up to which descents look at all, and at how many of more."""
_SEEDS, _BEFORE, _LOOKED_AT = 50, 20, 15
"""Seeds of a round; further ones that come from a search before; and seeds that may be answers at once."""
_ORIGINS, _COPIES, _WIDTHS = 8, 6, (1.0, 0.5, 0.25)
"""Valleys that a round's hops begin from, hops from each, and their widths in turn."""
_GAIN, _IDLE, _IDLE_OF_DYADS = 2e-3, 4, 2
"""So many rounds in a row that lower J by a smaller part end the search; fewer where dyads lead to most that there is."""
_IN_SIGHT = 1e-2, 1e-3
"""J of the first look, without limits and within them, from which on an exact answer is not sought further."""


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
    rounds: int | None = None,
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
    rounds : int, optional
        Of descents within the limits at most so many; default: until they gain nothing.

    Returns
    -------
    solutions : list of Solution
        Within the limits, each with its crank angles. Law: with more time none is worse.
    report : SearchReport

    Raises
    ------
    FieldError
        For a path in any order.
    """
    work = work or Work()
    trace: list[tuple[float, float]] = []

    def note(least: float) -> None:
        if not trace or least < (1 - _GAIN) * trace[-1][1]:
            trace.append((work.elapsed, least))

    found = Found(tolerance, note)
    search = _Search(poses, limits, found, work, screens, windows, rounds)
    ended = search.run()
    solutions: list[Solution] = []
    for chart, pool in found.pools.items():
        solutions += solutions_of(poses, pool, chart, limits, top, tolerance)
    if len(found.pools) > 1:
        solutions = distinct(
            solutions, top, APART, order=lambda one: max(one.errors.objective, tolerance), exact=tolerance
        )
    reached = Status.of(solutions, tolerance) is Status.REACHED
    if solutions:
        least = min(one.errors.objective for one in solutions)
        trace = [(seconds, max(objective, least)) for seconds, objective in trace]
        if not trace or trace[-1][1] != least:
            trace.append((work.elapsed, least))
    stopped = StoppedBy.TOLERANCE if reached else StoppedBy.CONVERGED if ended else StoppedBy.BUDGET
    return solutions, SearchReport(stopped, trace, 0.0, search.seeds)


class _Search:
    """One request's search."""

    def __init__(
        self,
        poses: Poses,
        limits: Limits,
        found: Found,
        work: Work,
        screens: Screens,
        windows: Callable[[str], Windows],
        rounds: int | None,
    ) -> None:
        self.poses, self.limits, self.found, self.work = poses, limits, found, work
        self.most = np.inf if rounds is None else rounds
        self.screens, self.windows = screens, windows
        self.seeds = 0
        few = poses.full.size <= FEW and poses.full.size < poses.samples
        self.dyads = poses.full.size >= _FEWEST_FULL or poses.full.size == poses.samples
        self._sampled = self.dyads and few
        """Whether dyads are drawn at random, since infinitely many fit the few full samples."""
        if not (self.dyads or poses.ordered):
            raise FieldError(
                "/order", "'any' needs rotation and position at three samples or more: a path has an order"
            )

    def run(self) -> bool:
        """Search until the tolerance is reached, the time is up or nothing is gained; whether it ran to its end."""
        family = self.limits.family
        if family != "any":
            return self._among(family)
        # what turns fully first, so that the larger family is never worse; but an exact one of any family is seen at once
        if self.dyads and not self._sampled:
            pool = next(search_motion(self.poses, family, self.found.tolerance, self.work))
            if pool.least <= self.found.tolerance:
                self._keep_dyads(pool, family)
        if self.found.reached:
            return True
        return self._among("full_crank") and (self.found.reached or self._among(family))

    def _among(self, family: str) -> bool:
        """The search among one family's linkages."""
        work, found, chart = self.work, self.found, chart_of(family)
        near = self._rounds(chart, _SAMPLES if self.poses.samples <= _SAMPLES else _FEWER)
        guesses = self._guesses(near, family) if self.poses.ordered else iter(())
        begin: list[Timed] = []
        pool = None
        if self._sampled:  # a round of theirs takes long: something is known before
            begin += islice(guesses, 1)
        for pool in search_motion(self.poses, family, found.tolerance, work) if self.dyads else ():
            self._keep_dyads(pool, family)
            if found.reached:
                return True
            if near.holds and not work.expired():
                if not begin:
                    begin += islice(guesses, 1)  # among them are answers
                elif pool.least > _IN_SIGHT[True]:
                    break
        if pool is not None and self._settled(pool):
            return not work.expired()
        if not (begin or (work.expired() and np.isfinite(found.least))):
            begin += islice(guesses, 1)
        if work.expired():
            return False
        if pool is not None and pool.cost.size:
            begin.append(near.thinned(pool.best(_BEFORE).timed))
        exact: Iterator[Rounds] = iter(())
        if self.poses.ordered and family != "any" and (pool is None or pool.least <= _FAR):
            exact = self._exact(chart, family)
            for before in islice(exact, 1):
                begin.append(near.thinned(before.spread(before.best(_BEFORE))))
        if found.reached or work.expired():
            return found.reached
        for _ in self._closest(near, chain([begin[0].joined(*begin[1:])] if begin else [], guesses)):
            if found.reached or work.expired():
                return found.reached
            next(exact, None)
        for _ in exact if self.most == np.inf else ():
            if found.reached or work.expired():
                return found.reached
        return not work.expired()

    def _rounds(self, chart: Chart, samples: int, limited: bool = True) -> Rounds:
        return Rounds(self.poses, self.limits, chart, self.found, self.work, samples, limited)

    def _keep_dyads(self, pool: Pool, family: str) -> None:
        """Pairs of dyads that keep the limits as they are are answers."""
        self.seeds += pool.cost.size
        rounds = self._rounds(chart_of(family), self.poses.samples)
        rounds.keep(pool.best(pool.cost.size), rounds=4)

    def _settled(self, pool: Pool) -> bool:
        """Whether what dyads led to is all that is to be had: without limits, and near a four-bar's motion."""
        if not self.limits.only_family:
            return False
        if self.poses.full.size < self.poses.samples:
            return False
        return not (self.poses.ordered and self.poses.samples > FEW and pool.least > _FAR)

    # -- where an exact answer may lie --------------------------------------------------------------------------------

    def _exact(self, chart: Chart, family: str) -> Iterator[Rounds]:
        """Rounds without limits on a few samples, while an exact answer is in sight."""
        run = self._rounds(chart, EXACT_SAMPLES, limited=False)
        seeds: dict[int, Timed] = {}
        for one in EXACT:
            match one.source:
                case Fresh(screen, start, stop):
                    if screen not in seeds:
                        found = self.screens(family)[screen].seeds(run.thin, run.chart)
                        seeds[screen] = JointProblem(run.thin, run.chart).facing(found)
                    begin = seeds[screen].take(slice(start, stop))
                case Hops(origins, copies):
                    begin = run.hops(origins, copies)
                case Best(most):
                    begin = run.best(most)
            self.seeds += begin.branch.size
            run.round(begin, Plan((Stage(0.0, one.steps, one.stall),)))
            yield run
            if run.least > _IN_SIGHT[run.holds]:
                return

    # -- what comes nearest -------------------------------------------------------------------------------------------

    def _closest(self, run: Rounds, seeds: Iterator[Timed]) -> Iterator[None]:
        """Rounds within the limits until they gain nothing: the first two and every second later one from seeds."""
        idle = number = 0
        while idle < (_IDLE_OF_DYADS if self.dyads else _IDLE) and number < self.most:
            before = self.found.least
            begin = next(seeds, None) if number < 2 or number % 2 == 0 else None
            if begin is None:
                if run.pool is None or not run.pool.cost.size:
                    return
                begin = run.hops(_ORIGINS, _COPIES, _WIDTHS[number // 2 % len(_WIDTHS)])
            self.seeds += begin.branch.size
            run.round(begin, FEW_TO_THEIR_END)
            number += 1
            idle = 0 if self.found.least < (1 - _GAIN) * before else idle + 1
            yield

    def _guesses(self, run: Rounds, family: str) -> Iterator[Timed]:
        """Windows at guessed crank angles, in poses within the limits; the best are looked at as answers."""
        if family == "any":
            for one in guessed_windows(self.poses, self.limits, self.windows(family)):
                run.keep(Pool(one, run.plain.plain_cost(one)), rounds=4)
                yield run.thinned(one)
            return
        limits = self.limits
        missing = None
        if limits.transmission_angle_min:

            def missing(lengths: Floats, first: Floats, last: Floats) -> Floats:
                held = transmission_angle_over(lengths, Interval(first, last))
                return np.maximum(limits.transmission_angle_min - np.nan_to_num(held), 0.0)

        seeds = self.screens(family)[0].seeds(run.thin, run.chart, missing)
        problem = run.problem(1.0)
        seeds = problem.facing(seeds)
        if isinstance(problem, LimitedJoint):
            boxes = ways(run.thin, limits, posed=True)[0].boxes
            assert boxes is not None
            seeds, inside = placed_within(problem, seeds, boxes)
            look = np.concatenate([inside[:_LOOKED_AT], np.arange(_LOOKED_AT)])
        else:
            seeds, look = problem.posed(seeds, problem.turned(seeds, derivatives=False)), np.arange(_LOOKED_AT)
        few = run.spread(seeds.take(look[look < seeds.branch.size]))
        run.keep(Pool(few, run.plain.plain_cost(few)) if run.holds else Pool.measured(run.plain, few), rounds=4)
        for k in range(0, seeds.branch.size, _SEEDS):
            yield seeds.take(slice(k, k + _SEEDS))
