"""Velocities, accelerations and forces: difference quotients, the equilibrium of each link, virtual work and energy.

These tests would catch a wrong derivative, and a force that does not hold its link.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.guides import Circle, Driver, Rail, Slot
from synthesis.link_motion import Mass
from synthesis.linkage import Linkage, four_bar
from synthesis.studies import forces as analysis
from synthesis.studies.forces import Forces, Load, on_links
from tests.oracles.four_bar_joints import Joints, joints_at
from tests.oracles.guided_cases import DRIVES, NAMES
from tests.oracles.guided_cases import random_linkage as any_linkage

LAW = settings(derandomize=True, deadline=None, max_examples=60)

TRAVEL = np.linspace(-0.4, 0.4, 9)


def forces(linkage: Linkage, travel: np.ndarray, load: Load) -> Forces:
    return analysis.forces(linkage, travel, on_links(load, linkage))


def random_linkage(seed: int, smallest: float) -> Linkage:
    """A linkage of any family whose transmission angle at `TRAVEL` is somewhere above ``least``, mostly not far above."""
    random = np.random.default_rng(seed)
    while True:
        lengths, branch = tuple(random.uniform(1, 100, 4).tolist()), int(random.choice([-1, 1]))
        start, pivot = float(random.uniform(0, 6.28)), complex(*random.uniform(-100, 100, 2))
        turned, point = float(random.uniform(-3, 3)), (float(random.uniform(0, 100)), float(random.uniform(-3, 3)))
        linkage = four_bar(lengths, branch, start, pivot, turned, point)
        joints = joints_at(linkage, TRAVEL)
        if joints.closed and joints.transmission_angle.min() > smallest:
            return linkage


SEEDS = st.integers(0, 2**32 - 1)
LOADS = st.builds(
    lambda force, torque: Load(force, torque),
    st.complex_numbers(max_magnitude=50, min_magnitude=1),
    st.floats(-500, 500),
)


def equilibrium(linkage: Linkage, joints: Joints, k: int, load: Load) -> tuple[np.ndarray, float]:
    """Return pin forces A, D, C, B and the crank's torque, (9,), from nine equations of equilibrium.

    The condition number is returned too: the unit of the rounding error.
    """
    a, b, d, c, p = joints.pivot_a, joints.pivot_b, joints.crank_pin[k], joints.coupler_pin[k], joints.body_point[k]
    system, right = np.zeros((9, 9)), np.zeros(9)

    def add(link: int, force: int, sign: float, arm: complex) -> None:
        x, y = 2 * force, 2 * force + 1
        system[3 * link, x] += sign
        system[3 * link + 1, y] += sign
        system[3 * link + 2, x] -= sign * arm.imag
        system[3 * link + 2, y] += sign * arm.real

    # the moments are taken about the crank's pivot, the body point, and the rocker's pivot
    add(0, 0, 1.0, 0j)
    add(0, 1, -1.0, d - a)
    system[2, 8] = 1.0
    add(1, 1, 1.0, d - p)
    add(1, 2, 1.0, c - p)
    right[3:6] = -load.force.real, -load.force.imag, -load.torque
    add(2, 2, -1.0, c - b)
    add(2, 3, 1.0, 0j)
    found = np.linalg.solve(system, right)
    return found, float(np.linalg.cond(system))


def as_row(found: Forces, k: int) -> np.ndarray:
    pins = [found.driven_ground[k], found.driven[k], found.undriven[k], found.undriven_ground[k]]
    return np.array([part for pin in pins for part in (pin.real, pin.imag)] + [found.drive[k]])


@LAW
@given(SEEDS, LOADS)
def test_virtual_work_and_the_equilibrium_of_each_link_agree(seed, load) -> None:
    linkage = random_linkage(seed, 1e-3)
    joints = joints_at(linkage, TRAVEL)
    found, body = forces(linkage, TRAVEL, load), linkage.motions(TRAVEL)[1]
    power = np.real(np.conj(load.force) * body.velocity) + load.torque * body.rate
    size = abs(load.force) * np.abs(body.velocity) + np.abs(load.torque * body.rate)
    assert np.all(np.abs(found.drive + power) <= 1e-9 * np.maximum(size, np.abs(power)))
    for k in range(TRAVEL.size):
        expected, condition = equilibrium(linkage, joints, k, load)
        gap = np.abs(as_row(found, k) - expected).max()
        assert gap <= max(1e-9, 1e-15 * condition) * np.abs(expected).max()


def test_a_dead_position_has_no_values_and_a_closed_loop_next_to_it_has() -> None:
    linkage = four_bar((1.0, 2.0, 6.0, 5.0), 1, coupler_point_polar=(1.0, 0.0))  # folds flat at theta1 = 0
    with np.errstate(all="raise"):
        _, body, rocker = linkage.motions(np.array([0.0, 1e-9, 4.0]))
        held = forces(linkage, np.zeros(1), Load(1 + 1j))
    assert np.isnan([body.rate[0], rocker.rate_change[0], body.velocity[0].real]).all()
    assert np.isfinite(body.acceleration[1:]).all() and np.isfinite(rocker.rate[1:]).all()
    assert np.isnan(held.drive).all() and np.isnan(held.undriven_ground).all()
    # 3, 4, 5: at a right angle of the crank coupler and rocker are stretched, to rounding
    nearly = four_bar((3.0, 2.0, 3.0, 4.0), 1).motions(np.array([np.pi / 2]))[1].rate
    assert np.isnan(nearly[0]) or abs(nearly[0]) > 1e6
    opened = four_bar((3.0, 1.0, 1.0, 3.0), 1, coupler_point_polar=(1.0, 0.0))
    assert np.isnan(opened.motions(np.array([np.pi]))[1].rate).all(), "where it does not close"


# -- every kind of linkage ---------------------------------------------------------------------------------------------


def _cases(drive, seed: int):
    random = np.random.default_rng(seed)
    for _ in range(25):
        linkage = any_linkage(random, *drive)
        travel = np.linspace(-0.3, 0.3, 7)
        found = linkage.body(linkage.start + travel)
        if np.all(np.minimum(np.abs(found.sine), found.arm) > 0.15):
            yield random, linkage, travel


def _energy(linkage: Linkage, at: np.ndarray, load: Load, speed: float) -> np.ndarray:
    total = np.zeros(at.shape)
    for link, mass in zip(linkage.motions(at), load.masses):
        arm = mass.at * np.exp(1j * link.angle)
        velocity = speed * (link.velocity + 1j * link.rate * arm)
        moving = mass.mass * np.abs(velocity) ** 2 + mass.inertia * (speed * link.rate) ** 2
        total = total + load.metre * moving / 2 - mass.mass * np.real(np.conj(load.gravity) * (link.origin + arm))
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
        found = analysis.forces(linkage, travel, load)
        body = linkage.motions(travel)[1]
        power = np.real(np.conj(load.force) * body.velocity) * speed + load.torque * body.rate * speed
        step = 1e-5

        before, after = (_energy(linkage, travel + direction, load, speed) for direction in (-step, step))
        growth = (after - before) / (2 * step) * speed
        size = 1 + np.abs(growth) + np.abs(power)
        assert np.all(np.abs(found.drive * speed + power - growth) < 2e-5 * size)
    assert seen > 3


@pytest.mark.parametrize("drive", DRIVES, ids=NAMES)
def test_forces_on_the_body_balance_and_guides_push_across(drive) -> None:
    for _, linkage, travel in _cases(drive, 52):
        load = Load(1 - 2j, 0.7)
        found = analysis.forces(linkage, travel, load)
        body = linkage.motions(travel)[1]
        turned = np.exp(1j * body.angle)
        assert np.allclose(found.driven + found.undriven + load.force, 0, atol=1e-10)
        for index, (guide, force) in enumerate(zip(linkage.guides, (found.driven, found.undriven))):
            if index == 0 and linkage.driver is not Driver.HINGE:
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
