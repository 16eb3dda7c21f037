"""Files of a linkage: they open again, and hold the linkage that the reply says."""

import csv
import io
import json
import math
import xml.etree.ElementTree as ElementTree

import ezdxf
import numpy as np
import pytest

from app import cli
from app.registry import worked_example
from synthesis.errors import FieldError
from synthesis.fourbar.files import to_csv, to_dxf, to_mjcf, to_svg
from synthesis.fourbar.joints import joints_at, joints_over
from synthesis.linkage import Linkage, four_bar
from synthesis.target import Interval, make_target

DEG = np.pi / 180
SVG = "{http://www.w3.org/2000/svg}"
EXACT = {"top": 2}


@pytest.fixture(scope="module")
def solved(client):
    """The worked example and its reply."""
    request = {**worked_example(), **EXACT}
    return request, client.post("/v1/synthesize", json=request).json()


def export(client, solved, **more):
    request, reply = solved
    return client.post("/v1/export", json={"request": request, "solution": reply["solutions"][0], **more})


def random_linkage(rng: np.random.Generator, family: str) -> tuple[Linkage, float]:
    """A mounted linkage that closes over the span that is returned with it."""
    while True:
        links = tuple(float(v) for v in rng.uniform(10, 200, 4))
        span = float(rng.uniform(-2, 2)) if family == "any" else float(rng.uniform(-7, 7))
        linkage = four_bar(
            links,
            int(rng.choice([-1, 1])),
            float(rng.uniform(0, 6.28)),
            body_offset=float(rng.uniform(-3, 3)),
            ground_angle=float(rng.uniform(-3, 3)),
            pivot_a=complex(*rng.uniform(-300, 300, 2)),
            coupler_point=(float(rng.uniform(0, 150)), float(rng.uniform(-3, 3))),
        )
        if family == "full" and not linkage.turns_fully:
            continue
        joints = joints_over(linkage, Interval(0, span))
        if abs(span) > 0.1 and np.all(np.isfinite(joints.coupler_pin)) and joints.transmission_angle.min() > 0.2:
            return linkage, span


LINKAGES = [random_linkage(np.random.default_rng(seed), family) for seed, family in enumerate(["full", "any"] * 6)]


def target_of(linkage: Linkage, span: float):
    travel = np.linspace(0, span, 9)
    joints = joints_at(linkage, travel)
    return make_target(joints.rotation, joints.body_point, span)


def lines_of(document, layer):
    return [
        (complex(*entity.dxf.start.vec2), complex(*entity.dxf.end.vec2))
        for entity in document.modelspace().query(f'LINE[layer=="{layer}"]')
    ]


@pytest.mark.parametrize(("linkage", "span"), LINKAGES)
@pytest.mark.parametrize("unit_mm", [1.0, 25.4])
def test_dxf_opens_audits_clean_and_closes_its_loop(linkage, span, unit_mm) -> None:
    document = ezdxf.read(io.StringIO(to_dxf(linkage, target_of(linkage, span), unit_mm)))
    audit = document.audit()
    assert not audit.errors and not audit.fixes
    assert document.units == ezdxf.units.MM
    assert {"GROUND", "LINKS", "BODY", "PATH"} <= {layer.dxf.name for layer in document.layers}
    (ground,) = lines_of(document, "GROUND")
    crank, coupler, rocker = lines_of(document, "LINKS")
    for (_, end), (start, _) in zip((crank, coupler, rocker), (coupler, rocker, (ground[1], 0))):
        assert abs(end - start) < 1e-6
    assert abs(crank[0] - ground[0]) < 1e-6
    for line, length in zip((crank, coupler, rocker, ground), linkage.links):
        assert abs(abs(line[1] - line[0]) - length * unit_mm) < 1e-6
    (path,) = document.modelspace().query('LWPOLYLINE[layer=="PATH"]')
    points = np.array([complex(x, y) for x, y, *_ in path.get_points()])
    wanted = joints_over(linkage, Interval(0, span)).body_point * unit_mm
    assert np.abs(points - wanted).max() < 1e-6
    assert len(document.modelspace().query('POINT[layer=="BODY"]')) == 9


@pytest.mark.parametrize(("linkage", "span"), LINKAGES)
def test_svg_is_a_drawing_of_the_linkage(linkage, span) -> None:
    root = ElementTree.fromstring(to_svg(linkage, target_of(linkage, span)))
    width, height = (float(v) for v in root.get("viewBox").split()[2:])
    parts = {path.get("class"): path.get("d") for path in root.iter(SVG + "path")}
    ends = {
        name: [complex(*map(float, at.split(","))) for at in parts[name].removeprefix("M").split(" L")]
        for name in ("ground", "crank", "rocker", "path")
    }
    for points in ends.values():
        for z in points:
            assert 0 <= z.real <= width and 0 <= z.imag <= height
    sizes = [abs(ends[name][1] - ends[name][0]) for name in ("crank", "rocker", "ground")]
    ratio = sizes[0] / linkage.links[0]
    assert sizes[1] / linkage.links[2] == pytest.approx(ratio, rel=1e-4)
    assert sizes[2] / linkage.links[3] == pytest.approx(ratio, rel=1e-4)
    assert sum(circle.get("class") == "pose" for circle in root.iter(SVG + "circle")) == 9


