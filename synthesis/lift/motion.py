"""The pneumatic lift: stroke, rise time and motion of a cylinder-driven lifting linkage, without integration.

Geometry, symbols and source are those of `synthesis.lift.pose`; numbers in parentheses are the source's equations.
The loops (7)-(12) and the linear systems (13), (14) are in `synthesis.lift.loops`, as an independent check.

Lengths are in the user's unit, angles in radians. What cannot be assembled is NaN in the array functions, and in
`checked_stroke` and `motion`, the functions for one lift, a `FieldError` with the constraint's name and the amount.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from synthesis.errors import FieldError
from synthesis.lift.pose import (
    EPSILON,
    Cylinder,
    Design,
    Pose,
    dead_point,
    pose_at_turn,
    top_lever,
    triangle_angle,
    turn_at_length,
)

MAX_PROPORTION = 1e6
"""Longest to shortest length of one lift; in more extreme ones rounding moves the joints visibly."""
TIME_ROOM = 1e-12
"""Relative room for a time that is meant to be the very end but was rounded on its way."""


@dataclass(frozen=True)
class Stroke:
    """The stretch of the working branch between the cylinder's shortest length and the top, shape (...) each.

    ``duration`` is the time for it, up or down; NaN where the cylinder stops before the end.
    """

    turn_bottom: np.ndarray
    turn_dead: np.ndarray
    length_dead: np.ndarray
    length_top: np.ndarray
    height_bottom: np.ndarray
    height_top: np.ndarray
    duration: np.ndarray


def stroke(design: Design, cylinder: Cylinder) -> Stroke:
    """The strokes of a batch of designs and cylinders; NaN where a lift cannot be assembled or does not work."""
    turn_dead = dead_point(design)
    turn_bottom = turn_at_length(design, cylinder.length, turn_dead)
    length_dead, top = pose_at_turn(design, turn_dead).length, pose_at_turn(design, 0.0)
    bottom = pose_at_turn(design, turn_bottom)
    travel = top.length - cylinder.length
    duration = travel_time(np.where(np.isnan(turn_bottom), np.nan, travel), cylinder.speed, cylinder.acceleration)
    return Stroke(turn_bottom, turn_dead, length_dead, top.length, bottom.height, top.height, duration)


def travel_time(travel: Any, speed: Any, acceleration: Any) -> np.ndarray:
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

    design: Design
    stroke: Stroke
    time: np.ndarray
    cylinder_length: np.ndarray
    cylinder_speed: np.ndarray
    cylinder_acceleration: float
    pose: Pose
    velocity: np.ndarray
    acceleration: np.ndarray


def velocity(pose: Pose, cylinder_speed: Any) -> np.ndarray:
    """Velocity of the platform, v_s = v_l s' / l1', the solution of (13)."""
    return cylinder_speed * pose.height_1 / pose.length_1 + 0.0  # no negative zero at the top


def acceleration(pose: Pose, cylinder_speed: Any, cylinder_acceleration: Any) -> np.ndarray:
    """Acceleration of the platform, the solution of (14).

    a_s = v_l^2 (s'' l1' - s' l1'') / l1'^3 + a_l s' / l1'. Law: the time derivative of `velocity`.
    """
    turn_rate = cylinder_speed / pose.length_1
    bend = pose.height_2 - pose.height_1 / pose.length_1 * pose.length_2
    return turn_rate * turn_rate * bend + cylinder_acceleration * (pose.height_1 / pose.length_1)


def motion(
    design: Design, cylinder: Cylinder, times: Any | None = None, samples: int = 201, limits: Stroke | None = None
) -> Motion:
    """The motion of one lift, at given times or at `samples` even ones from start to end.

    Rising starts at the cylinder's length, lowering (speed < 0) at the top. `limits` are those of `checked_stroke`,
    when they are known already.

    Raises
    ------
    FieldError
        With ``constraint`` and ``amount``: see `checked_stroke`; ``time`` for times outside of the motion.
    """
    limits = checked_stroke(design, cylinder) if limits is None else limits
    if times is None:
        times = np.linspace(0.0, float(limits.duration), samples)
    times = np.asarray(times, dtype=float)
    _check_times(times, float(limits.duration))
    rising = cylinder.speed > 0
    shortest, longest = float(cylinder.length), float(limits.length_top)
    start, end = (shortest, longest) if rising else (longest, shortest)
    length = start + times * (cylinder.speed + 0.5 * cylinder.acceleration * times)
    length = np.where(times >= limits.duration * (1 - EPSILON), end, np.clip(length, shortest, longest))
    pose = pose_at_turn(design, turn_at_length(design, length, limits.turn_dead))
    speed = cylinder.speed + cylinder.acceleration * times
    return Motion(
        design,
        limits,
        times,
        length,
        speed,
        float(cylinder.acceleration),
        pose,
        velocity(pose, speed),
        acceleration(pose, speed, cylinder.acceleration),
    )


def _check_times(times: np.ndarray, duration: float) -> None:
    wrong = np.nonzero(~((times >= 0) & (times <= duration * (1 + TIME_ROOM))))[0]
    if wrong.size:
        at = int(wrong[0])
        found = float(times[at])
        amount = -found if found < 0 else found - duration
        raise FieldError(
            f"/times/{at}",
            f"the motion lasts from 0 to {duration:.9g}, found {found:.9g}",
            constraint="time",
            amount=amount,
            rise_time=duration,
        )


def checked_stroke(design: Design, cylinder: Cylinder) -> Stroke:
    """The stroke of one lift, or the constraint that it fails and by how much.

    Raises
    ------
    FieldError
        ``constraint`` is one of ``proportion`` (no digits left), ``triangle`` (34), ``l3<l5`` (36), ``top_lever``
        (the cylinder must shorten to come to the top), ``dead_point`` (length at or below the dead point's: no such
        pose, or none that lifts), ``cylinder_length`` (no pose: longer than at the top), ``speed`` (zero) or
        ``stopping`` (the cylinder comes to rest before the end). ``amount`` >= 0 is by how much, as a length.
    """
    l2, l3, l4, l5, _ = (float(value) for value in design.as_tuple())
    sides = {"l2": l2, "l3": l3, "l4": l4}
    longest = max(sides, key=lambda name: sides[name])
    others = [name for name in sides if name != longest]
    lengths = {**design.as_dict(), "cylinder.length": float(cylinder.length)}
    large, small = max(lengths, key=lambda name: lengths[name]), min(lengths, key=lambda name: lengths[name])
    if not lengths[large] <= MAX_PROPORTION * lengths[small]:
        raise FieldError(
            "/cylinder/length" if "cylinder.length" in (large, small) else f"/design/{large}",
            f"{large} = {lengths[large]:.6g} is more than {MAX_PROPORTION:g} times {small} = {lengths[small]:.6g}: "
            "too few digits are left to say where the joints are",
            constraint="proportion",
            amount=lengths[large] - MAX_PROPORTION * lengths[small],
        )
    if np.isnan(triangle_angle(l2, l3, l4)[2]):
        excess = (sides[longest] - sides[others[0]]) - sides[others[1]]
        raise FieldError(
            "/design",
            f"no triangle ABC: {longest} must be less than {others[0]} + {others[1]}, it is {excess:.9g} too long",
            constraint="triangle",
            amount=max(excess, 0.0),
        )
    if not l3 < l5:
        raise FieldError(
            "/design",
            f"the loop of slide and link does not close in every position: l3 must be less than l5, "
            f"it is {l3 - l5:.9g} too long",
            constraint="l3<l5",
            amount=l3 - l5,
        )
    if float(cylinder.speed) == 0:
        raise FieldError(
            "/cylinder/speed", "the cylinder stands still: its speed must not be 0", constraint="speed", amount=0.0
        )
    limits = stroke(design, cylinder)
    length, dead, top = float(cylinder.length), float(limits.length_dead), float(limits.length_top)
    lever = float(top_lever(design))
    if np.isnan(limits.turn_dead):
        raise FieldError(
            "/design",
            f"the cylinder would have to shorten to come to the top: the lever b cos(gamma) + (l3 + l5) sin(gamma) "
            f"must be positive, it is {lever:.9g}",
            constraint="top_lever",
            amount=max(-lever, 0.0),
        )
    if not length > dead:
        raise FieldError(
            "/cylinder/length",
            f"no pose that lifts at this length: the dead point is at {dead:.9g}, {dead - length:.9g} above",
            constraint="dead_point",
            amount=dead - length,
            dead_point_length=dead,
        )
    if not length < top:
        raise FieldError(
            "/cylinder/length",
            f"no stroke: the top is at cylinder length {top:.9g}, {length - top:.9g} below",
            constraint="cylinder_length",
            amount=length - top,
            length_top=top,
        )
    if np.isnan(limits.duration):
        reach = float(cylinder.speed) ** 2 / (2 * abs(float(cylinder.acceleration)))
        raise FieldError(
            "/cylinder/acceleration",
            f"the cylinder comes to rest after {reach:.9g} of {top - length:.9g}: the stroke is not reached",
            constraint="stopping",
            amount=(top - length) - reach,
        )
    return limits
