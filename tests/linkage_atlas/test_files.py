"""Files of every kind of linkage hold its geometry and its motion.

These tests would catch a wrong frame, unit, column or joint in a table, a drawing or a simulation model.
"""

import csv
import io
from typing import Any
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pytest

import linkage_atlas as la
from synthesis.export.simulation import to_mjcf
from synthesis.guides import Circle, Driver, Rail, Slot
from synthesis.linkage import Linkage, four_bar, on_guides
from synthesis.target import Target
from tests.oracles.guided_cases import DRIVES, NAMES, good_linkage

DEG = np.pi / 180
SVG = "{http://www.w3.org/2000/svg}"
TEXTS = ("csv", "svg", "dxf", "mjcf")


def moving_four_bar(seed: int, turns_fully: bool, mounted: bool = True) -> Linkage:
    """Return a four-bar that moves well over 0.8 rad, or over a whole turn."""
    random = np.random.default_rng(seed)
    while True:
        position: dict[str, Any] = {
            "pivot_a": complex(*random.uniform(-9, 9, 2)),
            "ground_angle": random.uniform(-3, 3),
        }
        position |= {"coupler_point_polar": tuple(random.uniform(-3, 3, 2)), "body_offset": random.uniform(-3, 3)}
        lengths = tuple(random.uniform(1, 9, 4).tolist())
        linkage = four_bar(lengths, int(random.choice([-1, 1])), random.uniform(0, 6), **position if mounted else {})
        angles = linkage.body(linkage.start + np.linspace(0, 7 if turns_fully else 0.8, 90)).transmission_angle
        if linkage.turns_fully == turns_fully and np.all(angles > 0.3):
            return linkage


LINKAGES = {
    name: good_linkage(np.random.default_rng(41), drive, -0.2, 1.0, 0.5)
    for name, drive in zip(NAMES, DRIVES)
    if name != "crank-Circle"
} | {
    "four-bar turning": moving_four_bar(0, True),
    "four-bar swinging": moving_four_bar(1, False),
    "four-bar without positions": moving_four_bar(2, False, False),
}
ANY = pytest.mark.parametrize("linkage", LINKAGES.values(), ids=LINKAGES)
MOUNTED = pytest.mark.parametrize("name", [name for name in LINKAGES if "without" not in name])


def motion_of(linkage: Linkage, turn: float = 0.0) -> Target:
    travel = np.linspace(0.0, 0.8, 9)
    body = linkage.motions(travel)[1]
    return Target(body.angle + turn, body.origin if linkage.mounted else None, 1.0, crank=travel)


def text_of(linkage: Linkage, kind: str, target: Target | None = None, **options: Any) -> str:
    return la.Linkage.of(linkage, DEG, target or motion_of(linkage)).render(kind, **options)


