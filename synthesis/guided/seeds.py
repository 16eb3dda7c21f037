"""Seeds of the search for linkages of two guides: drives, guides that fit the poses, and their pairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Floats, Ints
from synthesis.free.dyads import (
    FARTHEST,
    FEW,
    Body,
    circles,
    distinct_dyads,
    landscape,
    linear_dyads,
    polished,
    sampled_dyads,
)
from synthesis.guided.pairs import Guides, Motion, Pairs, Straight, as_circles, lines_of
from synthesis.guides import DRIVERS, GUIDES, Circle, Driver, Kind, Rail, Slot


@dataclass(frozen=True)
class GuideSeedOptions:
    """Options of the guides that a search starts from."""

    exact: float = 1e-6
    """Rms distance over the length scale below which a guide may belong to an exact pair."""
    directions: int = 24
    """Number of directions of further rails and slots: a guide that fits worse may be better in a pair."""
    direction_step: int = 3
    """Only each such direction is used if all directions fit equally well."""
    fine_directions: int = 1440
    """Number of directions that are compared with a prescribed travel."""
    timely_directions: int = 4
    """Number of directions that fit a prescribed travel best."""
    radii: tuple[float, ...] = (0.35, 0.8, 1.4, 2.2, 3.5)
    """Distances of starting points from the middle of the motion, over the length scale."""
    around: int = 12
    """Number of starting points at each distance."""
    sampled_dyads: int = 90
    """Number of dyads for few poses."""
    best_dyads: int = 24
    """Number of dyads in the landscape of errors that are used."""
    seed: int = 20
    """Seed of the random numbers."""

    @property
    def normals(self) -> Floats:
        """All directions."""
        return np.linspace(0.0, np.pi, self.directions, endpoint=False)


OPTIONS = GuideSeedOptions()


class Drive(NamedTuple):
    """A kind of linkage, its guides with the driven guide first, and its driver."""

    kind: Kind
    first: Any
    second: Any
    driver: Driver


def drives(kinds: Sequence[Kind], driver: Driver | None) -> list[Drive]:
    """Return all drives of linkages of some kinds, or only by a single driver."""
    found = []
    for kind in kinds:
        pair = GUIDES[kind]
        for first, second in dict.fromkeys((pair, pair[::-1])):
            found += [Drive(kind, first, second, by) for by in DRIVERS[first] if driver in (None, by)]
    return found


Sorts = dict[Any, Guides]
"""Guides of each type, the best first."""


def exact_guides(body: Body, sorts: set[Any], drive: Floats | None = None) -> Sorts:
    """Return guides that fit the poses exactly: up to four circles, the best rails and slots, or some of all directions.

    ``drive`` (N,): prescribed travel along a rail or slot.
    """
    motion = Motion.of(body)
    straight = {sort: _exact_lines(seen, drive) for sort, seen in _lines_seen(motion) if sort in sorts}
    if Circle not in sorts:
        return straight
    if body.position.size <= FEW:
        return {
            Circle: as_circles(body, sampled_dyads(body, OPTIONS.sampled_dyads, np.random.default_rng(OPTIONS.seed)))
        } | straight
    dyads = linear_dyads(body)
    if dyads.radius.size:
        dyads, error = polished(body, dyads)
        dyads = dyads.take(error < OPTIONS.exact)
    found = [as_circles(body, dyads)]
    for guides in straight.values():  # the middle of a pencil of rails moves on a circle
        if guides.point.size > 2 and not guides.inverse[0]:
            found.append(as_circles(body, circles(body, np.array([guides.point.mean()]))))
    return {Circle: found[0].joined(*found[1:])} | straight


def _lines_seen(motion: Motion) -> tuple[tuple[Any, Motion], ...]:
    """Return the motions in which points of rails, and of slots, move along lines."""
    return (Rail, motion), (Slot, motion.inverse)


def _exact_lines(motion: Motion, drive: Floats | None) -> Guides:
    if motion.position.size <= 2:  # any point has a line through two positions
        return lines_of(motion, _points())
    lines = Straight(motion)
    best, error = lines.stationary()
    if motion.position.size == 3 or error[1] < OPTIONS.exact:  # a pencil: a line in each direction
        normals = OPTIONS.normals[:: 1 if motion.position.size == 3 else OPTIONS.direction_step]
        return lines.along(normals if drive is None else np.concatenate([_timely(lines, drive), normals]))
    return best.take(error < OPTIONS.exact)


def _timely(lines: Straight, drive: Floats) -> Floats:
    """Return the few directions of a pencil along which the travel is most similar to the prescribed travel (N,)."""
    fine = lines.along(np.linspace(0.0, np.pi, OPTIONS.fine_directions, endpoint=False))
    travel = (np.conj(1j * np.exp(1j * fine.normal))[:, None] * lines.motion.positions(fine.point)).real
    off = np.stack([travel - drive, travel + drive])
    miss = np.min(np.std(off, axis=2), axis=0)
    lowest = (miss <= np.roll(miss, 1)) & (miss <= np.roll(miss, -1))
    best = np.flatnonzero(lowest)
    return fine.normal[best[np.argsort(miss[best], kind="stable")[: OPTIONS.timely_directions]]]


def near_guides(body: Body, sorts: set[Any]) -> Sorts:
    """Return guides of points all over the body and the ground, and of all directions."""
    motion = Motion.of(body)
    found = {sort: lines_of(seen, _points()) for sort, seen in _lines_seen(motion) if sort in sorts}
    for sort, seen in _lines_seen(motion):
        if sort in sorts and seen.position.size > 2:
            lines = Straight(seen)
            found[sort] = found[sort].joined(lines.stationary()[0], lines.along(OPTIONS.normals))
    if Circle not in sorts:
        return found
    rough = circles(body, _points())
    if body.position.size > FEW:
        fine, error = landscape(body, 10, 24)
        fine, _ = distinct_dyads(fine, error, OPTIONS.best_dyads)
        rough = fine.joined(rough)
    proper = (np.abs(rough.fixed) < FARTHEST) & (rough.radius > 1e-6)
    return {Circle: as_circles(body, rough.take(proper))} | found


def _points() -> Any:
    count = OPTIONS.around
    radius, angle = np.meshgrid(OPTIONS.radii, np.arange(count) * (2 * np.pi / count), indexing="ij")
    return np.concatenate([[0j], (radius * np.exp(1j * angle)).ravel()])


def pairs_of(sorts: Sorts, drives: Sequence[Drive]) -> tuple[Pairs, Ints]:
    """Return all pairs of guides for some drives, and the index of the drive of each."""
    firsts, seconds, hinges, numbers = [], [], [], []
    for number, drive in enumerate(drives):
        first, second = sorts[drive.first], sorts[drive.second]
        i, j = (index.ravel() for index in np.indices((first.point.size, second.point.size)))
        if drive.first is drive.second:
            i, j = i[i != j], j[i != j]
        firsts.append(first.take(i))
        seconds.append(second.take(j))
        hinges.append(np.full(i.size, drive.driver is Driver.HINGE))
        numbers.append(np.full(i.size, number))
    pairs = Pairs(firsts[0].joined(*firsts[1:]), seconds[0].joined(*seconds[1:]), np.concatenate(hinges))
    return pairs, np.concatenate(numbers)
