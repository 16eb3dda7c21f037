"""Real springs that take load off a drive: tension and gas springs of a catalogue, placed by least squares of the drive's torque.

A spring of length l pulls with ``preload + stiffness (l - free_length)``; a gas spring's pull is negative. The drive gives what
the load asks for and stretches the spring besides: ``T + F(l) dl/dphi``. Its ends are looked for on a grid, then by a descent
with exact derivatives within boxes, away from pivots and with every length between the shortest and the longest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.drives.actuator import Box, forms_of
from synthesis.drives.balance import Spring
from synthesis.drives.links import GROUND, LinkMotion, Machine
from synthesis.work import Work

_GRID, _DIRECTIONS, _RADII = 12, 12, np.array([0.3, 0.6, 0.95])
"""The grid: points of a box, either way; directions and distances on a link."""
_DESCENTS = 4
"""Descents for a row."""
_ROWS = 6
"""Rows of a catalogue that descents are made for: those that are best on the grid."""
_HAIR = 1e-6
"""Of the largest length: by so much lengths stay inside their range at the positions looked at."""


class Kind(NamedTuple):
    """A spring of a catalogue: force in tension ``preload + stiffness (l - free_length)`` between two lengths."""

    name: str
    stiffness: float
    free_length: float
    preload: float
    shortest: float
    longest: float
    price: float | None = None


class Room(NamedTuple):
    """Where a spring may take hold.

    ``box``: of its end on the ground. ``reach``: its other ends are at most so far from their frame's origin. ``clear``: every
    end is at least so far from the pivots, and the origins, of what it is on.
    """

    box: Box
    reach: float
    clear: float


@dataclass(frozen=True)
class Fitted:
    """Springs in their places, and the drive's torque with them."""

    springs: tuple[Spring, ...]
    kinds: tuple[Kind | None, ...]
    lengths: tuple[Floats, ...]
    torque: Floats


def spring_torque(machine: Machine, spring: Spring) -> tuple[Floats, Floats]:
    """Lengths of a spring over the way, and what the drive must give because of it, (n,) each."""
    first, second = (_end(machine, name, point) for name, point in zip(spring.between, spring.points))
    v, speed = second[0] - first[0], second[1] - first[1]
    length = np.abs(v)
    if spring.free_length == 0 and spring.preload == 0:
        return length, spring.stiffness * np.real(np.conj(v) * speed)
    force = spring.preload + spring.stiffness * (length - spring.free_length)
    with np.errstate(divide="ignore", invalid="ignore"):
        return length, force * np.real(np.conj(v) * speed) / length


def fitted(machine: Machine, torque: Floats, springs: list[Spring], kinds: list[Kind] | None = None) -> Fitted:
    """Springs at their places, and what they leave of a torque."""
    both = [spring_torque(machine, one) for one in springs]
    left = torque + sum((one for _, one in both), np.zeros(torque.size))
    names: tuple[Kind | None, ...] = tuple(kinds) if kinds else (None,) * len(springs)
    return Fitted(tuple(springs), names, tuple(length for length, _ in both), left)


def _end(machine: Machine, name: str, point: complex) -> tuple[Complexes, Complexes]:
    if name == GROUND:
        still = np.zeros(machine.at.size, dtype=complex)
        return still + point, still
    link = machine.link(name)
    return link.place(point), link.speed(point)


