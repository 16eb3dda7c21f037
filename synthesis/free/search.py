"""Search without crank angles: choice of the methods for a request, rounds of descents, and solutions.

Data flow of a request::

    poses --(five and more samples, each with rotation and position)--> dyads and their pairs: `dyads`
          --(otherwise, or with limits, incomplete samples, or without a similar linkage)--> guessed crank angles: `screen`
      -> if an exact answer is possible: all seeds to their end, on a few samples  }  round by round in turn,
      -> within the limits: few candidates to their end                            }  until rounds gain nothing
      -> for any family the same again among all four-bars
      -> answers within the limits, ranked, different from each other

Rounds for an exact path run only if earlier rounds did not reach the tolerance. All seeds of such a round descend to their end:
on random crank-rockers and double-cranks over part of a turn, selecting the best seeds after 10 or 20 steps saved no time and
lost requests, because in long curved valleys the cost of the right seed is not the smallest so early.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Flags, Floats
from synthesis.constraints import keeps
from synthesis.descents import Pool, Stage, Timed
from synthesis.errors import FieldError
from synthesis.four_bar import coupler_angle, transmission_angle_over, wrap
from synthesis.fourbar.mechanism import AnyChart, placed_linkages, search_spaces
from synthesis.free.dyads import FEW, chart_of, exact_motion, near_motion
from synthesis.free.few_poses import NONE_CLEAR, Candidates, Obstacles, exact_four_bars, is_few
from synthesis.free.free_timing import FreeTiming, FreeTimingOptions
from synthesis.free.limited import guessed_windows, placed_within
from synthesis.free.screen import path_screen
from synthesis.limits import Limits
from synthesis.linkage import Linkage
from synthesis.mechanism import Chart, Placed
from synthesis.poses import Poses
from synthesis.ranking import APART, Status, distinct, key
from synthesis.scores import scores_of
from synthesis.search.multistart import Incumbents, MultiStart
from synthesis.search.options import Schedule, SearchOptions
from synthesis.search.prescribed_timing import in_portions
from synthesis.search.report import SearchReport, StoppedBy
from synthesis.search.search import DEFAULT_TOLERANCE
from synthesis.search.seeds import Windows, windows_of
from synthesis.solution import Solution, assess
from synthesis.target import TURN, Interval
from synthesis.work import UNLIMITED, Work

# -- answers -------------------------------------------------------------------------------------------------------


def _placed(poses: Poses, timed: Timed, chart: Chart) -> Placed:
    """Return candidates in the form used to evaluate limits, in the user's unit of length."""
    a, z1, z2 = timed.pose.T
    lengths, scale, start = chart.shape(timed.shape).lengths, poses.length_scale, timed.angles[:, 0]
    links = lengths * (scale * np.abs(z1) / lengths[:, 0])[:, None]
    used = poses.used(poses.whole(timed.angles - start[:, None])).interval.after(start)
    return Placed(links, timed.branch, used, poses.middle + scale * a, np.angle(z1), scale * z2)


def _assessed(poses: Poses, timed: Timed, chart: Chart) -> list[Solution]:
    """Build the solutions of candidates and recompute their errors from their own dimensions."""
    placed, start = _placed(poses, timed, chart), timed.angles[:, 0]
    assert placed.pivot is not None and placed.turned is not None and placed.coupler is not None
    crank, rotation = poses.whole(timed.angles - start[:, None]), None
    if poses.rotation is not None:
        turned = coupler_angle(placed.lengths, timed.branch, start[:, None] + crank)
        rotation = turned + timed.offset[:, None]
    linkages = placed_linkages(placed.lengths, timed.branch, start, (placed.pivot, placed.turned, placed.coupler))
    solutions = assess(poses.timed(crank, rotation), linkages)
    return [replace(solution, linkage=_offset_wrapped(solution)) for solution in solutions]


def _offset_wrapped(solution: Solution) -> Linkage:
    offset = solution.linkage.body_offset
    return solution.linkage if offset is None else replace(solution.linkage, body_offset=wrap(offset))


