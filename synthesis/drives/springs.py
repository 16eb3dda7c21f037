"""Springs between two links: their force, their limits, and the torque that remains for the drive."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Floats
from synthesis.drives.links import GROUND, LinkMotions
from synthesis.mechanism import Box

Between = tuple[str, str]
"""Names of the two links that a spring joins."""


@dataclass(frozen=True)
class Spring:
    """A spring between two links; it pulls with ``preload + stiffness (length - free_length)``, a negative pull pushes."""

    between: tuple[str, str]
    points: tuple[complex, complex]
    """Ends in the frames of their links; on the ground in the plane."""
    stiffness: float
    free_length: float = 0.0
    preload: float = 0.0

    def force(self, length: Floats) -> Floats:
        """Return the pull at some lengths."""
        return self.preload + self.stiffness * (length - self.free_length)


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


class SpringRegion(NamedTuple):
    """Region in which the ends of a spring may lie."""

    box: Box
    """Box of an end on the ground."""
    reach: float
    """Largest distance of an end on a link from the origin of its frame."""
    clear: float
    """Smallest distance of an end from the pivots and from the origin of its link's frame."""


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
class MountedSprings:
    """Springs at their places, and the drive's torque with them."""

    springs: tuple[Spring, ...]
    kinds: tuple[SpringRow | None, ...]
    lengths: tuple[Floats, ...]
    torque: Floats

    @property
    def rms(self) -> float:
        """Root mean square of the torque that remains."""
        return rms_of(self.torque)


def spring_torque(machine: LinkMotions, spring: Spring) -> tuple[Floats, Floats]:
    """Return the lengths of a spring and the torque that the drive gives because of it, (n,) each."""
    ends = list(zip(spring.between, spring.points))
    first, second = (machine.end(*end) for end in ends)
    v = second - first
    speeds = [0j if name == GROUND else machine.link(name).speed(point) for name, point in ends]
    speed, length = speeds[1] - speeds[0], np.abs(v)
    if spring.free_length == 0 and spring.preload == 0:
        return length, spring.stiffness * np.real(np.conj(v) * speed)
    with np.errstate(divide="ignore", invalid="ignore"):
        return length, spring.force(length) * np.real(np.conj(v) * speed) / length


def mount_springs(
    machine: LinkMotions, torque: Floats, springs: list[Spring], kinds: list[SpringRow] | None = None
) -> MountedSprings:
    """Compute the lengths of some springs and the torque that remains for the drive.

    Parameters
    ----------
    machine : LinkMotions
    torque : ndarray, shape (n,)
        Torque that the drive gives without the springs.
    springs : list of Spring
    kinds : list of SpringRow, optional
        Catalogue row of each spring.
    """
    evaluations = [spring_torque(machine, spring) for spring in springs]
    left = torque + sum((needed for _, needed in evaluations), np.zeros(torque.size))
    names: tuple[SpringRow | None, ...] = tuple(kinds) if kinds else (None,) * len(springs)
    return MountedSprings(tuple(springs), names, tuple(length for length, _ in evaluations), left)


def pairs_of(machine: LinkMotions) -> list[Between]:
    """Return every pair of links, the ground among them, between which a spring can do work."""
    return list(combinations((GROUND, *machine.links), 2))


def rms_of(values: Floats) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))
