"""The first answer to ten tasks of textbooks and forums is exact or accurate, transmits well and is compact.

Catches first answers that no engineer would build, and figures of docs/textbook_tasks.md that are out of date.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkage_atlas as la

DOCUMENT = Path(__file__).parents[2] / "docs" / "textbook_tasks.md"
CHEBYSHEV = np.array([0.5 - 0.5 * np.cos(np.pi * k / 8) for k in (1, 3, 5, 7)])
MOTIONS: dict[str, dict[str, Any]] = {
    "Norton 3-3": {"points": [(0, 0, 1.721, 1.750), (2.656, 0.751, 5.065, 0.281)]},
    "Norton 5-8": {"position": [(0, 0), (-1.236, 2.138)], "rotation": [210, 147.5]},
    "Suh and Radcliffe": {"position": [(1, 1), (2, 0.5), (3, 1.5)], "rotation": [0, 0, 45]},
    "Morgan and Wampler 7": {
        "position": [(-0.83, -0.27), (-0.34, 0.22), (-0.13, 0.43), (0.22, 0.78), (0.50, 1.06)],
        "limits": {"pivot_a": [0, 0], "pivot_b": [1, 0]},
    },
}
FUNCTIONS: dict[str, dict[str, Any]] = {
    "Follower of a crank": {"input": [45, 90, 135], "output": [60, 80, 100]},
    "Weaving machine": {
        "input": [40, 45, 50, 55, 60],
        "output": [70, 76, 83, 91, 100],
        "limits": {"links": {"ground": 180}},
    },
    "Cubic function": {"input": 60 * CHEBYSHEV, "output": 75 * CHEBYSHEV**3},
}
SPECIAL: dict[str, dict[str, Any]] = {
    "Norton 3-2": {"quick_return": {"swing": 90, "time_ratio": 1}},
    "Myszka 5-15": {"quick_return": {"stroke": 46, "time_ratio": 1.37}},
    "Steering trapezoid": {"steering": {"track": 4.5, "wheelbase": 10, "angle": 40}},
}
EXACT = 1e-6
"""Largest error that the document calls exact: degrees, or a fraction of the motion's extent."""
TRANSMISSION = 30.0


@cache
def first_answer(name: str) -> Any:
    """Return the first answer to a task."""
    if name in MOTIONS:
        return la.synthesize(timing="free", **MOTIONS[name]).best
    return la.function(**(FUNCTIONS | SPECIAL)[name]).best


def rows() -> dict[str, list[str]]:
    """Return the cells of the document's table by the name of the task."""
    lines = re.findall(r"^\| (.+) \|$", DOCUMENT.read_text(), re.MULTILINE)
    return {cells[0]: cells[1:] for cells in (line.split(" | ") for line in lines[1:])}


