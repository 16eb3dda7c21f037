"""The limits of a request as functions of four-bars, along which a search descends.

`Constraints` holds them as smooth functions of placed linkages. They are at least 0 if a limit is satisfied, over the length
scale and of order one; equations, such as a given pivot, are 0 if they are satisfied. Finished linkages of
all kinds are checked in `synthesis/violations.py`, and a test compares both.
"""

from __future__ import annotations

import numpy as np

from synthesis.arrays import Flags
from synthesis.four_bar import transmission_angle_over
from synthesis.kernels import codes, four_bar_limits
from synthesis.limits import LINKS, PIVOTS, Limits, in_family
from synthesis.mechanism import Constrained, Placed
from synthesis.pose import DEGENERATE
from synthesis.target import Samples
from synthesis.violations import EQUATION

_TRACED = {True: (257, 3), False: (25, 1)}
"""Number of crank angles at which joints are examined, and of refinements of their extremes: exactly, and in a search."""
SPARE = 1e-4
"""Fraction of the length scale by which the envelope of a search is smaller."""
_SIGNS = {"crank_rocker": 1.0, "double_crank": -1.0}
"""Signs of the first two excesses of a family, see `four_bar.grashof_excesses`."""


class Constraints:
    """The limits of a request as functions, in the unit of the linkages that are to keep them.

    Parameters
    ----------
    limits : Limits
    middle, scale : complex, float
        Positions of the placed linkages are measured from the middle, and all their lengths over the scale.
    exact : bool
        True to find the joints' extremes to rounding; otherwise within a fraction of `SPARE`, by which the envelope is smaller.
    smooth : bool
        True to make every constraint, also the family, smooth at all linkages, for a search over all length ratios.
        Otherwise the charts hold the family.
    """

    def __init__(
        self, limits: Limits, middle: complex = 0j, scale: float = 1.0, exact: bool = True, smooth: bool = False
    ) -> None:
        self.limits, self.exact, self.smooth = limits.relative(middle, scale), exact, smooth
        self._made: dict[bool, tuple[four_bar_limits.Limits, _Table]] = {}

    @property
    def any(self) -> bool:
        """True if there are constraints."""
        return not self.limits.only_family

    def __call__(self, placed: Placed, derivatives: bool = True) -> Constrained:
        """Evaluate the constraints of linkages."""
        posed = placed.pivot is not None
        count, (limits, table) = len(placed.lengths), self._once(posed)
        nothing = np.zeros(count)
        pivot, turned, coupler = (0.0 if column is None else np.asarray(column) for column in placed[3:])
        values, slopes = limits(
            np.ascontiguousarray(placed.lengths, dtype=float),
            nothing + placed.branch,
            nothing + placed.used.first,
            nothing + placed.used.last,
            (nothing + 0j + pivot)[:, None].view(float),
            nothing + turned,
            (nothing + 0j + coupler)[:, None].view(float),
            derivatives,
        )
        return Constrained(values, slopes, table.equal, table.names)

    def compiled(self, posed: bool) -> four_bar_limits.Limits:
        """Return the compiled constraints for a descent: of placed linkages, or only of shapes."""
        return self._once(posed)[0]

    def _once(self, posed: bool) -> tuple[four_bar_limits.Limits, _Table]:
        if posed not in self._made:
            table = self._table(posed)
            self._made[posed] = four_bar_limits.Limits(np.array(table.rows).reshape(-1, 8), posed, table.equal), table
        return self._made[posed]

    def _table(self, posed: bool) -> _Table:
        table, limits = _Table(), self.limits
        smooth = self.smooth and limits.family != "any"
        if limits.transmission_angle_min:
            table.add("transmission_angle_min", codes.USED, np.cos(limits.transmission_angle_min))
        if smooth:
            table.add("family", codes.FAMILY, _SIGNS.get(limits.family, 0.0))
        if (smallest := limits.transmission_angle_min_turn) and not limits.swings:
            table.add("transmission_angle_min_turn", codes.OVER_TURN, np.cos(smallest), smooth)
        for name, bound, sign in (("link_min", limits.link_min, 1.0), ("link_max", limits.link_max, -1.0)):
            if bound is not None:
                for k, prescribed in enumerate(limits.links):
                    if prescribed is None:  # prescribed lengths are within the bound
                        table.add(name, codes.LENGTH, k, sign, -sign * bound)
        if limits.link_ratio_max is not None:
            table.add("link_ratio_max", codes.RATIOS if self.smooth else codes.RATIO, limits.link_ratio_max)
        for k, length in enumerate(limits.links):
            if length is not None:
                table.add(f"links.{LINKS[k]}", codes.LENGTH, k, 1.0, -length, equal=True)
        if posed:
            self._on_pose(table)
        return table

    def _on_pose(self, table: _Table) -> None:
        limits, reach = self.limits, self.limits.pivot_reach
        for point, name in enumerate(PIVOTS):
            if (pivot := getattr(limits, name)) is not None:
                table.add(name, codes.AT, point, *_xy(pivot), equal=True)
                continue
            for box_name in (f"{name}_box", "pivot_box"):
                if (box := getattr(limits, box_name)) is not None:
                    table.add(box_name, codes.INSIDE, point, *box)
            if reach is not None and (radius := getattr(reach, name)) is not None:
                table.add("pivot_reach", codes.NEAR, point, *_xy(reach.middle), radius)
            for out in limits.keep_out:
                table.add("keep_out", codes.OUTSIDE, point, *out)
        if limits.coupler_radius_max is not None:
            table.add("coupler_radius_max", codes.NEAR, codes.BODY, 0.0, 0.0, limits.coupler_radius_max)
        if reach is not None and reach.body is not None:
            for point in (codes.BODY, codes.BODY_FROM_ROCKER):
                table.add("body_reach", codes.NEAR, point, 0.0, 0.0, reach.body)
        if limits.envelope is not None:
            spare = 0.0 if self.exact else SPARE
            x, y, right, upper = limits.envelope
            box = x + spare, y + spare, right - spare, upper - spare
            table.add("envelope", codes.ENVELOPE, *box, *_TRACED[self.exact])


