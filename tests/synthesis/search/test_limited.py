"""Searches within limits return linkages that satisfy every limit, and name the limits that exclude all linkages.

A limit that is checked at the samples only, or that hides the best linkage, would show here.
"""

from typing import Any

import numpy as np
import pytest

import linkage_atlas as la
from tests.conftest import some_of
from tests.oracles.classes import make_case
from tests.oracles.limited_classes import make_limited
from tests.oracles.recompute import broken_limits, recompute


@pytest.mark.parametrize("kind", ["broken", "boxed", "machine", "kept"])
@pytest.mark.parametrize("seed", range(3))
def test_what_is_found_keeps_every_limit(kind, seed) -> None:
    request = make_limited(kind, seed).request
    reply = la.synthesize(**request, top=4).to_dict()
    assert reply["solutions"]
    for solution in reply["solutions"]:
        assert broken_limits(request, solution) == []
    if kind == "kept":
        assert recompute(request, reply["solutions"][0]).objective < 1e-9


BOXED = [
    0.3407, 0.1491, 0.09562, 0.5419, 0.1466, 0.2858, 0.2101, 0.6646, 0.113, 0.3274, 0.3486, 0.2593, 0.181, 0.9055,
    0.06044, 0.5297, 0.2169, 0.1514, 0.2361, 0.3575, 0.1795, 0.4176, 0.4458, 0.3789, 0.2063, 0.2618, 0.0833, 0.2264,
    0.3471, 0.3635, 0.3143, 0.2648, 0.3243, 0.3062, 0.3748, 0.1446, 0.1303, 0.3576, 0.4906, 0.2558,
]  # fmt: skip
"""Smallest J that any search found for the first requests with boxes."""


@pytest.mark.parametrize("seeds", some_of([range(10), range(10, 40)], 1))
def test_limits_that_are_hard_to_keep_do_not_hide_the_best(seeds) -> None:
    """Candidates that move better but violate limits must not crowd out feasible candidates."""
    over = []
    for seed in seeds:
        found = la.synthesize(**make_limited("boxed", seed).request, top=1)
        over.append(found.best.errors.objective / BOXED[seed])
    assert np.mean(np.array(over) > 1.01) <= 0.1 and max(over) < 1.1


def named(middle: np.ndarray, extent: float) -> dict[str, Any]:
    """Each limit for a motion of this size at this place."""
    box = _box(middle, extent)
    return {
        "transmission_angle_min_turn": 20.0,
        "link_ratio_max": 2.5,
        "links": {"rocker": 1.3 * extent},
        "pivot_a": (middle + np.array([extent, -extent])).tolist(),
        "pivot_b": (middle - extent).tolist(),
        "pivot_a_box": box,
        "pivot_b_box": box,
        "keep_out": [_box(middle, 1.2 * extent), _box(middle + 2 * extent, 0.5 * extent)],
        "coupler_radius_max": 1.2 * extent,
        "envelope": _box(middle, 2.2 * extent),
        "preset": "practical",
    }


def _box(middle: np.ndarray, half: float) -> list[float]:
    return [*(middle - half).tolist(), *(middle + half).tolist()]


def place_of(request: dict[str, Any]) -> tuple[np.ndarray, float]:
    """Middle and extent of a request's positions."""
    position = np.array(request["position"])
    middle = position.mean(axis=0)
    return middle, float(np.linalg.norm(position - middle, axis=1).max())


def named_and_timed() -> list:
    """Each limit with crank angles given and free; the default run takes one of the two, in turn."""
    return [
        pytest.param(name, timing, marks=[pytest.mark.wide] * ((k + second) % 2))
        for k, name in enumerate(named(np.zeros(2), 1.0))
        for second, timing in enumerate(("given", "free"))
    ]


@pytest.mark.parametrize(("name", "timing"), named_and_timed())
def test_each_limit_is_kept(name, timing) -> None:
    request = dict(make_case("unreachable", len(name), 10).request)
    middle, extent = place_of(request)
    request["limits"] = {name: named(middle, extent)[name]}
    if timing == "free":
        del request["crank_span"]
        request["timing"] = "free"
    reply = la.synthesize(**request, top=2).to_dict()
    assert reply["solutions"]
    if name == "preset":
        retained = {"transmission_angle_min": 35, "transmission_angle_min_turn": 15, "link_ratio_max": 10}
        request["limits"] = retained | {"link_max": 10 * extent}
    for solution in reply["solutions"]:
        assert broken_limits(request, solution) == []


def test_what_excludes_everything_is_named() -> None:
    request = make_case("any order", 4, 12).request
    middle, extent = place_of(request)
    box = _box(middle, 0.5 * extent)
    reply = la.synthesize(**request, limits={"link_min": 4 * extent, "pivot_box": box}, top=1)
    assert reply.status == "infeasible"
    note = next(note for note in reply.report.notes if "(`limits.link_min`)" in note)
    eased = float(note.split("; with links of at least ")[1].split()[0])
    repeated = la.synthesize(**request, limits={"link_min": eased, "pivot_box": box}, top=1)
    assert repeated.solutions
    cut = la.synthesize(**request, limits={"link_min": 4 * extent, "pivot_box": box}, top=1, budget=1e-6)
    assert cut.status == "unknown" and not cut.solutions
