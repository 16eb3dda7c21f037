"""Series of an atlas's curves, and the matrices of a request that turn them into errors of windows.

The formulae and the bounds are those of `scan`; here is how they are laid out. A *bucket* holds the types whose series are
equally long. The cosine and the sine of a harmonic stand side by side, so a shorter series is a prefix of a longer one, and
all buckets share what a request gives: its means <w e^{iht}> over the samples, for all harmonics h at once, times the
phases e^{ihs} of the starts, which no request changes. A matrix has one row a window: branch +1 at all starts, then branch -1.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import CancelledError
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from threading import Event
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.atlas import haar
from synthesis.atlas.file import Atlas
from synthesis.atlas.rows import compute_rows
from synthesis.fourbar.kinematics import TURN
from synthesis.fourbar.pose import fixed_parts
from synthesis.target import Target

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]

ROUNDING = 1e-13
"""Rounding of a mean squared rotation error, for a target of variance 1."""
RESOLVED_SAMPLES = 256
RESOLVED_ERROR = 1e-6
"""Types that an atlas of fewer samples has less exactly, in radians, get their series from that many samples. Bounds as loose as
such curves allow would leave most of their windows to be evaluated."""
_HARMONICS_AT_ONCE = 16


@dataclass(frozen=True)
class Bucket:
    """Types of one winding whose series have the same number of harmonics H."""

    rows: Ints
    winding: int
    harmonics: int
    series: Floats
    """(n, 6H): p^2 up to 2H, then p up to H; cosine and sine of each harmonic side by side."""
    mean_square: Floats
    error: Floats

    def take(self, places: Any) -> Bucket:
        """The types at some places."""
        columns = {name: getattr(self, name)[places] for name in ("rows", "series", "mean_square", "error")}
        return replace(self, **columns)

    @property
    def periodic(self) -> Floats:
        """(n, 2H): the series of p alone."""
        return self.series[:, 4 * self.harmonics :]

    def gather_periodic(self, places: Ints) -> Floats:
        """The series of p alone of some types, (..., 2H)."""
        thirds = self.series.reshape(-1, 2 * self.harmonics)
        return gather(thirds, 3 * places + 2)


@dataclass(frozen=True)
class Phasors:
    """Series of e^{i theta2} of a bucket's types, which requests with positions need."""

    reach: int
    series: Complexes
    """(n, 2K + 1): coefficients -K .. K."""
    error: Floats
    modulus: Floats
    """(n, 4K): the squared modulus of that series, which is not quite 1."""
    modulus_mean: Floats


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
    reach = coefficients.shape[1] // 2
    points = 4 * reach + 2
    padded = np.zeros((len(coefficients), points), dtype=complex)
    padded[:, np.arange(-reach, reach + 1)] = coefficients
    values = np.fft.ifft(padded, axis=1) * points
    return _real_series(values.real**2 + values.imag**2, 2 * reach)


class _Curves(NamedTuple):
    """Spectra of some types, and the bound of the error of the curves that they are of."""

    rows: Ints
    spectrum: Complexes
    error: Floats

    @property
    def samples(self) -> int:
        return 2 * self.spectrum.shape[1] - 2


def _curves(atlas: Atlas, rows: Ints) -> list[_Curves]:
    """The curves of some types as the atlas has them; anew from the lengths where too few samples left them unresolved."""
    features: list[tuple[Ints, Any, Any, Any]] = []
    unresolved = np.zeros(len(rows), dtype=bool)
    if atlas.rule.samples < RESOLVED_SAMPLES:
        unresolved = atlas.curve_error[rows] > RESOLVED_ERROR
    if unresolved.any():
        poor = rows[unresolved]
        better = compute_rows(atlas.lengths[poor], RESOLVED_SAMPLES)
        features.append((poor, better.average, better.details, better.curve_error))
    rows = rows[~unresolved]
    features.append((rows, atlas.average[rows], atlas.details[rows], atlas.curve_error[rows]))
    result = []
    for chosen, average, details, error in features:
        curves = haar.curve_from_features(average, details)
        spectrum = np.fft.rfft(curves, axis=1) / curves.shape[1]
        spectrum[:, -1] = 0  # as in `atlas_rows.interpolate`, on which curve_error rests
        result.append(_Curves(chosen, spectrum, error.astype(float)))
    return result


