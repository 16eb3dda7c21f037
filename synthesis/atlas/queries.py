"""A request of a short span as queries of the entries of `storeys`: where its windows lie, and how far from an entry.

A request's windows differ, for the entries, only by where a window's middle lies in its interval: by one of starts / places
offsets, on one of two branches. (Branch -1 is the same curve mirrored, theta2(x, -1) = -theta2(-x, +1): there the request is
(-g, -t).) So a request is a few dozen *queries*, whatever the number of types.

Bounds. Let v_m be the samples in an interval's coordinate for one offset, V the matrix of P_k(v_m), k = 1 .. K, less its mean
over the samples, each row times the root of its weight, and g the centred target, weighted alike. Whatever Q of orthonormal
columns spans the columns of V, with R = Q' V, y = Q' g and l^2 = |g|^2 - |y|^2 (computed as the size of g - Q y),

    | g - V a |^2 = | y - R a |^2 + l^2

without any approximation. An entry's curve is sum_k a_k P_k to within its rest E, and the rms of what is left after the best
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

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.atlas.legendre import polynomials
from synthesis.atlas.series import Floats, Ints, gather
from synthesis.atlas.storeys import Storey
from synthesis.atlas.trees import Singles
from synthesis.target import TURN, Target

ABOVE_SINGLE = np.float32(1 + 2e-6)
"""Makes up for the rounding of a few operations in single precision."""
_SINGLE = 16 * 2.0**-24
"""Rounding of a few products in single precision, relative to the sum of the sizes of their terms."""
MALUS = 0.3
"""By how much of its rest an entry counts as worse in a first look."""
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
    rest : ndarray of float32, shape (parts, Q)
        l^2.
    share : ndarray of float32, shape (parts, Q)
        s, by which an entry's rest counts.
    """

    rows: Singles
    sizes: Singles
    wanted: Singles
    slack: Singles
    rest: Singles
    share: Singles

    def likely(self, part: int, points: Singles, rest: Singles) -> Singles:
        """About the error of entries of a part, for each query: (Q, points); the worse the less is known of one."""
        gap = self.rows[part].reshape(-1, points.shape[1]) @ points.T
        gap -= self.wanted[part].reshape(-1, 1)
        gap = gap.reshape(-1, self.rows.shape[2], len(points))
        far: Singles = np.sqrt(np.einsum("jqn,jqn->qn", gap, gap) + self.rest[part][:, None])
        far += np.float32(MALUS) * rest
        far[self.share[part] < _LEAST_SHARE] = np.inf
        return far

    def entries(self, limit: float, problem: Ints, points: Singles, half: Singles, rest: Singles) -> Bounds:
        """Which entries of some leaves, each for a query, may have an error of at most ``limit``.

        Parameters
        ----------
        limit : float
        problem : ndarray of int, shape (n,)
            part * Q + query.
        points : ndarray of float32, shape (n, K, LEAF)
        half : ndarray of float32, shape (n, K, 1)
            By how much the points may be off.
        rest : ndarray of float32, shape (n, LEAF)
        """

        def of(values: Singles) -> Singles:
            return gather(values.swapaxes(1, 2).reshape(-1, *values.shape[1:2], *values.shape[3:]), problem)

        gap = of(self.rows) @ points
        gap -= of(self.wanted)[..., None]
        estimate = np.einsum("pjn,pjn->pn", gap, gap)
        np.abs(gap, out=gap)
        reach = (of(self.sizes) @ half)[..., 0] + of(self.slack)
        gap -= reach[..., None]
        np.maximum(gap, 0, out=gap)
        least = np.einsum("pjn,pjn->pn", gap, gap)
        lost = gather(self.rest.ravel(), problem)[:, None]
        error = gather(self.share.ravel(), problem)[:, None] * rest
        near = np.flatnonzero(least <= (error + np.float32(limit)) ** 2 * ABOVE_SINGLE - lost)
        left = lost[near // points.shape[-1], 0].astype(float)
        bound = np.sqrt(least.ravel()[near] * (1 - 2e-6) + left) - error.ravel()[near] * (1 + 1e-6)
        return Bounds(near, bound, np.sqrt(estimate.ravel()[near] + left))

    def may_be_below(self, limit: float, part: int, box: Singles) -> NDArray[np.bool_]:
        """Which boxes may hold an error of at most ``limit``, for each query of a part: (Q, boxes)."""
        terms = self.rows.shape[-1]
        gap = self.rows[part].reshape(-1, terms) @ box[:, :terms].T
        gap -= self.wanted[part].reshape(-1, 1)
        np.abs(gap, out=gap)
        reach = self.sizes[part].reshape(-1, terms) @ box[:, terms:-1].T
        reach += self.slack[part].reshape(-1, 1)
        gap -= reach
        np.maximum(gap, 0, out=gap)
        gap *= gap
        most = self.share[part][:, None] * box[:, -1]
        most += np.float32(limit)
        most *= most
        most *= ABOVE_SINGLE
        most -= self.rest[part][:, None]
        return gap.reshape(-1, self.rows.shape[2], len(box)).sum(axis=0) <= most


class Offsets:
    """Where the windows of a request lie in the intervals of a storey.

    Parameters
    ----------
    target : Target
        Of a span that the storey is for.
    storey : Storey
    starts : int
        Of the turn, a multiple of the storey's intervals.
    branches : int
        Of the mechanism: 2, or 1.
    """

    def __init__(self, target: Target, storey: Storey, starts: int, branches: int = 2) -> None:
        self.target, self.storey, self.starts, self.branches = target, storey, starts, branches
        self._signs = np.array([1.0, -1.0])[:branches]
        low, high = float(target.crank.min()), float(target.crank.max())
        self._along = target.crank - (low + high) / 2
        self._per_branch = starts // storey.places
        step = TURN / starts
        middle = (low + high) / 2 / step * self._signs  # of a window that begins at crank angle 0
        self._first = np.ceil(-self._per_branch / 2 - middle).astype(np.int64)
        offsets = (self._first + middle)[:, None] + np.arange(self._per_branch)
        along = self._along * self._signs[:, None]
        places = along[:, None] + step * offsets[..., None]
        self._places = places.reshape(self.size, -1) / storey.half_width
        self._shift = step * offsets.ravel()

    @property
    def size(self) -> int:
        """Queries of a part: offsets of all branches."""
        return self.branches * self._per_branch

    def windows(self, entry: NDArray[np.integer], query: Ints) -> Ints:
        """Numbers of the windows that entries are to queries; all windows of a table between them, each once."""
        row, place = np.divmod(entry.astype(np.int64), self.storey.places)
        mirrored, offset = np.divmod(query, self._per_branch)
        start = place * self._per_branch + offset + self._first[mirrored]
        start = np.where(mirrored == 1, -start, start) % self.starts
        return (self.branches * row + mirrored) * self.starts + start

    def _some(self, weights: Floats | None, least: int) -> tuple[Ints, float]:
        """A few of the samples, at least so many of those that are given, and the root of their part of the weights."""
        samples = self.target.samples
        given = np.arange(samples) if weights is None else np.flatnonzero(weights)
        count = min(max(least, -(-given.size // _OF_ALL_SAMPLES)), given.size)
        some = given[np.round(np.linspace(0, given.size - 1, count)).astype(int)]
        share = count / samples if weights is None else weights[some].sum() / weights.sum()
        return some, float(np.sqrt(share))


class Request(Offsets):
    """A rotation as it meets the entries of a storey; parameters of `Offsets`.

    Attributes
    ----------
    rounding : float
        Of errors, in radians, and of what bounds them.
    without_rest : bool
        Whether every window is as good: never known of a rotation.
    """

    without_rest = False

    def __init__(self, target: Target, storey: Storey, starts: int, branches: int = 2) -> None:
        super().__init__(target, storey, starts, branches)
        assert target.rotation is not None
        mean = target.rotation_mean
        centred = target.rotation - mean(target.rotation)
        self._given = centred - mean(centred)
        self._weights = np.full(target.samples, 1 / target.samples) if mean.weights is None else mean.weights
        # of theta2 and of the rotation at the samples, as the exact error has them
        self.rounding = 1e-12 + 16 * np.finfo(float).eps * float(np.abs(target.rotation).max())

    def some_samples(self) -> tuple[Target, float]:
        """The rotation at a few of the samples, and the root of their part of the weights."""
        target, weights = self.target, self.target.rotation_weights
        some, share = self._some(weights, _FEW_SAMPLES)
        own = None if weights is None else weights[some]
        assert target.rotation is not None
        part = replace(target, crank=target.crank[some], rotation=target.rotation[some], rotation_weights=own)
        return replace(part, position=None, position_weights=None), share

    def queries(self, parts: NDArray[np.float64], reach: NDArray[np.floating]) -> Queries:
        """The request against the entries of some parts of the intervals.

        Parameters
        ----------
        parts : ndarray, shape (parts, 2)
            Their ends.
        reach : ndarray, shape (parts, K)
            Largest size of each coefficient of the entries.
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
            np.where(inside, (self._along - middle[:, None]) / half[:, None], 0.0), self.storey.terms
        )
        columns -= (weights[:, None] @ columns) / total[..., None]
        columns *= roots[..., None]
        basis = np.linalg.qr(columns)[0]
        along = basis.transpose(0, 2, 1) @ columns
        given = roots * (self._given - (weights @ self._given)[:, None] / total)
        wanted = (given[:, None] @ basis)[:, 0]
        left = given - (basis @ wanted[..., None])[..., 0]
        rest = (left**2).sum(axis=1)
        # those of the part's coordinate are sums of those of the range's
        sign = np.tile(np.repeat(self._signs, self._per_branch), count)
        scale = 2 / (high - low)[:, 0] / self.storey.half_width
        shifted = scale * (sign * middle[which] + np.tile(self._shift, count)) - ((high + low) / (high - low))[:, 0]
        rows = along[which] @ _substituted(scale * sign * half[which], shifted, self.storey.terms)
        y = sign[:, None] * wanted[which]
        slack = _SINGLE * (np.abs(y) + (np.abs(rows) @ np.repeat(reach, self.size, axis=0)[..., None])[..., 0])

        def single(values: Floats) -> Singles:
            """Part, j, query, ..."""
            values = values.reshape(count, self.size, *values.shape[1:])
            return np.ascontiguousarray(values.swapaxes(1, 2) if values.ndim > 2 else values, dtype=np.float32)

        rest, share = rest[which] * (1 - 2e-6), np.sqrt(share)[which] * (1 + 1e-6)
        return Queries(single(rows), single(np.abs(rows)), *map(single, (y, slack, rest, share)))


def _substituted(scale: Floats, shift: Floats, terms: int) -> Floats:
    """Coefficients in P_j(x) of P_k(scale x + shift), j and k = 1 .. terms, (n, j, k).

    By Gauss's rule, which is exact here: a product of two of them is of degree 2 terms at most.
    """
    point, weight = np.polynomial.legendre.leggauss(terms + 1)
    own = polynomials(point, terms) * (weight[:, None] * (np.arange(1, terms + 1) + 0.5))
    return own.T @ polynomials(scale[:, None] * point + shift[:, None], terms)
