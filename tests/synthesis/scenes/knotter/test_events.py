"""No root missed, none invented: against known roots, 40 digits, and windows narrower than any scan's step."""

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.errors import FieldError
from synthesis.scenes.knotter import d_knotter, events
from synthesis.scenes.knotter.mechanism import Linear, Table
from tests.oracles.knotter import Exact

ALPHA1, ALPHA3 = float(np.radians(10.0)), float(np.radians(25.0))
PAIR = {"alpha1": ALPHA1, "alpha3": ALPHA3}


def roots_of(function, first: float, last: float, rate: float = 1.0, breakpoints=()) -> np.ndarray:
    """All roots of one function of one item, sorted."""
    floor = np.full((1, 1), 1e-15)

    def single(driver, item):
        return np.broadcast_to(function(driver), np.broadcast_shapes(driver.shape, item.shape))[None]

    ends = events.piece_ends(first, last, list(breakpoints), lambda low, high: rate)
    return np.sort(events.roots(events.pieces(single, ends, 1, floor), single, floor).driver)


@settings(derandomize=True, max_examples=80, deadline=None)
@given(st.lists(st.floats(0.05, 3.05), min_size=1, max_size=8, unique=True))
def test_all_zeros_of_a_product_of_sines(zeros) -> None:
    zeros = np.sort(zeros)
    zeros = zeros[np.append(True, np.diff(zeros) > 1e-3)]
    waves = lambda x: np.prod([np.sin((x - zero) / 2) for zero in zeros], axis=0)  # noqa: E731
    found = roots_of(waves, 0.0, 3.1, 0.5 * len(zeros))
    assert len(found) == len(zeros)
    assert found == pytest.approx(zeros, abs=1e-8)


@pytest.mark.parametrize("middle", [0.1, 1.0, np.pi / 4, 2.7])
@pytest.mark.parametrize("gap", [1e-1, 1e-3, 1e-5, 1e-7, 1e-8])
def test_two_zeros_that_nearly_meet(middle: float, gap: float) -> None:
    """Nearly a double root: the values between the two are far below the rounding of a double near one."""
    found = roots_of(lambda x: np.cos(x - middle) - np.cos(np.longdouble(gap) / 2), 0.0, 3.0)
    if np.finfo(np.longdouble).eps > 1e-18 and gap < 1e-6:
        pytest.skip("this machine has no extended precision")
    expected = [at for at in (middle - gap / 2, middle + gap / 2) if 0 < at < 3]
    assert found == pytest.approx(expected, abs=1e-9)


def test_a_touch_is_no_root() -> None:
    assert len(roots_of(lambda x: np.cos(x - 1.0) - 1.0 - 1e-12, 0.0, 3.0)) == 0


@pytest.mark.parametrize("rate", [1.0, 30.0, 1000.0])
def test_fast_functions_keep_every_zero(rate: float) -> None:
    found = roots_of(lambda x: np.sin(rate * x + 0.3), 0.0, np.pi, rate)
    first = np.ceil(0.3 / np.pi + 1e-12)
    expected = (np.arange(first, first + round(rate)) * np.pi - 0.3) / rate
    assert found == pytest.approx(expected, abs=1e-13)


def test_a_rate_that_was_promised_too_low_is_made_good_by_halving() -> None:
    found = roots_of(lambda x: np.sin(40 * x + 0.3), 0.0, np.pi, 1.0)
    assert len(found) == 40


def test_a_zero_at_a_common_end_of_two_pieces_is_found_once() -> None:
    assert roots_of(lambda x: np.sin(x - 1.0), 0.0, 2.0, 1.0, [1.0]) == pytest.approx([1.0], abs=1e-15)
    found = roots_of(lambda x: np.abs(x - 1.0) - 1e-9, 0.0, 2.0, 1.0, [1.0])
    assert found == pytest.approx([1 - 1e-9, 1 + 1e-9], abs=1e-15)


def test_rounding_that_differs_between_two_looks_at_one_place_makes_no_root() -> None:
    def noisy(x: np.ndarray) -> np.ndarray:
        last = x.shape[-1] if x.ndim else 1
        return np.sin(x - 1.0) + 1e-17 * np.where(np.arange(last) < last / 2, -1, 1)

    assert len(roots_of(noisy, 0.0, 2.0, 1.0, [1.0])) == 1


def test_a_function_that_is_zero_has_no_events() -> None:
    assert len(roots_of(lambda x: 0.0 * x, 0.0, 2.0)) == 0
    assert len(roots_of(lambda x: 1e-16 * np.sin(50 * x), 0.0, 2.0)) == 0


def test_hostile_laws_are_refused_before_any_memory_is_taken() -> None:
    with pytest.raises(FieldError, match="turn so fast"):
        events.piece_ends(0.0, 1.0, [], lambda low, high: 1e12)


def test_extremes_of_a_function() -> None:
    floor = np.zeros((1, 1))
    ends = events.piece_ends(0.0, 6.0, [], lambda low, high: 2.0)
    parts = events.pieces(
        lambda x, item: np.broadcast_to(np.sin(2 * x), np.broadcast_shapes(x.shape, item.shape))[None], ends, 1, floor
    )
    found = np.sort(events.extremes(parts, floor).driver)
    assert found == pytest.approx(np.pi / 4 + np.arange(4) * np.pi / 2, abs=1e-12)


# The wrap in 40 digits


def crossing(alpha: float) -> np.ndarray:
    """E1 (y, z) with the assumed inputs at (10, 25) degrees."""
    return np.array([float(x) for x in Exact(10, 25).wrap(mp.mpf(alpha))[0]])


