"""Searches for linkages with sliders recover exact motions, satisfy limits and distinguish a line from a circle.

A kind of linkage, a limit or a drive that is lost would show here.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from synthesis.guided.search import search_guided
from synthesis.guides import Driver, Kind, Rail, Slot
from synthesis.limits import Limits
from synthesis.poses import Poses, make_poses
from synthesis.solution import Solution
from synthesis.violations import violations_of
from tests.conftest import some_of
from tests.oracles.guided import KINDS, random_motion

_ANY = Limits(family="any")


def gallery(name: str) -> Poses:
    """The motion of one of the page's examples."""
    examples = json.loads((Path(__file__).parents[3] / "app/static/examples.json").read_text())
    examples = examples if isinstance(examples, list) else examples["examples"]
    request = next(example["request"] for example in examples if example["name"] == name)
    return make_poses(np.deg2rad(request["rotation"]), np.array(request["position"]) @ [1, 1j])


def smallest_errors(solutions: list[Solution]) -> dict[str, float]:
    found: dict[str, float] = {}
    for solution in solutions:
        kind = solution.linkage.kind.value
        found[kind] = min(found.get(kind, np.inf), solution.errors.objective)
    return found


@pytest.mark.parametrize(("samples", "cases"), some_of([(5, 1), (10, 1), (5, 6), (10, 6), (6, 4), (30, 4)], 2))
@pytest.mark.parametrize("kind", KINDS)
def test_exact_motions_come_back(kind, samples, cases):
    random = np.random.default_rng(samples)
    for _ in range(cases):
        rotation, position, _ = random_motion(random, kind, samples)
        found, _ = search_guided(make_poses(rotation, position), _ANY, [Kind(kind)])
        assert min(solution.errors.objective for solution in found) < 1e-9


def test_casement_window_has_the_errors_of_the_design():
    """Lengths within four extents and 35 degrees: slider-crank 1.19e-3, swinging block 1.10e-3, rail and slot 1.33e-3."""
    poses = gallery("casement")
    limits = Limits(family="any", transmission_angle_min=np.deg2rad(35), link_max=4 * poses.extent)
    found, _ = search_guided(poses, limits, [Kind.SLIDER_CRANK, Kind.SWINGING_BLOCK, Kind.RAIL_SLOT])
    errors = smallest_errors(found)
    assert errors["slider_crank"] < 1.195e-3
    assert errors["swinging_block"] < 1.105e-3
    assert errors["rail_slot"] == pytest.approx(1.32881e-3, rel=1e-4)
    for found_solution in found:
        assert not violations_of(found_solution, poses, limits)
    # that rail, driven by a slider: 91.08 mm of travel at 68.7 degrees and more
    driven = [
        solution
        for solution in found
        if (solution.linkage.kind, solution.linkage.driver) == (Kind.RAIL_SLOT, Driver.SLIDER)
    ]
    slider = min(driven, key=lambda solution: solution.errors.objective)
    assert np.ptp(slider.travel) == pytest.approx(91.08, abs=0.05)
    assert np.rad2deg(slider.transmission_angle_min) == pytest.approx(68.7, abs=0.1)


def test_each_pivot_has_its_own_box():
    boxes = {"pivot_a_box": (-0.6, -0.4, -0.1, 0.2), "pivot_b_box": (0.1, 0.1, 0.3, 0.9)}
    turned = np.linspace(0, 0.96, 8)
    poses = make_poses(turned, np.cos(turned) + 1j * (0.8 * np.sin(turned) + 0.1 * turned))
    found, _ = search_guided(poses, Limits(family="any", **boxes), [Kind.SLIDER_CRANK, Kind.SWINGING_BLOCK])
    assert len(found) >= 3
    for solution in found:
        for guide, box in zip(solution.linkage.guides, boxes.values()):
            if not isinstance(guide, Rail):
                position = guide.pin if isinstance(guide, Slot) else guide.pivot
                assert box[0] <= position.real <= box[2] and box[1] <= position.imag <= box[3]


