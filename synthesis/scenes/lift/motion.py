"""The pneumatic lift: stroke, rise time, motion and forces of a cylinder-driven lifting linkage, without integration.

Geometry, symbols and source are those of `synthesis.scenes.lift.pose`; numbers in parentheses are the source's equations.
Its loops (7)-(12) are at the end, as an independent check.

Lengths are in the user's unit, angles in radians. What cannot be assembled is NaN in the array functions, and in
`checked_stroke` and `motion`, the functions for one lift, a `FieldError` with the constraint's name and the amount.

Forces: the platform carries a vertical load and a mass on the line of the slide; links and friction are without weight.
By virtual work the cylinder's force is F = P ds/dl1 for a weight P. By Newton's law the triangle with the platform is held
by the cylinder at B, the link at C and the slide at A: three equations for F, the link's force and the slide's. Forces in
newtons, lengths in millimetres, pressures in bar.

The five angles are those of the source: theta1 O->B, theta2 B->A, theta3 C->A, theta4 B->C, theta5 D->C, measured
counter-clockwise from +x. The last axis of angles holds theta1 to theta5.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from synthesis.errors import FieldError
from synthesis.one_variable import EPSILON, Floats, closer_looks
from synthesis.scenes.lift.pose import (
    Cylinder,
    Design,
    Pose,
    angle_or_flat,
    by_blocks,
    dead_point,
    pose_at_turn,
    third_side,
    top_lever,
    triangle_angle,
    turn_at_length,
)

MAX_PROPORTION = 1e6
"""Longest to shortest length of one lift; in more extreme ones rounding moves the joints visibly."""
TIME_ROOM = 1e-12
"""Relative room for a time that is meant to be the very end but was rounded on its way."""
GRAVITY = 9.80665
"""m/s^2."""
BAR = 0.1
"""One bar in N/mm^2."""
CONDITION_NODES = (33,) * 5
"""Poses of each look for the smallest condition number; each look is 16 times closer, and the minimum is flat."""
CONDITION_BLOCK = 4096
"""Jacobians that are decomposed at a time: bounds the memory."""


def refusal(constraint: str, field: str, amount: float, message: str, **facts: float) -> FieldError:
    """The error that names the constraint that fails, the request's field, and by how much."""
    return FieldError(field, message, constraint=constraint, amount=amount, **facts)


def check_speed(cylinder: Cylinder) -> None:
    """Refuse a cylinder that stands still.

    Raises `FieldError`: with ``constraint`` ``speed``.
    """
    if cylinder.speed == 0:
        raise refusal("speed", "/cylinder/speed", 0.0, "the cylinder stands still: its speed must not be 0")


@dataclass(frozen=True)
class Stroke:
    """The stretch of the working branch between the cylinder's shortest length and the top, shape (...) each.

    ``duration`` is the time for it, up or down; NaN where the cylinder stops before the end.
    """

    turn_bottom: Any
    turn_dead: Any
    length_dead: Any
    length_top: Any
    height_bottom: Any
    height_top: Any
    duration: Any


def stroke(design: Design, cylinder: Cylinder) -> Stroke:
    """The strokes of a batch of designs and cylinders; NaN where a lift cannot be assembled or does not work."""
    turn_dead = dead_point(design)
    turn_bottom = turn_at_length(design, cylinder.length, turn_dead)
    length_dead, top = pose_at_turn(design, turn_dead).length, pose_at_turn(design, 0.0)
    bottom = pose_at_turn(design, turn_bottom)
    travel = top.length - cylinder.length
    duration = travel_time(np.where(np.isnan(turn_bottom), np.nan, travel), cylinder.speed, cylinder.acceleration)
    return Stroke(turn_bottom, turn_dead, length_dead, top.length, bottom.height, top.height, duration)


def travel_time(travel: Any, speed: Any, acceleration: Any) -> Any:
    """Time in which the cylinder first covers `travel` >= 0 in the direction of its speed; NaN if it stops before.

    t = 2 e / (|v| + sqrt(v^2 + 2 a e)), with a counted along the speed: no cancellation for small a. A root that is
    zero to rounding counts as zero: the cylinder comes to rest just at the end.

    Law: |v| t + a t^2 / 2 = e.
    """
    travel, speed, acceleration = (np.asarray(value, dtype=float) for value in (travel, speed, acceleration))
    along = acceleration * np.sign(speed)
    square = speed * speed + 2 * along * travel
    square = np.where(np.abs(square) <= 8 * EPSILON * speed * speed, 0.0, square)
    final = np.sqrt(np.where(square >= 0, square, np.nan))
    total = np.abs(speed) + final
    return np.divide(2 * travel, total, out=np.full(total.shape, np.nan), where=total > 0)[()]


