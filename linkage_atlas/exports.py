"""A linkage as the text of a file: the kinds there are, by the endings of files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from linkage_atlas.motions import number
from linkage_atlas.studies import analysed, read_drive
from synthesis.errors import FieldError
from synthesis.fourbar import drawing, files
from synthesis.fourbar.linkage import Linkage
from synthesis.fourbar.plates import to_plates
from synthesis.target import Target

MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
"""Units of length that DXF and MJCF files are written from."""
ENDINGS = {
    "csv": "csv",
    "svg": "svg",
    "plates.dxf": "plates",
    "dxf": "dxf",
    "mjcf": "mjcf",
    "xml": "mjcf",
    "pylinkage.json": "pylinkage",
}
"""Endings of files and the kinds that they mean; of two that fit the first."""
KINDS = tuple(dict.fromkeys(ENDINGS.values()))


def kind_of(name: str) -> str:
    """The kind that the name of a file means."""
    for ending, kind in ENDINGS.items():
        if name.lower().endswith(f".{ending}"):
            return kind
    raise FieldError("/path", f"the file must end in one of {', '.join(ENDINGS)}, found {name!r}")


def text_of(
    linkage: Linkage,
    target: Target,
    radian: float,
    kind: str,
    length_unit: str,
    analysis: Mapping[str, Any] | None,
    plates: Mapping[str, Any] | None,
) -> str:
    """The text of a file; see `FourBar.render` for what the arguments mean."""
    if kind not in KINDS:
        raise FieldError("/kind", f"wanted one of {', '.join(KINDS)}, found {kind!r}")
    if kind == "csv":
        drive = None if analysis is None else read_drive(analysis, linkage.mounted)
        more = None if drive is None else analysed(linkage, drive, target.crank, radian).columns()
        return files.to_csv(linkage, target, radian, more)
    if kind in ("svg", "pylinkage"):
        return (drawing.to_svg if kind == "svg" else files.to_pylinkage)(linkage, target)
    if length_unit not in MILLIMETRES:
        raise FieldError("/length_unit", f"wanted one of {', '.join(MILLIMETRES)}, found {length_unit!r}")
    unit_mm = MILLIMETRES[length_unit]
    if kind == "plates":
        return to_plates(linkage, unit_mm, **_sizes(plates or {}))
    return (files.to_dxf if kind == "dxf" else files.to_mjcf)(linkage, target, unit_mm)


def _sizes(plates: Mapping[str, Any]) -> dict[str, float]:
    """Sizes of plates, those that are given."""
    for name in plates:
        if name not in ("hole", "width"):
            raise FieldError.no_such("/plates", name, ("hole", "width"), "size")
    return {name: number(f"plates/{name}", value) for name, value in plates.items() if value is not None}
