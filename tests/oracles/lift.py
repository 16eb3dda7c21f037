"""The pneumatic lift once more: textbook poses, 60 digits, the loops solved and integrated step by step, a plain search.

The formulas here are the source's and the textbook's, not those of `synthesis.scenes.lift`. That is asked for types and first
guesses, for the state in which an integration starts, and for what its end is compared with.
"""

from __future__ import annotations

import math
from itertools import pairwise

import mpmath
import numpy as np

from synthesis.scenes.lift.motion import angular_velocities, link_angles, loop_residuals, motion
from synthesis.scenes.lift.optimum import Task
from synthesis.scenes.lift.pose import Cylinder, Design, pose_at_turn, turn_at_length

DIGITS = 60


# -- one pose at a time ---------------------------------------------------------------------------------------


def pose(design: Design, turn: float) -> dict[str, float]:
    """Height, corner B and cylinder length at one turn, with plain inverse cosines."""
    l2, l3, l4, l5, b = design.as_tuple()
    mu = turn - math.pi / 2
    gamma = math.acos((l2**2 + l3**2 - l4**2) / (2 * l2 * l3))
    s = math.sqrt(l5**2 - (l3 * math.cos(mu)) ** 2) - l3 * math.sin(mu)
    x, y = -b + l2 * math.cos(mu - gamma), s + l2 * math.sin(mu - gamma)
    return {"height": s, "length": math.hypot(x, y), "x": x, "y": y}


def arccos_gain(design: Design, height: float) -> float:
    """v_s / v_l with the direction of AC from a plain arccos of the height, the formula as it comes to mind."""
    l2, l3, l4, l5, b = design.as_tuple()
    turn = math.acos(min(1.0, max(-1.0, (l3**2 + height**2 - l5**2) / (2 * l3 * height))))
    gamma = math.acos((l2**2 + l3**2 - l4**2) / (2 * l2 * l3))
    r = math.sqrt(l5**2 - (l3 * math.sin(turn)) ** 2)
    s1 = -l3 * l3 * math.sin(turn) * math.cos(turn) / r - l3 * math.sin(turn)
    x, y = l2 * math.sin(turn - gamma) - b, height - l2 * math.cos(turn - gamma)
    rate = x * l2 * math.cos(turn - gamma) + y * (s1 + l2 * math.sin(turn - gamma))
    return s1 * math.hypot(x, y) / rate


class Exact:
    """Poses of one design in `DIGITS` digits; rates by differentiating numerically."""

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
        """ds/dl1."""
        with mpmath.workdps(DIGITS):
            turn = mpmath.mpf(turn)
            return mpmath.diff(self.height, turn) / mpmath.diff(self.length, turn)

    def motion(self, cylinder: Cylinder, elongation: float) -> tuple[float, float, float]:
        """Height, velocity and acceleration at a constant speed of the cylinder."""
        with mpmath.workdps(DIGITS):
            turn = self.turn_at_length(mpmath.mpf(cylinder.length) + mpmath.mpf(elongation))
            s1, s2 = mpmath.diff(self.height, turn), mpmath.diff(self.height, turn, 2)
            l1, l2 = mpmath.diff(self.length, turn), mpmath.diff(self.length, turn, 2)
            v = cylinder.speed
            return float(self.height(turn)), float(v * s1 / l1), float(v * v * (s2 * l1 - s1 * l2) / l1**3)


# -- the loops, solved and integrated -------------------------------------------------------------------------


class Loops:
    """The linear systems (13) and (14) of one design, written out and solved as they stand."""

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
        """The five angular velocities and v_s, by (13)."""
        (c1, *_), (s1, *_) = self._fill(angles, l1)
        self.right[:] = -vl * c1, -vl * s1, 0.0, 0.0, -vl * c1, -vl * s1
        return np.linalg.solve(self.matrix, self.right)

    def accelerations(self, angles, rates, l1, vl, al):
        """The five angular accelerations and a_s, by (14)."""
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

    def equation(self, cylinder: Cylinder):
        """(14) as y' = f(t, y), y = (theta1..5, s, omega1..5, v_s): what a stepwise simulation integrates."""

        def derivative(t, y):
            l1 = cylinder.length + cylinder.speed * t + 0.5 * cylinder.acceleration * t * t
            vl = cylinder.speed + cylinder.acceleration * t
            change = self.accelerations(y[:5].tolist(), y[6:11].tolist(), l1, vl, cylinder.acceleration)
            return np.concatenate([y[6:], change])

        return derivative


