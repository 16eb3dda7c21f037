"""Motion without crank angles: the search for poses that have both a rotation and a position.

Data flow of a request::

    poses -> dyads (five and more: one SVD and a quartic; fewer: samples of the infinitely many)
      -> pairs of dyads as four-bars with crank angles -> those of the family, on one branch and in the order asked for
      -> joint refinement -> reached? otherwise dyads from starts all over the body, their pairs, refined in rounds
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.charts import AnyChart, GrashofChart
from synthesis.fourbar.limits import in_family
from synthesis.free.align import aligned
from synthesis.free.dyads import Body, Dyads, landscape, linear_dyads, polished
from synthesis.free.few import sampled_dyads
from synthesis.free.joint import JointProblem, Timed, refine
from synthesis.free.pairs import in_any_order, in_order, pairs_of, put_in_order
from synthesis.free.pool import Pool
from synthesis.free.poses import Poses
from synthesis.work import Work

Floats = NDArray[np.float64]

FEW = 4
"""Up to so many poses infinitely many dyads fit exactly."""
_FEW_DYADS, _FEW_BATCHES = 60, 20
_SAMPLED_DYADS, _SAMPLED_BATCHES = 110, 8
_WORTH = 0.01
"""Two batches in a row that gain less than this part end the search."""
_ENOUGH = 60
"""Exact candidates that are enough of a choice."""


_FITTED = 400
"""Pairs of dyads that fit the full samples best and are compared with others at all."""
_LOOKED_AT, _AT_ONCE = 8, 200
"""Full samples, and others, at which pairs of dyads are first compared, and how many pairs at a time."""
_ALIGNED, _FEWEST = 6000, 12
"""Pairs times samples that are then compared at all samples, and at least so many pairs."""


class Round(NamedTuple):
    """A descent of the best pairs."""

    most: int
    iterations: int
    reason: str


ROUNDS = (
    Round(60, 8, "pairs of dyads that each fit alone: most fall into few valleys"),
    Round(24, 30, "the best valleys"),
    Round(8, 150, "narrow ones"),
    Round(4, 1000, "what still falls, to its end: only where an exact answer may lie there"),
)
_KEPT = 100
"""Candidates that are handed on: limits may leave only a few of them."""
_EXACT_BELOW = 1e-4
"""Where J is above this after the rounds before the last, an exact answer is not in sight."""


def chart_of(family: str) -> AnyChart | GrashofChart:
    """The chart in which four-bars of one of `limits.FAMILIES` are refined."""
    return AnyChart() if family == "any" else GrashofChart()


def four_bars(poses: Poses, body: Body, dyads: Dyads, family: str, repair: bool = False) -> Timed:
    """The pairs of dyads that are of the family, lie on one branch and pass the poses in the order asked for.

    With ``repair`` also those that do so only nearly, their angles put in order.
    """
    pairs = pairs_of(body, dyads)
    if poses.ordered:
        angles, holds = in_order(pairs.angles, poses.span_max)
        if repair:
            angles = np.where(holds[:, None], angles, put_in_order(pairs.angles, poses.span_max))
    else:
        angles, holds = in_any_order(pairs.angles, poses.span_max)
    keep = np.flatnonzero((holds & pairs.one_branch | repair) & in_family(family, pairs.lengths))
    pairs = pairs.take(keep)
    shape = chart_of(family).unknowns(pairs.lengths)
    return Timed(shape, pairs.pose, pairs.offset, angles[keep], pairs.branch)


def search_motion(poses: Poses, family: str, tolerance: float, work: Work) -> Iterator[Pool]:
    """Four-bars that guide a body through poses, some of which may lack their rotation or their position.

    Parameters
    ----------
    poses : Poses
        With at least three samples that have both, or two and no others.
    family : str
        One of `limits.FAMILIES`.
    tolerance : float
        The search ends once J is below it.
    work : Work

    Yields
    ------
    Pool
        All candidates so far, first those of dyads as equations give them, within milliseconds; then after each round.
    """
    search = _Motion(poses, family)
    if search.full <= FEW and search.mixed:
        yield from _sampled(search, tolerance, work)
        return
    exact = 0.3 * tolerance
    if search.full <= FEW:
        pool = _few(search, work)
        near = np.flatnonzero(pool.cost > exact**2)
        if pool.cost.size - near.size < _ENOUGH:
            # dyads of short links lie where places all but coincide: a few steps give back what rounding took
            rest = pool.take(near).best(_ENOUGH)
            rest = Pool.of(refine(search.problem, rest.timed, 60, exact, work, all_of_them=True))
            pool = pool.take(np.flatnonzero(pool.cost <= exact**2)).joined(rest)
        yield pool
        return
    dyads = linear_dyads(search.body)
    dyads, _ = polished(search.body, dyads) if dyads.radius.size else (dyads, None)
    five = search.full == FEW + 1 and not search.mixed
    pool = Pool.of(refine(search.problem, search.four_bars(dyads), 25, exact, work, all_of_them=five))
    yield pool
    if pool.least < tolerance or (work.expired() and np.isfinite(pool.least)):
        return
    everywhere, _ = landscape(search.body)
    pool = search.measured(everywhere.joined(dyads), repair=True).joined(pool)
    yield pool
    if not work.expired():  # what follows takes half a second at 1,024 samples
        yield from _rounds(search, pool, tolerance, work)


def _rounds(search: _Motion, found: Pool, tolerance: float, work: Work) -> Iterator[Pool]:
    """A pool with its best refined, after each round."""
    for one in ROUNDS:
        if one is ROUNDS[-1] and found.least > _EXACT_BELOW:
            break
        going = found.best(one.most)
        found = Pool.of(refine(search.problem, going.timed, one.iterations, 0.3 * tolerance, work)).joined(found)
        yield found
        if found.least < tolerance or work.expired():
            break


def _sampled(search: _Motion, tolerance: float, work: Work) -> Iterator[Pool]:
    """Three or four full samples among others: dyads at random that fit those exactly, until one pair fits the rest too."""
    random = np.random.default_rng(20)
    best: Pool | None = None
    idle = 0
    for _ in range(_SAMPLED_BATCHES):
        found = search.measured(sampled_dyads(search.body, _SAMPLED_DYADS, random))
        *_, found = _rounds(search, found, tolerance, work)
        found = found.best(_KEPT)
        gained = best is None or found.least < (1 - _WORTH) * best.least
        best = found if best is None else best.joined(found)
        yield best
        idle = 0 if gained else idle + 1
        if best.least < tolerance or work.expired() or (idle == 2 and best.least > _EXACT_BELOW):
            break


class _Motion:
    """A request's full samples, which give the dyads, and all of its samples, which the four-bars must fit."""

    def __init__(self, poses: Poses, family: str) -> None:
        self.poses, self.family = poses, family
        self.body = Body(poses)
        self.full = self.body.position.size
        self.mixed = self.full < poses.samples
        self.problem = JointProblem(poses, chart_of(family))

    def four_bars(self, dyads: Dyads, repair: bool = False, most: int = 150) -> Timed:
        """The four-bars of pairs of dyads, with an angle at every sample; of many, those that fit the rest best."""
        timed = four_bars(self.poses, self.body, dyads, self.family, repair)
        if not self.mixed:
            return timed
        if not timed.branch.size:
            return timed._replace(angles=np.empty((0, self.poses.samples)))
        best = self._best_aligned(timed, most)
        return aligned(self.problem, timed.take(best), self.poses.full).timed

    def _best_aligned(self, timed: Timed, most: int) -> NDArray[np.intp]:
        """Places of those that fit some of the samples best, full ones and others, some hundred candidates at a time."""
        poses, place = self.poses, np.arange(timed.branch.size)
        if self.full > FEW:  # fewer are fitted exactly
            fitted = Pool.measured(JointProblem(poses.at(poses.full), self.problem.chart), timed)
            place = np.argsort(fitted.cost, kind="stable")[:_FITTED]
            timed = timed.take(place)
        others = np.setdiff1d(np.arange(poses.samples), poses.full)
        held, rest = (some[_evenly(some.size, _LOOKED_AT)] for some in (np.arange(poses.full.size), others))
        few = np.sort(np.concatenate([poses.full[held], rest]))
        problem = JointProblem(poses.at(few), self.problem.chart)
        pose = timed.pose.copy()
        pose[:, 0] -= poses.off(problem.poses)
        thin = timed._replace(angles=timed.angles[:, held], pose=pose)
        known = np.searchsorted(few, poses.full[held])
        parts = [slice(k, k + _AT_ONCE) for k in range(0, timed.branch.size, _AT_ONCE)]
        cost = np.concatenate([aligned(problem, thin.take(part), known).cost for part in parts])
        return place[np.argsort(cost, kind="stable")[: min(most, max(_FEWEST, _ALIGNED // poses.samples))]]

    def measured(self, dyads: Dyads, repair: bool = False) -> Pool:
        """The same with their J."""
        return Pool.measured(self.problem, self.four_bars(dyads, repair))


def _evenly(count: int, most: int) -> NDArray[np.intp]:
    """Places of at most so many of a count, both ends among them."""
    return np.unique(np.round(np.linspace(0, count - 1, min(count, most))).astype(np.intp))


def _few(search: _Motion, work: Work) -> Pool:
    """Four-bars that fit up to four full samples exactly, from dyads at random; more of them where few are usable."""
    random = np.random.default_rng(20)
    pool = search.measured(sampled_dyads(search.body, _FEW_DYADS, random))
    for _ in range(_FEW_BATCHES - 1):
        if pool.cost.size >= _ENOUGH or work.expired():
            break
        pool = pool.joined(search.measured(sampled_dyads(search.body, _FEW_DYADS, random)))
    return pool
