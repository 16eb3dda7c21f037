"""Targets treat weights, missing samples, intervals and reflections consistently.

A missing sample that still affects the result, or a reflection that is not its own inverse, would show here.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.atlas.scan import Scan
from synthesis.atlas.table import AtlasRule
from synthesis.four_bar import coupler_angle
from synthesis.fourbar.dimension_types import OrderRule, TypeRule
from synthesis.fourbar.mechanism import FOURBAR, FullCrankChart
from synthesis.pose import objective
from synthesis.search import prescribed
from synthesis.search.prescribed import GivenProblem
from synthesis.target import TURN, Interval, Mean, Target, make_target

LINE = np.array([0.0, 1, 3, 4])


@pytest.mark.parametrize(
    "make", [lambda p: p.real.astype(int), lambda p: np.repeat(p, 2)[::2], list, lambda p: p.astype("c8")]
)
def test_positions_may_be_any_kind_of_array(make) -> None:
    plain = make_target(position=LINE + 0j, crank_span=1.0)
    converted = make_target(position=make(LINE + 0j if make is not list else LINE), crank_span=1.0)
    assert np.array_equal(converted.position, plain.position)
    assert converted.length_scale == plain.length_scale == 2.0


# -- weights ----------------------------------------------------------------------------------------------------------

LAW = settings(derandomize=True, deadline=None, max_examples=40)
SAMPLES = 12
weights_with_gaps = st.lists(st.sampled_from([0.0, 0.0, 0.3, 1.0, 2.5]), min_size=SAMPLES, max_size=SAMPLES).filter(
    lambda weights: len(set(weights)) > 1 and sum(weight > 0 for weight in weights) >= 4
)
anything = st.lists(st.floats(-1e5, 1e5), min_size=SAMPLES, max_size=SAMPLES)


def motion() -> dict[str, np.ndarray]:
    """Return a motion that no linkage performs exactly, and its crank angles."""
    crank = np.linspace(0, 2, SAMPLES)
    rotation, position = 0.3 * np.sin(3 * crank) + crank**2 / 9, crank + 1j * np.cos(2 * crank)
    return {"rotation": rotation, "position": position, "crank_angle": crank}


def with_gaps(weights: list[float], replacements: list[float]) -> tuple[Target, Target]:
    """Return the motion with weights, and the same motion with other values for samples of weight 0."""
    columns, missing = motion(), np.array(weights) == 0
    options = {"rotation_weights": np.array(weights), "position_weights": np.array(weights[::-1])}
    changed = columns | {"rotation": np.where(missing, replacements, columns["rotation"])}
    changed["position"] = np.where(missing[::-1], np.array(replacements) * (1 - 2j), columns["position"])
    return make_target(**columns, **options), make_target(**changed, **options)


@pytest.fixture(scope="module")
def scan() -> Scan:
    return Scan(FOURBAR, AtlasRule(TypeRule(60, 2, OrderRule.FULL_CRANK)).lengths())


@LAW
@given(weights_with_gaps, anything)
def test_the_value_of_a_sample_of_weight_0_has_no_effect(weights, replacements) -> None:
    plain, changed = with_gaps(weights, replacements)
    size = 1 + max(map(abs, replacements))
    assert changed.length_scale == pytest.approx(plain.length_scale, rel=1e-12)
    angle = coupler_angle([19.0, 72, 144, 165], [[1], [-1]], [1 + plain.crank]).reshape(2, -1)
    assert objective(changed, angle) == pytest.approx(objective(plain, angle), rel=1e-13 * size)
    random = np.random.default_rng(1)
    drawn = random.uniform(-1.5, 1.5, (20, 3)), random.choice([-1.0, 1.0], 20), random.uniform(-1.5, 1.5, 20)
    timed = prescribed.candidates_at(*drawn)
    plain_problem, changed_problem = (GivenProblem(target, FullCrankChart()) for target in (plain, changed))
    expected_cost = plain_problem.measured(timed).cost
    np.testing.assert_allclose(changed_problem.measured(timed).cost, expected_cost, rtol=1e-13 * size)
    systems = zip(changed_problem.linearised(timed, 1e-3), plain_problem.linearised(timed, 1e-3))
    for system, expected in systems:
        np.testing.assert_allclose(system["rows"], expected["rows"], rtol=0, atol=1e-12 * size)


@settings(LAW, max_examples=4)
@given(weights_with_gaps, st.lists(st.floats(-50, 50), min_size=SAMPLES, max_size=SAMPLES))
def test_the_scan_ignores_samples_of_weight_0(scan, weights, replacements) -> None:
    (plain, _), (changed, _) = (scan.best(target, 5) for target in with_gaps(weights, replacements))
    for column in ("row", "start", "branch"):
        assert np.array_equal(getattr(plain, column), getattr(changed, column)), column
    assert changed.error == pytest.approx(plain.error, rel=1e-9)


@LAW
@given(st.floats(1e-9, 1e9))
def test_equal_weights_give_exactly_the_target_without_weights(weight) -> None:
    plain = make_target(**motion())
    weights = np.full(SAMPLES, weight)
    weighted = make_target(**motion(), rotation_weights=weights, position_weights=weights)
    assert weighted.rotation_weights is None and weighted.position_weights is None
    assert weighted.length_scale == plain.length_scale and weighted.extent == plain.extent
    for name in ("crank", "rotation", "position"):
        assert np.array_equal(getattr(weighted, name), getattr(plain, name))


@LAW
@given(st.lists(st.integers(0, 4), min_size=SAMPLES, max_size=SAMPLES).filter(any), st.floats(1e-3, 1e3))
def test_a_whole_weight_equals_repetition_of_the_sample(times, unit) -> None:
    values = np.random.default_rng(sum(times)).normal(size=(3, SAMPLES))
    repeated = np.repeat(values, times, axis=1)
    mean = Mean(SAMPLES, unit * np.array(times, dtype=float))
    np.testing.assert_allclose(mean(values), repeated.mean(axis=1), atol=1e-13)
    np.testing.assert_allclose(mean.spread(values), repeated.std(axis=1), atol=1e-13)
    np.testing.assert_allclose(mean.weighted(values).sum(axis=1) / mean.total, repeated.mean(axis=1), atol=1e-13)
    np.testing.assert_allclose(mean.product(values, values[0]), (repeated * repeated[0]).mean(axis=1), atol=1e-13)
    np.testing.assert_allclose(np.sum((mean.root * values) ** 2, axis=1), (repeated**2).mean(axis=1), atol=1e-13)


def test_a_thinned_target_keeps_the_samples_that_are_not_missing() -> None:
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
def test_the_interval_covers_the_crank_angles_of_the_motion(span) -> None:
    target = make_target(LINE, crank_span=span)
    assert target.interval == Interval(0.0, span) and target.clockwise == (span < 0)
    assert target.interval.after(1.5) == (1.5, 1.5 + span)
    first, last = target.interval.after(np.array([1.0, 2.0]))
    assert np.array_equal(first, [1.0, 2.0]) and np.array_equal(last, [1 + span, 2 + span])


def test_mirroring_twice_restores_the_target() -> None:
    target = make_target(**motion(), rotation_weights=np.arange(1.0, 13), position_weights=np.arange(2.0, 14))
    mirror = target.mirrored()
    assert mirror.clockwise and np.array_equal(mirror.crank, -target.crank)
    restored = mirror.mirrored()
    for name in ("crank", "rotation", "position", "rotation_weights", "position_weights", "length_scale"):
        assert np.array_equal(getattr(restored, name), getattr(target, name)), name
    lengths = np.array([19.0, 72, 144, 165])
    angle = coupler_angle(lengths, 1, 1 + target.crank)[None]
    mirrored_angle = coupler_angle(lengths, -1, -1 + mirror.crank)[None]
    assert objective(mirror, mirrored_angle) == pytest.approx(objective(target, angle), rel=1e-12)
