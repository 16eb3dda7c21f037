"""A finished linkage with its pose, its errors and how well it is determined: what every kind of search ends in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar import (
    FULL_CRANK,
    TURN,
    Family,
    close_loop,
    family,
    transmission_angle_over,
)
from synthesis.mounting import Mount, fit_positions, mount, rotation_residual, wrap
from synthesis.target import Target

Floats = NDArray[np.float64]

SAME = 1e-6
"""Linkages whose numbers agree to this, relative to their size, are the same linkage."""


@dataclass(frozen=True)
class Errors:
    """Errors of a motion at the samples: angles in radians, positions in the user's unit; None for what was not asked."""

    rotation_rms: float | None
    rotation_max: float | None
    position_rms: float | None
    position_max: float | None
    objective: float


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
        rotation = theta2 + theta4 + body_offset, theta4 being 0 without positions.
    mount : Mount or None
        Its scale is 1: ``links`` are actual.
    errors : Errors
        Recomputed from the numbers above, by the path that a user would go.
    family : Family
    transmission_angle_min : float
        Over the used interval, exactly.
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
        """Numbers, relative to the linkage's size, that tell linkages apart; `same` compares them."""
        size = float(self.links.max())
        numbers = [*(self.links / size), self.branch]
        if self.mount is not None:
            m = self.mount
            coupler = m.coupler_radius / size * np.exp(1j * m.coupler_angle)
            ground = np.exp(1j * m.ground_angle)
            place = m.pivot_a / size
            numbers += [np.log(size), ground.real, ground.imag, coupler.real, coupler.imag, place.real, place.imag]
        return np.array(numbers)

    def same(self, other: Solution) -> bool:
        """Whether two solutions are the same linkage, mounted alike, to within `SAME`; the start does not count."""
        mine, theirs = self.identity, other.identity
        return bool(np.all(np.abs(mine - theirs) <= SAME * np.maximum(1.0, np.abs(mine))))


def make_solution(target: Target, lengths: Floats, branch: int, start: float, row: int | None = None) -> Solution:
    """The solution that a candidate is: best offset and pose, actual lengths, errors.

    Parameters
    ----------
    target : Target
    lengths : ndarray, shape (4,)
        Any scale; closes at every sample.
    branch : int
    start : float
        theta1 at the first sample, radians.
    row : int, optional

    Returns
    -------
    Solution
    """
    start = float(start % TURN)
    crank = start + target.crank
    if target.position is None:
        return finish_solution(target, lengths / lengths[3], branch, start, None, row)
    fit = fit_positions(target, close_loop(lengths, crank).coupler_angle(branch)[None, :])
    pose = mount(lengths, start, fit.pivot[0], fit.crank_vector[0], fit.coupler_vector[0])
    links = lengths * pose.scale
    pose = Mount(1.0, pose.ground_angle, pose.pivot_a, pose.pivot_b, pose.coupler_radius, pose.coupler_angle)
    return finish_solution(target, links, branch, start, pose, row)


def finish_solution(
    target: Target, links: Floats, branch: int, start: float, pose: Mount | None, row: int | None = None
) -> Solution:
    """A solution from actual links and a given pose: the offset, the errors and the rest follow."""
    crank = start + target.crank
    closure = close_loop(links, crank)
    angle = principal(closure.coupler_angle(branch))
    ground_angle = pose.ground_angle if pose is not None else 0.0
    body_offset = rotation_rms = rotation_max = position_rms = position_max = None
    total = 0.0
    if target.rotation is not None:
        offset, residual = rotation_residual(target, angle[None, :])
        body_offset = float(offset[0]) - ground_angle
        rotation_rms, rotation_max = _rms_and_max(residual[0])
        total += rotation_rms**2
    if pose is not None and target.position is not None:
        gap = target.position - pose.body_point(links, crank, angle)
        position_rms, position_max = _rms_and_max(gap)
        total += (position_rms / target.length_scale) ** 2
    kind = family(links)[()]
    over_turn = float(transmission_angle_over(links, 0.0, np.pi)) if kind in FULL_CRANK else None
    return Solution(
        links,
        int(branch),
        start,
        body_offset,
        pose,
        Errors(rotation_rms, rotation_max, position_rms, position_max, float(np.sqrt(total))),
        Family(kind),
        float(transmission_angle_over(links, start, start + target.span)),
        over_turn,
        row,
    )


def _rms_and_max(values: NDArray[np.generic]) -> tuple[float, float]:
    size = np.abs(values)
    largest = float(size.max())
    if largest == 0.0:
        return 0.0, 0.0
    return largest * float(np.sqrt(np.mean((size / largest) ** 2))), largest


def principal(angle: Floats) -> Floats:
    """A continuous curve of angles, moved by whole turns so that its first sample lies in (-pi, pi]."""
    return angle - TURN * np.round((angle[0] - wrap(angle[0])) / TURN)


def distinct(solutions: list[Solution], top: int) -> list[Solution]:
    """The best ``top`` that differ from one another, by objective; ties keep their order."""
    kept: list[Solution] = []
    for solution in sorted(solutions, key=lambda s: s.errors.objective):
        if len(kept) == top:
            break
        if not any(solution.same(other) for other in kept):
            kept.append(solution)
    return kept
