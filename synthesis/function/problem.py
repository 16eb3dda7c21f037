"""Functions and limits prepared for descents: errors and conditions of candidates with their derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Floats, Ints
from synthesis.constraints import Constraints
from synthesis.fourbar.mechanism import AnyChart
from synthesis.function.descent import Linear, Linearise
from synthesis.function.target_function import TargetFunction
from synthesis.kernels import codes
from synthesis.limits import Limits
from synthesis.mechanism import Placed
from synthesis.pose import whole_turns


@dataclass(frozen=True)
class ProblemOptions:
    """Options of the limits of functions."""

    ratio_max: float = 20.0
    """Largest ratio of a length to the ground, and of the ground to a length, for the largest error if no limit is smaller."""
    wide_ratio_max: float = 1e6
    """The largest such ratio for least squares."""
    transmission_min: float = 1e-4
    """Smallest transmission angle in radians: at a locked position the output has no derivative."""
    margin: float = 1e-9
    """Margin by which descents satisfy the limits of angles and family."""
    rates: int = 9
    """Number of inputs at which the output must not turn back."""
    rate_min: float = 1e-3
    """Smallest rate of the output relative to its mean rate."""
    difference: float = 1e-6
    """Step of the differences of these rates."""


OPTIONS = ProblemOptions()


class OutputCurve(NamedTuple):
    """Output of candidates over their input."""

    value: Floats
    """(n, M): without the offset; angles up to whole turns; arbitrary if a candidate is impossible."""
    slope: Floats
    """(n, 4, M): derivatives by the unknowns of the shape and by the zero, which is also the derivative by the input.
    """
    possible: NDArray[np.bool_]
    """(n, M), or (n, 1): True if the linkage closes."""


class FunctionProblem:
    """A function and limits, prepared for many evaluations of errors and conditions with derivatives, for any linkage.

    The unknowns are three numbers of the shape, the zero and the offset.
    """

    function: TargetFunction
    free: NDArray[np.intp]
    """Unknowns that are not prescribed."""
    moving: Sequence[int] = range(4)
    """Unknowns that change the output."""
    rate_inputs: Floats
    """Inputs (q,) at which the output must advance, if it must not turn back."""
    offset: float | None
    """The prescribed offset, if there is any."""
    turns: bool
    """True if the output is an angle, so that whole turns of the offset do not count."""
    wraps: bool
    """True if outputs are known up to whole turns only."""

    def at(self, unknowns: Floats, branch: Floats, crank: Floats, derivatives: bool = True) -> OutputCurve:
        """Return the outputs at inputs (n, M) from the first sample, with slopes if required."""
        raise NotImplementedError

    def conditions(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Return the conditions at unknowns (n, 5), not negative if satisfied, (n, m), and their derivatives (n, m, 5)."""
        raise NotImplementedError

    def wrapped_error(self, gap: Floats) -> Floats:
        """Return errors to the nearest whole turn if outputs are known up to whole turns."""
        return gap - whole_turns(gap) if self.wraps else gap

    def gap(self, unknowns: Floats, branch: Floats, crank: Floats) -> Floats:
        """Return the errors (n, M) at inputs (n, M) that differ by candidate; infinite if the linkage does not close."""
        found = self.at(unknowns, branch, crank, derivatives=False)
        with np.errstate(invalid="ignore"):  # the output may overflow
            gap = self.wrapped_error(self.function.curve(crank) - unknowns[:, 4:] - found.value)
        return np.where(found.possible, gap, np.inf)

    def with_offset(self, unknowns: Floats, branch: Floats, crank: Floats, root: Floats) -> Floats:
        """Set the prescribed offset, or the best offset over inputs (M,) with errors multiplied by ``root`` (M,)."""
        angles, share = np.broadcast_to(crank, (len(unknowns), crank.size)), root**2 / np.sum(root**2)
        found = self.at(unknowns, branch, angles, derivatives=False)
        gap = np.where(found.possible, self.function.curve(angles) - found.value, 0.0)
        out = unknowns.copy()
        middle = np.angle(np.exp(1j * gap) @ share) if self.wraps else np.zeros(len(out))
        best = middle + self.wrapped_error(gap - middle[:, None]) @ share
        if self.offset is not None:
            best = self.offset + (whole_turns(best - self.offset) if self.turns else np.zeros(len(out)))
        out[:, 4] = best
        return out

    def _rates(self, unknowns: Floats, branch: Floats) -> tuple[Floats, Floats]:
        """Return the rate of the output less a margin at some inputs (n, q), and derivatives (n, q, 5)."""
        rise = self.function.output[-1] - self.function.output[0]
        sense = np.sign(rise) * np.sign(self.function.crank[-1])
        smallest = OPTIONS.rate_min * abs(rise / self.function.crank[-1])
        inputs = np.broadcast_to(self.rate_inputs, (len(unknowns), self.rate_inputs.size))

        def rate(at: Floats) -> Floats:
            return sense * np.clip(self.at(at, branch, inputs).slope[:, 3], -1e3, 1e3)

        by = np.zeros((*inputs.shape, 5))
        for k in self.moving:
            step = OPTIONS.difference * np.eye(5)[k]
            by[:, :, k] = (rate(unknowns + step) - rate(unknowns - step)) / (2 * OPTIONS.difference)
        return rate(unknowns) - smallest, by

    def linear(self, branch: Floats, crank: Floats, root: Floats) -> Linearise:
        """Return the linearized errors at inputs (n, M), times ``root`` (n, M), and conditions for `descent.descend`."""
        curve = self.function.curve(crank)

        def evaluate(unknowns: Floats, which: Ints) -> Linear:
            scale = root[which]
            found = self.at(unknowns, branch[which], crank[which])
            error = self.wrapped_error(curve[which] - unknowns[:, 4:] - found.value) * scale
            error[~found.possible.all(axis=1)] = np.inf
            slope = np.empty((*error.shape, 5))
            slope[:, :, :4] = -found.slope.transpose(0, 2, 1) * scale[:, :, None]
            slope[:, :, 4] = -scale
            condition, by = self.conditions(unknowns)
            if self.function.one_way:
                rate, by_rate = self._rates(unknowns, branch[which])
                condition, by = np.concatenate([condition, rate], axis=1), np.concatenate([by, by_rate], axis=1)
            return Linear(error, np.clip(slope, -1e9, 1e9)[:, :, self.free], condition, by[:, :, self.free])

        return evaluate


