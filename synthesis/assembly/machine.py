"""What a mechanism is built of: plates and pins with their sizes, the bodies that carry them, and how far they move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synthesis.assembly.movement import GROUND, Crank, Dyad, Movement, Place
from synthesis.assembly.shapes import Shape, contains, hull, nearest_on
from synthesis.errors import FieldError
from synthesis.fourbar.files import plate_sizes
from synthesis.fourbar.linkage import Linkage
from synthesis.fourbar.passage import Circuits, RoundCircuit
from synthesis.target import TURN, Interval

CLEARANCE = 0.5 / 165
"""The default clearance, as a part of the longest link."""
WHOLE = 1e-9
"""Radians by which an interval may fall short of a turn and still be one."""


class Hole(NamedTuple):
    """A hole of a plate, in the plate's frame, and the pin or post that it is for."""

    at: complex
    pin: str


class Slit(NamedTuple):
    """A slit of a plate along which a pin slides, of the pin's width, between the two ends that the pin's middle reaches."""

    first: complex
    last: complex
    pin: str

    def distance(self, point: complex) -> float:
        """Of a point from the line between its ends."""
        return abs(nearest_on((self.first, self.last), point) - point)


class SlitEnd(NamedTuple):
    """A place of the drive beyond which a pin would leave its slit; ``pair``: pin and plate."""

    at: float
    pair: tuple[str, str]


@dataclass(frozen=True)
class Plate:
    """A flat part in one layer; ``shape``, ``holes`` and ``slits`` in the frame of the body that carries it."""

    name: str
    body: int
    shape: Shape
    holes: tuple[Hole, ...]
    slits: tuple[Slit, ...] = ()


@dataclass(frozen=True)
class Pin:
    """A pin, or a post within one body, that joins plates; ``places``: the same point on each body that it belongs to."""

    name: str
    places: tuple[Place, ...]
    radius: float
    joins: tuple[str, ...]
    post: bool = False
    """Whether it joins plates of one body, and turns in none."""

    @property
    def grounded(self) -> bool:
        """Whether it stands in the ground."""
        return self.places[0].body == GROUND


class Sizes(NamedTuple):
    """Sizes of the parts in the unit of the lengths; None: the default."""

    hole: float | None = None
    """Diameter of pins and their holes."""
    width: float | None = None
    """Of the plates: they reach half of it around their holes."""
    clearance: float | None = None
    """Least gap of parts that pass one another."""


@dataclass(frozen=True)
class Machine:
    """A mechanism with its parts, over an interval of crank angles in radians from the first sample.

    ``origin``: where the ground's frame stands in the user's plane, whose axes it has. ``loop``: crank angles between which the
    loop closes; None where the crank turns fully. ``size``: its longest link. ``lengths``: of its links,
    which holes must be smaller than.
    """

    movement: Movement
    plates: tuple[Plate, ...]
    pins: tuple[Pin, ...]
    used: Interval
    loop: Interval | None
    hole: float
    width: float
    clearance: float
    size: float
    lengths: tuple[float, ...]
    origin: complex = 0j
    turns: bool = True
    """Whether the drive turns; otherwise its travel is a length in the unit of the linkage."""
    body_at: complex = 0j
    """In the coupler's frame, where that frame begins in which an analysis has the coupler's masses."""
    slit_ends: tuple[SlitEnd | None, SlitEnd | None] = (None, None)
    """Below and above the interval; None where no slit ends the motion before the loop does."""

    @property
    def whole_turn(self) -> bool:
        """Whether the interval is a turn, whose end is its beginning."""
        return self.turns and self.loop is None and self.used.last - self.used.first >= TURN - WHOLE

    def plate(self, name: str) -> Plate:
        """A plate by name."""
        return next(one for one in self.plates if one.name == name)


