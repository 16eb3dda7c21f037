"""Poses without crank angles are met by all exact linkages for five poses, and by many for fewer.

A lost dyad, or a result that depends on the frame of the request, would show here.
"""

import numpy as np
import pytest

import linkage_atlas as la
from synthesis.descents import Stage
from synthesis.fourbar.mechanism import GrashofChart
from synthesis.free.dyads import Body, linear_dyads, polished
from synthesis.free.joint import JointProblem
from synthesis.poses import Poses, make_poses
from tests.conftest import some_of
from tests.oracles.free_classes import burmester_dyads, free_case, recompute_free
from tests.synthesis.test_descents import unposed

EXACT = 1e-9


def free(rotation, position, **more):
    """Return the answer of `la.synthesize` without further limits."""
    more["limits"] = {"preset": "none"} | more.get("limits", {})
    return la.synthesize(rotation, position, timing="free", **more)


def unlimited(case, **more):
    return free(np.rad2deg(case.rotation), case.position, **more)


def checked(case, found, rotation=None):
    """Objectives of all solutions, recomputed by circles; the order holds in each."""
    reported = [solution.to_dict() for solution in found.solutions]
    done = [
        recompute_free(case.position, case.rotation if rotation is None else rotation, values) for values in reported
    ]
    assert all(judged.one_way for judged in done)
    for values, own in zip(reported, done):
        assert own.objective == pytest.approx(values["errors"]["objective"], rel=1e-6, abs=1e-11)
    return np.array([solution.objective for solution in done])


@pytest.mark.parametrize("samples", [5, 8, 100])
def test_exact_motions_are_recovered(samples) -> None:
    for seed in range(3):
        case = free_case(seed, samples)
        found = unlimited(case, top=20)
        assert checked(case, found).min() < EXACT, seed
        assert found.status == "reached"
        links = np.sort([solution.linkage.links for solution in found.solutions], axis=1)
        truth = np.sort(case.lengths * case.scale)
        close = np.abs(links - truth).max(axis=1) < 1e-4 * truth.max()
        assert close.any() or found.best.determination.ill_posed, seed


@pytest.mark.parametrize("seed", some_of(range(50), 4))
def test_five_poses_have_the_dyads_that_brute_force_finds(seed) -> None:
    case = free_case(seed, 5)
    body = Body(make_poses(case.rotation, case.position))
    dyads, error = polished(body, linear_dyads(body))
    mine = dyads.take((error < 1e-9) & (np.abs(dyads.body) < 1e3) & (np.abs(dyads.fixed) < 1e3))
    remaining = burmester_dyads(case.position, case.rotation)
    for point, centre in remaining:
        close = np.abs(mine.body - point) + np.abs(mine.fixed - centre)
        assert close.min() < 1e-4 * (1 + abs(point) + abs(centre))
    assert len(remaining) <= mine.radius.size


@pytest.mark.parametrize("samples", [5, 8, 30])
def test_half_of_the_rotations_may_be_missing(samples) -> None:
    for seed in range(2):
        case = free_case(seed, samples)
        rotation = case.rotation.copy()
        rotation[np.random.default_rng(seed).permutation(samples)[: samples // 2]] = np.nan
        asked_for = [None if np.isnan(turn) else float(np.rad2deg(turn)) for turn in rotation]
        found = free(asked_for, case.position, top=3)
        assert checked(case, found, rotation).min() < EXACT, seed


def same_linkages(result: la.Result, expected: la.Result, scale: float = 1.0) -> None:
    """The exact linkages of both answers are the same, whatever their rank."""
    first, second = ([s.linkage.links for s in r.solutions if s.errors.objective < EXACT] for r in (result, expected))
    assert len(first) == len(second) > 0
    for links in first:
        assert min(np.abs(links * scale - theirs).max() for theirs in second) < 1e-6 * scale * links.max()


@pytest.mark.parametrize("seed", some_of(range(3), 1))
def test_moved_scaled_mirrored_and_reversed_requests_give_the_same_linkages(seed) -> None:
    case = free_case(seed, 7)
    turns, points = np.rad2deg(case.rotation), case.position
    found = free(turns, points)
    turned = np.exp(1j * np.deg2rad(33.0))
    same_linkages(found, free(turns + 33, points * turned + (70 - 20j)))
    same_linkages(found, free(turns, 1e-3 * points), 1e-3)
    mirrored = free(-turns, points.conj())
    same_linkages(found, mirrored)
    assert {s.linkage.branch for s in mirrored.solutions[:1]} == {-found.best.linkage.branch}
    backward = free(turns[::-1], points[::-1])
    same_linkages(found, backward)
    assert np.sign(backward.best.crank_angle[-1]) == -np.sign(found.best.crank_angle[-1])


def test_in_any_order_a_shuffled_request_gives_the_same_linkage() -> None:
    for seed in range(2):
        case = free_case(seed, 9)
        shuffle = np.random.default_rng(seed).permutation(9)
        found = free(np.rad2deg(case.rotation[shuffle]), case.position[shuffle], order="any")
        own = unlimited(case)
        best = found.best.to_dict()
        repeated = recompute_free(case.position[shuffle], case.rotation[shuffle], best)
        assert repeated.objective < EXACT
        crank = found.best.crank_angle
        assert crank[0] == 0 and crank.min() >= 0 and crank.max() < 360
        same_linkages(own, found)


def test_noisy_poses_are_fitted_no_worse_than_by_the_truth() -> None:
    random = np.random.default_rng(5)
    for seed in range(3):
        case = free_case(seed, 20)
        poses = make_poses(case.rotation, case.position)
        noise = random.standard_normal(20) + 1j * random.standard_normal(20)
        noise *= 1e-3 * poses.length_scale / np.sqrt(2)
        rotation = case.rotation + 1e-3 * random.standard_normal(20)
        noisy = Poses(rotation, case.position + noise, length_scale=poses.length_scale)
        problem = JointProblem(noisy, GrashofChart())
        truth = unposed(problem.chart.unknowns(case.lengths[None]), case.theta1[None], float(case.branch))
        polished_truth = problem.descended(problem.facing(truth), [Stage(200)])
        found = free(noisy.rotation, noisy.position, degrees=False, length_scale=poses.length_scale)
        assert found.best.errors.objective <= 1.01 * polished_truth.min_error, seed
