"""Best design of a lift that satisfies the constraints of `synthesis.scenes.lift.constraints`.

The problem of the source is such a search with a collinear start and an upper bound of all lengths (`source_limits`).

The search variables are l2, gamma, l3 and the closed length; b follows from the cylinder length at the start. With
the collinear start, l3 and b follow from (31) and (32). Every design therefore meets the stroke exactly. The best of
a set of evenly distributed designs are the starting points of a least-squares descent with at most four variables
(`synthesis.constrained_descent`), whose conditions are the slacks in all poses. All starting points are processed at once.

Numbers in parentheses are equations of the source named in `synthesis.scenes.lift.pose`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from synthesis.constrained_descent import Linear, descend
from synthesis.errors import FieldError
from synthesis.one_variable import Flags, Floats
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
from synthesis.scenes.lift.pose import Design, dead_point, third_side, triangle_angle
from synthesis.work import UNLIMITED, Work


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
                turn = triangle_angle(low, l3, high - l3, may_be_flat=True)
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


class _Search:
    """Multistart of descents, run for all starting points at once."""

    def __init__(self, task: Task, limits: Constraints, work: Work) -> None:
        self.space, self.limits, self.work = DesignSpace(task, limits), limits, work
        self.evaluator = Evaluator(task, work)
        self.scale = 1.0

    def objective(self, candidates: StrokeDesign) -> Floats:
        """Return the objective; infinite if a design does not lift."""
        return np.asarray(self.evaluator.moments(candidates.design, candidates.gamma, candidates.closed_length)[0])

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
        value = self.objective(candidates.select(ranked))
        self.scale = float(np.sqrt(np.min(value, where=value > 0, initial=np.inf)))
        self.scale = self.scale if np.isfinite(self.scale) else 1.0
        with np.errstate(divide="ignore"):
            value = np.log(value) + OPTIONS.rank_penalty * violation[ranked]
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

    def linearise(self, points: Floats, side: Floats, nodes: int) -> Linear:
        """Linearise the speed's deviations and the slacks, by central differences within the ranges."""
        n, k = points.shape
        step = OPTIONS.difference_step
        steps = step * np.eye(k)
        stencil = np.concatenate([points[:, None], points[:, None] + steps, points[:, None] - steps], axis=1)
        candidates = self.space.designs(stencil.reshape(-1, k), np.repeat(side, 2 * k + 1))
        model = []
        for values in (self.evaluator.errors(candidates) / self.scale, self.reduced_slacks(candidates, nodes)):
            values = values.reshape(n, 2 * k + 1, -1)
            with np.errstate(invalid="ignore"):
                slope = (values[:, 1 : k + 1] - values[:, k + 1 :]).transpose(0, 2, 1) / (2 * step)
            model += [values[:, 0].copy(), np.where(np.isfinite(slope), slope, 0.0)]
        return Linear(*model)

    def descend(self, points: Floats, side: Floats, nodes: int) -> tuple[Floats, Floats]:
        """Refine points, shape (n, k), with constraints at a number of poses; return them and their merit, shape (n,)."""
        count = points.shape[1]
        found = descend(
            lambda unknowns, which: self.linearise(unknowns, side[which], nodes),
            np.asarray(points, dtype=float),
            np.arange(count),
            (np.full(count, 2 * OPTIONS.difference_step), np.full(count, 1 - 2 * OPTIONS.difference_step)),
            largest=False,
            steps=OPTIONS.iterations,
            gain=OPTIONS.gain,
            work=self.work,
            radius=OPTIONS.first_radius,
        )
        return found.unknowns, found.merit


def source_limits(task: Task) -> Constraints:
    """Return the limits of the source's problem: a collinear start, and an upper bound of l2, l5 and b."""
    closed = float(task.cylinder.length)
    bound = min(task.upper_bound, OPTIONS.search_limit * (task.high + closed))
    return Constraints(dict.fromkeys(("l2", "l5", "b"), (None, bound)), (closed, closed), start="collinear")


def optimize(task: Task, limits: Constraints, work: Work = UNLIMITED) -> Optimum:
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
    search = _Search(task, limits, work)
    # the last attempt ignores the ranges of l2 and l3, so that the error names them if they cannot be satisfied
    free = replace(limits, lengths=dict.fromkeys(("l2", "l3"), (None, task.upper_bound)))
    for ranges in (limits, free):
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
    points, merit = search.descend(points, side, OPTIONS.search_nodes)
    order = np.argsort(merit, kind="stable")[: OPTIONS.finalists]
    points, side = points[order], side[order]
    points, merit = search.descend(points, side, OPTIONS.fine_nodes)
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
    """Build the error that lists the violations of the nearest design, the largest first; ties in their order."""
    violations = {
        name: -slacks_by_name[name]
        for name in sorted(slacks_by_name, key=lambda name: float(f"{slacks_by_name[name]:.3g}"))
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
