"""Approximate errors of every window of a coarse table of types, by matrix products.

A window is a type, a branch and a start. Write the periodic part of theta2 of a type as p(x) = sum_h a_h cos hx + b_h sin hx, the
centred target (less the winding) as g, and means over the samples t_m as <.>. The mean squared error after the best offset is

    D(s) = <g^2> + <p(s+t)^2> - <p(s+t)>^2 - 2 <g p(s+t)>.

With p^2 as a series of its own, each term is a row of coefficients times a matrix that depends only on the request. Branch -1 is
the linkage mirrored, theta2(x, -1) = -theta2(-x, +1), so its windows are those of the target (-g, -t) at the start -s.

Positions are fitted by {1, e^{it}, e^{i theta2}} (see `synthesis.pose`). The residual is |p|^2 - |<q, p>|^2 / |q|^2, with p and q
the components of the positions and of e^{i theta2} orthogonal to {1, e^{it}}; the inner products are rows of the series of
e^{i theta2} times matrices of the request.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats, Ints
from synthesis.four_bar import coupler_angle
from synthesis.fourbar.mechanism import coupler_turns
from synthesis.pose import fixed_columns
from synthesis.target import TURN, Mean, Target

_SMALLEST = 1e-30
"""Smallest square that a residual is divided by."""


class _Group(NamedTuple):
    """Types with the same winding and number of harmonics.

    ``series`` (n, 6H): p^2 up to the harmonic 2H, then p up to H; cosine and sine of each harmonic side by side. ``mean_square``
    (n,): of p. ``phasors`` (n, 2K + 1): coefficients of e^{i theta2}. ``modulus`` (n, 4K), ``modulus_mean`` (n,): the squared
    modulus of that series, which is not quite 1.
    """

    rows: Ints
    winding: int
    harmonics: int
    series: Floats
    mean_square: Floats
    phasors: Complexes
    modulus: Floats
    modulus_mean: Floats


def _real_series(values: Floats, harmonics: int) -> tuple[Floats, Floats]:
    """Return the mean of samples over a turn, and their cosine and sine coefficients side by side."""
    spectrum = np.fft.rfft(values, axis=1)[:, : harmonics + 1] / values.shape[1]
    return spectrum[:, 0].real, np.ascontiguousarray(2 * np.conj(spectrum[:, 1:])).view(float)


def _group(rows: Ints, winding: int, spectrum: Complexes, harmonics: int, positions: bool) -> _Group:
    points = 4 * harmonics + 2
    square = np.fft.irfft(spectrum[:, : harmonics + 1] * points, points, axis=1) ** 2
    mean_square, series = _real_series(square, 2 * harmonics)
    own = np.ascontiguousarray(2 * np.conj(spectrum[:, 1 : harmonics + 1])).view(float)
    series = np.concatenate([series, own], axis=1)
    if not positions:
        nothing: Any = np.empty((0, 0))
        return _Group(rows, winding, harmonics, series, mean_square, nothing, nothing, nothing)
    # e^{i theta2} has more harmonics than theta2
    highest = int(1.25 * harmonics) + 4
    points = max(2 * spectrum.shape[1] - 2, 1 << (4 * highest - 1).bit_length())
    crank = np.arange(points) * (TURN / points)
    curves = np.fft.irfft(spectrum * points, points, axis=1) + winding * crank
    phasors = (np.fft.fft(np.exp(1j * curves), axis=1) / points)[:, np.arange(-highest, highest + 1) % points]
    padded = np.zeros((len(rows), 4 * highest + 2), dtype=complex)
    padded[:, np.arange(-highest, highest + 1)] = phasors
    modulus = np.abs(np.fft.ifft(padded, axis=1) * padded.shape[1]) ** 2
    modulus_mean, modulus = _real_series(modulus, 2 * highest)
    return _Group(rows, winding, harmonics, series, mean_square, phasors, modulus, modulus_mean)


class ErrorTable:
    """Types of four-bars as short series, prepared once.

    Parameters
    ----------
    lengths : ndarray, shape (T, 4)
        Types whose crank turns fully.
    starts : int
        Starts over the turn, evenly spaced from 0.
    samples : int
        Samples of a curve over the turn, from which its series is computed.
    series_error : float
        Largest sum of the amplitudes that a series may leave out, in radians.
    harmonics : tuple of int
        Lengths of series to choose from.
    positions : bool
        Also prepare the series that requests with positions need.
    """

    def __init__(
        self,
        lengths: Floats,
        starts: int,
        samples: int,
        series_error: float,
        harmonics: tuple[int, ...],
        positions: bool = True,
    ) -> None:
        self.lengths, self.starts = lengths, starts
        crank = np.arange(samples, dtype=float) * (TURN / samples)
        winding = coupler_turns(lengths).astype(int)
        periodic = coupler_angle(lengths, np.ones(len(lengths)), crank) - winding[:, None] * crank
        spectrum = np.fft.rfft(periodic, axis=1) / samples
        spectrum[:, [0, -1]] = 0  # the best offset takes up any constant; the highest harmonic has no phase
        tails = np.cumsum(2 * np.abs(spectrum[:, ::-1]), axis=1)[:, ::-1]
        choices = np.array([h for h in harmonics if h < samples // 2] + [samples // 2 - 1])
        choice = np.argmax(
            tails[:, choices + 1] <= np.append(np.full(choices.size - 1, series_error), np.inf), axis=1
        )
        self._groups = [
            _group(rows, turns, spectrum[rows], int(highest), positions)
            for index, highest in enumerate(choices)
            for turns in (0, 1)
            if (rows := np.flatnonzero((choice == index) & (winding == turns))).size
        ]

    def squared(self, target: Target) -> Floats:
        """Return the approximate squared error of every window, (types, branches, starts), branch +1 first."""
        result = np.zeros((len(self.lengths), 2 * self.starts))
        highest = 2 * max((max(g.harmonics, g.phasors.shape[1] // 2) for g in self._groups), default=0)
        matrices = _Matrices(target, highest, self.starts)
        for group in self._groups:
            if target.rotation is not None:
                result[group.rows] += matrices.rotation(group)
            if target.position is not None:
                result[group.rows] += matrices.position(group)
        return np.maximum(result, 0.0).reshape(-1, 2, self.starts)


class _Matrices:
    """Matrices of a request, one row a window: branch +1 at all starts, then branch -1."""

    def __init__(self, target: Target, highest: int, starts: int) -> None:
        self._target = target
        harmonics = np.arange(highest + 1)
        self._phases = np.exp(1j * np.outer(np.arange(starts) * (TURN / starts), harmonics))
        self._waves = np.exp(1j * np.outer(target.crank, harmonics))

    def _means(self, values: Any, mean: Mean) -> Complexes:
        """Return <f e^{iht}> over the samples for values f, h = 0 .. highest."""
        return mean.weighted(values) @ self._waves / mean.total

    def _both(self, shifted: Complexes, sign: int = 1) -> Complexes:
        return np.concatenate([shifted, sign * np.conj(shifted)])

    def _average(self, mean: Mean, harmonics: int) -> Floats:
        means = self._means(np.ones(self._target.samples), mean)[1 : harmonics + 1]
        return self._both(self._phases[:, 1 : harmonics + 1] * means).view(float)

    def rotation(self, group: _Group) -> Floats:
        """Return mean squared rotation errors, (n, windows)."""
        target, mean, size = self._target, self._target.rotation_mean, 2 * group.harmonics
        assert target.rotation is not None
        centred = target.rotation - group.winding * target.crank
        centred = centred - mean(centred)
        centred -= mean(centred)  # a large constant leaves a mean of its rounding
        products = self._means(centred, mean)[1 : group.harmonics + 1]
        along = self._both(self._phases[:, 1 : group.harmonics + 1] * products, -1).view(float)
        average = self._average(mean, size)
        result = group.series @ np.concatenate([average, -2 * along], axis=1).T
        result -= (group.series[:, 2 * size :] @ average[:, :size].T) ** 2
        return result + (group.mean_square + mean(centred**2))[:, None]

    def position(self, group: _Group) -> Floats:
        """Return mean squared position errors over l^2, (n, windows)."""
        target, mean, highest = self._target, self._target.position_mean, group.phasors.shape[1] // 2
        fixed = fixed_columns(target)
        size = float(np.sqrt(mean(np.abs(fixed.remainder) ** 2)))
        turn = self._phases[:, np.abs(np.arange(-highest, highest + 1))]
        turn = np.concatenate([np.conj(turn[:, :highest]), turn[:, highest:]], axis=1)
        squares = []
        for column in (fixed.constant, fixed.crank, fixed.remainder / size if size > 0 else fixed.remainder):
            ahead, behind = self._means(np.conj(column), mean), np.conj(self._means(column, mean))
            row = np.concatenate([behind[highest:0:-1], ahead[: highest + 1]])
            product = group.phasors @ self._both(turn * row).T
            squares.append(product.real**2 + product.imag**2)
        total = group.modulus_mean[:, None] + group.modulus @ self._average(mean, 2 * highest).T
        square = np.maximum(total - squares[0] - squares[1], _SMALLEST)
        return size**2 * np.maximum(1.0 - squares[2] / square, 0.0)
