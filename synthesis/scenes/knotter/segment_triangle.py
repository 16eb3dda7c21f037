"""Position and distance of a segment relative to a triangle in space.

A vector is a tuple ``(x, y, z)`` of numbers or arrays that broadcast against each other, so that each function works
on single points and on batches.
`orientations` also accepts fractions.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from fractions import Fraction
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.one_variable import Flags, Floats
from synthesis.scenes.knotter.mechanism import Vector

UNIT_ROUNDOFF = 2.0**-53


class DescribedCode(IntEnum):
    """Integer codes that carry a sentence for the user, written ``NAME = code, sentence``."""

    sentence: str

    def __new__(cls, code: int, sentence: str) -> Self:
        """Create the code and attach its sentence."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.sentence = sentence
        return member


class CrossingCase(DescribedCode):
    """Position of a segment relative to a triangle; ``sentence`` describes it to the user."""

    CROSSES = 0, "the segment crosses the triangle's inside"
    MISSES = 1, "the segment crosses the plane outside the triangle"
    TOUCHES = 2, "the segment touches the triangle's edge, a vertex or its plane with one end"
    SAME_SIDE = 3, "both ends lie on one side of the plane"
    PARALLEL = 4, "the segment runs parallel to the plane"
    IN_PLANE = 5, "the segment lies in the plane"
    DEGENERATE = 6, "the triangle has no area"


def subtract(a: Vector, b: Vector) -> Vector:
    """Return ``a - b``."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def dot(a: Vector, b: Vector) -> Any:
    """Return the scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product ``a x b``."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def point_on_line(origin: Vector, direction: Vector, parameter: Floats | float) -> Vector:
    """Return ``origin + parameter * direction``."""
    return (
        origin[0] + parameter * direction[0],
        origin[1] + parameter * direction[1],
        origin[2] + parameter * direction[2],
    )


def norm(a: Vector) -> Any:
    """Return the length of a vector."""
    return np.sqrt(dot(a, a))


def safe_divisor(x: Floats) -> Floats:
    """Replace zeros by 1, so that dividing by the result raises no warning."""
    return np.where(np.not_equal(x, 0), x, 1.0)


def orientations(p: Vector, q: Vector, a: Vector, b: Vector, c: Vector) -> tuple[Any, ...]:
    """Compute the five orientations that decide whether segment pq crosses triangle abc.

    Parameters
    ----------
    p, q : vector
        Ends of the segment.
    a, b, c : vector
        Vertices of the triangle.

    Returns
    -------
    s_p, s_q
        Side of the triangle's plane on which each end lies (length^3).
    u_ab, u_bc, u_ca
        Side of each edge on which the line pq meets the plane, with the sign of ``s_p - s_q`` (length^8).

    Notes
    -----
    The segment crosses the inside of the triangle if and only if ``s_p s_q < 0`` and all three ``u`` have the sign of
    ``s_p``.
    All five are polynomials in the coordinates and therefore have no poles.
    All coordinates are taken relative to ``a``, so that a common offset of all points costs no digits.
    """
    p, q, ab, ac = (subtract(point, a) for point in (p, q, b, c))
    normal = cross(ab, ac)
    s_p, s_q = dot(normal, p), dot(normal, q)
    w = s_p - s_q
    scaled_crossing = tuple(s_p * q_i - s_q * p_i for p_i, q_i in zip(p, q))  # w times the crossing point
    u_ab = dot(cross(normal, ab), scaled_crossing)
    u_bc = dot(cross(normal, subtract(ac, ab)), point_on_line(scaled_crossing, ab, -w))
    u_ca = -dot(cross(normal, ac), scaled_crossing)
    return s_p, s_q, u_ab, u_bc, u_ca


def crosses_inside(signs: Sequence[Floats] | Floats) -> Flags:
    """Check whether the segment crosses the inside of the triangle, given the five `orientations`."""
    s_p, s_q, *edge_sides = signs
    side = np.sign(s_p)
    crosses = side * np.sign(s_q) < 0
    for u in edge_sides:
        crosses = crosses & (side * u > 0)
    return crosses


def crossing_point(p: Vector, q: Vector, a: Vector, b: Vector, c: Vector) -> Vector:
    """Intersect the line pq with the plane abc.

    These are eqs 11 and 26 of the source, generalised to a plane in any position.

    Parameters
    ----------
    p, q : vector
        Two points of the line.
    a, b, c : vector
        Three points of the plane.

    Returns
    -------
    vector
        The intersection, or ``p`` if the line is parallel to the plane.
    """
    ab, ac = subtract(b, a), subtract(c, a)
    normal = cross(ab, ac)
    s_p, s_q = dot(normal, subtract(p, a)), dot(normal, subtract(q, a))
    w = s_p - s_q
    return point_on_line(p, subtract(q, p), np.where(w != 0, s_p / safe_divisor(w), 0.0))


