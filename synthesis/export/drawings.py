"""Drawings of a linkage at the first sample: SVG for viewing, DXF for CAD."""

from __future__ import annotations

import numpy as np

from synthesis.arrays import Complexes
from synthesis.export.layout import (
    Layout,
    layout_of,
    name_of,
    requested_poses,
    requested_positions,
    turn_path,
    unit_in_words,
)
from synthesis.guides import Driver, Rail, Slot
from synthesis.linkage import Linkage
from synthesis.sheet import Extra, More, Sheet, dxf_document, dxf_text
from synthesis.target import Target

_STYLE = (
    "<style>path{fill:none;stroke:#1d2733;stroke-width:4;stroke-linejoin:round;stroke-linecap:round}"
    ".ground{stroke:#7b8794;stroke-dasharray:14 10}.crank{stroke:#c2410c;stroke-width:8}.rocker{stroke-width:8}"
    ".body{fill:#2563eb33;stroke:#2563eb}.path{stroke:#0f766e}.turn{stroke:#0f766e66;stroke-width:2}"
    "circle{fill:#fff;stroke:#1d2733;stroke-width:3}.pivot{fill:#1d2733}.pose{fill:#b91c1c;stroke:none}"
    ".point{fill:#0f766e;stroke:none}text{font:22px sans-serif;fill:#1d2733}.size{font-size:18px;fill:#566272}</style>"
)
_TRACK_STYLE = (
    "<style>.rail{stroke:#7b8794;stroke-width:3}.slot{stroke:#2563eb;stroke-width:3}"
    ".slider{fill:#fff;stroke:#1d2733;stroke-width:4}</style>"
)
_DXF_COLOURS = {"GROUND": 8, "LINKS": 7, "BODY": 5, "PATH": 1}
"""AutoCAD colour index of each layer."""


def to_svg(linkage: Linkage, target: Target, extra: Extra | None = None, length_unit: str | None = None) -> str:
    """Draw a linkage at the first sample, y up, with names of joints and lengths of links.

    Parameters
    ----------
    linkage : Linkage
        The linkage.
    target : Target
        The motion, with the travel of the drive at the samples.
    extra : Extra, optional
        Additional elements, for example a drive.
    length_unit : str, optional
        Unit of lengths, if it is known.

    Raises
    ------
    FieldError
        For a linkage that does not close over the used interval.
    """
    layout = layout_of(linkage, target.interval)
    marks, turn = requested_positions(target), turn_path(linkage)
    rails, slots = layout.tracks(Rail), layout.tracks(Slot)
    names = layout.fixed | layout.moving
    points = [layout.links[1].position(guide.body_point) for guide in linkage.guides if guide.holds_point]
    points += [np.array([*names.values()]), *rails, *slots, marks]
    points += [curve for curve in (layout.path, turn) if curve is not None]
    sheet = Sheet(np.concatenate([*points, *([] if extra is None else [extra.points])]), 0.08, 1000, digits=7)
    dots = [sheet.dot(point, 11, 'class="pivot"') for point in layout.fixed.values()]
    dots += [sheet.dot(point, 8, 'class="pin"') for point in layout.moving.values()]
    curves = ""
    if layout.path is not None:
        names["P"] = layout.body.origin[0]
        dots.append(sheet.dot(names["P"], 7, 'class="point"'))
        curves = ("" if turn is None else sheet.line(turn, "turn")) + sheet.line(layout.path, "path")
    curves += "".join(sheet.dot(mark, 5, 'class="pose"') for mark in marks)
    labels = [sheet.label(point, name) for name, point in names.items()]
    for length, start, end in (*layout.bars, *([] if layout.ground is None else [layout.ground])):
        labels.append(sheet.label((start + end) / 2, f"{length:.5g}", 'class="size"'))
    ground = [] if layout.ground is None else [sheet.line(np.array(layout.ground[1:]), "ground")]
    ground += [sheet.line(rail, "rail") for rail in rails]
    links = [
        sheet.line(np.array([guide[0], layout.pins[index]]), ("crank", "rocker")[index])
        for index, guide in enumerate(linkage.guides)
        if not guide.slides
    ]
    links += [sheet.line(block, "slider", closed=True) for block in layout.blocks]
    links += [sheet.line(slot, "slot") for slot in slots]
    return sheet.text(
        _title(linkage, layout) + unit_in_words(length_unit),
        [
            _STYLE,
            *([_TRACK_STYLE] if layout.blocks else []),
            f'<g id="GROUND">{"".join(ground)}</g>',
            f'<g id="PATH">{curves}</g>',
            f'<g id="BODY">{sheet.line(layout.outline, "body", closed=True)}</g>',
            f'<g id="LINKS">{"".join(links)}</g>',
            f"<g>{''.join(dots)}</g>",
            *([] if extra is None else [f'<g id="DRIVE">{extra.draw(sheet)}</g>']),
            f'<g id="NAMES">{"".join(labels)}</g>',
            sheet.unit_text(length_unit),
        ],
    )


