"""Refinement where the crank angle of every sample is unknown, beside shape and pose: many candidates at once.

Unknowns of a candidate are its shape x in a chart, A, z1, z2 (complex, over the length scale), the rotation's offset, and
one crank angle phi_i a sample. With e1 = e^{i phi}, e2 = e^{i theta2(x, phi)}, a sample's rows are::

    sqrt(w_r) wrap(gamma - offset - theta2),      sqrt(w_p) (P - A - z1 e1 - z2 e2)

phi_i stands in the rows of its own sample only, so it is eliminated there before the step is computed. With t_i the rows'
derivative by phi_i, d_i its damping and n_i = t_i . t_i + d_i, the rows G of the other unknowns, and the residual, become::

    G - c_i t_i (t_i . G),      c_i = 1 / (n_i (1 + sqrt(d_i / n_i)))

whose normal matrix is the Schur complement of the full one, so that the step still comes from a QR decomposition. At
d_i = 0 that is the fit by orthogonal distances, with a large d_i the fit at given crank angles. A, z1, z2 and the offset are
solved again after every step (variable projection in Kaufman's form: BIT 15 (1975) 49-57), the steps are bent along the
residual's curvature, and lead uphill too where they go straight on (Transtrum and Sethna, arXiv:1201.5885). While the damping
is large, the triangle of the QR decomposition comes from the normal matrix by Cholesky's method instead, which is faster.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.free.poses import Poses
from synthesis.least_squares import goes_on
from synthesis.mechanism import BodyAngles, BoundedChart, Chart
from synthesis.target import TURN
from synthesis.work import Work

# -- candidates, their rows and steps ------------------------------------------------------------------------------

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


# -- descents ------------------------------------------------------------------------------------------------------


_LINEAR_DAMPING, _ANGLE_DAMPING = 1e-2, 1e-2
"""Damping of the linear unknowns and of the crank angles relative to that of the shape."""
_LEAST_DAMPING = 1e-22
_LEAST_NORMAL = 1e-9
"""Damping from which on a step may come from normal equations: the condition of the damped, scaled matrix is below 1e11."""
_AT_ONCE = 1 << 19
"""Numbers of the rows that are eliminated together: 4 MB."""


def loose_steps(problem: JointProblem, timed: Timed, random: np.random.Generator, size: float) -> Timed:
    """Candidates moved mostly where their cost is flat: along valleys, where the next minimum lies.

    Steps are R^{-1} times normal noise, with R of the linearised problem, so that they are longest where the rows change
    least; each is scaled to change the shape by about ``size`` of itself.
    """
    turned = problem.turned(timed)
    timed = problem.posed(timed, turned)
    rows = problem.evaluate(timed, turned)
    count = len(rows.cost)
    system = _damped(rows, np.full(count, 1e-12), problem.size)
    columns = problem.columns
    # homogeneous unknowns have a direction in which nothing changes at all: a row of its own holds it
    scale = np.zeros((count, 1, columns))
    scale[:, 0, : problem.size] = np.sign(timed.shape)
    upper: Any = np.linalg.qr(np.concatenate([system.upper[:, :-1, :-1], scale], axis=1), mode="r")
    step = _upper_solve(upper, random.standard_normal((count, columns)))
    relative = np.max(np.abs(step[:, : problem.size]) / (np.abs(timed.shape) + 0.02), axis=1)
    factor = size * random.standard_t(3, size=count) / np.maximum(relative, 1e-300)
    step *= factor[:, None]
    return problem.moved(timed, step, _back(system, step, np.zeros_like(system.inner)))


class _System(NamedTuple):
    """The damped system of one step."""

    stack: Floats
    """(n, m + 1, R N)"""
    turn: Floats
    along: Floats
    """(n, m + 1, N): t_i . G_i, and t_i . r_i last."""
    inner: Floats
    """(n, N): n_i"""
    upper: Floats
    """(n, m + 1, m + 1): R of the damped system, without the angles."""
    ridge: Floats
    """(n, m): squares of the damping rows."""


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
        The best place of each candidate's way. Law: no candidate is worse than its starting point with its best pose; the
        order of the angles is kept.
    """
    work = work or Work()
    if not timed.branch.size:
        return Refined(timed, np.empty(0))
    timed = timed.take(np.arange(len(timed.branch)))  # a copy
    turned = problem.turned(timed)
    timed = problem.posed(timed, turned)
    cost, stack, turn = problem.evaluate(timed, turned)
    # the candidates still on their way, and where they stand among all
    place = np.flatnonzero(np.isfinite(cost))
    here, rows = timed.take(place), Rows(cost[place], stack[place], turn[place])
    damped, growth = np.full(place.size, damping), np.full(place.size, 2.0)
    way = np.zeros((place.size, problem.size))
    best = Refined(timed, cost)
    done_below = max(1e-30, tolerance**2 if all_of_them else 0.0)
    for _ in range(iterations):
        if not place.size or work.expired() or (not all_of_them and best.cost.min() <= tolerance**2):
            break
        system = _damped(rows, damped, problem.size)
        straight, angle_step = _step(system)
        q = system.upper[:, :-1, -1]
        predicted = np.einsum("nc,nc->n", q, q) + np.einsum("nc,nc->n", system.ridge, straight**2)
        step, angle_step = _bent(problem, here, system, straight, angle_step)
        trial = problem.moved(here, step, angle_step)
        turned = problem.turned(trial)
        trial = problem.posed(trial, turned)
        new = problem.evaluate(trial, turned)
        before = rows.cost
        decrease = before - new.cost
        better = decrease > 0
        # uphill is allowed the farther, the straighter the way goes on: a curved valley is followed above its floor
        ahead = straight[:, : problem.size]
        taken = better | goes_on(ahead, way, new.cost, best.cost[place])
        refused = ~taken
        finished = (better & (decrease < stall * before)) | (before < done_below)
        gain = np.clip(decrease / np.maximum(predicted, 1e-300), 0, 1)
        shrunk = np.maximum(damped * np.maximum(0.1, 1 - (2 * gain - 1) ** 3), _LEAST_DAMPING)
        damped = np.where(better, shrunk, np.where(taken, damped, damped * growth))
        growth = np.where(taken, 2.0, 2 * growth)
        for column, values in zip((*trial, *new), (*here, *rows)):
            column[refused] = values[refused]
        here, rows, way = trial, new, np.where(taken[:, None], ahead, way)
        finished |= damped > 1e10
        lower = rows.cost < best.cost[place]
        for column, values in zip((*best.timed, best.cost), (*here, rows.cost)):
            column[place[lower]] = values[lower]
        if finished.any():
            left = ~finished
            place, here, rows = place[left], here.take(left), Rows(*(column[left] for column in rows))
            damped, growth, way = damped[left], growth[left], way[left]
    return best


