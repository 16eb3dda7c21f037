"""The D-knotter's rope-holding disc, bill, jaw and needle: which spatial angles let the knot be tied.

The machine is data: chains of named turns, points, and three conditions for the general study of
`synthesis.scenes.knotter.study`. Equation numbers are those of Zhang, Feng, Dong, Zhang and Han, "Analysis of spatial angle
parameters of rope-holding disc and bill hook of D-knotter", Transactions of the Chinese Society for Agricultural
Machinery 49(8), 2018. Lengths in mm (or any one unit), angles in radians.

Frames: ``u3`` turns with the disc, ``seat`` is the disc's bearing (sigma2), ``shaft`` the machine's (sigma1), ``bearing``
the bill's (sigma0), ``u4`` turns with the bill, ``u5`` with the jaw, which is
hinged on the bill and opened by a cam (the source also calls it the hook).
The driver is the bill's angle alpha.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyder, polyroots, polyval

from synthesis.one_variable import Flags, Floats, bisect
from synthesis.scenes.knotter.conditions import Clearance, Condition, SegmentHitsTriangle, divisor
from synthesis.scenes.knotter.mechanism import DRIVER, Chain, Law, Linear, Mechanism, Shift, Table, Turn

Point = tuple[float, float, float]

PUBLISHED_LENGTHS: Mapping[str, float] = MappingProxyType(
    {"S1x": 22.0, "S1y": 39.0, "r0": 16.0, "D0": 20.0, "d6": 142.0, "r1": 30.0, "d5": 54.0}
)
"""Printed lengths in mm; the disc's starting angle beta0 is 15 degrees, alpha2 between the bill's axis k0 and k1 8 degrees."""
BETA0, ALPHA2 = float(np.radians(15.0)), float(np.radians(8.0))

ASSUMED_PARAMETERS: Mapping[str, float] = MappingProxyType({"d1": 136.0, "D": 20.0, "d9": 12.0, "d10": 24.5})
"""Lengths that the source does not give: fitted so that its published pattern comes out, and not unique."""
SENSES: Mapping[str, int] = MappingProxyType({"alpha": -1, "beta": -1})
"""Senses of alpha1 and alpha3 and of beta; the source's own are at odds with its results or not given."""
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
POINT_FRAMES: Mapping[str, str] = MappingProxyType(
    {"S0": "u3", "S1": "u4", "S3": "u4", "S4": "u4", "S5": "u4", "S7": "u4", "S8": "u5", "S9": "u4", "S10": "u5"}
)
PUBLISHED_POINTS = ("S3", "S4")
GRID_DEGREES: Mapping[str, tuple[float, ...]] = MappingProxyType(
    {"alpha1": (0.0, 10.0, 20.0), "alpha3": (20.0, 25.0, 30.0)}
)
WRAP_WINDOW = (0.0, float(np.radians(180.0)))
BITE_WINDOW = (float(np.radians(270.0)), float(np.radians(360.0)))
CLEARANCE_AT = float(np.radians(270.0))
CLEARANCE_OVER = (float(np.radians(240.0)), float(np.radians(300.0)))


def reference_laws() -> dict[str, Law]:
    """The assumed laws: the disc turns half as fast as the bill, the jaw closes within 67 degrees after 270."""
    return {
        "beta": Linear(float(np.radians(23.5)), 0.5),
        "alpha4": Table((CLEARANCE_AT, float(np.radians(337.0))), (float(np.radians(22.5)), 0.0)),
    }


def mechanism(
    parameters: Mapping[str, float | Floats] | None = None,
    senses: Mapping[str, int] | None = None,
    laws: Mapping[str, Law] | None = None,
    points: Mapping[str, Point] | None = None,
) -> Mechanism:
    """The knotter as a mechanism; what is not given has the published or else the assumed value.

    ``parameters``: ``alpha1, alpha2, alpha3`` (rad) and ``d1, D, d5, d6, d9, d10``. ``senses``: ``alpha`` and ``beta``,
    each 1 or -1. ``laws``: ``beta`` (disc) and ``alpha4`` (jaw) over the bill's angle. ``points``: coordinates, each in
    its frame of `POINT_FRAMES`.

    Eq 9 with its senses made explicit; the printed eq 17 is not its inverse (it turns the bill the wrong way), so the
    inverse is derived from this chain. Law: ``u3`` to ``u4`` and back is the identity.
    """
    sense = {**SENSES, **(senses or {})}
    chains = (
        Chain("u3", "seat", (Turn("j", "beta", sense["beta"]),)),
        Chain("seat", "shaft", (Shift(j="-D"), Turn("i", "alpha1", -sense["alpha"]), Shift(i="d5", k="-d1"))),
        Chain("shaft", "bearing", (Turn("i", "alpha3", -sense["alpha"]), Turn("j", "alpha2"), Shift(k="d6"))),
        Chain("bearing", "u4", (Turn("k", DRIVER),)),
        Chain("u5", "u4", (Turn("j", "alpha4"), Shift(i="-d9", k="-d10"))),  # eqs 22-24
    )
    place = {**POINTS, **(points or {})}
    return Mechanism(
        parameters={
            "alpha1": 0.0,
            "alpha2": ALPHA2,
            "alpha3": 0.0,
            "d5": PUBLISHED_LENGTHS["d5"],
            "d6": PUBLISHED_LENGTHS["d6"],
            **ASSUMED_PARAMETERS,
            **(parameters or {}),
        },
        laws={**reference_laws(), **(laws or {})},
        chains=chains,
        points={**{name: (POINT_FRAMES[name], at) for name, at in place.items()}, "O5": ("u5", (0.0, 0.0, 0.0))},
    )


