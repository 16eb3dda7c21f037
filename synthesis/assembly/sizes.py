"""Default diameters of holes and widths of plates, and the check that a hole leaves material."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from synthesis.arrays import Floats
from synthesis.errors import FieldError

HOLE_OF_SHORTEST, HOLE_OF_LONGEST = 0.3, 0.05
"""The default diameter of a hole is the smaller of these fractions of the shortest and of the longest link."""
WIDTH_OF_HOLE = 2.5
"""Default width of a plate, in diameters of its holes."""


def plate_sizes(
    links: Sequence[float], hole: float | None = None, width: float | None = None, factor: float = 1.0
) -> tuple[float, float]:
    """Return the diameter of the holes and the width of the plates of some links.

    Parameters
    ----------
    links : sequence of float
        Lengths of the links; the defaults depend on the shortest and the longest.
    hole, width : float, optional
    factor : float
        Factor of the default diameter, below 1 if that leaves no room for other parts.
    """
    if hole is None:
        largest = np.inf if width is None else width / WIDTH_OF_HOLE
        hole = factor * min(HOLE_OF_SHORTEST * min(links), HOLE_OF_LONGEST * max(links), largest)
    return float(hole), float(WIDTH_OF_HOLE * hole if width is None else width)


def default_widths(lengths: Floats) -> Floats:
    """Return the default width of the plates, shape (n,), of linkages with these lengths, shape (n, links)."""
    hole = np.minimum(HOLE_OF_SHORTEST * lengths.min(axis=1), HOLE_OF_LONGEST * lengths.max(axis=1))
    return np.asarray(WIDTH_OF_HOLE * hole)


def check_sizes(links: Sequence[float], hole: float, width: float, field: str) -> None:
    """Raise `FieldError` for a hole that leaves no material: wider than the plate, or than the distance of two joints."""
    if not hole < width:
        raise FieldError(f"{field}/hole", f"must be less than the width {width:g}; it is {hole:g}")
    if not hole < min(links):
        raise FieldError(f"{field}/hole", f"must be less than the shortest link {min(links):g}; it is {hole:g}")
