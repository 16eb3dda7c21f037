"""Levenberg-Marquardt descents of crank-driven linkages towards the samples of a motion; `descents` derives the method.

A descent refines one candidate after another without allocating. The Jacobian is stored by column, each column contiguous over
component (rotation, x, y) and sample, followed by the rows of violated limits: ``m[set, column, component * N + sample]``, with
the residual in the last column. There are two sets: the current position of a candidate, and the position after its step. They
change places when a step is accepted, so that a rejected step evaluates nothing again. A third set, of which only the residual
is filled, serves the look ahead along a step.

Angles are in radians, lengths are relative to the length scale, costs to its square.
"""

import cython
import numpy as np
from cython import Py_ssize_t, bint, cclass, cfunc, declare, double, doublecomplex, final, inline
from cython.cimports.libc.math import atan2, copysign, cos, fabs, floor, isfinite, rint, sin, sqrt
from cython.cimports.synthesis.kernels.codes import (
    BY_BODY,
    BY_FIRST,
    BY_LAST,
    BY_PIVOT,
    BY_TURNED,
    GRASHOF,
    RAIL,
    SLOT,
)
from cython.cimports.synthesis.kernels.crank_loops import Shape
from cython.cimports.synthesis.kernels.four_bar_limits import Limits
from cython.cimports.synthesis.kernels.plane import cross, inner, inside, times, vector

PI = declare(double, 3.141592653589793)
TURN = declare(double, 6.283185307179586)
INFINITE = declare(double, float("inf"))
TINY = declare(double, 1e-300)  # keeps a divisor from zero
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
