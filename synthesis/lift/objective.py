"""The lift's objective and its designs on the constraints: five lengths, three equations, two free variables.

In l2 and gamma (the triangle's angle at A) the equations (31) collinear start, (32) closure there and (33) stroke are
solved *explicitly*. At the start A, B, O lie on a line, so with psi = atan2(b, sa) the start turn is
theta = psi + gamma; and l3 + l5 = sb says that C lies on an ellipse with foci A and D, whose polar form about A is
l3 = (sb^2 - sa^2) / (2 (sb - sa cos theta)). No equation is left to a penalty.

Numbers in parentheses are the equations of the source named in `synthesis.lift.pose`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from synthesis.lift.motion import velocity
from synthesis.lift.pose import (
    Cylinder,
    Design,
    Pose,
    angle_or_flat,
    by_blocks,
    pose_at_height,
    pose_at_turn,
    shape,
    third_side,
    top_length,
    top_lever,
    triangle_angle,
)
from synthesis.one_variable import EPSILON, Floats, bisect
from synthesis.work import Work

Kind = Literal["discrete", "continuous", "normalized"]

GAUSS_NODES = 200
"""Nodes of the height average of the continuous objectives, graded towards the start."""
PROJECT_NODES = 257
"""Values of gamma on which the roots of a projection are isolated."""
HALVINGS = 60
"""Halvings of an interval of gamma: to the last bit."""
OPEN_END = 1e-5
"""Share of the range of gamma that is kept away from its open ends, the flat triangles (34): in flatter ones the
lengths no longer carry the angle."""
BLOCK = 1 << 17
"""Poses that are evaluated at a time: bounds the memory."""


@dataclass(frozen=True)
class Objective:
    """What is minimised: the variance of the platform's speed over height.

    ``discrete``: the mean over n + 1 even heights, the lowest one included; without it when `include_start` is
    False, as (30) prints it. ``continuous``: the integral (28). ``normalized``: that divided by the squared mean
    speed (29), which no longer rewards slowness.
    """

    kind: Kind
    n: int = 310
    include_start: bool = True


@dataclass(frozen=True)
class Task:
    """One optimisation: the drive, the stroke from `low` to `high`, the objective, the bound on all five lengths."""

    cylinder: Cylinder
    low: float
    high: float
    objective: Objective
    upper_bound: float


def design_from_angle(l2: Any, gamma: Any, length: Any, low: Any, high: Any) -> Design:
    """The design that meets (31), (32) and (33), from its two free variables; arrays broadcast.

    Law: `equation_residuals` is 0 to rounding. NaN where l1' + l2 does not reach past `low`.
    """
    l2, gamma = np.broadcast_arrays(np.asarray(l2, dtype=float), np.asarray(gamma, dtype=float))
    b = base_distance(l2, length, low)
    theta = np.arctan2(b, low) + gamma
    # sb - sa cos(theta) as a sum of positive terms
    l3 = (high - low) * (high + low) / (2 * ((high - low) + 2 * low * np.sin(0.5 * theta) ** 2))
    return Design(l2, l3, third_side(l2, l3, gamma), high - l3, b)


def base_distance(l2: Any, length: Any, low: Any) -> Any:
    """The distance b of slide and cylinder from (31); NaN where l1' + l2 does not reach past `low`."""
    square = (length + l2 - low) * (length + l2 + low)
    return np.sqrt(np.where(square > 0, square, np.nan))


def angle_limit(l2: Any, length: Any, low: Any) -> Any:
    """Upper end of gamma: the start turn psi + gamma stays below a half turn, or the platform would fall first."""
    return np.pi - np.arctan2(base_distance(l2, length, low), low)


def project(l2: Any, l4: Any, length: float, low: float, high: float) -> Design:
    """The design with given l2 and l4 that meets (31)-(33); arrays broadcast, NaN where there is none.

    Almost always one root at most is a lift (l3 < l5, l3 <= l2); if there are more, the one with the least l3.
    """
    l2, l4 = np.broadcast_arrays(np.asarray(l2, dtype=float), np.asarray(l4, dtype=float))
    arms, sides = l2.reshape(-1), l4.reshape(-1)
    gammas = np.linspace(OPEN_END, 1 - OPEN_END, PROJECT_NODES) * angle_limit(arms, length, low)[:, None]
    excess = design_from_angle(arms[:, None], gammas, length, low, high).l4 - sides[:, None]
    below = excess < 0
    row, at = np.nonzero((below[:, :-1] != below[:, 1:]) & ~np.isnan(excess[:, :-1]))

    def same(gamma: Floats) -> Any:
        return (design_from_angle(arms[row], gamma, length, low, high).l4 < sides[row]) == below[row, at]

    left, right = bisect(same, gammas[row, at], gammas[row, at + 1], HALVINGS)
    found = design_from_angle(arms[row], 0.5 * (left + right), length, low, high)
    l3 = np.full(arms.shape, np.nan)
    lifts = (found.l3 < found.l5) & (found.l3 <= found.l2 * (1 + EPSILON))
    np.fmin.at(l3, row[lifts], found.l3[lifts])
    l3 = l3.reshape(l2.shape)
    fields = (l2, l3, l4, high - l3, base_distance(l2, length, low))
    return Design(*(np.where(np.isnan(l3), np.nan, field)[()] for field in fields))


