"""Descents of candidates without crank angles, in rounds: within limits from the first step on, few of them to their end.

Data flow of a round::

    seeds -> descents in which broken limits weigh more from stage to stage: all a few steps, the best of each valley some
      more, the best of the pool to their end -> on all samples, moved onto the limits that they still break -> `Found`

A valley is a timing: many candidates come to rest along the same long valley, and copies of them would fill every list.
What is found within the limits is kept, whatever comes after it, and no round depends on the time: more of it never gives less.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.limits import Limits
from synthesis.fourbar.mechanism import ways
from synthesis.free.joint import JointProblem, Timed, loose_steps, refine
from synthesis.free.limited import LimitedJoint, moved_onto
from synthesis.free.pool import Pool
from synthesis.free.poses import Poses
from synthesis.free.screen import way_along
from synthesis.mechanism import BoundedChart, Chart
from synthesis.work import Work

Floats = NDArray[np.float64]

_POOL = 120
_APART, _POOL_APART = 0.01, 0.03
"""Parts of the span by which a crank angle differs between two valleys: among answers, and in the pool."""
_ALIKE = 1e-4
"""Shapes, starts and branches of exact candidates are the same when they differ by less."""
_FLIPPED, _SPAN_HOP, _LOOSE_HOP = 0.15, 0.25, 0.5
"""Part of the hops that change the branch, and widths of hops: of the span's logarithm, and along flat directions."""
_TIRED = 2.0
"""A valley stands back by this factor of e in J squared for each time that hops started from it."""
_NEAREST_STEPS, _LAST_STEPS = 6, 40
_ON_ALL, _MOVED = 4, 30
"""Candidates that are refined on all samples, and that are moved onto the limits."""
_EXACT_NEAR = 1e-2
"""J below which an answer that no limit holds is refined in its best pose: an exact one may lie there."""
_KEPT = 1e-13
"""To which an answer must keep equations; other limits it keeps entirely."""


class Stage(NamedTuple):
    """A part of a descent."""

    weight: float
    """Its square weighs squared violations of limits against J squared."""
    steps: int
    stall: float
    """A candidate whose cost falls by a smaller part in a step ends."""


class Plan(NamedTuple):
    """How a round's seeds descend."""

    first: tuple[Stage, ...]
    going: int = 0
    """So many of the best valleys go on."""
    on: tuple[Stage, ...] = ()
    ended: int = 0
    """So many of the best of the pool descend to their end, where they did not before."""
    end: tuple[Stage, ...] = ()


FEW_TO_THEIR_END = Plan(
    (Stage(0.3, 15, 1e-2), Stage(1.0, 12, 1e-2)),
    12,
    (Stage(3.0, 12, 1e-3), Stage(10.0, 15, 1e-3), Stage(30.0, 15, 1e-3)),
    4,
    (Stage(100.0, 60, 1e-6), Stage(300.0, 60, 1e-6), Stage(300.0, 60, 1e-7)),
)


class Found:
    """What is known within the limits, with J on all samples; it only gets better.

    Parameters
    ----------
    tolerance : float
        J below it is exact.
    note : callable
        Told the best J whenever it falls.
    """

    def __init__(self, tolerance: float, note: Callable[[float], None]) -> None:
        self.tolerance, self.note = tolerance, note
        self.pools: dict[Any, Pool] = {}
        """By the chart that the candidates are in."""
        self.least = np.inf

    def add(self, chart: Chart, pool: Pool) -> None:
        """Take candidates that keep the limits."""
        if pool.cost.size:
            known = self.pools[chart].joined(pool) if chart in self.pools else pool
            self.pools[chart] = valleys(known, _POOL, self.tolerance, _APART)
        if pool.least < self.least:
            self.least = pool.least
            self.note(self.least)

    @property
    def reached(self) -> bool:
        """Whether an answer is below the tolerance."""
        return self.least <= self.tolerance


