"""The anytime search: seeds from a coarse table, refinement in rounds, until the tolerance is reached or time is up.

Data flow of a request::

    target --(clockwise: mirrored)--> squared errors of all windows of a coarse table (two matrix products)
      -> best start of each type and branch -> thinned out over cells of the chart -> seeds
      -> refine all at once -> pool -> reached? otherwise the next round of the schedule
      -> polish on all samples -> solutions, recomputed from their numbers, different from one another, within the limits
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.least_squares import minimise
from synthesis.mechanism import Chart, Limits
from synthesis.ranking import APART, Status, distinct
from synthesis.search import schedule
from synthesis.search.limited import LimitedProblem
from synthesis.search.projected import ProjectedProblem
from synthesis.search.schedule import Round
from synthesis.search.seeds import Candidates, SeedTables, grid
from synthesis.target import Target
from synthesis.work import Work

Floats = NDArray[np.float64]

DEFAULT_TOLERANCE = 1e-10
SEARCH_SAMPLES = 64
"""Samples that the rounds look at; longer requests are thinned for them and polished on all samples."""


class StoppedBy(StrEnum):
    """Why a search ended."""

    TOLERANCE = "tolerance"
    CONVERGED = "converged"
    BUDGET = "budget"


class SearchReport(NamedTuple):
    """How a search went."""

    stopped_by: StoppedBy
    trace: list[tuple[float, float]]
    """Seconds of its work, best objective within the limits."""
    screen_seconds: float
    seeds: int
    settled: bool = True
    """False where the best was still getting better when the steps that it is given were used up."""


class Starts(NamedTuple):
    """Shapes and starts of candidates, best first."""

    lengths: Floats
    """(n, d), any scale."""
    branch: Floats
    start: Floats
    """theta1 at the first sample, (n,)."""


class _Search:
    """One request's search, in one chart at a time."""

    def __init__(
        self, tables: SeedTables, target: Target, limits: Limits, tolerance: float, work: Work, chart: Chart
    ) -> None:
        self.tables, self.mechanism = tables, tables.mechanism
        self.target, self.limits, self.tolerance, self.work = target, limits, tolerance, work
        self.thin_target = target.thinned(SEARCH_SAMPLES)
        self.trace: list[tuple[float, float]] = []
        self.seeds = 0
        self.screen_seconds = 0.0
        self.random = np.random.default_rng(20)
        self.screened: dict[int, Candidates] = {}
        self.taken: dict[int, int] = {}
        self.use(chart)

    def use(self, chart: Chart) -> None:
        """Go on in another chart, with an empty pool."""
        self.chart = chart
        self.problem = ProjectedProblem(self.thin_target, chart)
        self.pool = Candidates.none(len(chart.cell))

    # -- seeds --------------------------------------------------------------------------------------------------------

    def draw(self, sources: Sequence[schedule.Source]) -> Candidates:
        """The seeds of a round."""
        return Candidates.none(len(self.chart.cell)).joined(*(self._draw(source) for source in sources))

    def _draw(self, source: schedule.Source) -> Candidates:
        match source:
            case schedule.Fresh():
                return self._fresh(source.table, source.most)
            case schedule.Best():
                return self.pool.thinned(source.most)
            case schedule.Hops():
                best = self.pool.thinned(source.origins)
                size = (len(best.branch) * source.copies, len(self.chart.hop))
                unknowns = np.repeat(best.unknowns, source.copies, axis=0)
                noise = self.random.standard_t(3, size=size) * self.chart.hop
                if self.target.start is not None:
                    noise[:, -1] = 0.0
                unknowns = unknowns + noise
                return Candidates(unknowns, np.repeat(best.branch, source.copies), np.full(len(unknowns), np.inf))
            case schedule.Grid():
                unknowns = grid(self.chart.unknowns(self.chart.types), source.starts, self.target.start)
                return self._each_branch(unknowns, source.most, 0.7, lambda branch, cost: cost)
            case schedule.NearestToLimits():
                unknowns = grid(self.chart.unknowns(self.tables.tables[0].scan.lengths), source.starts)
                return self._each_branch(
                    unknowns, source.most, 0.3, lambda branch, cost: self._violation(unknowns, branch) + 1e-6 * cost
                )

    def _fresh(self, index: int, count: int) -> Candidates:
        if index not in self.screened:
            begin = self.work.elapsed
            self.screened[index] = self.tables.best_starts(index, self.thin_target, self.limits.family)
            self.screen_seconds += self.work.elapsed - begin
        table, before = self.screened[index], self.taken.get(index, 0)
        self.taken[index] = count
        places = [np.flatnonzero(table.branch == branch)[before:count] for branch in self.mechanism.branches]
        return table.take(np.concatenate(places))

    def _each_branch(self, unknowns: Floats, count: int, cell: float, order: Any) -> Candidates:
        """The first ``count`` of each branch by an order of those that close, at most one a cell."""
        parts = []
        for branch in self.mechanism.branches:
            side = np.full(len(unknowns), float(branch))
            cost = self.problem.evaluate(unknowns, side, derivatives=False).cost
            ranked = np.where(np.isfinite(cost), order(side, cost), np.inf)
            parts.append(Candidates(unknowns, side, ranked).thinned(count, cell))
        return parts[0].joined(*parts[1:])

    def _violation(self, unknowns: Floats, branch: Floats) -> Floats:
        """Sum of the squares by which limits are broken in the best pose."""
        problem = self.limited(0.0)
        slacks = np.nan_to_num(problem.slacks(problem.with_pose(unknowns, branch)), nan=-1e3, neginf=-1e3)
        return np.sum(np.minimum(slacks, 0.0) ** 2, axis=1)

    # -- rounds -------------------------------------------------------------------------------------------------------

    def free_search(self, rounds: Sequence[Round], further: bool = False) -> None:
        """Rounds without limits until reached, out of time or out of rounds; in a further chart with a pool of its own."""
        for one in rounds:
            seeds = self.draw(one.sources)
            if further and one is rounds[0]:
                self.pool = Candidates.none(len(self.chart.cell))
            self.seeds += len(seeds.branch)
            found = minimise(
                self.problem.evaluate, seeds.unknowns, seeds.branch, one.iterations, 0.3 * self.tolerance, self.work
            )
            self.pool = self.pool.joined(Candidates(found.unknowns, seeds.branch, found.cost))
            if self.limits.only_family:
                self.note(self.pool.cost)
            if self.reached or self.work.expired():
                return

    def continue_in(self, chart: Chart) -> None:
        """Go on in a further chart, from the best so far and from its own types."""
        lengths = self.chart.shape(self.pool.unknowns[:, :-1]).lengths
        best = self.pool._replace(unknowns=np.hstack([chart.unknowns(lengths), self.pool.unknowns[:, -1:]]))
        self.use(chart)
        self.pool = best
        self.free_search(schedule.FURTHER_CHART, further=True)

    @property
    def reached(self) -> bool:
        """Whether the pool holds a candidate below the tolerance."""
        return bool(self.pool.cost.size and self.pool.cost.min() < self.tolerance**2)

    def note(self, cost: Floats) -> None:
        """Add the best objective so far to the trace."""
        best = float(np.sqrt(cost.min())) if cost.size else np.inf
        if self.trace:
            best = min(best, self.trace[-1][1])
        if np.isfinite(best):
            self.trace.append((self.work.elapsed, best))

    def done(self, solutions: list[Any]) -> bool:
        """Whether the tolerance is reached or the time is up."""
        return self.work.expired() or Status.of(solutions, self.tolerance) is Status.REACHED

    def polished(self, count: int, iterations: int) -> list[Any]:
        """The best of the pool, refined on all samples of the request, as solutions within the limits."""
        best = self.pool.thinned(count, 0.02)
        if not best.branch.size:
            return []
        problem = self.problem
        if self.thin_target is not self.target:
            problem = ProjectedProblem(self.target, self.chart)
        found = minimise(problem.evaluate, best.unknowns, best.branch, iterations, 0.0, self.work).unknowns
        lengths = self.chart.shape(found[:, :-1]).lengths
        linkages = self.mechanism.mounted(self.target, lengths, best.branch, found[:, -1])
        return self.limits.within(self.target, self.mechanism.assess(self.target, linkages))

    # -- within limits ------------------------------------------------------------------------------------------------

    def limited(self, penalty: float) -> LimitedProblem:
        """The problem within limits, with a weight of broken ones."""
        return LimitedProblem(self.mechanism, self.thin_target, self.chart, self.limits, penalty)

    def limited_search(self, top: int) -> list[Any]:
        """Solutions that keep to the limits: penalties that grow until the candidates lie inside."""
        found: list[Any] = []
        for one in (*schedule.LIMITED, schedule.LAST_RESORT):
            if found and one is schedule.LAST_RESORT:
                break
            seeds = self.draw(one.sources)
            unknowns, branch = self.limited(0.0).with_pose(seeds.unknowns, seeds.branch), seeds.branch
            self.seeds += len(branch)
            for index, (penalty, iterations) in enumerate(schedule.PENALTIES, 1):
                kept = 4 * top + 20 if index == len(schedule.PENALTIES) else len(branch)
                done = minimise(self.limited(penalty).evaluate, unknowns, branch, iterations, 0.0, self.work)
                best = np.argsort(done.cost, kind="stable")[:kept]
                best = best[np.isfinite(done.cost[best])]
                unknowns, branch = done.unknowns[best], branch[best]
            found = distinct(found + self._finished(unknowns, branch), 2 * top + 4, APART)
            self.note(np.array([s.errors.objective for s in found[:1]]) ** 2)
            if self.done(found):
                break
        return found

    def _finished(self, unknowns: Floats, branch: Floats) -> list[Any]:
        """Limited candidates as solutions on all samples, those outside of the limits left out."""
        problem = self.limited(0.0)
        start = unknowns[:, len(self.chart.cell) - 1, None]
        angle = self.mechanism.body_angle(problem.lengths(unknowns), branch, start + self.target.crank)
        closes = np.isfinite(angle).all(axis=1)
        solutions = self.mechanism.assess(self.target, problem.linkages(unknowns[closes], branch[closes]))
        return self.limits.within(self.target, solutions)

    def report(self, solutions: list[Any]) -> SearchReport:
        """How it went, by the objectives of the solutions that are returned."""
        best = solutions[0].errors.objective if solutions else np.inf
        if Status.of(solutions, self.tolerance) is Status.REACHED:
            stopped = StoppedBy.TOLERANCE
        else:
            stopped = StoppedBy.BUDGET if self.work.expired() else StoppedBy.CONVERGED
        # rounds see a thinned target or stop a rounding earlier: what counts is the objective of the reply's own numbers
        trace = [(seconds, max(objective, best)) for seconds, objective in self.trace] if solutions else []
        if solutions and (not trace or trace[-1][1] != best):
            trace.append((self.work.elapsed, best))
        return SearchReport(stopped, trace, self.screen_seconds, self.seeds)


