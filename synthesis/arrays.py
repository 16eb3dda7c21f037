"""Names of array types, products of plane vectors, and the angle of a triangle, shared by the numerical modules.

A plane vector is a complex number x + i y.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


def dot(a: Complexes | complex, b: NDArray[np.complexfloating] | complex) -> Floats:
    """Return the scalar product of two plane vectors."""
    return np.real(np.conj(a) * b)


def cross(a: Complexes | complex, b: NDArray[np.complexfloating] | complex) -> Floats:
    """Return the vector product of two plane vectors, positive if ``b`` is counter-clockwise of ``a``."""
    return np.imag(np.conj(a) * b)


def angle_at(adjacent: Floats | float, opposite: Floats | float, r: Floats) -> Floats:
    """Return the angle between two sides of a triangle, from its three sides.

    Half of the angle is computed from its sine and cosine, in which differences are taken before sums.
    Neither loses digits near a dead-centre position.

    Parameters
    ----------
    adjacent, r : ndarray or float
        Sides that enclose the angle.
    opposite : ndarray or float
        Side opposite the angle.

    Returns
    -------
    ndarray
        The angle, 0 to pi.
    """
    sine_square = np.maximum((opposite - (adjacent - r)) * (opposite + (adjacent - r)), 0.0)
    cosine_square = np.maximum((adjacent + r - opposite) * (adjacent + r + opposite), 0.0)
    return np.asarray(2 * np.arctan2(np.sqrt(sine_square), np.sqrt(cosine_square)))
