"""Poses without crank angles within limits: seeds that know the limits, and descents in shape, pose and all angles.

Data flow::

    windows at guessed timings in poses within the limits, and whatever else `rounds` begin from
      -> descents in which broken limits are rows of growing weight beside the samples'
      -> at the angles that were found, moved onto the limits that are still broken

A limit that depends on where the crank begins or ends has its row beside the first or last sample's own, so that the crank
angle of that sample can make up for it; the others stand as samples without an angle.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.limits import Limits
from synthesis.fourbar.mechanism import ways
from synthesis.free.dyads import chart_of
from synthesis.free.joint import JointProblem, Pool, Rows, Timed, Turned, refine
from synthesis.free.poses import Poses
from synthesis.least_squares import Evaluation
from synthesis.mechanism import BodyAngles, Boxes, Chart, Constrained, Constraints, Placed
from synthesis.search.problems import MARGIN, Descended, PosedProblem, restored
from synthesis.search.seeds import Fits, Windows
from synthesis.target import Interval, Target
from synthesis.work import Work

Floats = NDArray[np.float64]

_SPANS = np.deg2rad([130.0, 40.0, 80.0, 190.0, 260.0, 330.0])
"""Guesses of the crank angle from the first sample to the last."""
_SEEDS = 24
"""Windows of each guess."""
_PLAN = ((0.3, 12, 120), (3.0, 12, 60), (30.0, 15, 30), (300.0, 40, 14), (300.0, 120, 14))
"""Weight of broken limits, steps, and how many candidates go on."""
_APART = 1e-6
"""A crank shorter than this part of the length scale is none."""
_STALL = 1e-6
"""A step that lowers the cost by a smaller part ends a candidate's descent."""
_BY_ANGLE = ("transmission_angle_min", "envelope")
"""Limits that depend on where the crank begins and ends."""


class LimitedJoint(JointProblem):
    """Poses, a chart and limits made ready for many evaluations.

    Parameters
    ----------
    poses : Poses
        With positions.
    chart : Chart
    constraints : Constraints
        The limits, over the length scale.
    penalty : float
        Its square weighs squared violations against J squared.
    """

    def __init__(self, poses: Poses, chart: Chart, constraints: Constraints, penalty: float) -> None:
        super().__init__(poses, chart)
        self.constraints, self.penalty = constraints, penalty
        self.plain = JointProblem(poses, chart)

    def posed(self, timed: Timed, turned: Turned) -> Timed:
        """The candidates as they are: their pose is an unknown."""
        return timed

    def constrained(self, timed: Timed) -> tuple[Constrained, Floats]:
        """Constraints with derivatives by shape and pose (n, C, m), and by the first and last crank angle (n, C, 2)."""
        shape = self.chart.shape(timed.shape)
        a, z1, z2 = timed.pose.T
        size = np.abs(z1)
        safe = np.where(size > 0, size, 1.0)
        scale = size / shape.lengths[:, 0]
        used = Interval(timed.angles.min(axis=1), timed.angles.max(axis=1))
        placed = Placed(shape.lengths * scale[:, None], timed.branch, used, a, np.angle(z1), z2)
        found = self.constraints(placed)
        by_length, k = found.slopes[:, :, :4], self.size
        slopes = np.zeros((*found.slopes.shape[:2], k + 6))
        # lengths are those of the chart over its crank, times |z1|
        relative = shape.jacobian - shape.lengths[:, :, None] * (shape.jacobian[:, :1] / shape.lengths[:, :1, None])
        slopes[:, :, :k] = by_length @ (scale[:, None, None] * relative)
        by_size = (by_length @ (shape.lengths / shape.lengths[:, :1])[:, :, None])[:, :, 0]
        by_turn = found.slopes[:, :, 8] / safe[:, None]
        along = (z1 / safe)[:, None]
        slopes[:, :, k : k + 2] = found.slopes[:, :, 6:8]
        slopes[:, :, k + 2] = by_size * along.real - by_turn * along.imag
        slopes[:, :, k + 3] = by_size * along.imag + by_turn * along.real
        slopes[:, :, k + 4 :] = found.slopes[:, :, 9:]
        values = np.nan_to_num(found.values, nan=-1.0)
        return found._replace(values=values, slopes=np.nan_to_num(slopes)), np.nan_to_num(found.slopes[:, :, 4:6])

    def _broken(self, timed: Timed) -> _Broken:
        """The rows of the limits."""
        found, by_ends = self.constrained(timed)
        lacking = np.where(found.equal, -found.values, np.maximum(MARGIN - found.values, 0.0))
        active = np.where(lacking != 0, -self.penalty, 0.0)[:, :, None]
        beside = np.isin(found.names, _BY_ANGLE)
        later = np.abs(by_ends[:, beside, 1]) > np.abs(by_ends[:, beside, 0])
        ends = timed.angles.argmin(axis=1)[:, None], timed.angles.argmax(axis=1)[:, None]
        return _Broken(
            self.penalty * lacking,
            active * found.slopes,
            np.where(later, by_ends[:, beside, 1], by_ends[:, beside, 0]) * active[:, beside, 0],
            np.where(later, ends[1], ends[0]),
            beside,
        )

    def residual(self, timed: Timed, turned: Turned) -> Floats:
        """Residuals of the samples, and of the limits beside and after them, (n, R + E, N + K)."""
        broken = self._broken(timed)
        return broken.joined(super().residual(timed, turned)[:, None], broken.rows[:, None])[:, 0]

    def cost(self, residual: Floats, body: BodyAngles) -> Floats:
        """J squared and the squares of the limits' rows; infinite where a candidate does not close."""
        cost = np.einsum("nrk,nrk->n", residual, residual)
        return np.where(np.isfinite(cost) & (body.possible if body.possible is not True else True), cost, np.inf)

    def derivatives(self, timed: Timed, turned: Turned) -> Rows:
        """Rows and their derivatives."""
        plain, broken = self.plain.derivatives(timed, turned), self._broken(timed)
        columns = np.zeros((len(broken.rows), self.columns + 1, broken.rows.shape[1]))
        columns[:, : self.size + 6] = broken.slopes.transpose(0, 2, 1)
        columns[:, -1] = broken.rows
        stack = broken.joined(plain.stack, columns)
        turn = np.zeros((len(stack), *stack.shape[2:]))
        turn[:, : self.plain.rows, : self.poses.samples] = plain.turn
        rows = np.arange(len(stack))[:, None]
        turn[rows, self.plain.rows + np.arange(broken.at.shape[1]), broken.at] = broken.by_angle
        return Rows(self.cost(stack[:, -1], turned.body), stack, turn)

    def moved(self, timed: Timed, step: Floats, turn: Floats) -> Timed:
        """Candidates after a step."""
        return super().moved(timed, step, turn[:, : self.poses.samples])


