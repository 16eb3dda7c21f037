"""Bodies on two guides agree with published closed forms and obey the laws of poses, derivatives, mirrors and scales.

A wrong branch, rate or circuit of a slider would show here.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from synthesis.guides import Circle, Driver, Guide, Rail, Slot
from synthesis.link_motion import BodyPoses
from synthesis.linkage import Linkage, four_bar, on_guides
from synthesis.target import Interval
from tests.oracles.four_bar_joints import joints_at
from tests.oracles.guided_cases import DRIVES, NAMES, random_linkage


def off_guide(guide: Guide, poses: BodyPoses) -> np.ndarray:
    """Return the distance of each pose from its guide, by the guide's own conditions."""
    turned = np.exp(1j * poses.rotation)
    point = poses.position + turned * guide.body_point
    if isinstance(guide, Circle):
        return np.abs(point - guide.pivot) - guide.radius
    if isinstance(guide, Rail):
        return np.imag((point - guide.point) * np.exp(-1j * guide.direction))
    return np.imag((guide.pin - point) * np.conj(turned) * np.exp(-1j * guide.body_direction))


def pushed(linkage: Linkage, poses: BodyPoses) -> np.ndarray:
    """Sin mu as the module's head defines it."""
    driven, second = linkage.guides
    turned = np.exp(1j * poses.rotation)
    at, pin = (poses.position + turned * linkage.body_point for linkage in (second, driven))
    if isinstance(second, Circle):
        push = (at - second.pivot) / np.abs(at - second.pivot)
    elif isinstance(second, Rail):
        push = 1j * np.exp(1j * second.direction) + 0 * at
    else:
        push, at = 1j * turned * np.exp(1j * second.body_direction), second.pin + 0 * at
    if isinstance(driven, Slot):
        if linkage.driver is Driver.HINGE:
            return np.real(np.conj(push) * turned * np.exp(1j * driven.body_direction))
        pin = driven.pin + 0 * at
    return np.imag(np.conj(at - pin) * push) / np.abs(at - pin)


@pytest.mark.parametrize(("guide", "driver", "second"), DRIVES, ids=NAMES)
def test_poses_keep_both_guides_and_tell_branch_and_angle(guide, driver, second) -> None:
    random = np.random.default_rng(5)
    seen = 0
    for _ in range(60):
        linkage = random_linkage(random, guide, driver, second)
        assert np.isfinite(linkage.body(linkage.start).rotation).all()
        poses = linkage.body(linkage.start + random.uniform(-2, 2, 9))
        keep = np.isfinite(poses.rotation)
        seen += int(keep.sum())
        poses = BodyPoses(*(pose[keep] for pose in poses))
        size = 1 + np.abs(poses.position)
        for driven_guide in linkage.guides:
            assert np.all(np.abs(off_guide(driven_guide, poses)) < 1e-13 * size)
            turned = np.exp(1j * poses.rotation)
            contact, at = (f(poses.position, turned) for f in (driven_guide.contact, driven_guide.coordinate_of))
            assert np.all(np.abs(driven_guide.ground_at(at) - contact) < 1e-12 * size)
            assert np.all(np.abs(poses.position + turned * driven_guide.body_at(at) - contact) < 1e-12 * size)
        sine = pushed(linkage, poses)
        assert np.allclose(poses.sine, sine, atol=1e-12)
        assert np.allclose(np.sin(poses.transmission_angle), np.abs(sine), atol=1e-12)
        assert np.all(np.sign(poses.sine) == linkage.branch)
    assert seen > 150


@pytest.mark.parametrize(("guide", "driver", "second"), DRIVES, ids=NAMES)
def test_the_coordinate_of_a_pose_is_that_which_made_it(guide, driver, second) -> None:
    random = np.random.default_rng(6)
    for _ in range(40):
        linkage = random_linkage(random, guide, driver, second).moved(0.7, 2 - 3j)
        expected = linkage.start + random.uniform(-0.5, 0.5, 5)
        poses = linkage.body(expected)
        keep = np.isfinite(poses.rotation)
        found, sine = linkage.configuration(poses.rotation[keep], poses.position[keep])
        gap = found - expected[keep]
        gap = np.angle(np.exp(1j * gap)) if driver.turns else gap
        assert np.all(np.abs(gap) < 1e-12 * (1 + np.abs(poses.position[keep])))
        assert np.allclose(sine, poses.sine[keep], atol=1e-12)


