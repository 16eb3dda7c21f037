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

The formulae and the bounds are those of `scan`; here is how they are laid out. A *group* holds the types of one winding whose
series are equally long. Cosine and sine of a harmonic stand side by side, so a shorter series is a prefix of a longer one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from dataclasses import dataclass, replace
from functools import cached_property, partial
from threading import Event
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from synthesis.arrays import Complexes, Floats, Ints
from synthesis.atlas import haar
from synthesis.atlas.table import Table, compute_rows
from synthesis.target import TURN

# -- series -------------------------------------------------------------------------------------------------------------

New = Callable[[str, DTypeLike, tuple[int, ...]], NDArray[Any]]
"""``new(name, dtype, shape)``: an array to be filled, in memory or in a file, see `index`."""

RESOLVED_SAMPLES = 256
RESOLVED_ERROR = 1e-6
"""Types that an atlas of fewer samples has less exactly, in radians, get their series from that many samples. Bounds as loose as
such curves allow would leave most of their windows to be evaluated."""


COLUMNS = ("rows", "series", "mean_square", "error")
"""Arrays of a `SeriesGroup`."""
PHASOR_COLUMNS = ("series", "error", "modulus", "modulus_mean")
"""Arrays of `Phasors`."""
PREPARED_AT_ONCE = 512
"""Types whose series are computed at once."""
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


class GroupKey(NamedTuple):
    """What the types of a group have in common: turns of the body in one of the crank, and harmonics of the series."""

    winding: int
    harmonics: int


@dataclass(frozen=True)
class SeriesGroup:
    """Types of one winding whose series have the same number of harmonics H."""

    key: GroupKey
    rows: NDArray[Any]
    series: NDArray[Any]
    """(n, 6H): p^2 up to 2H, then p up to H; cosine and sine of each harmonic side by side."""
    mean_square: NDArray[Any]
    error: NDArray[Any]

    @property
    def winding(self) -> int:
        """Turns of the body in one turn of the crank."""
        return self.key.winding

    @property
    def harmonics(self) -> int:
        """H."""
        return self.key.harmonics

    def take(self, places: Any) -> SeriesGroup:
        """The types at some places."""
        columns = {name: getattr(self, name)[places] for name in COLUMNS}
        return replace(self, **columns)

    def copy(self, places: Ints, new: New) -> SeriesGroup:
        """The types at some places in arrays of their own."""
        columns: dict[str, Any] = {}
        for name in COLUMNS:
            values = getattr(self, name)
            columns[name] = new(name, values.dtype, (len(places), *values.shape[1:]))
            np.take(values, places, axis=0, out=columns[name], mode="clip")
        return replace(self, **columns)

    @property
    def periodic(self) -> Floats:
        """(n, 2H): the series of p alone."""
        periodic: Floats = self.series[:, 4 * self.harmonics :]
        return periodic

    def gather_periodic(self, places: Ints) -> Floats:
        """The series of p alone of some types, (..., 2H)."""
        thirds = self.series.reshape(-1, 2 * self.harmonics)
        return gather(thirds, 3 * places + 2)


@dataclass(frozen=True)
class Phasors:
    """Series of e^{i theta2} of a group's types, which requests with positions need."""

    harmonics: int
    """K."""
    series: NDArray[Any]
    """(n, 2K + 1): coefficients -K .. K."""
    error: NDArray[Any]
    modulus: NDArray[Any]
    """(n, 4K): the squared modulus of that series, which is not quite 1."""
    modulus_mean: NDArray[Any]


def _tails(magnitudes: Floats) -> Floats:
    """Sum of all magnitudes from each column to the last."""
    return np.cumsum(magnitudes[:, ::-1], axis=1)[:, ::-1]


def _side_by_side(spectrum: Complexes) -> Floats:
    """Cosine and sine coefficients, side by side, of a real series given by its coefficients of e^{ihx}, h = 1 .. H."""
    return np.ascontiguousarray(2 * np.conj(spectrum)).view(float)


def _real_series(values: Floats, harmonics: int) -> tuple[Floats, Floats]:
    """Mean, and series up to ``harmonics``, of samples over a turn."""
    spectrum = np.fft.rfft(values, axis=1)[:, : harmonics + 1] / values.shape[1]
    return spectrum[:, 0].real, _side_by_side(spectrum[:, 1:])


def _square_series(spectrum: Complexes, harmonics: int) -> tuple[Floats, Floats]:
    """Mean, and series up to 2H, of the square of a series given by rfft-like coefficients."""
    points = 4 * harmonics + 2
    return _real_series(np.fft.irfft(spectrum * points, points, axis=1) ** 2, 2 * harmonics)


def _modulus_series(coefficients: Complexes) -> tuple[Floats, Floats]:
    """Mean, and series up to 2K, of the squared modulus of a series of coefficients -K .. K."""
    harmonics = coefficients.shape[1] // 2
    points = 4 * harmonics + 2
    padded = np.zeros((len(coefficients), points), dtype=complex)
    padded[:, np.arange(-harmonics, harmonics + 1)] = coefficients
    values = np.fft.ifft(padded, axis=1) * points
    return _real_series(values.real**2 + values.imag**2, 2 * harmonics)


class _Curves(NamedTuple):
    rows: Ints
    spectrum: Complexes
    error: Floats

    @property
    def samples(self) -> int:
        return 2 * self.spectrum.shape[1] - 2


