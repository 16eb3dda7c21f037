"""How well a motion fixes the best linkage within limits, and which limits hold it.

What counts is how far that linkage moves when the motion does. It moves on the face Z of the limits that push, those with a
multiplier lambda > 0 in grad J^2 = sum lambda grad c (Nocedal and Wright, Numerical Optimization, 12.3)::

    change = Z (Z' M Z)^-1 Z' D' (change of the motion),    M = half the Hessian of J^2 - sum lambda c

with D the derivatives of the motion by the unknowns of `determination`. A direction that limits block is no freedom, and the
misfit is no tolerance. Where the crank angles were found with the linkage, M is D' D, and limits that depend on the first or
last crank angle count as not pushing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.determination import FREE, Determination, derivative_matrix
from synthesis.fourbar.kinematics import EXCESSES, coupler_angle, grashof_excesses
from synthesis.fourbar.limits import Constraints, Limits
from synthesis.fourbar.linkage import Linkage
from synthesis.fourbar.solution import four
from synthesis.fourbar.within import placed_linkages
from synthesis.target import Target

Floats = NDArray[np.float64]

_TOUCHED = 1e-5
"""A limit is touched where it is kept by less, over the length scale."""
_CHANGE_POINT = 1e-6
"""An excess of so small a part of the perimeter is a bound of the family."""
_PUSHES = 1e-6
"""Multiplier, over J squared, from which on a limit pushes."""
_STEP = 1e-5


class _Rows(NamedTuple):
    """The limits at linkages, and the bounds of their family."""

    slopes: Floats
    """(n, C, m): derivatives by the unknowns."""
    touched: NDArray[np.bool_]
    """(n, C)"""
    equal: NDArray[np.bool_]
    names: list[str]


def determinations_within(
    target: Target, linkages: list[Linkage], resolution: float, limits: Limits
) -> list[Determination]:
    """How well a motion fixes each of the best linkages within limits; see the module's head.

    Parameters
    ----------
    target : Target
        With one row of crank angles a linkage where they were found.
    linkages : list of Linkage
    resolution : float
        Error of the motion, in the objective's measure, that counts as none.
    limits : Limits
    """
    return [_determination(_one_of(target, k), linkage, resolution, limits) for k, linkage in enumerate(linkages)]


def _one_of(target: Target, place: int) -> Target:
    """The target of one linkage."""
    if not target.found or target.crank.ndim == 1:
        return target
    rotation = None if target.rotation is None else target.rotation[place]
    return replace(target, crank=target.crank[place], rotation=rotation)


def _determination(target: Target, linkage: Linkage, resolution: float, limits: Limits) -> Determination:
    matrix, free = derivative_matrix(target, [linkage])
    derivatives, rest = matrix[0], _residuals(target, [linkage])[0]
    count, unknowns = derivatives.shape[0], derivatives.shape[1]
    rest = np.concatenate([rest, np.zeros(count - rest.size)])
    rows = _limit_rows(target, [linkage], limits, free, unknowns)
    force = _multipliers(rows, -2 * derivatives.T @ rest)
    pushes = rows.touched[0] & (rows.equal | (force > _PUSHES * (rest @ rest)))
    names = tuple(dict.fromkeys(name for name, on in zip(rows.names, pushes) if on))
    face = _null_space(rows.slopes[0, pushes], unknowns)
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


def _residuals(target: Target, linkages: list[Linkage]) -> Floats:
    """What the motions lack, in the rows of `determination.derivative_matrix`, (n, rows)."""
    links, branch = np.array([one.links for one in linkages]), np.array([one.branch for one in linkages])
    crank = np.array([[one.start] for one in linkages]) + target.crank
    turned = np.array([[one.ground_angle] for one in linkages])
    angle, parts = coupler_angle(links, branch, crank) + turned, []
    if target.rotation is not None:
        offset = np.array([[one.body_offset or 0.0] for one in linkages])
        parts.append((target.rotation - angle - offset) * target.rotation_mean.root)
    if target.position is not None:
        coupler = np.array([[_coupler(one)] for one in linkages])
        pivot = np.array([[one.pivot_a] for one in linkages])
        points = pivot + links[:, :1] * np.exp(1j * (crank + turned)) + coupler * np.exp(1j * angle)
        gap = (target.position - points) / target.length_scale * target.position_mean.root
        parts += [gap.real, gap.imag]
    return np.concatenate(parts, axis=1)


def _coupler(linkage: Linkage) -> complex:
    """The body point from the crank pin, in the coupler's frame."""
    assert linkage.coupler_point is not None
    radius, angle = linkage.coupler_point
    return complex(radius * np.exp(1j * angle))


