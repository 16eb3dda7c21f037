"""The slot for the free pin of a chain on a crescent: its path, depth and curvature, and its effect on the chain.

All pins except the free pin P_k stay on the track. The free pin hangs below the upper arc between its two neighbours,
one pitch away from both. In a period it moves from its position on the track to the position of the next pin. Its path
is the slot that replaces this section of the upper arc, and every pin of the chain runs through the slot in turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import cross, dot, rows_at
from synthesis.errors import FieldError
from synthesis.one_variable import Floats, rising_root
from synthesis.scenes.chain.closure import (
    STRETCH_TOLERANCE,
    Chain,
    Extreme,
    closing_links,
    closure_error,
    find_maximum,
    find_minimum,
)
from synthesis.scenes.chain.crescent import (
    LEFT_WHEEL,
    LOWER_ARC,
    RIGHT_WHEEL,
    UPPER_ARC,
    Crescent,
    Dimensions,
    crescent_for,
)
from synthesis.scenes.chain.track import PinMotion, Points, TrackPosition, no_point_error, pitch_error
from synthesis.work import UNLIMITED, Work


@dataclass(frozen=True)
class SlotSearchOptions:
    """Tolerances for finding and analysing a slot."""

    middle_tolerance: float = 1e-6
    """Distance past the middle of the upper arc, in pitches, up to which a pin counts as not past it."""
    slack_tie: float = 1e-10
    """Difference of slack, in pitches, up to which two phases count as equally slack."""
    smallest_sine: float = 1e-7
    """Smallest sine of the angle between the links of the free pin. On the flattest upper arc it is 1e-6 up to rounding."""
    checked_phases: int = 193
    """Number of phases at which the neighbours of the free pin are checked for reversals."""


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
    start: float
    """Phase of the start of the window; the window ends one period later."""

    @property
    def end(self) -> float:
        """Return the phase of the end of the window."""
        return self.start + self.chain.period

    def phases(self, count: int) -> Floats:
        """Return evenly spaced phases of the window, both ends included."""
        return np.linspace(self.start, self.end, count)

    def neighbours(self, phase: Floats) -> tuple[tuple[TrackPosition, PinMotion], tuple[TrackPosition, PinMotion]]:
        """Return positions and motions of P(k-1) and P(k+1)."""
        track, pitch = self.chain.track, self.chain.pitch
        first, motion = self.chain.drive(phase)
        before = track.carry(first, motion, pitch, self.free - 2)
        return before, track.carry(first, motion, pitch, self.chain.links - self.free, -1)

    def path(self, phase: Floats) -> Points:
        """Return the points of the slot, shape (n,)."""
        return self._hang_between(*(self.chain.track.points(position) for position, _ in self.neighbours(phase)))

    def positions(self, phase: Floats) -> TrackPosition:
        """Return the positions of all pins, shape (n, links); for the free pin, the start of the upper arc."""
        track, pitch, count = self.chain.track, self.chain.pitch, len(phase)
        first, _ = self.chain.drive(phase)
        ahead, behind = [first], [first]
        while len(ahead) < self.free - 1:
            ahead.append(track.advance(ahead[-1], pitch))
        while len(behind) <= self.chain.links - self.free:
            behind.append(track.advance(behind[-1], pitch, 1, -1))
        free = TrackPosition(np.full(count, UPPER_ARC), np.zeros(count), np.zeros(count, np.int64))
        return TrackPosition._make(np.stack(columns, axis=1) for columns in zip(*ahead, free, *behind[:0:-1]))

    def pins(self, phase: Floats, positions: TrackPosition | None = None) -> Points:
        """Return the points of all pins, shape (n, links); ``positions`` are the `positions`, if they are known."""
        points = self.chain.track.points(self.positions(phase) if positions is None else positions)
        points[:, self.free - 1] = self._hang_between(
            points[:, self.free - 2], points[:, self.free % self.chain.links]
        )
        return points

    def _hang_between(self, before: Points, after: Points) -> Points:
        """Return the point below the chord of both neighbours that is one pitch away from them.

        The distance from the chord is sqrt((L - h)(L + h)), where h is half of the chord.
        """
        half, pitch = 0.5 * (after - before), self.chain.pitch
        half_chord = np.abs(half)
        if np.any(half_chord > pitch * (1 + STRETCH_TOLERANCE)):
            raise no_point_error(self.start)
        height = np.sqrt(np.maximum((pitch - half_chord) * (pitch + half_chord), 0.0))
        return before + half * (1 + 1j * height / half_chord)

    def motion(self, phase: Floats) -> tuple[Points, Points, Points]:
        """Return position, velocity and acceleration of the free pin with respect to the phase, shape (n,) each.

        The equations for each neighbour Q are (P - Q).(P' - Q') = 0 and (P - Q).(P'' - Q'') = -|P' - Q'|^2.
        """
        track, pitch = self.chain.track, self.chain.pitch
        neighbours = self.neighbours(phase)
        ends = [track.points(position) for position, _ in neighbours]
        tangents = [track.tangents(position) for position, _ in neighbours]
        point = self._hang_between(*ends)
        e1, e2 = ((point - end) / pitch for end in ends)
        v1, v2 = (tangent * pin_motion.rate for tangent, (_, pin_motion) in zip(tangents, neighbours))
        a1, a2 = (
            tangent * (pin_motion.acceleration + 1j * track.curvature[position.segment] * pin_motion.rate**2)
            for tangent, (position, pin_motion) in zip(tangents, neighbours)
        )
        sine = np.maximum(cross(e1, e2), OPTIONS.smallest_sine)

        def solve(component_1: Floats, component_2: Floats) -> Points:
            """Return the vector with these components along both links."""
            return 1j * (component_2 * e1 - component_1 * e2) / sine

        velocity = solve(dot(e1, v1), dot(e2, v2))
        centripetal_1, centripetal_2 = np.abs(velocity - v1) ** 2 / pitch, np.abs(velocity - v2) ** 2 / pitch
        return point, velocity, solve(dot(e1, a1) - centripetal_1, dot(e2, a2) - centripetal_2)

    def curvature(self, phase: Floats) -> Floats:
        """Return the signed curvature of the slot, positive to the left."""
        _, velocity, acceleration = self.motion(phase)
        return cross(velocity, acceleration) / np.abs(velocity) ** 3

    def normals(self, phase: Floats) -> Points:
        """Return the unit normals of the slot to the left of travel, shape (n,)."""
        velocity = self.motion(phase)[1]
        return 1j * velocity / np.abs(velocity)

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
        joints = track.joints[reached.segment] - track.joints[after.segment]
        return joints + track.total * (reached.lap - (after.lap + 1)) + (reached.along - after.along)

    def slack_rate(self, phase: Floats) -> tuple[Floats, Floats]:
        """Return the first and second derivatives of the slack with respect to the phase."""
        before, (_, after) = self.neighbours(phase)
        _, reached = self.chain.track.carry(*before, self.chain.pitch, 2)
        return reached.rate - after.rate, reached.acceleration - after.acceleration

    def depth(self, phase: Floats) -> Floats:
        """Return r - R1, the distance of the slot below the upper arc."""
        return self.chain.track.feet(UPPER_ARC, self.path(phase))[1]

    @cached_property
    def crossings(self) -> tuple[Crossing, ...]:
        """Return the crossings within the window, in order of phase.

        They are computed without a search: the joint that pin i will pass, stepped back by i - 1 links, is the
        position of P1 at that phase.
        """
        track, pitch, links = self.chain.track, self.chain.pitch, self.chain.links
        ends = track.arc_length(self.positions(np.array([self.start, self.end])))
        crossings = []
        for pin in {*range(1, links + 1)} - {self.free}:
            low, high = ends[:, pin - 1]
            for joint in range(track.count):
                lap = int(np.ceil((low - track.joints[joint]) / track.total))
                if track.joints[joint] + lap * track.total >= high:
                    continue
                position = TrackPosition(np.array([joint]), np.zeros(1), np.array([lap]))
                is_ahead = pin < self.free
                steps, direction = (pin - 1, -1) if is_ahead else (links + 1 - pin, 1)
                phase = self.chain.phase_at(track.advance(position, pitch, steps, direction))
                crossings.append(Crossing(min(max(phase, self.start), self.end), pin, joint))
        return tuple(sorted(crossings))

    @property
    def breaks(self) -> Floats:
        """Return the phases between which the slot is smooth: window ends and crossings."""
        phases = np.array([self.start, *(crossing.phase for crossing in self.crossings), self.end])
        phases = phases[np.concatenate([[True], np.diff(phases) > 1e-9 * self.chain.period])]
        phases[-1] = self.end
        return phases


def crescent_slot(
    dimensions: Dimensions, start: float | None = None, work: Work = UNLIMITED
) -> tuple[Crescent, Slot]:
    """Compute the crescent and its slot, below the middle of the upper arc.

    The window starts at the phase with the smallest slack. If the chain closes critically, both ends of the slot are
    then on the bare track. The free pin is the last pin that has not passed the middle of the arc at that phase.

    Parameters
    ----------
    dimensions : Dimensions
    start : float, optional
        Angle of P1 on the left wheel at the start of the window. By default, the phase with the smallest slack.
    work : Work, optional
        Called between the steps to check whether the result is still wanted.

    Raises
    ------
    FieldError
        There is no such crescent; the chain is too short at some phase, or has a link too many at every phase; a link
        does not fit on the track, or the chain does not run smoothly; or there is no slot.
    """
    pitch, links = dimensions.pitch, dimensions.links
    crescent = crescent_for(dimensions, work)
    chain = Chain(crescent.track, pitch, links)
    work.go_on()
    worst = chain.smallest_overrun()
    work.go_on()
    tolerance = STRETCH_TOLERANCE * pitch
    has_spare_link = links > 1 and Chain(chain.track, pitch, links - 1).smallest_overrun().value >= -tolerance
    if worst.value < -tolerance or has_spare_link:
        raise closure_error(links, closing_links(chain.track, pitch, work), -worst.value, "on this track")
    work.go_on()
    if start is not None:
        slot = _slot_at(chain, start * crescent.wheel_radius % chain.period)
        _check_running(slot)
        return crescent, slot
    slot = _slot_at(chain, worst.phase)
    _check_running(slot)
    work.go_on()
    # a crescent can be critical at two phases that are mirror images of each other; use the first phase
    minimum = find_minimum(slot.slack, 0.0, chain.period, OPTIONS.slack_tie * pitch)
    phase = _refined_extreme(slot, minimum.phase, 1) % chain.period
    return crescent, _slot_at(chain, 0.0 if chain.period - phase < 1e-9 * chain.period else phase)


def _check_running(slot: Slot) -> None:
    """Raise a `FieldError` if a neighbour of the free pin jumps or does not advance with the chain.

    A closed track of sufficient size always has a first position one pitch ahead. Its motion is smooth only if the
    bends of the track allow it.
    """
    track = slot.chain.track
    for position, motion in slot.neighbours(slot.phases(OPTIONS.checked_phases)):
        advances = np.diff(track.arc_length(position))
        failing = np.flatnonzero(~((motion.rate[:-1] > 0) & (advances > 0) & (advances <= 0.5 * slot.chain.pitch)))
        if len(failing):
            raise pitch_error(
                "reversal",
                "the pitch is too long for the bends of the track: a pin would jump or run backwards while the chain "
                "advances",
                float(track.arc_length(position)[failing[0]] % track.total),
            )


def _slot_at(chain: Chain, phase: float) -> Slot:
    """Return the slot of the pin that reaches the middle of the upper arc next.

    There is no slot if the track bends upwards at the start or at the end of the free pin's path. The pin would have
    to cross the line between its neighbours, which its slack does not allow.
    """
    track, pitch, links = chain.track, chain.pitch, chain.links
    first, _ = chain.drive(np.array([phase]))
    copies = rows_at(first, np.zeros(links + 1, dtype=np.intp))
    positions = track.advance(copies, pitch, np.arange(links + 1))
    middle = track.joints[UPPER_ARC] + 0.5 * track.length[UPPER_ARC]
    has_passed = track.arc_length(positions) - middle < OPTIONS.middle_tolerance * pitch
    free = int(np.clip(np.count_nonzero(has_passed), 2, links - 1))
    link_vectors = np.diff(track.points(rows_at(positions, slice(free - 2, free + 2)))) / pitch
    if np.any(cross(link_vectors[1:], link_vectors[:-1]) <= 0):
        raise FieldError(
            "/upper_radius",
            "the track bends to both sides within one link of the free pin, so no slot can guide it from one bend to the other",
            constraint="no_slot",
        )
    return Slot(chain, free, phase)


def _refined_extreme(slot: Slot, phase: float, sign: int) -> float:
    """Refine the phase of a minimum (sign 1) or maximum (sign -1) of the slack, as a zero of its derivative.

    The values determine the phase only to the square root of the rounding error.
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
    depth_max: float
    """Largest depth."""
    end_step: float
    """Largest distance of the ends of the slot from the track."""
    radius_min: float
    """Smallest radius of curvature of the pin's path, which limits the radius of a roller."""
    clearance: float
    """Smallest distance of the slot from the wheels and the lower arc."""
    chord_error: float
    """Largest difference between a chord and the pitch, over all links."""


