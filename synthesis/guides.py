"""Guides of a body and their drives: circle, rail and slot, and the vectors of the loop over the drive's coordinate."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import ClassVar, NamedTuple, Self

import numpy as np

from synthesis.arrays import Complexes, Floats, dot
from synthesis.target import TURN


class _Guide:
    """Properties and geometry of a guide."""

    __slots__ = ()
    has_pin: ClassVar[bool] = True
    """True if it has a fixed pin."""
    holds_point: ClassVar[bool] = True
    """True if it holds a point of the body; otherwise a line of the body."""
    slides: ClassVar[bool] = True
    """True if the body slides along it, or it along its pin."""


class _Circle(NamedTuple):
    pivot: complex
    radius: float
    body_point: complex


class Circle(_Circle, _Guide):
    """Circle for a body point: a crank or a rocker. Its coordinate is the direction from the pivot to the body point."""

    __slots__ = ()
    slides = False

    def ground_at(self, coordinate: Floats) -> Complexes:
        """Return the point of the ground at which the guide holds the body."""
        return self.pivot + self.radius * np.exp(1j * coordinate)

    def body_at(self, coordinate: Floats) -> Complexes:
        """Return the point of the body, in its frame, at which the guide holds it."""
        return np.full(np.shape(coordinate), self.body_point)

    def coordinate_of(self, position: Complexes, turned: Complexes) -> Floats:
        """Return the coordinate at poses of the body, which ``turned`` has as e^{i rotation}."""
        return np.angle(self.contact(position, turned) - self.pivot)

    def contact(self, position: Complexes, turned: Complexes) -> Complexes:
        """Return the point in the plane at which the guide holds the body."""
        return position + turned * self.body_point

    def push(self, position: Complexes, turned: Complexes) -> Complexes:
        """Return the direction in which the guide pushes the body, of modulus 1."""
        spoke = self.contact(position, turned) - self.pivot
        return spoke / np.abs(spoke)

    def from_pin(self) -> Vector:
        """Return the vector over the drive from its pin to the origin."""
        return Round(-self.pivot, self.radius)


class _Rail(NamedTuple):
    point: complex
    direction: float
    body_point: complex


class Rail(_Rail, _Guide):
    """Line of the ground for a body point, through ``point``; ``direction`` in radians. Its coordinate is along the line."""

    __slots__ = ()
    has_pin = False

    def ground_at(self, coordinate: Floats) -> Complexes:
        """Return the point of the ground at which the guide holds the body."""
        return self.point + coordinate * np.exp(1j * self.direction)

    def body_at(self, coordinate: Floats) -> Complexes:
        """Return the point of the body, in its frame, at which the guide holds it."""
        return np.full(np.shape(coordinate), self.body_point)

    def coordinate_of(self, position: Complexes, turned: Complexes) -> Floats:
        """Return the coordinate at poses of the body, which ``turned`` has as e^{i rotation}."""
        return dot(np.exp(1j * self.direction), self.contact(position, turned) - self.point)

    def contact(self, position: Complexes, turned: Complexes) -> Complexes:
        """Return the point in the plane at which the guide holds the body."""
        return position + turned * self.body_point

    def push(self, position: Complexes, turned: Complexes) -> Complexes:
        """Return the direction in which the guide pushes the body, of modulus 1."""
        return np.full(turned.shape, 1j * np.exp(1j * self.direction))

    def from_pin(self) -> Vector:
        """Return the vector over the drive from its pin to the origin."""
        return Straight(-self.point, self.direction)


class _Slot(NamedTuple):
    pin: complex
    body_point: complex
    body_direction: float


class Slot(_Slot, _Guide):
    """Line of the body, through ``body_point`` with ``body_direction`` in radians, through a fixed pin.

    Its coordinate is the position of the pin along the line, from the body point.
    """

    __slots__ = ()
    holds_point = False

    def ground_at(self, coordinate: Floats) -> Complexes:
        """Return the point of the ground at which the guide holds the body."""
        return np.full(np.shape(coordinate), self.pin)

    def body_at(self, coordinate: Floats) -> Complexes:
        """Return the point of the body, in its frame, at which the guide holds it."""
        return self.body_point + coordinate * np.exp(1j * self.body_direction)

    def coordinate_of(self, position: Complexes, turned: Complexes) -> Floats:
        """Return the coordinate at poses of the body, which ``turned`` has as e^{i rotation}."""
        return dot(turned * np.exp(1j * self.body_direction), self.pin - position - turned * self.body_point)

    def contact(self, position: Complexes, turned: Complexes) -> Complexes:
        """Return the point in the plane at which the guide holds the body; NaN at positions that are NaN."""
        return self.pin + 0.0 * position

    def push(self, position: Complexes, turned: Complexes) -> Complexes:
        """Return the direction in which the guide pushes the body, of modulus 1."""
        return 1j * turned * np.exp(1j * self.body_direction)

    def from_pin(self) -> Vector:
        """Return the vector over the drive from its pin to the origin."""
        return Vector(-self.pin)


Guide = Circle | Rail | Slot
"""Guides of all forms have the same methods; ``guide[0]`` is a point of the ground that the guide passes through."""


class Kind(StrEnum):
    """Pair of guides of a linkage."""

    FOUR_BAR = "four_bar"
    SLIDER_CRANK = "slider_crank"
    SWINGING_BLOCK = "swinging_block"
    RAIL_SLOT = "rail_slot"
    TWO_RAILS = "two_rails"
    TWO_SLOTS = "two_slots"


class Driver(StrEnum):
    """Drive of the first guide."""

    CRANK = "crank"
    SLIDER = "slider"
    CYLINDER = "cylinder"
    HINGE = "hinge"

    @property
    def turns(self) -> bool:
        """True if the coordinate is an angle, False if it is a length."""
        return self in (Driver.CRANK, Driver.HINGE)


GUIDES: dict[Kind, tuple[type[Circle] | type[Rail] | type[Slot], type[Circle] | type[Rail] | type[Slot]]] = {
    Kind.FOUR_BAR: (Circle, Circle),
    Kind.SLIDER_CRANK: (Circle, Rail),
    Kind.SWINGING_BLOCK: (Circle, Slot),
    Kind.RAIL_SLOT: (Rail, Slot),
    Kind.TWO_RAILS: (Rail, Rail),
    Kind.TWO_SLOTS: (Slot, Slot),
}
"""The guides of each kind, in either order."""
DRIVERS: dict[type[Circle] | type[Rail] | type[Slot], tuple[Driver, ...]] = {
    Circle: (Driver.CRANK,),
    Rail: (Driver.SLIDER,),
    Slot: (Driver.CYLINDER, Driver.HINGE),
}
"""Drives of each guide."""


class Condition(NamedTuple):
    """Function of the drive's coordinate that is negative if the loop does not close."""

    value: Callable[[Floats], Floats]
    extremes: tuple[float, ...]
    """Coordinates of its smallest and largest values, modulo the period; it is monotonic between two of them."""
    size: float
    """Magnitude of its terms, with which a small value is compared."""
    bounded: bool
    """True if it is negative far out on a line, so that the range of the coordinate is bounded."""


