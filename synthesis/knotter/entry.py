"""A segment enters a triangle: through which edge, at which driver angle, and how far from failing."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import partial

import numpy as np

from synthesis.errors import FieldError
from synthesis.knotter import events, segment_triangle
from synthesis.knotter.conditions import Result, in_chunks
from synthesis.knotter.mechanism import Mechanism, Vector

NARROW = 1e-5
"""Windows narrower than this (rad) are confirmed in extended precision."""
SPEED_STEP = 1e-6
"""Half step (rad) of the central difference that gives the speed of a crossing."""
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
    sensitivity : ndarray
        By how much ``enter`` moves when the edge of entry (or the segment's end) is moved by one unit of length, rad
        per length: the condition number of the event. It grows without bound as the entry becomes tangential.
    nearest : ndarray
        Where the segment never enters: the driver angle (rad) at which it comes nearest to the triangle.
    nearest_case : ndarray of int
        How it lies to the triangle there, values of `segment_triangle.Crossing`; -1 where it enters.
    """

    found: np.ndarray
    enter: np.ndarray
    leave: np.ndarray
    opened_by: np.ndarray
    point: np.ndarray
    fraction: np.ndarray
    windows: np.ndarray
    sensitivity: np.ndarray
    nearest: np.ndarray
    nearest_case: np.ndarray


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
        ends = events.piece_ends(first, last, mechanism.breakpoints(frames), partial(mechanism.turning_rate, frames))
        return in_chunks(lambda part, count: self._evaluate(part, count, ends), mechanism, items, ends, self.name)

    def _evaluate(self, mechanism: Mechanism, items: int, ends: np.ndarray) -> Entry:
        def function(driver: np.ndarray, item: np.ndarray) -> np.ndarray:
            signs = segment_triangle.orientations(*self.positions(mechanism.item(item), driver))
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
        enter, leave, fraction, margin, sensitivity, nearest = (np.full(items, np.nan) for _ in range(6))
        case = np.full(items, -1)
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
            crossing = segment_triangle.crossing_point(p, q, *corners)
            point[rows] = np.stack([np.broadcast_to(x, rows.shape) for x in crossing], axis=-1) + 0.0  # no minus zero
            for edge in range(3):
                a, b = corners[edge], corners[(edge + 1) % 3]
                ab = segment_triangle.subtract(b, a)
                length2 = segment_triangle.dot(ab, ab)
                f = segment_triangle.dot(segment_triangle.subtract(crossing, a), ab) / np.where(
                    length2 > 0, length2, 1.0
                )
                through = opened[rows] == 2 + edge
                fraction[rows[through]] = np.broadcast_to(f, rows.shape)[through]
                if edge == self.enter:
                    inner = np.minimum(f, 1 - f) * np.sqrt(length2)
                    outer = segment_triangle.norm(
                        segment_triangle.subtract(crossing, segment_triangle.along(a, ab, np.clip(f, 0, 1)))
                    )
                    margin[rows] = np.where(through, np.maximum(inner, 0.0), -outer)
        entering = np.flatnonzero(opened >= 0)
        if len(entering):
            sensitivity[entering] = self._sensitivity(mechanism.item(entering), enter[entering], opened[entering])
        missing = np.flatnonzero(~has)
        if len(missing):
            distance, nearest[missing] = self._closest_approach(mechanism.item(missing[:, None]), ends)
            margin[missing] = -distance
            corners = self.positions(mechanism.item(missing), nearest[missing])
            rows = [np.stack([np.broadcast_to(x, missing.shape) for x in corner], axis=-1) for corner in corners]
            case[missing] = segment_triangle.classify(*rows)
        holds = kind == Found.ENTERS
        return Entry(holds, margin, kind, enter, leave, opened, point, fraction, windows, sensitivity, nearest, case)

    def _sensitivity(self, mechanism: Mechanism, enter: np.ndarray, opened_by: np.ndarray) -> np.ndarray:
        """``|d driver / d length|``: one over the speed at which the crossing passes the edge it enters by."""

        def distance(driver: np.ndarray) -> np.ndarray:
            corners = self.positions(mechanism, driver)
            s_p, s_q, *u = segment_triangle.orientations(*corners)
            _, _, a, b, c = corners
            area = segment_triangle.norm(
                segment_triangle.cross(segment_triangle.subtract(b, a), segment_triangle.subtract(c, a))
            )
            area = np.where(area > 0, area, 1.0)
            sides = [
                segment_triangle.norm(segment_triangle.subtract(end, start))
                for start, end in ((a, b), (b, c), (c, a))
            ]
            w = s_p - s_q
            w = np.where(np.abs(w) > 0, w, 1.0)
            rows = [
                s_p / area,
                s_q / area,
                *(edge / (w * area * np.where(side > 0, side, 1.0)) for edge, side in zip(u, sides)),
            ]
            return np.choose(opened_by, [np.broadcast_to(row, enter.shape) for row in rows])

        speed = np.abs(distance(enter + SPEED_STEP) - distance(enter - SPEED_STEP)) / (2 * SPEED_STEP)
        return np.where(speed > 0, 1.0 / np.where(speed > 0, speed, 1.0), np.inf)

    def _floor(self, mechanism: Mechanism, items: int, ends: np.ndarray) -> np.ndarray:
        """Rounding error of the five orientations, shape (5, items); refuses a triangle without area."""
        driver = ends[None]
        p, q, a, b, c = self.positions(mechanism.item(np.arange(items)[:, None]), driver)
        far = segment_triangle.norm(segment_triangle.subtract(p, a)) + segment_triangle.norm(
            segment_triangle.subtract(q, a)
        )
        far = np.broadcast_to(far, (items, len(ends))).max(axis=1)
        ab, ac = segment_triangle.subtract(b, a), segment_triangle.subtract(c, a)
        area = np.broadcast_to(segment_triangle.norm(segment_triangle.cross(ab, ac)), (items, len(ends))).max(axis=1)
        sides = np.broadcast_to(segment_triangle.norm(ab) + segment_triangle.norm(ac), (items, len(ends))).max(axis=1)
        rounding = np.broadcast_to(mechanism.rounding(self.frames(mechanism), *self.window), (items,))
        if np.any(area <= rounding * sides):
            raise FieldError(
                "/points",
                "{}, {} and {} lie on one line, so {} has no triangle".format(*self.triangle, self.name),
                constraint="degenerate_triangle",
                points=list(self.triangle),
                amount=float(area.min()) / 2,
            )
        side = rounding * area
        edge = rounding * area**2 * sides * far
        return np.stack([side, side, edge, edge, edge])

    def _closest_approach(self, mechanism: Mechanism, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The smallest distance of segment and triangle and its driver angle, for parameters of shape (items, 1)."""
        grid = np.linspace(ends[:-1], ends[1:], 7)[:-1].T.ravel()
        grid = np.append(grid, ends[-1])
        near = segment_triangle.segment_triangle_distance(*self.positions(mechanism, grid[None]))
        near = np.atleast_2d(near)
        best = np.argmin(near, axis=1)[:, None]
        left, right = grid[np.maximum(best - 1, 0)], grid[np.minimum(best + 1, len(grid) - 1)]
        golden = (np.sqrt(5) - 1) / 2

        def distance(driver: np.ndarray) -> np.ndarray:
            return segment_triangle.segment_triangle_distance(*self.positions(mechanism, driver))

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
        # The range's ends and the grid stay candidates: the bracket may have been one-sided.
        candidates = np.concatenate([np.take_along_axis(near, best, 1), at_low, at_high], axis=1)
        drivers = np.concatenate([grid[best], low, high], axis=1)
        pick = np.argmin(candidates, axis=1)[:, None]
        return np.take_along_axis(candidates, pick, 1)[:, 0], np.take_along_axis(drivers, pick, 1)[:, 0]


def _coincide(first: tuple[float, float, float], second: tuple[float, float, float]) -> bool:
    distance = np.linalg.norm(np.subtract(first, second))
    return bool(distance <= 4 * segment_triangle.UNIT_ROUNDOFF * (np.linalg.norm(first) + np.linalg.norm(second)))


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
    hit = segment_triangle.inside(tuple(function(middle, item[span])))
    narrow = np.flatnonzero(width < NARROW)
    if len(narrow):
        extended = driver[span[narrow]] + 0.5 * width[narrow].astype(np.longdouble)
        hit[narrow] = segment_triangle.inside(tuple(function(extended, item[span[narrow]])))
    span = span[hit & allowed[item[span]]]
    # Two neighbouring spans that are both inside are one window: nothing but rounding parts them.
    continued = np.zeros(len(span), bool)
    continued[1:] = (driver[span[1:]] <= driver[span[:-1] + 1]) & (item[span[1:]] == item[span[:-1]])
    starts = np.flatnonzero(~continued)
    stops = np.append(starts[1:], len(span)) - 1 if len(span) else starts
    return item[span[starts]], driver[span[starts]], driver[span[stops] + 1], kind[span[starts]]
