"""The search without crank angles: which way a request goes, its rounds of descents, and what comes back.

Data flow of a request::

    poses --(three and more samples with rotation and position, or only such)--> dyads and their pairs: `dyads`
          --(else, or where limits hold, samples lack a part, or no linkage is near)--> guessed crank angles: `screen`
      -> where an exact answer may lie: all seeds to their end, on a few samples  }  round by round in turn,
      -> within the limits: few candidates to their end                           }  until rounds gain nothing
      -> for any family the same once more among all four-bars
      -> answers within the limits, ranked, different from one another

Data flow of a round::

    seeds -> descents in which broken limits weigh more from stage to stage: all a few steps, the best of each valley some
      more, the best of the pool to their end -> on all samples, moved onto the limits that they still break -> `Found`

A valley is a timing: many candidates come to rest along the same long valley, and copies of them would fill every list.
What is found within the limits is kept, whatever comes after it, and no round depends on the time: more of it never gives less.

Rounds for an exact path run only where those before them did not reach the tolerance. All seeds of such a round descend to their
end: on random crank-rockers and double-cranks over parts of a turn, picking the best after 10 or 20 steps saved no time and lost
requests, because in long curved valleys the cost of the right one is not yet the least.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, islice
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis import kernel
from synthesis.errors import FieldError
from synthesis.fourbar.charts import FullCrankChart
from synthesis.fourbar.dimension_types import OrderRule, TypeRule, enumerate_types
from synthesis.fourbar.kinematics import coupler_angle, transmission_angle_over, wrap
from synthesis.fourbar.limits import Limits, in_family
from synthesis.fourbar.mechanism import FOURBAR, ways
from synthesis.fourbar.passage import LEAVES_SAMPLES, excursions
from synthesis.fourbar.solution import Solution, assess, keeps
from synthesis.free.dyads import FEW, chart_of, search_motion
from synthesis.free.joint import JointProblem, Pool, Stage, Timed
from synthesis.free.limited import guessed_windows, limited_problem, placed_within
from synthesis.free.poses import Poses
from synthesis.free.screen import COARSE, FINE, PathScreen, way_along
from synthesis.mechanism import BoundedChart, Chart, Placed
from synthesis.ranking import APART, Status, distinct
from synthesis.search.search import DEFAULT_TOLERANCE, SearchReport, StoppedBy
from synthesis.search.seeds import Windows
from synthesis.target import TURN, Interval, Target
from synthesis.work import Work

# -- answers -------------------------------------------------------------------------------------------------------

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Flags = NDArray[np.bool_]

_SWING_STEP, _TRANSMISSION_STEP = np.deg2rad(90.0), np.deg2rad(5.0)
"""Exact answers whose cranks turn alike far are ranked by transmission angle, and then by how compact they are."""


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

    def order(self, tolerance: float) -> NDArray[np.intp]:
        """Places, best first: by J, and exact ones by what one would build.

        That is how far the crank turns, then the transmission angle, each in steps, and then how compact the linkage is.
        """
        objective = np.sqrt(self.cost)
        rest = np.where(objective < tolerance, 0.0, objective)
        used = self.poses.used(self.crank).interval.after(self.start)
        transmission = np.nan_to_num(transmission_angle_over(self.links, used))
        middle, scale = self.poses.middle, self.poses.length_scale
        far = np.max(np.abs(np.array(self.pivots) - middle), axis=0) / scale
        size = np.maximum(self.links.max(axis=1) / self.links.min(axis=1), far)
        swing = np.abs(used.last - used.first)
        return np.lexsort((size, -np.floor(transmission / _TRANSMISSION_STEP), np.floor(swing / _SWING_STEP), rest))

    def leaves(self) -> Flags:
        """Whether the body point goes far away between neighbouring samples, (n,)."""
        linkages = [one.linkage for one in self.solutions()]
        crank = self.start[:, None] + self.crank
        side = np.broadcast_to(self.branch[:, None], crank.shape)
        poses = self.poses
        way = excursions(linkages, crank, side, poses.extent, ordered=poses.ordered, closed=poses.closed)
        return np.array([one is not None and one > LEAVES_SAMPLES for one in way], dtype=bool)

    def solutions(self) -> list[Solution]:
        """Them with errors, recomputed from their own numbers."""
        linkages = FOURBAR.posed(self.links, self.branch, self.start, (self.pivot, self.turn, self.coupler))
        found = assess(self.target, linkages)
        return [
            replace(one, crank=crank.copy(), linkage=_offset_wrapped(one)) for one, crank in zip(found, self.crank)
        ]


def _offset_wrapped(solution: Solution) -> Any:
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
        Within the limits, with their crank angles; no two within 1 % of each other in all their numbers.
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
    ranked = every.take(every.order(tolerance)[: 8 * top + 20])
    exact = np.sqrt(ranked.cost) < tolerance
    if np.any(exact):  # of those that meet all samples the ones last that go elsewhere in between
        ranked = ranked.take(np.argsort(2 * ~exact + ranked.leaves(), kind="stable"))
    found = [one for one in ranked.solutions() if np.isfinite(one.errors.objective)]
    place = {id(one): rank for rank, one in enumerate(found)}
    return distinct(found, top, APART, order=lambda one: place[id(one)], exact=tolerance)


def in_turn(crank: Floats, ordered: bool) -> Floats:
    """Crank angles as a reply gives them: one way where the order counts, otherwise in [0, a turn)."""
    return crank if ordered else crank % TURN


# -- rounds for an exact path --------------------------------------------------------------------------------------


class Fresh(NamedTuple):
    """Windows of a screen, best first, ``start`` to ``stop``."""

    screen: int
    start: int
    stop: int


class Hops(NamedTuple):
    """Perturbed copies of the best valleys of the pool that were perturbed least often."""

    origins: int
    copies: int


class Best(NamedTuple):
    """The best valleys of the pool."""

    most: int


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


_POOL = 120
_APART, _POOL_APART = 0.01, 0.03
"""Parts of the span by which a crank angle differs between two valleys: among answers, and in the pool."""
_ALIKE = 1e-4
"""Shapes, starts and branches of exact candidates are the same when they differ by less."""
_FLIPPED, _SPAN_HOP, _LOOSE_HOP = 0.15, 0.25, 0.5
"""Part of the hops that change the branch, and widths of hops: of the span's logarithm, and along flat directions."""
_TIRED = 2.0
"""A valley stands back by this factor of e in J squared for each time that hops started from it."""
_NEAREST_STEPS, _LAST_STEPS = 6, 40
_ON_ALL, _MOVED = 4, 30
"""Candidates that are refined on all samples, and that are moved onto the limits."""
_EXACT_NEAR = 1e-2
"""J below which an answer that no limit holds is refined in its best pose: an exact one may lie there."""
_KEPT = 1e-13
"""To which an answer must keep equations; other limits it keeps entirely."""