@dataclass(frozen=True)
class Vector:
    """Plane vector over the drive's coordinate q, an array (n,) in every method; this class is a constant vector.

    Vectors that vary have three conditions: ``longer_than``, the square of the vector less the square of the
    difference of two lengths; ``shorter_than``, the square of the sum of two lengths less the square of the vector;
    and ``across``, a length less the component of the vector to the left of a direction (sign +1) or to the right of
    it (sign -1).
    """

    middle: complex

    def plus(self, offset: complex) -> Self:
        """Return the sum with a fixed vector."""
        return replace(self, middle=self.middle + offset)

    def at(self, q: Floats) -> Complexes:
        """Return the vector."""
        return np.full(np.shape(q), self.middle)

    def direction(self, q: Floats) -> Floats:
        """Return its angle against the x axis, continuous wherever it does not vanish."""
        return np.full(np.shape(q), np.angle(self.middle))

    @property
    def turning_points(self) -> tuple[float, ...]:
        """Coordinates at which its length is largest or smallest."""
        return ()


@dataclass(frozen=True)
class Round(Vector):
    """``middle - radius e^{iq}``: from a crank's pin to a fixed point."""

    radius: float

    @property
    def _distance(self) -> float:
        return abs(self.middle)

    @property
    def _towards(self) -> float:
        return float(np.angle(self.middle))

    def at(self, q: Floats) -> Complexes:
        """Return the vector."""
        return self.middle - self.radius * np.exp(1j * q)

    def direction(self, q: Floats) -> Floats:
        """Return its angle against the x axis."""
        d, r, x = self._distance, self.radius, q - self._towards
        # the bracket of the longer of the two has a positive real part, so that its argument needs no unwrapping
        if d >= r:
            return self._towards + np.arctan2(-r * np.sin(x), (d - r) + 2 * r * np.sin(x / 2) ** 2)
        return q - math.pi + np.arctan2(d * np.sin(x), (r - d) + 2 * d * np.sin(x / 2) ** 2)

    def longer_than(self, first: float, second: float = 0.0) -> Condition:
        """Return its square less the square of the difference of two lengths."""
        d, r, towards, length = self._distance, self.radius, self._towards, abs(first - second)
        minimum = math.fsum((d, -r, first, -second)) * math.fsum((d, -r, -first, second))
        return Condition(
            lambda q: minimum + 4 * d * r * np.sin((q - towards) / 2) ** 2,
            self.turning_points,
            (d + r + length) ** 2,
            False,
        )

    def shorter_than(self, first: float, second: float = 0.0) -> Condition:
        """Return the square of the sum of two lengths less the square of the vector."""
        d, r, towards, length = self._distance, self.radius, self._towards, first + second
        minimum = math.fsum((first, second, -d, -r)) * (length + d + r)
        return Condition(
            lambda q: minimum + 4 * d * r * np.cos((q - towards) / 2) ** 2,
            self.turning_points,
            (d + r + length) ** 2,
            False,
        )

    def across(self, direction: float, length: float, sign: int) -> Condition:
        """Return a length less the component across a direction; see `Vector`."""
        r = self.radius
        minimum = (length - r) - sign * float(np.imag(self.middle * np.exp(-1j * direction)))
        size = length + r + abs(self.middle)
        lowest = direction - sign * math.pi / 2
        return Condition(
            lambda q: minimum + 2 * r * np.sin((q - lowest) / 2) ** 2, (lowest, lowest + math.pi), size, False
        )

    @property
    def turning_points(self) -> tuple[float, ...]:
        """Coordinates at which its length is largest or smallest."""
        return self._towards, self._towards + math.pi


