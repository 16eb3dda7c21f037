"""Closure of four-bars: crank and coupler directions, their derivatives, and lengths as functions of a chart.

Every difference is formed without cancellation; `four_bar` derives the formulas.
"""

import cython
import numpy as np
from cython import bint, cclass, cfunc, declare, double, final, inline
from cython.cimports.libc.math import atan2, copysign, cos, exp, fabs, sin, sqrt
from cython.cimports.synthesis.kernels.codes import GRASHOF
from cython.cimports.synthesis.kernels.plane import clip, cross, inner, times, vector

PI = declare(double, 3.141592653589793)
TINY = declare(double, 1e-300)  # keeps divisors away from zero
TOGGLE_ROOT_MIN = declare(double, 1e-8)  # smallest sqrt(X Y) in derivatives, which stay finite at toggle positions
LOG_RATIO_MAX = declare(double, 16.0)  # largest logarithm of a ratio of lengths


@cfunc
def pair_difference(a: double, b: double, c: double, d: double) -> double:
    """Return (a + b) - (c + d) to nearly full relative accuracy (Knuth, TAOCP vol. 2, 4.2.2, theorem B)."""
    left = a + b
    part = left - a
    left_error = (a - (left - part)) + (b - part)
    right = c + d
    part = right - c
    right_error = (c - (right - part)) + (d - part)
    return (left - right) + (left_error - right_error)


@final
@cclass
class Loop:
    """The loop of a four-bar at one crank angle: lengths L1..L4, and X0, Y0 of the closure (see `four_bar`)."""

    def __init__(self):
        self.length = np.zeros(4)
        self.partials = np.zeros(5)

    @cfunc
    def set_lengths(self, l1: double, l2: double, l3: double, l4: double):
        """Set the lengths of a four-bar."""
        self.length[0] = l1
        self.length[1] = l2
        self.length[2] = l3
        self.length[3] = l4
        self.x0 = pair_difference(l2, l3, l1, l4) * (l1 + l2 + l3 + l4)
        self.y0 = pair_difference(l2, l4, l1, l3) * pair_difference(l3, l4, l1, l2)

    @cfunc
    @inline
    @cython.exceptval(check=False)
    def close_at(self, theta1: double, slopes: bint) -> bint:
        """Compute the crank and coupler directions at a crank angle. Return False if the loop does not close.

        With ``slopes``, ``partials`` receives the derivatives of theta2 with respect to the lengths and theta1.
        """
        l1, l2, l3, l4 = self.length[0], self.length[1], self.length[2], self.length[3]
        sine, cosine, four, gap = sin(0.5 * theta1), cos(0.5 * theta1), 4.0 * l1 * l4, l4 - l1
        square, both = sine * sine, sine * cosine
        reach = four * square
        x = self.x0 + four * (cosine * cosine)
        y = self.y0 + reach
        if not (x > 0.0 and y > 0.0):
            return False
        root = sqrt(x * y)
        across = gap * gap + reach + (l2 - l3) * (l2 + l3)
        e1 = vector(1.0 - 2.0 * square, 2.0 * both)
        # e^{i theta2} is (B - D) (C + i side root) to its direction; B - D in the form without cancellation
        if gap >= 0.0:
            diagonal = vector(gap + 2.0 * l1 * square, -2.0 * l1 * both)
        else:
            diagonal = e1 * vector(gap - 2.0 * l4 * square, -2.0 * l4 * both)
        toward = diagonal * vector(across, self.branch * root)
        size = sqrt(inner(toward, toward))
        if not size > 0.0:
            return False
        e2 = vector(toward.real / size, toward.imag / size)
        self.sine_squared, self.sine_cosine, self.projection, self.root = square, both, across, root
        self.e1 = e1
        self.e2 = e2
        if slopes:
            arm = times(l1, e1) + times(l2, e2)
            e3 = vector((arm.real - l4) / l3, arm.imag / l3)
            # 1 / (L2 sin(theta2 - theta3))
            lever = -2.0 * self.branch * l3 / max(root, TOGGLE_ROOT_MIN)
            self.partials[0] = lever * inner(e1, e3)
            self.partials[1] = lever * inner(e2, e3)
            self.partials[2] = -lever
            self.partials[3] = -lever * e3.real
            self.partials[4] = lever * l1 * cross(e1, e3)
        return True

    @cfunc
    @inline
    @cython.exceptval(check=False)
    def coupler_angle(self, theta1: double) -> double:
        """Return theta2 at the crank angle of the last closure, continuous over the turn."""
        ground = self.length[3]
        gap = ground - self.length[0]
        twice = 2.0 * min(self.length[0], ground)
        angle = self.branch * atan2(self.root, self.projection)
        angle += atan2(copysign(twice, -gap) * self.sine_cosine, fabs(gap) + twice * self.sine_squared)
        return angle if gap >= 0.0 else angle + theta1 - PI


