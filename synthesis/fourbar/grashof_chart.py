"""Full-crank four-bars by their shortest link and their three Grashof excesses: change points lie at bounds, not at infinity.

A descent reaches a bound in one step and leaves it when the gradient turns, where `charts.FullCrankChart` would creep to
infinity; the lengths are linear in the unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.fourbar.charts import Evaluated, FourBarShape, FullCrankChart
from synthesis.fourbar.kinematics import grashof_excesses

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_ROCKER = np.array([[1, 0, 0, 0], [1, 0.5, 0.5, 0], [1, 0.5, 0, 0.5], [1, 0, 0.5, 0.5]])
_DOUBLE = np.abs(_ROCKER[[3, 1, 2, 0]]) * np.array([-1, 1, 1, 1])
_SHEETS = np.stack([_DOUBLE, _ROCKER])
"""Lengths by unknowns of a double-crank, whose l counts negative, and of a crank-rocker."""
_NO_LESS = np.array([-np.inf, 0.0, 0.0, 0.0])


@dataclass(frozen=True)
class GrashofChart(Evaluated):
    """All four-bars whose crank turns fully, by homogeneous unknowns (l, x, y, z), x, y, z >= 0.

    |l| is the shortest link, the crank where l > 0 (crank-rocker) and the ground where l < 0 (double-crank);
    L2 = |l| + (x + y) / 2, L3 = |l| + (x + z) / 2, and the fourth length is |l| + (y + z) / 2. Then
    X0 = x (4 |l| + x + y + z) and Y0 = y z, without cancellation. The common scale is free: `within` makes
    the sum of magnitudes one, unless the lengths are actual.
    Law: ``unknowns(shape(x).lengths) == within(x)``.
    """

    scaled: bool = True
    """Whether the sum of magnitudes is kept at one; otherwise lengths are actual."""

    LEAST = 1e-9
    """Least magnitude of an unknown: at change points the slope of theta2 has no limit."""

    always_closes = True
    sheet = 0
    cell = np.append(np.full(4, 0.1), FullCrankChart.cell[3])
    hop = np.array([0.4, 0.8, 0.8, 0.8, 0.3])
    """Of the logarithms of the magnitudes, and of the start."""
    longest_step = 0.35

    def shape(self, unknowns: Floats) -> FourBarShape:
        """Shapes at unknowns (n, 4); excesses below zero count as zero."""
        jacobian = _SHEETS[(unknowns[:, 0] > 0).astype(np.intp)]
        kept = np.maximum(unknowns, _NO_LESS)
        lengths = (jacobian @ kept[:, :, None])[:, :, 0]
        least, x, y, z = np.abs(kept).T
        return FourBarShape(lengths, x * (4 * least + x + y + z), y * z, jacobian)

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
        if self.scaled:
            unknowns = unknowns / np.sum(np.abs(unknowns), axis=-1, keepdims=True)
        out = np.maximum(unknowns, self.LEAST)
        out[..., 0] = np.copysign(np.maximum(np.abs(unknowns[..., 0]), self.LEAST), unknowns[..., 0])
        return out

    def stepped(self, unknowns: Floats, step: Floats) -> Floats:
        """Unknowns after a step, each component cut by itself; l keeps its sign."""
        longest = self.longest_step if self.scaled else 1.0
        side = np.copysign(1.0, unknowns)
        out = side * (unknowns + np.minimum(np.maximum(step, -longest), longest))
        return self.within(side * np.maximum(out, 1e-300))  # lifted to the bounds there, once the scale is one

    def held(self, unknowns: Floats, gradient: Floats) -> Flags:
        """Which unknowns stand at a bound that descent would push them through, (n, 4)."""
        return (np.abs(unknowns) <= 1.01 * self.LEAST) & (np.copysign(1.0, unknowns) * gradient > 0)

    def hopped(self, unknowns: Floats, noise: Floats) -> Floats:
        """Unknowns whose logarithms moved by noise (n, 4); excesses at a bound are lifted off it first."""
        side = np.sign(unknowns)
        return self.within(side * np.maximum(np.abs(unknowns), 1e-4) * np.exp(np.clip(noise, -8.0, 8.0)))

    def place(self, unknowns: Floats) -> Floats:
        """Where shapes lie, whatever their scale: the family, and logarithms of ratios of the unknowns, (n, 4)."""
        size = np.log(np.maximum(np.abs(unknowns), 1e-5 * np.sum(np.abs(unknowns), axis=1, keepdims=True)))
        ratios = size[:, :3] - size[:, 3:]
        return np.hstack([2 * np.sign(unknowns[:, :1]), ratios / [0.7, 1.0, 1.0]])


@dataclass(frozen=True)
class LengthsChart(Evaluated):
    """All four-bars by the logarithms of their lengths, whose common scale is free."""

    LIMIT = 30.0
    always_closes = False
    sheet = 0
    cell = np.append(np.full(4, 0.7), FullCrankChart.cell[3])
    hop = np.array([0.4, 0.4, 0.4, 0.4, 0.3])
    longest_step = 0.5

    def shape(self, unknowns: Floats) -> FourBarShape:
        """Shapes at unknowns (n, 4)."""
        lengths = np.exp(unknowns)
        a, b, c = grashof_excesses(lengths)
        return FourBarShape(lengths, c * lengths.sum(axis=-1), a * b, lengths[:, :, None] * np.eye(4))

    def unknowns(self, lengths: ArrayLike) -> Floats:
        """Unknowns (n, 4) of lengths (n, 4)."""
        return np.log(np.asarray(lengths, dtype=float))

    def stepped(self, unknowns: Floats, step: Floats) -> Floats:
        """Unknowns after a step, each component cut by itself."""
        moved = unknowns + np.clip(step, -self.longest_step, self.longest_step)
        return np.clip(moved, -self.LIMIT, self.LIMIT)

    def held(self, unknowns: Floats, gradient: Floats) -> Flags:
        """None is held, (n, 4)."""
        return np.zeros(unknowns.shape, dtype=bool)

    def hopped(self, unknowns: Floats, noise: Floats) -> Floats:
        """Unknowns moved by noise."""
        return np.clip(unknowns + np.clip(noise, -8.0, 8.0), -self.LIMIT, self.LIMIT)

    def place(self, unknowns: Floats) -> Floats:
        """Where shapes lie, whatever their scale: logarithms of length ratios, (n, 3)."""
        return (unknowns[:, :3] - unknowns[:, 3:]) / 0.7