def search(
    tables: SeedTables,
    target: Target,
    limits: Limits,
    top: int,
    tolerance: float = DEFAULT_TOLERANCE,
    work: Work | None = None,
) -> tuple[list[Any], SearchReport]:
    """The best linkages for a motion.

    Parameters
    ----------
    tables : SeedTables
        Of the mechanism that is wanted.
    target : Target
    limits : Limits
    top : int
        At most this many solutions, different from one another, best first.
    tolerance : float
        Stop the search when the objective is below it.
    work : Work, optional
        Once it has expired the best found so far is returned.

    Returns
    -------
    solutions : list
        The mechanism's solutions, all within the limits. Law: a mirrored target gives the mirrored linkages.
    report : SearchReport
    """
    clockwise = target.clockwise
    if clockwise:  # a mirror image: one search serves both
        target, limits = target.mirrored(), limits.mirrored()
    first, *further = tables.mechanism.charts(limits.family)
    run = _Search(tables, target, limits, tolerance, work or Work(), first)
    solutions: list[Any] = []
    for chart in (first, *further):
        if chart is first:
            run.free_search(schedule.FREE if limits.only_family else schedule.FIRST_LOOK)
        else:
            run.continue_in(chart)
        # where the tolerance is reached, alternatives are worth a few steps, not a search of their own
        solutions = distinct(solutions + run.polished(top + 4, 6 if run.reached else 30), top, APART)
        run.note(np.array([s.errors.objective for s in solutions[:1]]) ** 2)
        if not limits.only_family and not run.done(solutions):
            solutions = distinct(solutions + run.limited_search(top), top, APART)
        if run.done(solutions):
            break
    report = run.report(solutions)
    return [s.mirrored() for s in solutions] if clockwise else solutions, report


def first_look(tables: SeedTables, target: Target, limits: Limits, count: int, work: Work) -> Starts:
    """Where good motions lie among full cranks, whatever other limits there are: a few rounds, nothing polished.

    Parameters
    ----------
    tables : SeedTables
    target : Target
        With a crank that turns counter-clockwise.
    limits : Limits
        Of which only the family counts.
    count : int
        At most so many.
    work : Work
    """
    run = _Search(tables, target, limits, DEFAULT_TOLERANCE, work, tables.mechanism.charts(limits.family)[0])
    run.free_search(schedule.FIRST_LOOK)
    best = run.pool.thinned(count)
    return Starts(run.chart.shape(best.unknowns[:, :-1]).lengths, best.branch, best.unknowns[:, -1])
