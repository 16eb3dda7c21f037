"""Where a search spends its time, compiled: the loop of a four-bar, the limits as functions, and the descent of candidates.

Written in Cython's pure Python mode: it is compiled when the package is installed, and runs uncompiled as well, slowly, which is
how its tests check the compiled library. Arrays come in contiguous and of floats; what they mean is said by `free.joint` and
`fourbar.limits`, which are the doors to it.

A descent works on one candidate after the other, without allocating. Rows are kept by column of the Jacobian, each contiguous
over part (rotation, x, y) and sample, then the rows of broken limits: ``m[set, column, part * N + sample]``, the residual in the
last column. There are two sets, of where a candidate stands and of where its step leads; they change places when a step is taken,
so that a refused one evaluates nothing again. The third is for a look ahead.
"""

import cython
import numpy as np
from cython.cimports.libc.math import atan2, copysign, cos, exp, fabs, floor, isfinite, log, rint, sin, sqrt

PI = cython.declare(cython.double, 3.141592653589793)
TURN = cython.declare(cython.double, 6.283185307179586)

# -- the loop of a four-bar ------------------------------------------------------------------------------------------


@cython.cfunc
@cython.inline
@cython.exceptval(check=False)
def pair_difference(a: cython.double, b: cython.double, c: cython.double, d: cython.double) -> cython.double:
    """(a + b) - (c + d) to nearly full relative accuracy (Knuth, TAOCP vol. 2, 4.2.2, theorem B)."""
    left: cython.double = a + b
    part: cython.double = left - a
    left_error: cython.double = (a - (left - part)) + (b - part)
    right: cython.double = c + d
    part = right - c
    right_error: cython.double = (c - (right - part)) + (d - part)
    return (left - right) + (left_error - right_error)


@cython.final
@cython.cclass
class Loop:
    """A linkage at a crank angle, whose coupler is guided in one of two ways.

    On a circle (guide 0), a four-bar: L1..L4, and X0, Y0 of the closure (see `fourbar.kinematics`). On a line through its own
    point at distance l2 from the crank pin (guide 1), a slider-crank: crank l1, rod l2, offset l3, sin theta2 =
    (l3 - l1 sin theta1) / l2.
    """

    guide: cython.int
    l1: cython.double
    l2: cython.double
    l3: cython.double
    l4: cython.double
    x0: cython.double
    y0: cython.double
    side: cython.double
    cos1: cython.double
    sin1: cython.double
    cos2: cython.double
    sin2: cython.double
    root: cython.double
    square: cython.double
    both: cython.double
    across: cython.double
    by_l1: cython.double
    by_l2: cython.double
    by_l3: cython.double
    by_l4: cython.double
    by_crank: cython.double

    @cython.cfunc
    @cython.exceptval(check=False)
    def of_lengths(
        self, l1: cython.double, l2: cython.double, l3: cython.double, l4: cython.double, side: cython.double
    ) -> cython.void:
        """Take lengths."""
        self.l1 = l1
        self.l2 = l2
        self.l3 = l3
        self.l4 = l4
        self.side = side
        self.x0 = pair_difference(l2, l3, l1, l4) * (l1 + l2 + l3 + l4)
        self.y0 = pair_difference(l2, l4, l1, l3) * pair_difference(l3, l4, l1, l2)

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def turn(self, theta1: cython.double) -> cython.bint:
        """Crank and coupler directions at a crank angle; False where the loop does not close."""
        if self.guide == 1:
            return self.slide(theta1)
        s: cython.double = sin(0.5 * theta1)
        c: cython.double = cos(0.5 * theta1)
        square: cython.double = s * s
        both: cython.double = s * c
        four: cython.double = 4.0 * self.l1 * self.l4
        reach: cython.double = four * square
        x: cython.double = self.x0 + four * (c * c)
        y: cython.double = self.y0 + reach
        if not (x > 0.0 and y > 0.0):
            return False
        gap: cython.double = self.l4 - self.l1
        root: cython.double = sqrt(x * y)
        # e^{i theta2} is (B - D) (C + i side root) to its direction; B - D in the form in which nothing cancels
        across: cython.double = gap * gap + reach + (self.l2 - self.l3) * (self.l2 + self.l3)
        up: cython.double = self.side * root
        vx: cython.double
        vy: cython.double
        self.cos1 = 1.0 - 2.0 * square
        self.sin1 = 2.0 * both
        if gap >= 0.0:
            vx = gap + 2.0 * self.l1 * square
            vy = -2.0 * self.l1 * both
        else:
            wx: cython.double = gap - 2.0 * self.l4 * square
            wy: cython.double = -2.0 * self.l4 * both
            vx = self.cos1 * wx - self.sin1 * wy
            vy = self.sin1 * wx + self.cos1 * wy
        ex: cython.double = vx * across - vy * up
        ey: cython.double = vx * up + vy * across
        size: cython.double = sqrt(ex * ex + ey * ey)
        if not size > 0.0:
            return False
        self.cos2 = ex / size
        self.sin2 = ey / size
        self.root = root
        self.square = square
        self.both = both
        self.across = across
        return True

    @cython.cfunc
    @cython.exceptval(check=False)
    def slide(self, theta1: cython.double) -> cython.bint:
        """The same of a slider-crank."""
        self.cos1 = cos(theta1)
        self.sin1 = sin(theta1)
        self.sin2 = (self.l3 - self.l1 * self.sin1) / self.l2
        square: cython.double = (1.0 - self.sin2) * (1.0 + self.sin2)
        if not square > 0.0:
            return False
        self.cos2 = sqrt(square)
        return True

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def angle(self, theta1: cython.double) -> cython.double:
        """theta2 where the loop was turned to, continuous over the turn."""
        if self.guide == 1:
            return atan2(self.sin2, self.cos2)
        gap: cython.double = self.l4 - self.l1
        twice: cython.double = 2.0 * min(self.l1, self.l4)
        angle: cython.double = self.side * atan2(self.root, self.across)
        angle += atan2(copysign(twice, -gap) * self.both, fabs(gap) + twice * self.square)
        return angle if gap >= 0.0 else angle + theta1 - PI

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def slopes(self) -> cython.void:
        """Derivatives of theta2 by the lengths and theta1, where the loop was turned to."""
        if self.guide == 1:
            rod: cython.double = self.l2 * self.cos2
            self.by_l1 = -self.sin1 / rod
            self.by_l2 = -self.sin2 / rod
            self.by_l3 = 1.0 / rod
            self.by_l4 = 0.0
            self.by_crank = -self.l1 * self.cos1 / rod
            return
        cos3: cython.double = (self.l1 * self.cos1 + self.l2 * self.cos2 - self.l4) / self.l3
        sin3: cython.double = (self.l1 * self.sin1 + self.l2 * self.sin2) / self.l3
        # one over L2 sin(theta2 - theta3); bounded, so that a dead position stops a step and not the program
        lever: cython.double = -2.0 * self.side * self.l3 / max(self.root, 1e-8)
        self.by_l1 = lever * (self.cos1 * cos3 + self.sin1 * sin3)
        self.by_l2 = lever * (self.cos2 * cos3 + self.sin2 * sin3)
        self.by_l3 = -lever
        self.by_l4 = -lever * cos3
        self.by_crank = lever * self.l1 * (sin3 * self.cos1 - cos3 * self.sin1)


# -- limits ----------------------------------------------------------------------------------------------------------

USED, OVER_TURN, LENGTH, RATIO, RATIOS, FAMILY, AT, NEAR, INSIDE, OUTSIDE, ENVELOPE = range(11)
"""Kinds of limits; the columns behind the kind in a table of limits:

USED            cosine of the least transmission angle over the used interval
OVER_TURN       the same over the turn; 1: of every linkage, 0: of those whose crank turns fully
LENGTH          link, sign, rest: sign times the length, and the rest, is at least 0 (or 0)
RATIO           the shortest length times this is at least each other
RATIOS          the same, pair by pair, in logarithms
FAMILY          signs of the excesses (0: those of any full crank)
AT              point, x, y: the point is there
NEAR            point, x, y, distance
INSIDE          point, xmin, ymin, xmax, ymax
OUTSIDE         the same: beyond the side that is nearest
ENVELOPE        xmin, ymin, xmax, ymax, places traced, refinements: all joints and the body point, over the used interval

Points are 0: pivot A, 1: pivot B, 2: z2, the body point from the crank pin.
"""
COUNTS = (2, 2, 1, 4, 12, 3, 2, 1, 4, 1, 20)
"""Rows of each kind."""
COLUMNS = 11
"""Derivatives: by four lengths, the first and the last crank angle, A (x, y), the ground angle, z2 (x, y)."""


