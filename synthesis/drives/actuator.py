"""Where a linear actuator goes: the ends on ground and link that need the least force, or why there are none.

An actuator of retracted length L0 and stroke s between a point G and a pin q of a moving link has the length
``L = |X + R q - G|`` and, per radian of the drive, the moment arm dL/dphi; its force is the drive's torque over its arm. It
uses its whole stroke: its length is L0 at one end of the interval and L0 + s at the other. No placement has a smaller peak
force than the integral of the torque's amount over s, nor a larger least arm than s over the interval.

On a link that turns about a pivot, with alpha the angle there between G and pin, ``L^2 = S - T cos alpha``: S and T follow from
alpha at the first position, and one unknown is left. On any other link q follows from G: it lies on two circles, one for each
end of the motion, in the link's frame. So the search is over G, a plane, in four families: extending or retracting, and two
intersections. A grid that is a product of matrices finds where to begin; a descent on the largest u with ``arm >= u |torque|``
at every position ends at the optimum.

A knee locks a linkage at one end of its way. Its strut of two links u + v between G and q is placed like an actuator; it is
straight just before that end and there, on a stop, bent the other way by the over-centre angle delta, with the length
``(u + v) sqrt(1 - 4 k (1 - k) sin^2(delta / 2))``, k = u / (u + v). A load that pushes the strut together then presses it onto
the stop. The linkage goes beyond its end by a little while the knee passes the line.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Complexes, Flags, Floats, Ints, angle_at
from synthesis.guided.linkage import LinkMotion
from synthesis.mechanism import Box
from synthesis.one_variable import closer_looks
from synthesis.work import Work

GRID = 60
"""Points of the grid of G, either way."""
BEGINNINGS = 3
"""Placements of each family from which a descent may begin."""
_APART = 0.06
"""Of the box or the reach: distance of such placements from one another."""
_AGAIN, _GAIN = 6, 1e-8
"""Descents from the best end of all, at most, and the part that each must gain for another."""
DESCENTS = 8
"""Descents for one actuator."""
_ROW_DESCENTS = 3
"""Descents for a row of a catalogue."""
_NEARLY = 1.1
"""Times its force that a row may lack before its place is gone over once more."""
ROW_GRID = 30
"""Points of the grid of G, either way, for a catalogue: its rows take more from one another than from a finer grid."""
_STROKES = np.array([0.12, 0.25, 0.4, 0.55, 0.7, 0.85, 0.97])
"""Of the longest way of a pin, where the stroke is free."""
_RETRACTED = np.array([1.0, 1.5, 2.2])
"""Of the least retracted length, where it is free."""
_SIZES = 4
"""Of these sizes, from how many a descent begins."""
_NEAREST = ("arm", "dead", "reach", "stroke", "box")
"""Reasons, the one first that is nearest to a placement."""
_ANGLES = 2001
"""Values of alpha that are looked at on a link with a pivot."""
_NEAR_DEAD = 1e-3
"""Angles this near to 0 and to pi lose too many digits."""
_BEGIN, _BEGIN_AGAIN, _LOST = 0.999, 0.9, 1
"""Of the least arm over burden where a descent begins, and where it begins once more; so many that led to no placement do."""
_LOOKS = (33,) * 8
"""Nodes of closer looks between them."""
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
    moment arm, per radian of the drive. ``extends``: which way it goes, where that matters.
    """

    box: Box
    reach: float
    arm: float
    extends: bool | None = None


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

    @property
    def least_arm(self) -> float:
        """The smallest moment arm."""
        return float(np.min(np.abs(self.arm)))