def best_spring(
    machine: Machine,
    torque: Floats,
    between: tuple[str, str],
    kinds: list[Kind],
    room: Room,
    work: Work | None = None,
) -> Fitted | str:
    """The spring of a catalogue, and its places on two links, that leave the least rms torque; or why there is none."""
    first, second = between
    link = _seen(machine, first, second)
    grounds, pins = _grid(machine, first, second, room)
    slope, square = forms_of(link, 0j)
    product = np.conj(grounds) * pins
    basis = np.stack(
        [
            np.ones(grounds.size),
            grounds.real,
            grounds.imag,
            pins.real,
            pins.imag,
            product.real,
            product.imag,
            np.abs(grounds) ** 2 + np.abs(pins) ** 2,
        ],
        axis=1,
    )
    length = np.sqrt(np.maximum(basis @ square, 1e-300))
    arm = (basis @ slope) / length
    shortest, longest = length.min(axis=1), length.max(axis=1)
    tries: list[tuple[float, Kind, list[int]]] = []
    for kind in kinds:
        some = np.flatnonzero((shortest >= kind.shortest) & (longest <= kind.longest))
        if not some.size:
            continue
        left = torque + (kind.preload + kind.stiffness * (length[some] - kind.free_length)) * arm[some]
        cost = np.einsum("mn,mn->m", left, left)
        order = np.argsort(cost, kind="stable")[:_DESCENTS]
        tries.append((float(cost[order[0]]), kind, some[order].tolist()))
    if not tries:
        spread = float((longest - shortest).min()) if shortest.size else np.inf
        return (
            f"no spring of {len(kinds)} fits between {first} and {second}: the least change of length there is {spread:.4g}, "
            f"and lengths range from {float(shortest.min()):.4g} to {float(longest.max()):.4g}"
        )
    tries.sort(key=lambda row: row[0])
    best: tuple[float, Kind, complex, complex] | None = None
    for _, kind, some_ in tries[:_ROWS]:
        for k in some_:
            if work is not None and work.expired() and best is not None:
                break
            one = _placed(link, machine, torque, kind, complex(grounds[k]), complex(pins[k]), room, first)
            if best is None or one[0] < best[0]:
                best = (one[0], kind, one[1], one[2])
    assert best is not None
    _, kind, ground, pin = best
    spring = Spring(between, (ground, pin), kind.stiffness, kind.free_length, kind.preload)
    return fitted(machine, torque, [_named(machine, spring)], [kind])


def _seen(machine: Machine, first: str, second: str) -> LinkMotion:
    link = machine.link(second)
    return link if first == GROUND else link.seen_from(machine.link(first))


def _named(machine: Machine, spring: Spring) -> Spring:
    """A spring whose first point is told in the plane at the first sample, with it in its link's frame."""
    first = spring.between[0]
    if first == GROUND:
        return spring
    point = machine.link(first).point_at(spring.points[0])
    return Spring(spring.between, (point, spring.points[1]), spring.stiffness, spring.free_length, spring.preload)


def _grid(machine: Machine, first: str, second: str, room: Room) -> tuple[Complexes, Complexes]:
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


def _pivots(machine: Machine) -> list[complex]:
    return [link.pivot for link in machine.links.values() if link.pivot is not None]


