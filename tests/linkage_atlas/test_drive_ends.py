"""Actuators whose ends are given, boxes of their pins, forces on any link, and equal drives side by side.

Bugs that these tests would catch: forces that miss a load on the rocker, a pin outside of its box, and a
force that is shared twice.
"""

from typing import Any

import numpy as np
import pytest

import linkage_atlas as la

CASEMENT = la.FourBar(240, 101.3, 83.8, 155.1, start_angle=18, coupler_point_polar=(162, 115.7))
DIRECTION = [0, -33.7]
LOADS = {
    "body": {"force": [0, 100]},
    "rocker": {"forces": [{"link": "rocker", "point": [83.8, 0], "force": [0, 100]}]},
    "crank": {
        "forces": [{"link": "crank", "point": [120, 30], "force": [40, 80]}, {"link": "body", "force": [0, 9]}]
    },
}


def drives(wish: dict[str, Any], load: dict[str, Any], **more: Any) -> la.Drives:
    return la.drives(CASEMENT, [{"kind": "actuator", **wish}], crank_angle=DIRECTION, load=load, **more)


@pytest.mark.parametrize("load", LOADS.values(), ids=LOADS)
@pytest.mark.parametrize("link, on", [("crank", "ground"), ("coupler", "ground"), ("rocker", "crank")])
def test_an_actuator_that_was_found_is_evaluated_alike_when_its_ends_are_given(load: Any, link: str, on: str) -> None:
    """The work over the motion is minus the work of the load, computed from positions only."""
    found = drives({"links": [link], "base_link": on, "retracted": 200, "stroke": 50, "reach_max": 300}, load).best(
        "actuator"
    )
    assert found is not None
    prescribed = {"links": [link], "base_link": on, "ground_point": found.ground_point}
    for pin in ({"pin": found.pin}, {"pin_on_link": found.pin_on_link}):
        (repeated,) = drives(prescribed | pin, load).drives
        for name in ("peak_force", "arm_min", "length", "holding", "peak_force_ratio", "stroke", "retracted"):
            assert getattr(repeated, name) == pytest.approx(getattr(found, name), rel=1e-9), name
    length, force = found.curve.length, found.curve.force
    work = np.sum((force[1:] + force[:-1]) / 2 * np.diff(length))
    joints = CASEMENT.joints(np.linspace(0, -33.7, 61))
    moved = 0.0
    if "force" in load:
        moved += (joints.body_point @ np.array(load["force"]))[[0, -1]] @ [-1, 1]
    frames = {
        "crank": (joints.pivot_a, joints.crank_pin),
        "rocker": (joints.pivot_b, joints.coupler_pin),
        "body": (joints.body_point, joints.body_point + np.array([1, 0])),
    }
    for element in load.get("forces", ()):
        start, end = (np.broadcast_to(part, (61, 2)) for part in frames[element["link"]])
        along = (end - start) / np.linalg.norm(end - start, axis=1)[:, None]
        x, y = element.get("point", (0, 0))
        position = start + x * along + y * np.stack([-along[:, 1], along[:, 0]], axis=1)
        moved += (position @ np.array(element["force"]))[[0, -1]] @ [-1, 1]
    assert work == pytest.approx(-moved, rel=2e-3)


@pytest.mark.parametrize("link", ["crank", "coupler"])
def test_a_motor_that_was_found_is_evaluated_alike_when_its_ends_are_given(link: str) -> None:
    found = la.drives(
        CASEMENT, [{"kind": "dyad", "links": [link]}], crank_angle=DIRECTION, load=LOADS["rocker"]
    ).best("dyad")
    assert found is not None
    for pin in ({"pin": found.pin}, {"pin_on_link": found.pin_on_link}):
        prescribed = {"kind": "dyad", "links": [link], "motor": found.motor, **pin}
        repeated = la.drives(CASEMENT, [prescribed], crank_angle=DIRECTION, load=LOADS["rocker"]).best("dyad")
        assert repeated is not None
        for name in ("crank", "coupler", "time_ratio", "transmission_angle_min", "motor_torque_max"):
            assert getattr(repeated.six_bar, name) == pytest.approx(getattr(found.six_bar, name), rel=1e-6), name
    away = {"kind": "dyad", "links": ["crank"], "motor": [0, 10], "pin_on_link": [0, 3]}
    assert "dead point" in la.drives(CASEMENT, [away], crank_angle=DIRECTION).refused[0].reason


def test_a_pin_stays_in_its_box_and_a_wider_box_is_no_worse() -> None:
    wish = {
        "links": ["coupler"],
        "retracted": 255,
        "stroke": 150,
        "ground_box": [-100, -250, 400, 150],
        "reach_max": 250,
    }
    free = drives(wish, LOADS["body"]).best("actuator")
    assert free is not None
    x, y = free.pin_on_link
    forces = []
    for half in (3, 30):
        box = [x + 10 - half, y + 10 - half, x + 10 + half, y + 10 + half]
        drive = drives(wish | {"pin_box": box}, LOADS["body"]).best("actuator")
        assert drive is not None and drive.peak_force is not None
        assert (
            box[0] - 1e-4 <= drive.pin_on_link[0] <= box[2] + 1e-4
            and box[1] - 1e-4 <= drive.pin_on_link[1] <= box[3] + 1e-4
        )
        forces.append(drive.peak_force)
    assert forces[0] >= forces[1] * (1 - 1e-6) and forces[1] == pytest.approx(free.peak_force, rel=1e-5)
    rocker = {"links": ["rocker"], "stroke": 60, "retracted": 100, "pin_box": [30, -60, 60, -30]}
    found = drives(rocker, LOADS["body"])
    for drive in found.drives:
        assert 30 - 1e-4 <= drive.pin_on_link[0] <= 60 + 1e-4 and -60 - 1e-4 <= drive.pin_on_link[1] <= -30 + 1e-4
    assert found.drives or "pin_box" in found.refused[0].reason


def test_equal_actuators_share_the_force() -> None:
    wish = {
        "links": ["coupler"],
        "retracted": 255,
        "stroke": 150,
        "ground_box": [-100, -250, 400, 150],
        "reach_max": 250,
    }
    single, double = (drives(wish | {"count": count}, LOADS["body"]).drives[0] for count in (1, 2))
    assert double.count == 2 and double.ground_point == single.ground_point
    for name in ("peak_force", "peak_force_bound", "holding"):
        assert np.multiply(getattr(double, name), 2) == pytest.approx(getattr(single, name), rel=1e-9)
    assert double.pin_forces == pytest.approx(single.pin_forces, rel=1e-9)
    row = {"name": "weak", "retracted": 255, "stroke": 150, "force": 0.6 * single.peak_force}
    bought = {key: wish[key] for key in ("links", "ground_box", "reach_max")} | {"catalogue": [row]}
    assert not drives(bought, LOADS["body"]).drives
    assert drives(bought | {"count": 2}, LOADS["body"]).drives[0].name == "weak"
