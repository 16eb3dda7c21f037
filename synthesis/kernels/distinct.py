"""Selection of rows of numbers that differ from one another."""

import numpy as np
from cython import Py_ssize_t, bint, double
from cython.cimports.libc.math import fabs


def apart(rows: double[:, ::1], reach: double[::1], selected, start: Py_ssize_t, max_rows: Py_ssize_t):
    """Select rows that differ from every row selected before by at least their own reach in some number.

    Parameters
    ----------
    rows : ndarray, shape (n, m)
        Best first.
    reach : ndarray, shape (n,)
    selected : sequence of int
        Rows selected already.
    start : int
        First row to examine.
    max_rows : int
        Maximum number of rows to select.

    Returns
    -------
    selected : ndarray of int
    """
    room = np.empty(len(rows) + len(selected), dtype=np.intp)
    out: Py_ssize_t[::1] = room
    count: Py_ssize_t = len(selected)
    room[:count] = selected
    for n in range(start, rows.shape[0]):
        if count >= max_rows:
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
