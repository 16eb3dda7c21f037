"""Where a search spends its time, compiled: loops, limits as functions, descents of four-bars and of pairs of guides, programs.

Written in Cython's pure Python mode: it is compiled when the package is installed, and runs uncompiled as well, slowly, which is
how its tests check the compiled library. Arrays come in contiguous and of floats; what they mean is said by `descents`,
`quadratic` and `fourbar.limits`, which are the doors to it.

A descent works on one candidate after the other, without allocating. Rows are kept by column of the Jacobian, each contiguous
over part (rotation, x, y) and sample, then the rows of broken limits: ``m[set, column, part * N + sample]``, the residual in the
last column. There are two sets, of where a candidate stands and of where its step leads; they change places when a step is taken,
so that a refused one evaluates nothing again. The third, of which only the residual is filled, is for a look ahead.
"""

import cython
import numpy as np
from cython import Py_ssize_t, bint, cclass, cfunc, declare, double, doublecomplex, final, inline
from cython.cimports.libc.math import atan2, copysign, cos, exp, fabs, floor, isfinite, log, rint, sin, sqrt

# -- constants: angles in radians, lengths over the length scale, J squared over its square ------------------------------

PI = declare(double, 3.141592653589793)
TURN = declare(double, 6.283185307179586)
NAN = declare(double, float("nan"))
INFINITE = declare(double, float("inf"))
TINY = declare(double, 1e-300)  # keeps a divisor from zero

DEAD = declare(double, 1e-8)  # least sqrt(X Y) of slopes, so that a dead position stops a step and not the program
FAR = declare(double, 16.0)  # largest logarithm of a ratio of lengths, as of `fourbar.charts`
FAR_EXCESS = declare(double, 30.0)  # largest |u| of a full crank
FAR_SHARE = declare(double, 17.0)  # largest |w| of a full crank: beyond, tanh is one
FAR_ROD = declare(double, 20.0)  # largest logarithm of what a slider-crank's rod has beyond what it must have
SERIES = declare(double, 1e-3)  # |x| below which tanh comes from its series, whose next term is below rounding
LEAST = declare(
    double, 1e-9
)  # least magnitude of an unknown of a Grashof chart: at change points theta2 has no slope
AT_LEAST = declare(double, 1.01e-9)  # an unknown below it stands on that bound

MARGIN = declare(double, 1e-7)  # by which descents keep limits, so that rounding breaks none
BEYOND = declare(double, 1.1e-7)  # to where Newton's steps aim, so that the margin is reached
KEPT = declare(double, 1e-15)  # an equation that lacks less needs no Newton step
SHORTEST = declare(double, 1e-12)  # damping of Newton's steps: of rows that say the same, the shortest step

ANGLE = declare(double, 1e-2)  # damping of the crank angles relative to that of the shape
LINEAR = declare(double, 1e-2)  # damping of pose and offset relative to that of the shape
BLUNT = declare(double, 1e-6)  # least square of a derivative by a crank angle for damping, over their mean
FLAT = declare(double, 1e-20)  # least damping of a crank angle over that mean, and of a column over its square
STEEP = declare(double, 1e-12)  # the same where angles move to the nearest point of the path
NORMAL = declare(
    double, 1e-9
)  # damping from which on a triangle may come from normal equations: condition below 1e11
LEFT = declare(double, 1e-6)  # of a column's square, least part that others must leave for that
PIVOT = declare(double, 1e-14)  # least pivot of Cholesky's method, of scaled columns
LOOSE = declare(double, 1e-12)  # damping of the triangle that says where the cost is flat
ZERO = declare(double, 0.02)  # size from which on an unknown of the shape changes by a part of itself

AHEAD = declare(double, 0.1)  # how far ahead a step's curvature is taken, as a part of it,
NOT_FAR = declare(double, 0.01)  # and in the unknowns, whichever is less
BENT = declare(double, 0.75)  # a step is bent by its curvature where that is by less than this part of it
STRAIGHT = declare(double, 0.999999999999)  # largest cosine between steps: an infinite cost is never straight on

LONGEST = declare(double, 1.0)  # step of an unknown of the shape, most are logarithms;
LONGEST_GRASHOF = declare(double, 0.35)  # of one of a Grashof chart, whose sum is one
LONGEST_START = declare(double, 0.75)  # of all crank angles, where their increments are given
LONGEST_ANGLE = declare(double, 0.6)  # of a crank angle, where the order is free
CLOSER = declare(double, 0.2)  # part of a gap between samples that a step leaves at least,
WIDER = declare(double, 0.8)  # and of the room below the largest span that it takes at most
GAP = declare(double, 1e-12)  # least gap between samples
CLOSE = declare(double, 0.05)  # gap over the mean one, below which samples that would pass one another turn as one
ASIDE = declare(double, 1e4)  # radians between samples that are not so close, where those that are get pooled

FALL = declare(
    double, 0.1
)  # damping falls to this part in a step at least (Nielsen's rule), grows twice as fast each time,
UNDAMPED = declare(double, 1e-22)  # counts for nothing below,
STUCK = declare(double, 1e10)  # and ends a descent above
EXACT = declare(double, 1e-30)  # J squared that is rounding

ITERATIONS = declare(cython.int, 30)  # of a quadratic program at most
SHARE = declare(double, 0.995)  # of the way to the nearest constraint that a step of it takes
ROUNDING = declare(double, 1e-16)  # pivot of its scaled system that is rounding

# -- complex numbers -----------------------------------------------------------------------------------------------------


@cfunc
@inline
@cython.exceptval(check=False)
def vector(x: double, y: double) -> doublecomplex:
    """x + i y, in C without a product."""
    if not cython.compiled:
        return x + 1j * y
    z: doublecomplex
    z.real = x  # noqa: F821
    z.imag = y  # noqa: F821
    return z  # noqa: F821


@cfunc
@inline
@cython.exceptval(check=False)
def times(size: double, z: doublecomplex) -> doublecomplex:
    """A real multiple, in C without products by zero."""
    return vector(size * z.real, size * z.imag)


@cfunc
@inline
@cython.exceptval(check=False)
def inner(a: doublecomplex, b: doublecomplex) -> double:
    """Inner product of plane vectors, the real part of conj(a) b."""
    return a.real * b.real + a.imag * b.imag


@cfunc
@inline
@cython.exceptval(check=False)
def cross(a: doublecomplex, b: doublecomplex) -> double:
    """Their outer product, the imaginary part of conj(a) b."""
    return a.real * b.imag - a.imag * b.real


@cfunc
@inline
@cython.exceptval(check=False)
def inside(value: double, most: double) -> double:
    """A value within -most and most."""
    return min(max(value, -most), most)


# -- the loop of a four-bar ----------------------------------------------------------------------------------------------


@cfunc
def pair_difference(a: double, b: double, c: double, d: double) -> double:
    """(a + b) - (c + d) to nearly full relative accuracy (Knuth, TAOCP vol. 2, 4.2.2, theorem B)."""
    left = a + b
    part = left - a
    left_error = (a - (left - part)) + (b - part)
    right = c + d
    part = right - c
    right_error = (c - (right - part)) + (d - part)
    return (left - right) + (left_error - right_error)


# How the body is guided beside its crank
CIRCLE = declare(cython.int, 0)  # a point of it on a circle: four-bar
RAIL = declare(cython.int, 1)  # a point of it on a line: slider-crank
SLOT = declare(cython.int, 2)  # a line of it through a fixed pin: swinging block

globals().update(CIRCLE=CIRCLE, RAIL=RAIL, SLOT=SLOT)


@final
@cclass
class Loop:
    """A linkage at a crank angle, whose body hangs on the crank pin and is guided in one of three ways.

    CIRCLE: L1..L4, and X0, Y0 of the closure (see `fourbar.kinematics`). RAIL: crank l1, rod l2, offset l3 of the rail,
    sin theta2 = (l3 - l1 sin theta1) / l2, with X0 = l2 - l1 - l3 and Y0 = l2 - l1 + l3. SLOT: crank l1, ground l2 to the pin,
    offset l3 of the slot from the crank pin, l2 - l1 e^{i theta1} = e^{i theta2} (s + i l3), with X0 + Y0 = 2 |l2 - l1| and
    Y0 - X0 = 2 l3. A crank of the latter two turns fully where both are above 0.
    """

    guide: cython.int
    length: double[4]
    x0: double
    y0: double
    side: double
    e1: doublecomplex
    e2: doublecomplex
    by: double[5]
    root: double
    square: double
    both: double
    across: double

    def __init__(self, guide=CIRCLE):
        self.guide = guide
        self.length = np.zeros(4)
        self.by = np.zeros(5)

    @cfunc
    def of_lengths(self, l1: double, l2: double, l3: double, l4: double):
        """Take the lengths of a four-bar."""
        self.length[0] = l1
        self.length[1] = l2
        self.length[2] = l3
        self.length[3] = l4
        self.x0 = pair_difference(l2, l3, l1, l4) * (l1 + l2 + l3 + l4)
        self.y0 = pair_difference(l2, l4, l1, l3) * pair_difference(l3, l4, l1, l2)

    @cfunc
    @inline
    @cython.exceptval(check=False)
    def turn(self, theta1: double, slopes: bint) -> bint:
        """Crank and coupler directions at a crank angle; False where the loop does not close.

        With ``slopes`` the derivatives of theta2 by the lengths and theta1 as well, into ``by``.
        """
        if self.guide == RAIL:
            return self.on_rail(theta1)
        if self.guide == SLOT:
            return self.through_pin(theta1)
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
        # e^{i theta2} is (B - D) (C + i side root) to its direction; B - D in the form in which nothing cancels
        if gap >= 0.0:
            diagonal = vector(gap + 2.0 * l1 * square, -2.0 * l1 * both)
        else:
            diagonal = e1 * vector(gap - 2.0 * l4 * square, -2.0 * l4 * both)
        toward = diagonal * vector(across, self.side * root)
        size = sqrt(inner(toward, toward))
        if not size > 0.0:
            return False
        e2 = vector(toward.real / size, toward.imag / size)
        self.square, self.both, self.across, self.root = square, both, across, root
        self.e1 = e1
        self.e2 = e2
        if slopes:
            arm = times(l1, e1) + times(l2, e2)
            e3 = vector((arm.real - l4) / l3, arm.imag / l3)
            # one over L2 sin(theta2 - theta3)
            lever = -2.0 * self.side * l3 / max(root, DEAD)
            self.by[0] = lever * inner(e1, e3)
            self.by[1] = lever * inner(e2, e3)
            self.by[2] = -lever
            self.by[3] = -lever * e3.real
            self.by[4] = lever * l1 * cross(e1, e3)
        return True

    @cfunc
    def on_rail(self, theta1: double) -> bint:
        """The same of a slider-crank; with X, Y = X0, Y0 + l1 (1 +- sin theta1) the rod's part along the rail is sqrt(X Y)."""
        crank, rod = self.length[0], self.length[1]
        half = 0.25 * PI - 0.5 * theta1
        sine, cosine = sin(half), cos(half)
        x = self.x0 + 2.0 * crank * cosine * cosine
        y = self.y0 + 2.0 * crank * sine * sine
        if not (x > 0.0 and y > 0.0):
            return False
        along = max(sqrt(x * y), TINY)
        self.e1 = vector(2.0 * sine * cosine, (cosine - sine) * (cosine + sine))
        across = (self.length[2] - crank * self.e1.imag) / rod
        self.e2 = vector(along / rod, across)
        along = max(along, DEAD * rod)
        self.by[0] = -self.e1.imag / along
        self.by[1] = -across / along
        self.by[2] = 1.0 / along
        self.by[3] = 0.0
        self.by[4] = -crank * self.e1.real / along
        return True

    @cfunc
    def through_pin(self, theta1: double) -> bint:
        """The same of a swinging block; s^2 = X0 Y0 + 4 l1 l2 sin^2(theta1 / 2)."""
        crank, ground, offset = self.length[0], self.length[1], self.length[2]
        sine, cosine, gap = sin(0.5 * theta1), cos(0.5 * theta1), ground - crank
        square, both = sine * sine, sine * cosine
        along = self.x0 * self.y0 + 4.0 * crank * ground * square
        if not along > 0.0:
            return False
        along = sqrt(along)
        self.e1 = vector(1.0 - 2.0 * square, 2.0 * both)
        # from the crank pin to the fixed pin, in the form in which nothing cancels
        if gap >= 0.0:
            diagonal = vector(gap + 2.0 * crank * square, -2.0 * crank * both)
        else:
            diagonal = self.e1 * vector(gap - 2.0 * ground * square, -2.0 * ground * both)
        toward = diagonal * vector(along, -offset)
        size = sqrt(inner(toward, toward))
        if not size > 0.0:
            return False
        self.e2 = vector(toward.real / size, toward.imag / size)
        self.root, self.square, self.both = along, square, both
        along = max(along, DEAD * ground)
        self.by[0] = cross(self.e1, self.e2) / along
        self.by[1] = -self.e2.imag / along
        self.by[2] = -1.0 / along
        self.by[3] = 0.0
        self.by[4] = -crank * inner(self.e1, self.e2) / along
        return True

    @cfunc
    @inline
    @cython.exceptval(check=False)
    def angle(self, theta1: double) -> double:
        """theta2 where the loop was turned to, continuous over the turn."""
        if self.guide == RAIL:
            return atan2(self.e2.imag, self.e2.real)
        ground = self.length[1] if self.guide == SLOT else self.length[3]
        gap = ground - self.length[0]
        twice = 2.0 * min(self.length[0], ground)
        if self.guide == SLOT:
            angle = -atan2(self.length[2], self.root)
        else:
            angle = self.side * atan2(self.root, self.across)
        angle += atan2(copysign(twice, -gap) * self.both, fabs(gap) + twice * self.square)
        return angle if gap >= 0.0 else angle + theta1 - PI


# -- limits --------------------------------------------------------------------------------------------------------------

# Kinds of limits; the columns behind the kind in a table of limits
USED = declare(cython.int, 0)  # cosine of the least transmission angle over the used interval
OVER_TURN = declare(cython.int, 1)  # the same over the turn; 1: of every linkage, 0: of those whose crank turns fully
LENGTH = declare(cython.int, 2)  # link, sign, rest: sign times the length, and the rest, is at least 0 (or 0)
RATIO = declare(cython.int, 3)  # the shortest length times this is at least each other
RATIOS = declare(cython.int, 4)  # the same, pair by pair, in logarithms
FAMILY = declare(cython.int, 5)  # sign of the first two excesses (0: those of any full crank)
AT = declare(cython.int, 6)  # point, x, y: the point is there
NEAR = declare(cython.int, 7)  # point, x, y, distance
INSIDE = declare(cython.int, 8)  # point, xmin, ymin, xmax, ymax
OUTSIDE = declare(cython.int, 9)  # the same: beyond the side that is nearest
ENVELOPE = declare(
    cython.int, 10
)  # xmin, ymin, xmax, ymax, places traced, refinements: all joints, over the used interval
COUNTS = (2, 2, 1, 4, 12, 3, 2, 1, 4, 1, 20)
"""Rows of each kind."""

# Points of limits, and what is followed along the motion after them
PIVOT_A = declare(cython.int, 0)
PIVOT_B = declare(cython.int, 1)
BODY = declare(cython.int, 2)  # z2, the body point from the crank pin
BODY_FROM_ROCKER = declare(cython.int, 3)  # the same from the coupler pin

# Derivatives: by four lengths,
BY_FIRST = declare(cython.int, 4)  # the first and the last crank angle,
BY_LAST = declare(cython.int, 5)
BY_PIVOT = declare(cython.int, 6)  # A (x, y),
BY_TURNED = declare(cython.int, 8)  # the ground angle,
BY_BODY = declare(cython.int, 9)  # and z2 (x, y)
COLUMNS = declare(cython.int, 11)

globals().update(
    USED=USED,
    OVER_TURN=OVER_TURN,
    LENGTH=LENGTH,
    RATIO=RATIO,
    RATIOS=RATIOS,
    FAMILY=FAMILY,
    AT=AT,
    NEAR=NEAR,
    INSIDE=INSIDE,
    OUTSIDE=OUTSIDE,
    ENVELOPE=ENVELOPE,
)


@cfunc
@inline
@cython.exceptval(check=False)
def depth(point: doublecomplex, side: cython.int, edge: double) -> double:
    """How far inside of one side of a box a point is: left, lower, right, upper."""
    value = (point.imag if side % 2 else point.real) - edge
    return value if side < 2 else -value


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

    table: double[:, ::1]
    begins: cython.int[::1]
    rows: cython.int
    equal: cython.int[::1]
    posed: bint
    values: double[::1]
    slopes: double[:, ::1]
    # the linkage
    loop: Loop
    excess: double[3]
    first: double
    last: double
    pivot: doublecomplex
    turned: doublecomplex
    body: doublecomplex
    # a point of it that does not move, crank pin, coupler pin, and body point
    joint: doublecomplex[4]
    joint_by: doublecomplex[:, ::1]
    trace: double[:, ::1]

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


