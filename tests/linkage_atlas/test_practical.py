"""Practical limits hold for the whole linkage: its body point, its rails and its shortest link.

Catches a body point eight link lengths away that is called practical, rails outside of the box for the pivots,
links of a thirty-thousandth of the motion, and a motion of a single hinge that is answered without a note.
"""

from typing import Any

import numpy as np
import pytest

import linkage_atlas as la
from tests.conftest import some_of

POSITION, ROTATION = [[0, 0], [40, 8], [75, 30]], [0, 15, 40]
EXTENT = max(np.hypot(*(np.array(POSITION) - np.mean(POSITION, axis=0)).T))


def arm_of(linkage: la.FourBar) -> float:
    """Largest distance of the body point from both joints of the coupler, from the positions of the joints."""
    joints = linkage.joints([0.0])
    assert joints.body_point is not None
    return float(max(np.hypot(*(joints.body_point - pin)[0]) for pin in (joints.crank_pin, joints.coupler_pin)))


@pytest.mark.parametrize("limits", some_of([{"link_max": 60}, {}, {"link_max": 120, "family": "any"}], 2))
def test_within_the_practical_limits_the_body_point_is_no_farther_than_a_link_may_be_long(
    limits: dict[str, Any],
) -> None:
    found = la.synthesize(position=POSITION, rotation=ROTATION, timing="free", limits=limits, top=6)
    assert found.solutions
    for solution in found.solutions:
        assert solution.linkage.kind == "four_bar"
        assert arm_of(solution.linkage) <= limits.get("link_max", 10 * EXTENT) * (1 + 1e-9)
        assert solution.verdict.practical


TURNED = np.array([0.0, 30, 60, 90])
ARC = 100 * np.transpose([np.cos(np.radians(TURNED)), np.sin(np.radians(TURNED))]).round(7)


def test_links_are_no_shorter_than_a_twentieth_of_the_extent() -> None:
    """A pure rotation led to links of 0.0034 for a radius of 100."""
    found = la.synthesize(position=ARC, rotation=TURNED, timing="free")
    extent = max(np.hypot(*(ARC - ARC.mean(axis=0)).T))
    for solution in found.solutions:
        assert solution.linkage.kind == "four_bar"
        assert solution.linkage.links.min() >= 0.05 * extent * (1 - 1e-9)
    tiny = la.synthesize(position=ARC, rotation=TURNED, timing="free", limits={"preset": "none"})
    for solution in tiny.solutions:
        assert solution.linkage.kind == "four_bar"
        said = any("shortest link" in reason for reason in solution.verdict.reasons)
        assert said == (solution.linkage.links.min() < 0.05 * extent)


INSIDE = [-30, -30, 100, 60]


@pytest.mark.parametrize(
    "kinds", some_of([["two_rails"], ["rail_slot"], ["slider_crank"], ["two_slots"], ["swinging_block"]], 2)
)
@pytest.mark.parametrize("name", ["pivot_box", "pivot_a_box"])
def test_rails_and_pins_of_slots_lie_in_the_box_for_the_pivots(kinds: list[str], name: str) -> None:
    """The used ends of rails and the pins come from their own numbers."""
    request = {"position": POSITION, "rotation": ROTATION, "timing": "free", "mechanisms": kinds, "top": 4}
    found = la.synthesize(**request, limits={name: INSIDE, "family": "any"})
    assert found.solutions
    for solution in found.solutions:
        for guide in (solution.guides or ())[: 1 if name == "pivot_a_box" else 2]:
            if guide.guide == "rail":
                direction = np.array([np.cos(np.radians(guide.direction)), np.sin(np.radians(guide.direction))])
                positions = [np.array(guide.point) + end * direction for end in guide.used or ()]
            else:
                positions = [np.array(guide.pivot if guide.guide == "circle" else guide.pin)]
            for x, y in positions:
                assert INSIDE[0] - 1e-6 <= x <= INSIDE[2] + 1e-6 and INSIDE[1] - 1e-6 <= y <= INSIDE[3] + 1e-6


@pytest.mark.parametrize("seed", [3, 12])
def test_wider_limits_never_give_a_worse_usable_linkage_for_given_crank_angles(seed):
    """The smallest errors belong to linkages near a change point, behind which usable linkages were not found."""
    random = np.random.default_rng(1000 + seed)
    share = np.linspace(0, 1, 10)
    rotation = 60 * share * random.normal() + 30 * np.sin(3 * share * random.normal())
    motion = la.Motion(rotation, crank_span=float(random.uniform(40, 200)))
    practical, default = (la.synthesize(motion, limits).best for limits in ({"preset": "practical"}, None))
    assert default.errors.objective <= practical.errors.objective * (1 + 1e-9)