class Rounds:
    """The rounds of one request in one chart; candidates come and go with crank angles at all samples.

    Parameters
    ----------
    poses : Poses
    limits : Limits
    chart : Chart
    found : Found
        Where answers go.
    work : Work
    samples : int
        That descents look at; longer requests are thinned for them.
    limited : bool
        Whether descents keep to the limits; otherwise only answers do.
    """

    def __init__(
        self, poses: Poses, limits: Limits, chart: Chart, found: Found, work: Work, samples: int, limited: bool = True
    ) -> None:
        self.poses, self.chart, self.found, self.work = poses, chart, found, work
        few = np.round(np.linspace(0, poses.samples - 1, min(samples, poses.samples)))
        self.few = few.astype(np.intp)
        self.thin = poses if self.few.size == poses.samples else poses.at(self.few)
        self.holds = not limits.only_family
        """Whether limits hold."""
        self.limited = limited and self.holds
        self._constraints = [ways(one, limits, posed=True)[0].constraints for one in (self.thin, poses)]
        """Of positions from the mean of the few samples, and of all."""
        self.plain = JointProblem(poses, chart)
        self.random = np.random.default_rng(20)
        self.pool: Pool | None = None
        self._used: Counter[float] = Counter()
        """How often hops started from a valley, by its cost."""
        self._ended: set[float] = set()
        """Costs of those that descended to their end."""

    def problem(self, weight: float, every: bool = False) -> JointProblem:
        """The problem of the samples that descents look at, or of every sample, with limits of some weight."""
        poses = self.poses if every else self.thin
        if not self.limited:
            return JointProblem(poses, self.chart)
        return LimitedJoint(poses, self.chart, self._constraints[every], weight)

    @property
    def _moved(self) -> complex:
        """Mean position of the few samples, from that of all, over the length scale."""
        return self.poses.off(self.thin)

    @property
    def least(self) -> float:
        """J of the best of the pool, whether it keeps the limits or not."""
        return np.inf if self.pool is None else self.pool.least

    def best(self, most: int) -> Timed:
        """The best valleys of the pool."""
        assert self.pool is not None
        return self.pool.timed.take(slice(0, most))

    # -- a round ----------------------------------------------------------------------------------------------------

    def round(self, seeds: Timed, plan: Plan) -> None:
        """Descents from seeds that have crank angles at the few samples."""
        found = self._descended(seeds, plan.first)
        if plan.on:
            going = valleys(found, plan.going, self.found.tolerance, _POOL_APART)
            self._answer(going)
            found = self._descended(going.timed, plan.on, answers=True)
        self._take(found)
        assert self.pool is not None
        best = [k for k in range(min(plan.ended, self.pool.cost.size)) if self.pool.cost[k] not in self._ended]
        if best and not (self.found.reached or self.work.expired()):
            before = set(self.pool.cost[best])
            found = self._descended(self.pool.take(best).timed, plan.end, answers=True)
            self._ended |= before | set(found.cost)
            self._take(found)

    def _descended(self, timed: Timed, stages: tuple[Stage, ...], answers: bool = False) -> Pool:
        cost = np.empty(0)
        for number, stage in enumerate(stages, 1):
            exact = 0.3 * self.found.tolerance
            timed, cost = refine(self.problem(stage.weight), timed, stage.steps, exact, self.work, stall=stage.stall)
            if answers and number < len(stages):
                self._answer(Pool(timed, cost))
        return Pool(timed, cost)

    def _take(self, found: Pool) -> None:
        """Into the pool; and what is worth it among the answers."""
        tolerance = self.found.tolerance
        found = found.take(np.isfinite(found.cost))
        self.pool = valleys(found if self.pool is None else self.pool.joined(found), _POOL, tolerance, _POOL_APART)
        if self.limited or not self.holds or found.least <= tolerance:
            self._answer(found)

    # -- answers ----------------------------------------------------------------------------------------------------

    def _answer(self, pool: Pool) -> None:
        """Candidates at the few samples, on all samples, to `keep`."""
        if pool.cost.size and self._counts:
            few = self.thin is not self.poses
            self.keep(self._on_all(pool.take(np.argsort(pool.cost, kind="stable")[:_ON_ALL])) if few else pool)

    @property
    def _counts(self) -> bool:
        """Whether what a descent led to counts: one that the time cut short does only where nothing else is known.

        More time would lead it elsewhere, and an answer must not be lost by that.
        """
        return not (self.work.expired() and np.isfinite(self.found.least))

    def keep(self, pool: Pool, rounds: int = 12) -> None:
        """Add those of candidates at all samples that keep the limits, or can be moved onto them, to the answers.

        Parameters
        ----------
        pool : Pool
        rounds : int
            Steps towards the limits.
        """
        if not (pool.cost.size and self._counts):
            return
        if not self.holds:
            self.found.add(self.chart, pool)
            return
        problem = LimitedJoint(self.poses, self.chart, self._constraints[True], 1.0)
        lacking = problem.constrained(pool.timed)[0].lacking
        merit = pool.cost + np.sum(lacking**2, axis=1)
        moved, broken = moved_onto(problem, pool.timed.take(np.argsort(merit, kind="stable")[:_MOVED]), rounds)
        self.found.add(self.chart, moved.take((broken <= _KEPT) & np.isfinite(moved.cost)))
        near = moved.take(moved.cost < _EXACT_NEAR**2)
        if near.cost.size:
            done = refine(self.plain, near.timed, 30, 0.3 * self.found.tolerance, self.work, stall=1e-2)
            lacking = problem.constrained(done.timed)[0].lacking.max(axis=1, initial=0.0)
            if self._counts:
                self.found.add(self.chart, Pool.of(done).take(lacking <= _KEPT))

    def _on_all(self, pool: Pool) -> Pool:
        """Candidates refined on all samples."""
        # two guesses of what lies between: angles that run into one another in one of them need not in the other
        spread = self.spread(pool.timed, 1.0).joined(self.spread(pool.timed, 0.5))
        timed = nearest(self.plain, spread, _NEAREST_STEPS)
        done = refine(
            self.problem(30.0, every=True), timed, _LAST_STEPS, 0.1 * self.found.tolerance, self.work, stall=1e-4
        )
        steps = np.diff(done.timed.angles, axis=1)
        strict = np.all(steps > 0, axis=1) | np.all(steps < 0, axis=1) | (not self.poses.ordered)
        return Pool.of(done.take(strict) if strict.any() else done)

    def spread(self, timed: Timed, power: float = 1.0) -> Timed:
        """Crank angles of all samples from those of the few, by the way along the path between them (see `way_along`)."""
        if self.thin is self.poses:
            return timed
        way = way_along(self.poses, power)
        angles = np.stack([np.interp(way, way[self.few], few) for few in timed.angles])
        pose = timed.pose.copy()
        pose[:, 0] += self._moved  # positions count from the mean of their own samples
        return timed._replace(angles=angles, pose=pose)

    def thinned(self, timed: Timed) -> Timed:
        """Candidates at all samples at the few alone."""
        if self.thin is self.poses:
            return timed
        pose = timed.pose.copy()
        pose[:, 0] -= self._moved
        return timed._replace(angles=timed.angles[:, self.few], pose=pose)

    # -- hops -------------------------------------------------------------------------------------------------------

    def hops(self, origins: int, copies: int, width: float = 1.0) -> Timed:
        """Perturbed copies of the best valleys that were perturbed least often.

        Half of them are moved in all unknowns alike, which reaches other valleys, half where the cost is flat, which reaches
        other minima of a long one.
        """
        assert self.pool is not None
        cost = self.pool.cost
        rank = np.log(np.maximum(cost, 1e-300)) + _TIRED * np.array([self._used[value] for value in cost])
        chosen = np.argsort(rank, kind="stable")[:origins]
        self._used.update(cost[chosen])
        best = self.pool.timed.take(np.repeat(chosen, copies // 2))
        return self._wide_steps(best, width).joined(loose_steps(self.problem(1.0), best, self.random, _LOOSE_HOP))

    def _wide_steps(self, timed: Timed, width: float) -> Timed:
        """Candidates moved in shape, start and span, with heavy tails, some to the other branch."""
        random, (count, size) = self.random, timed.shape.shape
        noise = width * random.standard_t(3, size=(count, size)) * self.chart.hop[:-1]
        hopped = self.chart.hopped if isinstance(self.chart, BoundedChart) else np.add
        shape = hopped(timed.shape, noise)
        along = timed.angles - timed.angles[:, :1]
        factor = np.exp(width * _SPAN_HOP * random.standard_t(3, size=(count, 1)))
        longest = 0.97 * self.poses.span_max / np.maximum(np.abs(along[:, -1:]), 1e-9)
        start = timed.angles[:, :1] + width * self.chart.hop[-1] * random.standard_t(3, size=(count, 1))
        branch = np.where(random.random(count) < _FLIPPED, -timed.branch, timed.branch)
        return timed._replace(shape=shape, angles=start + along * np.minimum(factor, longest), branch=branch)


def nearest(problem: JointProblem, timed: Timed, steps: int) -> Timed:
    """The candidates with each crank angle moved to the nearest point of the path; order is kept.

    Parameters
    ----------
    problem : JointProblem
    timed : Timed
    steps : int
        Gauss-Newton steps.
    """
    none = np.zeros((len(timed.branch), problem.columns))
    for _ in range(steps):
        _, stack, turn = problem.evaluate(timed, problem.turned(timed))
        square = np.einsum("nrk,nrk->nk", turn, turn)
        along = np.einsum("nrk,nrk->nk", turn, stack[:, -1])
        timed = problem.moved(timed, none, -along / np.maximum(square, 1e-12 * square.mean(axis=1, keepdims=True)))
    return timed


def valleys(found: Pool, most: int, tolerance: float, apart: float) -> Pool:
    """The best of each valley, best first; all that differ of those that reach the tolerance.

    A long valley is told by its timing: shapes and even costs change along it while the crank angles between the samples
    hardly do.
    """
    order = np.argsort(found.cost, kind="stable")
    order = order[np.isfinite(found.cost[order])]
    timing = found.timed.angles - found.timed.angles[:, :1]
    place = np.column_stack([found.timed.shape, found.timed.angles[:, 0], found.timed.branch])
    near = apart * np.abs(timing).max(axis=1)
    kept = np.empty(0, dtype=np.intp)
    for candidate in order:
        if found.cost[candidate] <= tolerance**2:
            twin = np.abs(place[kept] - place[candidate]).max(axis=1) < _ALIKE
        else:
            twin = np.abs(timing[kept] - timing[candidate]).max(axis=1) < near[candidate]
        if not twin.any():
            kept = np.append(kept, candidate)
            if kept.size == most:
                break
    return found.take(kept)