@dataclass(frozen=True)
class Motion:
    """A motion of one lift: the stroke, and over `time` the cylinder and the platform."""

    stroke: Stroke
    time: Floats
    cylinder_length: Floats
    cylinder_speed: Floats
    cylinder_acceleration: float
    pose: Pose
    velocity: Floats
    acceleration: Floats


def velocity(pose: Pose, cylinder_speed: Any) -> Any:
    """Velocity of the platform, v_s = v_l s' / l1', the solution of (13)."""
    return cylinder_speed * pose.gain + 0.0  # no negative zero at the top


def acceleration(pose: Pose, cylinder_speed: Any, cylinder_acceleration: Any) -> Any:
    """Acceleration of the platform, the solution of (14).

    a_s = v_l^2 (s'' l1' - s' l1'') / l1'^3 + a_l s' / l1'. Law: the time derivative of `velocity`.
    """
    turn_rate = cylinder_speed / pose.length_1
    return turn_rate * turn_rate * (pose.height_2 - pose.gain * pose.length_2) + cylinder_acceleration * pose.gain


def motion(design: Design, cylinder: Cylinder, times: Any | None = None, samples: int = 201) -> Motion:
    """The motion of one lift, at given times or at `samples` even ones from start to end.

    Rising starts at the cylinder's length, lowering (speed < 0) at the top.

    Raises `FieldError`: with ``constraint`` and ``amount``: see `checked_stroke`; ``time`` for times outside of the
    motion.
    """
    limits = checked_stroke(design, cylinder)
    duration = float(limits.duration)
    times = np.asarray(np.linspace(0.0, duration, samples) if times is None else times, dtype=float)
    _check_times(times, duration)
    shortest, longest = float(cylinder.length), float(limits.length_top)
    start, end = (shortest, longest) if cylinder.speed > 0 else (longest, shortest)
    length = start + times * (cylinder.speed + 0.5 * cylinder.acceleration * times)
    length = np.where(times >= duration * (1 - EPSILON), end, np.clip(length, shortest, longest))
    pose = pose_at_turn(design, turn_at_length(design, length, limits.turn_dead))
    speed, change = cylinder.speed + cylinder.acceleration * times, float(cylinder.acceleration)
    return Motion(
        limits, times, length, speed, change, pose, velocity(pose, speed), acceleration(pose, speed, change)
    )


def _check_times(times: Floats, duration: float) -> None:
    wrong = np.nonzero(~((times >= 0) & (times <= duration * (1 + TIME_ROOM))))[0]
    if wrong.size:
        found = float(times[wrong[0]])
        message = f"the motion lasts from 0 to {duration:.9g}, found {found:.9g}"
        amount = -found if found < 0 else found - duration
        raise refusal("time", f"/times/{wrong[0]}", amount, message, rise_time=duration)


def checked_stroke(design: Design, cylinder: Cylinder) -> Stroke:
    """The stroke of one lift, or the constraint that it fails and by how much.

    Raises `FieldError`: ``constraint`` is one of ``proportion`` (no digits left), ``triangle`` (34), ``l3<l5`` (36),
    ``top_lever`` (the cylinder must shorten to come to the top), ``dead_point`` (length at or below the dead point's:
    no such pose, or none that lifts), ``cylinder_length`` (no pose: longer than at the top), ``speed`` (zero) or
    ``stopping`` (the cylinder comes to rest before the end). ``amount`` >= 0 is by how much, as a length.
    """
    length = float(cylinder.length)
    _check_lengths(design, length)
    check_speed(cylinder)
    limits = stroke(design, cylinder)
    dead, top, lever = float(limits.length_dead), float(limits.length_top), float(top_lever(design))
    if np.isnan(limits.turn_dead):
        message = (
            f"the cylinder would have to shorten to come to the top: the lever b cos(gamma) + (l3 + l5) sin(gamma) "
            f"must be positive, it is {lever:.9g}"
        )
        raise refusal("top_lever", "/design", max(-lever, 0.0), message)
    if not length > dead:
        amount = dead - length
        message = f"no pose that lifts at this length: the dead point is at {dead:.9g}, {amount:.9g} above"
        raise refusal("dead_point", "/cylinder/length", amount, message, dead_point_length=dead)
    travel = top - length
    if not travel > 0:
        message = f"no stroke: the top is at cylinder length {top:.9g}, {-travel:.9g} below"
        raise refusal("cylinder_length", "/cylinder/length", -travel, message, length_top=top)
    if np.isnan(limits.duration):
        reach = float(cylinder.speed) ** 2 / (2 * abs(float(cylinder.acceleration)))
        message = f"the cylinder comes to rest after {reach:.9g} of {travel:.9g}: the stroke is not reached"
        raise refusal("stopping", "/cylinder/acceleration", travel - reach, message)
    return limits


