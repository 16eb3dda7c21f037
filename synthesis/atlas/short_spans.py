"""The best windows of a short span, from the index of `storeys`: boxes that may hold some, then their entries, then windows.

    likely windows, a few exact errors: a first limit
    boxes of all parts, level by level, all queries at once --(bound <= limit)--> leaves, each with some of the queries
    --(bound from the codes)--> windows --(limit of the likeliest)--> windows --(some exact samples)--> those to evaluate

The bounds are those of `queries`, for positions without rotation those of `path_queries`. That of a box holds for all it
contains, so no window below the limit is lost. Where the limit is large or many leaves are left, boxes of windows exclude
little and the cells of types do better: the search is given up, and what it knows by then serves as their ceiling.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.atlas.leaders import Leaders
from synthesis.atlas.path_queries import PathQueries, PathRequest
from synthesis.atlas.queries import ABOVE_SINGLE, Queries, Request
from synthesis.atlas.series import Floats, Ints, gather
from synthesis.atlas.storeys import StoreyIndex, Tree
from synthesis.atlas.trees import CODES, LEAF, NO_ENTRY, PARTS, Singles
from synthesis.atlas.windows import TIE, Windows
from synthesis.target import Target

LEAST_SPAN = np.deg2rad(5.0)
"""Below it the error of a tenth window is less than the rest of the entries."""
LARGEST_LIMIT = 0.05
"""First limit, radians, beyond which cells of types are left to do it: extreme curves are few, and cells are made for them."""
MOST_LEAVES = 5.0
"""Leaves, over the root of the number of types, beyond which the same."""
MOST_WINDOWS = 0.25
"""Windows, over the number of types, likewise: each costs a microsecond, and the cells need less."""
MOST_PLACED = 0.04
"""The same where positions are wanted too, of which the index knows nothing."""
LARGEST_SINE = 0.7
"""First limit, over what {1, e^{it}} leave of a path, beyond which all windows are compared with it."""
MOST_COMPARED = 1.0
"""Pairs of a leaf and a query for a path, over the number of types, beyond which the same."""
MOST_PATHS = 8.0
"""Windows for a path, over the number of types, likewise."""
MOST_SHORT_PATHS = 24.0
"""The same up to `SHORT_PATH`, where the error of the series leaves still more of all windows to be evaluated."""
SHORT_PATH = np.deg2rad(9.0)
_MOST_HELD = 1 << 22
"""Windows for a path at most: so many are held."""
_BEAM = 48
_LIKELY = 64
_BOXES_AT_ONCE = 512
_PAIRS_AT_ONCE = 512
_EVALUATED_AT_ONCE = 1 << 14
_TOO_MANY = 0.71
_MANY = 128
"""Windows for which a closer limit, or a few of their samples, are worth their time."""


class Near(NamedTuple):
    """Windows that are left, with a lower bound and an estimate of their error."""

    id: Ints
    bound: Floats
    estimate: Floats

    def take(self, places: Any) -> Near:
        """Some of them."""
        return Near(*(column[places] for column in self))


_NOTHING = Near(np.empty(0, dtype=np.int64), np.empty(0), np.empty(0))


class _GivenUp(Exception):
    """It does not pay to go on."""


class _OutOfTime(Exception):
    """The time is up."""


class _Worth(NamedTuple):
    """How far it pays to go on: a first limit, and numbers of leaves, of pairs of a leaf and a query, and of windows."""

    limit: float
    leaves: float
    pairs: float
    windows: float


class ShortSpan:
    """A request of a short span, or a path, and the index of its storey.

    Parameters
    ----------
    index : StoreyIndex
        Of rotations where the target has one, else of paths.
    target : Target
        Of a span that the storey is for.
    starts : int
        Of the turn, a multiple of the storey's intervals.
    expired : callable
        Asked between the steps, whether there is time for more.
    branches : int
        Of the mechanism: 2, or 1.
    """

    def __init__(
        self, index: StoreyIndex, target: Target, starts: int, expired: Callable[[], bool], branches: int = 2
    ) -> None:
        self.index, self.target = index, target
        self._expired = expired
        self._request: Request | PathRequest
        if target.rotation is not None:
            self._request = Request(target, index.storey, starts, branches)
            windows = MOST_WINDOWS if target.position is None else MOST_PLACED
            worth = _Worth(LARGEST_LIMIT, MOST_LEAVES * np.sqrt(index.types), np.inf, windows * index.types)
        else:
            self._request = PathRequest(target, index.storey, starts, branches)
            limit = LARGEST_SINE * self._request.length
            most = MOST_PATHS if float(np.ptp(target.crank)) > SHORT_PATH else MOST_SHORT_PATHS
            windows = min(most * index.types, _MOST_HELD)
            worth = _Worth(limit, np.inf, MOST_COMPARED * index.types, windows)
        self._worth = worth
        self._parts = [number for number, tree in enumerate(index.trees) if tree.levels]

    def candidates(self, leaders: Leaders, errors: Callable[[Target, Windows], Floats]) -> tuple[Ints, Floats] | None:
        """Numbers and lower bounds of all windows that may be among the best; None where the cells of types do better.

        Parameters
        ----------
        leaders : Leaders
            Gets the windows that are looked at on the way. Those that are left are compared with the worst of the best of them,
            also where the answer is None; where the time runs out it has the best found so far, and nothing is left.
        errors : callable
            ``errors(target, windows)``: the exact errors of windows for some of the samples, whatever rule there is beside them.
        """
        try:
            return self._candidates(leaders, errors)
        except _GivenUp:
            return None
        except _OutOfTime:
            return _NOTHING.id, _NOTHING.bound

    def _candidates(self, leaders: Leaders, errors: Callable[[Target, Windows], Floats]) -> tuple[Ints, Floats]:
        if not self._parts or self._request.without_rest or not self._any_below(self._worth.limit):
            raise _GivenUp
        wanted = max(_LIKELY, leaders.top)
        looked = self._likely(0, wanted)[0]
        self._evaluate(leaders, looked)
        if leaders.worst > self.index.storey.sharp:
            looked = np.union1d(looked, self._look_at_sharp_ones(looked, wanted, leaders, errors))
        if leaders.reached:
            return _NOTHING.id, _NOTHING.bound
        if not leaders.worst <= self._worth.limit:
            raise _GivenUp
        near = self._below(leaders.worst + TIE)
        if near.id.size > _MANY:
            likely = np.argpartition(near.estimate, min(_LIKELY, near.id.size - 1))[:_LIKELY]
            likely = near.id[likely]
            self._go_on()
            self._evaluate(leaders, likely[np.isin(likely, looked, invert=True)])
            near = near.take(near.bound <= leaders.worst + TIE)
        return self._by_samples(near, leaders, errors) if near.id.size > _MANY else (near.id, near.bound)

    def _look_at_sharp_ones(
        self, looked: Ints, wanted: int, leaders: Leaders, errors: Callable[[Target, Windows], Floats]
    ) -> Ints:
        """Evaluate windows of the entries that are kept by a part of their interval, those first that few samples favour."""
        self._go_on()
        found = [self._likely(number, 4 * wanted) for number, _ in enumerate(self._parts) if number]
        ids = np.concatenate([looked[:0], *(some for some, _ in found)])
        ids = ids[np.isin(ids, looked, invert=True)]
        if not ids.size:
            return ids
        part, _ = self._request.some_samples()
        error = errors(part, leaders.numbering.windows(ids))
        best = ids[np.argsort(error, kind="stable")[:wanted]]
        self._go_on()
        self._evaluate(leaders, best)
        return best

    def _evaluate(self, leaders: Leaders, ids: Ints) -> None:
        """Evaluate windows, no more at once than the leaders may."""
        for first in range(0, ids.size, leaders.at_once):
            if first:
                self._go_on()
            leaders.evaluate(ids[first : first + leaders.at_once])

    def _by_samples(
        self, near: Near, leaders: Leaders, errors: Callable[[Target, Windows], Floats]
    ) -> tuple[Ints, Floats]:
        """Those of some windows whose exact error over a few samples allows them among the best."""
        part, share = self._request.some_samples()
        if share > _TOO_MANY:
            return near.id, near.bound
        bound = near.bound
        for first in range(0, near.id.size, _EVALUATED_AT_ONCE):
            self._go_on()
            chosen = slice(first, first + _EVALUATED_AT_ONCE)
            error = share * (1 - 1e-12) * errors(part, leaders.numbering.windows(near.id[chosen]))
            bound[chosen] = np.maximum(bound[chosen], error - self._request.rounding)
        kept = np.flatnonzero(bound <= leaders.worst + TIE)
        return near.id[kept], bound[kept]

    def _go_on(self) -> None:
        if self._expired():
            raise _OutOfTime

    @cached_property
    def _queries(self) -> Queries | PathQueries:
        """Of all parts that have entries."""
        ends = np.array([self.index.trees[part].part for part in self._parts])
        return self._request.queries(ends, self.index.reach[self._parts])

    def _any_below(self, limit: float) -> bool:
        """Whether a resolved entry may have an error of at most a limit, by the coarsest boxes and by what no entry follows."""
        first, count = self.index.trees[0].levels[0]
        whole = self._request.queries(np.array([[-1.0, 1.0]]), self.index.reach[:1])
        return bool(whole.may_be_below(limit, 0, self.index.boxes[first : first + count]).any())

    # -- a first look -------------------------------------------------------------------------------------------------

    def _likely(self, number: int, wanted: int) -> tuple[Ints, Singles]:
        """Windows of a tree that are likely among the best, each once, with their distances."""
        tree, terms = self.index.trees[self._parts[number]], self.index.size
        queries = self._queries

        at = np.arange(tree.levels[0][1])
        for level, (first, _) in enumerate(tree.levels):
            box = gather(self.index.boxes, first + at)
            if at.size > _BEAM:
                far = queries.likely(number, box[:, :terms], box[:, -1]).min(axis=0)
                best = np.argpartition(far, _BEAM)[:_BEAM]
                at, box = at[best], box[best]
            if level + 1 < len(tree.levels):
                at = (PARTS * at[:, None] + np.arange(PARTS)).ravel()
                at = at[at < tree.levels[level + 1][1]]
        points, rest = self._points(tree.first + at, box)
        entry = gather(self.index.entries, tree.first + at).ravel()
        far = queries.likely(number, points.swapaxes(1, 2).reshape(-1, terms), rest.ravel())
        far[:, entry == NO_ENTRY] = np.inf
        far = far.ravel()
        count = min(wanted, far.size)
        best = np.argpartition(far, count - 1)[:count]
        best = best[np.isfinite(far[best])]
        query, place = np.divmod(best, entry.size)
        return self._request.windows(entry[place], query), far[best]

    def _points(self, leaves: Ints, box: Singles) -> tuple[Singles, Singles]:
        """Coefficients of the entries of some leaves, (leaves, K, LEAF), to half a step of their codes, and their rests."""
        terms = self.index.size
        codes = gather(self.index.codes, leaves).astype(np.float32)
        points = codes[:, :terms]
        points *= box[:, terms:-1, None] / np.float32(CODES)
        points += box[:, :terms, None]
        rest = codes[:, terms]
        rest += 128
        rest *= (box[:, -1:] / np.float32(255)) * ABOVE_SINGLE
        return points, rest

    # -- the search ---------------------------------------------------------------------------------------------------

    def _below(self, limit: float) -> Near:
        """All windows whose bound is at most ``limit``."""
        limit += self._request.rounding
        queries, trees = self._queries, [self.index.trees[part] for part in self._parts]
        most, pairs = self._worth.leaves, []
        for number, tree in enumerate(trees):
            leaves, boxes, mask = self._leaves(tree, queries, number, limit, most)
            which, query = np.nonzero(mask.T)  # leaf by leaf: the entries of each are decoded once
            pairs.append((number * self._request.size + query, leaves[which] + tree.first, boxes[which]))
            most -= leaves.size
        problem, leaf, box = (np.concatenate(column) for column in zip(*pairs))
        if problem.size > self._worth.pairs:
            raise _GivenUp
        found, held = [_NOTHING], 0
        for first in range(0, problem.size, _PAIRS_AT_ONCE):
            part = slice(first, first + _PAIRS_AT_ONCE)
            found.append(self._entries(queries, limit, problem[part], leaf[part], box[part]))
            held += found[-1].id.size
            if held > self._worth.windows:
                raise _GivenUp
            self._go_on()
        return Near(*(np.concatenate(column) for column in zip(*found)))

    def _leaves(
        self, tree: Tree, queries: Queries | PathQueries, number: int, limit: float, most: float
    ) -> tuple[Ints, Ints, NDArray[np.bool_]]:
        """Leaves that are left, their boxes, and for which queries (Q, leaves)."""
        at = np.arange(tree.levels[0][1])
        for level, (first, _) in enumerate(tree.levels):
            finest = level + 1 == len(tree.levels)
            kept, masks = [at[:0]], [np.empty((self._request.size, 0), dtype=bool)]
            for begin in range(0, at.size, _BOXES_AT_ONCE):
                part = at[begin : begin + _BOXES_AT_ONCE]
                mask = queries.may_be_below(limit, number, gather(self.index.boxes, first + part))
                some = np.flatnonzero(mask.any(axis=0))
                kept.append(part[some])
                masks.append(mask[:, some])
            at = np.concatenate(kept)
            if at.size > most * (1 if finest else 0.5):
                raise _GivenUp
            self._go_on()
            if not finest:
                at = (PARTS * at[:, None] + np.arange(PARTS)).ravel()
                at = at[at < tree.levels[level + 1][1]]
        return at, first + at, np.concatenate(masks, axis=1)

    def _entries(self, queries: Queries | PathQueries, limit: float, problem: Ints, leaf: Ints, boxes: Ints) -> Near:
        """Windows of the entries of some leaves, each for a query."""
        size = self.index.size
        leaves, first, which = np.unique(leaf, return_index=True, return_inverse=True)
        box = gather(self.index.boxes, boxes[first])
        points, rest = self._points(leaves, box)
        half: Singles = np.divide(box[:, size:-1, None], 2 * CODES, dtype=np.float32)
        near, bound, likely = queries.entries(limit, problem, points[which], half[which], rest[which])
        entry = gather(self.index.entries, leaf).ravel()[near]
        real = entry != NO_ENTRY
        near, bound, likely = near[real], bound[real] - self._request.rounding, likely[real]
        ids = self._request.windows(entry[real], problem[near // LEAF] % self._request.size)
        return Near(ids, np.maximum(bound, 0.0), likely)
