"""The schedule of the search for paths as a table: where each round takes its seeds, how it descends, and why it is there.

A round runs only where those before it did not reach the tolerance. The numbers were chosen on random crank-rockers and
double-cranks over parts of a turn, 30 or 40 requests at a time, so that differences of a few per cent are not settled.
Of 600 seeds a mean of 6 % reached an exact linkage within 100 steps (30 requests each of 10, 15 and 30 samples); half of the
requests had fewer than 2 to 4 %, a fifth none. The best of these is at the head after 10 steps in half of the requests that
have one, but only among the first 50 to 135 in nine of ten: hence wide stages.
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


class Stage(NamedTuple):
    """A part of a descent: the best ``most`` that are still falling go on for some steps."""

    most: int
    steps: int


class Round(NamedTuple):
    """One round of the search."""

    source: Source
    stages: tuple[Stage, ...]
    stall: float
    """A candidate whose cost falls by a smaller part in a step ends."""
    reason: str


_HOP_STAGES = (Stage(192, 8), Stage(64, 20), Stage(24, 40))
_HOPS = Hops(16, 6, 6)
_STALL = 1e-2

PATH = (
    Round(
        Fresh(0, 0, 600),
        (Stage(600, 8), Stage(150, 15), Stage(50, 40)),
        _STALL,
        "more than half of all exact paths end here",
    ),
    Round(_HOPS, _HOP_STAGES, _STALL, "minima beside the best"),
    Round(_HOPS, _HOP_STAGES, _STALL, "and theirs"),
    Round(_HOPS, _HOP_STAGES, _STALL, "once more, from valleys less often tried"),
    Round(Fresh(1, 0, 500), (Stage(500, 8), Stage(150, 15), Stage(40, 40)), _STALL, "finer types, other spans"),
    Round(_HOPS, _HOP_STAGES, _STALL, "minima beside the new ones"),
    Round(_HOPS, _HOP_STAGES, _STALL, "and theirs"),
    Round(_HOPS, _HOP_STAGES, _STALL, "once more"),
    Round(Fresh(1, 500, 1000), (Stage(500, 8), Stage(150, 15), Stage(40, 40)), _STALL, "the next of the finer types"),
    Round(_HOPS, _HOP_STAGES, _STALL, "minima beside the new ones"),
    Round(_HOPS, _HOP_STAGES, _STALL, "and theirs"),
    Round(Best(12), (Stage(12, 300),), 1e-5, "what still falls; it has not been seen to reach the tolerance"),
)
"""Paths without crank angles."""
