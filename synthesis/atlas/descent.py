"""From the coarsest cells of a group down to its windows: which of them may be among the best for one request.

    all representatives x all windows --(bound <= limit)--> cells and their windows left --> their parts, those windows
    --> ... --> finest cells --> their types, those windows: lower bounds, window by window

Where so many windows are left that this would be slower, all windows of the group's types are bounded, type after type.

A request gives `Matrices`: its means <f e^{iht}> over the samples, for all harmonics h at once, times the phases e^{ihs} of the
starts, which no request changes. A matrix has one row a window: branch +1 at all starts, then branch -1 if there is one.
Formulae and bounds are those of `scan`.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Complexes, Floats, Ints
from synthesis.atlas.cells import (
    ABOVE_SINGLE,
    ARCS,
    CURVATURE,
    PARTS,
    RANGES,
    SLOPE,
    THIRD,
    THIRDS,
    Cells,
    Level,
    Radii,
)
from synthesis.atlas.series import Phasors, SeriesGroup, gather, start_angles
from synthesis.atlas.windows import NO_WINDOWS, NOWHERE, Numbering, Place, lowest
from synthesis.pose import fixed_columns
from synthesis.target import TURN, Mean, Target

Batch = Callable[[float], tuple[Ints, Floats] | None]
"""Window numbers and lower bounds of those windows of a batch whose bound is at most a limit."""

BLOCK_ROWS = 64
CHUNK_BYTES = 1 << 20
"""Of the gathered matrices of a chunk of cells: they stay in a core's cache."""
FILLED = 0.6
"""Least part of a chunk's rows that is windows and no filling."""
HOPELESS = 1e6
"""A limit in radians that excludes next to nothing; the descent, partly in single precision, is for smaller ones."""
SPARSE = 0.12
"""Part of the windows of a chunk below which each is taken by itself."""
WORTHWHILE = 0.4
"""Part of the windows beyond which gathering those that are left costs more than it saves."""
_LARGEST_WAVE = 16
"""Blocks between two looks at the limit: the same on every machine, or reports would differ. Of each, all windows may be left."""
_HELD = 4
"""While more windows are found, so many times as many are held as are wanted (twelve bytes each, and as much again to sort)."""
_NEARLY = 1e-9
ROUNDING = 1e-13
"""Rounding of a mean squared rotation error, for a target of variance 1."""
_HARMONICS_AT_ONCE = 16


@lru_cache(maxsize=8)
def _phases(highest: int, starts: int) -> Complexes:
    """e^{ihs} for all starts and h = 0 .. highest."""
    phases = np.exp(1j * np.outer(start_angles(starts), np.arange(highest + 1)))
    phases.flags.writeable = False
    return phases


class Arcs:
    """Where the windows of a request lie, and how large the radius of a cell there is.

    ``branches``: of the mechanism: 2, or 1.

    ``piece`` (windows,): piece of the turn in which each window begins: all starts of branch +1, then of branch -1,
    whose windows are those of the mirrored turn, crank angles -(s + t).
    """

    def __init__(self, target: Target, starts: int, branches: int = 2) -> None:
        start = start_angles(starts)
        low, high = target.crank.min(), target.crank.max()
        begin = np.concatenate([start + low, -(start + high)][:branches]) * (ARCS / TURN)
        self.piece = np.floor(begin - _NEARLY).astype(np.int64) % ARCS
        span = high - low
        pieces = span * (ARCS / TURN)
        # a window that begins somewhere in a piece ends in the last of so many
        reached = min(int(np.ceil(pieces + _NEARLY)) + 1, ARCS)
        self._range = bisect_left(RANGES, reached)
        self._third = bisect_left(THIRDS, reached)
        self._middle = int(pieces / 2)
        along = target.crank - (low + high) / 2
        std = target.rotation_mean.spread
        self._taylor = [np.float32(v) for v in (std(along), std(along**2) / 2, span**3 / 48)]

    def radius(self, level: Level, cells: Ints) -> Radii:
        """Radius of some cells of a level for windows by the piece they begin in, (cells, ARCS)."""
        result = gather(level.bounds[self._range], cells)
        if self._third < len(THIRDS):
            slope, curvature, third = self._taylor
            taylor = slope * gather(level.bounds[SLOPE], cells)
            taylor += curvature * gather(level.bounds[CURVATURE], cells)
            # from the piece of the middle of a window to that of its begin
            taylor = np.concatenate([taylor[..., self._middle :], taylor[..., : self._middle]], axis=-1)
            taylor += third * gather(level.bounds[THIRD + self._third], cells)
            taylor *= ABOVE_SINGLE
            result = np.minimum(result, taylor)
        return result + gather(level.error, cells)[..., None]


