"""Linkages driven by a crank as a problem of the multistart search; a subclass knows the timing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Floats
from synthesis.descents import Pool, Problem, Stage, Timed
from synthesis.mechanism import Chart
from synthesis.search.multistart import SearchProblem
from synthesis.search.options import SearchOptions
from synthesis.work import Work


class Refinements(NamedTuple):
    """The problems that refine candidates."""

    plain: Problem
    """All samples, without limits."""
    within: Problem
    """All samples, within the limits."""
    search: Problem
    """The samples of the search, within the limits if the search satisfies them."""


class CrankDriven(SearchProblem):
    """A motion whose candidates have a shape, a pose, a branch and crank angles.

    The search refines at some of the samples, answers at all of them.

    Parameters
    ----------
    refinements : Refinements
    on_all_samples : bool
        Whether the search uses all samples.
    tolerance : float
        An error below it is exact.
    work : Work
    options : SearchOptions
    """

    def __init__(
        self, refinements: Refinements, on_all_samples: bool, tolerance: float, work: Work, options: SearchOptions
    ) -> None:
        self.refinements, self.on_all_samples, self.work, self.options = refinements, on_all_samples, work, options
        self.key = self.chart
        self.keeps_converged = True
        self.has_limits = refinements.within.limited
        self.within_limits = refinements.search.limited or not self.has_limits
        self.tolerance = tolerance
        self.random = np.random.default_rng(options.seed)

    @property
    def chart(self) -> Chart:
        """Chart of the candidates."""
        return self.refinements.plain.chart

    # -- to be known by the timing ----------------------------------------------------------------------------------

    def at_search_samples(self, timed: Timed) -> Timed:
        """Return candidates at all samples as candidates of the search."""
        raise NotImplementedError

    def perturbed_angles(self, timed: Timed) -> Floats:
        """Return perturbed crank angles (n, N)."""
        raise NotImplementedError

    # -- candidates -------------------------------------------------------------------------------------------------

    def identity(self, pool: Pool) -> Floats:
        """Return shape, start and branch."""
        return np.column_stack([pool.timed.shape, pool.timed.angles[:, 0], pool.timed.branch])

    def restart(self, pool: Pool) -> Timed:
        """Return candidates as starting points."""
        return pool.timed

    def may_answer(self, pool: Pool) -> bool:
        """Return whether the search satisfies the limits, or a candidate is exact."""
        return self.within_limits or pool.min_error <= self.tolerance

    # -- refinement -------------------------------------------------------------------------------------------------

    def refine(self, starts: Timed, stages: Sequence[Stage], between: Callable[[Pool], None] | None = None) -> Pool:
        """Refine candidates of the search."""
        return self.refinements.search.descended(starts, stages, 0.3 * self.tolerance, self.work, between=between)

    def converge(self, pool: Pool, stages: Sequence[Stage]) -> Pool:
        """Refine new basins to convergence."""
        return self.refine(pool.timed, stages)

    def polish(self, answers: Pool, stages: Sequence[Stage]) -> Pool:
        """Refine answers once more, on all samples and within the limits."""
        return self.refinements.within.descended(answers.timed, stages, 0.3 * self.tolerance, self.work)

    def satisfying(self, pool: Pool, steps: int) -> Iterator[Pool]:
        """Yield candidates at all samples that satisfy the limits, or nearly; then exact candidates near them."""
        if not self.has_limits:
            yield pool
            return
        options, (plain, within, _) = self.options, self.refinements
        merit = pool.cost + within.lacking(pool.timed)[0]
        best = np.argsort(merit, kind="stable")[: options.restored]
        moved, violation = within.moved_onto(pool.timed.take(best), steps)
        yield moved.take((violation <= options.equation_tolerance) & np.isfinite(moved.cost))
        nearly_satisfied = moved.take(moved.cost < options.nearly_exact**2)
        if nearly_satisfied.cost.size:
            exact = plain.descended(nearly_satisfied.timed, [Stage(30, 1e-2)], 0.3 * self.tolerance, self.work)
            yield exact.take(within.lacking(exact.timed)[1] <= options.equation_tolerance)

    # -- perturbation -----------------------------------------------------------------------------------------------

    def perturb(self, origins: Pool, copies: int) -> Timed:
        """Return copies of candidates with heavy-tailed perturbations of shape and timing; some change the branch."""
        timed = origins.timed.take(np.repeat(np.arange(origins.cost.size), copies))
        noise = self.random.standard_t(3, size=timed.shape.shape) * self.chart.hop[:-1]
        flipped = self.random.random(len(timed.branch)) < self.options.flipped
        return Timed(
            self.chart.hopped(timed.shape, noise),
            timed.pose,
            timed.offset,
            self.perturbed_angles(timed),
            np.where(flipped, -timed.branch, timed.branch),
        )
