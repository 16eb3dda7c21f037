"""Positions of the bodies of a mechanism at crank angles, with bounds of their movement over intervals.

A mechanism is constructed in steps: the crank turns about a point of a body; a dyad closes two links between two points that are
known by then. Each step encloses its bodies over a cell |t - tm| <= h from the enclosures of the bodies before: the origin of a
body moves by at most ``dp`` and it turns by at most ``dth``, so a point z of it moves by at most dp + |z| min(2, dth).

In a dyad between P and Q with lengths a, b the distance r = |Q - P| changes by at most e = d_P + d_Q, its direction by
asin(e / r), and the angle at P, phi(r) = acos((a^2 + r^2 - b^2) / (2 a r)), is monotone in r except at r^2 = a^2 - b^2. So the
bound also holds next to dead positions, where no bound of the derivative does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from synthesis.arrays import Complexes, Floats

GROUND = 0
"""The body that does not move."""


class BodyPoint(NamedTuple):
    """A point of a body, in the body's frame."""

    body: int
    at: complex


class Bodies(NamedTuple):
    """Bodies at m positions of the motion, with bounds of their movement over the cells around them, (bodies, m)."""

    origin: Complexes
    direction: Complexes
    """Unit vector of the x axis."""
    shift: Floats
    """Bound dp of the movement of the origin; infinite if the cell is too wide for a bound."""
    turn: Floats
    """Bound dth of the rotation, in radians."""

    def point(self, point: BodyPoint) -> Complexes:
        """Return the positions of a point, shape (m,)."""
        return np.asarray(self.origin[point.body] + self.direction[point.body] * point.at)

    def spread(self, point: BodyPoint) -> Floats:
        """Return the bound of a point's movement, shape (m,)."""
        return np.asarray(self.shift[point.body] + abs(point.at) * np.minimum(2.0, self.turn[point.body]))


class Step(Protocol):
    """Step of the construction, which fills in the rows of its own bodies."""

    def enclose(self, bodies: Bodies, travel: Floats, half: Floats) -> None:
        """Fill in the rows for cells with middles ``travel`` and half widths ``half``, (m,)."""


@dataclass(frozen=True)
class Crank:
    """A body that the drive turns about a point of another body, which is its origin."""

    body: int
    pivot: BodyPoint
    start: float
    """Angle from the other body at travel 0, in radians."""

    def enclose(self, bodies: Bodies, travel: Floats, half: Floats) -> None:
        """Add the half width to the rotation of the other body."""
        base = self.pivot.body
        bodies.origin[self.body] = bodies.point(self.pivot)
        bodies.direction[self.body] = bodies.direction[base] * np.exp(1j * (self.start + travel))
        bodies.shift[self.body] = bodies.spread(self.pivot)
        bodies.turn[self.body] = bodies.turn[base] + half


@dataclass(frozen=True)
class Dyad:
    """Two links that meet in a pin, the first from P and the second from Q; the x axes of their frames point to the pin."""

    first: int
    second: int
    p: BodyPoint
    q: BodyPoint
    a: float
    b: float
    side: int
    """1 if the pin lies to the left of the line from P to Q, otherwise -1."""

    def enclose(self, bodies: Bodies, travel: Floats, half: Floats) -> None:
        """Enclose both links; there is no bound if the distance of P and Q can vanish."""
        p, q = bodies.point(self.p), bodies.point(self.q)
        shifts = bodies.spread(self.p), bodies.spread(self.q)
        r = np.abs(q - p)
        e = shifts[0] + shifts[1]
        line, a, b = (q - p) / r, self.a, self.b
        rows = ((self.first, p, shifts[0], a, b, 1), (self.second, q, shifts[1], b, a, -1))
        for body, origin, shift, own, opposite, sign in rows:
            bodies.origin[body] = origin
            bodies.direction[body] = sign * line * corner(own, opposite, r, sign * self.side)
            bodies.shift[body] = shift
            bodies.turn[body] = turn_over(own, opposite, r, e)


