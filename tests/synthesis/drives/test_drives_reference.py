"""Drives and springs reproduce the checked examples to the digits of tests/reference/drives.json.

A change of a formula for drives would show here.
"""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from synthesis.drives.balance import springs_on_pendulums
from synthesis.drives.crank_rocker import place_motor_about_pivot, proportions
from synthesis.drives.links import LinkMotions, motions_of
from synthesis.drives.motor import evaluate_motor
from synthesis.drives.placement_search import PlacementSearch
from synthesis.drives.placements import Actuator, PlacementLimits, Refusal
from synthesis.drives.springs import Spring, SpringRow, torque_of
from synthesis.link_motion import Mass
from synthesis.linkage import Linkage, four_bar
from synthesis.studies.forces import Load
from synthesis.target import Interval
from tests.oracles.driven_cases import straight

REFERENCE = json.loads((Path(__file__).parents[2] / "reference" / "drives.json").read_text())
DEGREE = np.pi / 180


def linkage_of(row: dict) -> Linkage:
    radius, angle = row["coupler_point_polar"]
    mount = complex(*row["pivot_a"]), row["ground_angle"] * DEGREE, (radius, angle * DEGREE), 0.0
    return four_bar(tuple(row["links"]), row.get("branch", 1), row["start"] * DEGREE, *mount)


def machine(row: dict, samples: int = 61) -> LinkMotions:
    return motions_of(linkage_of(row), Interval(0.0, row["span"] * DEGREE), samples)


def question(row: dict, link: str) -> PlacementSearch:
    linkage = machine(row)
    torque = linkage.torque(Load(complex(*row["force"])))
    amount = row.get("amount", row.get("work"))
    expected = PlacementLimits(tuple(row["box"]), row["reach"], row["arm"])
    return PlacementSearch(linkage.links[link], linkage.at, torque, expected, torque_integral=amount)


CASEMENT, COMPLETE = REFERENCE["casement"], REFERENCE["whole_numbers"]


def test_torques_work_and_bound_of_the_casement() -> None:
    linkage = machine(CASEMENT)
    torque = linkage.torque(Load(complex(*CASEMENT["force"])))
    assert torque[[0, -1]] == pytest.approx([CASEMENT["torque_first"], CASEMENT["torque_last"]], abs=1e-6)
    assert np.abs(torque).max() == pytest.approx(CASEMENT["torque_largest"], abs=1e-6)
    at_b = np.abs(torque / linkage.links["rocker"].rate).max()
    assert at_b == pytest.approx(CASEMENT["torque_b_largest"], abs=1e-6)
    assert abs(linkage.links["rocker"].swing()) / DEGREE == pytest.approx(CASEMENT["rocker_swing"], abs=1e-6)
    assert abs(linkage.links["coupler"].swing()) / DEGREE == pytest.approx(CASEMENT["coupler_swing"], abs=1e-6)
    assert question(CASEMENT, "crank").force_bound(150) == pytest.approx(CASEMENT["bound"], abs=1e-6)


def test_the_actuator_on_the_crank_in_closed_form() -> None:
    want, problem = CASEMENT["straight"], question(CASEMENT, "crank")
    actuator = Actuator(255, 150)
    found, ground, pin = straight(problem.link, actuator)
    assert found == pytest.approx((want["pin"], want["ground"], want["arm"]), abs=1e-6)
    position = problem.evaluate(ground, pin)
    assert [ground.real, ground.imag] == pytest.approx(want["ground_point"], abs=1e-6)
    at_first = problem.link.position(pin)[0]
    assert [at_first.real, at_first.imag] == pytest.approx(want["pin_at"], abs=1e-6)
    assert position.length[[0, -1]] == pytest.approx([255, 405], abs=1e-9)
    assert position.peak == pytest.approx(want["peak"], abs=1e-6)
    assert 1000 / np.abs(position.arm).min() == pytest.approx(want["unit"], abs=1e-6)
    assert problem.best(actuator) == Refusal("reach", pytest.approx(want["pin"], abs=1e-6))


@pytest.mark.parametrize("link", ["coupler", "rocker"])
def test_the_same_actuator_on_coupler_and_rocker(link: str) -> None:
    want, problem = CASEMENT[link], question(CASEMENT, link)
    found = problem.best(Actuator(255, 150))
    assert not isinstance(found, Refusal)
    assert found.peak == pytest.approx(want["peak"], abs=1e-6)
    assert np.abs(found.arm).min() == pytest.approx(want["arm"], abs=1e-5)
    assert found.peak / problem.force_bound(150) == pytest.approx(want["over"], abs=5e-4)
    assert found.length[[0, -1]] == pytest.approx([255, 405] if found.extends else [405, 255], abs=1e-9)
    if link == "coupler":
        at_first = problem.link.position(found.pin)[0]
        assert found.extends
        assert [found.ground.real, found.ground.imag] == pytest.approx(want["ground"], abs=1e-4)
        assert [at_first.real, at_first.imag] == pytest.approx(want["pin"], abs=1e-4)
    else:
        assert not found.extends
        assert abs(found.ground - problem.link.pivot) == pytest.approx(want["ground"], abs=1e-4)
        assert abs(found.pin) == pytest.approx(want["pin"], abs=1e-4)


