"""A motor that turns on and on, and a rod: the two links that make a linkage swing between its ends, and the six-bar they make.

A motor's crank a about O and a rod b to a pin Q of the linkage reach the ends of its swing where ``|OQ|`` is ``b - a`` and
``b + a``: an actuator of retracted length b - a and stroke 2a goes through the same lengths. The rod's transmission angle is
that between rod and normal of Q's path: 90 degrees where it pulls along the path.

On a link that turns about a pivot the motor, the rod, the pin's radius c and the distance d of O from the pivot are a
crank-rocker; with h half the chord of the pin's way and e the angle QaOQb, which makes the time ratio (pi + e) / (pi - e)::

    a = h sin(zeta) / cos(e/2)        b = h cos(zeta) / |sin(e/2)|        0 < zeta < pi/2

and zeta is chosen for the best transmission angle. On other links O, a and b are found by search.

As one mechanism of six links, with poses and rates by the motor's angle, and forces: the motor's crank a about O and the rod b
to the pin Q leave the linkage one freedom, the motor's angle. Over half a turn and the other the linkage goes through its used
interval and back, so at an angle w its own drive stands at the only place phi of the interval with

    |Q(phi) - K(w)| = b,    K = O + a e^{i (w0 + w)}

which Newton's method finds to rounding, on any link. Rates follow by the chain rule; they vanish at both ends, where crank and
rod are in a line and the linkage stands still for a moment while the motor turns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Flags, Floats, angle_at, cross, dot
from synthesis.drives.actuator import Descent, Question, Wanted, within_box
from synthesis.drives.links import GROUND, LinkMotions, motions_at
from synthesis.errors import FieldError
from synthesis.four_bar import grashof_excesses, transmission_angle_over
from synthesis.guides import Circle, Rail
from synthesis.linkage import Linkage, LinkMotion
from synthesis.mechanism import Box, outside
from synthesis.studies.forces import Load
from synthesis.target import TURN, Interval
from synthesis.work import Work

_ZETAS = 2000
"""Values of zeta that are looked at before the best is closed in upon."""
_ROD = 3.0
"""Rod over pin radius for equal times, where any rod will do: at most 1.7 degrees worse than an endless one."""
_EQUAL = 1e-6
"""From 1, a time ratio is that of equal times: a reply's own ratio is, to rounding."""
_LOOSE = 1e-5
"""Of crank and rod together: by so much the ends of the way may differ from the dead centres."""
_OTHER_RODS = [2.5, 2.0, 1.6, 1.3, 1.1, 0.9, 4.0, 6.0]
LARGEST_RATIO = 5.0
"""Time ratio at most: the rod then stands at 60 degrees less than half the swing at best."""
_GRID, _FEW = 14, 19
"""Points of the grid of O, either way, and positions of the motion that are looked at there."""
_AROUND, _RADII = 12, (0.4, 0.7, 1.0)
"""Directions of pins on their link, and their distances over the reach."""
_CLOSER = (36, (0.15, 0.3, 0.5, 0.7, 0.85, 1.0))
"""The same where none of these is a beginning, as with a small box of the motor."""
_RODS, _LENGTHS = (0.2, 50.0), 16
"""Rods that are tried for given times, the shortest and the longest over half the way of the pin, and how many."""
_EACH_WAY, _APART, _SAME = 4, 0.3, 0.01
"""Short descents of each way; over the size, how far apart they begin, and how near is one place."""
_LEAST_STROKE = 0.1
"""Of the longest way that a pin of the link can have: twice the motor's crank at least."""
_LEAST_SPEED = 0.5
"""Of the mean one that this stroke asks for, a pin's least: at rest no rod could move it."""
_SHORT, _LONG, _STEPS = 8, 3, 40
"""Steps of a short descent; how many are gone on with, and for how many steps."""


class Proportions(NamedTuple):
    """A crank-rocker in units of the pin's radius, its place told from the pivot with the swing's bisector along x.

    It stands for a swing that turns counter-clockwise while the rod's end moves away from the motor; the others are its mirrors.
    """

    crank: float
    rod: float
    ground: float
    motor: complex
    transmission_angle_min: float
    """Over the whole turn of the motor, in radians."""
    zeta: float | None
    """None for equal times."""


def proportions(swing: float, time_ratio: float = 1.0, rod: float = _ROD) -> Proportions | None:
    """The crank-rocker whose rocker swings by an angle with the best least transmission angle; None where there is none.

    ``swing``: radians, below pi. ``time_ratio``: at least 1. ``rod``: over the pin's radius, for equal times only.

    Law: simulated, it swings by the angle, and the motor turns by the times' ratio, to rounding.
    """
    half = swing / 2
    chord = np.sin(half)
    if not 0 < swing < np.pi:
        return None
    if time_ratio == 1.0:
        ground = np.sqrt(rod**2 + np.cos(half) ** 2)
        lengths = np.array([chord, rod, 1.0, ground])
        angle = transmission_angle_over(lengths, Interval(0.0, TURN))
        if not np.isfinite(angle) or rod <= chord:
            return None
        # on the line of the two ends, b - a from the nearer one
        return Proportions(chord, rod, float(ground), complex(np.cos(half), -rod), float(angle), None)
    e = _angle_of(time_ratio)

    def worth(zeta: Floats) -> tuple[Floats, Complexes, Floats, Floats]:
        crank = chord * np.sin(zeta) / np.cos(e / 2)
        rod = chord * np.cos(zeta) / np.sin(e / 2)
        down = -crank * rod / chord
        near = rod - crank
        with np.errstate(invalid="ignore"):
            across = np.sqrt((near - down - chord) * (near + down + chord))
        motors = np.cos(half) + np.stack([across, -across]) + 1j * down
        return _angles(crank, rod, motors, half), motors, crank, rod

    zetas = np.linspace(0, np.pi / 2, _ZETAS + 2)[1:-1]
    angles, *_ = worth(zetas)
    side, k = divmod(int(np.argmax(angles)), zetas.size)
    if angles[side, k] <= 0:
        return None
    low, high = (zetas[min(max(k + step, 0), zetas.size - 1)] for step in (-1, 1))
    ratio = (np.sqrt(5) - 1) / 2
    for _ in range(90):
        one, other = high - ratio * (high - low), low + ratio * (high - low)
        here, there = worth(np.array([one, other]))[0][side]
        low, high = (low, other) if here >= there else (one, high)
    zeta = (low + high) / 2
    if worth(np.array([zeta]))[0][side, 0] < angles[side, k]:
        zeta = zetas[k]
    angles, motors, crank, rods = worth(np.array([zeta]))
    motor = complex(motors[side, 0])
    return Proportions(float(crank[0]), float(rods[0]), abs(motor), motor, float(angles[side, 0]), float(zeta))


