"""Where a search begins: candidates from coarse tables of a mechanism's types, from grids, and from the best found so far.

Different seeds find more than many seeds: the best rows of a dense table lie in one valley.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.atlas.scan import Scan
from synthesis.atlas.table import make_table
from synthesis.mechanism import Mechanism
from synthesis.search.windows import Windows
from synthesis.target import TURN, Target

Floats = NDArray[np.float64]

_SAMPLES = 64
_STARTS = 24
_SERIES_ERROR = 1e-3
_HARMONICS = (6, 20)


class Candidates(NamedTuple):
    """Starting points or results: unknowns of a chart with the start behind them (n, k + 1), branch (n,) and cost (n,)."""

    unknowns: Floats
    branch: Floats
    cost: Floats

    @classmethod
    def none(cls, size: int) -> Candidates:
        """No candidates, of ``size`` unknowns."""
        return cls(np.empty((0, size)), np.empty(0), np.empty(0))

    def take(self, index: NDArray[np.generic]) -> Candidates:
        """The candidates at some places."""
        return Candidates(*(column[index] for column in self))

    def joined(self, *others: Candidates) -> Candidates:
        """These and others, in order."""
        return Candidates(*(np.concatenate(columns) for columns in zip(self, *others)))

    def thinned(self, count: int, cell: float = 0.05) -> Candidates:
        """The best ``count``, at most one a small cell of shape, start and branch."""
        best = self.take(np.argsort(self.cost, kind="stable"))
        best = best.take(np.isfinite(best.cost))
        start = best.unknowns[:, -1:]
        place = np.hstack([best.unknowns[:, :-1], np.cos(start), np.sin(start), best.branch[:, None]])
        _, first = np.unique(np.round(place / cell).astype(np.int64), axis=0, return_index=True)
        return best.take(np.sort(first)[:count])


class SeedTable(NamedTuple):
    """A coarse table of types, prepared for seeds."""

    scan: Scan
    unknowns: Floats
    """Of the types, in the mechanism's first chart."""


class SeedTables:
    """The coarse tables of a mechanism, coarse to fine, enumerated and prepared once (2.7 MB for the four-bar)."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self._windows: dict[str, Windows] = {}
        chart = mechanism.charts("full_crank")[0]
        self.tables = [
            SeedTable(
                Scan(make_table(mechanism, lengths, _SAMPLES), _STARTS, _SERIES_ERROR, _HARMONICS, cells=False),
                chart.unknowns(lengths),
            )
            for lengths in mechanism.tables
        ]

    def windows(self, family: str) -> Windows:
        """The windows of a family's types for a search within limits; made by the first that asks."""
        if family not in self._windows:
            self._windows[family] = Windows(self.mechanism, self.mechanism.bounded_types(family))
        return self._windows[family]

    @property
    def nbytes(self) -> int:
        """Memory of all tables."""
        return sum(table.scan.nbytes + table.unknowns.nbytes for table in self.tables)

    def best_starts(self, index: int, target: Target, family: str) -> Candidates:
        """Best start of each type and branch of a table for a target, thinned out over cells of the chart, best first."""
        scan, shapes = self.tables[index]
        error = scan.error_table(target)
        error[~self.mechanism.in_family(family, scan.lengths)] = np.inf
        best = error.argmin(axis=2)
        cost = np.take_along_axis(error, best[:, :, None], 2)[:, :, 0]
        chart = self.mechanism.charts(family)[0]
        parts = Candidates.none(len(chart.cell))
        for side, branch in enumerate(self.mechanism.branches):
            start = best[:, side] * (TURN / scan.starts)
            unknowns = np.hstack([shapes, start[:, None]])
            parts = parts.joined(Candidates(unknowns, np.full(len(start), float(branch)), cost[:, side]))
        parts = parts.take(np.isfinite(parts.cost))
        parts = parts.take(np.argsort(parts.cost, kind="stable"))
        cells = np.column_stack([np.floor(parts.unknowns / chart.cell), parts.branch]).astype(np.int64)
        # one number a cell: many times faster to sort than rows
        _, first = np.unique((cells + 64) @ (1 << 8 * np.arange(cells.shape[1])), return_index=True)
        return parts.take(np.sort(first))