def _xy(point: complex) -> tuple[float, float]:
    return point.real, point.imag


class _Table:
    """Rows of limits for the compiled kernel, with the name of each."""

    def __init__(self) -> None:
        self.rows: list[list[float]] = []
        self.names: list[str] = []
        self._equal: list[bool] = []

    def add(self, name: str, kind: int, *numbers: float, equal: bool = False) -> None:
        """Add a limit."""
        self.rows.append([kind, *numbers, *[0.0] * (7 - len(numbers))])
        self.names += [name] * codes.COUNTS[kind]
        self._equal += [equal] * codes.COUNTS[kind]

    @property
    def equal(self) -> Flags:
        """True for rows that are equations."""
        return np.array(self._equal, dtype=bool)


# -- checks of four-bars ------------------------------------------------------------------------------------------------


def keeps(target: Samples, limits: Limits, placed: Placed, rounding: float = 0.0) -> Flags:
    """Check which placed four-bars satisfy limits, (n,).

    Parameters
    ----------
    target : Samples
        Its mean position and length scale are the units of the constraints.
    limits : Limits
    placed : Placed
        In the user's unit.
    rounding : float
        Fraction of the longest length by which a limit may be violated.
    """
    if limits.family == "any":
        holds = transmission_angle_over(placed.lengths, placed.used) > 0
    else:
        holds = in_family(limits.family, placed.lengths)
    if limits.only_family:
        return holds
    middle, scale = 0j, 1.0
    if placed.pivot is not None:
        assert target.position is not None
        middle, scale = target.middle, target.length_scale
        placed = placed.over(middle, scale)
    found = Constraints(limits, middle, scale)(placed)
    size = np.maximum(placed.lengths.max(axis=1, keepdims=True), 1 + abs(middle) / scale)
    inside = np.where(found.equal, np.abs(found.values) <= EQUATION * size, found.values >= -rounding * size)
    if placed.pivot is not None:  # a linkage that has shrunk to a point satisfies many limits, but it is no answer
        inside = inside & (placed.lengths[:, :1] * scale > DEGENERATE * target.extent)
    return holds & np.all(inside, axis=1)