def _check_lengths(design: Design, cylinder_length: float) -> None:
    """Refuse what cannot be assembled in any position."""
    lengths = {**design.as_dict(), "cylinder.length": cylinder_length}
    large, small = max(lengths, key=lengths.__getitem__), min(lengths, key=lengths.__getitem__)
    if not lengths[large] <= MAX_PROPORTION * lengths[small]:
        message = (
            f"{large} = {lengths[large]:.6g} is more than {MAX_PROPORTION:g} times {small} = {lengths[small]:.6g}: "
            "too few digits are left to say where the joints are"
        )
        field = "/cylinder/length" if "cylinder.length" in (large, small) else f"/design/{large}"
        raise refusal("proportion", field, lengths[large] - MAX_PROPORTION * lengths[small], message)
    longest, *others = sorted(("l2", "l3", "l4"), key=lambda name: -lengths[name])
    if np.isnan(triangle_angle(*(lengths[name] for name in ("l2", "l3", "l4")))[2]):
        others.sort()
        excess = (lengths[longest] - lengths[others[0]]) - lengths[others[1]]
        message = (
            f"no triangle ABC: {longest} must be less than {others[0]} + {others[1]}, it is {excess:.9g} too long"
        )
        raise refusal("triangle", "/design", max(excess, 0.0), message)
    excess = lengths["l3"] - lengths["l5"]
    if not excess < 0:
        message = (
            f"the loop of slide and link does not close in every position: l3 must be less than l5, "
            f"it is {excess:.9g} too long"
        )
        raise refusal("l3<l5", "/design", excess, message)


@dataclass(frozen=True)
class Drive:
    """What the cylinder has to carry, and the cylinder: ``load`` in N, ``mass`` in kg, ``bore`` and ``rod`` in mm.

    The mass acts by its weight and by its inertia. ``pressure``: what is available, in bar over the surroundings.
    """

    load: float
    mass: float
    bore: float
    rod: float
    pressure: float


@dataclass(frozen=True)
class Forces:
    """Forces over a motion, shape (n,) each: the cylinder pushes with ``cylinder`` > 0, the link with ``link`` > 0.

    ``slide``: horizontal force of the slide on A. ``weight``: what the platform weighs with its inertia. ``pressure``
    needed, on the bore where the cylinder pushes, on the ring around the rod where it pulls. ``pivot_o`` and ``pivot_d``,
    shape (n, 2): forces of the ground on the cylinder and on the link.
    """

    weight: Floats
    cylinder: Floats
    link: Floats
    slide: Floats
    pressure: Floats
    pivot_o: Floats
    pivot_d: Floats


def forces(moved: Motion, drive: Drive) -> Forces:
    """The forces over a motion.

    Laws: power in is power out, F v_l = P v_s; at the top the cylinder's force is 0 and
    the link carries the weight.
    """
    pose, design = moved.pose, moved.pose.design
    weight = drive.load + drive.mass * (GRAVITY + moved.acceleration / 1000)
    cylinder = weight * pose.gain
    along = np.stack([pose.x, pose.y], axis=-1) / pose.length[:, None]
    link_way = np.stack([design.l3 * pose.sin_turn, pose.root], axis=-1) / design.l5
    # what the cylinder does not carry of the weight the link does; the slide takes the rest
    link = (weight - cylinder * along[:, 1]) / link_way[:, 1]
    slide = -cylinder * along[:, 0] - link * link_way[:, 0]
    push = 0.25 * np.pi * drive.bore**2
    pull = push - 0.25 * np.pi * drive.rod**2
    pressure = np.where(cylinder >= 0, cylinder / push, -cylinder / pull) / BAR
    return Forces(weight, cylinder, link, slide, pressure, cylinder[:, None] * along, link[:, None] * link_way)


def least_bore(found: Forces, drive: Drive) -> float:
    """The bore in mm that just carries the load at the pressure available, with the same rod.

    Law: with it the largest pressure needed is the one available.
    """
    push = max(float(np.max(found.cylinder)), 0.0)
    pull = max(-float(np.min(found.cylinder)), 0.0)
    available = drive.pressure * BAR
    square = max(push / available, pull / available + 0.25 * np.pi * drive.rod**2 if pull > 0 else 0.0)
    return float(np.sqrt(square / (0.25 * np.pi)))


# -- the loop equations -------------------------------------------------------------------------------------------------


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
