"""Paths without crank angles lead back to the linkage that made them.

A screen that drops the right window would show here.
"""

import numpy as np
import pytest

from synthesis.four_bar import coupler_angle
from synthesis.free.search import search_free
from synthesis.limits import Limits
from synthesis.poses import Poses
from synthesis.solution import Solution
from tests.oracles.four_bar_joints import joints_at

ROCKER, DOUBLE = (0.15, 0.3, 0.25, 0.3), (0.4, 0.25, 0.28, 0.07)
CASES = [(ROCKER, 8, 250), (ROCKER, 15, 300), (DOUBLE, 10, 200), (DOUBLE, 40, 320)]


def request(lengths: tuple[float, ...], samples: int, span: float) -> Poses:
    """Positions of a linkage's point at uneven crank angles."""
    random = np.random.default_rng(samples)
    gaps = np.cumsum(random.uniform(0.4, 1, samples - 1))
    crank = 0.7 + np.concatenate([[0.0], gaps / gaps[-1]]) * np.deg2rad(span)
    angle = coupler_angle(np.array([lengths]), np.ones(1), crank[None])[0]
    position = 30 - 12j + 50 * (lengths[0] * np.exp(1j * crank) + 0.2 * np.exp(1j * (angle + 0.5)))
    return Poses(None, position, length_scale=float(np.max(np.abs(position - position.mean()))))


def recomputed(poses: Poses, solution: Solution) -> float:
    """J of an answer, from its own numbers by the general kinematics; the order must hold strictly."""
    assert poses.position is not None
    steps = np.diff(solution.travel)
    assert np.all(steps > 0) or np.all(steps < 0)
    assert abs(steps.sum()) < 2 * np.pi
    off = poses.position - joints_at(solution.linkage, solution.travel).body_point
    return float(np.sqrt(np.mean(np.abs(off) ** 2))) / poses.length_scale


@pytest.mark.parametrize(("lengths", "samples", "span"), CASES)
def test_exact_paths_are_reached(lengths: tuple[float, ...], samples: int, span: float) -> None:
    poses = request(lengths, samples, span)
    found, report = search_free(poses, Limits(), 3)
    assert recomputed(poses, found[0]) < 1e-9
    seconds, best = zip(*report.trace)
    # those below the tolerance are ranked by other merits
    assert list(seconds) == sorted(seconds) and best[-1] == min(solution.errors.objective for solution in found)
