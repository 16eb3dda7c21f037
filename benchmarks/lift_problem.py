"""The lifting problem of the benchmark: the published designs, the cylinder, and the stroke."""

from __future__ import annotations

import json

from benchmarks import report
from synthesis.lift.objective import Objective, Task
from synthesis.lift.pose import Cylinder, Design

REFERENCE = json.loads((report.ROOT / "tests/reference/lift_acceptance.json").read_text())
DESIGNS = {
    "initial": Design(*REFERENCE["designs"]["initial"]),
    "published": Design(*REFERENCE["designs"]["optimum"]),
}
CYLINDER = Cylinder(220.0, 100.0)
STROKE = (200.0, 510.0)
POSES = 57_201
"""Of one motion in closed form."""


def task(objective: Objective, bound: float = 600.0, cylinder: Cylinder = CYLINDER) -> Task:
    """The published problem with another objective, bound or cylinder."""
    return Task(cylinder, *STROKE, objective, bound)
