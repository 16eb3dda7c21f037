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
from cython.cimports.synthesis.kernels.plane import clip, depth_inside, inner, vector

from synthesis.kernels.codes import COUNTS

PI = declare(double, 3.141592653589793)
TURN = declare(double, 6.283185307179586)
NAN = declare(double, float("nan"))


@cfunc
def vertex(middle: double, before: double, here: double, after: double, step: double) -> double:
    """Locate the minimum of the parabola through three equidistant values, at most one step away and within 0..1."""
    bend = before - 2.0 * here + after
    if bend > 0.0:
        part = clip(0.5 * (before - after) / bend, 1.0)
    elif before == after:
        part = 0.0
    else:
        part = 1.0 if before > after else -1.0
    return min(max(middle + step * part, 0.0), 1.0)


@final
@cclass
class Limits:
    """Limits of a request as functions of a placed linkage; a value of at least 0 satisfies the limit.

    Parameters
    ----------
    table : ndarray, shape (K, 8)
        Code and numbers of each limit, see `codes`.
    has_pose : bool
        Whether the linkage is placed. Otherwise lengths are relative to the ground link.
    equations : sequence of bool
        Which rows are equations.
    """

    def __init__(self, table, has_pose, equations=()):
        table = np.ascontiguousarray(table, dtype=float).reshape(-1, 8)
        counts = [COUNTS[int(row[0])] for row in table]
        self.table = table
        self.first_rows = np.cumsum([0, *counts]).astype(np.intc)
        self.rows = sum(counts)
        self.has_pose = has_pose
        self.equations = np.array(equations if len(equations) else np.zeros(self.rows + 1), dtype=np.intc)
        self.values = np.zeros(self.rows + 1)
        self.slopes = np.zeros((self.rows + 1, COLUMNS))
        self.loop = Loop()
        self.excess = np.zeros(3)
        self.joints = np.zeros(4, dtype=complex)
        self.joint_slopes = np.zeros((4, COLUMNS), dtype=complex)
        self.trace = np.zeros((12, max([3] + [int(row[5]) for row in table if row[0] == ENVELOPE])))

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
        """Evaluate the limits of linkages.

        Parameters
        ----------
        lengths : ndarray, shape (n, 4)
        branch, first, last, turned : ndarray, shape (n,)
            Branch, first and last crank angle, angle of the ground link.
        pivot, body : ndarray, shape (n, 2)
            Pivot A and z2.
        derivatives : bool

        Returns
        -------
        values : ndarray, shape (n, C)
            NaN if the linkage does not close.
        slopes : ndarray, shape (n, C, 11)
            Derivatives by the columns of `codes`.
        """
        count = lengths.shape[0]
        values, slopes = np.empty((count, self.rows)), np.empty((count if derivatives else 0, self.rows, COLUMNS))
        value: double[:, ::1] = values
        slope: double[:, :, ::1] = slopes
        for n in range(count):
            self.loop.branch = branch[n]
            self.loop.set_lengths(lengths[n, 0], lengths[n, 1], lengths[n, 2], lengths[n, 3])
            at, arm = vector(pivot[n, 0], pivot[n, 1]), vector(body[n, 0], body[n, 1])
            self.evaluate(first[n], last[n], at, vector(cos(turned[n]), sin(turned[n])), arm)
            for row in range(self.rows):
                value[n, row] = self.values[row]
                if derivatives:
                    for c in range(COLUMNS):
                        slope[n, row, c] = self.slopes[row, c]
        return values, slopes

    @cfunc
    def evaluate(self, first: double, last: double, pivot: doublecomplex, turned: doublecomplex, body: doublecomplex):
        """Fill ``values`` and ``slopes`` for the linkage in ``loop``, placed by the arguments."""
        self.first_angle = first
        self.last_angle = last
        self.pivot = pivot
        self.ground_direction = turned
        self.body_arm = body
        for row in range(self.rows):
            for c in range(COLUMNS):
                self.slopes[row, c] = 0.0
        for n in range(self.table.shape[0]):
            kind = cython.cast(cython.int, self.table[n, 0])
            begin = self.first_rows[n]
            if kind == USED:
                self.used_transmission_rows(begin, self.table[n, 1])
            elif kind == OVER_TURN:
                self.turn_transmission_rows(begin, self.table[n, 1], self.table[n, 2] > 0.0)
            elif kind == LENGTH:
                self.length_row(begin, cython.cast(cython.int, self.table[n, 1]), self.table[n, 2], self.table[n, 3])
            elif kind == RATIO:
                self.ratio_rows(begin, self.table[n, 1])
            elif kind == RATIOS:
                self.log_ratio_rows(begin, self.table[n, 1])
            elif kind == FAMILY:
                self.family_rows(begin, self.table[n, 1])
            elif kind == ENVELOPE:
                self.envelope_rows(begin, n)
            else:
                self.point_rows(begin, kind, n)

    @cfunc
    def transmission_row(self, row: cython.int, cosine_max: double, at: double, sign: double) -> double:
        """Fill one row of the transmission angle at a crank angle. Return the derivative with respect to that angle."""
        l1, l2, l3, l4 = self.loop.length[0], self.loop.length[1], self.loop.length[2], self.loop.length[3]
        sine, cosine, product = sin(0.5 * at), cos(at), l2 * l3
        square = (l4 - l1) * (l4 - l1) + 4.0 * l1 * l4 * (sine * sine)
        ratio = (l2 * l2 + l3 * l3 - square) / (2.0 * product)
        self.slopes[row, 0] = -sign * (l4 * cosine - l1) / product
        self.slopes[row, 1] = -sign * (1.0 / l3 - ratio / l2)
        self.slopes[row, 2] = -sign * (1.0 / l2 - ratio / l3)
        self.slopes[row, 3] = -sign * (l1 * cosine - l4) / product
        self.values[row] = cosine_max - sign * ratio
        return sign * l1 * l4 * sin(at) / product

    @cfunc
    def used_transmission_rows(self, row: cython.int, cosine_max: double):
        """Fill the rows at the shortest and the longest diagonal within the used interval."""
        first, last = min(self.first_angle, self.last_angle), max(self.first_angle, self.last_angle)
        for k in range(2):
            folded = PI * k
            at = folded + TURN * rint((0.5 * (first + last) - folded) / TURN)
            at = min(max(at, first), last)
            by_angle = self.transmission_row(row + k, cosine_max, at, 1.0 - 2.0 * k)
            if at <= first:
                self.slopes[row + k, BY_FIRST] = by_angle
            if at >= last:
                self.slopes[row + k, BY_LAST] = by_angle

    @cfunc
    def turn_transmission_rows(self, row: cython.int, cosine_max: double, always: bint):
        """Fill the rows at the shortest and the longest diagonal over a whole turn."""
        if not always:
            self.update_excesses()
            always = self.excess[2] > 0.0 and self.excess[0] * self.excess[1] > 0.0
        for k in range(2):
            if always:
                self.transmission_row(row + k, cosine_max, PI * k, 1.0 - 2.0 * k)
            else:
                self.values[row + k] = 1.0

    @cfunc
    def update_excesses(self):
        """Compute the three excesses of `four_bar`."""
        l1, l2, l3, l4 = self.loop.length[0], self.loop.length[1], self.loop.length[2], self.loop.length[3]
        self.excess[0] = pair_difference(l2, l4, l1, l3)
        self.excess[1] = pair_difference(l3, l4, l1, l2)
        self.excess[2] = pair_difference(l2, l3, l1, l4)

    @cfunc
    def length_row(self, row: cython.int, link: cython.int, sign: double, constant: double):
        """Fill the row of a bound on a length."""
        self.slopes[row, link] = sign
        if self.has_pose:
            self.values[row] = sign * self.loop.length[link] + constant
        else:
            self.values[row] = sign * self.loop.length[link] + constant * self.loop.length[3]
            self.slopes[row, 3] += constant

    @cfunc
    def perimeter(self) -> double:
        """Return the sum of the lengths."""
        return self.loop.length[0] + self.loop.length[1] + self.loop.length[2] + self.loop.length[3]

    @cfunc
    def ratio_rows(self, row: cython.int, ratio_max: double):
        """Fill the rows of the length ratio, relative to the perimeter, whose derivative vanishes at the limit."""
        shortest, size = 0, self.perimeter()
        for k in range(1, 4):
            if self.loop.length[k] < self.loop.length[shortest]:
                shortest = k
        for k in range(4):
            self.values[row + k] = (ratio_max * self.loop.length[shortest] - self.loop.length[k]) / size
            self.slopes[row + k, shortest] = ratio_max / size
            self.slopes[row + k, k] -= 1.0 / size

    @cfunc
    def log_ratio_rows(self, row: cython.int, ratio_max: double):
        """Fill one row for each pair of lengths: the logarithm of their ratio is at most the logarithm of the limit."""
        for long in range(4):
            for short in range(4):
                if long != short:
                    self.values[row] = log(ratio_max) - log(self.loop.length[long]) + log(self.loop.length[short])
                    self.slopes[row, long] = -1.0 / self.loop.length[long]
                    self.slopes[row, short] = 1.0 / self.loop.length[short]
                    row += 1

    @cfunc
    def family_rows(self, row: cython.int, sign: double):
        """Fill the rows of the signs of the three excesses, relative to the perimeter."""
        size = self.perimeter()
        if sign == 0.0:
            sign = -1.0 if self.loop.length[0] > self.loop.length[3] else 1.0
        self.update_excesses()
        for k in range(3):
            own = 1.0 if k == 2 else sign
            value = own * self.excess[k] / size
            self.values[row + k] = value
            for c in range(4):
                # (L2 + L4) - (L1 + L3), (L3 + L4) - (L1 + L2), (L2 + L3) - (L1 + L4)
                less: bint = c == 0 or c == (3 if k == 2 else 2 - k)
                self.slopes[row + k, c] = ((-own if less else own) - value) / size

    @cfunc
    def locate_fixed_point(self, point: cython.int):
        """Compute a pivot, or the body point seen from a coupler joint, and its derivatives, as the first joint."""
        for c in range(COLUMNS):
            self.joint_slopes[0, c] = 0.0
        if point == BODY or point == BODY_FROM_ROCKER:
            self.joints[0] = self.body_arm
            self.joint_slopes[0, BY_BODY] = 1.0
            self.joint_slopes[0, BY_BODY + 1] = 1j
            if point == BODY_FROM_ROCKER:
                # z2 contains the ground angle
                self.joints[0] = self.body_arm - self.loop.length[1] * self.ground_direction
                self.joint_slopes[0, 1] = -self.ground_direction
                self.joint_slopes[0, BY_TURNED] = -1j * self.loop.length[1] * self.ground_direction
            return
        self.joints[0] = self.pivot
        self.joint_slopes[0, BY_PIVOT] = 1.0
        self.joint_slopes[0, BY_PIVOT + 1] = 1j
        if point == PIVOT_B:
            ground = self.loop.length[3] * self.ground_direction
            self.joints[0] = self.pivot + ground
            self.joint_slopes[0, 3] = self.ground_direction
            self.joint_slopes[0, BY_TURNED] = 1j * ground

    @cfunc
    def point_rows(self, row: cython.int, kind: cython.int, n: Py_ssize_t):
        """Fill the rows of a limit on a pivot, or on the body point seen from a coupler joint."""
        self.locate_fixed_point(cython.cast(cython.int, self.table[n, 1]))
        if kind == AT:
            for axis in range(2):
                self.side_row(row + axis, axis, self.table[n, 2 + axis], 0, 1.0)
        elif kind == NEAR:
            gap = self.joints[0] - vector(self.table[n, 2], self.table[n, 3])
            away = sqrt(inner(gap, gap))
            self.values[row] = self.table[n, 4] - away
            if away > 0.0:
                for c in range(COLUMNS):
                    self.slopes[row, c] = -inner(gap, self.joint_slopes[0, c]) / away
        elif kind == INSIDE:
            self.box_rows(row, n, 2)
        else:
            nearest = 0
            for side in range(1, 4):
                depth = depth_inside(self.joints[0], side, self.table[n, 2 + side])
                if depth < depth_inside(self.joints[0], nearest, self.table[n, 2 + nearest]):
                    nearest = side
            self.side_row(row, nearest, self.table[n, 2 + nearest], 0, -1.0)

    @cfunc
    def side_row(self, row: cython.int, side: cython.int, edge: double, k: cython.int, sign: double):
        """Fill the row of a joint's distance from one side of a box, times a sign."""
        self.values[row] = sign * depth_inside(self.joints[k], side, edge)
        for c in range(COLUMNS):
            self.slopes[row, c] = sign * depth_inside(self.joint_slopes[k, c], side, 0.0)

    @cfunc
    def box_rows(self, row: cython.int, n: Py_ssize_t, column: cython.int):
        """Fill the rows that keep the first joint inside the box whose numbers begin at a column."""
        for side in range(4):
            self.side_row(row + side, side, self.table[n, column + side], 0, 1.0)

    @cfunc
    def locate_joints(self, share: double, slopes: bint) -> bint:
        """Compute crank pin, coupler pin and body point at a fraction of the used interval. Return False if the loop is open."""
        loop = self.loop
        if not loop.close_at(self.first_angle + share * (self.last_angle - self.first_angle), slopes):
            return False
        crank, coupler = loop.e1 * self.ground_direction, loop.e2 * self.ground_direction
        arm = loop.length[0] * crank
        for k in range(1, 4):
            rod = loop.length[1] * coupler if k == 2 else self.body_arm * loop.e2 if k == 3 else 0j
            self.joints[k] = self.pivot + arm + rod
            if not slopes:
                continue
            # theta2 rotates the rod
            for c in range(4):
                self.joint_slopes[k, c] = 1j * rod * loop.partials[c]
            along = 1j * (arm + rod * loop.partials[4])
            self.joint_slopes[k, 0] = self.joint_slopes[k, 0] + crank
            self.joint_slopes[k, BY_FIRST] = (1.0 - share) * along
            self.joint_slopes[k, BY_LAST] = share * along
            self.joint_slopes[k, BY_PIVOT] = 1.0
            self.joint_slopes[k, BY_PIVOT + 1] = 1j
            self.joint_slopes[k, BY_TURNED] = 1j * (arm if k == 3 else arm + rod)
            if k == 2:
                self.joint_slopes[k, 1] = self.joint_slopes[k, 1] + coupler
            elif k == 3:
                self.joint_slopes[k, BY_BODY] = loop.e2
                self.joint_slopes[k, BY_BODY + 1] = 1j * loop.e2
        return True

    @cfunc
    def envelope_rows(self, row: cython.int, n: Py_ssize_t):
        """Fill the rows that keep both pivots, and the extreme position of each joint on each side, inside a box."""
        traced = cython.cast(cython.int, self.table[n, 5])
        refinements = cython.cast(cython.int, self.table[n, 6])
        closes: bint = True
        for pivot in range(2):
            self.locate_fixed_point(pivot)
            self.box_rows(row + 4 * pivot, n, 1)
        for t in range(traced):
            closes = closes and self.locate_joints(t * (1.0 / (traced - 1)), False)
            for k in range(12):
                self.trace[k, t] = depth_inside(self.joints[1 + k // 4], k % 4, 0.0)
        for k in range(12):
            if closes and self.locate_joints(self.find_farthest(k // 4 + 1, k % 4, traced, refinements), True):
                self.side_row(row + 8 + k, k % 4, self.table[n, 1 + k % 4], 1 + k // 4, 1.0)
            else:
                self.values[row + 8 + k] = NAN

    @cfunc
    def find_farthest(self, k: cython.int, side: cython.int, traced: cython.int, refinements: cython.int) -> double:
        """Return the fraction of the used interval at which a joint is farthest towards a side."""
        row, best, step = 4 * (k - 1) + side, 0, 1.0 / (traced - 1)
        for t in range(1, traced):
            if self.trace[row, t] < self.trace[row, best]:
                best = t
        best = min(max(best, 1), traced - 2)
        at = vertex(best * step, self.trace[row, best - 1], self.trace[row, best], self.trace[row, best + 1], step)
        for _ in range(refinements):
            step /= 8.0
            at = min(max(at, step), 1.0 - step)
            before = self.depth_of_joint(at - step, k, side)
            here = self.depth_of_joint(at, k, side)
            at = vertex(at, before, here, self.depth_of_joint(at + step, k, side), step)
        return at

    @cfunc
    def depth_of_joint(self, share: double, k: cython.int, side: cython.int) -> double:
        """Return a joint's coordinate towards a side at a fraction of the used interval; 0 if the loop is open."""
        return depth_inside(self.joints[k], side, 0.0) if self.locate_joints(share, False) else 0.0
