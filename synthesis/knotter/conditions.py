"""Conditions on a mechanism, each with a verdict and a margin.

A condition says whether it *holds* for each item of a mechanism, by how much (`margin`, positive where it holds,
continuous across the limit) and where. An item that fails is a result, not an exception; what is undefined for it is
NaN under a mask that says so.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, Protocol, TypeVar

import numpy as np

from synthesis.errors import FieldError
from synthesis.knotter import events
from synthesis.knotter.mechanism import Integers, Mechanism, as_array
from synthesis.one_variable import Flags, Floats
from synthesis.work import Work

MAX_PIECES = 500_000
"""Most pieces (grid items x pieces of the driver's range) that one condition may look at."""
CHUNK_PIECES = 4096
"""Pieces that are worked on at once: bounds the memory and keeps the arrays in the cache."""


class Condition(Protocol):
    """One requirement on a mechanism."""

    @property
    def name(self) -> str:
        """What results are found by."""

    def check(self, mechanism: Mechanism) -> None:
        """Raise `FieldError` for what has no answer at any parameters."""

    def evaluate(self, mechanism: Mechanism, items: int, work: Work | None = None) -> Result:
        """The verdict for each item; ``work`` is asked before each few of them."""


@dataclass(frozen=True)
class Result:
    """A condition's verdict; each array has shape (items,)."""

    holds: Flags
    margin: Floats


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

    value: Floats
    worst: Floats
    worst_driver: Floats


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

    def evaluate(self, mechanism: Mechanism, items: int, work: Work | None = None) -> Reach:
        """The verdict for each item."""
        if self.locked is not None:
            mechanism = mechanism.locked(self.locked, self.at)
        return in_chunks(self._evaluate, mechanism, items, self.frames(mechanism), self.over, self.name, work)

    def depth(self, mechanism: Mechanism, driver: Floats | float) -> Any:
        """How far the point is past the plane or inside the solid; negative outside."""
        depth, off_axis = self._coordinates(mechanism, driver)
        if np.isinf(self.radius):
            return depth
        beyond = off_axis - self.radius
        outside = np.hypot(np.maximum(beyond, 0), np.maximum(-depth, 0))
        return np.where((beyond < 0) & (depth > 0), np.minimum(depth, -beyond), -outside)

    def _coordinates(self, mechanism: Mechanism, driver: Floats | float) -> tuple[Any, Any]:
        position = mechanism.position(self.point, self.frame, driver)
        off_axis = np.hypot(position[(self.axis + 1) % 3], position[(self.axis + 2) % 3])
        return -self.side * position[self.axis], off_axis

    def _evaluate(self, mechanism: Mechanism, items: int, ends: Floats) -> Reach:
        def function(driver: Floats, item: Integers) -> Floats:
            depth, off_axis = self._coordinates(mechanism.item(item), driver)
            beyond = off_axis - self.radius
            # The depth has kinks at roots of the first three; between them it is extreme where one of the four is.
            rows = (depth, beyond, depth + beyond, beyond**2 + depth**2)
            return as_array(
                rows[:1] if np.isinf(self.radius) else rows, np.broadcast_shapes(driver.shape, item.shape)
            )

        every = np.arange(items)
        value = np.broadcast_to(self.depth(mechanism.item(every), self.at), (items,))
        rounding = np.broadcast_to(mechanism.rounding(self.frames(mechanism), *self.over), (items,))
        floor = rounding[None]
        if np.isfinite(self.radius):
            floor = np.stack([rounding, rounding, rounding, rounding * (np.abs(value) + self.radius)])
        parts = events.pieces(function, ends, items, floor)
        found = [events.extremes(parts, floor)]
        if np.isfinite(self.radius):
            found.append(events.roots(parts, None, floor))
        item = np.concatenate([np.repeat(every, len(ends)), *(part.item for part in found)])
        driver = np.concatenate([np.tile(ends, items), *(part.driver for part in found)])
        depth = np.broadcast_to(self.depth(mechanism.item(item), driver), item.shape)
        order = np.lexsort((driver, -depth, item))
        leading = order[np.searchsorted(item[order], every)]
        worst = depth[leading]
        return Reach(worst < 0, -worst, value, worst, driver[leading])


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
    function: Callable[[Mapping[str, Floats | float]], Floats | float]

    def check(self, mechanism: Mechanism) -> None:
        """A number needs no law and no point."""

    def evaluate(self, mechanism: Mechanism, items: int, work: Work | None = None) -> Result:
        """The verdict for each item."""
        value = np.broadcast_to(self.function(mechanism.parameters), (items,)).astype(float)
        return Result(value > 0, value)


Evaluated = TypeVar("Evaluated", bound=Result)


def in_chunks(
    evaluate: Callable[[Mechanism, int, Floats], Evaluated],
    mechanism: Mechanism,
    items: int,
    frames: set[str],
    over: tuple[float, float],
    name: str,
    work: Work | None = None,
) -> Evaluated:
    """A result over all items from results over a few items at a time.

    ``evaluate(mechanism, items, ends)`` is given the ends of the pieces of the range ``over`` in which nothing turns far
    between the frames; ``name`` is the condition's, for the refusal. ``work`` is asked before each few items.
    """
    ends = events.piece_ends(*over, mechanism.breakpoints(frames), partial(mechanism.turning_rate, frames))
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
    parts = (np.arange(start, min(start + step, items)) for start in range(0, items, step))
    results, work = [], work or Work()
    for part in parts:
        work.go_on()
        results.append(evaluate(mechanism.item(part), len(part), ends))
    every = (np.concatenate([getattr(result, field.name) for result in results]) for field in fields(results[0]))
    return type(results[0])(*every)
