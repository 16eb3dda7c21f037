"""The lift's optimum design: even speed of the platform under the closure constraints.

For each l2 the admissible gammas are found as intervals with their ends, and each interval is searched from end to
end; an optimum *on* a constraint, the usual case, is therefore met exactly. The cylinder's speed is set to 1 within:
the objective is then scaled by its square, so speed cannot move the optimum.

Numbers in parentheses are the equations of the source named in `synthesis.lift.pose`; the two free variables are
explained in `synthesis.lift.objective`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from synthesis.errors import FieldError
from synthesis.lift.motion import travel_time
from synthesis.lift.objective import (
    HALVINGS,
    OPEN_END,
    Evaluator,
    Objective,
    Task,
    base_distance,
    design_from_angle,
    equation_residuals,
)
from synthesis.lift.pose import Cylinder, Design, dead_point, pose_at_turn, shape

ARM_NODES = 48
"""Values of l2 in each of the even and the geometric grid of the global search."""
ANGLE_NODES = 129
"""Values of gamma on which the admissible intervals are isolated."""
FIRST_LOOK, CLOSER_LOOK = 17, 9
"""Points across an interval at first, and at each closer look (which narrows it by a factor of four)."""
CAUSE_NODES, CAUSE_LOOKS, CLOSER_REACH = 65, 9, 6
"""Values of l2 when nothing is admissible and what must give way is looked for, the looks, and the nodes to either
side of the best one that a closer look keeps."""
INNER_LOOKS, OUTER_LOOKS = 9, 12
"""Closer looks over gamma and over l2."""
GLOBAL_LOOKS = 4
"""Closer looks over gamma while the valleys over l2 are only being told apart."""
CANDIDATES = 3
"""Local optima over l2 that are followed to the end."""
STRICT = 1e-9
"""Share of the top height by which l3 stays below l5, a strict inequality (36)."""
ACTIVE = 5e-7
"""A constraint is active when its slack is below this share of the top height, or of the bound that it is about."""
SEARCH_LIMIT = 100.0
"""Longest length that is searched, in units of the top height and the cylinder: in longer arms the last digit of a
length decides where the dead point is."""


@dataclass(frozen=True)
class Optimum:
    """The best design of a task, its objective, the active inequalities by name and the slacks of all of them."""

    design: Design
    objective: float
    active: tuple[str, ...]
    slacks: dict[str, float]
    equations: dict[str, float]
    duration: float
    velocity_bottom: float
    mean_velocity: float
    dead_point_length: float
    evaluations: int


def optimize(task: Task, checkpoint: Callable[[], object] = lambda: None) -> Optimum:
    """The global optimum of a task; deterministic, no random start.

    Global: the best gamma for each of about a hundred values of l2 (even and geometric grid). Local: the best few
    valleys are narrowed around their best l2, each value again with its best gamma. ``checkpoint`` is called all the
    time; what it raises ends the search.

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
    return _answer(_optimize_at_unit_speed(unit, checkpoint), unit, task)


def optimize_batch(
    tasks: Sequence[Task], checkpoint: Callable[[], object] = lambda: None
) -> list[Optimum | FieldError]:
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
                known[unit] = _optimize_at_unit_speed(unit, checkpoint)
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
        duration=found.duration / speed,
        velocity_bottom=found.velocity_bottom * speed,
        mean_velocity=found.mean_velocity * speed,
    )


