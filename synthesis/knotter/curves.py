"""Where the rope meets the plane of its triangle, and where the points are, over the bill's angle: curves and not verdicts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from synthesis.knotter.entry import SegmentHitsTriangle
from synthesis.knotter.mechanism import Mechanism, as_array
from synthesis.knotter.segment_triangle import cross, crossing_point, dot, inside, orientations, subtract
from synthesis.one_variable import Flags, Floats


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
