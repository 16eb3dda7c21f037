"""The knotter as a row of frames from disc to jaw, joined by rotations and translations, and the laws of disc and jaw.

Frames, in order: ``u3`` turns with the disc, ``seat`` is the bearing of the disc (sigma2), ``shaft`` the machine's shaft
(sigma1), ``bearing`` the bearing of the bill (sigma0), ``u4`` turns with the bill and ``u5`` with the jaw. The driver is
the angle alpha of the bill.

Vectors are tuples ``(x, y, z)`` of arrays that broadcast against each other, so that a quantity that does not depend on
a parameter or on the driver is computed only once. Lengths are in the user's unit, angles in radians. Equation numbers
refer to the source named in `synthesis.scenes.knotter.d_knotter`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError
from synthesis.one_variable import EPSILON, Floats

Integers = NDArray[np.int_]
Vector = Sequence[Any] | NDArray[Any]
"""Three components: numbers, or arrays that broadcast against each other."""
Axis = Literal[0, 1, 2]
"""Axis i, j or k of a frame."""

FRAMES = ("u3", "seat", "shaft", "bearing", "u4", "u5")
"""Names of the frames, from disc to jaw."""
LAW_FRAMES = {"beta": "u3", "alpha4": "u5"}
"""Frame that turns by each law."""


@dataclass(frozen=True)
class SampleOptions:
    """Options of the samples over the driver's range."""

    turn_per_piece: float = 1.0
    """Largest rotation of a coordinate within a piece of the range, rad."""
    steps_per_piece: int = 16
    """Number of steps between samples in each piece."""
    max_pieces: int = 100_000
    """Largest number of pieces of a range."""


OPTIONS = SampleOptions()


def as_array(components: Iterable[Any], shape: tuple[int, ...]) -> Floats:
    """Broadcast numbers and arrays to a common shape and stack them along a new first axis."""
    return np.array([np.broadcast_to(component, shape) for component in components])


@dataclass(frozen=True)
class Linear:
    """The law ``lead + ratio * driver``, defined for every driver angle."""

    lead: float
    """Angle at driver angle zero, rad."""
    ratio: float = 0.0
    """Change of the angle per change of the driver angle."""

    driver: tuple[float, ...] = ()
    """Driver angles at which the law is not smooth: none."""

    def value(self, driver: Floats | float) -> Any:
        """Return the angle (rad) at each driver angle (rad)."""
        return self.lead + self.ratio * driver

    def rate_bound(self, first: float, last: float) -> float:
        """Return the largest ``|d angle / d driver|`` between two driver angles."""
        return abs(self.ratio)

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
    """Driver angles of the knots (rad), at least two and strictly increasing. The law may not be smooth there."""
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

    def value(self, driver: Floats | float) -> Any:
        """Return the angle (rad) at each driver angle (rad)."""
        if self.kind == "linear":
            return np.interp(driver, self.driver, self.angle)
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(self.driver, self.angle)(np.clip(driver, self.driver[0], self.driver[-1]))

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
        degrees = [f"{np.degrees(angle):.9g}" for angle in (start, end, first, last)]
        required = f"{degrees[2]} to {degrees[3]} degrees are" if first < last else f"{degrees[3]} degrees is"
        return (
            f"the law is not defined over the whole range: its table covers {degrees[0]} to {degrees[1]} degrees, but "
            f"{required} required"
        )


Law = Linear | Table
"""An angle as a function of the driver, smooth between the angles ``driver``."""


class Rotation(NamedTuple):
    """An active right-handed rotation about an axis (eqs 1-3)."""

    axis: Axis
    angle: Any

    def apply(self, vector: Vector, sense: int = 1) -> Vector:
        """Return the rotated vector; rotated back with sense -1."""
        cosine, sine = np.cos(self.angle), sense * np.sin(self.angle)
        first, second = (self.axis + 1) % 3, (self.axis + 2) % 3
        rotated = list(vector)
        rotated[first] = cosine * vector[first] - sine * vector[second]
        rotated[second] = sine * vector[first] + cosine * vector[second]
        return tuple(rotated)


class Translation(NamedTuple):
    """A translation along the three axes."""

    i: Any = 0.0
    j: Any = 0.0
    k: Any = 0.0

    def apply(self, vector: Vector, sense: int = 1) -> Vector:
        """Return the shifted vector; shifted back with sense -1."""
        return tuple(component + sense * length for component, length in zip(vector, self))


