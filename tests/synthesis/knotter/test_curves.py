"""Crossings over the bill's angle against the exact events and a naive twin; the step-before points of the source."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from synthesis.knotter import d_knotter
from synthesis.knotter.conditions import crossing_curve, point_paths, step_before
from synthesis.knotter.mechanism import Linear, dimensions, varied
from synthesis.knotter.segment_triangle import Crossing, classify
from tests.oracles.knotter import Exact

FIGURES = json.loads((Path(__file__).parents[2] / "reference" / "knotter.json").read_text())


def at_pair(alpha1: float, alpha3: float, **others):
    machine = d_knotter.mechanism(**others)
    return machine.with_parameters(alpha1=float(np.radians(alpha1)), alpha3=float(np.radians(alpha3)))


@pytest.mark.parametrize("key", FIGURES["wrap"])
def test_e1_runs_into_the_triangle_at_the_exact_event(key) -> None:
    machine, condition = at_pair(*map(int, key.split(","))), d_knotter.wrap()
    angle, _, y, z, leave = FIGURES["wrap"][key]
    driver = np.radians([angle - 1e-6, angle, angle + 1e-6, leave - 1e-6, leave + 1e-6])
    curve = crossing_curve(machine, condition, driver)
    assert curve.inside[[0, 2, 3, 4]].tolist() == [False, True, True, False]
    assert curve.point[1] == pytest.approx([0, y, z], abs=1e-7) and curve.on_rope.all()


def test_crossings_are_those_of_the_equations_typed_out() -> None:
    machine, exact = at_pair(10, 25), Exact(10, 25)
    degrees = np.arange(60, 130, 7.0)
    curve = crossing_curve(machine, d_knotter.wrap(), np.radians(degrees))
    for row, at in enumerate(degrees):
        (y, z), share, corners = exact.wrap(float(np.radians(at)))
        assert curve.point[row, 1:] == pytest.approx([float(y), float(z)], abs=1e-9)
        assert curve.on_rope[row] == (0 < share < 1)
        assert curve.triangle[:, row, 1:] == pytest.approx(
            np.array([[float(x) for x in c] for c in corners]), abs=1e-12
        )


@pytest.mark.parametrize("name", ["wrap", "bite"])
def test_inside_is_the_verdict_of_the_exact_predicate(name) -> None:
    machine, condition = at_pair(20, 25), getattr(d_knotter, name)()
    driver = np.linspace(*condition.window, 1001)
    curve = crossing_curve(machine, condition, driver)
    corners = [np.array(np.broadcast_arrays(*place)).T for place in condition.positions(machine, driver)]
    assert np.array_equal(curve.inside, classify(*corners) == Crossing.CROSSES) and curve.inside.any()


def test_a_rope_parallel_to_its_plane_has_no_crossing() -> None:
    machine = varied(at_pair(10, 25), {"S7.j": 0.0})
    driver = np.linspace(0, 6, 7)
    level = varied(machine, {"d9": 0.0, "d10": 0.0})
    curve = crossing_curve(level, d_knotter.bite(), driver)
    assert np.isfinite(curve.point).all()  # S0 is off the plane: one end in it crosses there
    still = d_knotter.SegmentHitsTriangle("still", ("S3", "S4"), ("S5", "O5", "S10"), "u4", (0.0, 1.0), 0)
    moved = varied(machine, {"S3.j": 5.0, "S4.j": 5.0, "S5.j": 0.0})
    assert np.isnan(crossing_curve(moved, still, driver).point).all()


@pytest.mark.parametrize("key", FIGURES["paper"]["E1_before_hit"])
def test_step_before_points_of_table_1(key) -> None:
    data = FIGURES["REF_PRINT"]
    law = data["laws"]["beta"]
    fitted = {
        "parameters": data["parameters"],
        "laws": {"beta": Linear(np.radians(law["lead"]), law["ratio"])},
        "points": {name: tuple(map(float, xyz)) for name, xyz in data["points"].items()},
    }
    pair = tuple(map(int, key.split(",")))
    _, point = step_before(at_pair(*pair, **fitted), d_knotter.wrap(), np.radians(data["scan_step"]))
    assert point[1:] == pytest.approx(FIGURES["paper"]["E1_before_hit"][key], abs=0.05)
    _, point = step_before(at_pair(*pair), d_knotter.wrap(), np.radians(2.0))
    assert point[1:] == pytest.approx(FIGURES["REF_scan_step_2"][key], abs=6e-4)
    assert step_before(varied(at_pair(*pair), {"S3.j": -500.0, "S4.j": -500.0}), d_knotter.wrap(), 0.1) is None


def test_paths_keep_distances_within_a_body() -> None:
    driver = np.linspace(0, 6, 30)
    paths = point_paths(at_pair(10, 25), ["S1", "S3", "S8", "S10", "S0"], "shaft", driver)
    for one, other in (("S1", "S3"), ("S8", "S10")):
        length = np.linalg.norm(paths[one] - paths[other], axis=1)
        assert np.ptp(length) < 1e-12
    assert np.ptp(paths["S0"], axis=0).max() > 50


def test_a_machine_with_its_own_dimensions_is_itself() -> None:
    machine = at_pair(10, 25)
    known = dimensions(machine)
    assert {"d1", "beta.lead", "beta.ratio", "S1.j", "S10.k"} <= set(known) and "O5.i" not in known
    many = varied(machine, {name: np.full(3, value) for name, value in known.items()})
    for condition in d_knotter.conditions():
        one, three = condition.evaluate(machine, 1), condition.evaluate(many, 3)
        assert three.margin == pytest.approx(np.repeat(one.margin, 3), abs=1e-12)
