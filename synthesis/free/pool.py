"""What the rounds of a search without crank angles hand on: candidates with their costs, thinned out to distinct ones."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.free.joint import JointProblem, Refined, Timed

Floats = NDArray[np.float64]


class Pool(NamedTuple):
    """Candidates and their costs, J squared."""

    timed: Timed
    cost: Floats

    @classmethod
    def of(cls, refined: Refined) -> Pool:
        """The candidates of a descent."""
        return cls(refined.timed, refined.cost)

    @classmethod
    def measured(cls, problem: JointProblem, timed: Timed) -> Pool:
        """Candidates in their best pose, as they are."""
        turned = problem.turned(timed, derivatives=False)
        timed = problem.posed(timed, turned)
        return cls(timed, problem.cost(problem.residual(timed, turned), turned.body))

    def take(self, places: Any) -> Pool:
        """Some of the candidates."""
        return Pool(self.timed.take(places), self.cost[places])

    def joined(self, other: Pool) -> Pool:
        """These candidates and others after them."""
        return Pool(self.timed.joined(other.timed), np.concatenate([self.cost, other.cost]))

    @property
    def least(self) -> float:
        """The best J; infinite where there is no candidate."""
        return float(np.sqrt(self.cost.min())) if self.cost.size else np.inf

    def best(self, most: int, cell: float = 0.02) -> Pool:
        """The best candidates, best first, at most one a cell of shape and place; those that do not close left out."""
        timed = self.timed
        order = np.argsort(self.cost, kind="stable")
        order = order[np.isfinite(self.cost[order])]
        first = timed.angles[:, 0]
        place = [timed.shape, np.cos(first)[:, None], np.sin(first)[:, None], timed.branch[:, None]]
        place += [timed.pose.real, timed.pose.imag]
        numbers = np.concatenate(place, axis=1)[order]
        size = np.maximum(1.0, np.abs(numbers))
        keys = np.round(np.sign(numbers) * (1 + np.log(size)) * np.minimum(1.0, np.abs(numbers)) / cell)
        _, kept = np.unique(np.nan_to_num(keys), axis=0, return_index=True)
        return self.take(order[np.sort(kept)[:most]])
