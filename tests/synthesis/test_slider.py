"""Shapes of slider-cranks and swinging blocks agree with closed forms and their derivatives with differences.

A wrong closure, or digits lost beside a change point, would show here.
"""

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from synthesis.kernels import crank_loops
from synthesis.slider import (
    RAIL,
    SLOT,
    AnySliderChart,
    SliderChart,
    SliderCrankChart,
    SwingingBlockChart,
    excesses,
)

CHARTS = [SliderCrankChart(), SwingingBlockChart(), AnySliderChart(RAIL), AnySliderChart(SLOT)]
every_chart = pytest.mark.parametrize("chart", CHARTS, ids=["slider", "block", "any slider", "any block"])
unknown = st.floats(-3, 3).filter(lambda q: abs(q) > 1e-3)


def turned(guide: int, lengths: Any, crank: Any, derivatives: bool = False) -> Any:
    lengths = np.atleast_2d(np.asarray(lengths, dtype=float))
    crank = np.atleast_2d(np.asarray(crank, dtype=float))
    return crank_loops.body_angles(guide, lengths, *excesses(guide, lengths), np.ones(1), crank, derivatives)


@pytest.mark.parametrize(
    ("guide", "lengths", "angle", "slopes"),
    [
        (RAIL, (1, 2, 0.3), -13.475068128, (-0.393864763, 0.119809292, 0.514153933, -0.330491777)),
        (SLOT, (1, 2, 0.5), -48.154355394, (-0.670614768, 0.504673445, -0.677464242, 0.096091789)),
    ],
    ids=["slider-crank", "swinging block"],
)
def test_checkpoints_of_the_design_note(guide: int, lengths: Any, angle: float, slopes: Any) -> None:
    found, by, possible = turned(guide, lengths, np.deg2rad(50.0), True)
    assert possible[0, 0]
    assert np.rad2deg(found[0, 0]) == pytest.approx(angle, abs=1e-9)
    np.testing.assert_allclose(by[0, :, 0], slopes, atol=1e-9)


@every_chart
@given(p=unknown, w=unknown, theta1=st.floats(-20, 20))
def test_the_body_is_where_its_guide_says(chart: SliderChart, p: float, w: float, theta1: float) -> None:
    found = chart.at(np.array([[p, w]]), np.array([[theta1]]), np.ones(1), derivatives=False)
    (crank, long, offset), size = chart.shape(np.array([[p, w]])).lengths[0], 1e-12
    assert found.closes[0] or type(chart) is AnySliderChart
    assume(found.closes[0])
    pin, body = crank * np.exp(1j * theta1), np.exp(1j * found.angle[0, 0])
    if chart.guide == RAIL:
        assert (pin + long * body).imag == pytest.approx(offset, abs=size * (crank + long))
        assert body.real >= 0
    else:
        slot = (long - pin) * np.conj(body)
        assert slot.imag == pytest.approx(offset, abs=size * (crank + long))
        assert slot.real >= 0


@every_chart
def test_slopes_are_the_derivatives(chart: SliderChart) -> None:
    random = np.random.default_rng(3)
    q, theta1, side, h = random.uniform(0.2, 1.5, (60, 2)), random.uniform(0, 6, (60, 1)), np.ones(60), 1e-6
    found = chart.at(q, theta1, side)
    keep = found.closes
    for k in range(3):
        moved = [
            chart.at(q + sign * h * np.eye(3)[k, :2], theta1 + sign * h * (k == 2), side, False) for sign in (1, -1)
        ]
        keep = keep & moved[0].closes & moved[1].closes
        difference = (moved[0].angle - moved[1].angle)[:, 0] / (2 * h)
        np.testing.assert_allclose(found.slope[keep, k, 0], difference[keep], rtol=1e-5, atol=1e-6)
    assert keep.sum() > 20


@pytest.mark.parametrize("guide", [RAIL, SLOT])
def test_angles_are_exact_next_to_a_change_point(guide: int) -> None:
    from mpmath import mp, mpf

    mp.dps = 40
    chart: Any = SliderCrankChart() if guide == RAIL else SwingingBlockChart()
    q = np.array([[np.log(1e-12), 0.3]]) if guide == RAIL else np.array([[0.4, 14.0]])
    shape = chart.shape(q)
    close = -np.pi / 2 if guide == RAIL else 0.0
    theta1 = close + np.array([[-1e-3, 1e-5, 0.2]])
    found = chart.at(q, theta1, np.ones(1), False).angle[0]
    r = mpf(shape.lengths[0, 0])
    for value, t in zip(found, theta1[0]):
        t, x, y = mpf(t), mpf(shape.x0[0]), mpf(shape.y0[0])
        if guide == RAIL:
            e, rod = (y - x) / 2, r + (x + y) / 2
            expected = mp.asin((e - r * mp.sin(t)) / rod)
        else:
            d, h = mpf(shape.lengths[0, 1]), (y - x) / 2
            d = r - (x + y) / 2
            away = d - r * mp.expj(t)
            expected = mp.arg(away) - mp.asin(h / abs(away))
            expected += 2 * mp.pi * mp.nint((mpf(value) - expected) / (2 * mp.pi))
        assert abs(value - float(expected)) < 1e-13
