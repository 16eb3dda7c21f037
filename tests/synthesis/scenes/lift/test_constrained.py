"""The lift within constraints: kept on 2,001 poses by independent code, not beaten by an independent search, refusals, laws."""

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
from tests.oracles.lift_constrained import cases, evolved, limits

CASES = cases()
LOOSE = Constraints({name: (51.0, 600.0) for name in ("l2", "l3", "l4", "l5", "b")}, (220.0, 600.0))


@cache
def found(name: str) -> Optimum:
    return optimize_within(*CASES[name])


@pytest.mark.parametrize("name", CASES)
def test_every_constraint_is_kept_on_2001_poses_by_independent_code(name) -> None:
    task, wanted = CASES[name]
    one = found(name)
    design, closed = one.stroke_design.design, float(one.stroke_design.closed_length)
    values = oracle.measures(design, closed, task.cylinder.speed, task.low, task.high)
    rows = constraint_rows(wanted, values)
    assert len(rows) > 12 and [row for row in rows if not row.satisfied] == []
    own = replace(task, cylinder=replace(task.cylinder, length=closed))
    assert oracle.objective(design, own) == pytest.approx(one.objective, rel=2e-6)
    mine = measured_values(one.stroke_design, task)
    assert mine.keys() == values.keys()
    for key, value in values.items():
        # the dead point is walked to in steps of 1e-4 rad, the extreme of a curve lies between poses
        assert mine[key] == pytest.approx(value, rel=2e-4, abs=1e-6), key


def test_the_optimum_lies_on_constraints_and_says_which() -> None:
    task, wanted = CASES["default"]
    one = found("default")
    values = oracle.measures(one.stroke_design.design, float(one.stroke_design.closed_length), 100.0, 200.0, 510.0)
    near = {row.name for row in constraint_rows(wanted, values) if abs(row.value - row.limit) < 2e-3 * abs(row.limit)}
    assert near == {name.split(">=")[0].split("<=")[0] for name in one.active}
    assert slack_names(task, wanted) >= set(one.active)


def slack_names(task: Task, wanted: Constraints) -> set[str]:
    """The names of all constraints that are computed."""
    built = DesignSpace(task, wanted).designs(np.full((1, 4), 0.5), np.ones(1))
    return set(slacks(built, task, wanted))


def test_differential_evolution_does_not_beat_it() -> None:
    """A short run; that of 200,000 evaluations is `benchmarks.lift_constrained`."""
    best, _ = evolved(*CASES["collinear start"], 6000)
    assert found("collinear start").objective <= best * 1.005


def test_without_limits_the_collinear_start_gives_the_optimum_of_the_source() -> None:
    task = Task(Cylinder(220.0, 100.0), 200.0, 510.0, Objective("normalized"), 600.0)
    free = optimize(task)
    wide = Constraints({name: (1.0, 600.0) for name in LOOSE.lengths}, (220.0, 220.0), start="collinear")
    one = optimize_within(task, wide)
    assert one.objective == pytest.approx(free.objective, rel=1e-4)
    assert "l4<=l2" in one.active


def test_speed_does_not_move_the_optimum() -> None:
    """As fast, as far in acceleration and jerk: the same design, lowering too."""
    task, wanted = CASES["default"]
    same = replace(wanted, acceleration_max=1000 * 0.8**2, jerk_max=10_000 * 0.8**3)
    other = optimize_within(replace(task, cylinder=Cylinder(220.0, -80.0)), same)
    assert other.objective == pytest.approx(found("default").objective, rel=1e-6)


def test_a_braking_cylinder_keeps_the_constraints_too() -> None:
    task, wanted = CASES["default"]
    one = optimize_within(replace(task, cylinder=Cylinder(220.0, 120.0, -6.0)), wanted)
    drive = Cylinder(float(one.stroke_design.closed_length), 120.0, -6.0)
    moved = motion(one.stroke_design.design, drive, samples=2001)
    assert np.abs(moved.acceleration).max() <= wanted.acceleration_max
    assert moved.time[-1] == pytest.approx(
        measured_values(one.stroke_design, replace(task, cylinder=drive))["rise_time"], rel=1e-9
    )


@pytest.mark.parametrize(
    ("stroke", "change", "name", "value"),
    [
        ((200.0, 510.0), {"lengths": {"b": (600.0, 600.0)}}, "b", 600.0),
        ((200.0, 510.0), {"lengths": {"l4": (200.0, 200.0)}}, "l4", 200.0),
        ((200.0, 510.0), {"rise_time": (3.0, 3.0)}, "rise_time", 3.0),
        (
            (300.0, 350.0),
            {"closed_length": (320.0, 320.0), "envelope": (-1000.0, 0.0, 200.0, 350.035)},
            "closed_length",
            320.0,
        ),
    ],
)
def test_a_range_may_be_one_value(stroke, change, name, value) -> None:
    """A frame that is there, a cylinder of a catalogue; no other limit is broken for it."""
    low, high = stroke
    task = replace(CASES["default"][0], low=low, high=high, upper_bound=800.0)
    wide = limits(high, 800.0, (220.0, 800.0))
    wanted = replace(wide, **{**change, "lengths": wide.lengths | change.get("lengths", {})})
    one = optimize_within(task, wanted)
    values = measured_values(one.stroke_design, task)
    assert values[name] == pytest.approx(value, rel=1e-12)
    assert [row.name for row in constraint_rows(wanted, values) if not row.satisfied and row.name != name] == []