def _angles(crank: Floats, rod: Floats, motors: Complexes, half: float) -> Floats:
    """Least transmission angles (2, n) of crank-rockers with pin radius 1; -1 where they do not do what is asked."""
    ground = np.abs(motors)
    lengths = np.stack(np.broadcast_arrays(crank, rod, 1.0, ground), axis=-1)
    with np.errstate(invalid="ignore"):
        shortest = (crank < rod) & (crank < 1) & (crank < ground)
        turns = np.all(np.stack(grashof_excesses(np.nan_to_num(lengths, nan=1.0))) > 0, axis=0)
        first, last = (np.imag(np.conj(motors) * np.exp(1j * angle)) for angle in (-half, half))
        one_side = first * last > 0
    good: Flags = shortest & turns & one_side & np.isfinite(ground)
    angles = np.full(good.shape, -1.0)
    if good.any():
        angles[good] = transmission_angle_over(lengths[good], Interval(0.0, TURN))
    return np.where(np.isfinite(angles), angles, -1.0)


@dataclass(frozen=True)
class Driven:
    """A motor and a rod on a linkage, at the n positions of its way; the first axis of pairs is forwards, backwards.

    Forwards the linkage passes its positions in order. The motor's angle grows counter-clockwise.
    """

    motor: complex
    pin: complex
    """In its link's frame."""
    crank: float
    rod: float
    extends: bool
    """Whether the first position has the crank folded over the rod."""
    length: Floats
    """|OQ|"""
    crank_pin: Complexes
    """(2, n)"""
    motor_angle: Floats
    """(2, n): of the crank against the x axis, continuous over the whole turn that begins with the way forwards."""
    transmission: Floats
    """(2, n): between rod and normal of the pin's path, radians."""
    gain: Floats
    """(2, n): change of the drive's parameter per radian of the motor, counter-clockwise; zero at both ends."""
    rod_force: Floats
    """(2, n): compression positive."""
    motor_torque: Floats
    """(2, n): counter-clockwise; what the motor must give."""

    @property
    def least_angle(self) -> float:
        """The least transmission angle of both ways."""
        return float(self.transmission.min())

    @property
    def turns(self) -> tuple[float, float]:
        """How far the motor turns forwards and backwards; together a whole turn."""
        forwards, backwards = np.abs(self.motor_angle[:, -1] - self.motor_angle[:, 0]).tolist()
        return forwards, backwards

    @property
    def time_ratio(self) -> float:
        """The longer of both over the shorter."""
        both = self.turns
        return max(both) / min(both)

    @property
    def sense(self) -> float:
        """Which way the motor turns: 1 counter-clockwise."""
        return float(np.sign(self.motor_angle[0, -1] - self.motor_angle[0, 0]))


def driven(
    link: LinkMotion,
    torque: Floats,
    motor: complex,
    pin: complex,
    crank: float,
    rod: float,
    extends: bool,
    loose: float = _LOOSE,
) -> Driven | None:
    """What motor and rod do to a link, for a motor that turns so that the rod's side is kept; None where they do not drive it.

    The motor passes a dead centre at either end: the pin's distance must grow or shrink all the way between. ``loose``: by how
    much of crank and rod together the ends may differ from the dead centres.
    """
    v = link.place(pin) - motor
    length = np.abs(v)
    along = v / length
    way = np.diff(length)
    ends = [rod - crank, rod + crank] if extends else [rod + crank, rod - crank]
    if np.max(np.abs(length[[0, -1]] - ends)) > loose * (rod + crank):
        return None
    if not (np.all(way > 0) if extends else np.all(way < 0)):
        return None
    # the angle at the pin between rod and line to the motor, from the triangle's sides: nothing cancels at its ends
    beta = angle_at(rod, crank, length)
    beta[0] = beta[-1] = 0.0
    # at the motor: between its crank and the line to the pin
    gamma = angle_at(crank, rod, length)
    gamma[0], gamma[-1] = (np.pi, 0.0) if extends else (0.0, np.pi)
    line = np.unwrap(np.angle(v))
    speed = link.speed(pin)
    best: Driven | None = None
    for side in (1.0, -1.0):
        sides = np.array([side, -side])[:, None]
        angle = line + sides * gamma
        pins = motor + crank * np.exp(1j * angle)
        rods = along * np.exp(-1j * sides * beta)
        pull = np.real(np.conj(rods) * speed)
        with np.errstate(divide="ignore", invalid="ignore"):
            transmission = np.arcsin(np.clip(np.abs(pull) / np.abs(speed), 0, 1))
            gain = np.real(np.conj(rods) * 1j * (pins - motor)) / pull
            force = torque / pull
        signed = pull * (1.0 if extends else -1.0) * np.sign(pull[0, 0] * (1.0 if extends else -1.0))
        if signed.min() <= 0:
            return None
        gain[:, [0, -1]] = 0.0
        begin, back = angle[0], angle[1] + TURN * np.round((angle[0, -1] - angle[1, -1]) / TURN)
        # forwards the motor turns one way; backwards, from the last position to the first, it goes on the same way
        found = Driven(
            motor,
            pin,
            crank,
            rod,
            extends,
            length,
            pins,
            np.stack([begin, back]),
            transmission,
            gain,
            force,
            force * np.real(np.conj(rods) * 1j * (pins - motor)),
        )
        if best is None or _order(found) > _order(best):
            best = found
    return best