def solutions_of(
    poses: Poses, pool: Pool, chart: Chart, limits: Limits, top: int, tolerance: float
) -> list[Solution]:
    """Return the best four-bars of a pool.

    Parameters
    ----------
    poses : Poses
    pool : Pool
    chart : Chart
        Chart of the pool.
    limits : Limits
    top : int
        Largest number of solutions.
    tolerance : float
        Error that counts as exact; exact answers are ranked by transmission angle and size.

    Returns
    -------
    list of Solution
        Solutions within the limits, best first by `synthesis.ranking.key`; any two differ by more than 1 % in some dimension.
    """
    if not pool.cost.size:
        return []
    timed = pool.timed.take(np.isfinite(pool.cost))
    placed = _placed(poses, timed, chart)
    accepted = keeps(poses, limits, placed)
    accepted &= np.all(np.isfinite(placed.lengths) & (placed.lengths > 0), axis=1)
    if poses.ordered:
        used = np.abs(timed.angles[:, [0, -1]] @ [-1.0, 1.0])
        accepted &= used <= poses.span_max * (1 + 1e-9)
    solutions = _assessed(poses, timed.take(np.flatnonzero(accepted)), chart)
    found = [solution for solution in solutions if np.isfinite(solution.errors.objective)]
    return _best(found, poses, top, tolerance)


def solutions_of_few(
    poses: Poses, candidates: Candidates, limits: Limits, top: int, tolerance: float
) -> list[Solution]:
    """Return the first candidates that are exact, satisfy the limits with their own dimensions, and differ from each other."""
    if not candidates.merit.size:
        return []
    timed, chart = candidates.timed, AnyChart()
    accepted = np.flatnonzero(keeps(poses, limits, _placed(poses, timed, chart)))
    found = _assessed(poses, timed.take(accepted), chart)
    exact = [solution for solution in found if solution.errors.objective < tolerance]
    return distinct(exact, top, APART, order=lambda _: 0)


def within_limits(poses: Poses, limits: Limits, pool: Pool, chart: Chart) -> Flags:
    """Return flags (n,) of the candidates of a pool that satisfy the limits without a change."""
    return keeps(poses, limits, _placed(poses, pool.timed, chart))


def _best(found: Sequence[Solution], poses: Poses, top: int, tolerance: float) -> list[Solution]:
    """Return the best solutions by their error that differ from each other.

    Unusable solutions come last. The smallest error is among two or more solutions, also among those that stay near the path.
    """
    scores = scores_of(found, poses, tolerance)
    keys = [key(score, "error") for score in scores]
    ranked = [found[k] for k in sorted(range(len(found)), key=keys.__getitem__)]
    chosen = distinct(ranked, top, APART, order=lambda _: 0, exact=tolerance)
    staying = {id(solution): solution for solution, score in zip(found, scores) if not score.strays}
    for group in (staying, {id(solution): solution for solution in found}) if top > 1 else ():
        smallest = min(group.values(), key=_error, default=None)
        known = min((_error(solution) for solution in chosen if id(solution) in group), default=np.inf)
        if smallest is not None and _error(smallest) < known and known > tolerance:
            chosen = [*chosen[: top - 1], smallest]
    return chosen


def _error(solution: Solution) -> float:
    return solution.errors.objective


def in_turn(crank: Floats, ordered: bool) -> Floats:
    """Return crank angles in the form of a reply: monotonic for ordered samples, otherwise in [0, a turn)."""
    return crank if ordered else crank % TURN


# -- options ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ExactPathOptions(FreeTimingOptions):
    """Options of the rounds without limits that look for an exact path.

    All starting points descend to their end; more than half of all exact paths are found in the first round.
    """

    schedule: Schedule = Schedule((Stage(100, 1e-2),))  # noqa: RUF009
    seed_rounds: int = 4
    origins: int = 16
    idle_rounds: float = np.inf
    windows: tuple[int, ...] = (100, 100, 200, 200)
    """Number of windows in each of the first rounds."""
    max_rounds: int = 8
    """Largest number of rounds; those after the windows start from perturbations."""


