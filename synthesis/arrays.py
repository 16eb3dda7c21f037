"""What the numerics share: names of array types, by the numbers they hold, and products of plane vectors as complex numbers."""

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