def prepare(atlas: Atlas, rows: Ints, series_error: float, lengths: tuple[int, ...]) -> Iterator[Bucket]:
    """Buckets of some rows: series no longer than need be to leave out at most ``series_error``, of the given lengths."""
    for curves in _curves(atlas, rows):
        if curves.rows.size:
            yield from _buckets(atlas, curves, series_error, lengths)


def _buckets(atlas: Atlas, curves: _Curves, series_error: float, lengths: tuple[int, ...]) -> Iterator[Bucket]:
    rows, spectrum, curve_error = curves
    half = curves.samples // 2
    winding = atlas.winding[rows].astype(int)
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
                part[:, 0] = 0  # a constant is the offset's business
                left_out = tails[chosen, harmonics + 1] if harmonics + 1 <= half else 0.0
                error = curve_error[chosen] + left_out + 1e-12
                mean_square, square = _square_series(part, int(harmonics))
                series = np.concatenate([square, _side_by_side(part[:, 1:])], axis=1)
                yield Bucket(rows[chosen], turns, int(harmonics), series, mean_square, error)


def join(parts: list[Bucket]) -> Bucket:
    """One bucket of parts that have the same winding and length."""
    columns = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("rows", "series", "mean_square", "error")
    }
    return replace(parts[0], **columns)


def prepare_phasors(atlas: Atlas, bucket: Bucket, at_once: int, given_up: Event) -> Phasors:
    """Series of e^{i theta2} of a bucket's types, with a few more harmonics than theta2 has; so many types at once."""
    reach = int(1.25 * bucket.harmonics) + 4
    count = len(bucket.rows)
    series = np.empty((count, 2 * reach + 1), dtype=complex)
    modulus, modulus_mean = np.empty((count, 4 * reach)), np.empty(count)
    error = np.empty(count)
    place = np.empty(len(atlas), dtype=np.int64)
    place[bucket.rows] = np.arange(count)
    for first in range(0, count, at_once):
        if given_up.is_set():
            raise CancelledError
        for curves in _curves(atlas, bucket.rows[first : first + at_once]):
            part = place[curves.rows]
            series[part], lost = _phasor_series(curves.spectrum, curves.samples, bucket.winding, reach)
            modulus_mean[part], modulus[part] = _modulus_series(series[part])
            error[part] = curves.error + 2 * lost + 1e-9
    return Phasors(reach, series, error, modulus, modulus_mean)


def _phasor_series(spectrum: Complexes, samples: int, winding: int, reach: int) -> tuple[Complexes, Floats]:
    """Coefficients -reach .. reach of e^{i theta2}, and the sum of the magnitudes of those left out.

    e^{i theta2} has more harmonics than theta2 has, so it is taken from a grid that resolves four times the reach.
    """
    points = max(samples, 1 << (4 * reach - 1).bit_length())
    curves = np.fft.irfft(spectrum * points, points, axis=1)
    crank = np.arange(points) * (TURN / points)
    phasor = np.fft.fft(np.exp(1j * (curves + winding * crank)), axis=1) / points
    coefficients = phasor[:, np.arange(-reach, reach + 1) % points]
    return coefficients, np.maximum(np.abs(phasor).sum(1) - np.abs(coefficients).sum(1), 0)


def gather(values: NDArray[Any], index: Ints, axis: int = 0) -> NDArray[Any]:
    """``values`` at indices that are known to be within it. (Unlike values[index], it lets other threads run meanwhile.)"""
    return np.take(values, index, axis=axis, mode="clip")


def start_angles(starts: int) -> Floats:
    """theta1 of evenly spaced starts, radians."""
    return np.arange(starts) * (TURN / starts)


@lru_cache(maxsize=8)
def _phases(highest: int, starts: int) -> Complexes:
    """e^{ihs} for all starts and h = 0 .. highest."""
    phases = np.exp(1j * np.outer(start_angles(starts), np.arange(highest + 1)))
    phases.flags.writeable = False
    return phases


def _both_branches(shifted: Complexes, sign: int = 1) -> Floats:
    """What a series (cosine and sine side by side) is multiplied with to give its mean, for all starts of both branches.

    A mirrored window has the increments -t and the starts -s, and the target ``sign`` times the one that the means are
    of: that conjugates every term.
    """
    return np.concatenate([shifted, sign * np.conj(shifted)]).view(float)


