"""The angles of a chain's pins as section 2 of the source counts them, and the directions of its links, over the phase."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.chain.crescent import LEFT_WHEEL, LOWER_ARC, RIGHT_WHEEL, UPPER_ARC, Crescent
from synthesis.chain.slot import Slot
from synthesis.chain.track import Points
from synthesis.one_variable import Floats


class Pins(NamedTuple):
    """All pins at some phases; each array has shape (n, links)."""

    points: Points
    segment: NDArray[np.intp]
    """The segment that a pin is on; the free pin hangs beside the first one that the slot replaces."""
    along: Floats
    """Way from that segment's start; 0 for the free pin."""

    @property
    def link_angle(self) -> Floats:
        """Direction of the link from each pin to the next, rad from x, continuous over the phases."""
        links = np.roll(self.points, -1, axis=1) - self.points
        angles: Floats = np.unwrap(np.angle(links), axis=0)
        return angles


def pins_at(slot: Slot, phases: Floats) -> Pins:
    """All pins of a chain at phases of shape (n,).

    Law: neighbours are one pitch apart, the last and the first too.
    """
    places = slot.places(phases)
    return Pins(slot.points_at(places), places.segment, places.along)


def crescent_angles(crescent: Crescent, slot: Slot, pins: Pins) -> Floats:
    """theta1 .. thetaN, rad, shape (n, links): each pin's angle on the part of the crescent that it is on.

    On a wheel from the joint with the upper arc, over the top; on the arcs about their own centre from straight down, right
    positive; the free pin about the upper arc's centre.
    """
    r0, r1, r2 = crescent.wheel_radius, crescent.upper_radius, crescent.lower_radius
    turn = np.pi + crescent.xi + crescent.eps
    angles = np.empty(pins.along.shape)
    for part, start, rate in (
        (LEFT_WHEEL, 0.0, 1 / r0),
        (LOWER_ARC, -crescent.alpha, 1 / r2),
        (RIGHT_WHEEL, turn, -1 / r0),
        (UPPER_ARC, np.pi / 2 + crescent.eps, -1 / r1),
    ):
        on = pins.segment == part
        angles[on] = start + rate * pins.along[on]
    free = pins.points[:, slot.free - 1]
    angles[:, slot.free - 1] = np.arctan2(free.real, -free.imag)
    return angles
