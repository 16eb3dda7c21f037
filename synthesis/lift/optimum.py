"""The lift's optimum design: even speed of the platform under the closure constraints; the published designs beside it.

For each l2 the admissible gammas are found as intervals with their ends, and each interval is searched from end to
end; an optimum *on* a constraint, the usual case, is therefore met exactly. The cylinder's speed is set to 1 within:
the objective is then scaled by its square, so speed cannot move the optimum.

Table 2 of the source has eleven published designs (its digits in tests/reference). A printed design is rounded to 0.1, which
alone moves its objective by more than the optimum gains; it is therefore put back on its constraints (31)-(33) first.

Numbers in parentheses are the equations of the source named in `synthesis.lift.pose`; the two free variables are
explained in `synthesis.lift.objective`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from synthesis.errors import FieldError
from synthesis.lift.objective import (
    OPEN_END,
    SEARCH_LIMIT,
    Built,
    Evaluator,
    Optimum,
    Task,
    active_inequalities,
    arm_range,
    check_task,
    design_from_angle,
    equation_residuals,
    inequality_slacks,
    infeasible,
    intervals,
    project,
    roomiest_arm,
)
from synthesis.lift.pose import Cylinder, Design, dead_point, pose_at_height
from synthesis.one_variable import Floats, closer_looks
from synthesis.work import Work

ARM_NODES = 48
"""Values of l2 in each of the even and the geometric grid of the global search."""
FIRST_LOOK, CLOSER_LOOK = 17, 9
"""Points across an interval at first, and at each closer look (which narrows it by a factor of four)."""
INNER_LOOKS, OUTER_LOOKS = 9, 12
"""Closer looks over gamma and over l2."""
GLOBAL_LOOKS = 4
"""Closer looks over gamma while the valleys over l2 are only being told apart."""
CANDIDATES = 3
"""Local optima over l2 that are followed to the end."""


def optimize(task: Task, work: Work | None = None) -> Optimum:
    """The global optimum of a task; deterministic, no random start.

    Global: the best gamma for each of about a hundred values of l2 (even and geometric grid). Local: the best few
    valleys are narrowed around their best l2, each value again with its best gamma. ``work`` is asked
    between steps whether the answer is still wanted.

    Raises
    ------
    FieldError
        Where no design is admissible: ``constraint`` names the inequality that must give way (a bound, or
        ``stopping``: the cylinder comes to rest) and ``amount`` by how much at least; all others can then hold.

    Laws: the objective is not above that of any admissible design; it scales with the square of the speed, and the
    design does not change with it; scaling all lengths scales the design.
    """
    check_task(task)
    unit = _unit_task(task)
    return _answer(_optimize_at_unit_speed(unit, work or Work()), unit, task)


def optimize_batch(tasks: Sequence[Task], work: Work | None = None) -> list[Optimum | FieldError]:
    """The optima of many tasks, each or the error that says why there is none.

    Tasks that differ only in the time scale (same a / v^2) share one search.
    Law: equal to `optimize` of each task, to the last bit.
    """
    known: dict[Task, Optimum | FieldError] = {}
    results: list[Optimum | FieldError] = []
    for task in tasks:
        try:
            check_task(task)
        except FieldError as error:
            results.append(error)
            continue
        unit = _unit_task(task)
        if unit not in known:
            try:
                known[unit] = _optimize_at_unit_speed(unit, work or Work())
            except FieldError as error:
                known[unit] = error
        found = known[unit]
        if isinstance(found, Optimum):
            found = _answer(found, unit, task)
        results.append(found)
    return results


def _unit_task(task: Task) -> Task:
    """The same task with time in units of 1 / speed, and with the bound that the search can resolve."""
    drive = task.cylinder
    speed = abs(float(drive.speed))
    unit = Cylinder(float(drive.length), float(np.sign(drive.speed)), float(drive.acceleration) / speed / speed)
    bound = min(task.upper_bound, SEARCH_LIMIT * (task.high + drive.length))
    return Task(unit, float(task.low), float(task.high), task.objective, float(bound))


def _answer(found: Optimum, unit: Task, task: Task) -> Optimum:
    """An optimum found at unit speed, at the task's: the platform's speed is linear in the cylinder's.

    Where the search's own limit took the place of a larger bound, the inequalities are named after it.
    """
    speed = abs(float(task.cylinder.speed))
    bound = "search_limit" if unit.upper_bound < task.upper_bound else "upper_bound"
    return replace(
        found,
        objective=found.objective * (1.0 if task.objective.kind == "normalized" else speed * speed),
        active=tuple(name.replace("upper_bound", bound) for name in found.active),
        slacks={name.replace("upper_bound", bound): slack for name, slack in found.slacks.items()},
        mean_velocity=found.mean_velocity * speed,
    )


def _optimize_at_unit_speed(task: Task, work: Work) -> Optimum:
    work.go_on()  # one without an admissible design evaluates nothing
    drive = task.cylinder
    evaluator = Evaluator(task, work)
    low, high = arm_range(task)
    span = high - low
    if not span > 0:
        raise infeasible(task)
    even = low + span * np.linspace(OPEN_END, 1.0, ARM_NODES)
    arms = np.union1d(even, low + np.geomspace(min(1e-3 * task.high, 0.5 * span), span, ARM_NODES))
    arms[-1] = high
    values, gammas = _best_angles(arms, evaluator, GLOBAL_LOOKS)
    if not np.any(np.isfinite(values)):
        arms = np.union1d(arms, roomiest_arm(task))
        values, gammas = _best_angles(arms, evaluator, GLOBAL_LOOKS)
    padded = np.concatenate([[np.inf], values, [np.inf]])
    valleys = np.nonzero(np.isfinite(values) & (values <= padded[:-2]) & (values <= padded[2:]))[0]
    valleys = valleys[np.argsort(values[valleys], kind="stable")][:CANDIDATES]
    for value, arm, gamma in sorted(_narrow(arms, values, gammas, int(at), evaluator) for at in valleys):
        fields = design_from_angle(arm, gamma, drive.length, task.low, task.high).as_tuple()
        design = Design(*(float(field) for field in fields))
        built = Built(design, gamma, float(pose_at_height(design, task.low).turn), drive.length)
        if np.isfinite(value) and dead_point(design) > built.turn:
            break
    else:
        raise infeasible(task)
    slacks = {name: float(slack) for name, slack in inequality_slacks(design, task).items()}
    return Optimum(
        built,
        objective=float(value),
        mean_velocity=float(evaluator.moments(design, gamma)[1]),
        active=active_inequalities(slacks, gamma, design.l2, task),
        slacks=slacks,
        equations=equation_residuals(design, drive.length, task.low, task.high),
        evaluations=evaluator.evaluations,
    )


def _best_angles(arms: Floats, evaluator: Evaluator, closer: int) -> tuple[Floats, Floats]:
    """The least objective over the admissible gammas, and that gamma, for each l2; infinite where there is none."""
    task = evaluator.task
    values, gammas = np.full(arms.shape, np.inf), np.zeros(arms.shape)
    row, left, right = intervals(arms, task)
    if not row.size:
        return values, gammas

    def objective(looks: Floats) -> Floats:
        design = design_from_angle(arms[row][:, None], looks, task.cylinder.length, task.low, task.high)
        return np.asarray(evaluator(design, looks))

    found, at = closer_looks(objective, left, right, (FIRST_LOOK, *(CLOSER_LOOK,) * closer))
    for index in range(row.size):
        if found[index] < values[row[index]]:
            values[row[index]], gammas[row[index]] = found[index], at[index]
    return values, gammas


def _narrow(
    arms: Floats, values: Floats, gammas: Floats, at: int, evaluator: Evaluator
) -> tuple[float, float, float]:
    """The best (objective, l2, gamma) of the valley around one value of l2, by closer and closer looks."""
    best = (float(values[at]), float(arms[at]), float(gammas[at]))
    left, right = arms[max(at - 1, 0)], arms[min(at + 1, arms.size - 1)]
    for _ in range(OUTER_LOOKS):
        looks = np.union1d(np.linspace(left, right, CLOSER_LOOK), best[1])
        tried, angles = _best_angles(looks, evaluator, INNER_LOOKS)
        index = int(np.argmin(tried))
        best = min(best, (float(tried[index]), float(looks[index]), float(angles[index])))
        step = (right - left) / (CLOSER_LOOK - 1)
        left, right = max(best[1] - step, left), min(best[1] + step, right)
    return best


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
    """The published design, put back on the constraints that its printed digits miss by their rounding."""

    design: Design
    objective: float
    slope: float
    """df/dl2 along l4 = l2."""
    reason: str
    source: Literal["printed", "fitted"]
    """Fitted: a digit that is lost in print is inferred."""


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
