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
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.charts import Chart, Shape
from synthesis.fourbar import TURN, close_loop
from synthesis.limits import Limits
from synthesis.mounting import DEGENERATE, fit_positions, fixed_parts
from synthesis.target import Target

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class Evaluation(NamedTuple):
    """Residuals and Jacobians of candidates."""

    cost: Floats
    """(n,): J squared; infinite where a candidate is no answer."""
    residual: Floats
    """(n, rows), scaled so that the sum of squares is J squared."""
    jacobian: Floats
    """(n, rows, 4)"""


class Problem:
    """A target made ready for many evaluations.

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
        self.weight = 1 / np.sqrt(target.samples)
        if target.rotation is not None:
            self.rotation = target.rotation - target.rotation.mean()
        if target.position is not None:
            _, self.turned, self.rest = fixed_parts(target)
            scaled = (target.position - target.position.mean()) / target.length_scale
            self.along = np.mean(np.conj(self.turned) * scaled)
            less_one = 2j * np.sin(target.crank / 2) * self.half
            self.turned_norm = float(np.sqrt(np.mean(np.abs(less_one - less_one.mean()) ** 2)))
            self.smallest_crank = DEGENERATE * target.extent / target.length_scale

    def evaluate(self, unknowns: Floats, branch: Floats, derivatives: bool = True) -> Evaluation:
        """Residuals, and Jacobians unless not wanted, at unknowns (n, 4) and branches (n,)."""
        shape = self.chart.shape(unknowns[:, :3])
        l1, l2, l3, l4 = (column[:, None] for column in shape.lengths.T)
        side = branch[:, None]
        half = np.exp(0.5j * unknowns[:, 3])[:, None] * self.half
        sine2, cosine2 = half.imag**2, half.real**2
        sine = 2 * half.real * half.imag
        product = 4 * l1 * l4
        x = shape.x0[:, None] + product * cosine2
        y = shape.y0[:, None] + product * sine2
        gap = l4 - l1
        r = np.sqrt(gap**2 + product * sine2)
        closed = np.all((x > 0) & (y > 0) & (r > 0), axis=1) & self._closes_between(shape, unknowns[:, 3])
        if self.sheet:
            closed &= (
                shape.lengths[:, 0] > shape.lengths[:, 3]
                if self.sheet > 0
                else shape.lengths[:, 0] < shape.lengths[:, 3]
            )
        if not closed.all():
            x, y, r = (np.where(closed[:, None], value, 1.0) for value in (x, y, r))
        # theta2 as in `fourbar`, where the two forms of arg(B - D) are explained
        longer = gap < 0
        small = np.where(longer, l4, l1)
        direction = np.arctan2(np.where(longer, small, -small) * sine, np.abs(gap) + 2 * small * sine2)
        crank = unknowns[:, 3:] + self.target.crank
        if longer.any():
            direction = np.where(longer, crank - np.pi + direction, direction)
        difference = l3 - l2
        larger = r + np.abs(difference)
        smaller = y / larger
        total = r + l2 + l3
        ahead, behind = np.where(difference >= 0, larger, smaller), np.where(difference >= 0, smaller, larger)
        angle = direction + 2 * side * np.arctan2(np.sqrt(ahead * x / total), np.sqrt(behind * total))

        residuals, slopes = [], []
        phasor = np.exp(1j * angle)
        if derivatives:
            slope = self._slope(shape, half * half, phasor, x, y, side)
        if self.target.rotation is not None:
            difference = self.rotation - angle
            residuals.append(difference - difference.mean(axis=1, keepdims=True))
            if derivatives:
                slopes.append(slope.mean(axis=1, keepdims=True) - slope)
        if self.target.position is not None:
            own, share = self._off_fixed(phasor)
            square = np.mean(own.real**2 + own.imag**2, axis=1)
            square = np.maximum(square, 1e-280)
            z = np.conj(own) @ self.rest / self.target.samples / square
            left = self.rest - z[:, None] * own
            crank_vector = np.abs(self.along - z * share) / self.turned_norm
            closed = closed & (crank_vector > self.smallest_crank)
            residuals += [left.real, left.imag]
            if derivatives:
                turned = 1j * phasor[:, :, None] * slope
                # turned off {1, e^{it}}, then off q
                mean = turned.mean(axis=1, keepdims=True)
                along = np.einsum("m,nmk->nk", np.conj(self.turned), turned) / self.target.samples
                turned = turned - mean - self.turned[:, None] * along[:, None, :]
                onto = np.einsum("nm,nmk->nk", np.conj(own), turned) / self.target.samples / square[:, None]
                against = np.einsum("nmk,nm->nk", np.conj(turned), left) / self.target.samples / square[:, None]
                change = -z[:, None, None] * (turned - own[:, :, None] * onto[:, None, :])
                change -= own[:, :, None] * against[:, None, :]
                slopes += [change.real, change.imag]
        if (rows := sum(part.shape[1] for part in residuals)) < 5:  # a triangle of 5 needs as many rows
            residuals.append(np.zeros((len(unknowns), 5 - rows)))
            slopes.append(np.zeros((len(unknowns), 5 - rows, 4)))
        residual = np.concatenate(residuals, axis=1) * self.weight
        cost = np.where(closed, np.einsum("nm,nm->n", residual, residual), np.inf)
        jacobian = np.concatenate(slopes, axis=1) * self.weight if derivatives else np.empty(0)
        return Evaluation(cost, residual, jacobian)

    def _closes_between(self, shape: Shape, start: Floats) -> NDArray[np.bool_]:
        """Whether the loop closes at theta1 = 0 and pi too, where the interval holds them: the diagonal's extremes."""
        end = start + self.target.span
        holds_zero = np.floor(end / TURN) >= np.ceil(start / TURN)
        holds_half = np.floor((end - np.pi) / TURN) >= np.ceil((start - np.pi) / TURN)
        return ~(holds_zero & (shape.y0 <= 0)) & ~(holds_half & (shape.x0 <= 0))

    def _off_fixed(self, phasor: Complexes) -> tuple[Complexes, Complexes]:
        own = phasor - phasor.mean(axis=1, keepdims=True)
        share = own @ np.conj(self.turned) / self.target.samples
        own = own - share[:, None] * self.turned
        again = own @ np.conj(self.turned) / self.target.samples  # twice is enough (Parlett, Kahan)
        own = own - own.mean(axis=1, keepdims=True) - again[:, None] * self.turned
        return own, share + again

    def _slope(
        self, shape: Shape, turned: Complexes, phasor: Complexes, x: Floats, y: Floats, side: Floats
    ) -> Floats:
        """d theta2 by the chart's unknowns and theta1', (n, N, 4)."""
        l1, l2, l3, l4 = (column[:, None] for column in shape.lengths.T)
        rocker = np.conj((l1 * turned + l2 * phasor - l4) / l3)
        lever = -2 * side * l3 / np.sqrt(x * y)
        lever = np.clip(lever, -1e8, 1e8)
        cross = turned * rocker
        by_length = np.stack([cross.real, (phasor * rocker).real, -np.ones_like(x), -rocker.real], axis=-1)
        slope = np.empty((*x.shape, 4))
        np.matmul(by_length, shape.jacobian, out=slope[..., :3])
        slope[..., 3] = -l1 * cross.imag
        slope *= lever[..., None]
        return slope


