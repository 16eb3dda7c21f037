"""A linkage with a motor, its crank and a rod as one mechanism of six links: poses by the motor's angle.

The motor's crank a about O and the rod b to the pin Q leave the linkage one degree of freedom, the motor's angle. In the two
strokes of a turn the linkage passes through its used interval and back, so at an angle w the linkage's own drive has the only
coordinate phi of the interval with

    |Q(phi) - K(w)| = b,    K = O + a e^{i (w0 + w)}

which Newton's method finds to rounding, on any link. At both ends crank and rod are collinear, and the linkage rests for a
moment while the motor turns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats, dot
from synthesis.drives.links import GROUND, LinkMotions, motions_at
from synthesis.drives.motor import MotorCycle, evaluate_motor
from synthesis.errors import FieldError
from synthesis.linkage import Linkage
from synthesis.target import TURN, Interval
from synthesis.triangle import angle_at

MOTOR_CRANK, ROD = "motor_crank", "rod"
"""Names of the two links that the motor adds."""


@dataclass(frozen=True)
class SixBarOptions:
    """Numerical options of a six-bar."""

    table: int = 721
    """Number of positions of the motion between which Newton's method starts."""
    newton_steps: int = 12
    """Largest number of steps of Newton's method."""
    newton_tolerance: float = 1e-9
    """Step at which Newton's method ends, as a fraction of the motion; its error is then of the order of rounding."""
    overtravel: float = 0.02
    """Fraction of the motion by which dimensions that were rounded may move the linkage beyond its ends."""
    dead_centre_tolerance: float = 1e-3
    """Allowed distance of the dead centres from the ends of the motion, as a fraction of crank and rod."""


OPTIONS = SixBarOptions()


class Motor(NamedTuple):
    """A motor in the user's plane with its crank and rod, and the rod's pin in the frame of a link."""

    link: str
    at: complex
    crank: float
    rod: float
    pin: complex


class Joint(NamedTuple):
    """A joint of two links at the first sample."""

    name: str
    links: tuple[str, str]
    position: complex


