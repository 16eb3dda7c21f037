"""Files of linkages on two guides: drawings that hold the geometry, tables, and models that MuJoCo runs."""

import csv
import io
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pytest

from synthesis.errors import FieldError
from synthesis.guided.files import to_csv, to_dxf, to_mjcf, to_svg
from synthesis.guides import Circle, Driver, Rail, Slot
from synthesis.linkage import Linkage, on_guides
from synthesis.target import Target
from tests.oracles.guided_cases import DRIVES, NAMES, good_linkage


def drawn(drive, turn: float = 0.0) -> tuple[Linkage, Target]:
    linkage, travel = good_linkage(np.random.default_rng(41), drive, -0.2, 1.0, 0.5), np.linspace(0.0, 0.8, 9)
    body = linkage.motions(travel)[1]
    return linkage, Target(body.angle + turn, body.origin, 1.0, crank=travel)


def test_a_body_a_whole_turn_away_is_where_it_was_asked_for() -> None:
    linkage, target = drawn(DRIVES[0], 2 * np.pi)
    for row in csv.DictReader(io.StringIO(to_csv(linkage, target, np.pi / 180))):
        assert abs(float(row["rotation_error"])) < 1e-10
        assert float(row["rotation"]) == pytest.approx(float(row["rotation_wanted"]), abs=1e-10)


@pytest.mark.parametrize("drive", DRIVES, ids=NAMES)
def test_a_table_has_what_the_linkage_does_and_what_was_asked_for(drive) -> None:
    linkage, target = drawn(drive)
    rows = list(csv.DictReader(io.StringIO(to_csv(linkage, target, np.pi / 180))))
    assert len(rows) == 9 and ("crank_angle" in rows[0]) == linkage.driver.turns
    for row, place, turn in zip(rows, target.position, target.rotation):
        assert complex(float(row["x"]), float(row["y"])) == pytest.approx(place, abs=1e-12)
        assert float(row["rotation"]) == pytest.approx(np.rad2deg(turn), abs=1e-10)
        assert abs(float(row["position_error"])) < 1e-12 and abs(float(row["rotation_error"])) < 1e-10
    for place, guide in enumerate(linkage.guides):
        name = linkage.link_names[0 if place == 0 else 2]
        if isinstance(guide, Rail):
            for row in rows:
                at = complex(float(row[f"{name}_pin_x"]), float(row[f"{name}_pin_y"]))
                along = guide.point + float(row[f"{name}_travel"]) * np.exp(1j * guide.direction)
                assert at == pytest.approx(along, abs=1e-12)
        if isinstance(guide, Circle):
            at = complex(float(rows[0][f"{name}_pin_x"]), float(rows[0][f"{name}_pin_y"]))
            assert abs(at - guide.pivot) == pytest.approx(guide.radius, rel=1e-12)


@pytest.mark.parametrize("drive", DRIVES, ids=NAMES)
def test_a_drawing_for_cad_holds_the_geometry(drive) -> None:
    linkage, target = drawn(drive)
    document = ezdxf.read(io.StringIO(to_dxf(linkage, target, 10.0)))
    assert not document.audit().errors
    space = document.modelspace()
    lines = {}
    for layer in ("GROUND", "LINKS", "BODY"):
        ends = [(one.dxf.start, one.dxf.end) for one in space.query(f'LINE[layer=="{layer}"]')]
        lines[layer] = [tuple(complex(end.x, end.y) for end in both) for both in ends]
    pose = linkage.motions(0.0)[1]
    turned = np.exp(1j * pose.angle[0])
    for guide in linkage.guides:
        at = 10 * (pose.origin[0] + turned * guide.body_point)
        if isinstance(guide, Rail):
            assert any(abs(_beside(at, line)) < 1e-6 for line in lines["GROUND"])
        elif isinstance(guide, Slot):
            assert any(abs(_beside(10 * guide.pin, line)) < 1e-6 for line in lines["BODY"])
        else:
            assert any(abs(line[0] - 10 * guide.pivot) < 1e-6 and abs(line[1] - at) < 1e-6 for line in lines["LINKS"])
    assert len(space.query('POINT[layer=="BODY"]')) == 9


