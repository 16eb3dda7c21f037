"""Springs that take load off a drive: those of zero free length that carry it in every position, and real ones of a catalogue.

Of zero free length, in closed form: the plane of motion is vertical. With e1, e2, e3 the directions of crank, coupler and
rocker every point is ``a0 + a1 e1 + a2 e2``, so masses have the potential ``const + Re(W1 e1 + W2 e2)``, and with e2 taken out
in favour of e3 ``Re(V1 e1 + V3 e3)``: two pendulums on fixed pivots. A spring from the ground at s to p e1 on the crank gives
``-k Re(conj(s - A) p e1)``. Two such springs, on crank and rocker, balance any four-bar; one alone does so only under a
condition on signs (published: Kuo, Mechanism and LinkMotions Theory 214, 106140; derived anew).

A body on guides has two such pendulums as well: a crank about its pivot, a block about its pin, and the body about the pin that a
slider carries. A spring there from s to p e1 gives -k Re(conj(s) p e1), on a slider too, which does not turn. With a circle among
the guides, or two rails, every weight is theirs. What weighs along the rail beside a slot, or between two slots, is not.

Real ones are placed by least squares of the torque. A spring of length l pulls with ``preload + stiffness (l - free_length)``;
a gas spring's pull is negative. The drive gives what the load asks for and stretches the spring besides: ``T + F(l) dl/dphi``.
Its ends are looked for on a grid, then by a descent with exact derivatives within boxes, away from pivots and with every length
between the shortest and the longest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.drives.actuator import descended, lengths_and_arms, slopes_of_leverage
from synthesis.drives.links import GROUND, LinkMotions
from synthesis.guides import Circle, Rail
from synthesis.linkage import Linkage
from synthesis.mechanism import Box
from synthesis.studies.forces import Load
from synthesis.work import Work

_NONE = 1e-12
"""A part of the potential this small beside all of it is none."""
_LEFT = 1e-9
"""Part of the largest torque that springs on guides may leave: rounding."""


@dataclass(frozen=True)
class Spring:
    """A spring between two links; it pulls with ``preload + stiffness (length - free_length)``, a negative pull pushes.

    ``points`` are in the links' frames, of the ground in the plane.
    """

    between: tuple[str, str]
    points: tuple[complex, complex]
    stiffness: float
    free_length: float = 0.0
    preload: float = 0.0

    def force(self, length: Floats) -> Floats:
        """Its pull at some lengths."""
        return self.preload + self.stiffness * (length - self.free_length)


@dataclass(frozen=True)
class Potential:
    """Of the masses and the force on a four-bar: W1, W2 and V1, V3 of the module's head."""

    linkage: Linkage
    w1: complex
    w2: complex

    @property
    def v1(self) -> complex:
        """Of the crank, where crank and rocker carry all."""
        one, two, _, _ = self.linkage.links
        return self.w1 - self.w2 * one / two

    @property
    def v3(self) -> complex:
        """Of the rocker, where crank and rocker carry all."""
        _, two, three, _ = self.linkage.links
        return self.w2 * three / two


def potential_of(linkage: Linkage, load: Load) -> Potential:
    """The potential of a load's masses and of its force; a torque has none that springs balance in every position."""
    one, two, three, _ = linkage.links
    w1 = w2 = 0j

    def add(pull: complex, link: str, point: complex) -> None:
        nonlocal w1, w2
        a1, a2 = {
            "crank": (point, 0j),
            "coupler": (complex(one), point),
            "rocker": (point * one / three, point * two / three),
        }[link]
        w1, w2 = w1 - np.conj(pull) * a1, w2 - np.conj(pull) * a2

    if linkage.mounted:
        add(load.force, "coupler", linkage.arm)
    weights = [(mass.link, mass.at, mass.mass * load.gravity) for mass in load.masses]
    for link, point, force in [*load.forces, *weights]:
        if link == "body":
            link, point = "coupler", linkage.arm + point * np.exp(1j * (linkage.body_offset or 0.0))
        add(force, link, point)
    return Potential(linkage, complex(w1), complex(w2))


