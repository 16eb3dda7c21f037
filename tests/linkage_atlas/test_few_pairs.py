"""Two to five pairs of a function are met exactly by linkages that an engineer would build.

Catches first answers that transmit badly, turn back or are not exact although random sampling finds better linkages
at once.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import linkage_atlas as la

EXACT = 1e-7
"""Degrees."""


def rocker(links: Any, branch: int, crank: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rocker and transmission angles in radians by the law of cosines."""
    diagonal = links[3] - links[0] * np.exp(1j * crank)
    distance = np.abs(diagonal)
    inner = np.arccos((distance**2 + links[2] ** 2 - links[1] ** 2) / (2 * distance * links[2]))
    between = np.arccos((links[1] ** 2 + links[2] ** 2 - distance**2) / (2 * links[1] * links[2]))
    return np.unwrap(np.angle(-diagonal) - branch * inner), np.minimum(between, np.pi - between)


def assert_exact(found: la.FunctionResult, travel: Any, output: Any, count: int = 10) -> None:
    assert found.status == "reached" and len(found) == count
    for solution in found:
        assert abs(solution.start_angle) <= 360
        crank = np.deg2rad(solution.start_angle + np.array(travel) - travel[0])
        built = np.rad2deg(rocker(solution.links, solution.branch, crank)[0]) + solution.output_offset
        gap = built - output
        assert np.abs(gap - 360 * np.round(gap[0] / 360)).max() < EXACT
    shapes = np.array([[*solution.links, solution.branch] for solution in found])
    assert all(np.abs(shapes[:k] - shapes[k]).max(axis=1).min() > 1e-3 for k in range(1, count))


def best_sampled(travel: np.ndarray, output: np.ndarray, seed: int) -> float:
    """Return the largest transmission angle of random exact four-bars, links within 1 to 10, that never turn back."""
    random, best = np.random.default_rng(seed), 0.0
    all_cases = np.linspace(0.0, travel[-1], 61)
    for start, offset in random.uniform(-np.pi, np.pi, (3000, 2)):
        phi, psi = start + travel, output - offset
        matrix = np.stack([np.cos(psi), -np.cos(phi), np.ones(3)], axis=1)
        first, second, third = np.linalg.solve(matrix, np.cos(phi - psi))
        square = 1 / first**2 + 1 / second**2 + 1 - 2 * third / (first * second)
        links = np.array([1 / first, np.sqrt(max(square, 0.0)), 1 / second, 1.0])
        if links.min() <= 0 or links.max() > 10 * links.min():
            continue
        for branch in (1, -1):
            with np.errstate(invalid="ignore"):
                angle, transmission = rocker(links, branch, start + all_cases)
                gap = np.interp(travel, all_cases, angle) - angle[0] - output
            if np.all(np.diff(angle) * output[-1] > 0) and np.abs(gap).max() < 0.02:
                best = max(best, float(np.min(transmission)))
    return np.rad2deg(best)


def test_three_pairs_of_a_fast_rocker() -> None:
    """A rocker that turns ten times as far as the crank had 2.2 degrees of transmission angle; 1.126/0.142/0.1146/1 has 57.8."""
    found = la.function(input=[0, 5, 10], output=[0, 50, 100])
    assert_exact(found, [0, 5, 10], [0, 50, 100])
    assert found.best.transmission_angle_min > 39.9
    assert all(solution.verdict.works for solution in found)
    best = la.function(input=[0, 5, 10], output=[0, 50, 100], limits={"transmission_angle_min": 57}).best
    assert best.errors.max < EXACT and best.transmission_angle_min >= 57


