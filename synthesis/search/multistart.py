"""Multistart search: seeds, refinement, perturbation of the best basins, and a rule to stop, for every problem.

A round::

    starting points (seeds or perturbations) -> a few steps of each -> more steps for the best of each basin -> pool
      -> the leading new basins to convergence -> refined on all samples, within the limits -> `Incumbents`

The problem supplies seeds, refinement, perturbation and signature (`SearchProblem`). Budget, cancellation and monotonicity
belong to this module: incumbents only improve, no round depends on the time, and a refinement that the time cut short counts
only if nothing is known yet. So more time never gives a worse answer.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from synthesis.arrays import Flags, Floats
from synthesis.descents import Pool, Stage, Timed
from synthesis.kernels import distinct
from synthesis.ranking import NEAR, STANDS_BACK
from synthesis.search.options import Schedule, SearchOptions
from synthesis.work import Work


class SearchProblem(Protocol):
    """What a multistart search needs to know of a problem.

    Candidates have costs, the squared errors; starting points are candidates before their refinement.
    """

    key: Any
    """Key of the incumbents: candidates of one key can be compared in their unknowns."""
    within_limits: bool
    """Whether the refinement satisfies the limits, so that its results may be answers."""
    on_all_samples: bool
    """Whether the refinement uses all samples."""

    def refine(self, starts: Timed, stages: Sequence[Stage], between: Callable[[Pool], None] | None = None) -> Pool:
        """Refine starting points; ``between`` receives the candidates after each stage but the last."""

    def perturb(self, origins: Timed, width: float) -> Timed:
        """Return perturbed copies of basins."""

    def signature(self, candidates: Timed) -> tuple[Floats, Floats]:
        """Return numbers (n, m) that differ between basins, and the scale (n,) of their differences."""

    def strays(self, candidates: Timed) -> Flags:
        """Return whether candidates leave the motion between the samples, (n,)."""

    def complete(self, candidates: Pool) -> Pool:
        """Refine candidates on all samples."""

    def satisfying(self, candidates: Pool, steps: int) -> Iterator[Pool]:
        """Yield answers within the limits near candidates at all samples."""

    def polish(self, answers: Timed, stages: Sequence[Stage]) -> Pool:
        """Refine answers once more, on all samples and within the limits."""


class Incumbents:
    """Best answers within the limits so far, with their errors on all samples. They only improve.

    Parameters
    ----------
    tolerance : float
        An error below it is exact.
    note : callable
        Receives the smallest error each time that it falls.
    """

    def __init__(self, tolerance: float, note: Callable[[float], None]) -> None:
        self.tolerance, self.note = tolerance, note
        self.pools: dict[Any, Pool] = {}
        """Best answer of each basin, by the problem's key, best first; the smallest error is at least second."""
        self.smallest = self.smallest_counted = np.inf
        """Smallest error, and the smallest if those that stray count for more."""

    @property
    def reached(self) -> bool:
        """Whether an answer that does not stray is below the tolerance."""
        return self.smallest_counted <= self.tolerance

    @property
    def levels(self) -> Floats:
        """Errors of which each may show a gain."""
        return np.array([self.smallest, self.smallest_counted])


P = TypeVar("P", bound=SearchProblem)


