"""Residuals of candidates with a crank angle at every sample, their derivatives, and the best pose for given angles."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.free.poses import Poses
from synthesis.mechanism import BodyAngles, BoundedChart, Chart
from synthesis.target import TURN

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

_SHAPE_STEP, _ANGLE_STEP = 1.0, 0.6
"""Longest step of an unknown of the chart, and of a crank angle where there is no order."""
_GAP_SHARE = 0.8
"""Part by which a gap between neighbouring crank angles may shrink in a step, so that the order holds at every step."""
_TIED = 1e-12
"""A gap below this shrinks no more: sums of angles would round it away."""


class Timed(NamedTuple):
    """Candidates with a crank angle at every sample."""

    shape: Floats
    """(n, k) in the chart."""
    pose: Complexes
    """(n, 3): A, z1, z2 over the length scale, positions from their mean; zero without positions."""
    offset: Floats
    """(n,)"""
    angles: Floats
    """(n, N): theta1, continuous along the samples."""
    branch: Floats
    """(n,)"""

    def take(self, places: Any) -> Timed:
        """Some of them."""
        return Timed(*(column[places] for column in self))

    def joined(self, *others: Timed) -> Timed:
        """These and others after them."""
        return Timed(*(np.concatenate(columns) for columns in zip(self, *others)))


class Rows(NamedTuple):
    """Residuals of candidates and their derivatives."""

    cost: Floats
    """(n,): J squared; infinite where a candidate does not close."""
    stack: Floats
    """(n, m + 1, R, N): derivatives by shape, pose and offset, then the residual; R rows a sample."""
    turn: Floats
    """(n, R, N): derivative by the sample's own crank angle."""


class Refined(NamedTuple):
    """Candidates after their descent."""

    timed: Timed
    cost: Floats

    def take(self, places: Any) -> Refined:
        """Some of them."""
        return Refined(self.timed.take(places), self.cost[places])

    def joined(self, *others: Refined) -> Refined:
        """These and others after them."""
        cost = np.concatenate([self.cost, *(other.cost for other in others)])
        return Refined(self.timed.joined(*(other.timed for other in others)), cost)


class Turned(NamedTuple):
    """Crank and body of candidates at their angles."""

    crank: Complexes
    """(n, N): e^{i phi}"""
    body: BodyAngles


def phasor(angle: Floats) -> Complexes:
    """e^{i angle}; several times faster than the exponential of complex numbers."""
    out = np.empty(angle.shape, dtype=complex)
    np.cos(angle, out=out.real)
    np.sin(angle, out=out.imag)
    return out


