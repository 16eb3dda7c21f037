"""Independent implementation of the lift: textbook poses, 60 digits, the loop equations and a plain search.

The formulas are taken from the source and from textbooks, not from `synthesis.scenes.lift`, which only provides
types and initial guesses.
"""

from __future__ import annotations

import math
from itertools import pairwise

import mpmath
import numpy as np

from synthesis.scenes.lift.motion import Motion, link_angles
from synthesis.scenes.lift.optimum import Task
from synthesis.scenes.lift.pose import Cylinder, Design, turn_at_length

DIGITS = 60
"""Decimal digits of `Exact`."""


# -- single poses ---------------------------------------------------------------------------------------------


def pose(design: Design, turn: float) -> dict[str, float]:
    """Return height, corner B and cylinder length at a turn, with plain inverse cosines."""
    l2, l3, l4, l5, b = design.as_tuple()
    mu = turn - math.pi / 2
    gamma = math.acos((l2**2 + l3**2 - l4**2) / (2 * l2 * l3))
    s = math.sqrt(l5**2 - (l3 * math.cos(mu)) ** 2) - l3 * math.sin(mu)
    x, y = -b + l2 * math.cos(mu - gamma), s + l2 * math.sin(mu - gamma)
    return {"height": s, "length": math.hypot(x, y), "x": x, "y": y}


class Exact:
    """Poses of a design with `DIGITS` digits; velocities by numerical differentiation."""

    def __init__(self, design: Design) -> None:
        self.design = design
        with mpmath.workdps(DIGITS):
            self.l2, self.l3, l4, self.l5, self.b = (mpmath.mpf(value) for value in design.as_tuple())
            self.gamma = mpmath.acos((self.l2**2 + self.l3**2 - l4**2) / (2 * self.l2 * self.l3))

    def height(self, turn):
        return mpmath.sqrt(self.l5**2 - (self.l3 * mpmath.sin(turn)) ** 2) + self.l3 * mpmath.cos(turn)

    def length(self, turn):
        x = self.l2 * mpmath.sin(turn - self.gamma) - self.b
        return mpmath.hypot(x, self.height(turn) - self.l2 * mpmath.cos(turn - self.gamma))

    def height_at_length(self, length):
        with mpmath.workdps(DIGITS):
            return self.height(self.turn_at_length(length))

    def turn_at_length(self, length):
        with mpmath.workdps(DIGITS):
            guess = float(turn_at_length(self.design, float(length)))
            return mpmath.findroot(lambda turn: self.length(turn) - length, guess)

    def turn_at_height(self, height):
        with mpmath.workdps(DIGITS):
            s = mpmath.mpf(height)
            return mpmath.acos((self.l3**2 + s * s - self.l5**2) / (2 * self.l3 * s))

    def gain(self, turn):
        """Return ds/dl1."""
        with mpmath.workdps(DIGITS):
            turn = mpmath.mpf(turn)
            return mpmath.diff(self.height, turn) / mpmath.diff(self.length, turn)

    def motion(self, cylinder: Cylinder, elongation: float) -> tuple[float, float, float]:
        """Return height, velocity and acceleration at a constant speed of the cylinder."""
        with mpmath.workdps(DIGITS):
            turn = self.turn_at_length(mpmath.mpf(cylinder.length) + mpmath.mpf(elongation))
            s1, s2 = mpmath.diff(self.height, turn), mpmath.diff(self.height, turn, 2)
            l1, l2 = mpmath.diff(self.length, turn), mpmath.diff(self.length, turn, 2)
            v = cylinder.speed
            return float(self.height(turn)), float(v * s1 / l1), float(v * v * (s2 * l1 - s1 * l2) / l1**3)


# -- the loops, solved and integrated -------------------------------------------------------------------------


