"""Triangles of parts: closed, within the exact solid; 3MF and STL as their readers see them."""

import io
import time
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest

from synthesis.assembly.gaps import distances
from synthesis.solids.mesh import Mesh, mesh_of, on_bed, ring_of, to_3mf, to_stl, to_stl_zip
from synthesis.solids.prism import Hole, Prism, filleted, rounded
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
        ring = ring_of(prism)
        sides = np.column_stack([ring, np.roll(ring, -1)])
        for arc in prism.arcs:
            if arc is not None:
                for point in arc.at(np.linspace(0, 1, 50)):
                    off = distances(np.full((len(sides), 2), point), sides)
                    assert off.min() <= 0.01 + 1e-9


def test_many_random_plates_are_closed() -> None:
    random = np.random.default_rng(11)
    for k in range(400):
        length, width = random.uniform(20, 300), random.uniform(2, 18)
        core, holes = [0j, complex(length)], [0j, complex(length)]
        if k % 2:
            # also symmetric ones, whose holes lie on one line with corners
            core.append(complex(length / 2 if k % 4 == 1 else random.uniform(0, length), random.uniform(20, 200)))
            holes.append(core[2])
        if k % 3 == 0:
            holes.append(complex(length / 2, 0))
        prism = Prism(rounded(core, width / 2), 0, 3, tuple(Hole(at, width / 5) for at in holes))
        mesh = mesh_of(prism)
        assert open_edges(mesh) == 0 and euler_characteristic(mesh) == 2 - 2 * len(holes)
        assert 0 < 1 - mesh.volume / prism.volume < 0.01


def test_straight_corners_of_a_body_leave_no_gap() -> None:
    corners = [0j, 10 + 0j, 30 + 0j, 60 + 0j, 60 + 40j, 60 + 60j, 30 + 60j, 60j, 30j]
    for fillet in (0.0, 3.0):
        holes = tuple(Hole(x + 30j, 5) for x in (30, 10, 50))
        mesh = mesh_of(Prism(filleted(corners, fillet), 0, 4, holes))
        assert open_edges(mesh) == 0 and euler_characteristic(mesh) == -4


@pytest.mark.parametrize("radius", [1e-3, 0.5, 20.0, 1e6])
def test_the_number_of_corners_is_bounded_at_every_size(radius) -> None:
    mesh = mesh_of(Prism.disc(0j, radius, 0, radius, radius / 2))
    assert 48 <= len(mesh.corners) <= 1000
    assert open_edges(mesh) == 0
    assert 0 < 1 - mesh.volume / (0.75 * np.pi * radius**3) < 0.06


def test_parts_on_the_bed_lie_flat_and_apart(window) -> None:
    places = on_bed(window.parts)
    boxes = []
    for part, (turn, shift, up) in zip(window.parts, places, strict=True):
        points = ring_of(part.prism) * turn + shift
        boxes.append((points.real.min(), points.imag.min(), points.real.max(), points.imag.max()))
        assert part.prism.low + up == 0
    for k, (left, below, right, above) in enumerate(boxes):
        assert left >= -1e-9 and below >= -1e-9
        for other in boxes[:k]:
            assert right < other[0] or other[2] < left or above < other[1] or other[3] < below


def model_of(content: bytes) -> ElementTree.Element:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert archive.testzip() is None
        assert set(archive.namelist()) == {"[Content_Types].xml", "_rels/.rels", "3D/3dmodel.model"}
        return ElementTree.fromstring(archive.read("3D/3dmodel.model"))


