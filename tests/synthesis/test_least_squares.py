"""The Levenberg-Marquardt method solves problems with known solutions and never returns a point worse than its start.

A wrong damping rule, a wrong step or a candidate mixed up with another would show here.
"""

from itertools import count

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.least_squares import Evaluation, _damped_steps, minimise
from synthesis.work import Work

LAW = settings(derandomize=True, deadline=None, max_examples=30)


def evaluation(residual: np.ndarray, jacobian: np.ndarray) -> Evaluation:
    """Build the evaluation from residuals (n, rows) and their derivatives (n, m, rows)."""
    return Evaluation(np.sum(residual**2, axis=1), np.concatenate([jacobian, residual[:, None]], axis=1))


def rosenbrock(unknowns: np.ndarray, steepness: np.ndarray) -> Evaluation:
    """Return the residuals 1 - x and a (y - x^2), both zero only at (1, 1); the label of a candidate is its a."""
    x, y = unknowns.T
    zeros, ones = np.zeros_like(x), np.ones_like(x)
    residual = np.stack([1 - x, steepness * (y - x**2)], axis=1)
    return evaluation(residual, np.stack([[-ones, -2 * steepness * x], [zeros, steepness]]).transpose(2, 0, 1))


def cliff(unknowns: np.ndarray, labels: np.ndarray) -> Evaluation:
    """Return Rosenbrock's residuals, with an infinite cost for x > 1.2."""
    found = rosenbrock(unknowns, labels)
    return found._replace(cost=np.where(unknowns[:, 0] > 1.2, np.inf, found.cost))


@pytest.mark.parametrize(
    ("start", "steepness"), [((-1.2, 1.0), 10.0), ((3.0, -4.0), 10.0), ((0.0, 0.0), 1.0), ((-5.0, 20.0), 30.0)]
)
def test_rosenbrocks_function_is_minimised_from_several_starts(start, steepness) -> None:
    found = minimise(rosenbrock, np.array([start]), np.array([steepness]), 300)
    np.testing.assert_allclose(found.unknowns, 1.0, rtol=0, atol=1e-12)
    assert np.all(found.cost < 1e-24)


def test_all_candidates_stop_when_a_cost_is_below_the_tolerance() -> None:
    start = np.array([[1.0 + 1e-9, 1.0], [-1.2, 1.0]])
    found = minimise(rosenbrock, start, np.array([10.0, 10.0]), 300, tolerance=1e-6)
    np.testing.assert_array_equal(found.unknowns, start)
    first, second = minimise(rosenbrock, start, np.array([10.0, 10.0]), 300, tolerance=1e-12).cost
    assert first <= 1e-24 < second < rosenbrock(start[1:], np.array([10.0])).cost[0]


@LAW
@given(st.integers(0, 10_000), st.integers(1, 6), st.integers(0, 12))
def test_a_linear_fit_agrees_with_lstsq(seed, size, excess) -> None:
    random = np.random.default_rng(seed)
    matrix, values = random.normal(size=(size + excess, size)), random.normal(size=size + excess)

    def linear(unknowns: np.ndarray, _: np.ndarray) -> Evaluation:
        jacobian = np.broadcast_to(matrix.T, (len(unknowns), *matrix.T.shape))
        return evaluation(unknowns @ matrix.T - values, jacobian)

    solution, *_ = np.linalg.lstsq(matrix, values, rcond=None)
    found = minimise(linear, random.normal(size=(1, size)), np.zeros(1), 300, stall=0.0)
    assert found.cost[0] == pytest.approx(np.sum((matrix @ solution - values) ** 2), rel=1e-9, abs=1e-18)
    # The cost is flat at its minimum, so the unknowns have only half of its digits.
    tolerance = 1e-6 * np.linalg.cond(matrix)
    np.testing.assert_allclose(found.unknowns[0], solution, rtol=0, atol=tolerance)


