"""The search without crank angles: which way a request goes, its rounds of descents, and what comes back.

Data flow of a request::

    poses --(three and more samples with rotation and position, or only such)--> dyads and their pairs: `dyads`
          --(else, or where limits hold, samples lack a part, or no linkage is near)--> guessed crank angles: `screen`
      -> where an exact answer may lie: all seeds to their end, on a few samples  }  round by round in turn,
      -> within the limits: few candidates to their end                           }  until rounds gain nothing
      -> for any family the same once more among all four-bars
      -> answers within the limits, ranked, different from one another

Rounds for an exact path run only where those before them did not reach the tolerance. All seeds of such a round descend to their
end: on random crank-rockers and double-cranks over parts of a turn, picking the best after 10 or 20 steps saved no time and lost
requests, because in long curved valleys the cost of the right one is not yet the least.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, islice
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Complexes, Flags, Floats
from synthesis.constraints import keeps
from synthesis.defects import LEAVES_SAMPLES, SHORTEST_CHORD
from synthesis.descents import Pool, Stage, Timed
from synthesis.errors import FieldError
from synthesis.four_bar import coupler_angle, transmission_angle_over, wrap
from synthesis.fourbar.dimension_types import OrderRule, TypeRule, enumerate_types
from synthesis.fourbar.mechanism import FOURBAR, AnyChart, FullCrankChart, ways
from synthesis.free.dyads import FEW, chart_of, search_motion
from synthesis.free.few_poses import Candidates, exact_four_bars, is_few
from synthesis.free.joint import JointProblem
from synthesis.free.limited import guessed_windows, limited_problem, placed_within
from synthesis.free.screen import COARSE, FINE, PathScreen, way_along
from synthesis.limits import Limits, in_family
from synthesis.linkage import Linkage
from synthesis.mechanism import Chart, Placed
from synthesis.poses import Poses
from synthesis.ranking import APART, Status, distinct, key
from synthesis.rounds import FEWER_ON, GAIN, Found, Plan, Rounds
from synthesis.scores import scores_of
from synthesis.search.report import SearchReport, StoppedBy
from synthesis.search.search import DEFAULT_TOLERANCE, Best, Hops
from synthesis.search.seeds import Windows
from synthesis.solution import Solution, assess
from synthesis.target import TURN, Interval, Target
from synthesis.work import Work

# -- answers -------------------------------------------------------------------------------------------------------


class _Mounted(NamedTuple):
    """Candidates in the user's unit of length."""

    poses: Poses
    cost: Floats
    branch: Floats
    links: Floats
    pivot: Complexes
    turn: Floats
    """Ground angles."""
    coupler: Complexes
    start: Floats
    crank: Floats
    """(n, N): crank angles from the first sample, of all samples that were asked for."""
    offset: Floats

    @classmethod
    def of(cls, poses: Poses, pool: Pool, chart: Chart) -> _Mounted:
        """The candidates of a pool."""
        timed = pool.timed
        a, z1, z2 = timed.pose.T
        lengths, scale = chart.shape(timed.shape).lengths, poses.length_scale
        start = timed.angles[:, 0]
        return cls(
            poses,
            pool.cost,
            timed.branch,
            lengths * (scale * np.abs(z1) / lengths[:, 0])[:, None],
            poses.middle + scale * a,
            np.angle(z1),
            scale * z2,
            start,
            poses.whole(timed.angles - start[:, None]),
            timed.offset,
        )

    def take(self, places: Any) -> _Mounted:
        """Some of them."""
        return _Mounted(self.poses, *(column[places] for column in self[1:]))

    @property
    def pivots(self) -> list[Complexes]:
        """Pivots A and B."""
        return [self.pivot, self.pivot + self.links[:, 3] * np.exp(1j * self.turn)]

    @property
    def placed(self) -> Placed:
        """They as the limits see them."""
        used = self.poses.used(self.crank).interval.after(self.start)
        return Placed(self.links, self.branch, used, self.pivot, self.turn, self.coupler)

    @property
    def target(self) -> Target:
        """The request with the crank angles of each."""
        rotation = None
        if self.poses.rotation is not None:
            rotation = coupler_angle(self.links, self.branch, self.start[:, None] + self.crank) + self.offset[:, None]
        return self.poses.timed(self.crank, rotation)

    def solutions(self) -> list[Solution]:
        """Them with errors, recomputed from their own numbers."""
        linkages = FOURBAR.posed(self.links, self.branch, self.start, (self.pivot, self.turn, self.coupler))
        return [replace(solution, linkage=_offset_wrapped(solution)) for solution in assess(self.target, linkages)]


