"""The lift's link angles and loop equations: an independent check of the closed form, and how well posed a pose is.

The five angles are those of the source: theta1 O->B, theta2 B->A, theta3 C->A, theta4 B->C, theta5 D->C, measured
counter-clockwise from +x. Numbers in parentheses are its equations; it is named in `synthesis.lift.pose`, which also
explains the points. All arrays broadcast; the last axis of angles holds theta1 to theta5.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from synthesis.lift.motion import Motion, Stroke
from synthesis.lift.pose import EPSILON, Design, Pose, pose_at_turn, triangle_angle

ANGLE_COUNT = 5
CONDITION_NODES = 33
"""Poses on which the smallest condition number is bracketed, and again at each closer look."""
CONDITION_LOOKS = 4
"""Closer looks; each narrows the bracket by a factor of 16, and the minimum is flat."""
CONDITION_BLOCK = 4096
"""Jacobians that are decomposed at a time: bounds the memory."""


def link_angles(design: Design, pose: Pose) -> np.ndarray:
    """The angles theta1 to theta5, shape (..., 5).

    Continuous along a motion, so that they may pass pi instead of jumping to -pi.
    Law: they close the loops (7)-(12), see `loop_residuals`.
    """
    cos_gamma, sin_gamma, gamma = triangle_angle(design.l2, design.l3, design.l4)
    # from BA to BC, by the same gamma as the pose: a needle of a triangle has no second angle to spare digits for
    at_b = np.arctan2(design.l3 * sin_gamma, design.l3 * cos_gamma - design.l2)
    half = 0.5 * np.pi
    angles = (
        np.pi - np.arctan2(pose.y, -pose.x),
        pose.turn + half - gamma,
        pose.turn + half,
        pose.turn - half - gamma + at_b,
        np.arctan2(pose.root, design.l3 * pose.sin_turn),
    )
    return np.stack(np.broadcast_arrays(*angles), axis=-1)


def angular_velocities(design: Design, pose: Pose, cylinder_speed: Any) -> np.ndarray:
    """The angular velocities of the five links in rad per unit of time, shape (..., 5): the solution of (13).

    Law: the time derivative of `link_angles`; the triangle turns as one (the middle three are equal).
    """
    first, _ = _angle_rates(design, pose)
    return first * (cylinder_speed / pose.length_1)[..., None]


def angular_accelerations(design: Design, pose: Pose, cylinder_speed: Any, cylinder_acceleration: Any) -> np.ndarray:
    """The angular accelerations of the five links in rad per squared unit of time, shape (..., 5): solution of (14).

    Law: the time derivative of `angular_velocities`.
    """
    first, second = _angle_rates(design, pose)
    rate = cylinder_speed / pose.length_1
    rate_change = (cylinder_acceleration - pose.length_2 * rate * rate) / pose.length_1
    return second * (rate * rate)[..., None] + first * rate_change[..., None]


def _angle_rates(design: Design, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """First and second derivatives of the five angles by the turn."""
    square = pose.length * pose.length
    theta1_1 = (pose.x * pose.y_1 - pose.y * pose.x_1) / square
    theta1_2 = (pose.x * pose.y_2 - pose.y * pose.x_2) / square - 2 * theta1_1 * pose.length_1 / pose.length
    level, across = design.l3 * pose.cos_turn, design.l3 * pose.sin_turn
    root = pose.root
    one, zero = np.ones_like(pose.turn), np.zeros_like(pose.turn)
    # root^2 - level^2 = k^2, the difference of squares of DC and AC
    k_squared = (root - np.abs(level)) * (root + np.abs(level))
    first = (theta1_1, one, one, one, -level / root)
    second = (theta1_2, zero, zero, zero, across * k_squared / (root * root * root))
    return (
        np.stack(np.broadcast_arrays(*first), axis=-1),
        np.stack(np.broadcast_arrays(*second), axis=-1),
    )


def loop_residuals(design: Design, angles: Any, length: Any, height: Any) -> np.ndarray:
    """The residuals F1 to F6 of the loops (7)-(12), shape (..., 6), in the lengths' unit."""
    cos, sin = _split(np.cos(angles)), _split(np.sin(angles))
    l1, s = length, height
    l2, l3, l4, l5, b = design.as_tuple()
    rows = (
        l1 * cos[0] + l2 * cos[1] + b,
        l1 * sin[0] + l2 * sin[1] - s,
        l5 * cos[4] + l3 * cos[2],
        l5 * sin[4] + l3 * sin[2] - s,
        l1 * cos[0] + l4 * cos[3] + b - l5 * cos[4],
        l1 * sin[0] + l4 * sin[3] - l5 * sin[4],
    )
    return np.stack(np.broadcast_arrays(*rows), axis=-1)


