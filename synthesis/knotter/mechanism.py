"""Bodies that turn under laws of one driver, the chains of turns and shifts between them, and all dimensions by name.

A chain is written once, in one direction; the way back is derived from it and never typed. Vectors are tuples
``(x, y, z)`` of arrays that broadcast against one another, so that what does not depend on a parameter or on the
driver is not computed for each of them. Lengths are in the user's unit, angles in radians.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError
from synthesis.one_variable import EPSILON, Floats

Integers = NDArray[np.int_]
Vector = Sequence[Any] | NDArray[Any]
"""Three components: numbers, or arrays that broadcast against one another."""

DRIVER = "driver"
AXES = "ijk"


def as_array(parts: Iterable[Any], shape: tuple[int, ...]) -> Floats:
    """Numbers and arrays that broadcast, of one shape and in one array with them along its first axis."""
    return np.array([np.broadcast_to(part, shape) for part in parts])


@dataclass(frozen=True)
class Linear:
    """The law ``lead + ratio * driver`` (radians; ratio is a pure number), defined everywhere.

    Both may be arrays of shape (items,): laws of many mechanisms.
    """

    lead: float | Floats
    ratio: float | Floats = 0.0
    breakpoints: tuple[float, ...] = field(default=(), init=False)

    def value(self, driver: Floats | float) -> Floats | float:
        """The angle at each driver angle."""
        return self.lead + self.ratio * driver

    def rate_bound(self, first: float, last: float) -> float:
        """The largest ``|d angle / d driver|`` between two driver angles."""
        return float(np.max(np.abs(self.ratio)))

    def undefined(self, first: float, last: float) -> str | None:
        """Why the law says nothing about a range of the driver; None where it does."""
        return None


@dataclass(frozen=True)
class Table:
    """A law through given points: straight between them, or a monotone cubic (pchip).

    Raises `ValueError`: fewer than two knots, lengths that differ, or driver angles that do not increase.

    Law: the value at a knot is the knot's angle; between two knots it never leaves the interval of their angles.
    """

    driver: tuple[float, ...]
    angle: tuple[float, ...]
    """Knots in radians; ``driver`` strictly increasing, at least two."""
    kind: Literal["linear", "pchip"] = "linear"
    """Pchip keeps the monotony of the points and has a continuous rate."""
    outside: Literal["hold", "error"] = "hold"
    """Before the first and after the last knot: a dwell at that angle, or no law at all. A table that holds must
    still share a driver angle with the range it is asked for: one that lies wholly elsewhere is a mistake."""

    def __post_init__(self) -> None:
        if len(self.driver) != len(self.angle) or len(self.driver) < 2:
            raise ValueError("a table needs two rows or more, each a driver angle and an angle")
        steps = np.diff(self.driver)
        if not np.all(steps > 0):
            row = int(np.argmin(steps > 0)) + 2  # counted from 1
            raise ValueError(f"the driver angles must increase, but row {row} is not above the row before it")

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """The knots: between them the law is a polynomial."""
        return self.driver

    @cached_property
    def _coefficients(self) -> Any:
        """Polynomial coefficients, highest power first, shape (degree + 1, knots - 1), about each left knot."""
        knots, angles = np.array(self.driver), np.array(self.angle)
        if self.kind == "linear" or len(knots) == 2:
            return np.stack([np.diff(angles) / np.diff(knots), angles[:-1]])
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(knots, angles).c

    def value(self, driver: Floats | float) -> Floats | float:
        """The angle at each driver angle, in the precision of ``driver``."""
        knots = np.array(self.driver)
        driver = np.clip(driver, knots[0], knots[-1])
        piece = np.clip(np.searchsorted(knots, driver, side="right") - 1, 0, len(knots) - 2)
        along = driver - knots[piece]
        value: Floats = self._coefficients[0][piece]
        for row in self._coefficients[1:]:
            value = value * along + row[piece]
        return value

    def rate_bound(self, first: float, last: float) -> float:
        """A bound of ``|d angle / d driver|``; for pchip three times the steepest chord (Fritsch and Carlson)."""
        knots = np.array(self.driver)
        inside = (knots[1:] > first) & (knots[:-1] < last)
        slopes = np.abs(np.diff(self.angle) / np.diff(knots))[inside]
        return float(slopes.max(initial=0.0)) * (3.0 if self.kind == "pchip" else 1.0)

    def undefined(self, first: float, last: float) -> str | None:
        """Why the law says nothing about a range of the driver; None where it does."""
        start, end = self.driver[0], self.driver[-1]
        if self.outside == "error":
            defined = start <= first and last <= end
        else:
            defined = (start <= last and first <= end) or not first < last  # at rest at any single angle
        if defined:
            return None
        needed = (
            f"are {np.degrees(first):.9g} to {np.degrees(last):.9g}" if first < last else f"is {np.degrees(last):.9g}"
        )
        return (
            f"the law is not defined over the whole range: its table covers {np.degrees(start):.9g} to "
            f"{np.degrees(end):.9g} degrees, needed {needed} degrees"
        )


Law = Linear | Table
"""An angle as a function of the driver, smooth between its ``breakpoints``."""


@dataclass(frozen=True)
class Turn:
    """An active right-handed rotation about an axis (eqs 1-3) by a parameter, a law or the driver."""

    axis: Literal["i", "j", "k"]
    by: str
    sense: int = 1


@dataclass(frozen=True)
class Shift:
    """A translation; each component a number, a parameter's name, or that name after a minus sign."""

    i: str | float = 0.0
    j: str | float = 0.0
    k: str | float = 0.0


