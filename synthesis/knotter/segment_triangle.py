"""Does a segment cross a triangle? Signs of orientations instead of a sum of angles or a quotient.

Nothing here divides to decide, so that a segment parallel to the plane, a point on an edge or a triangle without area
is a named case and never a NaN.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from fractions import Fraction
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.knotter.mechanism import Vector
from synthesis.one_variable import Flags, Floats

UNIT_ROUNDOFF = 2.0**-53


class Verdict(IntEnum):
    """Codes with the sentence that the user reads: ``NAME = code, sentence``."""

    sentence: str

    def __new__(cls, code: int, sentence: str) -> Self:
        """The code with its sentence."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.sentence = sentence
        return member


class Crossing(Verdict):
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
