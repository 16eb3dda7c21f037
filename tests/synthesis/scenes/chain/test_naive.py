"""The chain, compared with the slow and simple methods of `tests.oracles.chain`.

The tests would detect a pin that is not at the first position ahead, and a wrong critical closure for unseen sizes.
"""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from synthesis.scenes.chain.crescent import Dimensions, given_crescent
from synthesis.scenes.chain.slot import analyse_slot, crescent_slot
from tests.conftest import some_of
from tests.oracles.chain import crescent, free_pin, smallest_overrun


@pytest.mark.parametrize("seed", some_of([11, *range(11), *range(12, 60)], 6))
def test_600_steps_agree_with_bracketing_search(seed) -> None:
    rng = np.random.default_rng(seed)
    r0, r1, xi = rng.uniform(40, 150), rng.uniform(80, 300), rng.uniform(0.05, 1.2)
    sizes = r0, r1, r0 + (r0 + r1) / math.cos(xi) * rng.uniform(0.995, 1.005), (r0 + r1) * math.tan(xi)
    path, track = crescent(*sizes), given_crescent(*sizes).track
    pitch = rng.uniform(15, 75)
    position = track.locate(rng.uniform(0, track.total))
    s = float(track.arc_length(position)[0])
    ours, theirs = [], []
    direction = 1 if seed % 3 else -1
    for _ in range(600):
        position = track.advance(position, pitch, 1, direction)
        s = path.next(s, pitch, direction, cells=4)
        ours.append(float(track.arc_length(position)[0]))
        theirs.append(s)
    assert np.abs(np.array(ours) - theirs).max() < 1e-9
    assert np.abs(track.points(position) - complex(*path.point(s))).max() < 1e-9


# unseen sizes: pitch, links, upper radius, wheel radius (None: four pins per turn)
UNSEEN = [(1.5, 12, 1.3, 0.9), (100.0, 16, 140.0, None), (500.0, 19, 900.0, 420.0), (25.4, 24, 70.0, None)]
UNSEEN += [(60.0, 21, 120.0, 55.0)]


@pytest.mark.parametrize(("pitch", "links", "upper", "wheel"), some_of(UNSEEN, 2))
def test_unseen_sizes_agree_with_bracketing_search(pitch, links, upper, wheel) -> None:
    ours, slot = crescent_slot(Dimensions(pitch, links, upper, wheel))
    wheel = ours.wheel_radius
    tolerance = 1e-6 * pitch
    period = wheel * 2 * math.asin(pitch / (2 * wheel))

    def overrun(xi):
        b = (wheel + upper) * math.tan(xi)
        r2 = wheel + (wheel + upper) / math.cos(xi)
        return smallest_overrun(crescent(wheel, upper, r2, b), pitch, links, period, cells=20)

    computed_xi = ours.xi
    xi = brentq(overrun, computed_xi - 1e-3, computed_xi + 1e-3, xtol=1e-12)
    r2, b = wheel + (wheel + upper) / math.cos(xi), (wheel + upper) * math.tan(xi)
    assert ours.lower_radius == pytest.approx(r2, abs=tolerance)
    assert ours.eccentricity == pytest.approx(b, abs=tolerance)

    path = crescent(wheel, upper, ours.lower_radius, ours.eccentricity)
    phases = np.linspace(slot.start, slot.end, 13)
    # a phase beyond the end of the wheel corresponds to the next pin behind P1
    on_wheel = [(s, 0) if s <= path.ends[0] else (s - period, 1) for s in phases]
    origin = np.zeros(2)
    expected = [complex(*free_pin(path, pitch, links, slot.free + shift, s, origin)) for s, shift in on_wheel]
    assert np.abs(slot.path(phases) - expected).max() < tolerance
    facts = analyse_slot(slot, phases)
    depths = np.abs(expected) - upper
    assert facts.depth_max >= depths.max() - tolerance
    assert facts.end_step < tolerance

    # smallest radius of curvature, by differences inside each smooth piece up to its ends
    h = 2e-5 * period
    pieces = [(a, c) for a, c in zip(slot.breaks[:-1], slot.breaks[1:]) if c - a > 20 * h]
    dense = np.concatenate([np.linspace(a + 2 * h, c - 2 * h, 401) for a, c in pieces])
    before, at, after = (slot.path(dense + step) for step in (-h, 0, h))
    v, a = (after - before) / (2 * h), (after - 2 * at + before) / h**2
    radius = np.abs(v) ** 3 / np.abs(v.real * a.imag - v.imag * a.real)
    assert facts.radius_min == pytest.approx(radius.min(), rel=2e-3)
