"""Best design of a lift that satisfies the constraints of `synthesis.scenes.lift.constraints`.

The problem of the source is such a search with a collinear start and an upper bound of all lengths (`source_limits`).

The search variables are l2, gamma, l3 and the closed length; b follows from the cylinder length at the start. With
the collinear start, l3 and b follow from (31) and (32). Every design therefore meets the stroke exactly. The best of
a set of evenly distributed designs are the starting points of a sequential quadratic program with at most four
variables, whose linear constraints are the slacks in all poses. All starting points are processed at once.

Numbers in parentheses are equations of the source named in `synthesis.scenes.lift.pose`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from synthesis.errors import FieldError
from synthesis.one_variable import Flags, Floats
from synthesis.quadratic import minimise_quadratics
from synthesis.scenes.lift.constraints import (
    OPTIONS,
    OWN_UNIT,
    PLAIN_UNIT,
    Constraints,
    check_constraints,
    minimum_slacks,
    slacks,
)
from synthesis.scenes.lift.motion import constraint_error
from synthesis.scenes.lift.optimum import OPTIONS as OPTIMUM_OPTIONS
from synthesis.scenes.lift.optimum import (
    Evaluator,
    Optimum,
    StrokeDesign,
    Task,
    angle_limit,
    check_task,
    design_from_angle,
)
from synthesis.scenes.lift.pose import (
    Design,
    angle_or_flat,
    dead_point,
    third_side,
)
from synthesis.work import Work


@dataclass(frozen=True)
class DesignSpace:
    """Search variables of a task within its constraints; each variable is scaled to 0 .. 1."""

    task: Task
    """Drive, stroke and objective."""
    limits: Constraints
    """Ranges of the lengths, and the kind of start."""

    @property
    def count(self) -> int:
        """Return the number of variables: l2, gamma, and if they are free, l3 and the closed length."""
        return 2 + (self.limits.start == "any") + self._closed_is_free

    @property
    def _closed_is_free(self) -> bool:
        low, high = self.limits.closed_length
        return high - low > OPTIONS.closed_tolerance * high

    def _arm_range(self) -> tuple[float, float]:
        """Return the range of l2 in which b can be real and within its bound (31), if the start is collinear."""
        shortest, closed = 1e-6 * self.task.high, self.limits.closed_length
        bound = self.limits.lengths.get("b", (None, None))[1]
        if self.limits.start == "any" or bound is None:
            return shortest, np.inf
        return max(shortest, self.task.low - closed[1]), float(np.hypot(bound, self.task.low)) - closed[0]

    def designs(self, points: Floats, side: Floats) -> StrokeDesign:
        """Return the designs for points of the search space.

        Parameters
        ----------
        points : ndarray, shape (n, count)
            Scaled variables.
        side : ndarray, shape (n,)
            1 if B starts between the slide and the cylinder pivot, -1 if it starts beyond the pivot.

        Returns
        -------
        StrokeDesign
            NaN if a design cannot be assembled at the start.
        """
        low, high = self.task.low, self.task.high
        coordinates = iter(np.clip(points, 0.0, 1.0).T)

        def next_length(name: str, lower: float, upper: float) -> Floats:
            first, last = self.limits.lengths.get(name, (None, None))
            first, last = max(first or 0.0, lower), min(np.inf if last is None else last, upper)
            return np.asarray(first + (last - first) * next(coordinates))

        def next_closed_length() -> Any:
            first, last = self.limits.closed_length
            return first + (last - first) * (next(coordinates) if self._closed_is_free else 0.0)

        open_end = OPTIMUM_OPTIONS.open_end
        l2 = next_length("l2", *self._arm_range())
        angle_fraction = open_end + (1 - 2 * open_end) * next(coordinates)
        with np.errstate(all="ignore"):
            if self.limits.start == "any":
                # if l3 were below half of the stroke, A could not go down to the start
                l3 = next_length("l3", OPTIONS.l3_factor * 0.5 * (high - low), 0.5 * high)
                gamma, closed_length = np.pi * angle_fraction, next_closed_length()
                turn = angle_or_flat(low, l3, high - l3)
                across, y = l2 * np.sin(turn - gamma), low - l2 * np.cos(turn - gamma)
                x_squared = (closed_length - y) * (closed_length + y)
                b = across + side * np.sqrt(np.where(x_squared > 0, x_squared, np.nan))
                b = np.where(b > 0, b, np.nan)
                design = Design(l2, l3, third_side(l2, l3, gamma), high - l3, b)
            else:
                closed_length = next_closed_length()
                gamma = angle_fraction * angle_limit(l2, closed_length, low)
                design = design_from_angle(l2, gamma, closed_length, low, high)
                turn = np.arctan2(design.b, low) + gamma
        return StrokeDesign(design, gamma, turn, np.broadcast_to(closed_length, l2.shape))


class _LinearModel(NamedTuple):
    """Objective and constraints of n points, linearised in the k search variables."""

    value: Floats
    """Logarithm of the objective, shape (n,)."""
    gradient: Floats
    """Derivatives of the value, shape (n, k)."""
    slack: Floats
    """Slacks minus their margins, shape (n, m)."""
    jacobian: Floats
    """Derivatives of the slacks, shape (n, m, k)."""

    def select(self, rows: Any) -> _LinearModel:
        """Return the model of some of the points."""
        return _LinearModel(*(array[rows] for array in self))

    def lagrangian_gradient(self, multipliers: Floats) -> Floats:
        """Return the gradient of the Lagrangian, shape (n, k)."""
        return self.gradient - np.einsum("nmk,nm->nk", self.jacobian, multipliers)


class _Search:
    """Multistart of sequential quadratic programs, run for all starting points at once."""

    def __init__(self, task: Task, limits: Constraints, work: Work) -> None:
        self.space, self.limits, self.work = DesignSpace(task, limits), limits, work
        self.evaluator = Evaluator(task, work)
        self.penalty = OPTIONS.penalties[0]

    def objective(self, candidates: StrokeDesign) -> Floats:
        """Return the logarithm of the objective; infinite if a design does not lift."""
        value = self.evaluator.moments(candidates.design, candidates.gamma, candidates.closed_length)[0]
        return np.log(np.where(value > 0, value, np.inf))

    def reduced_slacks(self, candidates: StrokeDesign, nodes: int) -> Floats:
        """Return all slacks of each design minus a margin, shape (n, m); -10 if a design cannot be assembled.

        In a narrow range the two margins meet in the middle, and a range of a single value has no margin.
        """
        self.work.go_on()
        by_name = slacks(candidates, self.space.task, self.limits, nodes)
        margins: dict[str, Any] = {
            name: OPTIONS.margin if values.shape[1] > 1 else OPTIONS.single_margin for name, values in by_name.items()
        }
        for lower, upper in ((name, name.replace(">=min", "<=max")) for name in by_name):
            if lower != upper and upper in by_name:
                margins[lower] = margins[upper] = np.minimum(margins[lower], 0.5 * (by_name[lower] + by_name[upper]))
        stacked = np.concatenate([by_name[name] - margins[name] for name in by_name], axis=1)
        return np.where(np.isfinite(stacked), np.clip(stacked, -10.0, 10.0), -10.0)

    def starting_points(self) -> tuple[Floats, Floats]:
        """Return points and sides of the best initial designs, at a minimum distance from each other.

        Designs are ranked by the logarithm of the objective plus a penalty for violated constraints.
        """
        points, sides = self._spread_points()
        candidates = self.space.designs(points, sides)
        self.work.go_on()
        by_name = minimum_slacks(slacks(candidates, self.space.task, self.limits, OPTIONS.coarse_nodes))
        violation = np.sum(
            [np.where(np.isfinite(slack), np.clip(-slack, 0.0, 1.0), 1.0) for slack in by_name.values()], axis=0
        )
        ranked = np.argsort(violation, kind="stable")[: OPTIONS.ranked_designs]
        value = self.objective(candidates.select(ranked)) + self.penalty * violation[ranked] / 10
        chosen: list[int] = []
        for index in ranked[np.argsort(value, kind="stable")]:
            is_distant = (
                np.abs(points[index] - points[selected]).max() > OPTIONS.start_distance
                or sides[index] != sides[selected]
                for selected in chosen
            )
            if all(is_distant):
                chosen.append(int(index))
            if len(chosen) == OPTIONS.starts:
                break
        return np.clip(points[chosen], 1e-4, 1 - 1e-4), sides[chosen]

    def _spread_points(self) -> tuple[Floats, Floats]:
        """Return points and sides of the initial designs, evenly distributed in every projection.

        The points are the additive recurrence whose increments are powers of the generalised golden ratio.
        """
        count = self.space.count
        roots = np.roots([1.0, *([0.0] * (count - 1)), -1.0, -1.0])
        increments = 1 / float(np.max(roots.real[np.abs(roots.imag) < 1e-12])) ** np.arange(1, count + 1)
        points = (0.5 + np.arange(1, OPTIONS.spread_designs + 1)[:, None] * increments) % 1.0
        sides = (1.0, -1.0) if self.space.limits.start == "any" else (1.0,)
        return np.tile(points, (len(sides), 1)), np.repeat(sides, OPTIONS.spread_designs)

    def linearise(self, points: Floats, side: Floats, nodes: int) -> _LinearModel:
        """Evaluate objective and constraints with their derivatives, by central differences within the ranges."""
        n, k = points.shape
        step = OPTIONS.difference_step
        steps = step * np.eye(k)
        stencil = np.concatenate([points[:, None], points[:, None] + steps, points[:, None] - steps], axis=1)
        candidates = self.space.designs(stencil.reshape(-1, k), np.repeat(side, 2 * k + 1))
        value = self.objective(candidates).reshape(n, 2 * k + 1)
        reduced = self.reduced_slacks(candidates, nodes).reshape(n, 2 * k + 1, -1)
        with np.errstate(invalid="ignore"):
            gradient = (value[:, 1 : k + 1] - value[:, k + 1 :]) / (2 * step)
            jacobian = (reduced[:, 1 : k + 1] - reduced[:, k + 1 :]).transpose(0, 2, 1) / (2 * step)
        return _LinearModel(value[:, 0], np.where(np.isfinite(gradient), gradient, 0.0), reduced[:, 0], jacobian)

    def descend(
        self, points: Floats, side: Floats, nodes: int, iterations: int, first_radius: float
    ) -> tuple[Floats, Floats]:
        """Run the sequential quadratic programs.

        Parameters
        ----------
        points : ndarray, shape (n, k)
            Starting points, which are replaced by the points with the smallest merit function.
        side : ndarray, shape (n,)
            Side of each starting point; see `DesignSpace.designs`.
        nodes : int
            Number of poses at which the constraints are evaluated.
        iterations : int
            Largest number of iterations.
        first_radius : float
            Initial trust-region radius.

        Returns
        -------
        points : ndarray, shape (n, k)
        merit : ndarray, shape (n,)
        """
        n, k = points.shape
        radii, hessian = np.full(n, first_radius), np.tile(np.eye(k), (n, 1, 1))
        model = self.linearise(points, side, nodes)
        merit = self.merit(model)
        for _ in range(iterations):
            running = np.nonzero((radii > OPTIONS.min_radius) & np.isfinite(merit))[0]
            if not running.size:
                break
            self.work.go_on()
            local, radius = model.select(running), radii[running]
            step, multipliers = _quadratic_step(local, hessian[running], points[running], radius, self.penalty)
            trial_points = np.clip(
                points[running] + step, 2 * OPTIONS.difference_step, 1 - 2 * OPTIONS.difference_step
            )
            trial = self.linearise(trial_points, side[running], nodes)
            trial_merit = self.merit(trial)
            better = trial_merit < merit[running] - 1e-13
            step_size = np.abs(step).max(axis=1)
            enlarged = np.where(step_size > 0.9 * radius, 2 * radius, radius)
            radii[running] = np.where(
                better, np.minimum(enlarged, OPTIONS.max_radius), 0.3 * np.minimum(step_size, radius)
            )
            step_taken = trial_points - points[running]
            change = trial.lagrangian_gradient(multipliers) - local.lagrangian_gradient(multipliers)
            finite = np.isfinite(trial_merit)
            updated = running[finite]
            hessian[updated] = _damped_bfgs(hessian[updated], step_taken[finite], change[finite])
            accepted = running[better]
            points[accepted], merit[accepted] = trial_points[better], trial_merit[better]
            for array, values in zip(model, trial):
                array[accepted] = values[better]
        return points, merit

    def merit(self, model: _LinearModel) -> Floats:
        """Return the merit function: the logarithm of the objective plus the penalty of the largest violation."""
        return np.asarray(model.value + self.penalty * np.maximum(0.0, -model.slack.min(axis=1)))


def _quadratic_step(
    model: _LinearModel, hessian: Floats, points: Floats, radius: Floats, penalty: float
) -> tuple[Floats, Floats]:
    """Return the step within the trust region that minimises the quadratic model, and the multipliers.

    An additional unknown is the largest violation, with the same penalty as in the merit function.
    """
    n, k = points.shape
    m = model.slack.shape[1]
    program_hessian = np.zeros((n, k + 1, k + 1))
    program_hessian[:, :k, :k] = hessian
    program_hessian[:, k, k] = 1e-6
    unit = np.tile(np.eye(k), (n, 1, 1))
    matrix = np.zeros((n, m + 2 * k + 1, k + 1))
    matrix[:, :m, :k], matrix[:, :m, k], matrix[:, m, k] = model.jacobian, 1.0, 1.0
    matrix[:, m + 1 : m + 1 + k, :k], matrix[:, m + 1 + k :, :k] = unit, -unit
    # up to the ends of the ranges minus the difference step, with room for an interior point
    edge, room = 2 * OPTIONS.difference_step, 1e-3 * OPTIONS.difference_step
    low = np.minimum(radius[:, None], np.maximum(points - edge, room))
    high = np.minimum(radius[:, None], np.maximum(1 - edge - points, room))
    bound = np.concatenate([model.slack, np.zeros((n, 1)), low, high], axis=1)
    inside = np.zeros((n, k + 1))
    inside[:, k] = np.maximum(0.0, -model.slack.min(axis=1)) + 0.1
    gradient = np.concatenate([model.gradient, np.full((n, 1), penalty)], axis=1)
    solution, multipliers = minimise_quadratics(program_hessian, gradient, matrix, bound, inside, 1e-10)
    return solution[:, :k], multipliers[:, :m]


def _damped_bfgs(hessian: Floats, step: Floats, change: Floats) -> Floats:
    """Return Powell's damped BFGS update of positive definite matrices (Nocedal and Wright, procedure 18.2)."""
    hessian_step = np.einsum("nij,nj->ni", hessian, step)
    model_curvature, curvature = np.einsum("ni,ni->n", step, hessian_step), np.einsum("ni,ni->n", step, change)
    with np.errstate(all="ignore"):
        theta = np.where(
            curvature >= 0.2 * model_curvature, 1.0, 0.8 * model_curvature / (model_curvature - curvature)
        )[:, None]
        damped = theta * change + (1 - theta) * hessian_step
        updated = hessian - hessian_step[:, :, None] * hessian_step[:, None, :] / model_curvature[:, None, None]
        denominator = np.einsum("ni,ni->n", step, damped)[:, None, None]
        updated = updated + damped[:, :, None] * damped[:, None, :] / denominator
    finite = np.isfinite(updated).all(axis=(1, 2))
    usable = finite & (model_curvature > 1e-24) & (np.abs(updated).max(axis=(1, 2)) < 1e8)
    return np.where(usable[:, None, None], updated, hessian)