def start_state(design: Design, cylinder: Cylinder):
    """The exact first state of `Loops.equation`."""
    start = motion(design, cylinder, [0.0])
    rates = angular_velocities(start.pose, start.cylinder_speed)[0]
    return np.concatenate([link_angles(start.pose)[0], start.pose.height, rates, start.velocity])


def euler_step(f, t, y, h):
    """One step of Euler's rule."""
    return y + h * f(t, y)


def rk4_step(f, t, y, h):
    """One step of the classical Runge-Kutta rule."""
    a = f(t, y)
    b = f(t + 0.5 * h, y + 0.5 * h * a)
    c = f(t + 0.5 * h, y + 0.5 * h * b)
    return y + h / 6 * (a + 2 * b + 2 * c + f(t + h, y + h * c))


def integrate(design: Design, cylinder: Cylinder, step: float, rule=rk4_step):
    """Times and states of a fixed-step integration of (14) to the last whole step before the top.

    Ends early, with a last state of NaN, when it has diverged (a singular matrix, or no finite state).
    """
    duration = float(motion(design, cylinder, [0.0]).stroke.duration)
    f, y = Loops(design).equation(cylinder), start_state(design, cylinder)
    states = [y]
    with np.errstate(all="ignore"):
        for k in range(int(duration / step)):
            try:
                y = rule(f, k * step, y, step)
            except (np.linalg.LinAlgError, OverflowError, ValueError):
                y = np.full(y.shape, np.nan)
            if not np.all(np.isfinite(y)):
                states.append(np.full(y.shape, np.nan))
                break
            states.append(y)
    return step * np.arange(len(states)), np.array(states)


def integration_error(design: Design, cylinder: Cylinder, times, states) -> tuple[float, float]:
    """Largest error of the height against the closed form, and largest loop residual; NaN where it diverged."""
    if not np.all(np.isfinite(states)):
        return math.nan, math.nan
    length = cylinder.length + cylinder.speed * times + 0.5 * cylinder.acceleration * times**2
    height = pose_at_turn(design, turn_at_length(design, length)).height
    residuals = loop_residuals(design, states[:, :5], length, states[:, 5])
    return float(np.max(np.abs(states[:, 5] - height))), float(np.max(np.abs(residuals)))


# -- the objective, and a search ------------------------------------------------------------------------------


def moments(design: Design, wanted: Task, nodes: int = 4000) -> tuple[float, float]:
    """Variance and mean of the speed from textbook poses, with a sum in place of Gauss nodes; infinite past a dead point."""
    kind, n, drive = wanted.objective.kind, wanted.objective.n, wanted.cylinder
    l2, l3, l4, l5, b = design.as_tuple()
    span = wanted.high - wanted.low
    if kind == "discrete":
        heights = wanted.low + span * np.arange(0 if wanted.objective.include_start else 1, n + 1) / n
        weights = np.ones(heights.size)
    else:
        # midpoints of even steps in a variable that is graded towards both ends, where the speed has a peak or a root
        u = (np.arange(nodes) + 0.5) / nodes
        heights = wanted.low + span * u**4 / (u**4 + (1 - u) ** 4)
        weights = (u * (1 - u)) ** 3 / (u**4 + (1 - u) ** 4) ** 2
    # cosine rule in the triangles ADC and ABC; then B, and ds/dl1 from ds/dT and the components of B's velocity
    cosine = (l3**2 + heights**2 - l5**2) / (2 * l3 * heights)
    turn = np.arccos(np.clip(cosine, -1, 1)) - math.acos((l2**2 + l3**2 - l4**2) / (2 * l2 * l3))
    l3_sine = l3 * np.sqrt(np.maximum(1 - cosine**2, 0.0))
    x, y = l2 * np.sin(turn) - b, heights - l2 * np.cos(turn)
    s1 = -l3_sine * heights / (heights - l3 * cosine)
    length = np.hypot(x, y)
    length_1 = (x * l2 * np.cos(turn) + y * (s1 + l2 * np.sin(turn))) / length
    if not np.all(length_1 < 0):
        return math.inf, math.nan
    covered = length - drive.length
    if drive.speed < 0:
        covered = pose(design, 0.0)["length"] - length
    square = drive.speed**2 + 2 * drive.acceleration * math.copysign(1, drive.speed) * covered
    if np.any(square < 0):
        return math.inf, math.nan
    v = np.sqrt(square) * s1 / length_1
    mean = np.sum(weights * v) / np.sum(weights)
    return float(np.sum(weights * (v - mean) ** 2) / np.sum(weights)), float(mean)


