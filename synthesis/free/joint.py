"""Refinement where the crank angle of every sample is unknown, beside shape and pose: many candidates at once.

Unknowns of a candidate are its shape x in a chart, A, z1, z2 (complex, over the length scale), the rotation's offset, and
one crank angle phi_i a sample. With e1 = e^{i phi}, e2 = e^{i theta2(x, phi)}, a sample's rows are::

    sqrt(w_r) wrap(gamma - offset - theta2),      sqrt(w_p) (P - A - z1 e1 - z2 e2)

phi_i stands in the rows of its own sample only, so it is eliminated there before the step is computed. With t_i the rows'
derivative by phi_i, d_i its damping and n_i = t_i . t_i + d_i, the rows G of the other unknowns, and the residual, become::

    G - c_i t_i (t_i . G),      c_i = 1 / (n_i (1 + sqrt(d_i / n_i)))

whose normal matrix is the Schur complement of the full one, so that the step still comes from a QR decomposition. At
d_i = 0 that is the fit by orthogonal distances, with a large d_i the fit at given crank angles. A, z1, z2 and the offset are
solved again after every step (variable projection in Kaufman's form: BIT 15 (1975) 49-57), and the steps are bent along the
residual's curvature (Transtrum and Sethna, arXiv:1201.5885).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.free.poses import Poses
from synthesis.mechanism import BodyAngles, Chart
from synthesis.target import TURN
from synthesis.work import Work

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

_SHAPE_STEP, _ANGLE_STEP = 1.0, 0.6
"""Longest step of an unknown of the chart, and of a crank angle."""
_GAP_SHARE = 0.45
"""Part of the gap to its neighbour by which a crank angle may move in a step, so that the order holds at every step."""
_LINEAR_DAMPING, _ANGLE_DAMPING = 1e-2, 1e-2
"""Damping of the linear unknowns and of the crank angles relative to that of the shape."""
_LEAST_DAMPING = 1e-22


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
    """(n, N, R, m + 1): derivatives by shape, pose and offset, then the residual; R rows a sample."""
    turn: Floats
    """(n, N, R): derivative by the sample's own crank angle."""


class Refined(NamedTuple):
    """Candidates after their descent."""

    timed: Timed
    cost: Floats


