"""Quadratic programs have the solutions of scipy's solvers.

A constraint that is dropped from the active set would show here.
"""

import numpy as np
from scipy.optimize import minimize

from synthesis.quadratic import minimise_quadratics


def chebyshev(seed: int, count: int = 6, samples: int = 20, size: int = 4) -> tuple[np.ndarray, ...]:
    """Linear minimax problems as programs in (d, h): least h over |e + J d| <= h and |d| <= 0.3."""
    random = np.random.default_rng(seed)
    slope, error = random.normal(size=(count, samples, size)), random.normal(size=(count, samples))
    ones, eye = np.ones((count, samples, 1)), np.broadcast_to(np.eye(size, size + 1), (count, size, size + 1))
    parts = [np.concatenate([-slope, ones], axis=2), np.concatenate([slope, ones], axis=2), eye, -eye]
    matrix = np.concatenate(parts, axis=1)
    bound = np.concatenate([-error, error, np.full((count, 2 * size), 0.3)], axis=1)
    inside = np.zeros((count, size + 1))
    inside[:, -1] = 1.1 * np.abs(error).max(axis=1)
    return matrix, bound, inside


def test_quadratic_programs_against_scipy() -> None:
    matrix, bound, inside = chebyshev(9)
    count, _, size = matrix.shape
    random = np.random.default_rng(1)
    root = random.normal(size=(count, size, size))
    hessian, gradient = root.transpose(0, 2, 1) @ root, random.normal(size=(count, size))
    z, _ = minimise_quadratics(hessian, gradient, matrix, bound, inside, 1e-11)
    for k in range(count):

        def cost(x: np.ndarray, k: int = k) -> float:
            return float(0.5 * x @ hessian[k] @ x + gradient[k] @ x)

        limits = {"type": "ineq", "fun": lambda x, k=k: matrix[k] @ x + bound[k], "jac": lambda x, k=k: matrix[k]}
        slope, options = lambda x, k=k: hessian[k] @ x + gradient[k], {"ftol": 1e-14, "maxiter": 500}
        naive = minimize(cost, inside[k], jac=slope, constraints=[limits], method="SLSQP", options=options)
        assert cost(z[k]) <= naive.fun + 1e-8
