"""Function generators recover exact functions, satisfy limits and minimise the largest error.

A basin that is missed, or an error curve whose extremes do not alternate, would show here.
"""

import numpy as np
import pytest

import linkage_atlas as la
from linkage_atlas.task import seed_tables
from synthesis.function.generators import generate
from synthesis.function.problem import Problem
from synthesis.function.target_function import TargetFunction
from synthesis.limits import Limits
from tests.conftest import some_of
from tests.oracles.function_cases import CLASSES, function_case, recompute_rms, zeros_kept

LOGARITHM = {"name": "log10", "x": [1, 2], "output_span": 90}
SQUARE = {"name": "power", "exponent": 2, "x": [0, 1], "output_span": 90}


def wanted_of(function, first: float, last: float, crank: float, output: float, samples: int = 101) -> TargetFunction:
    """y = f(x) on its dials, radians."""
    ends = function(np.array([first, last]))
    scale, span = np.deg2rad(output) / (ends[1] - ends[0]), np.deg2rad(crank)

    def exact(t: np.ndarray) -> np.ndarray:
        return scale * (function(first + (last - first) * t / span) - ends[0])

    positions = np.linspace(0, span, samples)
    return TargetFunction(positions, exact(positions), exact=exact)


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


def test_the_least_largest_error_is_a_minimum_with_alternating_extremes() -> None:
    """No step in any direction lowers it, and with five unknowns six extremes alternate."""
    expected = wanted_of(lambda x: 1 / x, 1, 2, 90, -90)
    best = generate(seed_tables(), expected, Limits("any"), True, 1, 1e-10)[0][0]
    assert best.errors.alternations == 6
    problem = Problem(expected, Limits("any"), True)
    crank, coupler, rocker, ground = best.linkage.links
    x = np.append(np.log(np.array([crank, rocker, coupler]) / ground), [best.linkage.start, best.offset + np.pi])
    steps = np.random.default_rng(0).normal(size=(400, 5))
    steps *= 10.0 ** np.random.default_rng(1).uniform(-6, -2, (400, 1))
    positions = np.linspace(0, expected.crank[-1], 4001)[None]
    side = np.full(401, -float(best.linkage.branch))
    gap = problem.gap(np.vstack([x, x + steps]), side, np.broadcast_to(positions, (401, 4001)))
    size = np.abs(gap - 2 * np.pi * np.round(gap.mean(axis=1, keepdims=True) / (2 * np.pi))).max(axis=1)
    assert size[0] == pytest.approx(best.errors.max, rel=1e-6)
    assert np.all(size[1:] >= size[0] * (1 - 1e-7))


def test_a_mirrored_function_gives_the_mirrored_linkages() -> None:
    expected = wanted_of(np.exp, 0, 1, 90, 90, 33)
    solution = generate(seed_tables(), expected, Limits("any"), True, 2, 1e-10)[0]
    second = generate(seed_tables(), expected.mirrored(), Limits("any"), True, 2, 1e-10)[0]
    for a, b in zip(solution, second):
        assert a.linkage.links == b.linkage.links and a.linkage.branch == -b.linkage.branch
        assert a.offset == -b.offset and a.errors == b.errors


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
