"""Rocker curves, extremes of error curves, and errors that are recomputed."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from synthesis.four_bar import close_loop
from synthesis.fourbar.mechanism import ROCKER
from synthesis.function.answers import alternations, exchanged, extremes, finished, look, rocker_angles, turns_back
from synthesis.function.wanted import Wanted
from synthesis.linkage import four_bar
from tests.oracles.function_cases import rocker_angles as naive_angles

LENGTH = st.floats(0.05, 20.0)
CRANK_ROCKER = four_bar((1.0, 3.0, 2.5, 3.2), 1, 0.4)


@given(LENGTH, LENGTH, LENGTH, LENGTH, st.sampled_from([1, -1]), st.floats(-7, 7))
def test_a_rocker_turns_as_the_coupler_of_the_exchanged_linkage(a, b, c, d, branch, angle) -> None:
    both = close_loop(np.array([a, b, c, d]), [angle]), close_loop(np.array([a, c, b, d]), [angle])
    assume(both[0].closed.all())
    rocker, coupler = both[0].rocker_angle(branch)[0], both[1].coupler_angle(-branch)[0]
    turned = rocker - coupler - np.pi
    assert abs(turned - 2 * np.pi * round(turned / (2 * np.pi))) <= 4e-15
    one = exchanged(four_bar((a, b, c, d), branch, angle))
    assert one.links == (a, c, b, d) and one.branch == -branch and exchanged(one).links == (a, b, c, d)


def test_rocker_angles_against_fifty_digits() -> None:
    travel = np.linspace(0, 2 * np.pi, 13)
    naive = naive_angles(CRANK_ROCKER.links, 1, 0.4 + travel)
    found = rocker_angles([CRANK_ROCKER], travel)[0]
    np.testing.assert_allclose(found - found[0], [float(a - naive[0]) for a in naive], atol=4e-15)
    turned = ROCKER.body_angle(np.array([CRANK_ROCKER.links]), np.array([1.0]), 0.4 + travel)[0]
    np.testing.assert_allclose(turned - turned[0], found - found[0], atol=4e-15)


def test_extremes_of_a_chebyshev_polynomial() -> None:
    wanted = Wanted(np.linspace(0, 2, 5), np.zeros(5))

    def error(crank: np.ndarray) -> np.ndarray:
        return np.broadcast_to(0.3 * np.cos(5 * np.arccos(np.clip(crank - 1, -1, 1))), (1, crank.shape[-1]))

    found = extremes(error, look(wanted), 24)
    assert alternations(found) == [6]
    size = np.sort(found.size[0])[-6:]
    np.testing.assert_allclose(size, 0.3, rtol=1e-12)
    places = np.sort(found.crank[0][found.size[0] > 0.299])
    np.testing.assert_allclose(places, 1 - np.cos(np.arange(6) * np.pi / 5), atol=1e-6)


def test_an_error_next_to_an_infinite_slope_is_seen() -> None:
    wanted = Wanted(np.linspace(0, 1, 5), np.zeros(5))
    found = extremes(lambda crank: np.exp(-(((crank - 3e-7) / 1e-7) ** 2)) * np.ones((1, 1)), look(wanted), 24)
    assert found.size.max() > 0.99


def test_errors_are_those_of_dense_places() -> None:
    crank = np.linspace(0, 1.5, 21)
    dense = np.linspace(0, 1.5, 40_001)
    wanted = Wanted(crank, 0.8 * crank**2, exact=lambda t: 0.8 * t**2)
    one = finished(wanted, [CRANK_ROCKER], True, np.array([0.25]))[0]
    gap = 0.8 * dense**2 - rocker_angles([CRANK_ROCKER], dense)[0]
    gap = gap - 0.25 - 2 * np.pi * np.round((gap - 0.25).mean() / (2 * np.pi))
    assert one.errors.max == pytest.approx(np.abs(gap).max(), rel=1e-8)
    plain = finished(wanted, [CRANK_ROCKER], False)[0]
    residual = 0.8 * crank**2 - rocker_angles([CRANK_ROCKER], crank)[0]
    assert plain.errors.rms == pytest.approx(np.std(residual), rel=1e-12)
    assert plain.offset == pytest.approx(residual.mean(), rel=1e-12)
    assert plain.errors.alternations is None


def test_weights_count_in_objective_and_not_in_the_largest_error() -> None:
    crank = np.linspace(0, 1.5, 21)
    weights = np.where(crank > 1, 0.0, 4.0)
    wanted = Wanted(crank, 0.8 * crank**2, weights)
    one = finished(wanted, [CRANK_ROCKER], True, np.array([0.25]))[0]
    inside = np.linspace(0, 1.0, 2001)
    gap = wanted.curve(inside) - rocker_angles([CRANK_ROCKER], inside)[0] - one.offset
    assert one.errors.max >= np.abs(gap).max() * (1 - 1e-9)
    assert one.errors.objective <= one.errors.max


def test_a_rocker_that_turns_back_is_told() -> None:
    travel = np.linspace(0, 2 * np.pi, 9)
    wanted = Wanted(travel, travel)
    assert "turns back" in (turns_back(wanted, [CRANK_ROCKER])[0] or "")
    made = rocker_angles([CRANK_ROCKER], np.linspace(0, 0.5, 9))[0]
    assert turns_back(Wanted(np.linspace(0, 0.5, 9), made), [CRANK_ROCKER]) == [None]
    assert turns_back(Wanted(travel, np.cos(travel)), [CRANK_ROCKER]) == [None]
