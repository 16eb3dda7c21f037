"""Levenberg-Marquardt descents of pairs of guides within limits.

Angles are in radians, lengths are relative to the length scale, costs to its square.
"""

import cython
import numpy as np
from cython import Py_ssize_t, bint, cclass, cfunc, declare, double, final
from cython.cimports.libc.math import fabs, sqrt
from cython.cimports.synthesis.kernels.codes import PAIR_VALUE
from cython.cimports.synthesis.kernels.pair_rows import PairRows

INFINITE = declare(double, float("inf"))
TINY = declare(double, 1e-300)  # keeps divisors away from zero
DAMPING_DECREASE_MAX = declare(double, 0.1)  # largest decrease of the damping in one step (Nielsen's rule)
DAMPING_MIN = declare(double, 1e-22)  # damping below which a descent counts as undamped
DAMPING_MAX = declare(double, 1e10)  # damping above which a descent ends
ROUNDING_COST = declare(double, 1e-30)  # J squared at the level of rounding
STEP_MAX = declare(double, 1.5)  # largest change of an unknown


@final
@cclass
class PairDescent(PairRows):
    """Levenberg-Marquardt over pairs of guides towards the samples of one motion, with limits; see `PairRows`."""

    # triangular factor by column: current position, damped
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
        super().__init__(samples, limits, has_timing)
        self.current_rows, self.damped_rows = np.zeros((12, 12)), np.zeros((12, 24))
        self.ridge, self.step, self.trial = np.zeros(11), np.zeros(11), np.zeros(11)

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
                drives[n, i] = self.tracked[0, i, PAIR_VALUE]
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
        labels : ndarray, shape (n, 14)
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
