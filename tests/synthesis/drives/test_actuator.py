"""Placements of actuators are optimal on a finer grid, and refusals name the violated limit.

A better placement that is missed, or a wrong derivative, would show here.
"""

from dataclasses import replace

import numpy as np
import pytest

from synthesis.drives.links import SAMPLES, hinged_at, motions_of
from synthesis.drives.placement_search import PlacementSearch
from synthesis.drives.placements import Actuator, Placement, PlacementLimits, Refusal, Sizes
from synthesis.linkage import four_bar
from synthesis.studies.forces import Load
from synthesis.target import Interval
from tests.conftest import some_of
from tests.oracles.driven_cases import Case, straight


@pytest.mark.parametrize("seed", some_of(range(1, 33), 10))
def test_no_finer_grid_finds_a_smaller_force(seed: int) -> None:
    case = Case(seed)
    found, fine = case.question().best(case.actuator), case.question(150)
    repeated = fine.best(case.actuator)
    fine.link = replace(fine.link, pivot=None)
    grid = fine.screen([case.actuator])
    if isinstance(found, Refusal):
        assert isinstance(repeated, Refusal)
        assert isinstance(grid, Refusal) or grid.shortfall is not None
        return
    assert isinstance(repeated, Refusal) or found.worst <= repeated.worst * (1 + 1e-6)
    assert isinstance(grid, Refusal) or found.worst <= (1 + 1e-6) * fine.torque_scale / grid.best_value


def test_the_closed_form_has_the_largest_least_arm() -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        swing, stroke = rng.uniform(0.2, 2.0) * rng.choice([-1, 1]), rng.uniform(0.2, 2)
        actuator = Actuator(stroke * rng.uniform(1, 3), stroke)
        machine = hinged_at(0.3 + 0.1j, rng.uniform(0, 6), 1.0, np.linspace(0.0, swing, SAMPLES))
        link = machine.links["rocker"]
        (_, _, arm), ground, pin = straight(link, actuator)
        box = (-20.0, -20.0, 20.0, 20.0)
        question = PlacementSearch(link, machine.at, np.zeros(61), PlacementLimits(box, 20.0, 0.0))
        placed = question.evaluate(ground, pin)
        assert np.abs(placed.arm).min() == pytest.approx(arm, rel=1e-12)
        assert placed.length[[0, -1]] == pytest.approx([actuator.retracted, sum(actuator)], rel=1e-12)
        found = question.best(actuator)
        assert isinstance(found, Placement)
        assert np.abs(found.arm).min() == pytest.approx(arm, rel=1e-6)
        bound = question.force_bound(stroke) / found.worst
        assert bound == pytest.approx(abs(swing) / 2 / np.tan(abs(swing) / 2), rel=1e-6)


def test_a_shorter_dead_length_and_a_larger_box_lose_no_answer() -> None:
    """The first linkage was refused with a dead length of 10, the second in the larger box; the third found a worse place."""

    def question(
        links: tuple[float, float, float, float],
        branch: int,
        start: float,
        span: float,
        half: float,
        name: str = "coupler",
    ) -> PlacementSearch:
        direction = Interval(0.0, float(np.deg2rad(span)))
        position = (5 + 8j, float(np.deg2rad(10)), (40.0, float(np.deg2rad(30))))
        machine = motions_of(four_bar(links, branch, float(np.deg2rad(start)), *position), direction)
        torque = machine.torque(Load(3 - 20j, 30.0))
        expected = PlacementLimits((-half, -half, half + 50, half + 50), machine.reaches[name], 2.0 / machine.span)
        return PlacementSearch(machine.links[name], machine.at, torque, expected)

    first_question = question((87.1, 92.42, 79.71, 46.03), -1, -64.278, 186.1, 100.0)
    forces = []
    for dead in (10.0, 30.0, 45.0):
        found = first_question.best_of_sizes(Sizes(Actuator(1.0, 20.0), True, False, dead))
        assert isinstance(found, Placement)
        forces.append(found.worst)
    assert forces[0] <= forces[1] * (1 + 1e-6) and forces[1] <= forces[2] * (1 + 1e-6)
    boxes = [question((81.17, 70.76, 96.01, 34.97), 1, 131.388, -189.97, half) for half in (100.0, 200.0)]
    small, large = (box.best(Actuator(50.0, 20.0)) for box in boxes)
    assert isinstance(small, Placement)
    assert isinstance(large, Placement)
    assert large.worst <= small.worst * (1 + 1e-6)
    third = (30.73, 63.76, 85.49, 65.17), -1, -49.367, -151.36
    boxes = [question(*third, half, "crank") for half in (100.0, 200.0)]
    small, large = (box.best_of_sizes(Sizes(Actuator(1.0, 1.0), True, True)) for box in boxes)
    assert isinstance(small, Placement)
    assert isinstance(large, Placement)
    assert large.worst <= small.worst * (1 + 1e-6)
