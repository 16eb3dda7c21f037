"""Initial candidates: from coarse tables of the types of a mechanism, from grids, and from the best results so far.

Diversity of seeds matters more than their number: the best rows of a dense table lie in the same basin.

**Within limits** seeds are windows of a coarse table in the best pose within the limits.
A window is a type, a start and a branch. With e = e^{i t} and E = e^{i theta2} at the samples, its position is linear,

    P = A (1 - rho e) + B rho e + z2 E,      rho = L1 / L4 e^{i start}

z2 is eliminated, and a quadratic form in A and B remains, isotropic in each: clipping A and B to their boxes in turn is a
coordinate descent to the best pair within them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Complexes, Floats, Singles, rows_at
from synthesis.constraints import Constraints
from synthesis.descents import Pool, Timed
from synthesis.four_bar import coupler_angle
from synthesis.fourbar.mechanism import BRANCHES, GrashofChart, bounded_types, coarse_types
from synthesis.limits import in_family
from synthesis.mechanism import Boxes, Chart, Placed
from synthesis.search.error_table import ErrorTable
from synthesis.search.prescribed import GivenProblem, candidates_at
from synthesis.target import TURN, Mean, Target

# -- windows within limits -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SeedOptions:
    """Options of the seeds from coarse tables."""

    steps: int = 144
    """Number of crank angles in the table of a type."""
    samples: int = 12
    """Number of samples with which windows are compared."""
    missing_max: float = 0.2
    """Largest transmission angle in radians that a window may lack before its pose is fitted."""
    count: int = 100
    """Default number of seeds."""
    posed: int = 80
    """Number of windows for each seed whose pose is fitted within boxes."""
    checked: int = 25
    """Number of these windows whose other limits are evaluated."""
    sweeps: int = 12
    """Number of sweeps that fit a pose within boxes."""
    spare: float = 1.25
    """Factor by which the ratios of a type may exceed those of the limits."""
    table_samples: int = 64
    """Number of samples with which the coarse table is compared."""
    starts: int = 24
    """Number of starts of each type in the coarse table."""
    harmonics: int = 20
    """Number of harmonics of a series in the coarse table, which leave less than a thousandth of a radian."""
    given_samples: int = 8
    """Number of samples with which starts of given lengths are compared."""


OPTIONS = SeedOptions()


STARTS = 24
FINER = 4
"""Times the starts and steps of few types."""


class Windows:
    """The windows of coarse types, their angles prepared once (2 MB).

    Single precision is finer than the table, and halves the time of a screen. ``finer``: times the usual starts and steps.
    """

    def __init__(self, lengths: Floats, finer: int = 1) -> None:
        self.lengths = lengths
        self.starts, self.steps = STARTS * finer, OPTIONS.steps * finer
        grid = np.linspace(0, TURN, self.steps + 1)
        tables = np.stack([coupler_angle(lengths, side, grid) for side in BRANCHES])
        self.wound = np.nan_to_num(tables[:, :, -1] - tables[:, :, 0]).astype(np.float32)
        self.tables = tables.astype(np.float32)

    def angles(self, side: int, crank: Floats, window: NDArray[np.intp]) -> Singles:
        """Return theta2 of windows (n,) of a branch at crank angles (N,) after their starts, (n, N)."""
        table, wound = self.tables[side], self.wound[side]
        table_position = (np.arange(self.starts)[:, None] * (TURN / self.starts) + crank) * (self.steps / TURN)
        turn, remainder = np.divmod(table_position, self.steps)
        low = np.minimum(remainder.astype(np.intp), self.steps - 1)
        part, turn = (remainder - low).astype(np.float32), turn.astype(np.float32)
        kind, start = np.divmod(window, self.starts)
        cell = low[start] + (kind * table.shape[1])[:, None]
        before = table.ravel()[cell]
        cell += 1
        after = table.ravel()[cell]
        return before + (after - before) * part[start] + turn[start] * wound[kind][:, None]

    def seeds(
        self, problem: GivenProblem, on_shape: Constraints, boxes: Boxes | None = None, count: int = OPTIONS.count
    ) -> Timed:
        """Return windows ordered by their motion and their violation of limits, best first, at most one in each cell.

        Parameters
        ----------
        problem : GivenProblem
        on_shape : Constraints
            Limits that concern only shape and start; windows with a large violation are omitted.
        boxes : Boxes, optional
            Boxes for limits that concern the pose.
        count : int
            Approximate number of useful seeds; a smaller number reduces the number of windows that are evaluated closely.
        """
        target = problem.target.condensed(OPTIONS.samples)
        types, starts = len(self.lengths), self.starts
        start = np.tile(np.arange(starts) * (TURN / starts), types)
        lengths = np.repeat(self.lengths, starts, axis=0)
        miss = _missed(on_shape, Placed(lengths, np.ones(len(start)), target.interval.after(start)))
        reach = None
        if boxes is not None:
            shortest, largest = boxes.reach(self.lengths)
            reach = np.repeat(shortest, starts), np.repeat(largest, starts)
            miss = np.where(reach[0] > OPTIONS.spare * reach[1], np.inf, miss)
        windows, sides, angles = [], [], []
        for side, sign in enumerate(BRANCHES):
            close = np.flatnonzero(miss < OPTIONS.missing_max)
            angle = self.angles(side, target.crank, close)
            closed = np.isfinite(angle).all(axis=1)
            windows.append(close[closed])
            sides.append(np.full(closed.sum(), float(sign)))
            angles.append(angle[closed])
        window, branch, angle = np.concatenate(windows), np.concatenate(sides), np.concatenate(angles)
        fits = Fits.of(target, angle)
        merit = fits.rotation + fits.position + 3 * miss[window] ** 2
        if problem.posed:
            assert boxes is not None and reach is not None
            best = _smallest(merit, OPTIONS.posed * count)
            window, branch, fits = window[best], branch[best], rows_at(fits, best)
            chosen = lengths[window]
            turned: Complexes = np.exp(1j * start[window])
            error, pivot, ground, coupler = fits.within(
                turned * (chosen[:, 0] / chosen[:, -1]), boxes, (reach[0][window], reach[1][window])
            )
            merit = error + fits.rotation + miss[window] ** 2
            best = _smallest(merit, OPTIONS.checked * count)
            window, branch, merit = window[best], branch[best], merit[best]
            pivot, ground, coupler = pivot[best], ground[best], coupler[best]
            chosen = lengths[window]
            pose = np.stack([pivot, ground * (chosen[:, 0] / chosen[:, -1]), coupler], axis=1)
            timed = candidates_at(problem.chart.unknowns(chosen), branch, start[window], pose)
            merit = merit + problem.lacking(timed)[0]
        else:
            best = _smallest(merit, OPTIONS.checked * count)
            window, branch, merit = window[best], branch[best], merit[best]
            timed = candidates_at(problem.chart.unknowns(lengths[window]), branch, start[window])
        order = np.argsort(merit, kind="stable")
        order = order[np.isfinite(merit[order])]
        coordinates = np.hstack(
            [problem.chart.shape_coordinates(timed.shape), timed.angles / 0.6, timed.branch[:, None]]
        )
        return timed.take(order[first_in_cells(coordinates[order])])


def first_in_cells(coordinates: Floats) -> NDArray[np.intp]:
    """Return the indices of the first point (n, m) in each unit cell, in their order."""
    cells = np.floor(coordinates).astype(np.int64)
    # a single number for each cell: many times faster to sort than rows
    _, first = np.unique((cells + 64) @ (1 << 8 * np.arange(cells.shape[1])), return_index=True)
    return np.sort(first)


def _smallest(merit: Floats, count: int) -> NDArray[np.intp]:
    """Places of the least values, in their order."""
    if len(merit) <= count:
        return np.arange(len(merit))
    return np.sort(np.argpartition(merit, count)[:count])


def _missed(on_shape: Constraints, placed: Placed) -> Floats:
    """Return the largest violation of limits on shape and start only; infinite if a linkage does not close."""
    found = on_shape(placed, derivatives=False)
    return np.nan_to_num(np.max(found.lacking, axis=1, initial=0.0), nan=np.inf)


class Fits(NamedTuple):
    """Inner products of windows with the positions over l, <f, g> = mean(conj(f) g), after z2 E is taken out; (n,) each."""

    rotation: Floats
    """Mean square of the rotation's error."""
    position: Floats
    """Mean square of the error of the position in the best pose."""
    one_one: Floats
    one_turned: Complexes
    turned_turned: Floats
    one_rest: Complexes
    turned_rest: Complexes
    rest: Floats
    share: Complexes
    """(n, 3): <E, 1>, <E, e>, <E, P>."""

    @classmethod
    def of(cls, target: Target, angle: Singles) -> Fits:
        """Compute the products for angles (n, N) of windows."""
        rotation = np.zeros(len(angle))
        if target.rotation is not None:
            mean = target.rotation_mean
            gap = (target.rotation - mean(target.rotation)).astype(np.float32) - angle
            part = np.broadcast_to(mean.root**2, gap.shape[1]).astype(np.float32)
            gap -= (gap @ part)[:, None]
            rotation = ((gap * gap) @ part).astype(float)
        nothing = np.zeros(len(angle))
        if target.position is None:
            share: Complexes = np.zeros((len(angle), 3), dtype=np.complex128)
            no = share[:, 0]
            return cls(rotation, nothing, nothing, no, nothing, no, no, nothing, share)
        mean = target.position_mean
        turned = np.exp(1j * target.crank)
        centred = (target.position - mean(target.position)) / target.length_scale
        columns = np.stack([mean.weighted(c) / mean.total for c in (turned**0, turned, centred)], axis=1)
        back = np.empty(angle.shape, dtype=np.complex64)
        np.cos(angle, out=back.real)
        np.negative(np.sin(angle), out=back.imag)
        share = (back @ columns.astype(np.complex64)).astype(complex)
        return cls._of(rotation, share, mean(turned), mean(np.conj(turned) * centred), mean(np.abs(centred) ** 2))

    @classmethod
    def of_candidates(cls, mean: Mean, centred: Complexes, crank: Complexes, body: Complexes) -> Fits:
        """Of candidates with their own crank angles: positions over l (N,), e^{i crank angle} and e^{i theta2}, (n, N) each."""
        back = np.conj(body)
        share = np.stack([mean(back), mean(back * crank), mean(back * centred)], axis=1)
        rotation, square = np.zeros(len(crank)), mean(np.abs(centred) ** 2)
        return cls._of(rotation, share, mean(crank), mean(np.conj(crank) * centred), np.full(len(crank), square))

    @classmethod
    def _of(cls, rotation: Floats, share: Complexes, along: Any, across: Any, square: Any) -> Fits:
        mean_body, own, held = share.T
        one_one, turned_turned = 1 - np.abs(mean_body) ** 2, 1 - np.abs(own) ** 2
        one_turned = along - np.conj(mean_body) * own
        one_rest, turned_rest = -np.conj(mean_body) * held, across - np.conj(own) * held
        square_left = square - np.abs(held) ** 2
        determinant = np.maximum(one_one * turned_turned - np.abs(one_turned) ** 2, 1e-12)
        free = (
            turned_turned * np.abs(one_rest) ** 2
            + one_one * np.abs(turned_rest) ** 2
            - 2 * (np.conj(one_rest) * one_turned * turned_rest).real
        ) / determinant
        smallest = np.clip(square_left - free, 0.0, None)
        return cls(rotation, smallest, one_one, one_turned, turned_turned, one_rest, turned_rest, square_left, share)

    def within(
        self, rho: Complexes, boxes: Boxes, reach: tuple[Floats, Floats]
    ) -> tuple[Floats, Complexes, Complexes, Complexes]:
        """Mean square of the position's error, A, B - A and z2 with the pivots in boxes and |B - A| within a reach."""
        size = np.abs(rho) ** 2
        aa = self.one_one - 2 * (rho * self.one_turned).real + size * self.turned_turned
        ab = rho * self.one_turned - size * self.turned_turned
        bb = size * self.turned_turned
        ha, hb = self.one_rest - np.conj(rho) * self.turned_rest, np.conj(rho) * self.turned_rest
        determinant = np.maximum(aa * bb - np.abs(ab) ** 2, 1e-12)
        a = boxes.clip_a((bb * ha - ab * hb) / determinant)
        b = boxes.clip_b((aa * hb - np.conj(ab) * ha) / determinant)
        aa, bb = np.maximum(aa, 1e-9), np.maximum(bb, 1e-9)
        for _ in range(OPTIONS.sweeps):
            a = boxes.clip_a((ha - ab * b) / aa)
            b = boxes.clip_b((hb - np.conj(ab) * a) / bb)
        ground = b - a
        length = np.abs(ground)
        direction = np.where(length > 0, ground, 1.0) / np.where(length > 0, length, 1.0)
        clipped = direction * np.clip(length, np.minimum(*reach), np.maximum(reach[1], 1e-6))
        a = boxes.clip_a(a + (ground - clipped) / 2)
        b = boxes.clip_b(a + clipped)
        a = boxes.clip_a(b - clipped)
        ground = clipped
        b = a + ground
        square = self.rest - 2 * (np.conj(a) * ha + np.conj(b) * hb).real
        square += aa * np.abs(a) ** 2 + bb * np.abs(b) ** 2 + 2 * (np.conj(a) * ab * b).real
        mean_body, own, held = self.share.T
        return np.maximum(square, 0.0), a, ground, held - a * mean_body - ground * rho * own


