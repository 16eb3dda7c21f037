"""Motors that turn continuously swing the link as far and in the times of the request, in a simulation with circles.

A crank on the wrong side, or a time ratio that is inverted, would show here.
"""

import numpy as np
import pytest

from synthesis.drives.crank_rocker import place_motor_about_pivot
from synthesis.drives.links import motions_at, motions_of
from synthesis.drives.motor_search import place_motor
from tests.conftest import some_of
from tests.oracles.driven_cases import any_linkage
from tests.oracles.turned_motor import turned


@pytest.mark.parametrize("seed", some_of([28, 0, 4, 9, *range(1, 4), *range(5, 9), *range(10, 24)], 4))
def test_a_motor_that_is_turned_round_swings_a_linkage_of_any_kind(seed: int) -> None:
    linkage, interval = any_linkage(seed)
    machine = motions_of(linkage, interval)
    link = list(machine.links.values())[seed // 4 % 3]
    ratio, torque = (None, 1.2)[seed // 8 % 2], np.ones(61)
    middle = complex(np.mean(link.origin))
    box = (middle.real - 4, middle.imag - 4, middle.real + 4, middle.imag + 4)
    if link.pivot is None:
        found = place_motor(link, machine.at, torque, ratio, 1.5, box)
    else:
        found = place_motor_about_pivot(link, torque, ratio, 1.0, False, None)
    if isinstance(found, str):
        turns = np.diff(link.direction)
        assert "turns back" in found and turns.min() < 0 < turns.max()
        return

    def pin(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        moving = motions_at(linkage, at).links[link.name]
        return moving.position(found.pin), moving.speed(found.pin)

    start = float(found.motor_angle[0, 0])
    solution = turned(pin, interval.first, found.motor, start, found.crank, found.rod, 1001)
    assert solution.swings
    assert solution.rod < 1e-12
    assert solution.ends == pytest.approx(sorted(interval), abs=1e-9)
    assert solution.time_ratio == pytest.approx(ratio or found.time_ratio, rel=1e-9)
    assert found.transmission_angle_min == pytest.approx(solution.transmission_angle, abs=np.deg2rad(1))
    if (
        link.pivot is None
    ):  # its pin moves: the longest path has the length of the origin's path and of the turn about it
        largest = abs(link.origin[-1] - link.origin[0]) + 1.5 * abs(link.direction[-1] - link.direction[0])
        assert found.crank >= 0.0499 * largest
