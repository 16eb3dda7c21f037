"""Descents over shape, pose and crank angles: rows against a naive twin and differences, steps against dense least squares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.fourbar.charts import AnyChart, FullCrankChart, GrashofChart, LengthsChart
from synthesis.fourbar.kinematics import close_loop, coupler_angle
from synthesis.fourbar.limits import Constraints, Limits, Reach
from synthesis.free import dyads, joint
from synthesis.free.joint import JointProblem, Stage, Timed
from synthesis.free.limited import limited_problem
from synthesis.free.poses import Poses
from synthesis.mechanism import Placed
from synthesis.target import Interval
from synthesis.work import Work

LENGTHS = np.array([[0.15, 0.3, 0.25, 0.3], [0.4, 0.25, 0.28, 0.07]])
CHARTS = [FullCrankChart(), GrashofChart()]
EVERY_CHART = [FullCrankChart(), AnyChart(), GrashofChart(), GrashofChart(scaled=False), LengthsChart()]
CHART_NAMES = ["full crank", "any", "scaled", "actual", "lengths"]
MARGIN = 1e-7
"""By which descents keep limits."""
LIMITS = Limits(
    transmission_angle_min=0.6,
    transmission_angle_min_turn=0.3,
    link_max=0.6,
    pivot_a=0.1 - 0.3j,
    pivot_b_box=(1.0, -0.2, 2.0, 0.1),
    pivot_reach=Reach(0.1j, 0.9, 0.9),
    coupler_radius_max=0.4,
    envelope=(-1.0, -0.8, 1.2, 0.7),
)
"""Of nearly every kind; no linkage keeps them all."""
KEPT_LIMITS = Limits(transmission_angle_min=0.3, pivot_a=1 + 1j, link_max=6.0, coupler_radius_max=4.0)


def poses(rotation: bool = True, position: bool = True, samples: int = 11) -> Poses:
    """Some poses, of unequal weights."""
    random = np.random.default_rng(7)
    place = np.cumsum(random.standard_normal(samples) + 1j * random.standard_normal(samples))
    turned = np.cumsum(random.uniform(0, 0.3, samples)) if rotation else None
    weights = random.uniform(0.5, 2.0, (2, samples))
    return Poses(
        turned,
        place if position else None,
        length_scale=2.0,
        rotation_weights=weights[0] if rotation else None,
        position_weights=weights[1] if position else None,
    )


def candidates(
    chart: Any, rotation: bool, limits: Limits | None = None, position: bool = True
) -> tuple[JointProblem, Timed]:
    """Two candidates, a crank-rocker and a double-crank, some way off some poses, in their best pose there."""
    asked = poses(rotation, position)
    angles = np.sort(np.random.default_rng(8).uniform(0, 5, (2, asked.samples)), axis=1)
    timed = Timed(
        chart.unknowns(LENGTHS), np.zeros((2, 3), dtype=complex), np.zeros(2), angles, np.array([1.0, -1.0])
    )
    plain = JointProblem(asked, chart)
    return plain if limits is None else limited_problem(asked, chart, limits), plain.measured(
        timed, facing=True
    ).timed


def wide(columns: np.ndarray) -> np.ndarray:
    """Complex columns (..., m) as (..., 2 m) numbers."""
    return np.stack([columns.real, columns.imag], axis=-1).reshape(*columns.shape[:-1], -1)


def naive_residual(problem: JointProblem, timed: Timed) -> np.ndarray:
    """The samples' rows by the general kinematics, (n, R N): rotations, then x, then y."""
    asked = problem.poses
    turned = coupler_angle(problem.chart.shape(timed.shape).lengths, timed.branch, timed.angles)
    rows = []
    if asked.rotation is not None:
        gap = asked.rotation - timed.offset[:, None] - turned
        rows.append(asked.rotation_mean.root * np.angle(np.exp(1j * gap)))
    if asked.position is not None:
        a, z1, z2 = timed.pose.T[:, :, None]
        gap = asked.position_mean.root * (
            asked.scaled - a - z1 * np.exp(1j * timed.angles) - z2 * np.exp(1j * turned)
        )
        rows += [gap.real, gap.imag]
    return np.concatenate(rows, axis=1)


