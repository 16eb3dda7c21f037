"""Excursions of the body point agree with a fine polyline.

A loop between two samples that is not noticed would show here.
"""

from itertools import pairwise

import numpy as np
import pytest

from synthesis.excursions import LEAVES_SAMPLES, excursions_of
from synthesis.linkage import four_bar
from synthesis.poses import make_poses
from synthesis.solution import assess

TRAVEL = np.deg2rad([0, 40, 80, 130, 200, 250])
LINKS = (2.0, 7.0, 6.0, 8.0)


def points(links, branch, point, angle):
    """Return positions of the body point by circles that meet."""
    l1, l2, l3, l4 = links
    pin = l1 * np.exp(1j * angle)
    distance = np.abs(l4 - pin)
    foot = (distance**2 + l2**2 - l3**2) / (2 * distance)
    coupler = (foot + 1j * branch * np.sqrt(l2**2 - foot**2)) * (l4 - pin) / distance / l2
    return pin + point * coupler


def found(point, travel=TRAVEL, links=LINKS, branch=1, start=0.3, closed=False) -> float | None:
    poses = make_poses(position=points(links, branch, point, start + travel), closed=closed)
    linkage = four_bar(links, branch, start, coupler_point_polar=(abs(point), float(np.angle(point))))
    solutions = assess(poses.timed(travel, None), [linkage])
    return excursions_of(solutions, poses)[0]


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("links", [LINKS, (7.0, 5.0, 6.0, 3.0), (4.0, 5.0, 4.5, 5.2)])
@pytest.mark.parametrize("branch", [1, -1])
def test_as_a_fine_polyline(links, branch, closed: bool) -> None:
    turns = links != (4.0, 5.0, 4.5, 5.2)
    travel, start = (TRAVEL, 0.3) if turns else (TRAVEL / 4, 0.6)
    for point in (3 + 2j, -4 + 1j, 5j):
        ends = np.append(travel, travel[0] + 2 * np.pi) if closed and turns else travel
        curve = [points(links, branch, point, start + np.linspace(*gap, 20_001)) for gap in pairwise(ends)]
        samples = points(links, branch, point, start + travel)
        extent = np.abs(samples - samples.mean()).max()
        ratios = [np.abs(np.diff(gap)).sum() / max(abs(gap[-1] - gap[0]), 0.05 * extent) for gap in curve]
        assert found(point, travel, links, branch, start, closed and turns) == pytest.approx(max(ratios), rel=1e-3)


def test_the_same_for_reversed_samples_another_size_and_the_mirror_image() -> None:
    point = 3 + 2j
    truth = pytest.approx(found(point), rel=1e-9)
    assert found(point, (TRAVEL - TRAVEL[-1])[::-1], start=0.3 + TRAVEL[-1]) == truth
    assert found(10 * point, links=(20.0, 70.0, 60.0, 80.0)) == truth
    assert found(np.conj(point), -TRAVEL, branch=-1, start=-0.3) == truth


def test_a_loop_between_two_samples_shows() -> None:
    assert found(7.0, np.deg2rad([0, 10, 20, 30]), start=0.0) < 1.1
    assert found(7.0, np.deg2rad([0, 10, 20, 340]), start=0.0) > LEAVES_SAMPLES
