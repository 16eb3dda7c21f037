"""Levenberg-Marquardt descents of pairs of guides and their limits; `guided.pairs` derives the formulas.

Angles are in radians, lengths are relative to the length scale, costs to its square.
"""

import cython
import numpy as np
from cython import Py_ssize_t, bint, cclass, cfunc, declare, double, doublecomplex, final, inline
from cython.cimports.libc.math import atan2, copysign, cos, fabs, isfinite, rint, sin, sqrt
from cython.cimports.synthesis.kernels.plane import cross, depth_inside, inner, times, vector

PI = declare(double, 3.141592653589793)
TURN = declare(double, 6.283185307179586)
NAN = declare(double, float("nan"))
INFINITE = declare(double, float("inf"))
TINY = declare(double, 1e-300)  # keeps divisors away from zero
MARGIN = declare(double, 1e-7)  # margin by which descents satisfy limits, so that rounding violates none
DAMPING_DECREASE_MAX = declare(double, 0.1)  # largest decrease of the damping in one step (Nielsen's rule)
DAMPING_MIN = declare(double, 1e-22)  # damping below which a descent counts as undamped
DAMPING_MAX = declare(double, 1e10)  # damping above which a descent ends
ROUNDING_COST = declare(double, 1e-30)  # J squared at the level of rounding


# Unknowns of each guide: body point (x, y), direction and offset of the curve's normal, curvature
GUIDE_UNKNOWNS = declare(cython.int, 5)
BY_START = declare(cython.int, 10)  # drive at the first sample, if it is prescribed
# Columns of the derivatives with respect to the pose, after the unknowns
BY_ROTATION = declare(cython.int, 11)
BY_X = declare(cython.int, 12)
BY_Y = declare(cython.int, 13)
WIDTH = declare(cython.int, 14)
VALUE = declare(cython.int, 11)  # column of the value, after the derivatives with respect to the unknowns

POSE_STEP_MAX = declare(double, 0.7)  # longest correction of a pose, in radians and length scales
INDEPENDENT_FRACTION_MIN = declare(
    double, 1e-9
)  # smallest independent fraction of the second guide, if both guides push along one line
CLOSURE_GAP = declare(
    double, 1e-7
)  # gap below which a pose with prescribed drive closes, in radians and length scales
BRANCH_SINE_MIN = declare(
    double, 1e-3
)  # smallest sine of the transmission angle: at a toggle position the branches meet
DRIVE_STEP_MIN = declare(
    double, 1e-3
)  # smallest step of the drive between ordered samples, in radians or length scales
EQUATION_TOLERANCE = declare(double, 1e-8)  # accuracy to which a prescribed length or position is satisfied
BLOCK = declare(cython.int, 64)  # rows that are triangularised at once
STEP_MAX = declare(double, 1.5)  # largest change of an unknown


