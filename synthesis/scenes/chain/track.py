"""A closed track of tangent arcs and lines, the pins of a constant-pitch chain that step along it, and why one is refused.

Each segment is held by its start, its heading and its signed curvature, so an arc of any radius and a line are one
formula: in the segment's own frame nothing cancels when the radius grows, and the origin of the drawing may be
anywhere. Points are complex numbers x + i y, lengths are in the user's own unit, angles in radians.
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
    """Why a link does not fit; the value is the sentence that the user reads."""

    NO_POINT = "no point of the track ahead is one pitch away"
    REVERSAL = "the pitch is too long for the track's bends: a pin would jump or run back while the chain moves on"
    AMBIGUOUS = "a link stands square to the track, so that the pitch does not determine the pin's place"


class ChordError(FieldError):
    """A pin for which there is no next pin.

    ``fault``: what is wrong. ``position``: arc length of the pin from the start of the track.
    """

    def __init__(self, fault: ChordFault, position: float) -> None:
        message = f"{fault.value} (pin at {position:.6g} along the track)"
        super().__init__("/pitch", message, constraint=fault.name.lower(), amount=position)
        self.fault = fault


class TrackError(FieldError):
    """Segments that make no closed tangent track.

    ``message``: what was found and what was wanted. ``segment``: the segment at fault. ``amount``: the size of the
    fault: a gap, an angle, a length or a number of turns.
    """

    def __init__(self, message: str, segment: int, amount: float) -> None:
        super().__init__(f"/segments/{segment}", message, constraint="closed_tangent_track", amount=amount)
        self.segment = segment


class NotClosing(FieldError):
    """A chain so much too short or too long for its track that another number of links closes.

    ``links``, ``nearest_links``: number of links of the chain, and the nearest number that does close. ``missing``:
    length that the chain lacks at its worst phase; negative: its excess. ``where``: completes the sentence: on which
    track, or on which of a family of tracks.
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
    """Raise `FieldError` for an arc whose diameter is no longer than a link."""
    if not pitch < 2 * radius * (1 - 1e-9):
        raise FieldError(
            field,
            f"a link does not fit on an arc of radius {radius:.6g}; more than {pitch / 2:.6g} is wanted",
            constraint="link_on_arc",
            amount=pitch / 2 - radius,
        )


JOINT_GAP = 1e-7
"""Largest gap between two segments, as a fraction of the track's length."""
JOINT_KINK = 1e-6
"""Largest angle between the headings of two segments at their joint, radians."""
GRAZING = 1e-7
"""Cosine between link and track below which a pin's place is not determined by the pitch."""

Points = NDArray[np.complex128]


def dot(a: Points, b: Points) -> Floats:
    """Scalar products of plane vectors."""
    return (a * np.conj(b)).real


def cross(a: Points, b: Points) -> Floats:
    """Vector products of plane vectors; positive where the second lies to the left of the first."""
    return (np.conj(a) * b).imag


class Segment(NamedTuple):
    """An arc (curvature > 0 turns left, < 0 right) or a line (curvature 0), from its start."""

    x: float
    y: float
    heading: float
    curvature: float
    length: float


def line(x0: float, y0: float, x1: float, y1: float) -> Segment:
    """The line from one point to another."""
    return Segment(x0, y0, float(np.arctan2(y1 - y0, x1 - x0)), 0.0, float(np.hypot(x1 - x0, y1 - y0)))


def arc(cx: float, cy: float, radius: float, start_angle: float, sweep: float) -> Segment:
    """The arc around (cx, cy) from the polar angle ``start_angle``; a positive sweep turns left."""
    turn = 1.0 if sweep > 0 else -1.0
    x, y = cx + radius * np.cos(start_angle), cy + radius * np.sin(start_angle)
    return Segment(float(x), float(y), start_angle + turn * np.pi / 2, turn / radius, radius * abs(sweep))


class Place(NamedTuple):
    """Places on a track, shape (n,) each: the segment, the arc length along it, and the whole laps before it."""

    segment: NDArray[np.intp]
    along: Floats
    lap: NDArray[np.int64]

    def rows(self, index: NDArray[np.intp] | slice) -> Place:
        """Some of the places."""
        return Place(self.segment[index], self.along[index], self.lap[index])

    def repeated(self, times: int) -> Place:
        """One place, ``times`` times."""
        return Place(np.repeat(self.segment, times), np.repeat(self.along, times), np.repeat(self.lap, times))


class Motion(NamedTuple):
    """First and second derivative of a place's arc length by the phase that drives the chain, shape (n,) each."""

    rate: Floats
    bend: Floats

    def reversed(self) -> Motion:
        """The same motion where arc length is counted the other way."""
        return Motion(-self.rate, -self.bend)


