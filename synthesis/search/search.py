"""The anytime search: coarse atlas, diverse seeds, refinement in rounds, stop when the tolerance is reached.

Data flow of a request::

    target --(clockwise: mirrored)--> squared errors of all windows of a coarse level (two matrix products)
      -> best start of each type and branch -> thinned out over cells of the chart -> seeds
      -> refine all at once -> pool -> reached? otherwise the next round: more seeds, the finer level,
         perturbations of the best ("hops"), long runs along narrow valleys
      -> polish -> solutions, recomputed from their numbers, different from one another, within the limits

What decides is the diversity of the seeds, not the density of the atlas: the best rows of a dense atlas lie in one valley.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.atlas.file import Atlas, AtlasRule, generator_versions
from synthesis.atlas.rows import compute_rows
from synthesis.atlas.scan import Scan
from synthesis.fourbar.charts import AnyChart, Chart, FullCrankChart
from synthesis.fourbar.dimension_types import OrderRule, TypeRule, enumerate_types
from synthesis.fourbar.kinematics import TURN, close_loop
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.solution import APART, Solution, Status, distinct, finish_solutions, make_solutions
from synthesis.search.refine import LimitedProblem, Problem, refine
from synthesis.target import Target

Floats = NDArray[np.float64]

DEFAULT_TOLERANCE = 1e-10
SEARCH_SAMPLES = 64
"""Samples that the rounds look at; longer requests are thinned for them and polished on all samples."""

_LEVEL_PERIMETERS = (40, 64)
_LEVEL_SAMPLES = 64
_LEVEL_STARTS = 24
_LEVEL_SERIES_ERROR = 1e-3
_LEVEL_HARMONICS = (6, 20)
_CELL = np.array([0.7, 1.0, 1.0, 0.6])
_HOP = np.array([0.7, 1.5, 1.5, 0.4])
_ANY_LENGTHS = (1.0, 2.0, 3.0, 4.5)
_ANY_STARTS = 18
_LIMIT_STARTS = 12
_PENALTIES = (0.3, 3.0, 30.0, 1000.0)


class StoppedBy(StrEnum):
    """Why a search ended."""

    TOLERANCE = "tolerance"
    CONVERGED = "converged"
    BUDGET = "budget"


class SearchReport(NamedTuple):
    """How a search went."""

    stopped_by: StoppedBy
    trace: list[tuple[float, float]]
    """Seconds since the start, best objective within the limits."""
    screen_seconds: float
    seeds: int
    rounds: int


class _Level(NamedTuple):
    scan: Scan
    unknowns: Floats
    double_crank: NDArray[np.bool_]


class Levels:
    """The coarse atlases of the search, enumerated and prepared once (about 3 MB)."""

    def __init__(self) -> None:
        self.levels = [_prepare_level(perimeter) for perimeter in _LEVEL_PERIMETERS]

    @property
    def nbytes(self) -> int:
        """Memory of all levels."""
        return sum(level.scan.nbytes + level.unknowns.nbytes for level in self.levels)


def _prepare_level(perimeter: int) -> _Level:
    rule = AtlasRule(TypeRule(perimeter, 1, OrderRule.FULL_CRANK), _LEVEL_SAMPLES)
    lengths = enumerate_types(rule.types)
    rows = compute_rows(lengths, rule.samples)
    atlas = Atlas(rule, lengths.astype("<u2"), generator=generator_versions(), **rows._asdict())
    scan = Scan(atlas, _LEVEL_STARTS, _LEVEL_SERIES_ERROR, _LEVEL_HARMONICS, cells=False)
    return _Level(scan, FullCrankChart().unknowns(lengths), lengths[:, 0] > lengths[:, 3])


class _Candidates(NamedTuple):
    unknowns: Floats
    branch: Floats
    cost: Floats

    def take(self, index: NDArray[np.generic]) -> _Candidates:
        return _Candidates(*(column[index] for column in self))

    def joined(self, other: _Candidates) -> _Candidates:
        return _Candidates(*(np.concatenate(pair) for pair in zip(self, other)))


_NONE = _Candidates(np.empty((0, 4)), np.empty(0), np.empty(0))


def _thin(candidates: _Candidates, count: int, cell: float = 0.05) -> _Candidates:
    """The best ``count`` candidates, at most one a small cell of chart, start and branch."""
    candidates = candidates.take(np.argsort(candidates.cost, kind="stable"))
    candidates = candidates.take(np.isfinite(candidates.cost))
    start = candidates.unknowns[:, 3:]
    place = np.hstack([candidates.unknowns[:, :3], np.cos(start), np.sin(start), candidates.branch[:, None]])
    _, first = np.unique(np.round(place / cell).astype(np.int64), axis=0, return_index=True)
    return candidates.take(np.sort(first)[:count])


class _Search:
    """One request's search in one chart."""

    def __init__(
        self,
        levels: Levels,
        target: Target,
        limits: Limits,
        tolerance: float,
        clock: Callable[[], float],
        deadline: float,
        begin: float,
    ) -> None:
        self.levels, self.limits, self.tolerance = levels, limits, tolerance
        self.target = target
        self.clock, self.deadline, self.begin = clock, deadline, begin
        self.thin_target = _thinned(target)
        self.trace: list[tuple[float, float]] = []
        self.seeds = self.rounds = 0
        self.screen_seconds = 0.0
        self.random = np.random.default_rng(20)
        self.tables: dict[int, _Candidates] = {}
        self.taken: dict[int, int] = {}
        self.use(FullCrankChart())

    def use(self, chart: Chart) -> None:
        """Go on in another chart, with an empty pool."""
        self.chart = chart
        sheet = {"crank_rocker": -1, "double_crank": 1}.get(self.limits.family, 0)
        self.problem = Problem(self.thin_target, chart, sheet)
        self.pool = _NONE

    # -- seeds --------------------------------------------------------------------------------------------------------

    def table(self, index: int) -> _Candidates:
        """Best start of each type and branch of a level, thinned, best first."""
        if index not in self.tables:
            begin = self.clock()
            level = self.levels.levels[index]
            error = level.scan.error_table(self.thin_target)
            if self.limits.family in ("crank_rocker", "double_crank"):
                error[level.double_crank != (self.limits.family == "double_crank")] = np.inf
            best = error.argmin(axis=2)
            cost = np.take_along_axis(error, best[:, :, None], 2)[:, :, 0]
            parts = _NONE
            for side, branch in enumerate((1.0, -1.0)):
                start = best[:, side] * (TURN / level.scan.starts)
                unknowns = np.hstack([level.unknowns, start[:, None]])
                parts = parts.joined(_Candidates(unknowns, np.full(len(start), branch), cost[:, side]))
            parts = parts.take(np.isfinite(parts.cost))
            parts = parts.take(np.argsort(parts.cost, kind="stable"))
            cells = np.column_stack([np.floor(parts.unknowns / _CELL), parts.branch]).astype(np.int64) + 64
            key = cells @ np.array([1, 1 << 8, 1 << 16, 1 << 24, 1 << 32])
            _, first = np.unique(key, return_index=True)
            self.tables[index] = parts.take(np.sort(first))
            self.screen_seconds += self.clock() - begin
        return self.tables[index]

    def fresh(self, index: int, count: int) -> _Candidates:
        """The next seeds of a level, up to ``count`` of each branch in all rounds."""
        table = self.table(index)
        before = self.taken.get(index, 0)
        self.taken[index] = count
        places = [np.flatnonzero(table.branch == branch)[before:count] for branch in (1.0, -1.0)]
        return table.take(np.concatenate(places))

    # -- rounds -------------------------------------------------------------------------------------------------------

    def expired(self) -> bool:
        return self.clock() >= self.deadline

    def run(self, seeds: _Candidates, iterations: int) -> None:
        """Refine seeds and put them into the pool."""
        self.seeds += len(seeds.branch)
        self.rounds += 1
        tolerance = 0.3 * self.tolerance
        done = refine(self.problem, seeds.unknowns, seeds.branch, iterations, tolerance, self.expired)
        self.pool = self.pool.joined(_Candidates(done.unknowns, done.branch, done.cost))
        if self.limits.only_family:
            self.note(self.pool.cost)

    def note(self, cost: Floats) -> None:
        """Add the best objective so far to the trace."""
        best = float(np.sqrt(cost.min())) if cost.size else np.inf
        if self.trace:
            best = min(best, self.trace[-1][1])
        if np.isfinite(best):
            self.trace.append((self.clock() - self.begin, best))

    def hop(self, origins: int, copies: int) -> _Candidates:
        """Perturbed copies of the best of the pool: heavy tails reach the far ends of the chart, where change points lie."""
        best = _thin(self.pool, origins)
        steps = self.random.standard_t(3, size=(len(best.branch) * copies, 4)) * _HOP
        unknowns = np.repeat(best.unknowns, copies, axis=0) + steps
        return _Candidates(unknowns, np.repeat(best.branch, copies), np.full(len(steps), np.inf))

    def plan(self) -> list[Callable[[], object]]:
        """Rounds of growing effort; each is worth its time only where the ones before did not reach the tolerance."""
        return [
            lambda: self.run(self.fresh(0, 16), 15),
            lambda: self.run(self.fresh(0, 60).joined(_thin(self.pool, 12)), 20),
            lambda: self.run(self.hop(8, 6), 20),
            lambda: self.run(self.fresh(1, 150).joined(_thin(self.pool, 12)), 30),
            lambda: self.run(self.hop(15, 8), 40),
            lambda: self.run(self.hop(15, 12), 60),
            lambda: self.run(self.fresh(1, 400), 60),
            lambda: self.run(_thin(self.pool, 40), 200),
            lambda: self.run(self.hop(40, 12), 100),
            lambda: self.run(self.hop(80, 12), 100),
            lambda: self.run(_thin(self.pool, 12), 1000),
        ]

    def reached(self, pool: _Candidates) -> bool:
        return bool(pool.cost.size and pool.cost.min() < self.tolerance**2)

    def free_search(self, rounds: int | None = None) -> None:
        """Rounds without limits until reached, out of time or out of rounds."""
        for step in self.plan()[:rounds]:
            step()
            if self.reached(self.pool) or self.expired():
                return

    def continue_in(self, chart: AnyChart) -> None:
        """Go on in the chart of all four-bars, from the best so far and from types of all families."""
        lengths = self.lengths(self.pool)
        best = self.pool._replace(unknowns=np.hstack([chart.unknowns(lengths), self.pool.unknowns[:, 3:]]))
        self.use(chart)
        types = np.stack(np.meshgrid(*[_ANY_LENGTHS] * 4, indexing="ij"), axis=-1).reshape(-1, 4)
        types = np.unique(np.round(types / types[:, 3:], 9), axis=0)
        starts = np.arange(_ANY_STARTS) * (TURN / _ANY_STARTS)
        shapes = np.repeat(chart.unknowns(types), _ANY_STARTS, axis=0)
        unknowns = np.hstack([shapes, np.tile(starts, len(types))[:, None]])
        seeds = _thin(best, 20)
        for branch in (1.0, -1.0):
            side = np.full(len(unknowns), branch)
            cost = self.problem.evaluate(unknowns, side, derivatives=False).cost
            seeds = seeds.joined(_thin(_Candidates(unknowns, side, cost), 120, 0.7))
        for step in (
            lambda: self.run(seeds, 40),
            lambda: self.run(self.hop(20, 10), 60),
            lambda: self.run(self.hop(20, 10), 60),
            lambda: self.run(_thin(self.pool, 40), 300),
        ):
            step()
            if self.reached(self.pool) or self.expired():
                return

    def done(self, solutions: list[Solution]) -> bool:
        """Whether no further search is worth while, or there is no time for it."""
        return self.expired() or Status.of(solutions, self.tolerance) is Status.REACHED

    def polish(self, count: int, iterations: int = 30) -> _Candidates:
        """The best of the pool on all samples of the request."""
        best = _thin(self.pool, count, 0.02)
        if not best.branch.size:
            return best
        problem = self.problem
        if self.thin_target is not self.target:
            problem = Problem(self.target, self.chart, problem.sheet)
        done = refine(problem, best.unknowns, best.branch, iterations, 0.0, self.expired)
        return _Candidates(done.unknowns, done.branch, done.cost)

    def limited_search(self, top: int) -> list[Solution]:
        """Solutions that keep to the limits: penalties that grow until the candidates lie inside."""
        found: list[Solution] = []
        attempts = [
            lambda: _thin(self.pool, 30).joined(self.fresh(0, 100)),
            lambda: self.fresh(1, 300),
            lambda: self.hop(15, 12),
            self.nearest_to_limits,
        ]
        for attempt in attempts:
            if found and attempt == self.nearest_to_limits:
                break
            seeds = attempt()
            unknowns, branch = self.limited(_PENALTIES[0]).lift(seeds.unknowns, seeds.branch), seeds.branch
            self.seeds += len(branch)
            self.rounds += 1
            for penalty in _PENALTIES:
                last = penalty == _PENALTIES[-1]
                done = refine(self.limited(penalty), unknowns, branch, 60 if last else 20, 0.0, self.expired)
                best = np.argsort(done.cost, kind="stable")[: len(branch) if not last else 4 * top + 20]
                best = best[np.isfinite(done.cost[best])]
                unknowns, branch = done.unknowns[best], done.branch[best]
            found = distinct(found + self.finished(unknowns, branch), 2 * top + 4, APART)
            self.note(np.array([s.errors.objective for s in found[:1]]) ** 2)
            if self.done(found):
                break
        return found

    def nearest_to_limits(self) -> _Candidates:
        """Types and starts that break the limits least, whatever their motion: the last attempt before `infeasible`."""
        level = self.levels.levels[0]
        shapes = self.chart.unknowns(level.scan.lengths)
        starts = np.arange(_LIMIT_STARTS) * (TURN / _LIMIT_STARTS)
        unknowns = np.hstack([np.repeat(shapes, starts.size, axis=0), np.tile(starts, len(shapes))[:, None]])
        problem = self.limited(0.0)
        seeds = _NONE
        for branch in (1.0, -1.0):
            side = np.full(len(unknowns), branch)
            cost = self.problem.evaluate(unknowns, side, derivatives=False).cost
            slacks = np.nan_to_num(problem.slacks(problem.lift(unknowns, side)), nan=-1e3, neginf=-1e3)
            violation = np.sum(np.minimum(slacks, 0.0) ** 2, axis=1)
            order = np.where(np.isfinite(cost), violation + 1e-6 * cost, np.inf)
            seeds = seeds.joined(_thin(_Candidates(unknowns, side, order), 100, 0.3))
        return seeds

    def limited(self, penalty: float) -> LimitedProblem:
        return LimitedProblem(self.thin_target, self.chart, self.problem.sheet, self.limits, penalty)

    def finished(self, unknowns: Floats, branch: Floats) -> list[Solution]:
        """Limited candidates as solutions on all samples, those outside of the limits left out."""
        if not branch.size:
            return []
        problem = self.limited(0.0)
        links = problem.links(unknowns)
        start = unknowns[:, 3] % TURN
        closes = np.isfinite(close_loop(links, start[:, None] + self.target.crank).coupler_angle(branch)).all(axis=1)
        unknowns, links, branch, start = unknowns[closes], links[closes], branch[closes], start[closes]
        if not branch.size:
            return []
        solutions = finish_solutions(self.target, links, branch, start, problem.poses(unknowns))
        return _within(self.limits, self.target, solutions)

    def solutions(self, candidates: _Candidates) -> list[Solution]:
        """Candidates with their best pose as solutions, those outside of the limits left out."""
        if not candidates.branch.size:
            return []
        made = make_solutions(self.target, self.lengths(candidates), candidates.branch, candidates.unknowns[:, 3])
        return _within(self.limits, self.target, made)

    def lengths(self, candidates: _Candidates) -> Floats:
        return self.chart.shape(candidates.unknowns[:, :3]).lengths


