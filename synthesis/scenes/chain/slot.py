"""The slot that takes a chain's free pin: its locus, its depth and curvature, and what it does to the chain.

All pins but one stay on the track. The free pin P_k hangs between its two neighbours, both one pitch away, and over
one period it moves from one place of the track to the next pin's: its locus is the slot that replaces this part of
the track, and every pin of the chain runs through it in turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError
from synthesis.one_variable import Floats, rising_root
from synthesis.scenes.chain.closure import STRETCH_TOLERANCE, Chain, Extreme, closing_links, highest, lowest
from synthesis.scenes.chain.track import ChordError, ChordFault, Motion, NotClosing, Place, Points, cross, dot
from synthesis.work import Work

MIDDLE = 1e-6
"""Distance from the wanted middle of the slot, in pitches, within which a pin counts as not past it."""
TIE = 1e-10
"""Difference of slack, in pitches, up to which two phases count as equally slack."""
STRAIGHT = 1e-9
"""Bulge of the track over two links, in pitches, below which it counts as straight."""
SINGULAR = 1e-6
"""Sine of the angle between the free pin's links below which its motion is not determined. On a straight run it is
the root of the slack, and that is known to rounding."""


class Crossing(NamedTuple):
    """A pin on the track passes from one segment to the next: the slot's curvature jumps."""

    phase: float
    pin: int
    segment: int


