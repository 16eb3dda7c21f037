"""A motor that turns on and on, and a rod: the two links that make a linkage swing between its ends, and how well they do.

A motor's crank a about O and a rod b to a pin Q of the linkage reach the ends of its swing where ``|OQ|`` is ``b - a`` and
``b + a``: an actuator of retracted length b - a and stroke 2a goes through the same lengths. The rod's transmission angle is
that between rod and normal of Q's path: 90 degrees where it pulls along the path.

On a link that turns about a pivot the motor, the rod, the pin's radius c and the distance d of O from the pivot are a
crank-rocker; with h half the chord of the pin's way and e the angle QaOQb, which makes the time ratio (pi + e) / (pi - e)::

    a = h sin(zeta) / cos(e/2)        b = h cos(zeta) / |sin(e/2)|        0 < zeta < pi/2

and zeta is chosen for the best transmission angle. On other links O, a and b are found by search.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Flags, Floats
from synthesis.drives.actuator import Actuator, Box, Question, Wanted
from synthesis.drives.links import LinkMotion
from synthesis.fourbar.kinematics import grashof_excesses, transmission_angle_over
from synthesis.target import TURN, Interval
from synthesis.work import Work

_ZETAS = 2000
"""Values of zeta that are looked at before the best is closed in upon."""
_ROD = 3.0
"""Rod over pin radius for equal times, where any rod will do: at most 1.7 degrees worse than an endless one."""
_LOOSE = 1e-5
"""Of crank and rod together: by so much the ends of the way may differ from the dead centres."""
_OTHER_RODS = [2.5, 2.0, 1.6, 1.3, 1.1, 0.9, 4.0, 6.0]
LARGEST_RATIO = 5.0
"""Time ratio at most: the rod then stands at 60 degrees less than half the swing at best."""
_GRID, _SPARSE = 22, 5
"""Points of the grid of O, either way, and every which position of the motion is looked at there."""
_STROKES, _RODS = np.array([0.2, 0.4, 0.6, 0.8]), np.array([0.35, 1.0, 2.0, 4.0])
"""Sizes that are tried: 2a over the pin's longest way, and (b - a) over 2a."""


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
    e = np.pi * (time_ratio - 1) / (time_ratio + 1)

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
    low = np.maximum((crank - (rod - length)) * (crank + (rod - length)), 0.0)
    high = np.maximum((rod + length - crank) * (rod + length + crank), 0.0)
    beta = 2 * np.arctan2(np.sqrt(low), np.sqrt(high))
    beta[0] = beta[-1] = 0.0
    # at the motor: between its crank and the line to the pin
    near = np.maximum((rod - (crank - length)) * (rod + (crank - length)), 0.0)
    far = np.maximum((crank + length - rod) * (crank + length + rod), 0.0)
    gamma = 2 * np.arctan2(np.sqrt(near), np.sqrt(far))
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
) -> Driven | str:
    """The best motor and rod on a link that turns about a pivot, or why there is none.

    The transmission angle does not depend on the pin's radius nor on where it is around the pivot: these put the motor into its
    box. Without need the pin lies on the link's line.
    """
    assert link.pivot is not None
    turned = np.unwrap(np.angle(link.direction))
    swing = abs(float(turned[-1] - turned[0]))
    if np.min(np.diff(turned) * np.sign(turned[-1] - turned[0])) <= 0:
        return "the link turns back within the way: no motor drives it through"
    ratio = 1.0 if time_ratio is None else max(time_ratio, 1 / time_ratio)
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
    bisector = link.direction[0] * np.exp(0.5j * rising * swing)
    for found in known:
        for size in radii:
            for angle in turns:
                answers = []
                for extends in (True, False):
                    # extending counter-clockwise as it stands; the mirror image for either the other way or the other sense
                    place = found.motor if (rising > 0) == extends else found.motor.conjugate()
                    pin = complex(size * np.exp(1j * angle))
                    motor = complex(link.pivot + bisector * pin * place)
                    if box is None or _inside(motor, box):
                        answers.append(
                            driven(link, torque, motor, pin, size * found.crank, size * found.rod, extends)
                        )
                good = [one for one in answers if one is not None]
                if good:
                    return min(good, key=lambda one: float(np.abs(one.motor_torque).max()))
    return "no place of the pin puts the motor into motor_box"


