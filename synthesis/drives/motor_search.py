"""Search for the motor and rod with the largest minimum transmission angle on a link of any motion.

A coarse grid of motors and pins yields starting points. Short descents over a few positions find the promising basins; long
descents over all positions finish the best of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.drives.max_min import MaxMinProblem
from synthesis.drives.motor import MotorCycle, evaluate_motor, return_angle
from synthesis.drives.placement_search import PlacementSearch
from synthesis.drives.placements import PlacementLimits
from synthesis.link_motion import LinkMotion
from synthesis.mechanism import Box, outside
from synthesis.work import Work


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
    rods: tuple[float, float, int] = (0.2, 50.0, 16)
    """Shortest and longest rod for a given time ratio, divided by half the chord of the pin's path, and their number."""
    starts_per_direction: int = 4
    """Number of short descents of each direction."""
    spacing: float = 0.3
    """Smallest distance of their starting points, as a fraction of the size."""
    duplicate_distance: float = 0.01
    """Distance below which two end points are the same, as a fraction of the size."""
    stroke_min: float = 0.1
    """Smallest stroke, twice the motor's crank, as a fraction of the longest displacement of a pin of the link."""
    speed_min: float = 0.5
    """Smallest speed of the pin, as a fraction of the mean speed for this stroke: no rod can move a pin at rest."""
    short_steps: int = 8
    """Number of steps of a short descent."""
    long_descents: int = 3
    """Number of long descents."""
    long_steps: int = 40
    """Number of steps of a long descent."""
    tolerance: float = 1e-10
    """Change of u at which a descent ends."""


OPTIONS = MotorSearchOptions()
_MOTORS, _PINS = np.array([1, 1j, 0, 0]), np.array([0, 0, 1, 1j])
"""Derivatives of motor and pin by the unknowns."""


