"""A slot as files: CSV for tables, SVG for the eye, DXF for the workshop, each with the walls of a roller's slot.

All coordinates are those of the track, in its own unit and at full size.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from synthesis.chain.report import smallest_radius
from synthesis.chain.slot import Slot
from synthesis.chain.track import Points, Segment, Track, dot
from synthesis.errors import FieldError
from synthesis.one_variable import Floats
from synthesis.sheet import Sheet, csv_text, dxf_document, dxf_text

TRACK_COLOUR, PATH_COLOUR, WALL_COLOUR, PIN_COLOUR = "#5b6b7b", "#c0392b", "#2471a3", "#1b2631"
DXF_COLOURS = {"TRACK": 8, "SLOT": 1, "ROLLER_LEFT": 5, "ROLLER_RIGHT": 5, "PINS": 7}
"""AutoCAD colour index of each layer."""


def wall_offsets(slot: Slot, roller_radius: float | None) -> dict[str, float]:
    """The walls of a roller's slot by name, and how far to the left of the pin's path each lies; no roller, no walls.

    Raises
    ------
    FieldError
        The roller is too large for the path.
    """
    if roller_radius is None:
        return {}
    largest = smallest_radius(slot)
    if roller_radius >= largest:
        raise FieldError(
            "/roller_radius",
            f"a roller must be smaller than the slot's smallest curvature radius, {largest:.6g}",
            constraint="undercut",
            amount=roller_radius - largest,
        )
    return {"left": roller_radius, "right": -roller_radius}


def roller_walls(slot: Slot, phases: Floats, roller_radius: float | None) -> dict[str, Points]:
    """The walls of a slot for a roller: the pin's path moved square to itself, to the left and to the right.

    Law: each wall is a roller's radius from the path, and no closer to any of its points.
    """
    offsets = wall_offsets(slot, roller_radius)
    return {name: slot.path(phases) + offset * slot.normals(phases) for name, offset in offsets.items()}


def smooth_nodes(slot: Slot, samples: int) -> Floats:
    """Evenly spaced phases and the crossings: between them the path is smooth, as a cubic should be."""
    phases = np.union1d(np.linspace(slot.start, slot.end, samples), slot.breaks)
    phases = phases[np.concatenate([[True], np.diff(phases) > 1e-7 * slot.chain.period])]
    phases[-1] = slot.end
    return phases


def bezier(slot: Slot, phases: Floats, offset: float = 0.0) -> Points:
    """Cubics between phases, control points of shape (n - 1, 4), with the path's own tangents.

    ``offset`` > 0 moves the curve to the left. The wall's tangent is the path's, scaled by 1 - offset * curvature.
    """
    normals = slot.normals(phases)
    points = slot.path(phases) + offset * normals
    # Handles of chord/(3 cos^2(turn/4)) make each cubic a circle's to fourth order; the turn is that of the tangents.
    a, b = -1j * normals[:-1], -1j * normals[1:]
    cosine = np.sqrt(np.clip(0.5 * (1 + dot(a, b)), 0.25, 1.0))
    handle = np.abs(np.diff(points)) * 2 / (3 * (1 + cosine))
    return np.stack([points[:-1], points[:-1] + handle * a, points[1:] - handle * b, points[1:]], axis=1)


def to_csv(slot: Slot, phases: Floats, phase_name: str, phase_unit: float, roller_radius: float | None) -> str:
    """The slot as a table: phase, pin, depth, and with a roller its two walls.

    ``phase_unit`` is P1's way along the driver for one unit of the phase's column.
    """
    path = slot.path(phases)
    columns = {phase_name: phases / phase_unit, "x": path.real, "y": path.imag, "depth": slot.depth(phases)}
    for name, wall in roller_walls(slot, phases, roller_radius).items():
        columns |= {f"{name}_x": wall.real, f"{name}_y": wall.imag}
    return csv_text({name: column.tolist() for name, column in columns.items()})


def to_svg(slot: Slot, samples: int, roller_radius: float | None) -> str:
    """A drawing of the track, the pins at the window's start, the slot and a roller's walls, y up."""
    track, phases = slot.chain.track, smooth_nodes(slot, samples)
    pins = slot.pins(np.array([slot.start]))[0]
    outline = track.points(track.place(np.linspace(0, track.total, 720, endpoint=False)))
    sheet = Sheet(np.concatenate([outline, slot.path(phases)]), margin=0.06)
    thin, wide, dot_radius = (share * max(sheet.width, sheet.height) for share in (0.0015, 0.003, 0.006))

    def curve(name: str, colour: str, offset: float, attributes: str = "") -> str:
        cubics = bezier(slot, phases, offset)
        parts = [f"M {sheet.at(cubics[0, 0])}", *(f"C {' '.join(map(sheet.at, cubic[1:]))}" for cubic in cubics)]
        return f'<path id="{name}" stroke="{colour}"{attributes} d="{" ".join(parts)}"/>'

    chain = " L ".join(map(sheet.at, pins))
    parts = [
        f'<g fill="none" stroke-width="{thin:.6g}">',
        f'<path id="track" stroke="{TRACK_COLOUR}" d="{_track_path(track, sheet)}"/>',
        curve("slot", PATH_COLOUR, 0.0, f' stroke-width="{wide:.6g}"'),
        *(curve(f"roller-{name}", WALL_COLOUR, offset) for name, offset in wall_offsets(slot, roller_radius).items()),
        f'<path id="chain" stroke="{PIN_COLOUR}" d="M {chain} Z"/>',
        "</g>",
        f'<g fill="{PIN_COLOUR}">',
        *(sheet.dot(pin, dot_radius) for pin in pins),
        "</g>",
    ]
    return sheet.text("Chain track and compensation slot", parts)


def _track_path(track: Track, sheet: Sheet) -> str:
    """The track as SVG arcs; each in two halves, so that neither is more than half a turn."""
    parts = [f"M {sheet.at(track.points(track.place(0.0))[0])}"]
    for start, segment in zip(track.joints, track.segments):
        way = start + segment.length * np.array([0.5, 1.0])
        middle, end = map(sheet.at, track.points(track.place(way % track.total)))
        if segment.curvature == 0:
            parts.append(f"L {end}")
        else:
            radius = f"{1 / abs(segment.curvature):.9g}"
            # A left turn with y up is a right turn on the page: SVG's sweep flag 0.
            sweep = 0 if segment.curvature > 0 else 1
            parts += [f"A {radius} {radius} 0 0 {sweep} {point}" for point in (middle, end)]
    return " ".join([*parts, "Z"])


def to_dxf(slot: Slot, samples: int, roller_radius: float | None) -> str:
    """Track as arcs and lines, slot and roller walls as splines, pins as points, each on its own layer."""
    track, phases = slot.chain.track, smooth_nodes(slot, samples)
    document = dxf_document(DXF_COLOURS, unit=0)
    space = document.modelspace()
    ends = track.points(track.place(track.joints[:-1] + track.length))
    for segment, end in zip(track.segments, ends):
        _add_segment(space, segment, end)
    walls = {f"ROLLER_{name.upper()}": offset for name, offset in wall_offsets(slot, roller_radius).items()}
    for layer, offset in {"SLOT": 0.0, **walls}.items():
        cubics = bezier(slot, phases, offset)
        points = np.concatenate([cubics[:1, 0], cubics[:, 1:].ravel()])
        spline = space.add_spline(degree=3, dxfattribs={"layer": layer})
        spline.control_points = [(point.real, point.imag, 0.0) for point in points.tolist()]
        # Every inner knot three times: between its knots the B-spline is the Bezier curve.
        knots = np.arange(len(cubics) + 1.0)
        spline.knots = [0.0, *np.repeat(knots, 3).tolist(), knots[-1].item()]
    for pin in slot.pins(np.array([slot.start]))[0].tolist():
        space.add_point((pin.real, pin.imag), dxfattribs={"layer": "PINS"})
    return dxf_text(document)


def _add_segment(space: Any, segment: Segment, end: complex) -> None:
    layer = {"layer": "TRACK"}
    if segment.curvature == 0:
        space.add_line((segment.x, segment.y), (float(end.real), float(end.imag)), dxfattribs=layer)
        return
    radius = 1 / segment.curvature
    centre = complex(segment.x, segment.y) + 1j * radius * np.exp(1j * segment.heading)
    from_angle = np.degrees(segment.heading) - 90 * np.sign(radius)
    to_angle = from_angle + np.degrees(segment.curvature * segment.length)
    low, high = sorted((float(from_angle), float(to_angle)))
    space.add_arc((float(centre.real), float(centre.imag)), abs(radius), low, high, dxfattribs=layer)