class LimitedProblem:
    """A problem with a penalty for leaving limits: rows ``penalty * max(0, margin - slack)`` beside the residual.

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
        self.plain = Problem(target, chart, sheet)
        self.limits, self.penalty = limits, penalty

    def slacks(self, unknowns: Floats, branch: Floats) -> Floats:
        """Slacks of all limits, see `Limits.slacks`, (n, columns)."""
        target = self.plain.target
        lengths, start = self.plain.chart.shape(unknowns[:, :3]).lengths, unknowns[:, 3]
        if target.position is None:
            return self.limits.slacks(target, lengths / lengths[:, 3:], start, None, None)
        angle = close_loop(lengths, start[:, None] + target.crank).coupler_angle(branch)
        fit = fit_positions(target, angle)
        scale = np.maximum(np.abs(fit.crank_vector), np.finfo(float).tiny) / lengths[:, 0]
        # by its angle: a quotient of numbers near the smallest ones is NaN
        ground = scale * lengths[:, 3] * np.exp(1j * (np.angle(fit.crank_vector) - start))
        return self.limits.slacks(target, lengths * scale[:, None], start, fit.pivot, fit.pivot + ground)

    def evaluate(self, unknowns: Floats, branch: Floats, derivatives: bool = True) -> Evaluation:
        """As `Problem.evaluate`, the penalty included."""
        plain = self.plain.evaluate(unknowns, branch, derivatives)
        slacks = self.slacks(unknowns, branch)
        violation = np.maximum(self.MARGIN - slacks, 0.0)
        usable = np.isfinite(plain.cost) & np.all(np.isfinite(slacks), axis=1)
        violation = np.where(usable[:, None], violation, 0.0)
        cost = np.where(usable, plain.cost + self.penalty**2 * np.sum(violation**2, axis=1), np.inf)
        residual = np.concatenate([plain.residual, self.penalty * violation], axis=1)
        if not derivatives:
            return Evaluation(cost, residual, plain.jacobian)
        # central differences: the limits' derivatives steer the search, its answer is checked on the limits themselves
        rows = np.zeros((*violation.shape, 4))
        for k in range(4):
            step = np.zeros(4)
            step[k] = self._STEP
            change = self.slacks(unknowns + step, branch) - self.slacks(unknowns - step, branch)
            rows[:, :, k] = np.where(violation > 0, -change / (2 * self._STEP), 0.0)
        rows = np.nan_to_num(rows, posinf=0.0, neginf=0.0)
        return Evaluation(cost, residual, np.concatenate([plain.jacobian, self.penalty * rows], axis=1))


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
    unknowns : ndarray, shape (n, 4)
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
    state = problem.evaluate(unknowns, branch)
    cost, residual, jacobian = state.cost.copy(), state.residual.copy(), state.jacobian.copy()
    damping = np.full(len(unknowns), 1e-3)
    growth = np.full(len(unknowns), 2.0)
    active = np.flatnonzero(np.isfinite(cost))
    triangle = np.empty((len(unknowns), 5, 5))
    stale = active
    steps = 0
    while steps < iterations and active.size and cost.min() > tolerance**2 and not expired():
        steps += 1
        if stale.size:
            augmented = np.concatenate([jacobian[stale], residual[stale][:, :, None]], axis=2)
            triangle[stale] = np.linalg.qr(augmented, mode="r")
        upper, right = triangle[active, :4, :4], triangle[active, :4, 4]
        norms = np.maximum(np.sqrt(np.einsum("nij,nij->nj", upper, upper)), 1e-12)
        left, singular, vectors = np.linalg.svd(upper / norms[:, None, :])
        inner = np.einsum("nij,ni->nj", left, right)
        factor = singular / (singular**2 + damping[active, None])
        step = -np.einsum("nji,nj->ni", vectors, factor * inner) / norms
        # no more than a bit over one in any unknown at a time: the charts are logarithmic
        longest = np.max(np.abs(step), axis=1)
        step *= np.minimum(1.0, 1.5 / np.maximum(longest, 1e-300))[:, None]
        trial = unknowns[active] + step
        moved = np.einsum("nij,nj->ni", upper, step)
        predicted = -np.einsum("ni,ni->n", moved, moved) - 2 * np.einsum("ni,ni->n", moved, right)
        new = problem.evaluate(trial, branch[active])
        gain = (cost[active] - new.cost) / np.maximum(predicted, 1e-300)
        better = new.cost < cost[active]
        took = active[better]
        relative = (cost[active] - new.cost) / np.maximum(cost[active], 1e-300)
        unknowns[took], cost[took] = trial[better], new.cost[better]
        residual[took], jacobian[took] = new.residual[better], new.jacobian[better]
        good = np.clip(gain[better], 0, 1)
        damping[took] = np.maximum(damping[took] * np.maximum(1 / 10, 1 - (2 * good - 1) ** 3), 1e-20)
        growth[took] = 2.0
        refused = active[~better]
        damping[refused] *= growth[refused]
        growth[refused] *= 2
        finished = (better & (relative < 1e-9)) | (damping[active] > 1e10) | (cost[active] < 1e-30)
        stale = took
        active = active[~finished]
        stale = stale[np.isin(stale, active)]
    return Refined(unknowns, branch, cost, steps)
