"""Random linkages of all kinds, families and branches that swing either way, random loads on them, and actuators."""

from __future__ import annotations

import numpy as np

from synthesis.drives.links import GROUND, LinkMotions, motions_of
from synthesis.drives.placement_search import PlacementSearch
from synthesis.drives.placements import Actuator, PlacementLimits
from synthesis.link_motion import LinkMotion, Mass
from synthesis.linkage import Linkage, four_bar
from synthesis.studies.forces import Load
from synthesis.target import Interval
from tests.oracles.guided_cases import DRIVES, good_linkage


def random_linkage(rng: np.random.Generator) -> tuple[Linkage, Interval]:
    """A linkage of any family and branch and a way that closes with transmission angles above 15 degrees, either way."""
    while True:
        links = tuple(rng.uniform(0.3, 2.0, 4))
        start, span = rng.uniform(0, 2 * np.pi), rng.uniform(0.2, 1.8) * rng.choice([-1, 1])
        point = (rng.uniform(0.1, 2.0), rng.uniform(-np.pi, np.pi))
        position = complex(*rng.normal(size=2))
        linkage = four_bar(
            links, int(rng.choice([-1, 1])), start, position, rng.uniform(-3, 3), point, rng.uniform(-3, 3)
        )
        if linkage.transmission_angle_min(Interval(0.0, span)) > np.deg2rad(15):
            return linkage, Interval(0.0, span)


def any_linkage(seed: int) -> tuple[Linkage, Interval]:
    """Random linkages of all kinds, drives, families and branches in either direction: every fourth is a four-bar."""
    rng = np.random.default_rng([seed, 0])
    if seed % 4 == 0:
        return random_linkage(rng)
    drive = DRIVES[(seed - seed // 4) % len(DRIVES)]
    span = rng.uniform(0.2, 1.2) * rng.choice([-1, 1])
    low, high = sorted([0.0, span])
    return good_linkage(rng, drive, low, high, np.deg2rad(15)), Interval(0.0, span)


def loads(machine: LinkMotions, rng: np.random.Generator) -> Load:
    """Force, torque, and masses with inertia on every link and the body, at a speed."""
    names = [*machine.links, "body"]
    parts = [Mass(name, rng.uniform(0, 2), complex(*rng.normal(size=2)), rng.uniform(0, 0.3)) for name in names]
    return Load(
        complex(*rng.normal(size=2)), rng.normal(), tuple(parts), complex(*rng.normal(size=2)), rng.uniform(0, 3)
    )


class Case:
    """A linkage, a link, optionally a second link that carries the other end, a load, and an actuator that may fit."""

    def __init__(self, seed: int) -> None:
        self.linkage, self.interval = any_linkage(seed)
        self.kind = "four_bar" if self.linkage.is_four_bar else self.linkage.kind.value
        self.machine = motions_of(self.linkage, self.interval)
        rng = np.random.default_rng([seed, 1])
        self.load = loads(self.machine, rng)
        names = list(self.machine.links)
        self.name = names[seed // 4 % 3]
        self.on = names[(seed // 4 + 1) % 3] if seed // 12 % 3 == 2 else GROUND
        self.stroke = float(rng.uniform(0.15, 0.8))
        self.actuator = Actuator(self.stroke * float(rng.uniform(1.1, 2.5)), self.stroke)

    @property
    def link(self) -> LinkMotion:
        """As seen from where the other end is."""
        link = self.machine.links[self.name]
        return link if self.on == GROUND else link.seen_from(self.machine.links[self.on])

    def question(self, grid: int = 60) -> PlacementSearch:
        """Box and reach are of the linkage's size."""
        link = self.link
        middle = complex(np.mean(link.origin))
        box = (middle.real - 2.5, middle.imag - 2.5, middle.real + 2.5, middle.imag + 2.5)
        expected = PlacementLimits(box, 1.5, 0.02 * self.stroke)
        return PlacementSearch(link, self.machine.at, self.machine.torque(self.load), expected, grid)


def straight(link: LinkMotion, actuator: Actuator) -> tuple[tuple[float, float, float], complex, complex]:
    """Return the placement with the largest smallest arm about a pivot, extending: pins at both ends and ground
    point in a line.

    The result is the radius of the pin, the distance of the ground point and the smallest arm; then ground
    point and pin.
    """
    swing, half, middle = link.swing(), actuator.stroke / 2, actuator.retracted + actuator.stroke / 2
    arm, bisector = half / np.tan(abs(swing) / 2), link.direction[0] * np.exp(0.5j * swing)
    pin, ground = (complex(arm, -np.sign(swing) * distant) for distant in (half, middle))
    return (abs(pin), abs(ground), arm), link.pivot + bisector * ground, link.point_at(link.pivot + bisector * pin)
