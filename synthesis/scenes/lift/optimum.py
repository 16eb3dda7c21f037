"""Optimum design of the lift: the platform speed that varies least over the stroke.

In terms of l2 and gamma (the triangle's angle at A), the equations (31) collinear start, (32) closure at the start
and (33) stroke are solved explicitly. A, B and O are in line at the start, so with psi = atan2(b, sa) the start turn
is theta = psi + gamma. Because l3 + l5 = sb, C lies on an ellipse with foci A and D, whose polar form about A is l3 =
(sb^2 - sa^2) / (2 (sb - sa cos theta)). No equation needs a penalty.

For each l2, the admissible values of gamma form intervals, whose ends are computed exactly and which are searched
from end to end. An optimum on a constraint, which is the usual case, is therefore met exactly. The search uses a
cylinder speed of 1: the objective scales with the square of the speed, so the speed does not affect the optimal
design.

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
from synthesis.scenes.lift.motion import check_speed, constraint_error, travel_time, velocity
from synthesis.scenes.lift.pose import (
    Cylinder,
    Design,
    Pose,
    angle_or_flat,
    dead_point,
    design_constants,
    evaluate_in_blocks,
    pose_at_height,
    pose_at_turn,
    third_side,
    top_length,
    top_lever,
    triangle_angle,
)
from synthesis.work import Work

# -- designs on the constraints and their objective ---------------------------------------------------------------------

Kind = Literal["discrete", "continuous", "normalized"]
"""Kind of objective; see `Objective`."""


@dataclass(frozen=True)
class OptimumOptions:
    """Grids, refinements and tolerances of the search for the optimum."""

    gauss_nodes: int = 200
    """Number of Gauss nodes for the height average of the continuous objectives, clustered towards the start."""
    projection_nodes: int = 257
    """Number of values of gamma on which the roots of a projection are isolated."""
    halvings: int = 60
    """Number of bisection steps for the ends of an interval of gamma."""
    open_end: float = 1e-5
    """Fraction of the range of gamma excluded at its open ends, where the triangle is flat (34). In flatter triangles
    the side lengths no longer determine the angle."""
    poses_per_block: int = 1 << 17
    """Number of poses evaluated at a time, which bounds the memory."""
    angle_nodes: int = 129
    """Number of values of gamma on which the admissible intervals are isolated."""
    peak_refinements: int = 9
    """Number of refinements in the search for an admissible interval that is narrower than the node spacing."""
    strict_margin: float = 1e-9
    """Smallest difference of l5 and l3, as a fraction of the top height, for the strict inequality (36)."""
    active_tolerance: float = 5e-7
    """Slack below which a constraint counts as active, as a fraction of the top height or of the bound itself."""
    search_limit: float = 100.0
    """Largest length in the search, in units of top height plus cylinder length. With longer lengths, the last digit
    of a length determines the dead point."""
    cause_arm_nodes: int = 65
    """Number of values of l2 in the search for the smallest violation of an infeasible task."""
    cause_angle_nodes: int = 17
    """Number of values of gamma in the search for the smallest violation of an infeasible task."""
    cause_refinements: int = 9
    """Number of refinements in the search for the smallest violation of an infeasible task."""
    cause_reach: int = 6
    """Number of nodes on either side of the best node that such a refinement keeps. It is large because the best
    design can lie in a narrow wedge."""
    arm_nodes: int = 48
    """Number of values of l2 in each of the uniform and the geometric grid of the global search."""
    first_samples: int = 17
    """Number of initial samples of an interval of gamma."""
    refined_samples: int = 9
    """Number of samples in each refinement, which narrows an interval by a factor of four."""
    angle_refinements: int = 9
    """Number of refinements over gamma in the final search."""
    arm_refinements: int = 12
    """Number of refinements over l2 in the final search."""
    global_refinements: int = 4
    """Number of refinements over gamma in the global search over l2."""
    local_minima: int = 3
    """Number of local minima over l2 that are refined."""
    slope_step: float = 1e-4
    """Relative step of l2 for the slope along l4 = l2."""
    equality_tolerance: float = 1e-9
    """Relative difference up to which a stroke or a length counts as equal to a published value."""


OPTIONS = OptimumOptions()


@dataclass(frozen=True)
class Objective:
    """Objective to minimise: the variance of the platform speed over height."""

    kind: Kind
    """"discrete" is the mean over n + 1 evenly spaced heights.
    "continuous" is the integral (28).
    "normalized" is the integral divided by the squared mean speed (29), which does not favour slow motion.
    """
    n: int = 310
    """Number of height steps of the discrete objective."""
    include_start: bool = True
    """True: the discrete objective includes the lowest height. False: it omits this height, as (30) is printed."""


@dataclass(frozen=True)
class Task:
    """Problem of finding an optimum design."""

    cylinder: Cylinder
    """The drive."""
    low: float
    """Height of the platform at the start."""
    high: float
    """Height of the platform at the top."""
    objective: Objective
    """The objective."""
    upper_bound: float
    """Upper bound of all five lengths."""


def design_from_angle(l2: Any, gamma: Any, length: Any, low: Any, high: Any) -> Design:
    """Return the design that satisfies (31), (32) and (33) for given l2 and gamma.

    Parameters
    ----------
    l2, gamma : float or ndarray
        The free variables.
    length, low, high : float or ndarray
        Cylinder length l1' at the start, and the heights at the start and at the top. All arguments broadcast.

    Returns
    -------
    Design
        NaN if l1' + l2 does not exceed `low`.
    """
    l2, gamma = np.broadcast_arrays(np.asarray(l2, dtype=float), np.asarray(gamma, dtype=float))
    b = base_distance(l2, length, low)
    theta = np.arctan2(b, low) + gamma
    # write sb - sa cos(theta) as a sum of positive terms
    l3 = (high - low) * (high + low) / (2 * ((high - low) + 2 * low * np.sin(0.5 * theta) ** 2))
    return Design(l2, l3, third_side(l2, l3, gamma), high - l3, b)


def base_distance(l2: Any, length: Any, low: Any) -> Any:
    """Return the distance b from (31); NaN if l1' + l2 does not exceed `low`."""
    square = (length + l2 - low) * (length + l2 + low)
    return np.sqrt(np.where(square > 0, square, np.nan))