def two_springs(potential: Potential, stiffness: float | None = None) -> list[Spring]:
    """Ground to crank and ground to rocker: always possible; one is left out where its part is nothing.

    They take hold at the crank pin and at the middle of the rocker. Without a stiffness each is such that its ground end is
    as far from the pivot as the other end.
    """
    linkage = potential.linkage
    one, _, three, _ = linkage.links
    whole = abs(potential.v1) + abs(potential.v3)
    springs = []
    for link, pivot, part, point in (
        ("crank", linkage.pivot_a, potential.v1, one),
        ("rocker", linkage.pivot_b, potential.v3, three / 2),
    ):
        if abs(part) > _NONE * whole:
            rate = abs(part) / point**2 if stiffness is None else stiffness
            springs.append(
                Spring((GROUND, link), (complex(pivot + np.conj(part / (rate * point))), complex(point)), float(rate))
            )
    return springs


def one_spring(potential: Potential, between: tuple[str, str]) -> Spring | float:
    """The only spring of its kind that balances, or the negative stiffness that it would have (infinite: there is none).

    ``between``: ("ground", "coupler"), ("crank", "rocker"), ("ground", "crank") or ("ground", "rocker").
    """
    linkage = potential.linkage
    one, two, three, _ = linkage.links
    whole = abs(potential.w1) + abs(potential.w2)
    a, b = complex(linkage.pivot_a), linkage.pivot_b
    ground = a - b
    match between:
        case ("ground", "coupler"):
            q1, q2 = potential.w1 / np.conj(ground), potential.w2 / np.conj(ground)
            if min(abs(q1.imag), abs(q2.imag)) <= _NONE * (abs(q1) + abs(q2)):
                return np.inf
            place = one * q2.imag / q1.imag
            rate = (q2.real * q1.imag / q2.imag - q1.real) / (one * (1 - place / two))
            if not rate > 0:
                return float(rate)
            anchor = b + np.conj(potential.w2) / (rate * place)
            return Spring(between, (complex(anchor), complex(place)), float(rate))
        case ("crank", "rocker"):
            qa, qb = potential.v1 / np.conj(ground), potential.v3 / np.conj(ground)
            if min(abs(qa.imag), abs(qb.imag)) <= _NONE * (abs(qa) + abs(qb)):
                return np.inf
            share = -qb.imag / qa.imag
            y = (qb.real + share * qa.real) / (share**2 / three - share / one)
            point = share * y / three - qa.real - 1j * qa.imag
            rate = abs(point) ** 2 / y
            if not rate > 0:
                return float(rate)
            return Spring(between, (complex(point / rate), complex(share * point / rate)), float(rate))
        case ("ground", "crank" | "rocker"):
            mine, other = (potential.v1, potential.v3) if between[1] == "crank" else (potential.v3, potential.v1)
            if abs(other) > _NONE * whole or abs(mine) <= _NONE * whole:
                return np.inf
            return next(spring for spring in two_springs(potential) if spring.between == between)
    return np.inf


# -- pendulums -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Pendulum:
    """A link that turns about a point of what it is sprung to, and whose part U of the potential is Re(U e)."""

    between: tuple[str, str]
    pivot: complex
    """In the frame of the first link."""
    level: complex
    """Direction of that frame, which does not turn."""
    joint: complex
    """The pivot in the frame of the second link."""
    arm: float
    """How far from it the spring takes hold."""
    direction: Complexes
    rate: Floats

    @property
    def rows(self) -> Floats:
        """Derivatives of Re(U e) by the drive, for both parts of U, (n, 2)."""
        return np.column_stack([-self.direction.imag * self.rate, -self.direction.real * self.rate])

    def spring(self, part: complex, stiffness: float | None) -> Spring:
        """That which cancels Re(U e)."""
        rate = abs(part) / self.arm**2 if stiffness is None else stiffness
        end = self.pivot + np.conj(part / (rate * self.arm)) / self.level
        return Spring(self.between, (complex(end), self.joint + self.arm), float(rate))


def _pendulums(linkage: Linkage | None, machine: LinkMotions) -> list[_Pendulum]:
    """A link on each circle, and one of those that turn with the body: a block, or else the body on a slider. Or on a hinge."""
    if linkage is None:
        arm, links = machine.extent / 2, machine.links.values()
        return [
            _Pendulum((GROUND, one.name), one.origin[0], 1 + 0j, 0j, arm, one.direction, one.rate) for one in links
        ]
    first, body, second = linkage.link_names
    found, turning = [], []
    for guide, name in zip(linkage.guides, (first, second)):
        if isinstance(guide, Rail):
            link, level = machine.links[body], complex(machine.links[name].direction[0])
            turning.append(
                _Pendulum((name, body), 0j, level, guide.body_point, machine.extent / 4, link.direction, link.rate)
            )
            continue
        link = machine.links[name]
        pivot, arm = (guide.pivot, guide.radius) if isinstance(guide, Circle) else (guide.pin, machine.extent / 4)
        one = _Pendulum((GROUND, name), complex(pivot), 1 + 0j, 0j, arm, link.direction, link.rate)
        if isinstance(guide, Circle):
            found.append(one)
        else:
            turning.insert(0, one)
    return found + turning[:1]


