"""The slot for the free pin of a chain: its path, depth and curvature, and its effect on the chain.

All pins except the free pin P_k stay on the track. The free pin hangs between its two neighbours, one pitch away from
both. In a period it moves from its position on the track to the position of the next pin. Its path is the slot that
replaces this section of the track, and every pin of the chain runs through the slot in turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError
from synthesis.one_variable import Floats, rising_root
from synthesis.scenes.chain.closure import (
    STRETCH_TOLERANCE,
    Chain,
    Extreme,
    closing_links,
    find_maximum,
    find_minimum,
)
from synthesis.scenes.chain.track import (
    ChordError,
    ChordFault,
    NotClosing,
    PinMotion,
    Points,
    TrackPosition,
    cross,
    dot,
)
from synthesis.work import Work


@dataclass(frozen=True)
class SlotSearchOptions:
    """Tolerances and block sizes for finding and analysing a slot."""

    middle_tolerance: float = 1e-6
    """Distance past the requested middle of the slot, in pitches, up to which a pin counts as not past it."""
    slack_tie: float = 1e-10
    """Difference of slack, in pitches, up to which two phases count as equally slack."""
    singular_sine: float = 1e-6
    """Sine of the angle between the links of the free pin below which its motion is undetermined. On a straight run
    the sine is the square root of the slack, which is known up to rounding."""
    pins_per_block: int = 200_000
    """Number of pins placed at a time, which bounds the memory and the time until a cancelled request is noticed."""
    tightest_pieces: int = 4
    """Number of pieces of a slot that are searched for the smallest radius of curvature."""


OPTIONS = SlotSearchOptions()


class Crossing(NamedTuple):
    """A pin on the track passes from one segment to the next, where the curvature of the slot jumps."""

    phase: float
    """Phase of the crossing."""
    pin: int
    """Number of the pin, from 1."""
    segment: int
    """Index of the segment that the pin enters."""


@dataclass(frozen=True)
class Slot:
    """Path of the free pin of a chain over a period.

    At every phase the free pin is one pitch from both neighbours. If the slack at the ends of the window is 0, the
    slot starts and ends on the track and is tangent to it.
    """

    chain: Chain
    """The chain and its track."""
    free: int
    """Number k of the free pin. P1 drives; P2 .. P(k-1) are ahead of it and P(k+1) .. PN are behind it."""
    side: int
    """1 if the free pin is to the left of the chord from P(k-1) to P(k+1), -1 if it is to the right."""
    start: float
    """Phase of the start of the window; the window ends one period later."""

    @property
    def end(self) -> float:
        """Return the phase of the end of the window."""
        return self.start + self.chain.period

    # The pins

    def neighbours(self, phase: Floats) -> tuple[tuple[TrackPosition, PinMotion], tuple[TrackPosition, PinMotion]]:
        """Return positions and motions of P(k-1) and P(k+1)."""
        track, pitch = self.chain.track, self.chain.pitch
        first, motion = self.chain.drive(phase)
        before = track.carry(first, motion, pitch, self.free - 2)
        return before, track.carry(first, motion, pitch, self.chain.links - self.free, -1)

    def neighbour_points(self, phase: Floats) -> tuple[Points, Points]:
        """Return the points of P(k-1) and P(k+1), between which the free pin hangs."""
        (before, _), (after, _) = self.neighbours(phase)
        return self.chain.track.points(before), self.chain.track.points(after)

    def path(self, phase: Floats) -> Points:
        """Return the points of the slot, shape (n,)."""
        return self.hang_between(*self.neighbour_points(phase))

    def positions(self, phase: Floats) -> TrackPosition:
        """Return the positions of all pins, shape (n, links).

        The position of the free pin is the start of the replaced segment.
        """
        track, links, k = self.chain.track, self.chain.links, self.free - 1
        positions = TrackPosition(*np.zeros((3, len(phase), links)))
        positions.segment[:, k] = self.base[0][0]
        first, _ = self.chain.drive(phase)
        for pins, direction in ((range(k), 1), (range(links, k, -1), -1)):
            position = first
            for pin in pins:
                position = track.step(position, self.chain.pitch, direction) if pin not in (0, links) else first
                for target, values in zip(positions, position):
                    target[:, pin % links] = values
        return TrackPosition(positions.segment.astype(np.intp), positions.along, positions.lap.astype(np.int64))

    def pins(self, phase: Floats) -> Points:
        """Return the points of all pins, shape (n, links)."""
        return self.points_at(self.positions(phase))

    def points_at(self, positions: TrackPosition) -> Points:
        """Return the points of all pins for given `positions`; the free pin hangs between its neighbours."""
        points, k = self.chain.track.points(positions), self.free - 1
        points[:, k] = self.hang_between(points[:, k - 1], points[:, (k + 1) % self.chain.links])
        return points

    def hang_between(self, before: Points, after: Points) -> Points:
        """Return the point that is one pitch away from both neighbours, on the perpendicular bisector of their chord.

        The distance from the chord is sqrt((L - h)(L + h)), where h is half of the chord. On the crescent's upper arc
        the point is below the chord.
        """
        half, pitch = 0.5 * (after - before), self.chain.pitch
        half_chord = np.abs(half)
        if np.any(half_chord > pitch * (1 + STRETCH_TOLERANCE)):
            raise ChordError(ChordFault.NO_POINT, self.start)
        height = np.sqrt(np.maximum((pitch - half_chord) * (pitch + half_chord), 0.0))
        return before + half * (1 + 1j * self.side * height / half_chord)

    def motion(self, phase: Floats) -> tuple[Points, Points, Points]:
        """Compute position, velocity and acceleration of the free pin with respect to the phase.

        The equations for each neighbour Q are (P - Q).(P' - Q') = 0 and (P - Q).(P'' - Q'') = -|P' - Q'|^2.

        Parameters
        ----------
        phase : ndarray, shape (n,)

        Returns
        -------
        point, velocity, acceleration : ndarray of complex, shape (n,)
            Velocity and acceleration are NaN if both links are in line (a free pin on a straight run without slack),
            because the velocity has no limit there.
        """
        track, pitch = self.chain.track, self.chain.pitch
        neighbours = self.neighbours(phase)
        ends = [track.points(position) for position, _ in neighbours]
        tangents = [track.tangents(position) for position, _ in neighbours]
        point = self.hang_between(*ends)
        e1, e2 = ((point - end) / pitch for end in ends)
        v1, v2 = (tangent * pin_motion.rate for tangent, (_, pin_motion) in zip(tangents, neighbours))
        a1, a2 = (
            tangent * (pin_motion.acceleration + 1j * track.curvature[position.segment] * pin_motion.rate**2)
            for tangent, (position, pin_motion) in zip(tangents, neighbours)
        )
        sine = cross(e1, e2)
        inverse = 1 / np.where(np.abs(sine) < OPTIONS.singular_sine, np.nan, sine)

        def solve(component_1: Floats, component_2: Floats) -> Points:
            """Return the vector with these components along both links."""
            return 1j * (component_2 * e1 - component_1 * e2) * inverse

        velocity = solve(dot(e1, v1), dot(e2, v2))
        centripetal_1, centripetal_2 = np.abs(velocity - v1) ** 2 / pitch, np.abs(velocity - v2) ** 2 / pitch
        return point, velocity, solve(dot(e1, a1) - centripetal_1, dot(e2, a2) - centripetal_2)

    def curvature(self, phase: Floats) -> Floats:
        """Return the signed curvature of the slot, positive to the left.

        The curvature is NaN if the free pin does not move or its motion is undetermined.
        """
        _, velocity, acceleration = self.motion(phase)
        speed = np.abs(velocity)
        return cross(velocity, acceleration) / np.where(speed > 0, speed, np.nan) ** 3

    def normals(self, phase: Floats) -> Points:
        """Return the unit normals of the slot to the left of travel, shape (n,).

        If a normal is undetermined at an end of the slot, the normal slightly inside the slot is returned.
        """
        velocity = self.motion(phase)[1]
        undetermined = ~np.isfinite(velocity)
        if undetermined.any():
            inward = np.where(phase[undetermined] < 0.5 * (self.start + self.end), 1.0, -1.0)
            velocity[undetermined] = self.motion(phase[undetermined] + 1e-6 * self.chain.period * inward)[1]
        velocity = np.where(np.isfinite(velocity), velocity, 1.0)
        return 1j * velocity / np.abs(velocity)

    # Slack and depth

    def slack(self, phase: Floats) -> Floats:
        """Return the arc length by which two links from P(k-1) along the bare track overrun P(k+1); negative if stretched.

        On an arc of radius R the slack is R (2 du - G) with the angle G between the neighbours, which is R times the
        defect D.
        """
        track = self.chain.track
        (before, _), (after, _) = self.neighbours(phase)
        reached = track.advance(before, self.chain.pitch, 2)
        # differences within the same segment keep the digits on a long track; P(k+1) is counted backwards from P1 and is
        # therefore one lap behind
        laps = reached.lap - (after.lap + 1)
        return (
            track.joints[reached.segment]
            - track.joints[after.segment]
            + track.total * laps
            + (reached.along - after.along)
        )

    def slack_rate(self, phase: Floats) -> tuple[Floats, Floats]:
        """Return the first and second derivatives of the slack with respect to the phase."""
        before, (_, after) = self.neighbours(phase)
        _, reached = self.chain.track.carry(*before, self.chain.pitch, 2)
        return reached.rate - after.rate, reached.acceleration - after.acceleration

    def foot(self, points: Points) -> tuple[Floats, Floats]:
        """Return the arc length along the base and the depth of points.

        If the slot replaces several segments, each point is projected onto the nearest segment.
        """
        track = self.chain.track
        along, depth = np.zeros(len(points)), np.full(len(points), np.inf)
        for segment, shift in self.base:
            local_along, offset = track.feet(segment, points)
            overshoot = np.maximum(-local_along, local_along - track.length[segment])
            is_farther = np.abs(offset) + np.maximum(overshoot, 0.0) >= np.abs(depth)
            along, depth = np.where(is_farther, along, local_along + shift), np.where(is_farther, depth, offset)
        return along, self.outward * depth

    def depth(self, phase: Floats) -> Floats:
        """Return the distance of the slot from the bare track, positive on the side of the slot.

        On the crescent the depth is r - R1.
        """
        return self.foot(self.path(phase))[1]

    # What belongs to the whole slot

    @cached_property
    def outward(self) -> int:
        """Return 1 if the slot is to the left of the bare track at its largest depth, otherwise -1."""
        points = self.path(np.linspace(self.start, self.end, 65))
        offsets = [self.chain.track.feet(segment, points)[1] for segment, _ in self.base]
        nearest = np.array(offsets)[np.argmin(np.abs(offsets), axis=0), np.arange(len(points))]
        return 1 if nearest[np.argmax(np.abs(nearest))] >= 0 else -1

    @cached_property
    def base(self) -> tuple[tuple[int, float], ...]:
        """Return the replaced segments, each with the arc length of its start relative to the start of the base."""
        track = self.chain.track
        first, _ = self.chain.drive(np.array([self.start]))
        start_position, end_position = (
            track.advance(first, self.chain.pitch, links) for links in (self.free - 1, self.free)
        )
        # a pin at a joint, up to rounding, does not belong to the segment that it only touches
        tolerance = OPTIONS.middle_tolerance * self.chain.pitch
        first_position = track.locate(track.arc_length(start_position) + tolerance)
        last = track.locate(track.arc_length(end_position) - tolerance)
        first_index, count = int(first_position.segment[0]), track.count
        crossed = int(last.segment[0] + count * last.lap[0]) - (first_index + count * int(first_position.lap[0]))
        indices = [(first_index + offset) % count for offset in range(max(crossed, 0) + 1)]
        starts = np.concatenate([[0.0], np.cumsum(track.length[indices])])
        return tuple((index, float(shift)) for index, shift in zip(indices, starts))

    @cached_property
    def crossings(self) -> tuple[Crossing, ...]:
        """Return the crossings within the window, in order of phase.

        They are computed without a search: the joint that pin i will pass, stepped back by i - 1 links, is the
        position of P1 at that phase.
        """
        track, pitch, links, k = self.chain.track, self.chain.pitch, self.chain.links, self.free
        first, _ = self.chain.drive(np.array([self.start]))
        ahead = track.arc_length(track.advance(first.repeated(k), pitch, np.arange(k)))
        positions = track.advance(first.repeated(links - k), pitch, np.arange(links - k, 0, -1), -1)
        behind = track.arc_length(positions) + track.total
        crossings = []
        for joint in range(track.count):
            s = float(track.joints[joint])
            lap = int(s < ahead[0])
            s += lap * track.total
            joint_position = TrackPosition(np.array([joint]), np.zeros(1), np.array([lap]))
            if s < ahead[-1]:
                pin = int(np.searchsorted(ahead, s, side="right"))
                first_pin = track.advance(joint_position, pitch, pin - 1, -1)
            elif s >= behind[0]:
                pin = k + int(np.searchsorted(behind, s, side="right"))
                first_pin = track.advance(joint_position, pitch, links + 1 - pin)
                first_pin = first_pin._replace(lap=first_pin.lap - 1)
            else:
                continue
            phase = float(self.chain.phase_at(first_pin)[0])
            crossings.append(Crossing(min(max(phase, self.start), self.end), pin, joint))
        return tuple(sorted(crossings))

    @property
    def breaks(self) -> Floats:
        """Return the phases between which the slot is smooth: window ends and crossings."""
        inner = [crossing.phase for crossing in self.crossings]
        phases = np.array([self.start, *inner, self.end])
        is_distinct = np.concatenate([[True], np.diff(phases) > 1e-9 * self.chain.period])
        phases = phases[is_distinct]
        phases[-1] = self.end
        return phases

    @cached_property
    def frame(self) -> tuple[complex, complex]:
        """Return origin and direction of the slot's frame.

        The origin is the midpoint of the ends of the slot, and the direction is from its end to its start.
        """
        start, end = self.path(np.array([self.start, self.end]))
        return complex(0.5 * (start + end)), complex((start - end) / abs(start - end))


def find_slot(
    chain: Chain,
    middle: float,
    start: float | None = None,
    work: Work | None = None,
) -> Slot:
    """Find the slot nearest to a position on the track.

    The window starts at the phase with the smallest slack. If the chain closes critically, both ends of the slot are
    then on the bare track. The free pin is the last pin that has not passed ``middle`` at that phase.

    Parameters
    ----------
    chain : Chain
    middle : float
        Arc length of the requested middle of the slot from the start of the driver.
    start : float, optional
        Phase of the start of the window, instead of the phase with the smallest slack. The slot then ends in steps.
    work : Work, optional
        Called between the steps to check whether the result is still wanted.

    Returns
    -------
    Slot

    Raises
    ------
    NotClosing
        The chain is too short at some phase, or has a link too many at every phase.
    FieldError
        There is no slot at this position.
    ChordError
        A link does not fit on the track, or the chain does not run smoothly.
    """
    track, pitch, links, work = chain.track, chain.pitch, chain.links, work or Work()
    work.go_on()
    worst = chain.smallest_overrun()
    work.go_on()
    tolerance = STRETCH_TOLERANCE * pitch
    has_spare_link = links > 1 and Chain(track, pitch, links - 1).smallest_overrun().value >= -tolerance
    if worst.value < -tolerance or has_spare_link:
        raise NotClosing(links, closing_links(track, pitch, work), -worst.value, "on this track")
    start_phase = worst.phase if start is None else float(start % chain.period)
    work.go_on()
    slot = _slot_at(chain, start_phase, middle)
    _check_running(slot)
    if start is not None:
        return slot
    work.go_on()
    # a crescent can be critical at two phases that are mirror images of each other; use the first phase
    minimum = find_minimum(slot.slack, 0.0, chain.period, chain.search_cells, tie=OPTIONS.slack_tie * pitch)
    phase = refine_extreme(slot, minimum.phase, 1) % chain.period
    if chain.period - phase < 1e-9 * chain.period:
        phase = 0.0
    return _slot_at(chain, phase, middle)


def _check_running(slot: Slot) -> None:
    """Raise a `ChordError` if a neighbour of the free pin jumps or does not advance with the chain.

    A closed track of sufficient size always has a first position one pitch ahead. Its motion is smooth only if the
    bends of the track allow it.
    """
    chain, track = slot.chain, slot.chain.track
    phases = np.linspace(slot.start, slot.end, chain.search_cells + 1)
    for position, motion in slot.neighbours(phases):
        advances = np.diff(track.arc_length(position))
        failing = np.flatnonzero((motion.rate[:-1] <= 0) | (advances <= 0) | (advances > 0.5 * chain.pitch))
        if len(failing):
            raise ChordError(ChordFault.REVERSAL, float(track.arc_length(position)[failing[0]] % track.total))


def _slot_at(chain: Chain, phase: float, middle: float) -> Slot:
    """Return the slot of the pin that reaches ``middle`` next, on the outside of the bend.

    There is no slot if the track bends in opposite directions at the start and at the end of the free pin's path. The
    pin would have to cross the line between its neighbours, which its slack does not allow.
    """
    track, pitch, links = chain.track, chain.pitch, chain.links
    first, _ = chain.drive(np.array([phase]))
    positions = track.advance(first.repeated(links + 1), pitch, np.arange(links + 1))
    has_passed = track.arc_length(positions) - middle < OPTIONS.middle_tolerance * pitch
    free = int(np.clip(np.count_nonzero(has_passed), 2, links - 1))
    # bulge of the bare track over two links at the start and at the end of the free pin's path
    link_vectors = np.diff(track.points(positions.select(slice(free - 2, free + 2)))) / pitch
    sides = np.sign(cross(link_vectors[1:], link_vectors[:-1]))
    if sides[0] != sides[1]:
        raise FieldError(
            "/upper_radius",
            "the track bends to both sides within one link of the free pin, so no slot can guide it from one bend to the other",
            constraint="no_slot",
        )
    return Slot(chain, free, int(sides[0]), phase)


def refine_extreme(slot: Slot, phase: float, sign: int) -> float:
    """Refine the phase of an extreme of the slack, as a zero of its derivative.

    The values determine the phase only to the square root of the rounding error.

    Parameters
    ----------
    slot : Slot
    phase : float
        Approximate phase.
    sign : {1, -1}
        1 for a minimum, -1 for a maximum.

    Returns
    -------
    float
    """
    half_width = 1e-3 * slot.chain.period
    shift = slot.chain.period if phase < half_width else 0.0
    low, high = phase + shift - half_width, phase + shift + half_width

    def rising(phase: Floats) -> tuple[Floats, Floats]:
        rate, bend = slot.slack_rate(phase)
        return sign * rate, sign * bend

    ends, _ = rising(np.array([low, high]))
    if not ends[0] < 0 <= ends[1]:
        return phase
    return float(rising_root(rising, low, high, [phase + shift])[0]) - shift


class SlotReport(NamedTuple):
    """Properties of a slot. Lengths are in the unit of the track; a phase is the arc length of P1."""

    slack_min: float
    """Smallest slack."""
    slack_max: Extreme
    """Largest slack."""
    depth_max: Extreme
    """Largest depth."""
    end_step: float
    """Largest distance of the ends of the slot from the track."""
    radius_min: float
    """Smallest radius of curvature of the pin's path; infinite for a straight path."""
    single_valued: bool
    """True if x in the slot's frame is monotonic, so that y(x) exists."""
    clearance: float
    """Smallest distance of the slot from the segments that it does not replace."""
    chord_error: float
    """Largest difference between a chord and the pitch, over all links."""
    held_chord_error: float
    """Length by which the links are too short if the free pin is held halfway on the bare track, without a slot."""


