"""A linkage that a motor swings through a rod, as one mechanism of six links: poses and rates by the motor's angle, and forces.

The motor's crank a about O and the rod b to the pin Q leave the linkage one freedom, the motor's angle. Over half a turn and the
other the linkage goes through its used interval and back, so at an angle w its own drive stands at the only place phi of the
interval with

    |Q(phi) - K(w)| = b,    K = O + a e^{i (w0 + w)}

which Newton's method finds to rounding, on any link. Rates follow by the chain rule; they vanish at both ends, where crank and
rod are in a line and the linkage stands still for a moment while the motor turns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats, cross, dot
from synthesis.drives.dyad import Driven, driven
from synthesis.drives.links import GROUND, Machine, machine_at
from synthesis.errors import FieldError
from synthesis.fourbar.linkage import Linkage
from synthesis.guided.analysis import Load
from synthesis.guided.linkage import Circle, GuidedLinkage, LinkMotion, Rail
from synthesis.target import TURN, Interval

MOTOR_CRANK, ROD = "motor_crank", "rod"
"""Names of the two further links."""
_TABLE = 721
"""Positions of the way that Newton's method begins between."""
_STEPS, _STILL = 12, 1e-9
"""Steps of Newton's method at most; one of so small a part of the way leads to rounding."""
_BEYOND = 0.02
"""Part of the way by which numbers that were rounded may lead the linkage beyond its ends."""
_ROUNDED = 1e-3
"""Part of crank and rod by which the dead centres may miss the ends of the way."""


class Motor(NamedTuple):
    """A motor at a place of the user's plane, its crank and rod, and the rod's pin in the frame of a link."""

    link: str
    at: complex
    crank: float
    rod: float
    pin: complex


class Joint(NamedTuple):
    """Where two links are joined at n positions; of a slide ``normal``, the direction in which it holds, else None."""

    name: str
    first: str
    second: str
    place: Complexes
    normal: Complexes | None = None


class Held(NamedTuple):
    """What holds a load in equilibrium, (n,) each."""

    torque: Floats
    """Of the motor, counter-clockwise."""
    forces: dict[str, Complexes]
    """In each joint by its name, by the first link on the second."""


