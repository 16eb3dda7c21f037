"""Crank angles of samples that only have a position, or only a rotation: where along a known four-bar's motion they lie.

With the crank angles of some samples known, each other sample is put where the body comes nearest to it, all in the order of the
request: dynamic programming over a grid of crank angles once round the turn (the best cost of a sample at an angle is its own
plus the least of its predecessor's at or before that angle).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.free.joint import JointProblem, Timed
from synthesis.target import TURN

Floats = NDArray[np.float64]

_GRID = 120
_ANCHOR = 1e4
"""Weight of the squared distance from a known crank angle: more than any error of a sample."""
_LEAST_GAP = 1e-4
_AT_ONCE = 1 << 19
"""Candidates times samples times angles of the grid that are looked at together: 4 MB."""


class Aligned(NamedTuple):
    """Candidates with a crank angle at every sample, and their approximate J squared, (n,)."""

    timed: Timed
    cost: Floats


def aligned(problem: JointProblem, timed: Timed, known: NDArray[np.intp]) -> Aligned:
    """Candidates whose angles at the samples ``known`` (k,) are given, with angles at all samples of the problem.

    Parameters
    ----------
    problem : JointProblem
        Of all samples.
    timed : Timed
        With angles (n, k): where the order is required they rise or fall.
    known : ndarray of int, shape (k,)
        The samples that they belong to, rising.
    """
    count, few = len(timed.branch), max(1, _AT_ONCE // (problem.poses.samples * _GRID))
    parts = [_aligned(problem, timed.take(slice(k, k + few)), known) for k in range(0, max(count, 1), few)]
    return Aligned(
        parts[0].timed.joined(*(part.timed for part in parts[1:])), np.concatenate([p.cost for p in parts])
    )


def _aligned(problem: JointProblem, timed: Timed, known: NDArray[np.intp]) -> Aligned:
    way = np.where(timed.angles[:, -1] >= timed.angles[:, 0], 1.0, -1.0)[:, None]
    along = way * (timed.angles - timed.angles[:, :1])
    grid = np.arange(_GRID) * (TURN / _GRID)
    at = timed._replace(angles=timed.angles[:, :1] + way * grid)
    costs = squared_errors(problem, at)
    samples = problem.poses.samples
    if not problem.poses.ordered:
        place = costs.argmin(axis=2)
        angles = timed.angles[:, :1] + way * grid[place]
        angles[:, known] = timed.angles
        least = np.take_along_axis(costs, place[:, :, None], 2)[:, :, 0]
        least[:, known] = 0.0
        return Aligned(timed._replace(angles=angles), least.sum(axis=1))
    # once round the ring of samples, from the first known one on; its samples before that come after a whole turn
    ring = np.roll(np.arange(samples), -known[0])
    reach = np.empty((len(way), samples), dtype=float)
    reach.fill(np.nan)
    reach[:, known] = along
    steps, best = [], np.zeros((len(way), _GRID))
    best[:, 1:] = np.inf
    for sample in ring[1:]:
        lowest, where = _running_minimum(best)
        anchored = np.isfinite(reach[0, sample])
        own = _ANCHOR * (grid - reach[:, sample, None]) ** 2 if anchored else costs[:, sample]
        best = lowest + own
        steps.append(where)
    place = best.argmin(axis=1)
    least = np.take_along_axis(best, place[:, None], 1)[:, 0]
    turned = np.zeros((len(way), samples))
    for sample, where in zip(ring[:0:-1], reversed(steps)):
        turned[:, sample] = grid[place]
        place = np.take_along_axis(where, place[:, None], 1)[:, 0]
    turned[:, known] = along
    # apart, and the samples before the first known one a turn back
    order = np.maximum.accumulate(turned[:, ring] - _LEAST_GAP * np.arange(samples), axis=1)
    turned[:, ring] = order + _LEAST_GAP * np.arange(samples)
    turned[:, : known[0]] -= TURN
    off = np.sum(_ANCHOR * (turned[:, known] - along) ** 2, axis=1)
    return Aligned(timed._replace(angles=timed.angles[:, :1] + way * turned), least + off)


def squared_errors(problem: JointProblem, at: Timed) -> Floats:
    """Squared errors of every sample at every angle of the grid, (n, N, grid)."""
    crank, body = problem.turned(at, derivatives=False)
    total = np.zeros((len(at.branch), problem.poses.samples, at.angles.shape[1]))
    if problem.has_rotation:
        assert problem.rotation is not None
        gap = problem.rotation[:, None] - (at.offset[:, None] + body.angle)[:, None, :]
        gap -= TURN * np.round(gap / TURN)
        total += (problem.rotation_root[:, None] * gap) ** 2
    if problem.has_position:
        a, z1, z2 = at.pose.T[:, :, None]
        point = a + z1 * crank + z2 * body.phasor
        gap = problem.position[:, None] - point[:, None, :]
        total += problem.position_root[:, None] ** 2 * (gap.real**2 + gap.imag**2)
    return total


def _running_minimum(values: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """The least value up to each place of the last axis, and where it stands."""
    lowest = np.minimum.accumulate(values, axis=1)
    new = np.concatenate([np.ones((len(values), 1), dtype=bool), lowest[:, 1:] < lowest[:, :-1]], axis=1)
    where = np.maximum.accumulate(np.where(new, np.arange(values.shape[1]), 0), axis=1)
    return lowest, where