def _thinned(target: Target) -> Target:
    """The target at no more than `SEARCH_SAMPLES` samples, both ends kept."""
    if target.samples <= SEARCH_SAMPLES:
        return target
    keep = np.unique(np.round(np.linspace(0, target.samples - 1, SEARCH_SAMPLES)).astype(int))
    return replace(
        target,
        crank=target.crank[keep],
        rotation=None if target.rotation is None else target.rotation[keep],
        position=None if target.position is None else target.position[keep],
    )


def mirrored(target: Target) -> Target:
    """The target in a mirror (the x axis): the crank turns the other way, and so does the body."""
    return replace(
        target,
        crank=-target.crank,
        rotation=None if target.rotation is None else -target.rotation,
        position=None if target.position is None else np.conj(target.position),
    )


def mirrored_solution(solution: Solution) -> Solution:
    """The linkage in a mirror, for the mirrored target; its errors are the same."""
    pose = solution.mount
    if pose is not None:
        pose = replace(
            pose,
            ground_angle=-pose.ground_angle,
            pivot_a=pose.pivot_a.conjugate(),
            pivot_b=pose.pivot_b.conjugate(),
            coupler_angle=-pose.coupler_angle,
        )
    offset = None if solution.body_offset is None else -solution.body_offset
    start = float(-solution.start % TURN)
    return replace(solution, branch=-solution.branch, start=start, body_offset=offset, mount=pose)