def source_limits(task: Task) -> Constraints:
    """Return the limits of the source's problem: a collinear start, and an upper bound of l2, l5 and b."""
    closed = float(task.cylinder.length)
    bound = min(task.upper_bound, OPTIONS.search_limit * (task.high + closed))
    return Constraints(dict.fromkeys(("l2", "l5", "b"), (None, bound)), (closed, closed), start="collinear")


def optimize(task: Task, limits: Constraints, work: Work | None = None) -> Optimum:
    """Find the best design of a task that satisfies constraints.

    The search is deterministic. It ignores the length of the task's cylinder, because the closed length is a
    variable. Every slack of the result is at least 0 in every pose, up to rounding.

    Parameters
    ----------
    task : Task
    limits : Constraints
    work : Work, optional
        Called regularly to check whether the result is still wanted.

    Raises
    ------
    FieldError
        No design was found that satisfies all constraints. ``constraint`` names the constraint that the nearest
        design violates most, and ``amount`` is the size of the violation in the unit that the message states.
    """
    check_task(task)
    check_constraints(limits, task.high)
    search = _Search(task, limits, work or Work())
    # the last attempt ignores the ranges of l2 and l3, so that the error names them if they cannot be satisfied
    free = replace(limits, lengths=dict.fromkeys(("l2", "l3"), (None, task.upper_bound)))
    for search.penalty, ranges in zip((*OPTIONS.penalties, OPTIONS.penalties[1]), (limits, limits, free)):
        search.space = DesignSpace(task, ranges)
        candidates, merit = _local_optima(search)
        slacks_by_name = minimum_slacks(slacks(candidates, task, limits, 2 * OPTIONS.fine_nodes))
        worst = np.min(list(slacks_by_name.values()), axis=0)
        worst = np.where(np.isfinite(merit) & _reaches_top(candidates) & np.isfinite(worst), worst, -np.inf)
        admissible = np.nonzero(worst >= -OPTIONS.closed_tolerance)[0]
        if admissible.size:
            break
    else:
        nearest = int(np.argmax(worst))
        raise _no_design_error({name: float(slack[nearest]) for name, slack in slacks_by_name.items()})
    values = search.objective(candidates)
    best = int(admissible[np.argmin(values[admissible])])
    best_slacks = {name: float(slack[best]) for name, slack in slacks_by_name.items()}
    return _optimum(candidates.select([best]), best_slacks, search.evaluator, task)


