"""Drives of a reply that are attached to a linkage, for its layers and its files."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from linkage_atlas.arguments import one_of, pair, positive
from synthesis.drives.attached import DriveEnds
from synthesis.drives.links import GROUND
from synthesis.errors import FieldError

_PARTS = {
    "rotary": ("motor", "", ()),
    "actuator": ("ground_point", "", ("retracted", "stroke")),
    "dyad": ("motor", "six_bar", ("crank", "coupler")),
}
"""Field of the end that is not the pin, and record and names of the lengths, for each kind of drive."""


def read_attached(field: str, drive: object) -> DriveEnds:
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
    both = (sizes[0], sizes[1]) if sizes else (0.0, 0.0)
    return DriveEnds(kind, link, str(value(drive, "base_link") or GROUND), end, pin, both)
