"""The rows of an atlas: from dimension types to the Haar features of their body's rotation. Parts can be computed alone."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.atlas import haar
from synthesis.fourbar.mechanism import FOURBAR
from synthesis.mechanism import Mechanism
from synthesis.target import TURN

BLOCK = 256
"""Linkages worked on at a time: their samples fit a core's cache, which is twice as fast as all at once."""
BETWEEN = 1.5
"""Error anywhere over error at the samples and midway: sqrt(2) for a trigonometric polynomial of these harmonics (Ehlich and
Zeller, 1964: 1 / cos(pi n / M) for degree n at M points), and a little for what the samples do not resolve."""


class AtlasRows(NamedTuple):
    """Columns of the file for some types; see `table.Table`."""

    average: NDArray[np.float64]
    details: NDArray[np.float32]
    winding: NDArray[np.int8]
    curve_error: NDArray[np.float32]


def compute_rows(lengths: ArrayLike, samples: int, mechanism: Mechanism = FOURBAR) -> AtlasRows:
    """What the atlas stores of each type.

    Parameters
    ----------
    lengths : array_like, shape (T, d)
        Types whose crank turns fully.
    samples : int
        Power of two.
    mechanism : Mechanism

    Returns
    -------
    AtlasRows
        Law: the rows of a part are the part of the rows, bit for bit, if parts begin at multiples of `BLOCK`.
    """
    lengths = np.atleast_2d(np.asarray(lengths, dtype=float))
    blocks = [
        _compute_block(mechanism, lengths[k : k + BLOCK], samples) for k in range(0, max(len(lengths), 1), BLOCK)
    ]
    return AtlasRows(*(np.concatenate(columns) for columns in zip(*blocks)))


def _compute_block(mechanism: Mechanism, lengths: NDArray[np.float64], samples: int) -> AtlasRows:
    step = TURN / samples
    crank = np.arange(samples) * step
    winding: NDArray[Any] = mechanism.winding(lengths).astype(np.int8)

    def periodic(angle: NDArray[Any]) -> NDArray[np.float64]:
        return mechanism.body_angle(lengths, np.ones(len(lengths)), angle) - winding[:, None] * angle

    curve = periodic(crank)
    average, details = haar.features(curve)
    stored = details.astype("<f4")
    read_back = haar.curve_from_features(average, stored)
    at, midway = interpolate(read_back)
    error = np.maximum(np.abs(at - curve), np.abs(midway - periodic(crank + step / 2))).max(axis=-1)
    return AtlasRows(average, stored, winding, np.nextafter((BETWEEN * error).astype("<f4"), np.float32(np.inf)))


def interpolate(curve: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Band-limited interpolation of periodic samples, at each and midway to its next, both shaped as ``curve``.

    It is the trigonometric polynomial of all harmonics below the highest, whose phase the samples do not tell; so it does
    not pass through them.
    """
    samples = curve.shape[-1]
    spectrum = np.fft.rfft(curve, axis=-1)
    spectrum[..., -1] = 0
    shift = np.exp(1j * np.pi / samples * np.arange(samples // 2 + 1))
    return np.fft.irfft(spectrum, samples, axis=-1), np.fft.irfft(spectrum * shift, samples, axis=-1)
