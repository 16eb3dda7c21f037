"""Charts of four-bars return to the same lengths, and their derivatives agree with differences.

Cancellation beside a change point would show here.
"""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from synthesis.four_bar import close_loop
from synthesis.fourbar.mechanism import AnyChart, FullCrankChart, GrashofChart

CHARTS = [FullCrankChart(), AnyChart()]
LAW = settings(derandomize=True, deadline=None, max_examples=200)
moderate = st.floats(-4, 4).filter(lambda value: abs(value) > 1e-3)
points = st.tuples(moderate, moderate, moderate).map(lambda point: np.array([point]))


def rounding(point: np.ndarray, lengths: np.ndarray) -> float:
    """Return the rounding error of the excesses whose logarithms are the unknowns of the full-crank chart."""
    p, u, w = point[0]
    smallest = min(np.exp(u), np.abs(np.tanh(p / 2)) * (1 - np.abs(np.tanh(w))), 1.0)
    return 8 * np.finfo(float).eps * lengths.max() / smallest


@LAW
@given(points)
@example(np.array([[1 / 128, 1.0, 4.0]]))  # crank and ground nearly equal: a tolerance of 1e-11 was too strict
def test_charts_return_to_the_same_point(point) -> None:
    for chart in CHARTS:
        lengths = chart.shape(point).lengths
        largest = 1e-13 if isinstance(chart, AnyChart) else rounding(point, lengths)
        np.testing.assert_allclose(chart.unknowns(lengths), point, rtol=0, atol=largest)


@pytest.mark.parametrize(
    "chart", [*CHARTS, FullCrankChart(1), GrashofChart()], ids=["full", "any", "double-cranks", "grashof"]
)
def test_angles_and_slopes_are_those_of_the_closed_loop(chart) -> None:
    random = np.random.default_rng(4)
    count, size = 300, len(chart.cell) - 1
    points = random.uniform(0.1, 1.5, (count, size)) * np.where(random.random((count, size)) < 0.5, -1, 1)
    if isinstance(chart, GrashofChart):
        points = chart.within(points)
    theta1, branch = random.uniform(-9, 9, (count, 5)), random.choice([-1.0, 1.0], count)
    shape, found = chart.shape(points), chart.at(points, theta1, branch)
    loop = close_loop(shape.lengths, theta1)
    of_sheet = shape.lengths[:, 0] > shape.lengths[:, 3] if chart.sheet else np.ones(count, dtype=bool)
    np.testing.assert_array_equal(found.closes, loop.closed.all(axis=1) & of_sheet)
    selected = found.closes & (loop.transmission_angle.min(axis=1) > 1e-3)
    assert (selected.sum() > 20) and (selected.all() or isinstance(chart, AnyChart) or chart.sheet)
    np.testing.assert_allclose(found.angle[selected], loop.coupler_angle(branch)[selected], rtol=0, atol=1e-12)
    by_length = loop.coupler_angle_gradient(branch)
    by_shape = np.einsum("njl,nlc->ncj", by_length[..., :4], shape.jacobian)
    expected = np.concatenate([by_shape, by_length[..., 4][:, None]], axis=1)
    np.testing.assert_allclose(found.slope[selected], expected[selected], rtol=1e-7, atol=1e-9)
    np.testing.assert_array_equal(chart.at(points, theta1, branch, derivatives=False).angle, found.angle)
