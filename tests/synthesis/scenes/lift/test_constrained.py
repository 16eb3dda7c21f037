"""Optima of the lift within constraints, checked by independent code and an independent search, and the errors.

The tests would detect a design that violates a constraint between the nodes of the search, and an error that names
the wrong constraint.
"""

import math
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from synthesis.errors import FieldError
from synthesis.scenes.lift.constraints import (
    Constraints,
    DesignSpace,
    constraint_rows,
    measured_values,
    optimize_within,
    platform_rates,
    slacks,
)
from synthesis.scenes.lift.motion import motion
from synthesis.scenes.lift.optimum import Objective, Optimum, StrokeDesign, Task, optimize
from synthesis.scenes.lift.pose import Cylinder, Design
from synthesis.work import Cancelled, Work
from tests.conftest import some_of
from tests.oracles import lift as oracle
from tests.oracles.lift_constrained import cases, evolution_optimum, limits

CASES = cases()
LOOSE = Constraints({name: (51.0, 600.0) for name in ("l2", "l3", "l4", "l5", "b")}, (220.0, 600.0))


@cache
def found(name: str) -> Optimum:
    return optimize_within(*CASES[name])


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


def test_the_optimum_names_the_constraints_on_which_it_lies() -> None:
    task, constraints = CASES["default"]
    optimum = found("default")
    values = oracle.constrained_quantities(
        optimum.stroke_design.design, float(optimum.stroke_design.closed_length), 100.0, 200.0, 510.0
    )
    at_limit = {
        row.name for row in constraint_rows(constraints, values) if abs(row.value - row.limit) < 2e-3 * abs(row.limit)
    }
    assert at_limit == {name.split(">=")[0].split("<=")[0] for name in optimum.active}
    assert slack_names(task, constraints) >= set(optimum.active)


def slack_names(task: Task, constraints: Constraints) -> set[str]:
    """Return the names of all constraints for which slacks are computed."""
    built = DesignSpace(task, constraints).designs(np.full((1, 4), 0.5), np.ones(1))
    return set(slacks(built, task, constraints))


def test_differential_evolution_finds_no_better_design() -> None:
    """Use a short run; `benchmarks.lift_constrained` makes a run with 200,000 evaluations."""
    best, _ = evolution_optimum(*CASES["collinear start"], 6000)
    assert found("collinear start").objective <= best * 1.005


def test_without_limits_the_collinear_start_gives_the_optimum_of_the_source() -> None:
    task = Task(Cylinder(220.0, 100.0), 200.0, 510.0, Objective("normalized"), 600.0)
    free = optimize(task)
    wide = Constraints({name: (1.0, 600.0) for name in LOOSE.lengths}, (220.0, 220.0), start="collinear")
    optimum = optimize_within(task, wide)
    assert optimum.objective == pytest.approx(free.objective, rel=1e-4)
    assert "l4<=l2" in optimum.active


def test_the_speed_does_not_affect_the_optimum() -> None:
    """Check that the design is the same if acceleration and jerk limits are scaled with the speed, also when lowering."""
    task, constraints = CASES["default"]
    scaled = replace(constraints, acceleration_max=1000 * 0.8**2, jerk_max=10_000 * 0.8**3)
    slow = optimize_within(replace(task, cylinder=Cylinder(220.0, -80.0)), scaled)
    assert slow.objective == pytest.approx(found("default").objective, rel=1e-6)


def test_constraints_hold_for_a_decelerating_cylinder() -> None:
    task, constraints = CASES["default"]
    optimum = optimize_within(replace(task, cylinder=Cylinder(220.0, 120.0, -6.0)), constraints)
    drive = Cylinder(float(optimum.stroke_design.closed_length), 120.0, -6.0)
    trajectory = motion(optimum.stroke_design.design, drive, samples=2001)
    assert np.abs(trajectory.acceleration).max() <= constraints.acceleration_max
    assert trajectory.time[-1] == pytest.approx(
        measured_values(optimum.stroke_design, replace(task, cylinder=drive))["rise_time"], rel=1e-9
    )


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
    optimum = optimize_within(task, constraints)
    values = measured_values(optimum.stroke_design, task)
    assert values[name] == pytest.approx(value, rel=1e-12)
    assert [row.name for row in constraint_rows(constraints, values) if not row.satisfied and row.name != name] == []


def test_a_value_that_needs_a_nearly_flat_triangle_is_found() -> None:
    """Check a gamma at the end of its range; rounding may violate l4 by 1e-12 of the top height."""
    (task, constraints), l4 = CASES["default"], 52.0
    optimum = optimize_within(task, replace(constraints, lengths=constraints.lengths | {"l4": (l4, l4)}))
    assert optimum.stroke_design.gamma < 1e-4 and optimum.design.l4 == pytest.approx(l4, abs=1e-12 * task.high)


def test_a_range_is_at_least_as_good_as_a_value_inside_it() -> None:
    """Check that an objective that decreases far outside the limits does not lead the search astray."""
    task = replace(CASES["default"][0], upper_bound=800.0)
    wide = limits(510.0, 800.0, (220.0, 800.0))
    single, ranged = (
        optimize_within(task, replace(wide, lengths=wide.lengths | {"l4": (300.0 - room, 300.0 + room)}))
        for room in (0.0, 0.5)
    )
    assert ranged.objective < single.objective


