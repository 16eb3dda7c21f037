"""Drives of a reply that are attached to a linkage, for its layers and its files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from linkage_atlas.arguments import one_of, pair, positive
from synthesis.drives.links import GROUND
from synthesis.errors import FieldError

_PARTS = {
    "rotary": ("motor", "", ()),
    "actuator": ("ground_point", "", ("retracted", "stroke")),
    "dyad": ("motor", "six_bar", ("crank", "coupler")),
}
"""Field of the end that is not the pin, and record and names of the lengths, for each kind of drive."""


class AttachedDrive(NamedTuple):
    """Checked ends and lengths of a drive."""

    kind: str
    link: str
    base_link: str
    """Link that carries the other end."""
    end: complex
    """Other end, motor, or pivot of a rotary drive, in the plane at the first sample."""
    pin: complex
    """Pin in the frame of its link."""
    sizes: tuple[float, float]
    """Retracted length and stroke, or motor crank and rod."""
    extends: bool


def read_attached(field: str, drive: object) -> AttachedDrive:
    """Check a drive of a reply, a record or its plain values; raise `FieldError` with the path of a wrong field."""

    def value(record: object, name: str) -> object:
        return record.get(name) if isinstance(record, Mapping) else getattr(record, name, None)

    def point(name: str) -> complex:
        return pair(f"{field}/{name}", value(drive, name), np.inf)

    kind = one_of(f"{field}/kind", value(drive, "kind"), tuple(_PARTS))
    link = value(drive, "link")
    if not isinstance(link, str):
        raise FieldError(f"/{field}/link", f"must be the name of a link; it is {link!r}")
    end_name, part, names = _PARTS[kind]
    end, pin, sizes = point(end_name), 0j if kind == "rotary" else point("pin_on_link"), []
    for name in names:
        at = f"{field}/{part}/{name}" if part else f"{field}/{name}"
        length = value(value(drive, part) if part else drive, name)
        if length is None:
            raise FieldError(f"/{at}", "is required; pass the drive unchanged from a reply")
        sizes.append(positive(at, length))
    return AttachedDrive(
        kind,
        link,
        str(value(drive, "base_link") or GROUND),
        end,
        pin,
        (sizes[0], sizes[1]) if sizes else (0.0, 0.0),
        value(drive, "extends") in (True, None),
    )
