"""Within limits: candidates with crank angles descend with rows that grow where they leave a limit.

The rows ``penalty * max(0, margin - slack)`` stand beside the samples' as samples without a crank angle of their own. The pose
is an unknown like the others here, because the best pose of a shape may break a limit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.limits import Limits
from synthesis.fourbar.mechanism import FOURBAR
from synthesis.free.joint import refine
from synthesis.free.pool import Pool
from synthesis.free.poses import Poses
from synthesis.free.rows import JointProblem, Rows, Timed, Turned
from synthesis.mechanism import BodyAngles, Chart
from synthesis.search.schedule import PENALTIES
from synthesis.work import Work

Floats = NDArray[np.float64]

_MARGIN, _STEP = 1e-5, 1e-7
"""Slack that is aimed for, and the step of the limits' derivatives."""


class LimitedJoint(JointProblem):
    """Poses, a chart and limits made ready for many evaluations.

    Parameters
    ----------
    poses : Poses
    chart : Chart
    limits : Limits
    penalty : float
        Its square weighs squared violations against J squared.
    """

    def __init__(self, poses: Poses, chart: Chart, limits: Limits, penalty: float) -> None:
        super().__init__(poses, chart)
        self.limits, self.penalty = limits, penalty
        self.plain = JointProblem(poses, chart)

    def posed(self, timed: Timed, turned: Turned) -> Timed:
        """The candidates as they are: their pose is an unknown."""
        return timed

    def slacks(self, timed: Timed) -> Floats:
        """How far inside each limit candidates are, (n, columns)."""
        lengths = self.chart.shape(timed.shape).lengths
        a, z1, _ = timed.pose.T
        scale = self.poses.length_scale
        actual = lengths * (scale * np.abs(z1) / lengths[:, 0])[:, None]
        pivots = FOURBAR.pivots(actual, self.poses.middle + scale * a, np.angle(z1))
        start = timed.angles[:, 0]
        used = self.poses.used(timed.angles - start[:, None])
        with np.errstate(divide="ignore", invalid="ignore"):
            slacks = self.limits.slacks(used, actual, start, pivots)
        return np.nan_to_num(slacks, nan=-1.0, neginf=-1e3, posinf=1e3)

    def _broken(self, timed: Timed) -> Floats:
        """The limits' rows, (n, columns)."""
        return self.penalty * np.maximum(_MARGIN - self.slacks(timed), 0.0)

    def _as_samples(self, rows: Floats) -> Floats:
        """Rows (..., E) as those of further samples, (..., R, K)."""
        missing = -rows.shape[-1] % self.rows
        padded = np.concatenate([rows, np.zeros((*rows.shape[:-1], missing))], axis=-1)
        return padded.reshape(*rows.shape[:-1], self.rows, -1)

    def residual(self, timed: Timed, turned: Turned) -> Floats:
        """Residuals of the samples, then of the limits, (n, R, N + K)."""
        return np.concatenate([super().residual(timed, turned), self._as_samples(self._broken(timed))], axis=2)

    def cost(self, residual: Floats, body: BodyAngles) -> Floats:
        """J squared and the squares of the limits' rows; infinite where a candidate does not close."""
        cost = np.einsum("nrk,nrk->n", residual, residual)
        return np.where(np.isfinite(cost) & (body.possible if body.possible is not True else True), cost, np.inf)

    def evaluate(self, timed: Timed, turned: Turned) -> Rows:
        """Rows and derivatives, those of the limits by differences."""
        plain = self.plain.evaluate(timed, turned)
        broken = self._broken(timed)
        by_unknown = np.zeros((len(broken), self.columns + 1, broken.shape[1]))
        by_unknown[:, -1] = broken
        if broken.any():
            outward = np.sign(timed.shape) if self.bounded is not None else np.ones_like(timed.shape)
            for k in range(self.size):
                step = np.zeros_like(timed.shape)
                step[:, k] = _STEP * np.where(outward[:, k] == 0, 1.0, outward[:, k])
                moved = self._broken(timed._replace(shape=timed.shape + step))
                by_unknown[:, k] = (moved - broken) / step[:, k, None]
            for k in range(6):
                pose = timed.pose.copy()
                pose[:, k // 2] += _STEP * (1j if k % 2 else 1.0)
                by_unknown[:, self.size + k] = (self._broken(timed._replace(pose=pose)) - broken) / _STEP
        more = self._as_samples(by_unknown)
        stack = np.concatenate([plain.stack, more], axis=3)
        turn = np.concatenate([plain.turn, np.zeros((*plain.turn.shape[:2], more.shape[3]))], axis=2)
        return Rows(self.cost(stack[:, -1], turned.body), stack, turn)

    def moved(self, timed: Timed, step: Floats, turn: Floats) -> Timed:
        """Candidates after a step."""
        return super().moved(timed, step, turn[:, : self.poses.samples])


def within_limits(poses: Poses, chart: Chart, limits: Limits, pool: Pool, work: Work) -> Pool:
    """Candidates of a pool, refined within the limits by penalties that grow; their costs are J squared."""
    timed = pool.timed
    for penalty, steps in PENALTIES:
        if not timed.branch.size or work.expired():
            break
        found = refine(LimitedJoint(poses, chart, limits, penalty), timed, steps, 0.0, work)
        timed = found.timed.take(np.isfinite(found.cost))
    problem = JointProblem(poses, chart)
    turned = problem.turned(timed, derivatives=False)
    return Pool(timed, problem.cost(problem.residual(timed, turned), turned.body))
