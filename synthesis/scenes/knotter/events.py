"""All roots and extrema of smooth functions of the driver angle, found without a scan step that could miss some.

On each piece of the driver's range, a function is replaced by the polynomial through its values at Chebyshev points.
A piece is halved while the last coefficients of its polynomial are not small enough.
The number of sign changes of the Bernstein coefficients bounds the number of roots in a piece (Descartes' rule; Farouki
2012, section 5): without a change there is no root, and a single change means a single root.
If the bound is larger or uncertain, the piece is divided into monotone intervals at the extrema of the polynomial, which
are eigenvalues of a companion matrix.
The real part of a complex pair of eigenvalues divides the piece as well: it does no harm, and it preserves extrema that
nearly coincide.

A nearly double root is decided by the function itself at the extremum, in extended precision if the machine has it.
Its two roots are separated down to a distance of about 1e-8 of a piece; the companion eigenvalues of the function's own
polynomial would lose both.
Companion matrices of all pieces with a root would also take about 70 microseconds each, whereas simultaneous bisection
takes 6.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.polynomial.chebyshev import chebcompanion, chebder, chebval, chebvander

from synthesis.errors import FieldError
from synthesis.one_variable import EPSILON, Flags, Floats, bisect
from synthesis.scenes.knotter.mechanism import Integers

DEGREE = 12
"""Degree of the polynomials.
Coordinates turn by about half a radian within a piece, so that the truncation error is far below rounding."""


@dataclass(frozen=True)
class RootOptions:
    """Options of the search for roots and extrema."""

    turn_per_piece: float = 1.0
    """Largest rotation of a coordinate within an initial piece, rad."""
    max_initial_pieces: int = 100_000
    """Largest number of initial pieces of a range."""
    max_halvings: int = 8
    """Largest number of times that a piece is halved; after that its polynomial is accepted."""
    max_unresolved_pieces: int = 100_000
    """Largest number of pieces that may wait to be halved at the same time."""
    tail_tolerance: float = 1e-13
    """Largest size of the last two Chebyshev coefficients, relative to the size of the function."""
    ambiguous_sign: float = 1e-11
    """Size of a Bernstein coefficient, relative to the function, below which rounding may have changed its sign."""
    near_tangent_slope: float = 1e-3
    """Slope per piece, relative to the size of the function, below which a root counts as nearly tangent.
    Such a root is bisected in extended precision; any other root is corrected by a single Newton step."""


DEFAULT_OPTIONS = RootOptions()

Functions = Callable[[Floats, Integers], Floats]
"""``functions(driver, item) -> values``, shape (functions, *broadcast of driver and item)."""

_ORDER = np.arange(DEGREE + 1)
_NODES = np.sin(np.pi * _ORDER / (2 * DEGREE)) ** 2
_NODES[-1] = 1.0
_TO_CHEBYSHEV = np.linalg.inv(chebvander(2 * _NODES - 1, DEGREE))
_TO_BERNSTEIN = np.linalg.inv(
    np.array([comb(DEGREE, k) for k in _ORDER])
    * _NODES[:, None] ** _ORDER
    * (1 - _NODES[:, None]) ** (DEGREE - _ORDER)
)
# The end coefficients are exactly the end values, so that neighbouring pieces agree on the sign at their common end.
_TO_BERNSTEIN[[0, -1]] = np.eye(DEGREE + 1)[[0, -1]]
_TO_SLOPES = chebvander(2 * _NODES - 1, DEGREE - 1) @ chebder(_TO_CHEBYSHEV, scl=2)
"""Matrix from the values at the nodes to the derivatives there, with respect to the local coordinate 0 to 1."""


@dataclass(frozen=True)
class PiecewisePolynomials:
    """Polynomials that replace several functions on pieces of the driver's range."""

    item: Integers
    """Item to which each piece belongs, shape (pieces,)."""
    low: Floats
    """Driver angle at the lower end of each piece, shape (pieces,)."""
    high: Floats
    """Driver angle at the upper end of each piece, shape (pieces,)."""
    values: Floats
    """Values at the Chebyshev points, from ``low`` to ``high``, shape (functions, pieces, DEGREE + 1)."""
    size: Floats
    """Largest absolute value of each function on the initial pieces, shape (functions, items)."""


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
    """Divide a range of the driver into initial pieces within which no coordinate turns far.

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
        The range needs more than ``options.max_initial_pieces`` pieces.
    """
    corners = [first, *(breakpoint for breakpoint in breakpoints if first < breakpoint < last), last]
    spans = list(itertools.pairwise(corners))
    counts = [max(1.0, np.ceil((high - low) * rate(low, high) / options.turn_per_piece)) for low, high in spans]
    if sum(counts) > options.max_initial_pieces:
        raise FieldError(
            "/laws",
            f"the laws turn so fast that a range must be divided into {sum(counts):.0f} pieces, but at most "
            f"{options.max_initial_pieces} are allowed; give slower laws or a shorter range",
            constraint="work",
            amount=float(sum(counts)),
        )
    ends = [np.linspace(low, high, int(count) + 1)[1:] for (low, high), count in zip(spans, counts)]
    return np.concatenate([[first], *ends])


