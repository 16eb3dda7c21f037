"""Choose actuators from a catalogue: the rows that are strong enough at their best placement."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from synthesis.drives.placement_search import GridPlacements, PlacementSearch
from synthesis.drives.placements import Actuator, Placement, Refusal, Sizes
from synthesis.work import UNLIMITED, Work


@dataclass(frozen=True)
class CatalogueRow:
    """An actuator of a catalogue."""

    name: str
    actuator: Actuator
    push: float = np.inf
    """Largest pushing force."""
    pull: float = np.inf
    """Largest pulling force."""
    price: float | None = None
    rod: float | None = None
    """Diameter of its rod."""

    def can_carry(self, placement: Placement) -> bool:
        """Check that a placement's forces do not exceed the actuator's."""
        return bool(placement.force.max() <= self.push and -placement.force.min() <= self.pull)


class FittingRow(NamedTuple):
    """A row of a catalogue at its best placement."""

    row: CatalogueRow
    placement: Placement


class UnfitRow(NamedTuple):
    """A row of a catalogue that does not fit, with the reason."""

    row: CatalogueRow
    why: Refusal | float
    """Why there is no placement, or the smallest peak force, which the actuator cannot give."""


def choose_rows(
    search: PlacementSearch, rows: list[CatalogueRow], max_results: int, work: Work = UNLIMITED, max_descents: int = 3
) -> tuple[list[FittingRow], list[UnfitRow]]:
    """Return the cheapest rows of a catalogue that fit, and why others do not.

    Without prices the weakest rows come first, and among equal rows the row with the smallest peak force on the grid. A row
    whose force is below the lower bound of all placements is not searched for, and more expensive rows are not evaluated once
    enough are found.

    Parameters
    ----------
    search : PlacementSearch
    rows : list of CatalogueRow
    max_results : int
        Largest number of fitting rows.
    work : Work, optional
    max_descents : int
        Number of descents for a row.

    Returns
    -------
    fitting : list of FittingRow
    unfit : list of UnfitRow
    """
    found: list[FittingRow] = []
    unfit: list[UnfitRow] = []
    has_prices = any(row.price is not None for row in rows)

    def cost(row: CatalogueRow) -> tuple[float, float]:
        return (np.inf if row.price is None else row.price) if has_prices else 0.0, max(row.push, row.pull)

    @cache  # rows of equal sizes share their placements
    def screened(actuator: Actuator) -> GridPlacements | Refusal:
        return search.screen([actuator], max_descents)

    @cache
    def placed(actuator: Actuator) -> Placement | Refusal:
        return search.descend(screened(actuator), Sizes(actuator), work)

    def is_over() -> bool:
        return len(found) >= max_results or work.expired()

    for level in sorted({cost(row) for row in rows}):
        if is_over():
            break
        candidates = []
        for row in (row for row in rows if cost(row) == level):
            bound = search.force_bound(row.actuator.stroke)
            if search.loaded and bound > max(row.push, row.pull):
                unfit.append(UnfitRow(row, bound))
            elif isinstance(starts := screened(row.actuator), Refusal):
                unfit.append(UnfitRow(row, starts))
            else:
                candidates.append((-starts.best_value, row))
        first = len(found)
        for _, row in sorted(candidates, key=lambda candidate: candidate[0]):
            if is_over():
                break
            placement = placed(row.actuator)
            if isinstance(placement, Refusal):
                unfit.append(UnfitRow(row, placement))
            elif search.loaded and not row.can_carry(placement):
                unfit.append(UnfitRow(row, placement.peak))
            else:
                found.append(FittingRow(row, placement))
        found[first:] = sorted(found[first:], key=lambda fit: fit.placement.worst)
    return found, unfit
