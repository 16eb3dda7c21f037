"""The anytime search: seeds from a coarse table, refinement in rounds, until the tolerance is reached or time is up.

Data flow of a request::

    target --(clockwise: mirrored)--> squared errors of all windows of a coarse table (two matrix products)
      -> best start of each type and branch -> thinned out over cells of the chart -> seeds
      -> refine all at once -> pool -> reached? otherwise the next round of the schedule
      -> polish on all samples -> solutions, recomputed from their numbers, different from one another, within the limits

Where no linkage may be exact, or limits hold::

    windows of a coarse table in the best pose within the limits -> seeds, the first that keep all limits are answers
      -> descents under constraints, in rounds: seeds first, then further seeds and hops about the best valleys
      -> the best of each round moved onto the limits that they still break: answers
      -> the best valleys of all rounds, descended to their end on all samples

Rounds grow: one runs only where those before it did not reach the tolerance. Their numbers were chosen on
the random classes of the acceptance benchmark.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.least_squares import minimise
from synthesis.mechanism import Bounded, Chart, Limits, Mechanism
from synthesis.ranking import APART, Status, distinct
from synthesis.search.problems import Descended, Plan, PosedProblem, ProjectedProblem, descend, problem_of, restored
from synthesis.search.seeds import Candidates, SeedTables, Windows
from synthesis.target import TURN, Target
from synthesis.work import Work

Floats = NDArray[np.float64]

# -- rounds --------------------------------------------------------------------------------------------------------


class Fresh(NamedTuple):
    """The next best starts of the coarse table, up to ``most`` of each branch in all rounds."""

    most: int


class Best(NamedTuple):
    """The best of the pool, at most one a small cell."""

    most: int


class Hops(NamedTuple):
    """Perturbed copies of the best of the pool; heavy tails reach the far ends of the chart, where change points lie."""

    origins: int
    copies: int


class Edges(NamedTuple):
    """The best starts of shapes at the far ends of the chart, where the coarse table has none."""

    most: int


Source = Fresh | Best | Hops | Edges


class Round(NamedTuple):
    """One round of a search."""

    sources: tuple[Source, ...]
    iterations: int
    """Steps of the descent."""
    reason: str
    near: float = np.inf
    """The round is left out where the least J so far is above it."""
    damping: float = 1e-3
    """Of the first step."""


_GOING_ON = 1e-6
"""Damping of descents that go on where others ended."""

FIRST_LOOK = (
    Round((Fresh(16),), 15, "half of all reachable motions end here"),
    Round((Best(8),), 60, "narrow valleys: short spans and short cranks", near=1e-4, damping=_GOING_ON),
    Round((Fresh(60), Best(12)), 20, "more valleys, and the best so far go on"),
)
"""Before a search within limits: most exact answers are found here."""

TO_THE_END = (
    Round((Best(12),), 1000, "narrow valleys take many steps", damping=_GOING_ON),
    Round((Edges(100),), 30, "next to change points"),
    Round((Hops(40, 12),), 100, "short spans and change points: hops from many places"),
    Round((Best(12),), 1000, "what still falls, to its end", damping=_GOING_ON),
)
"""Where an exact answer is near."""

# -- within limits -------------------------------------------------------------------------------------------------


_SAMPLES, _FINE = 16, 48
"""Samples that descents begin with, and go on with."""
_SEEDS, _FURTHER = 60, 100
"""Seeds of the first round, and of each later one."""
_FIRST = 24
"""Seeds that may be answers at once."""
_PROMISING, _VALLEYS = 48, 24
"""Candidates of a round that go on after the first steps, and after those that follow."""
_ORIGINS, _COPIES = 8, 8
_ROUNDS = 4
_GAIN = 2e-3
"""A round after the first that lowers J by a smaller part ends the search."""
_EXACT_NEAR = 1e-6
"""J below which more rounds are of no use: what is left is to refine."""
_ALIKE = 1e-3
"""Candidates whose J^2 differ by a smaller part lie in one valley."""
_SAME_LENGTHS = 0.3
"""Logarithms of lengths by which candidates of one valley differ at most."""
_OPTIMA = 14
_BROKEN = 100.0
"""What the square of the amount by which a candidate still breaks a limit counts beside J^2."""
_KEPT = 1e-13
"""To which an answer must keep equations; other constraints it keeps entirely."""

_TRY = Plan(5, (0.1, 0.3), 3)
_DOWN = Plan(10, (1.0, 3.0, 10.0), 4)
_ON = Plan(20, (10.0, 30.0, 100.0, 300.0, 1000.0), 4)
_TO_THE_END = Plan(80, (10.0, 30.0, 100.0, 300.0, 1000.0), 4)


class LimitedSearch:
    """The search for a target within limits; the best seeds that keep them are answers at once.

    Parameters
    ----------
    target : Target
        With a crank that turns counter-clockwise.
    way : Bounded
        The limits, and the chart in which to look.
    windows : Windows
    work : Work
    note : callable
        Called with J squared of answers as they are found.
    """

    def __init__(
        self, target: Target, way: Bounded, windows: Windows, work: Work, note: Callable[[Floats], None]
    ) -> None:
        self.work, self.note = work, note
        self.rough, self.fine = (problem_of(target.condensed(samples), way) for samples in (_SAMPLES, _FINE))
        self.whole = problem_of(target, way)
        # far random numbers, the same for every request
        self.random = np.random.default_rng(20)
        self.seeds = windows.seeds(self.rough, way.on_shape, way.boxes)
        self.used = 0
        """How many seeds were taken."""
        nothing = np.empty(0)
        self.pool = Descended(np.empty((0, self.rough.unknowns)), nothing, nothing, nothing)
        self.answers = self.pool
        self._first_answers()

    def search(self, wanted: int) -> Descended:
        """Rounds until one gains nothing; the answers, best first, of different valleys, every one within the limits.

        Parameters
        ----------
        wanted : int
            So many of the best are descended to their end.
        """
        self.round(*self.fresh(_SEEDS))
        for number in range(1, _ROUNDS):
            best = self.least()
            if self.work.expired() or best < _EXACT_NEAR:
                break
            hops, fresh = self.hops(1.0 if number % 2 else 0.5), self.fresh(_FURTHER)
            self.round(*(np.concatenate(pair) for pair in zip(hops, fresh)))
            if self.least() > best * (1 - _GAIN) and np.isfinite(best):
                break
        return self.optima(wanted)

    def least(self) -> float:
        """The best J so far."""
        return float(np.sqrt(self.answers.cost.min(initial=np.inf)))

    def fresh(self, count: int) -> tuple[Floats, Floats]:
        """The next seeds."""
        part = slice(self.used, self.used + count)
        self.used += count
        return self.seeds.unknowns[part], self.seeds.branch[part]

    def hops(self, width: float) -> tuple[Floats, Floats]:
        """Perturbed copies of the best valleys."""
        best = _valleys(self.pool, _ORIGINS, 5 * _ALIKE, slack=_BROKEN)
        unknowns, branch = np.repeat(best.unknowns, _COPIES, axis=0), np.repeat(best.branch, _COPIES)
        flipped = self.random.random(len(branch)) < 0.12
        return self.rough.hopped(unknowns, self.random, width), np.where(flipped, -branch, branch)

    def _first_answers(self) -> None:
        """The best seeds, where they keep the limits or can be moved onto them."""
        unknowns, branch = self.seeds.unknowns[:_FIRST], self.seeds.branch[:_FIRST]
        if len(branch):
            self.keep(restored(self.whole, Descended(unknowns, branch, np.empty(0), np.empty(0)), 4))

    def round(self, unknowns: Floats, branch: Floats) -> None:
        """Descents from some candidates; those of the best valleys go on, and are moved onto the limits."""
        if len(branch):
            found = descend(self.rough, unknowns, branch, _TRY, self.work)
            found = _valleys(found, _PROMISING, 0.0, slack=1.0)
            found = descend(self.rough, found.unknowns, found.branch, _DOWN, self.work)
            found = _valleys(found, _VALLEYS, _ALIKE, slack=3.0)
            found = descend(self.fine, found.unknowns, found.branch, _ON, self.work)
            found = restored(self.whole, found)
            self.pool = self.pool.joined(found)
            self.keep(found)

    def optima(self, wanted: int) -> Descended:
        """The best valleys descended to their end, one of each, with what was found on the way."""
        best = _valleys(self.pool, max(wanted, _OPTIMA), _ALIKE, slack=_BROKEN)
        if len(best.branch) and not (self.answers.cost.size and self.work.expired()):
            plan = _TO_THE_END._replace(awaited=wanted)
            self.keep(restored(self.whole, descend(self.whole, best.unknowns, best.branch, plan, self.work)))
        return self._of_each_valley(self.answers)

    def _of_each_valley(self, found: Descended) -> Descended:
        """The best of those of nearly the same cost and lengths, best first."""
        found = _valleys(found, len(found.branch), 1e-6)
        lengths = np.log(self.whole.chart.shape(found.unknowns[:, : self.whole.size]).lengths)
        if not isinstance(self.whole, PosedProblem):
            lengths = lengths - lengths.mean(axis=1, keepdims=True)
        kept: list[int] = []
        for k in range(len(found.branch)):
            same = (found.cost[k] <= found.cost[kept] * (1 + 10 * _ALIKE)) & (found.branch[k] == found.branch[kept])
            if not np.any(same & np.all(np.abs(lengths[k] - lengths[kept]) < _SAME_LENGTHS, axis=1)):
                kept.append(k)
        return found.take(np.array(kept, dtype=int))

    def keep(self, found: Descended) -> None:
        """Take those that keep the limits as answers; of a descent that the time cut short only where there are none yet.

        More time would lead it elsewhere, and an answer must not be lost by that.
        """
        if self.answers.cost.size and self.work.expired():
            return
        inside = found.take((found.broken <= _KEPT) & np.isfinite(found.cost))
        self.answers = self.answers.joined(inside)
        self.note(inside.cost)


def _valleys(found: Descended, count: int, alike: float, slack: float = 0.0) -> Descended:
    """The best candidates of different cost; what breaks limits counts ``slack`` times the square of that beside J^2."""
    merit = found.cost + slack * found.broken**2
    order = np.argsort(merit, kind="stable")
    order = order[np.isfinite(merit[order])]
    kept: list[int] = []
    last = -np.inf
    for place in order.tolist():
        if len(kept) == count:
            break
        if merit[place] > last * (1 + alike) or last < 0:
            kept.append(place)
            last = merit[place]
    return found.take(np.array(kept, dtype=int))


# -- the search ----------------------------------------------------------------------------------------------------


DEFAULT_TOLERANCE = 1e-10
SEARCH_SAMPLES = 64
"""Samples that the rounds look at; longer requests are thinned for them and polished on all samples."""


_NEAR, _NEARER, _FINISHED = 1e-2, 1e-5, 12
"""J from which on an exact answer may be near, and how many candidates are then refined to machine precision.
From the second on it does, in a narrow valley."""


_BENT_BELOW = 1e-3
"""J from which on valleys are narrow: steps are bent along them."""
_EDGE_STARTS, _EDGE_SAMPLES = 24, 12
_FEW_STEPS = 6
"""That are worth while for alternatives to an exact answer."""


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
        self,
        tables: SeedTables,
        target: Target,
        limits: Limits,
        tolerance: float,
        work: Work,
        mechanism: Mechanism | None = None,
    ) -> None:
        self.tables, self.mechanism = tables, mechanism or tables.mechanism
        self.target, self.limits, self.tolerance, self.work = target, limits, tolerance, work
        self.thin_target = target.thinned(SEARCH_SAMPLES)
        self.trace: list[tuple[float, float]] = []
        self.seeds = 0
        self.screen_seconds = 0.0
        self.random = np.random.default_rng(20)
        self.screened: Candidates | None = None
        self.taken = 0
        self.use(self.mechanism.charts(limits.family)[0])

    def use(self, chart: Chart) -> None:
        """Go on in another chart, with an empty pool."""
        self.chart = chart
        self.problem = ProjectedProblem(self.thin_target, chart)
        self.pool = Candidates.none(len(chart.cell))

    # -- seeds --------------------------------------------------------------------------------------------------------

    def draw(self, sources: Sequence[Source]) -> Candidates:
        """The seeds of a round."""
        return Candidates.none(len(self.chart.cell)).joined(*(self._draw(source) for source in sources))

    def _draw(self, source: Source) -> Candidates:
        match source:
            case Fresh():
                return self._fresh(source.most)
            case Best():
                return self.pool.thinned(source.most)
            case Edges():
                return self._edges(source.most)
            case Hops():
                best = self.pool.thinned(source.origins)
                size = (len(best.branch) * source.copies, len(self.chart.hop))
                unknowns = np.repeat(best.unknowns, source.copies, axis=0)
                noise = self.random.standard_t(3, size=size) * self.chart.hop
                if self.target.start is not None:
                    noise[:, -1] = 0.0
                unknowns = unknowns + noise
                return Candidates(unknowns, np.repeat(best.branch, source.copies), np.full(len(unknowns), np.inf))

    def _edges(self, count: int) -> Candidates:
        shapes, starts = self.chart.edges, np.arange(_EDGE_STARTS) * (TURN / _EDGE_STARTS)
        if self.target.start is not None:
            starts = np.array([self.target.start % TURN])
        size = len(shapes) * starts.size
        each = np.column_stack([np.repeat(shapes, starts.size, axis=0), np.tile(starts, len(shapes))])
        few = ProjectedProblem(self.thin_target.thinned(_EDGE_SAMPLES), self.chart)
        found = Candidates.none(len(self.chart.cell))
        for branch in self.mechanism.branches if size else ():
            side = np.full(size, float(branch))
            cost = few.evaluate(each, side, derivatives=False).cost.reshape(-1, starts.size)
            best = cost.argmin(axis=1) + starts.size * np.arange(len(shapes))
            found = found.joined(Candidates(each[best], side[best], cost.ravel()[best]))
        best = np.argsort(found.cost, kind="stable")[:count]
        return found.take(best[np.isfinite(found.cost[best])])

    def _fresh(self, count: int) -> Candidates:
        if self.screened is None:
            begin = self.work.elapsed
            self.screened = self.tables.best_starts(self.thin_target, self.limits.family)
            self.screen_seconds += self.work.elapsed - begin
        table, before, self.taken = self.screened, self.taken, count
        places = [np.flatnonzero(table.branch == branch)[before:count] for branch in self.mechanism.branches]
        return table.take(np.concatenate(places))

    # -- rounds -------------------------------------------------------------------------------------------------------

    def free_search(self, rounds: Sequence[Round]) -> None:
        """Rounds without limits until reached, out of time or out of rounds."""
        for one in rounds:
            if self.pool.cost.min(initial=np.inf) > one.near**2:
                continue
            seeds = self.draw(one.sources)
            self.seeds += len(seeds.branch)
            found = minimise(
                self.problem.evaluate,
                seeds.unknowns,
                seeds.branch,
                one.iterations,
                0.3 * self.tolerance,
                self.work,
                residual=self.problem.residual,
                damping=one.damping,
                bent_below=_BENT_BELOW,
            )
            self.pool = self.pool.joined(Candidates(found.unknowns, seeds.branch, found.cost))
            if self.limits.only_family:
                self.note(self.pool.cost)
            if self.reached or self.work.expired():
                return

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
        # of few steps none would be worth bending
        bent = problem.residual if iterations > _FEW_STEPS else None
        found = minimise(
            problem.evaluate, best.unknowns, best.branch, iterations, 0.0, self.work, residual=bent
        ).unknowns
        lengths = self.chart.shape(found[:, :-1]).lengths
        linkages = self.mechanism.mounted(self.target, lengths, best.branch, found[:, -1])
        return self.mechanism.within(self.target, self.limits, self.mechanism.assess(self.target, linkages))

    # -- within limits, or where none is exact ------------------------------------------------------------------------

    def look(self, rounds: Sequence[Round], top: int) -> list[Any]:
        """Exact answers without limits, where a few rounds lead near them: those within the limits."""
        self.free_search(rounds)
        near = self.pool.cost.min(initial=np.inf) < _NEAR**2
        if not (near or self.limits.only_family):
            return []
        if not self.reached and self.pool.cost.min() < _NEARER**2:
            self.free_search(TO_THE_END[:2])
        # where the tolerance is reached, alternatives are worth a few steps, not a search of their own
        return self.polished(max(top + 4, _FINISHED), 30 if near and not self.reached else _FEW_STEPS)

    def bounded_search(self, windows: Callable[[str], Windows], solutions: list[Any], top: int) -> list[Any]:
        """Go on within the limits, in one chart after the other; what it finds, and of the solutions those that are better."""
        charts, ways = self.mechanism.charts(self.limits.family), self.mechanism.bounded(self.target, self.limits)
        if self.target.start is not None or self.target.offset is not None:
            ways = []  # they find the start and the offset themselves
        looked = self.limits.only_family
        if not ways:
            solutions = solutions if looked else self.look(FIRST_LOOK[:1], top)
            self.free_search(TO_THE_END)
            return solutions + self.polished(_FINISHED, 30)
        first, solutions = solutions, []
        for chart, way in zip(charts, ways):
            # the first way is that of full cranks alone, so that the larger family is never worse
            first_of_two = self.limits.family == "any" and way is ways[0]
            limited = LimitedSearch(
                self.target, way, windows("full_crank" if first_of_two else self.limits.family), self.work, self.note
            )
            if not looked:  # one round tells whether an exact answer keeps the limits
                first, looked = self.look(FIRST_LOOK[:1], top), True
                self.note(np.array([one.errors.objective for one in first]) ** 2)
                if Status.of(first, self.tolerance) is Status.REACHED:
                    return first
            found, problem = limited.search(top + 2), limited.whole
            self.seeds += limited.used
            linkages = problem.linkages(self.mechanism, found.unknowns, found.branch, self.target)
            solutions = solutions + self.mechanism.within(
                self.target, self.limits, self.mechanism.assess(self.target, linkages)
            )
            near = found.take(found.cost < _NEAR**2)
            if near.cost.size:  # normal equations lose half of the digits: an exact answer may lie there
                self.use(chart)
                lengths = way.chart.shape(near.unknowns[:, : problem.size]).lengths
                shape, start = chart.unknowns(lengths), near.unknowns[:, [problem.size]]
                self.pool = Candidates(np.hstack([shape, start]), near.branch, near.cost)
                solutions = solutions + self.polished(_FINISHED, 100)
                if not self.reached and near.cost.min() < _NEARER**2:
                    self.free_search(TO_THE_END)
                    solutions = solutions + self.polished(_FINISHED, 30)
            if self.done(sorted(solutions, key=lambda one: one.errors.objective)):
                break
        best = min((one.errors.objective for one in solutions), default=np.inf)
        return solutions + [one for one in first if one.errors.objective < best]

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
    mechanism: Mechanism | None = None,
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
    mechanism : Mechanism, optional
        Moves as that of the tables, and makes other solutions of linkages. Default: that of the tables.

    Returns
    -------
    solutions : list
        The mechanism's solutions, all within the limits. Law: a mirrored target gives the mirrored linkages.
    report : SearchReport
    """
    clockwise = target.clockwise
    if clockwise:  # a mirror image: one search serves both
        target, limits = target.mirrored(), limits.mirrored()
    run = _Search(tables, target, limits, tolerance, work or Work(), mechanism)
    solutions = run.look(FIRST_LOOK, top) if limits.only_family else []
    run.note(np.array([s.errors.objective for s in solutions]) ** 2)
    if not (run.done(solutions) or (solutions and run.reached)):
        solutions = run.bounded_search(tables.windows, solutions, top)
    solutions = distinct(solutions, top, APART, exact=tolerance)
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
    run = _Search(tables, target, limits, DEFAULT_TOLERANCE, work)
    run.free_search(FIRST_LOOK)
    best = run.pool.thinned(count)
    return Starts(run.chart.shape(best.unknowns[:, :-1]).lengths, best.branch, best.unknowns[:, -1])
