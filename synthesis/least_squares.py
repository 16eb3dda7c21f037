"""Batched non-linear least squares by Levenberg and Marquardt: many starting points at once, knows no mechanism.

Steps come from the triangle of a QR decomposition of the rows with the damping below them, never from normal equations: in
small spans of the crank the Jacobian's condition passes 1e8.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Floats
from synthesis.work import Work

_LONGEST_STEP = 1.5


class Evaluation(NamedTuple):
    """Residuals and Jacobians of candidates."""

    cost: Floats
    """(n,): sum of the squared residuals; infinite where a candidate is impossible."""
    stack: Floats
    """(n, m + 1, rows): the residual's derivatives by the first m unknowns, then the residual itself."""


class Minima(NamedTuple):
    """Candidates after their descent."""

    unknowns: Floats
    cost: Floats


def minimise(
    evaluate: Callable[[Floats, Floats], Evaluation],
    unknowns: Floats,
    labels: Floats,
    iterations: int,
    tolerance: float = 0.0,
    work: Work | None = None,
    stall: float = 1e-9,
    damping: float = 1e-3,
) -> Minima:
    """Levenberg-Marquardt from many starting points, all at once.

    Parameters
    ----------
    evaluate : callable
        ``evaluate(unknowns, labels)`` of some of the candidates.
    unknowns : ndarray, shape (n, m)
        Starting points; of order one, for a step is no longer than a bit over one in any unknown. Those behind the ones
        that there are derivatives by stay as they are.
    labels : ndarray, shape (n,)
        What else belongs to each candidate and does not change, such as its branch.
    iterations : int
        At most this many steps.
    tolerance : float
        Stop when the square root of the least cost is below it.
    work : Work, optional
        Asked before each step; once it has expired the descent stops where it is.
    stall : float
        A step that lowers the cost by a smaller part than this is a candidate's last one.
    damping : float
        Of the first step, relative to the squares of the derivatives: small where the start is near.

    Returns
    -------
    Minima
        The best place of each candidate's way. Law: no candidate is worse than its starting point; without unknowns that is it.
    """
    work = work or Work()
    cost, stack = evaluate(unknowns, labels)
    size = stack.shape[1] - 1
    best, least = unknowns.copy(), cost.copy()
    # the candidates still on their way, and where they stand among all
    place = np.flatnonzero(np.isfinite(cost))
    here, labels, cost, stack = unknowns[place], labels[place], cost[place], stack[place]
    damped, growth = np.full(place.size, damping), np.full(place.size, 2.0)
    steps = 0
    while size and steps < iterations and place.size and least.min() > tolerance**2 and not work.expired():
        steps += 1
        step, predicted = _damped_steps(stack, damped)
        trial = here.copy()
        trial[:, :size] += step
        new = evaluate(trial, labels)
        decrease = cost - new.cost
        better = decrease > 0
        finished = (better & (decrease < stall * cost)) | (cost < 1e-30)
        # Nielsen's rule (Madsen, Nielsen, Tingleff, Methods for non-linear least squares problems, 3.2)
        gain = np.clip(decrease / np.maximum(predicted, 1e-300), 0, 1)
        shrunk = np.maximum(damped * np.maximum(0.1, 1 - (2 * gain - 1) ** 3), 1e-20)
        damped = np.where(better, shrunk, damped * growth)
        growth = np.where(better, 2.0, 2 * growth)
        finished |= damped > 1e10
        for column, values in ((here, trial), (cost, new.cost), (stack, new.stack)):
            column[better] = values[better]
        best[place], least[place] = here, cost
        if finished.any():
            left = ~finished
            place, here, labels, cost, stack = place[left], here[left], labels[left], cost[left], stack[left]
            damped, growth = damped[left], growth[left]
    return Minima(best, least)


def _damped_steps(stack: Floats, damping: Floats) -> tuple[Floats, Floats]:
    """Steps (n, m) with Marquardt's damping, and by how much a linear model's cost falls."""
    count, columns, rows = stack.shape
    size, diagonal = columns - 1, np.arange(columns - 1)
    ridge = damping[:, None] * np.maximum(np.einsum("nij,nij->ni", stack, stack)[:, :size], 1e-24)
    system = np.zeros((count, columns, rows + size))
    system[:, :, :rows] = stack
    system[:, diagonal, rows + diagonal] = np.sqrt(ridge)
    triangle: Any = np.linalg.qr(system.transpose(0, 2, 1), mode="r")
    upper, right = triangle[:, :size, :size], triangle[:, :size, size:]
    step = np.linalg.solve(upper, right)[:, :, 0]
    part = np.minimum(1.0, _LONGEST_STEP / np.maximum(np.abs(step).max(axis=1), 1e-300))
    step *= -part[:, None]
    # |r|^2 - |r + J s|^2 with J^T r = R^T right: a sum of positive terms
    fall = part * (2 - part) * np.einsum("nij,nij->n", right, right) + np.einsum("ni,ni,ni->n", ridge, step, step)
    return step, fall