def degrees_off(exact, found: float) -> float:
    return abs(float(mp.degrees(exact - mp.mpf(float(found)))))


@pytest.fixture(autouse=True)
def forty_digits():
    with mp.workdps(40):
        yield


CLOSING_D5 = 74.5013991260888


@pytest.mark.parametrize("short_of", [1.0, 1e-2, 1e-4, 1e-6, 1e-8])
def test_windows_beside_the_vertex_down_to_a_millionth_of_a_degree(short_of: float) -> None:
    """E1 cuts the corner at S4: the window shrinks with d5, and no scan with a step would see it."""
    d5 = CLOSING_D5 - short_of
    found = d_knotter.wrap().evaluate(d_knotter.mechanism({**PAIR, "d5": d5}), 1)
    exact = Exact(10, 25, d5=d5)
    enter, leave = (exact.root("wrap", edge, at[0]) for edge, at in ((0, found.enter), (1, found.leave)))
    assert float(mp.degrees(leave - enter)) == pytest.approx(0.59 * short_of, rel=0.02)
    assert found.holds[0] and found.windows[0] == 1
    assert degrees_off(enter, found.enter[0]) < 1e-10
    assert degrees_off(leave, found.leave[0]) < 1e-10


def test_beyond_the_vertex_there_is_no_window() -> None:
    found = d_knotter.wrap().evaluate(d_knotter.mechanism({**PAIR, "d5": CLOSING_D5 + 1e-9}), 1)
    assert not found.holds[0] and found.opened_by[0] != 2


@pytest.mark.parametrize("degrees", [70.0, 95.0, 110.0, 130.0])
@pytest.mark.parametrize("width", [1.0, 1e-1, 1e-3, 1e-5])
def test_windows_where_the_rope_only_grazes_the_edge(degrees: float, width: float) -> None:
    """Enters and leaves through one edge, laid along E1's path: nearly a double root."""
    if np.finfo(np.longdouble).eps > 1e-18 and width < 1e-2:
        pytest.skip("this machine has no extended precision")

    at, h = np.radians(degrees), 1e-3
    middle = crossing(at)
    tangent = (crossing(at + h) - crossing(at - h)) / (2 * h)
    tangent /= np.linalg.norm(tangent)
    normal = np.array([-tangent[1], tangent[0]])
    bend = float((crossing(at + h) - 2 * middle + crossing(at - h)) @ normal) / h**2
    if bend < 0:
        normal, bend = -normal, -bend
    centre = middle + normal * bend * np.radians(width) ** 2 / 8
    corners = centre + 9.3 * tangent, centre - 11.1 * tangent, centre - 20 * normal
    s3, s4, s5 = ((0.0, *map(float, point)) for point in corners)
    found = d_knotter.wrap().evaluate(d_knotter.mechanism(PAIR, points={"S3": s3, "S4": s4, "S5": s5}), 1)

    exact = Exact(10, 25, {"S3": s3, "S4": s4, "S5": s5})
    bottom = mp.findroot(lambda alpha: mp.diff(lambda x: exact.side("wrap", 0, x), alpha), at)
    half = mp.sqrt(-2 * exact.side("wrap", 0, bottom) / mp.diff(lambda x: exact.side("wrap", 0, x), bottom, 2))
    enter, leave = (exact.root("wrap", 0, bottom + sign * half, bottom + sign * half * 0.99) for sign in (-1, 1))
    assert 0.5 * width < float(mp.degrees(leave - enter)) < 5 * width  # the points are rounded to doubles
    assert found.holds[0] and found.windows[0] == 1
    assert degrees_off(enter, found.enter[0]) < 1e-9
    assert degrees_off(leave, found.leave[0]) < 1e-9
    # A grazing entry is ill-conditioned, and says so: the angle moves as one over the window's width.
    speed = bend * np.radians(width) / 2
    assert found.sensitivity[0] == pytest.approx(1 / speed, rel=0.2 if width > 1e-4 else 1.0)


@pytest.mark.parametrize("half_width", [1e-1, 1e-4, 1e-6, 1e-7])
def test_windows_that_a_corner_of_a_law_opens(half_width: float) -> None:
    """The disc turns to and fro: E1 comes just past the edge at the table's corner and turns back."""
    entered = d_knotter.wrap().evaluate(d_knotter.mechanism(PAIR), 1).enter[0]
    turn = entered + half_width

    def beta(alpha: float) -> float:
        return float(np.radians(23.5)) + 0.5 * alpha

    # After the corner the disc turns fast the other way; E1 leaves again through the edge that it came by.
    table = Table((0.0, turn, turn + 0.2, np.pi), (beta(0.0), beta(turn), beta(turn) + 2.0, beta(turn) + 2.0))
    found = d_knotter.wrap().evaluate(d_knotter.mechanism(PAIR, laws={"beta": table}), 1)
    assert found.enter[0] == pytest.approx(entered, abs=1e-13)
    assert turn < found.leave[0] < turn + 2 * half_width
    assert found.holds[0]


def test_fast_disc_agrees_with_forty_digits() -> None:
    ratio, lead = 7.3, 0.4
    found = d_knotter.wrap().evaluate(d_knotter.mechanism(PAIR, laws={"beta": Linear(lead, ratio)}), 1)
    turning = Exact(10, 25, lead=float(np.degrees(lead)), ratio=ratio)
    exact = turning.root("wrap", int(found.opened_by[0]) - 2, found.enter[0])
    assert degrees_off(exact, found.enter[0]) < 1e-11
