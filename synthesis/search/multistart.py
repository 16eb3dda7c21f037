"""Multistart search: seeds, refinement, perturbation of the best basins, and a rule to stop, for every problem.

A round::

    starting points (seeds or perturbations) -> a few steps of each -> more steps for the best of each basin -> pool
      -> the leading new basins to convergence -> refined on all samples, within the limits -> `Incumbents`

The problem supplies seeds, refinement, perturbation and signature (`SearchProblem`). Its candidates may belong to groups, such
as kinds of linkages with their drives: each group has its own basins, incumbents and patience, and all share the rounds.

Budget, cancellation and monotonicity belong to this module: incumbents only improve, no round depends on the time, a refinement
ends early only once an answer is known or is a quarter of a second late (`Incumbents.awaited`), and then it does not count if an
answer is known. So more time never gives a worse answer, and with `search_nested` neither do wider limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from typing import Any, Generic, TypeVar

import numpy as np

from synthesis.arrays import Flags, Floats, Ints
from synthesis.kernels import distinct
from synthesis.ranking import NEAR, PENALTY_FACTOR
from synthesis.search.options import Schedule, SearchOptions
from synthesis.search.report import SearchReport
from synthesis.work import Work

Candidates = Any
"""A problem's candidates (n,) with their ``cost`` (n,), the squared errors, ``take(indices)`` and ``joined(others)``."""
Starts = Any
"""A problem's starting points, with ``take(indices)`` and ``joined(*others)``."""


class SearchProblem:
    """Problem that a multistart search solves; the defaults suit a single group that is refined on all samples."""

    key: Any = None
    """Key of the incumbents: candidates of the same key can be compared in their unknowns."""
    groups = 1
    """Number of groups."""
    on_all_samples = True
    """True if the refinement uses all samples."""
    keeps_converged = False
    """True if converged candidates compete in the pool; otherwise they are answers only."""

    def refine(self, starts: Starts, stages: Sequence[Any], between: Callable[[Any], None] | None) -> Candidates:
        """Refine starting points; ``between`` may receive the candidates after each stage but the last."""
        raise NotImplementedError

    def converge(self, candidates: Candidates, stages: Sequence[Any]) -> Candidates:
        """Refine new basins to convergence."""
        raise NotImplementedError

    def perturb(self, origins: Candidates, copies: int) -> Starts:
        """Return perturbed copies of basins."""
        raise NotImplementedError

    def identity(self, candidates: Candidates) -> Floats:
        """Return numbers (n, m) that differ between exact candidates."""
        raise NotImplementedError

    def satisfying(self, candidates: Candidates, steps: int) -> Iterable[Candidates]:
        """Return answers within the limits near candidates at all samples."""
        raise NotImplementedError

    def signature(self, candidates: Candidates) -> tuple[Floats, Floats]:
        """Return numbers (n, m) that differ between basins, and the scale (n,) of their differences."""
        return self.identity(candidates), np.ones(candidates.cost.size)

    def group(self, candidates: Any) -> Ints:
        """Return the groups of candidates or starting points, (n,)."""
        return np.zeros(candidates.cost.size, dtype=np.intp)

    def restart(self, candidates: Candidates) -> Starts:
        """Return candidates as starting points."""
        return candidates

    def relatives(self, new: Candidates) -> Starts | None:
        """Return further starting points that new basins suggest."""
        return None

    def strays(self, candidates: Candidates) -> Flags:
        """Return whether candidates leave the motion between the samples, (n,)."""
        return np.zeros(candidates.cost.size, dtype=bool)

    def usable(self, answers: Candidates) -> Flags:
        """Return whether answers that do not stray can be used, (n,)."""
        return np.ones(answers.cost.size, dtype=bool)

    def may_answer(self, candidates: Candidates) -> bool:
        """Return whether candidates of a round may be answers before they converge."""
        return True

    def complete(self, candidates: Candidates) -> Candidates:
        """Refine candidates on all samples."""
        return candidates

    def polish(self, answers: Candidates, stages: Sequence[Any]) -> Candidates:
        """Refine answers once more, on all samples and within the limits."""
        return answers.take([])


