"""Outlines of parts: discs, thick lines and polygons, with distances, containment and free room.

A shape is the set of points within a radius of a point, a line or a polygon.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from heapq import heappop, heappush

import numpy as np

from synthesis.arrays import Complexes, Flags, Floats

_MAX_SQUARES = 1000
"""Largest number of squares that are searched for room; ordinary outlines need some hundred."""
FLAT = 1e-9
"""Ratio of height and longest side below which a polygon counts as a line."""
ROOM = 1e-3
"""Resolution of a search for room, as a fraction of half the polygon's extent."""


@dataclass(frozen=True)
class Shape:
    """All points within `radius` of a core, in the frame of the body that carries it."""

    core: tuple[complex, ...]
    """A single point, the two ends of a line, or the corners of a simple polygon, counter-clockwise."""
    radius: float

    @cached_property
    def reach(self) -> float:
        """Largest distance of a corner of the core from the origin of its frame."""
        return max(map(abs, self.core))

    @property
    def corners(self) -> tuple[complex, ...]:
        """Corners of the core, with a point as a line of zero length, so that only lines and polygons occur."""
        return self.core * 2 if len(self.core) == 1 else self.core

    @property
    def extent(self) -> tuple[complex, complex]:
        """Lower left and upper right corner of the bounding box."""
        x, y = [z.real for z in self.core], [z.imag for z in self.core]
        return complex(min(x), min(y)) - self.radius * (1 + 1j), complex(max(x), max(y)) + self.radius * (1 + 1j)

    def times(self, factor: complex) -> Shape:
        """Return the shape scaled by the modulus of a factor and rotated about the origin by its argument."""
        return Shape(tuple(factor * z for z in self.core), abs(factor) * self.radius)

    def grown(self, by: float) -> Shape:
        """Return the shape with a larger radius."""
        return Shape(self.core, self.radius + by)


def disc(centre: complex, radius: float) -> Shape:
    """Return the shape of a pin, a post or a head."""
    return Shape((complex(centre),), float(radius))


def hull(points: Sequence[complex]) -> tuple[complex, ...]:
    """Return the corners of the convex hull, counter-clockwise.

    There are two corners if all points lie on a line, and a single corner if all points coincide. No point lies outside by
    more than `FLAT` of the largest distance.
    """
    points_left = sorted({complex(z) for z in points}, key=lambda z: (z.real, z.imag))
    if len(points_left) < 3:
        return tuple(points_left)
    halves = []
    for order in (points_left, points_left[::-1]):
        half: list[complex] = []
        for z in order:
            while len(half) > 1 and _cross(half[-1] - half[-2], z - half[-1]) <= 0:
                half.pop()
            half.append(z)
        halves.append(half[:-1])
    corners = halves[0] + halves[1]
    first, last = max(((a, b) for a in corners for b in corners), key=lambda pair: abs(pair[0] - pair[1]))
    longest = abs(last - first)
    if all(abs(_cross(last - first, z - first)) <= FLAT * longest**2 for z in corners):
        return (first, last)
    return tuple(corners)


def _cross(first: complex, second: complex) -> float:
    return first.real * second.imag - first.imag * second.real


def signed_area(corners: Sequence[complex]) -> float:
    """Return the area of a polygon, positive if its corners run counter-clockwise."""
    return sum(_cross(a, b) for a, b in zip(corners, [*corners[1:], corners[0]])) / 2


def crosses_itself(corners: Sequence[complex]) -> bool:
    """Check if two sides of a polygon that are not neighbours meet, or if two neighbours fold back."""
    z = np.asarray(corners, dtype=complex)
    side = np.roll(z, -1) - z
    count = z.size
    first, second = np.triu_indices(count, 2)
    apart = ~((first == 0) & (second == count - 1))
    first, second = first[apart], second[apart]
    ends = (
        np.stack([z[first], z[first] + side[first]], axis=-1),
        np.stack([z[second], z[second] + side[second]], axis=-1),
    )
    meets = bool(np.any(distances(*ends) <= 0)) if first.size else False
    turns = np.conj(side) * np.roll(side, -1)
    return meets or bool(np.any((turns.imag == 0) & (turns.real < 0))) or bool(np.any(side == 0))


def contains(corners: Sequence[complex], point: complex) -> bool:
    """Check if a polygon contains a point."""
    return bool(_inside(np.asarray(corners, dtype=complex)[None], np.array([point]))[0])


def nearest_on(corners: Sequence[complex], point: complex) -> complex:
    """Return the point of a polygon's outline that is nearest to a point."""
    best = min(
        (_foot(a, b, point) for a, b in zip(corners, [*corners[1:], corners[0]])), key=lambda foot: abs(foot - point)
    )
    return complex(best)


