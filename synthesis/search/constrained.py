"""Descent under constraints: projected Levenberg-Marquardt steps on an augmented Lagrangian, for many candidates at once.

What falls is J^2 + rho sum max(0, lambda / rho - c)^2 over constraints c >= 0, with multipliers lambda that are renewed while
rho grows (Nocedal and Wright, Numerical Optimization, 17.3). Equations are part of each step's linear system, so that they
reduce the unknowns. Steps come from normal equations: here J stays above 0.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from synthesis.least_squares import Evaluation
from synthesis.mechanism import Constrained
from synthesis.work import Work

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

MARGIN = 1e-7
"""By which constraints are kept, so that rounding breaks none."""
_LEAST_DAMPING = 1e-12
_EXACT = 1e-15
"""To which equations are solved."""
_STALL, _HOPELESS = 1e-7, 1e10
"""A candidate's descent ends where a step gains no more than this part, or its damping exceeds the other."""


class Problem(Protocol):
    """What a descent needs to know."""

    def evaluate(self, unknowns: Floats, branch: Floats) -> Evaluation:
        """Residuals and derivatives."""

    def constrained(self, unknowns: Floats, branch: Floats) -> Constrained:
        """Constraints and derivatives."""

    def stepped(self, unknowns: Floats, step: Floats) -> Floats:
        """Unknowns after a step."""

    def held(self, unknowns: Floats, gradient: Floats) -> Flags:
        """Which unknowns a bound holds."""


class Plan(NamedTuple):
    """How a descent goes."""

    steps: int
    weights: tuple[float, ...]
    """rho, one after the other."""
    every: int
    """Steps with each."""
    awaited: int | None = None
    """So many of the best candidates are descended to their end; None: all."""


class Descended(NamedTuple):
    """Candidates after a descent."""

    unknowns: Floats
    branch: Floats
    cost: Floats
    """J squared; infinite where a candidate does not close."""
    broken: Floats
    """Largest amount by which a constraint is broken."""

    def take(self, places: Any) -> Descended:
        """Some of them."""
        return Descended(*(column[places] for column in self))

    def joined(self, other: Descended) -> Descended:
        """These and others after them."""
        return Descended(*(np.concatenate(pair) for pair in zip(self, other)))


class _State(NamedTuple):
    """Candidates with what a step needs."""

    unknowns: Floats
    cost: Floats
    normal: Floats
    """(n, m + 1, m + 1): J'J and J'r."""
    values: Floats
    slopes: Floats

    @classmethod
    def at(cls, problem: Problem, unknowns: Floats, branch: Floats) -> tuple[_State, Flags]:
        """Candidates, and which of the constraints are equations."""
        cost, stack = problem.evaluate(unknowns, branch)
        stack = np.where(np.isfinite(cost)[:, None, None], stack, 0.0)
        found = problem.constrained(unknowns, branch)
        return cls(
            unknowns, cost, stack @ stack.transpose(0, 2, 1), found.values - MARGIN * ~found.equal, found.slopes
        ), found.equal


