"""A linkage with its motor by the front door: it moves, draws, is analysed and saved, and is what the drive's reply says."""

import csv
import io
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

import linkage_atlas as la
from synthesis.solids.robots import tree_of

FOUR_BAR = la.FourBar(30, 60, 70, 50, start_angle=40, coupler_point=(40, 30), pivot_a=(5, -3))
LOAD = {"force": [0, -10]}
GUIDES = [
    {"guide": "circle", "pivot": [0, 0], "radius": 10, "body_point": [0, 0]},
    {"guide": "rail", "point": [0, 3], "direction": 0, "body_point": [20, 0]},
]


def found(linkage, links, way, **asked) -> la.SixBarLinkage:
    drives = la.drives(linkage, [{"kind": "dyad", "links": links, **asked}], crank_angle=way, load=LOAD)
    assert drives.drives, drives.refused
    return drives.drives[0].linkage, drives.drives[0]


@pytest.fixture(scope="module", params=["crank", "coupler", "rocker", "pump", "pump body"])
def six(request):
    if request.param.startswith("pump"):
        pump = la.Linkage(GUIDES, "crank", start=30)
        return found(pump, ["crank" if request.param == "pump" else "coupler"], [0, 20, 50])
    return found(FOUR_BAR, [request.param], [60, 90, 130] if request.param == "rocker" else [0, 25, 60])


def test_it_is_what_the_reply_of_its_drive_says(six) -> None:
    linkage, drive = six
    bar = drive.six_bar
    assert linkage.kind == bar.kind
    assert linkage.dwell() == pytest.approx(bar.dwell)
    assert linkage.turn == pytest.approx(bar.motor_turn)
    assert linkage.time_ratio == pytest.approx(bar.time_ratio)
    assert linkage.transmission_angle_min() == pytest.approx(bar.transmission_angle_min, abs=1e-3)
    sense = np.sign(bar.motor_turn[0])
    turned = (bar.motor_angle - bar.motor_angle[0]) * 1.0
    joints = linkage.joints(turned)
    assert joints.travel == pytest.approx(bar.crank_angle, abs=1e-9)
    assert joints.joints["K"] == pytest.approx(bar.motor_pin, abs=1e-9)
    assert linkage.joints(sense * abs(linkage.turn[0])).travel == pytest.approx(linkage.ends[1], abs=1e-6)
    made = linkage.analysis(0.0, LOAD, turned)
    assert made.motor_torque == pytest.approx(bar.motor_torque, abs=1e-9 * drive.peak_torque)
    rod = np.linalg.norm(made.pin_forces["Q"], axis=1)
    assert rod == pytest.approx(np.abs(bar.rod_force), rel=1e-9)
    # the rod is between its pins all the way
    assert np.linalg.norm(joints.joints["Q"] - joints.joints["K"], axis=1) == pytest.approx(np.full(121, linkage.rod))
    again = la.SixBarLinkage.from_dict(linkage.to_dict())
    assert again.joints(turned).joints["C"] == pytest.approx(joints.joints["C"], abs=1e-9)
    assert repr(again) == repr(linkage)


def test_steadily_driven_it_has_inertia(six) -> None:
    linkage, _ = six
    masses = [{"link": name, "mass": 0.5, "inertia": 20.0} for name in ("motor_crank", "rod", "body")]
    slow, fast = (linkage.analysis(speed, {"masses": masses}) for speed in (1.0, 3600.0))
    assert np.abs(fast.motor_torque - slow.motor_torque).max() > 1e-3
    # in centimetres everything is the same, lengths being ten times shorter
    weighed = linkage.analysis(3600.0, {"masses": masses}, length_unit="cm")
    inertia = fast.motor_torque - slow.motor_torque
    tens = weighed.motor_torque - slow.motor_torque
    assert tens == pytest.approx(10 * inertia, abs=1e-3 * np.abs(tens).max())
    # power in is the change of kinetic energy: over a turn nothing is left of it
    work = np.trapezoid(inertia[:-1], dx=2 * np.pi / 360) + (inertia[-2] + inertia[-1]) * np.pi / 360
    assert abs(work) < 1e-3 * np.abs(inertia).max()
    h = 1e-4
    at = np.array([20.0, 200.0])
    places = [linkage.joints(at + off).linkage.body_point for off in (-h, h)]
    speed = linkage.analysis(90.0, motor=at).velocity
    assert speed == pytest.approx((places[1] - places[0]) / (2 * h) * 90.0, rel=1e-5, abs=1e-5)


