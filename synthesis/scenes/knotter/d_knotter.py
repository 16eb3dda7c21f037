"""The D-knotter: rope-holding disc, bill, jaw and needle, and the spatial angles at which the knot is tied.

Equation numbers refer to the source: Zhang, Feng, Dong, Zhang and Han, "Analysis of spatial angle parameters of
rope-holding disc and bill hook of D-knotter", Transactions of the Chinese Society for Agricultural Machinery 49(8), 2018.
Lengths are in mm (or in any other unit, used consistently), angles in radians. The frames are described in
`synthesis.scenes.knotter.mechanism`. The jaw, which the source also calls the hook, is hinged on the bill and opened by
a cam.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyder, polyroots, polyval

from synthesis.one_variable import Flags, Floats, bisect
from synthesis.scenes.knotter.conditions import Clearance, Condition, SegmentEntersTriangle
from synthesis.scenes.knotter.mechanism import Law, Linear, Mechanism, Table
from synthesis.scenes.knotter.segment_triangle import safe_divisor

Point = tuple[float, float, float]

PUBLISHED_D5, PUBLISHED_D6 = 54.0, 142.0
"""Lengths d5 and d6 printed in the source, mm."""
BETA0 = float(np.radians(15.0))
"""Published initial phase beta0 of the disc, 15 degrees."""
ALPHA2 = float(np.radians(8.0))
"""Published angle alpha2 between the bill's axis k0 and k1, 8 degrees."""
ASSUMED_PARAMETERS: Mapping[str, float] = MappingProxyType({"d1": 136.0, "D": 20.0, "d9": 12.0, "d10": 24.5})
"""Lengths (mm) that the source omits, fitted so that its published pattern is reproduced; they are not unique."""
SENSES: Mapping[str, int] = MappingProxyType({"alpha": -1, "beta": -1})
"""Assumed senses of rotation of alpha1 and alpha3, and of beta.
The printed sense of alpha1 and alpha3 contradicts the published results, and the sense of beta is not given."""
POINTS: Mapping[str, Point] = MappingProxyType(
    {
        "S0": (-30.0 * float(np.sin(BETA0)), 0.0, 30.0 * float(np.cos(BETA0))),
        "S1": (22.0, 14.0, -39.0),
        "S3": (0.0, 16.0, -12.0),
        "S4": (0.0, 8.0, -28.0),
        "S5": (0.0, 0.0, 0.0),
        "S7": (26.5, -5.5, -53.0),
        "S8": (40.0, 0.0, -27.0),
        "S9": (56.5, 0.0, -30.5),
        "S10": (59.0, 0.0, 31.5),
    }
)
"""Coordinates (mm) of the points, each in its frame of `POINT_FRAMES`."""
POINT_FRAMES: Mapping[str, str] = MappingProxyType(
    {"S0": "u3", "S1": "u4", "S3": "u4", "S4": "u4", "S5": "u4", "S7": "u4", "S8": "u5", "S9": "u4", "S10": "u5"}
)
"""Frame in which each point is fixed."""
PUBLISHED_POINTS = ("S3", "S4")
"""Points whose coordinates are published."""
GRID_DEGREES: Mapping[str, tuple[float, ...]] = MappingProxyType(
    {"alpha1": (0.0, 10.0, 20.0), "alpha3": (20.0, 25.0, 30.0)}
)
"""Spatial angles of the nine pairs that the source examines, degrees."""
WRAP_WINDOW = (0.0, float(np.radians(180.0)))
"""Range of the bill's angle in which the rope is wrapped, rad."""
BITE_WINDOW = (float(np.radians(270.0)), float(np.radians(360.0)))
"""Range of the bill's angle in which the jaw bites the rope, rad."""
CLEARANCE_AT = float(np.radians(270.0))
"""Bill's angle at which the source checks the clearance, rad."""
CLEARANCE_OVER = (float(np.radians(240.0)), float(np.radians(300.0)))
"""Range of the bill's angle in which the clearance is checked here, rad."""


def mechanism(
    parameters: Mapping[str, float | Floats] | None = None,
    senses: Mapping[str, int] | None = None,
    laws: Mapping[str, Law] | None = None,
    points: Mapping[str, Point] | None = None,
) -> Mechanism:
    """Build the knotter; every omitted value has its published or else its assumed value.

    By the assumed laws the disc turns half as fast as the bill, and the jaw closes while the bill turns from 270 to 337
    degrees. The printed eq 17 is not the inverse of eq 9, because it turns the bill in the wrong sense; the inverse is
    therefore derived from the steps of eq 9.

    Parameters
    ----------
    parameters : mapping, optional
        Angles ``alpha1, alpha2, alpha3`` (rad) and lengths ``d1, D, d5, d6, d9, d10``.
    senses : mapping, optional
        Senses ``alpha`` and ``beta``, each 1 or -1.
    laws : mapping, optional
        Laws ``beta`` (disc) and ``alpha4`` (jaw) over the bill's angle.
    points : mapping, optional
        Coordinates, each in its frame of `POINT_FRAMES`.
    """
    published = {"alpha1": 0.0, "alpha2": ALPHA2, "alpha3": 0.0, "d5": PUBLISHED_D5, "d6": PUBLISHED_D6}
    assumed_laws: dict[str, Law] = {
        "beta": Linear(float(np.radians(23.5)), 0.5),
        "alpha4": Table((CLEARANCE_AT, float(np.radians(337.0))), (float(np.radians(22.5)), 0.0)),
    }
    coordinates = {**POINTS, **(points or {})}
    return Mechanism(
        {**published, **ASSUMED_PARAMETERS, **(parameters or {})},
        {**SENSES, **(senses or {})},
        {**assumed_laws, **(laws or {})},
        {name: (POINT_FRAMES[name], xyz) for name, xyz in coordinates.items()} | {"O5": ("u5", (0.0, 0.0, 0.0))},
    )