class JointProblem:
    """Poses and a chart made ready for many evaluations.

    Parameters
    ----------
    poses : Poses
    chart : Chart
    """

    def __init__(self, poses: Poses, chart: Chart) -> None:
        self.poses, self.chart = poses, chart
        self.bounded = chart if isinstance(chart, BoundedChart) else None
        self.size = len(chart.cell) - 1
        self.has_rotation, self.has_position = poses.rotation is not None, poses.position is not None
        self.rotation, self.position = poses.rotation, poses.scaled
        samples = poses.samples
        self.rotation_root = np.broadcast_to(poses.rotation_mean.root, samples)
        self.position_root = np.broadcast_to(poses.position_mean.root, samples)
        self.position_share = self.position_root**2 + 0j
        self.rows = self.has_rotation + 2 * self.has_position
        self.columns = self.size + 6 * self.has_position + self.has_rotation

    # -- pose -------------------------------------------------------------------------------------------------------

    def posed(self, timed: Timed, turned: Turned) -> Timed:
        """The candidates with the best pose and offset for their angles."""
        pose, offset = timed.pose, timed.offset
        if self.has_position:
            pose = self._best_pose(turned.crank, turned.body.phasor)
        if self.has_rotation:
            gap = self._gap(timed, turned.body)
            offset = timed.offset + self.poses.rotation_mean(gap)
        return timed._replace(pose=pose, offset=offset)

    def facing(self, timed: Timed) -> Timed:
        """Candidates of unknown offset with one that is right to within their own error, from the mean direction of the gaps."""
        if self.rotation is None:
            return timed
        angle = self.turned(timed, derivatives=False).body.angle
        return timed._replace(offset=np.angle(self.poses.rotation_mean(np.exp(1j * (self.rotation - angle)))))

    def _best_pose(self, e1: Complexes, e2: Complexes) -> Complexes:
        """A, z1, z2 of the least mean square, by Gram and Schmidt twice over {1, e1, e2}: never by normal equations."""
        weight = self.position_share

        def share(column: Complexes, values: Complexes) -> Complexes:
            return ((np.conj(column) * values) @ weight)[:, None]

        def unit(own: Complexes) -> tuple[Complexes, Floats]:
            norm = np.sqrt((own.real**2 + own.imag**2) @ weight.real)[:, None]
            norm = np.where(norm > 1e-15, norm, 1.0)
            return own / norm, norm

        mean1, mean2 = (e1 @ weight)[:, None], (e2 @ weight)[:, None]
        own = e1 - mean1
        again = (own @ weight)[:, None]
        mean1 = mean1 + again
        first, norm1 = unit(own - again)
        own = e2 - mean2
        along = share(first, own)
        own = own - along * first
        mean_again, along_again = (own @ weight)[:, None], share(first, own)
        second, norm2 = unit(own - mean_again - along_again * first)
        # the positions have no mean; what a second pass over them would add is below the rounding of their residual
        right1 = share(first, self.position)
        right2 = share(second, self.position - right1 * first)
        z2 = right2 / norm2
        z1 = (right1 - (along + along_again) * z2) / norm1
        return np.concatenate([-mean1 * z1 - (mean2 + mean_again) * z2, z1, z2], axis=1)

    def _gap(self, timed: Timed, body: BodyAngles) -> Floats:
        """gamma - offset - theta2 within half a turn, (n, N)."""
        assert self.rotation is not None
        gap = self.rotation - timed.offset[:, None] - body.angle
        return gap - TURN * np.round(gap / TURN)

    # -- rows -------------------------------------------------------------------------------------------------------

    def turned(self, timed: Timed, derivatives: bool = True) -> Turned:
        """Crank and body of candidates at their angles."""
        return Turned(phasor(timed.angles), self.chart.at(timed.shape, timed.angles, timed.branch, derivatives))

    def residual(self, timed: Timed, turned: Turned) -> Floats:
        """Residuals (n, R, N)."""
        count, samples = timed.angles.shape
        out = np.empty((count, self.rows, samples))
        if self.has_rotation:
            np.multiply(self._gap(timed, turned.body), self.rotation_root, out=out[:, 0])
        if self.has_position:
            a, z1, z2 = timed.pose.T[:, :, None]
            left = self.position - a
            left -= z1 * turned.crank
            left -= z2 * turned.body.phasor
            np.multiply(left.real, self.position_root, out=out[:, -2])
            np.multiply(left.imag, self.position_root, out=out[:, -1])
        return out

    def cost(self, residual: Floats, body: BodyAngles) -> Floats:
        """J squared, infinite where a candidate does not close."""
        flat = residual.reshape(len(residual), self.rows * self.poses.samples)
        cost = np.einsum("nk,nk->n", flat, flat)
        cost = cost if body.possible is True else np.where(body.possible, cost, np.inf)
        return np.where(np.isfinite(cost), cost, np.inf)

    def plain_cost(self, timed: Timed) -> Floats:
        """J squared of candidates as they are, (n,)."""
        turned = self.turned(timed, derivatives=False)
        return JointProblem.cost(self, JointProblem.residual(self, timed, turned), turned.body)

    def evaluate(self, timed: Timed, turned: Turned) -> Rows:
        """Rows and derivatives of candidates whose body angles carry their derivatives; what a bound holds has none."""
        return self.within_bounds(timed, self.derivatives(timed, turned))

    def within_bounds(self, timed: Timed, rows: Rows) -> Rows:
        """The rows without derivatives by unknowns that a bound of the chart holds."""
        if self.bounded is not None:
            stack, size = rows.stack, self.size
            flat = stack.reshape(*stack.shape[:2], -1)
            held = self.bounded.held(timed.shape, (flat[:, :size] @ flat[:, -1, :, None])[:, :, 0])
            stack[:, :size][held] = 0.0
        return rows

    def derivatives(self, timed: Timed, turned: Turned) -> Rows:
        """Rows and all of their derivatives."""
        count, samples = timed.angles.shape
        slope = turned.body.slope
        assert slope is not None
        size = self.size
        residual = self.residual(timed, turned)
        stack = np.zeros((count, self.columns + 1, self.rows, samples))
        turn = np.empty((count, self.rows, samples))
        stack[:, -1] = residual
        if self.has_rotation:
            root = self.rotation_root
            np.multiply(slope[:, :size], -root, out=stack[:, :size, 0])
            stack[:, self.columns - 1, 0] = -root
            np.multiply(slope[:, size], -root, out=turn[:, 0])
        if self.has_position:
            root = self.position_root
            z1, z2 = timed.pose.T[1:, :, None]
            e1, e2 = -root * turned.crank, -root * turned.body.phasor
            lever = 1j * z2 * e2
            real, imag = stack[:, :, -2], stack[:, :, -1]
            np.multiply(slope[:, :size], lever.real[:, None], out=real[:, :size])
            np.multiply(slope[:, :size], lever.imag[:, None], out=imag[:, :size])
            real[:, size], imag[:, size + 1] = -root, -root
            for at, column in ((size + 2, e1), (size + 4, e2)):
                real[:, at], imag[:, at] = column.real, column.imag
                np.negative(column.imag, out=real[:, at + 1])
                imag[:, at + 1] = column.real
            by_angle = lever * slope[:, size] + 1j * z1 * e1
            turn[:, -2], turn[:, -1] = by_angle.real, by_angle.imag
        return Rows(self.cost(residual, turned.body), stack, turn)

    # -- steps ------------------------------------------------------------------------------------------------------

    def moved(self, timed: Timed, step: Floats, turn: Floats) -> Timed:
        """Candidates after a step of the common unknowns (n, m) and of the angles (n, N), each unknown and gap cut by itself."""
        size = self.size
        pose, offset = timed.pose, timed.offset
        if self.has_position:
            pose = pose + step[:, size : size + 6 : 2] + 1j * step[:, size + 1 : size + 6 : 2]
        if self.has_rotation:
            offset = offset + step[:, -1]
        if self.bounded is None:
            shape = timed.shape + np.clip(step[:, :size], -_SHAPE_STEP, _SHAPE_STEP)
        else:
            shape = self.bounded.stepped(timed.shape, step[:, :size])
        if self.poses.ordered:
            turn = _within_gaps(timed.angles, turn, self.poses.span_max)
        else:
            turn = np.clip(turn, -_ANGLE_STEP, _ANGLE_STEP)
        return Timed(shape, pose, offset, timed.angles + turn, timed.branch)


def _within_gaps(angles: Floats, turn: Floats, span_max: float) -> Floats:
    """Steps of crank angles, cut so that the samples keep their order and the crank stays within its span.

    The gaps between neighbours are cut, not the angles: a turn that all of them make together changes no order, and long
    valleys run that way.
    """
    way = np.where(angles[:, -1:] >= angles[:, :1], 1.0, -1.0)
    gaps = way * np.diff(angles, axis=1)
    span = gaps.sum(axis=1, keepdims=True)
    new = np.maximum(gaps + way * np.diff(turn, axis=1), (1 - _GAP_SHARE) * gaps)
    room = span_max - _TIED * gaps.shape[1] - span
    longest = span + np.where(room > 0, _GAP_SHARE * room, room)
    new *= np.minimum(1.0, longest / np.maximum(new.sum(axis=1, keepdims=True), 1e-300))
    new = np.maximum(new, np.minimum(gaps, _TIED))
    cut = np.zeros_like(turn)
    np.cumsum(way * (new - gaps), axis=1, out=cut[:, 1:])
    return cut + np.clip((turn - cut).mean(axis=1, keepdims=True), -np.pi, np.pi)