class Loops:
    """The linear systems (13) and (14) of a design, solved numerically."""

    def __init__(self, design: Design) -> None:
        self.design = design
        self.matrix, self.right = np.zeros((6, 6)), np.zeros(6)
        self.matrix[1, 5] = self.matrix[3, 5] = -1.0

    def _fill(self, angles, l1):
        l2, l3, l4, l5, _ = self.design.as_tuple()
        (c1, c2, c3, c4, c5), (s1, s2, s3, s4, s5) = map(math.cos, angles), map(math.sin, angles)
        matrix = self.matrix
        matrix[0, 0] = matrix[4, 0] = -l1 * s1
        matrix[1, 0] = matrix[5, 0] = l1 * c1
        matrix[0, 1], matrix[1, 1] = -l2 * s2, l2 * c2
        matrix[2, 2], matrix[3, 2] = -l3 * s3, l3 * c3
        matrix[4, 3], matrix[5, 3] = -l4 * s4, l4 * c4
        matrix[2, 4], matrix[3, 4] = -l5 * s5, l5 * c5
        matrix[4, 4], matrix[5, 4] = l5 * s5, -l5 * c5
        return (c1, c2, c3, c4, c5), (s1, s2, s3, s4, s5)

    def rates(self, angles, l1, vl):
        """Return the five angular velocities and v_s by (13)."""
        (c1, *_), (s1, *_) = self._fill(angles, l1)
        self.right[:] = -vl * c1, -vl * s1, 0.0, 0.0, -vl * c1, -vl * s1
        return np.linalg.solve(self.matrix, self.right)

    def accelerations(self, angles, rates, l1, vl, al):
        """Return the five angular accelerations and a_s by (14)."""
        l2, l3, l4, l5, _ = self.design.as_tuple()
        (c1, c2, c3, c4, c5), (s1, s2, s3, s4, s5) = self._fill(angles, l1)
        w1 = rates[0]
        w2, w3, w4, w5 = (rate * rate for rate in rates[1:5])
        x = -al * c1 + 2 * w1 * vl * s1 + w1 * w1 * l1 * c1
        y = -al * s1 - 2 * w1 * vl * c1 + w1 * w1 * l1 * s1
        self.right[:] = (
            x + w2 * l2 * c2,
            y + w2 * l2 * s2,
            w3 * l3 * c3 + w5 * l5 * c5,
            w3 * l3 * s3 + w5 * l5 * s5,
            x + w4 * l4 * c4 - w5 * l5 * c5,
            y + w4 * l4 * s4 - w5 * l5 * s5,
        )
        return np.linalg.solve(self.matrix, self.right)

    def condition(self, angles, l1) -> float:
        """Return the condition number of the system, with lengths in units of the top height."""
        self._fill(angles, l1)
        top = self.design.l3 + self.design.l5
        return float(np.linalg.cond(self.matrix / [top, top, top, top, top, 1.0]))


def loop_residuals(design: Design, angles, length, height):
    """Return the residuals of the loop equations (7)-(12), shape (6, n)."""
    l2, l3, l4, l5, b = design.as_tuple()
    first, second, third, fourth, fifth = (
        size * np.exp(1j * angle) for size, angle in zip((length, l2, l3, l4, l5), np.moveaxis(angles, -1, 0))
    )
    loops = (first + second + b - 1j * height, fifth + third - 1j * height, first + fourth + b - fifth)
    return np.concatenate([[loop.real, loop.imag] for loop in loops])


def largest_residual(trajectory: Motion) -> float:
    """Return the largest residual of the loop equations over a motion."""
    pose = trajectory.pose
    residuals = loop_residuals(pose.design, link_angles(pose), trajectory.cylinder_length, pose.height)
    return float(np.max(np.abs(residuals)))


# -- the objective, and a search ------------------------------------------------------------------------------


def moments(design: Design, task: Task, nodes: int = 4000) -> tuple[float, float]:
    """Return variance and mean of the platform speed from textbook poses, with a plain sum; infinite past a dead point."""
    kind, n, drive = task.objective.kind, task.objective.n, task.cylinder
    l2, l3, l4, l5, b = design.as_tuple()
    span = task.high - task.low
    if kind == "discrete":
        heights = task.low + span * np.arange(0 if task.objective.include_start else 1, n + 1) / n
        weights = np.ones(heights.size)
    else:
        # midpoints of uniform steps in a variable that is clustered at both ends, where the speed has a peak or a zero
        u = (np.arange(nodes) + 0.5) / nodes
        heights = task.low + span * u**4 / (u**4 + (1 - u) ** 4)
        weights = (u * (1 - u)) ** 3 / (u**4 + (1 - u) ** 4) ** 2
    # law of cosines in the triangles ADC and ABC; then B, and ds/dl1 from ds/dT and the velocity of B
    cosine = (l3**2 + heights**2 - l5**2) / (2 * l3 * heights)
    turn = np.arccos(np.clip(cosine, -1, 1)) - math.acos((l2**2 + l3**2 - l4**2) / (2 * l2 * l3))
    l3_sine = l3 * np.sqrt(np.maximum(1 - cosine**2, 0.0))
    x, y = l2 * np.sin(turn) - b, heights - l2 * np.cos(turn)
    s1 = -l3_sine * heights / (heights - l3 * cosine)
    length = np.hypot(x, y)
    length_1 = (x * l2 * np.cos(turn) + y * (s1 + l2 * np.sin(turn))) / length
    if not np.all(length_1 < 0):
        return math.inf, math.nan
    travel = length - drive.length
    if drive.speed < 0:
        travel = pose(design, 0.0)["length"] - length
    speed_squared = drive.speed**2 + 2 * drive.acceleration * math.copysign(1, drive.speed) * travel
    if np.any(speed_squared < 0):
        return math.inf, math.nan
    v = np.sqrt(speed_squared) * s1 / length_1
    mean = np.sum(weights * v) / np.sum(weights)
    return float(np.sum(weights * (v - mean) ** 2) / np.sum(weights)), float(mean)


