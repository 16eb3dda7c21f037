"""The lift's figures: tables and pictures of docs/lift.md, and the integration that the closed form replaces.

Run ``python -m benchmarks.lift``; it writes ``benchmarks/results/lift.json``, the pictures ``docs/img/lift_*.png``
and the tables between the markers of ``docs/lift.md``. All searches are deterministic; only run times differ.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from synthesis.lift import motion
from synthesis.lift_loops import link_angles, loop_residuals
from synthesis.lift_pose import Cylinder, Design, pose_at_turn, turn_at_length

INITIAL = Design(300.0, 180.0, 240.0, 330.0, 480.0)
OPTIMUM = Design(351.9, 162.8, 351.9, 347.2, 535.8)
CYLINDER = Cylinder(220.0, 100.0)


def acceleration_equation(design: Design, cylinder: Cylinder) -> Callable[[float, np.ndarray], np.ndarray]:
    """The system (14) as y' = f(t, y), y = (theta1..5, s, omega1..5, v_s): what a stepwise simulation integrates."""
    l2, l3, l4, l5, _ = design.as_tuple()
    matrix, right = np.zeros((6, 6)), np.zeros(6)
    matrix[1, 5] = matrix[3, 5] = -1.0

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        angles, w = y[:5].tolist(), y[6:11].tolist()
        (c1, c2, c3, c4, c5), (s1, s2, s3, s4, s5) = map(math.cos, angles), map(math.sin, angles)
        l1 = cylinder.length + cylinder.speed * t + 0.5 * cylinder.acceleration * t * t
        vl, al = cylinder.speed + cylinder.acceleration * t, cylinder.acceleration
        matrix[0, 0] = matrix[4, 0] = -l1 * s1
        matrix[1, 0] = matrix[5, 0] = l1 * c1
        matrix[0, 1], matrix[1, 1] = -l2 * s2, l2 * c2
        matrix[2, 2], matrix[3, 2] = -l3 * s3, l3 * c3
        matrix[4, 3], matrix[5, 3] = -l4 * s4, l4 * c4
        matrix[2, 4], matrix[3, 4] = -l5 * s5, l5 * c5
        matrix[4, 4], matrix[5, 4] = l5 * s5, -l5 * c5
        x = -al * c1 + 2 * w[0] * vl * s1 + w[0] * w[0] * l1 * c1
        z = -al * s1 - 2 * w[0] * vl * c1 + w[0] * w[0] * l1 * s1
        w2, w3, w4, w5 = (rate * rate for rate in w[1:])
        right[:] = (
            x + w2 * l2 * c2,
            z + w2 * l2 * s2,
            w3 * l3 * c3 + w5 * l5 * c5,
            w3 * l3 * s3 + w5 * l5 * s5,
            x + w4 * l4 * c4 - w5 * l5 * c5,
            z + w4 * l4 * s4 - w5 * l5 * s5,
        )
        return np.concatenate([y[6:], np.linalg.solve(matrix, right)])

    return rates


def start_state(design: Design, cylinder: Cylinder) -> np.ndarray:
    """The exact first state of `acceleration_equation`."""
    from synthesis.lift_loops import angular_velocities

    start = motion(design, cylinder, [0.0])
    return np.concatenate(
        [
            link_angles(design, start.pose)[0],
            start.pose.height,
            angular_velocities(design, start.pose, start.cylinder_speed)[0],
            start.velocity,
        ]
    )


def euler_step(f: Callable, t: float, y: np.ndarray, h: float) -> np.ndarray:
    """One step of Euler's rule."""
    return y + h * f(t, y)


def rk4_step(f: Callable, t: float, y: np.ndarray, h: float) -> np.ndarray:
    """One step of the classical Runge-Kutta rule."""
    a = f(t, y)
    b = f(t + 0.5 * h, y + 0.5 * h * a)
    c = f(t + 0.5 * h, y + 0.5 * h * b)
    return y + h / 6 * (a + 2 * b + 2 * c + f(t + h, y + h * c))


def integrate(
    design: Design, cylinder: Cylinder, step: float, rule: Callable = rk4_step
) -> tuple[np.ndarray, np.ndarray]:
    """Times and states of a fixed-step integration of (14) to the last whole step before the top.

    Ends early, with a last state of NaN, when it has diverged (a singular matrix, or no finite state).
    """
    duration = float(motion(design, cylinder, [0.0]).stroke.duration)
    f = acceleration_equation(design, cylinder)
    y, states, times = start_state(design, cylinder), [], []
    with np.errstate(all="ignore"):
        for k in range(int(duration / step) + 1):
            times.append(k * step)
            states.append(y)
            try:
                y = rule(f, k * step, y, step)
            except (np.linalg.LinAlgError, OverflowError, ValueError):
                y = np.full(y.shape, np.nan)
            if not np.all(np.isfinite(y)):
                times.append((k + 1) * step)
                states.append(np.full(y.shape, np.nan))
                break
    return np.array(times), np.array(states)


def integration_error(
    design: Design, cylinder: Cylinder, times: np.ndarray, states: np.ndarray
) -> tuple[float, float]:
    """Largest error of the height against the closed form, and largest loop residual; NaN where it diverged."""
    if not np.all(np.isfinite(states)):
        return math.nan, math.nan
    length = cylinder.length + cylinder.speed * times + 0.5 * cylinder.acceleration * times**2
    height = pose_at_turn(design, turn_at_length(design, length)).height
    residuals = loop_residuals(design, states[:, :5], length, states[:, 5])
    return float(np.max(np.abs(states[:, 5] - height))), float(np.max(np.abs(residuals)))
