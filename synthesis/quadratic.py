"""Convex quadratic programs with few unknowns, as steps of a sequential method, for many candidates at once."""

from __future__ import annotations

import numpy as np

from synthesis.arrays import Floats
from synthesis.kernels.quadratic_program import QuadraticProgram


def minimise_quadratics(
    hessian: Floats, gradient: Floats, matrix: Floats, bound: Floats, inside: Floats, accuracy: Floats | float = 1e-9
) -> tuple[Floats, Floats]:
    """Minimise ``z'Hz/2 + g'z`` subject to ``Az + b >= 0``.

    ``hessian`` (n, k, k): positive semidefinite matrices H. ``gradient`` (n, k): vectors g. ``matrix`` (n, m, k): matrices A.
    ``bound`` (n, m): vectors b. ``inside`` (n, k): starting points with ``matrix @ z + bound > 0``. ``accuracy`` (n,): a
    program ends when the sum of its multipliers times its slacks does not exceed this value.

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