class _Broken(NamedTuple):
    """The rows of C limits, E of which stand beside the sample whose crank angle they depend on."""

    rows: Floats
    """(n, C)"""
    slopes: Floats
    """(n, C, m): by shape and pose."""
    by_angle: Floats
    """(n, E): by that sample's crank angle."""
    at: NDArray[np.intp]
    """(n, E): that sample."""
    beside: NDArray[np.bool_]
    """(C,)"""

    def joined(self, plain: Floats, columns: Floats) -> Floats:
        """Rows (n, m, R, N) of the samples with those of the limits (n, m, C) beside and after them, (n, m, R + E, N + K)."""
        count, size, height, samples = plain.shape
        after = columns[:, :, ~self.beside]
        total = height + self.at.shape[1]
        more = -(-after.shape[2] // total)
        out = np.zeros((count, size, total, samples + more))
        out[:, :, :height, :samples] = plain
        padded = np.zeros((count, size, total * more))
        padded[:, :, : after.shape[2]] = after
        out[:, :, :, samples:] = padded.reshape(count, size, total, more)
        rows = np.arange(count)[:, None]
        place = (rows, slice(None), height + np.arange(self.at.shape[1]), self.at)
        out[place] = columns[:, :, self.beside].transpose(0, 2, 1)
        return out


class _AtTheirAngles:
    """Candidates whose crank angles stand still, as `constrained.restored` moves them: unknowns are shape and pose."""

    def __init__(self, problem: LimitedJoint, timed: Timed) -> None:
        self.problem, self.timed = problem, timed

    @property
    def unknowns(self) -> Floats:
        """Shape and pose, (n, k + 6)."""
        pose = self.timed.pose
        return np.hstack([self.timed.shape, np.stack([pose.real, pose.imag], axis=2).reshape(len(pose), 6)])

    def at(self, unknowns: Floats) -> Timed:
        """Candidates of unknowns."""
        size = self.problem.size
        return self.timed._replace(
            shape=unknowns[:, :size], pose=unknowns[:, size::2] + 1j * unknowns[:, size + 1 :: 2]
        )

    def evaluate(self, unknowns: Floats, branch: Floats) -> Evaluation:
        """Their J squared."""
        plain, timed = self.problem.plain, self.at(unknowns)
        turned = plain.turned(timed, derivatives=False)
        return Evaluation(plain.cost(plain.residual(timed, turned), turned.body), np.empty(0))

    def constrained(self, unknowns: Floats, branch: Floats) -> Constrained:
        """Constraints and derivatives."""
        return self.problem.constrained(self.at(unknowns))[0]

    def stepped(self, unknowns: Floats, step: Floats) -> Floats:
        """Unknowns after a step."""
        size, out = self.problem.size, unknowns + step
        chart = self.problem.bounded
        if chart is not None:
            out[:, :size] = chart.stepped(unknowns[:, :size], step[:, :size])
        return out

    def held(self, unknowns: Floats, gradient: Floats) -> NDArray[np.bool_]:
        """None is held."""
        return np.zeros(unknowns.shape, dtype=bool)


def moved_onto(problem: LimitedJoint, timed: Timed, rounds: int = 12) -> tuple[Pool, Floats]:
    """Candidates moved onto the limits that they break, with J squared, and by how much they still break one."""
    still = _AtTheirAngles(problem, timed)
    nothing = np.empty(0)
    moved = restored(still, Descended(still.unknowns, timed.branch, nothing, nothing), rounds)
    return Pool(still.at(moved.unknowns), moved.cost), moved.broken


def refined_within(poses: Poses, limits: Limits, timed: Timed, work: Work) -> Pool:
    """Candidates refined within limits and moved onto those that they still break; their costs are J squared."""
    chart, constraints = chart_of(limits.family), ways(poses, limits, posed=True)[-1].constraints
    for weight, steps, most in _PLAN:
        if not timed.branch.size or work.expired():
            break
        problem = LimitedJoint(poses, chart, constraints, weight)
        found = refine(problem, timed, steps, 0.0, work, stall=_STALL, all_of_them=True)
        timed = Pool.of(found).best(most).timed
    problem = LimitedJoint(poses, chart, constraints, 1.0)
    return moved_onto(problem, timed)[0]


def placed_within(problem: LimitedJoint, timed: Timed, boxes: Boxes) -> tuple[Timed, NDArray[np.intp]]:
    """Candidates in the best pose that boxes for pivots and lengths leave them.

    Those come first that fit well and keep the limits; then the places of those that keep all limits, best first.
    """
    turned = problem.turned(timed, derivatives=False)
    start = timed.angles[:, 0]
    crank = turned.crank * np.exp(-1j * start)[:, None]
    lengths = problem.chart.shape(timed.shape).lengths
    rho = lengths[:, 0] / lengths[:, 3] * np.exp(1j * start)
    fits = Fits.of_candidates(problem.poses.position_mean, problem.position, crank, turned.body.phasor)
    _, pivot, ground, coupler = fits.within(rho, boxes, boxes.reach(lengths))
    apart = np.abs(ground) > _APART * lengths[:, 3] / lengths[:, 0]
    pose = np.stack([pivot, ground * lengths[:, 0] / lengths[:, 3], coupler], axis=1)
    timed = timed._replace(pose=pose).take(apart)
    lacking = problem.constrained(timed)[0].lacking
    merit = problem.plain_cost(timed) + np.sum(lacking**2, axis=1)
    order = np.argsort(np.where(np.isfinite(merit), merit, np.inf), kind="stable")
    return timed.take(order), np.flatnonzero(lacking[order].max(axis=1, initial=0.0) == 0)


def guessed_windows(poses: Poses, limits: Limits, windows: Windows) -> Iterator[Timed]:
    """Seeds within limits at guessed crank angles, even along the way, for both senses of the crank; a guess at a time."""
    assert poses.position is not None
    steps = np.abs(np.diff(poses.position))
    share = np.concatenate([[0.0], np.cumsum(steps + 0.3 * steps.mean())])
    share = share / share[-1]
    chart = chart_of(limits.family)
    for span in _SPANS[_SPANS <= poses.span_max]:
        both = []
        for sense in (1, -1):
            target = Target(
                None if poses.rotation is None else np.unwrap(poses.rotation),
                poses.position,
                poses.length_scale,
                poses.rotation_weights,
                poses.position_weights,
                crank=sense * span * share,
            )
            both.append(_mirrored(_seeds(target, limits, windows, chart, sense), sense))
        yield both[0].joined(both[1])


def _seeds(target: Target, limits: Limits, windows: Windows, chart: Chart, sense: int) -> Timed:
    """The best windows of a target, for a crank that turns the other way in a mirror."""
    if sense < 0:
        target, limits = target.mirrored(), limits.mirrored()
    way = ways(target, limits, posed=True)[0]
    problem = PosedProblem(target, way.chart, way.constraints)
    found = windows.seeds(problem, way.on_shape, way.boxes, _SEEDS)
    unknowns, branch = found.unknowns[:_SEEDS], found.branch[:_SEEDS]
    pivot, turned, coupler = problem.pose(unknowns)
    lengths = way.chart.shape(unknowns[:, : problem.size]).lengths
    pose = np.stack([pivot, lengths[:, 0] * np.exp(1j * turned), coupler], axis=1)
    angles = unknowns[:, [problem.size]] + target.crank
    return Timed(chart.unknowns(lengths), pose, np.zeros(len(branch)), angles, branch)


def _mirrored(timed: Timed, sense: int) -> Timed:
    """Candidates in a mirror where the crank turns clockwise."""
    if sense > 0:
        return timed
    return timed._replace(pose=np.conj(timed.pose), angles=-timed.angles, branch=-timed.branch)
