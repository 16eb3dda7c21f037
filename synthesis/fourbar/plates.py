"""A four-bar as plates to cut: for each link one closed contour and its holes, side by side in a DXF file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from synthesis.errors import FieldError
from synthesis.fourbar.linkage import Linkage
from synthesis.sheet import dxf_document, dxf_text

COLOURS = {"CRANK": 1, "COUPLER": 5, "ROCKER": 3, "GROUND": 8, "MARK": 2}
"""AutoCAD colour index of each layer."""
LARGEST_MM, LEAST_MM = 1e7, 1e-6
"""Sizes in millimetres between which a plate is drawn."""
HOLE_OF_SHORTEST, HOLE_OF_LONGEST = 0.3, 0.05
"""The default diameter of a hole: the lesser of these parts of the shortest and of the longest link."""
WIDTH_OF_HOLE = 2.5
_FLAT = 1e-9
"""A triangle less high than this part of its longest side is a line."""


class Plate(NamedTuple):
    """A link as it is cut: its outline keeps half the width from the line or triangle of its holes."""

    name: str
    outline: list[tuple[float, float, float]]
    """x, y and bulge (the tangent of a quarter of the arc's angle) of each vertex, counter-clockwise, closed."""
    holes: list[complex]
    mark: complex | None
    """The body point, on the coupler."""


def rounded_outline(corners: Sequence[complex], radius: float) -> list[tuple[float, float, float]]:
    """The outline at a distance from a line or a convex polygon, with a round at each corner.

    Parameters
    ----------
    corners : sequence of complex
        Counter-clockwise; two are a line.
    radius : float

    Returns
    -------
    list of (x, y, bulge)
        Law: convex, so free of self-crossing, and nowhere nearer to a corner than ``radius``.
    """
    count = len(corners)
    sides = [corners[(k + 1) % count] - corners[k] for k in range(count)]
    normals = [-1j * side / abs(side) for side in sides]
    vertices = []
    for k, corner in enumerate(corners):
        turn = float(np.angle(normals[k] / normals[k - 1])) if count > 2 else np.pi
        for normal, bulge in ((normals[k - 1], np.tan(turn / 4)), (normals[k], 0.0)):
            place = corner + radius * normal
            vertices.append((place.real, place.imag, float(bulge)))
    return vertices


def _hull(points: Sequence[complex]) -> list[complex]:
    """The corners of the convex hull of three points, counter-clockwise; two where they lie on a line."""
    pairs = [(abs(a - b), a, b) for k, a in enumerate(points) for b in points[k + 1 :]]
    longest, a, b = max(pairs, key=lambda pair: pair[0])
    (c,) = [point for point in points if point not in (a, b)] or [a]
    height = float(np.imag(np.conj(b - a) * (c - a))) / longest
    if abs(height) <= _FLAT * longest:
        return [a, b]
    return [a, b, c] if height > 0 else [a, c, b]


def plates_of(linkage: Linkage, hole: float, width: float) -> list[Plate]:
    """Crank, coupler, rocker and ground as plates, each with its first hole at the origin and its second on the x axis."""
    plates = []
    for name, length in zip(("CRANK", "COUPLER", "ROCKER", "GROUND"), linkage.links):
        holes, corners, mark = [0j, complex(length)], [0j, complex(length)], None
        if name == "COUPLER" and linkage.coupler_point is not None:
            radius, angle = linkage.coupler_point
            mark = complex(radius * np.exp(1j * angle))
            corners = _hull([*holes, mark])
            # a hole that would run into another one is left out: the mark alone says where the body point is
            if min(abs(mark - other) for other in holes) > hole:
                holes.append(mark)
        plates.append(Plate(name, rounded_outline(corners, width / 2), holes, mark))
    return plates


def to_plates(linkage: Linkage, unit_mm: float = 1.0, hole: float | None = None, width: float | None = None) -> str:
    """The links as plates for cutting, a DXF file in millimetres.

    Parameters
    ----------
    linkage : Linkage
    unit_mm : float
        Millimetres in the unit of its lengths.
    hole, width : float, optional
        Diameter of the holes and width of the plates, in the unit of the lengths; the defaults go by the shortest and the longest
        link.

    Returns
    -------
    str
        A layer a link (CRANK, COUPLER, ROCKER, GROUND) with one closed contour and its holes; on MARK the names and the body
        point. The coupler's plate reaches to the body point and has a hole there. Law: contours are closed, do not cross
        themselves or one another, and keep ``(width - hole) / 2`` around each hole.

    Raises
    ------
    FieldError
        For a hole that leaves no material: wider than the plate, or than the distance of two joints.
    """
    shortest, longest = min(linkage.links), max(linkage.links)
    if hole is None:
        most = np.inf if width is None else width / WIDTH_OF_HOLE
        hole = min(HOLE_OF_SHORTEST * shortest, HOLE_OF_LONGEST * longest, most)
    width = WIDTH_OF_HOLE * hole if width is None else width
    for name, size in (("hole", hole), ("width", width)):
        if not LEAST_MM <= size * unit_mm <= LARGEST_MM:
            raise FieldError(f"/plates/{name}", f"wanted {LEAST_MM:g} to {LARGEST_MM:g} mm, found {size * unit_mm:g}")
    if not hole < width:
        raise FieldError("/plates/hole", f"wanted less than the width {width:g}, found {hole:g}")
    if not hole < shortest:
        raise FieldError("/plates/hole", f"wanted less than the shortest link {shortest:g}, found {hole:g}")
    plates = plates_of(linkage, hole, width)
    largest = max(abs(complex(x, y)) for plate in plates for x, y, _ in plate.outline)
    if not largest * unit_mm <= LARGEST_MM:
        raise FieldError("/length_unit", f"wanted plates of at most {LARGEST_MM:g} mm, found {largest * unit_mm:g}")
    return dxf_text(_drawn(plates, hole, width, unit_mm))


def _drawn(plates: Sequence[Plate], hole: float, width: float, unit_mm: float) -> object:
    """The document: one plate below the other."""
    document = dxf_document(COLOURS, 4)
    space = document.modelspace()
    below = 0.0
    for plate in plates:
        # an arc reaches beyond its ends, at most to half the width from the corner that it goes around
        low = min(y for _, y, _ in plate.outline) - width / 2
        high = max(y for _, y, _ in plate.outline) + width / 2
        lift = below - high
        below += low - high

        def at(point: complex, lift: float = lift) -> tuple[float, float]:
            return point.real * unit_mm, (point.imag + lift) * unit_mm

        space.add_lwpolyline(
            [(*at(complex(x, y)), bulge) for x, y, bulge in plate.outline],
            format="xyb",
            close=True,
            dxfattribs={"layer": plate.name},
        )
        for centre in plate.holes:
            space.add_circle(at(centre), hole / 2 * unit_mm, dxfattribs={"layer": plate.name})
        if plate.mark is not None:
            space.add_point(at(plate.mark), dxfattribs={"layer": "MARK"})
        text = space.add_text(plate.name.lower(), height=0.3 * (width - hole) * unit_mm, dxfattribs={"layer": "MARK"})
        text.set_placement(at(complex(hole, -0.15 * (width - hole))))
    return document
