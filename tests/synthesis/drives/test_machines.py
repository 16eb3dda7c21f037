"""Poses, torques and forces of links hold every body in equilibrium.

A wrong virtual work or a wrong frame of a link would show here.
"""

import numpy as np
import pytest

from synthesis.drives.links import motions_of
from synthesis.studies.forces import PointForce
from tests.conftest import some_of
from tests.oracles.driven_cases import any_linkage, loads
from tests.oracles.newton_euler import bodies


@pytest.mark.parametrize("seed", some_of(range(32), 16))
def test_all_kinds_hold_three_bodies_in_equilibrium(seed: int) -> None:
    """Poses, rates and the force of a rod on any link, from the ground or from another link."""
    rng = np.random.default_rng([seed, 1])
    linkage, interval = any_linkage(seed)
    machine = motions_of(linkage, interval, 7)
    load, three = loads(machine, rng), bodies(linkage)
    spots = np.random.default_rng([seed, 2]).normal(size=(4, 4))
    names = [*machine.links, "body"]
    load = load._replace(
        forces=tuple(PointForce(name, complex(a, b), complex(c, d)) for name, (a, b, c, d) in zip(names, spots))
    )
    states = three.along(machine.at)
    for k, name in enumerate(three.names):
        link = machine.links[name]
        for row, part in enumerate((link.origin, link.velocity, link.acceleration)):
            expected = [complex(*state[row][3 * k : 3 * k + 2]) for state in states]
            assert part == pytest.approx(np.array(expected), rel=1e-10, abs=1e-10 * (1 + np.abs(expected).max()))
        turned = np.array([np.exp(1j * state.at[3 * k + 2]) for state in states])
        assert link.direction == pytest.approx(turned, abs=1e-12)
        assert link.rate == pytest.approx(np.array([state.rate[3 * k + 2] for state in states]), rel=1e-10, abs=1e-10)
    name, on = three.names[seed % 3], ("ground", three.names[(seed + 1) % 3])[seed // 3 % 2]
    link = machine.links[name] if on == "ground" else machine.links[name].seen_from(machine.links[on])
    there, pin = complex(*rng.normal(size=2)) * 3, complex(*rng.normal(size=2))
    off = link.position(pin) - there
    force = machine.torque(load) / (np.real(np.conj(off) * link.speed(pin)) / np.abs(off))
    second = there if on == "ground" else machine.links[on].point_at(there)
    expected = [three.force(state, load, name, pin, on, second) for state in states]
    assert force == pytest.approx(np.array(expected), rel=1e-9, abs=1e-9 * np.abs(expected).max())
