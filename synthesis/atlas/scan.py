"""The exact scan of an atlas: which types, branches and starts come nearest to a requested motion, over any span.

A *window* is a type, a branch and a whole degree of start. The scan computes a lower bound of the error of windows from
short trigonometric series, then the exact error, from the lengths, of the few windows whose bound allows them among the
best. Most windows are excluded with their likes, by bounds for cells of types: see `cells`. So the answer is that of
evaluating every window, and does not depend on how well a series is resolved.

Rotation. Write the periodic part of theta2 of a type as p(x) = sum_h a_h cos hx + b_h sin hx, the centred target (less the
winding) as g, and means over the samples t_m as <.>. The mean squared error after the best offset is

    D(s) = <g^2> + <p(s+t)^2> - <p(s+t)>^2 - 2 <g p(s+t)>.

With p^2 as a series of its own, each of the three terms is a row of coefficients times a matrix that depends on the
request alone, so all starts of all types are a few matrix products. Branch -1 is the same linkage mirrored:
theta2(x, -1) = -theta2(-x, +1), so its windows are those of the target (-g, -t) at the start -s, and share the rows.
A mechanism may have branch +1 alone.

Position (design of `pose`): P is fitted by {1, e^{it}, e^{i theta2}}, so what is left of it is
|p|^2 - |<q, p>|^2 / |q|^2 with p and q the parts of P and of e^{i theta2} that are orthogonal to {1, e^{it}}; the inner
products are again rows of the series of e^{i theta2} times matrices of the request.

The norms of p and q are those of the series, whose modulus is not quite 1: |q|^2 is the mean of its squared modulus (one
more series) less the two parts that are taken off.

Bounds. If the series of theta2 is off by at most e everywhere, then the rms of a centred difference is off by at most e.
So is the norm of q, and as the residual of the position is the least |p - z q| over z, attained at |z| <= |p| / |q|, it is
off by at most e |p| / (|q| - e). e is the file's ``curve_error`` plus the coefficients left out.

From the coarsest cells of a group down to its windows:

    all representatives x all windows --(bound <= limit)--> cells and their windows left --> their parts, those windows
    --> ... --> finest cells --> their types, those windows: lower bounds, window by window

Where so many windows are left that this would be slower, all windows of the group's types are bounded, type after type.

A request gives `Matrices`: its means <f e^{iht}> over the samples, for all harmonics h at once, times the phases e^{ihs} of the
starts, which no request changes. A matrix has one row a window: branch +1 at all starts, then branch -1 if there is one.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
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
    Phasors,
    Radii,
    SeriesGroup,
    gather,
    start_angles,
)
from synthesis.atlas.preparation import Kind, Preparation
from synthesis.atlas.table import Table
from synthesis.atlas.window_index import LEAST_SPAN, WindowSearch
from synthesis.atlas.windows import (
    FIRST_BATCH,
    NO_WINDOWS,
    NOWHERE,
    TIE,
    BestWindows,
    Numbering,
    Place,
    ScanReport,
    Windows,
    best_of,
    each_once,
    lowest,
)
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.solution import Solution
from synthesis.mechanism import Placed
from synthesis.pose import fit_positions, fixed_columns, objective, position_errors
from synthesis.ranking import distinct
from synthesis.target import TURN, Mean, Target
from synthesis.work import Work

# -- from the coarsest cells down to windows ----------------------------------------------------------------------------

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
STARTS = 360
"""Starts of a window: every whole degree."""
HARMONICS = (5, 8, 12, 16, 24, 32, 64)
SERIES_ERROR = 3e-7
_FIRST_COUNT = 4096
_COUNT_BELOW = 1 << 17
"""Windows held where a ceiling is known: all below it are wanted, and a second pass would find the same ones first."""
_MOST_HELD = 1 << 18
"""Most windows that are held to be evaluated in the order of their bounds."""
_PROBED = 64
_AT_ONCE = 1 << 16
_EXACT_SAMPLES = 1 << 17
MAX_LIMITED_WINDOWS = 1 << 18
"""Windows evaluated before a search within limits gives up; the report then says that it is not exhaustive."""
MAX_LIMITED_SAMPLES = 1 << 22
"""The same in samples of all windows: a request of 1,024 samples takes no longer than one of 16."""


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
        size = float(np.sqrt(mean(np.abs(fixed.remainder) ** 2)))
        columns = [fixed.constant, fixed.crank, fixed.remainder / size if size > 0 else fixed.remainder]
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


# -- the scan -----------------------------------------------------------------------------------------------------------

KIND = Kind(SERIES_ERROR, HARMONICS)
"""Series of a scan unless others are asked for."""


class Scan:
    """A table prepared for scanning; made once, read-only afterwards.

    Parameters
    ----------
    table : Table or Preparation
        A preparation is used as it is, whatever ``series_error``, ``harmonics`` and ``cells`` say.
    starts : int
        Starts over the turn, evenly spaced from 0; 360 is every whole degree.
    series_error : float
        What the series may leave out, in radians; larger is faster to scan, and leaves more windows to evaluate exactly.
    harmonics : tuple of int
        Lengths of series to choose from; each costs a request its own matrices.
    threads : int
        Threads of a scan.
    cells : bool
        False scans all windows of all types; the answers are the same.
    """

    def __init__(
        self,
        table: Table | Preparation,
        starts: int = STARTS,
        series_error: float = SERIES_ERROR,
        harmonics: tuple[int, ...] = HARMONICS,
        threads: int = 1,
        cells: bool = True,
    ) -> None:
        kind = Kind(series_error, harmonics, cells)
        self.prepared = (
            table if isinstance(table, Preparation) else Preparation(table.mechanism, lambda: table, kind, threads)
        )
        self.mechanism: Any = self.prepared.types.mechanism
        """As its types have it; rows are mounted where it is a whole `synthesis.mechanism.Mechanism`."""
        self.starts = starts
        self.branches = len(self.mechanism.branches)
        self.numbering = Numbering(starts, self.branches)
        self.threads = threads
        self._families: dict[str, bool] = {}

    @property
    def types(self) -> int:
        """Number of types."""
        return len(self.prepared.types)

    @property
    def lengths(self) -> Floats:
        """Lengths of all types, (types, d)."""
        return np.asarray(self.prepared.types.lengths, dtype=np.float64)

    def lengths_of(self, rows: Ints) -> Floats:
        """Lengths of some types, (n, d)."""
        return gather(self.prepared.types.lengths, rows).astype(np.float64)

    def has_family(self, family: str) -> bool:
        """Whether a type is of a family; looked up once."""
        if family not in self._families:
            parts = (np.arange(first, min(first + _AT_ONCE, self.types)) for first in range(0, self.types, _AT_ONCE))
            self._families[family] = any(
                bool(self.mechanism.in_family(family, self.lengths_of(rows)).any()) for rows in parts
            )
        return self._families[family]

    @property
    def windows(self) -> int:
        """Number of windows: types x starts x branches."""
        return self.types * self.numbering.per_type

    @property
    def nbytes(self) -> int:
        """Bytes of the prepared series."""
        return self.prepared.nbytes

    def prepare_positions(self, work: Work) -> bool:
        """Make the series that requests with positions need, see `Preparation.prepare_positions`."""
        return self.prepared.prepare_positions(work)

    def prepare_short_spans(self, work: Work) -> None:
        """Make the index of windows that answers short spans sooner, see `Preparation.prepare_short_spans`."""
        self.prepared.prepare_short_spans(work)

    # -- bounds -------------------------------------------------------------------------------------------------------

    def _requested(self, target: Target, work: Work) -> list[Descent]:
        """Cells with the request's matrices for them.

        Where the time ran out before the positions' series were there, only the rotation bounds the windows: what is found
        then is the best of a first look.
        """
        prepared = self.prepared
        phasors: list[Any] = [None] * len(prepared.cells)
        if target.position is not None and prepared.prepare_positions(work):
            phasors = prepared.phasors
        harmonics = [cells.group.harmonics for cells in prepared.cells] + [
            p.harmonics for p in phasors if p is not None
        ]
        matrices = Matrices(target, 2 * max(harmonics, default=0), self.starts, self.branches)
        arcs = Arcs(target, self.starts, self.branches)
        return [Descent(cells, arcs, matrices, known) for cells, known in zip(prepared.cells, phasors)]

    def _window_search(self, target: Target, expired: Callable[[], bool]) -> WindowSearch | None:
        """The request against the index of its span, if there is one."""
        span = float(np.ptp(target.crank))
        for index in self.prepared.short_spans if span >= LEAST_SPAN and target.rotation is not None else []:
            if index.intervals.serves(span, self.starts):
                return WindowSearch(index, target, self.starts, expired, self.branches)
        return None

    def start_angles(self, windows: Windows) -> Floats:
        """theta1 at the first sample of windows, radians."""
        return np.multiply(windows.start, TURN / self.starts, dtype=np.float64)

    def angles(self, target: Target, windows: Windows) -> Floats:
        """Body angle of windows at the samples of a target, (n, N), from the lengths alone."""
        crank = self.start_angles(windows)[:, None] + target.crank
        return self.mechanism.body_angle(self.lengths_of(windows.row), windows.branch, crank)

    def errors(self, target: Target, windows: Windows) -> Floats:
        """Exact error of windows, shape (n,): the objective of `pose.objective`, evaluated at the samples.

        Without positions that is the rms rotation error in radians after the best offset.
        """
        return self._in_batches(target, windows, objective)

    def _errors_of_some(self, target: Target, windows: Windows) -> Floats:
        """Exact error of windows for a rotation or a path at some samples of a request: no more than that for all of them."""
        error = objective if target.position is None else position_errors
        return self._in_batches(target, windows, error)

    def _in_batches(self, target: Target, windows: Windows, error: Callable[[Target, Floats], Floats]) -> Floats:
        errors = np.empty(len(windows.row))
        batch = max(1, _EXACT_SAMPLES // target.samples)
        for first in range(0, errors.size, batch):
            part = windows.take(np.arange(first, min(first + batch, errors.size)))
            errors[first : first + batch] = error(target, self.angles(target, part))
        return errors

    def error_table(self, target: Target) -> Floats:
        """Approximate squared error of every window, (types, branches, starts): branch +1 first. For small atlases."""
        table = np.empty((self.types, self.numbering.per_type))

        for part in self._requested(target, Work()):
            table[part.types.rows] = part.squared(slice(None))
        np.maximum(table, 0.0, out=table)
        return table.reshape(-1, self.branches, self.starts)

    # -- answers ------------------------------------------------------------------------------------------------------

    def best(
        self,
        target: Target,
        top: int,
        exact: Callable[[Windows], Floats] | None = None,
        max_windows: int | None = None,
        work: Work | None = None,
        enough: float = -1.0,
    ) -> tuple[Windows, ScanReport]:
        """The best windows of the whole atlas, exactly as if every window had been evaluated.

        Parameters
        ----------
        target : Target
            With rotation: its rms error after the best offset; with positions the joint objective, see `pose.objective`.
        exact : callable, optional
            ``exact(windows) -> error``, the exact error of windows: never below the rms error or the objective, infinite for
            windows that are no answer. Default: `errors`.
        max_windows : int, optional
            Evaluate no more than this many exactly, beside those of the first look (and no fewer than four times ``top``);
            the report says if that cut the search short.
        work : Work, optional
            Asked now and then; once it has expired the scan ends with the best found so far, and the report says so.
        enough : float
            No better windows are looked for once ``top`` of them have an error of at most this, and the search does not go
            further for the others once the best has; the report says if that cut it short.

        Returns
        -------
        windows : Windows
            At most ``top``, by error, ties (to `TIE`) by number, start, branch. Law: equal to sorting all windows.
        report : ScanReport
        """
        work = work or Work()
        evaluate = exact or (lambda windows: self.errors(target, windows))
        cut_short = False

        def out_of_time() -> bool:  # asked only where something is left to do
            nonlocal cut_short
            cut_short = cut_short or work.expired()
            return cut_short

        def nothing_yet() -> BestWindows:
            at_once = max(FIRST_BATCH, _EXACT_SAMPLES // target.samples)
            return BestWindows(top, self.numbering, evaluate, at_once, out_of_time, enough)

        most = np.inf if max_windows is None else max(max_windows, 4 * top)
        alike = self._alike(target)
        first = nothing_yet()
        if first.settled_in_order(self.types, alike, most):
            return first.windows, ScanReport(self.windows, first.evaluated, not cut_short and first.evaluated < most)
        probed = nothing_yet()
        search = self._window_search(target, out_of_time)
        near = search.candidates(probed, self._errors_of_some) if search else None
        if near is not None:
            keep, cut = lowest(self.numbering, *near, int(min(near[0].size, most)))
            looked_at = probed.evaluated
            probed.consider(near[0][keep], near[1][keep])
            complete = not cut_short and not probed.reached and (probed.last <= cut or keep.size == near[0].size)
            windows = probed.windows if complete else best_of(each_once([first.windows, probed.windows]), top)
            return windows, ScanReport(self.windows, probed.evaluated - looked_at, complete)
        with ThreadPoolExecutor(self.threads) as pool:
            run = pool if self.threads > 1 else None
            parts = self._requested(target, work)
            self._probe(parts, probed, top)
            ceiling = min(first.worst, probed.worst)
            count = int(min(max(_FIRST_COUNT if ceiling == np.inf else _COUNT_BELOW, 4 * top), most))
            evaluated = 0
            while True:
                ids, bounds, cut = lowest_bounds(parts, self.numbering, count, ceiling + TIE, out_of_time, run)
                found = nothing_yet()
                found.consider(ids, bounds)
                evaluated = max(evaluated, found.evaluated)  # a further pass begins with the same windows
                complete = not cut_short and not found.reached and (found.last <= cut or ids.size < count)
                ceiling, reached = min(ceiling, found.worst), found.windows.error[:1].min(initial=np.inf) <= enough
                if complete or cut_short or reached or count >= most:
                    break
                if count >= _MOST_HELD:  # too many to be held and sorted: the others one by one as they come
                    self._one_by_one(parts, found, ceiling, out_of_time, run)
                    complete, evaluated = not cut_short, found.evaluated
                    break
                count = int(min(8 * count, most, max(_MOST_HELD, 4 * top)))
        windows = found.windows
        if not complete:
            windows = best_of(each_once([first.windows, probed.windows, windows]), top)
        return windows, ScanReport(self.windows, evaluated, complete)

    def _one_by_one(
        self,
        parts: list[Descent],
        found: BestWindows,
        ceiling: float,
        expired: Callable[[], bool],
        pool: Executor | None,
    ) -> None:
        for ids, bounds in bounds_of(parts, lambda: min(ceiling, found.worst) + TIE, expired, pool):
            found.consider(ids, bounds)

    def _alike(self, target: Target) -> Floats | None:
        """The error of each type where it is the same from every start: all samples lie whole turns of the crank apart."""
        if target.rotation is None or target.position is not None or not target.repeats_one_crank_angle:
            return None
        winding = self.prepared.types.winding
        kinds, example = np.unique(winding, return_index=True)
        one = np.zeros(kinds.size, dtype=np.int64)
        error = self.errors(target, Windows(example, one, one + 1, np.zeros(kinds.size)))
        return error[np.searchsorted(kinds, winding)]

    def _probe(self, parts: list[Descent], best: BestWindows, top: int) -> None:
        nearest = [part.nearest[0] for part in parts]
        squared = np.concatenate([np.empty(0), *nearest])
        if not squared.size:
            return
        count = min(max(_PROBED, top), squared.size)
        worst = np.partition(squared, count - 1)[count - 1]
        found = [
            part.probe(np.flatnonzero(near <= worst)) for part, near in zip(parts, nearest) if np.any(near <= worst)
        ]
        ids, bounds = (np.concatenate(column) for column in zip(*found))
        ids, first = np.unique(ids, return_index=True)  # a window met twice must not count twice
        best.consider(ids, bounds[first])


# -- rows as they are, mounted and within limits -----------------------------------------------------------------------


def best_rows(
    scan: Scan, target: Target, limits: Limits, top: int, work: Work | None = None, tolerance: float = -1.0
) -> tuple[list[Solution], ScanReport]:
    """The best rows by the joint objective over rotation and position.

    ``work``: once it has expired the scan ends with the best found so far. ``tolerance``: as good a row is good enough:
    once the best is, the scan goes no further for the others, see `Scan.best`.

    Returns
    -------
    solutions : list of Solution
        At most ``top``, by objective; each linkage once, at its best start. Empty where no row keeps the limits.
    report : ScanReport
    """

    def exact(windows: Windows) -> Floats:
        error = scan.errors(target, windows)
        return np.where(_within(scan, target, limits, windows), error, np.inf)

    if not scan.has_family(limits.family):
        return [], ScanReport(scan.windows, 0, True)
    most = MAX_LIMITED_WINDOWS
    if not limits.only_family:
        most = min(most, MAX_LIMITED_SAMPLES // target.samples)
    wanted = top
    while True:
        windows, report = scan.best(target, wanted, exact, most, work, tolerance)
        chosen = windows.take(_first_of_each(target, windows))
        linkages = scan.mechanism.mounted(
            target, scan.lengths_of(chosen.row), chosen.branch, scan.start_angles(chosen)
        )
        solutions = distinct(scan.mechanism.assess(target, linkages, chosen.row.tolist()), top)
        complete = len(windows.row) < wanted or not report.exhaustive
        if len(solutions) == top or complete:
            return solutions, report
        wanted *= 8


def _first_of_each(target: Target, windows: Windows) -> NDArray[np.intp]:
    """Places of the windows that can be different linkages: without positions a type and branch count once."""
    if target.position is not None:
        return np.arange(len(windows.row))
    _, first = np.unique(windows.row * 2 + (windows.branch < 0), return_index=True)
    return np.sort(first)


def _within(scan: Scan, target: Target, limits: Limits, windows: Windows) -> NDArray[np.bool_]:
    lengths, start = scan.lengths_of(windows.row), scan.start_angles(windows)
    placed = Placed(lengths, windows.branch.astype(float), target.interval.after(start))
    if not limits.only_family and target.position is not None:
        fit = fit_positions(target, scan.angles(target, windows))
        scale = np.maximum(np.abs(fit.crank_vector) / lengths[:, 0], np.finfo(float).tiny)
        turned = np.angle(fit.crank_vector) - start
        placed = placed._replace(
            lengths=lengths * scale[:, None], pivot=fit.pivot, turned=turned, coupler=fit.coupler_vector
        )
    return scan.mechanism.keeps(target, limits, placed)
