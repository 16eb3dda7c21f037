"""The cylinder of the lift and an actuator on the lift's triangle have the same length, arm and force.

A wrong sign or unit of either would show here.
"""

import numpy as np
import pytest

from synthesis.drives.links import LinkMotions
from synthesis.drives.placement_search import PlacementSearch
from synthesis.drives.placements import PlacementLimits
from synthesis.linkage import LinkMotion
from synthesis.scenes.lift.pose import Design, pose_at_turn
from synthesis.studies.forces import Load


@pytest.mark.parametrize(
    "design", [Design(300.0, 180.0, 240.0, 330.0, 480.0), Design(130.5, 165.5, 223.5, 344.5, 560.3)]
)
def test_length_arm_and_force_are_those_of_the_lift(design: Design) -> None:
    turn = np.linspace(1.2, 0.3, 61)  # it rises as the turn falls
    pose = pose_at_turn(design, turn)
    # the triangle's frame: from A, along the world's axes at turn 0; it turns clockwise or counter-clockwise with the turn
    corner = pose.x + 1j * pose.y
    a = -design.b + 1j * pose.height
    direction = (corner - a) / np.abs(corner - a)
    rate = np.sign(np.angle(direction[1] / direction[0]) / (turn[1] - turn[0])) * np.ones(61)
    still = np.zeros(61)
    link = LinkMotion("coupler", a, np.angle(direction), 1j * pose.height_1, rate, 1j * pose.height_2, still)
    platform = LinkMotion("body", a, still, 1j * pose.height_1, still, 1j * pose.height_2, still)
    machine = LinkMotions(turn, {"coupler": link}, platform)
    load = 1000.0
    torque = machine.torque(Load(-1j * load))
    question = PlacementSearch(link, turn, torque, PlacementLimits((-1e4, -1e4, 1e4, 1e4), 1e4, 0.0))
    found = question.evaluate(0j, complex(design.l2))
    assert found.length == pytest.approx(pose.length, rel=1e-9)
    assert found.arm == pytest.approx(pose.length_1, rel=1e-9)
    assert found.force == pytest.approx(load * pose.height_1 / pose.length_1, rel=1e-9)
    assert np.all(found.force > 0)
