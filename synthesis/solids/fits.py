"""How a pin fits its hole: ISO 286 for machined parts, and what a printer needs."""

from __future__ import annotations

from typing import NamedTuple

_STEPS = (3, 6, 10, 18, 30, 50, 80, 120, 180, 250, 315, 400, 500)
"""Upper ends of the ranges of nominal sizes, millimetres (ISO 286-1:2010, table 1)."""
_IT6 = (6, 8, 9, 11, 13, 16, 19, 22, 25, 29, 32, 36, 40)
_IT7 = (10, 12, 15, 18, 21, 25, 30, 35, 40, 46, 52, 57, 63)
"""Tolerances of grades 6 and 7 in micrometres (ISO 286-1:2010, table 1)."""
_G = (2, 4, 5, 6, 7, 9, 10, 12, 14, 15, 17, 18, 20)
"""How far a shaft g stays below its nominal size at least, micrometres (ISO 286-1:2010, table 4)."""


class Fit(NamedTuple):
    """What pin and hole differ by as drawn, millimetres in diameter."""

    name: str
    turning: float
    """Where a plate turns on the pin."""
    held: float
    """Where a plate, a board or a head holds the pin; negative presses."""
    axial: float
    """Between a plate that turns and the washer beside it."""
    toleranced: bool
    """Whether holes and pins are drawn at their nominal size, with tolerances."""
    plate: float
    """The least default thickness of a plate."""
    washer: float
    """The least default gap of two layers; a washer beside an empty place fills half of it."""


FITS = {"H7": Fit("H7", 0.0, 0.0, 0.05, True, 0.0, 0.0), "print": Fit("print", 0.4, 0.1, 0.1, False, 3.0, 2.8)}
"""H7: both drawn at the nominal size, with their tolerances in the parts list. Print: the play is drawn, as a printer makes what
it is shown; 0.4 and 0.1 mm turn and hold on common machines with a 0.4 mm nozzle."""


def tolerance(diameter: float, hole: bool) -> str:
    """The tolerance of a hole H7, or of a pin g6 that turns in it, as a drawing has it; empty outside of 500 mm.

    Law: the least play is that of g, the largest that plus both grades.
    """
    for step, six, seven, off in zip(_STEPS, _IT6, _IT7, _G, strict=True):
        if 0 < diameter <= step:
            return f"H7 +{seven / 1000:g}/0" if hole else f"g6 -{off / 1000:g}/-{(off + six) / 1000:g}"
    return ""
