"""Parts of an arrangement: plates, pins, posts, heads and boards as flat outlines between two heights, each on a body.

The z axis rises with the layers; layer 1 begins at z = 0. An outline is a `Shape` in the frame of the body that carries it.
`synthesis.assembly.movement.Movement.bodies` gives the position of this frame at a crank angle, ``origin + direction * z``,
measured from `Machine.origin` in the user's plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

from synthesis.assembly.machine import Hole, Machine, Pin, Slit
from synthesis.assembly.movement import GROUND
from synthesis.assembly.shapes import Shape, disc, hull
from synthesis.assembly.stacks import HEAD, Stack

THICKNESS = 0.5
"""Default thickness of a plate, in diameters of its holes."""
WASHER = 0.2
"""Default thickness of the washers between two layers, in thicknesses of a plate."""


@dataclass(frozen=True)
class Part:
    """A part of constant thickness."""

    name: str
    """A plate's own name (crank, coupler, rocker, body, bar), or pin_D, post_P, head_D_below, board_below."""
    kind: Literal["plate", "pin", "post", "head", "board"]
    body: int
    """Index of the body that carries the part, in `synthesis.assembly.movement.Movement`; a pin moves with the first of its
    bodies."""
    shape: Shape
    holes: tuple[Hole, ...]
    """Holes of plates and boards; they have the diameter of the machine's holes, which is also the width of slits."""
    layers: tuple[int, int]
    """Lowest and highest layer that the part fills; 0 is the board below."""
    z: tuple[float, float]
    """Heights of the lower and the upper face."""
    slits: tuple[Slit, ...] = ()


class Heights(NamedTuple):
    """Thickness of the plates and of the washers between two layers, in the unit of the lengths."""

    thickness: float
    washer: float

    @classmethod
    def of(cls, machine: Machine, thickness: float | None = None, washer: float | None = None) -> Heights:
        """Return the heights, with defaults for missing values."""
        thick = THICKNESS * machine.hole if thickness is None else thickness
        return cls(thick, WASHER * thick if washer is None else washer)

    def z(self, low: int, high: int) -> tuple[float, float]:
        """Return the heights of the faces of a part that fills the layers from ``low`` to ``high``."""
        step = self.thickness + self.washer
        return (low - 1) * step, (high - 1) * step + self.thickness


def parts_of(machine: Machine, stack: Stack, heights: Heights) -> list[Part]:
    """Return the parts of a stack: plates, then pins and posts, heads and boards.

    In a free stack no two parts in a common layer come closer than the clearance, except a plate and its own pin.
    """
    found = [
        Part(
            plate.name,
            "plate",
            plate.body,
            plate.shape,
            plate.holes,
            (layer, layer),
            heights.z(layer, layer),
            plate.slits,
        )
        for plate in machine.plates
        for layer in (stack.layers[plate.name],)
    ]
    pins = {pin.name: pin for pin in machine.pins}
    for name, (low, high) in stack.pins.items():
        pin, kind = pins[name], "post" if pins[name].post else "pin"
        found.append(_round(f"{kind}_{name}", kind, pin, pin.radius, low, high, heights))  # type: ignore[arg-type]
    for name, end, layer in stack.heads:
        found.append(
            _round(f"head_{name}_{end}", "head", pins[name], HEAD * pins[name].radius, layer, layer, heights)
        )
    grounded = [pin for pin in machine.pins if pin.grounded]
    outline = Shape(hull([pin.points[0].at for pin in grounded]), machine.width / 2)
    for name, layer in (("below", 0), ("above", stack.count + 1)):
        holes = tuple(
            Hole(pin.points[0].at, pin.name) for pin in grounded if name in stack.mounts.get(pin.name, "").split("+")
        )
        if holes:
            found.append(
                Part(f"board_{name}", "board", GROUND, outline, holes, (layer, layer), heights.z(layer, layer))
            )
    return found


def _round(
    name: str, kind: Literal["pin", "post", "head"], pin: Pin, radius: float, low: int, high: int, heights: Heights
) -> Part:
    body, at = pin.points[0]
    return Part(name, kind, body, disc(at, radius), (), (low, high), heights.z(low, high))
