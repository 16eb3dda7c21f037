"""The lift's link angles and loop equations: an independent check of the closed form, and how well posed a pose is.

The five angles are those of the source: theta1 O->B, theta2 B->A, theta3 C->A, theta4 B->C, theta5 D->C, measured
counter-clockwise from +x. Numbers in parentheses are its equations; it is named in `synthesis.lift.pose`, which also
explains the points. All arrays broadcast; the last axis of angles holds theta1 to theta5.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from synthesis.lift.motion import Motion, Stroke
from synthesis.lift.pose import (
    Design,
    Pose,
    angle_or_flat,
    by_blocks,
    pose_at_turn,
    third_side,
    triangle_angle,
)
from synthesis.one_variable import EPSILON, Floats, closer_looks

CONDITION_NODES = (33,) * 5
"""Poses of each look for the smallest condition number; each look is 16 times closer, and the minimum is flat."""
CONDITION_BLOCK = 4096
"""Jacobians that are decomposed at a time: bounds the memory."""


def link_angles(pose: Pose) -> Floats:
    """The angles theta1 to theta5, shape (..., 5).

    Continuous along a motion, so that they may pass pi instead of jumping to -pi.
    Law: they close the loops (7)-(12), see `loop_residuals`.
    """
    form, l3 = pose.form, pose.design.l3
    # from BA to BC, by the same gamma as the pose: a needle of a triangle has no second angle to spare digits for
    at_b = np.arctan2(l3 * form.sin_gamma, l3 * form.cos_gamma - pose.design.l2)
    half = 0.5 * np.pi
    return _together(
        np.pi - np.arctan2(pose.y, -pose.x),
        pose.turn + half - form.gamma,
        pose.turn + half,
        pose.turn - half - form.gamma + at_b,
        np.arctan2(pose.root, l3 * pose.sin_turn),
    )


def angular_velocities(pose: Pose, cylinder_speed: Any) -> Floats:
    """The angular velocities of the five links in rad per unit of time, shape (..., 5): the solution of (13).

    Law: the time derivative of `link_angles`; the triangle turns as one (the middle three are equal).
    """
    first, _ = _angle_rates(pose)
    return np.asarray(first * (cylinder_speed / pose.length_1)[..., None])


def angular_accelerations(pose: Pose, cylinder_speed: Any, cylinder_acceleration: Any) -> Floats:
    """The angular accelerations of the five links in rad per squared unit of time, shape (..., 5): solution of (14).

    Law: the time derivative of `angular_velocities`.
    """
    first, second = _angle_rates(pose)
    rate = cylinder_speed / pose.length_1
    rate_change = (cylinder_acceleration - pose.length_2 * rate * rate) / pose.length_1
    return np.asarray(second * (rate * rate)[..., None] + first * rate_change[..., None])


def _angle_rates(pose: Pose) -> tuple[Floats, Floats]:
    """First and second derivatives of the five angles by the turn."""
    # B moves by (down, height' + across), and that changes by (-across, height'' + down)
    y_1, y_2 = pose.height_1 + pose.across, pose.height_2 + pose.down
    square = pose.length * pose.length
    theta1_1 = (pose.x * y_1 - pose.y * pose.down) / square
    theta1_2 = (pose.x * y_2 + pose.y * pose.across) / square - 2 * theta1_1 * pose.length_1 / pose.length
    level, root = pose.design.l3 * pose.cos_turn, pose.root
    # root^2 - level^2 = k^2, the difference of squares of DC and AC
    k_squared = (root - np.abs(level)) * (root + np.abs(level))
    theta5_2 = pose.design.l3 * pose.sin_turn * k_squared / (root * root * root)
    return _together(theta1_1, 1.0, 1.0, 1.0, -level / root), _together(theta1_2, 0.0, 0.0, 0.0, theta5_2)


def _together(*values: Any) -> Floats:
    return np.stack(np.broadcast_arrays(*values), axis=-1)


def _cosines_sines(angles: Any) -> tuple[Floats, Floats]:
    """Cosines and sines with the links on the first axis."""
    angles = np.moveaxis(np.asarray(angles, dtype=float), -1, 0)
    return np.cos(angles), np.sin(angles)


def loop_residuals(design: Design, angles: Any, length: Any, height: Any) -> Floats:
    """The residuals F1 to F6 of the loops (7)-(12), shape (..., 6), in the lengths' unit."""
    cos, sin = _cosines_sines(angles)
    l2, l3, l4, l5, b = design.as_tuple()
    return _together(
        length * cos[0] + l2 * cos[1] + b,
        length * sin[0] + l2 * sin[1] - height,
        l5 * cos[4] + l3 * cos[2],
        l5 * sin[4] + l3 * sin[2] - height,
        length * cos[0] + l4 * cos[3] + b - l5 * cos[4],
        length * sin[0] + l4 * sin[3] - l5 * sin[4],
    )


