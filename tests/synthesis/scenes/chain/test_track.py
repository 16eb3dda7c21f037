"""Tracks and stepping along them, for large radii and distant origins too.

The tests would detect a pin at the wrong position, a derivative that does not match its function, and lost digits.
"""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from synthesis.scenes.chain.crescent import level_crescent
from synthesis.scenes.chain.track import Arc, PinMotion, Track


def tracks():
    crescents = st.builds(level_crescent, st.floats(0.6, 4), st.floats(0.6, 9), st.floats(0.3, 1.5))
    return crescents.map(lambda crescent: crescent.track)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(track=tracks(), share=st.floats(0, 1), direction=st.sampled_from([1, -1]))
def test_next_pin_is_one_pitch_away_and_steps_back(track, share, direction) -> None:
    position = track.locate(share * track.total)
    after = track.advance(position, 1.0, 1, direction)
    chord = np.abs(track.points(after) - track.points(position))
    assert chord[0] == pytest.approx(1, abs=1e-12)
    advance = direction * float((track.arc_length(after) - track.arc_length(position))[0])
    assert 1 - 1e-12 <= advance <= math.pi / 2 + 1e-9
    back = track.advance(after, 1.0, 1, -direction)
    assert track.arc_length(back)[0] == pytest.approx(track.arc_length(position)[0], abs=1e-10)


@settings(derandomize=True, deadline=None, max_examples=40)
@given(track=tracks(), share=st.floats(0, 1), links=st.integers(1, 30), direction=st.sampled_from([1, -1]))
def test_motion_is_the_derivative(track, share, links, direction) -> None:
    h = 1e-4
    s = share * track.total + np.array([-2, -1, 0, 1, 2]) * h
    position = track.locate(s)
    after, motion = track.carry(position, PinMotion(np.ones(5), np.zeros(5)), 1.0, links, direction)
    # exclude cases in which a pin passes a joint within the five positions, because the acceleration jumps there
    pin, on_segment = position, np.ptp(position.segment) == 0
    for _ in range(links):
        pin = track.advance(pin, 1.0, 1, direction)
        on_segment = on_segment and np.ptp(pin.segment) == 0
    assume(on_segment)
    position = track.arc_length(after)
    first = np.dot([1, -8, 0, 8, -1], position) / (12 * h)
    assert first == pytest.approx(motion.rate[2], abs=1e-6)
    second = (position[3] - 2 * position[2] + position[1]) / h**2
    assert second == pytest.approx(motion.acceleration[2], abs=2e-4 * (1 + abs(motion.acceleration[2])))


@pytest.mark.parametrize("radius", [1e3, 1e5, 1e6, 1e7, 1e8, 1e12])
def test_large_radii_cost_no_digits(radius) -> None:
    """Use two caps and two nearly straight runs, for which an arccos formula loses 1.1e-2 mm at 1e8 mm."""
    bend, cap = 150 / radius, 40.0
    turn = math.pi - 2 * bend
    half, top = radius * math.sin(bend), cap * math.cos(bend)
    caps, arcs = (1 / cap, cap * turn), (1 / radius, 2 * bend * radius)
    halves = [Arc(-half, top, math.pi + bend, *caps), Arc(-half, -top, -bend, *arcs)]
    track = Track([*halves, Arc(half, -top, bend, *caps), Arc(half, top, math.pi - bend, *arcs)])
    position = track.locate(np.linspace(0, track.total, 400))
    for pitch in (7.0, 50.0):
        link = track.points(track.advance(position, pitch)) - track.points(position)
        chord = np.hypot(link.real, link.imag)  # numpy's abs of a complex number is good to two units only
        assert np.abs(chord - pitch).max() < 2e-13
