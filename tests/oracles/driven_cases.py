"""Random linkages of every family and branch that swing either way, and random loads on them."""

from __future__ import annotations

import numpy as np

from synthesis.drives.actuator import Actuator
from synthesis.drives.links import LinkMotion, Loading
from synthesis.fourbar.linkage import Linkage
from synthesis.guided.analysis import Mass
from synthesis.target import Interval


def random_linkage(rng: np.random.Generator) -> tuple[Linkage, Interval]:
    """A linkage of any family and branch and a way that closes with transmission angles above 15 degrees, either way."""
    while True:
        links = tuple(rng.uniform(0.3, 2.0, 4))
        start, span = rng.uniform(0, 2 * np.pi), rng.uniform(0.2, 1.8) * rng.choice([-1, 1])
        point = (rng.uniform(0.1, 2.0), rng.uniform(-np.pi, np.pi))
        place = complex(*rng.normal(size=2))
        one = Linkage(links, int(rng.choice([-1, 1])), start, place, rng.uniform(-3, 3), point, rng.uniform(-3, 3))
        if one.transmission_angle_min(Interval(0.0, span)) > np.deg2rad(15):
            return one, Interval(0.0, span)


def loads(linkage: Linkage, rng: np.random.Generator) -> Loading:
    parts = [
        Mass(name, rng.uniform(0, 2), complex(*rng.normal(size=2)), rng.uniform(0, 0.3))
        for name in ("crank", "coupler", "rocker", "body")
    ]
    return Loading(
        complex(*rng.normal(size=2)), rng.normal(), tuple(parts), complex(*rng.normal(size=2)), rng.uniform(0, 3)
    )


def straight(link: LinkMotion, actuator: Actuator) -> tuple[tuple[float, float, float], complex, complex]:
    """The placement with the largest least arm about a pivot, extending: pins at both ends and the ground point on one line.

    Radius of the pin, distance of the ground point and the least arm; then ground point and pin.
    """
    swing, half, middle = link.swing(), actuator.stroke / 2, actuator.retracted + actuator.stroke / 2
    arm, bisector = half / np.tan(abs(swing) / 2), link.direction[0] * np.exp(0.5j * swing)
    pin, ground = (complex(arm, -np.sign(swing) * far) for far in (half, middle))
    return (abs(pin), abs(ground), arm), link.pivot + bisector * ground, link.point_at(link.pivot + bisector * pin)
