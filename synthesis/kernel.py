"""What a search computes for one candidate at a time, compiled: the triangle of a least-squares step.

Cython's pure Python mode: setup.py compiles this module; uncompiled it runs too, slowly, and is the oracle of its own test.
"""

import cython
from cython.cimports.libc.math import fabs


@cython.ccall
def back_substitute(r: cython.double[:, ::1], b: cython.double[::1], x: cython.double[::1]) -> cython.bint:
    """Solution x of R x = b with an upper triangle R; false, and x as it was, where R has a zero on its diagonal.

    Column by column, so that the inner loop runs over what lies side by side: ``r[k, :k]`` is column k of R above its diagonal.
    """
    n: cython.Py_ssize_t = b.shape[0]
    i: cython.Py_ssize_t
    k: cython.Py_ssize_t
    for k in range(n):
        if fabs(r[k, k]) == 0:
            return False
    for k in range(n):
        x[k] = b[k]
    for k in range(n - 1, -1, -1):
        x[k] /= r[k, k]
        for i in range(k):
            x[i] -= x[k] * r[k, i]
    return True
