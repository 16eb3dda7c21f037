"""The groove in which the pins of a chain run, as closed contours of arcs and lines, and its CSV, SVG and DXF files.

The path consists of the bare track and, where the slot replaces the track, the slot. The slot is approximated by
pairs of tangent arcs (biarcs) within `TOLERANCE`. The parallel curve of an arc is an arc, so each wall is exactly a
roller radius from this path. If the slot meets the track at a step or a corner, lines join the parallels, which cross
near an inner corner.

Coordinates are in the frame and the unit of the track, at full size.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from synthesis.errors import FieldError
from synthesis.one_variable import Floats
from synthesis.scenes.chain.slot import Slot, smallest_radius
from synthesis.scenes.chain.track import Points, Track, cross, dot
from synthesis.sheet import Sheet, csv_text, dxf_document, dxf_text

TOLERANCE = 1e-7
"""Largest distance of the drawn path from the exact path, in pitches."""


@dataclass(frozen=True)
class GrooveOptions:
    """Tolerances and numbers of points for the groove."""

    gap_tolerance: float = 1e-6
    """Step between slot and track that counts as none, in pitches."""
    min_nodes: int = 32
    """Initial number of nodes on the slot, which is doubled until the arcs are within the tolerance."""
    max_nodes: int = 4096
    """Largest number of nodes on the slot."""


OPTIONS = GrooveOptions()


class PathElement(NamedTuple):
    """An arc or a line from one point to another."""

    start: complex
    """Start point x + i y."""
    end: complex
    """End point x + i y."""
    turn: float
    """Turning angle of an arc in radians, positive to the left; 0 for a line."""

    @property
    def radius(self) -> float:
        """Return the signed radius, positive to the left; infinite for a line."""
        return float(abs(self.end - self.start) / (2 * np.sin(self.turn / 2))) if self.turn else np.inf

    @property
    def heading(self) -> complex:
        """Return the unit tangent at the start."""
        chord = self.end - self.start
        return complex(chord / abs(chord) * np.exp(-0.5j * self.turn))

    def points_at(self, fractions: Floats) -> Points:
        """Return the points at fractions of the length."""
        half_turn = 0.5 * self.turn
        # chord up to the fraction divided by the whole chord; for a line the fraction itself
        chord_ratio = np.sin(half_turn * fractions) / np.sin(half_turn) if self.turn else fractions
        points: Points = self.start + (self.end - self.start) * chord_ratio * np.exp(1j * half_turn * (fractions - 1))
        return points

    def offset_by(self, distance: float) -> PathElement:
        """Return the parallel element at a distance, positive to the left."""
        normal = 1j * self.heading
        return PathElement(
            self.start + distance * normal, self.end + distance * normal * np.exp(1j * self.turn), self.turn
        )


Polyarc = list[PathElement]
"""A curve of consecutive arcs and lines."""


def biarcs(points: Points, tangents: Points) -> Polyarc:
    """Connect points by pairs of tangent arcs.

    Parameters
    ----------
    points : ndarray of complex, shape (n,)
    tangents : ndarray of complex, shape (n,)
        Unit tangents at the points.

    Returns
    -------
    list of PathElement
        Two arcs between each pair of consecutive points.
    """
    chord, tangent_sum = np.diff(points), tangents[:-1] + tangents[1:]
    ahead, size = dot(chord, tangent_sum), dot(chord, chord)
    tangent_change = np.abs(np.diff(tangents)) ** 2  # 2 (1 - t1.t2), without the difference
    control_length = size / (ahead + np.sqrt(ahead**2 + tangent_change * size))
    middle = 0.5 * (points[:-1] + points[1:]) - 0.5 * control_length * np.diff(tangents)
    polyarc: Polyarc = []
    for start, joint, end, first, last in zip(points[:-1], middle, points[1:], tangents[:-1], tangents[1:]):
        chord_1, chord_2 = joint - start, end - joint
        polyarc.append(PathElement(start, joint, 2 * _angle(first, chord_1)))
        polyarc.append(PathElement(joint, end, 2 * _angle(chord_2, last)))
    return polyarc


def _angle(first: Any, second: Any) -> float:
    """Return the angle from the first vector to the second."""
    return float(np.arctan2(cross(first, second), dot(first, second)))


def slot_polyarc(slot: Slot) -> Polyarc:
    """Approximate the slot by biarcs.

    Parameters
    ----------
    slot : Slot

    Returns
    -------
    list of PathElement
        Arcs within `TOLERANCE` of the exact path.
    """
    allowed, count = TOLERANCE * slot.chain.pitch, OPTIONS.min_nodes
    while True:
        phases = np.union1d(np.linspace(slot.start, slot.end, count + 1), slot.breaks)
        phases = phases[np.concatenate([[True], np.diff(phases) > 1e-7 * slot.chain.period])]
        phases[-1] = slot.end
        polyarc = biarcs(slot.path(phases), -1j * slot.normals(phases))
        if count >= OPTIONS.max_nodes or _deviation(slot, polyarc, phases) <= allowed:
            return polyarc
        count *= 2


def _deviation(slot: Slot, polyarc: Polyarc, phases: Floats) -> float:
    """Return the largest distance of the path from its biarcs, at three points between neighbouring nodes."""
    fractions = np.array([[0.25], [0.5], [0.75]])
    points = slot.path((phases[:-1] + fractions * np.diff(phases)).ravel()).reshape(3, -1)
    distances = np.empty((2, *points.shape))
    for arc in range(2):
        starts, ends, turns = (np.array(column) for column in zip(*polyarc[arc::2]))
        # distance from a circle through the start with tangent t and curvature k: (2 a - k |p|^2)/(1 + ...), a to the left of t
        chords = ends - starts
        tangent, k = chords / np.abs(chords) * np.exp(-0.5j * turns), 2 * np.sin(turns / 2) / np.abs(chords)
        local = (points - starts) / tangent
        distances[arc] = np.abs(2 * local.imag - k * np.abs(local) ** 2) / (1 + np.abs(1 + 1j * k * local))
    return float(distances.min(axis=0).max())


def track_polyarc(track: Track, start: float, end: float) -> Polyarc:
    """Return the bare track between two arc lengths as elements of at most half a turn.

    Parameters
    ----------
    track : Track
    start, end : float
        Arc lengths; ``end`` is at most one lap beyond ``start``.
    """
    joints = np.concatenate([track.joints[:-1] + lap * track.total for lap in range(-1, 3)])
    cuts = np.concatenate([[start], joints[(joints > start) & (joints < end)], [end]])
    polyarc: Polyarc = []
    for low, high in itertools.pairwise(cuts):
        if high - low <= 1e-12 * track.total:
            continue
        turn = float(track.curvature[int(track.locate(0.5 * (low + high)).segment[0])] * (high - low))
        ends = np.linspace(low, high, 3 if abs(turn) > np.pi else 2)
        points = track.points(track.locate(ends))
        polyarc += [
            PathElement(complex(a), complex(b), turn / (len(ends) - 1)) for a, b in itertools.pairwise(points)
        ]
    return polyarc


class Groove(NamedTuple):
    """Closed contours in the direction of travel."""

    path: Polyarc
    """Path of the pins."""
    walls: dict[str, Polyarc]
    """Walls to the ``left`` and ``right`` of the path; empty without a roller."""


def groove(slot: Slot, roller_radius: float | None) -> Groove:
    """Compute the path of all pins and the walls of the groove for a roller.

    Parameters
    ----------
    slot : Slot
    roller_radius : float, optional
        Radius of the rollers. Without it the groove has no walls.

    Returns
    -------
    Groove
        Each wall is closed and at a roller radius from the path.

    Raises
    ------
    FieldError
        The roller is too large for the curvature of the path.
    """
    track, pitch = slot.chain.track, slot.chain.pitch
    ends = slot.path(np.array([slot.start, slot.end]))
    along, _ = slot.foot(ends)
    first = track.joints[slot.base[0][0]]
    track_path = track_polyarc(track, float(first + along[1]), float(first + along[0]) + track.total)
    path = _closed([*track_path, *slot_polyarc(slot)], pitch)
    if roller_radius is None:
        return Groove(path, {})
    refuse_undercut(roller_radius, min(smallest_radius(slot), min(abs(element.radius) for element in path)))
    return Groove(
        path,
        {
            name: _closed([element.offset_by(side * roller_radius) for element in path], pitch)
            for name, side in (("left", 1), ("right", -1))
        },
    )


def _closed(polyarc: Polyarc, pitch: float) -> Polyarc:
    """Join the ends of elements that do not meet by lines, also the last and the first."""
    closed: Polyarc = []
    for element, following in zip(polyarc, [*polyarc[1:], polyarc[0]]):
        closed.append(element)
        if abs(following.start - element.end) > OPTIONS.gap_tolerance * pitch:
            closed.append(PathElement(element.end, following.start, 0.0))
    return closed


def refuse_undercut(roller_radius: float, largest: float) -> None:
    """Raise a `FieldError` for a roller that would cut away the wall on the inside of a bend.

    Parameters
    ----------
    roller_radius : float
        Radius of the rollers.
    largest : float
        Smallest radius of curvature of the path, which the roller radius must not reach.
    """
    if roller_radius >= largest:
        raise FieldError(
            "/roller_radius",
            f"the radius must be less than the smallest radius of curvature of the path, {largest:.6g}",
            constraint="undercut",
            amount=roller_radius - largest,
        )


TRACK_COLOUR, PATH_COLOUR, WALL_COLOUR, PIN_COLOUR = "#5b6b7b", "#c0392b", "#2471a3", "#1b2631"
DXF_COLOURS = {"PATH": 1, "GROOVE_LEFT": 5, "GROOVE_RIGHT": 5, "PINS": 7}
"""AutoCAD colour index of each layer."""


def roller_walls(slot: Slot, phases: Floats, roller_radius: float | None) -> dict[str, Points]:
    """Return the walls of a slot for a roller: the parallel curves on both sides of the pin's path.

    Parameters
    ----------
    slot : Slot
    phases : ndarray, shape (n,)
    roller_radius : float, optional
        Radius of the rollers. Without it there are no walls.

    Returns
    -------
    dict of str to ndarray of complex, shape (n,)
        The ``left`` and the ``right`` wall, at a roller radius from the path and nowhere closer.

    Raises
    ------
    FieldError
        The roller is too large for the curvature of the path.
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
    """Write the slot as a table of phase, free pin, depth and slack.

    Parameters
    ----------
    slot : Slot
    phases : ndarray, shape (n,)
        Phases of the rows.
    phase_name : str
        Heading of the column of phases.
    phase_unit : float
        Travel of P1 along the driver for one unit of that column.
    roller_radius : float, optional
        Radius of the rollers, to add the two walls.
    more : dict of str to ndarray, optional
        Additional columns.
    """
    path = slot.path(phases)
    columns = {phase_name: phases / phase_unit, "x": path.real, "y": path.imag}
    columns |= {"depth": slot.depth(phases), "slack": slot.slack(phases)}
    for name, wall in roller_walls(slot, phases, roller_radius).items():
        columns |= {f"{name}_x": wall.real, f"{name}_y": wall.imag}
    columns |= more or {}
    return csv_text({name: column.tolist() for name, column in columns.items()})


