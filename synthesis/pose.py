"""Actual dimensions and pose of a linkage, which are linear once the angles of crank and body are known.

For a candidate with given branch, start and length ratios, theta1 and theta2 are known at every sample.
A point of the body that is attached to the crank pin is then linear in three complex numbers (Sun, Liu, Chu, eqs 21-31,
written for the samples instead of their Haar coefficients)::

    P_m = A + z1 e^{i theta1_m} + z2 e^{i theta2_m},    z1 = k L1 e^{i theta4},    z2 = L_P e^{i (theta_P + theta4)}

Up to a constant factor, the first two of the three columns are the same for every candidate.
They are therefore made orthonormal once per request, and a candidate adds a single vector.
The inner product is the (weighted) mean over the samples, <f, g> = mean(conj(f) g).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.target import TURN, Target

DEGENERATE = 1e-6
"""Length of the crank, as a fraction of the motion's extent, below which a linkage counts as shrunk to a point."""


def _crank_column(target: Target) -> tuple[Complexes, complex, float]:
    """Return e^{it} minus its mean, divided by its norm, and that mean and norm.

    The formula e^{it} - 1 = 2i sin(t/2) e^{it/2} keeps the digits for small spans.
    """
    mean = target.position_mean
    t = target.crank
    less_one = 2j * np.sin(t / 2) * np.exp(0.5j * t)
    average = mean(less_one)
    deviation = less_one - average
    norm = float(np.sqrt(mean(np.abs(deviation) ** 2)))
    return deviation / norm, 1 + average, norm


class FixedColumns(NamedTuple):
    """Orthonormal columns for {1, e^{it}}, common to all candidates, and the remainder of the positions."""

    constant: Complexes
    """Column of ones, shape (N,)."""
    crank: Complexes
    """Orthonormal column of e^{it}, shape (N,)."""
    remainder: Complexes
    """Positions over the length scale, minus their components along both columns, shape (N,)."""
    crank_component: complex
    """Component of the positions over the length scale along ``crank``."""
    mean_position: complex
    """Mean position."""


def fixed_columns(target: Target) -> FixedColumns:
    """Compute the columns of a target that are common to all candidates.

    Parameters
    ----------
    target : Target
        A target with positions.
    """
    assert target.position is not None
    mean = target.position_mean
    column, _, _ = _crank_column(target)
    mean_position = mean(target.position)
    scaled = (target.position - mean_position) / target.length_scale
    component = mean(np.conj(column) * scaled)
    remainder = scaled - column * component
    # The projection is repeated, because the first pass leaves rounding errors.
    remainder = remainder - mean(remainder) - column * mean(np.conj(column) * remainder)
    return FixedColumns(np.ones_like(column), column, remainder, component, mean_position)


class PositionFit(NamedTuple):
    """Least-squares pose of each candidate, and the position residuals; the first axis is the candidates."""

    pivot: Complexes
    """Fixed pivot A, shape (n,)."""
    crank_vector: Complexes
    """z1 e^{i theta1'}, with theta1' the crank angle at the first sample, shape (n,)."""
    coupler_vector: Complexes
    """z2, shape (n,)."""
    residual: Complexes
    """Requested position minus fitted position, in the user's unit, shape (n, N)."""


def fit_positions(target: Target, angle: Floats) -> PositionFit:
    """Compute the least-squares pose of candidates.

    Parameters
    ----------
    target : Target
        A target with positions.
    angle : ndarray, shape (n, N)
        Angle theta2 of the candidates at the samples.

    Returns
    -------
    PositionFit
        The pose with the smallest mean square residual. If e^{i theta2} lies in the span of {1, e^{it}}, z2 is 0.
    """
    mean, scale = target.position_mean, target.length_scale
    column, crank_mean, crank_norm = _crank_column(target)
    fixed = fixed_columns(target)
    phasor = np.exp(1j * angle)
    constant = mean(phasor)
    coupler_column = phasor - constant[:, None]
    component = mean.product(coupler_column, np.conj(column))
    coupler_column = coupler_column - component[:, None] * column
    correction = mean.product(coupler_column, np.conj(column))
    mean_correction = mean(coupler_column)
    coupler_column = coupler_column - mean_correction[:, None] - correction[:, None] * column
    constant, component = constant + mean_correction, component + correction
    square = mean(np.abs(coupler_column) ** 2)
    independent = square > (16 * np.finfo(float).eps) ** 2
    projection = mean.product(np.conj(coupler_column), fixed.remainder)
    coupler: Any = np.where(independent, projection, 0) / np.where(independent, square, 1.0)
    residual = fixed.remainder - coupler[:, None] * coupler_column
    crank = (fixed.crank_component - coupler * component) / crank_norm
    pivot = -coupler * constant - crank * crank_mean
    return PositionFit(fixed.mean_position + scale * pivot, scale * crank, scale * coupler, scale * residual)


def whole_turns(angle: Floats) -> Floats:
    """Return the multiple of a whole turn nearest to each angle, in radians."""
    return TURN * np.round(angle / TURN)


def rotation_residual(target: Target, angle: Floats) -> tuple[Floats, Floats]:
    """Compute the rotation offset of candidates and the remaining rotation error.

    Parameters
    ----------
    target : Target
        A target with rotations.
    angle : ndarray, shape (n, N)
        Angle theta2 of the candidates at the samples.

    Returns
    -------
    offset : ndarray, shape (n,)
        The least-squares offset, or the prescribed offset plus whole turns, in radians.
    residual : ndarray, shape (n, N)
        Requested rotation minus offset minus theta2, in radians.
    """
    assert target.rotation is not None
    difference = target.rotation - angle
    if target.offset is not None:
        offset = target.offset + whole_turns(target.rotation_mean(difference) - target.offset)
        return offset, difference - offset[:, None]
    # The mean of the deviations from the first sample keeps its digits if the angles are large.
    first = difference[:, :1]
    offset = first[:, 0] + target.rotation_mean(difference - first)
    return offset, difference - offset[:, None]


def objective(target: Target, angle: Floats) -> Floats:
    """Compute the objective J = sqrt(mean square rotation error + mean square position error / l^2) of candidates.

    Parameters
    ----------
    target : Target
        A target with rotations, positions or both.
    angle : ndarray, shape (n, N)
        Angle theta2 of the candidates at the samples.
        Only the increments of theta1 are used, from the target; its start is part of the fitted crank vector.

    Returns
    -------
    ndarray, shape (n,)
        The objective; without positions this is the rms rotation error in radians. Infinite for candidates that do
        not close at every sample, and for candidates whose best fit is a linkage that is shrunk to a point.
    """
    total = np.zeros(len(angle))
    if target.rotation is not None:
        _, residual = rotation_residual(target, angle)
        total = total + target.rotation_mean(residual**2)
    if target.position is not None:
        fit = fit_positions(target, angle)
        total = total + target.position_mean(np.abs(fit.residual / target.length_scale) ** 2)
        total = np.where(np.abs(fit.crank_vector) > DEGENERATE * target.extent, total, np.inf)
    return np.sqrt(np.where(np.isnan(total), np.inf, total))
