"""A motor that turns on, and its rod, as two more plates on a linkage: all of it then moves over a turn of the motor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from synthesis.arrays import Floats
from synthesis.assembly.guided import guided
from synthesis.assembly.machine import Hole, Machine, Pin, Plate, Sizes, four_bar
from synthesis.assembly.movement import GROUND, Between, Bodies, Crank, Movement, Place
from synthesis.assembly.shapes import Shape, hull
from synthesis.drives.six_bar import MOTOR_CRANK, ROD, Motor, SixBar
from synthesis.errors import FieldError
from synthesis.fourbar.files import plate_sizes
from synthesis.fourbar.linkage import Linkage
from synthesis.guided.linkage import GuidedLinkage
from synthesis.target import TURN, Interval

_ROUNDING = 1e-13
"""Of the way: places of the drive are found to far less."""


@dataclass(frozen=True)
class Swung:
    """The bodies of a linkage that a motor swings through its way and back.

    On either way the place of its drive is monotone in the motor's angle. So over a cell it stays between the places at both ends
    of the cell, and one end of the way where a dead centre lies within; the linkage's own movement encloses the rest.
    """

    six: SixBar
    plain: Movement

    def place(self, bodies: Bodies, travel: Floats, half: Floats) -> None:
        """``travel``, ``half`` (m,): of the motor."""
        middle = self.six.travel(travel)
        spread = np.zeros(travel.shape)
        wide = half > 0
        if wide.any():
            here, by = travel[wide], np.minimum(half[wide], np.pi)
            ends = self.six.travel(np.concatenate([here - by, here + by])).reshape(2, -1)
            off = np.abs(ends - middle[wide]).max(axis=0)
            for angle, end in zip((0.0, self.six.last), self.six.used):
                within = np.abs((here - angle + np.pi) % TURN - np.pi) <= by
                off = np.where(within, np.maximum(off, np.abs(end - middle[wide])), off)
            spread[wide] = off + _ROUNDING * abs(self.six.used[1] - self.six.used[0])
        found = self.plain.bodies(middle, spread)
        for all_of, some in zip(bodies, found):
            all_of[: len(some)] = some


def motor_driven(
    linkage: Linkage | GuidedLinkage,
    used: Interval,
    motor: Motor,
    sizes: Sizes,
    body: Sequence[complex] = (),
    bar: bool = False,
) -> Machine:
    """A linkage that a motor moves from one end of an interval to the other and back; the drive's travel is the motor's turn.

    Further plates: motor_crank and rod; further pins: M, the motor's shaft, K between both, Q on the link.

    Raises `FieldError`: for a motor that does not move the linkage over the interval, and a rod on a link that is no plate.
    """
    six = SixBar.of(linkage, used, motor)

    def of(given: Sizes) -> Machine:
        if isinstance(linkage, Linkage):
            return four_bar(linkage, used, given, body, bar)
        return guided(linkage, used, given, body, bar)

    plain = of(sizes)
    hole, width = plate_sizes((*plain.lengths, motor.crank, motor.rod), sizes.hole, sizes.width)
    plain = of(Sizes(hole, width, sizes.clearance))
    if motor.link not in plain.movement.names:
        raise FieldError("/drive/link", f"the rod moves the {motor.link}, which is no plate: it is not arranged")
    link = plain.movement.names.index(motor.link)
    # the body's frame of a linkage on guides begins at the driven guide's body point
    own = isinstance(linkage, GuidedLinkage) and motor.link == "coupler"
    pin = motor.pin - linkage.guides[0].body_point if own and isinstance(linkage, GuidedLinkage) else motor.pin
    at = motor.at - plain.origin
    cranked, rod = len(plain.movement.names), len(plain.movement.names) + 1
    end, held = Place(cranked, complex(motor.crank)), Place(link, pin)
    movement = Movement(
        (*plain.movement.names, MOTOR_CRANK, ROD),
        (
            Swung(six, plain.movement),
            Crank(cranked, Place(GROUND, at), six.start),
            Between(rod, end, held, motor.rod),
        ),
    )
    free = not any(one.name == "P" for one in plain.pins)
    plates = [_with_pin(one, pin, hole, "Q", free) if one.name == motor.link else one for one in plain.plates]
    if bar:
        plates = [_with_pin(one, at, hole, "M", free) if one.name == "bar" else one for one in plates]
    for name, number, reach, ends in (
        (MOTOR_CRANK, cranked, motor.crank, ("M", "K")),
        (ROD, rod, motor.rod, ("K", "Q")),
    ):
        shape = Shape((0j, complex(reach)), width / 2)
        plates.append(Plate(name, number, shape, (Hole(0j, ends[0]), Hole(complex(reach), ends[1]))))
    joins = (MOTOR_CRANK, "bar") if bar else (MOTOR_CRANK,)
    pins = (
        *plain.pins,
        Pin("M", (Place(GROUND, at), Place(cranked, 0j)), hole / 2, joins),
        Pin("K", (end, Place(rod, 0j)), hole / 2, (MOTOR_CRANK, ROD)),
        Pin("Q", (Place(rod, complex(motor.rod)), held), hole / 2, (ROD, motor.link)),
    )
    return replace(
        plain,
        movement=movement,
        plates=tuple(plates),
        pins=pins,
        used=Interval(0.0, TURN),
        loop=None,
        slit_ends=(None, None),
        size=max(plain.size, motor.rod),
        lengths=(*plain.lengths, motor.crank, motor.rod),
        turns=True,
    )


def _with_pin(plate: Plate, at: complex, hole: float, pin: str, free: bool) -> Plate:
    """A plate that reaches to one more pin; ``free``: a hole for the body point alone gives way to it."""
    core = hull((*plate.shape.core, at))
    holes = [one for one in plate.holes if not (free and one.pin == "P" and abs(one.at - at) <= hole)]
    return replace(plate, shape=Shape(core, plate.shape.radius), holes=(*holes, Hole(at, pin)))
