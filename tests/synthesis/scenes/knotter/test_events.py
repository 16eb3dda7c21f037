"""The root search finds every root and no false root: known roots, roots in 40 digits, and very narrow windows.

A search with a fixed step would miss windows that are narrower than the step; rounding could create false roots.
"""

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.errors import FieldError
from synthesis.scenes.knotter import d_knotter, events
from synthesis.scenes.knotter.mechanism import Linear
from tests.oracles.knotter import Exact

ALPHA1, ALPHA3 = float(np.radians(10.0)), float(np.radians(25.0))
PAIR = {"alpha1": ALPHA1, "alpha3": ALPHA3}


def roots_of(function, first: float, last: float, rate: float = 0.0) -> np.ndarray:
    """Return all roots of a function for a single item, sorted; the function turns ``1 + rate`` times as fast as its argument."""

    def functions(driver, item):
        return np.broadcast_to(function(driver), np.broadcast_shapes(driver.shape, item.shape))[None]

    driver = d_knotter.mechanism(laws={"beta": Linear(0.0, rate)}).samples({"u3"}, first, last)
    values = functions(driver[None], np.zeros((1, 1), int))
    return np.sort(events.find_roots(functions, driver, values, np.full((1, 1), 1e-15)).driver)


@settings(derandomize=True, max_examples=80, deadline=None)
@given(st.lists(st.floats(0.05, 3.05), min_size=1, max_size=8, unique=True))
def test_all_roots_of_a_product_of_sines(zeros) -> None:
    zeros = np.sort(zeros)
    zeros = zeros[np.append(True, np.diff(zeros) > 0.05)]
    product = lambda x: np.prod([np.sin((x - zero) / 2) for zero in zeros], axis=0)  # noqa: E731
    found = roots_of(product, 0.0, 3.1, 0.5 * len(zeros))
    assert len(found) == len(zeros)
    assert found == pytest.approx(zeros, abs=1e-8)


@pytest.mark.parametrize("middle", [0.1, 1.0, np.pi / 4, 2.7])
@pytest.mark.parametrize("gap", [1e-1, 1e-3, 1e-5, 1e-7, 1e-8])
def test_two_roots_that_nearly_coincide(middle: float, gap: float) -> None:
    """Between the roots of a nearly double root, the values are far below the rounding of a number near 1."""
    found = roots_of(
        lambda x: np.prod([np.sin((x - middle + end) / 2) for end in (-gap / 2, gap / 2)], axis=0), 0.0, 3.0
    )
    expected = [root for root in (middle - gap / 2, middle + gap / 2) if 0 < root < 3]
    assert found == pytest.approx(expected, abs=1e-9)


def test_extremely_fast_laws_are_refused_before_memory_is_allocated() -> None:
    with pytest.raises(FieldError, match="turn so fast"):
        d_knotter.mechanism(laws={"beta": Linear(0.0, 1e12)}).samples({"u3"}, 0.0, 1.0)


# The wrap in 40 digits


def error_degrees(exact, found: float) -> float:
    return abs(float(mp.degrees(exact - mp.mpf(float(found)))))


@pytest.fixture(autouse=True)
def forty_digits():
    with mp.workdps(40):
        yield


CLOSING_D5 = 74.5013991260888


@pytest.mark.parametrize("short_of", [1.0, 1e-2, 1e-4, 1e-6, 1e-8])
def test_windows_next_to_the_vertex_down_to_a_millionth_of_a_degree(short_of: float) -> None:
    """E1 cuts the corner at S4: the window shrinks as d5 grows, until any scan with a fixed step misses it."""
    d5 = CLOSING_D5 - short_of
    found = d_knotter.wrap().evaluate(d_knotter.mechanism({**PAIR, "d5": d5}), 1)
    exact = Exact(10, 25, d5=d5)
    enter, leave = (exact.root("wrap", edge, angle[0]) for edge, angle in ((0, found.enter), (1, found.leave)))
    assert float(mp.degrees(leave - enter)) == pytest.approx(0.59 * short_of, rel=0.02)
    assert found.holds[0] and found.windows[0] == 1
    assert error_degrees(enter, found.enter[0]) < 1e-10
    assert error_degrees(leave, found.leave[0]) < 1e-10
