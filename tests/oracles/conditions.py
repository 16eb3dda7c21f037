"""How much rounding of its input a computation may show: condition numbers, and the distance that Haar features give."""

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
    """Condition number of the fit of A, z1, z2: of the columns {1, e^{it}, e^{i theta2}}, each of norm one."""
    columns = np.stack([np.ones_like(crank), np.exp(1j * crank), np.exp(1j * angle)], axis=-1)
    singular = np.linalg.svd(columns, compute_uv=False)
    return singular[0] / max(singular[-1], np.finfo(float).tiny)


def feature_distance(details, other):
    """Rms difference of two curves after the best constant offset, from their orthonormal details."""
    return np.sqrt(np.sum((details - other) ** 2) / (details.size + 1))
