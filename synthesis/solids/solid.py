"""Solid parts of an assembly: names, positions, materials, fits and washers.

Each solid has its own frame: the frame of its body, moved to the centre of a round part, with the lower face at height 0.
Lengths are in millimetres, masses in kilograms.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Floats
from synthesis.assembly.machine import Machine
from synthesis.assembly.parts import Heights, Part, parts_of
from synthesis.assembly.stacks import HEAD, Stack
from synthesis.errors import FieldError
from synthesis.link_motion import Mass
from synthesis.linkage import BODY
from synthesis.solids.prism import Hole, MassProperties, Prism, filleted, rounded, together

DENSITIES = {
    "steel": 7850.0,
    "stainless": 7930.0,
    "aluminium": 2700.0,
    "brass": 8500.0,
    "plywood": 680.0,
    "acrylic": 1190.0,
    "POM": 1410.0,
    "PLA": 1240.0,
    "PETG": 1270.0,
    "ABS": 1040.0,
}
"""Materials and their densities in kg/m^3."""
COLOURS = {"ground": "#7b8794", "crank": "#c2410c", "coupler": "#2563eb", "rocker": "#2f855a"}
"""Colours of the plates of each body, as on the page."""
OTHER_BODY, ROUND, WASHER = "#0f766e", "#b0b7c0", "#d6a93b"
_CUBIC_MM = 1e-9
_STEPS = (3, 6, 10, 18, 30, 50, 80, 120, 180, 250, 315, 400, 500)
"""Upper ends of the ranges of nominal sizes in millimetres (ISO 286-1:2010, table 1)."""
_IT6 = (6, 8, 9, 11, 13, 16, 19, 22, 25, 29, 32, 36, 40)
_IT7 = (10, 12, 15, 18, 21, 25, 30, 35, 40, 46, 52, 57, 63)
"""Tolerances of grades 6 and 7 in micrometres (ISO 286-1:2010, table 1)."""
_G = (2, 4, 5, 6, 7, 9, 10, 12, 14, 15, 17, 18, 20)
"""Fundamental deviations of a shaft g in micrometres, below the nominal size (ISO 286-1:2010, table 4)."""
_SIDE_BY_SIDE = 0.48
"""Largest radius of washers relative to the distance of two holes in a plate."""
_LEAST_RIM = 0.1
"""Smallest rim of a washer relative to its hole; narrower washers are left out."""


class Fit(NamedTuple):
    """Play between pins and holes as drawn, in millimetres of the diameter."""

    name: str
    turning: float
    """Play of a plate that turns on the pin."""
    held: float
    """Play of a plate, a board or a head that holds the pin; negative for a press fit."""
    axial: float
    """Gap between a turning plate and the washer beside it."""
    toleranced: bool
    """True if holes and pins are drawn at their nominal size, with tolerances."""
    plate: float
    """Smallest default thickness of a plate."""
    washer: float
    """Smallest default gap between layers; a washer beside an empty layer fills half of it."""


FITS = {"H7": Fit("H7", 0.0, 0.0, 0.05, True, 0.0, 0.0), "print": Fit("print", 0.4, 0.1, 0.1, False, 3.0, 2.8)}
"""Fits by name. H7 draws nominal sizes and puts the tolerances into the parts list. Print draws the play: 0.4 mm lets plates turn
and 0.1 mm holds pins on common printers with a 0.4 mm nozzle."""


def tolerance(diameter: float, hole: bool) -> str:
    """Return the tolerance of a hole H7, or of a pin g6 that turns in it, as text for a drawing; empty above 500 mm."""
    for step, six, seven, off in zip(_STEPS, _IT6, _IT7, _G, strict=True):
        if 0 < diameter <= step:
            return f"H7 +{seven / 1000:g}/0" if hole else f"g6 -{off / 1000:g}/-{(off + six) / 1000:g}"
    return ""


class Manufacture(NamedTuple):
    """Materials, fit and sizes of parts; lengths in the unit of the linkage."""

    fit: Fit
    material: str
    pins: str
    thickness: float | None = None
    washer: float | None = None
    fillet: float = 0.0
    """Radius at the convex corners of the body."""
    scale: float = 1.0
    """Scale of a model."""


@dataclass(frozen=True, eq=False)
class Solid:
    """Part with the position ``at`` and the height ``up`` of its frame in the frame of body number ``body``."""

    name: str
    kind: str
    body: int
    link: str
    prism: Prism
    at: complex
    up: float
    material: str
    colour: str
    turns: str = ""
    """Plates that turn on the part, if it is a pin."""

    @property
    def volume(self) -> float:
        """Volume in cubic millimetres."""
        return self.prism.volume

    @property
    def mass(self) -> MassProperties:
        """Mass properties in kilograms and millimetres, in the frame of the body."""
        own = self.prism.mass(DENSITIES[self.material] * _CUBIC_MM)
        return own.turned(1.0 + 0j, np.array([self.at.real, self.at.imag, self.up]))


class Posed(NamedTuple):
    """Pose of a solid: rotated about z by the unit number ``turn``, then translated."""

    turn: complex
    shift: complex
    up: float


class Solids(NamedTuple):
    """All parts of a machine and its motion; ``unit`` is the built size of a unit of length in millimetres."""

    machine: Machine
    parts: tuple[Solid, ...]
    unit: float

    def posed(self, travel: float = 0.0) -> list[Posed]:
        """Return the poses of the parts at a crank angle relative to the first sample."""
        origin, direction = self.machine.movement.bodies(np.array([travel]))[:2]
        found = []
        for part in self.parts:
            turn = complex(direction[part.body, 0])
            shift = (complex(origin[part.body, 0]) + self.machine.origin) * self.unit + turn * part.at
            found.append(Posed(turn / abs(turn), shift, part.up))
        return found

    def masses(self) -> dict[str, MassProperties]:
        """Return the mass properties of each body with its parts, in its frame, in kilograms and millimetres."""
        names = self.machine.movement.names
        return {
            name: together([part.mass for part in self.parts if part.body == body]) for body, name in enumerate(names)
        }

    @property
    def thinnest_wall(self) -> tuple[float, str]:
        """Thinnest wall of all parts in millimetres, and the name of the part."""
        return min((part.prism.thinnest_wall, part.name) for part in self.parts)


def solids_of(machine: Machine, stack: Stack, manufacture: Manufacture, unit_mm: float) -> Solids:
    """Build the parts of a stack as solids, which do not overlap anywhere in the used interval if the stack is free.

    A pin is held by its first body and turns in the others. Each turning plate has a washer on either side. A washer between two
    plates fills the gap of their layers; beside an empty layer it fills half of the gap and is held by the pin, which extends
    through it. Heads are collars.

    Parameters
    ----------
    unit_mm : float
        Millimetres per unit of the machine's lengths.

    Raises
    ------
    FieldError
        If a hole leaves no material.
    """
    unit = unit_mm * manufacture.scale
    heights = _heights(machine, manufacture, unit)
    thick = heights.thickness * unit
    parts = parts_of(machine, stack, heights)
    names = machine.movement.names
    pin_radius = (machine.hole * unit - manufacture.fit.turning) / 2
    held = pin_radius + manufacture.fit.held / 2
    turning = machine.hole * unit / 2
    if not pin_radius > 0:
        raise FieldError(
            "/assembly/hole",
            f"must give holes above {manufacture.fit.turning:g} mm, the play of this fit; a hole is {2 * turning:g} mm",
        )
    carriers = {pin.name: pin.points[0].body for pin in machine.pins}
    washers = _Washers(machine, parts, heights, manufacture, unit, pin_radius, held)
    found: list[Solid] = []

    def add(part: Part, prism: Prism, at: complex, low: float, material: str, colour: str, turns: str = "") -> None:
        link = names[part.body]
        found.append(Solid(part.name, part.kind, part.body, link, prism, at * unit, low, material, colour, turns))

    for part in parts:
        low = part.z[0] * unit
        if part.kind in ("plate", "board"):
            holes = _holes(part, unit, turning, held, carriers)
            prism = Prism(_outline(part, manufacture.fillet) * np.array([unit, unit, 1.0]), 0.0, thick, holes)
            if not prism.thinnest_wall > 1e-9 * unit:
                raise FieldError(
                    "/assembly/body" if part.name == "body" else "/assembly/hole",
                    f"must leave material around every hole, but leaves none around a hole of {part.name}",
                )
            colour = COLOURS.get(names[part.body], OTHER_BODY)
            add(part, prism, 0j, low, manufacture.material, OTHER_BODY if part.name == "body" else colour)
        elif part.kind == "head":
            prism = Prism.disc(0j, part.shape.radius * unit, 0.0, thick, held)
            add(part, prism, part.shape.core[0], low, manufacture.pins, ROUND)
        else:
            low, high = washers.reach(part)
            prism = Prism.disc(0j, pin_radius, 0.0, high - low)
            add(part, prism, part.shape.core[0], low, manufacture.pins, ROUND, washers.turning_on(part))
    found += washers.solids()
    return Solids(machine, tuple(found), unit)


def _heights(machine: Machine, manufacture: Manufacture, unit: float) -> Heights:
    """Return the thicknesses in the unit of the machine; a printer needs a minimum."""
    usual = Heights.of(machine, manufacture.thickness, manufacture.washer)
    thick = (
        max(usual.thickness, manufacture.fit.plate / unit) if manufacture.thickness is None else manufacture.thickness
    )
    usual = Heights.of(machine, thick, manufacture.washer)
    return Heights(
        thick, max(usual.washer, manufacture.fit.washer / unit) if manufacture.washer is None else manufacture.washer
    )


def _outline(part: Part, fillet: float) -> Floats:
    if part.shape.radius == 0:
        return filleted(part.shape.core, fillet)
    return rounded(part.shape.core, part.shape.radius)


class _Washers:
    """Washers between and beside plates, and the ends of pins."""

    def __init__(
        self,
        machine: Machine,
        parts: Sequence[Part],
        heights: Heights,
        manufacture: Manufacture,
        unit: float,
        pin_radius: float,
        held: float,
    ) -> None:
        self.made, self.unit, self.held = manufacture, unit, held
        self.turning = machine.hole * unit / 2
        self.names = machine.movement.names
        self.gap, self.pitch = heights.washer * unit, (heights.thickness + heights.washer) * unit
        self.thick = heights.thickness * unit
        self.play = min(manufacture.fit.axial, self.gap / 8)
        # a pin can be anywhere in its slit
        apart = [a.apart(b) for part in parts for a, b in combinations(_holes(part, 1.0, 0.0, 0.0, {}), 2)]
        self.radius = min(
            HEAD * machine.hole / 2 * unit,
            machine.width / 2 * unit,
            _SIDE_BY_SIDE * min(apart, default=np.inf) * unit,
        )
        self.is_needed = self.radius - self.turning >= _LEAST_RIM * machine.hole * unit and self.gap > 0
        self.pins = {part.name: part for part in parts if part.kind == "pin"}
        self.plates: dict[str, dict[int, Part]] = {}
        """Plates, boards and heads on each pin, by layer."""
        for part in parts:
            on = (
                [*(hole.pin for hole in part.holes), *(slit.pin for slit in part.slits)]
                if part.kind != "head"
                else [part.name.split("_")[1]]
            )
            for pin in on:
                self.plates.setdefault(pin, {})[part.layers[0]] = part

    def _turns(self, pin: Part, layer: int) -> bool:
        """Return whether the plate in a layer turns on the pin."""
        part = self.plates[_pin_of(pin)].get(layer)
        return part is not None and part.kind != "head" and part.body != pin.body

    def turning_on(self, pin: Part) -> str:
        """Return the names of the plates that turn on a pin."""
        return " ".join(
            part.name for layer, part in self.plates.get(_pin_of(pin), {}).items() if self._turns(pin, layer)
        )

    def _above(self, layer: int) -> float:
        """Return the height of the upper face of a layer."""
        return (layer - 1) * self.pitch + self.thick

    def positions(self, pin: Part) -> Iterable[tuple[float, float, bool]]:
        """Yield the lower face and thickness of each washer of a pin, and whether the pin holds it."""
        if not self.is_needed:
            return
        layers = self.plates[_pin_of(pin)]
        for layer in range(min(layers) - 1, max(layers) + 1):
            below, above = layer in layers, layer + 1 in layers
            low, half = self._above(layer), self.gap / 2
            if below and above:
                if self._turns(pin, layer) or self._turns(pin, layer + 1):
                    yield low + self.play, self.gap - 2 * self.play, False
            elif below and self._turns(pin, layer):
                yield low + self.play, half - self.play, True
            elif above and self._turns(pin, layer + 1):
                yield low + half, half - self.play, True

    def reach(self, pin: Part) -> tuple[float, float]:
        """Return the lower and upper end of a pin or post, which extends through its heads and outer washers."""
        layers = self.plates[_pin_of(pin)]
        low, high = self._above(min(layers)) - self.thick, self._above(max(layers))
        if pin.kind == "pin":
            ends = [end for at, tall, holds in self.positions(pin) if holds for end in (at, at + tall)]
            low, high = min([low, *ends]), max([high, *ends])
        return low, high

    def solids_on(self, pin: Part) -> Iterable[Solid]:
        """Yield the washers of a pin, counted from below."""
        for number, (low, tall, holds) in enumerate(self.positions(pin), 1):
            prism = Prism.disc(0j, self.radius, 0.0, tall, self.held if holds else self.turning)
            at = pin.shape.core[0] * self.unit
            name = f"washer_{_pin_of(pin)}{number}"
            link = self.names[pin.body]
            yield Solid(name, "washer", pin.body, link, prism, at, low, self.made.pins, WASHER)

    def solids(self) -> list[Solid]:
        """Return all washers."""
        return [washer for pin in self.pins.values() for washer in self.solids_on(pin)]


def _holes(part: Part, unit: float, radius: float, held: float, carriers: Mapping[str, int]) -> tuple[Hole, ...]:
    """Return the holes of a plate or board, with the radius ``held`` for pins that it carries."""
    round_ = [Hole(hole.at * unit, held if carriers.get(hole.pin) == part.body else radius) for hole in part.holes]
    slits = [
        Hole((slit.first + slit.last) / 2 * unit, radius, (slit.last - slit.first) / 2 * unit) for slit in part.slits
    ]
    return (*round_, *slits)


def _pin_of(part: Part) -> str:
    """Return the name of a pin or post in the machine."""
    return part.name.split("_", 1)[1]


def parts_list(solids: Solids, fit: Fit) -> dict[str, list[object]]:
    """Return the columns of a parts list with a row for each part: lengths in millimetres, masses in grams, None if missing."""
    rows = []
    for part in solids.parts:
        prism = part.prism
        if (
            part.link == "ground" and len(prism.holes) > 1
        ):  # the ground is measured along its pins, not along the user's axes
            along = prism.holes[1].centre - prism.holes[0].centre
            prism = prism.moved(along.conjugate() / abs(along))
        low, high = prism.extent
        pin = prism.circle is not None and not prism.holes
        diameter = None if prism.circle is None else 2 * prism.circle.radius
        sizes = sorted({2 * hole.radius for hole in prism.holes})
        # a slit by its width and its length of cut
        kinds = sorted((2 * hole.radius, 2 * abs(hole.reach)) for hole in prism.holes)
        words = [f"{wide:.6g}" + (f" x {wide + long:.6g}" if long else "") for wide, long in kinds]
        holes = " + ".join(f"{words.count(word)} x {word}" for word in dict.fromkeys(words))
        nominal = diameter if pin else sizes[0] if sizes else None
        word = "" if nominal is None or not fit.toleranced else tolerance(nominal, not pin)
        rows.append(
            {
                "name": part.name,
                "kind": part.kind,
                "link": part.link,
                "material": part.material,
                "length": prism.height if pin else diameter or (high - low).real,
                "width": None if diameter is not None else (high - low).imag,
                "thickness": None if pin else prism.height,
                "diameter": diameter,
                "holes": holes or None,
                "tolerance": word or None,
                "turns_in": part.turns or None,
                "mass": 1000 * part.mass.mass,
            }
        )
    # further digits are rounding errors
    return {name: [_short(row[name]) for row in rows] for name in rows[0]}


def _short(value: object) -> object:
    return round(value, 9) if isinstance(value, float) else value


def masses_of_links(solids: Solids) -> list[Mass]:
    """Return mass, centre and inertia of each moving link, in its frame and in the user's unit, for an analysis."""
    found = []
    for name, mass in solids.masses().items():
        if name != "ground" and mass.mass > 0:
            at = complex(*mass.centre[:2].tolist()) / solids.unit - (solids.machine.body_at if name == BODY else 0j)
            found.append(Mass(name, mass.mass, at, float(mass.inertia[2, 2]) / solids.unit**2))
    return found
