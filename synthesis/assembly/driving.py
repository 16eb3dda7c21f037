"""A motor that turns on, and its rod, as two more plates on a four-bar: all of it then moves over a turn of the motor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Floats
from synthesis.assembly.machine import Hole, Machine, Pin, Plate, Sizes, four_bar
from synthesis.assembly.movement import GROUND, Bodies, Crank, Dyad, Movement, Place, Step
from synthesis.assembly.shapes import Shape, hull
from synthesis.errors import FieldError
from synthesis.fourbar.files import plate_sizes
from synthesis.fourbar.linkage import Linkage
from synthesis.target import TURN, Interval

LINKS = ("crank", "rocker")
"""Links that a motor's rod may move: those that turn about a fixed pivot."""
_NEAR = 1e-3
"""Part of the lengths, and radians, by which what a motor does may differ from what the linkage needs."""


class Motor(NamedTuple):
    """A motor at a place of the user's plane, its crank and rod, and the rod's pin in the frame of a link."""

    link: str
    at: complex
    crank: float
    rod: float
    pin: complex


@dataclass(frozen=True)
class Fixed:
    """A frame that is fixed to a body: its origin a point of it, its x axis turned by an angle."""

    body: int
    to: Place
    turn: float

    def place(self, bodies: Bodies, travel: Floats, half: Floats) -> None:
        """It turns as the body does."""
        bodies.origin[self.body] = bodies.point(self.to)
        bodies.direction[self.body] = bodies.direction[self.to.body] * np.exp(1j * self.turn)
        bodies.shift[self.body] = bodies.spread(self.to)
        bodies.turn[self.body] = bodies.turn[self.to.body]


def motor_driven(
    linkage: Linkage, used: Interval, motor: Motor, sizes: Sizes, body: Sequence[complex] = (), bar: bool = False
) -> Machine:
    """A four-bar that a motor moves from one end of an interval to the other and back; the drive's travel is the motor's turn.

    Further plates: motor_crank and rod; further pins: M, the motor's shaft, K between both, Q on the link.

    Raises `FieldError`: for a motor that does not move the linkage over the interval.
    """
    hole, width = plate_sizes((*linkage.links, motor.crank, motor.rod), sizes.hole, sizes.width)
    plain = four_bar(linkage, used, Sizes(hole, width, sizes.clearance), body, bar)
    at = motor.at - plain.origin
    pivot = 0j if motor.link == "crank" else linkage.pivot_b - linkage.pivot_a
    link = plain.movement.names.index(motor.link)
    end = complex(plain.movement.bodies(np.zeros(1)).point(Place(link, motor.pin))[0])
    length = abs(end - at)
    # at an end of the swing rod and crank lie on a line
    inward = abs(length - (motor.rod - motor.crank)) < abs(length - (motor.rod + motor.crank))
    towards = (end - at) / length * (-1 if inward else 1)
    knee = at + motor.crank * towards
    side = 1 if np.imag(np.conj(pivot - knee) * (end - knee)) > 0 else -1
    names = [*plain.movement.names, "motor_crank", "rod", "lever"]
    cranked, rod, lever = len(names) - 3, len(names) - 2, len(names) - 1
    steps: list[Step] = [
        Crank(cranked, Place(GROUND, at), float(np.angle(towards))),
        Dyad(
            rod,
            lever,
            Place(cranked, complex(motor.crank)),
            Place(GROUND, pivot),
            motor.rod,
            abs(motor.pin),
            side,
        ),
        Fixed(link, Place(lever, 0j), -float(np.angle(motor.pin))),
    ]
    crank, coupler, rocker, _ = linkage.links
    if motor.link == "crank":
        b = linkage.pivot_b - linkage.pivot_a
        steps.append(Dyad(2, 3, Place(1, complex(crank)), Place(GROUND, b), coupler, rocker, linkage.branch))
    else:
        names.append("back_of_coupler")
        joints = linkage.joints(np.zeros(1))
        d, c = joints.crank_pin[0] - plain.origin, joints.coupler_pin[0] - plain.origin
        behind = 1 if np.imag(np.conj(-c) * (d - c)) > 0 else -1
        back = len(names) - 1
        steps.append(Dyad(back, 1, Place(3, complex(rocker)), Place(GROUND, 0j), coupler, crank, behind))
        steps.append(Fixed(2, Place(back, complex(coupler)), np.pi))
    movement = Movement(names, steps)
    _check(linkage, plain, movement, Place(rod, complex(motor.rod)), Place(link, motor.pin))
    plates = [_with_pin(one, motor.pin, hole, "Q") if one.name == motor.link else one for one in plain.plates]
    for name, number, reach, ends in (
        ("motor_crank", cranked, motor.crank, ("M", "K")),
        ("rod", rod, motor.rod, ("K", "Q")),
    ):
        shape = Shape((0j, complex(reach)), width / 2)
        plates.append(Plate(name, number, shape, (Hole(0j, ends[0]), Hole(complex(reach), ends[1]))))
    joins = ("motor_crank", "bar") if bar else ("motor_crank",)
    pins = [
        *plain.pins,
        Pin("M", (Place(GROUND, at), Place(cranked, 0j)), hole / 2, joins),
        Pin("K", (Place(cranked, complex(motor.crank)), Place(rod, 0j)), hole / 2, ("motor_crank", "rod")),
        Pin("Q", (Place(rod, complex(motor.rod)), Place(link, motor.pin)), hole / 2, ("rod", motor.link)),
    ]
    if bar:
        plates = [_with_pin(one, at, hole, "M") if one.name == "bar" else one for one in plates]
    return replace(
        plain,
        movement=movement,
        plates=tuple(plates),
        pins=tuple(pins),
        used=Interval(0.0, TURN),
        loop=None,
        size=max(plain.size, motor.rod),
        lengths=(*plain.lengths, motor.crank, motor.rod),
    )


def _with_pin(plate: Plate, at: complex, hole: float, pin: str) -> Plate:
    """A plate that reaches to one more pin."""
    core = hull((*plate.shape.core, at))
    return replace(plate, shape=Shape(core, plate.shape.radius), holes=(*plate.holes, Hole(at, pin)))


def _check(linkage: Linkage, plain: Machine, movement: Movement, rod: Place, pin: Place) -> None:
    """FieldError unless the motor moves the linkage from one end of its used interval to the other, and no farther."""
    turned = movement.bodies(np.linspace(0.0, TURN, 721))
    wanted = plain.movement.bodies(np.linspace(*plain.used, 181))
    size = plain.size
    held = bool(
        np.abs(turned.point(rod) - turned.point(pin)).max() < _NEAR * size
    )  # the rod reaches the pin everywhere
    for body, reach in ((1, linkage.links[0]), (3, linkage.links[2])):
        joint = Place(body, complex(reach))
        found, ends = turned.point(joint), wanted.point(joint)
        far = max(np.abs(found - end).min() for end in (ends[0], ends[-1]))
        beyond = np.abs(found[:, None] - ends[None]).min(axis=1).max()
        step = np.abs(np.diff(ends)).max()
        if not (held and far < max(_NEAR * size, step) and beyond < max(_NEAR * size, step)):
            raise FieldError(
                "/drive",
                "the motor and its rod do not move this linkage over its used interval, from one end to the other",
            )