def analyse_slot(slot: Slot, phases: Floats, work: Work | None = None) -> SlotReport:
    """Compute the extremes of a slot over its window.

    Parameters
    ----------
    slot : Slot
    phases : ndarray, shape (n,)
        Phases at which the chords are checked.
    work : Work, optional
        Called between the steps to check whether the result is still wanted.

    Returns
    -------
    SlotReport
    """
    track, cells, work = slot.chain.track, slot.chain.search_cells, work or Work()
    work.go_on()
    largest_slack = find_maximum(slot.slack, slot.start, slot.end, cells)
    slack_max = Extreme(refine_extreme(slot, largest_slack.phase, -1), largest_slack.value)
    grid = np.concatenate([np.linspace(a, b, 33) for a, b in _smooth_pieces(slot)])
    _, velocity, _ = slot.motion(grid)
    finite_velocity = velocity[np.isfinite(velocity)]
    work.go_on()
    _, direction = slot.frame
    replaced = {segment for segment, _ in slot.base}
    kept_segments = [index for index in range(track.count) if index not in replaced]

    def distance(phase: Floats) -> Floats:
        points = slot.path(phase)
        return np.min([track.distance(index, points) for index in kept_segments], axis=0)

    return SlotReport(
        slack_min=find_minimum(slot.slack, slot.start, slot.end, cells).value,
        slack_max=slack_max,
        depth_max=find_maximum(slot.depth, slot.start, slot.end, cells),
        end_step=float(np.abs(slot.depth(np.array([slot.start, slot.end]))).max()),
        radius_min=smallest_radius(slot),
        single_valued=bool(np.all((finite_velocity / direction).real < 0)),
        clearance=find_minimum(distance, slot.start, slot.end, cells).value if kept_segments else np.inf,
        chord_error=chord_error(slot, phases, work),
        held_chord_error=_held_chord_error(slot, slack_max.phase, cells),
    )