def angle_limit(l2: Any, length: Any, low: Any) -> Any:
    """Return the upper limit of gamma, at which the start turn psi + gamma is half a turn.

    Beyond the limit the platform would first go down.
    """
    return np.pi - np.arctan2(base_distance(l2, length, low), low)


def project(l2: Any, l4: Any, length: float, low: float, high: float) -> Design:
    """Return the design with given l2 and l4 that satisfies (31)-(33).

    Parameters
    ----------
    l2, l4 : float or ndarray
        Lengths, which broadcast.
    length, low, high : float
        Cylinder length l1' at the start, and the heights at the start and at the top.

    Returns
    -------
    Design
        NaN if there is no such design. With few exceptions, at most one solution satisfies l3 < l5 and l3 <= l2; if
        there are several, the one with the smallest l3 is returned.
    """
    l2, l4 = np.broadcast_arrays(np.asarray(l2, dtype=float), np.asarray(l4, dtype=float))
    arms, sides = l2.reshape(-1), l4.reshape(-1)
    gammas = (
        np.linspace(OPTIONS.open_end, 1 - OPTIONS.open_end, OPTIONS.projection_nodes)
        * angle_limit(arms, length, low)[:, None]
    )
    excess = design_from_angle(arms[:, None], gammas, length, low, high).l4 - sides[:, None]
    too_short = excess < 0
    row, node = np.nonzero((too_short[:, :-1] != too_short[:, 1:]) & ~np.isnan(excess[:, :-1]))

    def on_same_side(gamma: Floats) -> Any:
        return (design_from_angle(arms[row], gamma, length, low, high).l4 < sides[row]) == too_short[row, node]

    left, right = bisect(on_same_side, gammas[row, node], gammas[row, node + 1], OPTIONS.halvings)
    roots = design_from_angle(arms[row], 0.5 * (left + right), length, low, high)
    l3 = np.full(arms.shape, np.nan)
    admissible = (roots.l3 < roots.l5) & (roots.l3 <= roots.l2 * (1 + EPSILON))
    np.fmin.at(l3, row[admissible], roots.l3[admissible])
    l3 = l3.reshape(l2.shape)
    fields = (l2, l3, l4, high - l3, base_distance(l2, length, low))
    return Design(*(np.where(np.isnan(l3), np.nan, field)[()] for field in fields))


