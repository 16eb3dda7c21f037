"""Search for the motor and rod with the largest minimum transmission angle on a link of any motion.

A coarse grid of motors and pins yields starting points, and descents over all positions end at the optima.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.drives.descent import DescentOptions, Functions, MaxMinProblem
from synthesis.drives.motor import MotorCycle, evaluate_motor, return_angle
from synthesis.drives.placement_search import grid_of, separate
from synthesis.link_motion import LinkMotion
from synthesis.mechanism import Box, outside
from synthesis.work import UNLIMITED, Work


@dataclass(frozen=True)
class PinGrid:
    """Grid of motors and pins from which descents start."""

    motors: int
    """Number of motors in each direction of the box."""
    directions: int
    """Number of directions of the pin on its link."""
    radii: tuple[float, ...]
    """Distances of the pin, as fractions of the reach."""


@dataclass(frozen=True)
class MotorSearchOptions:
    """Options of the search for a motor and a rod on any link."""

    grid: PinGrid = PinGrid(14, 12, (0.4, 0.7, 1.0))
    finer_grid: PinGrid = PinGrid(7, 36, (0.15, 0.3, 0.5, 0.7, 0.85, 1.0))
    """Grid for the case that the first one has no starting point, as with a small box of the motor."""
    positions: int = 19
    """Number of positions of the motion at which the grid is evaluated."""
    arc_points: int = 16
    """Number of motors on each half of a circle of equal time ratio."""
    starts_per_direction: int = 4
    """Number of descents of each direction."""
    spacing: float = 0.3
    """Smallest distance of their starting points, as a fraction of the size."""
    stroke_min: float = 0.1
    """Smallest stroke, twice the motor's crank, as a fraction of the longest displacement of a pin of the link."""
    speed_min: float = 0.5
    """Smallest speed of the pin, as a fraction of the mean speed for this stroke: no rod can move a pin at rest."""
    descent: DescentOptions = field(default_factory=lambda: DescentOptions(tolerance=1e-10, max_steps=40))


OPTIONS = MotorSearchOptions()


def place_motor(
    link: LinkMotion,
    at: Floats,
    torque: Floats,
    time_ratio: float | None,
    reach: float,
    box: Box,
    work: Work = UNLIMITED,
) -> MotorCycle | str:
    """Return the motor and rod with the largest minimum transmission angle, or a sentence with the reason if none is found.

    Parameters
    ----------
    link : LinkMotion
        Motion of the link that carries the pin, at n positions.
    at, torque : ndarray, shape (n,)
        Drive parameter, and torque that the linkage's drive must give.
    time_ratio : float or None
        Required ratio of the strokes; None for any.
    reach : float
        Largest distance of the pin from the origin of its link's frame.
    box : Box
        Region of the motor.
    work : Work, optional
    """
    angle = None if time_ratio is None else return_angle(time_ratio)
    task = _Task(link, at, box, reach, angle)
    few = np.unique(((at.size - 1) * np.sin(np.linspace(0, np.pi / 2, OPTIONS.positions)) ** 2).round().astype(int))
    coarse = replace(task, link=link.at(few), at=at[few])
    starts = coarse.starts(OPTIONS.grid) or replace(coarse, angle=None).starts(OPTIONS.finer_grid)
    if not starts:
        return "no point of the link has a distance from any point of motor_box that grows or shrinks all the way"
    best: MotorCycle | None = None
    for extends, points in starts:
        if best is not None and work.expired():
            break
        cycle = task.descend(points, extends, torque)
        if cycle is not None and (best is None or cycle.transmission_angle_min > best.transmission_angle_min):
            best = cycle
    if best is None:
        condition = "" if time_ratio is None else f" with a time ratio of {time_ratio:g}"
        return f"no motor in motor_box was found whose rod drives the link both ways{condition}"
    return best