def rocker(links: Any, branch: int, crank: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rocker and transmission angles in radians from the ground line by the law of cosines."""
    diagonal = links[3] - links[0] * np.exp(1j * crank)
    distance = np.abs(diagonal)
    inner = np.arccos((distance**2 + links[2] ** 2 - links[1] ** 2) / (2 * distance * links[2]))
    between = np.arccos((links[1] ** 2 + links[2] ** 2 - distance**2) / (2 * links[1] * links[2]))
    return np.unwrap(np.angle(-diagonal) - branch * inner), np.minimum(between, np.pi - between)


def slider(lengths: dict[str, float], crank: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return slider positions and transmission angles in radians by Pythagoras' theorem."""
    across = lengths["offset"] - lengths["crank"] * np.sin(crank)
    along = np.sqrt(lengths["rod"] ** 2 - across**2)
    return lengths["crank"] * np.cos(crank) + along, np.arctan2(along, np.abs(across))


def body(solution: Any, crank: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return body points, coupler directions and transmission angles from the stored dimensions."""
    links, mount = solution.linkage.links, solution.mount
    ground = np.deg2rad(mount.ground_angle)
    start = np.deg2rad(solution.start_angle)
    angle, transmission = rocker(links, solution.branch, start + crank)
    crank_pin = links[0] * np.exp(1j * (start + crank))
    coupler = links[3] + links[2] * np.exp(1j * angle) - crank_pin
    np.testing.assert_allclose(np.abs(coupler), links[1], rtol=1e-9)
    point = crank_pin + mount.coupler_point_polar.radius * np.exp(
        1j * (np.angle(coupler) + np.deg2rad(mount.coupler_point_polar.angle))
    )
    pivot = complex(*mount.pivot_a)
    return pivot + point * np.exp(1j * ground), np.unwrap(np.angle(coupler)) + ground, transmission


def motion_figures(name: str) -> tuple[list[float], float, float]:
    """Return links, transmission angle over the motion and largest error as a fraction of the extent, or in radians."""
    solution, task = first_answer(name), MOTIONS[name]
    crank = np.deg2rad(solution.crank_angle)
    assert np.all(np.diff(crank) > 0) or np.all(np.diff(crank) < 0)
    points = np.array(task.get("position", [row[:2] for row in task.get("points", [])]), dtype=float) @ [1, 1j]
    if "points" in task:
        ends = np.array(task["points"])
        rotation = np.unwrap(np.arctan2(ends[:, 3] - ends[:, 1], ends[:, 2] - ends[:, 0]))
    else:
        rotation = np.deg2rad(task.get("rotation", []))
    actual, direction, _ = body(solution, crank)
    extent = np.abs(points[:, None] - points).max()
    errors = [np.abs(actual - points).max() / extent]
    if rotation.size:
        errors.append(np.abs(np.angle(np.exp(1j * (direction - direction[0] - rotation + rotation[0])))).max())
    transmission = body(solution, np.linspace(crank[0], crank[-1], 2001))[2]
    return [*solution.linkage.links], float(np.rad2deg(transmission.min())), max(errors)


def function_figures(name: str) -> tuple[list[float], float, float]:
    """Return links, transmission angle over the interval and largest error in degrees."""
    solution, task = first_answer(name), (FUNCTIONS | SPECIAL)[name]
    if name in FUNCTIONS:
        travel, output = np.asarray(task["input"], float), np.asarray(task["output"], float)
        start = solution.start_angle - travel[0]
    else:
        ratio = task["steering"]["track"] / task["steering"]["wheelbase"]
        inner = np.deg2rad(task["steering"]["angle"])
        outer = np.arctan(1 / (1 / np.tan(inner) + ratio))
        left = np.linspace(-outer, inner, 2001)
        output = np.rad2deg(np.arctan(np.tan(left) / (1 + ratio * np.tan(left))))
        travel, start = np.rad2deg(left), solution.start_angle + np.rad2deg(outer)
    actual = (
        np.rad2deg(rocker(solution.links, solution.branch, np.deg2rad(start + travel))[0]) + solution.output_offset
    )
    gap = actual - output
    gap -= 360 * np.round(np.median(gap) / 360)
    used = np.deg2rad(start + np.linspace(travel[0], travel[-1], 2001))
    transmission = rocker(solution.links, solution.branch, used)[1]
    return [*solution.links], float(np.rad2deg(transmission.min())), float(np.abs(gap).max())


def quick_return_figures(name: str) -> tuple[list[float], float, float]:
    """Return lengths, transmission angle over a turn and largest relative error of stroke or swing and of the time ratio."""
    solution, task = first_answer(name), SPECIAL[name]["quick_return"]
    turn = np.deg2rad(np.arange(0, 360, 0.005))
    if "stroke" in task:
        lengths = [solution.lengths[part] for part in ("crank", "rod", "offset")]
        actual, transmission = slider(solution.lengths, turn)
        size = task["stroke"]
    else:
        lengths = [*solution.links]
        actual, transmission = rocker(solution.links, solution.branch, turn)
        size = np.deg2rad(task["swing"])
    slow = (np.argmax(actual) - np.argmin(actual)) * 0.005 % 360
    slow = max(slow, 360 - slow)
    assert slow / (360 - slow) == pytest.approx(task["time_ratio"], abs=3e-4)  # two steps of the grid
    return lengths, float(np.rad2deg(transmission.min())), abs(np.ptp(actual) / size - 1)


def figures(name: str) -> tuple[list[float], float, float]:
    """Return the figures of a first answer, recomputed by loop closure."""
    if name in MOTIONS:
        return motion_figures(name)
    return quick_return_figures(name) if "quick_return" in SPECIAL.get(name, {}) else function_figures(name)


ACCURACY = {"Morgan and Wampler 7": 1e-3, "Steering trapezoid": 1.0}
"""Allowed errors of the tasks without an exact answer: a fraction of the extent, degrees."""
NAMES = [*MOTIONS, *FUNCTIONS, *SPECIAL]


@pytest.mark.parametrize("name", NAMES)
def test_the_first_answer_is_usable(name: str) -> None:
    lengths, transmission, error = figures(name)
    assert first_answer(name).verdict.works
    assert error < ACCURACY.get(name, EXACT)
    assert transmission > TRANSMISSION
    bars = np.abs(lengths) if name != "Myszka 5-15" else np.abs(lengths[:2])
    assert bars.max() < 10 * bars.min()
    if name in MOTIONS:
        points = np.array(MOTIONS[name].get("position", [(0, 0), (2.656, 0.751)])) @ [1, 1j]
        assert bars.max() < 2 * np.abs(points[:, None] - points).max()
        limits = MOTIONS[name].get("limits", {})
        for pivot in limits:
            assert getattr(first_answer(name).mount, pivot) == pytest.approx(limits[pivot], abs=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_the_document_states_the_first_answer(name: str) -> None:
    _, stated_lengths, stated_transmission, stated_error = rows()[name]
    lengths, transmission, error = figures(name)
    assert lengths == pytest.approx([float(length) for length in stated_lengths.split(", ")], rel=5e-3, abs=2e-3)
    assert transmission == pytest.approx(float(stated_transmission), abs=0.3)
    if stated_error == "exact":
        assert error < EXACT
    else:
        value, unit = stated_error.split()
        assert error == pytest.approx(float(value) / (100 if unit == "%" else 1), rel=0.1)


def test_the_document_lists_these_tasks() -> None:
    assert set(rows()) == set(NAMES)


def test_an_exact_answer_to_the_cubic_function_transmits_with_30_degrees() -> None:
    found = la.function(**FUNCTIONS["Cubic function"], limits={"transmission_angle_min": TRANSMISSION})
    assert found.best.errors.max < EXACT and found.best.transmission_angle_min > TRANSMISSION - 1e-6


def test_the_linkage_of_the_textbook_changes_its_branch() -> None:
    """Suh and Radcliffe's pivots (0, 0) and (5, 0) leave a single exact linkage, whose third pose has the other
    branch.
    """
    points = np.array([1 + 1j, 2 + 0.5j, 3 + 1.5j])
    turns = np.exp(1j * np.deg2rad([0, 0, 45]))
    crank_pin, coupler_pin = (points + turns * (pin - points[0]) for pin in (0.994 + 3.238j, 3.547 - 1.655j))
    assert np.ptp(np.abs(crank_pin)) < 2e-3 and np.ptp(np.abs(coupler_pin - 5)) < 2e-3
    side = np.sign((np.conj(coupler_pin - crank_pin) * (5 - crank_pin)).imag)
    assert list(side) == [1, 1, -1]