def springs_on_pendulums(
    linkage: Linkage | None, machine: LinkMotions, torque: Floats, stiffness: float | None = None
) -> list[Spring] | None:
    """Springs that balance what a load asks, (n,), of the drive of a linkage on guides; None where no such springs do.

    ``linkage``: None for a link on a hinge.

    The parts of the potential are read off the torque: where the pendulums carry all of it nothing is left.
    """
    if not np.all(np.isfinite(torque)):
        return None
    pendulums = _pendulums(linkage, machine)
    rows = np.concatenate([one.rows for one in pendulums], axis=1)
    size = np.abs(rows).max()
    parts = np.linalg.lstsq(rows / size, torque / size, rcond=None)[0]
    largest = np.abs(torque).max()
    if np.abs(rows @ parts - torque).max() > _LEFT * largest:
        return None
    found = []
    for one, (real, imaginary) in zip(pendulums, parts.reshape(-1, 2)):
        part = complex(real, imaginary)
        if abs(part) * np.abs(one.rate).max() > _LEFT * largest:
            found.append(one.spring(part, stiffness))
    return found


# -- springs of a catalogue -----------------------------------------------------------------------------------------------


_GRID, _DIRECTIONS, _RADII = 12, 12, np.array([0.3, 0.6, 0.95])
"""The grid: points of a box in each direction; directions and distances on a link."""
_DESCENTS = 4
"""Descents for each row of the catalogue on each pair of links."""
_ROWS, _ROWS_OF_PAIR = 6, 2
"""Rows for which descents are made: the best of all pairs of links, and the best of each pair."""
_BEHAVIOUR_DESCENTS = 24
"""Descents for each row and pair of links with a behaviour, from different ends on the first link: few placements show it."""
_VIOLATED = 1e3
"""Cost on the grid of a violated behaviour, per part of the rms torque without springs or of the longest length."""
_TURNS = 2
"""Of placing springs one after the other, before all are placed together."""
_STEPS = 500
"""Of a descent at most."""
_NEARLY_FITS = 0.2
"""Fraction of the longest length by which a placement of the grid may leave the range of lengths at the start of a descent."""
_DIGITS, _GAIN = 9, 1e-6
"""Of sums of squares on the grid, over those without a spring; and the part of the rms torque that counts as better."""
_HAIR = 1e-6
"""Of the largest length: by so much lengths stay inside their range at the positions looked at."""


class SpringRow(NamedTuple):
    """A spring of a catalogue: force in tension ``preload + stiffness (l - free_length)`` between two lengths."""

    name: str
    stiffness: float
    free_length: float
    preload: float
    shortest: float
    longest: float
    price: float | None = None

    @property
    def offset(self) -> float:
        """Force in tension extrapolated to length 0."""
        return self.preload - self.stiffness * self.free_length


class Room(NamedTuple):
    """Where a spring may take hold.

    ``box``: of its end on the ground. ``reach``: its other ends are at most so far from their frame's origin. ``clear``: every
    end is at least so far from the pivots, and the origins, of what it is on.
    """

    box: Box
    reach: float
    clear: float


