"""The exact scan of an atlas: which types, branches and starts come nearest to a requested motion, over any span.

The answer is the same as if every window were evaluated. `docs/method.md`, section 5, explains the scan on one page: a first
look down the tree finds a limit, branch and bound with `tree_kernel.expand` leaves the few windows that may be below it, and
those are evaluated from their lengths. `windows.BestWindows` decides what is evaluated, in which order, and when that is
enough.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Floats, Ints, Singles, rows_at
from synthesis.atlas import tree_kernel
from synthesis.atlas.positions import PositionRequest
from synthesis.atlas.request import STARTS, RotationRequest
from synthesis.atlas.table import compute_series
from synthesis.atlas.tree import WIDTH, Level, Tree, build_tree
from synthesis.atlas.windows import FIRST_BATCH, TIE, BestWindows, Numbering, ScanReport, Windows
from synthesis.four_bar import coupler_angle
from synthesis.fourbar.mechanism import coupler_turns
from synthesis.limits import in_family
from synthesis.pose import objective
from synthesis.target import TURN, Target
from synthesis.work import UNLIMITED, Work

GROWTH = 1.5
"""Growth of the limit while too few of the windows below it are answers."""
_SLICE = 1 << 14
"""Pairs of a node and a window expanded at a time; the limit can fall between two slices."""
_BEAM = 32
"""Nodes that the first look keeps at each level."""
_EXACT_SAMPLES = 1 << 17
"""Samples of all windows evaluated together."""
_MAX_BY_TREE = 1 << 20
"""Windows left by the rotation beyond which a request with positions bounds the positions of all windows."""
_FEW = 1 << 11
"""Windows that are evaluated without a bound of their positions."""
_TYPES_AT_ONCE = 256
_FIRST_DIRECTIONS = 4
"""Directions of the rotation bound when all windows of types are bounded by matrix products."""


class _Siblings(NamedTuple):
    """A level of the tree as the kernel reads it, eight siblings side by side: (blocks, columns, 8)."""

    series: Singles
    errors: Singles
    slopes: Singles
    bends: Singles

    @classmethod
    def of(cls, level: Level) -> _Siblings:
        blocks = (v.reshape(len(v) // WIDTH, WIDTH, v.shape[1]) for v in level)
        return cls(*(np.ascontiguousarray(block.transpose(0, 2, 1)) for block in blocks))


class Scan:
    """Types of four-bars, ready to be matched; read-only.

    Parameters
    ----------
    lengths : array_like, shape (types, 4)
        Types whose crank turns fully.
    tree : Tree, optional
        Default: computed from the lengths.
    """

    starts = STARTS

    def __init__(self, lengths: NDArray[Any], tree: Tree | None = None) -> None:
        self.lengths: Floats = np.asarray(lengths, dtype=np.float64)
        self.numbering = Numbering(STARTS)
        tree = tree or build_tree(compute_series(self.lengths))
        self._levels = [_Siblings.of(level) for level in tree.levels]
        self._rows = tree.rows.astype(np.int64)
        self._leaf_of = np.argsort(self._rows, kind="stable")[self._rows.size - len(self.lengths) :]
        leaves = np.abs(tree.levels[-1].series[:, 2:])
        largest = np.nanmax(leaves, axis=0) if tree.rows.size else np.zeros(leaves.shape[1])
        self._amplitudes = np.hypot(largest[::2], largest[1::2]).astype(float)
        self._families: dict[str, bool] = {}

    @property
    def types(self) -> int:
        """Number of types."""
        return len(self.lengths)

    @property
    def windows(self) -> int:
        """Number of windows: types x starts x branches."""
        return self.types * self.numbering.per_type

    def has_family(self, family: str) -> bool:
        """Return whether any type is of a family; looked up once."""
        if family not in self._families:
            self._families[family] = bool(in_family(family, self.lengths).any())
        return self._families[family]

    def start_angles(self, windows: Windows) -> Floats:
        """Return theta1 at the first sample of windows, in radians."""
        return np.multiply(windows.start, TURN / STARTS, dtype=np.float64)

    def angles(self, target: Target, windows: Windows) -> Floats:
        """Return the body angle of windows at the samples of a target, (n, N), from the lengths."""
        crank = self.start_angles(windows)[:, None] + target.crank
        return coupler_angle(self.lengths[windows.row], windows.branch, crank)

    def errors(self, target: Target, windows: Windows) -> Floats:
        """Return the exact error of windows, (n,): the objective of `pose.objective`, evaluated at the samples."""
        errors = np.empty(len(windows.row))
        batch = max(1, _EXACT_SAMPLES // target.samples)
        for first in range(0, errors.size, batch):
            part = rows_at(windows, np.arange(first, min(first + batch, errors.size)))
            errors[first : first + batch] = objective(target, self.angles(target, part))
        return errors

    # -- down the tree -------------------------------------------------------------------------------------------------

    def _expand(
        self, level: int, request: RotationRequest, blocks: Ints, windows: Ints, limit: float
    ) -> tuple[Ints, Ints, Floats, Floats]:
        found: Any = tree_kernel.expand(
            *self._levels[level],
            request.rows,
            request.target,
            request.weights,
            request.first_piece,
            request.spread,
            request.rounding,
            np.ascontiguousarray(blocks, dtype=np.int32),
            np.ascontiguousarray(windows, dtype=np.int32),
            limit,
        )
        return found

    def _roots(self, windows: Ints) -> tuple[Ints, Ints]:
        """Return all blocks of roots with each of some windows."""
        blocks = np.arange(len(self._levels[0].series))
        return np.repeat(blocks, windows.size), np.tile(windows, blocks.size)

    def _ids(self, leaves: Ints, windows: Ints) -> tuple[Ints, NDArray[np.bool_]]:
        """Return numbers of windows, and which leaves are types."""
        rows = self._rows[leaves]
        return rows * self.numbering.per_type + windows, rows >= 0

    def _first_look(self, request: RotationRequest, found: BestWindows) -> None:
        """Evaluate promising windows: at each level the most similar nodes, at every 16th start, then every 8th, and so on."""
        step = 1 << min(4, len(self._levels) - 1)
        blocks, windows = self._roots(np.arange(0, self.numbering.per_type, step))
        count = max(_BEAM, found.top)
        for level in range(len(self._levels)):
            nodes, windows, _, estimates = self._expand(level, request, blocks, windows, np.inf)
            nearest = np.argpartition(estimates, min(count, estimates.size) - 1)[:count]
            blocks, windows = nodes[nearest], windows[nearest]
            if step > 1 and level < len(self._levels) - 1:
                step //= 2
                beside = windows[:, None] + np.array([-step, 0, step])
                side = windows[:, None] // STARTS * STARTS
                pairs = blocks[:, None].astype(np.int64) * self.numbering.per_type + side + (beside - side) % STARTS
                blocks, windows = np.divmod(np.unique(pairs), self.numbering.per_type)
        ids, real = self._ids(blocks, windows)
        found.evaluate(np.setdiff1d(ids[real], self.numbering.ids(found.windows)))

    def _leaves(
        self, request: RotationRequest, limit: Callable[[], float], stopped: Callable[[], bool]
    ) -> Iterator[tuple[Ints, Floats]]:
        """Yield the windows whose bounds are at most the limit, with their bounds, in parts."""

        def below(level: int, blocks: Ints, windows: Ints, bounds: Floats) -> Iterator[tuple[Ints, Floats]]:
            order = np.argsort(bounds, kind="stable") if bounds.size > _SLICE else np.arange(bounds.size)
            for first in range(0, order.size, _SLICE):
                if first and stopped():
                    return
                now = limit()
                part = order[first : first + _SLICE]
                part = part[bounds[part] <= now]
                nodes, inside, lower, _ = self._expand(level, request, blocks[part], windows[part], now)
                if level + 1 < len(self._levels):
                    yield from below(level + 1, nodes, inside, lower)
                else:
                    ids, real = self._ids(nodes, inside)
                    yield ids[real], lower[real]

        blocks, windows = self._roots(np.arange(self.numbering.per_type))
        return below(0, blocks, windows, np.zeros(blocks.size))

    def _every_window(
        self, target: Target, request: RotationRequest | None, found: BestWindows, limit: Callable[[], float]
    ) -> Iterator[tuple[Ints, Floats]]:
        """Yield the windows of a target with positions whose bounds are at most the limit, with their bounds."""
        positions = PositionRequest(target)
        indices = np.flatnonzero(self._rows >= 0)
        # some types from everywhere first, for the limit; then neighbours together, whose series are equally long
        spread = indices[:: max(1, indices.size // _TYPES_AT_ONCE)]
        remaining = np.setdiff1d(indices, spread)
        for part in [spread, *(remaining[k : k + _TYPES_AT_ONCE] for k in range(0, remaining.size, _TYPES_AT_ONCE))]:
            if found.stopped:
                return
            series, errors = self._series_of(part)
            squared = positions.squared(series, errors)
            if request is not None:
                squared += self._rotation_squared(request, series.astype(np.float32), errors)
            bounds = np.sqrt(squared)
            type_of, windows = np.nonzero(bounds <= limit())
            yield self._rows[part[type_of]] * self.numbering.per_type + windows, bounds[type_of, windows]

    def _series_of(self, leaves: Ints) -> tuple[Floats, Floats]:
        """Return series and errors of types by their leaves."""
        block, column = np.divmod(leaves, WIDTH)
        types = self._levels[-1]
        return types.series[block, :, column].astype(float), types.errors[block, :, column].astype(float)

    def _with_positions(self, positions: PositionRequest, ids: Ints, bounds: Floats) -> Floats:
        """Return bounds of windows that count positions, too."""
        rows, windows = np.divmod(ids, self.numbering.per_type)
        types, index = np.unique(rows, return_inverse=True)
        series, errors = self._series_of(self._leaf_of[types])
        return np.sqrt(bounds**2 + positions.squared_of_pairs(series, errors, index, windows))

    def _rotation_squared(self, request: RotationRequest, series: Singles, errors: Floats) -> Floats:
        """Return lower bounds of the mean squared rotation error of all windows of types, (n, windows)."""
        used = min(_FIRST_DIRECTIONS, request.target.size)
        rows = np.ascontiguousarray(request.rows[:, :used]).reshape(-1, series.shape[1])
        components = (series @ rows.T).reshape(len(series), -1, used) - request.target[:used]
        reach = (
            np.minimum(errors[:, 0], errors[:, 1] * request.spread) + request.rounding.sum() + 1e-5 * request.spread
        )
        return np.maximum(np.linalg.norm(components, axis=2) - reach[:, None], 0) ** 2

    # -- answers -------------------------------------------------------------------------------------------------------

    def best(
        self,
        target: Target,
        top: int,
        exact: Callable[[Windows], Floats] | None = None,
        max_windows: int | None = None,
        work: Work = UNLIMITED,
        enough: float = -1.0,
    ) -> tuple[Windows, ScanReport]:
        """Return the best windows of the whole table, exactly as if every window had been evaluated.

        Parameters
        ----------
        target : Target
            With rotation: its rms error after the best offset; with positions the joint objective, see `pose.objective`.
        top : int
            Number of windows wanted.
        exact : callable, optional
            ``exact(windows) -> error``, the exact error of windows: never below the rms error or the objective, infinite for
            windows that are no answer. Default: `errors`.
        max_windows : int, optional
            Largest number of windows evaluated exactly, beside those of the first look (but at least four times ``top``).
        work : Work, optional
            Once it has expired the scan ends with the best windows found so far.
        enough : float
            Once ``top`` windows have an error of at most this, no better ones are looked for; once the best has, the limit
            does not grow any more.

        Returns
        -------
        windows : Windows
            At most ``top``, by error, ties (to `TIE`) by number, start, branch. Law: equal to sorting all windows.
        report : ScanReport
            Says whether the time, ``max_windows`` or ``enough`` cut the scan short.
        """
        evaluate = exact or (lambda windows: self.errors(target, windows))
        max_windows_checked = np.inf if max_windows is None else max(max_windows, 4 * top)
        at_once = max(FIRST_BATCH, _EXACT_SAMPLES // target.samples)
        found = BestWindows(top, self.numbering, evaluate, at_once, work.expired, enough, max_windows_checked)
        if found.settled_in_order(self.types, self._alike(target)):
            return found.windows, ScanReport(self.windows, found.evaluated, not found.cut_short)
        request = None
        if target.rotation is not None:
            request = RotationRequest(target, self._amplitudes)
            self._first_look(request, found)
        ceiling = np.inf
        if request is not None and found.worst == np.inf:
            # limits exclude many windows: begin with what promising windows have without limits
            free = BestWindows(
                top, self.numbering, lambda windows: self.errors(target, windows), at_once, work.expired
            )
            self._first_look(request, free)
            ceiling = max(float(free.windows.error[len(free.windows.error) // 2 :].min(initial=np.inf)), TIE)
        found.evaluated, done, floor = 0, 0, -1.0

        def limit() -> float:
            return (min(found.worst, ceiling) + TIE) * (1 + 1e-9)

        by_tree, positions = request is not None, None
        if request is not None and target.position is not None:
            positions = PositionRequest(target)
        while True:
            if by_tree and request is not None:
                parts = self._leaves(request, limit, lambda: found.stopped)
            else:
                parts = self._every_window(target, request, found, limit)
            seen = looked_at = 0
            for ids, bounds in parts:
                new = bounds > floor
                seen += int(np.count_nonzero(new))
                ids, bounds = ids[new], bounds[new]
                if by_tree and positions is not None and ids.size > _FEW:
                    nearest = np.argpartition(bounds, _FEW // 4)[: _FEW // 4]
                    found.consider(ids[nearest], bounds[nearest])  # which lowers the limit for the others
                    candidates = np.flatnonzero(bounds <= limit())
                    looked_at += candidates.size
                    if looked_at > _MAX_BY_TREE:
                        break
                    ids, bounds = (
                        ids[candidates],
                        self._with_positions(positions, ids[candidates], bounds[candidates]),
                    )
                found.consider(ids, bounds)
                if found.stopped:
                    break
            else:
                done += seen
                if found.cut_short or min(found.worst, ceiling) == found.worst or done >= self.windows:
                    break
                if found.windows.error[:1].min(initial=np.inf) <= enough:
                    found.cut_short = True
                    break
                floor, ceiling = limit(), GROWTH * ceiling
                continue
            if found.cut_short:
                break
            by_tree, done, floor = False, 0, -1.0
        return found.windows, ScanReport(self.windows, found.evaluated, not found.cut_short)

    def _alike(self, target: Target) -> Floats | None:
        """Return the error of each type if it is the same from every start: all samples lie whole turns of the crank apart."""
        if target.rotation is None or target.position is not None or not target.repeats_one_crank_angle:
            return None
        winding = coupler_turns(self.lengths)
        kinds, example = np.unique(winding, return_index=True)
        zeros = np.zeros(kinds.size, dtype=np.int64)
        error = self.errors(target, Windows(example, zeros, zeros + 1, np.zeros(kinds.size)))
        return error[np.searchsorted(kinds, winding)]
