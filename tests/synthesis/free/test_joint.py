"""The joint refinement against a naive twin with all crank angles as unknowns, and its derivatives against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from synthesis.fourbar.charts import FullCrankChart, GrashofChart
from synthesis.free import dyads, joint
from synthesis.free.joint import JointProblem, Timed, refine
from synthesis.free.poses import Poses

LENGTHS = np.array([[0.15, 0.3, 0.25, 0.3], [0.4, 0.25, 0.28, 0.07]])
CHARTS = [FullCrankChart(), GrashofChart()]


def candidates(chart: FullCrankChart | GrashofChart, rotation: bool) -> tuple[JointProblem, Timed]:
    """Two candidates, a crank-rocker and a double-crank, some way off some poses."""
    random = np.random.default_rng(7)
    samples = 11
    position = np.cumsum(random.standard_normal(samples) + 1j * random.standard_normal(samples))
    turned = np.cumsum(random.uniform(0, 0.3, samples)) if rotation else None
    problem = JointProblem(Poses(turned, position, length_scale=2.0), chart)
    angles = np.sort(random.uniform(0, 5, (2, samples)), axis=1)
    timed = Timed(
        chart.unknowns(LENGTHS), np.zeros((2, 3), dtype=complex), np.zeros(2), angles, np.array([1.0, -1.0])
    )
    return problem, problem.posed(timed, problem.turned(timed))


@pytest.mark.parametrize("chart", CHARTS)
@pytest.mark.parametrize("rotation", [False, True])
def test_derivatives_are_those_of_the_residual(chart: FullCrankChart | GrashofChart, rotation: bool) -> None:
    problem, timed = candidates(chart, rotation)
    rows = problem.evaluate(timed, problem.turned(timed))
    size = problem.size

    def moved(column: int, by: float) -> np.ndarray:
        shape, pose, offset = timed.shape.copy(), timed.pose.copy(), timed.offset.copy()
        if column < size:
            shape[:, column] += by
        elif column < size + 6:
            pose[:, (column - size) // 2] += by * (1j if (column - size) % 2 else 1.0)
        else:
            offset += by
        trial = timed._replace(shape=shape, pose=pose, offset=offset)
        return problem.residual(trial, problem.turned(trial, derivatives=False))

    step = 1e-6
    for column in range(problem.columns):
        difference = (moved(column, step) - moved(column, -step)) / (2 * step)
        np.testing.assert_allclose(rows.stack[:, column], difference, atol=1e-7)
    ahead, behind = (
        problem.residual(t, problem.turned(t, derivatives=False))
        for t in (timed._replace(angles=timed.angles + by) for by in (step, -step))
    )
    np.testing.assert_allclose(rows.turn, (ahead - behind) / (2 * step), atol=1e-7)


@pytest.mark.parametrize("damping", [1e-2, 1e-12], ids=["by normal equations", "by reflections"])
@pytest.mark.parametrize("rotation", [False, True])
def test_step_is_that_of_dense_least_squares_over_all_angles(damping: float, rotation: bool) -> None:
    problem, timed = candidates(FullCrankChart(), rotation)
    rows = problem.evaluate(timed, problem.turned(timed))
    system = joint._damped(rows, np.full(2, damping), problem.size)
    step, angle_step = joint._step(system)
    samples, columns = problem.poses.samples, problem.columns
    for k in range(2):
        common = rows.stack[k, :-1].reshape(columns, -1).T
        own = np.vstack([np.diag(row) for row in rows.turn[k]])
        ridge_own = system.inner[k] - np.sum(rows.turn[k] ** 2, axis=0)
        ridge = np.concatenate([system.ridge[k], np.maximum(ridge_own, 0)])
        dense = np.vstack([np.hstack([common, own]), np.diag(np.sqrt(ridge))])
        right = np.concatenate([-rows.stack[k, -1].ravel(), np.zeros(columns + samples)])
        expected = np.linalg.lstsq(dense, right, rcond=None)[0]
        scale = np.abs(expected).max()
        # the angles' damping is recovered here from a difference, which at small damping keeps only some digits
        np.testing.assert_allclose(np.concatenate([step[k], angle_step[k]]), expected, atol=1e-4 * scale)


@pytest.mark.parametrize("chart", CHARTS)
def test_refinement_never_gets_worse_and_keeps_the_order(chart: FullCrankChart | GrashofChart) -> None:
    problem, timed = candidates(chart, False)
    before = problem.evaluate(timed, problem.turned(timed)).cost
    done = refine(problem, timed, 30)
    assert np.all(done.cost <= before)
    assert np.all(np.diff(done.timed.angles, axis=1) > 0)
    assert np.all(np.ptp(done.timed.angles, axis=1) < 2 * np.pi)


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
    none, turn = np.zeros((2, problem.columns)), np.full(timed.angles.shape, 0.7)
    np.testing.assert_allclose(problem.moved(timed, none, turn).angles, timed.angles + 0.7, atol=1e-12)


@pytest.mark.parametrize("size", [1.0, 50.0, 1e200])
def test_any_step_of_the_crank_angles_keeps_their_order(size: float) -> None:
    problem, timed = candidates(GrashofChart(), False)
    random = np.random.default_rng(3)
    for way in (1.0, -1.0):
        here = timed._replace(angles=way * timed.angles)
        for _ in range(20):
            turn = size * random.standard_normal(here.angles.shape)
            here = problem.moved(here, np.zeros((2, problem.columns)), turn)
            assert np.all(way * np.diff(here.angles, axis=1) > 0)
            assert np.all(np.ptp(here.angles, axis=1) <= 2 * np.pi * (1 + 1e-12))  # the sums' rounding
            here = here._replace(angles=here.angles - here.angles[:, :1])


def test_descents_leave_their_starting_points_as_they_were() -> None:
    problem, timed = candidates(GrashofChart(), False)
    before = [column.copy() for column in timed]
    refine(problem, timed, 10)
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
    done = refine(problem, start, 60, 1e-10, all_of_them=True)
    assert np.mean(done.cost < 1e-18) > 0.4


@pytest.mark.parametrize("damping", [1e-3, 1e-12])
def test_few_at_a_time_descend_as_all_at_once(damping, monkeypatch) -> None:
    """By normal equations and by reflections."""
    problem, timed = candidates(GrashofChart(), rotation=True)
    many = timed.take(np.arange(12) % 2)
    many = many._replace(shape=many.shape * np.linspace(0.9, 1.1, 12)[:, None])

    def descended() -> list[np.ndarray]:
        found = refine(problem, many, 40, damping=damping)
        return [*found.timed, found.cost]

    at_once = descended()
    monkeypatch.setattr(joint, "_AT_ONCE", 1)
    for one, other in zip(at_once, descended()):
        np.testing.assert_array_equal(one, other)


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
