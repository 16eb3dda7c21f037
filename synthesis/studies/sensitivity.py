"""Sensitivity of a motion to the dimensions of its linkage, to first order."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats, dot
from synthesis.guides import Circle, Driver, Guide, Rail, Slot
from synthesis.linkage import Linkage
from synthesis.target import Mean, Target

LENGTHS = ("crank", "coupler", "rocker", "ground")
"""Dimensions of a four-bar."""


class Deviation(NamedTuple):
    """Change of one guide of many linkages: arrays (count, 1) or numbers."""

    radius: Floats | float = 0.0
    body_point: Complexes | complex = 0j
    """Change in the body's frame."""
    fixed: Complexes | complex = 0j
    """Change of its pivot, point or pin."""
    direction: Floats | float = 0.0
    """Change of the direction of a rail, or of a slot in the body."""


Deviations = tuple[Deviation, Deviation]
"""Changes of both guides."""


class Change(NamedTuple):
    """Change of the motion per unit of a dimension, all other dimensions held."""

    dimension: str
    rotation: float | None
    """Rms change of rotation over the samples per unit of the dimension; null where no rotation was asked for."""
    position: float | None
    """Rms change of position."""


def changes(linkage: Linkage, target: Target, radian: float = 1.0) -> list[Change]:
    """Return the change of the motion per unit of each dimension, with all other dimensions held.

    Parameters
    ----------
    linkage : Linkage
        The linkage.
    target : Target
        The motion, with the travel of the drive at the samples.
    radian : float, optional
        Radians in the unit of angle, for rotations and for dimensions that are directions.
    """

    def rms(mean: Mean, slope: Complexes | Floats) -> float:
        return float(np.sqrt(mean(np.abs(slope) ** 2)))

    names, units = zip(*dimensions_of(linkage))
    positions, rotations = derivatives(linkage, linkage.start + target.crank, units)
    found = []
    for name, unit, position, rotation in zip(names, units, positions, rotations):
        scale = radian if any(change.direction for change in unit) else 1.0
        turned = None if target.rotation is None else rms(target.rotation_mean, rotation) * scale / radian
        moved = None if target.position is None else rms(target.position_mean, position) * scale
        found.append(Change(name, turned, moved))
    return found


def dimensions_of(linkage: Linkage) -> list[tuple[str, Deviations]]:
    """Return the name of each dimension and a unit change of it; directions come last, in radians.

    A four-bar has its four lengths; the ground line keeps its direction.
    """
    found: list[tuple[str, Deviations]] = []
    turned: list[tuple[str, Deviations]] = []

    def of_guide(index: int, change: Deviation) -> Deviations:
        return (change, Deviation()) if index == 0 else (Deviation(), change)

    if linkage.is_four_bar:
        first, second = linkage.guides
        coupler = second.body_point - first.body_point
        ground = np.exp(1j * linkage.ground_angle)
        units = (
            Deviation(radius=1.0),
            Deviation(body_point=coupler / abs(coupler)),
            Deviation(radius=1.0),
            Deviation(fixed=ground),
        )
        return [(name, of_guide(index, unit)) for name, index, unit in zip(LENGTHS, (0, 1, 1, 1), units)]
    for index, (name, guide) in enumerate(linkage.named_guides):
        fixed = {Circle: "pivot", Rail: "rail", Slot: "pin"}[type(guide)]
        if isinstance(guide, Circle):
            found.append((f"{name} length", of_guide(index, Deviation(radius=1.0))))
        else:
            turned.append((f"{name} direction", of_guide(index, Deviation(direction=1.0))))
        for axis, unit in (("x", 1.0), ("y", 1j)):
            found.append((f"{name} body point {axis}", of_guide(index, Deviation(body_point=unit))))
            found.append((f"{name} {fixed} {axis}", of_guide(index, Deviation(fixed=unit))))
    return found + turned


def derivatives(linkage: Linkage, coordinate: Floats, changes: Sequence[Deviations]) -> tuple[Complexes, Floats]:
    """Return derivatives (changes, n) of position and rotation of the body by changes of the guides; NaN at a dead position.

    With the drive locked, a change moves the body's point at the pin Z by a known vector (with a hinge up to a slide along its
    slot). The other guide then fixes the rotation about Z (the slide), with the lever |X - Z| sin mu (sin mu).

    Parameters
    ----------
    linkage : Linkage
        The linkage as designed.
    coordinate : ndarray, shape (n,)
        Coordinates of the drive.
    changes : sequence of two Deviation each
        Unit changes of both guides.
    """
    poses = linkage.body(coordinate)
    drive = coordinate + linkage.ground_angle if linkage.driver.turns else coordinate
    turned = np.exp(1j * poses.rotation)
    driven, second_guide = linkage.guides
    positions, rotations = [], []
    with np.errstate(all="ignore"):
        at = poses.position, turned
        on_driven = poses.position + turned * driven.body_point
        pin, contact, push = driven.contact(*at), second_guide.contact(*at), second_guide.push(*at)
        # turning a rail moves its contact along the push, turning a slot moves it against the push
        sign = 0 if not second_guide.slides else 1 if second_guide.holds_point else -1
        slid = sign * second_guide.coordinate_of(*at)
        slot = turned * np.exp(1j * direction_of(driven))
        for first, second in changes:
            shift = first.fixed - turned * first.body_point
            if isinstance(driven, Circle):
                shift = shift + first.radius * np.exp(1j * drive)
            elif isinstance(driven, Rail):
                shift = shift + 1j * drive * np.exp(1j * driven.direction) * first.direction
            else:
                shift = shift - 1j * (pin - on_driven) * first.direction
            defect = second.radius + dot(push, second.fixed - turned * second.body_point) + slid * second.direction
            if linkage.driver is Driver.HINGE:
                turn = np.full(turned.shape, -first.direction)
                slide = dot(push, shift + 1j * turn * (contact - pin)) - defect
                shift = shift - slot * slide / _clear(poses.sine)
            else:
                turn = (defect - dot(push, shift)) / _clear(np.copysign(poses.arm, poses.sine))
            positions.append(shift - 1j * turn * (pin - poses.position))
            rotations.append(turn)
    return np.array(positions), np.array(rotations)


def _clear(values: Floats) -> Floats:
    return np.where(values != 0, values, np.nan)


def direction_of(guide: Guide) -> float:
    """Return the direction of a rail, or of a slot in the body; 0 for a circle."""
    if isinstance(guide, Circle):
        return 0.0
    return guide.direction if isinstance(guide, Rail) else guide.body_direction
