"""Kinematics agrees with 50-digit arithmetic, and linkages that do not close give NaN without a warning.

Cancellation, a wrong branch or a wrong family would show here.
"""

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from synthesis.four_bar import FULL_CRANK, Family, close_loop, family, grashof_excesses, transmission_angle_over
from synthesis.target import TURN, Interval
from tests.oracles import naive
from tests.oracles.conditions import condition_of_closure

ULP = np.finfo(float).eps
FEW = 8
LENGTH = st.floats(0.05, 20.0)
ANGLE = st.floats(-7.0, 7.0)
BRANCH = st.sampled_from([1, -1])
laws = settings(derandomize=True, max_examples=60, deadline=None)


def turned(difference: float) -> float:
    """A difference of angles less whole turns."""
    return float(abs(mpmath.fmod(difference + 3 * mpmath.pi, 2 * mpmath.pi) - mpmath.pi))


def assert_as_naive(lengths, theta1: float, branch: int, exact_input: bool = False) -> bool:
    """Compare all angles of a position with `naive.angles`; return false if it does not close.

    If the crank turns fully and the sums of lengths are exact, nothing cancels.
    """
    exact = naive.angles(lengths, theta1, branch)
    closure = close_loop(lengths, [theta1])
    if exact is None:
        assert not closure.closed[0] and np.isnan(closure.coupler_angle(branch)[0])
        return False
    assert closure.closed[0], (lengths, theta1)
    condition = condition_of_closure(lengths, branch, [theta1])[0]
    found = closure.coupler_angle(branch)[0], closure.rocker_angle(branch)[0], closure.transmission_angle[0]
    assert condition > 0, "a dead position: choose another example"
    # theta3 and the transmission angle depend on the same triangle; their condition exceeds theta2's by L2/L3 at most
    allowed = FEW * ULP * (4 + (0 if exact_input else condition * max(1.0, lengths[1] / lengths[2])))
    with mpmath.workdps(naive.DIGITS):
        for name, number, truth in zip(("theta2", "theta3", "transmission"), found, exact):
            assert turned(mpmath.mpf(float(number)) - truth) <= allowed, (name, lengths, theta1, branch)
    return True


def lengths_of(kind: Family, rng: np.random.Generator) -> np.ndarray:
    """Random lengths of a family."""
    while True:
        lengths = np.exp(rng.uniform(-2, 2, size=4))
        if kind == Family.CHANGE_POINT:
            lengths = rng.integers(1, 1000, size=4) / 64
            lengths[3] = lengths[1] + lengths[2] - lengths[0]
        if lengths.min() > 0 and 2 * lengths.max() < lengths.sum() and family(lengths)[()] == kind:
            return lengths


@pytest.mark.parametrize("kind", Family)
def test_angles_agree_with_50_digits(kind) -> None:
    rng = np.random.default_rng(list(Family).index(kind))
    closed = sum(
        assert_as_naive(lengths_of(kind, rng), rng.uniform(-2 * np.pi, 2 * np.pi), rng.choice([1, -1]))
        for _ in range(60)
    )
    assert closed >= 10


@pytest.mark.parametrize("gap", [2.0**-20, 2.0**-40, 2.0**-43, 2.0**-48])
@pytest.mark.parametrize(
    "kind", [Family.CRANK_ROCKER, Family.DOUBLE_CRANK, Family.DOUBLE_ROCKER, Family.ROCKER_CRANK]
)
def test_angles_agree_within_1e_12_of_a_change_point(kind, gap) -> None:
    # Lengths on a grid of 2^-48 below 4: every sum is exact, and two of the three excesses are far from zero.
    rng = np.random.default_rng(7)
    closed = 0
    for _ in range(40):
        short, longer = rng.integers(1, 64) / 64, rng.integers(65, 96) / 64
        middle = longer + rng.integers(1, 64) / 64
        longest = longer + middle - short - gap
        crank, coupler, rocker, ground = {
            Family.CRANK_ROCKER: (short, longer, middle, longest),
            Family.DOUBLE_CRANK: (longest, middle, longer, short),
            Family.DOUBLE_ROCKER: (longer, short, middle, longest),
            Family.ROCKER_CRANK: (longer, middle, short, longest),
        }[kind]
        lengths = np.array([crank, coupler, rocker, ground])
        reported = kind if gap > 1e-12 * lengths.max() else Family.CHANGE_POINT
        assert family(lengths)[()] == reported and np.abs(grashof_excesses(lengths)).min() == gap
        near_fold = rng.choice([0.0, np.pi]) + rng.choice([-1, 1]) * 10.0 ** rng.uniform(-9, 0)
        closed += assert_as_naive(lengths, near_fold, rng.choice([1, -1]), exact_input=kind in FULL_CRANK)
    assert closed >= (10 if kind in FULL_CRANK else 3)  # the other two families close near at most a single fold


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 0.0, -1.0])
@pytest.mark.parametrize("position", range(5))
def test_what_does_not_close_is_nan_and_masked(bad, position) -> None:
    lengths, crank = np.array([[19.0, 72, 144, 165]] * 2), np.array([0.5, 1.0])
    if position < 4:
        lengths[1, position] = bad
        good = np.array([[True, True], [False, False]])
    else:
        crank[1] = bad
        good = np.array([[True, np.isfinite(bad)]] * 2)
    closure = close_loop(lengths, crank)
    assert np.array_equal(closure.closed, good)
    gradient = closure.coupler_angle_gradient(1)
    for numbers in (
        closure.coupler_angle(1),
        closure.rocker_angle(-1),
        closure.transmission_angle,
        condition_of_closure(lengths, 1, crank),
        gradient.sum(-1),
    ):
        assert np.array_equal(np.isfinite(numbers), good)
    over = transmission_angle_over(lengths, Interval(crank[0], crank))
    assert np.array_equal(np.isfinite(over), good[:, 1] if position < 4 else good[0])
    family(lengths)


