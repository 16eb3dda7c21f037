"""Velocities, accelerations and quasi-static forces of a four-bar whose crank turns at a constant speed.

All vectors are complex numbers in the user's plane, e1, e2, e3 the directions of crank, coupler and rocker there. The loop
``A + L1 e1 + L2 e2 = B + L3 e3``, differentiated once and twice by time and multiplied by the conjugate of e3 (or e2), leaves one
unknown in the real part of each equation (Norton, Design of Machinery, 6.7 and 7.3). Every one of them, and the rod force of
the rocker, is a quotient over ``sin(theta2 - theta3)``: at a dead position, where coupler and rocker lie on a line, there is
none.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.fourbar.kinematics import close_loop
from synthesis.fourbar.linkage import Linkage
from synthesis.target import Interval

CURVE_STEP = np.deg2rad(1.0)
"""Largest step of the crank in a curve over an interval."""
CURVE_LEAST = 24
"""A curve has at least so many steps, however short its interval is."""


class Load(NamedTuple):
    """What acts on the body, in directions that do not turn with it: a force at the body point and a torque."""

    force: complex = 0j
    torque: float = 0.0


class Forces(NamedTuple):
    """What holds a load in equilibrium, (n,) each: all links without mass, all pins without friction.

    Each pin force is that on the link named last: by the ground on the crank, by the crank on the coupler, by the rocker on the
    coupler, by the ground on the rocker. Law: ``crank_torque * crank_speed`` is minus the power of the load.
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


def _dot(one: Complexes, other: Complexes | complex) -> Floats:
    return np.real(np.conj(one) * other)


def _cross(one: Complexes, other: Complexes | complex) -> Floats:
    return np.imag(np.conj(one) * other)


def rates(linkage: Linkage, travel: Floats, crank_speed: float) -> Rates:
    """Velocities and accelerations of a linkage.

    ``travel`` (n,): crank angles from the first sample. ``crank_speed``: radians a second, counter-clockwise, constant.

    Law: what a difference quotient of `Linkage.joints` tends to.
    """
    at = _Directions(linkage, travel)
    one, two, three, _ = linkage.links
    e1, e2, e3 = at.first, at.second, at.third
    with np.errstate(all="ignore"):
        coupler = crank_speed * (one / two) * _cross(e1, e3) / at.sine
        rocker = crank_speed * (one / three) * _cross(e1, e2) / at.sine
        pull = (crank_speed * one) * crank_speed
        own, across = (coupler * two) * coupler, (rocker * three) * rocker
        coupler_change = -(pull * _dot(e1, e3) + own * _dot(e2, e3) - across) / (two * at.sine)
        rocker_change = -(pull * _dot(e1, e2) + own - across * _dot(e2, e3)) / (three * at.sine)
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


def forces(linkage: Linkage, travel: Floats, load: Load) -> Forces:
    """What holds a load on the body of a linkage, position by position.

    The rocker carries its rod force only; the moments on the coupler about the crank pin give it, the forces on the coupler that
    of the crank pin, and its moment about pivot A the torque of the drive.

    ``linkage``: with a body point where the load has a force. ``travel`` (n,): crank angles from the first sample.

    NaN at a dead position, where no finite force holds the load, and where the loop does not close. Law: the forces and
    moments on each link add up to zero.
    """
    at = _Directions(linkage, travel)
    one, two, _, _ = linkage.links
    moment = np.full(np.shape(travel), float(load.torque))
    with np.errstate(all="ignore"):
        if load.force:
            assert at.point is not None
            moment = moment + _cross(at.point, load.force)
        rod = moment / (two * at.sine)
        by_rocker = rod * at.third
        by_crank = -by_rocker - load.force
        torque = one * _cross(at.first, by_crank)
    pins = (by_crank, by_crank, by_rocker, by_rocker)
    return Forces(_finite(torque), *(_known(force) for force in pins))


def curve_over(interval: Interval) -> Floats:
    """Crank angles over an interval, both ends included, in even steps of at most a degree."""
    first, last = interval
    steps = max(CURVE_LEAST, int(np.ceil(abs(last - first) / CURVE_STEP * (1 - 1e-12))))
    return np.linspace(first, last, steps + 1)


def _finite(values: Floats) -> Floats:
    return np.where(np.isfinite(values), values, np.nan)


def _known(values: Complexes) -> Complexes:
    return np.where(np.isfinite(values), values, complex(np.nan, np.nan))
