"""Meshes of parts are closed surfaces within the exact solid, and 3MF and STL hold them completely.

A hole in a surface, or a part at a wrong position, would show here.
"""

import io
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest

from synthesis.assembly.shapes import distances
from synthesis.solids.mesh import Mesh, mesh_of, on_bed, ring_of, to_stl_zip
from synthesis.solids.prism import Prism
from tests.oracles.solids import SASH, built
from tests.oracles.surface import euler_characteristic, open_edges

CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"


@pytest.fixture(scope="module")
def window():
    """The casement's linkage to be printed, with a body that is not convex."""
    return built("E2", "below", fit="print", body=SASH)


@pytest.mark.parametrize(
    ("name", "boards", "heads"), [("E1", "both", True), ("E3", "both", False), ("E4", "below", True)]
)
def test_surfaces_are_closed_and_within_the_exact_solid(name, boards, heads) -> None:
    for part in built(name, boards, heads).parts:
        mesh, prism = mesh_of(part.prism), part.prism
        assert open_edges(mesh) == 0, part.name
        assert euler_characteristic(mesh) == 2 - 2 * len(prism.holes), part.name
        assert -1e-12 < 1 - mesh.volume / prism.volume < 0.02, part.name
        # of the outline at most a hundredth of a millimetre is lost
        ring = ring_of(prism.contours[0])
        sides = np.column_stack([ring, np.roll(ring, -1)])
        for _, arc in prism.contours[0]:
            if arc is not None:
                for point in arc.at(np.linspace(0, 1, 50)):
                    off = distances(np.full((len(sides), 2), point), sides)
                    assert off.min() <= 0.01 + 1e-9


@pytest.mark.parametrize("radius", [1e-3, 0.5, 20.0, 1e6])
def test_the_number_of_corners_is_bounded_at_every_size(radius) -> None:
    mesh = mesh_of(Prism.disc(radius, radius, radius / 2))
    assert 48 <= len(mesh.corners) <= 1000
    assert open_edges(mesh) == 0
    assert 0 < 1 - mesh.volume / (0.75 * np.pi * radius**3) < 0.06


def test_parts_on_the_bed_lie_flat_and_apart(window) -> None:
    positions = on_bed(window.parts)
    boxes = []
    for part, (turn, shift, up) in zip(window.parts, positions, strict=True):
        points = ring_of(part.prism.contours[0]) * turn + shift
        boxes.append((points.real.min(), points.imag.min(), points.real.max(), points.imag.max()))
        assert up == 0
    for k, (left, below, right, above) in enumerate(boxes):
        assert left >= -1e-9 and below >= -1e-9
        for box in boxes[:k]:
            assert right < box[0] or box[2] < left or above < box[1] or box[3] < below


def model_of(content: bytes) -> ElementTree.Element:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert archive.testzip() is None
        assert set(archive.namelist()) == {"[Content_Types].xml", "_rels/.rels", "3D/3dmodel.model"}
        return ElementTree.fromstring(archive.read("3D/3dmodel.model"))


def test_stl_is_a_closed_surface_a_part(window) -> None:
    with zipfile.ZipFile(io.BytesIO(to_stl_zip(window.parts))) as archive:
        assert archive.namelist() == [f"{part.name}.stl" for part in window.parts]
        for part in window.parts:
            content = archive.read(f"{part.name}.stl")
            count = int.from_bytes(content[80:84], "little")
            assert len(content) == 84 + 50 * count
            rows = np.frombuffer(content[84:], np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")]))
            positions, triangles = np.unique(rows["v"].reshape(-1, 3), axis=0, return_inverse=True)
            mesh = Mesh(positions.astype(float), triangles.reshape(-1, 3))
            assert open_edges(mesh) == 0
            assert mesh.volume == pytest.approx(mesh_of(part.prism).volume, rel=1e-6)
            lengths = np.linalg.norm(rows["n"], axis=1)
            assert np.all((np.abs(lengths - 1) < 1e-5) | (lengths == 0))