def search(
    levels: Levels,
    target: Target,
    limits: Limits,
    top: int,
    tolerance: float,
    clock: Callable[[], float],
    budget: float = np.inf,
) -> tuple[list[Solution], SearchReport]:
    """The best linkages for a motion.

    Parameters
    ----------
    levels : Levels
    target : Target
    limits : Limits
    top : int
        At most this many solutions, different from one another, best first.
    tolerance : float
        Stop the search when the objective is below it.
    clock : callable
        Seconds of a monotonic clock, asked all the time; what it raises ends the search.
    budget : float
        Seconds; the best found by then is returned.

    Returns
    -------
    solutions : list of Solution
        All within the limits. Law: a mirrored target gives the mirrored linkages.
    report : SearchReport
    """
    begin = clock()
    # a clockwise crank is a mirror image: one search serves both
    clockwise = target.span < 0
    if clockwise:
        target, limits = mirrored(target), limits.mirrored()
    run = _Search(levels, target, limits, tolerance, clock, begin + budget, begin)
    solutions: list[Solution] = []
    charts: list[Chart] = [FullCrankChart(), AnyChart()] if limits.family == "any" else [FullCrankChart()]
    for chart in charts:
        if isinstance(chart, FullCrankChart):
            run.free_search(None if limits.only_family else 2)
        else:
            run.continue_in(chart)
        # where the tolerance is reached, alternatives are worth a few steps, not a search of their own
        polished = run.polish(top + 4, 6 if run.reached(run.pool) else 30)
        solutions = distinct(solutions + run.solutions(polished), top, APART)
        run.note(np.array([s.errors.objective for s in solutions[:1]]) ** 2)
        if not limits.only_family and not run.done(solutions):
            solutions = distinct(solutions + run.limited_search(top), top, APART)
        if run.done(solutions):
            break
    report = _report(run, solutions, tolerance)
    if clockwise:
        solutions = [mirrored_solution(s) for s in solutions]
    return solutions, report


