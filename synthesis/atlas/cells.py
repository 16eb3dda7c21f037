"""Cells of types whose curves are alike: the error of a representative bounds those of all and excludes most windows.

A group's types are halved again and again along the coefficient in which they differ most, down to cells of a few types;
eight neighbouring cells make a cell of the next coarser level. Each half keeps its types in ascending order of their place, the
lower half being those of the least coefficients and, among equal ones, of the least places. Each cell has a *representative*,
one of its types, and for every part of the turn a *radius*.

Bound. Let d be the difference of the series of a type and of its cell's representative, and W the arc of crank angles of a
window. The rms of what is left after the best constant is a seminorm, so by the triangle inequality the error of the type
is at least that of the representative less the rms of d, whatever the samples in W are and however they lie. The *radius*
of a cell in W is a bound of that rms for all of its types, the smaller of two:

* (max - min) / 2 of d over W: no value is further than that from the middle of its range;
* with u the crank angle from the middle m of W, d = d(m) + d'(m) u + d''(m) u^2 / 2 + a rest of at most |d'''| |u|^3 / 6
  (Taylor), so std(u) |d'(m)| + std(u^2) |d''(m)| / 2 + S^3 / 48 max_W |d'''|, with S the length of W and std that of the samples.

The second is far smaller where the window is short. What is kept of a cell is the largest of these over its types, for
pieces and arcs of pieces of the turn: neighbours differ less over less of a turn, and that is what makes the bound useful.

Between the points of a grid of step h a series is off its neighbours by at most h^2/8 times its largest second derivative
(linear interpolation), and that is at most the sum of k^2 times its amplitudes, which is added; alike for derivatives. The
values of a coarser cell are, by the triangle inequality again, the largest over its parts of the value of the difference of
the representatives plus the part's value.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from synthesis.arrays import Floats, Ints
from synthesis.atlas.series import New, SeriesGroup, gather
from synthesis.target import TURN

Bounds = NDArray[np.float32]
Radii = NDArray[np.floating]

ABOVE_SINGLE = np.float32(1 + 1e-6)
"""Makes up for the rounding of a few operations in single precision."""

LEAF = 48
"""Most types of a cell of the finest level."""
PARTS = 8
"""Cells that make one of the next coarser level."""
FEWEST = 24
"""No coarser level than one of so many cells: evaluating all of its representatives costs little."""
ARCS = 64
"""Pieces of the turn."""
RANGES = (2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32, 40, 48, 64)
"""Pieces of the arcs over which the range of d is kept."""
THIRDS = (2, 3, 4, 6, 8, 12, 16)
"""Pieces of the arcs over which the largest third derivative is kept."""
SLOPE = len(RANGES)
CURVATURE = SLOPE + 1
THIRD = CURVATURE + 1
_POINTS_AT_ONCE = 1 << 18
_HALVED_HARMONICS = 6
"""Of the series, whose coefficients are looked at to halve."""
_STEP = 2.0**-16
"""Radians: a fraction of what neighbouring types of a billion differ by."""
_LARGEST_STEP = 1 << 18
"""Steps: whole sums of the squares of 100 million such numbers are still exact. What is larger counts as this."""
_POINTS = 8
"""Points of the grid for one period of the highest harmonic."""
_ROUNDING = 4e-6
"""Of the sum of the amplitudes: more than a transform of 2^17 points in single precision is off."""


@dataclass(frozen=True)
class Level:
    """Cells of one size.

    ``bounds`` (kinds, cells, ARCS): what the radius is made of, by the piece of the turn where an arc begins: (max -
    min) / 2 of d over the arcs of RANGES pieces, largest |d'| and |d''| over two pieces, largest |d^(3)| over the arcs
    of THIRDS pieces. ``error`` (cells,): largest error of the series of a cell's types.
    """

    representatives: SeriesGroup
    bounds: NDArray[Any]
    error: NDArray[Any]

    @cached_property
    def series(self) -> NDArray[Any]:
        """(cells of the coarser level, PARTS, 6H)."""
        return self.representatives.series.reshape(-1, PARTS, self.representatives.series.shape[1])

    @cached_property
    def mean_square(self) -> NDArray[Any]:
        """(cells of the coarser level, PARTS)."""
        return self.representatives.mean_square.reshape(-1, PARTS)


@dataclass(frozen=True)
class Cells:
    """A group in the order of its cells, and the levels of cells above it, coarse to fine.

    Cell c of a level has the cells PARTS c .. PARTS c + PARTS - 1 of the next; those of the finest have the group's types
    from ``first[c]`` on, up to ``first[c + 1]``.
    """

    group: SeriesGroup
    first: NDArray[Any]
    levels: list[Level]

    @property
    def nbytes(self) -> int:
        """Memory of the levels."""
        arrays: list[NDArray[Any]] = [self.first]
        for level in self.levels:
            arrays += [level.bounds, level.representatives.series]
        return sum(array.nbytes for array in arrays)

    def types_of(self, cells: Ints) -> Ints:
        """Places of the types of finest cells, (cells, LEAF); a cell with fewer repeats its last."""
        return np.minimum(
            gather(self.first, cells)[:, None] + np.arange(self.most), gather(self.first, cells + 1)[:, None] - 1
        )

    @cached_property
    def most(self) -> int:
        """Most types of a finest cell."""
        return int(np.max(np.diff(np.asarray(self.first))))


def make_cells(group: SeriesGroup, new: New) -> Cells:
    """The cells of a group, in arrays that ``new`` gives. Law: every type is in one cell of each level."""
    order, begins = halve(group, LEAF)
    first = new("first", begins.dtype, begins.shape)
    first[...] = begins
    cells = Cells(group.copy(order, new), first, [])
    del order
    types, levels = cells.types_of(np.arange(len(first) - 1)), cells.levels
    levels.append(_level(cells.group, types, None, cells.group.error, partial(_new_of_level, new, 0)))
    while len(levels[0].error) >= PARTS * FEWEST:
        fine = levels[0]
        parts = np.arange(len(fine.error)).reshape(-1, PARTS)
        new_level = partial(_new_of_level, new, len(levels))
        levels.insert(0, _level(fine.representatives, parts, fine.bounds, fine.error, new_level))
    return cells


def _new_of_level(new: New, level: int, name: str, dtype: DTypeLike, shape: tuple[int, ...]) -> NDArray[Any]:
    return new(f"level{level}.{name}", dtype, shape)


def halve(group: SeriesGroup, leaf: int) -> tuple[Ints, Ints]:
    """Order of the types in cells of at most ``leaf``, and where in it each cell begins (and the last ends).

    Coefficients count as whole numbers of `_STEP`, so that sums are exact.
    """
    scaled = group.periodic[:, : 2 * min(_HALVED_HARMONICS, group.harmonics)] / _STEP
    np.rint(scaled, out=scaled)
    steps = np.clip(scaled, -_LARGEST_STEP, _LARGEST_STEP, out=scaled).astype(np.int32)
    del scaled
    order, sizes = np.arange(len(steps)), np.array([len(steps)])
    while sizes.max() > leaf:
        first, half = np.cumsum(sizes) - sizes, sizes // 2
        cell = np.repeat(np.arange(sizes.size), sizes)
        widest = _spread(steps, order, first, sizes).argmax(axis=1)
        ranked = np.argsort((cell << 32) + steps[order, widest[cell]], kind="stable")
        high = np.ones(order.size, dtype=bool)
        high[ranked[np.arange(order.size) - first[cell] < half[cell]]] = False
        order = order[np.argsort(2 * cell + high, kind="stable")]
        sizes = np.stack([half, sizes - half], axis=1).ravel()
    return order, np.concatenate([[0], np.cumsum(sizes)])


def _spread(steps: NDArray[np.int32], order: Ints, first: Ints, sizes: Ints) -> Floats:
    """Variance of each coefficient in each cell, (cells, 2H)."""
    spread = np.empty((sizes.size, steps.shape[1]))
    for column, values in enumerate(steps.T):
        some = values[order].astype(np.int64)
        total, squares = np.add.reduceat(some, first), np.add.reduceat(some * some, first)
        spread[:, column] = squares / sizes - (total / sizes) ** 2
    return spread


def _middle(periodic: Floats) -> Ints:
    """Which of the types of each cell is nearest to their mean, over the turn; (cells, types, 2H) to (cells,)."""
    difference = periodic - periodic.mean(axis=1, keepdims=True)
    return np.einsum("gtk,gtk->gt", difference, difference).argmin(axis=1)


def _level(types: SeriesGroup, members: Ints, bounds: NDArray[Any] | None, error: NDArray[Any], new: New) -> Level:
    """Cells of the types or representatives in each of some cells, (cells, members), with their own bounds and errors."""
    chosen = np.empty(len(members), dtype=np.int64)
    own = new("bounds", np.float32, (THIRD + len(THIRDS), len(members), ARCS))
    at_once = max(1, _POINTS_AT_ONCE // (members.shape[1] * _points(types.harmonics)))
    for k in range(0, len(members), at_once):
        part = members[k : k + at_once]
        periodic = types.periodic[part]
        middle = part[np.arange(len(part)), _middle(periodic)]
        finer = None if bounds is None else bounds[:, part]
        own[:, k : k + at_once] = _upwards(_reaches(periodic - types.periodic[middle][:, None], finer))
        chosen[k : k + at_once] = middle
    largest = new("largest", np.float32, (len(members),))
    largest[...] = _upwards(error[members].max(axis=1))
    return Level(types.copy(chosen, new), own, largest)


def _upwards(values: NDArray[np.floating]) -> Bounds:
    """As float32, not smaller even if ``values`` are rounded to that."""
    return np.nextafter(values.astype(np.float32) * ABOVE_SINGLE, np.float32(np.inf))


def _points(harmonics: int) -> int:
    return max(2 * ARCS, 1 << (_POINTS * harmonics - 1).bit_length())


def _reaches(differences: Floats, finer: Radii | None) -> Radii:
    """What `Level.bounds` keeps, of cells whose members have so different series from their representative.

    ``differences`` (cells, members, 2H). ``finer`` (kinds, cells, members, ARCS): bounds of the members, which are
    cells themselves.

    Shape (kinds, cells, ARCS).
    """
    harmonics = differences.shape[-1] // 2
    points = _points(harmonics)
    order = np.arange(1, harmonics + 1)
    amplitudes = np.conj(np.ascontiguousarray(differences.swapaxes(0, 1)).view(complex))
    size = np.abs(amplitudes)
    result = np.empty((THIRD + len(THIRDS), len(differences), ARCS), dtype=np.float32)

    def keep(kind: int, reach: Radii) -> None:
        if finer is not None:
            reach += finer[kind].T
        result[kind] = reach.max(axis=1).T

    def pieces(derivative: int) -> tuple[Radii, Radii, Radii]:
        """Largest and least value in each piece at the points of a grid, (ARCS, members, cells), and what is missed between."""
        spectrum = np.zeros((*size.shape[:-1], points // 2 + 1), dtype=np.complex64)
        spectrum[..., 1 : harmonics + 1] = amplitudes * ((1j * order) ** derivative * (points / 2))
        values = np.fft.irfft(spectrum, points, axis=-1).astype(np.float32, copy=False)
        values = np.ascontiguousarray(np.moveaxis(values, -1, 0)).reshape(ARCS, -1, *size.shape[:-1])
        ends = np.roll(values[:, 0], -1, axis=0)  # a piece ends where the next begins
        highest, lowest = np.maximum(values.max(axis=1), ends), np.minimum(values.min(axis=1), ends)
        missed = size @ (order ** (2.0 + derivative) * ((TURN / points) ** 2 / 8) + _ROUNDING * order**derivative)
        return highest, lowest, missed.astype(np.float32)

    highest, lowest, missed = pieces(0)
    for kind, (high, low) in enumerate(
        zip(_over_arcs(highest + missed, RANGES), _over_arcs(missed - lowest, RANGES))
    ):
        high += low
        high /= 2
        keep(kind, high)
    # Two pieces: a window's middle is somewhere in a stretch as long as one. (That it may leave them by 1e-9 of a piece is
    # within what is added for rounding.)
    for derivative, first, arcs in ((1, SLOPE, (2,)), (2, CURVATURE, (2,)), (3, THIRD, THIRDS)):
        highest, lowest, missed = pieces(derivative)
        largest = np.maximum(highest, -lowest) + missed
        if finer is None:  # the largest of all members over an arc is the largest over the arc of all members'
            largest = largest.max(axis=1, keepdims=True)
        for kind, values in enumerate(_over_arcs(largest, arcs), first):
            keep(kind, values)
    return result


def _over_arcs(values: Radii, lengths: tuple[int, ...]) -> Iterator[Radii]:
    """Largest value over the arcs of so many pieces that begin in each, pieces along the first axis; the next overwrites it."""
    largest = np.empty_like(values)
    values, length = np.concatenate([values, values]), 1
    for wanted in lengths:
        while 2 * length <= wanted:
            values = np.maximum(values[:-length], values[length:])
            length *= 2
        # two arcs of ``length`` pieces, the second ending where the wanted one ends, cover it
        yield np.maximum(values[:ARCS], values[wanted - length :][:ARCS], out=largest)