@dataclass(frozen=True)
class Slot:
    """The locus of a chain's free pin over one period.

    Law: the free pin is one pitch from both its neighbours, at every phase.
    Law: where the slack at the window's ends is 0 the slot starts and ends on the track, tangent to it.
    """

    chain: Chain
    """Chain and track."""
    free: int
    """Number k of the free pin; P1 drives, P2..P(k-1) follow ahead of it, P(k+1)..PN behind it."""
    side: int
    """1 where the free pin lies to the left of the chord from P(k-1) to P(k+1), -1 to the right."""
    start: float
    """Phase of the window's start; its end is one period on."""

    @property
    def end(self) -> float:
        """Phase of the window's end."""
        return self.start + self.chain.period

    # The pins

    def neighbours(self, phase: Floats) -> tuple[tuple[Place, Motion], tuple[Place, Motion]]:
        """Places and motions of P(k-1) and of P(k+1)."""
        track, pitch = self.chain.track, self.chain.pitch
        first, motion = self.chain.drive(phase)
        before = track.carry(first, motion, pitch, self.free - 2)
        return before, track.carry(first, motion, pitch, self.chain.links - self.free, -1)

    def held(self, phase: Floats) -> tuple[Points, Points]:
        """Points of P(k-1) and P(k+1), between which the free pin hangs."""
        (before, _), (after, _) = self.neighbours(phase)
        return self.chain.track.points(before), self.chain.track.points(after)

    def path(self, phase: Floats) -> Points:
        """Points of the slot, shape (n,)."""
        return self.hung(*self.held(phase))

    def places(self, phase: Floats) -> Place:
        """Places of all pins, shape (n, links), each stepped from the one before; of the free pin the start of its base."""
        track, links, k = self.chain.track, self.chain.links, self.free - 1
        places = Place(*np.zeros((3, len(phase), links)))
        places.segment[:, k] = self.base[0][0]
        first, _ = self.chain.drive(phase)
        for pins, direction in ((range(k), 1), (range(links, k, -1), -1)):
            place = first
            for pin in pins:
                place = track.step(place, self.chain.pitch, direction) if pin not in (0, links) else first
                for column, found in zip(places, place):
                    column[:, pin % links] = found
        return Place(places.segment.astype(np.intp), places.along, places.lap.astype(np.int64))

    def pins(self, phase: Floats) -> Points:
        """All pins, shape (n, links)."""
        return self.points_at(self.places(phase))

    def points_at(self, places: Place) -> Points:
        """The points of all pins from their `places`: the free pin hangs between its neighbours."""
        points, k = self.chain.track.points(places), self.free - 1
        points[:, k] = self.hung(points[:, k - 1], points[:, (k + 1) % self.chain.links])
        return points

    def hung(self, before: Points, after: Points) -> Points:
        """The point one pitch from both neighbours: from the middle of their chord, square to it.

        The height is sqrt((L - h)(L + h)), h half the chord; below the chord for the crescent's upper arc.
        """
        half, pitch = 0.5 * (after - before), self.chain.pitch
        h = np.abs(half)
        if np.any(h > pitch * (1 + STRETCH_TOLERANCE)):
            raise ChordError(ChordFault.NO_POINT, self.start)
        height = np.sqrt(np.maximum((pitch - h) * (pitch + h), 0.0))
        return before + half * (1 + 1j * self.side * height / h)

    def motion(self, phase: Floats) -> tuple[Points, Points, Points]:
        """The free pin, its velocity and its acceleration by the phase, shape (n,) each.

        For either neighbour Q: (P - Q).(P' - Q') = 0 and (P - Q).(P'' - Q'') = -|P' - Q'|^2. Where both links are in
        line (a free pin on a straight run without slack) the velocity has no limit; NaN there.
        """
        track, pitch = self.chain.track, self.chain.pitch
        neighbours = self.neighbours(phase)
        ends = [track.points(place) for place, _ in neighbours]
        tangents = [track.tangents(place) for place, _ in neighbours]
        point = self.hung(*ends)
        e1, e2 = ((point - end) / pitch for end in ends)
        v1, v2 = (tangent * moved.rate for tangent, (_, moved) in zip(tangents, neighbours))
        a1, a2 = (
            tangent * (moved.bend + 1j * track.curvature[place.segment] * moved.rate**2)
            for tangent, (place, moved) in zip(tangents, neighbours)
        )
        sine = cross(e1, e2)
        inverse = 1 / np.where(np.abs(sine) < SINGULAR, np.nan, sine)

        def solve(along1: Floats, along2: Floats) -> Points:
            """The vector with these components along both links."""
            return 1j * (along2 * e1 - along1 * e2) * inverse

        velocity = solve(dot(e1, v1), dot(e2, v2))
        turn1, turn2 = np.abs(velocity - v1) ** 2 / pitch, np.abs(velocity - v2) ** 2 / pitch
        return point, velocity, solve(dot(e1, a1) - turn1, dot(e2, a2) - turn2)

    def curvature(self, phase: Floats) -> Floats:
        """Signed curvature of the slot, left positive; NaN where the free pin stands still or is not determined."""
        _, velocity, acceleration = self.motion(phase)
        speed = np.abs(velocity)
        return cross(velocity, acceleration) / np.where(speed > 0, speed, np.nan) ** 3

    def normals(self, phase: Floats) -> Points:
        """Unit normals of the slot, to the left of travel, shape (n,); at an end without one, from just inside."""
        velocity = self.motion(phase)[1]
        lost = ~np.isfinite(velocity)
        if lost.any():
            inward = np.where(phase[lost] < 0.5 * (self.start + self.end), 1.0, -1.0)
            velocity[lost] = self.motion(phase[lost] + 1e-6 * self.chain.period * inward)[1]
        velocity = np.where(np.isfinite(velocity), velocity, 1.0)
        return 1j * velocity / np.abs(velocity)

    # Slack and depth

    def slack(self, phase: Floats) -> Floats:
        """Arc length by which two links from P(k-1) along the bare track overrun P(k+1); negative: stretch.

        On an arc of radius R it is R (2 du - G), with G the angle between the neighbours: R times the defect D.
        """
        track = self.chain.track
        (before, _), (after, _) = self.neighbours(phase)
        on = track.advance(before, self.chain.pitch, 2)
        # Only differences of the same segment keep the digits of a long track. P(k+1) is counted backwards from P1:
        # one lap behind.
        laps = on.lap - (after.lap + 1)
        return track.joints[on.segment] - track.joints[after.segment] + track.total * laps + (on.along - after.along)

    def slack_rate(self, phase: Floats) -> tuple[Floats, Floats]:
        """First and second derivative of the slack by the phase."""
        before, (_, after) = self.neighbours(phase)
        _, on = self.chain.track.carry(*before, self.chain.pitch, 2)
        return on.rate - after.rate, on.bend - after.bend

    def foot(self, points: Points) -> tuple[Floats, Floats]:
        """Arc length along the base and depth of points; the base's segments meet where the feet change over."""
        track = self.chain.track
        along, depth = np.zeros(len(points)), np.full(len(points), np.inf)
        for segment, shift in self.base:
            here, offset = track.feet(segment, points)
            slip = np.maximum(-here, here - track.length[segment])
            worse = np.abs(offset) + np.maximum(slip, 0.0) >= np.abs(depth)
            along, depth = np.where(worse, along, here + shift), np.where(worse, depth, offset)
        return along, self.outward * depth

    def depth(self, phase: Floats) -> Floats:
        """Distance of the slot from the bare track, on the slot's side: r - R1 on the crescent."""
        return self.foot(self.path(phase))[1]

    # What belongs to the whole slot

    @cached_property
    def outward(self) -> int:
        """1 where the slot lies to the left of the bare track, -1 to the right, where it is furthest from it."""
        points = self.path(np.linspace(self.start, self.end, 65))
        offsets = [self.chain.track.feet(segment, points)[1] for segment, _ in self.base]
        nearest = np.array(offsets)[np.argmin(np.abs(offsets), axis=0), np.arange(len(points))]
        return 1 if nearest[np.argmax(np.abs(nearest))] >= 0 else -1

    @cached_property
    def base(self) -> tuple[tuple[int, float], ...]:
        """The segments that the slot replaces, each with the arc length of its start from that of the first."""
        track = self.chain.track
        first, _ = self.chain.drive(np.array([self.start]))
        from_, to = (track.advance(first, self.chain.pitch, links) for links in (self.free - 1, self.free))
        # A pin at a joint, up to rounding, does not belong to the segment that it only touches.
        tiny = MIDDLE * self.chain.pitch
        begin = track.place(track.position(from_) + tiny)
        finish = track.place(track.position(to) - tiny)
        first_segment, count = int(begin.segment[0]), track.count
        hops = int(finish.segment[0] + count * finish.lap[0]) - (first_segment + count * int(begin.lap[0]))
        indices = [(first_segment + hop) % count for hop in range(max(hops, 0) + 1)]
        starts = np.concatenate([[0.0], np.cumsum(track.length[indices])])
        return tuple((index, float(shift)) for index, shift in zip(indices, starts))

    @cached_property
    def crossings(self) -> tuple[Crossing, ...]:
        """Passages of a joint by the pins that stay on the track, within the window, in order of phase.

        No search: a joint that pin i will pass, stepped back by i - 1 links, is where P1 is at that moment.
        """
        track, pitch, links, k = self.chain.track, self.chain.pitch, self.chain.links, self.free
        first, _ = self.chain.drive(np.array([self.start]))
        ahead = track.position(track.advance(first.repeated(k), pitch, np.arange(k)))
        places = track.advance(first.repeated(links - k), pitch, np.arange(links - k, 0, -1), -1)
        behind = track.position(places) + track.total
        found = []
        for joint in range(track.count):
            s = float(track.joints[joint])
            lap = int(s < ahead[0])
            s += lap * track.total
            at = Place(np.array([joint]), np.zeros(1), np.array([lap]))
            if s < ahead[-1]:
                pin = int(np.searchsorted(ahead, s, side="right"))
                first_pin = track.advance(at, pitch, pin - 1, -1)
            elif s >= behind[0]:
                pin = k + int(np.searchsorted(behind, s, side="right"))
                first_pin = track.advance(at, pitch, links + 1 - pin)
                first_pin = first_pin._replace(lap=first_pin.lap - 1)
            else:
                continue
            phase = float(self.chain.phase_of(first_pin)[0])
            found.append(Crossing(min(max(phase, self.start), self.end), pin, joint))
        return tuple(sorted(found))

    @property
    def breaks(self) -> Floats:
        """Phases between which the slot is smooth: the window's ends and the crossings inside it."""
        inner = [crossing.phase for crossing in self.crossings]
        phases = np.array([self.start, *inner, self.end])
        apart = np.concatenate([[True], np.diff(phases) > 1e-9 * self.chain.period])
        phases = phases[apart]
        phases[-1] = self.end
        return phases

    @cached_property
    def frame(self) -> tuple[complex, complex]:
        """Origin and direction of the slot's own frame: the middle of its ends, x from its end to its start."""
        start, end = self.path(np.array([self.start, self.end]))
        return complex(0.5 * (start + end)), complex((start - end) / abs(start - end))

    def in_frame(self, points: Points) -> Points:
        """Points of the drawing in the slot's own frame."""
        origin, direction = self.frame
        return (points - origin) * direction.conjugate()

    def from_frame(self, points: Points) -> Points:
        """Points of the slot's own frame in the drawing: the inverse of `in_frame`."""
        origin, direction = self.frame
        return origin + points * direction


