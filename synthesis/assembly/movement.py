"""Where the bodies of a mechanism are at crank angles, and how far they can be from there within an interval of them.

A mechanism is built up in steps: the crank turns about a point of a body; a dyad closes two links between two points that are
known by then. Each step encloses its bodies over a cell |t - tm| <= h from the enclosures of the bodies before: the origin of a
body moves by at most ``dp`` and it turns by at most ``dth``, so that a point z of it moves by at most dp + |z| min(2, dth).

In a dyad between P and Q with lengths a, b the distance r = |Q - P| changes by at most e = d_P + d_Q, its direction by
asin(e / r), and the angle at P, phi(r) = acos((a^2 + r^2 - b^2) / (2 a r)), is monotone in r except at r^2 = a^2 - b^2: so the
bound holds also next to dead positions, where no bound of the derivative does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from synthesis.arrays import Complexes, Floats

GROUND = 0
"""The body that does not move."""


class Place(NamedTuple):
    """A point of a body, in the body's frame."""

    body: int
    at: complex


class Bodies(NamedTuple):
    """Bodies at m places of the motion, and their enclosures over the cells about them; arrays of shape (bodies, m)."""

    origin: Complexes
    direction: Complexes
    """e^{i angle} of the x axis."""
    shift: Floats
    """dp; infinite where nothing is known over so wide a cell."""
    turn: Floats
    """dth."""

    def point(self, place: Place) -> Complexes:
        """Where a point is, shape (m,)."""
        return np.asarray(self.origin[place.body] + self.direction[place.body] * place.at)

    def spread(self, place: Place) -> Floats:
        """How far it can be from there, shape (m,)."""
        return np.asarray(self.shift[place.body] + abs(place.at) * np.minimum(2.0, self.turn[place.body]))


class Step(Protocol):
    """A step of the construction: it fills in the rows of its own bodies."""

    def place(self, bodies: Bodies, travel: Floats, half: Floats) -> None:
        """``travel``, ``half`` (m,): middle of each cell and half its width."""


@dataclass(frozen=True)
class Crank:
    """A body that the drive turns about a point of another; its origin is that point."""

    body: int
    pivot: Place
    start: float
    """Its angle against the other body at travel 0."""

    def place(self, bodies: Bodies, travel: Floats, half: Floats) -> None:
        """Enclosed by the half width alone where it turns about the ground."""
        base = self.pivot.body
        bodies.origin[self.body] = bodies.point(self.pivot)
        bodies.direction[self.body] = bodies.direction[base] * np.exp(1j * (self.start + travel))
        bodies.shift[self.body] = bodies.spread(self.pivot)
        bodies.turn[self.body] = bodies.turn[base] + half


@dataclass(frozen=True)
class Dyad:
    """Two links that meet in a pin: the first from P, the second from Q; each has its origin there and its x axis to the pin.

    ``side``: +1 where the pin lies to the left of P -> Q.
    """

    first: int
    second: int
    p: Place
    q: Place
    a: float
    b: float
    side: int

    def place(self, bodies: Bodies, travel: Floats, half: Floats) -> None:
        """Where the distance of P and Q can be 0, nothing is known."""
        p, q = bodies.point(self.p), bodies.point(self.q)
        shifts = bodies.spread(self.p), bodies.spread(self.q)
        r = np.abs(q - p)
        e = shifts[0] + shifts[1]
        line, a, b = (q - p) / r, self.a, self.b
        rows = ((self.first, p, shifts[0], a, b, 1), (self.second, q, shifts[1], b, a, -1))
        for body, origin, shift, near, far, sign in rows:
            bodies.origin[body] = origin
            bodies.direction[body] = sign * line * corner(near, far, r, sign * self.side)
            bodies.shift[body] = shift
            bodies.turn[body] = turn_over(near, far, r, e)


@dataclass(frozen=True)
class Between:
    """A link of a length between points of two bodies that keep it; its frame begins at the first, x to the second."""

    body: int
    first: Place
    second: Place
    length: float

    def place(self, bodies: Bodies, travel: Floats, half: Floats) -> None:
        """Its direction moves by a chord, at most what both ends do over its length: an angle of 2 asin(chord / 2)."""
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
    origin: Place
    target: Place

    def place(self, bodies: Bodies, travel: Floats, half: Floats) -> None:
        """Enclose the direction by asin(e / r), with the sum e of the movements of both points and their distance r."""
        p, q = bodies.point(self.origin), bodies.point(self.target)
        shift = bodies.spread(self.origin)
        e, r = shift + bodies.spread(self.target), np.abs(q - p)
        bodies.origin[self.body], bodies.shift[self.body] = p, shift
        bodies.direction[self.body] = (q - p) / r
        bodies.turn[self.body] = np.where(e < r, np.arcsin(np.where(e < r, e / r, 0.0)), np.inf)


def turn_over(near: float, far: float, r: Floats, e: Floats) -> Floats:
    """How far the side ``near`` of a triangle turns whose side r varies by at most e, its direction with it."""
    low, high = np.maximum(r - e, abs(near - far)), np.minimum(r + e, near + far)
    known = (e < r) & (low <= high)
    middle = corner_angle(near, far, r)
    span = np.maximum(np.abs(corner_angle(near, far, low) - middle), np.abs(corner_angle(near, far, high) - middle))
    if near > far:
        turning = np.sqrt((near - far) * (near + far))
        extreme = np.abs(corner_angle(near, far, np.full(1, turning)) - middle)
        span = np.where((low < turning) & (turning < high), np.maximum(span, extreme), span)
    return np.where(known, np.arcsin(np.where(known, e / r, 0.0)) + span, np.inf)


def _halves(near: float, far: float, r: Floats) -> tuple[Floats, Floats]:
    """sin^2 and cos^2 of half the angle between ``near`` and ``r`` in the triangle with ``far`` opposite, times 4 near r.

    Differences before sums, so that neither loses digits next to a dead position.
    """
    below = np.maximum((far - (near - r)) * ((near + far) - r), 0.0)
    above = np.maximum(((near - far) + r) * (near + far + r), 0.0)
    return below, above


def corner(near: float, far: float, r: Floats, side: int) -> Complexes:
    """e^{i side phi} of that angle."""
    below, above = _halves(near, far, r)
    return np.asarray((above - below + 2j * side * np.sqrt(below * above)) / (below + above))


def corner_angle(near: float, far: float, r: Floats) -> Floats:
    """That angle, 0 to pi."""
    below, above = _halves(near, far, r)
    return np.asarray(2 * np.arctan2(np.sqrt(below), np.sqrt(above)))


class Movement:
    """Bodies and the steps that place them, in the order of their construction; body 0 is the ground.

    Law: over a cell no point of a body is farther from its place in the middle than `Bodies.spread` says.
    """

    def __init__(self, names: Sequence[str], steps: Sequence[Step]) -> None:
        self.names, self.steps = tuple(names), tuple(steps)

    def bodies(self, travel: Floats, half: Floats | float = 0.0) -> Bodies:
        """Bodies at crank angles (m,) in radians from the first sample, enclosed over cells of half widths (m,)."""
        travel = np.asarray(travel, dtype=float)
        shape = (len(self.names), travel.size)
        found = Bodies(
            np.zeros(shape, dtype=complex), np.ones(shape, dtype=complex), np.zeros(shape), np.zeros(shape)
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            for step in self.steps:
                step.place(found, travel, np.broadcast_to(half, travel.shape))
        return found
