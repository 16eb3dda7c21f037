"""The limits of function generators: conditions, their derivatives, and the check on the kinematics, agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthesis.errors import FieldError
from synthesis.fourbar.kinematics import close_loop
from synthesis.function.bounds import FunctionLimits
from synthesis.target import Interval

EVERY = FunctionLimits("full_crank", 0.5, 0.2, 6.0, 0.3, 4.0)


def candidates(seed: int, count: int = 400) -> np.ndarray:
    random = np.random.default_rng(seed)
    return np.column_stack([random.uniform(-1.2, 1.2, (count, 3)), random.uniform(-7, 7, count)])


@pytest.mark.parametrize("family", ["any", "full_crank", "crank_rocker", "double_crank"])
def test_derivatives(family: str) -> None:
    x, interval = candidates(1), Interval(0.0, 1.9)
    limits = replace(EVERY, family=family)
    _, slope = limits.conditions(x, interval)
    for k in range(4):
        step = np.zeros(4)
        step[k] = 1e-6
        ahead, behind = (limits.conditions(x + side * step, interval)[0] for side in (1, -1))
        change = (ahead - behind) / 2e-6
        # where the nearest angle leaves an end, or a crank gets longer than the ground, there are two slopes
        agree = np.isclose(change, slope[:, :, k], atol=1e-4, rtol=1e-4)
        assert agree.mean() > 0.985


@pytest.mark.parametrize("family", ["any", "full_crank", "crank_rocker", "double_crank"])
@pytest.mark.parametrize("span", [0.4, 2.0, 7.0, -1.3])
def test_conditions_hold_where_the_kinematics_say_so(family: str, span: float) -> None:
    x, interval = candidates(2), Interval(0.0, span)
    limits = FunctionLimits(family, 0.4, 0.25, 5.0)
    value, _ = limits.conditions(x, interval)
    lengths = np.concatenate([np.exp(x[:, :3]), np.ones((len(x), 1))], axis=1)
    kept = limits.kept_by(lengths, x[:, 3], interval)
    if family == "any":  # whether the turn counts depends on the family, which is no condition here
        kept_without = replace(limits, transmission_angle_min_turn=0.0).kept_by(lengths, x[:, 3], interval)
        assert np.all(kept <= kept_without)
    assert 0 < kept.sum() < len(x)
    np.testing.assert_array_equal(np.all(value >= -1e-12, axis=1), kept)


@given(st.integers(0, 10_000))
def test_kept_by_against_dense_samples(seed: int) -> None:
    x, interval = candidates(seed, 20), Interval(0.0, 2.5)
    lengths = np.concatenate([np.exp(x[:, :3]), np.ones((20, 1))], axis=1)
    closure = close_loop(lengths, x[:, 3:] + np.linspace(0, 2.5, 2001))
    dense = np.min(np.where(closure.closed, closure.transmission_angle, 0.0), axis=1)
    kept = FunctionLimits("any", 0.4).kept_by(lengths, x[:, 3], interval)
    clear = np.abs(dense - 0.4) > 1e-4
    np.testing.assert_array_equal(kept[clear], dense[clear] > 0.4)


def test_given_lengths_are_ratios_of_the_ground() -> None:
    limits = FunctionLimits(links=(30.0, None, 60.0, 120.0), link_min=20.0)
    np.testing.assert_allclose(np.exp(limits.given), [0.25, np.nan, 0.5])
    np.testing.assert_allclose(np.exp(limits.box(20.0)), [[1 / 6] * 3, [20.0] * 3])
    assert limits.exchanged().links == (30.0, 60.0, None, 120.0)
    assert not limits.only_family and FunctionLimits("crank_rocker").only_family


@pytest.mark.parametrize(
    ("limits", "field"),
    [
        ({"transmission_angle_min": 1.6}, "/limits/transmission_angle_min"),
        ({"link_ratio_max": 0.5}, "/limits/link_ratio_max"),
        ({"link_min": 3.0, "link_max": 2.0}, "/limits/link_min"),
        ({"link_max": -1.0}, "/limits/link_max"),
        ({"family": "six_bar"}, "/limits/family"),
    ],
)
def test_contradictions_are_named(limits: dict, field: str) -> None:
    with pytest.raises(FieldError) as error:
        FunctionLimits(**limits).check()
    assert error.value.field == field
