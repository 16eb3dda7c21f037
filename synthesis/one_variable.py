"""Roots and minima of functions of one variable, for many members at a time.

Every solver works on arrays and treats each member independently: a batch gives the same results, to the last bit, as
its members computed separately. (SciPy has such solvers, but importing them takes several times as long as the first
result of a scene.)
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.floating]
Flags = NDArray[np.bool_]

EPSILON = float(np.finfo(float).eps)
"""Spacing of floating-point numbers at 1."""
GOLDEN = (math.sqrt(5) - 1) / 2
"""Golden section ratio."""
MAX_ITERATIONS = 200
"""Largest number of Newton steps or bisections for a root."""
SMALL_STEP = 1e-9
"""Size of a Newton step, relative to the distance from the ends of the bracket, whose square is below rounding accuracy."""


def bisect(
    holds: Callable[[Floats], Flags], inside: Floats, outside: Floats, steps: int | None = None
) -> tuple[Floats, Floats]:
    """Locate the change of a condition by bisection.

    Parameters
    ----------
    holds : callable
        ``holds(x) -> mask`` for x of shape (n,); true at ``inside`` and false at ``outside``.
    inside, outside : ndarray, shape (n,)
        Ends of the intervals, in either order. The bisection uses their precision, double or extended.
    steps : int, optional
        Number of bisections. By default, until no number lies between the two ends, for intervals that do not start at 0.

    Returns
    -------
    inside, outside : ndarray, shape (n,)
        Neighbouring values; the condition holds at the first and not at the second.
    """
    if steps is None:
        steps = np.finfo(inside.dtype).nmant + 12
    for _ in range(steps if inside.size else 0):
        middle = 0.5 * (inside + outside)
        good = holds(middle)
        inside, outside = np.where(good, middle, inside), np.where(good, outside, middle)
    return inside, outside


def rising_root(
    function: Callable[[Floats], tuple[Floats, Floats]],
    low: ArrayLike,
    high: ArrayLike,
    guess: ArrayLike,
    noise: ArrayLike = 0.0,
) -> Floats:
    """Find the roots of functions that rise from negative at ``low`` to positive at ``high``.

    The method is a Newton iteration that bisects when a step leaves the bracket.

    Parameters
    ----------
    function : callable
        ``function(x) -> (value, slope)``. If the slope is NaN, the interval is bisected.
    low, high, guess : array_like
        Brackets and initial values, which broadcast. NaN gives NaN.
    noise : array_like
        Absolute value up to which a value counts as 0.

    Returns
    -------
    ndarray
        Roots within ``low .. high``.
    """
    low, high, x = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (low, high, guess)))
    # widen the bracket slightly, so that a Newton step can reach a root at its end
    pad = 4 * EPSILON * np.maximum(np.abs(low), np.abs(high))
    first, last = low, high
    low, high = low - pad, high + pad
    x = np.clip(x, first, last)
    settled = np.isnan(x)
    for _ in range(MAX_ITERATIONS):
        value, slope = function(x)
        low, high = np.where(value < 0, x, low), np.where(value > 0, x, high)
        step = np.divide(value, slope, out=np.full(x.shape, np.nan), where=slope > 0)
        newton = x - step
        following = np.where((newton >= low) & (newton <= high), newton, 0.5 * (low + high))
        converged = (np.abs(value) <= noise) | (np.abs(following - x) <= 2 * EPSILON * np.abs(x)) | np.isnan(value)
        # the next error is about step^2 / distance to the zero of the slope, which lies outside the bracket
        converged |= np.abs(step) <= SMALL_STEP * np.minimum(x - first, last - x)
        # converged members no longer change, so that a batch gives the same results as its members
        x = np.where(settled | (value == 0), x, following)
        settled = settled | converged
        if settled.all():
            break
    return np.clip(x, first, last)


def secant(
    function: Callable[[Floats], Floats], x_known: float, value: float
) -> Callable[[Floats], tuple[Floats, Floats]]:
    """Return a function with a secant slope, for `rising_root` with a function of one member without a derivative.

    Parameters
    ----------
    function : callable
        ``function(x) -> value``, both of shape (1,).
    x_known, value : float
        A point and the function value there. It must differ from the first point at which the result is evaluated.

    Returns
    -------
    callable
        ``with_slope(x) -> (value, slope)``, where the slope is the secant from the previous point.
    """
    before, known = np.array([x_known]), np.array([value])

    def with_slope(x: Floats) -> tuple[Floats, Floats]:
        nonlocal before, known
        here, change = function(x), x - before
        slope = np.divide(here - known, change, out=np.full(1, np.nan), where=change != 0)
        before, known = x, here
        return here, slope

    return with_slope


def closer_looks(
    function: Callable[[Floats], Floats], left: Floats, right: Floats, nodes: tuple[int, ...]
) -> tuple[Floats, Floats]:
    """Find the smallest values of functions over intervals by repeatedly refined grids.

    Parameters
    ----------
    function : callable
        ``function(x) -> values``, both of shape (n, nodes); row i belongs to interval i.
    left, right : ndarray, shape (n,)
        Ends of the intervals.
    nodes : tuple of int
        Number of nodes of each grid. Each grid covers the interval between the neighbours of the best node before it.

    Returns
    -------
    value, place : ndarray, shape (n,)
        Smallest value on the last grid, and its node. The error of the value is proportional to the square of the last
        spacing if the function is smooth.
    """
    rows = np.arange(left.size)
    for count in nodes:
        looks = np.linspace(left, right, count, axis=1)
        values = function(looks)
        best = np.argmin(values, axis=1)
        value, position = values[rows, best], looks[rows, best]
        left, right = looks[rows, np.maximum(best - 1, 0)], looks[rows, np.minimum(best + 1, count - 1)]
    return value, position


def golden_section(
    function: Callable[[Floats], Floats], left: Floats, right: Floats, steps: int
) -> tuple[Floats, Floats]:
    """Find the smallest values of functions with a single minimum in an interval, with one evaluation per step.

    This method suits functions that are slow to evaluate and may have kinks. `closer_looks` needs fewer but larger steps.

    Parameters
    ----------
    function : callable
        ``function(x) -> values``, both of the shape of ``left``.
    left, right : ndarray
        Ends of the intervals.
    steps : int
        Number of steps, each of which reduces an interval to 0.618 of its length.

    Returns
    -------
    value, place : ndarray
        Smallest value and its position.
    """
    low, high = right - GOLDEN * (right - left), left + GOLDEN * (right - left)
    at_low, at_high = function(low), function(high)
    for _ in range(steps):
        lower = at_low <= at_high
        left, right = np.where(lower, left, low), np.where(lower, high, right)
        inner, known = np.where(lower, low, high), np.where(lower, at_low, at_high)
        fresh = np.where(lower, right - GOLDEN * (right - left), left + GOLDEN * (right - left))
        value = function(fresh)
        low, high = np.where(lower, fresh, inner), np.where(lower, inner, fresh)
        at_low, at_high = np.where(lower, value, known), np.where(lower, known, value)
    return np.minimum(at_low, at_high), np.where(at_low <= at_high, low, high)