class Incumbents:
    """Incumbent answers within the limits, with their errors on all samples. They only improve.

    Parameters
    ----------
    tolerance : float
        An error below it is exact.
    note : callable
        Receives the smallest error each time that it falls.
    groups : int
        Number of groups of the problem.
    """

    def __init__(self, tolerance: float, note: Callable[[float], None], groups: int = 1) -> None:
        self.tolerance, self.note = tolerance, note
        self.pools: dict[Any, Candidates] = {}
        """Best answer of each basin, by the problem's key, best first; the smallest error is at least second."""
        self.levels: Floats = np.full((groups, 2), np.inf)
        """Smallest error of each group, and the smallest if those that stray count for more."""

    @property
    def smallest(self) -> float:
        """Smallest error."""
        return float(self.levels[:, 0].min())

    @property
    def unsolved(self) -> Flags:
        """Groups without an exact answer that does not stray."""
        return np.asarray(self.levels[:, 1] > self.tolerance)

    def awaited(self, work: Work) -> Work:
        """Return the work of refinements that lead to answers: the budget ends them once an answer is known or is late."""
        return work.awaiting(lambda: math.isfinite(self.smallest))

    @property
    def reached(self) -> bool:
        """True if all groups have an exact answer that does not stray."""
        return not self.unsolved.any()


P = TypeVar("P", bound=SearchProblem)
L = TypeVar("L")
A = TypeVar("A")


def search_nested(
    search: Callable[[L], tuple[list[A], SearchReport]],
    limits: L,
    narrower: Sequence[L],
    suffice: Callable[[Sequence[A]], bool],
) -> tuple[list[A], SearchReport]:
    """Search within limits, and within narrower limits too if answers were found but do not suffice."""
    found, report = search(limits)
    if narrower and found and not suffice(found):
        more, reports = zip(*map(search, narrower))
        found, report = [*found, *chain(*more)], SearchReport.joined([report, *reports])
    return found, report


