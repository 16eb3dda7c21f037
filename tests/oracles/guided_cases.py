"""Bodies on two guides drawn by chance, with samples on them, some in order and on one branch and some not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from synthesis.guides import DRIVERS, Circle, Driver, Guide, Rail, Slot
from synthesis.linkage import Linkage, through

GUIDE_TYPES = (Circle, Rail, Slot)
DRIVES = [(guide, driver, other) for guide in GUIDE_TYPES for driver in DRIVERS[guide] for other in GUIDE_TYPES]
"""Driven guide, drive, other guide: all there are."""
NAMES = [f"{driver}-{other.__name__}" for _, driver, other in DRIVES]
NEAR_DEAD = 0.01
"""Below this sine of the transmission angle a sample is left out of comparisons: branches are nearer than a tracker's step."""
NEAR_CHANGE_POINT = 1e-3


def random_guide(random: np.random.Generator, kind: type) -> Guide:
    def place() -> complex:
        return complex(*random.normal(size=2))

    if kind is Circle:
        return Circle(place(), float(random.uniform(0.5, 3)), place())
    if kind is Rail:
        return Rail(place(), float(random.uniform(0, 6)), place())
    return Slot(place(), place(), float(random.uniform(0, 6)))


def random_linkage(random: np.random.Generator, guide: type, driver: Driver, other: type) -> Linkage:
    """Of a pose that is drawn first, so that it closes somewhere."""
    guides = random_guide(random, guide), random_guide(random, other)
    rotation, position = float(random.uniform(-3, 3)), complex(*random.normal(size=2))
    turned = np.exp(1j * rotation)
    made: list[Guide] = []
    for one in guides:
        at = complex(position + turned * one.body_point)
        if isinstance(one, Circle):
            made.append(one._replace(radius=abs(at - one.pivot)))
        elif isinstance(one, Rail):
            made.append(one._replace(point=complex(at + random.normal() * np.exp(1j * one.direction))))
        else:
            made.append(one._replace(pin=complex(at + random.normal() * turned * np.exp(1j * one.body_direction))))
    return through((made[0], made[1]), driver, rotation, position)


def good_linkage(
    random: np.random.Generator, drive: tuple[type, Driver, type], low: float, high: float, least: float
):
    """One whose transmission angle is above a least one over an interval after its start, where no slot's pin comes near."""
    while True:
        linkage = random_linkage(random, *drive)
        found = linkage.body(linkage.start + np.linspace(low, high, 60))
        if np.all(found.transmission_angle > least) and np.all(found.arm > 0.3):
            return linkage


class Case(NamedTuple):
    """A linkage and samples on it, whatever branch they are on."""

    linkage: Linkage
    coordinate: np.ndarray
    side: np.ndarray
    poses: np.ndarray
    """(N, 3): rotation, x, y."""
    near: bool
    """Whether a sample is all but dead, or the linkage all but at a change point."""


def random_case(random: np.random.Generator, guide: type, driver: Driver, other: type) -> Case:
    while True:
        linkage = random_linkage(random, guide, driver, other)
        count = int(random.integers(3, 6))
        q = linkage.start + random.uniform(-2.5, 2.5, count)
        if random.random() < 0.6:
            q = np.sort(q)
        if driver.turns and random.random() < 0.3:
            q = linkage.start + random.random() + 0.8 * 2 * np.pi * np.arange(count) / count
        mixed = random.random() < 0.5
        side = np.where(mixed & (random.random(count) < 0.12), -linkage.branch, linkage.branch)
        found = [linkage.body(q, way) for way in (1, -1)]
        rotation, position, sine = (np.where(side > 0, *(getattr(one, name) for one in found)) for name in _COLUMNS)
        if not np.all(np.isfinite(rotation)):
            continue
        change = [
            np.abs(one.value(np.array(one.extremes)) / one.size).min() for one in linkage.conditions if one.extremes
        ]
        near = np.abs(sine).min() < NEAR_DEAD or min(change, default=1.0) < NEAR_CHANGE_POINT
        poses = np.stack([rotation, position.real, position.imag], axis=1)
        return Case(linkage, q, np.where(sine >= 0, 1, -1), poses, bool(near))


_COLUMNS = ("rotation", "position", "sine")
