"""Tolerances of manufacture: against linkages put together pin by pin, and against their own laws."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.fourbar.joints import joints_at
from synthesis.fourbar.tolerance_study import (
    SHARES,
    SOURCES,
    Tolerances,
    _derivatives,
    _Made,
    _variances,
    linear_quantiles,
    simulate,
)
from synthesis.linkage import Linkage, four_bar
from synthesis.work import Cancelled, Work

LINKAGE = four_bar((19.0, 72.0, 144.0, 165.0), 1, 0.5, 7 + 7j, 0.5, (20.0, 1.0), -1.0)
TRAVEL = np.linspace(0, 1.2, 5)
ALL = Tolerances(0.05, 0.04, 0.02)
LAW = settings(derandomize=True, deadline=None, max_examples=20)


def put_together(linkage: Linkage, travel: float, lengths, offset, pivots, play) -> complex:
    """The body point of one made linkage: every pin and hole a place in the plane, the loop closed by two circles."""
    way = np.exp(1j * linkage.ground_angle)
    on_ground_a, on_ground_b = linkage.pivot_a + pivots[0], linkage.pivot_a + linkage.links[3] * way + pivots[1]
    hole_of_crank = on_ground_a + play[0]
    tip = hole_of_crank + lengths[0] * np.exp(1j * (linkage.start + linkage.ground_angle + travel))
    coupler_start = tip + play[1]
    # the rocker's end is the coupler's end and play; its other end is pivot B and play
    centre = on_ground_b + play[3] - play[2]
    gap = centre - coupler_start
    along = (abs(gap) ** 2 + lengths[1] ** 2 - lengths[2] ** 2) / (2 * abs(gap))
    across = linkage.branch * np.sqrt(lengths[1] ** 2 - along**2)
    coupler_end = coupler_start + gap / abs(gap) * (along + 1j * across)
    direction = (coupler_end - coupler_start) / lengths[1]
    assert abs(abs(coupler_end + play[2] - on_ground_b - play[3]) - lengths[2]) < 1e-9
    radius, angle = linkage.coupler_point
    return coupler_start + (radius * np.exp(1j * angle) + offset) * direction


@pytest.mark.parametrize("branch", [1, -1])
def test_made_linkages_are_those_that_are_put_together_pin_by_pin(branch) -> None:
    linkage, count = replace(LINKAGE, branch=branch), 40
    made = _Made.of(linkage, ALL, count, np.random.default_rng(3))
    point, _ = made.positions(TRAVEL)
    random = np.random.default_rng(3)
    lengths = np.array(linkage.links[:3]) + 0.05 * random.uniform(-1, 1, (count, 3))
    offset = 0.05 * (random.uniform(-1, 1, (count, 2)) @ [1, 1j])
    pivots = [0.04 * (random.uniform(-1, 1, (count, 2)) @ [1, 1j]) for _ in range(2)]
    play = 0.01 * np.exp(1j * random.uniform(0, 2 * np.pi, (count, 4)))
    for k in range(count):
        for at, travel in enumerate(TRAVEL):
            own = [pivot[k] for pivot in pivots]
            wanted = put_together(linkage, travel, lengths[k], offset[k], own, play[k])
            assert abs(point[k, at] - wanted) < 1e-11


def test_quantiles_are_those_of_all_errors_sorted() -> None:
    count = 500
    study = simulate(LINKAGE, TRAVEL, 3, ALL, count, 7, Work())
    made = _Made.of(LINKAGE, ALL, count, np.random.default_rng(7))
    point, direction = made.positions(TRAVEL)
    joints = joints_at(LINKAGE, TRAVEL)
    errors = np.sort(np.abs(point - joints.body_point), axis=0)
    places = [int(np.ceil(share * count)) - 1 for share in SHARES]
    np.testing.assert_allclose(study.position.simulated, errors[places].T, rtol=1e-9)
    turned = np.sort(np.abs(direction - joints.coupler_angle), axis=0)
    np.testing.assert_allclose(study.rotation.simulated, turned[places].T, rtol=1e-6)
    worst = np.sort(np.abs(point - joints.body_point)[:, :3].max(axis=1))
    np.testing.assert_allclose(study.position.worst, worst[places], rtol=1e-9)
    assert study.open_share == 0.0 and study.count == count


def test_the_same_seed_gives_the_same_study_whatever_the_blocks(monkeypatch) -> None:
    one = simulate(LINKAGE, TRAVEL, 5, ALL, 300, 1, Work())
    monkeypatch.setattr("synthesis.fourbar.tolerance_study._BLOCK", 300)
    again = simulate(LINKAGE, TRAVEL, 5, ALL, 300, 1, Work())
    other = simulate(LINKAGE, TRAVEL, 5, ALL, 300, 2, Work())
    np.testing.assert_array_equal(one.position.simulated, again.position.simulated)
    assert np.abs(one.position.simulated - other.position.simulated).max() > 0


@LAW
@given(st.integers(0, 1000), st.floats(1e-6, 1e-3))
def test_small_tolerances_give_errors_in_proportion(seed, factor) -> None:
    small = Tolerances(*(factor * value for value in ALL))
    one, scaled = (simulate(LINKAGE, TRAVEL, 5, some, 200, seed, Work()) for some in (ALL, small))
    np.testing.assert_allclose(scaled.position.linear, factor * one.position.linear, rtol=1e-9)
    np.testing.assert_allclose(scaled.position.simulated, factor * one.position.simulated, rtol=0.05)
    np.testing.assert_allclose(scaled.rotation.simulated, factor * one.rotation.simulated, rtol=0.1, atol=1e-9)


@pytest.mark.parametrize("source", range(len(SOURCES)))
def test_derivatives_are_difference_quotients_of_made_linkages(source) -> None:
    rotation, position = _derivatives(LINKAGE, TRAVEL)
    joints = joints_at(LINKAGE, TRAVEL)
    for axis, unit in enumerate((1.0, 1j)):
        step = 1e-6
        lengths, offset, pivots, play = np.array(LINKAGE.links[:3]), 0j, [0j, 0j], [0j] * 4
        if source < 3:
            if axis:
                assert not rotation[source, :, 1].any() and not position[source, :, 1].any()
                continue
            lengths[source] += step
        elif source == 3:
            offset = unit * step
        elif source < 6:
            pivots[source - 4] = unit * step
        else:
            play[source - 6] = unit * step
        moved = [put_together(LINKAGE, travel, lengths, offset, pivots, play) for travel in TRAVEL]
        found = position[source, :, axis] @ [1, 1j]
        np.testing.assert_allclose(found, (np.array(moved) - joints.body_point) / step, rtol=1e-5, atol=1e-6)


def test_the_first_order_has_the_variance_of_the_simulation() -> None:
    small = Tolerances(0.005, 0.005, 0.005)
    study = simulate(LINKAGE, TRAVEL, 5, small, 40_000, 0, Work())
    # 40,000 linkages fix a quantile to about a hundredth; the sum of many sources is nearly normally distributed
    np.testing.assert_allclose(study.position.simulated, study.position.linear, rtol=0.08)
    made = _Made.of(replace(LINKAGE, pivot_a=0j), small, 40_000, np.random.default_rng(0))
    error = made.positions(TRAVEL)[0] - joints_at(LINKAGE, TRAVEL).body_point + LINKAGE.pivot_a
    variance = np.mean(np.abs(error) ** 2, axis=0)
    first = np.einsum("s,snci->n", _variances(small), _derivatives(LINKAGE, TRAVEL)[1] ** 2)
    np.testing.assert_allclose(variance, first, rtol=0.02)


def test_quantiles_of_a_normal_error_are_known_ones() -> None:
    one = np.zeros((2, 1, 2, 2))
    one[0, 0, 0] = [1.0, 0.0]
    line = linear_quantiles(one, np.array([4.0, 0.0]))[0]
    assert line == pytest.approx([2 * 0.0627068, 2 * 0.6744898, 2 * 1.9599640], rel=1e-4)
    one[1, 0, 0] = [0.0, 1.0]
    circle = linear_quantiles(one, np.array([1.0, 1.0]))[0]
    assert circle == pytest.approx(np.sqrt(-2 * np.log(1 - np.array(SHARES))), rel=1e-9)


@pytest.mark.parametrize("ratio", [0.0, 1e-6, 0.01, 0.3, 0.99])
def test_quantiles_are_where_so_many_are_nearer(ratio: float) -> None:
    one = np.zeros((2, 1, 2, 2))
    one[0, 0, 0], one[1, 0, 0] = [1.0, 0.0], [0.0, ratio]
    way = np.exp(1j * np.pi * (np.arange(128) + 0.5) / 256)
    square = 2 * (way.real**2 + (ratio * way.imag) ** 2)
    farther = [np.mean(np.exp(-(length**2) / square)) for length in linear_quantiles(one, np.ones(2))[0]]
    assert farther == pytest.approx(1 - np.array(SHARES), rel=1e-12)


def test_contributions_name_what_contributes() -> None:
    for name, tolerances in (("pivots", Tolerances(pivots=0.1)), ("clearance", Tolerances(clearance=0.1))):
        study = simulate(LINKAGE, TRAVEL, 5, tolerances, 100, 0, Work())
        wanted = {"pivots": slice(4, 6), "clearance": slice(6, 10)}[name]
        assert study.position.contributions[wanted].sum() == pytest.approx(1.0)
    none = simulate(LINKAGE, TRAVEL, 5, Tolerances(), 100, 0, Work())
    assert not none.position.contributions.any() and none.position.simulated.max() < 1e-12


def test_linkages_that_do_not_close_count_as_infinitely_far_off() -> None:
    near = four_bar((20.0, 40.0, 42.0, 61.9), 1, 0.0, 0j, 0.0, (5.0, 0.3))  # 0.1 from a change point
    travel = np.linspace(0, 2 * np.pi, 9)
    study = simulate(near, travel, 9, Tolerances(links=0.2), 2000, 0, Work())
    assert 0.05 < study.open_share < 0.5
    assert np.isinf(study.position.worst[2]) and np.isfinite(study.position.worst[0])
    assert np.isinf(study.position.simulated[4, 2]) and np.isfinite(study.position.simulated[0]).all()


def test_far_from_the_origin_nothing_is_lost() -> None:
    here = simulate(LINKAGE, TRAVEL, 5, ALL, 200, 0, Work())
    far = simulate(replace(LINKAGE, pivot_a=1e12 + 1e12j), TRAVEL, 5, ALL, 200, 0, Work())
    np.testing.assert_array_equal(here.position.simulated, far.position.simulated)


def test_nobody_waits_for_the_answer() -> None:
    with pytest.raises(Cancelled):
        simulate(LINKAGE, TRAVEL, 5, ALL, 100, 0, Work(cancelled=lambda: True))