# -- shapes --------------------------------------------------------------------------------------------------------------

# Charts, see `fourbar.charts` and `slider.charts`
GRASHOF = declare(cython.int, 0)
ANY = declare(cython.int, 1)
FULL_CRANK = declare(cython.int, 2)
SLIDER_CRANK = declare(cython.int, 3)
SWINGING_BLOCK = declare(cython.int, 4)
ANY_SLIDER_CRANK = declare(cython.int, 5)
ANY_SWINGING_BLOCK = declare(cython.int, 6)

globals().update(GRASHOF=GRASHOF, ANY=ANY, FULL_CRANK=FULL_CRANK, SLIDER_CRANK=SLIDER_CRANK)
globals().update(SWINGING_BLOCK=SWINGING_BLOCK)
globals().update(ANY_SLIDER_CRANK=ANY_SLIDER_CRANK, ANY_SWINGING_BLOCK=ANY_SWINGING_BLOCK)


@cfunc
def tanh_of(x: double) -> double:
    """Hyperbolic tangent, without cancellation where it is small."""
    if fabs(x) < SERIES:
        return x * (1.0 - x * x * (1.0 / 3.0 - x * x * (2.0 / 15.0)))
    e = exp(-2.0 * fabs(x))
    return copysign((1.0 - e) / (1.0 + e), x)


@final
@cclass
class Shape:
    """Lengths by the unknowns of a chart, with derivatives."""

    chart: cython.int
    size: cython.int
    loop: Loop
    by: double[:, ::1]

    def __init__(self, chart):
        self.chart = chart
        self.size = 4 if chart == GRASHOF else 3 if chart < SLIDER_CRANK else 2
        guides = {SLIDER_CRANK: RAIL, ANY_SLIDER_CRANK: RAIL, SWINGING_BLOCK: SLOT, ANY_SWINGING_BLOCK: SLOT}
        self.loop = Loop(guides.get(chart, CIRCLE))
        self.by = np.zeros((4, 4))

    @cfunc
    def at(self, q0: double, q1: double, q2: double, q3: double, side: double):
        """Lengths, X0 and Y0 into ``loop``, derivatives by the unknowns into ``by``."""
        self.loop.side = side
        if self.chart == GRASHOF:
            self.grashof(q0, max(q1, 0.0), max(q2, 0.0), max(q3, 0.0))
        elif self.chart == ANY:
            self.loop.of_lengths(exp(inside(q0, FAR)), exp(inside(q1, FAR)), exp(inside(q2, FAR)), 1.0)
            for k in range(3):
                self.by[k, k] = self.loop.length[k]
        elif self.chart == FULL_CRANK:
            self.full_crank(inside(q0, FAR), inside(q1, FAR_EXCESS), inside(q2, FAR_SHARE))
        elif self.chart == SLIDER_CRANK:
            self.slider_crank(exp(inside(q0, FAR_ROD)), exp(inside(q1, FAR_ROD)))
        elif self.chart == SWINGING_BLOCK:
            self.swinging_block(inside(q0, FAR), inside(q1, FAR_SHARE))
        else:
            self.any_slider(exp(inside(q0, FAR)), inside(q1, FAR_SHARE))

    @cfunc
    def slider_crank(self, x: double, y: double):
        """Of `slider.charts.SliderCrankChart`."""
        loop = self.loop
        loop.length[0] = 1.0
        loop.length[1] = 1.0 + 0.5 * (x + y)
        loop.length[2] = 0.5 * (y - x)
        loop.x0 = x
        loop.y0 = y
        self.by[1, 0] = 0.5 * x
        self.by[1, 1] = 0.5 * y
        self.by[2, 0] = -0.5 * x
        self.by[2, 1] = 0.5 * y

    @cfunc
    def swinging_block(self, p: double, w: double):
        """Of `slider.charts.SwingingBlockChart`."""
        loop, ratio = self.loop, exp(p)
        gap, share, e = fabs(tanh_of(0.5 * p)), tanh_of(w), exp(-2.0 * fabs(w))
        less, fall = 2.0 * e / (1.0 + e), 4.0 * e / ((1.0 + e) * (1.0 + e))  # 1 - |tanh w|, 1 / cosh^2 w
        loop.length[1] = 1.0 / (1.0 + ratio)
        loop.length[0] = ratio * loop.length[1]
        loop.length[2] = gap * share
        loop.x0 = gap * (less if w > 0.0 else 2.0 - less)
        loop.y0 = gap * (2.0 - less if w > 0.0 else less)
        step = loop.length[0] * loop.length[1]
        self.by[0, 0] = step
        self.by[1, 0] = -step
        self.by[2, 0] = copysign(2.0 * step, p) * share
        self.by[2, 1] = gap * fall

    @cfunc
    def any_slider(self, ratio: double, w: double):
        """Of `slider.charts.AnySliderChart`: l1 = 1, l2, and l3 as a part of their sum."""
        loop = self.loop
        share, e = tanh_of(w), exp(-2.0 * fabs(w))
        fall = 4.0 * e / ((1.0 + e) * (1.0 + e))
        loop.length[0] = 1.0
        loop.length[1] = ratio
        loop.length[2] = (1.0 + ratio) * share
        gap = ratio - 1.0
        if loop.guide == SLOT:
            gap = fabs(gap)
        loop.x0 = gap - loop.length[2]
        loop.y0 = gap + loop.length[2]
        self.by[1, 0] = ratio
        self.by[2, 0] = ratio * share
        self.by[2, 1] = (1.0 + ratio) * fall

    @cfunc
    def grashof(self, q0: double, x: double, y: double, z: double):
        """Of shortest link and excesses, of `fourbar.charts.GrashofChart`; excesses below zero count as zero."""
        loop, least = self.loop, fabs(q0)
        short = 0 if q0 > 0.0 else 3
        long = 3 - short
        loop.length[short] = least
        loop.length[long] = least + 0.5 * (y + z)
        loop.length[1] = least + 0.5 * (x + y)
        loop.length[2] = least + 0.5 * (x + z)
        loop.x0 = x * (4.0 * least + x + y + z)
        loop.y0 = y * z
        for k in range(4):
            self.by[k, 0] = 1.0 if q0 > 0.0 else -1.0
        for k in range(2, 4):
            self.by[short, k] = 0.0
            self.by[long, k] = 0.5
            self.by[k - 1, 1] = 0.5
            self.by[k - 1, k] = 0.5

    @cfunc
    def full_crank(self, p: double, u: double, w: double):
        """Of `fourbar.charts.FullCrankChart`."""
        loop, ratio, excess = self.loop, exp(p), exp(u)
        gap, share, e = fabs(tanh_of(0.5 * p)), tanh_of(w), exp(-2.0 * fabs(w))
        fall = 4.0 * e / ((1.0 + e) * (1.0 + e))  # 1 / cosh^2 w
        half, middle = 0.5 * gap * share, 0.5 + 0.5 * excess
        loop.length[3] = 1.0 / (1.0 + ratio)
        loop.length[0] = ratio * loop.length[3]
        loop.length[1] = middle + half
        loop.length[2] = middle - half
        loop.x0 = excess * (2.0 + excess)
        loop.y0 = gap * gap * fall
        step = loop.length[0] * loop.length[3]
        self.by[0, 0] = step
        self.by[3, 0] = -step
        for k in range(1, 3):
            sign = 1.0 if k == 1 else -1.0
            self.by[k, 0] = sign * copysign(step, p) * share
            self.by[k, 1] = 0.5 * excess
            self.by[k, 2] = sign * 0.5 * gap * fall


def shapes(chart: cython.int, unknowns: double[:, ::1]):
    """Lengths (n, d) at points (n, k) of a chart, X0 and Y0 (n,), and derivatives of the lengths by the unknowns (n, d, k)."""
    shape = Shape(chart)
    count, links, k = unknowns.shape[0], 4 if shape.loop.guide == CIRCLE else 3, shape.size
    lengths, excess, slopes = np.empty((count, links)), np.empty((2, count)), np.empty((count, links, k))
    length: double[:, ::1] = lengths
    by: double[:, :, ::1] = slopes
    x: double[::1] = excess[0]
    y: double[::1] = excess[1]
    for n in range(count):
        q2 = unknowns[n, 2] if k > 2 else 0.0
        q3 = unknowns[n, 3] if k > 3 else 0.0
        shape.at(unknowns[n, 0], unknowns[n, 1], q2, q3, 1.0)
        x[n], y[n] = shape.loop.x0, shape.loop.y0
        for j in range(links):
            length[n, j] = shape.loop.length[j]
            for c in range(k):
                by[n, j, c] = shape.by[j, c]
    return lengths, excess[0], excess[1], slopes


def body_angles(
    guide: cython.int,
    lengths: double[:, ::1],
    x0: double[::1],
    y0: double[::1],
    branch: double[::1],
    theta1: double[:, ::1],
    derivatives: bint = False,
):
    """theta2 of linkages at crank angles of their own, continuous over the turn, its derivatives, and where they close.

    Lengths (n, d), X0, Y0 and branches (n,), theta1 (n, N). Shapes (n, N); (n, d + 1, N), by the lengths and theta1; (n, N).
    Both are 0 where a linkage does not close. Law: to full relative accuracy wherever X0 and Y0 are exact and not negative.
    """
    count, samples, links = theta1.shape[0], theta1.shape[1], lengths.shape[1]
    angles, slopes = np.zeros((count, samples)), np.zeros((count if derivatives else 0, links + 1, samples))
    closes = np.zeros((count, samples), dtype=np.uint8)
    angle: double[:, ::1] = angles
    by: double[:, :, ::1] = slopes
    close: cython.uchar[:, ::1] = closes
    loop = Loop(guide)
    for n in range(count):
        for k in range(links):
            loop.length[k] = lengths[n, k]
        loop.x0, loop.y0, loop.side = x0[n], y0[n], branch[n]
        for i in range(samples):
            if not loop.turn(theta1[n, i], derivatives):
                continue
            close[n, i] = 1
            angle[n, i] = loop.angle(theta1[n, i])
            if derivatives:
                for k in range(links):
                    by[n, k, i] = loop.by[k]
                by[n, links, i] = loop.by[4]
    return angles, slopes, closes.view(bool)


# -- descents ------------------------------------------------------------------------------------------------------------

# Poses in which a candidate is evaluated
AS_IS = declare(cython.int, 0)
BEST_OFFSET = declare(cython.int, 1)  # as it is, with the best offset of the rotation
BEST = declare(cython.int, 2)
BEST_WITHIN = declare(cython.int, 3)  # in its best pose where that keeps the limits, otherwise with the best offset