@dataclass(frozen=True)
class _Task:
    """Motion of a link with the limits of motor and pin."""

    link: LinkMotion
    at: Floats
    box: Box
    reach: float
    angle: float | None
    """Angle QaOQb for the time ratio; None for any."""

    @property
    def size(self) -> float:
        """Length of the order of the coordinates."""
        left, bottom, right, top = self.box
        return max(right - left, top - bottom, self.reach)

    def problem(self, extends: bool) -> MaxMinProblem:
        """Return the problem of the largest u with ``sine of the transmission angle >= u`` within reach and time ratio.

        With psi the angle from the line OQ to the pin's path and beta the angle at the pin between rod and line, the sines are
        ``cos(psi -+ beta)``; crank and rod follow from ``|OQ|`` at both ends.
        """
        link, reach, size = self.link, self.reach, self.size
        sign = np.sign(self.at[-1] - self.at[0]) * (1.0 if extends else -1.0)
        # a rod on a pin that scarcely moves would have to carry too much
        stroke_min = OPTIONS.stroke_min * link.largest_shift(reach)
        speed_min = max(OPTIONS.speed_min * stroke_min / abs(float(self.at[-1] - self.at[0])), 1e-300)

        def evaluate(points: Complexes) -> Functions:
            motor, pin = points[:, :1], points[:, 1:]
            v, velocity = link.position(pin) - motor, link.speed(pin)
            length = np.abs(v)
            psi = np.conj(v) * velocity
            psi *= sign / np.maximum(np.abs(psi), 1e-300)
            short, long = (length[:, [k]] for k in ((0, -1) if extends else (-1, 0)))
            # the angle at the pin, from the sides of the triangle: 0 at both ends
            twice = length * (short + long)
            along = psi.real * np.minimum((length**2 + short * long) / twice, 1.0)
            sides = (length - short) * (length + short) * (long - length) * (long + length)
            across = psi.imag * np.sqrt(np.maximum(sides, 0.0)) / twice
            limits = (
                np.abs(velocity).min(axis=1, keepdims=True) / speed_min - 1,
                (1 - np.abs(pin) / reach) * (1 + np.abs(pin) / reach),
                (long - short - stroke_min) / size,
            )
            equal = np.abs(np.angle(v[:, -1:] * np.conj(v[:, :1]))) - (self.angle or 0.0)
            levels = np.hstack([along + across, (along - across)[:, 1:-1]])
            return Functions(levels, np.hstack(limits), equal[:, : self.angle is not None])

        left, bottom, right, top = (coordinate / size for coordinate in self.box)
        room = reach / size
        return MaxMinProblem(evaluate, size, [(left, right), (bottom, top), (-room, room), (-room, room)])

    def starts(self, grid: PinGrid) -> list[tuple[bool, Complexes]]:
        """Return motors and pins of a grid that drive the link, the best of each direction that lie apart from each other."""
        directions = np.exp(2j * np.pi * np.arange(grid.directions) / grid.directions)
        pins = np.concatenate([[0j], *(self.reach * radius * directions for radius in grid.radii)])
        if self.angle is None:
            points = np.stack([part.ravel() for part in np.meshgrid(grid_of(self.box, grid.motors), pins)], axis=1)
        else:
            points = self._timed(pins, self.angle)
        found = []
        for extends in (True, False):
            levels, limits, _ = self.problem(extends).evaluate(points)
            arms = self.link.leverage(points[:, :1], points[:, 1:])[1] * (self.at[-1] - self.at[0])
            grows = ((arms if extends else -arms) > 0).all(axis=1)
            value = np.where(grows & (limits[:, -1] >= 0), levels.min(axis=1), -np.inf)
            room, count = OPTIONS.spacing * self.size, OPTIONS.starts_per_direction
            found += [(extends, points[k]) for k in separate(value, points, room, count)]
        return found

    def _timed(self, pins: Complexes, angle: float) -> Complexes:
        """Return motors in their box that see both ends of a pin's path under an angle, each with its pin, (m, 2)."""
        first, last = (self.link.position(pins[:, None])[:, [k]] for k in (0, -1))
        # a circle through both ends, for a chord from -1 to 1; its points are denser near the ends
        angle = max(angle, 1e-6)
        around = (np.pi - angle) * (1 - np.geomspace(0.05 * np.sin(angle), 1, OPTIONS.arc_points))
        arc = 1j * (1 / np.tan(angle) + np.exp(1j * np.concatenate([around, -around])) / np.sin(angle))
        motors = (first + last) / 2 + (last - first) / 2 * np.concatenate([arc, arc.conj()])
        points = np.stack(np.broadcast_arrays(motors, pins[:, None]), axis=-1)
        return np.asarray(points[outside(motors, self.box) <= 0])

    def descend(self, start: Complexes, extends: bool, torque: Floats) -> MotorCycle | None:
        """Return the end of a descent, exactly in the reach and on the time ratio; None if it does not drive the link."""
        problem = self.problem(extends)
        motor, pin = problem.solve(start, OPTIONS.descent)
        points = np.array([motor, pin * min(1.0, self.reach / max(abs(pin), 1e-300))])
        if np.abs(problem.evaluate(points[None]).equalities).max(initial=0.0) > 1e-3:
            return None
        if self.angle is not None:
            points = problem.restored(points, 1)
        motor, pin = points.tolist()
        first, last = np.abs(self.link.position(pin)[[0, -1]] - motor).tolist()
        crank, rod = abs(last - first) / 2, (first + last) / 2
        return evaluate_motor(self.link, torque, motor, pin, crank, rod, extends)