def nearest_room(
    corners: Sequence[complex], obstacles: Sequence[Sequence[complex]], rim: float, distance: float, point: complex
) -> complex | None:
    """Return the point inside a polygon that is nearest to a given point, up to `ROOM`, with room for a hole; None without one.

    It keeps the distance ``rim`` from the polygon's outline and ``distance`` from the obstacles, which are lines. Squares are
    searched in the order of their distance. Room changes by at most the distance between two points, so a square without any room
    is discarded as a whole.
    """
    sides = np.asarray(corners, dtype=complex)[None]

    def clearance_at(at: complex) -> float:
        depth = float(_to_sides(np.array([[at]]), sides)[0]) * (1 if contains(corners, at) else -1)
        return min([depth - rim, *(abs(nearest_on(line, at) - at) - distance for line in obstacles)])

    if clearance_at(point) >= 0:
        return point
    low, high = (complex(function(sides.real), function(sides.imag)) for function in (np.min, np.max))
    half = max((high - low).real, (high - low).imag) / 2
    resolution, best, best_distance = ROOM * half, None, np.inf
    squares, counter = [(0.0, 0, (low + high) / 2, half)], 0
    for _ in range(_MAX_SQUARES):
        if not squares or squares[0][0] >= best_distance - resolution:
            break
        _, _, at, half = heappop(squares)
        clearance, reach = clearance_at(at), np.sqrt(2) * half
        distance_to = abs(point - at)
        if clearance >= 0 and distance_to - clearance < best_distance:
            # all within its room has some
            best, best_distance = at + (point - at) / distance_to * clearance, distance_to - clearance
        if -reach <= clearance < reach and half > resolution:
            for step in (-1 - 1j, 1 - 1j, -1 + 1j, 1 + 1j):
                counter += 1
                centre = at + step * half / 2
                offset = point - centre
                outside = complex(max(abs(offset.real) - half / 2, 0.0), max(abs(offset.imag) - half / 2, 0.0))
                heappush(squares, (abs(outside), counter, centre, half / 2))
    return best


def _foot(first: complex, last: complex, point: complex) -> complex:
    along = last - first
    square = abs(along) ** 2
    fraction = 0.0 if square == 0 else float(np.clip((np.conj(along) * (point - first)).real / square, 0, 1))
    return first + fraction * along


def distances(first: Complexes, second: Complexes) -> Floats:
    """Return the distances of cores, row by row: 0 if their lines cross or one core contains the other.

    Parameters
    ----------
    first, second : ndarray of complex, shape (m, j) and (m, k)
        Corners; two corners are a line, which may have length zero, and more are a simple polygon.

    Returns
    -------
    ndarray, shape (m,)
    """
    best = np.minimum(_to_sides(first, second), _to_sides(second, first))
    meet = _cross_somewhere(first, second)
    for polygon, partner in ((first, second), (second, first)):
        if polygon.shape[-1] > 2:
            # if no sides cross, the partner lies inside or outside as a whole
            meet |= _inside(polygon, partner[:, 0])
    return np.where(meet, 0.0, best)


def _sides(corners: Complexes) -> tuple[Complexes, Complexes]:
    """Return the starting points of the sides and the vectors to their ends, (m, sides)."""
    if corners.shape[-1] == 2:
        return corners[:, :1], corners[:, 1:] - corners[:, :1]
    return corners, np.roll(corners, -1, axis=-1) - corners


def _to_sides(points: Complexes, corners: Complexes) -> Floats:
    """Return the smallest distance of points (m, p) from the sides of polygons or lines (m, k), shape (m,)."""
    start, vector = _sides(corners)
    square = vector.real**2 + vector.imag**2
    inverse = (1 / np.where(square > 0, square, np.inf))[:, None]
    off = points[:, :, None] - start[:, None]
    along = vector[:, None]
    fraction = np.clip((off.real * along.real + off.imag * along.imag) * inverse, 0.0, 1.0)
    remainder = off - fraction * along
    return np.sqrt((remainder.real**2 + remainder.imag**2).reshape(len(points), -1).min(axis=-1))


def _cross_somewhere(first: Complexes, second: Complexes) -> Flags:
    """Check if a side of each core crosses a side of the other, shape (m,)."""
    (p, v), (q, w) = _sides(first), _sides(second)
    p, v, q, w = p[:, :, None], v[:, :, None], q[:, None], w[:, None]
    offset = p - q
    turned = w.real * v.imag - w.imag * v.real
    before = w.real * offset.imag - w.imag * offset.real
    beside = v.imag * offset.real - v.real * offset.imag
    crossing = (before * (before + turned) < 0) & (beside * (beside - turned) < 0)
    return np.asarray(crossing.reshape(len(first), -1).any(axis=-1))


def _inside(polygon: Complexes, point: Complexes) -> Flags:
    """Check if polygons (m, k) contain points (m,), by counting the sides that a ray along x crosses."""
    start, vector = _sides(polygon)
    height = point[:, None] - start
    last = start + vector
    spans = (start.imag > point.imag[:, None]) != (last.imag > point.imag[:, None])
    rise = np.where(spans, vector.imag, 1.0)
    beyond = height.real < vector.real * (height.imag / rise)
    return np.asarray((spans & beyond).sum(axis=-1) % 2 == 1)