def _order(one: Driven) -> float:
    """Of the two ways round, the one that goes forwards slowly, and of equal ones counter-clockwise."""
    forwards, backwards = one.turns
    return forwards - backwards + 1e-9 * one.sense


def about_pivot(
    link: LinkMotion,
    torque: Floats,
    time_ratio: float | None,
    radius: float,
    radius_given: bool,
    box: Box | None,
    rod: float | None = None,
    reach: float = np.inf,
) -> Driven | str:
    """The best motor and rod on a link that turns about a pivot, or why there is none.

    The transmission angle does not depend on the pin's radius, which is within `reach`, nor on where it is around the pivot:
    these put the motor into its box. Without need the pin lies on the link's line.
    """
    assert link.pivot is not None
    pivot = link.pivot
    turned = np.unwrap(np.angle(link.direction))
    swing = abs(float(turned[-1] - turned[0]))
    if np.min(np.diff(turned) * np.sign(turned[-1] - turned[0])) <= 0:
        return "the link turns back within the way: no motor drives it through"
    ratio = 1.0 if time_ratio is None or abs(time_ratio - 1) < _EQUAL else max(time_ratio, 1 / time_ratio)
    # for equal times any rod will do: others than the usual one where the motor's box asks for them
    rods = [_ROD if rod is None else rod / radius]
    if rod is None and ratio == 1.0 and box is not None:
        rods += _OTHER_RODS
    known = [one for one in (proportions(swing, ratio, length) for length in rods) if one is not None]
    if not known:
        return f"no crank-rocker swings by {np.rad2deg(swing):.6g} degrees with a time ratio of {ratio:.6g}"
    rising = float(np.sign(turned[-1] - turned[0]))
    around = np.linspace(0.0, TURN, 360, endpoint=False)
    turns = sorted(around.tolist(), key=lambda angle: min(angle, TURN - angle))
    radii = (
        [radius] if radius_given else [radius * part for part in (1, 0.8, 1.25, 0.6, 1.6, 0.4, 2.2, 0.25, 3, 0.15)]
    )
    radii = radii[:1] + [size for size in radii[1:] if size <= reach]
    bisector = link.direction[0] * np.exp(0.5j * rising * swing)
    for found in known:
        # extending counter-clockwise as it stands; the mirror image for either the other way or the other sense
        ways = (True, False) if rising > 0 else (False, True)
        motors = [bisector * place for place in (found.motor, found.motor.conjugate())]
        for pin in _pins(radii, turns, pivot, motors, box):
            answers = []
            for extends, place in zip(ways, motors):
                motor, size = complex(pivot + pin * place), abs(pin)
                if box is None or _inside(motor, box, pivot):
                    answers.append(driven(link, torque, motor, pin, size * found.crank, size * found.rod, extends))
            good = [one for one in answers if one is not None]
            if good:
                return min(good, key=lambda one: float(np.abs(one.motor_torque).max()))
    return "no place of the pin puts the motor into motor_box"


def _pins(
    radii: list[float], turns: list[float], pivot: complex, motors: list[complex], box: Box | None
) -> Iterator[complex]:
    """Pins on a grid, and for each motor, over its pin, the one that puts it on the middle of an arc in its box."""
    yield from (complex(size * np.exp(1j * angle)) for size in radii for angle in turns)
    if box is None:
        return
    near = complex(min(max(pivot.real, box[0]), box[2]), min(max(pivot.imag, box[1]), box[3]))
    far = max(abs(complex(x, y) - pivot) for x in box[::2] for y in box[1::2])
    away = abs(motors[0])
    low, high = max(abs(near - pivot) / away, min(radii)), min(far / away, max(radii))
    if low <= high:
        size = radii[0] if low <= radii[0] <= high else (low + high) / 2
        for motor in motors:
            direction = within_box(pivot, size * away, box, np.sort(turns))
            yield complex(size * np.exp(1j * (direction - np.angle(motor))))


def _inside(place: complex, box: Box, pivot: complex) -> bool:
    """To the rounding of a motor's distance from the pivot."""
    return bool(outside(place, box) <= 1e-12 * abs(place - pivot))


# -- any link ----------------------------------------------------------------------------------------------------------


