"""The drive's force or torque by Newton and Euler: joints by circles, nine equations a position, no virtual work."""

from __future__ import annotations

import math
from typing import Any

import numpy as np


def circles(one: Any, r: float, other: Any, s: float, left: bool) -> tuple[float, float]:
    """The point at distance r from one place and s from another, left or right of the line between them."""
    dx, dy = other[0] - one[0], other[1] - one[1]
    d = math.hypot(dx, dy)
    along = (r * r - s * s + d * d) / (2 * d)
    high = math.sqrt(r * r - along * along) * (1 if left else -1)
    return one[0] + (along * dx - high * dy) / d, one[1] + (along * dy + high * dx) / d


class Moving:
    """Joints, angles, angular velocities and accelerations of a four-bar at one crank angle (in the plane)."""

    def __init__(self, links: Any, branch: int, a: Any, b: Any, crank: float) -> None:
        one, two, three, _ = links
        self.a, self.b = a, b
        self.d = (a[0] + one * math.cos(crank), a[1] + one * math.sin(crank))
        self.c = circles(self.d, two, b, three, branch > 0)
        # to the left of D->B for branch +1: `circles` counts left from the first place to the second
        u = (self.c[0] - self.d[0], self.c[1] - self.d[1])
        v = (self.c[0] - b[0], self.c[1] - b[1])
        self.angles = (crank, math.atan2(u[1], u[0]), math.atan2(v[1], v[0]))
        # velocity of C along both links: one' z x (D-A) + w2 z x u = w3 z x v, two linear equations
        e = (self.d[0] - a[0], self.d[1] - a[1])
        matrix = np.array([[-u[1], v[1]], [u[0], -v[0]]])
        self.w = (1.0, *np.linalg.solve(matrix, [e[1], -e[0]]))
        w2, w3 = self.w[1:]
        right = [e[0] + w2 * w2 * u[0] - w3 * w3 * v[0], e[1] + w2 * w2 * u[1] - w3 * w3 * v[1]]
        self.alpha = (0.0, *np.linalg.solve(matrix, right))

    def frame(self, link: str) -> tuple[Any, float, int]:
        """Origin, direction and number of a link's frame."""
        k = ("crank", "coupler", "rocker").index(link)
        return (self.a, self.d, self.b)[k], self.angles[k], k

    def place(self, link: str, point: complex) -> tuple[float, float]:
        origin, angle, _ = self.frame(link)
        x, y, cos, sin = point.real, point.imag, math.cos(angle), math.sin(angle)
        return origin[0] + cos * x - sin * y, origin[1] + sin * x + cos * y

    def acceleration(self, link: str, point: complex) -> tuple[float, float]:
        """Of a point of a link, at unit speed of the crank."""
        origin, _, k = self.frame(link)
        x, y = (one - other for one, other in zip(self.place(link, point), origin))
        w, alpha = self.w[k], self.alpha[k]
        begin = (0.0, 0.0)
        if link == "coupler":
            begin = (-(self.d[0] - self.a[0]), -(self.d[1] - self.a[1]))
        return begin[0] - alpha * y - w * w * x, begin[1] + alpha * x - w * w * y


def drive_force(at: Moving, *loads: Any) -> float:
    """The unknown of the drive at one position, see `equilibrium`."""
    return float(equilibrium(at, *loads)[8])


def equilibrium(
    at: Moving, body: Any, force: Any, torque: float, masses: Any, gravity: Any, speed: float, drive: Any
) -> Any:
    """All nine unknowns at one position: x and y at pivot A, crank pin, coupler pin and pivot B, and the drive's.

    ``body``: the body point in the coupler's frame, ``force`` and ``torque`` on it. ``masses``: (link, amount, point, inertia).
    ``drive``: ("torque", link) at a fixed pivot, or ("rod", link, point, place of its other end): pushing is positive.
    """
    matrix, right = np.zeros((9, 9)), np.zeros(9)
    names = ("crank", "coupler", "rocker")
    origins = {name: at.frame(name)[0] for name in names}

    def load(link: str, place: Any, pull: Any, moment: float = 0.0) -> None:
        row, origin = 3 * names.index(link), origins[link]
        right[row] -= pull[0]
        right[row + 1] -= pull[1]
        right[row + 2] -= (place[0] - origin[0]) * pull[1] - (place[1] - origin[1]) * pull[0] + moment

    def unknown(link: str, place: Any, column: int, sign: float) -> None:
        row, origin = 3 * names.index(link), origins[link]
        matrix[row, column] += sign
        matrix[row + 1, column + 1] += sign
        matrix[row + 2, column] += -sign * (place[1] - origin[1])
        matrix[row + 2, column + 1] += sign * (place[0] - origin[0])

    unknown("crank", at.a, 0, 1.0)
    unknown("crank", at.d, 2, -1.0)
    unknown("coupler", at.d, 2, 1.0)
    unknown("coupler", at.c, 4, 1.0)
    unknown("rocker", at.c, 4, -1.0)
    unknown("rocker", at.b, 6, 1.0)
    load("coupler", at.place("coupler", body), force, torque)
    for link, amount, point, inertia in masses:
        pull = [amount * (g - speed**2 * x) for g, x in zip(gravity, at.acceleration(link, point))]
        load(link, at.place(link, point), pull, -inertia * speed**2 * at.alpha[names.index(link)])
    if drive[0] == "torque":
        matrix[3 * names.index(drive[1]) + 2, 8] = 1.0
    else:
        _, link, point, other = drive
        place = at.place(link, point)
        away = (place[0] - other[0], place[1] - other[1])
        length = math.hypot(*away)
        push = (away[0] / length, away[1] / length)
        row, origin = 3 * names.index(link), origins[link]
        matrix[row, 8], matrix[row + 1, 8] = push
        matrix[row + 2, 8] = (place[0] - origin[0]) * push[1] - (place[1] - origin[1]) * push[0]
    return np.linalg.solve(matrix, right)
