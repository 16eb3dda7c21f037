"""A linkage as plates together with its drive: a motor and a rod, a cylinder, or the two links of a knee."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from synthesis.arrays import Floats
from synthesis.assembly.linkage_machine import as_plates
from synthesis.assembly.machine import Hole, Machine, Pin, Plate, Sizes
from synthesis.assembly.movement import (
    GROUND,
    Aimed,
    Between,
    Bodies,
    BodyPoint,
    Crank,
    Dyad,
    Movement,
    Step,
)
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
    linkage: Linkage,
    used: Interval,
    motor: Motor,
    sizes: Sizes,
    body: Sequence[complex] = (),
    bar: bool = False,
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
    if motor.link not in plain.movement.names:
        raise FieldError("/drive/link", f"the rod moves the {motor.link}, which is not a plate; choose another drive")
    link = plain.movement.names.index(motor.link)
    pin = motor.pin + plain.body_at if motor.link == BODY else motor.pin
    at = motor.at - plain.origin
    cranked, rod = len(plain.movement.names), len(plain.movement.names) + 1
    end, held = BodyPoint(cranked, complex(motor.crank)), BodyPoint(link, pin)
    movement = Movement(
        (*plain.movement.names, MOTOR_CRANK, ROD),
        (
            SwungLinkage(six, plain.movement),
            Crank(cranked, BodyPoint(GROUND, at), six.start),
            Between(rod, end, held, motor.rod),
        ),
    )
    free = not any(pin_.name == "P" for pin_ in plain.pins)
    plates = [_with_pin(plate, pin, hole, "Q", free) if plate.name == motor.link else plate for plate in plain.plates]
    if bar:
        plates = [_with_pin(plate, at, hole, "M", free) if plate.name == "bar" else plate for plate in plates]
    for name, number, reach, ends in (
        (MOTOR_CRANK, cranked, motor.crank, ("M", "K")),
        (ROD, rod, motor.rod, ("K", "Q")),
    ):
        shape = Shape((0j, complex(reach)), width / 2)
        plates.append(Plate(name, number, shape, (Hole((0j,), ends[0]), Hole((complex(reach),), ends[1]))))
    joins = (MOTOR_CRANK, "bar") if bar else (MOTOR_CRANK,)
    pins = (
        *plain.pins,
        Pin("M", (BodyPoint(GROUND, at), BodyPoint(cranked, 0j)), hole / 2, joins),
        Pin("K", (end, BodyPoint(rod, 0j)), hole / 2, (MOTOR_CRANK, ROD)),
        Pin("Q", (BodyPoint(rod, complex(motor.rod)), held), hole / 2, (ROD, motor.link)),
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
        lengths=lengths,
        turns=True,
    )


@dataclass(frozen=True)
class Strut:
    """A drive between the ground, or a link, and a pin of another link: a cylinder, or the two links of a knee.

    Attributes
    ----------
    link, on : str
        The link with the pin, and what carries the other end.
    pin : complex
        In the frame of ``link``.
    end : complex
        The other end in the plane at the first sample.
    sizes : tuple of float
        Retracted length and stroke of a cylinder; lengths of handle and strut of a knee.
    knee : int
        0 for a cylinder; for a knee +1 where its joint lies to the left of the line from end to pin, or -1.
    """

    link: str
    on: str
    pin: complex
    end: complex
    sizes: tuple[float, float]
    knee: int = 0


CYLINDER, PISTON_ROD, HANDLE, STRUT = "cylinder", "piston_rod", "handle", "strut"


def strut_driven(
    linkage: Linkage,
    used: Interval,
    drive: Strut,
    sizes: Sizes,
    body: Sequence[complex] = (),
    bar: bool = False,
) -> Machine:
    """Return a linkage with a cylinder or a knee, over an interval of the linkage's own travel.

    Further plates are cylinder and piston_rod, which slides inside it, or handle and strut. Further pins are G, the end on the
    ground or on a link, K between handle and strut, and Q on the link that is moved. The plate of that link reaches to Q.

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
    names, hole, width = plain.movement.names, plain.hole, plain.width
    for name in (drive.link, drive.on):
        if name != names[GROUND] and name not in [plate.name for plate in plain.plates]:
            raise FieldError("/drive/link", f"an end is on the {name}, which is not a plate; choose another drive")
    link, on = names.index(drive.link), names.index(drive.on)
    pin = drive.pin + plain.body_at if drive.link == BODY else drive.pin
    still = plain.movement.bodies(np.zeros(1))
    end = complex((drive.end - plain.origin - still.origin[on, 0]) / still.direction[on, 0])
    foot, held = BodyPoint(on, end), BodyPoint(link, pin)
    first, second = len(names), len(names) + 1
    names_of_links = (HANDLE, STRUT) if drive.knee else (CYLINDER, PISTON_ROD)
    eye = Hole((0j,), "G"), Hole((0j,), "Q")
    steps: list[Step] = []
    pins: list[Pin] = []
    if drive.knee:
        first_length, second_length = drive.sizes
        steps.append(Dyad(first, second, foot, held, first_length, second_length, drive.knee))
        plates = [
            Plate(name, number, Shape((0j, complex(reach)), width / 2), (hole_, Hole((complex(reach),), "K")))
            for name, number, reach, hole_ in zip(names_of_links, (first, second), drive.sizes, eye)
        ]
        pins.append(
            Pin(
                "K",
                (BodyPoint(first, complex(first_length)), BodyPoint(second, complex(second_length))),
                hole / 2,
                names_of_links,
            )
        )
    else:
        retracted, stroke = drive.sizes
        steps += [Aimed(first, foot, held), Aimed(second, held, foot)]
        rod = stroke + (1 - _TUBE + _OVERLAP) * retracted
        radii = width / 2, hole / 2 + (width - hole) / 4
        plates = [
            Plate(name, number, Shape((0j, complex(reach)), radius), (hole_,))
            for name, number, reach, radius, hole_ in zip(
                names_of_links, (first, second), (_TUBE * retracted, rod), radii, eye
            )
        ]
    free = not any(pin_.name == "P" for pin_ in plain.pins)
    carriers = [(drive.link, pin, "Q")]
    if on != GROUND:
        carriers.append((drive.on, end, "G"))
    elif bar:
        carriers.append(("bar", end, "G"))
    plates_of_linkage = list(plain.plates)
    for name, at, pin_name in carriers:
        plates_of_linkage = [
            _with_pin(plate, at, hole, pin_name, free) if plate.name == name else plate for plate in plates_of_linkage
        ]
    foot_joins = (
        names_of_links[:1] if on == GROUND and not bar else (names_of_links[0], "bar" if on == GROUND else drive.on)
    )
    pins = [
        *plain.pins,
        Pin("G", (foot, BodyPoint(first, 0j)), hole / 2, foot_joins),
        *pins,
        Pin("Q", (BodyPoint(second, 0j), held), hole / 2, (names_of_links[1], drive.link)),
    ]
    return replace(
        plain,
        movement=Movement((*names, *names_of_links), (*plain.movement.steps, *steps)),
        plates=(*plates_of_linkage, *plates),
        pins=tuple(pins),
        size=max(plain.size, sum(drive.sizes)),
        telescopes=() if drive.knee else (names_of_links,),
    )


def _with_pin(plate: Plate, at: complex, hole: float, pin: str, free: bool) -> Plate:
    """Return a plate that reaches to a further pin; if ``free``, a hole that only marks the body point gives way to it."""
    core = hull((*plate.shape.core, at))
    holes = [hole_ for hole_ in plate.holes if not (free and hole_.pin == "P" and hole_.distance(at) <= hole)]
    return replace(plate, shape=Shape(core, plate.shape.radius), holes=(*holes, Hole((at,), pin)))
