"""A linkage as the text of a file: the formats there are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from synthesis.errors import FieldError

if TYPE_CHECKING:
    from synthesis.fourbar.linkage import Linkage
    from synthesis.guided.linkage import GuidedLinkage
    from synthesis.target import Target

MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
"""Units of length that DXF and MJCF files are written from."""


class Format(NamedTuple):
    """How a file is declared over HTTP, and how its name may end: first as in the name of a route, last as it is sent."""

    media_type: str
    endings: tuple[str, ...]


FORMATS = {
    "csv": Format("text/csv; charset=utf-8", ("csv",)),
    "svg": Format("image/svg+xml", ("svg",)),
    "plates": Format("image/vnd.dxf", ("plates.dxf",)),
    "dxf": Format("image/vnd.dxf", ("dxf",)),
    "mjcf": Format("application/xml", ("mjcf", "xml")),
    "pylinkage": Format("application/json", ("pylinkage.json",)),
}
"""Kinds of files; of two whose ending fits the first."""


def kind_of(name: str) -> str:
    """The kind that the name of a file means."""
    for kind, known in FORMATS.items():
        if name.lower().endswith(tuple(f".{ending}" for ending in known.endings)):
            return kind
    endings = ", ".join(ending for known in FORMATS.values() for ending in known.endings)
    raise FieldError("/path", f"the file must end in one of {endings}, found {name!r}")


def text_of(
    linkage: Linkage | GuidedLinkage,
    target: Target,
    radian: float,
    kind: str,
    length_unit: str,
    analysis: Mapping[str, Any] | None,
    plates: Mapping[str, Any] | None,
) -> str:
    """The text of a file; see `FourBar.render` for what the arguments mean."""
    from linkage_atlas.studies import analysed, read_drive
    from synthesis.fourbar import files
    from synthesis.fourbar.linkage import Linkage

    if kind not in FORMATS:
        raise FieldError("/kind", f"wanted one of {', '.join(FORMATS)}, found {kind!r}")
    if not isinstance(linkage, Linkage):
        return _guided_text(linkage, target, radian, kind, length_unit, analysis)
    if kind == "csv":
        drive = None if analysis is None else read_drive(analysis, linkage.mounted)
        more = None if drive is None else analysed(linkage, drive, target.crank, radian).columns()
        return files.to_csv(linkage, target, radian, more)
    if kind in ("svg", "pylinkage"):
        return (files.to_svg if kind == "svg" else files.to_pylinkage)(linkage, target)
    if length_unit not in MILLIMETRES:
        raise FieldError("/length_unit", f"wanted one of {', '.join(MILLIMETRES)}, found {length_unit!r}")
    unit_mm = MILLIMETRES[length_unit]
    if kind == "plates":
        return files.to_plates(linkage, unit_mm, **_sizes(plates or {}))
    return (files.to_dxf if kind == "dxf" else files.to_mjcf)(linkage, target, unit_mm)


_FOUR_BARS_ONLY = {
    "plates": "links are cut as plates for four-bars only: rails and slots are not drawn as plates",
    "pylinkage": "pylinkage has no guides that move or slots in a moving body: this linkage cannot be written for it",
}


def _guided_text(
    linkage: GuidedLinkage,
    target: Target,
    radian: float,
    kind: str,
    length_unit: str,
    analysis: Mapping[str, Any] | None,
) -> str:
    """The same of a body on two guides, rails and slots among them."""
    from linkage_atlas.guided_studies import analysed
    from linkage_atlas.studies import read_drive
    from synthesis.guided import files

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
