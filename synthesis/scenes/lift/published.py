"""Published designs of the lift, projected onto the constraints of the source for a comparison with the optimum.

Table 2 of the source has eleven published designs (digits in tests/reference). Rounding a printed design to 0.1
changes its objective by more than the optimum improves it. A published design is therefore first projected onto
the equations (31)-(33) of the source named in `synthesis.scenes.lift.pose`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from synthesis.scenes.lift.optimum import OPTIONS, Evaluator, Optimum, Task, project
from synthesis.scenes.lift.pose import (
    Design,
)

STROKE = (200.0, 510.0)
"""Heights of the published designs at the start and at the top, mm."""
ARMS = {200.0: 347.4, 210.0: 353.9, 220.0: 351.9, 230.0: 348.9, 240.0: 356.3, 250.0: 354.6}
"""Printed l2 = l4 by cylinder length l1', mm."""
FITTED_LENGTHS = (250.0,)
"""Cylinder lengths with an incompletely printed arm. Two digits are lost; (31) gives them from the printed b."""


@dataclass(frozen=True)
class Published:
    """The published design, projected onto the constraints that its rounded digits violate."""

    design: Design
    """The five lengths."""
    objective: float
    """Value of the objective."""
    slope: float
    """df/dl2 along l4 = l2."""
    reason: str
    """Comparison with the optimum, in words."""
    source: Literal["printed", "fitted"]
    """"fitted" if a digit lost in print has been inferred, otherwise "printed"."""


def published_for(task: Task, optimum: Optimum) -> Published | None:
    """Return the published design for a task.

    Parameters
    ----------
    task : Task
    optimum : Optimum
        Optimum of the task, for comparison.

    Returns
    -------
    Published or None
        None if the source has no design for this stroke and cylinder length.
    """
    if not np.allclose((task.low, task.high), STROKE, rtol=OPTIONS.equality_tolerance, atol=0.0):
        return None
    length = min(ARMS, key=lambda known: abs(known - task.cylinder.length))
    if abs(length - task.cylinder.length) > OPTIONS.equality_tolerance * length:
        return None
    arm = ARMS[length]
    step = OPTIONS.slope_step * arm
    arms = np.array([arm - step, arm, arm + step])
    designs = project(arms, arms, task.cylinder.length, task.low, task.high)
    values = Evaluator(task)(designs)
    if not np.all(np.isfinite(values)):
        return None
    design = Design(*(float(value[1]) for value in designs.as_tuple()))
    objective, slope = float(values[1]), float((values[2] - values[0]) / (2 * step))
    reason = _reason(task, optimum, design, objective, slope)
    return Published(design, objective, slope, reason, "fitted" if length in FITTED_LENGTHS else "printed")


def _reason(task: Task, optimum: Optimum, design: Design, objective: float, slope: float) -> str:
    largest = max(design.as_dict().items(), key=lambda entry: entry[1])
    if largest[1] > task.upper_bound:
        return f"not admissible here: {largest[0]} = {largest[1]:.6g} is above the upper bound {task.upper_bound:.6g}"
    gain = 1 - optimum.objective / objective
    if not gain > OPTIONS.equality_tolerance:
        return f"as good as the optimum: its f is {objective:.6g}"
    return (
        f"not the optimum: on the same constraints its f is {objective:.6g}, the optimum's is {100 * gain:.3g} % lower; "
        f"along l4 = l2 it changes by {slope:.4g} per unit of l2; the optimum has l2 = {optimum.design.l2:.6g}"
    )
