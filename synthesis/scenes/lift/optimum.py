"""Designs of the lift that meet a stroke, and their objective: the platform speed that varies least over the stroke.

In terms of l2 and gamma (the triangle's angle at A), the equations (31) collinear start, (32) closure at the start
and (33) stroke are solved explicitly. A, B and O are in line at the start, so with psi = atan2(b, sa) the start turn
is theta = psi + gamma. Because l3 + l5 = sb, C lies on an ellipse with foci A and D, whose polar form about A is l3 =
(sb^2 - sa^2) / (2 (sb - sa cos theta)). No equation needs a penalty.

Numbers in parentheses are the equations of the source named in `synthesis.scenes.lift.pose`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from synthesis.one_variable import Floats
from synthesis.scenes.lift.motion import check_speed, constraint_error, travel_time, velocity
from synthesis.scenes.lift.pose import (
    Cylinder,
    Design,
    Pose,
    dead_point,
    design_constants,
    evaluate_in_blocks,
    pose_at_height,
    pose_at_turn,
    third_side,
    top_length,
    top_lever,
    triangle_angle,
)
from synthesis.work import UNLIMITED, Work

Kind = Literal["discrete", "continuous", "normalized"]
"""Kind of objective; see `Objective`."""


@dataclass(frozen=True)
class OptimumOptions:
    """Options of the objective of a design."""

    gauss_nodes: int = 200
    """Number of Gauss nodes for the height average of the continuous objectives, clustered towards the start."""
    open_end: float = 1e-5
    """Fraction of the range of gamma excluded at its open ends, where the triangle is flat (34). In flatter triangles
    the side lengths no longer determine the angle."""
    poses_per_block: int = 1 << 17
    """Number of poses evaluated at a time, which bounds the memory."""


OPTIONS = OptimumOptions()


@dataclass(frozen=True)
class Objective:
    """Objective to minimise: the variance of the platform speed over height."""

    kind: Kind
    """"discrete" is the mean over n + 1 evenly spaced heights.
    "continuous" is the integral (28).
    "normalized" is the integral divided by the squared mean speed (29), which does not favour slow motion.
    """
    n: int = 310
    """Number of height steps of the discrete objective."""
    include_start: bool = True
    """True: the discrete objective includes the lowest height. False: it omits this height, as (30) is printed."""


@dataclass(frozen=True)
class Task:
    """Problem of finding an optimum design."""

    cylinder: Cylinder
    """The drive."""
    low: float
    """Height of the platform at the start."""
    high: float
    """Height of the platform at the top."""
    objective: Objective
    """The objective."""
    upper_bound: float
    """Upper bound of all five lengths."""


def design_from_angle(l2: Any, gamma: Any, length: Any, low: Any, high: Any) -> Design:
    """Return the design that satisfies (31), (32) and (33) for given l2 and gamma; NaN if l1' + l2 does not exceed ``low``.

    ``length`` is the cylinder length l1' at the start, and ``low`` and ``high`` are the heights at the start and at the
    top. All arguments broadcast.
    """
    l2, gamma = np.broadcast_arrays(np.asarray(l2, dtype=float), np.asarray(gamma, dtype=float))
    b = base_distance(l2, length, low)
    theta = np.arctan2(b, low) + gamma
    # write sb - sa cos(theta) as a sum of positive terms
    l3 = (high - low) * (high + low) / (2 * ((high - low) + 2 * low * np.sin(0.5 * theta) ** 2))
    return Design(l2, l3, third_side(l2, l3, gamma), high - l3, b)


def base_distance(l2: Any, length: Any, low: Any) -> Any:
    """Return the distance b from (31); NaN if l1' + l2 does not exceed `low`."""
    square = (length + l2 - low) * (length + l2 + low)
    return np.sqrt(np.where(square > 0, square, np.nan))


