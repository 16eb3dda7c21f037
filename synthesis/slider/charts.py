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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from synthesis import kernel
from synthesis.arrays import Flags, Floats
from synthesis.mechanism import BodyAngles

RAIL, SLOT = kernel.RAIL, kernel.SLOT
"""How the body is guided beside its crank: slider-crank, swinging block."""
_DEAD = 1e-8
"""Least part of the rod along its rail, or of the ground along the slot, for slopes: a dead position stops a step, no program."""


class SliderShape(NamedTuple):
    """Lengths at points of a chart."""

    lengths: Floats
    """(n, 3)"""
    x: Floats
    """(n,): by what a crank that turns fully falls short of its dead position on one side,"""
    y: Floats
    """and on the other."""
    jacobian: Floats
    """(n, 3, 2): derivatives of the lengths by the chart's unknowns."""


def excesses(guide: int, lengths: Floats) -> tuple[Floats, Floats]:
    """x and y of lengths (..., 3): above 0 where the crank turns fully."""
    short, long, offset = (lengths[..., k] for k in range(3))
    gap = long - short
    if guide == SLOT:
        gap = np.abs(gap)
    return gap - offset, gap + offset


def body_angles(
    guide: int, lengths: Floats, x: Floats, y: Floats, theta1: Floats, derivatives: bool = False
) -> tuple[Floats, Floats | None, Flags]:
    """theta2, its derivatives by the lengths and theta1, and which close at every crank angle.

    ``lengths`` (n, 3), ``x``, ``y`` (n,), ``theta1`` (n, N). Shapes (n, N), (n, 4, N), (n,).

    theta2 is continuous over the turn, any number where a linkage does not close. Law: to full relative accuracy wherever x
    and y are exact and not negative.
    """
    crank, long, offset = (lengths[:, k, None] for k in range(3))
    x, y = x[:, None], y[:, None]
    if guide == RAIL:
        half = np.pi / 4 - theta1 / 2
        to_x, to_y = x + 2 * crank * np.cos(half) ** 2, y + 2 * crank * np.sin(half) ** 2
        possible = np.all((to_x > 0) & (to_y > 0), axis=1)
        along = np.sqrt(np.where(possible[:, None], to_x * to_y, 1.0))
        across = offset - crank * np.sin(theta1)
        angle = np.arctan2(across, along)
        if not derivatives:
            return angle, None, possible
        lever = 1 / np.maximum(along, _DEAD * long)
        columns = [-np.sin(theta1), -across / long, np.ones_like(angle), -crank * np.cos(theta1)]
        return angle, np.stack([lever * column for column in columns], axis=1), possible
    square, both = np.sin(theta1 / 2) ** 2, np.sin(theta1 / 2) * np.cos(theta1 / 2)
    along = x * y + 4 * crank * long * square
    possible = np.all(along > 0, axis=1)
    along = np.sqrt(np.where(possible[:, None], along, 1.0))
    gap, twice = long - crank, 2 * np.minimum(crank, long)
    angle = np.arctan2(np.copysign(twice, -gap) * both, np.abs(gap) + twice * square) - np.arctan2(offset, along)
    angle = angle + np.where(gap < 0, theta1 - np.pi, 0.0)
    if not derivatives:
        return angle, None, possible
    lever = 1 / np.maximum(along, _DEAD * long)
    apart = theta1 - angle
    columns = [-np.sin(apart), -np.sin(angle), -np.ones_like(angle), -crank * np.cos(apart)]
    return angle, np.stack([lever * column for column in columns], axis=1), possible