@pytest.mark.parametrize(("linkage", "span"), LINKAGES)
def test_csv_holds_the_motion_at_full_precision(linkage, span) -> None:
    target = target_of(linkage, span)
    rows = list(csv.DictReader(io.StringIO(to_csv(linkage, target, DEG))))
    assert len(rows) == 9
    for row, crank, rotation, place in zip(rows, target.crank, target.rotation, target.position):
        assert float(row["crank_angle"]) * DEG == pytest.approx(crank, abs=1e-12)
        assert float(row["rotation"]) * DEG == pytest.approx(rotation, abs=1e-9)
        assert abs(complex(float(row["x"]), float(row["y"])) - place) < 1e-9
        assert float(row["position_error"]) < 1e-9 and abs(float(row["rotation_error"])) < 1e-9
        pin = complex(float(row["crank_pin_x"]), float(row["crank_pin_y"]))
        other = complex(float(row["coupler_pin_x"]), float(row["coupler_pin_y"]))
        assert abs(abs(pin - other) - linkage.links[1]) < 1e-9


@pytest.mark.parametrize(("linkage", "span"), LINKAGES)
def test_mjcf_is_a_tree_whose_loop_is_closed_by_an_equality(linkage, span) -> None:
    root = ElementTree.fromstring(to_mjcf(linkage, target_of(linkage, span)))
    (connect,) = root.find("equality").findall("connect")
    sites = {site.get("name"): site for site in root.iter("site")}
    assert {connect.get("site1"), connect.get("site2")} <= set(sites)
    bodies = {body.get("name"): body for body in root.iter("body")}
    place = {}
    for name in ("crank", "rocker"):
        x, y, _ = map(float, bodies[name].get("pos").split())
        place[name] = complex(x, y), float(bodies[name].get("euler").split()[2])
    at, turn = place["crank"]
    x, _, _ = map(float, bodies["coupler"].get("pos").split())
    pin, turn2 = at + x * np.exp(1j * turn), turn + float(bodies["coupler"].get("euler").split()[2])
    from_coupler = pin + float(sites["loop_coupler"].get("pos").split()[0]) * np.exp(1j * turn2)
    base, turn3 = place["rocker"]
    from_rocker = base + float(sites["loop_rocker"].get("pos").split()[0]) * np.exp(1j * turn3)
    assert abs(from_coupler - from_rocker) < 1e-12
    assert abs(x - linkage.links[0] / 1000) < 1e-15


@pytest.mark.parametrize(("linkage", "span"), LINKAGES[:6])
@pytest.mark.parametrize("start", ["keyframe", "rest"])
def test_mjcf_runs_in_mujoco_with_its_loop_closed(linkage, span, start) -> None:
    mujoco = pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")
    target = target_of(linkage, span)
    model = mujoco.MjModel.from_xml_string(to_mjcf(linkage, target))
    data = mujoco.MjData(model)
    if start == "keyframe":
        mujoco.mj_resetDataKeyframe(model, data, 0)
    else:
        data.ctrl[0] = math.copysign(1.0, span)
    mujoco.mj_forward(model, data)
    ends = data.site("loop_coupler"), data.site("loop_rocker")
    assert abs(complex(*data.site("body_point").xpos[:2]) * 1000 - target.position[0]) < 1e-6
    worst = 0.0
    for _ in range(min(3000, int(abs(span) / model.opt.timestep))):
        mujoco.mj_step(model, data)
        worst = max(worst, float(np.linalg.norm(ends[0].xpos - ends[1].xpos)))
    assert worst < 1e-6
    assert abs(data.joint("crank").qpos[0]) > 0.01
    # the simulated body lies where the kinematics say for the crank's simulated angle
    mujoco.mj_forward(model, data)
    there = joints_at(linkage, np.array([data.joint("crank").qpos[0]])).body_point[0]
    assert abs(complex(*data.site("body_point").xpos[:2]) * 1000 - there) < 0.01


def test_every_format_over_http_from_a_solution(client, solved) -> None:
    request, reply = solved
    best = reply["solutions"][0]
    dxf = export(client, solved, format="dxf")
    assert dxf.status_code == 200 and dxf.headers["content-type"] == "image/vnd.dxf"
    assert dxf.headers["content-disposition"] == 'attachment; filename="linkage.dxf"'
    assert not ezdxf.read(io.StringIO(dxf.text)).audit().errors
    assert ElementTree.fromstring(export(client, solved, format="svg").text).tag == SVG + "svg"
    assert ElementTree.fromstring(export(client, solved, format="mjcf").text).tag == "mujoco"
    rows = list(csv.DictReader(io.StringIO(export(client, solved, format="csv").text)))
    assert [float(row["x_wanted"]) for row in rows] == [x for x, _ in request["position"]]
    whole = export(client, solved).json()
    assert whole["solution"]["links"] == best["links"]
    assert whole["request"] == {**request}
    thin = {"crank": 1e-99, "coupler": 1e99, "rocker": 1e99, "ground": 1}
    odd = {"links": thin, "branch": 1, "start_angle": 0}
    assert all(export(client, solved, solution=odd, format=kind).status_code == 200 for kind in ("csv", "svg"))