def _local_optima(search: _Search) -> tuple[StrokeDesign, Floats]:
    """Return the finalists of a multistart and their merit."""
    points, side = search.starting_points()
    points, merit = search.descend(points, side, OPTIONS.search_nodes, OPTIONS.iterations, OPTIONS.first_radius)
    order = np.argsort(merit, kind="stable")[: OPTIONS.finalists]
    points, side = points[order], side[order]
    points, merit = search.descend(points, side, OPTIONS.fine_nodes, OPTIONS.fine_iterations, OPTIONS.fine_radius)
    return search.space.designs(points, side), merit


def _optimum(best: StrokeDesign, best_slacks: dict[str, float], evaluator: Evaluator, task: Task) -> Optimum:
    """Build the result from the best design, shape (1,), and its slacks."""
    value, mean = evaluator.moments(best.design, best.gamma, best.closed_length)[:, 0]
    design = Design(*(float(field[0]) for field in best.design.as_tuple()))
    stroke_design = StrokeDesign(design, float(best.gamma[0]), float(best.turn[0]), float(best.closed_length[0]))
    active = tuple(name for name, slack in best_slacks.items() if slack <= OPTIONS.active_tolerance)
    return Optimum(stroke_design, float(value), float(mean), active, best_slacks)


def _reaches_top(candidates: StrokeDesign) -> Flags:
    """Return whether no dead point lies between start and top."""
    return np.asarray(dead_point(candidates.design) > np.asarray(candidates.turn))


def _no_design_error(slacks_by_name: dict[str, float]) -> FieldError:
    """Build the error that lists the violations of the nearest design, the largest violation first."""
    violations = {
        name: -slacks_by_name[name]
        for name in sorted(slacks_by_name, key=slacks_by_name.__getitem__)
        if not slacks_by_name[name] >= -OPTIONS.closed_tolerance
    }
    if not violations or not all(map(np.isfinite, violations.values())):
        message = "no design with lengths within their ranges was found that meets the stroke; widen the ranges"
        return constraint_error("assembly", "/constraints", 0.0, message)
    parts = (f"{name} by {by:.3g} {_slack_unit(name)}" for name, by in violations.items())
    message = f"no design was found that satisfies all constraints; the nearest design violates {', '.join(parts)}"
    name, amount = next(iter(violations.items()))
    return constraint_error(name, "/constraints", amount, message)


def _slack_unit(constraint: str) -> str:
    """Return the unit of the slack of a constraint in messages."""
    name = re.split("[<>]", constraint)[0]
    return "of its limit" if name in OWN_UNIT else PLAIN_UNIT.get(name, "of the top height")