@final
@cclass
class Guide:
    """One guide of a pair (circle, rail or slot) and its point at a pose; `guided.pairs` derives the formulas."""

    index: cython.int  # 0 or 1 within the pair
    point: doublecomplex
    inward_normal: doublecomplex
    offset: double
    unit: double
    curvature: double
    origin: doublecomplex
    is_straight: bint
    is_slot: bint
    # at a pose, in the guide's own frame: the body's for a slot
    rotation: doublecomplex
    frame: doublecomplex
    rotated_point: doublecomplex
    local_point: doublecomplex
    foot_offset: doublecomplex
    rise: double
    root: double
    distance: double
    normal: doublecomplex
    by_rotation: doublecomplex
    by_position: doublecomplex
    rotation_slope: double
    position_slope: doublecomplex

    @cfunc
    def load(self, unknowns: double[::1], labels: double[::1], index: cython.int):
        """Load a guide of a candidate."""
        own = GUIDE_UNKNOWNS * index
        self.index = index
        self.point = vector(unknowns[own], unknowns[own + 1])
        self.inward_normal = vector(cos(unknowns[own + 2]), sin(unknowns[own + 2]))
        self.offset = unknowns[own + 3]
        first = 1 + own
        self.origin = vector(labels[first], labels[first + 1])
        self.unit = labels[first + 2]
        self.is_slot = labels[first + 3] > 0.0
        self.is_straight = labels[first + 4] > 0.0
        self.curvature = 0.0 if self.is_straight else unknowns[own + 4] * self.unit

    @cfunc
    def set_pose(self, turned: doublecomplex, position: doublecomplex):
        """Compute its point, the distance of the point from the curve, and the derivatives with respect to the pose."""
        if self.is_slot:
            self.frame = vector(turned.real, -turned.imag)
            self.rotated_point = self.frame * self.point
            self.local_point = self.rotated_point - self.frame * position
            self.by_rotation = vector(self.local_point.imag, -self.local_point.real)
            self.by_position = vector(-self.frame.real, -self.frame.imag)
        else:
            self.frame = turned
            self.rotated_point = self.frame * self.point
            self.local_point = self.rotated_point + position
            self.by_rotation = vector(-self.rotated_point.imag, self.rotated_point.real)
            self.by_position = vector(1.0, 0.0)
        self.rotation = turned
        away = self.local_point - self.origin - times(self.offset, self.inward_normal)
        bent = self.curvature
        self.foot_offset = away
        self.rise = 0.5 * bent * inner(away, away) - inner(self.inward_normal, away)
        self.root = sqrt(max(1.0 + 2.0 * bent * self.rise, 1e-24))
        self.distance = 2.0 * self.rise / (1.0 + self.root)
        self.normal = times(1.0 / self.root, times(bent, away) - self.inward_normal)
        self.rotation_slope = inner(self.normal, self.by_rotation)
        self.position_slope = vector(inner(self.by_position, self.normal), cross(self.by_position, self.normal))

    @cfunc
    def put_point_slopes(self, out: doublecomplex[::1], moved: doublecomplex):
        """Fill the derivatives, with respect to the body point, of a vector that rotates and scales with it."""
        own = GUIDE_UNKNOWNS * self.index
        out[own] = moved
        out[own + 1] = vector(-moved.imag, moved.real)

    @cfunc
    def distance_slopes(self, out: double[::1]):
        """Fill the derivatives of the distance with respect to the guide's unknowns."""
        own, bent, away = GUIDE_UNKNOWNS * self.index, self.curvature, self.foot_offset
        out[own] = inner(self.normal, self.frame)
        out[own + 1] = -cross(self.normal, self.frame)
        out[own + 2] = -(1.0 + bent * self.offset) * cross(self.inward_normal, away) / self.root
        out[own + 3] = -inner(self.normal, self.inward_normal)
        out[own + 4] = 0.0
        if not self.is_straight:
            ahead = 1.0 + self.root
            curvature_slope = inner(away, away) / (2.0 * self.root) - 2.0 * self.rise * self.rise / (
                self.root * ahead * ahead
            )
            out[own + 4] = curvature_slope * self.unit

    @cfunc
    def normal_slopes(self, out: double[::1], sign: double):
        """Add the derivatives of the direction of the normal, times a sign."""
        own, bent = GUIDE_UNKNOWNS * self.index, self.curvature
        part = sign / self.root
        out[BY_ROTATION] += part * bent * cross(self.normal, self.by_rotation)
        across = vector(cross(self.normal, self.by_position), inner(self.normal, self.by_position))
        out[BY_X] += part * bent * across.real
        out[BY_Y] += part * bent * across.imag
        out[own] += part * bent * cross(self.normal, self.frame)
        out[own + 1] += part * bent * inner(self.normal, self.frame)
        out[own + 2] -= part * (1.0 + bent * self.offset) * inner(self.normal, self.inward_normal)
        out[own + 3] -= part * bent * cross(self.normal, self.inward_normal)
        if not self.is_straight:
            out[own + 4] += part * self.unit * cross(self.normal, self.foot_offset)

    @cfunc
    def travel(self) -> double:
        """Return the coordinate of the point along a straight curve."""
        return cross(self.inward_normal, self.local_point - self.origin)

    @cfunc
    def travel_slopes(self, out: double[::1]):
        """Add the derivatives of the travel."""
        own = GUIDE_UNKNOWNS * self.index
        out[BY_ROTATION] += cross(self.inward_normal, self.by_rotation)
        out[BY_X] += cross(self.inward_normal, self.by_position)
        out[BY_Y] += inner(self.inward_normal, self.by_position)
        out[own] += cross(self.inward_normal, self.frame)
        out[own + 1] += inner(self.inward_normal, self.frame)
        out[own + 2] -= inner(self.inward_normal, self.local_point - self.origin)

    @cfunc
    def ground_point(self) -> doublecomplex:
        """Return the point of the ground that coincides with the guided point."""
        return self.point if self.is_slot else self.local_point

    @cfunc
    def ground_point_slopes(self, out: doublecomplex[::1]):
        """Fill the derivatives of the ground point."""
        if not self.is_slot:
            self.local_slopes(out)
            return
        for c in range(WIDTH):
            out[c] = 0.0
        self.put_point_slopes(out, vector(1.0, 0.0))

    @cfunc
    def local_slopes(self, out: doublecomplex[::1]):
        """Fill the derivatives of the guided point in the guide's own frame."""
        for c in range(WIDTH):
            out[c] = 0.0
        self.put_point_slopes(out, self.frame)
        out[BY_ROTATION] = self.by_rotation
        out[BY_X] = self.by_position
        out[BY_Y] = vector(-self.by_position.imag, self.by_position.real)

    @cfunc
    def pivot(self) -> doublecomplex:
        """Return the centre of a circle or the pin of a slot."""
        if self.is_slot or self.is_straight:
            return self.point
        return self.origin + times(self.offset + 1.0 / self.curvature, self.inward_normal)

    @cfunc
    def pivot_slopes(self, out: doublecomplex[::1]):
        """Fill the derivatives of the pivot."""
        for c in range(WIDTH):
            out[c] = 0.0
        if self.is_slot or self.is_straight:
            self.put_point_slopes(out, vector(1.0, 0.0))
            return
        own, bent = GUIDE_UNKNOWNS * self.index, self.curvature
        out[own + 2] = times(self.offset + 1.0 / bent, vector(-self.inward_normal.imag, self.inward_normal.real))
        out[own + 3] = self.inward_normal
        out[own + 4] = times(-self.unit / (bent * bent), self.inward_normal)


