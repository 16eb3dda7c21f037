"""Rounded linkages on two guides have available lengths, and their other dimensions are optimal.

A length beside the grid, or a pose that is not refitted, would show here.
"""

import numpy as np
import pytest

from synthesis.guides import Kind
from synthesis.limits import Limits
from synthesis.linkage import Linkage
from synthesis.poses import make_poses
from synthesis.solution import Solution, assess
from synthesis.studies.rounding import nearest_travel, round_lengths
from synthesis.target import make_target
from synthesis.work import Work
from tests.oracles.guided_cases import DRIVES, NAMES, good_linkage


def _case(drive, seed: int = 91):
    linkage, travel = good_linkage(np.random.default_rng(seed), drive, -0.3, 1.3, 0.6), np.linspace(0.0, 1.0, 9)
    body = linkage.motions(travel)[1]
    return linkage, travel, body


def _solution(drive) -> tuple[object, Solution]:
    linkage, travel, body = _case(drive)
    poses = make_poses(body.angle, body.origin)
    return poses, assess(poses, [linkage], nearest_travel(poses, linkage, travel))[0]


@pytest.mark.parametrize("drive", DRIVES, ids=NAMES)
def test_rounded_lengths_lie_on_the_grid(drive) -> None:
    poses, solution = _solution(drive)
    found = round_lengths(poses, solution, Limits("any"), 0.25, None, Work(None))
    if solution.linkage.kind in (Kind.TWO_SLOTS, Kind.RAIL_SLOT):
        assert solution.linkage.lengths == {} and found.solution is not None
        return
    assert found.solution is not None and found.tried >= 1
    for length in found.solution.linkage.lengths.values():
        assert abs(length / 0.25 - round(length / 0.25)) < 1e-9
    assert found.solution.errors.objective < 0.35


def test_with_given_timing_and_stock() -> None:
    linkage, travel, body = _case(DRIVES[1])
    target = make_target(body.angle, body.origin, crank_angle=travel)
    solution = assess(target, [linkage])[0]
    stock = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0]
    found = round_lengths(target, solution, Limits("any"), None, stock, Work(None))
    assert isinstance(found.solution.linkage, Linkage) and found.exhaustive is False
    for length in found.solution.linkage.lengths.values():
        assert min(abs(length - available) for available in stock) < 1e-9
    none = round_lengths(target, solution, Limits("any", link_max=1e-3), None, stock, Work(None))
    assert none.solution is None and none.reason