def jacobian(design: Design, angles: Any, length: Any) -> np.ndarray:
    """The derivatives of F1 to F6 by theta1 to theta5 and s, shape (..., 6, 6): the left side of (13) and (14).

    Law: the limit of differences of `loop_residuals`; singular only where dl1/dT = 0, for its determinant is
    l1 (dl1/dT) l2 l4 sin(theta2 - theta4) l5 sin(theta5) up to sign.
    """
    cos, sin = _split(np.cos(angles)), _split(np.sin(angles))
    l1 = length
    l2, l3, l4, l5, _ = design.as_tuple()
    shape = np.broadcast_shapes(cos[0].shape, *(np.shape(value) for value in (l1, l2, l3, l4, l5)))
    matrix = np.zeros((*shape, 6, 6))
    matrix[..., 0, 0] = matrix[..., 4, 0] = -l1 * sin[0]
    matrix[..., 1, 0] = matrix[..., 5, 0] = l1 * cos[0]
    matrix[..., 0, 1], matrix[..., 1, 1] = -l2 * sin[1], l2 * cos[1]
    matrix[..., 2, 2], matrix[..., 3, 2] = -l3 * sin[2], l3 * cos[2]
    matrix[..., 4, 3], matrix[..., 5, 3] = -l4 * sin[3], l4 * cos[3]
    matrix[..., 2, 4], matrix[..., 3, 4] = -l5 * sin[4], l5 * cos[4]
    matrix[..., 4, 4], matrix[..., 5, 4] = l5 * sin[4], -l5 * cos[4]
    matrix[..., 1, 5] = matrix[..., 3, 5] = -1.0
    return matrix


def rates_from_loops(design: Design, angles: Any, length: Any, cylinder_speed: Any) -> np.ndarray:
    """The five angular velocities and v_s, shape (..., 6): the linear system (13) solved as it stands."""
    cos, sin = np.cos(np.asarray(angles)[..., 0]), np.sin(np.asarray(angles)[..., 0])
    zero = np.zeros_like(cos)
    right = np.asarray(cylinder_speed)[..., None] * np.stack([-cos, -sin, zero, zero, -cos, -sin], axis=-1)
    return np.linalg.solve(jacobian(design, angles, length), right[..., None])[..., 0]


def accelerations_from_loops(
    design: Design, angles: Any, length: Any, rates: Any, cylinder_speed: Any, cylinder_acceleration: Any
) -> np.ndarray:
    """The five angular accelerations and a_s, shape (..., 6): the linear system (14) solved as it stands."""
    cos, sin = _split(np.cos(angles)), _split(np.sin(angles))
    w = _split(np.asarray(rates)[..., :ANGLE_COUNT])
    l1, speed = length, cylinder_speed
    l2, l3, l4, l5, _ = design.as_tuple()
    x = -cylinder_acceleration * cos[0] + 2 * w[0] * speed * sin[0] + w[0] ** 2 * l1 * cos[0]
    y = -cylinder_acceleration * sin[0] - 2 * w[0] * speed * cos[0] + w[0] ** 2 * l1 * sin[0]
    rows = (
        x + w[1] ** 2 * l2 * cos[1],
        y + w[1] ** 2 * l2 * sin[1],
        w[2] ** 2 * l3 * cos[2] + w[4] ** 2 * l5 * cos[4],
        w[2] ** 2 * l3 * sin[2] + w[4] ** 2 * l5 * sin[4],
        x + w[3] ** 2 * l4 * cos[3] - w[4] ** 2 * l5 * cos[4],
        y + w[3] ** 2 * l4 * sin[3] - w[4] ** 2 * l5 * sin[4],
    )
    right = np.stack(np.broadcast_arrays(*rows), axis=-1)
    return np.linalg.solve(jacobian(design, angles, length), right[..., None])[..., 0]


