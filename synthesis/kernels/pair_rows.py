"""Residuals and limits of pairs of guides with their derivatives; `guided.pairs` derives the formulas.

Angles are in radians, lengths are relative to the length scale, costs to its square.
"""

import cython
import numpy as np
from cython import Py_ssize_t, bint, cclass, cfunc, declare, double, doublecomplex, final
from cython.cimports.libc.math import atan2, copysign, cos, fabs, isfinite, rint, sin, sqrt
from cython.cimports.synthesis.kernels.codes import (
    BY_ROTATION,
    BY_START,
    BY_X,
    BY_Y,
    GUIDE_UNKNOWNS,
    PAIR_VALUE,
    PAIR_WIDTH,
)
from cython.cimports.synthesis.kernels.damped_steps import triangularise
from cython.cimports.synthesis.kernels.guide import Guide
from cython.cimports.synthesis.kernels.plane import cross, depth_inside, inner, times, vector

PI = declare(double, 3.141592653589793)
TURN = declare(double, 6.283185307179586)
NAN = declare(double, float("nan"))
INFINITE = declare(double, float("inf"))
TINY = declare(double, 1e-300)  # keeps divisors away from zero
MARGIN = declare(double, 1e-7)  # margin by which descents satisfy limits, so that rounding violates none
POSE_STEP_MAX = declare(double, 0.7)  # longest correction of a pose, in radians and length scales
INDEPENDENT_MIN = declare(double, 1e-9)  # smallest independent fraction of two guides that push along one line
CLOSURE_GAP = declare(double, 1e-7)  # gap below which a pose with prescribed drive closes
BRANCH_SINE_MIN = declare(double, 1e-3)  # smallest sine of the transmission angle: at a toggle position branches meet
DRIVE_STEP_MIN = declare(double, 1e-3)  # smallest step of the drive between ordered samples
EQUATION_TOLERANCE = declare(double, 1e-8)  # accuracy to which a prescribed length or position is satisfied
BLOCK = declare(cython.int, 64)  # rows that are triangularised at once


@cfunc
def room(number) -> double:
    """Return the number of a limit, or NaN if there is no limit."""
    return NAN if number is None else number


