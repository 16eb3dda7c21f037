"""Errors of function generators and their derivatives: over fixed places of the interval, or over each candidate's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Floats
from synthesis.fourbar.charts import AnyChart
from synthesis.fourbar.limits import BEGIN, END, Constraints, Limits
from synthesis.function.descent import Linear, Linearise
from synthesis.function.wanted import Wanted
from synthesis.mechanism import Placed
from synthesis.pose import whole_turns

Ints = NDArray[np.intp]

_RATIO, _WIDE = 20.0, 1e6
"""Lengths over the ground that are sought, and one over it, where no limit says otherwise; and where only the samples count."""
_CLOSES = 1e-4
"""Least transmission angle in radians: where the linkage locks, the rocker's angle has no derivative."""
_MARGIN = 1e-9
"""How far inside the limits of angles and family is aimed: what rounding leaves of it is inside too."""
_RATES, _LEAST_RATE, _DIFFERENCE = 9, 1e-3, 1e-6
"""Places at which the rocker must go on, its least rate beside the mean one, and the step of the rate's differences."""


class Problem:
    """A wanted function and limits made ready for many evaluations, for linkages with coupler and rocker exchanged.

    Least and largest lengths, and lengths that are given, are edges of a box; all other limits are conditions on the unknowns.

    Parameters
    ----------
    wanted : Wanted
        With a crank that turns counter-clockwise.
    limits : Limits
        Of the exchanged linkages, lengths over the ground's.
    largest : bool
        Whether ratios are sought within `_RATIO`, or as far as numbers go where no limit says otherwise.
    """

    def __init__(self, wanted: Wanted, limits: Limits, largest: bool) -> None:
        self.wanted = wanted
        self.chart = AnyChart()
        least = max(limits.transmission_angle_min, _CLOSES)
        in_box = replace(limits, transmission_angle_min=least, link_min=None, link_max=None, links=(None,) * 4)
        self.constraints = Constraints(in_box, smooth=True)
        self.given = given = np.log([np.nan if one is None else one for one in limits.links[:3]])
        """ln of the ratios that are given, NaN of the others, (3,)."""
        held = np.concatenate([~np.isnan(given), [wanted.start is not None, wanted.offset is not None]])
        self.free = np.flatnonzero(~held)
        ratio = limits.link_ratio_max or (_RATIO if largest else _WIDE)
        low, high = np.log([limits.link_min or 1 / ratio, limits.link_max or ratio])
        low, high = np.where(np.isnan(given), low, given), np.where(np.isnan(given), high, given)
        wide = np.full(2, np.inf)
        self.box = np.concatenate([low, -wide]), np.concatenate([high, wide])

    def conditions(self, unknowns: Floats) -> tuple[Floats, Floats]:
        """The conditions at unknowns (n, 5), at least 0 where they are kept, (n, m), and derivatives (n, m, 4)."""
        lengths = np.concatenate([np.exp(unknowns[:, :3]), np.ones((len(unknowns), 1))], axis=1)
        used = self.wanted.interval.after(unknowns[:, 3])
        found = self.constraints(Placed(lengths, np.ones(len(lengths)), used))
        slopes = np.empty((*found.values.shape, 4))
        slopes[:, :, :3] = found.slopes[:, :, :3] * lengths[:, None, :3]
        slopes[:, :, 3] = found.slopes[:, :, BEGIN] + found.slopes[:, :, END]
        return found.values - _MARGIN * np.array([name != "link_ratio_max" for name in found.names]), slopes

    def angle(self, unknowns: Floats, branch: Floats, crank: Floats) -> Floats:
        """theta2 of the exchanged linkages at crank angles (n, M) from the first sample; infinite where it does not close."""
        found = self.chart.at(unknowns[:, :3], unknowns[:, 3:4] + crank, branch, derivatives=False)
        return np.where(self._possible(found.possible, len(unknowns))[:, None], found.angle, np.inf)

    @staticmethod
    def _possible(possible: object, count: int) -> NDArray[np.bool_]:
        return np.full(count, True) if possible is True else np.asarray(possible)

    def gap(self, unknowns: Floats, branch: Floats, crank: Floats) -> Floats:
        """Errors (n, M) at crank angles (n, M) of the candidates' own; infinite where it does not close."""
        with np.errstate(invalid="ignore"):  # an output beyond all numbers
            return np.asarray(self.wanted.curve(crank) - unknowns[:, 4:] - self.angle(unknowns, branch, crank))

    def with_offset(self, unknowns: Floats, branch: Floats, crank: Floats, root: Floats) -> Floats:
        """Candidates with the given offset, or the best over crank angles (M,), whose errors count ``root`` (M,)."""
        some = np.broadcast_to(crank, (len(unknowns), crank.size))
        with np.errstate(invalid="ignore"):
            gap = self.wanted.curve(some) - self.angle(unknowns, branch, some)
        best = np.nan_to_num(gap, posinf=0.0, neginf=0.0) @ (root**2 / np.sum(root**2))
        given = self.wanted.target.offset
        out = unknowns.copy()
        out[:, 4] = best if given is None else given + whole_turns(best - given)
        return out

    def _rates(self, unknowns: Floats, branch: Floats) -> tuple[Floats, Floats]:
        """How fast the body turns the wanted way, less a little, at some places (n, q), and derivatives (n, q, 4)."""
        crank = (1 - np.cos(np.linspace(0.0, np.pi, _RATES))) / 2 * self.wanted.crank[-1]
        way = np.sign(self.wanted.output[-1] - self.wanted.output[0])
        least = _LEAST_RATE * abs((self.wanted.output[-1] - self.wanted.output[0]) / self.wanted.crank[-1])

        def rate(at: Floats) -> Floats:
            slope = self.chart.at(at[:, :3], at[:, 3:4] + crank, branch).slope
            assert slope is not None
            return way * np.clip(slope[:, 3], -1e3, 1e3)

        value = rate(unknowns)
        by = np.empty((*value.shape, 4))
        for k in range(4):
            step = np.zeros(5)
            step[k] = _DIFFERENCE
            by[:, :, k] = (rate(unknowns + step) - rate(unknowns - step)) / (2 * _DIFFERENCE)
        return value - least, by

    def linear(self, branch: Floats, crank: Floats, root: Floats) -> Linearise:
        """The errors at crank angles (n, M) times ``root`` (n, M), and the conditions, ready for `descent.descend`."""
        curve = self.wanted.curve(crank)

        def evaluate(unknowns: Floats, which: Ints) -> Linear:
            at, goal, scale = crank[which], curve[which], root[which]
            found = self.chart.at(unknowns[:, :3], unknowns[:, 3:4] + at, branch[which])
            assert found.slope is not None
            error = (goal - unknowns[:, 4:] - found.angle) * scale
            error[~self._possible(found.possible, len(unknowns))] = np.inf
            slope = np.empty((*error.shape, 5))
            slope[:, :, :4] = -found.slope.transpose(0, 2, 1) * scale[:, :, None]
            slope[:, :, 4] = -scale
            condition, by = self.conditions(unknowns)
            if self.wanted.one_way:
                rate, by_rate = self._rates(unknowns, branch[which])
                condition, by = np.concatenate([condition, rate], axis=1), np.concatenate([by, by_rate], axis=1)
            by = np.concatenate([by, np.zeros((*condition.shape, 1))], axis=2)
            return Linear(error, slope[:, :, self.free], condition, by[:, :, self.free])

        return evaluate
