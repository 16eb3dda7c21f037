"""Steps of the Levenberg-Marquardt method, for many candidates at once, by Householder's method."""

import cython
import numpy as np
from cython import cfunc, declare, double, inline
from cython.cimports.libc.math import copysign, fabs, sqrt

SQUARE_MIN = declare(double, 1e-24)  # smallest square of a column in its damping
TINY = declare(double, 1e-300)  # keeps divisors away from zero


def damped_steps(rows: double[:, :, :], damping: double[::1], step_max: double):
    """Compute steps with Marquardt's damping.

    Parameters
    ----------
    rows : ndarray, shape (n, m + 1, residuals)
        Derivatives of the residuals with respect to the unknowns, then the residuals.
    damping : ndarray, shape (n,)
        Damping relative to the squares of the derivatives.
    step_max : float
        Largest change of an unknown.

    Returns
    -------
    steps : ndarray, shape (n, m)
    decrease : ndarray, shape (n,)
        Decrease of the sum of squares that a linear model predicts.
    """
    size: cython.int = rows.shape[1] - 1
    residuals: cython.int = rows.shape[2]
    steps, decreases = np.empty((rows.shape[0], size)), np.empty(rows.shape[0])
    step: double[:, ::1] = steps
    decrease: double[::1] = decreases
    upper: double[:, ::1] = np.empty((size + 1, residuals + size))
    ridge: double[::1] = np.empty(size)
    for n in range(rows.shape[0]):
        for c in range(size + 1):
            for j in range(residuals):
                upper[c, j] = rows[n, c, j]
            for j in range(size):
                upper[c, residuals + j] = 0.0
        for c in range(size):
            ridge[c] = damping[n] * max(column_product(upper, c, c, 0, residuals), SQUARE_MIN)
            upper[c, residuals + c] = sqrt(ridge[c])
        triangularise(upper, size + 1, residuals + size)
        right: double = 0.0
        longest: double = 0.0
        for c in range(size - 1, -1, -1):
            value: double = upper[size, c]
            right += value * value
            for k in range(c + 1, size):
                value -= upper[k, c] * step[n, k]
            step[n, c] = value / upper[c, c]
            longest = max(longest, fabs(step[n, c]))
        part = min(1.0, step_max / max(longest, TINY))
        # |r|^2 - |r + J s|^2 with J' r = R' right: a sum of positive terms
        decrease[n] = part * (2.0 - part) * right
        for c in range(size):
            step[n, c] *= -part
            decrease[n] += ridge[c] * step[n, c] * step[n, c]
    return steps, decreases


@cfunc
def triangularise(m: double[:, ::1], columns: cython.int, rows: cython.int):
    """Triangularise rows in place; each column of the matrix is a row of ``m``."""
    for c in range(min(columns, rows)):
        square = column_product(m, c, c, c, rows)
        if square > 0.0:
            norm = -copysign(sqrt(square), m[c, c])
            head = m[c, c] - norm
            m[c, c] = head
            for k in range(c + 1, columns):
                product = column_product(m, c, k, c, rows) / (norm * head)
                for j in range(c, rows):
                    m[k, j] += product * m[c, j]
            m[c, c] = norm
        for j in range(c + 1, rows):
            m[c, j] = 0.0


@cfunc
@inline
@cython.exceptval(check=False)
def column_product(m: double[:, ::1], a: cython.int, b: cython.int, first: cython.int, rows: cython.int) -> double:
    """Return the inner product of two columns from a row on, in two partial sums."""
    even: double = 0.0
    odd: double = 0.0
    for j in range(first, rows - 1, 2):
        even += m[a, j] * m[b, j]
        odd += m[a, j + 1] * m[b, j + 1]
    if (rows - first) % 2:
        even += m[a, rows - 1] * m[b, rows - 1]
    return even + odd