def _offset_wrapped(solution: Solution) -> Linkage:
    offset = solution.linkage.body_offset
    return solution.linkage if offset is None else replace(solution.linkage, body_offset=wrap(offset))


def solutions_of(
    poses: Poses, pool: Pool, chart: Chart, limits: Limits, top: int, tolerance: float
) -> list[Solution]:
    """The best four-bars of a pool.

    Parameters
    ----------
    poses : Poses
    pool : Pool
    chart : Chart
        That of the pool.
    limits : Limits
    top : int
        At most so many.
    tolerance : float
        Below it J tells nothing: such answers are ranked by transmission angle and size.

    Returns
    -------
    list of Solution
        Within the limits, best first by `synthesis.ranking.key`; no two within 1 % of each other in all their numbers.
    """
    if not pool.cost.size:
        return []
    every = _Mounted.of(poses, pool.take(np.isfinite(pool.cost)), chart)
    kept = keeps(poses, limits, every.placed)
    kept &= np.all(np.isfinite(every.links) & (every.links > 0), axis=1)
    if poses.ordered:
        used = np.abs(pool.timed.angles[np.isfinite(pool.cost)][:, [0, -1]] @ [-1.0, 1.0])
        kept &= used <= poses.span_max * (1 + 1e-9)
    every = every.take(np.flatnonzero(kept))
    found = [solution for solution in every.solutions() if np.isfinite(solution.errors.objective)]
    return _best(found, poses, top, tolerance)


def solutions_of_few(
    poses: Poses, candidates: Candidates, limits: Limits, top: int, tolerance: float
) -> list[Solution]:
    """Return the first candidates that are exact and keep the limits by their own numbers, different from one another."""
    if not candidates.merit.size:
        return []
    pool = Pool(candidates.timed, np.zeros(candidates.merit.size))
    mounted = _Mounted.of(poses, pool, AnyChart())
    found = mounted.take(np.flatnonzero(keeps(poses, limits, mounted.placed))).solutions()
    exact = [solution for solution in found if solution.errors.objective < tolerance]
    return distinct(exact, top, APART, order=lambda _: 0)


def within_limits(poses: Poses, limits: Limits, pool: Pool, chart: Chart) -> Flags:
    """Whether the candidates of a pool keep the limits as they are, (n,)."""
    return keeps(poses, limits, _Mounted.of(poses, pool, chart).placed)


def _best(found: Sequence[Solution], poses: Poses, top: int, tolerance: float) -> list[Solution]:
    """Return the best solutions by their error that differ from one another; those that cannot be used come last."""
    scores = scores_of(found, poses, tolerance)
    keys = [key(score, "error") for score in scores]
    ranked = [found[k] for k in sorted(range(len(found)), key=keys.__getitem__)]
    return distinct(ranked, top, APART, order=lambda _: 0, exact=tolerance)


def in_turn(crank: Floats, ordered: bool) -> Floats:
    """Crank angles as a reply gives them: one way where the order counts, otherwise in [0, a turn)."""
    return crank if ordered else crank % TURN


# -- rounds for an exact path --------------------------------------------------------------------------------------


class Fresh(NamedTuple):
    """Windows of a screen, best first, ``start`` to ``stop``."""

    screen: int
    start: int
    stop: int


class Round(NamedTuple):
    """One round of the search."""

    source: Fresh | Hops | Best
    steps: int
    """A descent's longest."""
    stall: float
    """A candidate whose cost falls by a smaller part in a step ends."""
    reason: str


_HOPS = Hops(16, 12)
_STALL = 1e-2

