"""Spatial mechanisms whose bodies turn under laws of a single driver.

A mechanism consists of frames, chains of rotations and translations between them, and points fixed in frames.
Each chain is written in a single direction; its inverse is derived from it.
Vectors are tuples ``(x, y, z)`` of arrays that broadcast against each other, so that a quantity that does not depend on
a parameter or on the driver is computed only once.
Lengths are in the user's unit, angles in radians.
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
"""Three components: numbers, or arrays that broadcast against each other."""

DRIVER = "driver"
"""Name by which a `Rotation` refers to the driver angle itself."""
AXES = "ijk"
"""Names of the three axes of a frame, in order."""


def as_array(components: Iterable[Any], shape: tuple[int, ...]) -> Floats:
    """Broadcast numbers and arrays to a common shape and stack them along a new first axis.

    Parameters
    ----------
    components : iterable of number or ndarray
        For example the three components of a `Vector`.
    shape : tuple of int
        Shape that each component is broadcast to.

    Returns
    -------
    ndarray, shape (number of components, *shape)
        The stacked components.
    """
    return np.array([np.broadcast_to(component, shape) for component in components])


@dataclass(frozen=True)
class Linear:
    """The law ``lead + ratio * driver``, defined for every driver angle.

    Both fields may be arrays of shape (items,), one value for each of several mechanisms.
    """

    lead: float | Floats
    """Angle at driver angle zero, rad."""
    ratio: float | Floats = 0.0
    """Change of the angle per change of the driver angle."""
    breakpoints: tuple[float, ...] = field(default=(), init=False)
    """Driver angles at which the law is not smooth: none."""

    def value(self, driver: Floats | float) -> Floats | float:
        """Return the angle (rad) at each driver angle (rad)."""
        return self.lead + self.ratio * driver

    def rate_bound(self, first: float, last: float) -> float:
        """Return the largest ``|d angle / d driver|`` between two driver angles."""
        return float(np.max(np.abs(self.ratio)))

    def undefined_reason(self, first: float, last: float) -> str | None:
        """Explain why the law is undefined over a range of the driver, or return None if it is defined."""
        return None


@dataclass(frozen=True)
class Table:
    """A law that interpolates a table, linearly or by a monotone cubic (pchip).

    At a knot the law equals the knot's angle; between two knots it stays between their angles.

    Raises
    ------
    ValueError
        There are fewer than two knots, the two columns differ in length, or the driver angles do not increase.
    """

    driver: tuple[float, ...]
    """Driver angles of the knots (rad), at least two and strictly increasing."""
    angle: tuple[float, ...]
    """Angles at the knots, rad."""
    kind: Literal["linear", "pchip"] = "linear"
    """Interpolation; pchip preserves monotonicity and has a continuous rate."""
    outside: Literal["hold", "error"] = "hold"
    """Behaviour before the first and after the last knot: hold the end angle, or be undefined.
    A table that holds must still overlap the requested driver range; a range completely outside it is a mistake."""

    def __post_init__(self) -> None:
        if len(self.driver) != len(self.angle) or len(self.driver) < 2:
            raise ValueError("a table needs at least two rows, each with a driver angle and an angle")
        steps = np.diff(self.driver)
        if not np.all(steps > 0):
            row = int(np.argmin(steps > 0)) + 2  # counted from 1
            raise ValueError(f"the driver angles must increase, but row {row} is not above the row before it")

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Driver angles of the knots; between two knots the law is a polynomial."""
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
        """Return the angle (rad) at each driver angle (rad), in the precision of ``driver``."""
        knots = np.array(self.driver)
        driver = np.clip(driver, knots[0], knots[-1])
        interval = np.clip(np.searchsorted(knots, driver, side="right") - 1, 0, len(knots) - 2)
        offset = driver - knots[interval]
        value: Floats = self._coefficients[0][interval]
        for coefficient in self._coefficients[1:]:
            value = value * offset + coefficient[interval]
        return value

    def rate_bound(self, first: float, last: float) -> float:
        """Return an upper bound of ``|d angle / d driver|`` between two driver angles.

        For pchip this is three times the steepest chord (Fritsch and Carlson).
        """
        knots = np.array(self.driver)
        overlaps = (knots[1:] > first) & (knots[:-1] < last)
        slopes = np.abs(np.diff(self.angle) / np.diff(knots))[overlaps]
        return float(slopes.max(initial=0.0)) * (3.0 if self.kind == "pchip" else 1.0)

    def undefined_reason(self, first: float, last: float) -> str | None:
        """Explain why the law is undefined over a range of the driver, or return None if it is defined."""
        start, end = self.driver[0], self.driver[-1]
        if self.outside == "error":
            defined = start <= first and last <= end
        else:
            defined = (start <= last and first <= end) or not first < last  # held at any single angle
        if defined:
            return None
        required = (
            f"{np.degrees(first):.9g} to {np.degrees(last):.9g} degrees are required"
            if first < last
            else f"{np.degrees(last):.9g} degrees is required"
        )
        return (
            f"the law is not defined over the whole range: its table covers {np.degrees(start):.9g} to "
            f"{np.degrees(end):.9g} degrees, but {required}"
        )


