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

from typing import Any

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.four_bar import coupler_angle
from synthesis.fourbar.mechanism import coupler_turns
from synthesis.pose import fixed_columns
from synthesis.target import TURN, Mean, Target

_SMALLEST = 1e-30
"""Smallest square that a residual is divided by."""


def _real_series(values: Floats, harmonics: int) -> tuple[Floats, Floats]:
    """Return the mean of samples over a turn, and their cosine and sine coefficients side by side."""
    spectrum = np.fft.rfft(values, axis=1)[:, : harmonics + 1] / values.shape[1]
    return spectrum[:, 0].real, np.ascontiguousarray(2 * np.conj(spectrum[:, 1:])).view(float)


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
    harmonics : int
        Length of the series of theta2.
    """

    def __init__(self, lengths: Floats, starts: int, samples: int, harmonics: int) -> None:
        self.lengths, self.starts, self._harmonics = lengths, starts, harmonics
        self._highest = int(1.25 * harmonics) + 4  # e^{i theta2} has more harmonics than theta2
        crank, self._winding = np.arange(samples) * (TURN / samples), coupler_turns(lengths)[:, None]
        periodic = coupler_angle(lengths, np.ones(len(lengths)), crank) - self._winding * crank
        spectrum = np.fft.rfft(periodic, axis=1) / samples
        spectrum[:, [0, -1]] = 0  # the best offset takes up any constant; the highest harmonic has no phase
        points = 4 * harmonics + 2
        square = np.fft.irfft(spectrum[:, : harmonics + 1] * points, points, axis=1) ** 2
        self._mean_square, self._square = _real_series(square, 2 * harmonics)
        self._curve = np.ascontiguousarray(2 * np.conj(spectrum[:, 1 : harmonics + 1])).view(float)
        points = max(samples, 1 << (4 * self._highest - 1).bit_length())
        order = np.arange(-self._highest, self._highest + 1)
        angle = np.fft.irfft(spectrum * points, points, axis=1) + self._winding * np.arange(points) * (TURN / points)
        self._phasors = (np.fft.fft(np.exp(1j * angle), axis=1) / points)[:, order % points]
        padded = np.zeros((len(lengths), 4 * self._highest + 2), dtype=complex)
        padded[:, order] = self._phasors
        # the squared modulus of the series, which is not quite 1
        modulus = np.abs(np.fft.ifft(padded, axis=1) * padded.shape[1]) ** 2
        self._mean_modulus, self._modulus = _real_series(modulus, 2 * self._highest)
        self._phases = np.exp(1j * np.outer(np.arange(starts) * (TURN / starts), np.arange(2 * self._highest + 1)))

    def squared(self, target: Target) -> Floats:
        """Return the approximate squared error of every window, (types, branches, starts), branch +1 first."""
        waves = np.exp(1j * np.outer(target.crank, np.arange(2 * self._highest + 1)))
        result = np.zeros((len(self.lengths), 2 * self.starts))
        if target.rotation is not None:
            result += self._rotation(target, target.rotation, waves)
        if target.position is not None:
            result += self._position(target, waves)
        return np.maximum(result, 0.0).reshape(-1, 2, self.starts)

    def _windows(self, values: Floats, mean: Mean, waves: Complexes, harmonics: int, sign: int = 1) -> Floats:
        """Return <f e^{ih(s + t)}> for values f, h = 1 .. harmonics, with a row for each window, branch +1 first."""
        means = (mean.weighted(values) @ waves / mean.total)[1 : harmonics + 1]
        shifted = self._phases[:, 1 : harmonics + 1] * means
        return np.concatenate([shifted, sign * np.conj(shifted)]).view(float)

    def _rotation(self, target: Target, rotation: Floats, waves: Complexes) -> Floats:
        """Return mean squared rotation errors, (n, windows)."""
        mean, size = target.rotation_mean, self._harmonics
        average = self._windows(np.ones(target.samples), mean, waves, 2 * size)
        turned, crank = (values - mean(values) for values in (rotation, target.crank))
        turned -= mean(turned)  # a large constant leaves a mean of its rounding
        along, swept = (self._windows(values, mean, waves, size, -1) for values in (turned, crank))
        result = self._square @ average.T - (self._curve @ average[:, : 2 * size].T) ** 2
        result -= 2 * (self._curve @ along.T - self._winding * (self._curve @ swept.T))
        own = np.array([mean((turned - turns * crank) ** 2) for turns in (0, 1)])
        return result + self._mean_square[:, None] + own[self._winding]

    def _position(self, target: Target, waves: Complexes) -> Floats:
        """Return mean squared position errors over l^2, (n, windows)."""
        mean, highest, fixed = target.position_mean, self._highest, fixed_columns(target)
        size = float(np.sqrt(mean(np.abs(fixed.remainder) ** 2)))
        turn = self._phases[:, : highest + 1]
        turn = np.concatenate([np.conj(turn[:, :0:-1]), turn], axis=1)
        squares = []
        for column in (fixed.constant, fixed.crank, fixed.remainder / size if size > 0 else fixed.remainder):
            ahead, behind = (mean.weighted(values) @ waves / mean.total for values in (np.conj(column), column))
            shifted: Any = turn * np.concatenate([np.conj(behind[highest:0:-1]), ahead[: highest + 1]])
            product = self._phasors @ np.concatenate([shifted, np.conj(shifted)]).T
            squares.append(product.real**2 + product.imag**2)
        average = self._windows(np.ones(target.samples), mean, waves, 2 * highest)
        total = self._mean_modulus[:, None] + self._modulus @ average.T
        square = np.maximum(total - squares[0] - squares[1], _SMALLEST)
        return size**2 * np.maximum(1.0 - squares[2] / square, 0.0)