def test_exports_by_ending_over_http_and_on_the_command_line(client, solved, tmp_path) -> None:
    request, _ = solved
    file = tmp_path / "request.json"
    file.write_text(json.dumps(request))
    for name in ("csv", "svg", "dxf", "mjcf"):
        over_http = client.post(f"/v1/synthesize.{name}", json=request)
        assert over_http.status_code == 200, over_http.text
        out = tmp_path / f"linkage.{name}"
        assert cli.main(["synthesize", str(file), "--no-preset", "--export", str(out)]) == 0
        if name == "csv":  # the command's linkage went through degrees, which may cost a last digit
            ours, theirs = (list(csv.DictReader(io.StringIO(text))) for text in (out.read_text(), over_http.text))
            assert [list(row) for row in ours] == [list(row) for row in theirs]
            numbers = [[[float(value) for value in row.values()] for row in rows] for rows in (ours, theirs)]
            np.testing.assert_allclose(*numbers, rtol=1e-12, atol=1e-12)
        elif name != "dxf":  # whose header holds a time and a new identity
            assert out.read_bytes() == over_http.content
    assert not ezdxf.readfile(tmp_path / "linkage.dxf").audit().errors


def test_rank_and_request_without_a_solution(client, solved) -> None:
    request, reply = solved
    second = client.post("/v1/export", json={"request": request, "rank": 2}).json()["solution"]
    assert second["links"] == reply["solutions"][1]["links"]


def test_rotation_only_has_no_path_but_a_linkage(client) -> None:
    request = {"rotation": worked_example()["rotation"], "crank_span": 70, "top": 1}
    drawn = client.post("/v1/synthesize.dxf", json=request)
    document = ezdxf.read(io.StringIO(drawn.text))
    assert not document.audit().errors
    assert len(lines_of(document, "LINKS")) == 3 and not document.modelspace().query('*[layer=="PATH"]')
    rows = list(csv.DictReader(io.StringIO(client.post("/v1/synthesize.csv", json=request).text)))
    assert rows[0]["x"] == "" and abs(float(rows[3]["rotation_error"])) < 1e-6
    for name in ("svg", "mjcf"):
        ElementTree.fromstring(client.post(f"/v1/synthesize.{name}", json=request).text)


def test_radians_say_the_same_as_degrees(client, solved) -> None:
    request, _ = solved
    turned = {**request, "rotation": [v * DEG for v in request["rotation"]], "crank_span": 70 * DEG}
    texts = [client.post("/v1/synthesize.csv", json=body).text for body in (request, turned | {"angle_unit": "rad"})]
    rows = [list(csv.DictReader(io.StringIO(text))) for text in texts]
    for one, two in zip(*rows):
        assert float(one["coupler_direction"]) == pytest.approx(float(two["coupler_direction"]) / DEG, abs=1e-6)


def test_a_linkage_that_does_not_close_is_named() -> None:
    linkage = four_bar((9.0, 1.0, 1.0, 1.0), 1, 0.0)
    target = make_target(np.array([0.0, 0.1, 0.2]), None, 1.0)
    for write in (to_svg, to_dxf, to_mjcf):
        with pytest.raises(FieldError, match="close"):
            write(linkage, target)
    with pytest.raises(FieldError, match="close"):
        to_csv(linkage, target, DEG)


@pytest.mark.parametrize("far", [1e15 + 0j, 3e10j])
def test_a_linkage_too_far_away_to_be_drawn_is_named(far) -> None:
    linkage = four_bar((1.0, 3.0, 3.0, 3.0), 1, 0.0, pivot_a=far, coupler_point=(1.0, 0.0))
    target = make_target(np.array([0.0, 0.1, 0.2]), None, 1.0)
    for write in (to_svg, to_dxf, to_mjcf):
        with pytest.raises(FieldError, match=r"origin|size"):
            write(linkage, target)


def test_the_drawing_names_joints_and_lengths() -> None:
    rng = np.random.default_rng(5)
    linkage, span = random_linkage(rng, "full")
    root = ElementTree.fromstring(to_svg(linkage, target_of(linkage, span)))
    words = [one.text for one in root.iter(f"{SVG}text")]
    assert words[:5] == ["A", "B", "D", "C", "P"]
    np.testing.assert_allclose([float(word) for word in words[5:]], linkage.links, rtol=1e-4)