@pytest.mark.parametrize("seed", range(4))
def test_the_first_of_three_pairs_transmits_as_well_as_sampled_ones(seed: int) -> None:
    random = np.random.default_rng([56, seed])
    travel, output = np.cumsum(random.uniform([0, 20, 20], [0, 60, 60])), np.cumsum(random.uniform(10, 50, 3))
    output = np.array([0.0, *output[:2]]) * random.choice([-1, 1])
    sampled = best_sampled(np.deg2rad(travel), np.deg2rad(output), seed)
    found = la.function(output, input=travel)
    assert_exact(found, travel, output)
    assert found.best.transmission_angle_min > min(sampled, 40.0) - 1.0


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"limits": {"preset": "practical"}},
        {"limits": {"links": {"ground": 2.2, "crank": 1.0}}, "one_way": True},
        {"input_zero": 20},
    ],
)
def test_two_pairs(fields: dict[str, Any]) -> None:
    found = la.function([-40, 30], input=[-50, 30], **fields)
    assert_exact(found, [-50, 30], [-40, 30])
    assert any(note.startswith("Infinitely many linkages pass through two pairs") for note in found.report.notes)
    links = fields.get("limits", {}).get("links", {})
    assert all(getattr(linkage.links, name) == length for linkage in found for name, length in links.items())


def test_given_zeros_leave_one_linkage_through_three_pairs() -> None:
    """The lengths agree with the linkage that drew the pairs."""
    maker = la.FourBar(2, 5, 4.5, 5.5, start_angle=40)
    output = maker.joints(np.array([0, 40, 90])).rocker_direction
    request = {"input": [0, 40, 90], "input_zero": 40, "output_zero": output[0], "limits": {"links": {"ground": 5.5}}}
    found = la.function(output, **request)
    assert found.status == "reached"
    np.testing.assert_allclose(found.linkage.links, [2, 5, 4.5, 5.5], rtol=1e-9)


def drawn_pairs(seed: int, count: int) -> tuple[la.FourBar, np.ndarray, np.ndarray]:
    """Return a practical linkage and pairs that it draws."""
    random = np.random.default_rng([45, seed])
    while True:
        links, start = random.uniform(1, 4, 4), random.uniform(-180, 180)
        travel = np.concatenate([[0.0], np.cumsum(random.uniform(10, 30, count - 1))])
        try:
            maker = la.FourBar(*links, start_angle=start)
            drawn = maker.joints(np.linspace(0, travel[-1], 50))
        except la.FieldError:
            continue
        steps = np.diff(drawn.rocker_direction)
        steady = abs(np.sign(steps).sum()) == steps.size and np.ptp(drawn.rocker_direction) > 15
        if steady and np.all(drawn.transmission_angle > 40):
            return maker, travel, maker.joints(travel).rocker_direction


@pytest.mark.parametrize("seed", range(4))
def test_four_pairs_are_met_by_linkages_that_transmit_as_well_as_the_one_that_drew_them(seed: int) -> None:
    _, travel, output = drawn_pairs(seed, 4)
    found = la.function(output, input=travel)
    assert_exact(found, travel, output, len(found))
    assert len(found) >= 3
    assert found.best.transmission_angle_min > 34.0
    assert any(note.startswith("Infinitely many linkages pass through four pairs") for note in found.report.notes)


@pytest.mark.parametrize("seed", range(4))
def test_the_linkage_that_drew_five_pairs_is_found_and_unusable_ones_come_last(seed: int) -> None:
    maker, travel, output = drawn_pairs(seed, 5)
    found = la.function(output, input=travel)
    assert_exact(la.function(output, input=travel, top=1), travel, output, 1)
    shapes = [np.array(solution.links) / solution.links[3] for solution in found if solution.errors.max < EXACT]
    expected = np.array(maker.links) / maker.links[3]
    assert min(np.abs(shape / expected - 1).max() for shape in shapes) < 1e-6
    usable = [solution.transmission_angle_min > 5 for solution in found]
    assert usable == sorted(usable, reverse=True)


def test_a_given_zero_leaves_few_linkages_through_four_pairs() -> None:
    maker, travel, output = drawn_pairs(0, 4)
    for zeros in ({"input_zero": maker.start_angle}, {"output_zero": output[0]}):
        found = la.function(output, input=travel, **zeros)
        assert found.status == "reached"
        shapes = [np.array(solution.links) / solution.links[3] for solution in found]
        assert min(np.abs(shape - np.array(maker.links) / maker.links[3]).max() for shape in shapes) < 1e-6