def rows_of(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def point(row: dict[str, str], name: str) -> complex:
    return complex(float(row[name.format("x")]), float(row[name.format("y")]))


@ANY
def test_a_table_has_the_request_the_motion_and_the_joints(linkage) -> None:
    target = motion_of(linkage, 2 * np.pi)  # a body a whole turn away is in the requested position
    rows = rows_of(text_of(linkage, "csv", target))
    assert len(rows) == 9 and ("crank_angle" in rows[0]) == linkage.driver.turns
    for index, row in enumerate(rows):
        assert float(row["rotation"]) == pytest.approx(target.rotation[index] / DEG, abs=1e-9)
        assert abs(float(row["rotation_error"])) < 1e-9
        if linkage.mounted:
            assert point(row, "{}") == pytest.approx(target.position[index], abs=1e-9)
            assert float(row["position_error"]) < 1e-9
        else:
            assert row["x"] == row["x_wanted"] == row["position_error"] == ""
        pins = []
        for guide, link in zip(linkage.guides, linkage.link_names[::2]):
            if not isinstance(guide, Slot):
                pins.append(point(row, f"{'coupler' if link == 'rocker' else link}_pin_{{}}"))
            if isinstance(guide, Rail):
                along = guide.point + float(row[f"{link}_travel"]) * np.exp(1j * guide.direction)
                assert pins[-1] == pytest.approx(along, abs=1e-9)
            if isinstance(guide, Circle):
                spoke = guide.radius * np.exp(1j * DEG * float(row[f"{link}_direction"]))
                assert pins[-1] - guide.pivot == pytest.approx(spoke, abs=1e-9)
        if len(pins) == 2:
            assert abs(pins[1] - pins[0]) == pytest.approx(linkage.lengths["coupler"], rel=1e-9)
    if linkage.is_four_bar:
        along = linkage.links[1] * np.exp(1j * DEG * float(row["coupler_direction"]))
        assert pins[1] - pins[0] == pytest.approx(along, abs=1e-9)


@ANY
@pytest.mark.parametrize(("unit", "unit_mm"), [("mm", 1.0), ("in", 25.4)])
def test_a_drawing_for_cad_holds_the_geometry(linkage, unit, unit_mm) -> None:
    document = ezdxf.read(io.StringIO(text_of(linkage, "dxf", length_unit=unit)))
    audit = document.audit()
    assert not audit.errors and not audit.fixes and document.units == ezdxf.units.MM
    space = document.modelspace()
    lines = {
        layer: [
            (complex(*line.dxf.start.vec2), complex(*line.dxf.end.vec2))
            for line in space.query(f'LINE[layer=="{layer}"]')
        ]
        for layer in ("GROUND", "LINKS", "BODY")
    }
    body = linkage.motions(0.0)[1]
    pins = []
    for guide in linkage.guides:
        pins.append(unit_mm * complex(body.position(guide.body_point)[0]))
        if isinstance(guide, Rail):
            assert any(beside(pins[-1], line) < 1e-6 for line in lines["GROUND"])
        elif isinstance(guide, Slot):
            assert any(beside(unit_mm * guide.pin, line) < 1e-6 for line in lines["BODY"])
        else:
            assert any(joins(line, unit_mm * guide.pivot, pins[-1]) for line in lines["LINKS"])
    if linkage.is_four_bar:
        assert any(joins(line, *pins) for line in lines["LINKS"]) and len(lines["LINKS"]) == 3
        assert [abs(end - start) / unit_mm for start, end in lines["GROUND"]] == pytest.approx([linkage.links[3]])
    paths = space.query('LWPOLYLINE[layer=="PATH"]')
    assert len(paths) == linkage.mounted
    for path in paths:
        drawn = np.array([complex(x, y) for x, y, *_ in path.get_points()])
        exact = linkage.motions(np.linspace(0, 0.8, drawn.size))[1].origin * unit_mm
        np.testing.assert_allclose(drawn, exact, atol=1e-6)
    assert len(space.query('POINT[layer=="BODY"]')) == 9 * linkage.mounted


def joins(line: tuple[complex, complex], first: complex, second: complex) -> bool:
    return min(abs(line[0] - a) + abs(line[1] - b) for a, b in ((first, second), (second, first))) < 1e-6


def beside(at: complex, line: tuple[complex, complex]) -> float:
    start, end = line
    return abs(float(np.imag(np.conj(end - start) * (at - start)) / abs(end - start)))


@ANY
def test_a_drawing_to_view_has_every_part_on_its_page(linkage) -> None:
    root = ElementTree.fromstring(text_of(linkage, "svg"))
    width, height = (float(value) for value in root.get("viewBox").split()[2:])
    classes = [path.get("class") for path in root.iter(SVG + "path")]
    types = [type(guide) for guide in linkage.guides]
    assert classes.count("rail") == types.count(Rail) and classes.count("slot") == types.count(Slot)
    assert classes.count("slider") == 2 - types.count(Circle)
    assert classes.count("ground") == (Rail not in types)
    assert classes.count("path") == linkage.mounted
    assert classes.count("turn") == (linkage.mounted and linkage.turns_fully)
    for path in root.iter(SVG + "path"):
        for at in path.get("d").removeprefix("M").removesuffix("Z").split(" L"):
            x, y = map(float, at.split(","))
            assert -1e-3 <= x <= width + 1e-3 and -1e-3 <= y <= height + 1e-3
    words = [label.text for label in root.iter(SVG + "text")]
    expected = ["AB"[k] for k in (0, 1) if types[k] is not Rail] + ["DC"[k] for k in (0, 1) if types[k] is not Slot]
    expected += ["P"] if linkage.mounted else []
    assert words[: len(expected)] == expected
    sizes = [float(word) for word in words[len(expected) :]]
    if linkage.is_four_bar:
        np.testing.assert_allclose(sizes, linkage.links, rtol=1e-4)
    assert (f"driven by a {linkage.driver}" in root.find(SVG + "title").text) == (linkage.driver is not Driver.CRANK)


def places_of(root: ElementTree.Element) -> dict[str, complex]:
    """Return where the sites of a model lie in the plane."""
    found = {}

    def walk(element: ElementTree.Element, origin: complex, turn: float) -> None:
        for site in element.findall("site"):
            found[site.get("name")] = origin + np.exp(1j * turn) * complex(*map(float, site.get("pos").split()[:2]))
        for body in element.findall("body"):
            at = complex(*map(float, body.get("pos", "0 0 0").split()[:2]))
            angle = float(body.get("euler", "0 0 0").split()[2])
            walk(body, origin + np.exp(1j * turn) * at, turn + angle)

    walk(root.find("worldbody"), 0j, 0.0)
    return found


@ANY
def test_a_model_has_a_joint_of_every_kind_and_a_closed_loop(linkage) -> None:
    root = ElementTree.fromstring(text_of(linkage, "mjcf"))
    joints = {joint.get("name"): joint.get("type", "hinge") for joint in root.iter("joint") if joint.get("name")}
    first, second = linkage.guides
    names = linkage.link_names
    assert joints[names[0]] == ("slide" if isinstance(first, Rail) else "hinge")
    assert joints[names[2]] == ("slide" if isinstance(second, Rail) else "hinge")
    assert joints["coupler"] == ("slide" if isinstance(first, Slot) else "hinge")
    assert ("slide" in joints) == isinstance(second, Slot)
    # longer extensions push the body back along its slot
    axes = {joint.get("name"): joint.get("axis") for joint in root.iter("joint") if joint.get("type") == "slide"}
    assert axes.get("slide", "-1 0 0") == "-1 0 0"
    if isinstance(first, Slot):
        along = complex(*map(float, axes["coupler"].split()[:2]))
        assert along == pytest.approx(-np.exp(1j * first.body_direction), abs=1e-12)
    drive = root.find("actuator/velocity").get("joint")
    assert drive == ("coupler" if linkage.driver is Driver.CYLINDER else names[0])
    assert len(root.find("keyframe/key").get("qvel").split()) == len(joints)
    (loop,) = root.find("equality")
    sites = places_of(root)
    assert sites["loop_coupler"] == pytest.approx(sites[f"loop_{names[2]}"], abs=1e-12)
    assert {loop.get("site1"), loop.get("site2")} - {None} <= set(sites)
    if linkage.mounted:
        assert sites["body_point"] == pytest.approx(motion_of(linkage).position[0] / 1000, abs=1e-12)


@MOUNTED
@pytest.mark.parametrize("heavy", [True, False], ids=["masses of parts", "slender rods"])
def test_a_model_runs_in_mujoco_as_the_kinematics_say(name, heavy) -> None:
    mujoco = pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")
    linkage = LINKAGES[name]
    text = (
        text_of(linkage, "mjcf", length_unit="m") if heavy else to_mjcf(linkage, motion_of(linkage), unit_mm=1000.0)
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    ends = data.site("loop_coupler"), data.site(f"loop_{linkage.link_names[2]}")
    address = model.jnt_qposadr[model.actuator("drive").trnid[0]]
    gap = 0.0
    for _ in range(3000):
        mujoco.mj_step(model, data)
        gap = max(gap, float(np.linalg.norm(ends[0].xpos - ends[1].xpos)))
    mujoco.mj_forward(model, data)
    assert gap < 1e-4 and data.qpos[address] > 0.05
    exact = linkage.motions(float(data.qpos[address]))[1].origin[0]
    assert abs(complex(*data.site("body_point").xpos[:2]) - exact) < 1e-4


@pytest.mark.parametrize("kind", TEXTS)
def test_a_linkage_that_opens_or_is_too_far_away_is_refused(kind) -> None:
    opening = Target(None, None, crank=np.linspace(0.0, 5.0, 20))
    with pytest.raises(la.FieldError, match="four links do not close 0 degrees after the start"):
        text_of(four_bar((9.0, 1.0, 1.0, 1.0)), kind, opening)
    for distant in (1e15 + 0j, 3e10j):
        with pytest.raises(la.FieldError, match=r"origin|size"):
            text_of(four_bar((1.0, 3.0, 3.0, 3.0), pivot_a=distant, coupler_point_polar=(1.0, 0.0)), kind, opening)
    pump = on_guides((Circle(0j, 1.0, 0j), Rail(0.3j, 0.0, 1.1 + 0j)), Driver.CRANK, 1, 0.5)
    with pytest.raises(la.FieldError, match=r"cannot hold the body 2.* degrees after the start"):
        text_of(pump, kind, opening)
