"""Default diameters of holes and widths of plates, and the check that a hole leaves material."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from synthesis.errors import FieldError

HOLE_OF_SHORTEST, HOLE_OF_LONGEST = 0.3, 0.05
"""The default diameter of a hole is the smaller of these fractions of the shortest and of the longest link."""
WIDTH_OF_HOLE = 2.5
"""Default width of a plate, in diameters of its holes."""


def plate_sizes(
    links: Sequence[float], hole: float | None = None, width: float | None = None, share: float = 1.0
) -> tuple[float, float]:
    """Diameter of the holes and width of the plates of links; the defaults go by the shortest and the longest.

    ``share``: of the default diameter, where that leaves no room for something else.
    """
    if hole is None:
        most = np.inf if width is None else width / WIDTH_OF_HOLE
        hole = share * min(HOLE_OF_SHORTEST * min(links), HOLE_OF_LONGEST * max(links), most)
    return float(hole), float(WIDTH_OF_HOLE * hole if width is None else width)


def check_sizes(links: Sequence[float], hole: float, width: float, where: str) -> None:
    """FieldError for a hole that leaves no material: wider than the plate, or than the distance of two joints."""
    if not hole < width:
        raise FieldError(f"{where}/hole", f"wanted less than the width {width:g}, found {hole:g}")
    if not hole < min(links):
        raise FieldError(f"{where}/hole", f"wanted less than the shortest link {min(links):g}, found {hole:g}")
