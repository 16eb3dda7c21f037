"""The search for linkages of two guides, sliders among them, whose drive is free: from poses to the best within the limits.

Data flow of a request::

    poses -> exact guides (rails and slots in closed form, circles by the four-bar's dyads) -> their pairs, refined together
      -> where those do not answer: guides of points all over the body and the ground -> pairs, the best of each kind and drive
      -> descents in which broken limits weigh more from stage to stage, then about the best of what came out, in rounds
      -> answers within the limits, checked on the linkage's own motion

All kinds and drives share the rounds of one search: they differ in labels only.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Floats, Ints
from synthesis.constraints import broken_limits
from synthesis.four_bar import wrap
from synthesis.free.dyads import (
    FARTHEST,
    FEW,
    Body,
    circles,
    distinct_dyads,
    in_any_order,
    in_order,
    landscape,
    linear_dyads,
    polished,
    sampled_dyads,
)
from synthesis.guided.pairs import (
    OWN,
    Chart,
    Guides,
    Looked,
    Motion,
    Pairs,
    Problem,
    Samples,
    Stage,
    Straight,
    as_circles,
    lines_of,
)
from synthesis.guides import DRIVERS, GUIDES, Circle, Driver, Guide, Kind, Rail, Slot
from synthesis.kernels import distinct
from synthesis.limits import Limits
from synthesis.linkage import Linkage
from synthesis.poses import Poses
from synthesis.search.report import SearchReport, StoppedBy
from synthesis.search.search import DEFAULT_TOLERANCE
from synthesis.solution import Solution, assess
from synthesis.target import TURN
from synthesis.work import Work

_EXACT = 1e-6
"""Rms distance, over the length scale, of guides that may be a pair that fits exactly."""
_DIRECTIONS = 24
"""Rails and slots of further directions: one that is worse alone may be better in a pair."""
_ALL_WAYS: Floats = np.linspace(0.0, np.pi, _DIRECTIONS, endpoint=False)
_FEWER_WAYS = 3
"""Where any direction is as good every third of them will do."""
_FINE = 1440
"""Directions among which those are looked for that a given drive goes."""
_RADII, _AROUND = (0.0, 0.35, 0.8, 1.4, 2.2, 3.5), 12
"""Points that circles, rails and slots are begun with: distances from the middle of the motion, and so many around it."""
_SWEEPS, _AGAIN = 8, 6
"""Newton's steps of the poses of answers, and of those looked at before they are."""
_SEEDS, _HOPS = 40, 5
"""Candidates of each kind and drive that the first round begins with, and each further one."""
_FAR: Floats = np.array([0.25, 0.25, 0.15, 0.15, 0.3])
"""How far hops go, in the unknowns of a guide."""
_STAYS = 0.1
"""Part of it for a guide that hardly moves."""
_BENT = 0.2
"""Curvature of a circle that begins as a rail."""
_SPREAD_AT_ONCE = 1 << 13
"""Pairs of exact guides that are looked at before the time is."""
_TIMED_AT_ONCE = 1 << 12
"""Candidates times samples at a given drive between two looks at the time: some 20 ms."""
_LOOKED_AT = 40
"""Of the guides of a sort that fit best so many are paired."""
_LITTLE = 0.01
"""Weight of J squared where seeds are chosen that break the limits least."""
_SAMPLES, _FEWER, _MANY = 40, 24, 300
"""Samples up to which descents look at all, at how many of more, and up to which the best are refined on all in the end."""
_POOL, _ENDED = 6, 2
"""Valleys that are kept of each kind and drive, and so many new ones of a round that are descended to their end."""
_ANSWERS = 6
"""Answers that are kept of each."""
_FURTHER, _LEAST_FURTHER = 24, 2
"""Further ones that are looked at in the end, of all together, and of each at least."""
_STAGES = Stage(8, 0.1, 2), Stage(6, 1.0, 2), Stage(8, 10.0, 2)
_END = Stage(8, 1e2, 2), Stage(8, 1e4, 3), Stage(5, 1e6, 3)
_LAST = Stage(15, 1e4, 3), Stage(10, 1e6, 3)
_GIVEN = Stage(12, 1.0, _SWEEPS, 1e-6, 1e-3), Stage(20, 100.0, _SWEEPS, 1e-6, 1e-3)
_GIVEN_END = tuple(stage._replace(sweeps=_SWEEPS, stall=1e-6, damping=1e-3) for stage in _END)
_EXACTLY = Stage(12, 0.0, 4, 0.1, 1e-8)
"""Stages of descents: among the limits, along them, on all samples in the end; where the drive is given; and of exact guides."""
_BETWEEN = 4
"""Poses between two samples at which pairs for few samples are looked at."""
_SPARE = 1.05, 2e-5
"""What falls short is asked for this many times over, and so many radians more: what is asked for moves the worst place on."""
_TIGHTENED = 3
"""So often a descent is repeated for what falls short between the samples."""
_LOOKED_AT_WHOLE = 3
"""Candidates of each drive whose motion is looked at between the samples."""
_TURNS = 1e-3
"""Sine of the angle between two rails, or two slots, below which a body never turns."""
_LEAST_TRAVEL, _LEAST_STROKE = 0.02, 1e-3
"""Way of a drive, in radians or length scales, below which it drives nothing, and that along a rail or slot below which it is
but a pin."""
_NOISE, _EVEN = 0.05, 1e-3
"""Part of its range by which a drive may step back between noisy samples; and of the way to even steps when put in order."""
_AS_EXACT = 1e-9
"""J of a rail below which a circle in its place tells nothing."""
_LONG, _CHANCE = 10.0, 10.0
"""Radius, over the length scale, from which on a circle is compared with a rail; and the F up to which that is as good."""
_IDLE, _IDLE_LED, _IDLE_GIVEN, _ROUNDS, _WORTH = 40, 5, 4, 160, 0.01
"""A drive is left alone after so many rounds that gain nothing, or where rotations are led, or the drive is given; rounds at
most; and the part of J that is a gain."""
TIRED = 2.0
"""Increase of the logarithm of a basin's squared error each time that it was an origin."""
_PATIENCE = 16
"""Rounds more for a drive that nothing was found of."""
_ALTERNATIVES = 0.02
"""Minimum time in seconds for alternatives to an exact linkage, if the search may end soon."""


_HINGE = "the body comes back without a full turn, but it turns with a hinge that turns fully."
_SLIDER = "the body makes a full turn, which it cannot if a crank drives a slider."
_ROUND = "No linkage of these kinds passes this closed path: "
_LED = "No linkage of these kinds was found for this closed path. Only rotations of the best four-bars were tried, with which "
NOTHING_ROUND = {
    (led, turns): words + why
    for led, words in ((False, _ROUND), (True, _LED))
    for turns, why in ((False, _HINGE), (True, _SLIDER))
}
"""Why there is none, by whether the body's rotations are those of a four-bar, and whether it turns round."""


