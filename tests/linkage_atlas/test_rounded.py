"""Rounded links are available lengths within the limits of the request, ranked by their own errors.

A rounded linkage that violates a limit, or whose order is that before rounding, would show here.
"""

import numpy as np
import pytest

import linkage_atlas as la
from app.registry import worked_example
from tests.conftest import some_of
from tests.oracles.limited_classes import transmission_angle
from tests.oracles.recompute import LINKS, broken_limits

EXAMPLE = worked_example()


def as_over_http(solution: la.Solution) -> dict:
    """The rounded linkage of a solution as the independent check reads it."""
    return solution.rounded.to_dict() | {"branch": solution.linkage.branch}


LIMITS = [
    {"pivot_box": [7.0, 7.0, 151, 91], "transmission_angle_min": 60, "link_max": 165.2},
    {"pivot_b": [150, 90], "keep_out": [[0, 8, 8, 14]], "envelope": [-22, 6, 151, 95]},
    {"links": {"crank": 19.3, "ground": 166.1}, "coupler_radius_max": 19.5, "pivot_a_box": [6, 5, 8, 7]},
    {"transmission_angle_min_turn": 67.4, "link_ratio_max": 8.2},
    {"link_min": 18.9, "family": "crank_rocker"},
    {"pivot_a": [7, 7], "pivot_b": [150, 90]},
    {"pivot_a": [7.5, 6.5]},
]


@pytest.mark.parametrize(
    ("grid", "limits"), some_of([(grid, limit) for grid in (2.0, 5.0) for limit in LIMITS], 2), ids=str
)
def test_rounded_links_keep_to_the_limits(grid, limits) -> None:
    found = la.synthesize(**EXAMPLE, top=1, limits=limits, round_to=grid, tolerance=1e-6)
    request = {**EXAMPLE, "limits": {"family": "full_crank", **limits}}
    reply = as_over_http(found.best)
    assert reply["closes"] and broken_limits(request, reply) == []
    assert reply["transmission_angle_min"] == pytest.approx(transmission_angle(reply, EXAMPLE), abs=1e-4)
    prescribed = set(limits.get("links", ())) | ({"ground"} if {"pivot_a", "pivot_b"} <= limits.keys() else set())
    steps = np.array([reply["links"][name] for name in LINKS if name not in prescribed]) / grid
    assert steps == pytest.approx(np.round(steps), abs=1e-9)


BOX = {"pivot_box": [-150, -150, 150, 150], "transmission_angle_min": 40}


@pytest.mark.parametrize("limits", some_of([BOX, {}], 1), ids=["some", "none"])
def test_rounded_links_have_crank_angles_of_their_own_where_these_are_free(limits):
    """With the crank angles of the solution the best linkage on this grid misses by 0.019."""
    rotation, position = [0, 30, 60, 90, 110], np.array([[0, 0], [50, 20], [90, 60], [110, 110], [115, 150]])
    for solution in la.synthesize(rotation, position, timing="free", limits=limits, top=2, round_to=5):
        rounded = solution.rounded
        assert rounded.closes and all(length % 5 == 0 for length in rounded.links)
        assert rounded.errors.objective < 0.01
        off = np.linalg.norm(rounded.linkage.joints(rounded.crank_angle).body_point - position, axis=1)
        assert off.max() == pytest.approx(rounded.errors.position_max)
        assert np.all(np.diff(rounded.crank_angle) > 0) or np.all(np.diff(rounded.crank_angle) < 0)
        if limits:
            assert rounded.transmission_angle_min >= 40 - 1e-6
            assert np.abs([rounded.mount.pivot_a, rounded.mount.pivot_b]).max() <= 150 * (1 + 1e-9)
    prescribed = la.synthesize(**EXAMPLE | {"top": 1, "round_to": 5.0})
    assert prescribed.best.rounded.crank_angle is None


GRID, STOCK = {"round_to": 10}, {"lengths_from": [20, 35, 50, 80, 120, 200]}
FIRST = [(GRID, ["four_bar"], [0]), (STOCK, ["rail_slot"], [5])]
REMAINING = [(STOCK, ["four_bar"], [0, 5]), (GRID, "all", [0, 5])]


@pytest.mark.parametrize(("rounding", "kinds", "paths"), some_of(FIRST + REMAINING, 2), ids=str)
def test_what_can_be_had_ranks_by_its_own_error(rounding, kinds, paths) -> None:
    # once the nearest before rounding came first, here 0.066, which misses by 0.072 after rounding
    random = np.random.default_rng(3)
    positions = [20 * np.cumsum(random.normal(size=(6 + k % 5, 2)), axis=0) for k in range(6)]
    for position in (positions[path] for path in paths):
        request = {"position": position, "timing": "free", "mechanisms": kinds, **rounding}
        found = la.synthesize(**request, top=6)
        errors = [solution.rounded.errors.objective if solution.rounded.closes else np.inf for solution in found]
        assert errors == sorted(errors) and [solution.rank for solution in found] == list(range(1, len(errors) + 1))
        smallest = min(solution.errors.objective for solution in found)
        assert found.status == ("reached" if smallest < 1e-10 else "closest")
        if kinds == ["four_bar"]:
            single = la.synthesize(**request, top=1)
            assert len(single) == 1 and single.best.rounded.errors.objective <= 1.1 * errors[0]


POSITIONS = [[0, 0], [20, 10], [40, 25], [60, 50], [70, 80], [70, 110]]
MOTION = la.Motion([0, 10, 25, 45, 70, 90], POSITIONS, timing="free")


def test_lengths_outside_of_the_limits_are_refused_where_a_link_is_to_be_of_them() -> None:
    """Linkages were looked for that cannot be."""
    limits = {"link_min": 18, "links": dict(zip(LINKS, (19, 72, 144, 165)))}
    found = la.synthesize(**EXAMPLE | {"top": 1, "limits": limits, "lengths_from": [10]})
    assert found.best.rounded.closes, "all lengths are given"
    with pytest.raises(la.FieldError) as error:
        la.synthesize(**EXAMPLE | {"limits": {"link_min": 18}, "lengths_from": [10]})
    assert error.value.field == "/lengths_from"


def test_why_no_lengths_do_is_said() -> None:
    """A rhombus folds flat between samples of most solutions."""
    found = la.synthesize(MOTION, la.Limits(family="any"), lengths_from=[60])
    assert {solution.rounded.closes for solution in found} == {True, False}
    for solution in found:
        assert (solution.rounded.reason is None) == solution.rounded.closes
        assert solution.rounded.closes or "closes at all crank angles of this solution" in solution.rounded.reason