def equation_residuals(design: Design, length: Any, low: Any, high: Any) -> dict[str, float]:
    """Compute the residuals of (31), (32) and (33).

    Parameters
    ----------
    design : Design
        A single design.
    length, low, high : float
        Cylinder length l1' at the start, and the heights at the start and at the top.

    Returns
    -------
    dict of str to float
        Residuals as lengths: start height, l5 and stroke.
    """
    start = np.sqrt(np.maximum((length + design.l2 - design.b) * (length + design.l2 + design.b), 0.0))
    theta = np.arctan2(design.b, low) + design_constants(design).gamma
    return {
        "(31) start": float(start - low),
        "(32) closure": float(third_side(design.l3, low, theta) - design.l5),
        "(33) stroke": float(design.l3 + design.l5 - high),
    }


def driven_speed(pose: Pose, cylinder: Cylinder) -> Any:
    """Return the absolute cylinder speed in a pose; 0 beyond the length at which the cylinder stops."""
    speed, signed_acceleration = abs(cylinder.speed), cylinder.acceleration * np.sign(cylinder.speed)
    if not signed_acceleration:
        return speed
    rising = cylinder.speed > 0
    covered = pose.length - cylinder.length if rising else top_length(pose.design, pose.constants) - pose.length
    return np.sqrt(np.maximum(speed * speed + 2 * signed_acceleration * covered, 0.0))


@dataclass(frozen=True)
class StrokeDesign:
    """Designs that meet the stroke."""

    design: Design
    """The five lengths."""
    gamma: Any
    """The triangle's angle at A."""
    turn: Any
    """Turn at the start."""
    closed_length: Any
    """Cylinder length at the start."""

    def select(self, rows: Any) -> StrokeDesign:
        """Return some of the designs."""
        fields = (
            np.asarray(value)[rows] for value in (*self.design.as_tuple(), self.gamma, self.turn, self.closed_length)
        )
        *lengths, gamma, turn, closed = fields
        return StrokeDesign(Design(*lengths), gamma, turn, closed)


@dataclass(frozen=True)
class Optimum:
    """The best design of a task."""

    stroke_design: StrokeDesign
    """The design, with its angle, start turn and closed length."""
    objective: float
    """Value of the objective."""
    mean_velocity: float
    """Mean speed of the platform over height (29)."""
    active: tuple[str, ...]
    """Names of the active inequalities."""
    slacks: dict[str, float]
    """Slack of each inequality."""
    equations: dict[str, float]
    """Residuals of the equations, as lengths."""
    evaluations: int
    """Number of designs whose objective was evaluated."""

    @property
    def design(self) -> Design:
        """Return the five lengths."""
        return self.stroke_design.design


@dataclass(frozen=True)
class OptimumMotion:
    """Motion of the optimum design."""

    rise_time: float
    """Time from start to top, or from top to start."""
    velocity_start: float
    """Velocity of the platform at the start of the motion."""
    velocity_bottom: float
    """Velocity of the platform at the lowest height."""
    velocity_mean: float
    """Mean velocity of the platform over height."""
    dead_point_length: float
    """Cylinder length at the dead point."""


