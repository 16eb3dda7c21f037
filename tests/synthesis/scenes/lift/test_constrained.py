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
from tests.oracles.lift_constrained import cases, evolution_optimum

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


def test_cancelling_ends_the_search() -> None:
    looks = 0

    def left() -> bool:
        nonlocal looks
        looks += 1
        return looks > 3

    with pytest.raises(Cancelled):
        optimize(*CASES["default"], Work(cancelled=left))
    assert looks == 4