class JointProblem:
    """Poses and a chart made ready for many evaluations.

    Parameters
    ----------
    poses : Poses
    chart : Chart
    """

    def __init__(self, poses: Poses, chart: Chart) -> None:
        self.poses, self.chart = poses, chart
        self.size = len(chart.cell) - 1
        self.has_rotation, self.has_position = poses.rotation is not None, poses.position is not None
        self.rotation, self.position = poses.rotation, poses.scaled
        samples = poses.samples
        self.rotation_root = np.broadcast_to(poses.rotation_mean.root, samples)
        self.position_root = np.broadcast_to(poses.position_mean.root, samples)
        self.rows = self.has_rotation + 2 * self.has_position
        self.columns = self.size + 6 * self.has_position + self.has_rotation

    # -- pose -------------------------------------------------------------------------------------------------------

    def posed(self, timed: Timed, body: BodyAngles) -> Timed:
        """The candidates with the best pose and offset for their angles."""
        pose, offset = timed.pose, timed.offset
        if self.has_position:
            pose = self._best_pose(np.exp(1j * timed.angles), body.phasor)
        if self.has_rotation:
            gap = self._turned(timed, body)
            offset = timed.offset + self.poses.rotation_mean(gap)
        return timed._replace(pose=pose, offset=offset)

    def _best_pose(self, e1: Complexes, e2: Complexes) -> Complexes:
        """A, z1, z2 of the least mean square, by Gram and Schmidt twice over {1, e1, e2}: never by normal equations."""
        weight = self.position_root**2

        def share(column: Complexes, values: Complexes) -> Complexes:
            return ((np.conj(column) * values) @ weight)[:, None]

        one = np.ones_like(e1)
        basis, upper = [one], np.zeros((len(e1), 3, 3), dtype=complex)
        upper[:, 0, 0] = 1.0
        for place, own in ((1, e1), (2, e2)):
            for _ in range(2):
                for k, column in enumerate(basis):
                    part = share(column, own)
                    own = own - part * column
                    upper[:, k, place] += part[:, 0]
            norm = np.sqrt(share(own, own).real)
            norm = np.where(norm > 1e-15, norm, 1.0)
            basis.append(own / norm)
            upper[:, place, place] = norm[:, 0]
        rest, right = np.broadcast_to(self.position, e1.shape), np.zeros((len(e1), 3), dtype=complex)
        for _ in range(2):
            for k, column in enumerate(basis):
                part = share(column, rest)
                rest = rest - part * column
                right[:, k] += part[:, 0]
        z2 = right[:, 2] / upper[:, 2, 2]
        z1 = (right[:, 1] - upper[:, 1, 2] * z2) / upper[:, 1, 1]
        pivot = right[:, 0] - upper[:, 0, 1] * z1 - upper[:, 0, 2] * z2
        return np.stack([pivot, z1, z2], axis=1)

    def _turned(self, timed: Timed, body: BodyAngles) -> Floats:
        """gamma - offset - theta2 within half a turn, (n, N)."""
        assert self.rotation is not None
        gap: Floats = self.rotation - timed.offset[:, None] - body.angle
        return gap - TURN * np.round(gap / TURN)

    # -- rows -------------------------------------------------------------------------------------------------------

    def body(self, timed: Timed, derivatives: bool = True) -> BodyAngles:
        """theta2 of candidates at their angles."""
        return self.chart.at(timed.shape, timed.angles, timed.branch, derivatives)

    def residual(self, timed: Timed, body: BodyAngles) -> Floats:
        """Residuals (n, N, R)."""
        out = np.empty((*timed.angles.shape, self.rows))
        if self.has_rotation:
            np.multiply(self._turned(timed, body), self.rotation_root, out=out[:, :, 0])
        if self.has_position:
            a, z1, z2 = timed.pose.T[:, :, None]
            left = (self.position - a - z1 * np.exp(1j * timed.angles) - z2 * body.phasor) * self.position_root
            out[:, :, -2], out[:, :, -1] = left.real, left.imag
        return out

    def cost(self, residual: Floats, body: BodyAngles) -> Floats:
        """J squared, infinite where a candidate does not close."""
        cost = np.einsum("nkr,nkr->n", residual, residual)
        cost = cost if body.possible is True else np.where(body.possible, cost, np.inf)
        return np.where(np.isfinite(cost), cost, np.inf)

    def evaluate(self, timed: Timed, body: BodyAngles) -> Rows:
        """Rows and derivatives of candidates whose body angles carry their derivatives."""
        count, samples = timed.angles.shape
        assert body.slope is not None
        size, slope = self.size, body.slope.transpose(0, 2, 1)
        residual = self.residual(timed, body)
        stack = np.zeros((count, samples, self.rows, self.columns + 1))
        turn = np.empty((count, samples, self.rows))
        stack[..., -1] = residual
        if self.has_rotation:
            root = self.rotation_root
            stack[:, :, 0, :size] = -root[:, None] * slope[:, :, :size]
            stack[:, :, 0, self.columns - 1] = -root
            turn[:, :, 0] = -root * slope[:, :, size]
        if self.has_position:
            root = self.position_root
            z1, z2 = timed.pose.T[1:, :, None]
            e1, e2 = root * np.exp(1j * timed.angles), root * body.phasor
            lever = -1j * z2 * e2
            by_shape = lever[:, :, None] * slope[:, :, :size]
            real, imag = stack[:, :, -2], stack[:, :, -1]
            real[..., :size], imag[..., :size] = by_shape.real, by_shape.imag
            real[..., size], imag[..., size + 1] = -root, -root
            for at, column in ((size + 2, e1), (size + 4, e2)):
                real[..., at], imag[..., at] = -column.real, -column.imag
                real[..., at + 1], imag[..., at + 1] = column.imag, -column.real
            by_angle = lever * slope[:, :, size] - 1j * z1 * e1
            turn[:, :, -2], turn[:, :, -1] = by_angle.real, by_angle.imag
        return Rows(self.cost(residual, body), stack, turn)

    # -- steps ------------------------------------------------------------------------------------------------------

    def moved(self, timed: Timed, step: Floats, turn: Floats) -> Timed:
        """Candidates after a step of the common unknowns (n, m) and of the angles (n, N), each cut by itself."""
        size = self.size
        pose, offset = timed.pose, timed.offset
        if self.has_position:
            pose = pose + step[:, size : size + 6 : 2] + 1j * step[:, size + 1 : size + 6 : 2]
        if self.has_rotation:
            offset = offset + step[:, -1]
        shape = timed.shape + np.clip(step[:, :size], -_SHAPE_STEP, _SHAPE_STEP)
        turn = np.clip(turn, -_ANGLE_STEP, _ANGLE_STEP)
        if self.poses.ordered:
            turn = _within_gaps(timed.angles, turn, self.poses.span_max)
        return Timed(shape, pose, offset, timed.angles + turn, timed.branch)


