"""Batched convex quadratic programs of few unknowns: the step of a sequential method, for many candidates at once.

Every member of a batch is the problem of minimising ``z'Hz/2 + g'z`` over ``Az + b >= 0``. The method is Mehrotra's
predictor-corrector (Nocedal and Wright, Numerical Optimization, algorithm 16.4), begun at a point inside.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from synthesis.arrays import Floats

_ITERATIONS = 30
_SHARE = 0.995
"""Of the way to the nearest constraint that a step takes."""


def minimise_quadratics(
    hessian: Floats, gradient: Floats, matrix: Floats, bound: Floats, inside: Floats, accuracy: Floats | float = 1e-9
) -> tuple[Floats, Floats]:
    """Minimisers of convex quadratic programs.

    Parameters
    ----------
    hessian : ndarray, shape (n, k, k)
        Positive semidefinite.
    gradient : ndarray, shape (n, k)
    matrix : ndarray, shape (n, m, k)
    bound : ndarray, shape (n, m)
    inside : ndarray, shape (n, k)
        Points with ``matrix @ z + bound > 0``.
    accuracy : float or ndarray, shape (n,)
        A member has ended once no multiplier times its slack is larger than this on average.

    Returns
    -------
    z, multipliers : ndarray, shape (n, k) and (n, m)
        Law: every z lies inside; none is worse than its beginning by more than rounding. A member gives the same in any batch
        to rounding.
    """
    slack = np.einsum("nmk,nk->nm", matrix, inside) + bound
    count = slack.shape[1]
    scale = np.maximum(1.0, np.abs(gradient).max(axis=1))
    multiplier = np.minimum(scale[:, None] / np.maximum(slack, 1e-12) * 0.1, 1e6)
    found = inside.copy(), multiplier.copy()
    # the members that have not ended, and where they stand among all
    place, z, y, dual, fine = np.arange(len(slack)), inside, slack, multiplier, np.broadcast_to(accuracy, len(slack))
    for _ in range(_ITERATIONS):
        at = matrix.transpose(0, 2, 1)
        rest = np.einsum("nij,nj->ni", hessian, z) + gradient - (at @ dual[:, :, None])[:, :, 0]
        gap = np.einsum("nm,nm->n", y, dual) / count
        done = (gap * count <= fine) & (np.abs(rest).max(axis=1) <= 1e-6 * scale)
        if done.any():
            for column, values in zip(found, (z, dual)):
                column[place[done]] = values[done]
            keep = ~done
            place, z, y, dual, fine, scale = (one[keep] for one in (place, z, y, dual, fine, scale))
            hessian, gradient, matrix, rest, gap = (one[keep] for one in (hessian, gradient, matrix, rest, gap))
            at = matrix.transpose(0, 2, 1)
        if not place.size:
            break
        newton = _Newton.of(hessian, matrix, at, y, dual, rest)
        _, along, change = newton.solve(np.zeros(len(y)), 0.0)
        both = _longest(y, along), _longest(dual, change)
        ahead = np.einsum("nm,nm->n", y + both[0][:, None] * along, dual + both[1][:, None] * change) / count
        centre = gap * np.clip(ahead / gap, 0.0, 1.0) ** 3
        step, along, change = newton.solve(centre, along * change)
        length, dual_length = _SHARE * _longest(y, along), _SHARE * _longest(dual, change)
        z, y, dual = z + length[:, None] * step, y + length[:, None] * along, dual + dual_length[:, None] * change
    for column, values in zip(found, (z, dual)):
        column[place] = values
    return found


class _Newton(NamedTuple):
    """The linear systems of one iteration, made ready for two right sides."""

    matrix: Floats
    transposed: Floats
    slack: Floats
    multiplier: Floats
    weight: Floats
    rest: Floats
    scaled: Floats
    scaling: Floats

    @classmethod
    def of(
        cls, hessian: Floats, matrix: Floats, transposed: Floats, slack: Floats, multiplier: Floats, rest: Floats
    ) -> _Newton:
        weight = multiplier / slack
        system = hessian + transposed @ (weight[:, :, None] * matrix)
        # a hair on the diagonal: what no constraint and no curvature holds stays where it is
        diagonal = np.arange(system.shape[1])
        system[:, diagonal, diagonal] = system[:, diagonal, diagonal] * (1 + 1e-14) + 1e-300
        scaling = 1 / np.sqrt(system[:, diagonal, diagonal])
        scaled = system * scaling[:, :, None] * scaling[:, None, :]
        return cls(matrix, transposed, slack, multiplier, weight, rest, scaled, scaling)

    def solve(self, centre: Floats, second: Floats | float) -> tuple[Floats, Floats, Floats]:
        """Steps of z, slack and multiplier towards complementarity ``centre`` (n,), less what a first step missed."""
        wanted = (centre[:, None] - second) / self.slack - self.multiplier
        right = (self.transposed @ wanted[:, :, None])[:, :, 0] - self.rest
        step = self.scaling * np.linalg.solve(self.scaled, (right * self.scaling)[:, :, None])[:, :, 0]
        along = (self.matrix @ step[:, :, None])[:, :, 0]
        return step, along, wanted - self.weight * along


def _longest(values: Floats, change: Floats) -> Floats:
    """The longest part, at most 1 / `_SHARE`, of a change that leaves positive values (n, m) positive, (n,)."""
    return 1 / np.maximum(_SHARE, -(change / values).min(axis=1))