@dataclass(frozen=True)
class Chain:
    """The steps that carry coordinates from one frame to another, first step first."""

    source: str
    target: str
    steps: tuple[Turn | Shift, ...]


@dataclass(frozen=True)
class Mechanism:
    """Frames joined by chains, points fixed in frames, and the values that place them.

    Law: carrying a point to another frame and back gives the point, to rounding; distances between points of one frame
    are the same in every frame.
    """

    parameters: Mapping[str, float | Floats]
    """Lengths and angles by name. Arrays of shape (items,), here and in laws and points, make one mechanism stand for many."""
    laws: Mapping[str, Law]
    """Angles that follow the driver."""
    chains: tuple[Chain, ...]
    """A tree over the frames."""
    points: Mapping[str, tuple[str, Vector]]
    """Each point in the frame that it is fixed in."""

    def with_parameters(self, **values: float | Floats) -> Mechanism:
        """The same mechanism with other values of some parameters."""
        return replace(self, parameters={**self.parameters, **values})

    def locked(self, law: str, at: float) -> Mechanism:
        """The same mechanism with one law held at its value at driver angle ``at``."""
        return replace(self, laws={**self.laws, law: Linear(self.laws[law].value(np.float64(at)))})

    def item(self, index: Integers) -> Mechanism:
        """The mechanisms of some items, their parameters shaped as ``index``."""

        def of(value: Any) -> Any:
            return value[index] if isinstance(value, np.ndarray) and value.ndim else value

        laws = {
            name: Linear(of(law.lead), of(law.ratio)) if isinstance(law, Linear) else law
            for name, law in self.laws.items()
        }
        points = {name: (frame, tuple(map(of, xyz))) for name, (frame, xyz) in self.points.items()}
        return replace(
            self, parameters={name: of(value) for name, value in self.parameters.items()}, laws=laws, points=points
        )

    def position(self, point: str, frame: str, driver: Floats | float) -> Vector:
        """A point's coordinates in a frame, at driver angles that broadcast against the parameters."""
        home, coordinates = self.points[point]
        return self.carry(coordinates, home, frame, driver)

    def carry(self, vector: Vector, source: str, target: str, driver: Floats | float) -> Vector:
        """Coordinates in frame ``source`` as coordinates in frame ``target``, in the precision of ``driver``."""
        precision = np.result_type(driver, float)
        if np.finfo(precision).nmant > np.finfo(float).nmant:
            vector = tuple(np.asarray(at, precision) for at in vector)
        for chain, forward in self._path(source, target):
            for step in chain.steps if forward else reversed(chain.steps):
                if isinstance(step, Turn):
                    angle = np.asarray(self._angle(step, driver), precision)
                    vector = _turned(vector, step.axis, step.sense if forward else -step.sense, angle)
                else:
                    sign = 1.0 if forward else -1.0
                    vector = tuple(
                        at + sign * self._length(by) if not isinstance(by, float) or by else at
                        for at, by in zip(vector, (step.i, step.j, step.k))
                    )
        return vector

    def laws_between(self, frames: set[str]) -> set[str]:
        """The laws on the chains that join some frames."""
        first, *others = sorted(frames)
        steps = [step for frame in others for chain, _ in self._path(first, frame) for step in chain.steps]
        return {step.by for step in steps if isinstance(step, Turn) and step.by in self.laws}

    def require_laws(self, frames: set[str], first: float, last: float, only: str | None = None) -> None:
        """Raise `FieldError` naming the first law between the frames that is not defined over a driver range."""
        for name in sorted(self.laws_between(frames) & ({only} if only else set(self.laws))):
            if reason := self.laws[name].undefined(first, last):
                raise FieldError(f"/laws/{name}", reason, constraint="law_range")

    def breakpoints(self, frames: set[str]) -> list[float]:
        """Driver angles at which a law between the frames is not smooth."""
        return sorted({knot for name in self.laws_between(frames) for knot in self.laws[name].breakpoints})

    def turning_rate(self, frames: set[str], first: float, last: float) -> float:
        """A bound of how many times faster than the driver coordinates turn between the frames."""
        return 1.0 + sum(self.laws[name].rate_bound(first, last) for name in self.laws_between(frames))

    def rounding(self, frames: set[str], first: float, last: float) -> Floats | float:
        """A bound of the rounding error of any coordinate in these frames; a number or one per item.

        Coordinates lose digits to the sizes that are added up, and to angles of many turns.
        """
        shifts = [step for chain in self.chains for step in chain.steps if isinstance(step, Shift)]
        sizes = [np.sqrt(sum(np.square(at) for at in xyz)) for _, xyz in self.points.values()]
        reach: Any = reduce(np.maximum, sizes, 0.0)
        reach += sum(abs(self._length(by)) for step in shifts for by in (step.i, step.j, step.k))
        turned: Any = 1.0 + max(abs(first), abs(last))
        for name in self.laws_between(frames):
            law = self.laws[name]
            turned = turned + np.abs(law.value(np.float64(first))) + law.rate_bound(first, last) * (last - first)
        bound: Floats | float = 16 * EPSILON * turned * reach
        return bound

    def _length(self, by: str | float) -> Any:
        if isinstance(by, str):
            return -self.parameters[by[1:]] if by.startswith("-") else self.parameters[by]
        return by

    def _angle(self, step: Turn, driver: Floats | float) -> Floats | float:
        if step.by == DRIVER:
            return driver
        return self.laws[step.by].value(driver) if step.by in self.laws else self.parameters[step.by]

    def _path(self, source: str, target: str) -> list[tuple[Chain, bool]]:
        """The chains from one frame to another, each with whether it is walked in its own direction."""
        paths: dict[str, list[tuple[Chain, bool]]] = {source: []}
        ways = [(chain, forward) for chain in self.chains for forward in (True, False)]
        for _ in self.chains:
            for chain, forward in ways:
                here, there = (chain.source, chain.target)[:: 1 if forward else -1]
                if here in paths and there not in paths:
                    paths[there] = [*paths[here], (chain, forward)]
        if target not in paths:
            raise ValueError(f"no chain leads from frame {source} to frame {target}")
        return paths[target]


