"""The drive of a linkage on two guides is at its best position at each sample.

A sample matched to a distant position of the drive would show here.
"""

import numpy as np
import pytest

from synthesis.linkage import Linkage
from synthesis.poses import make_poses
from synthesis.studies.rounding import nearest_travel
from tests.oracles.guided_cases import DRIVES, NAMES, good_linkage


def _used(random: np.random.Generator, drive) -> tuple[Linkage, np.ndarray]:
    """A linkage and travel over which it transmits well."""
    return good_linkage(random, drive, -0.3, 0.9, 0.3), np.linspace(0.0, 0.6, 8)


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