def objective(design: Design, wanted: Task) -> float:
    """The objective; infinite past a dead point."""
    variance, mean = moments(design, wanted)
    return variance / mean**2 if wanted.objective.kind == "normalized" and variance < math.inf else variance


def closed_designs(l2: float, l4: float, wanted: Task) -> list[Design]:
    """The designs with given l2 and l4 that meet (31)-(33) and l3 <= l2, with (32) solved by bracketing in l3."""
    from scipy.optimize import brentq

    length, low, high = wanted.cylinder.length, wanted.low, wanted.high
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


def search(wanted: Task, polish: bool = False) -> tuple[float, Design]:
    """The least objective and its design, by differential evolution over (l2, l4 / l2) from a fixed seed.

    With `polish`, also along the two edges on which an optimum may lie, l4 = l2 and the longest l2.
    """
    from scipy.optimize import differential_evolution, minimize_scalar

    bound = wanted.upper_bound

    def best(x) -> tuple[float, Design | None]:
        designs = closed_designs(float(x[0]), float(x[0] * x[1]), wanted)
        found = [
            (objective(design, wanted), design)
            for design in designs
            if design.l5 <= bound and design.b <= bound * (1 + 1e-12)
        ]
        return min(found, key=lambda pair: pair[0], default=(1e30, None))

    last = min(bound, math.hypot(bound, wanted.low) - wanted.cylinder.length)
    first = max(wanted.low - wanted.cylinder.length, 0.0) + 1e-6 * wanted.high
    found = differential_evolution(
        lambda x: best(x)[0], [(first, last), (0.02, 1.0)], seed=3, popsize=15, maxiter=40, tol=1e-8
    )
    places = [found.x]
    if polish:
        fine = {"method": "bounded", "options": {"xatol": 1e-9 * last}}
        arm, share = found.x
        edge = minimize_scalar(lambda l2: best((l2, 1.0))[0], bounds=(0.9 * arm, min(1.1 * arm, last)), **fine)
        end = minimize_scalar(lambda x: best((last, x))[0], bounds=(0.9 * share, min(1.1 * share, 1.0)), **fine)
        places += [(edge.x, 1.0), (last, end.x), (last, 1.0)]
    return min((best(place) for place in places), key=lambda pair: pair[0])


# -- forces, and what a design within constraints is like -----------------------------------------------------------------


def newton(moved, weight):
    """Cylinder, link and slide force by the equilibrium of the triangle with the platform, shape (n, 3).

    A second way that shares nothing with the derivatives of a `Pose`: moments about A and forces in x and y.
    """
    pose, design = moved.pose, moved.pose.design
    a = np.stack(np.broadcast_arrays(-design.b, pose.height), axis=-1)
    b = np.stack([pose.x, pose.y], axis=-1)
    c = np.stack([design.l3 * pose.sin_turn - design.b, pose.c_height], axis=-1)
    along = b / np.linalg.norm(b, axis=-1, keepdims=True)
    way = (c - np.array([-design.b, 0.0])) / design.l5
    matrix = np.zeros((len(b), 3, 3))
    matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 0, 2] = along[:, 0], way[:, 0], 1.0
    matrix[:, 1, 0], matrix[:, 1, 1] = along[:, 1], way[:, 1]
    for k, (point, direction) in enumerate(((b, along), (c, way))):
        arm = point - a
        matrix[:, 2, k] = (arm[:, 0] * direction[:, 1] - arm[:, 1] * direction[:, 0]) / design.l2
    right = np.zeros((len(b), 3, 1))
    right[:, 1, 0] = weight
    return np.linalg.solve(matrix, right)[:, :, 0]


def circle_meets(p, r, q, s, side):
    """The point at distances r from p and s from q; ``side`` +1: to the left of p -> q."""
    d = math.dist(p, q)
    a = (r * r - s * s + d * d) / (2 * d)
    h = math.sqrt(max(r * r - a * a, 0.0))
    ex, ey = (q[0] - p[0]) / d, (q[1] - p[1]) / d
    return p[0] + a * ex - side * h * ey, p[1] + a * ey + side * h * ex


def placed(design: Design, height: float) -> dict[str, tuple[float, float]]:
    """The joints at a height of the platform, by circles: C from A and D on the cylinder's side, B from A and C."""
    l2, l3, l4, l5, b = design.as_tuple()
    a, d = (-b, height), (-b, 0.0)
    c = circle_meets(d, l5, a, l3, -1) if height < l3 + l5 else (-b, l5)
    # B is clockwise from C about A
    return {"A": a, "B": circle_meets(a, l2, c, l4, -1), "C": c, "D": d, "O": (0.0, 0.0)}


