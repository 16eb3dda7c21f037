"""A slot as files: CSV for tables, SVG for the eye, DXF for the workshop: the whole groove as closed contours.

All coordinates are those of the track, in its own unit and at full size.
"""

from __future__ import annotations

import numpy as np

from synthesis.chain.groove import Bend, Groove, groove, refuse_undercut
from synthesis.chain.report import smallest_radius
from synthesis.chain.slot import Slot
from synthesis.chain.track import Points
from synthesis.one_variable import Floats
from synthesis.sheet import Sheet, csv_text, dxf_document, dxf_text

TRACK_COLOUR, PATH_COLOUR, WALL_COLOUR, PIN_COLOUR = "#5b6b7b", "#c0392b", "#2471a3", "#1b2631"
DXF_COLOURS = {"PATH": 1, "GROOVE_LEFT": 5, "GROOVE_RIGHT": 5, "PINS": 7}
"""AutoCAD colour index of each layer."""


def roller_walls(slot: Slot, phases: Floats, roller_radius: float | None) -> dict[str, Points]:
    """The walls of a slot for a roller: the pin's path moved square to itself, to the left and to the right.

    Law: each wall is a roller's radius from the path, and no closer to any of its points.

    Raises
    ------
    FieldError
        The roller is too large for the path.
    """
    if roller_radius is None:
        return {}
    refuse_undercut(roller_radius, smallest_radius(slot))
    path, normals = slot.path(phases), slot.normals(phases)
    return {"left": path + roller_radius * normals, "right": path - roller_radius * normals}


def to_csv(
    slot: Slot,
    phases: Floats,
    phase_name: str,
    phase_unit: float,
    roller_radius: float | None,
    more: dict[str, Floats] | None = None,
) -> str:
    """The slot as a table: phase, free pin, depth, slack, with a roller its two walls, and ``more`` columns.

    ``phase_unit`` is P1's way along the driver for one unit of the phase's column.
    """
    path = slot.path(phases)
    columns = {phase_name: phases / phase_unit, "x": path.real, "y": path.imag}
    columns |= {"depth": slot.depth(phases), "slack": slot.slack(phases)}
    for name, wall in roller_walls(slot, phases, roller_radius).items():
        columns |= {f"{name}_x": wall.real, f"{name}_y": wall.imag}
    columns |= more or {}
    return csv_text({name: column.tolist() for name, column in columns.items()})


def contours(made: Groove) -> dict[str, list[list[float]]]:
    """The closed contours by name, each as rows x, y, bulge: of the bend that begins there, tan(turn/4), left positive."""
    runs = {"path": made.path, **made.walls}
    return {
        name: [[bend.start.real, bend.start.imag, float(np.tan(bend.turn / 4))] for bend in run]
        for name, run in runs.items()
    }


def to_svg(slot: Slot, roller_radius: float | None) -> str:
    """A drawing of the bare track, the pins at the window's start, their path and the groove's walls, y up."""
    track, made = slot.chain.track, groove(slot, roller_radius)
    pins = slot.pins(np.array([slot.start]))[0]
    runs = {"pin-path": made.path, **{f"groove-{name}": run for name, run in made.walls.items()}}
    outline = np.concatenate([bend.at(np.linspace(0, 1, 16)) for run in runs.values() for bend in run])
    sheet = Sheet(outline, margin=0.06)
    thin, dot_radius = (share * max(sheet.width, sheet.height) for share in (0.0015, 0.006))
    bare = track.points(track.place(np.linspace(0, track.total, 721)))
    chain = " L ".join(map(sheet.at, pins))
    dashed = f'stroke="{TRACK_COLOUR}" stroke-dasharray="{3 * thin:.6g}"'
    parts = [
        f'<g fill="none" stroke-width="{thin:.6g}">',
        f'<path id="bare-track" {dashed} d="M {" L ".join(map(sheet.at, bare))}"/>',
        *(
            f'<path id="{name}" stroke="{PATH_COLOUR if name == "pin-path" else WALL_COLOUR}" d="{_svg_path(run, sheet)}"/>'
            for name, run in runs.items()
        ),
        f'<path id="chain" stroke="{PIN_COLOUR}" d="M {chain} Z"/>',
        "</g>",
        f'<g fill="{PIN_COLOUR}">',
        *(sheet.dot(pin, dot_radius) for pin in pins),
        "</g>",
    ]
    return sheet.text("Chain, its track and the groove with the compensation slot", parts)


def _svg_path(run: list[Bend], sheet: Sheet) -> str:
    """A closed contour as SVG arcs; a left turn with y up is a right turn on the page, sweep flag 0."""
    parts = [f"M {sheet.at(run[0].start)}"]
    for bend in run:
        if bend.turn == 0:
            parts.append(f"L {sheet.at(bend.end)}")
            continue
        radius = f"{abs(bend.radius):.9g}"
        large, sweep = int(abs(bend.turn) > np.pi), int(bend.turn < 0)
        parts.append(f"A {radius} {radius} 0 {large} {sweep} {sheet.at(bend.end)}")
    return " ".join([*parts, "Z"])


def to_dxf(slot: Slot, roller_radius: float | None) -> str:
    """The pins' path and the groove's walls as closed polylines of arcs and lines, the pins as points, each on its own layer."""
    document = dxf_document(DXF_COLOURS, unit=0)
    space = document.modelspace()
    for name, rows in contours(groove(slot, roller_radius)).items():
        layer = "PATH" if name == "path" else f"GROOVE_{name.upper()}"
        space.add_lwpolyline(rows, format="xyb", close=True, dxfattribs={"layer": layer})
    for pin in slot.pins(np.array([slot.start]))[0].tolist():
        space.add_point((pin.real, pin.imag), dxfattribs={"layer": "PINS"})
    return dxf_text(document)