class SliderChart:
    """What all charts of both share."""

    guide: int
    kind: int
    sheet = 0
    cell = np.array([0.7, 0.7, 0.6])
    hop = np.array([0.7, 1.0, 0.4])
    edges: Floats = np.empty((0, 2))

    def shape(self, unknowns: Floats) -> SliderShape:
        """Shapes at unknowns (n, 2)."""
        raise NotImplementedError

    def hopped(self, unknowns: Floats, noise: Floats) -> Floats:
        """Unknowns moved by noise (n, 2)."""
        return unknowns + np.clip(noise, -8.0, 8.0)

    def place(self, unknowns: Floats) -> Floats:
        """Where shapes lie: the logarithm of a ratio of lengths, and the offset as a part of them, (n, 2)."""
        crank, long, offset = self.shape(unknowns).lengths.T
        return np.stack([np.log(long / crank) / 0.7, 3 * offset / (crank + long)], axis=1)

    def at(self, unknowns: Floats, theta1: Floats, branch: Floats, derivatives: bool = True) -> BodyAngles:
        """Angles of shapes (n, 2) at crank angles (n, N); the slope's last row is that by theta1."""
        shape = self.shape(unknowns)
        angle, by_length, possible = body_angles(self.guide, shape.lengths, shape.x, shape.y, theta1, derivatives)
        slope = None
        if by_length is not None:
            by_shape = np.matmul(shape.jacobian.transpose(0, 2, 1), by_length[:, :3])
            slope = np.concatenate([by_shape, by_length[:, 3:]], axis=1)
        return BodyAngles(angle, np.exp(1j * angle), slope, possible)


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

    def shape(self, unknowns: Floats) -> SliderShape:
        """Shapes at unknowns (n, 2)."""
        x, y = np.exp(np.clip(unknowns, -self.LIMIT, self.LIMIT)).T
        lengths = np.stack([np.ones_like(x), 1 + (x + y) / 2, (y - x) / 2], axis=1)
        jacobian = np.zeros((len(x), 3, 2))
        jacobian[:, 1, 0], jacobian[:, 1, 1], jacobian[:, 2, 0], jacobian[:, 2, 1] = x / 2, y / 2, -x / 2, y / 2
        return SliderShape(lengths, x, y, jacobian)

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

    def shape(self, unknowns: Floats) -> SliderShape:
        """Shapes at unknowns (n, 2)."""
        p, w = np.clip(unknowns, -self.LIMITS, self.LIMITS).T
        ratio = np.exp(p)
        ground = 1 / (1 + ratio)
        crank, gap, share, fall = ratio * ground, np.abs(np.tanh(p / 2)), np.tanh(w), 1 / np.cosh(w) ** 2
        e = np.exp(-2 * np.abs(w))
        less = 2 * e / (1 + e)
        lengths = np.stack([crank, ground, gap * share], axis=1)
        step = crank * ground
        jacobian = np.zeros((len(p), 3, 2))
        jacobian[:, 0, 0], jacobian[:, 1, 0] = step, -step
        jacobian[:, 2, 0], jacobian[:, 2, 1] = np.copysign(2 * step, p) * share, gap * fall
        x, y = gap * np.where(w > 0, less, 2 - less), gap * np.where(w > 0, 2 - less, less)
        return SliderShape(lengths, x, y, jacobian)

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

    def shape(self, unknowns: Floats) -> SliderShape:
        """Shapes at unknowns (n, 2)."""
        q, w = np.clip(unknowns, -self.LIMITS, self.LIMITS).T
        long, share = np.exp(q), np.tanh(w)
        lengths = np.stack([np.ones_like(q), long, (1 + long) * share], axis=1)
        jacobian = np.zeros((len(q), 3, 2))
        jacobian[:, 1, 0], jacobian[:, 2, 0], jacobian[:, 2, 1] = long, long * share, (1 + long) / np.cosh(w) ** 2
        return SliderShape(lengths, *excesses(self.guide, lengths), jacobian)

    def unknowns(self, lengths: ArrayLike) -> Floats:
        """Unknowns (n, 2) of lengths (n, 3)."""
        crank, long, offset = np.moveaxis(np.asarray(lengths, dtype=float), -1, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            found: Any = np.stack([np.log(long / crank), np.arctanh(offset / (crank + long))], axis=-1)
        return np.clip(np.nan_to_num(found), -self.LIMITS, self.LIMITS)


def _logarithms(values: Floats, most: float) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.clip(np.nan_to_num(np.log(values), nan=-most), -most, most)
