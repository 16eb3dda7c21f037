"""Targets treat weights, missing samples, intervals and reflections consistently.

A missing sample that still affects the result, or a reflection that is not its own inverse, would show here.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.four_bar import coupler_angle
from synthesis.fourbar.mechanism import GrashofChart
from synthesis.pose import objective
from synthesis.search import prescribed
from synthesis.search.prescribed import GivenProblem
from synthesis.target import Mean, Target, make_target

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


@LAW
@given(weights_with_gaps, anything)
def test_the_value_of_a_sample_of_weight_0_has_no_effect(weights, replacements) -> None:
    plain, changed = with_gaps(weights, replacements)
    size = 1 + max(map(abs, replacements))
    assert changed.length_scale == pytest.approx(plain.length_scale, rel=1e-12)
    angle = coupler_angle([19.0, 72, 144, 165], [[1], [-1]], [1 + plain.crank]).reshape(2, -1)
    assert objective(changed, angle) == pytest.approx(objective(plain, angle), rel=1e-13 * size)
    random = np.random.default_rng(1)
    drawn = random.uniform(0.1, 1.0, (20, 4)), random.choice([-1.0, 1.0], 20), random.uniform(-1.5, 1.5, 20)
    timed = prescribed.candidates_at(*drawn)
    plain_problem, changed_problem = (GivenProblem(target, GrashofChart()) for target in (plain, changed))
    expected_cost = plain_problem.measured(timed).cost
    np.testing.assert_allclose(changed_problem.measured(timed).cost, expected_cost, rtol=1e-13 * size)
    systems = zip(changed_problem.linearised(timed, 1e-3), plain_problem.linearised(timed, 1e-3))
    for system, expected in systems:
        np.testing.assert_allclose(system["rows"], expected["rows"], rtol=0, atol=1e-12 * size)


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


# -- intervals and mirrors --------------------------------------------------------------------------------------------
