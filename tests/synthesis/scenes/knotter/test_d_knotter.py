"""The knotter reproduces its published and reference figures, within the tolerances of tests/reference/knotter.README.md.

A wrong sense, a wrong order of rotations or an inexact event would show as a figure outside its tolerance.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from synthesis.scenes.knotter import d_knotter
from synthesis.scenes.knotter.conditions import crossing_curve, study
from synthesis.scenes.knotter.mechanism import Linear
from tests.oracles.knotter import Exact

FIGURES = json.loads((Path(__file__).parents[3] / "reference" / "knotter.json").read_text())
PAIRS = [(alpha1, alpha3) for alpha1 in (0, 10, 20) for alpha3 in (20, 25, 30)]
EDGES = {"wrap": ("S3S4", "S4S5", "S5S3"), "bite": ("O5S8", "S8S9", "S9O5")}


def at_pair(alpha1: float, alpha3: float, **options):
    machine = d_knotter.mechanism(**options)
    return machine.with_parameters(alpha1=float(np.radians(alpha1)), alpha3=float(np.radians(alpha3)))


def inputs_fitted_to_print():
    data = FIGURES["REF_PRINT"]
    law = data["laws"]["beta"]
    points = {name: tuple(map(float, xyz)) for name, xyz in data["points"].items()}
    laws = {"beta": Linear(np.radians(law["lead"]), law["ratio"])}
    return {"parameters": data["parameters"], "laws": laws, "points": points}


def study_published_grid(**options):
    grid = {name: np.radians(values) for name, values in d_knotter.GRID_DEGREES.items()}
    return study(d_knotter.mechanism(**options), grid, d_knotter.conditions())


@pytest.fixture(scope="module")
def reference():
    return study_published_grid()


def item_of(key: str) -> int:
    return PAIRS.index(tuple(int(part) for part in key.split(",")))


# The chain of frames (A7, A13)


@pytest.mark.parametrize("degrees", FIGURES["S0_u4_10_25"])
def test_position_of_the_holding_point_in_the_frame_of_the_bill(degrees: str) -> None:
    position = at_pair(10, 25).position("S0", "u4", np.radians(float(degrees)))
    assert np.array(position) == pytest.approx(FIGURES["S0_u4_10_25"][degrees], abs=1e-10)


# Entries (A8, A11)


@pytest.mark.parametrize("key", FIGURES["bite"])
def test_bite_events(key: str, reference) -> None:
    angle, fraction = FIGURES["bite"][key]
    result, item = reference.conditions["bite"], item_of(key)
    assert np.degrees(result.enter[item]) == pytest.approx(angle, abs=1e-8)
    assert EDGES["bite"][result.entered_by[item] - 2] == "S8S9"
    assert result.fraction[item] == pytest.approx(fraction, abs=1e-8)
    if key == "10,25":
        assert result.point[item] == pytest.approx(FIGURES["E2_10_25"], abs=1e-8)


# The published pattern (A12)


@pytest.mark.parametrize("inputs", ["REF", "REF_PRINT"])
def test_published_pattern_is_reproduced(inputs: str) -> None:
    result = study_published_grid(**(inputs_fitted_to_print() if inputs == "REF_PRINT" else {}))
    paper = FIGURES["paper"]
    for key, holds in paper["wrap_pattern"].items():
        assert result.conditions["wrap"].holds[item_of(key)] == holds, key
    for key, holds in paper["clearance_pattern"].items():
        assert (result.conditions["clearance"].value[item_of(key)] < 0) == holds, key


# Curves over the bill's angle


def test_crossings_agree_with_the_printed_equations() -> None:
    machine, exact = at_pair(10, 25), Exact(10, 25)
    degrees = np.arange(60, 130, 7.0)
    curve = crossing_curve(machine, d_knotter.wrap(), np.radians(degrees))
    for row, angle in enumerate(degrees):
        (y, z), fraction, corners = exact.wrap(float(np.radians(angle)))
        assert curve.point[row, 1:] == pytest.approx([float(y), float(z)], abs=1e-9)
        assert curve.on_rope[row] == (0 < fraction < 1)
        expected = np.array([[float(x) for x in c] for c in corners])
        assert curve.triangle[:, row, 1:] == pytest.approx(expected, abs=1e-12)
