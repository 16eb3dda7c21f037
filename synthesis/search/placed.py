"""A target and limits as problems of least squares under constraints: shape and start alone, or with the pose.

Where limits concern the shape alone, everything linear is projected out as in `projected`. Otherwise the best pose of a shape
may break a limit, and the pose is unknown too. Lengths then are actual, over l, and positions are measured from their mean:

    unknowns   shape (k), theta1 at the first sample, A (x, y), theta4, z2 (x, y)
    residual   P - A - L1 e^{i (theta1 + theta4)} - z2 e^{i theta2}
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.least_squares import Evaluation
from synthesis.mechanism import Bounded, BoundedChart, Constrained, Constraints, Mechanism, Placed
from synthesis.search.projected import ProjectedProblem
from synthesis.target import Target

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Flags = NDArray[np.bool_]

_NONE = np.empty(0, dtype=bool)
_LONGEST_TURN, _LONGEST_WAY = 0.75, 2.0
"""Longest step of angles and of positions over l."""


class Poses(NamedTuple):
    """Poses of candidates over l, from the mean position: pivot A, ground angle and z2, (n,) each."""

    pivot: Complexes
    turned: Floats
    coupler: Complexes


class ShapeProblem:
    """Shape and start, with constraints on both; see the module's head.

    Parameters
    ----------
    target : Target
        With a crank that turns counter-clockwise.
    chart : BoundedChart
    constraints : Constraints
    """

    def __init__(self, target: Target, chart: BoundedChart, constraints: Constraints) -> None:
        self.target, self.chart, self.constraints = target, chart, constraints
        self.size = len(chart.cell) - 1
        self.projected = ProjectedProblem(target, chart)
        self.unknowns = self.size + 1
        self.longest = np.array([_LONGEST_TURN])
        """Longest step of the unknowns behind the shape."""
        self.limited = constraints.any

    def evaluate(self, unknowns: Floats, branch: Floats) -> Evaluation:
        """Residuals and derivatives."""
        return self.projected.evaluate(unknowns, branch)

    def placed(self, unknowns: Floats, branch: Floats, lengths: Floats) -> Placed:
        """Candidates as the limits see them."""
        return Placed(lengths, branch, self.target.interval.after(unknowns[:, self.size]))

    def constrained(self, unknowns: Floats, branch: Floats) -> Constrained:
        """Constraints, with derivatives by the unknowns, (n, C, unknowns)."""
        if not self.limited:
            return Constrained(np.empty((len(unknowns), 0)), np.empty((len(unknowns), 0, self.unknowns)), _NONE, [])
        shape, size = self.chart.shape(unknowns[:, : self.size]), self.size
        found = self.constraints(self.placed(unknowns, branch, shape.lengths))
        by_lengths = shape.jacobian.shape[1]
        slopes = np.empty((*found.slopes.shape[:2], self.unknowns))
        slopes[:, :, :size] = found.slopes[:, :, :by_lengths] @ shape.jacobian
        slopes[:, :, size] = found.slopes[:, :, by_lengths] + found.slopes[:, :, by_lengths + 1]
        if self.unknowns > size + 1:
            slopes[:, :, size + 1 :] = found.slopes[:, :, by_lengths + 2 :]
        if not np.isfinite(found.values).all():  # where a linkage does not close
            found = found._replace(values=np.nan_to_num(found.values, nan=-1.0))
            slopes = np.nan_to_num(slopes)
        return found._replace(slopes=slopes)

    def stepped(self, unknowns: Floats, step: Floats) -> Floats:
        """Unknowns after a step, each component cut by itself and kept within the chart's bounds."""
        out, size = np.empty_like(unknowns), self.size
        out[:, :size] = self.chart.stepped(unknowns[:, :size], step[:, :size])
        out[:, size:] = unknowns[:, size:] + np.minimum(np.maximum(step[:, size:], -self.longest), self.longest)
        return out

    def held(self, unknowns: Floats, gradient: Floats) -> Flags:
        """Which unknowns stand at a bound that descent would push them through."""
        out = np.zeros(unknowns.shape, dtype=bool)
        out[:, : self.size] = self.chart.held(unknowns[:, : self.size], gradient[:, : self.size])
        return out

    def hopped(self, unknowns: Floats, random: np.random.Generator, width: float) -> Floats:
        """Perturbed unknowns; heavy tails reach far."""
        noise = random.standard_t(3, size=(len(unknowns), self.size + 1)) * self.chart.hop * width
        out = unknowns.copy()
        out[:, : self.size] = self.chart.hopped(unknowns[:, : self.size], noise[:, : self.size])
        out[:, self.size] += noise[:, self.size]
        return out

    def linkages(self, mechanism: Mechanism, unknowns: Floats, branch: Floats, target: Target) -> list[Any]:
        """The linkages that candidates are."""
        lengths = self.chart.shape(unknowns[:, : self.size]).lengths
        return mechanism.mounted(target, lengths, branch, unknowns[:, self.size])


