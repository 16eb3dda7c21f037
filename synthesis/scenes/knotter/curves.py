"""Curves of a single mechanism over the driver angle: crossings of the rope with a triangle's plane, and paths of points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from synthesis.one_variable import Flags, Floats
from synthesis.scenes.knotter.conditions import SegmentEntersTriangle
from synthesis.scenes.knotter.mechanism import Mechanism, as_array
from synthesis.scenes.knotter.segment_triangle import (
    cross,
    crosses_inside,
    crossing_point,
    dot,
    orientations,
    subtract,
)


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
    """Compute the crossing of the rope's line with the plane of a triangle over the driver angle.

    A crossing inside the triangle is always on the rope.
    If the rope is inside at a driver angle, the exact entry lies at or before that angle.

    Parameters
    ----------
    mechanism : Mechanism
        A single mechanism.
    condition : SegmentEntersTriangle
        The condition that names the rope's ends and the triangle.
    driver : ndarray, shape (n,)
        Driver angles, rad.

    Returns
    -------
    CrossingCurve
        The crossings (eqs 11 and 26 of the source).
    """
    p, q, *corners = condition.positions(mechanism, driver)
    a, b, c = corners
    normal = cross(subtract(b, a), subtract(c, a))
    s_p, s_q = (np.broadcast_to(dot(normal, subtract(end, a)), driver.shape) for end in (p, q))
    point = as_array(crossing_point(p, q, a, b, c), driver.shape).T
    point = np.where((s_p != s_q)[:, None], point, np.nan)
    crosses = np.broadcast_to(crosses_inside(orientations(p, q, a, b, c)), driver.shape)
    triangle = np.stack([as_array(corner, driver.shape).T for corner in corners])
    return CrossingCurve(point, s_p * s_q < 0, crosses, triangle)


def point_paths(mechanism: Mechanism, names: list[str], frame: str, driver: Floats) -> dict[str, Floats]:
    """Compute the paths of points in a frame.

    Parameters
    ----------
    mechanism : Mechanism
        A single mechanism.
    names : list of str
        Names of the points.
    frame : str
        Name of the frame.
    driver : ndarray, shape (n,)
        Driver angles, rad.

    Returns
    -------
    dict
        Path of each point, shape (n, 3).
    """
    return {name: as_array(mechanism.position(name, frame, driver), driver.shape).T for name in names}