@final
@cclass
class Shape:
    """Lengths as functions of the unknowns of a chart, with derivatives."""

    def __init__(self, chart):
        self.chart = chart
        self.size = 4 if chart == GRASHOF else 3
        self.loop = Loop()
        self.partials = np.zeros((4, 4))

    @cfunc
    def evaluate(self, q0: double, q1: double, q2: double, q3: double, side: double):
        """Set lengths, X0 and Y0 of ``loop``, and ``partials`` of the lengths with respect to the unknowns."""
        self.loop.branch = side
        if self.chart == GRASHOF:
            self.grashof(q0, max(q1, 0.0), max(q2, 0.0), max(q3, 0.0))
        else:
            q0, q1, q2 = clip(q0, LOG_RATIO_MAX), clip(q1, LOG_RATIO_MAX), clip(q2, LOG_RATIO_MAX)
            self.loop.set_lengths(exp(q0), exp(q1), exp(q2), 1.0)
            for k in range(3):
                self.partials[k, k] = self.loop.length[k]

    @cfunc
    def grashof(self, q0: double, x: double, y: double, z: double):
        """Evaluate `fourbar.mechanism.GrashofChart`: shortest link and excesses. Negative excesses count as zero."""
        loop, shortest = self.loop, fabs(q0)
        short = 0 if q0 > 0.0 else 3
        long = 3 - short
        loop.length[short] = shortest
        loop.length[long] = shortest + 0.5 * (y + z)
        loop.length[1] = shortest + 0.5 * (x + y)
        loop.length[2] = shortest + 0.5 * (x + z)
        loop.x0 = x * (4.0 * shortest + x + y + z)
        loop.y0 = y * z
        for k in range(4):
            self.partials[k, 0] = 1.0 if q0 > 0.0 else -1.0
        for k in range(2, 4):
            self.partials[short, k] = 0.0
            self.partials[long, k] = 0.5
            self.partials[k - 1, 1] = 0.5
            self.partials[k - 1, k] = 0.5


def shapes(chart: cython.int, unknowns: double[:, ::1]):
    """Compute lengths and closure constants at points of a chart.

    Parameters
    ----------
    chart : int
        Code of the chart.
    unknowns : ndarray, shape (n, k)

    Returns
    -------
    lengths : ndarray, shape (n, 4)
    x0, y0 : ndarray, shape (n,)
    derivatives : ndarray, shape (n, 4, k)
        Derivatives of the lengths with respect to the unknowns.
    """
    shape = Shape(chart)
    count, k = unknowns.shape[0], shape.size
    lengths, excess, slopes = np.empty((count, 4)), np.empty((2, count)), np.empty((count, 4, k))
    length: double[:, ::1] = lengths
    by: double[:, :, ::1] = slopes
    x: double[::1] = excess[0]
    y: double[::1] = excess[1]
    for n in range(count):
        q3 = unknowns[n, 3] if k > 3 else 0.0
        shape.evaluate(unknowns[n, 0], unknowns[n, 1], unknowns[n, 2], q3, 1.0)
        x[n], y[n] = shape.loop.x0, shape.loop.y0
        for j in range(4):
            length[n, j] = shape.loop.length[j]
            for c in range(k):
                by[n, j, c] = shape.partials[j, c]
    return lengths, excess[0], excess[1], slopes


def body_angles(
    lengths: double[:, ::1],
    x0: double[::1],
    y0: double[::1],
    branch: double[::1],
    theta1: double[:, ::1],
    derivatives: bint = False,
):
    """Compute theta2, continuous over the turn, at crank angles of each linkage.

    The result has full relative accuracy if X0 and Y0 are exact and not negative.

    Parameters
    ----------
    lengths : ndarray, shape (n, 4)
    x0, y0, branch : ndarray, shape (n,)
    theta1 : ndarray, shape (n, N)
    derivatives : bool

    Returns
    -------
    angles : ndarray, shape (n, N)
        0 if the linkage does not close.
    slopes : ndarray, shape (n, 5, N)
        Derivatives with respect to the lengths and theta1; 0 if the linkage does not close.
    closes : ndarray of bool, shape (n, N)
    """
    count, samples = theta1.shape[0], theta1.shape[1]
    angles, slopes = np.zeros((count, samples)), np.zeros((count if derivatives else 0, 5, samples))
    closes = np.zeros((count, samples), dtype=np.uint8)
    angle: double[:, ::1] = angles
    by: double[:, :, ::1] = slopes
    close: cython.uchar[:, ::1] = closes
    loop = Loop()
    for n in range(count):
        for k in range(4):
            loop.length[k] = lengths[n, k]
        loop.x0, loop.y0, loop.branch = x0[n], y0[n], branch[n]
        for i in range(samples):
            if not loop.close_at(theta1[n, i], derivatives):
                continue
            close[n, i] = 1
            angle[n, i] = loop.coupler_angle(theta1[n, i])
            if derivatives:
                for k in range(5):
                    by[n, k, i] = loop.partials[k]
    return angles, slopes, closes.view(bool)
