"""Options of the multistart search."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from synthesis.descents import Stage


class Schedule(NamedTuple):
    """Refinement of the candidates of a round."""

    first: tuple[Any, ...]
    """Stages for all starting points."""
    survivors: int = 0
    """Number of basins that continue after the first stages."""
    continuation: tuple[Any, ...] = ()
    """Stages for the survivors; without any the round continues with all candidates."""
    leading: int = 0
    """Number of leading basins of a group in the pool that may be refined to convergence, unless they were before; with 0
    the basins of the round, in the pool or not."""
    finished: int = 0
    """Largest number of basins of a group that a round refines to convergence."""
    end: tuple[Any, ...] = ()
    """Stages that refine a basin to convergence."""


_CONTINUATION = (Stage(12, 1e-3, 3.0), Stage(15, 1e-3, 10.0), Stage(15, 1e-3, 30.0))
_END = (Stage(60, 1e-6, 100.0), Stage(60, 1e-6, 300.0), Stage(60, 1e-7, 300.0))
_EARLY, _LATE = Stage(15, 1e-2, 0.3), Stage(12, 1e-2, 1.0)
SELECTED_LATE = Schedule((_EARLY, _LATE), 12, _CONTINUATION, 4, 4, _END)
"""Select after 27 steps."""
SELECTED_EARLY = Schedule((_EARLY,), 12, (_LATE, *_CONTINUATION), 4, 4, _END)
"""Select after 15 steps: with free crank angles the best candidates are known as well after 15 steps as after 27."""
POLISH = (Stage(120, 1e-10, 100.0), Stage(120, 1e-13, 300.0))
"""Stages that refine the best answers on all samples to convergence when the search ends."""
COMPLETION = Stage(40, 1e-4, 30.0)


@dataclass(frozen=True)
class SearchOptions:
    """Options of the multistart search.

    Distances between basins are relative to the scale that a problem's signature states, gains and errors to the error J.
    """

    schedule: Schedule = SELECTED_LATE
    """Refinement of the candidates of a round."""
    completion: Stage = COMPLETION
    """Refinement of a candidate on all samples."""
    polish: tuple[Any, ...] = POLISH
    """Stages of the last refinement of the best answers."""
    polished: int = 4
    """Number of answers of a group that are polished at the end."""
    max_pool: int = 120
    """Number of basins of a group that the pool and the incumbents keep."""
    pool_distance: float = 0.03
    """Distance below which two candidates of the pool belong to the same basin."""
    answer_distance: float = 0.01
    """Distance below which two incumbents belong to the same basin."""
    exact_distance: float = 1e-4
    """Difference of shape, start and branch below which two exact candidates are the same."""
    seed_rounds: int = 2
    """Number of rounds that start from seeds; the later ones start from perturbations."""
    origins: int = 8
    """Number of basins of a group that are perturbed in a round."""
    copies: int = 6
    """Number of perturbations of a basin."""
    gain: float = 2e-3
    """A round that lowers the error by a smaller fraction does not count as a gain."""
    idle_rounds: float = 10
    """Number of rounds without a gain that end the search."""
    idle_fraction: float = 0.5
    """The search continues at least for this fraction of the rounds up to its last gain."""
    idle_rounds_at_first: float = np.inf
    """Number of rounds that end a search without any gain on earlier incumbents, if it is below ``idle_rounds``."""
    idle_rounds_unanswered: float = 0
    """Number of further idle rounds for a group without any answer."""
    drop_exact: bool = False
    """End the search of a group once it has an exact answer."""
    refined_on_all: int = 4
    """Number of candidates of a round that are refined on all samples."""
    final_basins: int = 12
    """Number of basins of the pool that are refined on all samples when the search ends."""
    restored: int = 30
    """Number of candidates that Newton steps move onto the limits."""
    restoration_steps: int = 12
    """Number of these steps."""
    equation_tolerance: float = 1e-13
    """Largest violation of an equation among the limits; inequalities hold exactly."""
    nearly_exact: float = 1e-2
    """Error below which an answer is refined without limits too: an exact linkage may be near."""
    flipped: float = 0.15
    """Fraction of the perturbations that change the branch."""
    seed: int = 20
    """Seed of the random numbers."""