def find_slot(
    chain: Chain,
    middle: float,
    side: int = 1,
    start: float | None = None,
    place_field: str = "/free_segment",
    work: Work | None = None,
) -> Slot:
    """The slot nearest to a place of the track.

    The window starts where the slack is least: on a chain that closes critically both ends then lie on the bare track.
    The free pin is the last one that has not passed ``middle`` at that phase. ``work`` is asked between the steps.

    ``middle``: arc length of the place, from the driver's start. ``side``, one of {1, -1}: side of a slot on a straight
    run, 1 left; elsewhere it is the side to which the track bends out. ``start``: another phase for the window's start;
    its ends then have a step. ``place_field``: the request's field that decides where the slot lies.

    Raises
    ------
    NotClosing
        The chain misses length at some phase, or has a whole link too many at every phase.
    FieldError
        No slot can be there.
    ChordError
        A link does not fit on the track, or the chain does not run smoothly.
    """
    track, pitch, links, work = chain.track, chain.pitch, chain.links, work or Work()
    work.go_on()
    least = chain.least_overrun()
    work.go_on()
    allowed = STRETCH_TOLERANCE * pitch
    too_many = links > 1 and Chain(track, pitch, links - 1).least_overrun().value >= -allowed
    if least.value < -allowed or too_many:
        raise NotClosing(links, closing_links(track, pitch, work), -least.value, "on this track")
    chosen = least.phase if start is None else float(start % chain.period)
    work.go_on()
    slot = _slot_at(chain, chosen, middle, side, place_field)
    _check_running(slot)
    if start is not None:
        return slot
    work.go_on()
    # A crescent may be critical at two states, each the other's mirror image: then the first is taken.
    found = lowest(slot.slack, 0.0, chain.period, chain.cells, tie=TIE * pitch)
    phase = polished(slot, found.phase, 1) % chain.period
    if chain.period - phase < 1e-9 * chain.period:
        phase = 0.0
    return _slot_at(chain, phase, middle, side, place_field)


