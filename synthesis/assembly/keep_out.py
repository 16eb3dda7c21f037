"""Collisions of plates with an envelope and with boxes that must stay free."""

from __future__ import annotations

from collections.abc import Sequence

from synthesis.assembly.gaps import CarriedShape, GapOptions, Gaps
from synthesis.assembly.machine import Machine
from synthesis.assembly.movement import GROUND
from synthesis.assembly.shapes import Shape
from synthesis.assembly.stacks import Collision
from synthesis.mechanism import Box
from synthesis.work import Work

ENVELOPE = "envelope"
ROUGH = GapOptions(resolution=1e-5, collision=1e-2, root_steps=12)
"""Options of the proof, which is only as exact as an envelope needs to be."""


def outside(machine: Machine, envelope: Box | None, keep_out: Sequence[Box], work: Work) -> list[Collision]:
    """Return the ranges in which plates leave the envelope or enter a box, up to 1e-5 of the machine's size.

    Parameters
    ----------
    machine : Machine
    envelope : Box or None
        Box in the user's plane that all plates must stay in.
    keep_out : sequence of Box
        Boxes that no plate may enter; their names are keep_out 1, keep_out 2, ...
    work : Work
    """
    if envelope is None and not keep_out:
        return []
    walls: list[tuple[str, Shape]] = [
        (f"keep_out {number}", _wall(box, machine)) for number, box in enumerate(keep_out, 1)
    ]
    if envelope is not None:
        left, low, right, high = envelope
        # farther than any plate is from the ground's origin, or the envelope
        margin = 4 * (machine.size + max(abs(end) for end in envelope) + abs(machine.origin) + machine.width)
        margin += 4 * sum(plate.shape.reach for plate in machine.plates)
        sides = (
            (left - margin, low - margin, left, high + margin),
            (right, low - margin, right + margin, high + margin),
            (left - margin, low - margin, right + margin, low),
            (left - margin, high, right + margin, high + margin),
        )
        walls += [(ENVELOPE, _wall(side, machine)) for side in sides]
    names = [(name, plate.name) for plate in machine.plates for name, _ in walls]
    pairs = [
        (CarriedShape(plate.body, plate.shape), CarriedShape(GROUND, wall))
        for plate in machine.plates
        for _, wall in walls
    ]
    gaps = Gaps(machine.movement, pairs, machine.clearance, machine.size, ROUGH)
    proofs = gaps.prove(machine.used, work)
    found = [Collision(pair, *run) for pair, proof in zip(names, proofs) for run in proof.hits]
    return sorted(found, key=lambda collision: (collision.first, collision.last, collision.pair))


def _wall(box: Box, machine: Machine) -> Shape:
    """Return a box in the ground's frame; a wall needs no clearance, which is therefore subtracted."""
    left, low, right, high = box
    corners = complex(left, low), complex(right, low), complex(right, high), complex(left, high)
    return Shape(tuple(z - machine.origin for z in corners), -machine.clearance)