@laws
@given(st.tuples(LENGTH, LENGTH, LENGTH, LENGTH), ANGLE, BRANCH)
def test_loop_closes(lengths, theta1, branch) -> None:
    closure = close_loop(lengths, [theta1])
    l1, l2, l3, l4 = lengths
    t2, t3 = closure.coupler_angle(branch)[0], closure.rocker_angle(branch)[0]
    gap = l1 * np.exp(1j * theta1) + l2 * np.exp(1j * t2) - l4 - l3 * np.exp(1j * t3)
    assert np.isnan(gap) == (not closure.closed[0])
    assert not abs(gap) > 16 * ULP * sum(lengths)  # also if it is NaN


@laws
@given(st.tuples(LENGTH, LENGTH, LENGTH, LENGTH))
def test_family_changes_as_its_law_says(lengths) -> None:
    swap = {Family.ROCKER_CRANK: Family.DOUBLE_ROCKER, Family.DOUBLE_ROCKER: Family.ROCKER_CRANK}
    kind = family(lengths)[()]
    assert family(np.ldexp(lengths, -30))[()] == kind
    assert family([lengths[0], lengths[2], lengths[1], lengths[3]])[()] == swap.get(kind, kind)
    crank = np.linspace(0, TURN, 181)  # 0 and pi, the extremes of the diagonal, are among them
    turns_fully = kind in (Family.CRANK_ROCKER, Family.DOUBLE_CRANK)
    assume(kind != Family.CHANGE_POINT and min(np.abs(grashof_excesses(lengths))) > 1e-9)
    assert close_loop(lengths, crank).closed.all() == turns_fully


@pytest.mark.parametrize("scale", [1e-6, 0.1, 1 / 3, 1e7])
def test_rounding_leaves_a_change_point_one(scale) -> None:
    """Lengths that a user writes as decimals, or to which an answer keeps to a few digits less."""
    random = np.random.default_rng(3)
    lengths = scale * np.array([[60, 80, 75, 95], [100, 60, 100, 60], [80, 60, 80, 60], [60, 60, 60, 60]])
    moved = lengths * (1 + 1e-13 * random.uniform(-1, 1, (50, 1, 4)))
    assert set(family(moved).ravel()) == {Family.CHANGE_POINT}
    lengths[:, 0] *= 1 + 1e-10
    assert Family.CHANGE_POINT not in family(lengths)


def test_gradient_agrees_with_differentiation_in_50_digits() -> None:
    rng = np.random.default_rng(11)
    compared = 0
    for _ in range(12):
        lengths, theta1, branch = rng.uniform(0.5, 3, 4), rng.uniform(-3, 3), rng.choice([1, -1])
        closure = close_loop(lengths, [theta1])
        if not closure.closed[0] or closure.transmission_angle[0] < 0.1:
            continue
        found = closure.coupler_angle_gradient(branch)[0]
        point = [*lengths, theta1]
        with mpmath.workdps(naive.DIGITS):
            for k in range(5):

                def at(value, k=k, point=point, branch=branch):
                    moved = [value if j == k else mpmath.mpf(float(number)) for j, number in enumerate(point)]
                    l1, l2, l3, l4, t1 = moved
                    to_b = l4 - l1 * mpmath.expj(t1)
                    cosine = (abs(to_b) ** 2 + l2**2 - l3**2) / (2 * abs(to_b) * l2)
                    return mpmath.arg(to_b) + int(branch) * mpmath.acos(cosine)

                assert float(mpmath.diff(at, float(point[k]))) == pytest.approx(found[k], rel=1e-11, abs=1e-12)
        compared += 1
    assert compared >= 5
    assert np.isnan(close_loop([1.0, 1.0, 3.0, 3.0], [0.0]).coupler_angle_gradient(1)).all(), "a dead position"


def dense_samples(first: float, last: float) -> np.ndarray:
    """Crank angles of an interval, those where the diagonal is shortest and longest among them."""
    folds = np.pi * np.arange(-3, 4)
    inside = folds[(folds > min(first, last)) & (folds < max(first, last))]
    return np.concatenate([np.linspace(first, last, 999), inside])


@laws
@given(st.tuples(LENGTH, LENGTH, LENGTH, LENGTH), st.floats(-9, 9), st.floats(-9, 9))
def test_transmission_angle_over_is_the_least_of_dense_samples(lengths, first, last) -> None:
    closure = close_loop(lengths, dense_samples(first, last))
    assume(closure.closed.all())
    smallest = transmission_angle_over(lengths, Interval(first, last))
    assert smallest == pytest.approx(closure.transmission_angle.min(), abs=1e-7)
    assert smallest <= closure.transmission_angle.min() + 1e-14