class PosedProblem(ShapeProblem):
    """Shape, start and pose, with constraints on all; see the module's head."""

    def __init__(self, target: Target, chart: BoundedChart, constraints: Constraints) -> None:
        super().__init__(target, chart, constraints)
        assert target.position is not None
        self.body = chart.prepared(target)
        self.middle = target.position_mean(target.position)
        self.scaled = (target.position - self.middle) / target.length_scale
        self.turned = np.exp(1j * target.crank)
        self.rows = (2 if target.rotation is None else 3) * target.samples
        self.unknowns = self.size + 6
        self.longest = np.array(
            [_LONGEST_TURN, _LONGEST_WAY, _LONGEST_WAY, _LONGEST_TURN, _LONGEST_WAY, _LONGEST_WAY]
        )

    def pose(self, unknowns: Floats) -> Poses:
        """The pose of candidates."""
        ax, ay, turned, zx, zy = unknowns[:, self.size + 1 :].T
        return Poses(ax + 1j * ay, turned, zx + 1j * zy)

    def posed(self, shape: Floats, start: Floats, pose: Poses) -> Floats:
        """Unknowns of shapes in poses."""
        pivot, turned, coupler = pose
        columns = [start, pivot.real, pivot.imag, turned, coupler.real, coupler.imag]
        return np.hstack([shape, np.stack(columns, axis=1)])

    def evaluate(self, unknowns: Floats, branch: Floats) -> Evaluation:
        """Residuals and derivatives."""
        size, target = self.size, self.target
        found = self.body(unknowns[:, : size + 1], branch)
        assert found.slope is not None and target.position is not None
        shape = self.chart.shape(unknowns[:, :size])
        pivot, turned, coupler = self.pose(unknowns)
        pin = (shape.lengths[:, 0] * np.exp(1j * (unknowns[:, size] + turned)))[:, None] * self.turned
        arm = coupler[:, None] * found.phasor
        positions = 2 * target.samples
        stack = np.empty((len(unknowns), self.unknowns + 1, self.rows))
        columns = stack[:, :, :positions].view(complex)  # real and imaginary parts in turn
        np.multiply((-1j * arm)[:, None, :], found.slope, out=columns[:, : size + 1])
        columns[:, :size] -= (shape.jacobian[:, 0] / shape.lengths[:, :1])[:, :, None] * pin[:, None, :]
        turn = 1j * pin
        columns[:, size] -= turn
        columns[:, size + 1], columns[:, size + 2] = -1.0, -1j
        np.negative(turn, out=columns[:, size + 3])
        np.negative(found.phasor, out=columns[:, size + 4])
        np.multiply(-1j, found.phasor, out=columns[:, size + 5])
        columns[:, size + 6] = self.scaled - pivot[:, None] - pin - arm
        columns *= target.position_mean.root
        if target.rotation is not None:
            mean, turn = target.rotation_mean, stack[:, :, positions:]
            turn[:, size + 1 : -1] = 0.0
            np.negative(found.slope, out=turn[:, : size + 1])
            np.subtract(target.rotation, found.angle, out=turn[:, -1])
            turn -= mean.weighted(turn).sum(axis=2, keepdims=True) / mean.total
            turn *= mean.root
        cost = np.einsum("nm,nm->n", stack[:, -1], stack[:, -1])
        possible = np.isfinite(cost) if found.possible is True else found.possible & np.isfinite(cost)
        return Evaluation(np.where(possible, cost, np.inf), stack)

    def placed(self, unknowns: Floats, branch: Floats, lengths: Floats) -> Placed:
        """Candidates as the limits see them."""
        return super().placed(unknowns, branch, lengths)._replace(**self.pose(unknowns)._asdict())

    def hopped(self, unknowns: Floats, random: np.random.Generator, width: float) -> Floats:
        """Perturbed unknowns."""
        out = super().hopped(unknowns, random, width)
        count = len(unknowns)
        for k, size in ((1, 0.3), (2, 0.3), (4, 0.2), (5, 0.2)):
            out[:, self.size + k] += width * size * random.standard_normal(count)
        out[:, self.size + 3] += width * 0.3 * random.standard_t(3, size=count)
        return out

    def linkages(self, mechanism: Mechanism, unknowns: Floats, branch: Floats, target: Target) -> list[Any]:
        """The linkages that candidates are, in their pose."""
        scale, (pivot, turned, coupler) = target.length_scale, self.pose(unknowns)
        lengths = self.chart.shape(unknowns[:, : self.size]).lengths * scale
        pose = self.middle + scale * pivot, turned, scale * coupler
        return mechanism.posed(lengths, branch, unknowns[:, self.size], pose)


def problem_of(target: Target, way: Bounded) -> ShapeProblem:
    """The problem of a target within limits: with the pose where they concern it."""
    kind = ShapeProblem if way.boxes is None else PosedProblem
    return kind(target, way.chart, way.constraints)
