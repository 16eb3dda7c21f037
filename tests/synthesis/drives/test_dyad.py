"""Motors that turn continuously swing the link as far and in the times of the request, in a simulation with circles.

A crank on the wrong side, or a time ratio that is inverted, would show here.
"""

import numpy as np
import pytest

from synthesis.drives.crank_rocker import place_motor_about_pivot
from synthesis.drives.knee import place_knee
from synthesis.drives.links import SAMPLES, hinged_at, motions_at, motions_of
from synthesis.drives.motor_search import place_motor
from synthesis.drives.placements import PlacementLimits, Refusal
from synthesis.work import Work
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


@pytest.mark.parametrize("last", [True, False])
def test_a_knee_goes_over_its_centre_and_holds_what_pushes_it(last: bool) -> None:
    machine = hinged_at(0j, 0.0, 1.0, np.linspace(0.0, np.deg2rad(70), SAMPLES))
    link, delta, share = machine.links["rocker"], np.deg2rad(6), 0.4
    expected = PlacementLimits((-2.0, -2.0, 2.0, 2.0), 1.0, 0.05)
    push = np.full(61, 10.0 if last else -10.0)
    found = place_knee(link, machine.at, push, expected, last, delta, share, Work())
    assert not isinstance(found, Refusal)
    assert found.placement.extends is last
    pins = link.position(found.placement.pin)
    assert np.abs(found.knee - found.placement.ground) == pytest.approx(np.full(61, found.handle), abs=1e-9)
    assert np.abs(found.knee - pins) == pytest.approx(np.full(61, found.strut), abs=1e-9)
    bend = np.angle((pins - found.knee) / (found.knee - found.placement.ground))
    end = -1 if last else 0
    assert abs(bend[end]) == pytest.approx(delta, abs=1e-9)
    remaining = np.delete(bend, end)
    assert np.all(remaining * bend[end] < 0)
    assert found.holds
    assert not place_knee(link, machine.at, -push, expected, last, delta, share, Work()).holds
    assert found.overshoot > 0
