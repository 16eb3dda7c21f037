"""The parts of an assembly: plates, pins, posts, heads and boards, each a flat outline between two heights on one body.

The z axis rises with the layers; layer 1 begins at z = 0. An outline is a `Shape` in the frame of the body that carries it. Where
that frame is at a crank angle, `Movement.bodies` says: ``origin + direction * z``, from `Machine.origin` in the user's plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

from synthesis.assembly.layers import HEAD, Stack
from synthesis.assembly.machine import Hole, Machine, Pin, Slit
from synthesis.assembly.movement import GROUND
from synthesis.assembly.shapes import Shape, disc, hull

THICKNESS = 0.5
"""The default thickness of a plate, in diameters of its holes."""
WASHER = 0.2
"""The default thickness of the washers between two layers, in thicknesses of a plate."""


@dataclass(frozen=True)
class Part:
    """A part of one thickness.

    ``name``: of a plate its own (crank, coupler, rocker, body, bar); pin_D, post_P, head_D_below, board_below. ``body``: number
    of the body that carries it, in `Movement.names`; a pin goes with the first body that it belongs to. ``holes``: of plates and
    boards, with the pin that each is for; their diameter is that of the machine's holes, and so is the width of ``slits``.
    ``layers``: the lowest and the highest that it fills, 0 the board below. ``z``: its lower and upper face.
    """

    name: str
    kind: Literal["plate", "pin", "post", "head", "board"]
    body: int
    shape: Shape
    holes: tuple[Hole, ...]
    layers: tuple[int, int]
    z: tuple[float, float]
    slits: tuple[Slit, ...] = ()


class Heights(NamedTuple):
    """Thickness of the plates, and of the washers that keep two layers apart; both in the unit of the lengths."""

    thickness: float
    washer: float

    @classmethod
    def of(cls, machine: Machine, thickness: float | None = None, washer: float | None = None) -> Heights:
        """With the defaults for what is not given."""
        thick = THICKNESS * machine.hole if thickness is None else thickness
        return cls(thick, WASHER * thick if washer is None else washer)

    def z(self, low: int, high: int) -> tuple[float, float]:
        """The faces of what fills layers ``low`` to ``high``."""
        step = self.thickness + self.washer
        return (low - 1) * step, (high - 1) * step + self.thickness


def parts_of(machine: Machine, stack: Stack, heights: Heights) -> list[Part]:
    """The parts of a stack: plates, then pins and posts, heads and boards.

    Law: no two parts that fill a common layer and do not touch by design (a plate and its own pin) come nearer than the
    clearance, where the stack is free.
    """
    found = [
        Part(one.name, "plate", one.body, one.shape, one.holes, (layer, layer), heights.z(layer, layer), one.slits)
        for one in machine.plates
        for layer in (stack.layers[one.name],)
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
    outline = Shape(hull([pin.places[0].at for pin in grounded]), machine.width / 2)
    for name, layer in (("below", 0), ("above", stack.count + 1)):
        holes = tuple(
            Hole(pin.places[0].at, pin.name) for pin in grounded if name in stack.mounts.get(pin.name, "").split("+")
        )
        if holes:
            found.append(
                Part(f"board_{name}", "board", GROUND, outline, holes, (layer, layer), heights.z(layer, layer))
            )
    return found


def _round(
    name: str, kind: Literal["pin", "post", "head"], pin: Pin, radius: float, low: int, high: int, heights: Heights
) -> Part:
    body, at = pin.places[0]
    return Part(name, kind, body, disc(at, radius), (), (low, high), heights.z(low, high))
