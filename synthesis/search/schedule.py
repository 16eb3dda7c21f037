"""The schedule of the search as tables: which seeds each round takes, how many steps it makes, and why the round is there.

Rounds grow: one runs only where those before it did not reach the tolerance. Their numbers were chosen on
the random classes of the acceptance benchmark.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Fresh(NamedTuple):
    """The next best starts of the coarse table, up to ``most`` of each branch in all rounds."""

    most: int


class Best(NamedTuple):
    """The best of the pool, at most one a small cell."""

    most: int


class Hops(NamedTuple):
    """Perturbed copies of the best of the pool; heavy tails reach the far ends of the chart, where change points lie."""

    origins: int
    copies: int


class Edges(NamedTuple):
    """The best starts of shapes at the far ends of the chart, where the coarse table has none."""

    most: int


Source = Fresh | Best | Hops | Edges


class Round(NamedTuple):
    """One round of a search."""

    sources: tuple[Source, ...]
    iterations: int
    """Steps of the descent."""
    reason: str
    near: float = np.inf
    """The round is left out where the least J so far is above it."""
    damping: float = 1e-3
    """Of the first step."""


_GOING_ON = 1e-6
"""Damping of descents that go on where others ended."""

FIRST_LOOK = (
    Round((Fresh(16),), 15, "half of all reachable motions end here"),
    Round((Best(8),), 60, "narrow valleys: short spans and short cranks", near=1e-4, damping=_GOING_ON),
    Round((Fresh(60), Best(12)), 20, "more valleys, and the best so far go on"),
)
"""Before a search within limits: most exact answers are found here."""

TO_THE_END = (
    Round((Best(12),), 1000, "narrow valleys take many steps", damping=_GOING_ON),
    Round((Edges(100),), 30, "next to change points"),
    Round((Hops(40, 12),), 100, "short spans and change points: hops from many places"),
    Round((Best(12),), 1000, "what still falls, to its end", damping=_GOING_ON),
)
"""Where an exact answer is near."""