def _within_gaps(angles: Floats, turn: Floats, span_max: float) -> Floats:
    """Steps of crank angles, cut so that the samples keep their order and the crank stays within its span."""
    way = np.where(angles[:, -1:] >= angles[:, :1], 1.0, -1.0)
    along = way * angles
    gaps = np.empty((len(angles), angles.shape[1] + 1))
    gaps[:, 1:-1] = np.diff(along)
    gaps[:, 0] = gaps[:, -1] = span_max - (along[:, -1] - along[:, 0])
    gaps = _GAP_SHARE * np.maximum(gaps, 0.0)
    return way * np.clip(way * turn, -gaps[:, :-1], gaps[:, 1:])


class _System(NamedTuple):
    """The damped system of one step."""

    stack: Floats
    turn: Floats
    reduced: Floats
    shrink: Floats
    inner: Floats
    norms: Floats
    small: Floats


def refine(
    problem: JointProblem,
    timed: Timed,
    iterations: int,
    tolerance: float = 0.0,
    work: Work | None = None,
    damping: float = 1e-3,
    stall: float = 1e-9,
    all_of_them: bool = False,
) -> Refined:
    """Levenberg-Marquardt over shape, pose and all crank angles of many candidates.

    Parameters
    ----------
    problem : JointProblem
    timed : Timed
        Starting points; where the order is required their angles have it.
    iterations : int
    tolerance : float
        Stop when the least J is below it.
    work : Work, optional
        Once it has expired the descent stops where it is.
    damping : float
        Of the first step, relative to the squares of the derivatives.
    stall : float
        A step that lowers the cost by a smaller part than this is a candidate's last one.
    all_of_them : bool
        Stop only when J of every candidate is below the tolerance.

    Returns
    -------
    Refined
        Law: no candidate is worse than its starting point with its best pose; the order of the angles is kept.
    """
    work = work or Work()
    body = problem.body(timed)
    timed = problem.posed(timed, body)
    rows = problem.evaluate(timed, body)
    cost, stack, turn = rows
    damped, growth = np.full(len(cost), damping), np.full(len(cost), 2.0)
    done = max(1e-30, tolerance**2 if all_of_them else 0.0)
    active = np.flatnonzero(np.isfinite(cost) & (cost >= done))
    for _ in range(iterations):
        if not active.size or work.expired() or (not all_of_them and cost.min() <= tolerance**2):
            break
        here = timed.take(active)
        system = _damped(stack[active], turn[active], damped[active], problem.size)
        step, angle_step = _step(system)
        bend, angle_bend = _bend(problem, here, system, step, angle_step)
        trial = problem.moved(here, step + bend, angle_step + angle_bend)
        body = problem.body(trial)
        trial = problem.posed(trial, body)
        new = problem.evaluate(trial, body)
        before = cost[active]
        decrease = before - new.cost
        better = decrease > 0
        took, refused = active[better], active[~better]
        for column, values in zip(timed, trial):
            column[took] = values[better]
        cost[took], stack[took], turn[took] = new.cost[better], new.stack[better], new.turn[better]
        moved = np.einsum("nkrc,nc->nkr", system.reduced[..., :-1], step)
        predicted = -np.einsum("nkr,nkr->n", moved, moved + 2 * system.reduced[..., -1])
        gain = np.clip(decrease[better] / np.maximum(predicted[better], 1e-300), 0, 1)
        damped[took] = np.maximum(damped[took] * np.maximum(0.1, 1 - (2 * gain - 1) ** 3), _LEAST_DAMPING)
        growth[took] = 2.0
        damped[refused] *= growth[refused]
        growth[refused] *= 2
        finished = (better & (decrease < stall * before)) | (damped[active] > 1e10) | (cost[active] < done)
        active = active[~finished]
    return Refined(timed, cost)