def contours(groove_data: Groove) -> dict[str, list[list[float]]]:
    """Return the closed contours of a groove for export.

    Parameters
    ----------
    groove_data : Groove

    Returns
    -------
    dict of str to list
        By the name of the contour, one row per element: x and y of its start, and the bulge tan(turn / 4), positive
        to the left.
    """
    polyarcs = {"path": groove_data.path, **groove_data.walls}
    return {
        name: [[element.start.real, element.start.imag, float(np.tan(element.turn / 4))] for element in polyarc]
        for name, polyarc in polyarcs.items()
    }


def to_svg(slot: Slot, roller_radius: float | None) -> str:
    """Draw the bare track, the pins at the start of the window, their path and the walls of the groove.

    Parameters
    ----------
    slot : Slot
    roller_radius : float, optional
        Radius of the rollers, to draw the walls.

    Returns
    -------
    str
        SVG with y upwards.
    """
    track, groove_data = slot.chain.track, groove(slot, roller_radius)
    pins = slot.pins(np.array([slot.start]))[0]
    polyarcs = {
        "pin-path": groove_data.path,
        **{f"groove-{name}": polyarc for name, polyarc in groove_data.walls.items()},
    }
    outline = np.concatenate(
        [element.points_at(np.linspace(0, 1, 16)) for polyarc in polyarcs.values() for element in polyarc]
    )
    sheet = Sheet(outline, margin=0.06)
    thin, dot_radius = (fraction * max(sheet.width, sheet.height) for fraction in (0.0015, 0.006))
    track_points = track.points(track.locate(np.linspace(0, track.total, 721)))
    chain = " L ".join(map(sheet.at, pins))
    dashed = f'stroke="{TRACK_COLOUR}" stroke-dasharray="{3 * thin:.6g}"'
    parts = [
        f'<g fill="none" stroke-width="{thin:.6g}">',
        f'<path id="bare-track" {dashed} d="M {" L ".join(map(sheet.at, track_points))}"/>',
        *(
            f'<path id="{name}" stroke="{PATH_COLOUR if name == "pin-path" else WALL_COLOUR}" d="{_svg_path(polyarc, sheet)}"/>'
            for name, polyarc in polyarcs.items()
        ),
        f'<path id="chain" stroke="{PIN_COLOUR}" d="M {chain} Z"/>',
        "</g>",
        f'<g fill="{PIN_COLOUR}">',
        *(sheet.dot(pin, dot_radius) for pin in pins),
        "</g>",
    ]
    return sheet.text("Chain, its track and the groove with the compensation slot", parts)


