"""Kinds of files: how each is declared over HTTP, and how its name ends."""

from __future__ import annotations

from typing import NamedTuple

from synthesis.errors import FieldError


class Format(NamedTuple):
    """How a file is declared over HTTP, and how its name may end: first as in the name of a route, last as it is sent."""

    media_type: str
    endings: tuple[str, ...]


FORMATS = {
    "parts": Format("text/csv; charset=utf-8", ("parts.csv",)),
    "csv": Format("text/csv; charset=utf-8", ("csv",)),
    "svg": Format("image/svg+xml", ("svg",)),
    "plates": Format("image/vnd.dxf", ("plates.dxf",)),
    "dxf": Format("image/vnd.dxf", ("dxf",)),
    "mjcf": Format("application/xml", ("mjcf", "xml")),
    "pylinkage": Format("application/json", ("pylinkage.json",)),
    "step": Format("model/step", ("step",)),
    "3mf": Format("model/3mf", ("3mf",)),
    "stl": Format("application/zip", ("stl.zip",)),
    "urdf": Format("application/xml", ("urdf",)),
    "sdf": Format("application/xml", ("sdf",)),
}
"""Kinds of files; of two whose ending fits the first."""
OF_PARTS = ("step", "3mf", "stl", "urdf", "sdf", "parts")
"""Kinds that are written from solid parts."""
HELD = {
    **dict.fromkeys(("assembly", "solids"), (*OF_PARTS, "plates", "mjcf")),
    "drive": ("csv", "svg", "dxf", "mjcf"),
}
"""Kinds that hold what may be asked for beside a linkage."""


def kind_of(name: str) -> str:
    """The kind that the name of a file means."""
    for kind, known in FORMATS.items():
        if name.lower().endswith(tuple(f".{ending}" for ending in known.endings)):
            return kind
    endings = ", ".join(ending for known in FORMATS.values() for ending in known.endings)
    raise FieldError("/path", f"the file must end in one of {endings}, found {name!r}")
