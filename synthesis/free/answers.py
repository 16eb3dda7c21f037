"""From candidates with crank angles to four-bars with actual lengths: within the limits, different from one another, ranked."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.kinematics import coupler_angle, transmission_angle_over, wrap
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.mechanism import FOURBAR
from synthesis.fourbar.passage import LEAVES_SAMPLES, excursions
from synthesis.fourbar.solution import Solution, assess, keeps
from synthesis.free.pool import Pool
from synthesis.free.poses import Poses
from synthesis.mechanism import Chart, Placed
from synthesis.ranking import APART, distinct
from synthesis.target import TURN, Target

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Flags = NDArray[np.bool_]

_SWING_STEP, _TRANSMISSION_STEP = np.deg2rad(90.0), np.deg2rad(5.0)
"""Exact answers whose cranks turn alike far are ranked by transmission angle, and then by how compact they are."""


class _Mounted(NamedTuple):
    """Candidates in the user's unit of length."""

    poses: Poses
    cost: Floats
    branch: Floats
    links: Floats
    pivot: Complexes
    turn: Floats
    """Ground angles."""
    coupler: Complexes
    start: Floats
    crank: Floats
    """(n, N): crank angles from the first sample, of all samples that were asked for."""
    offset: Floats

    @classmethod
    def of(cls, poses: Poses, pool: Pool, chart: Chart) -> _Mounted:
        """The candidates of a pool."""
        timed = pool.timed
        a, z1, z2 = timed.pose.T
        lengths, scale = chart.shape(timed.shape).lengths, poses.length_scale
        start = timed.angles[:, 0]
        return cls(
            poses,
            pool.cost,
            timed.branch,
            lengths * (scale * np.abs(z1) / lengths[:, 0])[:, None],
            poses.middle + scale * a,
            np.angle(z1),
            scale * z2,
            start,
            poses.whole(timed.angles - start[:, None]),
            timed.offset,
        )

    def take(self, places: Any) -> _Mounted:
        """Some of them."""
        return _Mounted(self.poses, *(column[places] for column in self[1:]))

    @property
    def pivots(self) -> list[Complexes]:
        """Pivots A and B."""
        return [self.pivot, self.pivot + self.links[:, 3] * np.exp(1j * self.turn)]

    @property
    def placed(self) -> Placed:
        """They as the limits see them."""
        used = self.poses.used(self.crank).interval.after(self.start)
        return Placed(self.links, self.branch, used, self.pivot, self.turn, self.coupler)

    @property
    def target(self) -> Target:
        """The request with the crank angles of each."""
        rotation = None
        if self.poses.rotation is not None:
            rotation = coupler_angle(self.links, self.branch, self.start[:, None] + self.crank) + self.offset[:, None]
        return self.poses.timed(self.crank, rotation)

    def order(self, tolerance: float) -> NDArray[np.intp]:
        """Places, best first: by J, and exact ones by what one would build.

        That is how far the crank turns, then the transmission angle, each in steps, and then how compact the linkage is.
        """
        objective = np.sqrt(self.cost)
        rest = np.where(objective < tolerance, 0.0, objective)
        used = self.poses.used(self.crank).interval.after(self.start)
        transmission = np.nan_to_num(transmission_angle_over(self.links, used))
        middle, scale = self.poses.middle, self.poses.length_scale
        far = np.max(np.abs(np.array(self.pivots) - middle), axis=0) / scale
        size = np.maximum(self.links.max(axis=1) / self.links.min(axis=1), far)
        swing = np.abs(used.last - used.first)
        return np.lexsort((size, -np.floor(transmission / _TRANSMISSION_STEP), np.floor(swing / _SWING_STEP), rest))

    def leaves(self) -> Flags:
        """Whether the body point goes far away between neighbouring samples, (n,)."""
        linkages = [one.linkage for one in self.solutions()]
        crank = self.start[:, None] + self.crank
        side = np.broadcast_to(self.branch[:, None], crank.shape)
        poses = self.poses
        way = excursions(linkages, crank, side, poses.extent, ordered=poses.ordered, closed=poses.closed)
        return np.array([one is not None and one > LEAVES_SAMPLES for one in way], dtype=bool)

    def solutions(self) -> list[Solution]:
        """Them with errors, recomputed from their own numbers."""
        linkages = FOURBAR.posed(self.links, self.branch, self.start, (self.pivot, self.turn, self.coupler))
        found = assess(self.target, linkages)
        return [
            replace(one, crank=crank.copy(), linkage=_offset_wrapped(one)) for one, crank in zip(found, self.crank)
        ]


def _offset_wrapped(solution: Solution) -> Any:
    offset = solution.linkage.body_offset
    return solution.linkage if offset is None else replace(solution.linkage, body_offset=wrap(offset))


def solutions_of(
    poses: Poses, pool: Pool, chart: Chart, limits: Limits, top: int, tolerance: float
) -> list[Solution]:
    """The best four-bars of a pool.

    Parameters
    ----------
    poses : Poses
    pool : Pool
    chart : Chart
        That of the pool.
    limits : Limits
    top : int
        At most so many.
    tolerance : float
        Below it J tells nothing: such answers are ranked by transmission angle and size.

    Returns
    -------
    list of Solution
        Within the limits, with their crank angles; no two within 1 % of each other in all their numbers.
    """
    if not pool.cost.size:
        return []
    every = _Mounted.of(poses, pool.take(np.isfinite(pool.cost)), chart)
    kept = keeps(poses, limits, every.placed)
    kept &= np.all(np.isfinite(every.links) & (every.links > 0), axis=1)
    if poses.ordered:
        used = np.abs(pool.timed.angles[np.isfinite(pool.cost)][:, [0, -1]] @ [-1.0, 1.0])
        kept &= used <= poses.span_max * (1 + 1e-9)
    every = every.take(np.flatnonzero(kept))
    ranked = every.take(every.order(tolerance)[: 8 * top + 20])
    exact = np.sqrt(ranked.cost) < tolerance
    if np.any(exact):  # of those that meet all samples the ones last that go elsewhere in between
        ranked = ranked.take(np.argsort(2 * ~exact + ranked.leaves(), kind="stable"))
    found = [one for one in ranked.solutions() if np.isfinite(one.errors.objective)]
    place = {id(one): rank for rank, one in enumerate(found)}
    return distinct(found, top, APART, order=lambda one: place[id(one)], exact=tolerance)


def in_turn(crank: Floats, ordered: bool) -> Floats:
    """Crank angles as a reply gives them: one way where the order counts, otherwise in [0, a turn)."""
    return crank if ordered else crank % TURN
