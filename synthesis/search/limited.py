"""The search where no linkage may be exact, or limits hold: the best there is, from seeds that know the limits.

Data flow::

    windows of a coarse table in the best pose within the limits -> seeds, the first that keep all limits are answers
      -> descents under constraints, in rounds: more seeds and hops about the best valleys in turn
      -> the best of each round on all samples, moved onto the limits that they still break
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from synthesis.mechanism import Bounded
from synthesis.search.constrained import Descended, Plan, descend, restored
from synthesis.search.placed import PosedProblem, ShapeProblem, problem_of
from synthesis.search.windows import Windows
from synthesis.target import Target
from synthesis.work import Work

Floats = NDArray[np.float64]

_SAMPLES = 16
_SEEDS, _FURTHER = 60, 100
"""Seeds of the first round, and of each later one."""
_FIRST = 24
"""Seeds that may be answers at once."""
_VALLEYS, _POLISHED = 24, 10
_ORIGINS, _COPIES = 8, 8
_ROUNDS = 6
_GAIN = 2e-3
"""A round that lowers J by a smaller part has gained nothing; two in a row end the search."""
_ALIKE = 1e-3
"""Candidates whose J^2 differ by a smaller part lie in one valley."""
_SAME_LENGTHS = 0.3
"""Logarithms of lengths by which candidates of one valley differ at most."""
_OPTIMA = 14
_KEPT = 1e-13
"""To which an answer must keep equations; other constraints it keeps entirely."""

_DOWN = Plan(15, (0.1, 0.3, 1.0, 3.0, 10.0), 3)
_ON = Plan(24, (3.0, 10.0, 30.0, 100.0), 4)
_TO_THE_END = Plan(30, (10.0, 30.0, 100.0, 300.0), 5)
_STATIONARY = Plan(60, (100.0, 300.0, 1000.0), 8)


def search_limited(
    target: Target, way: Bounded, windows: Windows, work: Work, note: Callable[[Floats], None]
) -> tuple[Descended, ShapeProblem, int]:
    """The best candidates for a target within limits.

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

    Returns
    -------
    candidates : Descended
        Best first, of different valleys; on all samples, every one within the limits.
    problem : ShapeProblem
        Whose unknowns they have.
    seeds : int
        How many descents began.
    """
    run = _Run(target, way, windows, work, note)
    run.search()
    return run.optima(), run.whole, run.used


class _Run:
    def __init__(
        self, target: Target, way: Bounded, windows: Windows, work: Work, note: Callable[[Floats], None]
    ) -> None:
        self.work, self.note = work, note
        self.rough, self.whole = problem_of(target.condensed(_SAMPLES), way), problem_of(target, way)
        # far random numbers, the same for every request
        self.random = np.random.default_rng(20)
        self.seeds = windows.seeds(self.rough, way.on_shape, way.boxes)
        self.used = 0
        nothing = np.empty(0)
        self.pool = Descended(np.empty((0, self.rough.unknowns)), nothing, nothing, nothing)
        self.answers = self.pool
        self.polished = nothing
        """Costs in the pool of candidates that were refined on all samples."""

    def search(self) -> None:
        """Rounds until they gain nothing."""
        self.first_answers()
        idle, best = 0, np.inf
        for number in range(_ROUNDS):
            if number % 2:
                unknowns, branch = self.hops(1.0 if number % 4 == 1 else 0.5)
            else:
                unknowns, branch = self.fresh(_FURTHER if number else _SEEDS)
            self.round(unknowns, branch, 1.0 if number == 0 else 0.5)
            found = self.least()
            idle = idle + 1 if found > best * (1 - _GAIN) and np.isfinite(found) else 0
            best = min(best, found)
            if idle == 2 or self.work.expired():
                break

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
        best = _valleys(self.pool, _ORIGINS, 5 * _ALIKE)
        unknowns, branch = np.repeat(best.unknowns, _COPIES, axis=0), np.repeat(best.branch, _COPIES)
        flipped = self.random.random(len(branch)) < 0.12
        return self.rough.hopped(unknowns, self.random, width), np.where(flipped, -branch, branch)

    def first_answers(self) -> None:
        """The best seeds, where they keep the limits or can be moved onto them."""
        unknowns, branch = self.seeds.unknowns[:_FIRST], self.seeds.branch[:_FIRST]
        if len(branch):
            self.keep(restored(self.whole, Descended(unknowns, branch, np.empty(0), np.empty(0)), 4))

    def round(self, unknowns: Floats, branch: Floats, share: float) -> None:
        """Descents from some candidates; the best of the pool is polished on all samples."""
        if len(branch):
            found = descend(self.rough, unknowns, branch, _DOWN, self.work)
            found = _valleys(found, int(_VALLEYS * share), _ALIKE, slack=1.0)
            found = descend(self.rough, found.unknowns, found.branch, _ON, self.work)
            self.pool = self.pool.joined(found)
        best = _valleys(self.pool, int(_POLISHED * share), _ALIKE, slack=1.0)
        new = ~np.any(np.abs(best.cost[:, None] - self.polished) <= _ALIKE * best.cost[:, None], axis=1)
        best = best.take(new)
        if len(best.branch):
            self.polished = np.append(self.polished, best.cost)
            best = descend(self.whole, best.unknowns, best.branch, _TO_THE_END, self.work)
            self.keep(restored(self.whole, best))

    def optima(self) -> Descended:
        """The answers, the best of them descended to their end, one of each valley."""
        best = _valleys(self.answers, _OPTIMA, _ALIKE)
        if len(best.branch):
            self.keep(restored(self.whole, descend(self.whole, best.unknowns, best.branch, _STATIONARY, self.work)))
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
        """Take those that keep the limits as answers."""
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
