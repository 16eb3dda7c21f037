"""Finished linkages with their pose, errors and how well they are determined: what every kind of search ends in."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.kinematics import FULL_CRANK, TURN, Family, close_loop, family, transmission_angle_over
from synthesis.fourbar.pose import Mount, fit_positions, mount, rotation_residual
from synthesis.target import Target

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

SAME = 1e-6
"""Linkages whose numbers agree to this, relative to their size, are the same linkage."""
APART = 1e-2
"""Refined solutions that agree to this are one valley's; only its best is worth a user's look."""
FREE = 1e3
"""A relative uncertainty of a length above this says that the motion does not determine it at all."""


@dataclass(frozen=True)
class Errors:
    """Errors of a motion at the samples: angles in radians, positions in the user's unit; None for what was not asked."""

    rotation_rms: float | None
    rotation_max: float | None
    position_rms: float | None
    position_max: float | None
    objective: float


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

    ILL_POSED = 1e-3

    @property
    def ill_posed(self) -> bool:
        """Whether a length is not even fixed to a thousandth at this resolution."""
        return bool(np.max(self.length_uncertainty) > self.ILL_POSED)


@dataclass(frozen=True)
class Sensitivity:
    """Change of the motion per unit of each length, everything else held: rms over the samples, (4,) each."""

    rotation: Floats | None
    position: Floats | None


@dataclass(frozen=True)
class Solution:
    """A linkage that answers a request.

    Attributes
    ----------
    links : ndarray, shape (4,)
        Actual crank, coupler, rocker, ground; without positions the ground is 1.
    branch : int
    start : float
        theta1 at the first sample, [0, 2 pi).
    body_offset : float or None
        rotation = theta2 + theta4 + body_offset, theta2 in (-pi, pi] at the first sample and theta4 = 0 without positions.
    mount : Mount or None
        Its scale is 1: ``links`` are actual.
    errors : Errors
        Recomputed from the numbers above, by the path that a user would go.
    family : Family
    transmission_angle_min : float
        Over the used interval, exactly; 0 where it does not close between samples.
    transmission_angle_min_turn : float or None
        Over the whole turn; None where the crank does not turn fully.
    row : int or None
        Atlas row, for solutions that are a row as it is.
    """

    links: Floats
    branch: int
    start: float
    body_offset: float | None
    mount: Mount | None
    errors: Errors
    family: Family
    transmission_angle_min: float
    transmission_angle_min_turn: float | None
    row: int | None = None

    @property
    def identity(self) -> Floats:
        """Numbers, relative to the linkage's size, that tell linkages apart; the start does not count."""
        size = float(self.links.max())
        numbers = [*(self.links / size), self.branch]
        if self.mount is not None:
            m = self.mount
            coupler = m.coupler_radius / size * np.exp(1j * m.coupler_angle)
            ground = np.exp(1j * m.ground_angle)
            place = m.pivot_a / size
            numbers += [np.log(size), ground.real, ground.imag, coupler.real, coupler.imag, place.real, place.imag]
        return np.array(numbers)


class Status(StrEnum):
    """What was found."""

    REACHED = "reached"
    CLOSEST = "closest"
    INFEASIBLE = "infeasible"

    @classmethod
    def of(cls, solutions: list[Solution], tolerance: float) -> Status:
        """The status of solutions within the limits, best first: reached where the best objective is below the tolerance."""
        if not solutions:
            return cls.INFEASIBLE
        return cls.REACHED if solutions[0].errors.objective < tolerance else cls.CLOSEST


def make_solutions(
    target: Target, lengths: Floats, branch: NDArray[np.generic], start: Floats, rows: list[int] | None = None
) -> list[Solution]:
    """The solutions that candidates are: best offset and pose, actual lengths, errors.

    Parameters
    ----------
    target : Target
    lengths : ndarray, shape (n, 4)
        Any scale; each closes at every sample.
    branch, start : ndarray, shape (n,)
        theta1 at the first sample, in radians.
    rows : list of int, optional

    Returns
    -------
    list of Solution
    """
    lengths, branch = np.asarray(lengths, dtype=float), np.asarray(branch)
    start = np.asarray(start) % TURN
    if not start.size:
        return []
    if target.position is None:
        return finish_solutions(target, lengths / lengths[:, 3:], branch, start, None, rows)
    angle = close_loop(lengths, start[:, None] + target.crank).coupler_angle(branch)
    fit = fit_positions(target, angle)
    poses = [
        mount(lengths[k], start[k], fit.pivot[k], fit.crank_vector[k], fit.coupler_vector[k])
        for k in range(len(start))
    ]
    links = lengths * np.array([pose.scale for pose in poses])[:, None]
    return finish_solutions(target, links, branch, start, [replace(pose, scale=1.0) for pose in poses], rows)