def _check_running(slot: Slot) -> None:
    """Raise `ChordError` where a neighbour of the free pin jumps or does not move on with the chain.

    The first place one pitch ahead always exists on a closed track that is large enough; that it also moves smoothly
    is a property of the track's bends.
    """
    chain, track = slot.chain, slot.chain.track
    phases = np.linspace(slot.start, slot.end, chain.cells + 1)
    for place, motion in slot.neighbours(phases):
        moved = np.diff(track.position(place))
        wrong = np.flatnonzero((motion.rate[:-1] <= 0) | (moved <= 0) | (moved > 0.5 * chain.pitch))
        if len(wrong):
            raise ChordError(ChordFault.REVERSAL, float(track.position(place)[wrong[0]] % track.total))


def _slot_at(chain: Chain, phase: float, middle: float, side: int, place_field: str) -> Slot:
    """The slot of the pin that comes to ``middle`` next; ``side`` decides only where the track does not bend.

    There is none where the track bends one way at the free pin's start and the other way at its end: on its way the
    pin would have to pass the straight line between its neighbours, which its slack does not allow.
    """
    track, pitch, links = chain.track, chain.pitch, chain.links
    first, _ = chain.drive(np.array([phase]))
    places = track.advance(first.repeated(links + 1), pitch, np.arange(links + 1))
    passed = track.position(places) - middle < MIDDLE * pitch
    free = int(np.clip(np.count_nonzero(passed), 2, links - 1))
    # Where the free pin comes from and where it goes to: at both places the bare track bulges over two links.
    links_out = np.diff(track.points(places.rows(slice(free - 2, free + 2)))) / pitch
    bulge = cross(links_out[1:], links_out[:-1])
    sides = np.sign(bulge[np.abs(bulge) > STRAIGHT])
    if len(sides) == 2 and sides[0] != sides[1]:
        raise FieldError(
            place_field,
            "the track bends to both sides within one link of the free pin: no slot can lead it from one to the other",
            constraint="no_slot",
        )
    return Slot(chain, free, int(sides[0]) if len(sides) else side, phase)


