"""The wanted function: pairs of crank and rocker angles, the curve between them, and zeros of the dials that are given."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from synthesis.arrays import Floats
from synthesis.target import Interval, Mean, Target


@dataclass(frozen=True)
class TargetFunction:
    """Angle of a rocker as a function of the crank angle: output = theta3(start + crank) + offset, in radians.

    Attributes
    ----------
    crank : ndarray, shape (N,)
        Strictly monotonic crank angles from the first sample.
    output : ndarray, shape (N,)
        Continuous outputs.
    weights : ndarray, shape (N,), or None
        Weights of at least 0; None for equal weights.
    start : float, optional
        theta1 at the first sample, if it is given.
    offset : float, optional
        Offset, if it is given; whole turns do not count.
    exact : callable, optional
        ``exact(crank) -> output`` anywhere in the interval. Default: a spline of degree five through the samples, of a lower
        degree for less than six samples.
    one_way : bool
        True if the rocker must not turn back within the interval; see `answers.turning_back`.
    """

    crank: Floats
    output: Floats
    weights: Floats | None = None
    start: float | None = None
    offset: float | None = None
    exact: Callable[[Floats], Floats] | None = None
    one_way: bool = False

    @property
    def interval(self) -> Interval:
        """The crank angles used, from the first sample."""
        return Interval(0.0, float(self.crank[-1]))

    @property
    def clockwise(self) -> bool:
        """True if the crank turns clockwise."""
        return bool(self.crank[-1] < 0)

    @cached_property
    def mean(self) -> Mean:
        """The mean over the samples."""
        return Mean(self.crank.size, self.weights)

    @cached_property
    def curve(self) -> Callable[[Floats], Floats]:
        """The wanted output at crank angles of any shape."""
        if self.exact is not None:
            return self.exact
        return self._spline(5)

    def _spline(self, degree: int) -> Callable[[Floats], Floats]:
        """The spline through the samples, the highest odd degree that they allow; a parabola through three."""
        from scipy.interpolate import make_interp_spline

        side, last = -1.0 if self.clockwise else 1.0, self.crank.size - 1
        degree = 2 if last == 2 else min(degree, last - (last + 1) % 2)
        spline = make_interp_spline(side * self.crank, self.output, k=degree)
        return lambda crank: spline(side * crank)

    @cached_property
    def doubt(self) -> float:
        """Uncertainty of the curve between the samples: largest distance of two splines, in radians."""
        if self.exact is not None or self.crank.size < 4:
            return 0.0
        middle = (self.crank[:-1] + self.crank[1:]) / 2
        less = 3 if self.crank.size >= 6 else 1
        return float(np.abs(self.curve(middle) - self._spline(less)(middle)).max())

    def weight(self, crank: Floats) -> Floats:
        """Return the weights of errors at crank angles, relative to the largest weight, linear between the samples."""
        if self.weights is None:
            return np.ones_like(crank)
        side = -1.0 if self.clockwise else 1.0
        return np.interp(side * crank, side * self.crank, self.weights / self.weights.max())

    def mirrored(self) -> TargetFunction:
        """The function in a mirror: crank and rocker turn the other way."""
        exact = self.exact
        return replace(
            self,
            crank=-self.crank,
            output=-self.output,
            start=None if self.start is None else -self.start,
            offset=None if self.offset is None else -self.offset,
            exact=None if exact is None else lambda crank: -exact(-crank),
        )

    @cached_property
    def target(self) -> Target:
        """Return the function for the linkage with coupler and rocker exchanged, whose coupler turns as the rocker of this one.

        theta3(L1, L2, L3, L4; branch) = theta2(L1, L3, L2, L4; -branch) + pi, up to whole turns.
        """
        offset = None if self.offset is None else self.offset + np.pi
        return Target(
            self.output, None, rotation_weights=self.weights, crank=self.crank, start=self.start, offset=offset
        )
