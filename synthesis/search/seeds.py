"""Where a search begins: candidates from coarse tables of a mechanism's types, from grids, and from the best found so far.

Different seeds find more than many seeds: the best rows of a dense table lie in one valley.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.atlas.scan import Scan
from synthesis.atlas.table import make_table
from synthesis.mechanism import Mechanism
from synthesis.pose import whole_turns
from synthesis.search.windows import Windows
from synthesis.target import TURN, Target

Floats = NDArray[np.float64]

_SAMPLES = 64
_STARTS = 24
_SERIES_ERROR = 1e-3
_HARMONICS = (6, 20)
_GIVEN_SAMPLES = 8


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
    curves: Floats
    """Periodic part of theta2 of branch +1 over the turn, the first sample again at its end, (T, samples + 1)."""
    winding: Floats
    """Turns of the body in one turn of the crank, (T,)."""

    def errors(self, target: Target) -> tuple[Floats, Floats]:
        """Squared errors (T, branches, starts) where offset or start are given, from interpolated curves; and the starts."""
        assert target.rotation is not None
        few = target.thinned(_GIVEN_SAMPLES)
        assert few.rotation is not None
        starts: Floats = np.linspace(0.0, TURN, self.scan.starts, endpoint=False)
        if target.start is not None:
            starts = np.array([target.start % TURN])
        found: list[Any] = []
        for branch in self.scan.mechanism.branches:
            # branch -1 at -theta1 is branch +1 mirrored
            crank = branch * (starts[:, None] + few.crank)
            place = crank % TURN * ((self.curves.shape[1] - 1) / TURN)
            left = np.minimum(place.astype(np.intp), self.curves.shape[1] - 2)
            before = self.curves[:, left]
            angle = before + (place - left) * (self.curves[:, left + 1] - before)
            angle += self.winding[:, None, None] * crank
            gap = few.rotation - branch * angle
            mean = few.rotation_mean(gap)
            rest = few.rotation_mean((gap - mean[..., None]) ** 2)
            if few.offset is not None:
                rest += (mean - few.offset - whole_turns(mean - few.offset)) ** 2
            found.append(rest)
        return np.stack(found, axis=1), starts


class SeedTables:
    """The coarse types of a mechanism, prepared once: a table for the first rounds, windows for a search within limits."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self._windows: dict[str, Windows] = {}
        lengths = mechanism.coarse_types
        table = make_table(mechanism, lengths, _SAMPLES)
        curves = table.curves()
        self.table = SeedTable(
            Scan(table, _STARTS, _SERIES_ERROR, _HARMONICS, cells=False),
            mechanism.charts("full_crank")[0].unknowns(lengths),
            np.hstack([curves, curves[:, :1]]),
            table.winding.astype(float),
        )

    def windows(self, family: str) -> Windows:
        """The windows of a family's types for a search within limits; made by the first that asks."""
        if family not in self._windows:
            self._windows[family] = Windows(self.mechanism, self.mechanism.bounded_types(family))
        return self._windows[family]

    @property
    def nbytes(self) -> int:
        """Memory of the table."""
        return self.table.scan.nbytes + self.table.unknowns.nbytes + self.table.curves.nbytes

    def best_starts(self, target: Target, family: str) -> Candidates:
        """Best start of each type and branch of the table for a target, thinned out over cells of the chart, best first."""
        table = self.table
        scan, shapes = table.scan, table.unknowns
        if target.start is None and target.offset is None:
            error, starts = scan.error_table(target), np.arange(scan.starts) * (TURN / scan.starts)
        else:
            error, starts = table.errors(target)
        error[~self.mechanism.in_family(family, scan.lengths)] = np.inf
        best = error.argmin(axis=2)
        cost = np.take_along_axis(error, best[:, :, None], 2)[:, :, 0]
        chart = self.mechanism.charts(family)[0]
        parts = Candidates.none(len(chart.cell))
        for side, branch in enumerate(self.mechanism.branches):
            start = starts[best[:, side]]
            unknowns = np.hstack([shapes, start[:, None]])
            parts = parts.joined(Candidates(unknowns, np.full(len(start), float(branch)), cost[:, side]))
        parts = parts.take(np.isfinite(parts.cost))
        parts = parts.take(np.argsort(parts.cost, kind="stable"))
        cells = np.column_stack([np.floor(parts.unknowns / chart.cell), parts.branch]).astype(np.int64)
        # one number a cell: many times faster to sort than rows
        _, first = np.unique((cells + 64) @ (1 << 8 * np.arange(cells.shape[1])), return_index=True)
        return parts.take(np.sort(first))