def _split(values: Any) -> tuple[np.ndarray, ...]:
    return tuple(np.moveaxis(np.asarray(values, dtype=float), -1, 0))


def condition(design: Design, turn: Any) -> np.ndarray:
    """2-norm condition number of the Jacobian with all lengths in units of the top height l3 + l5; one design.

    How much a relative error of the loops grows in the rates. It goes to infinity as 1 / distance at the dead point,
    and stays small at the top. It is given up to 1 / epsilon = 4.5e15; beyond, no digit is left anyway.
    Law: it does not change when all lengths are scaled.
    """
    turn = np.asarray(turn, dtype=float)
    top = design.l3 + design.l5
    scaled = Design(*(value / top for value in design.as_tuple()))
    flat = turn.reshape(-1)
    found = np.empty(flat.shape)
    for start in range(0, flat.size, CONDITION_BLOCK):
        pose = pose_at_turn(scaled, flat[start : start + CONDITION_BLOCK])
        values = np.linalg.svd(jacobian(scaled, link_angles(scaled, pose), pose.length), compute_uv=False)
        found[start : start + CONDITION_BLOCK] = values[:, 0] / np.maximum(values[:, -1], EPSILON * values[:, 0])
    return found.reshape(turn.shape)[()]


def smallest_condition(design: Design, limits: Stroke) -> tuple[float, float]:
    """The smallest condition number along a stroke and its turn; deterministic, to about 1e-8."""
    low, high = 0.0, float(limits.turn_bottom)
    for _ in range(1 + CONDITION_LOOKS):
        turns = np.linspace(low, high, CONDITION_NODES)
        values = condition(design, turns)
        at = int(np.argmin(values))
        low, high = turns[max(at - 1, 0)], turns[min(at + 1, turns.size - 1)]
    return float(values[at]), float(turns[at])


def velocity_by_instant_centre(design: Design, cylinder_length_speed: Any, height: Any) -> np.ndarray:
    """Speed of the platform by the instant centre of the triangle, (17)-(27); shape of `height`.

    A second way to the velocity that shares nothing with the derivatives of `pose_at_turn`. It cannot see the sign
    (sin eta >= 0), so it is blind to a dead point that has been passed. Angles come from half-angle forms, not from
    the printed arccos; at the top, where the printed form is 0/0, the limit 0 is returned. NaN where it is singular.
    """
    l2, l3, _, l5, b = design.as_tuple()
    s = np.asarray(height, dtype=float)
    at_top = s >= l3 + l5
    alpha = triangle_angle(s, l5, l3)[2]
    d1 = s * np.tan(np.where(at_top, np.nan, alpha))
    along = s / np.cos(alpha) - l5  # from C to the instant centre G, along DC
    beta = _angle_or_flat(d1, l3, np.abs(along))
    gamma = triangle_angle(l2, l3, design.l4)[2]
    delta = np.where(along < 0, gamma - beta, gamma + beta)  # C above A where DC reaches beyond G
    d2 = np.sqrt((l2 - d1) ** 2 + 4 * l2 * d1 * np.sin(0.5 * delta) ** 2)
    # B from A: delta is measured from AG, which is horizontal
    x, y = b - l2 * np.cos(delta), s - l2 * np.sin(delta)
    eta = _angle_or_flat(d2, np.hypot(x, y), np.hypot(b - d1, s))
    speed = d1 / d2 * cylinder_length_speed
    found = np.divide(speed, np.sin(eta), out=np.full(np.broadcast(speed, eta).shape, np.nan), where=eta > 0)
    return np.where(at_top, 0.0, found)[()]


def _angle_or_flat(side: Any, other: Any, opposite: Any) -> np.ndarray:
    """Angle between two sides of a triangle that may be flat: rounding past flat counts as flat."""
    low = np.maximum((opposite - (side - other)) * (opposite + (side - other)), 0.0)
    high = np.maximum((side + other + opposite) * (side + other - opposite), 0.0)
    return 2 * np.arctan2(np.sqrt(low), np.sqrt(high))


def largest_residual(moved: Motion) -> float:
    """The largest loop residual over a motion, in the lengths' unit."""
    angles = link_angles(moved.design, moved.pose)
    residuals = loop_residuals(moved.design, angles, moved.cylinder_length, moved.pose.height)
    return float(np.max(np.abs(residuals)))