class Plan(NamedTuple):
    """How a round's seeds descend."""

    first: tuple[Stage, ...]
    going: int = 0
    """So many of the best valleys go on."""
    on: tuple[Stage, ...] = ()
    ended: int = 0
    """So many of the best of the pool descend to their end, where they did not before."""
    end: tuple[Stage, ...] = ()


FEW_TO_THEIR_END = Plan(
    (Stage(15, 1e-2, 0.3), Stage(12, 1e-2, 1.0)),
    12,
    (Stage(12, 1e-3, 3.0), Stage(15, 1e-3, 10.0), Stage(15, 1e-3, 30.0)),
    4,
    (Stage(60, 1e-6, 100.0), Stage(60, 1e-6, 300.0), Stage(60, 1e-7, 300.0)),
)


class Found:
    """What is known within the limits, with J on all samples; it only gets better.

    Parameters
    ----------
    tolerance : float
        J below it is exact.
    note : callable
        Told the best J whenever it falls.
    """

    def __init__(self, tolerance: float, note: Callable[[float], None]) -> None:
        self.tolerance, self.note = tolerance, note
        self.pools: dict[Any, Pool] = {}
        """By the chart that the candidates are in."""
        self.least = np.inf

    def add(self, chart: Chart, pool: Pool) -> None:
        """Take candidates that keep the limits."""
        if pool.cost.size:
            known = self.pools[chart].joined(pool) if chart in self.pools else pool
            self.pools[chart] = valleys(known, _POOL, self.tolerance, _APART)
        if pool.least < self.least:
            self.least = pool.least
            self.note(self.least)

    @property
    def reached(self) -> bool:
        """Whether an answer is below the tolerance."""
        return self.least <= self.tolerance


