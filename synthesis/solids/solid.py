"""Solid parts of an assembly: names, positions, materials, fits and washers.

Each solid has its own frame: the frame of its body, moved to the centre of a round part, with the lower face at height 0.
Lengths are in millimetres, masses in kilograms.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from synthesis.assembly.machine import Machine
from synthesis.assembly.parts import Heights, Part, parts_of
from synthesis.assembly.shapes import Shape
from synthesis.assembly.stacks import HEAD, Stack
from synthesis.errors import FieldError
from synthesis.link_motion import Mass
from synthesis.linkage import BODY
from synthesis.solids.prism import MassProperties, Prism, material_between, together

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
    heights: Heights


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
        return self.prism.mass(DENSITIES[self.material] * _CUBIC_MM, self.at, self.up)


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


def solids_of(machine: Machine, stack: Stack, manufacture: Manufacture, unit: float) -> Solids:
    """Build the parts of a stack as solids, which do not overlap anywhere in the used interval if the stack is free.

    A pin is held by its first body and turns in the others. Each turning plate has a washer on either side. A washer between two
    plates fills the gap of their layers; beside an empty layer it fills half of the gap and is held by the pin, which extends
    through it. Heads are collars.

    Parameters
    ----------
    unit : float
        Millimetres per unit of the machine's lengths, as built.

    Raises
    ------
    FieldError
        If a hole leaves no material.
    """
    play = manufacture.fit.turning
    if not machine.hole * unit > play:
        raise FieldError(
            "/assembly/hole",
            f"must give holes above {play:g} mm, the play of this fit; a hole is {machine.hole * unit:g} mm",
        )
    return Solids(machine, tuple(_Workshop(machine, stack, manufacture, unit).solids()), unit)


class _Workshop:
    """Makes the parts of a stack in millimetres."""

    def __init__(self, machine: Machine, stack: Stack, manufacture: Manufacture, unit: float) -> None:
        self.machine, self.made, self.unit = machine, manufacture, unit
        fit, heights = manufacture.fit, manufacture.heights
        self.parts = parts_of(machine, stack, heights)
        self.turning = machine.hole * unit / 2
        self.pin_radius = self.turning - fit.turning / 2
        self.held = self.pin_radius + fit.held / 2
        self.thick, self.gap = heights.thickness * unit, heights.washer * unit
        self.play = min(fit.axial, self.gap / 8)
        self.carriers = {pin.name: pin.points[0].body for pin in machine.pins}
        # a pin can be anywhere in its slit
        cores = [[Shape(hole.core, 0.0) for hole in part.holes] for part in self.parts]
        apart = [material_between(*pair) for holes in cores for pair in combinations(holes, 2)]
        self.washer_radius = unit * min(
            HEAD * machine.hole / 2, machine.width / 2, _SIDE_BY_SIDE * min(apart, default=np.inf)
        )
        self.plates: dict[str, dict[int, Part]] = {}
        """Plates, boards and heads on each pin, by layer."""
        for part in self.parts:
            for name in [part.pin] if part.kind == "head" else [hole.pin for hole in part.holes]:
                self.plates.setdefault(name, {})[part.layers[0]] = part

    def solids(self) -> list[Solid]:
        """Return all parts; the washers of a pin are counted from below."""
        found, washers = [], []
        for part in self.parts:
            low = part.z[0] * self.unit
            if part.kind in ("plate", "board"):
                own = part.name == "body"
                colour = OTHER_BODY if own else COLOURS.get(self.machine.movement.names[part.body], OTHER_BODY)
                found.append(self._solid(part, self._plate(part), low, self.made.material, colour))
            elif part.kind == "head":
                prism = Prism.disc(part.shape.radius * self.unit, self.thick, self.held)
                found.append(self._solid(part, prism, low, self.made.pins, ROUND))
            else:
                rings = list(self._washers(part)) if part.kind == "pin" else []
                layers = self.plates[part.pin]
                ends = [self._below(min(layers)), self._below(max(layers)) + self.thick]
                ends += [end for at, tall, is_held in rings if is_held for end in (at, at + tall)]
                turns = " ".join(plate.name for layer, plate in layers.items() if self._turns(part, layer))
                pin = Prism.disc(self.pin_radius, max(ends) - min(ends))
                found.append(replace(self._solid(part, pin, min(ends), self.made.pins, ROUND), turns=turns))
                for number, (at, tall, is_held) in enumerate(rings, 1):
                    ring = Prism.disc(self.washer_radius, tall, self.held if is_held else self.turning)
                    washer = self._solid(part, ring, at, self.made.pins, WASHER)
                    washers.append(replace(washer, name=f"washer_{part.pin}{number}", kind="washer"))
        return found + washers

    def _solid(self, part: Part, prism: Prism, low: float, material: str, colour: str) -> Solid:
        link = self.machine.movement.names[part.body]
        at = part.shape.core[0] * self.unit if part.pin else 0j
        return Solid(part.name, part.kind, part.body, link, prism, at, low, material, colour)

    def _plate(self, part: Part) -> Prism:
        """Return a plate or board, with play around pins that it does not carry."""
        radii = [self.held if self.carriers.get(hole.pin) == part.body else self.turning for hole in part.holes]
        holes = [Shape(hole.core, 0.0).times(self.unit).grown(radius) for hole, radius in zip(part.holes, radii)]
        prism = Prism(part.shape.times(self.unit), self.thick, tuple(holes))
        if not prism.thinnest_wall > 1e-9 * self.unit:
            raise FieldError(
                "/assembly/body" if part.name == "body" else "/assembly/hole",
                f"must leave material around every hole, but leaves none around a hole of {part.name}",
            )
        return prism

    def _turns(self, pin: Part, layer: int) -> bool:
        """Return whether the plate in a layer turns on the pin."""
        part = self.plates[pin.pin].get(layer)
        return part is not None and part.kind != "head" and part.body != pin.body

    def _below(self, layer: int) -> float:
        """Return the height of the lower face of a layer."""
        return (layer - 1) * (self.thick + self.gap)

    def _washers(self, pin: Part) -> Iterable[tuple[float, float, bool]]:
        """Yield the lower face and thickness of each washer of a pin, and whether the pin holds it."""
        if self.washer_radius - self.turning < 2 * _LEAST_RIM * self.turning or not self.gap > 0:
            return
        layers, half = self.plates[pin.pin], self.gap / 2
        for layer in range(min(layers) - 1, max(layers) + 1):
            below, above = layer in layers, layer + 1 in layers
            low, turns = self._below(layer) + self.thick, (self._turns(pin, layer), self._turns(pin, layer + 1))
            if below and above and any(turns):
                yield low + self.play, self.gap - 2 * self.play, False
            elif not above and turns[0]:
                yield low + self.play, half - self.play, True
            elif not below and turns[1]:
                yield low + half, half - self.play, True


def parts_list(solids: Solids, fit: Fit) -> dict[str, list[object]]:
    """Return the columns of a parts list with a row for each part: lengths in millimetres, masses in grams, None if missing."""
    rows = []
    for part in solids.parts:
        prism, shape, holes = part.prism, part.prism.shape, part.prism.holes
        if part.link == "ground" and len(holes) > 1:
            # the ground is measured along its pins, not along the user's axes
            along = holes[1].core[0] - holes[0].core[0]
            shape = shape.times(along.conjugate() / abs(along))
        low, high = shape.extent
        diameter, pin = prism.diameter, prism.diameter is not None and not holes
        # a slit by its width and its length of cut
        kinds = sorted((2 * hole.radius, abs(hole.core[-1] - hole.core[0])) for hole in holes)
        words = [f"{wide:.6g}" + (f" x {wide + long:.6g}" if long else "") for wide, long in kinds]
        nominal = diameter if pin else kinds[0][0] if kinds else None
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
                "holes": " + ".join(f"{words.count(word)} x {word}" for word in dict.fromkeys(words)) or None,
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
