"""The slot that takes a chain's free pin: its locus, its depth and curvature, and what it does to the chain.

All pins but one stay on the track. The free pin P_k hangs between its two neighbours, both one pitch away, and over
one period it moves from one place of the track to the next pin's: its locus is the slot that replaces this piece of
track, and every pin of the chain runs through it in turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from synthesis.chain.closure import STRETCH_TOLERANCE, Chain, closing_links, lowest
from synthesis.chain.track import ChordError, ChordFault, Floats, Motion, Place

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


class Stretched(ValueError):
    """The chain is too short or too long for its track by so much that another number of links would close.

    Parameters
    ----------
    nearest_links : int
        The number of links that closes.
    missing : float
        Length that is missing at the worst phase; negative: excess at the least slack phase.
    """

    def __init__(self, nearest_links: int, missing: float) -> None:
        super().__init__(f"{nearest_links} links close; missing length {missing:.6g}")
        self.nearest_links = nearest_links
        self.missing = missing


class NoSlot(ValueError):
    """The track bends one way where the free pin starts and the other way where it ends.

    On its way it would have to pass the straight line between its neighbours, which its slack does not allow.
    """

    def __init__(self) -> None:
        super().__init__(
            "the track bends to both sides within one link of the free pin: no slot can lead it from one to the other"
        )


@dataclass(frozen=True)
class Slot:
    """The locus of a chain's free pin over one period.

    Law: the free pin is one pitch from both its neighbours, at every phase.
    Law: where the slack at the window's ends is 0 the slot starts and ends on the track, tangent to it.

    Parameters
    ----------
    chain : Chain
        Chain and track.
    free : int
        Number k of the free pin; P1 drives, P2..P(k-1) follow ahead of it, P(k+1)..PN behind it.
    side : int
        1 where the free pin lies to the left of the chord from P(k-1) to P(k+1), -1 to the right.
    start : float
        Phase of the window's start; its end is one period on.
    """

    chain: Chain
    free: int
    side: int
    start: float

    @property
    def end(self) -> float:
        """Phase of the window's end."""
        return self.start + self.chain.period

    # The pins

    def neighbours(self, phase: Floats) -> tuple[Place, Motion, Place, Motion]:
        """Places and motions of P(k-1) and P(k+1)."""
        track, pitch = self.chain.track, self.chain.pitch
        first, motion = self.chain.drive(phase)
        before, before_motion = track.advance(first, pitch, self.free - 2, 1, motion)
        after, after_motion = track.advance(first, pitch, self.chain.links - self.free, -1, motion)
        return before, before_motion, after, after_motion

    def path(self, phase: Floats) -> Floats:
        """Points of the slot, shape (n, 2)."""
        before, _, after, _ = self.neighbours(phase)
        return self.hung(self.chain.track.points(before), self.chain.track.points(after))

    def pins(self, phase: Floats) -> Floats:
        """All pins, shape (n, links, 2), each stepped from the one before it."""
        track, pitch, links = self.chain.track, self.chain.pitch, self.chain.links
        place, _ = self.chain.drive(phase)
        points = np.empty((len(phase), links, 2))
        points[:, 0] = track.points(place)
        for pin in range(1, self.free - 1):
            place = track.step(place, pitch)
            points[:, pin] = track.points(place)
        place, _ = self.chain.drive(phase)
        for pin in range(links - 1, self.free - 1, -1):
            place = track.step(place, pitch, -1)
            points[:, pin] = track.points(place)
        k = self.free - 1
        points[:, k] = self.hung(points[:, k - 1], points[:, (k + 1) % links])
        return points

    def hung(self, before: Floats, after: Floats) -> Floats:
        """The point one pitch from both neighbours: from the middle of their chord, square to it.

        The height is sqrt((L - h)(L + h)), h half the chord; below the chord for the crescent's upper arc.
        """
        half = 0.5 * (after - before)
        h = np.hypot(half[:, 0], half[:, 1])
        pitch = self.chain.pitch
        if np.any(h > pitch * (1 + STRETCH_TOLERANCE)):
            raise ChordError(ChordFault.NO_POINT, self.start)
        height = np.sqrt(np.maximum((pitch - h) * (pitch + h), 0.0))
        square = np.stack([-half[:, 1], half[:, 0]], axis=1) / h[:, None]
        return before + half + (self.side * height)[:, None] * square

    def motion(self, phase: Floats) -> tuple[Floats, Floats, Floats]:
        """The free pin, its velocity and its acceleration by the phase, shape (n, 2) each.

        For either neighbour Q: (P - Q).(P' - Q') = 0 and (P - Q).(P'' - Q'') = -|P' - Q'|^2. Where both links are in
        line (a free pin on a straight run without slack) the velocity has no limit; NaN there.
        """
        track = self.chain.track
        before, before_motion, after, after_motion = self.neighbours(phase)
        point = self.hung(track.points(before), track.points(after))
        links, velocities, accelerations = [], [], []
        for place, (rate, bend) in ((before, before_motion), (after, after_motion)):
            tangent = track.tangents(place)
            left = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
            links.append((point - track.points(place)) / self.chain.pitch)
            velocities.append(tangent * rate[:, None])
            accelerations.append(tangent * bend[:, None] + left * (track.curvature[place.segment] * rate**2)[:, None])
        (e1, e2), (v1, v2), (a1, a2) = links, velocities, accelerations
        sine = e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]
        sine = np.where(np.abs(sine) < SINGULAR, np.nan, sine)

        def solve(right1: Floats, right2: Floats) -> Floats:
            x = (right1 * e2[:, 1] - right2 * e1[:, 1]) / sine
            y = (right2 * e1[:, 0] - right1 * e2[:, 0]) / sine
            return np.stack([x, y], axis=1)

        velocity = solve(_dot(e1, v1), _dot(e2, v2))
        turn1, turn2 = velocity - v1, velocity - v2
        pitch = self.chain.pitch
        acceleration = solve(_dot(e1, a1) - _dot(turn1, turn1) / pitch, _dot(e2, a2) - _dot(turn2, turn2) / pitch)
        return point, velocity, acceleration

    def curvature(self, phase: Floats) -> Floats:
        """Signed curvature of the slot, left positive; NaN where the free pin stands still or is not determined."""
        _, v, a = self.motion(phase)
        speed = np.hypot(v[:, 0], v[:, 1])
        return (v[:, 0] * a[:, 1] - v[:, 1] * a[:, 0]) / np.where(speed > 0, speed, np.nan) ** 3

    def normals(self, phase: Floats) -> Floats:
        """Unit normals of the slot, to the left of travel, shape (n, 2); at an end without one, from just inside."""
        _, v, _ = self.motion(phase)
        lost = ~np.isfinite(v).all(axis=1)
        if lost.any():
            inward = np.where(phase[lost] < 0.5 * (self.start + self.end), 1.0, -1.0)
            v[lost] = self.motion(phase[lost] + 1e-6 * self.chain.period * inward)[1]
        v = np.where(np.isfinite(v), v, [1.0, 0.0])
        return np.stack([-v[:, 1], v[:, 0]], axis=1) / np.hypot(v[:, 0], v[:, 1])[:, None]

    # Slack and depth

    def slack(self, phase: Floats) -> Floats:
        """Arc length by which two links from P(k-1) along the bare track overrun P(k+1); negative: stretch.

        On an arc of radius R it is R (2 du - G), with G the angle between the neighbours: R times the defect D.
        """
        return self._slack(phase)[0]

    def _slack(self, phase: Floats) -> tuple[Floats, Floats]:
        """Slack and its derivative by the phase."""
        track = self.chain.track
        before, before_motion, after, after_motion = self.neighbours(phase)
        on, on_motion = track.advance(before, self.chain.pitch, 2, 1, before_motion)
        # P(k+1) is counted backwards from P1: one lap behind.
        after = after._replace(lap=after.lap + 1)
        # Only differences of the same segment keep the digits of a long track.
        gap = track.joints[on.segment] - track.joints[after.segment] + track.total * (on.lap - after.lap)
        return gap + (on.along - after.along), on_motion.rate - after_motion.rate

    def foot(self, points: Floats) -> tuple[Floats, Floats]:
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
        from_, _ = track.advance(first, self.chain.pitch, self.free - 1)
        to, _ = track.advance(first, self.chain.pitch, self.free)
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
        ahead = track.position(track.advance(repeated(first, k), pitch, np.arange(k))[0])
        behind, _ = track.advance(repeated(first, links - k), pitch, np.arange(links - k, 0, -1), -1)
        behind = track.position(behind) + track.total
        found = []
        for joint in range(track.count):
            s = float(track.joints[joint])
            lap = int(s < ahead[0])
            s += lap * track.total
            at = Place(np.array([joint]), np.zeros(1), np.array([lap]))
            if s < ahead[-1]:
                pin = int(np.searchsorted(ahead, s, side="right"))
                first_pin, _ = track.advance(at, pitch, pin - 1, -1)
            elif s >= behind[0]:
                pin = k + int(np.searchsorted(behind, s, side="right"))
                first_pin, _ = track.advance(at, pitch, links + 1 - pin)
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

    @property
    def frame(self) -> tuple[Floats, float]:
        """Origin and angle of the slot's own frame: the middle of its ends, x from its end to its start."""
        start, end = self.path(np.array([self.start, self.end]))
        return 0.5 * (start + end), float(np.arctan2(start[1] - end[1], start[0] - end[0]))

    def in_frame(self, points: Floats) -> Floats:
        """Points of the drawing in the slot's own frame."""
        origin, angle = self.frame
        dx, dy = (points - origin).T
        c, s = np.cos(angle), np.sin(angle)
        return np.stack([c * dx + s * dy, c * dy - s * dx], axis=1)

    def from_frame(self, points: Floats) -> Floats:
        """Points of the slot's own frame in the drawing: the inverse of `in_frame`."""
        origin, angle = self.frame
        c, s = np.cos(angle), np.sin(angle)
        return origin + np.stack([c * points[:, 0] - s * points[:, 1], s * points[:, 0] + c * points[:, 1]], axis=1)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.sum(a * b, axis=1)


