"""A linkage as plates together with its drive: a motor and a rod, or a cylinder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from synthesis.arrays import Floats
from synthesis.assembly.linkage_machine import as_plates
from synthesis.assembly.machine import Hole, Machine, Pin, Plate, Sizes
from synthesis.assembly.movement import GROUND, Aimed, Bodies, BodyPoint, Crank, Movement, Step
from synthesis.assembly.shapes import Shape, hull
from synthesis.assembly.sizes import plate_sizes
from synthesis.drives.six_bar import MOTOR_CRANK, ROD, Motor, SixBar
from synthesis.errors import FieldError
from synthesis.linkage import BODY, Linkage
from synthesis.target import TURN, Interval

_TUBE = 0.85
"""Length of a cylinder's tube, as a fraction of the retracted length."""
_OVERLAP = 0.05
"""Smallest overlap of tube and rod, as a fraction of the retracted length."""
_ROUNDING = 1e-13
"""Uncertainty of the drive's coordinate, as a fraction of its travel; the actual error is much smaller."""


@dataclass(frozen=True)
class SwungLinkage:
    """Bodies of a linkage that a motor swings through its travel and back.

    In each stroke the coordinate of the linkage's drive is monotone in the motor's angle. So over a cell it stays between its
    values at both ends of the cell and, if the cell contains a dead centre, the end of the travel. The linkage's own movement
    bounds the rest.
    """

    six: SixBar
    plain: Movement

    def enclose(self, bodies: Bodies, travel: Floats, half: Floats) -> None:
        """Enclose the bodies over cells of the motor's angle, with middles and half widths (m,)."""
        middle = self.six.travel(travel)
        spread = np.zeros(travel.shape)
        wide = half > 0
        if wide.any():
            angles, half_widths = travel[wide], np.minimum(half[wide], np.pi)
            ends = self.six.travel(np.concatenate([angles - half_widths, angles + half_widths])).reshape(2, -1)
            deviation = np.abs(ends - middle[wide]).max(axis=0)
            for angle, end in zip((0.0, self.six.last), self.six.used):
                is_inside = np.abs((angles - angle + np.pi) % TURN - np.pi) <= half_widths
                deviation = np.where(is_inside, np.maximum(deviation, np.abs(end - middle[wide])), deviation)
            spread[wide] = deviation + _ROUNDING * abs(self.six.used[1] - self.six.used[0])
        bodies_of_linkage = self.plain.bodies(middle, spread)
        for column, values in zip(bodies, bodies_of_linkage):
            column[: len(values)] = values


def motor_driven(
    linkage: Linkage, used: Interval, motor: Motor, sizes: Sizes, body: Sequence[complex] = (), bar: bool = False
) -> Machine:
    """Return a linkage that a motor moves from the start of an interval to its end and back.

    The drive's travel is the motor's angle. Further plates are motor_crank and rod; further pins are the motor's shaft M, K
    between both, and Q on the link.

    Parameters
    ----------
    linkage : Linkage
    used : Interval
        Travel of the linkage's own drive.
    motor : Motor
    sizes, body, bar
        See `as_plates`.

    Raises
    ------
    FieldError
        If the motor does not move the linkage over the interval, or if the rod acts on a link that is not a plate.
    """
    six = SixBar.of(linkage, used, motor)
    lengths = (*as_plates(linkage, used, sizes).lengths, motor.crank, motor.rod)
    hole, width = plate_sizes(lengths, sizes.hole, sizes.width, sizes.hole_factor)
    plain = as_plates(linkage, used, Sizes(hole, width, sizes.clearance), body, bar)
    place = _Placed(plain, motor.link, plain.movement.names[GROUND], motor.pin, motor.at)
    first, second = place.numbers
    end = BodyPoint(first, complex(motor.crank))
    steps = (SwungLinkage(six, plain.movement), Crank(first, place.foot, six.start), Aimed(second, end, place.held))
    crank, rod = ((0j, complex(length)) for length in (motor.crank, motor.rod))
    plates = (
        Plate(MOTOR_CRANK, first, Shape(crank, width / 2), (Hole(crank[:1], "M"), Hole(crank[1:], "K"))),
        Plate(ROD, second, Shape(rod, width / 2), (Hole(rod[:1], "K"), Hole(rod[1:], "Q"))),
    )
    return replace(
        place.machine(bar, steps, plates, (end, BodyPoint(second, 0j)), rod[1]),
        used=Interval(0.0, TURN),
        loop=None,
        slit_ends=(None, None),
        size=max(plain.size, motor.rod),
        lengths=lengths,
        turns=True,
    )