@pytest.mark.parametrize("stroke", list(CASEMENT["catalogue"]))
def test_a_catalogue_on_all_three_links(stroke: str) -> None:
    for link, peak in zip(("crank", "coupler", "rocker"), CASEMENT["catalogue"][stroke]):
        found = question(CASEMENT, link).best(Actuator(float(stroke) + 105, float(stroke)))
        assert (None if isinstance(found, Refusal) else round(found.peak, 3)) == peak, link


def motor_torque(row: dict, motor: complex, crank: float, rod: float, radius: float) -> float:
    """Return the largest motor torque at 61 even motor angles in the same direction."""
    fine = machine(CASEMENT, 200_001)
    torque = fine.torque(Load(complex(*CASEMENT["force"])))
    found = evaluate_motor(
        fine.links["crank"], torque, motor, complex(radius), crank, rod, _extends(fine, motor, radius)
    )
    assert found is not None
    direction = row["way"]  # forwards is the slower direction here
    angle = np.abs(found.motor_angle[direction] - found.motor_angle[direction, 0])
    even = np.linspace(0, angle[-1], 61)
    return float(np.abs(np.interp(even, angle, found.motor_torque[direction])).max())


def _extends(linkage: LinkMotions, motor: complex, radius: float) -> bool:
    ends = np.abs(linkage.links["crank"].position(complex(radius))[[0, -1]] - motor)
    return bool(ends[1] > ends[0])


@pytest.mark.parametrize("name", ["equal_times", "ratio_1_2"])
def test_a_motor_on_the_crank(name: str) -> None:
    row = CASEMENT[name]
    radius, swing = row["radius"], abs(CASEMENT["span"]) * DEGREE
    ratio = 1.0 if name == "equal_times" else 1.2
    found = proportions(swing, ratio, row["rod"] / radius)
    assert found is not None
    assert found.crank * radius == pytest.approx(row["crank"], abs=1e-4 if ratio > 1 else 1e-6)
    assert found.rod * radius == pytest.approx(row["rod"], abs=1e-3)
    assert found.ground * radius == pytest.approx(row["ground"], abs=1e-3 if ratio > 1 else 1e-6)
    assert found.transmission_angle_min / DEGREE == pytest.approx(row["angle"], abs=1e-6)
    motor = complex(*row["motor"])
    assert motor_torque(row, motor, row["crank"], row["rod"], radius) == pytest.approx(row["torque"], rel=1e-4)
    linkage = machine(CASEMENT)
    best = place_motor_about_pivot(linkage.links["crank"], linkage.torque(Load(100j)), ratio, radius, True, None)
    assert not isinstance(best, str)
    ground = proportions(swing, ratio).ground * radius
    assert abs(best.motor - linkage.links["crank"].pivot) == pytest.approx(ground, abs=1e-3)
    turns = row.get("turns", [180, 180])
    assert sorted(np.rad2deg(best.turns)) == pytest.approx(sorted(turns), abs=1e-6)


@cache
def best_angles(swing: int) -> list[float]:
    """Return the best angles in degrees for each ratio of times of the table, equal times first."""
    ratios = [1.0, *REFERENCE["angles"]["ratios"]]
    return [proportions(swing * DEGREE, ratio).transmission_angle_min / DEGREE for ratio in ratios]


@pytest.mark.parametrize("swing", [20, 30, 45, 60, 90, 120, 150])
def test_best_transmission_angles(swing: int) -> None:
    # two of the table's 49 angles, at 45 and 1.5 and at 90 and 1.2, are rounded the other way
    assert best_angles(swing) == pytest.approx(REFERENCE["angles"][str(swing)], abs=0.054)


# -- springs ----------------------------------------------------------------------------------------------------------

GRAVITY = -9.81j


def masses(row: dict) -> Load:
    links = row["links"]
    weights = {"crank": 0.05, "coupler": 0.2, "rocker": 0.3}
    parts = [Mass(name, mass, size / 2) for (name, mass), size in zip(weights.items(), links)]
    return Load(masses=(*parts, Mass("body", 1.5, 0j)), gravity=GRAVITY)


@pytest.mark.parametrize("name", ["E1", "E2", "E3", "E4"])
def test_two_springs_balance(name: str) -> None:
    row = REFERENCE["balance"][name]
    linkage, load = linkage_of(row), masses(row)
    motions = motions_of(linkage, Interval(*np.deg2rad(row["span"])), 361)
    torque = motions.torque(load)
    assert [torque.min(), torque.max()] == pytest.approx(row["torque"], abs=1e-6)
    assert np.sqrt(np.mean(torque**2)) == pytest.approx(row["rms"], abs=1e-6)
    crank, rocker = row["links"][0], row["links"][2] / 2
    anchors = [complex(*row["s1"]), complex(*row["s3"])]
    ends = zip(("crank", "rocker"), anchors, (crank, rocker))
    springs = [Spring(("ground", link), (at, pin), SpringRow("given", 0.5)) for link, at, pin in ends]
    assert np.abs(torque + torque_of(springs, motions)).max() < 1e-5  # the anchors are given to seven decimals
    for mine, want in zip(springs_on_pendulums(linkage, motions, torque, 0.5), anchors):
        assert mine.points[0] == pytest.approx(want, abs=1e-7)
    found = springs_on_pendulums(linkage, motions, torque)
    assert np.abs(torque + torque_of(found, motions)).max() < 1e-9 * np.abs(torque).max()