def analyse_slot(slot: Slot, phases: Floats, work: Work = UNLIMITED) -> SlotReport:
    """Compute the extremes of a slot over its window.

    Parameters
    ----------
    slot : Slot
    phases : ndarray, shape (n,)
        Phases at which the chords are checked.
    work : Work, optional
        Called between the steps to check whether the result is still wanted.
    """
    track = slot.chain.track
    work.go_on()
    largest_slack = find_maximum(slot.slack, slot.start, slot.end)

    def distance(phase: Floats) -> Floats:
        points = slot.path(phase)
        return np.min([track.distance(index, points) for index in range(UPPER_ARC)], axis=0)

    work.go_on()
    return SlotReport(
        slack_min=find_minimum(slot.slack, slot.start, slot.end).value,
        slack_max=Extreme(_refined_extreme(slot, largest_slack.phase, -1), largest_slack.value),
        depth_max=find_maximum(slot.depth, slot.start, slot.end).value,
        end_step=float(np.abs(slot.depth(np.array([slot.start, slot.end]))).max()),
        radius_min=smallest_radius(slot),
        clearance=find_minimum(distance, slot.start, slot.end).value,
        chord_error=chord_error(slot, phases),
    )


def smallest_radius(slot: Slot) -> float:
    """Return the smallest radius of curvature of the pin's path."""
    inside = 1e-9 * slot.chain.period  # the curvature has two values at a break

    def negative_curvature(phase: Floats) -> Floats:
        return -np.abs(slot.curvature(phase))

    pieces = zip(slot.breaks[:-1] + inside, slot.breaks[1:] - inside)
    return -1 / min(find_minimum(negative_curvature, float(start), float(end)).value for start, end in pieces)