class Track:
    """A closed loop of tangent segments.

    Law: a pin and its next pin are one pitch apart, and the next pin is the *first* such place ahead.

    ``segments``: in the order of travel; each starts where the one before it ends, with the same heading, and the last
    one ends where the first starts.

    Raises `TrackError`: no segment, a segment without length, an arc of more than one turn, a gap or a kink at a joint.
    """

    def __init__(self, segments: Sequence[Segment]) -> None:
        if not segments:
            raise TrackError("a track needs at least one segment", 0, 0)
        rows = np.array(segments, dtype=float)
        for index, row in enumerate(rows):
            if not np.isfinite(row).all():
                raise TrackError(f"segment {index} has a coordinate that is not finite", index, 0)
            if not row[4] > 0:
                raise TrackError(f"segment {index} has no length", index, float(row[4]))
            if abs(row[3]) * row[4] > 2 * np.pi * (1 + 1e-12):
                turns = float(abs(row[3]) * row[4] / (2 * np.pi))
                raise TrackError(
                    f"segment {index} turns {turns:.6g} times round, at most once is wanted", index, turns
                )
        self.segments = tuple(Segment(*map(float, row)) for row in rows)
        starts, self._heading = rows[:, 0] + 1j * rows[:, 1], rows[:, 2].copy()
        self.origin = complex(starts[0])
        """The drawing's origin is far away in some tracks: all geometry is relative to the first segment's start."""
        self.count = len(rows)
        self.curvature, self.length = rows[:, 3].copy(), rows[:, 4].copy()
        self._start, self._direction = starts - self.origin, np.cos(self._heading) + 1j * np.sin(self._heading)
        self.joints = np.concatenate([[0.0], np.cumsum(self.length)])
        self.total = float(self.joints[-1])
        self._check_joints()

    def _check_joints(self) -> None:
        end = self._points(np.arange(self.count), self.length)
        gap = np.abs(np.roll(self._start, -1) - end)
        turn = np.roll(self._heading, -1) - self._heading - self.curvature * self.length
        kink = np.abs(np.arctan2(np.sin(turn), np.cos(turn)))
        for name, found, allowed in (
            ("a gap of {:.6g}, at most {:.3g} is allowed", gap, JOINT_GAP * self.total),
            ("a kink of {:.6g} rad, at most {:.3g} is allowed", kink, JOINT_KINK),
        ):
            worst = int(np.argmax(found))
            if found[worst] > allowed:
                text = name.format(found[worst], allowed)
                message = f"between segment {worst} and segment {(worst + 1) % self.count} there is {text}"
                raise TrackError(message, worst, float(found[worst]))

    @cached_property
    def reverse(self) -> Track:
        """The same loop travelled the other way; its arc length is ``total - s``."""
        ends = self._points(np.arange(self.count), self.length) + self.origin
        headings = self._heading + self.curvature * self.length + np.pi
        rows = zip(ends.real, ends.imag, headings, -self.curvature, self.length)
        return Track([Segment(*map(float, row)) for row in rows][::-1])

    def starting_at(self, segment: int) -> Track:
        """The same loop whose arc length counts from the start of another segment."""
        return Track(self.segments[segment:] + self.segments[:segment]) if segment else self

    # Places and points

    def place(self, s: ArrayLike) -> Place:
        """The places at arc lengths ``s``, which may lie beyond one lap."""
        s = np.atleast_1d(np.asarray(s, dtype=float))
        lap = np.floor(s / self.total)
        within = s - lap * self.total
        segment = np.clip(np.searchsorted(self.joints, within, side="right") - 1, 0, self.count - 1)
        return Place(segment, within - self.joints[segment], lap.astype(np.int64))

    def position(self, place: Place) -> Floats:
        """Arc length of places from the start of the first lap: the inverse of `place`."""
        return place.lap * self.total + (self.joints[place.segment] + place.along)

    def mirrored(self, place: Place) -> Place:
        """The same places as the reverse track counts them."""
        return Place(self.count - 1 - place.segment, self.length[place.segment] - place.along, -place.lap)

    def points(self, place: Place) -> Points:
        """Points of the track, shape (n,)."""
        return self._points(place.segment, place.along) + self.origin

    def beside(self, place: Place, offset: Floats) -> Points:
        """Points square to the track at a distance, left positive: the inverse of `feet`."""
        return self.points(place) + 1j * offset * self.tangents(place)

    def tangents(self, place: Place) -> Points:
        """Unit tangents in the direction of travel, shape (n,)."""
        turn = self.curvature[place.segment] * place.along
        return self._direction[place.segment] * (np.cos(turn) + 1j * np.sin(turn))

    # The two below write out the complex product: numpy rounds it differently with the place in the array, and
    # stepping would pass that on to places that are known to rounding.

    def _points(self, segment: NDArray[np.intp], along: Floats) -> Points:
        """Points relative to `origin`: start + chord at half the turn, which holds for curvature 0 as well."""
        curvature = self.curvature[segment]
        half = 0.5 * curvature * along
        straight = curvature == 0
        chord = np.where(straight, along, 2 * np.sin(half) / np.where(straight, 1.0, curvature))
        ahead, aside = chord * np.cos(half), chord * np.sin(half)
        c, s = self._direction[segment].real, self._direction[segment].imag
        return self._start[segment] + (ahead * c - aside * s) + 1j * (ahead * s + aside * c)

    def _local(self, segment: NDArray[np.intp], points: Points) -> tuple[Floats, Floats]:
        """Coordinates ahead and aside of each segment's start, of points relative to `origin`."""
        d = points - self._start[segment]
        c, s = self._direction[segment].real, self._direction[segment].imag
        return d.real * c + d.imag * s, d.imag * c - d.real * s

    def feet(self, segment: int, points: Points) -> tuple[Floats, Floats]:
        """Arc length and offset (left positive) of points by one segment, continued beyond its ends.

        The offset of an arc is (1 - rho)/k with rho the distance from its centre in radii; written without the
        difference it also holds for curvature 0.
        """
        ahead, aside = self._local(np.full(len(points), segment), points - self.origin)
        k = self.curvature[segment]
        rho = np.hypot(k * ahead, 1 - k * aside)
        offset = (2 * aside - k * (ahead**2 + aside**2)) / (1 + rho)
        along = ahead if k == 0 else np.arctan2(k * ahead, 1 - k * aside) / k
        # An arc of more than half a turn: the foot is searched from its middle, not from its start.
        if k != 0:
            turn = 2 * np.pi / abs(k)
            along = along + turn * np.round((self.length[segment] / 2 - along) / turn)
        return along, offset

    def distance(self, segment: int, points: Points) -> Floats:
        """Distance of points from one segment, its ends included."""
        along, offset = self.feet(segment, points)
        ends = self._points(np.array([segment, segment]), np.array([0.0, self.length[segment]])) + self.origin
        to_ends = np.abs(points[:, None] - ends).min(axis=1)
        return np.where((along >= 0) & (along <= self.length[segment]), np.abs(offset), to_ends)

    # Stepping

    def link_lengths(self, pitch: float) -> Floats:
        """Arc length that one link takes on each segment; infinite where the pitch exceeds the arc's diameter."""
        k = np.abs(self.curvature)
        fits = k * pitch <= 2
        half = np.arcsin(np.where(fits, 0.5 * k * pitch, 0.0))
        bent = np.where(k > 0, 2 * half / np.where(k > 0, k, 1.0), pitch)
        return np.where(fits, bent, np.inf)

    def step(self, place: Place, pitch: float, direction: int = 1) -> Place:
        """The next pins, shape (n,): the first places ahead that are one pitch away, chord by chord."""
        return self.advance(place, pitch, 1, direction)

    def advance(self, place: Place, pitch: float, links: ArrayLike, direction: int = 1) -> Place:
        """The pins ``links`` links ahead, shape (n,). Costs one crossing a joint, however many links lie on a segment.

        Law: equals ``links`` calls of `step`.

        ``place``: the pins, shape (n,). ``pitch``: length of a link. ``links``: number of links for each place, at
        least 0. ``direction``, one of {1, -1}: with or against the direction of travel.

        Raises `ChordError`: for the first pin that has no next pin.
        """
        if direction < 0:
            return self.reverse.mirrored(self.reverse.advance(self.mirrored(place), pitch, links))
        return self._advanced(place, None, pitch, links)[0]

    def carry(
        self, place: Place, motion: Motion, pitch: float, links: ArrayLike, direction: int = 1
    ) -> tuple[Place, Motion]:
        """As `advance`, with the motion of the places on the way in and that of the pins on the way out."""
        if direction < 0:
            # Arc length of the reverse track runs the other way: rate and bend change sign on the way in and out.
            back, moved = self.reverse.carry(self.mirrored(place), motion.reversed(), pitch, links)
            return self.reverse.mirrored(back), moved.reversed()
        return self._advanced(place, motion, pitch, links)

    def _advanced(self, place: Place, motion: Motion | None, pitch: float, links: ArrayLike) -> tuple[Place, Motion]:
        lengths = self.link_lengths(pitch)
        left = np.broadcast_to(np.asarray(links, dtype=float), place.along.shape).copy()
        segment, along, lap = place.segment.copy(), place.along.copy(), place.lap.copy()
        moved = Motion(np.ones_like(along), np.zeros_like(along)) if motion is None else motion
        rate, bend = moved.rate.copy(), moved.bend.copy()
        while True:
            own = lengths[segment]
            inside = np.clip(np.floor((self.length[segment] - along) / own), 0, left)
            along = along + np.where(inside > 0, inside * np.where(np.isfinite(own), own, 0.0), 0.0)
            left = left - inside
            go = np.flatnonzero(left > 0)
            if not len(go):
                return Place(segment, along, lap), Motion(rate, bend)
            before = Place(segment[go], along[go], lap[go])
            after = self._onto_later_segment(before, pitch)
            if motion is not None:
                rate[go], bend[go] = self._passed_on(before, after, Motion(rate[go], bend[go]))
            segment[go], along[go], lap[go] = after
            left[go] -= 1

    def _onto_later_segment(self, place: Place, pitch: float) -> Place:
        """Next pins on a later segment than the pins' own.

        In a segment's own frame, with P = (ahead, aside) and z = (2/k) tan(k t/2), |Q(t) - P| = pitch reads
        A z^2 - 2 B z + C = 0,  A = 1 - k aside + k^2 C/4,  B = ahead,  C = |P|^2 - pitch^2. While the track is still
        inside the circle around P (C < 0) the way out of it is the one root z = (B + sqrt(B^2 - A C))/A, on arcs of
        either sense and any sweep and on lines. So nothing is clamped, and no root has to be picked.
        """
        points = self._points(place.segment, place.along)
        segment, along, lap = place.segment.copy(), place.along.copy(), place.lap.copy()
        todo = np.arange(len(segment))
        for _ in range(self.count):
            j = segment[todo] + 1
            lap[todo] += j == self.count
            segment[todo] = j = j % self.count
            k = self.curvature[j]
            ahead, aside = self._local(j, points[todo])
            c = ahead**2 + aside**2 - pitch**2
            a = 1 - k * aside + 0.25 * k * k * c
            radicand = ahead**2 - a * c
            root = np.sqrt(np.maximum(radicand, 0.0))
            # Two forms of one root: neither adds numbers of opposite sign.
            up = np.where(ahead >= 0, ahead + root, -c)
            down = np.where(ahead >= 0, a, root - ahead)
            curved = k != 0
            size = np.abs(np.where(curved, k, 1.0))
            t = 2 * np.arctan2(0.5 * size * up, down) / size
            flat = up / np.where(curved | (down == 0), 1.0, down)
            t = np.where(curved, t, np.where(down > 0, flat, np.inf))
            t = np.where(c >= 0, 0.0, np.where(radicand < 0, np.inf, t))
            hit = t <= self.length[j]
            along[todo] = np.where(hit, t, along[todo])
            todo = todo[~hit]
            if not len(todo):
                return Place(segment, along, lap)
        raise ChordError(ChordFault.NO_POINT, float(self.position(place)[todo[0]]))

    def _passed_on(self, before: Place, after: Place, motion: Motion) -> Motion:
        """Motion of the next pins: first and second derivative of |Q2 - Q1| = pitch.

        e.T2 s2' = e.T1 s1';  e.T2 s2'' = e.T1 s1'' + e.(k1 N1 s1'^2 - k2 N2 s2'^2) - |Q2' - Q1'|^2/pitch.
        """
        link = self._points(after.segment, after.along) - self._points(before.segment, before.along)
        pitch = np.abs(link)
        t1, t2 = self.tangents(before), self.tangents(after)
        # e/T: its real part is e.T, its imaginary part e.N with N the tangent turned left.
        u1, u2 = link / pitch * np.conj(t1), link / pitch * np.conj(t2)
        grazing = np.flatnonzero(np.abs(u2.real) < GRAZING)
        if len(grazing):
            raise ChordError(ChordFault.AMBIGUOUS, float(self.position(before)[grazing[0]]))
        k1, k2 = self.curvature[before.segment], self.curvature[after.segment]
        rate = motion.rate * u1.real / u2.real
        relative = np.abs(t2 * rate - t1 * motion.rate)
        turned = k1 * u1.imag * motion.rate**2 - k2 * u2.imag * rate**2
        return Motion(rate, (u1.real * motion.bend + turned - relative**2 / pitch) / u2.real)
