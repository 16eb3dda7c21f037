"""Random bodies on two guides with samples, some of them in order and on the same branch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from synthesis.guides import DRIVERS, Circle, Driver, Guide, Rail, Slot
from synthesis.linkage import Linkage, through

GUIDE_TYPES = (Circle, Rail, Slot)
DRIVES = [
    (guide, driver, guide_type) for guide in GUIDE_TYPES for driver in DRIVERS[guide] for guide_type in GUIDE_TYPES
]
"""Driven guide, drive, other guide: all there are."""
NAMES = [f"{driver}-{second.__name__}" for _, driver, second in DRIVES]
NEAR_DEAD = 0.01
"""Below this sine of the transmission angle a sample is left out of comparisons: branches are nearer than a tracker's step."""
NEAR_CHANGE_POINT = 1e-3


def random_guide(random: np.random.Generator, kind: type) -> Guide:
    def position() -> complex:
        return complex(*random.normal(size=2))

    if kind is Circle:
        return Circle(position(), float(random.uniform(0.5, 3)), position())
    if kind is Rail:
        return Rail(position(), float(random.uniform(0, 6)), position())
    return Slot(position(), position(), float(random.uniform(0, 6)))


def random_linkage(random: np.random.Generator, guide: type, driver: Driver, second: type) -> Linkage:
    """Draw the guides through a random pose, so that the linkage closes there."""
    guides = random_guide(random, guide), random_guide(random, second)
    rotation, position = float(random.uniform(-3, 3)), complex(*random.normal(size=2))
    turned = np.exp(1j * rotation)
    built: list[Guide] = []
    for drawn in guides:
        at = complex(position + turned * drawn.body_point)
        if isinstance(drawn, Circle):
            built.append(drawn._replace(radius=abs(at - drawn.pivot)))
        elif isinstance(drawn, Rail):
            built.append(drawn._replace(point=complex(at + random.normal() * np.exp(1j * drawn.direction))))
        else:
            built.append(
                drawn._replace(pin=complex(at + random.normal() * turned * np.exp(1j * drawn.body_direction)))
            )
    return through((built[0], built[1]), driver, rotation, position)


def good_linkage(
    random: np.random.Generator, drive: tuple[type, Driver, type], low: float, high: float, smallest: float
):
    """Draw a linkage whose transmission angle exceeds a bound over an interval after its start, with each slot's
    pin far off.
    """
    while True:
        linkage = random_linkage(random, *drive)
        found = linkage.body(linkage.start + np.linspace(low, high, 60))
        if np.all(found.transmission_angle > smallest) and np.all(found.arm > 0.3):
            return linkage


class Case(NamedTuple):
    """A linkage and samples on it, whatever branch they are on."""

    linkage: Linkage
    coordinate: np.ndarray
    side: np.ndarray
    poses: np.ndarray
    """(N, 3): rotation, x, y."""
    close: bool
    """True if a sample is nearly dead, or the linkage nearly at a change point."""


def random_case(random: np.random.Generator, guide: type, driver: Driver, second: type) -> Case:
    while True:
        linkage = random_linkage(random, guide, driver, second)
        count = int(random.integers(3, 6))
        q = linkage.start + random.uniform(-2.5, 2.5, count)
        if random.random() < 0.6:
            q = np.sort(q)
        if driver.turns and random.random() < 0.3:
            q = linkage.start + random.random() + 0.8 * 2 * np.pi * np.arange(count) / count
        mixed = random.random() < 0.5
        side = np.where(mixed & (random.random(count) < 0.12), -linkage.branch, linkage.branch)
        found = [linkage.body(q, direction) for direction in (1, -1)]
        rotation, position, sine = (np.where(side > 0, *(getattr(pose, name) for pose in found)) for name in _COLUMNS)
        if not np.all(np.isfinite(rotation)):
            continue
        change = [
            np.abs(condition.value(np.array(condition.extremes)) / condition.size).min()
            for condition in linkage.conditions
            if condition.extremes
        ]
        close = np.abs(sine).min() < NEAR_DEAD or min(change, default=1.0) < NEAR_CHANGE_POINT
        poses = np.stack([rotation, position.real, position.imag], axis=1)
        return Case(linkage, q, np.where(sine >= 0, 1, -1), poses, bool(close))


_COLUMNS = ("rotation", "position", "sine")
