"""The lift's objective and its designs on the constraints: five lengths, three equations, two free variables.

In l2 and gamma (the triangle's angle at A) the equations (31) collinear start, (32) closure there and (33) stroke are
solved *explicitly*. At the start A, B, O lie on a line, so with psi = atan2(b, sa) the start turn is
theta = psi + gamma; and l3 + l5 = sb says that C lies on an ellipse with foci A and D, whose polar form about A is
l3 = (sb^2 - sa^2) / (2 (sb - sa cos theta)). No equation is left to a penalty.

Numbers in parentheses are the equations of the source named in `synthesis.lift.pose`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from synthesis.lift.pose import EPSILON, Cylinder, Design, Shape, shape, triangle_angle

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
    l4 = np.sqrt((l2 - l3) ** 2 + 4 * l2 * l3 * np.sin(0.5 * gamma) ** 2)
    return Design(l2, l3, l4, high - l3, b)


def base_distance(l2: np.ndarray, length: Any, low: Any) -> np.ndarray:
    square = (length + l2 - low) * (length + l2 + low)
    return np.sqrt(np.where(square > 0, square, np.nan))


def project(l2: Any, l4: Any, length: float, low: float, high: float) -> Design:
    """The design with given l2 and l4 that meets (31)-(33); arrays broadcast, NaN where there is none.

    Almost always one root at most is a lift (l3 < l5, l3 <= l2); if there are more, the one with the least l3.
    """
    l2, l4 = np.broadcast_arrays(np.asarray(l2, dtype=float), np.asarray(l4, dtype=float))
    arms, sides = l2.reshape(-1), l4.reshape(-1)
    limit = np.pi - np.arctan2(base_distance(arms, length, low), low)
    gammas = np.linspace(OPEN_END, 1 - OPEN_END, PROJECT_NODES) * limit[:, None]
    excess = design_from_angle(arms[:, None], gammas, length, low, high).l4 - sides[:, None]
    row, at = np.nonzero((excess[:, :-1] < 0) != (excess[:, 1:] < 0))
    row, at = row[~np.isnan(excess[row, at])], at[~np.isnan(excess[row, at])]
    left, right = gammas[row, at], gammas[row, at + 1]
    starts_below = excess[row, at] < 0
    for _ in range(HALVINGS):
        middle = 0.5 * (left + right)
        below = design_from_angle(arms[row], middle, length, low, high).l4 < sides[row]
        left, right = np.where(below == starts_below, middle, left), np.where(below == starts_below, right, middle)
    found = design_from_angle(arms[row], 0.5 * (left + right), length, low, high)
    l3 = np.full(arms.shape, np.nan)
    lifts = (found.l3 < found.l5) & (found.l3 <= found.l2 * (1 + EPSILON))
    np.fmin.at(l3, row[lifts], found.l3[lifts])
    l3 = l3.reshape(l2.shape)
    base = np.where(np.isnan(l3), np.nan, base_distance(l2, length, low))
    wanted = [np.where(np.isnan(l3), np.nan, value) for value in (l2, l4)]
    return Design(wanted[0][()], l3[()], wanted[1][()], (high - l3)[()], base[()])


def equation_residuals(design: Design, length: Any, low: Any, high: Any) -> dict[str, float]:
    """By how much one design fails (31), (32) and (33), each as a length (start height, l5 and stroke)."""
    start = np.sqrt(np.maximum((length + design.l2 - design.b) * (length + design.l2 + design.b), 0.0))
    theta = np.arctan2(design.b, low) + shape(design).gamma
    l5 = np.sqrt((design.l3 - low) ** 2 + 4 * low * design.l3 * np.sin(0.5 * theta) ** 2)
    return {
        "(31) start": float(start - low),
        "(32) closure": float(l5 - design.l5),
        "(33) stroke": float(design.l3 + design.l5 - high),
    }


def speeds_at_turn(
    design: Design, form: Shape, cylinder: Cylinder, sin_turn: Any, cos_turn: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Speed of the platform and ds/dT, from sine and cosine of the turn; negative past a dead point.

    `pose_at_turn` without second derivatives, and with the cylinder's speed taken from its length.
    """
    l2, l3 = design.l2, design.l3
    level = l3 * cos_turn
    root = np.sqrt(form.k_squared + level * level)
    both = root + np.abs(level)
    s = np.where(level >= 0, both, form.k_squared / both)
    s_1 = -l3 * sin_turn * s / root
    down = l2 * (cos_turn * form.cos_gamma + sin_turn * form.sin_gamma)
    across = l2 * (sin_turn * form.cos_gamma - cos_turn * form.sin_gamma)
    y = s - down
    # x x' + y y', in which two products cancel each other
    rate = across * s - design.b * down + s_1 * y
    length = np.hypot(across - design.b, y)
    gain = np.divide(length * s_1, rate, out=np.full(np.broadcast(length, rate).shape, np.inf), where=rate != 0)
    speed = abs(cylinder.speed)
    along = cylinder.acceleration * np.sign(cylinder.speed)
    if along:
        covered = length - cylinder.length
        if cylinder.speed < 0:
            top = np.hypot(design.b + l2 * form.sin_gamma, l3 + design.l5 - l2 * form.cos_gamma)
            covered = top - length
        speed = np.sqrt(np.maximum(speed * speed + 2 * along * covered, 0.0))
    return speed * gain, s_1


