"""Slow and simple methods for the chain: points of a path and bracketing search, without closed forms.

The module also contains the transfer relations and the list of cases of the source, in any arithmetic. It does not
use the code under test.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq, minimize_scalar


class Path:
    """A closed path of arcs (cx, cy, r, start, sweep), by arc length."""

    def __init__(self, parts):
        self.parts = parts
        self.ends = np.cumsum([radius * abs(sweep) for _, _, radius, _, sweep in parts])
        self.total = float(self.ends[-1])

    def point(self, s):
        s = s % self.total
        index = min(int(np.searchsorted(self.ends, s, side="right")), len(self.parts) - 1)
        t = s - (self.ends[index - 1] if index else 0.0)
        cx, cy, r, start, sweep = self.parts[index]
        angle = start + math.copysign(t / r, sweep)
        return cx + r * math.cos(angle), cy + r * math.sin(angle)

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
            (-cx, cy, r0, -eps, math.pi + xi + eps),
            (0.0, b, r2, math.pi + xi, math.pi - 2 * xi),
            (cx, cy, r0, -xi, math.pi + xi + eps),
            (0.0, 0.0, r1, eps, -(math.pi + 2 * eps)),
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
