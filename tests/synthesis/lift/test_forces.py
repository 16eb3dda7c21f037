"""The pneumatic side of the lift: virtual work and Newton's law, power, the ends of the stroke, least bore; and the files."""

from __future__ import annotations

import csv
import io
import math
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import ezdxf
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from synthesis.errors import FieldError
from synthesis.lift.files import design_csv, design_dxf, design_svg
from synthesis.lift.motion import BAR, Drive, forces, least_bore, motion
from synthesis.lift.pose import Cylinder, Design
from tests.oracles import lift as oracle

INITIAL = Design(300.0, 180.0, 240.0, 330.0, 480.0)
BUILDABLE = Design(130.5, 165.5, 223.5, 344.5, 560.3)
LIFTS = {"initial": (INITIAL, 220.0), "buildable": (BUILDABLE, 482.2)}
DRIVE = Drive(1000.0, 20.0, 63.0, 20.0, 6.0)


@pytest.mark.parametrize("name", LIFTS)
@pytest.mark.parametrize("speed", [100.0, -60.0])
def test_virtual_work_and_newton_agree(name, speed) -> None:
    design, length = LIFTS[name]
    moved = motion(design, Cylinder(length, speed, 3.0), samples=501)
    found = forces(moved, DRIVE)
    second = oracle.newton(moved, found.weight)
    scale = np.abs(second).max()
    for k, one in enumerate((found.cylinder, found.link, found.slide)):
        assert np.abs(one - second[:, k]).max() <= 1e-9 * scale
    # power in is power out, and the ground and the slide together carry the platform
    assert found.cylinder * moved.cylinder_speed == pytest.approx(found.weight * moved.velocity, rel=1e-12, abs=1e-9)
    total = found.pivot_o + found.pivot_d
    assert total[:, 1] == pytest.approx(found.weight, rel=1e-12)
    assert total[:, 0] + found.slide == pytest.approx(np.zeros(501), abs=1e-9 * scale)


@settings(derandomize=True, deadline=None, max_examples=40)
@given(*(st.floats(80.0, 500.0) for _ in range(5)), st.floats(0.02, 0.9))
def test_they_agree_for_any_lift(l2, l3, l4, l5, b, share) -> None:
    design = Design(l2, l3, l4, l5, b)
    try:
        whole = motion(design, Cylinder(1000.0, 100.0), [0.0])
    except FieldError as error:
        dead, top = error.details.get("dead_point_length"), error.details.get("length_top")
        assume(dead is not None or top is not None)
        try:
            limits = motion(design, Cylinder(top * 0.999 if top else dead * 1.001, 100.0), [0.0]).stroke
        except FieldError:
            assume(False)
        low, high = float(limits.length_dead), float(limits.length_top)
        length = low + share * (high - low)
        assume(high - length > 1e-3 * high)
        whole = motion(design, Cylinder(length, 100.0), samples=51)
    found = forces(whole, replace(DRIVE, mass=0.0))
    second = oracle.newton(whole, found.weight)
    assert np.abs(found.cylinder - second[:, 0]).max() <= 1e-9 * np.abs(second).max()


def test_at_the_top_the_link_carries_the_weight_and_without_mass_the_load_is_all() -> None:
    moved = motion(BUILDABLE, Cylinder(482.2, 100.0))
    found = forces(moved, replace(DRIVE, mass=0.0))
    assert np.all(found.weight == 1000.0)
    assert found.cylinder[-1] == 0 and found.pressure[-1] == 0
    assert found.link[-1] == pytest.approx(1000.0) and found.slide[-1] == pytest.approx(0.0, abs=1e-9)
    heavy = forces(moved, replace(DRIVE, load=0.0, mass=100.0))
    assert heavy.weight == pytest.approx(100 * (9.80665 + moved.acceleration / 1000), rel=1e-12)


def test_the_least_bore_needs_all_of_the_pressure() -> None:
    moved = motion(BUILDABLE, Cylinder(482.2, 100.0))
    found = forces(moved, DRIVE)
    assert found.pressure.max() * BAR * math.pi * 63**2 / 4 == pytest.approx(found.cylinder.max())
    exact = forces(moved, replace(DRIVE, bore=least_bore(found, DRIVE)))
    assert exact.pressure.max() == pytest.approx(DRIVE.pressure, rel=1e-12)


def test_files_show_the_design() -> None:
    moved = motion(BUILDABLE, Cylinder(482.2, 100.0), samples=51)
    turn = float(moved.stroke.turn_bottom)
    root = ElementTree.fromstring(design_svg(BUILDABLE, turn))
    words = [one.text for one in root.iter("{http://www.w3.org/2000/svg}text")]
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
        assert math.hypot(float(row["B_x"]), float(row["B_y"])) == pytest.approx(
            float(row["cylinder_length"]), rel=1e-12
        )