def largest_residual(moved: Motion) -> float:
    """The largest loop residual over a motion, in the lengths' unit."""
    pose = moved.pose
    return float(np.max(np.abs(loop_residuals(pose.design, link_angles(pose), moved.cylinder_length, pose.height))))


def jacobian(design: Design, angles: Any, length: Any) -> Floats:
    """The derivatives of F1 to F6 by theta1 to theta5 and s, shape (..., 6, 6): the left side of (13) and (14).

    Law: the limit of differences of `loop_residuals`; singular only where dl1/dT = 0, for its determinant is
    l1 (dl1/dT) l2 l4 sin(theta2 - theta4) l5 sin(theta5) up to sign.
    """
    cos, sin = _cosines_sines(angles)
    l2, l3, l4, l5, _ = design.as_tuple()
    shape = np.broadcast_shapes(cos[0].shape, *(np.shape(value) for value in (length, l2, l3, l4, l5)))
    matrix = np.zeros((*shape, 6, 6))
    matrix[..., 0, 0] = matrix[..., 4, 0] = -length * sin[0]
    matrix[..., 1, 0] = matrix[..., 5, 0] = length * cos[0]
    matrix[..., 0, 1], matrix[..., 1, 1] = -l2 * sin[1], l2 * cos[1]
    matrix[..., 2, 2], matrix[..., 3, 2] = -l3 * sin[2], l3 * cos[2]
    matrix[..., 4, 3], matrix[..., 5, 3] = -l4 * sin[3], l4 * cos[3]
    matrix[..., 2, 4], matrix[..., 3, 4] = -l5 * sin[4], l5 * cos[4]
    matrix[..., 4, 4], matrix[..., 5, 4] = l5 * sin[4], -l5 * cos[4]
    matrix[..., 1, 5] = matrix[..., 3, 5] = -1.0
    return matrix


def condition(design: Design, turn: Any) -> Any:
    """2-norm condition number of the Jacobian with all lengths in units of the top height l3 + l5; one design.

    How much a relative error of the loops grows in the rates. It goes to infinity as 1 / distance at the dead point,
    and stays small at the top. It is given up to 1 / epsilon = 4.5e15; beyond, no digit is left anyway.
    Law: it does not change when all lengths are scaled.
    """
    top = design.l3 + design.l5
    scaled = Design(*(value / top for value in design.as_tuple()))

    def of_block(turns: Floats) -> Any:
        pose = pose_at_turn(scaled, turns)
        values = np.linalg.svd(jacobian(scaled, link_angles(pose), pose.length), compute_uv=False)
        return values[:, 0] / np.maximum(values[:, -1], EPSILON * values[:, 0])

    return by_blocks(of_block, CONDITION_BLOCK, turn)


def smallest_condition(design: Design, limits: Stroke) -> tuple[float, float]:
    """The smallest condition number along a stroke and its turn; deterministic, to about 1e-8."""
    ends = np.zeros(1), np.array([float(limits.turn_bottom)])
    value, turn = closer_looks(lambda turns: np.asarray(condition(design, turns)), *ends, CONDITION_NODES)
    return float(value[0]), float(turn[0])


def velocity_by_instant_centre(design: Design, cylinder_speed: Any, height: Any) -> Any:
    """Speed of the platform by the instant centre of the triangle, (17)-(27); shape of `height`.

    A second way to the velocity that shares nothing with the derivatives of a `Pose`. It cannot see the sign
    (sin eta >= 0), so it is blind to a dead point that has been passed. Angles come from half-angle forms, not from
    the printed arccos; at the top, where the printed form is 0/0, the limit 0 is returned. NaN where it is singular.
    """
    l2, l3, l4, l5, b = design.as_tuple()
    s = np.asarray(height, dtype=float)
    at_top = s >= l3 + l5
    alpha = triangle_angle(s, l5, l3)[2]
    d1 = s * np.tan(np.where(at_top, np.nan, alpha))
    along = s / np.cos(alpha) - l5  # from C to the instant centre G, along DC
    beta, gamma = angle_or_flat(d1, l3, np.abs(along)), triangle_angle(l2, l3, l4)[2]
    delta = np.where(along < 0, gamma - beta, gamma + beta)  # C above A where DC reaches beyond G
    d2 = third_side(l2, d1, delta)
    # B from A: delta is measured from AG, which is horizontal
    x, y = b - l2 * np.cos(delta), s - l2 * np.sin(delta)
    eta = angle_or_flat(d2, np.hypot(x, y), np.hypot(b - d1, s))
    speed = d1 / d2 * cylinder_speed
    found = np.divide(speed, np.sin(eta), out=np.full(np.broadcast(speed, eta).shape, np.nan), where=eta > 0)
    return np.where(at_top, 0.0, found)[()]