def objective(design: Design, task: Task) -> float:
    """Return the objective; infinite past a dead point."""
    variance, mean = moments(design, task)
    return variance / mean**2 if task.objective.kind == "normalized" and variance < math.inf else variance


def closed_designs(l2: float, l4: float, task: Task) -> list[Design]:
    """Return the designs with given l2 and l4 that satisfy (31)-(33) and l3 <= l2, by bracketing (32) in l3."""
    from scipy.optimize import brentq

    length, low, high = task.cylinder.length, task.low, task.high
    b = math.sqrt((length + l2) ** 2 - low**2)
    psi = math.atan2(b, low)

    def closure(l3):
        gamma = np.arccos(np.clip((l2 * l2 + l3 * l3 - l4 * l4) / (2 * l2 * l3), -1, 1))
        return l3 * l3 + low * low - 2 * low * l3 * np.cos(psi + gamma) - (high - l3) ** 2

    grid = np.linspace(abs(l2 - l4) + 1e-9 * high, min(l2 + l4, l2, 0.5 * high) - 1e-9 * high, 60)
    if grid[0] >= grid[-1]:
        return []
    signs = closure(grid) < 0
    roots = [brentq(closure, grid[k], grid[k + 1], xtol=1e-13 * high) for k in np.nonzero(signs[:-1] != signs[1:])[0]]
    return [Design(l2, l3, l4, high - l3, b) for l3 in roots]


# -- forces and constrained quantities -------------------------------------------------------------------------------------


def equilibrium_forces(trajectory, weight):
    """Return the forces of cylinder, link and slide by the equilibrium of the triangle with the platform, shape (n, 3).

    Moments about A and forces in x and y are balanced, without the derivatives of a `Pose`.
    """
    pose, design = trajectory.pose, trajectory.pose.design
    a = np.stack(np.broadcast_arrays(-design.b, pose.height), axis=-1)
    b = np.stack([pose.x, pose.y], axis=-1)
    c = np.stack([design.l3 * pose.sin_turn - design.b, pose.c_height], axis=-1)
    cylinder_direction = b / np.linalg.norm(b, axis=-1, keepdims=True)
    link_direction = (c - np.array([-design.b, 0.0])) / design.l5
    matrix = np.zeros((len(b), 3, 3))
    matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 0, 2] = cylinder_direction[:, 0], link_direction[:, 0], 1.0
    matrix[:, 1, 0], matrix[:, 1, 1] = cylinder_direction[:, 1], link_direction[:, 1]
    for k, (point, direction) in enumerate(((b, cylinder_direction), (c, link_direction))):
        arm = point - a
        matrix[:, 2, k] = (arm[:, 0] * direction[:, 1] - arm[:, 1] * direction[:, 0]) / design.l2
    right = np.zeros((len(b), 3, 1))
    right[:, 1, 0] = weight
    return np.linalg.solve(matrix, right)[:, :, 0]


def circle_intersection(p, r, q, s, side):
    """Return the point at distances r from p and s from q, to the left of p -> q if ``side`` is 1."""
    d = math.dist(p, q)
    a = (r * r - s * s + d * d) / (2 * d)
    h = math.sqrt(max(r * r - a * a, 0.0))
    ex, ey = (q[0] - p[0]) / d, (q[1] - p[1]) / d
    return p[0] + a * ex - side * h * ey, p[1] + a * ey + side * h * ex


def joint_positions(design: Design, height: float) -> dict[str, tuple[float, float]]:
    """Return the joints at a height of the platform, by intersections of circles."""
    l2, l3, l4, l5, b = design.as_tuple()
    a, d = (-b, height), (-b, 0.0)
    c = circle_intersection(d, l5, a, l3, -1) if height < l3 + l5 else (-b, l5)
    # B is clockwise from C about A
    return {"A": a, "B": circle_intersection(a, l2, c, l4, -1), "C": c, "D": d, "O": (0.0, 0.0)}