def repeated(place: Place, times: int) -> Place:
    """One place, ``times`` times."""
    return Place(*(np.repeat(part, times) for part in place))


def find_slot(chain: Chain, middle: float, side: int | None = None, start: float | None = None) -> Slot:
    """The slot nearest to a place of the track.

    The window starts where the slack is least: on a chain that closes critically both ends then lie on the bare
    track. The free pin is the last one that has not passed ``middle`` at that phase.

    Parameters
    ----------
    chain : Chain
        Chain and track.
    middle : float
        Arc length of the place, from the driver's start.
    side : {1, -1}, optional
        Side of a slot on a straight run (default: left); elsewhere it is the side to which the track bends out.
    start : float, optional
        Another phase for the window's start; its ends then have a step.

    Raises
    ------
    Stretched
        The chain misses length at some phase, or has a whole link too many at every phase.
    NoSlot
        No slot can be there.
    ChordError
        A link does not fit on the track, or the chain does not run smoothly.
    """
    track, pitch, links = chain.track, chain.pitch, chain.links
    least = chain.least_overrun()
    allowed = STRETCH_TOLERANCE * pitch
    if least.value < -allowed:
        raise Stretched(closing_links(track, pitch), -least.value)
    if links > 1 and Chain(track, pitch, links - 1).least_overrun().value >= -allowed:
        raise Stretched(closing_links(track, pitch), -least.value)
    chosen = least.phase if start is None else float(start % chain.period)
    slot = _slot_at(chain, chosen, middle, side or 1)
    _check_running(slot)
    if start is not None:
        return slot
    # A crescent may be critical at two states, each the other's mirror image: then the first is taken.
    found = lowest(slot.slack, 0.0, chain.period, chain.cells, tie=TIE * pitch)
    phase = _polished(slot, found.phase) % chain.period
    if chain.period - phase < 1e-9 * chain.period:
        phase = 0.0
    return _slot_at(chain, phase, middle, side or 1)


