"""Limits of a four-bar as functions that are at least 0 where the limit is satisfied, with derivatives."""

import cython
import numpy as np
from cython import Py_ssize_t, bint, cclass, cfunc, declare, double, doublecomplex, final
from cython.cimports.libc.math import cos, log, rint, sin, sqrt
from cython.cimports.synthesis.kernels.codes import (
    AT,
    BODY,
    BODY_FROM_ROCKER,
    BY_BODY,
    BY_FIRST,
    BY_LAST,
    BY_PIVOT,
    BY_TURNED,
    COLUMNS,
    ENVELOPE,
    FAMILY,
    INSIDE,
    LENGTH,
    NEAR,
    OVER_TURN,
    PIVOT_B,
    RATIO,
    RATIOS,
    USED,
)
from cython.cimports.synthesis.kernels.crank_loops import Loop, pair_difference
from cython.cimports.synthesis.kernels.plane import depth, inner, inside, vector

from synthesis.kernels.codes import COUNTS

PI = declare(double, 3.141592653589793)
TURN = declare(double, 6.283185307179586)
NAN = declare(double, float("nan"))


@cfunc
def vertex(middle: double, before: double, here: double, after: double, step: double) -> double:
    """Where a function is least, from its values a step before a place, there, and a step after: a parabola's vertex."""
    bend = before - 2.0 * here + after
    if bend > 0.0:
        part = inside(0.5 * (before - after) / bend, 1.0)
    elif before == after:
        part = 0.0
    else:
        part = 1.0 if before > after else -1.0
    return min(max(middle + step * part, 0.0), 1.0)


