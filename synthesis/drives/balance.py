"""Springs of zero free length that carry a linkage's weight in every position, in closed form.

The plane of motion is vertical. With e1, e2, e3 the directions of crank, coupler and rocker every point is
``a0 + a1 e1 + a2 e2``, so masses have the potential ``const + Re(W1 e1 + W2 e2)``, and with e2 taken out in favour of e3
``Re(V1 e1 + V3 e3)``: two pendulums on fixed pivots. A spring from the ground at s to p e1 on the crank gives
``-k Re(conj(s - A) p e1)``. Two such springs, on crank and rocker, balance any four-bar; one alone does so only under a
condition on signs (published: Kuo, Mechanism and Machine Theory 214, 106140; derived anew).

A body on guides has two such pendulums as well: a crank about its pivot, a block about its pin, and the body about the pin that a
slider carries. A spring there from s to p e1 gives -k Re(conj(s) p e1), on a slider too, which does not turn. With a circle among
the guides, or two rails, every weight is theirs. What weighs along the rail beside a slot, or between two slots, is not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.drives.links import GROUND, Machine
from synthesis.fourbar.linkage import Linkage
from synthesis.guided.analysis import Load
from synthesis.guided.linkage import Circle, GuidedLinkage, Rail

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
    for mass in load.masses:
        link, point = mass.link, mass.at
        if link == "body":
            link, point = "coupler", linkage.arm + point * np.exp(1j * (linkage.body_offset or 0.0))
        add(mass.mass * load.gravity, link, point)
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


def _pendulums(linkage: GuidedLinkage | None, machine: Machine) -> list[_Pendulum]:
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
    linkage: GuidedLinkage | None, machine: Machine, torque: Floats, stiffness: float | None = None
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