def optimum_motion(optimum: Optimum, task: Task) -> OptimumMotion:
    """Compute the motion of an optimum.

    Parameters
    ----------
    optimum : Optimum
    task : Task

    Returns
    -------
    OptimumMotion
        If the cylinder shortens, the platform goes down and starts from rest at the top.
    """
    built, cylinder = optimum.stroke_design, replace(task.cylinder, length=float(optimum.stroke_design.closed_length))
    constants = design_constants(built.design, built.gamma)
    bottom = pose_at_turn(built.design, built.turn, constants)
    travel = top_length(built.design, constants) - cylinder.length
    velocity_bottom = float(velocity(bottom, np.sign(cylinder.speed) * driven_speed(bottom, cylinder)))
    return OptimumMotion(
        rise_time=float(travel_time(travel, cylinder.speed, cylinder.acceleration)),
        velocity_start=velocity_bottom if cylinder.speed > 0 else 0.0,
        velocity_bottom=velocity_bottom,
        velocity_mean=optimum.mean_velocity,
        dead_point_length=float(pose_at_turn(built.design, dead_point(built.design)).length),
    )


class Evaluator:
    """Objective of a task for batches of designs, with a count of the evaluations.

    Parameters
    ----------
    task : Task
    work : Work, optional
        Called before each block of designs to check whether the result is still wanted.
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
            z, weights = np.polynomial.legendre.leggauss(OPTIONS.gauss_nodes)
            z, weights = 0.5 * (z + 1), 0.5 * weights
            self._fractions, self._weights = 1 - z**3, 3 * z * z * weights

    def __call__(self, design: Design, gamma: Any | None = None) -> Any:
        """Return the objective of each design; infinite if a dead point lies between its heights.

        Parameters
        ----------
        design : Design
        gamma : float or ndarray, optional
            The triangle's angle at A, if it is known more accurately than it follows from the three sides.
        """
        return self.moments(design, gamma)[0]

    def moments(self, design: Design, gamma: Any | None = None, closed: Any | None = None) -> Any:
        """Return the objective and the mean speed over height (29) of each design, shape (2, ...).

        Parameters
        ----------
        design : Design
        gamma : float or ndarray, optional
            The triangle's angle at A, if it is known more accurately than it follows from the three sides.
        closed_length : float or ndarray, optional
            Cylinder length at the start, if it differs from the task's.
        """
        gamma = triangle_angle(design.l2, design.l3, design.l4)[2] if gamma is None else gamma
        closed = self.task.cylinder.length if closed is None else closed
        return evaluate_in_blocks(
            self._moments, max(1, OPTIONS.poses_per_block // self._weights.size), *design.as_tuple(), gamma, closed
        )

    def _moments(self, *fields: Floats) -> Floats:
        self.work.go_on()
        self.evaluations += fields[0].size
        task = self.task
        *lengths, gamma, closed = (field[:, None] for field in fields)
        design = Design(*lengths)
        constants = design_constants(design, gamma)
        weights = self._weights
        if task.objective.kind == "discrete":
            pose = pose_at_height(design, self._heights, constants, clip=True)
        else:
            start_turn = angle_or_flat(task.low, design.l3, design.l5)  # the turn at the start
            pose = pose_at_turn(design, start_turn * self._fractions, constants)
            weights = -weights * start_turn * pose.height_1
        v = velocity(pose, driven_speed(pose, replace(task.cylinder, length=closed)))
        lifts = np.all((v >= 0) & np.isfinite(v), axis=1) & (top_lever(design, constants)[:, 0] > 0)
        v = np.where(lifts[:, None], v, 1.0)
        total = np.where(lifts[:, None], np.sum(weights, axis=-1, keepdims=True), 1.0)
        mean = np.sum(weights * v, axis=1, keepdims=True) / total
        variance = np.sum(weights * (v - mean) ** 2, axis=1, keepdims=True) / total
        if task.objective.kind == "normalized":
            variance = np.divide(variance, mean * mean, out=np.full(mean.shape, np.inf), where=mean > 0)
        return np.stack([np.where(lifts, variance[:, 0], np.inf), mean[:, 0]])


def check_task(task: Task) -> None:
    """Raise a `FieldError` with ``constraint`` ``speed`` or ``stroke`` if the cylinder or the platform would not move."""
    check_speed(task.cylinder)
    if not task.low < task.high:
        message = f"the height at the start, {task.low:.9g}, must be less than the height at the top, {task.high:.9g}"
        raise constraint_error("stroke", "/stroke", task.low - task.high, message)


def _travel_to_top(design: Design, task: Task) -> Any:
    """Return the travel of the cylinder from the start to the top."""
    return top_length(design, design_constants(design)) - task.cylinder.length


def inequality_slacks(design: Design, task: Task) -> dict[str, Any]:
    """Return the slack of each inequality as a length; a negative slack is a violation."""
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
    cylinder = task.cylinder
    signed_acceleration = cylinder.acceleration * np.sign(cylinder.speed)
    if signed_acceleration < 0:
        slacks["stopping"] = cylinder.speed**2 / (-2 * signed_acceleration) - _travel_to_top(design, task)
    return slacks


def active_inequalities(slacks: dict[str, float], gamma: float, arm: float, task: Task) -> tuple[str, ...]:
    """Return the names of the active inequalities, from the slacks of a design.

    The open ends of gamma count as active within twice `OptimumOptions.open_end`.
    """
    scales = {name: task.upper_bound if "bound" in name else task.high for name in slacks}
    names = [
        name
        for name, slack in slacks.items()
        if slack <= OPTIONS.active_tolerance * scales[name] and name != "triangle"
    ]
    fraction = gamma / float(angle_limit(arm, task.cylinder.length, task.low))
    if fraction <= 2 * OPTIONS.open_end:
        names.insert(0, "triangle")
    if fraction >= 1 - 2 * OPTIONS.open_end:
        names.insert(0, "start_turn<pi")
    return tuple(names)


def arm_range(task: Task) -> tuple[float, float]:
    """Return the open lower and the closed upper end of l2.

    Within this range b is real in (31), and l2 and b are within the bound.
    """
    length, bound = task.cylinder.length, task.upper_bound
    reach = float(np.hypot(bound, task.low))
    return max(task.low - length, 0.0), min(bound, reach - length)


def _smallest_slack(arms: Floats, gammas: Floats, task: Task) -> Floats:
    """Return the smallest slack of the inequalities that depend on gamma.

    The range of l2 ensures the remaining inequalities.
    """
    design = design_from_angle(arms, gammas, task.cylinder.length, task.low, task.high)
    slacks = inequality_slacks(design, task)
    # ensured by the ranges of l2 and gamma
    del slacks["l2<=upper_bound"], slacks["b<=upper_bound"], slacks["triangle"]
    slacks["l3<l5"] = slacks["l3<l5"] - OPTIONS.strict_margin * task.high
    return np.asarray(np.minimum.reduce(list(slacks.values())))


def admissible_intervals(arms: Floats, task: Task) -> tuple[NDArray[np.intp], Floats, Floats]:
    """Find the admissible intervals of gamma for each l2.

    Parameters
    ----------
    arms : ndarray, shape (n,)
        Values of l2.
    task : Task

    Returns
    -------
    row : ndarray of int, shape (m,)
        Index of l2 for each interval.
    lower, upper : ndarray, shape (m,)
        Ends of the intervals, found by bisection; the ends are admissible.
    """
    limit = angle_limit(arms, task.cylinder.length, task.low)
    gammas = np.linspace(OPTIONS.open_end, 1 - OPTIONS.open_end, OPTIONS.angle_nodes) * limit[:, None]
    inside = _smallest_slack(arms[:, None], gammas, task) >= 0
    # an interval narrower than the node spacing is a peak of the slack: replace a node by the top of the peak
    empty_rows = np.nonzero(~inside.any(axis=1))[0]
    if empty_rows.size:
        empty_arms = arms[empty_rows][:, None]
        ends = gammas[empty_rows, 0], gammas[empty_rows, -1]
        shortage, top = closer_looks(
            lambda gamma: -_smallest_slack(empty_arms, gamma, task),
            *ends,
            (OPTIONS.angle_nodes,) * OPTIONS.peak_refinements,
        )
        node = np.clip(np.sum(gammas[empty_rows] < top[:, None], axis=1), 0, OPTIONS.angle_nodes - 1)
        gammas[empty_rows, node] = top
        inside[empty_rows, node] = shortage <= 0
    edge = np.zeros((arms.size, 1), dtype=bool)
    steps = np.diff(np.concatenate([edge, inside, edge], axis=1).astype(np.int8), axis=1)
    row, first = np.nonzero(steps == 1)
    _, after = np.nonzero(steps == -1)

    def interval_end(inside_node: NDArray[np.intp], outside_node: NDArray[np.intp]) -> Floats:
        outside = gammas[row, np.clip(outside_node, 0, OPTIONS.angle_nodes - 1)]
        return bisect(
            lambda gamma: _smallest_slack(arms[row], gamma, task) >= 0,
            gammas[row, inside_node],
            outside,
            OPTIONS.halvings,
        )[0]

    return row, interval_end(first, first - 1), interval_end(after - 1, after)


def most_feasible_arm(task: Task) -> float:
    """Return the l2 with the largest smallest slack, for a task without an admissible design on the grid."""
    low, high = arm_range(task)
    fractions = (OPTIONS.open_end, 1 - OPTIONS.open_end)
    arms = (low + OPTIONS.open_end * (high - low), high)
    for _ in range(OPTIONS.cause_refinements):
        arm_nodes = np.linspace(*arms, OPTIONS.angle_nodes)
        fraction_nodes = np.linspace(*fractions, OPTIONS.angle_nodes)
        gammas = fraction_nodes * angle_limit(arm_nodes, task.cylinder.length, task.low)[:, None]
        slack = _smallest_slack(arm_nodes[:, None], gammas, task)
        row, column = np.unravel_index(int(np.argmax(slack)), slack.shape)
        arms, fractions = _neighbourhood(arm_nodes, int(row)), _neighbourhood(fraction_nodes, int(column))
    return float(arm_nodes[row])


def _neighbourhood(nodes: Floats, index: int) -> tuple[float, float]:
    """Return the interval around a node for the next refinement."""
    first, last = max(index - OPTIONS.cause_reach, 0), min(index + OPTIONS.cause_reach, nodes.size - 1)
    return float(nodes[first]), float(nodes[last])


def infeasibility_error(task: Task) -> FieldError:
    """Build the error that names the constraint to relax, and the smallest amount by which it must be relaxed."""
    cylinder = task.cylinder
    constant_speed = replace(task, cylinder=Cylinder(cylinder.length, cylinder.speed))
    wide_bound = OPTIONS.search_limit * (task.high + cylinder.length)
    bounds = ("l2<=upper_bound", "l5<=upper_bound", "b<=upper_bound")
    for relaxed, names in (
        (constant_speed, ("stopping",)),
        (replace(task, upper_bound=wide_bound), bounds),
        (replace(constant_speed, upper_bound=wide_bound), ("stopping", *bounds)),
    ):
        name, amount = _smallest_violation(task, relaxed, names)
        if not 0 < amount < np.inf:
            continue
        if name == "stopping":
            message = (
                f"in every admissible design the cylinder comes to rest at least {amount:.9g} before the end of its stroke; "
                "reduce the deceleration or increase the speed"
            )
            return constraint_error(name, "/cylinder/acceleration", amount, message)
        message = (
            f"no design reaches this stroke within the upper bound of {task.upper_bound:.9g}: "
            f"{name} is violated by at least {amount:.9g}"
        )
        return constraint_error(name, "/upper_bound", amount, message)
    message = "every design for this stroke starts on a dead point of the cylinder or passes one"
    return constraint_error("dead_point", "/stroke", 0.0, message)


def _smallest_violation(task: Task, relaxed: Task, names: Sequence[str]) -> tuple[str, float]:
    """Return the name and amount of the smallest possible violation of the named inequalities of a task.

    The search covers the designs of the relaxed task. The amount is infinite if none of them lifts the platform.
    """
    # the acceleration of the drive does not affect whether a design passes a dead point
    cylinder = Cylinder(task.cylinder.length, task.cylinder.speed)
    evaluator = Evaluator(replace(relaxed, cylinder=cylinder, objective=Objective("continuous")))
    low, high = arm_range(relaxed)
    smallest = ("", np.inf)
    fractions = (OPTIONS.open_end ** (1 / 4), 1.0)
    for _ in range(OPTIONS.cause_refinements if high > low else 0):
        nodes = np.linspace(*fractions, OPTIONS.cause_arm_nodes)
        arms = low + (high - low) * nodes**4  # short arms need the finest spacing
        row, left, right = admissible_intervals(arms, relaxed)
        gammas = np.linspace(left, right, OPTIONS.cause_angle_nodes, axis=1)
        design = design_from_angle(arms[row][:, None], gammas, cylinder.length, task.low, task.high)
        slacks = inequality_slacks(design, task)
        violations = {name: np.broadcast_to(-slacks[name], gammas.shape) for name in names if name in slacks}
        if not violations or not row.size:
            break
        violation = np.maximum.reduce(list(violations.values()))
        violation = np.where(np.isfinite(evaluator(design, gammas)), violation, np.inf)
        index = np.unravel_index(int(np.argmin(violation)), violation.shape)
        if not np.isfinite(violation[index]):
            break
        if violation[index] < smallest[1]:
            smallest = max(violations, key=lambda name: float(violations[name][index])), float(violation[index])
        fractions = _neighbourhood(nodes, int(row[index[0]]))
    return smallest


# -- the optimum --------------------------------------------------------------------------------------------------------


def optimize(task: Task, work: Work | None = None) -> Optimum:
    """Find the global optimum of a task.

    The search is deterministic. The global search finds the best gamma for each of about a hundred values of l2, on a
    uniform and a geometric grid. The best local minima are then refined in l2, with the best gamma for each value.

    Parameters
    ----------
    task : Task
    work : Work, optional
        Called between the steps to check whether the result is still wanted.

    Returns
    -------
    Optimum
        The design does not depend on the speed, and it scales with all lengths of the task.

    Raises
    ------
    FieldError
        No design is admissible. ``constraint`` names the inequality to relax (a bound, or ``stopping`` if the
        cylinder comes to rest), and ``amount`` is the smallest amount with which all other inequalities can be
        satisfied.
    """
    check_task(task)
    unit = _unit_task(task)
    return _rescale(_optimize_at_unit_speed(unit, work or Work()), unit, task)


def optimize_batch(tasks: Sequence[Task], work: Work | None = None) -> list[Optimum | FieldError]:
    """Find the optima of many tasks.

    Tasks that differ only in the time scale (same a / v^2) share one search.

    Parameters
    ----------
    tasks : sequence of Task
    work : Work, optional
        Called between the steps to check whether the results are still wanted.

    Returns
    -------
    list of Optimum or FieldError
        For each task the result of `optimize`, equal to the last bit, or the error that it would raise.
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
        result = known[unit]
        if isinstance(result, Optimum):
            result = _rescale(result, unit, task)
        results.append(result)
    return results


