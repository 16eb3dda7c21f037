"""Linkages that meet a request exactly: random steps within their family to smaller merit, and different regions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from synthesis.arrays import Flags, Floats, rows_at
from synthesis.work import Work


@dataclass(frozen=True)
class ImprovementOptions:
    """Options of the improvement of exact linkages."""

    examined: int = 400
    """Number of sampled four-bars, best first, whose motion between the samples is examined."""
    regions: int = 24
    """Number of sampled four-bars that are improved."""
    region_size: float = 0.2
    """Smallest difference of two of them in some number."""
    rounds: int = 7
    """Rounds of the improvement."""
    trials: int = 50
    """Random neighbours of each four-bar that are tried in a round."""
    step: float = 0.2
    """Standard deviation of the first round's changes of the free numbers."""
    step_ratio: float = 0.65
    """Ratio of the changes of two successive rounds."""


class ExactFamily(Protocol):
    """Linkages that meet a request exactly, by their free numbers."""

    @property
    def options(self) -> ImprovementOptions:
        """Options of the improvement."""

    def evaluate(self, parameters: Any) -> Any:
        """Return the linkages of parameters that satisfy the limits, with their merit and their origin in the parameters."""

    def moved(self, parameters: Any, step: float) -> Any:
        """Return random neighbours of parameters."""

    def usable(self, candidates: Any) -> Any:
        """Return the candidates whose motion between the samples is as required."""

    def order(self, candidates: Any) -> tuple[Floats | Flags, ...]:
        """Return the keys (n,) by which candidates are compared, the most important one last."""


def improved(family: ExactFamily, candidates: Any, work: Work) -> Any:
    """Return each candidate moved by random steps within the exact family to a better one.

    Law: by the order of the family, no candidate is worse than before.
    """
    options, step = family.options, family.options.step
    for _ in range(options.rounds):
        if work.expired() or not candidates.merit.size:
            break
        parents = np.repeat(np.arange(candidates.merit.size), options.trials)
        trials = family.usable(family.evaluate(family.moved(rows_at(candidates.parameters, parents), step)))
        combined = candidates._replace(origin=np.arange(candidates.merit.size)).joined(
            trials._replace(origin=parents[trials.origin])
        )
        order = np.lexsort((*family.order(combined), combined.origin))
        candidates = combined.take(order[np.flatnonzero(np.diff(combined.origin[order], prepend=-1))])
        step *= options.step_ratio
    return candidates