def _beside(point: complex, line: tuple[complex, complex]) -> float:
    begin, end = line
    return float(np.imag(np.conj(end - begin) * (point - begin)) / abs(end - begin))


@pytest.mark.parametrize("drive", DRIVES, ids=NAMES)
def test_a_drawing_to_look_at_is_xml_with_every_part(drive) -> None:
    linkage, target = drawn(drive)
    text = to_svg(linkage, target)
    ElementTree.fromstring(text)
    sorts = [type(one) for one in linkage.guides]
    assert text.count('class="rail"') == sorts.count(Rail)
    assert text.count('class="slot"') == sorts.count(Slot)
    assert text.count('class="slider"') == 2 - sorts.count(Circle)
    assert f"driven by a {linkage.driver}" in text


@pytest.mark.parametrize("drive", DRIVES, ids=NAMES)
def test_a_model_has_a_joint_of_every_sort_and_one_loop(drive) -> None:
    linkage, target = drawn(drive)
    model = ElementTree.fromstring(to_mjcf(linkage, target))
    joints = {one.get("name"): one.get("type", "hinge") for one in model.iter("joint") if one.get("name")}
    names = linkage.link_names
    slots = [isinstance(one, Slot) for one in linkage.guides]
    assert joints[names[0]] == ("slide" if isinstance(linkage.guides[0], Rail) else "hinge")
    assert joints[names[2]] == ("slide" if isinstance(linkage.guides[1], Rail) else "hinge")
    assert joints["coupler"] == ("slide" if slots[0] else "hinge") and ("slide" in joints) == slots[1]
    # longer extensions push the body back along its slot
    axes = {one.get("name"): one.get("axis") for one in model.iter("joint") if one.get("type") == "slide"}
    if slots[1]:
        assert axes["slide"] == "-1 0 0"
    if slots[0]:
        along = complex(*[float(part) for part in axes["coupler"].split()[:2]])
        assert along == pytest.approx(-np.exp(1j * linkage.guides[0].body_direction), abs=1e-12)
    drive_joint = model.find("actuator/velocity").get("joint")
    assert drive_joint == ("coupler" if linkage.driver is Driver.CYLINDER else names[0])
    assert len(list(model.find("equality"))) == 1
    assert len(model.find("keyframe/key").get("qvel").split()) == len(joints)


@pytest.mark.parametrize("drive", DRIVES, ids=NAMES)
def test_a_model_begins_as_fast_in_every_unit(drive) -> None:
    linkage, target = drawn(drive)

    def speeds(unit_mm: float) -> list[float]:
        model = ElementTree.fromstring(to_mjcf(linkage, target, unit_mm))
        slides = [one.get("type") == "slide" for one in model.iter("joint") if one.get("name")]
        given = map(float, model.find("keyframe/key").get("qvel").split())
        return [speed / unit_mm if slide else speed for slide, speed in zip(slides, given, strict=True)]

    assert speeds(10.0) == pytest.approx(speeds(1000.0), rel=1e-12)


@pytest.mark.parametrize("drive", DRIVES, ids=NAMES)
def test_a_model_runs_in_mujoco_as_the_kinematics_say(drive) -> None:
    mujoco = pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")
    linkage, target = drawn(drive)
    model = mujoco.MjModel.from_xml_string(to_mjcf(linkage, target, 1000.0))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    address = model.jnt_qposadr[model.actuator("drive").trnid[0]]
    for _ in range(3000):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    assert data.qpos[address] > 0.05
    there = linkage.motions(float(data.qpos[address]))[1].origin[0]
    assert abs(complex(*data.site("body_point").xpos[:2]) - there) < 1e-5


def test_a_linkage_that_opens_is_refused_where_it_does() -> None:
    linkage = on_guides((Circle(0j, 1.0, 0j), Rail(0.3j, 0.0, 1.1 + 0j)), Driver.CRANK, start=0.5)
    with pytest.raises(FieldError, match=r"cannot hold the body 2.* degrees after the start"):
        to_svg(linkage, Target(None, None, crank=np.linspace(0.0, 5.0, 20)))