def _unit_task(task: Task) -> Task:
    """Return the task with time in units of 1 / speed, and with an upper bound that the search can resolve."""
    cylinder = task.cylinder
    speed = abs(float(cylinder.speed))
    unit_cylinder = Cylinder(
        float(cylinder.length), float(np.sign(cylinder.speed)), float(cylinder.acceleration) / speed / speed
    )
    bound = min(task.upper_bound, OPTIONS.search_limit * (task.high + cylinder.length))
    return Task(unit_cylinder, float(task.low), float(task.high), task.objective, float(bound))


def _rescale(optimum: Optimum, unit: Task, task: Task) -> Optimum:
    """Convert an optimum found at unit speed to the speed of the task; the platform speed is proportional to it.

    If the search limit replaced a larger bound, the names of the inequalities refer to the search limit.
    """
    speed = abs(float(task.cylinder.speed))
    bound = "search_limit" if unit.upper_bound < task.upper_bound else "upper_bound"
    return replace(
        optimum,
        objective=optimum.objective * (1.0 if task.objective.kind == "normalized" else speed * speed),
        active=tuple(name.replace("upper_bound", bound) for name in optimum.active),
        slacks={name.replace("upper_bound", bound): slack for name, slack in optimum.slacks.items()},
        mean_velocity=optimum.mean_velocity * speed,
    )


