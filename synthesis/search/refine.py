"""Local refinement: batched Levenberg-Marquardt over four non-linear unknowns, with everything linear projected out.

The unknowns are the three of a chart and theta1 at the first sample; offset, A, z1 and z2 are best for each of them
(variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413-432). For a candidate with e = e^{i theta2},
q its part orthogonal to {1, e^{it}}, p that of the positions over l:

    residual   [theta - mean(theta),  p - z q],   theta = rotation - theta2,   z = <q, p> / <q, q>
    derivative [-(D - mean(D)),  -z P dq - q <dq, p - z q> / <q, q>],   D = d theta2, dq = Q(i e D)

with Q the projector off {1, e^{it}} and P the one off q as well. Steps come from the singular values of the triangle of a QR
decomposition, never from normal equations: in small spans the Jacobian's condition passes 1e8.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.charts import Chart, Shape
from synthesis.fourbar.kinematics import TURN, close_loop
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.pose import DEGENERATE, Mount, fit_positions, fixed_parts, wrap
from synthesis.target import Target

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


_LONGEST_STEP = 1.5
_STALL = 1e-9
"""A step that lowers the cost by a smaller part than this is the last one."""


class Evaluation(NamedTuple):
    """Residuals and Jacobians of candidates."""

    cost: Floats
    """(n,): J squared; infinite where a candidate is no answer."""
    stack: Floats
    """(n, unknowns + 1, rows): the residual's derivatives, then the residual, whose squares add up to J squared."""