class Drive(NamedTuple):
    """A kind of linkage, which guide of it is driven, and how."""

    kind: Kind
    first: Any
    second: Any
    driver: Driver


def drives(kinds: Sequence[Kind], driver: Driver | None) -> list[Drive]:
    """All ways to drive linkages of some kinds, or those by one driver."""
    found = []
    for kind in kinds:
        one, other = GUIDES[kind]
        for first, second in dict.fromkeys(((one, other), (other, one))):
            found += [Drive(kind, first, second, by) for by in DRIVERS[first] if driver in (None, by)]
    return found


class Candidates(NamedTuple):
    """Pairs with what they are and how well they fit, best of all first or in any order."""

    pairs: Pairs
    drive: Ints
    """(n,): place among the drives of the request."""
    cost: Floats
    """(n,): J squared."""
    branch: Floats
    way: Floats
    first: Floats
    """(n,): the drive at the first sample, where it is given."""

    def take(self, places: Any) -> Candidates:
        """Some of them."""
        return Candidates(self.pairs.take(places), *(column[places] for column in self[1:]))

    def joined(self, *others: Candidates) -> Candidates:
        """These and others after them."""
        pairs = self.pairs.joined(*(one.pairs for one in others))
        return Candidates(pairs, *(np.concatenate(columns) for columns in zip(self[1:], *(o[1:] for o in others))))


# -- guides ----------------------------------------------------------------------------------------------------------


Sorts = dict[Any, Guides]
"""Guides of each sort, the best first."""


def exact_guides(body: Body, sorts: set[Any], drive: Floats | None = None) -> Sorts:
    """Guides that the poses keep to: up to four circles, the best rails and slots, and where any direction does, some of all.

    ``drive`` (N,): the way along a rail or slot, where it is given.
    """
    motion = Motion.of(body)
    straight = {sort: _exact_lines(seen, drive) for sort, seen in _lines_seen(motion) if sort in sorts}
    if Circle not in sorts:
        return straight
    if body.position.size <= FEW:
        return {Circle: as_circles(body, sampled_dyads(body, 90, np.random.default_rng(20)))} | straight
    dyads = linear_dyads(body)
    if dyads.radius.size:
        dyads, error = polished(body, dyads)
        dyads = dyads.take(error < _EXACT)
    found = [as_circles(body, dyads)]
    for guides in straight.values():  # a pencil of rails: the point in its middle goes round
        if guides.point.size > 2 and not guides.inverse[0]:
            found.append(as_circles(body, circles(body, np.array([guides.point.mean()]))))
    return {Circle: found[0].joined(*found[1:])} | straight


def _lines_seen(motion: Motion) -> tuple[tuple[Any, Motion], ...]:
    """Of rails and slots the motion in which their points run on lines."""
    return (Rail, motion), (Slot, motion.inverse)


def _exact_lines(motion: Motion, drive: Floats | None) -> Guides:
    if motion.position.size <= 2:  # any point has a line through two places
        return lines_of(motion, _points())
    lines = Straight(motion)
    best, error = lines.stationary()
    if motion.position.size == 3 or error[1] < _EXACT:  # a pencil: one in every direction
        ways = _ALL_WAYS if motion.position.size == 3 else _ALL_WAYS[::_FEWER_WAYS]
        return lines.along(ways if drive is None else np.concatenate([_timely(lines, drive), ways]))
    return best.take(error < _EXACT)


def _timely(lines: Straight, drive: Floats) -> Floats:
    """Of the directions of a pencil those few along which the way is most like the given one (N,)."""
    fine = lines.along(np.linspace(0.0, np.pi, _FINE, endpoint=False))
    way = (np.conj(1j * np.exp(1j * fine.normal))[:, None] * lines.motion.places(fine.point)).real
    off = np.stack([way - drive, way + drive])
    miss = np.min(np.std(off, axis=2), axis=0)
    lowest = (miss <= np.roll(miss, 1)) & (miss <= np.roll(miss, -1))
    best = np.flatnonzero(lowest)
    return fine.normal[best[np.argsort(miss[best], kind="stable")[:4]]]


def near_guides(body: Body, sorts: set[Any]) -> Sorts:
    """Guides of points all over the body, or the ground, and of all directions."""
    motion = Motion.of(body)
    found = {sort: lines_of(seen, _points()) for sort, seen in _lines_seen(motion) if sort in sorts}
    for sort, seen in _lines_seen(motion):
        if sort in sorts and seen.position.size > 2:
            lines = Straight(seen)
            found[sort] = found[sort].joined(lines.stationary()[0], lines.along(_ALL_WAYS))
    if Circle not in sorts:
        return found
    rough = circles(body, _points())
    if body.position.size > FEW:
        fine, error = landscape(body, 10, 24)
        fine, _ = distinct_dyads(fine, error, 24)
        rough = fine.joined(rough)
    proper = (np.abs(rough.fixed) < FARTHEST) & (rough.radius > 1e-6)
    return {Circle: as_circles(body, rough.take(proper))} | found


def _points() -> Any:
    radius, angle = np.meshgrid(_RADII[1:], np.arange(_AROUND) * (2 * np.pi / _AROUND), indexing="ij")
    return np.concatenate([[0j], (radius * np.exp(1j * angle)).ravel()])


def pairs_of(sorts: Sorts, ways: Sequence[Drive]) -> tuple[Pairs, Ints]:
    """All pairs for some drives, and which drive each is for."""
    firsts, seconds, hinges, numbers = [], [], [], []
    for number, way in enumerate(ways):
        one, other = sorts[way.first], sorts[way.second]
        i, j = (index.ravel() for index in np.indices((one.point.size, other.point.size)))
        if way.first is way.second:
            i, j = i[i != j], j[i != j]
        firsts.append(one.take(i))
        seconds.append(other.take(j))
        hinges.append(np.full(i.size, way.driver is Driver.HINGE))
        numbers.append(np.full(i.size, number))
    pairs = Pairs(firsts[0].joined(*firsts[1:]), seconds[0].joined(*seconds[1:]), np.concatenate(hinges))
    return pairs, np.concatenate(numbers)


# -- the search ------------------------------------------------------------------------------------------------------


