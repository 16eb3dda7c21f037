"""Whether plates keep inside an envelope and out of boxes that are kept free, over the whole interval: proved as gaps are."""

from __future__ import annotations

from collections.abc import Sequence

from synthesis.assembly.gaps import Carried, Gaps
from synthesis.assembly.layers import Collision
from synthesis.assembly.machine import Machine
from synthesis.assembly.movement import GROUND
from synthesis.assembly.shapes import Shape
from synthesis.mechanism import Box
from synthesis.work import Work

ENVELOPE = "envelope"


def outside(machine: Machine, envelope: Box | None, keep_out: Sequence[Box], work: Work) -> list[Collision]:
    """Where plates leave the envelope, or enter a box; boxes in the user's plane, named envelope, keep_out 1, keep_out 2, ...

    To 1e-5 of the machine's size. Law: with plates of no width these are the places where the lines of the links do so.
    """
    if envelope is None and not keep_out:
        return []
    walls: list[tuple[str, Shape]] = [
        (f"keep_out {number}", _shape(box, machine)) for number, box in enumerate(keep_out, 1)
    ]
    if envelope is not None:
        left, low, right, high = envelope
        # farther than any plate is from the ground's origin, or the envelope
        far = 4 * (machine.size + max(abs(end) for end in envelope) + abs(machine.origin) + machine.width)
        far += 4 * sum(plate.shape.reach for plate in machine.plates)
        sides = (
            (left - far, low - far, left, high + far),
            (right, low - far, right + far, high + far),
            (left - far, low - far, right + far, low),
            (left - far, high, right + far, high + far),
        )
        walls += [(ENVELOPE, _shape(side, machine)) for side in sides]
    shapes = [Carried(plate.body, plate.shape) for plate in machine.plates]
    plates = len(shapes)
    shapes += [Carried(GROUND, shape) for _, shape in walls]
    pairs = [(k, plates + n) for k in range(plates) for n in range(len(walls))]
    gaps = Gaps(machine.movement, shapes, pairs, machine.clearance, machine.size, rough=True)
    proofs = gaps.prove(machine.used, work)
    found = [
        Collision((walls[n - plates][0], machine.plates[k].name), *run)
        for (k, n), proof in zip(pairs, proofs)
        for run in proof.hits
    ]
    return sorted(found, key=lambda one: (one.first, one.last, one.pair))


def _shape(box: Box, machine: Machine) -> Shape:
    """A box in the ground's frame; walls need no clearance, which is therefore taken off."""
    left, low, right, high = box
    corners = complex(left, low), complex(right, low), complex(right, high), complex(left, high)
    return Shape(tuple(z - machine.origin for z in corners), -machine.clearance)