class Problem:
    """A target made ready for many evaluations.

    Few array operations a call, each over all candidates and samples: in small batches their number is the run time.

    Parameters
    ----------
    target : Target
        With a crank that turns counter-clockwise.
    chart : Chart
    sheet : int
        -1: only linkages with L1 < L4, +1: only L1 > L4, 0: both.
    """

    def __init__(self, target: Target, chart: Chart, sheet: int = 0) -> None:
        self.target = target
        self.chart = chart
        self.sheet = sheet
        self.half = np.exp(0.5j * target.crank)
        samples = target.samples
        self.weight = 1 / np.sqrt(samples)
        self.rotation_rows = samples if target.rotation is not None else 0
        rows = self.rotation_rows + (2 * samples if target.position is not None else 0)
        self.rows = rows
        if target.rotation is not None:
            self.rotation = target.rotation - target.rotation.mean()
        if target.position is not None:
            one, turned, self.rest = fixed_parts(target)
            self.basis = np.stack([one, turned])
            self.onto_basis = np.conj(self.basis.T) / samples
            scaled = (target.position - target.position.mean()) / target.length_scale
            self.along = np.mean(np.conj(turned) * scaled)
            less_one = 2j * np.sin(target.crank / 2) * self.half
            turned_norm = float(np.sqrt(np.mean(np.abs(less_one - less_one.mean()) ** 2)))
            self.smallest_share = DEGENERATE * target.extent / target.length_scale * turned_norm

    def evaluate(self, unknowns: Floats, branch: Floats, derivatives: bool = True) -> Evaluation:
        """Residuals, and derivatives unless not wanted, at unknowns (n, 4) and branches (n,)."""
        shape = self.chart.shape(unknowns[:, :3])
        lengths = shape.lengths[:, :, None]
        l1, l2, l3, l4 = lengths[:, 0], lengths[:, 1], lengths[:, 2], lengths[:, 3]
        side = branch[:, None]
        half = np.exp(0.5j * unknowns[:, 3:]) * self.half
        sine, cosine = half.imag, half.real
        product = 4 * l1 * l4
        reach = product * (sine * sine)
        x = shape.x0[:, None] + product * (cosine * cosine)
        y = shape.y0[:, None] + reach
        gap = l4 - l1
        r2 = gap * gap + reach
        answer = self._closes(shape, unknowns[:, 3], x, y)
        if answer is not True:
            x, y, r2 = (np.where(answer[:, None], value, 1.0) for value in (x, y, r2))
        # theta2 as in `fourbar`, where the two forms of arg(B - D) are explained. 2 L2 r cos(mu) = r^2 + L2^2 - L3^2 and
        # 2 L2 r sin(mu) = sqrt(X Y): not the last digit of `fourbar`'s form, but X and Y are as good as there.
        small = np.minimum(l1, l4)
        lag = np.arctan2(np.copysign(2 * small, -gap) * (sine * cosine), np.abs(gap) + 2 * small * (sine * sine))
        root = np.sqrt(x * y)
        angle = lag + side * np.arctan2(root, r2 + (l2 - l3) * (l2 + l3))
        ahead = np.flatnonzero(gap[:, 0] < 0)
        if ahead.size:
            angle[ahead] += unknowns[ahead, 3:] + (self.target.crank - np.pi)
        phasor = np.empty(angle.shape, dtype=complex)
        np.cos(angle, out=phasor.real)
        np.sin(angle, out=phasor.imag)

        stack = np.zeros((len(unknowns), 5, self.rows))
        samples = self.target.samples
        slope = self._slope(shape, half * half, phasor, root, side) if derivatives else None
        if self.target.rotation is not None:
            part = stack[:, :, :samples]
            np.subtract(self.rotation, angle, out=part[:, 4])
            if slope is not None:
                np.negative(slope, out=part[:, :4])
            part -= part.sum(axis=2, keepdims=True) / samples
        if self.target.position is not None:
            crank_share = self._position(phasor, slope, stack[:, :, self.rotation_rows :])
            answer = answer & (crank_share > self.smallest_share)
        stack *= self.weight
        residual = stack[:, 4]
        cost = np.einsum("nm,nm->n", residual, residual)
        return Evaluation(cost if answer is True else np.where(answer, cost, np.inf), stack)

    def _position(self, phasor: Complexes, slope: Floats | None, part: Floats) -> Floats:
        """Fill in the rows of the position; returns |z1| times the norm of e^{it} less its mean, (n,)."""
        samples = self.target.samples
        shares = phasor @ self.onto_basis
        own = phasor - shares @ self.basis
        again = own @ self.onto_basis  # twice is enough (Parlett, The Symmetric Eigenvalue Problem, 6.9)
        own -= again @ self.basis
        dual = np.conj(own) / samples
        square = np.maximum(np.einsum("nm,nm->n", dual, own).real, 1e-280)
        z = (dual @ self.rest) / square
        left = self.rest - z[:, None] * own
        part[:, 4, :samples], part[:, 4, samples : 2 * samples] = left.real, left.imag
        if slope is not None:
            change = (1j * phasor)[:, None, :] * slope
            change -= (change @ self.onto_basis) @ self.basis
            toward = (change @ dual[:, :, None])[:, :, 0] / square[:, None]
            against = np.conj(change @ np.conj(left)[:, :, None])[:, :, 0] / (samples * square[:, None])
            # z times the part off q, and the turn of q against the residual
            change *= -z[:, None, None]
            change += (z[:, None] * toward - against)[:, :, None] * own[:, None, :]
            part[:, :4, :samples], part[:, :4, samples : 2 * samples] = change.real, change.imag
        return np.abs(self.along - z * (shares[:, 1] + again[:, 1]))

    def _closes(self, shape: Shape, start: Floats, x: Floats, y: Floats) -> NDArray[np.bool_] | Literal[True]:
        """Which candidates are of the sheet and close at every sample, and at theta1 = 0 and pi where the interval holds them.

        There the diagonal is shortest and longest, so nothing can open between the samples.
        """
        answer: NDArray[np.bool_] | Literal[True] = True
        if self.sheet:
            answer = (shape.lengths[:, 0] - shape.lengths[:, 3]) * self.sheet > 0
        if not self.chart.always_closes:
            end = start + self.target.span
            holds_zero = np.floor(end / TURN) >= np.ceil(start / TURN)
            holds_half = np.floor((end - np.pi) / TURN) >= np.ceil((start - np.pi) / TURN)
            between = ~(holds_zero & (shape.y0 <= 0)) & ~(holds_half & (shape.x0 <= 0))
            answer = answer & between & np.all((x > 0) & (y > 0), axis=1)
        return answer

    def _slope(self, shape: Shape, turned: Complexes, phasor: Complexes, root: Floats, side: Floats) -> Floats:
        """d theta2 by the chart's unknowns and theta1', (n, 4, N)."""
        lengths = shape.lengths[:, :, None]
        l1, l2, l3, l4 = lengths[:, 0], lengths[:, 1], lengths[:, 2], lengths[:, 3]
        rocker = np.conj(l1 * turned + l2 * phasor - l4) / l3
        cross = turned * rocker
        by_length = np.empty((len(root), 4, root.shape[1]))
        by_length[:, 0] = cross.real
        by_length[:, 1] = (phasor * rocker).real
        by_length[:, 2] = -1.0
        np.negative(rocker.real, out=by_length[:, 3])
        slope = np.empty_like(by_length)
        np.matmul(shape.jacobian.transpose(0, 2, 1), by_length, out=slope[:, :3])
        np.multiply(-l1, cross.imag, out=slope[:, 3])
        # one over L2 sin(theta2 - theta3); bounded, so that a dead position stops a step and not the program
        lever = -2 * side * l3 / np.maximum(root, 1e-8)
        slope *= lever[:, None, :]
        return slope


