"""Conditions on a mechanism, each with a verdict and a margin.

A condition says whether it *holds* for each item of a mechanism, by how much (`margin`, positive where it holds,
continuous across the limit) and where. An item that fails is a result, not an exception; what is undefined for it is
NaN under a mask that says so.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np

from synthesis.errors import FieldError
from synthesis.knotter import events
from synthesis.knotter.mechanism import Mechanism

MAX_PIECES = 500_000
"""Most pieces (grid items x pieces of the driver's range) that one condition may look at."""
CHUNK_PIECES = 4096
"""Pieces that are worked on at once: bounds the memory and keeps the arrays in the cache."""


class Condition(Protocol):
    """One requirement on a mechanism."""

    @property
    def name(self) -> str: ...

    def check(self, mechanism: Mechanism) -> None: ...

    def evaluate(self, mechanism: Mechanism, items: int) -> Result: ...


@dataclass(frozen=True)
class Result:
    """A condition's verdict; each array has shape (items,)."""

    holds: np.ndarray
    margin: np.ndarray


@dataclass(frozen=True)
class Reach(Result):
    """How far a point comes past a plane or into a disc.

    Attributes
    ----------
    value : ndarray
        At the condition's own driver angle; positive is past the plane or inside.
    worst, worst_driver : ndarray
        The largest over the range and the driver angle (rad) where it is reached.
    """

    value: np.ndarray
    worst: np.ndarray
    worst_driver: np.ndarray


@dataclass(frozen=True)
class Clearance:
    """A point must keep to one side of a disc's plane, or out of the disc and what lies behind it.

    Parameters
    ----------
    name : str
    point : str
    frame : str
        Frame of the disc: it lies in the plane through the origin across ``axis``.
    axis : int
        0, 1, 2 for i, j, k.
    side : int
        The side that is free: -1 for negative coordinates.
    at : float
        Driver angle of ``value``, rad.
    over : (float, float)
        Range of the driver in which the worst is sought, rad; the two may be equal.
    radius : float
        Of the disc; infinite for the whole plane.
    locked : str or None
        A law that is held at its value at ``at``, for a body that is locked during the passage.

    Notes
    -----
    With a finite radius the value is minus the signed distance to the solid of all points on the disc or behind it (a
    half-infinite cylinder). Law: never larger than the plane's value, and equal to it as the radius grows.
    """

    name: str
    point: str
    frame: str
    axis: int
    side: int
    at: float
    over: tuple[float, float]
    radius: float = np.inf
    locked: str | None = None

    def frames(self, mechanism: Mechanism) -> set[str]:
        """Frames that the condition moves the point between."""
        return {mechanism.points[self.point][0], self.frame}

    def check(self, mechanism: Mechanism) -> None:
        """Raise `FieldError` for laws that end within the range."""
        if self.locked is not None:
            mechanism.require_laws(self.frames(mechanism), self.at, self.at, only=self.locked)
            mechanism = mechanism.locked(self.locked, self.at)
        mechanism.require_laws(self.frames(mechanism), min(self.at, self.over[0]), max(self.at, self.over[1]))

    def evaluate(self, mechanism: Mechanism, items: int) -> Reach:
        """The verdict for each item."""
        if self.locked is not None:
            mechanism = mechanism.locked(self.locked, self.at)
        frames = self.frames(mechanism)
        first, last = self.over
        ends = events.piece_ends(first, last, mechanism.breakpoints(frames), partial(mechanism.turning_rate, frames))
        return in_chunks(lambda part, count: self._evaluate(part, count, ends), mechanism, items, ends, self.name)

    def depth(self, mechanism: Mechanism, driver: np.ndarray) -> np.ndarray:
        """How far the point is past the plane or inside the solid; negative outside."""
        depth, off_axis = self._coordinates(mechanism, driver)
        if np.isinf(self.radius):
            return depth
        beyond = off_axis - self.radius
        outside = np.hypot(np.maximum(beyond, 0), np.maximum(-depth, 0))
        return np.where((beyond < 0) & (depth > 0), np.minimum(depth, -beyond), -outside)

    def _coordinates(self, mechanism: Mechanism, driver: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        position = mechanism.position(self.point, self.frame, driver)
        off_axis = np.hypot(position[(self.axis + 1) % 3], position[(self.axis + 2) % 3])
        return -self.side * position[self.axis], off_axis

    def _evaluate(self, mechanism: Mechanism, items: int, ends: np.ndarray) -> Reach:
        def function(driver: np.ndarray, item: np.ndarray) -> np.ndarray:
            shape = np.broadcast_shapes(driver.shape, item.shape)
            depth, off_axis = self._coordinates(mechanism.item(item), driver)
            if np.isinf(self.radius):
                return np.broadcast_to(depth, shape)[None]
            beyond = off_axis - self.radius
            # The depth has kinks at roots of the first three; between them it is extreme where one of the four is.
            rows = (depth, beyond, depth + beyond, beyond**2 + depth**2)
            return np.array([np.broadcast_to(row, shape) for row in rows])

        every = np.arange(items)
        value = np.broadcast_to(self.depth(mechanism.item(every), np.float64(self.at)), (items,))
        item = np.repeat(every, len(ends))
        driver = np.tile(ends, items)
        if self.over[1] > self.over[0]:
            rounding = np.broadcast_to(mechanism.rounding(self.frames(mechanism), *self.over), (items,))
            floor = rounding[None]
            if np.isfinite(self.radius):
                far = np.abs(value) + self.radius
                floor = np.array([rounding, rounding, rounding, rounding * far])
            parts = events.pieces(function, ends, items, floor)
            found = [events.extremes(parts, floor)]
            if np.isfinite(self.radius):
                found.append(events.roots(parts, None, floor))
            item = np.concatenate([item, *(part.item for part in found)])
            driver = np.concatenate([driver, *(part.driver for part in found)])
        depth = np.broadcast_to(self.depth(mechanism.item(item), driver), item.shape)
        order = np.lexsort((driver, -depth, item))
        leading = order[np.searchsorted(item[order], every)]
        worst = depth[leading]
        return Reach(worst < 0, -worst, value, worst, driver[leading])


@dataclass(frozen=True)
class Value(Result):
    """A scalar condition's value, shape (items,)."""

    value: np.ndarray


@dataclass(frozen=True)
class Scalar:
    """A number made from the parameters must be positive.

    Parameters
    ----------
    name : str
    function : callable
        Takes the mapping of parameters; vectorised over them.
    """

    name: str
    function: Callable[[Mapping[str, np.ndarray | float]], np.ndarray]

    def check(self, mechanism: Mechanism) -> None:
        """A number needs no law and no point."""

    def evaluate(self, mechanism: Mechanism, items: int) -> Value:
        """The verdict for each item."""
        value = np.broadcast_to(self.function(mechanism.parameters), (items,)).astype(float)
        return Value(value > 0, value, value)


def in_chunks(
    evaluate: Callable[[Mechanism, int], Result], mechanism: Mechanism, items: int, ends: np.ndarray, name: str
) -> Result:
    """A result over all items from results over a few items at a time."""
    count = len(ends) - 1
    if items * count > MAX_PIECES:
        raise FieldError(
            "",
            f"{name} would take {items * count} pieces, at most {MAX_PIECES} are allowed: ask for a coarser grid, a "
            "shorter range of the driver, slower laws or shorter tables",
            constraint="work",
            amount=items * count,
        )
    step = max(1, CHUNK_PIECES // count)
    results = [
        evaluate(mechanism.item(part := np.arange(start, min(start + step, items))), len(part))
        for start in range(0, items, step)
    ]
    kind = type(results[0])
    return kind(
        *(np.concatenate([getattr(result, name) for result in results]) for name in kind.__dataclass_fields__)
    )
