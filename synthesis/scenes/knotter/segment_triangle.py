"""Position and distance of a segment relative to a triangle in space.

A vector is a tuple ``(x, y, z)`` of numbers or arrays that broadcast against each other, so that each function works
on single points and on batches.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from synthesis.one_variable import EPSILON, Flags, Floats
from synthesis.scenes.knotter.mechanism import Vector


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
    return tuple(start + parameter * change for start, change in zip(origin, direction))


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
    """Intersect the line pq with the plane abc (eqs 11 and 26 for any plane); return ``p`` if they are parallel."""
    ab, ac = subtract(b, a), subtract(c, a)
    normal = cross(ab, ac)
    s_p, s_q = dot(normal, subtract(p, a)), dot(normal, subtract(q, a))
    w = s_p - s_q
    return point_on_line(p, subtract(q, p), np.where(w != 0, s_p / safe_divisor(w), 0.0))


def segment_distance(p: Vector, q: Vector, a: Vector, b: Vector) -> Any:
    """Compute the distance between segments pq and ab, which may have length zero.

    The squared distance is a convex quadratic function of the two segment parameters on the unit square.
    It is minimised in the first parameter, clamped to [0, 1], and then in the second (Ericson, Real-Time Collision Detection,
    5.1.9).
    """
    d1, d2, r = subtract(q, p), subtract(b, a), subtract(p, a)
    d1_d1, d2_d2, d1_d2 = dot(d1, d1), dot(d2, d2), dot(d1, d2)
    d1_r, d2_r = dot(d1, r), dot(d2, r)
    determinant = d1_d1 * d2_d2 - d1_d2 * d1_d2
    skew = determinant > 4 * EPSILON * d1_d1 * d2_d2
    s = np.where(skew, np.clip((d1_d2 * d2_r - d1_r * d2_d2) / np.where(skew, determinant, 1.0), 0.0, 1.0), 0.0)
    t = np.clip((d1_d2 * s + d2_r) / safe_divisor(d2_d2), 0.0, 1.0)
    s = np.clip((d1_d2 * t - d1_r) / safe_divisor(d1_d1), 0.0, 1.0)
    return norm(subtract(point_on_line(p, d1, s), point_on_line(a, d2, t)))


def segment_triangle_distance(p: Vector, q: Vector, a: Vector, b: Vector, c: Vector) -> Any:
    """Compute the distance between segment pq and triangle abc, zero if they meet.

    The closest points lie either on the segment and an edge, or on an end of the segment and the triangle's inside.
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
