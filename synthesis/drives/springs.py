"""Springs between two links: their force, their limits, and the torque that the drive gives because of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.drives.links import GROUND, LinkMotions
from synthesis.studies.forces import Pull
from synthesis.target import TURN

Between = tuple[str, str]
"""Names of the two links that a spring joins."""


class SpringRow(NamedTuple):
    """A spring of a catalogue: force in tension ``preload + stiffness (l - free_length)`` between two lengths.

    The force of a gas spring is negative. By default the spring is ideal: of zero free length, without limits.
    """

    name: str | None
    stiffness: float
    free_length: float = 0.0
    preload: float = 0.0
    shortest: float = 0.0
    longest: float = np.inf
    price: float | None = None

    @property
    def offset(self) -> float:
        """Force in tension extrapolated to length 0."""
        return self.preload - self.stiffness * self.free_length

    def force(self, length: Floats) -> Floats:
        """Return the pull at some lengths."""
        return self.preload + self.stiffness * (length - self.free_length)


@dataclass(frozen=True)
class Spring:
    """A linear spring between two links."""

    between: Between
    points: tuple[complex, complex]
    """Ends in the frames of their links; on the ground in the plane."""
    row: SpringRow

    @property
    def name(self) -> str | None:
        """Name of the row of the catalogue; None for an ideal spring."""
        return self.row.name

    def ends(self, machine: LinkMotions) -> tuple[Complexes, Complexes]:
        """Return the paths of both ends, (n,) each."""
        first, second = (machine.end(*end) for end in zip(self.between, self.points))
        return first, second

    def length(self, machine: LinkMotions) -> Floats:
        """Return the length over the motion, (n,)."""
        first, second = self.ends(machine)
        return np.abs(second - first)

    def torque(self, machine: LinkMotions) -> Floats:
        """Return the torque that the drive gives because of the spring, (n,)."""
        first, second = self.ends(machine)
        speeds = [
            0j if name == GROUND else machine.link(name).speed(point)
            for name, point in zip(self.between, self.points)
        ]
        work = np.real(np.conj(second - first) * (speeds[1] - speeds[0]))
        if self.row.offset == 0:
            return self.row.stiffness * work
        length = np.abs(second - first)
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.row.force(length) * work / length

    def excess(self, machine: LinkMotions) -> Floats:
        """Return by which fraction of its longest length the length leaves its range, (n,); negative inside."""
        length = self.length(machine)
        return np.maximum(self.row.shortest - length, length - self.row.longest) / self.row.longest

    def pulls(self, machine: LinkMotions) -> list[Pull]:
        """Return the forces on both links."""
        first, second = self.ends(machine)
        length = np.abs(second - first)
        # over a length of 0 a spring of zero free length has no force either
        pull = self.row.force(length) / np.maximum(length, 1e-300) * (second - first)
        return [Pull(self.between[0], first, pull), Pull(self.between[1], second, -pull)]


class TorsionRow(NamedTuple):
    """A torsion spring of a catalogue: moment ``preload + rate twist`` for twists from 0 to ``angle_max``, in radians."""

    name: str
    rate: float
    preload: float
    angle_max: float
    price: float | None = None


@dataclass(frozen=True)
class TorsionSpring:
    """A torsion spring in a joint of two links."""

    row: TorsionRow
    between: Between
    reference: LinkMotions
    """Motion along which the angle of the joint is continuous."""
    mounted: float = 0.0
    """Twist at the first position, in radians."""
    direction: int = 1
    """1 if the twist grows with the angle of the second link from the first, else -1."""

    @property
    def name(self) -> str:
        """Name of the row of the catalogue."""
        return self.row.name

    def turned(self, machine: LinkMotions) -> Floats:
        """Return the rotation in the joint since the first position, at any positions of the motion, (n,)."""
        known = np.unwrap(_difference(self.reference, self.between))
        order = np.argsort(self.reference.at)
        expected = np.interp(machine.at, self.reference.at[order], known[order])
        angle = _difference(machine, self.between)
        return np.asarray(angle + TURN * np.round((expected - angle) / TURN) - known[0])

    def rate(self, machine: LinkMotions) -> Floats:
        """Return the derivative of this rotation by the drive, (n,)."""
        first, second = self.between
        rate = machine.links[second].rate
        return rate if first == GROUND else rate - machine.links[first].rate

    def twist(self, machine: LinkMotions) -> Floats:
        """Return the twist over the motion, (n,)."""
        return self.mounted + self.direction * self.turned(machine)

    def moment(self, twist: Floats) -> Floats:
        """Return the moment at some twists."""
        return self.row.preload + self.row.rate * twist

    def torque(self, machine: LinkMotions) -> Floats:
        """Return the torque that the drive gives because of the spring, (n,)."""
        return self.direction * self.moment(self.twist(machine)) * self.rate(machine)

    def excess(self, machine: LinkMotions) -> Floats:
        """Return by which fraction of the largest twist the twist leaves its range, (n,); negative inside."""
        twist, angle_max = self.twist(machine), self.row.angle_max
        return np.maximum(-twist, twist - angle_max) / angle_max

    def pulls(self, machine: LinkMotions) -> list[Pull]:
        """Return the couples on both links."""
        couple = self.direction * self.moment(self.twist(machine))
        nowhere = np.zeros(machine.at.size, dtype=complex)
        return [Pull(name, nowhere, nowhere, sign * couple) for name, sign in zip(self.between, (1.0, -1.0))]


def _difference(machine: LinkMotions, between: Between) -> Floats:
    first, second = between
    angle = machine.links[second].angle
    return angle if first == GROUND else angle - machine.links[first].angle


MountedSpring = Spring | TorsionSpring
"""A spring in its place, of any kind."""


class SpringRegion(NamedTuple):
    """Region in which the ends of a spring may lie."""

    box: tuple[float, float, float, float]
    """Box of an end on the ground."""
    reach: float
    """Largest distance of an end on a link from the origin of its frame."""
    clear: float
    """Smallest distance of an end from the pivots and from the origin of its link's frame."""