def finish_solutions(
    target: Target,
    links: Floats,
    branch: NDArray[np.generic],
    start: Floats,
    poses: list[Mount] | None,
    rows: list[int] | None = None,
) -> list[Solution]:
    """Solutions from actual links and given poses: offsets, errors and the rest follow."""
    crank = start[:, None] + target.crank
    angle = principal(close_loop(links, crank).coupler_angle(branch))
    count = len(start)
    square = np.zeros(count)
    offset = rotation = position = [None] * count
    if target.rotation is not None:
        offset, residual = rotation_residual(target, angle)
        rotation = _rms_and_max(residual)
        square = square + np.array([rms for rms, _ in rotation]) ** 2
    if poses is not None:
        points = np.stack([pose.body_point(links[k], crank[k], angle[k]) for k, pose in enumerate(poses)])
        position = _rms_and_max(target.position - points)
        square = square + (np.array([rms for rms, _ in position]) / target.length_scale) ** 2
    families = family(links)
    used = np.nan_to_num(transmission_angle_over(links, start, start + target.span))
    turn = transmission_angle_over(links, np.zeros(count), np.full(count, np.pi))
    solutions = []
    for k in range(count):
        pose = poses[k] if poses is not None else None
        ground_angle = pose.ground_angle if pose is not None else 0.0
        rotation_rms, rotation_max = rotation[k] or (None, None)
        position_rms, position_max = position[k] or (None, None)
        solutions.append(
            Solution(
                links[k],
                int(branch[k]),
                float(start[k]),
                None if offset[k] is None else float(offset[k]) - ground_angle,
                pose,
                Errors(rotation_rms, rotation_max, position_rms, position_max, float(np.sqrt(square[k]))),
                Family(families[k]),
                float(used[k]),
                float(turn[k]) if families[k] in FULL_CRANK else None,
                rows[k] if rows is not None else None,
            )
        )
    return solutions


def _rms_and_max(values: NDArray[np.generic]) -> list[tuple[float, float]]:
    size = np.abs(values)
    largest = size.max(axis=-1)
    # squares of ratios: no under- or overflow at any unit of length
    rms = largest * np.sqrt(np.mean((size / np.where(largest > 0, largest, 1.0)[..., None]) ** 2, axis=-1))
    return list(zip(rms.tolist(), largest.tolist()))


def principal(angle: Floats) -> Floats:
    """Continuous curves of angles (..., N), moved by whole turns so that the first sample lies in (-pi, pi]."""
    first = angle[..., :1]
    wrapped = np.arctan2(np.sin(first), np.cos(first))
    return angle - TURN * np.round((first - wrapped) / TURN)


def distinct(solutions: list[Solution], top: int, apart: float = SAME) -> list[Solution]:
    """The best ``top`` that differ from one another by more than ``apart``, by objective; ties keep their order."""
    kept: list[Solution] = []
    identities = np.empty((0, 0))
    for solution in sorted(solutions, key=lambda s: s.errors.objective):
        if len(kept) == top:
            break
        mine = solution.identity
        if kept:
            near = np.abs(identities - mine) <= apart * np.maximum(1.0, np.abs(mine))
            if near.all(axis=1).any():
                continue
        kept.append(solution)
        identities = np.vstack([identities, mine]) if identities.size else mine[None, :]
    return kept


class _Motion:
    """Derivatives of the motions of solutions of one target, batched over the solutions."""

    def __init__(self, target: Target, solutions: list[Solution]) -> None:
        self.links = np.stack([s.links for s in solutions])
        branch = np.array([s.branch for s in solutions])
        crank = np.array([s.start for s in solutions])[:, None] + target.crank
        closure = close_loop(self.links, crank)
        slope = closure.coupler_angle_gradient(branch)
        self.rotation = slope if target.rotation is not None else None
        """(n, N, 5): by L1 .. L4, per unit, and theta1."""
        self.position: Complexes | None = None
        """(n, N, 5), the pose held."""
        if target.position is None:
            return
        poses = [s.mount for s in solutions]
        ground_angle = np.array([pose.ground_angle for pose in poses])[:, None]
        coupler = np.array([pose.coupler_radius * np.exp(1j * pose.coupler_angle) for pose in poses])[:, None]
        turned = np.exp(1j * (crank + ground_angle))
        self.arm = np.exp(1j * (closure.coupler_angle(branch) + ground_angle))
        """e^{i(theta2 + theta4)}."""
        self.point = self.links[:, :1] * turned + coupler * self.arm
        """P less A."""
        position = (1j * coupler * self.arm)[:, :, None] * slope
        position[:, :, 0] += turned
        position[:, :, 4] += 1j * self.links[:, :1] * turned
        self.position = position