EXACT = (
    Round(Fresh(0, 0, 100), 100, _STALL, "more than half of all exact paths end here"),
    Round(Fresh(0, 100, 200), 100, _STALL, "the next of the coarse types: nearly all end by the fourth round"),
    Round(Fresh(0, 200, 400), 100, _STALL, "the next"),
    Round(Fresh(0, 400, 600), 100, _STALL, "the rest"),
    Round(_HOPS, 60, _STALL, "minima beside the best"),
    Round(Fresh(1, 0, 300), 100, _STALL, "finer types, other spans"),
    Round(_HOPS, 60, _STALL, "minima beside the new ones"),
    Round(Best(12), 300, 1e-5, "to the end of the best valleys"),
)
EXACT_SAMPLES = 12
"""A few samples fix the linkage, and the fewer they are the fewer minima lie beside it."""

# -- rounds --------------------------------------------------------------------------------------------------------


_LONGEST = 0.97
"""Part of the longest span that crank angles are cut to."""
_PLACES = 48
"""Crank angles in a turn that samples are aligned with."""
_NEAREST_STEPS, _LAST_STEPS, _SPAN_HOP = 6, 40, 0.25
"""Steps of the crank angles alone, and of all, on all samples; width of hops of the span's logarithm."""


class FreeRounds(Rounds):
    """The rounds of a request whose crank angles are free.

    A long valley is told by its timing: shapes and even costs change along it while the crank angles between the samples
    hardly do.

    Parameters
    ----------
    samples : int
        That descents look at; longer requests are thinned for them.
    limited : bool
        Whether descents keep to the limits; otherwise only answers do.
    """

    plan = FEWER_ON
    thin: Poses
    problem: JointProblem

    def __init__(
        self,
        poses: Poses,
        limits: Limits,
        chart: Chart,
        found: Found,
        work: Work,
        samples: int,
        limited: bool = True,
    ) -> None:
        self.poses = poses
        self.few = poses.spread(samples)
        thin = poses if self.few.size == poses.samples else poses.at(self.few)
        self._moved = poses.off(thin)
        self._stays = limits.practical and poses.ordered and poses.position is not None
        plain = JointProblem(poses, chart)
        within = plain if limits.only_family else limited_problem(poses, chart, limits)
        problem = within if limited else plain
        if thin is not poses:
            problem = limited_problem(thin, chart, limits) if problem.limited else JointProblem(thin, chart)
        super().__init__(poses, thin, (plain, within, problem), limits.family, found, work)

    def signature(self, timed: Timed) -> tuple[Floats, Floats]:
        """The timing, and the span."""
        timing = timed.angles - timed.angles[:, :1]
        return timing, np.abs(timing).max(axis=1, initial=0.0)

    def strays(self, timed: Timed) -> Flags:
        """Flag candidates within the practical limits that leave the path between samples, measured by chords."""
        if not (self._stays and timed.branch.size):
            return super().strays(timed)
        whole = timed.angles.shape[1] == self.poses.samples
        poses, problem = (self.poses, self.plain) if whole else (self.thin, self.problem)
        gone, rotation = problem.excursions(timed, SHORTEST_CHORD, _PANEL)
        return np.asarray((gone > LEAVES_SAMPLES) | poses.turned_otherwise(rotation))

    def turned_apart(self, timed: Timed, width: float) -> Floats:
        """Another start, and another span."""
        random, count = self.random, len(timed.branch)
        along = timed.angles - timed.angles[:, :1]
        factor = np.exp(width * _SPAN_HOP * random.standard_t(3, size=(count, 1)))
        longest = _LONGEST * self.poses.span_max / np.maximum(np.abs(along[:, -1:]), 1e-9)
        start = timed.angles[:, :1] + width * self.chart.hop[-1] * random.standard_t(3, size=(count, 1))
        return np.asarray(start + along * np.minimum(factor, longest))

    def realigned(self, timed: Timed) -> Timed:
        """Where samples press on one another for their order, other crank angles may fit as well: minima lie there too."""
        return self.problem.aligned(self.problem.measured(timed).timed, _PLACES)

    def on_all(self, pool: Pool) -> Pool:
        """Candidates refined on all samples."""
        # two guesses of what lies between: angles that run into one another in one of them need not in the other
        spread = self.spread(pool.timed, 1.0).joined(self.spread(pool.timed, 0.5))
        timed, problem = self.plain.nearest(spread, _NEAREST_STEPS), self.within if self.limited else self.plain
        done = problem.descended(timed, [Stage(_LAST_STEPS, 1e-4, 30.0)], 0.1 * self.found.tolerance, self.work)
        steps = np.diff(done.timed.angles, axis=1)
        strict = np.all(steps > 0, axis=1) | np.all(steps < 0, axis=1) | (not self.poses.ordered)
        return done.take(strict) if strict.any() else done

    def spread(self, timed: Timed, power: float = 1.0) -> Timed:
        """Crank angles of all samples from those of the few, by the way along the path between them (see `way_along`)."""
        if self.thin is self.poses:
            return timed
        way = way_along(self.poses, power)
        angles = np.stack([np.interp(way, way[self.few], few) for few in timed.angles])
        pose = timed.pose.copy()
        pose[:, 0] += self._moved  # positions count from the mean of their own samples
        return timed._replace(angles=angles, pose=pose)

    def thinned(self, timed: Timed) -> Timed:
        """Candidates at all samples at the few alone."""
        if self.thin is self.poses:
            return timed
        pose = timed.pose.copy()
        pose[:, 0] -= self._moved
        return timed._replace(angles=timed.angles[:, self.few], pose=pose)