@LAW
@given(st.integers(0, 10_000), st.integers(1, 5), st.integers(1, 40), st.floats(1e-20, 1e8))
def test_a_step_solves_the_damped_system_and_predicts_the_decrease_of_the_cost(seed, size, rows, damping) -> None:
    random = np.random.default_rng(seed)
    systems = random.normal(size=(3, size + 1, rows)) * 10 ** random.uniform(-3, 3, (3, size + 1, 1))
    steps, decreases = _damped_steps(systems, np.full(3, damping))
    for columns, step, predicted in zip(systems, steps, decreases):
        jacobian, residual = columns[:-1].T, columns[-1]
        ridge = damping * np.sum(jacobian**2, axis=0)
        scale = np.sqrt(np.sum(jacobian**2, axis=0) + ridge)
        system = np.concatenate([jacobian, np.diag(np.sqrt(ridge))]) / scale
        expected, *_ = np.linalg.lstsq(system, -np.append(residual, np.zeros(size)), rcond=1e-15)
        condition = np.linalg.cond(system)
        fraction = min(1.0, 1.5 / np.max(np.abs(expected / scale)))
        assert np.max(np.abs(step)) <= 1.5 * (1 + 1e-12)
        if condition < 1e8:
            # Error bound of a fit with a residual (Golub and Van Loan, Matrix Computations, 5.3.7).
            allowed = 1e-14 * condition**2 * np.linalg.norm(residual)
            np.testing.assert_allclose(step * scale, fraction * expected, rtol=0, atol=allowed)
        decrease = np.sum(residual**2) - np.sum((residual + jacobian @ step) ** 2)
        assert predicted >= 0
        length = np.linalg.norm(residual)
        rounding = 1e-13 * length * (length + np.linalg.norm(jacobian) * np.linalg.norm(step))
        assert decrease == pytest.approx(predicted, rel=1e-9, abs=rounding)


@LAW
@given(st.integers(0, 10_000), st.sampled_from([rosenbrock, cliff]), st.integers(0, 30))
def test_no_candidate_is_worse_than_its_start(seed, problem, iterations) -> None:
    random = np.random.default_rng(seed)
    start, labels = random.uniform(-4, 4, (20, 2)), random.uniform(0.1, 30, 20)
    before = start.copy()
    found = minimise(problem, start, labels, iterations)
    assert np.array_equal(start, before), "the starting points must not be modified"
    at_start = problem(start, labels).cost
    assert np.all(found.cost <= at_start)
    np.testing.assert_allclose(problem(found.unknowns, labels).cost, found.cost, rtol=1e-12)
    moved = np.any(found.unknowns != start, axis=1)
    assert np.all(found.cost[moved] < at_start[moved]) and np.all(np.isfinite(found.cost[moved]))


def test_more_steps_never_increase_the_cost_and_several_are_needed() -> None:
    start, labels = np.array([[-1.2, 1.0]]), np.array([10.0])
    costs = [minimise(rosenbrock, start, labels, steps).cost[0] for steps in range(40)]
    assert costs == sorted(costs, reverse=True) and costs[0] == rosenbrock(start, labels).cost[0]
    assert costs[3] > 1e-3 and costs[-1] < 1e-24


@pytest.mark.parametrize("budget", [1, 3, 7])
def test_expired_work_ends_the_descent(budget) -> None:
    start, labels = np.array([[-1.2, 1.0]]), np.array([10.0])
    stopped = minimise(rosenbrock, start, labels, 100, work=Work(budget, clock=count().__next__))
    short = minimise(rosenbrock, start, labels, budget - 1)
    np.testing.assert_array_equal(stopped.unknowns, short.unknowns)
    assert stopped.cost > 1e-6


def test_the_length_of_a_step_is_limited() -> None:
    """From a point with a tiny derivative, the full step would be extremely long."""

    def flat(unknowns: np.ndarray, _: np.ndarray) -> Evaluation:
        return evaluation(np.tanh(unknowns) - 1.0, (1 / np.cosh(unknowns) ** 2)[:, None])

    found = minimise(flat, np.array([[-8.0]]), np.zeros(1), 1)
    assert 0 < found.unknowns[0, 0] + 8.0 <= 1.5


def test_underdetermined_residuals_are_reduced_to_zero() -> None:
    def line(unknowns: np.ndarray, _: np.ndarray) -> Evaluation:
        ones = np.ones((len(unknowns), 3, 1))
        return evaluation(unknowns.sum(axis=1, keepdims=True) - 1.0, ones)

    found = minimise(line, np.random.default_rng(1).normal(size=(5, 3)), np.zeros(5), 50)
    np.testing.assert_allclose(found.unknowns.sum(axis=1), 1.0, atol=1e-10)
