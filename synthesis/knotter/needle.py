"""The needle that lays the rope on the bill: its distance from the jaw's cam (eq 4) and the length d5 (eq 5) over alpha2.

Equation numbers are those of `synthesis.knotter.d_knotter`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyder, polyroots, polyval

from synthesis.knotter.d_knotter import BETA0, PUBLISHED_LENGTHS
from synthesis.knotter.segment_triangle import divisor
from synthesis.one_variable import Flags, Floats, bisect


@dataclass(frozen=True)
class Needle:
    """The needle beside the jaw's cam, over the angle alpha2 of the bill's axis.

    Parameters
    ----------
    S1x, S1y : float
        Where the needle lays the rope, from the bill's axis along i4 and from o4 along k4.
    r0, D0 : float
        Largest radius of the jaw's cam and thickness of the needle, positive.
    d6, r1 : float
        From o1 to the plane i0 o0 k0, and radius of the holding point S0 about the disc's axis.
    beta0 : float
        Initial phase of the disc, rad.

    Notes
    -----
    All angles alpha2 lie between -90 and 90 degrees, where ``cos alpha2`` is positive. There the clearance is concave
    wherever it is positive: it is positive on one interval or nowhere.
    """

    S1x: float = PUBLISHED_LENGTHS["S1x"]
    S1y: float = PUBLISHED_LENGTHS["S1y"]
    r0: float = PUBLISHED_LENGTHS["r0"]
    D0: float = PUBLISHED_LENGTHS["D0"]
    d6: float = PUBLISHED_LENGTHS["d6"]
    r1: float = PUBLISHED_LENGTHS["r1"]
    beta0: float = BETA0

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