@dataclass(frozen=True)
class Mechanism:
    """Dimensions, laws and points of one knotter, or of several knotters with different dimensions."""

    parameters: Mapping[str, float | Floats]
    """Angles ``alpha1, alpha2, alpha3`` (rad) and lengths ``d1, D, d5, d6, d9, d10``.
    Arrays of shape (items,) let an object represent several knotters."""
    senses: Mapping[str, int]
    """Senses of rotation, 1 or -1: ``alpha`` of alpha1 and alpha3, and ``beta`` of the disc."""
    laws: Mapping[str, Law]
    """Laws ``beta`` of the disc and ``alpha4`` of the jaw."""
    points: Mapping[str, tuple[str, Vector]]
    """Frame and coordinates of each point, by name."""

    def with_parameters(self, **values: float | Floats) -> Mechanism:
        """Return the mechanism with other values of some parameters."""
        return replace(self, parameters={**self.parameters, **values})

    def with_locked_jaw(self, at: float) -> Mechanism:
        """Return the mechanism with a jaw that keeps its angle at driver angle ``at`` (rad)."""
        return replace(self, laws={**self.laws, "alpha4": Linear(float(self.laws["alpha4"].value(at)))})

    def select(self, index: Integers) -> Mechanism:
        """Return the knotters of the given items; parameters that are arrays take the shape of ``index``."""
        selected = {
            name: value[index] if isinstance(value, np.ndarray) and value.ndim else value
            for name, value in self.parameters.items()
        }
        return replace(self, parameters=selected)

    def position(self, point: str, frame: str, driver: Floats | float) -> Vector:
        """Return the coordinates of a point in a frame at driver angles (rad) that broadcast against the parameters."""
        home, coordinates = self.points[point]
        return self.transform(coordinates, home, frame, driver)

    def transform(self, vector: Vector, source: str, target: str, driver: Floats | float) -> Vector:
        """Transform coordinates between two frames at driver angles (rad) that broadcast against them."""
        start, stop = FRAMES.index(source), FRAMES.index(target)
        for joint in range(start, stop):
            for step in self._steps(joint, driver):
                vector = step.apply(vector)
        for joint in reversed(range(stop, start)):
            for step in reversed(self._steps(joint, driver)):
                vector = step.apply(vector, -1)
        return vector

    def _steps(self, joint: int, driver: Floats | float) -> tuple[Rotation | Translation, ...]:
        """Return the steps that transform coordinates from a frame to the next: eq 9 with explicit senses, eqs 22-24."""
        p, sense = self.parameters, self.senses["alpha"]
        if joint == 0:
            return (Rotation(1, self.senses["beta"] * self.laws["beta"].value(driver)),)
        if joint == 1:
            return Translation(j=-p["D"]), Rotation(0, -sense * p["alpha1"]), Translation(i=p["d5"], k=-p["d1"])
        if joint == 2:
            return Rotation(0, -sense * p["alpha3"]), Rotation(1, p["alpha2"]), Translation(k=p["d6"])
        if joint == 3:
            return (Rotation(2, driver),)
        return Translation(i=p["d9"], k=p["d10"]), Rotation(1, -self.laws["alpha4"].value(driver))

    def laws_of(self, frames: set[str]) -> dict[str, Law]:
        """Return the laws on the way between some frames."""
        return {name: self.laws[name] for name, frame in LAW_FRAMES.items() if frame in frames}

    def require_laws(self, frames: set[str], first: float, last: float) -> None:
        """Raise a `FieldError` if a law between the frames is not defined from driver angle ``first`` to ``last`` (rad)."""
        for name, law in sorted(self.laws_of(frames).items()):
            if reason := law.undefined_reason(first, last):
                raise FieldError(f"/laws/{name}", reason, constraint="law_range")

    def samples(self, frames: set[str], first: float, last: float) -> Floats:
        """Return driver angles (rad) from first to last, between which no coordinate in the frames turns far.

        All angles at which a law is not smooth are among them.

        Raises
        ------
        FieldError
            The range needs more than `SampleOptions.max_pieces` pieces.
        """
        laws = self.laws_of(frames).values()
        corners = np.unique([first, *(knot for law in laws for knot in law.driver if first < knot < last), last])
        if len(corners) == 1:
            corners = np.repeat(corners, 2)
        spans = list(itertools.pairwise(corners.tolist()))
        rates = (1.0 + sum(law.rate_bound(*span) for law in laws) for span in spans)
        pieces = [
            max(1.0, np.ceil((high - low) * rate / OPTIONS.turn_per_piece)) for (low, high), rate in zip(spans, rates)
        ]
        if sum(pieces) > OPTIONS.max_pieces:
            raise FieldError(
                "/laws",
                f"the laws turn so fast that a range must be divided into {sum(pieces):.0f} pieces, but at most "
                f"{OPTIONS.max_pieces} are allowed; give slower laws or a shorter range",
                constraint="work",
                amount=float(sum(pieces)),
            )
        steps = [
            np.linspace(low, high, OPTIONS.steps_per_piece * int(count) + 1)[1:]
            for (low, high), count in zip(spans, pieces)
        ]
        return np.concatenate([[first], *steps])

    def rounding_bound(self, frames: set[str], first: float, last: float) -> Any:
        """Bound the rounding error of every coordinate in some frames over a range of the driver (rad), as a length.

        Large dimensions cost digits when they are added, and so do angles of many turns.
        """
        reach: Any = reduce(np.maximum, (np.linalg.norm(xyz) for _, xyz in self.points.values()))
        reach = reach + sum(np.abs(self.parameters[name]) for name in ("d1", "D", "d5", "d6", "d9", "d10"))
        largest_angle = 1.0 + max(abs(first), abs(last))
        for law in self.laws_of(frames).values():
            largest_angle += abs(float(law.value(first))) + law.rate_bound(first, last) * (last - first)
        return 16 * EPSILON * largest_angle * reach
