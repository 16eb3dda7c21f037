"""Selection of rows of numbers that differ from one another."""

import numpy as np
from cython import Py_ssize_t, bint, double
from cython.cimports.libc.math import fabs


def apart(rows: double[:, ::1], reach: double[::1], kept, start: Py_ssize_t, most: Py_ssize_t):
    """Which rows to keep, best first: those that differ from every row kept before by their own reach in some number.

    ``rows`` (n, m), ``reach`` (n,); ``kept`` are kept already, the others are looked at from ``start`` on; ``most`` at most.
    """
    room = np.empty(len(rows) + len(kept), dtype=np.intp)
    out: Py_ssize_t[::1] = room
    count: Py_ssize_t = len(kept)
    room[:count] = kept
    for n in range(start, rows.shape[0]):
        if count >= most:
            break
        twin: bint = False
        for k in range(count):
            twin = True
            for c in range(rows.shape[1]):
                if not fabs(rows[out[k], c] - rows[n, c]) < reach[n]:
                    twin = False
                    break
            if twin:
                break
        if not twin:
            out[count] = n
            count += 1
    return room[:count]
