"""How a body on a crank pin turns that a rail or a slot guides, for many at once, and coordinates of such shapes for a search.

Lengths of a *slider-crank* are (crank r, rod l, offset e): the rod is the body, its far end runs on the line y = e, ahead of the
crank's pivot in the origin. Lengths of a *swinging block* are (crank r, ground d, offset h): a line of the body, h to the left of
the crank pin, runs through the fixed pin d. With theta1 of the crank and theta2 of the body::

    sin theta2 = (e - r sin theta1) / l                          d - r e^{i theta1} = e^{i theta2} (s + i h)

Offsets have signs, so that there is one way to assemble each: the other is, half a turn on, that of the offset negated. In ::

    (l cos theta2)^2 = (x + r (1 + sin theta1)) (y + r (1 - sin theta1)),   x = l - r - e,   y = l - r + e
    s^2 = x y + 4 d r sin^2(theta1 / 2),                                    x = |d - r| - h, y = |d - r| + h

nothing cancels where the crank turns fully: there x and y are both above 0 (design note on sliders, section 5).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from synthesis import kernel
from synthesis.arrays import Floats
from synthesis.mechanism import Chart

RAIL, SLOT = kernel.RAIL, kernel.SLOT
"""How the body is guided beside its crank: slider-crank, swinging block."""


def excesses(guide: int, lengths: Floats) -> tuple[Floats, Floats]:
    """x and y of lengths (..., 3): above 0 where the crank turns fully."""
    short, long, offset = (lengths[..., k] for k in range(3))
    gap = long - short
    if guide == SLOT:
        gap = np.abs(gap)
    return gap - offset, gap + offset


class SliderChart(Chart):
    """What all charts of both share."""

    cell = np.array([0.7, 0.7, 0.6])
    hop = np.array([0.7, 1.0, 0.4])

    def place(self, unknowns: Floats) -> Floats:
        """Where shapes lie: the logarithm of a ratio of lengths, and the offset as a part of them, (n, 2)."""
        crank, long, offset = self.shape(unknowns).lengths.T
        return np.stack([np.log(long / crank) / 0.7, 3 * offset / (crank + long)], axis=1)


_EDGE = (-10.0, -6.0, -3.0, 0.0, 3.0, 6.0)


@dataclass(frozen=True)
class SliderCrankChart(SliderChart):
    """All slider-cranks whose crank turns fully, each once: with r = 1, ln x and ln y; change points lie at infinity.

    l = 1 + (x + y) / 2 and e = (y - x) / 2. Law: ``unknowns(shape(q).lengths) == q`` for moderate q.
    """

    guide = RAIL
    kind = kernel.SLIDER_CRANK
    edges = np.array([(p, q) for p in _EDGE for q in _EDGE if min(p, q) < -2 or max(p, q) > 5])
    LIMIT = 20.0

    def unknowns(self, lengths: ArrayLike) -> Floats:
        """Unknowns (n, 2) of lengths (n, 3)."""
        lengths = np.asarray(lengths, dtype=float)
        return _logarithms(np.stack(excesses(RAIL, lengths), axis=-1) / lengths[..., :1], self.LIMIT)


@dataclass(frozen=True)
class SwingingBlockChart(SliderChart):
    """All swinging blocks whose crank turns fully, each once: R^2 less the line p = 0, which only r = d, h = 0 touches.

    With r + d = 1: p = ln(r / d), h = |d - r| tanh w. The body swings where p < 0, and turns with the crank where p > 0.
    Law: ``unknowns(shape(q).lengths) == q`` for moderate q.
    """

    guide = SLOT
    kind = kernel.SWINGING_BLOCK
    edges = np.array([(p, q) for p in (-8.0, -4.0, -1.0, 1.0, 4.0, 8.0) for q in (-8.0, -4.0, 4.0, 8.0)])
    LIMITS = np.array([16.0, 17.0])

    def unknowns(self, lengths: ArrayLike) -> Floats:
        """Unknowns (n, 2) of lengths (n, 3)."""
        lengths = np.asarray(lengths, dtype=float)
        x, y = excesses(SLOT, lengths)
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.stack([np.log(lengths[..., 0] / lengths[..., 1]), 0.5 * np.log(y / x)], axis=-1)
        return np.clip(np.nan_to_num(found), -self.LIMITS, self.LIMITS)


@dataclass(frozen=True)
class AnySliderChart(SliderChart):
    """All slider-cranks, or all swinging blocks, that close anywhere; most do so over a part of the turn only.

    With r = 1: ln l, or ln d, and the offset, which is below the sum of both, as (r + l) tanh w.
    """

    guide: int = RAIL
    LIMITS = np.array([16.0, 17.0])

    @property
    def kind(self) -> int:  # type: ignore[override]
        """Its code in the compiled kernel."""
        return kernel.ANY_SLIDER_CRANK if self.guide == RAIL else kernel.ANY_SWINGING_BLOCK

    def unknowns(self, lengths: ArrayLike) -> Floats:
        """Unknowns (n, 2) of lengths (n, 3)."""
        crank, long, offset = np.moveaxis(np.asarray(lengths, dtype=float), -1, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            found: Any = np.stack([np.log(long / crank), np.arctanh(offset / (crank + long))], axis=-1)
        return np.clip(np.nan_to_num(found), -self.LIMITS, self.LIMITS)


def _logarithms(values: Floats, most: float) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.clip(np.nan_to_num(np.log(values), nan=-most), -most, most)
