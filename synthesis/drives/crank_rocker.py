"""The crank-rocker that swings a link about a fixed pivot through a given angle with a given time ratio.

Motor, rod, the pin's radius c and the distance d of the motor O from the pivot are a crank-rocker. With h half the chord of the
pin's path and e the angle QaOQb, which determines the time ratio (pi + e) / (pi - e)::

    a = h sin(zeta) / cos(e/2)        b = h cos(zeta) / |sin(e/2)|        0 < zeta < pi/2

and zeta is chosen for the largest minimum transmission angle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Flags, Floats
from synthesis.drives.motor import MotorCycle, evaluate_motor, return_angle
from synthesis.four_bar import grashof_excesses, transmission_angle_over
from synthesis.link_motion import LinkMotion
from synthesis.mechanism import Box, outside
from synthesis.target import TURN, Interval


@dataclass(frozen=True)
class CrankRockerOptions:
    """Options of the search for a crank-rocker."""

    zetas: int = 2000
    """Number of values of zeta that are evaluated before the best is refined."""
    rod: float = 3.0
    """Rod divided by pin radius for equal times, for which any rod works: at most 1.7 degrees worse than an infinite rod."""
    more_rods: tuple[float, ...] = (2.5, 2.0, 1.6, 1.3, 1.1, 0.9, 4.0, 6.0)
    """Further rods that are tried if the region of the motor is limited."""
    equal_time_tolerance: float = 1e-6
    """Difference from 1 below which a time ratio counts as equal times."""
    radius_factors: tuple[float, ...] = (1, 0.8, 1.25, 0.6, 1.6, 0.4, 2.2, 0.25, 3, 0.15)
    """Factors of the pin's default radius that are tried."""


OPTIONS = CrankRockerOptions()
MAX_TIME_RATIO = 5.0
"""Largest time ratio: the rod's transmission angle is then at best 60 degrees less half the swing."""


class Proportions(NamedTuple):
    """A crank-rocker in units of the pin's radius, seen from the pivot with the bisector of the swing along x.

    It belongs to a swing that turns counter-clockwise while the rod's end moves away from the motor; mirror images give the
    other swings.
    """

    crank: float
    rod: float
    ground: float
    motor: complex
    transmission_angle_min: float
    """Minimum over the whole turn of the motor, in radians."""


def proportions(swing: float, time_ratio: float = 1.0, rod: float = OPTIONS.rod) -> Proportions | None:
    """Return the crank-rocker with the largest minimum transmission angle for a swing; None if there is none.

    Parameters
    ----------
    swing : float
        Angle of the rocker's swing, in radians, below pi.
    time_ratio : float
        Ratio of the slower and the faster stroke, at least 1.
    rod : float, optional
        Length of the rod divided by the pin's radius, for equal times only.
    """
    from scipy.optimize import minimize_scalar

    if not 0 < swing < np.pi:
        return None
    half, e = swing / 2, return_angle(time_ratio)
    chord = np.sin(half)

    def evaluate(zeta: Floats) -> tuple[Floats, Complexes, Floats, Floats]:
        crank = chord * np.sin(zeta) / np.cos(e / 2)
        rods = chord * np.cos(zeta) / np.sin(e / 2) if e > 0 else np.full(zeta.shape, rod)
        with np.errstate(invalid="ignore"):
            across = np.sqrt((rods - chord) * (rods + chord) * (chord - crank) * (chord + crank)) / chord
        motors = np.cos(half) + np.stack([across, -across]) - 1j * (crank / chord * rods)
        return _transmission_angles(crank, rods, motors, half), motors, crank, rods

    side, zeta = 0, np.pi / 2  # of equal times, for any rod
    if e > 0:
        zetas = np.linspace(0, np.pi / 2, OPTIONS.zetas + 2)[1:-1]
        angles = evaluate(zetas)[0]
        side, k = divmod(int(np.argmax(angles)), zetas.size)
        ends = zetas[[max(k - 1, 0), min(k + 1, zetas.size - 1)]]
        refined = minimize_scalar(
            lambda zeta: -evaluate(np.array([zeta]))[0][side, 0],
            bounds=ends,
            method="bounded",
            options={"xatol": 1e-12},
        )
        zeta = zetas[k] if -refined.fun < angles[side, k] else refined.x
    angles, motors, crank, rods = evaluate(np.array([zeta]))
    if angles[side, 0] <= 0:
        return None
    motor = complex(motors[side, 0])
    return Proportions(float(crank[0]), float(rods[0]), abs(motor), motor, float(angles[side, 0]))


def _transmission_angles(crank: Floats, rod: Floats, motors: Complexes, half: float) -> Floats:
    """Return the minimum transmission angles (2, n) of crank-rockers with pin radius 1; -1 if the crank does not turn fully."""
    ground = np.abs(motors)
    lengths = np.stack(np.broadcast_arrays(crank, rod, 1.0, ground), axis=-1)
    with np.errstate(invalid="ignore"):
        shortest = (crank < rod) & (crank < 1) & (crank < ground)
        turns = np.all(np.stack(grashof_excesses(np.nan_to_num(lengths, nan=1.0))) > 0, axis=0)
        first, last = (np.imag(np.conj(motors) * np.exp(1j * angle)) for angle in (-half, half))
        same_side = first * last > 0
    good: Flags = shortest & turns & same_side & np.isfinite(ground)
    angles = np.full(good.shape, -1.0)
    if good.any():
        angles[good] = transmission_angle_over(lengths[good], Interval(0.0, TURN))
    return np.where(np.isfinite(angles), angles, -1.0)


