"""Solid parts are the same in Python, on the command line and over HTTP, and their files hold them completely.

A part of a wrong size or mass, or a refusal without its reason, would show here.
"""

import io
import json
from importlib.resources import files

import ezdxf
import ezdxf.path
import numpy as np
import pytest
import shapely

import linkage_atlas as la
from app import cli
from app.registry import worked_example
from linkage_atlas.formats import FORMATS, OF_PARTS
from tests.conftest import some_of
from tests.oracles.solids import deepest, step_shells
from tests.oracles.surface import open_edges
from tests.synthesis.solids.test_mesh import CORE, Mesh, model_of

GALLERY = {
    example["name"]: example for example in json.loads(files("app").joinpath("static/examples.json").read_text())
}
BOTH = {"boards": "both"}
WORKED = la.FourBar(19, 72, 144, 165, start_angle=30, ground_angle=30, coupler_point_polar=(20, 60))


@pytest.fixture
def linkage() -> la.FourBar:
    return la.FourBar(19, 72, 144, 165, start_angle=30, coupler_point_polar=(20, 60), body_offset=-76)


@pytest.fixture
def request_body():
    return worked_example()


@pytest.mark.parametrize("kind", OF_PARTS)
def test_a_file_is_what_save_writes(linkage, kind, tmp_path) -> None:
    path = tmp_path / f"window.{FORMATS[kind].endings[-1]}"
    linkage.save(path, fit="print", boards="both")
    content = path.read_bytes()
    assert content == linkage.file(kind, assembly=BOTH, solids={"fit": "print"})
    assert content == linkage.solids(fit="print", boards="both").file(kind)
    starts = {"step": b"ISO-10303-21;", "3mf": b"PK", "stl": b"PK", "parts": b"name,kind,"}
    assert content.startswith(starts.get(kind, b"<?xml"))
    assert content != linkage.file(kind)
    if kind in ("3mf", "stl"):
        with pytest.raises(la.FieldError, match="not a text format"):
            linkage.render(kind)
    else:
        assert linkage.render(kind).encode() == linkage.file(kind)


def test_what_parts_weigh_is_what_an_analysis_and_a_simulation_take(linkage) -> None:
    parts = linkage.solids(material="steel", thickness=4)
    assert parts.mass == pytest.approx(sum(part.mass for part in parts.parts))
    links = {mass.link: mass for mass in parts.masses}
    crank = next(part for part in parts.parts if part.name == "crank")
    assert crank.mass == pytest.approx(crank.volume * 7850e-9)
    assert links["crank"].mass == pytest.approx(sum(part.mass for part in parts.parts if part.link == "crank"))
    # by virtual work at rest: the drive holds the weights
    load = {"masses": parts.to_dict()["masses"], "gravity": [0.0, -9.81]}
    held = linkage.analysis(0, load, travel=[20.0])
    h = 1e-4
    ends = [linkage.joints(20.0 + off) for off in (-h, h)]
    lifted = 0.0
    for name, origin in (("crank", "pivot_a"), ("coupler", "crank_pin"), ("rocker", "pivot_b")):
        body = links[name]
        heights = []
        for joints in ends:
            position = np.ravel(getattr(joints, origin)) + 0.0
            turn = np.exp(1j * np.deg2rad(getattr(joints, f"{name}_direction")[0]))
            heights.append(position[1] + (complex(*body.centre) * turn).imag)
        lifted += body.mass * 9.81 * (heights[1] - heights[0]) / (2 * np.deg2rad(h))
    assert held.drive_load[0] == pytest.approx(lifted, rel=1e-6)
    text = linkage.file("mjcf", solids={"material": "steel"}, assembly={"thickness": 4}).decode()
    assert f'mass="{links["rocker"].mass!r}"' in text and "kilograms of its parts" in text
    # a model is printed smaller, but an analysis is of the linkage itself
    sizes = parts.solids.machine.hole, parts.solids.machine.width
    same = {"hole": sizes[0], "width": sizes[1], "thickness": 4, "washer": 0.8}
    assert linkage.solids(material="steel", **same, scale=0.5).masses == parts.masses


CRANK = {"guide": "circle", "pivot": [3, -4], "radius": 20, "body_point": [5, 2]}
RAIL = {"guide": "rail", "point": [0, 6], "direction": 10, "body_point": [50, 8]}
STEEP = {"guide": "rail", "point": [0, 0], "direction": 100, "body_point": [0, 4]}
SLOT = {"guide": "slot", "pin": [60, 5], "body_point": [3, 1], "body_direction": 4}
GUIDED = [la.Linkage([CRANK, RAIL], "crank", start=30), la.Linkage([STEEP, SLOT], "slider", start=12)]


