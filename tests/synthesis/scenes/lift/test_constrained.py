"""Optima of the lift within constraints, checked by independent code and an independent search, and the errors.

The tests would detect a design that violates a constraint between the nodes of the search, and an error that names
the wrong constraint.
"""

from dataclasses import replace
from functools import cache

import pytest

from synthesis.scenes.lift.constrained import optimize
from synthesis.scenes.lift.constraints import constraint_rows, measured_values
from synthesis.scenes.lift.optimum import Optimum
from synthesis.work import Cancelled, Work
from tests.oracles import lift as oracle
from tests.oracles.lift_constrained import cases, evolution_optimum, limits

CASES = cases()


@cache
def found(name: str) -> Optimum:
    return optimize(*CASES[name])


@pytest.mark.parametrize("name", CASES)
def test_independent_code_confirms_every_constraint_on_2001_poses(name) -> None:
    task, constraints = CASES[name]
    optimum = found(name)
    design, closed = optimum.stroke_design.design, float(optimum.stroke_design.closed_length)
    values = oracle.constrained_quantities(design, closed, task.cylinder.speed, task.low, task.high)
    rows = constraint_rows(constraints, values)
    assert len(rows) > 12 and [row for row in rows if not row.satisfied] == []
    own = replace(task, cylinder=replace(task.cylinder, length=closed))
    assert oracle.objective(design, own) == pytest.approx(optimum.objective, rel=2e-6)
    measured = measured_values(optimum.stroke_design, task)
    assert measured.keys() == values.keys()
    for key, value in values.items():
        # the oracle finds the dead point in steps of 1e-4 rad, and the extreme of a curve lies between its poses
        assert measured[key] == pytest.approx(value, rel=2e-4, abs=1e-6), key


def test_differential_evolution_finds_no_better_design() -> None:
    """Use a short run; `benchmarks.lift_constrained` makes a run with 200,000 evaluations."""
    best, _ = evolution_optimum(*CASES["collinear start"], 6000)
    assert found("collinear start").objective <= best * 1.005


@pytest.mark.parametrize(
    ("stroke", "change", "name", "value"),
    [
        ((200.0, 510.0), {"lengths": {"b": (600.0, 600.0)}}, "b", 600.0),
        ((200.0, 510.0), {"rise_time": (3.0, 3.0)}, "rise_time", 3.0),
        (
            (300.0, 350.0),
            {"closed_length": (320.0, 320.0), "envelope": (-1000.0, 0.0, 200.0, 350.035)},
            "closed_length",
            320.0,
        ),
    ],
)
def test_a_range_can_be_a_single_value(stroke, change, name, value) -> None:
    """Check an existing frame length and a cylinder from a catalogue; no other limit may be violated."""
    low, high = stroke
    task = replace(CASES["default"][0], low=low, high=high, upper_bound=800.0)
    wide = limits(high, 800.0, (220.0, 800.0))
    constraints = replace(wide, **{**change, "lengths": wide.lengths | change.get("lengths", {})})
    optimum = optimize(task, constraints)
    values = measured_values(optimum.stroke_design, task)
    assert values[name] == pytest.approx(value, rel=1e-12)
    assert [row.name for row in constraint_rows(constraints, values) if not row.satisfied and row.name != name] == []


def test_cancelling_ends_the_search() -> None:
    looks = 0

    def left() -> bool:
        nonlocal looks
        looks += 1
        return looks > 3

    with pytest.raises(Cancelled):
        optimize(*CASES["default"], Work(cancelled=left))
    assert looks == 4
