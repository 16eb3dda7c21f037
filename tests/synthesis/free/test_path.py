"""Paths without crank angles lead back to the linkage that made them, within any budget.

A screen that drops the right window, or a longer search that is worse, would show here.
"""

import itertools

import numpy as np
import pytest

from synthesis.four_bar import coupler_angle
from synthesis.free.search import search_free
from synthesis.limits import Limits, practical_limits
from synthesis.poses import Poses
from synthesis.solution import Solution
from synthesis.work import Work
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


def test_more_time_is_never_worse() -> None:
    # a wave: once 0.06 after 50 to 300 ms, nothing after 500 to 1,500, and 3.8 mm after 2,000
    position = 200 * np.arange(24) / 23 + 40j * np.sin(3.1 * np.arange(24) / 23)
    poses = Poses(None, position, length_scale=float(np.max(np.abs(position - position.mean()))))
    limits = Limits(**practical_limits(poses, {}))
    smallest = np.inf
    # readings of the clock represent time: the same on any machine
    for looks in (1, 10, 30, 150, 800):
        found, _ = search_free(poses, limits, 3, work=counted(looks))
        assert found
        assert found[0].errors.objective <= smallest * 1.01
        smallest = min(smallest, found[0].errors.objective)
    assert smallest < 1e-2


def counted(looks: int) -> Work:
    """Return work that expires after a number of clock readings."""
    ticks = itertools.count()
    return Work(float(looks), clock=lambda: float(next(ticks)))
