"""Representations of the slot: errors compared with independent values, and slots that cannot be represented.

The tests would detect stored parameters that do not reproduce the fit, and digits lost by a distant origin.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from synthesis.errors import FieldError
from synthesis.scenes.chain import crescent as chain
from synthesis.scenes.chain.fit import exact_slot, fit_error, fit_slot

REFERENCE = json.loads((Path(__file__).parents[3] / "reference" / "chain.json").read_text())


@pytest.fixture(scope="module")
def slot():
    return chain.crescent_slot(131.0, 16, 181.78)[1]


@pytest.fixture(scope="module")
def phases(slot):
    return np.linspace(slot.start, slot.end, 9001)


@pytest.mark.parametrize("kind", ["chebyshev", "spline"])
def test_errors_of_pieces_and_splines(kind, slot, phases) -> None:
    for order, (normal, chord) in REFERENCE["representations"][kind].items():
        fit = fit_slot(slot, kind, int(order))
        error = fit_error(slot, fit, exact_slot(slot, phases))
        assert error.normal == pytest.approx(normal, rel=0.03)
        assert error.chord == pytest.approx(chord, rel=0.03)
        assert fit.condition <= 3 + 1e-9


@pytest.mark.parametrize(("kind", "order"), [("chebyshev", 12), ("spline", 90), ("fourier", 16), ("polynomial", 12)])
def test_the_stored_numbers_are_the_fit(kind, order, slot, phases) -> None:
    """Evaluate the fit from the stored numbers only, as a reader of the reply would."""
    fit = fit_slot(slot, kind, order)
    phases = phases[::50]
    data = fit.data
    if kind == "chebyshev":
        expected = []
        for phase in phases:
            piece = next(p for p in data["pieces"] if p["phase"][0] <= phase <= p["phase"][1])
            a, b = piece["phase"]
            u = (2 * phase - a - b) / (b - a)
            x, y = (chebyshev.chebval(u, piece[axis]) + o for axis, o in zip("xy", data["origin"]))
            expected.append(complex(x, y))
    elif kind == "polynomial":
        x = slot.path(phases).real - data["origin"][0]
        low, high = data["x"]
        y = chebyshev.chebval((2 * x - low - high) / (high - low), data["coefficients"])
        assert data["angle"] == pytest.approx(0, abs=1e-12)
        expected = x + 1j * y + complex(*data["origin"])
    else:
        turn = 2 * np.pi * (phases - slot.start) / slot.chain.period
        if kind == "fourier":
            m = np.arange(order + 1)
            cos, sin = np.cos(turn[:, None] * m), np.sin(turn[:, None] * m[1:])
            along = cos @ data["along_cos"] + sin @ data["along_sin"]
            depth = cos @ data["depth_cos"] + sin @ data["depth_sin"]
        else:
            from scipy.interpolate import CubicSpline

            knots = [*data["phase"], data["phase"][0] + slot.chain.period]
            values = np.stack([data["along"], data["depth"]], axis=1)
            along, depth = CubicSpline(knots, [*values, values[0]], bc_type="periodic")(phases).T
        along = along + data["start"] + data["slope"] * (phases - slot.start)
        # the upper arc runs from the right through the bottom to the left
        expected = (181.78 + depth) * np.exp(-1j * along / 181.78)
    assert np.abs(fit.evaluate(phases) - expected).max() < 1e-9


@pytest.mark.parametrize(
    ("kind", "order"),
    [("chebyshev", 0), ("chebyshev", 65), ("spline", 3), ("fourier", 257), ("polynomial", 91), ("polynomial", 101)],
)
def test_orders_out_of_range(kind, order, slot) -> None:
    with pytest.raises(FieldError) as caught:
        fit_slot(slot, kind, order)
    assert caught.value.field == "/fit/order"