def _smooth_pieces(slot: Slot) -> list[tuple[float, float]]:
    """Return the windows between the breaks, just inside them, because the curvature has two values at a break."""
    inside = 1e-9 * slot.chain.period
    return [(float(a) + inside, float(b) - inside) for a, b in zip(slot.breaks[:-1], slot.breaks[1:])]


def smallest_radius(slot: Slot) -> float:
    """Return the smallest radius of curvature of the pin's path, which is an upper limit for rollers.

    The radius is infinite for a straight path.
    """

    def radius(phase: Floats) -> Floats:
        curvature = np.abs(slot.curvature(phase))
        is_curved = np.isfinite(curvature) & (curvature > 0)
        return np.where(is_curved, 1 / np.where(is_curved, curvature, 1.0), np.inf)

    pieces = _smooth_pieces(slot)
    coarse = radius(np.concatenate([np.linspace(a, b, 33) for a, b in pieces])).reshape(len(pieces), 33).min(axis=1)
    # a track can have hundreds of pieces: search only those with the smallest radii on the coarse grid
    tightest = np.argsort(coarse, kind="stable")[: OPTIONS.tightest_pieces]
    return min(find_minimum(radius, start, end, 32, 3).value for start, end in (pieces[index] for index in tightest))


def chord_error(slot: Slot, phases: Floats, work: Work | None = None) -> float:
    """Compute the largest difference between a chord of the chain and the pitch.

    Parameters
    ----------
    slot : Slot
    phases : ndarray, shape (n,)
        Phases at which the chords are checked.
    work : Work, optional
        Called before each block of phases to check whether the result is still wanted.

    Returns
    -------
    float
    """
    largest, block_size, work = 0.0, max(1, OPTIONS.pins_per_block // slot.chain.links), work or Work()
    for first in range(0, len(phases), block_size):
        work.go_on()
        pins = slot.pins(phases[first : first + block_size])
        largest = max(largest, float(np.abs(np.abs(pins - np.roll(pins, -1, axis=1)) - slot.chain.pitch).max()))
    return largest


def _held_chord_error(slot: Slot, phase: float, cells: int) -> float:
    """Return the largest error of the links of a free pin that is held halfway between its neighbours on the track."""
    track = slot.chain.track

    def shortfall(phase: Floats) -> Floats:
        (before, _), (after, _) = slot.neighbours(phase)
        middle = 0.5 * (track.arc_length(before) + (track.arc_length(after) + track.total))
        held_points = track.points(track.locate(middle))
        chords = np.abs([held_points - track.points(end) for end in (before, after)])
        return np.abs(slot.chain.pitch - chords).max(axis=0)

    return find_maximum(shortfall, slot.start, slot.end, cells, 3).value


def wheel_conflict(slot: Slot, wheel: int) -> Extreme:
    """Return the largest phase difference, in links, between the driver and another wheel that the chain turns.

    Parameters
    ----------
    slot : Slot
    wheel : int
        Index of the segment of the wheel.

    Returns
    -------
    Extreme
        Range of the phase difference over a period, and the phase at which the wheel is furthest ahead.

    Raises
    ------
    ChordError
        The wheel cannot hold a link.

    Notes
    -----
    A pin that enters the wheel determines the phase of the wheel. The next pin ahead gives the same phase.
    """
    chain, track = slot.chain, slot.chain.track
    link_length = float(track.link_lengths(chain.pitch)[wheel])
    if not link_length <= track.length[wheel]:
        raise ChordError(ChordFault.NO_POINT, float(track.joints[wheel]))
    first, _ = chain.drive(np.array([slot.start]))
    positions = track.advance(first.repeated(chain.links + 1), chain.pitch, np.arange(chain.links + 1))
    entry = track.joints[wheel] + track.total * (track.joints[wheel] < track.arc_length(first)[0])
    # the last pin before the wheel enters it within the period
    links_before = int(np.count_nonzero(track.arc_length(positions) < entry)) - 1

    def lead(phase: Floats) -> Floats:
        start, _ = chain.drive(phase)
        entering = track.advance(start, chain.pitch, links_before)
        has_entered = track.arc_length(entering) >= entry
        later = track.step(entering, chain.pitch)
        along = np.where(
            has_entered, track.arc_length(entering) - entry, track.arc_length(later) - entry - link_length
        )
        return along / link_length - (phase - slot.start) / chain.period

    largest_lead = find_maximum(lead, slot.start, slot.end, chain.search_cells)
    return Extreme(
        largest_lead.phase, largest_lead.value - find_minimum(lead, slot.start, slot.end, chain.search_cells).value
    )


class Pins(NamedTuple):
    """All pins at n phases."""

    points: Points
    """Points of the pins, shape (n, links)."""
    segment: NDArray[np.intp]
    """Segment of each pin, shape (n, links); for the free pin, the first segment that the slot replaces."""
    along: Floats
    """Arc length from the start of that segment, shape (n, links); 0 for the free pin."""

    @property
    def link_angle(self) -> Floats:
        """Return the direction of the link from each pin to the next pin, in radians from x, continuous over the phases."""
        links = np.roll(self.points, -1, axis=1) - self.points
        angles: Floats = np.unwrap(np.angle(links), axis=0)
        return angles


def pins_at(slot: Slot, phases: Floats) -> Pins:
    """Compute the positions of all pins of a chain.

    Parameters
    ----------
    slot : Slot
    phases : ndarray, shape (n,)

    Returns
    -------
    Pins
        Neighbouring pins are one pitch apart, including the last and the first.
    """
    positions = slot.positions(phases)
    return Pins(slot.points_at(positions), positions.segment, positions.along)