@dataclass(frozen=True)
class Between:
    """A link between points of two bodies at constant distance; its frame starts at the first, with the x axis to the second."""

    body: int
    first: BodyPoint
    second: BodyPoint
    length: float

    def enclose(self, bodies: Bodies, travel: Floats, half: Floats) -> None:
        """Bound the rotation by 2 asin(chord / 2), with the movement of both ends divided by the length as the chord."""
        origin = bodies.point(self.first)
        shift = bodies.spread(self.first)
        bodies.origin[self.body] = origin
        bodies.direction[self.body] = (bodies.point(self.second) - origin) / self.length
        chord = np.minimum((shift + bodies.spread(self.second)) / (2 * self.length), 1.0)
        bodies.shift[self.body], bodies.turn[self.body] = shift, 2 * np.arcsin(chord)


@dataclass(frozen=True)
class Aimed:
    """A body with its origin at a point of one body and its x axis towards a point of a second body, at any distance."""

    body: int
    origin: BodyPoint
    target: BodyPoint

    def enclose(self, bodies: Bodies, travel: Floats, half: Floats) -> None:
        """Enclose the direction by asin(e / r), with the sum e of the movements of both points and their distance r."""
        p, q = bodies.point(self.origin), bodies.point(self.target)
        shift = bodies.spread(self.origin)
        e, r = shift + bodies.spread(self.target), np.abs(q - p)
        bodies.origin[self.body], bodies.shift[self.body] = p, shift
        bodies.direction[self.body] = (q - p) / r
        bodies.turn[self.body] = np.where(e < r, np.arcsin(np.where(e < r, e / r, 0.0)), np.inf)


def turn_over(own: float, opposite: float, r: Floats, e: Floats) -> Floats:
    """Return the largest rotation of a side of a triangle.

    Parameters
    ----------
    own, opposite : float
        Length of the side, and of the side opposite to the corner at which it turns.
    r : ndarray
        Length of the third side.
    e : ndarray
        Largest change of the third side's length and of its ends' distance.
    """
    low, high = np.maximum(r - e, abs(own - opposite)), np.minimum(r + e, own + opposite)
    known = (e < r) & (low <= high)
    middle = corner_angle(own, opposite, r)
    span = np.maximum(
        np.abs(corner_angle(own, opposite, low) - middle), np.abs(corner_angle(own, opposite, high) - middle)
    )
    if own > opposite:
        turning = np.sqrt((own - opposite) * (own + opposite))
        extreme = np.abs(corner_angle(own, opposite, np.full(1, turning)) - middle)
        span = np.where((low < turning) & (turning < high), np.maximum(span, extreme), span)
    return np.where(known, np.arcsin(np.where(known, e / r, 0.0)) + span, np.inf)


def _halves(own: float, opposite: float, r: Floats) -> tuple[Floats, Floats]:
    """Return sin^2 and cos^2 of half the angle between ``own`` and ``r`` in the triangle, multiplied by 4 own r.

    Differences come before sums, so that neither loses digits next to a dead position.
    """
    below = np.maximum((opposite - (own - r)) * ((own + opposite) - r), 0.0)
    above = np.maximum(((own - opposite) + r) * (own + opposite + r), 0.0)
    return below, above


def corner(own: float, opposite: float, r: Floats, side: int) -> Complexes:
    """Return e^{i side phi} for the angle phi between the sides ``own`` and ``r``."""
    below, above = _halves(own, opposite, r)
    return np.asarray((above - below + 2j * side * np.sqrt(below * above)) / (below + above))


def corner_angle(own: float, opposite: float, r: Floats) -> Floats:
    """Return the angle phi between the sides ``own`` and ``r``, from 0 to pi."""
    below, above = _halves(own, opposite, r)
    return np.asarray(2 * np.arctan2(np.sqrt(below), np.sqrt(above)))


class Movement:
    """Bodies and the steps that position them, in the order of their construction; body 0 is the ground.

    Over a cell no point of a body is farther from its position in the middle than `Bodies.spread`.
    """

    def __init__(self, names: Sequence[str], steps: Sequence[Step]) -> None:
        self.names, self.steps = tuple(names), tuple(steps)

    def bodies(self, travel: Floats, half: Floats | float = 0.0) -> Bodies:
        """Return the bodies at crank angles (m,) in radians from the first sample, enclosed over cells of half widths (m,)."""
        travel = np.asarray(travel, dtype=float)
        shape = (len(self.names), travel.size)
        bodies = Bodies(
            np.zeros(shape, dtype=complex), np.ones(shape, dtype=complex), np.zeros(shape), np.zeros(shape)
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            for step in self.steps:
                step.enclose(bodies, travel, np.broadcast_to(half, travel.shape))
        return bodies
