"""Drawings show the joints and paths of the linkage, and the requested poses.

A wrong unit or joint order would draw bars of another length than their links.
"""

from __future__ import annotations

import numpy as np
import pytest

import linkage_atlas as la

matplotlib = pytest.importorskip("matplotlib")


@pytest.fixture
def ax():
    from matplotlib.figure import Figure

    return Figure().subplots()


def bar_lengths(ax) -> list[float]:
    """Return the lengths of all drawn lines of two points."""
    segments = [line.get_xydata() for line in ax.lines if len(line.get_xydata()) == 2]
    return [float(np.hypot(*(end - start))) for start, end in segments]


@pytest.mark.parametrize("degrees", [True, False])
def test_bars_have_the_lengths_of_their_links(ax, degrees) -> None:
    unit = 1.0 if degrees else np.deg2rad(1.0)
    linkage = la.FourBar(
        19, 72, 144, 165, start_angle=30 * unit, coupler_point_polar=(20, 60 * unit), degrees=degrees
    )
    linkage.plot(ax, np.array([0, 40, 90]) * unit)
    assert np.allclose(bar_lengths(ax), [19, 144] * 3)
    path = ax.lines[0].get_xydata()
    assert np.allclose(path[0], linkage.joints(0).body_point[0])
    assert np.allclose(path[-1], linkage.joints(90 * unit).body_point[0])


def test_a_rail_is_drawn_through_the_slider(ax) -> None:
    linkage = la.SliderCrank(1, 3.0, offset=0.2)
    linkage.plot(ax, [0, 90])
    assert bar_lengths(ax)[:2] == pytest.approx([1, 1])
    rail = ax.lines[-1].get_xydata()
    slider = linkage.joints(0).coupler_pin[0]
    (across,) = np.diff(rail, axis=0)
    assert np.cross(np.append(across, 0), np.append(slider - rail[0], 0))[2] == pytest.approx(0, abs=1e-12)


def test_requested_poses_are_drawn_with_their_headings(ax) -> None:
    motion = la.Motion([0, 90], [[0, 0], [10, 5]], timing="free")
    motion.plot(ax, arrow=2)
    assert np.allclose(ax.lines[0].get_xydata(), motion.position)
    (arrows,) = ax.collections
    assert np.allclose(np.column_stack([arrows.U, arrows.V]), [[2, 0], [0, 2]])
    assert len(motion) == 2 and np.allclose(motion.rotation, [0, 90])


def test_a_drive_is_drawn_over_its_travel(ax) -> None:
    linkage = la.FourBar(19, 72, 144, 165, start_angle=30, coupler_point_polar=(20, 60))
    found = la.drives(
        linkage, crank_angle=np.linspace(0, 70, 8), drives=[{"kind": "rotary"}], load={"force": [0, -10]}
    )
    found.plot(ax)
    assert np.allclose(ax.lines[0].get_xydata()[:, 1], found.best("rotary").curve.torque)


@pytest.mark.parametrize(
    "arguments, reason",
    [
        ({"drives": []}, "names no drive"),
        ({"drives": [{"kind": "rotary"}]}, "give a `load`"),
        ({"drives": [{"kind": "actuator", "retracted": 200, "stroke": 150, "reach_max": 10}]}, "no actuator on the"),
    ],
)
def test_a_drawing_without_a_curve_says_why(ax, arguments, reason) -> None:
    found = la.drives(la.FourBar(19, 72, 144, 165, start_angle=30), crank_angle=[0, 35, 70], **arguments)
    with pytest.raises(ValueError, match=reason):
        found.plot(ax)
