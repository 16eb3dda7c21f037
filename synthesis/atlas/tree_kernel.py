"""The compiled step down the tree of an atlas: bounds for eight siblings at a time.

Written in Cython's pure Python mode, like `synthesis.kernels`; `scan` is the only caller and `docs/method.md` derives the bounds.
Eight siblings lie side by side in every array, so that the processor handles them as vectors.
"""

import cython
import numpy as np
from cython import Py_ssize_t, declare
from cython.cimports.libc.math import fabs, sqrt


def expand(
    series: cython.float[:, :, ::1],
    errors: cython.float[:, :, ::1],
    slopes: cython.float[:, :, ::1],
    bends: cython.float[:, :, ::1],
    rows: cython.float[:, :, ::1],
    target: cython.double[::1],
    weights: cython.float[:, :, ::1],
    first_piece: cython.int[::1],
    spread: cython.double,
    rounding: cython.double[::1],
    blocks: cython.int[::1],
    windows: cython.int[::1],
    limit: cython.double,
):
    """Return the children that may have windows with an error of at most the limit.

    Parameters
    ----------
    series, errors, slopes, bends : (blocks, columns or 2 or pieces, 8)
        A level of the tree, eight siblings side by side; without pieces at the lowest level.
    rows, target, weights, first_piece, spread, rounding
        See `request.RotationRequest`.
    blocks, windows : (n,)
        Whose eight children are looked at in which window.

    Returns
    -------
    children, windows, bounds, estimates : (m,)
        Lower bounds of the error of everything below a child, and the error of its own series along the directions.
    """
    count: Py_ssize_t = blocks.shape[0]
    columns: Py_ssize_t = series.shape[1]
    pieces: Py_ssize_t = slopes.shape[1]
    directions: Py_ssize_t = rows.shape[1]
    covered: Py_ssize_t = weights.shape[2] if pieces > 0 else 0
    children, survivors = np.empty(8 * count, np.int32), np.empty(8 * count, np.int32)
    bounds, estimates = np.empty(8 * count), np.empty(8 * count)
    child: cython.int[::1] = children
    window_of: cython.int[::1] = survivors
    bound_of: cython.double[::1] = bounds
    estimate_of: cython.double[::1] = estimates
    line, bent, dot = declare(cython.float[8]), declare(cython.float[8]), declare(cython.float[8])
    reach, bend, along = declare(cython.double[8]), declare(cython.double[8]), declare(cython.double[8])
    square, room = declare(cython.double[8]), declare(cython.double[8])
    x, m = declare(cython.pointer(cython.float)), declare(cython.pointer(cython.float))
    n, j, c, k = declare(Py_ssize_t), declare(Py_ssize_t), declare(Py_ssize_t), declare(Py_ssize_t)
    block, window, piece = declare(Py_ssize_t), declare(Py_ssize_t), declare(Py_ssize_t)
    factor, bend_factor = declare(cython.float), declare(cython.float)
    value, remainder, target_bound = declare(cython.double), declare(cython.double), declare(cython.double)
    alive = declare(cython.int)
    found: Py_ssize_t = 0
    top: cython.double = limit * limit
    for n in range(count):
        block, window = blocks[n], windows[n]
        for j in range(8):
            line[j] = 0
            bent[j] = 0
        if covered > 0:
            piece = first_piece[window]
            for c in range(covered):
                factor, bend_factor = weights[window, 0, c], weights[window, 1, c]
                x, m = cython.address(slopes[block, piece, 0]), cython.address(bends[block, piece, 0])
                for j in range(8):
                    line[j] += x[j] * x[j] * factor
                    bent[j] += m[j] * bend_factor
                piece += 1
                if piece == pieces:
                    piece = 0
        alive = 1
        for k in range(directions):
            m = cython.address(rows[window, k, 0])
            x = cython.address(series[block, 0, 0]) + 8 * columns
            for j in range(8):
                dot[j] = 0
            for c in range(columns - 1, -1, -1):
                factor = m[c]
                x -= 8
                for j in range(8):
                    dot[j] += x[j] * factor
            target_bound = target[k]
            if k == 0:
                for j in range(8):
                    value = errors[block, 1, j] * spread
                    if errors[block, 0, j] < value:
                        value = errors[block, 0, j]
                    reach[j] = sqrt(line[j]) + value + rounding[0] + rounding[1]
                    bend[j] = bent[j] + value + rounding[1]
                    if bend[j] > reach[j]:
                        bend[j] = reach[j]
                    along[j] = fabs(target_bound - dot[j])
                    square[j] = 0
                    # the largest square of the other components for which both bounds allow the limit
                    value = along[j] - reach[j] if along[j] > reach[j] else 0
                    remainder = top - value * value
                    room[j] = -1
                    if remainder >= 0:
                        value = bend[j] + sqrt(remainder)
                        room[j] = value * value
                        value = (limit + reach[j]) * (limit + reach[j]) - along[j] * along[j]
                        if value < room[j]:
                            room[j] = value
                        room[j] *= 1 + 1e-12
                    if not (dot[j] == dot[j]):
                        room[j] = -1
            else:
                for j in range(8):
                    value = target_bound - dot[j]
                    square[j] += value * value
            alive = 0
            for j in range(8):
                alive += square[j] <= room[j]
            if alive == 0:
                break
        if alive == 0:
            continue
        for j in range(8):
            if square[j] <= room[j]:
                remainder = sqrt(along[j] * along[j] + square[j])
                estimate_of[found] = remainder
                remainder = remainder - reach[j] if remainder > reach[j] else 0
                value = along[j] - reach[j] if along[j] > reach[j] else 0
                target_bound = sqrt(square[j]) - bend[j]
                if target_bound > 0:
                    value = sqrt(value * value + target_bound * target_bound)
                child[found] = 8 * block + j
                window_of[found] = window
                bound_of[found] = value if value > remainder else remainder
                found += 1
    return children[:found], survivors[:found], bounds[:found], estimates[:found]