class LimitedProblem:
    """A problem within limits: pose and shape together are unknown, because the best pose of a shape may break a limit.

    Unknowns are the four of `Problem` and, with positions, six more, lengths over l and positions from their mean: A (two),
    ln k (k scales the chart's lengths), theta4, and the coefficient of e^{i theta2} (two). The offset stays projected out.
    Leaving a limit costs rows ``penalty * max(0, margin - slack)`` beside the residual.

    Parameters
    ----------
    target, chart, sheet
        As for `Problem`.
    limits : Limits
    penalty : float
        Its square weighs squared violations against J squared; the margin makes up for what a finite penalty gives way.
    """

    MARGIN = 1e-5
    _STEP = 1e-6

    def __init__(self, target: Target, chart: Chart, sheet: int, limits: Limits, penalty: float) -> None:
        self.plain = Problem(replace(target, position=None, rotation=_or_zero(target)), chart, sheet)
        self.target, self.limits, self.penalty = target, limits, penalty
        self.unknowns = 4
        if target.position is not None:
            self.unknowns = 10
            self.mean = target.position.mean()
            self.scaled = (target.position - self.mean) / target.length_scale

    def lift(self, unknowns: Floats, branch: Floats) -> Floats:
        """Unknowns of this problem (n, 10) for those of `Problem` (n, 4): the best pose; unchanged without positions."""
        if self.target.position is None:
            return unknowns
        lengths = self.plain.chart.shape(unknowns[:, :3]).lengths
        angle = close_loop(lengths, unknowns[:, 3:] + self.target.crank).coupler_angle(branch)
        fit = fit_positions(self.target, angle)
        scale = self.target.length_scale
        pivot, coupler = (fit.pivot - self.mean) / scale, fit.coupler_vector / scale
        crank = np.maximum(np.abs(fit.crank_vector) / scale, 1e-3)
        ground_angle = np.angle(fit.crank_vector) - unknowns[:, 3]
        pose = [pivot.real, pivot.imag, np.log(crank / lengths[:, 0]), ground_angle, coupler.real, coupler.imag]
        return np.hstack([unknowns, np.stack(pose, axis=1)])

    def links(self, unknowns: Floats) -> Floats:
        """Actual lengths, (n, 4)."""
        lengths = self.plain.chart.shape(unknowns[:, :3]).lengths
        if self.target.position is None:
            return lengths / lengths[:, 3:]
        return lengths * (self.target.length_scale * np.exp(np.clip(unknowns[:, 6:7], -60, 60)))

    def pivots(self, unknowns: Floats) -> tuple[Complexes | None, Complexes | None]:
        """Fixed pivots A and B, (n,) each."""
        if self.target.position is None:
            return None, None
        pivot = self.mean + self.target.length_scale * (unknowns[:, 4] + 1j * unknowns[:, 5])
        return pivot, pivot + self.links(unknowns)[:, 3] * np.exp(1j * unknowns[:, 7])

    def poses(self, unknowns: Floats) -> list[Mount] | None:
        """Poses of candidates, for `solution.finish_solutions`."""
        if self.target.position is None:
            return None
        pivot_a, pivot_b = self.pivots(unknowns)
        coupler = self.target.length_scale * (unknowns[:, 8] + 1j * unknowns[:, 9])
        return [
            Mount(1.0, wrap(row[7]), complex(a), complex(b), abs(c), wrap(float(np.angle(c)) - row[7]))
            for row, a, b, c in zip(unknowns, pivot_a, pivot_b, coupler)
        ]

    def slacks(self, unknowns: Floats) -> Floats:
        """Slacks of all limits, see `Limits.slacks`, (n, columns)."""
        return self.limits.slacks(self.target, self.links(unknowns), unknowns[:, 3], *self.pivots(unknowns))

    def evaluate(self, unknowns: Floats, branch: Floats) -> Evaluation:
        """Residuals and derivatives, the penalty included."""
        plain = self.plain.evaluate(unknowns[:, :4], branch)
        parts = []
        cost = np.where(np.isfinite(plain.cost), 0.0, np.inf)
        if self.target.rotation is not None:
            cost = cost + plain.cost
            part = np.zeros((len(unknowns), self.unknowns + 1, plain.stack.shape[2]))
            part[:, :4], part[:, -1] = plain.stack[:, :4], plain.stack[:, 4]
            parts.append(part)
        if self.target.position is not None:
            parts.append(self._position(unknowns, branch))
            cost = cost + np.sum(parts[-1][:, -1] ** 2, axis=1)
        parts.append(self._violation(unknowns))
        cost = cost + np.sum(parts[-1][:, -1] ** 2, axis=1)
        return Evaluation(np.where(np.isnan(cost), np.inf, cost), np.nan_to_num(np.concatenate(parts, axis=2)))

    def _position(self, unknowns: Floats, branch: Floats) -> Floats:
        shape = self.plain.chart.shape(unknowns[:, :3])
        closure = close_loop(shape.lengths, unknowns[:, 3:4] + self.target.crank)
        angle = closure.coupler_angle(branch)
        slope = np.zeros((len(unknowns), 4, self.target.samples))
        by_length = closure.coupler_angle_gradient(branch)
        slope[:, :3] = np.einsum("nmi,nik->nkm", by_length[..., :4], shape.jacobian)
        slope[:, 3] = by_length[..., 4]
        a, log_scale, ground_angle = unknowns[:, 4] + 1j * unknowns[:, 5], unknowns[:, 6], unknowns[:, 7]
        coupler = unknowns[:, 8] + 1j * unknowns[:, 9]
        crank_vector = shape.lengths[:, 0] * np.exp(np.clip(log_scale, -60, 60) + 1j * ground_angle)
        crank = crank_vector[:, None] * np.exp(1j * (unknowns[:, 3:4] + self.target.crank))
        arm = np.exp(1j * angle)
        columns = np.empty((len(unknowns), 11, self.target.samples), dtype=complex)
        columns[:, :4] = -1j * (coupler[:, None] * arm)[:, None, :] * slope
        columns[:, :3] -= crank[:, None, :] * (shape.jacobian[:, 0] / shape.lengths[:, :1])[:, :, None]
        columns[:, 3] -= 1j * crank
        columns[:, 4], columns[:, 5] = -1.0, -1j
        columns[:, 6], columns[:, 7] = -crank, -1j * crank
        columns[:, 8], columns[:, 9] = -arm, -1j * arm
        columns[:, 10] = self.scaled - a[:, None] - crank - coupler[:, None] * arm
        columns /= np.sqrt(self.target.samples)
        return np.concatenate([columns.real, columns.imag], axis=2)

    def _violation(self, unknowns: Floats) -> Floats:
        count, size = unknowns.shape
        violation = np.maximum(self.MARGIN - self.slacks(unknowns), 0.0)
        rows = np.zeros((count, size + 1, violation.shape[1]))
        rows[:, -1] = violation
        if violation.any():
            # central differences: the limits' derivatives steer the search, its answer is checked on the limits themselves
            steps = self._STEP * np.concatenate([np.eye(size), -np.eye(size)])
            moved = self.slacks((unknowns[:, None, :] + steps).reshape(-1, size)).reshape(count, 2, size, -1)
            change = (moved[:, 1] - moved[:, 0]) / (2 * self._STEP)
            rows[:, :-1] = np.where(violation[:, None, :] > 0, change, 0.0)
        return self.penalty * rows


