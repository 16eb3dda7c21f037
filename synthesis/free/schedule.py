"""The schedule of the search for exact paths as a table: whence each round takes its seeds, how long they descend, and why.

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
    copies: int


class Best(NamedTuple):
    """The best valleys of the pool."""

    most: int


class Round(NamedTuple):
    """One round of the search."""

    source: Fresh | Hops | Best
    steps: int
    """A descent's longest."""
    stall: float
    """A candidate whose cost falls by a smaller part in a step ends."""
    reason: str


_HOPS = Hops(16, 12)
_STALL = 1e-2

EXACT = (
    Round(Fresh(0, 0, 100), 100, _STALL, "more than half of all exact paths end here"),
    Round(Fresh(0, 100, 200), 100, _STALL, "the next of the coarse types: nearly all end by the fourth round"),
    Round(Fresh(0, 200, 400), 100, _STALL, "the next"),
    Round(Fresh(0, 400, 600), 100, _STALL, "the rest"),
    Round(_HOPS, 60, _STALL, "minima beside the best"),
    Round(Fresh(1, 0, 300), 100, _STALL, "finer types, other spans"),
    Round(_HOPS, 60, _STALL, "minima beside the new ones"),
    Round(Best(12), 300, 1e-5, "to the end of the best valleys"),
)
EXACT_SAMPLES = 12
"""A few samples fix the linkage, and the fewer they are the fewer minima lie beside it."""