def angle_limit(l2: Any, length: Any, low: Any) -> Any:
    """Return the upper limit of gamma, at which the start turn psi + gamma is half a turn.

    Beyond the limit the platform would first go down.
    """
    return np.pi - np.arctan2(base_distance(l2, length, low), low)


def driven_speed(pose: Pose, cylinder: Cylinder) -> Any:
    """Return the absolute cylinder speed in a pose; 0 beyond the length at which the cylinder stops."""
    speed, signed_acceleration = abs(cylinder.speed), cylinder.acceleration * np.sign(cylinder.speed)
    if not signed_acceleration:
        return speed
    rising = cylinder.speed > 0
    covered = pose.length - cylinder.length if rising else top_length(pose.design, pose.constants) - pose.length
    return np.sqrt(np.maximum(speed * speed + 2 * signed_acceleration * covered, 0.0))


@dataclass(frozen=True)
class StrokeDesign:
    """Designs that meet the stroke."""

    design: Design
    """The five lengths."""
    gamma: Any
    """The triangle's angle at A."""
    turn: Any
    """Turn at the start."""
    closed_length: Any
    """Cylinder length at the start."""

    def select(self, rows: Any) -> StrokeDesign:
        """Return some of the designs."""
        fields = (
            np.asarray(value)[rows] for value in (*self.design.as_tuple(), self.gamma, self.turn, self.closed_length)
        )
        *lengths, gamma, turn, closed = fields
        return StrokeDesign(Design(*lengths), gamma, turn, closed)


@dataclass(frozen=True)
class Optimum:
    """The best design of a task."""

    stroke_design: StrokeDesign
    """The design, with its angle, start turn and closed length."""
    objective: float
    """Value of the objective."""
    mean_velocity: float
    """Mean speed of the platform over height (29)."""
    active: tuple[str, ...]
    """Names of the active inequalities."""
    slacks: dict[str, float]
    """Slack of each inequality."""

    @property
    def design(self) -> Design:
        """Return the five lengths."""
        return self.stroke_design.design


@dataclass(frozen=True)
class OptimumMotion:
    """Motion of the optimum design."""

    rise_time: float
    """Time from start to top, or from top to start."""
    velocity_start: float
    """Velocity of the platform at the start of the motion."""
    velocity_bottom: float
    """Velocity of the platform at the lowest height."""
    velocity_mean: float
    """Mean velocity of the platform over height."""
    dead_point_length: float
    """Cylinder length at the dead point."""


def optimum_motion(optimum: Optimum, task: Task) -> OptimumMotion:
    """Compute the motion of an optimum. If the cylinder shortens, the platform goes down and starts from rest at the top."""
    built, cylinder = optimum.stroke_design, replace(task.cylinder, length=float(optimum.stroke_design.closed_length))
    constants = design_constants(built.design, built.gamma)
    bottom = pose_at_turn(built.design, built.turn, constants)
    travel = top_length(built.design, constants) - cylinder.length
    velocity_bottom = float(velocity(bottom, np.sign(cylinder.speed) * driven_speed(bottom, cylinder)))
    return OptimumMotion(
        rise_time=float(travel_time(travel, cylinder.speed, cylinder.acceleration)),
        velocity_start=velocity_bottom if cylinder.speed > 0 else 0.0,
        velocity_bottom=velocity_bottom,
        velocity_mean=optimum.mean_velocity,
        dead_point_length=float(pose_at_turn(built.design, dead_point(built.design)).length),
    )


