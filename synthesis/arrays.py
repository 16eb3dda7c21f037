"""What the numerics share: names of array types, by the numbers they hold, products of plane vectors, angles of triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


def dot(one: Complexes | complex, other: NDArray[np.complexfloating] | complex) -> Floats:
    """Scalar product."""
    return np.real(np.conj(one) * other)


def cross(one: Complexes | complex, other: NDArray[np.complexfloating] | complex) -> Floats:
    """Vector product: positive where the second lies counter-clockwise of the first."""
    return np.imag(np.conj(one) * other)


def angle_at(near: Floats | float, far: Floats | float, r: Floats) -> Floats:
    """The angle of a triangle between ``near`` and ``r``, ``far`` opposite, 0 to pi.

    By sine and cosine of half of it, as differences before sums: neither loses digits next to a dead position.
    """
    below = np.maximum((far - (near - r)) * (far + (near - r)), 0.0)
    above = np.maximum((near + r - far) * (near + r + far), 0.0)
    return np.asarray(2 * np.arctan2(np.sqrt(below), np.sqrt(above)))