def _damped(rows: Rows, damping: Floats, size: int) -> _System:
    """The system of a step: angles eliminated, and R of the damped rest; of few candidates at a time where they are large."""
    few = max(1, _AT_ONCE // math.prod(rows.stack.shape[1:]))
    places = [slice(k, k + few) for k in range(0, max(1, len(rows.stack)), few)]
    coarse = damping > _LEAST_NORMAL  # then the squares are well conditioned, and faster
    try:
        parts = [_eliminated(rows, damping, size, coarse, some) for some in places]
    except np.linalg.LinAlgError:
        parts = [_eliminated(rows, damping, size, np.zeros_like(coarse), some) for some in places]
    return _System(
        rows.stack.reshape(*rows.stack.shape[:2], math.prod(rows.stack.shape[2:])),
        rows.turn,
        *(np.concatenate(columns) if len(parts) > 1 else columns[0] for columns in zip(*parts)),
    )


def _eliminated(
    rows: Rows, damping: Floats, size: int, coarse: NDArray[np.bool_], some: slice
) -> tuple[Floats, Floats, Floats, Floats]:
    """Of some candidates what `_System` has from ``along`` on."""
    stack, turn, damping, coarse = rows.stack[some], rows.turn[some], damping[some], coarse[some]
    count, columns = len(stack), stack.shape[1] - 1
    square = np.einsum("nrk,nrk->nk", turn, turn)
    average = square.mean(axis=1, keepdims=True)
    own = _ANGLE_DAMPING * damping[:, None] * np.maximum(square, 1e-6 * average) + 1e-20 * average
    inner = square + own
    inner = np.where(inner > 0, inner, 1.0)
    along = stack[:, :, 0] * turn[:, None, 0]
    for row in range(1, turn.shape[1]):
        along += stack[:, :, row] * turn[:, None, row]
    shrink = 1 / (inner * (1 + np.sqrt(own / inner)))
    reduced = stack - along[:, :, None] * (shrink[:, None] * turn)[:, None]
    reduced = reduced.reshape(count, columns + 1, math.prod(stack.shape[2:]))
    squares = np.einsum("ncm,ncm->nc", reduced[:, :-1], reduced[:, :-1])
    squares = np.where(squares > 0, squares, 1.0)
    part = np.full(columns, _LINEAR_DAMPING)
    part[:size] = 1.0
    ridge = damping[:, None] * part * squares
    upper = np.empty((count, columns + 1, columns + 1))
    if coarse.any():
        upper[coarse] = _by_cholesky(reduced[coarse], ridge[coarse], squares[coarse])
    fine = np.flatnonzero(~coarse)
    if fine.size:
        upper[fine] = _by_reflections(reduced[fine], ridge[fine])
    return along, inner, upper, ridge


def _by_cholesky(reduced: Floats, ridge: Floats, squares: Floats) -> Floats:
    """R of damped systems from their normal matrices, the columns scaled first."""
    count, columns = ridge.shape
    diagonal = np.arange(columns)
    scale = np.ones((count, columns + 1))
    scale[:, :-1] = np.sqrt(squares)
    last = np.sqrt(np.einsum("nm,nm->n", reduced[:, -1], reduced[:, -1]))
    scale[:, -1] = np.where(last > 0, last, 1.0)
    scaled = reduced / scale[:, :, None]
    normal = scaled @ scaled.transpose(0, 2, 1)
    normal[:, diagonal, diagonal] += ridge / squares
    normal[:, columns, columns] = 2.0  # the residual's own norm is not used: far enough from the others
    lower: Any = np.linalg.cholesky(normal)
    return lower.transpose(0, 2, 1) * scale[:, None, :]


def _by_reflections(reduced: Floats, ridge: Floats) -> Floats:
    """R of damped systems by QR decomposition."""
    count, columns = ridge.shape
    diagonal = np.arange(columns)
    system = np.zeros((count, reduced.shape[2] + columns, columns + 1))
    system[:, :-columns] = reduced.transpose(0, 2, 1)
    system[:, diagonal - columns, diagonal] = np.sqrt(ridge)
    small: Any = np.linalg.qr(system, mode="r")
    return small[:, : columns + 1]


def _step(system: _System) -> tuple[Floats, Floats]:
    """The step of the common unknowns (n, m) and of the angles (n, N)."""
    step = -_upper_solve(system.upper[:, :-1, :-1], system.upper[:, :-1, -1])
    return step, _back(system, step, system.along[:, -1])


def _back(system: _System, step: Floats, toward: Floats) -> Floats:
    """The angles' part of a step, from the common unknowns' part and t_i . r_i."""
    return -(toward + (step[:, None] @ system.along[:, :-1])[:, 0]) / system.inner


def _upper_solve(upper: Floats, right: Floats) -> Floats:
    """Solutions of upper triangular systems, by substitution over all at once; zero where one is singular."""
    out = np.empty_like(right)
    for k in reversed(range(right.shape[1])):
        rest = right[:, k]
        if k + 1 < right.shape[1]:
            rest = rest - np.einsum("nj,nj->n", upper[:, k, k + 1 :], out[:, k + 1 :])
        out[:, k] = rest / upper[:, k, k]
    return np.where(np.isfinite(out).all(axis=1, keepdims=True), out, 0.0)


def _lower_solve(upper: Floats, right: Floats) -> Floats:
    """Solutions of the transposed systems."""
    out = np.empty_like(right)
    for k in range(right.shape[1]):
        rest = right[:, k]
        if k:
            rest = rest - np.einsum("nj,nj->n", upper[:, :k, k], out[:, :k])
        out[:, k] = rest / upper[:, k, k]
    return out


def _bent(
    problem: JointProblem, here: Timed, system: _System, step: Floats, angle_step: Floats
) -> tuple[Floats, Floats]:
    """Steps with their second-order correction, from one more residual; unchanged where it is not small beside the step."""
    longest = np.sqrt(np.sum(step**2, axis=1) + np.sum(angle_step**2, axis=1))
    ahead = np.minimum(0.1, 0.01 / np.maximum(longest, 1e-300))[:, None]
    size, pose = problem.size, here.pose
    if problem.has_position:
        pose = pose + ahead * (step[:, size : size + 6 : 2] + 1j * step[:, size + 1 : size + 6 : 2])
    there = Timed(
        here.shape + ahead * step[:, :size],
        pose,
        here.offset + ahead[:, 0] * step[:, -1] * problem.has_rotation,
        here.angles + ahead * angle_step[:, : here.angles.shape[1]],
        here.branch,
    )
    residual = problem.residual(there, problem.turned(there, derivatives=False))
    flat, count = system.stack, len(step)
    straight = (step[:, None] @ flat[:, :-1]).reshape(residual.shape) + system.turn * angle_step[:, None]
    curve = (residual - flat[:, -1].reshape(residual.shape)) / ahead[:, :, None] - straight
    curve *= (1.0 / ahead)[:, :, None]  # half the second derivative along the step
    toward = np.einsum("nrk,nrk->nk", system.turn, curve)
    right = flat[:, :-1] @ curve.reshape(count, -1, 1) - system.along[:, :-1] @ (toward / system.inner)[:, :, None]
    upper = system.upper[:, :-1, :-1]
    with np.errstate(all="ignore"):
        bend = -_upper_solve(upper, _lower_solve(upper, right[:, :, 0]))
    angle_bend = _back(system, bend, toward)
    length = np.sqrt(np.sum(bend**2, axis=1) + np.sum(angle_bend**2, axis=1))
    keep = (2 * length < 1.5 * longest)[:, None]
    return step + np.where(keep, bend, 0.0), angle_step + np.where(keep, angle_bend, 0.0)


# -- what rounds hand on -------------------------------------------------------------------------------------------


class Pool(NamedTuple):
    """Candidates and their costs, J squared."""

    timed: Timed
    cost: Floats

    @classmethod
    def of(cls, refined: Refined) -> Pool:
        """The candidates of a descent."""
        return cls(refined.timed, refined.cost)

    @classmethod
    def measured(cls, problem: JointProblem, timed: Timed) -> Pool:
        """Candidates in their best pose, as they are."""
        turned = problem.turned(timed, derivatives=False)
        timed = problem.posed(timed, turned)
        return cls(timed, problem.cost(problem.residual(timed, turned), turned.body))

    def take(self, places: Any) -> Pool:
        """Some of the candidates."""
        return Pool(self.timed.take(places), self.cost[places])

    def joined(self, other: Pool) -> Pool:
        """These candidates and others after them."""
        return Pool(self.timed.joined(other.timed), np.concatenate([self.cost, other.cost]))

    @property
    def least(self) -> float:
        """The best J; infinite where there is no candidate."""
        return float(np.sqrt(self.cost.min())) if self.cost.size else np.inf

    def best(self, most: int, cell: float = 0.02) -> Pool:
        """The best candidates, best first, at most one a cell of shape and place; those that do not close left out."""
        timed = self.timed
        order = np.argsort(self.cost, kind="stable")
        order = order[np.isfinite(self.cost[order])]
        first = timed.angles[:, 0]
        place = [timed.shape, np.cos(first)[:, None], np.sin(first)[:, None], timed.branch[:, None]]
        place += [timed.pose.real, timed.pose.imag]
        numbers = np.concatenate(place, axis=1)[order]
        size = np.maximum(1.0, np.abs(numbers))
        keys = np.round(np.sign(numbers) * (1 + np.log(size)) * np.minimum(1.0, np.abs(numbers)) / cell)
        _, kept = np.unique(np.nan_to_num(keys), axis=0, return_index=True)
        return self.take(order[np.sort(kept)[:most]])