def place_motor_about_pivot(
    link: LinkMotion,
    torque: Floats,
    time_ratio: float | None,
    radius: float,
    radius_is_fixed: bool,
    box: Box | None,
    reach: float = np.inf,
) -> MotorCycle | str:
    """Return the best motor and rod on a link that turns about a pivot, or a sentence with the reason why there is none.

    The transmission angle depends neither on the pin's radius nor on its direction from the pivot; these are chosen so that the
    motor lies in its box. By default the pin lies on the link's line.

    Parameters
    ----------
    link : LinkMotion
        Motion of the link at n positions.
    torque : ndarray, shape (n,)
        Torque that the linkage's drive must give.
    time_ratio : float or None
        Ratio of forward and return stroke or its reciprocal; None for equal times.
    radius : float
        Distance of the pin from the pivot, or the first one that is tried.
    radius_is_fixed : bool
    box : Box or None
        Region of the motor.
    reach : float
        Largest distance of the pin from the pivot.
    """
    assert link.pivot is not None
    pivot = link.pivot
    turned = np.unwrap(np.angle(link.direction))
    swing = abs(float(turned[-1] - turned[0]))
    if np.min(np.diff(turned) * np.sign(turned[-1] - turned[0])) <= 0:
        return "the link reverses within the motion, so that no motor drives it through"
    ratio = 1.0 if time_ratio is None else max(time_ratio, 1 / time_ratio)
    if ratio - 1 < OPTIONS.equal_time_tolerance:
        ratio = 1.0
    # for equal times any rod works: other rods are tried if the motor has a box
    rods = [OPTIONS.rod, *(OPTIONS.more_rods if ratio == 1.0 and box is not None else ())]
    shapes = [shape for shape in (proportions(swing, ratio, length) for length in rods) if shape is not None]
    if not shapes:
        return f"no crank-rocker swings by {np.rad2deg(swing):.6g} degrees with a time ratio of {ratio:.6g}"
    rising = float(np.sign(turned[-1] - turned[0]))
    radii = [radius] if radius_is_fixed else [radius * factor for factor in OPTIONS.radius_factors]
    radii = radii[:1] + [size for size in radii[1:] if size <= reach]
    bisector = link.direction[0] * np.exp(0.5j * rising * swing)
    for shape in shapes:
        # the shape extends counter-clockwise; its mirror image serves the other direction or the other sense
        offsets = (bisector * shape.motor, bisector * shape.motor.conjugate())
        for size in radii if box is None else [*radii, *_size_in_box(radii, pivot, shape.ground, box)]:
            cycles = []
            for extends, offset in zip((True, False) if rising > 0 else (False, True), offsets):
                pin = complex(size)
                if box is not None:
                    pin *= np.exp(1j * (direction_into_box(pivot, size * shape.ground, box) - np.angle(offset)))
                motor = complex(pivot + pin * offset)
                if box is None or _is_inside(motor, box, pivot):
                    cycles.append(
                        evaluate_motor(link, torque, motor, pin, size * shape.crank, size * shape.rod, extends)
                    )
            good = [cycle for cycle in cycles if cycle is not None]
            if good:
                return min(good, key=lambda cycle: float(np.abs(cycle.motor_torque).max()))
    return "no position of the pin puts the motor into motor_box"


def _size_in_box(radii: list[float], pivot: complex, ground: float, box: Box) -> list[float]:
    """Return a radius of the pin, between the smallest and the largest, for which the motor can lie in its box, if any."""
    nearest = complex(min(max(pivot.real, box[0]), box[2]), min(max(pivot.imag, box[1]), box[3]))
    farthest = max(abs(complex(x, y) - pivot) for x in box[::2] for y in box[1::2])
    low, high = max(abs(nearest - pivot) / ground, min(radii)), min(farthest / ground, max(radii))
    return [(low + high) / 2] if low <= high else []


def _is_inside(motor: complex, box: Box, pivot: complex) -> bool:
    """Check that a motor lies in a box, up to the rounding of its distance from the pivot."""
    return bool(outside(motor, box) <= 1e-12 * abs(motor - pivot))


def direction_into_box(pivot: complex, radius: float, box: Box) -> float:
    """Return a direction in which a circle about a pivot lies in a box: the middle of its longest arc in the box.

    Without such an arc, return the direction of the point of the box that is nearest to the pivot.
    """
    left, bottom, right, top = box
    lines = [(0.0, left - pivot.real), (0.0, right - pivot.real)]
    lines += [(np.pi / 2, bottom - pivot.imag), (np.pi / 2, top - pivot.imag)]
    crossings = [
        normal + sign * np.arctan2(np.sqrt((radius - distance) * (radius + distance)), distance)
        for normal, distance in lines
        if abs(distance) <= radius
        for sign in (1, -1)
    ]
    starts = np.sort(np.mod(crossings or [0.0], TURN))
    widths = np.diff(np.append(starts, starts[0] + TURN))
    middles = starts + widths / 2
    inside = outside(pivot + radius * np.exp(1j * middles), box) <= 0
    if inside.any():
        return float(middles[np.argmax(np.where(inside, widths, -1.0))])
    nearest = complex(min(max(pivot.real, left), right), min(max(pivot.imag, bottom), top))
    return float(np.angle(nearest - pivot))
