"""Parts as triangles, for printers: 3MF with names and colours, and STL.

Corners lie within the exact solid or on it: outer arcs have their corners on the circle, holes theirs around it. So a pin of the
hole's diameter passes, and parts that are apart stay apart.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from typing import NamedTuple
from xml.sax.saxutils import escape as _escape

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Complexes, Floats
from synthesis.solids.prism import Hole, Prism
from synthesis.solids.solid import Posed, Solid

SAGITTA = 0.01
"""Millimetres that a chord may be off its arc, in a part of printable size."""
_LEAST_SAGITTA, _MOST_SAGITTA = 1e-4, 0.02
"""What the sagitta is at least and at most, as a part of the radius: a circle has at most 223 corners and at least 16."""
_GOLDEN = np.pi * (3 - np.sqrt(5))
_GAP = 5.0
"""Millimetres between parts on the bed."""


def escape(words: str) -> str:
    """Words within the quotation marks of an attribute, or as text."""
    return _escape(words, {'"': "&quot;"})


class Mesh(NamedTuple):
    """A closed surface."""

    corners: Floats
    """(n, 3)"""
    triangles: NDArray[np.int32]
    """(m, 3) corners, counter-clockwise as seen from outside."""

    @property
    def volume(self) -> float:
        """By the divergence theorem."""
        middle = (self.corners.min(axis=0) + self.corners.max(axis=0)) / 2
        first, second, third = np.moveaxis(self.corners[self.triangles] - middle, 1, 0)
        return float(np.sum(np.cross(first, second) * third)) / 6


def _steps(radius: float, angle: float) -> int:
    sagitta = min(max(SAGITTA, _LEAST_SAGITTA * radius), _MOST_SAGITTA * radius)
    # cos(step / 2) = 1 - sagitta / radius, by the half angle
    step = 4 * np.arcsin(np.sqrt(sagitta / radius / 2))
    return max(1, int(np.ceil(abs(angle) / step * (1 - 1e-12))))


def ring_of(prism: Prism) -> Complexes:
    """The outline as a polygon within the exact one, counter-clockwise."""
    corners: list[Complexes] = []
    for start, arc in zip(prism.corners, prism.arcs):
        corners.append(np.array([start]))
        if arc is None:
            continue
        steps = _steps(arc.radius, arc.angle)
        if arc.angle > 0:
            corners.append(arc.at(np.arange(1, steps) / steps))
        else:
            # around a hollow: where the tangents at the steps meet
            meet = arc.at((np.arange(steps) + 0.5) / steps) - arc.centre
            corners.append(arc.centre + meet / np.cos(arc.angle / steps / 2))
    ring = np.concatenate(corners)
    on, back = np.roll(ring, -1) - ring, ring - np.roll(ring, 1)
    # a corner on the line of its neighbours would be left out of the faces but not of the sides
    bent = np.abs(np.imag(np.conj(back) * on)) > 1e-12 * np.abs(back) * np.abs(on)
    return np.asarray(ring[bent])


def _hole_ring(hole: Hole, phase: float) -> Complexes:
    """A hole as a polygon around it, clockwise."""
    if hole.reach:
        return ring_of(Prism(hole.outline, 0.0, 1.0))
    centre, radius = hole.centre, hole.radius
    count = max(12, _steps(radius, 2 * np.pi))
    turn = phase - 2 * np.pi * np.arange(count) / count
    return np.asarray(centre + radius / np.cos(np.pi / count) * np.exp(1j * turn))


def mesh_of(prism: Prism) -> Mesh:
    """The closed surface of a part.

    Law: every edge belongs to two triangles, in both directions; corners less edges plus triangles are 2 less two for each hole;
    the volume is that of the polygons, below the exact one.
    """
    from mapbox_earcut import triangulate_float64

    outline = ring_of(prism)
    for attempt in range(8):
        # no two holes alike: three corners on one line would leave out the one between
        phases = _GOLDEN * (np.arange(len(prism.holes)) + 0.3) * (attempt + 1)
        rings = [outline, *(_hole_ring(hole, phase) for hole, phase in zip(prism.holes, phases))]
        plane = np.concatenate(rings)
        ends = np.cumsum([len(ring) for ring in rings]).astype(np.uint32)
        # about their middle, in which the predicates lose fewest digits
        at = plane - (plane.real.min() + plane.real.max() + 1j * (plane.imag.min() + plane.imag.max())) / 2
        face = triangulate_float64(np.column_stack([at.real, at.imag]), ends).reshape(-1, 3).astype(np.int32)
        if len(face) == len(plane) + 2 * len(prism.holes) - 2:
            break
    else:
        raise ArithmeticError("the face of a part could not be cut into triangles")
    one, two, three = at[face].T
    if np.sum(np.imag(np.conj(two - one) * (three - one))) < 0:
        face = face[:, ::-1]
    count = len(plane)
    firsts = np.concatenate([[0], ends[:-1]])
    after = np.arange(1, count + 1, dtype=np.int32)
    after[ends.astype(int) - 1] = firsts
    here = np.arange(count, dtype=np.int32)
    sides = [np.column_stack([here, after, after + count]), np.column_stack([here, after + count, here + count])]
    flat = np.column_stack([plane.real, plane.imag])
    corners = np.concatenate([np.column_stack([flat, np.full(count, z)]) for z in (prism.low, prism.high)])
    return Mesh(corners, np.concatenate([face[:, ::-1], face + count, *sides]).astype(np.int32))


def on_bed(parts: Sequence[Solid]) -> list[Posed]:
    """Parts beside one another, each on its lower face, in rows on a bed that is about square.

    Law: their extents do not overlap.
    """
    boxes = []
    for part in parts:
        low, high = part.prism.extent
        size = high - low
        # the long side lies along x
        turn = 1j if size.imag > size.real * (1 + 1e-9) else 1.0 + 0j
        corner = complex(-high.imag, low.real) if turn == 1j else low
        size = complex(size.imag, size.real) if turn == 1j else size
        boxes.append((turn, corner, size))
    area = sum((size.real + _GAP) * (size.imag + _GAP) for _, _, size in boxes)
    wide = max([1.2 * np.sqrt(area), *(size.real for _, _, size in boxes)])
    places: dict[int, Posed] = {}
    at, row = 0j, 0.0
    for k in sorted(range(len(boxes)), key=lambda k: -boxes[k][2].imag):
        turn, corner, size = boxes[k]
        if at.real + size.real > wide * (1 + 1e-9):
            at, row = complex(0.0, at.imag + row + _GAP), 0.0
        places[k] = Posed(turn, at - corner, -parts[k].prism.low)
        row = max(row, size.imag)
        at += size.real + _GAP
    return [places[k] for k in range(len(parts))]


_TYPES = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>\n'
)
_RELATIONS = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    '<Relationship Target="/3D/3dmodel.model" Id="model" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>\n'
)


def to_3mf(parts: Sequence[Solid], places: Sequence[Posed], name: str) -> bytes:
    """A 3MF file: an object a part, with its name and colour; millimetres.

    Law: a strict reader takes it without a warning.
    """
    colours = list(dict.fromkeys((part.material, part.colour) for part in parts))
    bases = "".join(
        f'<base name="{escape(material)}" displaycolor="{colour.upper()}"/>' for material, colour in colours
    )
    objects, items = [], []
    for number, (part, place) in enumerate(zip(parts, places, strict=True), 2):
        mesh = mesh_of(part.prism)
        # 1e-6 mm is far below what a printer sees, and keeps the file short
        vertices = "".join(f'<vertex x="{x:.9g}" y="{y:.9g}" z="{z:.9g}"/>' for x, y, z in mesh.corners.tolist())
        faces = "".join(f'<triangle v1="{i}" v2="{j}" v3="{k}"/>' for i, j, k in mesh.triangles.tolist())
        base = colours.index((part.material, part.colour))
        objects.append(
            f'<object id="{number}" type="model" name="{escape(part.name)}" pid="1" pindex="{base}">'
            f"<mesh><vertices>{vertices}</vertices><triangles>{faces}</triangles></mesh></object>"
        )
        turn, shift, up = place
        matrix = (turn.real, turn.imag, 0, -turn.imag, turn.real, 0, 0, 0, 1, shift.real, shift.imag, up)
        items.append(f'<item objectid="{number}" transform="{" ".join(f"{value + 0.0:.12g}" for value in matrix)}"/>')
    model = (
        '<?xml version="1.0" encoding="UTF-8"?>\n<model unit="millimeter" xml:lang="en" '
        'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
        f'<metadata name="Title">{escape(name)}</metadata><metadata name="Application">linkage-atlas</metadata>'
        f'<resources><basematerials id="1">{bases}</basematerials>{"".join(objects)}</resources>'
        f"<build>{''.join(items)}</build></model>\n"
    )
    return zipped({"[Content_Types].xml": _TYPES, "_rels/.rels": _RELATIONS, "3D/3dmodel.model": model})


def to_stl(mesh: Mesh, name: str) -> bytes:
    """A binary STL file of one part in its own frame, by convention in millimetres."""
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
    rows = np.zeros(len(mesh.triangles), record)
    rows["corners"] = mesh.corners[mesh.triangles]
    first, second, third = np.moveaxis(mesh.corners[mesh.triangles], 1, 0)
    normals = np.cross(second - first, third - first)
    sizes = np.linalg.norm(normals, axis=1, keepdims=True)
    rows["normal"] = normals / np.where(sizes > 0, sizes, 1.0)
    head = name.encode("ascii", "replace")[:79].ljust(80)
    return head + np.uint32(len(rows)).tobytes() + rows.tobytes()


def to_stl_zip(parts: Sequence[Solid]) -> bytes:
    """A zip file with an STL file a part."""
    return zipped({f"{part.name}.stl": to_stl(mesh_of(part.prism), part.name) for part in parts})


def zipped(files: Mapping[str, str | bytes]) -> bytes:
    """A zip file; the same bytes for the same files."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            archive.writestr(entry, content, zipfile.ZIP_DEFLATED, compresslevel=4)
    return stream.getvalue()
