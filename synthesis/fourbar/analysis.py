"""Velocities, accelerations and forces of a four-bar whose crank turns at a constant speed, its own weight and inertia included.

All vectors are complex numbers in the user's plane, e1, e2, e3 the directions of crank, coupler and rocker there. The loop
``A + L1 e1 + L2 e2 = B + L3 e3``, differentiated once and twice by time and multiplied by the conjugate of e3 (or e2), leaves one
unknown in the real part of each equation (Norton, Design of Machinery, 6.7 and 7.3). Every one of them, and the rod force of
the rocker, is a quotient over ``sin(theta2 - theta3)``: at a dead position, where coupler and rocker lie on a line, there is
none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats, cross, dot
from synthesis.fourbar.kinematics import close_loop
from synthesis.fourbar.linkage import Linkage
from synthesis.target import Interval

CURVE_STEP = np.deg2rad(1.0)
"""Largest step of the crank in a curve over an interval."""
CURVE_LEAST = 24
"""A curve has at least so many steps, however short its interval is."""


class LinkMass(NamedTuple):
    """Mass, centre and inertia of a moving link, in its frame: origin in its first joint, x axis to its second."""

    mass: float
    centre: complex
    inertia: float = 0.0
    """About the centre: mass times length squared."""


class Own(NamedTuple):
    """What the links weigh: masses of ``crank``, ``coupler`` and ``rocker``, those that have any."""

    masses: Mapping[str, LinkMass]
    gravity: complex = 0j
    """Force of a unit of mass."""
    metre: float = 1.0
    """Force of a unit of mass that gains a unit of length a second every second: 0.001 for kg, mm and N."""


class Load(NamedTuple):
    """What acts on the body, in directions that do not turn with it, and what the links weigh."""

    force: complex = 0j
    """At the body point."""
    torque: float = 0.0
    own: Own | None = None


class Forces(NamedTuple):
    """What holds a load in equilibrium, (n,) each: links with the masses of the load or none, all pins without friction.

    Each pin force is that on the link named last: by the ground on the crank, by the crank on the coupler, by the rocker on the
    coupler, by the ground on the rocker. Law: ``crank_torque * crank_speed`` is minus the power of the load, plus the rate at
    which the energy of the links' own masses grows.
    """

    crank_torque: Floats
    """Of the drive on the crank, counter-clockwise: force times length."""
    pivot_a: Complexes
    crank_pin: Complexes
    coupler_pin: Complexes
    pivot_b: Complexes


@dataclass(frozen=True)
class Rates:
    """Velocities and accelerations at crank angles, (n,) each; NaN at a dead position and where the loop does not close.

    Angles in radians. ``velocity`` and ``acceleration`` are those of the body point, None where the linkage guides none.
    """

    coupler_velocity: Floats
    rocker_velocity: Floats
    coupler_acceleration: Floats
    rocker_acceleration: Floats
    velocity: Complexes | None
    acceleration: Complexes | None


class _Directions:
    """e1, e2, e3 of a linkage at crank angles from its first sample, and the sine of theta2 - theta3 without cancellation."""

    def __init__(self, linkage: Linkage, travel: Floats) -> None:
        closure = close_loop(np.array(linkage.links), linkage.start + travel)
        branch, turn = np.array(linkage.branch), linkage.ground_angle
        self.first = np.exp(1j * (closure.crank_angle + turn))
        self.second = np.exp(1j * (closure.coupler_angle(branch) + turn))
        self.third = np.exp(1j * (closure.rocker_angle(branch) + turn))
        two, three = closure.lengths[..., 1], closure.lengths[..., 2]
        # sin(tau) = sqrt(X Y) / (2 L2 L3), see `Closure.coupler_angle_gradient`; each factor stays of order one
        sine = -linkage.branch * np.sqrt(closure.excess_x / (2 * two)) * np.sqrt(closure.excess_y / (2 * two)) / three
        self.sine = np.where(sine != 0, sine, np.nan)
        """sin(theta2 - theta3); NaN at a dead position."""
        self.point = None
        """The vector from the crank pin to the body point."""
        if linkage.mounted:
            self.point = linkage.arm * self.second


def rates(linkage: Linkage, travel: Floats, crank_speed: float) -> Rates:
    """Velocities and accelerations of a linkage.

    ``travel`` (n,): crank angles from the first sample. ``crank_speed``: radians a second, counter-clockwise, constant.

    Law: what a difference quotient of `Linkage.joints` tends to.
    """
    at = _Directions(linkage, travel)
    one, two, three, _ = linkage.links
    e1, e2, e3 = at.first, at.second, at.third
    with np.errstate(all="ignore"):
        coupler = crank_speed * (one / two) * cross(e1, e3) / at.sine
        rocker = crank_speed * (one / three) * cross(e1, e2) / at.sine
        pull = (crank_speed * one) * crank_speed
        own, across = (coupler * two) * coupler, (rocker * three) * rocker
        coupler_change = -(pull * dot(e1, e3) + own * dot(e2, e3) - across) / (two * at.sine)
        rocker_change = -(pull * dot(e1, e2) + own - across * dot(e2, e3)) / (three * at.sine)
        velocity = acceleration = None
        if at.point is not None:
            velocity = 1j * (crank_speed * one * e1 + coupler * at.point)
            acceleration = (1j * coupler_change - coupler**2) * at.point - pull * e1
    return Rates(
        _finite(coupler),
        _finite(rocker),
        _finite(coupler_change),
        _finite(rocker_change),
        None if velocity is None else _known(velocity),
        None if acceleration is None else _known(acceleration),
    )


def forces(linkage: Linkage, travel: Floats, load: Load, crank_speed: float = 0.0) -> Forces:
    """What holds a load on the body of a linkage, position by position, while the crank turns.

    Coupler pin: its part along the rocker from the moments on the coupler about the crank pin, that along the coupler from those
    on the rocker about pivot B. The forces on the coupler give the crank pin, its moment about pivot A the torque of the drive. A
    mass adds its weight and, against its acceleration, its inertia (d'Alembert).

    ``linkage``: with a body point where the load has a force. ``travel`` (n,): crank angles from the first sample.
    ``crank_speed``: radians a second; without own masses the forces do not depend on it.

    NaN at a dead position, where no finite force holds the load, and where the loop does not close. Law: the forces and
    moments on each link add up to zero.
    """
    at = _Directions(linkage, travel)
    one, two, three, _ = linkage.links
    moment = np.full(np.shape(travel), float(load.torque))
    own = _own_loads(linkage, travel, at, load.own or Own({}), crank_speed)
    with np.errstate(all="ignore"):
        if load.force:
            assert at.point is not None
            moment = moment + cross(at.point, load.force)
        (by_mass, turned), (on_coupler, about_pin), (on_rocker, about_b) = own
        rod = (moment + about_pin) / (two * at.sine)
        by_rocker = rod * at.third + about_b / (three * at.sine) * at.second
        by_crank = -by_rocker - load.force - on_coupler
        torque = one * cross(at.first, by_crank) - turned
        pins = (by_crank - by_mass, by_crank, by_rocker, by_rocker - on_rocker)
    return Forces(_finite(torque), *(_known(force) for force in pins))


def _own_loads(
    linkage: Linkage, travel: Floats, at: _Directions, own: Own, crank_speed: float
) -> list[tuple[Complexes, Floats]]:
    """Weight and inertia of crank, coupler and rocker: the force on each, and its moment about pivot A, crank pin, pivot B."""
    found = []
    moving = rates(linkage, travel, crank_speed) if own.masses else None
    for name, direction in (("crank", at.first), ("coupler", at.second), ("rocker", at.third)):
        link = own.masses.get(name)
        if link is None or moving is None:
            found.append((np.zeros_like(at.first), np.zeros(np.shape(travel))))
            continue
        turning, gaining, pin = {
            "crank": (np.array(crank_speed), np.array(0.0), 0.0),
            "coupler": (moving.coupler_velocity, moving.coupler_acceleration, 1.0),
            "rocker": (moving.rocker_velocity, moving.rocker_acceleration, 0.0),
        }[name]
        arm = link.centre * direction
        with np.errstate(all="ignore"):
            gain = (1j * gaining - turning**2) * arm - pin * crank_speed**2 * linkage.links[0] * at.first
            force = link.mass * (own.gravity - own.metre * gain)
            found.append((force, cross(arm, force) - own.metre * link.inertia * gaining))
    return found


def curve_over(interval: Interval) -> Floats:
    """Crank angles over an interval, both ends included, in even steps of at most a degree."""
    first, last = interval
    steps = max(CURVE_LEAST, int(np.ceil(abs(last - first) / CURVE_STEP * (1 - 1e-12))))
    return np.linspace(first, last, steps + 1)


def _finite(values: Floats) -> Floats:
    return np.where(np.isfinite(values), values, np.nan)


def _known(values: Complexes) -> Complexes:
    return np.where(np.isfinite(values), values, complex(np.nan, np.nan))