def polished(slot: Slot, phase: float, sign: int) -> float:
    """The phase of a minimum (``sign`` 1) or maximum (-1) of the slack, placed where its derivative vanishes.

    Values alone fix the place only to the root of the rounding error, the derivative to rounding.
    """
    near = 1e-3 * slot.chain.period
    shift = slot.chain.period if phase < near else 0.0
    low, high = phase + shift - near, phase + shift + near

    def rising(phase: Floats) -> tuple[Floats, Floats]:
        rate, bend = slot.slack_rate(phase)
        return sign * rate, sign * bend

    ends, _ = rising(np.array([low, high]))
    if not ends[0] < 0 <= ends[1]:
        return phase
    return float(rising_root(rising, low, high, [phase + shift])[0]) - shift


PINS_AT_ONCE = 200_000
"""Pins that are placed at once: bounds the memory, and the time until a client that has left is noticed."""
TIGHTEST = 4
"""Pieces of a slot that are searched closely for its smallest curvature radius."""


class Report(NamedTuple):
    """What a slot is and does; lengths in the track's unit, phases as arc length of P1."""

    slack_min: float
    slack_max: Extreme
    depth_max: Extreme
    end_step: float
    radius_min: float
    """Smallest curvature radius of the pin's path; infinite on a straight path."""
    single_valued: bool
    """Whether the slot's own x runs one way: then y(x) exists."""
    condition: float
    """Largest change of the free pin's place per change of a link's length."""
    clearance: float
    """Smallest distance of the slot from the segments that it does not replace."""
    chord_error: float
    """Largest difference between a chord and the pitch, over all links."""
    free_speed: tuple[float, float]
    """Smallest and largest speed of the free pin per speed of P1."""
    held_chord_error: float
    """Without a slot: by how much each link of a pin held half-way on the bare track is too short."""


def report(slot: Slot, phases: Floats, work: Work | None = None) -> Report:
    """Extremes of a slot over its window; the chords are checked at ``phases``, shape (n,); ``work`` is asked in between."""
    track, cells, work = slot.chain.track, slot.chain.cells, work or Work()
    work.go_on()
    most = highest(slot.slack, slot.start, slot.end, cells)
    slack_max = Extreme(polished(slot, most.phase, -1), most.value)
    grid = np.concatenate([np.linspace(a, b, 33) for a, b in _smooth_pieces(slot)])
    _, velocity, _ = slot.motion(grid)
    known = velocity[np.isfinite(velocity)]
    speed = np.abs(known)
    work.go_on()
    _, direction = slot.frame
    replaced = {segment for segment, _ in slot.base}
    others = [index for index in range(track.count) if index not in replaced]

    def room(phase: Floats) -> Floats:
        points = slot.path(phase)
        return np.min([track.distance(index, points) for index in others], axis=0)

    return Report(
        slack_min=lowest(slot.slack, slot.start, slot.end, cells).value,
        slack_max=slack_max,
        depth_max=highest(slot.depth, slot.start, slot.end, cells),
        end_step=float(np.abs(slot.depth(np.array([slot.start, slot.end]))).max()),
        radius_min=smallest_radius(slot),
        single_valued=bool(np.all((known / direction).real < 0)),
        condition=_condition(slot, np.concatenate([[slot.start], grid, [slot.end]])),
        clearance=lowest(room, slot.start, slot.end, cells).value if others else np.inf,
        chord_error=chord_error(slot, phases, work),
        free_speed=(float(speed.min()), float(speed.max())),
        held_chord_error=_held_chord_error(slot, slack_max.phase, cells),
    )


def _smooth_pieces(slot: Slot) -> list[tuple[float, float]]:
    """Windows between the breaks, just inside them: at a break the curvature has two values."""
    inside = 1e-9 * slot.chain.period
    return [(float(a) + inside, float(b) - inside) for a, b in zip(slot.breaks[:-1], slot.breaks[1:])]


def smallest_radius(slot: Slot) -> float:
    """The smallest curvature radius of the pin's path, an upper limit for a roller's; infinite on a straight path."""

    def radius(phase: Floats) -> Floats:
        bent = np.abs(slot.curvature(phase))
        known = np.isfinite(bent) & (bent > 0)
        return np.where(known, 1 / np.where(known, bent, 1.0), np.inf)

    pieces = _smooth_pieces(slot)
    coarse = radius(np.concatenate([np.linspace(a, b, 33) for a, b in pieces])).reshape(len(pieces), 33).min(axis=1)
    # Only the pieces that may hold the smallest one are searched closely: a track may have hundreds.
    tightest = np.argsort(coarse, kind="stable")[:TIGHTEST]
    return min(lowest(radius, start, end, 32, 3).value for start, end in (pieces[index] for index in tightest))


