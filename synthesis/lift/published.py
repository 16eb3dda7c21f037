"""The published designs of the lift, and why each is or is not an optimum.

Table 2 of the source (eleven rows; its digits in tests/reference). A printed design is rounded to 0.1, which alone
moves its objective by more than the optimum gains; it is therefore put back on its constraints (31)-(33) first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from synthesis.lift.objective import Evaluator, Task, project
from synthesis.lift.optimum import Optimum
from synthesis.lift.pose import Design

STROKE = (200.0, 510.0)
ARMS = {200.0: 347.4, 210.0: 353.9, 220.0: 351.9, 230.0: 348.9, 240.0: 356.3, 250.0: 354.6}
"""Printed l2 = l4 by cylinder length l1'."""
FITTED = (250.0,)
"""Cylinder lengths whose arm is not printed in full: two of its digits are lost, and (31) gives them from the printed b."""
SLOPE_STEP = 1e-4
"""Step of the slope along l4 = l2, as a share of l2."""
SAME = 1e-9
"""Share by which a stroke or a length may differ from the table's."""


@dataclass(frozen=True)
class Published:
    """A published design on its constraints, its objective, the slope df/dl2 along l4 = l2, and how it compares.

    ``source``: "printed", or "fitted" where a digit of it is inferred.
    """

    design: Design
    objective: float
    slope: float
    reason: str
    source: Literal["printed", "fitted"]


def published_for(task: Task, optimum: Optimum) -> Published | None:
    """The published design for a task beside its optimum; None where the source has none for this stroke and cylinder."""
    if not np.allclose((task.low, task.high), STROKE, rtol=SAME, atol=0.0):
        return None
    length = min(ARMS, key=lambda one: abs(one - task.cylinder.length))
    if abs(length - task.cylinder.length) > SAME * length:
        return None
    arm = ARMS[length]
    step = SLOPE_STEP * arm
    arms = np.array([arm - step, arm, arm + step])
    designs = project(arms, arms, task.cylinder.length, task.low, task.high)
    values = Evaluator(task)(designs)
    if not np.all(np.isfinite(values)):
        return None
    design = Design(*(float(value[1]) for value in designs.as_tuple()))
    objective, slope = float(values[1]), float((values[2] - values[0]) / (2 * step))
    reason = _reason(task, optimum, design, objective, slope)
    return Published(design, objective, slope, reason, "fitted" if length in FITTED else "printed")


def _reason(task: Task, optimum: Optimum, design: Design, objective: float, slope: float) -> str:
    largest = max(design.as_dict().items(), key=lambda entry: entry[1])
    if largest[1] > task.upper_bound:
        return f"not admissible here: {largest[0]} = {largest[1]:.6g} is above the upper bound {task.upper_bound:.6g}"
    gain = 1 - optimum.objective / objective
    if not gain > SAME:
        return f"as good as the optimum: its f is {objective:.6g}"
    return (
        f"not the optimum: on the same constraints its f is {objective:.6g}, the optimum's is {100 * gain:.3g} % lower; "
        f"along l4 = l2 it changes by {slope:.4g} per unit of l2; the optimum has l2 = {optimum.design.l2:.6g}"
    )
