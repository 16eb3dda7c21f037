"""The optimum of a lift within constraints: a spread of designs, the best of them descended along their constraints.

A design is given by l2, gamma, l3 and the closed length; b follows from the length of the cylinder at the start, or, with
the collinear start, l3 and b from (31) and (32), so that every design meets the stroke exactly. All descents run at once: a
sequential quadratic program in at most four variables each, whose linear rows are the slacks at all poses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synthesis.errors import FieldError
from synthesis.lift.admissible import check_task
from synthesis.lift.constraints import FINE_NODES, SEARCH_NODES, Built, Constraints, check_constraints, least, slacks
from synthesis.lift.motion import refusal
from synthesis.lift.objective import OPEN_END, Evaluator, Task, angle_limit, design_from_angle
from synthesis.lift.pose import Design, angle_or_flat, dead_point, third_side
from synthesis.one_variable import Flags, Floats
from synthesis.quadratic import minimise_quadratics
from synthesis.work import Work

SPREAD = 4096
"""Designs of the first look, on each side of the cylinder's pivot."""
COARSE_NODES = 17
NEAR = 1024
"""Designs of the first look whose objective is computed: those that break the constraints least."""
STARTS = 16
APART = 0.08
"""Distance between two starts, in units of the ranges."""
ROUNDS, FINE_ROUNDS = 30, 20
LAST = 3
"""Descents that are finished on `FINE_NODES` poses."""
STEP = 1e-6
"""Of the differences that slopes are taken by, in units of the ranges."""
MARGIN = 5e-5
"""Share of a limit by which a design stays inside, so that poses between the nodes do too."""
REACH, LEAST_REACH = 0.15, 1e-8
"""First and last length of a step, in units of the ranges."""
WEIGHT = 30.0
"""Of the worst broken constraint beside the logarithm of the objective."""
ACTIVE = 2e-3
"""Slack, in units of the limit, below which a constraint holds a design."""
REACHES = 1 + 1e-6
"""Share by which l3 stays above half of the stroke, where A would only just come down to the start."""
CLOSED = 1e-12
"""Share of its end below which a range is one value."""


@dataclass(frozen=True)
class Space:
    """The variables of a task within its constraints, each from 0 to 1."""

    task: Task
    limits: Constraints

    @property
    def count(self) -> int:
        """Variables: l2, gamma, and as far as they are free, l3 and the closed length."""
        return 2 + (self.limits.start == "any") + self._closed_is_free

    @property
    def _closed_is_free(self) -> bool:
        low, high = self.limits.closed_length
        return high - low > CLOSED * high

    def designs(self, place: Floats, side: Floats) -> Built:
        """The designs at places (n, count); ``side`` -1: B starts on the far side of the cylinder's pivot."""
        low, high = self.task.low, self.task.high
        at = iter(np.clip(place, 0.0, 1.0).T)

        def between(name: str, least_end: float, most_end: float) -> Floats:
            first, last = self.limits.lengths.get(name, (None, None))
            first, last = max(first or 0.0, least_end), min(np.inf if last is None else last, most_end)
            return np.asarray(first + (last - first) * next(at))

        l2, turning = between("l2", 1e-6 * high, np.inf), OPEN_END + (1 - 2 * OPEN_END) * next(at)
        closed_low, closed_high = self.limits.closed_length
        with np.errstate(all="ignore"):
            if self.limits.start == "any":
                # below half of the stroke C cannot hang A so low
                l3, gamma = between("l3", REACHES * 0.5 * (high - low), 0.5 * high), np.pi * turning
                closed = closed_low + (closed_high - closed_low) * (next(at) if self._closed_is_free else 0.0)
                l5 = high - l3
                turn = angle_or_flat(low, l3, l5)
                across, y = l2 * np.sin(turn - gamma), low - l2 * np.cos(turn - gamma)
                square = (closed - y) * (closed + y)
                b = across + side * np.sqrt(np.where(square > 0, square, np.nan))
                b = np.where(b > 0, b, np.nan)
                design = Design(l2, l3, third_side(l2, l3, gamma), l5, b)
            else:
                closed = closed_low + (closed_high - closed_low) * (next(at) if self._closed_is_free else 0.0)
                gamma = turning * angle_limit(l2, closed, low)
                design = design_from_angle(l2, gamma, closed, low, high)
                turn = np.arctan2(design.b, low) + gamma
        return Built(design, gamma, turn, np.broadcast_to(closed, l2.shape))


@dataclass(frozen=True)
class Constrained:
    """The best design within constraints, the names of those that hold it, and the least slack of each."""

    built: Built
    objective: float
    mean_velocity: float
    active: tuple[str, ...]
    slacks: dict[str, float]
    evaluations: int