Law = Linear | Table
"""An angle as a function of the driver, smooth between its ``breakpoints``."""


@dataclass(frozen=True)
class Rotation:
    """An active right-handed rotation about an axis (eqs 1-3)."""

    axis: Literal["i", "j", "k"]
    """Axis of rotation."""
    angle: str
    """Name of a parameter or of a law, or `DRIVER`."""
    sense: int = 1
    """Factor of the angle, 1 or -1."""


@dataclass(frozen=True)
class Translation:
    """A translation; each component is a number, a parameter's name, or a minus sign and a parameter's name."""

    i: str | float = 0.0
    j: str | float = 0.0
    k: str | float = 0.0


@dataclass(frozen=True)
class Chain:
    """Rotations and translations that transform coordinates between two frames."""

    source: str
    """Frame of the given coordinates."""
    target: str
    """Frame of the resulting coordinates."""
    steps: tuple[Rotation | Translation, ...]
    """Steps in the order in which they are applied."""


@dataclass(frozen=True)
class Mechanism:
    """Frames joined by chains, points fixed in frames, and their parameters and laws.

    A point that is transformed to another frame and back returns to itself, to rounding.
    The distance between two points of the same frame is the same in every frame.
    """

    parameters: Mapping[str, float | Floats]
    """Lengths and angles by name.
    Arrays of shape (items,), here and in laws and points, let an object represent several mechanisms."""
    laws: Mapping[str, Law]
    """Laws of the angles that follow the driver, by name."""
    chains: tuple[Chain, ...]
    """Chains that join all frames into a tree."""
    points: Mapping[str, tuple[str, Vector]]
    """Frame and coordinates of each point, by name."""

    def with_parameters(self, **values: float | Floats) -> Mechanism:
        """Return the mechanism with other values of some parameters."""
        return replace(self, parameters={**self.parameters, **values})

    def with_locked_law(self, law: str, at: float) -> Mechanism:
        """Return the mechanism with one law held at its value at driver angle ``at`` (rad)."""
        return replace(self, laws={**self.laws, law: Linear(self.laws[law].value(np.float64(at)))})

    def select(self, index: Integers) -> Mechanism:
        """Return the mechanisms of the given items.

        Parameters
        ----------
        index : ndarray of int
            Indices of the items; parameters that are arrays take the shape of ``index``.
        """

        def selected(value: Any) -> Any:
            return value[index] if isinstance(value, np.ndarray) and value.ndim else value

        laws = {
            name: Linear(selected(law.lead), selected(law.ratio)) if isinstance(law, Linear) else law
            for name, law in self.laws.items()
        }
        points = {name: (frame, tuple(map(selected, xyz))) for name, (frame, xyz) in self.points.items()}
        parameters = {name: selected(value) for name, value in self.parameters.items()}
        return replace(self, parameters=parameters, laws=laws, points=points)

    def position(self, point: str, frame: str, driver: Floats | float) -> Vector:
        """Return the coordinates of a point in a frame.

        Parameters
        ----------
        point, frame : str
            Names of the point and of the frame.
        driver : ndarray or float
            Driver angles (rad) that broadcast against the parameters.

        Returns
        -------
        vector
            Coordinates in the precision of ``driver``.
        """
        home, coordinates = self.points[point]
        return self.transform(coordinates, home, frame, driver)

    def transform(self, vector: Vector, source: str, target: str, driver: Floats | float) -> Vector:
        """Transform coordinates between two frames.

        Parameters
        ----------
        vector : vector
            Coordinates in frame ``source``.
        source, target : str
            Names of the frames.
        driver : ndarray or float
            Driver angles (rad) that broadcast against the coordinates and the parameters.

        Returns
        -------
        vector
            Coordinates in frame ``target``, in the precision of ``driver``.

        Raises
        ------
        ValueError
            No sequence of chains joins the two frames.
        """
        precision = np.result_type(driver, float)
        if np.finfo(precision).nmant > np.finfo(float).nmant:
            vector = tuple(np.asarray(component, precision) for component in vector)
        for chain, forward in self._path(source, target):
            for step in chain.steps if forward else reversed(chain.steps):
                if isinstance(step, Rotation):
                    angle = np.asarray(self._angle(step, driver), precision)
                    vector = _rotate(vector, step.axis, step.sense if forward else -step.sense, angle)
                else:
                    sign = 1.0 if forward else -1.0
                    vector = tuple(
                        component + sign * self._length(length)
                        if not isinstance(length, float) or length
                        else component
                        for component, length in zip(vector, (step.i, step.j, step.k))
                    )
        return vector

    def laws_between(self, frames: set[str]) -> set[str]:
        """Return the names of the laws on the chains that join some frames."""
        first, *remaining = sorted(frames)
        steps = [step for frame in remaining for chain, _ in self._path(first, frame) for step in chain.steps]
        return {step.angle for step in steps if isinstance(step, Rotation) and step.angle in self.laws}

    def require_laws(self, frames: set[str], first: float, last: float, only: str | None = None) -> None:
        """Check that the laws between some frames are defined over a range of the driver.

        Parameters
        ----------
        frames : set of str
            Names of the frames.
        first, last : float
            Ends of the range, rad.
        only : str, optional
            Name of the only law to check.

        Raises
        ------
        FieldError
            A law is not defined over the whole range; the error names the first such law.
        """
        for name in sorted(self.laws_between(frames) & ({only} if only else set(self.laws))):
            if reason := self.laws[name].undefined_reason(first, last):
                raise FieldError(f"/laws/{name}", reason, constraint="law_range")

    def breakpoints(self, frames: set[str]) -> list[float]:
        """Return the driver angles (rad) at which a law between the frames is not smooth."""
        return sorted({knot for name in self.laws_between(frames) for knot in self.laws[name].breakpoints})

    def turning_rate(self, frames: set[str], first: float, last: float) -> float:
        """Return an upper bound of the rotation of coordinates between the frames per rotation of the driver."""
        return 1.0 + sum(self.laws[name].rate_bound(first, last) for name in self.laws_between(frames))

    def rounding_bound(self, frames: set[str], first: float, last: float) -> Floats | float:
        """Bound the rounding error of every coordinate in some frames.

        Large dimensions cost digits when they are added, and so do angles of many turns.

        Parameters
        ----------
        frames : set of str
            Names of the frames.
        first, last : float
            Range of the driver, rad.

        Returns
        -------
        float or ndarray, shape (items,)
            The bound, as a length.
        """
        translations = [step for chain in self.chains for step in chain.steps if isinstance(step, Translation)]
        distances = [np.sqrt(sum(np.square(coordinate) for coordinate in xyz)) for _, xyz in self.points.values()]
        reach: Any = reduce(np.maximum, distances, 0.0)
        reach += sum(abs(self._length(length)) for step in translations for length in (step.i, step.j, step.k))
        largest_angle: Any = 1.0 + max(abs(first), abs(last))
        for name in self.laws_between(frames):
            law = self.laws[name]
            initial = np.abs(law.value(np.float64(first)))
            largest_angle = largest_angle + initial + law.rate_bound(first, last) * (last - first)
        bound: Floats | float = 16 * EPSILON * largest_angle * reach
        return bound

    def _length(self, length: str | float) -> Any:
        if isinstance(length, str):
            return -self.parameters[length[1:]] if length.startswith("-") else self.parameters[length]
        return length

    def _angle(self, step: Rotation, driver: Floats | float) -> Floats | float:
        if step.angle == DRIVER:
            return driver
        return self.laws[step.angle].value(driver) if step.angle in self.laws else self.parameters[step.angle]

    def _path(self, source: str, target: str) -> list[tuple[Chain, bool]]:
        """Return the chains from one frame to another, each with True if it is followed from source to target."""
        paths: dict[str, list[tuple[Chain, bool]]] = {source: []}
        directed_chains = [(chain, forward) for chain in self.chains for forward in (True, False)]
        for _ in self.chains:
            for chain, forward in directed_chains:
                tail, head = (chain.source, chain.target)[:: 1 if forward else -1]
                if tail in paths and head not in paths:
                    paths[head] = [*paths[tail], (chain, forward)]
        if target not in paths:
            raise ValueError(f"no chain leads from frame {source} to frame {target}")
        return paths[target]


def _rotate(vector: Vector, axis: str, sense: int, angle: Floats | float) -> Vector:
    """Return ``R(axis, sense * angle) vector`` (eqs 1-3), by one formula that is cyclic in the three axes."""
    cosine, sine = np.cos(angle), sense * np.sin(angle)
    axis_index = AXES.index(axis)
    first, second = (axis_index + 1) % 3, (axis_index + 2) % 3
    rotated = list(vector)
    rotated[first] = cosine * vector[first] - sine * vector[second]
    rotated[second] = sine * vector[first] + cosine * vector[second]
    return tuple(rotated)
