"""Finished linkages with their errors: what every kind of search ends in, recomputed from the linkage's own numbers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.arrays import Floats
from synthesis.four_bar import (
    FULL_CRANK,
    Family,
    close_loop,
    family,
    principal,
    transmission_angle_over,
    wrap,
)
from synthesis.fourbar.joints import body_point
from synthesis.fourbar.limits import Constraints, Limits, in_family
from synthesis.linkage import Linkage, four_bar
from synthesis.mechanism import Placed
from synthesis.pose import DEGENERATE, fit_positions
from synthesis.ranking import Errors, motion_errors
from synthesis.target import TURN, Interval, Samples, Target

_KEPT = 1e-12
"""To which, over the largest number involved, an answer must keep a given length or place."""
ALIKE = 0.02
"""Part by which lengths of linkages that look alike in a picture differ at most."""


@dataclass(frozen=True)
class Solution:
    """A linkage that answers a request.

    Attributes
    ----------
    errors : Errors
        Recomputed from the linkage's numbers: its motion is compared with the request.
    transmission_angle_min : float
        Over the used interval, exactly; 0 where it does not close between samples.
    transmission_angle_min_turn : float or None
        Over the whole turn; None where the crank does not turn fully.
    row : int or None
        Atlas row, for solutions that are a row as it is.
    crank : ndarray, shape (N,), or None
        Crank angles at the samples from the first one, where they were found with the linkage; None where they were given.
    """

    linkage: Linkage
    errors: Errors
    family: Family
    transmission_angle_min: float
    transmission_angle_min_turn: float | None
    row: int | None = None
    crank: Floats | None = None

    @property
    def identity(self) -> Floats:
        """Numbers, relative to the linkage's size, that tell linkages apart; the start does not count."""
        one = self.linkage
        size = max(one.links)
        numbers: list[float] = [*(np.array(one.links) / size), one.branch]
        if one.coupler_point is not None:
            radius, angle = one.coupler_point
            coupler = radius / size * np.exp(1j * angle)
            ground = np.exp(1j * one.ground_angle)
            place = one.pivot_a / size
            numbers += [np.log(size), ground.real, ground.imag, coupler.real, coupler.imag, place.real, place.imag]
        return np.array(numbers)

    @property
    def looks(self) -> Floats:
        """Numbers of which two linkages that look alike in a picture differ by less than one; see `looks_of`."""
        return looks_of(self.linkage, self.family)

    def mirrored(self) -> Solution:
        """The linkage in a mirror, for the mirrored target; its errors are the same."""
        return replace(self, linkage=self.linkage.mirrored(), crank=None if self.crank is None else -self.crank)


def looks_of(linkage: Linkage, family: Family) -> Floats:
    """Logarithms of the lengths over that of 1 + `ALIKE`, the branch and the family, (6,).

    Law: they differ by less than one exactly where branch and family are the same and all lengths agree to within `ALIKE`.
    """
    return np.array([*(np.log(linkage.links) / np.log1p(ALIKE)), linkage.branch, list(Family).index(family)])


def mounted(target: Target, lengths: ArrayLike, branch: ArrayLike, start: ArrayLike) -> list[Linkage]:
    """The linkages that candidates are, in their best pose and with actual lengths.

    ``lengths`` (n, 4): any scale; each closes at every sample. ``branch``, ``start`` (n,): theta1 at the first sample,
    in radians.

    Without positions not mounted, with a ground of 1.
    """
    lengths, branch = np.asarray(lengths, dtype=float), np.asarray(branch)
    start = np.asarray(start) % TURN
    if not start.size:
        return []
    if target.position is None:
        links = lengths / lengths[:, 3:]
        return [four_bar(four(row), int(b), float(s)) for row, b, s in zip(links, branch, start)]
    fit = fit_positions(target, close_loop(lengths, start[:, None] + target.crank).coupler_angle(branch))
    linkages = []
    for k, at in enumerate(start):
        scale = float(abs(fit.crank_vector[k]) / lengths[k, 0])
        turn = wrap(np.angle(fit.crank_vector[k]) - at)
        coupler = fit.coupler_vector[k]
        point = float(abs(coupler)), wrap(np.angle(coupler) - turn)
        linkages.append(
            four_bar(four(lengths[k] * scale), int(branch[k]), float(at), complex(fit.pivot[k]), turn, point)
        )
    return linkages


