"""A linkage with its errors, recomputed from its own numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from synthesis.arrays import Flags, Floats
from synthesis.four_bar import Family
from synthesis.guides import Circle, Rail
from synthesis.linkage import Linkage
from synthesis.linkages import body_motions, transmission_angles_over, turn_fully
from synthesis.poses import Poses
from synthesis.ranking import Errors, motion_errors
from synthesis.target import TURN, Interval, Target

ALIKE = 0.02
"""Largest relative difference of the lengths of linkages that look alike in a picture."""


@dataclass(frozen=True)
class Solution:
    """Linkage that answers a request.

    Attributes
    ----------
    linkage : Linkage
        It starts at the first sample.
    errors : Errors
        Errors of its motion, recomputed from its own numbers.
    travel : ndarray, shape (N,)
        Travel of its drive from the first sample, at all samples of the request.
    interval : Interval
        Travel that the motion uses; a whole turn if the motion is closed.
    transmission_angle_min : float
        Smallest transmission angle over the interval, exactly; 0 if the loop does not close between samples.
    transmission_angle_min_turn : float or None
        The same over a whole turn; None if the drive does not turn fully.
    row : int or None
        Row of the atlas, for a row as it is.
    """

    linkage: Linkage
    errors: Errors
    travel: Floats
    interval: Interval
    transmission_angle_min: float
    transmission_angle_min_turn: float | None
    row: int | None = None

    @cached_property
    def identity(self) -> Floats:
        """Numbers, relative to its size, that distinguish the linkage from others of its kind and drive.

        The start does not count.
        """
        return identity_of(self.linkage)

    @cached_property
    def looks(self) -> Floats:
        """Numbers that differ by less than 1 if two linkages look alike in a picture."""
        return looks_of(self.linkage)

    def mirrored(self) -> Solution:
        """Return the linkage in a mirror, for the mirrored request; its errors are the same."""
        mirrored = replace(self, linkage=self.linkage.mirrored())
        if not self.linkage.driver.turns:
            return mirrored
        return replace(mirrored, travel=-self.travel, interval=Interval(-self.interval.last, -self.interval.first))


def identity_of(linkage: Linkage) -> Floats:
    """Return numbers, relative to its size, that distinguish a linkage from others of its kind and drive, for any start."""
    return _four_bar_identity(linkage) if linkage.is_four_bar else _identity(linkage)


def looks_of(linkage: Linkage) -> Floats:
    """Return numbers that differ by less than 1 for linkages whose pictures look alike.

    For a four-bar they are the logarithms of its lengths to the base 1 + `ALIKE`, its branch and its family, so that they differ
    by less than 1 exactly if branch and family are the same and all lengths agree to within `ALIKE`.
    """
    if linkage.family is None:
        return identity_of(linkage) / ALIKE
    return np.array([*(np.log(linkage.links) / np.log1p(ALIKE)), linkage.branch, list(Family).index(linkage.family)])


def _four_bar_identity(linkage: Linkage) -> Floats:
    size = max(linkage.links)
    numbers: list[float] = [*(np.array(linkage.links) / size), linkage.branch]
    if linkage.mounted:
        coupler, ground, pivot = linkage.arm / size, np.exp(1j * linkage.ground_angle), linkage.pivot_a / size
        numbers += [np.log(size), ground.real, ground.imag, coupler.real, coupler.imag, pivot.real, pivot.imag]
    return np.array(numbers)


def _identity(linkage: Linkage) -> Floats:
    numbers: list[float] = [linkage.branch]
    radii = [guide.radius for guide in linkage.guides if isinstance(guide, Circle)]
    size = max(abs(guide.body_point) for guide in linkage.guides) + sum(radii)
    size = size if size > 0 else 1.0
    for guide in linkage.guides:
        body, fixed = guide.body_point / size, guide[0] / size
        if isinstance(guide, Circle):
            numbers += [guide.radius / size, fixed.real, fixed.imag, body.real, body.imag]
            continue
        # the line itself, not the point that it is given by
        direction, point, second_point = (
            (guide.direction, fixed, body) if isinstance(guide, Rail) else (guide.body_direction, body, fixed)
        )
        height = np.real(np.conj(1j * np.exp(1j * direction)) * point)
        numbers += [np.cos(2 * direction), np.sin(2 * direction), abs(height), second_point.real, second_point.imag]
    return np.array([*numbers, math.log(size)])


def target_of(samples: Poses | Target, linkage: Linkage, travel: Floats) -> Target:
    """Return the motion with the travel of a drive as its crank angles; each rotation by whole turns nearest to the body's.

    The motion is closed only if the drive turns fully.
    """
    target = targets_of(samples, [linkage], travel[None]).one_of(0)
    return replace(target, closed=target.closed and linkage.turns_fully) if target.closed else target


def targets_of(samples: Poses | Target, linkages: Sequence[Linkage], travel: Floats) -> Target:
    """Return the motion with the travel (n, N) of the drives of several linkages."""
    if isinstance(samples, Target):
        return samples
    rotation = None if samples.rotation is None else body_motions(linkages, travel).rotation
    return samples.timed(travel, rotation)


def assess(
    samples: Poses | Target,
    linkages: Sequence[Linkage],
    travel: ArrayLike | None = None,
    *,
    rows: Sequence[int] | None = None,
) -> list[Solution]:
    """Build the solutions of linkages: turn each body by the best offset, and recompute its errors from its own numbers.

    Parameters
    ----------
    samples : Poses or Target
    linkages : sequence of Linkage
        Mounted if the motion has positions; each closes at every sample.
    travel : array_like, shape (n, N) or (N,), optional
        Travel of each drive from its start at all samples of the request; default: the crank angles of a `Target`.
        The linkage of a solution starts at the first sample.
    rows : sequence of int, optional
        Rows of the atlas that the linkages are.
    """
    if not linkages:
        return []
    if travel is None:
        assert isinstance(samples, Target)
        travel = samples.crank
    own = np.atleast_2d(np.asarray(travel, dtype=float))
    own = np.broadcast_to(own, (len(linkages), own.shape[1]))
    begin = own[:, 0]
    if begin.any():
        linkages = [replace(linkage, start=linkage.start + first) for linkage, first in zip(linkages, begin.tolist())]
        own = own - begin[:, None]
    motions = body_motions(linkages, own)
    target = samples if isinstance(samples, Target) else samples.timed(own, motions.rotation)
    position = None if target.position is None else motions.position
    offsets, errors = motion_errors(target, motions.rotation, position)
    turns = turn_fully(linkages)
    used = _used(own, turns & target.closed)
    smallest = np.nan_to_num(transmission_angles_over(linkages, used)).tolist()
    turning = np.flatnonzero(turns).tolist()
    full_turn = Interval(np.zeros(len(turning)), np.full(len(turning), TURN))
    over_turn = dict(zip(turning, transmission_angles_over([linkages[k] for k in turning], full_turn).tolist()))
    return [
        Solution(
            linkage if offset is None or not math.isfinite(offset) else linkage.turned_body(offset),
            errors[k],
            own[k].copy(),
            Interval(float(used.first[k]), float(used.last[k])),
            smallest[k],
            over_turn.get(k),
            None if rows is None else rows[k],
        )
        for k, (linkage, offset) in enumerate(zip(linkages, offsets))
    ]


def _used(travel: Floats, closed: Flags) -> Interval:
    """Return the travel that n motions use, with ends of shape (n,): whole turns if they are closed."""
    low, high = travel.min(axis=1), travel.max(axis=1)
    falls = travel[:, 0] >= high
    return Interval(
        np.where(closed & falls, high, low), np.where(closed, np.where(falls, high - TURN, low + TURN), high)
    )
