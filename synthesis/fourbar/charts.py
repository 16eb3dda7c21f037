"""Coordinates of a four-bar's shape for a search: without bounds, or with change points at bounds.

Each chart maps its unknowns to four lengths (their common scale is free, the pose takes it up) and to the two constants
X0, Y0 of the closure (see `kinematics`), formed without cancellation; both are computed by `kernel.Shape`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from synthesis import kernel
from synthesis.arrays import Floats
from synthesis.fourbar.kinematics import grashof_excesses
from synthesis.mechanism import Chart

_FAR = (-8.0, -5.0, -2.5, 2.5, 5.0, 8.0)


class FourBarChart(Chart):
    """What charts of the four-bar without bounds share."""

    cell = np.array([0.7, 1.0, 1.0, 0.6])
    hop = np.array([0.7, 1.5, 1.5, 0.4])

    def place(self, unknowns: Floats) -> Floats:
        """Where shapes lie: logarithms of length ratios, (n, 3)."""
        lengths = self.shape(unknowns).lengths
        return np.log(lengths[:, :3] / lengths[:, 3:]) / 0.7


@dataclass(frozen=True)
class FullCrankChart(FourBarChart):
    """All four-bars whose crank turns fully, each once: R^3 less the plane p = 0, which only L1 = L4, L2 = L3 touches.

    With L1 + L4 = 1: p = ln(L1 / L4), L2 + L3 = 1 + e^u, L2 - L3 = |L4 - L1| tanh w. Crank-rockers have p < 0, double-cranks
    p > 0; change points lie at infinity. X0 = e^u (2 + e^u) and Y0 = (L4 - L1)^2 / cosh^2 w are positive everywhere.
    Law: ``unknowns(shape(x).lengths) == x`` for moderate x.

    Attributes
    ----------
    sheet : int
        -1: only linkages with L1 < L4, crank-rockers; +1: only L1 > L4, double-cranks; 0: both.
    """

    sheet: int = 0

    kind = kernel.FULL_CRANK
    edges = np.array(list(product(_FAR, (-8.0, -4.0, -2.0, -0.5, 0.5, 2.0, 4.0), _FAR)))
    """Near one change point or two."""
    LIMITS = np.array([16.0, 30.0, 17.0])
    """Largest |p|, |u|, |w|: beyond, the lengths no longer change in double precision."""

    def unknowns(self, lengths: ArrayLike) -> Floats:
        """Unknowns (n, 3) of lengths (n, 4)."""
        lengths = np.asarray(lengths, dtype=float)
        l1, l4 = lengths[..., 0], lengths[..., 3]
        a, b, c = grashof_excesses(lengths)
        total = l1 + l4
        with np.errstate(divide="ignore", invalid="ignore"):
            x = np.stack([np.log(l1 / l4), np.log(c / total), 0.5 * np.log(np.abs(a / b))], axis=-1)
        # (gap + d) / (gap - d) is a / b for crank-rockers and b / a for double-cranks
        x[..., 2] *= np.where(l1 > l4, -1.0, 1.0)
        return np.clip(np.nan_to_num(x), -self.LIMITS, self.LIMITS)


@dataclass(frozen=True)
class AnyChart(FourBarChart):
    """All four-bars: the logarithms of L1 / L4, L2 / L4, L3 / L4. Most points close over a part of the turn only."""

    kind = kernel.ANY

    def unknowns(self, lengths: ArrayLike) -> Floats:
        """Unknowns (n, 3) of lengths (n, 4)."""
        lengths = np.asarray(lengths, dtype=float)
        return np.log(lengths[..., :3] / lengths[..., 3:])


@dataclass(frozen=True)
class GrashofChart(Chart):
    """All four-bars whose crank turns fully, by homogeneous unknowns (l, x, y, z), x, y, z >= 0.

    |l| is the shortest link, the crank where l > 0 (crank-rocker) and the ground where l < 0 (double-crank);
    L2 = |l| + (x + y) / 2, L3 = |l| + (x + z) / 2, and the fourth length is |l| + (y + z) / 2. Then
    X0 = x (4 |l| + x + y + z) and Y0 = y z, without cancellation. The common scale is free: `within` makes
    the sum of magnitudes one.
    Law: ``unknowns(shape(x).lengths) == within(x)``.
    """

    LEAST = 1e-9
    """Least magnitude of an unknown: at change points the slope of theta2 has no limit."""

    cell = np.append(np.full(4, 0.1), FourBarChart.cell[3])
    hop = np.array([0.4, 0.8, 0.8, 0.8, 0.3])
    """Of the logarithms of the magnitudes, and of the start."""
    kind = kernel.GRASHOF

    def unknowns(self, lengths: ArrayLike) -> Floats:
        """Unknowns (n, 4) of lengths (n, 4)."""
        lengths = np.asarray(lengths, dtype=float)
        a, b, c = grashof_excesses(lengths)
        rocker = lengths[..., 0] < lengths[..., 3]
        out = np.stack(
            [
                np.where(rocker, lengths[..., 0], -lengths[..., 3]),
                c,
                np.where(rocker, a, -b),
                np.where(rocker, b, -a),
            ],
            axis=-1,
        )
        return self.within(out)

    def within(self, unknowns: Floats) -> Floats:
        """The nearest unknowns within the bounds, each of its own sign of l, and of scale one."""
        unknowns = unknowns / np.sum(np.abs(unknowns), axis=-1, keepdims=True)
        out = np.maximum(unknowns, self.LEAST)
        out[..., 0] = np.copysign(np.maximum(np.abs(unknowns[..., 0]), self.LEAST), unknowns[..., 0])
        return out

    def hopped(self, unknowns: Floats, noise: Floats) -> Floats:
        """Unknowns whose logarithms moved by noise (n, 4); excesses at a bound are lifted off it first."""
        side = np.sign(unknowns)
        return self.within(side * np.maximum(np.abs(unknowns), 1e-4) * np.exp(np.clip(noise, -8.0, 8.0)))

    def place(self, unknowns: Floats) -> Floats:
        """Where shapes lie, whatever their scale: the family, and logarithms of ratios of the unknowns, (n, 4)."""
        size = np.log(np.maximum(np.abs(unknowns), 1e-5 * np.sum(np.abs(unknowns), axis=1, keepdims=True)))
        ratios = size[:, :3] - size[:, 3:]
        return np.hstack([2 * np.sign(unknowns[:, :1]), ratios / [0.7, 1.0, 1.0]])