def refused(task: Task, limits: Constraints) -> FieldError:
    """Return the error of a search that finds no design."""
    with pytest.raises(FieldError) as caught:
        optimize_within(task, limits)
    return caught.value


def test_a_box_can_end_at_the_top_of_the_stroke_but_not_below() -> None:
    task, constraints = CASES["default"]
    low, high = (
        optimize_within(task, replace(constraints, envelope=(None, 0.0, None, top))).objective
        for top in (510.0, 510.001)
    )
    assert low == pytest.approx(high, rel=1e-4)
    assert refused(task, replace(constraints, envelope=(None, 0.0, None, 509.0))).details == {
        "constraint": "envelope",
        "amount": 1.0,
    }


@pytest.mark.parametrize(
    ("change", "constraint"),
    some_of(
        [
            ({"rise_time": (5.0, 4.0)}, "rise_time"),
            ({"envelope": (None, 5.0, None, None)}, "envelope"),
            ({"closed_length": (300.0, 200.0)}, "closed_length"),
            ({"jerk_max": 1e-3}, "jerk<=max"),
            ({"lengths": LOOSE.lengths | {"l3": (300.0, 400.0)}}, "l3>=min"),
        ],
        3,
    ),
)
def test_the_error_names_the_violated_constraint(change, constraint) -> None:
    task, constraints = CASES["default"]
    error = refused(task, replace(constraints, **change))
    assert error.details["constraint"] == constraint
    assert error.field.startswith("/constraints")


def test_the_error_names_all_violations_of_the_nearest_design() -> None:
    task, constraints = CASES["default"]
    error = refused(task, replace(constraints, lengths=constraints.lengths | {"l2": (None, 5.0)}))
    assert "jerk<=max by" in error.message and "l2<=max by" in error.message
    assert error.details["amount"] < 0.2


def test_a_cylinder_that_stops_early_is_refused_with_the_smallest_violation() -> None:
    task, constraints = CASES["default"]
    error = refused(replace(task, cylinder=Cylinder(220.0, 100.0, -30.0)), constraints)
    assert "stopping by" in error.message and error.details["amount"] < 0.1


def test_cancelling_ends_the_search() -> None:
    looks = 0

    def left() -> bool:
        nonlocal looks
        looks += 1
        return looks > 3

    with pytest.raises(Cancelled):
        optimize_within(*CASES["default"], Work(cancelled=left))
    assert looks == 4


def test_jerk_is_the_derivative_of_acceleration() -> None:
    design, drive, h = Design(130.5, 165.5, 223.5, 344.5, 560.3), Cylinder(482.2, 100.0, 7.0), 1e-4
    times = np.linspace(0.01, 3.0, 40)
    trajectory = motion(design, drive, times)
    rates = platform_rates(trajectory.pose, drive, trajectory.cylinder_speed)
    assert rates.acceleration == pytest.approx(trajectory.acceleration, rel=1e-12)
    ahead, behind = (motion(design, drive, times + step).acceleration for step in (h, -h))
    assert rates.jerk == pytest.approx((ahead - behind) / (2 * h), rel=1e-5, abs=1e-4)


def test_designs_of_the_search_meet_the_stroke() -> None:
    for name in ("default", "collinear start"):
        task, constraints = CASES[name]
        space = DesignSpace(task, constraints)
        rng = np.random.default_rng(4)
        candidates = space.designs(
            rng.uniform(0, 1, (400, space.count)), np.where(rng.uniform(size=400) < 0.5, 1.0, -1.0)
        )
        good = np.nonzero(np.isfinite(candidates.design.b) & (candidates.design.l3 < candidates.design.l5))[0]
        assert good.size > 60
        for at in good[:60]:
            design = Design(*(float(field[at]) for field in candidates.design.as_tuple()))
            turn = float(candidates.turn[at])
            textbook = oracle.pose(design, turn)
            assert textbook["height"] == pytest.approx(task.low, rel=1e-9)
            assert textbook["length"] == pytest.approx(float(candidates.closed_length[at]), rel=1e-8)
            assert oracle.pose(design, 0.0)["height"] == pytest.approx(task.high, rel=1e-12)


def test_a_slack_is_negative_exactly_if_the_limit_is_violated() -> None:
    task, constraints = CASES["default"]
    loose = optimize_within(task, LOOSE).stroke_design
    missed = {row.name for row in constraint_rows(constraints, measured_values(loose, task)) if not row.satisfied}
    *lengths, gamma, turn, closed = map(
        np.atleast_1d, (*loose.design.as_tuple(), loose.gamma, loose.turn, loose.closed_length)
    )
    found = slacks(StrokeDesign(Design(*lengths), gamma, turn, closed), task, constraints, 801)
    negative = {re.split("[<>]=", name)[0] for name, slack in found.items() if slack.min() < 0}
    assert missed and negative == missed
    assert limits(510.0, 600.0, (220.0, 600.0)) == constraints
    assert math.isclose(constraints.transmission_min, math.pi / 6)