class MultiStart(Generic[P]):
    """Multistart search for one problem.

    Parameters
    ----------
    problem : SearchProblem
    incumbents : Incumbents
        Receives the answers; several searches may share it, so that a later one never makes the result worse.
    work : Work
    options : SearchOptions
    """

    def __init__(self, problem: P, incumbents: Incumbents, work: Work, options: SearchOptions) -> None:
        self.problem, self.incumbents, self.work, self.options = problem, incumbents, work, options
        self.pool: Pool | None = None
        self._uses: Counter[float] = Counter()
        """Number of times that a basin was perturbed, by its cost."""
        self._converged: set[float] = set()
        """Costs of the basins that were refined to convergence."""
        self._strays: dict[float, bool] = {}
        """Whether candidates stray, by their cost."""

    # -- rounds -----------------------------------------------------------------------------------------------------

    def run(self, seeds: Iterator[Timed], max_rounds: float = np.inf) -> Iterator[Timed]:
        """Run rounds until they gain nothing. Yield the starting points of each round after it."""
        options, incumbents, number, last_gain = self.options, self.incumbents, 0, 0
        while number < max_rounds and number - last_gain < self._patience(last_gain):
            before = incumbents.levels
            scheduled = number < options.seed_rounds or number % options.seed_interval == 0
            starts = next(seeds, None) if scheduled else None
            if starts is None:
                if self.pool is None or not self.pool.cost.size:
                    return
                starts = self.perturbations(options.origins, options.copies, self._width(number))
            self.round(starts, options.schedule)
            number += 1
            if np.any(incumbents.levels < (1 - options.gain) * before):
                last_gain = number
            yield starts
        self._conclude()

    def _patience(self, last_gain: int) -> float:
        """Return the number of rounds without a gain that end the search."""
        options = self.options
        if last_gain:
            return max(options.idle_rounds, options.idle_fraction * last_gain)
        return min(options.idle_rounds, options.idle_rounds_at_first)

    def _width(self, number: int) -> float:
        """Return the width of the perturbations of a round."""
        widths = self.options.widths
        return widths[number // 2 % len(widths)]

    def round(self, starts: Timed, schedule: Schedule) -> None:
        """Refine starting points, add them to the pool, and take the best of them as answers."""
        found = self._refine(starts, schedule.first)
        if schedule.continuation:
            survivors = self.basins(found, schedule.survivors, self.options.pool_distance)
            self._first_answers(survivors)
            found = self._refine(survivors.timed, schedule.continuation)
        self._take(found)
        assert self.pool is not None
        leading = range(min(schedule.finished, self.pool.cost.size))
        new = [k for k in leading if self.pool.cost[k] not in self._converged]
        if new and not (self.incumbents.reached or self.work.expired()):
            begun = self.pool.take(new)
            found = self._refine(begun.timed, schedule.end)
            self._converged |= set(begun.cost) | set(found.cost)
            self._take(found)

    def _refine(self, starts: Timed, stages: tuple[Stage, ...]) -> Pool:
        found: Pool = self.problem.refine(starts, stages, self._first_answers if len(stages) > 2 else None)
        return found

    def _conclude(self) -> None:
        """Refine the best basins on all samples, and polish the best answers."""
        problem, options, pools = self.problem, self.options, self.incumbents.pools
        if self.pool is not None and not problem.on_all_samples:
            self.offer(self.pool, options.final_basins, np.inf)
        if problem.key in pools:
            best = pools[problem.key].timed.take(slice(0, options.refined_on_all))
            self.accept(problem.polish(best, options.polish))

    # -- pool -------------------------------------------------------------------------------------------------------

    @property
    def smallest(self) -> float:
        """Smallest error of the pool, within the limits or not."""
        return np.inf if self.pool is None else self.pool.least

    def best(self, count: int) -> Timed:
        """Return the best basins of the pool."""
        assert self.pool is not None
        return self.pool.timed.take(slice(0, count))

    def _take(self, found: Pool) -> None:
        """Add candidates to the pool, and the worthwhile ones to the answers."""
        found = found.take(np.isfinite(found.cost))
        joined = found if self.pool is None else self.pool.joined(found)
        self.pool = self.basins(joined, self.options.max_pool, self.options.pool_distance)
        if self.problem.within_limits or found.least <= self.incumbents.tolerance:
            self.offer(found, self.options.refined_on_all, self.options.promising)

    def basins(self, found: Pool, count: int, distance: float) -> Pool:
        """Return the best candidate of each basin, best first; of exact candidates all that differ."""
        found = found.take(np.isfinite(found.cost))
        counted = self.counted(found)
        order = np.argsort(counted, kind="stable")
        found, counted = found.take(order), counted[order]
        identity = np.column_stack([found.timed.shape, found.timed.angles[:, 0], found.timed.branch])
        rows, scale = self.problem.signature(found.timed)
        exact = int(np.searchsorted(counted, self.incumbents.tolerance**2, side="right"))
        same = np.full(exact, self.options.exact_distance)
        kept = distinct.apart(identity[:exact], same, (), 0, count)
        return found.take(distinct.apart(rows, distance * scale, kept, exact, count))

    def counted(self, found: Pool) -> Floats:
        """Return squared errors; those of candidates that stray are increased as in a ranking (see `ranking.NEAR`)."""
        new = [k for k, cost in enumerate(found.cost.tolist()) if cost not in self._strays]
        if new:
            self._strays.update(zip(found.cost[new].tolist(), self.problem.strays(found.timed.take(new)).tolist()))
        strays = [self._strays[cost] for cost in found.cost.tolist()]
        return np.where(strays, np.maximum(STANDS_BACK**2 * found.cost, NEAR**2), found.cost)

    def perturbations(self, origins: int, copies: int, width: float = 1.0) -> Timed:
        """Return perturbed copies of the best basins, those first that were perturbed least often."""
        assert self.pool is not None
        best = self.pool.take(slice(0, self.options.active_basins))
        uses = np.array([self._uses[cost] for cost in best.cost])
        rank = np.log(np.maximum(self.counted(best), 1e-300)) + self.options.reuse_penalty * uses
        chosen = np.argsort(rank, kind="stable")[:origins]
        self._uses.update(best.cost[chosen])
        perturbed: Timed = self.problem.perturb(best.timed.take(np.repeat(chosen, copies // 2)), width)
        return perturbed

    # -- answers ----------------------------------------------------------------------------------------------------

    def _first_answers(self, found: Pool) -> None:
        """Offer the candidates of a stage if nothing is known yet."""
        if not math.isfinite(self.incumbents.smallest):
            self.offer(found, self.options.refined_on_all, self.options.promising)

    def offer(self, found: Pool, count: int, promising: float) -> None:
        """Refine the best candidates on all samples, if they may improve on the incumbents, and accept them as answers."""
        if not (found.cost.size and self._counts):
            return
        if not self.problem.on_all_samples:
            found = found.take(np.argsort(found.cost, kind="stable")[:count])
            found = found.take(found.cost <= promising * self.incumbents.smallest**2)
            found = self.problem.complete(found) if found.cost.size else found
        self.accept(found)

    @property
    def _counts(self) -> bool:
        """Whether the results of a refinement count.

        Those that the time cut short count only if nothing is known: more time would lead them elsewhere, and an answer must
        not be lost by that.
        """
        return not (self.work.expired() and math.isfinite(self.incumbents.smallest))

    def accept(self, found: Pool, steps: int | None = None) -> None:
        """Add candidates at all samples that satisfy the limits, or after a few Newton steps do, to the incumbents."""
        if not (found.cost.size and self._counts):
            return
        for number, answers in enumerate(
            self.problem.satisfying(found, self.options.restoration_steps if steps is None else steps)
        ):
            if number == 0 or self._counts:
                self._add(answers)

    def _add(self, answers: Pool) -> None:
        """Add answers within the limits to the incumbents."""
        key, incumbents = self.problem.key, self.incumbents
        if answers.cost.size:
            known = incumbents.pools[key].joined(answers) if key in incumbents.pools else answers
            kept = self.basins(known, self.options.max_pool, self.options.answer_distance)
            if known.least < kept.least:  # the best strays, and comes after many others
                best = known.take([int(known.cost.argmin())])
                kept = kept.take(slice(0, 1)).joined(best).joined(kept.take(slice(1, None)))
            incumbents.pools[key] = kept
            first = float(np.sqrt(self.counted(kept.take(slice(0, 1))).min(initial=np.inf)))
            incumbents.smallest_counted = min(incumbents.smallest_counted, first)
        if answers.least < incumbents.smallest:
            incumbents.smallest = answers.least
            incumbents.note(incumbents.smallest)
