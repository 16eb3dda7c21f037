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
    here = unknowns.copy()
    cost, stack = evaluate(here, labels)
    size = stack.shape[1] - 1
    best, least = here.copy(), cost.copy()
    damped, growth, way = np.full(len(here), damping), np.full(len(here), 2.0), np.zeros((len(here), size))
    triangle = _triangle(stack)
    active = np.flatnonzero(np.isfinite(cost))
    none, steps = np.empty(0, dtype=np.intp), 0
    while steps < iterations and active.size and least.min() > tolerance**2 and not work.expired():
        steps += 1
        upper, right = triangle[active, :size, :size], triangle[active, :size, size]
        straight, damped_upper = _damped_solution(upper, right, damped[active])
        longest = np.max(np.abs(straight), axis=1)
        straight *= -np.minimum(1.0, _LONGEST_STEP / np.maximum(longest, 1e-300))[:, None]
        moved = np.einsum("nij,nj->ni", upper, straight)
        predicted = -np.einsum("ni,ni->n", moved, moved + 2 * right)
        trial, before = here[active], cost[active]
        step, bent = straight, np.flatnonzero(before < bent_below**2) if residual is not None else none
        if residual is not None and bent.size:
            some, step = active[bent], straight.copy()
            step[bent] = _bent(residual, here[some], labels[some], stack[some], straight[bent], damped_upper[bent])
        trial[:, :size] += step
        new = evaluate(trial, labels[active])
        decrease = before - new.cost
        better = decrease > 0
        taken = better.copy()
        taken[bent] |= goes_on(straight[bent], way[active[bent]], new.cost[bent], least[active[bent]])
        took, refused = active[taken], active[~taken]
        here[took], cost[took], way[took] = trial[taken], new.cost[taken], straight[taken]
        stack[took], triangle[took] = new.stack[taken], _triangle(new.stack[taken])
        lower = took[cost[took] < least[took]]
        best[lower], least[lower] = here[lower], cost[lower]
        # Nielsen's rule (Madsen, Nielsen, Tingleff, Methods for non-linear least squares problems, 3.2)
        fell = active[better]
        gain = np.clip(decrease[better] / np.maximum(predicted[better], 1e-300), 0, 1)
        damped[fell] = np.maximum(damped[fell] * np.maximum(0.1, 1 - (2 * gain - 1) ** 3), 1e-20)
        growth[took] = 2.0
        damped[refused] *= growth[refused]
        growth[refused] *= 2
        stalled = better & (decrease < stall * before)
        finished = stalled | (damped[active] > 1e10) | (before < 1e-30)
        active = active[~finished]
    return Minima(best, least)


def goes_on(step: Floats, before: Floats, cost: Floats, least: Floats) -> NDArray[np.bool_]:
    """Whether steps (n, m) are taken wherever they lead: the higher, the straighter they go on from the ones before.

    ``cost`` is where they lead, ``least`` the least on each way so far, (n,).
    """
    length = np.sqrt(np.einsum("nk,nk->n", step, step) * np.einsum("nk,nk->n", before, before))
    cosine = np.einsum("nk,nk->n", step, before) / np.where(length > 0, length, 1.0)
    taken: NDArray[np.bool_] = (1 - np.clip(cosine, 0, _STRAIGHT)) ** _BOLD * cost < least
    return taken


def _damped_solution(upper: Floats, right: Floats, damping: Floats) -> tuple[Floats, Floats]:
    """Least-squares solutions of ``upper @ step = right`` with Marquardt's damping, by QR of both; and R."""
    size = upper.shape[1]
    norms = np.maximum(np.sqrt(np.einsum("nij,nij->nj", upper, upper)), 1e-12)
    system = np.zeros((len(upper), 2 * size, size + 1))
    system[:, :size, :size], system[:, :size, size] = upper, right
    diagonal = np.arange(size)
    system[:, size + diagonal, diagonal] = np.sqrt(damping)[:, None] * norms
    small: Any = np.linalg.qr(system, mode="r")
    damped_upper = small[:, :size, :size]
    return np.linalg.solve(damped_upper, small[:, :size, size:])[:, :, 0], damped_upper


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


def _triangle(stack: Floats) -> Floats:
    """R of the QR decomposition of derivatives and residual as columns, (n, m + 1, m + 1)."""
    columns = stack.transpose(0, 2, 1)
    if (missing := columns.shape[2] - columns.shape[1]) > 0:
        columns = np.concatenate([columns, np.zeros((len(columns), missing, columns.shape[2]))], axis=1)
    triangle: Any = np.linalg.qr(columns, mode="r")
    return triangle