def _placed(
    link: LinkMotion,
    machine: Machine,
    torque: Floats,
    kind: Kind,
    ground: complex,
    pin: complex,
    room: Room,
    first: str,
) -> tuple[float, complex, complex]:
    """The nearest optimum from one place: rms torque, and both ends; by sequential quadratic programs."""
    from scipy.optimize import minimize

    left, bottom, right, top = room.box
    size = max(right - left, top - bottom, room.reach)
    rms = float(np.sqrt(np.mean(torque**2))) or 1.0
    steps = np.array([-1, -1j, 0, 0]) * size  # of the first end; the second's turn with the link
    origins = [] if first == GROUND else [complex(machine.link(first).origin[0])]
    centres = _pivots(machine) if first == GROUND else origins
    low, high = kind.shortest + _HAIR * kind.longest, kind.longest * (1 - _HAIR)

    def parts(z: Floats) -> tuple[Floats, Floats, Floats, Floats, complex, complex]:
        one, other = complex(z[0], z[1]) * size, complex(z[2], z[3]) * size
        v = link.place(other) - one
        length = np.maximum(np.abs(v), 1e-12 * size)
        along = v / length
        speed = link.speed(other)
        arm = np.real(np.conj(along) * speed)
        turned = np.stack([np.zeros_like(v), np.zeros_like(v), link.direction, 1j * link.direction], axis=1) * size
        dv = turned + steps
        back = np.conj(along)[:, None]
        change = np.real(back * dv)
        dn = (dv - along[:, None] * change) / length[:, None]
        arms = np.real(np.conj(dn) * speed[:, None]) + np.real(back * 1j * link.rate[:, None] * turned)
        return length, arm, change, arms, one, other

    def cost(z: Floats) -> tuple[float, Floats]:
        length, arm, change, arms, _, _ = parts(z)
        force = kind.preload + kind.stiffness * (length - kind.free_length)
        left_ = (torque + force * arm) / rms
        slopes = (kind.stiffness * change * arm[:, None] + force[:, None] * arms) / rms
        return float(np.mean(left_**2)), np.asarray(2 * left_ @ slopes / left_.size)

    def rows(z: Floats) -> Floats:
        length, *_, one, other = parts(z)
        away = [abs(one - centre) ** 2 - room.clear**2 for centre in centres]
        mine = [abs(other) ** 2 - room.clear**2, room.reach**2 - abs(other) ** 2]
        if origins:
            mine.append(room.reach**2 - abs(one - origins[0]) ** 2)
        return np.concatenate([(length - low) / size, (high - length) / size, np.array([*mine, *away]) / size**2])

    def slopes(z: Floats) -> Floats:
        _, _, change, _, one, other = parts(z)
        away = [[(one - c).real, (one - c).imag, 0, 0] for c in centres]
        mine = [[0, 0, other.real, other.imag], [0, 0, -other.real, -other.imag]]
        if origins:
            mine.append([-(one - origins[0]).real, -(one - origins[0]).imag, 0, 0])
        return np.concatenate([change / size, -change / size, 2 * np.array([*mine, *away]) / size])

    box: list[tuple[float | None, float | None]] = [(None, None)] * 4
    if first == GROUND:
        box[:2] = [(left / size, right / size), (bottom / size, top / size)]
    begin = np.array([ground.real, ground.imag, pin.real, pin.imag]) / size
    answer: Any = minimize(
        cost,
        begin,
        jac=True,
        bounds=box,
        constraints=[{"type": "ineq", "fun": rows, "jac": slopes}],
        method="SLSQP",
        options={"ftol": 1e-12, "maxiter": 80},
    )
    z = answer.x
    if not np.all(np.isfinite(z)) or rows(z).min() < -_HAIR / 2 or cost(z)[0] > cost(begin)[0]:
        z = begin
    _, _, _, _, one, other = parts(z)
    return float(np.sqrt(cost(z)[0])) * rms, one, other


def best_pair(
    machine: Machine,
    torque: Floats,
    betweens: list[tuple[str, str]],
    kinds: list[Kind],
    room: Room,
    work: Work | None = None,
    turns: int = 3,
) -> Fitted | str:
    """Springs on several pairs of links together: one after the other, each against what the others leave, some turns."""
    placed: list[Fitted | None] = [None] * len(betweens)
    left = torque
    for _ in range(turns):
        for k, between in enumerate(betweens):
            others = sum(
                (one.torque - torque for j, one in enumerate(placed) if one and j != k), np.zeros(torque.size)
            )
            found = best_spring(machine, torque + others, between, kinds, room, work)
            if isinstance(found, str):
                return found
            before = placed[k]
            mine = fitted(machine, torque, list(found.springs), [kind for kind in found.kinds if kind is not None])
            if before is None or _rms(torque + others + mine.torque - torque) < _rms(left):
                placed[k] = mine
                left = mine.torque + others
        if work is not None and work.expired():
            break
    every = [one for one in placed if one is not None]
    return fitted(
        machine,
        torque,
        [spring for one in every for spring in one.springs],
        [kind for one in every for kind in one.kinds if kind is not None],
    )


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
