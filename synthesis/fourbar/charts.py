"""Coordinates of a linkage's shape for a search without bounds: length ratios from real numbers, with their derivatives.

Each chart maps the first three unknowns to four lengths (their common scale is free, the pose takes it up) and to the two
constants X0, Y0 of the closure (see `fourbar`), formed without cancellation. The fourth unknown of a search is theta1 at
the first sample and is no business of the chart.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.kinematics import grashof_excesses

Floats = NDArray[np.float64]


class Shape(NamedTuple):
    """Lengths and closure constants at points of a chart."""

    lengths: Floats
    """(n, 4)"""
    x0: Floats
    """(n,): (L2 + L3)^2 - (L1 + L4)^2"""
    y0: Floats
    """(n,): (L4 - L1)^2 - (L3 - L2)^2"""
    jacobian: Floats
    """(n, 4, 3): derivatives of the lengths by the chart's unknowns."""


class Chart(Protocol):
    """A chart of linkages."""

    always_closes: bool
    """Whether every point of it closes at every crank angle."""

    def shape(self, unknowns: Floats) -> Shape:
        """Shape at unknowns (n, 3)."""

    def unknowns(self, lengths: Floats) -> Floats:
        """Unknowns (n, 3) of lengths (n, 4)."""


class FullCrankChart:
    """All four-bars whose crank turns fully, each once: R^3 less the plane p = 0, which only L1 = L4, L2 = L3 touches.

    With L1 + L4 = 1: p = ln(L1 / L4), L2 + L3 = 1 + e^u, L2 - L3 = |L4 - L1| tanh w. Crank-rockers have p < 0, double-cranks
    p > 0; change points lie at infinity. X0 = e^u (2 + e^u) and Y0 = (L4 - L1)^2 / cosh^2 w are positive everywhere.
    Law: ``unknowns(shape(x).lengths) == x`` for moderate x.
    """

    always_closes = True
    LIMITS = np.array([16.0, 30.0, 17.0])
    """Largest |p|, |u|, |w|: beyond, the lengths no longer change in double precision."""

    def shape(self, unknowns: Floats) -> Shape:
        p, u, w = np.clip(unknowns, -self.LIMITS, self.LIMITS).T
        l1, l4 = 1 / (1 + np.exp(-p)), 1 / (1 + np.exp(p))
        gap, excess = np.abs(np.tanh(p / 2)), np.exp(u)
        share, fall = np.tanh(w), 1 / np.cosh(w) ** 2
        half = gap * share / 2
        middle = (1 + excess) / 2
        lengths = np.stack([l1, middle + half, middle - half, l4], axis=-1)
        jacobian = np.zeros((*lengths.shape, 3))
        step = l1 * l4
        jacobian[:, 0, 0], jacobian[:, 3, 0] = step, -step
        jacobian[:, 1, 0] = np.sign(p) * step * share
        jacobian[:, 2, 0] = -jacobian[:, 1, 0]
        jacobian[:, 1, 1] = jacobian[:, 2, 1] = excess / 2
        jacobian[:, 1, 2] = gap * fall / 2
        jacobian[:, 2, 2] = -jacobian[:, 1, 2]
        return Shape(lengths, excess * (2 + excess), gap**2 * fall, jacobian)

    def unknowns(self, lengths: Floats) -> Floats:
        lengths = np.asarray(lengths, dtype=float)
        l1, l4 = lengths[..., 0], lengths[..., 3]
        a, b, c = grashof_excesses(lengths)
        total = l1 + l4
        with np.errstate(divide="ignore", invalid="ignore"):
            x = np.stack([np.log(l1 / l4), np.log(c / total), 0.5 * np.log(np.abs(a / b))], axis=-1)
        # (gap + d) / (gap - d) is a / b for crank-rockers and b / a for double-cranks
        x[..., 2] *= np.where(l1 > l4, -1.0, 1.0)
        return np.clip(np.nan_to_num(x), -self.LIMITS, self.LIMITS)


class AnyChart:
    """All four-bars: the logarithms of L1 / L4, L2 / L4, L3 / L4. Most points close over a part of the turn only."""

    always_closes = False
    LIMIT = 16.0

    def shape(self, unknowns: Floats) -> Shape:
        three = np.exp(np.clip(unknowns, -self.LIMIT, self.LIMIT))
        lengths = np.concatenate([three, np.ones((len(three), 1))], axis=1)
        jacobian = np.zeros((*lengths.shape, 3))
        for k in range(3):
            jacobian[:, k, k] = three[:, k]
        a, b, c = grashof_excesses(lengths)
        return Shape(lengths, c * lengths.sum(axis=-1), a * b, jacobian)

    def unknowns(self, lengths: Floats) -> Floats:
        lengths = np.asarray(lengths, dtype=float)
        return np.log(lengths[..., :3] / lengths[..., 3:])
