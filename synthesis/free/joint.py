"""Poses and paths whose crank angles are free, beside shape and pose, made ready for descents."""

from __future__ import annotations

from synthesis.descents import Problem, Timed
from synthesis.kernels import four_bar_limits
from synthesis.mechanism import Chart
from synthesis.poses import Poses


class JointProblem(Problem):
    """Poses, a chart and limits made ready for many candidates."""

    def __init__(self, poses: Poses, chart: Chart, limits: four_bar_limits.Limits | None = None) -> None:
        super().__init__(poses, chart, limits, ordered=poses.ordered, span_max=poses.span_max, closed=poses.closed)
        self.posed, self.poses = self.limited, poses

    def facing(self, timed: Timed) -> Timed:
        """Candidates of unknown offset with one that is right to within their own error, from the mean direction of the gaps."""
        return self.measured(timed, posed=False, facing=True).timed
