"""Links that can be had, through the front door: on a grid or from a stock, within the limits of the request."""

from __future__ import annotations

import numpy as np
import pytest

import linkage_atlas as la
from app.registry import worked_example
from tests.oracles.recompute import LINKS, broken_limits

EXAMPLE = worked_example()


def as_over_http(one: la.Solution) -> dict:
    """The rounded linkage of a solution as the independent check reads it."""
    return one.rounded.to_dict() | {"branch": one.linkage.branch}


@pytest.mark.parametrize("grid", [1.0, 2.0, 5.0])
@pytest.mark.parametrize(
    "limits",
    [
        {"transmission_angle_min": 79.5},
        {"link_max": 165.2},
        {"link_min": 18.9, "family": "crank_rocker"},
        {"pivot_box": [7.0, 7.0, 151, 91]},
        {"pivot_box": [7.0, 7.0, 151, 91], "transmission_angle_min": 60, "link_max": 165.2},
    ],
    ids=str,
)
def test_rounded_links_keep_to_the_limits(grid, limits) -> None:
    found = la.synthesize(**EXAMPLE, top=2, limits=limits, round_to=grid, tolerance=1e-6)
    assert found.solutions
    request = {**EXAMPLE, "limits": {"family": "full_crank", **limits}}
    for one in found.solutions:
        if one.rounded is None:
            continue
        reply = as_over_http(one)
        assert broken_limits(request, reply) == []
        steps = np.array([reply["links"][name] for name in LINKS]) / grid
        assert steps == pytest.approx(np.round(steps), abs=1e-9)
    assert found.best.rounded is not None