def test_its_files_hold_the_motor(six, tmp_path) -> None:
    linkage, drive = six
    rows = list(csv.DictReader(io.StringIO(linkage.render("csv", analysis={"motor_speed": 60, "load": LOAD}))))
    assert len(rows) == 73
    assert [float(row["motor_angle"]) for row in rows] == pytest.approx(np.linspace(0, 360, 73))
    for row in rows:
        knee, pin = (complex(float(row[f"{name}_x"]), float(row[f"{name}_y"])) for name in "KQ")
        assert abs(knee - complex(*drive.motor)) == pytest.approx(drive.six_bar.crank)
        assert abs(knee - pin) == pytest.approx(drive.six_bar.coupler)
    assert max(abs(float(row["motor_torque"])) for row in rows) == pytest.approx(drive.peak_torque, rel=1e-2)
    assert len(list(csv.DictReader(io.StringIO(linkage.render("csv", motor=[0, 90]))))) == 2
    assert 'id="DRIVE"' in linkage._repr_svg_()
    assert "DRIVE" in linkage.render("dxf")
    model = ElementTree.fromstring(linkage.render("mjcf"))
    assert model.find("actuator")[0].get("joint") == "motor"
    linkage.save(tmp_path / "wiper.svg")
    assert (tmp_path / "wiper.svg").read_text() == linkage.render("svg")


