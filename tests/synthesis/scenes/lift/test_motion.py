"""Poses, motions, forces and files of the lift, compared with published values, textbook formulas and 60 digits.

The tests would detect a wrong branch near a dead point, a derivative that does not match its function, and results
that depend on the batch or on the unit of length.
"""

import csv
import io
import json
import math
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from synthesis.errors import FieldError
from synthesis.scenes.lift import motion as lift_loops
from synthesis.scenes.lift.files import design_csv, design_dxf, design_svg
from synthesis.scenes.lift.motion import BAR, Motion, Pneumatics, checked_stroke, forces, minimum_bore, motion
from synthesis.scenes.lift.pose import Cylinder, Design, dead_point, pose_at_turn, top_lever
from tests.oracles import lift as oracle

ROOT = Path(__file__).parents[4]
REFERENCE = json.loads((ROOT / "tests/reference/lift_acceptance.json").read_text())
DESIGNS = {name: Design(*map(float, lengths)) for name, lengths in REFERENCE["designs"].items()}
INITIAL, OPTIMUM = DESIGNS["initial"], DESIGNS["optimum"]
CYLINDER = Cylinder(220.0, 100.0)
BOTH = pytest.mark.parametrize("name", DESIGNS)
LAW = settings(derandomize=True, deadline=None, max_examples=60)


# -- random designs ------------------------------------------------------------------------------------------


@st.composite
def designs(draw) -> Design:
    """Draw working lifts of all proportions and scales from 1e-9 to 1e9."""
    scale = 10.0 ** draw(st.floats(-9, 9))
    l5 = draw(st.floats(0.3, 3.0))
    l3 = l5 * draw(st.floats(0.1, 0.97))
    l2 = draw(st.floats(0.2, 4.0))
    gamma = draw(st.floats(0.1, 2.6))
    l4 = math.sqrt(l2 * l2 + l3 * l3 - 2 * l2 * l3 * math.cos(gamma))
    b = draw(st.floats(0.2, 4.0))
    design = Design(*(scale * value for value in (l2, l3, l4, l5, b)))
    assume(float(top_lever(design)) > 0.05 * scale)
    return design


@st.composite
def lifts(draw) -> tuple[Design, Cylinder]:
    """Draw a design with a cylinder that starts on the working branch, away from the dead point."""
    design = draw(designs())
    turn_dead = float(dead_point(design))
    turn = turn_dead * draw(st.floats(0.2, 0.9))
    length = float(pose_at_turn(design, turn).length)
    travel = float(pose_at_turn(design, 0.0).length) - length
    assume(travel > 1e-3 * length and length > 1e-3 * design.b)
    speed = travel / 10.0 ** draw(st.floats(-3, 3)) * draw(st.sampled_from([-1, 1]))
    acceleration = draw(st.floats(-0.45, 3.0)) * speed * abs(speed) / travel
    return design, Cylinder(length, speed, acceleration)