@cython.final
@cython.cclass
class Limits:
    """The limits of a request as functions of a linkage in its place, at least 0 where they are kept.

    Parameters
    ----------
    table : ndarray, shape (K, 8)
        Kind and numbers of each.
    posed : bool
        Whether there is a pose; without one lengths count over the ground.
    """

    table: cython.double[:, ::1]
    posed: cython.bint
    count: cython.int
    rows: cython.int
    values: cython.double[::1]
    slopes: cython.double[:, ::1]
    loop: Loop
    used_first: cython.double
    used_last: cython.double
    ax: cython.double
    ay: cython.double
    zx: cython.double
    zy: cython.double
    cos_turned: cython.double
    sin_turned: cython.double
    joint: cython.double[:, ::1]
    joint_slopes: cython.double[:, :, ::1]
    trace: cython.double[:, ::1]
    excess: cython.double[::1]
    equal: cython.int[::1]

    def __init__(self, table, posed, equal=()):
        self.table = np.ascontiguousarray(table, dtype=float).reshape(-1, 8)
        self.count = self.table.shape[0]
        self.posed = posed
        self.rows = sum(COUNTS[int(row[0])] for row in np.asarray(self.table))
        self.values = np.zeros(max(1, self.rows))
        self.slopes = np.zeros((max(1, self.rows), COLUMNS))
        self.loop = Loop()
        self.joint = np.zeros((3, 2))
        self.joint_slopes = np.zeros((3, 2, COLUMNS))
        traced = [int(row[5]) for row in np.asarray(self.table) if row[0] == ENVELOPE]
        self.trace = np.zeros((12, max(3, *traced, 3)))
        self.excess = np.zeros(3)
        self.equal = np.zeros(max(1, self.rows), dtype=np.intc)
        for row in np.flatnonzero(equal):
            self.equal[row] = 1

    @property
    def count_rows(self):
        """Rows of all limits."""
        return self.rows

    def __call__(self, lengths, branch, first, last, pivot, turned, coupler):
        """Values (n, C) and derivatives (n, C, 11) at linkages; NaN where one does not close.

        Lengths (n, 4), branch, first and last crank angle (n,), pivot (n, 2), ground angle (n,), z2 (n, 2).
        """
        n: cython.Py_ssize_t
        k: cython.Py_ssize_t
        c: cython.Py_ssize_t
        rows: cython.double[:, ::1] = lengths
        sides: cython.double[::1] = branch
        begin: cython.double[::1] = first
        end: cython.double[::1] = last
        a: cython.double[:, ::1] = pivot
        t: cython.double[::1] = turned
        z: cython.double[:, ::1] = coupler
        count: cython.Py_ssize_t = rows.shape[0]
        values = np.empty((count, self.rows))
        slopes = np.empty((count, self.rows, COLUMNS))
        out: cython.double[:, :] = values
        by: cython.double[:, :, :] = slopes
        for n in range(count):
            self.loop.of_lengths(rows[n, 0], rows[n, 1], rows[n, 2], rows[n, 3], sides[n])
            self.at(begin[n], end[n], a[n, 0], a[n, 1], cos(t[n]), sin(t[n]), z[n, 0], z[n, 1])
            for k in range(self.rows):
                out[n, k] = self.values[k]
                for c in range(COLUMNS):
                    by[n, k, c] = self.slopes[k, c]
        return values, slopes

    @cython.cfunc
    @cython.exceptval(check=False)
    def at(
        self,
        begin: cython.double,
        end: cython.double,
        ax: cython.double,
        ay: cython.double,
        cos_turned: cython.double,
        sin_turned: cython.double,
        zx: cython.double,
        zy: cython.double,
    ) -> cython.void:
        """Values and derivatives of the linkage in ``loop`` at a place, into ``values`` and ``slopes``."""
        k: cython.Py_ssize_t
        c: cython.Py_ssize_t
        n: cython.Py_ssize_t
        row: cython.int = 0
        kind: cython.int
        self.used_first = begin
        self.used_last = end
        self.ax = ax
        self.ay = ay
        self.zx = zx
        self.zy = zy
        self.cos_turned = cos_turned
        self.sin_turned = sin_turned
        for k in range(self.rows):
            for c in range(11):
                self.slopes[k, c] = 0.0
        for n in range(self.count):
            kind = cython.cast(cython.int, self.table[n, 0])
            if kind == 0:
                row = self.used_transmission(row, self.table[n, 1])
            elif kind == 1:
                row = self.turn_transmission(row, self.table[n, 1], self.table[n, 2] > 0.0)
            elif kind == 2:
                row = self.length(row, cython.cast(cython.int, self.table[n, 1]), self.table[n, 2], self.table[n, 3])
            elif kind == 3:
                row = self.ratio(row, self.table[n, 1])
            elif kind == 4:
                row = self.ratios(row, self.table[n, 1])
            elif kind == 5:
                row = self.family(row, self.table[n, 1])
            elif kind == 10:
                row = self.envelope(row, n)
            else:
                row = self.place(row, kind, n)

    @cython.cfunc
    @cython.exceptval(check=False)
    def transmission(
        self, row: cython.int, least: cython.double, at: cython.double, sign: cython.double
    ) -> cython.double:
        """One row of a transmission angle at a crank angle; returns its derivative by that angle."""
        l1: cython.double = self.loop.l1
        l2: cython.double = self.loop.l2
        l3: cython.double = self.loop.l3
        l4: cython.double = self.loop.l4
        sine: cython.double = sin(0.5 * at)
        cosine: cython.double = cos(at)
        square: cython.double = (l4 - l1) * (l4 - l1) + 4.0 * l1 * l4 * (sine * sine)
        product: cython.double = l2 * l3
        ratio: cython.double = (l2 * l2 + l3 * l3 - square) / (2.0 * product)
        self.slopes[row, 0] = -sign * (l4 * cosine - l1) / product
        self.slopes[row, 3] = -sign * (l1 * cosine - l4) / product
        self.slopes[row, 1] = -sign * (1.0 / l3 - ratio / l2)
        self.slopes[row, 2] = -sign * (1.0 / l2 - ratio / l3)
        self.values[row] = least - sign * ratio
        return sign * l1 * l4 * sin(at) / product

    @cython.cfunc
    @cython.exceptval(check=False)
    def used_transmission(self, row: cython.int, least: cython.double) -> cython.int:
        """Where the diagonal is shortest and longest within the used interval."""
        first: cython.double = min(self.used_first, self.used_last)
        last: cython.double = max(self.used_first, self.used_last)
        middle: cython.double = 0.5 * (first + last)
        k: cython.int
        for k in range(2):
            folded: cython.double = PI * k
            at: cython.double = folded + TURN * rint((middle - folded) / TURN)
            at = min(max(at, first), last)
            by_angle: cython.double = self.transmission(row, least, at, 1.0 - 2.0 * k)
            if at <= first:
                self.slopes[row, 4] = by_angle
            if at >= last:
                self.slopes[row, 5] = by_angle
            row += 1
        return row

    @cython.cfunc
    @cython.exceptval(check=False)
    def turn_transmission(self, row: cython.int, least: cython.double, every: cython.bint) -> cython.int:
        """Where the diagonal is shortest and longest over the turn."""
        k: cython.int
        c: cython.int
        if not every:
            self.excesses()
            a: cython.double = self.excess[0]
            b: cython.double = self.excess[1]
            every = self.excess[2] > 0.0 and ((a > 0.0 and b > 0.0) or (a < 0.0 and b < 0.0))
        for k in range(2):
            self.transmission(row, least, PI * k, 1.0 - 2.0 * k)
            if not every:
                self.values[row] = 1.0
                for c in range(4):
                    self.slopes[row, c] = 0.0
            row += 1
        return row

    @cython.cfunc
    @cython.exceptval(check=False)
    def excesses(self) -> cython.void:
        """The three excesses of `fourbar.kinematics`."""
        l1: cython.double = self.loop.l1
        l2: cython.double = self.loop.l2
        l3: cython.double = self.loop.l3
        l4: cython.double = self.loop.l4
        self.excess[0] = pair_difference(l2, l4, l1, l3)
        self.excess[1] = pair_difference(l3, l4, l1, l2)
        self.excess[2] = pair_difference(l2, l3, l1, l4)

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def link(self, k: cython.int) -> cython.double:
        """A length."""
        if k == 0:
            return self.loop.l1
        if k == 1:
            return self.loop.l2
        if k == 2:
            return self.loop.l3
        return self.loop.l4

    @cython.cfunc
    @cython.exceptval(check=False)
    def length(self, row: cython.int, link: cython.int, sign: cython.double, rest: cython.double) -> cython.int:
        """A length's bound."""
        self.slopes[row, link] = sign
        if self.posed:
            self.values[row] = sign * self.link(link) + rest
        else:
            self.values[row] = sign * self.link(link) + rest * self.loop.l4
            self.slopes[row, 3] += rest
        return row + 1

    @cython.cfunc
    @cython.exceptval(check=False)
    def ratio(self, row: cython.int, most: cython.double) -> cython.int:
        """Over the perimeter, whose change does not matter where the constraint holds."""
        k: cython.int
        shortest: cython.int = 0
        size: cython.double = self.loop.l1 + self.loop.l2 + self.loop.l3 + self.loop.l4
        for k in range(1, 4):
            if self.link(k) < self.link(shortest):
                shortest = k
        for k in range(4):
            self.values[row] = (most * self.link(shortest) - self.link(k)) / size
            self.slopes[row, shortest] = most / size
            self.slopes[row, k] -= 1.0 / size
            row += 1
        return row

    @cython.cfunc
    @cython.exceptval(check=False)
    def ratios(self, row: cython.int, most: cython.double) -> cython.int:
        """The logarithm of no length is above that of another by more than that of the ratio."""
        long: cython.int
        short: cython.int
        for long in range(4):
            for short in range(4):
                if long != short:
                    self.values[row] = log(most) - log(self.link(long)) + log(self.link(short))
                    self.slopes[row, long] = -1.0 / self.link(long)
                    self.slopes[row, short] = 1.0 / self.link(short)
                    row += 1
        return row

    @cython.cfunc
    @cython.exceptval(check=False)
    def family(self, row: cython.int, sign: cython.double) -> cython.int:
        """The signs of the three excesses, over the perimeter."""
        k: cython.int
        size: cython.double = self.loop.l1 + self.loop.l2 + self.loop.l3 + self.loop.l4
        if sign == 0.0:
            sign = -1.0 if self.loop.l1 > self.loop.l4 else 1.0
        total: cython.double = self.loop.l1 + self.loop.l2 + self.loop.l3 + self.loop.l4
        self.excesses()
        for k in range(3):
            own: cython.double = 1.0 if k == 2 else sign
            value: cython.double = own * self.excess[k] / total
            self.values[row] = value
            # (L2 + L4) - (L1 + L3), (L3 + L4) - (L1 + L2), (L2 + L3) - (L1 + L4)
            self.slopes[row, 0] = (-own - value) / size
            self.slopes[row, 1] = ((-own if k == 1 else own) - value) / size
            self.slopes[row, 2] = ((-own if k == 0 else own) - value) / size
            self.slopes[row, 3] = ((-own if k == 2 else own) - value) / size
            row += 1
        return row

    @cython.cfunc
    @cython.exceptval(check=False)
    def place(self, row: cython.int, kind: cython.int, n: cython.Py_ssize_t) -> cython.int:
        """Limits on pivot A, pivot B and the body point from the crank pin."""
        point: cython.int = cython.cast(cython.int, self.table[n, 1])
        c: cython.int
        x: cython.double
        y: cython.double
        l4: cython.double = self.loop.l4
        # joint_slopes[0] as room for the point's own
        for c in range(11):
            self.joint_slopes[0, 0, c] = 0.0
            self.joint_slopes[0, 1, c] = 0.0
        if point == 2:
            x = self.zx
            y = self.zy
            self.joint_slopes[0, 0, 9] = 1.0
            self.joint_slopes[0, 1, 10] = 1.0
        else:
            x = self.ax
            y = self.ay
            self.joint_slopes[0, 0, 6] = 1.0
            self.joint_slopes[0, 1, 7] = 1.0
            if point == 1:
                x += l4 * self.cos_turned
                y += l4 * self.sin_turned
                self.joint_slopes[0, 0, 3] = self.cos_turned
                self.joint_slopes[0, 1, 3] = self.sin_turned
                self.joint_slopes[0, 0, 8] = -l4 * self.sin_turned
                self.joint_slopes[0, 1, 8] = l4 * self.cos_turned
        p: cython.double = self.table[n, 2]
        q: cython.double = self.table[n, 3]
        if kind == 6:
            self.values[row] = x - p
            self.values[row + 1] = y - q
            for c in range(11):
                self.slopes[row, c] = self.joint_slopes[0, 0, c]
                self.slopes[row + 1, c] = self.joint_slopes[0, 1, c]
            return row + 2
        if kind == 7:
            gx: cython.double = x - p
            gy: cython.double = y - q
            away: cython.double = sqrt(gx * gx + gy * gy)
            self.values[row] = self.table[n, 4] - away
            if away > 0.0:
                for c in range(11):
                    self.slopes[row, c] = -(gx * self.joint_slopes[0, 0, c] + gy * self.joint_slopes[0, 1, c]) / away
            return row + 1
        side: cython.int
        if kind == 8:
            for side in range(4):
                self.beside(row, side, n, 2, x, y, 0, 1.0)
                row += 1
            return row
        nearest: cython.int = 0
        for side in range(4):
            self.beside(row, side, n, 2, x, y, 0, 1.0)
            self.trace[0, 0] = self.values[row]
            if side == 0 or self.trace[0, 0] < self.trace[0, 1]:
                self.trace[0, 1] = self.trace[0, 0]
                nearest = side
        self.beside(row, nearest, n, 2, x, y, 0, -1.0)
        return row + 1

    @cython.cfunc
    @cython.exceptval(check=False)
    def beside(
        self,
        row: cython.int,
        side: cython.int,
        n: cython.Py_ssize_t,
        column: cython.int,
        x: cython.double,
        y: cython.double,
        point: cython.int,
        sign: cython.double,
    ) -> cython.void:
        """How far inside of one side of a box a point is: left, lower, right, upper; times a sign."""
        c: cython.int
        axis: cython.int = side % 2
        way: cython.double = sign * (1.0 if side < 2 else -1.0)
        self.values[row] = way * ((y if axis else x) - self.table[n, column + side])
        for c in range(11):
            self.slopes[row, c] = way * self.joint_slopes[point, axis, c]

    @cython.cfunc
    @cython.exceptval(check=False)
    def joints(self, share: cython.double, slopes: cython.bint) -> cython.bint:
        """Crank pin, coupler pin and body point at a part of the used interval, into ``joint``; False where it is open."""
        k: cython.int
        c: cython.int
        theta1: cython.double = self.used_first + share * (self.used_last - self.used_first)
        loop: Loop = self.loop
        ct: cython.double = self.cos_turned
        st: cython.double = self.sin_turned
        if not loop.turn(theta1):
            return False
        # crank, coupler and body point arms, turned
        cx: cython.double = loop.cos1 * ct - loop.sin1 * st
        cy: cython.double = loop.cos1 * st + loop.sin1 * ct
        ex: cython.double = loop.cos2 * ct - loop.sin2 * st
        ey: cython.double = loop.cos2 * st + loop.sin2 * ct
        px: cython.double = loop.l1 * cx
        py: cython.double = loop.l1 * cy
        self.joint[0, 0] = self.ax + px
        self.joint[0, 1] = self.ay + py
        self.joint[1, 0] = self.ax + px + loop.l2 * ex
        self.joint[1, 1] = self.ay + py + loop.l2 * ey
        bx: cython.double = self.zx * loop.cos2 - self.zy * loop.sin2
        by: cython.double = self.zx * loop.sin2 + self.zy * loop.cos2
        self.joint[2, 0] = self.ax + px + bx
        self.joint[2, 1] = self.ay + py + by
        if not slopes:
            return True
        loop.slopes()
        for k in range(3):
            rx: cython.double = 0.0
            ry: cython.double = 0.0
            if k == 1:
                rx = loop.l2 * ex
                ry = loop.l2 * ey
            elif k == 2:
                rx = bx
                ry = by
            for c in range(11):
                self.joint_slopes[k, 0, c] = 0.0
                self.joint_slopes[k, 1, c] = 0.0
            self.joint_slopes[k, 0, 6] = 1.0
            self.joint_slopes[k, 1, 7] = 1.0
            # theta2 turns the rod
            self.joint_slopes[k, 0, 0] = -ry * loop.by_l1 + cx
            self.joint_slopes[k, 1, 0] = rx * loop.by_l1 + cy
            self.joint_slopes[k, 0, 1] = -ry * loop.by_l2
            self.joint_slopes[k, 1, 1] = rx * loop.by_l2
            self.joint_slopes[k, 0, 2] = -ry * loop.by_l3
            self.joint_slopes[k, 1, 2] = rx * loop.by_l3
            self.joint_slopes[k, 0, 3] = -ry * loop.by_l4
            self.joint_slopes[k, 1, 3] = rx * loop.by_l4
            self.joint_slopes[k, 0, 8] = -py
            self.joint_slopes[k, 1, 8] = px
            if k == 1:
                self.joint_slopes[k, 0, 1] += ex
                self.joint_slopes[k, 1, 1] += ey
                self.joint_slopes[k, 0, 8] -= ry
                self.joint_slopes[k, 1, 8] += rx
            elif k == 2:
                self.joint_slopes[k, 0, 9] = loop.cos2
                self.joint_slopes[k, 1, 9] = loop.sin2
                self.joint_slopes[k, 0, 10] = -loop.sin2
                self.joint_slopes[k, 1, 10] = loop.cos2
            along_x: cython.double = -py - ry * loop.by_crank
            along_y: cython.double = px + rx * loop.by_crank
            self.joint_slopes[k, 0, 4] = (1.0 - share) * along_x
            self.joint_slopes[k, 1, 4] = (1.0 - share) * along_y
            self.joint_slopes[k, 0, 5] = share * along_x
            self.joint_slopes[k, 1, 5] = share * along_y
        return True

    @cython.cfunc
    @cython.exceptval(check=False)
    def way(self, joint: cython.int, side: cython.int) -> cython.double:
        """How far a joint is from going beyond a side: least where it goes farthest."""
        sign: cython.double = 1.0 if side < 2 else -1.0
        return sign * self.joint[joint, side % 2]

    @cython.cfunc
    @cython.exceptval(check=False)
    def envelope(self, row: cython.int, n: cython.Py_ssize_t) -> cython.int:
        """Both pivots within a box, and each joint where it goes farthest to each side."""
        traced: cython.int = cython.cast(cython.int, self.table[n, 5])
        refinements: cython.int = cython.cast(cython.int, self.table[n, 6])
        t: cython.int
        j: cython.int
        side: cython.int
        open: cython.bint = False
        for side in range(4):
            self.pivot_slopes(0)
            self.beside(row, side, n, 1, self.ax, self.ay, 0, 1.0)
            self.pivot_slopes(1)
            self.beside(
                row + 4,
                side,
                n,
                1,
                self.ax + self.loop.l4 * self.cos_turned,
                self.ay + self.loop.l4 * self.sin_turned,
                0,
                1.0,
            )
            row += 1
        row += 4
        step: cython.double = 1.0 / (traced - 1)
        for t in range(traced):
            if not self.joints(step * t, False):
                open = True
                break
            for j in range(12):
                self.trace[j, t] = self.way(j // 4, j % 4)
        for j in range(12):
            side = j % 4
            if open:
                self.values[row] = float("nan")
                row += 1
                continue
            best: cython.int = 0
            for t in range(1, traced):
                if self.trace[j, t] < self.trace[j, best]:
                    best = t
            best = min(max(best, 1), traced - 2)
            at: cython.double = vertex(
                best * step, self.trace[j, best - 1], self.trace[j, best], self.trace[j, best + 1], step
            )
            fine: cython.double = step
            for _ in range(refinements):
                fine /= 8.0
                middle: cython.double = min(max(at, fine), 1.0 - fine)
                before: cython.double = 0.0
                here: cython.double = 0.0
                after: cython.double = 0.0
                if self.joints(middle - fine, False):
                    before = self.way(j // 4, side)
                if self.joints(middle, False):
                    here = self.way(j // 4, side)
                if self.joints(middle + fine, False):
                    after = self.way(j // 4, side)
                at = vertex(middle, before, here, after, fine)
            if self.joints(at, True):
                self.beside(row, side, n, 1, self.joint[j // 4, 0], self.joint[j // 4, 1], j // 4, 1.0)
            else:
                self.values[row] = float("nan")
            row += 1
        return row

    @cython.cfunc
    @cython.exceptval(check=False)
    def pivot_slopes(self, point: cython.int) -> cython.void:
        """Derivatives of a fixed pivot, into the first place of ``joint_slopes``."""
        c: cython.int
        for c in range(11):
            self.joint_slopes[0, 0, c] = 0.0
            self.joint_slopes[0, 1, c] = 0.0
        self.joint_slopes[0, 0, 6] = 1.0
        self.joint_slopes[0, 1, 7] = 1.0
        if point == 1:
            self.joint_slopes[0, 0, 3] = self.cos_turned
            self.joint_slopes[0, 1, 3] = self.sin_turned
            self.joint_slopes[0, 0, 8] = -self.loop.l4 * self.sin_turned
            self.joint_slopes[0, 1, 8] = self.loop.l4 * self.cos_turned


@cython.cfunc
@cython.exceptval(check=False)
def vertex(
    middle: cython.double, before: cython.double, here: cython.double, after: cython.double, step: cython.double
) -> cython.double:
    """Where a function is least, from its values a step before a place, there, and a step after: a parabola's vertex."""
    bend: cython.double = before - 2.0 * here + after
    part: cython.double
    if bend > 0.0:
        part = 0.5 * (before - after) / bend
    elif before > after:
        part = 1.0
    elif before < after:
        part = -1.0
    else:
        part = 0.0
    return min(max(middle + step * min(max(part, -1.0), 1.0), 0.0), 1.0)


# -- valleys ---------------------------------------------------------------------------------------------------------


def apart(rows, reach, kept, start, most):
    """Which rows to keep, best first: those that differ from every row kept before by their own reach in some number.

    ``rows`` (n, m), ``reach`` (n,); ``kept`` are kept already, the others are looked at from ``start`` on; ``most`` at most.
    """
    values: cython.double[:, ::1] = rows
    far: cython.double[::1] = reach
    room = np.empty(len(rows) + len(kept), dtype=np.intp)
    out: cython.Py_ssize_t[::1] = room
    count: cython.Py_ssize_t = len(kept)
    room[:count] = kept
    largest: cython.Py_ssize_t = most
    n: cython.Py_ssize_t
    k: cython.Py_ssize_t
    c: cython.Py_ssize_t
    first: cython.Py_ssize_t = start
    for n in range(first, values.shape[0]):
        if count >= largest:
            break
        twin: cython.bint = False
        for k in range(count):
            twin = True
            for c in range(values.shape[1]):
                if not fabs(values[out[k], c] - values[n, c]) < far[n]:
                    twin = False
                    break
            if twin:
                break
        if not twin:
            out[count] = n
            count += 1
    return room[:count]


# -- shapes ----------------------------------------------------------------------------------------------------------

GRASHOF, ANY, FULL_CRANK, SLIDER_CRANK = range(4)
"""Charts, see `fourbar.charts`; of slider-cranks, of crank 1: ln(rod - 1 - |offset|), offset."""
_LEAST = cython.declare(cython.double, 1e-9)
"""Least magnitude of an unknown of a Grashof chart: at change points the slope of theta2 has no limit."""


@cython.final
@cython.cclass
class Shape:
    """Lengths by the unknowns of a chart, with derivatives."""

    chart: cython.int
    size: cython.int
    guide: cython.int
    loop: Loop
    by: cython.double[:, ::1]

    def __init__(self, chart):
        self.chart = chart
        self.size = {GRASHOF: 4, SLIDER_CRANK: 2}.get(chart, 3)
        self.guide = 1 if chart == SLIDER_CRANK else 0
        self.loop = Loop()
        self.by = np.zeros((4, 4))

    @cython.cfunc
    @cython.exceptval(check=False)
    def at(
        self, q0: cython.double, q1: cython.double, q2: cython.double, q3: cython.double, side: cython.double
    ) -> cython.void:
        """Lengths, X0 and Y0 into ``loop``, derivatives by the unknowns into ``by``."""
        loop: Loop = self.loop
        loop.side = side
        loop.guide = self.guide
        if self.chart == 3:
            loop.l1 = 1.0
            loop.l2 = 1.0 + fabs(q1) + exp(inside(q0, 20.0))
            loop.l3 = q1
            self.by[1, 0] = exp(inside(q0, 20.0))
            self.by[1, 1] = copysign(1.0, q1)
            self.by[2, 1] = 1.0
        elif self.chart == 0:
            self.grashof(q0, q1, q2, q3)
        elif self.chart == 1:
            loop.of_lengths(exp(inside(q0, 16.0)), exp(inside(q1, 16.0)), exp(inside(q2, 16.0)), 1.0, side)
            self.by[0, 0] = loop.l1
            self.by[1, 1] = loop.l2
            self.by[2, 2] = loop.l3
        else:
            self.full_crank(inside(q0, 16.0), inside(q1, 30.0), inside(q2, 17.0))

    @cython.cfunc
    @cython.exceptval(check=False)
    def grashof(self, q0: cython.double, x: cython.double, y: cython.double, z: cython.double) -> cython.void:
        """Of shortest link and excesses; excesses below zero count as zero."""
        loop: Loop = self.loop
        least: cython.double = fabs(q0)
        sign: cython.double = 1.0 if q0 > 0.0 else -1.0
        short: cython.double
        long: cython.double
        k: cython.int
        c: cython.int
        x = max(x, 0.0)
        y = max(y, 0.0)
        z = max(z, 0.0)
        short = least
        long = least + 0.5 * (y + z)
        loop.l2 = least + 0.5 * (x + y)
        loop.l3 = least + 0.5 * (x + z)
        loop.x0 = x * (4.0 * least + x + y + z)
        loop.y0 = y * z
        for k in range(4):
            for c in range(4):
                self.by[k, c] = 0.0
            self.by[k, 0] = sign
        self.by[1, 1] = 0.5
        self.by[1, 2] = 0.5
        self.by[2, 1] = 0.5
        self.by[2, 3] = 0.5
        k = 3 if q0 > 0.0 else 0
        self.by[k, 2] = 0.5
        self.by[k, 3] = 0.5
        loop.l1 = short if q0 > 0.0 else long
        loop.l4 = long if q0 > 0.0 else short

    @cython.cfunc
    @cython.exceptval(check=False)
    def full_crank(self, p: cython.double, u: cython.double, w: cython.double) -> cython.void:
        """Of `fourbar.charts.FullCrankChart`."""
        loop: Loop = self.loop
        ratio: cython.double = exp(p)
        excess: cython.double = exp(u)
        loop.l4 = 1.0 / (1.0 + ratio)
        loop.l1 = ratio * loop.l4
        e: cython.double = exp(-fabs(p))
        gap: cython.double = (1.0 - e) / (1.0 + e)
        if fabs(p) < 1e-3:  # without cancellation
            h: cython.double = 0.5 * fabs(p)
            gap = h * (1.0 - h * h * (1.0 / 3.0 - h * h * (2.0 / 15.0)))
        e = exp(-2.0 * fabs(w))
        share: cython.double = copysign((1.0 - e) / (1.0 + e), w)
        if fabs(w) < 1e-3:
            share = w * (1.0 - w * w * (1.0 / 3.0 - w * w * (2.0 / 15.0)))
        fall: cython.double = 4.0 * e / ((1.0 + e) * (1.0 + e))
        half: cython.double = 0.5 * gap * share
        middle: cython.double = 0.5 + 0.5 * excess
        step: cython.double = loop.l1 * loop.l4
        loop.l2 = middle + half
        loop.l3 = middle - half
        loop.x0 = excess * (2.0 + excess)
        loop.y0 = gap * gap * fall
        self.by[0, 0] = step
        self.by[3, 0] = -step
        step = copysign(step, p) * share
        self.by[1, 0] = step
        self.by[2, 0] = -step
        self.by[1, 1] = 0.5 * excess
        self.by[2, 1] = 0.5 * excess
        step = 0.5 * gap * fall
        self.by[1, 2] = step
        self.by[2, 2] = -step


@cython.cfunc
@cython.inline
@cython.exceptval(check=False)
def inside(value: cython.double, most: cython.double) -> cython.double:
    """A value within -most and most."""
    return min(max(value, -most), most)


# -- descents --------------------------------------------------------------------------------------------------------

ANGLE_ = cython.declare(cython.double, 1e-2)
LINEAR_ = cython.declare(cython.double, 1e-2)
"""Damping of the crank angles and of the linear unknowns relative to that of the shape."""
NORMAL_ = cython.declare(cython.double, 1e-9)
"""Damping from which on a step may come from normal equations: the condition of the damped, scaled matrix is below 1e11."""
MARGIN_ = cython.declare(cython.double, 1e-7)
"""By which limits are kept, so that rounding breaks none."""
_STRAIGHT = cython.declare(cython.double, 0.999999999999)
"""Largest cosine between steps: the cost of what does not close is infinite, however straight the way there."""


@cython.final
@cython.cclass
class Descent:
    """Levenberg-Marquardt over shape, pose and all crank angles of candidates toward the samples of one request.

    See `free.joint` for the mathematics. Everything is an array of floats; complex numbers are two.

    Parameters
    ----------
    rotation : ndarray, shape (N,)
        Wanted; empty where none is.
    rotation_root, position_root : ndarray, shape (N,)
        Square roots of the samples' parts of the means.
    place : ndarray, shape (N, 2)
        Wanted positions over the length scale; empty where none are.
    chart : int
    ordered : bool
        Whether the crank passes the samples in their order.
    span_max : float
    limits : Limits, optional
        That descents keep to.
    crank : ndarray, shape (N,), optional
        Crank angles from the first sample on, where they are given: then the one at the first sample is unknown, and rotations
        do not count modulo a turn.
    fixed : tuple of bool
        Whether that one is given, and whether the rotation's offset is.
    sheet : int
        -1: only linkages with L1 < L4; 1: only others; 0: both.
    shortest : float
        |z1| below this is no crank.
    """

    samples: cython.Py_ssize_t
    timed: cython.bint
    fixed_start: cython.bint
    fixed_offset: cython.bint
    sheet: cython.int
    shortest: cython.double
    linear: cython.int
    unknowns: cython.int
    crank: cython.double[::1]
    goal: cython.double[::1]
    has_rotation: cython.bint
    has_position: cython.bint
    parts: cython.int
    columns: cython.int
    size: cython.int
    width: cython.Py_ssize_t
    flat: cython.Py_ssize_t
    ordered: cython.bint
    span_max: cython.double
    limited: cython.bint
    pose_is_best: cython.bint
    rho: cython.double
    shape: Shape
    limits: Limits
    # the request
    goal_cos: cython.double[::1]
    goal_sin: cython.double[::1]
    place_x: cython.double[::1]
    place_y: cython.double[::1]
    rotation_root: cython.double[::1]
    position_root: cython.double[::1]
    # two sets and one to look ahead
    q: cython.double[:, ::1]
    pose: cython.double[:, ::1]
    offset: cython.double[::1]
    phi: cython.double[:, ::1]
    side: cython.double[::1]
    cost: cython.double[::1]
    plain: cython.double[::1]
    m: cython.double[:, :, ::1]
    turn: cython.double[:, ::1]
    by_angle: cython.double[:, ::1]
    at_sample: cython.Py_ssize_t[:, ::1]
    active: cython.int[::1]
    e1: cython.double[:, ::1]
    e2: cython.double[:, ::1]
    slope: cython.double[:, ::1]
    gap: cython.double[::1]
    # of a step
    red: cython.double[:, ::1]
    upper: cython.double[:, ::1]
    along: cython.double[:, ::1]
    inner: cython.double[::1]
    coefficient: cython.double[::1]
    square: cython.double[::1]
    ridge: cython.double[::1]
    straight: cython.double[::1]
    step: cython.double[::1]
    turn_step: cython.double[::1]
    kept: cython.double[::1]
    spare: cython.double[::1]
    bend: cython.double[::1]
    way: cython.double[::1]
    column: cython.double[::1]
    shifted: cython.bint
    shift: cython.double[::1]
    room: cython.double[:, ::1]
    # the run
    count: cython.Py_ssize_t
    candidate: cython.Py_ssize_t
    iteration: cython.int
    iterations: cython.int
    begun: cython.bint
    here: cython.int
    damping0: cython.double
    damping: cython.double
    growth: cython.double
    stall: cython.double
    exact: cython.double
    others: cython.double
    bent_below: cython.double
    best_cost: cython.double
    least: cython.double
    taken: cython.Py_ssize_t
    shapes: cython.double[:, ::1]
    poses: cython.double[:, ::1]
    offsets: cython.double[::1]
    angles: cython.double[:, ::1]
    branches: cython.double[::1]
    shifts: cython.double[:, ::1]
    costs: cython.double[::1]

    def __init__(
        self,
        rotation,
        rotation_root,
        place,
        position_root,
        chart,
        ordered,
        span_max,
        limits=None,
        crank=None,
        fixed=(False, False),
        sheet=0,
        shortest=0.0,
    ):
        self.timed = crank is not None
        self.fixed_start, self.fixed_offset = fixed
        self.sheet, self.shortest = sheet, shortest
        self.has_rotation = rotation is not None
        self.has_position = place is not None
        samples = len(rotation) if self.has_rotation else len(place)
        self.samples = samples
        none = np.zeros(samples)
        self.crank = np.array(crank, dtype=float) if self.timed else none
        self.goal = np.array(rotation, dtype=float) if self.has_rotation else none
        self.goal_cos = np.cos(rotation) if self.has_rotation else none
        self.goal_sin = np.sin(rotation) if self.has_rotation else none
        self.place_x = np.array(place[:, 0]) if self.has_position else none
        self.place_y = np.array(place[:, 1]) if self.has_position else none
        self.rotation_root = np.array(np.broadcast_to(rotation_root, samples), dtype=float)
        self.position_root = np.array(np.broadcast_to(position_root, samples), dtype=float)
        self.shape = Shape(chart)
        self.size = self.shape.size
        self.ordered = ordered
        self.span_max = span_max
        self.limited = limits is not None
        self.limits = limits if limits is not None else Limits(np.empty((0, 8)), True)
        self.pose_is_best = not (self.limited and self.limits.posed)
        self.rho = 1.0
        self.parts = self.has_rotation + 2 * self.has_position
        self.linear = 6 * self.has_position + self.has_rotation
        self.unknowns = self.size + self.timed
        self.columns = self.linear + self.unknowns
        self.flat = self.parts * samples
        rows = self.limits.rows
        self.width = -(-(self.flat + rows + 1) // 4) * 4  # a row is left for `loose`
        sets = 3
        self.q = np.zeros((sets, 4))
        self.pose = np.zeros((sets, 6))
        self.offset = np.zeros(sets)
        self.phi = np.zeros((sets, samples))
        self.side = np.ones(sets)
        self.cost = np.zeros(sets)
        self.plain = np.zeros(sets)
        self.m = np.zeros((2, self.columns + 1, self.width))
        self.turn = np.zeros((sets, self.flat))
        self.by_angle = np.zeros((sets, rows + 1))
        self.at_sample = np.zeros((sets, rows + 1), dtype=np.intp)
        self.active = np.zeros(sets, dtype=np.intc)
        self.e1 = np.zeros((2, samples))
        self.e2 = np.zeros((2, samples))
        self.slope = np.zeros((5, samples))
        self.gap = np.zeros(samples)
        self.red = np.zeros((self.columns + 1, self.width))
        self.upper = np.zeros((self.columns + 1, self.columns + 1))
        self.along = np.zeros((self.columns + 1, samples))
        self.inner = np.zeros(samples)
        self.coefficient = np.zeros(samples)
        self.square = np.zeros(self.columns + 1)
        self.ridge = np.zeros(self.columns + 1)
        self.straight = np.zeros(self.columns + 1)
        self.step = np.zeros(self.columns + 1)
        self.turn_step = np.zeros(samples)
        self.spare = np.zeros(max(self.width, samples, self.columns + 1))
        self.bend = np.zeros(samples)
        self.way = np.zeros(5)
        self.kept = np.zeros(6)
        self.column = np.zeros(self.columns + 1)
        self.shift = np.zeros(rows + 1)
        self.room = np.zeros((8, samples))

    # -- candidates of arrays ---------------------------------------------------------------------------------------

    def begin(self, shapes, poses, offsets, angles, branches, shifts, rho):
        """Take candidates, whose arrays later results go into.

        Shapes (n, k), poses (n, 6), offsets (n,), angles (n, N), branches (n,), shifts of the limits' rows (n, C); the weight
        of squared violations against J squared.
        """
        self.shapes = shapes
        self.poses = poses
        self.offsets = offsets
        self.angles = angles
        self.branches = branches
        self.shifts = shifts
        self.rho = rho
        self.count = len(branches)
        costs = np.empty(len(branches))
        self.costs = costs
        self.candidate = 0
        self.iteration = 0
        self.begun = False
        self.least = float("inf")
        self.taken = 0
        return costs

    @cython.cfunc
    @cython.exceptval(check=False)
    def take(self, s: cython.int, n: cython.Py_ssize_t) -> cython.void:
        """A candidate into a set."""
        k: cython.Py_ssize_t
        for k in range(self.size):
            self.q[s, k] = self.shapes[n, k]
        for k in range(6):
            self.pose[s, k] = self.poses[n, k]
        self.offset[s] = self.offsets[n]
        self.side[s] = self.branches[n]
        for k in range(self.samples):
            self.phi[s, k] = self.angles[n, 0] + self.crank[k] if self.timed else self.angles[n, k]
        self.shifted = False
        for k in range(self.limits.rows):
            self.shift[k] = self.shifts[n, k]
            if self.shift[k] != 0.0:
                self.shifted = True

    @cython.cfunc
    @cython.exceptval(check=False)
    def give(self, s: cython.int, n: cython.Py_ssize_t) -> cython.void:
        """A set into its candidate's place."""
        k: cython.Py_ssize_t
        for k in range(self.size):
            self.shapes[n, k] = self.q[s, k]
        for k in range(6):
            self.poses[n, k] = self.pose[s, k]
        self.offsets[n] = self.offset[s]
        for k in range(1 if self.timed else self.samples):
            self.angles[n, k] = self.phi[s, k]
        self.costs[n] = self.cost[s]

    def look(self, best_pose, facing):
        """Costs of the candidates: as they are, or in their best pose, which they keep; rotations by their mean direction."""
        n: cython.Py_ssize_t
        pose: cython.bint = best_pose
        face: cython.bint = facing
        for n in range(self.count):
            self.take(0, n)
            if self.evaluate(0, False, 1 if pose else 0, face):
                self.give(0, n)
            else:
                self.costs[n] = float("inf")

    def nearest(self, steps):
        """Move each crank angle of the candidates to the nearest point of the path, the order kept."""
        n: cython.Py_ssize_t
        i: cython.Py_ssize_t
        r: cython.int
        most: cython.int = steps
        c: cython.int
        for n in range(self.count):
            self.take(0, n)
            for c in range(self.columns):
                self.step[c] = 0.0
            for _ in range(most):
                if not self.evaluate(0, True, 0, False):
                    break
                average: cython.double = 0.0
                for i in range(self.samples):
                    square: cython.double = 0.0
                    toward: cython.double = 0.0
                    for r in range(self.parts):
                        t: cython.double = self.turn[0, r * self.samples + i]
                        square += t * t
                        toward += t * self.m[0, self.columns, r * self.samples + i]
                    self.inner[i] = square
                    self.turn_step[i] = -toward
                    average += square
                average /= self.samples
                for i in range(self.samples):
                    self.turn_step[i] /= max(self.inner[i], 1e-12 * average)
                self.move(0, 0)
            self.give(0, n)

    def loose(self, noise, factors, size):
        """Move the candidates mostly where their cost is flat: along valleys, where the next minimum lies.

        Steps are R^{-1} times normal noise (n, m), longest where the rows change least; each is scaled to change the shape by
        about ``size`` times its factor (n,) of itself.
        """
        n: cython.Py_ssize_t
        c: cython.int
        k: cython.int
        normal: cython.double[:, ::1] = noise
        by: cython.double[::1] = factors
        far: cython.double = size
        for n in range(self.count):
            self.take(0, n)
            if not self.first(0):
                continue
            self.reduce(0, 1e-12)
            # homogeneous unknowns have a direction in which nothing changes at all: a row of its own holds it
            for c in range(self.columns + 1):
                self.red[c, self.width - 1] = 0.0
            for k in range(self.size):
                self.red[self.linear + k, self.width - 1] = copysign(1.0, self.q[0, k])
            self.triangle(1e-12)
            for c in range(self.columns):
                self.step[c] = normal[n, c]
            self.upper_solve(self.step)
            relative: cython.double = 0.0
            for k in range(self.size):
                relative = max(relative, fabs(self.step[self.linear + k]) / (fabs(self.q[0, k]) + 0.02))
            factor: cython.double = far * by[n] / max(relative, 1e-300)
            for c in range(self.columns):
                self.step[c] *= factor
            self.angles_of(0, self.step, False)
            self.move(0, 0)
            self.give(0, n)

    def linearised(self, n, damping):
        """What a step of a candidate is made of, for tests: rows, derivatives by the angles, damping, and the step itself."""
        self.take(0, n)
        if not self.first(0):
            return None
        fall = self.solve(0, damping)
        active = self.active[0]
        return {
            "rows": np.array(self.m[0, :, : self.flat + active]),
            "turn": np.array(self.turn[0]),
            "by_angle": np.array(self.by_angle[0, :active]),
            "at_sample": np.array(self.at_sample[0, :active]),
            "inner": np.array(self.inner),
            "ridge": np.array(self.ridge[: self.columns]),
            "step": np.array(self.step[: self.columns]),
            "turn_step": np.array(self.turn_step),
            "fall": fall,
        }

    def moved(self, steps, turns):
        """Move the candidates by steps (n, m) of shape, pose and offset, and (n, N) of the crank angles, cut as in a descent."""
        n: cython.Py_ssize_t
        for n in range(self.count):
            self.take(0, n)
            np.asarray(self.step)[: self.columns] = steps[n]
            np.asarray(self.turn_step)[:] = turns[n]
            self.move(0, 0)
            self.give(0, n)

    def broken(self):
        """Sum of the squares of what the candidates lack of the limits, and the largest, (n,) each."""
        n: cython.Py_ssize_t
        squares = np.empty(self.count)
        largest = np.empty(self.count)
        total: cython.double[::1] = squares
        most: cython.double[::1] = largest
        for n in range(self.count):
            self.take(0, n)
            self.shape.at(self.q[0, 0], self.q[0, 1], self.q[0, 2], self.q[0, 3], self.side[0])
            self.constrained(0)
            most[n] = self.worst()
            total[n] = self.room[0, 0]
        return squares, largest

    @cython.cfunc
    @cython.exceptval(check=False)
    def worst(self) -> cython.double:
        """What is lacked most; the sum of squares into ``room``."""
        row: cython.int
        most: cython.double = 0.0
        total: cython.double = 0.0
        for row in range(self.limits.rows):
            value: cython.double = self.limits.values[row]
            if not isfinite(value):
                value = -1.0
            value = fabs(value) if self.limits.equal[row] else max(-value, 0.0)
            total += value * value
            most = max(most, value)
        self.room[0, 0] = total
        return most

    def restore(self, rounds):
        """Move the candidates onto the limits that they break by the shortest way, at their crank angles: Newton's steps.

        None breaks more than it did; one that the steps lead away stays where it was. Their costs are J squared. Returns what
        they still lack, (n,).
        """
        n: cython.Py_ssize_t
        most: cython.int = rounds
        lacked = np.empty(self.count)
        out: cython.double[::1] = lacked
        for n in range(self.count):
            self.take(0, n)
            self.shape.at(self.q[0, 0], self.q[0, 1], self.q[0, 2], self.q[0, 3], self.side[0])
            scale: cython.double = self.constrained(0)
            before: cython.double = self.worst()
            for _ in range(most):
                if not self.newton(0, scale):
                    break
                self.shape.at(self.q[0, 0], self.q[0, 1], self.q[0, 2], self.q[0, 3], self.side[0])
                scale = self.constrained(0)
            out[n] = self.worst()
            if not out[n] <= before:
                out[n] = before
                self.take(0, n)
            self.evaluate(0, False, 1 if self.pose_is_best else 2, False)
            self.give(0, n)
        return lacked

    @cython.cfunc
    @cython.exceptval(check=False)
    def newton(self, s: cython.int, scale: cython.double) -> cython.bint:
        """One step of shape and pose onto the limits that are broken, the shortest there is; False where none is."""
        row: cython.int
        c: cython.int
        j: cython.Py_ssize_t
        rows: cython.int = 0
        held: cython.int
        last: cython.int = self.columns
        for c in range(last + 1):
            for j in range(self.width):
                self.red[c, j] = 0.0
        for row in range(self.limits.rows):
            value: cython.double = self.limits.values[row]
            if not isfinite(value):
                continue
            if self.limits.equal[row]:
                if fabs(value) <= 1e-15:
                    continue
            else:
                value -= MARGIN_
                if value >= 0.0:
                    continue
                value -= 0.1 * MARGIN_
            self.limit_column(s, row, scale)
            for c in range(last):
                self.red[c, rows] = self.column[c]
            self.red[last, rows] = value
            rows += 1
        if rows == 0:
            return False
        for held in range(2):
            for c in range(last + 1):
                for j in range(rows, self.width):
                    self.red[c, j] = 0.0
                if held:
                    for j in range(rows):
                        self.red[c, j] = self.m[s, c, j]
                else:
                    for j in range(rows):
                        self.m[s, c, j] = self.red[c, j]
            largest: cython.double = 0.0
            for c in range(last):
                if held and c >= self.linear and c < self.linear + 4 and self.way[c - self.linear] != 0.0:
                    for j in range(rows):
                        self.red[c, j] = 0.0
                largest = max(largest, self.dot(c, c))
            for c in range(last):
                self.ridge[c] = 1e-12 * largest if largest > 0.0 else 1.0
            self.orthogonal(0.0)
            for c in range(last):
                self.step[c] = -self.upper[c, last]
            self.upper_solve(self.step)
            if self.shape.chart > 0 or held:
                break
            again: cython.bint = False
            for c in range(4):
                self.way[c] = 0.0
                if (
                    fabs(self.q[s, c]) <= 1.01 * _LEAST
                    and copysign(1.0, self.q[s, c]) * self.step[self.linear + c] < 0.0
                ):
                    self.way[c] = 1.0
                    again = True
            if not again:
                break
        for c in range(last + 1):  # what no sample's row depends on stays zero
            for j in range(rows):
                self.m[s, c, j] = 0.0
        for j in range(self.samples):
            self.turn_step[j] = 0.0
        if self.has_rotation:
            self.step[self.linear - 1] = 0.0
        self.move(s, s)
        return True

    # -- rows ---------------------------------------------------------------------------------------------------------

    @cython.cfunc
    @cython.exceptval(check=False)
    def evaluate(self, s: cython.int, full: cython.bint, pose: cython.int, face: cython.bint) -> cython.bint:
        """Residual, cost and, where wanted, derivatives of a set; False where it does not close.

        ``pose``: 0, as it is; 1, in its best pose; 2, with the best offset of the rotation; 3, in its best pose where that keeps
        the limits. ``face``: the offset begins with the mean direction of the gaps.
        """
        k: cython.int
        self.shape.at(self.q[s, 0], self.q[s, 1], self.q[s, 2], self.q[s, 3], self.side[s])
        if not self.turned(s, full):
            self.cost[s] = float("inf")
            return False
        if face and self.has_rotation:
            self.face(s)
        if pose == 3 and self.has_position:
            for k in range(6):
                self.kept[k] = self.pose[s, k]
        if (pose == 1 or pose == 3) and self.has_position:
            self.best_pose(s)
            if self.shortest > 0.0 and not sqrt(self.pose[s, 2] ** 2 + self.pose[s, 3] ** 2) > self.shortest:
                self.cost[s] = float("inf")
                return False
        self.residual(s, pose > 0)
        if self.limited:
            if pose == 3:
                self.limit_rows(s, False)
                if self.cost[s] > self.plain[s]:
                    for k in range(6):
                        self.pose[s, k] = self.kept[k]
                    self.residual(s, True)
                else:
                    self.cost[s] = self.plain[s]
            self.limit_rows(s, full)
        else:
            self.active[s] = 0
        if not isfinite(self.cost[s]):
            self.cost[s] = float("inf")
            return False
        if full:
            self.derivatives(s)
            if self.shape.chart == 0:
                self.hold(s)
        return True

    @cython.cfunc
    @cython.exceptval(check=False)
    def turned(self, s: cython.int, full: cython.bint) -> cython.bint:
        """Crank and body at the crank angles; the body's derivatives by the unknowns of the shape and the crank angle."""
        i: cython.Py_ssize_t
        k: cython.int
        loop: Loop = self.shape.loop
        shape: Shape = self.shape
        if self.sheet and not (loop.l1 - loop.l4) * self.sheet > 0.0:
            return False
        if self.timed and not self.closes_between(s):
            return False
        for i in range(self.samples):
            if not loop.turn(self.phi[s, i]):
                return False
            if self.timed and self.has_rotation:
                self.gap[i] = self.goal[i] - loop.angle(self.phi[s, i])
            self.e1[0, i] = loop.cos1
            self.e1[1, i] = loop.sin1
            self.e2[0, i] = loop.cos2
            self.e2[1, i] = loop.sin2
            if full:
                loop.slopes()
                for k in range(self.size):
                    self.slope[k, i] = (
                        loop.by_l1 * shape.by[0, k]
                        + loop.by_l2 * shape.by[1, k]
                        + loop.by_l3 * shape.by[2, k]
                        + loop.by_l4 * shape.by[3, k]
                    )
                self.slope[4, i] = loop.by_crank
        return True

    @cython.cfunc
    @cython.exceptval(check=False)
    def closes_between(self, s: cython.int) -> cython.bint:
        """Whether the loop closes at theta1 = 0 and pi where the motion passes them: the diagonal is least or most there."""
        i: cython.Py_ssize_t
        loop: Loop = self.shape.loop
        if loop.guide == 1 or (loop.x0 > 0.0 and loop.y0 > 0.0):
            return True
        first: cython.double = self.phi[s, 0]
        last: cython.double = first
        for i in range(1, self.samples):
            first = min(first, self.phi[s, i])
            last = max(last, self.phi[s, i])
        if loop.y0 <= 0.0 and floor(last / TURN) >= -floor(-first / TURN):
            return False
        return not (loop.x0 <= 0.0 and floor((last - PI) / TURN) >= -floor((PI - first) / TURN))

    @cython.cfunc
    @cython.exceptval(check=False)
    def face(self, s: cython.int) -> cython.void:
        """The offset right to within its own error, from the mean direction of the gaps."""
        i: cython.Py_ssize_t
        x: cython.double = 0.0
        y: cython.double = 0.0
        for i in range(self.samples):
            weight: cython.double = self.rotation_root[i] * self.rotation_root[i]
            x += weight * (self.goal_cos[i] * self.e2[0, i] + self.goal_sin[i] * self.e2[1, i])
            y += weight * (self.goal_sin[i] * self.e2[0, i] - self.goal_cos[i] * self.e2[1, i])
        self.offset[s] = atan2(y, x)

    @cython.cfunc
    @cython.exceptval(check=False)
    def best_pose(self, s: cython.int) -> cython.void:
        """A, z1, z2 of the least mean square, by Gram and Schmidt twice over {1, e1, e2}: never by normal equations."""
        i: cython.Py_ssize_t
        n: cython.Py_ssize_t = self.samples
        w: cython.double
        m1x: cython.double = 0.0
        m1y: cython.double = 0.0
        m2x: cython.double = 0.0
        m2y: cython.double = 0.0
        for i in range(n):
            w = self.position_root[i] * self.position_root[i]
            m1x += w * self.e1[0, i]
            m1y += w * self.e1[1, i]
            m2x += w * self.e2[0, i]
            m2y += w * self.e2[1, i]
        ax: cython.double = 0.0
        ay: cython.double = 0.0
        for i in range(n):
            w = self.position_root[i] * self.position_root[i]
            self.room[0, i] = self.e1[0, i] - m1x
            self.room[1, i] = self.e1[1, i] - m1y
            ax += w * self.room[0, i]
            ay += w * self.room[1, i]
        m1x += ax
        m1y += ay
        square: cython.double = 0.0
        for i in range(n):
            w = self.position_root[i] * self.position_root[i]
            self.room[0, i] -= ax
            self.room[1, i] -= ay
            square += w * (self.room[0, i] * self.room[0, i] + self.room[1, i] * self.room[1, i])
        norm1: cython.double = sqrt(square)
        if not norm1 > 1e-15:
            norm1 = 1.0
        alx: cython.double = 0.0
        aly: cython.double = 0.0
        for i in range(n):
            w = self.position_root[i] * self.position_root[i]
            self.room[0, i] /= norm1
            self.room[1, i] /= norm1
            self.room[2, i] = self.e2[0, i] - m2x
            self.room[3, i] = self.e2[1, i] - m2y
            alx += w * (self.room[0, i] * self.room[2, i] + self.room[1, i] * self.room[3, i])
            aly += w * (self.room[0, i] * self.room[3, i] - self.room[1, i] * self.room[2, i])
        nx: cython.double = 0.0
        ny: cython.double = 0.0
        bx: cython.double = 0.0
        by: cython.double = 0.0
        for i in range(n):
            w = self.position_root[i] * self.position_root[i]
            self.room[2, i] -= alx * self.room[0, i] - aly * self.room[1, i]
            self.room[3, i] -= alx * self.room[1, i] + aly * self.room[0, i]
            nx += w * self.room[2, i]
            ny += w * self.room[3, i]
            bx += w * (self.room[0, i] * self.room[2, i] + self.room[1, i] * self.room[3, i])
            by += w * (self.room[0, i] * self.room[3, i] - self.room[1, i] * self.room[2, i])
        square = 0.0
        rx: cython.double = 0.0
        ry: cython.double = 0.0
        for i in range(n):
            w = self.position_root[i] * self.position_root[i]
            self.room[2, i] -= nx + bx * self.room[0, i] - by * self.room[1, i]
            self.room[3, i] -= ny + bx * self.room[1, i] + by * self.room[0, i]
            square += w * (self.room[2, i] * self.room[2, i] + self.room[3, i] * self.room[3, i])
            rx += w * (self.room[0, i] * self.place_x[i] + self.room[1, i] * self.place_y[i])
            ry += w * (self.room[0, i] * self.place_y[i] - self.room[1, i] * self.place_x[i])
        norm2: cython.double = sqrt(square)
        if not norm2 > 1e-15:
            norm2 = 1.0
        # the positions have no mean; what a second pass over them would add is below the rounding of their residual
        zx: cython.double = 0.0
        zy: cython.double = 0.0
        for i in range(n):
            w = self.position_root[i] * self.position_root[i]
            px: cython.double = self.place_x[i] - (rx * self.room[0, i] - ry * self.room[1, i])
            py: cython.double = self.place_y[i] - (rx * self.room[1, i] + ry * self.room[0, i])
            zx += w * (self.room[2, i] * px + self.room[3, i] * py)
            zy += w * (self.room[2, i] * py - self.room[3, i] * px)
        zx /= norm2 * norm2
        zy /= norm2 * norm2
        alx += bx
        aly += by
        ux: cython.double = (rx - (alx * zx - aly * zy)) / norm1
        uy: cython.double = (ry - (alx * zy + aly * zx)) / norm1
        m2x += nx
        m2y += ny
        self.pose[s, 0] = -(m1x * ux - m1y * uy) - (m2x * zx - m2y * zy)
        self.pose[s, 1] = -(m1x * uy + m1y * ux) - (m2x * zy + m2y * zx)
        self.pose[s, 2] = ux
        self.pose[s, 3] = uy
        self.pose[s, 4] = zx
        self.pose[s, 5] = zy

    @cython.cfunc
    @cython.exceptval(check=False)
    def residual(self, s: cython.int, pose: cython.bint) -> cython.void:
        """The rows of the samples, in the last column, or in ``spare`` of the set that looks ahead; and their squares' sum."""
        i: cython.Py_ssize_t
        n: cython.Py_ssize_t = self.samples
        at: cython.Py_ssize_t = 0
        total: cython.double = 0.0
        value: cython.double
        if self.has_rotation:
            mean: cython.double = 0.0
            told: cython.double = self.offset[s] if self.timed else 0.0
            if not self.timed:
                self.gaps(s)
            for i in range(n):
                mean += self.rotation_root[i] * self.rotation_root[i] * (self.gap[i] - told)
            if self.fixed_offset:
                mean = TURN * rint(mean / TURN)
            elif pose:
                self.offset[s] += mean
            else:
                mean = 0.0
            for i in range(n):
                value = self.gap[i] - told - mean
                if not self.timed:
                    value -= TURN * rint(value / TURN)
                value *= self.rotation_root[i]
                self.put(s, i, value)
                total += value * value
            at = n
        if self.has_position:
            ax: cython.double = self.pose[s, 0]
            ay: cython.double = self.pose[s, 1]
            ux: cython.double = self.pose[s, 2]
            uy: cython.double = self.pose[s, 3]
            zx: cython.double = self.pose[s, 4]
            zy: cython.double = self.pose[s, 5]
            for i in range(n):
                value = self.position_root[i] * (
                    self.place_x[i]
                    - ax
                    - (ux * self.e1[0, i] - uy * self.e1[1, i])
                    - (zx * self.e2[0, i] - zy * self.e2[1, i])
                )
                self.put(s, at + i, value)
                total += value * value
                value = self.position_root[i] * (
                    self.place_y[i]
                    - ay
                    - (ux * self.e1[1, i] + uy * self.e1[0, i])
                    - (zx * self.e2[1, i] + zy * self.e2[0, i])
                )
                self.put(s, at + n + i, value)
                total += value * value
        self.plain[s] = total
        self.cost[s] = total

    @cython.cfunc
    @cython.exceptval(check=False)
    def gaps(self, s: cython.int) -> cython.void:
        """What the body lacks of the rotations wanted, within half a turn."""
        i: cython.Py_ssize_t
        c: cython.double = cos(self.offset[s])
        d: cython.double = sin(self.offset[s])
        for i in range(self.samples):
            # e^{i (gamma - offset)} conj(e2)
            gx: cython.double = self.goal_cos[i] * c + self.goal_sin[i] * d
            gy: cython.double = self.goal_sin[i] * c - self.goal_cos[i] * d
            self.gap[i] = atan2(gy * self.e2[0, i] - gx * self.e2[1, i], gx * self.e2[0, i] + gy * self.e2[1, i])

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def put(self, s: cython.int, k: cython.Py_ssize_t, value: cython.double) -> cython.void:
        """One number of the residual."""
        if s < 2:
            self.m[s, self.columns, k] = value
        else:
            self.spare[k] = value

    @cython.cfunc
    @cython.exceptval(check=False)
    def derivatives(self, s: cython.int) -> cython.void:
        """Derivatives of the samples' rows by all unknowns, and by each sample's own crank angle."""
        i: cython.Py_ssize_t
        k: cython.int
        n: cython.Py_ssize_t = self.samples
        x: cython.Py_ssize_t = 0
        if self.has_rotation:
            x = n
            last: cython.int = self.linear - 1
            for k in range(self.size):
                for i in range(n):
                    self.m[s, self.linear + k, i] = -self.rotation_root[i] * self.slope[k, i]
            for i in range(n):
                self.m[s, last, i] = 0.0 if self.fixed_offset else -self.rotation_root[i]
                self.turn[s, i] = -self.rotation_root[i] * self.slope[4, i]
        if self.has_position:
            self.position_derivatives(s, x)
        if self.timed:
            for i in range(self.flat):
                self.m[s, self.columns - 1, i] = 0.0 if self.fixed_start else self.turn[s, i]

    @cython.cfunc
    @cython.exceptval(check=False)
    def position_derivatives(self, s: cython.int, x: cython.Py_ssize_t) -> cython.void:
        """Those of the positions' rows, from row x on."""
        i: cython.Py_ssize_t
        k: cython.int
        n: cython.Py_ssize_t = self.samples
        root: cython.double
        y: cython.Py_ssize_t = x + n
        ux: cython.double = self.pose[s, 2]
        uy: cython.double = self.pose[s, 3]
        zx: cython.double = self.pose[s, 4]
        zy: cython.double = self.pose[s, 5]
        for i in range(n):
            root = self.position_root[i]
            c1: cython.double = -root * self.e1[0, i]
            s1: cython.double = -root * self.e1[1, i]
            c2: cython.double = -root * self.e2[0, i]
            s2: cython.double = -root * self.e2[1, i]
            # i z2 e2 times the root
            lx: cython.double = -(zx * s2 + zy * c2)
            ly: cython.double = zx * c2 - zy * s2
            self.room[0, i] = lx
            self.room[1, i] = ly
            self.m[s, 0, x + i] = -root
            self.m[s, 1, y + i] = -root
            self.m[s, 2, x + i] = c1
            self.m[s, 2, y + i] = s1
            self.m[s, 3, x + i] = -s1
            self.m[s, 3, y + i] = c1
            self.m[s, 4, x + i] = c2
            self.m[s, 4, y + i] = s2
            self.m[s, 5, x + i] = -s2
            self.m[s, 5, y + i] = c2
            self.turn[s, x + i] = lx * self.slope[4, i] - (ux * s1 + uy * c1)
            self.turn[s, y + i] = ly * self.slope[4, i] + (ux * c1 - uy * s1)
        for k in range(self.size):
            for i in range(n):
                self.m[s, self.linear + k, x + i] = self.room[0, i] * self.slope[k, i]
                self.m[s, self.linear + k, y + i] = self.room[1, i] * self.slope[k, i]

    @cython.cfunc
    @cython.exceptval(check=False)
    def constrained(self, s: cython.int) -> cython.double:
        """The limits at a set, into ``limits``; returns |z1| over the crank's length in the chart."""
        i: cython.Py_ssize_t
        loop: Loop = self.shape.loop
        ux: cython.double = self.pose[s, 2]
        uy: cython.double = self.pose[s, 3]
        size: cython.double = sqrt(ux * ux + uy * uy)
        scale: cython.double = size / loop.l1
        safe: cython.double = size if size > 0.0 else 1.0
        first: cython.double = self.phi[s, 0]
        last: cython.double = first
        for i in range(1, self.samples):
            first = min(first, self.phi[s, i])
            last = max(last, self.phi[s, i])
        own: Loop = self.limits.loop
        if not self.limits.posed:
            scale = 1.0
            size = loop.l1
        own.l1 = size
        own.l2 = loop.l2 * scale
        own.l3 = loop.l3 * scale
        own.l4 = loop.l4 * scale
        own.side = self.side[s]
        own.x0 = loop.x0 * scale * scale
        own.y0 = loop.y0 * scale * scale
        self.limits.at(
            first, last, self.pose[s, 0], self.pose[s, 1], ux / safe, uy / safe, self.pose[s, 4], self.pose[s, 5]
        )
        return scale

    @cython.cfunc
    @cython.exceptval(check=False)
    def limit_rows(self, s: cython.int, full: cython.bint) -> cython.void:
        """The rows of the limits that are broken, or held by a shift, behind those of the samples; their squares' sum."""
        n: cython.Py_ssize_t = self.samples
        row: cython.int
        c: cython.int
        i: cython.Py_ssize_t
        first: cython.Py_ssize_t = 0
        last: cython.Py_ssize_t = 0
        limits: Limits = self.limits
        scale: cython.double = self.constrained(s)
        root: cython.double = sqrt(self.rho)
        for i in range(1, n):
            if self.phi[s, i] < self.phi[s, first]:
                first = i
            if self.phi[s, i] > self.phi[s, last]:
                last = i
        at: cython.int = 0
        for row in range(limits.rows):
            value: cython.double = self.lacking(row)
            if value == 0.0:
                continue
            value *= root
            self.cost[s] += value * value
            if not full:
                continue
            column: cython.Py_ssize_t = self.flat + at
            self.m[s, self.columns, column] = value
            finite: cython.bint = isfinite(limits.values[row])
            for c in range(self.columns):
                self.m[s, c, column] = 0.0
            self.by_angle[s, at] = 0.0
            self.at_sample[s, at] = 0
            at += 1
            if not finite:
                continue
            self.limit_column(s, row, scale)
            for c in range(self.columns):
                self.m[s, c, column] = -root * self.column[c]
            if self.timed:
                continue
            # a limit that hangs on where the crank begins or ends stands beside that sample
            if fabs(limits.slopes[row, 5]) > fabs(limits.slopes[row, 4]):
                self.by_angle[s, at - 1] = -root * limits.slopes[row, 5]
                self.at_sample[s, at - 1] = last
            else:
                self.by_angle[s, at - 1] = -root * limits.slopes[row, 4]
                self.at_sample[s, at - 1] = first
        self.active[s] = at

    @cython.cfunc
    @cython.exceptval(check=False)
    def limit_column(self, s: cython.int, row: cython.int, scale: cython.double) -> cython.void:
        """Derivatives of a limit by shape and pose, into ``column``; lengths are the chart's over its crank, times |z1|."""
        c: cython.int
        k: cython.int
        limits: Limits = self.limits
        loop: Loop = self.shape.loop
        total: cython.double
        by_size: cython.double = 0.0
        if limits.posed:
            by_size = (
                limits.slopes[row, 0] * loop.l1
                + limits.slopes[row, 1] * loop.l2
                + limits.slopes[row, 2] * loop.l3
                + limits.slopes[row, 3] * loop.l4
            ) / loop.l1
        for c in range(self.linear):
            self.column[c] = 0.0
        for k in range(self.size):
            total = -by_size * self.shape.by[0, k]
            for c in range(4):
                total += limits.slopes[row, c] * self.shape.by[c, k]
            self.column[self.linear + k] = scale * total
        if self.timed:
            self.column[self.columns - 1] = 0.0 if self.fixed_start else limits.slopes[row, 4] + limits.slopes[row, 5]
        if not limits.posed:
            return
        ux: cython.double = self.pose[s, 2]
        uy: cython.double = self.pose[s, 3]
        size: cython.double = sqrt(ux * ux + uy * uy)
        safe: cython.double = size if size > 0.0 else 1.0
        ux /= safe
        uy /= safe
        by_turn: cython.double = limits.slopes[row, 8] / safe
        self.column[0] = limits.slopes[row, 6]
        self.column[1] = limits.slopes[row, 7]
        self.column[2] = by_size * ux - by_turn * uy
        self.column[3] = by_size * uy + by_turn * ux
        self.column[4] = limits.slopes[row, 9]
        self.column[5] = limits.slopes[row, 10]

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def lacking(self, row: cython.int) -> cython.double:
        """What a limit lacks, its shift added; 0 where it is kept."""
        value: cython.double = self.limits.values[row]
        if not isfinite(value):
            value = -1.0
        if self.limits.equal[row]:
            return self.shift[row] - value
        return max(MARGIN_ - value + self.shift[row], 0.0)

    @cython.cfunc
    @cython.exceptval(check=False)
    def hold(self, s: cython.int) -> cython.void:
        """No derivatives by unknowns of the shape that a bound holds."""
        k: cython.int
        j: cython.Py_ssize_t
        for k in range(self.size):
            if fabs(self.q[s, k]) <= 1.01 * _LEAST:
                toward: cython.double = 0.0
                for j in range(self.flat + self.active[s]):
                    toward += self.m[s, self.linear + k, j] * self.m[s, self.columns, j]
                if copysign(1.0, self.q[s, k]) * toward > 0.0:
                    for j in range(self.flat + self.active[s]):
                        self.m[s, self.linear + k, j] = 0.0

    # -- a step -------------------------------------------------------------------------------------------------------

    @cython.cfunc
    @cython.exceptval(check=False)
    def reduce(self, s: cython.int, damping: cython.double) -> cython.void:
        """Rows with the crank angles eliminated, into ``red``; squares of its columns."""
        n: cython.Py_ssize_t = self.samples
        flat: cython.Py_ssize_t = self.flat
        i: cython.Py_ssize_t
        j: cython.Py_ssize_t
        c: cython.int
        k: cython.int
        r: cython.int
        base: cython.Py_ssize_t
        average: cython.double = 0.0
        value: cython.double
        active: cython.int = self.active[s]
        if self.timed:
            for c in range(self.columns + 1):
                for j in range(flat + active):
                    self.red[c, j] = self.m[s, c, j]
                for j in range(flat + active, self.width):
                    self.red[c, j] = 0.0
                self.square[c] = self.dot(c, c)
            return
        for i in range(n):
            self.inner[i] = 0.0
        for r in range(self.parts):
            base = r * n
            for i in range(n):
                self.inner[i] += self.turn[s, base + i] * self.turn[s, base + i]
        for k in range(active):
            self.inner[self.at_sample[s, k]] += self.by_angle[s, k] * self.by_angle[s, k]
        for i in range(n):
            average += self.inner[i]
        average /= n
        for i in range(n):
            value = self.inner[i]
            own: cython.double = ANGLE_ * damping * max(value, 1e-6 * average) + 1e-20 * average
            value += own
            if not value > 0.0:
                value = 1.0
            self.inner[i] = value
            self.coefficient[i] = 1.0 / (value * (1.0 + sqrt(own / value)))
        for c in range(self.columns + 1):
            for i in range(n):
                self.along[c, i] = self.m[s, c, i] * self.turn[s, i]
            for r in range(1, self.parts):
                base = r * n
                for i in range(n):
                    self.along[c, i] += self.m[s, c, base + i] * self.turn[s, base + i]
            for k in range(active):
                self.along[c, self.at_sample[s, k]] += self.by_angle[s, k] * self.m[s, c, flat + k]
            for r in range(self.parts):
                base = r * n
                for i in range(n):
                    self.red[c, base + i] = (
                        self.m[s, c, base + i] - self.coefficient[i] * self.turn[s, base + i] * self.along[c, i]
                    )
            for k in range(active):
                i = self.at_sample[s, k]
                self.red[c, flat + k] = (
                    self.m[s, c, flat + k] - self.coefficient[i] * self.by_angle[s, k] * self.along[c, i]
                )
            for j in range(flat + active, self.width):
                self.red[c, j] = 0.0
            self.square[c] = self.dot(c, c)

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def dot(self, a: cython.int, b: cython.int) -> cython.double:
        """Product of two columns, in four sums that a processor takes at once."""
        j: cython.Py_ssize_t
        s0: cython.double = 0.0
        s1: cython.double = 0.0
        s2: cython.double = 0.0
        s3: cython.double = 0.0
        for j in range(0, self.width, 4):
            s0 += self.red[a, j] * self.red[b, j]
            s1 += self.red[a, j + 1] * self.red[b, j + 1]
            s2 += self.red[a, j + 2] * self.red[b, j + 2]
            s3 += self.red[a, j + 3] * self.red[b, j + 3]
        return (s0 + s1) + (s2 + s3)

    @cython.cfunc
    @cython.exceptval(check=False)
    def triangle(self, damping: cython.double) -> cython.void:
        """R of the damped rows, the residual's column last.

        By Gram and Schmidt with the pivot of each column as its own damping row: that is Householder's method on the rows with
        the damping rows above them.
        """
        c: cython.int
        for c in range(self.columns):
            self.ridge[c] = damping
            if self.square[c] > 0.0:
                # in their best pose linear unknowns need none; beside limits that a step meets it must come to an end
                none: cython.bint = self.timed and self.pose_is_best
                self.ridge[c] = 0.0 if none else damping * (LINEAR_ if c < self.linear else 1.0) * self.square[c]
        if not (damping > NORMAL_ and self.cholesky(damping)):
            self.orthogonal(damping)

    @cython.cfunc
    @cython.exceptval(check=False)
    def orthogonal(self, damping: cython.double) -> cython.void:
        """R by Gram and Schmidt, ``red`` used up; given timing, damping is relative to what the linear columns leave."""
        c: cython.int
        k: cython.int
        j: cython.Py_ssize_t
        for c in range(self.columns):
            if c == self.linear and self.timed and damping > 0.0:
                for k in range(c, self.columns):
                    if self.square[k] > 0.0:
                        self.ridge[k] = damping * max(self.dot(k, k), 1e-20 * self.square[k])
            norm: cython.double = sqrt(self.dot(c, c) + self.ridge[c])
            root: cython.double = sqrt(self.ridge[c])
            self.upper[c, c] = norm
            if not norm > 0.0:
                for k in range(c + 1, self.columns + 1):
                    self.upper[c, k] = 0.0
                continue
            for k in range(c + 1, self.columns + 1):
                product: cython.double = self.dot(c, k) / norm
                self.upper[c, k] = product
                # v0 = sqrt(ridge) + norm, beta = 1 / (norm v0)
                product /= norm + root
                for j in range(self.width):
                    self.red[k, j] -= product * self.red[c, j]

    @cython.cfunc
    @cython.exceptval(check=False)
    def cholesky(self, damping: cython.double) -> cython.bint:
        """R from the normal matrix of the scaled columns; False where that is not well conditioned."""
        c: cython.int
        k: cython.int
        j: cython.int
        count: cython.int = self.columns
        for c in range(count + 1):
            value: cython.double = self.square[c]
            self.spare[c] = sqrt(value) if value > 0.0 else 1.0
        for c in range(count):
            for k in range(c, count + 1):
                value = self.square[c] if k == c else self.dot(c, k)
                value /= self.spare[c] * self.spare[k]
                for j in range(c if k > c else min(c, self.linear)):
                    value -= self.upper[j, c] * self.upper[j, k]
                if k == c:
                    if self.timed and c >= self.linear and self.square[c] > 0.0:
                        if not value > 1e-6:
                            return False
                        self.ridge[c] = damping * value * self.square[c]
                    value += self.ridge[c] / (self.spare[c] * self.spare[c])
                    for j in range(self.linear, c):
                        value -= self.upper[j, c] * self.upper[j, c]
                    if not value > 1e-14:
                        return False
                    self.upper[c, c] = sqrt(value)
                else:
                    self.upper[c, k] = value / self.upper[c, c]
        for c in range(count):
            for k in range(c, count + 1):
                self.upper[c, k] *= self.spare[k]
        return True

    @cython.cfunc
    @cython.exceptval(check=False)
    def upper_solve(self, x: cython.double[::1]) -> cython.void:
        """R^{-1} x in place; zero where R is singular."""
        c: cython.int
        k: cython.int
        good: cython.bint = True
        for c in range(self.columns - 1, -1, -1):
            value: cython.double = x[c]
            for k in range(c + 1, self.columns):
                value -= self.upper[c, k] * x[k]
            x[c] = value / self.upper[c, c]
            if not isfinite(x[c]):
                good = False
        if not good:
            for c in range(self.columns):
                x[c] = 0.0

    @cython.cfunc
    @cython.exceptval(check=False)
    def angles_of(self, s: cython.int, step: cython.double[::1], residual: cython.bint) -> cython.void:
        """The crank angles' part of a step of the other unknowns."""
        c: cython.int
        i: cython.Py_ssize_t
        if self.timed:
            for i in range(self.samples):
                self.turn_step[i] = step[self.columns - 1]
            return
        for i in range(self.samples):
            self.turn_step[i] = self.along[self.columns, i] if residual else 0.0
        for c in range(self.columns):
            value: cython.double = step[c]
            for i in range(self.samples):
                self.turn_step[i] += value * self.along[c, i]
        for i in range(self.samples):
            self.turn_step[i] = -self.turn_step[i] / self.inner[i]

    @cython.cfunc
    @cython.exceptval(check=False)
    def solve(self, s: cython.int, damping: cython.double) -> cython.double:
        """The step from a set; returns by how much a linear model's cost falls."""
        c: cython.int
        total: cython.double = 0.0
        self.reduce(s, damping)
        self.triangle(damping)
        for c in range(self.columns):
            value: cython.double = self.upper[c, self.columns]
            total += value * value
            self.step[c] = -value
        self.upper_solve(self.step)
        for c in range(self.columns):
            total += self.ridge[c] * self.step[c] * self.step[c]
            self.straight[c] = self.step[c]
        self.angles_of(s, self.step, True)
        return total

    @cython.cfunc
    @cython.exceptval(check=False)
    def bow(self, s: cython.int) -> cython.void:
        """Bend the step by its second-order correction, from one more residual, unless that is not small beside it."""
        c: cython.int
        k: cython.int
        i: cython.Py_ssize_t
        j: cython.Py_ssize_t
        r: cython.int
        n: cython.Py_ssize_t = self.samples
        longest: cython.double = 0.0
        for c in range(self.columns):
            longest += self.step[c] * self.step[c]
        if not self.timed:
            for i in range(n):
                longest += self.turn_step[i] * self.turn_step[i]
        longest = sqrt(longest)
        ahead: cython.double = min(0.1, 0.01 / max(longest, 1e-300))
        for k in range(self.size):
            self.q[2, k] = self.q[s, k] + ahead * self.step[self.linear + k]
        if self.has_position:
            for k in range(6):
                self.pose[2, k] = self.pose[s, k] + ahead * self.step[k]
        self.offset[2] = self.offset[s]
        if self.has_rotation:
            self.offset[2] += ahead * self.step[self.linear - 1]
        self.side[2] = self.side[s]
        for i in range(n):
            self.phi[2, i] = self.phi[s, i] + ahead * self.turn_step[i]
        self.shape.at(self.q[2, 0], self.q[2, 1], self.q[2, 2], self.q[2, 3], self.side[2])
        if not self.turned(2, False):
            return
        self.residual(2, False)
        # half the second derivative along the step
        for j in range(self.flat):
            self.spare[j] = (self.spare[j] - self.m[s, self.columns, j]) / ahead
        for c in range(self.columns):
            value: cython.double = self.step[c]
            for j in range(self.flat):
                self.spare[j] -= value * self.m[s, c, j]
        for i in range(n):
            self.bend[i] = 0.0
        for r in range(self.parts):
            for i in range(n):
                j = r * n + i
                if not self.timed:
                    self.spare[j] -= self.turn[s, j] * self.turn_step[i]
                self.spare[j] /= ahead
                self.bend[i] += self.turn[s, j] * self.spare[j]
        for i in range(n):
            self.gap[i] = 0.0 if self.timed else self.bend[i] / self.inner[i]
        for c in range(self.columns):
            value = 0.0
            for j in range(self.flat):
                value += self.m[s, c, j] * self.spare[j]
            for i in range(n):
                value -= self.along[c, i] * self.gap[i]
            # R^T x = right
            for k in range(c):
                value -= self.upper[k, c] * self.ridge[k]
            self.ridge[c] = value / self.upper[c, c]
        for c in range(self.columns):
            self.ridge[c] = -self.ridge[c]
        self.upper_solve(self.ridge)
        length: cython.double = 0.0
        for c in range(self.columns):
            value = self.ridge[c]
            length += value * value
            if not self.timed:
                for i in range(n):
                    self.bend[i] += value * self.along[c, i]
        if not self.timed:
            for i in range(n):
                self.bend[i] = -self.bend[i] / self.inner[i]
                length += self.bend[i] * self.bend[i]
        if not 2.0 * sqrt(length) < 1.5 * longest:
            return
        for c in range(self.columns):
            self.step[c] += self.ridge[c]
        for i in range(n):
            self.turn_step[i] = self.step[self.columns - 1] if self.timed else self.turn_step[i] + self.bend[i]

    @cython.cfunc
    @cython.exceptval(check=False)
    def move(self, s: cython.int, t: cython.int) -> cython.void:
        """The set s after its step, into the set t; each unknown and gap cut by itself."""
        k: cython.int
        i: cython.Py_ssize_t
        self.side[t] = self.side[s]
        if self.has_position:
            for k in range(6):
                self.pose[t, k] = self.pose[s, k] + self.step[k]
        self.offset[t] = self.offset[s]
        if self.has_rotation:
            self.offset[t] += self.step[self.linear - 1]
        longest: cython.double = 0.35 if self.shape.chart == 0 else 1.0
        for k in range(self.size):
            side: cython.double = copysign(1.0, self.q[s, k])
            self.q[t, k] = self.q[s, k] + inside(self.step[self.linear + k], longest)
            if self.shape.chart == 0:
                self.q[t, k] = side * max(side * self.q[t, k], 1e-300)
        if self.shape.chart == 0:
            self.bound(t)
        if self.timed:
            start: cython.double = self.phi[s, 0] + inside(self.step[self.columns - 1], 0.75)
            for i in range(self.samples):
                self.phi[t, i] = start + self.crank[i]
        elif self.ordered:
            self.within_gaps(s, t)
        else:
            for i in range(self.samples):
                self.phi[t, i] = self.phi[s, i] + inside(self.turn_step[i], 0.6)

    @cython.cfunc
    @cython.exceptval(check=False)
    def bound(self, t: cython.int) -> cython.void:
        """The unknowns of a Grashof chart, each of its own sign, within their bounds and of scale one."""
        k: cython.int
        total: cython.double = 0.0
        for k in range(4):
            total += fabs(self.q[t, k])
        self.q[t, 0] = copysign(max(fabs(self.q[t, 0] / total), _LEAST), self.q[t, 0])
        for k in range(1, 4):
            self.q[t, k] = max(self.q[t, k] / total, _LEAST)

    @cython.cfunc
    @cython.exceptval(check=False)
    def within_gaps(self, s: cython.int, t: cython.int) -> cython.void:
        """Steps of crank angles, cut so that the samples keep their order and the crank stays within its span.

        The gaps between neighbours are cut, not the angles: a turn that all of them make together changes no order, and long
        valleys run that way.
        """
        n: cython.Py_ssize_t = self.samples
        i: cython.Py_ssize_t
        way: cython.double = 1.0 if self.phi[s, n - 1] >= self.phi[s, 0] else -1.0
        span: cython.double = 0.0
        new: cython.double = 0.0
        gap: cython.double
        for i in range(n - 1):
            gap = way * (self.phi[s, i + 1] - self.phi[s, i])
            span += gap
            self.gap[i] = max(gap + way * (self.turn_step[i + 1] - self.turn_step[i]), 0.2 * gap)
            new += self.gap[i]
        room: cython.double = self.span_max - 1e-12 * (n - 1) - span
        longest: cython.double = span + (0.8 * room if room > 0.0 else room)
        factor: cython.double = min(1.0, longest / max(new, 1e-300))
        cut: cython.double = 0.0
        mean: cython.double = self.turn_step[0]
        self.bend[0] = 0.0
        for i in range(n - 1):
            gap = way * (self.phi[s, i + 1] - self.phi[s, i])
            cut += way * (max(self.gap[i] * factor, min(gap, 1e-12)) - gap)
            self.bend[i + 1] = cut
            mean += self.turn_step[i + 1] - cut
        mean = inside(mean / n, PI)
        for i in range(n):
            self.phi[t, i] = self.phi[s, i] + (self.bend[i] + mean)

    # -- a run --------------------------------------------------------------------------------------------------------

    def descend(self, iterations, damping, stall, exact, others, bent_below):
        """Say how the candidates are to descend; see `free.joint.refine`."""
        self.iterations = iterations
        self.damping0 = damping
        self.stall = stall
        self.exact = exact
        self.others = others
        self.bent_below = bent_below
        self.candidate = 0
        self.begun = False

    def run(self, most):
        """Go on for so many steps; True once all candidates came to their end."""
        left: cython.Py_ssize_t = most
        done_below: cython.double = max(1e-30, self.exact)
        if self.others == 0.0 and self.least <= self.exact:
            return True
        while self.candidate < self.count:
            if left <= 0:
                return False
            left -= 1
            if not self.begun:
                self.take(0, self.candidate)
                self.here = 0
                if not self.first(0):
                    self.costs[self.candidate] = float("inf")
                    self.candidate += 1
                    continue
                self.give(0, self.candidate)
                self.begun = True
                self.iteration = 0
                self.damping = self.damping0
                self.growth = 2.0
                self.best_cost = self.cost[0]
                k: cython.int
                for k in range(5):
                    self.way[k] = 0.0
            ended: cython.bint = self.iteration >= self.iterations
            if not ended:
                ended = self.advance(done_below)
                self.iteration += 1
            self.least = min(self.least, self.best_cost)
            if self.best_cost <= self.exact:
                ended = True
                if self.others == 0.0:
                    return True
                self.iterations = cython.cast(cython.int, min(1.0 * self.iterations, self.others * self.iteration))
            if ended:
                self.candidate += 1
                self.begun = False
        return True

    @property
    def steps(self):
        """Steps of all candidates so far."""
        return self.taken

    def renew(self, weight):
        """The shifts of the candidates' limits for another weight: what is still broken counts on."""
        n: cython.Py_ssize_t
        row: cython.int
        ratio: cython.double = self.rho / weight
        for n in range(self.count):
            self.take(0, n)
            self.shape.at(self.q[0, 0], self.q[0, 1], self.q[0, 2], self.q[0, 3], self.side[0])
            self.constrained(0)
            for row in range(self.limits.rows):
                self.shifts[n, row] = ratio * self.lacking(row)
        self.rho = weight

    @cython.cfunc
    @cython.exceptval(check=False)
    def first(self, s: cython.int) -> cython.bint:
        """A candidate's beginning: in its best pose, where limits leave it that."""
        return self.evaluate(s, True, 1 if self.pose_is_best else 2, False)

    @cython.cfunc
    @cython.exceptval(check=False)
    def advance(self, done_below: cython.double) -> cython.bint:
        """One step of the candidate; whether it was its last."""
        s: cython.int = self.here
        t: cython.int = 1 - s
        k: cython.int
        before: cython.double = self.cost[s]
        predicted: cython.double = self.solve(s, self.damping)
        if self.best_cost < self.bent_below and not self.limited:
            self.bow(s)
        self.move(s, t)
        closes: cython.bint
        if self.pose_is_best:
            closes = self.evaluate(t, True, 1, False)
        elif self.active[s] == 0 and not self.shifted:
            closes = self.evaluate(t, True, 3, False)
        else:
            closes = self.evaluate(t, True, 2, False)
        new: cython.double = self.cost[t]
        decrease: cython.double = before - new
        better: cython.bint = closes and decrease > 0.0
        taken: cython.bint = better
        if closes and not better:
            # uphill is allowed the farther, the straighter the way goes on: a curved valley is followed above its floor
            product: cython.double = 0.0
            own: cython.double = 0.0
            last: cython.double = 0.0
            for k in range(self.unknowns):
                product += self.straight[self.linear + k] * self.way[k]
                own += self.straight[self.linear + k] * self.straight[self.linear + k]
                last += self.way[k] * self.way[k]
            length: cython.double = sqrt(own * last)
            cosine: cython.double = product / (length if length > 0.0 else 1.0)
            cosine = 1.0 - min(max(cosine, 0.0), _STRAIGHT)
            taken = cosine * cosine * new < self.best_cost
        finished: cython.bint = (better and decrease < self.stall * before) or before < done_below
        if better:
            gain: cython.double = 2.0 * min(max(decrease / max(predicted, 1e-300), 0.0), 1.0) - 1.0
            self.damping = max(self.damping * max(0.1, 1.0 - gain * gain * gain), 1e-22)
        elif not taken:
            self.damping *= self.growth
        if taken:
            self.growth = 2.0
            self.here = t
            for k in range(self.unknowns):
                self.way[k] = self.straight[self.linear + k]
            if new < self.best_cost:
                self.best_cost = new
                self.give(t, self.candidate)
        else:
            self.growth *= 2.0
        self.taken += 1
        return finished or self.damping > 1e10