class Evaluator:
    """Objective of a task for batches of designs.

    Parameters
    ----------
    task : Task
    work : Work, optional
        Called before each block of designs to check whether the result is still wanted.
    """

    def __init__(self, task: Task, work: Work = UNLIMITED) -> None:
        self.task = task
        self.work = work
        objective = task.objective
        if objective.kind == "discrete":
            steps = np.arange(0 if objective.include_start else 1, objective.n + 1) / objective.n
            self._heights = task.low + steps * (task.high - task.low)
            self._weights = np.ones(steps.size)
        else:
            z, weights = np.polynomial.legendre.leggauss(OPTIONS.gauss_nodes)
            z, weights = 0.5 * (z + 1), 0.5 * weights
            self._fractions, self._weights = 1 - z**3, 3 * z * z * weights

    def __call__(self, design: Design, gamma: Any | None = None) -> Any:
        """Return the objective of each design; infinite if a dead point lies between its heights; see `moments`."""
        return self.moments(design, gamma)[0]

    def moments(self, design: Design, gamma: Any | None = None, closed: Any | None = None) -> Any:
        """Return the objective and the mean speed over height (29) of each design, shape (2, ...).

        Parameters
        ----------
        design : Design
        gamma : float or ndarray, optional
            The triangle's angle at A, if it is known more accurately than it follows from the three sides.
        closed : float or ndarray, optional
            Cylinder length at the start, if it differs from the task's.
        """
        gamma = triangle_angle(design.l2, design.l3, design.l4) if gamma is None else gamma
        closed = self.task.cylinder.length if closed is None else closed

        def moments(*fields: Floats) -> Floats:
            errors, mean = self._errors(*fields)
            return np.stack([np.sum(errors * errors, axis=1), mean])

        return self._in_blocks(moments, design, gamma, closed)

    def errors(self, candidates: StrokeDesign) -> Floats:
        """Return weighted deviations of the speed from its mean, whose squares add up to the objective, shape (n, samples)."""
        fields = candidates.design, candidates.gamma, candidates.closed_length
        return np.asarray(self._in_blocks(lambda *fields: self._errors(*fields)[0].T, *fields)).T

    def _in_blocks(self, function: Callable[..., Floats], design: Design, gamma: Any, closed: Any) -> Any:
        size = max(1, OPTIONS.poses_per_block // self._weights.size)
        return evaluate_in_blocks(function, size, *design.as_tuple(), gamma, closed)

    def _errors(self, *fields: Floats) -> tuple[Floats, Floats]:
        """Return the weighted deviations, shape (n, samples), and the mean speeds, shape (n,), for columns of shape (n,)."""
        self.work.go_on()
        task = self.task
        *lengths, gamma, closed = (field[:, None] for field in fields)
        design = Design(*lengths)
        constants = design_constants(design, gamma)
        weights = self._weights
        if task.objective.kind == "discrete":
            pose = pose_at_height(design, self._heights, constants)
        else:
            start_turn = triangle_angle(task.low, design.l3, design.l5, may_be_flat=True)  # the turn at the start
            pose = pose_at_turn(design, start_turn * self._fractions, constants)
            weights = -weights * start_turn * pose.height_1
        v = velocity(pose, driven_speed(pose, replace(task.cylinder, length=closed)))
        lifts = (np.all((v >= 0) & np.isfinite(v), axis=1) & (top_lever(design, constants)[:, 0] > 0))[:, None]
        v = np.where(lifts, v, 1.0)
        weights = np.where(lifts, weights, 1.0)
        weights = weights / np.sum(weights, axis=1, keepdims=True)
        mean = np.sum(weights * v, axis=1, keepdims=True)
        unit = mean if task.objective.kind == "normalized" else np.ones_like(mean)
        deviation = np.divide(v - mean, unit, out=np.full(v.shape, np.inf), where=lifts & (unit > 0))
        return np.where(np.isfinite(deviation), np.sqrt(weights) * deviation, np.inf), mean[:, 0]


def check_task(task: Task) -> None:
    """Raise a `FieldError` with ``constraint`` ``speed`` or ``stroke`` if the cylinder or the platform would not move."""
    check_speed(task.cylinder)
    if not task.low < task.high:
        message = f"the height at the start, {task.low:.9g}, must be less than the height at the top, {task.high:.9g}"
        raise constraint_error("stroke", "/stroke", task.low - task.high, message)
