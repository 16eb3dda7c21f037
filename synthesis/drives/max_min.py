"""Maximize the minimum of smooth functions of two points, by sequential quadratic programming (SLSQP).

The unknowns are two points and a level u. The largest u is sought for which all constraints, linear in u, are satisfied.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

from synthesis.arrays import Floats


@cache
def _threads() -> ThreadpoolController:
    return ThreadpoolController()  # created after scipy has loaded its own BLAS, which it can then control


def solve_sqp(
    cost: Callable[[Floats], tuple[float, Floats]],
    start: Floats,
    bounds: Sequence[tuple[float | None, float | None]],
    constraints: Sequence[Mapping[str, Any]],
    tolerance: float,
    max_steps: int,
) -> Floats:
    """Return the end point of sequential quadratic programming.

    It uses one BLAS thread, because products of matrices that are shared by several threads round differently in each run.

    Parameters
    ----------
    cost : callable
        Return the cost and its gradient at the unknowns.
    start : ndarray, shape (m,)
    bounds : sequence of pairs
        Lower and upper bound of each unknown; None if there is none.
    constraints : sequence of mappings
        Constraints in the form of `scipy.optimize.minimize`.
    tolerance : float
        Change of the cost below which the iteration stops.
    max_steps : int
    """
    from scipy.optimize import minimize

    with _threads().limit(limits=1, user_api="blas"):
        answer: Any = minimize(
            cost,
            start,
            jac=True,
            bounds=bounds,
            constraints=constraints,
            method="SLSQP",
            options={"ftol": tolerance, "maxiter": max_steps},
        )
    return np.asarray(answer.x)


class MaxMinProblem:
    """Problem in two points and a level u: maximize u so that `constraints` are at least 0 and `equalities` are 0.

    The unknowns are the coordinates of both points divided by ``size``, and u. Subclasses supply the functions and their exact
    derivatives; ``_evaluate`` computes what these have in common once for each pair of points.
    """

    size: float
    bounds: list[tuple[float, float]]
    constraints: Callable[[Floats], Floats]
    constraint_jacobian: Callable[[Floats], Floats]
    equalities: Callable[[Floats], Floats]
    equality_jacobian: Callable[[Floats], Floats]
    _evaluate: Callable[[complex, complex], Any]
    _cache: tuple[bytes, Any] = b"", None

    def points(self, z: Floats) -> tuple[complex, complex]:
        """Return both points: the ground point or motor, and the pin."""
        return complex(z[0], z[1]) * self.size, complex(z[2], z[3]) * self.size

    def unknowns(self, ground: complex, pin: complex) -> Floats:
        """Return the unknowns of two points with u = 0."""
        return np.array([ground.real, ground.imag, pin.real, pin.imag, 0.0]) / self.size

    def solve(self, start: Floats, with_equalities: bool, tolerance: float, max_steps: int) -> Floats:
        """Return the local maximum that is reached from some unknowns."""
        upwards = np.array([0.0, 0.0, 0.0, 0.0, -1.0])
        limits = [{"type": "ineq", "fun": self.constraints, "jac": self.constraint_jacobian}]
        limits += [{"type": "eq", "fun": self.equalities, "jac": self.equality_jacobian}] * with_equalities
        return solve_sqp(lambda z: (-z[-1], upwards), start, self.bounds, limits, tolerance, max_steps)

    def _at(self, z: Floats) -> Any:
        key = z[:4].tobytes()
        if self._cache[0] != key:
            self._cache = key, self._evaluate(*self.points(z))
        return self._cache[1]