def _optimize_at_unit_speed(task: Task, checkpoint: Callable[[], object]) -> Optimum:
    checkpoint()  # one without an admissible design evaluates nothing
    drive = task.cylinder
    evaluator = Evaluator(task, checkpoint)
    low, high = _arm_range(task)
    span = high - low
    if not span > 0:
        raise _infeasible(task)
    even = low + span * np.linspace(OPEN_END, 1.0, ARM_NODES)
    arms = np.union1d(even, low + np.geomspace(min(1e-3 * task.high, 0.5 * span), span, ARM_NODES))
    arms[-1] = high
    values, gammas = _best_angles(arms, evaluator, GLOBAL_LOOKS)
    if not np.any(np.isfinite(values)):
        arms = np.union1d(arms, _roomiest_arm(task))
        values, gammas = _best_angles(arms, evaluator, GLOBAL_LOOKS)
    padded = np.concatenate([[np.inf], values, [np.inf]])
    valleys = np.nonzero(np.isfinite(values) & (values <= padded[:-2]) & (values <= padded[2:]))[0]
    valleys = valleys[np.argsort(values[valleys], kind="stable")][:CANDIDATES]
    for value, arm, gamma in sorted(_narrow(arms, values, gammas, int(at), evaluator) for at in valleys):
        design = _plain(design_from_angle(arm, gamma, drive.length, task.low, task.high))
        turn_dead = float(dead_point(design))
        if np.isfinite(value) and turn_dead > np.arctan2(design.b, task.low) + gamma:
            break
    else:
        raise _infeasible(task)
    slacks = {name: float(slack) for name, slack in _slacks(design, task).items()}
    _, mean = evaluator.moments(design, gamma)
    travel = float(_travel(design, task))
    at_bottom = 1.0 if drive.speed > 0 else _final_speed(travel, drive)
    return Optimum(
        design=design,
        objective=float(value),
        active=_active(slacks, gamma, design.l2, task),
        slacks=slacks,
        equations=equation_residuals(design, drive.length, task.low, task.high),
        duration=float(travel_time(travel, drive.speed, drive.acceleration)),
        # the start is collinear, so that B moves along the line OA
        velocity_bottom=float(drive.speed * at_bottom * (drive.length + design.l2) / task.low),
        mean_velocity=float(mean),
        dead_point_length=float(pose_at_turn(design, turn_dead).length),
        evaluations=evaluator.evaluations,
    )


def _active(slacks: dict[str, float], gamma: float, arm: float, task: Task) -> tuple[str, ...]:
    """Names of the inequalities that hold the optimum; the open ends of gamma are met to `OPEN_END`."""
    scales = {name: task.upper_bound if "bound" in name else task.high for name in slacks}
    names = [name for name, slack in slacks.items() if slack <= ACTIVE * scales[name] and name != "triangle"]
    share = gamma / float(_angle_limit(np.float64(arm), task))
    if share <= 2 * OPEN_END:
        names.insert(0, "triangle")
    if share >= 1 - 2 * OPEN_END:
        names.insert(0, "start_turn<pi")
    return tuple(names)


def _plain(design: Design) -> Design:
    return Design(*(float(value) for value in design.as_tuple()))


def _final_speed(travel: float, drive: Cylinder) -> float:
    square = drive.speed**2 + 2 * drive.acceleration * float(np.sign(drive.speed)) * travel
    return float(np.sqrt(max(square, 0.0)))