def _svg_path(polyarc: list[PathElement], sheet: Sheet) -> str:
    """Return a closed contour as SVG arcs.

    A left turn with y upwards is a right turn on the page (sweep flag 0).
    """
    parts = [f"M {sheet.at(polyarc[0].start)}"]
    for element in polyarc:
        if element.turn == 0:
            parts.append(f"L {sheet.at(element.end)}")
            continue
        radius = f"{abs(element.radius):.9g}"
        large, sweep = int(abs(element.turn) > np.pi), int(element.turn < 0)
        parts.append(f"A {radius} {radius} 0 {large} {sweep} {sheet.at(element.end)}")
    return " ".join([*parts, "Z"])


def to_dxf(slot: Slot, roller_radius: float | None) -> str:
    """Write the path of the pins, the walls of the groove and the pins, each on a layer of its own.

    Parameters
    ----------
    slot : Slot
    roller_radius : float, optional
        Radius of the rollers, to write the walls.

    Returns
    -------
    str
        DXF in which path and walls are closed polylines of arcs and lines.
    """
    document = dxf_document(DXF_COLOURS, unit=0)
    space = document.modelspace()
    for name, rows in contours(groove(slot, roller_radius)).items():
        layer = "PATH" if name == "path" else f"GROOVE_{name.upper()}"
        space.add_lwpolyline(rows, format="xyb", close=True, dxfattribs={"layer": layer})
    for pin in slot.pins(np.array([slot.start]))[0].tolist():
        space.add_point((pin.real, pin.imag), dxfattribs={"layer": "PINS"})
    return dxf_text(document)