class Rounds:
    """The rounds of one request in one chart; candidates come and go with crank angles at all samples.

    Parameters
    ----------
    poses : Poses
    limits : Limits
    chart : Chart
    found : Found
        Where answers go.
    work : Work
    samples : int
        That descents look at; longer requests are thinned for them.
    limited : bool
        Whether descents keep to the limits; otherwise only answers do.
    """

    def __init__(
        self, poses: Poses, limits: Limits, chart: Chart, found: Found, work: Work, samples: int, limited: bool = True
    ) -> None:
        self.poses, self.chart, self.found, self.work = poses, chart, found, work
        few = np.round(np.linspace(0, poses.samples - 1, min(samples, poses.samples)))
        self.few = few.astype(np.intp)
        self.thin = poses if self.few.size == poses.samples else poses.at(self.few)
        self.holds = not limits.only_family
        """Whether limits hold."""
        self.limited = limited and self.holds
        self.plain = JointProblem(poses, chart)
        """Of all samples, without limits."""
        self.within = limited_problem(poses, chart, limits) if self.holds else self.plain
        """Of all samples, within the limits."""
        self.problem = self.within
        """Of the few samples, within the limits where descents keep to them."""
        if self.thin is not poses or not self.limited:
            self.problem = (
                limited_problem(self.thin, chart, limits) if self.limited else JointProblem(self.thin, chart)
            )
        self.random = np.random.default_rng(20)
        self.pool: Pool | None = None
        self._used: Counter[float] = Counter()
        """How often hops started from a valley, by its cost."""
        self._ended: set[float] = set()
        """Costs of those that descended to their end."""

    @property
    def _moved(self) -> complex:
        """Mean position of the few samples, from that of all, over the length scale."""
        return self.poses.off(self.thin)

    @property
    def least(self) -> float:
        """J of the best of the pool, whether it keeps the limits or not."""
        return np.inf if self.pool is None else self.pool.least

    def best(self, most: int) -> Timed:
        """The best valleys of the pool."""
        assert self.pool is not None
        return self.pool.timed.take(slice(0, most))

    # -- a round ----------------------------------------------------------------------------------------------------

    def round(self, seeds: Timed, plan: Plan) -> None:
        """Descents from seeds that have crank angles at the few samples."""
        found = self._descended(seeds, plan.first)
        if plan.on:
            going = valleys(found, plan.going, self.found.tolerance, _POOL_APART)
            self._answer(going)
            found = self._descended(going.timed, plan.on, answers=True)
        self._take(found)
        assert self.pool is not None
        best = [k for k in range(min(plan.ended, self.pool.cost.size)) if self.pool.cost[k] not in self._ended]
        if best and not (self.found.reached or self.work.expired()):
            before = set(self.pool.cost[best])
            found = self._descended(self.pool.take(best).timed, plan.end, answers=True)
            self._ended |= before | set(found.cost)
            self._take(found)

    def _descended(self, timed: Timed, stages: tuple[Stage, ...], answers: bool = False) -> Pool:
        exact, between = 0.3 * self.found.tolerance, self._answer if answers else None
        return self.problem.descended(timed, stages, exact, self.work, between=between)

    def _take(self, found: Pool) -> None:
        """Into the pool; and what is worth it among the answers."""
        tolerance = self.found.tolerance
        found = found.take(np.isfinite(found.cost))
        self.pool = valleys(found if self.pool is None else self.pool.joined(found), _POOL, tolerance, _POOL_APART)
        if self.limited or not self.holds or found.least <= tolerance:
            self._answer(found)

    # -- answers ----------------------------------------------------------------------------------------------------

    def _answer(self, pool: Pool) -> None:
        """Candidates at the few samples, on all samples, to `keep`."""
        if pool.cost.size and self._counts:
            few = self.thin is not self.poses
            self.keep(self._on_all(pool.take(np.argsort(pool.cost, kind="stable")[:_ON_ALL])) if few else pool)

    @property
    def _counts(self) -> bool:
        """Whether what a descent led to counts: one that the time cut short does only where nothing else is known.

        More time would lead it elsewhere, and an answer must not be lost by that.
        """
        return not (self.work.expired() and np.isfinite(self.found.least))

    def keep(self, pool: Pool, rounds: int = 12) -> None:
        """Add those of candidates at all samples that keep the limits, or can be moved onto them, to the answers.

        Parameters
        ----------
        pool : Pool
        rounds : int
            Steps towards the limits.
        """
        if not (pool.cost.size and self._counts):
            return
        if not self.holds:
            self.found.add(self.chart, pool)
            return
        merit = pool.cost + self.within.lacking(pool.timed)[0]
        moved, broken = self.within.moved_onto(pool.timed.take(np.argsort(merit, kind="stable")[:_MOVED]), rounds)
        self.found.add(self.chart, moved.take((broken <= _KEPT) & np.isfinite(moved.cost)))
        near = moved.take(moved.cost < _EXACT_NEAR**2)
        if near.cost.size:
            done = self.plain.descended(near.timed, [Stage(30, 1e-2)], 0.3 * self.found.tolerance, self.work)
            if self._counts:
                self.found.add(self.chart, done.take(self.within.lacking(done.timed)[1] <= _KEPT))

    def _on_all(self, pool: Pool) -> Pool:
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

    # -- hops -------------------------------------------------------------------------------------------------------

    def hops(self, origins: int, copies: int, width: float = 1.0) -> Timed:
        """Perturbed copies of the best valleys that were perturbed least often.

        Half of them are moved in all unknowns alike, which reaches other valleys, half where the cost is flat, which reaches
        other minima of a long one.
        """
        assert self.pool is not None
        cost = self.pool.cost
        rank = np.log(np.maximum(cost, 1e-300)) + _TIRED * np.array([self._used[value] for value in cost])
        chosen = np.argsort(rank, kind="stable")[:origins]
        self._used.update(cost[chosen])
        best = self.pool.timed.take(np.repeat(chosen, copies // 2))
        return self._wide_steps(best, width).joined(self.problem.loose_steps(best, self.random, _LOOSE_HOP))

    def _wide_steps(self, timed: Timed, width: float) -> Timed:
        """Candidates moved in shape, start and span, with heavy tails, some to the other branch."""
        random, (count, size) = self.random, timed.shape.shape
        noise = width * random.standard_t(3, size=(count, size)) * self.chart.hop[:-1]
        hopped = self.chart.hopped if isinstance(self.chart, BoundedChart) else np.add
        shape = hopped(timed.shape, noise)
        along = timed.angles - timed.angles[:, :1]
        factor = np.exp(width * _SPAN_HOP * random.standard_t(3, size=(count, 1)))
        longest = 0.97 * self.poses.span_max / np.maximum(np.abs(along[:, -1:]), 1e-9)
        start = timed.angles[:, :1] + width * self.chart.hop[-1] * random.standard_t(3, size=(count, 1))
        branch = np.where(random.random(count) < _FLIPPED, -timed.branch, timed.branch)
        return timed._replace(shape=shape, angles=start + along * np.minimum(factor, longest), branch=branch)


def valleys(found: Pool, most: int, tolerance: float, apart: float) -> Pool:
    """The best of each valley, best first; all that differ of those that reach the tolerance.

    A long valley is told by its timing: shapes and even costs change along it while the crank angles between the samples
    hardly do.
    """
    order = np.argsort(found.cost, kind="stable")
    order = order[np.isfinite(found.cost[order])]
    found = found.take(order)
    timing = found.timed.angles - found.timed.angles[:, :1]
    place = np.column_stack([found.timed.shape, found.timed.angles[:, 0], found.timed.branch])
    exact = int(np.searchsorted(found.cost, tolerance**2, side="right"))
    kept = kernel.apart(place[:exact], np.full(exact, _ALIKE), (), 0, most)
    kept = kernel.apart(timing, apart * np.abs(timing).max(axis=1), kept, exact, most)
    return found.take(kept)


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
                run.keep(run.plain.measured(one, posed=False), rounds=4)
                yield run.thinned(one)
            return
        limits = self.limits
        missing = None
        if limits.transmission_angle_min:

            def missing(lengths: Floats, first: Floats, last: Floats) -> Floats:
                held = transmission_angle_over(lengths, Interval(first, last))
                return np.maximum(limits.transmission_angle_min - np.nan_to_num(held), 0.0)

        seeds = self.screens(family)[0].seeds(run.thin, run.chart, missing)
        problem = run.problem
        seeds = problem.facing(seeds)
        if problem.limited:
            boxes = ways(run.thin, limits, posed=True)[0].boxes
            assert boxes is not None
            seeds, inside = placed_within(problem, seeds, boxes)
            look = np.concatenate([inside[:_LOOKED_AT], np.arange(_LOOKED_AT)])
        else:
            seeds, look = problem.measured(seeds).timed, np.arange(_LOOKED_AT)
        few = run.spread(seeds.take(look[look < seeds.branch.size]))
        run.keep(run.plain.measured(few, posed=not run.holds), rounds=4)
        for k in range(0, seeds.branch.size, _SEEDS):
            yield seeds.take(slice(k, k + _SEEDS))
