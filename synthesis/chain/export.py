"""A slot as files: CSV for tables, SVG for the eye, DXF for the workshop, each with the walls of a roller's slot.

All coordinates are those of the track, in its own unit and at full size.
"""

from __future__ import annotations

import io

import numpy as np

from synthesis.chain.slot import Slot
from synthesis.chain.track import Floats, Segment, Track
from synthesis.errors import FieldError

TRACK_COLOUR, PATH_COLOUR, WALL_COLOUR, PIN_COLOUR = "#5b6b7b", "#c0392b", "#2471a3", "#1b2631"
DXF_COLOURS = {"TRACK": 8, "SLOT": 1, "ROLLER_LEFT": 5, "ROLLER_RIGHT": 5, "PINS": 7}
"""AutoCAD colour index of each layer."""


def roller_walls(slot: Slot, phases: Floats, roller_radius: float, radius_min: float) -> tuple[Floats, Floats]:
    """The two walls of a slot for a roller: the pin's path moved square to itself, to the left and to the right.

    Law: each wall is a roller's radius from the path, and no closer to any of its points.

    Parameters
    ----------
    phases : ndarray, shape (n,)
    radius_min : float
        Smallest curvature radius of the path; a larger roller would cut its own wall away.

    Raises
    ------
    FieldError
        The roller is too large for the path.
    """
    if roller_radius >= radius_min:
        raise FieldError(
            "/roller_radius",
            f"a roller must be smaller than the slot's smallest curvature radius, {radius_min:.6g}",
            constraint="undercut",
            amount=roller_radius - radius_min,
        )
    points, shift = slot.path(phases), roller_radius * slot.normals(phases)
    return points + shift, points - shift


def nodes(slot: Slot, samples: int) -> Floats:
    """Evenly spaced phases and the crossings: between them the path is smooth, as a cubic piece should be."""
    phases = np.union1d(np.linspace(slot.start, slot.end, samples), slot.breaks)
    keep = np.concatenate([[True], np.diff(phases) > 1e-7 * slot.chain.period])
    phases = phases[keep]
    phases[-1] = slot.end
    return phases


def bezier(slot: Slot, phases: Floats, offset: float = 0.0) -> Floats:
    """Cubic pieces between phases, control points of shape (n - 1, 4, 2), with the path's own tangents.

    ``offset`` > 0 moves the curve to the left. The wall's tangent is the path's, scaled by 1 - offset * curvature.
    """
    normals = slot.normals(phases)
    points = slot.path(phases) + offset * normals
    tangents = np.stack([normals[:, 1], -normals[:, 0]], axis=1)
    chord = np.diff(points, axis=0)
    length = np.hypot(chord[:, 0], chord[:, 1])
    # Handles of chord/(3 cos^2(turn/4)) make each piece a circle's to fourth order; the turn is that of the tangents.
    a, b = tangents[:-1], tangents[1:]
    cosine = np.sqrt(np.clip(0.5 * (1 + np.sum(a * b, axis=1)), 0.25, 1.0))
    handle = (length * 2 / (3 * (1 + cosine)))[:, None]
    return np.stack([points[:-1], points[:-1] + handle * a, points[1:] - handle * b, points[1:]], axis=1)


def to_csv(
    slot: Slot, phases: Floats, phase_name: str, phase_scale: float, walls: tuple[Floats, Floats] | None
) -> str:
    """The slot as a table: phase, pin, depth, and with a roller its two walls. Numbers at full precision."""
    points, depth = slot.path(phases), slot.depth(phases)
    columns = [phases * phase_scale, points[:, 0], points[:, 1], depth]
    names = [phase_name, "x", "y", "depth"]
    if walls is not None:
        columns += [walls[0][:, 0], walls[0][:, 1], walls[1][:, 0], walls[1][:, 1]]
        names += ["left_x", "left_y", "right_x", "right_y"]
    rows = [",".join(names)]
    rows += [",".join(repr(float(value)) for value in row) for row in np.stack(columns, axis=1)]
    return "\r\n".join(rows) + "\r\n"