def _turned(vector: Vector, axis: str, sense: int, angle: Floats | float) -> Vector:
    """``R(axis, sense * angle) vector`` (eqs 1-3); cyclic, so that one formula serves the three axes."""
    cosine, sine = np.cos(angle), sense * np.sin(angle)
    own = AXES.index(axis)
    first, second = (own + 1) % 3, (own + 2) % 3
    turned = list(vector)
    turned[first] = cosine * vector[first] - sine * vector[second]
    turned[second] = sine * vector[first] + cosine * vector[second]
    return tuple(turned)


ANGLES = ("alpha1", "alpha2", "alpha3", "beta.lead", "alpha4.lead")
"""Dimensions that are angles; ratios of laws are pure numbers, all others are lengths."""


def dimensions(mechanism: Mechanism) -> dict[str, float]:
    """Every dimension and its value: parameters, ``law.lead`` and ``law.ratio`` of laws that are linear, ``point.axis``.

    Points without a name of their own in the source (a frame's origin) are left out.
    """
    found = {name: float(np.asarray(value)) for name, value in mechanism.parameters.items()}
    for name, law in mechanism.laws.items():
        if isinstance(law, Linear):
            found |= {f"{name}.lead": float(np.asarray(law.lead)), f"{name}.ratio": float(np.asarray(law.ratio))}
    for name, (_, xyz) in mechanism.points.items():
        if name.startswith("S"):
            found |= {f"{name}.{axis}": float(at) for axis, at in zip(AXES, xyz)}
    return found


def varied(mechanism: Mechanism, values: Mapping[str, Floats | float]) -> Mechanism:
    """The mechanism with other values of some dimensions, each a number or an array of shape (items,).

    Law: with the values of `dimensions` it is the same mechanism.

    Raises `FieldError`: a dimension that this mechanism does not have.
    """
    parameters, laws, points = dict(mechanism.parameters), dict(mechanism.laws), dict(mechanism.points)
    for name, value in values.items():
        owner, _, part = name.partition(".")
        law = laws.get(owner)
        if name in parameters:
            parameters[name] = value
        elif isinstance(law, Linear) and part in ("lead", "ratio"):
            laws[owner] = Linear(value, law.ratio) if part == "lead" else Linear(law.lead, value)
        elif owner in points and part in tuple(AXES):
            frame, xyz = points[owner]
            moved = list(xyz)
            moved[AXES.index(part)] = value
            points[owner] = (frame, tuple(moved))
        else:
            raise FieldError(
                "",
                f"there is no dimension {name}: a parameter, law.lead or law.ratio of a linear law, or point.i, .j, .k",
            )
    return replace(mechanism, parameters=parameters, laws=laws, points=points)
