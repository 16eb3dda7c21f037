"""Where a linear actuator goes: the ends on ground and link that need the least force, or why there are none.

An actuator of retracted length L0 and stroke s between a point G and a pin q of a moving link has the length
``L = |X + R q - G|`` and, per radian of the drive, the moment arm dL/dphi; its force is the drive's torque over its arm. It
uses its whole stroke: its length is L0 at one end of the interval and L0 + s at the other. No placement has a smaller peak
force than the integral of the torque's amount over s, nor a larger least arm than s over the interval.

On a link that turns about a pivot, with alpha the angle there between G and pin, ``L^2 = S - T cos alpha``: S and T follow from
alpha at the first position, and one unknown is left. On any other link q follows from G: it lies on two circles, one for each
end of the motion, in the link's frame. So a grid is over G, a plane, in four families: extending or retracting, and two
intersections. That grid, a product of matrices, finds where to begin; a descent of G and q on the largest u with
``arm >= u |torque|`` at every position ends at the optimum.

A knee locks a linkage at one end of its way. Its strut of two links u + v between G and q is placed like an actuator; it is
straight just before that end and there, on a stop, bent the other way by the over-centre angle delta, with the length
``(u + v) sqrt(1 - 4 k (1 - k) sin^2(delta / 2))``, k = u / (u + v). A load that pushes the strut together then presses it onto
the stop. The linkage goes beyond its end by a little while the knee passes the line.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from synthesis.arrays import Complexes, Flags, Floats, Ints, angle_at, dot
from synthesis.linkage import LinkMotion
from synthesis.mechanism import Box, outside
from synthesis.one_variable import closer_looks
from synthesis.work import Work

GRID = 60
"""Points of the grid of G, either way."""
BEGINNINGS = 3
"""Placements of each family from which a descent may begin."""
_APART = 0.06
"""Of the box or the reach: distance of such placements from one another."""
_NEWTON = 3
"""Steps to the lengths that are given."""
_AGAIN, _GAIN = 6, 1e-8
"""Descents from the best end of all, at most, and the part that each must gain for another."""
DESCENTS = 8
"""Descents for one actuator."""
_ROW_DESCENTS = 3
"""Descents for a row of a catalogue."""
_NEARLY = 1.1
"""Times its force that a row may lack before its place is gone over once more."""
COARSE_GRID = 30
"""The same for a catalogue and for free sizes: many actuators take more from one another than from a finer grid."""
_STROKES = np.array([0.12, 0.25, 0.4, 0.55, 0.7, 0.85, 0.97])
"""Of the longest way of a pin, where the stroke is free."""
_RUNG = 1.5
"""Times the one before: retracted lengths, where they are free, all that fit between box and link."""
_CLOSER = 4
"""Times that places around the best ones are looked at, each half as far away as the last."""
_ABOUT = np.array([complex(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y])
"""Such places, in steps of the grid."""
_NEAREST = ("arm", "dead", "pin_box", "reach", "stroke", "box")
"""Reasons, the one first that is nearest to a placement."""
_ANGLES = 2001
"""Values of alpha that are looked at on a link with a pivot."""
_NEAR_DEAD = 1e-3
"""Angles this near to 0 and to pi lose too many digits."""
_BEGIN, _BEGIN_AGAIN, _LOST = 0.999, 0.9, 1
"""Of the least arm over burden where a descent begins, and where it begins once more; so many that led to no placement do."""
_LOOKS = (33,) * 8
"""Nodes of closer looks between them."""
_ALMOST = 0.7
"""Of the arm asked for where a descent begins all the same."""
_HAIR = 1e-7
"""Of the size: by so much a placement may be beyond what is wanted, for the rounding of descents."""
_AROUND = 720
"""Directions in which a circle about a pivot is looked for in a box."""


class Actuator(NamedTuple):
    """An actuator: its length when retracted, and its stroke."""

    retracted: float
    stroke: float


@dataclass(frozen=True)
class Sizes:
    """Which sizes of an actuator may change: retracted length, at least stroke and dead length, stroke, both or neither."""

    begin: Actuator
    retracted_free: bool = False
    stroke_free: bool = False
    dead_length: float = 0.0


class Wanted(NamedTuple):
    """What a placement must keep to.

    ``box``: of the ground point. ``reach``: largest distance of the pin from the origin of its link's frame. ``arm``: least
    moment arm, per radian of the drive. ``extends``: which way it goes, where that matters. ``pin_box``: of the pin, in its
    link's frame.
    """

    box: Box
    reach: float
    arm: float
    extends: bool | None = None
    pin_box: Box | None = None


@dataclass(frozen=True)
class Placement:
    """Where an actuator is, and what that means at the n positions."""

    ground: complex
    pin: complex
    """In its link's frame."""
    extends: bool
    """Whether it is retracted at the first position."""
    length: Floats
    arm: Floats
    """dL/dphi: negative where it shortens as the drive's parameter grows."""
    force: Floats
    """Along the actuator, pushing counted as positive."""
    worst: float
    """Largest of |torque / arm|, or without a load of 1 / |arm|: what was made least."""

    @property
    def peak(self) -> float:
        """The largest force, of either sign."""
        return float(np.max(np.abs(self.force)))


class Refused(NamedTuple):
    """Why an actuator finds no place: what binds, with its numbers."""

    reason: str
    """``stroke``, ``reach``, ``box``, ``pin_box``, ``dead`` or ``arm``; ``knee``: its handle turns back on both sides."""
    needed: float
    """Reach or arm: what would be needed, or what there is at best; the place of a dead point, in the drive's parameter."""
    between: tuple[int, int] | None = None
    """Positions between which the dead point lies, from 0."""


