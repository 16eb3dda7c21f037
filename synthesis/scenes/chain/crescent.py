"""The chain on a U-shaped slide: the crescent of two arcs and two wheels, and the size at which its chain closes.

Source: Li, Hong, "Realization of compensation trajectory for constrained chain with U-type slide based on MATLAB",
Heavy Machinery 2014-5. The upper arc (radius R1) lies around the origin, the lower arc (R2) around (0, b); the
wheels (R0) touch the upper arc from outside and the lower one from inside. Lengths in the user's own unit, angles in
radians.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synthesis.errors import FieldError
from synthesis.one_variable import Floats
from synthesis.scenes.chain.closure import Chain, critical_parameter
from synthesis.scenes.chain.slot import Pins, Slot, find_slot
from synthesis.scenes.chain.track import Segment, Track, arc, check_link_fits, line
from synthesis.work import Work

FLATTEST = 1e-6
"""Half the lower arc's sweep, radians, of the flattest crescent that is searched: almost a straight lower run."""
RADIUS_RATIO = 1e6
"""Largest radius in pitches."""

LEFT_WHEEL, LOWER_ARC, RIGHT_WHEEL, UPPER_ARC = range(4)
"""The crescent's segments in the order of travel, counterclockwise."""


@dataclass(frozen=True)
class Crescent:
    """The paper's track.

    Law: all four joints are tangent for any radii and any eccentricity whose triangle exists.
    """

    wheel_radius: float
    upper_radius: float
    lower_radius: float
    """R0, R1, R2."""
    eccentricity: float
    """b, height of the lower arc's centre over the upper one's."""
    alpha: float
    """Half the lower arc's sweep; xi = pi/2 - alpha."""
    eps: float
    """Polar angle of the right wheel's centre seen from the origin; 0 in the intended layout."""

    @property
    def xi(self) -> float:
        """Angle under the horizontal at which wheel and lower arc touch, atan(b/c) for eps = 0."""
        return np.pi / 2 - self.alpha

    @property
    def tangency_residual(self) -> float:
        """hypot(c, b) - a: 0 when the wheels' centres are at the height of the upper arc's centre."""
        c, a = self.upper_radius + self.wheel_radius, self.lower_radius - self.wheel_radius
        return float(np.hypot(c, self.eccentricity) - a)

    @property
    def track(self) -> Track:
        """The closed path from the upper-left joint: left wheel, lower arc, right wheel, upper arc.

        Every segment starts from a wheel, so no large radius enters a coordinate.
        """
        r0, r1, r2 = self.wheel_radius, self.upper_radius, self.lower_radius
        xi, eps = self.xi, self.eps
        centre = (r1 + r0) * np.exp(1j * eps)
        turn = np.pi + xi + eps

        def from_wheel(x: float, angle: float, curvature: float, sweep: float) -> Segment:
            start = complex(x, centre.imag) + r0 * np.exp(1j * angle)
            return Segment(start.real, start.imag, angle + np.pi / 2, curvature, sweep / abs(curvature))

        return Track(
            [
                arc(-centre.real, centre.imag, r0, -eps, turn),
                from_wheel(-centre.real, np.pi + xi, 1 / r2, 2 * self.alpha),
                arc(centre.real, centre.imag, r0, -xi, turn),
                from_wheel(centre.real, np.pi + eps, -1 / r1, np.pi + 2 * eps),
            ]
        )

    def link_angles(self, pitch: float) -> tuple[float, float, float]:
        """Angle of one link on the wheel, the upper and the lower arc: dq, du, dd = 2 asin(L/2R)."""
        radii = (self.wheel_radius, self.upper_radius, self.lower_radius)
        wheel, upper, lower = (2 * float(np.arcsin(pitch / (2 * radius))) for radius in radii)
        return wheel, upper, lower


def level_crescent(wheel_radius: float, upper_radius: float, alpha: float) -> Crescent:
    """The crescent with its wheels at the height of the upper arc's centre: a^2 = c^2 + b^2, tan xi = b/c."""
    c = wheel_radius + upper_radius
    lower_radius = wheel_radius + c / np.sin(alpha)
    return Crescent(wheel_radius, upper_radius, float(lower_radius), float(c * np.tan(np.pi / 2 - alpha)), alpha, 0.0)


