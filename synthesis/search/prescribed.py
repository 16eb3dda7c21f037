"""Problems of motions with prescribed crank angles, and the conversion of candidates to linkages."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.constraints import Constraints
from synthesis.descents import Pool, Problem, Timed
from synthesis.fourbar.mechanism import Bounded, mounted, placed_linkages
from synthesis.linkage import Linkage
from synthesis.mechanism import Chart
from synthesis.pose import DEGENERATE
from synthesis.target import Samples, Target


class GivenProblem(Problem):
    """A target, a chart and limits, prepared for many candidates.

    Parameters
    ----------
    target : Target
        The motion, with a crank that turns counter-clockwise.
    chart : Chart
    constraints : Constraints, optional
    posed : bool
        The constraints concern the pose, over the length scale; otherwise only the shape and the start.
    """

    def __init__(
        self, target: Target, chart: Chart, constraints: Constraints | None = None, posed: bool = False
    ) -> None:
        limits = None if constraints is None or not constraints.any else constraints.compiled(posed)
        self.target, self.posed = target, posed and limits is not None
        super().__init__(
            target,
            chart,
            limits,
            crank=target.crank,
            fixed=(target.start is not None, target.offset is not None),
            shortest=0.0 if target.position is None else DEGENERATE * target.extent / target.length_scale,
        )

    def goal(self, samples: Samples) -> Floats | None:
        """Return the rotations from their mean, or from a prescribed offset."""
        if samples.rotation is None:
            return None
        offset = self.target.offset
        return samples.rotation - (samples.rotation_mean(samples.rotation) if offset is None else offset)

    def linkages(self, pool: Pool) -> list[Linkage]:
        """Return candidates as linkages: in their own pose if limits concern it, otherwise in their best pose."""
        timed, target = pool.timed, self.target
        lengths, start = self.chart.shape(timed.shape).lengths, timed.angles[:, 0]
        if not self.posed:
            return mounted(target, lengths, timed.branch, start)
        (a, z1, z2), scale = timed.pose.T, target.length_scale
        lengths = lengths * (scale * np.abs(z1) / lengths[:, 0])[:, None]
        return placed_linkages(lengths, timed.branch, start, (target.middle + scale * a, np.angle(z1), scale * z2))


def problem_of(target: Target, space: Bounded) -> GivenProblem:
    """Return the problem of a target within limits."""
    return GivenProblem(target, space.chart, space.constraints, space.boxes is not None)


def candidates_at(shape: Floats, branch: Floats, start: Floats, pose: Complexes | None = None) -> Timed:
    """Return candidates of shapes (n, k) in a chart, branches and starts (n,), and poses (n, 3) if known."""
    count = len(branch)
    pose = np.zeros((count, 3), dtype=complex) if pose is None else pose
    return Timed(np.asarray(shape), pose, np.zeros(count), np.asarray(start)[:, None], np.asarray(branch))


def candidates_of(samples: Samples, chart: Chart, linkages: Sequence[Linkage], angles: Floats) -> Timed:
    """Return four-bars at their own crank angles (n, N), or at their starts (n, 1), as candidates in their pose."""
    links = np.array([linkage.links for linkage in linkages])
    numbers = [(linkage.ground_angle, linkage.body_offset or 0.0, linkage.branch) for linkage in linkages]
    ground, offset, branch = np.array(numbers, dtype=float).T
    pose = np.zeros((len(linkages), 3), dtype=complex)
    if samples.position is not None:
        pivot, arm = np.array([(linkage.pivot_a, linkage.arm) for linkage in linkages]).T
        along = np.exp(1j * ground)
        pose[:] = np.stack([pivot - samples.middle, links[:, 0] * along, arm * along], axis=1) / samples.length_scale
    return Timed(chart.unknowns(links), pose, ground + offset, angles, branch)