def fit_pieces(
    functions: Functions, ends: Floats, items: int, noise: Floats, options: RootOptions = DEFAULT_OPTIONS
) -> PiecewisePolynomials:
    """Replace functions by polynomials on pieces, halving each piece until its polynomials are accurate.

    A piece that is still inaccurate after ``options.max_halvings`` is accepted as it is.
    Among the functions of this scene this happens only to the distance of a point from an axis, if the point passes
    through the axis.

    Parameters
    ----------
    functions : callable
        The functions, see `Functions`.
    ends : ndarray, shape (pieces + 1,)
        Ends of the initial pieces (rad), increasing.
    items : int
        Number of items.
    noise : ndarray, shape (functions, items)
        Rounding error of the values; no piece is halved because of a smaller error.
    options : RootOptions, optional
        Options of the search.

    Returns
    -------
    PiecewisePolynomials
        The polynomials of all functions and items.

    Raises
    ------
    FieldError
        More than ``options.max_unresolved_pieces`` pieces would have to be halved at the same time.
    """
    low, high = ends[:-1], ends[1:]
    values = np.array(functions(_node_drivers(low, high)[None], np.arange(items)[:, None, None]), float)
    values[..., 1:, 0] = values[..., :-1, -1]  # bitwise equal values at the common end of two pieces
    size = np.abs(values).max(axis=(2, 3))
    pieces_per_item = len(low)
    item = np.repeat(np.arange(items), pieces_per_item)
    low, high = np.tile(low, items), np.tile(high, items)
    values = values.reshape(len(values), items * pieces_per_item, DEGREE + 1)
    accepted = []
    for halving in range(options.max_halvings + 1):
        tail = np.abs(values @ _TO_CHEBYSHEV[-2:].T).max(axis=-1)
        accurate = np.all(tail <= np.maximum(options.tail_tolerance * size, noise)[:, item], axis=0)
        if halving == options.max_halvings:
            accurate[:] = True
        accepted.append((item[accurate], low[accurate], high[accurate], values[:, accurate]))
        if np.all(accurate):
            break
        unresolved = ~accurate
        if np.sum(unresolved) > options.max_unresolved_pieces:
            raise FieldError(
                "/laws",
                "the laws change too fast to be followed; give smoother laws or a shorter range",
                constraint="work",
                amount=int(np.sum(unresolved)),
            )
        item, low, high, parent = item[unresolved], low[unresolved], high[unresolved], values[:, unresolved]
        middle = low + (high - low) / 2
        left, right = (
            np.array(functions(_node_drivers(*ends), item[:, None]), float)
            for ends in ((low, middle), (middle, high))
        )
        left[..., 0], right[..., -1], right[..., 0] = parent[..., 0], parent[..., -1], left[..., -1]
        item, low, high = np.tile(item, 2), np.concatenate([low, middle]), np.concatenate([middle, high])
        values = np.concatenate([left, right], axis=1)
    item, low, high = (np.concatenate(columns) for columns in list(zip(*accepted))[:3])
    return PiecewisePolynomials(item, low, high, np.concatenate([piece[3] for piece in accepted], axis=1), size)


