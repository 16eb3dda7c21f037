"""Parts of a mechanism: plates and pins with their sizes, the bodies that carry them, and their movement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from synthesis.assembly.movement import GROUND, BodyPoint, Movement
from synthesis.assembly.shapes import Shape, nearest_on
from synthesis.target import TURN, Interval

CLEARANCE = 0.5 / 165
"""Default clearance, as a fraction of the longest link."""
FULL_TURN_TOLERANCE = 1e-9
"""Largest amount in radians by which an interval may fall short of a turn and still count as one."""


class Hole(NamedTuple):
    """A hole of a plate for a pin or post, or a slit along which a pin slides, as wide as the pin; in the plate's frame."""

    core: tuple[complex, ...]
    """Centre of a hole, or the two ends of a slit that the pin's middle reaches."""
    pin: str

    def distance(self, point: complex) -> float:
        """Return the distance of a point from the centre, or from the line between the ends."""
        return abs(nearest_on(self.core, point) - point)


class Stop(NamedTuple):
    """End of the motion: a coordinate of the drive."""

    at: float
    pair: tuple[str, str] | None
    """Parts that collide there, or the pin and the plate whose slit it would leave; None if the loop itself ends."""


@dataclass(frozen=True)
class Plate:
    """A flat part in a single layer; shape and holes are given in the frame of the body that carries it."""

    name: str
    body: int
    shape: Shape
    holes: tuple[Hole, ...]

    @property
    def slits(self) -> list[Hole]:
        """Holes in which pins slide."""
        return [hole for hole in self.holes if len(hole.core) > 1]


@dataclass(frozen=True)
class Pin:
    """A pin, or a post within a body, that joins plates."""

    name: str
    points: tuple[BodyPoint, ...]
    """The same point on each body that the pin belongs to."""
    radius: float
    joins: tuple[str, ...]
    post: bool = False
    """True if it joins plates of the same body and rotates in none."""

    @property
    def grounded(self) -> bool:
        """True if it is fixed to the ground."""
        return self.points[0].body == GROUND


class Sizes(NamedTuple):
    """Sizes of the parts in the unit of the lengths; None selects the default."""

    hole: float | None = None
    """Diameter of pins and their holes."""
    width: float | None = None
    """Width of the plates, which extend half of it around their holes."""
    clearance: float | None = None
    """Smallest gap of parts that pass each other."""
    hole_factor: float = 1.0
    """Factor of the default hole."""


@dataclass(frozen=True)
class Machine:
    """A mechanism with its parts, over an interval of crank angles in radians from the first sample."""

    movement: Movement
    plates: tuple[Plate, ...]
    pins: tuple[Pin, ...]
    used: Interval
    loop: Interval | None
    """Crank angles between which the loop closes; None if the crank turns fully."""
    hole: float
    width: float
    clearance: float
    size: float
    """Length of the longest link."""
    lengths: tuple[float, ...]
    """Lengths of the links, which holes must not exceed."""
    origin: complex = 0j
    """Position of the ground's frame in the user's plane; the axes are parallel."""
    turns: bool = True
    """True if the drive rotates; otherwise its travel is a length in the unit of the linkage."""
    body_at: complex = 0j
    """Origin of the frame of the coupler's masses, in the coupler's frame."""
    slit_ends: tuple[Stop | None, Stop | None] = (None, None)
    """Ends of slits below and above the interval; None if the loop ends first."""
    telescopes: tuple[tuple[str, str], ...] = ()
    """Pairs of plates that slide inside each other: both lie in the same layer and do not collide."""

    @property
    def whole_turn(self) -> bool:
        """True if the interval is a turn, so that its end coincides with its start."""
        return self.turns and self.loop is None and self.used.last - self.used.first >= TURN - FULL_TURN_TOLERANCE

    def plate(self, name: str) -> Plate:
        """Return a plate by its name."""
        return next(plate for plate in self.plates if plate.name == name)