@dataclass(frozen=True)
class Behaviour:
    """Limits on the torque that the drive gives once the springs are mounted, shape (n,) over the motion.

    Attributes
    ----------
    sense : float
        1 if the drive's coordinate rises from the first position to the last, -1 if it falls.
    margins : tuple of float
        Torques with which the linkage is pressed onto its stop at the first and the last position, if these must hold.
    holds_first, holds_last : bool
        The linkage rests on its stop at the first (last) position without a drive.
    torque_max : ndarray or None
        Largest absolute torque at each position.
    offset : ndarray or float
        Torque that is added to the given ones: a search that approximates a wanted torque works with differences from it.
    """

    sense: float
    margins: tuple[float, float]
    holds_first: bool = False
    holds_last: bool = False
    torque_max: Floats | None = None
    offset: Floats | float = 0.0

    def rows(self, torque: Floats) -> Floats:
        """Return values that are at least 0 if the torque (..., n) satisfies the limits, shape (..., m)."""
        found, torque = [], torque + self.offset
        if self.holds_first:
            found.append(self.sense * torque[..., :1] - self.margins[0])
        if self.holds_last:
            found.append(-self.sense * torque[..., -1:] - self.margins[1])
        if self.torque_max is not None:
            found += [self.torque_max - torque, self.torque_max + torque]
        return np.concatenate(found, axis=-1)

    def slopes(self, slopes: Floats) -> Floats:
        """Return the derivatives of `rows` from the derivatives of the torque, (n, unknowns)."""
        found = []
        if self.holds_first:
            found.append(self.sense * slopes[:1])
        if self.holds_last:
            found.append(-self.sense * slopes[-1:])
        if self.torque_max is not None:
            found += [-slopes, slopes]
        return np.concatenate(found)

    def violation(self, torque: Floats) -> Floats:
        """Return the largest violation of the limits by torques (..., n), at least 0, as a torque."""
        return np.maximum(-self.rows(torque).min(axis=-1), 0.0)


@dataclass(frozen=True)
class Fitted:
    """Springs in their places, and the drive's torque with them."""

    springs: tuple[Spring, ...]
    kinds: tuple[SpringRow | None, ...]
    lengths: tuple[Floats, ...]
    torque: Floats

    @property
    def rms(self) -> float:
        """Root mean square of the torque that remains."""
        return _rms(self.torque)


def spring_torque(machine: LinkMotions, spring: Spring) -> tuple[Floats, Floats]:
    """Lengths of a spring over the way, and what the drive must give because of it, (n,) each."""
    ends = list(zip(spring.between, spring.points))
    first, second = (machine.end(*one) for one in ends)
    v = second - first
    speeds = [0j if name == GROUND else machine.link(name).speed(point) for name, point in ends]
    speed, length = speeds[1] - speeds[0], np.abs(v)
    if spring.free_length == 0 and spring.preload == 0:
        return length, spring.stiffness * np.real(np.conj(v) * speed)
    with np.errstate(divide="ignore", invalid="ignore"):
        return length, spring.force(length) * np.real(np.conj(v) * speed) / length


def fitted(
    machine: LinkMotions, torque: Floats, springs: list[Spring], kinds: list[SpringRow] | None = None
) -> Fitted:
    """Springs at their places, and what they leave of a torque."""
    both = [spring_torque(machine, one) for one in springs]
    left = torque + sum((one for _, one in both), np.zeros(torque.size))
    names: tuple[SpringRow | None, ...] = tuple(kinds) if kinds else (None,) * len(springs)
    return Fitted(tuple(springs), names, tuple(length for length, _ in both), left)


Between = tuple[str, str]
"""The two links that a spring joins."""


def pairs_of(machine: LinkMotions) -> list[Between]:
    """Return every pair of links, the ground among them, between which a spring can do work."""
    return list(combinations((GROUND, *machine.links), 2))


class _Start(NamedTuple):
    """A row of the catalogue on a pair of links, with placements of the grid at which descents begin."""

    cost: float
    between: Between
    kind: SpringRow
    ends: list[tuple[complex, complex]]


