"""Laws and chains agree with rotation matrices and scipy; transformations preserve distances and can be reversed.

A wrong sense, a wrong order of steps or a wrong interpolation would show here.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.errors import FieldError
from synthesis.scenes.knotter.d_knotter import mechanism
from synthesis.scenes.knotter.mechanism import Linear, Table
from tests.oracles.knotter import disc_to_bill

KNOTS = (-1.0, 0.5, 0.7, 2.0, 6.5)
ANGLES = (0.3, 0.3, -1.0, 2.0, 2.5)


@pytest.mark.parametrize("seed", range(20))
def test_chain_agrees_with_equation_9(seed: int) -> None:
    random = np.random.default_rng(seed)
    names = ("alpha1", "alpha2", "alpha3", "d1", "D", "d5", "d6")
    size = {name: random.uniform(-1, 1) * (1 if name.startswith("alpha") else 150) for name in names}
    sense = {name: int(random.choice([-1, 1])) for name in ("alpha", "beta")}
    law, alpha, r = Linear(*random.uniform(-2, 2, 2)), random.uniform(-7, 7), random.uniform(-50, 50, 3)
    machine = mechanism(size, sense, {"beta": law})
    found = machine.transform(tuple(r), "u3", "u4", np.float64(alpha))
    expected = disc_to_bill(r, np.float64(alpha), size, sense, law.value(alpha))
    assert np.array(found) == pytest.approx(expected, abs=1e-11)


@settings(derandomize=True, max_examples=60, deadline=None)
@given(
    st.tuples(*[st.floats(-100, 100)] * 3),
    st.tuples(*[st.floats(-100, 100)] * 3),
    st.floats(-10, 10),
    st.sampled_from([("u3", "u4"), ("u3", "u5"), ("u5", "seat"), ("u4", "u3")]),
)
def test_transformations_preserve_distances_and_can_be_reversed(first, second, driver, frames) -> None:
    machine = mechanism({"alpha1": 0.2, "alpha3": 0.4})
    driver = np.float64(driver)
    first_moved, second_moved = (np.array(machine.transform(point, *frames, driver)) for point in (first, second))
    assert np.linalg.norm(first_moved - second_moved) == pytest.approx(
        np.linalg.norm(np.subtract(first, second)), abs=1e-11
    )
    assert np.array(machine.transform(tuple(first_moved), *frames[::-1], driver)) == pytest.approx(first, abs=1e-11)


def test_pchip_agrees_with_scipy() -> None:
    from scipy.interpolate import PchipInterpolator

    driver = np.linspace(-1, 6.5, 500)
    expected = PchipInterpolator(KNOTS, ANGLES)(driver)
    assert Table(KNOTS, ANGLES, "pchip").value(driver) == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize(
    ("rows", "word"),
    [((), "at least two rows"), ((1.0,), "at least two rows"), ((1.0, 1.0), "row 2"), ((2.0, 1.0), "row 2")],
)
def test_table_that_does_not_define_a_function_is_refused(rows, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        Table(rows, tuple(0.0 for _ in rows))


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
