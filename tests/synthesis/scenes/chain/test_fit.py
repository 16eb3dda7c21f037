"""The fit of the slot: errors compared with independent values.

The tests would detect stored coefficients that do not reproduce the fit, and digits lost by a distant origin.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from synthesis.scenes.chain import crescent as chain
from synthesis.scenes.chain.fit import exact_slot, fit_error, fit_slot

REFERENCE = json.loads((Path(__file__).parents[3] / "reference" / "chain.json").read_text())


@pytest.mark.parametrize(("order", "errors"), REFERENCE["fit"].items())
def test_the_coefficients_are_the_fit_and_its_errors_are_the_known_ones(order, errors) -> None:
    slot = chain.crescent_slot(131.0, 16, 181.78)[1]
    phases = np.linspace(slot.start, slot.end, 9001)
    fit = fit_slot(slot, int(order))
    error = fit_error(slot, fit, exact_slot(slot, phases))
    assert [error.normal, error.chord] == pytest.approx(errors, rel=0.03)
    for series, first, last in zip(fit.series, fit.breaks, fit.breaks[1:]):
        inside = phases[(phases > first) & (phases < last)][::50]
        points = fit.origin + chebyshev.chebval((2 * inside - first - last) / (last - first), series)
        assert np.abs(fit.evaluate(inside) - points).max() < 1e-9