@final
@cclass
class Descent:
    """Levenberg-Marquardt over shape, pose and crank angles of candidates toward the samples of one request.

    See `descents` for the mathematics. Arguments are arrays of floats; complex numbers are two.

    Parameters
    ----------
    rotation : ndarray, shape (N,)
        Wanted; None where none is.
    rotation_root, position_root : ndarray, shape (N,)
        Square roots of the samples' parts of the means.
    place : ndarray, shape (N, 2)
        Wanted positions over the length scale, of mean zero; None where none are.
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
    closed : bool
        Whether the way leads from the last sample on to the first: limits hold over the whole turn.
    """

    # the request
    samples: Py_ssize_t
    goal: double[::1]
    facing: doublecomplex[::1]
    place: doublecomplex[::1]
    rotation_root: double[::1]
    position_root: double[::1]
    crank: double[::1]
    has_rotation: bint
    has_position: bint
    timed: bint
    fixed_start: bint
    fixed_offset: bint
    ordered: bint
    closed: bint
    span_max: double
    sheet: cython.int
    shortest: double
    shape: Shape
    limits: Limits
    limited: bint
    posed: bint
    rho: double
    # rows and columns: of pose and offset, then of the shape, then the start
    parts: cython.int
    flat: Py_ssize_t
    width: Py_ssize_t
    linear: cython.int
    size: cython.int
    unknowns: cython.int
    columns: cython.int
    # sets: where the candidate stands, where its step leads, and a look ahead
    q: double[:, ::1]
    pose: doublecomplex[:, ::1]
    offset: double[::1]
    phi: double[:, ::1]
    side: double[::1]
    cost: double[::1]
    plain: double[::1]
    m: double[:, :, ::1]
    turn: double[:, ::1]
    active: cython.int[::1]
    by_angle: double[:, ::1]
    at_sample: Py_ssize_t[:, ::1]
    # of the set evaluated last
    e1: doublecomplex[::1]
    e2: doublecomplex[::1]
    slope: double[:, ::1]
    lever: doublecomplex[::1]
    basis: doublecomplex[:, ::1]
    missing: double[::1]
    gap: double[::1]
    first_sample: Py_ssize_t
    last_sample: Py_ssize_t
    column: double[::1]
    shift: double[::1]
    shifted: bint
    # of a step
    red: double[:, ::1]
    along: double[:, ::1]
    inner: double[::1]
    coefficient: double[::1]
    wish: double[::1]
    level: double[::1]
    weight: double[::1]
    head: Py_ssize_t[::1]
    block: Py_ssize_t[::1]
    joined: bint
    square: double[::1]
    ridge: double[::1]
    upper: double[:, ::1]
    step: double[::1]
    turn_step: double[::1]
    straight: double[::1]
    way: double[::1]
    bow_step: double[::1]
    bow_turn: double[::1]
    spare: double[::1]
    # the run
    candidate: Py_ssize_t
    begun: bint
    iteration: cython.int
    iterations: cython.int
    here: cython.int
    first_damping: double
    damping: double
    growth: double
    stall: double
    exact: double
    others: double
    bent_below: double
    best_cost: double
    least: double
    taken: Py_ssize_t
    # the candidates
    shapes: double[:, ::1]
    poses: doublecomplex[:, ::1]
    offsets: double[::1]
    angles: double[:, ::1]
    branches: double[::1]
    shifts: double[:, ::1]
    costs: double[::1]

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
        closed=False,
    ):
        samples = len(place if rotation is None else rotation)
        self.samples, self.ordered, self.span_max = samples, ordered, span_max
        self.sheet, self.shortest, self.rho, self.closed = sheet, shortest, 1.0, closed
        self.has_rotation, self.has_position = rotation is not None, place is not None
        self.timed, (self.fixed_start, self.fixed_offset) = crank is not None, fixed
        rotation, crank = (
            np.zeros(samples) if one is None else np.array(one, dtype=float) for one in (rotation, crank)
        )
        place = np.zeros((samples, 2)) if place is None else np.array(place, dtype=float)
        root = np.array(np.broadcast_to(position_root, samples), dtype=float)
        self.goal, self.facing, self.crank = rotation, np.exp(1j * rotation), crank
        self.rotation_root = np.array(np.broadcast_to(rotation_root, samples), dtype=float)
        self.position_root = root
        self.place = root * place.view(complex)[:, 0]
        self.shape = Shape(chart)
        self.limited = limits is not None
        self.limits = Limits(np.empty((0, 8)), True) if limits is None else limits
        self.posed = self.limited and self.limits.posed
        self.parts = self.has_rotation + 2 * self.has_position
        self.size = self.shape.size
        self.linear = self.has_rotation + 6 * self.has_position
        self.unknowns = self.size + self.timed
        self.columns = self.linear + self.unknowns
        self.flat = self.parts * samples
        rows, columns, sets = self.limits.rows + 1, self.columns + 1, 3
        self.width = (self.flat + rows + 3) // 4 * 4  # a row is left for `loose`
        self.q, self.pose = np.zeros((sets, 4)), np.zeros((sets, 3), dtype=complex)
        self.phi, self.turn = np.zeros((sets, samples)), np.zeros((sets, self.flat))
        self.offset, self.side, self.cost, self.plain = np.zeros((4, sets))
        self.m = np.zeros((sets, columns, self.width))
        self.active, self.by_angle = np.zeros(sets, dtype=np.intc), np.zeros((sets, rows))
        self.at_sample = np.zeros((sets, rows), dtype=np.intp)
        self.e1, self.e2, self.lever = np.zeros((3, samples), dtype=complex)
        self.slope, self.basis = np.zeros((5, samples)), np.zeros((3, samples), dtype=complex)
        self.missing, self.gap, self.inner, self.coefficient, self.turn_step, self.bow_turn = np.zeros((6, samples))
        self.wish, self.level, self.weight = np.zeros((3, samples))
        self.head, self.block = np.zeros((2, samples), dtype=np.intp)
        self.column, self.square, self.ridge, self.step, self.straight, self.bow_step = np.zeros((6, columns))
        self.shift, self.way = np.zeros(rows), np.zeros(5)
        self.red, self.upper = np.zeros((columns, self.width)), np.zeros((columns, columns))
        self.along, self.spare = np.zeros((columns, samples)), np.zeros(max(self.width, columns))
        self.constant_columns()

    @cfunc
    def constant_columns(self):
        """What no candidate changes: derivatives by pivot A and the offset."""
        for s in range(2):
            for i in range(self.samples):
                if self.has_position:
                    self.basis[2, i] = self.place[i]
                    self.put(s, 0, i, -self.position_root[i])
                if self.has_rotation and not self.fixed_offset:
                    self.m[s, self.linear - 1, i] = -self.rotation_root[i]

    # -- candidates of arrays --------------------------------------------------------------------------------------------

    @cfunc
    def take(self, s: cython.int, n: Py_ssize_t):
        """A candidate into a set."""
        for k in range(self.size):
            self.q[s, k] = self.shapes[n, k]
        for k in range(3):
            self.pose[s, k] = self.poses[n, k]
        self.offset[s] = self.offsets[n]
        self.side[s] = self.branches[n]
        for i in range(self.samples):
            self.phi[s, i] = self.angles[n, 0] + self.crank[i] if self.timed else self.angles[n, i]
        self.shifted = False
        for row in range(self.limits.rows):
            self.shift[row] = self.shifts[n, row]
            self.shifted = self.shifted or self.shift[row] != 0.0

    @cfunc
    def give(self, s: cython.int, n: Py_ssize_t):
        """A set into its candidate's place."""
        for k in range(self.size):
            self.shapes[n, k] = self.q[s, k]
        for k in range(3):
            self.poses[n, k] = self.pose[s, k]
        self.offsets[n] = self.offset[s]
        for i in range(1 if self.timed else self.samples):
            self.angles[n, i] = self.phi[s, i]
        self.costs[n] = self.cost[s]

    def look(self, best_pose: bint, facing: bint):
        """Costs of the candidates: as they are, or in their best pose, which they keep; rotations by their mean direction."""
        for n in range(self.costs.shape[0]):
            self.take(0, n)
            if self.evaluate(0, False, BEST if best_pose else AS_IS, facing):
                self.give(0, n)
            else:
                self.costs[n] = INFINITE

    def nearest(self, steps: cython.int):
        """Move each crank angle of the candidates to the nearest point of the path, the order kept."""
        for n in range(self.costs.shape[0]):
            self.take(0, n)
            for c in range(self.columns):
                self.step[c] = 0.0
            for _ in range(steps):
                if not self.evaluate(0, True, AS_IS, False):
                    break
                self.active[0] = 0
                mean = self.angle_squares(0)
                for i in range(self.samples):
                    toward = 0.0
                    for r in range(self.parts):
                        j = r * self.samples + i
                        toward += self.turn[0, j] * self.m[0, self.columns, j]
                    self.turn_step[i] = -toward / max(self.inner[i], STEEP * mean)
                self.move(0, 0)
            self.give(0, n)

    def errors_at(self, angles: double[:, ::1]):
        """Squared errors (n, N, G) of each sample of the candidates with the crank at some angles (n, G) of their own.

        Infinite where a candidate does not close.
        """
        count, places = angles.shape[0], angles.shape[1]
        errors = np.full((count, self.samples, places), np.inf)
        error: double[:, :, ::1] = errors
        loop = self.shape.loop
        for n in range(count):
            self.take(0, n)
            self.shaped(0)
            a, z1, z2 = self.pose[0, 0], self.pose[0, 1], self.pose[0, 2]
            back = vector(cos(self.offset[0]), -sin(self.offset[0]))
            for g in range(places):
                if not loop.turn(angles[n, g], False):
                    continue
                point = a + z1 * loop.e1 + z2 * loop.e2
                for i in range(self.samples):
                    error[n, i, g] = self.error_there(i, point, back)
        return errors

    def align(self, places: cython.int):
        """Move the crank angles of the candidates to those of the least error among so many places in a turn.

        Where the order counts, to the best that pass the samples in it within the span, either way: from each place where the
        first sample may be, by dynamic programming. Samples at one place share the room about it. What closes nowhere stays.
        """
        error: double[:, ::1] = np.empty((self.samples, places))
        before: Py_ssize_t[:, ::1] = np.empty((self.samples, places), dtype=np.intp)
        best: Py_ssize_t[::1] = np.empty(self.samples, dtype=np.intp)
        total: double[::1] = np.empty(max(1, min(places, int(self.span_max / TURN * places))))
        begin: Py_ssize_t
        way: Py_ssize_t
        first: Py_ssize_t
        sense: Py_ssize_t
        i: Py_ssize_t
        for n in range(self.costs.shape[0]):
            self.take(0, n)
            self.over_turn(error)
            rest, least, first, sense = 0.0, INFINITE, 0, 1
            for i in range(self.samples):
                best[i] = self.lowest(error[i])
                rest += error[i, best[i]]
            if self.ordered and isfinite(rest):
                rest -= error[0, best[0]]
                for way in range(-1, 2, 2):
                    for begin in range(places):
                        if error[0, begin] + rest < least:
                            cost = self.in_order(error, begin, way, total, before)
                            if cost < least:
                                least, first, sense = cost, begin, way
                                self.lead_back(total, before, best)
            if isfinite(least if self.ordered else rest):
                self.spread_out(n, first, sense, best, TURN / places)

    @cfunc
    def lead_back(self, total: double[::1], before: Py_ssize_t[:, ::1], best: Py_ssize_t[::1]):
        """How many places after the first sample each lies, of the least sum."""
        place: Py_ssize_t = self.lowest(total)
        for i in range(self.samples - 1, -1, -1):
            best[i] = place
            place = before[i, place]

    @cfunc
    def spread_out(self, n: Py_ssize_t, first: Py_ssize_t, sense: Py_ssize_t, best: Py_ssize_t[::1], step: double):
        """Angles of a candidate at places; in their order, those at one place lie apart within it."""
        count: Py_ssize_t = 0
        number: Py_ssize_t = 0
        for i in range(self.samples):
            part = 0.0
            if self.ordered:
                if number == count:
                    number = count = 0
                    while i + count < self.samples and best[i + count] == best[i]:
                        count += 1
                part = 0.8 * ((number + 0.5) / count - 0.5)
                number += 1
            self.angles[n, i] = step * (first + sense * (best[i] + part))

    @cfunc
    def lowest(self, values: double[::1]) -> Py_ssize_t:
        """Where values are least."""
        at: Py_ssize_t = 0
        for g in range(values.shape[0]):
            if values[g] < values[at]:
                at = g
        return at

    @cfunc
    def over_turn(self, error: double[:, ::1]):
        """Squared errors (N, G) of each sample with the crank at even places of a turn; infinite where the loop is open."""
        loop, places = self.shape.loop, error.shape[1]
        self.shaped(0)
        a, z1, z2 = self.pose[0, 0], self.pose[0, 1], self.pose[0, 2]
        back = vector(cos(self.offset[0]), -sin(self.offset[0]))
        for g in range(places):
            closes = loop.turn(TURN * g / places, False)
            point = a + z1 * loop.e1 + z2 * loop.e2
            for i in range(self.samples):
                error[i, g] = self.error_there(i, point, back) if closes else INFINITE

    @cfunc
    @inline
    @cython.exceptval(check=False)
    def error_there(self, i: Py_ssize_t, point: doublecomplex, back: doublecomplex) -> double:
        """Squared error of a sample with the body point there and the loop turned; ``back``: e^{-i offset}."""
        total = 0.0
        if self.has_rotation:
            wanted = self.facing[i] * back
            e2 = self.shape.loop.e2
            off = self.rotation_root[i] * atan2(cross(e2, wanted), inner(e2, wanted))
            total += off * off
        if self.has_position:
            left = self.place[i] - times(self.position_root[i], point)
            total += inner(left, left)
        return total

    @cfunc
    def in_order(
        self,
        error: double[:, ::1],
        begin: Py_ssize_t,
        way: Py_ssize_t,
        total: double[::1],
        before: Py_ssize_t[:, ::1],
    ) -> double:
        """The least sum of errors with the first sample at a place; of each number of places to the last one: ``total``.

        ``before``: how many places after the first the sample before lies then.
        """
        places, lowest = error.shape[1], INFINITE
        place: Py_ssize_t
        at: Py_ssize_t
        here: Py_ssize_t
        for place in range(total.shape[0]):
            total[place] = INFINITE if place else error[0, begin]
            before[0, place] = 0
        for i in range(1, self.samples):
            least, lowest, at, here = INFINITE, INFINITE, 0, begin
            for place in range(total.shape[0]):
                if total[place] < least:
                    least, at = total[place], place
                before[i, place] = at
                total[place] = least + error[i, here]
                lowest = min(lowest, total[place])
                here += way
                if here == places:
                    here = 0
                elif here < 0:
                    here = places - 1
        return lowest

    def loose(self, noise: double[:, ::1], factors: double[::1], size: double):
        """Move the candidates mostly where their cost is flat: along valleys, where the next minimum lies.

        Steps are R^{-1} times normal noise (n, m), longest where the rows change least; each is scaled to change the shape by
        about ``size`` times its factor (n,) of itself.
        """
        for n in range(self.costs.shape[0]):
            self.take(0, n)
            if not self.first(0):
                continue
            self.joined = False
            self.reduce(0, LOOSE)
            # homogeneous unknowns have a direction in which nothing changes at all: a row of its own holds it
            for c in range(self.columns + 1):
                self.red[c, self.width - 1] = 0.0
            for k in range(self.size):
                self.red[self.linear + k, self.width - 1] = copysign(1.0, self.q[0, k])
            self.triangle(LOOSE)
            for c in range(self.columns):
                self.step[c] = noise[n, c]
            self.upper_solve(self.step)
            relative = TINY
            for k in range(self.size):
                relative = max(relative, fabs(self.step[self.linear + k]) / (fabs(self.q[0, k]) + ZERO))
            for c in range(self.columns):
                self.step[c] *= size * factors[n] / relative
            for i in range(self.samples):
                self.turn_step[i] = 0.0
            self.angles_of(self.step, self.turn_step)
            self.move(0, 0)
            self.give(0, n)

    def linearised(self, n, damping):
        """What a step of a candidate is made of, for tests: rows, derivatives by the angles, damping, and the step itself."""
        self.take(0, n)
        if not self.first(0):
            return None
        fall, active, columns = self.solve(0, damping), self.active[0], self.columns
        told = {
            "rows": np.asarray(self.m)[0, :, : self.flat + active],
            "turn": np.asarray(self.turn)[0],
            "by_angle": np.asarray(self.by_angle)[0, :active],
            "at_sample": np.asarray(self.at_sample)[0, :active],
            "inner": np.asarray(self.inner),
            "block": np.asarray(self.block) if self.joined else np.arange(self.samples),
            "ridge": np.asarray(self.ridge)[:columns],
            "step": np.asarray(self.step)[:columns],
            "turn_step": np.asarray(self.turn_step),
        }
        return {**{name: np.array(values) for name, values in told.items()}, "fall": fall}

    def moved(self, steps, turns):
        """Move the candidates by steps (n, m) of shape, pose and offset, and (n, N) of the crank angles, cut as in a descent."""
        np.asarray(self.inner)[:] = 1.0
        for n in range(self.costs.shape[0]):
            self.take(0, n)
            np.asarray(self.step)[: self.columns], np.asarray(self.turn_step)[:] = steps[n], turns[n]
            self.move(0, 0)
            self.give(0, n)

    def broken(self):
        """Sum of the squares of what the candidates lack of the limits, and the largest, (n,) each."""
        squares, largest = np.empty(len(self.costs)), np.empty(len(self.costs))
        for n in range(self.costs.shape[0]):
            self.take(0, n)
            self.shaped(0)
            self.constrained(0)
            largest[n] = self.worst()
            squares[n] = self.spare[0]
        return squares, largest

    def excursions(self, shortest: double, panel: double):
        """How far the body point of each candidate goes between two neighbouring samples, over their distance, at most, (n,).

        By chords between crank angles at most ``panel`` apart, and by those over two such steps: the error of their sum is
        four times as large, so both together leave one of the fourth order. A distance below ``shortest`` counts as that.
        Infinite where the loop does not close in between. And the body's angle at the samples, of a closed way at the first
        once more, (n, M); not set where the loop does not close.
        """
        gaps = self.samples if self.closed else self.samples - 1
        most, told = np.empty(len(self.costs)), np.zeros((len(self.costs), gaps + 1))
        angle: double[:, ::1] = told
        loop = self.shape.loop
        for n in range(self.costs.shape[0]):
            self.take(0, n)
            self.shaped(0)
            largest = 0.0
            for i in range(gaps):
                begin = self.phi[0, i]
                if i + 1 < self.samples:
                    step = self.phi[0, i + 1] - begin
                else:
                    step = copysign(TURN, begin - self.phi[0, 0]) + self.phi[0, 0] - begin
                parts = 2 + 2 * cython.cast(cython.int, fabs(step) / (2 * panel))
                gone, first, before, outer = 0.0, 0j, 0j, 0j
                for k in range(parts + 1):
                    if not loop.turn(begin + step * k / parts, False):
                        gone = INFINITE
                        break
                    place = self.pose[0, 1] * loop.e1 + self.pose[0, 2] * loop.e2
                    if k == 0:
                        first = outer = place
                        angle[n, i] = loop.angle(begin)
                    else:
                        gone += sqrt(inner(place - before, place - before)) * 4 / 3
                    if k > 0 and k % 2 == 0:
                        gone -= sqrt(inner(place - outer, place - outer)) / 3
                        outer = place
                    before = place
                angle[n, i + 1] = loop.angle(begin + step)
                chord = sqrt(inner(before - first, before - first))
                largest = max(largest, gone / max(chord, shortest))
            most[n] = largest
        return most, told

    def restore(self, rounds: cython.int):
        """Move the candidates onto the limits that they break by the shortest way, at their crank angles: Newton's steps.

        None breaks more than it did; one that the steps lead away stays where it was. Their costs are J squared. Returns what
        they still lack, (n,).
        """
        lacked = np.empty(len(self.costs))
        for n in range(self.costs.shape[0]):
            self.take(0, n)
            self.shaped(0)
            scale = self.constrained(0)
            before = self.worst()
            for _ in range(rounds):
                if not self.newton(0, scale):
                    break
                self.shaped(0)
                scale = self.constrained(0)
            after = self.worst()
            if not after <= before:
                after = before
                self.take(0, n)
            lacked[n] = after
            self.evaluate(0, False, BEST_OFFSET if self.posed else BEST, False)
            self.give(0, n)
        return lacked

    # -- rows ------------------------------------------------------------------------------------------------------------

    @cfunc
    def evaluate(self, s: cython.int, full: bint, pose: cython.int, face: bint) -> bint:
        """Residual, cost and, where wanted, derivatives of a set in a pose; False where it does not close.

        ``face``: the offset begins with the mean direction of the gaps.
        """
        self.cost[s] = INFINITE
        self.shaped(s)
        if not self.turned(s, full):
            return False
        if face and self.has_rotation:
            self.face(s)
        a, z1, z2 = self.pose[s, 0], self.pose[s, 1], self.pose[s, 2]
        if pose >= BEST and self.has_position:
            self.best_pose(s)
            if self.shortest > 0.0 and not sqrt(inner(self.pose[s, 1], self.pose[s, 1])) > self.shortest:
                return False
        self.residual(s, pose != AS_IS)
        self.active[s] = 0
        if self.limited:
            self.limit_rows(s, full)
            if pose == BEST_WITHIN and self.cost[s] > self.plain[s]:
                self.pose[s, 0], self.pose[s, 1], self.pose[s, 2] = a, z1, z2
                self.residual(s, True)
                self.limit_rows(s, full)
        if not isfinite(self.cost[s]):
            self.cost[s] = INFINITE
            return False
        if full:
            self.derivatives(s)
            if self.shape.chart == GRASHOF:
                self.hold(s)
        return True

    @cfunc
    def shaped(self, s: cython.int):
        """The shape of a set into ``shape``."""
        self.shape.at(self.q[s, 0], self.q[s, 1], self.q[s, 2], self.q[s, 3], self.side[s])

    @cfunc
    def turned(self, s: cython.int, full: bint) -> bint:
        """Crank and body at the crank angles; the body's slopes by the unknowns of the shape and the crank angle."""
        loop, shape = self.shape.loop, self.shape
        if self.sheet and not (loop.length[0] - loop.length[3]) * self.sheet > 0.0:
            return False
        if self.timed and not self.closes_between(s):
            return False
        for i in range(self.samples):
            if not loop.turn(self.phi[s, i], full):
                return False
            self.e1[i], self.e2[i] = loop.e1, loop.e2
            if self.timed and self.has_rotation:
                self.missing[i] = self.goal[i] - loop.angle(self.phi[s, i])
            if full:
                for k in range(self.size):
                    self.slope[k, i] = (
                        loop.by[0] * shape.by[0, k]
                        + loop.by[1] * shape.by[1, k]
                        + loop.by[2] * shape.by[2, k]
                        + loop.by[3] * shape.by[3, k]
                    )
                self.slope[4, i] = loop.by[4]
        return True

    @cfunc
    def ends(self, s: cython.int):
        """The samples of the least and the largest crank angle, into ``first_sample`` and ``last_sample``."""
        self.first_sample = 0
        self.last_sample = 0
        for i in range(1, self.samples):
            if self.phi[s, i] < self.phi[s, self.first_sample]:
                self.first_sample = i
            if self.phi[s, i] > self.phi[s, self.last_sample]:
                self.last_sample = i

    @cfunc
    def closes_between(self, s: cython.int) -> bint:
        """Whether the loop closes where it comes nearest to being stretched or folded, if the motion passes there.

        CIRCLE: the diagonal is least at theta1 = 0, most at pi. RAIL: the crank pin is farthest from the rail at -pi / 2 or
        pi / 2. SLOT: it is nearest to the fixed pin at 0.
        """
        loop = self.shape.loop
        if loop.x0 > 0.0 and loop.y0 > 0.0:
            return True
        if loop.guide == SLOT:
            return not self.passes(s, 0.0)
        if loop.guide == RAIL:
            return not (
                (loop.x0 <= 0.0 and self.passes(s, -0.5 * PI)) or (loop.y0 <= 0.0 and self.passes(s, 0.5 * PI))
            )
        return not ((loop.y0 <= 0.0 and self.passes(s, 0.0)) or (loop.x0 <= 0.0 and self.passes(s, PI)))

    @cfunc
    def passes(self, s: cython.int, place: double) -> bint:
        """Whether the motion passes a crank angle, or one whole turns from it."""
        if self.closed:
            return True
        self.ends(s)
        first, last = self.phi[s, self.first_sample], self.phi[s, self.last_sample]
        return floor((last - place) / TURN) >= -floor((place - first) / TURN)

    @cfunc
    def face(self, s: cython.int):
        """The offset right to within its own error, from the mean direction of the gaps."""
        mean = 0j
        for i in range(self.samples):
            mean += self.rotation_root[i] * self.rotation_root[i] * self.facing[i] * self.e2[i].conjugate()
        self.offset[s] = atan2(mean.imag, mean.real)

    @cfunc
    def best_pose(self, s: cython.int):
        """A, z1, z2 of the least mean square, by Gram and Schmidt twice over {1, e1, e2}: never by normal equations."""
        for i in range(self.samples):
            root = self.position_root[i]
            self.basis[0, i] = times(root, self.e1[i])
            self.basis[1, i] = times(root, self.e2[i])
        mean1 = self.centred(0)
        mean1 += self.centred(0)
        square = self.basis_square(0)
        mean2, share = self.centred(1), self.without(1, 0, square)
        mean2 += self.centred(1)
        share += self.without(1, 0, square)
        # the positions have no mean
        z2 = times(1.0 / self.basis_square(1), self.along_basis(2, 1))
        z1 = times(1.0 / square, self.along_basis(2, 0)) - share * z2
        self.pose[s, 0] = -mean1 * z1 - mean2 * z2
        self.pose[s, 1] = z1
        self.pose[s, 2] = z2

    @cfunc
    def centred(self, k: cython.int) -> doublecomplex:
        """Take the mean out of a column of ``basis``, and return it."""
        mean: doublecomplex = 0j
        for i in range(self.samples):
            mean += times(self.position_root[i], self.basis[k, i])
        for i in range(self.samples):
            self.basis[k, i] = self.basis[k, i] - times(self.position_root[i], mean)
        return mean

    @cfunc
    def without(self, k: cython.int, j: cython.int, square: double) -> doublecomplex:
        """Take the part along a column of ``basis`` from another; returns how much of it that was."""
        part = times(1.0 / square, self.along_basis(k, j))
        for i in range(self.samples):
            self.basis[k, i] = self.basis[k, i] - part * self.basis[j, i]
        return part

    @cfunc
    def along_basis(self, k: cython.int, j: cython.int) -> doublecomplex:
        """Product of two columns of ``basis``."""
        part: doublecomplex = 0j
        for i in range(self.samples):
            part += self.basis[j, i].conjugate() * self.basis[k, i]
        return part

    @cfunc
    def basis_square(self, k: cython.int) -> double:
        """Square of a column of ``basis``; one where others leave nothing of it."""
        total = self.along_basis(k, k).real
        return total if total > EXACT else 1.0

    @cfunc
    def residual(self, s: cython.int, pose: bint):
        """The samples' rows of the last column, and the sum of their squares; ``pose``: with the best offset."""
        last, total = self.columns, 0.0
        if self.has_rotation:
            mean = self.gaps(s)
            if self.fixed_offset:
                mean = TURN * rint(mean / TURN)
            elif pose:
                self.offset[s] += mean
            else:
                mean = 0.0
            for i in range(self.samples):
                value = self.gap[i] - mean
                if not self.timed:
                    value -= TURN * rint(value / TURN)
                value *= self.rotation_root[i]
                self.m[s, last, i] = value
                total += value * value
        if self.has_position:
            a, z1, z2 = self.pose[s, 0], self.pose[s, 1], self.pose[s, 2]
            x = self.flat - 2 * self.samples
            y = x + self.samples
            for i in range(self.samples):
                left = self.place[i] - times(self.position_root[i], a + z1 * self.e1[i] + z2 * self.e2[i])
                self.m[s, last, x + i] = left.real
                self.m[s, last, y + i] = left.imag
                total += inner(left, left)
        self.plain[s] = total
        self.cost[s] = total

    @cfunc
    def gaps(self, s: cython.int) -> double:
        """What the body lacks of the rotations wanted, within half a turn where no crank angles are given; returns its mean."""
        mean, back = 0.0, vector(cos(self.offset[s]), -sin(self.offset[s]))
        for i in range(self.samples):
            if self.timed:
                self.gap[i] = self.missing[i] - self.offset[s]
            else:
                wanted = self.facing[i] * back
                self.gap[i] = atan2(cross(self.e2[i], wanted), inner(self.e2[i], wanted))
            mean += self.rotation_root[i] * self.rotation_root[i] * self.gap[i]
        return mean

    @cfunc
    @inline
    @cython.exceptval(check=False)
    def put(self, s: cython.int, c: cython.int, i: Py_ssize_t, value: doublecomplex) -> cython.void:
        """A sample's derivatives by a complex unknown, whose two columns begin at c."""
        x = self.flat - 2 * self.samples + i
        y = x + self.samples
        self.m[s, c, x] = value.real
        self.m[s, c, y] = value.imag
        self.m[s, c + 1, x] = -value.imag
        self.m[s, c + 1, y] = value.real

    @cfunc
    def derivatives(self, s: cython.int):
        """Derivatives of the samples' rows by all unknowns that are no constants, and by each sample's own crank angle."""
        n = self.samples
        if self.has_rotation:
            for k in range(self.size):
                for i in range(n):
                    self.m[s, self.linear + k, i] = -self.rotation_root[i] * self.slope[k, i]
            for i in range(n):
                self.turn[s, i] = -self.rotation_root[i] * self.slope[4, i]
        if self.has_position:
            x = self.flat - 2 * n
            y = x + n
            iz1, iz2 = 1j * self.pose[s, 1], 1j * self.pose[s, 2]
            for i in range(n):
                root = -self.position_root[i]
                crank, coupler = times(root, self.e1[i]), times(root, self.e2[i])
                self.put(s, 2, i, crank)
                self.put(s, 4, i, coupler)
                self.lever[i] = iz2 * coupler
                by_angle = iz1 * crank + times(self.slope[4, i], self.lever[i])
                self.turn[s, x + i] = by_angle.real
                self.turn[s, y + i] = by_angle.imag
            for k in range(self.size):
                for i in range(n):
                    self.m[s, self.linear + k, x + i] = self.lever[i].real * self.slope[k, i]
                    self.m[s, self.linear + k, y + i] = self.lever[i].imag * self.slope[k, i]
        if self.timed and not self.fixed_start:
            for j in range(self.flat):
                self.m[s, self.columns - 1, j] = self.turn[s, j]

    @cfunc
    def hold(self, s: cython.int):
        """No derivatives by unknowns of the shape that a bound holds."""
        rows = self.flat + self.active[s]
        for k in range(self.linear, self.linear + self.size):
            value = self.q[s, k - self.linear]
            toward: double = 0.0
            if fabs(value) > AT_LEAST:
                continue
            for j in range(rows):
                toward += self.m[s, k, j] * self.m[s, self.columns, j]
            if copysign(1.0, value) * toward > 0.0:
                for j in range(rows):
                    self.m[s, k, j] = 0.0

    # -- rows of limits --------------------------------------------------------------------------------------------------

    @cfunc
    def constrained(self, s: cython.int) -> double:
        """The limits at a set, into ``limits``; returns |z1| over the crank's length in the chart."""
        loop, own = self.shape.loop, self.limits.loop
        z1 = self.pose[s, 1]
        size = sqrt(inner(z1, z1))
        scale = size / loop.length[0] if self.limits.posed else 1.0
        for k in range(4):
            own.length[k] = scale * loop.length[k]
        own.side = self.side[s]
        own.x0 = scale * scale * loop.x0
        own.y0 = scale * scale * loop.y0
        self.ends(s)
        self.limits.at(
            self.phi[s, self.first_sample],
            self.phi[s, self.first_sample] + TURN if self.closed else self.phi[s, self.last_sample],
            self.pose[s, 0],
            times(1.0 / size if size > 0.0 else 0.0, z1),
            self.pose[s, 2],
        )
        return scale

    @cfunc
    def lacking(self, row: cython.int) -> double:
        """What a limit lacks, its shift added; 0 where it is kept."""
        value = self.limits.values[row]
        if not isfinite(value):
            value = -1.0
        if self.limits.equal[row]:
            return self.shift[row] - value
        return max(MARGIN - value + self.shift[row], 0.0)

    @cfunc
    def worst(self) -> double:
        """What is lacked most, without margins; the sum of squares into ``spare``."""
        most, total = 0.0, 0.0
        for row in range(self.limits.rows):
            value = self.limits.values[row]
            if not isfinite(value):
                value = -1.0
            value = fabs(value) if self.limits.equal[row] else max(-value, 0.0)
            total += value * value
            most = max(most, value)
        self.spare[0] = total
        return most

    @cfunc
    def limit_rows(self, s: cython.int, full: bint):
        """The rows of the limits that are broken, or held by a shift, behind those of the samples; their squares' sum."""
        limits, scale, root, at = self.limits, self.constrained(s), sqrt(self.rho), 0
        for row in range(limits.rows):
            value = root * self.lacking(row)
            if value == 0.0:
                continue
            self.cost[s] += value * value
            if not full:
                continue
            j = self.flat + at
            known: bint = isfinite(limits.values[row])
            if known:
                self.limit_column(s, row, scale)
            for c in range(self.columns):
                self.m[s, c, j] = -root * self.column[c] if known else 0.0
            self.m[s, self.columns, j] = value
            # a limit that hangs on where the crank begins or ends stands beside that sample
            late: bint = fabs(limits.slopes[row, BY_LAST]) > fabs(limits.slopes[row, BY_FIRST])
            self.at_sample[s, at] = self.last_sample if late else self.first_sample
            self.by_angle[s, at] = -root * limits.slopes[row, BY_LAST if late else BY_FIRST]
            if self.timed or self.closed or not known:
                self.by_angle[s, at] = 0.0
            at += 1
        self.active[s] = at

    @cfunc
    def limit_column(self, s: cython.int, row: cython.int, scale: double):
        """Derivatives of a limit by shape and pose, into ``column``; lengths are the chart's over its crank, times |z1|."""
        limits, loop, shape = self.limits, self.shape.loop, self.shape
        by_size: double = 0.0
        for c in range(self.linear):
            self.column[c] = 0.0
        if limits.posed:
            for c in range(4):
                by_size += limits.slopes[row, c] * loop.length[c] / loop.length[0]
            z1 = self.pose[s, 1]
            size = sqrt(inner(z1, z1))
            size = size if size > 0.0 else 1.0
            # along z1 and across it
            by_z1 = vector(by_size, limits.slopes[row, BY_TURNED] / size) * times(1.0 / size, z1)
            self.column[0] = limits.slopes[row, BY_PIVOT]
            self.column[1] = limits.slopes[row, BY_PIVOT + 1]
            self.column[2] = by_z1.real
            self.column[3] = by_z1.imag
            self.column[4] = limits.slopes[row, BY_BODY]
            self.column[5] = limits.slopes[row, BY_BODY + 1]
        for k in range(self.size):
            total: double = -by_size * shape.by[0, k]
            for c in range(4):
                total += limits.slopes[row, c] * shape.by[c, k]
            self.column[self.linear + k] = scale * total
        if self.timed:
            both = limits.slopes[row, BY_FIRST] + limits.slopes[row, BY_LAST]
            self.column[self.columns - 1] = 0.0 if self.fixed_start else both

    @cfunc
    def newton(self, s: cython.int, scale: double) -> bint:
        """One step of shape and pose onto the limits that are broken, the shortest there is; False where none is."""
        for k in range(4):
            self.way[k] = 0.0
        if not self.shortest_step(s, scale):
            return False
        if self.shape.chart == GRASHOF:
            held: bint = False
            for k in range(4):
                if fabs(self.q[s, k]) <= AT_LEAST and copysign(1.0, self.q[s, k]) * self.step[self.linear + k] < 0.0:
                    self.way[k] = 1.0
                    held = True
            if held:
                self.shortest_step(s, scale)
        for i in range(self.samples):
            self.turn_step[i] = 0.0
        if self.has_rotation:
            self.step[self.linear - 1] = 0.0
        self.move(s, s)
        return True

    @cfunc
    def shortest_step(self, s: cython.int, scale: double) -> bint:
        """That step, without unknowns of the shape that ``way`` tells to stay; False where no limit is broken."""
        rows, largest = 0, 0.0
        for c in range(self.columns + 1):
            for j in range(self.width):
                self.red[c, j] = 0.0
        for row in range(self.limits.rows):
            value = self.limits.values[row]
            if not isfinite(value) or (fabs(value) <= KEPT if self.limits.equal[row] else value >= MARGIN):
                continue
            self.limit_column(s, row, scale)
            for c in range(self.columns):
                self.red[c, rows] = self.column[c]
            self.red[self.columns, rows] = value if self.limits.equal[row] else value - BEYOND
            rows += 1
        if rows == 0:
            return False
        for k in range(self.size):
            if self.way[k] != 0.0:
                for j in range(rows):
                    self.red[self.linear + k, j] = 0.0
        for c in range(self.columns):
            largest = max(largest, self.dot(c, c))
        for c in range(self.columns):
            self.ridge[c] = SHORTEST * largest if largest > 0.0 else 1.0
        self.orthogonal(0.0)
        for c in range(self.columns):
            self.step[c] = -self.upper[c, self.columns]
        self.upper_solve(self.step)
        return True

    # -- a step ----------------------------------------------------------------------------------------------------------

    @cfunc
    def angle_squares(self, s: cython.int) -> double:
        """Squares of the samples' rows' derivatives by their crank angles, into ``inner``; returns their mean."""
        n, total = self.samples, 0.0
        for i in range(n):
            self.inner[i] = 0.0
        for r in range(self.parts):
            base = r * n
            for i in range(n):
                self.inner[i] += self.turn[s, base + i] * self.turn[s, base + i]
        for k in range(self.active[s]):
            self.inner[self.at_sample[s, k]] += self.by_angle[s, k] * self.by_angle[s, k]
        for i in range(n):
            total += self.inner[i]
        return total / n

    @cfunc
    def reduce(self, s: cython.int, damping: double):
        """Rows with the crank angles eliminated, into ``red``; squares of its columns."""
        n, flat, active = self.samples, self.flat, self.active[s]
        if not self.timed:
            mean = self.angle_squares(s)
            if self.joined:
                for i in range(n):
                    if self.block[i] != i:
                        self.inner[self.block[i]] += self.inner[i]
                for i in range(n):
                    self.inner[i] = self.inner[self.block[i]]
            for i in range(n):
                own = ANGLE * damping * max(self.inner[i], BLUNT * mean) + FLAT * mean
                value = self.inner[i] + own
                value = value if value > 0.0 else 1.0
                self.inner[i] = value
                self.coefficient[i] = 1.0 / (value * (1.0 + sqrt(own / value)))
        for c in range(self.columns + 1):
            if self.timed:
                for j in range(flat + active):
                    self.red[c, j] = self.m[s, c, j]
            else:
                self.eliminate(s, c)
            for j in range(flat + active, self.width):
                self.red[c, j] = 0.0
            self.square[c] = self.dot(c, c)

    @cfunc
    def pool_violators(self):
        """The rising numbers nearest to ``wish`` by the weights ``inner``, in its place; each block's first into ``head``."""
        top: Py_ssize_t = 0
        for i in range(self.samples):
            self.level[top], self.weight[top], self.head[top] = self.wish[i], max(self.inner[i], TINY), i
            while top > 0 and self.level[top - 1] >= self.level[top]:
                total = self.weight[top - 1] + self.weight[top]
                self.level[top - 1] += self.weight[top] / total * (self.level[top] - self.level[top - 1])
                self.weight[top - 1] = total
                top -= 1
            top += 1
        end: Py_ssize_t = self.samples
        while top > 0:  # from behind, since heads lie where those of later samples go
            top -= 1
            first: Py_ssize_t = self.head[top]
            for i in range(first, end):
                self.wish[i] = self.level[top]
                self.head[i] = first
            end = first

    @cfunc
    def along_angles(self, s: cython.int, c: cython.int):
        """What a column has along the crank angles."""
        n = self.samples
        for i in range(n):
            self.along[c, i] = self.m[s, c, i] * self.turn[s, i]
        for r in range(1, self.parts):
            base = r * n
            for i in range(n):
                self.along[c, i] += self.m[s, c, base + i] * self.turn[s, base + i]
        for k in range(self.active[s]):
            self.along[c, self.at_sample[s, k]] += self.by_angle[s, k] * self.m[s, c, self.flat + k]

    @cfunc
    def eliminate(self, s: cython.int, c: cython.int):
        """A column of ``red``, and what it has along the crank angles."""
        n, flat = self.samples, self.flat
        self.along_angles(s, c)
        if self.joined:
            for i in range(n):
                if self.block[i] != i:
                    self.along[c, self.block[i]] += self.along[c, i]
            for i in range(n):
                self.along[c, i] = self.along[c, self.block[i]]
        for r in range(self.parts):
            base = r * n
            for i in range(n):
                part = self.coefficient[i] * self.turn[s, base + i] * self.along[c, i]
                self.red[c, base + i] = self.m[s, c, base + i] - part
        for k in range(self.active[s]):
            i = self.at_sample[s, k]
            part = self.coefficient[i] * self.by_angle[s, k] * self.along[c, i]
            self.red[c, flat + k] = self.m[s, c, flat + k] - part

    @cfunc
    @inline
    @cython.exceptval(check=False)
    def dot(self, a: cython.int, b: cython.int) -> double:
        """Product of two columns, in four sums that a processor takes at once."""
        s0: double = 0.0
        s1: double = 0.0
        s2: double = 0.0
        s3: double = 0.0
        for j in range(0, self.width, 4):
            s0 += self.red[a, j] * self.red[b, j]
            s1 += self.red[a, j + 1] * self.red[b, j + 1]
            s2 += self.red[a, j + 2] * self.red[b, j + 2]
            s3 += self.red[a, j + 3] * self.red[b, j + 3]
        return (s0 + s1) + (s2 + s3)

    @cfunc
    def triangle(self, damping: double):
        """R of the damped rows, the residual's column last, from normal equations where they will do."""
        for c in range(self.columns):
            self.ridge[c] = damping
            if self.square[c] > 0.0:
                # in their best pose linear unknowns need none; beside limits that a step meets it must come to an end
                none: bint = self.timed and not self.posed
                self.ridge[c] = 0.0 if none else damping * (LINEAR if c < self.linear else 1.0) * self.square[c]
        if not (damping > NORMAL and self.cholesky(damping)):
            self.orthogonal(damping)

    @cfunc
    def orthogonal(self, damping: double):
        """R by Gram and Schmidt with the pivot of each column as its own damping row, ``red`` used up.

        That is Householder's method on the rows with the damping rows above them. Given timing, damping is relative to what the
        linear columns leave.
        """
        for c in range(self.columns):
            if c == self.linear and self.timed and damping > 0.0:
                for k in range(c, self.columns):
                    if self.square[k] > 0.0:
                        self.ridge[k] = damping * max(self.dot(k, k), FLAT * self.square[k])
            root, norm = sqrt(self.ridge[c]), sqrt(self.dot(c, c) + self.ridge[c])
            self.upper[c, c] = norm
            for k in range(c + 1, self.columns + 1):
                self.upper[c, k] = 0.0
                if norm > 0.0:
                    product = self.dot(c, k) / norm
                    self.upper[c, k] = product
                    # v0 = root + norm, beta = 1 / (norm v0)
                    product /= norm + root
                    for j in range(self.width):
                        self.red[k, j] -= product * self.red[c, j]

    @cfunc
    def cholesky(self, damping: double) -> bint:
        """R from the normal matrix of the scaled columns; False where that is not well conditioned."""
        count = self.columns
        for c in range(count + 1):
            self.spare[c] = sqrt(self.square[c]) if self.square[c] > 0.0 else 1.0
        for c in range(count):
            for k in range(c, count + 1):
                value: double = self.square[c] if k == c else self.dot(c, k)
                value /= self.spare[c] * self.spare[k]
                for j in range(c if k > c else min(c, self.linear)):
                    value -= self.upper[j, c] * self.upper[j, k]
                if k > c:
                    self.upper[c, k] = value / self.upper[c, c]
                    continue
                if self.timed and c >= self.linear and self.square[c] > 0.0:
                    if not value > LEFT:
                        return False
                    self.ridge[c] = damping * value * self.square[c]
                value += self.ridge[c] / (self.spare[c] * self.spare[c])
                for j in range(self.linear, c):
                    value -= self.upper[j, c] * self.upper[j, c]
                if not value > PIVOT:
                    return False
                self.upper[c, c] = sqrt(value)
        for c in range(count):
            for k in range(c, count + 1):
                self.upper[c, k] *= self.spare[k]
        return True

    @cfunc
    def upper_solve(self, x: double[::1]):
        """R^{-1} x in place; zero where R is singular."""
        good: bint = True
        for c in range(self.columns - 1, -1, -1):
            value: double = x[c]
            for k in range(c + 1, self.columns):
                value -= self.upper[c, k] * x[k]
            x[c] = value / self.upper[c, c]
            good = good and isfinite(x[c])
        if not good:
            for c in range(self.columns):
                x[c] = 0.0

    @cfunc
    def angles_of(self, step: double[::1], turns: double[::1]):
        """The crank angles' part of a step of the other unknowns; ``turns`` begin as what the residual has along them."""
        n = self.samples
        if self.timed:
            for i in range(n):
                turns[i] = step[self.columns - 1]
            return
        for c in range(self.columns):
            for i in range(n):
                turns[i] += step[c] * self.along[c, i]
        for i in range(n):
            turns[i] = -turns[i] / self.inner[i]

    @cfunc
    def solve(self, s: cython.int, damping: double) -> double:
        """The step from a set; returns by how much a linear model's cost falls.

        Samples that would pass one another turn as one in a second solution, and come together.
        """
        self.joined = False
        fall = self.solved(s, damping)
        if self.ordered and not self.timed and self.join(s):
            fall = self.solved(s, damping)
            self.meet(s)
        return fall

    @cfunc
    def join(self, s: cython.int) -> bint:
        """Find the samples that are close and would pass one another: the first of each block into ``block``."""
        n = self.samples
        self.wanted_in_order(s, INFINITE)
        passing: bint = False
        for i in range(n):
            passing = passing or self.head[i] != i
        if not passing:
            return False
        self.wanted_in_order(s, CLOSE * fabs(self.phi[s, n - 1] - self.phi[s, 0]) / (n - 1))
        for i in range(n):
            self.block[i] = self.head[i]
            self.joined = self.joined or self.head[i] != i
        return self.joined

    @cfunc
    def solved(self, s: cython.int, damping: double) -> double:
        """The step, with the samples of a block as one."""
        total = 0.0
        self.reduce(s, damping)
        self.triangle(damping)
        for c in range(self.columns):
            self.step[c] = -self.upper[c, self.columns]
            total += self.step[c] * self.step[c]
        self.upper_solve(self.step)
        for c in range(self.columns):
            total += self.ridge[c] * self.step[c] * self.step[c]
            self.straight[c] = self.step[c]
        for i in range(self.samples):
            self.turn_step[i] = self.along[self.columns, i]
        self.angles_of(self.step, self.turn_step)
        return total

    @cfunc
    def meet(self, s: cython.int):
        """Let the samples of each block come together, into its middle."""
        n, end = self.samples, self.samples
        for k in range(n):
            first = n - 1 - k
            if self.block[first] == first:
                middle = 0.5 * (self.phi[s, first] + self.phi[s, end - 1])
                for i in range(first, end):
                    self.turn_step[i] += middle - self.phi[s, i]
                end = first

    @cfunc
    def bow(self, s: cython.int):
        """Bend the step by its second-order correction, from one more residual, unless that is not small beside it."""
        if self.joined:
            return
        n, longest, length = self.samples, 0.0, 0.0
        for c in range(self.columns):
            longest += self.step[c] * self.step[c]
        if not self.timed:
            for i in range(n):
                longest += self.turn_step[i] * self.turn_step[i]
        ahead = min(AHEAD, NOT_FAR / max(sqrt(longest), TINY))
        self.place_ahead(s, 2, ahead)
        for k in range(self.size):
            self.q[2, k] = self.q[s, k] + ahead * self.step[self.linear + k]
        for i in range(n):
            self.phi[2, i] = self.phi[s, i] + ahead * self.turn_step[i]
        self.shaped(2)
        if not self.turned(2, False):
            return
        self.residual(2, False)
        # half the second derivative along the step
        for j in range(self.flat):
            self.spare[j] = (self.m[2, self.columns, j] - self.m[s, self.columns, j]) / ahead
        for c in range(self.columns):
            value: double = self.step[c]
            for j in range(self.flat):
                self.spare[j] -= value * self.m[s, c, j]
        for i in range(n):
            self.bow_turn[i] = 0.0
        for r in range(self.parts):
            base = r * n
            for i in range(n):
                if not self.timed:
                    self.spare[base + i] -= self.turn[s, base + i] * self.turn_step[i]
                self.spare[base + i] /= ahead
                self.bow_turn[i] += self.turn[s, base + i] * self.spare[base + i]
        for i in range(n):
            self.gap[i] = 0.0 if self.timed else self.bow_turn[i] / self.inner[i]
        for c in range(self.columns):
            value = 0.0
            for j in range(self.flat):
                value += self.m[s, c, j] * self.spare[j]
            for i in range(n):
                value -= self.along[c, i] * self.gap[i]
            # R^T x = right
            for k in range(c):
                value += self.upper[k, c] * self.bow_step[k]
            self.bow_step[c] = -value / self.upper[c, c]
        self.upper_solve(self.bow_step)
        self.angles_of(self.bow_step, self.bow_turn)
        for c in range(self.columns):
            length += self.bow_step[c] * self.bow_step[c]
        if not self.timed:
            for i in range(n):
                length += self.bow_turn[i] * self.bow_turn[i]
        if sqrt(length) < BENT * sqrt(longest):
            for c in range(self.columns):
                self.step[c] += self.bow_step[c]
            for i in range(n):
                self.turn_step[i] += self.bow_turn[i]

    @cfunc
    def place_ahead(self, s: cython.int, t: cython.int, part: double):
        """Pose and offset of the set t: those of s after a part of its step."""
        self.side[t] = self.side[s]
        self.offset[t] = self.offset[s]
        if self.has_position:
            for k in range(3):
                self.pose[t, k] = self.pose[s, k] + vector(part * self.step[2 * k], part * self.step[2 * k + 1])
        if self.has_rotation:
            self.offset[t] += part * self.step[self.linear - 1]

    @cfunc
    def move(self, s: cython.int, t: cython.int):
        """The set s after its step, into the set t; each unknown and gap cut by itself."""
        self.place_ahead(s, t, 1.0)
        if self.shape.chart == GRASHOF:
            self.move_within(s, t)
        else:
            for k in range(self.size):
                self.q[t, k] = self.q[s, k] + inside(self.step[self.linear + k], LONGEST)
        if self.timed:
            start = self.phi[s, 0] + inside(self.step[self.columns - 1], LONGEST_START)
            for i in range(self.samples):
                self.phi[t, i] = start + self.crank[i]
        elif self.ordered:
            self.move_in_order(s, t)
        else:
            for i in range(self.samples):
                self.phi[t, i] = self.phi[s, i] + inside(self.turn_step[i], LONGEST_ANGLE)

    @cfunc
    def move_within(self, s: cython.int, t: cython.int):
        """The unknowns of a Grashof chart, each of its own sign, within their bounds and of scale one."""
        sign = copysign(1.0, self.q[s, 0])
        total: double = 0.0
        for k in range(4):
            own = sign if k == 0 else 1.0
            self.q[t, k] = max(own * (self.q[s, k] + inside(self.step[self.linear + k], LONGEST_GRASHOF)), TINY)
            total += self.q[t, k]
        for k in range(4):
            self.q[t, k] = max(self.q[t, k] / total, LEAST)
        self.q[t, 0] *= sign

    @cfunc
    def wanted_in_order(self, s: cython.int, close: double) -> double:
        """Where the step leads the crank angles, less a part of each gap, in order, into ``wish``; returns the way they turn.

        Samples farther apart than ``close`` don't meet: they are pooled as if they were far aside.
        """
        n, far = self.samples, 0.0
        way = 1.0 if self.phi[s, n - 1] >= self.phi[s, 0] else -1.0
        for i in range(n):
            if i > 0 and way * (self.phi[s, i] - self.phi[s, i - 1]) >= close:
                far += ASIDE
            self.wish[i] = far + way * (self.turn_step[i] + (1.0 - CLOSER) * (self.phi[s, i] - self.phi[s, 0]))
        self.pool_violators()
        return way

    @cfunc
    def move_in_order(self, s: cython.int, t: cython.int):
        """Crank angles after steps that are cut so that the samples keep their order and the crank stays within its span.

        Of all angles that leave a part of each gap those nearest to the steps, by the weights ``inner``: who passes a neighbour
        meets it between, the others turn as they want, and a turn that all make together changes no order.
        """
        n = self.samples
        span: double = 0.0
        new: double = 0.0
        cut: double = 0.0
        mean: double = 0.0
        way = self.wanted_in_order(s, INFINITE)
        for i in range(n - 1):
            gap = way * (self.phi[s, i + 1] - self.phi[s, i])
            self.gap[i] = self.wish[i + 1] - self.wish[i] + CLOSER * gap
            span += gap
            new += self.gap[i]
        room = self.span_max - GAP * (n - 1) - span
        longest = span + (WIDER * room if room > 0.0 else room)
        factor = min(1.0, longest / max(new, TINY))
        mean = way * self.wish[0]
        self.bow_turn[0] = 0.0
        for i in range(n - 1):
            gap = way * (self.phi[s, i + 1] - self.phi[s, i])
            cut += way * (max(self.gap[i] * factor, min(gap, GAP)) - gap)
            self.bow_turn[i + 1] = cut
            # the turn that was wanted, less what is made of it
            mean += way * self.wish[i + 1] - (1.0 - CLOSER) * (self.phi[s, i + 1] - self.phi[s, 0]) - cut
        mean = inside(mean / n, PI)
        for i in range(n):
            self.phi[t, i] = self.phi[s, i] + (self.bow_turn[i] + mean)

    # -- a run -----------------------------------------------------------------------------------------------------------

    def begin(self, shapes, poses, offsets, angles, branches, shifts, rho):
        """Take candidates, whose arrays later results go into; returns that of their costs.

        Shapes (n, k), poses (n, 6), offsets (n,), angles (n, N), branches (n,), shifts of the limits' rows (n, C); the weight
        of squared violations against J squared.
        """
        costs = np.empty(len(branches))
        self.shapes, self.poses, self.offsets, self.angles = shapes, poses.view(complex), offsets, angles
        self.branches, self.shifts, self.costs, self.rho = branches, shifts, costs, rho
        self.candidate, self.begun, self.least, self.taken = 0, False, INFINITE, 0
        return costs

    def renew(self, weight: double):
        """The shifts of the candidates' limits for another weight: what is still broken counts on."""
        for n in range(self.costs.shape[0]):
            self.take(0, n)
            self.shaped(0)
            self.constrained(0)
            for row in range(self.limits.rows):
                self.shifts[n, row] = self.rho / weight * self.lacking(row)
        self.rho = weight

    def descend(self, iterations, damping, stall, exact, others, bent_below):
        """Say how the candidates are to descend; see `descents.Problem.descended`."""
        self.iterations, self.first_damping, self.stall = iterations, damping, stall
        self.exact, self.others, self.bent_below = exact, others, bent_below
        self.candidate, self.begun = 0, False

    def run(self, most: Py_ssize_t):
        """Go on for so many steps; True once all candidates came to their end."""
        if self.others == 0.0 and self.least <= self.exact:
            return True
        while self.candidate < self.costs.shape[0]:
            if most <= 0:
                return False
            most -= 1
            if not (self.begun or self.start()):
                self.costs[self.candidate] = INFINITE
                self.candidate += 1
                continue
            ended: bint = self.iteration >= self.iterations or self.advance()
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

    @cfunc
    def start(self) -> bint:
        """Begin with the next candidate; False where it does not close."""
        self.take(0, self.candidate)
        if not self.first(0):
            return False
        self.give(0, self.candidate)
        self.begun = True
        self.here = 0
        self.iteration = 0
        self.damping = self.first_damping
        self.growth = 2.0
        self.best_cost = self.cost[0]
        for k in range(5):
            self.way[k] = 0.0
        return True

    @cfunc
    def first(self, s: cython.int) -> bint:
        """A candidate's beginning: in its best pose, where limits leave it that."""
        return self.evaluate(s, True, BEST_OFFSET if self.posed else BEST, False)

    @cfunc
    def advance(self) -> bint:
        """One step of the candidate; whether it was its last."""
        s, t, free = self.here, 1 - self.here, BEST_OFFSET
        before, predicted = self.cost[s], self.solve(s, self.damping)
        if self.best_cost < self.bent_below and not self.limited:
            self.bow(s)
        self.move(s, t)
        if not self.posed:
            free = BEST
        elif self.active[s] == 0 and not self.shifted:
            free = BEST_WITHIN
        closes = self.evaluate(t, True, free, False)
        decrease = before - self.cost[t]
        better: bint = closes and decrease > 0.0
        taken: bint = better or (closes and not self.joined and self.goes_on(self.cost[t]))
        finished: bint = (better and decrease < self.stall * before) or before < max(EXACT, self.exact)
        if better:
            gain = 2.0 * inside(decrease / max(predicted, TINY), 1.0) - 1.0
            self.damping = max(self.damping * max(FALL, 1.0 - gain * gain * gain), UNDAMPED)
        elif not taken:
            self.damping *= self.growth
        self.growth = 2.0 if taken else 2.0 * self.growth
        self.taken += 1
        if taken:
            self.here = t
            for k in range(self.unknowns):
                self.way[k] = self.straight[self.linear + k]
            if self.cost[t] < self.best_cost:
                self.best_cost = self.cost[t]
                self.give(t, self.candidate)
        return finished or self.damping > STUCK

    @cfunc
    def goes_on(self, cost: double) -> bint:
        """Whether a step uphill is taken: the farther, the straighter it goes on; so valleys are followed above their floor."""
        product, own, last = 0.0, 0.0, 0.0
        for k in range(self.unknowns):
            step = self.straight[self.linear + k]
            product += step * self.way[k]
            own += step * step
            last += self.way[k] * self.way[k]
        length = sqrt(own * last)
        part = 1.0 - min(max(product / (length if length > 0.0 else 1.0), 0.0), STRAIGHT)
        return part * part * cost < self.best_cost


