"""Closed tracks of tangent arcs, and the pins of a constant-pitch chain that are stepped along them.

Each segment is defined by its start, its heading and its signed curvature. In the frame of a segment there is no
cancellation at large radii. Points are complex numbers x + i y, lengths are in the user's unit, and angles are in
radians.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.errors import FieldError
from synthesis.one_variable import Floats

Points = NDArray[np.complex128]


def pitch_error(constraint: str, sentence: str, arc_length: float) -> FieldError:
    """Return the error for a pin without a valid next pin, at an arc length of the track."""
    message = f"{sentence} (pin at {arc_length:.6g} along the track)"
    return FieldError("/pitch", message, constraint=constraint, amount=arc_length)


def no_point_error(arc_length: float) -> FieldError:
    """Return the error for a link that does not fit on the track."""
    return pitch_error("no_point", "no point of the track ahead is one pitch away", arc_length)


class Arc(NamedTuple):
    """A segment of a track."""

    x: float
    """Horizontal coordinate of the start."""
    y: float
    """Vertical coordinate of the start."""
    heading: float
    """Direction of travel at the start."""
    curvature: float
    """Signed curvature, not 0: positive for a left turn, negative for a right turn."""
    length: float
    """Arc length."""


class TrackPosition(NamedTuple):
    """Positions on a track, in arrays of the same shape."""

    segment: NDArray[np.intp]
    """Index of the segment."""
    along: Floats
    """Arc length from the start of the segment."""
    lap: NDArray[np.int64]
    """Number of completed laps."""


class PinMotion(NamedTuple):
    """Derivatives of the arc length of a position with respect to the phase of the chain."""

    rate: Floats
    """First derivative, shape (n,)."""
    acceleration: Floats
    """Second derivative, shape (n,)."""

    def reversed(self) -> PinMotion:
        """Return the same motion with the arc length measured in the opposite direction."""
        return PinMotion(-self.rate, -self.acceleration)


class Track:
    """A closed loop of tangent arcs.

    Consecutive pins are one pitch apart, and the next pin is the first such position ahead.

    Parameters
    ----------
    segments : sequence of Arc
        Segments in the direction of travel. Each segment starts at the end of its predecessor with the same heading,
        and the last segment ends at the start of the first.
    """

    def __init__(self, segments: Sequence[Arc]) -> None:
        x, y, self._heading, self.curvature, self.length = np.array(segments, dtype=float).T.copy()
        self.count = len(x)
        self._start, self._direction = x + 1j * y, np.cos(self._heading) + 1j * np.sin(self._heading)
        self.joints = np.concatenate([[0.0], np.cumsum(self.length)])
        self.total = float(self.joints[-1])

    @cached_property
    def reverse(self) -> Track:
        """Return the same loop with the opposite direction of travel; its arc length is ``total - s``."""
        ends = self._points(np.arange(self.count), self.length)
        headings = self._heading + self.curvature * self.length + np.pi
        rows = zip(ends.real, ends.imag, headings, -self.curvature, self.length)
        return Track([Arc(*map(float, row)) for row in rows][::-1])

    def locate(self, s: ArrayLike) -> TrackPosition:
        """Return the positions at arc lengths ``s``, which can exceed one lap."""
        s = np.atleast_1d(np.asarray(s, dtype=float))
        lap = np.floor(s / self.total)
        within = s - lap * self.total
        segment = np.clip(np.searchsorted(self.joints, within, side="right") - 1, 0, self.count - 1)
        return TrackPosition(segment, within - self.joints[segment], lap.astype(np.int64))

    def arc_length(self, position: TrackPosition) -> Floats:
        """Return the arc length of positions from the start of the first lap; the inverse of `locate`."""
        return position.lap * self.total + (self.joints[position.segment] + position.along)

    def mirror(self, position: TrackPosition) -> TrackPosition:
        """Return the same positions on the reverse track."""
        return TrackPosition(
            self.count - 1 - position.segment, self.length[position.segment] - position.along, -position.lap
        )

    def points(self, position: TrackPosition) -> Points:
        """Return the points of the track at positions."""
        return self._points(position.segment, position.along)

    def tangents(self, position: TrackPosition) -> Points:
        """Return the unit tangents in the direction of travel."""
        turn = self.curvature[position.segment] * position.along
        return self._direction[position.segment] * (np.cos(turn) + 1j * np.sin(turn))

    # The next two methods write out the complex product, because numpy rounds it differently depending on the index in the
    # array, and stepping would propagate the difference.

    def _points(self, segment: NDArray[np.intp], along: Floats) -> Points:
        """Return points as the start of the segment plus a chord at half of the turn."""
        curvature = self.curvature[segment]
        half = 0.5 * curvature * along
        chord = 2 * np.sin(half) / curvature
        ahead, aside = chord * np.cos(half), chord * np.sin(half)
        c, s = self._direction[segment].real, self._direction[segment].imag
        return self._start[segment] + (ahead * c - aside * s) + 1j * (ahead * s + aside * c)

    def _local_coordinates(self, segment: NDArray[np.intp] | int, points: Points) -> tuple[Floats, Floats]:
        """Return the coordinates of points ahead and to the left of the start of segments."""
        relative = points - self._start[segment]
        cosine, sine = self._direction[segment].real, self._direction[segment].imag
        return relative.real * cosine + relative.imag * sine, relative.imag * cosine - relative.real * sine

    def feet(self, segment: int, points: Points) -> tuple[Floats, Floats]:
        """Project points, shape (n,), onto a segment, which is continued beyond its ends.

        Returns
        -------
        along : ndarray, shape (n,)
            Arc length of the foot from the start of the segment.
        offset : ndarray, shape (n,)
            Distance from the segment, positive to the left: (1 - rho)/k, where rho is the distance from the centre in
            radii, written without the difference.
        """
        ahead, aside = self._local_coordinates(segment, points)
        k = self.curvature[segment]
        offset = (2 * aside - k * (ahead**2 + aside**2)) / (1 + np.hypot(k * ahead, 1 - k * aside))
        along, turn = np.arctan2(k * ahead, 1 - k * aside) / k, 2 * np.pi / abs(k)
        # for an arc of more than half a turn, choose the foot nearest to the middle of the arc
        return along + turn * np.round((self.length[segment] / 2 - along) / turn), offset

    def distance(self, segment: int, points: Points) -> Floats:
        """Return the distance of points from a segment including its ends."""
        along, offset = self.feet(segment, points)
        ends = self._points(np.array([segment, segment]), np.array([0.0, self.length[segment]]))
        to_ends = np.abs(points[:, None] - ends).min(axis=1)
        return np.where((along >= 0) & (along <= self.length[segment]), np.abs(offset), to_ends)

    def link_lengths(self, pitch: float) -> Floats:
        """Return the arc length that one link covers on each segment; infinite if it is longer than the diameter."""
        k = np.abs(self.curvature)
        fits = k * pitch <= 2
        return np.where(fits, 2 * np.arcsin(np.where(fits, 0.5 * k * pitch, 0.0)) / k, np.inf)

    def advance(
        self, position: TrackPosition, pitch: float, links: ArrayLike = 1, direction: int = 1
    ) -> TrackPosition:
        """Return the pins some links ahead; the next pin is the first position whose straight distance is one pitch.

        The cost does not depend on the number of links on a segment, only on the number of joints passed.

        Parameters
        ----------
        position : TrackPosition
            The pins, shape (n,).
        pitch : float
            Length of a link.
        links : int or array_like of int
            Number of links for each position, at least 0.
        direction : {1, -1}
            In or against the direction of travel.

        Raises
        ------
        FieldError
            A pin has no next pin; the error describes the first such pin.
        """
        at_rest = PinMotion(np.zeros_like(position.along), np.zeros_like(position.along))
        return self.carry(position, at_rest, pitch, links, direction)[0]

    def carry(
        self, position: TrackPosition, motion: PinMotion, pitch: float, links: ArrayLike, direction: int = 1
    ) -> tuple[TrackPosition, PinMotion]:
        """Advance positions as in `advance`, together with their motion."""
        if direction < 0:
            # the arc length of the reverse track decreases: both derivatives change sign, before and after the step
            reached, reached_motion = self.reverse.carry(self.mirror(position), motion.reversed(), pitch, links)
            return self.reverse.mirror(reached), reached_motion.reversed()
        lengths = self.link_lengths(pitch)
        remaining = np.broadcast_to(np.asarray(links, dtype=float), position.along.shape).copy()
        segment, along, lap = position.segment.copy(), position.along.copy(), position.lap.copy()
        rate, acceleration = motion.rate.copy(), motion.acceleration.copy()
        while True:
            link_length = lengths[segment]
            links_inside = np.clip(np.floor((self.length[segment] - along) / link_length), 0, remaining)
            along = along + np.where(
                links_inside > 0, links_inside * np.where(np.isfinite(link_length), link_length, 0.0), 0.0
            )
            remaining = remaining - links_inside
            active = np.flatnonzero(remaining > 0)
            if not len(active):
                return TrackPosition(segment, along, lap), PinMotion(rate, acceleration)
            before = TrackPosition(segment[active], along[active], lap[active])
            after = self._step_to_later_segment(before, pitch)
            moving = PinMotion(rate[active], acceleration[active])
            rate[active], acceleration[active] = self._next_motion(before, after, moving)
            segment[active], along[active], lap[active] = after
            remaining[active] -= 1

    def _step_to_later_segment(self, position: TrackPosition, pitch: float) -> TrackPosition:
        """Return the next pins, which lie on a later segment than the pins themselves.

        In the frame of a segment, with P = (ahead, aside) and z = (2/k) tan(k t/2), the equation |Q(t) - P| = pitch
        is A z^2 - 2 B z + C = 0 with A = 1 - k aside + k^2 C/4, B = ahead and C = |P|^2 - pitch^2. While the track is
        inside the circle around P (C < 0), it leaves the circle at the root z = (B + sqrt(B^2 - A C))/A, on arcs of
        either sense and any sweep. No value has to be clamped, and no root has to be selected.
        """
        points = self.points(position)
        segment, along, lap = position.segment.copy(), position.along.copy(), position.lap.copy()
        pending = np.arange(len(segment))
        for _ in range(self.count):
            following = segment[pending] + 1
            lap[pending] += following == self.count
            segment[pending] = following = following % self.count
            k = self.curvature[following]
            ahead, aside = self._local_coordinates(following, points[pending])
            c = ahead**2 + aside**2 - pitch**2
            a = 1 - k * aside + 0.25 * k * k * c
            radicand = ahead**2 - a * c
            root = np.sqrt(np.maximum(radicand, 0.0))
            # choose the form of the root that does not add numbers of opposite sign
            numerator = np.where(ahead >= 0, ahead + root, -c)
            denominator = np.where(ahead >= 0, a, root - ahead)
            t = 2 * np.arctan2(0.5 * np.abs(k) * numerator, denominator) / np.abs(k)
            t = np.where(c >= 0, 0.0, np.where(radicand < 0, np.inf, t))
            hit = t <= self.length[following]
            along[pending] = np.where(hit, t, along[pending])
            pending = pending[~hit]
            if not len(pending):
                return TrackPosition(segment, along, lap)
        raise no_point_error(float(self.arc_length(position)[pending[0]]))

    def _next_motion(self, first: TrackPosition, second: TrackPosition, motion: PinMotion) -> PinMotion:
        """Return the motion of the next pins, from the first and second derivatives of |Q2 - Q1| = pitch.

        e.T2 s2' = e.T1 s1';  e.T2 s2'' = e.T1 s1'' + e.(k1 N1 s1'^2 - k2 N2 s2'^2) - |Q2' - Q1'|^2/pitch.
        """
        link = self.points(second) - self.points(first)
        pitch = np.abs(link)
        t1, t2 = self.tangents(first), self.tangents(second)
        # e/T has the real part e.T and the imaginary part e.N, where N is the tangent turned left
        u1, u2 = link / pitch * np.conj(t1), link / pitch * np.conj(t2)
        k1, k2 = self.curvature[first.segment], self.curvature[second.segment]
        with np.errstate(divide="ignore", invalid="ignore"):  # a link perpendicular to the track has no finite rate
            rate = motion.rate * u1.real / u2.real
            relative = np.abs(t2 * rate - t1 * motion.rate)
            turned = k1 * u1.imag * motion.rate**2 - k2 * u2.imag * rate**2
            return PinMotion(rate, (u1.real * motion.acceleration + turned - relative**2 / pitch) / u2.real)