def best_spring(
    machine: LinkMotions,
    torque: Floats,
    betweens: Sequence[Between],
    kinds: list[SpringRow],
    room: Room,
    work: Work | None = None,
    behaviour: Behaviour | None = None,
) -> Fitted | str:
    """Find the spring of a catalogue, the pair of links and its ends that leave the least rms torque.

    Parameters
    ----------
    machine : LinkMotions
    torque : ndarray, shape (n,)
        What the drive gives without the spring.
    betweens : sequence of pairs of str
        Pairs of links to try.
    kinds : list of SpringRow
        The catalogue.
    room : Room
        Where the ends may be.
    work : Work, optional
        The search returns the best known placement once its time is up.
    behaviour : Behaviour, optional
        Limits on the torque that remains; placements that satisfy them come before all others.

    Returns
    -------
    Fitted or str
        The spring, or a sentence with the reason why no row fits.
    """
    starts: list[_Start] = []
    nearest: tuple[float, float, float, Between] | None = None
    for between in betweens:
        if starts and work is not None and work.expired():
            break
        found, spread = _screened(machine, torque, between, kinds, room, behaviour)
        starts += found
        if nearest is None or spread[0] < nearest[0]:
            nearest = (*spread, between)
    if not starts:
        assert nearest is not None
        change, low, high, (first, second) = nearest
        where = f" between {first} and {second}" if len(betweens) == 1 else " between any two links"
        return (
            f"no spring of {len(kinds)} fits{where}: the smallest change of length there is {change:.4g}, "
            f"and lengths range from {low:.4g} to {high:.4g}"
        )
    best: tuple[tuple[float, float, float], Between, SpringRow, complex, complex] | None = None
    for start in _promising(starts):
        part = _Placing(machine, start.between, start.kind, room)
        for ends in start.ends:
            if work is not None and work.expired() and best is not None:
                break
            rank, z = _together([part], torque, part.start(*ends), behaviour)
            if best is None or rank < (*best[0][:2], best[0][2] * (1 - _GAIN)):
                best = (rank, start.between, start.kind, *part.ends(z))
    assert best is not None
    if best[0][0] > 0:  # no spring both fits and behaves: the best fit shows what is missing
        return best_spring(machine, torque, betweens, kinds, room, work)
    _, between, kind, ground, pin = best
    spring = Spring(between, (ground, pin), kind.stiffness, kind.free_length, kind.preload)
    return fitted(machine, torque, [_named(machine, spring)], [kind])


def _promising(starts: list[_Start]) -> list[_Start]:
    """Return the starts with the lowest cost of all, and the best starts of each pair of links."""
    starts = sorted(starts, key=lambda start: start.cost)
    chosen = {id(start) for start in starts[:_ROWS]}
    for between in {start.between for start in starts}:
        chosen |= {id(start) for start in [one for one in starts if one.between == between][:_ROWS_OF_PAIR]}
    return [start for start in starts if id(start) in chosen]


def _screened(
    machine: LinkMotions,
    torque: Floats,
    between: Between,
    kinds: list[SpringRow],
    room: Room,
    behaviour: Behaviour | None,
) -> tuple[list[_Start], tuple[float, float, float]]:
    """Evaluate the rows of a catalogue on a grid of placements on two links.

    The torque of a spring is linear in its stiffness and its force at length 0, so that sums over the motion are made once for
    all rows.

    Returns
    -------
    starts : list of _Start
        The rows that fit somewhere.
    spread : tuple of float
        Smallest change of length on the grid, and the smallest and the largest length.
    """
    first, second = between
    grounds, pins = _grid(machine, first, second, room)
    if not grounds.size:
        return [], (np.inf, 0.0, 0.0)
    length, arm = lengths_and_arms(machine.seen(second, first), 0j, grounds, pins)
    shortest, longest = length.min(axis=1), length.max(axis=1)
    pull = length * arm
    whole = float(np.dot(torque, torque)) or 1.0
    by_arm, by_pull = arm @ torque, pull @ torque
    arms, pulls, both = (np.einsum("mn,mn->m", a, b) for a, b in ((arm, arm), (pull, pull), (arm, pull)))
    starts = []
    for kind in kinds:
        fits = (shortest >= kind.shortest) & (longest <= kind.longest)
        a, k = kind.offset, kind.stiffness
        square = whole + a * a * arms + k * k * pulls + 2 * (a * by_arm + k * by_pull + a * k * both)
        if behaviour is None:
            usable = np.flatnonzero(fits)
            cost = square[usable] / whole
        else:
            # few placements show the behaviour, and a descent moves other placements into the range of lengths
            beyond = np.maximum(kind.shortest - shortest, longest - kind.longest)
            usable = np.flatnonzero(beyond < _NEARLY_FITS * kind.longest)
            left = torque + a * arm[usable] + k * pull[usable]
            lacks = behaviour.violation(left) / np.sqrt(whole / torque.size)
            lacks = lacks + np.maximum(beyond[usable], 0.0) / kind.longest
            cost = square[usable] / whole + _VIOLATED * lacks
        if not usable.size:
            continue
        # of equal placements the first, whatever rounding makes of them
        cost = np.round(cost, _DIGITS)
        order = usable[np.argsort(cost, kind="stable")]
        if behaviour is not None:
            order = order[np.sort(np.unique(grounds[order], return_index=True)[1])]
        order = order[: _DESCENTS if behaviour is None else _BEHAVIOUR_DESCENTS]
        ends = [(complex(grounds[m]), complex(pins[m])) for m in order]
        starts.append(_Start(float(cost.min()), between, kind, ends))
    return starts, (float((longest - shortest).min()), float(shortest.min()), float(longest.max()))


