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


def position_condition(crank, angle):
    """Return the condition number of the fit of A, z1, z2: of the columns {1, e^{it}, e^{i theta2}}, each of unit
    norm.
    """
    columns = np.stack([np.ones_like(crank), np.exp(1j * crank), np.exp(1j * angle)], axis=-1)
    singular = np.linalg.svd(columns, compute_uv=False)
    return singular[0] / max(singular[-1], np.finfo(float).tiny)


def feature_distance(details, second):
    """Rms difference of two curves after the best constant offset, from their orthonormal details."""
    return np.sqrt(np.sum((details - second) ** 2) / (details.size + 1))
