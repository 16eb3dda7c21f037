"""Actual dimensions and pose: the part of the problem that is linear once the crank's and the body's angles are known.

With theta1 and theta2 of a candidate at every sample (branch, start and length ratios chosen), the point of a body that
hangs on the crank pin is linear in three complex numbers (Sun, Liu, Chu, eqs 21-31, written over the samples instead of
their Haar coefficients)::

    P_m = A + z1 e^{i theta1_m} + z2 e^{i theta2_m},    z1 = k L1 e^{i theta4},    z2 = L_P e^{i (theta_P + theta4)}

Of the three columns the first two are the same for every candidate up to a constant factor, so they are made orthonormal
once a request; a candidate adds one vector. The (weighted) mean over the samples serves as inner product,
<f, g> = mean(conj(f) g).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.target import TURN, Target

DEGENERATE = 1e-6
"""A crank shorter than this part of the motion's extent is a linkage shrunk to a point: no answer."""


def _turned(target: Target) -> tuple[Complexes, complex, float]:
    """e^{it} less its mean, over its norm; and that mean and norm. Stable for small spans: e^{it}-1 = 2i sin(t/2) e^{it/2}."""
    mean = target.position_mean
    t = target.crank
    less_one = 2j * np.sin(t / 2) * np.exp(0.5j * t)
    average = mean(less_one)
    rest = less_one - average
    norm = float(np.sqrt(mean(np.abs(rest) ** 2)))
    return rest / norm, 1 + average, norm


class FixedColumns(NamedTuple):
    """What all candidates share: orthonormal columns for {1, e^{it}}, and what they leave of the positions.

    Attributes
    ----------
    one, turned : ndarray of complex, shape (N,)
        The columns.
    rest : ndarray of complex, shape (N,)
        Positions over l less their parts along both.
    along : complex
        The part of the positions over l along ``turned``.
    middle : complex
        Mean position.
    """

    one: Complexes
    turned: Complexes
    rest: Complexes
    along: complex
    middle: complex


def fixed_columns(target: Target) -> FixedColumns:
    """The columns of a target with positions that no candidate changes."""
    assert target.position is not None
    mean = target.position_mean
    turned, _, _ = _turned(target)
    middle = mean(target.position)
    scaled = (target.position - middle) / target.length_scale
    along = mean(np.conj(turned) * scaled)
    rest = scaled - turned * along
    rest = rest - mean(rest) - turned * mean(np.conj(turned) * rest)  # once more: the first pass leaves rounding
    return FixedColumns(np.ones_like(turned), turned, rest, along, middle)


class PositionFit(NamedTuple):
    """Best A, z1 e^{i theta1'}, z2 of candidates, and what they leave; leading axis: candidates."""

    pivot: Complexes
    crank_vector: Complexes
    """z1 e^{i theta1'}, with theta1' the crank angle at the first sample."""
    coupler_vector: Complexes
    residual: Complexes
    """(n, N): position less fit, in the user's unit."""


def fit_positions(target: Target, angle: Floats) -> PositionFit:
    """Least-squares pose of candidates.

    Parameters
    ----------
    target : Target
        With positions.
    angle : ndarray, shape (n, N)
        theta2 of the candidates at the samples.

    Returns
    -------
    PositionFit
        Law: no other A, z1, z2 leaves a smaller mean square. Where e^{i theta2} lies in the span of {1, e^{it}}, z2 = 0.
    """
    mean, scale = target.position_mean, target.length_scale
    turned, turned_mean, turned_norm = _turned(target)
    fixed = fixed_columns(target)
    phasor = np.exp(1j * angle)
    constant = mean(phasor)
    own = phasor - constant[:, None]
    share = mean.product(own, np.conj(turned))
    own = own - share[:, None] * turned
    again = mean.product(own, np.conj(turned))
    left_mean = mean(own)
    own = own - left_mean[:, None] - again[:, None] * turned
    constant, share = constant + left_mean, share + again
    square = mean(np.abs(own) ** 2)
    independent = square > (16 * np.finfo(float).eps) ** 2
    coupler: Any = np.where(independent, mean.product(np.conj(own), fixed.rest), 0) / np.where(
        independent, square, 1.0
    )
    residual = fixed.rest - coupler[:, None] * own
    crank = (fixed.along - coupler * share) / turned_norm
    pivot = -coupler * constant - crank * turned_mean
    return PositionFit(fixed.middle + scale * pivot, scale * crank, scale * coupler, scale * residual)


def whole_turns(angle: Floats) -> Floats:
    """The whole turns next to angles, in radians."""
    return TURN * np.round(angle / TURN)


def rotation_residual(target: Target, angle: Floats) -> tuple[Floats, Floats]:
    """Best offsets (n,), or the given one, and requested rotation less offset less theta2 (n, N), in radians."""
    assert target.rotation is not None
    difference = target.rotation - angle
    if target.offset is not None:
        offset = target.offset + whole_turns(target.rotation_mean(difference) - target.offset)
        return offset, difference - offset[:, None]
    # the mean of a difference from the first sample keeps its digits where the angles are large
    first = difference[:, :1]
    offset = first[:, 0] + target.rotation_mean(difference - first)
    return offset, difference - offset[:, None]


def position_errors(target: Target, angle: Floats) -> Floats:
    """Rms position error of candidates over l, shape (n,), infinite for those that do not close at every sample.

    Law: for some of the samples, counted as part of all, no more than for all of them.
    """
    left = fit_positions(target, angle).residual / target.length_scale
    total = target.position_mean(np.abs(left) ** 2)
    return np.sqrt(np.where(np.isnan(total), np.inf, total))


def objective(target: Target, angle: Floats) -> Floats:
    """J of candidates: sqrt(mean square rotation error + mean square position error / l^2), shape (n,).

    Parameters
    ----------
    target : Target
    angle : ndarray, shape (n, N)
        theta2 at the samples. Of theta1 only the increments of the target count; its start is part of the fitted crank vector.

    Returns
    -------
    ndarray, shape (n,)
        Without positions the rms rotation error in radians. Infinite for candidates that do not close at every sample, and
        for those whose best fit is a linkage shrunk to a point.
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