def _named(machine: LinkMotions, spring: Spring) -> Spring:
    """A spring whose first point is told in the plane at the first sample, with it in its link's frame."""
    return replace(spring, points=(machine.point_on(spring.between[0], spring.points[0]), spring.points[1]))


def _grid(machine: LinkMotions, first: str, second: str, room: Room) -> tuple[Complexes, Complexes]:
    """All pairs of places of the first end, in the plane at the first sample, and points of the second link."""
    angles = np.exp(1j * np.linspace(0, 2 * np.pi, _DIRECTIONS, endpoint=False))
    around = (np.maximum(_RADII * room.reach, room.clear)[:, None] * angles).ravel()
    if first == GROUND:
        left, bottom, right, top = room.box
        x, y = np.meshgrid(np.linspace(left, right, _GRID), np.linspace(bottom, top, _GRID))
        grounds = (x + 1j * y).ravel()
        for pivot in _pivots(machine):
            grounds = grounds[np.abs(grounds - pivot) >= room.clear]
    else:
        link = machine.link(first)
        grounds = link.origin[0] + link.direction[0] * around
    return np.repeat(grounds, around.size), np.tile(around, grounds.size)


def _pivots(machine: LinkMotions) -> list[complex]:
    return [link.pivot for link in machine.links.values() if link.pivot is not None]