def wrap(window: tuple[float, float] = WRAP_WINDOW) -> SegmentEntersTriangle:
    """Return the condition that the rope wraps around the bill (eqs 11-15) in a range of the bill's angle, rad.

    The rope S0-S1 must first enter the triangle S3 S4 S5 through the edge S3S4.
    """
    return SegmentEntersTriangle("wrap", ("S0", "S1"), ("S3", "S4", "S5"), {"u3", "u4"}, "u4", window, 0)


def bite(window: tuple[float, float] = BITE_WINDOW) -> SegmentEntersTriangle:
    """Return the condition that the jaw bites the rope (eqs 26-30) in a range of the bill's angle, rad.

    The rope S0-S7 must first enter the triangle O5 S8 S9 through the edge S8S9.
    """
    return SegmentEntersTriangle("bite", ("S0", "S7"), ("O5", "S8", "S9"), {"u3", "u4", "u5"}, "u5", window, 1)


def conditions() -> list[Condition]:
    """Return the three conditions of a knot with their default ranges: wrap, clearance and bite."""
    return [wrap(), Clearance(CLEARANCE_AT, CLEARANCE_OVER), bite()]


@dataclass(frozen=True)
class Needle:
    """The needle next to the jaw's cam, as functions of the angle alpha2 of the bill's axis.

    All angles alpha2 lie between -90 and 90 degrees, where ``cos alpha2`` is positive.
    There the clearance is concave wherever it is positive, and therefore positive in a single interval or nowhere.
    """

    S1x: float = 22.0
    """Distance along i4 from the bill's axis to the point where the needle lays the rope."""
    S1y: float = 39.0
    """Distance along k4 from o4 to the point where the needle lays the rope."""
    r0: float = 16.0
    """Largest radius of the jaw's cam, positive."""
    D0: float = 20.0
    """Thickness of the needle, positive."""
    d6: float = PUBLISHED_D6
    """Distance from o1 to o0 along k0."""
    r1: float = 30.0
    """Radius of the holding point S0 about the disc's axis."""
    beta0: float = BETA0
    """Initial phase of the disc, rad."""

    def clearance(self, alpha2: Floats | float) -> Any:
        """Return ``L(alpha2)`` of eq 4, the smallest distance between needle and cam; positive if the needle is free."""
        return self.S1x * np.cos(alpha2) + self.S1y * np.sin(alpha2) - self.r0 / np.cos(alpha2) - self.D0 / 2

    def best_angle(self) -> float:
        """Return the angle alpha2 (rad) of the largest clearance.

        With ``t = tan alpha2``, the derivative of eq 4 is ``L' / cos alpha2 = S1y - S1x t - r0 t (1 + t^2)``.
        The largest clearance is at one of its at most three zeros.
        """
        cubic = np.array([self.S1y, -self.S1x - self.r0, 0.0, -self.r0])
        t = polyroots(cubic).real
        # A Newton step restores the digits of roots that are far smaller than the others.
        t -= polyval(t, cubic) / safe_divisor(polyval(t, polyder(cubic)))
        return float(max(np.arctan(t), key=self.clearance))

    def free_range(self) -> tuple[float, float] | None:
        """Return the angles alpha2 (rad) between which the clearance is positive, or None if it never is."""
        best = self.best_angle()
        if not self.clearance(best) > 0:
            return None

        def is_free(alpha2: Floats) -> Flags:  # eq 4 times cos(alpha2), which has no poles at 90 degrees
            cosine, sine = np.cos(alpha2), np.sin(alpha2)
            return cosine * (self.S1x * cosine + self.S1y * sine - self.D0 / 2) > self.r0

        (low, high), _ = bisect(is_free, np.full(2, best), np.array([-0.5, 0.5]) * np.pi)
        return float(low), float(high)

    def smallest_whole_degree(self) -> int | None:
        """Return the smallest whole number of degrees at which the clearance is positive, or None."""
        low, high = np.degrees(self.free_range() or (np.nan, np.nan))
        first = np.floor(low) + 1
        return int(first) if first < high else None

    def d5(self, alpha2: Floats | float) -> Any:
        """Return the length ``d5`` at which the rope is laid on the disc (eq 5)."""
        return self.r1 * np.sin(self.beta0) + self.S1x * np.cos(alpha2) + (self.d6 + self.S1y) * np.sin(alpha2)

    def angles_for_d5(self, d5: float) -> list[float]:
        """Return the angles alpha2 (rad), increasing, at which eq 5 gives a length ``d5``; empty if there are none.

        Eq 5 is ``d5 - r1 sin beta0 = C cos(alpha2 - chi)``.
        The inverse cosine is computed as an arctangent of ``sqrt((C - m)(C + m))``, which keeps its digits where the two
        solutions meet.
        """
        height = self.d6 + self.S1y
        amplitude, chi = np.hypot(self.S1x, height), np.arctan2(height, self.S1x)
        m = d5 - self.r1 * np.sin(self.beta0)
        if abs(m) > amplitude or amplitude == 0:
            return []
        delta = np.arctan2(np.sqrt((amplitude - m) * (amplitude + m)), m)
        angles = [np.remainder(chi + sign * delta + np.pi, 2 * np.pi) - np.pi for sign in (-1, 1)]
        return sorted({float(angle) for angle in angles if abs(angle) < np.pi / 2})
