"""Forces on bodies on two guides: balance of every link, and of power."""

import numpy as np
import pytest

from synthesis.guided.analysis import Load, forces
from synthesis.guides import Circle, Driver, Rail, Slot
from synthesis.linkage import Linkage, Mass
from tests.oracles.guided_cases import DRIVES, NAMES, random_linkage


def _cases(drive, seed: int):
    random = np.random.default_rng(seed)
    for _ in range(25):
        linkage = random_linkage(random, *drive)
        travel = np.linspace(-0.3, 0.3, 7)
        found = linkage.body(linkage.start + travel)
        if np.all(np.minimum(np.abs(found.sine), found.arm) > 0.15):
            yield random, linkage, travel


def _energy(linkage: Linkage, at: np.ndarray, load: Load, speed: float) -> np.ndarray:
    total = np.zeros(at.shape)
    for link, one in zip(linkage.motions(at), load.masses):
        arm = one.at * np.exp(1j * link.angle)
        velocity = speed * (link.velocity + 1j * link.rate * arm)
        moving = one.mass * np.abs(velocity) ** 2 + one.inertia * (speed * link.rate) ** 2
        total = total + load.metre * moving / 2 - one.mass * np.real(np.conj(load.gravity) * (link.origin + arm))
    return total


@pytest.mark.parametrize("drive", DRIVES, ids=NAMES)
def test_the_power_of_the_drive_is_that_of_all_loads_and_of_the_growing_energy(drive) -> None:
    seen = 0
    for random, linkage, travel in _cases(drive, 51):
        seen += 1
        speed, metre = 1.7, 0.5
        masses = tuple(
            Mass(name, random.uniform(0.5, 2), complex(*random.normal(size=2)), random.uniform(0, 1))
            for name in linkage.link_names
        )
        force, gravity = complex(*random.normal(size=2)), complex(*random.normal(size=2))
        load = Load(force, random.normal(), masses, gravity, speed, metre)
        found = forces(linkage, travel, load)
        body = linkage.motions(travel)[1]
        power = np.real(np.conj(load.force) * body.velocity) * speed + load.torque * body.rate * speed
        step = 1e-5

        before, after = (_energy(linkage, travel + way, load, speed) for way in (-step, step))
        growth = (after - before) / (2 * step) * speed
        size = 1 + np.abs(growth) + np.abs(power)
        assert np.all(np.abs(found.drive * speed + power - growth) < 2e-5 * size)
    assert seen > 3


@pytest.mark.parametrize("drive", DRIVES, ids=NAMES)
def test_forces_on_the_body_balance_and_guides_push_across(drive) -> None:
    for _, linkage, travel in _cases(drive, 52):
        load = Load(1 - 2j, 0.7)
        found = forces(linkage, travel, load)
        body = linkage.motions(travel)[1]
        turned = np.exp(1j * body.angle)
        assert np.allclose(found.driven + found.other + load.force, 0, atol=1e-10)
        for place, (guide, force) in enumerate(zip(linkage.guides, (found.driven, found.other))):
            if place == 0 and linkage.driver is not Driver.HINGE:
                continue
            if isinstance(guide, Rail):
                free = np.real(np.exp(-1j * guide.direction) * force)
            elif isinstance(guide, Slot):
                free = np.real(np.conj(turned * np.exp(1j * guide.body_direction)) * force)
            else:
                assert isinstance(guide, Circle)
                spoke = body.origin + turned * guide.body_point - guide.pivot
                free = np.imag(np.conj(spoke) * force)
            assert np.allclose(free, 0, atol=1e-9 * (1 + np.abs(force).max()))