class Question:
    """Placements on one link for actuators of several sizes: what all of them share.

    Parameters
    ----------
    link : LinkMotion
        As seen from where the other end is.
    at : ndarray, shape (n,)
        The drive's parameter.
    torque : ndarray, shape (n,)
        That the drive must give; zero everywhere: the largest least arm is looked for.
    wanted : Wanted
    grid : int
        Points of the grid of G, either way.
    amount : float, optional
        The integral of |torque| over the interval, where it is known better than from the n positions.
    """

    def __init__(
        self,
        link: LinkMotion,
        at: Floats,
        torque: Floats,
        wanted: Wanted,
        grid: int = GRID,
        amount: float | None = None,
    ) -> None:
        self.link, self.at, self.torque, self.wanted = link, at, torque, wanted
        self.loaded = bool(np.any(torque))
        self.burden = np.abs(torque) if self.loaded else np.ones(at.size)
        self.burden = self.burden / self.burden.max()
        self.scale_of_burden = float(np.abs(torque).max()) if self.loaded else 1.0
        self.sense = 1.0 if at[-1] >= at[0] else -1.0
        span = float(abs(at[-1] - at[0]))
        self.amount = span if not self.loaded else amount or float(np.trapezoid(np.abs(torque), at) * self.sense)
        left, bottom, right, top = wanted.box
        self.grid, self.grounds = grid, _grid_of(wanted.box, grid)
        self.ways = (True, False) if wanted.extends is None else (wanted.extends,)
        self.middle = complex(np.mean(link.origin))
        self.size = max(right - left, top - bottom, wanted.reach)

    @property
    def turns_about_pivot(self) -> bool:
        """Whether the closed form for a link with a fixed pivot applies: its pin may be anywhere within the reach."""
        return self.link.pivot is not None and self.wanted.pin_box is None

    def bound(self, stroke: float) -> float:
        """The peak force that no placement is below: the integral of |torque| over the stroke; without a load that of 1."""
        return self.amount / stroke

    # -- what a placement is ------------------------------------------------------------------------------------------

    def placement(self, ground: complex, pin: complex) -> Placement:
        """What follows from its two ends."""
        length, arm = self.link.leverage(ground, pin)
        with np.errstate(divide="ignore", invalid="ignore"):
            force = self.torque / arm
            worst = float(np.max(self.burden / np.abs(arm))) * self.scale_of_burden
        return Placement(ground, pin, bool(length[-1] > length[0]), length, arm, force, worst)

    # -- the search ---------------------------------------------------------------------------------------------------

    def best(self, actuator: Actuator, work: Work | None = None) -> Placement | Refused:
        """The placement of an actuator with the least peak force, or why there is none."""
        if self.turns_about_pivot:
            return self._about_pivot(actuator)
        return self.descend(self.screened([actuator], DESCENTS, work), Sizes(actuator), work)

    def best_of_sizes(self, sizes: Sizes, work: Work | None = None) -> Placement | Refused:
        """The same where retracted length or stroke may be chosen too."""
        return self.descend(self.begun(sizes, work), sizes, work)

    def begun(self, sizes: Sizes, work: Work | None = None) -> Screened | Refused:
        """Where its descents begin, or why there are none."""
        if self.link.longest_way(self.wanted.reach) <= _HAIR * self.size:  # the link comes back to where it began
            return Refused("stroke", 0.0 if sizes.stroke_free else sizes.begin.stroke)
        return self.screened(self._ladder(sizes), DESCENTS, work)

    def _ladder(self, sizes: Sizes) -> list[Actuator]:
        """Sizes from which descents may begin: rungs that do not move with the box or the dead length, and the shortest."""
        most = self.link.longest_way(self.wanted.reach)
        far = float(np.abs(self.grounds - self.link.origin[0]).max()) + self.wanted.reach
        found = []
        for stroke in (_STROKES * most if sizes.stroke_free else np.array([sizes.begin.stroke])).tolist():
            least = stroke + sizes.dead_length
            if sizes.retracted_free:
                first, last = (int(np.ceil(np.log(length / most) / np.log(_RUNG))) for length in (least, far))
                rungs = [least, *(most * _RUNG ** np.arange(first, last)).tolist()]
            else:
                rungs = [sizes.begin.retracted] * (sizes.begin.retracted >= least)
            found += [Actuator(retracted, stroke) for retracted in rungs]
        return found

    def descend(
        self, begin: Screened | Refused, sizes: Sizes, work: Work | None, closer: bool = True
    ) -> Placement | Refused:
        """The best of the descents from placements of the grid; ``closer``: gone over once more."""
        if isinstance(begin, Refused):
            return begin
        found = self.descended(begin, sizes, work)
        if not found:
            return begin.short or Refused("arm", 0.0)
        return self.closer(found[0], sizes) if closer else found[0]

    def descended(self, begin: Screened, sizes: Sizes, work: Work | None) -> list[Placement]:
        """Where the descents from placements of the grid end, the best first."""
        found, lost = [], []
        columns = (begin.grounds.tolist(), begin.pins.tolist(), begin.ways.tolist())
        for actuator, ground, pin, way in zip(begin.actuators, *columns):
            if work is None or not work.expired():
                here = replace(sizes, begin=Actuator(*actuator.tolist()))
                one = self._descended(here, ground, pin, way)
                if one is None:
                    lost.append((here, ground, pin, way))
                else:
                    found.append(one)
        for here, ground, pin, way in lost[:_LOST]:  # a line search led to where there are no placements
            one = self._descended(here, ground, pin, way, _BEGIN_AGAIN)
            found += [] if one is None else [one]
        if begin.short is None:  # where no descent ended within what is wanted, or none well, the grid's best is
            found.append(self.placement(complex(begin.grounds[0]), complex(begin.pins[0])))
        return sorted(found, key=lambda one: one.worst)

    def closer(self, best: Placement, sizes: Sizes) -> Placement:
        """Descents from the end of one, with the curvature learnt anew: a descent can end early along a narrow ridge."""
        for _ in range(_AGAIN):
            low, high = sorted(best.length[[0, -1]].tolist())
            begin = Actuator(
                low if sizes.retracted_free else sizes.begin.retracted,
                high - low if sizes.stroke_free else sizes.begin.stroke,
            )
            again = self._descended(replace(sizes, begin=begin), best.ground, best.pin, best.extends)
            gain = 0.0 if again is None else 1 - again.worst / best.worst
            if again is not None and gain > 0:
                best = again
            if gain < _GAIN:
                break
        return best

    def screened(
        self, actuators: list[Actuator], most: int = DESCENTS, work: Work | None = None
    ) -> Screened | Refused:
        """The best placements of the grid, at most so many, with at most `BEGINNINGS` of each family, or why there are none.

        Where none is within what is wanted, of closer and closer looks around them. ``work``: once it has expired no more of the
        actuators are looked at than one.
        """
        box = self.wanted.pin_box or self.wanted.box
        points = self.grounds if self.wanted.pin_box is None else _grid_of(box, self.grid)
        found = [
            self._on_grid(points, np.array([one]))
            for k, one in enumerate(actuators)
            if not (k and work is not None and work.expired())
        ]
        looked = [self._chosen(one) for one in found if not isinstance(one, Refused)]
        if not looked:
            refused = [one for one in found if isinstance(one, Refused)]
            return min(refused, key=lambda one: _NEAREST.index(one.reason), default=Refused("stroke", 0.0))
        best = self._chosen(Screened.joined(looked))
        left, bottom, right, top = box
        step = complex(right - left, top - bottom) / max(self.grid - 1, 1)
        for _ in range(_CLOSER):
            if best.worth > 0:
                break
            step /= 2
            centres = best.grounds if self.wanted.pin_box is None else best.pins
            about = centres[:, None] + (_ABOUT.real * step.real + 1j * _ABOUT.imag * step.imag)
            about = np.clip(about.real, left, right) + 1j * np.clip(about.imag, bottom, top)
            closer = self._on_grid(about.ravel(), np.repeat(best.actuators, _ABOUT.size, axis=0))
            if not isinstance(closer, Refused):
                best = self._chosen(Screened.joined([best, closer]))
        best = best.taken(np.arange(min(most, best.value.size)))
        least = float(best.least[0])
        if least <= 0:
            arm = self.arms(best.grounds[:1], best.pins[:1])[0] * (self.sense if best.ways[0] else -self.sense)
            low = int(np.argmin(arm))
            other = low + 1 if low == 0 or (low + 1 < arm.size and arm[low + 1] > 0) else low - 1
            return Refused("dead", float(self.at[low]), (min(low, other), max(low, other)))
        if best.worth > 0:
            return best.taken(np.flatnonzero(best.value > 0))
        # a little below the arm asked for: the descent may still reach it
        short, few = Refused("arm", least), best.taken(np.arange(min(BEGINNINGS, best.value.size)))
        return few._replace(short=short) if least >= _ALMOST * self.wanted.arm else short

    def _on_grid(self, points: Complexes, actuators: Floats) -> Screened | Refused:
        """All placements of actuators (1, 2) or (m, 2) from points (m,) of the grid within the limits, or why there are none.

        The grid is over ground points, or over pins if these have a box.
        """
        grounds, pins, ways, sides, actuators, need = self.families(points, actuators)
        if not grounds.size:
            return Refused("stroke", need)
        near = np.abs(pins) <= self.wanted.reach
        if not near.any():
            return Refused("reach", float(np.abs(pins).min()))
        if self.wanted.pin_box is not None:
            beyond = outside(grounds, self.wanted.box)
            if not (near & (beyond <= 0)).any():
                return Refused("pin_box", float(beyond[near].min()))
            near &= beyond <= 0
        grounds, pins, ways, sides = grounds[near], pins[near], ways[near], sides[near]
        arm = self.arms(grounds, pins) * (self.sense * np.where(ways, 1.0, -1.0))[:, None]
        least = arm.min(axis=1)
        strong = (least > 0) & (least >= self.wanted.arm)
        value = least - self.wanted.arm
        value[strong] = np.min(arm[strong] / np.maximum(self.burden, 1e-300), axis=1)
        return Screened(grounds, pins, ways, sides, actuators[near], least, value)

    def _chosen(self, looked: Screened) -> Screened:
        """The best placements of each family that lie apart from one another, best first."""
        family = 2 * looked.ways.astype(int) + (looked.sides > 0)
        apart = [self._apart(looked.grounds, np.where(family == k, looked.value, -np.inf)) for k in range(4)]
        some = np.concatenate(apart)
        return looked.taken(some[np.argsort(-looked.value[some], kind="stable")])

    def _apart(self, grounds: Complexes, value: Floats) -> Ints:
        """The best placements of a family that lie apart from one another: valleys, not neighbours in one."""
        found, value = [], value.copy()
        for _ in range(BEGINNINGS):
            k = int(np.argmax(value))
            if value[k] == -np.inf:
                break
            found.append(k)
            value[np.abs(grounds - grounds[k]) < _APART * self.size] = -np.inf
        return np.array(found, dtype=np.int64)

    def families(
        self, points: Complexes, actuators: Floats
    ) -> tuple[Complexes, Complexes, Flags, Floats, Floats, float]:
        """Ground points, pins, ways, intersections and actuators of all four families; and by how much the stroke is too long.

        ``actuators``: (m, 2) at points (m,), or (1, 2). From ground points follow pins, or from pins that have a box ground
        points.
        """
        link, has_pins = self.link, self.wanted.pin_box is not None
        if has_pins:
            first, last = (link.origin[k] + link.direction[k] * points for k in (0, -1))
        else:
            first, last = (np.conj(link.direction[k]) * (points - link.origin[k]) for k in (0, -1))
        actuators = np.broadcast_to(actuators, (points.size, 2))
        short, long = actuators[:, 0], actuators[:, 0] + actuators[:, 1]
        between = last - first
        distance = np.abs(between)
        parts: list[tuple[Any, ...]] = []
        with np.errstate(divide="ignore", invalid="ignore"):
            along = between / distance
            for way in self.ways:
                begin, end = (short, long) if way else (long, short)
                foot = ((begin - end) * (begin + end) / distance + distance) / 2
                height = begin**2 - foot**2
                meets = np.flatnonzero(height >= 0)
                root = np.sqrt(height[meets])
                for side in (1.0, -1.0):
                    other = first[meets] + (foot[meets] + 1j * side * root) * along[meets]
                    same = np.full(meets.size, way), np.full(meets.size, side)
                    ends = (other, points[meets]) if has_pins else (points[meets], other)
                    parts.append((*ends, *same, actuators[meets]))
        grounds, pins, ways, sides, sizes = (np.concatenate(column) for column in zip(*parts))
        return grounds, pins, ways, sides, sizes, float((actuators[:, 1] - distance).min())

    def arms(self, grounds: Complexes, pins: Complexes) -> Floats:
        """dL/dphi of m placements at n positions, (m, n): products of matrices."""
        return lengths_and_arms(self.link, self.middle, grounds, pins)[1]

    def _descended(
        self, sizes: Sizes, ground: complex, pin: complex, way: bool, share: float = _BEGIN
    ) -> Placement | None:
        """The nearest optimum, by sequential quadratic programs; None where it leaves what is wanted."""
        one = _Descent(self, sizes, way)
        given = not (sizes.retracted_free and sizes.stroke_free)
        end = one.end(one.start(ground, pin, share), given, 1e-13, 60)
        if not np.isfinite(end).all():
            return None
        end = one.met(end)
        found = self.placement(*one.ends(end))
        return found if found.extends is way and self.keeps(found) and one.fits(end) else None

    def keeps(self, found: Placement, hair: float = _HAIR) -> bool:
        """Whether a placement is within what is wanted, to a hair."""
        room = hair * self.size
        signed = found.arm * self.sense * (1.0 if found.extends else -1.0)
        return bool(
            outside(found.ground, self.wanted.box) <= room
            and abs(found.pin) <= self.wanted.reach + room
            and (self.wanted.pin_box is None or outside(found.pin, self.wanted.pin_box) <= room)
            and np.all(np.isfinite(signed))
            and signed.min() >= self.wanted.arm - room
            and signed.min() > 0
        )

    # -- a link with a pivot ------------------------------------------------------------------------------------------

    def _about_pivot(self, actuator: Actuator) -> Placement | Refused:
        """On a link that turns about a pivot: one unknown, the angle at the pivot at the retracted end."""
        link, wanted = self.link, self.wanted
        assert link.pivot is not None
        turned = np.unwrap(np.angle(link.direction))
        swing = float(np.ptp(turned))
        least = actuator.stroke / (2 * np.sin(min(swing, np.pi) / 2))
        if least > wanted.reach + _HAIR * self.size or swing >= np.pi - 2 * _NEAR_DEAD:
            return Refused("reach", float(least))
        steps = np.diff(turned) * np.sign(turned[-1] - turned[0])
        if steps.min() <= 0:
            k = int(np.argmin(steps))
            return Refused("dead", float(self.at[k]), (k, k + 1))
        ways = [_Pivoted(self, actuator, np.abs(turned - turned[0 if way else -1]), way) for way in self.ways]
        answers = [one.best() for one in ways]
        found = [(worst, one, alpha) for one, (worst, alpha) in zip(ways, answers) if np.isfinite(worst)]
        if not found:
            return min((one.refusal() for one in ways), key=lambda one: one.reason)
        _, one, alpha = min(found, key=lambda row: row[0])
        ground, pin = one.ends(alpha)
        return self.placement(ground, pin)