def multiply(one, two):
    """The product of two power series of four terms, each (4, n)."""
    return np.array([sum(one[i] * two[k - i] for i in range(k + 1)) for k in range(4)])


def root(series):
    """The square root of a power series."""
    found = np.zeros_like(series)
    found[0] = np.sqrt(series[0])
    for k in range(1, 4):
        rest = sum((found[i] * found[k - i] for i in range(1, k)), np.zeros_like(found[0]))
        found[k] = (series[k] - rest) / (2 * found[0])
    return found


def series_of(design: Design, turns):
    """Height and cylinder length as power series in the turn about each of ``turns``: two of (4, n).

    The formulas of `pose`, in arithmetic of series; no derivative is written down.
    """
    l2, l3, l4, l5, b = design.as_tuple()
    gamma = math.acos((l2**2 + l3**2 - l4**2) / (2 * l2 * l3))

    def sine(angle):
        return np.array([np.sin(angle), np.cos(angle), -np.sin(angle) / 2, -np.cos(angle) / 6])

    def whole(value):
        return np.array([np.full(turns.shape, value), *np.zeros((3, *turns.shape))])

    across = l3 * sine(turns)
    s = root(whole(l5**2) - multiply(across, across)) + l3 * sine(turns + math.pi / 2)
    x = l2 * sine(turns - gamma) - whole(b)
    y = s - l2 * sine(turns - gamma + math.pi / 2)
    return s, root(multiply(x, x) + multiply(y, y))


def measures(design: Design, closed: float, speed: float, low: float, high: float, poses: int = 2001) -> dict:
    """What the constraints of `synthesis.scenes.lift.constraints` are about, at a constant speed of the cylinder.

    Joints by circles, at heights that are graded towards both ends. The motion by series in the turn, reverted into
    series in the cylinder's length; the dead point by walking down from the start.
    """
    l3, l5, b = design.l3, design.l5, design.b
    u = np.linspace(0.0, 1.0, poses)
    found = [placed(design, float(height)) for height in low + (high - low) * u * u * (3 - 2 * u)]
    length = np.array([math.hypot(*at["B"]) for at in found])
    xy = np.array([[at[name] for name in "ABC"] for at in found])
    assert abs(length[0] - closed) < 1e-6 * closed and np.all(np.diff(length) > 0)
    # B moves at right angles to its arm from the triangle's instant centre, where D-C meets the level of A
    push = []
    for at in found:
        (_, ay), (cx, cy), (dx, _) = at["A"], at["C"], at["D"]
        bx, by = at["B"]
        gx, gy = bx - dx - ay / cy * (cx - dx), by - ay
        push.append(abs(gx * by - gy * bx) / (math.hypot(gx, gy) * math.hypot(bx, by)))
    first = math.acos((l3**2 + low**2 - l5**2) / (2 * l3 * low))
    s, l1 = series_of(design, first * (1 - np.linspace(0.0, 1.0, poses) ** 2))
    way = 1 / l1[1], -l1[2] / l1[1] ** 3, (2 * l1[2] ** 2 - l1[1] * l1[3]) / l1[1] ** 5
    gain = s[1] * way[0]
    second = s[1] * way[1] + s[2] * way[0] ** 2
    third = s[1] * way[2] + 2 * s[2] * way[0] * way[1] + s[3] * way[0] ** 3
    below = [pose(design, first + 1e-4 * k)["length"] for k in range(12_000)]
    dead = next(one for one, after in pairwise(below) if after > one)
    return {
        **design.as_dict(),
        "closed_length": closed,
        "extension": float(length[-1] / closed),
        "dead_point": 1 - dead / closed,
        "acceleration": float(np.abs(2 * second).max() * speed**2),
        "jerk": float(np.abs(6 * third).max() * abs(speed) ** 3),
        "rise_time": float((length[-1] - closed) / abs(speed)),
        "transmission": math.asin(min(1.0, *push)),
        "force_ratio": float(np.abs(gain).max()),
        "x_min": float(min(xy[:, :, 0].min(), -b)),
        "x_max": float(max(xy[:, :, 0].max(), 0.0)),
        "y_min": float(min(xy[:, :, 1].min(), 0.0)),
        "y_max": float(xy[:, :, 1].max()),
    }
