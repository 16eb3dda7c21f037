"""All roots and extrema of smooth functions of the driver angle.

The functions are sampled so densely that no coordinate turns far between two nodes. A sign change between two nodes is a
root. Where the size of a function has a minimum that may reach zero between nodes of the same sign, the function itself at
the minimum decides, in extended precision if the machine has it: two roots that nearly coincide are separated down to a
distance of about 1e-8 of a piece.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from synthesis.errors import FieldError
from synthesis.one_variable import Flags, Floats, bisect, golden_section, rising_root
from synthesis.scenes.knotter.mechanism import Integers


@dataclass(frozen=True)
class RootOptions:
    """Options of the search for roots and extrema."""

    turn_per_piece: float = 1.0
    """Largest rotation of a coordinate within a piece, rad."""
    max_pieces: int = 100_000
    """Largest number of pieces of a range."""
    nodes_per_piece: int = 16
    """Number of steps between nodes in each piece."""
    near_zero: float = 0.5
    """Smallest size of a function near a minimum that cannot be a root, as a fraction of its second difference."""
    golden_steps: int = 70
    """Number of golden-section steps to an extremum."""
    slope_step: float = 1e-6
    """Step of the difference quotients, as a fraction of the distance between nodes."""


DEFAULT_OPTIONS = RootOptions()

Functions = Callable[[Floats, Integers], Floats]
"""``functions(driver, item) -> values``, shape (functions, *broadcast of driver and item)."""


@dataclass(frozen=True)
class Samples:
    """Values of several functions at nodes of the driver's range."""

    functions: Functions
    """The functions."""
    driver: Floats
    """Driver angles of the nodes, increasing, shape (nodes,)."""
    values: Floats
    """Values, shape (functions, items, nodes)."""

    @property
    def size(self) -> Floats:
        """Largest absolute value of each function, shape (functions, items)."""
        return np.abs(self.values).max(axis=-1)

    def of(self, function: Integers, item: Integers, sign: Floats) -> Callable[[Floats], Floats]:
        """Return the values of some functions, times a sign, at a driver angle for each."""

        def value(driver: Floats) -> Floats:
            return sign * np.take_along_axis(self.functions(driver, item), function[None], axis=0)[0]

        return value


@dataclass(frozen=True)
class Events:
    """Roots or extrema of functions of the driver, in no particular order."""

    item: Integers
    """Item of each event, shape (events,)."""
    function: Integers
    """Index of the function that has the event, shape (events,)."""
    driver: Floats
    """Driver angle of each event, shape (events,)."""


def piece_ends(
    first: float,
    last: float,
    breakpoints: list[float],
    rate: Callable[[float, float], float],
    options: RootOptions = DEFAULT_OPTIONS,
) -> np.ndarray:
    """Divide a range of the driver into pieces within which no coordinate turns far.

    Parameters
    ----------
    first, last : float
        Ends of the range, rad.
    breakpoints : list of float
        Driver angles at which the functions are not smooth, increasing.
    rate : callable
        ``rate(low, high)`` bounds the rotation per driver rotation between two driver angles.
    options : RootOptions, optional
        Options of the search.

    Returns
    -------
    ndarray, shape (pieces + 1,)
        Ends of the pieces, increasing.

    Raises
    ------
    FieldError
        The range needs more than ``options.max_pieces`` pieces.
    """
    corners = [first, *(breakpoint for breakpoint in breakpoints if first < breakpoint < last), last]
    spans = list(itertools.pairwise(corners))
    counts = [max(1.0, np.ceil((high - low) * rate(low, high) / options.turn_per_piece)) for low, high in spans]
    if sum(counts) > options.max_pieces:
        raise FieldError(
            "/laws",
            f"the laws turn so fast that a range must be divided into {sum(counts):.0f} pieces, but at most "
            f"{options.max_pieces} are allowed; give slower laws or a shorter range",
            constraint="work",
            amount=float(sum(counts)),
        )
    ends = [np.linspace(low, high, int(count) + 1)[1:] for (low, high), count in zip(spans, counts)]
    return np.concatenate([[first], *ends])


def sample(functions: Functions, ends: Floats, items: int, options: RootOptions = DEFAULT_OPTIONS) -> Samples:
    """Evaluate functions at the nodes of all pieces.

    Parameters
    ----------
    functions : callable
        The functions, see `Functions`.
    ends : ndarray, shape (pieces + 1,)
        Ends of the pieces (rad), increasing.
    items : int
        Number of items.
    options : RootOptions, optional
        Options of the search.
    """
    steps = np.linspace(ends[:-1], ends[1:], options.nodes_per_piece, endpoint=False, axis=1)
    driver = np.append(steps.ravel(), ends[-1])
    return Samples(functions, driver, np.array(functions(driver[None], np.arange(items)[:, None]), float))