@dataclass(frozen=True)
class Straight(Vector):
    """``middle - q e^{i along}``: from a slider's pin to a fixed point."""

    along: float

    @property
    def _foot(self) -> complex:
        """Coordinate of the perpendicular foot (real part), and distance from the line (imaginary part)."""
        return complex(self.middle * np.exp(-1j * self.along))

    def at(self, q: Floats) -> Complexes:
        """Return the vector."""
        return self.middle - q * np.exp(1j * self.along)

    def direction(self, q: Floats) -> Floats:
        """Return its angle against the x axis."""
        foot = self._foot
        return self.along + np.arctan2(foot.imag, foot.real - q)

    def longer_than(self, first: float, second: float = 0.0) -> Condition:
        """Return its square less the square of the difference of two lengths."""
        foot, length = self._foot, abs(first - second)
        minimum, size = (abs(foot.imag) - length) * (abs(foot.imag) + length), (abs(foot.imag) + length) ** 2
        return Condition(lambda q: minimum + (foot.real - q) ** 2, (foot.real,), size, False)

    def shorter_than(self, first: float, second: float = 0.0) -> Condition:
        """Return the square of the sum of two lengths less the square of the vector."""
        foot, length = self._foot, first + second
        square, size = (length - abs(foot.imag)) * (length + abs(foot.imag)), (length + abs(foot.imag)) ** 2
        if square < 0:
            return Condition(lambda q: square - (foot.real - q) ** 2, (foot.real,), size, True)
        half = math.sqrt(square)
        return Condition(lambda q: (half - (foot.real - q)) * (half + (foot.real - q)), (foot.real,), size, True)

    def across(self, direction: float, length: float, sign: int) -> Condition:
        """Return a length less the component across a direction; see `Vector`."""
        beside = float(np.imag(self.middle * np.exp(-1j * direction)))
        slope = math.sin(self.along - direction)
        return Condition(lambda q: length - sign * beside + sign * q * slope, (), length, slope != 0)

    @property
    def turning_points(self) -> tuple[float, ...]:
        """Coordinates at which its length is largest or smallest."""
        return (self._foot.real,)


def positions_within(positions: Iterable[float], first: float, last: float, period: float | None) -> list[float]:
    """Return the positions, modulo an optional period, strictly between two coordinates in either order."""
    low, high = min(first, last), max(first, last)
    found: list[float] = []
    for position in positions:
        if period is None:
            found += [position] if low < position < high else []
            continue
        number = math.floor((low - position) / TURN) + 1
        while position + number * TURN < high:
            found.append(position + number * TURN)
            number += 1
    return found


def mapped(
    guide: Guide,
    ground: Callable[[complex], complex],
    body: Callable[[complex], complex],
    scale: float = 1.0,
    sense: float = 1.0,
    turn: float = 0.0,
    turn_in_body: float = 0.0,
) -> Guide:
    """Return a guide with mapped points of ground and body, a scaled radius, and directions reflected and turned."""
    fixed, point = complex(ground(guide[0])), complex(body(guide.body_point))
    if isinstance(guide, Circle):
        return Circle(fixed, guide.radius * scale, point)
    if isinstance(guide, Rail):
        return Rail(fixed, guide.direction * sense + turn, point)
    return Slot(fixed, point, guide.body_direction * sense + turn_in_body)
