"""Limits of function generators hold exactly if the kinematics satisfies them, and their derivatives are correct.

A wrong sign of a condition would show here.
"""

from dataclasses import replace

import numpy as np
import pytest

from synthesis.constraints import keeps
from synthesis.function.search import Problem
from synthesis.function.target_function import TargetFunction
from synthesis.limits import Limits
from synthesis.mechanism import Placed

ALL_CASES = Limits("full_crank", 0.5, 0.2, link_ratio_max=6.0)
FAMILIES = ["any", "full_crank", "crank_rocker", "double_crank"]


def problem(limits: Limits, span: float) -> Problem:
    crank = np.linspace(0.0, span, 5)
    return Problem(TargetFunction(crank, crank), limits, True)


def candidates(seed: int, count: int = 400) -> np.ndarray:
    random = np.random.default_rng(seed)
    zeros = np.zeros(count)
    return np.column_stack([random.uniform(-1.2, 1.2, (count, 3)), random.uniform(-7, 7, count), zeros])


def kept_by(limits: Limits, x: np.ndarray, span: float) -> np.ndarray:
    request = problem(limits, span).function
    lengths = np.concatenate([np.exp(x[:, :3]), np.ones((len(x), 1))], axis=1)
    return keeps(request.target, limits, Placed(lengths, np.ones(len(x)), request.interval.after(x[:, 3])))


@pytest.mark.parametrize("family", FAMILIES)
def test_derivatives(family: str) -> None:
    x, request = candidates(1), problem(replace(ALL_CASES, family=family), 1.9)
    _, slope = request.conditions(x)
    for k in range(4):
        step = np.zeros(5)
        step[k] = 1e-6
        ahead, behind = (request.conditions(x + side * step)[0] for side in (1, -1))
        change = (ahead - behind) / 2e-6
        # where the nearest angle leaves an end, or a crank gets longer than the ground, there are two slopes
        agree = np.isclose(change, slope[:, :, k], atol=1e-4, rtol=1e-4)
        assert agree.mean() > 0.985


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("span", [0.4, 2.0, 7.0, -1.3])
def test_conditions_hold_where_the_kinematics_say_so(family: str, span: float) -> None:
    x, limits = candidates(2), Limits(family, 0.4, 0.25, link_ratio_max=5.0)
    value, _ = problem(limits, span).conditions(x)
    retained = kept_by(limits, x, span)
    if family == "any":  # whether the turn counts depends on the family, which is no condition here
        assert np.all(retained <= kept_by(replace(limits, transmission_angle_min_turn=0.0), x, span))
    assert 0 < retained.sum() < len(x)
    np.testing.assert_array_equal(np.all(value >= -1e-12, axis=1), retained)