@cfunc
def room(number) -> double:
    """Return the number of a limit, or NaN if there is no limit."""
    return NAN if number is None else number


@final
@cclass
class PairDescent:
    """Levenberg-Marquardt over pairs of guides towards the samples of one motion, with limits.

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
    Labels of candidates have shape (n, 15): whether the first guide is a slot that turns about its pin; for each guide the origin
    (x, y), the unit of the curvature, whether it is a slot, whether it is straight; then the branch, the direction of the drive,
    the margin added to the smallest transmission angle, and the sign of the drive's coordinate.
    """

    samples: Py_ssize_t
    targets: double[:, ::1]
    has_timing: bint
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
    cylinder_dead_length: double
    cylinder_extended_max: double
    crank: double
    coupler: double
    ground: double
    pivots: double[:, ::1]
    pivot_boxes: double[:, ::1]
    middle: doublecomplex
    reaches: double[::1]
    rail_boxes: double[:, ::1]
    rail_reach: double
    envelope: double[::1]
    keep_out: double[:, ::1]
    # candidate
    size: cython.int
    first_guide: Guide
    second_guide: Guide
    is_hinge: bint
    is_slider: bint
    branch: double
    direction: double
    margin: double
    sign: double
    start: double
    sweeps: cython.int
    weight: double  # weight of violated limits; 0 ignores them
    # sample
    rotation: double
    position: doublecomplex
    l11: double
    l21: double
    l22: double
    first_residual: double
    second_residual: double
    pose_inverse: double[:, ::1]
    drive_gap: double
    is_open: bint
    drive: double
    sine: double
    cosine: double
    gap: doublecomplex
    rotation_slopes: double[::1]
    position_slopes: doublecomplex[::1]
    row: double[::1]
    second_row: double[::1]
    drive_row: double[::1]
    vectors: doublecomplex[:, ::1]
    # derivatives and values at all samples: drive, travel along each guide, length of a cylinder
    tracked: double[:, :, ::1]
    # derivatives and values of links: both cranks, coupler or distance of two pins, distance of two pivots
    lengths: double[:, ::1]
    has_length: cython.int[4]
    # candidate at all samples
    with_rows: bint
    is_valid: bint
    closed: bint
    poses: double[:, ::1]
    cost: double
    worst: double
    merit: double
    violation_squares: double
    sine_sum: double
    drive_travel: double
    extension: double
    # triangular factor by column: last evaluation, current position, damped
    filled_rows: cython.int
    rows: double[:, ::1]
    current_rows: double[:, ::1]
    damped_rows: double[:, ::1]
    ridge: double[::1]
    step: double[::1]
    trial: double[::1]
    # run
    unknowns: double[:, ::1]
    labels: double[:, ::1]
    costs: double[::1]
    candidate: Py_ssize_t
    started: bint
    iteration: cython.int
    iterations: cython.int
    first_damping: double
    stall: double
    damping: double
    growth: double

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
        self.pivots = limits["pivots"]
        self.pivot_boxes = limits["pivot_boxes"]
        self.middle = limits["reach_middle"]
        self.reaches = limits["reaches"]
        self.rail_boxes = limits["rail_boxes"]
        self.rail_reach = room(limits["far"])
        self.envelope = limits["envelope"]
        self.keep_out = limits["keep_out"]
        self.first_guide, self.second_guide = Guide(), Guide()
        self.pose_inverse = np.zeros((3, 3))
        self.rotation_slopes, self.position_slopes = np.zeros(WIDTH), np.zeros(WIDTH, dtype=complex)
        self.row, self.second_row, self.drive_row = np.zeros(WIDTH), np.zeros(WIDTH), np.zeros(WIDTH)
        self.vectors = np.zeros((2, WIDTH), dtype=complex)
        self.tracked = np.zeros((4, self.samples, VALUE + 1))
        self.lengths = np.zeros((4, WIDTH + 1))
        self.has_length = np.zeros(4, dtype=np.intc)
        self.rows, self.current_rows = np.zeros((12, BLOCK)), np.zeros((12, 12))
        self.damped_rows = np.zeros((12, 24))
        self.ridge, self.step, self.trial = np.zeros(11), np.zeros(11), np.zeros(11)
        self.poses = np.zeros((self.samples, 3))

    # -- candidate at a sample -------------------------------------------------------------------------------------

    @cfunc
    def load(self, unknowns: double[::1], labels: double[::1]):
        """Load a candidate."""
        self.first_guide.load(unknowns, labels, 0)
        self.second_guide.load(unknowns, labels, 1)
        self.is_hinge = labels[0] > 0.0
        self.is_slider = self.first_guide.is_straight and not self.is_hinge
        self.branch, self.direction, self.margin, self.sign = labels[11], labels[12], labels[13], labels[14]
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
        v, p, first_guide, second_guide = self.targets[i, 3], self.targets[i, 4], self.first_guide, self.second_guide
        s11 = v * first_guide.rotation_slope * first_guide.rotation_slope + p * inner(
            first_guide.position_slope, first_guide.position_slope
        )
        s12 = v * first_guide.rotation_slope * second_guide.rotation_slope + p * inner(
            first_guide.position_slope, second_guide.position_slope
        )
        s22 = v * second_guide.rotation_slope * second_guide.rotation_slope + p * inner(
            second_guide.position_slope, second_guide.position_slope
        )
        # the determinant as a sum of squares (Cauchy-Binet)
        differ = times(first_guide.rotation_slope, second_guide.position_slope) - times(
            second_guide.rotation_slope, first_guide.position_slope
        )
        area = cross(first_guide.position_slope, second_guide.position_slope)
        minors = v * p * inner(differ, differ) + p * p * area * area
        self.l11 = sqrt(max(s11, TINY))
        self.l21 = s12 / self.l11
        self.l22 = max(sqrt(minors) / self.l11, INDEPENDENT_FRACTION_MIN * sqrt(s22))
        back, away = angle - self.rotation, position - self.position
        self.first_residual = (
            first_guide.distance + first_guide.rotation_slope * back + inner(first_guide.position_slope, away)
        ) / self.l11
        low = second_guide.distance + second_guide.rotation_slope * back + inner(second_guide.position_slope, away)
        self.second_residual = (low - self.l21 * self.first_residual) / self.l22

    @cfunc
    def project_pose(self, i: Py_ssize_t, sweeps: cython.int):
        """Find the pose on both guides that is nearest to a sample."""
        angle, position = self.targets[i, 0], vector(self.targets[i, 1], self.targets[i, 2])
        v, p = self.targets[i, 3], self.targets[i, 4]
        self.set_pose(angle, position)
        for sweep in range(sweeps):
            self.factorise_pose_system(i, angle, position)
            if sweep == sweeps - 1:
                break
            second = self.second_residual / self.l22
            first = (self.first_residual - self.l21 * second) / self.l11
            change = -v * (self.first_guide.rotation_slope * first + self.second_guide.rotation_slope * second)
            shift = times(
                -p, times(first, self.first_guide.position_slope) + times(second, self.second_guide.position_slope)
            )
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
        target = self.start + self.sign * self.targets[i, 7]
        self.set_pose(self.targets[i, 0], vector(self.targets[i, 1], self.targets[i, 2]))
        for sweep in range(sweeps):
            self.invert_pose_system(target)
            if sweep == sweeps - 1:
                break
            turn = self.pose_change(0, self.first_guide.distance, self.second_guide.distance, self.drive_gap)
            x = self.pose_change(1, self.first_guide.distance, self.second_guide.distance, self.drive_gap)
            y = self.pose_change(2, self.first_guide.distance, self.second_guide.distance, self.drive_gap)
            part = 1.0 / max(1.0, max(fabs(turn), sqrt(x * x + y * y)) / POSE_STEP_MAX)
            self.set_pose(self.rotation - part * turn, self.position - vector(part * x, part * y))
        off = max(fabs(self.first_guide.distance), max(fabs(self.second_guide.distance), fabs(self.drive_gap)))
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
        a0, a1, a2 = (
            self.first_guide.rotation_slope,
            self.first_guide.position_slope.real,
            self.first_guide.position_slope.imag,
        )
        b0, b1, b2 = (
            self.second_guide.rotation_slope,
            self.second_guide.position_slope.real,
            self.second_guide.position_slope.imag,
        )
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
        for c in range(WIDTH):
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
        push = (
            self.first_guide.rotation * self.second_guide.normal
            if self.second_guide.is_slot
            else self.second_guide.normal
        )
        self.gap = self.second_guide.ground_point() - self.first_guide.ground_point()
        size = sqrt(inner(self.gap, self.gap))
        to = (
            self.first_guide.rotation * self.first_guide.normal
            if self.is_hinge
            else times(1.0 / size if size > 0.0 else 1.0, self.gap)
        )
        self.sine, self.cosine = cross(to, push), inner(to, push)

    @cfunc
    def transmission_slopes(self, out: double[::1], scale: double):
        """Fill the derivatives of the sine, times a factor."""
        for c in range(WIDTH):
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
            for c in range(WIDTH):
                out[c] -= cross(self.gap, self.vectors[0, c]) / square
        for c in range(WIDTH):
            out[c] *= scale * self.cosine

    @cfunc
    def gap_slopes(self):
        """Fill the derivatives of the vector between the ground points of both guides."""
        self.second_guide.ground_point_slopes(self.vectors[0])
        self.first_guide.ground_point_slopes(self.vectors[1])
        for c in range(WIDTH):
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
            self.triangularise(self.rows, BLOCK)
            self.filled_rows = self.size + 1

    @cfunc
    def triangularise(self, m: double[:, ::1], rows: cython.int):
        """Triangularise rows in place by Householder's method; the residual is the last column."""
        for c in range(min(self.size + 1, rows)):
            square = self.column_product(m, c, c, rows)
            if square > 0.0:
                norm = -copysign(sqrt(square), m[c, c])
                head = m[c, c] - norm
                m[c, c] = head
                for k in range(c + 1, self.size + 1):
                    product = self.column_product(m, c, k, rows) / (norm * head)
                    for j in range(c, rows):
                        m[k, j] += product * m[c, j]
                m[c, c] = norm
            for j in range(c + 1, rows):
                m[c, j] = 0.0

    @cfunc
    @inline
    @cython.exceptval(check=False)
    def column_product(self, m: double[:, ::1], a: cython.int, b: cython.int, rows: cython.int) -> double:
        """Return the inner product of two columns from the diagonal of the first, in two partial sums."""
        even: double = 0.0
        odd: double = 0.0
        for j in range(a, rows - 1, 2):
            even += m[a, j] * m[b, j]
            odd += m[a, j + 1] * m[b, j + 1]
        if (rows - a) % 2:
            even += m[a, rows - 1] * m[b, rows - 1]
        return even + odd

    @cfunc
    def fill_sample_rows(self, i: Py_ssize_t):
        """Append the rows of a sample and compute the derivatives of its pose with respect to the unknowns."""
        v, p, row, second = self.targets[i, 3], self.targets[i, 4], self.row, self.second_row
        for c in range(WIDTH):
            row[c], second[c], self.rotation_slopes[c], self.position_slopes[c] = 0.0, 0.0, 0.0, 0.0
        if self.has_timing:
            self.fill_driven_rows(v, p, i)
            return
        if not self.with_rows:
            self.cost += self.first_residual * self.first_residual + self.second_residual * self.second_residual
            return
        self.first_guide.distance_slopes(row)
        self.second_guide.distance_slopes(second)
        upper, lower = 1.0 / self.l11, 1.0 / self.l22
        for c in range(self.size):
            row[c] *= upper
            second[c] = (second[c] - self.l21 * row[c]) * lower
            low = second[c] * lower
            first = (row[c] - self.l21 * low) * upper
            self.rotation_slopes[c] = -v * (
                self.first_guide.rotation_slope * first + self.second_guide.rotation_slope * low
            )
            self.position_slopes[c] = times(
                -p, times(first, self.first_guide.position_slope) + times(low, self.second_guide.position_slope)
            )
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
                    self.position_slopes[c] = vector(
                        -self.pose_change(1, row[c], second[c], third), -self.pose_change(2, row[c], second[c], third)
                    )
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
            row[c] += (
                turn * self.rotation_slopes[c] + x * self.position_slopes[c].real + y * self.position_slopes[c].imag
            )

    @cfunc
    def project_slopes(self, to: doublecomplex, v: cython.int) -> double[::1]:
        """Fill ``row`` with the derivatives of a vector's component along a direction."""
        for c in range(WIDTH):
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
            for c in range(WIDTH):
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
            self.put_limit_row(
                self.project_slopes(times(1.0 / max(size, 1e-12), off), 0), -1.0, distance - size, False
            )

    @cfunc
    def sample_limits(self):
        """Add the limits of a sample."""
        many: double = self.samples
        sine_min = max(sin(min(self.transmission + self.margin, 0.5 * PI - 1e-6)), BRANCH_SINE_MIN)
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
                for c in range(WIDTH):
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
        self.tracked[which, i, VALUE] = value
        if self.with_rows:
            self.chain_pose_slopes(self.row)
            for c in range(self.size):
                self.tracked[which, i, c] = self.row[c]

    @cfunc
    def track_drive(self, i: Py_ssize_t):
        """Store the drive, the strokes and the length of a cylinder at a sample."""
        if self.with_rows and self.ordered:
            for c in range(WIDTH):
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
            for c in range(WIDTH):
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
            gone: double = tracked[0, i + 1, VALUE] - tracked[0, i, VALUE]
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
                        if tracked[k, i, VALUE] < tracked[k, low, VALUE]:
                            low = i
                        if tracked[k, i, VALUE] > tracked[k, high, VALUE]:
                            high = i
                    value = self.stroke_max - (tracked[k, high, VALUE] - tracked[k, low, VALUE])
                    if self.register_limit(value, 1.0, False):
                        self.put_difference_row(k, high, low, -1.0, value)

    @cfunc
    def cylinder_reference(self) -> double:
        """Return the reference from which a cylinder's length is measured along its slot; fill its derivatives.

        The reference is the foot of the other guide's body point, or the intersection of two slots of the body.
        """
        first_guide, second_guide, out = self.first_guide, self.second_guide, self.second_row
        for c in range(WIDTH):
            out[c] = 0.0
        if not second_guide.is_slot:
            away = second_guide.point - first_guide.origin
            out[GUIDE_UNKNOWNS], out[GUIDE_UNKNOWNS + 1] = (
                -first_guide.inward_normal.imag,
                first_guide.inward_normal.real,
            )
            out[2] = -inner(first_guide.inward_normal, away)
            return cross(first_guide.inward_normal, away)
        along = vector(-first_guide.inward_normal.imag, first_guide.inward_normal.real)
        gap = (
            second_guide.origin
            + times(second_guide.offset, second_guide.inward_normal)
            - first_guide.origin
            - times(first_guide.offset, first_guide.inward_normal)
        )
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
            total += self.tracked[3, i, VALUE] - start
        self.extension = total / self.samples
        sign = copysign(1.0, total)
        for i in range(self.samples):
            length = sign * (self.tracked[3, i, VALUE] - start)
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
        for c in range(WIDTH):
            self.lengths[which, c] = inner(gap, self.vectors[0, c]) / max(size, 1e-12)
        self.lengths[which, WIDTH] = size

    @cfunc
    def measure_links(self):
        """Measure both cranks, the coupler (or the distance of two pins), and the distance of two pivots."""
        first_guide, second_guide = self.first_guide, self.second_guide
        for k in range(2):
            guide = first_guide if k == 0 else second_guide
            self.has_length[k] = not guide.is_straight
            for c in range(WIDTH + 1):
                self.lengths[k, c] = 0.0
            if not guide.is_straight:
                bent = guide.curvature
                self.lengths[k, GUIDE_UNKNOWNS * k + 4] = -copysign(guide.unit / (bent * bent), bent)
                self.lengths[k, WIDTH] = 1.0 / fabs(bent)
        self.has_length[2] = first_guide.is_slot == second_guide.is_slot
        if self.has_length[2]:
            for k in range(2):
                for c in range(WIDTH):
                    self.vectors[k, c] = 0.0
            second_guide.put_point_slopes(self.vectors[0], vector(1.0, 0.0))
            first_guide.put_point_slopes(self.vectors[0], vector(-1.0, 0.0))
            self.measure_distance(2, second_guide.point - first_guide.point)
        pinned: bint = (first_guide.is_slot or not first_guide.is_straight) and (
            second_guide.is_slot or not second_guide.is_straight
        )
        self.has_length[3] = pinned and not (first_guide.is_slot and second_guide.is_slot)
        if self.has_length[3]:
            second_guide.pivot_slopes(self.vectors[0])
            first_guide.pivot_slopes(self.vectors[1])
            for c in range(WIDTH):
                self.vectors[0, c] = self.vectors[0, c] - self.vectors[1, c]
            self.measure_distance(3, second_guide.pivot() - first_guide.pivot())

    @cfunc
    def length_limit(self, which: cython.int, sign: double, value: double, equal: bint):
        """Add a limit on one link."""
        if self.register_limit(value, 1.0, equal):
            for c in range(WIDTH):
                self.row[c] = self.lengths[which, c]
            self.put_limit_row(self.row, sign, value, equal)

    @cfunc
    def link_limits(self):
        """Add the limits on links."""
        self.measure_links()
        for k in range(4):
            if not self.has_length[k]:
                continue
            value = self.lengths[k, WIDTH]
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
        value = self.lengths[j, WIDTH] - self.lengths[k, WIDTH] / self.link_ratio
        if self.register_limit(value, 1.0, False):
            for c in range(WIDTH):
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
                    for c in range(WIDTH):
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
                    self.put_limit_row(
                        self.project_slopes(vector(0.0, 1.0) if side else vector(1.0, 0.0), 0), 1.0, value, True
                    )
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
            self.poses[i, 0], self.poses[i, 1], self.poses[i, 2] = (
                self.rotation,
                self.position.real,
                self.position.imag,
            )
        self.motion_limits()
        self.cylinder_limits()
        if bounded:
            self.link_limits()
            self.point_limits(self.first_guide)
            self.point_limits(self.second_guide)
        if full:
            self.triangularise(self.rows, self.filled_rows)
            for c in range(self.size + 1):
                for j in range(self.filled_rows, self.size + 1):
                    self.rows[c, j] = 0.0
        return isfinite(self.cost) and (self.is_valid or not bounded)

    def evaluate_candidates(
        self, unknowns: double[:, ::1], labels: double[:, ::1], sweeps: cython.int, bounded: bint
    ):
        """Evaluate candidates without moving them.

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
        table, poses, drive = (
            np.zeros((count, 8)),
            np.zeros((count, self.samples, 3)),
            np.zeros((count, self.samples)),
        )
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
                drives[n, i] = self.tracked[0, i, VALUE]
                for k in range(3):
                    pose_values[n, i, k] = self.poses[i, k]
        return table, poses, drive

    def gradient(self, unknowns: double[::1], labels: double[::1], weight: double, sweeps: cython.int):
        """Return the gradient of a candidate's cost."""
        self.weight, self.sweeps = weight, sweeps
        self.load(unknowns, labels)
        self.evaluate(True, weight > 0.0)
        table = np.asarray(self.rows)[: self.size + 1, : self.size + 1]
        return 2.0 * (table[: self.size] @ table[self.size])

    # -- descents ----------------------------------------------------------------------------------------------------

    def set_candidates(self, unknowns, labels, iterations, damping, stall, weight, sweeps):
        """Set the candidates, which the run moves. Return the array of their costs.

        Parameters
        ----------
        unknowns : ndarray, shape (n, 10 or 11)
        labels : ndarray, shape (n, 15)
        iterations, damping, stall
            See `least_squares.minimise`.
        weight : float
            Weight of violated limits; 0 ignores them.
        sweeps : int
            Newton sweeps to a pose.
        """
        costs = np.full(len(unknowns), np.inf)
        self.unknowns, self.labels, self.costs = unknowns, labels, costs
        self.iterations, self.first_damping, self.stall = iterations, damping, stall
        self.weight, self.sweeps = weight, sweeps
        self.candidate, self.started = 0, False
        return costs

    def run(self, max_steps: Py_ssize_t):
        """Continue for a number of steps. Return True once all candidates have terminated."""
        while self.candidate < self.costs.shape[0]:
            if max_steps <= 0:
                return False
            max_steps -= 1
            if self.started:
                ended: bint = self.iteration >= self.iterations or self.advance()
            else:
                ended = not self.start_candidate()
            self.iteration += 1
            if ended:
                self.candidate += 1
                self.started = False
        return True

    @cfunc
    def start_candidate(self) -> bint:
        """Begin with the next candidate. Return False if it does not close."""
        n = self.candidate
        self.load(self.unknowns[n], self.labels[n])
        if not self.evaluate(True, self.weight > 0.0):
            return False
        self.accept_current()
        self.iteration = -1
        self.damping, self.growth, self.started = self.first_damping, 2.0, True
        return True

    @cfunc
    def accept_current(self):
        """Make the last evaluation the current position of the candidate."""
        self.costs[self.candidate] = self.cost
        for c in range(self.size + 1):
            for j in range(self.size + 1):
                self.current_rows[c, j] = self.rows[c, j]

    @cfunc
    def advance(self) -> bint:
        """Take one step of the candidate. Return whether it has terminated."""
        n, before = self.candidate, self.costs[self.candidate]
        predicted = self.compute_step()
        for k in range(self.size):
            self.trial[k] = self.unknowns[n, k] + self.step[k]
        self.load(self.trial, self.labels[n])
        good: bint = self.evaluate(True, self.weight > 0.0)
        decrease = before - self.cost
        if not (good and decrease > 0.0):
            self.damping *= self.growth
            self.growth *= 2.0
            return before < ROUNDING_COST or self.damping > DAMPING_MAX
        for k in range(self.size):
            self.unknowns[n, k] = self.trial[k]
        self.accept_current()
        gain = 2.0 * min(decrease / max(predicted, TINY), 1.0) - 1.0
        self.damping = max(self.damping * max(DAMPING_DECREASE_MAX, 1.0 - gain * gain * gain), DAMPING_MIN)
        self.growth = 2.0
        return decrease < self.stall * before or before < ROUNDING_COST

    @cfunc
    def compute_step(self) -> double:
        """Compute the damped step. Return the predicted decrease of the cost."""
        size, upper, step = self.size, self.damped_rows, self.step
        for c in range(size + 1):
            square: double = 0.0
            for j in range(2 * size + 1):
                upper[c, j] = self.current_rows[c, j] if j <= size else 0.0
                square += upper[c, j] * upper[c, j]
            if c < size:
                self.ridge[c] = self.damping * max(square, 1e-24)
                upper[c, size + 1 + c] = sqrt(self.ridge[c])
        self.triangularise(upper, 2 * size + 1)
        right, longest = 0.0, 0.0
        for c in range(size - 1, -1, -1):
            value: double = upper[size, c]
            right += value * value
            for k in range(c + 1, size):
                value -= upper[k, c] * step[k]
            step[c] = value / upper[c, c]
            longest = max(longest, fabs(step[c]))
        part = min(1.0, STEP_MAX / max(longest, TINY))
        # |r|^2 - |r + J s|^2 with J' r = R' right: a sum of positive terms
        fall = part * (2.0 - part) * right
        for c in range(size):
            step[c] *= -part
            fall += self.ridge[c] * step[c] * step[c]
        return fall
