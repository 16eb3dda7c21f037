"""The whole groove that a chain's pins run in, as closed contours of arcs and lines, and as files: CSV, SVG and DXF.

The path is the bare track where it stays and the slot where the slot replaces it. The slot is drawn by pairs of tangent
arcs (biarcs) within `TOLERANCE`; an arc moved square to itself is an arc again, so each wall is exactly a roller's
radius from that path. Where the slot meets the track at a step or a corner, walls that would cross are cut at their
crossing and walls that part are joined by an arc of the roller's radius: what is left is the edge of what the roller sweeps.
All coordinates are those of the track, in its own unit and at full size.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from synthesis.errors import FieldError
from synthesis.one_variable import Flags, Floats, bisect
from synthesis.scenes.chain.slot import Slot, smallest_radius
from synthesis.scenes.chain.track import Points, Track, cross, dot
from synthesis.sheet import Sheet, csv_text, dxf_document, dxf_text

TOLERANCE = 1e-7
"""Distance of the drawn path from the exact one, in pitches."""
GAP = 1e-6
"""Step between slot and track that counts as none, in pitches."""
FEWEST, MOST = 32, 4096
"""Nodes of the slot: doubled until the arcs are within the tolerance."""
CHECKS = 2048
"""Points of the path, and of each wall, whose distances tell whether the groove cuts into itself."""


class Bend(NamedTuple):
    """An arc, or with ``turn`` 0 a line, from one point to another; a positive turn (rad) goes to the left."""

    start: complex
    end: complex
    turn: float

    @property
    def radius(self) -> float:
        """Signed radius, left positive; infinite for a line."""
        return float(abs(self.end - self.start) / (2 * np.sin(self.turn / 2))) if self.turn else np.inf

    @property
    def heading(self) -> complex:
        """Unit tangent at the start."""
        chord = self.end - self.start
        return complex(chord / abs(chord) * np.exp(-0.5j * self.turn))

    def at(self, share: Floats) -> Points:
        """Points at shares of the way."""
        half = 0.5 * self.turn
        # chord of a share of the turn over the whole chord; for a line the share itself
        ratio = np.sin(half * share) / np.sin(half) if self.turn else share
        points: Points = self.start + (self.end - self.start) * ratio * np.exp(1j * half * (share - 1))
        return points

    def cut(self, first: float, last: float) -> Bend:
        """The part between two shares of the way."""
        start, end = (complex(point) for point in self.at(np.array([first, last])))
        return Bend(self.start if first == 0 else start, self.end if last == 1 else end, self.turn * (last - first))

    def moved(self, offset: float) -> Bend:
        """The bend moved square to itself, to the left where ``offset`` > 0."""
        normal = 1j * self.heading
        return Bend(self.start + offset * normal, self.end + offset * normal * np.exp(1j * self.turn), self.turn)

    @property
    def reversed(self) -> Bend:
        """The same bend the other way."""
        return Bend(self.end, self.start, -self.turn)


Run = list[Bend]


def backwards(run: Run) -> Run:
    """A run of bends the other way."""
    return [bend.reversed for bend in reversed(run)]


def biarcs(points: Points, tangents: Points) -> Run:
    """Two tangent arcs from each point to the next, with the given unit tangents."""
    chord, sum_ = np.diff(points), tangents[:-1] + tangents[1:]
    ahead, size = dot(chord, sum_), dot(chord, chord)
    closed = np.abs(np.diff(tangents)) ** 2  # 2 (1 - t1.t2), without the difference
    handle = size / (ahead + np.sqrt(ahead**2 + closed * size))
    middle = 0.5 * (points[:-1] + points[1:]) - 0.5 * handle * np.diff(tangents)
    run: Run = []
    for start, joint, end, first, last in zip(points[:-1], middle, points[1:], tangents[:-1], tangents[1:]):
        one, two = joint - start, end - joint
        run.append(Bend(start, joint, 2 * float(np.arctan2(cross(first, one), dot(first, one)))))
        run.append(Bend(joint, end, 2 * float(np.arctan2(cross(two, last), dot(two, last)))))
    return run


def slot_run(slot: Slot) -> Run:
    """The slot as biarcs within `TOLERANCE` of its exact path."""
    allowed, count = TOLERANCE * slot.chain.pitch, FEWEST
    while True:
        phases = np.union1d(np.linspace(slot.start, slot.end, count + 1), slot.breaks)
        phases = phases[np.concatenate([[True], np.diff(phases) > 1e-7 * slot.chain.period])]
        phases[-1] = slot.end
        run = biarcs(slot.path(phases), -1j * slot.normals(phases))
        if count >= MOST or _deviation(slot, run, phases) <= allowed:
            return run
        count *= 2


def _deviation(slot: Slot, run: Run, phases: Floats) -> float:
    """Largest distance of the path at three places between the nodes from the nearer of its two arcs."""
    shares = np.array([[0.25], [0.5], [0.75]])
    points = slot.path((phases[:-1] + shares * np.diff(phases)).ravel()).reshape(3, -1)
    off = np.empty((2, *points.shape))
    for arc in range(2):
        starts, ends, turns = (np.array(column) for column in zip(*run[arc::2]))
        # off a circle through the start with tangent t and curvature k: (2 a - k |p|^2)/(1 + ...), a the way to the left
        chords = ends - starts
        tangent, k = chords / np.abs(chords) * np.exp(-0.5j * turns), 2 * np.sin(turns / 2) / np.abs(chords)
        way = (points - starts) / tangent
        off[arc] = np.abs(2 * way.imag - k * np.abs(way) ** 2) / (1 + np.abs(1 + 1j * k * way))
    return float(off.min(axis=0).max())


def track_run(track: Track, start: float, end: float) -> Run:
    """The bare track between two arc lengths, ``end`` at most one lap beyond ``start``; no bend of more than half a turn."""
    joints = np.concatenate([track.joints[:-1] + lap * track.total for lap in range(-1, 3)])
    cuts = np.concatenate([[start], joints[(joints > start) & (joints < end)], [end]])
    run: Run = []
    for low, high in itertools.pairwise(cuts):
        if high - low <= 1e-12 * track.total:
            continue
        turn = float(track.curvature[int(track.place(0.5 * (low + high)).segment[0])] * (high - low))
        parts = np.linspace(low, high, 3 if abs(turn) > np.pi else 2)
        points = track.points(track.place(parts))
        run += [Bend(complex(a), complex(b), turn / (len(parts) - 1)) for a, b in itertools.pairwise(points)]
    return run


class Groove(NamedTuple):
    """Closed contours in the order of travel."""

    path: Run
    """The way of the pins."""
    walls: dict[str, Run]
    """``left`` and ``right`` of that way; none without a roller."""


def groove(slot: Slot, roller_radius: float | None) -> Groove:
    """The path of all pins and the walls of a roller's groove around it.

    Law: each wall is closed, does not cross itself, and is a roller's radius from the path, no closer anywhere.

    Raises `FieldError`: the roller is too large for a bend of the path, for the step at the slot's ends, or for the
    room between two parts of the track.
    """
    track, pitch = slot.chain.track, slot.chain.pitch
    ends = slot.path(np.array([slot.start, slot.end]))
    along, _ = slot.foot(ends)
    first = track.joints[slot.base[0][0]]
    stay = track_run(track, float(first + along[1]), float(first + along[0]) + track.total)
    slide = slot_run(slot)
    path = [*stay, *_bridge(stay, slide, pitch), *slide, *_bridge(slide, stay, pitch)]
    if roller_radius is None:
        return Groove(path, {})
    refuse_undercut(roller_radius, min(smallest_radius(slot), min(abs(bend.radius) for bend in path)))
    walls = {}
    for name, side in (("left", 1), ("right", -1)):
        outer = side == slot.outward
        kept, cut = ([bend.moved(side * roller_radius) for bend in run] for run in (stay, slide))
        kept, joint, cut = _joined(kept, cut, stay[-1], slide[0], roller_radius, side, outer, pitch)
        # the other end is the same one, travelled backwards: left is then right
        back = backwards(kept), backwards(cut), stay[0].reversed, slide[-1].reversed
        turned, other, cut = _joined(*back, roller_radius, -side, outer, pitch)
        walls[name] = [*backwards(turned), *joint, *backwards(cut), *backwards(other)]
    _refuse_cuts(path, walls, roller_radius, pitch)
    return Groove(path, walls)


def refuse_undercut(roller_radius: float, largest: float) -> None:
    """Raise `FieldError` for a roller that would cut away the wall on the inside of a bend of this radius."""
    if roller_radius >= largest:
        raise FieldError(
            "/roller_radius",
            f"a roller must be smaller than the path's smallest curvature radius, {largest:.6g}",
            constraint="undercut",
            amount=roller_radius - largest,
        )


def _bridge(run: Run, other: Run, pitch: float) -> Run:
    """The step from one run to another; none where they meet."""
    step = Bend(run[-1].end, other[0].start, 0.0)
    return [step] if abs(step.end - step.start) > GAP * pitch else []


def _joined(
    kept: Run, cut: Run, before: Bend, after: Bend, radius: float, side: int, outer: bool, pitch: float
) -> tuple[Run, Run, Run]:
    """The walls of two runs of the path where the second follows the first: both shortened, and what comes between.

    ``before`` and ``after`` are the path's bends there. On the slot's own side (``outer``) the second wall, the arc around the
    slot's end or the wall of the step crosses the first one; on the other side an arc around the track's end, and where the
    step is higher than the roller its wall, leads to the second one.
    """
    if abs(kept[-1].end - cut[0].start) <= GAP * pitch:
        return kept, [], [cut[0]._replace(start=kept[-1].end), *cut[1:]]
    foot, end = before.end, after.start
    heading = before.heading * np.exp(1j * before.turn)
    step = abs(end - foot) > GAP * pitch
    up = (end - foot) / abs(end - foot) if step else 0j

    if not outer:

        def clear(points: Points) -> Flags:
            """Whether points are a roller's radius from the step."""
            way = (points - foot) * np.conj(up)
            return np.asarray(
                np.abs(points - foot - up * np.clip(way.real, 0, abs(end - foot))) >= radius * (1 - 1e-12)
            )

        index, share = _first(cut, clear)
        rest = [cut[index].cut(share, 1.0), *cut[index + 1 :]]
        corner = foot + radius * heading
        if step and ((rest[0].start - foot) * np.conj(up)).real > GAP * pitch:
            return kept, [_around(foot, kept[-1].end, corner, side), Bend(corner, rest[0].start, 0.0)], rest
        return kept, [_around(foot, kept[-1].end, rest[0].start, side)], rest
    base, tail = kept[-1], cut
    if step:
        corner = end - radius * heading
        tail = [Bend(foot - radius * heading, corner, 0.0), _around(end, corner, cut[0].start, side), *cut]

    def outside(points: Points) -> Flags:
        """Whether points lie beyond the first wall, continued."""
        way, k = (points - base.start) / base.heading, 1 / base.radius
        return np.asarray(side * (2 * way.imag - k * np.abs(way) ** 2) >= 0)

    index, share = _first(tail, outside)
    rest = [tail[index].cut(share, 1.0), *tail[index + 1 :]]
    return [*kept[:-1], _shortened(base, rest[0].start)], [], rest