def test_3mf_holds_every_part_by_name_and_in_place(window) -> None:
    places = window.posed(-0.2)
    content = to_3mf(window.parts, places, "window & <frame>")
    assert content == to_3mf(window.parts, places, "window & <frame>")
    model = model_of(content)
    assert model.get("unit") == "millimeter"
    objects = {one.get("id"): one for one in model.iter(f"{CORE}object")}
    assert [one.get("name") for one in objects.values()] == [part.name for part in window.parts]
    items = list(model.iter(f"{CORE}item"))
    for part, (turn, shift, up), item in zip(window.parts, places, items, strict=True):
        one = objects[item.get("objectid")]
        corners = np.array([[float(v.get(k)) for k in "xyz"] for v in one.iter(f"{CORE}vertex")])
        triangles = np.array([[int(t.get(k)) for k in ("v1", "v2", "v3")] for t in one.iter(f"{CORE}triangle")])
        mesh = Mesh(corners, triangles)
        assert open_edges(mesh) == 0
        assert mesh.volume == pytest.approx(mesh_of(part.prism).volume, rel=1e-6)
        matrix = np.array(list(map(float, item.get("transform").split()))).reshape(4, 3)
        wanted = [turn.real, turn.imag, 0, -turn.imag, turn.real, 0, 0, 0, 1, shift.real, shift.imag, up]
        assert matrix.ravel() == pytest.approx(wanted, abs=1e-9)


def test_3mf_passes_a_strict_reader(window, tmp_path) -> None:
    lib3mf = pytest.importorskip("lib3mf", reason="the extra [solids] is not installed")
    read_strictly(lib3mf, window, tmp_path / "window.3mf")


def read_strictly(lib3mf, solids, path) -> None:
    """A 3MF file of parts on the bed is taken without a warning, every part by its name."""
    path.write_bytes(to_3mf(solids.parts, on_bed(solids.parts), "window"))
    model = lib3mf.get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(path))
    assert reader.GetWarningCount() == 0
    meshes, names = model.GetMeshObjects(), []
    while meshes.MoveNext():
        one = meshes.GetCurrentMeshObject()
        names.append(one.GetName())
        assert one.IsManifoldAndOriented()
    assert names == [part.name for part in solids.parts]


def test_stl_is_a_closed_surface_a_part(window) -> None:
    with zipfile.ZipFile(io.BytesIO(to_stl_zip(window.parts))) as archive:
        assert archive.namelist() == [f"{part.name}.stl" for part in window.parts]
        for part in window.parts:
            content = archive.read(f"{part.name}.stl")
            count = int.from_bytes(content[80:84], "little")
            assert len(content) == 84 + 50 * count
            rows = np.frombuffer(content[84:], np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")]))
            places, triangles = np.unique(rows["v"].reshape(-1, 3), axis=0, return_inverse=True)
            mesh = Mesh(places.astype(float), triangles.reshape(-1, 3))
            assert open_edges(mesh) == 0
            assert mesh.volume == pytest.approx(mesh_of(part.prism).volume, rel=1e-6)
            lengths = np.linalg.norm(rows["n"], axis=1)
            assert np.all((np.abs(lengths - 1) < 1e-5) | (lengths == 0))


def test_stl_is_watertight_for_trimesh(window) -> None:
    trimesh = pytest.importorskip("trimesh", reason="the extra [solids] is not installed")
    watertight(trimesh, window)


def watertight(trimesh, solids) -> None:
    """Every part is a closed surface of its volume."""
    for part in solids.parts:
        mesh = mesh_of(part.prism)
        one = trimesh.load(io.BytesIO(to_stl(mesh, part.name)), file_type="stl")
        assert one.is_watertight and one.is_winding_consistent
        # single precision
        assert one.volume == pytest.approx(mesh.volume, rel=1e-5)


@pytest.mark.timed
def test_each_file_takes_less_than_50_ms(window) -> None:
    from synthesis.solids.robots import to_sdf, to_urdf
    from synthesis.solids.step import to_step

    places = on_bed(window.parts)
    for write in (
        lambda: to_3mf(window.parts, places, "window"),
        lambda: to_stl_zip(window.parts),
        lambda: to_step(window.parts, places, "window"),
        lambda: to_urdf(window, "window"),
        lambda: to_sdf(window, "window"),
    ):
        times = []
        for _ in range(5):
            begin = time.perf_counter()
            write()
            times.append(time.perf_counter() - begin)
        assert min(times) < 0.05
