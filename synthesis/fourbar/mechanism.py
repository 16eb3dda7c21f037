"""The four-bar as the scan and the search see it: what `synthesis.mechanism` asks of any mechanism."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.fourbar.charts import AnyChart, FullCrankChart
from synthesis.fourbar.dimension_types import OrderRule, TypeRule, enumerate_types
from synthesis.fourbar.kinematics import close_loop, coupler_angle, wrap
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.linkage import Linkage
from synthesis.fourbar.solution import Solution, assess, four, mounted
from synthesis.fourbar.within import bounded_types, keeps, ways, within
from synthesis.mechanism import Bounded, Placed
from synthesis.target import TURN, Target

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

_TABLE_PERIMETER = 40


class FourBar:
    """The four-bar whose coupler is the body; lengths are crank, coupler, rocker, ground."""

    branches = (1, -1)

    @cached_property
    def coarse_types(self) -> Floats:
        """Crank-rockers and double-cranks of whole lengths and a small perimeter."""
        return enumerate_types(TypeRule(_TABLE_PERIMETER, 1, OrderRule.FULL_CRANK)).astype(float)

    def winding(self, lengths: Floats) -> NDArray[np.int8]:
        """One for double-cranks, whose coupler turns with the crank; for full cranks only."""
        return (lengths[:, 0] > lengths[:, 3]).astype(np.int8)

    def body_angle(self, lengths: Floats, branch: ArrayLike, crank: Floats) -> Floats:
        """The coupler angle."""
        return coupler_angle(lengths, branch, crank)

    def body_angle_gradient(self, lengths: Floats, branch: ArrayLike, crank: Floats) -> tuple[Floats, Floats]:
        """The coupler angle and its derivatives by the four lengths and theta1."""
        closure = close_loop(lengths, crank)
        return closure.coupler_angle(branch), closure.coupler_angle_gradient(branch)

    def in_family(self, family: str, lengths: Floats) -> NDArray[np.bool_]:
        """Which full-crank types are of a family of `limits.FAMILIES`."""
        longer = lengths[:, 0] > lengths[:, 3]
        return {"crank_rocker": ~longer, "double_crank": longer}.get(family, np.ones(len(lengths), dtype=bool))

    def charts(self, family: str) -> list[Any]:
        """Full cranks first; all four-bars after them where any family will do."""
        if family == "any":
            return [FullCrankChart(), AnyChart()]
        return [FullCrankChart({"crank_rocker": -1, "double_crank": 1}.get(family, 0))]

    def bounded(self, target: Target, limits: Limits) -> list[Bounded]:
        """The ways to look within limits; see `within.ways`."""
        return ways(target, limits)

    def bounded_types(self, family: str) -> Floats:
        """Coarse types of a family, change points among them."""
        return bounded_types(family)

    def keeps(self, target: Target, limits: Limits, placed: Placed) -> NDArray[np.bool_]:
        """Which linkages keep limits."""
        return keeps(target, limits, placed)

    def within(self, target: Target, limits: Limits, solutions: list[Solution]) -> list[Solution]:
        """The solutions that keep limits."""
        return within(target, limits, solutions)

    def mounted(self, target: Target, lengths: Floats, branch: ArrayLike, start: Floats) -> list[Linkage]:
        """Linkages in their best pose."""
        return mounted(target, lengths, branch, start)

    def posed(
        self, lengths: Floats, branch: Floats, start: Floats, pose: tuple[Complexes, Floats, Complexes] | None
    ) -> list[Linkage]:
        """Linkages in a given pose."""
        linkages = [
            Linkage(four(row), int(side), float(at))
            for row, side, at in zip(lengths, branch, np.asarray(start) % TURN)
        ]
        if pose is None:
            return linkages
        return [
            one.placed(complex(a), wrap(turn), (float(abs(z)), wrap(float(np.angle(z)) - turn)))
            for one, a, turn, z in zip(linkages, *pose)
        ]

    def assess(self, target: Target, linkages: list[Linkage], rows: list[int] | None = None) -> list[Solution]:
        """Linkages with their errors."""
        return assess(target, linkages, rows)


class RockerOutput(FourBar):
    """The four-bar whose rocker is the body: it turns as the coupler of the linkage with coupler and rocker exchanged.

    Law: theta3(L1, L2, L3, L4; branch) = theta2(L1, L3, L2, L4; -branch) + pi, up to whole turns.
    """

    def body_angle(self, lengths: Floats, branch: ArrayLike, crank: Floats) -> Floats:
        """The rocker angle."""
        return super().body_angle(lengths[:, _EXCHANGED], -np.asarray(branch), crank) + np.pi

    def body_angle_gradient(self, lengths: Floats, branch: ArrayLike, crank: Floats) -> tuple[Floats, Floats]:
        """The rocker angle and its derivatives by the four lengths and theta1."""
        angle, slope = super().body_angle_gradient(lengths[:, _EXCHANGED], -np.asarray(branch), crank)
        return angle + np.pi, slope[..., [*_EXCHANGED, 4]]


_EXCHANGED = [0, 2, 1, 3]

FOURBAR = FourBar()
"""The mechanism of the atlas and of `synthesize`."""
ROCKER = RockerOutput()
"""The mechanism of rocker curves."""
