"""Conditions on a mechanism, each with a verdict and a margin: a point clears a disc, a segment enters a triangle.

A condition says whether it *holds* for each item of a mechanism, by how much (`margin`, positive where it holds,
continuous across the limit) and where. An item that fails is a result, not an exception; what is undefined for it is
NaN under a mask that says so.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from enum import IntEnum
from fractions import Fraction
from functools import partial
from typing import Any, NamedTuple, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.errors import FieldError
from synthesis.one_variable import Flags, Floats, golden_section
from synthesis.scenes.knotter import events
from synthesis.scenes.knotter.mechanism import Integers, Mechanism, Vector, as_array
from synthesis.work import Work

# -- a segment and a triangle -------------------------------------------------------------------------------------------

UNIT_ROUNDOFF = 2.0**-53
MAX_PIECES = 500_000
"""Most pieces (grid items x pieces of the driver's range) that one condition may look at."""
CHUNK_PIECES = 4096
"""Pieces that are worked on at once: bounds the memory and keeps the arrays in the cache."""
NARROW = 1e-5
"""Windows narrower than this (rad) are confirmed in extended precision."""
SPEED_STEP = 1e-6
"""Half step (rad) of the central difference that gives the speed of a crossing."""
APPROACH_NODES = 7
"""Places in each piece of the range from which the closest approach is sought."""
APPROACH_STEPS = 60
"""Golden-section steps of the closest approach: from the nodes' distance to below 1e-12 of it."""


class Coded(IntEnum):
    """Codes with the sentence that the user reads: ``NAME = code, sentence``."""

    sentence: str

    def __new__(cls, code: int, sentence: str) -> Self:
        """The code with its sentence."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.sentence = sentence
        return member


class Crossing(Coded):
    """How a segment lies to a triangle; ``sentence`` is what the user reads."""

    CROSSES = 0, "the segment crosses the triangle's inside"
    MISSES = 1, "the segment crosses the plane outside the triangle"
    TOUCHES = 2, "the segment touches the triangle's edge, a vertex or its plane with one end"
    SAME_SIDE = 3, "both ends lie on one side of the plane"
    PARALLEL = 4, "the segment runs parallel to the plane"
    IN_PLANE = 5, "the segment lies in the plane"
    DEGENERATE = 6, "the triangle has no area"


def subtract(a: Vector, b: Vector) -> Vector:
    """``a - b``."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def dot(a: Vector, b: Vector) -> Any:
    """The scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """The vector product ``a x b``."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def along(a: Vector, direction: Vector, by: Floats | float) -> Vector:
    """``a + by * direction``."""
    return a[0] + by * direction[0], a[1] + by * direction[1], a[2] + by * direction[2]


def norm(a: Vector) -> Any:
    """The length."""
    return np.sqrt(dot(a, a))


def divisor(x: Floats) -> Floats:
    """``x``, and one where it is zero: what may be divided by."""
    return np.where(np.not_equal(x, 0), x, 1.0)


def orientations(p: Vector, q: Vector, a: Vector, b: Vector, c: Vector) -> tuple[Any, ...]:
    """The five orientations that decide whether segment pq crosses triangle abc.

    ``s_p, s_q``: on which side of the plane the ends lie (length^3). ``u_ab, u_bc, u_ca``: on which side of each edge
    the line pq meets the plane, with the sign of ``s_p - s_q`` (length^8). All are polynomials in the coordinates: no
    poles.

    Law: pq crosses abc inside if and only if ``s_p s_q < 0`` and ``u`` has the sign of ``s_p`` for the three edges.
    Everything is taken relative to ``a``, so a common offset of all points costs no digits.
    """
    p, q, ab, ac = (subtract(point, a) for point in (p, q, b, c))
    n = cross(ab, ac)
    s_p, s_q = dot(n, p), dot(n, q)
    w = s_p - s_q
    meet = tuple(s_p * at_q - s_q * at_p for at_p, at_q in zip(p, q))  # w times the crossing point
    u_ab = dot(cross(n, ab), meet)
    u_bc = dot(cross(n, subtract(ac, ab)), along(meet, ab, -w))
    u_ca = -dot(cross(n, ac), meet)
    return s_p, s_q, u_ab, u_bc, u_ca


def inside(signs: Sequence[Floats] | Floats) -> Flags:
    """Whether the five orientations say that the segment crosses the triangle's inside."""
    s_p, s_q, *edges = signs
    side = np.sign(s_p)
    hit = side * np.sign(s_q) < 0
    for u in edges:
        hit = hit & (side * u > 0)
    return hit


def crossing_point(p: Vector, q: Vector, a: Vector, b: Vector, c: Vector) -> Vector:
    """Where the line pq meets the plane abc (eqs 11 and 26, for a plane in any position); p where it never does."""
    ab, ac = subtract(b, a), subtract(c, a)
    n = cross(ab, ac)
    s_p, s_q = dot(n, subtract(p, a)), dot(n, subtract(q, a))
    w = s_p - s_q
    return along(p, subtract(q, p), np.where(w != 0, s_p / divisor(w), 0.0))


def classify(p: ArrayLike, q: ArrayLike, a: ArrayLike, b: ArrayLike, c: ArrayLike) -> NDArray[np.int8]:
    """How segments lie to triangles, without a rounding error in the verdict.

    ``p``, ``q``, ``a``, ``b``, ``c`` (..., 3): ends of the segments and vertices of the triangles; finite, they
    broadcast.

    Shape (...). Values of `Crossing`.

    Signs come from doubles where they exceed a bound of their rounding error and from rational arithmetic elsewhere, so
    the verdict is exact for the doubles given (a filtered predicate, after Shewchuk 1997).
    """
    rows = np.array(np.broadcast_arrays(p, q, a, b, c), float)
    shape = rows.shape[1:-1]
    rows = rows.reshape(5, -1, 3)
    with np.errstate(all="ignore"):
        corners = np.moveaxis(rows - rows[2], -1, 1)
        signs = np.array(orientations(*corners))
        far_p, far_q, _, ab, ac = (norm(corner) for corner in corners)
        side_bound = 16 * UNIT_ROUNDOFF * ab * ac * np.array([far_p, far_q])
        edge_bound = 128 * UNIT_ROUNDOFF * (ab * ac) ** 2 * (ab + ac) * (far_p + ab + ac) * (far_q + ab + ac)
        # What may have no area, or be parallel, is left to rational arithmetic as well, and so is what underflows.
        known = norm(cross(corners[3], corners[4])) > 16 * UNIT_ROUNDOFF * ab * ac
        known &= np.abs(signs[0] - signs[1]) > side_bound.sum(axis=0)
        known &= np.all(np.abs(signs[:2]) > side_bound, axis=0)
        known &= np.all(np.abs(signs[2:]) > edge_bound + np.finfo(float).tiny, axis=0)
        known &= np.all(np.isfinite(signs), axis=0)
        crosses = np.where(inside(signs), Crossing.CROSSES, Crossing.MISSES)
    verdict = np.where(np.sign(signs[0]) == np.sign(signs[1]), Crossing.SAME_SIDE, crosses).astype(np.int8)
    for row in np.flatnonzero(~known):
        verdict[row] = _classify_exactly(*([Fraction(float(x)) for x in point] for point in rows[:, row]))
    return verdict.reshape(shape)


def _classify_exactly(p: Vector, q: Vector, a: Vector, b: Vector, c: Vector) -> Crossing:
    if not any(cross(subtract(b, a), subtract(c, a))):
        return Crossing.DEGENERATE
    s_p, s_q, *edges = orientations(p, q, a, b, c)
    if s_p == s_q:
        return Crossing.PARALLEL if s_p else Crossing.IN_PLANE
    if s_p * s_q > 0:
        return Crossing.SAME_SIDE
    side = 1 if s_p > s_q else -1
    if any(side * u < 0 for u in edges):
        return Crossing.MISSES
    return Crossing.CROSSES if s_p * s_q and all(edges) else Crossing.TOUCHES


def segment_distance(p: Vector, q: Vector, a: Vector, b: Vector) -> Any:
    """The distance of segments pq and ab; either may be a point.

    The minimum of a convex quadratic over a square: unclamped in one parameter, clamped, then the other (Ericson,
    Real-Time Collision Detection, 5.1.9). Law: symmetric in the two segments.
    """
    d1, d2, r = subtract(q, p), subtract(b, a), subtract(p, a)
    len1, len2, mixed = dot(d1, d1), dot(d2, d2), dot(d1, d2)
    to1, to2 = dot(d1, r), dot(d2, r)
    determinant = len1 * len2 - mixed * mixed
    skew = determinant > 8 * UNIT_ROUNDOFF * len1 * len2
    s = np.where(skew, np.clip((mixed * to2 - to1 * len2) / np.where(skew, determinant, 1.0), 0.0, 1.0), 0.0)
    t = np.clip((mixed * s + to2) / divisor(len2), 0.0, 1.0)
    s = np.clip((mixed * t - to1) / divisor(len1), 0.0, 1.0)
    return norm(subtract(along(p, d1, s), along(a, d2, t)))


def segment_triangle_distance(p: Vector, q: Vector, a: Vector, b: Vector, c: Vector) -> Any:
    """The distance of segment pq and triangle abc; zero where they meet.

    The nearest points lie on an edge and the segment, or on an end of the segment and the triangle's inside.
    """
    distance = np.minimum(
        np.minimum(segment_distance(p, q, a, b), segment_distance(p, q, b, c)), segment_distance(p, q, c, a)
    )
    n = cross(subtract(b, a), subtract(c, a))
    size = norm(n)
    for end in (p, q):
        over = np.ones_like(distance, bool)
        for start, stop in ((a, b), (b, c), (c, a)):
            over &= dot(cross(n, subtract(stop, start)), subtract(end, start)) > 0
        height = np.abs(dot(n, subtract(end, a))) / divisor(size)
        distance = np.where(over, np.minimum(distance, height), distance)
    return np.where(inside(orientations(p, q, a, b, c)), 0.0, distance)


# -- the conditions -----------------------------------------------------------------------------------------------------


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
    """How far a point comes past a plane or into a disc."""

    value: Floats
    """At the condition's own driver angle; positive is past the plane or inside."""
    worst: Floats
    worst_driver: Floats
    """The largest over the range and the driver angle (rad) where it is reached."""


@dataclass(frozen=True)
class Clearance:
    """A point must keep to one side of a disc's plane, or out of the disc and what lies behind it.

    With a finite radius the value is minus the signed distance to the solid of all points on the disc or behind it (a
    half-infinite cylinder). Law: never larger than the plane's value, and equal to it as the radius grows.
    """

    name: str
    point: str
    frame: str
    """Frame of the disc: it lies in the plane through the origin across ``axis``."""
    axis: int
    """0, 1, 2 for i, j, k."""
    side: int
    """The side that is free: -1 for negative coordinates."""
    at: float
    """Driver angle of ``value``, rad."""
    over: tuple[float, float]
    """Range of the driver in which the worst is sought, rad; the two may be equal."""
    radius: float = np.inf
    """Of the disc; infinite for the whole plane."""
    locked: str | None = None
    """A law that is held at its value at ``at``, for a body that is locked during the passage."""

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


class Found(Coded):
    """What a search for a segment's entry into a triangle found; ``sentence`` is what the user reads."""

    ENTERS = 0, "the segment first enters through the wanted edge"
    ENTERS_ELSEWHERE = 1, "the segment first enters through another edge, or with one end through the plane"
    INSIDE_AT_START = 2, "the segment is inside already where the range starts"
    NEVER = 3, "the segment never crosses the triangle in the range"
    ALWAYS_IN_PLANE = 4, "an end of the segment lies in the triangle's plane throughout: it never crosses"


@dataclass(frozen=True)
class Entry(Result):
    """How a segment enters a triangle; NaN (and -1 for the edge) where ``found`` says that there is no such thing."""

    found: Integers
    """Values of `Found`."""
    enter: Floats
    leave: Floats
    """Driver angles (rad) of the first window; ``leave`` is the range's end if the segment stays inside."""
    opened_by: Integers
    """0, 1: an end of the segment came through the plane; 2, 3, 4: the edge of entry, from its first vertex; -1:
    inside at the start or never inside."""
    point: Floats
    """The crossing at ``enter``, shape (items, 3)."""
    fraction: Floats
    """Where ``point`` lies along the entry edge, 0 at its first vertex."""
    windows: Integers
    """Number of separate windows in the range."""
    sensitivity: Floats
    """By how much ``enter`` moves when the edge of entry (or the segment's end) is moved by one unit of length, rad
    per length: the condition number of the event. It grows without bound as the entry becomes tangential."""
    nearest: Floats
    """Where the segment never enters: the driver angle (rad) at which it comes nearest to the triangle."""
    nearest_case: Integers
    """How it lies to the triangle there, values of `Crossing`; -1 where it enters."""


@dataclass(frozen=True)
class SegmentHitsTriangle:
    """A segment must first enter a triangle through one named edge, within a range of the driver.

    ``margin`` (length) is, where the condition holds, the distance of the entry point to the nearer end of the wanted
    edge. Where the segment enters elsewhere it is minus the distance of the entry point to the wanted edge, and where
    it never enters minus the smallest distance of segment and triangle in the range. The three meet at zero.
    """

    name: str
    segment: tuple[str, str]
    triangle: tuple[str, str, str]
    """Names of points."""
    frame: str
    """Frame in which the crossing is reported."""
    window: tuple[float, float]
    """Range of the driver, rad."""
    enter: int
    """The wanted edge: 0, 1, 2 for the edges from the first, second and third vertex."""

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
        for first, second in itertools.combinations(home, 2):
            (frame, one), (other_frame, other) = home[first], home[second]
            reach = np.linalg.norm(one) + np.linalg.norm(other)
            if frame == other_frame and np.linalg.norm(np.subtract(one, other)) <= 4 * UNIT_ROUNDOFF * reach:
                lost = "triangle" if {first, second} <= set(self.triangle) else "segment that could cross"
                raise FieldError(
                    "/points",
                    f"{first} and {second} coincide, so {self.name} has no {lost}",
                    constraint="coincident_points",
                    points=[first, second],
                )

    def positions(self, mechanism: Mechanism, driver: Floats) -> tuple[Vector, ...]:
        """The segment's ends and the triangle's vertices in `frame`."""
        return tuple(mechanism.position(name, self.frame, driver) for name in (*self.segment, *self.triangle))

    def evaluate(self, mechanism: Mechanism, items: int, work: Work | None = None) -> Entry:
        """The verdict for each item."""
        return in_chunks(self._evaluate, mechanism, items, self.frames(mechanism), self.window, self.name, work)

    def _evaluate(self, mechanism: Mechanism, items: int, ends: Floats) -> Entry:
        def function(driver: Floats, item: Integers) -> Floats:
            signs = orientations(*self.positions(mechanism.item(item), driver))
            return as_array(signs, np.broadcast_shapes(driver.shape, item.shape))

        floor = self._floor(mechanism, items, ends)
        parts = events.pieces(function, ends, items, floor)
        in_plane = np.any(parts.size[:2] <= floor[:2], axis=0)
        item, start, end, opened_by = inside_windows(
            function, events.roots(parts, function, floor), ends, items, ~in_plane
        )
        windows = np.bincount(item, minlength=items)
        entered, missing = np.flatnonzero(windows), np.flatnonzero(windows == 0)
        first = np.searchsorted(item, entered)

        enter, leave, fraction, margin, sensitivity, nearest = np.full((6, items), np.nan)
        point = np.full((items, 3), np.nan)
        opened, case = np.full((2, items), -1)
        enter[entered], leave[entered], opened[entered] = start[first], end[first], opened_by[first]
        through = np.flatnonzero(opened >= 0)
        point[entered], fraction[entered], margin[entered] = self._crossing(mechanism, entered, enter, opened)
        sensitivity[through] = self._sensitivity(mechanism.item(through), enter[through], opened[through])
        if len(missing):
            distance, nearest[missing] = self._closest_approach(mechanism, missing, ends)
            margin[missing] = -distance
            corners = self.positions(mechanism.item(missing), nearest[missing])
            case[missing] = classify(*(as_array(corner, missing.shape).T for corner in corners))
        found = np.select(
            [in_plane, windows == 0, opened < 0, opened == 2 + self.enter],
            [Found.ALWAYS_IN_PLANE, Found.NEVER, Found.INSIDE_AT_START, Found.ENTERS],
            Found.ENTERS_ELSEWHERE,
        )
        holds = found == Found.ENTERS
        return Entry(holds, margin, found, enter, leave, opened, point, fraction, windows, sensitivity, nearest, case)

    def _crossing(self, mechanism: Mechanism, rows: Integers, enter: Floats, opened: Integers) -> tuple[Floats, ...]:
        """Point, fraction and margin at the entry of some items."""
        positions = self.positions(mechanism.item(rows), enter[rows])
        p, q, *corners = (as_array(position, rows.shape) for position in positions)
        point = crossing_point(p, q, *corners)
        fraction, margin = np.full((2, len(rows)), np.nan)
        for edge in range(3):
            a, b = corners[edge], corners[(edge + 1) % 3]
            ab = subtract(b, a)
            length = norm(ab)
            share = dot(subtract(point, a), ab) / divisor(dot(ab, ab))
            through = opened[rows] == 2 + edge
            fraction[through] = share[through]
            if edge == self.enter:
                inner = np.minimum(share, 1 - share) * length
                outer = norm(subtract(point, along(a, ab, np.clip(share, 0, 1))))
                margin = np.where(through, np.maximum(inner, 0.0), -outer)
        return np.transpose(point) + 0.0, fraction, margin  # no minus zero

    def _sensitivity(self, mechanism: Mechanism, enter: Floats, opened_by: Integers) -> Floats:
        """``|d driver / d length|``: one over the speed at which the crossing passes the edge it enters by."""

        def distance(driver: Floats) -> Floats:
            p, q, a, b, c = self.positions(mechanism, driver)
            s_p, s_q, *u = orientations(p, q, a, b, c)
            area = divisor(norm(cross(subtract(b, a), subtract(c, a))))
            scale = divisor(s_p - s_q) * area
            sides = (norm(subtract(end, start)) for start, end in ((a, b), (b, c), (c, a)))
            rows = (s_p / area, s_q / area, *(edge / (scale * divisor(side)) for edge, side in zip(u, sides)))
            return np.choose(opened_by, as_array(rows, enter.shape))

        speed = np.abs(distance(enter + SPEED_STEP) - distance(enter - SPEED_STEP)) / (2 * SPEED_STEP)
        return np.where(speed > 0, 1.0 / divisor(speed), np.inf)

    def _floor(self, mechanism: Mechanism, items: int, ends: Floats) -> Floats:
        """Rounding error of the five orientations, shape (5, items); refuses a triangle without area."""
        p, q, a, b, c = self.positions(mechanism.item(np.arange(items)[:, None]), ends)
        ab, ac = subtract(b, a), subtract(c, a)
        sizes = (norm(subtract(p, a)) + norm(subtract(q, a)), norm(cross(ab, ac)), norm(ab) + norm(ac))
        far, area, sides = as_array(sizes, (items, len(ends))).max(axis=-1)
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

    def _closest_approach(self, mechanism: Mechanism, rows: Integers, ends: Floats) -> tuple[Floats, Floats]:
        """The smallest distance of segment and triangle over the range, and its driver angle, for some items."""
        mechanism = mechanism.item(rows[:, None])

        def distance(driver: Floats) -> Any:
            return segment_triangle_distance(*self.positions(mechanism, driver))

        grid = np.append(np.linspace(ends[:-1], ends[1:], APPROACH_NODES)[:-1].T.ravel(), ends[-1])
        at_grid = np.broadcast_to(distance(grid[None]), (len(rows), len(grid)))
        best = np.argmin(at_grid, axis=1)[:, None]
        left, right = grid[np.maximum(best - 1, 0)], grid[np.minimum(best + 1, len(grid) - 1)]
        least, driver = golden_section(distance, left, right, APPROACH_STEPS)
        # The node stays a candidate: at an end of the range the bracket is one-sided.
        at_node = np.take_along_axis(at_grid, best, 1)
        driver = np.where(at_node <= least, grid[best], driver)
        return np.minimum(at_node, least)[:, 0], driver[:, 0]


def inside_windows(
    function: events.Function, found: events.Events, ends: Floats, items: int, allowed: Flags
) -> tuple[Any, ...]:
    """Ranges of the driver in which the segment is inside, sorted by item and driver.

    The five orientations (``function``) change sign at their roots (``found``) only, so one look between two neighbours
    decides. ``allowed`` tells the items that may have a window at all.

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
    hit = inside(function(driver[span] + 0.5 * width, item[span]))
    narrow = np.flatnonzero(width < NARROW)
    if len(narrow):
        extended = driver[span[narrow]] + 0.5 * width[narrow].astype(np.longdouble)
        hit[narrow] = inside(function(extended, item[span[narrow]]))
    span = span[hit & allowed[item[span]]]
    # Two neighbouring spans that are both inside are one window: nothing but rounding parts them.
    continued = np.zeros(len(span), bool)
    continued[1:] = (driver[span[1:]] <= driver[span[:-1] + 1]) & (item[span[1:]] == item[span[:-1]])
    starts = np.flatnonzero(~continued)
    stops = np.append(starts[1:], len(span)) - 1 if len(span) else starts
    return item[span[starts]], driver[span[starts]], driver[span[stops] + 1], kind[span[starts]]


class CrossingCurve(NamedTuple):
    """The rope's line against the plane of a triangle (E1 or E2), each array with one row a driver angle."""

    point: Floats
    """Where the line meets the plane, in the condition's frame, shape (n, 3); NaN where it runs parallel to it."""
    on_rope: Flags
    """Whether that is between the rope's ends."""
    inside: Flags
    """Whether the rope crosses the inside of the triangle."""
    triangle: Floats
    """The triangle's vertices, shape (3, n, 3): those of another body move."""


def crossing_curve(mechanism: Mechanism, condition: SegmentHitsTriangle, driver: Floats) -> CrossingCurve:
    """The crossing of one mechanism at driver angles of shape (n,).

    Law: inside is on the rope; where a scan's rope is inside, the exact event lies at or before that angle.
    """
    p, q, *corners = condition.positions(mechanism, driver)
    a, b, c = corners
    n = cross(subtract(b, a), subtract(c, a))
    s_p, s_q = (np.broadcast_to(dot(n, subtract(end, a)), driver.shape) for end in (p, q))
    point = as_array(crossing_point(p, q, a, b, c), driver.shape).T
    point = np.where((s_p != s_q)[:, None], point, np.nan)
    hits = np.broadcast_to(inside(orientations(p, q, a, b, c)), driver.shape)
    triangle = np.stack([as_array(corner, driver.shape).T for corner in corners])
    return CrossingCurve(point, s_p * s_q < 0, hits, triangle)


def step_before(mechanism: Mechanism, condition: SegmentHitsTriangle, step: float) -> tuple[float, Floats] | None:
    """Driver angle and crossing at the last step of a scan before the rope is first inside, as the source tabulates them.

    None where no step of the scan is inside, or the first one already.
    """
    low, high = condition.window
    driver = low + step * np.arange(int(np.floor((high - low) / step * (1 + 1e-12))) + 1)
    curve = crossing_curve(mechanism, condition, driver)
    hit = int(np.argmax(curve.inside))
    if not curve.inside[hit] or hit == 0:
        return None
    return float(driver[hit - 1]), curve.point[hit - 1]


def point_paths(mechanism: Mechanism, names: list[str], frame: str, driver: Floats) -> dict[str, Floats]:
    """Paths of points in a frame, each of shape (n, 3)."""
    return {name: as_array(mechanism.position(name, frame, driver), driver.shape).T for name in names}
