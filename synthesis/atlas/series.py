"""Trigonometric series of a table's curves: what the scan holds of every type, made once.

The formulae and the bounds are those of `scan`; here is how they are laid out. A *group* holds the types of one winding whose
series are equally long. Cosine and sine of a harmonic stand side by side, so a shorter series is a prefix of a longer one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from dataclasses import dataclass, replace
from threading import Event
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from synthesis.arrays import Complexes, Floats, Ints
from synthesis.atlas import haar
from synthesis.atlas.table import Table, compute_rows
from synthesis.target import TURN

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
