"""A function, a law and limits prepared for descents: errors and conditions of candidates with their derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Floats
from synthesis.constrained_descent import Linear
from synthesis.function.laws import ANGLE, FourBarLaw, FunctionLimits
from synthesis.function.target_function import TargetFunction
from synthesis.function.travel_laws import TravelLaw
from synthesis.pose import whole_turns

AnyLaw: TypeAlias = FourBarLaw | TravelLaw


@dataclass(frozen=True)
class ProblemOptions:
    """Options of the unknowns of functions."""

    rates: int = 9
    """Number of inputs at which the output must not turn back."""
    rate_min: float = 1e-3
    """Smallest rate of the output relative to its mean rate."""
    difference: float = 1e-6
    """Step of the differences of these rates."""
    travel_max: float = 4e3
    """Largest position of a slider or length of a cylinder at the first sample, over the scale."""
    seed: int = 21
    """Seed of the random numbers."""


OPTIONS = ProblemOptions()


class Inputs(NamedTuple):
    """Inputs at which candidates are compared with the function."""

    branch: Floats
    """(n,): branches of the candidates."""
    crank: Floats
    """(n, M): inputs from the first sample."""
    root: Floats
    """(n, M): factors of the errors."""
    wanted: Floats
    """(n, M): outputs of the function."""


class FunctionProblem:
    """A function, a law and limits, prepared for many evaluations of errors and conditions with derivatives.

    The unknowns are three numbers of the shape, the zero and the offset. Limits of lengths and prescribed lengths are the edges
    of a box; all other limits are conditions on the unknowns.

    Parameters
    ----------
    target : TargetFunction
    law : FourBarLaw or TravelLaw
    limits : FunctionLimits
    largest : bool
        The largest error is minimized, otherwise squared errors.
    """

    def __init__(self, target: TargetFunction, law: AnyLaw, limits: FunctionLimits, largest: bool) -> None:
        self.function, self.law, self.limits, self.largest = target, law, limits, largest
        self.offset = target.offset
        """The prescribed offset, if there is any."""
        lengths = limits.prescribed_in(law)
        self.prescribed = np.append(law.unknowns(lengths[: law.size]), np.zeros(3 - law.size))
        """Prescribed unknowns of the shape, NaN for the others, (3,)."""
        held = np.concatenate([~np.isnan(self.prescribed), [target.start is not None, target.offset is not None]])
        self.free: NDArray[np.intp] = np.flatnonzero(~held)
        """Unknowns that are not prescribed."""
        shortest, longest = law.bounds(limits.relative, largest)
        low, high = np.full(5, -np.inf), np.full(5, np.inf)
        for k, (name, above) in enumerate(zip(law.lengths, law.positive)):
            if name != "angle":
                low[k], high[k] = (np.log(shortest), np.log(longest)) if above else (-longest, longest)
        if law.input != ANGLE:
            low[3], high[3] = -OPTIONS.travel_max, OPTIONS.travel_max
        low[:3], high[:3] = np.where(np.isnan(self.prescribed), [low[:3], high[:3]], self.prescribed)
        self.box = low, high
        self.rate_inputs = (1 - np.cos(np.linspace(0.0, np.pi, OPTIONS.rates))) / 2 * target.crank[-1]
        """Inputs (q,) at which the output must advance, if it must not turn back."""
        self.conditions = law.conditions(target, limits.relative)

    def beginnings(self, count: int) -> Floats:
        """Spread shapes and zeros (n, 5) over the useful range; the same each time."""
        random, out = np.random.default_rng(OPTIONS.seed), np.zeros((count, 5))
        low, high = (np.tile(edge[:3], (count, 1)) for edge in self.box)
        out[:, :3] = np.where(np.isnan(self.prescribed), self.law.sample(random, low, high), self.prescribed)
        out[:, 3] = self.law.zeros(random, self.law.of(out), float(self.function.crank[-1]))
        if self.function.start is not None:
            out[:, 3] = self.function.start
        return out

    # -- errors -------------------------------------------------------------------------------------------------------

    def wrapped_error(self, gap: Floats) -> Floats:
        """Return errors to the nearest whole turn if outputs are known up to whole turns."""
        return gap - whole_turns(gap) if self.law.wraps else gap

    def gap(self, unknowns: Floats, branch: Floats, crank: Floats) -> Floats:
        """Return the errors (n, M) at inputs (M,) or (n, M); infinite if the linkage does not close."""
        crank = np.broadcast_to(crank, (len(unknowns), np.shape(crank)[-1]))
        found = self.law.at(unknowns, branch, crank, derivatives=False)
        with np.errstate(invalid="ignore"):  # the output may overflow
            gap = self.wrapped_error(self.function.curve(crank) - unknowns[:, 4:] - found.value)
        return np.where(found.possible, gap, np.inf)

    def with_offset(self, unknowns: Floats, branch: Floats, crank: Floats, root: Floats) -> Floats:
        """Set the prescribed offset, or the best offset over inputs (M,) with errors multiplied by ``root`` (M,)."""
        angles, share = np.broadcast_to(crank, (len(unknowns), crank.size)), root**2 / np.sum(root**2)
        found = self.law.at(unknowns, branch, angles, derivatives=False)
        gap = np.where(found.possible, self.function.curve(angles) - found.value, 0.0)
        out = unknowns.copy()
        middle = np.angle(np.exp(1j * gap) @ share) if self.law.wraps else np.zeros(len(out))
        best = middle + self.wrapped_error(gap - middle[:, None]) @ share
        if self.offset is not None:
            best = self.offset + (whole_turns(best - self.offset) if self.law.output == ANGLE else np.zeros(len(out)))
        out[:, 4] = best
        return out

    def _rates(self, unknowns: Floats, branch: Floats) -> tuple[Floats, Floats]:
        """Return the rate of the output less a margin at some inputs (n, q), and derivatives (n, q, 5)."""
        rise = self.function.output[-1] - self.function.output[0]
        sense = np.sign(rise) * np.sign(self.function.crank[-1])
        smallest = OPTIONS.rate_min * abs(rise / self.function.crank[-1])
        inputs = np.broadcast_to(self.rate_inputs, (len(unknowns), self.rate_inputs.size))

        def rate(at: Floats) -> Floats:
            return sense * np.clip(self.law.at(at, branch, inputs).slope[:, 3], -1e3, 1e3)

        by = np.zeros((*inputs.shape, 5))
        for k in (*range(self.law.size), 3):
            step = OPTIONS.difference * np.eye(5)[k]
            by[:, :, k] = (rate(unknowns + step) - rate(unknowns - step)) / (2 * OPTIONS.difference)
        return rate(unknowns) - smallest, by

    def inputs(self, branch: Floats, crank: Floats, root: Floats) -> Inputs:
        """Return the inputs of candidates (n,), each (M,) or (n, M), with the factors of their errors."""
        shape = branch.size, crank.shape[-1]
        crank = np.broadcast_to(crank, shape)
        return Inputs(branch, crank, np.broadcast_to(root, shape), self.function.curve(crank))

    def linearised(self, unknowns: Floats, inputs: Inputs) -> Linear:
        """Return the errors and conditions of candidates at unknowns (n, 5), linearized."""
        found = self.law.at(unknowns, inputs.branch, inputs.crank)
        error = self.wrapped_error(inputs.wanted - unknowns[:, 4:] - found.value) * inputs.root
        error[~found.possible.all(axis=1)] = np.inf
        slope = np.empty((*error.shape, 5))
        slope[:, :, :4] = -found.slope.transpose(0, 2, 1) * inputs.root[:, :, None]
        slope[:, :, 4] = -inputs.root
        condition, by = self.conditions(unknowns)
        if self.function.one_way:
            rate, by_rate = self._rates(unknowns, inputs.branch)
            condition, by = np.concatenate([condition, rate], axis=1), np.concatenate([by, by_rate], axis=1)
        return Linear(error, np.clip(slope, -1e9, 1e9)[:, :, self.free], condition, by[:, :, self.free])
