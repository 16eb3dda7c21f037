"""A motor and its linkage move as a single mechanism whose forces balance.

A rod that changes its length, or a wrong rate, would show here.
"""

import numpy as np
import pytest

from synthesis.drives.six_bar import ROD, Motor, SixBar, joints_of
from synthesis.link_motion import Mass
from synthesis.linkage import four_bar
from synthesis.studies.forces import Load
from synthesis.target import TURN, Interval
from tests.oracles.assembly import other_six_bars

WATT = four_bar((30.0, 60.0, 70.0, 50.0), 1, np.deg2rad(40.0), 3 - 2j, 0.2, (40.0, 0.5), 0.1)
USED = Interval(0.0, np.deg2rad(60.0))
TURNED = np.linspace(0.0, 2 * TURN, 97)


def watt() -> SixBar:
    """The motor of the assembly's example, turned and moved with the linkage."""
    at = 3 - 2j + (74.76662388200997 - 5.0943059670631925j) * np.exp(0.2j)
    return SixBar.of(WATT, USED, Motor("crank", complex(at), 12.0, 72.0, 24 + 0j))


CASES = [*((SixBar.of(*case), case[0]) for case in other_six_bars(6)), (watt(), WATT)]


@pytest.mark.parametrize(("six", "linkage"), CASES)
def test_everywhere_the_rod_keeps_its_length_and_the_linkage_its_way(six, linkage) -> None:
    moved = six.machine(TURNED)
    off = moved.links[six.motor.link].position(six.motor.pin) - moved.links[ROD].origin
    assert np.abs(off) == pytest.approx(np.full(TURNED.size, six.motor.rod), rel=1e-12)
    at = six.travel(np.linspace(0, TURN, 1001))
    first, last = six.used
    assert at.min() >= first - 1e-9 and at.max() <= last + 1e-9
    assert six.travel(np.array([0.0, six.last, TURN])) == pytest.approx([first, last, first], abs=1e-9)
    rising = np.linspace(0, six.last, 400)
    assert np.all(np.diff(six.travel(rising)) > 0)
    assert np.all(np.diff(six.travel(rising - six.last)[::-1]) > 0) or six.last != TURN / 2
    # there and back by the other formula
    inner = six.travel(np.array([0.3, 1.7, 3.0, 4.4, 5.9]))
    assert np.abs(six.turned(inner) - [0.3, 1.7, 3.0, 4.4, 5.9]).min(axis=0) == pytest.approx(np.zeros(5), abs=1e-7)
    forwards = six.forwards(inner)
    assert six.travel(forwards) == pytest.approx(inner, abs=1e-9)
    assert np.all(forwards * six.sense >= 0)
    assert np.all(np.abs(forwards) <= max(six.last, TURN - six.last) + 1e-9)


@pytest.mark.parametrize(("six", "linkage"), CASES)
def test_rates_are_what_differences_tend_to(six, linkage) -> None:
    h, point = 1e-5, 0.3 + 0.2j
    before, here, after = (six.machine(TURNED + step) for step in (-h, 0.0, h))
    for name in (*here.links, "body"):
        if name == "body" and here.body is None:
            continue
        moving_link = here.link(name)
        speed = (after.link(name).position(point) - before.link(name).position(point)) / (2 * h)
        change = (after.link(name).speed(point) - before.link(name).speed(point)) / (2 * h)
        assert np.abs(moving_link.speed(point) - speed).max() <= 1e-7 * (1 + np.abs(speed).max())
        assert np.abs(moving_link.change(point) - change).max() <= 1e-7 * (1 + np.abs(change).max())
    # the dead centres: the linkage is at rest
    still = six.machine(np.array([0.0, six.last]))
    assert np.abs(still.links[six.motor.link].speed(six.motor.pin)).max() < 1e-6 * six.motor.crank
    # a dwell is as long as the linkage is near
    positions, (first, last) = np.linspace(0, TURN, 10_001), six.used
    at = np.interp(np.linspace(0, TURN, 200_001), positions, six.travel(positions))
    for end, found in zip((first, last), six.dwell(0.05)):
        assert TURN * np.mean(np.abs(at - end) <= 0.05 * (last - first)) == pytest.approx(found, abs=1e-4)


@pytest.mark.parametrize(("six", "linkage"), CASES)
def test_newton_and_euler_give_the_torque_of_virtual_work(six, linkage) -> None:
    rng = np.random.default_rng(5)
    machine = six.machine(TURNED)
    links = [*machine.links, *([] if machine.body is None else ["body"])]
    masses = tuple(Mass(link, rng.uniform(0.1, 2), complex(*rng.normal(size=2)), rng.uniform(0, 1)) for link in links)
    for speed in (0.0, 2.0):
        load = Load(complex(*rng.normal(size=2)), rng.normal(), masses, 1 - 9.81j, speed, 0.7)
        held = six.reactions(machine, joints_of(linkage, six.motor, machine), load)
        expected = machine.torque(load)
        assert np.abs(held.torque - expected).max() <= 1e-11 * np.abs(expected).max()
        # inertia counts, and its unit
        if speed:
            second = six.reactions(machine, joints_of(linkage, six.motor, machine), load._replace(metre=1.0))
            assert np.abs(second.torque - held.torque).max() > 1e-6 * np.abs(expected).max()
