"""Targets: what is checked, and which field is named."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.atlas.scan import Scan
from synthesis.atlas.table import AtlasRule
from synthesis.fourbar.dimension_types import OrderRule, TypeRule
from synthesis.fourbar.kinematics import coupler_angle
from synthesis.fourbar.mechanism import FOURBAR, FullCrankChart
from synthesis.pose import objective
from synthesis.search import problems
from synthesis.search.problems import GivenProblem
from synthesis.target import TURN, Interval, Mean, Target, make_target

LINE = np.array([0.0, 1, 3, 4])


@pytest.mark.parametrize(
    "make", [lambda p: p.real.astype(int), lambda p: np.repeat(p, 2)[::2], list, lambda p: p.astype("c8")]
)
def test_positions_of_any_kind_of_array_are_the_same(make) -> None:
    plain = make_target(position=LINE + 0j, crank_span=1.0)
    other = make_target(position=make(LINE + 0j if make is not list else LINE), crank_span=1.0)
    assert np.array_equal(other.position, plain.position) and other.length_scale == plain.length_scale == 2.0


# -- weights ----------------------------------------------------------------------------------------------------------

LAW = settings(derandomize=True, deadline=None, max_examples=40)
SAMPLES = 12
weights_with_gaps = st.lists(st.sampled_from([0.0, 0.0, 0.3, 1.0, 2.5]), min_size=SAMPLES, max_size=SAMPLES).filter(
    lambda weights: len(set(weights)) > 1 and sum(weight > 0 for weight in weights) >= 4
)
anything = st.lists(st.floats(-1e5, 1e5), min_size=SAMPLES, max_size=SAMPLES)


def motion() -> dict[str, np.ndarray]:
    """Curves that no linkage performs, and their crank angles."""
    crank = np.linspace(0, 2, SAMPLES)
    rotation, position = 0.3 * np.sin(3 * crank) + crank**2 / 9, crank + 1j * np.cos(2 * crank)
    return {"rotation": rotation, "position": position, "crank_angle": crank}


def with_gaps(weights: list[float], others: list[float]) -> tuple[Target, Target]:
    """The motion with weights, and with other numbers where the weight is 0."""
    given, missing = motion(), np.array(weights) == 0
    options = {"rotation_weights": np.array(weights), "position_weights": np.array(weights[::-1])}
    changed = given | {"rotation": np.where(missing, others, given["rotation"])}
    changed["position"] = np.where(missing[::-1], np.array(others) * (1 - 2j), given["position"])
    return make_target(**given, **options), make_target(**changed, **options)


@pytest.fixture(scope="module")
def scan() -> Scan:
    return Scan(FOURBAR, AtlasRule(TypeRule(60, 2, OrderRule.FULL_CRANK)).lengths())


@LAW
@given(weights_with_gaps, anything)
def test_the_value_of_a_sample_of_weight_0_does_not_matter(weights, others) -> None:
    plain, changed = with_gaps(weights, others)
    size = 1 + max(map(abs, others))
    assert changed.length_scale == pytest.approx(plain.length_scale, rel=1e-12)
    angle = coupler_angle([19.0, 72, 144, 165], [[1], [-1]], [1 + plain.crank]).reshape(2, -1)
    assert objective(changed, angle) == pytest.approx(objective(plain, angle), rel=1e-13 * size)
    random = np.random.default_rng(1)
    drawn = random.uniform(-1.5, 1.5, (20, 3)), random.choice([-1.0, 1.0], 20), random.uniform(-1.5, 1.5, 20)
    timed = problems.given(*drawn)
    ours, theirs = (GivenProblem(one, FullCrankChart()) for one in (plain, changed))
    np.testing.assert_allclose(theirs.measured(timed).cost, ours.measured(timed).cost, rtol=1e-13 * size)
    for one, other in zip(ours.linearised(timed, 1e-3), theirs.linearised(timed, 1e-3)):
        np.testing.assert_allclose(other["rows"], one["rows"], rtol=0, atol=1e-12 * size)


@settings(LAW, max_examples=4)
@given(weights_with_gaps, st.lists(st.floats(-50, 50), min_size=SAMPLES, max_size=SAMPLES))
def test_the_scan_does_not_look_at_samples_of_weight_0(scan, weights, others) -> None:
    (ours, _), (theirs, _) = (scan.best(target, 5) for target in with_gaps(weights, others))
    for column in ("row", "start", "branch"):
        assert np.array_equal(getattr(ours, column), getattr(theirs, column)), column
    assert theirs.error == pytest.approx(ours.error, rel=1e-9)


@LAW
@given(st.floats(1e-9, 1e9))
def test_equal_weights_are_the_target_without_weights_bit_for_bit(weight) -> None:
    plain = make_target(**motion())
    weights = np.full(SAMPLES, weight)
    same = make_target(**motion(), rotation_weights=weights, position_weights=weights)
    assert same.rotation_weights is None and same.position_weights is None
    assert same.length_scale == plain.length_scale and same.extent == plain.extent
    for name in ("crank", "rotation", "position"):
        assert np.array_equal(getattr(same, name), getattr(plain, name))


@LAW
@given(st.lists(st.integers(0, 4), min_size=SAMPLES, max_size=SAMPLES).filter(any), st.floats(1e-3, 1e3))
def test_a_weight_says_how_often_a_sample_counts(times, unit) -> None:
    values = np.random.default_rng(sum(times)).normal(size=(3, SAMPLES))
    repeated = np.repeat(values, times, axis=1)
    mean = Mean(SAMPLES, unit * np.array(times, dtype=float))
    np.testing.assert_allclose(mean(values), repeated.mean(axis=1), atol=1e-13)
    np.testing.assert_allclose(mean.spread(values), repeated.std(axis=1), atol=1e-13)
    np.testing.assert_allclose(mean.weighted(values).sum(axis=1) / mean.total, repeated.mean(axis=1), atol=1e-13)
    np.testing.assert_allclose(mean.product(values, values[0]), (repeated * repeated[0]).mean(axis=1), atol=1e-13)
    np.testing.assert_allclose(np.sum((mean.root * values) ** 2, axis=1), (repeated**2).mean(axis=1), atol=1e-13)


def test_a_thinned_target_keeps_samples_that_count() -> None:
    samples = 600
    crank, weights = np.linspace(0, 3, samples), np.zeros(samples)
    weights[100:110] = np.arange(1, 11)
    target = make_target(np.sin(crank), crank + 1j * crank**2, crank_angle=crank, rotation_weights=weights)
    thin = target.thinned(64)
    assert thin.samples < 80 and np.sum(thin.rotation_weights > 0) == 10
    assert thin.crank[0] == 0 and thin.crank[-1] == 3 and thin.length_scale == target.length_scale
    assert np.array_equal(thin.rotation, np.sin(thin.crank)) and thin.position.size == thin.samples
    assert target.thinned(600) is target


# -- intervals and mirrors --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("span", [2.0, -2.0, 3 * TURN])
def test_the_interval_is_what_the_crank_uses(span) -> None:
    target = make_target(LINE, crank_span=span)
    assert target.interval == Interval(0.0, span) and target.clockwise == (span < 0)
    assert target.interval.after(1.5) == (1.5, 1.5 + span)
    first, last = target.interval.after(np.array([1.0, 2.0]))
    assert np.array_equal(first, [1.0, 2.0]) and np.array_equal(last, [1 + span, 2 + span])


def test_a_mirrored_target_is_its_mirror_image_and_back() -> None:
    target = make_target(**motion(), rotation_weights=np.arange(1.0, 13), position_weights=np.arange(2.0, 14))
    mirror = target.mirrored()
    assert mirror.clockwise and np.array_equal(mirror.crank, -target.crank)
    back = mirror.mirrored()
    for name in ("crank", "rotation", "position", "rotation_weights", "position_weights", "length_scale"):
        assert np.array_equal(getattr(back, name), getattr(target, name)), name
    lengths = np.array([19.0, 72, 144, 165])
    angle = coupler_angle(lengths, 1, 1 + target.crank)[None]
    other = coupler_angle(lengths, -1, -1 + mirror.crank)[None]
    assert objective(mirror, other) == pytest.approx(objective(target, angle), rel=1e-12)
