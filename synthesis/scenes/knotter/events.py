"""All roots of smooth functions of one driver, so that no window between two of them is missed.

A function is replaced, piece by piece, by the polynomial through its values at Chebyshev points; a piece whose last
coefficients have not died away is halved. The sign changes of a polynomial's Bernstein coefficients bound the number
of its roots (Descartes' rule; Farouki 2012, section 5): none means none, one means one. Where they leave it open, the
polynomial's extremes cut the piece into monotone parts. They are eigenvalues of a companion matrix; of a complex pair
the real part cuts as well, which does no harm and keeps extremes that nearly meet.

What is nearly a double root is decided by the function itself at the extreme, in extended precision where the machine
has it: its two roots are told apart down to a distance of about 1e-8 of a piece, where companion eigenvalues of the
function's own polynomial would lose both. Companions of all pieces with a root would also take some 70 microseconds each,
where bisecting them all at once takes 6.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.polynomial.chebyshev import chebcompanion, chebder, chebval, chebvander

from synthesis.errors import FieldError
from synthesis.one_variable import EPSILON, Flags, Floats, bisect
from synthesis.scenes.knotter.mechanism import Integers

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

Function = Callable[[Floats, Integers], Floats]
"""``function(driver, item) -> values``, shape (functions, *broadcast of driver and item)."""

_ORDER = np.arange(DEGREE + 1)
_NODES = np.sin(np.pi * _ORDER / (2 * DEGREE)) ** 2
_NODES[-1] = 1.0
_TO_CHEBYSHEV = np.linalg.inv(chebvander(2 * _NODES - 1, DEGREE))
_TO_BERNSTEIN = np.linalg.inv(
    np.array([comb(DEGREE, k) for k in _ORDER])
    * _NODES[:, None] ** _ORDER
    * (1 - _NODES[:, None]) ** (DEGREE - _ORDER)
)
# The ends are values, exactly: neighbouring pieces then agree on the sign at their common end.
_TO_BERNSTEIN[[0, -1]] = np.eye(DEGREE + 1)[[0, -1]]
_TO_SLOPES = chebvander(2 * _NODES - 1, DEGREE - 1) @ chebder(_TO_CHEBYSHEV, scl=2)
"""From the values at the nodes to those of the derivative with respect to the place in the piece, 0 to 1."""


@dataclass(frozen=True)
class Pieces:
    """Polynomials of several functions on pieces of the driver's range."""

    item: Integers
    """Shape (pieces,)."""
    low: Floats
    high: Floats
    """The piece's ends in the driver, shape (pieces,)."""
    values: Floats
    """At the Chebyshev points, from ``low`` to ``high``, shape (functions, pieces, DEGREE + 1)."""
    size: Floats
    """The largest value that was met, shape (functions, items)."""


@dataclass(frozen=True)
class Events:
    """Roots of functions of the driver, in no particular order; each array has shape (events,)."""

    item: Integers
    function: Integers
    driver: Floats


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


def pieces(function: Function, ends: Floats, items: int, floor: Floats) -> Pieces:
    """The functions as polynomials on pieces that are halved until the polynomials are good.

    ``ends`` (n + 1,): ends of the first pieces, increasing. ``floor`` (functions, items): rounding error of the values:
    no piece is halved for the sake of it.

    A piece that is rough after `MAX_HALVINGS` stays as it is. Of what this scene asks only the distance from an axis is
    ever that rough, where the point passes through the axis.
    """
    low, high = ends[:-1], ends[1:]
    values = np.array(function(_places(low, high)[None], np.arange(items)[:, None, None]), float)
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
        left, right = (
            np.array(function(_places(*ends), item[:, None]), float) for ends in ((low, middle), (middle, high))
        )
        left[..., 0], right[..., -1], right[..., 0] = parent[..., 0], parent[..., -1], left[..., -1]
        item, low, high = np.tile(item, 2), np.concatenate([low, middle]), np.concatenate([middle, high])
        values = np.concatenate([left, right], axis=1)
    item, low, high = (np.concatenate(parts) for parts in list(zip(*done))[:3])
    return Pieces(item, low, high, np.concatenate([part[3] for part in done], axis=1), size)