class Matrices:
    """What one request multiplies the series of an atlas with; what buckets share is made once, when first asked for.

    Parameters
    ----------
    target : Target
    highest : int
        Highest harmonic of any series or square.
    starts : int
    """

    def __init__(self, target: Target, highest: int, starts: int) -> None:
        self.target = target
        self.highest = highest
        self.starts = starts
        blocks = -(-(highest + 1) // _HARMONICS_AT_ONCE)
        self._coarse = np.exp(1j * np.outer(_HARMONICS_AT_ONCE * np.arange(blocks), target.crank)) / target.samples
        self._fine = np.exp(1j * np.outer(target.crank, np.arange(_HARMONICS_AT_ONCE)))
        self._along: dict[int, tuple[Floats, Floats]] = {}
        self._position: dict[int, PositionMatrices] = {}

    def means(self, weights: NDArray[Any]) -> Complexes:
        """<w e^{iht}> over the samples, h = 0 .. highest."""
        return ((self._coarse * weights) @ self._fine).ravel()[: self.highest + 1]

    @cached_property
    def phases(self) -> Complexes:
        """e^{ihs}, (starts, highest + 1)."""
        return _phases(self.highest, self.starts)

    @cached_property
    def average(self) -> Floats:
        """For the mean of a series, (2 starts, 2 highest)."""
        return _both_branches(self.phases[:, 1:] * self.means(np.ones(self.target.samples))[1:])

    def _times(self, weights: Floats) -> Floats:
        """For the mean of a series times what weighs the samples, (2 starts, 2 reach), of half of all harmonics."""
        reach = self.highest // 2 + 1
        return _both_branches(self.phases[:, 1:reach] * self.means(weights)[1:reach], -1)

    def _turned(self, winding: int) -> tuple[Floats, Floats]:
        """The centred target less the winding, and what series are multiplied with for the mean of their product with it."""
        if winding not in self._along:
            rotation = self.target.rotation - winding * self.target.crank
            centred = rotation - rotation.mean()
            centred -= centred.mean()  # a large constant leaves a mean of its rounding at the first time
            self._along[winding] = centred, self._times(centred)
        return self._along[winding]

    @cached_property
    def _line(self) -> tuple[Floats, Floats]:
        """The crank angle, centred and of mean square 1, and what series are multiplied with for their slope over it."""
        line = self.target.crank - self.target.crank.mean()
        line /= np.sqrt(np.mean(line**2))
        return line, self._times(line)

    def rotation(self, bucket: Bucket) -> RotationMatrix:
        """For the mean squared rotation error."""
        reach = 2 * bucket.harmonics
        centred, along = self._turned(bucket.winding)
        line, slopes = self._line
        return RotationMatrix(
            np.concatenate([self.average[:, : 2 * reach], -2 * along[:, :reach]], axis=1),
            float(np.mean(centred**2)),
            np.ascontiguousarray(slopes[:, :reach]),
            float(np.mean(centred * line)),
        )

    def position(self, reach: int) -> PositionMatrices:
        """For the mean squared position error of phasors of some reach."""
        if reach not in self._position:
            ahead, behind, size = self._position_means
            turn = self.phases[:, np.abs(np.arange(-reach, reach + 1))]
            turn = np.concatenate([np.conj(turn[:, :reach]), turn[:, reach:]], axis=1)
            columns = []
            for forward, backward in zip(ahead, behind):
                shifted = turn * np.concatenate([backward[reach:0:-1], forward[: reach + 1]])
                columns.append(np.concatenate([shifted, np.conj(shifted)]))
            self._position[reach] = PositionMatrices(np.stack(columns), self.average[:, : 4 * reach], size)
        return self._position[reach]

    @cached_property
    def _position_means(self) -> tuple[list[Complexes], list[Complexes], float]:
        """<conj(c) e^{iht}> and its counterpart at -h for three columns c, and the norm of the rest.

        The columns are the fixed parts {1, e^{it}} made orthonormal, and the positions over l that are left, made a unit.
        """
        one, turned, rest = fixed_parts(self.target)
        size = float(np.sqrt(np.mean(np.abs(rest) ** 2)))
        columns = [one, turned, rest / size if size > 0 else rest]
        return [self.means(np.conj(c)) for c in columns], [np.conj(self.means(c)) for c in columns], size


@dataclass(frozen=True)
class RotationMatrix:
    """What the series of types are multiplied with to give mean squared errors and slopes, one row a window.

    Attributes
    ----------
    columns : ndarray, shape (windows, 6H)
        The means over p^2 (4H), then -2 times those over p times the target (2H).
    variance : float
        Of the target.
    slopes : ndarray, shape (windows, 2H)
        The means over p times the line.
    slope : float
        The mean of the target times the line.
    """

    columns: Floats
    variance: float
    slopes: Floats
    slope: float

    @property
    def rounding(self) -> float:
        """Rounding of a mean squared error."""
        return ROUNDING * (1 + self.variance)

    def mean_square_error(self, bucket: Bucket, part: slice) -> Floats:
        """D of all windows of some types, (n, windows)."""
        result = self._error(bucket.series[part], self.columns.T)
        result += (bucket.mean_square[part] + self.variance)[:, None]
        return result

    def of_windows(self, series: Floats, windows: Ints) -> Floats:
        """D, less the type's ``mean_square`` and the variance, of some windows of some groups of types.

        Parameters
        ----------
        series : ndarray, shape (groups, types, 6H)
        windows : ndarray of int, shape (groups, windows)

        Returns
        -------
        ndarray, shape (groups, types, windows)
        """
        return self._error(series, gather(self.columns, windows).transpose(0, 2, 1))

    def of_pairs(self, series: Floats, windows: Ints) -> Floats:
        """The same of one window of each of some types; (n, 6H) and (n,) to (n,)."""
        return self._error(series[:, None], gather(self.columns, windows)[:, :, None])[:, 0, 0]

    def slopes_of_windows(self, periodic: Floats, windows: Ints) -> Floats:
        """Distance of a type's slope from the target's, shaped as by `of_windows`; ``periodic`` (groups, types, 2H).

        The slope is the mean of a curve times a line of mean 0 and mean square 1, so by Cauchy and Schwarz no error is
        less than this.
        """
        result = periodic @ gather(self.slopes, windows).transpose(0, 2, 1)
        result -= self.slope
        return np.abs(result, out=result)

    def _error(self, series: Floats, columns: Floats) -> Floats:
        third = columns.shape[-2] // 3  # the means over p itself are the first third of the rows, those up to H
        result = series @ columns
        mean = series[..., 2 * third :] @ columns[..., :third, :]
        np.multiply(mean, mean, out=mean)
        result -= mean
        return result


@dataclass(frozen=True)
class PositionMatrices:
    """What phasors are multiplied with, to bound the mean squared position error (over l^2)."""

    columns: Complexes
    """(3, windows, 2K + 1): for the inner products with the two fixed parts and with the unit of the rest."""
    modulus: Floats
    size: float

    @cached_property
    def rows(self) -> Complexes:
        """All three with one column a window, side by side: as a whole they make a faster product."""
        return np.ascontiguousarray(self.columns.reshape(-1, self.columns.shape[-1]).T)

    def mean_square_error(self, phasors: Phasors, part: Any) -> Floats:
        """Lower bounds of the mean squared position error over l^2, (n, windows)."""
        along = np.split(phasors.series[part] @ self.rows, 3, axis=1)
        whole = phasors.modulus_mean[part][:, None] + phasors.modulus[part] @ self.modulus.T
        return self._bound(along, whole, phasors.error[part][:, None])

    def of_windows(self, phasors: Phasors, places: Ints, windows: Ints) -> Floats:
        """The same of some windows of some groups of types, (groups, types, windows).

        Parameters
        ----------
        phasors : Phasors
        places : ndarray of int, shape (groups, types)
        windows : ndarray of int, shape (groups, windows)
        """
        series = gather(phasors.series, places)
        along = [series @ gather(columns, windows).transpose(0, 2, 1) for columns in self.columns]
        modulus = gather(self.modulus, windows).transpose(0, 2, 1)
        whole = phasors.modulus_mean[places][..., None] + phasors.modulus[places] @ modulus
        return self._bound(along, whole, phasors.error[places][..., None])

    def _bound(self, along: list[Complexes], whole: Floats, error: Floats) -> Floats:
        first, second, rest = (product.real**2 + product.imag**2 for product in along)
        square = np.maximum(whole - first - second, 1e-30)
        left = np.sqrt(np.maximum(1.0 - rest / square - 1e-14 / square, 0.0))
        norm = np.maximum(np.sqrt(square) - error - 1e-8, 1e-30)
        return (self.size * np.maximum(left - error / norm, 0.0)) ** 2