class Matrices:
    """What one request multiplies the series of an atlas with; what groups share is made once, when first asked for.

    ``highest``: highest harmonic of any series or square. ``branches``: of the mechanism: 2, or 1.
    """

    def __init__(self, target: Target, highest: int, starts: int, branches: int = 2) -> None:
        self.target = target
        self.branches = branches
        self.highest = highest
        self.starts = starts
        blocks = -(-(highest + 1) // _HARMONICS_AT_ONCE)
        coarse = np.exp(1j * np.outer(_HARMONICS_AT_ONCE * np.arange(blocks), target.crank))
        self._coarse = {mean.total: coarse / mean.total for mean in (target.rotation_mean, target.position_mean)}
        self._fine = np.exp(1j * np.outer(target.crank, np.arange(_HARMONICS_AT_ONCE)))
        self._averages: dict[int | None, Floats] = {}
        self._along: dict[int, tuple[Floats, Floats]] = {}
        self._position: dict[int, PositionMatrices] = {}

    def means(self, values: NDArray[Any], mean: Mean) -> Complexes:
        """<f e^{iht}> over the samples for values f of them, h = 0 .. highest."""
        return ((self._coarse[mean.total] * mean.weighted(values)) @ self._fine).ravel()[: self.highest + 1]

    @cached_property
    def phases(self) -> Complexes:
        """e^{ihs}, (starts, highest + 1)."""
        return _phases(self.highest, self.starts)

    def _of_branches(self, shifted: Complexes, sign: int = 1) -> Complexes:
        """What a series is multiplied with to give its mean, for all starts of all branches.

        A mirrored window has the increments -t and the starts -s, and the target ``sign`` times the one that the means are
        of: that conjugates every term.
        """
        return np.concatenate([shifted, sign * np.conj(shifted)][: self.branches])

    def average(self, mean: Mean) -> Floats:
        """For the mean of a series, cosine and sine side by side, (windows, 2 highest)."""
        key = None if mean.weights is None else id(mean)
        if key not in self._averages:
            means = self.means(np.ones(self.target.samples), mean)
            self._averages[key] = self._of_branches(self.phases[:, 1:] * means[1:]).view(float)
        return self._averages[key]

    def _times(self, values: Floats) -> Floats:
        """For the mean of a series times values of the samples, (windows, 2 harmonics), of half of all harmonics."""
        harmonics = self.highest // 2 + 1
        means = self.means(values, self.target.rotation_mean)
        return self._of_branches(self.phases[:, 1:harmonics] * means[1:harmonics], -1).view(float)

    def _turned(self, winding: int) -> tuple[Floats, Floats]:
        """The centred target less the winding, and what series are multiplied with for the mean of their product with it."""
        if winding not in self._along:
            assert self.target.rotation is not None
            rotation = self.target.rotation - winding * self.target.crank
            mean = self.target.rotation_mean
            centred = rotation - mean(rotation)
            centred -= mean(centred)  # a large constant leaves a mean of its rounding at the first time
            self._along[winding] = centred, self._times(centred)
        return self._along[winding]

    @cached_property
    def _line(self) -> tuple[Floats, Floats]:
        """The crank angle, centred and of mean square 1, and what series are multiplied with for their slope over it."""
        mean = self.target.rotation_mean
        line = self.target.crank - mean(self.target.crank)
        line /= np.sqrt(mean(line**2))
        return line, self._times(line)

    def rotation(self, group: SeriesGroup) -> RotationMatrix:
        """For the mean squared rotation error."""
        harmonics, mean = 2 * group.harmonics, self.target.rotation_mean
        centred, along = self._turned(group.winding)
        line, slopes = self._line
        return RotationMatrix(
            np.concatenate([self.average(mean)[:, : 2 * harmonics], -2 * along[:, :harmonics]], axis=1),
            float(mean(centred**2)),
            np.ascontiguousarray(slopes[:, :harmonics]),
            float(mean(centred * line)),
        )

    def position(self, harmonics: int) -> PositionMatrices:
        """For the mean squared position error of phasors of some harmonics."""
        if harmonics not in self._position:
            ahead, behind, size = self._position_means
            turn = self.phases[:, np.abs(np.arange(-harmonics, harmonics + 1))]
            turn = np.concatenate([np.conj(turn[:, :harmonics]), turn[:, harmonics:]], axis=1)
            columns = []
            for forward, backward in zip(ahead, behind):
                shifted = turn * np.concatenate([backward[harmonics:0:-1], forward[: harmonics + 1]])
                columns.append(self._of_branches(shifted))
            self._position[harmonics] = PositionMatrices(
                np.stack(columns), self.average(self.target.position_mean)[:, : 4 * harmonics], size
            )
        return self._position[harmonics]

    @cached_property
    def _position_means(self) -> tuple[list[Complexes], list[Complexes], float]:
        """<conj(c) e^{iht}> and its counterpart at -h for three columns c, and the norm of the rest.

        The columns are the fixed parts {1, e^{it}} made orthonormal, and the positions over l that are left, made a unit.
        """
        mean, fixed = self.target.position_mean, fixed_columns(self.target)
        size = float(np.sqrt(mean(np.abs(fixed.rest) ** 2)))
        columns = [fixed.one, fixed.turned, fixed.rest / size if size > 0 else fixed.rest]
        ahead = [self.means(np.conj(c), mean) for c in columns]
        return ahead, [np.conj(self.means(c, mean)) for c in columns], size


@dataclass(frozen=True)
class RotationMatrix:
    """What the series of types are multiplied with to give mean squared errors and slopes, one row a window.

    ``columns`` (windows, 6H): the means over p^2 (4H), then -2 times those over p times the target (2H). ``variance``:
    of the target. ``slopes`` (windows, 2H): the means over p times the line. ``slope``: the mean of the target times
    the line.
    """

    columns: Floats
    variance: float
    slopes: Floats
    slope: float

    @property
    def rounding(self) -> float:
        """Rounding of a mean squared error."""
        return ROUNDING * (1 + self.variance)

    def mean_square_error(self, group: SeriesGroup, part: slice) -> Floats:
        """D of all windows of some types, (n, windows)."""
        result = self._error(group.series[part], self.columns.T)
        result += (group.mean_square[part] + self.variance)[:, None]
        return result

    def of_windows(self, series: Floats, windows: Ints) -> Floats:
        """D, less the type's ``mean_square`` and the variance, of some windows of some groups of types.

        ``series`` (groups, types, 6H). ``windows`` (groups, windows).

        Shape (groups, types, windows).
        """
        return self._error(series, gather(self.columns, windows).transpose(0, 2, 1))

    def of_pairs(self, series: Floats, windows: Ints) -> Floats:
        """The same of one window of each of some types; (n, 6H) and (n,) to (n,)."""
        return self._error(series[:, None], gather(self.columns, windows)[:, :, None])[:, 0, 0]

    def slopes_of_windows(self, periodic: Floats, windows: Ints) -> Floats:
        """Distance of a type's slope from the target's, shaped as by `of_windows`; ``periodic`` (groups, types, 2H).

        The slope is the mean of a curve times a line of mean 0 and mean square 1, so by Cauchy and Schwarz no error is
        less than this.
        """
        result = periodic @ gather(self.slopes, windows).transpose(0, 2, 1)
        result -= self.slope
        return np.abs(result, out=result)

    def _error(self, series: Floats, columns: Floats) -> Floats:
        third = columns.shape[-2] // 3  # the means over p itself are the first third of the rows, those up to H
        result = series @ columns
        mean = series[..., 2 * third :] @ columns[..., :third, :]
        np.multiply(mean, mean, out=mean)
        result -= mean
        return result


@dataclass(frozen=True)
class PositionMatrices:
    """What phasors are multiplied with, to bound the mean squared position error (over l^2)."""

    columns: Complexes
    """(3, windows, 2K + 1): for the inner products with the two fixed parts and with the unit of the rest."""
    modulus: Floats
    size: float

    @cached_property
    def rows(self) -> Complexes:
        """All three with one column a window, side by side: as a whole they make a faster product."""
        return np.ascontiguousarray(self.columns.reshape(-1, self.columns.shape[-1]).T)

    def mean_square_error(self, phasors: Phasors, part: Any) -> Floats:
        """Lower bounds of the mean squared position error over l^2, (n, windows)."""
        along = np.split(phasors.series[part] @ self.rows, 3, axis=1)
        whole = phasors.modulus_mean[part][:, None] + phasors.modulus[part] @ self.modulus.T
        return self._bound(along, whole, phasors.error[part][:, None])

    def of_windows(self, phasors: Phasors, places: Ints, windows: Ints) -> Floats:
        """The same of some windows of some groups of types, (groups, types, windows).

        ``places`` (groups, types). ``windows`` (groups, windows).
        """
        series = gather(phasors.series, places)
        along = [series @ gather(columns, windows).transpose(0, 2, 1) for columns in self.columns]
        modulus = gather(self.modulus, windows).transpose(0, 2, 1)
        whole = phasors.modulus_mean[places][..., None] + phasors.modulus[places] @ modulus
        return self._bound(along, whole, phasors.error[places][..., None])

    def _bound(self, along: list[Complexes], whole: Floats, error: Floats) -> Floats:
        first, second, rest = (product.real**2 + product.imag**2 for product in along)
        square = np.maximum(whole - first - second, 1e-30)
        left = np.sqrt(np.maximum(1.0 - rest / square - 1e-14 / square, 0.0))
        norm = np.maximum(np.sqrt(square) - error - 1e-8, 1e-30)
        return (self.size * np.maximum(left - error / norm, 0.0)) ** 2


# -- which windows are left -------------------------------------------------------------------------------------------


class Left(NamedTuple):
    """Windows left of some cells: cell i has the next ``counts[i]`` of ``window``."""

    cell: Ints
    counts: Ints
    window: Ints

    @classmethod
    def of(cls, cell: Ints, window: Ints) -> Left:
        """From a cell, each in one stretch, and a window for every pair that is left."""
        first = np.flatnonzero(np.diff(cell, prepend=-1))
        return cls(cell[first], np.diff(first, append=cell.size), window)

    def chunks(self, width: int) -> Iterator[tuple[Ints, Ints, NDArray[np.bool_]]]:
        """Groups of cells with about as many windows each: cells (g,), windows (g, w), and which windows are no padding."""
        first = np.cumsum(self.counts) - self.counts
        order = np.argsort(-self.counts, kind="stable")
        falling = -self.counts[order]
        at = 0
        while at < order.size:
            most = -int(falling[at])
            fitting = at + max(1, CHUNK_BYTES // (width * most))
            part = order[at : min(fitting, np.searchsorted(falling, -FILLED * most, side="right"))]
            at += part.size
            place = np.arange(most)
            real = place < self.counts[part, None]
            place = np.where(real, place, 0) + first[part, None]
            yield self.cell[part], gather(self.window, place), real


class Descent:
    """A request's matrices for the cells of a group."""

    def __init__(self, cells: Cells, arcs: Arcs, matrices: Matrices, phasors: Phasors | None) -> None:
        self.cells = cells
        self.arcs = arcs
        self.matrices = matrices
        self.phasors = phasors

    @property
    def turned(self) -> bool:
        """Whether a rotation is requested."""
        return self.matrices.target.rotation is not None

    @cached_property
    def rotation(self) -> RotationMatrix:
        """For the rotation that is requested."""
        return self.matrices.rotation(self.types)

    def position_error(self, phasors: Phasors, part: Any) -> Floats:
        """Lower bounds of the mean squared position error of all windows of some types, (n, windows)."""
        return self.matrices.position(phasors.harmonics).mean_square_error(phasors, part)

    @property
    def types(self) -> SeriesGroup:
        """The series of the types."""
        return self.cells.group

    @property
    def windows(self) -> int:
        """Windows of one type."""
        return self.arcs.piece.size

    def squared(self, part: slice) -> Floats:
        """Mean squared error of all windows of some types, or a lower bound of it, (n, windows)."""
        squared: Any = 0.0
        if self.turned:
            squared = self.rotation.mean_square_error(self.types, part)
        if self.phasors is not None:
            squared = squared + self.position_error(self.phasors, part)
        return squared

    # -- every window -------------------------------------------------------------------------------------------------

    def _everything(self) -> list[Batch]:
        count = len(self.types.rows)
        return [partial(self._block, slice(k, k + BLOCK_ROWS)) for k in range(0, count, BLOCK_ROWS)]

    def _block(self, part: slice, limit: float) -> tuple[Ints, Floats] | None:
        types = self.types
        places = np.arange(len(types.rows))[part]
        squared: Any = 0.0
        if self.turned:
            squared = self.rotation.mean_square_error(types, part)
            # cheap test on D itself first: bound = sqrt(D - rounding) - e <= limit
            keep = squared <= ((limit + types.error[part]) ** 2 + self.rotation.rounding)[:, None]
            some = keep.any(axis=1)
            if not some.any():
                return None
            places, squared, keep = places[some], squared[some], keep[some]
            squared = self._lowered(squared, gather(types.error, places)[:, None]) ** 2
        if self.phasors is not None:
            squared = squared + self.position_error(self.phasors, places)
            keep = squared <= limit**2
        elif not self.turned:  # positions only, and no time for their series: any window may be the best
            squared = np.zeros((places.size, self.windows))
            keep = squared <= limit**2
        place, window = np.nonzero(keep)
        return gather(types.rows, places[place]) * self.windows + window, np.sqrt(squared[place, window])

    def _lowered(self, squared: Floats, error: Floats) -> Floats:
        """Lower bound of the rms rotation error from D and the error of the series."""
        return np.maximum(np.sqrt(np.maximum(squared - self.rotation.rounding, 0.0)) - error, 0.0)

    # -- the descent --------------------------------------------------------------------------------------------------

    @cached_property
    def _top(self) -> Floats:
        representatives = self.cells.levels[0].representatives
        return self.rotation.mean_square_error(representatives, slice(None))

    @property
    def _descends(self) -> bool:
        return self.turned and bool(self.cells.levels)

    def batches(self, limit: float, expired: Callable[[], bool] = lambda: False) -> tuple[list[Batch], bool]:
        """Batches that between them find every window whose bound is at most any limit up to this one.

        With a flag: whether their matrix products are large enough to run on threads of their own. Where the time expires on
        the way down, some are missing.
        """
        if not self._descends or limit > HOPELESS:
            return self._everything(), True
        level = self.cells.levels[0]
        radius = gather(self.arcs.radius(level, np.arange(len(self._top))), self.arcs.piece, axis=1)
        cell, window = np.divmod(np.flatnonzero(self._may_be_below(self._top, radius, limit)), self.windows)
        left = Left.of(cell, window)
        for fine in self.cells.levels[1:]:
            left = self._parts(left, limit, fine, expired)
        if left.window.size > WORTHWHILE * self.windows * (len(self.cells.first) - 1):
            return self._everything(), True
        width = 8 * max(self.cells.most, 2 * self.types.harmonics)
        return [partial(self._types, *chunk) for chunk in left.chunks(width)], self.phasors is not None

    def _may_be_below(self, squared: Floats, radius: NDArray[np.floating], limit: float) -> NDArray[np.bool_]:
        most = (radius + limit) * ABOVE_SINGLE
        most *= most
        most += self.rotation.rounding
        return squared <= most

    def _parts(self, left: Left, limit: float, fine: Level, expired: Callable[[], bool]) -> Left:
        """What is left of the windows of some cells in the cells that they are made of."""
        cells, windows = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
        for cell, window, real in left.chunks(8 * fine.series.shape[-1]):
            if expired():
                break
            squared = self.rotation.of_windows(gather(fine.series, cell), window)
            squared += (gather(fine.mean_square, cell) + self.rotation.variance)[..., None]
            part = PARTS * cell[:, None] + np.arange(PARTS)
            radius = self.arcs.radius(fine, part)
            at = ARCS * np.arange(part.size).reshape(*part.shape, 1) + gather(self.arcs.piece, window)[:, None]
            keep = self._may_be_below(squared, gather(radius.ravel(), at), limit)
            keep &= real[:, None]
            row, column = np.divmod(np.flatnonzero(keep), window.shape[1])
            cells.append(gather(part.ravel(), row))
            windows.append(window[row // PARTS, column])
        return Left.of(np.concatenate(cells), np.concatenate(windows))

    def _types(self, cell: Ints, window: Ints, real: NDArray[np.bool_], limit: float) -> tuple[Ints, Floats] | None:
        types = self.cells.types_of(cell)
        error = gather(self.types.error, types)
        group, place, column, squared = self._near(types, window, error, limit)
        # no filling of short rows: neither a window twice nor a type twice
        own = real[group, column] & ((place == 0) | (types[group, place] != types[group, place - 1]))
        group, place, column = group[own], place[own], column[own]
        if not group.size:
            return None
        bound = self._lowered(squared[own], error[group, place])
        if self.phasors is not None:
            some, inside = np.unique(group, return_inverse=True)
            position = self.matrices.position(self.phasors.harmonics)
            left = position.of_windows(self.phasors, types[some], window[some])
            bound = np.sqrt(bound**2 + left[inside, place, column])
            own = bound <= limit
            group, place, column, bound = group[own], place[own], column[own], bound[own]
        return gather(self.types.rows, types[group, place]) * self.windows + window[group, column], bound

    def _near(self, types: Ints, window: Ints, error: Floats, limit: float) -> tuple[Ints, Ints, Ints, Floats]:
        """Group, place and column of the windows whose D allows an error of at most ``limit``, and that D."""
        series, rotation = self.types, self.rotation
        constant = gather(series.mean_square, types) + rotation.variance
        most = (limit + error) ** 2 + rotation.rounding
        shape = (*types.shape, window.shape[1])
        # Slopes take a quarter of the time of D and mostly suffice. Few windows left are taken one by one, many all together.
        slope = rotation.slopes_of_windows(series.gather_periodic(types), window)
        near = np.flatnonzero(slope <= np.sqrt(most)[..., None])
        if near.size > SPARSE * slope.size:
            squared = rotation.of_windows(gather(series.series, types), window)
            near = np.flatnonzero(squared <= (most - constant)[..., None])
            group, place, column = np.unravel_index(near, shape)
            return group, place, column, squared.ravel()[near] + constant[group, place]
        group, place, column = np.unravel_index(near, shape)
        squared = rotation.of_pairs(gather(series.series, types[group, place]), window[group, column])
        squared += constant[group, place]
        kept = np.flatnonzero(squared <= most[group, place])
        return group[kept], place[kept], column[kept], squared[kept]

    # -- a first guess ------------------------------------------------------------------------------------------------

    @cached_property
    def nearest(self) -> tuple[Floats, Ints]:
        """Least D of each of the coarsest cells, and its window; empty where there are no cells."""
        if not self._descends:
            return np.empty(0), np.empty(0, dtype=np.int64)
        window = self._top.argmin(axis=1)
        return self._top[np.arange(len(window)), window], window

    def probe(self, cell: Ints) -> tuple[Ints, Floats]:
        """Windows of the types that lie below some of the coarsest cells, near their best window: for the first limit."""
        window = self.nearest[1][cell]
        for fine in self.cells.levels[1:]:
            part = PARTS * cell[:, None] + np.arange(PARTS)
            around = self._around(window)
            squared = self.rotation.of_windows(fine.series[cell], around) + fine.mean_square[cell][..., None]
            best = squared.reshape(len(cell), -1).argmin(axis=1)
            group = np.arange(len(cell))
            cell, window = part[group, best // around.shape[1]], around[group, best % around.shape[1]]
        found = self._types(cell, self._around(window), np.ones((len(cell), 3), dtype=bool), np.inf)
        assert found is not None
        return found

    def _around(self, window: Ints) -> Ints:
        """Windows and their neighbours of the same branch, (n, 3)."""
        starts = self.matrices.starts
        start, branch = window % starts, window // starts
        return branch[:, None] * starts + (start[:, None] + np.array([-1, 0, 1])) % starts


# -- all groups together ----------------------------------------------------------------------------------------------


def bounds_of(
    parts: list[Descent],
    limit: Callable[[], float],
    expired: Callable[[], bool],
    pool: Executor | None = None,
) -> Iterator[tuple[Ints, Floats]]:
    """Window numbers and lower bounds of their error, batch by batch, of all windows that may be below ``limit()``.

    Batches are worked on in waves, all of a wave with the same limit, so that the result does not depend on which
    thread is faster. (A matrix product of its own many threads waits for the slowest of them.) What the cells leave of
    rotations is done sooner by one thread: so many short steps would mostly wait for the interpreter.
    """
    highest = limit()
    found = [part.batches(highest, expired) for part in parts]
    batches = [batch for some, _ in found for batch in some]
    heavy = sum(len(some) for some, are_heavy in found if are_heavy)
    run = pool.map if pool is not None and 2 * heavy > len(batches) else map
    first, wave = 0, 1  # small at first, while nothing is known that could exclude a window

    def bounds(batch: Batch) -> tuple[Ints, Floats] | None:
        return None if first and expired() else batch(ceiling)

    while first < len(batches):
        ceiling = limit()
        yield from filter(None, run(bounds, batches[first : first + wave]))
        first, wave = first + wave, min(2 * wave, _LARGEST_WAVE)
        if first < len(batches) and expired():
            return


def lowest_bounds(
    parts: list[Descent],
    numbering: Numbering,
    count: int,
    ceiling: float,
    expired: Callable[[], bool],
    pool: Executor | None = None,
) -> tuple[Ints, Floats, Place]:
    """The ``count`` windows of lowest bound at or below ``ceiling``, ties in order, and a place that no other is before."""
    ids: list[Ints] = [NO_WINDOWS.row]
    bounds: list[Floats] = [NO_WINDOWS.error]
    held, cut = 0, NOWHERE

    def reduce() -> None:
        nonlocal ids, bounds, held, cut
        all_ids, all_bounds = np.concatenate(ids), np.concatenate(bounds)
        keep, first_left = lowest(numbering, all_ids, all_bounds, count)
        cut = min(cut, first_left)
        ids, bounds, held = [all_ids[keep]], [all_bounds[keep]], keep.size

    for block_ids, block_bounds in bounds_of(parts, lambda: min(ceiling, cut.bound), expired, pool):
        near = np.flatnonzero(block_bounds <= cut.bound)
        ids.append(block_ids[near])
        bounds.append(block_bounds[near])
        held += near.size
        if held > _HELD * count:
            reduce()
    reduce()
    return ids[0], bounds[0], cut
