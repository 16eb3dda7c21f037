"""Positions of the bodies of a mechanism at crank angles, with bounds of their movement over intervals.

A mechanism is constructed in steps: the crank turns about a point of a body, and other bodies are aimed from one known point at
another. Each step encloses its bodies over a cell |t - tm| <= h from the enclosures of the bodies before: the origin of a body
moves by at most ``dp`` and it turns by at most ``dth``, so a point z of it moves by at most dp + |z| min(2, dth).
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
