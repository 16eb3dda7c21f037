"""Velocities, accelerations and forces of a body on two guides whose drive moves at a constant speed.

The other guide pushes along f through X; with the drive locked the body turns about the pin Z (with the hinge locked it slides
along its slot). So the moments about Z (the forces along the slot) give that push, the rest of the forces that of the driven
guide, and the driven link's balance the torque or force of the drive. Guides have no friction. Everything is a quotient over
sin mu: at a dead position there is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats, cross, dot
from synthesis.guided.linkage import BODY, Circle, Driver, GuidedLinkage, MovingLink, Rail, Slot


class Mass(NamedTuple):
    """A mass on a link: its centre in the link's frame, its inertia about that (mass times length squared)."""

    link: str
    mass: float
    at: complex = 0j
    inertia: float = 0.0


class Load(NamedTuple):
    """What acts on the body, in directions that do not turn with it, and what the links weigh."""

    force: complex = 0j
    """At the body's place."""
    torque: float = 0.0
    masses: Sequence[Mass] = ()
    gravity: complex = 0j
    """Force of a unit of mass."""
    metre: float = 1.0
    """Force of a unit of mass that gains a unit of length a second every second: 0.001 for kg, mm and N."""


class Forces(NamedTuple):
    """What holds a load in equilibrium, (n,) each. Law: ``drive`` times its speed is minus the power of all that acts."""

    drive: Floats
    """Counter-clockwise torque of a crank or hinge; force of a slider along its rail, of a cylinder outwards."""
    driven: Complexes
    """By the driven guide's link on the body."""
    other: Complexes
    """By the other guide's link on the body."""
    driven_ground: Complexes
    """On the driven guide's link, by the ground and a drive that slides."""
    other_ground: Complexes
    """By the ground on the other guide's link."""


def forces(linkage: GuidedLinkage, travel: Floats, load: Load, speed: float = 0.0) -> Forces:
    """What holds a load on the body, position by position, while the drive moves.

    ``travel`` (n,): of the drive from the first sample. ``speed``: of the drive, constant; without masses it does not count.

    NaN at a dead position, where no finite force holds the load, and where the loop does not close.
    """
    links = linkage.links(travel)
    found = linkage.body(linkage.start + travel)
    body = links[1]
    driven, other = linkage.guides
    turned = np.exp(1j * body.direction)
    with np.errstate(all="ignore"):
        acting = {link.name: _acting(link, load, speed) for link in links}
        on_body, about_place = acting[BODY]
        on_body = on_body + load.force
        about_place = about_place + load.torque
        # where the other guide pushes, which way, and what its link's own mass adds
        at = other.pin + 0j * turned if isinstance(other, Slot) else body.place + turned * other.body_point
        extra, couple = 0j * turned, np.zeros(turned.shape)
        own, turning = acting[links[2].name]
        if isinstance(other, Circle):
            push = (at - other.pivot) / other.radius
            extra = turning / other.radius * 1j * push
        elif isinstance(other, Rail):
            along = np.exp(1j * other.direction)
            push, extra = 1j * along + 0j * turned, np.real(np.conj(along) * own) * along
        else:
            push, couple = 1j * turned * np.exp(1j * other.body_direction), turning
        own_other = own
        own, turning = acting[links[0].name]

        def held_by(drive: Floats, by_driven: Complexes, by_other: Complexes) -> Forces:
            ground = by_driven - own, by_other - own_other
            return Forces(_finite(drive), *(_known(force) for force in (by_driven, by_other, *ground)))

        if linkage.driver is Driver.HINGE:
            assert isinstance(driven, Slot)
            slot = turned * np.exp(1j * driven.body_direction)
            size = -dot(slot, on_body + extra) / _clear(found.sine)
            by_other = size * push + extra
            by_driven = -by_other - on_body
            pin = driven.pin + 0j * turned
            held = cross(at - pin, by_other) + couple + cross(body.place - pin, on_body) + about_place + turning
            return held_by(-held, by_driven, by_other)
        pin = driven.pin + 0j * turned if isinstance(driven, Slot) else body.place + turned * driven.body_point
        moment = cross(at - pin, extra) + couple + cross(body.place - pin, on_body) + about_place
        if isinstance(driven, Slot):
            moment = moment + turning
        size = -moment / _clear(np.copysign(found.arm, found.sine))
        by_other = size * push + extra
        by_driven = -by_other - on_body
        if isinstance(driven, Circle):
            drive = cross(pin - driven.pivot, by_driven) - turning
        elif isinstance(driven, Rail):
            along = np.exp(1j * driven.direction)
            drive = np.real(np.conj(along) * (by_driven - own))
        else:
            drive = -dot(turned * np.exp(1j * driven.body_direction), by_driven)
        return held_by(drive, by_driven, by_other)


def _acting(link: MovingLink, load: Load, speed: float) -> tuple[Complexes, Floats]:
    """Weight and inertia of a link, against its acceleration (d'Alembert): the force, and its moment about the link's place."""
    force, moment = 0j * link.place, np.zeros(link.direction.shape)
    for one in load.masses:
        if one.link != link.name:
            continue
        arm = one.at * np.exp(1j * link.direction)
        spin = link.direction_second * speed**2
        gain = link.place_second * speed**2 + (1j * spin - (link.direction_rate * speed) ** 2) * arm
        own = one.mass * (load.gravity - load.metre * gain)
        force = force + own
        moment = moment + cross(arm, own) - load.metre * one.inertia * spin
    return force, moment


def _clear(values: Floats) -> Floats:
    return np.where(values != 0, values, np.nan)


def _finite(values: Floats) -> Floats:
    return np.where(np.isfinite(values), values, np.nan)


def _known(values: Complexes) -> Complexes:
    return np.where(np.isfinite(values), values, complex(np.nan, np.nan))
