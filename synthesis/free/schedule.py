"""The schedule of the search for paths as a table: where each round takes its seeds, how long they descend, and why it is there.

A round runs only where those before it did not reach the tolerance. All seeds of a round descend to their end: on random
crank-rockers and double-cranks over parts of a turn, picking the best after 10 or 20 steps saved no time and lost requests,
because in long curved valleys the cost of the right one is not yet the least.
"""

from __future__ import annotations

from typing import NamedTuple


class Fresh(NamedTuple):
    """Windows of a screen, best first, ``start`` to ``stop``."""

    screen: int
    start: int
    stop: int


class Hops(NamedTuple):
    """Perturbed copies of the best valleys of the pool that were perturbed least often."""

    origins: int
    wide: int
    """Copies moved in all unknowns alike: they reach other valleys."""
    loose: int
    """Copies moved where the cost is flat: they reach other minima of a long valley."""


class Best(NamedTuple):
    """The best valleys of the pool."""

    most: int


Source = Fresh | Hops | Best


class Round(NamedTuple):
    """One round of the search."""

    source: Source
    steps: int
    """A descent's longest."""
    stall: float
    """A candidate whose cost falls by a smaller part in a step ends."""
    reason: str


class Schedule(NamedTuple):
    """A search, round by round."""

    rounds: tuple[Round, ...]
    samples: int
    """That the rounds look at; longer requests are thinned for them and polished on all samples."""


_HOPS = Hops(16, 6, 6)
_STALL = 1e-2

PATH = Schedule(
    (
        Round(Fresh(0, 0, 100), 100, _STALL, "more than half of all exact paths end here"),
        Round(Fresh(0, 100, 200), 100, _STALL, "the next of the coarse types: nearly all end by the fourth round"),
        Round(Fresh(0, 200, 400), 100, _STALL, "the next"),
        Round(Fresh(0, 400, 600), 100, _STALL, "the rest"),
        Round(_HOPS, 60, _STALL, "minima beside the best"),
        Round(Fresh(1, 0, 300), 100, _STALL, "finer types, other spans"),
        Round(_HOPS, 60, _STALL, "minima beside the new ones"),
        Round(Best(12), 300, 1e-5, "where no linkage is exact: to the end of the best valleys"),
    ),
    12,
)
"""Paths without crank angles: a few samples fix the linkage, and the fewer they are the fewer minima lie beside it."""

GUESSED = Schedule(
    (
        Round(Fresh(0, 0, 600), 60, _STALL, "all coarse types: none is near"),
        *(Round(_HOPS, 60, _STALL, "minima beside the best, and beside what the round before found"),) * 7,
        Round(Best(12), 300, 1e-5, "to the end of the best valleys"),
    ),
    32,
)
"""Poses that are far from any four-bar's, where pairs of dyads are no beginning: the best valley of a few is not that of all."""
