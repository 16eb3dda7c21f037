"""A linkage as a file: the formats there are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from synthesis.errors import FieldError

if TYPE_CHECKING:
    from synthesis.fourbar.linkage import Linkage
    from synthesis.guided.linkage import GuidedLinkage
    from synthesis.target import Target


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


def kind_of(name: str) -> str:
    """The kind that the name of a file means."""
    for kind, known in FORMATS.items():
        if name.lower().endswith(tuple(f".{ending}" for ending in known.endings)):
            return kind
    endings = ", ".join(ending for known in FORMATS.values() for ending in known.endings)
    raise FieldError("/path", f"the file must end in one of {endings}, found {name!r}")


def content_of(
    linkage: Linkage,
    target: Target,
    radian: float,
    kind: str,
    length_unit: str,
    analysis: Mapping[str, Any] | None,
    plates: Mapping[str, Any] | None,
    parts: Callable[[bool], Any],
    arranged: bool,
) -> bytes:
    """The content of a file; see `FourBar.file` for what the arguments mean.

    ``parts``: makes the `SolidParts`, with an error where they collide, or (True) nevertheless.
    ``arranged``: plates are those of an assembly, not the links alone.
    """
    from linkage_atlas.motions import MILLIMETRES
    from linkage_atlas.studies import analysed, read_drive
    from synthesis.fourbar import files
    from synthesis.fourbar.analysis import LinkMass

    if kind not in FORMATS:
        raise FieldError("/kind", f"wanted one of {', '.join(FORMATS)}, found {kind!r}")
    if kind == "csv":
        drive = None if analysis is None else read_drive(analysis, linkage.mounted)
        more = None if drive is None else analysed(linkage, drive, target.crank, radian).columns()
        return files.to_csv(linkage, target, radian, more).encode()
    if kind in ("svg", "pylinkage"):
        return (files.to_svg if kind == "svg" else files.to_pylinkage)(linkage, target).encode()
    if length_unit not in MILLIMETRES:
        raise FieldError("/length_unit", f"wanted one of {', '.join(MILLIMETRES)}, found {length_unit!r}")
    unit_mm = MILLIMETRES[length_unit]
    if kind in OF_PARTS:
        return parts(False).file(kind)
    if kind == "plates":
        if arranged and plates:
            raise FieldError("/plates", "with `assembly` or `solids` sizes stand there: `hole` and `width`")
        from synthesis.solids.plates import to_plates

        return parts(False).file(kind) if arranged else to_plates(linkage, unit_mm, **_sizes(plates or {})).encode()
    if kind == "dxf":
        return files.to_dxf(linkage, target, unit_mm).encode()
    try:
        masses = {one.link: LinkMass(one.mass, complex(*one.at), one.inertia) for one in parts(True).masses}
    except FieldError:
        masses = None  # no plates of these sizes: the file says that its links are rods
    return files.to_mjcf(linkage, target, unit_mm, masses).encode()


_FOUR_BARS_ONLY = {
    "plates": "links are cut as plates for four-bars only: rails and slots are not drawn as plates",
    "pylinkage": "pylinkage has no guides that move or slots in a moving body: this linkage cannot be written for it",
}


def guided_text(
    linkage: GuidedLinkage,
    target: Target,
    radian: float,
    kind: str,
    length_unit: str,
    analysis: Mapping[str, Any] | None,
) -> str:
    """The text of a file of a body on two guides, rails and slots among them."""
    from linkage_atlas.guided_studies import analysed
    from linkage_atlas.motions import MILLIMETRES
    from linkage_atlas.studies import read_drive
    from synthesis.guided import files

    if kind not in FORMATS:
        raise FieldError("/kind", f"wanted one of {', '.join(FORMATS)}, found {kind!r}")
    if kind in _FOUR_BARS_ONLY:
        raise FieldError("/format", _FOUR_BARS_ONLY[kind])
    if kind == "csv":
        drive = None if analysis is None else read_drive(analysis, True)
        more = None if drive is None else analysed(linkage, drive, target.crank, radian).columns()
        return files.to_csv(linkage, target, radian, more)
    if kind == "svg":
        return files.to_svg(linkage, target)
    if kind not in ("dxf", "mjcf"):
        raise FieldError("/format", f"{kind!r} is written for four-bars only")
    if length_unit not in MILLIMETRES:
        raise FieldError("/length_unit", f"wanted one of {', '.join(MILLIMETRES)}, found {length_unit!r}")
    return (files.to_dxf if kind == "dxf" else files.to_mjcf)(linkage, target, MILLIMETRES[length_unit])


def _sizes(plates: Mapping[str, Any]) -> dict[str, float]:
    from linkage_atlas.motions import number

    for name in plates:
        if name not in ("hole", "width"):
            raise FieldError.no_such("/plates", name, ("hole", "width"), "size")
    return {name: number(f"plates/{name}", value) for name, value in plates.items() if value is not None}