def to_svg(slot: Slot, samples: int, roller_radius: float | None) -> str:
    """A drawing of the track, the pins at the window's start, the slot and a roller's walls, y up."""
    track = slot.chain.track
    phases = nodes(slot, samples)
    pins = slot.pins(np.array([slot.start]))[0]
    outline = _outline(track)
    low = np.minimum(outline.min(axis=0), slot.path(phases).min(axis=0))
    high = np.maximum(outline.max(axis=0), slot.path(phases).max(axis=0))
    margin = 0.06 * float((high - low).max())
    # Written about the drawing's own corner: viewers hold coordinates in single precision.
    x0, y1 = low[0] - margin, high[1] + margin
    width, height = high - low + 2 * margin

    def at(point: Floats) -> str:
        return f"{point[0] - x0:.9g} {y1 - point[1]:.9g}"

    def curve(pieces: Floats) -> str:
        parts = [f"M {at(pieces[0, 0])}"]
        parts += [f"C {at(piece[1])} {at(piece[2])} {at(piece[3])}" for piece in pieces]
        return " ".join(parts)

    thin, wide, dot = (f"{share * max(width, height):.6g}" for share in (0.0015, 0.003, 0.006))
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.9g} {height:.9g}">',
        "<title>Chain track and compensation slot</title>",
        f'<g fill="none" stroke-width="{thin}">',
        f'<path id="track" stroke="{TRACK_COLOUR}" d="{_track_path(track, at)}"/>',
        f'<path id="slot" stroke="{PATH_COLOUR}" stroke-width="{wide}" d="{curve(bezier(slot, phases))}"/>',
    ]
    if roller_radius is not None:
        for name, offset in (("roller-left", roller_radius), ("roller-right", -roller_radius)):
            path = curve(bezier(slot, phases, offset))
            lines.append(f'<path id="{name}" stroke="{WALL_COLOUR}" d="{path}"/>')
    chain = " L ".join(at(pin) for pin in pins)
    lines += [f'<path id="chain" stroke="{PIN_COLOUR}" d="M {chain} Z"/>', "</g>", f'<g fill="{PIN_COLOUR}">']
    for pin in pins:
        x, y = at(pin).split()
        lines.append(f'<circle cx="{x}" cy="{y}" r="{dot}"/>')
    return "\n".join([*lines, "</g>", "</svg>"]) + "\n"


def to_dxf(slot: Slot, samples: int, roller_radius: float | None) -> str:
    """Track as arcs and lines, slot and roller walls as splines, pins as points, each on its own layer."""
    import ezdxf

    track = slot.chain.track
    document = ezdxf.new("R2010", setup=False)
    document.header["$INSUNITS"] = 0  # the user's own unit
    for name, colour in DXF_COLOURS.items():
        document.layers.add(name, color=colour)
    space = document.modelspace()
    ends = track.points(track.place(track.joints[:-1] + track.length))
    for segment, end in zip(track.segments, ends):
        _add_segment(space, segment, end)
    phases = nodes(slot, samples)
    offsets = {"SLOT": 0.0}
    if roller_radius is not None:
        offsets |= {"ROLLER_LEFT": roller_radius, "ROLLER_RIGHT": -roller_radius}
    for layer, offset in offsets.items():
        pieces = bezier(slot, phases, offset)
        points = np.concatenate([pieces[:1, 0], pieces[:, 1:].reshape(-1, 2)])
        spline = space.add_spline(degree=3, dxfattribs={"layer": layer})
        spline.control_points = [(float(x), float(y), 0.0) for x, y in points]
        # Every inner knot three times: the B-spline's pieces are the Bezier pieces.
        knots = np.arange(len(pieces) + 1.0)
        spline.knots = [0.0, *np.repeat(knots, 3).tolist(), knots[-1].item()]
    for x, y in slot.pins(np.array([slot.start]))[0]:
        space.add_point((float(x), float(y)), dxfattribs={"layer": "PINS"})
    stream = io.StringIO()
    document.write(stream)
    return stream.getvalue()


def _add_segment(space, segment: Segment, end: Floats) -> None:  # type: ignore[no-untyped-def]
    layer = {"layer": "TRACK"}
    if segment.curvature == 0:
        space.add_line((segment.x, segment.y), (float(end[0]), float(end[1])), dxfattribs=layer)
        return
    radius = 1 / segment.curvature
    centre = (segment.x - radius * np.sin(segment.heading), segment.y + radius * np.cos(segment.heading))
    from_angle = np.degrees(segment.heading) - 90 * np.sign(radius)
    to_angle = from_angle + np.degrees(segment.curvature * segment.length)
    space.add_arc(
        tuple(map(float, centre)),
        abs(radius),
        float(min(from_angle, to_angle)),
        float(max(from_angle, to_angle)),
        dxfattribs=layer,
    )


def _outline(track: Track) -> Floats:
    return track.points(track.place(np.linspace(0, track.total, 720, endpoint=False)))


def _track_path(track: Track, at) -> str:  # type: ignore[no-untyped-def]
    """The track as SVG arcs; each in two halves, so that neither is more than half a turn."""
    parts = [f"M {at(track.points(track.place(0.0))[0])}"]
    for index, segment in enumerate(track.segments):
        start, length = track.joints[index], segment.length
        middle, end = track.points(track.place(np.array([start + length / 2, (start + length) % track.total])))
        if segment.curvature == 0:
            parts.append(f"L {at(end)}")
        else:
            radius = f"{1 / abs(segment.curvature):.9g}"
            # A left turn with y up is a right turn on the page: SVG's sweep flag 0.
            sweep = 0 if segment.curvature > 0 else 1
            parts += [f"A {radius} {radius} 0 0 {sweep} {at(point)}" for point in (middle, end)]
    return " ".join([*parts, "Z"])
