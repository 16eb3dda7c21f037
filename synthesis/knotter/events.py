"""All events of smooth functions of one driver, so that no window between two of them is missed.

A function is replaced, piece by piece, by the polynomial through its values at Chebyshev points; a piece whose last
coefficients have not died away is halved. The sign changes of a polynomial's Bernstein coefficients bound the number
of its roots (Descartes' rule; Farouki 2012, section 5): none means none, one means one. Where they leave it open, the
derivatives' roots, from the highest derivative down, cut the piece into monotone parts. What is nearly a double root
is decided by the function itself at the extremum, in extended precision where the machine has it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from math import comb

import numpy as np

from synthesis.errors import FieldError

DEGREE = 12
"""Degree of the polynomials; coordinates turn about half a radian within a piece, so 12 is far below rounding."""
TURN_PER_PIECE = 1.0
"""Radians that a coordinate may turn within one piece at the start."""
MAX_HALVINGS = 8
"""How often a piece is halved when its polynomial is not good enough."""
MAX_PIECES_PER_ITEM = 100_000
"""Most pieces that one range may take at the start."""
MAX_ROUGH = 100_000
"""Most pieces that may wait to be halved at once."""
TAIL = 1e-13
"""Largest size of the last two coefficients against the function's own size."""
AMBIGUOUS = 1e-11
"""Bernstein coefficients below this share of the function's size have a sign that rounding may have made."""
NEAR_TANGENT = 1e-3
"""Slope over size, per piece, below which a root is bisected in extended precision; above, one Newton step does."""