def _limit_rows(target: Target, linkages: list[Linkage], limits: Limits, free: int, unknowns: int) -> _Rows:
    """All limits at linkages, then the bounds of their family."""
    placed, middle, scale = placed_linkages(target, linkages), 0j, 1.0
    links, count = placed.lengths, len(linkages)
    if target.position is not None:
        middle, scale = complex(target.position_mean(target.position)), target.length_scale
        placed = placed.over(middle, scale)
    found = Constraints(limits, middle, scale)(placed)
    slopes = found.slopes
    near = found.equal | (found.values <= _TOUCHED)
    if target.found:
        near &= ~np.any(slopes[:, :, 4:6] != 0, axis=2)
    size = links.sum(axis=1)[:, None]
    excesses = np.stack(grashof_excesses(links), axis=1) / size
    edges = (np.abs(excesses) <= _CHANGE_POINT) & (limits.family != "any")
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
    return _Rows(rows, np.concatenate([near, edges], axis=1), equal, [*found.names, *["family"] * 3])


def _multipliers(rows: _Rows, gradient: Floats) -> Floats:
    """Multipliers of the limits of one linkage, those of touched inequalities at least 0, of untouched ones 0, (C,)."""
    out = np.zeros(rows.touched.shape[1])
    places = np.flatnonzero(rows.touched[0])
    while places.size:
        force, *_ = np.linalg.lstsq(rows.slopes[0, places].T, gradient, rcond=None)
        wrong = np.where(rows.equal[places], 0.0, force)
        if wrong.min() >= 0:
            out[places] = force
            break
        places = np.delete(places, wrong.argmin())
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
    moved = [_moved(target, linkage, step, free) for step in _STEP * np.vstack([face.T, -face.T])]
    if not moved:
        return np.empty((0, 0))
    matrices, rest = derivative_matrix(target, moved)[0], _residuals(target, moved)
    gradients = -(matrices[:, : rest.shape[1]].transpose(0, 2, 1) @ rest[:, :, None])[:, :, 0]
    if force.any():
        gradients -= 0.5 * force @ _limit_rows(target, moved, limits, free, len(face)).slopes
    size = face.shape[1]
    return ((gradients[:size] - gradients[size:]) @ face) / (2 * _STEP)


def _moved(target: Target, linkage: Linkage, step: Floats, free: int) -> Linkage:
    """A linkage after a step of the unknowns."""
    links = np.array(linkage.links)
    links[:free] *= np.exp(step[:free])
    changed: dict[str, Any] = {"links": four(links), "start": linkage.start + step[free]}
    at = free + 1
    if target.rotation is not None:
        changed["body_offset"] = (linkage.body_offset or 0.0) + step[at]
        at += 1
    if target.position is not None:
        turn, x, y, zx, zy = step[at:]
        coupler = _coupler(linkage) + target.length_scale * (zx + 1j * zy)
        # the offset of the rotation and the turn of the pose are unknowns of their own
        if target.rotation is not None:
            changed["body_offset"] -= turn
        changed["ground_angle"] = linkage.ground_angle + turn
        changed["pivot_a"] = linkage.pivot_a + target.length_scale * (x + 1j * y)
        changed["coupler_point"] = (abs(coupler), float(np.angle(coupler)))
    return replace(linkage, **changed)
