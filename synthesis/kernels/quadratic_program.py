"""Convex quadratic programs by Mehrotra's predictor-corrector method."""

import cython
import numpy as np
from cython import Py_ssize_t, cclass, cfunc, declare, double, final
from cython.cimports.libc.math import fabs, sqrt

INFINITE = declare(double, float("inf"))
TINY = declare(double, 1e-300)  # keeps a divisor from zero
ITERATIONS = declare(cython.int, 30)  # of a quadratic program at most
SHARE = declare(double, 0.995)  # of the way to the nearest constraint that a step of it takes
ROUNDING = declare(double, 1e-16)  # pivot of its scaled system that is rounding


@final
@cclass
class QuadraticProgram:
    """Programs min z'Hz/2 + g'z over Az + b >= 0 of one size: Mehrotra's predictor-corrector from a point inside.

    Nocedal and Wright, Numerical Optimization, algorithm 16.4.
    """

    rows: Py_ssize_t
    size: Py_ssize_t
    matrix: double[:, ::1]
    dual: double[::1]
    slack: double[::1]
    weight: double[::1]
    along: double[::1]  # change of the slack,
    change: double[::1]  # and of the multipliers
    triangle: double[:, ::1]  # of the scaled system, lower
    scaling: double[::1]
    rest: double[::1]  # of the gradient of the Lagrangian
    step: double[::1]

    def __init__(self, rows: Py_ssize_t, size: Py_ssize_t):
        self.rows, self.size = rows, size
        self.slack, self.weight, self.along, self.change = np.empty((4, rows))
        self.triangle = np.empty((size, size))
        self.scaling, self.rest, self.step = np.empty((3, size))

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
        """Lead ``z`` from inside to the minimum, up to a sum of multipliers times slacks of ``accuracy``; fill ``dual``."""
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
        for _ in range(ITERATIONS):
            worst = 0.0
            for j in range(self.size):
                self.rest[j] = gradient[j]
                for k in range(self.size):
                    self.rest[j] += hessian[j, k] * z[k]
            gap = 0.0
            for i in range(self.rows):
                gap += self.slack[i] * dual[i]
                for j in range(self.size):
                    self.rest[j] -= matrix[i, j] * dual[i]
            for j in range(self.size):
                worst = max(worst, fabs(self.rest[j]))
            if gap <= accuracy and worst <= 1e-6 * scale:
                return
            self.factorise(hessian)
            self.solve(0.0, 0.0)
            part, dual_part = longest(self.slack, self.along), longest(dual, self.change)
            ahead = 0.0
            for i in range(self.rows):
                ahead += (self.slack[i] + part * self.along[i]) * (dual[i] + dual_part * self.change[i])
            centring = min(max(ahead / max(gap, TINY), 0.0), 1.0)
            self.solve(gap / self.rows * centring * centring * centring, 1.0)
            part, dual_part = SHARE * longest(self.slack, self.along), SHARE * longest(dual, self.change)
            for j in range(self.size):
                z[j] += part * self.step[j]
            for i in range(self.rows):
                self.slack[i] += part * self.along[i]
                dual[i] += dual_part * self.change[i]

    @cfunc
    def factorise(self, hessian: double[:, ::1]):
        """Cholesky's triangle of H + A'WA, scaled to a diagonal of ones; what nothing holds stays where it is."""
        size, triangle, matrix = self.size, self.triangle, self.matrix
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
                    triangle[j, j] = sqrt(value) if value > ROUNDING else INFINITE

    @cfunc
    def solve(self, centre: double, second: double):
        """Steps towards complementarity ``centre``, less ``second`` times the product that the steps before have missed."""
        size, matrix, step, triangle = self.size, self.matrix, self.step, self.triangle
        for j in range(size):
            step[j] = -self.rest[j]
        for i in range(self.rows):
            missed = second * self.along[i] * self.change[i] if second != 0.0 else 0.0
            self.change[i] = (centre - missed) / self.slack[i] - self.dual[i]
            for j in range(size):
                step[j] += matrix[i, j] * self.change[i]
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
            self.along[i] = value
            self.change[i] -= self.weight[i] * value


@cfunc
def longest(values: double[::1], change: double[::1]) -> double:
    """The longest part, at most 1 / `SHARE`, of a change that leaves positive values positive."""
    steepest: double = SHARE
    for i in range(values.shape[0]):
        steepest = max(steepest, -change[i] / values[i])
    return 1.0 / steepest
