"""Rails and slots through given poses have the closed forms of the design, and no line near them is better.

A wrong stationary line would show here.
"""

import numpy as np
import pytest

from synthesis.guided.pairs import Motion, Straight

_ANGLE = np.deg2rad([0.0, 20.0, 50.0, 85.0])
_POSITION = np.array([0, 1 + 0.2j, 1.8 + 0.7j, 2.2 + 1.5j])


def motion(angle: np.ndarray, position: np.ndarray) -> Motion:
    root = np.full(angle.size, angle.size**-0.5)
    return Motion(position, np.exp(1j * angle), root, root)


@pytest.mark.parametrize(
    ("inverse", "point", "normal", "height"),
    [
        (False, -0.173951869 + 1.330564385j, 96.19237246, 1.341564652),
        (True, 0.848481704 + 1.744674636j, 117.55293200, 1.154320023),
    ],
)
def test_the_one_rail_and_the_one_slot_of_four_poses(inverse, point, normal, height):
    seen = motion(_ANGLE, _POSITION)
    seen = seen.inverse if inverse else seen
    lines, error = Straight(seen).stationary()
    assert error[0] < 1e-15 < error[1]
    found = np.exp(1j * lines.normal[0])
    distance = (np.conj(found) * lines.foot[0]).real
    found, distance = (found, distance) if distance > 0 else (-found, -distance)
    assert abs(lines.point[0] - point) < 1e-9
    assert abs(np.rad2deg(np.angle(found)) - normal) < 1e-8
    assert abs(distance - height) < 1e-9


def test_no_other_line_is_better_than_the_stationary_one():
    random = np.random.default_rng(3)
    for span in (1e-2, 0.5, 3.0):
        seen = motion(np.sort(random.uniform(0, span, 9)), random.normal(size=9) + 1j * random.normal(size=9))
        lines, error = Straight(seen).stationary()

        def rms(point: complex, seen: Motion = seen) -> float:
            """The best line of a point, by the least eigenvalue of its places' spread."""
            positions = seen.places(np.array([point]))[0]
            remaining = positions - positions.mean()
            spread = np.cov(remaining.real, remaining.imag, bias=True)
            return float(np.sqrt(max(np.linalg.eigvalsh(spread)[0], 0)))

        best = rms(lines.point[0])
        assert abs(best - error[0]) < 1e-9 * max(1.0, abs(lines.point[0]))
        for size in (1e-3, 0.1, 1.0, 10.0):
            for _ in range(20):
                second = lines.point[0] + size * complex(*random.normal(size=2))
                assert rms(second) >= best - 1e-9 * (1 + abs(second))
