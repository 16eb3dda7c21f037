"""Does a segment cross a triangle? Signs of orientations instead of a sum of angles or a quotient.

Nothing here divides to decide, so that a segment parallel to the plane, a point on an edge or a triangle without area
is a named case and never a NaN.
"""

from __future__ import annotations

from enum import IntEnum
from fractions import Fraction

import numpy as np

from synthesis.knotter.mechanism import Vector

UNIT_ROUNDOFF = 2.0**-53


class Crossing(IntEnum):
    """How a segment lies to a triangle; ``sentence`` is what the user reads."""

    CROSSES = 0, "the segment crosses the triangle's inside"
    MISSES = 1, "the segment crosses the plane outside the triangle"
    TOUCHES = 2, "the segment touches the triangle's edge, a vertex or its plane with one end"
    SAME_SIDE = 3, "both ends lie on one side of the plane"
    PARALLEL = 4, "the segment runs parallel to the plane"
    IN_PLANE = 5, "the segment lies in the plane"
    DEGENERATE = 6, "the triangle has no area"

    def __new__(cls, code: int, sentence: str) -> Crossing:
        member = int.__new__(cls, code)
        member._value_ = code
        member.sentence = sentence
        return member


def subtract(a: Vector, b: Vector) -> Vector:
    """``a - b``."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def dot(a: Vector, b: Vector) -> np.ndarray:
    """The scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """The vector product ``a x b``."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def along(a: Vector, direction: Vector, by: np.ndarray | float) -> Vector:
    """``a + by * direction``."""
    return a[0] + by * direction[0], a[1] + by * direction[1], a[2] + by * direction[2]


def norm(a: Vector) -> np.ndarray:
    """The length."""
    return np.sqrt(dot(a, a))


def orientations(p: Vector, q: Vector, a: Vector, b: Vector, c: Vector) -> tuple[np.ndarray, ...]:
    """The five orientations that decide whether segment pq crosses triangle abc.

    Returns
    -------
    tuple of ndarray
        ``s_p, s_q``: on which side of the plane the ends lie (length^3). ``u_ab, u_bc, u_ca``: on which side of each
        edge the line pq meets the plane, with the sign of ``s_p - s_q`` (length^8). All are polynomials in the
        coordinates: no poles.

    Notes
    -----
    Law: pq crosses abc inside if and only if ``s_p s_q < 0`` and ``u`` has the sign of ``s_p`` for the three edges.
    Everything is taken relative to ``a``, so a common offset of all points costs no digits.
    """
    ab, ac = subtract(b, a), subtract(c, a)
    return _orientations(subtract(p, a), subtract(q, a), ab, ac, cross(ab, ac))


def _orientations(p: Vector, q: Vector, ab: Vector, ac: Vector, n: Vector) -> tuple[np.ndarray, ...]:
    s_p, s_q = dot(n, p), dot(n, q)
    w = s_p - s_q
    meet = tuple(s_p * at_q - s_q * at_p for at_p, at_q in zip(p, q))  # w times the crossing point
    u_ab = dot(cross(n, ab), meet)
    u_bc = dot(cross(n, subtract(ac, ab)), along(meet, ab, -w))
    u_ca = -dot(cross(n, ac), meet)
    return s_p, s_q, u_ab, u_bc, u_ca


def inside(signs: tuple[np.ndarray, ...]) -> np.ndarray:
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
    meets = np.abs(w) > 0
    return along(p, subtract(q, p), np.where(meets, s_p / np.where(meets, w, 1.0), 0.0))


def classify(p: np.ndarray, q: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """How segments lie to triangles, without a rounding error in the verdict.

    Parameters
    ----------
    p, q, a, b, c : array_like, shape (..., 3)
        Ends of the segments and vertices of the triangles; finite, they broadcast.

    Returns
    -------
    ndarray of int8, shape (...)
        Values of `Crossing`.

    Notes
    -----
    Signs come from doubles where they exceed a bound of their rounding error and from rational arithmetic elsewhere,
    so the verdict is exact for the doubles given (a filtered predicate, after Shewchuk 1997).
    """
    points = np.broadcast_arrays(*(np.asarray(point, float) for point in (p, q, a, b, c)))
    shape = points[0].shape[:-1]
    rows = [point.reshape(-1, 3) for point in points]
    with np.errstate(all="ignore"):
        origin = rows[2]
        p_, q_, ab, ac = (tuple((row - origin).T) for row in (rows[0], rows[1], rows[3], rows[4]))
        n = cross(ab, ac)
        signs = np.array(_orientations(p_, q_, ab, ac, n))
        area, far_p, far_q = norm(ab) * norm(ac), norm(p_), norm(q_)
        longest = norm(ab) + norm(ac)
        side_bound = 16 * UNIT_ROUNDOFF * area * np.array([far_p, far_q])
        edge_bound = 128 * UNIT_ROUNDOFF * area**2 * longest * (far_p + longest) * (far_q + longest)
        sides_known = np.all(np.abs(signs[:2]) > side_bound, axis=0)
        edges_known = np.all(np.abs(signs[2:]) > edge_bound, axis=0)
        known = sides_known & (edges_known | (signs[0] * signs[1] > 0)) & np.all(np.isfinite(signs), axis=0)
        known &= np.isfinite(edge_bound) & (norm(n) > 16 * UNIT_ROUNDOFF * area)
        same_side = np.sign(signs[0]) == np.sign(signs[1])
        # A segment that is nearly parallel may be exactly parallel: only rational arithmetic tells.
        known &= ~same_side | (np.abs(signs[0] - signs[1]) > side_bound.sum(axis=0))
        verdict = np.where(
            same_side, Crossing.SAME_SIDE, np.where(inside(tuple(signs)), Crossing.CROSSES, Crossing.MISSES)
        )
    verdict = verdict.astype(np.int8)
    for row in np.flatnonzero(~known):
        verdict[row] = _classify_exactly(*(tuple(Fraction(float(x)) for x in point[row]) for point in rows))
    return verdict.reshape(shape)


def _classify_exactly(p: Vector, q: Vector, a: Vector, b: Vector, c: Vector) -> Crossing:
    ab, ac = subtract(b, a), subtract(c, a)
    n = cross(ab, ac)
    if not any(n):
        return Crossing.DEGENERATE
    s_p, s_q, *edges = _orientations(subtract(p, a), subtract(q, a), ab, ac, n)
    if s_p == s_q:
        return Crossing.PARALLEL if s_p else Crossing.IN_PLANE
    if s_p * s_q > 0:
        return Crossing.SAME_SIDE
    side = 1 if s_p > s_q else -1
    if any(side * u < 0 for u in edges):
        return Crossing.MISSES
    return Crossing.CROSSES if s_p * s_q and all(edges) else Crossing.TOUCHES


def segment_distance(p: Vector, q: Vector, a: Vector, b: Vector) -> np.ndarray:
    """The distance of segments pq and ab; either may be a point.

    Notes
    -----
    The minimum of a convex quadratic over a square: unclamped in one parameter, clamped, then the other
    (Ericson, Real-Time Collision Detection, 5.1.9). Law: symmetric in the two segments.
    """
    d1, d2, r = subtract(q, p), subtract(b, a), subtract(p, a)
    len1, len2, mixed = dot(d1, d1), dot(d2, d2), dot(d1, d2)
    to1, to2 = dot(d1, r), dot(d2, r)
    determinant = len1 * len2 - mixed * mixed
    skew = determinant > 8 * UNIT_ROUNDOFF * len1 * len2
    s = np.where(skew, np.clip((mixed * to2 - to1 * len2) / np.where(skew, determinant, 1.0), 0.0, 1.0), 0.0)
    t = np.clip((mixed * s + to2) / np.where(len2 > 0, len2, 1.0), 0.0, 1.0)
    s = np.clip((mixed * t - to1) / np.where(len1 > 0, len1, 1.0), 0.0, 1.0)
    return norm(subtract(along(p, d1, s), along(a, d2, t)))


def segment_triangle_distance(p: Vector, q: Vector, a: Vector, b: Vector, c: Vector) -> np.ndarray:
    """The distance of segment pq and triangle abc; zero where they meet.

    Notes
    -----
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
        height = np.abs(dot(n, subtract(end, a))) / np.where(size > 0, size, 1.0)
        distance = np.where(over, np.minimum(distance, height), distance)
    return np.where(inside(orientations(p, q, a, b, c)), 0.0, distance)
