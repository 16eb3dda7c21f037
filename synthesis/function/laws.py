"""Relations of output and input of linkages that generate functions, by kind of linkage; here those of four-bars.

Each law is output = y(u) + offset, with the input u from the first sample and five unknowns: three of the shape, the *zero*,
which is the input at the first sample, and the offset. Lengths are over a scale, and positive lengths are represented by
their logarithms. For a four-bar, whose ground is the scale, y is theta3 of

    |1 + l3 e^{i theta3} - l1 e^{i theta1}| = l2,   theta1 = zero + u.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from synthesis.arrays import Flags, Floats
from synthesis.constraints import Constraints, keeps
from synthesis.four_bar import transmission_angle_over
from synthesis.fourbar.mechanism import AnyChart
from synthesis.function.target_function import TargetFunction
from synthesis.guides import Driver, Kind
from synthesis.kernels import codes
from synthesis.limits import LINKS, Limits
from synthesis.linkage import Linkage, as_lengths, four_bar
from synthesis.mechanism import Placed
from synthesis.target import TURN, Interval

ANGLE, LENGTH = "angle", "length"
Conditions: TypeAlias = Callable[[Floats], tuple[Floats, Floats]]
"""Conditions of limits at unknowns (n, 5), not negative if satisfied, (n, m), and their derivatives (n, m, 5)."""


@dataclass(frozen=True)
class FourBarOptions:
    """Options of the limits of four-bars."""

    ratio_max: float = 20.0
    """Largest ratio of a length to the ground, and of the ground to a length, for the largest error if no limit is smaller."""
    wide_ratio_max: float = 1e6
    """The largest such ratio for least squares."""
    begin_ratio: float = 2.6
    """Logarithm of the largest ratio from which a search starts."""
    transmission_min: float = 1e-4
    """Smallest transmission angle in radians: at a locked position the output has no derivative."""
    margin: float = 1e-9
    """Margin by which descents satisfy the limits of angles and family."""
    rounding: float = 1e-12
    """Fraction of the longest length by which rounding may violate a limit."""


OPTIONS = FourBarOptions()


class OutputCurve(NamedTuple):
    """Output of candidates over their input."""

    value: Floats
    """(n, M): without the offset; angles up to whole turns; arbitrary if a candidate is impossible."""
    slope: Floats
    """(n, 4, M): derivatives by the unknowns of the shape and by the zero, which is also the derivative by the input."""
    possible: Flags
    """(n, M), or (n, 1): True if the linkage closes."""


@dataclass(frozen=True)
class FunctionLimits:
    """Limits of shape and lengths, and prescribed lengths by the names of a law, in the user's unit of length."""

    limits: Limits
    prescribed: Mapping[str, float] = field(default_factory=dict)
    scale: float = 1.0
    """Length that is 1 in the search: the ground of a four-bar, or the largest travel."""

    @classmethod
    def of_four_bar(cls, limits: Limits) -> FunctionLimits:
        """Return the limits of a four-bar, whose ground is 1 if it is not prescribed."""
        links = zip(LINKS[:3], limits.links)
        return cls(limits, {name: length for name, length in links if length is not None}, limits.links[3] or 1.0)

    @cached_property
    def relative(self) -> Limits:
        """The limits with lengths over the scale."""
        return self.limits.over(self.scale)

    def prescribed_in(self, law: Law) -> Floats:
        """Return the prescribed lengths of a law over the scale, NaN for the others, (3,)."""
        held = np.full(3, np.nan)
        held[law.size :] = 0.0
        for index, name in enumerate(law.lengths):
            held[index] = self.prescribed.get(name, np.nan) / self.scale
        return held

    def in_user_units(self, law: Law, lengths: Floats) -> Floats:
        """Return lengths (k,) of a law in the user's unit, angles in radians; prescribed lengths are equal to the last bit."""
        scaled = np.where(np.array(law.lengths) == "angle", lengths, lengths * self.scale).tolist()
        return np.array([self.prescribed.get(name, length) for name, length in zip(law.lengths, scaled)])


@dataclass(frozen=True, eq=False)
class Law:
    """Relation of output and input for a kind of linkage."""

    kind: Kind
    driver: Driver
    output: str
    """Kind of the output, "angle" or "length"."""
    lengths: tuple[str, ...]
    """Names of the unknowns of the shape."""
    branches: tuple[int, ...]

    wraps = False
    """True if outputs are known up to whole turns only."""

    @property
    def input(self) -> str:
        """Kind of the input."""
        return ANGLE if self.driver.turns else LENGTH

    @property
    def positive(self) -> tuple[bool, ...]:
        """Unknowns of the shape that are positive lengths, represented by their logarithms."""
        signed = {"offset", "slot_offset", "angle"} | ({"pin_distance"} if self.output == ANGLE else set())
        return tuple(name not in signed for name in self.lengths)

    @property
    def size(self) -> int:
        """Number of unknowns of the shape."""
        return len(self.lengths)

    def of(self, unknowns: Floats) -> Floats:
        """Return the lengths (n, 3) of unknowns (n, 5); 0 if the shape has fewer."""
        out = np.zeros((len(unknowns), 3), dtype=unknowns.dtype)
        for k, above in enumerate(self.positive):
            out[:, k] = np.exp(unknowns[:, k]) if above else unknowns[:, k]
        return out

    def unknowns(self, lengths: Floats) -> Floats:
        """Return the unknowns (..., k) of lengths (..., k)."""
        positive = np.array(self.positive)
        return np.where(positive, np.log(np.where(positive, lengths, 1.0)), lengths)

    def plain(self, unknowns: Floats, branch: Floats) -> tuple[Any, Floats, Floats]:
        """Return the law by which answers are described, and lengths (n, k) and branches (n,) at unknowns (n, 5)."""
        return self, self.of(unknowns)[:, : self.size], branch

    def zeros(self, random: np.random.Generator, lengths: Floats, last: float) -> Floats:
        """Spread zeros (n,) over the useful range of lengths (n, 3); ``last``: the input from the first sample to the last."""
        return random.uniform(0, TURN, len(lengths))


