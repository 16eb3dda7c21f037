"""The crescent of two arcs and two wheels on which a chain runs, and the size at which the chain closes.

Source: Li, Hong, "Realization of compensation trajectory for constrained chain with U-type slide based on MATLAB",
Heavy Machinery 2014-5. The upper arc (radius R1) is centred on the origin and the lower arc (R2) on (0, b). The
wheels (R0) touch the upper arc from outside and the lower arc from inside. Lengths are in the user's unit and angles
in radians.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synthesis.errors import FieldError
from synthesis.one_variable import rising_root, secant
from synthesis.scenes.chain.closure import STRETCH_TOLERANCE, Chain, closing_links, closure_error
from synthesis.scenes.chain.track import Arc, Track
from synthesis.work import UNLIMITED, Work

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
        r0, r1, r2, xi, eps = self.wheel_radius, self.upper_radius, self.lower_radius, self.xi, self.eps
        centre = (r1 + r0) * np.exp(1j * eps)
        turn = np.pi + xi + eps

        def segment(side: int, angle: float, curvature: float, sweep: float) -> Arc:
            """Return a segment that starts at an angle of the left (-1) or right (1) wheel."""
            start = complex(side * centre.real, centre.imag) + r0 * np.exp(1j * angle)
            return Arc(start.real, start.imag, angle + np.pi / 2, curvature, sweep / abs(curvature))

        return Track(
            [
                segment(-1, -eps, 1 / r0, turn),
                segment(-1, np.pi + xi, 1 / r2, 2 * self.alpha),
                segment(1, -xi, 1 / r0, turn),
                segment(1, np.pi + eps, -1 / r1, np.pi + 2 * eps),
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
    """Return the crescent for given R0, R1, R2 and b, whose joints are exactly tangent.

    Raises
    ------
    FieldError
        The triangle of the centres with the sides a, b, c does not exist, or the wheels overlap.
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
    pitch: float, links: int, upper_radius: float, wheel_radius: float, work: Work = UNLIMITED
) -> Crescent:
    """Return the level crescent on which the chain just closes: it fits exactly at one phase and is never stretched.

    Its lower radius is the largest value that any phase requires. The source assumes the critical phase theta1m; here
    it is found.

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

    Raises
    ------
    FieldError
        The chain closes on no crescent with these radii. The error contains the nearest number of links and the
        missing or excess length.
    """
    where = "on any lower radius"

    def track(alpha: float) -> Track:
        return level_crescent(wheel_radius, upper_radius, alpha).track

    def overrun(alpha: float, links: int = links) -> float:
        work.go_on()
        return Chain(track(alpha), pitch, links).smallest_overrun().value

    longest, shortest = np.pi / 2, FLATTEST
    at_longest, at_shortest = overrun(longest), overrun(shortest)
    if at_shortest < 0:
        raise closure_error(links, closing_links(track(shortest), pitch, work), -at_shortest, where)
    if at_longest > 0:
        nearest = closing_links(track(longest), pitch, work)
        # with `nearest` links the longest track is slack, unless it fits exactly; a link less closes on a shorter track
        fits_exactly = abs(overrun(longest, nearest)) <= STRETCH_TOLERANCE * pitch
        raise closure_error(links, nearest if fits_exactly else nearest - 1, -at_longest, where)
    # the overrun rises with the negative angle
    rising = secant(lambda x: np.array([overrun(-x[0])]), -longest, at_longest)
    guess = -longest + (longest - shortest) * at_longest / (at_longest - at_shortest)
    return level_crescent(wheel_radius, upper_radius, -float(rising_root(rising, -longest, -shortest, [guess])[0]))


class Dimensions(NamedTuple):
    """Dimensions of a chain and its crescent; missing dimensions follow from the others.

    If lower radius and eccentricity are both given, the layout is used unchanged. If one is given, the other follows from wheel
    centres level with the centre of the upper arc. If neither is given, both follow from the critical closure.
    """

    pitch: float
    """Length of a link."""
    links: int
    """Number of links."""
    upper_radius: float
    """R1."""
    wheel_radius: float | None = None
    """R0; None: pitch/sqrt(2), with four pins per turn."""
    lower_radius: float | None = None
    """R2."""
    eccentricity: float | None = None
    """b."""


def crescent_for(dimensions: Dimensions, work: Work = UNLIMITED) -> Crescent:
    """Return the crescent of some dimensions.

    Raise a `FieldError` if there is none. ``work`` is called between the steps.
    """
    pitch, links, upper_radius, wheel_radius, lower_radius, eccentricity = dimensions
    wheel_radius = float(pitch / np.sqrt(2)) if wheel_radius is None else wheel_radius
    radii = {"upper_radius": upper_radius, "wheel_radius": wheel_radius, "lower_radius": lower_radius}
    for name, radius in radii.items():
        if radius is not None:
            _check_radius(f"/{name}", radius, pitch)
    c = upper_radius + wheel_radius
    if eccentricity is not None:
        lower_radius = float(wheel_radius + np.hypot(c, eccentricity)) if lower_radius is None else lower_radius
        return given_crescent(wheel_radius, upper_radius, lower_radius, eccentricity)
    if lower_radius is None:
        return critical_crescent(pitch, links, upper_radius, wheel_radius, work)
    a = lower_radius - wheel_radius
    if not a > c:
        raise FieldError(
            "/lower_radius",
            f"the radius must be more than {wheel_radius + c:.6g} if the wheel centres are level with the centre of "
            "the upper arc",
            constraint="tangency",
            amount=c - a,
        )
    return given_crescent(wheel_radius, upper_radius, lower_radius, float(np.sqrt((a - c) * (a + c))))


def _check_radius(field: str, radius: float, pitch: float) -> None:
    """Raise a `FieldError` for a radius that is too small or too large for the pitch."""
    if not pitch < 2 * radius * (1 - 1e-9):
        raise FieldError(
            field,
            f"a link does not fit on an arc of radius {radius:.6g}; the radius must be more than {pitch / 2:.6g}",
            constraint="link_on_arc",
            amount=pitch / 2 - radius,
        )
    if radius > RADIUS_RATIO * pitch:
        raise FieldError(
            field,
            f"the radius must be at most {RADIUS_RATIO:.0e} pitches; found {radius / pitch:.6g}",
            constraint="radius_ratio",
            amount=radius - RADIUS_RATIO * pitch,
        )
