"""What the four pins of a four-bar carry when a drive or springs act on its links, position by position.

The coupler's moments about the crank pin and the rocker's about its pivot are two linear equations for the force in the coupler
pin; the forces on each link give the others. The crank's moment is left over: it is what the drive is computed from.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats, cross
from synthesis.drives.links import Loading, Machine


class Pull(NamedTuple):
    """A force (n,) on a link at places (n,) of the plane."""

    link: str
    place: Complexes
    force: Complexes


class Pins(NamedTuple):
    """Forces in the pins, (n,) each, by ground on crank, crank on coupler, rocker on coupler, ground on rocker."""

    pivot_a: Complexes
    crank_pin: Complexes
    coupler_pin: Complexes
    pivot_b: Complexes


def pin_forces(machine: Machine, load: Loading, pulls: Sequence[Pull], on_rocker: Floats | float = 0.0) -> Pins:
    """Pin forces of a four-bar from `machine_of`; ``on_rocker``: the torque of a drive at its pivot.

    Law: with what drives it among ``pulls``, the forces and moments on each link add up to zero.
    """
    coupler, rocker = machine.links["coupler"], machine.links["rocker"]
    origins = {name: link.origin for name, link in machine.links.items()}
    end = rocker.place(2 * machine.middles["rocker"])
    forces = {name: np.zeros(machine.at.size, dtype=complex) for name in origins}
    moments = {name: np.zeros(machine.at.size) for name in origins}

    def add(name: str, place: Complexes, force: Complexes | complex) -> None:
        name = "coupler" if name == "body" else name
        forces[name] = forces[name] + force
        moments[name] = moments[name] + cross(place - origins[name], force)

    if machine.body is not None:
        add("body", machine.body.origin, load.force)
    moments["coupler"] = moments["coupler"] + load.torque
    for mass in load.masses:
        link = machine.link(mass.link)
        add(
            mass.link,
            link.place(mass.at),
            mass.mass * (load.gravity - load.metre * load.speed**2 * link.change(mass.at)),
        )
        name = "coupler" if mass.link == "body" else mass.link
        moments[name] = moments[name] - load.metre * mass.inertia * load.speed**2 * link.rate_change
    for pull in pulls:
        if pull.link in origins:
            add(pull.link, pull.place, pull.force)
    moments["rocker"] = moments["rocker"] + on_rocker
    one, other = end - coupler.origin, end - rocker.origin
    at_c = (-moments["rocker"] * one - moments["coupler"] * other) / cross(one, other)
    at_d = -at_c - forces["coupler"]
    return Pins(at_d - forces["crank"], at_d, at_c, at_c - forces["rocker"])