def _optimize_at_unit_speed(task: Task, work: Work) -> Optimum:
    work.go_on()  # a task without an admissible design evaluates no design
    cylinder = task.cylinder
    evaluator = Evaluator(task, work)
    low, high = arm_range(task)
    span = high - low
    if not span > 0:
        raise infeasibility_error(task)
    even = low + span * np.linspace(OPTIONS.open_end, 1.0, OPTIONS.arm_nodes)
    arms = np.union1d(even, low + np.geomspace(min(1e-3 * task.high, 0.5 * span), span, OPTIONS.arm_nodes))
    arms[-1] = high
    values, gammas = _best_angles(arms, evaluator, OPTIONS.global_refinements)
    if not np.any(np.isfinite(values)):
        arms = np.union1d(arms, most_feasible_arm(task))
        values, gammas = _best_angles(arms, evaluator, OPTIONS.global_refinements)
    padded = np.concatenate([[np.inf], values, [np.inf]])
    minima = np.nonzero(np.isfinite(values) & (values <= padded[:-2]) & (values <= padded[2:]))[0]
    minima = minima[np.argsort(values[minima], kind="stable")][: OPTIONS.local_minima]
    for value, arm, gamma in sorted(_refine_minimum(arms, values, gammas, int(index), evaluator) for index in minima):
        fields = design_from_angle(arm, gamma, cylinder.length, task.low, task.high).as_tuple()
        design = Design(*(float(field) for field in fields))
        start_turn = float(pose_at_height(design, task.low).turn)
        if np.isfinite(value) and dead_point(design) > start_turn:
            break
    else:
        raise infeasibility_error(task)
    slacks = {name: float(slack) for name, slack in inequality_slacks(design, task).items()}
    return Optimum(
        StrokeDesign(design, gamma, start_turn, cylinder.length),
        objective=float(value),
        mean_velocity=float(evaluator.moments(design, gamma)[1]),
        active=active_inequalities(slacks, gamma, design.l2, task),
        slacks=slacks,
        equations=equation_residuals(design, cylinder.length, task.low, task.high),
        evaluations=evaluator.evaluations,
    )


