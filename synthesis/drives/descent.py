"""Maximize the smallest of several smooth functions of points, by sequential quadratic programming (SLSQP).

The unknowns are the coordinates of the points and a level u. The largest u is sought for which every function is at least u times
its weight, within limits and equalities. Derivatives are central differences, evaluated at once for all coordinates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from threadpoolctl import ThreadpoolController

from synthesis.arrays import Complexes, Floats

Bounds = list[tuple[float | None, float | None]]


@dataclass(frozen=True)
class DescentOptions:
    """Options of a descent."""

    step: float = 1e-5
    """Step of the differences as a fraction of the size; truncation and rounding are then both of the order of 1e-10."""
    tolerance: float = 1e-13
    """Change of u at which the descent ends."""
    max_steps: int = 60
    fraction: float = 1.0
    """Initial u as a fraction of the largest possible u at the start."""


OPTIONS = DescentOptions()
NEWTON_STEPS = 4
"""Newton steps by which the ends of a descent are moved onto the equalities."""


class Functions(NamedTuple):
    """Values at m sets of points, of the order of 1."""

    levels: Floats
    """(m, r): functions whose minimum is maximized."""
    limits: Floats
    """(m, l): at least 0."""
    equalities: Floats
    """(m, e): equal to 0."""


@cache
def _threads() -> ThreadpoolController:
    return ThreadpoolController()  # created after scipy has loaded its own BLAS, which it can then control


@dataclass(frozen=True)
class MaxMinProblem:
    """Functions of k points, and bounds on their coordinates."""

    evaluate: Callable[[Complexes], Functions]
    """Return the functions at points (m, k)."""
    size: float
    """Length of the order of the coordinates."""
    bounds: Bounds
    """Bounds of x and y of each point in turn, divided by the size."""
    weights: Floats | float = 1.0
    """Multiples of u that the levels must attain."""

    def solve(self, start: Complexes, options: DescentOptions) -> Complexes:
        """Return the points (k,) of the local maximum that is reached from some points.

        A single level is the objective itself, without an unknown u. One thread multiplies matrices, because several threads
        would round differently in each run.
        """
        from scipy.optimize import minimize

        n = 2 * start.size
        values = Functions(*(rows[0] for rows in self.evaluate(start[None])))
        has_level = values.levels.size > 1
        weights = np.broadcast_to(self.weights, values.levels.shape) * has_level
        by_level = np.append(-weights, np.zeros(values.limits.size))

        @cache
        def at(key: bytes) -> tuple[Functions, Functions]:
            return self.derivatives(self._points(np.frombuffer(key)), options.step)

        def cost(z: Floats) -> tuple[float, Floats]:
            if has_level:
                return -z[-1], np.append(np.zeros(n), -1.0)
            values, slopes = at(z.tobytes())
            return -float(values.levels[0]), -slopes.levels[:, 0]

        def limits(z: Floats) -> Floats:
            values, _ = at(z[:n].tobytes())
            return np.append(values.levels, values.limits) + z[-1] * by_level if has_level else values.limits

        def limit_slopes(z: Floats) -> Floats:
            _, slopes = at(z[:n].tobytes())
            return (
                np.vstack([np.hstack([slopes.levels, slopes.limits]), by_level]).T if has_level else slopes.limits.T
            )

        def equalities(z: Floats) -> Floats:
            return at(z[:n].tobytes())[0].equalities

        def equality_slopes(z: Floats) -> Floats:
            slopes = at(z[:n].tobytes())[1].equalities.T
            return np.pad(slopes, ((0, 0), (0, int(has_level))))

        constraints = [{"type": "ineq", "fun": limits, "jac": limit_slopes}]
        if values.equalities.size:
            constraints.append({"type": "eq", "fun": equalities, "jac": equality_slopes})
        level = options.fraction * np.min(values.levels / np.maximum(weights, 1e-300))
        with _threads().limit(limits=1, user_api="blas"), np.errstate(all="ignore"):
            answer: Any = minimize(
                cost,
                np.append(self._unknowns(start), [level] * has_level),
                jac=True,
                bounds=[*self.bounds, *[(None, None)] * has_level],
                constraints=constraints,
                method="SLSQP",
                options={"ftol": options.tolerance, "maxiter": options.max_steps},
            )
        return self._points(np.asarray(answer.x)[:n])

    def restored(self, points: Complexes, moving: int) -> Complexes:
        """Return points (k,) that satisfy the equalities up to rounding; only the first ``moving`` of them change."""
        z = self._unknowns(points)
        for _ in range(NEWTON_STEPS):
            values, slopes = self.derivatives(self._points(z), OPTIONS.step)
            z[: 2 * moving] -= np.linalg.pinv(slopes.equalities[: 2 * moving].T) @ values.equalities
        return self._points(z)

    def derivatives(self, points: Complexes, step: float) -> tuple[Functions, Functions]:
        """Return the functions (r,) at points (k,), and their derivatives (2 k, r) by the coordinates divided by the size."""
        n = 2 * points.size
        steps = step * np.eye(n)
        found = self.evaluate(self._points(self._unknowns(points) + np.concatenate([0 * steps[:1], steps, -steps])))
        slopes = ((rows[1 : n + 1] - rows[n + 1 :]) / (2 * step) for rows in found)
        return Functions(*(rows[0] for rows in found)), Functions(*slopes)

    def _points(self, unknowns: Floats) -> Complexes:
        return np.asarray((unknowns[..., ::2] + 1j * unknowns[..., 1::2]) * self.size)

    def _unknowns(self, points: Complexes) -> Floats:
        return np.stack([points.real, points.imag], axis=-1).ravel() / self.size
