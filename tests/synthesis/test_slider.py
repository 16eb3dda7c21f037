"""Shapes of slider-cranks and swinging blocks agree with closed forms and their derivatives with differences.

A wrong closure, or digits lost beside a change point, would show here.
"""

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from synthesis.slider import (
    RAIL,
    SLOT,
    AnySliderChart,
    SliderChart,
    SliderCrankChart,
    SwingingBlockChart,
)

CHARTS = [SliderCrankChart(), SwingingBlockChart(), AnySliderChart(RAIL), AnySliderChart(SLOT)]
every_chart = pytest.mark.parametrize("chart", CHARTS, ids=["slider", "block", "any slider", "any block"])
unknown = st.floats(-3, 3).filter(lambda q: abs(q) > 1e-3)


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
