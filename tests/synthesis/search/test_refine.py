"""Refinement: derivatives, and that nothing gets worse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.fourbar.charts import AnyChart, FullCrankChart
from synthesis.fourbar.kinematics import close_loop, coupler_angle
from synthesis.least_squares import Evaluation, Minima, minimise
from synthesis.pose import objective
from synthesis.search.problems import ProjectedProblem
from synthesis.target import Target, make_target
from synthesis.work import Work

KINDS = ("both", "rotation", "position")
CHARTS = [FullCrankChart(), AnyChart()]
LAW = settings(derandomize=True, deadline=None, max_examples=25)


def refine(problem: ProjectedProblem, *arguments: object, **options: object) -> Minima:
    return minimise(problem.evaluate, *arguments, **options)


def random_target(seed: int, kind: str = "both", samples: int = 16, weighted: bool = False) -> Target:
    """Smooth curves that no linkage is bound to perform, over uneven crank angles; with random weights, or all alike."""
    random = np.random.default_rng(seed)
    crank = np.concatenate([[0.0], np.cumsum(random.uniform(0.1, 0.4, samples - 1))])
    wave = random.standard_normal((3, 3)) @ np.sin(np.outer([1, 2, 3], crank) + random.uniform(0, 6, (3, 1)))
    rotation = None if kind == "position" else wave[0]
    position = None if kind == "rotation" else wave[1] + 1j * wave[2] + complex(*random.uniform(-3, 3, 2))
    weights = random.uniform(0.2, 3, (2, samples)) * (np.arange(samples) % 4 != [[1], [2]])
    return make_target(
        rotation,
        position,
        crank_angle=crank,
        rotation_weights=weights[0] if weighted and kind != "position" else None,
        position_weights=weights[1] if weighted and kind != "rotation" else None,
    )


def closing_candidates(problem: ProjectedProblem, seed: int, count: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Random unknowns that close, away from the edge of closing, and branches."""
    random = np.random.default_rng(seed)
    unknowns = np.column_stack([random.uniform(-1.5, 1.5, (4000, 3)), random.uniform(0, 6, 4000)])
    branch = random.choice([-1.0, 1.0], len(unknowns))
    lengths = problem.chart.shape(unknowns[:, :3]).lengths
    closure = close_loop(lengths, unknowns[:, 3:] + problem.target.crank)
    angles = np.where(closure.closed, closure.transmission_angle, 0.0).min(axis=1)
    cost = problem.evaluate(unknowns, branch, derivatives=False).cost
    good = np.flatnonzero(np.isfinite(cost) & (angles > 0.15) & (np.abs(unknowns[:, 0]) > 0.05))[:count]
    assert len(good) == count
    return unknowns[good], branch[good]


@pytest.mark.parametrize("weighted", [False, True], ids=["all alike", "weighted"])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("chart", CHARTS, ids=lambda chart: type(chart).__name__)
def test_cost_is_the_square_of_the_objective_and_its_jacobian_that_of_differences(chart, kind, weighted) -> None:
    problem = ProjectedProblem(random_target(3, kind, weighted=weighted), chart)
    unknowns, branch = closing_candidates(problem, 4)
    crank = unknowns[:, 3:] + problem.target.crank
    angle = coupler_angle(chart.shape(unknowns[:, :3]).lengths, branch, crank)
    cost = problem.evaluate(unknowns, branch).cost
    np.testing.assert_allclose(cost, objective(problem.target, angle) ** 2, rtol=1e-10)
    analytic = problem.evaluate(unknowns, branch).stack[:, :4]
    for k in range(4):
        step = np.zeros(4)
        step[k] = 1e-6
        ahead = problem.evaluate(unknowns + step, branch, derivatives=False).stack[:, 4]
        behind = problem.evaluate(unknowns - step, branch, derivatives=False).stack[:, 4]
        scale = 1 + np.abs(analytic[:, k]).max(axis=1, keepdims=True)
        assert np.max(np.abs(analytic[:, k] - (ahead - behind) / 2e-6) / scale) < 1e-6


def test_a_linkage_that_opens_between_samples_is_no_answer() -> None:
    # L1 + L4 > L2 + L3: open around theta1 = pi, which lies between the second sample and the third
    target = make_target(np.array([0.0, 0.1, 0.4]), crank_angle=np.array([0.0, 0.1, 2.0]))
    lengths = np.array([[1.0, 1.2, 1.2, 1.5]])
    shape = AnyChart().unknowns(lengths)[0]
    across, beside = np.array([*shape, np.pi - 1.0]), np.array([*shape, np.pi + 1.0])
    assert close_loop(lengths, across[3] + target.crank).closed.all()
    costs = ProjectedProblem(target, AnyChart()).evaluate(np.array([across, beside]), np.ones(2)).cost
    assert np.isinf(costs[0]) and np.isfinite(costs[1])


