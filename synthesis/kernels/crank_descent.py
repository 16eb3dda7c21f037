"""Levenberg-Marquardt descents of four-bars towards the samples of a motion; `descents` derives the method.

Descents refine the candidates in sequence without allocating. The Jacobian is stored by column, each column contiguous over
component (rotation, x, y) and sample, followed by the rows of violated limits: ``m[set, column, component * N + sample]``, with
the residual in the last column. There are two sets: the current position of a candidate, and the position after its step. They
change places when a step is accepted, so that a rejected step evaluates nothing again.

Angles are in radians, lengths are relative to the length scale, costs to its square.
"""

import cython
import numpy as np
from cython import Py_ssize_t, bint, cclass, cfunc, declare, double, doublecomplex, final, inline
from cython.cimports.libc.math import atan2, copysign, cos, fabs, floor, isfinite, rint, sin, sqrt
from cython.cimports.synthesis.kernels.codes import BY_BODY, BY_FIRST, BY_LAST, BY_PIVOT, BY_TURNED, GRASHOF
from cython.cimports.synthesis.kernels.crank_loops import Shape
from cython.cimports.synthesis.kernels.four_bar_limits import Limits
from cython.cimports.synthesis.kernels.plane import clip, cross, inner, times, vector

PI = declare(double, 3.141592653589793)
TURN = declare(double, 6.283185307179586)
INFINITE = declare(double, float("inf"))
TINY = declare(double, 1e-300)  # keeps divisors away from zero
BOUND = declare(double, 1e-9)  # smallest unknown of a Grashof chart: at change points theta2 has no derivative
AT_BOUND = declare(double, 1.01e-9)  # an unknown below this magnitude lies on its bound
MARGIN = declare(double, 1e-7)  # margin by which descents satisfy limits, so that rounding violates none
NEWTON_MARGIN = declare(double, 1.1e-7)  # margin at which Newton steps aim, so that they reach MARGIN
SATISFIED = declare(double, 1e-15)  # violation of an equation below which no Newton step is needed
NEWTON_DAMPING = declare(double, 1e-12)  # relative damping that selects the shortest Newton step for dependent rows
ANGLE_DAMPING = declare(double, 1e-2)  # damping of the crank angles relative to the damping of the shape
LINEAR_DAMPING = declare(double, 1e-2)  # damping of pose and offset relative to the damping of the shape
ANGLE_SQUARE_MIN = declare(double, 1e-6)  # smallest squared derivative by a crank angle in its damping, over the mean
FLAT = declare(double, 1e-20)  # smallest damping of a crank angle over that mean, and of a column over its square
NEAREST_SQUARE_MIN = declare(double, 1e-12)  # the same minimum when angles move to the nearest point
NORMAL_DAMPING_MIN = declare(double, 1e-9)  # damping above which normal equations suffice: condition below 1e11
ORTHOGONAL_MIN = declare(double, 1e-6)  # smallest fraction of a column's square that the linear columns leave
PIVOT_MIN = declare(double, 1e-14)  # smallest pivot of Cholesky's method for scaled columns
COSINE_MAX = declare(double, 1 - 1e-12)  # largest cosine between steps, so that an infinite cost is never accepted
STEP_MAX = declare(double, 1.0)  # largest change of a shape unknown; most unknowns are logarithms
GRASHOF_STEP_MAX = declare(double, 0.35)  # the same for a Grashof chart, whose unknowns add up to one
START_STEP_MAX = declare(double, 0.75)  # largest change of the start angle with prescribed timing
ANGLE_STEP_MAX = declare(double, 0.6)  # largest change of a crank angle without a prescribed order
GAP_FRACTION_MIN = declare(double, 0.2)  # fraction of a gap between samples that a step leaves at least
ROOM_FRACTION_MAX = declare(double, 0.8)  # fraction of the remaining span that a step uses at most
GAP_MIN = declare(double, 1e-12)  # smallest gap between samples
DAMPING_DECREASE_MAX = declare(double, 0.1)  # largest decrease of the damping in one step (Nielsen's rule)
DAMPING_MIN = declare(double, 1e-22)  # damping below which a descent counts as undamped
DAMPING_MAX = declare(double, 1e10)  # damping above which a descent ends
ROUNDING_COST = declare(double, 1e-30)  # J squared at the level of rounding


# Poses in which a candidate is evaluated
AS_IS = declare(cython.int, 0)
BEST_OFFSET = declare(cython.int, 1)  # unchanged except for the best offset of the rotation
BEST = declare(cython.int, 2)
BEST_WITHIN = declare(cython.int, 3)  # best pose if it satisfies the limits, otherwise best offset


