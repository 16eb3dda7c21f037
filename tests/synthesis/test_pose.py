"""The pose and the actual dimensions are the least-squares solution, and the worked example is recovered from the atlas.

A pose that is not optimal, or that loses digits far from the origin, would show here.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import linkage_atlas as la
from synthesis.atlas.scan import Scan
from synthesis.four_bar import coupler_angle
from synthesis.fourbar.mechanism import FOURBAR, mounted
from synthesis.limits import Limits
from synthesis.linkage import Linkage
from synthesis.pose import DEGENERATE, fit_positions, objective
from synthesis.search.atlas_rows import best_rows
from synthesis.target import Target, make_target
from tests.oracles.conditions import position_condition
from tests.oracles.four_bar_joints import body_point

LENGTHS = np.array([19.0, 72, 144, 165])
laws = settings(derandomize=True, max_examples=30, deadline=None)


def motion(seed: int, span: float = 2.0, noise: float = 0.0, weighted: bool = False) -> tuple[Target, np.ndarray]:
    """Return a motion of `LENGTHS` in a random pose, and theta2; with weights, a third of the samples is missing."""
    rng = np.random.default_rng(seed)
    crank = np.linspace(0, span, 24)
    theta2 = coupler_angle(LENGTHS, 1, rng.uniform(0, 6) + crank)
    pivot, z1, z2, *deviations = rng.normal(size=27) + 1j * rng.normal(size=27)
    position = pivot + z1 * np.exp(1j * crank) + z2 * np.exp(1j * theta2) + noise * np.array(deviations)
    weights = rng.uniform(0.1, 3, 24) * (np.arange(24) % 3 > 0) if weighted else None
    return make_target(position=position, crank_span=span, position_weights=weights), theta2


@laws
@given(st.integers(0, 10**6), st.sampled_from([0.0, 0.3]), st.sampled_from([0.5, 2.0, -5.0]), st.booleans())
def test_no_other_pose_is_better(seed, noise, span, weighted) -> None:
    target, theta2 = motion(seed, span, noise, weighted)
    mean = target.position_mean
    fit = fit_positions(target, theta2[None, :])
    columns = np.stack([np.ones(24), np.exp(1j * target.crank), np.exp(1j * theta2)])
    pose = np.array([fit.pivot[0], fit.crank_vector[0], fit.coupler_vector[0]])
    assert np.allclose(target.position - pose @ columns, fit.residual[0], rtol=0, atol=1e-11)
    minimum = mean(np.abs(fit.residual) ** 2)[0]
    rng = np.random.default_rng(seed)
    for size in (1e-3, 1e-1, 10.0):
        moved = pose + size * (rng.normal(size=3) + 1j * rng.normal(size=3))
        assert mean(np.abs(target.position - moved @ columns) ** 2) >= minimum
    assert noise or np.sqrt(minimum) < 1e-13


@pytest.mark.parametrize(
    ("scale", "offset"), [(1.0, 0), (1e-9, 0), (1e9, 0), (1.0, 1e6 - 3e5j), (1e-9, 1e-3), (1e9, 1e15j)]
)
def test_pose_follows_the_motion(scale, offset) -> None:
    target, theta2 = motion(4)
    moved = make_target(position=scale * target.position + offset, crank_span=target.interval.last)
    before, after = (fit_positions(case, theta2[None, :]) for case in (target, moved))
    # An offset of 10^6 times the size leaves ten digits of the positions, and the condition of the fit costs some more.
    lost = 1e-12 + 1e-16 * abs(offset) / scale * position_condition(target.crank, theta2)
    for name in ("crank_vector", "coupler_vector"):
        assert getattr(after, name)[0] / scale == pytest.approx(getattr(before, name)[0], abs=4 * lost)
    assert (after.pivot[0] - offset) / scale == pytest.approx(before.pivot[0], abs=4 * lost)
    assert np.sqrt(np.mean(np.abs(after.residual) ** 2)) / scale < 4 * lost


def test_mounting_places_the_body_point_as_fitted() -> None:
    target, theta2 = motion(5, noise=0.1)
    fit = fit_positions(target, theta2[None, :])
    for start in (0.0, 2.0, -40.0):
        angle = coupler_angle(LENGTHS, 1, start + target.crank)
        fit_at_start = fit_positions(target, angle[None, :])
        (linkage,) = mounted(target, LENGTHS[None], [1], [start])
        check_pose(linkage, target, angle, fit_at_start.residual[0])
        # Build the same linkage from its pose.
        rotation = np.angle(fit_at_start.crank_vector) - start
        pose = fit_at_start.pivot, rotation, fit_at_start.coupler_vector
        (posed,) = FOURBAR.posed(np.array([linkage.links]), np.array([1]), np.array([start]), pose)
        check_pose(posed, target, angle, fit_at_start.residual[0])
    best = mounted(target, LENGTHS[None], [1], [true_start(5)])[0]
    check_pose(best, target, theta2, fit.residual[0])


def true_start(seed: int) -> float:
    """Return the crank angle at which the motion of `motion` starts."""
    return np.random.default_rng(seed).uniform(0, 6)


def check_pose(linkage: Linkage, target: Target, theta2: np.ndarray, residual: np.ndarray) -> None:
    point = body_point(linkage, linkage.start + target.crank, theta2)
    assert np.allclose(target.position - point, residual, rtol=0, atol=1e-12)
    ground = linkage.pivot_b - linkage.pivot_a
    scale = linkage.links[0] / LENGTHS[0]
    assert np.allclose(linkage.links, scale * LENGTHS, rtol=1e-14)
    assert abs(ground) == pytest.approx(scale * LENGTHS[3])
    assert np.angle(ground) == pytest.approx(linkage.ground_angle)
    radius, angle = linkage.coupler_point_polar
    assert scale > 0 and radius >= 0
    assert -np.pi < linkage.ground_angle <= np.pi and -np.pi < angle <= np.pi


def test_a_linkage_shrunk_to_a_point_is_rejected() -> None:
    # Only the coupler contributes to the positions, so that z1 = 0 fits exactly.
    crank = np.linspace(0, 2, 24)
    theta2 = coupler_angle(LENGTHS, 1, crank)
    for length, expected in ((0.0, np.inf), (DEGENERATE / 10, np.inf), (DEGENERATE * 100, 0.0)):
        target = make_target(position=np.exp(1j * theta2) + length * np.exp(1j * crank), crank_span=2.0)
        assert objective(target, theta2[None, :])[0] == pytest.approx(expected, abs=1e-12)


def test_a_linkage_that_does_not_close_has_an_infinite_objective() -> None:
    target, theta2 = motion(6)
    with_gap = np.where(np.arange(24) == 3, np.nan, theta2)
    found = objective(target, np.stack([theta2, with_gap]))
    assert found[0] < 1e-12 and found[1] == np.inf


# -- the worked example -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def default_scan(atlas_path) -> Scan:
    """Open the scan of the atlas that the tests of the service build or use."""
    return la.load_atlas(atlas_path).scan


@pytest.mark.parametrize(("scale", "offset"), [(1.0, 0.0), (1e-9, 2e7)], ids=["as_is", "small_and_far"])
def test_worked_example_is_recovered(default_scan, scale, offset) -> None:
    theta4, beta = np.deg2rad([30, 45])
    crank = np.deg2rad(np.linspace(30, 100, 16))
    theta2 = coupler_angle(LENGTHS, 1, crank)
    pivot = 10 * np.exp(1j * beta) + offset
    position = pivot + 19 * np.exp(1j * (crank + theta4)) + 20 * np.exp(1j * (np.deg2rad(60) + theta2 + theta4))
    target = make_target(theta2 - 0.8012, scale * position, crank_angle=crank)
    solutions, report = best_rows(default_scan, target, Limits(), 3)
    assert report.exhaustive
    best = solutions[0]
    assert (best.row + 1, best.linkage.branch) == (45_185, 1)
    linkage = best.linkage
    radius, angle = linkage.coupler_point_polar
    assert np.rad2deg(linkage.start) == pytest.approx(30)
    digits = 1e-6 if not offset else 1e-3
    assert np.array(linkage.links) / scale == pytest.approx(LENGTHS, rel=digits)
    assert np.rad2deg(linkage.ground_angle) == pytest.approx(30, abs=100 * digits)
    assert np.rad2deg(angle) == pytest.approx(60, abs=100 * digits)
    assert radius / scale == pytest.approx(20, rel=digits)
    assert linkage.pivot_a / scale == pytest.approx(pivot, abs=10 * digits)
    assert linkage.body_offset + theta4 == pytest.approx(-0.8012, abs=digits)
    assert best.errors.objective < digits
    objectives = [solution.errors.objective for solution in solutions]
    assert objectives == sorted(objectives) and len({s.row for s in solutions}) == 3


def test_an_exact_solution_over_a_short_span_is_found(default_scan) -> None:
    # Regression: the bound of the position error exceeded the error if e^{i theta2} lies nearly in the span of {1, e^{it}}.
    crank = np.deg2rad(30 + np.linspace(0, 20, 16))
    theta2 = coupler_angle(LENGTHS, 1, crank)
    target = make_target(theta2, np.exp(1j * crank) + (1 + 0.7j) * np.exp(1j * theta2), crank_angle=crank)
    found, _ = default_scan.best(target, 1)
    assert (found.row[0] + 1, found.start[0], found.branch[0]) == (45_185, 30, 1) and found.error[0] < 1e-12
