"""Velocities, accelerations and forces of a body on two guides whose drive moves at a constant speed.

The other guide pushes along f through X. If the drive is locked, the body turns about the pin Z (with a hinge, it
slides along the slot). Therefore the moments about Z (or the forces along the slot) determine this push, the remaining
forces the push of the driven guide, and the balance of the driven link the torque or force of the drive. Guides have no
friction. All results are quotients over sin mu, so that they do not exist at a dead position.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats, cross, dot
from synthesis.guides import Circle, Driver, Rail, Slot
from synthesis.link_motion import LinkMotion, Mass
from synthesis.linkage import BODY, Linkage


class PointForce(NamedTuple):
    """Force of constant direction at a point of a link; ``at`` in the frame of the link."""

    link: str
    at: complex
    force: complex


class Load(NamedTuple):
    """Loads on the body, in fixed directions, and masses of the links."""

    force: complex = 0j
    """Force at the position of the body."""
    torque: float = 0.0
    masses: tuple[Mass, ...] = ()
    gravity: complex = 0j
    """Force on a unit of mass."""
    speed: float = 0.0
    """Constant speed of the drive; masses also resist their acceleration."""
    metre: float = 1.0
    """Force that accelerates a unit of mass by a unit of length per second squared: 0.001 for kg, mm and N."""
    forces: tuple[PointForce, ...] = ()
    """Forces at points of links; `forces` takes them as pulls."""


class Pull(NamedTuple):
    """Additional load on a link: a force (n,) at points (n,) of the plane, and a couple."""

    link: str
    point: Complexes
    force: Complexes
    couple: Floats | float = 0.0


class Forces(NamedTuple):
    """Forces in equilibrium with a load, (n,) each. Law: ``drive`` times its speed is minus the power of all loads."""

    drive: Floats
    """Counter-clockwise torque of a crank or hinge; force of a slider along its rail, of a cylinder outwards."""
    driven: Complexes
    """Force on the body by the link of the driven guide."""
    undriven: Complexes
    """Force on the body by the link of the other guide."""
    driven_ground: Complexes
    """Force on the link of the driven guide by the ground and by a sliding drive."""
    undriven_ground: Complexes
    """Force on the link of the other guide by the ground."""


def on_links(load: Load, linkage: Linkage) -> Load:
    """Convert masses on ``body`` and on a coupler (from the crank pin along it) to masses of `forces`."""

    def on_link(mass: Mass) -> Mass:
        if mass.link == BODY:
            return mass._replace(at=linkage.on_body(mass.at))
        return mass._replace(link=BODY) if mass.link == "body" else mass

    return load._replace(masses=tuple(map(on_link, load.masses)))


def forces(linkage: Linkage, travel: Floats, load: Load, pulls: Sequence[Pull] = ()) -> Forces:
    """Compute the forces that hold loads on the body and on links, position by position, while the drive moves.

    ``travel`` (n,): travel of the drive from the first sample. Masses are on links of `Linkage.link_names`, in their
    frames.

    NaN at a dead position, at which no finite force holds the load, and if the loop does not close.
    """
    links = linkage.motions(travel)
    found = linkage.body(linkage.start + travel)
    body = links[1]
    driven, second = linkage.guides
    turned = body.direction
    with np.errstate(all="ignore"):
        acting = {link.name: _acting(link, load, pulls) for link in links}
        on_body, about_place = acting[BODY]
        on_body = on_body + load.force
        about_place = about_place + load.torque
        # contact and direction of the push of the other guide, and the share of the mass of its link
        at, push = second.contact(body.origin, turned), second.push(body.origin, turned)
        extra, couple = 0j * turned, np.zeros(turned.shape)
        own, turning = acting[links[2].name]
        if isinstance(second, Circle):
            extra = turning / second.radius * 1j * push
        elif isinstance(second, Rail):
            along = np.exp(1j * second.direction)
            extra = np.real(np.conj(along) * own) * along
        else:
            couple = turning
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
            pin = driven.contact(body.origin, turned)
            held = cross(at - pin, by_other) + couple + cross(body.origin - pin, on_body) + about_place + turning
            return held_by(-held, by_driven, by_other)
        pin = driven.contact(body.origin, turned)
        moment = cross(at - pin, extra) + couple + cross(body.origin - pin, on_body) + about_place
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


def _acting(link: LinkMotion, load: Load, pulls: Sequence[Pull]) -> tuple[Complexes, Floats]:
    """Weight, inertia against its acceleration (d'Alembert) and pulls of a link: the force, and its moment about its origin."""
    force, moment = 0j * link.origin, np.zeros(link.angle.shape)
    for mass in load.masses:
        if mass.link == link.name:
            inertial = mass.mass * (load.gravity - load.metre * load.speed**2 * link.change(mass.at))
            force = force + inertial
            moment = moment + cross(link.direction * mass.at, inertial)
            moment = moment - load.metre * load.speed**2 * mass.inertia * link.rate_change
    for pull in pulls:
        if pull.link == link.name:
            force = force + pull.force
            moment = moment + cross(pull.point - link.origin, pull.force) + pull.couple
    return force, moment


def _clear(values: Floats) -> Floats:
    return np.where(values != 0, values, np.nan)


def _finite(values: Floats) -> Floats:
    return np.where(np.isfinite(values), values, np.nan)


def _known(values: Complexes) -> Complexes:
    return np.where(np.isfinite(values), values, complex(np.nan, np.nan))
