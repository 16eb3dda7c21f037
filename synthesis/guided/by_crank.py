"""Slider-cranks and swinging blocks for motions with given crank angles: `linkages_by_crank`, the search of all mechanisms.

Example::

    solutions, report = linkages_by_crank(Kind.SLIDER_CRANK, target, family="any", top=10, tolerance=1e-10, work=work)

The `Linkage` of each solution is driven by its crank and has the frame of the body in the motion. The search satisfies only the
limit on the family; callers check other limits and can continue from the result.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from synthesis.arrays import Complexes, Flags, Floats
from synthesis.guides import Circle, Driver, Kind, Rail, Slot
from synthesis.linkage import Linkage, on_guides
from synthesis.mechanism import Bounded, Constrained, Placed
from synthesis.pose import fit_positions
from synthesis.search.report import SearchReport
from synthesis.search.search import DEFAULT_TOLERANCE, search
from synthesis.search.seeds import SeedTables
from synthesis.slider import FULL_CHARTS, RAIL, SliderTurning
from synthesis.solution import Solution, assess
from synthesis.target import Target
from synthesis.work import Work

Family = Literal["full_crank", "any"]


class _NoLimits:
    """No limits: solutions are checked afterwards."""

    any = False

    def __call__(self, placed: Placed, derivatives: bool = True) -> Constrained:
        count, width = placed.lengths.shape
        return Constrained(np.empty((count, 0)), np.empty((count, 0, width + 7)), np.empty(0, dtype=bool), [])

    def compiled(self, posed: bool) -> Any:
        """None."""
        return None


@dataclass(frozen=True)
class SliderLimits:
    """Limits of a search for these kinds: only the family."""

    family: Family = "any"
    only_family: bool = True

    def mirrored(self) -> SliderLimits:
        """Return the limits unchanged, since both families contain their mirror images."""
        return self


class CrankGuided(SliderTurning):
    """A kind of linkage with a crank and a rail or a slot, with what the search needs of its linkages."""

    def bounded(self, target: Target, limits: Any) -> list[Bounded]:
        """Searches without limits, for motions that no linkage makes exactly."""
        nothing = _NoLimits()
        return [Bounded(chart, nothing, nothing, None) for chart in self.charts(limits.family)]

    def keeps(self, target: Target, limits: Any, placed: Placed) -> Flags:
        """Return all candidates, since only the family is limited and tables contain full cranks."""
        return np.ones(len(placed.lengths), dtype=bool)

    def within(self, target: Target, limits: Any, solutions: list[Solution]) -> list[Solution]:
        """The solutions of the family that close over the interval."""
        return [
            solution
            for solution in solutions
            if np.isfinite(solution.errors.objective)
            and solution.transmission_angle_min > 0
            and (limits.family == "any" or solution.linkage.turns_fully)
        ]

    # -- linkages -----------------------------------------------------------------------------------------------------

    def mounted(self, target: Target, lengths: Floats, branch: ArrayLike, start: Floats) -> list[Linkage]:
        """Linkages in their best pose; without positions in the origin, the rod or the ground 1."""
        lengths, start = np.atleast_2d(np.asarray(lengths, dtype=float)), np.asarray(start, dtype=float)
        if target.position is None or not len(lengths):
            return self.posed(lengths / lengths[:, 1:2], np.ones(len(lengths)), start, None)
        fit = fit_positions(target, self.body_angle(lengths, branch, start[:, None] + target.crank))
        lengths = lengths * (np.abs(fit.crank_vector) / lengths[:, 0])[:, None]
        return self.posed(
            lengths, np.ones(len(lengths)), start, (fit.pivot, np.angle(fit.crank_vector) - start, fit.coupler_vector)
        )

    def posed(
        self, lengths: Floats, branch: Floats, start: Floats, pose: tuple[Complexes, Floats, Complexes] | None
    ) -> list[Linkage]:
        """Linkages in a given pose; their body turns as the rod, or the slot, does."""
        count = len(lengths)
        pivot, turn, arm = (
            (np.zeros(count, dtype=complex), np.zeros(count), np.zeros(count)) if pose is None else pose
        )
        return [
            self._linkage(
                (row[0], row[1], row[2]), float(at), complex(a), float(angle), complex(z * np.exp(-1j * angle))
            )
            for row, at, a, angle, z in zip(lengths.tolist(), start, pivot, turn, arm)
        ]

    def _linkage(
        self, lengths: tuple[float, float, float], start: float, pivot: complex, turn: float, arm: complex
    ) -> Linkage:
        """``arm``: from the crank pin to the body point, in the frame of rod or slot."""
        crank, long, offset = lengths
        along = complex(np.exp(1j * turn))
        second: Rail | Slot
        if self.guide == RAIL:
            second = Rail(pivot + 1j * offset * along, turn, long - arm)
        else:
            second = Slot(pivot + long * along, 1j * offset - arm, 0.0)
        return on_guides((Circle(pivot, crank, -arm), second), Driver.CRANK, 1, start + turn)

    def assess(
        self, target: Target, linkages: Sequence[Linkage], /, *, rows: Sequence[int] | None = None
    ) -> list[Any]:
        """Return the linkages with their errors."""
        return assess(target, linkages, rows=rows)


BY_CRANK = {kind: CrankGuided(kind, FULL_CHARTS[kind]) for kind in (Kind.SLIDER_CRANK, Kind.SWINGING_BLOCK)}
"""The mechanisms of this module by their kind."""


@cache
def seed_tables(kind: Kind) -> SeedTables:
    """Coarse types of a kind, prepared for searches by the first that asks."""
    return SeedTables(BY_CRANK[kind])


def linkages_by_crank(
    kind: Kind,
    target: Target,
    family: Family = "any",
    top: int = 10,
    tolerance: float = DEFAULT_TOLERANCE,
    work: Work | None = None,
) -> tuple[list[Solution], SearchReport]:
    """Find the best linkages of a kind for a motion with given crank angles: positions, rotations or both.

    Parameters
    ----------
    kind : {Kind.SLIDER_CRANK, Kind.SWINGING_BLOCK}
    target : Target
    family : {"full_crank", "any"}
        With "full_crank" the crank must be able to turn fully; otherwise it only has to reach all samples.
    top : int
        Largest number of solutions; they differ from each other, best first.
    tolerance : float
        Objective below which the search ends.
    work : Work, optional
        When it has expired, the best solutions so far are returned.

    Returns
    -------
    solutions : list of Solution
        Linkages driven by their crank; only the limit on the family is satisfied. A mirrored target gives the mirrored linkages.
    report : SearchReport
    """
    return search(seed_tables(kind), target, SliderLimits(family), top, tolerance, work)
