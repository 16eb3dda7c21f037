"""Poses as two points of the body, crank angles from the ground line and obstacles are respected by the linkages found.

Catches a body that is turned the wrong way, bodies that are not rigid, motors whose rest position is not kept, and links that
pass through the floor before others.
"""

from __future__ import annotations

import numpy as np
import pytest

import linkage_atlas as la

POSITION = np.array([[0, 0], [22, 5], [41, 17], [52, 36], [50, 58]], dtype=float)
ROTATION = np.array([0, 12, 27, 45, 66], dtype=float)


def two_points(distance: float = 80.0) -> np.ndarray:
    direction = np.deg2rad(ROTATION + 100)
    return np.hstack([POSITION, POSITION + distance * np.stack([np.cos(direction), np.sin(direction)], axis=1)])


def test_two_points_are_position_and_direction() -> None:
    motion = la.Motion(points=two_points(), timing="free")
    same = la.Motion(ROTATION + 100, POSITION, timing="free")
    np.testing.assert_allclose(motion.requested.rotation, same.requested.rotation, atol=1e-12)
    np.testing.assert_allclose(motion.requested.position, same.requested.position, atol=1e-12)
    assert not motion.notes()


def test_rounded_points_are_noted_and_points_of_no_rigid_body_name_their_row() -> None:
    points = two_points()
    drawn = points.copy()
    drawn[2, 2] += 0.2
    assert any("taken as rounding" in note for note in la.Motion(points=drawn, timing="free").notes())
    drawn[3, 3] += 4
    with pytest.raises(
        la.FieldError, match=r"84 apart, 4 \(5 %\) more than 80 as usual|more than 80 as usual"
    ) as error:
        la.Motion(points=drawn, timing="free")
    assert error.value.field == "/points/3"
    with pytest.raises(la.FieldError, match="rows") as error:
        la.Motion(points=[[0, 0, 1]], timing="free")
    assert error.value.field == "/points"


@pytest.mark.parametrize("parts", ["rotation", "position", "both"])
def test_a_motor_starts_at_a_given_angle(parts: str) -> None:
    maker = la.FourBar(2, 5, 4.5, 5.5, start_angle=30, body_offset=10, coupler_point_polar=(3, 1))
    joints = maker.joints(np.linspace(0, 100, 9))
    rotation = None if parts == "position" else joints.rotation
    position = None if parts == "rotation" else joints.body_point
    found = la.synthesize(rotation, position, crank_span=100, start_angle=30)
    assert all(np.cos(np.deg2rad(solution.start_angle - 30)) == pytest.approx(1, abs=1e-12) for solution in found)
    assert found.best.errors.objective < 1e-6
    second = la.synthesize(rotation, position, crank_span=100, start_angle=75)
    assert all(np.cos(np.deg2rad(solution.start_angle - 75)) == pytest.approx(1, abs=1e-12) for solution in second)
    assert second.best.errors.objective > found.best.errors.objective
