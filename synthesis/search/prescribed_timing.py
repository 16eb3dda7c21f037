"""Motions with prescribed crank angles, within limits, as a problem of the multistart search."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from synthesis.arrays import Floats
from synthesis.descents import Pool, Timed
from synthesis.fourbar.mechanism import Bounded
from synthesis.search.crank_driven import CrankDriven, Refinements
from synthesis.search.multistart import MultiStart
from synthesis.search.options import SearchOptions
from synthesis.search.prescribed import GivenProblem, problem_of
from synthesis.search.seeds import Windows
from synthesis.target import Target
from synthesis.work import Work


@dataclass(frozen=True)
class PrescribedTimingOptions(SearchOptions):
    """Options of the search with prescribed timing."""

    idle_rounds: float = 2
    origins: int = 12
    max_samples: int = 40
    """Number of samples up to which the search uses all."""
    condensed_samples: int = 24
    """Approximate number of samples that the search uses of a longer motion."""
    seeds: int = 50
    """Number of seeds of a round."""
    first_answers: int = 24
    """Number of leading seeds that may be answers without refinement."""
    start_width: float = 10.0
    """Scale of the differences of shape and start between two basins."""


class PrescribedTiming(CrankDriven):
    """A motion with prescribed crank angles, within limits.

    Parameters
    ----------
    target : Target
        With a crank that turns counter-clockwise.
    bounded : Bounded
        The limits, and the chart of the search.
    tolerance : float
    work : Work
    options : PrescribedTimingOptions
    """

    options: PrescribedTimingOptions

    def __init__(
        self, target: Target, bounded: Bounded, tolerance: float, work: Work, options: PrescribedTimingOptions
    ) -> None:
        thin = target if target.samples <= options.max_samples else target.condensed(options.condensed_samples)
        self.within = problem_of(target, bounded)
        self.search = self.within if thin is target else problem_of(thin, bounded)
        self.bounded, self._shift = bounded, target.off(thin)
        problems = Refinements(GivenProblem(target, bounded.chart), self.within, self.search)
        super().__init__(problems, thin is target, tolerance, work, options)

    def seeds(self, windows: Windows, run: MultiStart[PrescribedTiming]) -> Iterator[Timed]:
        """Yield the seeds of each round; the best are offered as answers first."""
        seeds = windows.seeds(self.search, self.bounded.on_shape, self.bounded.boxes)
        first = self._at_all_samples(seeds.take(slice(0, self.options.first_answers)))
        run.accept(self.refinements.plain.measured(first, posed=not self.within.posed), steps=4)
        yield from in_portions(seeds, self.options.seeds)

    def signature(self, pool: Pool) -> tuple[Floats, Floats]:
        """Return shape, start and branch."""
        timed = pool.timed
        rows = np.column_stack([self.chart.shape_coordinates(timed.shape), timed.angles[:, 0], 3 * timed.branch])
        return rows, np.full(len(rows), self.options.start_width)

    def complete(self, pool: Pool) -> Pool:
        """Refine candidates of the search on all samples."""
        timed = self._at_all_samples(pool.timed)
        return self.within.descended(timed, [self.options.completion], 0.1 * self.tolerance, self.work)

    def perturbed_angles(self, timed: Timed) -> Floats:
        """Return other starts."""
        return timed.angles + self.chart.hop[-1] * self.random.standard_t(3, size=timed.angles.shape)

    def at_search_samples(self, timed: Timed) -> Timed:
        """Return candidates at all samples as candidates of the search."""
        return timed._replace(pose=timed.pose - np.array([self._shift, 0, 0]))

    def _at_all_samples(self, timed: Timed) -> Timed:
        """Return candidates of the search at all samples: positions are relative to the mean of their own samples."""
        return timed._replace(pose=timed.pose + np.array([self._shift, 0, 0]))


def in_portions(seeds: Timed, size: int) -> Iterator[Timed]:
    """Yield seeds in portions of a size."""
    for first in range(0, seeds.branch.size, size):
        yield seeds.take(slice(first, first + size))