def classify(p: ArrayLike, q: ArrayLike, a: ArrayLike, b: ArrayLike, c: ArrayLike) -> NDArray[np.int8]:
    """Determine exactly how segments pq lie relative to triangles abc.

    Parameters
    ----------
    p, q, a, b, c : array_like, shape (..., 3)
        Ends of the segments and vertices of the triangles.
        They must be finite and broadcast against each other.

    Returns
    -------
    ndarray, shape (...)
        Values of `CrossingCase`, exact for the given doubles.

    Notes
    -----
    This is a filtered predicate (Shewchuk 1997).
    A sign is taken from double precision if it exceeds a bound of its rounding error, and from rational arithmetic
    otherwise.
    """
    points = np.array(np.broadcast_arrays(p, q, a, b, c), float)
    shape = points.shape[1:-1]
    points = points.reshape(5, -1, 3)
    with np.errstate(all="ignore"):
        relative = np.moveaxis(points - points[2], -1, 1)
        signs = np.array(orientations(*relative))
        distance_p, distance_q, _, ab, ac = (norm(point) for point in relative)
        side_bound = 16 * UNIT_ROUNDOFF * ab * ac * np.array([distance_p, distance_q])
        edge_bound = (
            128 * UNIT_ROUNDOFF * (ab * ac) ** 2 * (ab + ac) * (distance_p + ab + ac) * (distance_q + ab + ac)
        )
        # Possibly degenerate triangles, possibly parallel segments and underflow also go to rational arithmetic.
        certain = norm(cross(relative[3], relative[4])) > 16 * UNIT_ROUNDOFF * ab * ac
        certain &= np.abs(signs[0] - signs[1]) > side_bound.sum(axis=0)
        certain &= np.all(np.abs(signs[:2]) > side_bound, axis=0)
        certain &= np.all(np.abs(signs[2:]) > edge_bound + np.finfo(float).tiny, axis=0)
        certain &= np.all(np.isfinite(signs), axis=0)
        crosses = np.where(crosses_inside(signs), CrossingCase.CROSSES, CrossingCase.MISSES)
    same_side = np.sign(signs[0]) == np.sign(signs[1])
    cases = np.where(same_side, CrossingCase.SAME_SIDE, crosses).astype(np.int8)
    for row in np.flatnonzero(~certain):
        cases[row] = _classify_exactly(*([Fraction(float(x)) for x in point] for point in points[:, row]))
    return cases.reshape(shape)


def _classify_exactly(p: Vector, q: Vector, a: Vector, b: Vector, c: Vector) -> CrossingCase:
    if not any(cross(subtract(b, a), subtract(c, a))):
        return CrossingCase.DEGENERATE
    s_p, s_q, *edge_sides = orientations(p, q, a, b, c)
    if s_p == s_q:
        return CrossingCase.PARALLEL if s_p else CrossingCase.IN_PLANE
    if s_p * s_q > 0:
        return CrossingCase.SAME_SIDE
    side = 1 if s_p > s_q else -1
    if any(side * u < 0 for u in edge_sides):
        return CrossingCase.MISSES
    return CrossingCase.CROSSES if s_p * s_q and all(edge_sides) else CrossingCase.TOUCHES


def segment_distance(p: Vector, q: Vector, a: Vector, b: Vector) -> Any:
    """Compute the distance between segments pq and ab.

    Parameters
    ----------
    p, q, a, b : vector
        Ends of the segments; a segment may have length zero.

    Returns
    -------
    ndarray or float
        The distance, which is symmetric in the two segments.

    Notes
    -----
    The squared distance is a convex quadratic function of the two segment parameters on the unit square.
    It is minimised in the first parameter, clamped to [0, 1], and then in the second (Ericson, Real-Time Collision Detection,
    5.1.9).
    """
    d1, d2, r = subtract(q, p), subtract(b, a), subtract(p, a)
    d1_d1, d2_d2, d1_d2 = dot(d1, d1), dot(d2, d2), dot(d1, d2)
    d1_r, d2_r = dot(d1, r), dot(d2, r)
    determinant = d1_d1 * d2_d2 - d1_d2 * d1_d2
    skew = determinant > 8 * UNIT_ROUNDOFF * d1_d1 * d2_d2
    s = np.where(skew, np.clip((d1_d2 * d2_r - d1_r * d2_d2) / np.where(skew, determinant, 1.0), 0.0, 1.0), 0.0)
    t = np.clip((d1_d2 * s + d2_r) / safe_divisor(d2_d2), 0.0, 1.0)
    s = np.clip((d1_d2 * t - d1_r) / safe_divisor(d1_d1), 0.0, 1.0)
    return norm(subtract(point_on_line(p, d1, s), point_on_line(a, d2, t)))


def segment_triangle_distance(p: Vector, q: Vector, a: Vector, b: Vector, c: Vector) -> Any:
    """Compute the distance between segment pq and triangle abc, zero if they meet.

    The closest points lie either on the segment and an edge, or on an end of the segment and the triangle's inside.

    Parameters
    ----------
    p, q : vector
        Ends of the segment.
    a, b, c : vector
        Vertices of the triangle.

    Returns
    -------
    ndarray or float
        The distance.
    """
    distance = np.minimum(
        np.minimum(segment_distance(p, q, a, b), segment_distance(p, q, b, c)), segment_distance(p, q, c, a)
    )
    normal = cross(subtract(b, a), subtract(c, a))
    double_area = norm(normal)
    for end in (p, q):
        projects_inside = np.ones_like(distance, bool)
        for start, stop in ((a, b), (b, c), (c, a)):
            projects_inside &= dot(cross(normal, subtract(stop, start)), subtract(end, start)) > 0
        height = np.abs(dot(normal, subtract(end, a))) / safe_divisor(double_area)
        distance = np.where(projects_inside, np.minimum(distance, height), distance)
    return np.where(crosses_inside(orientations(p, q, a, b, c)), 0.0, distance)