def _curves(table: Table, rows: Ints) -> list[_Curves]:
    """The curves of some types as the atlas has them; from the lengths where the stored samples are too few."""
    features: list[tuple[Ints, Any, Any, Any]] = []
    unresolved = np.zeros(len(rows), dtype=bool)
    if table.samples < RESOLVED_SAMPLES:
        unresolved = table.curve_error[rows] > RESOLVED_ERROR
    if unresolved.any():
        poor = rows[unresolved]
        better = compute_rows(table.lengths[poor], RESOLVED_SAMPLES, table.mechanism)
        features.append((poor, better.average, better.details, better.curve_error))
    rows = rows[~unresolved]
    features.append((rows, table.average[rows], table.details[rows], table.curve_error[rows]))
    result = []
    for chosen, average, details, error in features:
        curves = haar.curve_from_features(average, details)
        spectrum = np.fft.rfft(curves, axis=1) / curves.shape[1]
        spectrum[:, -1] = 0  # as in `table.interpolate`, on which curve_error rests
        result.append(_Curves(chosen, spectrum, error.astype(float)))
    return result


def prepare(table: Table, rows: Ints, series_error: float, lengths: tuple[int, ...]) -> Iterator[SeriesGroup]:
    """Groups of some rows: the shortest series of the allowed lengths that leave out at most ``series_error``."""
    for curves in _curves(table, rows):
        if curves.rows.size:
            yield from _groups(table, curves, series_error, lengths)


def _groups(table: Table, curves: _Curves, series_error: float, lengths: tuple[int, ...]) -> Iterator[SeriesGroup]:
    rows, spectrum, curve_error = curves
    half = curves.samples // 2
    winding = table.winding[rows].astype(int)
    tails = _tails(2 * np.abs(spectrum))
    choices = np.array([h for h in lengths if h < half] + [half - 1])
    # the first choice whose tail is small enough; the last one leaves nothing out
    choice = np.argmax(
        np.concatenate([tails[:, choices[:-1] + 1], np.zeros((len(rows), 1))], axis=1) <= series_error, axis=1
    )
    for index, harmonics in enumerate(choices):
        for turns in (0, 1):
            chosen = np.flatnonzero((choice == index) & (winding == turns))
            if chosen.size:
                part = spectrum[chosen, : harmonics + 1]
                part[:, 0] = 0  # the best offset takes up any constant
                left_out = tails[chosen, harmonics + 1] if harmonics + 1 <= half else 0.0
                error = curve_error[chosen] + left_out + 1e-12
                mean_square, square = _square_series(part, int(harmonics))
                series = np.concatenate([square, _side_by_side(part[:, 1:])], axis=1)
                yield SeriesGroup(GroupKey(turns, int(harmonics)), rows[chosen], series, mean_square, error)


def phasor_harmonics(key: GroupKey) -> int:
    """Of the series of e^{i theta2} of a group: a few more than theta2 has."""
    return int(1.25 * key.harmonics) + 4


def prepare_phasors(table: Table, group: SeriesGroup, given_up: Event, new: New) -> None:
    """Fill the arrays of a group's `Phasors`."""
    harmonics = phasor_harmonics(group.key)
    count = len(group.rows)
    series = new("series", complex, (count, 2 * harmonics + 1))
    modulus, modulus_mean = new("modulus", float, (count, 4 * harmonics)), new("modulus_mean", float, (count,))
    error = new("error", float, (count,))
    for first in range(0, count, PREPARED_AT_ONCE):
        if given_up.is_set():
            raise CancelledError
        rows = group.rows[first : first + PREPARED_AT_ONCE]
        order = np.argsort(rows)
        for curves in _curves(table, rows):
            part = first + order[np.searchsorted(rows, curves.rows, sorter=order)]
            series[part], lost = _phasor_series(curves.spectrum, curves.samples, group.winding, harmonics)
            modulus_mean[part], modulus[part] = _modulus_series(series[part])
            error[part] = curves.error + 2 * lost + 1e-9


def _phasor_series(spectrum: Complexes, samples: int, winding: int, harmonics: int) -> tuple[Complexes, Floats]:
    """Coefficients -K .. K of e^{i theta2}, and the sum of the magnitudes of those left out.

    e^{i theta2} has more harmonics than theta2 has, so it is taken from a grid that resolves four times as many.
    """
    points = max(samples, 1 << (4 * harmonics - 1).bit_length())
    curves = np.fft.irfft(spectrum * points, points, axis=1)
    crank = np.arange(points) * (TURN / points)
    phasor = np.fft.fft(np.exp(1j * (curves + winding * crank)), axis=1) / points
    coefficients = phasor[:, np.arange(-harmonics, harmonics + 1) % points]
    return coefficients, np.maximum(np.abs(phasor).sum(1) - np.abs(coefficients).sum(1), 0)


def gather(values: NDArray[Any], index: Ints, axis: int = 0) -> NDArray[Any]:
    """``values`` at indices that are known to be within it; unlike values[index], it lets other threads run meanwhile."""
    return np.take(values, index, axis=axis, mode="clip")


def start_angles(starts: int) -> Floats:
    """theta1 of evenly spaced starts, radians."""
    return np.arange(starts, dtype=float) * (TURN / starts)


# -- cells --------------------------------------------------------------------------------------------------------------

Bounds = NDArray[np.float32]
Radii = NDArray[np.floating]


SLOPE = len(RANGES)
CURVATURE = SLOPE + 1
THIRD = CURVATURE + 1


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
