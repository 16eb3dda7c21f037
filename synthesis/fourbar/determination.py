"""Determination of a four-bar by a motion, and limits that restrict the best four-bar within them.

Without limits the singular values of the derivatives D of the motion by the unknowns describe it: the logarithms of the lengths,
the angles, and the pose over the length scale. Within limits the displacement of the best linkage after a change of the motion
counts. It moves on the face Z of the active limits with a multiplier lambda > 0 in grad J^2 = sum lambda grad c (Nocedal and
Wright, Numerical Optimization, 12.3)::

    change = Z (Z' M Z)^-1 Z' D' (change of the motion),    M = half the Hessian of J^2 - sum lambda c

A direction that limits block is no freedom, and the misfit is no tolerance. If the crank angles were found with the linkage,
M is D' D, and each crank angle is an unknown that is eliminated; the crank angles of the first and last sample stay unknowns if
an active limit depends on them. The multipliers follow from the rows of the other unknowns, which hold even if the order of the
samples blocks a crank angle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Complexes, Floats
from synthesis.constraints import SPARE, Constraints, placed_linkages
from synthesis.four_bar import EXCESSES, close_loop, coupler_angle, grashof_excesses
from synthesis.limits import Limits
from synthesis.linkage import Linkage, as_lengths, with_links
from synthesis.target import TURN, Target

FREE = 1e3
"""Relative uncertainty of a length above which the motion does not determine it."""


@dataclass(frozen=True)
class DeterminationOptions:
    """Options of the examination of limits at an answer."""

    touched: float = 1e-5
    """Distance over the length scale up to which an answer is at a limit."""
    change_point: float = 1e-6
    """Excess over the perimeter below which the answer is at a bound of the family."""
    pushes: float = 1e-6
    """Multiplier over J squared above which a limit is active."""
    step: float = 1e-5
    """Step of the unknowns in the differences for the Hessian."""


OPTIONS = DeterminationOptions()


@dataclass(frozen=True)
class Determination:
    """Determination of a linkage by a motion, from the singular values of the motion's derivatives.

    The unknowns are the logarithms of the actual lengths, the angles, and the pose over the length scale; the motion is
    measured as in the objective. An error ``resolution`` of the motion moves the logarithm of a length by up to
    ``length_uncertainty``, to first order (Golub and Van Loan, Matrix Computations, 5.3).
    """

    condition: float
    """Largest over smallest singular value; 1e17 where the smallest vanishes."""
    length_uncertainty: Floats
    """(4,) relative; infinite where the motion does not fix a length at all. Without positions the ground is exact."""
    resolution: float
    active_limits: tuple[str, ...] = ()
    """Names of the limits without which the motion would be met better."""

    ILL_POSED = 1e-3

    @property
    def ill_posed(self) -> bool:
        """True if some length is not even determined to a thousandth at this resolution."""
        return bool(np.max(self.length_uncertainty) > self.ILL_POSED)


class _Motion:
    """Derivatives of the motions of linkages for the same target, batched over the linkages."""

    def __init__(self, target: Target, linkages: list[Linkage]) -> None:
        self.links = np.array([linkage.links for linkage in linkages])
        branch = np.array([linkage.branch for linkage in linkages])
        crank = np.array([linkage.start for linkage in linkages])[:, None] + target.crank
        closure = close_loop(self.links, crank)
        slope = closure.coupler_angle_gradient(branch)
        self.rotation = slope if target.rotation is not None else None
        """(n, N, 5): by L1 .. L4, per unit, and theta1."""
        self.position: Complexes | None = None
        """(n, N, 5), the pose held."""
        if target.position is None:
            return
        ground_angle = np.array([linkage.ground_angle for linkage in linkages])[:, None]
        coupler = np.array([[linkage.arm] for linkage in linkages])
        turned = np.exp(1j * (crank + ground_angle))
        self.arm = np.exp(1j * (closure.coupler_angle(branch) + ground_angle))
        """e^{i(theta2 + theta4)}."""
        self.point = self.links[:, :1] * turned + coupler * self.arm
        """P less A."""
        position = (1j * coupler * self.arm)[:, :, None] * slope
        position[:, :, 0] += turned
        position[:, :, 4] += 1j * self.links[:, :1] * turned
        self.position = position


def determinations(
    target: Target, linkages: list[Linkage], resolutions: list[float], fixed: Sequence[int] = ()
) -> list[Determination]:
    """Return how well the motion fixes each linkage; see `Determination`.

    Parameters
    ----------
    target : Target
    linkages : list of Linkage
    resolutions : list of float
        Error of the motion, in the objective's measure, that is considered for each.
    fixed : sequence of int
        Links with given lengths, which the motion does not have to determine.
    """
    if not linkages:
        return []
    matrix, free = derivative_matrix(target, linkages)
    matrix, lengths = np.delete(matrix, list(fixed), axis=2), [k for k in range(free) if k not in fixed]
    if not matrix.shape[2]:  # nothing is left to be fixed
        return [Determination(1.0, np.zeros(4), resolution) for resolution in resolutions]
    _, singular, vectors = np.linalg.svd(matrix, full_matrices=False)
    floor = np.finfo(float).eps * singular[:, :1] * np.sqrt(matrix.shape[1])
    inverse = 1 / np.maximum(singular, np.maximum(floor, np.finfo(float).tiny))
    share = vectors[:, :, : len(lengths)] ** 2
    uncertainty = np.zeros((len(linkages), 4))
    uncertainty[:, lengths] = np.sqrt(np.einsum("nkf,nk->nf", share, inverse**2))
    uncertainty *= np.array(resolutions)[:, None]
    # a direction without a singular value is free, and so is every length that has a part in it
    lost = np.einsum("nkf,nk->nf", share, (singular <= floor).astype(float)) > 1e-12
    uncertainty[:, lengths] = np.where(lost, np.inf, uncertainty[:, lengths])
    uncertainty[uncertainty > FREE] = np.inf
    condition = singular[:, 0] * inverse.max(axis=1)
    return [Determination(float(c), row, r) for c, row, r in zip(condition, uncertainty, resolutions)]


def derivative_matrix(
    target: Target, linkages: list[Linkage], not_eliminated: Sequence[int] = ()
) -> tuple[Floats, int]:
    """Return derivatives of the objective's residual (n, rows, unknowns), and how many first unknowns are logarithms of lengths.

    ``not_eliminated``: samples whose crank angles, if they were found, remain unknowns in the last columns.
    """
    matrix, free = _derivatives(target, linkages)
    if target.found:
        matrix = _angles_eliminated(matrix, target.samples, free, not_eliminated)
    if (missing := matrix.shape[2] - matrix.shape[1]) > 0:
        matrix = np.concatenate([matrix, np.zeros((len(linkages), missing, matrix.shape[2]))], axis=1)
    return matrix, free


def _derivatives(target: Target, linkages: list[Linkage]) -> tuple[Floats, int]:
    """Return the matrix with the crank angle as an unknown; if crank angles were found, each row has the angle of its sample."""
    motion = _Motion(target, linkages)
    count, samples = len(linkages), target.samples
    free = 3 if motion.position is None else 4
    by_unknown = np.concatenate([motion.links, np.ones((count, 1))], axis=1)[:, None, [*range(free), 4]]
    ones = np.ones((count, samples))
    turn = None
    if motion.rotation is not None:
        turn = motion.rotation[:, :, [*range(free), 4]] * by_unknown
        turn = np.concatenate([turn, ones[:, :, None]], axis=2) * np.asarray(target.rotation_mean.root)[..., None]
    if motion.position is not None:
        position_rows = motion.position * by_unknown / target.length_scale
        pose = [1j * motion.point / target.length_scale, ones, 1j * ones, motion.arm, 1j * motion.arm]
        position_rows = (
            np.stack([*np.moveaxis(position_rows, -1, 0), *pose], axis=-1)
            * np.asarray(target.position_mean.root)[..., None]
        )
        position_rows = np.concatenate([position_rows.real, position_rows.imag], axis=1)
        if turn is None:
            matrix = position_rows
        else:
            # unknowns: lengths and start of both; then the offset of the rotation; then the pose of the position
            matrix = np.zeros((count, 3 * samples, position_rows.shape[2] + 1))
            matrix[:, :samples, : free + 2] = turn
            matrix[:, samples:, : free + 1] = position_rows[:, :, : free + 1]
            matrix[:, samples:, free + 2 :] = position_rows[:, :, free + 1 :]
    else:
        assert turn is not None
        matrix = turn
    held = ([free] if target.start is not None else []) + ([free + 1] if target.offset is not None else [])
    return np.nan_to_num(np.delete(matrix, held, axis=2), posinf=0.0, neginf=0.0), free


def _angles_eliminated(matrix: Floats, samples: int, start: int, not_eliminated: Sequence[int]) -> Floats:
    """Return the matrix with crank angles that are free at each sample: their directions are projected out, sample by sample.

    The column ``start`` holds each sample's derivative by its own crank angle and is removed. The samples ``not_eliminated`` are
    not projected; their derivatives by their own crank angles are appended as columns.
    """
    rows = matrix.reshape(len(matrix), -1, samples, matrix.shape[2])
    turn = rows[..., start]
    square = np.einsum("nrk,nrk->nk", turn, turn)
    along = np.einsum("nrk,nrkc->nkc", turn, rows) / np.where(square > 0, square, 1.0)[..., None]
    along[:, list(not_eliminated)] = 0.0
    remaining = np.delete(rows - turn[..., None] * along[:, None], start, axis=3)
    own = turn[..., None] * (np.arange(samples)[:, None] == np.array(not_eliminated, dtype=int))
    return np.concatenate([remaining, own], axis=3).reshape(
        len(matrix), -1, matrix.shape[2] - 1 + len(not_eliminated)
    )


class _Rows(NamedTuple):
    slopes: Floats
    """(n, C, m): derivatives by the unknowns."""
    touched: NDArray[np.bool_]
    """(n, C)"""
    equal: NDArray[np.bool_]
    names: list[str]
    ends: Floats
    """(n, C, 2): derivatives by the first and the last crank angle of the interval, which are unknowns if these were found."""


def determinations_within(
    target: Target, linkages: list[Linkage], resolution: float, limits: Limits
) -> list[Determination]:
    """Return the determination of each of the best linkages within limits, see the module.

    ``target``: if crank angles were found, with a row of crank angles for each linkage. ``resolution``: error of the motion in
    the measure of the objective that is negligible.
    """
    return [_determination(target.one_of(k), linkage, resolution, limits) for k, linkage in enumerate(linkages)]


def _determination(target: Target, linkage: Linkage, resolution: float, limits: Limits) -> Determination:
    by_unknown, free = _derivatives(target, [linkage])
    residual = residuals(target, [linkage])[0]
    gradient = -2 * by_unknown[0].T @ residual
    if target.found:
        gradient = np.delete(gradient, free)
    rows = _limit_rows(target, [linkage], limits, free, gradient.size)
    force = _multipliers(rows, gradient)
    pushes = rows.touched[0] & (rows.equal | (force > OPTIONS.pushes * (residual @ residual)))
    names = tuple(dict.fromkeys(name for name, on in zip(rows.names, pushes) if on))
    slopes, ends = rows.slopes[0, pushes], rows.ends[0, pushes]
    end_samples = _end_samples(target) if target.found and np.any(ends) else []
    if end_samples:
        at_ends, end_samples = end_samples, sorted(set(end_samples))
        slopes = np.hstack([slopes, ends @ np.equal.outer(at_ends, end_samples)])
    derivatives = derivative_matrix(target, [linkage], end_samples)[0][0]
    unknowns = derivatives.shape[1]
    face = _null_space(slopes, unknowns)
    along = derivatives @ face
    inner = along.T @ along
    if not target.found:
        inner = _half_hessian(target, linkage, limits, free, face, np.where(pushes, force, 0.0))
    if not np.all(np.isfinite(inner)):  # so near a change point that no step leads along the limits
        return Determination(1e17, np.full(4, np.inf), resolution, names)
    uncertainty = np.zeros(4)
    values, vectors = np.linalg.eigh((inner + inner.T) / 2)
    if face.shape[1]:
        if values[0] <= 1e-12 * values[-1]:
            moves = np.abs(face @ vectors[:, values <= 1e-12 * values[-1]]).max(axis=1) > 1e-6
            uncertainty[:free] = np.where(moves[:free], np.inf, 0.0)
        else:
            change = face @ np.linalg.solve(inner, along.T)
            uncertainty[:free] = resolution * np.linalg.norm(change[:free], axis=1)
    uncertainty[uncertainty > FREE] = np.inf
    singular = np.linalg.svd(along, compute_uv=False) if face.shape[1] else np.ones(1)
    condition = float(singular[0] / max(singular[-1], singular[0] * 1e-17)) if singular[0] > 0 else 1e17
    return Determination(condition, uncertainty, resolution, names)


def residuals(target: Target, linkages: list[Linkage]) -> Floats:
    """Return the residuals of the motions in the rows of `derivative_matrix`, (n, rows)."""
    links, branch = (
        np.array([linkage.links for linkage in linkages]),
        np.array([linkage.branch for linkage in linkages]),
    )
    crank = np.array([[linkage.start] for linkage in linkages]) + target.crank
    turned = np.array([[linkage.ground_angle] for linkage in linkages])
    angle, parts = coupler_angle(links, branch, crank) + turned, []
    if target.rotation is not None:
        offset = np.array([[linkage.body_offset or 0.0] for linkage in linkages])
        gap = target.rotation - angle - offset
        gap = gap - TURN * np.round(target.rotation_mean(gap) / TURN)[:, None]
        parts.append(gap * target.rotation_mean.root)
    if target.position is not None:
        coupler = np.array([[linkage.arm] for linkage in linkages])
        pivot = np.array([[linkage.pivot_a] for linkage in linkages])
        points = pivot + links[:, :1] * np.exp(1j * (crank + turned)) + coupler * np.exp(1j * angle)
        gap = (target.position - points) / target.length_scale * target.position_mean.root
        parts += [gap.real, gap.imag]
    return np.concatenate(parts, axis=1)


def _limit_rows(target: Target, linkages: list[Linkage], limits: Limits, free: int, unknowns: int) -> _Rows:
    """All limits at linkages, then the bounds of their family."""
    placed, middle, scale = placed_linkages(target, linkages), 0j, 1.0
    links, count = placed.lengths, len(linkages)
    if target.position is not None:
        middle, scale = complex(target.position_mean(target.position)), target.length_scale
        placed = placed.over(middle, scale)
    found = Constraints(limits, middle, scale)(placed)
    slopes = found.slopes
    touched = np.where(np.array(found.names) == "envelope", OPTIONS.touched + 2 * SPARE, OPTIONS.touched)
    touched_rows = found.equal | (found.values <= touched)
    size = links.sum(axis=1)[:, None]
    excesses = np.stack(grashof_excesses(links), axis=1) / size
    edges = (np.abs(excesses) <= OPTIONS.change_point) & (limits.family != "any")
    bounds = EXCESSES * (links / size)[:, None] * np.sign(excesses)[:, :, None]
    rows = np.zeros((count, slopes.shape[1] + 3, unknowns))
    rows[:, :-3, :free] = (slopes[:, :, :4] * placed.lengths[:, None])[:, :, :free]
    rows[:, -3:, :free] = bounds[:, :, :free]
    limited, at = rows[:, :-3], free
    if not target.found:
        limited[:, :, at] = slopes[:, :, 4] + slopes[:, :, 5]
        at += 1
    if placed.turned is not None and placed.coupler is not None:
        at += target.rotation is not None
        spin, ground = (1j * placed.coupler)[:, None], np.exp(1j * placed.turned)[:, None]
        zx, zy = slopes[:, :, 9], slopes[:, :, 10]
        limited[:, :, at] = slopes[:, :, 8] + zx * spin.real + zy * spin.imag
        limited[:, :, at + 1 : at + 3] = slopes[:, :, 6:8]
        limited[:, :, at + 3] = zx * ground.real + zy * ground.imag
        limited[:, :, at + 4] = -zx * ground.imag + zy * ground.real
    equal = np.concatenate([found.equal, np.zeros(3, dtype=bool)])
    at_ends = np.concatenate([slopes[:, :, 4:6], np.zeros((count, 3, 2))], axis=1)
    return _Rows(rows, np.concatenate([touched_rows, edges], axis=1), equal, [*found.names, *["family"] * 3], at_ends)


def _end_samples(target: Target) -> list[int]:
    """Return the samples at the first and the last crank angle of the used interval, twice the first if it is closed."""
    first = int(np.argmin(np.abs(target.crank - target.interval.first)))
    last = first if target.closed else int(np.argmin(np.abs(target.crank - target.interval.last)))
    return [first, last]


def _multipliers(rows: _Rows, gradient: Floats) -> Floats:
    """Return the multipliers (C,) of the limits of a linkage: not negative for touched inequalities, 0 for untouched ones."""
    out = np.zeros(rows.touched.shape[1])
    indices = np.flatnonzero(rows.touched[0])
    while indices.size:
        force, *_ = np.linalg.lstsq(rows.slopes[0, indices].T, gradient, rcond=None)
        wrong = np.where(rows.equal[indices], 0.0, force)
        if wrong.min() >= 0:
            out[indices] = force
            break
        indices = np.delete(indices, wrong.argmin())
    return out


def _null_space(rows: Floats, unknowns: int) -> Floats:
    """An orthonormal basis of what rows (C, m) leave free, (m, m - rank)."""
    if not rows.size:
        return np.eye(unknowns)
    _, singular, vectors = np.linalg.svd(rows)
    rank = int(np.sum(singular > 1e-10 * singular[0]))
    return vectors[rank:].T


def _half_hessian(target: Target, linkage: Linkage, limits: Limits, free: int, face: Floats, force: Floats) -> Floats:
    """Z' M Z of the module's head, by central differences of half the Lagrangian's gradient along the face."""
    moved = [_moved(target, linkage, step, free) for step in OPTIONS.step * np.vstack([face.T, -face.T])]
    if not moved:
        return np.empty((0, 0))
    matrices, residual = derivative_matrix(target, moved)[0], residuals(target, moved)
    gradients = -(matrices[:, : residual.shape[1]].transpose(0, 2, 1) @ residual[:, :, None])[:, :, 0]
    if force.any():
        gradients -= 0.5 * force @ _limit_rows(target, moved, limits, free, len(face)).slopes
    size = face.shape[1]
    return ((gradients[:size] - gradients[size:]) @ face) / (2 * OPTIONS.step)


def _moved(target: Target, linkage: Linkage, step: Floats, free: int) -> Linkage:
    links = np.array(linkage.links)
    links[:free] *= np.exp(step[:free])
    changed: dict[str, Any] = {"start": linkage.start + step[free]}
    at = free + 1
    if target.rotation is not None:
        changed["body_offset"] = (linkage.body_offset or 0.0) + step[at]
        at += 1
    if target.position is not None:
        turn, x, y, zx, zy = step[at:]
        coupler = linkage.arm + target.length_scale * (zx + 1j * zy)
        # the offset of the rotation and the turn of the pose are unknowns of their own
        if target.rotation is not None:
            changed["body_offset"] -= turn
        changed["ground_angle"] = linkage.ground_angle + turn
        changed["pivot_a"] = linkage.pivot_a + target.length_scale * (x + 1j * y)
        changed["coupler_point_polar"] = (abs(coupler), float(np.angle(coupler)))
    return replace(with_links(linkage, as_lengths(links)), **changed)