def _around(centre: complex, start: complex, end: complex, side: int) -> Bend:
    """The arc around a point, to the right for a positive ``side``, that is to the left of its way."""
    turn = float(np.angle((end - centre) / (start - centre)))
    return Bend(start, end, turn if -side * turn >= 0 else turn - side * 2 * np.pi)


def _shortened(bend: Bend, end: complex) -> Bend:
    """A bend that ends earlier, at a point of its own."""
    way = (end - bend.start) / bend.heading
    turn = 2 * float(np.angle(way)) if bend.turn else 0.0
    if not (abs(turn) < abs(bend.turn) if bend.turn else 0 < way.real < abs(bend.end - bend.start)):
        raise _no_wall()
    return Bend(bend.start, end, turn)


def _first(run: Run, holds: Callable[[Points], Flags]) -> tuple[int, float]:
    """The first bend of a run and the share of it from which a condition holds."""
    for index, bend in enumerate(run):
        if holds(bend.at(np.array([0.0])))[0]:
            return index, 0.0
        if holds(bend.at(np.array([1.0])))[0]:
            _, share = bisect(lambda at, b=bend: ~holds(b.at(at)), np.zeros(1), np.ones(1))  # type: ignore[misc]
            return index, float(share[0])
    raise _no_wall()


def _no_wall() -> FieldError:
    message = "the slot's ends are so far from the track, or so steep, that no groove of this roller joins them"
    return FieldError("/roller_radius", message, constraint="step")


