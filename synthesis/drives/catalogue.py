"""Choose actuators from a catalogue: the rows that are strong enough at their best placement."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from synthesis.drives.placement_search import GridPlacements, PlacementSearch
from synthesis.drives.placements import Actuator, Placement, Refusal, Sizes
from synthesis.work import Work


@dataclass(frozen=True)
class CatalogueOptions:
    """Effort that is spent on each row of a catalogue."""

    max_descents: int = 3
    """Number of descents for a row."""
    near_miss: float = 1.1
    """Ratio of needed and available force up to which the placement of a row is improved by restarts."""


OPTIONS = CatalogueOptions()


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

    def can_carry(self, placement: Placement, factor: float = 1.0) -> bool:
        """Check that a placement's forces do not exceed the actuator's by more than a factor."""
        return bool(placement.force.max() <= factor * self.push and -placement.force.min() <= factor * self.pull)


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
    search: PlacementSearch,
    rows: list[CatalogueRow],
    max_results: int,
    work: Work | None = None,
    options: CatalogueOptions = OPTIONS,
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
    options : CatalogueOptions

    Returns
    -------
    fitting : list of FittingRow
    unfit : list of UnfitRow
    """
    selection = _Selection(search, work, options)
    found: list[FittingRow] = []
    has_prices = any(row.price is not None for row in rows)

    def cost(row: CatalogueRow) -> tuple[float, float]:
        return (np.inf if row.price is None else row.price) if has_prices else 0.0, max(row.push, row.pull)

    for level in sorted({cost(row) for row in rows}):
        if len(found) >= max_results or (work is not None and work.expired()):
            break
        fitting: list[FittingRow] = []
        for row in selection.promising([row for row in rows if cost(row) == level]):
            if len(found) + len(fitting) >= max_results or (work is not None and work.expired()):
                break
            placement = selection.placement_of(row)
            if placement is not None:
                fitting.append(FittingRow(row, placement))
        found += sorted(fitting, key=lambda fit: fit.placement.worst)
    return found, selection.unfit


class _Selection:
    """Placements of catalogue rows; rows of equal sizes share them."""

    def __init__(self, search: PlacementSearch, work: Work | None, options: CatalogueOptions) -> None:
        self.search, self.options = search, options
        self.unfit: list[UnfitRow] = []

        @cache
        def screened(actuator: Actuator) -> GridPlacements | Refusal:
            return search.screen([actuator], options.max_descents)

        @cache
        def placed(actuator: Actuator) -> Placement | Refusal:
            return search.descend(screened(actuator), Sizes(actuator), work, restart=False)

        @cache
        def improved(actuator: Actuator) -> Placement | Refusal:
            placement = placed(actuator)
            return placement if isinstance(placement, Refusal) else search.restart_from(placement, Sizes(actuator))

        self._screened, self._placed, self._improved = screened, placed, improved

    def promising(self, rows: list[CatalogueRow]) -> list[CatalogueRow]:
        """Return the rows that may fit, the most promising first, and note why the others do not."""
        search, candidates = self.search, []
        for row in rows:
            bound = search.force_bound(row.actuator.stroke)
            if search.loaded and bound > max(row.push, row.pull):
                self.unfit.append(UnfitRow(row, bound))
                continue
            starts = self._screened(row.actuator)
            if isinstance(starts, Refusal):
                self.unfit.append(UnfitRow(row, starts))
            else:
                candidates.append((-starts.best_value, row))
        candidates.sort(key=lambda candidate: candidate[0])
        return [row for _, row in candidates]

    def placement_of(self, row: CatalogueRow) -> Placement | None:
        """Return the best placement of a row that can carry the load; otherwise note why there is none."""
        search = self.search
        placement = self._placed(row.actuator)
        if isinstance(placement, Placement):
            if not search.loaded or row.can_carry(placement, self.options.near_miss):
                placement = self._improved(row.actuator)
        if isinstance(placement, Refusal):
            self.unfit.append(UnfitRow(row, placement))
            return None
        if search.loaded and not row.can_carry(placement):
            self.unfit.append(UnfitRow(row, placement.peak))
            return None
        return placement
