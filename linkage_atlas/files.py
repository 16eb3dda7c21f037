"""Contents of the files of a linkage."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from linkage_atlas.analysis import analysed, read_analysis
from linkage_atlas.arguments import Fields, millimetres_in, number, one_of, pair
from linkage_atlas.formats import FORMATS, HELD, OF_PARTS
from linkage_atlas.part_settings import PartSettings
from linkage_atlas.solids import SLIDES
from synthesis.assembly.sizes import plate_sizes
from synthesis.drives.attached import COLOUR, LAYER, Attached
from synthesis.drives.links import GROUND, LinkMotions, ends_of, motions_at
from synthesis.drives.six_bar import Motor, SixBar
from synthesis.errors import FieldError
from synthesis.export.drawings import to_dxf, to_svg
from synthesis.export.simulation import ONLY_FOUR_BARS, to_mjcf, to_pylinkage
from synthesis.export.tables import to_csv
from synthesis.link_motion import Mass
from synthesis.linkage import Linkage
from synthesis.sheet import More
from synthesis.target import Target

_FOUR_BARS_ONLY = {
    "pylinkage": ONLY_FOUR_BARS,
    **{kind: SLIDES.format(kind) for kind in ("urdf", "sdf")},
}
"""Reason why a file of a kind can only be written for a four-bar."""


def check_format(kind: str, mechanisms: Sequence[str]) -> None:
    """Raise FieldError for a file that is written for four-bars only, if no four-bar is requested."""
    if kind in _FOUR_BARS_ONLY and "four_bar" not in mechanisms:
        raise FieldError("/format", _FOUR_BARS_ONLY[kind])


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
    parts: Callable[[bool], Any] | None = None,
    arranged: bool = False,
    more: Fields | None = None,
) -> bytes:
    """Return the content of a file; see `Linkage.file` for the arguments.

    Parameters
    ----------
    length_unit : str or None
        None if it is unknown: CSV and SVG do not mention it then, and other files take millimetres.
    parts : callable, optional
        Makes the `SolidParts` of the linkage, with an error if they collide, or with True in any case.
    arranged : bool
        True if plates are those of an assembly and not only the links.
    more : mapping, optional
        Further columns of a CSV file.
    """
    one_of("kind", kind, FORMATS)
    attached = drive_on(linkage, target, drive)
    layer = None if attached is None else More(LAYER, COLOUR, attached.draw)
    if kind == "csv":
        more = _analysis_columns(linkage, target, radian, analysis) | dict(more or {})
        more |= {} if attached is None else attached.columns()
        more |= {"length_unit": [length_unit] * target.samples} if length_unit else {}
        return to_csv(linkage, target, radian, more).encode()
    if kind == "svg":
        return to_svg(linkage, target, None if attached is None else attached.shown(), length_unit).encode()
    if kind == "pylinkage":
        return to_pylinkage(linkage, target, length_unit).encode()
    unit_mm = millimetres_in(length_unit or "mm")
    if kind in (*OF_PARTS, "plates"):
        assert parts is not None
        if kind != "plates" or arranged or not linkage.is_four_bar:
            return parts(False).file(kind)
        from synthesis.solids.plates import to_plates

        settings = PartSettings(length_unit=length_unit)
        hole, width = plate_sizes(linkage.links)
        settings = settings.completed(hole, width, 0.0)
        return to_plates(linkage, unit_mm, settings.hole, settings.width).encode()
    if kind == "dxf":
        return to_dxf(linkage, target, unit_mm, layer).encode()
    if kind != "mjcf":
        raise FieldError("/kind", f"there is no writer for {kind!r}")
    assert parts is not None
    try:
        masses = {
            mass.link: Mass(mass.link, mass.mass, complex(*mass.centre), mass.inertia) for mass in parts(True).masses
        }
    except FieldError:
        masses = None  # no plates of these sizes: the file has a note
    text = to_mjcf(linkage, target, unit_mm, masses)
    return (text if attached is None else attached.simulated(text, unit_mm / 1000)).encode()


def _analysis_columns(linkage: Linkage, target: Target, radian: float, analysis: Fields | None) -> dict[str, Any]:
    if analysis is None:
        return {}
    request = read_analysis(analysis, linkage.mounted)
    return dict(analysed(linkage, request, target.crank, radian).columns())


def drive_on(linkage: Linkage, target: Target, drive: Fields | None) -> Attached | None:
    """Return a drive of a reply on a linkage at the samples of a motion."""
    if drive is None:
        return None
    found = _attached(drive, motions_at(linkage, target.crank))
    if found.kind != "dyad":
        return found
    motor = Motor(found.link, found.ground, *found.sizes, found.pin)
    try:
        return replace(found, six_bar=SixBar.of(linkage, ends_of(target.way), motor))
    except FieldError:
        return found  # moved by hand, it does not swing the linkage: only its ends are drawn


def with_drive(
    kind: str, assembly: Fields | bool | None, drive: Fields | None
) -> tuple[Fields | bool | None, Fields | None]:
    """Return an assembly with a drive: in files of parts a motor and its rod, or a cylinder, are two of them."""
    if not isinstance(drive, Mapping) or kind not in (*OF_PARTS, "plates"):
        return assembly, drive
    return {**(assembly if isinstance(assembly, Mapping) else {}), "drive": drive}, None


def _attached(drive: Mapping[str, Any], machine: LinkMotions) -> Attached:
    """Check a drive of a reply and return it on a machine at its samples."""
    if not isinstance(drive, Mapping):
        raise FieldError("/drive", "must be a drive of a reply, as plain values")
    kind, link = drive.get("kind"), drive.get("link")
    if kind not in ("rotary", "actuator", "dyad", "toggle"):
        raise FieldError("/drive/kind", f"must be a drive of a reply; it is {kind!r}")
    on = drive.get("on") or GROUND
    for name in (link, on):
        if name not in (GROUND, *machine.links):
            raise FieldError("/drive/link", f"must be one of {', '.join(machine.links)}; it is {name!r}")
    ground_values = drive.get("motor") if kind in ("rotary", "dyad") else drive.get("ground_point")
    ground = pair(f"drive/{'motor' if kind in ('rotary', 'dyad') else 'ground_point'}", ground_values, math.inf)
    pin = 0j if kind == "rotary" else pair("drive/pin_on_link", drive.get("pin_on_link"), math.inf)
    part, names = {
        "rotary": ({}, ()),
        "actuator": (drive, ("retracted", "stroke")),
        "dyad": (drive.get("six_bar") or {}, ("crank", "coupler")),
        "toggle": (drive.get("lock") or {}, ("handle", "strut")),
    }[kind]
    sizes = [number(f"drive/{name}", part.get(name)) for name in names]
    if any(not size > 0 for size in sizes):
        raise FieldError("/drive", f"must have {' and '.join(names)} above 0")
    knee = (drive.get("curve") or {}).get("knee") if kind == "toggle" else None
    return Attached(
        machine,
        kind,
        str(link),
        on,
        ground,
        pin,
        (sizes[0], sizes[1]) if sizes else (0.0, 0.0),
        bool(drive.get("extends", True)),
        None if not knee or knee[0] is None else pair("drive/curve/knee/0", knee[0], math.inf),
    )