@dataclass(frozen=True)
class Row:
    """One of a catalogue: an actuator, what it pushes and pulls at most, and perhaps its price."""

    name: str
    actuator: Actuator
    push: float = np.inf
    pull: float = np.inf
    price: float | None = None

    def bears(self, found: Placement, times: float = 1.0) -> bool:
        """Whether a placement asks no more of it than it can, or so many times as much."""
        return bool(found.force.max() <= times * self.push and -found.force.min() <= times * self.pull)


class Bought(NamedTuple):
    """A row of a catalogue at its best place."""

    row: Row
    placement: Placement


class Unfit(NamedTuple):
    """Why a row does not do: its best place, which asks too much of it, or why it has none."""

    row: Row
    why: Refused | float
    """A reason, or the least peak force."""


def best_of_rows(
    question: Question, rows: list[Row], most: int, work: Work | None = None
) -> tuple[list[Bought], list[Unfit]]:
    """The rows of a catalogue that do, at most so many, the cheapest first, and why others do not.

    Without prices the weakest first; of equal ones that with the least peak force on the grid. A row whose force is below its
    bound is not searched for, and once ``most`` are found dearer rows are not looked at.
    """
    found: list[Bought] = []
    unfit: list[Unfit] = []
    priced = any(row.price is not None for row in rows)

    def cost(row: Row) -> tuple[float, float]:
        return (np.inf if row.price is None else row.price) if priced else 0.0, max(row.push, row.pull)

    # rows of other forces have the same sizes
    @cache
    def begun(actuator: Actuator) -> Screened | Refused | None:
        return None if question.turns_about_pivot else question.screened([actuator], _ROW_DESCENTS)

    @cache
    def placed(actuator: Actuator) -> Placement | Refused:
        begin = begun(actuator)
        return question.best(actuator) if begin is None else question.descend(begin, Sizes(actuator), work, False)

    @cache
    def gone_over(actuator: Actuator) -> Placement | Refused:
        one = placed(actuator)
        return one if isinstance(one, Refused) else question.closer(one, Sizes(actuator))

    for worth in sorted({cost(row) for row in rows}):
        if len(found) >= most or (work is not None and work.expired()):
            break
        tries: list[tuple[float, Row, Screened | None]] = []
        for row in (row for row in rows if cost(row) == worth):
            if question.loaded and question.bound(row.actuator.stroke) > max(row.push, row.pull):
                unfit.append(Unfit(row, question.bound(row.actuator.stroke)))
                continue
            begin = begun(row.actuator)
            if isinstance(begin, Refused):
                unfit.append(Unfit(row, begin))
            else:
                tries.append((-row.actuator.stroke if begin is None else -begin.worth, row, begin))
        tries.sort(key=lambda one: one[0])
        here: list[Bought] = []
        for _, row, begin in tries:
            if len(found) + len(here) >= most or (work is not None and work.expired()):
                break
            one = placed(row.actuator)
            if begin is not None and isinstance(one, Placement) and (not question.loaded or row.bears(one, _NEARLY)):
                one = gone_over(row.actuator)
            if isinstance(one, Refused):
                unfit.append(Unfit(row, one))
            elif question.loaded and not row.bears(one):
                unfit.append(Unfit(row, one.peak))
            else:
                here.append(Bought(row, one))
        found += sorted(here, key=lambda one: one.placement.worst)
    return found, unfit


