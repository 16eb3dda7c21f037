"""Plane shapes of parts: everything within a radius of a point, a line or a polygon, and how far two of them are apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from synthesis.arrays import Complexes, Flags, Floats

FLAT = 1e-9
"""A polygon less high than this part of its longest side is a line."""
OVERLAP = 1e-6
"""Of the size: how deep sharp outlines count as lying in one another; `distances` is 0 there, whatever the depth."""


@dataclass(frozen=True)
class Shape:
    """All points within `radius` of a core, in the frame of the body that carries it.

    ``core``: one point; the two ends of a line; or the corners of a simple polygon, counter-clockwise, convex or not.
    """

    core: tuple[complex, ...]
    radius: float

    @cached_property
    def reach(self) -> float:
        """Largest distance of a corner of the core from the origin of its frame."""
        return max(map(abs, self.core))

    @property
    def corners(self) -> tuple[complex, ...]:
        """The core with a point as a line of no length, so that there are lines and polygons only."""
        return self.core * 2 if len(self.core) == 1 else self.core


def disc(centre: complex, radius: float) -> Shape:
    """A pin, a post or a head."""
    return Shape((complex(centre),), float(radius))


def hull(points: Sequence[complex]) -> tuple[complex, ...]:
    """Corners of the convex hull, counter-clockwise; two where all points lie on a line, one where they are one.

    Law: no point lies outside of it by more than `FLAT` of the largest distance.
    """
    rest = sorted({complex(z) for z in points}, key=lambda z: (z.real, z.imag))
    if len(rest) < 3:
        return tuple(rest)
    halves = []
    for way in (rest, rest[::-1]):
        half: list[complex] = []
        for z in way:
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


def _cross(one: complex, other: complex) -> float:
    return one.real * other.imag - one.imag * other.real


def signed_area(corners: Sequence[complex]) -> float:
    """Area of a polygon, above 0 where its corners run counter-clockwise."""
    return sum(_cross(a, b) for a, b in zip(corners, [*corners[1:], corners[0]])) / 2


def crosses_itself(corners: Sequence[complex]) -> bool:
    """Whether two sides of a polygon that are no neighbours meet, or a corner has no angle."""
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
    back = np.conj(side) * np.roll(side, -1)
    return meets or bool(np.any((back.imag == 0) & (back.real < 0))) or bool(np.any(side == 0))


def contains(corners: Sequence[complex], point: complex) -> bool:
    """Whether a polygon has a point inside."""
    return bool(_inside(np.asarray(corners, dtype=complex)[None], np.array([point]))[0])


def nearest_on(corners: Sequence[complex], point: complex) -> complex:
    """The point of a polygon's outline that is nearest to a point."""
    best = min(
        (_foot(a, b, point) for a, b in zip(corners, [*corners[1:], corners[0]])), key=lambda foot: abs(foot - point)
    )
    return complex(best)


def _foot(first: complex, last: complex, point: complex) -> complex:
    along = last - first
    square = abs(along) ** 2
    share = 0.0 if square == 0 else float(np.clip((np.conj(along) * (point - first)).real / square, 0, 1))
    return first + share * along


# -- distances ----------------------------------------------------------------------------------------------------------


def distances(one: Complexes, other: Complexes) -> Floats:
    """How far cores are apart, row by row: 0 where their lines cross or one lies in the other.

    ``one`` (m, j), ``other`` (m, k): corners; two are a line (also of no length), more a simple polygon.

    Shape (m,). Law: symmetric, and the same for both moved alike.
    """
    best = np.minimum(_to_sides(one, other), _to_sides(other, one))
    meet = _cross_somewhere(one, other)
    for polygon, rest in ((one, other), (other, one)):
        if polygon.shape[-1] > 2:
            # where no sides cross, all of the rest is inside or all of it outside
            meet |= _inside(polygon, rest[:, 0])
    return np.where(meet, 0.0, best)


def _sides(corners: Complexes) -> tuple[Complexes, Complexes]:
    """Beginnings of the sides and the ways to their ends, (m, sides)."""
    if corners.shape[-1] == 2:
        return corners[:, :1], corners[:, 1:] - corners[:, :1]
    return corners, np.roll(corners, -1, axis=-1) - corners


def _to_sides(points: Complexes, corners: Complexes) -> Floats:
    """Least distance of points (m, p) from the sides of polygons or lines (m, k), shape (m,)."""
    begin, way = _sides(corners)
    square = way.real**2 + way.imag**2
    inverse = (1 / np.where(square > 0, square, np.inf))[:, None]
    off = points[:, :, None] - begin[:, None]
    along = way[:, None]
    share = np.clip((off.real * along.real + off.imag * along.imag) * inverse, 0.0, 1.0)
    rest = off - share * along
    return np.sqrt((rest.real**2 + rest.imag**2).reshape(len(points), -1).min(axis=-1))


def _cross_somewhere(one: Complexes, other: Complexes) -> Flags:
    """Whether a side of each crosses a side of the other, shape (m,)."""
    (p, v), (q, w) = _sides(one), _sides(other)
    p, v, q, w = p[:, :, None], v[:, :, None], q[:, None], w[:, None]
    off = p - q
    turned = w.real * v.imag - w.imag * v.real
    before = w.real * off.imag - w.imag * off.real
    beside = v.imag * off.real - v.real * off.imag
    crossing = (before * (before + turned) < 0) & (beside * (beside - turned) < 0)
    return np.asarray(crossing.reshape(len(one), -1).any(axis=-1))


def _inside(polygon: Complexes, point: Complexes) -> Flags:
    """Whether polygons (m, k) have points (m,) inside, by the sides that a ray along x meets."""
    begin, way = _sides(polygon)
    height = point[:, None] - begin
    last = begin + way
    spans = (begin.imag > point.imag[:, None]) != (last.imag > point.imag[:, None])
    rise = np.where(spans, way.imag, 1.0)
    beyond = height.real < way.real * (height.imag / rise)
    return np.asarray((spans & beyond).sum(axis=-1) % 2 == 1)
