"""Levenberg-Marquardt descents of pairs of guides and their limits; `guided.pairs` derives the formulas.

Angles are in radians, lengths are relative to the length scale, costs to its square.
"""

import cython
import numpy as np
from cython import Py_ssize_t, bint, cclass, cfunc, declare, double, doublecomplex, final, inline
from cython.cimports.libc.math import atan2, copysign, cos, fabs, isfinite, rint, sin, sqrt
from cython.cimports.synthesis.kernels.plane import cross, depth, inner, times, vector

PI = declare(double, 3.141592653589793)
TURN = declare(double, 6.283185307179586)
NAN = declare(double, float("nan"))
INFINITE = declare(double, float("inf"))
TINY = declare(double, 1e-300)  # keeps a divisor from zero
MARGIN = declare(double, 1e-7)  # by which descents keep limits, so that rounding breaks none
FALL = declare(
    double, 0.1
)  # damping falls to this part in a step at least (Nielsen's rule), grows twice as fast each time,
UNDAMPED = declare(double, 1e-22)  # counts for nothing below,
STUCK = declare(double, 1e10)  # and ends a descent above
EXACT = declare(double, 1e-30)  # J squared that is rounding


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
        return 2.0 * (table[: self.size] @ table[self.size])

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