class Problem(FunctionProblem):
    """A function and limits, prepared for many evaluations, for linkages with coupler and rocker exchanged.

    Limits of lengths and prescribed lengths are the edges of a box; all other limits are conditions on the unknowns.

    Parameters
    ----------
    target : TargetFunction
        The function, with a crank that turns counter-clockwise.
    limits : Limits
        Limits of the exchanged linkages, with lengths over the ground.
    largest : bool
        Search ratios within `OPTIONS.ratio_max`; otherwise as far as numbers allow if no limit is smaller.
    """

    turns, wraps = True, False

    def __init__(self, target: TargetFunction, limits: Limits, largest: bool) -> None:
        self.function, self.offset = target, target.target.offset
        self.chart = AnyChart()
        smallest_angle = max(limits.transmission_angle_min, OPTIONS.transmission_min)
        in_box = replace(
            limits, transmission_angle_min=smallest_angle, link_min=None, link_max=None, links=(None,) * 4
        )
        self.constraints = Constraints(in_box, smooth=True)
        self.prescribed = prescribed = np.log([np.nan if length is None else length for length in limits.links[:3]])
        """Logarithms of the prescribed ratios, NaN for the others, (3,)."""
        held = np.concatenate([~np.isnan(prescribed), [target.start is not None, target.offset is not None]])
        self.free = np.flatnonzero(~held)
        ratio = limits.link_ratio_max or (OPTIONS.ratio_max if largest else OPTIONS.wide_ratio_max)
        low, high = np.log([limits.link_min or 1 / ratio, limits.link_max or ratio])
        low, high = np.where(np.isnan(prescribed), low, prescribed), np.where(np.isnan(prescribed), high, prescribed)
        wide = np.full(2, np.inf)
        self.box = np.concatenate([low, -wide]), np.concatenate([high, wide])
        self.rate_inputs = (1 - np.cos(np.linspace(0.0, np.pi, OPTIONS.rates))) / 2 * target.crank[-1]

    def conditions(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """Return the conditions of lengths, angles and family."""
        lengths = np.concatenate([np.exp(unknowns[:, :3]), np.ones((len(unknowns), 1))], axis=1)
        used = self.function.interval.after(unknowns[:, 3])
        found = self.constraints(Placed(lengths, np.ones(len(lengths)), used))
        slopes = np.zeros((*found.values.shape, 5))
        slopes[:, :, :3] = found.slopes[:, :, :3] * lengths[:, None, :3]
        slopes[:, :, 3] = found.slopes[:, :, codes.BY_FIRST] + found.slopes[:, :, codes.BY_LAST]
        return found.values - OPTIONS.margin * np.array([name != "link_ratio_max" for name in found.names]), slopes

    def at(self, unknowns: Floats, branch: Floats, crank: Floats, derivatives: bool = True) -> OutputCurve:
        """Return theta2 of the exchanged linkages."""
        found = self.chart.at(unknowns[:, :3], unknowns[:, 3:4] + crank, branch, derivatives)
        return OutputCurve(found.angle, found.slope, found.closes[:, None])