@final
@cclass
class PairRows:
    """Residuals of a pair of guides at the samples of one motion and rows of its limits, with derivatives.

    Lengths are relative to the length scale, positions to the mean position.

    Parameters
    ----------
    samples : ndarray, shape (N, 8)
        Rotation, position (x, y), reciprocals of the weights of rotation and position, whether either is missing (1 or 0), the
        drive relative to the first sample.
    limits : dict
        Numbers by name, None without such a limit; ``pivots``, ``pivot_boxes`` and ``reaches`` have an entry for each pivot.
    has_timing : bool
        Whether the drive is prescribed.

    Notes
    -----
    Labels of candidates have shape (n, 14): whether the first guide is a slot that turns about its pin; for each guide the origin
    (x, y), the unit of the curvature, whether it is a slot, whether it is straight; then the branch, the direction of the drive,
    and the sign of the drive's coordinate.
    """

    def __init__(self, samples, limits, has_timing):
        self.targets = samples
        self.samples = len(samples)
        self.has_timing = has_timing
        self.size = 11 if has_timing else 10
        self.transmission = limits["transmission"]
        self.ordered = limits["ordered"]
        self.span_max = limits["span_max"]
        self.arm_min = room(limits["arm_min"])
        self.stroke_max = room(limits["stroke_max"])
        self.link_max = room(limits["link_max"])
        self.link_min = room(limits["link_min"])
        self.link_ratio = room(limits["link_ratio_max"])
        self.coupler_radius = room(limits["coupler_radius_max"])
        self.cylinder_dead_length = room(limits["cylinder_dead_length"])
        self.cylinder_extended_max = room(limits["cylinder_extended_max"])
        self.crank, self.coupler, self.ground = room(limits["crank"]), room(limits["coupler"]), room(limits["ground"])
        self.pivots, self.pivot_boxes = limits["pivots"], limits["pivot_boxes"]
        self.middle, self.reaches = limits["reach_middle"], limits["reaches"]
        self.rail_boxes = limits["rail_boxes"]
        self.rail_reach = room(limits["far"])
        self.envelope = limits["envelope"]
        self.keep_out = limits["keep_out"]
        self.first_guide, self.second_guide = Guide(), Guide()
        self.pose_inverse = np.zeros((3, 3))
        self.rotation_slopes, self.position_slopes = np.zeros(PAIR_WIDTH), np.zeros(PAIR_WIDTH, dtype=complex)
        self.row, self.second_row, self.drive_row = np.zeros(PAIR_WIDTH), np.zeros(PAIR_WIDTH), np.zeros(PAIR_WIDTH)
        self.vectors = np.zeros((2, PAIR_WIDTH), dtype=complex)
        self.tracked = np.zeros((4, self.samples, PAIR_VALUE + 1))
        self.lengths = np.zeros((4, PAIR_WIDTH + 1))
        self.has_length = np.zeros(4, dtype=np.intc)
        self.rows = np.zeros((12, BLOCK))
        self.poses = np.zeros((self.samples, 3))

    # -- candidate at a sample -------------------------------------------------------------------------------------

    @cfunc
    def load(self, unknowns: double[::1], labels: double[::1]):
        """Load a candidate."""
        self.first_guide.load(unknowns, labels, 0)
        self.second_guide.load(unknowns, labels, 1)
        self.is_hinge = labels[0] > 0.0
        self.is_slider = self.first_guide.is_straight and not self.is_hinge
        self.branch, self.direction, self.sign = labels[11], labels[12], labels[13]
        self.start = unknowns[BY_START] if self.has_timing else 0.0

    @cfunc
    def set_pose(self, angle: double, position: doublecomplex):
        """Set the pose of both guides."""
        self.rotation, self.position = angle, position
        turned = vector(cos(angle), sin(angle))
        self.first_guide.set_pose(turned, position)
        self.second_guide.set_pose(turned, position)

    @cfunc
    def factorise_pose_system(self, i: Py_ssize_t, angle: double, position: doublecomplex):
        """Factorise S = B W^-1 B' at the current pose and solve L x = gaps towards a given pose."""
        v, p, first, second = self.targets[i, 3], self.targets[i, 4], self.first_guide, self.second_guide
        turn1, turn2 = first.rotation_slope, second.rotation_slope
        move1, move2 = first.position_slope, second.position_slope
        s11 = v * turn1 * turn1 + p * inner(move1, move1)
        s12 = v * turn1 * turn2 + p * inner(move1, move2)
        s22 = v * turn2 * turn2 + p * inner(move2, move2)
        # the determinant as a sum of squares (Cauchy-Binet)
        differ, area = times(turn1, move2) - times(turn2, move1), cross(move1, move2)
        minors = v * p * inner(differ, differ) + p * p * area * area
        self.l11 = sqrt(max(s11, TINY))
        self.l21 = s12 / self.l11
        self.l22 = max(sqrt(minors) / self.l11, INDEPENDENT_MIN * sqrt(s22))
        back, away = angle - self.rotation, position - self.position
        self.first_residual = (first.distance + turn1 * back + inner(move1, away)) / self.l11
        low = second.distance + turn2 * back + inner(move2, away)
        self.second_residual = (low - self.l21 * self.first_residual) / self.l22

    @cfunc
    def project_pose(self, i: Py_ssize_t, sweeps: cython.int):
        """Find the pose on both guides that is nearest to a sample."""
        angle, position = self.targets[i, 0], vector(self.targets[i, 1], self.targets[i, 2])
        v, p, first, second = self.targets[i, 3], self.targets[i, 4], self.first_guide, self.second_guide
        self.set_pose(angle, position)
        for sweep in range(sweeps):
            self.factorise_pose_system(i, angle, position)
            if sweep == sweeps - 1:
                break
            force2 = self.second_residual / self.l22
            force1 = (self.first_residual - self.l21 * force2) / self.l11
            change = -v * (first.rotation_slope * force1 + second.rotation_slope * force2)
            shift = times(-p, times(force1, first.position_slope) + times(force2, second.position_slope))
            part = 1.0 / max(1.0, max(fabs(change), sqrt(inner(shift, shift))) / POSE_STEP_MAX)
            self.set_pose(angle + part * change, position + times(part, shift))
            # a missing coordinate restarts from its current value
            if self.targets[i, 5] > 0.0:
                angle = self.rotation
            if self.targets[i, 6] > 0.0:
                position = self.position

    @cfunc
    def solve_driven_pose(self, i: Py_ssize_t, sweeps: cython.int):
        """Find the pose of a prescribed drive. If the drive cannot reach it, take the nearest pose and record the gap."""
        target, first, second = self.start + self.sign * self.targets[i, 7], self.first_guide, self.second_guide
        self.set_pose(self.targets[i, 0], vector(self.targets[i, 1], self.targets[i, 2]))
        for sweep in range(sweeps):
            self.invert_pose_system(target)
            if sweep == sweeps - 1:
                break
            turn = self.pose_change(0, first.distance, second.distance, self.drive_gap)
            x = self.pose_change(1, first.distance, second.distance, self.drive_gap)
            y = self.pose_change(2, first.distance, second.distance, self.drive_gap)
            part = 1.0 / max(1.0, max(fabs(turn), sqrt(x * x + y * y)) / POSE_STEP_MAX)
            self.set_pose(self.rotation - part * turn, self.position - vector(part * x, part * y))
        off = max(fabs(first.distance), max(fabs(second.distance), fabs(self.drive_gap)))
        self.is_open = not off <= CLOSURE_GAP
        if self.is_open:
            self.closed = False
            self.project_pose(i, 4)
            self.invert_pose_system(target)

    @cfunc
    def invert_pose_system(self, target: double):
        """Invert the derivatives of both distances and the drive with respect to the pose, and compute the drive's gap."""
        self.update_drive()
        self.drive_gap = self.drive - target
        if not self.is_slider:
            self.drive_gap -= TURN * rint(self.drive_gap / TURN)
        first, second = self.first_guide, self.second_guide
        a0, a1, a2 = first.rotation_slope, first.position_slope.real, first.position_slope.imag
        b0, b1, b2 = second.rotation_slope, second.position_slope.real, second.position_slope.imag
        c0, c1, c2 = self.drive_row[BY_ROTATION], self.drive_row[BY_X], self.drive_row[BY_Y]
        to = self.pose_inverse
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
    def pose_change(self, k: cython.int, first: double, second: double, third: double) -> double:
        """Return one component of the change of pose that closes three gaps."""
        return self.pose_inverse[k, 0] * first + self.pose_inverse[k, 1] * second + self.pose_inverse[k, 2] * third

    @cfunc
    def update_drive(self):
        """Compute the drive's coordinate at the pose and its derivatives."""
        out = self.drive_row
        for c in range(PAIR_WIDTH):
            out[c] = 0.0
        if self.is_slider:
            self.drive = self.first_guide.travel()
            self.first_guide.travel_slopes(out)
        elif self.is_hinge:
            self.drive = self.rotation
            out[BY_ROTATION] = 1.0
        else:
            self.drive = atan2(self.first_guide.normal.imag, self.first_guide.normal.real)
            self.first_guide.normal_slopes(out, 1.0)

    @cfunc
    def update_transmission(self):
        """Compute sine and cosine of the transmission angle between the follower's push and the direction of its point."""
        first, second = self.first_guide, self.second_guide
        push = first.rotation * second.normal if second.is_slot else second.normal
        self.gap = second.ground_point() - first.ground_point()
        size = sqrt(inner(self.gap, self.gap))
        to = first.rotation * first.normal if self.is_hinge else times(1.0 / size if size > 0.0 else 1.0, self.gap)
        self.sine, self.cosine = cross(to, push), inner(to, push)

    @cfunc
    def transmission_slopes(self, out: double[::1], scale: double):
        """Fill the derivatives of the sine, times a factor."""
        for c in range(PAIR_WIDTH):
            out[c] = 0.0
        self.second_guide.normal_slopes(out, 1.0)
        if self.second_guide.is_slot:
            out[BY_ROTATION] += 1.0
        if self.is_hinge:
            out[BY_ROTATION] -= 1.0
            self.first_guide.normal_slopes(out, -1.0)
        else:
            self.gap_slopes()
            square = max(inner(self.gap, self.gap), 1e-24)
            for c in range(PAIR_WIDTH):
                out[c] -= cross(self.gap, self.vectors[0, c]) / square
        for c in range(PAIR_WIDTH):
            out[c] *= scale * self.cosine

    @cfunc
    def gap_slopes(self):
        """Fill the derivatives of the vector between the ground points of both guides."""
        self.second_guide.ground_point_slopes(self.vectors[0])
        self.first_guide.ground_point_slopes(self.vectors[1])
        for c in range(PAIR_WIDTH):
            self.vectors[0, c] = self.vectors[0, c] - self.vectors[1, c]

    # -- rows --------------------------------------------------------------------------------------------------------

    @cfunc
    def put_row(self, row: double[::1], scale: double, value: double):
        """Append a least-squares row: derivatives times a scale, and the residual."""
        for c in range(self.size):
            self.rows[c, self.filled_rows] = scale * row[c]
        self.rows[self.size, self.filled_rows] = value
        self.cost += value * value
        self.filled_rows += 1
        if self.filled_rows == BLOCK:
            triangularise(self.rows, self.size + 1, BLOCK)
            self.filled_rows = self.size + 1

    @cfunc
    def fill_sample_rows(self, i: Py_ssize_t):
        """Append the rows of a sample and compute the derivatives of its pose with respect to the unknowns."""
        v, p, row, second = self.targets[i, 3], self.targets[i, 4], self.row, self.second_row
        for c in range(PAIR_WIDTH):
            row[c], second[c], self.rotation_slopes[c], self.position_slopes[c] = 0.0, 0.0, 0.0, 0.0
        if self.has_timing:
            self.fill_driven_rows(v, p, i)
            return
        if not self.with_rows:
            self.cost += self.first_residual * self.first_residual + self.second_residual * self.second_residual
            return
        first_guide, second_guide = self.first_guide, self.second_guide
        first_guide.distance_slopes(row)
        second_guide.distance_slopes(second)
        upper, lower = 1.0 / self.l11, 1.0 / self.l22
        for c in range(self.size):
            row[c] *= upper
            second[c] = (second[c] - self.l21 * row[c]) * lower
            force2 = second[c] * lower
            force1 = (row[c] - self.l21 * force2) * upper
            turned = first_guide.rotation_slope * force1 + second_guide.rotation_slope * force2
            self.rotation_slopes[c] = -v * turned
            moved = times(force1, first_guide.position_slope) + times(force2, second_guide.position_slope)
            self.position_slopes[c] = times(-p, moved)
        self.put_row(row, 1.0, self.first_residual)
        self.put_row(second, 1.0, self.second_residual)

    @cfunc
    def fill_driven_rows(self, v: double, p: double, i: Py_ssize_t):
        """Append the rows of a sample with a prescribed drive: gaps to the sample's pose, and the drive's gap."""
        row, second = self.row, self.second_row
        off = self.targets[i, 0] - self.rotation
        off -= TURN * rint(off / TURN)
        away = vector(self.targets[i, 1], self.targets[i, 2]) - self.position
        turn = 0.0 if self.targets[i, 5] > 0.0 else 1.0 / sqrt(v)
        point = 0.0 if self.targets[i, 6] > 0.0 else 1.0 / sqrt(p)
        if self.with_rows:
            self.first_guide.distance_slopes(row)
            self.second_guide.distance_slopes(second)
            self.drive_row[BY_START] = -1.0
            if not self.is_open:
                for c in range(self.size):
                    third = self.drive_row[c]
                    self.rotation_slopes[c] = -self.pose_change(0, row[c], second[c], third)
                    x = self.pose_change(1, row[c], second[c], third)
                    y = self.pose_change(2, row[c], second[c], third)
                    self.position_slopes[c] = vector(-x, -y)
            for c in range(self.size):
                row[c] = self.rotation_slopes[c]
            self.put_row(row, -turn, turn * off)
            for c in range(self.size):
                row[c], second[c] = self.position_slopes[c].real, self.position_slopes[c].imag
            self.put_row(row, -point, point * away.real)
            self.put_row(second, -point, point * away.imag)
            if self.is_open:
                self.put_row(self.drive_row, 1.0, self.drive_gap)
        else:
            self.cost += turn * turn * off * off + point * point * inner(away, away)
            if self.is_open:
                self.cost += self.drive_gap * self.drive_gap

    # -- limits ------------------------------------------------------------------------------------------------------

    @cfunc
    def register_limit(self, value: double, among: double, equal: bint) -> bint:
        """Record the value of a limit, one of ``among`` of its kind. Return whether it needs a row."""
        off = value if equal else min(value, 0.0)
        if not isfinite(value):
            self.is_valid = False
            return False
        self.worst = max(self.worst, fabs(value) - EQUATION_TOLERANCE if equal else -value)
        self.violation_squares += off * off
        self.merit += min(off * off, 1.0) / among
        return self.with_rows and self.weight > 0.0 and (equal or value < MARGIN)

    @cfunc
    def put_limit_row(self, row: double[::1], sign: double, value: double, equal: bint):
        """Append the row of a limit from its derivatives at a pose, times a sign."""
        scale = sqrt(self.weight)
        self.chain_pose_slopes(row)
        self.put_row(row, sign * scale, scale * (value if equal else value - MARGIN))

    @cfunc
    def chain_pose_slopes(self, row: double[::1]):
        """Add the contribution of the pose to the derivatives in a row."""
        turn, x, y = row[BY_ROTATION], row[BY_X], row[BY_Y]
        for c in range(self.size):
            moved = self.position_slopes[c]
            row[c] += turn * self.rotation_slopes[c] + x * moved.real + y * moved.imag

    @cfunc
    def project_slopes(self, to: doublecomplex, v: cython.int) -> double[::1]:
        """Fill ``row`` with the derivatives of a vector's component along a direction."""
        for c in range(PAIR_WIDTH):
            self.row[c] = inner(to, self.vectors[v, c])
        return self.row

    @cfunc
    def put_slopes_of(self, what: cython.int):
        """Fill the derivatives of a point: 0 the body, 1 and 2 the ground points of the guides, 3 and 4 their pivots."""
        to = self.vectors[0]
        if what == 1 or what == 2:
            (self.first_guide if what == 1 else self.second_guide).ground_point_slopes(to)
        elif what == 3 or what == 4:
            (self.first_guide if what == 3 else self.second_guide).pivot_slopes(to)
        else:
            for c in range(PAIR_WIDTH):
                to[c] = 0.0
            to[BY_X], to[BY_Y] = 1.0, vector(0.0, 1.0)

    @cfunc
    def inside_box(self, point: doublecomplex, what: cython.int, box: double[::1], among: double):
        """Add the limits that keep a point inside a box."""
        for side in range(4):
            value = depth_inside(point, side, box[side])
            if self.register_limit(value, among, False):
                self.put_slopes_of(what)
                to = vector(0.0, 1.0) if side % 2 else vector(1.0, 0.0)
                self.put_limit_row(self.project_slopes(to, 0), 1.0 if side < 2 else -1.0, value, False)

    @cfunc
    def outside_box(self, point: doublecomplex, what: cython.int, box: double[::1]):
        """Add the limit that keeps a point outside a box, beyond the nearest side."""
        nearest: cython.int = 0
        for side in range(1, 4):
            if -depth_inside(point, side, box[side]) > -depth_inside(point, nearest, box[nearest]):
                nearest = side
        value = -depth_inside(point, nearest, box[nearest])
        if self.register_limit(value, 1.0, False):
            self.put_slopes_of(what)
            to = vector(0.0, 1.0) if nearest % 2 else vector(1.0, 0.0)
            self.put_limit_row(self.project_slopes(to, 0), -1.0 if nearest < 2 else 1.0, value, False)

    @cfunc
    def within_distance(self, off: doublecomplex, what: cython.int, distance: double, among: double):
        """Add the limit that keeps a point within a distance."""
        size = sqrt(inner(off, off))
        if self.register_limit(distance - size, among, False):
            self.put_slopes_of(what)
            row = self.project_slopes(times(1.0 / max(size, 1e-12), off), 0)
            self.put_limit_row(row, -1.0, distance - size, False)

    @cfunc
    def sample_limits(self):
        """Add the limits of a sample."""
        many: double = self.samples
        sine_min = max(sin(min(self.transmission, 0.5 * PI - 1e-6)), BRANCH_SINE_MIN)
        value = self.branch * self.sine - sine_min
        if self.register_limit(value, many, False):
            self.transmission_slopes(self.row, self.branch)
            self.put_limit_row(self.row, 1.0, value, False)
        if self.arm_min == self.arm_min and self.second_guide.is_slot and not self.is_hinge:
            size = sqrt(inner(self.gap, self.gap))
            value = self.branch * size * self.sine - self.arm_min
            if self.register_limit(value, many, False):
                self.transmission_slopes(self.row, self.branch * size)
                self.gap_slopes()
                for c in range(PAIR_WIDTH):
                    across = inner(self.gap, self.vectors[0, c]) / max(size, 1e-12)
                    self.row[c] += self.branch * self.sine * across
                self.put_limit_row(self.row, 1.0, value, False)
        if self.envelope[0] == self.envelope[0]:
            self.inside_box(self.position, 0, self.envelope, many)
            self.inside_box(self.first_guide.ground_point(), 1, self.envelope, many)
            self.inside_box(self.second_guide.ground_point(), 2, self.envelope, many)
        self.guide_limits(self.first_guide, many)
        self.guide_limits(self.second_guide, many)

    @cfunc
    def guide_limits(self, guide: Guide, many: double):
        """Add the limits of one guide at a sample."""
        if guide.is_straight and not guide.is_slot:
            if self.rail_boxes[guide.index, 0] == self.rail_boxes[guide.index, 0]:
                self.inside_box(guide.ground_point(), 1 + guide.index, self.rail_boxes[guide.index], many)
            if self.rail_reach == self.rail_reach:
                self.within_distance(guide.ground_point(), 1 + guide.index, self.rail_reach, many)
        if guide.is_slot and self.link_max == self.link_max:  # used end of the slot
            size = sqrt(inner(guide.local_point, guide.local_point))
            if self.register_limit(self.link_max - size, many, False):
                guide.local_slopes(self.vectors[0])
                to = times(1.0 / max(size, 1e-12), guide.local_point)
                self.put_limit_row(self.project_slopes(to, 0), -1.0, self.link_max - size, False)

    @cfunc
    def store_tracked(self, which: cython.int, i: Py_ssize_t, value: double):
        """Store a quantity that is compared between samples, and its derivatives."""
        self.tracked[which, i, PAIR_VALUE] = value
        if self.with_rows:
            self.chain_pose_slopes(self.row)
            for c in range(self.size):
                self.tracked[which, i, c] = self.row[c]

    @cfunc
    def track_drive(self, i: Py_ssize_t):
        """Store the drive, the strokes and the length of a cylinder at a sample."""
        if self.with_rows and self.ordered:
            for c in range(PAIR_WIDTH):
                self.row[c] = self.drive_row[c]
        self.store_tracked(0, i, self.drive)
        if self.stroke_max == self.stroke_max:
            self.track_travel(1, i, self.first_guide)
            self.track_travel(2, i, self.second_guide)
        if self.first_guide.is_slot and not self.is_hinge:
            self.track_travel(3, i, self.first_guide)

    @cfunc
    def track_travel(self, which: cython.int, i: Py_ssize_t, guide: Guide):
        """Store the travel along a straight guide."""
        if not guide.is_straight:
            return
        if self.with_rows:
            for c in range(PAIR_WIDTH):
                self.row[c] = 0.0
            guide.travel_slopes(self.row)
        self.store_tracked(which, i, guide.travel())

    @cfunc
    def put_difference_row(self, which: cython.int, i: Py_ssize_t, j: Py_ssize_t, sign: double, value: double):
        """Append the row of a limit on the difference of a tracked quantity between two samples."""
        for c in range(self.size):
            self.row[c] = self.tracked[which, i, c] - self.tracked[which, j, c]
        scale = sqrt(self.weight)
        self.put_row(self.row, sign * scale, scale * (value - MARGIN))

    @cfunc
    def motion_limits(self):
        """Add the limits that involve several samples: their order, the span of the drive and the strokes."""
        last, tracked = self.samples - 1, self.tracked
        self.drive_travel = 0.0
        worst = self.worst  # the order is checked with the whole motion elsewhere
        for i in range(last):
            gone: double = tracked[0, i + 1, PAIR_VALUE] - tracked[0, i, PAIR_VALUE]
            if not self.is_slider:
                gone -= TURN * rint(gone / TURN)
            self.drive_travel += gone
            if self.ordered:
                value = self.direction * gone - DRIVE_STEP_MIN
                if self.register_limit(value, 1.0 * last, False):
                    self.put_difference_row(0, i + 1, i, self.direction, value)
        self.worst = worst
        if self.ordered and not self.is_slider:
            value = self.span_max - self.direction * self.drive_travel
            if self.register_limit(value, 1.0, False):
                self.put_difference_row(0, last, 0, -self.direction, value)
        if self.stroke_max == self.stroke_max:
            for k in range(1, 3):
                if (self.first_guide if k == 1 else self.second_guide).is_straight:
                    low: Py_ssize_t = 0
                    high: Py_ssize_t = 0
                    for i in range(1, self.samples):
                        if tracked[k, i, PAIR_VALUE] < tracked[k, low, PAIR_VALUE]:
                            low = i
                        if tracked[k, i, PAIR_VALUE] > tracked[k, high, PAIR_VALUE]:
                            high = i
                    value = self.stroke_max - (tracked[k, high, PAIR_VALUE] - tracked[k, low, PAIR_VALUE])
                    if self.register_limit(value, 1.0, False):
                        self.put_difference_row(k, high, low, -1.0, value)

    @cfunc
    def cylinder_reference(self) -> double:
        """Return the reference from which a cylinder's length is measured along its slot; fill its derivatives.

        The reference is the foot of the other guide's body point, or the intersection of two slots of the body.
        """
        first_guide, second_guide, out = self.first_guide, self.second_guide, self.second_row
        for c in range(PAIR_WIDTH):
            out[c] = 0.0
        if not second_guide.is_slot:
            away = second_guide.point - first_guide.origin
            out[GUIDE_UNKNOWNS] = -first_guide.inward_normal.imag
            out[GUIDE_UNKNOWNS + 1] = first_guide.inward_normal.real
            out[2] = -inner(first_guide.inward_normal, away)
            return cross(first_guide.inward_normal, away)
        along = vector(-first_guide.inward_normal.imag, first_guide.inward_normal.real)
        gap = second_guide.origin + times(second_guide.offset, second_guide.inward_normal)
        gap = gap - first_guide.origin - times(first_guide.offset, first_guide.inward_normal)
        below = inner(second_guide.inward_normal, along)
        if not fabs(below) > 1e-12:
            below = 1e-12
        value = inner(second_guide.inward_normal, gap) / below
        facing = inner(second_guide.inward_normal, first_guide.inward_normal)
        out[2] = (value * facing - first_guide.offset * below) / below
        out[3] = -facing / below
        out[GUIDE_UNKNOWNS + 2] = cross(second_guide.inward_normal, gap - times(value, along)) / below
        out[GUIDE_UNKNOWNS + 3] = 1.0 / below
        return value

    @cfunc
    def cylinder_limits(self):
        """Add the limits of a cylinder's length at all samples; ``extension`` receives the signed mean."""
        if not (self.first_guide.is_slot and not self.is_hinge):
            return
        start: double = self.cylinder_reference()
        total: double = 0.0
        for i in range(self.samples):
            total += self.tracked[3, i, PAIR_VALUE] - start
        self.extension = total / self.samples
        sign = copysign(1.0, total)
        for i in range(self.samples):
            length = sign * (self.tracked[3, i, PAIR_VALUE] - start)
            for k in range(2):
                side = sign if k == 0 else -sign
                value = length - self.cylinder_dead_length if k == 0 else self.cylinder_extended_max - length
                if value == value and self.register_limit(value, 1.0 * self.samples, False):
                    for c in range(self.size):
                        self.row[c] = self.tracked[3, i, c] - self.second_row[c]
                    scale = sqrt(self.weight)
                    self.put_row(self.row, side * scale, scale * (value - MARGIN))

    @cfunc
    def measure_distance(self, which: cython.int, gap: doublecomplex):
        """Store the length of a link and its derivatives from the vector along the link."""
        size = sqrt(inner(gap, gap))
        for c in range(PAIR_WIDTH):
            self.lengths[which, c] = inner(gap, self.vectors[0, c]) / max(size, 1e-12)
        self.lengths[which, PAIR_WIDTH] = size

    @cfunc
    def measure_links(self):
        """Measure both cranks, the coupler (or the distance of two pins), and the distance of two pivots."""
        first_guide, second_guide = self.first_guide, self.second_guide
        for k in range(2):
            guide = first_guide if k == 0 else second_guide
            self.has_length[k] = not guide.is_straight
            for c in range(PAIR_WIDTH + 1):
                self.lengths[k, c] = 0.0
            if not guide.is_straight:
                bent = guide.curvature
                self.lengths[k, GUIDE_UNKNOWNS * k + 4] = -copysign(guide.unit / (bent * bent), bent)
                self.lengths[k, PAIR_WIDTH] = 1.0 / fabs(bent)
        self.has_length[2] = first_guide.is_slot == second_guide.is_slot
        if self.has_length[2]:
            for k in range(2):
                for c in range(PAIR_WIDTH):
                    self.vectors[k, c] = 0.0
            second_guide.put_point_slopes(self.vectors[0], vector(1.0, 0.0))
            first_guide.put_point_slopes(self.vectors[0], vector(-1.0, 0.0))
            self.measure_distance(2, second_guide.point - first_guide.point)
        on_rail: bint = first_guide.is_straight and not first_guide.is_slot
        on_second_rail: bint = second_guide.is_straight and not second_guide.is_slot
        self.has_length[3] = not (on_rail or on_second_rail or (first_guide.is_slot and second_guide.is_slot))
        if self.has_length[3]:
            second_guide.pivot_slopes(self.vectors[0])
            first_guide.pivot_slopes(self.vectors[1])
            for c in range(PAIR_WIDTH):
                self.vectors[0, c] = self.vectors[0, c] - self.vectors[1, c]
            self.measure_distance(3, second_guide.pivot() - first_guide.pivot())

    @cfunc
    def length_limit(self, which: cython.int, sign: double, value: double, equal: bint):
        """Add a limit on one link."""
        if self.register_limit(value, 1.0, equal):
            for c in range(PAIR_WIDTH):
                self.row[c] = self.lengths[which, c]
            self.put_limit_row(self.row, sign, value, equal)

    @cfunc
    def link_limits(self):
        """Add the limits on links."""
        self.measure_links()
        for k in range(4):
            if not self.has_length[k]:
                continue
            value = self.lengths[k, PAIR_WIDTH]
            if self.link_max == self.link_max:
                self.length_limit(k, -1.0, self.link_max - value, False)
            if self.link_min == self.link_min:
                self.length_limit(k, 1.0, value - self.link_min, False)
            target = self.crank if k < 2 else self.ground if k == 3 or self.first_guide.is_slot else self.coupler
            if target == target:
                self.length_limit(k, 1.0, value - target, True)
        if self.link_ratio == self.link_ratio:
            for j in range(2):
                for k in range(2, 4):
                    if self.has_length[j] and self.has_length[k]:
                        self.ratio_limit(j, k)
                        self.ratio_limit(k, j)

    @cfunc
    def ratio_limit(self, j: cython.int, k: cython.int):
        """Add the limit on the ratio of two links."""
        value = self.lengths[j, PAIR_WIDTH] - self.lengths[k, PAIR_WIDTH] / self.link_ratio
        if self.register_limit(value, 1.0, False):
            for c in range(PAIR_WIDTH):
                self.row[c] = self.lengths[j, c] - self.lengths[k, c] / self.link_ratio
            self.put_limit_row(self.row, 1.0, value, False)

    @cfunc
    def point_limits(self, guide: Guide):
        """Add the limits on the body point of a guide and on its pivot or pin."""
        k = guide.index
        if not guide.is_slot:
            size = sqrt(inner(guide.point, guide.point))
            for j in range(2):
                distance = self.link_max if j == 0 else self.coupler_radius if k == 0 else NAN
                if distance == distance and self.register_limit(distance - size, 1.0, False):
                    for c in range(PAIR_WIDTH):
                        self.vectors[0, c] = 0.0
                    guide.put_point_slopes(self.vectors[0], vector(1.0, 0.0))
                    to = times(1.0 / max(size, 1e-12), guide.point)
                    self.put_limit_row(self.project_slopes(to, 0), -1.0, distance - size, False)
        if guide.is_straight and not guide.is_slot:
            return
        point = guide.pivot()
        if self.pivots[k, 0] == self.pivots[k, 0]:
            for side in range(2):
                value = (point.imag if side else point.real) - self.pivots[k, side]
                if self.register_limit(value, 1.0, True):
                    self.put_slopes_of(3 + k)
                    to = vector(1.0 - side, 1.0 * side)
                    self.put_limit_row(self.project_slopes(to, 0), 1.0, value, True)
            return
        if self.pivot_boxes[k, 0] == self.pivot_boxes[k, 0]:
            self.inside_box(point, 3 + k, self.pivot_boxes[k], 1.0)
        if self.reaches[k] == self.reaches[k]:
            self.within_distance(point - self.middle, 3 + k, self.reaches[k], 1.0)
        for box in range(self.keep_out.shape[0]):
            self.outside_box(point, 3 + k, self.keep_out[box])

    # -- candidate -------------------------------------------------------------------------------------------------

    @cfunc
    def evaluate(self, full: bint, bounded: bint) -> bint:
        """Compute cost and limits, with ``full`` also the triangular factor. Return whether all values are finite."""
        self.with_rows = full
        self.cost, self.worst, self.merit, self.violation_squares, self.sine_sum = 0.0, 0.0, 0.0, 0.0, 0.0
        self.filled_rows, self.extension = 0, 0.0
        self.is_valid, self.closed = True, True
        for i in range(self.samples):
            if self.has_timing:
                self.solve_driven_pose(i, self.sweeps)
            else:
                self.project_pose(i, self.sweeps)
                self.update_drive()
            self.update_transmission()
            self.sine_sum += self.sine
            self.fill_sample_rows(i)
            if bounded:
                self.sample_limits()
            self.track_drive(i)
            self.poses[i, 0] = self.rotation
            self.poses[i, 1], self.poses[i, 2] = self.position.real, self.position.imag
        self.motion_limits()
        self.cylinder_limits()
        if bounded:
            self.link_limits()
            self.point_limits(self.first_guide)
            self.point_limits(self.second_guide)
        if full:
            triangularise(self.rows, self.size + 1, self.filled_rows)
            for c in range(self.size + 1):
                for j in range(self.filled_rows, self.size + 1):
                    self.rows[c, j] = 0.0
        return isfinite(self.cost) and (self.is_valid or not bounded)

    def evaluate_candidates(
        self, unknowns: double[:, ::1], labels: double[:, ::1], sweeps: cython.int, bounded: bint
    ):
        """Evaluate candidates without derivatives.

        Returns
        -------
        table : ndarray, shape (n, 8)
            Cost (infinite if a limit has no value), whether all poses close, largest violation (without the order), sum over
            the limits of their mean squared violations (at most 1 each), sum of squared violations, sum of the sines of the
            transmission angles, travel of the drive from first to last sample, and signed mean length of a cylinder.
        poses : ndarray, shape (n, N, 3)
        drive : ndarray, shape (n, N)
        """
        count = unknowns.shape[0]
        table = np.zeros((count, 8))
        poses, drive = np.zeros((count, self.samples, 3)), np.zeros((count, self.samples))
        to: double[:, ::1] = table
        pose_values: double[:, :, ::1] = poses
        drives: double[:, ::1] = drive
        self.sweeps, self.weight = sweeps, 0.0
        for n in range(count):
            self.load(unknowns[n], labels[n])
            good: bint = self.evaluate(False, bounded)
            to[n, 0] = self.cost if good else INFINITE
            to[n, 1], to[n, 2], to[n, 3], to[n, 4] = self.closed, self.worst, self.merit, self.violation_squares
            to[n, 5], to[n, 6], to[n, 7] = self.sine_sum, self.drive_travel, self.extension
            for i in range(self.samples):
                drives[n, i] = self.tracked[0, i, PAIR_VALUE]
                for k in range(3):
                    pose_values[n, i, k] = self.poses[i, k]
        return table, poses, drive

    def linearise(self, unknowns: double[:, ::1], labels: double[:, ::1], weight: double, sweeps: cython.int):
        """Compute costs and derivatives of candidates.

        Parameters
        ----------
        unknowns : ndarray, shape (n, m)
        labels : ndarray, shape (n, 14)
        weight : float
            Weight of violated limits; 0 ignores them.
        sweeps : int
            Newton sweeps to a pose.

        Returns
        -------
        costs : ndarray, shape (n,)
            Infinite if a candidate does not close.
        rows : ndarray, shape (n, m + 1, m + 1)
            Triangular factor of the derivatives by column, and the reduced residuals in the last column.
        """
        columns = self.size + 1
        costs, tables = np.full(len(unknowns), INFINITE), np.zeros((len(unknowns), columns, columns))
        table: double[:, :, ::1] = tables
        self.weight, self.sweeps = weight, sweeps
        for n in range(unknowns.shape[0]):
            self.load(unknowns[n], labels[n])
            if self.evaluate(True, weight > 0.0):
                costs[n] = self.cost
                for c in range(columns):
                    for j in range(columns):
                        table[n, c, j] = self.rows[c, j]
        return costs, tables