def _damped(stack: Floats, turn: Floats, damping: Floats, size: int) -> _System:
    """The system of a step: angles eliminated, and R of the damped rest."""
    square = np.einsum("nkr,nkr->nk", turn, turn)
    average = square.mean(axis=1, keepdims=True)
    own = _ANGLE_DAMPING * damping[:, None] * np.maximum(square, 1e-6 * average) + 1e-20 * average
    inner = square + own
    inner = np.where(inner > 0, inner, 1.0)
    shrink = 1 / (inner * (1 + np.sqrt(own / inner)))
    reduced = stack - (shrink[:, :, None] * turn)[..., None] * np.einsum("nkr,nkrc->nkc", turn, stack)[:, :, None, :]
    count, columns = len(stack), stack.shape[-1] - 1
    flat = reduced.reshape(count, -1, columns + 1)
    norms = np.sqrt(np.einsum("nmc,nmc->nc", flat[..., :-1], flat[..., :-1]))
    norms = np.where(norms > 0, norms, 1.0)
    part = np.full(columns, _LINEAR_DAMPING)
    part[:size] = 1.0
    system = np.zeros((count, flat.shape[1] + columns, columns + 1))
    system[:, : flat.shape[1]] = flat
    diagonal = np.arange(columns)
    system[:, flat.shape[1] + diagonal, diagonal] = np.sqrt(damping[:, None] * part) * norms
    small: Any = np.linalg.qr(system, mode="r")
    return _System(stack, turn, reduced, shrink, inner, norms, small)


def _step(system: _System) -> tuple[Floats, Floats]:
    """The step of the common unknowns (n, m) and of the angles (n, N)."""
    columns = system.stack.shape[-1] - 1
    step = -_upper_solve(system.small[:, :columns, :columns], system.small[:, :columns, columns])
    return step, _back(system, step, system.stack[..., -1])


def _back(system: _System, step: Floats, residual: Floats) -> Floats:
    """The angles' part of a step, from the common unknowns' part."""
    left = residual + np.einsum("nkrc,nc->nkr", system.stack[..., :-1], step)
    along: Floats = np.einsum("nkr,nkr->nk", system.turn, left)
    return -along / system.inner


def _upper_solve(upper: Floats, right: Floats) -> Floats:
    """Solutions of triangular systems; zero where one is singular."""
    diagonal = np.abs(np.diagonal(upper, axis1=1, axis2=2))
    bad = ~np.all(diagonal > 1e-200, axis=1) | ~np.all(np.isfinite(right), axis=1)
    if bad.any():
        upper, right = upper.copy(), right.copy()
        upper[bad], right[bad] = np.eye(upper.shape[1]), 0.0
    return np.linalg.solve(upper, right[:, :, None])[:, :, 0]


def _bend(
    problem: JointProblem, here: Timed, system: _System, step: Floats, angle_step: Floats
) -> tuple[Floats, Floats]:
    """Second-order correction of a step along itself, from one more residual; zero where it is not small beside the step."""
    columns = step.shape[1]
    longest = np.sqrt(np.sum(step**2, axis=1) + np.sum(angle_step**2, axis=1))
    ahead = np.minimum(0.1, 0.01 / np.maximum(longest, 1e-300))[:, None]
    size, pose = problem.size, here.pose
    if problem.has_position:
        pose = pose + ahead * (step[:, size : size + 6 : 2] + 1j * step[:, size + 1 : size + 6 : 2])
    there = Timed(
        here.shape + ahead * step[:, :size],
        pose,
        here.offset + ahead[:, 0] * step[:, -1] * problem.has_rotation,
        here.angles + ahead * angle_step,
        here.branch,
    )
    residual = problem.residual(there, problem.body(there, derivatives=False))
    straight = np.einsum("nkrc,nc->nkr", system.stack[..., :-1], step) + system.turn * angle_step[:, :, None]
    bent = (residual - system.stack[..., -1]) / ahead[:, :, None] - straight
    bent *= (1.0 / ahead)[:, :, None]  # half the second derivative along the step
    own = np.einsum("nkr,nkr->nk", system.turn, bent)
    reduced = bent - (system.shrink * own)[:, :, None] * system.turn
    small = system.small[:, :columns, :columns]
    right = np.einsum("nkrc,nkr->nc", system.reduced[..., :-1], reduced)
    bend = -_upper_solve(small, _upper_solve(small.transpose(0, 2, 1), right))
    angle_bend = _back(system, bend, bent)
    length = np.sqrt(np.sum(bend**2, axis=1) + np.sum(angle_bend**2, axis=1))
    keep = (2 * length < 1.5 * longest)[:, None]
    return np.where(keep, bend, 0.0), np.where(keep, angle_bend, 0.0)
