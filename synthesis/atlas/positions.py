"""Lower bounds of the position error of windows, by inner products.

The positions of a window are fitted by {1, e^{it}, q = e^{i theta2}}. With both p (the positions) and q less their components
along 1 and e^{it}, the error is |p| times the sine of the angle between them. For the unit p^ of p and any orthonormal e_j
orthogonal to 1, e^{it} and p^, with a = |<p^, q>| and b^2 = sum |<e_j, q>|^2 <= |q|^2 - a^2, it is at least |p| b / sqrt(a^2
+ b^2).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Complexes, Floats, Ints
from synthesis.atlas.request import STARTS
from synthesis.atlas.table import COLUMNS, HARMONICS
from synthesis.pose import fixed_columns
from synthesis.target import TURN, Target

_GRID = 128
"""Samples over the turn from which the series of e^{i theta2} is computed."""
_LEFT_OUT = 1e-7
"""Sum of the coefficients that the series of some types may leave out."""
_PAIRS_AT_ONCE = 1 << 14
_ROUNDING = 1e-5
"""Relative rounding of an inner product in single precision."""


class PositionRequest:
    """Request matrices for positions."""

    def __init__(self, target: Target) -> None:
        mean, crank = target.position_mean, target.crank
        fixed = fixed_columns(target)
        self.size = float(np.sqrt(mean(np.abs(fixed.remainder) ** 2)))
        found: list[Complexes] = [fixed.constant, fixed.crank]
        candidates = [fixed.remainder, np.exp(-1j * crank), np.exp(2j * crank)]
        for column in candidates:
            remaining = column.astype(complex)
            before = mean(np.abs(remaining) ** 2)
            for _ in range(2):
                for direction in found:
                    remaining = remaining - direction * mean(np.conj(direction) * remaining)
            square = mean(np.abs(remaining) ** 2)
            found.append(remaining / np.sqrt(square) if square > 1e-16 * before else np.zeros_like(remaining))
        order = np.arange(-_GRID // 2, _GRID // 2)
        waves = np.exp(1j * np.outer(crank, order))
        inner = np.stack([mean.weighted(np.conj(direction)) @ waves / mean.total for direction in found[2:]])
        turned = np.exp(1j * np.outer(np.arange(STARTS) * (TURN / STARTS), order)) * inner[:, None, :]
        turned = np.concatenate([turned, np.conj(turned)], axis=1)
        self._factors: NDArray[np.complex64] = turned.astype(np.complex64)  # (3, windows, harmonics)

    def squared(self, series: Floats, errors: Floats) -> Floats:
        """Return lower bounds of mean squared position errors over l^2 of all windows of types (n, COLUMNS), (n, windows)."""
        phasors, part, off = _phasors(series, errors)
        factors = np.ascontiguousarray(self._factors[:, :, part]).reshape(-1, phasors.shape[1])
        return self._bound((phasors @ factors.T).reshape(len(series), 3, -1), off[:, None])

    def squared_of_pairs(self, series: Floats, errors: Floats, types: Ints, windows: Ints) -> Floats:
        """Return the same of some windows: of each the index of its type in ``series``, and its number, (m,)."""
        phasors, part, off = _phasors(series, errors)
        factors, result = np.ascontiguousarray(self._factors[:, :, part]), np.empty(types.size)
        for first in range(0, types.size, _PAIRS_AT_ONCE):
            now = slice(first, first + _PAIRS_AT_ONCE)
            product = np.einsum("mk,jmk->mj", phasors[types[now]], factors[:, windows[now]])
            result[now] = self._bound(product[:, :, None], off[types[now]][:, None])[:, 0]
        return result

    def _bound(self, product: NDArray[np.complex64], off: NDArray[np.float32]) -> Floats:
        """Bound the squared errors from inner products (n, 3, m), off by as much as the rest of the series."""
        squares = product.real**2 + product.imag**2
        across = np.maximum(np.sqrt(squares[:, 1] + squares[:, 2]) * np.float32(1 - _ROUNDING) - off, 0)
        along = np.sqrt(squares[:, 0]) * np.float32(1 + _ROUNDING) + off
        across *= across
        share = across / np.maximum(across + along * along, np.float32(1e-37))
        return share.astype(float) * self.size**2


def _phasors(series: Floats, errors: Floats) -> tuple[NDArray[np.complex64], slice, NDArray[np.float32]]:
    """Return the series of e^{i theta2} of types, its harmonics as a slice of all, and bounds of what it leaves out."""
    angle = series[:, 1:] @ _waves() + series[:, :1] * (np.arange(_GRID) * (TURN / _GRID))
    phasors = np.fft.fftshift(np.fft.fft(np.exp(1j * angle), axis=1), axes=1) / _GRID
    # amplitudes by harmonic, and what a series up to each of them leaves out
    half, size = _GRID // 2, np.abs(phasors)
    pairs = np.pad(size[:, half:], ((0, 0), (0, 1))) + np.pad(size[:, half - 1 :: -1], ((0, 0), (1, 0)))
    tails = np.cumsum(pairs[:, ::-1], axis=1)[:, ::-1]
    enough = np.flatnonzero(tails.max(axis=0) <= _LEFT_OUT)
    highest = int(enough[0]) - 1 if enough.size else half - 1
    part = slice(half - highest, half + highest + 1)
    off = errors[:, 0] + tails[:, highest + 1] + 2 * tails[:, 3 * half // 4]
    return phasors[:, part].astype(np.complex64), part, off.astype(np.float32)


def _waves() -> Floats:
    """Return the values on the grid that belong to the columns of a series from the second on."""
    turned = np.exp(1j * np.outer(np.arange(1, HARMONICS + 1), np.arange(_GRID) * (TURN / _GRID)))
    table = np.zeros((COLUMNS - 1, _GRID))
    table[1::2], table[2::2] = turned.real, turned.imag
    return table