class MultiStart(Generic[P]):
    """Multistart search for a problem.

    Parameters
    ----------
    problem : SearchProblem
    incumbents : Incumbents
        Receives the answers; several searches may share it, so that a later search never makes the result worse.
    work : Work
    options : SearchOptions
    """

    def __init__(self, problem: P, incumbents: Incumbents, work: Work, options: SearchOptions) -> None:
        self.problem, self.incumbents, self.options = problem, incumbents, options
        self.work = incumbents.awaited(work)
        self.pool: Candidates | None = None
        self._new: Candidates | None = None
        """Basins that converged in the round before."""
        self._converged: Candidates | None = None
        """Candidates that were refined to convergence."""
        self._strays: dict[float, bool] = {}
        """Straying of candidates, by their cost."""

    # -- rounds -----------------------------------------------------------------------------------------------------

    def run(self, seeds: Iterator[Starts], max_rounds: float = np.inf) -> Iterator[Starts]:
        """Run rounds until they gain nothing. Yield the starting points of each round after it."""
        options, incumbents, number = self.options, self.incumbents, 0
        last_gain = np.zeros(self.problem.groups)
        while number < max_rounds:
            active = number - last_gain < self._patience(last_gain)
            if options.drop_exact:
                active &= incumbents.unsolved
            starts = self._starts(seeds, number) if active.any() else None
            if starts is None:
                break
            if self.problem.groups > 1:
                group = self.problem.group(starts)
                if not active[group].any():
                    break
                starts = starts.take(active[group])
            before = incumbents.levels.copy()
            self.round(starts, options.schedule)
            number += 1
            last_gain[np.any(incumbents.levels < (1 - options.gain) * before, axis=1)] = number
            yield starts
        self._conclude()

    def _patience(self, last_gain: Floats) -> Floats:
        """Return the number of rounds without a gain that end the search of each group."""
        options = self.options
        first = min(options.idle_rounds, options.idle_rounds_at_first)
        later = np.maximum(options.idle_rounds, options.idle_fraction * last_gain)
        more = np.where(np.isinf(self.incumbents.levels[:, 0]), options.idle_rounds_unanswered, 0.0)
        return np.where(last_gain > 0, later, first) + more

    def _starts(self, seeds: Iterator[Starts], number: int) -> Starts | None:
        """Return the starting points of a round, if there are any."""
        options = self.options
        starts = next(seeds, None) if number < options.seed_rounds else None
        if starts is not None:
            return starts
        if self.pool is None or not self.pool.cost.size:
            return None
        starts = self.perturbations(options.origins, options.copies)
        more = None if self._new is None else self.problem.relatives(self._new)
        return starts if more is None else starts.joined(more)

    def round(self, starts: Starts, schedule: Schedule) -> None:
        """Refine starting points, add them to the pool, and take the best of them as answers."""
        found = self._refine(starts, schedule.first)
        if schedule.continuation:
            survivors = self.basins(found, schedule.survivors, self.options.pool_distance)
            self._first_answers(survivors)
            if self.work.expired():
                return
            found = self._refine(self.problem.restart(survivors), schedule.continuation)
        self._take(found)
        if self.work.expired():
            return
        self._new = self._unconverged(found, schedule)
        if self._new.cost.size and not self.incumbents.reached:
            found = self.problem.converge(self._new, schedule.end)
            known = [self._new] if self._converged is None else [self._converged, self._new]
            if self.problem.keeps_converged:
                known.append(found.take(np.isfinite(found.cost)))
                self._take(found)
            else:
                self.accept(found)
            self._converged = known[0]
            for more in known[1:]:
                self._converged = self._converged.joined(more)

    def _refine(self, starts: Starts, stages: Sequence[Any]) -> Candidates:
        return self.problem.refine(starts, stages, self._first_answers if len(stages) > 2 else None)

    def _conclude(self) -> None:
        """Refine the best basins on all samples, and polish the best answers."""
        problem, options, pools = self.problem, self.options, self.incumbents.pools
        if self.pool is not None and not problem.on_all_samples:
            self.offer(self.pool, options.final_basins)
        if problem.key in pools:
            best = self._leading(pools[problem.key], options.polished)
            self.accept(problem.polish(best, options.polish))

    # -- pool -------------------------------------------------------------------------------------------------------

    @property
    def smallest(self) -> float:
        """Smallest error of the pool, within the limits or not."""
        return _smallest(self.pool)

    def best(self, count: int) -> Starts:
        """Return the best basins of the pool as starting points."""
        assert self.pool is not None
        return self.problem.restart(self.pool.take(slice(0, count)))

    def _take(self, found: Candidates) -> None:
        """Add candidates to the pool, and offer the best of them as answers."""
        found = found.take(np.isfinite(found.cost))
        joined = found if self.pool is None else self.pool.joined(found)
        self.pool = self.basins(joined, self.options.max_pool, self.options.pool_distance)
        if self.problem.may_answer(found):
            self.offer(found, self.options.refined_on_all)

    def _unconverged(self, found: Candidates, schedule: Schedule) -> Candidates:
        """Return the first of the leading basins of each group that were not refined to convergence."""
        if schedule.leading:
            leading = self._leading(self.pool, schedule.leading)
            return self._leading(leading.take(self._unlike_converged(leading)), schedule.finished)
        return self.basins(found.take(self._unlike_converged(found)), schedule.finished, self.options.pool_distance)

    def _unlike_converged(self, found: Candidates) -> Flags:
        """Return which candidates are in other basins than all that converged, or improve on these by a gain, (n,)."""
        known, options, problem = self._converged, self.options, self.problem
        if known is None:
            return np.ones(found.cost.size, dtype=bool)
        (rows, scale), (known_rows, _) = problem.signature(found), problem.signature(known)
        group, other_group = problem.group(found), problem.group(known)
        unlike = np.ones(found.cost.size, dtype=bool)
        for number in range(problem.groups):
            own, others_own = np.flatnonzero(group == number), np.flatnonzero(other_group == number)
            distance = np.abs(rows[own][:, None] - known_rows[others_own]).max(axis=2, initial=0.0)
            no_gain = found.cost[own][:, None] > (1 - options.gain) ** 2 * known.cost[others_own]
            unlike[own] = ~np.any(no_gain & (distance < options.pool_distance * scale[own][:, None]), axis=1)
        return unlike

    def _leading(self, found: Candidates, count: int) -> Candidates:
        """Return the first candidates of each group."""
        if self.problem.groups == 1:
            return found.take(slice(0, count))
        group = self.problem.group(found)
        indices = [np.flatnonzero(group == number)[:count] for number in range(self.problem.groups)]
        return found.take(np.sort(np.concatenate(indices)))

    def basins(self, found: Candidates, count: int, distance: float) -> Candidates:
        """Return the best candidate of each basin, best first; of exact candidates all that differ.

        There are at most ``count`` of a group. The best of all groups come first, then the second of each.
        """
        found = found.take(np.isfinite(found.cost))
        counted = self.counted(found)
        order = np.argsort(counted, kind="stable")
        found, counted = found.take(order), counted[order]
        rows, scale = self.problem.signature(found)
        identity, group = self.problem.identity(found), self.problem.group(found)
        chosen = []
        for number in range(self.problem.groups):
            own = np.flatnonzero(group == number)
            exact = int(np.searchsorted(counted[own], self.incumbents.tolerance**2, side="right"))
            same = np.full(exact, self.options.exact_distance)
            different = distinct.apart(identity[own[:exact]], same, (), 0, count)
            chosen.append(own[distinct.apart(rows[own], distance * scale[own], different, exact, count)])
        rank = np.concatenate([np.arange(own.size) for own in chosen])
        return found.take(np.concatenate(chosen)[np.argsort(rank, kind="stable")])

    def counted(self, found: Candidates) -> Floats:
        """Return squared errors; the errors of straying candidates are increased as in a ranking (see `ranking.NEAR`)."""
        new = [k for k, cost in enumerate(found.cost.tolist()) if cost not in self._strays]
        if new:
            self._strays.update(zip(found.cost[new].tolist(), self.problem.strays(found.take(new)).tolist()))
        strays = [self._strays[cost] for cost in found.cost.tolist()]
        return np.where(strays, np.maximum(PENALTY_FACTOR**2 * found.cost, NEAR**2), found.cost)

    def perturbations(self, origins: int, copies: int) -> Starts:
        """Return perturbed copies of the best basins of each group."""
        assert self.pool is not None
        return self.problem.perturb(self._leading(self.pool, origins), copies)

    # -- answers ----------------------------------------------------------------------------------------------------

    def _first_answers(self, found: Candidates) -> None:
        """Offer the candidates of a stage if nothing is known yet."""
        if not math.isfinite(self.incumbents.smallest):
            self.offer(found, self.options.refined_on_all)

    def offer(self, found: Candidates, count: int) -> None:
        """Refine the best candidates on all samples, and accept them as answers."""
        if not (found.cost.size and self._counts):
            return
        if not self.problem.on_all_samples:
            found = self.problem.complete(found.take(np.argsort(found.cost, kind="stable")[:count]))
        self.accept(found)

    @property
    def _counts(self) -> bool:
        """True if the results of a refinement count.

        Those that the time cut short count only if nothing is known: more time would lead them elsewhere.
        """
        return not (self.work.expired() and math.isfinite(self.incumbents.smallest))

    def accept(self, found: Candidates, steps: int | None = None) -> None:
        """Add candidates at all samples that satisfy the limits, or after a few Newton steps do, to the incumbents."""
        if not (found.cost.size and self._counts):
            return
        steps = self.options.restoration_steps if steps is None else steps
        for number, answers in enumerate(self.problem.satisfying(found, steps)):
            if number == 0 or self._counts:
                self._add(answers)

    def _with_best(self, chosen: Candidates, known: Candidates) -> Candidates:
        """Return the best basins with the best answer that can be used, and with the smallest error, in the second place."""
        counted = self.counted(known)
        can_be_used = self.problem.usable(known) & (counted == known.cost)
        for cost in (np.where(can_be_used, known.cost, np.inf), known.cost):
            best = int(cost.argmin())
            if np.isfinite(cost[best]) and known.cost[best] not in chosen.cost:
                chosen = chosen.take(slice(0, 1)).joined(known.take([best]), chosen.take(slice(1, None)))
        return chosen

    def _add(self, answers: Candidates) -> None:
        """Add answers within the limits to the incumbents."""
        key, incumbents = self.problem.key, self.incumbents
        if not answers.cost.size:
            return
        known = incumbents.pools[key].joined(answers) if key in incumbents.pools else answers
        distinct_answers = self.basins(known, self.options.max_pool, self.options.answer_distance)
        if self.problem.groups == 1:
            distinct_answers = self._with_best(distinct_answers, known)
        incumbents.pools[key] = distinct_answers
        before = incumbents.smallest
        np.minimum.at(incumbents.levels[:, 0], self.problem.group(answers), np.sqrt(answers.cost))
        np.minimum.at(
            incumbents.levels[:, 1], self.problem.group(distinct_answers), np.sqrt(self.counted(distinct_answers))
        )
        if incumbents.smallest < before:
            incumbents.note(incumbents.smallest)


def _smallest(found: Candidates | None) -> float:
    """Return the smallest error of candidates; infinity if there are none."""
    return float(np.sqrt(found.cost.min())) if found is not None and found.cost.size else math.inf
