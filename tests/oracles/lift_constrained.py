"""Sets of constraints for the lift, and a differential evolution within them for comparison with the search of the product."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from synthesis.scenes.lift.constrained import DesignSpace
from synthesis.scenes.lift.constraints import OPTIONS, Constraints, minimum_slacks, slacks
from synthesis.scenes.lift.optimum import Evaluator, Objective, Task
from synthesis.scenes.lift.pose import Cylinder

POPULATION = 50
"""Number of members of the differential evolution for each variable."""
VIOLATION_PENALTY = 1e3
"""Penalty factor of the sum of the violations, relative to the logarithm of the objective."""
NAMES = ("l2", "l3", "l4", "l5", "b")


def limits(high: float, bound: float, closed: tuple[float, float], **changes: Any) -> Constraints:
    """Return the default constraints of the service for a stroke, with some of them changed."""
    settings: dict[str, Any] = {
        "extension_max": 1.8,
        "dead_point_min": 0.05,
        "acceleration_max": 1000.0,
        "jerk_max": 10_000.0,
        "envelope": (None, 0.0, None, None),
        "transmission_min": math.radians(30),
    }
    return Constraints({name: (0.1 * high, bound) for name in NAMES}, closed, **{**settings, **changes})


def cases() -> dict[str, tuple[Task, Constraints]]:
    """Return the default set and three further sets: a narrow frame, another stroke, and the collinear start."""
    stroke, normalized = (200.0, 510.0), Objective("normalized")
    return {
        "default": (Task(Cylinder(220.0, 100.0), *stroke, normalized, 600.0), limits(510.0, 600.0, (220.0, 600.0))),
        "narrow frame": (
            Task(Cylinder(220.0, 100.0), *stroke, normalized, 600.0),
            limits(
                510.0,
                600.0,
                (220.0, 600.0),
                envelope=(-550.0, 0.0, 50.0, 600.0),
                rise_time=(2.5, 4.0),
                force_ratio_max=1.2,
            ),
        ),
        "stroke 200 to 700": (
            Task(Cylinder(300.0, 150.0), 200.0, 700.0, Objective("continuous"), 900.0),
            limits(700.0, 900.0, (300.0, 900.0), acceleration_max=3000.0, jerk_max=100_000.0),
        ),
        "collinear start": (
            Task(Cylinder(220.0, 100.0), *stroke, normalized, 600.0),
            limits(
                510.0,
                600.0,
                (220.0, 600.0),
                start="collinear",
                extension_max=2.5,
                dead_point_min=0.01,
                jerk_max=1e5,
                acceleration_max=2000.0,
                transmission_min=math.radians(20),
            ),
        ),
    }


def evolution_optimum(task: Task, constraints: Constraints, evaluations: int) -> tuple[float, int]:
    """Return the smallest objective found by a differential evolution in the same variables, and its number of evaluations."""
    from scipy.optimize import differential_evolution

    space, evaluator = DesignSpace(task, constraints), Evaluator(task)
    best, count = math.inf, 0

    def cost(points: np.ndarray) -> np.ndarray:
        nonlocal best, count
        candidates = space.designs(points.T, np.ones(points.shape[1]))
        count += points.shape[1]
        slacks_by_name = minimum_slacks(slacks(candidates, task, constraints, OPTIONS.fine_nodes))
        violation = np.sum(
            [np.where(np.isfinite(slack), np.clip(-slack, 0.0, 1.0), 1.0) for slack in slacks_by_name.values()],
            axis=0,
        )
        value = evaluator.moments(candidates.design, candidates.gamma, candidates.closed_length)[0]
        admissible = (violation == 0) & np.isfinite(value)
        best = min(best, float(value[admissible].min())) if admissible.any() else best
        return (
            np.where(np.isfinite(value), np.log(np.where(np.isfinite(value), value, 1.0)), 20.0)
            + VIOLATION_PENALTY * violation
        )

    generations = max(1, evaluations // (POPULATION * space.count) - 1)
    differential_evolution(
        cost,
        [(0.0, 1.0)] * space.count,
        seed=7,
        popsize=POPULATION,
        maxiter=generations,
        tol=0.0,
        polish=False,
        vectorized=True,
        updating="deferred",
    )
    return best, count
