"""The search without limits: shape and start are unknown, everything linear is projected out.

Offset, A, z1 and z2 are best for each shape and start (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10
(1973) 413-432). For a candidate with e = e^{i theta2}, q its part orthogonal to {1, e^{it}}, p that of the positions over l:

    residual   [theta - mean(theta),  p - z q],   theta = rotation - theta2,   z = <q, p> / <q, q>
    derivative [-(D - mean(D)),  -z P dq - q <dq, p - z q> / <q, q>],   D = d theta2, dq = Q(i e D)

with Q the projector off {1, e^{it}} and P the one off q as well.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from synthesis.least_squares import Evaluation
from synthesis.mechanism import Chart
from synthesis.pose import DEGENERATE, fixed_columns, whole_turns
from synthesis.target import Target

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class ProjectedProblem:
    """A target and a chart made ready for many evaluations.

    Parameters
    ----------
    target : Target
        With a crank that turns counter-clockwise.
    chart : Chart
    """

    def __init__(self, target: Target, chart: Chart) -> None:
        self.target = target
        self.chart = chart
        self.body = chart.prepared(target)
        samples = target.samples
        self.rotation_rows = samples if target.rotation is not None else 0
        roots = []
        if target.rotation is not None:
            zero = target.rotation_mean(target.rotation) if target.offset is None else target.offset
            self.rotation = target.rotation - zero
            roots = [target.rotation_mean.root]
        if target.position is not None:
            mean = target.position_mean
            roots += [mean.root, mean.root]
            fixed = fixed_columns(target)
            self.rest, self.along = fixed.rest, fixed.along
            self.basis = np.stack([fixed.one, fixed.turned])
            self.onto_basis = (mean.weighted(np.conj(self.basis)) / mean.total).T
            less_one = 2j * np.sin(target.crank / 2) * np.exp(0.5j * target.crank)
            self.smallest_share = DEGENERATE * target.extent / target.length_scale * float(mean.spread(less_one))
        self.roots = np.concatenate([np.broadcast_to(root, samples) for root in roots])

    def evaluate(self, unknowns: Floats, branch: Floats, derivatives: bool = True) -> Evaluation:
        """Residuals, and derivatives unless not wanted, at candidates (n, k + 1) of branches (n,).

        A start that is given has no derivative.
        """
        angle, phasor, slope, answer = self.body(unknowns, branch, derivatives)
        size = unknowns.shape[1]
        stack = np.zeros((len(unknowns), size + 1, self.roots.size))
        if self.target.rotation is not None:
            mean = self.target.rotation_mean
            part = stack[:, :, : self.rotation_rows]
            np.subtract(self.rotation, angle, out=part[:, size])
            if slope is not None:
                np.negative(slope, out=part[:, :size])
            if self.target.offset is None:
                part -= mean.weighted(part).sum(axis=2, keepdims=True) / mean.total
            else:
                part[:, size] -= whole_turns(mean(part[:, size]))[:, None]
        if self.target.position is not None:
            crank_share = self._position(phasor, slope, stack[:, :, self.rotation_rows :])
            answer = answer & (crank_share > self.smallest_share)
        stack *= self.roots
        residual = stack[:, size]
        cost = np.einsum("nm,nm->n", residual, residual)
        if self.target.start is not None:
            stack = np.delete(stack, size - 1, axis=1)
        return Evaluation(cost if answer is True else np.where(answer, cost, np.inf), stack)

    def residual(self, unknowns: Floats, branch: Floats) -> Floats:
        """The residuals alone, (n, rows)."""
        return self.evaluate(unknowns, branch, derivatives=False).stack[:, -1]

    def _position(self, phasor: Complexes, slope: Floats | None, part: Floats) -> Floats:
        """Fill in the rows of the position; returns |z1| times the norm of e^{it} less its mean, (n,)."""
        samples, mean = self.target.samples, self.target.position_mean
        size = part.shape[1] - 1
        shares = phasor @ self.onto_basis
        own = phasor - shares @ self.basis
        again = own @ self.onto_basis  # twice is enough (Parlett, The Symmetric Eigenvalue Problem, 6.9)
        own -= again @ self.basis
        dual = mean.weighted(np.conj(own)) / mean.total
        square = np.maximum(np.einsum("nm,nm->n", dual, own).real, 1e-280)
        z = (dual @ self.rest) / square
        left = self.rest - z[:, None] * own
        part[:, size, :samples], part[:, size, samples:] = left.real, left.imag
        if slope is not None:
            change = (1j * phasor)[:, None, :] * slope
            change -= (change @ self.onto_basis) @ self.basis
            toward = (change @ dual[:, :, None])[:, :, 0] / square[:, None]
            against = np.conj(change @ mean.weighted(np.conj(left))[:, :, None])[:, :, 0]
            against /= mean.total * square[:, None]
            # z times the part off q, and the turn of q against the residual
            change *= -z[:, None, None]
            change += (z[:, None] * toward - against)[:, :, None] * own[:, None, :]
            part[:, :size, :samples], part[:, :size, samples:] = change.real, change.imag
        return np.abs(self.along - z * (shares[:, 1] + again[:, 1]))