class _Search:
    def __init__(self, task: Task, limits: Constraints, work: Work) -> None:
        self.space, self.work = Space(task, limits), work
        self.evaluator = Evaluator(task, work)

    def objective(self, built: Built) -> Floats:
        """The logarithm of the objective; infinite where there is none."""
        value = self.evaluator.moments(built.design, built.gamma, built.closed)[0]
        return np.log(np.where(value > 0, value, np.inf))

    def rows(self, built: Built, nodes: int, margin: float = 0.0) -> Floats:
        """All slacks of each design, (n, m); very negative where it cannot be assembled."""
        found = slacks(built, self.space.task, self.space.limits, nodes)
        together = np.concatenate(list(found.values()), axis=1) - margin
        return np.where(np.isfinite(together), np.clip(together, -10.0, 10.0), -10.0)

    def spread(self) -> tuple[Floats, Floats]:
        """Places and sides of the starts: the best admissible ones, and those that miss least, apart from one another."""
        count = self.space.count
        # the additive sequence with the generalised golden ratio: even in every projection, and the same each time
        ratio = np.roots([1.0, *([0.0] * (count - 1)), -1.0, -1.0])
        share = 1 / float(np.max(ratio.real[np.abs(ratio.imag) < 1e-12])) ** np.arange(1, count + 1)
        places = (0.5 + np.arange(1, SPREAD + 1)[:, None] * share) % 1.0
        both = (1.0, -1.0) if self.space.limits.start == "any" else (1.0,)
        sides = np.repeat(both, SPREAD)
        places = np.tile(places, (len(both), 1))
        built = self.space.designs(places, sides)
        self.work.go_on()
        found = least(slacks(built, self.space.task, self.space.limits, COARSE_NODES))
        missing = np.sum([np.where(np.isfinite(one), np.clip(-one, 0.0, 1.0), 1.0) for one in found.values()], axis=0)
        near = np.argsort(missing, kind="stable")[:NEAR]
        value = self.objective(built.taken(near)) + WEIGHT * missing[near] / 10
        chosen: list[int] = []
        for at in near[np.argsort(value, kind="stable")]:
            apart = (
                np.abs(places[at] - places[other]).max() > APART or sides[at] != sides[other] for other in chosen
            )
            if all(apart):
                chosen.append(int(at))
            if len(chosen) == STARTS:
                break
        return np.clip(places[chosen], 1e-4, 1 - 1e-4), sides[chosen]

    def linear(self, place: Floats, side: Floats, nodes: int) -> tuple[Floats, Floats, Floats, Floats]:
        """Objective, slacks and their slopes, by central differences within the ranges."""
        n, k = place.shape
        steps = STEP * np.eye(k)
        around = np.concatenate([place[:, None], place[:, None] + steps, place[:, None] - steps], axis=1)
        built = self.space.designs(around.reshape(-1, k), np.repeat(side, 2 * k + 1))
        value = self.objective(built).reshape(n, 2 * k + 1)
        rows = self.rows(built, nodes, MARGIN).reshape(n, 2 * k + 1, -1)
        with np.errstate(invalid="ignore"):
            slope = (value[:, 1 : k + 1] - value[:, k + 1 :]) / (2 * STEP)
            matrix = (rows[:, 1 : k + 1] - rows[:, k + 1 :]).transpose(0, 2, 1) / (2 * STEP)
        return value[:, 0], np.where(np.isfinite(slope), slope, 0.0), rows[:, 0], matrix

    def descend(self, place: Floats, side: Floats, nodes: int, rounds: int, reach: float) -> tuple[Floats, Floats]:
        """Places after sequential quadratic programs, and their merit."""
        n, k = place.shape
        reaches, hessian = np.full(n, reach), np.tile(np.eye(k), (n, 1, 1))
        value, slope, rows, matrix = self.linear(place, side, nodes)
        merit = _merit(value, rows)
        for _ in range(rounds):
            running = np.nonzero((reaches > LEAST_REACH) & np.isfinite(merit))[0]
            if not running.size:
                break
            self.work.go_on()
            step, multipliers = _program(
                hessian[running], slope[running], rows[running], matrix[running], place[running], reaches[running]
            )
            there = np.clip(place[running] + step, 2 * STEP, 1 - 2 * STEP)
            tried = self.linear(there, side[running], nodes)
            new = _merit(tried[0], tried[2])
            better = new < merit[running] - 1e-13
            size = np.abs(step).max(axis=1)
            grown = np.where(size > 0.9 * reaches[running], 2 * reaches[running], reaches[running])
            reaches[running] = np.where(better, np.minimum(grown, 0.5), 0.3 * np.minimum(size, reaches[running]))
            moved = there - place[running]
            before = slope[running] - np.einsum("nmk,nm->nk", matrix[running], multipliers)
            after = tried[1] - np.einsum("nmk,nm->nk", tried[3], multipliers)
            finite = np.isfinite(new)
            hessian[running[finite]] = _updated(hessian[running[finite]], moved[finite], (after - before)[finite])
            at = running[better]
            place[at], merit[at] = there[better], new[better]
            for held, fresh in zip((value, slope, rows, matrix), tried):
                held[at] = fresh[better]
        return place, merit


def _merit(value: Floats, rows: Floats) -> Floats:
    """What a descent lowers: the objective's logarithm and the worst broken slack."""
    return np.asarray(value + WEIGHT * np.maximum(0.0, -rows.min(axis=1)))


