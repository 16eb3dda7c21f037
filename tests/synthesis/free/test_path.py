"""The search for paths without crank angles: seeded linkages are found again, in order, mirrored and reversed alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from synthesis.fourbar.charts import FullCrankChart
from synthesis.fourbar.dimension_types import OrderRule, TypeRule, enumerate_types
from synthesis.fourbar.grashof_chart import GrashofChart
from synthesis.fourbar.kinematics import coupler_angle
from synthesis.fourbar.mechanism import FOURBAR
from synthesis.free import path
from synthesis.free.joint import JointProblem
from synthesis.free.path import PathResult, search_path
from synthesis.free.poses import Poses
from synthesis.free.schedule import PATH
from synthesis.free.screen import COARSE, FINE, PathScreen
from synthesis.work import Work

CHART = GrashofChart()
ROCKER, DOUBLE = (0.15, 0.3, 0.25, 0.3), (0.4, 0.25, 0.28, 0.07)
CASES = [(ROCKER, 8, 250), (ROCKER, 15, 300), (DOUBLE, 10, 200), (DOUBLE, 40, 320)]


@pytest.fixture(scope="module")
def screens() -> list[PathScreen]:
    def types(perimeter: int) -> np.ndarray:
        return enumerate_types(TypeRule(perimeter, 1, OrderRule.FULL_CRANK)).astype(float)

    spread = FullCrankChart()
    return [PathScreen(FOURBAR, types(28), spread, COARSE), PathScreen(FOURBAR, types(44), spread, FINE, 1000)]


def request(lengths: tuple[float, ...], samples: int, span: float) -> Poses:
    """Positions of a linkage's point at uneven crank angles."""
    random = np.random.default_rng(samples)
    gaps = np.cumsum(random.uniform(0.4, 1, samples - 1))
    crank = 0.7 + np.concatenate([[0.0], gaps / gaps[-1]]) * np.deg2rad(span)
    angle = coupler_angle(np.array([lengths]), np.ones(1), crank[None])[0]
    position = 30 - 12j + 50 * (lengths[0] * np.exp(1j * crank) + 0.2 * np.exp(1j * (angle + 0.5)))
    return Poses(None, position, length_scale=float(np.max(np.abs(position - position.mean()))))


def recomputed(poses: Poses, found: PathResult) -> float:
    """J of the best, from its own numbers by the general kinematics; the order must hold strictly."""
    timed = found.pool.timed.take(slice(0, 1))
    steps = np.diff(timed.angles[0])
    assert np.all(steps > 0) or np.all(steps < 0)
    assert abs(steps.sum()) < 2 * np.pi
    angle = coupler_angle(CHART.shape(timed.shape).lengths, timed.branch, timed.angles)[0]
    pivot, z1, z2 = timed.pose[0]
    left = poses.scaled - pivot - z1 * np.exp(1j * timed.angles[0]) - z2 * np.exp(1j * angle)
    return float(np.sqrt(np.mean(np.abs(left) ** 2)))


@pytest.mark.parametrize(("lengths", "samples", "span"), CASES)
def test_exact_paths_are_reached(
    lengths: tuple[float, ...], samples: int, span: float, screens: list[PathScreen]
) -> None:
    poses = request(lengths, samples, span)
    found = search_path(poses, CHART, screens, 1e-10)
    assert recomputed(poses, found) < 1e-9
    seconds, best = zip(*found.trace)
    assert list(seconds) == sorted(seconds) and best[-1] == np.sqrt(found.pool.cost[0])


@pytest.mark.parametrize("change", ["mirrored", "reversed"])
def test_mirrored_and_reversed_paths_are_reached_too(change: str, screens: list[PathScreen]) -> None:
    poses = request(ROCKER, 12, 250)
    assert poses.position is not None
    position = np.conj(poses.position) if change == "mirrored" else poses.position[::-1]
    for one in (poses, replace(poses, position=position)):
        assert recomputed(one, search_path(one, CHART, screens, 1e-10)) < 1e-9


def test_same_request_same_answer(screens: list[PathScreen]) -> None:
    poses = request(DOUBLE, 12, 150)
    noisy = replace(poses, position=poses.position + 0.01 * np.random.default_rng(1).standard_normal(12))
    one, two = (
        search_path(noisy, CHART, screens, 1e-10, schedule=PATH._replace(rounds=PATH.rounds[:3])) for _ in range(2)
    )
    np.testing.assert_array_equal(one.pool.cost, two.pool.cost)
    np.testing.assert_array_equal(one.pool.timed.angles, two.pool.timed.angles)
    assert np.all(np.diff(one.pool.cost) >= 0)


def test_the_few_samples_of_the_rounds_lead_to_all_of_them(screens: list[PathScreen]) -> None:
    # once A stayed counted from the mean of the few: the polish had to find the path again, and sometimes did not
    poses = request(DOUBLE, 40, 320)
    run = path._PathSearch(poses, CHART, screens, PATH.samples, 1e-10, Work())
    run.descend(PATH.rounds[0])
    assert run.reached and run.pool is not None
    problem = JointProblem(poses, CHART)
    timed = path.nearest(problem, run._spread(run.pool.timed.take(slice(0, 1)), 1.0), 6)
    assert np.sqrt(problem.evaluate(timed, problem.turned(timed)).cost[0]) < 1e-8


@pytest.mark.parametrize("samples", [12, 40])
def test_no_time_still_gives_an_answer(samples: int, screens: list[PathScreen]) -> None:
    found = search_path(request(ROCKER, samples, 200), CHART, screens, 1e-10, Work(0.0))
    assert np.isfinite(found.pool.cost).all() and found.pool.cost.size