Function = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""``function(driver, item) -> values``, shape (functions, *broadcast of driver and item)."""

_ORDER = np.arange(DEGREE + 1)
_NODES = np.sin(np.pi * _ORDER / (2 * DEGREE)) ** 2
_NODES[-1] = 1.0
_TO_CHEBYSHEV = np.linalg.inv(np.polynomial.chebyshev.chebvander(2 * _NODES - 1, DEGREE))
_TO_BERNSTEIN = np.linalg.inv(
    np.array([comb(DEGREE, k) for k in _ORDER])
    * _NODES[:, None] ** _ORDER
    * (1 - _NODES[:, None]) ** (DEGREE - _ORDER)
)
# The ends are values, exactly: neighbouring pieces then agree on the sign at their common end.
_TO_BERNSTEIN[0], _TO_BERNSTEIN[-1] = np.eye(DEGREE + 1)[0], np.eye(DEGREE + 1)[-1]
# Chebyshev coefficients of the derivative with respect to the place in the piece, 0 to 1.
_DERIVATIVE = np.zeros((DEGREE + 1, DEGREE + 1))
_DERIVATIVE[:-1] = 2 * np.polynomial.chebyshev.chebder(np.eye(DEGREE + 1))
_FROM_CHEBYSHEV = np.polynomial.chebyshev.chebvander(2 * _NODES - 1, DEGREE)


@dataclass(frozen=True)
class Pieces:
    """Polynomials of several functions on pieces of the driver's range.

    Attributes
    ----------
    item : ndarray of int, shape (pieces,)
    low, high : ndarray, shape (pieces,)
        The piece's ends in the driver.
    values : ndarray, shape (functions, pieces, DEGREE + 1)
        At the Chebyshev points, from ``low`` to ``high``.
    size : ndarray, shape (functions, items)
        The largest value that was met.
    """

    item: np.ndarray
    low: np.ndarray
    high: np.ndarray
    values: np.ndarray
    size: np.ndarray


@dataclass(frozen=True)
class Events:
    """Roots of functions of the driver, in no particular order; each array has shape (events,)."""

    item: np.ndarray
    function: np.ndarray
    driver: np.ndarray


def piece_ends(
    first: float, last: float, breakpoints: list[float], rate: Callable[[float, float], float]
) -> np.ndarray:
    """Ends of the pieces of a range: at the breakpoints, and so that nothing turns far within a piece.

    ``rate(low, high)`` is how many times faster than the driver anything turns between two driver angles.
    Raises `FieldError` when that takes more than `MAX_PIECES_PER_ITEM` pieces.
    """
    corners = [first, *(at for at in breakpoints if first < at < last), last]
    spans = list(itertools.pairwise(corners))
    counts = [max(1.0, np.ceil((high - low) * rate(low, high) / TURN_PER_PIECE)) for low, high in spans]
    if sum(counts) > MAX_PIECES_PER_ITEM:
        raise FieldError(
            "/laws",
            f"the laws turn so fast that a range takes {sum(counts):.0f} pieces, more than {MAX_PIECES_PER_ITEM}",
            constraint="work",
            amount=float(sum(counts)),
        )
    parts = [np.linspace(low, high, int(count) + 1)[1:] for (low, high), count in zip(spans, counts)]
    return np.concatenate([[first], *parts])


def pieces(function: Function, ends: np.ndarray, items: int, floor: np.ndarray) -> Pieces:
    """The functions as polynomials on pieces that are halved until the polynomials are good.

    Parameters
    ----------
    function : callable
    ends : ndarray, shape (n + 1,)
        Ends of the first pieces, increasing.
    items : int
    floor : ndarray, shape (functions, items)
        Rounding error of the values: no piece is halved for the sake of it.

    Notes
    -----
    A piece that is rough after `MAX_HALVINGS` stays as it is. Of what this scene asks only the distance from an axis
    is ever that rough, where the point passes through the axis.
    """
    low, high = ends[:-1], ends[1:]
    values = np.array(function(_places(low, high)[None], np.arange(items)[:, None, None]))
    values[..., 1:, 0] = values[..., :-1, -1]  # one value at a common end, to the last bit
    size = np.abs(values).max(axis=(2, 3))
    count = len(low)
    item = np.repeat(np.arange(items), count)
    low, high = np.tile(low, items), np.tile(high, items)
    values = values.reshape(len(values), items * count, DEGREE + 1)
    done = []
    for halving in range(MAX_HALVINGS + 1):
        tail = np.abs(values @ _TO_CHEBYSHEV[-2:].T).max(axis=-1)
        good = np.all(tail <= np.maximum(TAIL * size, floor)[:, item], axis=0)
        if halving == MAX_HALVINGS:
            good[:] = True
        done.append((item[good], low[good], high[good], values[:, good]))
        if np.all(good):
            break
        rough = ~good
        if np.sum(rough) > MAX_ROUGH:
            raise FieldError(
                "/laws", "the laws change too fast to be followed", constraint="work", amount=int(np.sum(rough))
            )
        item, low, high, parent = item[rough], low[rough], high[rough], values[:, rough]
        middle = low + (high - low) / 2
        left, right = (np.array(function(_places(*ends), item[:, None])) for ends in ((low, middle), (middle, high)))
        left[..., 0], right[..., -1], right[..., 0] = parent[..., 0], parent[..., -1], left[..., -1]
        item, low, high = np.tile(item, 2), np.concatenate([low, middle]), np.concatenate([middle, high])
        values = np.concatenate([left, right], axis=1)
    item, low, high = (np.concatenate(parts) for parts in list(zip(*done))[:3])
    return Pieces(item, low, high, np.concatenate([part[3] for part in done], axis=1), size)


def roots(parts: Pieces, function: Function | None, floor: np.ndarray) -> Events:
    """Every root of every function.

    Parameters
    ----------
    parts : Pieces
    function : callable or None
        The function of the pieces, to correct the polynomials' roots; None to take them as they are.
    floor : ndarray, shape (functions, items)
        A function that stays below it on a whole piece is zero there, without events.
    """
    count, _, width = parts.values.shape
    which = np.repeat(np.arange(count), len(parts.item))
    piece = np.tile(np.arange(len(parts.item)), count)
    values = parts.values.reshape(-1, width)
    item = parts.item[piece]
    size, least = parts.size[which, item], floor[which, item]
    alive = np.abs(values).max(axis=1) > least
    which, piece, values, item, size = which[alive], piece[alive], values[alive], item[alive], size[alive]

    bernstein = values @ _TO_BERNSTEIN.T
    changes = np.sum((bernstein[:, 1:] >= 0) != (bernstein[:, :-1] >= 0), axis=1)
    ambiguous = np.any(np.abs(bernstein) <= AMBIGUOUS * size[:, None], axis=1)
    simple = np.flatnonzero((changes == 1) & ~ambiguous)
    hard = np.flatnonzero((changes > 1) | ambiguous)
    chebyshev = values @ _TO_CHEBYSHEV.T

    def true_values(row: np.ndarray, place: np.ndarray, precision: type = np.longdouble) -> np.ndarray:
        """The function of each row's piece at places in it."""
        at = parts.low[piece[row]] + place.astype(precision) * (parts.high - parts.low)[piece[row]]
        return np.take_along_axis(function(at, item[row]), which[row][None], axis=0)[0]

    cuts = _monotone_parts(chebyshev[hard])
    row = np.repeat(hard, cuts.shape[1] - 1)
    left, right = cuts[:, :-1].ravel(), cuts[:, 1:].ravel()
    row, left, right = (part[right > left] for part in (row, left, right))
    if function is None:
        at_left, at_right = (_evaluate(chebyshev[row], place) for place in (left, right))
    else:
        at_left, at_right = true_values(row, left), true_values(row, right)
    # At the piece's own ends the stored value counts: the neighbouring piece has the same one.
    at_left, at_right = np.where(left > 0, at_left, values[row, 0]), np.where(right < 1, at_right, values[row, -1])
    changing = (at_left >= 0) != (at_right >= 0)
    row, left, right, positive = row[changing], left[changing], right[changing], at_left[changing] >= 0

    row = np.concatenate([simple, row])
    left = np.concatenate([np.zeros(len(simple)), left])
    right = np.concatenate([np.ones(len(simple)), right])
    positive = np.concatenate([values[simple, 0] >= 0, positive])
    coefficients, step = chebyshev[row], (parts.high - parts.low)[piece[row]]
    place = _bracketed(lambda x: _evaluate(coefficients, x), left, right, positive)
    if function is not None:
        slope = _evaluate(coefficients @ _DERIVATIVE.T, place)
        flat = np.flatnonzero(np.abs(slope) <= NEAR_TANGENT * size[row])
        slope[flat] = np.inf
        place = np.clip(place - true_values(row, place, float) / slope, left, right)
        place[flat] = _bracketed(
            lambda x: true_values(row[flat], x), left[flat], right[flat], positive[flat], np.longdouble
        )
    return Events(item[row], which[row], parts.low[piece[row]] + place * step)