@dataclass(frozen=True)
class SixBar:
    """A linkage with a motor, over the motion between both ends of an interval."""

    poses: Callable[[Floats], LinkMotions]
    """Return the linkage at coordinates of its drive, counted from the first sample."""
    used: Interval
    """Coordinates at the dead centres of the motor, whose angles count counter-clockwise from the first."""
    motor: Motor

    @classmethod
    def of(cls, linkage: Linkage, used: Interval, motor: Motor) -> SixBar:
        """Return the six-bar of a linkage.

        Parameters
        ----------
        linkage : Linkage
            A four-bar or a body on guides.
        used : Interval
            Coordinates of the linkage's drive at the ends of the motion.
        motor : Motor

        Raises
        ------
        FieldError
            If the motor does not swing the linkage from one end of the interval to the other.
        """
        found = cls(lambda at: motions_at(linkage, at), used, motor)
        found.check()
        return found

    def check(self) -> None:
        """Raise `FieldError` unless the motor swings the linkage from one end of its motion to the other, and no farther."""
        size = max(self.motor.crank, self.motor.rod)
        turned = np.linspace(0.0, TURN, 181)
        with np.errstate(all="ignore"):
            if self.motor.link in self._coarse.links and self._cycle is not None:
                if np.abs(np.abs(self.rod(turned)) - self.motor.rod).max() < 1e-9 * size:
                    return
        raise FieldError(
            "/drive",
            "the motor and its rod do not move this linkage over its used interval, from one end to the other",
        )

    # -- positions ----------------------------------------------------------------------------------------------------

    @cached_property
    def _coarse(self) -> LinkMotions:
        """The linkage over its motion, with more positions at both ends, where the motor turns farthest."""
        first, last = self.used
        return self.poses(first + (last - first) * (1 - np.cos(np.linspace(0.0, np.pi, OPTIONS.table))) / 2)

    @cached_property
    def _cycle(self) -> MotorCycle | None:
        """Both strokes of the motor at the coarse positions; None if it does not drive the linkage."""
        link, motor = self._coarse.links[self.motor.link], self.motor
        unloaded, tolerance = np.zeros(OPTIONS.table), OPTIONS.dead_centre_tolerance
        return evaluate_motor(link, unloaded, motor.at, motor.pin, motor.crank, motor.rod, self.extends, tolerance)

    @cached_property
    def extends(self) -> bool:
        """True if motor crank and rod are folded at the first end."""
        length = abs(self._coarse.links[self.motor.link].position(self.motor.pin)[0] - self.motor.at)
        return bool(
            abs(length - (self.motor.rod - self.motor.crank)) < abs(length - (self.motor.rod + self.motor.crank))
        )

    @property
    def pivot(self) -> complex | None:
        """Fixed pivot of the link that carries the rod's pin; None if it has none."""
        return self._coarse.links[self.motor.link].pivot

    @cached_property
    def start(self) -> float:
        """Direction of the motor's crank at the first end, from the x axis, in radians."""
        towards = self._coarse.links[self.motor.link].position(self.motor.pin)[0] - self.motor.at
        return float(np.angle(-towards if self.extends else towards))

    @cached_property
    def sense(self) -> float:
        """Direction of the motor: 1 (counter-clockwise) or -1, such that the slower stroke is the forward stroke."""
        return 1.0 if 2 * self.last - TURN > -1e-9 else -1.0

    @cached_property
    def last(self) -> float:
        """Angle of the motor at the last end, from 0 to a turn."""
        return float(self.turned(np.array([self.used.last]))[0, 0])

    @cached_property
    def _table(self) -> tuple[Floats, Floats]:
        """Increasing angles of the motor over a turn, and the coordinates of the linkage's drive there."""
        assert self._cycle is not None
        forwards, backwards = self._cycle.motor_angle
        angles = np.concatenate([forwards, backwards[::-1][1:]]) - forwards[0]
        travels = np.concatenate([self._coarse.at, self._coarse.at[::-1][1:]])
        if angles[-1] < 0:
            angles, travels = angles[::-1] + TURN, travels[::-1]
        return angles, travels

    @cached_property
    def _room(self) -> tuple[float, float]:
        """Interval of the drive in which solutions are sought: slightly beyond both ends, if the linkage closes there."""
        first, last = self.used
        beyond = OPTIONS.overtravel * (last - first)
        rates = self.poses(np.array([first - beyond, last + beyond])).links[self.motor.link].rate
        ends = (first - beyond if np.isfinite(rates[0]) else first, last + beyond if np.isfinite(rates[1]) else last)
        return min(ends), max(ends)

    @property
    def turn(self) -> tuple[float, float]:
        """Rotation of the motor in the forward and in the return stroke, counter-clockwise positive."""
        forwards = self.last if self.sense > 0 else self.last - TURN
        return forwards, self.sense * TURN - forwards

    @property
    def kind(self) -> str:
        """Kind of the six-bar: `watt_2` if the rod moves a link with a fixed pivot, otherwise `stephenson_3`."""
        return "stephenson_3" if self.pivot is None else "watt_2"

    def knee(self, turned: Floats) -> Complexes:
        """Return the joint of motor crank and rod at angles (n,) of the motor from the first end."""
        return np.asarray(self.motor.at + self.motor.crank * np.exp(1j * (self.start + np.asarray(turned))))

    def travel(self, turned: Floats) -> Floats:
        """Return the coordinate of the linkage's drive at angles (n,) of the motor from the first end.

        The rod has its length up to rounding. The coordinate rises in one stroke of the motor and falls in the other.
        """
        turned = np.asarray(turned, dtype=float)
        angles, travels = self._table
        at = np.interp(turned % TURN, angles, travels)
        knee, (low, high) = self.knee(turned), self._room
        with np.errstate(all="ignore"):
            for _ in range(OPTIONS.newton_steps):
                link = self.poses(at).links[self.motor.link]
                off = link.position(self.motor.pin) - knee
                length = np.abs(off)
                step = (length - self.motor.rod) * length / dot(off, link.speed(self.motor.pin))
                at = np.clip(at - step, low, high)
                if not np.any(np.abs(step) > OPTIONS.newton_tolerance * (high - low)):
                    break
        return np.asarray(at)

    def turned(self, travel: Floats) -> Floats:
        """Return both angles (2, n) of the motor, from 0 to a turn, at coordinates (n,) of the linkage's drive, sorted."""
        away = self.poses(np.asarray(travel)).links[self.motor.link].position(self.motor.pin) - self.motor.at
        corner = angle_at(self.motor.crank, self.motor.rod, np.abs(away))
        both = (np.angle(away) - self.start + np.stack([corner, -corner])) % TURN
        return np.sort(both, axis=0)

    def forwards(self, travel: Floats) -> Floats:
        """Return the angles (n,) of the motor, in its sense, at coordinates of the drive in the forward stroke."""
        both = self.turned(travel)
        found = both[0] if self.sense > 0 else both[1] - TURN
        # the first end has the angle 0, although rounding may give a whole turn
        return np.where(np.abs(found) > TURN - 1e-6, 0.0, found)

    def dwell(self, fraction: float) -> tuple[float, float]:
        """Return the rotation of the motor while the linkage is within a fraction of its motion from each end."""
        first, last = self.used
        near_ends = np.array([first + fraction * (last - first), last - fraction * (last - first)])
        (leave_first, return_first), (reach_last, leave_last) = self.turned(near_ends).T
        return float(leave_first + TURN - return_first), float(leave_last - reach_last)

    # -- motion -------------------------------------------------------------------------------------------------------

    def machine(self, turned: Floats) -> LinkMotions:
        """Return the linkage at angles (n,) of the motor from the first end, with derivatives by its own drive."""
        return self.poses(self.travel(np.asarray(turned)))

    def rod(self, turned: Floats) -> Complexes:
        """Return the vector (n,) along the rod, from the motor's crank to the pin on the link."""
        return self.machine(turned).links[self.motor.link].position(self.motor.pin) - self.knee(turned)

    def joints(self, linkage: Linkage | None) -> list[Joint]:
        """Return the joints of all six links at the first sample, in the forward stroke.

        They are A, D, C and B of the linkage, M, the motor's shaft, K of its crank and the rod, and Q of rod and link. The
        slide of a rail and the pin of a slot's block are A or B too; the slide of a slot in the body is D or C. A link on a
        hinge has only B.

        Parameters
        ----------
        linkage : Linkage or None
            None for a link on a hinge.
        """
        turned, motor = self.forwards(np.zeros(1)), self.motor
        links = self.machine(turned).links
        joints = []
        if linkage is None:
            joints.append(("B", (GROUND, motor.link), links[motor.link].origin))
        else:
            body = links["coupler"]
            for (name, guide), fixed, moving in zip(linkage.by_coupler.named_guides, "AB", "DC"):
                pin = guide.contact(body.origin, body.direction)
                ground = fixed, (GROUND, name), pin if guide.slides else links[name].origin
                joints += [ground, (moving, (name, "coupler"), pin)]
            if linkage.is_four_bar:  # in the order of the loop
                joints[2:] = joints[:1:-1]
        joints.append(("M", (GROUND, MOTOR_CRANK), np.array([motor.at])))
        joints.append(("K", (MOTOR_CRANK, ROD), self.knee(turned)))
        joints.append(("Q", (ROD, motor.link), links[motor.link].position(motor.pin)))
        return [Joint(name, pair, complex(position[0])) for name, pair, position in joints]
