"""Sizes of plates and pins, shared by the check of layers and by every file."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

from linkage_atlas.arguments import MILLIMETRES, millimetres_in, number, one_of, positive
from synthesis.assembly.machine import Sizes
from synthesis.assembly.sizes import WIDTH_OF_HOLE
from synthesis.errors import FieldError

LEAST_SCALE, LARGEST_SCALE = 1e-3, 1e3
THICKNESS = 0.5
"""Default thickness of a plate, in diameters of its holes."""
WASHER = 0.2
"""Default thickness of the washers between two layers, in thicknesses of a plate."""
HOLES = (1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 12, 16, 20, 25, 30, 40, 50, 60, 80, 100, 120, 160, 200)
"""Diameters of pins and drills, in millimetres."""
SHEETS = (0.5, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30, 40, 50, 60, 80, 100)
"""Thicknesses of sheet and plate, in millimetres."""
WASHERS = (0.2, 0.3, 0.5, 0.8, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 12, 16, 20)
"""Thicknesses of washers, in millimetres."""


class PartSizes(NamedTuple):
    """Sizes of the parts: from the request, or else the defaults, in the unit of the lengths."""

    hole: float
    """Diameter of the pins."""
    width: float
    """Width of the plates."""
    clearance: float
    """Smallest allowed gap between parts that pass each other."""
    thickness: float
    """Thickness of the plates."""
    washer: float
    """Thickness of the washers between two layers."""


@dataclass(frozen=True)
class PartSettings:
    """Sizes of plates and pins in the unit of the linkage's lengths; None: the default.

    Defaults are sizes that can be bought, after scaling: holes of `HOLES`, plates of whole millimetres in width and of a
    thickness of `SHEETS`, washers of `WASHERS`. Parts with holes below the smallest of `HOLES` are not rounded.
    """

    hole: float | None = None
    """Diameter of the pins. Default: the largest standard diameter up to 0.3 of the shortest and 0.05 of the longest link."""
    width: float | None = None
    """Width of the plates. Default: 2.5 hole diameters, in whole millimetres."""
    thickness: float | None = None
    """Thickness of the plates. Default: the standard sheet from half a hole diameter on."""
    washer: float | None = None
    """Thickness of the washers between layers. Default: a fifth of the plate's thickness."""
    clearance: float | None = None
    """Smallest gap between parts that move past each other. Default: 0.5 / 165 of the longest link."""
    kerf: float = 0.0
    """Width of the cut: contours in plates to cut are larger by half of it, and holes smaller; it is not scaled."""
    scale: float = 1.0
    """Scale of the parts in all files; clearances and the kerf are not scaled."""
    length_unit: str | None = None
    """Unit of the lengths, for the default sizes, which are standard millimetre sizes; None: the unit of the file, or mm."""

    def in_unit(self, length_unit: str) -> PartSettings:
        """Return the settings with a unit for the default sizes, if none is set."""
        return self if self.length_unit is not None else replace(self, length_unit=length_unit)

    @property
    def millimetres(self) -> float:
        """Millimetres, as made, of the linkage's unit of length."""
        return millimetres_in(self.length_unit or "mm") * self.scale

    @property
    def sizes(self) -> Sizes:
        """The sizes that concern layers."""
        return Sizes(self.hole, self.width, self.clearance)

    def completed(self, hole: float, width: float, clearance: float) -> PartSizes:
        """Return the sizes with all defaults filled in.

        Parameters
        ----------
        hole, width, clearance : float
            Sizes that the linkage allows. The default hole is rounded down from ``hole``.
        """
        unit = self.millimetres
        standard = hole * unit >= HOLES[0] * (1 - 1e-9)
        if self.hole is None and standard:
            hole = _down(hole * unit, HOLES) / unit
        if self.width is None:
            width = WIDTH_OF_HOLE * hole
            if standard and width * unit >= 1:  # whole millimetres
                width = math.ceil(width * unit - 1e-9) / unit

        def bought(size: float, known: tuple[float, ...]) -> float:
            return _up(size * unit, known) / unit if standard else size

        thickness = bought(THICKNESS * hole, SHEETS) if self.thickness is None else self.thickness
        washer = bought(WASHER * thickness, WASHERS) if self.washer is None else self.washer
        return PartSizes(hole, width, clearance, thickness, washer)


def _scale(field: str, value: object) -> float:
    found = number(field, value)
    if not LEAST_SCALE <= found <= LARGEST_SCALE:
        raise FieldError(f"/{field}", f"must be {LEAST_SCALE:g} to {LARGEST_SCALE:g}; it is {found:g}")
    return found


PART_SETTINGS: dict[str, Callable[[str, Any], Any]] = {
    **dict.fromkeys(("hole", "width", "thickness"), positive),
    **dict.fromkeys(("washer", "clearance", "kerf"), partial(number, minimum=0.0)),
    "scale": _scale,
    "length_unit": partial(one_of, known=MILLIMETRES),
}
"""Settings in requests, with the functions that check them."""


def _down(value: float, known: tuple[float, ...]) -> float:
    """Return the largest known size up to a value, which is at least the smallest; beyond all of them tens."""
    if value >= known[-1] + 10:
        return 10.0 * math.floor(value / 10 + 1e-9)
    return max(size for size in known if size <= value * (1 + 1e-9))


def _up(value: float, known: tuple[float, ...]) -> float:
    """Return the smallest known size from a value on; beyond all of them tens."""
    if value > known[-1]:
        return 10.0 * math.ceil(value / 10 - 1e-9)
    return min(size for size in known if size >= value * (1 - 1e-9))
