"""Bodies on a crank pin that a rail or a slot guides, in batches: their rotation and coordinates for a search.

Lengths of a *slider-crank* are (crank r, rod l, offset e): the rod is the body, its far end moves on the line y = e, with the
crank's pivot in the origin. Lengths of a *swinging block* are (crank r, ground d, offset h): a line of the body, h to the left of
the crank pin, passes through the fixed pin d. With theta1 of the crank and theta2 of the body::

    sin theta2 = (e - r sin theta1) / l                          d - r e^{i theta1} = e^{i theta2} (s + i h)

Offsets have signs, so that there is a single way to assemble each linkage: the other assembly is, turned by half a turn, the
linkage with the negative offset. In ::

    (l cos theta2)^2 = (x + r (1 + sin theta1)) (y + r (1 - sin theta1)),   x = l - r - e,   y = l - r + e
    s^2 = x y + 4 d r sin^2(theta1 / 2),                                    x = |d - r| - h, y = |d - r| + h

no term cancels if the crank turns fully: then x and y are both above 0.

`guided.by_crank` builds the mounted linkages.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.arrays import Flags, Floats
from synthesis.kernels import codes, crank_loops
from synthesis.mechanism import Chart

RAIL, SLOT = codes.RAIL, codes.SLOT
"""Guide of the body beside its crank: slider-crank or swinging block."""


def excesses(guide: int, lengths: Floats) -> tuple[Floats, Floats]:
    """x and y of lengths (..., 3): above 0 where the crank turns fully."""
    short, long, offset = (lengths[..., k] for k in range(3))
    gap = long - short
    if guide == SLOT:
        gap = np.abs(gap)
    return gap - offset, gap + offset


class SliderChart(Chart):
    """Base class of the charts of both kinds."""

    cell = np.array([0.7, 0.7, 0.6])
    hop = np.array([0.7, 1.0, 0.4])

    def shape_coordinates(self, unknowns: Floats) -> Floats:
        """Return coordinates of shapes: the logarithm of a ratio of lengths, and the offset relative to them, (n, 2)."""
        crank, long, offset = self.shape(unknowns).lengths.T
        return np.stack([np.log(long / crank) / 0.7, 3 * offset / (crank + long)], axis=1)


@dataclass(frozen=True)
class SliderCrankChart(SliderChart):
    """All slider-cranks whose crank turns fully, each once: with r = 1, ln x and ln y; change points lie at infinity.

    l = 1 + (x + y) / 2 and e = (y - x) / 2. Law: ``unknowns(shape(q).lengths) == q`` for moderate q.
    """

    guide = RAIL
    kind = codes.SLIDER_CRANK
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
    kind = codes.SWINGING_BLOCK
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
        """Code in the compiled kernel."""
        return codes.ANY_SLIDER_CRANK if self.guide == RAIL else codes.ANY_SWINGING_BLOCK

    def unknowns(self, lengths: ArrayLike) -> Floats:
        """Unknowns (n, 2) of lengths (n, 3)."""
        crank, long, offset = np.moveaxis(np.asarray(lengths, dtype=float), -1, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            found: Any = np.stack([np.log(long / crank), np.arctanh(offset / (crank + long))], axis=-1)
        return np.clip(np.nan_to_num(found), -self.LIMITS, self.LIMITS)


def _logarithms(values: Floats, largest: float) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.clip(np.nan_to_num(np.log(values), nan=-largest), -largest, largest)


# -- the mechanism ------------------------------------------------------------------------------------------------------


class SliderTurning:
    """Body on a crank that a rail or a slot guides; lengths are crank, rod or ground, and the signed offset.

    There is a single branch: the other assembly is the linkage with the negative offset.
    """

    branches: tuple[int, ...] = (1,)

    def __init__(self, kind: str, full: SliderChart) -> None:
        self.kind, self.full, self.guide = kind, full, full.guide

    @cached_property
    def coarse_types(self) -> Floats:
        """Types whose crank turns fully, spread over the chart."""
        if self.guide == RAIL:
            logarithms = np.linspace(-4.0, 3.5, 16)
            return self.full.shape(np.array(list(product(logarithms, logarithms)))).lengths
        ratios = np.concatenate([-np.geomspace(0.05, 3.5, 10), np.geomspace(0.05, 3.5, 10)])
        return self.full.shape(np.array(list(product(ratios, np.linspace(-3.0, 3.0, 13))))).lengths

    def winding(self, lengths: Floats) -> NDArray[np.int8]:
        """One for swinging blocks whose ground is shorter than the crank: their body turns with it; for full cranks only."""
        turns = (lengths[:, 0] > lengths[:, 1]) & (self.guide == SLOT)
        return turns.astype(np.int8)

    def body_angle(self, lengths: Floats, branch: ArrayLike, crank: Floats) -> Floats:
        """Return continuous theta2 at crank angles (n, N) or (N,), shape (n, N); NaN if the loop does not close."""
        lengths = np.asarray(lengths, dtype=float)
        crank = np.broadcast_to(crank, (len(lengths), np.shape(crank)[-1]))
        angle, _, closes = crank_loops.body_angles(
            self.guide,
            np.array(lengths, order="C"),
            *excesses(self.guide, lengths),
            np.ones(len(lengths)),
            np.array(crank, dtype=float, order="C"),
        )
        return np.where(closes, angle, np.nan)

    def in_family(self, family: str, lengths: Floats) -> Flags:
        """Return flags of types of a table that belong to a family: all types, since their cranks turn fully."""
        return np.ones(len(lengths), dtype=bool)

    def charts(self, family: str) -> list[Any]:
        """Return full cranks first, then all other linkages if any family is allowed."""
        return [self.full, AnySliderChart(self.guide)] if family == "any" else [self.full]

    def bounded_types(self, family: str) -> Floats:
        """Coarse types for that; of any family those whose crank does not turn fully as well."""
        if family != "any":
            return self.coarse_types
        shapes = AnySliderChart(self.guide).shape(
            np.array(list(product(np.linspace(-2, 2, 9), np.linspace(-2, 2, 9))))
        )
        swinging = shapes.lengths[np.minimum(shapes.x0, shapes.y0) <= 0]
        return np.concatenate([self.coarse_types, swinging])


SLIDER_CRANK = "slider_crank"
SWINGING_BLOCK = "swinging_block"
FULL_CHARTS: dict[str, SliderChart] = {SLIDER_CRANK: SliderCrankChart(), SWINGING_BLOCK: SwingingBlockChart()}
"""Charts of full cranks of each kind."""
