"""The published designs of the lift, and why each is or is not an optimum.

Table 2 of the source (eleven rows; its digits in tests/reference). A printed design is rounded to 0.1, which alone
moves its objective by more than the optimum gains; it is therefore put back on its constraints (31)-(33) first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synthesis.lift.objective import Evaluator, Task, project
from synthesis.lift.optimum import Optimum
from synthesis.lift.pose import Design

STROKE = (200.0, 510.0)
BASE_LENGTH = 220.0
ARMS = {200.0: 347.4, 210.0: 353.9, 220.0: 351.9, 230.0: 348.9, 240.0: 356.3, 250.0: 354.6}
"""Printed l2 = l4 by cylinder length l1' (that of 250 follows from (31): two of its digits are lost in print)."""
SLOPE_STEP = 1e-4
"""Step of the slope along l4 = l2, as a share of l2."""


@dataclass(frozen=True)
class Published:
    """A published design on its constraints, its objective, the slope df/dl2 along l4 = l2, and the reason."""

    design: Design
    objective: float
    slope: float
    reason: str


def published_for(task: Task, optimum: Optimum) -> Published | None:
    """The published design for a task beside its optimum; None where the source has none (another stroke).

    For a cylinder length that is not in the table, the arms of the base row (l1' = 220).
    """
    if not np.allclose((task.low, task.high), STROKE, rtol=1e-9, atol=0.0):
        return None
    arm = ARMS.get(task.cylinder.length, ARMS[BASE_LENGTH])
    step = SLOPE_STEP * arm
    arms = np.array([arm - step, arm, arm + step])
    designs = project(arms, arms, task.cylinder.length, task.low, task.high)
    values = Evaluator(task)(designs)
    if not np.all(np.isfinite(values)):
        return None
    design = Design(*(float(value[1]) for value in designs.as_tuple()))
    objective, slope = float(values[1]), float((values[2] - values[0]) / (2 * step))
    return Published(design, objective, slope, _reason(task, optimum, design, objective, slope))


def _reason(task: Task, optimum: Optimum, design: Design, objective: float, slope: float) -> str:
    largest = max(design.as_dict().items(), key=lambda entry: entry[1])
    if largest[1] > task.upper_bound:
        return f"not admissible here: {largest[0]} = {largest[1]:.6g} is above the upper bound {task.upper_bound:.6g}"
    share = 100 * (1 - optimum.objective / objective)
    text = (
        f"not the optimum: on the same constraints its f is {objective:.6g}, the optimum's is {share:.3g} % lower; "
    )
    text += f"along l4 = l2 it still changes by {slope:.4g} per unit of l2, towards l2 = {optimum.design.l2:.6g}"
    if task.objective.kind == "continuous":
        text += "; the continuous objective has no interior optimum: it rewards slowness and falls to 0 as l2 grows"
    elif task.objective.kind == "discrete" and task.objective.include_start:
        text += "; the discrete objective has an interior optimum only because of its sample at the start"
    return text