# -- pairs of guides -----------------------------------------------------------------------------------------------------

# Unknowns of a pair: of each guide its running point (x, y), direction and offset of the curve's normal, and curvature
OF_GUIDE = declare(cython.int, 5)
BY_START = declare(cython.int, 10)  # the drive at the first sample, where it is given
# Derivatives by the pose at a sample, behind those by the unknowns: rotation, x, y
BY_ROTATION = declare(cython.int, 11)
BY_X = declare(cython.int, 12)
BY_Y = declare(cython.int, 13)
WIDTH = declare(cython.int, 14)
VALUE = declare(cython.int, 11)  # behind the derivatives by the unknowns

FAR_OFF = declare(double, 0.7)  # longest correction of a pose, in radians and length scales
LINED_UP = declare(double, 1e-9)  # least part of the second guide's own, where both guides have one force line
CLOSED = declare(
    double, 1e-7
)  # gap of a pose whose drive is given, in radians and length scales, below which it closes
ON_BRANCH = declare(double, 1e-3)  # least sine of the transmission angle: at a dead position the branches meet
APART = declare(double, 1e-3)  # least step of the drive between samples in their order, in radians or length scales
EQUAL = declare(double, 1e-8)  # to which a given length or place is kept
BLOCK = declare(cython.int, 64)  # rows that are made a triangle at once
LONGEST_PAIR = declare(double, 1.5)  # step of an unknown of a pair


