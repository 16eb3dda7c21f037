"""Kinds of files with their media types and endings."""

from __future__ import annotations

from typing import NamedTuple

from synthesis.errors import FieldError


class Format(NamedTuple):
    """Media type of a file and endings of its name: the first is used in routes, the last in names of files that are sent."""

    media_type: str
    endings: tuple[str, ...]


FORMATS = {
    "parts": Format("text/csv; charset=utf-8", ("parts.csv",)),
    "csv": Format("text/csv; charset=utf-8", ("csv",)),
    "svg": Format("image/svg+xml", ("svg",)),
    "plates": Format("image/vnd.dxf", ("plates.dxf",)),
    "dxf": Format("image/vnd.dxf", ("dxf",)),
    "mjcf": Format("application/xml", ("mjcf", "xml")),
    "step": Format("model/step", ("step",)),
    "3mf": Format("model/3mf", ("3mf",)),
    "stl": Format("application/zip", ("stl.zip",)),
}
"""Kinds of files; of two whose ending fits the first."""
OF_PARTS = ("step", "3mf", "stl", "parts")
"""Kinds that are written from solid parts."""
HELD = {**dict.fromkeys(("assembly", "solids"), (*OF_PARTS, "plates", "mjcf")), "drive": ("csv", "svg", "dxf")}
"""Kinds of files that can hold more than a linkage."""


def kind_of(name: str) -> str:
    """Return the kind of a file from its name."""
    for kind, known in FORMATS.items():
        if name.lower().endswith(tuple(f".{ending}" for ending in known.endings)):
            return kind
    endings = ", ".join(ending for known in FORMATS.values() for ending in known.endings)
    raise FieldError("/path", f"the file must end in one of {endings}, found {name!r}")