@dataclass(frozen=True)
class SixBar:
    """A linkage with a motor, over the way between the two ends of an interval.

    ``poses``: the linkage at places of its drive from the first sample on. ``used``: those where the motor's dead centres are;
    at the first its angles begin, which count counter-clockwise.
    """

    poses: Callable[[Floats], Machine]
    used: Interval
    motor: Motor

    @classmethod
    def of(cls, linkage: Linkage | GuidedLinkage, used: Interval, motor: Motor) -> SixBar:
        """With a four-bar or a body on guides.

        Raises `FieldError`: for a motor that does not swing it from one end of the interval to the other.
        """
        found = cls(lambda at: machine_at(linkage, at), used, motor)
        found.check()
        return found

    def check(self) -> None:
        """FieldError for a motor that does not swing the linkage from one end of its way to the other, and no farther."""
        size = max(self.motor.crank, self.motor.rod)
        turned = np.linspace(0.0, TURN, 181)
        with np.errstate(all="ignore"):
            if self.motor.link in self._coarse.links and self._whole is not None:
                one = self.machine(turned)
                off = one.links[self.motor.link].place(self.motor.pin) - one.links[ROD].origin
                if np.abs(np.abs(off) - self.motor.rod).max() < 1e-9 * size:
                    return
        raise FieldError(
            "/drive",
            "the motor and its rod do not move this linkage over its used interval, from one end to the other",
        )

    # -- where it is --------------------------------------------------------------------------------------------------

    @cached_property
    def _coarse(self) -> Machine:
        """The linkage over its way, closer at both ends, where the motor turns farthest."""
        first, last = self.used
        return self.poses(first + (last - first) * (1 - np.cos(np.linspace(0.0, np.pi, _TABLE))) / 2)

    @cached_property
    def _whole(self) -> Driven | None:
        """Both ways of the motor, there; None where it does not drive the linkage."""
        link, motor = self._coarse.links[self.motor.link], self.motor
        none = np.zeros(_TABLE)
        return driven(link, none, motor.at, motor.pin, motor.crank, motor.rod, self.extends, _ROUNDED)

    @cached_property
    def extends(self) -> bool:
        """Whether motor crank and rod are folded at the first end."""
        length = abs(self._coarse.links[self.motor.link].place(self.motor.pin)[0] - self.motor.at)
        return bool(
            abs(length - (self.motor.rod - self.motor.crank)) < abs(length - (self.motor.rod + self.motor.crank))
        )

    @property
    def pivot(self) -> complex | None:
        """About which the link of the rod turns, if it turns about a fixed one."""
        return self._coarse.links[self.motor.link].pivot

    @cached_property
    def start(self) -> float:
        """Direction of the motor's crank at the first end, against the x axis."""
        towards = self._coarse.links[self.motor.link].place(self.motor.pin)[0] - self.motor.at
        return float(np.angle(-towards if self.extends else towards))

    @cached_property
    def sense(self) -> float:
        """Which way the motor turns for the slower of both ways to be the one forwards; 1 counter-clockwise, so of equal ones."""
        return 1.0 if 2 * self.last - TURN > -1e-9 else -1.0

    @cached_property
    def last(self) -> float:
        """Angle of the motor, 0 to a turn, at the last end."""
        return float(self.turned(np.array([self.used.last]))[0, 0])

    @cached_property
    def _ways(self) -> tuple[Floats, Floats]:
        """Angles of the motor over a turn, rising, and places of the linkage's drive there."""
        assert self._whole is not None
        forwards, backwards = self._whole.motor_angle
        angles = np.concatenate([forwards, backwards[::-1][1:]]) - forwards[0]
        places = np.concatenate([self._coarse.at, self._coarse.at[::-1][1:]])
        if angles[-1] < 0:
            angles, places = angles[::-1] + TURN, places[::-1]
        return angles, places

    @cached_property
    def _room(self) -> tuple[float, float]:
        """Places of the drive between which solutions are looked for: a little beyond both ends, where it closes there."""
        first, last = self.used
        beyond = _BEYOND * (last - first)
        rates = self.poses(np.array([first - beyond, last + beyond])).links[self.motor.link].rate
        ends = (first - beyond if np.isfinite(rates[0]) else first, last + beyond if np.isfinite(rates[1]) else last)
        return min(ends), max(ends)

    def knee(self, turned: Floats) -> Complexes:
        """Where motor crank and rod meet, at angles (n,) of the motor from the first end on."""
        return np.asarray(self.motor.at + self.motor.crank * np.exp(1j * (self.start + np.asarray(turned))))

    def travel(self, turned: Floats) -> Floats:
        """Place of the linkage's drive at angles (n,) of the motor from the first end on.

        Law: the rod keeps its length to rounding; rising on one way of the motor, falling on the other.
        """
        turned = np.asarray(turned, dtype=float)
        angles, places = self._ways
        at = np.interp(turned % TURN, angles, places)
        knee, (low, high) = self.knee(turned), self._room
        with np.errstate(all="ignore"):
            for _ in range(_STEPS):
                link = self.poses(at).links[self.motor.link]
                off = link.place(self.motor.pin) - knee
                length = np.abs(off)
                step = (length - self.motor.rod) * length / dot(off, link.speed(self.motor.pin))
                at = np.clip(at - step, low, high)
                if not np.any(np.abs(step) > _STILL * (high - low)):
                    break
        return np.asarray(at)

    def turned(self, travel: Floats) -> Floats:
        """Angles (2, n) of the motor, 0 to a turn, at places (n,) of the linkage's drive within the way, the lesser first."""
        away = self.poses(np.asarray(travel)).links[self.motor.link].place(self.motor.pin) - self.motor.at
        length, crank, rod = np.abs(away), self.motor.crank, self.motor.rod
        near = np.maximum((rod - (crank - length)) * (rod + (crank - length)), 0.0)
        far = np.maximum((crank + length - rod) * (crank + length + rod), 0.0)
        corner = 2 * np.arctan2(np.sqrt(near), np.sqrt(far))
        both = (np.angle(away) - self.start + np.stack([corner, -corner])) % TURN
        return np.sort(both, axis=0)

    def forwards(self, travel: Floats) -> Floats:
        """The angle of the motor (n,) at which it passes places of the drive on its way forwards, in its sense."""
        both = self.turned(travel)
        found = both[0] if self.sense > 0 else both[1] - TURN
        # the first end lies at 0, whichever way rounding takes it
        return np.where(np.abs(found) > TURN - 1e-6, 0.0, found)

    def dwell(self, share: float) -> tuple[float, float]:
        """How far the motor turns while the linkage is within a share of its way of the first end, and of the last."""
        first, last = self.used
        (one, other), (two, three) = self.turned(
            np.array([first + share * (last - first), last - share * (last - first)])
        ).T
        return float(one + TURN - other), float(three - two)

    # -- how it moves -------------------------------------------------------------------------------------------------

    def machine(self, turned: Floats) -> Machine:
        """All links at angles (n,) of the motor from the first end on, with derivatives by that angle.

        Frames: of the linkage as `machine_at` has them; the motor's crank from O along it, the rod from there to its pin.
        Law: `LinkMotion.velocity`, `rate` and so on are what differences of places tend to.
        """
        turned = np.asarray(turned, dtype=float)
        motor, at = self.motor, self.travel(turned)
        plain = self.poses(at)
        link = plain.links[motor.link]
        knee = self.knee(turned)
        arm = knee - motor.at
        off, speed = link.place(motor.pin) - knee, link.speed(motor.pin)
        along = dot(off, speed)
        rate = dot(off, 1j * arm) / along
        slip = speed * rate - 1j * arm
        change = -(np.abs(slip) ** 2 + dot(off, link.change(motor.pin) * rate**2 + arm)) / along
        gain = speed * change + link.change(motor.pin) * rate**2 + arm
        ones, still = np.ones(turned.size), np.zeros(turned.size, dtype=complex)
        links = {name: _by(one, rate, change) for name, one in plain.links.items()}
        links[MOTOR_CRANK] = LinkMotion(
            MOTOR_CRANK, motor.at + still, self.start + turned, still, ones, still, 0 * ones, motor.at
        )
        square = np.abs(off) ** 2
        links[ROD] = LinkMotion(
            ROD, knee, np.angle(off), 1j * arm, cross(off, slip) / square, -arm, cross(off, gain) / square
        )
        return replace(
            plain,
            at=turned,
            links=links,
            body=None if plain.body is None else _by(plain.body, rate, change),
            drive="motor",
            extent=max(plain.extent, motor.rod),
            reaches=plain.reaches | {MOTOR_CRANK: motor.crank, ROD: motor.rod},
            middles=plain.middles | {MOTOR_CRANK: motor.crank / 2 + 0j, ROD: motor.rod / 2 + 0j},
        )

    def transmission(self, machine: Machine) -> Floats:
        """Angle (n,) between the rod and the normal of its pin's path, of a machine of this motor; 0 is dead."""
        link, rod = self.poses(self.travel(machine.at)).links[self.motor.link], machine.links[ROD].direction
        speed = link.speed(self.motor.pin)
        return np.arctan2(np.abs(dot(rod, speed)), np.abs(cross(rod, speed)))

    # -- what holds it ------------------------------------------------------------------------------------------------

    def held(self, machine: Machine, joints: list[Joint], load: Load) -> Held:
        """The motor's torque and the forces in all joints, from the equilibrium of every link, masses and inertia included.

        ``machine``: of this motor. ``load.speed``: of the motor, constant. Law: the torque is `Machine.torque`, by virtual work.
        """
        names = list(machine.links)
        rows, count = 3 * len(names), machine.at.size
        matrix, right = np.zeros((count, rows, rows)), np.zeros((count, rows))

        def acts(name: str, place: Complexes, force: Complexes, moment: Floats | float, on: Floats) -> None:
            if name != GROUND:
                row = 3 * names.index("coupler" if name == "body" else name)
                about = machine.links[names[row // 3]].origin
                on[:, row] += np.real(force)
                on[:, row + 1] += np.imag(force)
                on[:, row + 2] += (cross(place - about, force) + moment) / machine.extent

        none = np.zeros(count, dtype=complex)
        for k, one in enumerate(joints):
            if one.normal is None:
                pushes = ((none + 1, 0.0), (none + 1j, 0.0))
            else:
                pushes = ((one.normal, 0.0), (none, machine.extent))
            for column, (force, moment) in enumerate(pushes, 2 * k):
                acts(one.second, one.place, force, moment, matrix[:, :, column])
                acts(one.first, one.place, -force, -moment, matrix[:, :, column])
        matrix[:, 3 * names.index(MOTOR_CRANK) + 2, -1] = 1.0
        if machine.body is not None:
            acts("body", machine.body.origin, none + load.force, load.torque, right)
        for mass in load.masses:
            link = machine.link(mass.link)
            pull = mass.mass * (load.gravity - load.metre * load.speed**2 * link.change(mass.at))
            spin = load.metre * mass.inertia * load.speed**2 * link.rate_change
            acts(mass.link, link.place(mass.at), pull, -spin, right)
        found: Floats = np.asarray(np.linalg.solve(matrix, -right[:, :, None])[:, :, 0], dtype=float)
        forces = {}
        for k, one in enumerate(joints):
            first, second = found[:, 2 * k], found[:, 2 * k + 1]
            forces[one.name] = first + 1j * second if one.normal is None else first * one.normal
        return Held(np.asarray(found[:, -1] * machine.extent), forces)


def _by(link: LinkMotion, rate: Floats, change: Floats) -> LinkMotion:
    """A link's motion by another parameter, of which its own one has these derivatives."""
    return replace(
        link,
        velocity=link.velocity * rate,
        rate=link.rate * rate,
        acceleration=link.acceleration * rate**2 + link.velocity * change,
        rate_change=link.rate_change * rate**2 + link.rate * change,
    )


def joints_of(linkage: Linkage | GuidedLinkage, motor: Motor, machine: Machine) -> list[Joint]:
    """The seven joints of a six-bar: A, D, C, B of the linkage, M the motor's shaft, K between crank and rod, Q on the link.

    A slide of a rail is A or B too, and so is the pin of a slot's block; its slide in the body is D or C.
    """
    links = machine.links
    found = []
    if isinstance(linkage, Linkage):
        end = links["rocker"].place(complex(linkage.links[2]))
        found = [
            Joint("A", GROUND, "crank", links["crank"].origin),
            Joint("D", "crank", "coupler", links["coupler"].origin),
            Joint("C", "rocker", "coupler", end),
            Joint("B", GROUND, "rocker", links["rocker"].origin),
        ]
    else:
        body = links["coupler"]
        for place, (guide, fixed, moving) in enumerate(zip(linkage.guides, "AB", "DC")):
            name = linkage.link_names[2 * place]
            pin = body.place(guide[1]) if not isinstance(guide, (Circle, Rail)) else body.place(guide.body_point)
            ground: tuple[Complexes, Complexes | None]
            on_body: tuple[Complexes, Complexes | None]
            if isinstance(guide, Circle):
                ground, on_body = (links[name].origin, None), (pin, None)
            elif isinstance(guide, Rail):
                across = np.full(pin.shape, 1j * np.exp(1j * guide.direction))
                ground, on_body = (pin, across), (pin, None)
            else:
                pin = np.full(pin.shape, guide.pin, dtype=complex)
                across = 1j * body.direction * np.exp(1j * guide.body_direction)
                ground, on_body = (pin, None), (pin, across)
            found += [Joint(fixed, GROUND, name, *ground), Joint(moving, name, "coupler", *on_body)]
    return found + rod_joints(motor, machine)


def rod_joints(motor: Motor, machine: Machine) -> list[Joint]:
    """M, K and Q."""
    links, rod = machine.links, machine.links[ROD]
    return [
        Joint("M", GROUND, MOTOR_CRANK, links[MOTOR_CRANK].origin),
        Joint("K", MOTOR_CRANK, ROD, rod.origin),
        Joint("Q", ROD, motor.link, rod.place(complex(motor.rod))),
    ]