def _or_zero(target: Target) -> Floats:
    """The rotation, or zeros where there is none: what closes is asked for in either case."""
    return np.zeros(target.samples) if target.rotation is None else target.rotation


@dataclass
class Refined:
    """Candidates after refinement."""

    unknowns: Floats
    branch: Floats
    cost: Floats
    steps: int


def refine(
    problem: Problem | LimitedProblem,
    unknowns: Floats,
    branch: Floats,
    iterations: int,
    tolerance: float = 0.0,
    expired: Callable[[], bool] = lambda: False,
) -> Refined:
    """Levenberg-Marquardt from seeds, all at once.

    Parameters
    ----------
    problem : Problem or LimitedProblem
    unknowns : ndarray, shape (n, m)
        Four for a `Problem`, up to ten for a `LimitedProblem`.
    branch : ndarray of +-1, shape (n,)
    iterations : int
        At most this many steps.
    tolerance : float
        Stop when the best J is below it.
    expired : callable
        Asked before each step; true stops the refinement where it is.

    Returns
    -------
    Refined
        Law: no candidate is worse than its seed.
    """
    unknowns = unknowns.copy()
    size = unknowns.shape[1]
    cost, stack = problem.evaluate(unknowns, branch)
    damping = np.full(len(unknowns), 1e-3)
    growth = np.full(len(unknowns), 2.0)
    triangle = _triangle(stack)
    active = np.flatnonzero(np.isfinite(cost))
    steps = 0
    while steps < iterations and active.size and cost.min() > tolerance**2 and not expired():
        steps += 1
        upper, right = triangle[active, :size, :size], triangle[active, :size, size]
        step = -_damped_solution(upper, right, damping[active])
        # no more than a bit over one in any unknown at a time: the charts are logarithmic
        longest = np.max(np.abs(step), axis=1)
        step *= np.minimum(1.0, _LONGEST_STEP / np.maximum(longest, 1e-300))[:, None]
        trial = unknowns[active] + step
        moved = np.einsum("nij,nj->ni", upper, step)
        predicted = -np.einsum("ni,ni->n", moved, moved + 2 * right)
        new = problem.evaluate(trial, branch[active])
        before = cost[active]
        decrease = before - new.cost
        better = decrease > 0
        took, refused = active[better], active[~better]
        unknowns[took], cost[took] = trial[better], new.cost[better]
        triangle[took] = _triangle(new.stack[better])
        # Nielsen's rule (Madsen, Nielsen, Tingleff, Methods for non-linear least squares problems, 3.2)
        gain = np.clip(decrease[better] / np.maximum(predicted[better], 1e-300), 0, 1)
        damping[took] = np.maximum(damping[took] * np.maximum(0.1, 1 - (2 * gain - 1) ** 3), 1e-20)
        growth[took] = 2.0
        damping[refused] *= growth[refused]
        growth[refused] *= 2
        stalled = better & (decrease < _STALL * before)
        finished = stalled | (damping[active] > 1e10) | (before < 1e-30)
        active = active[~finished]
    return Refined(unknowns, branch, cost, steps)


def _damped_solution(upper: Floats, right: Floats, damping: Floats) -> Floats:
    """Least-squares solutions of ``upper @ step = right`` with Marquardt's damping, by the QR decomposition of both."""
    size = upper.shape[1]
    norms = np.maximum(np.sqrt(np.einsum("nij,nij->nj", upper, upper)), 1e-12)
    system = np.zeros((len(upper), 2 * size, size + 1))
    system[:, :size, :size], system[:, :size, size] = upper, right
    diagonal = np.arange(size)
    system[:, size + diagonal, diagonal] = np.sqrt(damping)[:, None] * norms
    small = np.linalg.qr(system, mode="r")
    return np.linalg.solve(small[:, :size, :size], small[:, :size, size:])[:, :, 0]


def _triangle(stack: Floats) -> Floats:
    """R of the QR decomposition of derivatives and residual as columns, (n, m + 1, m + 1)."""
    columns = stack.transpose(0, 2, 1)
    if (missing := columns.shape[2] - columns.shape[1]) > 0:
        columns = np.concatenate([columns, np.zeros((len(columns), missing, columns.shape[2]))], axis=1)
    return np.linalg.qr(columns, mode="r")
