"""A body on two guides has the same reply, analysis and files in Python, over HTTP and on the command line.

A field that is missing for linkages with sliders would show here.
"""

import json
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

import linkage_atlas as la
from app.query import plain_of, reply_model
from linkage_atlas.limits import read_limits
from linkage_atlas.solutions import Solution, finished
from linkage_atlas.studies import read_studies
from synthesis.solution import assess
from synthesis.studies.rounding import nearest_travel
from synthesis.work import Work
from tests.oracles.guided_cases import DRIVES, NAMES, good_linkage

CRANK = {"guide": "circle", "pivot": [0, 0], "radius": 1, "body_point": [0, 0]}
RAIL = {"guide": "rail", "point": [0, 0.3], "direction": 0, "body_point": [2, 0]}
SLOT = {"guide": "slot", "pin": [2, 0], "body_point": [0, 0.5], "body_direction": 0}


def reply_of(drive, *, noise: float = 0.0, **studies) -> tuple[Solution, la.Motion]:
    """A solution as a search would hand it over."""
    random = np.random.default_rng(61)
    linkage, travel = good_linkage(random, drive, -0.2, 1.0, 0.7), np.linspace(0.0, 0.8, 7)
    body = linkage.motions(travel)[1]
    position = 50 * (body.origin + noise * (random.normal(size=7) + 1j * random.normal(size=7)))
    motion = la.Motion(np.rad2deg(body.angle), np.stack([position.real, position.imag], 1), timing="free")
    scaled = linkage.scaled(50.0)
    begin = travel if scaled.driver.turns else 50 * travel
    solution = assess(motion.samples, [scaled], nearest_travel(motion.samples, scaled, begin))[0]
    limits = read_limits({"preset": "none"}, motion)
    (described,) = finished([solution], motion, limits, 1e-10, read_studies(studies, motion), None, Work(None))
    return replace(described, rank=1), motion


@pytest.mark.parametrize("drive", DRIVES[1:], ids=NAMES[1:])
def test_a_reply_holds_all_that_its_errors_are_made_of(drive) -> None:
    solution, motion = reply_of(drive, noise=0.01)
    plain = json.loads(json.dumps(plain_of(solution)))
    reply_model(Solution).model_validate(plain)
    assert plain["kind"] == solution.linkage.kind and plain["driver"] == drive[1]
    repeated = la.Linkage.from_dict(plain)
    position = plain["crank_angle"] if drive[1].turns else plain["travel"]
    joints = repeated.joints(position)
    request = motion.requested
    off = np.abs(joints.body_point @ [1, 1j] - request.position)
    turned = joints.rotation - np.rad2deg(request.rotation)
    turned -= 360 * np.round(turned / 360)
    assert off.max() == pytest.approx(plain["errors"]["position_max"], rel=1e-9)
    assert np.abs(turned).max() == pytest.approx(plain["errors"]["rotation_max"], rel=1e-7)
    mean = np.mean(np.deg2rad(turned) ** 2) + np.mean(off**2) / request.length_scale**2
    assert np.sqrt(mean) == pytest.approx(plain["errors"]["objective"], rel=1e-9)
    assert repeated.transmission_angle_min(min(position), max(position)) == pytest.approx(
        plain["transmission_angle_min"]
    )
    for place_of, guide in enumerate(plain["guides"]):
        if guide["guide"] != "circle":
            ends = guide["used"]
            assert ends[0] <= ends[1]
            inside = repeated.plain.along(place_of, np.array(position) * (np.pi / 180 if drive[1].turns else 1))
            assert ends[0] - 1e-9 <= inside.min() and inside.max() <= ends[1] + 1e-9
    assert plain["size"] > 0 and plain["verdict"]["order"]
    assert 0 < plain["arm_min"] <= joints.arm.min() * (1 + 1e-6)


@pytest.mark.parametrize("drive", DRIVES[1:], ids=NAMES[1:])
def test_an_analysis_comes_with_the_solution(drive) -> None:
    solution, _ = reply_of(drive, analysis={"crank_speed": 10, "load": {"force": [0, -5], "torque": 2}})
    found = solution.analysis
    assert found is not None and found.curve is not None
    total = found.pin_forces.crank_pin + found.pin_forces.coupler_pin + np.array([0, -5])
    assert np.allclose(total, 0, atol=1e-9)
    repeated = solution.linkage.analysis(10, {"force": [0, -5], "torque": 2})
    assert np.allclose(repeated.drive_load, found.drive_load)
    json.dumps(plain_of(solution), allow_nan=False)
    text = solution.linkage.render("csv", analysis={"crank_speed": 10, "load": {"force": [0, -5]}})
    assert "drive_load" in text.splitlines()[0]


def test_the_object_prints_draws_and_keeps_itself() -> None:
    pump = la.Linkage([CRANK, RAIL], "crank", start=20)
    reported = "Linkage(slider_crank driven by a crank: circle of radius 1 about (0, 0), rail"
    assert repr(pump).startswith(reported)
    ElementTree.fromstring(pump._repr_svg_())
    assert (
        max(len(repr(study)) for study in (pump.analysis(1), pump.assembly(), pump.tolerance_study(links=0.1))) < 2500
    )
    repeated = la.Linkage.from_dict(pump.to_dict())
    assert repeated.plain == pump.plain
    block = la.Linkage([SLOT, CRANK], "hinge", start=10)
    assert block.kind == "swinging_block" and block.driver == "hinge"
    four = la.Linkage([CRANK, {**CRANK, "pivot": [3, 0], "body_point": [2.5, 0], "radius": 2}], "crank")
    assert four.kind == "four_bar" and four.turns_fully
