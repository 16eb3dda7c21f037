"""Excursions of the body point agree with a fine polyline.

A loop between two samples that is not noticed would show here.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.defects import LEAVES_SAMPLES
from synthesis.excursions import excursions
from synthesis.linkage import four_bar
from synthesis.target import TURN
from tests.oracles import tracker
from tests.synthesis.test_defects import KINDS, lengths_of, samples_on, start_of

laws = settings(derandomize=True, max_examples=60, deadline=None)
ACCURACY = 1e-6
CRANK_ROCKER = four_bar((2, 7, 6, 8), coupler_point_polar=(5.0, 0.7))
DEGREES = np.deg2rad([[0, 40, 80, 130, 200, 250]])
SIDE = np.ones((1, 6))


class Polyline:
    """The body point's curve over a whole circuit, 200,000 corners and the samples; all by circles that meet."""

    def __init__(self, lengths, point, samples) -> None:
        self.lengths, self.point = lengths, point
        l1, l2, l3, l4 = lengths
        cosines = [(l1**2 + l4**2 - reach**2) / (2 * l1 * l4) for reach in (l2 - l3, l2 + l3)]
        low, high = (float(np.arccos(np.clip(cosine, -1, 1))) for cosine in cosines)
        self.side = samples[0][1]
        self.turns = cosines[0] >= 1 and cosines[1] <= -1
        if cosines[1] <= -1:
            low, high = low, TURN - low
        elif cosines[0] >= 1:
            low, high = -high, high
        elif np.sin(samples[0][0]) < 0:
            low, high = -high, -low
        self.low, self.width = low, high - low
        self.at_samples = np.array([self.position(*sample) for sample in samples])
        self.corners = np.unique(np.concatenate([self.at_samples, np.linspace(0, TURN, 200_001)]))
        points = self.points(self.corners)
        self.path_length = np.concatenate([[0], np.cumsum(np.abs(np.diff(points)))])

    def position(self, theta1, side):
        if self.turns:
            return theta1 % TURN
        half = np.arccos(1 - 2 * ((theta1 - self.low) % TURN) / self.width)
        return half if side > 0 else TURN - half

    def points(self, position):
        l1, l2, l3, l4 = self.lengths
        angle = position if self.turns else self.low + self.width * (1 - np.cos(position)) / 2
        side = self.side if self.turns else np.where(position < np.pi, 1, -1)
        pin = l1 * np.exp(1j * angle)
        r = np.abs(l4 - pin)
        foot = (r**2 + l2**2 - l3**2) / (2 * r)
        coupler = (foot + 1j * side * np.sqrt(np.maximum(l2**2 - foot**2, 0))) * (l4 - pin) / r / l2
        return pin + self.point * coupler

    def ratios(self, point, remaining, sense):
        """Curve over chord from samples to others, forwards or backwards round the circuit."""
        first, last = (np.searchsorted(self.corners, self.at_samples[k]) for k in (point, remaining))
        arc = (sense * (self.path_length[last] - self.path_length[first])) % self.path_length[-1]
        chord = np.abs(np.subtract(*(self.points(self.corners[k]) for k in (first, last))))
        return arc / np.maximum(chord, 0.05)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_as_a_fine_polyline(kind, closed: bool) -> None:
    rng = np.random.default_rng(5)
    for _ in range(2):
        lengths = 4 * lengths_of(rng, *kind)
        circuit = tracker.track(lengths, *start_of(rng, lengths))
        samples = samples_on(rng, circuit)
        point = complex(*rng.normal(size=2))
        angle, side = np.array(samples).T
        linkage = four_bar(tuple(lengths), coupler_point_polar=(abs(point), np.angle(point)))
        (found,) = excursions([linkage], [angle], [side], 1.0, closed=closed)
        naive = Polyline(lengths, point, samples)
        steps = np.diff(naive.at_samples)
        sense = min((1, -1), key=lambda direction: np.sum((direction * steps) % TURN))
        index = np.arange(len(samples) - (not closed))
        assert found == pytest.approx(max(naive.ratios(index, (index + 1) % len(samples), sense)), rel=ACCURACY)


def found(linkage=CRANK_ROCKER, angle=DEGREES, side=SIDE, scale=10.0, **request) -> float | None:
    return excursions([linkage], angle, side, scale, **request)[0]


@laws
@given(st.floats(0.0, 8.0), st.floats(-3.0, 3.0), st.booleans(), st.integers(-2, 2))
def test_the_same_for_reversed_samples_another_size_and_the_mirror_image(radius, direction, closed, turns) -> None:
    linkage = four_bar((2, 7, 6, 8), coupler_point_polar=(radius, direction))
    large = four_bar((20, 70, 60, 80), coupler_point_polar=(10 * radius, direction))
    truth = pytest.approx(found(linkage, closed=closed), rel=1e-7)
    assert found(linkage, DEGREES[:, ::-1], closed=closed) == truth
    assert found(large, scale=100.0, closed=closed) == truth
    assert found(linkage, DEGREES + TURN * turns, closed=closed) == truth
    mirror = four_bar((2, 7, 6, 8), coupler_point_polar=(radius, -direction))
    assert found(mirror, -DEGREES, -SIDE, closed=closed) == truth


def test_a_loop_between_two_samples_shows() -> None:
    complete = four_bar((2, 7, 6, 8), coupler_point_polar=(7.0, 0.0))
    close = np.deg2rad([[0, 10, 20, 30]])
    assert found(complete, close, np.ones((1, 4)), 1.0) < 1.1
    assert found(complete, np.deg2rad([[0, 10, 20, -20]]), np.ones((1, 4)), 1.0) > LEAVES_SAMPLES
