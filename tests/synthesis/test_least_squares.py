"""The Levenberg-Marquardt method solves problems with known solutions and never returns a point worse than its start.

A wrong damping rule, a wrong step or a candidate mixed up with another would show here.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.least_squares import Evaluation, minimise

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
