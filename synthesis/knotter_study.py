"""Conditions on a mechanism, each with a verdict and a margin, over a grid of its parameters.

A condition says whether it *holds* for each item of a mechanism, by how much (`margin`, positive where it holds,
continuous across the limit) and where. An item that fails is a result, not an exception; what is undefined for it is
NaN under a mask that says so.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from typing import Protocol

import numpy as np

from synthesis import knotter_events as events
from synthesis import knotter_predicates as predicates
from synthesis.errors import FieldError
from synthesis.knotter_mechanism import Mechanism, Vector

MAX_PIECES = 500_000
"""Most pieces (grid items x pieces of the driver's range) that one condition may look at."""
CHUNK_PIECES = 4096
"""Pieces that are worked on at once: bounds the memory and keeps the arrays in the cache."""
NARROW = 1e-5
"""Windows narrower than this (rad) are confirmed in extended precision."""
APPROACH_STEPS = 60
"""Golden-section steps of the closest approach: from a piece's node distance to below 1e-13 of it."""


class Found(IntEnum):
    """What a search for a segment's entry into a triangle found; ``sentence`` is what the user reads."""

    ENTERS = 0, "the segment first enters through the wanted edge"
    ENTERS_ELSEWHERE = 1, "the segment first enters through another edge, or with one end through the plane"
    INSIDE_AT_START = 2, "the segment is inside already where the range starts"
    NEVER = 3, "the segment never crosses the triangle in the range"
    ALWAYS_IN_PLANE = 4, "an end of the segment lies in the triangle's plane throughout: it never crosses"

    def __new__(cls, code: int, sentence: str) -> Found:
        member = int.__new__(cls, code)
        member._value_ = code
        member.sentence = sentence
        return member


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
class Entry(Result):
    """How a segment enters a triangle; NaN (and -1 for the edge) where ``found`` says that there is no such thing.

    Attributes
    ----------
    found : ndarray of int
        Values of `Found`.
    enter, leave : ndarray
        Driver angles (rad) of the first window; ``leave`` is the range's end if the segment stays inside.
    opened_by : ndarray of int
        0, 1: an end of the segment came through the plane; 2, 3, 4: the edge of entry, from its first vertex;
        -1: inside at the start or never inside.
    point : ndarray, shape (items, 3)
        The crossing at ``enter``.
    fraction : ndarray
        Where ``point`` lies along the entry edge, 0 at its first vertex.
    windows : ndarray of int
        Number of separate windows in the range.
    """

    found: np.ndarray
    enter: np.ndarray
    leave: np.ndarray
    opened_by: np.ndarray
    point: np.ndarray
    fraction: np.ndarray
    windows: np.ndarray


@dataclass(frozen=True)
class SegmentHitsTriangle:
    """A segment must first enter a triangle through one named edge, within a range of the driver.

    Parameters
    ----------
    name : str
    segment : (str, str)
    triangle : (str, str, str)
        Names of points.
    frame : str
        Frame in which the crossing is reported.
    window : (float, float)
        Range of the driver, rad.
    enter : int
        The wanted edge: 0, 1, 2 for the edges from the first, second and third vertex.

    Notes
    -----
    ``margin`` (length) is, where the condition holds, the distance of the entry point to the nearer end of the wanted
    edge. Where the segment enters elsewhere it is minus the distance of the entry point to the wanted edge, and where
    it never enters minus the smallest distance of segment and triangle in the range. The three meet at zero.
    """

    name: str
    segment: tuple[str, str]
    triangle: tuple[str, str, str]
    frame: str
    window: tuple[float, float]
    enter: int

    @property
    def edge_names(self) -> tuple[str, str, str]:
        """Names of the edges, each from one vertex to the next."""
        a, b, c = self.triangle
        return a + b, b + c, c + a

    def frames(self, mechanism: Mechanism) -> set[str]:
        """Frames that the condition moves points between."""
        return {mechanism.points[point][0] for point in (*self.segment, *self.triangle)} | {self.frame}

    def check(self, mechanism: Mechanism) -> None:
        """Raise `FieldError` for points that make no segment or triangle, and for laws that end within the range."""
        mechanism.require_laws(self.frames(mechanism), *self.window)
        home = {name: mechanism.points[name] for name in (*self.segment, *self.triangle)}
        names = list(home)
        for index, first in enumerate(names):
            for second in names[index + 1 :]:
                if home[first][0] == home[second][0] and _coincide(home[first][1], home[second][1]):
                    raise FieldError(
                        "/points",
                        f"{first} and {second} coincide, so {self.name} has no "
                        + ("triangle" if {first, second} <= set(self.triangle) else "segment that could cross"),
                        constraint="coincident_points",
                        points=[first, second],
                    )

    def positions(self, mechanism: Mechanism, driver: np.ndarray) -> tuple[Vector, ...]:
        """The segment's ends and the triangle's vertices in `frame`."""
        return tuple(mechanism.position(name, self.frame, driver) for name in (*self.segment, *self.triangle))

    def evaluate(self, mechanism: Mechanism, items: int) -> Entry:
        """The verdict for each item."""
        frames = self.frames(mechanism)
        first, last = self.window
        ends = events.edges(first, last, mechanism.breakpoints(frames), partial(mechanism.turning_rate, frames))
        return _in_chunks(lambda part, count: self._evaluate(part, count, ends), mechanism, items, ends, self.name)

    def _evaluate(self, mechanism: Mechanism, items: int, ends: np.ndarray) -> Entry:
        def function(driver: np.ndarray, item: np.ndarray) -> np.ndarray:
            signs = predicates.orientations(*self.positions(mechanism.item(item), driver))
            shape = np.broadcast_shapes(driver.shape, item.shape)
            return np.array([np.broadcast_to(sign, shape) for sign in signs])

        floor = self._floor(mechanism, items, ends)
        parts = events.pieces(function, ends, items, floor)
        in_plane = np.any(parts.size[:2] <= floor[:2], axis=0)
        found = events.roots(parts, function, floor)
        item, start, end, opened_by = _windows(function, found, ends, items, ~in_plane)

        windows = np.bincount(item, minlength=items)
        has = windows > 0
        leading = np.searchsorted(item, np.flatnonzero(has))
        enter, leave, fraction, margin = (np.full(items, np.nan) for _ in range(4))
        opened = np.full(items, -1)
        enter[has], leave[has], opened[has] = start[leading], end[leading], opened_by[leading]

        kind = np.full(items, Found.ENTERS_ELSEWHERE)
        kind[opened == 2 + self.enter] = Found.ENTERS
        kind[has & (opened < 0)] = Found.INSIDE_AT_START
        kind[~has] = Found.NEVER
        kind[in_plane] = Found.ALWAYS_IN_PLANE

        point = np.full((items, 3), np.nan)
        rows = np.flatnonzero(has)
        if len(rows):
            p, q, *corners = self.positions(mechanism.item(rows), enter[rows])
            crossing = predicates.crossing_point(p, q, *corners)
            point[rows] = np.stack([np.broadcast_to(x, rows.shape) for x in crossing], axis=-1)
            for edge in range(3):
                a, b = corners[edge], corners[(edge + 1) % 3]
                ab = predicates.subtract(b, a)
                length2 = predicates.dot(ab, ab)
                f = predicates.dot(predicates.subtract(crossing, a), ab) / np.where(length2 > 0, length2, 1.0)
                through = opened[rows] == 2 + edge
                fraction[rows[through]] = np.broadcast_to(f, rows.shape)[through]
                if edge == self.enter:
                    inner = np.minimum(f, 1 - f) * np.sqrt(length2)
                    outer = predicates.norm(predicates.subtract(crossing, predicates.along(a, ab, np.clip(f, 0, 1))))
                    margin[rows] = np.where(through, np.maximum(inner, 0.0), -outer)
        missing = np.flatnonzero(~has)
        if len(missing):
            margin[missing] = -self._closest_approach(mechanism.item(missing[:, None]), ends)
        holds = kind == Found.ENTERS
        return Entry(holds, margin, kind, enter, leave, opened, point, fraction, windows)

    def _floor(self, mechanism: Mechanism, items: int, ends: np.ndarray) -> np.ndarray:
        """Rounding error of the five orientations, shape (5, items); refuses a triangle without area."""
        driver = ends[None]
        p, q, a, b, c = self.positions(mechanism.item(np.arange(items)[:, None]), driver)
        far = predicates.norm(predicates.subtract(p, a)) + predicates.norm(predicates.subtract(q, a))
        far = np.broadcast_to(far, (items, len(ends))).max(axis=1)
        ab, ac = predicates.subtract(b, a), predicates.subtract(c, a)
        area = np.broadcast_to(predicates.norm(predicates.cross(ab, ac)), (items, len(ends))).max(axis=1)
        sides = np.broadcast_to(predicates.norm(ab) + predicates.norm(ac), (items, len(ends))).max(axis=1)
        rounding = np.broadcast_to(mechanism.rounding(self.frames(mechanism), *self.window), (items,))
        if np.any(area <= rounding * sides):
            raise FieldError(
                "/points",
                f"{', '.join(self.triangle[:2])} and {self.triangle[2]} lie on one line, so {self.name} has no triangle",
                constraint="degenerate_triangle",
                points=list(self.triangle),
                amount=float(area.min()) / 2,
            )
        side = rounding * area
        edge = rounding * area**2 * sides * far
        return np.stack([side, side, edge, edge, edge])

    def _closest_approach(self, mechanism: Mechanism, ends: np.ndarray) -> np.ndarray:
        """The smallest distance of segment and triangle, shape (items,), for parameters of shape (items, 1)."""
        grid = np.linspace(ends[:-1], ends[1:], 7)[:-1].T.ravel()
        grid = np.append(grid, ends[-1])
        near = predicates.segment_triangle_distance(*self.positions(mechanism, grid[None]))
        near = np.atleast_2d(near)
        best = np.argmin(near, axis=1)[:, None]
        left, right = grid[np.maximum(best - 1, 0)], grid[np.minimum(best + 1, len(grid) - 1)]
        golden = (np.sqrt(5) - 1) / 2

        def distance(driver: np.ndarray) -> np.ndarray:
            return predicates.segment_triangle_distance(*self.positions(mechanism, driver))

        low, high = right - golden * (right - left), left + golden * (right - left)
        at_low, at_high = distance(low), distance(high)
        for _ in range(APPROACH_STEPS):
            lower = at_low <= at_high
            left, right = np.where(lower, left, low), np.where(lower, high, right)
            low_new = np.where(lower, right - golden * (right - left), high)
            high_new = np.where(lower, low, left + golden * (right - left))
            fresh = distance(np.where(lower, low_new, high_new))
            at_low, at_high = np.where(lower, fresh, at_high), np.where(lower, at_low, fresh)
            low, high = low_new, high_new
        return np.minimum(near.min(axis=1), np.minimum(at_low, at_high)[:, 0])


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
            mechanism = mechanism.locked(self.locked, self.at)
        mechanism.require_laws(self.frames(mechanism), min(self.at, self.over[0]), max(self.at, self.over[1]))

    def evaluate(self, mechanism: Mechanism, items: int) -> Reach:
        """The verdict for each item."""
        if self.locked is not None:
            mechanism = mechanism.locked(self.locked, self.at)
        frames = self.frames(mechanism)
        first, last = self.over
        ends = events.edges(first, last, mechanism.breakpoints(frames), partial(mechanism.turning_rate, frames))
        return _in_chunks(lambda part, count: self._evaluate(part, count, ends), mechanism, items, ends, self.name)

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
            # Between its kinks, which are roots of the first three, the depth is extreme only where one of the last is.
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


@dataclass(frozen=True)
class StudyResult:
    """The verdicts over a grid.

    Attributes
    ----------
    grid : mapping of str to ndarray, shape (items,)
        Each item's value of every grid parameter; the last parameter varies fastest.
    conditions : mapping of str to Result
    feasible : ndarray of bool, shape (items,)
        Where all conditions hold.
    margin : ndarray, shape (items,)
        The smallest margin of all conditions.
    """

    grid: Mapping[str, np.ndarray]
    conditions: Mapping[str, Result]
    feasible: np.ndarray
    margin: np.ndarray


def study(mechanism: Mechanism, grid: Mapping[str, Sequence[float]], conditions: Sequence[Condition]) -> StudyResult:
    """Every condition for every combination of the grid's parameters.

    Raises
    ------
    FieldError
        An empty grid, degenerate points, a law that is not defined over a condition's range, too much work.

    Notes
    -----
    Law: an item's result does not depend on the other items of the grid.
    """
    for name, values in grid.items():
        if len(values) == 0:
            raise FieldError(f"/grid/{name}", "the grid is empty: at least one value is needed", constraint="min_length")
    axes = np.meshgrid(*(np.asarray(values, float) for values in grid.values()), indexing="ij")
    flat = {name: axis.ravel() for name, axis in zip(grid, axes)}
    items = len(next(iter(flat.values()))) if flat else 1
    mechanism = mechanism.with_parameters(**flat)
    for condition in conditions:
        condition.check(mechanism)
    results = {condition.name: condition.evaluate(mechanism, items) for condition in conditions}
    return StudyResult(
        flat,
        results,
        np.logical_and.reduce([np.ones(items, bool), *(result.holds for result in results.values())]),
        np.minimum.reduce([np.full(items, np.inf), *(result.margin for result in results.values())]),
    )


@dataclass(frozen=True)
class Limit:
    """A parameter's value at which a verdict changes.

    Attributes
    ----------
    value : float
        The last value at which the condition holds, to rounding.
    holds_above : bool
        Whether it holds on the upper side.
    result : Result
        The condition at ``value``, arrays of one item.
    """

    value: float
    holds_above: bool
    result: Result


def solve(
    mechanism: Mechanism, condition: Condition, parameter: str, between: tuple[float, float], samples: int = 257
) -> list[Limit]:
    """Every limit of a condition in one parameter that ``samples`` evenly spaced values tell apart, increasing.

    Notes
    -----
    Where the condition holds between two samples only, neither sees it; the verdict at a sample is exact, the search
    over the parameter is as fine as its samples. Each sign change is then cut into 16 until the doubles are exhausted.
    Law: the condition holds at ``value`` and fails at the next samples beyond it.
    """
    condition.check(mechanism)

    def verdict(values: np.ndarray) -> np.ndarray:
        return condition.evaluate(mechanism.with_parameters(**{parameter: values}), len(values)).holds

    values = np.linspace(*between, samples)
    holds = verdict(values)
    at = np.flatnonzero(holds[1:] != holds[:-1])
    left, right, rises = values[at], values[at + 1], holds[at + 1]
    cut = np.linspace(0, 1, 17)
    for _ in range(13 if len(at) else 0):
        inner = left[:, None] + (right - left)[:, None] * cut
        inner[:, -1] = right
        # The first change in the bracket: its ends differ by construction.
        state = verdict(inner[:, 1:-1].ravel()).reshape(len(at), -1) == rises[:, None]
        state = np.concatenate([state, np.ones((len(at), 1), bool)], axis=1)
        first = np.argmax(state, axis=1)[:, None]
        left = np.take_along_axis(inner, first, 1)[:, 0]
        right = np.take_along_axis(inner, first + 1, 1)[:, 0]
    limits = []
    for low, high, above in zip(left, right, rises):
        value = float(high if above else low)
        limits.append(
            Limit(value, bool(above), condition.evaluate(mechanism.with_parameters(**{parameter: np.array([value])}), 1))
        )
    return limits


def _coincide(first: tuple[float, float, float], second: tuple[float, float, float]) -> bool:
    distance = np.linalg.norm(np.subtract(first, second))
    return bool(distance <= 4 * predicates.UNIT_ROUNDOFF * (np.linalg.norm(first) + np.linalg.norm(second)))


def _in_chunks(
    evaluate: Callable[[Mechanism, int], Result], mechanism: Mechanism, items: int, ends: np.ndarray, name: str
) -> Result:
    """A result over all items from results over a few items at a time."""
    count = len(ends) - 1
    if items * count > MAX_PIECES:
        raise FieldError(
            "/grid",
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
    return kind(*(np.concatenate([getattr(result, name) for result in results]) for name in kind.__dataclass_fields__))


def _windows(
    function: events.Function, found: events.Events, ends: np.ndarray, items: int, allowed: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Ranges of the driver in which the segment is inside, sorted by item and driver.

    The orientations change sign at events only, so one look between two neighbouring events decides.

    Returns
    -------
    tuple of ndarray
        Item, start, end, and the function whose root is the start (-1: the range's start).
    """
    every = np.arange(items)
    item = np.concatenate([found.item, every, every])
    driver = np.concatenate([found.driver, np.full(items, ends[0]), np.full(items, ends[-1])])
    kind = np.concatenate([found.function, np.full(items, -1), np.full(items, 9)])
    order = np.lexsort((kind, driver, item))
    item, driver, kind = item[order], driver[order], kind[order]
    span = np.flatnonzero((item[1:] == item[:-1]) & (driver[1:] > driver[:-1]))
    width = driver[span + 1] - driver[span]
    middle = driver[span] + 0.5 * width
    hit = predicates.inside(tuple(function(middle, item[span])))
    narrow = np.flatnonzero(width < NARROW)
    if len(narrow):
        extended = driver[span[narrow]] + 0.5 * width[narrow].astype(np.longdouble)
        hit[narrow] = predicates.inside(tuple(function(extended, item[span[narrow]])))
    span = span[hit & allowed[item[span]]]
    # Two neighbouring spans that are both inside are one window: the event between them was none of the five's.
    continued = np.zeros(len(span), bool)
    continued[1:] = (span[1:] == span[:-1] + 1) & (item[span[1:]] == item[span[:-1]])
    starts = np.flatnonzero(~continued)
    stops = np.append(starts[1:], len(span)) - 1 if len(span) else starts
    return item[span[starts]], driver[span[starts]], driver[span[stops] + 1], kind[span[starts]]
