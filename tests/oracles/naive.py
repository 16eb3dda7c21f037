"""Slow twins that are obviously right: every fast path is compared with one of these."""

from __future__ import annotations

import mpmath
import numpy as np

DIGITS = 50


def joints(lengths, theta1, branch):
    """Return D and C in the ground frame by intersecting the circles of coupler and rocker; None if they do not meet."""
    with mpmath.workdps(DIGITS):
        l1, l2, l3, l4 = (mpmath.mpf(float(length)) for length in lengths)
        d = l1 * mpmath.expj(mpmath.mpf(float(theta1)))
        to_b = l4 - d
        r = abs(to_b)
        along = (r**2 + l2**2 - l3**2) / (2 * r)
        height_squared = l2**2 - along**2
        if height_squared < 0:
            return None
        return d, d + (along + mpmath.mpc(0, branch) * mpmath.sqrt(height_squared)) * to_b / r


def angles(lengths, theta1, branch):
    """Return theta2, theta3 in (-pi, pi] and the acute angle between coupler and rocker, to `DIGITS`; None if it
    does not close.
    """
    with mpmath.workdps(DIGITS):
        if (found := joints(lengths, theta1, branch)) is None:
            return None
        d, c = found
        coupler, rocker = c - d, c - mpmath.mpf(float(lengths[3]))
        between = abs(mpmath.arg(coupler / rocker))
        return mpmath.arg(coupler), mpmath.arg(rocker), min(between, mpmath.pi - between)


def types(perimeter, smallest, positions):
    """Dimension types by three loops; ``places`` are the orders of the sorted lengths, as tuples of indices."""
    found = set()
    for a in range(smallest, perimeter):
        for b in range(a + 1, perimeter):
            for c in range(b + 1, perimeter):
                d = perimeter - a - b - c
                if d <= c:
                    break
                if a + d < b + c:
                    found |= {tuple((a, b, c, d)[k] for k in order) for order in positions}
    return sorted(found)


def haar(curve):
    """Average, and details coarse to fine as half the difference of the means of both halves of each block."""
    details, size = [], len(curve)
    while size > 1:
        for first in range(0, len(curve), size):
            left, right = curve[first : first + size // 2], curve[first + size // 2 : first + size]
            details.append((np.mean(left) - np.mean(right)) / 2)
        size //= 2
    return np.mean(curve), np.array(details)