class Evaluator:
    """The objective of a task for batches of designs; counts what it evaluates.

    ``checkpoint`` is called before each block of designs: what it raises ends a long evaluation.
    """

    def __init__(self, task: Task, checkpoint: Callable[[], object] = lambda: None) -> None:
        self.task = task
        self.checkpoint = checkpoint
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

    def __call__(self, design: Design, gamma: Any | None = None) -> np.ndarray:
        """The objective of each design, shape of its fields; infinite where a dead point shows between its heights.

        `gamma` is the triangle's angle at A where it is known better than from the three sides.
        """
        return self.moments(design, gamma)[0]

    def moments(self, design: Design, gamma: Any | None = None) -> tuple[np.ndarray, np.ndarray]:
        """The objective and the mean speed over height (29) of each design."""
        gamma = triangle_angle(design.l2, design.l3, design.l4)[2] if gamma is None else gamma
        fields = np.broadcast_arrays(*(np.asarray(value, dtype=float) for value in (*design.as_tuple(), gamma)))
        flat = [field.reshape(-1) for field in fields]
        values, means = np.empty(flat[0].shape), np.empty(flat[0].shape)
        rows = max(1, BLOCK // self._weights.size)
        for start in range(0, values.size, rows):
            self.checkpoint()
            *lengths, angle = (field[start : start + rows, None] for field in flat)
            values[start : start + rows], means[start : start + rows] = self._moments(Design(*lengths), angle)
        self.evaluations += values.size
        return values.reshape(fields[0].shape)[()], means.reshape(fields[0].shape)[()]

    def _moments(self, design: Design, gamma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        task = self.task
        form = Shape(np.cos(gamma), np.sin(gamma), gamma, (design.l5 - design.l3) * (design.l5 + design.l3))
        if task.objective.kind == "discrete":
            s = self._heights
            down, up = _half_turn(design, s)
            product = 4 * design.l3 * s
            sin_turn, cos_turn = 2 * np.sqrt(down * up) / product, (up - down) / product
            v, _ = speeds_at_turn(design, form, task.cylinder, sin_turn, cos_turn)
            weights = self._weights
        else:
            down, up = _half_turn(design, task.low)
            theta = 2 * np.arctan2(np.sqrt(down), np.sqrt(up))
            turn = theta * self._fractions
            v, s_1 = speeds_at_turn(design, form, task.cylinder, np.sin(turn), np.cos(turn))
            weights = -self._weights * theta * s_1
        lever = design.b * form.cos_gamma + task.high * form.sin_gamma  # `synthesis.lift.motion.top_lever`
        works = np.all((v >= 0) & np.isfinite(v), axis=1) & (lever[:, 0] > 0)
        v = np.where(works[:, None], v, 1.0)
        total = np.where(works[:, None], np.sum(weights, axis=-1, keepdims=True), 1.0)
        mean = np.sum(weights * v, axis=1, keepdims=True) / total
        variance = np.sum(weights * (v - mean) ** 2, axis=1, keepdims=True) / total
        if task.objective.kind == "normalized":
            variance = np.divide(variance, mean * mean, out=np.full(mean.shape, np.inf), where=mean > 0)
        return np.where(works, variance[:, 0], np.inf), mean[:, 0]


def _half_turn(design: Design, height: Any) -> tuple[np.ndarray, np.ndarray]:
    """4 l3 s times the squared sine and cosine of half the turn, as in `synthesis.lift.motion.pose_at_height`.

    Rounding past an end of the stroke counts as the end.
    """
    down = np.maximum((design.l5 + (design.l3 - height)) * (design.l5 - (design.l3 - height)), 0.0)
    up = np.maximum(((height - design.l5) + design.l3) * (height + design.l3 + design.l5), 0.0)
    return down, up