def _within(limits: Limits, target: Target, solutions: list[Solution]) -> list[Solution]:
    """Solutions that keep the limits, checked on the numbers of the reply."""
    if not solutions:
        return []
    links, start = np.stack([s.links for s in solutions]), np.array([s.start for s in solutions])
    pivots: tuple[NDArray[np.complex128] | None, ...] = (None, None)
    if target.position is not None:
        pivots = tuple(np.array([getattr(s.mount, name) for s in solutions]) for name in ("pivot_a", "pivot_b"))
    keeps = limits.family_holds(target, links, start)
    keeps &= np.isfinite([s.errors.objective for s in solutions])
    keeps &= np.all(limits.slacks(target, links, start, *pivots) >= 0, axis=1)
    return [s for s, keep in zip(solutions, keeps) if keep]


def _report(run: _Search, solutions: list[Solution], tolerance: float) -> SearchReport:
    best = solutions[0].errors.objective if solutions else np.inf
    if Status.of(solutions, tolerance) is Status.REACHED:
        stopped = StoppedBy.TOLERANCE
    else:
        stopped = StoppedBy.BUDGET if run.expired() else StoppedBy.CONVERGED
    # rounds see a thinned target or stop a rounding earlier: what counts is the objective of the reply's own numbers
    trace = [(seconds, max(objective, best)) for seconds, objective in run.trace] if solutions else []
    if solutions and (not trace or trace[-1][1] != best):
        trace.append((run.clock() - run.begin, best))
    return SearchReport(stopped, trace, run.screen_seconds, run.seeds, run.rounds)
