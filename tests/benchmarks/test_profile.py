"""Performance profiles: shares within factors of the best time, failures, and the plain formulation that baselines solve."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import profile
from tests.oracles.free_classes import close

PART = {
    "cases": ["a", "b", "c"],
    "methods": {
        "fast": {"ms": [1.0, 2.0, 1.0], "J": [1e-12, 1e-3, None]},
        "slow": {"ms": [5.0, 20.0, 9.0], "J": [1e-10, 1e-10, 0.1]},
    },
}


def test_a_factor_is_of_the_fastest_that_solves_the_case() -> None:
    found = profile.factors(profile.TIMED, PART)
    assert found["fast"].tolist() == [1.0, np.inf, np.inf] and found["slow"].tolist() == [5.0, 1.0, np.inf]
    within = profile.solved(profile.LIMITED, PART)  # there the least J of all methods counts
    assert within["fast"].tolist() == [True, False, False] and within["slow"].tolist() == [True, True, True]


def test_failures_come_with_the_worst_first() -> None:
    made = {"machine": {"processor": "P", "cores": 2}, "commit": 40 * "a", "command": "python -m benchmarks.profile"}
    told = profile.blocks({"requests": {profile.TIMED: PART}, "made": made})
    assert "| crank angles given | fast | 2 | c: no answer; b: 1.0e-03 |" in told["failures"]
    assert told["failures"].index("| fast |") < told["failures"].index("| slow |")


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("branch", [1, -1])
def test_the_plain_formulation_is_zero_at_the_linkage_of_the_motion(branch, free) -> None:
    lengths, crank, turned = np.array([0.3, 1.1, 0.9, 1.2]), np.linspace(0, 2, 9), 0.4
    pin, coupler_pin = close(lengths, branch, 0.7 + crank)
    coupler = (coupler_pin - pin) / lengths[1]
    arm, offset = 0.5 - 0.2j, 0.3
    place = 1 + 2j + np.exp(1j * turned) * (pin + arm * coupler)
    motion = profile.Motion.of(np.unwrap(np.angle(coupler)) + turned + offset, place, None if free else crank)
    size = np.max(np.abs(place - place.mean()))
    pivot, arm = (1 + 2j - place.mean()) / size, arm / size
    head = [*np.log(lengths / size), offset, turned, pivot.real, pivot.imag, arm.real, arm.imag]
    x = np.concatenate([head, 0.7 + crank if free else [0.7]])
    assert motion.cost(x, branch) < 1e-14
    assert motion.cost(x + 1e-3, branch) > 1e-4
    if free:
        x[[12, 13]] = x[[13, 12]]
        assert motion.cost(x, branch) == np.inf, "the order is not kept"