@pytest.mark.parametrize("linkage", GUIDED, ids=lambda linkage: linkage.kind)
def test_parts_of_rails_and_slots_weigh_where_they_are(linkage, tmp_path, client) -> None:
    direction = np.array([0.0, 10.0, 25.0])
    turns = linkage.driver == "crank"
    motion = la.Motion(position=linkage.joints(direction).body_point, timing="free")
    parts = linkage.solids(motion, direction, boards="both")
    solids = parts.solids
    assert any(len(hole.core) > 1 for part in solids.parts for hole in part.prism.holes)
    # the centre of the body's parts in the plane, by the parts themselves and by the frame of an analysis
    (coupler,) = [mass for mass in parts.masses if mass.link == "coupler"]
    for k, travel in enumerate(direction):
        held, moved = 0.0, 0j
        for part, position in zip(solids.parts, solids.posed(np.deg2rad(travel) if turns else travel), strict=True):
            if part.link == "coupler":
                moved += part.mass.mass * (part.prism.moments.centre * position.turn + position.shift)
                held += part.mass.mass
        joints = linkage.joints(travel)
        position = complex(*joints.body_point[0]) + complex(*coupler.centre) * np.exp(
            1j * np.deg2rad(joints.rotation[0])
        )
        assert held == pytest.approx(coupler.mass)
        assert moved / held == pytest.approx(position, abs=1e-6), k
    masses = {"masses": parts.to_dict()["masses"]}
    by_masses, by_parts = (linkage.analysis(5, load, direction) for load in (masses, {"parts": True}))
    assert np.abs(by_masses.drive_load).min() > 0
    # by default they are mounted on a single board
    assert by_parts.drive_load == pytest.approx(by_masses.drive_load, rel=0.2)
    request = [{"kind": "rotary" if turns else "actuator"}]
    driven = la.drives(linkage, request, crank_angle=direction[[0, -1]], load={"parts": True})
    assert np.abs(driven.torque.torque).max() > 0
    body = {"linkage": linkage.to_dict(), "crank_angle": [0, 25], "load": {"parts": True}, "drives": request}
    assert client.post("/v2/drives", json=body).status_code == 200
    parts.save(tmp_path / "pump.step")
    assert len(step_shells((tmp_path / "pump.step").read_text())) == len(solids.parts)


def test_parts_that_would_collide_are_refused_with_the_reason(tmp_path) -> None:
    double = la.FourBar(60, 50, 70, 30)
    words = r"would collide: .*with boards on both sides 3 layers are free"
    with pytest.raises(la.FieldError, match=words) as refused:
        double.save(tmp_path / "x.step")
    assert refused.value.field == "/assembly"
    assert not list(tmp_path.iterdir())
    double.save(tmp_path / "x.step", allow_collisions=True)
    double.save(tmp_path / "y.step", boards="both")
    assert len(list(tmp_path.iterdir())) == 2


OUTLINES = {
    "a corner at the body point": [[0, 0], [90, 0], [90, 60], [0, 60]],
    "a side through it": [[-40, 0], [90, 0], [90, 60], [-40, 60]],
    "beside it": [[30, 20], [120, 20], [120, 80], [30, 80]],
    "slimmer than the plates": [[-60, -5], [60, -5], [60, 5], [-60, 5]],
    "as slim as a pin": [[-60, -3], [60, -3], [60, 3], [-60, 3]],
    "an angle with the point within": [[-50, -50], [80, -50], [80, -20], [-20, -20], [-20, 80], [-50, 80]],
}


POINTS = {"arm": (20, 60), "at D": (0, 0), "beside C": (70, 0)}
PLACED = [(name, [*POINTS][(k + shift) % 3]) for shift in range(3) for k, name in enumerate(OUTLINES)]
"""The first six have each outline and each point."""


@pytest.mark.parametrize(("name", "point"), some_of(PLACED, 6))
def test_a_body_that_has_layers_can_be_made(name, point) -> None:
    outline, point = OUTLINES[name], POINTS[point]
    linkage = la.FourBar(19, 72, 144, 165, start_angle=30, coupler_point_polar=point)
    sizes = linkage.assembly(body=outline, **BOTH).sizes
    parts = linkage.solids(body=outline, allow_collisions=True, **BOTH)
    rim = min(part.prism.thinnest_wall for part in parts.solids.parts if part.name in ("body", "coupler"))
    assert rim >= min(sizes.thickness, (sizes.width - sizes.hole) / 8) * (1 - 1e-9)


ON_THE_LINE = [[0, 0], [100, 0], [30, 180], [72, 1e-4], [1e-9, 100], [72, 0], [36, 0], [30, 1e-11]]


@pytest.mark.parametrize("point", [None, *some_of(ON_THE_LINE, 4)])
def test_plates_to_cut_have_their_holes_at_the_joints(point) -> None:
    """Also with a body point on the coupler's line or at a pin, whose hole gives way to that of the pin."""
    lengths = {"CRANK": 19, "COUPLER": 72, "ROCKER": 144}
    linkage = la.FourBar(*lengths.values(), 165, coupler_point_polar=point)
    sizes = linkage.assembly(**BOTH).sizes
    document = ezdxf.read(io.StringIO(linkage.file("plates", assembly=BOTH).decode()))
    assert not document.audit().errors
    space = document.modelspace()
    for layer, length in lengths.items():
        (contour,) = space.query(f'LWPOLYLINE[layer=="{layer}"]')
        assert contour.closed
        outline = shapely.Polygon([point.vec2 for point in ezdxf.path.make_path(contour).flattening(1e-4)])
        circles = space.query(f'CIRCLE[layer=="{layer}"]')
        holes = [shapely.Point(circle.dxf.center.vec2) for circle in circles]
        assert holes[0].distance(holes[1]) == pytest.approx(length) and outline.is_valid
        assert [circle.dxf.radius for circle in circles] == pytest.approx([sizes.hole / 2] * len(circles))
        for hole in holes:
            assert outline.contains(hole) and outline.exterior.distance(hole) >= sizes.width / 2 * (1 - 1e-5)
        assert all(hole.distance(second) > sizes.hole for hole in holes for second in holes if second is not hole)


