"""Batched non-linear least squares by Levenberg and Marquardt: many starting points at once, knows no mechanism.

Steps come from the triangle of a QR decomposition of the rows with the damping below them, never from normal equations: in
small spans of the crank the Jacobian's condition passes 1e8.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Floats
from synthesis.work import Work

_LONGEST_STEP = 1.5
_BOLD = 2
"""Power of 1 - cos(angle between a step and the one before) by which the cost uphill counts (Transtrum and Sethna, section 5)."""
_STRAIGHT = 1 - 1e-12
"""Largest cosine between steps: the cost of what does not close is infinite, however straight the way there."""
_AHEAD, _NOT_FAR = 0.1, 0.01
"""How far ahead along a step its curvature is taken: as a part of it, and in the unknowns, whichever is less."""
_BENT = 0.75
"""A step is bent by its curvature where that is by less than this part of it."""


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
    residual: Callable[[Floats, Floats], Floats] | None = None,
    bent_below: float = np.inf,
) -> Minima:
    """Levenberg-Marquardt from many starting points, all at once.

    With ``residual`` steps are bent along curved valleys, and one uphill is taken where it goes straight on from the one
    before, so that they are followed above their floor (M. K. Transtrum, J. P. Sethna: Improvements to the
    Levenberg-Marquardt algorithm for nonlinear least-squares minimization, arXiv:1201.5885).

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
    residual : callable, optional
        The residuals alone, (n, rows): worth its time where valleys are narrow and curved.
    bent_below : float
        Square root of the cost from which on a candidate's steps are bent.

    Returns
    -------
    Minima
        The best place of each candidate's way. Law: no candidate is worse than its starting point.
    """
    work = work or Work()
    cost, stack = evaluate(unknowns, labels)
    size = stack.shape[1] - 1
    best, least = unknowns.copy(), cost.copy()
    # the candidates still on their way, where they stand among all, and the least cost on each way
    place = np.flatnonzero(np.isfinite(cost))
    here, labels, cost, stack, lowest = unknowns[place], labels[place], cost[place], stack[place], cost[place]
    damped, growth, way = np.full(place.size, damping), np.full(place.size, 2.0), np.zeros((place.size, size))
    steps = 0
    while steps < iterations and place.size and least.min() > tolerance**2 and not work.expired():
        steps += 1
        straight, upper, predicted = _damped_steps(stack, damped)
        bent = cost < (bent_below**2 if residual is not None else 0.0)
        step = straight
        if residual is not None and bent.any():
            some: Any = slice(None) if bent.all() else bent
            step = straight.copy()
            step[some] = _bent(residual, here[some], labels[some], stack[some], straight[some], upper[some])
        trial = here.copy()
        trial[:, :size] += step
        new = evaluate(trial, labels)
        decrease = cost - new.cost
        better = decrease > 0
        finished = (better & (decrease < stall * cost)) | (cost < 1e-30)
        taken, uphill = better, bent & ~better
        if uphill.any():
            taken = better.copy()
            taken[uphill] = goes_on(straight[uphill], way[uphill], new.cost[uphill], lowest[uphill])
        # Nielsen's rule (Madsen, Nielsen, Tingleff, Methods for non-linear least squares problems, 3.2)
        gain = np.clip(decrease / np.maximum(predicted, 1e-300), 0, 1)
        shrunk = np.maximum(damped * np.maximum(0.1, 1 - (2 * gain - 1) ** 3), 1e-20)
        damped = np.where(better, shrunk, np.where(taken, damped, damped * growth))
        growth = np.where(taken, 2.0, 2 * growth)
        finished |= damped > 1e10
        if not taken.all():
            refused = ~taken
            for column, values in ((trial, here), (new.cost, cost), (new.stack, stack), (straight, way)):
                column[refused] = values[refused]
        here, cost, stack, way = trial, new.cost, new.stack, straight
        lower = cost < lowest
        best[place[lower]], least[place[lower]] = here[lower], cost[lower]
        lowest = np.minimum(lowest, cost)
        if finished.any():
            left = ~finished
            place, here, labels, cost, stack = place[left], here[left], labels[left], cost[left], stack[left]
            lowest, damped, growth, way = lowest[left], damped[left], growth[left], way[left]
    return Minima(best, least)


def goes_on(step: Floats, before: Floats, cost: Floats, least: Floats) -> NDArray[np.bool_]:
    """Whether steps (n, m) are taken wherever they lead: the higher, the straighter they go on from the ones before.

    ``cost`` is where they lead, ``least`` the least on each way so far, (n,).
    """
    length = np.sqrt(np.einsum("nk,nk->n", step, step) * np.einsum("nk,nk->n", before, before))
    cosine = np.einsum("nk,nk->n", step, before) / np.where(length > 0, length, 1.0)
    taken: NDArray[np.bool_] = (1 - np.clip(cosine, 0, _STRAIGHT)) ** _BOLD * cost < least
    return taken


def _damped_steps(stack: Floats, damping: Floats) -> tuple[Floats, Floats, Floats]:
    """Steps (n, m) with Marquardt's damping, R of the damped rows (n, m, m), and by how much a linear model's cost falls."""
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
    return step, upper, fall


def _bent(
    residual: Callable[[Floats, Floats], Floats],
    unknowns: Floats,
    labels: Floats,
    stack: Floats,
    step: Floats,
    damped_upper: Floats,
) -> Floats:
    """Steps with their second-order correction, from one more residual; unchanged where it is not small beside the step."""
    size = step.shape[1]
    length = np.sqrt(np.einsum("nj,nj->n", step, step))
    ahead = np.minimum(_AHEAD, _NOT_FAR / np.maximum(length, 1e-300))[:, None]
    there = unknowns.copy()
    there[:, :size] += ahead * step
    with np.errstate(all="ignore"):
        rise = (residual(there, labels) - stack[:, size]) / ahead
        # half the second derivative along the step
        curve = (rise - np.einsum("nj,njr->nr", step, stack[:, :size])) / ahead
        right = np.einsum("njr,nr->nj", stack[:, :size], curve)[:, :, None]
        bend = -np.linalg.solve(damped_upper, np.linalg.solve(damped_upper.transpose(0, 2, 1), right))[:, :, 0]
        small = np.sqrt(np.einsum("nj,nj->n", bend, bend)) < _BENT * length
    return np.where(small[:, None], step + bend, step)