def _program(
    hessian: Floats, slope: Floats, rows: Floats, matrix: Floats, place: Floats, reach: Floats
) -> tuple[Floats, Floats]:
    """The step within a reach that lowers the model most, its worst broken slack weighed like in the merit; multipliers."""
    n, k = place.shape
    m = rows.shape[1]
    wide = np.zeros((n, k + 1, k + 1))
    wide[:, :k, :k] = hessian
    wide[:, k, k] = 1e-6
    unit = np.tile(np.eye(k), (n, 1, 1))
    full = np.zeros((n, m + 2 * k + 1, k + 1))
    full[:, :m, :k], full[:, :m, k], full[:, m, k] = matrix, 1.0, 1.0
    full[:, m + 1 : m + 1 + k, :k], full[:, m + 1 + k :, :k] = unit, -unit
    low = np.minimum(reach[:, None], np.maximum(place - STEP, STEP))
    high = np.minimum(reach[:, None], np.maximum(1 - STEP - place, STEP))
    bound = np.concatenate([rows, np.zeros((n, 1)), low, high], axis=1)
    inside = np.zeros((n, k + 1))
    inside[:, k] = np.maximum(0.0, -rows.min(axis=1)) + 0.1
    gradient = np.concatenate([slope, np.full((n, 1), WEIGHT)], axis=1)
    found, multipliers = minimise_quadratics(wide, gradient, full, bound, inside, 1e-10)
    return found[:, :k], multipliers[:, :m]


def _updated(hessian: Floats, step: Floats, change: Floats) -> Floats:
    """Powell's damped update of positive definite matrices; Nocedal and Wright, procedure 18.2."""
    along = np.einsum("nij,nj->ni", hessian, step)
    curve, have = np.einsum("ni,ni->n", step, along), np.einsum("ni,ni->n", step, change)
    with np.errstate(all="ignore"):
        share = np.where(have >= 0.2 * curve, 1.0, 0.8 * curve / (curve - have))[:, None]
        damped = share * change + (1 - share) * along
        fresh = hessian - along[:, :, None] * along[:, None, :] / curve[:, None, None]
        fresh = fresh + damped[:, :, None] * damped[:, None, :] / np.einsum("ni,ni->n", step, damped)[:, None, None]
    good = np.isfinite(fresh).all(axis=(1, 2)) & (curve > 1e-24) & (np.abs(fresh).max(axis=(1, 2)) < 1e8)
    return np.where(good[:, None, None], fresh, hessian)


def optimize_within(task: Task, limits: Constraints, work: Work | None = None) -> Constrained:
    """The best design of a task that keeps to constraints; deterministic.

    The length of the task's cylinder is not used: the closed length is one of the variables, within its range.

    Raises
    ------
    FieldError
        Where no design was found that keeps to all: ``constraint`` names the one that the nearest breaks most, and
        ``amount`` by how much, in units of the limit.

    Law: every slack is at least 0 at any pose.
    """
    check_task(task)
    check_constraints(limits)
    search = _Search(task, limits, work or Work())
    place, side = search.spread()
    place, merit = search.descend(place, side, SEARCH_NODES, ROUNDS, REACH)
    order = np.argsort(merit, kind="stable")[:LAST]
    place, side = place[order], side[order]
    place, merit = search.descend(place, side, FINE_NODES, FINE_ROUNDS, 0.02)
    built = search.space.designs(place, side)
    found = least(slacks(built, task, limits, 2 * FINE_NODES))
    worst = np.min([np.where(np.isfinite(one), one, -1.0) for one in found.values()], axis=0)
    worst = np.where(np.isfinite(merit) & _lifts(built), worst, -1.0)
    admissible = np.nonzero(worst >= 0)[0]
    if not admissible.size:
        raise _none_found({name: float(one[int(np.argmax(worst))]) for name, one in found.items()})
    values = search.objective(built)
    at = int(admissible[np.argmin(values[admissible])])
    one = built.taken([at])
    value, mean = search.evaluator.moments(one.design, one.gamma, one.closed)[:, 0]
    mine = {name: float(slack[at]) for name, slack in found.items()}
    active = tuple(name for name, slack in mine.items() if slack <= ACTIVE)
    single = Design(*(float(field[0]) for field in one.design.as_tuple()))
    result = Built(single, float(one.gamma[0]), float(one.turn[0]), float(one.closed[0]))
    return Constrained(result, float(value), float(mean), active, mine, search.evaluator.evaluations)


def _lifts(built: Built) -> Flags:
    """Whether no dead point lies between start and top."""
    return np.asarray(dead_point(built.design) > np.asarray(built.turn))


def _none_found(mine: dict[str, float]) -> FieldError:
    """The error that names what the nearest design breaks most."""
    if not all(np.isfinite(list(mine.values()))):
        message = "no design was found that meets the stroke with lengths within their ranges"
        return refusal("assembly", "/constraints", 0.0, message)
    name = min(mine, key=mine.__getitem__)
    amount = max(-mine[name], 0.0)
    message = f"no design within all constraints was found: the nearest fails {name} by {amount:.3g} of its limit"
    return refusal(name, "/constraints", amount, message)
