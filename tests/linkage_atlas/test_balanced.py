"""Without a preference the first answer is accurate, can be used and would be built by an engineer.

A first answer that is huge, transmits badly or has a defect although a better linkage is known would show here.
"""

import numpy as np
import pytest

import linkage_atlas as la

ALONG = np.linspace(0, 1, 20)
STRAIGHT = {"position": [[k, k] for k in range(10)], "timing": "free"}
S_CURVE = {"position": np.column_stack([100 * ALONG, 20 * np.sin(2 * np.pi * ALONG)]), "timing": "free"}


def extent(position) -> float:
    """Largest distance of two points."""
    points = np.asarray(position) @ [1, 1j]
    return float(np.abs(points[:, None] - points).max())


def marked(result: la.Result) -> la.Solution:
    (smallest,) = [solution for solution in result if solution.has_smallest_error]
    return smallest


def test_a_straight_line_is_answered_with_small_links_within_the_everyday_accuracy() -> None:
    # once with a size of 10, four nanometres off
    found = la.synthesize(**STRAIGHT)
    assert found.best.size < 2.5 and found.best.transmission_angle_min > 40
    assert found.best.errors.position_max <= 1e-3 * extent(STRAIGHT["position"])
    smallest = marked(found)
    assert smallest.errors.objective == min(solution.errors.objective for solution in found)
    assert smallest.errors.objective < 0.01 * found.best.errors.objective
    assert not la.synthesize(**STRAIGHT, top=1).best.has_smallest_error


@pytest.mark.parametrize("start", [0, 90])
def test_a_lid_of_90_degrees_is_no_larger_than_the_linkage_that_was_drawn(start: int) -> None:
    built = la.FourBar(
        84, 51, 76, 25, start_angle=start, ground_angle=10, coupler_point_polar=(90, 30), pivot_a=(0, 0)
    )
    crank = np.linspace(0, {0: 111, 90: 132}[start], 7)
    joints = built.joints(crank)
    rotation, position = np.round(joints.rotation - joints.rotation[0], 1), np.round(joints.body_point, 1)
    found = la.synthesize(rotation, position, timing="free")
    assert max(found.best.links) < 1.2 * 84 and found.best.transmission_angle_min > 45
    assert found.best.errors.position_max <= 1e-3 * extent(position) and found.best.errors.rotation_max <= 0.1


@pytest.mark.parametrize("mechanisms", [None, "all"])
def test_a_linkage_that_cannot_be_used_is_not_first(mechanisms) -> None:
    # once two samples of this S had the same crank angle in the first and in the third linkage
    found = la.synthesize(**S_CURVE, mechanisms=mechanisms)
    usable = [solution.verdict.works for solution in found]
    assert not any(
        works and any("share one" in reason or "goes" in reason for reason in solution.verdict.reasons)
        for works, solution in zip(usable, found)
    )
    assert usable[0] and usable == sorted(usable, reverse=True)


def test_cranks_need_not_turn_fully_unless_the_path_is_closed() -> None:
    lid = {"rotation": [0, 15, 40], "position": [[0, 0], [40, 8], [75, 30]], "timing": "free"}
    swings = {"crank_rocker", "double_crank"}
    assert {solution.family for solution in la.synthesize(**lid)} - swings
    assert {
        solution.family for solution in la.synthesize(**lid, limits={"transmission_angle_min_turn": 20})
    } <= swings
    turn = np.linspace(0, 2 * np.pi, 13)  # the last sample repeats the first
    eight = la.Motion(
        position=np.column_stack([60 * np.cos(turn), 20 * np.sin(2 * turn)]), timing="free", closed=True
    )
    found, named = (la.synthesize(eight, {"preset": "none", **more}) for more in ({}, {"family": "full_crank"}))
    assert {solution.family for solution in found} <= swings
    assert [solution.errors for solution in found] == [solution.errors for solution in named]
