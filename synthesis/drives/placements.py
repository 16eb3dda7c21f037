"""Placements of a linear actuator between two links: sizes, limits, lengths, moment arms and forces.

An actuator of retracted length L0 and stroke s between a point G and a pin q of a moving link has the length
``L = |X + R q - G|`` and, per radian of the drive, the moment arm dL/dphi; its force is the drive's torque over its arm. It
uses its whole stroke: its length is L0 at one end of the interval and L0 + s at the other. No placement has a smaller peak
force than the integral of the torque's absolute value over s, and none has a larger minimum arm than s over the interval.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Floats
from synthesis.mechanism import Box

TOLERANCE = 1e-7
"""Allowed violation of the limits of a placement by rounding, as a fraction of its size."""


class Actuator(NamedTuple):
    """Sizes of an actuator: its retracted length and its stroke."""

    retracted: float
    stroke: float


@dataclass(frozen=True)
class Sizes:
    """Sizes of an actuator, some of which a search may change."""

    start: Actuator
    """Sizes that are fixed, and the initial values of the free sizes."""
    retracted_free: bool = False
    stroke_free: bool = False
    dead_length: float = 0.0
    """Smallest difference of retracted length and stroke, if one of them is free."""


class PlacementLimits(NamedTuple):
    """Limits on a placement."""

    box: Box
    """Region of the ground point."""
    reach: float
    """Largest distance of the pin from the origin of its link's frame."""
    arm: float
    """Smallest moment arm, a length per radian of the drive."""
    extends: bool | None = None
    """Required direction: extending (True) or retracting (False) from the first position; None allows both."""
    pin_box: Box | None = None
    """Region of the pin in its link's frame."""


@dataclass(frozen=True)
class Placement:
    """Ends of an actuator, with its length, moment arm and force at the n positions of the motion."""

    ground: complex
    pin: complex
    """Pin in its link's frame."""
    extends: bool
    """True if the actuator is retracted at the first position."""
    length: Floats
    arm: Floats
    """Moment arm dL/dphi; negative if the actuator shortens as the drive's parameter grows."""
    force: Floats
    """Force along the actuator; positive if it pushes."""
    worst: float
    """Objective of the search: the maximum of ``|torque / arm|``, or without a load of ``1 / |arm|``."""

    @property
    def peak(self) -> float:
        """Largest absolute force."""
        return float(np.max(np.abs(self.force)))


class Refusal(NamedTuple):
    """Reason why an actuator cannot be placed, with the number that shows it."""

    reason: str
    """``stroke``, ``reach``, ``pin_box``, ``dead`` or ``arm``."""
    needed: float
    """Reach or arm that would be needed or that can be attained; for a dead point the drive's parameter there."""
    between: tuple[int, int] | None = None
    """Indices of the positions between which the dead point lies."""