class FourBarLaw(Law):
    """Angle of the rocker of a four-bar with the ground 1.

    It is the angle of the coupler if coupler and rocker are exchanged, plus half a turn; so the unknowns are those of the
    chart of all four-bars, in which the rocker comes before the coupler.
    """

    def logarithms(self, unknowns: Floats) -> tuple[Floats, Floats | None]:
        """Return the logarithms of the lengths (n, 3), and their derivatives by the first four unknowns, (n, 3, 4).

        The derivatives are None if these logarithms are the unknowns.
        """
        return unknowns[:, :3], None

    def at(self, unknowns: Floats, branch: Floats, travel: Floats, derivatives: bool = True) -> OutputCurve:
        """Return the rocker angle at crank angles (n, M) from the first sample."""
        logarithms, by = self.logarithms(unknowns)
        possible = np.isfinite(logarithms).all(axis=1, keepdims=True)
        found = AnyChart().at(np.where(possible, logarithms, 0.0), unknowns[:, 3:4] + travel, -branch, derivatives)
        slope = found.slope
        if derivatives and by is not None:
            slope = by.transpose(0, 2, 1) @ found.slope[:, :3]
            slope[:, 3] += found.slope[:, 3]
        return OutputCurve(found.angle + np.pi, slope, found.closes[:, None] & possible)

    def linkage(self, lengths: Floats, branch: int, zero: float, scale: float = 1.0) -> Linkage:
        """Return the linkage with its crank at the zero, and the ground ``scale``."""
        crank, rocker, coupler = lengths
        return four_bar(as_lengths((crank, coupler, rocker, scale)), branch, zero)

    def unknowns_of(self, links: Floats, start: Floats) -> Floats:
        """Return unknowns (n, 5) of four-bars of lengths (n, 4) and crank angles at the first sample (n,), with the offset 0."""
        ratios = np.log(links[:, [0, 2, 1]] / links[:, 3:])
        return np.column_stack([ratios, start, np.zeros(len(links))])

    def bounds(self, limits: Limits, largest: bool) -> tuple[float, float]:
        """Return the smallest and the largest length over the ground."""
        ratio = limits.link_ratio_max or (OPTIONS.ratio_max if largest else OPTIONS.wide_ratio_max)
        return limits.link_min or 1 / ratio, limits.link_max or ratio

    def conditions(self, target: TargetFunction, limits: Limits) -> Conditions:
        """Return the conditions of angles, family and ratios."""
        smallest_angle = max(limits.transmission_angle_min, OPTIONS.transmission_min)
        without = replace(limits, link_min=None, link_max=None, links=(None,) * 4)  # these are bounds of lengths
        constraints = Constraints(replace(without, transmission_angle_min=smallest_angle), smooth=True)

        def evaluate(unknowns: Floats) -> tuple[Floats, Floats]:
            logarithms, by = self.logarithms(unknowns)
            lengths = np.column_stack([np.exp(logarithms), np.ones(len(unknowns))])
            used = target.interval.after(unknowns[:, 3])
            found = constraints(Placed(lengths, np.ones(len(lengths)), used))
            by_logarithm = found.slopes[:, :, :3] * lengths[:, None, :3]
            slopes = np.zeros((*found.values.shape, 5))
            slopes[:, :, : 3 if by is None else 4] = by_logarithm if by is None else by_logarithm @ by
            slopes[:, :, 3] += found.slopes[:, :, codes.BY_FIRST] + found.slopes[:, :, codes.BY_LAST]
            margin = OPTIONS.margin * np.array([name != "link_ratio_max" for name in found.names])
            return found.values - margin, slopes

        return evaluate

    def transmission(self, linkages: Sequence[Linkage], used: Interval) -> Floats:
        """Return the exact smallest transmission angles (n,) over crank angles from the first sample."""
        rows = np.array([(*linkage.links, linkage.start) for linkage in linkages]).reshape(-1, 5)
        return transmission_angle_over(rows[:, :4], used.after(rows[:, 4]))

    def keeps(self, target: TargetFunction, limits: Limits, linkages: Sequence[Linkage], lengths: Floats) -> Flags:
        """Return which four-bars satisfy limits, except for rounding, (n,)."""
        rows = np.array([(*linkage.links, linkage.branch, linkage.start) for linkage in linkages]).reshape(-1, 6)
        placed = Placed(rows[:, :4], rows[:, 4], target.interval.after(rows[:, 5]))
        return keeps(target.target, limits, placed, OPTIONS.rounding)

    def sample(self, random: np.random.Generator, low: Floats, high: Floats) -> Floats:
        """Spread logarithms of ratios (n, 3) over the useful range within bounds (n, 3)."""
        reach = OPTIONS.begin_ratio
        return random.uniform(np.maximum(low, np.minimum(high, -reach)), np.minimum(high, np.maximum(low, reach)))


FOUR_BAR = FourBarLaw(Kind.FOUR_BAR, Driver.CRANK, ANGLE, ("crank", "rocker", "coupler"), (1, -1))
