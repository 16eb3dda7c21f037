"""A motor and its rod swing the linkage from end to end, and all parts pass each other as shapely confirms.

A rod in the wrong layer would show here.
"""

import numpy as np
import pytest

from synthesis.assembly.driven_machine import SwungLinkage, motor_driven
from synthesis.assembly.linkage_machine import as_plates
from synthesis.assembly.machine import Machine, Sizes
from synthesis.assembly.movement import BodyPoint
from synthesis.assembly.stacks import StackRequest, StackSearch
from synthesis.drives.six_bar import Motor
from synthesis.errors import FieldError
from synthesis.guides import Circle, Driver, Rail
from synthesis.linkage import four_bar, on_guides
from synthesis.target import TURN, Interval
from synthesis.work import Work
from tests.oracles.assembly import disagreements, nearest, other_six_bars, six_bars

LINKAGE = four_bar((30.0, 60.0, 70.0, 50.0), 1, np.deg2rad(40.0))
USED = Interval(0.0, np.deg2rad(60.0))
MOTOR = Motor("crank", 74.76662388200997 - 5.0943059670631925j, 12.0, 72.0, 24 + 0j)
"""As `linkage_atlas.drives` finds it for this linkage."""


def check(machine: Machine, number: int) -> None:
    """Check that the layers agree with shapely, and that no point of a body leaves its enclosure over a cell."""
    search = StackSearch(machine, StackRequest("below" if number % 2 else "both"), Work())
    assert disagreements(machine, search)[2] == 0
    found = search.solve()
    if found.status == "free":
        assert nearest(machine, found) > -1e-9
    rng = np.random.default_rng(number)
    cells = [*zip(rng.uniform(*machine.used, 20), 10 ** rng.uniform(-6, -0.5, 20))]
    # within these the linkage turns back: it is farther out than at both their ends
    swung = machine.movement.steps[0]
    assert isinstance(swung, SwungLinkage)
    cells += [(dead + 0.4 * half, half) for dead in (0.0, swung.six.last) for half in (0.01, 0.2)]
    for at, half in cells:
        cell = machine.movement.bodies(np.array([at]), np.array([half]))
        moved = machine.movement.bodies(at + half * np.linspace(-1, 1, 33))
        for body in range(1, len(machine.movement.names)):
            point = BodyPoint(body, complex(*rng.normal(size=2)))
            distant = np.abs(moved.point(point) - cell.point(point)[0]).max()
            assert distant <= cell.spread(point)[0] * (1 + 1e-9) + 1e-9


def test_the_motor_swings_the_linkage_from_end_to_end() -> None:
    machine, plain = motor_driven(LINKAGE, USED, MOTOR, Sizes()), as_plates(LINKAGE, USED, Sizes())
    turn = machine.movement.bodies(np.linspace(*machine.used, 7201))
    for body, end in ((1, 30.0), (2, 60.0), (3, 70.0)):
        pin = BodyPoint(body, complex(end))
        ends = plain.movement.bodies(np.array(USED)).point(pin)
        found = turn.point(pin)
        assert abs(found[0] - ends[0]) < 1e-6
        assert np.abs(found - ends[1]).min() < 1e-4


def test_six_bars_agree_with_shapely_and_their_enclosures_hold() -> None:
    for number, machine in enumerate(six_bars(2)):
        check(machine, number)


def test_so_do_those_with_a_rod_on_the_coupler_or_on_a_linkage_on_guides() -> None:
    seen = set()
    for number, (linkage, used, motor) in enumerate(other_six_bars(4)):
        seen.add((linkage.is_four_bar, motor.link))
        machine = motor_driven(linkage, used, motor, Sizes())
        turn = machine.movement.bodies(np.linspace(0.0, TURN, 181))
        rod, moved = (machine.movement.names.index(name) for name in ("rod", motor.link))
        ends = {pin.name: pin.points for pin in machine.pins}["Q"]
        assert (ends[0].body, ends[1].body) == (rod, moved)
        assert np.abs(turn.point(ends[0]) - turn.point(ends[1])).max() < 1e-12 * machine.size
        check(machine, number)
    assert {(True, "coupler"), (False, "coupler"), (False, "crank")} <= seen


def test_a_rod_on_a_slider_has_no_plate() -> None:
    slider = on_guides((Circle(0j, 1.0, 0j), Rail(0.3j, 0.0, 3 + 0j)), Driver.CRANK, 1, 0.5)
    used = Interval(0.0, 1.0)
    at = slider.motions(np.array(used))[2].origin
    # on the rail's line, a crank of half the way
    direction = abs(at[1] - at[0])
    motor = Motor("slider", complex(min(at.real) - 2 * direction, 0.3), direction / 2, 2.5 * direction, 0j)
    with pytest.raises(FieldError, match="slider, which is not a plate"):
        motor_driven(slider, used, motor, Sizes())
