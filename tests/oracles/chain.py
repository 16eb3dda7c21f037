"""Slow and simple methods for the chain: points of a path and bracketing search, without closed forms.

The module also contains the transfer relations and the list of cases of the source, in any arithmetic. It does not
use the code under test.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq, minimize_scalar


class Path:
    """A closed path of ("arc", cx, cy, r, start, sweep) and ("line", x0, y0, x1, y1), by arc length."""

    def __init__(self, parts):
        self.parts = parts
        lengths = [
            part[3] * abs(part[5]) if part[0] == "arc" else math.hypot(part[3] - part[1], part[4] - part[2])
            for part in parts
        ]
        self.ends = np.cumsum(lengths)
        self.total = float(self.ends[-1])

    def point(self, s):
        s = s % self.total
        index = min(int(np.searchsorted(self.ends, s, side="right")), len(self.parts) - 1)
        t = s - (self.ends[index - 1] if index else 0.0)
        part = self.parts[index]
        if part[0] == "arc":
            _, cx, cy, r, start, sweep = part
            angle = start + math.copysign(t / r, sweep)
            return cx + r * math.cos(angle), cy + r * math.sin(angle)
        _, x0, y0, x1, y1 = part
        length = math.hypot(x1 - x0, y1 - y0)
        return x0 + (x1 - x0) * t / length, y0 + (y1 - y0) * t / length

    def next(self, s, pitch, direction=1, cells=48):
        """Return the first position ahead at a distance of a pitch: bracketed on a grid, then refined by brentq."""
        x, y = self.point(s)

        def excess(u):
            px, py = self.point(s + direction * u)
            return math.hypot(px - x, py - y) - pitch

        # the arc length to the next position is at least a pitch; the search ends after a lap
        u, width = 0.999999 * pitch, pitch / cells
        while u < self.total:
            if excess(u + width) >= 0:
                return s + direction * brentq(excess, u, u + width, xtol=1e-300, rtol=8.9e-16)
            u += width
        raise LookupError("no point")

    def after(self, s, pitch, links, direction=1):
        for _ in range(links):
            s = self.next(s, pitch, direction)
        return s


def crescent(r0, r1, r2, b):
    """Return the path of the crescent from the joint of the upper arc with the left wheel."""
    c, a = r1 + r0, r2 - r0
    cy = (c * c + b * b - a * a) / (2 * b)
    cx = math.sqrt(c * c - cy * cy)
    xi, eps = math.atan2(b - cy, cx), math.atan2(cy, cx)
    return Path(
        [
            ("arc", -cx, cy, r0, -eps, math.pi + xi + eps),
            ("arc", 0.0, b, r2, math.pi + xi, math.pi - 2 * xi),
            ("arc", cx, cy, r0, -xi, math.pi + xi + eps),
            ("arc", 0.0, 0.0, r1, eps, -(math.pi + 2 * eps)),
        ]
    )


def stadium(radius, straight):
    h = straight / 2
    return Path(
        [
            ("arc", h, 0.0, radius, -math.pi / 2, math.pi),
            ("line", h, radius, -h, radius),
            ("arc", -h, 0.0, radius, math.pi / 2, math.pi),
            ("line", -h, -radius, h, -radius),
        ]
    )


def overrun(path, pitch, links, s):
    return path.after(s, pitch, links) - s - path.total


def smallest_overrun(path, pitch, links, period, cells=48):
    """Return the smallest overrun over a period, by a grid and bounded minimisation around its smallest values."""
    grid = np.linspace(0, period, cells + 1)
    values = np.array([overrun(path, pitch, links, s) for s in grid])
    best = values.min()
    for index in np.argsort(values)[:3]:
        low, high = grid[index] - period / cells, grid[index] + period / cells
        found = minimize_scalar(
            lambda s: overrun(path, pitch, links, s), bounds=(low, high), method="bounded", options={"xatol": 1e-6}
        )
        best = min(best, found.fun)
    return float(best)


def free_pin(path, pitch, links, k, s, side_of):
    """Return P_k between P_(k-1) and P_(k+1): the intersection of two circles that is further from the point ``side_of``."""
    a = np.array(path.point(path.after(s, pitch, k - 2)))
    b = np.array(path.point(path.after(s, pitch, links - k, -1)))
    half = (b - a) / 2
    h = math.hypot(*half)
    normal = np.array([-half[1], half[0]]) / h * math.sqrt(pitch * pitch - h * h)
    candidates = [a + half + normal, a + half - normal]
    return max(candidates, key=lambda p: math.hypot(*(p - side_of)))


def rounded_polygon(rng):
    """Return a convex polygon with rounded corners: lines and arcs of equal radius, at a random position."""
    corners = int(rng.integers(3, 8))
    angles = np.sort(rng.uniform(0, 2 * np.pi, corners))
    while np.any(np.diff(np.append(angles, angles[0] + 2 * np.pi)) > 0.9 * np.pi):
        angles = np.sort(rng.uniform(0, 2 * np.pi, corners))
    centres = rng.uniform(-1e3, 1e3, 2) + 300 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    radius = rng.uniform(40, 90)
    parts = []
    edges = np.roll(centres, -1, axis=0) - centres
    headings = np.arctan2(edges[:, 1], edges[:, 0])
    for index, (centre, edge, heading) in enumerate(zip(centres, edges, headings)):
        right = radius * np.array([np.sin(heading), -np.cos(heading)])
        parts.append(("line", *(centre + right), *(centre + right + edge)))
        sweep = (headings[(index + 1) % corners] - heading) % (2 * np.pi)
        parts.append(("arc", *centres[(index + 1) % corners], radius, heading - np.pi / 2, sweep))
    return Path(parts)