class _Rows(NamedTuple):
    """One polynomial per row: each pair of a function and a piece whose values exceed the noise."""

    function: Integers
    item: Integers
    start: Floats
    step: Floats
    values: Floats
    size: Floats
    chebyshev: Floats

    def evaluate(self, functions: Functions, row: Integers, position: Floats) -> Floats:
        """Return the true function of each row at a local position 0 to 1, in the precision of ``position``."""
        at_driver = functions(self.start[row] + position * self.step[row], self.item[row])
        values: Floats = np.take_along_axis(at_driver, self.function[row][None], axis=0)[0]
        return values


class _Brackets(NamedTuple):
    """Intervals that contain exactly one root each, in local positions 0 to 1 of a row."""

    row: Integers
    left: Floats
    right: Floats
    positive_at_left: Flags


def find_roots(
    polynomials: PiecewisePolynomials,
    functions: Functions | None,
    noise: Floats,
    options: RootOptions = DEFAULT_OPTIONS,
) -> Events:
    """Find every root of every function.

    Parameters
    ----------
    polynomials : PiecewisePolynomials
        The functions as polynomials, see `fit_pieces`.
    functions : callable, optional
        The functions themselves, to correct the roots of the polynomials.
        If None, the roots of the polynomials are returned.
    noise : ndarray, shape (functions, items)
        A function that stays below this value on a whole piece is zero there and has no roots in it.
    options : RootOptions, optional
        Options of the search.

    Returns
    -------
    Events
        The roots.
    """
    rows = _rows_above_noise(polynomials, noise)
    brackets = _bracket_roots(rows, functions, options)
    position = _refine_roots(rows, brackets, functions, options)
    row = brackets.row
    return Events(rows.item[row], rows.function[row], rows.start[row] + position * rows.step[row])


def _rows_above_noise(polynomials: PiecewisePolynomials, noise: Floats) -> _Rows:
    function, piece = (index.ravel() for index in np.indices(polynomials.values.shape[:2]))
    values, item = polynomials.values.reshape(len(function), -1), polynomials.item[piece]
    size = polynomials.size[function, item]
    nonzero = np.abs(values).max(axis=1) > noise[function, item]
    function, piece, item, values, size = (column[nonzero] for column in (function, piece, item, values, size))
    start, step = polynomials.low[piece], (polynomials.high - polynomials.low)[piece]
    return _Rows(function, item, start, step, values, size, values @ _TO_CHEBYSHEV.T)


def _bracket_roots(rows: _Rows, functions: Functions | None, options: RootOptions) -> _Brackets:
    values, chebyshev = rows.values, rows.chebyshev
    bernstein = values @ _TO_BERNSTEIN.T
    sign_changes = np.sum((bernstein[:, 1:] >= 0) != (bernstein[:, :-1] >= 0), axis=1)
    ambiguous = np.any(np.abs(bernstein) <= options.ambiguous_sign * rows.size[:, None], axis=1)
    single = np.flatnonzero((sign_changes == 1) & ~ambiguous)
    undecided = np.flatnonzero((sign_changes > 1) | ambiguous)

    cuts = _monotone_intervals(chebyshev[undecided])
    row = np.repeat(undecided, cuts.shape[1] - 1)
    left, right = cuts[:, :-1].ravel(), cuts[:, 1:].ravel()
    nonempty = right > left
    row, left, right = row[nonempty], left[nonempty], right[nonempty]
    at_left, at_right = (
        _evaluate_chebyshev(chebyshev[row], end)
        if functions is None
        else rows.evaluate(functions, row, end.astype(np.longdouble))
        for end in (left, right)
    )
    # At the ends of a piece the stored value is used, because the neighbouring piece stores the same value.
    at_left, at_right = np.where(left > 0, at_left, values[row, 0]), np.where(right < 1, at_right, values[row, -1])
    changes_sign = (at_left >= 0) != (at_right >= 0)

    return _Brackets(
        np.concatenate([single, row[changes_sign]]),
        np.concatenate([np.zeros(len(single)), left[changes_sign]]),
        np.concatenate([np.ones(len(single)), right[changes_sign]]),
        np.concatenate([values[single, 0], at_left[changes_sign]]) >= 0,
    )


