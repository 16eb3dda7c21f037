"""Parts of an arrangement: plates, pins, posts, heads and boards as flat outlines between two heights, each on a body.

The z axis rises with the layers; layer 1 begins at z = 0. An outline is a `Shape` in the frame of the body that carries it.
`synthesis.assembly.movement.Movement.bodies` gives the position of this frame at a crank angle, ``origin + direction * z``,
measured from `Machine.origin` in the user's plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

from synthesis.assembly.machine import Hole, Machine
from synthesis.assembly.movement import GROUND
from synthesis.assembly.shapes import Shape, disc, hull
from synthesis.assembly.stacks import HEAD, Stack

PartKind = Literal["plate", "pin", "post", "head", "board"]


@dataclass(frozen=True)
class Part:
    """A part of constant thickness."""

    name: str
    """A plate's own name (crank, coupler, rocker, body, bar), or pin_D, post_P, head_D_below, board_below."""
    kind: PartKind
    body: int
    """Index of the body that carries the part, in `synthesis.assembly.movement.Movement`; a pin moves with the first of its
    bodies."""
    shape: Shape
    holes: tuple[Hole, ...]
    """Holes and slits of plates and boards; they are as wide as the machine's holes."""
    layers: tuple[int, int]
    """Lowest and highest layer that the part fills; 0 is the board below."""
    z: tuple[float, float]
    """Heights of the lower and the upper face."""
    pin: str = ""
    """Name of the pin or post that the part is or that its head belongs to."""


class Heights(NamedTuple):
    """Thickness of the plates and of the washers between two layers, in the unit of the lengths."""

    thickness: float
    washer: float

    def z(self, low: int, high: int) -> tuple[float, float]:
        """Return the heights of the faces of a part that fills the layers from ``low`` to ``high``."""
        step = self.thickness + self.washer
        return (low - 1) * step, (high - 1) * step + self.thickness


def parts_of(machine: Machine, stack: Stack, heights: Heights) -> list[Part]:
    """Return the parts of a stack: plates, then pins and posts, heads and boards.

    In a free stack no two parts in a common layer come closer than the clearance, except a plate and its own pin.
    """
    found: list[Part] = []

    def add(
        name: str,
        kind: PartKind,
        body: int,
        shape: Shape,
        holes: tuple[Hole, ...],
        low: int,
        high: int,
        pin: str = "",
    ) -> None:
        found.append(Part(name, kind, body, shape, holes, (low, high), heights.z(low, high), pin))

    for plate in machine.plates:
        layer = stack.layers[plate.name]
        add(plate.name, "plate", plate.body, plate.shape, plate.holes, layer, layer)
    pins = {pin.name: pin for pin in machine.pins}
    for name, (low, high) in stack.pins.items():
        kind: PartKind = "post" if pins[name].post else "pin"
        body, at = pins[name].points[0]
        add(f"{kind}_{name}", kind, body, disc(at, pins[name].radius), (), low, high, name)
    for name, end, layer in stack.heads:
        body, at = pins[name].points[0]
        add(f"head_{name}_{end}", "head", body, disc(at, HEAD * pins[name].radius), (), layer, layer, name)
    grounded = [pin for pin in machine.pins if pin.grounded]
    outline = Shape(hull([pin.points[0].at for pin in grounded]), machine.width / 2)
    for end, layer in (("below", 0), ("above", stack.count + 1)):
        held = [pin for pin in grounded if end in stack.mounts.get(pin.name, "").split("+")]
        holes = tuple(Hole((pin.points[0].at,), pin.name) for pin in held)
        if holes:
            add(f"board_{end}", "board", GROUND, outline, holes, layer, layer)
    return found
