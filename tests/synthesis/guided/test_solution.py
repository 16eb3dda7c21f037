"""The drive of a linkage on two guides is at its best position at each sample.

A sample matched to a distant position of the drive would show here.
"""

import numpy as np
import pytest

from synthesis.defects import practical_faults
from synthesis.excursions import excursions_of
from synthesis.limits import Limits
from synthesis.linkage import Linkage
from synthesis.poses import make_poses
from synthesis.scores import size_of
from synthesis.solution import assess
from synthesis.studies.rounding import nearest_travel
from tests.oracles.guided_cases import DRIVES, NAMES, good_linkage


def _used(random: np.random.Generator, drive) -> tuple[Linkage, np.ndarray]:
    """A linkage and travel over which it transmits well."""
    return good_linkage(random, drive, -0.3, 0.9, 0.3), np.linspace(0.0, 0.6, 8)


@pytest.mark.parametrize("drive", DRIVES, ids=NAMES)
def test_an_exact_motion_is_met_from_nearby(drive) -> None:
    random = np.random.default_rng(31)
    for _ in range(10):
        linkage, travel = _used(random, drive)
        body = linkage.motions(travel)[1]
        poses = make_poses(body.angle + 0.3, body.origin)
        begin = travel + random.uniform(-0.05, 0.05, travel.size)
        found = nearest_travel(poses, linkage.turned_body(0.3), begin)
        assert np.allclose(found, travel, atol=1e-7)
        solution = assess(poses, [linkage], found)[0]
        # the offset of the rotation is found with the errors
        assert solution.errors.objective < 1e-7 * (1 + np.abs(body.origin).max())
        turned = solution.linkage.body(solution.linkage.start).rotation[0] - body.angle[0] - 0.3
        assert abs(np.exp(1j * turned) - 1) < 1e-6
        assert solution.transmission_angle_min > 0.29
        assert size_of(solution.linkage, poses, solution.interval) > 0 and excursions_of([solution], poses)[0] >= 1
        assert isinstance(practical_faults(solution, poses, Limits(), solution.interval), list)


@pytest.mark.parametrize("drive", DRIVES, ids=NAMES)
def test_the_nearest_travel_is_that_of_a_fine_search(drive) -> None:
    random, seen = np.random.default_rng(32), 0
    for _ in range(5):
        linkage, travel = _used(random, drive)
        body = linkage.motions(travel)[1]
        off = 0.02 * (random.normal(size=8) + 1j * random.normal(size=8))
        poses = make_poses(body.angle + 0.02 * random.normal(size=8), body.origin + off)
        found = nearest_travel(poses, linkage, travel)
        walk = np.linspace(-0.25, 0.85, 22001)
        there = linkage.body(linkage.start + walk)
        for k in range(8):
            square = (there.rotation - poses.rotation[k]) ** 2
            square = square + np.abs(there.position - poses.position[k]) ** 2 / poses.length_scale**2
            best = walk[np.argmin(square)]
            if -0.2 < best < 0.8:
                seen += 1
                assert found[k] == pytest.approx(best, abs=1e-4)
    assert seen == 40