def four_bar(
    linkage: Linkage, used: Interval, sizes: Sizes, body: Sequence[complex] = (), bar: bool = False
) -> Machine:
    """A four-bar as plates crank, coupler and rocker on pins A, B, D, C; its coupler's plate reaches to the body point P.

    ``body``: corners of a plate that the coupler carries, counter-clockwise, from P in axes that turn with the coupler and lie as
    the user's do where the body's rotation is 0; a post joins it, at P where P lies in it. ``bar``: the ground is a plate too.

    Raises `FieldError`: for sizes that leave no material, and for a loop that does not close over the interval.
    """
    crank, coupler, rocker, _ = linkage.links
    hole, width = plate_sizes(linkage.links, sizes.hole, sizes.width)
    size = max(linkage.links)
    clearance = CLEARANCE * size if sizes.clearance is None else sizes.clearance
    first, last = min(used), max(used)
    loop = loop_of(linkage, Interval(first, last))
    if loop is None and last - first > TURN:
        last = first + TURN
    pivot_b = linkage.pivot_b - linkage.pivot_a
    start = linkage.start + linkage.ground_angle
    points = [0j, complex(coupler)]
    joins = {"A": ["crank"], "B": ["rocker"], "D": ["crank", "coupler"], "C": ["coupler", "rocker"]}
    places: dict[str, tuple[Place, ...]] = {
        "A": (Place(GROUND, 0j), Place(1, 0j)),
        "B": (Place(GROUND, pivot_b), Place(3, 0j)),
        "D": (Place(1, complex(crank)), Place(2, 0j)),
        "C": (Place(2, complex(coupler)), Place(3, complex(rocker))),
    }
    plates = {
        "crank": Plate(
            "crank", 1, Shape((0j, complex(crank)), width / 2), (Hole(0j, "A"), Hole(complex(crank), "D"))
        ),
        "rocker": Plate(
            "rocker", 3, Shape((0j, complex(rocker)), width / 2), (Hole(0j, "B"), Hole(complex(rocker), "C"))
        ),
    }
    holes = [Hole(0j, "D"), Hole(complex(coupler), "C")]
    if linkage.mounted:
        # a hole that would run into another one is left out
        points.append(linkage.arm)
        sash, post = carried_by(body, linkage.arm, body_turn(linkage))
        if sash:
            points.append(post)
            joins["P"], places["P"] = ["coupler", "body"], (Place(2, post),)
            plates["body"] = Plate("body", 2, Shape(sash, 0.0), (Hole(post, "P"),))
        if min(abs(post - at) for at, _ in holes) > hole:
            holes.append(Hole(post, "P"))
    plates["coupler"] = Plate("coupler", 2, Shape(hull(points), width / 2), tuple(holes))
    if bar:
        plates["bar"] = Plate("bar", GROUND, Shape((0j, pivot_b), width / 2), (Hole(0j, "A"), Hole(pivot_b, "B")))
        joins["A"].append("bar")
        joins["B"].append("bar")
    order = ("crank", "coupler", "rocker", "body", "bar")
    return Machine(
        Movement(
            ("ground", "crank", "coupler", "rocker"),
            (
                Crank(1, Place(GROUND, 0j), start),
                Dyad(2, 3, Place(1, complex(crank)), Place(GROUND, pivot_b), coupler, rocker, linkage.branch),
            ),
        ),
        tuple(plates[name] for name in order if name in plates),
        tuple(
            Pin(name, places[name], hole / 2, tuple(joins[name]), name == "P")
            for name in ("A", "B", "D", "C", "P")
            if name in joins
        ),
        Interval(first, last),
        loop,
        hole,
        width,
        clearance,
        size,
        linkage.links,
        linkage.pivot_a,
    )


def carried_by(body: Sequence[complex], point: complex, turn: float) -> tuple[tuple[complex, ...], complex]:
    """A body's outline in the frame of the link that carries it, and where its post stands: at the body point, or nearest to it.

    ``point``, ``turn``: the body's frame in the link's. Without an outline the post's place is the body point.
    """
    corners = tuple(complex(point + np.exp(1j * turn) * z) for z in body)
    if not corners or contains(corners, point):
        return corners, point
    return corners, nearest_on(corners, point)


def body_turn(linkage: Linkage) -> float:
    """Angle of the body's axes in the coupler's frame; where no rotation is known they lie as the user's at the first sample."""
    if linkage.body_offset is not None:
        return linkage.body_offset
    return -float(linkage.joints(np.zeros(1)).coupler_angle[0])


def loop_of(linkage: Linkage, used: Interval) -> Interval | None:
    """Crank angles between which the loop closes, about those used; None where the crank turns fully.

    Raises `FieldError`: where it does not close over all that is used.
    """
    lengths = np.array([linkage.links])
    circuits = Circuits.of(lengths)
    if circuits.turns.item():
        return None
    middle = linkage.start + (used.first + used.last) / 2
    circuit, _ = RoundCircuit.through(lengths, np.array([[middle]]), np.array([[float(linkage.branch)]]))
    low, width = circuit.low.item(), circuit.width.item()
    turns = TURN * np.floor((middle - low) / TURN)
    first = low + turns - linkage.start
    slack = 1e-9
    if used.first < first - slack or used.last > first + width + slack:
        fault = used.first if used.first < first - slack else used.last
        raise FieldError(
            "/solution/links", f"the four links do not close {np.rad2deg(fault):.6g} degrees after the start"
        )
    return Interval(min(first, used.first), max(first + width, used.last))