def on_any_link(
    link: LinkMotion,
    at: Floats,
    torque: Floats,
    time_ratio: float | None,
    reach: float,
    box: Box,
    work: Work | None = None,
) -> Driven | str:
    """The motor and rod with the best least transmission angle on a link that moves anyhow, or why there are none found."""
    angle = None if time_ratio is None else _angle_of(time_ratio)
    wanted = Wanted(box, reach, 0.0)
    whole = Question(link, at, np.zeros(at.size), wanted, _GRID)
    some = np.unique(((at.size - 1) * np.sin(np.linspace(0, np.pi / 2, _FEW)) ** 2).round().astype(int))
    rough = Question(link.at(some), at[some], np.zeros(some.size), wanted, _GRID)
    begun = _beginnings(rough, angle)
    if not begun:
        closer = Question(rough.link, rough.at, rough.torque, wanted, _GRID // 2)
        begun = _beginnings(closer, None, *_CLOSER)  # the descents see to the times
    if not begun:
        return "no point of the link has a distance from any point of motor_box that grows or shrinks all the way"
    # short descents over few positions say which valleys are worth a long one over all
    ends: list[tuple[float, _Begin]] = []
    for begin in begun:
        if work is not None and work.expired() and ends:
            break
        end = _improved(rough, begin, angle, _SHORT)
        ends.append((_Descent(whole, begin.way, angle).worth(end), end))
    ends.sort(key=lambda row: -row[0])
    best: Driven | None = None
    seen: list[_Begin] = []
    for _, begin in ends:
        if best is not None and (len(seen) >= _LONG or (work is not None and work.expired())):
            break
        if any(one.near(begin, _SAME * whole.size) for one in seen):
            continue
        seen.append(begin)
        one = _closed(whole, torque, _improved(whole, begin, angle, _STEPS), angle)
        if one is not None and (best is None or one.least_angle > best.least_angle):
            best = one
    if best is None:
        wish = "" if time_ratio is None else f" with a time ratio of {time_ratio:g}"
        return f"no motor in motor_box was found whose rod drives the link both ways{wish}"
    return best


def _least_stroke(question: Question) -> float:
    """Of the line between motor and pin: a pin that hardly moves asks for a rod that nothing bears."""
    link = question.link
    turned = abs(link.direction[-1] - link.direction[0])
    return float(_LEAST_STROKE * (abs(link.origin[-1] - link.origin[0]) + question.wanted.reach * turned))


def _beginnings(
    question: Question, angle: float | None, many: int = _AROUND, radii: tuple[float, ...] = _RADII
) -> list[_Begin]:
    """Motors and pins of a coarse grid that drive the link, the best of each way that lie apart from one another."""
    link, reach = question.link, question.wanted.reach
    turns = np.exp(2j * np.pi * np.arange(many) / many)
    pins = np.concatenate([[0j], *(reach * part * turns for part in radii)])
    if angle is None:
        o, q = (one.ravel() for one in np.meshgrid(question.grounds, pins))
    else:
        o, q = _in_time(question, pins, angle)
    arms = question.arms(o, q) * question.sense
    first, last = (np.abs(link.origin[k] + link.direction[k] * q - o) for k in (0, -1))
    far = np.abs(last - first) >= _least_stroke(question)
    found: list[_Begin] = []
    for way in (True, False):
        good = np.flatnonzero(far & ((arms if way else -arms).min(axis=1) > 0))
        if not good.size:
            continue
        worth = _sines(link, o[good], q[good], way, question.sense).min(axis=(0, 2))
        for _ in range(_EACH_WAY):
            k = int(np.argmax(worth))
            if worth[k] == -np.inf:
                break
            found.append(_Begin(complex(o[good][k]), complex(q[good][k]), way))
            apart = np.abs(o[good] - found[-1].motor) + np.abs(q[good] - found[-1].pin)
            worth[apart < _APART * question.size] = -np.inf
    return found


def _angle_of(time_ratio: float) -> float:
    ratio = max(time_ratio, 1 / time_ratio)
    return float(np.pi * (ratio - 1) / (ratio + 1))


def _in_time(question: Question, pins: Complexes, angle: float) -> tuple[Complexes, Complexes]:
    """Motors in their box from which the ends of a pin's way are seen under an angle, and the pins; for rods of many lengths."""
    first, last = (question.link.origin[k] + question.link.direction[k] * pins for k in (0, -1))
    half, middle = (last - first)[:, None] / 2, (first + last)[:, None] / 2
    size = np.abs(half)
    # crank and rod over half the chord: points of the ellipse (a cos(e/2))^2 + (b sin(e/2))^2 = 1, some of equal steps of the rod
    rods = np.geomspace(_RODS[0], min(_RODS[1], 0.999 / np.sin(angle / 2)), _LENGTHS)
    cranks = np.sqrt(1 - (rods * np.sin(angle / 2)) ** 2) / np.cos(angle / 2)
    # from the middle of the chord, along it and beside it, by the two distances b - a and b + a from its ends
    along = cranks * rods
    beside = np.sqrt(np.maximum((rods - cranks) ** 2 - (along - 1) ** 2, 0.0))
    places, of = [], []
    for way in (1, -1):
        for side in (1, -1):
            motors = middle + half * (way * along + 1j * side * beside)
            inside = (outside(motors, question.wanted.box) <= 0) & (rods > cranks) & (size > 0)
            places.append(motors[inside])
            of.append(np.broadcast_to(pins[:, None], motors.shape)[inside])
    return np.concatenate(places), np.concatenate(of)


def _sines(link: LinkMotion, motors: Complexes, pins: Complexes, way: bool, sense: float) -> Floats:
    """Sines of the transmission angle of m motors and pins, (2, m, n), negative where the rod works against the way."""
    turned = link.direction * pins[:, None]
    v = link.origin + turned - motors[:, None]
    length = np.abs(v)
    first, last = length[:, :1], length[:, -1:]
    cosine = np.minimum((length**2 + first * last) / (length * (first + last)), 1.0)
    part = np.conj(v) * (link.velocity + 1j * link.rate * turned)
    part *= (sense if way else -sense) / np.maximum(np.abs(part), 1e-300)
    along, across = part.real * cosine, part.imag * np.sqrt(1 - cosine**2)
    return np.stack([along + across, along - across])


class _Begin(NamedTuple):
    """Where a descent begins: motor, pin, and whether the line between both grows."""

    motor: complex
    pin: complex
    way: bool

    def near(self, other: _Begin, length: float) -> bool:
        """Whether both are in one valley, as far as one can see."""
        return self.way == other.way and abs(self.motor - other.motor) + abs(self.pin - other.pin) < length


class _Descent(Descent):
    """Rows and exact derivatives of ``sine of the transmission angle >= u``, reach and times, of motor O and pin q.

    With psi the angle from the line OQ to the pin's path and beta that at the pin
    between rod and line, the sines are ``cos(psi -+ beta)``; crank and rod follow from ``|OQ|`` at both ends.
    """

    def __init__(self, question: Question, way: bool, angle: float | None) -> None:
        self.link, self.way, self.angle = question.link, way, angle
        self.size, self.reach = question.size, question.wanted.reach
        self.sign, self.stroke = question.sense * (1.0 if way else -1.0), _least_stroke(question)
        span = abs(float(question.at[-1] - question.at[0]))
        self.speed = max(_LEAST_SPEED * self.stroke / span, 1e-300)
        box = [part / self.size for part in question.wanted.box]
        room = self.reach / self.size
        self.bounds = [(box[0], box[2]), (box[1], box[3]), (-room, room), (-room, room), (-1.0, 1.0)]

    def rows(self, z: Floats) -> Floats:
        """Sines less u, (2 n - 2,), the pin's least speed, room of the reach, and how far the line grows or shrinks."""
        found = self._at(z).rows[:-1].copy()
        found[:-3] -= z[4]
        return found

    def slopes(self, z: Floats) -> Floats:
        """Of `rows`, by the unknowns."""
        found = self._at(z).slopes[:-1]
        return np.column_stack([found, np.append(np.full(found.shape[0] - 3, -1.0), np.zeros(3))])

    def off(self, z: Floats) -> Floats:
        """The angle QaOQb less the one that the times ask for."""
        return self._at(z).rows[-1:]

    def off_slopes(self, z: Floats) -> Floats:
        """Of `off`."""
        return np.append(self._at(z).slopes[-1], 0.0)[None]

    def start(self, begin: _Begin) -> Floats:
        """The unknowns at a place, with u the smallest sine there."""
        z = self.unknowns(begin.motor, begin.pin)
        z[4] = self._at(z).rows[:-4].min()
        return z

    def worth(self, begin: _Begin) -> float:
        """The smallest sine at a place, less what the times are off."""
        z = self.start(begin)
        return float(z[4] - (0.0 if self.angle is None else abs(self.off(z)[0])))

    def _looked(self, motor: complex, pin: complex) -> _Angles:
        v, moved = self.link.place(pin) - motor, self.link.speed(pin)
        length = np.abs(v)
        part = np.conj(v) * moved
        part *= self.sign / np.maximum(np.abs(part), 1e-300)
        short, long = (length[0], length[-1]) if self.way else (length[-1], length[0])
        middle = length[1:-1]
        # the angle at the pin, from the triangle's sides: 0 at both ends
        twice = middle * (short + long)
        cosine = np.minimum((middle**2 + short * long) / twice, 1.0)
        sine = (
            np.sqrt(np.maximum((middle - short) * (middle + short) * (long - middle) * (long + middle), 0.0)) / twice
        )
        rows = np.empty(2 * length.size + 2)
        here, there = part[1:-1].real * cosine, part[1:-1].imag * sine
        n = middle.size
        rows[:n], rows[n : 2 * n], rows[2 * n : -4] = here + there, here - there, part[[0, -1]].real
        rows[-4] = float(np.abs(moved).min()) / self.speed - 1
        rows[-3] = (1 - abs(pin) / self.reach) * (1 + abs(pin) / self.reach)
        rows[-2] = (long - short - self.stroke) / self.size
        turned = float(np.angle(v[-1] * np.conj(v[0])))
        rows[-1] = abs(turned) - (self.angle or 0.0)
        return _Angles(self, rows, pin, v, moved, part, cosine, sine, turned)

    def slopes_of(self, seen: _Angles) -> Floats:
        """Derivatives of its rows by both points."""
        link, v, part = self.link, seen.v, seen.part
        along = link.direction[:, None]
        dv = along * _PINS - _MOTORS
        by_line = dv / v[:, None]
        psi = (1j * link.rate[:, None] * along * _PINS / seen.moved[:, None]).imag - by_line.imag
        length = np.abs(v)[:, None]
        longer = by_line.real * length
        (short, d_short), (long, d_long) = ((length[k], longer[k]) for k in ((0, -1) if self.way else (-1, 0)))
        middle, total = length[1:-1], short + long
        # of the cosine (L^2 + s l) / (L (s + l)) by L, s and l
        cosines = (middle**2 - short * long) / (middle**2 * total) * longer[1:-1]
        cosines += (long - middle) * (long + middle) / (middle * total**2) * d_short
        cosines += (short - middle) * (short + middle) / (middle * total**2) * d_long
        beta = -cosines / np.maximum(seen.sine, 1e-12)[:, None]
        one, other = part[1:-1].imag * seen.cosine, part[1:-1].real * seen.sine
        slopes = np.zeros((seen.rows.size, 4))
        n = seen.sine.size
        slopes[:n] = (other - one)[:, None] * (psi[1:-1] - beta)
        slopes[n : 2 * n] = -(other + one)[:, None] * (psi[1:-1] + beta)
        slopes[2 * n : -4] = -part[[0, -1]].imag[:, None] * psi[[0, -1]]
        k = int(np.argmin(np.abs(seen.moved)))
        turned = 1j * link.rate[k] * link.direction[k] * _PINS
        slopes[-4] = np.real(np.conj(seen.moved[k]) * turned) / abs(seen.moved[k]) / self.speed
        slopes[-3] = -2 * np.real(np.conj(seen.pin) * _PINS) / self.reach**2
        slopes[-2] = (d_long - d_short) / self.size
        slopes[-1] = np.sign(seen.turned) * (by_line[-1] - by_line[0]).imag
        return slopes * self.size


_MOTORS, _PINS = np.array([1, 1j, 0, 0]), np.array([0, 0, 1, 1j])
"""Of both by the unknowns."""


@dataclass(frozen=True)
class _Angles:
    """Psi and beta with motor and pin at their places, the rows that they make, and what the slopes are made of."""

    descent: _Descent
    rows: Floats
    pin: complex
    v: Complexes
    moved: Complexes
    part: Complexes
    """Of modulus 1: real is the cosine of psi, imaginary its sine."""
    cosine: Floats
    sine: Floats
    turned: float

    @cached_property
    def slopes(self) -> Floats:
        """Of the rows."""
        return self.descent.slopes_of(self)


def _improved(question: Question, begin: _Begin, angle: float | None, steps: int) -> _Begin:
    """Towards the nearest optimum from one place, by sequential quadratic programs."""
    one = _Descent(question, begin.way, angle)
    return _Begin(*one.ends(one.end(one.start(begin), angle is not None, 1e-10, steps)), begin.way)


def _closed(question: Question, torque: Floats, begin: _Begin, angle: float | None) -> Driven | None:
    """Motor and rod at the end of a descent, in reach and in the times exactly; None where they do not drive the link."""
    one = _Descent(question, begin.way, angle)
    if abs(begin.pin) > one.reach:
        begin = begin._replace(pin=begin.pin * one.reach / abs(begin.pin))
    z = one.start(begin)
    for _ in range(4 if angle is not None else 0):  # by the least step of the motor
        off, slope = one.off(z)[0], one.off_slopes(z)[0, :2]
        if abs(off) > 1e-3:
            return None
        z[:2] -= off * slope / np.dot(slope, slope)
    motor, pin = one.ends(z)
    first, last = np.abs(question.link.place(pin)[[0, -1]] - motor).tolist()
    return driven(question.link, torque, motor, pin, abs(last - first) / 2, (first + last) / 2, begin.way)


# -- six links ------------------------------------------------------------------------------------------------------------


MOTOR_CRANK, ROD = "motor_crank", "rod"
"""Names of the two further links."""
_TABLE = 721
"""Positions of the way that Newton's method begins between."""
_NEWTON, _STILL = 12, 1e-9
"""Steps of Newton's method at most; one of so small a part of the way leads to rounding."""
_BEYOND = 0.02
"""Part of the way by which numbers that were rounded may lead the linkage beyond its ends."""
_ROUNDED = 1e-3
"""Part of crank and rod by which the dead centres may miss the ends of the way."""


class Motor(NamedTuple):
    """A motor at a place of the user's plane, its crank and rod, and the rod's pin in the frame of a link."""

    link: str
    at: complex
    crank: float
    rod: float
    pin: complex


class Joint(NamedTuple):
    """Where two links are joined at n positions; of a slide ``normal``, the direction in which it holds, else None."""

    name: str
    first: str
    second: str
    place: Complexes
    normal: Complexes | None = None


class Held(NamedTuple):
    """What holds a load in equilibrium, (n,) each."""

    torque: Floats
    """Of the motor, counter-clockwise."""
    forces: dict[str, Complexes]
    """In each joint by its name, by the first link on the second."""


@dataclass(frozen=True)
class SixBar:
    """A linkage with a motor, over the way between the two ends of an interval.

    ``poses``: the linkage at places of its drive from the first sample on. ``used``: those where the motor's dead centres are;
    at the first its angles begin, which count counter-clockwise.
    """

    poses: Callable[[Floats], LinkMotions]
    used: Interval
    motor: Motor

    @classmethod
    def of(cls, linkage: Linkage, used: Interval, motor: Motor) -> SixBar:
        """With a four-bar or a body on guides.

        Raises `FieldError`: for a motor that does not swing it from one end of the interval to the other.
        """
        found = cls(lambda at: motions_at(linkage, at), used, motor)
        found.check()
        return found

    def check(self) -> None:
        """FieldError for a motor that does not swing the linkage from one end of its way to the other, and no farther."""
        size = max(self.motor.crank, self.motor.rod)
        turned = np.linspace(0.0, TURN, 181)
        with np.errstate(all="ignore"):
            if self.motor.link in self._coarse.links and self._whole is not None:
                one = self.machine(turned)
                off = one.links[self.motor.link].place(self.motor.pin) - one.links[ROD].origin
                if np.abs(np.abs(off) - self.motor.rod).max() < 1e-9 * size:
                    return
        raise FieldError(
            "/drive",
            "the motor and its rod do not move this linkage over its used interval, from one end to the other",
        )

    # -- where it is --------------------------------------------------------------------------------------------------

    @cached_property
    def _coarse(self) -> LinkMotions:
        """The linkage over its way, closer at both ends, where the motor turns farthest."""
        first, last = self.used
        return self.poses(first + (last - first) * (1 - np.cos(np.linspace(0.0, np.pi, _TABLE))) / 2)

    @cached_property
    def _whole(self) -> Driven | None:
        """Both ways of the motor, there; None where it does not drive the linkage."""
        link, motor = self._coarse.links[self.motor.link], self.motor
        none = np.zeros(_TABLE)
        return driven(link, none, motor.at, motor.pin, motor.crank, motor.rod, self.extends, _ROUNDED)

    @cached_property
    def extends(self) -> bool:
        """Whether motor crank and rod are folded at the first end."""
        length = abs(self._coarse.links[self.motor.link].place(self.motor.pin)[0] - self.motor.at)
        return bool(
            abs(length - (self.motor.rod - self.motor.crank)) < abs(length - (self.motor.rod + self.motor.crank))
        )

    @property
    def pivot(self) -> complex | None:
        """About which the link of the rod turns, if it turns about a fixed one."""
        return self._coarse.links[self.motor.link].pivot

    @cached_property
    def start(self) -> float:
        """Direction of the motor's crank at the first end, against the x axis."""
        towards = self._coarse.links[self.motor.link].place(self.motor.pin)[0] - self.motor.at
        return float(np.angle(-towards if self.extends else towards))

    @cached_property
    def sense(self) -> float:
        """Which way the motor turns for the slower of both ways to be the one forwards; 1 counter-clockwise, so of equal ones."""
        return 1.0 if 2 * self.last - TURN > -1e-9 else -1.0

    @cached_property
    def last(self) -> float:
        """Angle of the motor, 0 to a turn, at the last end."""
        return float(self.turned(np.array([self.used.last]))[0, 0])

    @cached_property
    def _ways(self) -> tuple[Floats, Floats]:
        """Angles of the motor over a turn, rising, and places of the linkage's drive there."""
        assert self._whole is not None
        forwards, backwards = self._whole.motor_angle
        angles = np.concatenate([forwards, backwards[::-1][1:]]) - forwards[0]
        places = np.concatenate([self._coarse.at, self._coarse.at[::-1][1:]])
        if angles[-1] < 0:
            angles, places = angles[::-1] + TURN, places[::-1]
        return angles, places

    @cached_property
    def _room(self) -> tuple[float, float]:
        """Places of the drive between which solutions are looked for: a little beyond both ends, where it closes there."""
        first, last = self.used
        beyond = _BEYOND * (last - first)
        rates = self.poses(np.array([first - beyond, last + beyond])).links[self.motor.link].rate
        ends = (first - beyond if np.isfinite(rates[0]) else first, last + beyond if np.isfinite(rates[1]) else last)
        return min(ends), max(ends)

    @property
    def turn(self) -> tuple[float, float]:
        """How far the motor turns forwards, to the last end, and then back to the first; counter-clockwise positive."""
        forwards = self.last if self.sense > 0 else self.last - TURN
        return forwards, self.sense * TURN - forwards

    @property
    def kind(self) -> str:
        """`watt_2` where the rod moves a link with a fixed pivot, `stephenson_3` on any other."""
        return "stephenson_3" if self.pivot is None else "watt_2"

    def knee(self, turned: Floats) -> Complexes:
        """Where motor crank and rod meet, at angles (n,) of the motor from the first end on."""
        return np.asarray(self.motor.at + self.motor.crank * np.exp(1j * (self.start + np.asarray(turned))))

    def travel(self, turned: Floats) -> Floats:
        """Place of the linkage's drive at angles (n,) of the motor from the first end on.

        Law: the rod keeps its length to rounding; rising on one way of the motor, falling on the other.
        """
        turned = np.asarray(turned, dtype=float)
        angles, places = self._ways
        at = np.interp(turned % TURN, angles, places)
        knee, (low, high) = self.knee(turned), self._room
        with np.errstate(all="ignore"):
            for _ in range(_NEWTON):
                link = self.poses(at).links[self.motor.link]
                off = link.place(self.motor.pin) - knee
                length = np.abs(off)
                step = (length - self.motor.rod) * length / dot(off, link.speed(self.motor.pin))
                at = np.clip(at - step, low, high)
                if not np.any(np.abs(step) > _STILL * (high - low)):
                    break
        return np.asarray(at)

    def turned(self, travel: Floats) -> Floats:
        """Angles (2, n) of the motor, 0 to a turn, at places (n,) of the linkage's drive within the way, the lesser first."""
        away = self.poses(np.asarray(travel)).links[self.motor.link].place(self.motor.pin) - self.motor.at
        corner = angle_at(self.motor.crank, self.motor.rod, np.abs(away))
        both = (np.angle(away) - self.start + np.stack([corner, -corner])) % TURN
        return np.sort(both, axis=0)

    def forwards(self, travel: Floats) -> Floats:
        """The angle of the motor (n,) at which it passes places of the drive on its way forwards, in its sense."""
        both = self.turned(travel)
        found = both[0] if self.sense > 0 else both[1] - TURN
        # the first end lies at 0, whichever way rounding takes it
        return np.where(np.abs(found) > TURN - 1e-6, 0.0, found)

    def dwell(self, share: float) -> tuple[float, float]:
        """How far the motor turns while the linkage is within a share of its way of the first end, and of the last."""
        first, last = self.used
        (one, other), (two, three) = self.turned(
            np.array([first + share * (last - first), last - share * (last - first)])
        ).T
        return float(one + TURN - other), float(three - two)

    # -- how it moves -------------------------------------------------------------------------------------------------

    def machine(self, turned: Floats) -> LinkMotions:
        """All links at angles (n,) of the motor from the first end on, with derivatives by that angle.

        Frames: of the linkage as `motions_at` has them; the motor's crank from O along it, the rod from there to its pin.
        Law: `LinkMotion.velocity`, `rate` and so on are what differences of places tend to.
        """
        turned = np.asarray(turned, dtype=float)
        motor, at = self.motor, self.travel(turned)
        plain = self.poses(at)
        link = plain.links[motor.link]
        knee = self.knee(turned)
        arm = knee - motor.at
        off, speed = link.place(motor.pin) - knee, link.speed(motor.pin)
        along = dot(off, speed)
        rate = dot(off, 1j * arm) / along
        slip = speed * rate - 1j * arm
        change = -(np.abs(slip) ** 2 + dot(off, link.change(motor.pin) * rate**2 + arm)) / along
        gain = speed * change + link.change(motor.pin) * rate**2 + arm
        ones, still = np.ones(turned.size), np.zeros(turned.size, dtype=complex)
        links = {name: _by(one, rate, change) for name, one in plain.links.items()}
        links[MOTOR_CRANK] = LinkMotion(
            MOTOR_CRANK, motor.at + still, self.start + turned, still, ones, still, 0 * ones, motor.at
        )
        square = np.abs(off) ** 2
        links[ROD] = LinkMotion(
            ROD, knee, np.angle(off), 1j * arm, cross(off, slip) / square, -arm, cross(off, gain) / square
        )
        return replace(
            plain,
            at=turned,
            links=links,
            body=None if plain.body is None else _by(plain.body, rate, change),
            drive="motor",
            extent=max(plain.extent, motor.rod),
            reaches=plain.reaches | {MOTOR_CRANK: motor.crank, ROD: motor.rod},
            middles=plain.middles | {MOTOR_CRANK: motor.crank / 2 + 0j, ROD: motor.rod / 2 + 0j},
        )

    def transmission(self, machine: LinkMotions) -> Floats:
        """Angle (n,) between the rod and the normal of its pin's path, of a machine of this motor; 0 is dead."""
        link, rod = self.poses(self.travel(machine.at)).links[self.motor.link], machine.links[ROD].direction
        speed = link.speed(self.motor.pin)
        return np.arctan2(np.abs(dot(rod, speed)), np.abs(cross(rod, speed)))

    # -- what holds it ------------------------------------------------------------------------------------------------

    def held(self, machine: LinkMotions, joints: list[Joint], load: Load) -> Held:
        """The motor's torque and the forces in all joints, from the equilibrium of every link, masses and inertia included.

        ``machine``: of this motor. ``load.speed``: of the motor, constant. Law: the torque is
        `LinkMotions.torque`, by virtual work.
        """
        names = list(machine.links)
        rows, count = 3 * len(names), machine.at.size
        matrix, right = np.zeros((count, rows, rows)), np.zeros((count, rows))

        def acts(name: str, place: Complexes, force: Complexes, moment: Floats | float, on: Floats) -> None:
            if name != GROUND:
                row = 3 * names.index("coupler" if name == "body" else name)
                about = machine.links[names[row // 3]].origin
                on[:, row] += np.real(force)
                on[:, row + 1] += np.imag(force)
                on[:, row + 2] += (cross(place - about, force) + moment) / machine.extent

        none = np.zeros(count, dtype=complex)
        for k, one in enumerate(joints):
            if one.normal is None:
                pushes = ((none + 1, 0.0), (none + 1j, 0.0))
            else:
                pushes = ((one.normal, 0.0), (none, machine.extent))
            for column, (force, moment) in enumerate(pushes, 2 * k):
                acts(one.second, one.place, force, moment, matrix[:, :, column])
                acts(one.first, one.place, -force, -moment, matrix[:, :, column])
        matrix[:, 3 * names.index(MOTOR_CRANK) + 2, -1] = 1.0
        if machine.body is not None:
            acts("body", machine.body.origin, none + load.force, load.torque, right)
        for mass in load.masses:
            link = machine.link(mass.link)
            pull = mass.mass * (load.gravity - load.metre * load.speed**2 * link.change(mass.at))
            spin = load.metre * mass.inertia * load.speed**2 * link.rate_change
            acts(mass.link, link.place(mass.at), pull, -spin, right)
        found: Floats = np.asarray(np.linalg.solve(matrix, -right[:, :, None])[:, :, 0], dtype=float)
        forces = {}
        for k, one in enumerate(joints):
            first, second = found[:, 2 * k], found[:, 2 * k + 1]
            forces[one.name] = first + 1j * second if one.normal is None else first * one.normal
        return Held(np.asarray(found[:, -1] * machine.extent), forces)


def _by(link: LinkMotion, rate: Floats, change: Floats) -> LinkMotion:
    """A link's motion by another parameter, of which its own one has these derivatives."""
    return replace(
        link,
        velocity=link.velocity * rate,
        rate=link.rate * rate,
        acceleration=link.acceleration * rate**2 + link.velocity * change,
        rate_change=link.rate_change * rate**2 + link.rate * change,
    )


def joints_of(linkage: Linkage, motor: Motor, machine: LinkMotions) -> list[Joint]:
    """The seven joints of a six-bar: A, D, C, B of the linkage, M the motor's shaft, K between crank and rod, Q on the link.

    A slide of a rail is A or B too, and so is the pin of a slot's block; its slide in the body is D or C.
    """
    links, body, found = machine.links, machine.links["coupler"], []
    for (name, guide), fixed, moving in zip(linkage.by_coupler.named_guides, "AB", "DC"):
        ground: tuple[Complexes, Complexes | None]
        on_body: tuple[Complexes, Complexes | None]
        pin = body.place(guide.body_point)
        if isinstance(guide, Circle):
            ground, on_body = (links[name].origin, None), (pin, None)
        elif isinstance(guide, Rail):
            across = np.full(pin.shape, 1j * np.exp(1j * guide.direction))
            ground, on_body = (pin, across), (pin, None)
        else:
            pin = np.full(pin.shape, guide.pin, dtype=complex)
            across = 1j * body.direction * np.exp(1j * guide.body_direction)
            ground, on_body = (pin, None), (pin, across)
        found += [Joint(fixed, GROUND, name, *ground), Joint(moving, name, "coupler", *on_body)]
    if linkage.is_four_bar:  # along the loop
        found[2:] = found[:1:-1]
    return found + rod_joints(motor, machine)


def rod_joints(motor: Motor, machine: LinkMotions) -> list[Joint]:
    """M, K and Q."""
    links, rod = machine.links, machine.links[ROD]
    return [
        Joint("M", GROUND, MOTOR_CRANK, links[MOTOR_CRANK].origin),
        Joint("K", MOTOR_CRANK, ROD, rod.origin),
        Joint("Q", ROD, motor.link, rod.place(complex(motor.rod))),
    ]
