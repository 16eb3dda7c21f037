"""Unknown dimensions that reproduce a wanted pattern of verdicts, and how far from unique they are.

Every entry of the pattern has a margin that is positive where its verdict is the wanted one. The search makes the smallest of
them as large as it can: seeded draws over the ranges, then linear programs on the margins' slopes from the best draws.
A pattern of yes and no bounds values and never fixes them; how far it bounds them is part of the answer.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from synthesis.one_variable import Flags, Floats, bisect
from synthesis.scenes.knotter.conditions import Condition
from synthesis.scenes.knotter.mechanism import Mechanism, varied
from synthesis.work import OutOfTime, Work

ITERATIONS, FIRST_REACH, LAST_REACH = 30, 0.15, 1e-3
"""Linear programs of one descent; how far the first may go and when the last has come too close, in shares of the ranges."""
STEP = 4e-3
"""Step of the differences, in shares of the ranges: a set that does not keep the pattern so far around it is worth less."""
PLACES, HALVINGS = 24, 18
"""Places looked at along a direction for the first broken verdict, and halvings of the gap before it."""
LONGER = 1e3
"""Times the budget that the first set takes at most: there is no answer before."""
DRAWING = 0.5
"""Part of the budget that draws leave to the descents."""
FIRST_TOGETHER, TOGETHER = 8, 64
"""Draws that are judged before the first look at the time, and at most between two others, each time twice as many."""
RANK = 1e-6
"""Singular values below this share of the largest count as zero."""


@dataclass(frozen=True)
class Wanted:
    """Verdicts wanted of one condition."""

    condition: Condition
    items: Mapping[str, Floats]
    """The dimensions in which the entries differ, shape (entries,)."""
    holds: Flags
    """Shape (entries,)."""


class Pattern:
    """The margins of all wanted verdicts as functions of unknown dimensions, given as shares of their ranges.

    Law: an entry is positive where its verdict is the wanted one.
    """

    def __init__(
        self, mechanism: Mechanism, wanted: Sequence[Wanted], ranges: Mapping[str, tuple[float, float]]
    ) -> None:
        self.mechanism, self.wanted, self.names = mechanism, tuple(wanted), tuple(ranges)
        self.low, self.high = np.array(list(ranges.values())).T

    def values(self, share: Floats) -> Floats:
        """Dimensions from shares."""
        return self.low + share * (self.high - self.low)

    def shares(self, values: Floats) -> Floats:
        """Shares from dimensions."""
        return (values - self.low) / (self.high - self.low)

    def margins(self, shares: Floats, work: Work) -> Floats:
        """Margins, shape (candidates, entries), of candidates of shape (candidates, unknowns)."""
        values, count, found = self.values(shares), len(shares), []
        for part in self.wanted:
            entries = len(part.holds)
            items = {name: np.repeat(values[:, k], entries) for k, name in enumerate(self.names)}
            items |= {name: np.tile(column, count) for name, column in part.items.items()}
            result = part.condition.evaluate(varied(self.mechanism, items), count * entries, work)
            sign = np.where(part.holds, 1.0, -1.0)
            found.append(result.margin.reshape(count, entries) * sign)
        return np.concatenate(found, axis=1)

    def found(self, share: Floats, work: Work) -> Found:
        """Margins and their derivatives at a set of shape (unknowns,).

        A margin jumps where another window of the rope becomes the first: there the side without the jump counts.
        """
        steps, count = STEP * np.eye(len(share)), len(share)
        at = self.margins(np.concatenate([share[None], share + steps, share - steps]), work)
        forward, backward = (at[1 : count + 1] - at[0]) / STEP, (at[0] - at[count + 1 :]) / STEP
        size = np.maximum(np.abs(forward), np.abs(backward))
        smaller = np.where(np.abs(forward) < np.abs(backward), forward, backward)
        slopes = np.where(np.abs(forward - backward) <= 0.5 * size, 0.5 * (forward + backward), smaller).T
        return Found(share, at[0], slopes, float(at.min()))


@dataclass(frozen=True)
class Found:
    """One set of dimensions."""

    share: Floats
    """As shares of the ranges, shape (unknowns,)."""
    margins: Floats
    """Shape (entries,)."""
    slopes: Floats | None
    """Derivatives of the margins by the shares, shape (entries, unknowns); None where the time was up before they were known."""
    around: float
    """The smallest margin of this set and of those one `STEP` away along each unknown, as far as these are known."""

    @property
    def worst(self) -> float:
        """The smallest margin; positive where the whole pattern comes out."""
        return float(self.margins.min())


@dataclass(frozen=True)
class Direction:
    """A direction of the unknowns along which the pattern is kept for a while."""

    strength: float
    """How fast the margins change along it, length per share of the ranges; 0: not at all."""
    back: float
    """How far the pattern is kept, in shares of the ranges; to their ends at most."""
    forth: float
    vector: Annotated[Floats, dict[str, float]]
    """In shares of the ranges, of length 1."""


def search(
    pattern: Pattern, draws: int, descents: int, seed: int, start: Floats | None = None, work: Work | None = None
) -> tuple[list[Found], int]:
    """Sets of dimensions with their smallest margin as large as it was found, best first, and how many draws kept the pattern.

    ``draws``, ``descents``: draws over the ranges, and how many of the best are improved; with 0 descents a start stays
    as it is. ``start`` (unknowns,): shares of one more start, improved as well. ``work``: its end ends the improvement;
    the best so far is the answer.
    """
    work = work or Work()
    first, drawing = work.extended(LONGER), work.extended(-DRAWING)
    random = np.random.default_rng(seed)
    unknowns = len(pattern.names)
    # one draw in each of `draws` equal parts of every range
    shares = (
        random.permuted(np.tile(np.arange(draws), (unknowns, 1)), axis=1).T + random.random((draws, unknowns))
    ) / draws
    kept = 0
    starts = [] if start is None else [start]
    if draws and descents:
        worst = np.full(draws, -np.inf)
        begin, together = 0, FIRST_TOGETHER
        while begin < draws and not (begin and drawing.expired()):
            some = slice(begin, begin + together)
            worst[some] = pattern.margins(shares[some], first).min(axis=1)
            begin, together = begin + together, min(2 * together, TOGETHER)
        kept = int(np.count_nonzero(worst > 0))
        best = np.argsort(-worst, kind="stable")[:descents]
        starts += list(shares[best[np.isfinite(worst[best])]])
    found: list[Found] = []
    for share in starts:
        if found and work.expired():
            break
        try:
            found.append(_improved(pattern, share, work) if descents else pattern.found(share, work))
        except OutOfTime:  # before its slopes are known
            if not found:
                margins = pattern.margins(share[None], first)[0]
                found.append(Found(share, margins, None, float(margins.min())))
    return sorted(found, key=lambda one: (one.worst <= 0, -one.around)), kept


def _improved(pattern: Pattern, share: Floats, work: Work) -> Found:
    """The smallest margin around a set made larger by linear programs within a reach that shrinks where they promise too much."""
    from scipy.optimize import linprog

    best = pattern.found(share, work)
    reach, count = FIRST_REACH, len(share)
    for _ in range(ITERATIONS):
        if reach < LAST_REACH or work.expired():
            break
        assert best.slopes is not None
        # the largest t with margin + slope . step >= t for every entry
        rows = np.column_stack([-best.slopes, np.ones(len(best.margins))])
        low, high = np.maximum(-reach, -best.share), np.minimum(reach, 1 - best.share)
        bounds = [*zip(low, high), (None, None)]
        solved = linprog(np.append(np.zeros(count), -1.0), A_ub=rows, b_ub=best.margins, bounds=bounds)
        if not solved.success:
            break
        try:
            trial = pattern.found(np.clip(best.share + solved.x[:count], 0.0, 1.0), work)
        except OutOfTime:
            break
        gain, promised = trial.around - best.around, -solved.fun - best.worst
        if gain > 0.1 * promised > 0:
            best = trial
            reach = min(2 * reach, 0.5) if gain > 0.7 * promised else reach
        else:
            reach *= 0.4
    return best


def extents(pattern: Pattern, share: Floats, vectors: Floats, work: Work) -> Floats:
    """How far the pattern is kept from a set along vectors, shape (n, unknowns), in their own length; to the ranges at most."""
    with np.errstate(divide="ignore", invalid="ignore"):
        room = np.where(vectors > 0, (1 - share) / vectors, np.where(vectors < 0, -share / vectors, np.inf)).min(
            axis=1
        )

    def keeps(lengths: Floats) -> Flags:
        return np.asarray(pattern.margins(share + lengths[:, None] * vectors, work).min(axis=1) > 0)

    along = np.linspace(0, 1, PLACES + 1)[1:]
    places = share + (room[:, None] * along)[..., None] * vectors[:, None]
    margins = pattern.margins(np.clip(places, 0, 1).reshape(-1, len(share)), work).min(axis=1)
    broken = margins.reshape(len(vectors), PLACES) <= 0
    first = np.argmax(broken, axis=1)
    whole = ~broken.any(axis=1)
    inner = room * np.where(whole, 1.0, along[first] - along[0])
    outer = room * np.where(whole, 1.0, along[first])
    return bisect(keeps, inner, outer, HALVINGS)[0]


def directions(pattern: Pattern, found: Found, work: Work | None = None) -> list[Direction]:
    """Orthogonal directions of the unknowns, those that change the margins least first, each with how far it keeps the pattern.

    They are the right singular vectors of the margins' slopes: along one of strength 0 no margin changes to first order.
    """
    work, share = work or Work(), found.share
    assert found.slopes is not None, "a set that a search was cut short at has none"
    _, strengths, vectors = np.linalg.svd(found.slopes)
    strengths = np.append(strengths, np.zeros(len(share) - len(strengths)))
    forth = extents(pattern, share, vectors, work)
    back = extents(pattern, share, -vectors, work)
    rows = zip(vectors, strengths, back, forth)
    return [Direction(float(s), float(b), float(f), v) for v, s, b, f in rows][::-1]


def rank(found: Sequence[Direction]) -> int:
    """How many directions change the margins to first order."""
    strengths = np.array([direction.strength for direction in found])
    return int(np.count_nonzero(strengths > RANK * strengths.max()))


def single_ranges(pattern: Pattern, share: Floats, work: Work | None = None) -> list[tuple[float, float]]:
    """The range of each unknown within which the pattern is kept while the others stay."""
    axes, work = np.eye(len(share)), work or Work()
    below, above = extents(pattern, share, -axes, work), extents(pattern, share, axes, work)
    size = pattern.high - pattern.low
    low, high = pattern.values(share) - below * size, pattern.values(share) + above * size
    return [(float(a), float(b)) for a, b in zip(low, high)]
