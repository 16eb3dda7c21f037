"""How well a motion fixes a linkage, and how much the motion changes with each length."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.kinematics import close_loop
from synthesis.fourbar.linkage import Linkage
from synthesis.target import Mean, Target

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

FREE = 1e3
"""A relative uncertainty of a length above this says that the motion does not determine it at all."""


@dataclass(frozen=True)
class Determination:
    """How well a motion fixes a linkage, from the singular values of the motion's derivatives.

    The unknowns are the logarithms of the actual lengths, the angles, and the pose over the length scale; the motion is
    measured as in the objective. An error ``resolution`` of the motion moves the logarithm of a length by up to
    ``length_uncertainty``, to first order (Golub and Van Loan, Matrix Computations, 5.3).
    """

    condition: float
    """Largest over smallest singular value; 1e17 where the smallest vanishes."""
    length_uncertainty: Floats
    """(4,) relative; infinite where the motion does not fix a length at all. Without positions the ground is exact."""
    resolution: float
    at_limits: tuple[str, ...] = ()
    """Names of the limits without which the motion would be met better; see `held`."""

    ILL_POSED = 1e-3

    @property
    def ill_posed(self) -> bool:
        """Whether a length is not even fixed to a thousandth at this resolution."""
        return bool(np.max(self.length_uncertainty) > self.ILL_POSED)


@dataclass(frozen=True)
class Sensitivity:
    """Change of the motion per unit of each length, everything else held: rms over the samples, (4,) each."""

    rotation: Floats | None
    """Rms change of rotation per unit of crank, coupler, rocker, ground."""
    position: Floats | None
    """Rms change of position per unit of crank, coupler, rocker, ground."""


class _Motion:
    """Derivatives of the motions of linkages for one target, batched over the linkages."""

    def __init__(self, target: Target, linkages: list[Linkage]) -> None:
        self.links = np.array([one.links for one in linkages])
        branch = np.array([one.branch for one in linkages])
        crank = np.array([one.start for one in linkages])[:, None] + target.crank
        closure = close_loop(self.links, crank)
        slope = closure.coupler_angle_gradient(branch)
        self.rotation = slope if target.rotation is not None else None
        """(n, N, 5): by L1 .. L4, per unit, and theta1."""
        self.position: Complexes | None = None
        """(n, N, 5), the pose held."""
        if target.position is None:
            return
        ground_angle = np.array([one.ground_angle for one in linkages])[:, None]
        points = np.array([one.coupler_point for one in linkages])
        coupler = (points[:, 0] * np.exp(1j * points[:, 1]))[:, None]
        turned = np.exp(1j * (crank + ground_angle))
        self.arm = np.exp(1j * (closure.coupler_angle(branch) + ground_angle))
        """e^{i(theta2 + theta4)}."""
        self.point = self.links[:, :1] * turned + coupler * self.arm
        """P less A."""
        position = (1j * coupler * self.arm)[:, :, None] * slope
        position[:, :, 0] += turned
        position[:, :, 4] += 1j * self.links[:, :1] * turned
        self.position = position


def sensitivities(target: Target, linkages: list[Linkage]) -> list[Sensitivity]:
    """First-order change of each linkage's motion per unit of each length."""
    if not linkages:
        return []
    motion = _Motion(target, linkages)

    def rms(derivatives: NDArray[Any] | None, mean: Mean) -> list[Floats | None]:
        if derivatives is None:
            return [None] * len(linkages)
        return list(np.sqrt(mean(np.abs(np.moveaxis(derivatives[:, :, :4], 1, -1)) ** 2)))

    rotation, position = rms(motion.rotation, target.rotation_mean), rms(motion.position, target.position_mean)
    return [Sensitivity(r, p) for r, p in zip(rotation, position)]