def naive_limits(problem: JointProblem, limits: Limits, timed: Timed) -> tuple[np.ndarray, np.ndarray]:
    """Values (n, C) of limits where the candidates stand, and which are equations."""
    lengths = problem.chart.shape(timed.shape).lengths
    a, z1, z2 = timed.pose.T
    used = Interval(timed.angles.min(axis=1), timed.angles.max(axis=1))
    placed = Placed(lengths * (np.abs(z1) / lengths[:, 0])[:, None], timed.branch, used, a, np.angle(z1), z2)
    found = Constraints(limits, problem.poses.middle, problem.poses.length_scale, exact=False)(placed)
    return found.values, found.equal


def changed(timed: Timed, step: np.ndarray, turns: np.ndarray) -> Timed:
    """Candidates after steps (n, m) of shape, pose and offset, and turns (n, N), uncut."""
    size = timed.shape.shape[1]
    pose = timed.pose
    if step.shape[1] > size + 1:
        pose = pose + step[:, size : size + 6 : 2] + 1j * step[:, size + 1 : size + 6 : 2]
    offset = timed.offset + (step[:, -1] if step.shape[1] in (size + 1, size + 7) else 0.0)
    return Timed(timed.shape + step[:, :size], pose, offset, timed.angles + turns, timed.branch)


