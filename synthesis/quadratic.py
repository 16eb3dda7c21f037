"""Convex quadratic programs of few unknowns: the step of a sequential method, for many candidates at once."""

from __future__ import annotations

import numpy as np

from synthesis.arrays import Floats
from synthesis.kernel import QuadraticProgram


def minimise_quadratics(
    hessian: Floats, gradient: Floats, matrix: Floats, bound: Floats, inside: Floats, accuracy: Floats | float = 1e-9
) -> tuple[Floats, Floats]:
    """Minimisers of ``z'Hz/2 + g'z`` over ``Az + b >= 0``.

    Parameters
    ----------
    hessian : ndarray, shape (n, k, k)
        Positive semidefinite.
    gradient : ndarray, shape (n, k)
    matrix : ndarray, shape (n, m, k)
    bound : ndarray, shape (n, m)
    inside : ndarray, shape (n, k)
        Points with ``matrix @ z + bound > 0``.
    accuracy : float or ndarray, shape (n,)
        A program has ended once the sum of its multipliers times their slacks is not larger than this.

    Returns
    -------
    z, multipliers : ndarray, shape (n, k) and (n, m)
        Law: every z lies inside; none is worse than its beginning by more than rounding. A member gives the same in any batch.
    """
    count, rows, size = matrix.shape
    z, multiplier = np.array(inside, dtype=float, order="C"), np.empty((count, rows))
    program = QuadraticProgram(rows, size)
    given = (np.ascontiguousarray(part, dtype=float) for part in (hessian, gradient, matrix, bound))
    for one in zip(*given, np.broadcast_to(accuracy, count), z, multiplier):
        program.minimise(*one)
    return z, multiplier
