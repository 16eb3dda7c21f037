"""Poses, torques and forces of links against joints by circles and the equilibrium of every link; laws of motion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from synthesis.drives.links import LinkMotions, motions_of
from synthesis.linkage import Linkage
from synthesis.studies.forces import PointForce, Pull, forces, on_links
from synthesis.target import Interval
from tests.conftest import some_of
from tests.oracles.driven_cases import any_linkage, loads, random_linkage
from tests.oracles.equilibrium import Moving, drive_force, equilibrium
from tests.oracles.newton_euler import bodies


def poses(linkage: Linkage, machine: LinkMotions, some: list[int]) -> list[Moving]:
    a, b = linkage.pivot_a, linkage.pivot_b
    pivots = (a.real, a.imag), (b.real, b.imag)
    begin = linkage.start + linkage.ground_angle
    return [Moving(linkage.links, linkage.branch, *pivots, begin + machine.at[k]) for k in some]


@pytest.mark.parametrize("seed", range(30))
def test_torques_and_forces_hold_every_link_in_equilibrium(seed: int) -> None:
    rng = np.random.default_rng(seed)
    linkage, interval = random_linkage(rng)
    machine = motions_of(linkage, interval)
    load = loads(machine, rng)
    torque = machine.torque(load)
    some = [0, 13, 30, 47, 60]
    turn = np.exp(1j * (linkage.body_offset or 0.0))
    masses = [
        ("coupler", one.mass, complex(linkage.arm + one.at * turn), one.inertia)
        if one.link == "body"
        else (one.link, one.mass, one.at, one.inertia)
        for one in load.masses
    ]
    size = np.abs(torque).max()
    link = ("crank", "coupler", "rocker")[seed % 3]
    ground, pin = complex(*rng.normal(size=2)) * 3, complex(*rng.normal(size=2))
    moving = machine.links[link]
    v = moving.place(pin) - ground
    arm = np.real(np.conj(v) * moving.speed(pin)) / np.abs(v)
    for k, at in zip(some, poses(linkage, machine, some)):
        origin, angle, _ = at.frame(link)
        assert moving.origin[k] == pytest.approx(complex(*origin), abs=1e-12)
        assert moving.direction[k] == pytest.approx(np.exp(1j * angle), abs=1e-12)
        force = (load.force.real, load.force.imag)
        gravity = (load.gravity.real, load.gravity.imag)
        held = linkage.arm, force, load.torque, masses, gravity, load.speed
        assert drive_force(at, *held, ("torque", "crank")) == pytest.approx(torque[k], abs=1e-9 * size)
        at_rocker = torque[k] / machine.links["rocker"].rate[k]
        assert drive_force(at, *held, ("torque", "rocker")) == pytest.approx(at_rocker, rel=1e-9, abs=1e-9 * size)
        rod = drive_force(at, *held, ("rod", link, pin, (ground.real, ground.imag)))
        assert rod == pytest.approx(torque[k] / arm[k], rel=1e-9, abs=1e-9 * size)
        pivot, torque_there = machine.links["rocker"].origin, torque / machine.links["rocker"].rate
        rod = ("rod", link, pin, (ground.real, ground.imag))
        for drive, pulls in (
            (("torque", "crank"), []),
            (("torque", "rocker"), [Pull("rocker", pivot, 0 * pivot, torque_there)]),
            (rod, [Pull(link, moving.place(pin), torque / arm * v / np.abs(v))]),
        ):
            found = forces(linkage, machine.at, on_links(load, linkage), pulls)
            pins = found.driven_ground, found.driven, found.other, found.other_ground
            wanted = equilibrium(at, *held, drive)
            scale = 1 + np.abs(wanted).max()
            told = [part for one in pins for part in (one[k].real, one[k].imag)]
            assert told == pytest.approx(wanted[:8].tolist(), abs=1e-9 * scale)


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
            wanted = [complex(*one[row][3 * k : 3 * k + 2]) for one in states]
            assert part == pytest.approx(np.array(wanted), rel=1e-10, abs=1e-10 * (1 + np.abs(wanted).max()))
        turned = np.array([np.exp(1j * one.at[3 * k + 2]) for one in states])
        assert link.direction == pytest.approx(turned, abs=1e-12)
        assert link.rate == pytest.approx(np.array([one.rate[3 * k + 2] for one in states]), rel=1e-10, abs=1e-10)
    name, on = three.names[seed % 3], ("ground", three.names[(seed + 1) % 3])[seed // 3 % 2]
    link = machine.links[name] if on == "ground" else machine.links[name].seen_from(machine.links[on])
    there, pin = complex(*rng.normal(size=2)) * 3, complex(*rng.normal(size=2))
    off = link.place(pin) - there
    force = machine.torque(load) / (np.real(np.conj(off) * link.speed(pin)) / np.abs(off))
    other = there if on == "ground" else machine.links[on].point_at(there)
    wanted = [three.force(one, load, name, pin, on, other) for one in states]
    assert force == pytest.approx(np.array(wanted), rel=1e-9, abs=1e-9 * np.abs(wanted).max())


@given(st.integers(0, 10_000))
def test_rates_are_derivatives_also_as_seen_from_another_link(seed: int) -> None:
    rng = np.random.default_rng(seed)
    linkage, _ = random_linkage(rng)
    machine = motions_of(linkage, Interval(0.0, 0.05), 241)
    one, other = rng.permutation(["crank", "coupler", "rocker"])[:2]
    seen = machine.links[one].seen_from(machine.links[other])
    _are_derivatives(LinkMotions(machine.at, {one: seen}, None))
    # distances between points of both links are the same seen from either
    p, q = complex(*rng.normal(size=2)), complex(*rng.normal(size=2))
    apart = np.abs(machine.links[one].place(p) - machine.links[other].place(q))
    there = machine.links[other].place(q)[0]
    assert np.abs(seen.place(p) - there) == pytest.approx(apart, abs=1e-12)


def _are_derivatives(machine: LinkMotions) -> None:
    """Rates and their changes against differences of fourth order."""
    step = machine.at[1] - machine.at[0]

    def difference(values: np.ndarray) -> np.ndarray:
        return (values[:-4] - 8 * values[1:-3] + 8 * values[3:-1] - values[4:]) / (12 * step)

    for link in machine.links.values():
        assert np.all(np.isfinite(link.origin))
        size = max(1.0, np.abs(link.acceleration).max(), np.abs(link.rate_change).max()) ** 2
        point = 0.7 - 0.4j
        for values, slope in (
            (link.place(point), link.speed(point)),
            (link.speed(point), link.change(point)),
            (np.unwrap(np.angle(link.direction)), link.rate),
            (link.rate, link.rate_change),
        ):
            assert difference(values) == pytest.approx(slope[2:-2], abs=2e-7 * size**2)
