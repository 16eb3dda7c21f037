"""The search where no linkage may be exact, or limits hold: the best there is, from seeds that know the limits.

Data flow::

    windows of a coarse table in the best pose within the limits -> seeds, the first that keep all limits are answers
      -> descents under constraints, in rounds: seeds first, then further seeds and hops about the best valleys
      -> the best of each round moved onto the limits that they still break: answers
      -> the best valleys of all rounds, descended to their end on all samples
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from synthesis.mechanism import Bounded
from synthesis.search.constrained import Descended, Plan, descend, restored
from synthesis.search.placed import PosedProblem, problem_of
from synthesis.search.windows import Windows
from synthesis.target import Target
from synthesis.work import Work

Floats = NDArray[np.float64]

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