def slopes(rows: Callable[[Timed], np.ndarray], timed: Timed, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """Central differences of rows (n, R) by all unknowns, (n, m, R), and by each crank angle, (n, N, R)."""
    step, (count, samples) = 1e-6, timed.angles.shape
    every = np.eye(columns + samples) * step
    found = []
    for one in every:
        by = np.tile(one, (count, 1))
        there, here = (rows(changed(timed, way * by[:, :columns], way * by[:, columns:])) for way in (1, -1))
        found.append((there - here) / (2 * step))
    return np.stack(found[:columns], axis=1), np.stack(found[columns:], axis=1)


@pytest.mark.parametrize("chart", EVERY_CHART, ids=CHART_NAMES)
@pytest.mark.parametrize(("rotation", "position"), [(True, True), (False, True), (True, False)])
def test_rows_and_derivatives_are_those_of_the_general_kinematics(chart: Any, rotation: bool, position: bool) -> None:
    problem, timed = candidates(chart, rotation, position=position)
    told = problem.linearised(timed, 1e-3)
    by_unknowns, by_angles = slopes(partial(naive_residual, problem), timed, len(told[0]["rows"]) - 1)
    samples = problem.poses.samples
    for k, one in enumerate(told):
        np.testing.assert_allclose(one["rows"][-1], naive_residual(problem, timed)[k], atol=1e-14)
        np.testing.assert_allclose(one["rows"][:-1], by_unknowns[k], atol=2e-8)
        own = by_angles[k].reshape(samples, -1, samples)
        np.testing.assert_allclose(one["turn"].reshape(-1, samples), np.einsum("iri->ri", own), atol=2e-8)


@settings(max_examples=150)
@given(
    st.sampled_from(EVERY_CHART),
    st.lists(st.floats(-9, 3), min_size=4, max_size=4),
    st.sampled_from([-1.0, 1.0]),
    st.lists(st.floats(-4, 4) | st.sampled_from([0.0, np.pi, -np.pi, 1e-6]), min_size=5, max_size=5),
)
def test_the_loop_closes_as_in_the_general_kinematics(
    chart: Any, magnitudes: list[float], branch: float, crank: list[float]
) -> None:
    """Beside change points and dead positions too, with cranks much shorter and longer than the ground."""
    unknowns = np.array([magnitudes[: len(chart.cell) - 1]])
    if hasattr(chart, "within"):
        unknowns = chart.within(np.exp(unknowns) * [branch if crank[0] > 0 else 1.0, 1, 1, 1])
    lengths, turns = chart.shape(unknowns).lengths, np.array(crank)
    closure = close_loop(lengths, turns[:, None])
    wanted = closure.coupler_angle(np.array([branch]))[:, 0]
    # one sample, so that each crank angle is a candidate of its own, turned back by the angle that is expected
    problem = JointProblem(Poses(np.zeros(1), None), chart)
    timed = Timed(
        np.repeat(unknowns, 5, axis=0),
        np.zeros((5, 3), dtype=complex),
        -np.nan_to_num(wanted),
        turns[:, None],
        np.full(5, branch),
    )
    found = np.sqrt(problem.measured(timed, posed=False).cost)
    # what rounding of the lengths makes of theta2, which has no slope where the loop folds
    size = closure.lengths.sum(axis=-1)[:, 0] ** 2
    root = np.sqrt(closure.excess_x * closure.excess_y)[:, 0]
    sure = closure.closed[:, 0] & (root > 1e-7 * size)
    assert np.all(found[sure] < 1e-15 * (16 + 8 * size[sure] / root[sure]))
    diagonal = np.abs(lengths[0, 3] - lengths[0, 0] * np.exp(1j * turns))
    beyond = np.maximum(diagonal - lengths[0, 1:3].sum(), np.abs(np.diff(lengths[0, 1:3])) - diagonal)
    assert np.all(np.isinf(found[beyond > 1e-12 * lengths.sum()]))
    for k in np.flatnonzero(sure & (root > 1e-5 * size)):
        (one,) = problem.linearised(timed.take([k]), 1e-3)
        by = closure.coupler_angle_gradient(np.array([branch]))[k, 0]
        slope = np.append(by[:4] @ chart.shape(unknowns).jacobian[0], by[4])
        own = np.append(one["rows"][:-2, 0], one["turn"])
        held = np.append(own[:-1] == 0, False)
        np.testing.assert_allclose(own[~held], -slope[~held], rtol=1e-6, atol=1e-6 * np.abs(slope).max())


def test_the_best_pose_is_that_of_least_squares() -> None:
    problem, timed = candidates(GrashofChart(), True)
    turned = problem.turned(timed)
    root = problem.poses.position_mean.root
    for k in range(2):
        columns = np.stack([np.ones(11), turned.crank[k], turned.body.phasor[k]], axis=1) * root[:, None]
        fit = np.linalg.lstsq(columns, root * problem.poses.scaled, rcond=None)[0]
        np.testing.assert_allclose(timed.pose[k], fit, rtol=1e-12)
    np.testing.assert_allclose(
        problem.poses.rotation_mean(problem.poses.rotation - timed.offset[:, None] - turned.body.angle), 0, atol=1e-15
    )


@pytest.mark.parametrize("chart", EVERY_CHART, ids=CHART_NAMES)
def test_rows_of_limits_and_their_derivatives(chart: Any) -> None:
    problem, timed = candidates(chart, True, LIMITS)
    weight = 3.0
    values, equal = naive_limits(problem, LIMITS, timed)
    told = problem.linearised(timed, 1e-3, weight)
    size = len(told[0]["rows"]) - 1
    by_unknowns, by_angles = slopes(lambda one: naive_limits(problem, LIMITS, one)[0], timed, size)
    for k, one in enumerate(told):
        broken = np.flatnonzero(np.where(equal, values[k] != 0, values[k] < MARGIN))
        traced = broken >= values.shape[1] - 12  # the envelope's extremes, which lie between the angles looked at
        assert traced.sum() > 5 and (~traced).sum() > 5
        rows = one["rows"][:, 3 * problem.poses.samples :]
        np.testing.assert_allclose(rows[-1], weight * (MARGIN * ~equal - values[k])[broken], atol=1e-14)
        beside = np.zeros((problem.poses.samples, broken.size))
        beside[one["at_sample"], np.arange(broken.size)] = one["by_angle"]
        found, wanted = np.vstack([rows[:-1], beside]), np.vstack([by_unknowns[k], by_angles[k]])[:, broken] * -weight
        np.testing.assert_allclose(found[:, ~traced], wanted[:, ~traced], atol=1e-6)
        np.testing.assert_allclose(found[:, traced], wanted[:, traced], rtol=1e-3, atol=3e-3)
    assert any(np.abs(one["by_angle"]).max() > 0.1 for one in told)


@pytest.mark.parametrize("damping", [1e-2, 1e-12], ids=["by normal equations", "by reflections"])
@pytest.mark.parametrize("limits", [None, LIMITS], ids=["without limits", "within limits"])
@pytest.mark.parametrize("rotation", [False, True])
def test_step_is_that_of_dense_least_squares_over_all_angles(
    damping: float, limits: Limits | None, rotation: bool
) -> None:
    problem, timed = candidates(FullCrankChart(), rotation, limits)
    samples = problem.poses.samples
    for one in problem.linearised(timed, damping, 3.0):
        rows, columns = one["rows"][:-1].T, len(one["rows"]) - 1
        own = np.zeros((len(rows), samples))
        for row, part in enumerate(one["turn"].reshape(-1, samples)):
            own[row * samples + np.arange(samples), np.arange(samples)] = part
        own[len(one["turn"]) + np.arange(one["at_sample"].size), one["at_sample"]] = one["by_angle"]
        square = np.sum(own**2, axis=0)
        ridge_own = 1e-2 * damping * np.maximum(square, 1e-6 * square.mean()) + 1e-20 * square.mean()
        np.testing.assert_allclose(one["inner"], square + ridge_own, rtol=1e-13)
        dense = np.vstack([np.hstack([rows, own]), np.diag(np.sqrt(np.concatenate([one["ridge"], ridge_own])))])
        right = np.concatenate([-one["rows"][-1], np.zeros(columns + samples)])
        expected = np.linalg.lstsq(dense, right, rcond=None)[0]
        scale = np.abs(expected).max()
        np.testing.assert_allclose(np.concatenate([one["step"], one["turn_step"]]), expected, atol=1e-7 * scale)
        # what is eliminated follows: the fall is that of the best angles before and after the step
        angles = np.vstack([own, np.diag(np.sqrt(ridge_own))])

        def left(step: np.ndarray, rows: np.ndarray = rows, angles: np.ndarray = angles, one: Any = one) -> float:
            gap = np.concatenate([one["rows"][-1] + rows @ step, np.zeros(samples)])
            return float(np.sum((gap - angles @ np.linalg.lstsq(angles, gap, rcond=None)[0]) ** 2))

        assert one["fall"] == pytest.approx(left(np.zeros(columns)) - left(one["step"]), rel=1e-6)


def test_what_a_bound_holds_is_not_derived_by() -> None:
    held = []
    for chart, unknown in product((GrashofChart(), GrashofChart(scaled=False)), range(4)):
        problem, timed = candidates(chart, True)
        shape = timed.shape.copy()
        shape[:, unknown] = np.copysign(chart.LEAST, shape[:, unknown])
        timed = problem.measured(timed._replace(shape=shape), facing=True).timed
        body = chart.at(timed.shape, timed.angles, timed.branch)
        lever = -problem.position_root * 1j * timed.pose[:, 2:] * body.phasor
        parts = [-problem.rotation_root * np.ones_like(body.angle), lever.real, lever.imag]
        slope = np.concatenate([body.slope[:, :4] * part[:, None] for part in parts], axis=2)
        for k, one in enumerate(problem.linearised(timed, 1e-3)):
            told = chart.held(timed.shape[k], slope[k] @ one["rows"][-1])
            np.testing.assert_allclose(one["rows"][:4], np.where(told[:, None], 0.0, slope[k]), rtol=1e-9, atol=1e-12)
            held.append(told[unknown])
    assert 4 <= sum(held) < 16


@pytest.mark.parametrize(
    "chart", [GrashofChart(), GrashofChart(scaled=False), LengthsChart()], ids=["scaled", "actual", "lengths"]
)
def test_steps_of_the_shape_are_those_of_the_chart(chart: Any) -> None:
    problem, timed = candidates(chart, True)
    random = np.random.default_rng(2)
    for size in (0.1, 1.0, 40.0):
        steps = size * random.standard_normal((2, 11))
        there = problem.moved(timed, steps, np.zeros((2, 11)))
        np.testing.assert_allclose(there.shape, chart.stepped(timed.shape, steps[:, :4]), rtol=1e-13)
        np.testing.assert_allclose(wide(there.pose), wide(timed.pose) + steps[:, 4:10], rtol=1e-13)
        np.testing.assert_allclose(there.offset, timed.offset + steps[:, 10], rtol=1e-13)


@pytest.mark.parametrize("chart", CHARTS)
def test_descents_never_get_worse_and_keep_the_order(chart: FullCrankChart | GrashofChart) -> None:
    problem, timed = candidates(chart, False)
    before = np.sum(naive_residual(problem, timed) ** 2, axis=1)
    done = problem.descended(timed, [Stage(30)])
    assert np.all(done.cost <= before)
    # beside a change point lengths tell less than the unknowns
    np.testing.assert_allclose(done.cost, np.sum(naive_residual(problem, done.timed) ** 2, axis=1), rtol=1e-6)
    assert np.all(np.diff(done.timed.angles, axis=1) > 0)
    assert np.all(np.ptp(done.timed.angles, axis=1) < 2 * np.pi)


@pytest.mark.parametrize("chart", EVERY_CHART, ids=CHART_NAMES)
def test_within_limits_descents_lower_what_they_say(chart: Any) -> None:
    """The rows' squares in one stage; from stage to stage less is broken, at last next to nothing."""
    problem, timed = candidates(chart, True, KEPT_LIMITS)
    values, equal = naive_limits(problem, KEPT_LIMITS, timed)
    squares, largest = problem.lacking(timed)
    lacking = np.where(equal, np.abs(values), np.maximum(-values, 0.0))
    np.testing.assert_allclose(largest, lacking.max(axis=1), rtol=1e-12)
    np.testing.assert_allclose(squares, np.sum(lacking**2, axis=1), rtol=1e-12)

    def cost(one: Timed, weight: float) -> np.ndarray:
        there = naive_limits(problem, KEPT_LIMITS, one)[0]
        rows = np.where(equal, there, np.maximum(MARGIN - there, 0.0))
        return np.sum(naive_residual(problem, one) ** 2, axis=1) + weight**2 * np.sum(rows**2, axis=1)

    least = cost(timed, 2.0)
    for steps in (1, 3, 10, 30):
        done = problem.descended(timed, [Stage(steps, weight=2.0)])
        np.testing.assert_allclose(done.cost, cost(done.timed, 2.0), rtol=1e-8)
        assert np.all(done.cost <= least * (1 + 1e-12))
        least = done.cost


@pytest.mark.parametrize("chart", EVERY_CHART, ids=CHART_NAMES)
def test_from_stage_to_stage_less_is_broken(chart: Any) -> None:
    """Of limits that a crank-rocker just does not keep: an equation, and bounds."""
    random = np.random.default_rng(3)
    shape, angles = chart.unknowns(LENGTHS[:1]), 0.4 + np.sort(random.uniform(0, 3, (1, 11)), axis=1)
    turned = chart.at(shape, angles, np.ones(1)).angle[0]
    place = 3 - 4j + 2 * (0.5 * np.exp(1j * angles[0]) + np.exp(1j * (turned + 0.3)))
    asked = Poses(turned, place, length_scale=2.0)
    limits = Limits(pivot_a=3.1 - 4.1j, link_max=1.9, coupler_radius_max=1.8, transmission_angle_min=0.5)
    timed = Timed(shape, np.zeros((1, 3), dtype=complex), np.zeros(1), angles, np.ones(1)).take(
        np.zeros(20, dtype=int)
    )
    timed = timed._replace(shape=timed.shape + 0.02 * random.standard_normal(timed.shape.shape) * timed.shape)
    problem, other = limited_problem(asked, chart, limits), limited_problem(asked, chart, limits)
    told = [problem.lacking(JointProblem(asked, chart).measured(timed, facing=True).timed)[1]]
    stages = [Stage(40, 1e-6, weight) for weight in (1.0, 3.0, 10.0, 30.0, 100.0)]
    done = problem.descended(timed, stages, between=lambda pool: told.append(other.lacking(pool.timed)[1]))
    told.append(problem.lacking(done.timed)[1])
    assert len(told) == 6
    for before, after in pairwise(told):  # weights alone would gain a factor of ten
        assert np.all(after < 0.05 * before + 1e-6)


@pytest.mark.parametrize("chart", EVERY_CHART, ids=CHART_NAMES)
def test_a_step_onto_the_limits_is_the_shortest(chart: Any) -> None:
    problem, timed = candidates(chart, True, KEPT_LIMITS)
    kept, broken = problem.moved_onto(timed)
    assert np.all(broken < 1e-13)
    size, random = timed.shape.shape[1], np.random.default_rng(6)
    for way in range(20):
        near = problem.moved(kept.timed, 1e-3 * random.standard_normal((2, size + 7)), np.zeros((2, 11)))
        values, equal = naive_limits(problem, KEPT_LIMITS, near)
        by_unknowns = slopes(lambda one: naive_limits(problem, KEPT_LIMITS, one)[0], near, size + 7)[0]
        moved = problem.moved_onto(near, 1)[0].timed
        for k in range(2):
            wrong = np.flatnonzero(np.where(equal, np.abs(values[k]) > 1e-15, values[k] < MARGIN))
            gap = np.where(equal, -values[k], 1.1 * MARGIN - values[k])[wrong]
            step = np.linalg.pinv(by_unknowns[k, : size + 6, wrong], rcond=1e-6) @ gap
            took = np.concatenate([moved.shape[k] - near.shape[k], wide(moved.pose[k] - near.pose[k])])
            np.testing.assert_allclose(took, step, atol=1e-5 * np.abs(step).max(), err_msg=str((way, k, wrong)))
    np.testing.assert_allclose(moved.angles, near.angles, atol=1e-10)


@pytest.mark.parametrize("chart", EVERY_CHART, ids=CHART_NAMES)
@pytest.mark.parametrize("limits", [LIMITS, KEPT_LIMITS], ids=["that contradict one another", "that can be kept"])
def test_moved_onto_limits_none_breaks_more_than_it_did(chart: Any, limits: Limits) -> None:
    problem, timed = candidates(chart, True, limits)
    random = np.random.default_rng(4)
    many = timed.take(np.arange(60) % 2)
    many = problem.moved(many, 0.2 * random.standard_normal((60, timed.shape.shape[1] + 7)), np.zeros((60, 11)))
    before = problem.lacking(many)[1]
    moved, broken = problem.moved_onto(many)
    assert np.all(broken <= before)
    np.testing.assert_allclose(problem.lacking(moved.timed)[1], broken, rtol=1e-12)
    if limits is KEPT_LIMITS:
        assert np.mean(broken < 1e-13) > 0.5


def test_a_descent_cut_into_pieces_leads_to_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    for limits in (None, KEPT_LIMITS):
        problem, timed = candidates(GrashofChart(), True, limits)
        many = timed.take(np.arange(7) % 2)
        many = many._replace(shape=many.shape * np.linspace(0.9, 1.1, 7)[:, None])
        stages = [Stage(25, weight=1.0), Stage(10, weight=10.0)]
        at_once = problem.descended(many, stages)
        monkeypatch.setattr(joint, "_BETWEEN_LOOKS", 1)
        in_pieces = problem.descended(many, stages)
        monkeypatch.undo()
        alone = [problem.descended(many.take([k]), stages) for k in range(7)]
        for k, one in enumerate(alone):
            for other in (at_once, in_pieces):
                for column, whole in zip((*one.timed, one.cost), (*other.timed, other.cost)):
                    np.testing.assert_array_equal(column[0], whole[k])


def test_a_descent_whose_time_is_up_stays_where_it_came_to() -> None:
    problem, timed = candidates(GrashofChart(), True)
    none = problem.descended(timed, [Stage(50)], work=Work(0.0))
    for one, two in zip(timed, none.timed):
        np.testing.assert_allclose(one, two, rtol=1e-12)
    assert np.all(problem.descended(timed, [Stage(50)]).cost < none.cost)


def test_one_exact_candidate_is_enough_unless_all_are_wanted() -> None:
    problem, timed = candidates(GrashofChart(), True)
    found = problem.descended(timed, [Stage(30)]).cost
    assert found[1] != found[0]
    reached = float(np.sqrt(found[0])) * 1.0001
    one = problem.descended(timed, [Stage(30)], reached)
    both = problem.descended(timed, [Stage(30)], reached, all_of_them=True)
    assert one.least <= reached and one.cost[1] > both.cost[1]


def test_grashof_chart_gives_the_lengths_back_and_holds_its_bounds() -> None:
    chart = GrashofChart()
    unknowns = chart.unknowns(LENGTHS)
    assert np.sign(unknowns[:, 0]).tolist() == [1.0, -1.0]
    shape = chart.shape(unknowns)
    np.testing.assert_allclose(shape.lengths / shape.lengths.sum(axis=1, keepdims=True), LENGTHS, atol=1e-12)
    l1, l2, l3, l4 = shape.lengths.T
    np.testing.assert_allclose(shape.x0, (l2 + l3) ** 2 - (l1 + l4) ** 2)
    np.testing.assert_allclose(shape.y0, (l4 - l1) ** 2 - (l3 - l2) ** 2)
    pushed = unknowns
    for _ in range(3):  # a step is cut at a third of the whole
        pushed = chart.stepped(pushed, np.array([[0.0, -9, 0, 0], [9.0, 0, 0, -9]]))
    assert pushed[0, 1] == chart.LEAST and pushed[1, 3] == chart.LEAST and pushed[1, 0] < 0
    np.testing.assert_allclose(np.abs(pushed).sum(axis=1), 1.0, atol=1e-8)
    assert chart.held(pushed, np.ones((2, 4)))[[0, 1], [1, 3]].all()
    assert not chart.held(pushed, -np.ones((2, 4)))[:, 1:].any()
    # a trial a little past a bound: once a short link with it came out negative
    assert chart.shape(np.array([[1e-3, 0.5, -0.01, -0.01]])).lengths.min() > 0


def test_all_crank_angles_may_turn_together() -> None:
    # once each angle was cut by the gap to its neighbour, so that long valleys were followed in tiny steps
    problem, timed = candidates(GrashofChart(), False)
    none, turn = np.zeros((2, 10)), np.full(timed.angles.shape, 0.7)
    np.testing.assert_allclose(problem.moved(timed, none, turn).angles, timed.angles + 0.7, atol=1e-12)


@pytest.mark.parametrize("size", [1.0, 50.0, 1e200])
def test_any_step_of_the_crank_angles_keeps_their_order(size: float) -> None:
    problem, timed = candidates(GrashofChart(), False)
    random = np.random.default_rng(3)
    for way in (1.0, -1.0):
        here = timed._replace(angles=way * timed.angles)
        for _ in range(20):
            turn = size * random.standard_normal(here.angles.shape)
            here = problem.moved(here, np.zeros((2, 10)), turn)
            assert np.all(way * np.diff(here.angles, axis=1) > 0)
            assert np.all(np.ptp(here.angles, axis=1) <= 2 * np.pi * (1 + 1e-12))  # the sums' rounding
            here = here._replace(angles=here.angles - here.angles[:, :1])


def test_descents_leave_their_starting_points_as_they_were() -> None:
    problem, timed = candidates(GrashofChart(), False)
    before = [column.copy() for column in timed]
    problem.descended(timed, [Stage(10)])
    for column, kept in zip(timed, before):
        np.testing.assert_array_equal(column, kept)


def test_a_curved_valley_is_followed_to_its_end() -> None:
    # a short crank over a small span; by downhill steps with each angle cut by itself none of these arrived
    random = np.random.default_rng(1)
    chart, count = GrashofChart(), 40
    shape = chart.unknowns(np.array([[0.019, 0.14, 0.417, 0.424]]))
    angles = 0.4 + np.deg2rad(83) * np.sort(random.uniform(0, 1, (1, 12)), axis=1)
    coupler = chart.at(shape, angles, np.ones(1)).angle[0]
    position = 0.2 * np.exp(1j * angles[0]) + 1.1 * np.exp(1j * (coupler + 0.4))
    scale = float(np.max(np.abs(position - position.mean())))
    problem = JointProblem(Poses(None, position, length_scale=scale), chart)
    start = Timed(
        chart.hopped(np.repeat(shape, count, axis=0), random.standard_normal((count, 4))),
        np.zeros((count, 3), dtype=complex),
        np.zeros(count),
        angles + 0.5 * random.standard_normal((count, 1)),
        np.ones(count),
    )
    done = problem.descended(start, [Stage(60)], 1e-10, all_of_them=True)
    assert np.mean(done.cost < 1e-18) > 0.4


@pytest.mark.parametrize("order", ["given", "any"])
def test_few_at_a_time_are_aligned_as_all_at_once(order, monkeypatch) -> None:
    problem, timed = candidates(GrashofChart(), rotation=True)
    problem = JointProblem(replace(problem.poses, ordered=order == "given"), GrashofChart())
    known = np.array([2, 5, 9])
    some = timed.take(np.arange(7) % 2)
    some = some._replace(angles=some.angles[:, known] + np.linspace(0, 0.1, 7)[:, None])
    at_once = dyads.aligned(problem, some, known)
    if order == "given":  # also of the samples before the first known one
        assert np.all(np.diff(at_once.timed.angles, axis=1) > 0)
        assert np.abs(at_once.timed.angles[:, known] - some.angles).max() < 2 * np.pi / dyads._GRID
    monkeypatch.setattr(dyads, "_AT_ONCE", 1)
    few = dyads.aligned(problem, some, known)
    for one, other in zip((*at_once.timed, at_once.cost), (*few.timed, few.cost)):
        np.testing.assert_array_equal(one, other)
