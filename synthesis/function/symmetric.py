"""Symmetric four-bars for functions: steering linkages, whose left and right arm are mirror images.

Input and output are measured from the position in which the linkage is its own mirror image, an isosceles trapezoid.
With the arm a over the ground and the angle t of the left arm there, the coupler is 1 - 2 a cos(t), and the right arm
has the angle 180 - t. The only unknowns are the arm and the zero, which is t and the input at the first sample.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from synthesis.arrays import Floats
from synthesis.function.laws import FOUR_BAR, FourBarLaw, FunctionLimits, OutputCurve
from synthesis.function.target_function import TargetFunction
from synthesis.limits import Limits


@dataclass(frozen=True)
class SymmetricOptions:
    """Options of symmetric four-bars."""

    arm_min: float = 0.1
    """Shortest arm over the ground if no limit is smaller; in shorter arms the play of the pins turns a wheel considerably.
    """
    arm_max: float = 0.2
    """Longest arm over the ground if no limit is larger; longer arms need much room and reduce the error only slightly.
    """


OPTIONS = SymmetricOptions()


@dataclass(frozen=True, eq=False)
class SymmetricLaw(FourBarLaw):
    """Angle of the right arm, less 180 degrees - t, so that the offset is known."""

    first: float = 0.0
    """Input at the first sample, from the symmetric position."""

    def logarithms(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Return the logarithms of the lengths (n, 3), and their derivatives by the first four unknowns, (n, 3, 4)."""
        arm, angle = np.exp(unknowns[:, 0]), unknowns[:, 3] - self.first
        slopes, coupler = np.zeros((len(arm), 3, 4)), 1 - 2 * arm * np.cos(angle)
        slopes[:, 0, 0] = slopes[:, 1, 0] = 1.0
        with np.errstate(invalid="ignore", divide="ignore"):
            slopes[:, 2, 0], slopes[:, 2, 3] = (coupler - 1) / coupler, 2 * arm * np.sin(angle) / coupler
            return np.column_stack([unknowns[:, 0], unknowns[:, 0], np.log(coupler)]), slopes

    def side(self, unknowns: Floats) -> Floats:
        """Return the branches (n,) of trapezoids, which are not crossed."""
        return np.where(np.sin(unknowns[:, 3] - self.first) > 0, 1.0, -1.0)

    def at(self, unknowns: Floats, branch: Floats, travel: Floats, derivatives: bool = True) -> OutputCurve:
        """Return the output at inputs (n, M) from the first sample."""
        found = super().at(unknowns, self.side(unknowns), travel, derivatives)
        if derivatives:
            found.slope[:, 3] += 1.0
        return found._replace(value=found.value + (unknowns[:, 3:4] - self.first))

    def plain(self, unknowns: Floats, branch: Floats) -> tuple[FourBarLaw, Floats, Floats]:
        """Return the lengths (n, 3) and branches (n,) of four-bars."""
        return FOUR_BAR, np.exp(self.logarithms(unknowns)[0]), self.side(unknowns)

    def bounds(self, limits: Limits, largest: bool) -> tuple[float, float]:
        """Return the shortest and the longest arm over the ground."""
        ratio = limits.link_ratio_max  # a limit that the usual range of arms satisfies does not widen the range
        tight = ratio is not None and ratio * OPTIONS.arm_max < 1 + 2 * OPTIONS.arm_max
        bounded = limits.link_min is not None or limits.link_max is not None or tight
        return limits.link_min or OPTIONS.arm_min, limits.link_max or (1.0 if bounded else OPTIONS.arm_max)


def symmetric_question(
    target: TargetFunction, first: tuple[float, float], limits: Limits
) -> tuple[TargetFunction, SymmetricLaw, FunctionLimits]:
    """Return the function, law and limits of symmetric four-bars; ``first``: input and output at the first sample."""
    law = SymmetricLaw(FOUR_BAR.kind, FOUR_BAR.driver, FOUR_BAR.output, ("arm",), (1,), first[0])
    four_bars = FunctionLimits.of_four_bar(limits)
    given = [length for length in (limits.links[0], limits.links[2]) if length is not None][:1]
    prescribed = {name: length for length in given for name in ("arm", "crank", "rocker")}
    offset = float(target.output[0]) - first[1] - np.pi
    return replace(target, offset=offset), law, replace(four_bars, prescribed=prescribed)