# -- candidates ----------------------------------------------------------------------------------------------------


def thinned(pool: Pool, count: int, cell: float = 0.05) -> Pool:
    """Return the best ``count`` candidates, at most one in each small cell of shape, start and branch."""
    best = pool.take(np.argsort(pool.cost, kind="stable"))
    best = best.take(np.isfinite(best.cost))
    timed, start = best.timed, best.timed.angles[:, :1]
    coordinates = np.hstack([timed.shape, np.cos(start), np.sin(start), timed.branch[:, None]])
    _, first = np.unique(np.round(coordinates / cell).astype(np.int64), axis=0, return_index=True)
    return best.take(np.sort(first)[:count])


class SeedTables:
    """The coarse types of four-bars, prepared once: a table for the first rounds, windows for a search within limits."""

    def __init__(self) -> None:
        self.lengths = coarse_types()
        self.errors_of = ErrorTable(self.lengths, OPTIONS.starts, OPTIONS.table_samples, OPTIONS.harmonics)
        self.chart: Chart = GrashofChart()
        self.shapes = self.chart.unknowns(self.lengths)

    def errors(self, target: Target) -> tuple[Floats, Floats]:
        """Return squared errors (types, branches, starts), and the starts; at a few samples if start or offset is given."""
        starts: Floats = np.linspace(0.0, TURN, self.errors_of.starts, endpoint=False)
        if target.start is None and target.offset is None:
            return self.errors_of.squared(target), starts
        if target.start is not None:
            starts = np.array([target.start % TURN])
        problem = GivenProblem(target.thinned(OPTIONS.given_samples), self.chart)
        shapes, start = np.repeat(self.shapes, starts.size, axis=0), np.tile(starts, len(self.shapes))
        each = (candidates_at(shapes, np.full(start.size, float(branch)), start) for branch in BRANCHES)
        cost = [problem.measured(timed).cost.reshape(-1, starts.size) for timed in each]
        return np.stack(cost, axis=1), starts

    def best_starts(self, target: Target, family: str) -> Pool:
        """Best start of each type and branch of the table for a target, thinned out over cells of the chart, best first."""
        error, starts = self.errors(target)
        error[~in_family(family, self.lengths)] = np.inf
        best = error.argmin(axis=2)
        cost = np.take_along_axis(error, best[:, :, None], 2)[:, :, 0]
        parts = []
        for side, branch in enumerate(BRANCHES):
            start = starts[best[:, side]]
            parts.append(Pool(candidates_at(self.shapes, np.full(len(start), float(branch)), start), cost[:, side]))
        pool = parts[0].joined(*parts[1:])
        pool = pool.take(np.isfinite(pool.cost))
        pool = pool.take(np.argsort(pool.cost, kind="stable"))
        coordinates = np.hstack([pool.timed.shape, pool.timed.angles]) / self.chart.cell
        return pool.take(first_in_cells(np.column_stack([coordinates, pool.timed.branch])))


@cache
def windows_of(family: str) -> Windows:
    """Return the windows of a family's types for a search within limits, which the first call makes."""
    return Windows(bounded_types(family))
