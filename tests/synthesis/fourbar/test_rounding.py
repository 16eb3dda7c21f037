"""Links on a grid: laws of the manufacturing view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.fourbar.kinematics import coupler_angle
from synthesis.fourbar.rounding import round_solution
from synthesis.fourbar.solution import Solution, finish_solutions, make_solutions
from synthesis.target import Target, make_target

LAW = settings(derandomize=True, deadline=None, max_examples=25)


def exact_case(seed: int, with_rotation: bool = True) -> tuple[Target, Solution]:
    """A target of a crank-rocker of lengths near 20 .. 80, and that crank-rocker."""
    random = np.random.default_rng(seed)
    lengths = np.array([20.0, 52.0, 61.0, 74.0]) + random.uniform(-5, 5, 4)
    start, branch = random.uniform(0, 6), int(random.choice([-1, 1]))
    crank = np.linspace(0, random.uniform(1, 6), 24)
    angle = coupler_angle(lengths, np.array(branch), start + crank)
    turned = np.exp(1j * random.uniform(0, 6))
    position = 10 - 3j + turned * (lengths[0] * np.exp(1j * (start + crank)) + (15 + 9j) * np.exp(1j * angle))
    target = make_target(angle if with_rotation else None, position, crank_angle=crank)
    return target, make_solutions(target, lengths[None], np.array([branch]), np.array([start]))[0]


@LAW
@given(st.integers(0, 10_000), st.floats(1e-3, 4.0), st.booleans())
def test_links_lie_on_the_grid_and_near_the_old_ones(seed, grid, with_rotation) -> None:
    target, solution = exact_case(seed, with_rotation)
    rounded = round_solution(target, solution, grid)
    if rounded is None:
        return
    steps = rounded.links / grid
    np.testing.assert_allclose(steps, np.round(steps), rtol=0, atol=1e-9)
    assert np.all(np.abs(rounded.links - solution.links) <= 0.5 * grid * (1 + 1e-9))
    assert rounded.errors.objective >= 0.5 * solution.errors.objective
    assert rounded.branch == solution.branch


@LAW
@given(st.integers(0, 10_000), st.booleans())
def test_the_rest_is_fitted_anew(seed, with_rotation) -> None:
    """No small change of start or pose makes the rounded linkage better."""
    target, solution = exact_case(seed, with_rotation)
    rounded = round_solution(target, solution, 1.0)
    best = rounded.errors.objective
    pose = rounded.mount
    turn = np.exp(1e-4j)
    size = 1e-4 * target.length_scale
    changes = [(rounded.start + step, pose) for step in (-1e-4, 1e-4)]
    changes += [(rounded.start, replace(pose, ground_angle=pose.ground_angle + step)) for step in (-1e-4, 1e-4)]
    changes += [(rounded.start, replace(pose, pivot_a=pose.pivot_a + step)) for step in (size, -size, 1j * size)]
    changes += [(rounded.start, replace(pose, coupler_radius=pose.coupler_radius + step)) for step in (size, -size)]
    changes += [(rounded.start, replace(pose, coupler_angle=pose.coupler_angle + np.angle(turn)))]
    for start, other in changes:
        changed = finish_solutions(
            target, rounded.links[None], np.array([rounded.branch]), np.array([start]), [other]
        )[0]
        assert changed.errors.objective >= best * (1 - 1e-9)


def test_a_fine_grid_costs_little_and_a_coarse_one_more() -> None:
    target, solution = exact_case(1)
    errors = [round_solution(target, solution, grid).errors.objective for grid in (1e-9, 1e-3, 1.0)]
    assert errors[0] < 1e-9 < errors[1] < 1e-3 < errors[2]


def test_links_of_no_length_become_one_step() -> None:
    target, solution = exact_case(2)
    rounded = round_solution(target, solution, 45.0)  # the crank is near 20: it would round to nothing
    if rounded is not None:
        assert rounded.links.min() == 45.0


def test_a_linkage_that_no_longer_closes_is_said_to_be_none() -> None:
    # L1 + L4 just below L2 + L3; on the grid it is above, and opens around theta1 = pi
    lengths = np.array([[20.1, 52.4, 42.4, 74.4]])
    crank = np.linspace(0, 2 * np.pi, 33)
    angle = coupler_angle(lengths[0], np.array(1), crank)
    position = 20.1 * np.exp(1j * crank) + 10 * np.exp(1j * angle)
    target = make_target(angle, position, crank_angle=crank)
    solution = make_solutions(target, lengths, np.ones(1), np.zeros(1))[0]
    assert round_solution(target, solution, 5.0) is None