def equation_residuals(design: Design, length: Any, low: Any, high: Any) -> dict[str, float]:
    """By how much one design fails (31), (32) and (33), each as a length (start height, l5 and stroke)."""
    start = np.sqrt(np.maximum((length + design.l2 - design.b) * (length + design.l2 + design.b), 0.0))
    theta = np.arctan2(design.b, low) + shape(design).gamma
    return {
        "(31) start": float(start - low),
        "(32) closure": float(third_side(design.l3, low, theta) - design.l5),
        "(33) stroke": float(design.l3 + design.l5 - high),
    }


def driven_speed(pose: Pose, cylinder: Cylinder) -> Any:
    """Speed of the cylinder, without its sign, when it has come to the length of a pose; 0 past where it stops."""
    speed, along = abs(cylinder.speed), cylinder.acceleration * np.sign(cylinder.speed)
    if not along:
        return speed
    rising = cylinder.speed > 0
    covered = pose.length - cylinder.length if rising else top_length(pose.design, pose.form) - pose.length
    return np.sqrt(np.maximum(speed * speed + 2 * along * covered, 0.0))


class Evaluator:
    """The objective of a task for batches of designs; counts what it evaluates.

    ``work`` is asked before each block of designs whether the answer is still wanted.
    """

    def __init__(self, task: Task, work: Work | None = None) -> None:
        self.task = task
        self.work = work or Work()
        self.evaluations = 0
        objective = task.objective
        if objective.kind == "discrete":
            steps = np.arange(0 if objective.include_start else 1, objective.n + 1) / objective.n
            self._heights = task.low + steps * (task.high - task.low)
            self._weights = np.ones(steps.size)
        else:
            z, weights = np.polynomial.legendre.leggauss(GAUSS_NODES)
            z, weights = 0.5 * (z + 1), 0.5 * weights
            self._fractions, self._weights = 1 - z**3, 3 * z * z * weights

    def __call__(self, design: Design, gamma: Any | None = None) -> Any:
        """The objective of each design, shape of its fields; infinite where a dead point shows between its heights.

        `gamma` is the triangle's angle at A where it is known better than from the three sides.
        """
        return self.moments(design, gamma)[0]

    def moments(self, design: Design, gamma: Any | None = None, closed: Any | None = None) -> Any:
        """The objective and the mean speed over height (29) of each design, shape (2, ...).

        `closed` is the cylinder's length at the start where it is not the task's.
        """
        gamma = triangle_angle(design.l2, design.l3, design.l4)[2] if gamma is None else gamma
        closed = self.task.cylinder.length if closed is None else closed
        return by_blocks(self._moments, max(1, BLOCK // self._weights.size), *design.as_tuple(), gamma, closed)

    def _moments(self, *fields: Floats) -> Floats:
        self.work.go_on()
        self.evaluations += fields[0].size
        task = self.task
        *lengths, gamma, closed = (field[:, None] for field in fields)
        design = Design(*lengths)
        form = shape(design, gamma)
        weights = self._weights
        if task.objective.kind == "discrete":
            pose = pose_at_height(design, self._heights, form, clip=True)
        else:
            theta = angle_or_flat(task.low, design.l3, design.l5)  # the turn at the start
            pose = pose_at_turn(design, theta * self._fractions, form)
            weights = -weights * theta * pose.height_1
        v = velocity(pose, driven_speed(pose, replace(task.cylinder, length=closed)))
        works = np.all((v >= 0) & np.isfinite(v), axis=1) & (top_lever(design, form)[:, 0] > 0)
        v = np.where(works[:, None], v, 1.0)
        total = np.where(works[:, None], np.sum(weights, axis=-1, keepdims=True), 1.0)
        mean = np.sum(weights * v, axis=1, keepdims=True) / total
        variance = np.sum(weights * (v - mean) ** 2, axis=1, keepdims=True) / total
        if task.objective.kind == "normalized":
            variance = np.divide(variance, mean * mean, out=np.full(mean.shape, np.inf), where=mean > 0)
        return np.stack([np.where(works, variance[:, 0], np.inf), mean[:, 0]])
