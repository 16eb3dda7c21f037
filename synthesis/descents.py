"""Candidates and their descents, which all searches use, with known and with free crank angles.

The unknowns of a candidate are its shape x in a chart, A, z1, z2 (complex, over the length scale), the offset of the rotation,
and crank angles: an angle for each sample if they are free, otherwise the angle at the first sample. With e1 = e^{i phi} and
e2 = e^{i theta2(x, phi)}, the rows of a sample are::

    sqrt(w_r) (gamma - offset - theta2),      sqrt(w_p) (P - A - z1 e1 - z2 e2)

(the first modulo a turn if the crank angles are free). A free phi_i occurs only in the rows of its own sample, so it is
eliminated there before the step is computed. With t_i the derivative of the rows by phi_i, d_i its damping and
n_i = t_i . t_i + d_i, the rows G of the other unknowns, and the residual, become::

    G - c_i t_i (t_i . G),      c_i = 1 / (n_i (1 + sqrt(d_i / n_i)))

whose normal matrix is the Schur complement of the full matrix, so that the step still comes from a QR decomposition. At
d_i = 0 this is the fit by orthogonal distances, with a large d_i the fit at given crank angles. A, z1, z2 and the offset are
solved again after every step (variable projection in Kaufman's form: BIT 15 (1975) 49-57). A step that increases the cost is
accepted if it continues the direction of the previous step (Transtrum and Sethna, arXiv:1201.5885). While the damping is large,
the triangle of the QR decomposition comes from the normal matrix by Cholesky's method instead, which is faster.

Within limits c >= 0 the descent minimises J^2 + rho sum max(0, -c)^2, with the pose among the unknowns; the penalty rho grows
from stage to stage. A limit that depends on the first or last crank angle has its row beside the rows of the first or last
sample, so that this crank angle can satisfy it. Candidates that violate no limit continue in their best pose.

`synthesis.kernels.crank_descent` computes these steps for each candidate in turn.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats, rows_at, rows_of_all
from synthesis.kernels import crank_descent, four_bar_limits
from synthesis.mechanism import Chart
from synthesis.target import Samples
from synthesis.work import UNLIMITED, Work

_BETWEEN_LOOKS = 16_000
"""Steps times samples between two looks at the time: 2 to 4 ms."""


# -- candidates ----------------------------------------------------------------------------------------------------


class Timed(NamedTuple):
    """Candidates with their crank angles."""

    shape: Floats
    """(n, k) in the chart."""
    pose: Complexes
    """(n, 3): A, z1, z2 over the length scale, positions from their mean; zero without positions."""
    offset: Floats
    """(n,)"""
    angles: Floats
    """(n, N): theta1, continuous along the samples; (n, 1), that at the first sample, where the timing is given."""
    branch: Floats
    """(n,)"""

    def take(self, indices: Any) -> Timed:
        """Select candidates."""
        return rows_at(self, indices)

    def joined(self, *following: Timed) -> Timed:
        """Return these candidates followed by others."""
        return rows_of_all(self, *following)


class Pool(NamedTuple):
    """Candidates and their costs: J squared, and within limits the squares of their rows."""

    timed: Timed
    cost: Floats

    def take(self, indices: Any) -> Pool:
        """Select candidates."""
        return rows_at(self, indices)

    def joined(self, *following: Pool) -> Pool:
        """Return these candidates followed by others."""
        return rows_of_all(self, *following)

    @property
    def min_error(self) -> float:
        """Square root of the smallest cost; infinite without candidates."""
        return float(np.sqrt(self.cost.min())) if self.cost.size else np.inf

    def best(self, max_count: int, cell: float = 0.02) -> Pool:
        """Return the best candidates that close, best first, at most one in each cell of shape and pose."""
        timed = self.timed
        order = np.argsort(self.cost, kind="stable")
        order = order[np.isfinite(self.cost[order])]
        first = timed.angles[:, 0]
        columns = [timed.shape, np.cos(first)[:, None], np.sin(first)[:, None], timed.branch[:, None]]
        columns += [timed.pose.real, timed.pose.imag]
        numbers = np.concatenate(columns, axis=1)[order]
        size = np.maximum(1.0, np.abs(numbers))
        keys = np.round(np.sign(numbers) * (1 + np.log(size)) * np.minimum(1.0, np.abs(numbers)) / cell)
        _, unique = np.unique(np.nan_to_num(keys), axis=0, return_index=True)
        return self.take(order[np.sort(unique)[:max_count]])


# -- what descends -------------------------------------------------------------------------------------------------


class Stage(NamedTuple):
    """A part of a descent."""

    steps: int
    stall: float = 1e-9
    """Relative decrease of the cost below which a step is the last one of a candidate."""
    weight: float = 1.0
    """Square root of rho, the weight of squared violations of limits against J squared."""


class Problem:
    """Samples, a chart and limits made ready for many candidates.

    Parameters
    ----------
    samples : Samples
    chart : Chart
    limits : four_bar_limits.Limits, optional
        That descents keep to, over the length scale and from the mean position.
    ordered, span_max, crank, fixed, closed
        As of `crank_descent.Descent`.
    shortest : float
        |z1| below this is no crank.

    Attributes
    ----------
    posed : bool
        Whether limits concern the pose.
    """

    posed: bool

    def __init__(
        self,
        samples: Samples,
        chart: Chart,
        limits: four_bar_limits.Limits | None = None,
        *,
        ordered: bool = True,
        span_max: float = np.inf,
        crank: Floats | None = None,
        fixed: tuple[bool, bool] = (False, False),
        shortest: float = 0.0,
        closed: bool = False,
    ) -> None:
        self.chart, self.limited, self.samples = chart, limits is not None, samples.samples
        self.has_rotation, self.has_position = samples.rotation is not None, samples.position is not None
        self._angles = samples.samples if crank is None else 1
        self._kernel = crank_descent.Descent(
            self.goal(samples),
            samples.rotation_mean.root if self.has_rotation else 1.0,
            _real(samples.scaled[:, None]) if self.has_position else None,
            samples.position_mean.root if self.has_position else 1.0,
            chart.kind,
            ordered,
            span_max,
            limits,
            crank,
            fixed,
            shortest,
            closed,
        )

    def goal(self, samples: Samples) -> Floats | None:
        """The rotations wanted of the body, up to an offset."""
        return samples.rotation

    def _begin(self, timed: Timed, weight: float = 0.0) -> Pool:
        """Copies of candidates, which the kernel works on in their place."""
        count = len(timed.branch)
        shape, angles = np.array(timed.shape, dtype=float, order="C"), np.array(timed.angles, dtype=float, order="C")
        pose = np.array(timed.pose, dtype=complex, order="C")
        mine = Timed(shape, pose, timed.offset + np.zeros(count), angles, timed.branch + np.zeros(count))
        return Pool(
            mine, self._kernel.set_candidates(shape, _real(pose), mine.offset, angles, mine.branch, weight**2)
        )

    def measured(self, timed: Timed, posed: bool = True, facing: bool = False) -> Pool:
        """Candidates and J squared: in their best pose or as they are; ``facing``: of offsets that are unknown."""
        pool = self._begin(timed)
        self._kernel.evaluate_candidates(posed, facing)
        return pool

    def nearest(self, timed: Timed, steps: int) -> Timed:
        """Candidates with each crank angle moved to the nearest point of the path by Gauss-Newton steps; order is kept."""
        pool = self._begin(timed)
        self._kernel.move_to_nearest_angles(steps)
        return pool.timed

    def linearised(self, timed: Timed, damping: float, weight: float = 1.0) -> list[dict[str, Any]]:
        """Return the linearised problem of each candidate, see `crank_descent.Descent.linearised`."""
        self._begin(timed, weight)
        return [self._kernel.linearised(n, damping) for n in range(len(timed.branch))]

    def lacking(self, timed: Timed) -> tuple[Floats, Floats]:
        """The sum of squares of what candidates lack of the limits, and the largest, (n,) each."""
        self._begin(timed)
        squares, largest = self._kernel.violations()
        return squares, largest

    def excursions(self, timed: Timed, shortest: float, panel: float) -> tuple[Floats, Floats]:
        """Return the largest excursion (n,) of the body point between two samples, by chords, and the angles of the body.

        The angles (n, M) of the body are given at the samples, with the first sample repeated on a closed path, if the loop
        closes. ``shortest``: smallest distance that counts, over the length scale. ``panel``: largest angle of a chord in
        radians.
        """
        self._begin(timed)
        largest, angle = self._kernel.excursions(shortest, panel)
        return largest, angle

    def moved_onto(self, timed: Timed, rounds: int = 12) -> tuple[Pool, Floats]:
        """Move candidates onto violated limits at their crank angles; return the remaining violation too.

        These are Newton steps of shape and pose of minimum length. No violation increases.
        """
        pool = self._begin(timed)
        return pool, self._kernel.restore(rounds)

    def descended(
        self,
        timed: Timed,
        stages: Sequence[Stage],
        tolerance: float = 0.0,
        work: Work = UNLIMITED,
        damping: float = 1e-3,
        steps_after_first: float = 1.0,
        between: Callable[[Pool], None] | None = None,
    ) -> Pool:
        """Run Levenberg-Marquardt steps over shape, pose and all crank angles.

        Parameters
        ----------
        timed : Timed
            Starting points; for ordered samples their angles are in order.
        stages : sequence of Stage
        tolerance : float
            A candidate ends with the step after which the square root of its cost is below this value.
        work : Work, optional
            When it has expired, the descent stops.
        damping : float
            Damping of the first step of each stage, relative to the squares of the derivatives.
        steps_after_first : float
            Largest number of steps of the other candidates after the first one is below the tolerance, relative to its steps.
        between : callable, optional
            Called with the result of each stage except the last.

        Returns
        -------
        Pool
            Best point of each candidate in its last stage. Without limits no candidate is worse than its starting point with its
            best pose; the order of the angles does not change.
        """
        pool = self._begin(timed, stages[0].weight)
        max_steps = max(1, _BETWEEN_LOOKS // self.samples)
        self._kernel.evaluate_candidates(not self.limited, False)
        for number, stage in enumerate(stages):
            if number and between is not None:
                between(pool.take(np.arange(pool.cost.size)))
            self._kernel.configure(
                stage.steps, damping, stage.stall, tolerance**2, steps_after_first, stage.weight**2
            )
            while not work.expired() and not self._kernel.run(max_steps):
                pass
        return pool


def _real(columns: Complexes) -> Floats:
    """Complex columns (n, m) as (n, 2 m) numbers, in place."""
    return columns.view(np.float64).reshape(len(columns), 2 * columns.shape[1])
