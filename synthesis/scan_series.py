"""Series of an atlas's curves, and the matrices of a request that turn them into errors of all windows.

The formulae and the bounds are those of `scan`; here is how they are laid out. A *bucket* holds the types whose series are
equally long. A request's means <w e^{iht}> over its samples are computed once for all harmonics h; a bucket's matrices are
those means times the phases e^{ihs} of the starts, which no request changes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from synthesis.atlas_file import Atlas
from synthesis.fourbar import TURN
from synthesis.mounting import fixed_parts
from synthesis.target import Target

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]

ROUNDING = 1e-13
"""Rounding of a mean squared rotation error, for a target of variance 1."""


@dataclass(frozen=True)
class Bucket:
    """Types of one winding whose series have the same number of harmonics."""

    rows: Ints
    winding: int
    harmonics: int
    series: Floats
    """(n, 6H): cosines and sines of p^2 up to 2H, then of p up to H."""
    mean_square: Floats
    error: Floats
    phasor: NDArray[np.complex128]
    """(n, 2K + 1): coefficients -K .. K of e^{i theta2}."""
    phasor_error: Floats
    modulus: Floats
    """(n, 4K): cosines and sines of the squared modulus of that series, which is not quite 1."""
    modulus_mean: Floats


def _tails(magnitudes: Floats) -> Floats:
    """Sum of all magnitudes from each column to the last."""
    return np.cumsum(magnitudes[:, ::-1], axis=1)[:, ::-1]


def _real_series(values: Floats, harmonics: int) -> tuple[Floats, Floats]:
    """Mean, and cosine and sine coefficients 1 .. ``harmonics``, of samples over a turn."""
    spectrum = np.fft.rfft(values, axis=1)[:, : harmonics + 1] / values.shape[1]
    return spectrum[:, 0].real, np.concatenate([2 * spectrum[:, 1:].real, -2 * spectrum[:, 1:].imag], axis=1)


def _square_series(spectrum: NDArray[np.complex128], harmonics: int) -> tuple[Floats, Floats]:
    """Mean, and cosine and sine coefficients 1 .. 2H, of the square of a series given by rfft-like coefficients."""
    points = 4 * harmonics + 2
    return _real_series(np.fft.irfft(spectrum * points, points, axis=1) ** 2, 2 * harmonics)


def _modulus_series(coefficients: NDArray[np.complex128]) -> tuple[Floats, Floats]:
    """Mean, and cosine and sine coefficients 1 .. 2K, of the squared modulus of a series of coefficients -K .. K."""
    reach = coefficients.shape[1] // 2
    points = 4 * reach + 2
    padded = np.zeros((len(coefficients), points), dtype=complex)
    padded[:, np.arange(-reach, reach + 1)] = coefficients
    values = np.fft.ifft(padded, axis=1) * points
    return _real_series(values.real**2 + values.imag**2, 2 * reach)


def prepare(atlas: Atlas, rows: Ints, series_error: float, lengths: tuple[int, ...]) -> Iterator[Bucket]:
    """Buckets of some rows: series no longer than need be to leave out at most ``series_error``, of the given lengths."""
    samples = atlas.rule.samples
    half = samples // 2
    curves = atlas.curves(rows)
    spectrum = np.fft.rfft(curves, axis=1) / samples
    spectrum[:, half] = 0  # as in `atlas_rows.interpolate`, on which curve_error rests
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
                part = spectrum[chosen, : harmonics + 1].copy()
                part[:, 0] = 0  # a constant is the offset's business
                left_out = tails[chosen, harmonics + 1] if harmonics + 1 <= half else 0.0
                error = atlas.curve_error[rows[chosen]].astype(float) + left_out + 1e-12
                mean_square, square = _square_series(part, int(harmonics))
                series = np.concatenate([square, 2 * part[:, 1:].real, -2 * part[:, 1:].imag], axis=1)
                reach = int(1.25 * harmonics) + 4
                coefficients, lost = _phasor_series(spectrum[chosen], samples, turns, reach)
                modulus_mean, modulus = _modulus_series(coefficients)
                yield Bucket(
                    rows[chosen],
                    turns,
                    int(harmonics),
                    series,
                    mean_square,
                    error,
                    coefficients,
                    atlas.curve_error[rows[chosen]] + 2 * lost + 1e-9,
                    modulus,
                    modulus_mean,
                )


def _phasor_series(
    spectrum: NDArray[np.complex128], samples: int, winding: int, reach: int
) -> tuple[NDArray[np.complex128], Floats]:
    """Coefficients -reach .. reach of e^{i theta2}, and the sum of the magnitudes of those left out.

    e^{i theta2} has more harmonics than theta2 has, so it is taken from a grid that resolves four times the reach.
    """
    points = max(samples, 1 << (4 * reach - 1).bit_length())
    curves = np.fft.irfft(spectrum * points, points, axis=1)
    crank = np.arange(points) * (TURN / points)
    phasor = np.fft.fft(np.exp(1j * (curves + winding * crank)), axis=1) / points
    coefficients = phasor[:, np.arange(-reach, reach + 1) % points]
    return coefficients, np.maximum(np.abs(phasor).sum(1) - np.abs(coefficients).sum(1), 0)


def join(parts: list[Bucket]) -> Bucket:
    """One bucket of parts that have the same winding and length."""
    first = parts[0]
    arrays = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name, value in vars(first).items()
        if isinstance(value, np.ndarray)
    }
    return Bucket(winding=first.winding, harmonics=first.harmonics, **arrays)


def start_angles(starts: int) -> Floats:
    """theta1 of evenly spaced starts, radians."""
    return np.arange(starts) * (TURN / starts)


@lru_cache(maxsize=32)
def _phases(highest: int, starts: int) -> Complexes:
    """e^{ihs} for h = 0 .. highest and all starts."""
    phases = np.exp(1j * np.outer(np.arange(highest + 1), start_angles(starts)))
    phases.flags.writeable = False
    return phases


class RequestMeans:
    """Means of a request over its samples, for all harmonics up to a highest one, each computed when first asked for."""

    def __init__(self, target: Target, highest: int) -> None:
        self.target = target
        self.powers = np.exp(1j * np.outer(np.arange(highest + 1), target.crank)) / target.samples
        self._turned: dict[int, tuple[Complexes, float]] = {}

    @cached_property
    def one(self) -> Complexes:
        """<e^{iht}>, h = 0 .. highest."""
        return self.powers.sum(axis=1)

    def rotation(self, winding: int) -> tuple[Complexes, float]:
        """<g e^{iht}> and <g^2> for the centred rotation less the winding."""
        if winding not in self._turned:
            rotation = self.target.rotation - winding * self.target.crank
            centred = rotation - rotation.mean()
            self._turned[winding] = self.powers @ centred, float(np.mean(centred**2))
        return self._turned[winding]

    @cached_property
    def position(self) -> tuple[Complexes, Complexes, float]:
        """<conj(c) e^{iht}> and its counterpart at -h for three columns c, (3, highest + 1) each, and the norm of the rest.

        The columns are the fixed parts {1, e^{it}} made orthonormal, and the positions over l that are left, made a unit.
        """
        one, turned, rest = fixed_parts(self.target)
        size = float(np.sqrt(np.mean(np.abs(rest) ** 2)))
        columns = np.stack([one, turned, rest / size if size > 0 else rest])
        return np.conj(columns) @ self.powers.T, np.conj(columns @ self.powers.T), size


def _both_branches(means: Complexes, phases: Complexes, sign: int = 1) -> Floats:
    """What cosines and sines are multiplied with to give the mean of their series, at all starts of both branches.

    A mirrored window has the increments -t and the starts -s, and the target ``sign`` times the one that ``means`` is of: that
    conjugates every term.
    """
    shifted = phases * means[:, None]
    return np.vstack(
        [np.hstack([shifted.real, sign * shifted.real]), np.hstack([shifted.imag, -sign * shifted.imag])]
    )


class RotationMatrices:
    """What a request multiplies the series of a bucket with, to give the mean squared rotation error of all windows."""

    def __init__(self, means: RequestMeans, bucket: Bucket, starts: int) -> None:
        turned, self.variance = means.rotation(bucket.winding)
        self.rounding = ROUNDING * (1 + self.variance)
        single, double = slice(1, bucket.harmonics + 1), slice(1, 2 * bucket.harmonics + 1)
        phases = _phases(2 * bucket.harmonics, starts)
        along = _both_branches(turned[single], phases[single], -1)
        self.product = np.vstack([_both_branches(means.one[double], phases[double]), -2 * along])
        self.mean = _both_branches(means.one[single], phases[single])

    def mean_square_error(self, bucket: Bucket, part: slice) -> Floats:
        """D of all windows of some rows, (n, 2 starts): branch +1 at all starts, then branch -1."""
        series = bucket.series[part]
        result = series @ self.product
        mean = series[:, 4 * bucket.harmonics :] @ self.mean
        np.multiply(mean, mean, out=mean)
        result -= mean
        result += (bucket.mean_square[part] + self.variance)[:, None]
        return result


class PositionMatrices:
    """What a request multiplies phasors -reach .. reach with, to bound the mean squared position error (over l^2)."""

    def __init__(self, means: RequestMeans, reach: int, starts: int) -> None:
        ahead, behind, self.size = means.position
        phases = _phases(2 * reach, starts)
        turn = np.concatenate([np.conj(phases[reach:0:-1]), phases[: reach + 1]])
        columns = []
        for forward, backward in zip(ahead, behind):
            shifted = turn * np.concatenate([backward[reach:0:-1], forward[: reach + 1]])[:, None]
            columns += [shifted, np.conj(shifted)]
        self.product = np.hstack(columns)
        double = slice(1, 2 * reach + 1)
        self.modulus = _both_branches(means.one[double], phases[double])

    def mean_square_error(self, bucket: Bucket, part: slice | Ints) -> Floats:
        """Lower bounds of the mean squared position error over l^2, (n, 2 starts)."""
        products = bucket.phasor[part] @ self.product
        squares = products.real**2 + products.imag**2
        windows = squares.shape[1] // 3
        first, second, along = squares[:, :windows], squares[:, windows : 2 * windows], squares[:, 2 * windows :]
        error = bucket.phasor_error[part][:, None]
        whole = bucket.modulus_mean[part][:, None] + bucket.modulus[part] @ self.modulus
        square = np.maximum(whole - first - second, 1e-30)
        left = np.sqrt(np.maximum(1.0 - along / square - 1e-14 / square, 0.0))
        norm = np.maximum(np.sqrt(square) - error - 1e-8, 1e-30)
        return (self.size * np.maximum(left - error / norm, 0.0)) ** 2
