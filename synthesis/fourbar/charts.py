"""Coordinates of a four-bar's shape for a search, with their derivatives: without bounds, or with change points at bounds.

Each chart maps its unknowns to four lengths (their common scale is free, the pose takes it up) and to the two constants
X0, Y0 of the closure (see `kinematics`), formed without cancellation, and evaluates the coupler angle of candidates, shape
and crank angle at the first sample, over a target's samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from synthesis import kernel
from synthesis.arrays import Complexes, Flags, Floats
from synthesis.fourbar.kinematics import grashof_excesses
from synthesis.mechanism import BodyAngles


class FourBarShape(NamedTuple):
    """Lengths and closure constants at points of a chart."""

    lengths: Floats
    """(n, 4)"""
    x0: Floats
    """(n,): (L2 + L3)^2 - (L1 + L4)^2"""
    y0: Floats
    """(n,): (L4 - L1)^2 - (L3 - L2)^2"""
    jacobian: Floats
    """(n, 4, 3): derivatives of the lengths by the chart's unknowns."""


_FAR = (-8.0, -5.0, -2.5, 2.5, 5.0, 8.0)


class Evaluated:
    """What all charts of the four-bar share: the evaluation of coupler angles, the fast path of `kinematics`.

    It makes few array operations, each over all candidates and samples: in small batches their number determines the run time.
    """

    cell: Floats
    sheet: int
    """-1: only linkages with L1 < L4; +1: only L1 > L4; 0: both."""
    always_closes: bool
    """Whether every shape closes at every crank angle."""

    @property
    def edges(self) -> Floats:
        """None, where a chart names no shapes at its far ends."""
        return np.empty((0, len(self.cell) - 1))

    def shape(self, unknowns: Floats) -> FourBarShape:
        """Shapes at unknowns (n, k)."""
        raise NotImplementedError

    def hopped(self, unknowns: Floats, noise: Floats) -> Floats:
        """Unknowns moved by noise."""
        return unknowns + np.clip(noise, -8.0, 8.0)

    def place(self, unknowns: Floats) -> Floats:
        """Where shapes lie: logarithms of length ratios, (n, 3)."""
        lengths = self.shape(unknowns).lengths
        return np.log(lengths[:, :3] / lengths[:, 3:]) / 0.7

    def at(self, unknowns: Floats, theta1: Floats, branch: Floats, derivatives: bool = True) -> BodyAngles:
        """Angles at crank angles (n, N) of each candidate's own; the slope's last row is that by theta1."""
        half = np.exp(0.5j * theta1)
        return _angles(self, self.shape(unknowns), theta1, half, branch[:, None], derivatives)


@dataclass(frozen=True)
class FullCrankChart(Evaluated):
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

    always_closes = True
    kind = kernel.FULL_CRANK
    cell = np.array([0.7, 1.0, 1.0, 0.6])
    hop = np.array([0.7, 1.5, 1.5, 0.4])
    edges = np.array(list(product(_FAR, (-8.0, -4.0, -2.0, -0.5, 0.5, 2.0, 4.0), _FAR)))
    """Near one change point or two."""
    LIMITS = np.array([16.0, 30.0, 17.0])
    """Largest |p|, |u|, |w|: beyond, the lengths no longer change in double precision."""

    def shape(self, unknowns: Floats) -> FourBarShape:
        """Shapes at unknowns (n, 3)."""
        p, u, w = np.minimum(np.maximum(unknowns, -self.LIMITS), self.LIMITS).T
        ratio, excess = np.exp(p), np.exp(u)
        l4 = 1 / (1 + ratio)
        l1 = ratio * l4
        gap, share, fall = np.abs(np.tanh(0.5 * p)), np.tanh(w), 1 / np.cosh(w) ** 2
        half, middle, step, height = 0.5 * gap * share, 0.5 + 0.5 * excess, l1 * l4, 0.5 * excess
        lengths = np.empty((len(p), 4))
        lengths[:, 0], lengths[:, 1], lengths[:, 2], lengths[:, 3] = l1, middle + half, middle - half, l4
        jacobian = np.zeros((len(p), 4, 3))
        jacobian[:, 0, 0], jacobian[:, 3, 0] = step, -step
        step = np.copysign(step, p) * share
        jacobian[:, 1, 0], jacobian[:, 2, 0] = step, -step
        jacobian[:, 1, 1] = jacobian[:, 2, 1] = height
        step = 0.5 * gap * fall
        jacobian[:, 1, 2], jacobian[:, 2, 2] = step, -step
        return FourBarShape(lengths, excess * (2 + excess), gap**2 * fall, jacobian)

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
class AnyChart(Evaluated):
    """All four-bars: the logarithms of L1 / L4, L2 / L4, L3 / L4. Most points close over a part of the turn only."""

    sheet = 0
    always_closes = False
    kind = kernel.ANY
    cell = FullCrankChart.cell
    hop = FullCrankChart.hop
    LIMIT = 16.0

    def shape(self, unknowns: Floats) -> FourBarShape:
        """Shapes at unknowns (n, 3)."""
        three = np.exp(np.clip(unknowns, -self.LIMIT, self.LIMIT))
        lengths = np.concatenate([three, np.ones((len(three), 1))], axis=1)
        jacobian = np.zeros((*lengths.shape, 3))
        for k in range(3):
            jacobian[:, k, k] = three[:, k]
        a, b, c = grashof_excesses(lengths)
        return FourBarShape(lengths, c * lengths.sum(axis=-1), a * b, jacobian)

    def unknowns(self, lengths: ArrayLike) -> Floats:
        """Unknowns (n, 3) of lengths (n, 4)."""
        lengths = np.asarray(lengths, dtype=float)
        return np.log(lengths[..., :3] / lengths[..., 3:])


