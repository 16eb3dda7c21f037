"""Pitch wear and tolerances of the chain, compared with the reference and with new closures.

The tests would detect a worn chain that is analysed with the wrong slot, and corners that are not recomputed.
"""

import math

import numpy as np
import pytest

from synthesis.scenes.chain import crescent as chain
from synthesis.scenes.chain.slot import analyse_slot
from synthesis.scenes.chain.wear import tightest_pitch_error, tolerance_corners, worn_chains

PRINTED = {"wheel_radius": 92.63, "lower_radius": 381.5, "eccentricity": 90.22}


@pytest.fixture(scope="module")
def printed():
    return chain.crescent_slot(131.0, 16, 181.78, **PRINTED)


@pytest.fixture(scope="module")
def critical():
    return chain.crescent_slot(131.0, 16, 181.78)


def test_no_wear_is_the_nominal_chain(critical, printed) -> None:
    for _, slot in (critical, printed):
        facts = analyse_slot(slot, np.array([slot.start]))
        (row,) = worn_chains(slot, np.zeros(1))
        assert row.slack_max == pytest.approx(facts.slack_max.value, abs=1e-9)
        assert row.slack_min == pytest.approx(facts.slack_min, abs=1e-9)
        assert row.depth_max == pytest.approx(facts.depth_max.value, abs=1e-9)
        assert not row.stretched and abs(row.beyond_slot) < 1e-5


def test_a_worn_chain_is_the_slot_of_that_pitch_on_the_same_track(critical) -> None:
    crescent, slot = critical
    sizes = crescent.upper_radius, crescent.wheel_radius, crescent.lower_radius, crescent.eccentricity
    for row in worn_chains(slot, np.array([0.03, 0.1])):
        worn_slot = chain.crescent_slot(131.0 + row.pitch_error, 16, *sizes)[1]
        facts = analyse_slot(worn_slot, np.array([worn_slot.start]))
        assert row.slack_max == pytest.approx(facts.slack_max.value, abs=1e-9)
        assert row.depth_max == pytest.approx(facts.depth_max.value, abs=1e-9)
        # the distance beyond the slot is compared with the distance of the worn pin's path from the points of the slot
        path, slot_points = (s.path(np.linspace(s.start, s.end, 3001)) for s in (worn_slot, slot))
        under = path[np.abs(path.real) < 60]
        away = np.abs(under[::10, None] - slot_points).min(axis=1).max()
        assert row.beyond_slot == pytest.approx(away, rel=2e-2)


def test_shorter_links_stretch_the_chain(critical, printed) -> None:
    short, long = worn_chains(critical[1], np.array([-0.1, 0.1]))
    assert short.stretched and short.slack_min < -1 and short.beyond_slot is None
    assert not long.stretched and 1.5 < long.slack_min < 2.0 and long.beyond_slot > 2
    for _, slot in (critical, printed):
        error = tightest_pitch_error(slot)
        (at,) = worn_chains(slot, np.array([error]))
        assert abs(at.slack_min) < 1e-9
    assert abs(tightest_pitch_error(critical[1])) < 1e-12 and tightest_pitch_error(printed[1]) < -1e-3


def test_corners_of_the_printed_rounding_agree_with_the_reference(printed) -> None:
    """Use +-0.005 for R0, R1, R2 and b, for which the reference gives a smallest defect from -0.068 to 0.132 degrees."""
    half = dict.fromkeys(("wheel_radius", "upper_radius", "lower_radius", "eccentricity"), 0.005)
    corners = tolerance_corners(*printed, half)
    assert corners.corners == 16
    assert math.degrees(corners.slack_min / 181.78) == pytest.approx(-0.068, abs=5e-4)
    per_hundredth = {name: math.degrees(0.01 * value / 181.78) for name, value in corners.sensitivity.items()}
    expected = {"wheel_radius": -0.111, "upper_radius": -0.052, "lower_radius": 0.033, "eccentricity": -0.006}
    expected["pitch"] = 0.058
    assert per_hundredth == pytest.approx(expected, abs=0.003)
    assert corners.slack_min == pytest.approx(corners.slack_min_linear, abs=0.01)
    assert tolerance_corners(*printed, {}).corners == 1
