"""Triangle meshes of parts for 3D printing: 3MF with names and colours, and STL.

The mesh lies within the exact solid. A pin of the hole's diameter therefore fits, and separate parts stay separate.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from html import escape
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Complexes, Floats
from synthesis.solids.prism import Prism, Side, contour
from synthesis.solids.solid import Posed, Solid

SAGITTA = 0.01
"""Largest distance between a chord and its arc in millimetres."""
_LEAST_SAGITTA, _MOST_SAGITTA = 1e-4, 0.02
"""Bounds of the sagitta relative to the radius, so that a circle has 16 to 223 corners."""
_GOLDEN = np.pi * (3 - np.sqrt(5))
_GAP = 5.0
"""Gap between parts on the bed in millimetres."""


class Mesh(NamedTuple):
    """Closed triangulated surface."""

    corners: Floats
    """Coordinates, shape (n, 3)."""
    triangles: NDArray[np.int32]
    """Indices of corners, counter-clockwise as seen from outside, shape (m, 3)."""

    @property
    def volume(self) -> float:
        """Volume by the divergence theorem."""
        middle = (self.corners.min(axis=0) + self.corners.max(axis=0)) / 2
        first, second, third = np.moveaxis(self.corners[self.triangles] - middle, 1, 0)
        return float(np.sum(np.cross(first, second) * third)) / 6


def _steps(radius: float, angle: float) -> int:
    sagitta = min(max(SAGITTA, _LEAST_SAGITTA * radius), _MOST_SAGITTA * radius)
    # cos(step / 2) = 1 - sagitta / radius, by the half angle
    step = 4 * np.arcsin(np.sqrt(sagitta / radius / 2))
    return max(1, int(np.ceil(abs(angle) / step * (1 - 1e-12))))


def ring_of(sides: Sequence[Side]) -> Complexes:
    """Return a contour as a polygon within the material: chords of its arcs, and tangents around holes."""
    corners: list[Complexes] = []
    for start, arc in sides:
        corners.append(np.array([start]))
        if arc is None:
            continue
        steps = _steps(arc.radius, arc.angle)
        if arc.angle > 0:
            corners.append(arc.at(np.arange(1, steps) / steps))
        else:
            # intersections of neighbouring tangents
            meet = arc.at((np.arange(steps) + 0.5) / steps) - arc.centre
            corners.append(arc.centre + meet / np.cos(arc.angle / steps / 2))
    ring = np.concatenate(corners)
    on, back = np.roll(ring, -1) - ring, ring - np.roll(ring, 1)
    # a collinear corner would be missing in the faces but not in the sides
    bent = np.abs(np.imag(np.conj(back) * on)) > 1e-12 * np.abs(back) * np.abs(on)
    return np.asarray(ring[bent])


def mesh_of(prism: Prism) -> Mesh:
    """Triangulate the closed surface of a part.

    Every edge belongs to two triangles in opposite directions, and Euler's characteristic is 2 minus twice the number of holes.
    The volume is slightly below the exact volume.
    """
    from mapbox_earcut import triangulate_float64

    outline = ring_of(contour(prism.shape))
    for attempt in range(8):
        # different phases avoid collinear corners of different holes, which earcut would drop
        phases = _GOLDEN * (np.arange(len(prism.holes)) + 0.3) * (attempt + 1)
        rings = [outline, *(ring_of(contour(hole, True, phase)) for hole, phase in zip(prism.holes, phases.tolist()))]
        plane = np.concatenate(rings)
        ends = np.cumsum([len(ring) for ring in rings]).astype(np.uint32)
        # coordinates relative to the middle, which lose the fewest digits
        at = plane - (plane.real.min() + plane.real.max() + 1j * (plane.imag.min() + plane.imag.max())) / 2
        face = triangulate_float64(np.column_stack([at.real, at.imag]), ends).reshape(-1, 3).astype(np.int32)
        if len(face) == len(plane) + 2 * len(prism.holes) - 2:
            break
    else:
        raise ArithmeticError("the face of a part could not be cut into triangles")
    first, second, third = at[face].T
    if np.sum(np.imag(np.conj(second - first) * (third - first))) < 0:
        face = face[:, ::-1]
    count = len(plane)
    firsts = np.concatenate([[0], ends[:-1]])
    after = np.arange(1, count + 1, dtype=np.int32)
    after[ends.astype(int) - 1] = firsts
    here = np.arange(count, dtype=np.int32)
    sides = [np.column_stack([here, after, after + count]), np.column_stack([here, after + count, here + count])]
    flat = np.column_stack([plane.real, plane.imag])
    corners = np.concatenate([np.column_stack([flat, np.full(count, z)]) for z in (0.0, prism.height)])
    return Mesh(corners, np.concatenate([face[:, ::-1], face + count, *sides]).astype(np.int32))


def on_bed(parts: Sequence[Solid]) -> list[Posed]:
    """Arrange parts on their lower faces, in rows on a roughly square bed, without overlap."""
    boxes = [part.prism.shape.extent for part in parts]
    sizes = [high - low + _GAP * (1 + 1j) for low, high in boxes]
    wide = max([1.2 * np.sqrt(sum(size.real * size.imag for size in sizes)), *(size.real for size in sizes)])
    poses: dict[int, Posed] = {}
    at, row = 0j, 0.0
    for k in sorted(range(len(parts)), key=lambda k: -sizes[k].imag):
        if at.real + sizes[k].real > wide * (1 + 1e-9):
            at, row = complex(0.0, at.imag + row), 0.0
        poses[k] = Posed(1.0 + 0j, at - boxes[k][0], 0.0)
        row = max(row, sizes[k].imag)
        at += sizes[k].real
    return [poses[k] for k in range(len(parts))]


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


def to_3mf(parts: Sequence[Solid], poses: Sequence[Posed], name: str) -> bytes:
    """Write a 3MF file in millimetres with an object, a name and a colour for each part."""
    colours = list(dict.fromkeys((part.material, part.colour) for part in parts))
    bases = "".join(
        f'<base name="{escape(material)}" displaycolor="{colour.upper()}"/>' for material, colour in colours
    )
    objects, items = [], []
    for number, (part, pose) in enumerate(zip(parts, poses, strict=True), 2):
        mesh = mesh_of(part.prism)
        # 1e-6 mm is far below the resolution of a printer and keeps the file short
        vertices = "".join(f'<vertex x="{x:.9g}" y="{y:.9g}" z="{z:.9g}"/>' for x, y, z in mesh.corners.tolist())
        faces = "".join(f'<triangle v1="{i}" v2="{j}" v3="{k}"/>' for i, j, k in mesh.triangles.tolist())
        base = colours.index((part.material, part.colour))
        objects.append(
            f'<object id="{number}" type="model" name="{escape(part.name)}" pid="1" pindex="{base}">'
            f"<mesh><vertices>{vertices}</vertices><triangles>{faces}</triangles></mesh></object>"
        )
        turn, shift, up = pose
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
    """Write a binary STL file of a part in its own frame, in millimetres by convention."""
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
    """Write a zip file with an STL file for each part."""
    return zipped({f"{part.name}.stl": to_stl(mesh_of(part.prism), part.name) for part in parts})


def zipped(files: Mapping[str, str | bytes]) -> bytes:
    """Write a zip file that is byte-identical for identical content."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            archive.writestr(entry, content, zipfile.ZIP_DEFLATED, compresslevel=4)
    return stream.getvalue()