def place_motor(
    link: LinkMotion,
    at: Floats,
    torque: Floats,
    time_ratio: float | None,
    reach: float,
    box: Box,
    work: Work | None = None,
    options: MotorSearchOptions = OPTIONS,
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
    options : MotorSearchOptions
    """
    angle = None if time_ratio is None else return_angle(time_ratio)
    limits = PlacementLimits(box, reach, 0.0)
    task = PlacementSearch(link, at, np.zeros(at.size), limits, options.grid.motors)
    few = np.unique(((at.size - 1) * np.sin(np.linspace(0, np.pi / 2, options.positions)) ** 2).round().astype(int))
    coarse = PlacementSearch(link.at(few), at[few], np.zeros(few.size), limits, options.grid.motors)
    starts = _grid_starts(coarse, angle, options.grid, options)
    if not starts:
        finer = PlacementSearch(coarse.link, coarse.at, coarse.torque, limits, options.finer_grid.motors)
        starts = _grid_starts(finer, None, options.finer_grid, options)  # the descents satisfy the time ratio
    if not starts:
        return "no point of the link has a distance from any point of motor_box that grows or shrinks all the way"
    ends: list[tuple[float, _Start]] = []
    for start in starts:
        if work is not None and work.expired() and ends:
            break
        end = _improve(coarse, start, angle, options.short_steps, options)
        ends.append((_TransmissionProblem(task, end.extends, angle, options).merit(end), end))
    ends.sort(key=lambda row: -row[0])
    best: MotorCycle | None = None
    seen: list[_Start] = []
    for _, start in ends:
        if best is not None and (len(seen) >= options.long_descents or (work is not None and work.expired())):
            break
        if any(earlier.is_near(start, options.duplicate_distance * task.size) for earlier in seen):
            continue
        seen.append(start)
        end = _improve(task, start, angle, options.long_steps, options)
        cycle = _finish(task, torque, end, angle, options)
        if cycle is not None and (best is None or cycle.transmission_angle_min > best.transmission_angle_min):
            best = cycle
    if best is None:
        condition = "" if time_ratio is None else f" with a time ratio of {time_ratio:g}"
        return f"no motor in motor_box was found whose rod drives the link both ways{condition}"
    return best


class _Start(NamedTuple):
    """Starting point of a descent: motor, pin, and the sign of the change of their distance."""

    motor: complex
    pin: complex
    extends: bool

    def is_near(self, start: _Start, length: float) -> bool:
        """Check whether two points probably belong to the same basin."""
        distance = abs(self.motor - start.motor) + abs(self.pin - start.pin)
        return self.extends == start.extends and distance < length


def _stroke_min(task: PlacementSearch, options: MotorSearchOptions) -> float:
    """Return the smallest stroke: a rod on a pin that scarcely moves would have to carry too much."""
    link = task.link
    turned = abs(link.direction[-1] - link.direction[0])
    return float(options.stroke_min * (abs(link.origin[-1] - link.origin[0]) + task.limits.reach * turned))


# -- starting points ----------------------------------------------------------------------------------------------------


def _grid_starts(
    task: PlacementSearch, angle: float | None, grid: PinGrid = OPTIONS.grid, options: MotorSearchOptions = OPTIONS
) -> list[_Start]:
    """Return motors and pins of a grid that drive the link, the best of each direction that lie apart from each other."""
    link, reach = task.link, task.limits.reach
    directions = np.exp(2j * np.pi * np.arange(grid.directions) / grid.directions)
    points = np.concatenate([[0j], *(reach * radius * directions for radius in grid.radii)])
    if angle is None:
        motors, pins = (points.ravel() for points in np.meshgrid(task.grounds, points))
    else:
        motors, pins = _timed_motors(task, points, angle, options)
    arms = task.arms(motors, pins) * task.sense
    first, last = (np.abs(link.origin[k] + link.direction[k] * pins - motors) for k in (0, -1))
    long_enough = np.abs(last - first) >= _stroke_min(task, options)
    found: list[_Start] = []
    for extends in (True, False):
        good = np.flatnonzero(long_enough & ((arms if extends else -arms).min(axis=1) > 0))
        if not good.size:
            continue
        o, q = motors[good], pins[good]
        merit = _sines(link, o, q, extends, task.sense).min(axis=(0, 2))
        for _ in range(options.starts_per_direction):
            k = int(np.argmax(merit))
            if merit[k] == -np.inf:
                break
            found.append(_Start(complex(o[k]), complex(q[k]), extends))
            distance = np.abs(o - found[-1].motor) + np.abs(q - found[-1].pin)
            merit[distance < options.spacing * task.size] = -np.inf
    return found


def _timed_motors(
    task: PlacementSearch, pins: Complexes, angle: float, options: MotorSearchOptions
) -> tuple[Complexes, Complexes]:
    """Return motors in their box that see the ends of a pin's path under an angle, with the pins, for several rods."""
    first, last = (task.link.origin[k] + task.link.direction[k] * pins for k in (0, -1))
    half, middle = (last - first)[:, None] / 2, (first + last)[:, None] / 2
    size = np.abs(half)
    # crank and rod over half the chord are points of the ellipse (a cos(e/2))^2 + (b sin(e/2))^2 = 1
    shortest, longest, count = options.rods
    rods = np.geomspace(shortest, min(longest, 0.999 / np.sin(angle / 2)), count)
    cranks = np.sqrt(1 - (rods * np.sin(angle / 2)) ** 2) / np.cos(angle / 2)
    # coordinates from the middle of the chord, by the two distances b - a and b + a from its ends
    along = cranks * rods
    beside = np.sqrt(np.maximum((rods - cranks) ** 2 - (along - 1) ** 2, 0.0))
    motors, owners = [], []
    for direction in (1, -1):
        for side in (1, -1):
            points = middle + half * (direction * along + 1j * side * beside)
            inside = (outside(points, task.limits.box) <= 0) & (rods > cranks) & (size > 0)
            motors.append(points[inside])
            owners.append(np.broadcast_to(pins[:, None], points.shape)[inside])
    return np.concatenate(motors), np.concatenate(owners)


def _sines(link: LinkMotion, motors: Complexes, pins: Complexes, extends: bool, sense: float) -> Floats:
    """Return the sines of the transmission angles, (2, m, n), negative if the rod works against the motion."""
    turned = link.direction * pins[:, None]
    v = link.origin + turned - motors[:, None]
    length = np.abs(v)
    first, last = length[:, :1], length[:, -1:]
    cosine = np.minimum((length**2 + first * last) / (length * (first + last)), 1.0)
    part = np.conj(v) * (link.velocity + 1j * link.rate * turned)
    part *= (sense if extends else -sense) / np.maximum(np.abs(part), 1e-300)
    along, across = part.real * cosine, part.imag * np.sqrt(1 - cosine**2)
    return np.stack([along + across, along - across])


# -- descents -----------------------------------------------------------------------------------------------------------


def _improve(
    task: PlacementSearch, start: _Start, angle: float | None, steps: int, options: MotorSearchOptions = OPTIONS
) -> _Start:
    """Return the end point of a descent with some steps."""
    problem = _TransmissionProblem(task, start.extends, angle, options)
    z = problem.solve(problem.start(start), angle is not None, options.tolerance, steps)
    return _Start(*problem.points(z), start.extends)


def _finish(
    task: PlacementSearch, torque: Floats, start: _Start, angle: float | None, options: MotorSearchOptions = OPTIONS
) -> MotorCycle | None:
    """Move the end point of a descent exactly into the reach and onto the time ratio; None if it does not drive the link."""
    problem = _TransmissionProblem(task, start.extends, angle, options)
    if abs(start.pin) > problem.reach:
        start = start._replace(pin=start.pin * problem.reach / abs(start.pin))
    z = problem.start(start)
    for _ in range(4 if angle is not None else 0):  # by the smallest step of the motor
        difference, slope = problem.equalities(z)[0], problem.equality_jacobian(z)[0, :2]
        if abs(difference) > 1e-3:
            return None
        z[:2] -= difference * slope / np.dot(slope, slope)
    motor, pin = problem.points(z)
    first, last = np.abs(task.link.position(pin)[[0, -1]] - motor).tolist()
    crank, rod = abs(last - first) / 2, (first + last) / 2
    return evaluate_motor(task.link, torque, motor, pin, crank, rod, start.extends)


class _TransmissionProblem(MaxMinProblem):
    """Problem of the largest u with ``sine of the transmission angle >= u`` within reach and time ratio.

    The unknowns are the motor O, the pin q and u. With psi the angle from the line OQ to the pin's path and beta the angle at
    the pin between rod and line, the sines are ``cos(psi -+ beta)``; crank and rod follow from ``|OQ|`` at both ends.
    """

    def __init__(
        self, task: PlacementSearch, extends: bool, angle: float | None, options: MotorSearchOptions = OPTIONS
    ) -> None:
        self.link, self.extends, self.angle = task.link, extends, angle
        self.size, self.reach = task.size, task.limits.reach
        self.sign, self.stroke = task.sense * (1.0 if extends else -1.0), _stroke_min(task, options)
        span = abs(float(task.at[-1] - task.at[0]))
        self.speed = max(options.speed_min * self.stroke / span, 1e-300)
        box = [coordinate / self.size for coordinate in task.limits.box]
        room = self.reach / self.size
        self.bounds = [(box[0], box[2]), (box[1], box[3]), (-room, room), (-room, room), (-1.0, 1.0)]

    def constraints(self, z: Floats) -> Floats:
        """Return the sines less u, (2 n - 2,), then the excesses of the pin's speed, of the reach and of the stroke."""
        found = self._at(z).rows[:-1].copy()
        found[:-3] -= z[4]
        return found

    def constraint_jacobian(self, z: Floats) -> Floats:
        """Return the derivatives of `constraints` by the unknowns."""
        found = self._at(z).derivatives[:-1]
        return np.column_stack([found, np.append(np.full(found.shape[0] - 3, -1.0), np.zeros(3))])

    def equalities(self, z: Floats) -> Floats:
        """Return the difference of the angle QaOQb from the angle for the time ratio."""
        return self._at(z).rows[-1:]

    def equality_jacobian(self, z: Floats) -> Floats:
        """Return the derivatives of `equalities` by the unknowns."""
        return np.append(self._at(z).derivatives[-1], 0.0)[None]

    def start(self, start: _Start) -> Floats:
        """Return the unknowns at a starting point, with u the smallest sine there."""
        z = self.unknowns(start.motor, start.pin)
        z[4] = self._at(z).rows[:-4].min()
        return z

    def merit(self, start: _Start) -> float:
        """Return the smallest sine at a point less the violation of the time ratio."""
        z = self.start(start)
        return float(z[4] - (0.0 if self.angle is None else abs(self.equalities(z)[0])))

    def _evaluate(self, motor: complex, pin: complex) -> _Angles:
        v, velocity = self.link.position(pin) - motor, self.link.speed(pin)
        length = np.abs(v)
        part = np.conj(v) * velocity
        part *= self.sign / np.maximum(np.abs(part), 1e-300)
        short, long = (length[0], length[-1]) if self.extends else (length[-1], length[0])
        middle = length[1:-1]
        # the angle at the pin, from the sides of the triangle: 0 at both ends
        twice = middle * (short + long)
        cosine = np.minimum((middle**2 + short * long) / twice, 1.0)
        sine = (
            np.sqrt(np.maximum((middle - short) * (middle + short) * (long - middle) * (long + middle), 0.0)) / twice
        )
        rows = np.empty(2 * length.size + 2)
        along, across = part[1:-1].real * cosine, part[1:-1].imag * sine
        n = middle.size
        rows[:n], rows[n : 2 * n], rows[2 * n : -4] = along + across, along - across, part[[0, -1]].real
        rows[-4] = float(np.abs(velocity).min()) / self.speed - 1
        rows[-3] = (1 - abs(pin) / self.reach) * (1 + abs(pin) / self.reach)
        rows[-2] = (long - short - self.stroke) / self.size
        turned = float(np.angle(v[-1] * np.conj(v[0])))
        rows[-1] = abs(turned) - (self.angle or 0.0)
        return _Angles(self, rows, pin, v, velocity, part, cosine, sine, turned)

    def derivatives_of(self, angles: _Angles) -> Floats:
        """Return the derivatives of the rows by the coordinates of both points."""
        link, v, part = self.link, angles.v, angles.part
        along = link.direction[:, None]
        dv = along * _PINS - _MOTORS
        by_line = dv / v[:, None]
        psi = (1j * link.rate[:, None] * along * _PINS / angles.velocity[:, None]).imag - by_line.imag
        length = np.abs(v)[:, None]
        longer = by_line.real * length
        (short, d_short), (long, d_long) = ((length[k], longer[k]) for k in ((0, -1) if self.extends else (-1, 0)))
        middle, total = length[1:-1], short + long
        # derivatives of the cosine (L^2 + s l) / (L (s + l)) by L, s and l
        cosines = (middle**2 - short * long) / (middle**2 * total) * longer[1:-1]
        cosines += (long - middle) * (long + middle) / (middle * total**2) * d_short
        cosines += (short - middle) * (short + middle) / (middle * total**2) * d_long
        beta = -cosines / np.maximum(angles.sine, 1e-12)[:, None]
        across, alongside = part[1:-1].imag * angles.cosine, part[1:-1].real * angles.sine
        slopes = np.zeros((angles.rows.size, 4))
        n = angles.sine.size
        slopes[:n] = (alongside - across)[:, None] * (psi[1:-1] - beta)
        slopes[n : 2 * n] = -(alongside + across)[:, None] * (psi[1:-1] + beta)
        slopes[2 * n : -4] = -part[[0, -1]].imag[:, None] * psi[[0, -1]]
        k = int(np.argmin(np.abs(angles.velocity)))
        turned = 1j * link.rate[k] * link.direction[k] * _PINS
        slopes[-4] = np.real(np.conj(angles.velocity[k]) * turned) / abs(angles.velocity[k]) / self.speed
        slopes[-3] = -2 * np.real(np.conj(angles.pin) * _PINS) / self.reach**2
        slopes[-2] = (d_long - d_short) / self.size
        slopes[-1] = np.sign(angles.turned) * (by_line[-1] - by_line[0]).imag
        return slopes * self.size


@dataclass(frozen=True)
class _Angles:
    """Angles psi and beta of a motor and a pin, with the rows of the problem that they determine."""

    problem: _TransmissionProblem
    rows: Floats
    pin: complex
    v: Complexes
    """Vector from the motor to the pin."""
    velocity: Complexes
    """Derivative of the pin's position."""
    part: Complexes
    """Unit vector with the cosine of psi as its real and the sine as its imaginary part."""
    cosine: Floats
    """Cosine of beta between the ends."""
    sine: Floats
    turned: float
    """Angle QaOQb, with its sign."""

    @cached_property
    def derivatives(self) -> Floats:
        """Derivatives of the rows by the coordinates of both points."""
        return self.problem.derivatives_of(self)
