"""Additional turns of a body between samples are detected, whichever whole turns its angles carry.

A turn that is not reported, or reported at a wrong sample, would show here.
"""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from synthesis.poses import make_poses, spin_faults

TURN = 2 * np.pi
ANGLES = st.lists(st.floats(-170, 170), min_size=2, max_size=8).map(lambda steps: np.deg2rad(np.cumsum(steps)))
POSITIONS = np.arange(9) * (1 + 0.3j)


def poses_of(rotation: np.ndarray, **more: object):
    return make_poses(rotation, POSITIONS[: rotation.size], **more)


@given(ANGLES, st.floats(-9, 9), st.data())
def test_a_body_that_turns_as_its_angles_say_spins_nowhere(
    angles: np.ndarray, offset: float, data: st.DataObject
) -> None:
    wraps = np.array(data.draw(st.lists(st.integers(-2, 2), min_size=angles.size, max_size=angles.size)))
    for request in (angles, np.angle(np.exp(1j * angles)), angles + TURN * wraps):
        if np.all(np.abs(np.abs(np.diff(request)) - np.pi) > 1e-6):
            expected = np.unwrap(request)
            assert np.all(np.isnan(poses_of(request).spins(expected + offset)[2]))
            assert not spin_faults(poses_of(request), expected)
    literal = poses_of(angles + TURN * wraps).spins(angles + TURN * wraps + offset)[2]
    assert np.all(np.isnan(literal))


@given(ANGLES, st.data())
def test_one_turn_more_is_told_with_its_samples(angles: np.ndarray, data: st.DataObject) -> None:
    at = data.draw(st.integers(1, angles.size - 1))
    direction = data.draw(st.sampled_from([1, -1]))
    turned = angles + direction * TURN * (np.arange(angles.size) >= at)
    (sentence,) = spin_faults(poses_of(angles), turned)
    assert f"from sample {at} to {at + 1}, not by" in sentence
    assert np.flatnonzero(~np.isnan(poses_of(angles).spins(turned)[2])).tolist() == [at - 1]
    assert not spin_faults(poses_of(angles, ordered=False), turned)


def test_a_closed_way_leads_back_to_the_first_angle() -> None:
    poses = poses_of(np.deg2rad([0.0, 30.0, 10.0]), closed=True)
    assert np.array_equal(poses.there_and_back(np.array([0.0, 1.0, 2.0])), [0.0, 1.0, 2.0, TURN])
    assert np.array_equal(poses.there_and_back(np.array([0.0, -1.0, -2.0])), [0.0, -1.0, -2.0, -TURN])
    assert spin_faults(poses, np.deg2rad([0.0, 30.0, 10.0, 0.0])) == []
    (sentence,) = spin_faults(poses, np.deg2rad([0.0, 30.0, 10.0, 360.0]))
    assert sentence == "the body turns by 350 degrees from sample 3 to 1, not by -10"