def _inside(place: complex, box: Box) -> bool:
    return box[0] <= place.real <= box[2] and box[1] <= place.imag <= box[3]


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
    question = Question(link, at, np.zeros(at.size), Wanted(box, reach, 0.0), _GRID)
    turned = abs(link.direction[-1] - link.direction[0])
    most = abs(link.origin[-1] - link.origin[0]) + reach * turned
    angle = None if time_ratio is None else _angle_of(time_ratio)
    begun: list[tuple[float, Floats, bool, float]] = []
    sparse: Any = slice(None, None, _SPARSE)
    for stroke in (_STROKES * most).tolist():
        for retracted in (_RODS * stroke).tolist():
            grounds, pins, ways, sides, _ = question.families(Actuator(retracted, stroke))
            near = np.abs(pins) <= reach
            if not near.any():
                continue
            grounds, pins, ways, sides = grounds[near], pins[near], ways[near], sides[near]
            arm = question.arms(grounds, pins) * (question.sense * np.where(ways, 1.0, -1.0))[:, None]
            good = np.flatnonzero(arm.min(axis=1) > 0)
            if not good.size:
                continue
            grounds, pins, ways, sides = grounds[good], pins[good], ways[good], sides[good]
            worth = _sines(link, sparse, grounds, pins, ways, retracted, stroke, question.sense).min(axis=(0, 2))
            if angle is not None:
                worth -= 0.5 * np.abs(_turned(link, grounds, pins) - angle)
            for k in np.argsort(-worth)[:2]:
                sizes = np.array([grounds[k].real, grounds[k].imag, retracted, stroke]) / question.size
                begun.append((float(worth[k]), sizes, bool(ways[k]), float(sides[k])))
    if not begun:
        return "no point of the link has a distance from any point of motor_box that grows or shrinks all the way"
    begun.sort(key=lambda row: -row[0])
    best: Driven | None = None
    for _, sizes, way, side in begun[:5]:
        if work is not None and work.expired() and best is not None:
            break
        one = _improved(question, link, torque, sizes, way, side, angle)
        if one is not None and (best is None or one.least_angle > best.least_angle):
            best = one
    if best is None:
        wish = "" if time_ratio is None else f" with a time ratio of {time_ratio:g}"
        return f"no motor in motor_box was found whose rod drives the link both ways{wish}"
    return best


def _angle_of(time_ratio: float) -> float:
    ratio = max(time_ratio, 1 / time_ratio)
    return float(np.pi * (ratio - 1) / (ratio + 1))


def _turned(link: LinkMotion, motors: Complexes, pins: Complexes) -> Floats:
    """The angle QaOQb of pairs, its amount."""
    first, last = (link.origin[k] + link.direction[k] * pins - motors for k in (0, -1))
    return np.asarray(np.abs(np.angle(last * np.conj(first))))


def _sines(
    link: LinkMotion,
    some: slice,
    motors: Complexes,
    pins: Complexes,
    ways: Flags | bool,
    retracted: Any,
    stroke: Any,
    sense: float,
) -> Floats:
    """Sines of the transmission angle, (2, m, n), negative where the rod works against the way."""
    x, r, speed, rate = link.origin[some], link.direction[some], link.velocity[some], link.rate[some]
    q = np.asarray(pins)[:, None]
    v = x + r * q - np.asarray(motors)[:, None]
    moved = speed + 1j * rate * r * q
    a = np.broadcast_to(np.asarray(stroke) / 2, np.shape(pins))[:, None]
    b = np.broadcast_to(np.asarray(retracted) + np.asarray(stroke) / 2, np.shape(pins))[:, None]
    length = np.abs(v)
    cosine = np.clip((length**2 + b**2 - a**2) / (2 * length * b), -1, 1)
    sine = np.sqrt(1 - cosine**2)
    sign = sense * np.where(np.broadcast_to(ways, np.shape(pins)), 1.0, -1.0)[:, None]
    part = np.conj(v) * moved / (length * np.abs(moved)) * sign
    return np.stack([np.real(part * (cosine - 1j * side * sine)) for side in (1, -1)])


