"""Rounds of descents: seeds, few of them to their end, hops about the best, and what of it keeps the limits.

Data flow of a round::

    seeds -> descents in which broken limits weigh more from stage to stage: all a few steps, the best of each valley some
      more, the best of the pool to their end -> on all samples, moved onto the limits that they still break -> `Found`

What is found within the limits is kept, whatever comes after it, and no round depends on the time: more of it never gives less.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Flags, Floats
from synthesis.descents import Pool, Problem, Stage, Timed
from synthesis.kernels import codes, distinct
from synthesis.ranking import NEAR, STANDS_BACK
from synthesis.target import Samples
from synthesis.work import Work

_POOL = 120
_APART, _POOL_APART = 0.01, 0.03
"""By how much two valleys differ (see `Rounds.signature`): among answers, and in the pool."""
_ALIKE = 1e-4
"""Shapes, starts and branches of exact candidates are the same when they differ by less."""
_FLIPPED, _EXCHANGED, _LOOSE_HOP = 0.15, 0.1, 0.5
"""Parts of the hops that change the branch, and the family, and the width of hops along flat directions."""
TIRED = 2.0
"""A valley stands back by this factor of e in J squared for each time that hops started from it."""
_ON_ALL, _VALLEYS, _MOVED = 4, 12, 30
"""Candidates that are refined on all samples, those of the last pool, and those that are moved onto the limits."""
_BETTER = 1.4
"""Candidates are refined on all samples where J squared on the few is at most this part of the least known."""
_EXACT_NEAR = 1e-2
"""J below which an answer that no limit holds is refined in its best pose: an exact one may lie there."""
_KEPT = 1e-13
"""To which an answer must keep equations; other limits it keeps entirely."""
_STOOD = 40
"""Of the pool so many may be begun from, or descend to their end."""
_ORIGINS, _COPIES, _WIDTHS = 8, 6, (1.0, 0.5, 0.25)
"""Valleys that a round's hops begin from, hops from each, and their widths in turn."""
GAIN = 2e-3
"""A round that lowers J by a smaller part gains nothing."""
SAME = 1.01
"""Rounds that lead to J within this factor of the best one found its valley, or one as good, again."""


class Plan(NamedTuple):
    """How a round's seeds descend."""

    first: tuple[Stage, ...]
    going: int = 0
    """So many of the best valleys go on."""
    on: tuple[Stage, ...] = ()
    ended: int = 0
    """So many of the best of the pool descend to their end, where they did not before."""
    end: tuple[Stage, ...] = ()


_SOON, _LATER = Stage(15, 1e-2, 0.3), Stage(12, 1e-2, 1.0)
_ON = (Stage(12, 1e-3, 3.0), Stage(15, 1e-3, 10.0), Stage(15, 1e-3, 30.0))
_END = (Stage(60, 1e-6, 100.0), Stage(60, 1e-6, 300.0), Stage(60, 1e-7, 300.0))
FEW_TO_THEIR_END = Plan((_SOON, _LATER), 12, _ON, 4, _END)
FEWER_ON = Plan((_SOON,), 12, (_LATER, *_ON), 4, _END)
"""Where crank angles are free: after 15 steps the best of a hundred seeds are known as well as after 27."""


LAST = (Stage(60, 1e-9, 100.0), Stage(60, 1e-10, 300.0), Stage(60, 1e-12, 300.0), Stage(60, 1e-13, 300.0))
"""How the best answers descend in the end, on all samples."""