def _check_running(slot: Slot) -> None:
    """Raise `ChordError` where a neighbour of the free pin jumps or does not move on with the chain.

    The first place one pitch ahead always exists on a closed track that is large enough; that it also moves smoothly
    is a property of the track's bends.
    """
    chain, track = slot.chain, slot.chain.track
    phases = np.linspace(slot.start, slot.end, chain.cells + 1)
    before, before_motion, after, after_motion = slot.neighbours(phases)
    for place, motion in ((before, before_motion), (after, after_motion)):
        moved = np.diff(track.position(place))
        wrong = np.flatnonzero((motion.rate[:-1] <= 0) | (moved <= 0) | (moved > 0.5 * chain.pitch))
        if len(wrong):
            raise ChordError(ChordFault.REVERSAL, float(track.position(place)[wrong[0]] % track.total))


def _slot_at(chain: Chain, phase: float, middle: float, side: int) -> Slot:
    """The slot of the pin that comes to ``middle`` next; ``side`` decides only where the track does not bend."""
    track, pitch, links = chain.track, chain.pitch, chain.links
    first, _ = chain.drive(np.array([phase]))
    places, _ = track.advance(repeated(first, links + 1), pitch, np.arange(links + 1))
    passed = track.position(places) - middle < MIDDLE * pitch
    free = int(np.clip(np.count_nonzero(passed), 2, links - 1))
    # Where the free pin comes from and where it goes to: at both places the bare track bulges over two links.
    links_out = np.diff(track.points(Place(*(part[free - 2 : free + 2] for part in places))), axis=0) / pitch
    bulge = links_out[1:, 0] * links_out[:-1, 1] - links_out[1:, 1] * links_out[:-1, 0]
    sides = np.sign(bulge[np.abs(bulge) > STRAIGHT])
    if len(sides) == 2 and sides[0] != sides[1]:
        raise NoSlot
    return Slot(chain, free, int(sides[0]) if len(sides) else side, phase)


def _polished(slot: Slot, phase: float) -> float:
    """The phase of least slack, from the sign of the slack's derivative.

    Values alone fix a minimum only to the root of the rounding error; its derivative fixes it to rounding.
    """
    period = slot.chain.period
    low, high = phase - 1e-3 * period, phase + 1e-3 * period
    shift = period if low < 0 else 0.0
    low, high = low + shift, high + shift
    for _ in range(8):
        grid = np.linspace(low, high, 33)
        falling = slot._slack(grid)[1] < 0
        if not falling[0] or falling[-1]:
            return phase
        last = int(np.flatnonzero(falling)[-1])
        low, high = float(grid[last]), float(grid[last + 1])
    return 0.5 * (low + high) - shift
