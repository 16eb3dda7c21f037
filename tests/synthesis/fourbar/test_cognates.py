"""Roberts' cognates draw the same curve, and the answers to a path name their cognates.

A cognate with a wrong pivot or branch would show here.
"""

import numpy as np
import pytest

import linkage_atlas as la
from synthesis.cognates import cognates
from synthesis.linkage import four_bar
from tests.oracles.four_bar_joints import joints_at


@pytest.mark.parametrize("seed", range(20))
def test_a_cognate_passes_all_points_of_the_curve(seed) -> None:
    random = np.random.default_rng(seed)
    lengths = np.sort(random.uniform(20, 100, 4))
    lengths[3] = lengths[1] + lengths[2] - lengths[0] - random.uniform(0.05, 0.9) * (lengths[1] - lengths[0])
    position = complex(*random.uniform(-50, 50, 2))
    point = random.uniform(10, 80), random.uniform(-3, 3)
    assert lengths[0] + lengths[3] < lengths[1] + lengths[2], "it closes everywhere"
    linkage = four_bar(tuple(lengths.tolist()), 1, 0.3, position, random.uniform(-3, 3), point, None)
    curve = joints_at(linkage, np.linspace(0, 1.0, 9)).body_point
    for links, (first, second) in cognates(linkage):
        # the other linkage closes at every point: its two dyads reach it with a coupler triangle that keeps its shape
        assert abs(first - second) == pytest.approx(links[3])
    # driven like the first linkage: the crank of the second cognate turns by the same angles from the third pivot
    crank, coupler, rocker, _ = cognates(linkage)[1][0]
    third = cognates(linkage)[1][1][0]
    part = point[0] / lengths[1] * np.exp(1j * point[1])
    joints = joints_at(linkage, np.linspace(0, 1.0, 9))
    pin = third + (1 - part) * (joints.crank_pin - linkage.pivot_a)
    turned_curve = linkage.pivot_b + curve - joints.coupler_pin
    assert np.abs(pin - third) == pytest.approx(crank)
    assert np.abs(turned_curve - linkage.pivot_b) == pytest.approx(rocker)
    assert np.abs(turned_curve - pin) == pytest.approx(coupler)
    arm = (curve - pin) / (turned_curve - pin)
    assert np.abs(arm - arm[0]).max() < 1e-9, "the point is fixed to the coupler"


def test_the_answers_to_a_path_name_their_cognates() -> None:
    linkage = la.FourBar(
        19, 72, 64, 80, start_angle=30, pivot_a=(10, 5), ground_angle=20, coupler_point_polar=(50, 30)
    )
    points = linkage.joints(np.linspace(0, 300, 12)).body_point
    found = la.synthesize(position=points, timing="free", limits={"preset": "none"}, top=4)
    exact = [solution for solution in found.solutions if solution.errors.objective < 1e-9]
    assert len(exact) == 2
    assert any(solution.linkage.links == pytest.approx([19, 72, 64, 80], rel=1e-5) for solution in exact)
    assert exact[0].linkage.is_cognate_of(exact[1].linkage) and exact[1].linkage.is_cognate_of(exact[0].linkage)
    assert not exact[0].linkage.is_cognate_of(exact[0].linkage)
    assert any("Solutions 1 and 2 are Roberts cognates" in note for note in found.report.notes)