class _Placing:
    """One spring's part of a fit: lengths and torque with exact derivatives by its four unknowns, its ends over the size."""

    def __init__(self, machine: LinkMotions, between: tuple[str, str], kind: SpringRow, room: Room) -> None:
        first, second = between
        self.link, self.kind, self.room = machine.seen(second, first), kind, room
        left, bottom, right, top = room.box
        self.size = max(right - left, top - bottom, room.reach)
        self.origin = None if first == GROUND else complex(machine.link(first).origin[0])
        self.centres = _pivots(machine) if self.origin is None else [self.origin]
        self.low, self.high = kind.shortest + _HAIR * kind.longest, kind.longest * (1 - _HAIR)
        free: list[tuple[float | None, float | None]] = [(None, None)] * 2
        box: list[tuple[float | None, float | None]] = [
            (left / self.size, right / self.size),
            (bottom / self.size, top / self.size),
        ]
        self.bounds = (box if self.origin is None else free) + free

    def ends(self, z: Floats) -> tuple[complex, complex]:
        return complex(z[0], z[1]) * self.size, complex(z[2], z[3]) * self.size

    def start(self, ground: complex, pin: complex) -> Floats:
        return np.array([ground.real, ground.imag, pin.real, pin.imag]) / self.size

    def torque(self, z: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Length and its derivatives (n, 4), torque and its derivatives (n, 4)."""
        one, other = self.ends(z)
        link, size, kind = self.link, self.size, self.kind
        v = link.place(other) - one
        length = np.maximum(np.abs(v), 1e-12 * size)
        along = v / length
        speed = link.speed(other)
        arm = np.real(np.conj(along) * speed)
        change, arms = slopes_of_leverage(link, along, length, speed, size)
        force = kind.preload + kind.stiffness * (length - kind.free_length)
        return length, change, force * arm, kind.stiffness * change * arm[:, None] + force[:, None] * arms

    def rows(self, z: Floats) -> tuple[Floats, Floats]:
        """What must not be negative: lengths, and distances squared; and its derivatives."""
        length, change, _, _ = self.torque(z)
        one, other = self.ends(z)
        room, size = self.room, self.size
        clear, reach = room.clear**2, room.reach**2
        mine = [abs(other) ** 2 - clear, reach - abs(other) ** 2]
        slopes = [[0, 0, other.real, other.imag], [0, 0, -other.real, -other.imag]]
        for centre in self.centres:
            away = one - centre
            mine.append(abs(away) ** 2 - clear)
            slopes.append([away.real, away.imag, 0, 0])
            if self.origin is not None:
                mine.append(reach - abs(away) ** 2)
                slopes.append([-away.real, -away.imag, 0, 0])
        values = [(length - self.low) / size, (self.high - length) / size, np.array(mine) / size**2]
        return np.concatenate(values), np.concatenate([change / size, -change / size, 2 * np.array(slopes) / size])


def _together(
    parts: list[_Placing], torque: Floats, begin: Floats, behaviour: Behaviour | None = None
) -> tuple[tuple[float, float, float], Floats]:
    """Descend to the nearest optimum of some springs together.

    Returns
    -------
    rank : tuple of float
        Violations of the ranges of lengths and places, and of the behaviour, 0 within rounding; then the rms torque that remains.
    z : ndarray
        The unknowns, four per spring; ``begin`` where the descent ended with a higher rank.
    """
    rms = float(np.sqrt(np.mean(torque**2))) or 1.0
    four = [slice(4 * k, 4 * k + 4) for k in range(len(parts))]

    def cost(z: Floats) -> tuple[float, Floats]:
        found = [one.torque(z[some]) for one, some in zip(parts, four)]
        left = (torque + sum(one[2] for one in found)) / rms
        slopes = np.concatenate([one[3] for one in found], axis=1) / rms
        return float(np.mean(left**2)), np.asarray(2 * left @ slopes / left.size)

    def rows(z: Floats) -> Floats:
        return np.concatenate([one.rows(z[some])[0] for one, some in zip(parts, four)])

    def left_of(z: Floats) -> Floats:
        return np.asarray(torque + sum(one.torque(z[some])[2] for one, some in zip(parts, four)))

    def slopes(z: Floats) -> Floats:
        found = [one.rows(z[some])[1] for one, some in zip(parts, four)]
        table = np.zeros((sum(len(one) for one in found), z.size))
        row = 0
        for one, some in zip(found, four):
            table[row : row + len(one), some] = one
            row += len(one)
        return table

    def behaves(z: Floats) -> Floats:
        assert behaviour is not None
        return behaviour.rows(left_of(z)) / rms

    def behaves_slopes(z: Floats) -> Floats:
        assert behaviour is not None
        found = [one.torque(z[some])[3] for one, some in zip(parts, four)]
        return behaviour.slopes(np.concatenate(found, axis=1)) / rms

    def rank(z: Floats) -> tuple[float, float, float]:
        beyond = max(-float(rows(z).min()), 0.0)
        lacks = 0.0 if behaviour is None else float(behaviour.violation(left_of(z))) / rms
        return (
            beyond if beyond > _HAIR / 2 else 0.0,
            lacks if lacks > _HAIR else 0.0,
            float(np.sqrt(cost(z)[0])) * rms,
        )

    bounds = [bound for one in parts for bound in one.bounds]
    limits = [{"type": "ineq", "fun": rows, "jac": slopes}]
    if behaviour is not None:
        limits.append({"type": "ineq", "fun": behaves, "jac": behaves_slopes})
    z = descended(cost, begin, bounds, limits, 1e-12, _STEPS)
    if not np.all(np.isfinite(z)) or rank(z) > rank(begin):
        z = begin
    return rank(z), z


def best_pair(
    machine: LinkMotions,
    torque: Floats,
    betweens: list[Between],
    kinds: list[SpringRow],
    room: Room,
    work: Work | None = None,
    behaviour: Behaviour | None = None,
) -> Fitted | str:
    """Find springs on several pairs of links that work together.

    They are placed one after the other, each against what the others leave, some turns; then all at once. Arguments as of
    `best_spring`, with a spring on each pair of links.
    """
    placed: dict[int, Fitted] = {}
    gives, left = [0 * torque for _ in betweens], torque
    for _ in range(_TURNS):
        for k, between in enumerate(betweens):
            others = torque + sum(gives[:k] + gives[k + 1 :])
            found = best_spring(machine, others, [between], kinds, room, work)
            if isinstance(found, str):
                return found
            if k not in placed or found.rms < _rms(left):
                placed[k], gives[k], left = found, found.torque - others, found.torque
        if work is not None and work.expired():
            break
    springs = [one.springs[0] for one in placed.values()]
    rows = [kind for one in placed.values() for kind in one.kinds if kind is not None]
    parts = [_Placing(machine, between, kind, room) for between, kind in zip(betweens, rows)]
    # unknowns have the first end in the plane at the first sample
    levels = [complex(machine.end(one.between[0], one.points[0])[0]) for one in springs]
    begin = [part.start(level, one.points[1]) for part, level, one in zip(parts, levels, springs)]
    _, z = _together(parts, torque, np.concatenate(begin), behaviour)
    for k, (part, spring) in enumerate(zip(parts, springs)):
        springs[k] = _named(machine, replace(spring, points=part.ends(z[4 * k : 4 * k + 4])))
    return fitted(machine, torque, springs, rows)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
