"""Paths without crank angles: from guessed timing to linkages, in rounds that hop from valley to valley.

Data flow of a request::

    poses --(thinned)--> windows of a coarse table at guessed crank angles, best first, spread out -> seeds
      -> descend -> pool, one a valley -> reached? otherwise the next round of the schedule
      -> crank angles of all samples by the way between those of the few -> polish on all samples -> pool

A valley is a timing: many candidates come to rest along the same long valley, and copies of them would fill every list.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.free.joint import JointProblem, Refined, Timed, loose_steps, refine
from synthesis.free.poses import Poses
from synthesis.free.schedule import PATH, Best, Fresh, Hops, Round, Schedule, Source
from synthesis.free.screen import PathScreen, way_along
from synthesis.mechanism import BoundedChart, Chart
from synthesis.work import Work

Floats = NDArray[np.float64]

_POOL = 120
_APART, _POOL_APART = 0.01, 0.03
"""Parts of the span by which a crank angle differs between two valleys: of the same descent, and in the pool."""
_ALIKE = 1e-4
"""Shapes, starts and branches of exact candidates are the same when they differ by less."""
_SPAN_HOP, _LOOSE_HOP = 0.25, 0.5
_FLIPPED = 0.15
"""Part of the hops that change the branch."""
_TIRED = 2.0
"""A valley stands back by this factor of e in J squared for each time that hops started from it."""
_PARTS = ("rotation", "position", "rotation_weights", "position_weights")
_POLISHED, _POLISH_STEPS, _NEAREST_STEPS = 8, 100, 6


class PathResult(NamedTuple):
    """What a search for a path found."""

    pool: Refined
    """Candidates on all samples, best first, distinct; at least one."""
    trace: list[tuple[float, float]]
    """Seconds of the work, best J so far on all samples: no entry for rounds that saw only a few and did not reach it."""


class _PathSearch:
    """One request's search."""

    def __init__(
        self,
        poses: Poses,
        chart: Chart,
        screens: Sequence[PathScreen],
        samples: int,
        tolerance: float,
        work: Work,
    ) -> None:
        self.poses, self.chart, self.screens, self.tolerance, self.work = poses, chart, screens, tolerance, work
        few = np.round(np.linspace(0, poses.samples - 1, min(samples, poses.samples)))
        self.few = few.astype(np.intp)
        self.thin = _some(poses, self.few)
        self.problem = JointProblem(self.thin, chart)
        self.random = np.random.default_rng(20)
        self.seeds: dict[int, Timed] = {}
        self.pool: Refined | None = None
        self.used: Counter[float] = Counter()
        """How often hops started from a valley, by its cost."""

    # -- rounds -----------------------------------------------------------------------------------------------------

    def descend(self, one: Round) -> None:
        """One round: its seeds' descent, and what it found into the pool."""
        seeds = self._draw(one.source)
        found = refine(self.problem, seeds, one.steps, 0.3 * self.tolerance, self.work, stall=one.stall)
        found = found if self.pool is None else self.pool.joined(found)
        self.pool = _valleys(found, _POOL, self.tolerance, _POOL_APART)

    @property
    def reached(self) -> bool:
        """Whether the pool holds a candidate below the tolerance."""
        return self.pool is not None and bool(self.pool.cost.size and self.pool.cost[0] <= self.tolerance**2)

    def finished(self, work: Work) -> Refined:
        """The best of the pool on all samples."""
        assert self.pool is not None
        if self.few.size == self.poses.samples:
            return self.pool
        best = self.pool.take(slice(0, _POLISHED))
        problem = JointProblem(self.poses, self.chart)
        # two guesses of what lies between: angles that run into one another in one of them need not in the other
        spread = self._spread(best.timed, 1.0).joined(self._spread(best.timed, 0.5))
        timed = nearest(problem, spread, _NEAREST_STEPS)
        done = refine(problem, timed, _POLISH_STEPS, 0.1 * self.tolerance, work, 1e-6)
        steps = np.diff(done.timed.angles, axis=1)
        strict = np.all(steps > 0, axis=1) | np.all(steps < 0, axis=1)
        done = done.take(strict) if strict.any() else done
        return _valleys(done, _POLISHED, self.tolerance, _APART)

    def _spread(self, timed: Timed, power: float) -> Timed:
        """Crank angles of all samples from those of the few, by the way along the path between them (see `way_along`)."""
        way = way_along(self.poses, power)
        own = way[self.few]
        angles = np.stack([np.interp(way, own, few) for few in timed.angles])
        pose = timed.pose.copy()
        # positions count from the mean of their own samples
        pose[:, 0] += (self.thin.middle - self.poses.middle) / self.poses.length_scale
        return timed._replace(angles=angles, pose=pose)

    # -- seeds ------------------------------------------------------------------------------------------------------

    def _draw(self, source: Source) -> Timed:
        match source:
            case Fresh():
                if source.screen not in self.seeds:
                    found = self.screens[source.screen].seeds(self.thin, self.chart)
                    self.seeds[source.screen] = self.problem.facing(found)
                return self.seeds[source.screen].take(slice(source.start, source.stop))
            case Best():
                assert self.pool is not None
                return self.pool.timed.take(slice(0, source.most))
            case Hops():
                return self._hops(source)

    def _hops(self, source: Hops) -> Timed:
        assert self.pool is not None
        cost = self.pool.cost
        rank = np.log(np.maximum(cost, 1e-300)) + _TIRED * np.array([self.used[value] for value in cost])
        chosen = np.argsort(rank, kind="stable")[: source.origins]
        self.used.update(cost[chosen])
        best = self.pool.timed.take(chosen)
        wide = self._wide_steps(best.take(np.repeat(np.arange(chosen.size), source.wide)))
        loose = best.take(np.repeat(np.arange(chosen.size), source.loose))
        return wide.joined(loose_steps(self.problem, loose, self.random, _LOOSE_HOP))

    def _wide_steps(self, timed: Timed) -> Timed:
        """Candidates moved in shape, start and span, with heavy tails, some to the other branch."""
        random, (count, size) = self.random, timed.shape.shape
        noise = random.standard_t(3, size=(count, size)) * self.chart.hop[:-1]
        hopped = self.chart.hopped if isinstance(self.chart, BoundedChart) else np.add
        shape = hopped(timed.shape, noise)
        along = timed.angles - timed.angles[:, :1]
        factor = np.exp(_SPAN_HOP * random.standard_t(3, size=(count, 1)))
        longest = 0.97 * self.poses.span_max / np.maximum(np.abs(along[:, -1:]), 1e-9)
        start = timed.angles[:, :1] + self.chart.hop[-1] * random.standard_t(3, size=(count, 1))
        branch = np.where(random.random(count) < _FLIPPED, -timed.branch, timed.branch)
        return timed._replace(shape=shape, angles=start + along * np.minimum(factor, longest), branch=branch)


