"""Batched non-linear least squares by Levenberg and Marquardt: many starting points at once, knows no mechanism.

Steps come from the singular values of the triangle of a QR decomposition, never from normal equations: in small spans of
the crank the Jacobian's condition passes 1e8.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.work import Work

Floats = NDArray[np.float64]

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
        Law: no candidate is worse than its starting point.
    """
    work = work or Work()
    unknowns = unknowns.copy()
    cost, stack = evaluate(unknowns, labels)
    size = stack.shape[1] - 1
    damped = np.full(len(unknowns), damping)
    growth = np.full(len(unknowns), 2.0)
    triangle = _triangle(stack)
    active = np.flatnonzero(np.isfinite(cost))
    steps = 0
    while steps < iterations and active.size and cost.min() > tolerance**2 and not work.expired():
        steps += 1
        upper, right = triangle[active, :size, :size], triangle[active, :size, size]
        step = -_damped_solution(upper, right, damped[active])
        longest = np.max(np.abs(step), axis=1)
        step *= np.minimum(1.0, _LONGEST_STEP / np.maximum(longest, 1e-300))[:, None]
        trial = unknowns[active]
        trial[:, :size] += step
        moved = np.einsum("nij,nj->ni", upper, step)
        predicted = -np.einsum("ni,ni->n", moved, moved + 2 * right)
        new = evaluate(trial, labels[active])
        before = cost[active]
        decrease = before - new.cost
        better = decrease > 0
        took, refused = active[better], active[~better]
        unknowns[took], cost[took] = trial[better], new.cost[better]
        triangle[took] = _triangle(new.stack[better])
        # Nielsen's rule (Madsen, Nielsen, Tingleff, Methods for non-linear least squares problems, 3.2)
        gain = np.clip(decrease[better] / np.maximum(predicted[better], 1e-300), 0, 1)
        damped[took] = np.maximum(damped[took] * np.maximum(0.1, 1 - (2 * gain - 1) ** 3), 1e-20)
        growth[took] = 2.0
        damped[refused] *= growth[refused]
        growth[refused] *= 2
        stalled = better & (decrease < stall * before)
        finished = stalled | (damped[active] > 1e10) | (before < 1e-30)
        active = active[~finished]
    return Minima(unknowns, cost)


def _damped_solution(upper: Floats, right: Floats, damping: Floats) -> Floats:
    """Least-squares solutions of ``upper @ step = right`` with Marquardt's damping, by the QR decomposition of both."""
    size = upper.shape[1]
    norms = np.maximum(np.sqrt(np.einsum("nij,nij->nj", upper, upper)), 1e-12)
    system = np.zeros((len(upper), 2 * size, size + 1))
    system[:, :size, :size], system[:, :size, size] = upper, right
    diagonal = np.arange(size)
    system[:, size + diagonal, diagonal] = np.sqrt(damping)[:, None] * norms
    small: Any = np.linalg.qr(system, mode="r")
    return np.linalg.solve(small[:, :size, :size], small[:, :size, size:])[:, :, 0]


def _triangle(stack: Floats) -> Floats:
    """R of the QR decomposition of derivatives and residual as columns, (n, m + 1, m + 1)."""
    columns = stack.transpose(0, 2, 1)
    if (missing := columns.shape[2] - columns.shape[1]) > 0:
        columns = np.concatenate([columns, np.zeros((len(columns), missing, columns.shape[2]))], axis=1)
    triangle: Any = np.linalg.qr(columns, mode="r")
    return triangle