def four(lengths: Iterable[float]) -> tuple[float, float, float, float]:
    """A row of lengths as plain numbers."""
    crank, coupler, rocker, ground = (float(value) for value in lengths)
    return crank, coupler, rocker, ground


def how_they_turn(links: Floats, used: Interval) -> list[tuple[Family, float, float | None]]:
    """Of each linkage (n, 4) the family, and the smallest transmission angle over the used interval and over the whole turn.

    The first is 0 where the linkage does not close over its interval of theta1, the second None where its crank does not turn.
    """
    first, last = (
        np.stack([np.broadcast_to(end, len(links)), np.full(len(links), whole)])
        for end, whole in zip(used, (0.0, np.pi))
    )
    smallest, turn = transmission_angle_over(links, Interval(first, last))
    families = [Family(one) for one in family(links)]
    return [
        (one, least, least_turn if one in FULL_CRANK else None)
        for one, least, least_turn in zip(families, np.nan_to_num(smallest).tolist(), turn.tolist())
    ]


def assess(target: Target, linkages: list[Linkage], rows: list[int] | None = None) -> list[Solution]:
    """Linkages with their errors: the best offset of the rotation, and all else recomputed from their own numbers.

    ``linkages``: mounted where the target has positions; each closes at every sample. ``rows``: atlas rows that they
    are.
    """
    if not linkages:
        return []
    links = np.array([one.links for one in linkages])
    start = np.array([one.start for one in linkages])
    crank = start[:, None] + target.crank
    angle = principal(close_loop(links, crank).coupler_angle(np.array([one.branch for one in linkages])))
    turning = how_they_turn(links, target.interval.after(start))
    points = None
    if target.position is not None:
        points = np.stack([body_point(one, crank[k], angle[k]) for k, one in enumerate(linkages)])
    offsets, errors = motion_errors(target, angle, points)
    solutions = []
    for k, one in enumerate(linkages):
        offset = offsets[k]
        solutions.append(
            Solution(
                replace(one, body_offset=None if offset is None else offset - one.ground_angle),
                errors[k],
                *turning[k],
                None if rows is None else rows[k],
            )
        )
    return solutions


def keeps(target: Samples, limits: Limits, placed: Placed, rounding: float = 0.0) -> NDArray[np.bool_]:
    """Which linkages, placed in the user's unit, keep limits, (n,).

    ``target``: whose mean position and length scale the constraints are measured in. ``rounding``: part of the longest
    length by which a limit may be broken.
    """
    if limits.family == "any":
        holds = transmission_angle_over(placed.lengths, placed.used) > 0
    else:
        holds = in_family(limits.family, placed.lengths)
    if limits.only_family:
        return holds
    middle, scale = 0j, 1.0
    if placed.pivot is not None:
        assert target.position is not None
        middle, scale = complex(target.position_mean(target.position)), target.length_scale
        placed = placed.over(middle, scale)
    found = Constraints(limits, middle, scale)(placed)
    size = np.maximum(placed.lengths.max(axis=1, keepdims=True), 1 + abs(middle) / scale)
    inside = np.where(found.equal, np.abs(found.values) <= _KEPT * size, found.values >= -rounding * size)
    if placed.pivot is not None:  # a linkage shrunk to a point keeps many limits, and is no answer
        inside = inside & (placed.lengths[:, :1] * scale > DEGENERATE * target.extent)
    return holds & np.all(inside, axis=1)


def placed_linkages(target: Target, linkages: Sequence[Linkage]) -> Placed:
    """Linkages as the limits see them, in the user's unit."""
    found = Placed(
        np.array([one.links for one in linkages]),
        np.array([float(one.branch) for one in linkages]),
        target.interval.after(np.array([one.start for one in linkages])),
    )
    if target.position is None:
        return found
    turned = np.array([one.ground_angle for one in linkages])
    points = np.array([one.coupler_point for one in linkages])
    coupler = points[:, 0] * np.exp(1j * (points[:, 1] + turned))
    return found._replace(pivot=np.array([one.pivot_a for one in linkages]), turned=turned, coupler=coupler)


def within(target: Target, limits: Limits, solutions: list[Solution]) -> list[Solution]:
    """The solutions that keep limits, checked on their own numbers."""
    if not solutions:
        return []
    kept = keeps(target, limits, placed_linkages(target, [one.linkage for one in solutions]))
    kept &= np.isfinite([one.errors.objective for one in solutions])
    return [one for one, keep in zip(solutions, kept) if keep]
