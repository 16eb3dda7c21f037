"""Links on a grid: laws of the manufacturing view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from synthesis.fourbar.kinematics import coupler_angle
from synthesis.fourbar.rounding import round_solution
from synthesis.fourbar.solution import Solution, assess, mounted
from synthesis.target import Target, make_target

LAW = settings(derandomize=True, deadline=None, max_examples=25)


def exact_case(seed: int, with_rotation: bool = True, crank_length: float = 20.0) -> tuple[Target, Solution]:
    """A target of a crank-rocker of lengths near 20 .. 80, and that crank-rocker."""
    random = np.random.default_rng(seed)
    lengths = np.array([crank_length, 52.0, 61.0, 74.0]) + random.uniform(-5, 5, 4)
    start, branch = random.uniform(0, 6), int(random.choice([-1, 1]))
    crank = np.linspace(0, random.uniform(1, 6), 24)
    angle = coupler_angle(lengths, np.array(branch), start + crank)
    turned = np.exp(1j * random.uniform(0, 6))
    position = 10 - 3j + turned * (lengths[0] * np.exp(1j * (start + crank)) + (15 + 9j) * np.exp(1j * angle))
    target = make_target(angle if with_rotation else None, position, crank_angle=crank)
    return target, assess(target, mounted(target, lengths[None], [branch], [start]))[0]


@LAW
@given(st.integers(0, 10_000), st.floats(1e-3, 4.0), st.booleans())
def test_links_lie_on_the_grid_and_near_the_old_ones(seed, grid, with_rotation) -> None:
    target, solution = exact_case(seed, with_rotation)
    rounded = round_solution(target, solution, grid)
    assume(rounded is not None)
    links, old = np.array(rounded.linkage.links), np.array(solution.linkage.links)
    steps = links / grid
    np.testing.assert_allclose(steps, np.round(steps), rtol=0, atol=1e-9)
    assert np.all(np.abs(links - old) <= 0.5 * grid * (1 + 1e-9))
    assert rounded.errors.objective >= 0.5 * solution.errors.objective
    assert rounded.linkage.branch == solution.linkage.branch


@LAW
@given(st.integers(0, 10_000), st.booleans())
def test_the_rest_is_fitted_anew(seed, with_rotation) -> None:
    """No small change of start or pose makes the rounded linkage better."""
    target, solution = exact_case(seed, with_rotation)
    rounded = round_solution(target, solution, 1.0)
    best = rounded.errors.objective
    one = rounded.linkage
    radius, angle = one.coupler_point
    step, size = 1e-4, 1e-4 * target.length_scale
    changes = [replace(one, start=one.start + sign * step) for sign in (1, -1)]
    changes += [replace(one, ground_angle=one.ground_angle + sign * step) for sign in (1, -1)]
    changes += [replace(one, pivot_a=one.pivot_a + way * size) for way in (1, -1, 1j, -1j)]
    changes += [replace(one, coupler_point=(radius + sign * size, angle)) for sign in (1, -1)]
    changes += [replace(one, coupler_point=(radius, angle + sign * step)) for sign in (1, -1)]
    for changed in assess(target, changes):
        assert changed.errors.objective >= best * (1 - 1e-9)


def test_a_fine_grid_costs_little_and_a_coarse_one_more() -> None:
    target, solution = exact_case(1)
    errors = [round_solution(target, solution, grid).errors.objective for grid in (1e-9, 1e-3, 1.0)]
    assert errors[0] < 1e-9 < errors[1] < 1e-3 < errors[2]


def test_links_of_no_length_become_one_step() -> None:
    target, solution = exact_case(2, crank_length=5.5)
    grid = 25.0
    assert solution.linkage.links[0] < grid / 2, "to the nearest step it would be nothing"
    assert round_solution(target, solution, grid).linkage.links[0] == grid


def test_a_linkage_that_no_longer_closes_is_said_to_be_none() -> None:
    # L1 + L4 just below L2 + L3; on the grid it is above, and opens around theta1 = pi
    lengths = np.array([[20.1, 52.4, 42.4, 74.4]])
    crank = np.linspace(0, 2 * np.pi, 33)
    angle = coupler_angle(lengths[0], np.array(1), crank)
    position = 20.1 * np.exp(1j * crank) + 10 * np.exp(1j * angle)
    target = make_target(angle, position, crank_angle=crank)
    solution = assess(target, mounted(target, lengths, [1], [0.0]))[0]
    assert round_solution(target, solution, 5.0) is None
