"""Convex quadratic programs with few unknowns, as steps of a sequential method, for many candidates at once."""

from __future__ import annotations

import numpy as np

from synthesis.arrays import Floats
from synthesis.kernels.quadratic_program import QuadraticProgram


def minimise_quadratics(
    hessian: Floats, gradient: Floats, matrix: Floats, bound: Floats, inside: Floats, accuracy: Floats | float = 1e-9
) -> tuple[Floats, Floats]:
    """Minimise ``z'Hz/2 + g'z`` subject to ``Az + b >= 0``.

    Parameters
    ----------
    hessian : ndarray, shape (n, k, k)
        Positive semidefinite matrices H.
    gradient : ndarray, shape (n, k)
        Vectors g.
    matrix : ndarray, shape (n, m, k)
        Matrices A.
    bound : ndarray, shape (n, m)
        Vectors b.
    inside : ndarray, shape (n, k)
        Starting points with ``matrix @ z + bound > 0``.
    accuracy : float or ndarray, shape (n,)
        A program ends when the sum of its multipliers times its slacks does not exceed this value.

    Returns
    -------
    z, multipliers : ndarray, shape (n, k) and (n, m)
        Every z is feasible, and no objective exceeds its value at the start by more than rounding. The result of a program
        does not depend on the other programs of the batch.
    """
    count, rows, size = matrix.shape
    z, multiplier = np.array(inside, dtype=float, order="C"), np.empty((count, rows))
    program = QuadraticProgram(rows, size)
    arguments = (np.ascontiguousarray(part, dtype=float) for part in (hessian, gradient, matrix, bound))
    for problem in zip(*arguments, np.broadcast_to(accuracy, count), z, multiplier):
        program.minimise(*problem)
    return z, multiplier