def sampled(run: Run, count: int) -> Points:
    """About ``count`` points of a run, evenly spaced bend by bend."""
    lengths = np.array([abs(b.radius * b.turn) if b.turn else abs(b.end - b.start) for b in run])
    counts = np.maximum(1, np.ceil(count * lengths / lengths.sum())).astype(int)
    return np.concatenate([bend.at(np.arange(n) / n) for bend, n in zip(run, counts)])


def _refuse_cuts(path: Run, walls: dict[str, Run], radius: float, pitch: float) -> None:
    """Refuse walls that come closer to the path than the roller: another part of the groove cuts through them."""
    axis = sampled(path, CHECKS)
    for run in walls.values():
        points = sampled(run, CHECKS)
        nearest = np.concatenate([np.abs(part[:, None] - axis).min(axis=1) for part in np.array_split(points, 16)])
        missing = radius - float(nearest.min())
        if missing > 4 * GAP * pitch:
            raise FieldError(
                "/roller_radius",
                f"the groove would cut into itself: two parts of its path are {2 * missing:.6g} too close for twice the roller",
                constraint="groove_cut",
                amount=missing,
            )


TRACK_COLOUR, PATH_COLOUR, WALL_COLOUR, PIN_COLOUR = "#5b6b7b", "#c0392b", "#2471a3", "#1b2631"
DXF_COLOURS = {"PATH": 1, "GROOVE_LEFT": 5, "GROOVE_RIGHT": 5, "PINS": 7}
"""AutoCAD colour index of each layer."""


def roller_walls(slot: Slot, phases: Floats, roller_radius: float | None) -> dict[str, Points]:
    """The walls of a slot for a roller: the pin's path moved square to itself, to the left and to the right.

    Law: each wall is a roller's radius from the path, and no closer to any of its points.

    Raises `FieldError`: the roller is too large for the path.
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
