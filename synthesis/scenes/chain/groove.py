"""The groove in which the pins of a chain run, as closed contours of arcs and lines, and its SVG and DXF files.

The path consists of the bare track and, where the slot replaces the track, the slot. The slot is approximated by
pairs of tangent arcs (biarcs) within `GrooveOptions.tolerance`. The parallel curve of an arc is an arc, so each wall is
exactly a roller radius from this path. If the slot meets the track at a step or a corner, lines join the parallels,
which cross near an inner corner.

Coordinates are in the frame and the unit of the track, at full size.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synthesis.arrays import cross, dot
from synthesis.errors import FieldError
from synthesis.one_variable import Floats
from synthesis.scenes.chain.crescent import UPPER_ARC
from synthesis.scenes.chain.slot import Slot, smallest_radius
from synthesis.scenes.chain.track import Points, Track
from synthesis.sheet import Sheet, dxf_document, dxf_text


@dataclass(frozen=True)
class GrooveOptions:
    """Tolerances and numbers of points for the groove."""

    tolerance: float = 1e-7
    """Largest distance of the drawn path from the exact path, in pitches."""
    gap_tolerance: float = 1e-6
    """Step between slot and track that counts as none, in pitches."""
    min_nodes: int = 32
    """Initial number of nodes on the slot, which is doubled until the arcs are within the tolerance."""
    max_nodes: int = 4096
    """Largest number of nodes on the slot."""
    drawn_step: float = 0.02
    """Turn between two points of an arc in an SVG file, rad."""


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
        """Return the radius; infinite for a line."""
        return float(abs((self.end - self.start) / (2 * np.sin(self.turn / 2)))) if self.turn else np.inf

    def points(self) -> Points:
        """Return points from the start up to, but without, the end."""
        count = max(1, int(np.ceil(abs(self.turn) / OPTIONS.drawn_step)))
        fractions, half_turn = np.arange(count) / count, 0.5 * self.turn
        # chord up to the fraction divided by the whole chord; for a line the fraction itself
        chord_ratio = np.sin(half_turn * fractions) / np.sin(half_turn) if self.turn else fractions
        points: Points = self.start + (self.end - self.start) * chord_ratio * np.exp(1j * half_turn * (fractions - 1))
        return points

    def offset_by(self, distance: float) -> PathElement:
        """Return the parallel element at a distance, positive to the left."""
        chord = self.end - self.start
        normal = 1j * chord / abs(chord) * np.exp(-0.5j * self.turn)
        return PathElement(
            self.start + distance * normal, self.end + distance * normal * np.exp(1j * self.turn), self.turn
        )


Polyarc = list[PathElement]
"""A curve of consecutive arcs and lines."""


def biarcs(points: Points, tangents: Points) -> Polyarc:
    """Connect points, shape (n,), with unit tangents, by a pair of tangent arcs between each two consecutive points."""
    chord, tangent_sum = np.diff(points), tangents[:-1] + tangents[1:]
    ahead, size = dot(chord, tangent_sum), dot(chord, chord)
    tangent_change = np.abs(np.diff(tangents)) ** 2  # 2 (1 - t1.t2), without the difference
    control_length = size / (ahead + np.sqrt(ahead**2 + tangent_change * size))
    middle = 0.5 * (points[:-1] + points[1:]) - 0.5 * control_length * np.diff(tangents)
    chord_1, chord_2 = middle - points[:-1], points[1:] - middle
    turn_1, turn_2 = (
        2 * np.arctan2(cross(first, second), dot(first, second))
        for first, second in ((tangents[:-1], chord_1), (chord_2, tangents[1:]))
    )
    rows = zip(points[:-1], middle, points[1:], turn_1, turn_2)
    return [
        element
        for start, joint, end, first, second in rows
        for element in (PathElement(start, joint, float(first)), PathElement(joint, end, float(second)))
    ]


def slot_polyarc(slot: Slot) -> Polyarc:
    """Approximate the slot by biarcs within the tolerance."""
    allowed, count = OPTIONS.tolerance * slot.chain.pitch, OPTIONS.min_nodes
    while True:
        phases = np.union1d(slot.phases(count + 1), slot.breaks)
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
    """Return the bare track between two arc lengths, at most a lap apart, as elements of at most half a turn."""
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


def groove(slot: Slot, roller_radius: float | None) -> dict[str, Polyarc]:
    """Compute the path of all pins and the walls of the groove for a roller.

    Parameters
    ----------
    slot : Slot
    roller_radius : float, optional
        Radius of the rollers. Without it the groove has no walls.

    Returns
    -------
    dict of str to list of PathElement
        Closed contours in the direction of travel: ``path``, and the walls ``left`` and ``right``, each at a roller
        radius from the path.

    Raises
    ------
    FieldError
        The roller is too large for the curvature of the path.
    """
    track, pitch = slot.chain.track, slot.chain.pitch
    along, _ = track.feet(UPPER_ARC, slot.path(np.array([slot.start, slot.end])))
    first = track.joints[UPPER_ARC]
    track_path = track_polyarc(track, float(first + along[1]), float(first + along[0]) + track.total)
    path = _closed([*track_path, *slot_polyarc(slot)], pitch)
    if roller_radius is None:
        return {"path": path}
    _refuse_undercut(roller_radius, min(smallest_radius(slot), *(element.radius for element in path)))
    walls = {
        name: _closed([element.offset_by(distance) for element in path], pitch)
        for name, distance in (("left", roller_radius), ("right", -roller_radius))
    }
    return {"path": path, **walls}


def _closed(polyarc: Polyarc, pitch: float) -> Polyarc:
    """Join the ends of elements that do not meet by lines, also the last and the first."""
    closed: Polyarc = []
    for element, following in zip(polyarc, [*polyarc[1:], polyarc[0]]):
        closed.append(element)
        if abs(following.start - element.end) > OPTIONS.gap_tolerance * pitch:
            closed.append(PathElement(element.end, following.start, 0.0))
    return closed


def _refuse_undercut(roller_radius: float, largest: float) -> None:
    """Raise a `FieldError` for a roller that would cut away the wall on the inside of a bend."""
    if roller_radius >= largest:
        raise FieldError(
            "/roller_radius",
            f"the radius must be less than the smallest radius of curvature of the path, {largest:.6g}",
            constraint="undercut",
            amount=roller_radius - largest,
        )


def roller_walls(slot: Slot, phases: Floats, roller_radius: float) -> dict[str, Points]:
    """Return the ``left`` and the ``right`` wall of a slot for a roller, parallel to the pin's path, at phases, shape (n,).

    Raises
    ------
    FieldError
        The roller is too large for the curvature of the path.
    """
    _refuse_undercut(roller_radius, smallest_radius(slot))
    path, normals = slot.path(phases), slot.normals(phases)
    return {"left": path + roller_radius * normals, "right": path - roller_radius * normals}


def contours(slot: Slot, roller_radius: float | None) -> dict[str, list[list[float]]]:
    """Return the closed contours of the `groove` by name, each with one row per element.

    A row contains x and y of the start of the element, and the bulge tan(turn / 4), positive to the left.
    """
    return {
        name: [[element.start.real, element.start.imag, float(np.tan(element.turn / 4))] for element in polyarc]
        for name, polyarc in groove(slot, roller_radius).items()
    }


COLOURS = {"path": "#c0392b", "left": "#2471a3", "right": "#2471a3", "track": "#5b6b7b", "pins": "#1b2631"}
DXF_LAYERS = {"PATH": 1, "GROOVE_LEFT": 5, "GROOVE_RIGHT": 5, "PINS": 7}
"""AutoCAD colour index of each layer."""


def to_svg(slot: Slot, roller_radius: float | None) -> str:
    """Draw the bare track, the pins at the start of the window, their path and the walls of the groove, as SVG."""
    track, pins = slot.chain.track, slot.pins(np.array([slot.start]))[0]
    outlines = {
        name: np.concatenate([element.points() for element in polyarc])
        for name, polyarc in groove(slot, roller_radius).items()
    }
    sheet = Sheet(np.concatenate([*outlines.values()]), margin=0.06)
    thin, dot_radius = (fraction * max(sheet.width, sheet.height) for fraction in (0.0015, 0.006))
    outlines |= {"track": track.points(track.locate(np.linspace(0, track.total, 721))), "pins": pins}
    styles = "".join(f".{name}{{stroke:{colour}}}" for name, colour in COLOURS.items())
    parts = [
        f"<style>path{{fill:none;stroke-width:{thin:.6g}}}.track{{stroke-dasharray:{3 * thin:.6g}}}{styles}</style>",
        *(sheet.line(points, name, closed=True) for name, points in outlines.items()),
        *(sheet.dot(pin, dot_radius, f'fill="{COLOURS["pins"]}"') for pin in pins),
    ]
    return sheet.text("Chain, its track and the groove with the compensation slot", parts)


def to_dxf(slot: Slot, roller_radius: float | None) -> str:
    """Write path and walls as closed polylines of arcs and lines, and the pins, each on a layer of its own, as DXF."""
    document = dxf_document(DXF_LAYERS, unit=0)
    space = document.modelspace()
    for name, rows in contours(slot, roller_radius).items():
        layer = "PATH" if name == "path" else f"GROOVE_{name.upper()}"
        space.add_lwpolyline(rows, format="xyb", close=True, dxfattribs={"layer": layer})
    for pin in slot.pins(np.array([slot.start]))[0].tolist():
        space.add_point((pin.real, pin.imag), dxfattribs={"layer": "PINS"})
    return dxf_text(document)