def search_path(
    poses: Poses,
    chart: Chart,
    screens: Sequence[PathScreen],
    tolerance: float,
    work: Work | None = None,
    schedule: Schedule = PATH,
) -> PathResult:
    """Linkages whose body point passes positions in their order, the crank turning one way.

    Parameters
    ----------
    poses : Poses
        Positions; their order is kept strictly.
    chart : Chart
        Of the shapes that are sought; best with change points at its bounds.
    screens : sequence of PathScreen
        As many as the schedule names, coarse and then finer.
    tolerance : float
        Stop when J is below it.
    work : Work, optional
        Once it has expired the best so far is returned, at the least the best of the first seeds.
    schedule : Schedule

    Returns
    -------
    PathResult
        Law: the same for the same request, where the work did not expire.
    """
    work = work or Work()
    run = _PathSearch(poses, chart, screens, schedule.samples, tolerance, work)
    trace: list[tuple[float, float]] = []
    pool: Refined | None = None

    def note() -> Refined:
        # polish on all samples what the few settle, even where the time is up: without it there is no answer
        done = run.finished(work)
        merged = done if pool is None else _valleys(pool.joined(done), _POOL, tolerance, _APART)
        trace.append((work.elapsed, float(np.sqrt(merged.cost[0]))))
        return merged

    for one in schedule.rounds:
        run.descend(one)
        if run.reached:
            pool = note()
            if pool.cost[0] <= tolerance**2:
                return PathResult(pool, trace)
        elif run.few.size == poses.samples:
            assert run.pool is not None
            trace.append((work.elapsed, float(np.sqrt(run.pool.cost[0]))))
        if work.expired():
            break
    pool = note()
    return PathResult(pool, trace)


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


def _some(poses: Poses, kept: NDArray[np.intp]) -> Poses:
    """The poses at some samples."""
    part: dict[str, Any] = {name: None if (given := getattr(poses, name)) is None else given[kept] for name in _PARTS}
    return replace(poses, **part)


def _valleys(found: Refined, most: int, tolerance: float, apart: float) -> Refined:
    """The best of each valley, best first; all that differ of those that reach the tolerance.

    A long valley is told by its timing: shapes and even costs change along it while the crank angles between the samples
    hardly do.
    """
    order = np.argsort(found.cost, kind="stable")
    order = order[np.isfinite(found.cost[order])]
    timing = found.timed.angles - found.timed.angles[:, :1]
    place = np.column_stack([found.timed.shape, found.timed.angles[:, 0], found.timed.branch])
    near = apart * np.abs(timing[:, -1])
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