@final
@cclass
class Descent:
    """Levenberg-Marquardt over shape, pose and crank angles of candidates towards the samples of one motion.

    Arguments are arrays of floats; a complex number takes two of them.

    Parameters
    ----------
    rotation : ndarray, shape (N,), or None
        Target rotations.
    rotation_root, position_root : ndarray, shape (N,)
        Square roots of the weights of the samples in the means.
    position : ndarray, shape (N, 2), or None
        Target positions over the length scale, with mean zero.
    chart : int
        Code of the chart.
    ordered : bool
        Whether the crank passes the samples in their order.
    span_max : float
        Largest span of the crank angles.
    limits : Limits, optional
        Limits that the descent satisfies.
    crank : ndarray, shape (N,), optional
        Prescribed crank angles relative to the first sample. The start angle is then an unknown, and rotations are not taken
        modulo a turn.
    fixed : tuple of bool
        Whether the start angle and the offset of the rotation are prescribed.
    crank_min : float
        Smallest |z1| of a crank.
    closed : bool
        Whether the motion returns from the last sample to the first; limits then hold over the whole turn.
    """

    # request
    samples: Py_ssize_t
    target_rotation: double[::1]
    target_direction: doublecomplex[::1]
    target_position: doublecomplex[::1]
    rotation_root: double[::1]
    position_root: double[::1]
    crank_increments: double[::1]
    has_rotation: bint
    has_position: bint
    has_timing: bint
    fixed_start: bint
    fixed_offset: bint
    ordered: bint
    closed: bint
    span_max: double
    crank_min: double
    shape: Shape
    limits: Limits
    has_limits: bint
    has_pose: bint
    penalty: double
    # numbers of rows and columns; columns are pose and offset, shape, start angle
    components: cython.int
    sample_rows: Py_ssize_t
    row_stride: Py_ssize_t
    linear_unknowns: cython.int
    shape_unknowns: cython.int
    nonlinear_unknowns: cython.int
    columns: cython.int
    # sets: current position, position after the step
    shape_values: double[:, ::1]
    pose: doublecomplex[:, ::1]
    offset: double[::1]
    crank_angle: double[:, ::1]
    branch: double[::1]
    cost: double[::1]
    sample_cost: double[::1]
    rows: double[:, :, ::1]
    angle_slopes: double[:, ::1]
    active_rows: cython.int[::1]
    limit_angle_slopes: double[:, ::1]
    limit_sample: Py_ssize_t[:, ::1]
    # set evaluated last
    e1: doublecomplex[::1]
    e2: doublecomplex[::1]
    coupler_slopes: double[:, ::1]
    lever: doublecomplex[::1]
    basis: doublecomplex[:, ::1]
    rotation_gap: double[::1]
    gap: double[::1]
    first_sample: Py_ssize_t
    last_sample: Py_ssize_t
    limit_slopes: double[::1]
    # step
    reduced_rows: double[:, ::1]
    angle_projection: double[:, ::1]
    angle_squares: double[::1]
    elimination_factor: double[::1]
    requested_angle: double[::1]
    pooled_level: double[::1]
    pooled_weight: double[::1]
    block_head: Py_ssize_t[::1]
    column_squares: double[::1]
    ridge: double[::1]
    upper_triangle: double[:, ::1]
    step: double[::1]
    angle_step: double[::1]
    previous_step: double[::1]
    angle_change: double[::1]
    scratch: double[::1]
    # run
    candidate: Py_ssize_t
    started: bint
    iteration: cython.int
    iterations: cython.int
    current: cython.int
    first_damping: double
    damping: double
    growth: double
    stall: double
    exact: double
    iteration_factor: double
    best_cost: double
    lowest_cost: double
    # candidates
    shapes: double[:, ::1]
    poses: doublecomplex[:, ::1]
    offsets: double[::1]
    angles: double[:, ::1]
    branches: double[::1]
    costs: double[::1]

    def __init__(
        self,
        rotation,
        rotation_root,
        position,
        position_root,
        chart,
        ordered,
        span_max,
        limits=None,
        crank=None,
        fixed=(False, False),
        crank_min=0.0,
        closed=False,
    ):
        samples = len(position if rotation is None else rotation)
        self.samples, self.ordered, self.span_max = samples, ordered, span_max
        self.crank_min, self.penalty, self.closed = crank_min, 1.0, closed
        self.has_rotation, self.has_position = rotation is not None, position is not None
        self.has_timing, (self.fixed_start, self.fixed_offset) = crank is not None, fixed
        rotation, crank = (
            np.zeros(samples) if angles is None else np.array(angles, dtype=float) for angles in (rotation, crank)
        )
        position = np.zeros((samples, 2)) if position is None else np.array(position, dtype=float)
        root = np.array(np.broadcast_to(position_root, samples), dtype=float)
        self.target_rotation, self.target_direction, self.crank_increments = rotation, np.exp(1j * rotation), crank
        self.rotation_root = np.array(np.broadcast_to(rotation_root, samples), dtype=float)
        self.position_root = root
        self.target_position = root * position.view(complex)[:, 0]
        self.shape = Shape(chart)
        self.has_limits = limits is not None
        self.limits = Limits(np.empty((0, 8)), True) if limits is None else limits
        self.has_pose = self.has_limits and self.limits.has_pose
        self.components = self.has_rotation + 2 * self.has_position
        self.shape_unknowns = self.shape.size
        self.linear_unknowns = self.has_rotation + 6 * self.has_position
        self.nonlinear_unknowns = self.shape_unknowns + self.has_timing
        self.columns = self.linear_unknowns + self.nonlinear_unknowns
        self.sample_rows = self.components * samples
        rows, columns, sets = self.limits.rows + 1, self.columns + 1, 2
        self.row_stride = (self.sample_rows + rows + 3) // 4 * 4
        self.shape_values, self.pose = np.zeros((sets, 4)), np.zeros((sets, 3), dtype=complex)
        self.crank_angle, self.angle_slopes = np.zeros((sets, samples)), np.zeros((sets, self.sample_rows))
        self.offset, self.branch, self.cost, self.sample_cost = np.zeros((4, sets))
        self.rows = np.zeros((sets, columns, self.row_stride))
        self.active_rows, self.limit_angle_slopes = np.zeros(sets, dtype=np.intc), np.zeros((sets, rows))
        self.limit_sample = np.zeros((sets, rows), dtype=np.intp)
        self.e1, self.e2, self.lever = np.zeros((3, samples), dtype=complex)
        self.coupler_slopes, self.basis = np.zeros((5, samples)), np.zeros((3, samples), dtype=complex)
        self.rotation_gap, self.gap, self.angle_squares, self.elimination_factor = np.zeros((4, samples))
        self.angle_step, self.angle_change = np.zeros((2, samples))
        self.requested_angle, self.pooled_level, self.pooled_weight = np.zeros((3, samples))
        self.block_head = np.zeros(samples, dtype=np.intp)
        self.limit_slopes, self.column_squares, self.ridge, self.step = np.zeros((4, columns))
        self.previous_step, self.upper_triangle = np.zeros(5), np.zeros((columns, columns))
        self.reduced_rows = np.zeros((columns, self.row_stride))
        self.angle_projection, self.scratch = np.zeros((columns, samples)), np.zeros(max(self.row_stride, columns))
        self.fill_constant_columns()

    @cfunc
    def fill_constant_columns(self):
        """Fill the derivatives that are the same for all candidates: with respect to pivot A and the offset."""
        for s in range(2):
            for i in range(self.samples):
                if self.has_position:
                    self.basis[2, i] = self.target_position[i]
                    self.put_complex_column(s, 0, i, -self.position_root[i])
                if self.has_rotation and not self.fixed_offset:
                    self.rows[s, self.linear_unknowns - 1, i] = -self.rotation_root[i]

    # -- candidates in arrays --------------------------------------------------------------------------------------------

    @cfunc
    def load(self, s: cython.int, n: Py_ssize_t):
        """Copy a candidate into a set."""
        for k in range(self.shape_unknowns):
            self.shape_values[s, k] = self.shapes[n, k]
        for k in range(3):
            self.pose[s, k] = self.poses[n, k]
        self.offset[s] = self.offsets[n]
        self.branch[s] = self.branches[n]
        timed: bint = self.has_timing
        for i in range(self.samples):
            self.crank_angle[s, i] = self.angles[n, 0] + self.crank_increments[i] if timed else self.angles[n, i]

    @cfunc
    def store(self, s: cython.int, n: Py_ssize_t):
        """Copy a set back to its candidate."""
        for k in range(self.shape_unknowns):
            self.shapes[n, k] = self.shape_values[s, k]
        for k in range(3):
            self.poses[n, k] = self.pose[s, k]
        self.offsets[n] = self.offset[s]
        for i in range(1 if self.has_timing else self.samples):
            self.angles[n, i] = self.crank_angle[s, i]
        self.costs[n] = self.cost[s]

    def evaluate_candidates(self, best_pose: bint, facing: bint):
        """Compute the costs of the candidates.

        Parameters
        ----------
        best_pose : bool
            Move each candidate to its best pose first, and keep that pose.
        facing : bool
            Begin with the offset of the mean direction of the rotations.
        """
        for n in range(self.costs.shape[0]):
            self.load(0, n)
            if self.evaluate(0, False, BEST if best_pose else AS_IS, facing):
                self.store(0, n)
            else:
                self.costs[n] = INFINITE

    def move_to_nearest_angles(self, steps: cython.int):
        """Move each crank angle of the candidates towards the nearest point of the path, preserving the order."""
        for n in range(self.costs.shape[0]):
            self.load(0, n)
            for c in range(self.columns):
                self.step[c] = 0.0
            for _ in range(steps):
                if not self.evaluate(0, True, AS_IS, False):
                    break
                self.active_rows[0] = 0
                mean = self.update_angle_squares(0)
                for i in range(self.samples):
                    toward = 0.0
                    for r in range(self.components):
                        j = r * self.samples + i
                        toward += self.angle_slopes[0, j] * self.rows[0, self.columns, j]
                    self.angle_step[i] = -toward / max(self.angle_squares[i], NEAREST_SQUARE_MIN * mean)
                self.apply_step(0, 0)
            self.store(0, n)

    def linearised(self, n, damping):
        """Return the parts of a candidate's step for tests: rows, derivatives, damping and the step itself."""
        self.load(0, n)
        if not self.evaluate_start(0):
            return None
        fall, active, columns = self.compute_step(0, damping), self.active_rows[0], self.columns
        values = {
            "rows": np.asarray(self.rows)[0, :, : self.sample_rows + active],
            "turn": np.asarray(self.angle_slopes)[0],
            "by_angle": np.asarray(self.limit_angle_slopes)[0, :active],
            "at_sample": np.asarray(self.limit_sample)[0, :active],
            "inner": np.asarray(self.angle_squares),
            "ridge": np.asarray(self.ridge)[:columns],
            "step": np.asarray(self.step)[:columns],
            "turn_step": np.asarray(self.angle_step),
        }
        return {**{name: np.array(values) for name, values in values.items()}, "fall": fall}

    def violations(self):
        """Return the sum of squares and the maximum of the limit violations of each candidate, (n,) each."""
        squares, largest = np.empty(len(self.costs)), np.empty(len(self.costs))
        for n in range(self.costs.shape[0]):
            self.load(0, n)
            self.update_shape(0)
            self.evaluate_limits(0)
            largest[n] = self.largest_violation()
            squares[n] = self.scratch[0]
        return squares, largest

    def excursions(self, shortest: double, panel: double):
        """Compute the detours of the body point between neighbouring samples.

        The path length comes from chords between crank angles at most ``panel`` apart and from chords over two such steps: the
        error of the latter is four times as large, so their combination is accurate to fourth order.

        Returns
        -------
        detours : ndarray, shape (n,)
            Largest ratio of path length to the distance of two neighbouring samples, where distances below ``shortest`` count as
            ``shortest``; infinite if the loop opens between samples.
        angles : ndarray, shape (n, M)
            Body angle at the samples, for a closed motion also at the first sample after one turn; not set if the loop opens.
        """
        gaps = self.samples if self.closed else self.samples - 1
        detours, values = np.empty(len(self.costs)), np.zeros((len(self.costs), gaps + 1))
        angle: double[:, ::1] = values
        loop = self.shape.loop
        for n in range(self.costs.shape[0]):
            self.load(0, n)
            self.update_shape(0)
            largest = 0.0
            for i in range(gaps):
                begin = self.crank_angle[0, i]
                if i + 1 < self.samples:
                    step = self.crank_angle[0, i + 1] - begin
                else:
                    step = copysign(TURN, begin - self.crank_angle[0, 0]) + self.crank_angle[0, 0] - begin
                parts = 2 + 2 * cython.cast(cython.int, fabs(step) / (2 * panel))
                gone, first, before, outer = 0.0, 0j, 0j, 0j
                for k in range(parts + 1):
                    if not loop.close_at(begin + step * k / parts, False):
                        gone = INFINITE
                        break
                    point = self.pose[0, 1] * loop.e1 + self.pose[0, 2] * loop.e2
                    if k == 0:
                        first = outer = point
                        angle[n, i] = loop.coupler_angle(begin)
                    else:
                        gone += sqrt(inner(point - before, point - before)) * 4 / 3
                    if k > 0 and k % 2 == 0:
                        gone -= sqrt(inner(point - outer, point - outer)) / 3
                        outer = point
                    before = point
                angle[n, i + 1] = loop.coupler_angle(begin + step)
                chord = sqrt(inner(before - first, before - first))
                largest = max(largest, gone / max(chord, shortest))
            detours[n] = largest
        return detours, values

    def restore(self, rounds: cython.int):
        """Move the candidates onto violated limits by the shortest way, at unchanged crank angles, with Newton's method.

        No candidate's largest violation increases: a candidate for which the steps diverge keeps its position. The costs become
        J squared.

        Returns
        -------
        violation : ndarray, shape (n,)
            Largest remaining violation.
        """
        lacked = np.empty(len(self.costs))
        for n in range(self.costs.shape[0]):
            self.load(0, n)
            self.update_shape(0)
            scale = self.evaluate_limits(0)
            before = self.largest_violation()
            for _ in range(rounds):
                if not self.restore_step(0, scale):
                    break
                self.update_shape(0)
                scale = self.evaluate_limits(0)
            after = self.largest_violation()
            if not after <= before:
                after = before
                self.load(0, n)
            lacked[n] = after
            self.evaluate(0, False, BEST_OFFSET if self.has_pose else BEST, False)
            self.store(0, n)
        return lacked

    # -- rows ------------------------------------------------------------------------------------------------------------

    @cfunc
    def evaluate(self, s: cython.int, full: bint, pose: cython.int, face: bint) -> bint:
        """Compute residual, cost and, with ``full``, derivatives of a set. Return False if it does not close.

        ``pose`` selects the pose in which the set is evaluated. ``face`` begins with the offset of the mean direction.
        """
        self.cost[s] = INFINITE
        self.update_shape(s)
        if not self.close_at_samples(s, full):
            return False
        if face and self.has_rotation:
            self.align_offset(s)
        a, z1, z2 = self.pose[s, 0], self.pose[s, 1], self.pose[s, 2]
        if pose >= BEST and self.has_position:
            self.fit_pose(s)
            if self.crank_min > 0.0 and not sqrt(inner(self.pose[s, 1], self.pose[s, 1])) > self.crank_min:
                return False
        self.fill_residual(s, pose != AS_IS)
        self.active_rows[s] = 0
        if self.has_limits:
            self.fill_limit_rows(s, full)
            if pose == BEST_WITHIN and self.cost[s] > self.sample_cost[s]:
                self.pose[s, 0], self.pose[s, 1], self.pose[s, 2] = a, z1, z2
                self.fill_residual(s, True)
                self.fill_limit_rows(s, full)
        if not isfinite(self.cost[s]):
            self.cost[s] = INFINITE
            return False
        if full:
            self.fill_derivatives(s)
            if self.shape.chart == GRASHOF:
                self.apply_bounds(s)
        return True

    @cfunc
    def update_shape(self, s: cython.int):
        """Evaluate the shape of a set."""
        q0, q1, q2, q3 = (
            self.shape_values[s, 0],
            self.shape_values[s, 1],
            self.shape_values[s, 2],
            self.shape_values[s, 3],
        )
        self.shape.evaluate(q0, q1, q2, q3, self.branch[s])

    @cfunc
    def close_at_samples(self, s: cython.int, full: bint) -> bint:
        """Compute crank and coupler directions at all samples, with ``full`` also the derivatives of the body's angle."""
        loop, shape = self.shape.loop, self.shape
        if self.has_timing and not self.closes_between(s):
            return False
        for i in range(self.samples):
            if not loop.close_at(self.crank_angle[s, i], full):
                return False
            self.e1[i], self.e2[i] = loop.e1, loop.e2
            if self.has_timing and self.has_rotation:
                self.rotation_gap[i] = self.target_rotation[i] - loop.coupler_angle(self.crank_angle[s, i])
            if full:
                for k in range(self.shape_unknowns):
                    self.coupler_slopes[k, i] = (
                        loop.partials[0] * shape.partials[0, k]
                        + loop.partials[1] * shape.partials[1, k]
                        + loop.partials[2] * shape.partials[2, k]
                        + loop.partials[3] * shape.partials[3, k]
                    )
                self.coupler_slopes[4, i] = loop.partials[4]
        return True

    @cfunc
    def find_end_samples(self, s: cython.int):
        """Find the samples with the smallest and the largest crank angle."""
        self.first_sample = 0
        self.last_sample = 0
        for i in range(1, self.samples):
            if self.crank_angle[s, i] < self.crank_angle[s, self.first_sample]:
                self.first_sample = i
            if self.crank_angle[s, i] > self.crank_angle[s, self.last_sample]:
                self.last_sample = i

    @cfunc
    def closes_between(self, s: cython.int) -> bint:
        """Check that the loop closes at its critical crank angles if the motion passes them.

        The diagonal is shortest at theta1 = 0 and longest at pi.
        """
        loop = self.shape.loop
        if loop.x0 > 0.0 and loop.y0 > 0.0:
            return True
        return not ((loop.y0 <= 0.0 and self.passes(s, 0.0)) or (loop.x0 <= 0.0 and self.passes(s, PI)))

    @cfunc
    def passes(self, s: cython.int, angle: double) -> bint:
        """Return whether the motion passes a crank angle modulo a turn."""
        if self.closed:
            return True
        self.find_end_samples(s)
        first, last = self.crank_angle[s, self.first_sample], self.crank_angle[s, self.last_sample]
        return floor((last - angle) / TURN) >= -floor((angle - first) / TURN)

    @cfunc
    def align_offset(self, s: cython.int):
        """Set the offset to the mean direction of the rotation gaps."""
        mean = 0j
        for i in range(self.samples):
            mean += self.rotation_root[i] * self.rotation_root[i] * self.target_direction[i] * self.e2[i].conjugate()
        self.offset[s] = atan2(mean.imag, mean.real)

    @cfunc
    def fit_pose(self, s: cython.int):
        """Fit A, z1, z2 in the least-squares sense by twice-iterated Gram-Schmidt over {1, e1, e2}, not by normal equations."""
        for i in range(self.samples):
            root = self.position_root[i]
            self.basis[0, i] = times(root, self.e1[i])
            self.basis[1, i] = times(root, self.e2[i])
        mean1 = self.remove_mean(0)
        mean1 += self.remove_mean(0)
        square = self.basis_square(0)
        mean2, share = self.remove_mean(1), self.remove_projection(1, 0, square)
        mean2 += self.remove_mean(1)
        share += self.remove_projection(1, 0, square)
        # the positions have mean zero
        z2 = times(1.0 / self.basis_square(1), self.basis_product(2, 1))
        z1 = times(1.0 / square, self.basis_product(2, 0)) - share * z2
        self.pose[s, 0] = -mean1 * z1 - mean2 * z2
        self.pose[s, 1] = z1
        self.pose[s, 2] = z2

    @cfunc
    def remove_mean(self, k: cython.int) -> doublecomplex:
        """Subtract and return the weighted mean of a column of ``basis``."""
        mean: doublecomplex = 0j
        for i in range(self.samples):
            mean += times(self.position_root[i], self.basis[k, i])
        for i in range(self.samples):
            self.basis[k, i] = self.basis[k, i] - times(self.position_root[i], mean)
        return mean

    @cfunc
    def remove_projection(self, k: cython.int, j: cython.int, square: double) -> doublecomplex:
        """Subtract from a column of ``basis`` its projection on another column. Return the coefficient."""
        part = times(1.0 / square, self.basis_product(k, j))
        for i in range(self.samples):
            self.basis[k, i] = self.basis[k, i] - part * self.basis[j, i]
        return part

    @cfunc
    def basis_product(self, k: cython.int, j: cython.int) -> doublecomplex:
        """Return the inner product of two columns of ``basis``."""
        part: doublecomplex = 0j
        for i in range(self.samples):
            part += self.basis[j, i].conjugate() * self.basis[k, i]
        return part

    @cfunc
    def basis_square(self, k: cython.int) -> double:
        """Return the squared norm of a column of ``basis``; 1 if the column vanishes."""
        total = self.basis_product(k, k).real
        return total if total > ROUNDING_COST else 1.0

    @cfunc
    def fill_residual(self, s: cython.int, pose: bint):
        """Fill the residual of the samples and their sum of squares, with ``pose`` at the best offset."""
        last, total = self.columns, 0.0
        if self.has_rotation:
            mean = self.fill_rotation_gaps(s)
            if self.fixed_offset:
                mean = TURN * rint(mean / TURN)
            elif pose:
                self.offset[s] += mean
            else:
                mean = 0.0
            for i in range(self.samples):
                value = self.gap[i] - mean
                if not self.has_timing:
                    value -= TURN * rint(value / TURN)
                value *= self.rotation_root[i]
                self.rows[s, last, i] = value
                total += value * value
        if self.has_position:
            a, z1, z2 = self.pose[s, 0], self.pose[s, 1], self.pose[s, 2]
            x = self.sample_rows - 2 * self.samples
            y = x + self.samples
            for i in range(self.samples):
                left = self.target_position[i] - times(self.position_root[i], a + z1 * self.e1[i] + z2 * self.e2[i])
                self.rows[s, last, x + i] = left.real
                self.rows[s, last, y + i] = left.imag
                total += inner(left, left)
        self.sample_cost[s] = total
        self.cost[s] = total

    @cfunc
    def fill_rotation_gaps(self, s: cython.int) -> double:
        """Fill the target rotations minus the body's, modulo a turn unless timing is prescribed. Return their mean."""
        mean, back = 0.0, vector(cos(self.offset[s]), -sin(self.offset[s]))
        for i in range(self.samples):
            if self.has_timing:
                self.gap[i] = self.rotation_gap[i] - self.offset[s]
            else:
                target = self.target_direction[i] * back
                self.gap[i] = atan2(cross(self.e2[i], target), inner(self.e2[i], target))
            mean += self.rotation_root[i] * self.rotation_root[i] * self.gap[i]
        return mean

    @cfunc
    @inline
    @cython.exceptval(check=False)
    def put_complex_column(self, s: cython.int, c: cython.int, i: Py_ssize_t, value: doublecomplex) -> cython.void:
        """Fill a sample's derivatives with respect to a complex unknown, whose two columns begin at c."""
        x = self.sample_rows - 2 * self.samples + i
        y = x + self.samples
        self.rows[s, c, x] = value.real
        self.rows[s, c, y] = value.imag
        self.rows[s, c + 1, x] = -value.imag
        self.rows[s, c + 1, y] = value.real

    @cfunc
    def fill_derivatives(self, s: cython.int):
        """Fill the sample rows' derivatives with respect to the varying unknowns and to each sample's crank angle."""
        n = self.samples
        if self.has_rotation:
            for k in range(self.shape_unknowns):
                for i in range(n):
                    self.rows[s, self.linear_unknowns + k, i] = -self.rotation_root[i] * self.coupler_slopes[k, i]
            for i in range(n):
                self.angle_slopes[s, i] = -self.rotation_root[i] * self.coupler_slopes[4, i]
        if self.has_position:
            x = self.sample_rows - 2 * n
            y = x + n
            iz1, iz2 = 1j * self.pose[s, 1], 1j * self.pose[s, 2]
            for i in range(n):
                root = -self.position_root[i]
                crank, coupler = times(root, self.e1[i]), times(root, self.e2[i])
                self.put_complex_column(s, 2, i, crank)
                self.put_complex_column(s, 4, i, coupler)
                self.lever[i] = iz2 * coupler
                by_angle = iz1 * crank + times(self.coupler_slopes[4, i], self.lever[i])
                self.angle_slopes[s, x + i] = by_angle.real
                self.angle_slopes[s, y + i] = by_angle.imag
            for k in range(self.shape_unknowns):
                for i in range(n):
                    self.rows[s, self.linear_unknowns + k, x + i] = self.lever[i].real * self.coupler_slopes[k, i]
                    self.rows[s, self.linear_unknowns + k, y + i] = self.lever[i].imag * self.coupler_slopes[k, i]
        if self.has_timing and not self.fixed_start:
            for j in range(self.sample_rows):
                self.rows[s, self.columns - 1, j] = self.angle_slopes[s, j]

    @cfunc
    def apply_bounds(self, s: cython.int):
        """Clear the derivatives with respect to shape unknowns that are held by a bound."""
        rows = self.sample_rows + self.active_rows[s]
        for k in range(self.linear_unknowns, self.linear_unknowns + self.shape_unknowns):
            value = self.shape_values[s, k - self.linear_unknowns]
            toward: double = 0.0
            if fabs(value) > AT_BOUND:
                continue
            for j in range(rows):
                toward += self.rows[s, k, j] * self.rows[s, self.columns, j]
            if copysign(1.0, value) * toward > 0.0:
                for j in range(rows):
                    self.rows[s, k, j] = 0.0

    # -- rows of limits --------------------------------------------------------------------------------------------------

    @cfunc
    def evaluate_limits(self, s: cython.int) -> double:
        """Evaluate the limits at a set. Return |z1| over the length of the crank in the chart."""
        loop, own = self.shape.loop, self.limits.loop
        z1 = self.pose[s, 1]
        size = sqrt(inner(z1, z1))
        scale = size / loop.length[0] if self.limits.has_pose else 1.0
        for k in range(4):
            own.length[k] = scale * loop.length[k]
        own.branch = self.branch[s]
        own.x0 = scale * scale * loop.x0
        own.y0 = scale * scale * loop.y0
        self.find_end_samples(s)
        first, last = self.crank_angle[s, self.first_sample], self.crank_angle[s, self.last_sample]
        direction = times(1.0 / size if size > 0.0 else 0.0, z1)
        last = first + TURN if self.closed else last
        self.limits.evaluate(first, last, self.pose[s, 0], direction, self.pose[s, 2])
        return scale

    @cfunc
    def violation(self, row: cython.int) -> double:
        """Return the violation of a limit; 0 if it is satisfied."""
        value = self.limits.values[row]
        if not isfinite(value):
            value = -1.0
        if self.limits.equations[row]:
            return -value
        return max(MARGIN - value, 0.0)

    @cfunc
    def largest_violation(self) -> double:
        """Return the largest violation without margins; ``scratch[0]`` receives the sum of squares."""
        largest, total = 0.0, 0.0
        for row in range(self.limits.rows):
            value = self.limits.values[row]
            if not isfinite(value):
                value = -1.0
            value = fabs(value) if self.limits.equations[row] else max(-value, 0.0)
            total += value * value
            largest = max(largest, value)
        self.scratch[0] = total
        return largest

    @cfunc
    def fill_limit_rows(self, s: cython.int, full: bint):
        """Append the rows of violated limits, and add their squares to the cost."""
        limits, scale, root, at = self.limits, self.evaluate_limits(s), sqrt(self.penalty), 0
        for row in range(limits.rows):
            value = root * self.violation(row)
            if value == 0.0:
                continue
            self.cost[s] += value * value
            if not full:
                continue
            j = self.sample_rows + at
            known: bint = isfinite(limits.values[row])
            if known:
                self.fill_limit_slopes(s, row, scale)
            for c in range(self.columns):
                self.rows[s, c, j] = -root * self.limit_slopes[c] if known else 0.0
            self.rows[s, self.columns, j] = value
            # a limit that depends on the first or last crank angle belongs to that sample
            late: bint = fabs(limits.slopes[row, BY_LAST]) > fabs(limits.slopes[row, BY_FIRST])
            self.limit_sample[s, at] = self.last_sample if late else self.first_sample
            self.limit_angle_slopes[s, at] = -root * limits.slopes[row, BY_LAST if late else BY_FIRST]
            if self.has_timing or self.closed or not known:
                self.limit_angle_slopes[s, at] = 0.0
            at += 1
        self.active_rows[s] = at

    @cfunc
    def fill_limit_slopes(self, s: cython.int, row: cython.int, scale: double):
        """Fill the derivatives of a limit with respect to shape and pose. Lengths of the chart are scaled to |z1|."""
        limits, loop, shape = self.limits, self.shape.loop, self.shape
        by_size: double = 0.0
        for c in range(self.linear_unknowns):
            self.limit_slopes[c] = 0.0
        if limits.has_pose:
            for c in range(4):
                by_size += limits.slopes[row, c] * loop.length[c] / loop.length[0]
            z1 = self.pose[s, 1]
            size = sqrt(inner(z1, z1))
            size = size if size > 0.0 else 1.0
            # along z1 and across it
            by_z1 = vector(by_size, limits.slopes[row, BY_TURNED] / size) * times(1.0 / size, z1)
            self.limit_slopes[0] = limits.slopes[row, BY_PIVOT]
            self.limit_slopes[1] = limits.slopes[row, BY_PIVOT + 1]
            self.limit_slopes[2] = by_z1.real
            self.limit_slopes[3] = by_z1.imag
            self.limit_slopes[4] = limits.slopes[row, BY_BODY]
            self.limit_slopes[5] = limits.slopes[row, BY_BODY + 1]
        for k in range(self.shape_unknowns):
            total: double = -by_size * shape.partials[0, k]
            for c in range(4):
                total += limits.slopes[row, c] * shape.partials[c, k]
            self.limit_slopes[self.linear_unknowns + k] = scale * total
        if self.has_timing:
            both = limits.slopes[row, BY_FIRST] + limits.slopes[row, BY_LAST]
            self.limit_slopes[self.columns - 1] = 0.0 if self.fixed_start else both

    @cfunc
    def restore_step(self, s: cython.int, scale: double) -> bint:
        """Take one Newton step of shape and pose onto the violated limits. Return False if all are satisfied."""
        for k in range(4):
            self.previous_step[k] = 0.0
        if not self.shortest_step(s, scale):
            return False
        if self.shape.chart == GRASHOF:
            held: bint = False
            for k in range(4):
                value, change = self.shape_values[s, k], self.step[self.linear_unknowns + k]
                if fabs(value) <= AT_BOUND and copysign(1.0, value) * change < 0.0:
                    self.previous_step[k] = 1.0
                    held = True
            if held:
                self.shortest_step(s, scale)
        for i in range(self.samples):
            self.angle_step[i] = 0.0
        if self.has_rotation:
            self.step[self.linear_unknowns - 1] = 0.0
        self.apply_step(s, s)
        return True

    @cfunc
    def shortest_step(self, s: cython.int, scale: double) -> bint:
        """Compute the shortest such step without the held shape unknowns. Return False if no limit is violated."""
        rows, largest = 0, 0.0
        for c in range(self.columns + 1):
            for j in range(self.row_stride):
                self.reduced_rows[c, j] = 0.0
        for row in range(self.limits.rows):
            value = self.limits.values[row]
            if not isfinite(value) or (fabs(value) <= SATISFIED if self.limits.equations[row] else value >= MARGIN):
                continue
            self.fill_limit_slopes(s, row, scale)
            for c in range(self.columns):
                self.reduced_rows[c, rows] = self.limit_slopes[c]
            self.reduced_rows[self.columns, rows] = value if self.limits.equations[row] else value - NEWTON_MARGIN
            rows += 1
        if rows == 0:
            return False
        for k in range(self.shape_unknowns):
            if self.previous_step[k] != 0.0:
                for j in range(rows):
                    self.reduced_rows[self.linear_unknowns + k, j] = 0.0
        for c in range(self.columns):
            largest = max(largest, self.column_product(c, c))
        for c in range(self.columns):
            self.ridge[c] = NEWTON_DAMPING * largest if largest > 0.0 else 1.0
        self.factorise_orthogonally(0.0)
        for c in range(self.columns):
            self.step[c] = -self.upper_triangle[c, self.columns]
        self.solve_upper(self.step)
        return True

    # -- step ----------------------------------------------------------------------------------------------------------

    @cfunc
    def update_angle_squares(self, s: cython.int) -> double:
        """Sum the squares of the derivatives by each crank angle into ``angle_squares``. Return their mean."""
        n, total = self.samples, 0.0
        for i in range(n):
            self.angle_squares[i] = 0.0
        for r in range(self.components):
            base = r * n
            for i in range(n):
                self.angle_squares[i] += self.angle_slopes[s, base + i] * self.angle_slopes[s, base + i]
        for k in range(self.active_rows[s]):
            slope = self.limit_angle_slopes[s, k]
            self.angle_squares[self.limit_sample[s, k]] += slope * slope
        for i in range(n):
            total += self.angle_squares[i]
        return total / n

    @cfunc
    def eliminate_angles(self, s: cython.int, damping: double):
        """Fill ``reduced_rows`` by eliminating the crank angles (variable projection), and the squares of its columns."""
        n, flat, active = self.samples, self.sample_rows, self.active_rows[s]
        if not self.has_timing:
            mean = self.update_angle_squares(s)
            for i in range(n):
                own = ANGLE_DAMPING * damping * max(self.angle_squares[i], ANGLE_SQUARE_MIN * mean) + FLAT * mean
                value = self.angle_squares[i] + own
                value = value if value > 0.0 else 1.0
                self.angle_squares[i] = value
                self.elimination_factor[i] = 1.0 / (value * (1.0 + sqrt(own / value)))
        for c in range(self.columns + 1):
            if self.has_timing:
                for j in range(flat + active):
                    self.reduced_rows[c, j] = self.rows[s, c, j]
            else:
                self.eliminate_column(s, c)
            for j in range(flat + active, self.row_stride):
                self.reduced_rows[c, j] = 0.0
            self.column_squares[c] = self.column_product(c, c)

    @cfunc
    def pool_adjacent_violators(self):
        """Replace ``requested_angle`` by its weighted isotonic regression."""
        top: Py_ssize_t = 0
        for i in range(self.samples):
            self.pooled_level[top], self.block_head[top] = self.requested_angle[i], i
            self.pooled_weight[top] = max(self.angle_squares[i], TINY)
            while top > 0 and self.pooled_level[top - 1] >= self.pooled_level[top]:
                total = self.pooled_weight[top - 1] + self.pooled_weight[top]
                rise = self.pooled_level[top] - self.pooled_level[top - 1]
                self.pooled_level[top - 1] += self.pooled_weight[top] / total * rise
                self.pooled_weight[top - 1] = total
                top -= 1
            top += 1
        end: Py_ssize_t = self.samples
        while top > 0:
            top -= 1
            for i in range(self.block_head[top], end):
                self.requested_angle[i] = self.pooled_level[top]
            end = self.block_head[top]

    @cfunc
    def eliminate_column(self, s: cython.int, c: cython.int):
        """Fill a column of ``reduced_rows`` and its inner products with the derivatives by the crank angles."""
        n, flat = self.samples, self.sample_rows
        for i in range(n):
            self.angle_projection[c, i] = self.rows[s, c, i] * self.angle_slopes[s, i]
        for r in range(1, self.components):
            base = r * n
            for i in range(n):
                self.angle_projection[c, i] += self.rows[s, c, base + i] * self.angle_slopes[s, base + i]
        for k in range(self.active_rows[s]):
            i = self.limit_sample[s, k]
            self.angle_projection[c, i] += self.limit_angle_slopes[s, k] * self.rows[s, c, flat + k]
        for r in range(self.components):
            base = r * n
            for i in range(n):
                part = self.elimination_factor[i] * self.angle_slopes[s, base + i] * self.angle_projection[c, i]
                self.reduced_rows[c, base + i] = self.rows[s, c, base + i] - part
        for k in range(self.active_rows[s]):
            i = self.limit_sample[s, k]
            part = self.elimination_factor[i] * self.limit_angle_slopes[s, k] * self.angle_projection[c, i]
            self.reduced_rows[c, flat + k] = self.rows[s, c, flat + k] - part

    @cfunc
    @inline
    @cython.exceptval(check=False)
    def column_product(self, a: cython.int, b: cython.int) -> double:
        """Return the inner product of two reduced columns, in four partial sums that a processor adds at once."""
        s0: double = 0.0
        s1: double = 0.0
        s2: double = 0.0
        s3: double = 0.0
        for j in range(0, self.row_stride, 4):
            s0 += self.reduced_rows[a, j] * self.reduced_rows[b, j]
            s1 += self.reduced_rows[a, j + 1] * self.reduced_rows[b, j + 1]
            s2 += self.reduced_rows[a, j + 2] * self.reduced_rows[b, j + 2]
            s3 += self.reduced_rows[a, j + 3] * self.reduced_rows[b, j + 3]
        return (s0 + s1) + (s2 + s3)

    @cfunc
    def factorise(self, damping: double):
        """Compute the triangular factor R of the damped rows, with the residual last, from normal equations if they suffice."""
        for c in range(self.columns):
            self.ridge[c] = damping
            if self.column_squares[c] > 0.0:
                own = LINEAR_DAMPING if c < self.linear_unknowns else 1.0
                # linear unknowns in their best pose need no damping, unless limits restrict the pose
                free: bint = self.has_timing and not self.has_pose
                self.ridge[c] = 0.0 if free else damping * own * self.column_squares[c]
        if not (damping > NORMAL_DAMPING_MIN and self.factorise_normal_matrix(damping)):
            self.factorise_orthogonally(damping)

    @cfunc
    def factorise_orthogonally(self, damping: double):
        """Compute R by Gram-Schmidt with each pivot as its own damping row; ``reduced_rows`` is overwritten.

        This equals Householder's method with the damping rows on top. With prescribed timing, the damping is relative to the part
        of each column that is orthogonal to the linear columns.
        """
        for c in range(self.columns):
            if c == self.linear_unknowns and self.has_timing and damping > 0.0:
                for k in range(c, self.columns):
                    if self.column_squares[k] > 0.0:
                        self.ridge[k] = damping * max(self.column_product(k, k), FLAT * self.column_squares[k])
            root, norm = sqrt(self.ridge[c]), sqrt(self.column_product(c, c) + self.ridge[c])
            self.upper_triangle[c, c] = norm
            for k in range(c + 1, self.columns + 1):
                self.upper_triangle[c, k] = 0.0
                if norm > 0.0:
                    product = self.column_product(c, k) / norm
                    self.upper_triangle[c, k] = product
                    # v0 = root + norm, beta = 1 / (norm v0)
                    product /= norm + root
                    for j in range(self.row_stride):
                        self.reduced_rows[k, j] -= product * self.reduced_rows[c, j]

    @cfunc
    def factorise_normal_matrix(self, damping: double) -> bint:
        """Compute R by Cholesky's method from the scaled normal matrix. Return False if it is ill-conditioned."""
        count = self.columns
        for c in range(count + 1):
            self.scratch[c] = sqrt(self.column_squares[c]) if self.column_squares[c] > 0.0 else 1.0
        for c in range(count):
            for k in range(c, count + 1):
                value: double = self.column_squares[c] if k == c else self.column_product(c, k)
                value /= self.scratch[c] * self.scratch[k]
                for j in range(c if k > c else min(c, self.linear_unknowns)):
                    value -= self.upper_triangle[j, c] * self.upper_triangle[j, k]
                if k > c:
                    self.upper_triangle[c, k] = value / self.upper_triangle[c, c]
                    continue
                if self.has_timing and c >= self.linear_unknowns and self.column_squares[c] > 0.0:
                    if not value > ORTHOGONAL_MIN:
                        return False
                    self.ridge[c] = damping * value * self.column_squares[c]
                value += self.ridge[c] / (self.scratch[c] * self.scratch[c])
                for j in range(self.linear_unknowns, c):
                    value -= self.upper_triangle[j, c] * self.upper_triangle[j, c]
                if not value > PIVOT_MIN:
                    return False
                self.upper_triangle[c, c] = sqrt(value)
        for c in range(count):
            for k in range(c, count + 1):
                self.upper_triangle[c, k] *= self.scratch[k]
        return True

    @cfunc
    def solve_upper(self, x: double[::1]):
        """Replace x by R^{-1} x, or by zero if R is singular."""
        good: bint = True
        for c in range(self.columns - 1, -1, -1):
            value: double = x[c]
            for k in range(c + 1, self.columns):
                value -= self.upper_triangle[c, k] * x[k]
            x[c] = value / self.upper_triangle[c, c]
            good = good and isfinite(x[c])
        if not good:
            for c in range(self.columns):
                x[c] = 0.0

    @cfunc
    def compute_step(self, s: cython.int, damping: double) -> double:
        """Compute the step from a set, and its crank angles. Return the predicted decrease of the cost."""
        total = 0.0
        self.eliminate_angles(s, damping)
        self.factorise(damping)
        for c in range(self.columns):
            self.step[c] = -self.upper_triangle[c, self.columns]
            total += self.step[c] * self.step[c]
        self.solve_upper(self.step)
        for c in range(self.columns):
            total += self.ridge[c] * self.step[c] * self.step[c]
        n, last = self.samples, self.columns
        for i in range(n):
            self.angle_step[i] = self.step[last - 1] if self.has_timing else self.angle_projection[last, i]
        if not self.has_timing:
            for c in range(last):
                for i in range(n):
                    self.angle_step[i] += self.step[c] * self.angle_projection[c, i]
            for i in range(n):
                self.angle_step[i] = -self.angle_step[i] / self.angle_squares[i]
        return total

    @cfunc
    def apply_step(self, s: cython.int, t: cython.int):
        """Set the set t to s after its step; the change of each unknown and gap is limited."""
        self.branch[t] = self.branch[s]
        self.offset[t] = self.offset[s]
        if self.has_position:
            for k in range(3):
                self.pose[t, k] = self.pose[s, k] + vector(self.step[2 * k], self.step[2 * k + 1])
        if self.has_rotation:
            self.offset[t] += self.step[self.linear_unknowns - 1]
        if self.shape.chart == GRASHOF:
            self.apply_grashof_step(s, t)
        else:
            for k in range(self.shape_unknowns):
                change = clip(self.step[self.linear_unknowns + k], STEP_MAX)
                self.shape_values[t, k] = self.shape_values[s, k] + change
        if self.has_timing:
            start = self.crank_angle[s, 0] + clip(self.step[self.columns - 1], START_STEP_MAX)
            for i in range(self.samples):
                self.crank_angle[t, i] = start + self.crank_increments[i]
        elif self.ordered:
            self.apply_ordered_step(s, t)
        else:
            for i in range(self.samples):
                self.crank_angle[t, i] = self.crank_angle[s, i] + clip(self.angle_step[i], ANGLE_STEP_MAX)

    @cfunc
    def apply_grashof_step(self, s: cython.int, t: cython.int):
        """Move the unknowns of a Grashof chart within their bounds and normalise their sum; the first keeps its sign."""
        sign = copysign(1.0, self.shape_values[s, 0])
        total: double = 0.0
        for k in range(4):
            own, change = sign if k == 0 else 1.0, clip(self.step[self.linear_unknowns + k], GRASHOF_STEP_MAX)
            self.shape_values[t, k] = max(own * (self.shape_values[s, k] + change), TINY)
            total += self.shape_values[t, k]
        for k in range(4):
            self.shape_values[t, k] = max(self.shape_values[t, k] / total, BOUND)
        self.shape_values[t, 0] *= sign

    @cfunc
    def apply_ordered_step(self, s: cython.int, t: cython.int):
        """Move the crank angles so that the samples keep their order and satisfy the limit on the span.

        Among all angles that leave a fraction of each gap, the result is nearest to the requested angles with the weights
        ``angle_squares``. A common rotation of all angles is not restricted.
        """
        n = self.samples
        span: double = 0.0
        new: double = 0.0
        cut: double = 0.0
        mean: double = 0.0
        direction = 1.0 if self.crank_angle[s, n - 1] >= self.crank_angle[s, 0] else -1.0
        for i in range(n):
            along = (1.0 - GAP_FRACTION_MIN) * (self.crank_angle[s, i] - self.crank_angle[s, 0])
            self.requested_angle[i] = direction * (self.angle_step[i] + along)
        self.pool_adjacent_violators()
        for i in range(n - 1):
            gap = direction * (self.crank_angle[s, i + 1] - self.crank_angle[s, i])
            self.gap[i] = self.requested_angle[i + 1] - self.requested_angle[i] + GAP_FRACTION_MIN * gap
            span += gap
            new += self.gap[i]
        room = self.span_max - GAP_MIN * (n - 1) - span
        longest = span + (ROOM_FRACTION_MAX * room if room > 0.0 else room)
        factor = min(1.0, longest / max(new, TINY))
        mean = direction * self.requested_angle[0]
        self.angle_change[0] = 0.0
        for i in range(n - 1):
            gap = direction * (self.crank_angle[s, i + 1] - self.crank_angle[s, i])
            cut += direction * (max(self.gap[i] * factor, min(gap, GAP_MIN)) - gap)
            self.angle_change[i + 1] = cut
            # requested change minus the applied change
            along = (1.0 - GAP_FRACTION_MIN) * (self.crank_angle[s, i + 1] - self.crank_angle[s, 0])
            mean += direction * self.requested_angle[i + 1] - along - cut
        mean = clip(mean / n, PI)
        for i in range(n):
            self.crank_angle[t, i] = self.crank_angle[s, i] + (self.angle_change[i] + mean)

    # -- run -----------------------------------------------------------------------------------------------------------

    def set_candidates(self, shapes, poses, offsets, angles, branches, penalty):
        """Set the candidates, whose arrays receive the results. Return the array of their costs.

        Parameters
        ----------
        shapes : ndarray, shape (n, k)
        poses : ndarray, shape (n, 6)
        offsets, branches : ndarray, shape (n,)
        angles : ndarray, shape (n, N)
        penalty : float
            Weight of squared violations relative to J squared.
        """
        costs = np.empty(len(branches))
        self.shapes, self.poses, self.offsets, self.angles = shapes, poses.view(complex), offsets, angles
        self.branches, self.costs, self.penalty = branches, costs, penalty
        self.candidate, self.started, self.lowest_cost = 0, False, INFINITE
        return costs

    def configure(self, iterations, damping, stall, exact, iteration_factor, penalty):
        """Set the options of the descents; see `descents.Problem.descended`."""
        self.iterations, self.first_damping, self.stall = iterations, damping, stall
        self.exact, self.iteration_factor, self.penalty = exact, iteration_factor, penalty
        self.candidate, self.started = 0, False

    def run(self, max_steps: Py_ssize_t):
        """Continue for a number of steps. Return True once all candidates have terminated."""
        if self.iteration_factor == 0.0 and self.lowest_cost <= self.exact:
            return True
        while self.candidate < self.costs.shape[0]:
            if max_steps <= 0:
                return False
            max_steps -= 1
            if not (self.started or self.start_candidate()):
                self.costs[self.candidate] = INFINITE
                self.candidate += 1
                continue
            ended: bint = self.iteration >= self.iterations or self.advance()
            self.iteration += 1
            self.lowest_cost = min(self.lowest_cost, self.best_cost)
            if self.best_cost <= self.exact:
                ended = True
                if self.iteration_factor == 0.0:
                    return True
                remaining = min(1.0 * self.iterations, self.iteration_factor * self.iteration)
                self.iterations = cython.cast(cython.int, remaining)
            if ended:
                self.candidate += 1
                self.started = False
        return True

    @cfunc
    def start_candidate(self) -> bint:
        """Begin with the next candidate. Return False if it does not close."""
        self.load(0, self.candidate)
        if not self.evaluate_start(0):
            return False
        self.store(0, self.candidate)
        self.started, self.current, self.iteration = True, 0, 0
        self.damping, self.growth, self.best_cost = self.first_damping, 2.0, self.cost[0]
        for k in range(5):
            self.previous_step[k] = 0.0
        return True

    @cfunc
    def evaluate_start(self, s: cython.int) -> bint:
        """Evaluate a candidate's start, in its best pose if limits leave the pose free."""
        return self.evaluate(s, True, BEST_OFFSET if self.has_pose else BEST, False)

    @cfunc
    def advance(self) -> bint:
        """Take one step of the candidate. Return whether it has terminated."""
        s, t = self.current, 1 - self.current
        before, predicted = self.cost[s], self.compute_step(s, self.damping)
        self.apply_step(s, t)
        pose = BEST if not self.has_pose else BEST_WITHIN if self.active_rows[s] == 0 else BEST_OFFSET
        closes = self.evaluate(t, True, pose, False)
        decrease = before - self.cost[t]
        better: bint = closes and decrease > 0.0
        taken: bint = better or (closes and self.accepts_uphill(self.cost[t]))
        finished: bint = (better and decrease < self.stall * before) or before < max(ROUNDING_COST, self.exact)
        if better:
            gain = 2.0 * clip(decrease / max(predicted, TINY), 1.0) - 1.0
            self.damping = max(self.damping * max(DAMPING_DECREASE_MAX, 1.0 - gain * gain * gain), DAMPING_MIN)
        elif not taken:
            self.damping *= self.growth
        self.growth = 2.0 if taken else 2.0 * self.growth
        if taken:
            self.current = t
            for k in range(self.nonlinear_unknowns):
                self.previous_step[k] = self.step[self.linear_unknowns + k]
            if self.cost[t] < self.best_cost:
                self.best_cost = self.cost[t]
                self.store(t, self.candidate)
        return finished or self.damping > DAMPING_MAX

    @cfunc
    def accepts_uphill(self, cost: double) -> bint:
        """Return whether an uphill step is accepted: the straighter the path, the larger the increase that is allowed."""
        product, own, last = 0.0, 0.0, 0.0
        for k in range(self.nonlinear_unknowns):
            step = self.step[self.linear_unknowns + k]
            product += step * self.previous_step[k]
            own += step * step
            last += self.previous_step[k] * self.previous_step[k]
        length = sqrt(own * last)
        part = 1.0 - min(max(product / (length if length > 0.0 else 1.0), 0.0), COSINE_MAX)
        return part * part * cost < self.best_cost