def multiply(first, second):
    """Return the product of two power series of four terms, each of shape (4, n)."""
    return np.array([sum(first[i] * second[k - i] for i in range(k + 1)) for k in range(4)])


def square_root(series):
    """Return the square root of a power series."""
    result = np.zeros_like(series)
    result[0] = np.sqrt(series[0])
    for k in range(1, 4):
        remainder = sum((result[i] * result[k - i] for i in range(1, k)), np.zeros_like(result[0]))
        result[k] = (series[k] - remainder) / (2 * result[0])
    return result


def series_of(design: Design, turns):
    """Return height and cylinder length as power series in the turn about each of ``turns``, two arrays of shape
    (4, n).

    The formulas of `pose` are evaluated in the arithmetic of series, so that no derivative is written out.
    """
    l2, l3, l4, l5, b = design.as_tuple()
    gamma = math.acos((l2**2 + l3**2 - l4**2) / (2 * l2 * l3))

    def sine(angle):
        return np.array([np.sin(angle), np.cos(angle), -np.sin(angle) / 2, -np.cos(angle) / 6])

    def constant(value):
        return np.array([np.full(turns.shape, value), *np.zeros((3, *turns.shape))])

    across = l3 * sine(turns)
    s = square_root(constant(l5**2) - multiply(across, across)) + l3 * sine(turns + math.pi / 2)
    x = l2 * sine(turns - gamma) - constant(b)
    y = s - l2 * sine(turns - gamma + math.pi / 2)
    return s, square_root(multiply(x, x) + multiply(y, y))


def constrained_quantities(
    design: Design, closed: float, speed: float, low: float, high: float, poses: int = 2001
) -> dict:
    """Return the constrained quantities of a design at a constant speed of the cylinder.

    The names are defined by `synthesis.scenes.lift.constraints.measured_values`. The joints are found by
    circles at heights that are clustered at both ends. The motion follows from series in the turn, which are
    reverted to series in the cylinder length. The dead point is found in small steps from the start.
    """
    l3, l5, b = design.l3, design.l5, design.b
    u = np.linspace(0.0, 1.0, poses)
    poses_at = [joint_positions(design, float(height)) for height in low + (high - low) * u * u * (3 - 2 * u)]
    length = np.array([math.hypot(*at["B"]) for at in poses_at])
    xy = np.array([[at[name] for name in "ABC"] for at in poses_at])
    assert abs(length[0] - closed) < 1e-6 * closed and np.all(np.diff(length) > 0)
    # B moves perpendicular to its radius from the instant centre, where the line DC meets the height of A
    sines = []
    for at in poses_at:
        (_, ay), (cx, cy), (dx, _) = at["A"], at["C"], at["D"]
        bx, by = at["B"]
        gx, gy = bx - dx - ay / cy * (cx - dx), by - ay
        sines.append(abs(gx * by - gy * bx) / (math.hypot(gx, gy) * math.hypot(bx, by)))
    first = math.acos((l3**2 + low**2 - l5**2) / (2 * l3 * low))
    s, l1 = series_of(design, first * (1 - np.linspace(0.0, 1.0, poses) ** 2))
    turn_series = 1 / l1[1], -l1[2] / l1[1] ** 3, (2 * l1[2] ** 2 - l1[1] * l1[3]) / l1[1] ** 5
    gain = s[1] * turn_series[0]
    second = s[1] * turn_series[1] + s[2] * turn_series[0] ** 2
    third = s[1] * turn_series[2] + 2 * s[2] * turn_series[0] * turn_series[1] + s[3] * turn_series[0] ** 3
    below = [pose(design, first + 1e-4 * k)["length"] for k in range(12_000)]
    dead = next(length_now for length_now, after in pairwise(below) if after > length_now)
    return {
        **design.as_dict(),
        "closed_length": closed,
        "extension": float(length[-1] / closed),
        "dead_point": 1 - dead / closed,
        "acceleration": float(np.abs(2 * second).max() * speed**2),
        "jerk": float(np.abs(6 * third).max() * abs(speed) ** 3),
        "rise_time": float((length[-1] - closed) / abs(speed)),
        "transmission": math.asin(min(1.0, *sines)),
        "force_ratio": float(np.abs(gain).max()),
        "x_min": float(min(xy[:, :, 0].min(), -b)),
        "x_max": float(max(xy[:, :, 0].max(), 0.0)),
        "y_min": float(min(xy[:, :, 1].min(), 0.0)),
        "y_max": float(xy[:, :, 1].max()),
    }