def chord_error(slot: Slot, phases: Floats) -> float:
    """Return the largest difference between a chord of the chain and the pitch at phases, shape (n,)."""
    pins = slot.pins(phases)
    return float(np.abs(np.abs(pins - np.roll(pins, -1, axis=1)) - slot.chain.pitch).max())


def wheel_conflict(slot: Slot) -> float:
    """Return the range of the phase difference, in links, between the two wheels if the chain turned both of them.

    Each pin on the right wheel gives the same phase of this wheel, except for whole links.
    """
    track, period = slot.chain.track, slot.chain.period

    def lead(phase: Floats) -> Floats:
        positions = slot.positions(phase)
        pin = np.argmax(positions.segment == RIGHT_WHEEL, axis=1)
        along = np.take_along_axis(positions.along, pin[:, None], axis=1)[:, 0]
        return along / track.link_lengths(slot.chain.pitch)[RIGHT_WHEEL] - (phase - slot.start) / period

    at_start = lead(np.array([slot.start]))

    def change(phase: Floats) -> Floats:
        return np.mod(lead(phase) - at_start + 0.5, 1.0) - 0.5

    return find_maximum(change, slot.start, slot.end).value - find_minimum(change, slot.start, slot.end).value


class Pins(NamedTuple):
    """All pins at n phases."""

    points: Points
    """Points of the pins, shape (n, links)."""
    segment: NDArray[np.intp]
    """Segment of each pin, shape (n, links)."""
    theta: Floats
    """Angles theta1 .. thetaN in radians, shape (n, links).
    On a wheel, the angle is measured from the joint with the upper arc, over the top. On an arc, it is measured about
    the centre of the arc from straight down, positive to the right; the free pin uses the centre of the upper arc.
    """


def pins_at(crescent: Crescent, slot: Slot, phases: Floats) -> Pins:
    """Compute all pins of a chain at phases, shape (n,); neighbouring pins are one pitch apart."""
    positions = slot.positions(phases)
    points = slot.pins(phases, positions)
    r0, r1, r2 = crescent.wheel_radius, crescent.upper_radius, crescent.lower_radius
    starts, rates = np.empty(4), np.empty(4)
    starts[LEFT_WHEEL], rates[LEFT_WHEEL] = 0.0, 1 / r0
    starts[LOWER_ARC], rates[LOWER_ARC] = -crescent.alpha, 1 / r2
    starts[RIGHT_WHEEL], rates[RIGHT_WHEEL] = np.pi + crescent.xi + crescent.eps, -1 / r0
    starts[UPPER_ARC], rates[UPPER_ARC] = np.pi / 2 + crescent.eps, -1 / r1
    theta = starts[positions.segment] + rates[positions.segment] * positions.along
    free = points[:, slot.free - 1]
    theta[:, slot.free - 1] = np.arctan2(free.real, -free.imag)
    return Pins(points, positions.segment, theta)