def find_roots(samples: Samples, noise: Floats, options: RootOptions = DEFAULT_OPTIONS) -> Events:
    """Find the roots of every function.

    Parameters
    ----------
    samples : Samples
        The functions at the nodes.
    noise : ndarray, shape (functions, items)
        Size below which a value counts as zero: it has the sign of the last larger value.
    options : RootOptions, optional
        Options of the search.

    Returns
    -------
    Events
        The roots.
    """
    values, nodes = samples.values, np.arange(samples.driver.size)
    clear = np.abs(values) > noise[..., None]
    source = np.maximum.accumulate(np.where(clear, nodes, -1), axis=-1)
    source = np.where(source < 0, np.argmax(clear, axis=-1)[..., None], source)
    sign = np.where(np.take_along_axis(values, source, axis=-1) >= 0, 1.0, -1.0)

    function, item, node = np.nonzero(sign[..., 1:] != sign[..., :-1])
    left, right = samples.driver[node], samples.driver[node + 1]
    rising = samples.of(function, item, -sign[function, item, node])
    crossed = Events(item, function, _root(rising, left, right, options))

    function, item, node = np.nonzero(_near_zero(sign * values, sign, options))
    ends = (samples.driver[node + k].astype(np.longdouble) for k in (0, 2))
    left, right = ends
    falling = samples.of(function, item, sign[function, item, node])
    lowest, middle = golden_section(falling, left, right, options.golden_steps)
    double = np.flatnonzero(lowest < 0)
    function, item, middle = function[double], item[double], middle[double]
    positive = samples.of(function, item, sign[function, item, node[double]])
    roots = [crossed.driver]
    for end in (left[double], right[double]):
        outside, inside = bisect(lambda x: positive(x) >= 0, end, middle)
        roots.append((0.5 * (outside + inside)).astype(float))
    return Events(
        np.concatenate([crossed.item, item, item]),
        np.concatenate([crossed.function, function, function]),
        np.concatenate(roots),
    )


def _root(rising: Callable[[Floats], Floats], left: Floats, right: Floats, options: RootOptions) -> Floats:
    """Return the root of each rising function between two nodes, by Newton's method with difference quotients."""
    if not left.size:
        return left
    width = right - left

    def with_slope(x: Floats) -> tuple[Floats, Floats]:
        step = options.slope_step * np.where(x > 0.5 * (left + right), -width, width)
        value = rising(x)
        return value, (rising(x + step) - value) / step

    return rising_root(with_slope, left, right, 0.5 * (left + right))


def _near_zero(size: Floats, sign: Floats, options: RootOptions) -> Flags:
    """Return where a parabola through three nodes of one sign has a minimum that may reach zero, shape (..., nodes - 2).

    The minimum lies next to the middle node, or at the ends of the range beyond it.
    """
    before, here, after = size[..., :-2], size[..., 1:-1], size[..., 2:]
    bend = before - 2 * here + after
    lowest, highest = (np.full(here.shape[-1], value) for value in (-1.0, 1.0))
    lowest[0], highest[-1] = -2.0, 2.0
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = (before - after) / bend
        reaches_zero = here - bend * shift**2 / 8 < options.near_zero * bend
    is_minimum = (bend > 0) & (lowest <= shift) & (shift <= highest) & reaches_zero
    return np.asarray(is_minimum & (sign[..., :-2] == sign[..., 1:-1]) & (sign[..., 1:-1] == sign[..., 2:]))


def find_extrema(samples: Samples, options: RootOptions = DEFAULT_OPTIONS) -> Events:
    """Find the driver angles at which a function is smallest or largest nearby, the ends of the range among them."""
    steps, last, found = np.diff(samples.values), samples.driver.size - 1, []
    beside = [(0, 0)] * (steps.ndim - 1)
    for sign in (1.0, -1.0):
        falls = np.pad(sign * steps <= 0, [*beside, (1, 0)], constant_values=True)
        rises = np.pad(sign * steps > 0, [*beside, (0, 1)], constant_values=True)
        function, item, node = np.nonzero(falls & rises)
        value = samples.of(function, item, np.full(node.shape, sign))
        left, right = samples.driver[np.maximum(node - 1, 0)], samples.driver[np.minimum(node + 1, last)]
        found.append((item, function, golden_section(value, left, right, options.golden_steps)[1]))
    item, function, driver = (np.concatenate(columns) for columns in zip(*found))
    return Events(item, function, driver)
