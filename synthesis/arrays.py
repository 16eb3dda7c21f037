"""Names of array types, rows of columns, and products of plane vectors.

A plane vector is a complex number x + i y.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
Rows = TypeVar("Rows", bound=tuple[Any, ...])
"""Named tuple of columns, each an array with a row for each candidate, or such a named tuple itself."""


def rows_at(columns: Rows, indices: Any) -> Rows:
    """Return some rows of all columns."""
    chosen = (rows_at(column, indices) if isinstance(column, tuple) else column[indices] for column in columns)
    return type(columns)(*chosen)


def rows_of_all(*parts: Rows) -> Rows:
    """Return the rows of the first part followed by the rows of the others."""
    joined = (rows_of_all(*c) if isinstance(c[0], tuple) else np.concatenate(c) for c in zip(*parts))
    return type(parts[0])(*joined)


def dot(a: Complexes | complex, b: NDArray[np.complexfloating] | complex) -> Floats:
    """Return the scalar product of two plane vectors."""
    return np.real(np.conj(a) * b)


def cross(a: Complexes | complex, b: NDArray[np.complexfloating] | complex) -> Floats:
    """Return the vector product of two plane vectors, positive if ``b`` is counter-clockwise of ``a``."""
    return np.imag(np.conj(a) * b)
