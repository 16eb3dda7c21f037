"""Link lengths that can be had: on a grid or from a list of stock lengths, with start, pose and offset fitted anew.

Which combination of stock lengths is best is a closest-point problem: near a solution the squared objective is a square form of
the four logarithms, whose triangle says how much each choice costs at least, link by link (Fincke and Pohst, Mathematics of
Computation 44 (1985), 463-471). So combinations come in the order of that estimate; each is then judged by a scan of its own.
"""

from __future__ import annotations

import bisect
import heapq
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.limits import Limits
from synthesis.fourbar.placement import place, response_to_lengths, scan
from synthesis.fourbar.solution import Solution
from synthesis.target import Target
from synthesis.work import Work

Floats = NDArray[np.float64]

GRID_TRIES = 300
"""Combinations around the nearest that are tried at most; they come in the order of their estimate."""
AROUND = 3
"""Where the nearest lengths of a grid break a limit, so many steps to each side are looked at."""
MOST_OPEN = 1 << 17
"""Choices of some links whose others are not chosen yet: about 50 MB."""
_TOGETHER = 64
"""Combinations that are scanned at once."""
_PLACED = 8
"""Combinations that are refined at once."""
_MOST_PLACED = 64
_SCANS_OF_PLACING = 16
"""Within limits a place is found in the time of more scans than this: of few tries fewer are refined, at least `_PLACED`."""
_WORSE = 2.0
"""A combination whose squared objective in the scan, over fewer samples, is so many times the best one refined is given up."""
_NEARER = 1e-3
"""Weight of a length's own change beside the estimate: of lengths that the motion does not fix the nearest come first."""


@dataclass(frozen=True)
class Rounding:
    """What came of looking for lengths that can be had.

    Attributes
    ----------
    solution : Solution or None
        The best; None where no combination that was tried has a place within the limits.
    tried : int
        How many combinations were fitted.
    combinations : int or None
        How many there are; None for a grid, which has no end.
    exhaustive : bool or None
        Whether the choice is the best of all combinations: every one was scanned over the whole turn of the start, and refined
        unless the scan shows it to be worse. None for a grid.
    """

    solution: Solution | None
    tried: int
    combinations: int | None = None
    exhaustive: bool | None = None


def round_to_grid(
    target: Target, solution: Solution, grid: float, limits: Limits, tries: int, work: Work
) -> Rounding:
    """The solution with its links on a grid and everything else fitted anew, within the limits.

    Parameters
    ----------
    target : Target
        With positions: only then are lengths actual.
    solution : Solution
    grid : float
        Step of the lengths, in the user's unit; a link is at least one step long.
    limits : Limits
    tries : int
        At most so many combinations, where the nearest lengths do not do.
    work : Work
        Asked between steps whether the answer is still wanted; its budget is the search's.

    Returns
    -------
    Rounding
        The nearest lengths, or where these break a limit in every place the best combination around them. Law: no length is off
        the grid but those that the limits give; where the nearest lengths do, none moved by more than half a step (or up to one).
    """
    old, given = solution.linkage, _given(limits)
    steps = np.maximum(np.round(np.array(old.links) / grid), 1.0)
    links = np.where(np.isnan(given), steps * grid, given)[None]
    starts = scan(target, links, old.branch, limits)[1]
    if (found := place(target, links, old.branch, starts, old, limits)[0]) is not None:
        return Rounding(found, 1)
    near = [np.arange(max(1.0, step - AROUND), step + AROUND + 1) * grid for step in steps]
    near = [values if np.isnan(length) else np.array([length]) for values, length in zip(near, given)]
    best = _best_of(target, solution, near, limits, min(tries, GRID_TRIES), work)
    return Rounding(best.solution, best.tried)


def best_from_stock(
    target: Target, solution: Solution, stock: Sequence[float], limits: Limits, tries: int, work: Work
) -> Rounding:
    """The solution with each link of a stock length and everything else fitted anew, within the limits; arguments as above.

    Returns
    -------
    Rounding
        Law: each length is one of the stock; where it is exhaustive no combination is better.
    """
    choices = [np.unique(stock) if np.isnan(length) else np.array([length]) for length in _given(limits)]
    return _best_of(target, solution, choices, limits, tries, work)


def _given(limits: Limits) -> Floats:
    """Lengths that the limits give, which are no choice, (4,); NaN for the others."""
    given = np.array([np.nan if length is None else length for length in limits.links])
    if limits.pivot_a is not None and limits.pivot_b is not None:
        given[3] = abs(limits.pivot_b - limits.pivot_a)
    return given


