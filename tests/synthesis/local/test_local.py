"""A refined linkage is never worse than its start, satisfies the limits and returns to the exact linkage nearby.

A step that is accepted although it is worse would show here.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.limits import Limits
from synthesis.linkage import Linkage, four_bar, with_links
from synthesis.local_refinement import refine_motion, refine_poses
from synthesis.poses import make_poses
from synthesis.solution import assess
from synthesis.target import make_target
from synthesis.violations import within
from synthesis.work import Work
from tests.oracles.four_bar_joints import joints_at

TRUE = {
    "crank_rocker": four_bar((19.0, 72.0, 144.0, 165.0), 1, 0.6, 3 + 4j, 0.4, (50.0, 0.7), 0.3),
    "double_crank": four_bar((60.0, 75.0, 70.0, 20.0), -1, 2.0, -30 + 4j, -1.4, (40.0, -0.7), 0.3),
    "any": four_bar((50.0, 60.0, 65.0, 100.0), 1, 0.3, 30 + 4j, 1.0, (40.0, 1.7), -0.3),
}
CRANK = np.linspace(0.0, 1.1, 9)
LIMITS = (
    Limits(),
    Limits(transmission_angle_min=np.deg2rad(20)),
    Limits(pivot_box=(-40.0, -40.0, 170.0, 120.0), link_min=15.0, link_max=180.0),
    Limits(family="any", link_ratio_max=10.0, pivot_a=3 + 4j),
)
"""All kept by the crank-rocker."""


def moved(linkage: Linkage, size: float, random: np.random.Generator) -> Linkage:
    """Return the linkage with every number changed by about a fraction of its size."""
    stretch = np.exp(size * random.standard_normal(5))
    turn, position = size * random.standard_normal(3), 50 * size * random.standard_normal(2)
    links = tuple(float(length * by) for length, by in zip(linkage.links, stretch))
    radius, angle = linkage.coupler_point_polar
    point = float(radius * stretch[4]), float(angle + turn[2])
    at = linkage.pivot_a + complex(*position)
    return replace(
        with_links(linkage, links), start=linkage.start + turn[0], ground_angle=linkage.ground_angle + turn[1],
        pivot_a=at, coupler_point_polar=point,
    )  # fmt: skip


def motion_of(linkage: Linkage, crank=CRANK) -> dict:
    joints = joints_at(linkage, crank)
    return {"rotation": joints.rotation, "position": joints.body_point}


@pytest.mark.parametrize("family", TRUE)
@pytest.mark.parametrize("sense", [1, -1])
def test_a_moved_linkage_comes_back(family: str, sense: int) -> None:
    true = TRUE[family] if sense > 0 else TRUE[family].mirrored()
    random = np.random.default_rng(3)
    request = motion_of(true, sense * CRANK)
    for size in (1e-3, 0.02):
        begin = moved(true, size, random)
        target = make_target(**request, crank_angle=sense * CRANK)
        (found,), report = refine_motion(target, Limits(family=family), begin, 1e-10, Work())
        assert np.allclose(found.linkage.links, true.links, rtol=1e-9) and found.errors.objective < 1e-12
        assert report.stopped_by == "tolerance" and report.trace[-1][1] == found.errors.objective
        for crank in (sense * CRANK, None):
            (found,), _ = refine_poses(make_poses(**request), Limits(family=family), begin, crank, 1e-10, Work())
            assert found.errors.objective < 1e-10
            assert np.allclose(found.travel, sense * CRANK, atol=1e-6)


def kept_at(target, limits: Limits, linkage: Linkage) -> list:
    """Return the linkage with its errors, if it satisfies the limits."""
    return within(target, limits, assess(target, [linkage])) if joints_at(linkage, CRANK).closed else []


def asked_and_begun(seed: int, keeps: bool) -> tuple[dict, Limits, Linkage]:
    """Return a motion that no linkage makes, limits, and a linkage, far away if it has to satisfy the limits."""
    random, limits = np.random.default_rng(seed), LIMITS[seed % len(LIMITS)]
    request = motion_of(moved(TRUE["crank_rocker"], 0.05, random))
    request["position"] = request["position"] + 3 * (random.standard_normal(9) + 1j * random.standard_normal(9))
    target = make_target(**request, crank_angle=CRANK)
    for size in (0.3, 0.1, 0.03, 0.01, 0.0):
        begin = moved(TRUE["crank_rocker"], size, random)
        begin = replace(begin, pivot_a=limits.pivot_a or begin.pivot_a)
        if not keeps or kept_at(target, limits, begin):
            break
    return request, limits, begin


@settings(max_examples=16)
@given(st.integers(0, 10**6), st.booleans())
def test_no_refinement_is_worse_than_its_beginning_and_each_keeps_the_limits(seed: int, keeps: bool) -> None:
    request, limits, begin = asked_and_begun(seed, keeps)
    target = make_target(**request, crank_angle=CRANK)
    found, report = refine_motion(target, limits, begin, 1e-10, Work())
    assert within(target, limits, found) == found
    retained = kept_at(target, limits, begin)
    assert retained or not keeps
    assert not retained or found[0].errors.objective <= retained[0].errors.objective
    assert not found or report.trace[-1][1] == found[0].errors.objective
