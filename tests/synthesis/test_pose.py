"""The pose and the actual dimensions are the least-squares solution.

A pose that is not optimal, or that loses digits far from the origin, would show here.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.atlas.scan import Scan
from synthesis.four_bar import coupler_angle
from synthesis.pose import DEGENERATE, fit_positions, objective
from synthesis.target import Target, make_target

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


def test_an_exact_solution_over_a_short_span_is_found() -> None:
    # Regression: the bound of the position error exceeded the error if e^{i theta2} lies nearly in the span of {1, e^{it}}.
    crank = np.deg2rad(30 + np.linspace(0, 20, 16))
    theta2 = coupler_angle(LENGTHS, 1, crank)
    target = make_target(theta2, np.exp(1j * crank) + (1 + 0.7j) * np.exp(1j * theta2), crank_angle=crank)
    found, _ = Scan(LENGTHS[None].astype(int)).best(target, 1)
    assert (found.start[0], found.branch[0]) == (30, 1) and found.error[0] < 1e-12


def test_a_linkage_shrunk_to_a_point_is_rejected() -> None:
    # only the coupler contributes to the positions, so that z1 = 0 fits exactly
    crank = np.linspace(0, 2, 24)
    theta2 = coupler_angle(LENGTHS, 1, crank)
    for length, expected in ((0.0, np.inf), (DEGENERATE / 10, np.inf), (DEGENERATE * 100, 0.0)):
        target = make_target(position=np.exp(1j * theta2) + length * np.exp(1j * crank), crank_span=2.0)
        assert objective(target, theta2[None, :])[0] == pytest.approx(expected, abs=1e-12)