@dataclass(frozen=True)
class Strut:
    """A cylinder between the ground, or a link, and a pin of another link."""

    link: str
    on: str
    """Name of the link that carries the other end, or of the ground."""
    pin: complex
    """Pin in the frame of ``link``."""
    end: complex
    """Other end in the plane at the first sample."""
    sizes: tuple[float, float]
    """Retracted length and stroke."""


CYLINDER, PISTON_ROD = "cylinder", "piston_rod"


def strut_driven(
    linkage: Linkage, used: Interval, drive: Strut, sizes: Sizes, body: Sequence[complex] = (), bar: bool = False
) -> Machine:
    """Return a linkage with a cylinder over an interval of the linkage's own travel.

    Further plates are cylinder and piston_rod, which slides inside it. Further pins are G, the end on the ground or on a link,
    and Q on the link that is moved. The plate of that link reaches to Q.

    Parameters
    ----------
    linkage : Linkage
    used : Interval
        Travel of the linkage's drive.
    drive : Strut
    sizes, body, bar
        See `as_plates`.

    Raises
    ------
    FieldError
        If an end lies on a link that is not a plate.
    """
    plain = as_plates(linkage, used, sizes, body, bar)
    place = _Placed(plain, drive.link, drive.on, drive.pin, drive.end)
    (first, second), foot, held = place.numbers, place.foot, place.held
    steps = Aimed(first, foot, held), Aimed(second, held, foot)
    (retracted, stroke), names = drive.sizes, (CYLINDER, PISTON_ROD)
    reaches = _TUBE * retracted, stroke + (1 - _TUBE + _OVERLAP) * retracted
    radii = plain.width / 2, plain.hole / 2 + (plain.width - plain.hole) / 4
    plates = [
        Plate(name, number, Shape((0j, complex(reach)), radius), (Hole((0j,), eye),))
        for name, number, reach, radius, eye in zip(names, place.numbers, reaches, radii, ("G", "Q"))
    ]
    return replace(
        place.machine(bar, (*plain.movement.steps, *steps), plates, None, 0j),
        size=max(plain.size, sum(drive.sizes)),
        telescopes=(names,),
    )


class _Placed:
    """Place of two further plates between a foot, on the ground or on a link, and the pin Q of a link.

    ``pin`` is given in the frame of ``link``, and ``foot``, which ``on`` carries, in the plane at the first sample.
    """

    def __init__(self, plain: Machine, link: str, on: str, pin: complex, foot: complex) -> None:
        names = plain.movement.names
        for name in (link, on):
            if name != names[GROUND] and name not in [plate.name for plate in plain.plates]:
                raise FieldError(
                    "/drive/link", f"an end is on the {name}, which is not a plate; choose another drive"
                )
        self.plain, self.link = plain, link
        self.on = None if on == names[GROUND] else on
        self.numbers = len(names), len(names) + 1
        still = plain.movement.bodies(np.zeros(1))
        carrier = names.index(on)
        at = complex((foot - plain.origin - still.origin[carrier, 0]) / still.direction[carrier, 0])
        self.foot = BodyPoint(carrier, at)
        self.held = BodyPoint(names.index(link), pin + plain.body_at if link == BODY else pin)

    def machine(
        self,
        bar: bool,
        steps: Sequence[Step],
        plates: Sequence[Plate],
        joint: tuple[BodyPoint, BodyPoint] | None,
        end: complex,
    ) -> Machine:
        """Return the linkage with both plates, a pin K at their joint, and the second plate's point ``end`` on Q."""
        plain, (first, second) = self.plain, plates
        foot_pin, radius = first.holes[0].pin, plain.hole / 2
        carrier = "bar" if bar and self.on is None else self.on
        # a hole that only marks the body point gives way to a pin
        free = not any(pin.name == "P" for pin in plain.pins)
        found = list(plain.plates)
        for name, at, pin in ((self.link, self.held.at, "Q"), (carrier, self.foot.at, foot_pin)):
            for k, plate in enumerate(found):
                if plate.name == name:
                    holes = [
                        hole
                        for hole in plate.holes
                        if not (free and hole.pin == "P" and hole.distance(at) <= plain.hole)
                    ]
                    shape = Shape(hull((*plate.shape.core, at)), plate.shape.radius)
                    found[k] = replace(plate, shape=shape, holes=(*holes, Hole((at,), pin)))
        foot_joins = (first.name,) if carrier is None else (first.name, carrier)
        middle = [] if joint is None else [Pin("K", joint, radius, (first.name, second.name))]
        pins = (
            *plain.pins,
            Pin(foot_pin, (self.foot, BodyPoint(first.body, 0j)), radius, foot_joins),
            *middle,
            Pin("Q", (BodyPoint(second.body, end), self.held), radius, (second.name, self.link)),
        )
        movement = Movement((*plain.movement.names, first.name, second.name), steps)
        return replace(plain, movement=movement, plates=(*found, first, second), pins=pins)