@dataclass(frozen=True)
class FreeSearchOptions:
    """Options of the search with free crank angles that choose its seeds and its rounds."""

    exact_samples: int = 12
    """Number of samples that the rounds for an exact path use: the fewer they are, the fewer minima lie beside the linkage."""
    full_samples: int = 3
    """Number of samples with rotation and position from which on the samples may be passed in any order."""
    far: float = 0.01
    """Error of the dyads above which the motion is not the motion of a four-bar with some noise."""
    seeds: int = 50
    """Number of seeds of a round."""
    seeds_before: int = 20
    """Number of further seeds that come from a search before."""
    first_answers: int = 15
    """Number of leading seeds that may be answers without refinement."""
    idle_beyond_full_cranks: float = 4
    """Number of rounds among all four-bars without a gain on full cranks that end the search: four of 2,300 later ones gained."""
    guesses_beside_dyads: int = 2
    """Number of guessed timings beside what dyads lead to."""
    exact_in_sight: float = 1e-2
    """Error of the first round for an exact path above which no further round runs."""
    exact_in_sight_within: float = 1e-3
    """and the same within limits."""


OPTIONS = FreeSearchOptions()


# -- the search ----------------------------------------------------------------------------------------------------


Run = MultiStart[FreeTiming]


def search_free(
    poses: Poses,
    limits: Limits,
    top: int,
    tolerance: float = DEFAULT_TOLERANCE,
    work: Work = UNLIMITED,
    rounds: int | None = None,
    obstacles: Obstacles | None = None,
) -> tuple[list[Solution], SearchReport]:
    """Find the best four-bars for samples without crank angles.

    Parameters
    ----------
    poses : Poses
    limits : Limits
    top : int
        Largest number of solutions; they differ from each other, best first.
    tolerance : float
        Objective below which the search ends.
    work : Work, optional
        When it has expired, the best solutions so far are returned.
    rounds : int, optional
        Largest number of rounds of descents within the limits; default: until they gain nothing.
    obstacles : Obstacles, optional
        Boxes that no link enters, if linkages through two to four poses avoid them; otherwise a note says so.

    Returns
    -------
    solutions : list of Solution
        Solutions within the limits, each with its crank angles. With more time none is worse.
    report : SearchReport

    Raises
    ------
    FieldError
        If a path can be passed in any order.
    """
    trace: list[tuple[float, float]] = []

    def note(objective: float) -> None:
        if not trace or objective < (1 - SearchOptions.gain) * trace[-1][1]:
            trace.append((work.elapsed, objective))

    if is_few(poses) and not poses.closed and not any(limits.links):
        candidates = exact_four_bars(poses, limits, work, obstacles=obstacles)
        notes = []
        if obstacles is not None and not candidates.merit.size:
            candidates, notes = exact_four_bars(poses, limits, work), [NONE_CLEAR]
        exact = solutions_of_few(poses, candidates, limits, top, tolerance)
        if exact:
            trace = [(work.elapsed, min(solution.errors.objective for solution in exact))]
            return exact, SearchReport(StoppedBy.TOLERANCE, trace, 0.0, candidates.merit.size, notes=notes)
    found = Incumbents(tolerance, note)
    search = FreeSearch(poses, limits, found, work, rounds)
    ended = search.run()
    solutions: list[Solution] = []
    for chart, pool in found.pools.items():
        solutions += solutions_of(poses, pool, chart, limits, top, tolerance)
    if len(found.pools) > 1:
        solutions = _best(solutions, poses, top, tolerance)
    reached = Status.of(solutions, tolerance) is Status.REACHED
    if solutions:
        smallest = min(solution.errors.objective for solution in solutions)
        trace = [(seconds, max(objective, smallest)) for seconds, objective in trace]
        if not trace or trace[-1][1] != smallest:
            trace.append((work.elapsed, smallest))
    stopped = StoppedBy.TOLERANCE if reached else StoppedBy.CONVERGED if ended else StoppedBy.BUDGET
    return solutions, SearchReport(stopped, trace, 0.0, search.seeds)