def _best_angles(arms: Floats, evaluator: Evaluator, refinements: int) -> tuple[Floats, Floats]:
    """Return the smallest objective over the admissible values of gamma, and that gamma, for each l2.

    The objective is infinite if no gamma is admissible.
    """
    task = evaluator.task
    values, gammas = np.full(arms.shape, np.inf), np.zeros(arms.shape)
    row, left, right = admissible_intervals(arms, task)
    if not row.size:
        return values, gammas

    def objective(gamma: Floats) -> Floats:
        design = design_from_angle(arms[row][:, None], gamma, task.cylinder.length, task.low, task.high)
        return np.asarray(evaluator(design, gamma))

    best_values, best_gammas = closer_looks(
        objective, left, right, (OPTIONS.first_samples, *(OPTIONS.refined_samples,) * refinements)
    )
    for index in range(row.size):
        if best_values[index] < values[row[index]]:
            values[row[index]], gammas[row[index]] = best_values[index], best_gammas[index]
    return values, gammas


def _refine_minimum(
    arms: Floats, values: Floats, gammas: Floats, node: int, evaluator: Evaluator
) -> tuple[float, float, float]:
    """Refine a local minimum over l2 and return its (objective, l2, gamma)."""
    best = (float(values[node]), float(arms[node]), float(gammas[node]))
    left, right = arms[max(node - 1, 0)], arms[min(node + 1, arms.size - 1)]
    for _ in range(OPTIONS.arm_refinements):
        samples = np.union1d(np.linspace(left, right, OPTIONS.refined_samples), best[1])
        trial_values, trial_gammas = _best_angles(samples, evaluator, OPTIONS.angle_refinements)
        index = int(np.argmin(trial_values))
        best = min(best, (float(trial_values[index]), float(samples[index]), float(trial_gammas[index])))
        step = (right - left) / (OPTIONS.refined_samples - 1)
        left, right = max(best[1] - step, left), min(best[1] + step, right)
    return best
