"""Which designs of the lift are admissible, and what must give way where none is.

Numbers in parentheses are the equations of the source named in `synthesis.lift.pose`; the two free variables, l2 and
gamma, are explained in `synthesis.lift.objective`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError
from synthesis.lift.motion import check_speed, refusal
from synthesis.lift.objective import (
    HALVINGS,
    OPEN_END,
    Evaluator,
    Objective,
    Task,
    angle_limit,
    design_from_angle,
)
from synthesis.lift.pose import Cylinder, Design, shape, top_length
from synthesis.one_variable import Floats, bisect, closer_looks

ANGLE_NODES = 129
"""Values of gamma on which the admissible intervals are isolated."""
PEAK_LOOKS = 9
"""Closer looks for an interval that is narrower than these nodes are apart."""
STRICT = 1e-9
"""Share of the top height by which l3 stays below l5, a strict inequality (36)."""
ACTIVE = 5e-7
"""A constraint is active when its slack is below this share of the top height, or of the bound that it is about."""
SEARCH_LIMIT = 100.0
"""Longest length that is searched, in units of the top height and the cylinder: in longer arms the last digit of a
length decides where the dead point is."""
CAUSE_NODES, CAUSE_ANGLES, CAUSE_LOOKS, CLOSER_REACH = 65, 17, 9, 6
"""Values of l2 and of gamma when nothing is admissible and what must give way is looked for, the looks, and the nodes
to either side of the best one that a closer look keeps: wide, for it may sit in the tip of a wedge."""


def check_task(task: Task) -> None:
    """Refuse what no search is needed for: a cylinder at rest, or a stroke that does not rise.

    Raises
    ------
    FieldError
        With ``constraint`` ``speed`` or ``stroke``.
    """
    check_speed(task.cylinder)
    if not task.low < task.high:
        message = f"the stroke must rise: {task.low:.9g} is not below {task.high:.9g}"
        raise refusal("stroke", "/stroke", task.low - task.high, message)


def travel_to_top(design: Design, task: Task) -> Any:
    """The way of the cylinder from its start to the top."""
    return top_length(design, shape(design)) - task.cylinder.length


def inequality_slacks(design: Design, task: Task) -> dict[str, Any]:
    """Slack of each inequality as a length, negative where it fails."""
    bound = task.upper_bound
    found = {
        "triangle": np.minimum(design.l4 - np.abs(design.l2 - design.l3), design.l2 + design.l3 - design.l4),
        "l3<l5": design.l5 - design.l3,
        "l3<=l2": design.l2 - design.l3,
        "l4<=l2": design.l2 - design.l4,
        "l2<=upper_bound": bound - design.l2,
        "l5<=upper_bound": bound - design.l5,
        "b<=upper_bound": bound - design.b,
    }
    drive = task.cylinder
    along = drive.acceleration * np.sign(drive.speed)
    if along < 0:
        found["stopping"] = drive.speed**2 / (-2 * along) - travel_to_top(design, task)
    return found


def active_inequalities(found: dict[str, float], gamma: float, arm: float, task: Task) -> tuple[str, ...]:
    """Names of the inequalities that hold a design, from its slacks; the open ends of gamma are met to `OPEN_END`."""
    scales = {name: task.upper_bound if "bound" in name else task.high for name in found}
    names = [name for name, slack in found.items() if slack <= ACTIVE * scales[name] and name != "triangle"]
    share = gamma / float(angle_limit(arm, task.cylinder.length, task.low))
    if share <= 2 * OPEN_END:
        names.insert(0, "triangle")
    if share >= 1 - 2 * OPEN_END:
        names.insert(0, "start_turn<pi")
    return tuple(names)


def arm_range(task: Task) -> tuple[float, float]:
    """The open lower and closed upper end of l2: b real in (31), and l2 and b within the bound."""
    length, bound = task.cylinder.length, task.upper_bound
    reach = float(np.hypot(bound, task.low))
    return max(task.low - length, 0.0), min(bound, reach - length)


def _room(arms: Floats, gammas: Floats, task: Task) -> Floats:
    """The least slack of the inequalities that depend on gamma; those of l2 alone are kept by its range."""
    design = design_from_angle(arms, gammas, task.cylinder.length, task.low, task.high)
    found = inequality_slacks(design, task)
    del found["l2<=upper_bound"], found["b<=upper_bound"], found["triangle"]  # the last by the range of gamma
    found["l3<l5"] = found["l3<l5"] - STRICT * task.high
    return np.asarray(np.minimum.reduce(list(found.values())))


def intervals(arms: Floats, task: Task) -> tuple[NDArray[np.intp], Floats, Floats]:
    """The admissible intervals of gamma as (index into arms, lower end, upper end); ends by halving, inside."""
    limit = angle_limit(arms, task.cylinder.length, task.low)
    gammas = np.linspace(OPEN_END, 1 - OPEN_END, ANGLE_NODES) * limit[:, None]
    inside = _room(arms[:, None], gammas, task) >= 0
    # an interval narrower than the grid shows as a peak of the slack: add the peak's top to the nodes
    missing = np.nonzero(~inside.any(axis=1))[0]
    if missing.size:
        some = arms[missing][:, None]
        ends = gammas[missing, 0], gammas[missing, -1]
        shortage, top = closer_looks(lambda looks: -_room(some, looks, task), *ends, (ANGLE_NODES,) * PEAK_LOOKS)
        slot = np.clip(np.sum(gammas[missing] < top[:, None], axis=1), 0, ANGLE_NODES - 1)
        gammas[missing, slot] = top
        inside[missing, slot] = shortage <= 0
    edge = np.zeros((arms.size, 1), dtype=bool)
    steps = np.diff(np.concatenate([edge, inside, edge], axis=1).astype(np.int8), axis=1)
    row, first = np.nonzero(steps == 1)
    _, after = np.nonzero(steps == -1)

    def end(at: NDArray[np.intp], beyond: NDArray[np.intp]) -> Floats:
        outside = gammas[row, np.clip(beyond, 0, ANGLE_NODES - 1)]
        return bisect(lambda gamma: _room(arms[row], gamma, task) >= 0, gammas[row, at], outside, HALVINGS)[0]

    return row, end(first, first - 1), end(after - 1, after)


def roomiest_arm(task: Task) -> float:
    """The l2 at which the inequalities leave most room: where to look when no node of the grid is admissible."""
    low, high = arm_range(task)
    shares = (OPEN_END, 1 - OPEN_END)
    arms = (low + OPEN_END * (high - low), high)
    for _ in range(CAUSE_LOOKS):
        tall, wide = np.linspace(*arms, ANGLE_NODES), np.linspace(*shares, ANGLE_NODES)
        gammas = wide * angle_limit(tall, task.cylinder.length, task.low)[:, None]
        room = _room(tall[:, None], gammas, task)
        row, column = np.unravel_index(int(np.argmax(room)), room.shape)
        arms, shares = _around(tall, int(row)), _around(wide, int(column))
    return float(tall[row])


def _around(nodes: Floats, at: int) -> tuple[float, float]:
    """The neighbourhood of a node for a closer look."""
    return float(nodes[max(at - CLOSER_REACH, 0)]), float(nodes[min(at + CLOSER_REACH, nodes.size - 1)])


def infeasible(task: Task) -> FieldError:
    """The error that names what must give way, and by how much at least."""
    drive = task.cylinder
    steady = replace(task, cylinder=Cylinder(drive.length, drive.speed))
    wide = SEARCH_LIMIT * (task.high + drive.length)
    bounds = ("l2<=upper_bound", "l5<=upper_bound", "b<=upper_bound")
    for relaxed, yielding in (
        (steady, ("stopping",)),
        (replace(task, upper_bound=wide), bounds),
        (replace(steady, upper_bound=wide), ("stopping", *bounds)),
    ):
        name, amount = _least_violation(task, relaxed, yielding)
        if not 0 < amount < np.inf:
            continue
        if name == "stopping":
            message = f"the cylinder comes to rest at least {amount:.9g} before the end of every admissible design"
            return refusal(name, "/cylinder/acceleration", amount, message)
        bound = f"{task.upper_bound:.9g}: {name} fails by at least {amount:.9g}"
        return refusal(name, "/upper_bound", amount, f"no design reaches this stroke within {bound}")
    message = "no design reaches this stroke without passing a dead point of the cylinder, or starting on one"
    return refusal("dead_point", "/stroke", 0.0, message)


def _least_violation(task: Task, relaxed: Task, yielding: Sequence[str]) -> tuple[str, float]:
    """The least by which `yielding` inequalities of a task fail in designs of the relaxed task, and the worst one.

    Infinite where no design of the relaxed task lifts.
    """
    # whether a design passes a dead point does not depend on the drive's acceleration
    drive = Cylinder(task.cylinder.length, task.cylinder.speed)
    works = Evaluator(replace(relaxed, cylinder=drive, objective=Objective("continuous")))
    low, high = arm_range(relaxed)
    least = ("", np.inf)
    shares = (OPEN_END ** (1 / 4), 1.0)
    for _ in range(CAUSE_LOOKS if high > low else 0):
        nodes = np.linspace(*shares, CAUSE_NODES)
        arms = low + (high - low) * nodes**4  # short arms are where it matters
        row, left, right = intervals(arms, relaxed)
        gammas = np.linspace(left, right, CAUSE_ANGLES, axis=1)
        design = design_from_angle(arms[row][:, None], gammas, drive.length, task.low, task.high)
        found = inequality_slacks(design, task)
        given = {name: np.broadcast_to(-found[name], gammas.shape) for name in yielding if name in found}
        if not given or not row.size:
            break
        violation = np.maximum.reduce(list(given.values()))
        violation = np.where(np.isfinite(works(design, gammas)), violation, np.inf)
        at = np.unravel_index(int(np.argmin(violation)), violation.shape)
        if not np.isfinite(violation[at]):
            break
        if violation[at] < least[1]:
            least = max(given, key=lambda name: float(given[name][at])), float(violation[at])
        shares = _around(nodes, int(row[at[0]]))
    return least