@pytest.mark.parametrize(("guide", "driver", "second"), DRIVES, ids=NAMES)
def test_a_mirror_a_scale_and_a_move_carry_the_motion_over(guide, driver, second) -> None:
    random = np.random.default_rng(8)
    travel = np.linspace(-0.4, 0.4, 7)
    for _ in range(20):
        linkage = random_linkage(random, guide, driver, second)
        body = linkage.motions(travel)[1]
        size = 1 + np.nanmax(np.abs(body.origin))
        mirrored = linkage.mirrored()
        there = mirrored.motions(-travel if driver.turns else travel)[1]
        assert np.allclose(there.origin, body.origin.conj(), atol=1e-11 * size, equal_nan=True)
        assert np.allclose(np.exp(1j * there.angle), np.exp(-1j * body.angle), atol=1e-11, equal_nan=True)
        assert mirrored.mirrored() == replace(linkage, start=mirrored.mirrored().start)
        assert np.exp(1j * mirrored.mirrored().start) == pytest.approx(np.exp(1j * linkage.start))
        scaled = linkage.scaled(4.0).motions(travel if driver.turns else travel * 4.0)[1]
        assert np.allclose(scaled.origin, 4 * body.origin, atol=1e-10 * size, equal_nan=True)
        moved = linkage.moved(0.7, 2 - 3j).motions(travel)[1]
        assert np.allclose(moved.origin, body.origin * np.exp(0.7j) + 2 - 3j, atol=1e-11 * size, equal_nan=True)
        assert np.allclose(moved.rate, body.rate, rtol=1e-6, atol=1e-6, equal_nan=True)


@pytest.mark.parametrize(("guide", "driver", "second"), DRIVES, ids=NAMES)
def test_what_is_said_of_an_interval_is_what_a_fine_walk_sees(guide, driver, second) -> None:
    random = np.random.default_rng(9)
    for _ in range(40):
        linkage = random_linkage(random, guide, driver, second)
        ends = linkage.start + np.sort(random.uniform(-2.5, 2.5, 2))
        walk = linkage.body(np.linspace(*ends, 4001))
        interval = Interval(*ends)
        smallest = linkage.transmission_angle_over(interval)
        if linkage.closes_over(interval):
            assert np.isfinite(walk.rotation).all()
            assert smallest <= walk.transmission_angle.min() + 1e-12
            assert smallest > walk.transmission_angle.min() - 0.02
            assert np.abs(np.diff(walk.rotation)).max() < 1.0  # continuous
        else:
            assert math.isnan(smallest)


@pytest.mark.parametrize(
    ("radius", "rod", "offset", "turns"),
    [(1, 2, 0.3, True), (1, 2, 1.0, True), (1, 2, 1.01, False), (2, 1, 0.1, False)],
)
def test_a_slider_crank_turns_where_the_rod_reaches_beyond_crank_and_offset(radius, rod, offset, turns) -> None:
    built = on_guides((Circle(0j, radius, 0j), Rail(1j * offset, 0.0, complex(rod))), Driver.CRANK)
    assert built.turns_fully is turns


@pytest.mark.parametrize(
    ("ground", "crank", "offset", "turns"), [(2, 1, 0.9, True), (1, 2, 0.9, True), (2, 1, 1.1, False)]
)
def test_a_swinging_block_turns_where_ground_and_crank_differ_by_the_offset(ground, crank, offset, turns) -> None:
    built = on_guides((Circle(0j, crank, 0j), Slot(complex(ground), 1j * offset, 0.0)), Driver.CRANK)
    assert built.turns_fully is turns
    if turns:
        wound = np.diff(built.body(np.array([0.0, 2 * math.pi])).rotation)[0]
        assert wound == pytest.approx(0.0 if ground > crank else 2 * math.pi, abs=1e-12)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.floats(0.5, 4.0), min_size=4, max_size=4),
    st.sampled_from([1, -1]),
    st.floats(-3, 3),
    st.floats(-3, 3),
    st.floats(0.1, 2),
    st.floats(-3, 3),
)
def test_a_four_bar_moves_as_a_body_on_two_circles(lengths, branch, start, turn, radius, offset) -> None:
    linkage = four_bar(tuple(lengths), branch, start, 1 - 2j, turn, (radius, 0.7), offset)
    travel = np.linspace(0, 1, 9)
    joints = joints_at(linkage, travel)
    assume(np.isfinite(joints.rotation[0]))
    assume(np.all(np.isnan(joints.transmission_angle) | (joints.transmission_angle > 1e-3)))
    crank, body, rocker = linkage.motions(travel)
    assert (crank.name, body.name, rocker.name) == ("crank", "coupler", "rocker")
    tolerance = {"atol": 1e-10, "equal_nan": True}
    assert np.allclose(body.origin, joints.body_point, **tolerance)
    assert np.allclose(np.exp(1j * body.angle), np.exp(1j * joints.rotation), **tolerance)
    assert np.allclose(np.exp(1j * rocker.angle), np.exp(1j * joints.rocker_angle), **tolerance)