class Search:
    """One request's search.

    ``given`` (N,): the drive from the first sample on, in radians or in the unit of length; None where it is free.
    ``turned`` (N,): rotations to begin with, where none are asked for. ``leads``: linkages to begin with at the given drive.
    ``soon``: see `search_guided`.
    """

    def __init__(
        self,
        poses: Poses,
        limits: Limits,
        ways: Sequence[Drive],
        tolerance: float,
        work: Work,
        given: Floats | None = None,
        turned: Floats | None = None,
        rounds: int | None = None,
        leads: Sequence[Linkage] = (),
        soon: bool = False,
    ) -> None:
        self.leads, self.soon = leads, soon
        self.rounds = _ROUNDS if rounds is None else rounds
        self.poses, self.limits, self.ways, self.tolerance, self.work = poses, limits, list(ways), tolerance, work
        self.given = given
        if given is not None and not ways[0].driver.turns:
            self.given = given / poses.length_scale
        samples = Samples.of(poses, self.given)
        if turned is not None:
            samples = samples._replace(angle=np.where(samples.rotation_missing, turned, samples.angle))
        self.idle = _IDLE if turned is None else _IDLE_LED
        self.all = self._problem(samples)
        self.samples = self.all.samples
        self.few = (
            self.all if self.samples.number <= _SAMPLES else self._problem(_some(self.samples, _SAMPLES, _FEWER))
        )
        self.posed = poses if turned is None else replace(poses, rotation=turned, rotation_weights=None)
        self.body = Body(self.posed)
        full = poses.full
        self.thin = self.body if full.size <= _MANY else Body(poses.at(full[:: 3 * full.size // _MANY]))
        self.sorts = {sort for way in ways for sort in (way.first, way.second)}
        self.random = np.random.default_rng(20)
        self.seeds = 0
        self.found: Candidates | None = None
        self.waiting: Candidates | None = None
        """What keeps the limits at the samples, to be looked at between them when the search has ended."""
        self.trace: list[tuple[float, float]] = []
        self.notes: list[str] = []
        self._used: Counter[float] = Counter()
        """How often hops started from a valley, by its cost."""
        self._made: dict[tuple[int, float], Solution] = {}
        """Answers as linkages, by their drive and J squared."""

    # -- candidates -------------------------------------------------------------------------------------------------

    def _problem(self, samples: Samples, given: bool = False) -> Problem:
        """The limits of the request at some samples; ``given``: at the drive that is given."""
        return Problem(samples, self.limits, self.poses, given)

    def measured(self, pairs: Pairs, drive: Ints, problem: Problem, sweeps: int = 2) -> Candidates:
        """Pairs with J squared, branch and way at the poses that they allow."""
        at = problem.look(Chart(pairs), np.zeros((drive.size, 4)), sweeps, bounded=False)
        branch, way = np.where(at.sines >= 0, 1.0, -1.0), np.where(at.gone >= 0, 1.0, -1.0)
        return Candidates(pairs, drive, at.cost, branch, way, np.zeros(drive.size))

    def _measured_again(self, found: Candidates, problem: Problem) -> Candidates:
        return self.measured(found.pairs, found.drive, problem, _AGAIN)

    def look(self, found: Candidates, problem: Problem, sweeps: int) -> Looked:
        """Candidates with what they break of the limits."""
        return problem.look(Chart(found.pairs), _labels(found), sweeps)

    def descended(
        self, begin: Candidates, stages: Sequence[Stage], problem: Problem, margin: Floats | None = None
    ) -> Candidates:
        """Candidates after descents in which broken limits weigh more from stage to stage; their J squared alone."""
        for stage in stages:
            if not begin.cost.size or (self.work.expired() and self.found is not None):
                break
            pairs, _, _ = problem.descended(Chart(begin.pairs), _labels(begin, margin), stage, self.work)
            begin = begin._replace(pairs=pairs)
        return begin

    def _signs(self, found: Candidates, at: Looked) -> Floats:
        """Along which candidates' own coordinate the given drive counts, (n,): a cylinder's is longer where it is more."""
        first, second, hinge = found.pairs
        # where two slots meet tells nothing of where a rod is fastened
        cylinder = first.inverse & ~hinge & ~second.inverse
        slides = first.straight & ~hinge
        return np.where(
            cylinder, np.sign(at.extension), np.where(slides, found.way * np.sign(self.samples.drive[-1]), 1.0)
        )

    def _timing(self, at: Looked, sign: Floats, drive: Floats) -> tuple[Floats, Floats]:
        """The drive at the first sample (n,) for which the given one is nearest to their own, and how near, squared."""
        off = at.drive - sign[:, None] * drive
        if self.ways[0].driver.turns:
            first = np.angle(np.mean(np.exp(1j * off), axis=1))
            off = (off - first[:, None] + np.pi) % (2 * np.pi) - np.pi
            return first, np.mean(off**2, axis=1)
        first = np.mean(off, axis=1)
        return first, np.mean((off - first[:, None]) ** 2, axis=1)

    @cached_property
    def given_at_all(self) -> Problem:
        """All samples with the drive that is given."""
        return self._problem(self.samples, given=True)

    def timed(self, begin: Candidates, stages: Sequence[Stage]) -> Candidates:
        """Candidates after descents at the drive that is given, or as many as the time allows; with J squared there."""
        few = max(1, _TIMED_AT_ONCE // self.samples.number)
        parts = [self._timed(begin.take(slice(few)), stages)]
        for k in range(few, begin.cost.size, few):
            known = self.found is not None or any(np.isfinite(part.cost).any() for part in parts)
            if known and self.work.expired():
                break
            parts.append(self._timed(begin.take(slice(k, k + few)), stages))
        return parts[0].joined(*parts[1:])

    def _timed(self, begin: Candidates, stages: Sequence[Stage]) -> Candidates:
        at = self.look(begin, self.all, _AGAIN)
        sign = self._signs(begin, at)
        first, _ = self._timing(at, sign, self.samples.drive)
        for stage in stages:
            chart, labels = Chart(begin.pairs), _labels(begin, sign=sign)
            pairs, first, _ = self.given_at_all.descended(chart, labels, stage, self.work, first)
            begin = begin._replace(pairs=pairs)
        at = self.given_at_all.look(Chart(begin.pairs), _labels(begin, sign=sign), 12, first)
        return begin._replace(cost=np.where(at.closed, at.cost, np.inf), first=first)

    def broken(self, found: Candidates) -> tuple[Candidates, Floats]:
        """Candidates with their J squared at the closed poses, and the most by which each breaks a limit there."""
        at = self._at(found)
        worst = np.where(at.closed & np.isfinite(at.cost), at.worst, np.inf)
        return found._replace(cost=at.cost), worst

    def _at(self, found: Candidates) -> Looked:
        """Candidates at the poses that close, and where the drive is given those that it leads to."""
        if self.given is None:
            return self.look(found, self.all, _SWEEPS)
        sign = self._signs(found, self.look(found, self.all, _AGAIN))
        return self.given_at_all.look(Chart(found.pairs), _labels(found, sign=sign), _SWEEPS, found.first)

    # -- seeds ------------------------------------------------------------------------------------------------------

    @property
    def _straight_drive(self) -> Floats | None:
        """The given travel at the poses that have both parts."""
        if self.given is None or self.ways[0].driver.turns:
            return None
        return self.given[self.poses.full]

    def exact(self) -> Candidates | None:
        """Pairs of exact guides, refined together; several kinds at once."""
        sorts = exact_guides(self.body, self.sorts, self._straight_drive)
        pairs, drive = pairs_of(sorts, self.ways)
        if not pairs.number:
            return None
        if self.body.position.size <= FEW:
            pairs, drive = self._spread(pairs, drive)
        return self._refined(self.measured(pairs, drive, self.all))

    def _refined(self, begin: Candidates) -> Candidates:
        pairs, _, _ = self.all.descended(Chart(begin.pairs), _labels(begin), _EXACTLY, Work())
        self.seeds += begin.cost.size
        return self.measured(pairs, begin.drive, self.all, 4)

    def _spread(self, pairs: Pairs, drive: Ints) -> tuple[Pairs, Ints]:
        """Of very many pairs, or of as many as the time allows, those that break the limits least, as many of each drive."""
        problem, merit = self._problem(_with_between(self.samples)), np.full(pairs.number, np.inf)
        parts = -(-pairs.number // _SPREAD_AT_ONCE)
        for first in range(parts):
            part = slice(first, None, parts)
            merit[part] = self._merit(self.measured(pairs.take(part), drive[part], self.all), problem, errors=0.0)
            if self.work.expired():
                break
        chosen = _in_turn(self._apart(pairs, drive, merit, 4 * _SEEDS))
        return pairs.take(chosen), drive[chosen]

    def _best(self, found: Candidates, most: int, problem: Problem, errors: float = 1.0) -> Ints:
        """Places of the best of each drive by `_merit`."""
        return _in_turn(self._apart(found.pairs, found.drive, self._merit(found, problem, errors), most))

    def _merit(self, found: Candidates, problem: Problem, errors: float) -> Floats:
        """Broken limits and J squared times ``errors``: less is better."""
        at = self.look(found, problem, 2)
        merit = 0.3 * at.merit + np.where(np.isfinite(at.cost), errors * at.cost, np.inf)
        if self.given is not None:
            merit = merit + self._timing(at, self._signs(found, at), problem.samples.drive)[1]
        return merit

    def _apart(self, pairs: Pairs, drive: Ints, order: Floats, most: int) -> list[Ints]:
        """Of each drive the places of the first that differ, in the order of some numbers and where those are finite."""
        marks, rank = _marks(pairs), np.argsort(order, kind="stable")
        rank = rank[np.isfinite(order[rank])]
        reach = np.full(rank.size, _CELL)
        places = []
        for number in range(len(self.ways)):
            own = rank[drive[rank] == number]
            places.append(own[distinct.apart(marks[own], reach[: own.size], (), 0, most)])
        return places

    def _unlike(self, found: Candidates, known: Candidates | None) -> Ints:
        """Places of those that are no known valley of their drive again, or lie a part lower in it."""
        if known is None:
            return np.arange(found.cost.size)
        kept = []
        marks, others = _marks(found.pairs), _marks(known.pairs)
        for place in range(found.cost.size):
            near = (known.drive == found.drive[place]) & (found.cost[place] > (1 - _WORTH) ** 2 * known.cost)
            if not np.any(np.abs(others[near] - marks[place]).max(axis=1) < _CELL):
                kept.append(place)
        return np.array(kept, dtype=int)

    def near(self, lacking: Ints | None = None) -> Candidates:
        """Pairs of guides of points all over body and ground: the best of each drive.

        ``lacking``: drives of which nothing is known, of those that fit best nothing could be made: of these alone, and of all
        their pairs those that break the limits least.
        """
        numbers = np.arange(len(self.ways)) if lacking is None else lacking
        ways, motion = [self.ways[number] for number in numbers], Motion.of(self.thin)
        best = near_guides(self.thin, {sort for way in ways for sort in (way.first, way.second)})
        for sort, guides in best.items():
            best[sort] = guides.take(np.argsort(_errors(guides, motion), kind="stable")[:_LOOKED_AT])
        pairs, drive = pairs_of(best, ways)
        thin = self._problem(_some(self.samples, 10, 8))
        found = self.measured(pairs, numbers[drive], thin, 2)
        self.seeds += _SEEDS * len(ways)
        if lacking is not None:
            return found.take(self._best(found, _SEEDS, thin, _LITTLE))
        # the limits cost more to look at: of each drive the half that fits best
        places = []
        for number in range(len(self.ways)):
            own = np.flatnonzero(found.drive == number)
            places.append(own[np.argsort(found.cost[own], kind="stable")[:300]])
        found = found.take(np.concatenate(places))
        return found.take(self._best(found, _SEEDS, thin))

    def led_by(self) -> Candidates | None:
        """The linkages to begin with, of the drives that are asked for."""
        found = []
        for one in self.leads:
            sorts = type(one.guides[0]), type(one.guides[1])
            for number, way in enumerate(self.ways):
                if (way.first, way.second, way.driver) == (*sorts, one.driver):
                    first, second = (_as_guides(guide, self.posed) for guide in one.guides)
                    hinge = np.array([way.driver is Driver.HINGE])
                    found.append(self.measured(Pairs(first, second, hinge), np.array([number]), self.all))
        return found[0].joined(*found[1:]) if found else None

    def refine_leads(self) -> None:
        """Descend from the linkages to begin with, without a search elsewhere."""
        begin = self.led_by()
        if begin is None:
            return
        if self.given is None:
            self._to_the_end(begin)
        else:
            for stages in (_GIVEN, _GIVEN_END):
                self._answers(self.timed(begin, stages))
        self.note()

    def hops(self, pool: Candidates) -> Candidates:
        """Perturbed copies of each drive's best valleys, those used least first; of every other one guide alone is moved far."""
        some = []
        for number in range(len(self.ways)):
            own = np.flatnonzero(pool.drive == number)
            cost = pool.cost[own]
            rank = np.log(np.maximum(cost, 1e-300)) + TIRED * np.array([self._used[value] for value in cost.tolist()])
            own = own[np.argsort(rank, kind="stable")[:3]]
            self._used.update(pool.cost[own].tolist())
            some.append(np.resize(own, _HOPS) if own.size else own)
        begin = pool.take(_in_turn(some))
        chart = Chart(begin.pairs)
        count = begin.cost.size
        share = np.where(self.random.random((count, 2)) < 0.5, _STAYS, 1.0)
        share[share[:, 0] == share[:, 1]] = 1.0
        noise = self.random.standard_t(3, size=(count, 2 * OWN)) * np.tile(_FAR, 2) * np.repeat(share, OWN, axis=1)
        self.seeds += count
        return self.measured(chart.pairs_at(chart.start + noise), begin.drive, self.few, 2)

    def relatives(self, valleys: Candidates) -> Candidates | None:
        """Valleys of one drive as beginnings for others: driven otherwise, and with rails bent to circles."""
        to = [(k, *kin) for k, number in enumerate(valleys.drive) for kin in self._kin[number]]
        if not to:
            return None
        place, drive, turned, bent = (np.array(column) for column in zip(*to))
        begin = valleys.pairs.take(place)
        guides = []
        for one, other in ((begin.first, begin.second), (begin.second, begin.first)):
            guides.append(Guides(*(np.where(turned, b, a) for a, b in zip(one, other))))
        for k in (0, 1):
            bend = np.where(self.random.random(drive.size) < 0.5, _BENT, -_BENT)
            guides[k] = guides[k]._replace(curvature=np.where(bent[:, k], bend, guides[k].curvature))
        hinge = np.array([way.driver is Driver.HINGE for way in self.ways])[drive]
        self.seeds += drive.size
        return self.measured(Pairs(guides[0], guides[1], hinge), drive, self.few, 2)

    @cached_property
    def _kin(self) -> list[list[tuple[int, bool, tuple[bool, bool]]]]:
        """Of each drive those that its valleys may begin: which, whether its guides change places, and which are bent."""
        found: list[list[tuple[int, bool, tuple[bool, bool]]]] = []
        for number, way in enumerate(self.ways):
            kin = []
            for other, to in enumerate(self.ways):
                for turned in (False, True):
                    sorts = (way.second, way.first) if turned else (way.first, way.second)
                    bent = tuple(a is Rail and b is Circle for a, b in zip(sorts, (to.first, to.second)))
                    alike = all(a is b or bend for a, b, bend in zip(sorts, (to.first, to.second), bent))
                    if alike and (other != number or turned):
                        kin.append((other, turned, (bent[0], bent[1])))
            found.append(kin)
        return found

    # -- rounds -----------------------------------------------------------------------------------------------------

    def run(self) -> bool:
        """Search until nothing is gained or the time is up; whether it ran to its end."""
        return self._run_free() if self.given is None else self._run_given()

    def _run_given(self) -> bool:
        """First the poses alone, then with the drive that is given."""
        exact = self.exact()
        if exact is not None:
            exact = exact.take(self._best(exact, _SEEDS, self.few))
            self._answers(self.timed(exact, _GIVEN))
            self.note()
        idle, pool = 0, None
        begin = self.near()
        led = self.led_by()
        if led is not None:
            begin = begin.joined(led)
        for _ in range(self.rounds):
            patience = _IDLE_GIVEN + _PATIENCE * np.isinf(self.levels).any()
            if idle >= patience or not self._left.size or (self.work.expired() and self.found is not None):
                break
            before = self.levels
            begin = begin.take(np.isin(begin.drive, self._left))
            begin = self._measured_again(self.descended(begin, _STAGES[:1], self.few), self.few)
            begin = self._pooled(begin, _SEEDS)
            ended = self.timed(begin, _GIVEN)
            pool = ended if pool is None else pool.joined(ended)
            pool = self._pooled(pool)
            self._answers(self.timed(self._pooled(ended, 2), _GIVEN_END))
            self.note()
            if self.work.expired():
                return False
            idle = 0 if np.any(self.levels < (1 - _WORTH) * before) else idle + 1
            begin = self.hops(pool)
        return not self.work.expired()

    def _run_free(self) -> bool:
        exact = self.exact()
        if exact is not None:
            self._answers(exact)
            self.note()
        left = self._left
        if not left.size or (self.work.expired() and self.found is not None):
            return not left.size
        begin = self.near()
        if exact is not None:
            begin = begin.joined(exact.take(self._best(exact, 3, self.few)))
        pool: Candidates | None = None
        ended: Candidates | None = None
        idle = np.zeros(len(self.ways), dtype=int)
        for number in range(self.rounds):
            patience = self.idle + _PATIENCE * np.isinf(self.levels)
            left = np.intersect1d(self._left, np.flatnonzero(idle < patience))
            begin = begin.take(np.isin(begin.drive, left))
            if not begin.cost.size:
                break
            before = self.levels
            begin = self._valued(self.descended(begin, _STAGES, self.few))
            fresh = self._pooled(begin.take(self._unlike(begin, ended)), _ENDED)
            ended = fresh if ended is None else ended.joined(fresh)
            pool = self._pooled(begin if pool is None else pool.joined(begin))
            self._to_the_end(fresh)
            self.note()
            if self.work.expired():
                return False
            idle = np.where(self.levels >= (1 - _WORTH) * before, idle + 1, 0)
            begin, more = self.hops(pool), self.relatives(fresh)
            begin = begin if more is None else begin.joined(more)
            lacking = np.flatnonzero(np.isinf(self.levels))
            if number == 0 and lacking.size:
                begin = begin.joined(self.near(lacking))
        left = self._left
        if self.found is not None and left.size:
            best = self._pooled(self.found, 1)
            if self.samples.number <= _MANY:
                self._to_the_end(best.take(np.isin(best.drive, left)), _LAST)
            self.note()
        return not self.work.expired()

    def straighten(self) -> None:
        """Replace circles that are too large to be told from rails, where rails are asked for too; and say so.

        A rail has one unknown less: it is taken where J rises by less than a hundredth, or by less than what chance makes of
        one unknown more (F below 10), or where it is exact too.
        """
        found = self.found
        if found is None or self.work.expired():
            return
        gone = np.zeros(found.cost.size, dtype=bool)
        for place in (0, 1):
            guides = found.pairs.guides[place]
            long = ~guides.straight & (np.abs(guides.curvature) * _LONG < 1)
            for k in np.flatnonzero(long & ~gone):
                one = found.take([k])
                way = self.ways[int(one.drive[0])]
                number = self._straight_way(way, place)
                if number is None:
                    continue
                line = self._as_rail(one, place, number)
                if line is None:
                    continue
                worse, circle = float(line.cost[0]), float(one.cost[0])
                chance = (worse - circle) * (self.samples.number - 5) / max(circle, 1e-300)
                radius = self.poses.length_scale / abs(float(guides.curvature[k]))
                words = f"A guide of a {way.kind.value.replace('_', '-')} came out as a circle of radius {radius:.3g}"
                exact = max(self.tolerance, _AS_EXACT) ** 2
                if worse <= max(exact, circle * 1.01**2) or chance < _CHANCE:
                    gone[k] = True
                    self.found = self.found.joined(line) if self.found is not None else line
                    reason = (
                        "both are exact"
                        if worse <= self.tolerance**2
                        else f"F = {max(chance, 0):.2g}, below {_CHANCE:g}"
                    )
                    note = (
                        f"{words}, which the samples do not distinguish from a rail ({reason}): a rail is reported."
                    )
                else:
                    note = f"{words}; a rail in its place fits worse (F = {chance:.3g}): the circle is reported."
                if note not in self.notes:
                    self.notes.append(note)
        assert self.found is not None
        more = self.found.cost.size - gone.size
        self.found = self._pooled(self.found.take(~np.concatenate([gone, np.zeros(more, dtype=bool)])), _ANSWERS)

    def _straight_way(self, way: Drive, place: int) -> int | None:
        """The drive of the request that has a rail in the place of a circle."""
        sorts = [way.first, way.second]
        sorts[place] = Rail
        driver = Driver.SLIDER if place == 0 else way.driver
        for number, other in enumerate(self.ways):
            if [other.first, other.second] == sorts and other.driver is driver:
                return number
        return None

    def _as_rail(self, one: Candidates, place: int, number: int) -> Candidates | None:
        """A candidate with the tangent of a circle in its place, refined; None where that breaks the limits."""
        guide = one.pairs.guides[place]
        angle, x, y = np.moveaxis(self._at(one).poses, 2, 0)
        middle = np.mean(x + 1j * y + np.exp(1j * angle) * guide.point[:, None], axis=1)
        inward = guide.centre - middle
        normal = np.angle(inward)
        foot = guide.centre - np.exp(1j * normal) / np.abs(guide.curvature)
        straight = guide._replace(foot=foot, normal=normal, curvature=0.0 * guide.curvature)
        guides = [straight if k == place else guide for k, guide in enumerate(one.pairs.guides)]
        pairs = Pairs(guides[0], guides[1], one.pairs.hinge)
        begin = self.measured(pairs, np.full(1, number), self.all)
        if self.given is not None:
            begin = self.timed(begin, _GIVEN_END)
        else:
            begin = self._refined(begin)
            if not self.limits.only_family:
                begin = self.descended(begin, _END, self.all)
        line, worst = self.broken(begin)
        return line if worst[0] <= 0 and np.isfinite(line.cost[0]) and self.solution(line) is not None else None

    def _to_the_end(self, begin: Candidates, stages: Sequence[Stage] = _END) -> None:
        """Descents along the limits on all samples, and once more for what breaks them between samples."""
        margin = np.zeros(begin.cost.size)
        for _ in range(_TIGHTENED):
            if not begin.cost.size:
                return
            ended = self.descended(begin, stages, self.all if stages is _LAST else self.few, margin)
            ended = self._measured_again(ended, self.all)._replace(branch=begin.branch, way=begin.way)
            lacking = self._answers(ended)
            again = lacking > 0
            if not again.any() or self.work.expired():
                return
            begin, margin = ended.take(again), margin[again] + _SPARE[0] * lacking[again] + _SPARE[1]

    def _valued(self, found: Candidates) -> Candidates:
        """Candidates with what they break of the limits in their cost, as the last descent priced it."""
        at = self.look(found, self.few, _AGAIN)
        return found._replace(cost=at.cost + _STAGES[-1].weight * at.excess)

    @property
    def levels(self) -> Floats:
        """The least J of each drive."""
        return np.full(len(self.ways), np.inf) if self.found is None else self._least(self.found)

    def _least(self, found: Candidates) -> Floats:
        least = np.full(len(self.ways), np.inf)
        np.minimum.at(least, found.drive, np.sqrt(found.cost))
        return least

    @property
    def _left(self) -> Ints:
        """Drives without an answer below the tolerance."""
        return np.flatnonzero(self.levels >= self.tolerance)

    def note(self) -> None:
        """Write down the best J."""
        least = float(self.levels.min())
        if np.isfinite(least) and (not self.trace or least < self.trace[-1][1]):
            self.trace.append((self.work.elapsed, least))
        if self.soon and least < self.tolerance:
            self.soon, self.work = False, self.work.ending_in(max(_ALTERNATIVES, self.work.elapsed))

    def _answers(self, new: Candidates) -> Floats:
        """Keep those of candidates that are a gain and keep the limits over all that they use; others wait to be looked at.

        Returns
        -------
        ndarray, shape (n,)
            By how much the transmission angle of the others falls short between the samples, where nothing else is amiss.
        """
        lacking = np.zeros(new.cost.size)
        new, worst = self.broken(new)
        most = _LOOKED_AT_WHOLE * (4 if self.body.position.size <= FEW else 1)  # few samples leave much between them
        fine = self._apart(new.pairs, new.drive, np.where(worst <= 0, new.cost, np.inf), most)
        kept: list[int] = []
        later: list[int] = []
        least = self.levels**2
        for number, own in enumerate(fine):
            if self.work.expired() and (kept or self.found is not None):
                break
            for place in own:
                if new.cost[place] >= least[number]:
                    later.append(int(place))
                    continue
                missing = self._missing(new.take([place]))
                if not missing:
                    kept.append(int(place))
                    least[number] = new.cost[place]
                elif set(missing) == {"transmission_angle_min"}:
                    lacking[place] = missing["transmission_angle_min"]
        if kept:
            more = new.take(np.array(kept))
            self.found = self._pooled(more if self.found is None else self.found.joined(more), _ANSWERS)
        if later:
            more = new.take(np.array(later))
            self.waiting = self._pooled(more if self.waiting is None else self.waiting.joined(more), _ANSWERS)
        return lacking

    def _missing(self, one: Candidates) -> dict[str, float]:
        """What a single candidate breaks over all that it uses, by name; where that is nothing it is kept as a linkage."""
        solution = self.solution(one)
        if solution is None or solution.transmission_angle_min <= 0:
            return {"samples": np.inf}
        missing = broken_limits(solution, self.poses, self.limits)
        if not missing:
            self._made[_key(one)] = solution
        return missing

    def further(self) -> None:
        """Look at those that were no gain when they were found: further answers of each drive."""
        if self.found is None or self.waiting is None:
            return
        both = self._pooled(self.found.joined(self.waiting), max(_FURTHER // len(self.ways), _LEAST_FURTHER))
        fine = []
        for place in range(both.cost.size):
            one = both.take([place])
            fine.append(_key(one) in self._made or (not self.work.expired() and not self._missing(one)))
        self.found, self.waiting = self._pooled(self.found.joined(both.take(np.array(fine))), _ANSWERS), None

    def _pooled(self, found: Candidates, most: int = _POOL) -> Candidates:
        """The best of each drive that differ."""
        return found.take(_in_turn(self._apart(found.pairs, found.drive, found.cost, most)))

    # -- answers ----------------------------------------------------------------------------------------------------

    def solutions(self) -> list[Solution]:
        """The best of each drive, in the user's unit."""
        if self.found is None:
            return []
        ones = [self.found.take([k]) for k in range(self.found.cost.size)]
        solutions = [self._made.get(_key(one)) or self.solution(one) for one in ones]
        return [one for one in solutions if one is not None]

    def solution(self, one: Candidates) -> Solution | None:
        """A single candidate as a linkage with its errors; None where it does not pass the samples."""
        rotation, *places = self._at(one).poses[0].T
        poses, place = self.poses, places[0] + 1j * places[1]
        position = poses.middle + poses.length_scale * place
        way = self.ways[int(one.drive[0])]
        guides = [_guide(guide.take([0]), poses, float(rotation[0]), complex(place[0])) for guide in one.pairs.guides]
        guides = [_referred(guide, other) for guide, other in zip(guides, guides[::-1])]
        if _parallel(guides):
            return None
        linkage = Linkage((guides[0], guides[1]), way.driver)
        drive, sine = linkage.configuration(rotation, position)
        if not (np.isfinite(drive).all() and np.isfinite(sine).all()) or np.any(sine * sine[0] <= 0):
            return None
        if not way.driver.turns:
            turned = _directed(guides, drive, self.given)
            linkage = replace(linkage, local_guides=turned)
            drive, sine = linkage.configuration(rotation, position)
        if not poses.ordered:
            holds = True
            if way.driver.turns:
                (drive,), (holds,) = in_any_order(drive[None], poses.span_max)
        else:
            drive, holds = _in_order(drive, way.driver.turns, poses.span_max)
        if not holds:
            return None
        linkage = replace(linkage, branch=1 if sine[0] > 0 else -1, start=float(drive[0]))
        travel = drive - drive[0]
        if np.ptp(travel) < _LEAST_TRAVEL * (1.0 if way.driver.turns else poses.length_scale):
            return None
        straight = [place for place, guide in enumerate(guides) if not isinstance(guide, Circle)]
        if any(np.ptp(linkage.along(place, travel)) < _LEAST_STROKE * poses.length_scale for place in straight):
            return None
        if poses.closed and not linkage.turns_fully:
            return None
        if not np.isfinite(linkage.body(drive).rotation).all():
            return None
        (found,) = assess(poses, [linkage], poses.whole(travel) if way.driver.turns else travel)
        return found if np.isfinite(found.errors.objective) else None


def _key(one: Candidates) -> tuple[int, float]:
    """A single candidate by its drive and J squared."""
    return int(one.drive[0]), float(one.cost[0])


def _in_order(drive: Floats, turns: bool, span_max: float) -> tuple[Floats, bool]:
    """The drive (N,) as it goes one way, and whether it does: samples out of order by no more than noise are put in it."""
    if turns:
        straight, holds = in_order(drive[None], span_max)
        if holds[0]:
            return straight[0], True
        steps = np.diff(drive)
        steps -= TURN * np.round(steps / TURN)
        drive = drive[0] + np.concatenate([[0.0], np.cumsum(steps)])
    way = 1.0 if drive[-1] >= drive[0] else -1.0
    along = way * (drive - drive[0])
    if np.all(np.diff(along) > 0):
        return drive, not turns or along[-1] < span_max
    rising, falling = np.maximum.accumulate(along), np.minimum.accumulate(along[::-1])[::-1]
    middle = (rising + falling) / 2
    noise = float(np.max(np.abs(middle - along)))
    middle = middle + _EVEN * (middle[0] + np.linspace(0.0, 1.0, along.size) * (middle[-1] - middle[0]) - middle)
    holds_now = noise < _NOISE * (middle[-1] - middle[0]) and bool(np.all(np.diff(middle) > 0))
    if turns:
        holds_now = holds_now and middle[-1] - middle[0] < span_max
    return drive[0] + way * middle, holds_now


def _guide(one: Guides, poses: Poses, rotation: float, position: complex) -> Guide:
    """A guide in the user's unit; a rail's point is where its body point is at the first sample, whose pose is given."""
    scale, middle = poses.length_scale, poses.middle
    point, foot, normal = complex(one.point[0]), complex(one.foot[0]), float(one.normal[0])
    inward, turned = np.exp(1j * normal), np.exp(1j * rotation)
    place = np.conj(turned) * (point - position) if one.inverse[0] else position + turned * point
    on_line = foot + complex(1j * inward * (np.conj(1j * inward) * (place - foot)).real)
    if one.inverse[0]:
        return Slot(middle + scale * point, scale * on_line, float(wrap(normal + np.pi / 2)))
    if one.straight[0]:
        return Rail(middle + scale * on_line, float(wrap(normal + np.pi / 2)), scale * point)
    return Circle(middle + scale * complex(one.centre[0]), scale / abs(float(one.curvature[0])), scale * point)


def _as_guides(guide: Guide, poses: Poses) -> Guides:
    """The other way round: a guide in the lengths of the search."""
    scale, middle = poses.length_scale, poses.middle
    if isinstance(guide, Slot):
        one = (guide.pin - middle) / scale, guide.body_point / scale, guide.body_direction - np.pi / 2, 0.0, True
    elif isinstance(guide, Rail):
        one = guide.body_point / scale, (guide.point - middle) / scale, guide.direction - np.pi / 2, 0.0, False
    else:
        centre, point, radius = (guide.pivot - middle) / scale, guide.body_point / scale, guide.radius / scale
        first = poses.full[0]
        inward = np.angle(centre - poses.scaled[first] - poses.turned[first] * point)
        one = point, centre - radius * np.exp(1j * inward), inward, 1 / radius, False
    return Guides(*(np.array([part]) for part in one))


def _referred(guide: Guide, other: Guide) -> Guide:
    """A slot measured from the foot of the other guide's body point on it; of two slots from where they meet."""
    if not isinstance(guide, Slot):
        return guide
    along = np.exp(1j * guide.body_direction)
    to = other.body_point - guide.body_point
    if isinstance(other, Slot):
        across = np.exp(1j * other.body_direction)
        below = (np.conj(along) * across).imag
        way = (np.conj(to) * across).imag / below if abs(below) > 1e-12 else 0.0
    else:
        way = (np.conj(along) * to).real
    return guide._replace(body_point=complex(guide.body_point + way * along))


def _parallel(guides: Sequence[Guide]) -> bool:
    """Whether two rails, or two slots, are parallel: the body never turns."""
    first, second = guides
    if isinstance(first, Rail) and isinstance(second, Rail):
        return bool(abs(np.sin(first.direction - second.direction)) < _TURNS)
    if isinstance(first, Slot) and isinstance(second, Slot):
        return bool(abs(np.sin(first.body_direction - second.body_direction)) < _TURNS)
    return False


def _directed(guides: Sequence[Guide], drive: Floats, given: Floats | None) -> tuple[Guide, Guide]:
    """Guides whose first, driven along itself, counts as asked: a cylinder's length is positive, given travel has its sign."""
    first, second = guides
    backwards = given is not None and (drive[-1] - drive[0]) * given[-1] < 0
    if isinstance(first, Rail):
        turned = first._replace(direction=float(wrap(first.direction + np.pi)))
        return (turned if backwards else first), second
    assert isinstance(first, Slot)
    if backwards or (given is None and drive[0] < 0):
        first = first._replace(body_direction=float(wrap(first.body_direction + np.pi)))
        drive = -drive
    if drive[0] < 0:  # of two slots: the rod is fastened as far on the other side of where they meet
        along = np.exp(1j * first.body_direction)
        first = first._replace(body_point=complex(first.body_point - (abs(drive[0]) + np.max(np.abs(drive))) * along))
    return first, second


def search_guided(
    poses: Poses,
    limits: Limits,
    kinds: Sequence[Kind],
    driver: Driver | None = None,
    tolerance: float = DEFAULT_TOLERANCE,
    work: Work | None = None,
    given: Floats | None = None,
    turned: Floats | None = None,
    rounds: int | None = None,
    leads: Sequence[Linkage] = (),
    soon: bool = False,
) -> tuple[list[Solution], SearchReport]:
    """The best linkages with sliders for poses whose drive is free, or given.

    Parameters
    ----------
    poses : Poses
        With two samples at least that have both rotation and position, or with positions alone.
    limits : Limits
    kinds : sequence of Kind
        Among which; each has at least one rail or slot.
    driver : Driver, optional
        Only linkages that are driven so.
    tolerance : float
        J below it is exact.
    work : Work, optional
        Once it has expired the best found so far is returned.
    given : ndarray, shape (N,), optional
        The drive at the samples, from the first one: radians, or the unit of length, as its ``driver`` has it. Without a driver
        those of sliders and cylinders.
    turned : ndarray, shape (N,), optional
        Rotations to begin with, where none are asked for: such as those of a four-bar along the same way.
    rounds : int, optional
        At most so many.
    leads : sequence of Linkage
        With which to begin, where the drive is given.
    soon : bool
        Whether the search for alternatives to the first exact linkage takes at most as long as the search for it, at least 20 ms.

    Returns
    -------
    solutions : list of Solution
        Of each kind and drive the best that differ, in no order: J alone does not rank them. Law: with more time none of the
        least errors is larger.
    report : SearchReport
    """
    work = work or Work()
    ways = drives(kinds, driver)
    if given is not None and driver is None:
        ways = [way for way in ways if not way.driver.turns]
    round_once = _comes_round_turned(poses, turned) if poses.closed else None
    if poses.closed:  # round and round goes only what turns
        ways = [way for way in ways if _goes_round(way, round_once)]
    if not ways:
        notes = [] if round_once is None else [NOTHING_ROUND[turned is not None, round_once]]
        return [], SearchReport(StoppedBy.CONVERGED, [], seeds=0, notes=notes)
    search = Search(poses, limits, ways, tolerance, work, given, turned, rounds, leads, soon)
    ended = search.run()
    search.further()
    search.straighten()
    solutions = search.solutions()
    reached = not search._left.size or (soon and search.levels.min() < tolerance)
    stopped = StoppedBy.TOLERANCE if reached else StoppedBy.CONVERGED if ended else StoppedBy.BUDGET
    return solutions, SearchReport(stopped, search.trace, seeds=search.seeds, notes=search.notes)


def _comes_round_turned(poses: Poses, turned: Floats | None) -> bool | None:
    """Whether the body turns by whole turns over a closed way, as its angles say; None where some are missing."""
    rotation = turned if poses.rotation is None or poses.rotation_weights is not None else poses.rotation
    if rotation is None:
        return None
    steps = np.diff(np.append(rotation, rotation[0]))
    return bool(round(float(np.sum(steps - TURN * np.round(steps / TURN))) / TURN))


def _goes_round(way: Drive, turned: bool | None) -> bool:
    """Whether a drive may turn fully, the body turning round with it or not."""
    if way.kind is Kind.RAIL_SLOT or not way.driver.turns:  # its slot never passes the rail's direction
        return False
    if turned is None:
        return True
    return turned if way.driver is Driver.HINGE else not turned or way.kind is not Kind.SLIDER_CRANK


_CELL = 0.02
"""Difference in some mark from which on pairs are two."""


def _marks(pairs: Pairs) -> Floats:
    """Numbers that tell pairs apart, (n, 12)."""
    columns: list[Any] = []
    for one in pairs[:2]:
        size = np.maximum(1.0, np.abs(one.point))
        columns += [one.point.real / size, one.point.imag / size, np.cos(2 * one.normal), np.sin(2 * one.normal)]
        columns += [np.log1p(np.abs(one.curvature)), np.log(size)]
    return np.stack(columns, axis=1)


def _errors(guides: Guides, motion: Motion) -> Floats:
    """First-order rms distance of guides from the poses, (n,)."""
    seen = [motion, motion.inverse]
    out = np.empty(guides.point.size)
    for k, one in enumerate(seen):
        own = guides.inverse == (k == 1)
        places = one.places(guides.point[own])
        centre, bent = guides.centre[own][:, None], guides.curvature[own][:, None]
        straight = guides.straight[own][:, None]
        inward = np.exp(1j * guides.normal[own])[:, None]
        gap = places - centre
        normal = np.where(straight, -inward, gap / np.maximum(np.abs(gap), 1e-12))
        off = np.where(straight, (np.conj(-inward) * gap).real, np.abs(gap) - 1 / np.where(straight, 1.0, bent))
        swing = (np.conj(normal) * 1j * (places - one.position)).real
        out[own] = np.sqrt(np.sum((off**2 / (1 + swing**2)) * one.root**2, axis=1))
    return out


def _in_turn(places: list[Ints]) -> Ints:
    """The first of each drive, then the second: what time is left goes to all alike."""
    rank = np.concatenate([np.arange(own.size) for own in places])
    return np.concatenate(places)[np.argsort(rank, kind="stable")]


def _labels(found: Candidates, margin: Floats | None = None, sign: Floats | None = None) -> Floats:
    """As of `Problem.descended`, (n, 4)."""
    nothing = np.zeros(found.cost.size)
    return np.stack(
        [found.branch, found.way, nothing if margin is None else margin, nothing if sign is None else sign], 1
    )


def _with_between(samples: Samples) -> Samples:
    """Samples with others between them, as the body would go straight on: where limits are looked at, not errors."""
    number = samples.number
    at = np.linspace(0, number - 1, (number - 1) * (_BETWEEN + 1) + 1)
    place = np.arange(number)
    whole = np.arange(at.size) // (_BETWEEN + 1)
    return Samples(
        np.interp(at, place, np.unwrap(samples.angle)),
        np.interp(at, place, samples.position.real) + 1j * np.interp(at, place, samples.position.imag),
        samples.rotation_variance[whole],
        samples.position_variance[whole],
        samples.rotation_missing[whole],
        samples.position_missing[whole],
        np.interp(at, place, samples.drive),
    )


def _some(samples: Samples, most: int, few: int) -> Samples:
    """All samples, or of many a few evenly chosen, whose cost stands for the others."""
    if samples.number <= most:
        return samples
    kept = np.unique(np.round(np.linspace(0, samples.number - 1, few)).astype(int))
    share = kept.size / samples.number
    some = Samples(*(column[kept] for column in samples))
    turn, place = some.rotation_variance, some.position_variance
    return some._replace(
        rotation_variance=np.where(some.rotation_missing, turn, turn * share),
        position_variance=np.where(some.position_missing, place, place * share),
    )
