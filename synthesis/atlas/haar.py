"""Haar features of rotation curves: the average and the detail coefficients of 2^j samples (pywt does the transform).

The average is the mean of the samples; detail w(n, l) is half the difference of the means of the first and the second half of
block l at level n (Sun, Liu, Chu, table 2). Level 0 is the whole curve, level n has 2^n blocks. Details are stored flat, coarse
to fine: w(n, l) is element 2^n - 1 + l. Times the root of the block's length they are orthonormal, so by Parseval the Euclidean
distance of two such vectors over sqrt(2^j) is the rms difference of the two curves after the best constant offset.
"""

from __future__ import annotations

import numpy as np
import pywt
from numpy.typing import ArrayLike

from synthesis.arrays import Floats


def levels(samples: int) -> int:
    """Return j for 2^j samples; raise ValueError if the number is no power of two or below 2."""
    if samples < 2 or samples & (samples - 1):
        raise ValueError(f"samples must be a power of two of at least 2; it is {samples}")
    return samples.bit_length() - 1


def block_roots(samples: int) -> Floats:
    """Return the square root of the block length of each flat detail, (2^j - 1,)."""
    j = levels(samples)
    return np.repeat(np.sqrt(samples / 2.0 ** np.arange(j)), 2 ** np.arange(j))


def features(curve: ArrayLike) -> tuple[Floats, Floats]:
    """Return the Haar features of curves.

    Law: with r the block roots, ``sum((r * details)**2) = sum((curve - average)**2)``. A constant added to the curve leaves the
    details unchanged.

    Parameters
    ----------
    curve : array_like, shape (..., 2^j)
        Samples in any unit.

    Returns
    -------
    average : ndarray, shape (...)
    details : ndarray, shape (..., 2^j - 1)
        From coarse to fine.

    Examples
    --------
    >>> from synthesis.atlas import haar
    >>> haar.features([1.0, 3.0, 6.0, 10.0])
    (np.float64(5.0), array([-3., -1., -2.]))
    """
    curve = np.asarray(curve, dtype=float)
    roots = block_roots(curve.shape[-1])
    parts = pywt.wavedec(curve, "haar", mode="periodization", axis=-1)
    return curve.mean(axis=-1), np.concatenate(parts[1:], axis=-1) / roots


def curve_from_features(average: ArrayLike, details: ArrayLike) -> Floats:
    """Return curves from their average and details: the inverse of `features`.

    Parameters
    ----------
    average : array_like, shape (...)
    details : array_like, shape (..., 2^j - 1)

    Returns
    -------
    ndarray, shape (..., 2^j)

    Examples
    --------
    >>> from synthesis.atlas import haar
    >>> haar.curve_from_features(5.0, [-3, -1, -2])
    array([ 1.,  3.,  6., 10.])
    """
    average, details = np.asarray(average, dtype=float), np.asarray(details, dtype=float)
    samples = details.shape[-1] + 1
    curve = np.empty((*details.shape[:-1], samples))
    curve[..., 0] = average
    for n in range(levels(samples)):
        # the first sample of a block holds its mean; with its detail come the means of its halves
        step, half = samples >> n, details[..., 2**n - 1 : 2 ** (n + 1) - 1]
        curve[..., step // 2 :: step] = curve[..., ::step] - half
        curve[..., ::step] += half
    return curve


def resample(crank_angle: ArrayLike, curve: ArrayLike) -> tuple[Floats, Floats]:
    """Return a curve at evenly spaced crank angles, whose number is the next power of two.

    Parameters
    ----------
    crank_angle : array_like, shape (N,)
        Strictly monotonic, N >= 3.
    curve : array_like, shape (..., N)

    Returns
    -------
    crank_angle, curve : ndarray, shape (2^j,) and (..., 2^j)
        Both ends included, 2^j >= N. Unchanged if the samples are even and their number is a power of two, otherwise
        a cubic spline through the samples (not-a-knot ends). Law: cubics are reproduced exactly.
    """
    angle, curve = np.asarray(crank_angle, dtype=float), np.asarray(curve, dtype=float)
    samples = 1 << (angle.size - 1).bit_length()
    even = np.linspace(angle[0], angle[-1], samples)
    if samples == angle.size and np.allclose(even, angle, rtol=0, atol=1e-12 * abs(angle[-1] - angle[0])):
        return angle, curve
    from scipy.interpolate import CubicSpline

    sign = 1.0 if angle[-1] > angle[0] else -1.0
    return even, CubicSpline(sign * angle, curve, axis=-1)(sign * even)
