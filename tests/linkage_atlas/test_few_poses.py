"""Two, three or four poses are passed exactly by linkages that an engineer would build, whatever the box for the pivots.

Catches first answers that are large, badly driven or not exact although random sampling finds better ones at once.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import linkage_atlas as la
from tests.conftest import some_of
from tests.oracles.few_poses import random_task, sampled_four_bars

EXACT = 1e-9


def solve(poses: list[tuple[float, float, float]], **limits: Any) -> la.Result:
    x, y, angle = np.array(poses, dtype=float).T
    return la.synthesize(angle, np.stack([x, y], axis=1), timing="free", limits={"family": "any", **limits})


def assert_exact(found: la.Result, count: int = 10) -> None:
    assert found.status == "reached" and len(found) == count
    assert max(solution.errors.objective for solution in found) < EXACT
    assert all(solution.verdict.works and solution.verdict.practical for solution in found)


def test_a_lid_that_goes_over_by_half_a_turn() -> None:
    found = solve([(15, 10, 0), (0, 15, 180)], pivot_box=(0, 0, 15, 10))
    assert_exact(found)
    assert found.best.linkage.links.max() < 8 and found.best.transmission_angle_min > 39


def test_a_shelf_that_stays_level_gets_a_parallelogram() -> None:
    found = solve([(2, 172, 0), (28.15, 166.2, 0), (42.55, 143.6, 0)], pivot_box=(0, 170, 40, 250))
    assert_exact(found)
    crank, coupler, rocker, ground = found.best.linkage.links
    assert (crank, coupler) == pytest.approx((rocker, ground), rel=1e-9)
    assert crank == pytest.approx(35.0, abs=0.05)


@pytest.mark.parametrize("poses", [2, 3])
@pytest.mark.parametrize("seed", some_of(range(4), 2))
def test_the_first_answer_is_as_compact_as_the_smallest_of_60_000_sampled(poses: int, seed: int) -> None:
    task = random_task(seed, poses)
    sampled = sampled_four_bars(task)
    comfortable = sampled.longest[sampled.transmission >= np.deg2rad(40)]
    position = zip(task.position.real, task.position.imag, np.rad2deg(task.rotation))
    found = solve(list(position), pivot_box=task.box)
    if sampled.longest.size >= 60:
        assert_exact(found)
        assert found.best.linkage.links.max() < 1.5 * np.quantile(comfortable, 0.05)


def test_four_poses_are_passed_within_limits() -> None:
    poses = [(0, 0, 0), (40, 8, 15), (75, 30, 40), (90, 60, 70)]
    box, keep_out, envelope = (-200, -200, 200, 200), [(-20, -40, 20, -10)], (-120, -120, 200, 200)
    found = solve(poses, pivot_box=box, keep_out=keep_out, envelope=envelope, coupler_radius_max=90)
    assert_exact(found, len(found))
    assert len(found) >= 3
    for solution in found:
        joints = solution.linkage.joints(np.linspace(0, solution.crank_angle[-1], 200))
        points = np.concatenate([joints.crank_pin, joints.coupler_pin, joints.body_point])
        assert points.min() >= -120.001 and points.max() <= 200.001
        assert solution.mount.coupler_point_polar.radius <= 90 * (1 + 1e-9)


def test_a_turning_crank_is_given_where_it_is_asked_for() -> None:
    found = solve([(0, 0, 0), (40, 8, 15), (75, 30, 40)], family="crank_rocker")
    assert_exact(found, len(found))
    assert {solution.family for solution in found} == {"crank_rocker"}


def test_poses_in_any_order_are_passed_too() -> None:
    x, y, angle = np.array([(75, 30, 40), (0, 0, 0), (40, 8, 15)], dtype=float).T
    found = la.synthesize(angle, np.stack([x, y], axis=1), timing="free", order="any", limits={"family": "any"})
    assert_exact(found)


@pytest.mark.parametrize(("seed", "poses"), [(0, 2), (3, 2), (7, 2), (3, 3), (5, 3), (10, 3)])
def test_the_links_of_a_lid_stay_above_a_floor(seed: int, poses: int) -> None:
    """Linkages above the floor exist, but none of them was drawn or ranked first."""
    task, width = random_task(seed, poses), 0.04
    position = np.stack([task.position.real, task.position.imag], axis=1)
    low, high = task.box[1], task.box[3]
    floor = min(position[:, 1].min() - 0.1, low + 0.3 * (high - low))
    found = la.synthesize(
        np.rad2deg(task.rotation),
        position,
        timing="free",
        limits={"pivot_box": task.box},
        assembly={"keep_out": [[-100, -100, 100, floor]], "width": width},
    )
    assert found.status == "reached" and found.best.errors.objective < EXACT
    assert not any(
        "keep_out" in name for collision in found.best.verdict.assembly.collisions for name in collision["pair"]
    )
    joints = found.best.linkage.joints(np.linspace(0, found.best.crank_angle[-1], 200))
    pins = np.concatenate([joints.crank_pin, joints.coupler_pin, joints.body_point])
    assert min(pins[:, 1].min(), found.best.mount.pivot_a[1], found.best.mount.pivot_b[1]) > floor + width / 2 - 1e-6


def test_a_floor_that_no_linkage_stays_above_is_named_in_a_note() -> None:
    poses = [(0, 0, 0), (40, 8, 15), (75, 30, 40)]
    x, y, angle = np.array(poses, dtype=float).T
    asked = {
        "limits": {"pivot_box": [-30, -30, 100, 60]},
        "assembly": {"keep_out": [[-1000, -1000, 1000, 5]], "width": 4},
    }
    found = la.synthesize(angle, np.stack([x, y], axis=1), timing="free", **asked)
    assert found.status == "reached"
    assert any("stay out of the boxes" in note for note in found.report.notes)


@pytest.mark.parametrize("box", [None, (-300, -50, -20, 300)])
def test_a_body_that_turns_nowhere_between_two_poses_hangs_on_a_parallelogram(box) -> None:
    # once on linkages that tilted it in between
    found = solve([(0, 0, 0), (60, 200, 0)], **({} if box is None else {"pivot_box": box}))
    assert_exact(found)
    for solution in found:
        crank, coupler, rocker, ground = solution.linkage.links
        assert (crank, coupler) == pytest.approx((rocker, ground), rel=1e-9)
    assert {solution.family for solution in solve([(0, 0, 0), (60, 200, 0)], family="crank_rocker")} == {
        "crank_rocker"
    }


def test_the_hinge_that_joins_two_poses_is_named_if_a_pivot_may_lie_there() -> None:
    poses = [(100, 0, 0), (0, 100, 90)]
    assert any("single hinge at (0, 0) " in note for note in solve(poses).report.notes)
    assert not any("single hinge" in note for note in solve(poses, pivot_box=(20, 20, 90, 90)).report.notes)
    level = solve([(0, 0, 0), (60, 200, 0)])
    assert not any("single hinge" in note for note in level.report.notes)


def test_limits_that_exclude_all_exact_linkages_are_named_with_values_that_allow_one() -> None:
    # once the answer was twelve degrees off without a word about the box
    poses = [(0, 0, 0), (30, 60, 60), (80, 70, 120)]
    found = solve(poses, pivot_box=(-150, -150, 0, 0))
    assert found.status == "closest"
    (note,) = [note for note in found.report.notes if "limits.pivot_box" in note]
    assert note.startswith("No exact four-bar was found with both fixed pivots in the box [-150, -150, 0, 0]; with ")
    wider = [float(number) for number in note.rpartition("[")[2].partition("]")[0].split(", ")]
    assert solve(poses, pivot_box=wider).best.errors.objective < EXACT


def test_a_linkage_that_is_continued_through_few_poses_is_exact_as_all_others() -> None:
    # once 0.005 degrees off and ranked before exact ones
    moved = [(0, 0, 0), (41, 8, 15), (75, 31, 40)]
    start = solve([(0, 0, 0), (40, 8, 15), (75, 30, 40)], pivot_box=(-30, -30, 100, 60))[3].linkage
    x, y, angle = np.array(moved, dtype=float).T
    found = la.synthesize(angle, np.stack([x, y], axis=1), timing="free", start_from=[start])
    assert found.report.start_from_ranks != [None]
    assert_exact(found)