def test_limits_of_rails_and_cylinders_are_kept():
    poses = gallery("casement")
    limits = Limits(
        family="any", transmission_angle_min=np.deg2rad(30), rail_box=(-100.0, -400.0, 450.0, 150.0), stroke_max=300.0,
        cylinder_dead_length=150.0, cylinder_extended_max=420.0, arm_min=40.0, link_max=900.0,
    )  # fmt: skip
    found, _ = search_guided(poses, limits, [Kind.RAIL_SLOT, Kind.SWINGING_BLOCK])
    assert {solution.linkage.driver for solution in found} >= {Driver.SLIDER, Driver.CYLINDER}
    for solution in found:
        assert not violations_of(solution, poses, limits)
        for index, guide in enumerate(solution.linkage.guides):
            if hasattr(guide, "direction"):  # both ends of the used travel, by the linkage's own motion
                at = solution.linkage.along(index, np.linspace(*solution.interval, 400))
                ends = guide.point + at * np.exp(1j * guide.direction)
                assert ends.real.min() > -100.001 and ends.real.max() < 450.001
                assert ends.imag.min() > -400.001 and ends.imag.max() < 150.001
        if solution.linkage.driver is Driver.CYLINDER:
            length = solution.linkage.start + solution.travel
            assert length.min() > 150 - 1e-3 and length.max() < 420.001


PRESCRIBED = [("slider_crank", Driver.CRANK), ("swinging_block", Driver.CRANK), ("rail_slot", Driver.SLIDER)]
PRESCRIBED += [("two_rails", Driver.SLIDER), ("two_slots", Driver.CYLINDER)]


@pytest.mark.parametrize(("kind", "driver"), PRESCRIBED)
def test_given_drives_come_back(kind, driver):
    random = np.random.default_rng(7)
    for _ in range(3):
        rotation, position, drive = random_motion(random, kind, 12)
        found, _ = search_guided(make_poses(rotation, position), _ANY, [Kind(kind)], driver, prescribed=drive)
        best = min(found, key=lambda solution: solution.errors.objective)
        assert best.errors.objective < 1e-9
        assert np.allclose(best.travel, drive, rtol=1e-7, atol=1e-9 * np.abs(drive).max())


def arc(radius: float, noise: float) -> Poses:
    """Return a body with a point on an arc of a circle over a chord of 2, and a line through that point past a
    fixed pin.
    """
    random = np.random.default_rng(5)
    along = np.linspace(-1, 1, 12)
    point = along + 1j * along**2 / (radius + np.sqrt(radius**2 - along**2))
    angle = np.angle(0.3 + 1.4j - point)
    mixed = noise * (random.normal(size=12) + 1j * random.normal(size=12))
    return make_poses(angle + noise * random.normal(size=12), point + 0.5 * np.exp(1j * (angle + 0.4)) + mixed)


def test_a_rail_is_found_beside_a_huge_circle():
    found, _ = search_guided(arc(1e8, 0.0), _ANY, [Kind.SWINGING_BLOCK, Kind.RAIL_SLOT])
    exact = {solution.linkage.kind for solution in found if solution.errors.objective < 1e-7}
    assert Kind.RAIL_SLOT in exact


def test_the_radius_of_a_large_circle_is_found_through_noise():
    found, _ = search_guided(arc(1e3, 1e-6), _ANY, [Kind.SWINGING_BLOCK, Kind.RAIL_SLOT])
    best = min(found, key=lambda solution: solution.errors.objective)
    assert best.linkage.kind is Kind.SWINGING_BLOCK
    assert best.errors.objective < 3e-6
    radius = max(guide.radius for guide in best.linkage.guides if hasattr(guide, "radius"))
    assert radius == pytest.approx(1e3, rel=0.05)  # as well as the noise lets it be known