def descend(problem: Problem, unknowns: Floats, branch: Floats, plan: Plan, work: Work) -> Descended:
    """Candidates after a plan's steps; none is worse by its augmented Lagrangian than it was before.

    Parameters
    ----------
    problem : Problem
    unknowns : ndarray, shape (n, m)
    branch : ndarray, shape (n,)
    plan : Plan
    work : Work
        Asked before each step.
    """
    here, equal = _State.at(problem, unknowns, branch)
    count = len(unknowns)
    damping, growth = np.full(count, 1e-2), np.full(count, 2.0)
    multipliers = np.zeros(here.values.shape)
    rho = plan.weights[0]
    for step in range(plan.steps):
        if not count or work.expired():
            break
        if step and step % plan.every == 0 and here.values.shape[1]:
            multipliers = rho * _active(here.values, multipliers, rho, equal)
            rho = plan.weights[min(step // plan.every, len(plan.weights) - 1)]
        active = _active(here.values, multipliers, rho, equal)
        trial, predicted = _trial(problem, here, active, rho, equal, damping)
        there, _ = _State.at(problem, trial, branch)
        before = here.cost + rho * np.einsum("nc,nc->n", active, active)
        new = _active(there.values, multipliers, rho, equal)
        after = there.cost + rho * np.einsum("nc,nc->n", new, new)
        closes = np.isfinite(before) & np.isfinite(after)
        decrease = np.where(closes, before, 0.0) - np.where(closes, after, 0.0)
        last = here.values.shape[1] == 0 or step >= plan.every * (len(plan.weights) - 1)
        better = np.where(np.isfinite(before), decrease > 0, np.isfinite(after))
        gain = np.clip(decrease / np.maximum(predicted, 1e-100), 0, 1)
        damping = np.where(better, damping * np.maximum(0.1, 1 - (2 * gain - 1) ** 3), damping * growth)
        damping = np.clip(damping, _LEAST_DAMPING, 1e12)
        growth = np.where(better, 2.0, 2 * growth)
        for new_column, column in zip(there, here):
            new_column[~better] = column[~better]
        here = there
        if last:
            ended = (predicted <= _STALL * before) | better & (decrease <= _STALL * before) | (damping > _HOPELESS)
            if ended[np.argsort(np.where(better, after, before))[: plan.awaited]].all():
                break
    broken = np.where(equal, np.abs(here.values), -here.values)
    return Descended(here.unknowns, branch, here.cost, np.max(broken, axis=1, initial=0.0))


def _active(values: Floats, multipliers: Floats, rho: float, equal: Flags) -> Floats:
    """max(0, lambda / rho - c) of constraints, lambda / rho - c of equations, (n, C)."""
    part = multipliers / rho - values
    return np.where(equal, part, np.maximum(part, 0.0))


def _trial(
    problem: Problem, here: _State, active: Floats, rho: float, equal: Flags, damping: Floats
) -> tuple[Floats, Floats]:
    """Unknowns after a damped step, and the decrease that the linear model predicts for it."""
    size = here.unknowns.shape[1]
    hessian, gradient = here.normal[:, :size, :size], here.normal[:, :size, size]
    if active.shape[1]:
        rows = np.where((active != 0)[:, :, None], here.slopes, 0.0)
        hessian = hessian + rho * (rows.transpose(0, 2, 1) @ rows)
        gradient = gradient - rho * (active[:, None, :] @ rows)[:, 0]
    held = problem.held(here.unknowns, gradient)
    free = ~held
    diagonal = np.arange(size)
    largest = hessian[:, diagonal, diagonal]
    largest = np.maximum(largest, 1e-9 * largest.max(axis=1, keepdims=True))
    system = hessian * (free[:, :, None] & free[:, None, :])
    system[:, diagonal, diagonal] += np.where(held, 1.0, damping[:, None] * largest + 1e-300)
    right = -np.where(held, 0.0, gradient)
    if equal.any():
        rows = here.slopes[:, equal] * free[:, None, :]
        step = _within_equations(system, right, rows, -here.values[:, equal])
    else:
        step = _solved(system, right[:, :, None])[:, :, 0]
    trial = problem.stepped(here.unknowns, step)
    moved = trial - here.unknowns
    predicted = -np.einsum("nm,nm->n", moved, 2 * gradient + (hessian @ moved[:, :, None])[:, :, 0])
    return trial, predicted


def _solved(system: Floats, right: Floats) -> Floats:
    """Solutions of damped systems; of least norm where one is singular to rounding."""
    try:
        return np.asarray(np.linalg.solve(system, right))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(system, hermitian=True) @ right)


def _within_equations(system: Floats, right: Floats, rows: Floats, gap: Floats) -> Floats:
    """Steps that solve the system among those that meet linearised equations; redundant equations do no harm."""
    base = _solved(system, np.concatenate([right[:, :, None], rows.transpose(0, 2, 1)], axis=2))
    plain, spread = base[:, :, 0], base[:, :, 1:]
    forces: Any = np.linalg.pinv(rows @ spread, rcond=1e-12) @ (gap - (rows @ plain[:, :, None])[:, :, 0])[:, :, None]
    return plain + (spread @ forces)[:, :, 0]


def restored(problem: Problem, found: Descended, rounds: int = 12) -> Descended:
    """Candidates moved onto the limits that they break by the shortest way: Newton steps on those constraints.

    Law: none breaks more than it did; one that the steps lead away stays where it was.
    """
    unknowns, branch = found.unknowns, found.branch
    constrained = problem.constrained(unknowns, branch)
    before = np.max(constrained.lacking, axis=1, initial=0.0)
    for _ in range(rounds):
        equal, values = constrained.equal, constrained.values - MARGIN * ~constrained.equal
        wrong = np.where(equal, np.abs(values) > _EXACT, values < 0)
        if not wrong.any():
            break
        rows = np.where(wrong[:, :, None], constrained.slopes, 0.0)
        gap = np.where(wrong, np.where(equal, -values, 0.1 * MARGIN - values), 0.0)
        steps = (np.linalg.pinv(rows, rcond=1e-9) @ gap[:, :, None])[:, :, 0]
        held = problem.held(unknowns, -steps)
        if held.any():
            steps = (np.linalg.pinv(np.where(held[:, None], 0.0, rows), rcond=1e-9) @ gap[:, :, None])[:, :, 0]
        unknowns = problem.stepped(unknowns, steps)
        constrained = problem.constrained(unknowns, branch)
    broken = np.max(constrained.lacking, axis=1, initial=0.0)
    astray = ~(broken <= before)  # NaN is astray, too
    unknowns = np.where(astray[:, None], found.unknowns, unknowns)
    cost = problem.evaluate(unknowns, branch).cost
    return Descended(unknowns, branch, cost, np.where(astray, before, broken))