@dataclass(frozen=True)
class Behaviour:
    """Limits on the torque that the drive gives once the springs are mounted, shape (n,) over the motion."""

    sense: float
    """1 if the drive's coordinate rises from the first position to the last, -1 if it falls."""
    margins: tuple[float, float]
    """Torques with which the linkage is pressed onto its stop at the first and the last position, if these must hold."""
    holds_first: bool = False
    """The linkage rests on its stop at the first position without a drive."""
    holds_last: bool = False
    torque_max: Floats | None = None
    """Largest absolute torque at each position."""
    offset: Floats | float = 0.0
    """Torque that is added to the given ones: a search that approximates a wanted torque works with differences from it."""

    def rows(self, torque: Floats) -> Floats:
        """Return values, affine in the torque (.., n), that are at least 0 if it satisfies the limits, shape (.., m)."""
        found, torque = [], torque + self.offset
        if self.holds_first:
            found.append(self.sense * torque[..., :1] - self.margins[0])
        if self.holds_last:
            found.append(-self.sense * torque[..., -1:] - self.margins[1])
        if self.torque_max is not None:
            found += [self.torque_max - torque, self.torque_max + torque]
        return np.concatenate(found, axis=-1)

    def violation(self, torque: Floats) -> Floats:
        """Return the largest violation of the limits by torques (.., n), at least 0, as a torque."""
        return np.maximum(-self.rows(torque).min(axis=-1), 0.0)


def torque_of(springs: Iterable[MountedSpring], machine: LinkMotions) -> Floats:
    """Return the torque that the drive gives because of some springs, (n,)."""
    return sum((spring.torque(machine) for spring in springs), np.zeros(machine.at.size))


def pairs_of(machine: LinkMotions) -> list[Between]:
    """Return every pair of links, the ground among them, between which a spring can do work."""
    return list(combinations((GROUND, *machine.links), 2))


def rms_of(values: Floats) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))
