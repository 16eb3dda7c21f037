"""Contents of the files of a linkage."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from linkage_atlas.analysis import analysed, read_analysis
from linkage_atlas.arguments import Fields, millimetres_in, one_of
from linkage_atlas.attached_drives import read_attached
from linkage_atlas.formats import FORMATS, HELD, OF_PARTS
from synthesis.drives.attached import COLOUR, LAYER, Attached
from synthesis.drives.links import GROUND, ends_of, motions_at
from synthesis.drives.six_bar import Motor, SixBar
from synthesis.errors import FieldError
from synthesis.export.drawings import to_dxf, to_svg
from synthesis.export.simulation import to_mjcf
from synthesis.export.tables import to_csv
from synthesis.linkage import Linkage
from synthesis.sheet import More
from synthesis.target import Target


def check_held(kind: str, **options: Any) -> None:
    """Raise FieldError for an option that a file of a kind does not contain."""
    options["assembly"], options["drive"] = with_drive(kind, options["assembly"], options["drive"])
    for name, kinds in HELD.items():
        if options[name] and kind not in kinds:
            raise FieldError(f"/{name}", f"has no effect on the format {kind!r}; choose {' or '.join(kinds)}")


def content_of(
    linkage: Linkage,
    target: Target,
    radian: float,
    kind: str,
    length_unit: str | None,
    analysis: Fields | None,
    drive: Fields | None,
    parts: Callable[[bool], Any],
) -> bytes:
    """Return the content of a file; see `Linkage.file` for the arguments.

    Without ``length_unit`` CSV and SVG do not mention the unit, and other files take millimetres. ``parts`` makes the
    `SolidParts` of the linkage, with an error if they collide, or with True in any case.
    """
    one_of("kind", kind, FORMATS)
    attached = drive_on(linkage, target, drive)
    layer = None if attached is None else More(LAYER, COLOUR, attached.draw)
    if kind == "csv":
        more: dict[str, Any] = {}
        if analysis is not None:
            request = read_analysis(analysis, linkage.mounted)
            more |= analysed(linkage, request, target.crank, radian).columns()
        more |= {} if attached is None else attached.columns()
        more |= {"length_unit": [length_unit] * target.samples} if length_unit else {}
        return to_csv(linkage, target, radian, more).encode()
    if kind == "svg":
        return to_svg(linkage, target, None if attached is None else attached.shown(), length_unit).encode()
    unit_mm = millimetres_in(length_unit or "mm")
    if kind in (*OF_PARTS, "plates"):
        return parts(False).file(kind)
    if kind == "dxf":
        return to_dxf(linkage, target, unit_mm, layer).encode()
    if kind != "mjcf":
        raise FieldError("/kind", f"there is no writer for {kind!r}")
    try:
        masses = {weight.link: weight.as_mass() for weight in parts(True).masses}
    except FieldError:
        masses = None  # no plates of these sizes: the file has a note
    return to_mjcf(linkage, target, unit_mm, masses).encode()


def drive_on(linkage: Linkage, target: Target, drive: Fields | None) -> Attached | None:
    """Return a drive of a reply on a linkage at the samples of a motion."""
    if drive is None:
        return None
    found, machine = read_attached("drive", drive), motions_at(linkage, target.crank)
    for name in (found.link, found.on):
        if name not in (GROUND, *machine.links):
            raise FieldError("/drive/link", f"must be one of {', '.join(machine.links)}; it is {name!r}")
    attached = Attached(machine, found)
    if found.kind != "dyad":
        return attached
    motor = Motor(found.link, found.ground, *found.sizes, found.pin)
    try:
        return replace(attached, six_bar=SixBar.of(linkage, ends_of(target.way), motor))
    except FieldError:
        return attached  # moved by hand, it does not swing the linkage: only its ends are drawn


def with_drive(
    kind: str, assembly: Fields | bool | None, drive: Fields | None
) -> tuple[Fields | bool | None, Fields | None]:
    """Return an assembly with a drive: in files of parts a motor and its rod, or a cylinder, are two of them."""
    if not isinstance(drive, Mapping) or kind not in (*OF_PARTS, "plates"):
        return assembly, drive
    return {**(assembly if isinstance(assembly, Mapping) else {}), "drive": drive}, None