def chord_error(slot: Slot, phases: Floats, work: Work | None = None) -> float:
    """Largest difference between any of the chain's chords and the pitch, at phases of shape (n,)."""
    worst, few, work = 0.0, max(1, PINS_AT_ONCE // slot.chain.links), work or Work()
    for first in range(0, len(phases), few):
        work.go_on()
        pins = slot.pins(phases[first : first + few])
        worst = max(worst, float(np.abs(np.abs(pins - np.roll(pins, -1, axis=1)) - slot.chain.pitch).max()))
    return worst


def _condition(slot: Slot, phases: Floats) -> float:
    """1/|sin| of the angle between the free pin's links, at its worst; infinite where they are in line."""
    first, last = slot.held(phases)
    point = slot.hung(first, last)
    sine = np.abs(cross(point - first, point - last)).min() / slot.chain.pitch**2
    return float(1 / sine) if sine > SINGULAR else np.inf


def _held_chord_error(slot: Slot, phase: float, cells: int) -> float:
    """By how much the links are too short of a free pin that is held half-way between its neighbours on the track."""
    track = slot.chain.track

    def shortfall(phase: Floats) -> Floats:
        (before, _), (after, _) = slot.neighbours(phase)
        middle = 0.5 * (track.position(before) + (track.position(after) + track.total))
        held = track.points(track.place(middle))
        chords = np.abs([held - track.points(end) for end in (before, after)])
        return np.abs(slot.chain.pitch - chords).max(axis=0)

    return highest(shortfall, slot.start, slot.end, cells, 3).value


def wheel_conflict(slot: Slot, wheel: int) -> Extreme:
    """Largest phase difference, in links, between the driver and another wheel that the chain turns.

    A pin that enters the wheel marks its phase; a pin one link further on marks the same. The value is the range over
    a period, the phase where the wheel is furthest ahead.

    Raises `ChordError`: the wheel cannot hold one link.
    """
    chain, track = slot.chain, slot.chain.track
    own = float(track.link_lengths(chain.pitch)[wheel])
    if not own <= track.length[wheel]:
        raise ChordError(ChordFault.NO_POINT, float(track.joints[wheel]))
    first, _ = chain.drive(np.array([slot.start]))
    places = track.advance(first.repeated(chain.links + 1), chain.pitch, np.arange(chain.links + 1))
    onto = track.joints[wheel] + track.total * (track.joints[wheel] < track.position(first)[0])
    # The last pin that is still short of the wheel enters it within the period.
    short = int(np.count_nonzero(track.position(places) < onto)) - 1

    def lead(phase: Floats) -> Floats:
        start, _ = chain.drive(phase)
        entering = track.advance(start, chain.pitch, short)
        entered = track.position(entering) >= onto
        later = track.step(entering, chain.pitch)
        along = np.where(entered, track.position(entering) - onto, track.position(later) - onto - own)
        return along / own - (phase - slot.start) / chain.period

    most = highest(lead, slot.start, slot.end, chain.cells)
    return Extreme(most.phase, most.value - lowest(lead, slot.start, slot.end, chain.cells).value)


class Pins(NamedTuple):
    """All pins at some phases; each array has shape (n, links)."""

    points: Points
    segment: NDArray[np.intp]
    """The segment that a pin is on; the free pin hangs beside the first one that the slot replaces."""
    along: Floats
    """Way from that segment's start; 0 for the free pin."""

    @property
    def link_angle(self) -> Floats:
        """Direction of the link from each pin to the next, rad from x, continuous over the phases."""
        links = np.roll(self.points, -1, axis=1) - self.points
        angles: Floats = np.unwrap(np.angle(links), axis=0)
        return angles


def pins_at(slot: Slot, phases: Floats) -> Pins:
    """All pins of a chain at phases of shape (n,).

    Law: neighbours are one pitch apart, the last and the first too.
    """
    places = slot.places(phases)
    return Pins(slot.points_at(places), places.segment, places.along)
