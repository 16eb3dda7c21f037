"""Closed tracks of tangent arcs and lines, and the pins of a constant-pitch chain that are stepped along them.

Each segment is defined by its start, its heading and its signed curvature, so one formula covers lines and arcs of
any radius. In the frame of a segment there is no cancellation at large radii, and the origin of the drawing can be
anywhere. Points are complex numbers x + i y, lengths are in the user's unit, and angles are in radians.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.errors import FieldError
from synthesis.one_variable import Floats


class ChordFault(StrEnum):
    """Reason why a link does not fit; the value is the sentence shown to the user."""

    NO_POINT = "no point of the track ahead is one pitch away"
    REVERSAL = (
        "the pitch is too long for the bends of the track: a pin would jump or run backwards while the chain advances"
    )
    AMBIGUOUS = "a link is perpendicular to the track, so the pitch does not determine the position of the pin"


class ChordError(FieldError):
    """Error for a pin that has no next pin.

    Parameters
    ----------
    fault : ChordFault
        The reason.
    arc_length : float
        Arc length of the pin from the start of the track.
    """

    def __init__(self, fault: ChordFault, arc_length: float) -> None:
        message = f"{fault.value} (pin at {arc_length:.6g} along the track)"
        super().__init__("/pitch", message, constraint=fault.name.lower(), amount=arc_length)
        self.fault = fault


class NotClosing(FieldError):
    """Error for a chain with the wrong number of links for its track.

    Parameters
    ----------
    links : int
        Number of links of the chain.
    nearest_links : int
        Nearest number of links with which the chain closes.
    missing : float
        Missing length at the worst phase; negative for an excess length.
    where : str
        End of the sentence: the track or the family of tracks.
    """

    def __init__(self, links: int, nearest_links: int, missing: float, where: str) -> None:
        verb, word, length = "does not close", "in excess", {"excess_length": -missing}
        if missing > 0:
            verb, word, length = "would be stretched", "missing", {"missing_length": missing}
        super().__init__(
            "/links",
            f"a chain of {links} links {verb} {where}: {abs(missing):.6g} of length is {word}; "
            f"{nearest_links} links close",
            constraint="closure",
            amount=abs(missing),
            nearest_links=nearest_links,
            **length,
        )


def check_link_fits(field: str, pitch: float, radius: float) -> None:
    """Raise a `FieldError` for an arc whose diameter is not larger than a link."""
    if not pitch < 2 * radius * (1 - 1e-9):
        raise FieldError(
            field,
            f"a link does not fit on an arc of radius {radius:.6g}; the radius must be more than {pitch / 2:.6g}",
            constraint="link_on_arc",
            amount=pitch / 2 - radius,
        )


GRAZING = 1e-7
"""Cosine of the angle between link and track below which the pitch does not determine the position of a pin."""

Points = NDArray[np.complex128]


def dot(first: Points, second: Points) -> Floats:
    """Return the scalar products of plane vectors."""
    return (first * np.conj(second)).real


def cross(first: Points, second: Points) -> Floats:
    """Return the vector products of plane vectors, positive if the second vector is to the left of the first."""
    return (np.conj(first) * second).imag


class Segment(NamedTuple):
    """An arc or a line."""

    x: float
    """Horizontal coordinate of the start."""
    y: float
    """Vertical coordinate of the start."""
    heading: float
    """Direction of travel at the start."""
    curvature: float
    """Signed curvature: positive for a left turn, negative for a right turn, 0 for a line."""
    length: float
    """Arc length."""


def arc(cx: float, cy: float, radius: float, start_angle: float, sweep: float) -> Segment:
    """Return an arc.

    Parameters
    ----------
    cx, cy : float
        Centre.
    radius : float
    start_angle : float
        Polar angle of the start about the centre.
    sweep : float
        Swept angle, positive for a left turn.

    Returns
    -------
    Segment
    """
    turn = 1.0 if sweep > 0 else -1.0
    x, y = cx + radius * np.cos(start_angle), cy + radius * np.sin(start_angle)
    return Segment(float(x), float(y), start_angle + turn * np.pi / 2, turn / radius, radius * abs(sweep))


class TrackPosition(NamedTuple):
    """Positions on a track."""

    segment: NDArray[np.intp]
    """Index of the segment, shape (n,)."""
    along: Floats
    """Arc length from the start of the segment, shape (n,)."""
    lap: NDArray[np.int64]
    """Number of completed laps, shape (n,)."""

    def select(self, index: NDArray[np.intp] | slice) -> TrackPosition:
        """Return some of the positions."""
        return TrackPosition(self.segment[index], self.along[index], self.lap[index])

    def repeated(self, times: int) -> TrackPosition:
        """Repeat a single position."""
        return TrackPosition(np.repeat(self.segment, times), np.repeat(self.along, times), np.repeat(self.lap, times))


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
    """A closed loop of tangent segments.

    Consecutive pins are one pitch apart, and the next pin is the first such position ahead.

    Parameters
    ----------
    segments : sequence of Segment
        Segments in the direction of travel. Each segment starts at the end of its predecessor with the same heading,
        and the last segment ends at the start of the first.
    """

    def __init__(self, segments: Sequence[Segment]) -> None:
        rows = np.array(segments, dtype=float)
        starts, self._heading = rows[:, 0] + 1j * rows[:, 1], rows[:, 2].copy()
        # all geometry is relative to the start of the first segment, because the origin of the drawing can be far away
        self.origin = complex(starts[0])
        self.count = len(rows)
        self.curvature, self.length = rows[:, 3].copy(), rows[:, 4].copy()
        self._start, self._direction = starts - self.origin, np.cos(self._heading) + 1j * np.sin(self._heading)
        self.joints = np.concatenate([[0.0], np.cumsum(self.length)])
        self.total = float(self.joints[-1])

    @cached_property
    def reverse(self) -> Track:
        """Return the same loop with the opposite direction of travel; its arc length is ``total - s``."""
        ends = self._points(np.arange(self.count), self.length) + self.origin
        headings = self._heading + self.curvature * self.length + np.pi
        rows = zip(ends.real, ends.imag, headings, -self.curvature, self.length)
        return Track([Segment(*map(float, row)) for row in rows][::-1])

    # Places and points

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
        """Return the points of the track at positions, shape (n,)."""
        return self._points(position.segment, position.along) + self.origin

    def tangents(self, position: TrackPosition) -> Points:
        """Return the unit tangents in the direction of travel, shape (n,)."""
        turn = self.curvature[position.segment] * position.along
        return self._direction[position.segment] * (np.cos(turn) + 1j * np.sin(turn))

    # The next two methods write out the complex product, because numpy rounds it differently depending on the index in the
    # array, and stepping would propagate the difference.

    def _points(self, segment: NDArray[np.intp], along: Floats) -> Points:
        """Return points relative to `origin`, as the start plus a chord at half of the turn.

        The formula is also valid for curvature 0.
        """
        curvature = self.curvature[segment]
        half = 0.5 * curvature * along
        is_line = curvature == 0
        chord = np.where(is_line, along, 2 * np.sin(half) / np.where(is_line, 1.0, curvature))
        ahead, aside = chord * np.cos(half), chord * np.sin(half)
        c, s = self._direction[segment].real, self._direction[segment].imag
        return self._start[segment] + (ahead * c - aside * s) + 1j * (ahead * s + aside * c)

    def _local_coordinates(self, segment: NDArray[np.intp], points: Points) -> tuple[Floats, Floats]:
        """Return the coordinates ahead and to the left of the start of each segment, of points relative to `origin`."""
        relative = points - self._start[segment]
        cosine, sine = self._direction[segment].real, self._direction[segment].imag
        return relative.real * cosine + relative.imag * sine, relative.imag * cosine - relative.real * sine

    def feet(self, segment: int, points: Points) -> tuple[Floats, Floats]:
        """Project points onto a segment, which is continued beyond its ends.

        The offset from an arc is (1 - rho)/k, where rho is the distance from the centre in radii. Written without the
        difference, the formula is also valid for curvature 0.

        Parameters
        ----------
        segment : int
            Index of the segment.
        points : ndarray of complex, shape (n,)

        Returns
        -------
        along : ndarray, shape (n,)
            Arc length of the foot from the start of the segment.
        offset : ndarray, shape (n,)
            Distance from the segment, positive to the left.
        """
        ahead, aside = self._local_coordinates(np.full(len(points), segment), points - self.origin)
        k = self.curvature[segment]
        radius_ratio = np.hypot(k * ahead, 1 - k * aside)
        offset = (2 * aside - k * (ahead**2 + aside**2)) / (1 + radius_ratio)
        along = ahead if k == 0 else np.arctan2(k * ahead, 1 - k * aside) / k
        # for an arc of more than half a turn, choose the foot nearest to the middle of the arc
        if k != 0:
            turn = 2 * np.pi / abs(k)
            along = along + turn * np.round((self.length[segment] / 2 - along) / turn)
        return along, offset

    def distance(self, segment: int, points: Points) -> Floats:
        """Return the distance of points from a segment including its ends."""
        along, offset = self.feet(segment, points)
        ends = self._points(np.array([segment, segment]), np.array([0.0, self.length[segment]])) + self.origin
        to_ends = np.abs(points[:, None] - ends).min(axis=1)
        return np.where((along >= 0) & (along <= self.length[segment]), np.abs(offset), to_ends)

    # Stepping

    def link_lengths(self, pitch: float) -> Floats:
        """Return the arc length that one link covers on each segment.

        It is infinite if the pitch exceeds the diameter of the arc.
        """
        k = np.abs(self.curvature)
        fits = k * pitch <= 2
        half_angle = np.arcsin(np.where(fits, 0.5 * k * pitch, 0.0))
        on_arc = np.where(k > 0, 2 * half_angle / np.where(k > 0, k, 1.0), pitch)
        return np.where(fits, on_arc, np.inf)

    def step(self, position: TrackPosition, pitch: float, direction: int = 1) -> TrackPosition:
        """Return the next pin of each pin: the first position ahead whose straight distance from it is one pitch.

        Parameters
        ----------
        position : TrackPosition
            The pins, shape (n,).
        pitch : float
            Length of a link.
        direction : {1, -1}
            In or against the direction of travel.

        Returns
        -------
        TrackPosition
        """
        return self.advance(position, pitch, links=1, direction=direction)

    def advance(self, position: TrackPosition, pitch: float, links: ArrayLike, direction: int = 1) -> TrackPosition:
        """Return the pins ``links`` links ahead, which is equivalent to calling `step` ``links`` times.

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

        Returns
        -------
        TrackPosition

        Raises
        ------
        ChordError
            A pin has no next pin; the error describes the first such pin.
        """
        if direction < 0:
            return self.reverse.mirror(self.reverse.advance(self.mirror(position), pitch, links))
        return self._advanced(position, None, pitch, links)[0]

    def carry(
        self, position: TrackPosition, motion: PinMotion, pitch: float, links: ArrayLike, direction: int = 1
    ) -> tuple[TrackPosition, PinMotion]:
        """Advance positions as in `advance`, together with their motion.

        Parameters
        ----------
        position : TrackPosition
            The pins, shape (n,).
        motion : PinMotion
            Motion of the pins.
        pitch, links, direction
            See `advance`.

        Returns
        -------
        TrackPosition, PinMotion
            Position and motion of the pins ``links`` links ahead.
        """
        if direction < 0:
            # the arc length of the reverse track decreases: both derivatives change sign, before and after the step
            reached, reached_motion = self.reverse.carry(self.mirror(position), motion.reversed(), pitch, links)
            return self.reverse.mirror(reached), reached_motion.reversed()
        return self._advanced(position, motion, pitch, links)

    def _advanced(
        self, position: TrackPosition, motion: PinMotion | None, pitch: float, links: ArrayLike
    ) -> tuple[TrackPosition, PinMotion]:
        lengths = self.link_lengths(pitch)
        remaining = np.broadcast_to(np.asarray(links, dtype=float), position.along.shape).copy()
        segment, along, lap = position.segment.copy(), position.along.copy(), position.lap.copy()
        start_motion = PinMotion(np.ones_like(along), np.zeros_like(along)) if motion is None else motion
        rate, acceleration = start_motion.rate.copy(), start_motion.acceleration.copy()
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
            if motion is not None:
                rate[active], acceleration[active] = self._next_motion(
                    before, after, PinMotion(rate[active], acceleration[active])
                )
            segment[active], along[active], lap[active] = after
            remaining[active] -= 1

    def _step_to_later_segment(self, position: TrackPosition, pitch: float) -> TrackPosition:
        """Return the next pins, which lie on a later segment than the pins themselves.

        In the frame of a segment, with P = (ahead, aside) and z = (2/k) tan(k t/2), the equation |Q(t) - P| = pitch
        is A z^2 - 2 B z + C = 0 with A = 1 - k aside + k^2 C/4, B = ahead and C = |P|^2 - pitch^2. While the track is
        inside the circle around P (C < 0), it leaves the circle at the root z = (B + sqrt(B^2 - A C))/A, on lines and
        on arcs of either sense and any sweep. No value has to be clamped, and no root has to be selected.
        """
        points = self._points(position.segment, position.along)
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
            curved = k != 0
            abs_curvature = np.abs(np.where(curved, k, 1.0))
            t = 2 * np.arctan2(0.5 * abs_curvature * numerator, denominator) / abs_curvature
            on_line = numerator / np.where(curved | (denominator == 0), 1.0, denominator)
            t = np.where(curved, t, np.where(denominator > 0, on_line, np.inf))
            t = np.where(c >= 0, 0.0, np.where(radicand < 0, np.inf, t))
            hit = t <= self.length[following]
            along[pending] = np.where(hit, t, along[pending])
            pending = pending[~hit]
            if not len(pending):
                return TrackPosition(segment, along, lap)
        raise ChordError(ChordFault.NO_POINT, float(self.arc_length(position)[pending[0]]))

    def _next_motion(self, first: TrackPosition, second: TrackPosition, motion: PinMotion) -> PinMotion:
        """Return the motion of the next pins, from the first and second derivatives of |Q2 - Q1| = pitch.

        e.T2 s2' = e.T1 s1';  e.T2 s2'' = e.T1 s1'' + e.(k1 N1 s1'^2 - k2 N2 s2'^2) - |Q2' - Q1'|^2/pitch.
        """
        link = self._points(second.segment, second.along) - self._points(first.segment, first.along)
        pitch = np.abs(link)
        t1, t2 = self.tangents(first), self.tangents(second)
        # e/T has the real part e.T and the imaginary part e.N, where N is the tangent turned left
        u1, u2 = link / pitch * np.conj(t1), link / pitch * np.conj(t2)
        grazing = np.flatnonzero(np.abs(u2.real) < GRAZING)
        if len(grazing):
            raise ChordError(ChordFault.AMBIGUOUS, float(self.arc_length(first)[grazing[0]]))
        k1, k2 = self.curvature[first.segment], self.curvature[second.segment]
        rate = motion.rate * u1.real / u2.real
        relative = np.abs(t2 * rate - t1 * motion.rate)
        turned = k1 * u1.imag * motion.rate**2 - k2 * u2.imag * rate**2
        return PinMotion(rate, (u1.real * motion.acceleration + turned - relative**2 / pitch) / u2.real)
