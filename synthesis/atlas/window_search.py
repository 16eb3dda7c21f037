"""The best windows of a short span, from the index of `window_index`: boxes that may hold some, their entries, then windows.

    likely windows, a few exact errors: a first limit
    boxes of all parts, level by level, all queries at once --(bound <= limit)--> leaves, each with some of the queries
    --(bound from the codes)--> windows --(limit of the likeliest)--> windows --(some exact samples)--> those to evaluate

The bound of a box holds for all it contains, so no window below the limit is lost. Where the limit is large or many leaves are
left, boxes of windows exclude little and the cells of types do better: the search is given up, and what it knows by then serves
as their ceiling.

A request's windows differ, for the entries, only by where a window's middle lies in its interval: by one of starts / intervals
offsets, on one of two branches. (Branch -1 is the same curve mirrored, theta2(x, -1) = -theta2(-x, +1): there the request is
(-g, -t).) So a request is a few dozen *queries*, whatever the number of types.

Bounds. Let v_m be the samples in an interval's coordinate for one offset, V the matrix of P_k(v_m), k = 1 .. K, less its mean
over the samples, each row times the root of its weight, and g the centred target, weighted alike. Whatever Q of orthonormal
columns spans the columns of V, with R = Q' V, y = Q' g and l^2 = |g|^2 - |y|^2 (computed as the size of g - Q y),

    | g - V a |^2 = | y - R a |^2 + l^2

without any approximation. An entry's curve is sum_k a_k P_k to within its remainder E, and the rms of what is left after the best
constant is a seminorm, so by the triangle inequality

    error >= sqrt(| y - R a |^2 + l^2) - E.

* *Box*, a within ``half`` of ``middle``: component j of R a is within h_j = sum_k |R_jk| half_k of that of the middle, so
  | y - R a | is at least the norm of max(0, |y - R middle|_j - h_j). A code is a box of half a step.
* *Part of the samples*, total weight s^2 of 1: any constant leaves at least what the best one of the part leaves, so the
  error is at least the norm over the part: sqrt(| y - R a |^2 + l^2) - s E with y, R, l of those samples. By this the entries
  that are kept by a part of their interval are bounded, and windows by a few exact samples.

Q spans the polynomials of degree K over the samples, less the constant: the same for all offsets and both branches.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Floats, Ints, Singles
from synthesis.atlas.series import gather
from synthesis.atlas.window_index import CHILDREN, CODES, LEAF, NO_ENTRY, Intervals, RTree, WindowIndex
from synthesis.atlas.windows import TIE, BestWindows, Windows
from synthesis.target import TURN, Target

LEAST_SPAN = np.deg2rad(5.0)
"""Below it the error of a tenth window is less than the remainder of the entries."""
LARGEST_LIMIT = 0.05
"""First limit, radians, beyond which cells of types are left to do it: extreme curves are few, and cells are made for them."""
MOST_LEAVES = 5.0
"""Leaves, over the root of the number of types, beyond which the same."""
MOST_WINDOWS = 0.25
"""Windows, over the number of types, likewise: each costs a microsecond, and the cells need less."""
MOST_PLACED = 0.04
"""The same where positions are wanted too, of which the index knows nothing."""
_BEAM = 48
_LIKELY = 64
_BOXES_AT_ONCE = 512
_PAIRS_AT_ONCE = 512
_EVALUATED_AT_ONCE = 1 << 14
_TOO_MANY = 0.71
_MANY = 128
"""Windows for which a closer limit, or a few of their samples, are worth their time."""
_ABOVE = np.float32(1 + 2e-6)
"""Makes up for the rounding of a few operations in single precision."""
_SINGLE = 16 * 2.0**-24
"""Rounding of a few products in single precision, relative to the sum of the sizes of their terms."""
_MALUS = 0.3
"""By how much of its remainder an entry counts as worse in a first look."""
_RANGES = 32
_FEW_SAMPLES = 4
_OF_ALL_SAMPLES = 8
_LEAST_SHARE = 0.3
_NEXT_TO_NOTHING = np.finfo(float).tiny


class Bounds(NamedTuple):
    """Entries that are left of some leaves: place, lower bound and estimate of the error."""

    near: Ints
    bound: Floats
    estimate: Floats


class Queries(NamedTuple):
    """A request against the entries of some parts of the intervals: of each part all offsets of branch +1, then of -1.

    Attributes
    ----------
    rows : ndarray of float32, shape (parts, J, Q, K)
        R of each query: part, j, query, k.
    sizes : ndarray of float32, shape (parts, J, Q, K)
        Their sizes |R_jk|.
    wanted : ndarray of float32, shape (parts, J, Q)
        y.
    slack : ndarray of float32, shape (parts, J, Q)
        Rounding of y - R a.
    left : ndarray of float32, shape (parts, Q)
        l^2.
    share : ndarray of float32, shape (parts, Q)
        s, by which an entry's remainder counts.
    """

    rows: Singles
    sizes: Singles
    wanted: Singles
    slack: Singles
    left: Singles
    share: Singles

    def likely(self, part: int, points: Singles, remainder: Singles) -> Singles:
        """About the error of entries of a part, for each query: (Q, points); the worse the less is known of one."""
        gap = self.rows[part].reshape(-1, points.shape[1]) @ points.T
        gap -= self.wanted[part].reshape(-1, 1)
        gap = gap.reshape(-1, self.rows.shape[2], len(points))
        far: Singles = np.sqrt(np.einsum("jqn,jqn->qn", gap, gap) + self.left[part][:, None])
        far += np.float32(_MALUS) * remainder
        far[self.share[part] < _LEAST_SHARE] = np.inf
        return far

    def entries(self, limit: float, problem: Ints, points: Singles, half: Singles, remainder: Singles) -> Bounds:
        """Which entries of some leaves, each for a query, may have an error of at most ``limit``.

        ``problem`` (n,): part * Q + query. ``points`` (n, K, LEAF). ``half`` (n, K, 1): by how much the points may be
        off. ``remainder`` (n, LEAF).
        """

        def of(values: Singles) -> Singles:
            return gather(values.swapaxes(1, 2).reshape(-1, *values.shape[1:2], *values.shape[3:]), problem)

        gap = of(self.rows) @ points
        gap -= of(self.wanted)[..., None]
        estimate = np.einsum("pjn,pjn->pn", gap, gap)
        np.abs(gap, out=gap)
        largest = (of(self.sizes) @ half)[..., 0] + of(self.slack)
        gap -= largest[..., None]
        np.maximum(gap, 0, out=gap)
        least = np.einsum("pjn,pjn->pn", gap, gap)
        left = gather(self.left.ravel(), problem)[:, None]
        error = gather(self.share.ravel(), problem)[:, None] * remainder
        near = np.flatnonzero(least <= (error + np.float32(limit)) ** 2 * _ABOVE - left)
        left = left[near // points.shape[-1], 0].astype(float)
        bound = np.sqrt(least.ravel()[near] * (1 - 2e-6) + left) - error.ravel()[near] * (1 + 1e-6)
        return Bounds(near, bound, np.sqrt(estimate.ravel()[near] + left))

    def may_be_below(self, limit: float, part: int, box: Singles) -> NDArray[np.bool_]:
        """Which boxes may hold an error of at most ``limit``, for each query of a part: (Q, boxes)."""
        terms = self.rows.shape[-1]
        gap = self.rows[part].reshape(-1, terms) @ box[:, :terms].T
        gap -= self.wanted[part].reshape(-1, 1)
        np.abs(gap, out=gap)
        largest = self.sizes[part].reshape(-1, terms) @ box[:, terms:-1].T
        largest += self.slack[part].reshape(-1, 1)
        gap -= largest
        np.maximum(gap, 0, out=gap)
        gap *= gap
        most = self.share[part][:, None] * box[:, -1]
        most += np.float32(limit)
        most *= most
        most *= _ABOVE
        most -= self.left[part][:, None]
        return gap.reshape(-1, self.rows.shape[2], len(box)).sum(axis=0) <= most


class Request:
    """A rotation as it meets the entries of some intervals.

    ``target``: of a span that the intervals are for. ``starts``: of the turn, a multiple of the intervals.
    ``branches``: of the mechanism: 2, or 1.

    ``rounding``: of errors, in radians, and of what bounds them.
    """

    def __init__(self, target: Target, intervals: Intervals, starts: int, branches: int = 2) -> None:
        self.target, self.intervals, self.starts, self.branches = target, intervals, starts, branches
        self._signs = np.array([1.0, -1.0])[:branches]
        low, high = float(target.crank.min()), float(target.crank.max())
        self._along = target.crank - (low + high) / 2
        self._per_branch = starts // intervals.number
        step = TURN / starts
        middle = (low + high) / 2 / step * self._signs  # of a window that begins at crank angle 0
        self._first = np.ceil(-self._per_branch / 2 - middle).astype(np.int64)
        offsets = (self._first + middle)[:, None] + np.arange(self._per_branch)
        along = self._along * self._signs[:, None]
        places = along[:, None] + step * offsets[..., None]
        self._places = places.reshape(self.size, -1) / intervals.half_width
        self._shift = step * offsets.ravel()
        assert target.rotation is not None
        mean = target.rotation_mean
        centred = target.rotation - mean(target.rotation)
        self._given = centred - mean(centred)
        self._weights = np.full(target.samples, 1 / target.samples) if mean.weights is None else mean.weights
        # of theta2 and of the rotation at the samples, as the exact error has them
        self.rounding = 1e-12 + 16 * np.finfo(float).eps * float(np.abs(target.rotation).max())

    @property
    def size(self) -> int:
        """Queries of a part: offsets of all branches."""
        return self.branches * self._per_branch

    def windows(self, entry: NDArray[np.integer], query: Ints) -> Ints:
        """Numbers of the windows that entries are to queries; all windows of a table between them, each once."""
        row, place = np.divmod(entry.astype(np.int64), self.intervals.number)
        mirrored, offset = np.divmod(query, self._per_branch)
        start = place * self._per_branch + offset + self._first[mirrored]
        start = np.where(mirrored == 1, -start, start) % self.starts
        return (self.branches * row + mirrored) * self.starts + start

    def some_samples(self) -> tuple[Target, float]:
        """The rotation at a few of the samples, and the root of their part of the weights."""
        target, weights = self.target, self.target.rotation_weights
        given = np.arange(target.samples) if weights is None else np.flatnonzero(weights)
        count = min(max(_FEW_SAMPLES, -(-given.size // _OF_ALL_SAMPLES)), given.size)
        some = given[np.round(np.linspace(0, given.size - 1, count)).astype(int)]
        share = count / target.samples if weights is None else weights[some].sum() / weights.sum()
        own = None if weights is None else weights[some]
        assert target.rotation is not None
        part = replace(target, crank=target.crank[some], rotation=target.rotation[some], rotation_weights=own)
        return replace(part, position=None, position_weights=None), float(np.sqrt(share))

    def queries(self, parts: NDArray[np.float64], largest: NDArray[np.floating]) -> Queries:
        """The request against the entries of some parts of the intervals.

        ``parts`` (parts, 2): their ends. ``largest`` (parts, K): largest size of each coefficient of the entries.
        """
        count, samples = len(parts), self._along.size
        low, high = (np.repeat(end, self.size)[:, None] for end in parts.T)
        within = (np.tile(self._places, (count, 1)) >= low) & (np.tile(self._places, (count, 1)) <= high)
        # where samples are many, ranges of them that are nearly the same are made the same
        grain = -(-samples // _RANGES)
        first = -(-within.argmax(axis=1) // grain) * grain
        last = within.argmax(axis=1) + within.sum(axis=1)
        last = np.maximum(np.where(last == samples, last, last // grain * grain), first)
        ranges, which = np.unique(first * (samples + 1) + last, return_inverse=True)
        first, last = np.divmod(ranges, samples + 1)
        inside = (np.arange(samples) >= first[:, None]) & (np.arange(samples) < last[:, None])
        weights = np.where(inside, self._weights, 0.0)
        share = weights.sum(axis=1)
        total = np.maximum(share, _NEXT_TO_NOTHING)[:, None]
        roots = np.sqrt(weights)
        # the polynomials of the range's own coordinate, place = (along - middle) / half, made orthonormal
        ends = self._along[np.minimum(first, samples - 1)], self._along[np.maximum(last, 1) - 1]
        middle, half = (ends[0] + ends[1]) / 2, np.abs(ends[1] - ends[0]) / 2
        half = np.where(half > 0, half, 1.0)
        columns = polynomials(
            np.where(inside, (self._along - middle[:, None]) / half[:, None], 0.0), self.intervals.terms
        )
        columns -= (weights[:, None] @ columns) / total[..., None]
        columns *= roots[..., None]
        basis = np.linalg.qr(columns)[0]
        along = basis.transpose(0, 2, 1) @ columns
        given = roots * (self._given - (weights @ self._given)[:, None] / total)
        wanted = (given[:, None] @ basis)[:, 0]
        unexplained = given - (basis @ wanted[..., None])[..., 0]
        left = (unexplained**2).sum(axis=1)
        # those of the part's coordinate are sums of those of the range's
        sign = np.tile(np.repeat(self._signs, self._per_branch), count)
        scale = 2 / (high - low)[:, 0] / self.intervals.half_width
        shifted = scale * (sign * middle[which] + np.tile(self._shift, count)) - ((high + low) / (high - low))[:, 0]
        rows = along[which] @ _substituted(scale * sign * half[which], shifted, self.intervals.terms)
        y = sign[:, None] * wanted[which]
        slack = _SINGLE * (np.abs(y) + (np.abs(rows) @ np.repeat(largest, self.size, axis=0)[..., None])[..., 0])

        def single(values: Floats) -> Singles:
            """Part, j, query, ..."""
            values = values.reshape(count, self.size, *values.shape[1:])
            return np.ascontiguousarray(values.swapaxes(1, 2) if values.ndim > 2 else values, dtype=np.float32)

        left, share = left[which] * (1 - 2e-6), np.sqrt(share)[which] * (1 + 1e-6)
        return Queries(single(rows), single(np.abs(rows)), *map(single, (y, slack, left, share)))


def polynomials(v: Floats, terms: int) -> Floats:
    """P_1 .. P_terms at points in [-1, 1]; shape (..., terms). Law: P_k(1) = 1, and |P_k| <= 1 (DLMF 18.9.1)."""
    result = np.empty((*v.shape, terms))
    before, now = np.ones_like(v), v
    for k in range(1, terms + 1):
        result[..., k - 1] = now
        before, now = now, ((2 * k + 1) * v * now - k * before) / (k + 1)
    return result


def _substituted(scale: Floats, shift: Floats, terms: int) -> Floats:
    """Coefficients in P_j(x) of P_k(scale x + shift), j and k = 1 .. terms, (n, j, k).

    By Gauss's rule, which is exact here: a product of two of them is of degree 2 terms at most.
    """
    point, weight = np.polynomial.legendre.leggauss(terms + 1)
    own = polynomials(point, terms) * (weight[:, None] * (np.arange(1, terms + 1) + 0.5))
    return own.T @ polynomials(scale[:, None] * point + shift[:, None], terms)


# -- the search --------------------------------------------------------------------------------------------------------


class Candidates(NamedTuple):
    """Windows that are left, with a lower bound and an estimate of their error."""

    id: Ints
    bound: Floats
    estimate: Floats

    def take(self, places: Any) -> Candidates:
        """Some of them."""
        return Candidates(*(column[places] for column in self))


_NOTHING = Candidates(np.empty(0, dtype=np.int64), np.empty(0), np.empty(0))


class _GivenUp(Exception):
    """It does not pay to go on."""


class _OutOfTime(Exception):
    """The time is up."""


class WindowSearch:
    """A rotation over a short span, and the index of the intervals for it.

    ``target``: of a span that its intervals are for. ``starts``: of the turn, a multiple of the intervals. ``expired``:
    asked between the steps, whether there is time for more. ``branches``: of the mechanism: 2, or 1.
    """

    def __init__(
        self, index: WindowIndex, target: Target, starts: int, expired: Callable[[], bool], branches: int = 2
    ) -> None:
        self.index, self.target = index, target
        self._expired = expired
        self._request = Request(target, index.intervals, starts, branches)
        self._most_leaves = MOST_LEAVES * np.sqrt(index.types)
        self._most_windows = index.types * (MOST_WINDOWS if target.position is None else MOST_PLACED)
        self._parts = [number for number, tree in enumerate(index.trees) if tree.levels]

    def candidates(
        self, best: BestWindows, errors: Callable[[Target, Windows], Floats]
    ) -> tuple[Ints, Floats] | None:
        """Numbers and lower bounds of all windows that may be among the best; None where the cells of types do better.

        ``best``: gets the windows that are looked at on the way. Those that are left are compared with the worst of the
        best of them, also where the answer is None; where the time runs out it has the best found so far, and nothing
        is left. ``errors``: ``errors(target, windows)``: the exact errors of windows for some of the samples, whatever
        rule there is beside them.
        """
        try:
            return self._candidates(best, errors)
        except _GivenUp:
            return None
        except _OutOfTime:
            return _NOTHING.id, _NOTHING.bound

    def _candidates(self, best: BestWindows, errors: Callable[[Target, Windows], Floats]) -> tuple[Ints, Floats]:
        if not self._parts or not self._any_below(LARGEST_LIMIT):
            raise _GivenUp
        wanted = max(_LIKELY, best.top)
        looked = self._likely(0, wanted)
        self._evaluate(best, looked)
        if best.worst > self.index.intervals.sharp:
            looked = np.union1d(looked, self._look_at_sharp_ones(looked, wanted, best, errors))
        if best.reached:
            return _NOTHING.id, _NOTHING.bound
        if not best.worst <= LARGEST_LIMIT:
            raise _GivenUp
        near = self._below(best.worst + TIE)
        if near.id.size > _MANY:
            likely = np.argpartition(near.estimate, min(_LIKELY, near.id.size - 1))[:_LIKELY]
            likely = near.id[likely]
            self._go_on()
            self._evaluate(best, likely[np.isin(likely, looked, invert=True)])
            near = near.take(near.bound <= best.worst + TIE)
        return self._by_samples(near, best, errors) if near.id.size > _MANY else (near.id, near.bound)

    def _look_at_sharp_ones(
        self, looked: Ints, wanted: int, best: BestWindows, errors: Callable[[Target, Windows], Floats]
    ) -> Ints:
        """Evaluate windows of the entries that are kept by a part of their interval, those first that few samples favour."""
        self._go_on()
        found = [self._likely(number, 4 * wanted) for number, _ in enumerate(self._parts) if number]
        ids = np.concatenate([looked[:0], *found])
        ids = ids[np.isin(ids, looked, invert=True)]
        if not ids.size:
            return ids
        part, _ = self._request.some_samples()
        error = errors(part, best.numbering.windows(ids))
        nearest = ids[np.argsort(error, kind="stable")[:wanted]]
        self._go_on()
        self._evaluate(best, nearest)
        return nearest

    def _evaluate(self, best: BestWindows, ids: Ints) -> None:
        for first in range(0, ids.size, best.at_once):
            if first:
                self._go_on()
            best.evaluate(ids[first : first + best.at_once])

    def _by_samples(
        self, near: Candidates, best: BestWindows, errors: Callable[[Target, Windows], Floats]
    ) -> tuple[Ints, Floats]:
        """Those of some windows whose exact error over a few samples allows them among the best."""
        part, share = self._request.some_samples()
        if share > _TOO_MANY:
            return near.id, near.bound
        bound = near.bound
        for first in range(0, near.id.size, _EVALUATED_AT_ONCE):
            self._go_on()
            chosen = slice(first, first + _EVALUATED_AT_ONCE)
            error = share * (1 - 1e-12) * errors(part, best.numbering.windows(near.id[chosen]))
            bound[chosen] = np.maximum(bound[chosen], error - self._request.rounding)
        kept = np.flatnonzero(bound <= best.worst + TIE)
        return near.id[kept], bound[kept]

    def _go_on(self) -> None:
        if self._expired():
            raise _OutOfTime

    @cached_property
    def _queries(self) -> Queries:
        ends = np.array([self.index.trees[part].part for part in self._parts])
        return self._request.queries(ends, self.index.largest[self._parts])

    def _any_below(self, limit: float) -> bool:
        """Whether a resolved entry may have an error of at most a limit, by the coarsest boxes and by what no entry follows."""
        first, count = self.index.trees[0].levels[0]
        whole = self._request.queries(np.array([[-1.0, 1.0]]), self.index.largest[:1])
        return bool(whole.may_be_below(limit, 0, self.index.boxes[first : first + count]).any())

    # -- a first look -------------------------------------------------------------------------------------------------

    def _likely(self, number: int, wanted: int) -> Ints:
        """Windows of a tree that are likely among the best, each once."""
        tree, terms = self.index.trees[self._parts[number]], self.index.intervals.terms
        queries = self._queries

        at = np.arange(tree.levels[0][1])
        for level, (first, _) in enumerate(tree.levels):
            box = gather(self.index.boxes, first + at)
            if at.size > _BEAM:
                far = queries.likely(number, box[:, :terms], box[:, -1]).min(axis=0)
                best = np.argpartition(far, _BEAM)[:_BEAM]
                at, box = at[best], box[best]
            if level + 1 < len(tree.levels):
                at = (CHILDREN * at[:, None] + np.arange(CHILDREN)).ravel()
                at = at[at < tree.levels[level + 1][1]]
        points, remainder = self._points(tree.first_leaf + at, box)
        entry = gather(self.index.entries, tree.first_leaf + at).ravel()
        far = queries.likely(number, points.swapaxes(1, 2).reshape(-1, terms), remainder.ravel())
        far[:, entry == NO_ENTRY] = np.inf
        far = far.ravel()
        count = min(wanted, far.size)
        best = np.argpartition(far, count - 1)[:count]
        best = best[np.isfinite(far[best])]
        query, place = np.divmod(best, entry.size)
        return self._request.windows(entry[place], query)

    def _points(self, leaves: Ints, box: Singles) -> tuple[Singles, Singles]:
        """Coefficients of the entries of some leaves, (leaves, K, LEAF), to half a step of their codes, and their remainders."""
        terms = self.index.intervals.terms
        codes = gather(self.index.codes, leaves).astype(np.float32)
        points = codes[:, :terms]
        points *= box[:, terms:-1, None] / np.float32(CODES)
        points += box[:, :terms, None]
        remainder = codes[:, terms]
        remainder += 128
        remainder *= (box[:, -1:] / np.float32(255)) * _ABOVE
        return points, remainder

    # -- the search ---------------------------------------------------------------------------------------------------

    def _below(self, limit: float) -> Candidates:
        limit += self._request.rounding
        queries, trees = self._queries, [self.index.trees[part] for part in self._parts]
        most, pairs = self._most_leaves, []
        for number, tree in enumerate(trees):
            leaves, boxes, mask = self._leaves(tree, queries, number, limit, most)
            which, query = np.nonzero(mask.T)  # leaf by leaf: the entries of each are decoded once
            pairs.append((number * self._request.size + query, leaves[which] + tree.first_leaf, boxes[which]))
            most -= leaves.size
        problem, leaf, box = (np.concatenate(column) for column in zip(*pairs))
        found, held = [_NOTHING], 0
        for first in range(0, problem.size, _PAIRS_AT_ONCE):
            part = slice(first, first + _PAIRS_AT_ONCE)
            found.append(self._entries(queries, limit, problem[part], leaf[part], box[part]))
            held += found[-1].id.size
            if held > self._most_windows:
                raise _GivenUp
            self._go_on()
        return Candidates(*(np.concatenate(column) for column in zip(*found)))

    def _leaves(
        self, tree: RTree, queries: Queries, number: int, limit: float, most: float
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
                at = (CHILDREN * at[:, None] + np.arange(CHILDREN)).ravel()
                at = at[at < tree.levels[level + 1][1]]
        return at, first + at, np.concatenate(masks, axis=1)

    def _entries(self, queries: Queries, limit: float, problem: Ints, leaf: Ints, boxes: Ints) -> Candidates:
        terms = self.index.intervals.terms
        leaves, first, which = np.unique(leaf, return_index=True, return_inverse=True)
        box = gather(self.index.boxes, boxes[first])
        points, remainder = self._points(leaves, box)
        half: Singles = np.divide(box[:, terms:-1, None], 2 * CODES, dtype=np.float32)
        near, bound, likely = queries.entries(limit, problem, points[which], half[which], remainder[which])
        entry = gather(self.index.entries, leaf).ravel()[near]
        real = entry != NO_ENTRY
        near, bound, likely = near[real], bound[real] - self._request.rounding, likely[real]
        ids = self._request.windows(entry[real], problem[near // LEAF] % self._request.size)
        return Candidates(ids, np.maximum(bound, 0.0), likely)