@final
@cclass
class Guide:
    """One guide of a pair, a circle, rail or slot, and where its point is at a pose; see `guided.pairs` for the formulas."""

    place: cython.int  # 0 or 1: in the pair
    point: doublecomplex
    inward: doublecomplex
    offset: double
    unit: double
    curvature: double
    origin: doublecomplex
    straight: bint
    inverse: bint
    # at a pose, in the guide's own frame, which is the body's for a slot
    turned: doublecomplex
    frame: doublecomplex
    arm: doublecomplex
    at: doublecomplex
    from_foot: doublecomplex
    rise: double
    root: double
    distance: double
    normal: doublecomplex
    by_rotation: doublecomplex
    by_position: doublecomplex
    turn: double
    shift: doublecomplex

    @cfunc
    def take(self, unknowns: double[::1], labels: double[::1], place: cython.int):
        """A guide of a candidate."""
        own = OF_GUIDE * place
        self.place = place
        self.point = vector(unknowns[own], unknowns[own + 1])
        self.inward = vector(cos(unknowns[own + 2]), sin(unknowns[own + 2]))
        self.offset = unknowns[own + 3]
        first = 1 + own
        self.origin = vector(labels[first], labels[first + 1])
        self.unit = labels[first + 2]
        self.inverse = labels[first + 3] > 0.0
        self.straight = labels[first + 4] > 0.0
        self.curvature = 0.0 if self.straight else unknowns[own + 4] * self.unit

    @cfunc
    def pose(self, turned: doublecomplex, position: doublecomplex):
        """Its point at a pose: distance from the curve, and how that changes with the pose."""
        if self.inverse:
            self.frame = vector(turned.real, -turned.imag)
            self.arm = self.frame * self.point
            self.at = self.arm - self.frame * position
            self.by_rotation = vector(self.at.imag, -self.at.real)
            self.by_position = vector(-self.frame.real, -self.frame.imag)
        else:
            self.frame = turned
            self.arm = self.frame * self.point
            self.at = self.arm + position
            self.by_rotation = vector(-self.arm.imag, self.arm.real)
            self.by_position = vector(1.0, 0.0)
        self.turned = turned
        away = self.at - self.origin - times(self.offset, self.inward)
        bent = self.curvature
        self.from_foot = away
        self.rise = 0.5 * bent * inner(away, away) - inner(self.inward, away)
        self.root = sqrt(max(1.0 + 2.0 * bent * self.rise, 1e-24))
        self.distance = 2.0 * self.rise / (1.0 + self.root)
        self.normal = times(1.0 / self.root, times(bent, away) - self.inward)
        self.turn = inner(self.normal, self.by_rotation)
        self.shift = vector(inner(self.by_position, self.normal), cross(self.by_position, self.normal))

    @cfunc
    def by_point(self, out: doublecomplex[::1], moved: doublecomplex):
        """Derivatives by the running point of what moves with it, turned and stretched by a number."""
        own = OF_GUIDE * self.place
        out[own] = moved
        out[own + 1] = vector(-moved.imag, moved.real)

    @cfunc
    def columns(self, out: double[::1]):
        """Derivatives of the distance by the guide's unknowns."""
        own, bent, away = OF_GUIDE * self.place, self.curvature, self.from_foot
        out[own] = inner(self.normal, self.frame)
        out[own + 1] = -cross(self.normal, self.frame)
        out[own + 2] = -(1.0 + bent * self.offset) * cross(self.inward, away) / self.root
        out[own + 3] = -inner(self.normal, self.inward)
        out[own + 4] = 0.0
        if not self.straight:
            ahead = 1.0 + self.root
            rest = inner(away, away) / (2.0 * self.root) - 2.0 * self.rise * self.rise / (self.root * ahead * ahead)
            out[own + 4] = rest * self.unit

    @cfunc
    def normal_slopes(self, out: double[::1], sign: double):
        """Add derivatives of the normal's direction in the guide's frame, times a sign."""
        own, bent = OF_GUIDE * self.place, self.curvature
        part = sign / self.root
        out[BY_ROTATION] += part * bent * cross(self.normal, self.by_rotation)
        across = vector(cross(self.normal, self.by_position), inner(self.normal, self.by_position))
        out[BY_X] += part * bent * across.real
        out[BY_Y] += part * bent * across.imag
        out[own] += part * bent * cross(self.normal, self.frame)
        out[own + 1] += part * bent * inner(self.normal, self.frame)
        out[own + 2] -= part * (1.0 + bent * self.offset) * inner(self.normal, self.inward)
        out[own + 3] -= part * bent * cross(self.normal, self.inward)
        if not self.straight:
            out[own + 4] += part * self.unit * cross(self.normal, self.from_foot)

    @cfunc
    def travel(self) -> double:
        """The way of the point along a straight curve."""
        return cross(self.inward, self.at - self.origin)

    @cfunc
    def travel_slopes(self, out: double[::1]):
        """Add its derivatives."""
        own = OF_GUIDE * self.place
        out[BY_ROTATION] += cross(self.inward, self.by_rotation)
        out[BY_X] += cross(self.inward, self.by_position)
        out[BY_Y] += inner(self.inward, self.by_position)
        out[own] += cross(self.inward, self.frame)
        out[own + 1] += inner(self.inward, self.frame)
        out[own + 2] -= inner(self.inward, self.at - self.origin)

    @cfunc
    def ground(self) -> doublecomplex:
        """The place in the ground that both bodies share there."""
        return self.point if self.inverse else self.at

    @cfunc
    def ground_slopes(self, out: doublecomplex[::1]):
        """Its derivatives: of what runs in the ground those of its own place, of a pin those of its point alone."""
        if not self.inverse:
            self.own_slopes(out)
            return
        for c in range(WIDTH):
            out[c] = 0.0
        self.by_point(out, vector(1.0, 0.0))

    @cfunc
    def own_slopes(self, out: doublecomplex[::1]):
        """Derivatives of the place in the guide's own frame."""
        for c in range(WIDTH):
            out[c] = 0.0
        self.by_point(out, self.frame)
        out[BY_ROTATION] = self.by_rotation
        out[BY_X] = self.by_position
        out[BY_Y] = vector(-self.by_position.imag, self.by_position.real)

    @cfunc
    def pivot(self) -> doublecomplex:
        """Centre of a circle, pin of a slot."""
        if self.inverse or self.straight:
            return self.point
        return self.origin + times(self.offset + 1.0 / self.curvature, self.inward)

    @cfunc
    def pivot_slopes(self, out: doublecomplex[::1]):
        """Its derivatives."""
        for c in range(WIDTH):
            out[c] = 0.0
        if self.inverse or self.straight:
            self.by_point(out, vector(1.0, 0.0))
            return
        own, bent = OF_GUIDE * self.place, self.curvature
        out[own + 2] = times(self.offset + 1.0 / bent, vector(-self.inward.imag, self.inward.real))
        out[own + 3] = self.inward
        out[own + 4] = times(-self.unit / (bent * bent), self.inward)


