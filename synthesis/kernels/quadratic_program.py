"""Convex quadratic programs by Mehrotra's predictor-corrector method."""

import cython
import numpy as np
from cython import Py_ssize_t, cclass, cfunc, declare, double, final
from cython.cimports.libc.math import fabs, sqrt

INFINITE = declare(double, float("inf"))
TINY = declare(double, 1e-300)  # keeps divisors away from zero
MAX_ITERATIONS = declare(cython.int, 30)
SHARE = declare(double, 0.995)  # fraction of the distance to the nearest constraint that a step covers
PIVOT_MIN = declare(double, 1e-16)  # pivot of the scaled system at the level of rounding


@final
@cclass
class QuadraticProgram:
    """Solver of min z'Hz/2 + g'z subject to Az + b >= 0 for one size, from a feasible interior point.

    Mehrotra's predictor-corrector method: Nocedal and Wright, Numerical Optimization, algorithm 16.4.
    """

    rows: Py_ssize_t
    size: Py_ssize_t
    matrix: double[:, ::1]
    dual: double[::1]
    slack: double[::1]
    weight: double[::1]
    slack_change: double[::1]
    dual_change: double[::1]
    factor: double[:, ::1]  # lower Cholesky factor of the scaled system
    scaling: double[::1]
    residual: double[::1]  # gradient of the Lagrangian
    step: double[::1]

    def __init__(self, rows: Py_ssize_t, size: Py_ssize_t):
        self.rows, self.size = rows, size
        self.slack, self.weight, self.slack_change, self.dual_change = np.empty((4, rows))
        self.factor = np.empty((size, size))
        self.scaling, self.residual, self.step = np.empty((3, size))

    def minimise(
        self,
        hessian: double[:, ::1],
        gradient: double[::1],
        matrix: double[:, ::1],
        bound: double[::1],
        accuracy: double,
        z: double[::1],
        dual: double[::1],
    ):
        """Move ``z`` to the minimum until the sum of multipliers times slacks is at most ``accuracy``; fill ``dual``."""
        self.matrix, self.dual = matrix, dual
        scale: double = 1.0
        for j in range(self.size):
            scale = max(scale, fabs(gradient[j]))
        for i in range(self.rows):
            value: double = bound[i]
            for j in range(self.size):
                value += matrix[i, j] * z[j]
            self.slack[i] = value
            dual[i] = min(0.1 * scale / max(value, 1e-12), 1e6)
        for _ in range(MAX_ITERATIONS):
            worst = 0.0
            for j in range(self.size):
                self.residual[j] = gradient[j]
                for k in range(self.size):
                    self.residual[j] += hessian[j, k] * z[k]
            gap = 0.0
            for i in range(self.rows):
                gap += self.slack[i] * dual[i]
                for j in range(self.size):
                    self.residual[j] -= matrix[i, j] * dual[i]
            for j in range(self.size):
                worst = max(worst, fabs(self.residual[j]))
            if gap <= accuracy and worst <= 1e-6 * scale:
                return
            self.factorise(hessian)
            self.compute_step(0.0, 0.0)
            part, dual_part = longest(self.slack, self.slack_change), longest(dual, self.dual_change)
            ahead = 0.0
            for i in range(self.rows):
                ahead += (self.slack[i] + part * self.slack_change[i]) * (dual[i] + dual_part * self.dual_change[i])
            centring = min(max(ahead / max(gap, TINY), 0.0), 1.0)
            self.compute_step(gap / self.rows * centring * centring * centring, 1.0)
            part, dual_part = SHARE * longest(self.slack, self.slack_change), SHARE * longest(dual, self.dual_change)
            for j in range(self.size):
                z[j] += part * self.step[j]
            for i in range(self.rows):
                self.slack[i] += part * self.slack_change[i]
                dual[i] += dual_part * self.dual_change[i]

    @cfunc
    def factorise(self, hessian: double[:, ::1]):
        """Compute the Cholesky factor of H + A'WA, scaled to a unit diagonal; undetermined directions do not move."""
        size, triangle, matrix = self.size, self.factor, self.matrix
        for j in range(size):
            for k in range(j + 1):
                triangle[j, k] = hessian[j, k]
        for i in range(self.rows):
            self.weight[i] = self.dual[i] / self.slack[i]
            for j in range(size):
                weighed: double = self.weight[i] * matrix[i, j]
                for k in range(j + 1):
                    triangle[j, k] += weighed * matrix[i, k]
        for j in range(size):
            self.scaling[j] = 1.0 / sqrt(max(triangle[j, j], TINY))
        for j in range(size):
            for k in range(j + 1):
                value: double = triangle[j, k] * self.scaling[j] * self.scaling[k]
                for c in range(k):
                    value -= triangle[j, c] * triangle[k, c]
                if k < j:
                    triangle[j, k] = value / triangle[k, k]
                else:
                    triangle[j, j] = sqrt(value) if value > PIVOT_MIN else INFINITE

    @cfunc
    def compute_step(self, centre: double, second: double):
        """Compute the step towards complementarity ``centre``, minus ``second`` times the predictor's second-order term."""
        size, matrix, step, triangle = self.size, self.matrix, self.step, self.factor
        for j in range(size):
            step[j] = -self.residual[j]
        for i in range(self.rows):
            missed = second * self.slack_change[i] * self.dual_change[i] if second != 0.0 else 0.0
            self.dual_change[i] = (centre - missed) / self.slack[i] - self.dual[i]
            for j in range(size):
                step[j] += matrix[i, j] * self.dual_change[i]
        for j in range(size):
            value: double = step[j] * self.scaling[j]
            for k in range(j):
                value -= triangle[j, k] * step[k]
            step[j] = value / triangle[j, j]
        for j in range(size - 1, -1, -1):
            value = step[j]
            for k in range(j + 1, size):
                value -= triangle[k, j] * step[k]
            step[j] = value / triangle[j, j]
        for j in range(size):
            step[j] *= self.scaling[j]
        for i in range(self.rows):
            value = 0.0
            for j in range(size):
                value += matrix[i, j] * step[j]
            self.slack_change[i] = value
            self.dual_change[i] -= self.weight[i] * value


@cfunc
def longest(values: double[::1], change: double[::1]) -> double:
    """Return the largest fraction, at most 1 / `SHARE`, of a change that keeps positive values positive."""
    steepest: double = SHARE
    for i in range(values.shape[0]):
        steepest = max(steepest, -change[i] / values[i])
    return 1.0 / steepest