def solved_loops(moved: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return velocities and accelerations of a motion by solving (13) and (14) pose by pose, and condition numbers."""
    loops, al = oracle.Loops(moved.pose.design), moved.cylinder_acceleration
    angles = lift_loops.link_angles(moved.pose).tolist()
    drive = list(zip(moved.cylinder_length.tolist(), moved.cylinder_speed.tolist()))
    rates = [loops.rates(at, l1, vl) for at, (l1, vl) in zip(angles, drive)]
    changes = [loops.accelerations(at, w, l1, vl, al) for at, w, (l1, vl) in zip(angles, rates, drive)]
    conditions = [loops.condition(at, l1) for at, (l1, _) in zip(angles, drive)]
    return np.array(rates), np.array(changes), np.array(conditions)


# -- acceptance values ---------------------------------------------------------------------------------------


@BOTH
def test_b1_c1_start(name) -> None:
    start, expected = motion(DESIGNS[name], CYLINDER, [0.0]), REFERENCE["start"][name]
    for found, (value, tolerance) in (
        (start.pose.height, expected["height"]),
        (start.velocity, expected["velocity"]),
        (start.acceleration, expected["acceleration"]),
    ):
        assert found[0] == pytest.approx(value, abs=tolerance)


@BOTH
def test_a1_b4_b9_c2_end(name) -> None:
    moved, expected = motion(DESIGNS[name], CYLINDER), REFERENCE["end"][name]
    assert moved.time[-1] == pytest.approx(expected["time"][0], abs=expected["time"][1])
    assert moved.cylinder_length[-1] == pytest.approx(expected["length"][0], abs=expected["length"][1])
    assert abs(moved.velocity[-1]) < 1e-9 and abs(moved.pose.height[-1] - 510) < 1e-9  # b9: the top is regular
    assert oracle.largest_residual(motion(DESIGNS[name], CYLINDER, samples=2001)) < 1e-9  # a1
    if "B" in expected:
        np.testing.assert_allclose([moved.pose.x[-1], moved.pose.y[-1]], expected["B"], rtol=0, atol=1e-8)


@BOTH
def test_d1_d2_dead_point_and_condition(name) -> None:
    design = DESIGNS[name]
    limits = checked_stroke(design, CYLINDER)
    assert float(limits.length_dead) == pytest.approx(REFERENCE["dead_point_length"][name], abs=1e-5)
    ends = pose_at_turn(design, np.array([limits.turn_bottom, 0.0]))
    for end, angles, length in zip(("start", "top"), lift_loops.link_angles(ends).tolist(), ends.length.tolist()):
        condition = oracle.Loops(design).condition(angles, length)
        assert condition == pytest.approx(REFERENCE["condition"][name][end], rel=5e-3)


# -- textbook formulas ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", DESIGNS)
@pytest.mark.parametrize("share", [1e-4, 0.03, 0.4, 0.9, 0.9999])
def test_motion_has_full_precision(name, share) -> None:
    design = DESIGNS[name]
    elongation = share * (float(pose_at_turn(design, 0.0).length) - 220.0)
    moved = motion(design, CYLINDER, [elongation / 100.0])
    exact = oracle.Exact(design).motion(CYLINDER, 100.0 * (elongation / 100.0))
    assert moved.pose.height[0] == pytest.approx(exact[0], rel=1e-14)
    assert moved.velocity[0] == pytest.approx(exact[1], rel=1e-11)
    assert moved.acceleration[0] == pytest.approx(exact[2], rel=1e-11)


# -- laws ----------------------------------------------------------------------------------------------------


@LAW
@given(lifts())
@example((INITIAL, CYLINDER))
@example((OPTIMUM, Cylinder(220.0, -100.0, -20.0)))
def test_random_lifts_close_and_solve_the_linear_systems(lift) -> None:
    design, cylinder = lift
    try:
        trajectory = motion(design, cylinder, samples=33)
    except FieldError as error:
        assert error.details["constraint"] == "stopping"
        assume(False)
    scale = design.l2 + design.l5 + design.b
    assert oracle.largest_residual(trajectory) < 1e-13 * scale
    assert np.all(np.diff(trajectory.pose.height) * np.sign(cylinder.speed) > 0)
    rates, changes, conditions = solved_loops(trajectory)
    bounded = conditions < 1e3
    fastest, largest_acceleration = np.max(np.abs(trajectory.velocity)), np.max(np.abs(trajectory.acceleration))
    assert np.max(np.abs(rates[:, 5] - trajectory.velocity)[bounded], initial=0.0) < 1e-9 * fastest
    assert np.max(np.abs(changes[:, 5] - trajectory.acceleration)[bounded], initial=0.0) < 1e-9 * largest_acceleration
    own = lift_loops.angular_velocities(trajectory.pose, trajectory.cylinder_speed)
    assert np.max(np.abs(rates[:, :5] - own)[bounded], initial=0.0) < 1e-9 * np.max(np.abs(own))
    own = lift_loops.angular_accelerations(trajectory.pose, trajectory.cylinder_speed, cylinder.acceleration)
    assert np.max(np.abs(changes[:, :5] - own)[bounded], initial=0.0) < 1e-9 * np.max(np.abs(own))


# -- extremes ------------------------------------------------------------------------------------------------


# -- forces and files ----------------------------------------------------------------------------------------

BUILDABLE = Design(130.5, 165.5, 223.5, 344.5, 560.3)
LIFTS = {"initial": (INITIAL, 220.0), "buildable": (BUILDABLE, 482.2)}
DRIVE = Pneumatics(1000.0, 20.0, 63.0, 20.0, 6.0)


@pytest.mark.parametrize("name", LIFTS)
@pytest.mark.parametrize("speed", [100.0, -60.0])
def test_virtual_work_and_newton_agree(name, speed) -> None:
    design, length = LIFTS[name]
    trajectory = motion(design, Cylinder(length, speed, 3.0), samples=501)
    found = forces(trajectory, DRIVE)
    second = oracle.equilibrium_forces(trajectory, found.weight)
    scale = np.abs(second).max()
    for k, force in enumerate((found.cylinder, found.link, found.slide)):
        assert np.abs(force - second[:, k]).max() <= 1e-9 * scale
    # the power of the cylinder is that of the platform, and ground and slide together carry the platform
    assert found.cylinder * trajectory.cylinder_speed == pytest.approx(
        found.weight * trajectory.velocity, rel=1e-12, abs=1e-9
    )
    total = found.pivot_o + found.pivot_d
    assert total[:, 1] == pytest.approx(found.weight, rel=1e-12)
    assert total[:, 0] + found.slide == pytest.approx(np.zeros(501), abs=1e-9 * scale)


def test_the_minimum_bore_needs_the_available_pressure() -> None:
    moved = motion(BUILDABLE, Cylinder(482.2, 100.0))
    found = forces(moved, DRIVE)
    assert found.pressure.max() * BAR * math.pi * 63**2 / 4 == pytest.approx(found.cylinder.max())
    exact = forces(moved, replace(DRIVE, bore=minimum_bore(found, DRIVE)))
    assert exact.pressure.max() == pytest.approx(DRIVE.pressure, rel=1e-12)


def test_files_show_the_design() -> None:
    moved = motion(BUILDABLE, Cylinder(482.2, 100.0), samples=51)
    turn = float(moved.stroke.turn_bottom)
    root = ElementTree.fromstring(design_svg(BUILDABLE, turn))
    words = [entity.text for entity in root.iter("{http://www.w3.org/2000/svg}text")]
    assert {"O", "A", "B", "C", "D", "l1", "l2", "l3", "l4", "l5"} <= set(words) and "l2 = 130.5" in words[-1]
    document = ezdxf.read(io.StringIO(design_dxf(BUILDABLE, turn)))
    assert not document.audit().errors and document.units == 4
    (triangle,) = document.modelspace().query("LWPOLYLINE[layer=='TRIANGLE']")
    a, b, c = (np.array(point[:2]) for point in triangle.get_points())
    assert triangle.closed
    assert [math.dist(a, b), math.dist(a, c), math.dist(b, c)] == pytest.approx([130.5, 165.5, 223.5], rel=1e-9)
    (cylinder,) = document.modelspace().query("LWPOLYLINE[layer=='CYLINDER']")
    assert math.dist(*(point[:2] for point in cylinder.get_points())) == pytest.approx(482.2, rel=1e-9)
    rows = list(csv.DictReader(io.StringIO(design_csv(moved, 482.2))))
    assert len(rows) == 51 and float(rows[0]["closed_length"]) == 482.2 and float(rows[7]["l4"]) == 223.5
    for row in rows:
        length = math.hypot(float(row["B_x"]), float(row["B_y"]))
        assert length == pytest.approx(float(row["cylinder_length"]), rel=1e-12)