class Found:
    """What is known within the limits, with J on all samples; it only gets better.

    Parameters
    ----------
    tolerance : float
        J below it is exact.
    note : callable
        Told the best J whenever it falls.
    """

    def __init__(self, tolerance: float, note: Callable[[float], None]) -> None:
        self.tolerance, self.note = tolerance, note
        self.pools: dict[Any, Pool] = {}
        """By the chart that the candidates are in; the best of each valley, best first, but that of least J at least second."""
        self.least = self.standing = np.inf
        """The least J, and the least where those that stray stand back."""
        self.led: list[float] = []
        """J that each round led to, on the samples that descents look at."""

    def add(self, rounds: Rounds, pool: Pool) -> None:
        """Take candidates that keep the limits."""
        chart = rounds.chart
        if pool.cost.size:
            known = self.pools[chart].joined(pool) if chart in self.pools else pool
            kept = rounds.valleys(known, _POOL, _APART)
            if known.least < kept.least:  # it strays, and stands behind many others
                least = known.take([int(known.cost.argmin())])
                kept = kept.take(slice(0, 1)).joined(least).joined(kept.take(slice(1, None)))
            self.pools[chart] = kept
            self.standing = min(
                self.standing, np.sqrt(rounds.stood(self.pools[chart].take(slice(0, 1))).min(initial=np.inf))
            )
        if pool.least < self.least:
            self.least = pool.least
            self.note(self.least)

    @property
    def reached(self) -> bool:
        """Whether an answer that does not stray is below the tolerance."""
        return self.standing <= self.tolerance

    def unseen(self, odds: tuple[float, float]) -> float | None:
        """The estimated chance that a better valley was missed; None where an answer is exact. ``odds``: see `Rounds`."""
        return None if self.least <= self.tolerance else unseen(elsewhere(self.led), odds)


def elsewhere(led: Sequence[float]) -> float:
    """The part of rounds that led to more than the least of what they led to, J; half a round at least."""
    least = SAME * min(led, default=1.0)
    return (sum(one > least for one in led) + 0.5) / max(len(led), 1)


def unseen(part: float, odds: tuple[float, float]) -> float:
    """The estimated chance that a better valley was missed, from the part of the rounds that led elsewhere."""
    constant, slope = odds
    return 1 / (1 + math.exp(-constant - slope * math.log(part)))


