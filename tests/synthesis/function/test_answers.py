"""Rocker curves and the extremes of error curves agree with closed forms.

A missed extreme between two samples, or a rocker that turns back unnoticed, would show here.
"""

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from synthesis.four_bar import close_loop
from synthesis.function.answers import alternations, exchanged, extremes, finished, look, rocker_angles, turns_back
from synthesis.function.target_function import TargetFunction
from synthesis.linkage import four_bar

LENGTH = st.floats(0.05, 20.0)
CRANK_ROCKER = four_bar((1.0, 3.0, 2.5, 3.2), 1, 0.4)


@given(LENGTH, LENGTH, LENGTH, LENGTH, st.sampled_from([1, -1]), st.floats(-7, 7))
def test_a_rocker_turns_as_the_coupler_of_the_exchanged_linkage(a, b, c, d, branch, angle) -> None:
    both = close_loop(np.array([a, b, c, d]), [angle]), close_loop(np.array([a, c, b, d]), [angle])
    assume(both[0].closed.all())
    rocker, coupler = both[0].rocker_angle(branch)[0], both[1].coupler_angle(-branch)[0]
    turned = rocker - coupler - np.pi
    assert abs(turned - 2 * np.pi * round(turned / (2 * np.pi))) <= 4e-15
    linkage = exchanged(four_bar((a, b, c, d), branch, angle))
    assert linkage.links == (a, c, b, d) and linkage.branch == -branch and exchanged(linkage).links == (a, b, c, d)


def test_extremes_of_a_chebyshev_polynomial() -> None:
    expected = TargetFunction(np.linspace(0, 2, 5), np.zeros(5))

    def error(crank: np.ndarray) -> np.ndarray:
        return np.broadcast_to(0.3 * np.cos(5 * np.arccos(np.clip(crank - 1, -1, 1))), (1, crank.shape[-1]))

    found = extremes(error, look(expected), 24)
    assert alternations(found) == [6]
    size = np.sort(found.size[0])[-6:]
    np.testing.assert_allclose(size, 0.3, rtol=1e-12)
    positions = np.sort(found.crank[0][found.size[0] > 0.299])
    np.testing.assert_allclose(positions, 1 - np.cos(np.arange(6) * np.pi / 5), atol=1e-6)


def test_weights_count_in_objective_and_not_in_the_largest_error() -> None:
    crank = np.linspace(0, 1.5, 21)
    weights = np.where(crank > 1, 0.0, 4.0)
    expected = TargetFunction(crank, 0.8 * crank**2, weights)
    solution = finished(expected, [CRANK_ROCKER], True, np.array([0.25]))[0]
    inside = np.linspace(0, 1.0, 2001)
    gap = expected.curve(inside) - rocker_angles([CRANK_ROCKER], inside)[0] - solution.offset
    assert solution.errors.max >= np.abs(gap).max() * (1 - 1e-9)
    assert solution.errors.objective <= solution.errors.max


def test_a_rocker_that_turns_back_is_told() -> None:
    travel = np.linspace(0, 2 * np.pi, 9)
    expected = TargetFunction(travel, travel)
    assert "turns back" in (turns_back(expected, [CRANK_ROCKER])[0] or "")
    built = rocker_angles([CRANK_ROCKER], np.linspace(0, 0.5, 9))[0]
    assert turns_back(TargetFunction(np.linspace(0, 0.5, 9), built), [CRANK_ROCKER]) == [None]
    assert turns_back(TargetFunction(travel, np.cos(travel)), [CRANK_ROCKER]) == [None]
