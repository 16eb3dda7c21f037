"""Actual dimensions and pose: the part of the problem that is linear once the crank and coupler angles are known.

With theta1 and theta2 of a candidate at every sample (branch, start and length ratios chosen), the body point is linear in
three complex numbers (Sun, Liu, Chu, eqs 21-31, written over the samples instead of their Haar coefficients)::

    P_m = A + z1 e^{i theta1_m} + z2 e^{i theta2_m},    z1 = k L1 e^{i theta4},    z2 = L_P e^{i (theta_P + theta4)}

Of the three columns the first two are the same for every candidate up to a constant factor, so they are made orthonormal
once a request; a candidate adds one vector. Means over the samples serve as inner product, <f, g> = mean(conj(f) g).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.target import Target

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

DEGENERATE = 1e-6
"""A crank shorter than this part of the motion's extent is a linkage shrunk to a point: no answer."""


def _turned(target: Target) -> tuple[Complexes, complex, float]:
    """e^{it} less its mean, over its norm; and that mean and norm. Stable for small spans: e^{it}-1 = 2i sin(t/2) e^{it/2}."""
    t = target.crank
    less_one = 2j * np.sin(t / 2) * np.exp(0.5j * t)
    mean = less_one.mean()
    rest = less_one - mean
    norm = float(np.sqrt(np.mean(np.abs(rest) ** 2)))
    return rest / norm, 1 + mean, norm


def fixed_parts(target: Target) -> tuple[Complexes, Complexes, Complexes]:
    """Orthonormal columns for {1, e^{it}}, and what is left of the positions over l when both are taken off.

    Returns
    -------
    one, turned, rest : ndarray of complex, shape (N,)
    """
    turned, _, _ = _turned(target)
    scaled = (target.position - target.position.mean()) / target.length_scale
    rest = scaled - turned * np.mean(np.conj(turned) * scaled)
    rest = rest - rest.mean() - turned * np.mean(np.conj(turned) * rest)  # once more: the first pass leaves rounding
    return np.ones_like(turned), turned, rest


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
    turned, turned_mean, turned_norm = _turned(target)
    mean = target.position.mean()
    scaled = (target.position - mean) / target.length_scale
    along = np.mean(np.conj(turned) * scaled)
    _, _, rest = fixed_parts(target)
    phasor = np.exp(1j * angle)
    constant = phasor.mean(axis=-1)
    own = phasor - constant[:, None]
    share = own @ np.conj(turned) / turned.size
    own = own - share[:, None] * turned
    again = own @ np.conj(turned) / turned.size
    left_mean = own.mean(axis=-1)
    own = own - left_mean[:, None] - again[:, None] * turned
    constant, share = constant + left_mean, share + again
    square = np.mean(np.abs(own) ** 2, axis=-1)
    independent = square > (16 * np.finfo(float).eps) ** 2
    coupler = np.where(independent, np.conj(own) @ rest / turned.size, 0) / np.where(independent, square, 1.0)
    residual = rest - coupler[:, None] * own
    crank = (along - coupler * share) / turned_norm
    pivot = -coupler * constant - crank * turned_mean
    scale = target.length_scale
    return PositionFit(mean + scale * pivot, scale * crank, scale * coupler, scale * residual)


def rotation_residual(target: Target, angle: Floats) -> tuple[Floats, Floats]:
    """Best offsets (n,) and requested rotation less offset less theta2 (n, N), in radians."""
    difference = target.rotation - angle
    # the mean of a difference from the first sample keeps its digits where the angles are large
    first = difference[:, :1]
    offset = first[:, 0] + (difference - first).mean(axis=-1)
    return offset, difference - offset[:, None]


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
        total = total + np.mean(residual**2, axis=-1)
    if target.position is not None:
        fit = fit_positions(target, angle)
        total = total + np.mean(np.abs(fit.residual / target.length_scale) ** 2, axis=-1)
        total = np.where(np.abs(fit.crank_vector) > DEGENERATE * target.extent, total, np.inf)
    return np.sqrt(np.where(np.isnan(total), np.inf, total))


@dataclass(frozen=True)
class Mount:
    """Pose of a linkage in the user's plane and unit; angles in radians."""

    scale: float
    """User's unit over model unit: multiplies the four lengths."""
    ground_angle: float
    pivot_a: complex
    pivot_b: complex
    coupler_radius: float
    coupler_angle: float

    def body_point(self, lengths: Floats, crank: Floats, angle: Floats) -> Complexes:
        """P at crank and coupler angles: A + k L1 e^{i(theta1+theta4)} + L_P e^{i(theta_P+theta2+theta4)}."""
        pin = self.pivot_a + self.scale * lengths[0] * np.exp(1j * (crank + self.ground_angle))
        return pin + self.coupler_radius * np.exp(1j * (self.coupler_angle + angle + self.ground_angle))


def mount(lengths: Floats, start: float, pivot: complex, crank_vector: complex, coupler_vector: complex) -> Mount:
    """The pose that a `PositionFit` of one candidate means.

    Parameters
    ----------
    lengths : ndarray, shape (4,)
        Model lengths, any scale.
    start : float
        theta1 at the first sample.
    pivot, crank_vector, coupler_vector : complex
    """
    scale = abs(crank_vector) / lengths[0]
    ground_angle = wrap(np.angle(crank_vector) - start)
    return Mount(
        float(scale),
        ground_angle,
        complex(pivot),
        complex(pivot + scale * lengths[3] * np.exp(1j * ground_angle)),
        float(abs(coupler_vector)),
        wrap(np.angle(coupler_vector) - ground_angle),
    )


def wrap(angle: float) -> float:
    """An angle in (-pi, pi]."""
    wrapped = float(np.arctan2(np.sin(angle), np.cos(angle)))
    return np.pi if wrapped <= -np.pi else wrapped


def position_condition(target: Target, angle: Floats) -> Floats:
    """Condition number of the fit of A, z1, z2: of the columns {1, e^{it}, e^{i theta2}}, each of norm one, shape (n,)."""
    columns = np.stack(
        [
            np.ones(angle.shape, dtype=complex),
            np.broadcast_to(np.exp(1j * target.crank), angle.shape),
            np.exp(1j * angle),
        ],
        axis=-1,
    )
    singular = np.linalg.svd(columns, compute_uv=False)
    smallest = np.maximum(singular[..., -1], np.finfo(float).tiny)
    return singular[..., 0] / smallest