class Screened(NamedTuple):
    """Placements from which descents begin, the best first."""

    grounds: Complexes
    pins: Complexes
    ways: Flags
    sides: Floats
    actuators: Floats
    """(m, 2)"""
    least: Floats
    """Of the arms."""
    value: Floats
    """Least of arm over burden; below 0 by how much an arm is less than asked for."""
    short: Refused | None = None
    """Where the arms are all a little below what is asked for."""

    @property
    def worth(self) -> float:
        """Of the best."""
        return float(self.value[0])

    def taken(self, some: Ints) -> Screened:
        """Some of them."""
        columns: list[Any] = [column[some] for column in list(self)[:7]]  # type: ignore[index]
        return Screened(*columns)

    @classmethod
    def joined(cls, parts: list[Screened]) -> Screened:
        """All of several."""
        columns: list[Any] = [np.concatenate(column) for column in list(zip(*parts))[:7]]
        return cls(*columns)


def lengths_and_arms(link: LinkMotion, middle: complex, grounds: Complexes, pins: Complexes) -> tuple[Floats, Floats]:
    """L and dL/dphi of m placements at n positions, (m, n): products of matrices.

    L^2 and L dL/dphi, which is the real part of ``conj(v) Q'`` with v = X + R q - G and Q' = X' + i w R q, are multiplied out to
    coefficients (8, n) of 1, G, q, conj(G) q and |G|^2 + |q|^2; G from the middle.
    """
    x, r, speed, rate = link.origin - middle, link.direction, link.velocity, link.rate
    zero = np.zeros(x.size)

    def coefficients(one: Floats, ground: Complexes, pin: Complexes, both: Complexes, squares: Floats) -> Floats:
        return np.array([one, ground.real, ground.imag, pin.real, -pin.imag, both.real, -both.imag, squares])

    of_pin = np.conj(speed) * r + 1j * rate * np.conj(x) * r
    slope = coefficients(dot(x, speed), -speed, of_pin, -1j * rate * r, zero)
    square = coefficients(np.abs(x) ** 2, -2 * x, 2 * np.conj(x) * r, -2 * r, zero + 1)
    g = grounds - middle
    both, squares = np.conj(g) * pins, np.abs(g) ** 2 + np.abs(pins) ** 2
    basis = np.stack([np.ones(g.size), g.real, g.imag, pins.real, pins.imag, both.real, both.imag, squares], axis=1)
    # the expanded square can round below 0 only where there is as good as no length
    length = np.sqrt(np.maximum(basis @ square, 1e-300))
    return length, (basis @ slope) / length


