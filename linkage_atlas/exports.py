"""A linkage as the text of a file: the formats there are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from synthesis.errors import FieldError

if TYPE_CHECKING:
    from synthesis.drives.attached import Attached
    from synthesis.drives.links import Machine
    from synthesis.fourbar.linkage import Linkage
    from synthesis.guided.linkage import GuidedLinkage
    from synthesis.sheet import More
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
    drive: Mapping[str, Any] | None = None,
) -> str:
    """The text of a file; see `FourBar.render` for what the arguments mean."""
    from linkage_atlas.studies import analysed, read_drive
    from synthesis.fourbar import files
    from synthesis.fourbar.linkage import Linkage

    if kind not in FORMATS:
        raise FieldError("/kind", f"wanted one of {', '.join(FORMATS)}, found {kind!r}")
    with_drive = _with_drive(linkage, target, drive, kind)
    if not isinstance(linkage, Linkage):
        return _guided_text(linkage, target, radian, kind, length_unit, analysis, with_drive)
    if kind == "csv":
        asked = None if analysis is None else read_drive(analysis, linkage.mounted)
        more = {} if asked is None else analysed(linkage, asked, target.crank, radian).columns()
        return files.to_csv(linkage, target, radian, more | with_drive.columns())
    if kind in ("svg", "pylinkage"):
        return (files.to_svg if kind == "svg" else files.to_pylinkage)(linkage, target)
    if length_unit not in MILLIMETRES:
        raise FieldError("/length_unit", f"wanted one of {', '.join(MILLIMETRES)}, found {length_unit!r}")
    unit_mm = MILLIMETRES[length_unit]
    if kind == "plates":
        return files.to_plates(linkage, unit_mm, **_sizes(plates or {}))
    if kind == "dxf":
        return files.to_dxf(linkage, target, unit_mm, with_drive.drawn())
    return with_drive.simulated(files.to_mjcf(linkage, target, unit_mm), unit_mm / 1000)


class _WithDrive(NamedTuple):
    """What a drive adds to a file; nothing where there is none."""

    drive: Attached | None
    machine: Machine | None

    def columns(self) -> dict[str, Any]:
        return {} if self.drive is None or self.machine is None else self.drive.columns(self.machine)

    def drawn(self) -> More | None:
        from synthesis.drives.attached import COLOUR, LAYER
        from synthesis.sheet import More

        drive, machine = self
        if drive is None or machine is None:
            return None
        return More(LAYER, COLOUR, lambda space, xy, size: drive.draw(machine, space, xy, size))

    def simulated(self, model: str, metre: float) -> str:
        return (
            model if self.drive is None or self.machine is None else self.drive.simulated(self.machine, model, metre)
        )


def _with_drive(
    linkage: Linkage | GuidedLinkage, target: Target, drive: Mapping[str, Any] | None, kind: str
) -> _WithDrive:
    """A drive of a reply on a linkage at the samples of a motion."""
    if drive is None:
        return _WithDrive(None, None)
    if kind not in ("csv", "dxf", "mjcf"):
        raise FieldError("/drive", f"a file of the kind {kind!r} holds no drive: ask for csv, dxf or mjcf")
    from linkage_atlas.driving import attached_of
    from synthesis.drives.links import guided_machine_at, machine_at
    from synthesis.fourbar.linkage import Linkage

    if isinstance(linkage, Linkage):
        machine = machine_at(linkage, target.crank)
    else:
        machine = guided_machine_at(linkage, target.crank)
    return _WithDrive(attached_of(drive, machine), machine)


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
    with_drive: _WithDrive,
) -> str:
    """The same of a body on two guides, rails and slots among them."""
    from linkage_atlas.guided_studies import analysed
    from linkage_atlas.studies import read_drive
    from synthesis.guided import files

    if kind in _FOUR_BARS_ONLY:
        raise FieldError("/format", _FOUR_BARS_ONLY[kind])
    if kind == "csv":
        asked = None if analysis is None else read_drive(analysis, True)
        more = {} if asked is None else analysed(linkage, asked, target.crank, radian).columns()
        return files.to_csv(linkage, target, radian, more | with_drive.columns())
    if kind == "svg":
        return files.to_svg(linkage, target)
    if kind not in ("dxf", "mjcf"):
        raise FieldError("/format", f"{kind!r} is written for four-bars only")
    if length_unit not in MILLIMETRES:
        raise FieldError("/length_unit", f"wanted one of {', '.join(MILLIMETRES)}, found {length_unit!r}")
    unit_mm = MILLIMETRES[length_unit]
    if kind == "dxf":
        return files.to_dxf(linkage, target, unit_mm, with_drive.drawn())
    return with_drive.simulated(files.to_mjcf(linkage, target, unit_mm), unit_mm / 1000)


def _sizes(plates: Mapping[str, Any]) -> dict[str, float]:
    from linkage_atlas.motions import number

    for name in plates:
        if name not in ("hole", "width"):
            raise FieldError.no_such("/plates", name, ("hole", "width"), "size")
    return {name: number(f"plates/{name}", value) for name, value in plates.items() if value is not None}