def wrap(window: tuple[float, float] = WRAP_WINDOW) -> SegmentHitsTriangle:
    """The rope S0-S1 comes to lie on the bill: it first enters S3 S4 S5 through S3S4 (eqs 11-15)."""
    return SegmentHitsTriangle("wrap", ("S0", "S1"), ("S3", "S4", "S5"), "u4", window, enter=0)


def bite(window: tuple[float, float] = BITE_WINDOW) -> SegmentHitsTriangle:
    """The jaw catches the rope S0-S7: it first enters O5 S8 S9 through S8S9 (eqs 26-30)."""
    return SegmentHitsTriangle("bite", ("S0", "S7"), ("O5", "S8", "S9"), "u5", window, enter=1)


def clearance(
    at: float = CLEARANCE_AT,
    over: tuple[float, float] = CLEARANCE_OVER,
    radius: float = np.inf,
    jaw_locked: bool = True,
) -> Clearance:
    """The jaw's point S10 passes the disc on its free side (eq 18), over a range and not at one angle only."""
    return Clearance("clearance", "S10", "seat", 1, -1, at, over, radius, "alpha4" if jaw_locked else None)


def conditions() -> list[Condition]:
    """The three conditions of a knot with the source's ranges."""
    return [wrap(), clearance(), bite()]


@dataclass(frozen=True)
class Needle:
    """The needle beside the jaw's cam, over the angle alpha2 of the bill's axis.

    All angles alpha2 lie between -90 and 90 degrees, where ``cos alpha2`` is positive. There the clearance is concave
    wherever it is positive: it is positive on one interval or nowhere.
    """

    S1x: float = PUBLISHED_LENGTHS["S1x"]
    S1y: float = PUBLISHED_LENGTHS["S1y"]
    """Where the needle lays the rope, from the bill's axis along i4 and from o4 along k4."""
    r0: float = PUBLISHED_LENGTHS["r0"]
    D0: float = PUBLISHED_LENGTHS["D0"]
    """Largest radius of the jaw's cam and thickness of the needle, positive."""
    d6: float = PUBLISHED_LENGTHS["d6"]
    r1: float = PUBLISHED_LENGTHS["r1"]
    """From o1 to o0 along k0, and radius of the holding point S0 about the disc's axis."""
    beta0: float = BETA0
    """Initial phase of the disc, rad."""

    def clearance(self, alpha2: Floats | float) -> Any:
        """``L(alpha2)`` of eq 4, the least distance of needle and cam; the needle is free where it is positive."""
        return self.S1x * np.cos(alpha2) + self.S1y * np.sin(alpha2) - self.r0 / np.cos(alpha2) - self.D0 / 2

    def best(self) -> float:
        """The angle of the largest clearance.

        ``L' / cos alpha2 = S1y - S1x t - r0 t (1 + t^2)`` with ``t = tan alpha2``: the largest of at most three zeros.
        """
        cubic = np.array([self.S1y, -self.S1x - self.r0, 0.0, -self.r0])
        t = polyroots(cubic).real
        # A Newton step gives back the digits of roots far smaller than the others.
        t -= polyval(t, cubic) / divisor(polyval(t, polyder(cubic)))
        return float(max(np.arctan(t), key=self.clearance))

    def free_range(self) -> tuple[float, float] | None:
        """The angles between which the clearance is positive; None if it never is."""
        best = self.best()
        if not self.clearance(best) > 0:
            return None

        def free(alpha2: Floats) -> Flags:  # L without its poles at 90 degrees
            cosine, sine = np.cos(alpha2), np.sin(alpha2)
            return cosine * (self.S1x * cosine + self.S1y * sine - self.D0 / 2) > self.r0

        (low, high), _ = bisect(free, np.full(2, best, np.longdouble), np.array([-0.5, 0.5], np.longdouble) * np.pi)
        return float(low), float(high)

    def smallest_whole_degree(self) -> int | None:
        """The smallest whole number of degrees at which the clearance is positive; None if there is none."""
        free = self.free_range()
        if free is None:
            return None
        low, high = (float(np.degrees(end)) for end in free)
        candidates = range(max(-89, int(np.floor(low))), min(89, int(np.ceil(high))) + 1)
        return next((degree for degree in candidates if self.clearance(np.radians(degree)) > 0), None)

    def lay(self, alpha2: Floats | float) -> Any:
        """``d5`` at which the rope is laid on the disc (eq 5)."""
        return self.r1 * np.sin(self.beta0) + self.S1x * np.cos(alpha2) + (self.d6 + self.S1y) * np.sin(alpha2)

    def lay_slope(self, alpha2: Floats | float) -> Any:
        """``d d5 / d alpha2``; zero where an angle for a given d5 is ill-conditioned."""
        return (self.d6 + self.S1y) * np.cos(alpha2) - self.S1x * np.sin(alpha2)

    def angles_for_lay(self, d5: float) -> list[float]:
        """The angles between -90 and 90 degrees at which eq 5 gives ``d5``, increasing; none if it is out of reach.

        ``d5 - r1 sin beta0 = C cos(alpha2 - chi)``; the inverse cosine is taken as an arctangent of
        ``sqrt((C - m)(C + m))``, which keeps its digits where the two solutions meet.
        """
        height = self.d6 + self.S1y
        amplitude, chi = np.hypot(self.S1x, height), np.arctan2(height, self.S1x)
        m = d5 - self.r1 * np.sin(self.beta0)
        if abs(m) > amplitude or amplitude == 0:
            return []
        delta = np.arctan2(np.sqrt((amplitude - m) * (amplitude + m)), m)
        turned = [np.remainder(chi + sign * delta + np.pi, 2 * np.pi) - np.pi for sign in (-1, 1)]
        return sorted({float(angle) for angle in turned if abs(angle) < np.pi / 2})