def slopes_of_leverage(
    link: LinkMotion, along: Complexes, length: Floats, speed: Complexes, size: float
) -> tuple[Floats, Floats]:
    """Derivatives (n, 4) of L and dL/dphi by G and q over a size; ``along`` (n,): direction from G to the pin."""
    turned = link.direction[:, None] * np.array([0, 0, 1, 1j]) * size
    dv = turned - np.array([1, 1j, 0, 0]) * size
    back = np.conj(along)[:, None]
    lengths = np.real(back * dv)
    dn = (dv - along[:, None] * lengths) / length[:, None]
    return lengths, np.real(np.conj(dn) * speed[:, None]) + np.real(back * 1j * link.rate[:, None] * turned)


def _grid_of(box: Box, count: int) -> Complexes:
    """Return the points of a grid over a box, ``count`` in each direction."""
    left, bottom, right, top = box
    x, y = np.meshgrid(np.linspace(left, right, count), np.linspace(bottom, top, count))
    return np.asarray((x + 1j * y).ravel())


@cache
def _threads() -> ThreadpoolController:
    return ThreadpoolController()  # made once scipy has loaded its own BLAS, which it then knows


def descended(
    cost: Callable[[Floats], tuple[float, Floats]],
    begin: Floats,
    bounds: Sequence[tuple[float | None, float | None]],
    limits: Sequence[Mapping[str, Any]],
    ftol: float,
    steps: int,
) -> Floats:
    """Where sequential quadratic programs end, of a cost with its slopes.

    By one thread: products of matrices that several share round differently from run to run.
    """
    from scipy.optimize import minimize

    with _threads().limit(limits=1, user_api="blas"):
        answer: Any = minimize(
            cost,
            begin,
            jac=True,
            bounds=bounds,
            constraints=limits,
            method="SLSQP",
            options={"ftol": ftol, "maxiter": steps},
        )
    return np.asarray(answer.x)