def _refine_roots(rows: _Rows, brackets: _Brackets, functions: Functions | None, options: RootOptions) -> Floats:
    """Return the local position of the root in each bracket."""
    row, left, right, positive_at_left = brackets
    coefficients = rows.chebyshev[row]
    position = _sign_change(lambda x: _evaluate_chebyshev(coefficients, x), left, right, positive_at_left)
    if functions is None:
        return position
    slope = _evaluate_chebyshev(chebder(coefficients, scl=2, axis=1), position)
    tangent = np.flatnonzero(np.abs(slope) <= options.near_tangent_slope * rows.size[row])
    slope[tangent] = np.inf
    position = np.clip(position - rows.evaluate(functions, row, position) / slope, left, right)
    extended_left, extended_right = (end[tangent].astype(np.longdouble) for end in (left, right))
    position[tangent] = _sign_change(
        lambda x: rows.evaluate(functions, row[tangent], x), extended_left, extended_right, positive_at_left[tangent]
    )
    return position


def find_extrema(polynomials: PiecewisePolynomials, noise: Floats, options: RootOptions = DEFAULT_OPTIONS) -> Events:
    """Find every driver angle inside a piece at which the derivative of a function changes sign.

    Parameters
    ----------
    polynomials : PiecewisePolynomials
        The functions as polynomials, see `fit_pieces`.
    noise : ndarray, shape (functions, items) or (1, items)
        Rounding error of the values.
    options : RootOptions, optional
        Options of the search.

    Returns
    -------
    Events
        The extrema.
    """
    size = np.maximum(polynomials.size, np.finfo(float).tiny)
    slope_noise = 64 * DEGREE**2 * np.maximum(noise, EPSILON * size)
    slopes = polynomials.values @ _TO_SLOPES.T
    derivative = PiecewisePolynomials(polynomials.item, polynomials.low, polynomials.high, slopes, size)
    return find_roots(derivative, None, slope_noise, options)


def _node_drivers(low: Floats, high: Floats) -> Floats:
    """Return the driver angles of the Chebyshev points of each piece, shape (pieces, DEGREE + 1)."""
    drivers: Floats = low[:, None] + (high - low)[:, None] * _NODES
    drivers[:, -1] = high
    return drivers


def _evaluate_chebyshev(coefficients: Floats, position: Floats) -> Floats:
    """Evaluate one polynomial per row at a local position 0 to 1."""
    return np.asarray(chebval(2 * position - 1, coefficients.T, tensor=False))


def _sign_change(
    function: Callable[[Floats], Floats], left: Floats, right: Floats, positive_at_left: Flags
) -> Floats:
    """Locate the sign change between ``left`` and ``right``, in their precision.

    Bisection is used because a batch is as slow as its slowest member; faster methods were slower here when measured.
    """
    steps = np.finfo(left.dtype).nmant + 1
    before, after = bisect(lambda x: (function(x) >= 0) == positive_at_left, left, right, steps)
    return 0.5 * (before + after)


def _monotone_intervals(chebyshev: Floats) -> Floats:
    """Return the local positions, increasing from 0 to 1, between which each polynomial is monotone.

    Some intervals may be empty.
    A leading coefficient below rounding is raised to rounding, because the companion matrix divides by it.
    """
    slopes = chebder(chebyshev, axis=1)
    rounding = EPSILON * np.abs(chebyshev).max(axis=1)
    slopes[:, -1] = np.where(np.abs(slopes[:, -1]) > rounding, slopes[:, -1], rounding)
    companions = [chebcompanion(row)[::-1, ::-1] for row in slopes]  # in this order fewer digits are lost
    extrema = np.linalg.eigvals(np.reshape(companions, (-1, DEGREE - 1, DEGREE - 1))).real
    inner = np.sort(np.clip(0.5 + 0.5 * extrema, 0.0, 1.0), axis=1)
    return np.pad(inner, ((0, 0), (1, 1)), constant_values=((0, 0), (0, 1)))