def given_crescent(wheel_radius: float, upper_radius: float, lower_radius: float, eccentricity: float) -> Crescent:
    """The crescent of four given lengths: the triangle of the centres is solved, so its joints are exactly tangent.

    Raises `FieldError`: where the triangle a, b, c does not exist or its arcs have no sweep.
    """
    c, a, b = upper_radius + wheel_radius, lower_radius - wheel_radius, eccentricity
    if not (a > 0 and abs(c - b) < a < c + b):
        least, most = wheel_radius + abs(c - b), wheel_radius + c + b
        raise FieldError(
            "/lower_radius",
            f"the wheels cannot touch both arcs: with this eccentricity the radius must lie between {least:.6g} "
            f"and {most:.6g}",
            constraint="tangency",
            amount=least - lower_radius if lower_radius <= least else lower_radius - most,
        )
    # cy = (c^2 + b^2 - a^2)/(2b), with the difference taken of the two lengths that are close to each other.
    cy = ((c - a) * (c + a) + b * b) / (2 * b) if b < c else ((b - a) * (b + a) + c * c) / (2 * b)
    cx = np.sqrt((c - cy) * (c + cy))
    if not cx > wheel_radius:
        raise FieldError(
            "/eccentricity", "the two wheels overlap", constraint="wheel_overlap", amount=float(wheel_radius - cx)
        )
    alpha, eps = float(np.arctan2(cx, b - cy)), float(np.arctan2(cy, cx))
    return Crescent(wheel_radius, upper_radius, lower_radius, eccentricity, alpha, eps)


def critical_crescent(
    pitch: float, links: int, upper_radius: float, wheel_radius: float, work: Work | None = None
) -> Crescent:
    """The level crescent on which the chain just closes: at one phase it fits exactly, at no phase it is stretched.

    Its lower radius is the largest that any phase asks for (the paper's theta1m).

    Raises `FieldError`: no crescent of these radii closes; with the nearest number of links and the missing or excess
    length.
    """

    def family(alpha: float) -> Crescent:
        return level_crescent(wheel_radius, upper_radius, alpha)

    where = "on any lower radius"
    return family(
        critical_parameter(lambda alpha: family(alpha).track, pitch, links, np.pi / 2, FLATTEST, where, work)
    )


def stadium(radius: float, straight: float) -> Track:
    """Two half circles, centres ``straight`` apart on the x axis, joined by lines.

    It is travelled to the left, from the joint of the lower line with the right half circle.
    """
    half = straight / 2
    return Track(
        [
            Segment(half, -radius, 0.0, 1 / radius, np.pi * radius),
            line(half, radius, -half, radius),
            Segment(-half, radius, np.pi, 1 / radius, np.pi * radius),
            line(-half, -radius, half, -radius),
        ]
    )


def critical_stadium(pitch: float, links: int, radius: float, work: Work | None = None) -> Track:
    """The stadium of a given radius on which the chain just closes.

    Raises `FieldError`: the chain is shorter than the two half circles.
    """
    check_link_fits("/stadium/radius", pitch, radius)
    where = "on any straight of this stadium"
    straight = critical_parameter(
        lambda x: stadium(radius, x), pitch, links, links * pitch, 1e-6 * pitch, where, work
    )
    return stadium(radius, straight)