@cfunc
def room(number) -> double:
    """A number of a limit; NaN where there is none."""
    return NAN if number is None else number


@final
@cclass
class PairDescent:
    """Levenberg-Marquardt over pairs of guides toward the samples of one request, and their limits.

    See `guided.pairs` for the mathematics, `guided.limits` for the limits. Lengths over the length scale, from the mean position.

    Parameters
    ----------
    samples : ndarray, shape (N, 8)
        Rotation, x and y of the position, reciprocals of the weights of rotation and position, whether either is missing (1 or
        0), and the drive from the first sample on.
    limits : dict
        Numbers by name, None where there is no such limit; ``pivots``, ``pivot_boxes``, ``reaches``: one of each pivot.
    driven : bool
        Whether the drive is given.

    Labels of candidates, (n, 15): whether the first guide, a slot, is turned about its pin; of each guide the origin (x, y), the
    unit of the curvature, whether it is a slot, whether it is straight; branch, the way that the drive goes, what is added to the
    least transmission angle, and along which of its own ways the drive counts.
    """

    number: Py_ssize_t
    given: double[:, ::1]
    driven: bint
    # limits
    transmission: double
    ordered: bint
    span_max: double
    arm_min: double
    stroke_max: double
    link_max: double
    link_min: double
    link_ratio: double
    coupler_radius: double
    dead: double
    extended: double
    crank: double
    coupler: double
    ground: double
    pivots: double[:, ::1]
    pivot_boxes: double[:, ::1]
    middle: doublecomplex
    reaches: double[::1]
    rail_boxes: double[:, ::1]
    far: double
    envelope: double[::1]
    keep_out: double[:, ::1]
    # a candidate
    size: cython.int
    one: Guide
    other: Guide
    hinge: bint
    slides: bint
    branch: double
    way: double
    margin: double
    sign: double
    start: double
    sweeps: cython.int
    weight: double  # of broken limits; 0 where none counts
    # at a sample
    angle: double
    position: doublecomplex
    l11: double
    l21: double
    l22: double
    top: double
    low: double
    inverse: double[:, ::1]
    lack: double
    opened: bint
    drive: double
    sine: double
    cosine: double
    gap: doublecomplex
    turning: double[::1]
    moving: doublecomplex[::1]
    row: double[::1]
    second: double[::1]
    by_drive: double[::1]
    vectors: doublecomplex[:, ::1]
    # at all samples, derivatives and value: the drive, the travel along the first guide and the second, a cylinder's length
    ways: double[:, :, ::1]
    # derivatives and values of the links: both cranks, the distance of two points, that of two pivots
    lengths: double[:, ::1]
    has: cython.int[4]
    # of a candidate at all samples
    full: bint
    kept: bint
    closed: bint
    poses: double[:, ::1]
    cost: double
    worst: double
    merit: double
    excess: double
    sines: double
    gone: double
    extension: double
    # rows made a triangle, by column; that of where a candidate stands; and damped
    filled: cython.int
    m: double[:, ::1]
    stand: double[:, ::1]
    upper: double[:, ::1]
    ridge: double[::1]
    step: double[::1]
    trial: double[::1]
    # the run
    unknowns: double[:, ::1]
    labels: double[:, ::1]
    costs: double[::1]
    candidate: Py_ssize_t
    begun: bint
    iteration: cython.int
    iterations: cython.int
    first_damping: double
    stall: double
    damping: double
    growth: double

    def __init__(self, samples, limits, driven):
        self.given = samples
        self.number = len(samples)
        self.driven = driven
        self.size = 11 if driven else 10
        self.transmission = limits["transmission"]
        self.ordered = limits["ordered"]
        self.span_max = limits["span_max"]
        self.arm_min = room(limits["arm_min"])
        self.stroke_max = room(limits["stroke_max"])
        self.link_max = room(limits["link_max"])
        self.link_min = room(limits["link_min"])
        self.link_ratio = room(limits["link_ratio_max"])
        self.coupler_radius = room(limits["coupler_radius_max"])
        self.dead = room(limits["cylinder_dead_length"])
        self.extended = room(limits["cylinder_extended_max"])
        self.crank, self.coupler, self.ground = room(limits["crank"]), room(limits["coupler"]), room(limits["ground"])
        self.pivots = limits["pivots"]
        self.pivot_boxes = limits["pivot_boxes"]
        self.middle = limits["reach_middle"]
        self.reaches = limits["reaches"]
        self.rail_boxes = limits["rail_boxes"]
        self.far = room(limits["far"])
        self.envelope = limits["envelope"]
        self.keep_out = limits["keep_out"]
        self.one, self.other = Guide(), Guide()
        self.inverse = np.zeros((3, 3))
        self.turning, self.moving = np.zeros(WIDTH), np.zeros(WIDTH, dtype=complex)
        self.row, self.second, self.by_drive = np.zeros(WIDTH), np.zeros(WIDTH), np.zeros(WIDTH)
        self.vectors = np.zeros((2, WIDTH), dtype=complex)
        self.ways = np.zeros((4, self.number, VALUE + 1))
        self.lengths = np.zeros((4, WIDTH + 1))
        self.has = np.zeros(4, dtype=np.intc)
        self.m, self.stand = np.zeros((12, BLOCK)), np.zeros((12, 12))
        self.upper = np.zeros((12, 24))
        self.ridge, self.step, self.trial = np.zeros(11), np.zeros(11), np.zeros(11)
        self.poses = np.zeros((self.number, 3))

    # -- a candidate at a sample -------------------------------------------------------------------------------------

    @cfunc
    def take(self, unknowns: double[::1], labels: double[::1]):
        """A candidate."""
        self.one.take(unknowns, labels, 0)
        self.other.take(unknowns, labels, 1)
        self.hinge = labels[0] > 0.0
        self.slides = self.one.straight and not self.hinge
        self.branch, self.way, self.margin, self.sign = labels[11], labels[12], labels[13], labels[14]
        self.start = unknowns[BY_START] if self.driven else 0.0

    @cfunc
    def pose(self, angle: double, position: doublecomplex):
        """Both guides at a pose."""
        self.angle, self.position = angle, position
        turned = vector(cos(angle), sin(angle))
        self.one.pose(turned, position)
        self.other.pose(turned, position)

    @cfunc
    def factor(self, i: Py_ssize_t, angle: double, position: doublecomplex):
        """L of S = B W^-1 B' at the pose that it is in, and L^-1 of the gaps toward a given one: ``top``, ``low``."""
        v, p, one, other = self.given[i, 3], self.given[i, 4], self.one, self.other
        s11 = v * one.turn * one.turn + p * inner(one.shift, one.shift)
        s12 = v * one.turn * other.turn + p * inner(one.shift, other.shift)
        s22 = v * other.turn * other.turn + p * inner(other.shift, other.shift)
        # the determinant as a sum of squares (Cauchy-Binet)
        differ = times(one.turn, other.shift) - times(other.turn, one.shift)
        area = cross(one.shift, other.shift)
        minors = v * p * inner(differ, differ) + p * p * area * area
        self.l11 = sqrt(max(s11, TINY))
        self.l21 = s12 / self.l11
        self.l22 = max(sqrt(minors) / self.l11, LINED_UP * sqrt(s22))
        back, away = angle - self.angle, position - self.position
        self.top = (one.distance + one.turn * back + inner(one.shift, away)) / self.l11
        low = other.distance + other.turn * back + inner(other.shift, away)
        self.low = (low - self.l21 * self.top) / self.l22

    @cfunc
    def correct(self, i: Py_ssize_t, sweeps: cython.int):
        """The pose that both guides allow that is nearest to the sample's."""
        angle, position = self.given[i, 0], vector(self.given[i, 1], self.given[i, 2])
        v, p = self.given[i, 3], self.given[i, 4]
        self.pose(angle, position)
        for sweep in range(sweeps):
            self.factor(i, angle, position)
            if sweep == sweeps - 1:
                break
            second = self.low / self.l22
            first = (self.top - self.l21 * second) / self.l11
            change = -v * (self.one.turn * first + self.other.turn * second)
            shift = times(-p, times(first, self.one.shift) + times(second, self.other.shift))
            part = 1.0 / max(1.0, max(fabs(change), sqrt(inner(shift, shift))) / FAR_OFF)
            self.pose(angle + part * change, position + times(part, shift))
            # what is missing begins anew where it is
            if self.given[i, 5] > 0.0:
                angle = self.angle
            if self.given[i, 6] > 0.0:
                position = self.position

    @cfunc
    def lead(self, i: Py_ssize_t, sweeps: cython.int):
        """The pose that a given drive leads to; where it does not reach so far the nearest one, and what the drive lacks."""
        wanted = self.start + self.sign * self.given[i, 7]
        self.pose(self.given[i, 0], vector(self.given[i, 1], self.given[i, 2]))
        for sweep in range(sweeps):
            self.inverted(wanted)
            if sweep == sweeps - 1:
                break
            turn = self.solved(0, self.one.distance, self.other.distance, self.lack)
            x = self.solved(1, self.one.distance, self.other.distance, self.lack)
            y = self.solved(2, self.one.distance, self.other.distance, self.lack)
            part = 1.0 / max(1.0, max(fabs(turn), sqrt(x * x + y * y)) / FAR_OFF)
            self.pose(self.angle - part * turn, self.position - vector(part * x, part * y))
        off = max(fabs(self.one.distance), max(fabs(self.other.distance), fabs(self.lack)))
        self.opened = not off <= CLOSED
        if self.opened:
            self.closed = False
            self.correct(i, 4)
            self.inverted(wanted)

    @cfunc
    def inverted(self, wanted: double):
        """The inverse of the derivatives of both distances and the drive by the pose, and what the drive lacks."""
        self.drive_slopes()
        self.lack = self.drive - wanted
        if not self.slides:
            self.lack -= TURN * rint(self.lack / TURN)
        a0, a1, a2 = self.one.turn, self.one.shift.real, self.one.shift.imag
        b0, b1, b2 = self.other.turn, self.other.shift.real, self.other.shift.imag
        c0, c1, c2 = self.by_drive[BY_ROTATION], self.by_drive[BY_X], self.by_drive[BY_Y]
        to = self.inverse
        to[0, 0], to[1, 0], to[2, 0] = b1 * c2 - b2 * c1, b2 * c0 - b0 * c2, b0 * c1 - b1 * c0
        to[0, 1], to[1, 1], to[2, 1] = c1 * a2 - c2 * a1, c2 * a0 - c0 * a2, c0 * a1 - c1 * a0
        to[0, 2], to[1, 2], to[2, 2] = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
        determinant = a0 * to[0, 0] + a1 * to[1, 0] + a2 * to[2, 0]
        if not fabs(determinant) > TINY:
            determinant = TINY
        for k in range(3):
            for j in range(3):
                to[k, j] /= determinant

    @cfunc
    def solved(self, k: cython.int, first: double, second: double, third: double) -> double:
        """A part of the change of the pose that closes three gaps."""
        return self.inverse[k, 0] * first + self.inverse[k, 1] * second + self.inverse[k, 2] * third

    @cfunc
    def drive_slopes(self):
        """The drive's coordinate at a pose, and its derivatives at that."""
        out = self.by_drive
        for c in range(WIDTH):
            out[c] = 0.0
        if self.slides:
            self.drive = self.one.travel()
            self.one.travel_slopes(out)
        elif self.hinge:
            self.drive = self.angle
            out[BY_ROTATION] = 1.0
        else:
            self.drive = atan2(self.one.normal.imag, self.one.normal.real)
            self.one.normal_slopes(out, 1.0)

    @cfunc
    def transmit(self):
        """The transmission angle's sine and cosine: between the follower's push and the way that its point would go."""
        push = self.one.turned * self.other.normal if self.other.inverse else self.other.normal
        self.gap = self.other.ground() - self.one.ground()
        size = sqrt(inner(self.gap, self.gap))
        to = self.one.turned * self.one.normal if self.hinge else times(1.0 / size if size > 0.0 else 1.0, self.gap)
        self.sine, self.cosine = cross(to, push), inner(to, push)

    @cfunc
    def transmission_slopes(self, out: double[::1], scale: double):
        """Derivatives of the sine, times a number."""
        for c in range(WIDTH):
            out[c] = 0.0
        self.other.normal_slopes(out, 1.0)
        if self.other.inverse:
            out[BY_ROTATION] += 1.0
        if self.hinge:
            out[BY_ROTATION] -= 1.0
            self.one.normal_slopes(out, -1.0)
        else:
            self.gap_slopes()
            square = max(inner(self.gap, self.gap), 1e-24)
            for c in range(WIDTH):
                out[c] -= cross(self.gap, self.vectors[0, c]) / square
        for c in range(WIDTH):
            out[c] *= scale * self.cosine

    @cfunc
    def gap_slopes(self):
        """Derivatives of the vector from the first guide's place in the ground to the second's, into ``vectors[0]``."""
        self.other.ground_slopes(self.vectors[0])
        self.one.ground_slopes(self.vectors[1])
        for c in range(WIDTH):
            self.vectors[0, c] = self.vectors[0, c] - self.vectors[1, c]

    # -- rows --------------------------------------------------------------------------------------------------------

    @cfunc
    def put(self, row: double[::1], scale: double, value: double):
        """A row of the least squares: its derivatives times a scale, and its value."""
        for c in range(self.size):
            self.m[c, self.filled] = scale * row[c]
        self.m[self.size, self.filled] = value
        self.cost += value * value
        self.filled += 1
        if self.filled == BLOCK:
            self.triangle(self.m, BLOCK)
            self.filled = self.size + 1

    @cfunc
    def triangle(self, m: double[:, ::1], rows: cython.int):
        """Rows as a triangle in their place, by Householder's method; the residual is the last column."""
        for c in range(min(self.size + 1, rows)):
            square = self.product(m, c, c, rows)
            if square > 0.0:
                norm = -copysign(sqrt(square), m[c, c])
                head = m[c, c] - norm
                m[c, c] = head
                for k in range(c + 1, self.size + 1):
                    product = self.product(m, c, k, rows) / (norm * head)
                    for j in range(c, rows):
                        m[k, j] += product * m[c, j]
                m[c, c] = norm
            for j in range(c + 1, rows):
                m[c, j] = 0.0

    @cfunc
    @inline
    @cython.exceptval(check=False)
    def product(self, m: double[:, ::1], a: cython.int, b: cython.int, rows: cython.int) -> double:
        """Product of two columns from the diagonal of the first one on, in two sums that a processor takes at once."""
        even: double = 0.0
        odd: double = 0.0
        for j in range(a, rows - 1, 2):
            even += m[a, j] * m[b, j]
            odd += m[a, j + 1] * m[b, j + 1]
        if (rows - a) % 2:
            even += m[a, rows - 1] * m[b, rows - 1]
        return even + odd

    @cfunc
    def own_rows(self, i: Py_ssize_t):
        """A sample's own rows, and the derivatives of its pose by the unknowns: ``turning``, ``moving``."""
        v, p, row, second = self.given[i, 3], self.given[i, 4], self.row, self.second
        for c in range(WIDTH):
            row[c], second[c], self.turning[c], self.moving[c] = 0.0, 0.0, 0.0, 0.0
        if self.driven:
            self.driven_rows(v, p, i)
            return
        if not self.full:
            self.cost += self.top * self.top + self.low * self.low
            return
        self.one.columns(row)
        self.other.columns(second)
        upper, lower = 1.0 / self.l11, 1.0 / self.l22
        for c in range(self.size):
            row[c] *= upper
            second[c] = (second[c] - self.l21 * row[c]) * lower
            low = second[c] * lower
            first = (row[c] - self.l21 * low) * upper
            self.turning[c] = -v * (self.one.turn * first + self.other.turn * low)
            self.moving[c] = times(-p, times(first, self.one.shift) + times(low, self.other.shift))
        self.put(row, 1.0, self.top)
        self.put(second, 1.0, self.low)

    @cfunc
    def driven_rows(self, v: double, p: double, i: Py_ssize_t):
        """The same where the drive is given: differences to the sample's pose, and what the drive lacks."""
        row, second = self.row, self.second
        off = self.given[i, 0] - self.angle
        off -= TURN * rint(off / TURN)
        away = vector(self.given[i, 1], self.given[i, 2]) - self.position
        turn = 0.0 if self.given[i, 5] > 0.0 else 1.0 / sqrt(v)
        place = 0.0 if self.given[i, 6] > 0.0 else 1.0 / sqrt(p)
        if self.full:
            self.one.columns(row)
            self.other.columns(second)
            self.by_drive[BY_START] = -1.0
            if not self.opened:
                for c in range(self.size):
                    third = self.by_drive[c]
                    self.turning[c] = -self.solved(0, row[c], second[c], third)
                    self.moving[c] = vector(
                        -self.solved(1, row[c], second[c], third), -self.solved(2, row[c], second[c], third)
                    )
            for c in range(self.size):
                row[c] = self.turning[c]
            self.put(row, -turn, turn * off)
            for c in range(self.size):
                row[c], second[c] = self.moving[c].real, self.moving[c].imag
            self.put(row, -place, place * away.real)
            self.put(second, -place, place * away.imag)
            if self.opened:
                self.put(self.by_drive, 1.0, self.lack)
        else:
            self.cost += turn * turn * off * off + place * place * inner(away, away)
            if self.opened:
                self.cost += self.lack * self.lack

    # -- limits ------------------------------------------------------------------------------------------------------

    @cfunc
    def lacks(self, value: double, among: double, equal: bint) -> bint:
        """Count a limit, one ``among`` so many of its kind; whether it needs its row."""
        off = value if equal else min(value, 0.0)
        if not isfinite(value):
            self.kept = False
            return False
        self.worst = max(self.worst, fabs(value) - EQUAL if equal else -value)
        self.excess += off * off
        self.merit += min(off * off, 1.0) / among
        return self.full and self.weight > 0.0 and (equal or value < MARGIN)

    @cfunc
    def hold(self, row: double[::1], sign: double, value: double, equal: bint):
        """The row of a limit whose derivatives at a pose, times a sign, are given: what the pose's own do is added."""
        scale = sqrt(self.weight)
        self.chained(row)
        self.put(row, sign * scale, scale * (value if equal else value - MARGIN))

    @cfunc
    def chained(self, row: double[::1]):
        """Add to derivatives at a pose what the pose's own do."""
        turn, x, y = row[BY_ROTATION], row[BY_X], row[BY_Y]
        for c in range(self.size):
            row[c] += turn * self.turning[c] + x * self.moving[c].real + y * self.moving[c].imag

    @cfunc
    def along(self, to: doublecomplex, v: cython.int) -> double[::1]:
        """Derivatives of a vector's part along a direction, from ``vectors``."""
        for c in range(WIDTH):
            self.row[c] = inner(to, self.vectors[v, c])
        return self.row

    @cfunc
    def slopes_of(self, what: cython.int):
        """Derivatives of a place into ``vectors[0]``: the body's, or those of its guides in the ground, and their pivots."""
        to = self.vectors[0]
        if what == 1 or what == 2:
            (self.one if what == 1 else self.other).ground_slopes(to)
        elif what == 3 or what == 4:
            (self.one if what == 3 else self.other).pivot_slopes(to)
        else:
            for c in range(WIDTH):
                to[c] = 0.0
            to[BY_X], to[BY_Y] = 1.0, vector(0.0, 1.0)

    @cfunc
    def inside(self, place: doublecomplex, what: cython.int, box: double[::1], among: double):
        """A place within a box."""
        for side in range(4):
            value = depth(place, side, box[side])
            if self.lacks(value, among, False):
                self.slopes_of(what)
                to = vector(0.0, 1.0) if side % 2 else vector(1.0, 0.0)
                self.hold(self.along(to, 0), 1.0 if side < 2 else -1.0, value, False)

    @cfunc
    def outside(self, place: doublecomplex, what: cython.int, box: double[::1]):
        """A place outside of a box: beyond the side that is nearest."""
        nearest: cython.int = 0
        for side in range(1, 4):
            if -depth(place, side, box[side]) > -depth(place, nearest, box[nearest]):
                nearest = side
        value = -depth(place, nearest, box[nearest])
        if self.lacks(value, 1.0, False):
            self.slopes_of(what)
            to = vector(0.0, 1.0) if nearest % 2 else vector(1.0, 0.0)
            self.hold(self.along(to, 0), -1.0 if nearest < 2 else 1.0, value, False)

    @cfunc
    def within(self, off: doublecomplex, what: cython.int, far: double, among: double):
        """A place no farther than that from another."""
        size = sqrt(inner(off, off))
        if self.lacks(far - size, among, False):
            self.slopes_of(what)
            self.hold(self.along(times(1.0 / max(size, 1e-12), off), 0), -1.0, far - size, False)

    @cfunc
    def at_sample(self):
        """The limits of a sample."""
        many: double = self.number
        least = max(sin(min(self.transmission + self.margin, 0.5 * PI - 1e-6)), ON_BRANCH)
        value = self.branch * self.sine - least
        if self.lacks(value, many, False):
            self.transmission_slopes(self.row, self.branch)
            self.hold(self.row, 1.0, value, False)
        if self.arm_min == self.arm_min and self.other.inverse and not self.hinge:
            size = sqrt(inner(self.gap, self.gap))
            value = self.branch * size * self.sine - self.arm_min
            if self.lacks(value, many, False):
                self.transmission_slopes(self.row, self.branch * size)
                self.gap_slopes()
                for c in range(WIDTH):
                    across = inner(self.gap, self.vectors[0, c]) / max(size, 1e-12)
                    self.row[c] += self.branch * self.sine * across
                self.hold(self.row, 1.0, value, False)
        if self.envelope[0] == self.envelope[0]:
            self.inside(self.position, 0, self.envelope, many)
            self.inside(self.one.ground(), 1, self.envelope, many)
            self.inside(self.other.ground(), 2, self.envelope, many)
        self.guide_at_sample(self.one, many)
        self.guide_at_sample(self.other, many)

    @cfunc
    def guide_at_sample(self, guide: Guide, many: double):
        """The limits of one guide at a sample."""
        if guide.straight and not guide.inverse:
            if self.rail_boxes[guide.place, 0] == self.rail_boxes[guide.place, 0]:
                self.inside(guide.ground(), 1 + guide.place, self.rail_boxes[guide.place], many)
            if self.far == self.far:
                self.within(guide.ground(), 1 + guide.place, self.far, many)
        if guide.inverse and self.link_max == self.link_max:  # how far out the slot is used
            size = sqrt(inner(guide.at, guide.at))
            if self.lacks(self.link_max - size, many, False):
                guide.own_slopes(self.vectors[0])
                to = times(1.0 / max(size, 1e-12), guide.at)
                self.hold(self.along(to, 0), -1.0, self.link_max - size, False)

    @cfunc
    def keep(self, which: cython.int, i: Py_ssize_t, value: double):
        """Keep what goes on from sample to sample: its value, and its derivatives in ``row`` at a pose."""
        self.ways[which, i, VALUE] = value
        if self.full:
            self.chained(self.row)
            for c in range(self.size):
                self.ways[which, i, c] = self.row[c]

    @cfunc
    def follow(self, i: Py_ssize_t):
        """Keep drive, strokes and a cylinder's length of a sample, as far as limits concern them."""
        if self.full and self.ordered:
            for c in range(WIDTH):
                self.row[c] = self.by_drive[c]
        self.keep(0, i, self.drive)
        if self.stroke_max == self.stroke_max:
            self.keep_travel(1, i, self.one)
            self.keep_travel(2, i, self.other)
        if self.one.inverse and not self.hinge:
            self.keep_travel(3, i, self.one)

    @cfunc
    def keep_travel(self, which: cython.int, i: Py_ssize_t, guide: Guide):
        """Keep the way along a straight guide."""
        if not guide.straight:
            return
        if self.full:
            for c in range(WIDTH):
                self.row[c] = 0.0
            guide.travel_slopes(self.row)
        self.keep(which, i, guide.travel())

    @cfunc
    def between(self, which: cython.int, i: Py_ssize_t, j: Py_ssize_t, sign: double, value: double):
        """The row of a limit of what was kept of one sample, less that of another."""
        for c in range(self.size):
            self.row[c] = self.ways[which, i, c] - self.ways[which, j, c]
        scale = sqrt(self.weight)
        self.put(self.row, sign * scale, scale * (value - MARGIN))

    @cfunc
    def over_samples(self):
        """The limits of all samples together: their order, the span of the drive, strokes, a cylinder's length."""
        last, way = self.number - 1, self.ways
        self.gone = 0.0
        worst = self.worst  # the order itself is looked at with the whole motion
        for i in range(last):
            gone: double = way[0, i + 1, VALUE] - way[0, i, VALUE]
            if not self.slides:
                gone -= TURN * rint(gone / TURN)
            self.gone += gone
            if self.ordered:
                value = self.way * gone - APART
                if self.lacks(value, 1.0 * last, False):
                    self.between(0, i + 1, i, self.way, value)
        self.worst = worst
        if self.ordered and not self.slides:
            value = self.span_max - self.way * self.gone
            if self.lacks(value, 1.0, False):
                self.between(0, last, 0, -self.way, value)
        if self.stroke_max == self.stroke_max:
            for k in range(1, 3):
                if (self.one if k == 1 else self.other).straight:
                    low: Py_ssize_t = 0
                    high: Py_ssize_t = 0
                    for i in range(1, self.number):
                        if way[k, i, VALUE] < way[k, low, VALUE]:
                            low = i
                        if way[k, i, VALUE] > way[k, high, VALUE]:
                            high = i
                    value = self.stroke_max - (way[k, high, VALUE] - way[k, low, VALUE])
                    if self.lacks(value, 1.0, False):
                        self.between(k, high, low, -1.0, value)

    @cfunc
    def reference(self) -> double:
        """Where a cylinder's length is measured from, along its slot; derivatives into ``second``.

        That is the foot of the other guide's body point, or where two slots of the body meet.
        """
        one, other, out = self.one, self.other, self.second
        for c in range(WIDTH):
            out[c] = 0.0
        if not other.inverse:
            away = other.point - one.origin
            out[OF_GUIDE], out[OF_GUIDE + 1] = -one.inward.imag, one.inward.real
            out[2] = -inner(one.inward, away)
            return cross(one.inward, away)
        along = vector(-one.inward.imag, one.inward.real)
        gap = other.origin + times(other.offset, other.inward) - one.origin - times(one.offset, one.inward)
        below = inner(other.inward, along)
        if not fabs(below) > 1e-12:
            below = 1e-12
        value = inner(other.inward, gap) / below
        facing = inner(other.inward, one.inward)
        out[2] = (value * facing - one.offset * below) / below
        out[3] = -facing / below
        out[OF_GUIDE + 2] = cross(other.inward, gap - times(value, along)) / below
        out[OF_GUIDE + 3] = 1.0 / below
        return value

    @cfunc
    def cylinder(self):
        """The limits of a cylinder's length at all samples, without its sign; ``extension`` is the mean, with it."""
        if not (self.one.inverse and not self.hinge):
            return
        start: double = self.reference()
        total: double = 0.0
        for i in range(self.number):
            total += self.ways[3, i, VALUE] - start
        self.extension = total / self.number
        sign = copysign(1.0, total)
        for i in range(self.number):
            length = sign * (self.ways[3, i, VALUE] - start)
            for k in range(2):
                side = sign if k == 0 else -sign
                value = length - self.dead if k == 0 else self.extended - length
                if value == value and self.lacks(value, 1.0 * self.number, False):
                    for c in range(self.size):
                        self.row[c] = self.ways[3, i, c] - self.second[c]
                    scale = sqrt(self.weight)
                    self.put(self.row, side * scale, scale * (value - MARGIN))

    @cfunc
    def distance_of(self, which: cython.int, gap: doublecomplex):
        """A link from the vector along it, whose derivatives are in ``vectors[0]``."""
        size = sqrt(inner(gap, gap))
        for c in range(WIDTH):
            self.lengths[which, c] = inner(gap, self.vectors[0, c]) / max(size, 1e-12)
        self.lengths[which, WIDTH] = size

    @cfunc
    def measure(self):
        """The links: both cranks, the distance of two points of the body or of two pins of the ground, that of two pivots."""
        one, other = self.one, self.other
        for k in range(2):
            guide = one if k == 0 else other
            self.has[k] = not guide.straight
            for c in range(WIDTH + 1):
                self.lengths[k, c] = 0.0
            if not guide.straight:
                bent = guide.curvature
                self.lengths[k, OF_GUIDE * k + 4] = -copysign(guide.unit / (bent * bent), bent)
                self.lengths[k, WIDTH] = 1.0 / fabs(bent)
        self.has[2] = one.inverse == other.inverse
        if self.has[2]:
            for k in range(2):
                for c in range(WIDTH):
                    self.vectors[k, c] = 0.0
            other.by_point(self.vectors[0], vector(1.0, 0.0))
            one.by_point(self.vectors[0], vector(-1.0, 0.0))
            self.distance_of(2, other.point - one.point)
        pinned: bint = (one.inverse or not one.straight) and (other.inverse or not other.straight)
        self.has[3] = pinned and not (one.inverse and other.inverse)
        if self.has[3]:
            other.pivot_slopes(self.vectors[0])
            one.pivot_slopes(self.vectors[1])
            for c in range(WIDTH):
                self.vectors[0, c] = self.vectors[0, c] - self.vectors[1, c]
            self.distance_of(3, other.pivot() - one.pivot())

    @cfunc
    def length(self, which: cython.int, sign: double, value: double, equal: bint):
        """A limit of one link."""
        if self.lacks(value, 1.0, equal):
            for c in range(WIDTH):
                self.row[c] = self.lengths[which, c]
            self.hold(self.row, sign, value, equal)

    @cfunc
    def over_links(self):
        """The limits of links."""
        self.measure()
        for k in range(4):
            if not self.has[k]:
                continue
            value = self.lengths[k, WIDTH]
            if self.link_max == self.link_max:
                self.length(k, -1.0, self.link_max - value, False)
            if self.link_min == self.link_min:
                self.length(k, 1.0, value - self.link_min, False)
            wanted = self.crank if k < 2 else self.ground if k == 3 or self.one.inverse else self.coupler
            if wanted == wanted:
                self.length(k, 1.0, value - wanted, True)
        if self.link_ratio == self.link_ratio:
            for j in range(2):
                for k in range(2, 4):
                    if self.has[j] and self.has[k]:
                        self.ratio(j, k)
                        self.ratio(k, j)

    @cfunc
    def ratio(self, j: cython.int, k: cython.int):
        """One link no shorter than another's part."""
        value = self.lengths[j, WIDTH] - self.lengths[k, WIDTH] / self.link_ratio
        if self.lacks(value, 1.0, False):
            for c in range(WIDTH):
                self.row[c] = self.lengths[j, c] - self.lengths[k, c] / self.link_ratio
            self.hold(self.row, 1.0, value, False)

    @cfunc
    def over_places(self, guide: Guide):
        """The limits of the point of a guide, and of its fixed pivot or pin."""
        k = guide.place
        if not guide.inverse:
            size = sqrt(inner(guide.point, guide.point))
            for j in range(2):
                far = self.link_max if j == 0 else self.coupler_radius if k == 0 else NAN
                if far == far and self.lacks(far - size, 1.0, False):
                    for c in range(WIDTH):
                        self.vectors[0, c] = 0.0
                    guide.by_point(self.vectors[0], vector(1.0, 0.0))
                    to = times(1.0 / max(size, 1e-12), guide.point)
                    self.hold(self.along(to, 0), -1.0, far - size, False)
        if guide.straight and not guide.inverse:
            return
        place = guide.pivot()
        if self.pivots[k, 0] == self.pivots[k, 0]:
            for side in range(2):
                value = (place.imag if side else place.real) - self.pivots[k, side]
                if self.lacks(value, 1.0, True):
                    self.slopes_of(3 + k)
                    self.hold(self.along(vector(0.0, 1.0) if side else vector(1.0, 0.0), 0), 1.0, value, True)
            return
        if self.pivot_boxes[k, 0] == self.pivot_boxes[k, 0]:
            self.inside(place, 3 + k, self.pivot_boxes[k], 1.0)
        if self.reaches[k] == self.reaches[k]:
            self.within(place - self.middle, 3 + k, self.reaches[k], 1.0)
        for box in range(self.keep_out.shape[0]):
            self.outside(place, 3 + k, self.keep_out[box])

    # -- a candidate -------------------------------------------------------------------------------------------------

    @cfunc
    def evaluate(self, full: bint, bounded: bint) -> bint:
        """Cost and limits of the candidate taken; ``full``: with the triangle of its rows. Whether they are numbers."""
        self.full = full
        self.cost, self.worst, self.merit, self.excess, self.sines = 0.0, 0.0, 0.0, 0.0, 0.0
        self.filled, self.extension = 0, 0.0
        self.kept, self.closed = True, True
        for i in range(self.number):
            if self.driven:
                self.lead(i, self.sweeps)
            else:
                self.correct(i, self.sweeps)
                self.drive_slopes()
            self.transmit()
            self.sines += self.sine
            self.own_rows(i)
            if bounded:
                self.at_sample()
            self.follow(i)
            self.poses[i, 0], self.poses[i, 1], self.poses[i, 2] = self.angle, self.position.real, self.position.imag
        self.over_samples()
        self.cylinder()
        if bounded:
            self.over_links()
            self.over_places(self.one)
            self.over_places(self.other)
        if full:
            self.triangle(self.m, self.filled)
            for c in range(self.size + 1):
                for j in range(self.filled, self.size + 1):
                    self.m[c, j] = 0.0
        return isfinite(self.cost) and (self.kept or not bounded)

    def look(self, unknowns: double[:, ::1], labels: double[:, ::1], sweeps: cython.int, bounded: bint):
        """Candidates as they are.

        Returns
        -------
        table : ndarray, shape (n, 8)
            Cost, whether all poses close, the most by which a limit is broken (order apart), the mean square of what is (no more
            than 1 each) summed over the limits, the sum of squares, the sum of the transmission angle's sines, the way that the
            drive goes from first to last, and a cylinder's mean length with its sign; infinite cost where it does not close.
        poses : ndarray, shape (n, N, 3)
        drive : ndarray, shape (n, N)
        """
        count = unknowns.shape[0]
        table, poses, drive = np.zeros((count, 8)), np.zeros((count, self.number, 3)), np.zeros((count, self.number))
        to: double[:, ::1] = table
        places: double[:, :, ::1] = poses
        drives: double[:, ::1] = drive
        self.sweeps, self.weight = sweeps, 0.0
        for n in range(count):
            self.take(unknowns[n], labels[n])
            good: bint = self.evaluate(False, bounded)
            to[n, 0] = self.cost if good else INFINITE
            to[n, 1], to[n, 2], to[n, 3], to[n, 4] = self.closed, self.worst, self.merit, self.excess
            to[n, 5], to[n, 6], to[n, 7] = self.sines, self.gone, self.extension
            for i in range(self.number):
                drives[n, i] = self.ways[0, i, VALUE]
                for k in range(3):
                    places[n, i, k] = self.poses[i, k]
        return table, poses, drive

    def gradient(self, unknowns: double[::1], labels: double[::1], weight: double, sweeps: cython.int):
        """The derivatives of a candidate's cost."""
        self.weight, self.sweeps = weight, sweeps
        self.take(unknowns, labels)
        self.evaluate(True, weight > 0.0)
        table = np.asarray(self.m)[: self.size + 1, : self.size + 1]
        return 2.0 * (table[:-1] @ table[-1])

    # -- descents ----------------------------------------------------------------------------------------------------

    def begin(self, unknowns, labels, iterations, damping, stall, weight, sweeps):
        """Take candidates (n, 10 or 11), which move, and their labels; returns their costs, which follow.

        ``weight``: of broken limits; 0 where none counts. Otherwise as of `least_squares.minimise`.
        """
        costs = np.full(len(unknowns), np.inf)
        self.unknowns, self.labels, self.costs = unknowns, labels, costs
        self.iterations, self.first_damping, self.stall = iterations, damping, stall
        self.weight, self.sweeps = weight, sweeps
        self.candidate, self.begun = 0, False
        return costs

    def run(self, most: Py_ssize_t):
        """Go on for so many steps; True once all candidates came to their end."""
        while self.candidate < self.costs.shape[0]:
            if most <= 0:
                return False
            most -= 1
            if self.begun:
                ended: bint = self.iteration >= self.iterations or self.advance()
            else:
                ended = not self.start_out()
            self.iteration += 1
            if ended:
                self.candidate += 1
                self.begun = False
        return True

    @cfunc
    def start_out(self) -> bint:
        """Begin with the next candidate; False where it does not close."""
        n = self.candidate
        self.take(self.unknowns[n], self.labels[n])
        if not self.evaluate(True, self.weight > 0.0):
            return False
        self.stay()
        self.iteration = -1
        self.damping, self.growth, self.begun = self.first_damping, 2.0, True
        return True

    @cfunc
    def stay(self):
        """Where it was evaluated last is where the candidate stands."""
        self.costs[self.candidate] = self.cost
        for c in range(self.size + 1):
            for j in range(self.size + 1):
                self.stand[c, j] = self.m[c, j]

    @cfunc
    def advance(self) -> bint:
        """One step of the candidate; whether it was its last."""
        n, before = self.candidate, self.costs[self.candidate]
        predicted = self.solve()
        for k in range(self.size):
            self.trial[k] = self.unknowns[n, k] + self.step[k]
        self.take(self.trial, self.labels[n])
        good: bint = self.evaluate(True, self.weight > 0.0)
        decrease = before - self.cost
        if not (good and decrease > 0.0):
            self.damping *= self.growth
            self.growth *= 2.0
            return before < EXACT or self.damping > STUCK
        for k in range(self.size):
            self.unknowns[n, k] = self.trial[k]
        self.stay()
        gain = 2.0 * min(decrease / max(predicted, TINY), 1.0) - 1.0
        self.damping = max(self.damping * max(FALL, 1.0 - gain * gain * gain), UNDAMPED)
        self.growth = 2.0
        return decrease < self.stall * before or before < EXACT

    @cfunc
    def solve(self) -> double:
        """The damped step; returns by how much a linear model's cost falls."""
        size, upper, step = self.size, self.upper, self.step
        for c in range(size + 1):
            square: double = 0.0
            for j in range(2 * size + 1):
                upper[c, j] = self.stand[c, j] if j <= size else 0.0
                square += upper[c, j] * upper[c, j]
            if c < size:
                self.ridge[c] = self.damping * max(square, 1e-24)
                upper[c, size + 1 + c] = sqrt(self.ridge[c])
        self.triangle(upper, 2 * size + 1)
        right, longest = 0.0, 0.0
        for c in range(size - 1, -1, -1):
            value: double = upper[size, c]
            right += value * value
            for k in range(c + 1, size):
                value -= upper[k, c] * step[k]
            step[c] = value / upper[c, c]
            longest = max(longest, fabs(step[c]))
        part = min(1.0, LONGEST_PAIR / max(longest, TINY))
        # |r|^2 - |r + J s|^2 with J' r = R' right: a sum of positive terms
        fall = part * (2.0 - part) * right
        for c in range(size):
            step[c] *= -part
            fall += self.ridge[c] * step[c] * step[c]
        return fall


# -- quadratic programs --------------------------------------------------------------------------------------------------


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


# -- valleys -------------------------------------------------------------------------------------------------------------


def apart(rows: double[:, ::1], reach: double[::1], kept, start: Py_ssize_t, most: Py_ssize_t):
    """Which rows to keep, best first: those that differ from every row kept before by their own reach in some number.

    ``rows`` (n, m), ``reach`` (n,); ``kept`` are kept already, the others are looked at from ``start`` on; ``most`` at most.
    """
    room = np.empty(len(rows) + len(kept), dtype=np.intp)
    out: Py_ssize_t[::1] = room
    count: Py_ssize_t = len(kept)
    room[:count] = kept
    for n in range(start, rows.shape[0]):
        if count >= most:
            break
        twin: bint = False
        for k in range(count):
            twin = True
            for c in range(rows.shape[1]):
                if not fabs(rows[out[k], c] - rows[n, c]) < reach[n]:
                    twin = False
                    break
            if twin:
                break
        if not twin:
            out[count] = n
            count += 1
    return room[:count]
