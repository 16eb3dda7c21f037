"""The chain on a U-shaped slide: a crescent of two arcs and two wheels, and the size at which the chain closes.

Source: Li, Hong, "Realization of compensation trajectory for constrained chain with U-type slide based on MATLAB",
Heavy Machinery 2014-5. The upper arc (radius R1) is centred on the origin and the lower arc (R2) on (0, b). The
wheels (R0) touch the upper arc from outside and the lower arc from inside. Lengths are in the user's unit and angles
in radians.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synthesis.errors import FieldError
from synthesis.one_variable import Floats
from synthesis.scenes.chain.closure import Chain, critical_parameter
from synthesis.scenes.chain.slot import Pins, Slot, find_slot
from synthesis.scenes.chain.track import Segment, Track, arc, check_link_fits
from synthesis.work import Work

FLATTEST = 1e-6
"""Half sweep of the lower arc, in radians, of the flattest crescent in the search, whose lower run is almost
straight."""
RADIUS_RATIO = 1e6
"""Largest radius in pitches."""

LEFT_WHEEL, LOWER_ARC, RIGHT_WHEEL, UPPER_ARC = range(4)
"""Indices of the crescent's segments in the direction of travel, counter-clockwise."""


@dataclass(frozen=True)
class Crescent:
    """Track of the source. All four joints are tangent for any radii and any eccentricity whose triangle exists."""

    wheel_radius: float
    """R0."""
    upper_radius: float
    """R1."""
    lower_radius: float
    """R2."""
    eccentricity: float
    """b, the height of the lower arc's centre above the centre of the upper arc."""
    alpha: float
    """Half sweep of the lower arc."""
    eps: float
    """Polar angle of the right wheel's centre about the origin; 0 in the intended layout."""

    @property
    def xi(self) -> float:
        """Return the angle below the horizontal at which wheel and lower arc touch; atan(b/c) for eps = 0."""
        return np.pi / 2 - self.alpha

    @property
    def tangency_residual(self) -> float:
        """Return hypot(c, b) - a, which is 0 if the wheel centres are level with the centre of the upper arc."""
        c, a = self.upper_radius + self.wheel_radius, self.lower_radius - self.wheel_radius
        return float(np.hypot(c, self.eccentricity) - a)

    @property
    def track(self) -> Track:
        """Return the closed path from the upper left joint: left wheel, lower arc, right wheel, upper arc.

        Every segment starts on a wheel, so that a large radius does not appear in a coordinate.
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
        """Return the angles of one link on the wheel, the upper and the lower arc: dq, du, dd = 2 asin(L/2R)."""
        radii = (self.wheel_radius, self.upper_radius, self.lower_radius)
        wheel, upper, lower = (2 * float(np.arcsin(pitch / (2 * radius))) for radius in radii)
        return wheel, upper, lower


def level_crescent(wheel_radius: float, upper_radius: float, alpha: float) -> Crescent:
    """Return the crescent whose wheel centres are level with the centre of the upper arc: a^2 = c^2 + b^2, tan xi = b/c.

    Parameters
    ----------
    wheel_radius, upper_radius : float
        R0 and R1.
    alpha : float
        Half sweep of the lower arc.
    """
    c = wheel_radius + upper_radius
    lower_radius = wheel_radius + c / np.sin(alpha)
    return Crescent(wheel_radius, upper_radius, float(lower_radius), float(c * np.tan(np.pi / 2 - alpha)), alpha, 0.0)


def given_crescent(wheel_radius: float, upper_radius: float, lower_radius: float, eccentricity: float) -> Crescent:
    """Return the crescent for four given lengths.

    The triangle of the centres is solved, so that the joints are exactly tangent.

    Parameters
    ----------
    wheel_radius, upper_radius, lower_radius, eccentricity : float
        R0, R1, R2 and b.

    Returns
    -------
    Crescent

    Raises
    ------
    FieldError
        The triangle with the sides a, b, c does not exist, or the wheels overlap.
    """
    c, a, b = upper_radius + wheel_radius, lower_radius - wheel_radius, eccentricity
    if not (a > 0 and abs(c - b) < a < c + b):
        lower_min, lower_max = wheel_radius + abs(c - b), wheel_radius + c + b
        raise FieldError(
            "/lower_radius",
            f"the wheels cannot touch both arcs: with this eccentricity the radius must lie between {lower_min:.6g} "
            f"and {lower_max:.6g}",
            constraint="tangency",
            amount=lower_min - lower_radius if lower_radius <= lower_min else lower_radius - lower_max,
        )
    # cy = (c^2 + b^2 - a^2)/(2b), with the difference formed from the two lengths that are closest to each other
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
    """Return the level crescent on which the chain just closes: it fits exactly at one phase and is never stretched.

    Its lower radius is the largest value that any phase requires (at theta1m in the source).

    Parameters
    ----------
    pitch : float
        Length of a link.
    links : int
        Number of links.
    upper_radius, wheel_radius : float
        R1 and R0.
    work : Work, optional
        Called between the steps to check whether the result is still wanted.

    Returns
    -------
    Crescent

    Raises
    ------
    FieldError
        The chain closes on no crescent with these radii. The error contains the nearest number of links and the
        missing or excess length.
    """

    def family(alpha: float) -> Crescent:
        return level_crescent(wheel_radius, upper_radius, alpha)

    family_name = "on any lower radius"
    return family(
        critical_parameter(lambda alpha: family(alpha).track, pitch, links, np.pi / 2, FLATTEST, family_name, work)
    )


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
    """Compute the crescent and its slot, below the middle of the upper arc.

    Parameters
    ----------
    pitch : float
        Length of a link.
    links : int
        Number of links.
    upper_radius : float
        R1.
    wheel_radius : float, optional
        R0. By default pitch/sqrt(2), with four pins per turn.
    lower_radius, eccentricity : float, optional
        R2 and b. If both are given, the layout is used unchanged. If one is given, the other follows from wheel
        centres level with the centre of the upper arc. If neither is given, both follow from the critical closure.
    start : float, optional
        Angle of P1 on the left wheel at the start of the window. By default, the phase with the smallest slack.
    work : Work, optional
        Called between the steps to check whether the result is still wanted.

    Returns
    -------
    Crescent, Slot

    Raises
    ------
    FieldError
        There is no such crescent, or the chain would be stretched or does not close on it.
    """
    wheel_radius = float(pitch / np.sqrt(2)) if wheel_radius is None else wheel_radius
    radii = {"upper_radius": upper_radius, "wheel_radius": wheel_radius, "lower_radius": lower_radius}
    for name, radius in radii.items():
        if radius is not None:
            _check_radius(name, radius, pitch)
    if lower_radius is None and eccentricity is None:
        crescent = critical_crescent(pitch, links, upper_radius, wheel_radius, work)
    else:
        crescent = _sized_crescent(wheel_radius, upper_radius, lower_radius, eccentricity)
    track = crescent.track
    middle = float(track.joints[UPPER_ARC] + 0.5 * track.length[UPPER_ARC])
    phase = None if start is None else start * wheel_radius
    chain = Chain(track, pitch, links)
    return crescent, find_slot(chain, middle, phase, work)


def _check_radius(name: str, radius: float, pitch: float) -> None:
    """Raise a `FieldError` for a radius that is too small or too large for the pitch."""
    check_link_fits(f"/{name}", pitch, radius)
    if radius > RADIUS_RATIO * pitch:
        raise FieldError(
            f"/{name}",
            f"the radius must be at most {RADIUS_RATIO:.0e} pitches; found {radius / pitch:.6g}",
            constraint="radius_ratio",
            amount=radius - RADIUS_RATIO * pitch,
        )


def _sized_crescent(
    wheel_radius: float, upper_radius: float, lower_radius: float | None, eccentricity: float | None
) -> Crescent:
    """Return the crescent for a given lower radius, a given eccentricity, or both."""
    c = upper_radius + wheel_radius
    if lower_radius is not None and eccentricity is None:
        a = lower_radius - wheel_radius
        if not a > c:
            raise FieldError(
                "/lower_radius",
                f"the radius must be more than {wheel_radius + c:.6g} if the wheel centres are level with the centre of "
                "the upper arc",
                constraint="tangency",
                amount=c - a,
            )
        eccentricity = float(np.sqrt((a - c) * (a + c)))
    assert eccentricity is not None
    lower_radius = float(wheel_radius + np.hypot(c, eccentricity)) if lower_radius is None else lower_radius
    return given_crescent(wheel_radius, upper_radius, lower_radius, eccentricity)


def crescent_angles(crescent: Crescent, slot: Slot, pins: Pins) -> Floats:
    """Compute the angle of each pin on its part of the crescent.

    On a wheel, the angle is measured from the joint with the upper arc, over the top. On an arc, it is measured about
    the centre of the arc from straight down, positive to the right; the free pin uses the centre of the upper arc.

    Parameters
    ----------
    crescent : Crescent
    slot : Slot
    pins : Pins

    Returns
    -------
    ndarray, shape (n, links)
        theta1 .. thetaN in radians.
    """
    r0, r1, r2 = crescent.wheel_radius, crescent.upper_radius, crescent.lower_radius
    turn = np.pi + crescent.xi + crescent.eps
    angles = np.empty(pins.along.shape)
    for segment, start, rate in (
        (LEFT_WHEEL, 0.0, 1 / r0),
        (LOWER_ARC, -crescent.alpha, 1 / r2),
        (RIGHT_WHEEL, turn, -1 / r0),
        (UPPER_ARC, np.pi / 2 + crescent.eps, -1 / r1),
    ):
        is_on = pins.segment == segment
        angles[is_on] = start + rate * pins.along[is_on]
    free = pins.points[:, slot.free - 1]
    angles[:, slot.free - 1] = np.arctan2(free.real, -free.imag)
    return angles
