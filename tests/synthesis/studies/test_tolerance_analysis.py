"""Tolerance analysis agrees with linkages put together pin by pin, with closed forms and with its own laws.

These tests would catch a wrong sign of a play, a wrong derivative, and a linkage that opens but counts as closed.
"""

from dataclasses import replace

import numpy as np
import pytest

from synthesis.guides import Circle, Driver, Rail
from synthesis.linkage import Linkage, four_bar, on_guides
from synthesis.studies.sensitivity import Deviation, derivatives, dimensions_of
from synthesis.studies.tolerance_analysis import SHARES, Tolerances, linear_quantiles, manufactured, simulate
from synthesis.work import Cancelled, Work
from tests.oracles.guided_cases import DRIVES, NAMES, good_linkage

FOUR_BAR = four_bar((19.0, 72.0, 144.0, 165.0), 1, 0.5, 7 + 7j, 0.5, (20.0, 1.0), -1.0)
TRAVEL = np.linspace(0, 1.2, 5)
ALL = Tolerances(0.05, 0.04, 0.02)
LINKAGES = {
    name: good_linkage(np.random.default_rng(83), drive, -0.3, 0.7, 0.41) for name, drive in zip(NAMES, DRIVES)
} | {"four-bar": FOUR_BAR}
ANY = pytest.mark.parametrize("linkage", LINKAGES.values(), ids=LINKAGES)


def study_of(linkage: Linkage, tolerances: Tolerances = ALL, count: int = 200, seed: int = 0, travel=TRAVEL):
    return simulate(linkage, travel, travel.size, tolerances, count, seed, Work())


def put_together(linkage: Linkage, travel: float, lengths, offset, pivots, play) -> tuple[complex, float]:
    """Return the pose of a four-bar whose pins and holes are points of the plane, closed by two circles."""
    direction = np.exp(1j * linkage.ground_angle)
    on_ground_a, on_ground_b = linkage.pivot_a + pivots[0], linkage.pivot_a + linkage.links[3] * direction + pivots[1]
    hole_of_crank = on_ground_a + play[0]
    tip = hole_of_crank + lengths[0] * np.exp(1j * (linkage.start + linkage.ground_angle + travel))
    coupler_start = tip + play[1]
    # the rocker's end is the coupler's end and play; its other end is pivot B and play
    centre = on_ground_b + play[3] - play[2]
    gap = centre - coupler_start
    along = (abs(gap) ** 2 + lengths[1] ** 2 - lengths[2] ** 2) / (2 * abs(gap))
    across = linkage.branch * np.sqrt(lengths[1] ** 2 - along**2)
    coupler_end = coupler_start + gap / abs(gap) * (along + 1j * across)
    coupler = (coupler_end - coupler_start) / lengths[1]
    assert abs(abs(coupler_end + play[2] - on_ground_b - play[3]) - lengths[2]) < 1e-9
    return coupler_start + (linkage.arm + offset) * coupler, np.angle(coupler) + linkage.body_offset


@pytest.mark.parametrize("branch", [1, -1])
def test_four_bars_are_those_that_are_put_together_pin_by_pin(branch, monkeypatch) -> None:
    linkage, count = replace(FOUR_BAR, branch=branch), 200
    random = np.random.default_rng(7)
    lengths = np.array(linkage.links[:3]) + 0.05 * random.uniform(-1, 1, (count, 3))
    offset = 0.05 * (random.uniform(-1, 1, (count, 2)) @ [1, 1j])
    pivots = np.array([0.04 * (random.uniform(-1, 1, (count, 2)) @ [1, 1j]) for _ in range(2)])
    play = 0.01 * np.exp(1j * random.uniform(0, 2 * np.pi, (count, 4)))
    exact = linkage.body(linkage.start + TRAVEL)
    distance, turned = np.empty((count, TRAVEL.size)), np.empty((count, TRAVEL.size))
    for k in range(count):
        for at, travel in enumerate(TRAVEL):
            point, angle = put_together(linkage, travel, lengths[k], offset[k], pivots[:, k], play[k])
            distance[k, at] = abs(point - exact.position[at])
            turned[k, at] = abs(np.angle(np.exp(1j * (angle - exact.rotation[at]))))
    ranks = [int(np.ceil(share * count)) - 1 for share in SHARES]
    study = simulate(linkage, TRAVEL, 3, ALL, count, 7, Work())
    np.testing.assert_allclose(study.position.simulated, np.sort(distance, axis=0)[ranks].T, rtol=1e-9)
    np.testing.assert_allclose(study.rotation.simulated, np.sort(turned, axis=0)[ranks].T, rtol=1e-6)
    np.testing.assert_allclose(study.position.worst, np.sort(distance[:, :3].max(axis=1))[ranks], rtol=1e-9)
    assert study.open_share == 0.0 and study.count == count
    monkeypatch.setattr("synthesis.studies.tolerance_analysis._BLOCK", count)
    repeated = simulate(linkage, TRAVEL, 3, ALL, count, 7, Work())
    np.testing.assert_array_equal(repeated.position.simulated, study.position.simulated)
    assert np.abs(study_of(linkage, seed=8).position.simulated - study.position.simulated).max() > 0


