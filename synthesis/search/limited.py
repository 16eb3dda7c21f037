"""The search within limits: shape and pose together are unknown, because the best pose of a shape may break a limit.

Unknowns are those of `projected` and, with positions, six more, lengths over l and positions from their mean: A (two), ln k
(k scales the chart's lengths), theta4, and the coefficient of e^{i theta2} (two). The offset stays projected out. Leaving a
limit costs rows ``penalty * max(0, margin - slack)`` beside the residual.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from synthesis.least_squares import Evaluation
from synthesis.mechanism import Chart, Limits, Mechanism
from synthesis.pose import fit_positions
from synthesis.search.projected import ProjectedProblem
from synthesis.target import Target

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

_MARGIN = 1e-5
"""Makes up for what a finite penalty gives way."""
_STEP = 1e-6


class LimitedProblem:
    """A target, a chart and limits made ready for many evaluations; unknowns and rows as in the module's head.

    Parameters
    ----------
    mechanism : Mechanism
    target : Target
        With a crank that turns counter-clockwise.
    chart : Chart
    limits : Limits
    penalty : float
        Its square weighs squared violations against J squared.
    """

    def __init__(self, mechanism: Mechanism, target: Target, chart: Chart, limits: Limits, penalty: float) -> None:
        rotation = np.zeros(target.samples) if target.rotation is None else target.rotation
        # without a rotation this still tells what closes
        self.plain = ProjectedProblem(replace(target, position=None, rotation=rotation), chart)
        self.mechanism, self.target, self.chart = mechanism, target, chart
        self.limits, self.penalty = limits, penalty
        self.shape_size = len(chart.cell) - 1
        if target.position is not None:
            self.middle = target.position_mean(target.position)
            self.scaled = (target.position - self.middle) / target.length_scale

    def with_pose(self, unknowns: Floats, branch: Floats) -> Floats:
        """Candidates of this problem from those of `ProjectedProblem`: their best pose added; unchanged without positions."""
        if self.target.position is None:
            return unknowns
        start = unknowns[:, -1]
        lengths = self.chart.shape(unknowns[:, :-1]).lengths
        angle = self.mechanism.body_angle(lengths, branch, start[:, None] + self.target.crank)
        fit = fit_positions(self.target, angle)
        scale = self.target.length_scale
        pivot, coupler = (fit.pivot - self.middle) / scale, fit.coupler_vector / scale
        crank = np.maximum(np.abs(fit.crank_vector) / scale, 1e-3)
        ground_angle = np.angle(fit.crank_vector) - start
        pose = [pivot.real, pivot.imag, np.log(crank / lengths[:, 0]), ground_angle, coupler.real, coupler.imag]
        return np.hstack([unknowns, np.stack(pose, axis=1)])

    def lengths(self, unknowns: Floats) -> Floats:
        """Actual lengths, (n, d); without positions the last is 1."""
        lengths = self.chart.shape(unknowns[:, : self.shape_size]).lengths
        if self.target.position is None:
            return lengths / lengths[:, -1:]
        scale = unknowns[:, self.shape_size + 3, None]
        return lengths * (self.target.length_scale * np.exp(np.clip(scale, -60, 60)))

    def pose(self, unknowns: Floats) -> tuple[Complexes, Floats, Complexes] | None:
        """Pivot A, ground angle and the coefficient of e^{i theta2} in the user's unit, (n,) each; None without positions."""
        if self.target.position is None:
            return None
        ax, ay, _, ground_angle, zx, zy = unknowns[:, self.shape_size + 1 :].T
        scale = self.target.length_scale
        return self.middle + scale * (ax + 1j * ay), ground_angle, scale * (zx + 1j * zy)

    def linkages(self, unknowns: Floats, branch: Floats) -> list[Any]:
        """The linkages that candidates are."""
        start = unknowns[:, self.shape_size]
        return self.mechanism.posed(self.lengths(unknowns), branch, start, self.pose(unknowns))

    def slacks(self, unknowns: Floats) -> Floats:
        """Slacks of all limits, see `mechanism.Limits.slacks`, (n, columns)."""
        lengths, pose = self.lengths(unknowns), self.pose(unknowns)
        pivots = () if pose is None else self.mechanism.pivots(lengths, pose[0], pose[1])
        return self.limits.slacks(self.target, lengths, unknowns[:, self.shape_size], pivots)

    def evaluate(self, unknowns: Floats, branch: Floats) -> Evaluation:
        """Residuals and derivatives, the penalty included."""
        shape = self.shape_size + 1
        plain = self.plain.evaluate(unknowns[:, :shape], branch)
        parts = []
        cost = np.where(np.isfinite(plain.cost), 0.0, np.inf)
        if self.target.rotation is not None:
            cost = cost + plain.cost
            part = np.zeros((len(unknowns), unknowns.shape[1] + 1, plain.stack.shape[2]))
            part[:, :shape], part[:, -1] = plain.stack[:, :-1], plain.stack[:, -1]
            parts.append(part)
        if self.target.position is not None:
            parts.append(self._position(unknowns, branch))
            cost = cost + np.sum(parts[-1][:, -1] ** 2, axis=1)
        parts.append(self._violation(unknowns))
        cost = cost + np.sum(parts[-1][:, -1] ** 2, axis=1)
        return Evaluation(np.where(np.isnan(cost), np.inf, cost), np.nan_to_num(np.concatenate(parts, axis=2)))

    def _position(self, unknowns: Floats, branch: Floats) -> Floats:
        size, samples = self.shape_size, self.target.samples
        shape, start = self.chart.shape(unknowns[:, :size]), unknowns[:, size, None]
        crank_angle = start + self.target.crank
        angle, by_length = self.mechanism.body_angle_gradient(shape.lengths, branch, crank_angle)
        slope = np.zeros((len(unknowns), size + 1, samples))
        slope[:, :size] = np.einsum("nmi,nik->nkm", by_length[..., :-1], shape.jacobian)
        slope[:, size] = by_length[..., -1]
        ax, ay, log_scale, ground_angle, zx, zy = unknowns[:, size + 1 :].T
        coupler = zx + 1j * zy
        crank_vector = shape.lengths[:, 0] * np.exp(np.clip(log_scale, -60, 60) + 1j * ground_angle)
        crank = crank_vector[:, None] * np.exp(1j * crank_angle)
        arm = np.exp(1j * angle)
        columns = np.empty((len(unknowns), size + 8, samples), dtype=complex)
        columns[:, : size + 1] = -1j * (coupler[:, None] * arm)[:, None, :] * slope
        columns[:, :size] -= crank[:, None, :] * (shape.jacobian[:, 0] / shape.lengths[:, :1])[:, :, None]
        columns[:, size] -= 1j * crank
        columns[:, size + 1], columns[:, size + 2] = -1.0, -1j
        columns[:, size + 3], columns[:, size + 4] = -crank, -1j * crank
        columns[:, size + 5], columns[:, size + 6] = -arm, -1j * arm
        columns[:, size + 7] = self.scaled - (ax + 1j * ay)[:, None] - crank - coupler[:, None] * arm
        columns *= self.target.position_mean.root
        return np.concatenate([columns.real, columns.imag], axis=2)

    def _violation(self, unknowns: Floats) -> Floats:
        count, size = unknowns.shape
        violation = np.maximum(_MARGIN - self.slacks(unknowns), 0.0)
        rows = np.zeros((count, size + 1, violation.shape[1]))
        rows[:, -1] = violation
        if violation.any():
            # central differences: the limits' derivatives steer the search, its answer is checked on the limits themselves
            steps = _STEP * np.concatenate([np.eye(size), -np.eye(size)])
            moved = self.slacks((unknowns[:, None, :] + steps).reshape(-1, size)).reshape(count, 2, size, -1)
            change = (moved[:, 1] - moved[:, 0]) / (2 * _STEP)
            rows[:, :-1] = np.where(violation[:, None, :] > 0, change, 0.0)
        return self.penalty * rows