def determinations(target: Target, linkages: list[Linkage], resolutions: list[float]) -> list[Determination]:
    """How well the motion fixes each linkage; see `Determination`.

    Parameters
    ----------
    target : Target
    linkages : list of Linkage
    resolutions : list of float
        Error of the motion, in the objective's measure, that is considered for each.
    """
    if not linkages:
        return []
    matrix, free = derivative_matrix(target, linkages)
    _, singular, vectors = np.linalg.svd(matrix, full_matrices=False)
    floor = np.finfo(float).eps * singular[:, :1] * np.sqrt(matrix.shape[1])
    inverse = 1 / np.maximum(singular, np.maximum(floor, np.finfo(float).tiny))
    share = vectors[:, :, :free] ** 2
    uncertainty = np.zeros((len(linkages), 4))
    uncertainty[:, :free] = np.sqrt(np.einsum("nkf,nk->nf", share, inverse**2))
    uncertainty *= np.array(resolutions)[:, None]
    # a direction without a singular value is free, and so is every length that has a part in it
    lost = np.einsum("nkf,nk->nf", share, (singular <= floor).astype(float)) > 1e-12
    uncertainty[:, :free][lost] = np.inf
    uncertainty[uncertainty > FREE] = np.inf
    condition = singular[:, 0] * inverse.max(axis=1)
    return [Determination(float(c), row, r) for c, row, r in zip(condition, uncertainty, resolutions)]


def derivative_matrix(target: Target, linkages: list[Linkage]) -> tuple[Floats, int]:
    """Derivatives of the objective's residual (n, rows, unknowns), and how many logarithms of lengths come first."""
    motion = _Motion(target, linkages)
    count, samples = len(linkages), target.samples
    free = 3 if motion.position is None else 4
    by_unknown = np.concatenate([motion.links, np.ones((count, 1))], axis=1)[:, None, [*range(free), 4]]
    ones = np.ones((count, samples))
    turn = None
    if motion.rotation is not None:
        turn = motion.rotation[:, :, [*range(free), 4]] * by_unknown
        turn = np.concatenate([turn, ones[:, :, None]], axis=2) * _rooted(target.rotation_mean)
    if motion.position is not None:
        place = motion.position * by_unknown / target.length_scale
        pose = [1j * motion.point / target.length_scale, ones, 1j * ones, motion.arm, 1j * motion.arm]
        place = np.stack([*np.moveaxis(place, -1, 0), *pose], axis=-1) * _rooted(target.position_mean)
        place = np.concatenate([place.real, place.imag], axis=1)
        if turn is None:
            matrix = place
        else:
            # unknowns: lengths and start of both; then the offset of the rotation; then the pose of the position
            matrix = np.zeros((count, 3 * samples, place.shape[2] + 1))
            matrix[:, :samples, : free + 2] = turn
            matrix[:, samples:, : free + 1] = place[:, :, : free + 1]
            matrix[:, samples:, free + 2 :] = place[:, :, free + 1 :]
    else:
        assert turn is not None
        matrix = turn
    held = ([free] if target.start is not None else []) + ([free + 1] if target.offset is not None else [])
    matrix = np.delete(matrix, held, axis=2)
    if target.found:
        matrix = _angles_eliminated(matrix, samples, free)
    if (missing := matrix.shape[2] - matrix.shape[1]) > 0:
        matrix = np.concatenate([matrix, np.zeros((count, missing, matrix.shape[2]))], axis=1)
    return np.nan_to_num(matrix, posinf=0.0, neginf=0.0), free


def _angles_eliminated(matrix: Floats, samples: int, start: int) -> Floats:
    """The matrix where each sample has a crank angle of its own: what that angle can make up is projected out, sample by sample.

    The column ``start`` holds each sample's derivative by its own crank angle; it goes.
    """
    rows = matrix.reshape(len(matrix), -1, samples, matrix.shape[2])
    turn = rows[..., start]
    square = np.einsum("nrk,nrk->nk", turn, turn)
    along = np.einsum("nrk,nrkc->nkc", turn, rows) / np.where(square > 0, square, 1.0)[..., None]
    rest = rows - turn[..., None] * along[:, None]
    return np.delete(rest, start, axis=3).reshape(len(matrix), -1, matrix.shape[2] - 1)


def _rooted(mean: Mean) -> NDArray[Any]:
    """What rows (samples, unknowns) are multiplied with, so that their squares add up to mean squares."""
    return np.asarray(mean.root)[..., None]
