"""A linkage as the content of a file."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from linkage_atlas.arguments import check_names, millimetres_in, number, one_of, pair
from linkage_atlas.formats import FORMATS, OF_PARTS
from linkage_atlas.solids import SLIDES
from linkage_atlas.studies import analysed, read_analysis
from synthesis.drives.attached import COLOUR, LAYER, Attached
from synthesis.drives.links import GROUND, LinkMotions, ends_of, motions_at
from synthesis.drives.six_bar import Motor, SixBar
from synthesis.errors import FieldError
from synthesis.fourbar import files as of_four_bars
from synthesis.fourbar.linkage import Linkage, Mass
from synthesis.guided import files as of_guided
from synthesis.guided.linkage import GuidedLinkage
from synthesis.sheet import More

if TYPE_CHECKING:
    from synthesis.target import Target

_FOUR_BARS_ONLY = {
    "pylinkage": "pylinkage has no guides that move or slots in a moving body: this linkage cannot be written for it",
    **{kind: SLIDES.format(kind) for kind in ("urdf", "sdf")},
}
"""Why there is no file of some kinds of a body on two guides."""


def check_format(kind: str, mechanisms: Sequence[str]) -> None:
    """FieldError for a file that is written for four-bars only, where none of the kinds asked for is one."""
    if kind in _FOUR_BARS_ONLY and "four_bar" not in mechanisms:
        raise FieldError("/format", _FOUR_BARS_ONLY[kind])


def content_of(
    linkage: Linkage | GuidedLinkage,
    target: Target,
    radian: float,
    kind: str,
    length_unit: str,
    analysis: Mapping[str, Any] | None,
    drive: Mapping[str, Any] | None,
    parts: Callable[[bool], Any] | None = None,
    plates: Mapping[str, Any] | None = None,
    arranged: bool = False,
    more: Mapping[str, Any] | None = None,
) -> bytes:
    """The content of a file; see `FourBar.file` for what the arguments mean.

    ``parts``: makes the `SolidParts` of a four-bar, with an error where they collide, or (True) nevertheless.
    ``arranged``: plates are those of an assembly, not the links alone. ``more``: further columns of a CSV file.
    """
    one_of("kind", kind, FORMATS)
    if isinstance(linkage, GuidedLinkage) and kind == "pylinkage":
        raise FieldError("/format", _FOUR_BARS_ONLY[kind])
    attached = drive_on(linkage, target, drive, kind)
    layer = None if attached is None else More(LAYER, COLOUR, attached.draw)
    guided = isinstance(linkage, GuidedLinkage)
    files: Any = of_guided if guided else of_four_bars
    text: str
    if kind == "csv":
        more = _analysis_columns(linkage, target, radian, analysis) | dict(more or {})
        more |= {} if attached is None else attached.columns()
        text = files.to_csv(linkage, target, radian, more)
        return text.encode()
    if kind == "svg":
        text = files.to_svg(linkage, target, None if attached is None else attached.shown())
        return text.encode()
    if kind == "pylinkage":
        assert isinstance(linkage, Linkage)
        return of_four_bars.to_pylinkage(linkage, target).encode()
    unit_mm = millimetres_in(length_unit)
    if kind in (*OF_PARTS, "plates"):
        assert parts is not None
        if plates and (arranged or guided):
            raise FieldError(
                "/plates", "with `assembly` or `solids`, rails or slots sizes stand there: `hole` and `width`"
            )
        if kind != "plates" or arranged or isinstance(linkage, GuidedLinkage):
            return parts(False).file(kind)
        from synthesis.solids.plates import to_plates

        return to_plates(linkage, unit_mm, **_sizes(plates or {})).encode()
    if kind == "dxf":
        text = files.to_dxf(linkage, target, unit_mm, layer)
        return text.encode()
    assert parts is not None
    try:
        masses = {one.link: Mass(one.link, one.mass, complex(*one.at), one.inertia) for one in parts(True).masses}
    except FieldError:
        masses = None  # no plates of these sizes: the file says so
    text = files.to_mjcf(linkage, target, unit_mm, masses)
    return (text if attached is None else attached.simulated(text, unit_mm / 1000)).encode()


def _analysis_columns(
    linkage: Linkage | GuidedLinkage, target: Target, radian: float, analysis: Mapping[str, Any] | None
) -> dict[str, Any]:
    if analysis is None:
        return {}
    asked = read_analysis(analysis, isinstance(linkage, GuidedLinkage) or linkage.mounted)
    columns: dict[str, Any] = analysed(linkage, asked, target.crank, radian).columns()
    return columns


def drive_on(
    linkage: Linkage | GuidedLinkage, target: Target, drive: Mapping[str, Any] | None, kind: str
) -> Attached | None:
    """A drive of a reply on a linkage at the samples of a motion."""
    if drive is None:
        return None
    if kind not in ("csv", "svg", "dxf", "mjcf"):
        raise FieldError("/drive", f"a file of the kind {kind!r} holds no drive: ask for csv, svg, dxf or mjcf")
    found = _attached(drive, motions_at(linkage, target.crank))
    if found.kind != "dyad":
        return found
    motor = Motor(found.link, found.ground, *found.sizes, found.pin)
    try:
        return replace(found, six_bar=SixBar.of(linkage, ends_of(target.way), motor))
    except FieldError:
        return found  # moved by hand, it does not swing the linkage: its ends alone are told


def with_motor(
    kind: str, assembly: Mapping[str, Any] | None, drive: Mapping[str, Any] | None
) -> tuple[Mapping[str, Any] | None, Mapping[str, Any] | None]:
    """What is asked of an assembly, and a drive: in files of parts a motor with its rod is two of them."""
    if drive is None or kind not in (*OF_PARTS, "plates") or drive.get("kind") != "dyad":
        return assembly, drive
    return {**(assembly or {}), "drive": drive}, None


def _attached(given: Mapping[str, Any], machine: LinkMotions) -> Attached:
    """A drive of a reply, as it came, on a machine at its samples."""
    kind, link = given.get("kind"), given.get("link")
    if kind not in ("rotary", "actuator", "dyad", "toggle"):
        raise FieldError("/drive/kind", f"wanted a drive of a reply, found {kind!r}")
    on = given.get("on") or GROUND
    for name in (link, on):
        if name not in (GROUND, *machine.links):
            raise FieldError("/drive/link", f"wanted one of {', '.join(machine.links)}, found {name!r}")
    where = given.get("motor") if kind in ("rotary", "dyad") else given.get("ground_point")
    ground = pair(f"drive/{'motor' if kind in ('rotary', 'dyad') else 'ground_point'}", where, math.inf)
    pin = 0j if kind == "rotary" else pair("drive/pin_on_link", given.get("pin_on_link"), math.inf)
    part, names = {
        "rotary": ({}, ()),
        "actuator": (given, ("retracted", "stroke")),
        "dyad": (given.get("six_bar") or {}, ("crank", "coupler")),
        "toggle": (given.get("lock") or {}, ("handle", "strut")),
    }[kind]
    sizes = [number(f"drive/{name}", part.get(name)) for name in names]
    if any(not size > 0 for size in sizes):
        raise FieldError("/drive", f"wanted {' and '.join(names)} above 0")
    knee = (given.get("curve") or {}).get("knee") if kind == "toggle" else None
    return Attached(
        machine,
        kind,
        str(link),
        on,
        ground,
        pin,
        (sizes[0], sizes[1]) if sizes else (0.0, 0.0),
        bool(given.get("extends", True)),
        None if not knee or knee[0] is None else pair("drive/curve/knee/0", knee[0], math.inf),
    )


def _sizes(plates: Mapping[str, Any]) -> dict[str, float]:
    check_names("/plates", plates, ("hole", "width"), "size")
    return {name: number(f"plates/{name}", value) for name, value in plates.items() if value is not None}
