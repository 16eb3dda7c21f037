"""Batched non-linear least squares by the Levenberg-Marquardt method, independent of any mechanism.

Many starting points are improved at once.
Each step comes from the QR decomposition of the Jacobian with the damping rows below it, never from the normal equations,
because the condition number of the Jacobian exceeds 1e8 if the crank turns through a small angle.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Floats
from synthesis.kernels.damped_steps import damped_steps
from synthesis.work import UNLIMITED, Work

_MAX_STEP = 1.5
"""Largest change of any unknown in a step."""


class Evaluation(NamedTuple):
    """Residuals and Jacobians of candidates."""

    cost: Floats
    """Sum of the squared residuals, shape (n,); infinite for an impossible candidate."""
    rows: Floats
    """Derivatives of the residuals with respect to the first m unknowns, then the residuals themselves, shape
    (n, m + 1, residuals)."""


class Minima(NamedTuple):
    """Candidates after their descent."""

    unknowns: Floats
    """Unknowns with the lowest cost found, shape (n, unknowns)."""
    cost: Floats
    """Cost at these unknowns, shape (n,)."""


def minimise(
    evaluate: Callable[[Floats, Floats], Evaluation],
    unknowns: Floats,
    labels: Floats,
    iterations: int,
    tolerance: float = 0.0,
    work: Work = UNLIMITED,
    stall: float = 1e-9,
    damping: float = 1e-3,
) -> Minima:
    """Minimise sums of squares by the Levenberg-Marquardt method, from many starting points at once.

    Parameters
    ----------
    evaluate : callable
        ``evaluate(unknowns, labels)`` returns the `Evaluation` of some of the candidates.
    unknowns : ndarray, shape (n, unknowns)
        Starting points, scaled to order one, because no unknown changes by more than 1.5 in a step.
        Unknowns after the first m, for which there are no derivatives, are not changed.
    labels : ndarray, shape (n, ...)
        Fixed data of each candidate, such as its branch.
    iterations : int
        Largest number of steps.
    tolerance : float
        The descent stops when the square root of the smallest cost is below this value.
    work : Work, optional
        Time budget and cancellation, checked before each step; when the budget is used up, the descent stops.
    stall : float
        A step that reduces the cost by a smaller fraction than this is the last step of a candidate.
    damping : float
        Damping of the first step, relative to the squares of the derivatives; small if the start is close to a minimum.

    Returns
    -------
    Minima
        The best point on the path of each candidate, never worse than its starting point.

    Notes
    -----
    The damping is controlled by Nielsen's rule (Madsen, Nielsen, Tingleff, Methods for non-linear least squares problems,
    section 3.2).
    """
    cost, rows = evaluate(unknowns, labels)
    size = rows.shape[1] - 1
    best, best_cost = unknowns.copy(), cost.copy()
    # The arrays of the loop hold only the active candidates; `index` gives their rows in the result.
    index = np.flatnonzero(np.isfinite(cost))
    current, labels, cost, rows = unknowns[index], labels[index], cost[index], rows[index]
    damped, growth = np.full(index.size, damping), np.full(index.size, 2.0)
    steps = 0
    while size and steps < iterations and index.size and best_cost.min() >= tolerance**2 and not work.expired():
        steps += 1
        step, predicted = damped_steps(rows, damped, _MAX_STEP)
        trial = current.copy()
        trial[:, :size] += step
        trial_evaluation = evaluate(trial, labels)
        decrease = cost - trial_evaluation.cost
        better = decrease > 0
        finished = (better & (decrease < stall * cost)) | (cost < 1e-30)
        gain_ratio = np.clip(decrease / np.maximum(predicted, 1e-300), 0, 1)
        reduced = np.maximum(damped * np.maximum(0.1, 1 - (2 * gain_ratio - 1) ** 3), 1e-20)
        damped = np.where(better, reduced, damped * growth)
        growth = np.where(better, 2.0, 2 * growth)
        finished |= damped > 1e10
        for column, values in ((current, trial), (cost, trial_evaluation.cost), (rows, trial_evaluation.rows)):
            column[better] = values[better]
        best[index], best_cost[index] = current, cost
        if finished.any():
            active = ~finished
            index, labels, damped, growth = index[active], labels[active], damped[active], growth[active]
            current, cost, rows = current[active], cost[active], rows[active]
    return Minima(best, best_cost)