class Refused(NamedTuple):
    """Why an actuator finds no place: what binds, with its numbers."""

    reason: str
    """``stroke``, ``reach``, ``box``, ``dead`` or ``arm``."""
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
        x, y = np.meshgrid(np.linspace(left, right, grid), np.linspace(bottom, top, grid))
        self.grounds = (x + 1j * y).ravel()
        self.ways = (True, False) if wanted.extends is None else (wanted.extends,)
        self.middle = complex(np.mean(link.origin))
        self.size = max(right - left, top - bottom, wanted.reach)
        turned = np.conj(link.direction)
        self.first, self.last = (turned[k] * (self.grounds - link.origin[k]) for k in (0, -1))
        self._matrices = forms_of(link, self.middle)

    def bound(self, stroke: float) -> float:
        """The peak force that no placement is below: the integral of |torque| over the stroke; without a load that of 1."""
        return self.amount / stroke

    # -- what a placement is ------------------------------------------------------------------------------------------

    def placement(self, ground: complex, pin: complex) -> Placement:
        """What follows from its two ends."""
        v = self.link.place(pin) - ground
        length = np.abs(v)
        arm = np.real(np.conj(v) * self.link.speed(pin)) / length
        with np.errstate(divide="ignore", invalid="ignore"):
            force = self.torque / arm
            worst = float(np.max(self.burden / np.abs(arm))) * self.scale_of_burden
        return Placement(ground, pin, bool(length[-1] > length[0]), length, arm, force, worst)

    # -- the search ---------------------------------------------------------------------------------------------------

    def best(self, actuator: Actuator, work: Work | None = None, descents: int = DESCENTS) -> Placement | Refused:
        """The placement of an actuator with the least peak force, or why there is none."""
        if self.link.pivot is not None:
            return self._about_pivot(actuator)
        begin = self.screened(actuator, descents)
        return begin.refused or self.descend(begin, Sizes(actuator), work)

    def best_of_sizes(self, sizes: Sizes, work: Work | None = None) -> Placement | Refused:
        """The same where retracted length or stroke may be chosen too."""
        link = self.link
        turned = abs(link.direction[-1] - link.direction[0])
        most = abs(link.origin[-1] - link.origin[0]) + self.wanted.reach * turned
        first = sizes.begin
        strokes = _STROKES * most if sizes.stroke_free else np.array([first.stroke])
        tries: list[tuple[float, Screened, Actuator]] = []
        refused: list[Refused] = []
        for stroke in strokes.tolist():
            least = stroke + sizes.dead_length
            for retracted in least * _RETRACTED if sizes.retracted_free else (first.retracted,):
                one = Actuator(float(retracted), stroke)
                if one.retracted < least:
                    continue
                found = self.screened(one, 2)
                if found.refused is None:
                    tries.append((found.worth, found, one))
                else:
                    refused.append(found.refused)
        if not tries:
            return min(refused, key=lambda one: _NEAREST.index(one.reason), default=Refused("stroke", most))
        tries.sort(key=lambda row: -row[0])
        answers = [self.descend(begin, replace(sizes, begin=one), work) for _, begin, one in tries[:_SIZES]]
        placed = [one for one in answers if isinstance(one, Placement)]
        return min(placed, key=lambda one: one.worst) if placed else answers[0]

    def descend(self, begin: Screened, sizes: Sizes, work: Work | None, closer: bool = True) -> Placement | Refused:
        """The best of the descents from placements of the grid; ``closer``: gone over once more."""
        found, lost = [], []
        for ground, way, side in zip(begin.grounds.tolist(), begin.ways.tolist(), begin.sides.tolist()):
            if work is None or not work.expired():
                one = self._descended(sizes, ground, way, side)
                if one is None:
                    lost.append((ground, way, side))
                else:
                    found.append(one)
        for ground, way, side in lost[:_LOST]:  # a line search led to where there are no placements
            one = self._descended(sizes, ground, way, side, _BEGIN_AGAIN)
            found += [] if one is None else [one]
        if not found and begin.short is None:  # no descent ended within what is wanted: the grid's best is
            return self.placement(complex(begin.grounds[0]), complex(begin.pins[0]))
        if not found:
            return begin.short or Refused("arm", 0.0)
        best = min(found, key=lambda one: one.worst)
        return self.closer(best, sizes) if closer else best

    def closer(self, best: Placement, sizes: Sizes) -> Placement:
        """Descents from the end of one: with the curvature learnt anew, and where that gains nothing with the other intersection.

        A descent can end early along a narrow ridge, and does where the two circles just touch: both intersections become one.
        """
        first, last = (np.conj(self.link.direction[k]) * (best.ground - self.link.origin[k]) for k in (0, -1))
        side = 1.0 if np.imag((best.pin - first) * np.conj(last - first)) >= 0 else -1.0
        turned = False
        for _ in range(_AGAIN):
            low, high = sorted(best.length[[0, -1]].tolist())
            again = self._descended(replace(sizes, begin=Actuator(low, high - low)), best.ground, best.extends, side)
            gain = -1.0 if again is None else 1 - again.worst / best.worst
            if again is not None and gain > 0:
                best = again
            if gain < _GAIN:
                if turned:
                    break
                side, turned = -side, True
        return best

    def screened(self, actuator: Actuator, most: int = DESCENTS) -> Screened:
        """The best placements of the grid, at most so many, with at most `BEGINNINGS` of each family."""
        grounds, pins, ways, sides, need = self.families(actuator)
        refused = Refused("stroke", need)
        if not grounds.size:
            return Screened.none(refused)
        near = np.abs(pins) <= self.wanted.reach
        if not near.any():
            return Screened.none(Refused("reach", float(np.abs(pins).min())))
        grounds, pins, ways, sides = grounds[near], pins[near], ways[near], sides[near]
        arm = self.arms(grounds, pins) * (self.sense * np.where(ways, 1.0, -1.0))[:, None]
        least = arm.min(axis=1)
        good = least > 0
        if not good.any():
            k = int(np.argmax(least))
            low = int(np.argmin(arm[k]))
            other = low + 1 if low == 0 or (low + 1 < arm.shape[1] and arm[k, low + 1] > 0) else low - 1
            pair = (min(low, other), max(low, other))
            return Screened.none(Refused("dead", float(self.at[low]), pair))
        strong = good & (least >= self.wanted.arm)
        shortfall = not strong.any()
        # a little below the arm asked for: the descent may still reach it from between the grid's points
        keep = np.flatnonzero(good & (least >= 0.7 * self.wanted.arm)) if shortfall else np.flatnonzero(strong)
        if not keep.size:
            return Screened.none(Refused("arm", float(least.max())))
        worth = np.min(arm[keep] / np.maximum(self.burden, 1e-300), axis=1)
        value = np.full(least.size, -np.inf)
        value[keep] = worth
        family = 2 * ways.astype(int) + (sides > 0)
        some = np.concatenate([self._apart(grounds, np.where(family == k, value, -np.inf)) for k in range(4)])
        some = some[np.argsort(-value[some], kind="stable")][:most]
        reason = Refused("arm", float(least.max())) if shortfall else None
        return Screened(grounds[some], pins[some], ways[some], sides[some], None, reason, float(value[some[0]]))

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

    def families(self, actuator: Actuator) -> tuple[Complexes, Complexes, Flags, Floats, float]:
        """Ground points, pins, ways and intersections of all four families; and by how much the stroke is too long, if it is."""
        short, long = actuator.retracted, actuator.retracted + actuator.stroke
        between = self.last - self.first
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
                    pin = self.first[meets] + (foot[meets] + 1j * side * root) * along[meets]
                    parts.append((self.grounds[meets], pin, np.full(meets.size, way), np.full(meets.size, side)))
        grounds, pins, ways, sides = (np.concatenate(column) for column in zip(*parts))
        return grounds, pins, ways, sides, float(actuator.stroke - distance.max())

    def arms(self, grounds: Complexes, pins: Complexes) -> Floats:
        """dL/dphi of m placements at n positions, (m, n): products of matrices."""
        slope, square = self._matrices
        shifted = grounds - self.middle
        product = np.conj(shifted) * pins
        basis = np.empty((grounds.size, 8))
        basis[:, 0] = 1.0
        basis[:, 1], basis[:, 2] = shifted.real, shifted.imag
        basis[:, 3], basis[:, 4] = pins.real, pins.imag
        basis[:, 5], basis[:, 6] = product.real, product.imag
        basis[:, 7] = np.abs(shifted) ** 2 + np.abs(pins) ** 2
        squared = basis @ square
        # the expanded square can round below 0 only where the actuator is as good as without a length
        return np.asarray((basis @ slope) / np.sqrt(np.maximum(squared, 1e-300)))

    def _descended(
        self, sizes: Sizes, ground: complex, way: bool, side: float, share: float = _BEGIN
    ) -> Placement | None:
        """The nearest optimum of a family, by sequential quadratic programs; None where it leaves what is wanted."""
        from scipy.optimize import minimize

        one = _Descent(self, sizes, way, side)
        try:
            begin = one.start(ground, share)
        except ValueError:
            return None
        answer = minimize(
            lambda z: -z[-1],
            begin,
            jac=lambda z: one.gradient,
            bounds=one.bounds,
            constraints=[{"type": "ineq", "fun": one.rows, "jac": one.slopes}],
            method="SLSQP",
            options={"ftol": 1e-13, "maxiter": 60},
        )
        ground = one.ground(answer.x)
        pin = one.pin(ground, *one.ends(answer.x))
        if pin is None:
            return None
        found = self.placement(ground, pin)
        return found if self.keeps(found) else None

    def keeps(self, found: Placement, hair: float = _HAIR) -> bool:
        """Whether a placement is within what is wanted, to a hair."""
        left, bottom, right, top = self.wanted.box
        room = hair * self.size
        inside = left - room <= found.ground.real <= right + room and bottom - room <= found.ground.imag <= top + room
        signed = found.arm * self.sense * (1.0 if found.extends else -1.0)
        return bool(
            inside
            and abs(found.pin) <= self.wanted.reach + room
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

    def bears(self, found: Placement) -> bool:
        """Whether a placement asks no more of it than it can."""
        return bool(found.force.max() <= self.push and -found.force.min() <= self.pull)


def _nearly(row: Row, found: Placement) -> bool:
    """Whether a row bears a placement, or one that is a little better."""
    return bool(found.force.max() <= _NEARLY * row.push and -found.force.min() <= _NEARLY * row.pull)


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
    def begun(actuator: Actuator) -> Screened | None:
        return None if question.link.pivot is not None else question.screened(actuator, _ROW_DESCENTS)

    @cache
    def placed(actuator: Actuator) -> Placement | Refused:
        begin = begun(actuator)
        if begin is None:
            return question.best(actuator)
        return question.descend(begin, Sizes(actuator), work, False)

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
            if begin is not None and begin.refused is not None:
                unfit.append(Unfit(row, begin.refused))
            else:
                tries.append((-row.actuator.stroke if begin is None else -begin.worth, row, begin))
        tries.sort(key=lambda one: one[0])
        here: list[Bought] = []
        for _, row, begin in tries:
            if len(found) + len(here) >= most or (work is not None and work.expired()):
                break
            one = placed(row.actuator)
            if begin is not None and isinstance(one, Placement) and (not question.loaded or _nearly(row, one)):
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
    """Placements from which descents begin, the best first, or why there are none."""

    grounds: Complexes
    pins: Complexes
    ways: Flags
    sides: Floats
    refused: Refused | None
    short: Refused | None = None
    """Where the grid's arms are all a little below what is asked for."""
    worth: float = 0.0
    """Of the best: least of arm over burden."""

    @classmethod
    def none(cls, refused: Refused) -> Screened:
        """No placement."""
        empty, places = np.zeros(0), np.zeros(0, dtype=np.complex128)
        return cls(places, places, empty > 0, empty, refused)


def forms_of(link: LinkMotion, middle: complex) -> tuple[Floats, Floats]:
    """Coefficients (8, n) of L dL/dphi and of L^2 in 1, G, q, conj(G) q and |G|^2 + |q|^2; G from the middle.

    ``conj(v) Q'`` with v = X + R q - G and Q' = X' + i w R q, multiplied out.
    """
    x, r, speed, rate = link.origin - middle, link.direction, link.velocity, link.rate
    zero = np.zeros(x.size)
    of_pin = np.conj(speed) * r + 1j * rate * np.conj(x) * r
    of_both = -1j * rate * r
    slope = [
        np.real(np.conj(x) * speed),
        -speed.real,
        -speed.imag,
        of_pin.real,
        -of_pin.imag,
        of_both.real,
        -of_both.imag,
        zero,
    ]
    pin = 2 * np.conj(x) * r
    both = -2 * r
    square = [
        np.abs(x) ** 2,
        -2 * x.real,
        -2 * x.imag,
        pin.real,
        -pin.imag,
        both.real,
        -both.imag,
        zero + 1,
    ]
    return np.array(slope), np.array(square)


class _Descent:
    """Rows and exact derivatives of ``arm >= u burden``, arm, reach and sizes along one family.

    Unknowns: G, then retracted length and stroke where they are free, all over the size; and u.
    """

    def __init__(self, question: Question, sizes: Sizes, way: bool, side: float) -> None:
        self.q, self.side, self.way, self.sizes = question, side, way, sizes
        self.sign = question.sense * (1.0 if way else -1.0)
        self.size = question.size
        left, bottom, right, top = question.wanted.box
        box = [(left / self.size, right / self.size), (bottom / self.size, top / self.size)]
        free = [sizes.retracted_free, sizes.stroke_free]
        self.free = [k for k in (0, 1) if free[k]]
        self.bounds = [*box, *[(1e-6, 1e6)] * len(self.free), (0.0, 1e6)]
        self.gradient = np.zeros(len(self.bounds))
        self.gradient[-1] = -1.0
        # u is told in what a placement at the bound would have, so that all unknowns are of order one
        whole = float(np.trapezoid(question.burden, question.at) * question.sense)
        self.unit = sizes.begin.stroke / max(whole, 1e-300)
        self._seen: _Looked | None = None

    def ground(self, z: Floats) -> complex:
        return complex(z[0] * self.size, z[1] * self.size)

    def ends(self, z: Floats) -> tuple[float, float]:
        """Lengths at the first position and at the last."""
        both = list(self.sizes.begin)
        for place, k in enumerate(self.free, 2):
            both[k] = float(z[place]) * self.size
        short, long = both[0], both[0] + both[1]
        return (short, long) if self.way else (long, short)

    def pin(self, ground: complex, begin: float, end: float) -> complex | None:
        """The pin from both circles; None where they do not meet."""
        link = self.q.link
        first, last = (np.conj(link.direction[k]) * (ground - link.origin[k]) for k in (0, -1))
        distance = abs(last - first)
        if distance == 0:
            return None
        foot = ((begin - end) * (begin + end) / distance + distance) / 2
        height = (begin - foot) * (begin + foot)
        if height < 0:
            return None
        return complex(first + (foot + 1j * self.side * np.sqrt(height)) * (last - first) / distance)

    def start(self, ground: complex, share: float) -> Floats:
        sizes = self.sizes.begin
        z = np.array([ground.real, ground.imag, *(sizes[k] for k in self.free), 0.0]) / self.size
        pin = self.pin(ground, *self.ends(z))
        if pin is None:
            raise ValueError
        arm = self.q.placement(ground, pin).arm * self.sign
        z[-1] = share * np.min(arm / np.maximum(self.q.burden, 1e-300)) / self.unit
        return z

    def rows(self, z: Floats) -> Floats:
        return self._at(z).rows

    def slopes(self, z: Floats) -> Floats:
        seen = self._at(z)
        if seen.slopes is None:
            seen = self._seen = seen._replace(slopes=self._slopes_of(seen))
        return np.asarray(seen.slopes)

    def _at(self, z: Floats) -> _Looked:
        """What is known at the unknowns that were looked at last; a line search asks for rows alone."""
        key = z.tobytes()
        if self._seen is None or self._seen.key != key:
            self._seen = self._computed(key, z)
        return self._seen

    def _computed(self, key: bytes, z: Floats) -> _Looked:
        q, link, size = self.q, self.q.link, self.size
        n = q.at.size
        rows = np.full(2 * n + 1 + bool(self.free), -1.0)
        flat = np.zeros((rows.size, z.size))
        ground, ends, pin = 0j, (0.0, 0.0), None
        if np.all(np.isfinite(z)):
            ground, ends = self.ground(z), self.ends(z)
            pin = self.pin(ground, *ends)
        if pin is None:
            return _Looked(key, rows, flat)
        v = link.place(pin) - ground
        # Re(conj(v_k) R_k dq) = Re(conj(v_k) dG) + L_k dL_k at both ends: two real equations for dq
        one, other = (complex(np.conj(v[k]) * link.direction[k]) for k in (0, -1))
        system = (one.real, -one.imag, other.real, -other.imag)
        if abs(system[0] * system[3] - system[1] * system[2]) < 1e-14 * max(ends) ** 2:
            return _Looked(key, rows, flat)
        along, speed = v / np.abs(v), link.speed(pin)
        arm = np.real(np.conj(along) * speed) * (self.sign / self.unit)
        rows[:n] = arm - z[-1] * q.burden
        rows[n : 2 * n] = arm - q.wanted.arm / self.unit
        reach = q.wanted.reach
        rows[2 * n] = (1 - abs(pin) / reach) * (1 + abs(pin) / reach)
        if self.free:
            rows[-1] = (min(ends) - abs(ends[1] - ends[0]) - self.sizes.dead_length) / size
        return _Looked(key, rows, None, ends, pin, v, along, speed, system)

    def _slopes_of(self, seen: _Looked) -> Floats:
        q, link, size = self.q, self.q.link, self.size
        n, (a, b, c, d) = q.at.size, seen.system
        slopes = np.zeros((seen.rows.size, len(self.bounds)))
        right = np.zeros((2, len(self.bounds) - 1))
        right[:, 0], right[:, 1] = seen.v[[0, -1]].real, seen.v[[0, -1]].imag
        for place, k in enumerate(self.free, 2):
            longer = 1 if self.way else 0
            if k == 0:
                right[:, place] = seen.ends
            else:
                right[longer, place] = seen.ends[longer]
        right *= size / (a * d - b * c)
        moved = (d * right[0] - b * right[1]) + 1j * (a * right[1] - c * right[0])
        changes = np.array([1, 1j, *[0] * len(self.free)]) * size
        along, speed = seen.along[:, None], seen.speed[:, None]
        turned = link.direction[:, None] * moved
        dv = turned - changes
        back = np.conj(along)
        dn = (dv - along * np.real(back * dv)) / np.abs(seen.v)[:, None]
        arms = np.real(np.conj(dn) * speed) + np.real(back * 1j * link.rate[:, None] * turned)
        arms *= self.sign / self.unit
        slopes[:n, :-1], slopes[:n, -1] = arms, -q.burden
        slopes[n : 2 * n, :-1] = arms
        slopes[2 * n, :-1] = -2 * np.real(np.conj(seen.pin) * moved) / q.wanted.reach**2
        for place, k in enumerate(self.free, 2):
            slopes[-1, place] = 1.0 if k == 0 else -1.0
        return slopes


class _Looked(NamedTuple):
    """What a descent knows at one set of unknowns: its rows, and what their slopes are made of."""

    key: bytes
    rows: Floats
    slopes: Floats | None
    ends: tuple[float, float] = (0.0, 0.0)
    pin: complex = 0j
    v: Complexes = np.zeros(0, dtype=np.complex128)
    along: Complexes = np.zeros(0, dtype=np.complex128)
    speed: Complexes = np.zeros(0, dtype=np.complex128)
    system: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)


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
    places = pivot + radius * np.exp(1j * angles)
    inside = (places.real >= left) & (places.real <= right) & (places.imag >= bottom) & (places.imag <= top)
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
        places = pivot + radius * np.exp(1j * tried)
        off = np.maximum(np.maximum(left - places.real, places.real - right), 0.0)
        off += np.maximum(np.maximum(bottom - places.imag, places.imag - top), 0.0)
        return float(tried[np.argmin(off)])
    step = angles[1] - angles[0]
    begin = int(np.argmin(inside))
    run, longest, middle = 0, 0, 0
    for k in range(angles.size + 1):
        here = inside[(begin + k) % angles.size]
        run = run + 1 if here else 0
        if run > longest:
            longest, middle = run, 2 * (begin + k) - run + 1
    return float(step * middle / 2)


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
    """The knee with the least force along it that locks the last position, or the first."""
    question = Question(link, at, torque, wanted._replace(extends=last))
    size = question.size
    found = question.best_of_sizes(Sizes(Actuator(size, size), True, True), work)
    if isinstance(found, Refused):
        return found
    end = -1 if last else 0
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
        back, most = bool((arm * arm[end] <= 0).any()), float(np.abs(turned).max())
        bends.append(((back, most, -float(np.abs(arm).min()), side), knee, turned))
    _, knee, turned = min(bends, key=lambda bend: bend[0])
    return Knee(
        found,
        handle,
        strut,
        knee,
        float((whole - length[end]) / abs(found.arm[end])),
        turned,
        bool(found.force[end] > 0),
    )