class Rounds:
    """The rounds of one request in one chart; candidates come with crank angles at the few samples and go with those at all.

    Parameters
    ----------
    whole, thin : Samples
        All samples, and those that descents look at.
    problems : tuple of Problem
        Of all samples without limits; of all within them; of the few, within them where descents keep to them.
    family : str
        That is asked for.
    found : Found
        Where answers go.
    work : Work
    """

    bent_below = np.inf
    """J from which on steps are bent."""
    plan = FEW_TO_THEIR_END
    idle, idle_at_first = 20, np.inf
    """So many rounds that gain nothing end the search, or half as many as there were before, whichever is more; perhaps fewer
    while none has gained anything on what was known before the first."""
    odds = (-0.85, 1.87)
    """The logarithm of the odds that a better valley was missed: a constant, and what the logarithm of the part of the rounds
    that led elsewhere adds. Fitted to `benchmarks.unseen`."""

    def __init__(
        self,
        whole: Samples,
        thin: Samples,
        problems: tuple[Problem, Problem, Problem],
        family: str,
        found: Found,
        work: Work,
    ) -> None:
        self.whole, self.thin, self.found, self.work = whole, thin, found, work
        self.plain, self.within, self.problem = problems
        self.chart = self.plain.chart
        self.holds, self.limited = self.within.limited, self.problem.limited
        """Whether limits hold, and whether descents keep to them."""
        self._exchanges = family in ("full_crank", "any")
        self.random = np.random.default_rng(20)
        self.pool: Pool | None = None
        self._used: Counter[float] = Counter()
        """How often hops started from a valley, by its cost."""
        self._ended: set[float] = set()
        """Costs of those that descended to their end."""
        self._strays: dict[float, bool] = {}
        """By cost, whether those of the pool that were looked at stray between samples."""

    # -- what is asked of those who know the timing -----------------------------------------------------------------

    def signature(self, timed: Timed) -> tuple[Floats, Floats]:
        """Numbers (n, m) that tell valleys apart, and the scale (n,) on which they differ."""
        raise NotImplementedError

    def on_all(self, pool: Pool) -> Pool:
        """Candidates at the few samples, refined on all."""
        raise NotImplementedError

    def thinned(self, timed: Timed) -> Timed:
        """Candidates at all samples at the few alone."""
        raise NotImplementedError

    def turned_apart(self, timed: Timed, width: float) -> Floats:
        """Crank angles (n, N) of candidates that hop."""
        raise NotImplementedError

    def realigned(self, timed: Timed) -> Timed:
        """Candidates in their best pose with the crank angles that fit it best, wherever they lie; none where these are given."""
        return timed.take(slice(0, 0))

    # -- the pool ---------------------------------------------------------------------------------------------------

    @property
    def least(self) -> float:
        """J of the best of the pool, whether it keeps the limits or not."""
        return np.inf if self.pool is None else self.pool.least

    def best(self, most: int) -> Timed:
        """The best valleys of the pool."""
        assert self.pool is not None
        return self.pool.timed.take(slice(0, most))

    def valleys(self, found: Pool, most: int, apart: float) -> Pool:
        """The best of each valley, best first; all that differ of those that reach the tolerance."""
        found = found.take(np.isfinite(found.cost))
        stood = self.stood(found)
        order = np.argsort(stood, kind="stable")
        found, stood = found.take(order), stood[order]
        place = np.column_stack([found.timed.shape, found.timed.angles[:, 0], found.timed.branch])
        rows, scale = self.signature(found.timed)
        exact = int(np.searchsorted(stood, self.found.tolerance**2, side="right"))
        kept = distinct.apart(place[:exact], np.full(exact, _ALIKE), (), 0, most)
        return found.take(distinct.apart(rows, apart * scale, kept, exact, most))

    # -- rounds until they gain nothing -----------------------------------------------------------------------------

    def in_turn(self, seeds: Timed, most: int) -> Iterator[Timed]:
        """Yield seeds, at most this many at a time."""
        for first in range(0, seeds.branch.size, most):
            yield seeds.take(slice(first, first + most))

    def closest(self, seeds: Iterator[Timed], most: float = np.inf) -> Iterator[Timed]:
        """Rounds within the limits until they gain nothing, at most so many; gives what each began from.

        The first two and every third later one begin from seeds, the others from hops.
        """
        number = last = 0
        while number < most:
            if number - last >= (max(self.idle, 0.5 * last) if last else min(self.idle, self.idle_at_first)):
                break
            before = self.found.least, self.found.standing
            begin = next(seeds, None) if number < 2 or number % 3 == 0 else None
            if begin is None:
                if self.pool is None or not self.pool.cost.size:
                    return
                begin = self.hops(_ORIGINS, _COPIES, _WIDTHS[number // 2 % len(_WIDTHS)])
            self.found.led.append(self.round(begin, self.plan))
            number += 1
            if self.found.least < (1 - GAIN) * before[0] or self.found.standing < (1 - GAIN) * before[1]:
                last = number
            yield begin
        if self.pool is not None and self.thin is not self.whole:
            self._answer(self.pool, _VALLEYS)
        if self.chart in self.found.pools:
            best = self.found.pools[self.chart].timed.take(slice(0, _ON_ALL))
            self.keep(self.within.descended(best, LAST, 0.3 * self.found.tolerance, self.work))

    # -- a round ----------------------------------------------------------------------------------------------------

    def round(self, seeds: Timed, plan: Plan) -> float:
        """Descents from seeds that have crank angles at the few samples; J of the best that they led to."""
        found = self._descended(seeds, plan.first)
        if plan.on:
            going = self.valleys(found, plan.going, _POOL_APART)
            self._first_answer(going)
            found = self._descended(going.timed, plan.on)
        self._take(found)
        led = found.least
        assert self.pool is not None
        best = [k for k in range(min(plan.ended, self.pool.cost.size)) if self.pool.cost[k] not in self._ended]
        if best and not (self.found.reached or self.work.expired()):
            before = set(self.pool.cost[best])
            found = self._descended(self.pool.take(best).timed, plan.end)
            self._ended |= before | set(found.cost)
            self._take(found)
            led = min(led, found.least)
        return led

    def _descended(self, timed: Timed, stages: tuple[Stage, ...]) -> Pool:
        exact, between = 0.3 * self.found.tolerance, self._first_answer if len(stages) > 2 else None
        return self.problem.descended(timed, stages, exact, self.work, bent_below=self.bent_below, between=between)

    def _take(self, found: Pool) -> None:
        """Into the pool; and what is worth it among the answers."""
        found = found.take(np.isfinite(found.cost))
        self.pool = self.valleys(found if self.pool is None else self.pool.joined(found), _POOL, _POOL_APART)
        if self.limited or not self.holds or found.least <= self.found.tolerance:
            self._answer(found)

    def strays(self, timed: Timed) -> Flags:
        """Whether candidates go elsewhere between samples than anybody asked for, where that counts, (n,)."""
        return np.zeros(timed.branch.size, dtype=bool)

    def stood(self, pool: Pool) -> Floats:
        """J squared, of those that stray by as much more as they count in a ranking (see `ranking.NEAR`)."""
        new = [k for k, value in enumerate(pool.cost.tolist()) if value not in self._strays]
        if new:
            self._strays.update(zip(pool.cost[new].tolist(), self.strays(pool.timed.take(new)).tolist()))
        strays = [self._strays[value] for value in pool.cost.tolist()]
        return np.where(strays, np.maximum(STANDS_BACK**2 * pool.cost, NEAR**2), pool.cost)

    # -- answers ----------------------------------------------------------------------------------------------------

    def _first_answer(self, pool: Pool) -> None:
        """What a stage led to, where nothing is known yet."""
        if not np.isfinite(self.found.least):
            self._answer(pool)

    def _answer(self, pool: Pool, most: int = _ON_ALL) -> None:
        """Candidates at the few samples, on all, to `keep`: at most so many, of those that may be better than what is known."""
        if not (pool.cost.size and self._counts):
            return
        if self.thin is not self.whole:
            pool = pool.take(np.argsort(pool.cost, kind="stable")[:most])
            pool = pool.take(pool.cost <= (np.inf if most > _ON_ALL else _BETTER) * self.found.least**2)
            pool = self.on_all(pool) if pool.cost.size else pool
        self.keep(pool)

    @property
    def _counts(self) -> bool:
        """Whether what a descent led to counts: one that the time cut short does only where nothing else is known.

        More time would lead it elsewhere, and an answer must not be lost by that.
        """
        return not (self.work.expired() and np.isfinite(self.found.least))

    def keep(self, pool: Pool, rounds: int = 12) -> None:
        """Add those of candidates at all samples that keep the limits, or can be moved onto them, to the answers.

        Parameters
        ----------
        pool : Pool
        rounds : int
            Steps towards the limits.
        """
        if not (pool.cost.size and self._counts):
            return
        if not self.holds:
            self.found.add(self, pool)
            return
        merit = pool.cost + self.within.lacking(pool.timed)[0]
        moved, broken = self.within.moved_onto(pool.timed.take(np.argsort(merit, kind="stable")[:_MOVED]), rounds)
        self.found.add(self, moved.take((broken <= _KEPT) & np.isfinite(moved.cost)))
        near = moved.take(moved.cost < _EXACT_NEAR**2)
        if near.cost.size:
            done = self.plain.descended(near.timed, [Stage(30, 1e-2)], 0.3 * self.found.tolerance, self.work)
            if self._counts:
                self.found.add(self, done.take(self.within.lacking(done.timed)[1] <= _KEPT))

    # -- hops -------------------------------------------------------------------------------------------------------

    def hops(self, origins: int, copies: int, width: float = 1.0) -> Timed:
        """Perturbed copies of the best valleys that were perturbed least often.

        Some are moved in all unknowns alike, which reaches other valleys, and where crank angles are free they begin from the
        best ones of their shapes too; as many are moved where the cost is flat, which reaches other minima of a long valley.
        """
        assert self.pool is not None
        best = self.pool.take(slice(0, _STOOD))
        cost = best.cost
        rank = np.log(np.maximum(self.stood(best), 1e-300)) + TIRED * np.array([self._used[value] for value in cost])
        chosen = np.argsort(rank, kind="stable")[:origins]
        self._used.update(cost[chosen])
        hop = best.timed.take(np.repeat(chosen, copies // 2))
        wide = self._wide_steps(hop, width)
        return wide.joined(self.realigned(wide), self.problem.loose_steps(hop, self.random, _LOOSE_HOP))

    def _wide_steps(self, timed: Timed, width: float) -> Timed:
        """Candidates moved in shape and timing, with heavy tails, some to the other branch, some to the other family."""
        random, (count, size) = self.random, timed.shape.shape
        noise = width * random.standard_t(3, size=(count, size)) * self.chart.hop[:-1]
        shape = self.chart.hopped(timed.shape, noise)
        branch = np.where(random.random(count) < _FLIPPED, -timed.branch, timed.branch)
        exchanged = random.random(count) < _EXCHANGED
        if self._exchanges and self.chart.kind == codes.GRASHOF:  # crank-rockers from double-cranks and back
            shape[:, 0] *= np.where(exchanged, -1.0, 1.0)
        return timed._replace(shape=shape, angles=self.turned_apart(timed, width), branch=branch)
