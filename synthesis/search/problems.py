"""What descends where the crank angles are given: residuals, constraints, and the descent under constraints.

**Without limits** shape and start are unknown, everything linear is projected out.

Offset, A, z1 and z2 are best for each shape and start (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10
(1973) 413-432). For a candidate with e = e^{i theta2}, q its part orthogonal to {1, e^{it}}, p that of the positions over l:

    residual   [theta - mean(theta),  p - z q],   theta = rotation - theta2,   z = <q, p> / <q, q>
    derivative [-(D - mean(D)),  -z P dq - q <dq, p - z q> / <q, q>],   D = d theta2, dq = Q(i e D)

with Q the projector off {1, e^{it}} and P the one off q as well.

**Within limits** that concern the shape alone the same is done. Otherwise the best pose of a shape may break a limit, and the
pose is unknown too. Lengths then are actual, over l, and positions are measured from their mean:

    unknowns   shape (k), theta1 at the first sample, A (x, y), theta4, z2 (x, y)
    residual   P - A - L1 e^{i (theta1 + theta4)} - z2 e^{i theta2}

**Constraints** are kept by projected Levenberg-Marquardt steps on an augmented Lagrangian, for many candidates at once.
What falls is J^2 + rho sum max(0, lambda / rho - c)^2 over constraints c >= 0, with multipliers lambda that are renewed while
rho grows (Nocedal and Wright, Numerical Optimization, 17.3). Equations are part of each step's linear system, so that they
reduce the unknowns. Steps come from normal equations: here J stays above 0.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from synthesis.least_squares import Evaluation
from synthesis.mechanism import Bounded, BoundedChart, Chart, Constrained, Constraints, Mechanism, Placed
from synthesis.pose import DEGENERATE, fixed_columns, whole_turns
from synthesis.target import Target
from synthesis.work import Work

Flags = NDArray[np.bool_]

# -- without limits ------------------------------------------------------------------------------------------------

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class ProjectedProblem:
    """A target and a chart made ready for many evaluations.

    Parameters
    ----------
    target : Target
        With a crank that turns counter-clockwise.
    chart : Chart
    """

    def __init__(self, target: Target, chart: Chart) -> None:
        self.target = target
        self.chart = chart
        self.body = chart.prepared(target)
        samples = target.samples
        self.rotation_rows = samples if target.rotation is not None else 0
        roots = []
        if target.rotation is not None:
            zero = target.rotation_mean(target.rotation) if target.offset is None else target.offset
            self.rotation = target.rotation - zero
            roots = [target.rotation_mean.root]
        if target.position is not None:
            mean = target.position_mean
            roots += [mean.root, mean.root]
            fixed = fixed_columns(target)
            self.rest, self.along = fixed.rest, fixed.along
            self.basis = np.stack([fixed.one, fixed.turned])
            self.onto_basis = (mean.weighted(np.conj(self.basis)) / mean.total).T
            less_one = 2j * np.sin(target.crank / 2) * np.exp(0.5j * target.crank)
            self.smallest_share = DEGENERATE * target.extent / target.length_scale * float(mean.spread(less_one))
        self.roots = np.concatenate([np.broadcast_to(root, samples) for root in roots])

    def evaluate(self, unknowns: Floats, branch: Floats, derivatives: bool = True) -> Evaluation:
        """Residuals, and derivatives unless not wanted, at candidates (n, k + 1) of branches (n,).

        A start that is given has no derivative.
        """
        angle, phasor, slope, answer = self.body(unknowns, branch, derivatives)
        size = unknowns.shape[1]
        stack = np.zeros((len(unknowns), size + 1, self.roots.size))
        if self.target.rotation is not None:
            mean = self.target.rotation_mean
            part = stack[:, :, : self.rotation_rows]
            np.subtract(self.rotation, angle, out=part[:, size])
            if slope is not None:
                np.negative(slope, out=part[:, :size])
            if self.target.offset is None:
                part -= mean.weighted(part).sum(axis=2, keepdims=True) / mean.total
            else:
                part[:, size] -= whole_turns(mean(part[:, size]))[:, None]
        if self.target.position is not None:
            crank_share = self._position(phasor, slope, stack[:, :, self.rotation_rows :])
            answer = answer & (crank_share > self.smallest_share)
        stack *= self.roots
        residual = stack[:, size]
        cost = np.einsum("nm,nm->n", residual, residual)
        if self.target.start is not None:
            stack = np.delete(stack, size - 1, axis=1)
        return Evaluation(cost if answer is True else np.where(answer, cost, np.inf), stack)

    def residual(self, unknowns: Floats, branch: Floats) -> Floats:
        """The residuals alone, (n, rows)."""
        return self.evaluate(unknowns, branch, derivatives=False).stack[:, -1]

    def _position(self, phasor: Complexes, slope: Floats | None, part: Floats) -> Floats:
        """Fill in the rows of the position; returns |z1| times the norm of e^{it} less its mean, (n,)."""
        samples, mean = self.target.samples, self.target.position_mean
        size = part.shape[1] - 1
        shares = phasor @ self.onto_basis
        own = phasor - shares @ self.basis
        again = own @ self.onto_basis  # twice is enough (Parlett, The Symmetric Eigenvalue Problem, 6.9)
        own -= again @ self.basis
        dual = mean.weighted(np.conj(own)) / mean.total
        square = np.maximum(np.einsum("nm,nm->n", dual, own).real, 1e-280)
        z = (dual @ self.rest) / square
        left = self.rest - z[:, None] * own
        part[:, size, :samples], part[:, size, samples:] = left.real, left.imag
        if slope is not None:
            change = (1j * phasor)[:, None, :] * slope
            change -= (change @ self.onto_basis) @ self.basis
            toward = (change @ dual[:, :, None])[:, :, 0] / square[:, None]
            against = np.conj(change @ mean.weighted(np.conj(left))[:, :, None])[:, :, 0]
            against /= mean.total * square[:, None]
            # z times the part off q, and the turn of q against the residual
            change *= -z[:, None, None]
            change += (z[:, None] * toward - against)[:, :, None] * own[:, None, :]
            part[:, :size, :samples], part[:, :size, samples:] = change.real, change.imag
        return np.abs(self.along - z * (shares[:, 1] + again[:, 1]))


# -- within limits -------------------------------------------------------------------------------------------------


_NONE = np.empty(0, dtype=bool)
_LONGEST_TURN, _LONGEST_WAY = 0.75, 2.0
"""Longest step of angles and of positions over l."""


class Places(NamedTuple):
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

    def pose(self, unknowns: Floats) -> Places:
        """The pose of candidates."""
        ax, ay, turned, zx, zy = unknowns[:, self.size + 1 :].T
        return Places(ax + 1j * ay, turned, zx + 1j * zy)

    def posed(self, shape: Floats, start: Floats, pose: Places) -> Floats:
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


# -- descent under constraints -------------------------------------------------------------------------------------


MARGIN = 1e-7
"""By which constraints are kept, so that rounding breaks none."""
_LEAST_DAMPING = 1e-12
_EXACT = 1e-15
"""To which equations are solved."""
_STALL, _HOPELESS = 1e-7, 1e10
"""A candidate's descent ends where a step gains no more than this part, or its damping exceeds the other."""