@pytest.mark.parametrize("l4", [51.0, 52.0, 60.0])
def test_one_value_that_only_a_nearly_flat_triangle_has_is_found(l4) -> None:
    """There gamma lies at the end of its range; rounding may break l4 by 1e-12 of the top height."""
    task, wanted = CASES["default"]
    one = optimize_within(task, replace(wanted, lengths=wanted.lengths | {"l4": (l4, l4)}))
    assert one.stroke_design.gamma < 1e-4 and one.design.l4 == pytest.approx(l4, abs=1e-12 * task.high)


def test_what_one_value_allows_a_range_about_it_does_too() -> None:
    """An objective that falls far outside of the limits does not draw the search out of them."""
    task = replace(CASES["default"][0], upper_bound=800.0)
    wide = limits(510.0, 800.0, (220.0, 800.0))
    one, near = (
        optimize_within(task, replace(wide, lengths=wide.lengths | {"l4": (300.0 - room, 300.0 + room)}))
        for room in (0.0, 0.5)
    )
    assert near.objective < one.objective


def refused(task: Task, limits: Constraints) -> FieldError:
    """The error of a search that finds no design."""
    with pytest.raises(FieldError) as caught:
        optimize_within(task, limits)
    return caught.value


def test_a_box_may_end_at_the_top_of_the_stroke_and_not_below() -> None:
    task, wanted = CASES["default"]
    low, high = (
        optimize_within(task, replace(wanted, envelope=(None, 0.0, None, top))).objective for top in (510.0, 510.001)
    )
    assert low == pytest.approx(high, rel=1e-4)
    assert refused(task, replace(wanted, envelope=(None, 0.0, None, 509.0))).details == {
        "constraint": "envelope",
        "amount": 1.0,
    }


@pytest.mark.parametrize(
    ("change", "constraint"),
    some_of(
        [
            ({"lengths": LOOSE.lengths | {"l2": (51.0, 60.0)}}, "l2<=max"),
            ({"rise_time": (5.0, 4.0)}, "rise_time"),
            ({"envelope": (None, 5.0, None, None)}, "envelope"),
            ({"closed_length": (300.0, 200.0)}, "closed_length"),
            ({"jerk_max": 1e-3}, "jerk<=max"),
            ({"lengths": LOOSE.lengths | {"l3": (300.0, 400.0)}}, "l3>=min"),
        ],
        4,
    ),
)
def test_what_cannot_be_kept_is_named(change, constraint) -> None:
    task, wanted = CASES["default"]
    error = refused(task, replace(wanted, **change))
    assert error.details["constraint"] == constraint
    assert error.field.startswith("/constraints")


def test_limits_that_the_nearest_design_breaks_alike_are_all_named() -> None:
    task, wanted = CASES["default"]
    error = refused(task, replace(wanted, lengths=wanted.lengths | {"l2": (None, 5.0)}))
    assert "jerk<=max by" in error.message and "l2<=max by" in error.message
    assert error.details["amount"] < 0.2


def test_a_cylinder_that_would_rest_is_refused_by_how_little_the_nearest_design_misses() -> None:
    task, wanted = CASES["default"]
    error = refused(replace(task, cylinder=Cylinder(220.0, 100.0, -30.0)), wanted)
    assert "stopping by" in error.message and error.details["amount"] < 0.1


def test_a_client_that_leaves_ends_the_search() -> None:
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
    moved = motion(design, drive, times)
    run = platform_rates(moved.pose, drive, moved.cylinder_speed)
    assert run.acceleration == pytest.approx(moved.acceleration, rel=1e-12)
    ahead, behind = (motion(design, drive, times + step).acceleration for step in (h, -h))
    assert run.jerk == pytest.approx((ahead - behind) / (2 * h), rel=1e-5, abs=1e-4)


def test_designs_of_the_search_meet_the_stroke() -> None:
    for name in ("default", "collinear start"):
        task, wanted = CASES[name]
        space = DesignSpace(task, wanted)
        rng = np.random.default_rng(4)
        built = space.designs(rng.uniform(0, 1, (400, space.count)), np.where(rng.uniform(size=400) < 0.5, 1.0, -1.0))
        good = np.nonzero(np.isfinite(built.design.b) & (built.design.l3 < built.design.l5))[0]
        assert good.size > 60
        for at in good[:60]:
            design = Design(*(float(field[at]) for field in built.design.as_tuple()))
            turn = float(built.turn[at])
            textbook = oracle.pose(design, turn)
            assert textbook["height"] == pytest.approx(task.low, rel=1e-9)
            assert textbook["length"] == pytest.approx(float(built.closed_length[at]), rel=1e-8)
            assert oracle.pose(design, 0.0)["height"] == pytest.approx(task.high, rel=1e-12)


def test_slacks_are_negative_exactly_where_a_limit_is_missed() -> None:
    task, wanted = CASES["default"]
    loose = optimize_within(task, LOOSE).stroke_design
    missed = {row.name for row in constraint_rows(wanted, measured_values(loose, task)) if not row.satisfied}
    *lengths, gamma, turn, closed = map(
        np.atleast_1d, (*loose.design.as_tuple(), loose.gamma, loose.turn, loose.closed_length)
    )
    found = slacks(StrokeDesign(Design(*lengths), gamma, turn, closed), task, wanted, 801)
    negative = {re.split("[<>]=", name)[0] for name, slack in found.items() if slack.min() < 0}
    assert missed and negative == missed
    assert limits(510.0, 600.0, (220.0, 600.0)) == wanted
    assert math.isclose(wanted.transmission_min, math.pi / 6)