def sensitivities(target: Target, solutions: list[Solution]) -> list[Sensitivity]:
    """First-order change of each solution's motion per unit of each length."""
    if not solutions:
        return []
    motion = _Motion(target, solutions)

    def rms(derivatives: NDArray[np.generic] | None) -> list[Floats | None]:
        if derivatives is None:
            return [None] * len(solutions)
        return list(np.sqrt(np.mean(np.abs(derivatives[:, :, :4]) ** 2, axis=1)))

    return [Sensitivity(r, p) for r, p in zip(rms(motion.rotation), rms(motion.position))]


def determinations(target: Target, solutions: list[Solution], resolutions: list[float]) -> list[Determination]:
    """How well the motion fixes each solution; see `Determination`.

    Parameters
    ----------
    target : Target
    solutions : list of Solution
    resolutions : list of float
        Error of the motion, in the objective's measure, that is considered for each.
    """
    if not solutions:
        return []
    matrix, free = _derivative_matrix(target, solutions)
    _, singular, vectors = np.linalg.svd(matrix, full_matrices=False)
    floor = np.finfo(float).eps * singular[:, :1] * np.sqrt(matrix.shape[1])
    inverse = 1 / np.maximum(singular, np.maximum(floor, np.finfo(float).tiny))
    share = vectors[:, :, :free] ** 2
    uncertainty = np.zeros((len(solutions), 4))
    uncertainty[:, :free] = np.sqrt(np.einsum("nkf,nk->nf", share, inverse**2))
    uncertainty *= np.array(resolutions)[:, None]
    # a direction without a singular value is free, and so is every length that has a part in it
    lost = np.einsum("nkf,nk->nf", share, (singular <= floor).astype(float)) > 1e-12
    uncertainty[:, :free][lost] = np.inf
    uncertainty[uncertainty > FREE] = np.inf
    condition = singular[:, 0] * inverse.max(axis=1)
    return [Determination(float(c), row, r) for c, row, r in zip(condition, uncertainty, resolutions)]


def _derivative_matrix(target: Target, solutions: list[Solution]) -> tuple[Floats, int]:
    """Derivatives of the objective's residual (n, rows, unknowns), and how many logarithms of lengths come first."""
    motion = _Motion(target, solutions)
    count, samples = len(solutions), target.samples
    free = 3 if motion.position is None else 4
    by_unknown = np.concatenate([motion.links, np.ones((count, 1))], axis=1)[:, None, [*range(free), 4]]
    rows, ones = [], np.ones((count, samples))
    if motion.rotation is not None:
        rows.append([*np.moveaxis(motion.rotation[:, :, [*range(free), 4]] * by_unknown, -1, 0), ones])
    if motion.position is not None:
        place = motion.position * by_unknown / target.length_scale
        pose = [1j * motion.point / target.length_scale, ones, 1j * ones, motion.arm, 1j * motion.arm]
        place = np.stack([*np.moveaxis(place, -1, 0), *pose], axis=-1)
        place = np.concatenate([place.real, place.imag], axis=1)
        if motion.rotation is None:
            matrix = place
        else:
            # unknowns: lengths and start of both; then the offset of the rotation; then the pose of the position
            turn = np.stack(rows[0], axis=-1)
            matrix = np.zeros((count, 3 * samples, place.shape[2] + 1))
            matrix[:, :samples, : free + 2] = turn
            matrix[:, samples:, : free + 1] = place[:, :, : free + 1]
            matrix[:, samples:, free + 2 :] = place[:, :, free + 1 :]
    else:
        matrix = np.stack(rows[0], axis=-1)
    if (missing := matrix.shape[2] - matrix.shape[1]) > 0:
        matrix = np.concatenate([matrix, np.zeros((count, missing, matrix.shape[2]))], axis=1)
    return np.nan_to_num(matrix / np.sqrt(samples), posinf=0.0, neginf=0.0), free
