"""Motions whose crank angles are given: J of candidates, and that descents lose nothing and come back to what is exact."""

import numpy as np
import pytest

from synthesis.descents import Stage, Timed
from synthesis.four_bar import close_loop, coupler_angle
from synthesis.fourbar.limits import Constraints, Limits
from synthesis.fourbar.mechanism import FOURBAR, AnyChart, FullCrankChart, GrashofChart
from synthesis.pose import objective
from synthesis.search import problems
from synthesis.search.problems import GivenProblem
from synthesis.target import Target, make_target

KINDS = ("both", "rotation", "position")
CHARTS = [FullCrankChart(), AnyChart(), GrashofChart()]
charts = pytest.mark.parametrize("chart", CHARTS, ids=["full crank", "any", "grashof"])


def random_target(seed: int, kind: str = "both", samples: int = 16, weighted: bool = False) -> Target:
    """Smooth curves that no linkage is bound to perform, over uneven crank angles; with random weights, or all alike."""
    random = np.random.default_rng(seed)
    crank = np.concatenate([[0.0], np.cumsum(random.uniform(0.1, 0.4, samples - 1))])
    wave = random.standard_normal((3, 3)) @ np.sin(np.outer([1, 2, 3], crank) + random.uniform(0, 6, (3, 1)))
    rotation = None if kind == "position" else wave[0]
    position = None if kind == "rotation" else wave[1] + 1j * wave[2] + complex(*random.uniform(-3, 3, 2))
    weights = random.uniform(0.2, 3, (2, samples)) * (np.arange(samples) % 4 != [[1], [2]])
    turns, places = (weighted and kind != other for other in ("position", "rotation"))
    weighed = {"rotation_weights": weights[0] if turns else None, "position_weights": weights[1] if places else None}
    return make_target(rotation, position, crank_angle=crank, **weighed)


def drawn(chart: AnyChart | FullCrankChart | GrashofChart, seed: int, count: int, reach: float) -> Timed:
    """Random candidates."""
    random = np.random.default_rng(seed)
    shape = random.uniform(-reach, reach, (count, 3))
    if isinstance(chart, GrashofChart):
        shape = chart.unknowns(FullCrankChart().shape(shape).lengths)
    return problems.given(shape, random.choice([-1.0, 1.0], count), random.uniform(-9, 9, count))


@pytest.mark.parametrize("weighted", [False, True], ids=["all alike", "weighted"])
@pytest.mark.parametrize("kind", KINDS)
@charts
def test_cost_is_the_square_of_the_objective(chart, kind, weighted) -> None:
    target, timed = random_target(3, kind, weighted=weighted), drawn(chart, 4, 400, 1.5)
    lengths = chart.shape(timed.shape).lengths
    closure = close_loop(lengths, timed.angles + target.crank)
    sure = closure.closed.all(axis=1) & (np.where(closure.closed, closure.transmission_angle, 0.0).min(axis=1) > 0.15)
    problem, timed = GivenProblem(target, chart), timed.take(sure)
    found = problem.measured(timed)
    kept = np.isfinite(found.cost)  # the others open between the samples
    angle = coupler_angle(lengths[sure], timed.branch, timed.angles + target.crank)
    assert kept.sum() > 40
    np.testing.assert_allclose(found.cost[kept], objective(target, angle[kept]) ** 2, rtol=1e-10)
    linkages = problem.linkages(FOURBAR, found.take(kept))
    errors = [one.errors.objective for one in FOURBAR.assess(target, linkages)]
    np.testing.assert_allclose(np.sqrt(found.cost[kept]), errors, rtol=1e-8)


@pytest.mark.parametrize("posed", [False, True], ids=["of shape and start", "posed"])
def test_linkages_are_in_the_pose_that_limits_leave_them(posed) -> None:
    target, chart = random_target(5), GrashofChart()
    limits = Limits(pivot_a=target.middle + 2) if posed else Limits(transmission_angle_min=0.6)
    frame = (target.middle, target.length_scale) if posed else (0j, 1.0)
    constraints = Constraints(limits, *frame, exact=False)
    problem = GivenProblem(target, chart, constraints, posed)
    start = GivenProblem(target, chart).measured(drawn(chart, 6, 40, 1.5)).timed
    found = problem.descended(start, [Stage(20, weight=weight) for weight in (3.0, 30.0, 300.0)])
    found, broken = problem.moved_onto(found.timed)
    found = found.take((broken < 1e-13) & np.isfinite(found.cost))
    assert found.cost.size > 20
    linkages = problem.linkages(FOURBAR, found)
    errors = [one.errors.objective for one in FOURBAR.assess(target, linkages)]
    np.testing.assert_allclose(np.sqrt(found.cost), errors, rtol=1e-8)
    if posed:
        np.testing.assert_allclose([one.pivot_a for one in linkages], limits.pivot_a, rtol=1e-12)


def test_a_linkage_that_opens_between_samples_is_no_answer() -> None:
    # L1 + L4 > L2 + L3: open around theta1 = pi, which lies between the second sample and the third
    target = make_target(np.array([0.0, 0.1, 0.4]), crank_angle=np.array([0.0, 0.1, 2.0]))
    lengths, across = np.array([[1.0, 1.2, 1.2, 1.5]]), np.pi - 1.0
    shape = np.repeat(AnyChart().unknowns(lengths), 2, axis=0)
    assert close_loop(lengths, across + target.crank).closed.all()
    timed = problems.given(shape, np.ones(2), np.array([across, np.pi + 1.0]))
    assert np.isinf(GivenProblem(target, AnyChart()).measured(timed).cost).tolist() == [True, False]


@pytest.mark.parametrize("sheet", [-1, 1])
def test_a_sheet_is_never_left(sheet) -> None:
    chart = FullCrankChart(sheet)
    done = GivenProblem(random_target(9), chart).descended(drawn(chart, 10, 60, 2), [Stage(30)])
    kept = np.isfinite(done.cost)
    assert kept.any() and np.all(np.sign(done.timed.shape[kept, 0]) == sheet)