@final
@cclass
class Limits:
    """The limits of a request as functions of a linkage in its place, at least 0 where they are kept.

    Parameters
    ----------
    table : ndarray, shape (K, 8)
        Kind and numbers of each.
    posed : bool
        Whether there is a pose; without one lengths count over the ground.
    equal : sequence of bool
        Of all rows: which are equations.
    """

    def __init__(self, table, posed, equal=()):
        table = np.ascontiguousarray(table, dtype=float).reshape(-1, 8)
        counts = [COUNTS[int(row[0])] for row in table]
        self.table = table
        self.begins = np.cumsum([0, *counts]).astype(np.intc)
        self.rows = sum(counts)
        self.posed = posed
        self.equal = np.array(equal if len(equal) else np.zeros(self.rows + 1), dtype=np.intc)
        self.values = np.zeros(self.rows + 1)
        self.slopes = np.zeros((self.rows + 1, COLUMNS))
        self.loop = Loop()
        self.excess = np.zeros(3)
        self.joint = np.zeros(4, dtype=complex)
        self.joint_by = np.zeros((4, COLUMNS), dtype=complex)
        self.trace = np.zeros((12, max([3] + [int(row[5]) for row in table if row[0] == ENVELOPE])))

    @property
    def count_rows(self):
        """Rows of all limits."""
        return self.rows

    def __call__(
        self,
        lengths: double[:, ::1],
        branch: double[::1],
        first: double[::1],
        last: double[::1],
        pivot: double[:, ::1],
        turned: double[::1],
        body: double[:, ::1],
        derivatives: bint = True,
    ):
        """Values (n, C) and, where wanted, derivatives (n, C, 11) at linkages; NaN where one does not close.

        Lengths (n, 4), branch, first and last crank angle (n,), pivot (n, 2), ground angle (n,), z2 (n, 2).
        """
        count = lengths.shape[0]
        values, slopes = np.empty((count, self.rows)), np.empty((count if derivatives else 0, self.rows, COLUMNS))
        value: double[:, ::1] = values
        slope: double[:, :, ::1] = slopes
        for n in range(count):
            self.loop.side = branch[n]
            self.loop.of_lengths(lengths[n, 0], lengths[n, 1], lengths[n, 2], lengths[n, 3])
            self.at(
                first[n],
                last[n],
                vector(pivot[n, 0], pivot[n, 1]),
                vector(cos(turned[n]), sin(turned[n])),
                vector(body[n, 0], body[n, 1]),
            )
            for row in range(self.rows):
                value[n, row] = self.values[row]
                if derivatives:
                    for c in range(COLUMNS):
                        slope[n, row, c] = self.slopes[row, c]
        return values, slopes

    @cfunc
    def at(
        self,
        first: double,
        last: double,
        pivot: doublecomplex,
        turned: doublecomplex,
        body: doublecomplex,
    ):
        """Values and derivatives of the linkage in ``loop`` at a place, into ``values`` and ``slopes``."""
        self.first = first
        self.last = last
        self.pivot = pivot
        self.turned = turned
        self.body = body
        for row in range(self.rows):
            for c in range(COLUMNS):
                self.slopes[row, c] = 0.0
        for n in range(self.table.shape[0]):
            kind = cython.cast(cython.int, self.table[n, 0])
            begin = self.begins[n]
            if kind == USED:
                self.used_transmission(begin, self.table[n, 1])
            elif kind == OVER_TURN:
                self.turn_transmission(begin, self.table[n, 1], self.table[n, 2] > 0.0)
            elif kind == LENGTH:
                self.of_length(begin, cython.cast(cython.int, self.table[n, 1]), self.table[n, 2], self.table[n, 3])
            elif kind == RATIO:
                self.ratio(begin, self.table[n, 1])
            elif kind == RATIOS:
                self.ratios(begin, self.table[n, 1])
            elif kind == FAMILY:
                self.family(begin, self.table[n, 1])
            elif kind == ENVELOPE:
                self.envelope(begin, n)
            else:
                self.place(begin, kind, n)

    @cfunc
    def transmission(self, row: cython.int, least: double, at: double, sign: double) -> double:
        """One row of a transmission angle at a crank angle; returns its derivative by that angle."""
        l1, l2, l3, l4 = self.loop.length[0], self.loop.length[1], self.loop.length[2], self.loop.length[3]
        sine, cosine, product = sin(0.5 * at), cos(at), l2 * l3
        square = (l4 - l1) * (l4 - l1) + 4.0 * l1 * l4 * (sine * sine)
        ratio = (l2 * l2 + l3 * l3 - square) / (2.0 * product)
        self.slopes[row, 0] = -sign * (l4 * cosine - l1) / product
        self.slopes[row, 1] = -sign * (1.0 / l3 - ratio / l2)
        self.slopes[row, 2] = -sign * (1.0 / l2 - ratio / l3)
        self.slopes[row, 3] = -sign * (l1 * cosine - l4) / product
        self.values[row] = least - sign * ratio
        return sign * l1 * l4 * sin(at) / product

    @cfunc
    def used_transmission(self, row: cython.int, least: double):
        """Where the diagonal is shortest and longest within the used interval."""
        first, last = min(self.first, self.last), max(self.first, self.last)
        for k in range(2):
            folded = PI * k
            at = folded + TURN * rint((0.5 * (first + last) - folded) / TURN)
            at = min(max(at, first), last)
            by_angle = self.transmission(row + k, least, at, 1.0 - 2.0 * k)
            if at <= first:
                self.slopes[row + k, BY_FIRST] = by_angle
            if at >= last:
                self.slopes[row + k, BY_LAST] = by_angle

    @cfunc
    def turn_transmission(self, row: cython.int, least: double, every: bint):
        """Where the diagonal is shortest and longest over the turn."""
        if not every:
            self.excesses()
            every = self.excess[2] > 0.0 and (
                (self.excess[0] > 0.0 and self.excess[1] > 0.0) or (self.excess[0] < 0.0 and self.excess[1] < 0.0)
            )
        for k in range(2):
            if every:
                self.transmission(row + k, least, PI * k, 1.0 - 2.0 * k)
            else:
                self.values[row + k] = 1.0

    @cfunc
    def excesses(self):
        """The three excesses of `fourbar.kinematics`."""
        l1, l2, l3, l4 = self.loop.length[0], self.loop.length[1], self.loop.length[2], self.loop.length[3]
        self.excess[0] = pair_difference(l2, l4, l1, l3)
        self.excess[1] = pair_difference(l3, l4, l1, l2)
        self.excess[2] = pair_difference(l2, l3, l1, l4)

    @cfunc
    def of_length(self, row: cython.int, link: cython.int, sign: double, rest: double):
        """A length's bound."""
        self.slopes[row, link] = sign
        if self.posed:
            self.values[row] = sign * self.loop.length[link] + rest
        else:
            self.values[row] = sign * self.loop.length[link] + rest * self.loop.length[3]
            self.slopes[row, 3] += rest

    @cfunc
    def perimeter(self) -> double:
        """Sum of the lengths."""
        return self.loop.length[0] + self.loop.length[1] + self.loop.length[2] + self.loop.length[3]

    @cfunc
    def ratio(self, row: cython.int, most: double):
        """Over the perimeter, whose change does not matter where the constraint holds."""
        shortest, size = 0, self.perimeter()
        for k in range(1, 4):
            if self.loop.length[k] < self.loop.length[shortest]:
                shortest = k
        for k in range(4):
            self.values[row + k] = (most * self.loop.length[shortest] - self.loop.length[k]) / size
            self.slopes[row + k, shortest] = most / size
            self.slopes[row + k, k] -= 1.0 / size

    @cfunc
    def ratios(self, row: cython.int, most: double):
        """The logarithm of no length is above that of another by more than that of the ratio."""
        for long in range(4):
            for short in range(4):
                if long != short:
                    self.values[row] = log(most) - log(self.loop.length[long]) + log(self.loop.length[short])
                    self.slopes[row, long] = -1.0 / self.loop.length[long]
                    self.slopes[row, short] = 1.0 / self.loop.length[short]
                    row += 1

    @cfunc
    def family(self, row: cython.int, sign: double):
        """The signs of the three excesses, over the perimeter."""
        size = self.perimeter()
        if sign == 0.0:
            sign = -1.0 if self.loop.length[0] > self.loop.length[3] else 1.0
        self.excesses()
        for k in range(3):
            own = 1.0 if k == 2 else sign
            value = own * self.excess[k] / size
            self.values[row + k] = value
            for c in range(4):
                # (L2 + L4) - (L1 + L3), (L3 + L4) - (L1 + L2), (L2 + L3) - (L1 + L4)
                less: bint = c == 0 or c == (3 if k == 2 else 2 - k)
                self.slopes[row + k, c] = ((-own if less else own) - value) / size

    @cfunc
    def fixed(self, point: cython.int):
        """Pivot A or B, or the body point from a coupler joint, and its derivatives, into the first of the joints."""
        for c in range(COLUMNS):
            self.joint_by[0, c] = 0.0
        if point == BODY or point == BODY_FROM_ROCKER:
            self.joint[0] = self.body
            self.joint_by[0, BY_BODY] = 1.0
            self.joint_by[0, BY_BODY + 1] = 1j
            if point == BODY_FROM_ROCKER:
                # z2 contains the ground angle
                self.joint[0] = self.body - self.loop.length[1] * self.turned
                self.joint_by[0, 1] = -self.turned
                self.joint_by[0, BY_TURNED] = -1j * self.loop.length[1] * self.turned
            return
        self.joint[0] = self.pivot
        self.joint_by[0, BY_PIVOT] = 1.0
        self.joint_by[0, BY_PIVOT + 1] = 1j
        if point == PIVOT_B:
            ground = self.loop.length[3] * self.turned
            self.joint[0] = self.pivot + ground
            self.joint_by[0, 3] = self.turned
            self.joint_by[0, BY_TURNED] = 1j * ground

    @cfunc
    def place(self, row: cython.int, kind: cython.int, n: Py_ssize_t):
        """Limits on pivot A, pivot B and the body point from a coupler joint."""
        self.fixed(cython.cast(cython.int, self.table[n, 1]))
        if kind == AT:
            for axis in range(2):
                self.beside(row + axis, axis, self.table[n, 2 + axis], 0, 1.0)
        elif kind == NEAR:
            gap = self.joint[0] - vector(self.table[n, 2], self.table[n, 3])
            away = sqrt(inner(gap, gap))
            self.values[row] = self.table[n, 4] - away
            if away > 0.0:
                for c in range(COLUMNS):
                    self.slopes[row, c] = -inner(gap, self.joint_by[0, c]) / away
        elif kind == INSIDE:
            self.within(row, n, 2)
        else:
            nearest = 0
            for side in range(1, 4):
                if depth(self.joint[0], side, self.table[n, 2 + side]) < depth(
                    self.joint[0], nearest, self.table[n, 2 + nearest]
                ):
                    nearest = side
            self.beside(row, nearest, self.table[n, 2 + nearest], 0, -1.0)

    @cfunc
    def beside(self, row: cython.int, side: cython.int, edge: double, k: cython.int, sign: double):
        """How far inside of one side of a box a joint is, times a sign."""
        self.values[row] = sign * depth(self.joint[k], side, edge)
        for c in range(COLUMNS):
            self.slopes[row, c] = sign * depth(self.joint_by[k, c], side, 0.0)

    @cfunc
    def within(self, row: cython.int, n: Py_ssize_t, column: cython.int):
        """The first of the joints inside of all sides of a box, whose numbers begin in a column."""
        for side in range(4):
            self.beside(row + side, side, self.table[n, column + side], 0, 1.0)

    @cfunc
    def joints(self, share: double, slopes: bint) -> bint:
        """Crank pin, coupler pin and body point at a part of the used interval, into ``joint``; False where it is open."""
        loop = self.loop
        if not loop.turn(self.first + share * (self.last - self.first), slopes):
            return False
        crank, coupler = loop.e1 * self.turned, loop.e2 * self.turned
        arm = loop.length[0] * crank
        for k in range(1, 4):
            rod = loop.length[1] * coupler if k == 2 else self.body * loop.e2 if k == 3 else 0j
            self.joint[k] = self.pivot + arm + rod
            if not slopes:
                continue
            # theta2 turns the rod
            for c in range(4):
                self.joint_by[k, c] = 1j * rod * loop.by[c]
            along = 1j * (arm + rod * loop.by[4])
            self.joint_by[k, 0] = self.joint_by[k, 0] + crank
            self.joint_by[k, BY_FIRST] = (1.0 - share) * along
            self.joint_by[k, BY_LAST] = share * along
            self.joint_by[k, BY_PIVOT] = 1.0
            self.joint_by[k, BY_PIVOT + 1] = 1j
            self.joint_by[k, BY_TURNED] = 1j * (arm if k == 3 else arm + rod)
            if k == 2:
                self.joint_by[k, 1] = self.joint_by[k, 1] + coupler
            elif k == 3:
                self.joint_by[k, BY_BODY] = loop.e2
                self.joint_by[k, BY_BODY + 1] = 1j * loop.e2
        return True

    @cfunc
    def envelope(self, row: cython.int, n: Py_ssize_t):
        """Both pivots within a box, and each joint where it goes farthest to each side."""
        traced = cython.cast(cython.int, self.table[n, 5])
        refinements = cython.cast(cython.int, self.table[n, 6])
        closes: bint = True
        for pivot in range(2):
            self.fixed(pivot)
            self.within(row + 4 * pivot, n, 1)
        for t in range(traced):
            closes = closes and self.joints(t * (1.0 / (traced - 1)), False)
            for k in range(12):
                self.trace[k, t] = depth(self.joint[1 + k // 4], k % 4, 0.0)
        for k in range(12):
            if closes and self.joints(self.farthest(k // 4 + 1, k % 4, traced, refinements), True):
                self.beside(row + 8 + k, k % 4, self.table[n, 1 + k % 4], 1 + k // 4, 1.0)
            else:
                self.values[row + 8 + k] = NAN

    @cfunc
    def farthest(self, k: cython.int, side: cython.int, traced: cython.int, refinements: cython.int) -> double:
        """Where in the used interval a joint goes farthest to a side."""
        row, best, step = 4 * (k - 1) + side, 0, 1.0 / (traced - 1)
        for t in range(1, traced):
            if self.trace[row, t] < self.trace[row, best]:
                best = t
        best = min(max(best, 1), traced - 2)
        at = vertex(best * step, self.trace[row, best - 1], self.trace[row, best], self.trace[row, best + 1], step)
        for _ in range(refinements):
            step /= 8.0
            at = min(max(at, step), 1.0 - step)
            before = self.depth_at(at - step, k, side)
            here = self.depth_at(at, k, side)
            at = vertex(at, before, here, self.depth_at(at + step, k, side), step)
        return at

    @cfunc
    def depth_at(self, share: double, k: cython.int, side: cython.int) -> double:
        """How far a joint is from going beyond a side at a part of the used interval."""
        return depth(self.joint[k], side, 0.0) if self.joints(share, False) else 0.0
