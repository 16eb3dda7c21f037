"""URDF and SDF files are trees whose frames lie at the joints and whose masses are those of the parts.

A joint in a wrong frame, or a loop that is left open, would show here.
"""

from xml.etree import ElementTree

import numpy as np
import pytest

from synthesis.solids.robots import to_sdf, to_urdf
from tests.oracles.four_bar_joints import joints_at
from tests.oracles.solids import TABLE, built, linkage_of


def numbers(text: str) -> np.ndarray:
    return np.array(list(map(float, text.split())))


@pytest.fixture(scope="module", params=["E1", "E2", "E3", "E4"])
def named(request):
    return request.param, built(request.param, "both", True)


def frames_of(root: ElementTree.Element) -> dict[str, tuple[complex, complex]]:
    """Return the frames of a URDF with all joints at zero: position, and direction of x."""
    found = {"ground": (0j, 1 + 0j)}
    joints = list(root.iter("joint"))
    while len(found) <= len(joints):
        for joint in joints:
            parent, child = joint.find("parent").get("link"), joint.find("child").get("link")
            if parent in found and child not in found:
                origin = joint.find("origin")
                at, turn = numbers(origin.get("xyz")), numbers(origin.get("rpy", "0 0 0"))
                assert at[2] == turn[0] == turn[1] == 0
                position, direction = found[parent]
                found[child] = position + direction * complex(at[0], at[1]), direction * np.exp(1j * turn[2])
    return found


def test_urdf_is_a_tree_whose_frames_stand_where_the_joints_are(named) -> None:
    name, solids = named
    root = ElementTree.fromstring(to_urdf(solids, "linkage", solids.machine.used))
    assert root.tag == "robot" and not root.findall(".//mimic")
    frames, joints = frames_of(root), joints_at(linkage_of(TABLE[name]), np.zeros(1))
    ground = joints.pivot_a
    for link, position in (("crank", ground), ("coupler", joints.crank_pin[0]), ("rocker", joints.pivot_b)):
        assert frames[link][0] == pytest.approx((position - ground) / 1000, abs=1e-9)
    # both halves of the cut meet
    for frame in ("closing_C_1", "closing_C_2"):
        assert frames[frame][0] == pytest.approx((joints.coupler_pin[0] - ground) / 1000, abs=1e-9)
    crank = next(joint for joint in root.iter("joint") if joint.get("name") == "A")
    assert crank.get("type") == "revolute"
    limits = [float(crank.find("limit").get(end)) for end in ("lower", "upper")]
    assert limits == pytest.approx(list(solids.machine.used), abs=1e-9)
    turning = ElementTree.fromstring(to_urdf(solids, "linkage"))
    assert {joint.get("type") for joint in turning.iter("joint")} == {"continuous", "fixed"}


def check_masses(solids, found: dict[str, tuple[float, np.ndarray, np.ndarray]]) -> None:
    for name, mass in solids.masses().items():
        weight, centre, inertia = found[name]
        assert weight == pytest.approx(mass.mass, rel=1e-9)
        assert centre == pytest.approx(mass.centre / 1000, abs=1e-11)
        size = mass.inertia.max() / 1e6
        assert inertia == pytest.approx(mass.inertia[np.triu_indices(3)] / 1e6, abs=1e-9 * size)
        values = np.linalg.eigvalsh(mass.inertia)
        assert values[0] > 0 and values[0] + values[1] > values[2]


INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def test_urdf_has_the_masses_of_the_parts(named) -> None:
    root = ElementTree.fromstring(to_urdf(named[1], "linkage"))
    found = {}
    for link in root.iter("link"):
        if (inertial := link.find("inertial")) is not None:
            mass, origin = inertial.find("mass").get("value"), inertial.find("origin").get("xyz")
            inertia = np.array([float(inertial.find("inertia").get(key)) for key in INERTIA])
            found[link.get("name")] = float(mass), numbers(origin), inertia
    check_masses(named[1], found)


def test_sdf_closes_the_loop_by_a_fourth_joint(named) -> None:
    name, solids = named
    root = ElementTree.fromstring(to_sdf(solids, "linkage"))
    model, joints = root.find("model"), joints_at(linkage_of(TABLE[name]), np.zeros(1))
    poses, found = {}, {}
    for link in model.findall("link"):
        pose, inertial = numbers(link.find("pose").text), link.find("inertial")
        poses[link.get("name")] = complex(pose[0], pose[1]), np.exp(1j * pose[5])
        inertia = np.array([float(inertial.find("inertia").find(key).text) for key in INERTIA])
        origin = numbers(inertial.find("pose").text)[:3]
        found[link.get("name")] = float(inertial.find("mass").text), origin, inertia
    check_masses(solids, found)
    expected = {"A": joints.pivot_a, "B": joints.pivot_b, "D": joints.crank_pin[0], "C": joints.coupler_pin[0]}
    turning = [joint for joint in model.findall("joint") if joint.get("type") == "revolute"]
    assert {joint.get("name") for joint in turning} == set(expected)
    children = [joint.find("child").text for joint in turning]
    assert children.count("rocker") == 2
    for joint in turning:
        at = numbers(joint.find("pose").text)
        position, direction = poses[joint.find("pose").get("relative_to")]
        assert position + direction * complex(at[0], at[1]) == pytest.approx(
            expected[joint.get("name")] / 1000, abs=1e-9
        )
        assert joint.find("axis/xyz").text == "0 0 1"
    assert len(model.findall(".//polyline")) == len(solids.parts)
