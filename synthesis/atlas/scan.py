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
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Floats, Ints
from synthesis.atlas.descent import Arcs, Descent, Matrices, bounds_of, lowest_bounds
from synthesis.atlas.preparation import Kind, Preparation
from synthesis.atlas.series import gather
from synthesis.atlas.table import Table
from synthesis.atlas.window_search import LEAST_SPAN, WindowSearch
from synthesis.atlas.windows import (
    FIRST_BATCH,
    TIE,
    BestWindows,
    Numbering,
    ScanReport,
    Windows,
    best_of,
    each_once,
    lowest,
)
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.solution import Solution
from synthesis.mechanism import Placed
from synthesis.pose import fit_positions, objective, position_errors
from synthesis.ranking import distinct
from synthesis.target import TURN, Target
from synthesis.work import Work

STARTS = 360
"""Starts of a window: every whole degree."""
HARMONICS = (5, 8, 12, 16, 24, 32, 64)
SERIES_ERROR = 3e-7
KIND = Kind(SERIES_ERROR, HARMONICS)
"""Series of a scan unless others are asked for."""
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
