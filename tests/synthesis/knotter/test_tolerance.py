"""Verdicts within tolerances: sensitivities against small steps, corners and samples against machines made one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from synthesis.knotter import d_knotter
from synthesis.knotter.mechanism import ANGLES, dimensions, varied
from synthesis.knotter.study import spread

CONDITIONS = {condition.name: condition for condition in d_knotter.conditions()}


@pytest.fixture(scope="module")
def machine():
    return d_knotter.mechanism().with_parameters(alpha1=math.radians(10), alpha3=math.radians(25))


def box(machine, length: float, degrees: float) -> dict[str, float]:
    names = (name for name in dimensions(machine) if not name.endswith("ratio"))
    return {name: math.radians(degrees) if name in ANGLES else length for name in names}


@pytest.fixture(scope="module")
def found(machine):
    return spread(machine, CONDITIONS, box(machine, 0.1, 0.1), 200, 7)


def margin(machine, name, changes) -> float:
    known = dimensions(machine)
    moved = varied(machine, {key: known[key] + change for key, change in changes.items()})
    return float(CONDITIONS[name].evaluate(moved, 1).margin[0])


@pytest.mark.parametrize("name", CONDITIONS)
def test_corner_and_sensitivities_are_those_of_machines_made_one_by_one(name, machine, found) -> None:
    one, tolerances = found[0][name], box(machine, 0.1, 0.1)
    assert one.margin == margin(machine, name, {}) > 0
    for key in list(tolerances)[::5]:
        step = 1e-4 * tolerances[key]
        slope = (margin(machine, name, {key: step}) - margin(machine, name, {key: -step})) / (2 * step)
        assert one.sensitivity[key] == pytest.approx(slope, rel=2e-3, abs=1e-6), key
    worst = {key: -math.copysign(tolerances[key], one.sensitivity[key]) for key in tolerances if one.sensitivity[key]}
    assert one.corner == pytest.approx(margin(machine, name, worst), abs=1e-12)
    assert one.corner == pytest.approx(one.linear, abs=0.15)
    assert one.corner <= one.least <= one.margin
    edge = {key: one.factor * change for key, change in worst.items()}
    assert margin(machine, name, edge) == pytest.approx(0, abs=1e-6) and one.factor > 1


def test_clearance_sensitivities_have_a_closed_form(machine, found) -> None:
    """At 270 degrees j3 = X cos phi + e h sin phi - e d1 sin alpha1 + D: by D one for one, by d1 by sin alpha1."""
    at = d_knotter.CLEARANCE_AT
    sample = {"clearance": d_knotter.clearance(at, (at, at))}
    one = spread(machine, sample, box(machine, 0.1, 0.1), 0, 0)[0]["clearance"]
    assert one.sensitivity["D"] == pytest.approx(-1, abs=1e-9)
    assert one.sensitivity["d1"] == pytest.approx(-math.sin(math.radians(10)), abs=1e-9)
    assert one.sensitivity["d5"] == pytest.approx(0, abs=1e-9)


def test_wide_tolerances_break_the_knot_and_samples_tell_how_often(machine) -> None:
    tolerances = box(machine, 0.5, 0.5)
    wide, share = spread(machine, CONDITIONS, tolerances, 200, 1)
    assert any(one.corner < 0 for one in wide.values()) and 0.5 < share < 1
    known, random = dimensions(machine), np.random.default_rng(1)
    draws = random.uniform(-1, 1, (10, len(tolerances)))
    holds = []
    for draw in draws[:10]:
        moved = varied(machine, {key: known[key] + x * half for x, (key, half) in zip(draw, tolerances.items())})
        holds.append(all(condition.evaluate(moved, 1).holds[0] for condition in CONDITIONS.values()))
    again, part = spread(machine, CONDITIONS, tolerances, 10, 1)
    assert part == np.mean(holds) and again["wrap"].margin == wide["wrap"].margin


def test_a_knot_that_fails_as_it_is_has_no_factor() -> None:
    machine = d_knotter.mechanism().with_parameters(alpha1=0.0, alpha3=math.radians(20))
    one = spread(machine, {"wrap": d_knotter.wrap()}, box(machine, 0.1, 0.1), 20, 0)[0]["wrap"]
    assert one.margin < 0 and one.factor is None and one.share == 0
