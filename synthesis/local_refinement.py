"""Refinement of a given four-bar to its nearest optimum by the descents of the searches.

**Crank angles given**::

    linkage --(clockwise: mirrored)--> unchanged, in a chart of its family
      -> descent without limits, with the linear unknowns projected out, to machine precision
      -> descents within the limits (with the pose if they concern it), then projection onto limits that are still violated
      -> a second descent without limits from there
      -> best result within the limits, including the given linkage; if there is none, repeat from a full crank close to it

**Crank angles free**::

    linkage with its crank angles at the poses, or with the crank angles at which it is closest to the poses in their order
      -> joint descent without limits -> descents with increasing weight of the limits, then projection onto the limits
      -> best result within the limits, including the given linkage; if there is none, repeat from a full crank close to it

**Moved no farther than needed**: a single descent within the limits begins with short steps and ends as soon as a step lowers the
error only slightly. A compact linkage thus stays compact if its nearest optimum lies far along a flat valley.

Unknown crank angles of a linkage are found on a grid over the turn. Dynamic programming minimizes the sum of squared errors:
the best sum up to a sample at an angle is its error there plus the smallest sum up to the previous sample at or before this
angle. This is done from each angle of the grid in both directions, and never passes an angle at which the loop is open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Floats
from synthesis.descents import Stage, Timed
from synthesis.four_bar import grashof_excesses, wrap
from synthesis.fourbar.mechanism import AnyChart, Bounded, GrashofChart, mounted, search_spaces
from synthesis.free.dyads import chart_of
from synthesis.free.joint import JointProblem
from synthesis.free.limited import limited_problem, refined_within
from synthesis.free.search import solutions_of, within_limits
from synthesis.function.answers import Generator
from synthesis.function.answers import within_limits as answers_within
from synthesis.function.laws import FOUR_BAR
from synthesis.function.search import FunctionSearch, FunctionTask
from synthesis.limits import Limits, in_family
from synthesis.linkage import Linkage, with_links
from synthesis.pose import whole_turns
from synthesis.poses import Poses
from synthesis.ranking import Answer, Status
from synthesis.search.prescribed import GivenProblem, candidates_of, problem_of
from synthesis.search.report import SearchReport, stopped_by
from synthesis.solution import Solution, assess
from synthesis.target import TURN, Target
from synthesis.violations import within
from synthesis.work import Work

Ints = NDArray[np.intp]

# -- starting linkages ---------------------------------------------------------------------------------------------


def _stages(steps: int, weights: Sequence[float], last: int) -> tuple[Stage, ...]:
    """Return stages with growing weights of the limits, and a long last stage."""
    return *(Stage(steps, weight=rho**0.5) for rho in weights), Stage(last, weight=1000.0**0.5)


_WEIGHTS = (10.0, 30.0, 100.0, 300.0, 1000.0)


@dataclass(frozen=True)
class LocalOptions:
    """Options of the refinement of a given linkage."""

    excess_min: float = 1e-2
    """Smallest Grashof excess over the sum of the lengths of a linkage that is changed to turn fully.

    Near a change point a descent stagnates."""
    apart: float = 1e-3
    """Relative difference of crank and ground after their exchange, if their order does not suit the family."""
    stages: tuple[tuple[Stage, ...], ...] = (
        _stages(4, _WEIGHTS, 80),
        _stages(5, (0.1, 0.3, 1.0, 3.0, *_WEIGHTS), 55),
    )
    """Stages of the two descents within limits.

    The first does not leave the basin of a linkage within them, the second approaches distant limits slowly."""
    free_stages: tuple[Stage, ...] = (Stage(400),)
    """Stages of a descent without limits if the crank angles are prescribed."""
    free_damping: float = 1.0
    """Damping of its first step, so large that a flat valley is not left for its far end in a single step."""
    joint_stages: tuple[Stage, ...] = (Stage(1000),)
    """Stages of a descent without limits if the crank angles are free."""
    grid: int = 120
    """Number of crank angles at which a linkage is compared with the poses."""
    nearest_steps: int = 3
    """Number of refinement steps from the grid to crank angles in between."""
    gap: float = 1e-4
    """Distance in radians to which coinciding crank angles are separated."""
    nearby_stages: tuple[Stage, ...] = (Stage(30, 0.05, 30.0), Stage(30, 0.05, 300.0))
    """Stages of `nearby_motion` and `nearby_poses`.

    Each ends with the first step that lowers the squared error by less than a twentieth."""
    nearby_damping: float = 0.1
    """Damping of their first step: much larger than in a descent to an optimum, so that no step goes far along a flat valley."""


OPTIONS = LocalOptions()


def turning_fully(linkage: Linkage, family: str) -> Linkage:
    """Return the linkage if it belongs to a family of full cranks, otherwise a similar linkage that does, mounted alike.

    Parameters
    ----------
    linkage : Linkage
    family : str
        Family of `limits.FAMILIES`; ``any`` means full cranks.
    """
    family = "full_crank" if family == "any" else family
    if in_family(family, np.array([linkage.links]))[0]:
        return linkage
    crank, coupler, rocker, ground = linkage.links
    rocks = {"crank_rocker": True, "double_crank": False}.get(family, crank <= ground)
    # a double-crank has the lengths of a crank-rocker with crank and ground, coupler and rocker exchanged
    shortest, first, second, fourth = (crank, coupler, rocker, ground) if rocks else (ground, rocker, coupler, crank)
    if fourth < (1 + 2 * OPTIONS.apart) * shortest:
        middle = (shortest + fourth) / 2
        shortest, fourth = (1 - OPTIONS.apart) * middle, (1 + OPTIONS.apart) * middle
    smallest_excess = OPTIONS.excess_min * (shortest + first + second + fourth)
    a, b, c = (max(float(excess), smallest_excess) for excess in grashof_excesses([shortest, first, second, fourth]))
    first, second, fourth = shortest + (a + c) / 2, shortest + (b + c) / 2, shortest + (a + b) / 2
    links = (shortest, first, second, fourth) if rocks else (fourth, second, first, shortest)
    return with_links(linkage, links)


def _of_family(linkage: Linkage, limits: Limits) -> Linkage:
    """Return the linkage, or a similar linkage of the family that the limits require."""
    return linkage if limits.family == "any" else turning_fully(linkage, limits.family)


def report_of(
    found: Sequence[Answer], begin: Sequence[Answer], seconds: float, tolerance: float, work: Work
) -> SearchReport:
    """Return the report of a refinement: the error of the given linkage, if it satisfies the limits, and of the result."""
    trace = [(seconds, min(answer.errors.objective for answer in begin))] if begin else []
    if found and (not trace or found[0].errors.objective < trace[-1][1]):
        trace.append((work.elapsed, found[0].errors.objective))
    return SearchReport(stopped_by(found, tolerance, work), trace, 0.0, 1)


# -- crank angles given --------------------------------------------------------------------------------------------


def refine_motion(
    target: Target, limits: Limits, linkage: Linkage, tolerance: float, work: Work
) -> tuple[list[Solution], SearchReport]:
    """Refine a linkage by descents and return the best result.

    Parameters
    ----------
    target : Target
    limits : Limits
    linkage : Linkage
        Initial linkage; if it is not mounted, it starts in its best pose.
    tolerance : float
        Objective below which the descents end.
    work : Work
        When it has expired, the best result until then is returned.

    Returns
    -------
    solutions : list of Solution
        A single linkage within the limits; empty if no descent leads into them. If the given linkage satisfies the limits,
        the result is not worse.
    report : SearchReport
    """
    if target.clockwise:
        found, report = refine_motion(target.mirrored(), limits.mirrored(), linkage.mirrored(), tolerance, work)
        return [solution.mirrored() for solution in found], report
    run = _Descents(target, limits, tolerance, work)
    closing = run.assessed([linkage])
    begin, seconds = run.within_limits(closing), work.elapsed
    if limits.family == "any" and (closing or linkage.mounted):
        run.lead(linkage)
    if not run.found:
        run.lead(turning_fully(linkage, limits.family), full_crank=True)
    run.found += begin
    found = run.best[:1]
    return found, report_of(found, begin, seconds, tolerance, work)


def nearby_motion(target: Target, limits: Limits, linkage: Linkage, tolerance: float, work: Work) -> list[Solution]:
    """Return a linkage moved no farther than needed; for the parameters and the law see `refine_motion`.

    Returns
    -------
    list of Solution
        A single linkage within the limits; empty if the descent does not lead into them.
    """
    if target.clockwise:
        moved = nearby_motion(target.mirrored(), limits.mirrored(), linkage.mirrored(), tolerance, work)
        return [solution.mirrored() for solution in moved]
    run = _Descents(target, limits, tolerance, work)
    linkage = _of_family(linkage, limits)
    closing = run.assessed([linkage])
    run.found = run.within_limits(closing)
    if closing and not run.done:
        space = search_spaces(target, limits)[-1 if limits.family == "any" else 0]
        run.lead_within(space, linkage, OPTIONS.nearby_stages, OPTIONS.nearby_damping)
    return run.best[:1]


class _Descents:
    """Descents for a request, and their results within the limits."""

    def __init__(self, target: Target, limits: Limits, tolerance: float, work: Work) -> None:
        self.target, self.limits, self.tolerance, self.work = target, limits, tolerance, work
        self.found: list[Solution] = []

    @property
    def done(self) -> bool:
        """True if the tolerance is reached or the work has expired."""
        return Status.of(self.best, self.tolerance) is Status.REACHED or self.work.expired()

    @property
    def best(self) -> list[Solution]:
        """Results, best first."""
        return sorted(self.found, key=lambda solution: solution.errors.objective)

    def assessed(self, linkages: list[Linkage]) -> list[Solution]:
        """Compute the errors of linkages, in their best pose if they are not mounted; omit linkages that do not close."""
        closing = [
            linkage
            for linkage in linkages
            if np.isfinite(linkage.body(linkage.start + self.target.crank).rotation).all()
        ]
        if self.target.position is None:
            closing = [
                replace(linkage, pivot_a=0j, ground_angle=0.0, coupler_point_polar=None) for linkage in closing
            ]
            closing = [linkage.scaled(1 / linkage.links[3]) for linkage in closing]
        elif not all(linkage.mounted for linkage in closing):
            closing = [self._mounted(linkage) for linkage in closing]
        return [solution for solution in assess(self.target, closing) if np.isfinite(solution.errors.objective)]

    def _mounted(self, linkage: Linkage) -> Linkage:
        return mounted(self.target, [linkage.links], [linkage.branch], [linkage.start])[0]

    def within_limits(self, solutions: list[Solution]) -> list[Solution]:
        """Return the solutions within the limits."""
        return within(self.target, self.limits, solutions)

    def lead(self, linkage: Linkage, full_crank: bool = False) -> None:
        """Run descents from a linkage; a full crank closes at every sample."""
        chart = GrashofChart() if full_crank else AnyChart()
        space = search_spaces(self.target, self.limits)[0 if full_crank else -1]
        self._freely(chart, [linkage])
        if not self.done:
            self._freely(chart, [end for plan in OPTIONS.stages for end in self.lead_within(space, linkage, plan)])

    def _freely(self, chart: GrashofChart | AnyChart, linkages: list[Linkage]) -> None:
        """Run descents without limits, and add the results that satisfy the limits."""
        if not linkages or self.work.expired():
            return
        problem = GivenProblem(self.target, chart)
        starts = candidates_of(self.target, chart, linkages, np.array([[linkage.start] for linkage in linkages]))
        found = problem.descended(starts, OPTIONS.free_stages, 0.0, self.work, OPTIONS.free_damping)
        ends = problem.linkages(found.take(np.isfinite(found.cost)))
        self.found += self.within_limits(assess(self.target, ends))

    def lead_within(
        self, space: Bounded, linkage: Linkage, plan: Sequence[Stage], damping: float = 1e-3
    ) -> list[Linkage]:
        """Run a descent within the limits, project its end onto violated limits, and return the linkage."""
        if self.work.expired():
            return []
        problem = problem_of(self.target, space)
        placed = self._mounted(linkage) if problem.posed and not linkage.mounted else linkage
        starts = candidates_of(self.target, problem.chart, [placed], np.array([[linkage.start]]))
        found = problem.descended(starts, plan, 0.0, self.work, damping)
        found, _ = problem.moved_onto(found.timed)
        if not np.isfinite(found.cost).all():
            return []
        linkages = problem.linkages(found)
        self.found += self.within_limits(self.assessed(linkages))
        return linkages


# -- crank angles free ---------------------------------------------------------------------------------------------


def refine_poses(
    poses: Poses, limits: Limits, linkage: Linkage, crank: Floats | None, tolerance: float, work: Work
) -> tuple[list[Solution], SearchReport]:
    """Refine a linkage for poses without crank angles; see `refine_motion` for the parameters and the result.

    ``crank`` (N,): crank angles of the linkage at all requested samples from the first sample; None if unknown.
    """
    begins = [linkage] if limits.family == "any" else []
    begins.append(turning_fully(linkage, limits.family))
    found: list[Solution] = []
    unchanged: list[Solution] = []
    seconds = work.elapsed
    for start in begins:
        timed = None if found else _candidates_of(poses, limits, start, crank)
        if timed is None:
            continue
        problem = JointProblem(poses, chart_of(limits.family))
        pool, chart = problem.measured(timed, posed=False), problem.chart
        if start is linkage:
            unchanged, seconds = (
                solutions_of(poses, pool, chart, Limits(family=limits.family), 1, tolerance),
                work.elapsed,
            )
        pool = pool.joined(problem.descended(timed, OPTIONS.joint_stages, 0.3 * tolerance, work))
        found = solutions_of(poses, pool, chart, limits, 1, tolerance)
        if not (limits.only_family or Status.of(found, tolerance) is Status.REACHED or work.expired()):
            inside = refined_within(poses, limits, pool.timed, work)
            found = solutions_of(poses, inside.joined(pool), chart, limits, 1, tolerance)
    return found, report_of(found, unchanged, seconds, tolerance, work)


def crank_angles_at(poses: Poses, linkage: Linkage) -> Floats | None:
    """Return the crank angles (N,) from the start of a mounted four-bar at which it comes nearest to the samples.

    None if it closes at no crank angle.
    """
    limits = Limits(family="any")
    timed = _candidates_of(poses, limits, linkage, None)
    if timed is None:
        return None
    pool = JointProblem(poses, chart_of(limits.family)).measured(timed, posed=False)
    angles = pool.timed.angles[int(np.argmin(pool.cost))]
    return np.asarray(angles - angles[0] + wrap(angles[0] - linkage.start))


def nearby_poses(
    poses: Poses, limits: Limits, linkage: Linkage, crank: Floats | None, tolerance: float, work: Work
) -> list[Solution]:
    """Return a linkage moved no farther than needed; see `refine_poses` for the parameters."""
    timed = _candidates_of(poses, limits, _of_family(linkage, limits), crank)
    if timed is None:
        return []
    chart = chart_of(limits.family)
    unmoved = JointProblem(poses, chart).measured(timed, posed=False)
    if unmoved.min_error < tolerance and (accurate := solutions_of(poses, unmoved, chart, limits, 1, tolerance)):
        return accurate
    problem = limited_problem(poses, chart, limits)
    moved = problem.descended(timed, OPTIONS.nearby_stages, tolerance, work, OPTIONS.nearby_damping)
    pool, _ = problem.moved_onto(moved.timed)
    return solutions_of(poses, pool.joined(unmoved), chart, limits, 1, tolerance)


def _candidates_of(poses: Poses, limits: Limits, linkage: Linkage, crank: Floats | None) -> Timed | None:
    """Return the linkage as candidates: at the given crank angles if it closes there, otherwise at its best crank angles.

    Return None if it does not close at any crank angle.
    """
    problem = JointProblem(poses, chart_of(limits.family))
    own = candidates_of(poses, problem.chart, [linkage], np.empty((1, 0)))
    attached = linkage.body_offset is not None

    def at(angles: Floats) -> Timed:
        arcs = _in_order(poses, angles)[None] if poses.ordered else _arcs(angles, poses.span_max)
        candidates = own.take(np.zeros(len(arcs), dtype=int))._replace(angles=arcs)
        candidates = candidates if attached else problem.facing(candidates)
        if poses.ordered:
            return candidates
        # in any order all arcs contain the samples, but an arc may violate limits that another arc satisfies
        accepted = within_limits(poses, limits, problem.measured(candidates, posed=False), problem.chart)
        return candidates.take([int(accepted.argmax())])

    if crank is not None:
        candidates = at(linkage.start + crank[: poses.samples])
        if np.isfinite(problem.measured(candidates, posed=False).cost).all():
            return candidates
    begins = [at(angles) for angles in _fitting(poses if attached else replace(poses, rotation=None), linkage)]
    if not begins:
        return None
    joined = begins[0].joined(*begins[1:])
    return joined.joined(problem.nearest(joined, OPTIONS.nearest_steps))


def _in_order(poses: Poses, angles: Floats) -> Floats:
    """Return crank angles (N,) in increasing or decreasing order within the largest span, changed as little as needed."""
    sense = 1.0 if angles[-1] >= angles[0] else -1.0
    along = sense * (angles - angles[0])
    gap = min(OPTIONS.gap, 0.01 * poses.span_max / len(along))
    if np.diff(along).min() <= 0:
        even = gap * np.arange(len(along))
        along = np.maximum.accumulate(along - even) + even
    along *= min(1.0, (1 - 1e-9) * poses.span_max / along[-1])
    return np.asarray(angles[0] + sense * along)


def _arcs(angles: Floats, span_max: float) -> Floats:
    """Return crank angles (n, N) on the shortest arc that contains all of them, then on other arcs within ``span_max``."""
    within = angles % TURN
    begin = within[:, None]
    along = begin + (within - begin) % TURN
    along -= TURN * np.round(along[:, :1] / TURN)
    span = np.ptp(along, axis=1)
    order = np.argsort(span, kind="stable")
    return along[order[: max(1, np.count_nonzero(span <= span_max))]]


def _fitting(poses: Poses, linkage: Linkage) -> list[Floats]:
    """Return crank angles (N,) at which a linkage is closest to the samples; for ordered samples in both directions."""
    grid = np.linspace(0.0, TURN, OPTIONS.grid, endpoint=False)
    body, costs = linkage.body(grid), np.zeros((poses.samples, grid.size))
    if poses.rotation is not None:
        turned = body.rotation - poses.rotation[:, None]
        turned -= TURN * np.round(turned / TURN)
        costs += np.reshape(poses.rotation_mean.root**2, (-1, 1)) * turned**2
    if poses.position is not None:
        off = (body.position - poses.position[:, None]) / poses.length_scale
        costs += np.reshape(poses.position_mean.root**2, (-1, 1)) * np.abs(off) ** 2
    closes = np.isfinite(costs[0])
    costs[:, ~closes] = np.inf
    if not closes.any():
        return []
    if not poses.ordered:
        return [grid[costs.argmin(axis=1)]]
    width = min(OPTIONS.grid, int(poses.span_max / (TURN / OPTIONS.grid)) + 1)
    found = []
    for sense in (1, -1):
        ring = np.roll(np.arange(OPTIONS.grid)[::sense], 1 if sense < 0 else 0)
        begin, steps = _one_way(costs[:, ring], closes[ring], width)
        found.append(sense * (grid[begin] + steps * grid[1]))
    return found


def _one_way(costs: Floats, closes: NDArray[np.bool_], width: int) -> tuple[int, Ints]:
    """Minimize the sum of costs (N, G) over a start on the ring and non-decreasing steps (N,) from it; return both."""
    size = len(closes)
    index = (np.arange(size)[:, None] + np.arange(width)) % size
    # positions beyond the first angle at which the loop is open are excluded
    index = np.where(np.logical_and.accumulate(closes[index], axis=1), index, size)
    padded = np.pad(costs, ((0, 0), (0, 1)), constant_values=np.inf)
    sums = np.zeros(index.shape)
    for row in padded:
        sums = np.minimum.accumulate(sums, axis=1) + row[index]
    begin = int(sums.min(axis=1).argmin())
    rows = padded[:, index[begin]]
    best, trail = np.zeros(width), []
    for row in rows:
        lowest = np.minimum.accumulate(best)
        trail.append(np.maximum.accumulate(np.where(best <= lowest, np.arange(width), 0)))
        best = lowest + row
    steps, at = [], int(best.argmin())
    for where in reversed(trail):
        steps.append(at)
        at = int(where[at])
    return begin, np.array(steps[::-1])


# -- function generators -------------------------------------------------------------------------------------------


def refine_function(
    task: FunctionTask, linkage: Linkage, offset: float | None
) -> tuple[list[Generator], SearchReport]:
    """Refine a function generator by descents and return the best result.

    Parameters
    ----------
    task : FunctionTask
        Given lengths and zeros replace the lengths and zeros of the linkage.
    linkage : Linkage
        A four-bar.
    offset : float or None
        output = theta3 + offset with theta3 in (-pi, pi] at the first sample; None: the offset with the smallest rms error.

    Returns
    -------
    generators : list of Generator
        A single generator within the limits; empty if no descent leads into them. If the given linkage satisfies the limits,
        the result is not worse.
    report : SearchReport
    """
    run = FunctionSearch(task, FOUR_BAR, 1)
    unchanged: list[Generator] = []
    found: list[Generator] = []
    seconds = task.work.elapsed
    for start in (linkage, turning_fully(linkage, task.limits.limits.family)):
        if found:
            break
        branch = np.array([float(start.branch)])
        unknowns = FOUR_BAR.unknowns_of(np.array([start.links]), np.array([start.start]))
        unknowns = run.with_best_offset(unknowns, branch)
        if offset is not None and task.target.offset is None:
            unknowns[:, 4] = offset + whole_turns(unknowns[:, 4] - offset)
        as_it_is = [answer for answer in answers_within(run.problem, unknowns, branch) if answer is not None]
        if start is linkage:
            unchanged, seconds = as_it_is, task.work.elapsed
        found = sorted(run.best_from(unknowns, branch) + as_it_is, key=lambda each: each.errors.objective)[:1]
    return found, report_of(found, unchanged, seconds, task.tolerance, task.work)
