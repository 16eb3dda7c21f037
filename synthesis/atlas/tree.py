"""A tree of dimension types with similar rotation curves: what the scan needs to exclude most windows in groups.

The types are the leaves, in an order in which neighbours are alike. Eight leaves have a common parent, eight parents a common
parent, and so on up to at most 32 roots. A node is the mean series of its leaves and bounds, for every piece of the turn, how
much the slope and the second derivative of any leaf differ from slope and second derivative of the mean. `docs/method.md`
derives what follows from it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Floats, Ints, Singles
from synthesis.atlas.table import COLUMNS, HARMONICS, Series
from synthesis.target import TURN

WIDTH = 8
"""Children of a node."""
MAX_ROOTS = 32
PIECES = 36
"""Pieces of the turn for which the differences of a node are stored."""
_POINTS = 288
"""Points over the turn at which differences are computed."""
_AXES = 6
"""Principal axes of the series along which the types are halved."""
_ROUNDING = 4e-6
"""Rounding of a product of a series and a table in single precision, as a fraction of the sum of its magnitudes."""
_ABOVE_SINGLE = np.float32(1 + 1e-5)
"""Covers the rounding of differences in single precision."""
_NEGLIGIBLE = 1e-11
"""Coefficients below this are stored as 0, which takes less of the file."""
_AT_ONCE = 4096


class Level(NamedTuple):
    """Nodes of one level, or the types themselves at the lowest; the children of node n are 8 n .. 8 n + 7 of the next level.

    ``series`` (n, COLUMNS): NaN in a place without a node. ``errors`` (n, 2): largest errors of the series of the types
    below, see `Series`. ``slopes``, ``bends`` (n, PIECES): largest differences of first and second derivative, (n, 0) for
    types.
    """

    series: Singles
    errors: Singles
    slopes: Singles
    bends: Singles


class Tree(NamedTuple):
    """Levels from the roots to the types, and the row of each leaf, -1 if there is none."""

    levels: list[Level]
    rows: NDArray[np.int32]


def depth_of(types: int) -> int:
    """Return the number of levels above the types."""
    depth = 0
    while -(-types // WIDTH**depth) > MAX_ROOTS:
        depth += 1
    return depth


def level_sizes(types: int) -> list[int]:
    """Return the number of places at each level, from the roots to the types."""
    depth = depth_of(types)
    roots = -(-types // WIDTH**depth)
    return [-(-roots // WIDTH) * WIDTH, *(roots * WIDTH**level for level in range(1, depth + 1))]


def build_tree(series: Series) -> Tree:
    """Build the tree of types from their series."""
    count, depth = len(series.errors), depth_of(len(series.errors))
    roots = -(-count // WIDTH**depth)
    extra = roots * WIDTH**depth - count
    # a place that is left over repeats some type, so that it does not move the means
    types = np.concatenate([np.arange(count), np.arange(extra) * (count // max(1, extra))])
    order = _ordered(series.coefficients, types, roots)
    leaves, rows = types[order], np.where(order < count, order, -1).astype(np.int32)
    coefficients, errors = series.coefficients[leaves], series.errors[leaves]
    single = np.where(np.abs(coefficients) < _NEGLIGIBLE, 0, coefficients).astype(np.float32)
    lost = np.abs(coefficients - single)
    harmonic = np.concatenate([[TURN, 0.0], np.repeat(np.arange(1.0, HARMONICS + 1), 2)])
    errors = errors + np.stack([lost.sum(axis=1), lost @ harmonic], axis=1)
    nothing = np.empty((rows.size, 0), np.float32)
    levels = [Level(np.where(rows[:, None] < 0, np.float32(np.nan), single), _above(errors), nothing, nothing)]
    children, slopes, bends = single.astype(float), np.zeros((rows.size, PIECES)), np.zeros((rows.size, PIECES))
    for _ in range(depth):
        means = children.reshape(-1, WIDTH, COLUMNS).mean(axis=1).astype(np.float32)
        first, second = _differences(children, means.astype(float))
        slopes = _largest(slopes + first)
        bends = _largest(bends + second)
        errors = _largest(errors)
        levels.append(Level(means, _above(errors), _above(slopes), _above(bends)))
        children = means.astype(float)
    missing = -roots % WIDTH
    if missing:
        top = [np.pad(values, ((0, missing), (0, 0))) for values in levels[-1]]
        top[0][roots:] = np.nan
        levels[-1] = Level(*top)
    if depth == 0:
        rows = np.pad(rows, (0, missing), constant_values=-1)
    return Tree(levels[::-1], rows)


def _above(values: Floats) -> Singles:
    """Return single-precision numbers that are not smaller."""
    return values.astype(np.float32) * _ABOVE_SINGLE


def _largest(values: Floats) -> Floats:
    return values.reshape(-1, WIDTH, values.shape[1]).max(axis=1)


def _ordered(coefficients: Floats, types: Ints, roots: int) -> Ints:
    """Order places by halving them again and again along the axis in which their types differ most."""
    weight = np.concatenate([[1.0, 0.0], np.repeat(np.arange(1.0, HARMONICS + 1), 2)])
    scaled = (coefficients - coefficients.mean(axis=0)) * weight if types.size else coefficients
    axes = np.linalg.eigh(scaled.T @ scaled)[1][:, -_AXES:]
    points = (scaled @ axes)[types]

    def split(index: Ints, parts: int) -> list[Ints]:
        if parts == 1:
            return [index]
        axis = np.argmax(points[index].var(axis=0))
        index = index[np.argsort(points[index, axis], kind="stable")]
        cut = index.size // parts * (parts // 2)
        return [*split(index[:cut], parts // 2), *split(index[cut:], parts - parts // 2)]

    order = np.array(split(np.arange(types.size), roots)) if roots else np.empty((0, 1), dtype=np.int64)
    while order.shape[1] > 1:
        chosen = points[order]
        axis = chosen.var(axis=1).argmax(axis=1)
        key = np.take_along_axis(chosen, axis[:, None, None], axis=2)[:, :, 0]
        order = np.take_along_axis(order, np.argsort(key, axis=1, kind="stable"), axis=1)
        order = order.reshape(-1, order.shape[1] // 2)
    return order.ravel()


def _differences(children: Floats, means: Floats) -> tuple[Floats, Floats]:
    """Bound the differences of slope and second derivative of children from their means in each piece, (children, PIECES) each.

    Between two points a function is at most its largest value at both plus h^2 / 8 times its largest second derivative, and that
    is bounded in the same way, in the end by the sum of the amplitudes.
    """
    harmonic, points = np.arange(1, HARMONICS + 1), np.arange(_POINTS) * (TURN / _POINTS)
    waves = np.exp(1j * np.outer(harmonic, points))
    turned = [(1j * harmonic[:, None]) ** order * waves for order in (1, 2, 3, 4)]
    tables: list[Any] = [np.stack([wave.real, wave.imag], axis=1).reshape(-1, _POINTS) for wave in turned]
    tables = [table.astype(np.float32) for table in tables]
    step = (TURN / _POINTS) ** 2 / 8
    first, second = np.empty((len(children), PIECES)), np.empty((len(children), PIECES))
    for begin in range(0, len(children), _AT_ONCE):
        part = slice(begin, begin + _AT_ONCE)
        differences = children[part] - np.repeat(means[begin // WIDTH : (begin + _AT_ONCE) // WIDTH], WIDTH, axis=0)
        waving = differences[:, 2:].astype(np.float32)
        amplitude = np.hypot(waving[:, ::2], waving[:, 1::2])
        for result, own, curved, power, constant in (
            (first, tables[0], tables[2], 5, differences[:, 0]),
            (second, tables[1], tables[3], 6, 0.0),
        ):
            values = np.abs(waving @ own + np.reshape(constant, (-1, 1)).astype(np.float32))
            curving = np.abs(waving @ curved) + step * (amplitude @ harmonic**power)[:, None]
            values += step * curving + _ROUNDING * (amplitude @ harmonic ** (power - 4))[:, None]
            values = values.reshape(len(differences), PIECES, -1)
            ends = np.roll(values[:, :, 0], -1, axis=1)
            result[part] = np.maximum(values.max(axis=2), ends) * float(_ABOVE_SINGLE)
    return first, second