def _improved(
    question: Question, link: LinkMotion, torque: Floats, sizes: Floats, way: bool, side: float, angle: float | None
) -> Driven | None:
    """The nearest optimum from one place of the grid, by sequential quadratic programs; None where it fails."""
    from scipy.optimize import minimize

    size, n = question.size, question.at.size
    left, bottom, right, top = question.wanted.box
    reach = question.wanted.reach
    steps = np.concatenate([np.zeros((1, 4)), 1e-7 * np.eye(4)])

    def values(z: Floats) -> Floats:
        """Sines less t, room of the reach, and the angle QaOQb, at z and at a step of each unknown from it."""
        every = (z[:4] + steps) * size
        motors = every[:, 0] + 1j * every[:, 1]
        short, long = every[:, 2], every[:, 2] + every[:, 3]
        begin, end = (short, long) if way else (long, short)
        first, last = (np.conj(link.direction[k]) * (motors - link.origin[k]) for k in (0, -1))
        distance = np.abs(last - first)
        foot = ((begin - end) * (begin + end) / distance + distance) / 2
        height = np.maximum((begin - foot) * (begin + foot), 0.0)
        pins = first + (foot + 1j * side * np.sqrt(height)) * (last - first) / distance
        sines = _sines(link, slice(None), motors, pins, way, every[:, 2], every[:, 3], question.sense)
        sines[:, :, [0, -1]] = sines[0, :, [0, -1]].T
        meets = (begin - foot) * (begin + foot) / size**2
        rows = [*sines.transpose(0, 2, 1).reshape(2 * n, 5), 1 - np.abs(pins) ** 2 / reach**2, meets]
        if angle is not None:
            rows.append(_turned(link, motors, pins) - angle)
        return np.array(rows)

    seen: dict[bytes, Floats] = {}

    def known(z: Floats) -> Floats:
        key = z[:4].tobytes()
        if key not in seen:
            seen.clear()
            with np.errstate(all="ignore"):
                seen[key] = np.nan_to_num(values(z), nan=-1.0)
        return seen[key]

    def rows(z: Floats) -> Floats:
        found = known(z)[: 2 * n + 2, 0].copy()
        found[: 2 * n] -= z[4]
        return found

    def slopes(z: Floats) -> Floats:
        found = known(z)[: 2 * n + 2]
        table = np.empty((2 * n + 2, 5))
        table[:, :4] = (found[:, 1:] - found[:, :1]) / 1e-7
        table[:, 4] = -1.0
        table[2 * n :, 4] = 0.0
        return table

    begin = np.append(sizes, 0.0)
    begin[4] = known(begin)[: 2 * n, 0].min()
    limits = [{"type": "ineq", "fun": rows, "jac": slopes}]
    if angle is not None:
        limits.append(
            {
                "type": "eq",
                "fun": lambda z: known(z)[-1:, 0],
                "jac": lambda z: np.append((known(z)[-1, 1:] - known(z)[-1, 0]) / 1e-7, 0.0)[None],
            }
        )
    answer = minimize(
        lambda z: -z[4],
        begin,
        jac=lambda z: np.array([0, 0, 0, 0, -1.0]),
        bounds=[(left / size, right / size), (bottom / size, top / size), (1e-4, 1e3), (1e-4, 1e3), (-1, 1)],
        constraints=limits,
        method="SLSQP",
        options={"ftol": 1e-10, "maxiter": 60},
    )
    z = answer.x.copy()
    for _ in range(4 if angle is not None else 0):  # the times exactly, by the stroke
        off, slope = known(z)[-1, 0], (known(z)[-1, 4] - known(z)[-1, 0]) / 1e-7
        if abs(off) > 1e-3 or not slope:
            return None
        z[3] -= off / slope
    found = known(z)
    if found[: 2 * n + 2, 0].min() < -1e-7:
        return None
    x, y, retracted, stroke = (z[:4] * size).tolist()
    short, long = retracted, retracted + stroke
    motor, (begun, ended) = complex(x, y), (short, long) if way else (long, short)
    first, last = (complex(np.conj(link.direction[k]) * (motor - link.origin[k])) for k in (0, -1))
    distance = abs(last - first)
    foot = ((begun - ended) * (begun + ended) / distance + distance) / 2
    height = (begun - foot) * (begun + foot)
    if height < 0:
        return None
    pin = first + (foot + 1j * side * np.sqrt(height)) * (last - first) / distance
    return driven(link, torque, motor, complex(pin), stroke / 2, retracted + stroke / 2, way)