class Problem(Protocol):
    """What a descent needs to know."""

    def evaluate(self, unknowns: Floats, branch: Floats) -> Evaluation:
        """Residuals and derivatives."""

    def constrained(self, unknowns: Floats, branch: Floats) -> Constrained:
        """Constraints and derivatives."""

    def stepped(self, unknowns: Floats, step: Floats) -> Floats:
        """Unknowns after a step."""

    def held(self, unknowns: Floats, gradient: Floats) -> Flags:
        """Which unknowns a bound holds."""


class Plan(NamedTuple):
    """How a descent goes."""

    steps: int
    weights: tuple[float, ...]
    """rho, one after the other."""
    every: int
    """Steps with each."""
    awaited: int | None = None
    """So many of the best candidates are descended to their end; None: all."""


class Descended(NamedTuple):
    """Candidates after a descent."""

    unknowns: Floats
    branch: Floats
    cost: Floats
    """J squared; infinite where a candidate does not close."""
    broken: Floats
    """Largest amount by which a constraint is broken."""

    def take(self, places: Any) -> Descended:
        """Some of them."""
        return Descended(*(column[places] for column in self))

    def joined(self, other: Descended) -> Descended:
        """These and others after them."""
        return Descended(*(np.concatenate(pair) for pair in zip(self, other)))


