"""The lift's optimum design: even speed of the platform under the closure constraints; the published designs beside it.

For each l2 the admissible gammas are found as intervals with their ends, and each interval is searched from end to
end; an optimum *on* a constraint, the usual case, is therefore met exactly. The cylinder's speed is set to 1 within:
the objective is then scaled by its square, so speed cannot move the optimum.

Table 2 of the source has eleven published designs (its digits in tests/reference). A printed design is rounded to 0.1, which
alone moves its objective by more than the optimum gains; it is therefore put back on its constraints (31)-(33) first.

In l2 and gamma (the triangle's angle at A) the equations (31) collinear start, (32) closure there and (33) stroke are
solved *explicitly*. At the start A, B, O lie on a line, so with psi = atan2(b, sa) the start turn is
theta = psi + gamma; and l3 + l5 = sb says that C lies on an ellipse with foci A and D, whose polar form about A is
l3 = (sb^2 - sa^2) / (2 (sb - sa cos theta)). No equation is left to a penalty.

Numbers in parentheses are the equations of the source named in `synthesis.scenes.lift.pose`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError
from synthesis.one_variable import EPSILON, Floats, bisect, closer_looks
from synthesis.scenes.lift.motion import check_speed, refusal, travel_time, velocity
from synthesis.scenes.lift.pose import (
    Cylinder,
    Design,
    Pose,
    angle_or_flat,
    by_blocks,
    dead_point,
    pose_at_height,
    pose_at_turn,
    shape,
    third_side,
    top_length,
    top_lever,
    triangle_angle,
)
from synthesis.work import Work

# -- designs on the constraints and their objective ---------------------------------------------------------------------

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
SLOPE_STEP = 1e-4
"""Step of the slope along l4 = l2, as a share of l2."""
SAME = 1e-9
"""Share by which a stroke or a length may differ from the table's."""


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


@dataclass(frozen=True)
class Built:
    """Designs that meet the stroke, with the triangle's angle gamma at A, the turn at the start and the closed length."""

    design: Design
    gamma: Any
    turn: Any
    closed: Any

    def taken(self, rows: Any) -> Built:
        """Some of them."""
        fields = (np.asarray(value)[rows] for value in (*self.design.as_tuple(), self.gamma, self.turn, self.closed))
        *lengths, gamma, turn, closed = fields
        return Built(Design(*lengths), gamma, turn, closed)


@dataclass(frozen=True)
class Optimum:
    """The best design of a task, the inequalities that hold it, the slack of each, and what is left of the equations."""

    built: Built
    objective: float
    mean_velocity: float
    active: tuple[str, ...]
    slacks: dict[str, float]
    equations: dict[str, float]
    evaluations: int

    @property
    def design(self) -> Design:
        """The five lengths."""
        return self.built.design


@dataclass(frozen=True)
class OptimumMotion:
    """How the optimum moves."""

    rise_time: float
    velocity_start: float
    velocity_bottom: float
    velocity_mean: float
    dead_point_length: float


def rise(found: Optimum, task: Task) -> OptimumMotion:
    """The rise of an optimum, or where the cylinder shortens its lowering, which starts at rest at the top."""
    built, drive = found.built, replace(task.cylinder, length=float(found.built.closed))
    form = shape(built.design, built.gamma)
    bottom = pose_at_turn(built.design, built.turn, form)
    travel = top_length(built.design, form) - drive.length
    velocity_bottom = float(velocity(bottom, np.sign(drive.speed) * driven_speed(bottom, drive)))
    return OptimumMotion(
        rise_time=float(travel_time(travel, drive.speed, drive.acceleration)),
        velocity_start=velocity_bottom if drive.speed > 0 else 0.0,
        velocity_bottom=velocity_bottom,
        velocity_mean=found.mean_velocity,
        dead_point_length=float(pose_at_turn(built.design, dead_point(built.design)).length),
    )


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


def check_task(task: Task) -> None:
    """Refuse what no search is needed for: a cylinder at rest, or a stroke that does not rise.

    Raises `FieldError`: with ``constraint`` ``speed`` or ``stroke``.
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


# -- the optimum --------------------------------------------------------------------------------------------------------


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