class Descent:
    """The largest u for which `rows` of the unknowns are at least 0 and `off` is 0, by sequential quadratic programs.

    Unknowns: two points over the ``size``, and u. ``slopes`` and ``off_slopes`` are the exact derivatives; what all of them take
    from the points is worked out once, by ``_looked``.
    """

    size: float
    bounds: list[tuple[float, float]]
    rows: Callable[[Floats], Floats]
    slopes: Callable[[Floats], Floats]
    off: Callable[[Floats], Floats]
    off_slopes: Callable[[Floats], Floats]
    _looked: Callable[[complex, complex], Any]
    _seen: tuple[bytes, Any] = b"", None

    def ends(self, z: Floats) -> tuple[complex, complex]:
        """Both points: ground point or motor, and pin."""
        return complex(z[0], z[1]) * self.size, complex(z[2], z[3]) * self.size

    def unknowns(self, one: complex, pin: complex) -> Floats:
        """With u 0."""
        return np.array([one.real, one.imag, pin.real, pin.imag, 0.0]) / self.size

    def end(self, begin: Floats, equations: bool, ftol: float, steps: int) -> Floats:
        """Where a descent from some unknowns ends; ``equations``: whether `off` counts."""
        upwards = np.array([0.0, 0.0, 0.0, 0.0, -1.0])
        limits = [{"type": "ineq", "fun": self.rows, "jac": self.slopes}]
        limits += [{"type": "eq", "fun": self.off, "jac": self.off_slopes}] * equations
        return descended(lambda z: (-z[-1], upwards), begin, self.bounds, limits, ftol, steps)

    def _at(self, z: Floats) -> Any:
        key = z[:4].tobytes()
        if self._seen[0] != key:
            self._seen = key, self._looked(*self.ends(z))
        return self._seen[1]


class _Descent(Descent):
    """Rows and exact derivatives of ``arm >= u burden``, arm, reach and sizes, one way, of G and q.

    Lengths that are given are equations: nothing is singular where the circles about
    both ends of q's way just touch, which is where many optima lie.
    """

    def __init__(self, question: Question, sizes: Sizes, way: bool) -> None:
        self.q, self.sizes = question, sizes
        self.sign = question.sense * (1.0 if way else -1.0)
        self.short, self.long = (0, -1) if way else (-1, 0)
        self.free = sizes.retracted_free or sizes.stroke_free
        self.size = question.size
        left, bottom, right, top = np.array(question.wanted.box) / self.size
        reach = question.wanted.reach / self.size
        low_x, low_y, high_x, high_y = -reach, -reach, reach, reach
        if question.wanted.pin_box is not None:
            low_x, low_y, high_x, high_y = np.array(question.wanted.pin_box) / self.size
        self.bounds = [(left, right), (bottom, top), (low_x, high_x), (low_y, high_y), (0.0, 1e6)]
        # u is told in what a placement at the bound would have, so that all unknowns are of order one
        whole = float(np.trapezoid(question.burden, question.at) * question.sense)
        self.unit = sizes.begin.stroke / max(whole, 1e-300)

    def start(self, ground: complex, pin: complex, share: float) -> Floats:
        z = self.unknowns(ground, pin)
        arm = self._at(z).arm
        z[-1] = share * np.min(arm / np.maximum(self.q.burden, 1e-300))
        return z

    def rows(self, z: Floats) -> Floats:
        """At least 0."""
        q, seen = self.q, self._at(z)
        n, short, long = q.at.size, seen.length[self.short], seen.length[self.long]
        rows = np.empty(2 * n + 1 + self.free)
        rows[:n] = seen.arm - z[-1] * q.burden
        rows[n : 2 * n] = seen.arm - q.wanted.arm / self.unit
        reach = q.wanted.reach
        rows[2 * n] = (1 - abs(seen.pin) / reach) * (1 + abs(seen.pin) / reach)
        if self.free:
            rows[-1] = (2 * short - long - self.sizes.dead_length) / self.size
        return rows

    def slopes(self, z: Floats) -> Floats:
        q, seen = self.q, self._at(z)
        n, (lengths, arms) = q.at.size, seen.slopes
        slopes = np.zeros((2 * n + 1 + self.free, 5))
        slopes[:n, :4], slopes[:n, 4] = arms, -q.burden
        slopes[n : 2 * n, :4] = arms
        slopes[2 * n, 2:4] = np.array([seen.pin.real, seen.pin.imag]) * (-2 * self.size / q.wanted.reach**2)
        if self.free:
            slopes[-1, :4] = 2 * lengths[self.short] - lengths[self.long]
        return slopes

    def off(self, z: Floats) -> Floats:
        """0 where an actuator has the lengths that are given."""
        short, long = (self._at(z).length[k] for k in (self.short, self.long))
        given = [] if self.sizes.retracted_free else [short - self.sizes.begin.retracted]
        given += [] if self.sizes.stroke_free else [long - short - self.sizes.begin.stroke]
        return np.array(given) / self.size

    def off_slopes(self, z: Floats) -> Floats:
        lengths, _ = self._at(z).slopes
        short, long = lengths[self.short], lengths[self.long]
        slopes = np.zeros((2, 5))
        slopes[0, :4], slopes[1, :4] = short, long - short
        return slopes[[not self.sizes.retracted_free, not self.sizes.stroke_free]]

    def met(self, z: Floats) -> Floats:
        """The nearest unknowns with the lengths that are given, to rounding."""
        for _ in range(_NEWTON):
            off = self.off(z)
            if off.size:
                z = z - np.linalg.pinv(self.off_slopes(z)) @ off
        return z

    def fits(self, z: Floats) -> bool:
        """Whether it has the lengths that are given, and no less dead length, to a hair."""
        return bool(np.abs(self.off(z)).max(initial=0.0) <= _HAIR and (not self.free or self.rows(z)[-1] >= -_HAIR))

    def _looked(self, ground: complex, pin: complex) -> _Leverage:
        v, speed = self.q.link.place(pin) - ground, self.q.link.speed(pin)
        length = np.maximum(np.abs(v), 1e-300)
        along = v / length
        return _Leverage(self, pin, length, along, speed, dot(along, speed) * (self.sign / self.unit))


@dataclass(frozen=True)
class _Leverage:
    """Lengths and arms of a placement; a line search asks for no slopes."""

    descent: _Descent
    pin: complex
    length: Floats
    along: Complexes
    speed: Complexes
    arm: Floats
    """Over the unit."""

    @cached_property
    def slopes(self) -> tuple[Floats, Floats]:
        """Derivatives (n, 4) by G and q, of lengths over the size and of arms."""
        one = self.descent
        lengths, arms = slopes_of_leverage(one.q.link, self.along, self.length, self.speed, 1.0)
        return lengths, arms * (one.size * one.sign / one.unit)