@LAW
@given(st.integers(0, 10_000), st.sampled_from(KINDS), st.sampled_from(CHARTS))
def test_no_candidate_is_worse_than_its_seed(seed, kind, chart) -> None:
    problem = ProjectedProblem(random_target(seed, kind), chart)
    random = np.random.default_rng(seed)
    reach = 1 if isinstance(chart, AnyChart) else 6
    unknowns = np.column_stack([random.uniform(-reach, reach, (30, 3)), random.uniform(-9, 9, 30)])
    branch = random.choice([-1.0, 1.0], 30)
    before = problem.evaluate(unknowns, branch).cost
    done = refine(problem, unknowns, branch, 15)
    assert np.all(done.cost <= before)
    # what is returned belongs together; other batches sum in another order, which counts where q nearly vanishes
    np.testing.assert_allclose(problem.evaluate(done.unknowns, branch).cost, done.cost, rtol=1e-6, atol=1e-28)


@pytest.mark.parametrize("sheet", [-1, 1])
def test_a_sheet_is_never_left(sheet) -> None:
    problem = ProjectedProblem(random_target(9), FullCrankChart(sheet))
    random = np.random.default_rng(10)
    unknowns = np.column_stack([random.uniform(-2, 2, (60, 3)), random.uniform(0, 6, 60)])
    done = refine(problem, unknowns, np.ones(60), 30)
    kept = np.isfinite(done.cost)
    assert kept.any() and np.all(np.sign(done.unknowns[kept, 0]) == sheet)


def exact_target(kind: str = "both") -> tuple[Target, np.ndarray]:
    """A target that a linkage performs, and its unknowns; branch +1."""
    lengths = np.array([[1.0, 2.6, 3.1, 3.7]])
    crank = np.linspace(0, 4.0, 20)
    angle = coupler_angle(lengths, np.ones(1), 0.7 + crank)[0]
    position = 3 - 2j + np.exp(1j * (0.7 + crank)) + 1.4j * np.exp(1j * angle)
    target = make_target(
        None if kind == "position" else angle + 0.3, None if kind == "rotation" else position, crank_angle=crank
    )
    return target, np.column_stack([FullCrankChart().unknowns(lengths), [0.7]])


@pytest.mark.parametrize("kind", KINDS)
def test_refinement_from_nearby_reaches_rounding(kind) -> None:
    target, truth = exact_target(kind)
    problem = ProjectedProblem(target, FullCrankChart())
    done = refine(problem, truth + np.array([0.05, -0.05, 0.05, 0.03]), np.ones(1), 50)
    assert np.sqrt(done.cost[0]) < 1e-13
    np.testing.assert_allclose(done.unknowns, truth, atol=1e-8)


def test_refinement_ends_at_the_tolerance_and_when_time_is_up() -> None:
    target, truth = exact_target()
    problem, seed = ProjectedProblem(target, FullCrankChart()), truth + 0.05
    asked = []

    def evaluate(*candidates: np.ndarray) -> Evaluation:
        asked.append(candidates)
        return problem.evaluate(*candidates)

    minimise(evaluate, seed, np.ones(1), 50)
    free = len(asked)
    loose = minimise(evaluate, seed, np.ones(1), 50, tolerance=1e-4)
    assert np.sqrt(loose.cost[0]) < 1e-4 and len(asked) - free < free
    asked.clear()
    late = minimise(evaluate, seed, np.ones(1), 50, work=Work(0.0))
    assert len(asked) == 1, "the seed itself, and no step"
    np.testing.assert_array_equal(late.unknowns, seed)


def test_candidates_do_not_touch_one_another() -> None:
    problem = ProjectedProblem(random_target(11), FullCrankChart())
    unknowns, branch = closing_candidates(problem, 12, 10)
    together = refine(problem, unknowns, branch, 10)
    alone = [refine(problem, unknowns[k : k + 1], branch[k : k + 1], 10).unknowns[0] for k in range(len(branch))]
    np.testing.assert_allclose(together.unknowns, alone, rtol=1e-6, atol=1e-6)


def test_the_unit_of_length_does_not_matter() -> None:
    target, truth = exact_target()
    for scale in (2.0**-30, 2.0**30):
        scaled = replace(target, position=target.position * scale, length_scale=target.length_scale * scale)
        ours, theirs = (
            ProjectedProblem(one, FullCrankChart()).evaluate(truth + 0.1, np.ones(1)) for one in (target, scaled)
        )
        np.testing.assert_array_equal(ours.cost, theirs.cost)
        np.testing.assert_array_equal(ours.stack, theirs.stack)