def _slacks(design: Design, task: Task) -> dict[str, np.ndarray]:
    """Slack of each inequality as a length, negative where it fails."""
    bound = task.upper_bound
    slacks = {
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
        slacks["stopping"] = drive.speed**2 / (-2 * along) - _travel(design, task)
    return slacks


def _travel(design: Design, task: Task) -> np.ndarray:
    form = shape(design)
    x, y = design.b + design.l2 * form.sin_gamma, task.high - design.l2 * form.cos_gamma
    return np.hypot(x, y) - task.cylinder.length


def check_task(task: Task) -> None:
    """Refuse what no search is needed for: a cylinder at rest, or a stroke that does not rise."""
    if task.cylinder.speed == 0:
        raise FieldError(
            "/cylinder/speed", "the cylinder stands still: its speed must not be 0", constraint="speed", amount=0.0
        )
    if not task.low < task.high:
        raise FieldError(
            "/stroke",
            f"the stroke must rise: {task.low:.9g} is not below {task.high:.9g}",
            constraint="stroke",
            amount=task.low - task.high,
        )


def _arm_range(task: Task) -> tuple[float, float]:
    """The open lower and closed upper end of l2: b real in (31), and l2 and b within the bound."""
    length, bound = task.cylinder.length, task.upper_bound
    reach = np.hypot(bound, task.low)
    return max(task.low - length, 0.0), min(bound, reach - length)


def _angle_limit(arms: np.ndarray, task: Task) -> np.ndarray:
    """Upper end of gamma: the start turn psi + gamma stays below a half turn, or the platform would fall first."""
    return np.pi - np.arctan2(base_distance(arms, task.cylinder.length, task.low), task.low)


def _room(arms: np.ndarray, gammas: np.ndarray, task: Task) -> np.ndarray:
    """The least slack of the inequalities that depend on gamma; those of l2 alone are kept by its range."""
    design = design_from_angle(arms, gammas, task.cylinder.length, task.low, task.high)
    slacks = _slacks(design, task)
    del slacks["l2<=upper_bound"], slacks["b<=upper_bound"], slacks["triangle"]  # the last by the range of gamma
    slacks["l3<l5"] = slacks["l3<l5"] - STRICT * task.high
    return np.minimum.reduce(list(slacks.values()))


def _intervals(arms: np.ndarray, task: Task) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The admissible intervals of gamma as (index into arms, lower end, upper end); ends by halving, inside."""
    limit = _angle_limit(arms, task)
    gammas = np.linspace(OPEN_END, 1 - OPEN_END, ANGLE_NODES) * limit[:, None]
    inside = _room(arms[:, None], gammas, task) >= 0
    # an interval narrower than the grid shows as a peak of the slack: add the peak's top to the nodes
    missing = np.nonzero(~inside.any(axis=1))[0]
    if missing.size:
        some = arms[missing]
        left, right = gammas[missing, 0], gammas[missing, -1]
        for _ in range(INNER_LOOKS):
            looks = np.linspace(left, right, ANGLE_NODES, axis=1)
            best = np.argmax(_room(some[:, None], looks, task), axis=1)
            pick = np.arange(missing.size)
            middle = looks[pick, best]
            left, right = looks[pick, np.maximum(best - 1, 0)], looks[pick, np.minimum(best + 1, ANGLE_NODES - 1)]
        slot = np.clip(np.sum(gammas[missing] < middle[:, None], axis=1), 0, ANGLE_NODES - 1)
        gammas[missing, slot] = middle
        inside[missing, slot] = _room(some, middle, task) >= 0
    edge = np.zeros((arms.size, 1), dtype=bool)
    steps = np.diff(np.concatenate([edge, inside, edge], axis=1).astype(np.int8), axis=1)
    row, first = np.nonzero(steps == 1)
    _, after = np.nonzero(steps == -1)
    lower = _edge(arms[row], gammas[row, np.maximum(first - 1, 0)], gammas[row, first], task)
    upper = _edge(arms[row], gammas[row, np.minimum(after, ANGLE_NODES - 1)], gammas[row, after - 1], task)
    return row, lower, upper


def _edge(arms: np.ndarray, outside: np.ndarray, inside: np.ndarray, task: Task) -> np.ndarray:
    """The admissible end between an inadmissible and an admissible gamma, to the last bit."""
    for _ in range(HALVINGS):
        middle = 0.5 * (outside + inside)
        admissible = _room(arms, middle, task) >= 0
        outside, inside = np.where(admissible, outside, middle), np.where(admissible, middle, inside)
    return inside


def _best_angles(arms: np.ndarray, evaluator: Evaluator, closer: int) -> tuple[np.ndarray, np.ndarray]:
    """The least objective over the admissible gammas, and that gamma, for each l2; infinite where there is none."""
    task = evaluator.task
    values, gammas = np.full(arms.shape, np.inf), np.zeros(arms.shape)
    row, left, right = _intervals(arms, task)
    if not row.size:
        return values, gammas
    pick = np.arange(row.size)
    for look in range(1 + closer):
        count = FIRST_LOOK if look == 0 else CLOSER_LOOK
        looks = np.linspace(left, right, count, axis=1)
        tried = evaluator(
            design_from_angle(arms[row][:, None], looks, task.cylinder.length, task.low, task.high), looks
        )
        best = np.argmin(tried, axis=1)
        left, right = looks[pick, np.maximum(best - 1, 0)], looks[pick, np.minimum(best + 1, count - 1)]
    found, at = tried[pick, best], looks[pick, best]
    for index in range(row.size):
        if found[index] < values[row[index]]:
            values[row[index]], gammas[row[index]] = found[index], at[index]
    return values, gammas


def _narrow(
    arms: np.ndarray, values: np.ndarray, gammas: np.ndarray, at: int, evaluator: Evaluator
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


def _roomiest_arm(task: Task) -> float:
    """The l2 at which the inequalities leave most room: where to look when no node of the grid is admissible."""
    low, high = _arm_range(task)
    shares = (OPEN_END, 1 - OPEN_END)
    arms = (low + OPEN_END * (high - low), high)
    for _ in range(CAUSE_LOOKS):
        tall, wide = np.linspace(*arms, ANGLE_NODES), np.linspace(*shares, ANGLE_NODES)
        room = _room(tall[:, None], wide * _angle_limit(tall, task)[:, None], task)
        row, column = np.unravel_index(int(np.argmax(room)), room.shape)
        arms, shares = _around(tall, int(row)), _around(wide, int(column))
    return float(tall[row])


def _around(nodes: np.ndarray, at: int) -> tuple[float, float]:
    """The neighbourhood of a node for a closer look; wide, for the best point may sit in the tip of a wedge."""
    return float(nodes[max(at - CLOSER_REACH, 0)]), float(nodes[min(at + CLOSER_REACH, nodes.size - 1)])


def _infeasible(task: Task) -> FieldError:
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
        worst = _least_violation(task, relaxed, yielding)
        if worst is None or worst[1] <= 0:
            continue
        name, amount = worst
        if name == "stopping":
            text = f"the cylinder comes to rest at least {amount:.9g} before the end of every admissible design"
            return FieldError("/cylinder/acceleration", text, constraint=name, amount=amount)
        text = f"no design reaches this stroke within {task.upper_bound:.9g}: {name} fails by at least {amount:.9g}"
        return FieldError("/upper_bound", text, constraint=name, amount=amount)
    return FieldError(
        "/stroke",
        "no design reaches this stroke without passing a dead point of the cylinder, or starting on one",
        constraint="dead_point",
        amount=0.0,
    )


def _least_violation(task: Task, relaxed: Task, yielding: Sequence[str]) -> tuple[str, float] | None:
    """The least by which `yielding` inequalities of a task fail in designs of the relaxed task, and the worst one."""
    length = task.cylinder.length
    # whether a design passes a dead point does not depend on the drive
    drive = Cylinder(length, task.cylinder.speed)
    works = Evaluator(replace(relaxed, cylinder=drive, objective=Objective("continuous")))
    low, high = _arm_range(relaxed)
    if not high > low:
        return None
    shares = (OPEN_END ** (1 / 4), 1.0)
    found = None
    for _ in range(CAUSE_LOOKS):
        nodes = np.linspace(*shares, CAUSE_NODES)
        arms = low + (high - low) * nodes**4  # short arms are where it matters
        row, left, right = _intervals(arms, relaxed)
        gammas = np.linspace(left, right, FIRST_LOOK, axis=1)
        design = design_from_angle(arms[row][:, None], gammas, length, task.low, task.high)
        slacks = _slacks(design, task)
        given = [name for name in yielding if name in slacks]
        if not given or not row.size:
            return found
        violation = np.maximum.reduce([np.broadcast_to(-slacks[name], gammas.shape) for name in given])
        violation = np.where(np.isfinite(works(design, gammas)), violation, np.inf)
        at, column = np.unravel_index(int(np.argmin(violation)), violation.shape)
        if not np.isfinite(violation[at, column]):
            return found
        worst = max(given, key=lambda name: -float(np.broadcast_to(slacks[name], gammas.shape)[at, column]))
        if found is None or violation[at, column] < found[1]:
            found = worst, float(violation[at, column])
        shares = _around(nodes, int(row[at]))
    return found
