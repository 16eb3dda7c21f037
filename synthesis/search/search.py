"""The anytime search: seeds from a coarse table, refinement in rounds, until the tolerance is reached or time is up.

Data flow of a request::

    target --(clockwise: mirrored)--> squared errors of all windows of a coarse table (two matrix products)
      -> best start of each type and branch -> thinned out over cells of the chart -> seeds
      -> refine all at once -> pool -> reached? otherwise the next round of the schedule
      -> polish on all samples -> distinct solutions within the limits, with recomputed errors

If no linkage may be exact, or limits apply::

    windows of a coarse table in the best pose within the limits -> seeds; the first that satisfy all limits are answers
      -> rounds within the limits (`synthesis.search.multistart`) until they gain nothing

The rounds without limits increase in size: each runs only if the rounds before it did not reach the tolerance. Their
numbers were chosen on the random classes of the acceptance benchmark.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Floats
from synthesis.descents import Pool, Stage, Timed
from synthesis.fourbar.mechanism import BRANCHES, GrashofChart, search_spaces
from synthesis.limits import Limits
from synthesis.linkage import Linkage
from synthesis.mechanism import Chart
from synthesis.ranking import APART, Status, distinct
from synthesis.search.multistart import Incumbents, MultiStart
from synthesis.search.prescribed import GivenProblem, candidates_at
from synthesis.search.prescribed_timing import PrescribedTiming, PrescribedTimingOptions
from synthesis.search.report import SearchReport, stopped_by
from synthesis.search.seeds import FINER, SeedTables, Windows, thinned, windows_of
from synthesis.solution import assess
from synthesis.target import Target
from synthesis.violations import within
from synthesis.work import UNLIMITED, Work

# -- rounds --------------------------------------------------------------------------------------------------------


class Round(NamedTuple):
    """One round of a search without limits."""

    steps: int
    """Steps of the descent."""
    fresh: int = 0
    """Number of best starts of the coarse table, of each branch, up to this round."""
    best: int = 0
    """Number of the best basins that continue."""
    continue_all: bool = False
    """True if all descents continue to their end after an exact answer, to find alternatives."""


FIRST_ROUNDS = (Round(15, fresh=16, continue_all=True), Round(20, fresh=60, best=12))
"""Rounds before a search within limits: half of all reachable motions end in the first round, most in the second."""
FINAL_ROUND = Round(1000, best=12)
"""Round for a nearly exact solution, since narrow basins require many steps."""

# -- the search ----------------------------------------------------------------------------------------------------


DEFAULT_TOLERANCE = 1e-10
SEARCH_SAMPLES = 64
"""Number of samples in the rounds; longer requests are thinned for them and polished on all samples."""


@dataclass(frozen=True)
class TimedOptions:
    """Options of the search with prescribed timing that choose its rounds."""

    exact_near: float = 1e-6
    """Error below which no further round runs: only refinement remains."""
    close: float = 1e-2
    """Error below which an exact answer may be near."""
    nearer: float = 1e-5
    """Error below which an exact answer lies in the same narrow basin."""
    finished: int = 12
    """Number of candidates that are refined to machine precision at the end."""
    in_sight: float = 1e-4
    """Error below which further rounds look for an exact answer in another basin."""
    idle_in_sight: int = 6
    """Number of idle rounds that end the search for such an answer."""
    continued_damping: float = 1e-6
    """Damping of descents that continue where others ended."""
    polish_steps: int = 30
    """Number of steps of that refinement."""
    alternative_steps: int = 6
    """Number of steps for alternatives to an exact answer."""


OPTIONS = TimedOptions()


class _Search:
    """Search for a single request, in one chart at a time."""

    def __init__(
        self,
        tables: SeedTables,
        target: Target,
        limits: Limits,
        tolerance: float,
        work: Work,
        answers: Callable[[Sequence[Linkage]], list[Any]] | None = None,
    ) -> None:
        self.tables, self.answers = tables, answers or self._assessed
        self.target, self.limits, self.tolerance, self.work = target, limits, tolerance, work
        self.thin_target = target.thinned(SEARCH_SAMPLES)
        self.trace: list[tuple[float, float]] = []
        self.seeds = 0
        self.screen_seconds = 0.0
        self.screened: Pool | None = None
        self.taken = 0
        self.use(GrashofChart())

    def use(self, chart: Chart) -> None:
        """Continue in another chart, with an empty pool."""
        self.chart = chart
        self.problem = GivenProblem(self.thin_target, chart)
        nothing = np.empty(0)
        self.pool = Pool(candidates_at(np.empty((0, len(chart.cell) - 1)), nothing, nothing), nothing)

    # -- rounds without limits ----------------------------------------------------------------------------------------

    def _starts(self, plan: Round) -> Timed:
        """Return the starting points of a round."""
        starts = thinned(self.pool, plan.best).timed
        if not plan.fresh:
            return starts
        if self.screened is None:
            begin = self.work.elapsed
            self.screened = self.tables.best_starts(self.thin_target, self.limits.family)
            self.screen_seconds += self.work.elapsed - begin
        table, before, self.taken = self.screened.timed, self.taken, plan.fresh
        fresh = [np.flatnonzero(table.branch == branch)[before : plan.fresh] for branch in BRANCHES]
        return table.take(np.concatenate(fresh)).joined(starts)

    def free_search(self, *rounds: Round) -> None:
        """Run rounds without limits until the tolerance is reached or the time is up."""
        for plan in rounds:
            starts = self._starts(plan)
            self.seeds += len(starts.branch)
            found = self.problem.descended(
                starts,
                [Stage(plan.steps)],
                0.3 * self.tolerance,
                self.work,
                1e-3 if plan.fresh else OPTIONS.continued_damping,
                steps_after_first=np.inf if plan.continue_all else 0.0,
            )
            self.pool = self.pool.joined(found)
            if self.limits.only_family:
                self.note(self.pool.cost)
            if self.reached or self.work.expired():
                return

    @property
    def reached(self) -> bool:
        """Return True if the pool has a candidate below the tolerance."""
        return bool(self.pool.cost.size and self.pool.cost.min() < self.tolerance**2)

    def note(self, cost: Floats) -> None:
        """Add the smallest objective to the trace."""
        best = float(np.sqrt(cost.min())) if cost.size else np.inf
        if self.trace:
            best = min(best, self.trace[-1][1])
        if np.isfinite(best):
            self.trace.append((self.work.elapsed, best))

    def done(self, solutions: list[Any]) -> bool:
        """Return True if the tolerance is reached or the work has expired."""
        return self.work.expired() or Status.of(solutions, self.tolerance) is Status.REACHED

    def polished(self, count: int, iterations: int) -> list[Any]:
        """Refine the best of the pool on all samples of the request; return the solutions within the limits."""
        best = thinned(self.pool, count, 0.02).timed
        if not best.branch.size:
            return []
        problem = self.problem if self.thin_target is self.target else GivenProblem(self.target, self.chart)
        found = problem.descended(best, [Stage(iterations)], 0.0, self.work, steps_after_first=np.inf)
        return self.answers(problem.linkages(found))

    def _assessed(self, linkages: Sequence[Linkage]) -> list[Any]:
        """Return linkages within the limits with their errors."""
        return within(self.target, self.limits, assess(self.target, linkages))

    # -- within limits, or if no linkage is exact ---------------------------------------------------------------------

    def try_without_limits(self, rounds: Sequence[Round], top: int) -> list[Any]:
        """Search without limits, and return the refined solutions that satisfy the limits nevertheless.

        Return none if no round comes close to an exact solution. ``top`` is the number of solutions requested.
        """
        if not self.reached:
            self.free_search(*rounds)
        is_close = self.pool.cost.min(initial=np.inf) < OPTIONS.close**2
        if not (is_close or self.limits.only_family):
            return []
        if not self.reached and self.pool.cost.min() < OPTIONS.nearer**2:
            self.free_search(FINAL_ROUND)
        # if the tolerance is reached, alternatives are worth a few steps, not another search
        return self.polished(
            max(top + 4, OPTIONS.finished),
            OPTIONS.polish_steps if is_close and not self.reached else OPTIONS.alternative_steps,
        )

    def bounded_search(self, solutions: list[Any], top: int) -> list[Any]:
        """Continue within the limits, in each chart in turn; return new solutions and the better ones of the given solutions."""
        spaces = search_spaces(self.target, self.limits)
        if self.target.start is not None or self.target.offset is not None:
            spaces = []  # these spaces treat the start and the offset as unknowns
        is_tested = self.limits.only_family
        if not spaces:
            solutions = solutions if is_tested else self.try_without_limits(FIRST_ROUNDS[:1], top)
            self.free_search(FINAL_ROUND)
            return solutions + self.polished(OPTIONS.finished, OPTIONS.polish_steps)
        first, solutions = solutions, []
        found = Incumbents(self.tolerance, lambda objective: self.note(np.array([objective**2])))
        for space in spaces:
            # the first search space contains only full cranks, so that a larger family never gives a worse result
            family = "full_crank" if self.limits.family == "any" and space is spaces[0] else self.limits.family
            options = PrescribedTimingOptions()
            problem = PrescribedTiming(self.target, space, self.tolerance, found.awaited(self.work), options)
            run = MultiStart(problem, found, self.work, options)
            seeds = problem.seeds(windows_of(family), run)
            late = self.work.expired() and space.chart in found.pools
            begin = [] if late else list(islice(seeds, 1))
            if not (begin or late) and len(space.types):
                seeds = problem.seeds(Windows(space.types, FINER), run)
                begin = list(islice(seeds, 1))
            max_error = 0.0 if late else np.inf
            if not (is_tested or late):  # a single round shows if an exact answer satisfies the limits
                first, is_tested = self.try_without_limits(FIRST_ROUNDS[:1], top), True
                self.note(np.array([solution.errors.objective for solution in first]) ** 2)
                if Status.of(first, self.tolerance) is Status.REACHED:
                    if len(first) >= top:
                        return first
                    max_error = 1  # for alternatives
            all_seeds = chain(begin, seeds)
            for idle in (run.options.idle_rounds, OPTIONS.idle_in_sight):
                run.options = replace(run.options, idle_rounds=idle)
                for round_seeds in run.run(all_seeds, max_error):
                    self.seeds += len(round_seeds.branch)
                    if found.smallest < OPTIONS.exact_near or self.work.expired():
                        break
                if space.chart in found.pools:
                    solutions = solutions + self._finished(problem, found.pools[space.chart], top)
                smallest = min((solution.errors.objective for solution in solutions), default=np.inf)
                # if J is so small, an exact answer may lie in another basin
                if self.reached or self.work.expired() or not self.tolerance < smallest < OPTIONS.in_sight:
                    break
            if self.done(sorted(solutions, key=lambda solution: solution.errors.objective)):
                break
        best = min((solution.errors.objective for solution in solutions), default=np.inf)
        reached = Status.of(first, self.tolerance) is Status.REACHED
        return solutions + [solution for solution in first if reached or solution.errors.objective < best]

    def _finished(self, problem: PrescribedTiming, pool: Pool, top: int) -> list[Any]:
        """Return the solutions of a pool; near an exact answer also without limits."""
        solutions = self.answers(problem.within.linkages(pool.take(slice(0, 8 * top + 20))))
        close = pool.take(pool.cost < OPTIONS.close**2)
        if close.cost.size:
            self.use(problem.chart)
            self.pool = close
            solutions = solutions + self.polished(OPTIONS.finished, 100)
            if not self.reached and close.cost.min() < OPTIONS.nearer**2:
                self.free_search(FINAL_ROUND)
                solutions = solutions + self.polished(OPTIONS.finished, OPTIONS.polish_steps)
        return list(solutions)

    def report(self, solutions: list[Any]) -> SearchReport:
        """Return the report of the search with the errors of the returned solutions."""
        best = solutions[0].errors.objective if solutions else np.inf
        stopped = stopped_by(solutions, self.tolerance, self.work)
        # rounds use thinned samples and end with rounding errors: recompute the objective from the linkage
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
    work: Work = UNLIMITED,
    answers: Callable[[Sequence[Linkage]], list[Any]] | None = None,
) -> tuple[list[Any], SearchReport]:
    """Find the best linkages for a motion.

    Parameters
    ----------
    tables : SeedTables
    target : Target
    limits : Limits
    top : int
        Largest number of solutions; they differ from each other, best first.
    tolerance : float
        Objective below which the search ends.
    work : Work, optional
        When it expires, the best solutions found are returned.
    answers : callable, optional
        Makes answers of linkages and omits those outside the limits. Default: their errors, and all limits.

    Returns
    -------
    solutions : list
        Answers within the limits. A mirrored target gives the mirrored linkages.
    report : SearchReport
    """
    clockwise = target.clockwise
    if clockwise:  # the same search serves both mirror images
        target, limits = target.mirrored(), limits.mirrored()
    run = _Search(tables, target, limits, tolerance, work, answers)
    solutions: list[Any] = []
    if limits.only_family:
        solutions = run.try_without_limits(FIRST_ROUNDS, top)
    run.note(np.array([s.errors.objective for s in solutions]) ** 2)
    if not (run.done(solutions) or (solutions and run.reached)):
        solutions = run.bounded_search(solutions, top)
    solutions = distinct(solutions, top, APART, exact=tolerance)
    report = run.report(solutions)
    return [s.mirrored() for s in solutions] if clockwise else solutions, report