def _best_of(
    target: Target, solution: Solution, choices: Sequence[Floats], limits: Limits, tries: int, work: Work
) -> Rounding:
    """The best combination of lengths, one of each of four lists."""
    old = solution.linkage
    every = int(np.prod([float(values.size) for values in choices]))
    order = _nearest_first(target, solution, choices)
    tried, found = 0, []
    while tried < tries and (links := np.array(list(itertools.islice(order, min(_TOGETHER, tries - tried))))).size:
        work.check()
        found.append((links, *scan(target, links, old.branch, limits)))
        tried += len(links)
    links, cost, starts = (np.concatenate(columns) for columns in zip(*found))
    best: Solution | None = None
    refined_all = True
    ranked = np.flatnonzero(np.isfinite(cost))[np.argsort(cost[np.isfinite(cost)], kind="stable")]
    for first in range(0, ranked.size, _PLACED):
        if best is not None and cost[ranked[first]] > _WORSE * best.errors.objective**2:
            break
        if first >= min(_MOST_PLACED, max(_PLACED, tries // _SCANS_OF_PLACING)):
            refined_all = False
            break
        work.check()
        some = ranked[first : first + _PLACED]
        for one in place(target, links[some], old.branch, starts[some], old, limits):
            if one is not None and (best is None or one.errors.objective < best.errors.objective):
                best = one
    return Rounding(best, tried, every, tried == every and refined_all)


def _nearest_first(target: Target, solution: Solution, choices: Sequence[Floats]) -> Iterator[Floats]:
    """Combinations of lengths, one of each rising list, by their estimated objective; best first."""
    old = solution.linkage
    triangle, right = response_to_lengths(target, old)
    size = _NEARER * max(float(np.abs(triangle).max()), np.finfo(float).tiny)
    stack = np.concatenate([np.column_stack([triangle, right]), size * np.eye(4, 5)])
    upper: Any = np.linalg.qr(stack, mode="r")
    moved = [np.log(values / length) for values, length in zip(choices, old.links)]
    for chosen in nearest_of(upper, [column.tolist() for column in moved]):
        yield np.array([values[place] for values, place in zip(choices, chosen)])


def nearest_of(upper: Floats, moved: Sequence[Sequence[float]]) -> Iterator[tuple[int, ...]]:
    """Places in lists of numbers d_k, one in each, by ``|upper[:4, :4] @ d + upper[:4, 4]|^2``; the least first.

    Where lengths are so badly determined that more than `MOST_OPEN` choices are open, those are left out that stand beside the
    ones looked at from then on.

    Parameters
    ----------
    upper : ndarray, shape (5, 5)
        Upper triangular, no zero on its diagonal.
    moved : sequence of sequence of float
        Each rising.
    """
    rows = [[float(value) for value in row] for row in upper]
    # A node is a choice for the last links; its children choose the link before, the nearest first. Along a rising list that is
    # from the nearest outward, so an open node is two places in it: there may be a hundred thousand of them.
    heap: list[tuple[float, tuple[int, ...], int, int, float, float]] = []

    def push(chosen: tuple[int, ...], below: int, above: int, bound: float, rest: float) -> None:
        link = 3 - len(chosen)
        column, slope = moved[link], rows[link][link]
        costs = [
            bound + (gap := slope * column[place] + rest) * gap if 0 <= place < len(column) else math.inf
            for place in (below, above)
        ]
        if costs[0] <= costs[1] and below >= 0:
            heapq.heappush(heap, (costs[0], (below, *chosen), below - 1, above, bound, rest))
        elif above < len(column):
            heapq.heappush(heap, (costs[1], (above, *chosen), below, above + 1, bound, rest))

    def open_node(bound: float, chosen: tuple[int, ...]) -> None:
        link = 3 - len(chosen)
        row = rows[link]
        rest = row[4] + sum(row[link + 1 + k] * moved[link + 1 + k][place] for k, place in enumerate(chosen))
        above = bisect.bisect_left(moved[link], -rest / row[link])
        push(chosen, above - 1, above, bound, rest)

    open_node(0.0, ())
    while heap:
        bound, chosen, below, above, before, rest = heapq.heappop(heap)
        if len(heap) < MOST_OPEN:
            push(chosen[1:], below, above, before, rest)
        if len(chosen) == 4:
            yield chosen
        else:
            open_node(bound, chosen)
