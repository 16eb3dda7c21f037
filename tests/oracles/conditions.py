"""Condition numbers, and the distance of Haar features: the rounding of its input that a computation may show.

A tolerance that hides a fault is larger than these.
"""

from __future__ import annotations

import numpy as np

from synthesis.four_bar import close_loop


def condition_of_closure(lengths, branch, crank_angle):
    """Condition number of theta2: error in radians per relative error of the worst input, shape (..., N).

    The sum of ``|d theta2 / d L_i| L_i`` over the lengths and ``|d theta2 / d theta1| |theta1|``.
    """
    closure = close_loop(lengths, crank_angle)
    gradient = np.abs(closure.coupler_angle_gradient(branch))
    lengths = np.asarray(lengths, dtype=float)[..., None, :]
    return (gradient[..., :4] * lengths).sum(-1) + gradient[..., 4] * np.abs(closure.crank_angle)
