"""All roots and smallest values of smooth functions of the driver angle.

The functions are sampled so densely that no coordinate turns far between two samples. A sign change between two samples
is a root. Where the size of a function has a minimum that may reach zero between samples of the same sign, the function
itself at the minimum decides.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synthesis.one_variable import Flags, Floats, bisect, golden_section, rising_root
from synthesis.scenes.knotter.mechanism import Integers


@dataclass(frozen=True)
class RootOptions:
    """Options of the search for roots and smallest values."""

    near_zero: float = 0.5
    """Smallest size of a function near a minimum that cannot be a root, as a fraction of its second difference."""
    golden_steps: int = 70
    """Number of golden-section steps to a minimum."""
    slope_step: float = 1e-6
    """Step of the difference quotients, as a fraction of the distance between samples."""


OPTIONS = RootOptions()

Functions = Callable[[Floats, Integers], Floats]
"""``functions(driver, item) -> values``, shape (functions, *broadcast of driver and item)."""


class Events(NamedTuple):
    """Roots of functions of the driver, in no particular order."""

    item: Integers
    """Item of each root, shape (roots,)."""
    function: Integers
    """Index of the function, shape (roots,)."""
    driver: Floats
    """Driver angle of each root, shape (roots,)."""


def find_roots(functions: Functions, driver: Floats, values: Floats, noise: Floats) -> Events:
    """Find the roots of every function.

    Parameters
    ----------
    functions : callable
        The functions, see `Functions`.
    driver : ndarray, shape (samples,)
        Driver angles of the samples, increasing.
    values : ndarray, shape (functions, items, samples)
        Values of the functions.
    noise : ndarray, shape (functions, items)
        Size below which a value counts as zero: it has the sign of the last larger value.
    """

    def of(function: Integers, item: Integers, sign: Floats) -> Callable[[Floats], Floats]:
        """Return the values of some functions, times a sign, at a driver angle for each."""
        return lambda x: sign * np.take_along_axis(functions(x, item), function[None], axis=0)[0]

    clear = np.abs(values) > noise[..., None]
    source = np.maximum.accumulate(np.where(clear, np.arange(driver.size), -1), axis=-1)
    source = np.where(source < 0, np.argmax(clear, axis=-1)[..., None], source)
    sign = np.where(np.take_along_axis(values, source, axis=-1) >= 0, 1.0, -1.0)

    function, item, node = np.nonzero(sign[..., 1:] != sign[..., :-1])
    rising = of(function, item, -sign[function, item, node])
    crossed = Events(item, function, _root(rising, driver[node], driver[node + 1]))

    function, item, node = np.nonzero(_near_zero(sign * values, sign))
    left, right = driver[node], driver[node + 2]
    lowest, middle = golden_section(of(function, item, sign[function, item, node]), left, right, OPTIONS.golden_steps)
    double = np.flatnonzero(lowest < 0)
    function, item, node, middle = function[double], item[double], node[double], middle[double]
    positive = of(function, item, sign[function, item, node])
    roots = [np.mean(bisect(lambda x: positive(x) >= 0, end[double], middle), axis=0) for end in (left, right)]
    return Events(
        *(np.concatenate(rows) for rows in zip(crossed, (item, function, roots[0]), (item, function, roots[1])))
    )


def _root(rising: Callable[[Floats], Floats], left: Floats, right: Floats) -> Floats:
    """Return the root of each rising function between two samples, by Newton's method with difference quotients."""
    if not left.size:
        return left
    width = right - left

    def with_slope(x: Floats) -> tuple[Floats, Floats]:
        step = OPTIONS.slope_step * np.where(x > 0.5 * (left + right), -width, width)
        value = rising(x)
        return value, (rising(x + step) - value) / step

    return rising_root(with_slope, left, right, 0.5 * (left + right))


def _near_zero(size: Floats, sign: Floats) -> Flags:
    """Return where a parabola through three samples of one sign has a minimum that may reach zero, shape (..., samples - 2).

    The minimum lies next to the middle sample, or at the ends of the range beyond it.
    """
    before, here, after = size[..., :-2], size[..., 1:-1], size[..., 2:]
    bend = before - 2 * here + after
    lowest, highest = (np.full(here.shape[-1], value) for value in (-1.0, 1.0))
    lowest[0], highest[-1] = -2.0, 2.0
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = (before - after) / bend
        reaches_zero = here - bend * shift**2 / 8 < OPTIONS.near_zero * bend
    is_minimum = (bend > 0) & (lowest <= shift) & (shift <= highest) & reaches_zero
    return np.asarray(is_minimum & (sign[..., :-2] == sign[..., 1:-1]) & (sign[..., 1:-1] == sign[..., 2:]))


def smallest_values(function: Functions, driver: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Find the smallest value of a continuous function for each item, which may be at a kink or an end of the range.

    Parameters
    ----------
    function : callable
        ``function(driver, item) -> values``, of the common shape of its arguments.
    driver : ndarray, shape (samples,)
        Driver angles of the samples, increasing.
    values : ndarray, shape (items, samples)
        Values of the function.

    Returns
    -------
    value, driver : ndarray, shape (items,)
        Smallest values, and the first driver angle of each.
    """
    padded = np.pad(values, [(0, 0), (1, 1)], constant_values=np.inf)
    item, node = np.nonzero((values < padded[:, :-2]) & (values <= padded[:, 2:]))
    left, right = driver[np.maximum(node - 1, 0)], driver[np.minimum(node + 1, driver.size - 1)]
    lowest, at = golden_section(lambda x: function(x, item), left, right, OPTIONS.golden_steps)
    # the sample remains a candidate, because at an end of the range the bracket has only its inner side
    is_sample = values[item, node] <= lowest
    lowest, at = np.where(is_sample, values[item, node], lowest), np.where(is_sample, driver[node], at)
    order = np.lexsort((at, lowest, item))
    first = order[np.searchsorted(item[order], np.arange(len(values)))]
    return lowest[first], at[first]
