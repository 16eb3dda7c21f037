"""Function generators recover exact functions, satisfy limits and minimise the largest error.

A basin that is missed, or an error curve whose extremes do not alternate, would show here.
"""

import numpy as np
import pytest

import linkage_atlas as la
from tests.conftest import some_of
from tests.oracles.function_cases import CLASSES, function_case, recompute_rms, zeros_kept

LOGARITHM = {"name": "log10", "x": [1, 2], "output_span": 90}
SQUARE = {"name": "power", "exponent": 2, "x": [0, 1], "output_span": 90}


@pytest.mark.parametrize("kind", CLASSES)
@pytest.mark.parametrize("zeros", ["free", "input", "output", "both"])
def test_exact_functions_are_found(kind: str, zeros: str) -> None:
    seed = ([*CLASSES].index(kind) + len(zeros)) % 2
    request = function_case(kind, (5, 9)[seed], zeros, seed)
    best = la.function(**request, top=2).best.to_dict()
    assert recompute_rms(request, best) < 1e-9
    assert zeros_kept(request, best)


@pytest.mark.parametrize(
    ("function", "span", "limits", "known"),
    some_of(
        [
            (LOGARITHM, 60, {"transmission_angle_min": 30}, 0.04694),
            ({"name": "power", "exponent": 1.5, "x": [1, 4], "output_span": 90}, 90, {}, 0.004855),
            (SQUARE, 90, {}, 0.05905),
            ({"name": "sin", "x": [0, 90], "output_span": 60}, 120, {}, 0.04023),
        ],
        2,
    ),
)
def test_the_least_largest_error_is_the_best_known(function, span, limits, known) -> None:
    found = la.function(function=function, crank_span=span, objective="max", limits=limits, top=3)
    assert found.best.errors.max <= known
    assert found.report.stopped_by == "converged"
    if limits:
        assert found.best.transmission_angle_min >= 30


def test_the_extremes_of_the_least_largest_error_alternate() -> None:
    """With five unknowns six extremes of the same size alternate at a minimum (Chebyshev)."""
    function = {"name": "reciprocal", "x": [1, 2], "output_span": -90}
    found = la.function(
        function=function, crank_span=90, objective="max", limits={"preset": "none"}, top=1, curves=True
    )
    error = found.best.error_curve.error / found.best.errors.max
    signs = np.sign(error[np.abs(error) > 0.999])
    assert np.count_nonzero(np.diff(signs)) == 5


def test_a_pair_of_weight_zero_does_not_count() -> None:
    maker = la.FourBar(2, 5, 4.5, 5.5, start_angle=40)
    output = maker.joints(np.linspace(0, 100, 12)).rocker_direction
    spoilt = output.copy()
    spoilt[4] += 20
    weights = np.ones(12)
    weights[4] = 0
    found = la.function(spoilt, 100, weights=weights, top=1)
    assert found.status == "reached" and found.best.errors.max < 1e-6, "nor in the largest error"
    assert la.function(spoilt, 100, top=1, limits={"family": "crank_rocker"}).status == "closest"


def test_a_rocker_that_turns_back_is_reported_with_the_angle() -> None:
    turn, limits = np.linspace(0, 300, 9), {"preset": "none", "family": "crank_rocker"}
    best = la.function(turn / 10, input=turn, top=1, limits=limits).best
    rocker = best.linkage.joints(np.linspace(0, 300, 3001)).rocker_direction
    back = np.diff(np.unwrap(np.deg2rad(rocker))).clip(max=0).sum()
    assert f"the rocker turns back by {-np.rad2deg(back):.3g} degrees" in best.verdict.reasons[0]
