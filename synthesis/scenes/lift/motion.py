"""Stroke, motion and forces of the pneumatic lift in closed form, without integration.

Geometry, symbols and source are the same as in `synthesis.scenes.lift.pose`; numbers in parentheses are equations of
the source. Lengths are in the user's unit and angles in radians. Array functions return NaN if a lift cannot be
assembled. The functions for a single lift, `checked_stroke` and `motion`, raise a `FieldError` instead, with the name of
the violated constraint and the amount of the violation.

Forces: the platform carries a vertical load and a mass on the line of the slide. Links have no mass and joints have
no friction. By virtual work, the cylinder force is F = P ds/dl1 for a weight P. By Newton's law, the triangle with
the platform is held by the cylinder at B, the link at C and the slide at A, which gives three equations for the
three forces. Forces are in newtons, lengths in millimetres and pressures in bar.

The five angles are defined as in the source: theta1 O->B, theta2 B->A, theta3 C->A, theta4 B->C, theta5 D->C,
measured counter-clockwise from +x. The last axis of an array of angles contains theta1 to theta5.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from synthesis.errors import FieldError
from synthesis.one_variable import EPSILON, Floats
from synthesis.scenes.lift.pose import (
    Cylinder,
    Design,
    Pose,
    dead_point,
    pose_at_turn,
    top_lever,
    triangle_angle,
    turn_at_length,
)


@dataclass(frozen=True)
class MotionOptions:
    """Tolerances of motions."""

    max_length_ratio: float = 1e6
    """Largest ratio of two lengths of one lift; beyond it, rounding moves the joints visibly."""
    time_tolerance: float = 1e-12
    """Relative amount by which a time may exceed the duration because of rounding."""


OPTIONS = MotionOptions()

GRAVITY = 9.80665
"""Acceleration of gravity, m/s^2."""
BAR = 0.1
"""One bar in N/mm^2."""


def constraint_error(constraint: str, field: str, amount: float, message: str, **facts: float) -> FieldError:
    """Build the error that names the violated constraint, the field of the request, and the amount of the violation."""
    return FieldError(field, message, constraint=constraint, amount=amount, **facts)


def check_speed(cylinder: Cylinder) -> None:
    """Raise a `FieldError` with ``constraint`` ``speed`` if the cylinder does not move."""
    if cylinder.speed == 0:
        raise constraint_error(
            "speed", "/cylinder/speed", 0.0, "the speed must not be 0: the cylinder would not move"
        )


@dataclass(frozen=True)
class Stroke:
    """The part of the working branch between the shortest cylinder length and the top; fields of shape (...)."""

    turn_bottom: Any
    """Turn at the shortest cylinder length."""
    turn_dead: Any
    """Turn at the dead point."""
    length_dead: Any
    """Cylinder length at the dead point."""
    length_top: Any
    """Cylinder length at the top."""
    height_bottom: Any
    """Height of the platform at the shortest cylinder length."""
    height_top: Any
    """Height of the platform at the top."""
    duration: Any
    """Time of the stroke, up or down; NaN if the cylinder stops before the end."""


def stroke(design: Design, cylinder: Cylinder) -> Stroke:
    """Compute the strokes of designs and cylinders, whose fields broadcast; NaN if the length is not on the working branch."""
    turn_dead = dead_point(design)
    turn_bottom = turn_at_length(design, cylinder.length, turn_dead)
    length_dead, top = pose_at_turn(design, turn_dead).length, pose_at_turn(design, 0.0)
    bottom = pose_at_turn(design, turn_bottom)
    travel = top.length - cylinder.length
    duration = travel_time(np.where(np.isnan(turn_bottom), np.nan, travel), cylinder.speed, cylinder.acceleration)
    return Stroke(turn_bottom, turn_dead, length_dead, top.length, bottom.height, top.height, duration)


def travel_time(travel: Any, speed: Any, acceleration: Any) -> Any:
    """Return the time in which the cylinder first covers a distance e >= 0 in the direction of its speed; NaN if it stops.

    t = 2 e / (|v| + sqrt(v^2 + 2 a e)), with a positive along the speed, solves |v| t + a t^2 / 2 = e without
    cancellation for small a. A square root that is zero up to rounding counts as zero: the cylinder then comes to
    rest exactly at the end.
    """
    travel, speed, acceleration = (np.asarray(value, dtype=float) for value in (travel, speed, acceleration))
    signed_acceleration = acceleration * np.sign(speed)
    final_speed_squared = speed * speed + 2 * signed_acceleration * travel
    final_speed_squared = np.where(
        np.abs(final_speed_squared) <= 8 * EPSILON * speed * speed, 0.0, final_speed_squared
    )
    final_speed = np.sqrt(np.where(final_speed_squared >= 0, final_speed_squared, np.nan))
    speed_sum = np.abs(speed) + final_speed
    return np.divide(2 * travel, speed_sum, out=np.full(speed_sum.shape, np.nan), where=speed_sum > 0)[()]


@dataclass(frozen=True)
class Motion:
    """Motion of one lift over time; arrays have the shape of ``time``."""

    stroke: Stroke
    """Stroke of the lift."""
    time: Floats
    """Time since the start."""
    cylinder_length: Floats
    """Length of the cylinder."""
    cylinder_speed: Floats
    """Rate of change of the cylinder length."""
    cylinder_acceleration: float
    """Constant acceleration of the cylinder length."""
    pose: Pose
    """Pose at each time."""
    velocity: Floats
    """Velocity of the platform, positive upwards."""
    acceleration: Floats
    """Acceleration of the platform, positive upwards."""


def velocity(pose: Pose, cylinder_speed: Any) -> Any:
    """Return the platform velocity v_s = v_l s' / l1', the solution of (13)."""
    return cylinder_speed * pose.gain + 0.0  # no negative zero at the top


def acceleration(pose: Pose, cylinder_speed: Any, cylinder_acceleration: Any) -> Any:
    """Return the platform acceleration a_s = v_l^2 (s'' l1' - s' l1'') / l1'^3 + a_l s' / l1', the solution of (14).

    It is the time derivative of `velocity`.
    """
    turn_rate = cylinder_speed / pose.length_1
    return turn_rate * turn_rate * (pose.height_2 - pose.gain * pose.length_2) + cylinder_acceleration * pose.gain


def motion(design: Design, cylinder: Cylinder, times: Any | None = None, samples: int = 201) -> Motion:
    """Compute the motion of one lift.

    Parameters
    ----------
    design : Design
        A single design.
    cylinder : Cylinder
        With a positive speed the motion starts at the cylinder's length, with a negative speed at the top.
    times : array_like, optional
        Times since the start. By default, `samples` evenly spaced times from start to end.
    samples : int
        Number of times, if `times` is not given.

    Raises
    ------
    FieldError
        See `checked_stroke`. The constraint is ``time`` if a time lies outside the motion.
    """
    stroke_range = checked_stroke(design, cylinder)
    duration = float(stroke_range.duration)
    times = np.asarray(np.linspace(0.0, duration, samples) if times is None else times, dtype=float)
    _check_times(times, duration)
    shortest, longest = float(cylinder.length), float(stroke_range.length_top)
    start, end = (shortest, longest) if cylinder.speed > 0 else (longest, shortest)
    length = start + times * (cylinder.speed + 0.5 * cylinder.acceleration * times)
    length = np.where(times >= duration * (1 - EPSILON), end, np.clip(length, shortest, longest))
    pose = pose_at_turn(design, turn_at_length(design, length, stroke_range.turn_dead))
    speed, cylinder_acceleration = cylinder.speed + cylinder.acceleration * times, float(cylinder.acceleration)
    return Motion(
        stroke_range,
        times,
        length,
        speed,
        cylinder_acceleration,
        pose,
        velocity(pose, speed),
        acceleration(pose, speed, cylinder_acceleration),
    )


def _check_times(times: Floats, duration: float) -> None:
    outside = np.nonzero(~((times >= 0) & (times <= duration * (1 + OPTIONS.time_tolerance))))[0]
    if outside.size:
        time = float(times[outside[0]])
        message = f"the time must lie within the motion, from 0 to {duration:.9g}; found {time:.9g}"
        amount = -time if time < 0 else time - duration
        raise constraint_error("time", f"/times/{outside[0]}", amount, message, rise_time=duration)


def checked_stroke(design: Design, cylinder: Cylinder) -> Stroke:
    """Compute the stroke of one lift, or raise an error that names the violated constraint.

    Raises
    ------
    FieldError
        ``amount`` >= 0 is the size of the violation, as a length. ``constraint`` is one of

        * ``proportion``: the ratio of two lengths is too large for an accurate result;
        * ``triangle``: the sides do not form a triangle (34);
        * ``l3<l5``: the link is too short (36);
        * ``top_lever``: the cylinder would have to shorten to reach the top;
        * ``dead_point``: the cylinder length is not above the length at the dead point;
        * ``cylinder_length``: the cylinder is longer than at the top;
        * ``speed``: the speed is zero;
        * ``stopping``: the cylinder comes to rest before the end.
    """
    length = float(cylinder.length)
    _check_lengths(design, length)
    check_speed(cylinder)
    stroke_range = stroke(design, cylinder)
    dead, top, lever = float(stroke_range.length_dead), float(stroke_range.length_top), float(top_lever(design))
    travel = top - length
    if np.isnan(stroke_range.turn_dead):
        message = (
            f"the cylinder would have to shorten to reach the top: the lever b cos(gamma) + (l3 + l5) sin(gamma) "
            f"must be positive (it is {lever:.9g})"
        )
        raise constraint_error("top_lever", "/design", max(-lever, 0.0), message)
    if not length > dead:
        message = (
            f"the lift cannot start at this length: the cylinder must be longer than at the dead point, {dead:.9g}; "
            f"increase the length by more than {dead - length:.9g}"
        )
        raise constraint_error("dead_point", "/cylinder/length", dead - length, message, dead_point_length=dead)
    if not travel > 0:
        message = (
            f"there is no stroke: the cylinder must be shorter than at the top, {top:.9g}; "
            f"reduce the length by more than {-travel:.9g}"
        )
        raise constraint_error("cylinder_length", "/cylinder/length", -travel, message, length_top=top)
    if np.isnan(stroke_range.duration):
        reach = float(cylinder.speed) ** 2 / (2 * abs(float(cylinder.acceleration)))
        message = (
            f"the cylinder comes to rest after {reach:.9g} of the {travel:.9g} to the top; "
            "reduce the deceleration or increase the speed"
        )
        raise constraint_error("stopping", "/cylinder/acceleration", travel - reach, message)
    return stroke_range


def _check_lengths(design: Design, cylinder_length: float) -> None:
    """Raise a `FieldError` for lengths that cannot be assembled in any position."""
    lengths = {**design.as_dict(), "cylinder.length": cylinder_length}
    longest_name, shortest_name = max(lengths, key=lengths.__getitem__), min(lengths, key=lengths.__getitem__)
    longest_length, allowed = lengths[longest_name], OPTIONS.max_length_ratio * lengths[shortest_name]
    if not longest_length <= allowed:
        message = (
            f"{longest_name} = {longest_length:.6g} is more than {OPTIONS.max_length_ratio:g} times "
            f"{shortest_name} = {lengths[shortest_name]:.6g}: the joints cannot be computed accurately"
        )
        is_cylinder = "cylinder.length" in (longest_name, shortest_name)
        field = "/cylinder/length" if is_cylinder else f"/design/{longest_name}"
        raise constraint_error("proportion", field, longest_length - allowed, message)
    longest, *shorter = sorted(("l2", "l3", "l4"), key=lambda name: -lengths[name])
    if np.isnan(triangle_angle(design.l2, design.l3, design.l4)):
        shorter.sort()
        excess = (lengths[longest] - lengths[shorter[0]]) - lengths[shorter[1]]
        message = (
            f"the sides do not form a triangle ABC: {longest} must be less than {shorter[0]} + {shorter[1]}, "
            f"and it is {excess:.9g} too long"
        )
        raise constraint_error("triangle", "/design", max(excess, 0.0), message)
    excess = lengths["l3"] - lengths["l5"]
    if not excess < 0:
        message = (
            f"the loop of slide and link does not close in every position: l3 must be less than l5, "
            f"and it is {excess:.9g} too long"
        )
        raise constraint_error("l3<l5", "/design", excess, message)


@dataclass(frozen=True)
class Pneumatics:
    """Load on the platform and size of the cylinder."""

    load: float
    """Vertical load on the platform, N."""
    mass: float
    """Mass on the platform in kg, which acts by its weight and its inertia."""
    bore: float
    """Diameter of the piston, mm."""
    rod: float
    """Diameter of the piston rod, mm."""
    pressure: float
    """Available gauge pressure, bar."""


@dataclass(frozen=True)
class Forces:
    """Forces and pressure over a motion, shape (n,) unless stated otherwise."""

    weight: Floats
    """Weight of load and mass plus the inertia force of the mass, N."""
    cylinder: Floats
    """Force of the cylinder, positive if it pushes."""
    link: Floats
    """Force of the link, positive if it pushes."""
    slide: Floats
    """Horizontal force of the slide on A."""
    pressure: Floats
    """Required pressure in bar: on the piston area if the cylinder pushes, on the annular area if it pulls."""
    pivot_o: Floats
    """Force of the ground on the cylinder, shape (n, 2)."""
    pivot_d: Floats
    """Force of the ground on the link, shape (n, 2)."""


def forces(trajectory: Motion, pneumatics: Pneumatics) -> Forces:
    """Compute the forces over a motion.

    The power of the cylinder equals the power of the platform, F v_l = P v_s. At the top the cylinder force is 0 and the
    link carries the weight.
    """
    pose, design = trajectory.pose, trajectory.pose.design
    weight = pneumatics.load + pneumatics.mass * (GRAVITY + trajectory.acceleration / 1000)
    cylinder = weight * pose.gain
    cylinder_direction = np.stack([pose.x, pose.y], axis=-1) / pose.length[:, None]
    link_direction = np.stack([design.l3 * pose.sin_turn, pose.c_height], axis=-1) / design.l5
    # the link carries the remaining weight, and the slide balances the horizontal forces
    link = (weight - cylinder * cylinder_direction[:, 1]) / link_direction[:, 1]
    slide = -cylinder * cylinder_direction[:, 0] - link * link_direction[:, 0]
    piston_area = 0.25 * np.pi * pneumatics.bore**2
    ring_area = piston_area - 0.25 * np.pi * pneumatics.rod**2
    pressure = np.where(cylinder >= 0, cylinder / piston_area, -cylinder / ring_area) / BAR
    return Forces(
        weight,
        cylinder,
        link,
        slide,
        pressure,
        cylinder[:, None] * cylinder_direction,
        link[:, None] * link_direction,
    )


def minimum_bore(force_history: Forces, pneumatics: Pneumatics) -> float:
    """Return the smallest piston diameter (mm) that carries the load at the available pressure; the bore is not used."""
    largest_push = max(float(np.max(force_history.cylinder)), 0.0)
    largest_pull = max(-float(np.min(force_history.cylinder)), 0.0)
    available = pneumatics.pressure * BAR
    bore_area = max(
        largest_push / available,
        largest_pull / available + 0.25 * np.pi * pneumatics.rod**2 if largest_pull > 0 else 0.0,
    )
    return float(np.sqrt(bore_area / (0.25 * np.pi)))


# -- the angles of the links ----------------------------------------------------------------------------------------------


def link_angles(pose: Pose) -> Floats:
    """Return the angles theta1 to theta5 of poses of shape (...), shape (..., 5), which satisfy (7)-(12).

    They are continuous along a motion and may exceed pi instead of jumping to -pi.
    """
    constants, l3 = pose.constants, pose.design.l3
    # angle from BA to BC, computed from the gamma of the pose: a needle-shaped triangle loses the digits of a second angle
    at_b = np.arctan2(l3 * constants.sin_gamma, l3 * constants.cos_gamma - pose.design.l2)
    quarter_turn = 0.5 * np.pi
    return _stack_links(
        np.pi - np.arctan2(pose.y, -pose.x),
        pose.turn + quarter_turn - constants.gamma,
        pose.turn + quarter_turn,
        pose.turn - quarter_turn - constants.gamma + at_b,
        np.arctan2(pose.c_height, l3 * pose.sin_turn),
    )


def angular_velocities(pose: Pose, cylinder_speed: Any) -> Floats:
    """Return the angular velocities of the five links, the solution of (13), shape (..., 5).

    The triangle moves as one body, so the three middle values are equal.
    """
    first, _ = _angle_rates(pose)
    return np.asarray(first * (cylinder_speed / pose.length_1)[..., None])


def angular_accelerations(pose: Pose, cylinder_speed: Any, cylinder_acceleration: Any) -> Floats:
    """Return the angular accelerations of the five links, the solution of (14), shape (..., 5)."""
    first, second = _angle_rates(pose)
    rate = cylinder_speed / pose.length_1
    rate_change = (cylinder_acceleration - pose.length_2 * rate * rate) / pose.length_1
    return np.asarray(second * (rate * rate)[..., None] + first * rate_change[..., None])


def _angle_rates(pose: Pose) -> tuple[Floats, Floats]:
    """Return the first and second derivatives of `link_angles` with respect to the turn T, shape (..., 5) each."""
    # With primes for derivatives by T, the first derivative of point B is (down, height' + across), and the second is
    # (-across, height'' + down).
    y_1, y_2 = pose.height_1 + pose.across, pose.height_2 + pose.down
    square = pose.length * pose.length
    theta1_1 = (pose.x * y_1 - pose.y * pose.down) / square
    theta1_2 = (pose.x * y_2 + pose.y * pose.across) / square - 2 * theta1_1 * pose.length_1 / pose.length
    a_above_c, c_height = pose.design.l3 * pose.cos_turn, pose.c_height
    # c_height^2 - a_above_c^2 = k^2 = l5^2 - l3^2
    k_squared = (c_height - np.abs(a_above_c)) * (c_height + np.abs(a_above_c))
    theta5_1 = -a_above_c / c_height
    theta5_2 = pose.design.l3 * pose.sin_turn * k_squared / (c_height * c_height * c_height)
    # The suffixes _1 and _2 denote the first and second derivative; theta2 to theta4 turn with the triangle.
    return _stack_links(theta1_1, 1.0, 1.0, 1.0, theta5_1), _stack_links(theta1_2, 0.0, 0.0, 0.0, theta5_2)


def _stack_links(*values: Any) -> Floats:
    return np.stack(np.broadcast_arrays(*values), axis=-1)