def roots(parts: Pieces, function: Function | None, floor: Floats) -> Events:
    """Every root of every function.

    ``function``: the function of the pieces, to correct the polynomials' roots; None to take them as they are.
    ``floor`` (functions, items): a function that stays below it on a whole piece is zero there, without events.
    """
    which, piece = (index.ravel() for index in np.indices(parts.values.shape[:2]))
    values, item = parts.values.reshape(len(which), -1), parts.item[piece]
    size = parts.size[which, item]
    alive = np.abs(values).max(axis=1) > floor[which, item]
    which, piece, item, values, size = (part[alive] for part in (which, piece, item, values, size))
    start, step = parts.low[piece], (parts.high - parts.low)[piece]

    def true_values(row: Integers, place: Floats) -> Floats:
        """The function of each row's piece at places in it, in their precision."""
        assert function is not None
        at_driver = function(start[row] + place * step[row], item[row])
        values: Floats = np.take_along_axis(at_driver, which[row][None], axis=0)[0]
        return values

    bernstein = values @ _TO_BERNSTEIN.T
    changes = np.sum((bernstein[:, 1:] >= 0) != (bernstein[:, :-1] >= 0), axis=1)
    ambiguous = np.any(np.abs(bernstein) <= AMBIGUOUS * size[:, None], axis=1)
    simple = np.flatnonzero((changes == 1) & ~ambiguous)
    hard = np.flatnonzero((changes > 1) | ambiguous)
    chebyshev = values @ _TO_CHEBYSHEV.T

    cuts = _monotone_parts(chebyshev[hard])
    row = np.repeat(hard, cuts.shape[1] - 1)
    left, right = cuts[:, :-1].ravel(), cuts[:, 1:].ravel()
    full = right > left
    row, left, right = row[full], left[full], right[full]
    at_left, at_right = (
        _evaluate(chebyshev[row], end) if function is None else true_values(row, end.astype(np.longdouble))
        for end in (left, right)
    )
    # At the piece's own ends the stored value counts: the neighbouring piece has the same one.
    at_left, at_right = np.where(left > 0, at_left, values[row, 0]), np.where(right < 1, at_right, values[row, -1])
    changing = (at_left >= 0) != (at_right >= 0)

    row = np.concatenate([simple, row[changing]])
    left = np.concatenate([np.zeros(len(simple)), left[changing]])
    right = np.concatenate([np.ones(len(simple)), right[changing]])
    positive = np.concatenate([values[simple, 0], at_left[changing]]) >= 0
    coefficients = chebyshev[row]
    place = _sign_change(lambda x: _evaluate(coefficients, x), left, right, positive)
    if function is not None:
        slope = _evaluate(chebder(coefficients, scl=2, axis=1), place)
        flat = np.flatnonzero(np.abs(slope) <= NEAR_TANGENT * size[row])
        slope[flat] = np.inf
        place = np.clip(place - true_values(row, place) / slope, left, right)
        first, last = (end[flat].astype(np.longdouble) for end in (left, right))
        place[flat] = _sign_change(lambda x: true_values(row[flat], x), first, last, positive[flat])
    return Events(item[row], which[row], start[row] + place * step[row])


def extremes(parts: Pieces, floor: Floats) -> Events:
    """Every driver angle at which a function's derivative changes sign inside a piece."""
    size = np.maximum(parts.size, np.finfo(float).tiny)
    noise = 64 * DEGREE**2 * np.maximum(floor, EPSILON * size)
    return roots(Pieces(parts.item, parts.low, parts.high, parts.values @ _TO_SLOPES.T, size), None, noise)


def _places(low: Floats, high: Floats) -> Floats:
    places: Floats = low[:, None] + (high - low)[:, None] * _NODES
    places[:, -1] = high
    return places


def _evaluate(chebyshev: Floats, place: Floats) -> Floats:
    """One polynomial a row, at ``place`` in 0..1."""
    return np.asarray(chebval(2 * place - 1, chebyshev.T, tensor=False))


def _sign_change(function: Callable[[Floats], Floats], left: Floats, right: Floats, positive: Flags) -> Floats:
    """The sign changes between ``left`` and ``right``, ``positive`` at the left, in the precision of the two.

    By bisection, because a batch is as slow as its slowest member: faster methods were measured and were slower here.
    """
    steps = np.finfo(left.dtype).nmant + 1
    before, after = bisect(lambda x: (function(x) >= 0) == positive, left, right, steps)
    return 0.5 * (before + after)


def _monotone_parts(chebyshev: Floats) -> Floats:
    """Places that cut each polynomial into monotone parts, with 0 and 1, increasing; some parts may be empty.

    A leading coefficient below rounding is raised to it: the companion matrix divides by it.
    """
    slopes = chebder(chebyshev, axis=1)
    least = EPSILON * np.abs(chebyshev).max(axis=1)
    slopes[:, -1] = np.where(np.abs(slopes[:, -1]) > least, slopes[:, -1], least)
    companions = [chebcompanion(row)[::-1, ::-1] for row in slopes]  # this way round it loses fewer digits
    turns = np.linalg.eigvals(np.reshape(companions, (-1, DEGREE - 1, DEGREE - 1))).real
    inner = np.sort(np.clip(0.5 + 0.5 * turns, 0.0, 1.0), axis=1)
    return np.pad(inner, ((0, 0), (1, 1)), constant_values=((0, 0), (0, 1)))