class FreeSearch:
    """Search for a single request: it chooses the seeds of its multistart searches and their order."""

    def __init__(
        self,
        poses: Poses,
        limits: Limits,
        incumbents: Incumbents,
        work: Work,
        rounds: int | None,
        options: FreeSearchOptions = OPTIONS,
    ) -> None:
        self.poses, self.limits, self.incumbents, self.work, self.options = poses, limits, incumbents, work, options
        self._within: dict[str, Run] = {}
        """Searches within the limits, by family."""
        self.max_rounds = np.inf if rounds is None else rounds
        self.seeds = 0
        self.has_dyads = FEW < poses.full.size == poses.samples
        if not poses.ordered and poses.full.size < min(options.full_samples, poses.samples):
            raise FieldError(
                "/order",
                "must be 'given' for this motion: 'any' needs rotation and position at three or more samples",
            )

    def run(self) -> bool:
        """Search until the tolerance is reached, the time is up or nothing is gained. Return whether the search is complete."""
        family = self.limits.family
        if family != "any" or self.limits.swings:
            return self._search_family(family)
        # full cranks first, so that the larger family is never worse; an exact linkage of any family is found at once
        if self.has_dyads:
            pool, _ = exact_motion(self.poses, family, self.incumbents.tolerance, self.incumbents.awaited(self.work))
            if pool.min_error <= self.incumbents.tolerance:
                self._accept_dyads(pool, family)
        if self.incumbents.reached:
            return True
        return self._search_family("full_crank") and (self.incumbents.reached or self._search_family(family))

    def _search_family(self, family: str) -> bool:
        """Search among the linkages of a family. Return whether the search is complete."""
        work, incumbents, options = self.work, self.incumbents, self.options
        run = self._run_within(family)
        guesses = self._guesses(run, family)
        starts: list[Timed] = []
        pool = None
        if self.has_dyads:
            awaited = incumbents.awaited(work)
            pool, dyads = exact_motion(self.poses, family, incumbents.tolerance, awaited)
            self._accept_dyads(pool, family)
            is_known = work.expired() and np.isfinite(pool.min_error)
            if self.limits.only_family and not (incumbents.reached or is_known):
                pool = near_motion(self.poses, family, dyads, incumbents.tolerance, awaited).joined(pool)
                self._accept_dyads(pool, family)
                # nothing better is to be expected near the motion of a four-bar
                if not self.poses.ordered or pool.min_error <= options.far:
                    return incumbents.reached or not work.expired()
            if incumbents.reached:
                return True
        if not (starts or (work.expired() and np.isfinite(incumbents.smallest))):
            starts += islice(guesses, 1)
        if work.expired():
            return False
        if pool is not None and pool.cost.size and family == "any" and None in self.limits.links:
            guesses = islice(guesses, options.guesses_beside_dyads)
        exact: Iterator[Run] = iter(())
        if self.poses.ordered and family != "any" and (pool is None or pool.min_error <= options.far):
            exact = self._exact(chart_of(family), family)
            for before in islice(exact, 1):
                found = before.problem.at_all_samples(before.best(options.seeds_before))
                starts.append(run.problem.at_search_samples(found))
        if incumbents.reached or work.expired():
            return incumbents.reached
        first = [starts[0].joined(*starts[1:])] if starts else []
        for seeds in run.run(chain(first, guesses), self.max_rounds):
            self.seeds += seeds.branch.size
            if incumbents.reached or work.expired():
                return incumbents.reached
            next(exact, None)
        for _ in exact if self.max_rounds == np.inf else ():
            if incumbents.reached or work.expired():
                return incumbents.reached
        return not work.expired()

    def _run_within(self, family: str) -> Run:
        """Return the search within the limits."""
        if family not in self._within:
            options = FreeTimingOptions()
            if family == "any" and not self.limits.swings:  # after full cranks
                options = FreeTimingOptions(idle_rounds_at_first=self.options.idle_beyond_full_cranks)
            few = self.poses.samples <= options.max_samples
            samples = options.max_samples if few else options.thinned_samples
            self._within[family] = self._run(chart_of(family), samples, options=options)
        return self._within[family]

    def _run(
        self, chart: Chart, samples: int, within_limits: bool = True, options: FreeTimingOptions | None = None
    ) -> Run:
        options, incumbents = options or FreeTimingOptions(), self.incumbents
        work = incumbents.awaited(self.work) if within_limits else self.work
        poses, limits, tolerance = self.poses, self.limits, incumbents.tolerance
        problem = FreeTiming(poses, limits, chart, tolerance, work, samples, within_limits, options)
        return MultiStart(problem, incumbents, self.work, options)

    def _accept_dyads(self, pool: Pool, family: str) -> None:
        """Accept the pairs of dyads that satisfy the limits as they are."""
        self.seeds += pool.cost.size
        self._run(chart_of(family), self.poses.samples).accept(pool.best(pool.cost.size), steps=4)

    # -- seeds ------------------------------------------------------------------------------------------------------

    def _exact(self, chart: Chart, family: str) -> Iterator[Run]:
        """Run rounds without limits on a few samples while an exact answer is in sight. Yield their search after each."""
        options = ExactPathOptions()
        run = self._run(chart, self.options.exact_samples, within_limits=False, options=options)
        problem, sight = run.problem, self.options.exact_in_sight
        if problem.has_limits:
            sight = self.options.exact_in_sight_within

        def windows() -> Iterator[Timed]:
            seeds = problem.search.facing(path_screen(family).seeds(problem.thin, problem.chart))
            stops = np.cumsum(options.windows)
            yield from (seeds.take(slice(stop - count, stop)) for count, stop in zip(options.windows, stops))

        for starts in run.run(windows(), options.max_rounds):
            self.seeds += starts.branch.size
            yield run
            if run.smallest > sight:
                return

    def _guesses(self, run: Run, family: str) -> Iterator[Timed]:
        """Yield windows at guessed crank angles, in poses within the limits; the best are offered as answers."""
        limits, problem = self.limits, run.problem
        tables = [windows_of(family)] if family == "any" else []
        if None not in limits.links:  # no table contains the linkage with the given lengths
            tables.append(Windows(np.array([limits.links], dtype=float)))
        within = replace(limits, family=family)
        for guess in zip(*(guessed_windows(self.poses, within, table) for table in tables)):
            for seeds in guess:
                run.accept(problem.plain.measured(seeds, posed=False), steps=4)
            yield problem.at_search_samples(guess[0].joined(*guess[1:]))
        if family == "any":
            return
        missing = None
        if limits.transmission_angle_min:

            def missing(lengths: Floats, first: Floats, last: Floats) -> Floats:
                smallest = transmission_angle_over(lengths, Interval(first, last))
                return np.maximum(limits.transmission_angle_min - np.nan_to_num(smallest), 0.0)

        screen, search = path_screen(family), problem.search
        boxes = search_spaces(problem.thin, limits, posed=True)[0].boxes if search.limited else None
        count = self.options.first_answers

        def placed(seeds: Timed) -> tuple[Timed, NDArray[np.intp]]:
            seeds, first = search.facing(seeds), np.arange(count)
            if boxes is None:
                return search.measured(seeds).timed, first
            seeds, inside = placed_within(search, seeds, boxes)
            return seeds, np.concatenate([inside[:count], first])

        seeds, leading = placed(screen.seeds(problem.thin, problem.chart, missing))
        few = problem.at_all_samples(seeds.take(leading[leading < seeds.branch.size]))
        run.accept(problem.plain.measured(few, posed=not problem.has_limits), steps=4)
        yield from in_portions(seeds, self.options.seeds)