class _Pivoted:
    """All placements on a link that turns about a pivot, for one way: a curve in alpha, the angle at the retracted end."""

    def __init__(self, question: Question, actuator: Actuator, turned: Floats, way: bool) -> None:
        self.q, self.way, self.turned = question, way, turned
        self.room = 0.0  # beyond the reach, where nothing is within it
        self.low, self.high = actuator.retracted, actuator.retracted + actuator.stroke
        self.swing = float(turned.max())
        self.rate = np.abs(question.link.rate)
        self.alphas = np.linspace(_NEAR_DEAD, np.pi - self.swing - _NEAR_DEAD, _ANGLES)
        left, bottom, right, top = question.wanted.box
        pivot = question.link.pivot
        assert pivot is not None
        across = max(left - pivot.real, 0.0, pivot.real - right), max(bottom - pivot.imag, 0.0, pivot.imag - top)
        self.nearest = float(np.hypot(*across))
        corners = np.array([complex(x, y) for x in (left, right) for y in (bottom, top)])
        self.farthest = float(np.abs(corners - pivot).max())

    def sizes(self, alpha: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """S, T, and the longer and the shorter of the two distances from the pivot; NaN where there are none."""
        half = self.swing / 2
        # cos(a) - cos(a + swing) as a product
        fall = 2 * np.sin(alpha + half) * np.sin(half)
        t = (self.high - self.low) * (self.high + self.low) / fall
        # S - T = L0^2 - T (1 - cos alpha), and S + T likewise, without the difference of S and T
        less = self.low**2 - 2 * t * np.sin(alpha / 2) ** 2
        more = self.low**2 + 2 * t * np.cos(alpha / 2) ** 2
        with np.errstate(invalid="ignore"):
            sum_, difference = np.sqrt(more), np.sqrt(less)
        return self.low**2 + t * np.cos(alpha), t, (sum_ + difference) / 2, (sum_ - difference) / 2

    def arms(self, alpha: Floats) -> Floats:
        """Amounts of the moment arms per radian of the drive, (alphas, n)."""
        s, t, _, _ = self.sizes(alpha)
        # sine and cosine of the sums, as products: many angles at many positions
        here, there = np.exp(1j * alpha), np.exp(1j * self.turned)
        sine = np.outer(here.imag, there.real) + np.outer(here.real, there.imag)
        cosine = np.outer(here.real, there.real) - np.outer(here.imag, there.imag)
        with np.errstate(invalid="ignore"):
            length = np.sqrt(s[:, None] - t[:, None] * cosine)
            return np.asarray(t[:, None] / 2 * sine / length * self.rate)

    def worst(self, alpha: Floats) -> tuple[Floats, Flags, Flags, Floats]:
        """Largest burden over arm; whether reach and box, and the arm, are kept; the least arm."""
        arm = self.arms(alpha)
        _, _, longer, shorter = self.sizes(alpha)
        placed = self._placed(longer, shorter) | self._placed(shorter, longer)
        least = arm.min(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            value = np.max(self.q.burden / arm, axis=1)
        return value, placed & np.isfinite(value), least >= self.q.wanted.arm, least

    def _placed(self, ground: Floats, pin: Floats) -> Flags:
        with np.errstate(invalid="ignore"):
            kept: Flags = (
                (pin <= self.q.wanted.reach + self.room) & (ground >= self.nearest) & (ground <= self.farthest)
            )
        return kept

    def best(self) -> tuple[float, float]:
        """The least worst and its alpha; infinite where there is none."""
        alphas = self.alphas
        value, placed, strong, _ = self.worst(alphas)
        good = placed & strong
        if not good.any():
            self.room = _HAIR * self.q.size
            alphas = self._between()
            value, placed, strong, _ = self.worst(alphas)
            good = placed & strong
        if not good.any():
            return np.inf, 0.0

        def cost(alpha: NDArray[np.floating]) -> Floats:
            value, placed, strong, _ = self.worst(np.asarray(alpha.ravel(), dtype=float))
            return np.where(placed & strong, value, np.inf).reshape(alpha.shape)

        # with a node in the middle of each look it is never worse than the one before, also where what is wanted ends
        k = int(np.argmin(np.where(good, value, np.inf)))
        low, high = alphas[[max(k - 1, 0)]], alphas[[min(k + 1, alphas.size - 1)]]
        least, alpha = closer_looks(cost, low, high, _LOOKS)
        return float(least[0]), float(alpha[0])

    def _between(self) -> Floats:
        """Where reach, box and arm are kept best between the values that are looked at, each between its two neighbours."""

        def lacks(alpha: NDArray[np.floating]) -> Floats:
            flat = np.asarray(alpha.ravel(), dtype=float)
            _, _, longer, shorter = self.sizes(flat)
            least = self.arms(flat).min(axis=1)
            ways = [
                np.maximum.reduce([pin - self.q.wanted.reach, self.nearest - ground, ground - self.farthest])
                for ground, pin in ((longer, shorter), (shorter, longer))
            ]
            found = np.maximum(np.minimum(*ways), self.q.wanted.arm - least)
            return np.where(np.isfinite(found), found, np.inf).reshape(alpha.shape)

        there = np.concatenate([[np.inf], lacks(self.alphas), [np.inf]])
        k = np.flatnonzero((there[1:-1] <= there[:-2]) & (there[1:-1] <= there[2:]) & np.isfinite(there[1:-1]))
        step = self.alphas[1] - self.alphas[0]
        middle = closer_looks(lacks, self.alphas[k] - step, self.alphas[k] + step, _LOOKS)[1]
        return np.column_stack([middle - step, middle, middle + step]).ravel()

    def ends(self, alpha: float) -> tuple[complex, complex]:
        """Ground point and pin, turned about the pivot so that the ground point lies in its box."""
        q, link = self.q, self.q.link
        assert link.pivot is not None
        _, _, longer, shorter = (float(value[0]) for value in self.sizes(np.array([alpha])))
        first = (longer, shorter) if self._placed(np.array(longer), np.array(shorter)) else (shorter, longer)
        ground, pin = first
        rising = np.sign(link.swing())
        angles = np.linspace(0.0, 2 * np.pi, _AROUND, endpoint=False)
        direction = within_box(link.pivot, ground, q.wanted.box, angles)
        # from the ground's direction to the pin's: alpha at the retracted end, growing with the link's turn as it extends
        turn = rising * (alpha if self.way else -(alpha + self.swing))
        at_first = link.pivot + pin * np.exp(1j * (direction + turn))
        return complex(link.pivot + ground * np.exp(1j * direction)), link.point_at(complex(at_first))

    def refusal(self) -> Refused:
        """What binds where nothing is kept."""
        value, placed, _, least = self.worst(self.alphas)
        exists = np.isfinite(value)
        if not exists.any():
            return Refused("stroke", float(self.high - self.low))
        if not placed.any():
            _, _, longer, shorter = self.sizes(self.alphas)
            if np.nanmin(shorter) > self.q.wanted.reach:
                return Refused("reach", float(np.nanmin(shorter)))
            return Refused("box", float(self.nearest if np.nanmax(longer) < self.nearest else np.nanmin(longer)))
        return Refused("arm", float(np.max(np.where(placed, least, -np.inf))))


def within_box(pivot: complex, radius: float, box: Box, angles: Floats) -> float:
    """A direction in which a circle about a pivot lies in a box: the middle of its longest arc there."""
    left, bottom, right, top = box
    inside = outside(pivot + radius * np.exp(1j * angles), box) <= 0
    if inside.all():
        return 0.0
    if not inside.any():  # between two of them, along an arc that short; or it touches the box only
        near = complex(min(max(pivot.real, left), right), min(max(pivot.imag, bottom), top))
        corners = [complex(x, y) for x in (left, right) for y in (bottom, top)]
        lines = [(0.0, left - pivot.real), (0.0, right - pivot.real)]
        lines += [(np.pi / 2, bottom - pivot.imag), (np.pi / 2, top - pivot.imag)]
        met = [np.angle(place - pivot) for place in (near, *corners)]
        met += [
            about + way * np.arccos(away / radius) for about, away in lines if abs(away) <= radius for way in (1, -1)
        ]
        ends = np.sort(np.mod(met, 2 * np.pi))
        ends = np.append(ends, ends[0] + 2 * np.pi)
        tried = np.concatenate([(ends[1:] + ends[:-1]) / 2, ends])
        return float(tried[np.argmin(np.maximum(outside(pivot + radius * np.exp(1j * tried), box), 0.0))])
    begin = int(np.argmin(inside))
    ends = np.flatnonzero(np.diff(np.roll(inside, -begin), append=False))
    first, last = ends[::2] + 1, ends[1::2]
    k = int(np.argmax(last - first))
    return float((angles[1] - angles[0]) * (begin + (first[k] + last[k]) / 2))


# -- a knee -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Knee:
    """A strut of two links in its place, at the n positions of the way."""

    placement: Placement
    handle: float
    """Length of the link at O."""
    strut: float
    """Length of the link at the pin."""
    knee: Complexes
    """Where both meet, (n,); at the locked end beyond the line."""
    overshoot: float
    """By how much the drive's parameter goes beyond its end while the knee passes the line, to first order."""
    handle_torque: Floats
    """What a handle on the link at O must give, (n,), counter-clockwise; at the locked end what the stop bears."""
    holds: bool
    """Whether the load presses it onto its stop."""


def locked(
    link: LinkMotion,
    at: Floats,
    torque: Floats,
    wanted: Wanted,
    last: bool,
    over_centre: float,
    share: float,
    work: Work,
) -> Knee | Refused:
    """The knee with the least force along it that locks the last position, or the first, and whose handle does not turn back."""
    question = Question(link, at, torque, wanted._replace(extends=last))
    sizes = Sizes(Actuator(question.size, question.size), True, True)
    begin = question.begun(sizes, work)
    if isinstance(begin, Refused):
        return begin
    knees = (
        _bent(question, question.closer(one, sizes), over_centre, share)
        for one in question.descended(begin, sizes, work)
    )
    first = next(knees, None)
    if first is None:
        return begin.short or Refused("arm", 0.0)
    return first if isinstance(first, Knee) else next((one for one in knees if isinstance(one, Knee)), first)


def _bent(question: Question, found: Placement, over_centre: float, share: float) -> Knee | Refused:
    """A placement as a knee, bent to the better side, or refused where its handle turns back on both."""
    link, at, torque, end = question.link, question.at, question.torque, -1 if found.extends else 0
    length = found.length
    whole = float(length[end] / np.sqrt(1 - 4 * share * (1 - share) * np.sin(over_centre / 2) ** 2))
    handle, strut = share * whole, (1 - share) * whole
    pin, speed = link.place(found.pin), link.speed(found.pin)
    angle = angle_at(handle, strut, length)
    angle[end] = -angle[end]
    bends = []
    for side in (1, -1):
        knee = found.ground + handle * (pin - found.ground) / length * np.exp(1j * side * angle)
        rod = (pin - knee) / strut
        arm = np.real(np.conj(rod) * speed)
        with np.errstate(divide="ignore", invalid="ignore"):
            turned = torque / arm * np.real(np.conj(rod) * 1j * (knee - found.ground))
        # where the strut has no arm the handle turns back: of the sides without such a place that of the least torque
        back, most = arm * arm[end] <= 0, float(np.abs(turned).max())
        bends.append(((bool(back.any()), most, -float(np.abs(arm).min()), side), knee, turned, back))
    rank, knee, turned, back = min(bends, key=lambda bend: bend[0])
    if rank[0]:
        return Refused("knee", float(at[np.argmax(back)]))
    return Knee(
        found,
        handle,
        strut,
        knee,
        float((whole - length[end]) / abs(found.arm[end])),
        turned,
        bool(found.force[end] > 0),
    )