class _State(NamedTuple):
    """Candidates with what a step needs."""

    unknowns: Floats
    cost: Floats
    normal: Floats
    """(n, m + 1, m + 1): J'J and J'r."""
    values: Floats
    slopes: Floats

    @classmethod
    def at(cls, problem: Problem, unknowns: Floats, branch: Floats) -> tuple[_State, Flags]:
        """Candidates, and which of the constraints are equations."""
        cost, stack = problem.evaluate(unknowns, branch)
        stack = np.where(np.isfinite(cost)[:, None, None], stack, 0.0)
        found = problem.constrained(unknowns, branch)
        return cls(
            unknowns, cost, stack @ stack.transpose(0, 2, 1), found.values - MARGIN * ~found.equal, found.slopes
        ), found.equal


def descend(problem: Problem, unknowns: Floats, branch: Floats, plan: Plan, work: Work) -> Descended:
    """Candidates after a plan's steps; none is worse by its augmented Lagrangian than it was before.

    Parameters
    ----------
    problem : Problem
    unknowns : ndarray, shape (n, m)
    branch : ndarray, shape (n,)
    plan : Plan
    work : Work
        Asked before each step.
    """
    here, equal = _State.at(problem, unknowns, branch)
    count = len(unknowns)
    damping, growth = np.full(count, 1e-2), np.full(count, 2.0)
    multipliers = np.zeros(here.values.shape)
    rho = plan.weights[0]
    for step in range(plan.steps):
        if not count or work.expired():
            break
        if step and step % plan.every == 0 and here.values.shape[1]:
            multipliers = rho * _active(here.values, multipliers, rho, equal)
            rho = plan.weights[min(step // plan.every, len(plan.weights) - 1)]
        active = _active(here.values, multipliers, rho, equal)
        trial, predicted = _trial(problem, here, active, rho, equal, damping)
        there, _ = _State.at(problem, trial, branch)
        before = here.cost + rho * np.einsum("nc,nc->n", active, active)
        new = _active(there.values, multipliers, rho, equal)
        after = there.cost + rho * np.einsum("nc,nc->n", new, new)
        closes = np.isfinite(before) & np.isfinite(after)
        decrease = np.where(closes, before, 0.0) - np.where(closes, after, 0.0)
        last = here.values.shape[1] == 0 or step >= plan.every * (len(plan.weights) - 1)
        better = np.where(np.isfinite(before), decrease > 0, np.isfinite(after))
        gain = np.clip(decrease / np.maximum(predicted, 1e-100), 0, 1)
        damping = np.where(better, damping * np.maximum(0.1, 1 - (2 * gain - 1) ** 3), damping * growth)
        damping = np.clip(damping, _LEAST_DAMPING, 1e12)
        growth = np.where(better, 2.0, 2 * growth)
        for new_column, column in zip(there, here):
            new_column[~better] = column[~better]
        here = there
        if last:
            ended = (predicted <= _STALL * before) | better & (decrease <= _STALL * before) | (damping > _HOPELESS)
            if ended[np.argsort(np.where(better, after, before))[: plan.awaited]].all():
                break
    broken = np.where(equal, np.abs(here.values), -here.values)
    return Descended(here.unknowns, branch, here.cost, np.max(broken, axis=1, initial=0.0))


def _active(values: Floats, multipliers: Floats, rho: float, equal: Flags) -> Floats:
    """max(0, lambda / rho - c) of constraints, lambda / rho - c of equations, (n, C)."""
    part = multipliers / rho - values
    return np.where(equal, part, np.maximum(part, 0.0))


def _trial(
    problem: Problem, here: _State, active: Floats, rho: float, equal: Flags, damping: Floats
) -> tuple[Floats, Floats]:
    """Unknowns after a damped step, and the decrease that the linear model predicts for it."""
    size = here.unknowns.shape[1]
    hessian, gradient = here.normal[:, :size, :size], here.normal[:, :size, size]
    if active.shape[1]:
        rows = np.where((active != 0)[:, :, None], here.slopes, 0.0)
        hessian = hessian + rho * (rows.transpose(0, 2, 1) @ rows)
        gradient = gradient - rho * (active[:, None, :] @ rows)[:, 0]
    held = problem.held(here.unknowns, gradient)
    free = ~held
    diagonal = np.arange(size)
    largest = hessian[:, diagonal, diagonal]
    largest = np.maximum(largest, 1e-9 * largest.max(axis=1, keepdims=True))
    system = hessian * (free[:, :, None] & free[:, None, :])
    system[:, diagonal, diagonal] += np.where(held, 1.0, damping[:, None] * largest + 1e-300)
    right = -np.where(held, 0.0, gradient)
    if equal.any():
        rows = here.slopes[:, equal] * free[:, None, :]
        step = _within_equations(system, right, rows, -here.values[:, equal])
    else:
        step = _solved(system, right[:, :, None])[:, :, 0]
    trial = problem.stepped(here.unknowns, step)
    moved = trial - here.unknowns
    predicted = -np.einsum("nm,nm->n", moved, 2 * gradient + (hessian @ moved[:, :, None])[:, :, 0])
    return trial, predicted


def _solved(system: Floats, right: Floats) -> Floats:
    """Solutions of damped systems; of least norm where one is singular to rounding."""
    try:
        return np.asarray(np.linalg.solve(system, right))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(system, hermitian=True) @ right)


def _within_equations(system: Floats, right: Floats, rows: Floats, gap: Floats) -> Floats:
    """Steps that solve the system among those that meet linearised equations; redundant equations do no harm."""
    base = _solved(system, np.concatenate([right[:, :, None], rows.transpose(0, 2, 1)], axis=2))
    plain, spread = base[:, :, 0], base[:, :, 1:]
    forces: Any = np.linalg.pinv(rows @ spread, rcond=1e-12) @ (gap - (rows @ plain[:, :, None])[:, :, 0])[:, :, None]
    return plain + (spread @ forces)[:, :, 0]


def restored(problem: Problem, found: Descended, rounds: int = 12) -> Descended:
    """Candidates moved onto the limits that they break by the shortest way: Newton steps on those constraints.

    Law: none breaks more than it did; one that the steps lead away stays where it was.
    """
    unknowns, branch = found.unknowns, found.branch
    constrained = problem.constrained(unknowns, branch)
    before = np.max(constrained.lacking, axis=1, initial=0.0)
    for _ in range(rounds):
        equal, values = constrained.equal, constrained.values - MARGIN * ~constrained.equal
        wrong = np.where(equal, np.abs(values) > _EXACT, values < 0)
        if not wrong.any():
            break
        rows = np.where(wrong[:, :, None], constrained.slopes, 0.0)
        gap = np.where(wrong, np.where(equal, -values, 0.1 * MARGIN - values), 0.0)
        steps = (np.linalg.pinv(rows, rcond=1e-9) @ gap[:, :, None])[:, :, 0]
        held = problem.held(unknowns, -steps)
        if held.any():
            steps = (np.linalg.pinv(np.where(held[:, None], 0.0, rows), rcond=1e-9) @ gap[:, :, None])[:, :, 0]
        unknowns = problem.stepped(unknowns, steps)
        constrained = problem.constrained(unknowns, branch)
    broken = np.max(constrained.lacking, axis=1, initial=0.0)
    astray = ~(broken <= before)  # NaN is astray, too
    unknowns = np.where(astray[:, None], found.unknowns, unknowns)
    cost = problem.evaluate(unknowns, branch).cost
    return Descended(unknowns, branch, cost, np.where(astray, before, broken))