def changed(linkage: Linkage, changes: tuple[Deviation, Deviation]) -> Linkage:
    """Return the linkage with changed guides."""
    guides = []
    for guide, off in zip(linkage.guides, changes):
        fixed, point = complex(guide[0] + off.fixed), complex(guide.body_point + off.body_point)
        if isinstance(guide, Circle):
            guides.append(Circle(fixed, float(guide.radius + off.radius), point))
        elif isinstance(guide, Rail):
            guides.append(Rail(fixed, float(guide.direction + off.direction), point))
        else:
            guides.append(
                guide._replace(pin=fixed, body_point=point, body_direction=guide.body_direction + off.direction)
            )
    start = linkage.start + (linkage.ground_angle if linkage.driver.turns else 0.0)
    return on_guides((guides[0], guides[1]), linkage.driver, linkage.branch, start)


@ANY
def test_manufactured_linkages_have_the_poses_of_the_closed_form(linkage) -> None:
    random, travel = np.random.default_rng(81), np.linspace(0.0, 0.4, 5)
    for _ in range(10):
        points = random.normal(size=(2, 4)) @ [[1, 0], [1j, 0], [0, 1], [0, 1j]]
        first, two = (
            Deviation(*(0.02 * value for value in (r, *p, d)))
            for r, p, d in zip(random.normal(size=2), points, random.normal(size=2))
        )
        position, rotation = manufactured(linkage, linkage.start + travel, first, two)
        second = changed(linkage, (first, two))
        exact = second.body(second.start + travel)
        np.testing.assert_allclose(position, exact.position, atol=1e-9)
        np.testing.assert_allclose(np.exp(1j * rotation), np.exp(1j * exact.rotation), atol=1e-9)


@ANY
def test_derivatives_are_difference_quotients(linkage) -> None:
    travel, step = np.linspace(0.0, 0.4, 5), 1e-5
    for name, unit in dimensions_of(linkage):
        ends = []
        for signed in (step, -step):
            second = changed(linkage, tuple(Deviation(*(signed * value for value in change)) for change in unit))
            ends.append(second.body(second.start + travel))
        position, rotation = derivatives(linkage, linkage.start + travel, [unit])
        size = 1 + np.abs(position[0]).max() ** 3
        quotient = (ends[0].position - ends[1].position) / (2 * step)
        np.testing.assert_allclose(quotient, position[0], atol=1e-8 * size, err_msg=name)
        quotient = (ends[0].rotation - ends[1].rotation) / (2 * step)
        np.testing.assert_allclose(quotient, rotation[0], atol=1e-8 * size, err_msg=name)


@ANY
def test_a_study_is_linear_in_small_tolerances_and_agrees_with_the_first_order(linkage) -> None:
    travel, sizes = np.linspace(0.0, 0.4, 5), Tolerances(1e-5, 2e-5, 1.5e-5)
    once = study_of(linkage, sizes, 8000, travel=travel)
    twice = study_of(linkage, Tolerances(*(2 * size for size in sizes)), 8000, travel=travel)
    assert once.open_share == 0
    for small, large in ((once.rotation, twice.rotation), (once.position, twice.position)):
        np.testing.assert_allclose(large.simulated, 2 * small.simulated, rtol=5e-3, atol=1e-12)
        np.testing.assert_allclose(large.linear, 2 * small.linear, rtol=1e-9, atol=1e-15)
        # 8,000 linkages fix a quantile to about two hundredths; the sum of many sources is nearly normally distributed
        np.testing.assert_allclose(small.simulated[:, 1:], small.linear[:, 1:], rtol=0.12, atol=1e-9)
        total = small.contributions.sum()
        assert total == pytest.approx(1.0) or (linkage.driver is Driver.HINGE and total == 0)
        assert len(small.contributions) == len(once.sources)


@pytest.mark.parametrize("ratio", [0.0, 1e-6, 0.01, 0.3, 0.99, 1.0])
def test_quantiles_have_the_probability_of_a_normal_error(ratio: float) -> None:
    slopes = np.zeros((2, 1, 2, 2))
    slopes[0, 0, 0], slopes[1, 0, 0] = [1.0, 0.0], [0.0, ratio]
    found = linear_quantiles(slopes, np.ones(2))[0]
    direction = np.exp(1j * np.pi * (np.arange(128) + 0.5) / 256)
    square = 2 * (direction.real**2 + (ratio * direction.imag) ** 2)
    farther = [np.mean(np.exp(-(length**2) / square)) for length in found]
    assert farther == pytest.approx(1 - np.array(SHARES), rel=1e-12)
    if ratio == 0.0:
        assert found == pytest.approx([0.0627068, 0.6744898, 1.9599640], rel=1e-4)
    if ratio == 1.0:
        assert found == pytest.approx(np.sqrt(-2 * np.log(1 - np.array(SHARES))), rel=1e-9)


def test_linkages_that_do_not_close_count_as_infinitely_far_off() -> None:
    close = four_bar((20.0, 40.0, 42.0, 61.9), 1, 0.0, 0j, 0.0, (5.0, 0.3))  # 0.1 from a change point
    study = study_of(close, Tolerances(links=0.2), 2000, travel=np.linspace(0, 2 * np.pi, 9))
    assert 0.05 < study.open_share < 0.5
    assert np.isinf(study.position.worst[2]) and np.isfinite(study.position.worst[0])
    assert np.isinf(study.position.simulated[4, 2]) and np.isfinite(study.position.simulated[0]).all()


def test_a_cancelled_study_stops() -> None:
    with pytest.raises(Cancelled):
        simulate(FOUR_BAR, TRAVEL, 5, ALL, 100, 0, Work(cancelled=lambda: True))
