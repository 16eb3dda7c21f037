"""The schedule of the search as tables: which seeds each round takes, how many steps it makes, and why the round is there.

Rounds grow: one runs only where those before it did not reach the tolerance. Their numbers were chosen on
the random classes of the acceptance benchmark.
"""

from __future__ import annotations

from typing import NamedTuple


class Fresh(NamedTuple):
    """The next best starts of a coarse table, up to ``most`` of each branch in all rounds."""

    table: int
    most: int


class Best(NamedTuple):
    """The best of the pool, at most one a small cell."""

    most: int


class Hops(NamedTuple):
    """Perturbed copies of the best of the pool; heavy tails reach the far ends of the chart, where change points lie."""

    origins: int
    copies: int


class Grid(NamedTuple):
    """The chart's own types at ``starts`` evenly spaced starts, the best ``most`` of each branch."""

    starts: int
    most: int


class NearestToLimits(NamedTuple):
    """Types of the coarsest table at ``starts`` starts that break the limits least, whatever their motion."""

    starts: int
    most: int


Source = Fresh | Best | Hops | Grid | NearestToLimits


class Round(NamedTuple):
    """One round of a search."""

    sources: tuple[Source, ...]
    iterations: int
    """Steps of the descent; within limits each penalty has its own number."""
    reason: str


FREE = (
    Round((Fresh(0, 16),), 15, "half of all reachable motions end here"),
    Round((Fresh(0, 60), Best(12)), 20, "more valleys, and the best so far go on"),
    Round((Hops(8, 6),), 20, "valleys beside the best, which no type of the table lies in"),
    Round((Fresh(1, 150), Best(12)), 30, "the finer table"),
    Round((Hops(15, 8),), 40, "hops from more places"),
    Round((Hops(15, 12),), 60, "and longer descents from them"),
    Round((Fresh(1, 400),), 60, "the rest of the finer table that is worth a look"),
    Round((Best(40),), 200, "narrow valleys take many steps"),
    Round((Hops(40, 12),), 100, "change points and short spans: hops from many places"),
    Round((Hops(80, 12),), 100, "once more, twice as many"),
    Round((Best(12),), 1000, "what still falls, to its end"),
)
"""Without limits, in the first chart."""

FIRST_LOOK = FREE[:2]
"""Before a search within limits: where good motions lie at all."""

FURTHER_CHART = (
    Round((Best(20), Grid(18, 120)), 40, "the best so far, and types of all families"),
    Round((Hops(20, 10),), 60, "valleys beside them"),
    Round((Hops(20, 10),), 60, "and once more"),
    Round((Best(40),), 300, "narrow valleys take many steps"),
)
"""Without limits, in the charts after the first."""

LIMITED = (
    Round((Best(30), Fresh(0, 100)), 0, "the best without limits, and the coarse table"),
    Round((Fresh(1, 300),), 0, "the finer table"),
    Round((Hops(15, 12),), 0, "valleys beside the best"),
)
"""Within limits."""

LAST_RESORT = Round(
    (NearestToLimits(12, 100),), 0, "only where nothing was found: before the request is called infeasible"
)

PENALTIES = ((0.3, 20), (3.0, 20), (30.0, 20), (1000.0, 60))
"""Weights of broken limits, growing until the candidates lie inside, and the steps with each."""
