"""All pins and their angles: constant chords, the relations that section 2 of the source writes out, the pins' own places."""

from __future__ import annotations

import numpy as np
import pytest

from synthesis.chain import crescent as chain
from synthesis.chain.crescent import crescent_angles
from synthesis.chain.slot import pins_at

PHASES = 9001


@pytest.fixture(scope="module")
def found():
    crescent, slot = chain.crescent_slot(131.0, 16, 181.78)
    phases = np.linspace(slot.start, slot.end, PHASES)
    pins = pins_at(slot, phases)
    return crescent, slot, phases, pins, crescent_angles(crescent, slot, pins)


def test_all_sixteen_chords_close_at_9001_phases(found) -> None:
    _, slot, phases, pins, _ = found
    assert pins.points.shape == (PHASES, 16)
    chords = np.abs(np.roll(pins.points, -1, axis=1) - pins.points)
    assert np.abs(chords / 131 - 1).max() < 1e-9
    assert np.array_equal(pins.points, slot.pins(phases))


def test_angles_place_every_pin(found) -> None:
    """A naive way back from the angle to the point, by the definitions of the source."""
    crescent, slot, _, pins, theta = found
    r0, r1, r2, b = crescent.wheel_radius, crescent.upper_radius, crescent.lower_radius, crescent.eccentricity
    c = r0 + r1
    back = {
        0: -c + r0 * np.exp(1j * theta),
        1: 1j * b + r2 * np.exp(1j * (theta - np.pi / 2)),
        2: c + r0 * np.exp(1j * (np.pi - theta)),
        3: r1 * np.exp(1j * (theta - np.pi / 2)),
    }
    for pin in set(range(16)) - {slot.free - 1}:
        made = np.choose(pins.segment[:, pin], [back[part][:, pin] for part in range(4)])
        assert np.abs(made - pins.points[:, pin]).max() < 1e-9, pin
    free = slot.free - 1
    radius = np.abs(pins.points[:, free])
    assert np.abs(radius * np.exp(1j * (theta[:, free] - np.pi / 2)) - pins.points[:, free]).max() < 1e-9


def test_pins_on_one_part_are_one_link_apart(found) -> None:
    crescent, slot, phases, pins, theta = found
    wheel, upper, lower = crescent.link_angles(131.0)
    assert theta[:, 0] == pytest.approx(phases / crescent.wheel_radius, abs=1e-12)
    for part, step in ((0, wheel), (1, lower), (2, -wheel), (3, -upper)):
        for pin in range(15):
            if slot.free - 1 in (pin, pin + 1):
                continue
            both = (pins.segment[:, pin] == part) & (pins.segment[:, pin + 1] == part)
            assert np.abs(theta[both, pin + 1] - theta[both, pin] - step).max(initial=0.0) < 1e-12
    # the source's phi: the free pin hangs half-way between its neighbours
    assert np.abs((theta[:, 12] + theta[:, 14]) / 2 - theta[:, 13]).max() < 1e-12


def test_link_angles_are_continuous_and_point_to_the_next_pin(found) -> None:
    _, _, _, pins, _ = found
    angles = pins.link_angle
    assert np.abs(np.diff(angles, axis=0)).max() < 0.01
    assert np.abs(pins.points + 131 * np.exp(1j * angles) - np.roll(pins.points, -1, axis=1)).max() < 1e-9