def _title(linkage: Linkage, layout: Layout) -> str:
    """Return kind, lengths and drive of a linkage in words."""
    lengths = {name: linkage.lengths[name] for name in linkage.link_names if name in linkage.lengths}
    lengths |= {} if layout.ground is None else {"ground": layout.ground[0]}
    words = [f"{name} {length:.6g}" for name, length in lengths.items()]
    title = ": ".join([name_of(linkage).capitalize(), *([", ".join(words)] if words else [])])
    return title if linkage.driver is Driver.CRANK else f"{title}, driven by a {linkage.driver}"


def to_dxf(linkage: Linkage, target: Target, unit_mm: float = 1.0, more: More | None = None) -> str:
    """Draw a linkage at the first sample for CAD, in millimetres.

    Layers: GROUND (ground line, pivots, rails), LINKS (bars, sliders, blocks, pins), BODY (the body with its slots, and a cross
    with a direction at each requested pose), PATH (the body point over the used interval).

    Law: bars end at their pins, a slider's middle lies on its rail and a slot's line through its pin, to 1e-6 mm; the drawing
    passes ezdxf's audit.

    Parameters
    ----------
    linkage : Linkage
        The linkage.
    target : Target
        The motion, with the travel of the drive at the samples.
    unit_mm : float, optional
        Millimetres in the unit of lengths.
    more : More, optional
        Additional elements on a layer of their own.

    Raises
    ------
    FieldError
        For a linkage that does not close over the used interval, or whose coordinates the file cannot hold.
    """
    layout = layout_of(linkage, target.interval)
    layout.check_size(unit_mm)
    document = dxf_document(_DXF_COLOURS, 4)
    space = document.modelspace()
    size = layout.size * unit_mm

    def xy(point: complex) -> tuple[float, float]:
        return float(point.real * unit_mm), float(point.imag * unit_mm)

    def line(start: complex, end: complex, layer: str) -> None:
        space.add_line(xy(start), xy(end), dxfattribs={"layer": layer})

    def polygon(points: Complexes, layer: str, closed: bool = True) -> None:
        space.add_lwpolyline([xy(point) for point in points], close=closed, dxfattribs={"layer": layer})

    if layout.ground is not None:
        line(*layout.ground[1:], "GROUND")
    for start, end in layout.tracks(Rail):
        line(start, end, "GROUND")
    for point in layout.fixed.values():
        space.add_circle(xy(point), 0.02 * size, dxfattribs={"layer": "GROUND"})
    for _, start, end in layout.bars:
        line(start, end, "LINKS")
    for point in layout.moving.values():
        space.add_circle(xy(point), 0.012 * size, dxfattribs={"layer": "LINKS"})
    for block in layout.blocks:
        polygon(block, "LINKS")
    for start, end in layout.tracks(Slot):
        line(start, end, "BODY")
    if layout.path is not None:
        polygon(layout.outline, "BODY")
        polygon(layout.path, "PATH", closed=False)
    for point, turn in requested_poses(target, linkage.motions(target.crank)[1].angle):
        space.add_point(xy(point), dxfattribs={"layer": "BODY"})
        line(point, point + 0.08 * layout.size * np.exp(1j * turn), "BODY")
    if more is not None:
        document.layers.add(more.layer, color=more.colour)
        more.draw(space, xy, size)
    return dxf_text(document)
