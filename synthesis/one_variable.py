"""Roots and minima of functions of one variable, many at once: where a mechanism just closes, turns back or is at its best.

Every solver works on arrays and treats each member by itself: a batch gives to the last bit what its members give alone.
(SciPy has such solvers, but importing them takes several times as long as a scene's first answer.)
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.floating]
Flags = NDArray[np.bool_]

EPSILON = float(np.finfo(float).eps)
GOLDEN = (math.sqrt(5) - 1) / 2
MAX_ITERATIONS = 200
SMALL_STEP = 1e-9
"""A Newton step this small beside the distance to the bracket's ends squares to less than rounding."""


def bisect(
    holds: Callable[[Floats], Flags], inside: Floats, outside: Floats, steps: int | None = None
) -> tuple[Floats, Floats]:
    """The places between which a condition changes, by halving.

    ``holds``: ``holds(x) -> mask`` for places of shape (n,); true at ``inside``, false at ``outside``. ``inside``,
    ``outside`` (n,): in either order; of double or extended precision, in which the halving is done. ``steps``:
    halvings. Default: until nothing lies between the two, for intervals that do not begin at zero.

    Returns
    -------
    inside, outside : ndarray, shape (n,)
        Law: the condition holds at the first and not at the second.
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
    """Roots of functions that rise from negative at ``low`` to positive at ``high``: Newton, kept in bounds by halving.

    ``function``: ``function(x) -> (value, slope)``; a slope of NaN means that there is none, and halves. ``low``,
    ``high``, ``guess``: broadcast; NaN stays NaN. ``noise``: the value that rounding alone can make.

    Within ``low .. high``.
    """
    low, high, x = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (low, high, guess)))
    # a hair of room, so that a root at the very end is stepped onto and not halved towards
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
        near = (np.abs(value) <= noise) | (np.abs(following - x) <= 2 * EPSILON * np.abs(x)) | np.isnan(value)
        # the next error is about step^2 / distance to where the slope vanishes, which is not within the bracket
        near |= np.abs(step) <= SMALL_STEP * np.minimum(x - first, last - x)
        # what has settled stays: a batch gives to the last bit what its members give one by one
        x = np.where(settled | (value == 0), x, following)
        settled = settled | near
        if settled.all():
            break
    return np.clip(x, first, last)


def secant(
    function: Callable[[Floats], Floats], place: float, value: float
) -> Callable[[Floats], tuple[Floats, Floats]]:
    """A function of one member without a derivative, for `rising_root`: the slope is that from the place before.

    ``function``: ``function(x) -> value``, both of shape (1,). ``place``, ``value``: a place where the function is
    known, other than the first one that is asked for.
    """
    before, known = np.array([place]), np.array([value])

    def with_slope(x: Floats) -> tuple[Floats, Floats]:
        nonlocal before, known
        here, way = function(x), x - before
        slope = np.divide(here - known, way, out=np.full(1, np.nan), where=way != 0)
        before, known = x, here
        return here, slope

    return with_slope


def closer_looks(
    function: Callable[[Floats], Floats], left: Floats, right: Floats, nodes: tuple[int, ...]
) -> tuple[Floats, Floats]:
    """The least values of functions over intervals, by closer and closer looks at evenly spaced nodes.

    ``function``: ``function(x) -> values``, both of shape (n, nodes): row i belongs to interval i. ``left``, ``right``
    (n,). ``nodes``: nodes of each look; the next one looks between the neighbours of the best node.

    Returns
    -------
    value, place : ndarray, shape (n,)
        Of the last look. The value's error falls with the square of the last spacing where the function is smooth.
    """
    rows = np.arange(left.size)
    for count in nodes:
        looks = np.linspace(left, right, count, axis=1)
        values = function(looks)
        best = np.argmin(values, axis=1)
        value, place = values[rows, best], looks[rows, best]
        left, right = looks[rows, np.maximum(best - 1, 0)], looks[rows, np.minimum(best + 1, count - 1)]
    return value, place


def golden_section(
    function: Callable[[Floats], Floats], left: Floats, right: Floats, steps: int
) -> tuple[Floats, Floats]:
    """The least values of functions with one minimum in an interval, by one evaluation a step.

    For functions that are slow to evaluate and may have kinks; `closer_looks` takes fewer and larger steps.

    ``function``: ``function(x) -> values``, both of the shape of ``left``. ``steps``: each leaves 0.618 of an interval.

    Returns
    -------
    value, place : ndarray
    """
    low, high = right - GOLDEN * (right - left), left + GOLDEN * (right - left)
    at_low, at_high = function(low), function(high)
    for _ in range(steps):
        lower = at_low <= at_high
        left, right = np.where(lower, left, low), np.where(lower, high, right)
        kept, known = np.where(lower, low, high), np.where(lower, at_low, at_high)
        fresh = np.where(lower, right - GOLDEN * (right - left), left + GOLDEN * (right - left))
        value = function(fresh)
        low, high = np.where(lower, fresh, kept), np.where(lower, kept, fresh)
        at_low, at_high = np.where(lower, value, known), np.where(lower, known, value)
    return np.minimum(at_low, at_high), np.where(at_low <= at_high, low, high)