def test_a_simulator_turns_it_once_around(six, tmp_path) -> None:
    mujoco = pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")
    linkage, _ = six
    model = mujoco.MjModel.from_xml_string(linkage.render("mjcf"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    motor = model.joint("motor").qposadr[0]
    begin = data.qpos[motor]
    sense = np.sign(data.ctrl[0])
    turned = []
    point = model.site("body_point").id
    while abs(data.qpos[motor] - begin) < 2 * np.pi:
        mujoco.mj_step(model, data)
        turned.append((data.qpos[motor] - begin, *data.site_xpos[point][:2]))
    turned = np.array(turned[:: len(turned) // 60])
    first = linkage.way[0]
    wanted = linkage.joints(np.rad2deg(first + turned[:, 0])).linkage.body_point / 1000
    assert sense != 0
    assert np.abs(turned[:, 1:] - wanted).max() < 0.01 * np.ptp(wanted, axis=0).max()


@pytest.mark.parametrize("link", ["crank", "coupler"])
def test_its_urdf_closes_all_around_in_a_simulator(link) -> None:
    mujoco = pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")
    one, _ = found(FOUR_BAR, [link], [0, 60])
    parts = one.solids(boards="both", nevertheless=True)
    machine = parts.solids.machine
    names, joints = machine.movement.names, tree_of(machine)
    assert [joint.name for joint in joints if joint.closing] == ["C", "Q"]
    spec = mujoco.MjSpec.from_string(parts.file("urdf").decode())
    for joint in joints:
        if joint.closing:
            loop = spec.add_equality()
            loop.type, loop.objtype = mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtObj.mjOBJ_BODY
            loop.name1, loop.name2 = names[joint.parent], names[joint.child]
            loop.data[0:3] = [joint.at_parent.real / 1000, joint.at_parent.imag / 1000, 0]
    model = spec.compile()
    data = mujoco.MjData(model)
    first = machine.movement.bodies(np.zeros(1)).direction[:, 0]
    for turned in np.linspace(0, 2 * np.pi, 13):
        turn = machine.movement.bodies(np.array([turned])).direction[:, 0] / first
        for joint in joints:
            if not joint.closing:
                data.joint(joint.name).qpos = np.angle(turn[joint.child] / turn[joint.parent])
        mujoco.mj_forward(model, data)
        assert abs(data.efc_pos).max() < 1e-9
    # SDF has all seven
    assert parts.file("sdf").decode().count('type="revolute"') == 7


def test_on_a_hinge_it_is_a_four_bar() -> None:
    flap = {"pivot": [10, 5], "start": 20, "swing": -60, "length": 400}
    drive = la.drives(rocker=flap, drives=[{"kind": "dyad", "time_ratio": 1.2}]).drives[0]
    one = drive.linkage
    assert one.kind == "four_bar"
    assert one.family == "crank_rocker"
    turned = drive.six_bar.motor_angle - drive.six_bar.motor_angle[0]
    joints = one.joints(turned)
    assert joints.crank_pin == pytest.approx(drive.six_bar.motor_pin, abs=1e-6)
    rocker = joints.rocker_direction - joints.rocker_direction[0]
    assert rocker == pytest.approx(drive.six_bar.crank_angle, abs=1e-6)
    assert joints.coupler_pin[0] == pytest.approx(drive.pin, abs=1e-6)
    assert one.pivot_b == pytest.approx([10, 5])


def test_of_a_solution_it_passes_the_samples() -> None:
    position = [[0, 0], [22, 5], [41, 17], [52, 36], [50, 58]]
    best = la.synthesize(position=position, rotation=[0, 12, 27, 45, 66], timing="free", top=1)[0]
    one = la.drives(best, [{"kind": "dyad"}]).drives[0].linkage
    passed = one.joints(np.rad2deg(one.way)).linkage
    assert passed.body_point == pytest.approx(best.linkage.joints(best.crank_angle).body_point, abs=1e-6)
    assert np.all(np.diff(one.way) * np.sign(one.turn[0]) > 0)
    assert la.SixBarLinkage(best, one.drive).ends == pytest.approx(one.ends)


def test_what_is_amiss_is_named() -> None:
    one, drive = found(FOUR_BAR, ["crank"], [0, 60])
    for call, field in (
        (lambda: la.SixBarLinkage(FOUR_BAR, drive), "/crank_angle"),
        (lambda: la.SixBarLinkage(FOUR_BAR, {"kind": "rotary"}, [0, 60]), "/drive"),
        (lambda: la.SixBarLinkage(FOUR_BAR, {**one.drive, "link": "wing"}, [0, 60]), "/drive"),
        (lambda: la.SixBarLinkage(FOUR_BAR, drive, [0, 90]), "/drive"),
        (lambda: la.SixBarLinkage(one, drive, [0, 60]), "/linkage"),
        (lambda: la.drives(one), "/linkage"),
        (lambda: la.SixBarLinkage.from_dict({}), "/linkage"),
        (lambda: one.dwell(0.7), "/share"),
        (lambda: one.analysis("fast"), "/motor_speed"),
        (lambda: one.analysis(9, {"masses": [{"link": "wing", "mass": 1}]}), "/load/masses/0/link"),
        (lambda: one.assembly(drive=one.drive), "/drive"),
        (lambda: one.file("pylinkage"), "/drive"),
        (lambda: one.file("dwg"), "/kind"),
        (lambda: one.file("parts", assembly=True, solids={"fit": "loose"}), "/solids/fit"),
        (lambda: one.file("parts", assembly={"hole": 1e3}), "/assembly/hole"),
        (lambda: one.file("csv", analysis={}), "/analysis/motor_speed"),
        (lambda: one.tolerance_study(links=1), "/linkage"),
        (lambda: one.assembly(la.Motion(rotation=[0, 1, 2], crank_span=60)), "/motion"),
    ):
        try:
            call()
        except la.FieldError as refused:
            assert refused.field == field, refused
        else:
            pytest.fail(f"nothing amiss with {field}")
    assert one.file("parts", assembly=True) == one.file("parts")