def extremes(parts: Pieces, floor: np.ndarray) -> Events:
    """Every driver angle at which a function's derivative changes sign inside a piece."""
    derivative = parts.values @ (_FROM_CHEBYSHEV @ _DERIVATIVE @ _TO_CHEBYSHEV).T
    size = np.maximum(parts.size, np.finfo(float).tiny)
    noise = 64 * DEGREE**2 * np.maximum(floor, np.finfo(float).eps * size)
    return roots(Pieces(parts.item, parts.low, parts.high, derivative, size), None, noise)


def _places(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    places = low[:, None] + (high - low)[:, None] * _NODES
    places[:, -1] = high
    return places


def _evaluate(chebyshev: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Clenshaw's sum, one polynomial a row, at ``place`` in 0..1."""
    twice = 4.0 * place - 2.0
    here = np.zeros_like(place)
    next_ = np.zeros_like(place)
    for k in range(DEGREE, 0, -1):
        here, next_ = chebyshev[:, k] + twice * here - next_, here
    return chebyshev[:, 0] + 0.5 * twice * here - next_


def _bracketed(
    function: Callable[[np.ndarray], np.ndarray],
    left: np.ndarray,
    right: np.ndarray,
    positive: np.ndarray,
    precision: type = float,
) -> np.ndarray:
    """The sign changes between ``left`` and ``right`` by bisection; ``positive`` is the sign at the left.

    Bisection, because a batch is as slow as its slowest member: faster methods were measured and were slower here.
    """
    left, right = left.astype(precision), right.astype(precision)
    for _ in range(np.finfo(precision).nmant + 1 if len(left) else 0):
        middle = 0.5 * (left + right)
        same = (function(middle) >= 0) == positive
        left, right = np.where(same, middle, left), np.where(same, right, middle)
    return 0.5 * (left + right)


def _monotone_parts(chebyshev: np.ndarray) -> np.ndarray:
    """Places that cut each polynomial into monotone parts, with 0 and 1, increasing; some parts may be empty.

    The roots of each derivative lie one by one between those of the next, so they follow from the highest down.
    """
    derivatives = [chebyshev]
    while len(derivatives) < DEGREE:
        derivatives.append(derivatives[-1] @ _DERIVATIVE.T)
        bernstein = derivatives[-1] @ (_TO_BERNSTEIN @ _FROM_CHEBYSHEV).T
        if np.all(bernstein > 0, axis=1).sum() + np.all(bernstein < 0, axis=1).sum() == len(bernstein):
            break  # a derivative without roots: the one before it is monotone as a whole
    cuts = np.tile([0.0, 1.0], (len(chebyshev), 1))
    for order in range(len(derivatives) - 1, 0, -1):
        rows, parts = len(chebyshev), cuts.shape[1] - 1
        row = np.repeat(np.arange(rows), parts)
        left, right = cuts[:, :-1].ravel(), cuts[:, 1:].ravel()
        coefficients = derivatives[order][row]
        at_left, at_right = _evaluate(coefficients, left), _evaluate(coefficients, right)
        changing = np.flatnonzero((at_left >= 0) != (at_right >= 0))
        middle = right.copy()
        middle[changing] = _bracketed(
            lambda x, c=coefficients[changing]: _evaluate(c, x),
            left[changing],
            right[changing],
            at_left[changing] >= 0,
        )
        middle = middle.reshape(rows, parts)
        cuts = np.concatenate([cuts[:, :1], middle, cuts[:, -1:]], axis=1)
    return cuts
