"""Sensitivity of a motion to the dimensions of its linkage, to first order."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats, dot
from synthesis.guides import Circle, Driver, Guide, Rail, Slot
from synthesis.limits import LINKS
from synthesis.linkage import Linkage
from synthesis.target import Mean, Samples, Target


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


def deviated(guide: Guide, change: Deviation) -> Any:
    """Return a guide after a deviation; its numbers are arrays if the deviation has arrays."""
    fixed: Any = guide[0] + change.fixed
    point: Any = guide.body_point + change.body_point
    length: Any = np.real(change.radius)
    turn: Any = np.real(change.direction)
    if isinstance(guide, Circle):
        return Circle(fixed, guide.radius + length, point)
    if isinstance(guide, Rail):
        return Rail(fixed, guide.direction + turn, point)
    return Slot(fixed, point, guide.body_direction + turn)


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
    """Return the name of each dimension and a unit change of it: the four lengths of a four-bar, or `guide_dimensions`.

    The ground line of a four-bar keeps its direction.
    """
    if not linkage.is_four_bar:
        return guide_dimensions(linkage)
    first, second = linkage.guides
    coupler, ground = second.body_point - first.body_point, np.exp(1j * linkage.ground_angle)
    length, still = Deviation(radius=1.0), Deviation()
    along = Deviation(body_point=coupler / abs(coupler))
    units = (length, still), (still, along), (still, length), (still, Deviation(fixed=ground))
    return list(zip(LINKS, units))


def guide_dimensions(linkage: Linkage) -> list[tuple[str, Deviations]]:
    """Return the name of each dimension of both guides and a unit change of it; directions come last, in radians."""
    found: list[tuple[str, Deviations]] = []
    turned: list[tuple[str, Deviations]] = []
    for index, (name, guide) in enumerate(linkage.named_guides):
        fixed = {Circle: "pivot", Rail: "rail", Slot: "pin"}[type(guide)]
        units = {f"{name} length": Deviation(radius=1.0)} if isinstance(guide, Circle) else {}
        for axis, unit in (("x", 1.0), ("y", 1j)):
            units[f"{name} body point {axis}"] = Deviation(body_point=unit)
            units[f"{name} {fixed} {axis}"] = Deviation(fixed=unit)
        if guide.slides:
            units[f"{name} direction"] = Deviation(direction=1.0)
        for dimension, change in units.items():
            pair = (Deviation(), change) if index else (change, Deviation())
            (turned if change.direction else found).append((dimension, pair))
    return found + turned


def length_changes(linkage: Linkage, units: Sequence[Deviations]) -> dict[str, Floats]:
    """Return the change of each length by unit changes of the guides, (k,); a four-bar also has the length of its ground."""
    first, second = linkage.guides
    found = {
        name: np.array([np.real(unit[index].radius) for unit in units])
        for index, (name, guide) in enumerate(linkage.named_guides)
        if isinstance(guide, Circle)
    }
    if first.holds_point and second.holds_point:
        coupler = second.body_point - first.body_point
        found["coupler"] = dot(
            coupler / abs(coupler), np.array([two.body_point - one.body_point for one, two in units])
        )
    if linkage.is_four_bar:
        ground = second[0] - first[0]
        found["ground"] = dot(ground / abs(ground), np.array([two.fixed - one.fixed for one, two in units]))
    return found


def null_space(rows: Floats) -> Floats:
    """Return an orthonormal basis (m, m - rank) of the directions that rows (n, m) leave free."""
    _, singular, vectors = np.linalg.svd(rows)
    return vectors[int(np.sum(singular > 1e-10 * np.max(singular, initial=0.0))) :].T


def weighted(samples: Samples, turned: Floats, moved: Complexes) -> Floats:
    """Return changes (..., N) of rotation and position in the measure of the objective, (..., rows, N)."""
    rows = [] if samples.rotation is None else [samples.rotation_mean.root * turned]
    if samples.position is not None:
        off = samples.position_mean.root * moved / samples.length_scale
        rows += [off.real, off.imag]
    return np.stack(rows, axis=-2)


def without_drive(matrix: Floats, drive: Floats) -> Floats:
    """Project derivatives (..., rows, N) onto the changes that a drive with derivatives ``drive`` could not undo."""
    square = np.sum(drive**2, axis=-2)
    return matrix - drive * (np.sum(matrix * drive, axis=-2) / np.where(square > 0, square, 1.0))[..., None, :]


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
    first, second = (Deviation(*(np.array(values)[:, None] for values in zip(*side))) for side in zip(*changes))
    with np.errstate(all="ignore"):
        at = poses.position, turned
        on_driven = poses.position + turned * driven.body_point
        pin, contact, push = driven.contact(*at), second_guide.contact(*at), second_guide.push(*at)
        # turning a rail moves its contact along the push, turning a slot moves it against the push
        sign = 0 if not second_guide.slides else 1 if second_guide.holds_point else -1
        slid = sign * second_guide.coordinate_of(*at)
        shift = first.fixed - turned * first.body_point
        if isinstance(driven, Circle):
            shift = shift + first.radius * np.exp(1j * drive)
        elif isinstance(driven, Rail):
            shift = shift + 1j * drive * np.exp(1j * driven.direction) * first.direction
        else:
            shift = shift - 1j * (pin - on_driven) * first.direction
        defect = second.radius + dot(push, second.fixed - turned * second.body_point) + slid * second.direction
        if linkage.driver is Driver.HINGE:
            assert isinstance(driven, Slot)
            turn = -first.direction * np.ones(turned.shape)
            slide = dot(push, shift + 1j * turn * (contact - pin)) - defect
            shift = shift - turned * np.exp(1j * driven.body_direction) * slide / _clear(poses.sine)
        else:
            turn = (defect - dot(push, shift)) / _clear(np.copysign(poses.arm, poses.sine))
        return shift - 1j * turn * (pin - poses.position), turn


def _clear(values: Floats) -> Floats:
    return np.where(values != 0, values, np.nan)