# -- the search ----------------------------------------------------------------------------------------------------


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
_SAMPLES, _FEWER = 64, 32
"""Samples up to which descents look at all, and at how many of more."""
_PANEL = np.deg2rad(12.0)
"""Crank angle that a chord spans at most, where it is told how far a candidate goes between samples."""
_SEEDS, _BEFORE, _LOOKED_AT = 50, 20, 15
"""Seeds of a round; further ones that come from a search before; and seeds that may be answers at once."""
_BEYOND_FULL_CRANKS = 4
"""Rounds among four-bars of any family that gain nothing on those whose crank turns fully: four of 2,300 later ones did."""
_FROM_THE_WAY = 2
"""Rounds that begin from crank angles which the way between the samples suggests; others from such at random."""
_GUESSES_BESIDE = 2
"""Guesses beside what dyads lead to: more of them were not worth their time in `benchmarks.engine`."""
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
        if not trace or least < (1 - GAIN) * trace[-1][1]:
            trace.append((work.elapsed, least))

    if is_few(poses) and not poses.closed and not any(limits.links):
        candidates = exact_four_bars(poses, limits, work)
        exact = solutions_of_few(poses, candidates, limits, top, tolerance)
        if exact:
            trace = [(work.elapsed, min(solution.errors.objective for solution in exact))]
            return exact, SearchReport(StoppedBy.TOLERANCE, trace, 0.0, candidates.merit.size)
    found = Found(tolerance, note)
    search = _Search(poses, limits, found, work, screens, windows, rounds)
    ended = search.run()
    solutions: list[Solution] = []
    for chart, pool in found.pools.items():
        solutions += solutions_of(poses, pool, chart, limits, top, tolerance)
    if len(found.pools) > 1:
        solutions = _best(solutions, poses, top, tolerance)
    reached = Status.of(solutions, tolerance) is Status.REACHED
    if solutions:
        least = min(one.errors.objective for one in solutions)
        trace = [(seconds, max(objective, least)) for seconds, objective in trace]
        if not trace or trace[-1][1] != least:
            trace.append((work.elapsed, least))
    stopped = StoppedBy.TOLERANCE if reached else StoppedBy.CONVERGED if ended else StoppedBy.BUDGET
    unseen = found.unseen(FreeRounds.odds) if solutions else None
    return solutions, SearchReport(stopped, trace, 0.0, search.seeds, unseen=unseen)


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
        self._near: dict[str, FreeRounds] = {}
        """Rounds within the limits, by family."""
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
        if family != "any" or self.limits.swings:
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
        near = self._rounds_near(family)
        guesses = self._guesses(near, family)
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
            if family == "any" and None in self.limits.links:
                guesses = islice(guesses, _GUESSES_BESIDE)
            begin.append(near.thinned(pool.best(_BEFORE).timed))
        exact: Iterator[FreeRounds] = iter(())
        if self.poses.ordered and family != "any" and (pool is None or pool.least <= _FAR):
            exact = self._exact(chart, family)
            for before in islice(exact, 1):
                begin.append(near.thinned(before.spread(before.best(_BEFORE))))
        if found.reached or work.expired():
            return found.reached
        for seeds in near.closest(chain([begin[0].joined(*begin[1:])] if begin else [], guesses), self.most):
            self.seeds += seeds.branch.size
            if found.reached or work.expired():
                return found.reached
            next(exact, None)
        for _ in exact if self.most == np.inf else ():
            if found.reached or work.expired():
                return found.reached
        return not work.expired()

    def _rounds_near(self, family: str) -> FreeRounds:
        """The rounds within the limits."""
        if family not in self._near:
            samples = _SAMPLES if self.poses.samples <= _SAMPLES else _FEWER
            self._near[family] = self._rounds(chart_of(family), samples)
            if family == "any" and not self.limits.swings:  # after those whose crank turns fully
                self._near[family].idle_at_first = _BEYOND_FULL_CRANKS
        return self._near[family]

    def _rounds(self, chart: Chart, samples: int, limited: bool = True) -> FreeRounds:
        return FreeRounds(self.poses, self.limits, chart, self.found, self.work, samples, limited)

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

    def _exact(self, chart: Chart, family: str) -> Iterator[FreeRounds]:
        """Rounds without limits on a few samples, while an exact answer is in sight."""
        run = self._rounds(chart, EXACT_SAMPLES, limited=False)
        seeds: dict[int, Timed] = {}
        for one in EXACT:
            match one.source:
                case Fresh(screen, start, stop):
                    if screen not in seeds:
                        found = self.screens(family)[screen].seeds(run.thin, run.chart)
                        seeds[screen] = run.problem.facing(found)
                    begin = seeds[screen].take(slice(start, stop))
                case Hops(origins, copies):
                    begin = run.hops(origins, copies)
                case Best(most):
                    begin = run.best(most)
            self.seeds += begin.branch.size
            run.round(begin, Plan((Stage(one.steps, one.stall),)))
            yield run
            if run.least > _IN_SIGHT[run.holds]:
                return

    # -- what comes nearest -------------------------------------------------------------------------------------------

    def _guesses(self, run: FreeRounds, family: str) -> Iterator[Timed]:
        """Windows at guessed crank angles, in poses within the limits; the best are looked at as answers."""
        limits = self.limits
        tables = [self.windows(family)] if family == "any" else []
        if None not in limits.links:  # the linkage that has them is in no table
            tables.append(Windows(FOURBAR, np.array([limits.links], dtype=float)))
        within = replace(limits, family=family)
        for some in zip(*(guessed_windows(self.poses, within, table) for table in tables)):
            for one in some:
                run.keep(run.plain.measured(one, posed=False), rounds=4)
            yield run.thinned(some[0].joined(*some[1:]))
        if family == "any":
            return
        missing = None
        if limits.transmission_angle_min:

            def missing(lengths: Floats, first: Floats, last: Floats) -> Floats:
                held = transmission_angle_over(lengths, Interval(first, last))
                return np.maximum(limits.transmission_angle_min - np.nan_to_num(held), 0.0)

        screen, problem = self.screens(family)[0], run.problem
        boxes = ways(run.thin, limits, posed=True)[0].boxes if problem.limited else None

        def placed(seeds: Timed) -> tuple[Timed, NDArray[np.intp]]:
            seeds, first = problem.facing(seeds), np.arange(_LOOKED_AT)
            if boxes is None:
                return problem.measured(seeds).timed, first
            seeds, inside = placed_within(problem, seeds, boxes)
            return seeds, np.concatenate([inside[:_LOOKED_AT], first])

        seeds, look = placed(screen.seeds(run.thin, run.chart, missing))
        few = run.spread(seeds.take(look[look < seeds.branch.size]))
        run.keep(run.plain.measured(few, posed=not run.holds), rounds=4)
        yield from islice(run.in_turn(seeds, _SEEDS), _FROM_THE_WAY)
        while True:
            yield placed(screen.seeds(run.thin, run.chart, missing, run.random))[0]
