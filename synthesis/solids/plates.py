"""DXF files in millimetres of plates to cut: only the links of a four-bar, or all flat parts of an assembly."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from synthesis.assembly.shapes import hull
from synthesis.assembly.sizes import check_sizes, plate_sizes
from synthesis.errors import FieldError
from synthesis.linkage import Linkage
from synthesis.sheet import dxf_document, dxf_text
from synthesis.solids.prism import Hole, Prism, rounded
from synthesis.solids.solid import Solids

COLOURS = {"CRANK": 1, "COUPLER": 5, "ROCKER": 3, "GROUND": 8, "BODY": 4, "MARK": 2}
"""AutoCAD colour index of each layer; other layers are grey."""
GREY = 8
LARGEST_MM, LEAST_MM = 1e7, 1e-6
"""Range of sizes in millimetres of a plate."""


class _Drawn(NamedTuple):
    """Plate in millimetres."""

    name: str
    prism: Prism
    word: complex
    """Position of the name."""
    height: float
    """Height of the letters."""
    mark: complex | None = None
    """Body point on the coupler."""
    thickness: float | None = None
    """Thickness of the sheet, if it is known."""


def to_plates(linkage: Linkage, unit_mm: float = 1.0, hole: float | None = None, width: float | None = None) -> str:
    """The links as plates for cutting, each with its first hole at the origin and its second on the x axis.

    ``unit_mm``: millimetres in the unit of its lengths. ``hole``, ``width``: diameter of the holes and width of the
    plates, in the unit of the lengths; the defaults go by the shortest and the longest link.

    A layer a link (CRANK, COUPLER, ROCKER, GROUND) with one closed contour and its holes; on MARK the names and the
    body point. The coupler's plate reaches to the body point and has a hole there. Law: contours are closed, do not
    cross themselves or one another, and keep ``(width - hole) / 2`` around each hole.

    Raises `FieldError`: for a hole that leaves no material: wider than the plate, or than the distance of two joints.
    """
    hole, width = plate_sizes(linkage.links, hole, width)
    for name, size in (("hole", hole), ("width", width)):
        if not LEAST_MM <= size * unit_mm <= LARGEST_MM:
            raise FieldError(
                f"/plates/{name}", f"must be {LEAST_MM:g} to {LARGEST_MM:g} mm; it is {size * unit_mm:g}"
            )
    check_sizes(linkage.links, hole, width, "/plates")
    rim = (width - hole) * unit_mm
    drawn = []
    for name, length in zip(("CRANK", "COUPLER", "ROCKER", "GROUND"), linkage.links):
        holes, core, mark = [0j, complex(length)], [0j, complex(length)], None
        if name == "COUPLER" and linkage.mounted:
            mark = linkage.arm
            core.append(mark)
            # a hole that would overlap another is left out; the mark still shows the body point
            if min(abs(mark - centre) for centre in holes) > hole:
                holes.append(mark)
        prism = Prism(rounded(hull(core), width / 2), 0.0, 1.0, tuple(Hole(at, hole / 2) for at in holes))
        word = complex(hole * unit_mm, -0.15 * rim)
        scaled = None if mark is None else mark * unit_mm
        drawn.append(_Drawn(name, prism.scaled(unit_mm), word, 0.3 * rim, scaled))
    largest = max(float(np.abs(plate.prism.corners).max()) for plate in drawn)
    if not largest <= LARGEST_MM:
        raise FieldError(
            "/length_unit", f"must give plates of at most {LARGEST_MM:g} mm; the largest is {largest:g} mm"
        )
    return dxf_text(_document(drawn))


def parts_to_plates(solids: Solids, kerf: float = 0.0) -> str:
    """Write plates, boards and washers of an assembly, with the holes of their fit, each on its own layer.

    The name of a part on the layer MARK is followed by the thickness of its sheet.
    ``kerf`` is the width of the cut in millimetres. Contours are offset by half of it, so that the parts have their size after
    the cut.
    """
    drawn = []
    for part in solids.parts:
        if part.kind in ("plate", "board", "washer", "head"):
            hole = part.prism.holes[0]
            if not all(opening.radius > kerf / 2 for opening in part.prism.holes):
                raise FieldError(
                    "/assembly/kerf",
                    f"must be smaller, because it closes a hole of {2 * hole.radius:g} mm in {part.name}",
                )
            # limit the letters of a large body, whose corners are far from its hole
            rim = min(float(np.abs(part.prism.corners - hole.centre).min()) - hole.radius, 3 * hole.radius)
            word = hole.centre + complex(1.1 * hole.radius, -0.3 * rim)
            drawn.append(
                _Drawn(part.name.upper(), part.prism.grown(kerf / 2), word, 0.6 * rim, thickness=part.prism.height)
            )
    return dxf_text(_document(drawn))


def _document(plates: Sequence[_Drawn]) -> object:
    """Draw the plates below each other."""
    layers = {plate.name: COLOURS.get(plate.name, GREY) for plate in plates}
    document = dxf_document({**layers, "MARK": COLOURS["MARK"]}, 4)
    space = document.modelspace()
    below = 0.0
    for plate in plates:
        low, high = (end.imag for end in plate.prism.extent)
        lift = complex(0.0, below - high)
        below -= 1.02 * (high - low)

        def at(point: complex, lift: complex = lift) -> tuple[float, float]:
            return float((point + lift).real), float((point + lift).imag)

        space.add_lwpolyline(
            [
                (*at(corner), float(bulge))
                for corner, bulge in zip(plate.prism.corners, plate.prism.outline[:, 2], strict=True)
            ],
            format="xyb",
            close=True,
            dxfattribs={"layer": plate.name},
        )
        for hole in plate.prism.holes:
            if not hole.reach:
                space.add_circle(at(hole.centre), hole.radius, dxfattribs={"layer": plate.name})
                continue
            contour = [(*at(complex(x, y)), float(bulge)) for x, y, bulge in hole.outline]
            space.add_lwpolyline(contour, format="xyb", close=True, dxfattribs={"layer": plate.name})
        if plate.mark is not None:
            space.add_point(at(plate.mark), dxfattribs={"layer": "MARK"})
        sheet = "" if plate.thickness is None else f" {plate.thickness:.4g} mm"
        text = space.add_text(plate.name.lower() + sheet, height=plate.height, dxfattribs={"layer": "MARK"})
        text.set_placement(at(plate.word))
    return document
