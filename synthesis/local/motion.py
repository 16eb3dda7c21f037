"""A given four-bar refined for a motion whose crank angles are given: the search's own descents, from just there.

Data flow::

    linkage --(clockwise: mirrored)--> as it is, in a chart of its family
      -> descent without limits, everything linear projected out: to machine precision
      -> descents under the limits, with the pose where they concern it, moved onto the limits that are still broken
      -> from there once more without limits
      -> the best of these and of the linkage itself that keeps the limits; where none does, the same from a full crank near it
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.charts import AnyChart, FullCrankChart, GrashofChart, LengthsChart
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.linkage import Linkage
from synthesis.fourbar.mechanism import FOURBAR
from synthesis.fourbar.solution import Solution, assess, mounted, within
from synthesis.least_squares import minimise
from synthesis.local.beginning import report_of, turning_fully
from synthesis.mechanism import Bounded
from synthesis.ranking import Status
from synthesis.search.constrained import Plan, descend, restored
from synthesis.search.placed import PosedProblem, Poses, ShapeProblem, problem_of
from synthesis.search.projected import ProjectedProblem
from synthesis.search.search import SearchReport
from synthesis.target import Target
from synthesis.work import Work

Floats = NDArray[np.float64]

_STEPS = 400
_PLANS = (
    # a linkage that breaks no limit must not be led out of its valley first; one that breaks many must find a way in
    Plan(100, (10.0, 30.0, 100.0, 300.0, 1000.0), 4),
    Plan(100, (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0), 5),
)


def refine_motion(
    target: Target, limits: Limits, linkage: Linkage, tolerance: float, work: Work
) -> tuple[list[Solution], SearchReport]:
    """The best linkage that descents from a given one lead to.

    Parameters
    ----------
    target : Target
    limits : Limits
    linkage : Linkage
        Mounted, or else it begins in its best pose.
    tolerance : float
        The descents end when the objective is below it.
    work : Work
        Once it has expired the best found so far is returned.

    Returns
    -------
    solutions : list of Solution
        One, within the limits; none where no descent led into them. Law: where the linkage keeps the limits itself, what is
        returned is no worse.
    report : SearchReport
    """
    if target.clockwise:
        found, report = refine_motion(target.mirrored(), limits.mirrored(), linkage.mirrored(), tolerance, work)
        return [one.mirrored() for one in found], report
    run = _Descents(target, limits, tolerance, work)
    closing = run.assessed([linkage])
    begin, seconds = run.kept(closing), work.elapsed
    if limits.family == "any" and (closing or linkage.mounted):
        run.lead(linkage)
    if not run.found:
        run.lead(turning_fully(linkage, limits.family), full_crank=True)
    run.found += begin
    found = run.best[:1]
    return found, report_of(found, begin, seconds, tolerance, work)


class _Descents:
    """One request, and what its descents have found within the limits."""

    def __init__(self, target: Target, limits: Limits, tolerance: float, work: Work) -> None:
        self.target, self.limits, self.tolerance, self.work = target, limits, tolerance, work
        self.found: list[Solution] = []

    @property
    def done(self) -> bool:
        """Whether the tolerance is reached or the time is up."""
        return Status.of(self.best, self.tolerance) is Status.REACHED or self.work.expired()

    @property
    def best(self) -> list[Solution]:
        """What was found, best first."""
        return sorted(self.found, key=lambda one: one.errors.objective)

    def assessed(self, linkages: list[Linkage]) -> list[Solution]:
        """Linkages with their errors, in their best pose where they have none; without those that do not close."""
        closing = [one for one in linkages if one.joints(self.target.crank).closed]
        if self.target.position is None:
            closing = [replace(one, pivot_a=0j, ground_angle=0.0, coupler_point=None) for one in closing]
            closing = [one.scaled(1 / one.links[3]) for one in closing]
        elif not all(one.mounted for one in closing):
            closing = [self._mounted(one) for one in closing]
        return [one for one in assess(self.target, closing) if np.isfinite(one.errors.objective)]

    def _mounted(self, linkage: Linkage) -> Linkage:
        return mounted(self.target, [linkage.links], [linkage.branch], [linkage.start])[0]

    def kept(self, solutions: list[Solution]) -> list[Solution]:
        """Those within the limits."""
        return within(self.target, self.limits, solutions)

    def lead(self, linkage: Linkage, full_crank: bool = False) -> None:
        """Descents from a linkage, which closes at every sample where its crank turns fully."""
        sheet = {"crank_rocker": -1, "double_crank": 1}.get(self.limits.family, 0)
        chart = FullCrankChart(sheet) if full_crank else AnyChart()
        way = FOURBAR.bounded(self.target, self.limits)[0 if full_crank else -1]
        assert isinstance(way.chart, GrashofChart if full_crank else LengthsChart)
        self._freely(chart, [linkage])
        if not self.done:
            self._freely(chart, [one for plan in _PLANS for one in self._under_limits(way, linkage, plan)])

    def _freely(self, chart: FullCrankChart | AnyChart, linkages: list[Linkage]) -> None:
        """Descents without limits from linkages: those that end within them are found."""
        if not linkages or self.work.expired():
            return
        problem = ProjectedProblem(self.target, chart)
        shape = chart.unknowns(np.array([one.links for one in linkages]))
        unknowns = np.column_stack([shape, [one.start for one in linkages]])
        branch = np.array([float(one.branch) for one in linkages])
        found = minimise(problem.evaluate, unknowns, branch, _STEPS, 0.0, self.work, residual=problem.residual)
        closes = np.isfinite(found.cost)
        ends, branch = found.unknowns[closes], branch[closes]
        lengths = chart.shape(ends[:, :-1]).lengths
        self.found += self.kept(assess(self.target, mounted(self.target, lengths, branch, ends[:, -1])))

    def _under_limits(self, way: Bounded, linkage: Linkage, plan: Plan) -> list[Linkage]:
        """Where a descent under the limits ends, moved onto those that it still breaks."""
        if self.work.expired():
            return []
        problem = problem_of(self.target, way)
        unknowns, branch = self._unknowns(problem, way, linkage), np.array([float(linkage.branch)])
        found = restored(problem, descend(problem, unknowns, branch, plan, self.work))
        if not np.isfinite(found.cost).all():
            return []
        linkages = problem.linkages(FOURBAR, found.unknowns, found.branch, self.target)
        self.found += self.kept(self.assessed(linkages))
        return linkages

    def _unknowns(self, problem: ShapeProblem, way: Bounded, linkage: Linkage) -> Floats:
        """The linkage as unknowns of a problem within limits."""
        lengths, start = np.array([linkage.links]), np.array([linkage.start])
        if not isinstance(problem, PosedProblem):
            return np.column_stack([way.chart.unknowns(lengths), start])
        if not linkage.mounted:
            linkage = self._mounted(linkage)
        assert linkage.coupler_point is not None
        scale, (radius, angle) = self.target.length_scale, linkage.coupler_point
        pose = Poses(
            np.array([(linkage.pivot_a - problem.middle) / scale]),
            np.array([linkage.ground_angle]),
            np.array([radius / scale * np.exp(1j * (angle + linkage.ground_angle))]),
        )
        return problem.posed(way.chart.unknowns(np.array([linkage.links]) / scale), start, pose)
