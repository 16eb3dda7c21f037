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
    """Return the cells of the table in the document by the name of the task."""
    lines = re.findall(r"^\| (.+) \|$", DOCUMENT.read_text(), re.MULTILINE)
    return {cells[0]: cells[1:] for cells in (line.split(" | ") for line in lines[1:])}


def figures(name: str) -> tuple[list[float], float, float]:
    """Return lengths, smallest transmission angle in degrees, and error: degrees, or a fraction of the motion's extent."""
    solution = first_answer(name)
    if name not in MOTIONS:
        lengths = solution.lengths or {} if name == "Myszka 5-15" else {}
        return [*(lengths.values() or solution.links)], solution.transmission_angle_min, solution.errors.max
    points = np.array(MOTIONS[name].get("position", [(0, 0), (2.656, 0.751)])) @ [1, 1j]
    extent = np.abs(points[:, None] - points).max()
    error = max(solution.errors.position_max / extent, solution.errors.rotation_max or 0.0)
    return [*solution.linkage.links], solution.transmission_angle_min, error


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
