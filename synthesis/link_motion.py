"""Motion of the links of a linkage over its drive: poses and rates of the body, motions of links, and masses on them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats, Ints, dot


class Mass(NamedTuple):
    """Mass on a link: its centre in the frame of the link, and its inertia about the centre."""

    link: str
    mass: float
    at: complex = 0j
    inertia: float = 0.0


class BodyPoses(NamedTuple):
    """Poses of the body at n coordinates of the drive; NaN if the loop does not close."""

    position: Complexes
    rotation: Floats
    """Radians, continuous in the coordinate."""
    sine: Floats
    """sin mu: its sign is the branch, its absolute value the sine of the transmission angle."""
    arm: Floats
    """|X - Z| |sin mu|, the moment arm of the other guide's push about the pin Z; with the hinge locked |sin mu|."""
    transmission_angle: Floats
    """From 0 (dead) to pi/2 (best), without the loss of accuracy of an arcsine near either."""


class BodyRates(NamedTuple):
    """First and second derivatives of a body's pose by the drive's coordinate, (n,); NaN at a dead position."""

    position: Complexes
    rotation: Floats
    position_second: Complexes
    rotation_second: Floats


@dataclass(frozen=True)
class LinkMotion:
    """Motion of a link over n positions of a drive: origin X and angle (radians) of its frame, and their derivatives.

    A point q of the link, in its frame, lies at ``X + q e^{i angle}``. Derivatives are by the drive, and NaN at a
    dead position.

    Law: `velocity` and `rate` are the limits of difference quotients of origin and angle, and so on.
    """

    name: str
    origin: Complexes
    angle: Floats
    velocity: Complexes
    rate: Floats
    acceleration: Complexes
    rate_change: Floats
    pivot: complex | None = None
    """Pivot of the link in the observer's frame, if it has a pivot; it is then the origin of the link's frame too."""

    @cached_property
    def direction(self) -> Complexes:
        """Direction of the link's frame, of modulus 1, (n,)."""
        return np.exp(1j * self.angle)

    def largest_shift(self, reach: float) -> float:
        """Return the largest shift, first to last position, of a point within ``reach`` of the origin."""
        turned = float(abs(self.direction[-1] - self.direction[0]))
        return float(abs(self.origin[-1] - self.origin[0])) + reach * turned

    def position(self, point: complex | Complexes) -> Complexes:
        """Return the position of a point of the link, (n,), or of points (m, 1), (m, n)."""
        return self.origin + self.direction * point

    def speed(self, point: complex | Complexes) -> Complexes:
        """Return the first derivative of the position of a point by the drive, (n,), or of points (m, 1), (m, n)."""
        return self.velocity + 1j * self.rate * self.direction * point

    def change(self, point: complex) -> Complexes:
        """Return the second derivative of the position of a point by the drive, (n,)."""
        return self.acceleration + (1j * self.rate_change - self.rate**2) * self.direction * point

    def leverage(self, ground: complex | Complexes, point: complex | Complexes) -> tuple[Floats, Floats]:
        """Return the distance from a fixed point to a point of the link, and its derivative, (n,), or of m pairs, (m, n)."""
        v = self.position(point) - ground
        length = np.abs(v)
        return length, dot(v, self.speed(point)) / length

    def point_at(self, point: complex) -> complex:
        """Return the point of the link, in its frame, that coincides with a fixed point at the first sample."""
        return complex(np.conj(self.direction[0]) * (point - self.origin[0]))

    def at(self, samples: Ints) -> LinkMotion:
        """Return the motion at a selection of the samples."""
        names = ("origin", "angle", "velocity", "rate", "acceleration", "rate_change")
        return replace(self, **{name: getattr(self, name)[samples] for name in names})

    def swing(self) -> float:
        """Return the angle through which the link turns, in radians."""
        turned = np.unwrap(self.angle)
        return float(turned[-1] - turned[0])

    def seen_from(self, observer: LinkMotion) -> LinkMotion:
        """Return the motion relative to another link, whose frame coincides with the fixed frame at the first sample."""
        level = observer.angle - observer.angle[0]
        back, rate, change = np.exp(-1j * level), observer.rate, observer.rate_change
        reach, speed = self.origin - observer.origin, self.velocity - observer.velocity
        velocity = back * (speed - 1j * rate * reach)
        acceleration = back * (
            self.acceleration - observer.acceleration - 2j * rate * speed - (1j * change + rate**2) * reach
        )
        return replace(
            self,
            origin=observer.origin[0] + back * reach,
            angle=self.angle - level,
            velocity=velocity,
            rate=self.rate - rate,
            acceleration=acceleration,
            rate_change=self.rate_change - change,
            pivot=None,
        )