def crescent_slot(
    pitch: float,
    links: int,
    upper_radius: float,
    wheel_radius: float | None = None,
    lower_radius: float | None = None,
    eccentricity: float | None = None,
    start: float | None = None,
    work: Work | None = None,
) -> tuple[Crescent, Slot]:
    """The crescent and its slot, under the middle of the upper arc.

    ``wheel_radius``: default pitch/sqrt(2): four pins a turn. ``lower_radius``, ``eccentricity``: both: the layout is
    taken as it is. One: the other follows from wheels at the height of the upper arc's centre. None: both follow from
    the critical closure. ``start``: P1's angle on the left wheel at which the window starts; default: where the chain
    is least slack. ``work``: asked between the steps.

    Raises `FieldError`: no such crescent, or the chain would be stretched or does not close on it.
    """
    wheel_radius = pitch / np.sqrt(2) if wheel_radius is None else wheel_radius
    named = {"upper_radius": upper_radius, "wheel_radius": wheel_radius, "lower_radius": lower_radius}
    for name, radius in named.items():
        if radius is None:
            continue
        check_link_fits(f"/{name}", pitch, radius)
        if radius > RADIUS_RATIO * pitch:
            raise FieldError(
                f"/{name}",
                f"the radius may be at most {RADIUS_RATIO:.0e} pitches, found {radius / pitch:.6g}",
                constraint="radius_ratio",
                amount=radius - RADIUS_RATIO * pitch,
            )
    c = upper_radius + wheel_radius
    if eccentricity is not None:
        lower_radius = float(wheel_radius + np.hypot(c, eccentricity)) if lower_radius is None else lower_radius
        crescent = given_crescent(wheel_radius, upper_radius, lower_radius, eccentricity)
    elif lower_radius is None:
        crescent = critical_crescent(pitch, links, upper_radius, wheel_radius, work)
    else:
        a = lower_radius - wheel_radius
        if not a > c:
            raise FieldError(
                "/lower_radius",
                f"with the wheels at the height of the upper arc's centre it must exceed {wheel_radius + c:.6g}",
                constraint="tangency",
                amount=c - a,
            )
        crescent = given_crescent(wheel_radius, upper_radius, lower_radius, float(np.sqrt((a - c) * (a + c))))
    track = crescent.track
    middle = float(track.joints[UPPER_ARC] + 0.5 * track.length[UPPER_ARC])
    phase = None if start is None else start * wheel_radius
    chain = Chain(track, pitch, links)
    return crescent, find_slot(chain, middle, start=phase, place_field="/upper_radius", work=work)


def tightest_room(track: Track, pitch: float, driver: int) -> int:
    """The segment for the free pin: the tightest arc, other than the driver, that holds two links; else the roomiest.

    On a tight arc a little slack makes a shallow slot. On a straight run the slot is about sqrt(pitch * slack) deep,
    and its gain is without bound where the slack vanishes.
    """
    room = track.length / track.link_lengths(pitch)
    others = [index for index in range(track.count) if index != driver] or [driver]
    arcs = [index for index in others if track.curvature[index] != 0 and room[index] >= 2 - 1e-9]
    if arcs:
        return max(arcs, key=lambda index: (abs(track.curvature[index]), -index))
    return max(others, key=lambda index: (room[index], -index))


def driving_segment(track: Track, pitch: float) -> int:
    """The first segment that holds a link.

    Raises `FieldError`: there is none.
    """
    holds = np.flatnonzero(track.link_lengths(pitch) <= track.length)
    if not len(holds):
        raise FieldError("/pitch", "no segment of the track is long enough for one link", constraint="link_on_track")
    return int(holds[0])


def crescent_angles(crescent: Crescent, slot: Slot, pins: Pins) -> Floats:
    """theta1 .. thetaN, rad, shape (n, links): each pin's angle on the part of the crescent that it is on.

    On a wheel from the joint with the upper arc, over the top; on the arcs about their own centre from straight down, right
    positive; the free pin about the upper arc's centre.
    """
    r0, r1, r2 = crescent.wheel_radius, crescent.upper_radius, crescent.lower_radius
    turn = np.pi + crescent.xi + crescent.eps
    angles = np.empty(pins.along.shape)
    for part, start, rate in (
        (LEFT_WHEEL, 0.0, 1 / r0),
        (LOWER_ARC, -crescent.alpha, 1 / r2),
        (RIGHT_WHEEL, turn, -1 / r0),
        (UPPER_ARC, np.pi / 2 + crescent.eps, -1 / r1),
    ):
        on = pins.segment == part
        angles[on] = start + rate * pins.along[on]
    free = pins.points[:, slot.free - 1]
    angles[:, slot.free - 1] = np.arctan2(free.real, -free.imag)
    return angles
