"""Vectors that go round or straight on as a drive moves, with the differences of their lengths free of cancellation.

A loop closes where certain differences are not negative: of a squared length and a square, or of a length and a projection.
Each is written as a sum of terms that are not negative wherever the drive moves freely, as in `fourbar.kinematics`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.target import TURN


class Condition(NamedTuple):
    """What must not be negative for a loop to close, over the drive's coordinate."""

    value: Callable[[Floats], Floats]
    extremes: tuple[float, ...]
    """Where it is smallest or largest, modulo the period: between two of these it rises or falls throughout."""
    size: float
    """Of the terms that it is made of, to tell what is small."""
    bounded: bool
    """Whether it is negative far out on a line, so that the coordinate has ends."""


@dataclass(frozen=True)
class Vector(ABC):
    """A plane vector over the drive's coordinate q, which every method takes as an array (n,)."""

    middle: complex

    def plus(self, offset: complex) -> Self:
        """The sum with a fixed vector."""
        return replace(self, middle=self.middle + offset)

    @abstractmethod
    def at(self, q: Floats) -> Complexes:
        """The vector."""

    @abstractmethod
    def direction(self, q: Floats) -> Floats:
        """Its angle against the x axis, continuous wherever it does not vanish."""

    @abstractmethod
    def longer_than(self, length: float) -> Condition:
        """Its square less that of a length that is at least 0."""

    @abstractmethod
    def shorter_than(self, length: float) -> Condition:
        """The square of a length that is at least 0, less its own."""

    @abstractmethod
    def across(self, direction: float, length: float, sign: int) -> Condition:
        """A length less, for sign +1, its part to the left of a direction; for sign -1, that to the right."""

    @property
    @abstractmethod
    def turning_points(self) -> tuple[float, ...]:
        """Where its length is largest or smallest."""


@dataclass(frozen=True)
class Round(Vector):
    """``middle - radius e^{iq}``: from a crank's pin to a fixed place."""

    radius: float

    @property
    def _distance(self) -> float:
        return abs(self.middle)

    @property
    def _towards(self) -> float:
        return float(np.angle(self.middle))

    def at(self, q: Floats) -> Complexes:
        """As of `Vector`."""
        return self.middle - self.radius * np.exp(1j * q)

    def direction(self, q: Floats) -> Floats:
        """As of `Vector`."""
        d, r, x = self._distance, self.radius, q - self._towards
        # the bracket of the longer of both has a positive real part: its argument needs no unwrapping
        if d >= r:
            return self._towards + np.arctan2(-r * np.sin(x), (d - r) + 2 * r * np.sin(x / 2) ** 2)
        return q - math.pi + np.arctan2(d * np.sin(x), (r - d) + 2 * d * np.sin(x / 2) ** 2)

    def longer_than(self, length: float) -> Condition:
        """As of `Vector`."""
        d, r, towards = self._distance, self.radius, self._towards
        least = (d - r - length) * (d - r + length)
        return Condition(
            lambda q: least + 4 * d * r * np.sin((q - towards) / 2) ** 2,
            self.turning_points,
            (d + r + length) ** 2,
            False,
        )

    def shorter_than(self, length: float) -> Condition:
        """As of `Vector`."""
        d, r, towards = self._distance, self.radius, self._towards
        least = (length - d - r) * (length + d + r)
        return Condition(
            lambda q: least + 4 * d * r * np.cos((q - towards) / 2) ** 2,
            self.turning_points,
            (d + r + length) ** 2,
            False,
        )

    def across(self, direction: float, length: float, sign: int) -> Condition:
        """As of `Vector`."""
        r = self.radius
        least = (length - r) - sign * float(np.imag(self.middle * np.exp(-1j * direction)))
        size = length + r + abs(self.middle)
        lowest = direction - sign * math.pi / 2
        return Condition(
            lambda q: least + 2 * r * np.sin((q - lowest) / 2) ** 2, (lowest, lowest + math.pi), size, False
        )

    @property
    def turning_points(self) -> tuple[float, ...]:
        """As of `Vector`."""
        return self._towards, self._towards + math.pi


@dataclass(frozen=True)
class Straight(Vector):
    """``middle - q e^{i along}``: from a slider's pin to a fixed place."""

    along: float

    @property
    def _foot(self) -> complex:
        """The place on the line nearest to the vector's end, and how far beside the line that end lies."""
        return complex(self.middle * np.exp(-1j * self.along))

    def at(self, q: Floats) -> Complexes:
        """As of `Vector`."""
        return self.middle - q * np.exp(1j * self.along)

    def direction(self, q: Floats) -> Floats:
        """As of `Vector`."""
        foot = self._foot
        return self.along + np.arctan2(foot.imag, foot.real - q)

    def longer_than(self, length: float) -> Condition:
        """As of `Vector`."""
        foot = self._foot
        least, size = (abs(foot.imag) - length) * (abs(foot.imag) + length), (abs(foot.imag) + length) ** 2
        return Condition(lambda q: least + (foot.real - q) ** 2, (foot.real,), size, False)

    def shorter_than(self, length: float) -> Condition:
        """As of `Vector`."""
        foot = self._foot
        square, size = (length - abs(foot.imag)) * (length + abs(foot.imag)), (length + abs(foot.imag)) ** 2
        if square < 0:
            return Condition(lambda q: square - (foot.real - q) ** 2, (foot.real,), size, True)
        half = math.sqrt(square)
        return Condition(lambda q: (half - (foot.real - q)) * (half + (foot.real - q)), (foot.real,), size, True)

    def across(self, direction: float, length: float, sign: int) -> Condition:
        """As of `Vector`."""
        beside = float(np.imag(self.middle * np.exp(-1j * direction)))
        slope = math.sin(self.along - direction)
        return Condition(lambda q: length - sign * beside + sign * q * slope, (), length, slope != 0)

    @property
    def turning_points(self) -> tuple[float, ...]:
        """As of `Vector`."""
        return (self._foot.real,)


@dataclass(frozen=True)
class Still(Vector):
    """A vector that the drive does not change."""

    def at(self, q: Floats) -> Complexes:
        """As of `Vector`."""
        return np.full(np.shape(q), self.middle)

    def direction(self, q: Floats) -> Floats:
        """As of `Vector`."""
        return np.full(np.shape(q), np.angle(self.middle))

    def longer_than(self, length: float) -> Condition:
        """As of `Vector`."""
        value = (abs(self.middle) - length) * (abs(self.middle) + length)
        return Condition(lambda q: np.full(np.shape(q), value), (), 1.0, False)

    def shorter_than(self, length: float) -> Condition:
        """As of `Vector`."""
        value = (length - abs(self.middle)) * (length + abs(self.middle))
        return Condition(lambda q: np.full(np.shape(q), value), (), 1.0, False)

    def across(self, direction: float, length: float, sign: int) -> Condition:
        """As of `Vector`."""
        value = length - sign * float(np.imag(self.middle * np.exp(-1j * direction)))
        return Condition(lambda q: np.full(np.shape(q), value), (), 1.0, False)

    @property
    def turning_points(self) -> tuple[float, ...]:
        """As of `Vector`."""
        return ()


def places_within(places: Iterable[float], first: float, last: float, period: float | None) -> list[float]:
    """The places, modulo a period where there is one, strictly between two coordinates in either order."""
    low, high = min(first, last), max(first, last)
    found: list[float] = []
    for place in places:
        if period is None:
            found += [place] if low < place < high else []
            continue
        number = math.floor((low - place) / TURN) + 1
        while place + number * TURN < high:
            found.append(place + number * TURN)
            number += 1
    return found
