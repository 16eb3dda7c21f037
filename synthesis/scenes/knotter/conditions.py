"""The conditions of a knot: the jaw's point S10 clears the disc, and a rope enters a triangle through a given edge.

For each item of a mechanism a condition determines whether it *holds*, the driver angle of the deciding event, and a
*margin*, which is positive if the condition holds and continuous across the limit.
An item that fails is a result, not an exception; quantities that are undefined for it are NaN.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, ClassVar, NamedTuple

import numpy as np

from synthesis.errors import FieldError
from synthesis.one_variable import EPSILON, Flags, Floats
from synthesis.scenes.knotter import events
from synthesis.scenes.knotter import mechanism as machine
from synthesis.scenes.knotter.mechanism import Integers, Mechanism, Vector, as_array
from synthesis.scenes.knotter.segment_triangle import (
    cross,
    crosses_inside,
    crossing_point,
    dot,
    norm,
    orientations,
    point_on_line,
    safe_divisor,
    segment_triangle_distance,
    subtract,
)
from synthesis.work import UNLIMITED, Work


@dataclass(frozen=True)
class EvaluationOptions:
    """Limits of the evaluation of a condition."""

    max_pieces: int = 500_000
    """Largest number of pieces (items x pieces of the driver's range) in a single evaluation."""
    chunk_pieces: int = 4096
    """Number of pieces evaluated at once, which bounds the memory and keeps the arrays in the cache."""


OPTIONS = EvaluationOptions()


class ClearanceResult(NamedTuple):
    """Depth of S10 beyond the disc's plane or inside the disc, shape (items,) each; positive is interference."""

    holds: Flags
    """True for items that satisfy the condition."""
    margin: Floats
    """Minus the largest depth."""
    value: Floats
    """Depth at the condition's own driver angle."""
    worst: Floats
    """Largest depth over the range."""
    worst_driver: Floats
    """Driver angle (rad) of the largest depth."""


@dataclass(frozen=True)
class Clearance:
    """Requirement that S10 stays on the free side of the disc's plane, or outside the disc and the space behind it.

    With a finite radius, the depth is minus the signed distance to the solid of all points on or behind the disc, a
    half-infinite cylinder. Eq 18 of the source checks this at a single angle.
    It never exceeds the depth beyond the plane, and approaches it as the radius grows.
    """

    at: float
    """Driver angle (rad) of ``ClearanceResult.value``."""
    over: tuple[float, float]
    """Range of the driver (rad) in which the largest depth is searched; its ends may be equal."""
    radius: float = np.inf
    """Radius of the disc; infinite for the whole plane."""
    jaw_locked: bool = True
    """True if the jaw keeps its angle at ``at`` over the whole range."""

    name: ClassVar[str] = "clearance"
    frames: ClassVar[set[str]] = {"u5", "seat"}

    def check(self, mechanism: Mechanism) -> None:
        """Raise a `FieldError` if a law is not defined at ``at`` or over the range."""
        first, last = (self.at, self.at) if self.jaw_locked else self.over
        mechanism.require_laws(self.frames, min(self.at, first), max(self.at, last))

    def evaluate(self, mechanism: Mechanism, items: int, work: Work = UNLIMITED) -> ClearanceResult:
        """Return the verdict for each item; ``work`` may end the evaluation early."""
        if self.jaw_locked:
            mechanism = mechanism.with_locked_jaw(self.at)
        return _in_chunks(self._evaluate, mechanism, items, self, self.over, work)

    def depth(self, mechanism: Mechanism, driver: Floats | float) -> Any:
        """Return the depth of the point beyond the plane or inside the solid, negative outside."""
        x, depth, z = mechanism.position("S10", "seat", driver)
        if np.isinf(self.radius):
            return depth
        beyond_rim = np.hypot(x, z) - self.radius
        outside = np.hypot(np.maximum(beyond_rim, 0), np.maximum(-depth, 0))
        return np.where((beyond_rim < 0) & (depth > 0), np.minimum(depth, -beyond_rim), -outside)

    def _evaluate(self, mechanism: Mechanism, items: Integers, driver: Floats) -> ClearanceResult:
        def height(driver: Floats, item: Integers) -> Floats:
            shape = np.broadcast_shapes(driver.shape, item.shape)
            return np.broadcast_to(-self.depth(mechanism.select(item), driver), shape)

        margin, worst_driver = events.smallest_values(height, driver, height(driver[None], items[:, None]))
        value = np.broadcast_to(self.depth(mechanism.select(items), self.at), items.shape)
        return ClearanceResult(margin > 0, margin, value, -margin, worst_driver)


class EntryStatus(IntEnum):
    """Outcome of the search for a segment's entry into a triangle; see `STATUS_SENTENCES`."""

    ENTERS = 0
    ENTERS_ELSEWHERE = 1
    INSIDE_AT_START = 2
    NEVER = 3
    ALWAYS_IN_PLANE = 4


STATUS_SENTENCES = {
    EntryStatus.ENTERS: "the segment first enters through the wanted edge",
    EntryStatus.ENTERS_ELSEWHERE: "the segment first enters through another edge, or with one end through the plane",
    EntryStatus.INSIDE_AT_START: "the segment is inside already where the range starts",
    EntryStatus.NEVER: "the segment never crosses the triangle in the range",
    EntryStatus.ALWAYS_IN_PLANE: "an end of the segment lies in the triangle's plane throughout: it never crosses",
}
"""Each outcome as a sentence to the user."""


class EntryResult(NamedTuple):
    """First entry of a segment into a triangle; quantities that do not exist for ``status`` are NaN."""

    holds: Flags
    """True for items that satisfy the condition, shape (items,)."""
    margin: Floats
    """Distance from the limit, positive if the condition holds, shape (items,)."""
    status: Integers
    """Values of `EntryStatus`, shape (items,)."""
    enter: Floats
    """Driver angle (rad) at which the first window opens, shape (items,)."""
    leave: Floats
    """Driver angle (rad) at which the first window closes, or the end of the range, shape (items,)."""
    entered_by: Integers
    """Entry into the first window, shape (items,).
    0 or 1: that end of the segment passes through the plane.
    2, 3 or 4: the segment passes the edge from the first, second or third vertex.
    -1: the segment is inside at the start, or never."""
    point: Floats
    """Crossing point at ``enter``, shape (items, 3)."""
    fraction: Floats
    """Position of ``point`` along the edge of entry, 0 at its first vertex and 1 at the next, shape (items,)."""
    windows: Integers
    """Number of separate windows in the range, shape (items,)."""
    nearest: Floats
    """Driver angle (rad) of the closest approach, if the segment never enters, shape (items,)."""


@dataclass(frozen=True)
class SegmentEntersTriangle:
    """Requirement that a segment first enters a triangle through a given edge, within a range of the driver.

    The margin is a length.
    If the condition holds, it is the distance from the entry point to the nearer end of the required edge.
    If the segment enters elsewhere, it is minus the distance from the entry point to the required edge.
    If the segment never enters, it is minus the smallest distance between segment and triangle in the range.
    All three are zero at the limit of the condition.
    """

    name: str
    """Name of the condition."""
    segment: tuple[str, str]
    """Names of the two ends of the segment."""
    triangle: tuple[str, str, str]
    """Names of the three vertices of the triangle."""
    frames: set[str]
    """Frames of these points."""
    frame: str
    """Frame in which the crossing is reported."""
    window: tuple[float, float]
    """Range of the driver, rad."""
    required_edge: int
    """Edge of entry: 0, 1 or 2 for the edge that begins at the first, second or third vertex."""

    @property
    def edge_names(self) -> tuple[str, str, str]:
        """Names of the edges, each from one vertex to the next."""
        a, b, c = self.triangle
        return a + b, b + c, c + a

    def check(self, mechanism: Mechanism) -> None:
        """Raise a `FieldError` if two points of the same frame coincide, or a law is not defined over the range."""
        mechanism.require_laws(self.frames, *self.window)
        points = {name: mechanism.points[name] for name in (*self.segment, *self.triangle)}
        for first, second in itertools.combinations(points, 2):
            (first_frame, first_xyz), (second_frame, second_xyz) = points[first], points[second]
            reach = np.linalg.norm(first_xyz) + np.linalg.norm(second_xyz)
            distance = np.linalg.norm(np.subtract(first_xyz, second_xyz))
            if first_frame == second_frame and distance <= 2 * EPSILON * reach:
                lost = "triangle" if {first, second} <= set(self.triangle) else "segment that could cross"
                raise FieldError(
                    "/points",
                    f"{first} and {second} coincide, so {self.name} has no {lost}; move one of them",
                    constraint="coincident_points",
                    points=[first, second],
                )

    def positions(self, mechanism: Mechanism, driver: Floats) -> tuple[Vector, ...]:
        """Return the ends of the segment and the vertices of the triangle in the condition's frame."""
        return tuple(mechanism.position(name, self.frame, driver) for name in (*self.segment, *self.triangle))

    def evaluate(self, mechanism: Mechanism, items: int, work: Work = UNLIMITED) -> EntryResult:
        """Return the verdict for each item; ``work`` may end the evaluation early.

        Raises
        ------
        FieldError
            The triangle of some item has no area, or the evaluation takes too many pieces.
        """
        return _in_chunks(self._evaluate, mechanism, items, self, self.window, work)

    def _evaluate(self, mechanism: Mechanism, items: Integers, driver: Floats) -> EntryResult:
        def functions(driver: Floats, item: Integers) -> Floats:
            signs = orientations(*self.positions(mechanism.select(item), driver))
            return as_array(signs, np.broadcast_shapes(driver.shape, item.shape))

        noise = self._noise(mechanism, items, driver)
        values = functions(driver[None], items[:, None])
        in_plane = np.any(np.abs(values[:2]).max(axis=-1) <= noise[:2], axis=0)
        roots = events.find_roots(functions, driver, values, noise)
        item, start, end, opened_by = find_windows(functions, roots, (driver[0], driver[-1]), ~in_plane)
        count = np.bincount(item, minlength=items.size)
        entered, missing = np.flatnonzero(count), np.flatnonzero(count == 0)
        first = np.searchsorted(item, entered)

        enter, leave, fraction, margin, nearest = np.full((5, items.size), np.nan)
        point, entered_by = np.full((items.size, 3), np.nan), np.full(items.size, -1)
        enter[entered], leave[entered], entered_by[entered] = start[first], end[first], opened_by[first]
        point[entered], fraction[entered], margin[entered] = self._crossing(mechanism, entered, enter, entered_by)
        if len(missing):
            distance, nearest[missing] = self._closest_approach(mechanism.select(missing), driver, len(missing))
            margin[missing] = -distance
        status = np.select(
            [in_plane, count == 0, entered_by < 0, entered_by == 2 + self.required_edge],
            [EntryStatus.ALWAYS_IN_PLANE, EntryStatus.NEVER, EntryStatus.INSIDE_AT_START, EntryStatus.ENTERS],
            EntryStatus.ENTERS_ELSEWHERE,
        )
        holds = status == EntryStatus.ENTERS
        return EntryResult(holds, margin, status, enter, leave, entered_by, point, fraction, count, nearest)

    def _crossing(
        self, mechanism: Mechanism, rows: Integers, enter: Floats, entered_by: Integers
    ) -> tuple[Floats, ...]:
        """Return the point, the fraction and the margin at the entry of some items."""
        positions = self.positions(mechanism.select(rows), enter[rows])
        p, q, *corners = (as_array(position, rows.shape) for position in positions)
        point = crossing_point(p, q, *corners)
        fraction, margin = np.full((2, len(rows)), np.nan)
        for edge in range(3):
            a, b = corners[edge], corners[(edge + 1) % 3]
            ab = subtract(b, a)
            length = norm(ab)
            edge_fraction = dot(subtract(point, a), ab) / safe_divisor(dot(ab, ab))
            through = entered_by[rows] == 2 + edge
            fraction[through] = edge_fraction[through]
            if edge == self.required_edge:
                to_nearer_end = np.minimum(edge_fraction, 1 - edge_fraction) * length
                to_edge = norm(subtract(point, point_on_line(a, ab, np.clip(edge_fraction, 0, 1))))
                margin = np.where(through, np.maximum(to_nearer_end, 0.0), -to_edge)
        return np.transpose(point) + 0.0, fraction, margin  # adding 0.0 removes negative zeros

    def _noise(self, mechanism: Mechanism, items: Integers, driver: Floats) -> Floats:
        """Return the rounding error of the five orientations, shape (5, items); refuse a triangle without area."""
        driver = driver[:: machine.OPTIONS.steps_per_piece]
        p, q, a, b, c = self.positions(mechanism.select(items[:, None]), driver)
        ab, ac = subtract(b, a), subtract(c, a)
        sizes = (norm(subtract(p, a)) + norm(subtract(q, a)), norm(cross(ab, ac)), norm(ab) + norm(ac))
        rope, area, sides = as_array(sizes, (items.size, driver.size)).max(axis=-1)
        rounding = np.broadcast_to(mechanism.rounding_bound(self.frames, *self.window), items.shape)
        if np.any(area <= rounding * sides):
            first, second, third = self.triangle
            raise FieldError(
                "/points",
                f"{first}, {second} and {third} lie on one line, so {self.name} has no triangle; move one of them",
                constraint="degenerate_triangle",
                points=list(self.triangle),
                amount=float(area.min()) / 2,
            )
        side, edge = rounding * area, rounding * area**2 * sides * rope
        return np.stack([side, side, edge, edge, edge])

    def _closest_approach(self, mechanism: Mechanism, driver: Floats, items: int) -> tuple[Floats, Floats]:
        """Return the smallest distance between segment and triangle, and the driver angle at which it occurs."""

        def distance(driver: Floats, item: Integers) -> Floats:
            found = segment_triangle_distance(*self.positions(mechanism.select(item), driver))
            return np.broadcast_to(found, np.broadcast_shapes(driver.shape, item.shape))

        return events.smallest_values(distance, driver, distance(driver[None], np.arange(items)[:, None]))


Condition = Clearance | SegmentEntersTriangle
ConditionResult = ClearanceResult | EntryResult


def _in_chunks(
    evaluate: Callable[[Mechanism, Integers, Floats], Any],
    mechanism: Mechanism,
    items: int,
    condition: Condition,
    over: tuple[float, float],
    work: Work,
) -> Any:
    """Evaluate a condition for a few items at a time and join the results.

    ``evaluate(mechanism, items, driver)`` has the samples of the range as its last argument.
    """
    driver = mechanism.samples(condition.frames, *over)
    pieces_per_item = driver.size // machine.OPTIONS.steps_per_piece
    if items * pieces_per_item > OPTIONS.max_pieces:
        raise FieldError(
            "",
            f"{condition.name} would take {items * pieces_per_item} pieces, but at most {OPTIONS.max_pieces} are "
            "allowed: give a coarser grid, a shorter range of the driver, slower laws or shorter tables",
            constraint="work",
            amount=items * pieces_per_item,
        )
    step, results = max(1, OPTIONS.chunk_pieces // pieces_per_item), []
    for start in range(0, items, step):
        work.go_on()
        chunk = np.arange(start, min(start + step, items))
        results.append(evaluate(mechanism.select(chunk), np.arange(chunk.size), driver))
    return type(results[0])(*map(np.concatenate, zip(*results)))


def find_windows(
    orientation_functions: events.Functions, roots: events.Events, ends: tuple[float, float], may_enter: Flags
) -> tuple[Any, ...]:
    """Find the ranges of the driver in which the segment crosses the inside of the triangle.

    The five orientations change sign only at their roots, so that an evaluation between each two neighbouring roots decides.

    Parameters
    ----------
    orientation_functions : callable
        The five `orientations` as functions of driver and item, see `events.Functions`.
    roots : events.Events
        All roots of these functions.
    ends : tuple of float
        Ends of the driver's range, rad.
    may_enter : ndarray of bool, shape (items,)
        False for items that have no window in any case.

    Returns
    -------
    item : ndarray of int, shape (windows,)
        Item of each window; windows are sorted by item and driver angle.
    start, end : ndarray, shape (windows,)
        Driver angles of the ends of each window, rad.
    opened_by : ndarray of int, shape (windows,)
        Index of the orientation whose root is ``start``; -1 for the start of the range.
    """
    items = may_enter.size
    item = np.concatenate([roots.item, np.arange(items), np.arange(items)])
    driver = np.concatenate([roots.driver, np.repeat(ends, items)])
    function = np.concatenate([roots.function, np.repeat([-1, 9], items)])
    order = np.lexsort((function, driver, item))
    item, driver, function = item[order], driver[order], function[order]
    span = np.flatnonzero((item[1:] == item[:-1]) & (driver[1:] > driver[:-1]))
    middle = driver[span] + 0.5 * (driver[span + 1] - driver[span])
    span = span[crosses_inside(orientation_functions(middle, item[span])) & may_enter[item[span]]]
    # Two neighbouring spans that are both inside form a single window, because only rounding separates them.
    continued = np.zeros(len(span), bool)
    continued[1:] = (driver[span[1:]] <= driver[span[:-1] + 1]) & (item[span[1:]] == item[span[:-1]])
    starts = np.flatnonzero(~continued)
    stops = np.append(starts[1:], len(span)) - 1 if len(span) else starts
    return item[span[starts]], driver[span[starts]], driver[span[stops] + 1], function[span[starts]]


class CrossingCurve(NamedTuple):
    """Crossing of the rope's line with the plane of a triangle (E1 or E2), one row per driver angle."""

    point: Floats
    """Crossing point in the condition's frame, shape (n, 3); NaN if the line is parallel to the plane."""
    on_rope: Flags
    """True if the crossing point lies between the ends of the rope, shape (n,)."""
    inside: Flags
    """True if the rope crosses the inside of the triangle, shape (n,)."""
    triangle: Floats
    """Vertices of the triangle in the condition's frame, shape (3, n, 3); vertices fixed in another body move."""


def crossing_curve(mechanism: Mechanism, condition: SegmentEntersTriangle, driver: Floats) -> CrossingCurve:
    """Compute the crossing of the rope's line with the plane of a triangle over the driver angle (eqs 11 and 26).

    Parameters
    ----------
    mechanism : Mechanism
        A single mechanism.
    condition : SegmentEntersTriangle
        The condition that names the rope's ends and the triangle.
    driver : ndarray, shape (n,)
        Driver angles, rad.
    """
    positions = condition.positions(mechanism, driver)
    signs = as_array(orientations(*positions), driver.shape)
    point = as_array(crossing_point(*positions), driver.shape).T
    point = np.where((signs[0] != signs[1])[:, None], point, np.nan)
    triangle = np.stack([as_array(corner, driver.shape).T for corner in positions[2:]])
    return CrossingCurve(point, signs[0] * signs[1] < 0, crosses_inside(signs), triangle)


class StudyResult(NamedTuple):
    """Verdicts of several conditions over a grid."""

    grid: Mapping[str, Floats]
    """Value of each grid parameter for each item, shape (items,); the last parameter varies fastest."""
    conditions: Mapping[str, ConditionResult]
    """Result of each condition, by name."""
    feasible: Flags
    """True for items that satisfy all conditions, shape (items,)."""
    margin: Floats
    """Smallest margin of all conditions, shape (items,)."""


def study(
    mechanism: Mechanism, grid: Mapping[str, Sequence[float]], conditions: Sequence[Condition], work: Work = UNLIMITED
) -> StudyResult:
    """Evaluate conditions for every combination of some parameters.

    Parameters
    ----------
    mechanism : Mechanism
        A single mechanism.
    grid : mapping
        Values of each parameter that varies, at least one each.
    conditions : sequence of Condition
        The conditions.
    work : Work, optional
        Time budget and cancellation, checked before each few items of each condition.

    Returns
    -------
    StudyResult
        Verdicts; the result of an item does not depend on the other items of the grid.

    Raises
    ------
    FieldError
        Points coincide or are collinear, a law is not defined over the range of a condition, or the evaluation would
        take too many pieces.
    """
    axes = np.meshgrid(*(np.asarray(values, float) for values in grid.values()), indexing="ij")
    item_values = {name: axis.ravel() for name, axis in zip(grid, axes)}
    items = len(next(iter(item_values.values()))) if item_values else 1
    mechanism = mechanism.with_parameters(**item_values)
    for condition in conditions:
        condition.check(mechanism)
    results = {condition.name: condition.evaluate(mechanism, items, work) for condition in conditions}
    holds, margins = zip(*((result.holds, result.margin) for result in results.values()))
    return StudyResult(item_values, results, np.all(holds, axis=0), np.min(margins, axis=0))
