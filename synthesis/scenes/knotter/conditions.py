"""Conditions on a mechanism, each with a verdict and a margin: a point clears a disc, a segment enters a triangle.

For each item of a mechanism a condition determines whether it *holds*, the driver angle of the deciding event, and a
*margin*, which is positive if the condition holds and continuous across the limit.
An item that fails is a result, not an exception; quantities that are undefined for it are NaN.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, fields
from enum import IntEnum
from functools import partial
from typing import Any, Protocol, TypeVar

import numpy as np

from synthesis.errors import FieldError
from synthesis.one_variable import Flags, Floats, golden_section
from synthesis.scenes.knotter import events
from synthesis.scenes.knotter.mechanism import Integers, Mechanism, Vector, as_array
from synthesis.scenes.knotter.segment_triangle import (
    UNIT_ROUNDOFF,
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
from synthesis.work import Work


@dataclass(frozen=True)
class EvaluationOptions:
    """Numerical options and limits of the evaluation of a condition."""

    max_pieces: int = 500_000
    """Largest number of pieces (items x pieces of the driver's range) in a single evaluation."""
    chunk_pieces: int = 4096
    """Number of pieces evaluated at once, which bounds the memory and keeps the arrays in the cache."""
    narrow_window: float = 1e-5
    """Width (rad) below which a window is confirmed in extended precision."""
    approach_nodes: int = 7
    """Number of nodes in each piece of the range from which the closest approach is searched."""
    approach_steps: int = 60
    """Number of golden-section steps of the closest approach: the interval shrinks to below 1e-12 of its width."""


DEFAULT_OPTIONS = EvaluationOptions()


class Condition(Protocol):
    """A requirement on a mechanism."""

    @property
    def name(self) -> str:
        """Name of the condition, the key of its results."""

    def check(self, mechanism: Mechanism) -> None:
        """Raise `FieldError` if the condition cannot be evaluated for any parameters."""

    def evaluate(self, mechanism: Mechanism, items: int, work: Work | None = None) -> ConditionResult:
        """Return the verdict for each of ``items`` items; ``work`` may end the evaluation early."""


@dataclass(frozen=True)
class ConditionResult:
    """Verdict of a condition for each item."""

    holds: Flags
    """True for items that satisfy the condition, shape (items,)."""
    margin: Floats
    """Distance from the limit, positive if the condition holds, shape (items,)."""


@dataclass(frozen=True)
class ClearanceResult(ConditionResult):
    """Depth of a point beyond a plane or inside a disc; positive is interference."""

    value: Floats
    """Depth at the condition's own driver angle, shape (items,)."""
    worst: Floats
    """Largest depth over the range, shape (items,)."""
    worst_driver: Floats
    """Driver angle (rad) of the largest depth, shape (items,)."""


@dataclass(frozen=True)
class Clearance:
    """Requirement that a point stays on one side of a disc's plane, or outside the disc and the space behind it.

    With a finite radius, the depth is minus the signed distance to the solid of all points on or behind the disc, a
    half-infinite cylinder.
    It never exceeds the depth beyond the plane, and approaches it as the radius grows.
    """

    name: str
    """Name of the condition."""
    point: str
    """Name of the point."""
    frame: str
    """Frame of the disc, which lies in the plane through the origin perpendicular to ``axis``."""
    axis: int
    """Axis of the disc: 0, 1 or 2 for i, j or k."""
    side: int
    """Free side of the disc: 1 for positive coordinates, -1 for negative coordinates."""
    at: float
    """Driver angle (rad) of ``ClearanceResult.value``."""
    over: tuple[float, float]
    """Range of the driver (rad) in which the largest depth is searched; its ends may be equal."""
    radius: float = np.inf
    """Radius of the disc; infinite for the whole plane."""
    locked: str | None = None
    """Name of a law that is held at its value at ``at``, for a body that is locked while it passes the disc."""
    options: EvaluationOptions = DEFAULT_OPTIONS
    """Numerical options."""

    def frames(self, mechanism: Mechanism) -> set[str]:
        """Return the frames between which the condition transforms the point."""
        return {mechanism.points[self.point][0], self.frame}

    def check(self, mechanism: Mechanism) -> None:
        """Check that the laws are defined over the range.

        Raises
        ------
        FieldError
            A law is not defined at ``at`` or over the range.
        """
        if self.locked is not None:
            mechanism.require_laws(self.frames(mechanism), self.at, self.at, only=self.locked)
            mechanism = mechanism.with_locked_law(self.locked, self.at)
        mechanism.require_laws(self.frames(mechanism), min(self.at, self.over[0]), max(self.at, self.over[1]))

    def evaluate(self, mechanism: Mechanism, items: int, work: Work | None = None) -> ClearanceResult:
        """Return the verdict for each item.

        Parameters
        ----------
        mechanism : Mechanism
            The mechanism, whose parameters are numbers or arrays of shape (items,).
        items : int
            Number of items.
        work : Work, optional
            Time budget and cancellation.

        Returns
        -------
        ClearanceResult
            Depths and margins; a margin is minus the largest depth.
        """
        if self.locked is not None:
            mechanism = mechanism.with_locked_law(self.locked, self.at)
        frames = self.frames(mechanism)
        return evaluate_in_chunks(self._evaluate, mechanism, items, frames, self.over, self.name, work, self.options)

    def depth(self, mechanism: Mechanism, driver: Floats | float) -> Any:
        """Return the depth of the point beyond the plane or inside the solid, negative outside."""
        depth, axis_distance = self._coordinates(mechanism, driver)
        if np.isinf(self.radius):
            return depth
        beyond_rim = axis_distance - self.radius
        outside = np.hypot(np.maximum(beyond_rim, 0), np.maximum(-depth, 0))
        return np.where((beyond_rim < 0) & (depth > 0), np.minimum(depth, -beyond_rim), -outside)

    def _coordinates(self, mechanism: Mechanism, driver: Floats | float) -> tuple[Any, Any]:
        """Return the depth of the point beyond the plane and its distance from the axis of the disc."""
        position = mechanism.position(self.point, self.frame, driver)
        axis_distance = np.hypot(position[(self.axis + 1) % 3], position[(self.axis + 2) % 3])
        return -self.side * position[self.axis], axis_distance

    def _evaluate(self, mechanism: Mechanism, items: int, ends: Floats) -> ClearanceResult:
        def functions(driver: Floats, item: Integers) -> Floats:
            depth, axis_distance = self._coordinates(mechanism.select(item), driver)
            beyond_rim = axis_distance - self.radius
            # The clearance has kinks at roots of the first three; between kinks, its extrema are extrema of the four.
            rows = (depth, beyond_rim, depth + beyond_rim, beyond_rim**2 + depth**2)
            shape = np.broadcast_shapes(driver.shape, item.shape)
            return as_array(rows[:1] if np.isinf(self.radius) else rows, shape)

        all_items = np.arange(items)
        value = np.broadcast_to(self.depth(mechanism.select(all_items), self.at), (items,))
        rounding = np.broadcast_to(mechanism.rounding_bound(self.frames(mechanism), *self.over), (items,))
        noise = rounding[None]
        if np.isfinite(self.radius):
            noise = np.stack([rounding, rounding, rounding, rounding * (np.abs(value) + self.radius)])
        samples = events.sample(functions, ends, items)
        found_events = [events.find_extrema(samples)]
        if np.isfinite(self.radius):
            found_events.append(events.find_roots(samples, noise))
        item = np.concatenate([np.repeat(all_items, len(ends)), *(found.item for found in found_events)])
        driver = np.concatenate([np.tile(ends, items), *(found.driver for found in found_events)])
        depth = np.broadcast_to(self.depth(mechanism.select(item), driver), item.shape)
        order = np.lexsort((driver, -depth, item))
        deepest = order[np.searchsorted(item[order], all_items)]
        worst = depth[deepest]
        return ClearanceResult(worst < 0, -worst, value, worst, driver[deepest])


ResultT = TypeVar("ResultT", bound=ConditionResult)


def evaluate_in_chunks(
    evaluate: Callable[[Mechanism, int, Floats], ResultT],
    mechanism: Mechanism,
    items: int,
    frames: set[str],
    over: tuple[float, float],
    name: str,
    work: Work | None = None,
    options: EvaluationOptions = DEFAULT_OPTIONS,
) -> ResultT:
    """Evaluate a condition for a few items at a time and join the results.

    Parameters
    ----------
    evaluate : callable
        ``evaluate(mechanism, items, ends)``, given the ends of the pieces of the range.
    mechanism : Mechanism
        The mechanism, whose parameters are numbers or arrays of shape (items,).
    items : int
        Number of items.
    frames : set of str
        Frames whose relative rotation within a piece is limited.
    over : tuple of float
        Range of the driver, rad.
    name : str
        Name of the condition, for the error message.
    work : Work, optional
        Time budget and cancellation, checked before each chunk.
    options : EvaluationOptions, optional
        Limits of the evaluation.

    Returns
    -------
    ConditionResult
        The result for all items, of the type that ``evaluate`` returns.

    Raises
    ------
    FieldError
        The evaluation would take more than ``options.max_pieces`` pieces.
    """
    ends = events.piece_ends(*over, mechanism.breakpoints(frames), partial(mechanism.turning_rate, frames))
    pieces_per_item = len(ends) - 1
    if items * pieces_per_item > options.max_pieces:
        raise FieldError(
            "",
            f"{name} would take {items * pieces_per_item} pieces, but at most {options.max_pieces} are allowed: give "
            "a coarser grid, a shorter range of the driver, slower laws or shorter tables",
            constraint="work",
            amount=items * pieces_per_item,
        )
    step = max(1, options.chunk_pieces // pieces_per_item)
    chunks = (np.arange(start, min(start + step, items)) for start in range(0, items, step))
    results, work = [], work or Work()
    for chunk in chunks:
        work.go_on()
        results.append(evaluate(mechanism.select(chunk), len(chunk), ends))
    columns = (np.concatenate([getattr(result, field.name) for result in results]) for field in fields(results[0]))
    return type(results[0])(*columns)


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


@dataclass(frozen=True)
class EntryResult(ConditionResult):
    """First entry of a segment into a triangle; quantities that do not exist for ``status`` are NaN."""

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
    frame: str
    """Frame in which the crossing is reported."""
    window: tuple[float, float]
    """Range of the driver, rad."""
    required_edge: int
    """Edge of entry: 0, 1 or 2 for the edge that begins at the first, second or third vertex."""
    options: EvaluationOptions = DEFAULT_OPTIONS
    """Numerical options."""

    @property
    def edge_names(self) -> tuple[str, str, str]:
        """Names of the edges, each from one vertex to the next."""
        a, b, c = self.triangle
        return a + b, b + c, c + a

    def frames(self, mechanism: Mechanism) -> set[str]:
        """Return the frames between which the condition transforms points."""
        return {mechanism.points[point][0] for point in (*self.segment, *self.triangle)} | {self.frame}

    def check(self, mechanism: Mechanism) -> None:
        """Check that the points are distinct and that the laws are defined over the range.

        Raises
        ------
        FieldError
            Two points of the same frame coincide, or a law is not defined over the range.
        """
        mechanism.require_laws(self.frames(mechanism), *self.window)
        points = {name: mechanism.points[name] for name in (*self.segment, *self.triangle)}
        for first, second in itertools.combinations(points, 2):
            (first_frame, first_xyz), (second_frame, second_xyz) = points[first], points[second]
            reach = np.linalg.norm(first_xyz) + np.linalg.norm(second_xyz)
            distance = np.linalg.norm(np.subtract(first_xyz, second_xyz))
            if first_frame == second_frame and distance <= 4 * UNIT_ROUNDOFF * reach:
                lost = "triangle" if {first, second} <= set(self.triangle) else "segment that could cross"
                raise FieldError(
                    "/points",
                    f"{first} and {second} coincide, so {self.name} has no {lost}; move one of them",
                    constraint="coincident_points",
                    points=[first, second],
                )

    def positions(self, mechanism: Mechanism, driver: Floats) -> tuple[Vector, ...]:
        """Return the ends of the segment and the vertices of the triangle.

        Parameters
        ----------
        mechanism : Mechanism
            The mechanism.
        driver : ndarray
            Driver angles (rad) that broadcast against the parameters.

        Returns
        -------
        tuple of five vectors
            Coordinates in the condition's frame.
        """
        return tuple(mechanism.position(name, self.frame, driver) for name in (*self.segment, *self.triangle))

    def evaluate(self, mechanism: Mechanism, items: int, work: Work | None = None) -> EntryResult:
        """Return the verdict for each item.

        Parameters
        ----------
        mechanism : Mechanism
            The mechanism, whose parameters are numbers or arrays of shape (items,).
        items : int
            Number of items.
        work : Work, optional
            Time budget and cancellation.

        Returns
        -------
        EntryResult
            Entries and margins.

        Raises
        ------
        FieldError
            The triangle of some item has no area, or the evaluation takes too many pieces.
        """
        frames = self.frames(mechanism)
        return evaluate_in_chunks(
            self._evaluate, mechanism, items, frames, self.window, self.name, work, self.options
        )

    def _evaluate(self, mechanism: Mechanism, items: int, ends: Floats) -> EntryResult:
        def functions(driver: Floats, item: Integers) -> Floats:
            signs = orientations(*self.positions(mechanism.select(item), driver))
            return as_array(signs, np.broadcast_shapes(driver.shape, item.shape))

        noise = self._noise(mechanism, items, ends)
        samples = events.sample(functions, ends, items)
        in_plane = np.any(samples.size[:2] <= noise[:2], axis=0)
        roots = events.find_roots(samples, noise)
        windows = find_windows(functions, roots, ends, items, ~in_plane, self.options.narrow_window)
        item, start, end, opened_by = windows
        count = np.bincount(item, minlength=items)
        entered, missing = np.flatnonzero(count), np.flatnonzero(count == 0)
        first = np.searchsorted(item, entered)

        enter, leave, fraction, margin, nearest = np.full((5, items), np.nan)
        point = np.full((items, 3), np.nan)
        entered_by = np.full(items, -1)
        enter[entered], leave[entered], entered_by[entered] = start[first], end[first], opened_by[first]
        point[entered], fraction[entered], margin[entered] = self._crossing(mechanism, entered, enter, entered_by)
        if len(missing):
            distance, nearest[missing] = self._closest_approach(mechanism, missing, ends)
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

    def _noise(self, mechanism: Mechanism, items: int, ends: Floats) -> Floats:
        """Return the rounding error of the five orientations, shape (5, items); refuse a triangle without area."""
        p, q, a, b, c = self.positions(mechanism.select(np.arange(items)[:, None]), ends)
        ab, ac = subtract(b, a), subtract(c, a)
        sizes = (norm(subtract(p, a)) + norm(subtract(q, a)), norm(cross(ab, ac)), norm(ab) + norm(ac))
        rope, area, sides = as_array(sizes, (items, len(ends))).max(axis=-1)
        rounding = np.broadcast_to(mechanism.rounding_bound(self.frames(mechanism), *self.window), (items,))
        if np.any(area <= rounding * sides):
            raise FieldError(
                "/points",
                "{}, {} and {} lie on one line, so {} has no triangle; move one of them".format(
                    *self.triangle, self.name
                ),
                constraint="degenerate_triangle",
                points=list(self.triangle),
                amount=float(area.min()) / 2,
            )
        side = rounding * area
        edge = rounding * area**2 * sides * rope
        return np.stack([side, side, edge, edge, edge])

    def _closest_approach(self, mechanism: Mechanism, rows: Integers, ends: Floats) -> tuple[Floats, Floats]:
        """Return the smallest distance between segment and triangle, and the driver angle at which it occurs.

        ``rows`` are the indices of the evaluated items, and ``ends`` the ends of the pieces of the driver's range.
        """
        mechanism = mechanism.select(rows[:, None])

        def distance(driver: Floats) -> Any:
            return segment_triangle_distance(*self.positions(mechanism, driver))

        grid = np.append(np.linspace(ends[:-1], ends[1:], self.options.approach_nodes)[:-1].T.ravel(), ends[-1])
        at_grid = np.broadcast_to(distance(grid[None]), (len(rows), len(grid)))
        best = np.argmin(at_grid, axis=1)[:, None]
        left, right = grid[np.maximum(best - 1, 0)], grid[np.minimum(best + 1, len(grid) - 1)]
        minimum, driver = golden_section(distance, left, right, self.options.approach_steps)
        # The node remains a candidate, because at an end of the range the bracket has only its inner side.
        at_node = np.take_along_axis(at_grid, best, 1)
        driver = np.where(at_node <= minimum, grid[best], driver)
        return np.minimum(at_node, minimum)[:, 0], driver[:, 0]


def find_windows(
    orientation_functions: events.Functions,
    roots: events.Events,
    ends: Floats,
    items: int,
    may_enter: Flags,
    narrow: float = DEFAULT_OPTIONS.narrow_window,
) -> tuple[Any, ...]:
    """Find the ranges of the driver in which the segment crosses the inside of the triangle.

    The five orientations change sign only at their roots, so that an evaluation between each two neighbouring roots decides.

    Parameters
    ----------
    orientation_functions : callable
        The five `orientations` as functions of driver and item, see `events.Functions`.
    roots : events.Events
        All roots of these functions.
    ends : ndarray, shape (pieces + 1,)
        Ends of the pieces of the driver's range, rad.
    items : int
        Number of items.
    may_enter : ndarray of bool, shape (items,)
        False for items that have no window in any case.
    narrow : float, optional
        Width (rad) below which a window is confirmed in extended precision.

    Returns
    -------
    item : ndarray of int, shape (windows,)
        Item of each window; windows are sorted by item and driver angle.
    start, end : ndarray, shape (windows,)
        Driver angles of the ends of each window, rad.
    opened_by : ndarray of int, shape (windows,)
        Index of the orientation whose root is ``start``; -1 for the start of the range.
    """
    all_items = np.arange(items)
    item = np.concatenate([roots.item, all_items, all_items])
    driver = np.concatenate([roots.driver, np.full(items, ends[0]), np.full(items, ends[-1])])
    function = np.concatenate([roots.function, np.full(items, -1), np.full(items, 9)])
    order = np.lexsort((function, driver, item))
    item, driver, function = item[order], driver[order], function[order]
    span = np.flatnonzero((item[1:] == item[:-1]) & (driver[1:] > driver[:-1]))
    width = driver[span + 1] - driver[span]
    crosses = crosses_inside(orientation_functions(driver[span] + 0.5 * width, item[span]))
    narrow_spans = np.flatnonzero(width < narrow)
    if len(narrow_spans):
        extended = driver[span[narrow_spans]] + 0.5 * width[narrow_spans].astype(np.longdouble)
        crosses[narrow_spans] = crosses_inside(orientation_functions(extended, item[span[narrow_spans]]))
    span = span[crosses & may_enter[item[span]]]
    # Two neighbouring spans that are both inside form a single window, because only rounding separates them.
    continued = np.zeros(len(span), bool)
    continued[1:] = (driver[span[1:]] <= driver[span[:-1] + 1]) & (item[span[1:]] == item[span[:-1]])
    starts = np.flatnonzero(~continued)
    stops = np.append(starts[1:], len(span)) - 1 if len(span) else starts
    return item[span[starts]], driver[span[starts]], driver[span[stops] + 1], function[span[starts]]