def _closes(chart: Evaluated, shape: FourBarShape, x: Floats, y: Floats) -> Flags | Literal[True]:
    """Which candidates are of the sheet and close at every sample."""
    answer: Flags | Literal[True] = True
    if chart.sheet:
        answer = (shape.lengths[:, 0] - shape.lengths[:, 3]) * chart.sheet > 0
    return answer if chart.always_closes else answer & np.all((x > 0) & (y > 0), axis=1)


def _angles(
    chart: Evaluated,
    shape: FourBarShape,
    theta1: Floats,
    half: Complexes,
    side: Floats,
    derivatives: bool,
) -> BodyAngles:
    """theta2 of shapes at theta1 (n, N), with half = e^{i theta1 / 2}."""
    lengths = shape.lengths[:, :, None]
    l1, l2, l3, l4 = lengths[:, 0], lengths[:, 1], lengths[:, 2], lengths[:, 3]
    sine, cosine = half.imag.copy(), half.real.copy()
    gap, product = l4 - l1, 4 * l1 * l4
    square, both = sine * sine, sine * cosine
    reach = product * square
    cosine *= cosine
    cosine *= product
    x, y, r2 = shape.x0[:, None] + cosine, shape.y0[:, None] + reach, gap * gap + reach
    possible = _closes(chart, shape, x, y)
    if possible is not True:
        x, y, r2 = (np.where(possible[:, None], value, 1.0) for value in (x, y, r2))
    # theta2 as in `kinematics`, where the two forms of arg(B - D) are explained. 2 L2 r cos(mu) = r^2 + L2^2 - L3^2 and
    # 2 L2 r sin(mu) = sqrt(X Y): not the last digit of that form, but X and Y are as good as there.
    twice = 2 * np.minimum(l1, l4)
    x *= y
    root = np.sqrt(x, out=x)
    r2 += (l2 - l3) * (l2 + l3)
    angle = np.arctan2(root, r2)
    angle *= side
    angle += np.arctan2(np.copysign(twice, -gap) * both, np.abs(gap) + twice * square)
    ahead = np.flatnonzero(gap < 0)
    if ahead.size:
        angle[ahead] += theta1[ahead] - np.pi
    phasor = np.empty(angle.shape, dtype=complex)
    phasor.real, phasor.imag = turned = np.cos(angle), np.sin(angle)
    slope = None
    if derivatives:
        square *= -2
        square += 1
        both *= 2
        slope = _slope(shape, (square, both), turned, root, side)
    return BodyAngles(angle, phasor, slope, possible)


def _slope(
    shape: FourBarShape, crank: tuple[Floats, Floats], coupler: tuple[Floats, Floats], root: Floats, side: Floats
) -> Floats:
    """d theta2 by the chart's unknowns and theta1', (n, k + 1, N), from cosine and sine of both angles, (n, N) each."""
    lengths = shape.lengths[:, :, None]
    l1, l2, l3, l4 = lengths[:, 0], lengths[:, 1], lengths[:, 2], lengths[:, 3]
    (cos1, sin1), (cos2, sin2) = crank, coupler
    # e^{i theta3} from the loop
    cos3, sin3 = l1 * cos1, l1 * sin1
    cos3 += l2 * cos2
    cos3 -= l4
    cos3 /= l3
    sin3 += l2 * sin2
    sin3 /= l3
    by_length = np.empty((len(root), 4, root.shape[1]))
    np.add(cos1 * cos3, sin1 * sin3, out=by_length[:, 0])
    np.add(cos2 * cos3, sin2 * sin3, out=by_length[:, 1])
    by_length[:, 2] = -1.0
    np.negative(cos3, out=by_length[:, 3])
    slope = np.empty((len(root), shape.jacobian.shape[2] + 1, root.shape[1]))
    np.matmul(shape.jacobian.transpose(0, 2, 1), by_length, out=slope[:, :-1])
    cos3 *= sin1
    sin3 *= cos1
    sin3 -= cos3
    np.multiply(l1, sin3, out=slope[:, -1])
    # one over L2 sin(theta2 - theta3); bounded, so that a dead position stops a step and not the program
    lever = -2 * side * l3 / np.maximum(root, 1e-8)
    slope *= lever[:, None, :]
    return slope


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
    the sum of magnitudes one.
    Law: ``unknowns(shape(x).lengths) == within(x)``.
    """

    LEAST = 1e-9
    """Least magnitude of an unknown: at change points the slope of theta2 has no limit."""

    always_closes = True
    sheet = 0
    cell = np.append(np.full(4, 0.1), FullCrankChart.cell[3])
    hop = np.array([0.4, 0.8, 0.8, 0.8, 0.3])
    """Of the logarithms of the magnitudes, and of the start."""
    kind = kernel.GRASHOF

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
