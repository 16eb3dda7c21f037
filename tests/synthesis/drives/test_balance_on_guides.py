"""Springs that balance a body on guides keep its total energy constant in every position.

A spring on the wrong link would show here.
"""

import numpy as np
import pytest

from synthesis.drives.balance import springs_on_pendulums
from synthesis.drives.links import motions_at
from synthesis.guides import Circle, Driver, Rail, Slot
from synthesis.link_motion import Mass
from synthesis.studies.forces import Load
from tests.oracles.guided_cases import DRIVES, NAMES, good_linkage

GRAVITY = 2.3 - 9.5j


def load_of(linkage, random):
    return load_of_links(("body", *linkage.link_names), random)


def load_of_links(names, random):
    masses = [Mass(name, float(random.uniform(0.1, 2)), complex(*random.normal(size=2))) for name in names]
    return Load(force=complex(*random.normal(size=2)), masses=tuple(masses), gravity=GRAVITY)


def energy(machine, load, springs):
    """Return the energy of masses, force and springs in a position."""
    total = -np.real(np.conj(load.force) * machine.body.position(0j))
    for mass in load.masses:
        total -= mass.mass * np.real(np.conj(load.gravity) * machine.link(mass.link).position(mass.at))
    for spring in springs:
        ends = [
            np.full(machine.at.size, point) if name == "ground" else machine.link(name).position(point)
            for name, point in zip(spring.between, spring.points)
        ]
        total += spring.row.stiffness / 2 * np.abs(ends[1] - ends[0]) ** 2
    return total


@pytest.mark.parametrize("drive", DRIVES, ids=NAMES)
@pytest.mark.parametrize("stiffness", [None, 3.0])
def test_the_energy_is_the_same_in_every_position(drive, stiffness):
    random = np.random.default_rng(DRIVES.index(drive))
    linkage = good_linkage(random, drive, -0.3, 0.6, 0.2)
    load = load_of(linkage, random)
    machine, wider = motions_at(linkage, np.linspace(0, 0.3, 61)), motions_at(linkage, np.linspace(-0.3, 0.6, 400))
    found = springs_on_pendulums(linkage, machine, machine.torque(load), stiffness)
    kinds = drive[0], drive[2]
    if Circle not in kinds and kinds != (Rail, Rail):
        assert found is None
        return
    assert found is not None
    without = energy(wider, load, [])
    assert np.ptp(without) > 0.1
    assert np.ptp(energy(wider, load, found)) < 1e-6 * np.ptp(without)
    assert all(spring.row.stiffness > 0 and stiffness in (None, spring.row.stiffness) for spring in found)


def test_what_weighs_along_a_rail_beside_a_slot_cannot_be_balanced_but_across_it_can():
    random = np.random.default_rng(5)
    linkage = good_linkage(random, (Rail, Driver.SLIDER, Slot), -0.1, 0.4, 0.2)
    machine = motions_at(linkage, np.linspace(0, 0.3, 61))
    masses = (Mass("body", 1.5, 0.4 + 0.2j), Mass("slider", 0.5, 0j))
    along = np.exp(1j * linkage.guides[0].direction)
    assert springs_on_pendulums(linkage, machine, machine.torque(Load(masses=masses, gravity=9.81 * along))) is None
    across = Load(masses=masses, gravity=9.81j * along)
    found = springs_on_pendulums(linkage, machine, machine.torque(across))
    assert found is not None and [spring.between for spring in found] == [("ground", "block")]
    assert np.ptp(energy(machine, across, found)) < 1e-9 * np.ptp(energy(machine, across, []))
