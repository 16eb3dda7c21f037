"""A requested path as queries of the shapes of `path_storeys`: how far from a shape it is.

With <f, g> the mean over the samples, let A_k be what {1, e^{it}} leave of P_k at a query's samples, p what they leave
of the requested positions, made a unit, and |p| its size before (over l). An entry is the vector
q = A_2 + sum shape_k A_k + e, |e| <= E, up to a complex factor, and the error of its window is what the best multiple of
it leaves of p, that is |p| times the sine of the angle between them. With d the size of the part of q that is orthogonal
to p, and t that of the part along p,

    error = |p| sin(angle),   tan(angle) = d / t.

Let Q be orthonormal columns that span what p leaves of the A_k, R_k = Q' A_k, and T_k = <p, A_k>. Then without approximation

    d = | R_2 + sum shape_k R_k |,  t = | T_2 + sum shape_k T_k |     of A_2 + sum shape_k A_k, and of q each within E of these,

both of them sizes of what is linear in the real and imaginary parts of a shape. So

    error <= limit   only if   d - E <= tau (t + E),   tau = tan(arcsin(limit / |p|)).

* *Box*: each component is within h_j = sum_k |R_jk| half_k of that of the middle: d is at least the norm of
  max(0, |.|_j - h_j), t at most that of |.|_j + h_j. Components of d may be left out: those behind the first few, of the
  highest polynomials, add little.
* *Rest*: what the terms above K leave is seen by the samples as far as these see P_k, K < k: E is the rest times the
  largest rms of those A_k (`legendre.PhasorExpansion`), for samples all over the interval about 1 / sqrt(2K).
* *Part of the samples*: no fit of all of them leaves less of a part than the part's own, as in `queries`.

Branch -1 is conj(e^{i theta2}) of the mirrored crank angle, so there the request is the mirrored path.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.atlas.legendre import LEAST_SEEN, TAIL, polynomials
from synthesis.atlas.queries import MALUS, Bounds, Offsets
from synthesis.atlas.series import Floats, Ints, gather
from synthesis.atlas.storeys import Storey
from synthesis.atlas.trees import Singles
from synthesis.pose import fixed_columns
from synthesis.target import Target

_SINGLE = 2.0**-24
_BELOW, _ABOVE = np.float32(1 - 4e-6), np.float32(1 + 4e-6)
"""Make up for the rounding of a few operations in single precision."""
_NEXT_TO_NOTHING = np.float32(1e-20)
_ALONG = 2
"""Rows of t, real and imaginary part."""
_ROWS = 12
"""Rows of d that are computed: the others are of the highest polynomials."""
_FEW_SAMPLES = 5
_AT_ONCE = 1 << 17
"""Offsets times samples times terms that are compared together: 2 MB."""


class PathQueries(NamedTuple):
    """A path against the shapes of a storey: all offsets of branch +1, then of -1.

    Attributes
    ----------
    rows : ndarray of float32, shape (J, Q, K)
        T, then R of each query: component, query, number of the shape.
    sizes : ndarray of float32, shape (J, Q, K)
        Their sizes.
    wanted : ndarray of float32, shape (J, Q)
        The components of A_2, less than 0.
    slack : ndarray of float32, shape (J, Q)
        Rounding of the components.
    share : ndarray of float32, shape (Q,)
        By which an entry's rest counts.
    size : float
        |p|.
    """

    rows: Singles
    sizes: Singles
    wanted: Singles
    slack: Singles
    share: Singles
    size: float

    def _tangent(self, limit: float) -> np.float32:
        """Tau, for limits below |p|."""
        sine = min(limit / self.size, 1 - 1e-6)
        return np.float32(sine / np.sqrt(1 - sine**2)) * _ABOVE

    def _components(self, points: Singles) -> Singles:
        gap = self.rows.reshape(-1, points.shape[1]) @ points.T
        gap -= self.wanted.reshape(-1, 1)
        return gap

    def may_be_below(self, limit: float, part: int, box: Singles) -> NDArray[np.bool_]:
        """Which boxes may hold an error of at most ``limit``, for each query: (Q, boxes)."""
        size = self.rows.shape[-1]
        gap = self._components(box[:, :size])
        np.abs(gap, out=gap)
        reach = self.sizes.reshape(-1, size) @ box[:, size:-1].T
        reach += self.slack.reshape(-1, 1)
        along = _ALONG * self.rows.shape[1]
        gap[:along] += reach[:along]
        gap[along:] -= reach[along:]
        np.maximum(gap, 0, out=gap)
        gap *= gap
        gap = gap.reshape(len(self.rows), -1, len(box))
        tangent = self._tangent(limit)
        most = tangent * np.sqrt(gap[:_ALONG].sum(axis=0))
        most += ((1 + tangent) * self.share)[:, None] * box[:, -1]
        return gap[_ALONG:].sum(axis=0) * _BELOW <= most * most * _ABOVE

    def likely(self, part: int, points: Singles, rest: Singles) -> Singles:
        """About the error of entries, for each query: (Q, points); the worse the less is known of one."""
        gap = self._components(points).reshape(len(self.rows), -1, len(points))
        gap *= gap
        far = np.sqrt(gap[_ALONG:].sum(axis=0)) + np.float32(MALUS) * self.share[:, None] * rest
        far /= np.sqrt(gap[:_ALONG].sum(axis=0)) + _NEXT_TO_NOTHING
        return far

    def entries(self, limit: float, problem: Ints, points: Singles, half: Singles, rest: Singles) -> Bounds:
        """As of `queries.Queries.entries`; there is one part."""

        def of(values: Singles) -> Singles:
            return gather(values, problem, axis=1).swapaxes(0, 1)

        gap = of(self.rows) @ points
        gap -= of(self.wanted)[..., None]
        np.abs(gap, out=gap)
        reach = (of(self.sizes) @ half)[..., 0] + of(self.slack)
        square = np.einsum("pjn,pjn->pn", gap[:, _ALONG:], gap[:, _ALONG:])
        gap[:, :_ALONG] += reach[:, :_ALONG, None]
        gap[:, _ALONG:] -= reach[:, _ALONG:, None]
        np.maximum(gap, 0, out=gap)
        along = np.sqrt(np.einsum("pjn,pjn->pn", gap[:, :_ALONG], gap[:, :_ALONG]))
        least = np.sqrt(np.einsum("pjn,pjn->pn", gap[:, _ALONG:], gap[:, _ALONG:]))
        error = gather(self.share, problem)[:, None] * rest
        tangent = self._tangent(limit)
        near = np.flatnonzero(least * _BELOW <= (tangent * along + (1 + tangent) * error) * _ABOVE)
        error, along = error.ravel()[near].astype(float), along.ravel()[near] + _NEXT_TO_NOTHING
        ratio = np.maximum(least.ravel()[near] * (1 - 4e-6) - error * (1 + 1e-6), 0.0) / (along + error)
        bound = self.size * ratio / np.hypot(1.0, ratio) * (1 - 1e-5)
        return Bounds(near, bound, np.sqrt(square.ravel()[near]) / along)


class PathRequest(Offsets):
    """A path as it meets the shapes of a storey; parameters of `Offsets`, a target with positions.

    Attributes
    ----------
    rounding : float
        Of errors, over l.
    length : float
        |p|.
    """

    rounding = 1e-12

    def __init__(self, target: Target, storey: Storey, starts: int, branches: int = 2) -> None:
        super().__init__(target, storey, starts, branches)
        mean, fixed = target.position_mean, fixed_columns(target)
        self._root = mean.root
        self._fixed = [fixed.one * mean.root, fixed.turned * mean.root]
        self._rest = fixed.rest * mean.root
        self.length = float(np.linalg.norm(self._rest))

    @property
    def without_rest(self) -> bool:
        """Whether {1, e^{it}} alone leave nothing of the path."""
        return self.length <= self.rounding

    def some_samples(self) -> tuple[Target, float]:
        """The path at a few of the samples, and the root of their part of the weights."""
        target, weights = self.target, self.target.position_weights
        some, share = self._some(weights, _FEW_SAMPLES)
        assert target.position is not None
        own = None if weights is None else weights[some]
        part = replace(target, crank=target.crank[some], position=target.position[some], position_weights=own)
        return replace(part, rotation=None, rotation_weights=None), share

    def queries(self, parts: NDArray[np.float64], reach: NDArray[np.floating]) -> PathQueries:
        """The path against the shapes.

        Parameters
        ----------
        parts : ndarray, shape (1, 2)
            The whole interval.
        reach : ndarray, shape (1, K)
            Largest size of each number of the shapes.
        """
        few = max(1, _AT_ONCE // (self.target.samples * (self.storey.terms + TAIL)))
        found = [self._against(slice(k, k + few), reach[0]) for k in range(0, self.size, few)]
        real, wanted, slack, share = (np.concatenate(columns) for columns in zip(*found))

        def single(values: Floats) -> Singles:
            return np.ascontiguousarray(values.swapaxes(0, 1), dtype=np.float32)

        return PathQueries(single(real), single(np.abs(real)), single(wanted), single(slack), share, self.length)

    def _against(self, some: slice, reach: NDArray[np.floating]) -> tuple[Floats, Floats, Floats, Singles]:
        """Rows, components, rounding and share of some queries."""
        terms = self.storey.terms
        mirrored = (np.arange(self.size)[some] >= self._per_branch)[:, None]

        def of(column: NDArray[np.complex128]) -> NDArray[np.complex128]:
            return np.where(mirrored, np.conj(column), column)[..., None]

        own = polynomials(self._places[some].clip(-1, 1), terms + TAIL)[..., 1:]
        columns = own * np.reshape(self._root, (-1, 1)).astype(complex)
        fixed = [of(column) for column in self._fixed]
        for column in (*fixed, *fixed):  # twice: the first time leaves rounding
            columns -= column * (np.conj(column).swapaxes(1, 2) @ columns)
        seen = np.linalg.norm(columns[..., terms - 1 :], axis=1).max(axis=1)
        columns = columns[..., : terms - 1]
        path = of(self._rest / self.length)
        along = np.conj(path).swapaxes(1, 2) @ columns
        columns = columns - path * along
        across = np.linalg.qr(columns, mode="r")
        rows = np.concatenate([along, across], axis=1)[:, : (_ALONG + _ROWS) // 2]
        wanted = np.stack([-rows[..., 0].real, -rows[..., 0].imag], axis=2).reshape(len(rows), -1)
        free = rows[..., 1:]
        real = np.stack([free, 1j * free], axis=-1).reshape(*free.shape[:2], -1)  # times real and imaginary parts
        real = np.stack([real.real, real.imag], axis=2).reshape(len(rows), -1, 2 * free.shape[2])
        rounding = (real.shape[-1] + 8) * _SINGLE
        slack = rounding * (np.abs(wanted) + np.abs(real) @ reach)
        return real, wanted, slack, (np.maximum(seen, LEAST_SEEN) * (1 + 1e-6)).astype(np.float32)
