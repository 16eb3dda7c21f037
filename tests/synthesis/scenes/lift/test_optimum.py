"""Optimum designs of the lift, compared with published optima, an independent search and direct sums.

The tests would detect a search that misses the global optimum, a design that violates a constraint, and an error with
a wrong amount.
"""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from synthesis.scenes.lift import constrained as product
from synthesis.scenes.lift.optimum import Evaluator, Objective, Optimum, Task
from synthesis.scenes.lift.pose import Cylinder, Design
from tests.conftest import some_of
from tests.oracles import lift as oracle

REFERENCE = json.loads((Path(__file__).parents[3] / "reference/lift_acceptance.json").read_text())
DESIGNS = {name: Design(*map(float, lengths)) for name, lengths in REFERENCE["designs"].items()}
OBJECTIVES = {kind: Objective(kind) for kind in ("discrete", "continuous", "normalized")}
OBJECTIVES["printed"] = Objective("discrete", include_start=False)
CYLINDER = Cylinder(220.0, 100.0)


def task(kind: str = "discrete", bound: float = 600.0, cylinder: Cylinder = CYLINDER, **changes) -> Task:
    return Task(cylinder, 200.0, 510.0, replace(OBJECTIVES[kind], **changes), bound)


@cache
def optimize(problem: Task) -> Optimum:
    """Return the optimum, which several tests use for the same task."""
    return product.optimize(problem, product.source_limits(problem))


def projected() -> Design:
    (design,) = oracle.closed_designs(*REFERENCE["projected"]["arms"], task())
    return design


# -- acceptance values ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", REFERENCE["objective"])
def test_e2_e4_e5_objectives(kind) -> None:
    tolerance = 1e-3 if kind == "continuous" else 2e-3
    evaluate = Evaluator(task(kind))
    for name, value in REFERENCE["objective"][kind].items():
        design = projected() if name == "projected" else DESIGNS[name]
        assert float(evaluate(design)) == pytest.approx(value, abs=tolerance)


@pytest.mark.parametrize("length", some_of([*REFERENCE["table_2"]], 1))
def test_e6_f5_table_2(length) -> None:
    row = REFERENCE["table_2"][length]
    problem = task(cylinder=Cylinder(float(length), 100.0))
    optimum = optimize(problem)
    assert optimum.objective == pytest.approx(row["optimum"], abs=2e-3)
    (published,) = oracle.closed_designs(row["arm"], row["arm"], problem)
    objective = float(Evaluator(problem)(published))
    assert objective == pytest.approx(row["projected"], abs=5e-3)
    assert objective == pytest.approx(row["printed"], rel=0.0122)
    assert objective > optimum.objective


@pytest.mark.parametrize(
    "row",
    some_of(REFERENCE["optima"][::2] + REFERENCE["optima"][1::2], 4),
    ids=lambda row: f"{row['kind']}-{row.get('n', '')}-{row['bound']}",
)
def test_f1_to_f4_optima(row) -> None:
    changes = {"n": row["n"]} if "n" in row else {}
    optimum = optimize(task(row["kind"], float(row["bound"]), **changes))
    value, below, above = row["objective"]
    assert value - below <= optimum.objective <= value + above
    for name in ("l2", "l4", "b"):
        if name in row:
            assert getattr(optimum.design, name) == pytest.approx(row[name][0], abs=row[name][1])
    active = {"l4<=l2"} if row["l2"] == row["l4"] else set()
    if "b" in row:
        active.add("b<=max")
    assert set(optimum.active) == active


# -- against independent search and sums ---------------------------------------------------------------------


@pytest.mark.parametrize("kind", OBJECTIVES)
def test_the_objective_agrees_with_a_direct_sum(kind) -> None:
    problem = task(kind, 1e4)
    for arm, ratio in zip((250.0, 351.9, 500.0, 3000.0), (1.0, 0.9, 0.95, 1.0)):
        for design in oracle.closed_designs(arm, ratio * arm, problem):
            assert float(Evaluator(problem)(design)) == pytest.approx(oracle.objective(design, problem), rel=2e-6)


# -- refusals ------------------------------------------------------------------------------------------------