# -- the command and HTTP -----------------------------------------------------------------------------------------------


def test_one_command_gives_a_window_to_print(tmp_path, monkeypatch, capsys) -> None:
    """The command of the README: closed parts on the bed, every wall thicker than 1.2 mm."""
    monkeypatch.chdir(tmp_path)
    command = ["export", "--example", "casement", "--format", "3mf", "--fit", "print", "--scale", "0.5"]
    assert cli.main(command) == 0
    assert "wrote casement.3mf" in capsys.readouterr().err
    model = model_of((tmp_path / "casement.3mf").read_bytes())
    objects = {element.get("id"): element for element in model.iter(f"{CORE}object")}
    names, volume = set(), 0.0
    for item in model.iter(f"{CORE}item"):
        element = objects[item.get("objectid")]
        names.add(element.get("name"))
        corners = np.array([[float(v.get(k)) for k in "xyz"] for v in element.iter(f"{CORE}vertex")])
        triangles = np.array([[int(t.get(k)) for k in ("v1", "v2", "v3")] for t in element.iter(f"{CORE}triangle")])
        mesh = Mesh(corners, triangles)
        assert open_edges(mesh) == 0 and mesh.volume > 0
        volume += mesh.volume
        height = float(item.get("transform").split()[-1])
        assert corners[:, 2].min() + height == pytest.approx(0, abs=1e-9)
    assert {"crank", "coupler", "rocker", "pin_A", "pin_B", "pin_C", "pin_D", "board_below"} <= names
    assert 1e4 < volume < 1e6
    best = la.Linkage.from_dict(GALLERY["casement"]["reply"]["solutions"][0])
    motion = la.Motion(crank_angle=np.linspace(0, -33.7, 8), rotation=np.zeros(8))
    parts = best.solids(motion, fit="print", scale=0.5)
    assert {part.name for part in parts.parts} == names
    assert parts.thinnest_wall.value > 1.2
    assert volume == pytest.approx(sum(part.volume for part in parts.parts), rel=0.02)


@pytest.mark.parametrize("kind", OF_PARTS)
def test_http_gives_the_same_files(client, kind, request_body) -> None:
    request = {"assembly": BOTH, "solids": {"fit": "print", "pins": "brass"}}
    body = {"request": request_body, "linkage": WORKED.to_dict(), "format": kind, **request}
    reply = client.post("/v2/export", json=body)
    assert reply.status_code == 200, reply.text
    assert reply.headers["content-type"] == FORMATS[kind].media_type
    assert reply.headers["content-disposition"].endswith(f'linkage.{FORMATS[kind].endings[-1]}"')
    assert reply.content == WORKED.file(kind, la.Motion(**request_body), **request)
    body["assembly"] = {"boards": "both", "mounts": {"A": "below+above", "B": "below+above"}, "width": 60, "hole": 2}
    refused = client.post("/v2/export", json=body)
    assert refused.status_code == 422
    assert "would collide" in refused.text
    body["solids"]["allow_collisions"] = True
    assert client.post("/v2/export", json=body).status_code == 200


@pytest.mark.parametrize("name", some_of([*GALLERY], 2))
def test_a_machine_of_the_gallery_is_reopened_as_it_was(name, tmp_path) -> None:
    """In Open CASCADE: names, volumes, holes; its parts apart at 50 places."""
    machine = GALLERY[name]
    request = {name: machine["request"].get(name) for name in ("rotation", "position", "crank_span", "crank_angle")}
    motion = la.Motion(**request, timing=machine["request"].get("timing"))
    solution = machine["reply"]["solutions"][0]
    parts = la.Linkage.from_dict(solution).solids(motion, solution["crank_angle"], boards="both")
    deep, who = deepest(parts.solids, 50)
    assert deep <= 1e-9, who
    shells = step_shells(parts.file("step").decode())
    assert [shell["name"] for shell in shells] == [part.name for part in parts.parts]
    assert all(shell["closed"] for shell in shells)
    pytest.importorskip("OCP", reason="the extra [solids] is not installed")
    from tests.oracles.occt import reopened
    from tests.synthesis.solids.test_step import check

    title, found = reopened(parts.file("step").decode(), tmp_path)
    assert title == "linkage"
    for solid, part, position in zip(found, parts.solids.parts, parts.solids.posed(), strict=True):
        check(solid, part, position)
