"""A given four-bar led to its nearest optimum: the searches' own descents, from just there.

**Crank angles given**::

    linkage --(clockwise: mirrored)--> as it is, in a chart of its family
      -> descent without limits, everything linear projected out: to machine precision
      -> descents under the limits, with the pose where they concern it, moved onto the limits that are still broken
      -> from there once more without limits
      -> the best of these and of the linkage itself that keeps the limits; where none does, the same from a full crank near it

**Crank angles free**::

    linkage, and its crank angles at the poses or else those at which it comes nearest to them in their order
      -> joint descent without limits -> descents in which limits gain weight, moved onto those still broken
      -> the best of these and of the linkage itself that keeps the limits; where none does, the same from a full crank near it

**Moved no farther than needed**: a single descent within the limits begins with short steps and ends as soon as a step lowers the
error only slightly. A compact linkage thus stays compact if its nearest optimum lies far along a flat valley.

The crank angles of a linkage whose own are not given: a grid over the turn, and over it the least sum of squared errors by
dynamic programming (the best sum up to a sample at an angle is its own error there plus the least sum up to the sample before
at or before that angle), once from each angle of the grid, both ways round; it passes no angle at which the loop is open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Floats
from synthesis.constraints import within
from synthesis.descents import Pool, Stage, Timed
from synthesis.four_bar import grashof_excesses
from synthesis.fourbar.mechanism import FOURBAR, AnyChart, FullCrankChart, mounted
from synthesis.free.dyads import chart_of
from synthesis.free.joint import JointProblem
from synthesis.free.limited import limited_problem, refined_within
from synthesis.free.search import solutions_of, within_limits
from synthesis.function.answers import Generator
from synthesis.function.search import FunctionSearch
from synthesis.function.wanted import Wanted
from synthesis.limits import Limits, in_family
from synthesis.linkage import Linkage, with_links
from synthesis.mechanism import Bounded
from synthesis.poses import Poses
from synthesis.ranking import Answer, Status
from synthesis.search.prescribed import GivenProblem, given, problem_of
from synthesis.search.report import SearchReport, stopped_by
from synthesis.solution import Solution, assess, target_of
from synthesis.target import TURN, Target
from synthesis.work import Work

Ints = NDArray[np.intp]

# -- the beginning -------------------------------------------------------------------------------------------------

_EXCESS = 1e-2
"""Least Grashof excess over the sum of the lengths of a linkage made to turn fully: next to a change point a descent sticks."""
_APART = 1e-3
"""Part by which crank and ground are then moved apart where they stand in the wrong order."""


def turning_fully(linkage: Linkage, family: str) -> Linkage:
    """The linkage where it is of a family of full cranks; else one near it that is, in the same place.

    Parameters
    ----------
    linkage : Linkage
    family : str
        One of `limits.FAMILIES`; of ``any`` the full cranks.
    """
    family = "full_crank" if family == "any" else family
    if in_family(family, np.array([linkage.links]))[0]:
        return linkage
    crank, coupler, rocker, ground = linkage.links
    rocks = {"crank_rocker": True, "double_crank": False}.get(family, crank <= ground)
    # a double-crank's lengths are those of a crank-rocker with crank and ground, coupler and rocker exchanged
    shortest, first, second, fourth = (crank, coupler, rocker, ground) if rocks else (ground, rocker, coupler, crank)
    if fourth < (1 + 2 * _APART) * shortest:
        middle = (shortest + fourth) / 2
        shortest, fourth = (1 - _APART) * middle, (1 + _APART) * middle
    least = _EXCESS * (shortest + first + second + fourth)
    a, b, c = (max(float(one), least) for one in grashof_excesses([shortest, first, second, fourth]))
    first, second, fourth = shortest + (a + c) / 2, shortest + (b + c) / 2, shortest + (a + b) / 2
    links = (shortest, first, second, fourth) if rocks else (fourth, second, first, shortest)
    return with_links(linkage, links)


def _of_family(linkage: Linkage, limits: Limits) -> Linkage:
    """Return the linkage, or a similar linkage of the family that the limits require."""
    return linkage if limits.family == "any" else turning_fully(linkage, limits.family)


def report_of(
    found: Sequence[Answer], begin: Sequence[Answer], seconds: float, tolerance: float, work: Work
) -> SearchReport:
    """How a refinement went: from the error of the given linkage, where it keeps the limits, to that of what was found."""
    trace = [(seconds, min(one.errors.objective for one in begin))] if begin else []
    if found and (not trace or found[0].errors.objective < trace[-1][1]):
        trace.append((work.elapsed, found[0].errors.objective))
    return SearchReport(stopped_by(found, tolerance, work), trace, 0.0, 1)


@dataclass(frozen=True)
class NearbyOptions:
    """Options of `nearby_motion` and `nearby_poses`."""

    stages: tuple[Stage, ...] = (Stage(30, 0.05, 30.0), Stage(30, 0.05, 300.0))
    """Stages of the descent; each ends with the first step that lowers the squared error by less than a twentieth."""
    damping: float = 0.1
    """Damping of the first step: much larger than in a descent to an optimum, so that no step goes far along a flat valley."""


# -- crank angles given --------------------------------------------------------------------------------------------


_STEPS = 400
_WEIGHTS = (10.0, 30.0, 100.0, 300.0, 1000.0)
_PLANS = (
    # a linkage that breaks no limit must not be led out of its valley first; one that breaks many must find a way in
    (*(Stage(4, weight=rho**0.5) for rho in _WEIGHTS), Stage(80, weight=1000.0**0.5)),
    (*(Stage(5, weight=rho**0.5) for rho in (0.1, 0.3, 1.0, 3.0, *_WEIGHTS)), Stage(55, weight=1000.0**0.5)),
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


def nearby_motion(
    target: Target,
    limits: Limits,
    linkage: Linkage,
    tolerance: float,
    work: Work,
    options: NearbyOptions | None = None,
) -> list[Solution]:
    """Return a linkage moved no farther than needed; for the parameters and the law see `refine_motion`.

    Returns
    -------
    list of Solution
        A single linkage within the limits; empty if the descent does not lead into them.
    """
    if target.clockwise:
        moved = nearby_motion(target.mirrored(), limits.mirrored(), linkage.mirrored(), tolerance, work, options)
        return [solution.mirrored() for solution in moved]
    options = options or NearbyOptions()
    run = _Descents(target, limits, tolerance, work)
    linkage = _of_family(linkage, limits)
    closing = run.assessed([linkage])
    run.found = run.kept(closing)
    if closing and not run.done:
        way = FOURBAR.bounded(target, limits)[-1 if limits.family == "any" else 0]
        run.lead_within(way, linkage, options.stages, options.damping)
    return run.best[:1]


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
        closing = [one for one in linkages if np.isfinite(one.body(one.start + self.target.crank).rotation).all()]
        if self.target.position is None:
            closing = [replace(one, pivot_a=0j, ground_angle=0.0, coupler_point_polar=None) for one in closing]
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
        self._freely(chart, [linkage])
        if not self.done:
            self._freely(chart, [one for plan in _PLANS for one in self.lead_within(way, linkage, plan)])

    def _freely(self, chart: FullCrankChart | AnyChart, linkages: list[Linkage]) -> None:
        """Descents without limits from linkages: those that end within them are found."""
        if not linkages or self.work.expired():
            return
        problem = GivenProblem(self.target, chart)
        shape = chart.unknowns(np.array([one.links for one in linkages]))
        branch = np.array([float(one.branch) for one in linkages])
        begun = given(shape, branch, np.array([one.start for one in linkages]))
        found = problem.descended(begun, [Stage(_STEPS)], 0.0, self.work)
        ends = problem.linkages(FOURBAR, found.take(np.isfinite(found.cost)))
        self.found += self.kept(assess(self.target, ends))

    def lead_within(
        self, way: Bounded, linkage: Linkage, plan: Sequence[Stage], damping: float = 1e-3
    ) -> list[Linkage]:
        """Where a descent under the limits ends, moved onto those that it still breaks."""
        if self.work.expired():
            return []
        problem = problem_of(self.target, way)
        found = problem.descended(self._placed(problem, linkage), plan, 0.0, self.work, damping)
        found, _ = problem.moved_onto(found.timed)
        if not np.isfinite(found.cost).all():
            return []
        linkages = problem.linkages(FOURBAR, found)
        self.found += self.kept(self.assessed(linkages))
        return linkages

    def _placed(self, problem: GivenProblem, linkage: Linkage) -> Timed:
        """The linkage as a candidate of a problem within limits."""
        if problem.posed and not linkage.mounted:
            linkage = self._mounted(linkage)
        pose = None
        if problem.posed:
            assert linkage.coupler_point_polar is not None
            scale, (radius, angle) = self.target.length_scale, linkage.coupler_point_polar
            z1 = linkage.links[0] / scale * np.exp(1j * linkage.ground_angle)
            z2 = radius / scale * np.exp(1j * (angle + linkage.ground_angle))
            pose = np.array([[(linkage.pivot_a - self.target.middle) / scale, z1, z2]])
        shape = problem.chart.unknowns(np.array([linkage.links]))
        return given(shape, np.array([float(linkage.branch)]), np.array([linkage.start]), pose)


# -- crank angles free ---------------------------------------------------------------------------------------------


_GRID = 120
"""Crank angles at which a linkage is compared with the poses."""
_JOINT_STEPS = 1000
_SHARPER = 3
"""Steps from the grid to the crank angles between."""
_GAP = 1e-4
"""By which crank angles that coincide are pushed apart."""


def refine_poses(
    poses: Poses, limits: Limits, linkage: Linkage, crank: Floats | None, tolerance: float, work: Work
) -> tuple[list[Solution], SearchReport]:
    """The best linkage that descents from a given one lead to; parameters and what is returned as of `refine_motion`.

    ``crank`` (N,): its crank angles at the samples from the first one, of all samples that were asked for; None: unknown.
    """
    begins = [linkage] if limits.family == "any" else []
    begins.append(turning_fully(linkage, limits.family))
    found: list[Solution] = []
    given: list[Solution] = []
    seconds = work.elapsed
    for one in begins:
        timed = None if found else _begun(poses, limits, one, crank)
        if timed is None:
            continue
        problem = JointProblem(poses, chart_of(limits.family))
        pool, chart = _as_it_is(problem, timed), problem.chart
        if one is linkage:
            given, seconds = (
                solutions_of(poses, pool, chart, Limits(family=limits.family), 1, tolerance),
                work.elapsed,
            )
        pool = pool.joined(problem.descended(timed, [Stage(_JOINT_STEPS)], 0.3 * tolerance, work))
        found = solutions_of(poses, pool, chart, limits, 1, tolerance)
        if not (limits.only_family or Status.of(found, tolerance) is Status.REACHED or work.expired()):
            inside = refined_within(poses, limits, pool.timed, work)
            found = solutions_of(poses, inside.joined(pool), chart, limits, 1, tolerance)
    return found, report_of(found, given, seconds, tolerance, work)


def nearby_poses(
    poses: Poses,
    limits: Limits,
    linkage: Linkage,
    crank: Floats | None,
    tolerance: float,
    work: Work,
    options: NearbyOptions | None = None,
) -> list[Solution]:
    """Return a linkage moved no farther than needed; see `refine_poses` for the parameters."""
    options = options or NearbyOptions()
    timed = _begun(poses, limits, _of_family(linkage, limits), crank)
    if timed is None:
        return []
    chart = chart_of(limits.family)
    unmoved = _as_it_is(JointProblem(poses, chart), timed)
    if unmoved.least < tolerance and (accurate := solutions_of(poses, unmoved, chart, limits, 1, tolerance)):
        return accurate
    problem = limited_problem(poses, chart, limits)
    moved = problem.descended(timed, options.stages, tolerance, work, options.damping)
    pool, _ = problem.moved_onto(moved.timed)
    return solutions_of(poses, pool.joined(unmoved), chart, limits, 1, tolerance)


def refined_in_place(poses: Poses, limits: Limits, one: Solution, crank: Floats, work: Work) -> Solution:
    """The same links mounted anew, at the crank angles (N,) that fit best; as it is where that is no better."""
    held = replace(limits, links=one.linkage.links)
    found, _ = refine_poses(poses, held, one.linkage, crank, 0.0, work)
    for better in found:
        if better.errors.objective < one.errors.objective:
            same = with_links(better.linkage, one.linkage.links)
            return assess(target_of(poses, same, better.travel), [same])[0]
    return one


def _as_it_is(problem: JointProblem, timed: Timed) -> Pool:
    """Candidates in their own pose."""
    return problem.measured(timed, posed=False)


def _begun(poses: Poses, limits: Limits, linkage: Linkage, crank: Floats | None) -> Timed | None:
    """The linkage as candidates: at the crank angles given, where it closes there, else at those at which it fits best.

    None where it closes at no crank angle.
    """
    problem = JointProblem(poses, chart_of(limits.family))
    assert linkage.coupler_point_polar is not None
    scale, (radius, angle) = poses.length_scale, linkage.coupler_point_polar
    z1 = linkage.links[0] / scale * np.exp(1j * linkage.ground_angle)
    z2 = radius / scale * np.exp(1j * (angle + linkage.ground_angle))
    own = Timed(
        problem.chart.unknowns(np.array([linkage.links])),
        np.array([[(linkage.pivot_a - poses.middle) / scale, z1, z2]]),
        np.array([linkage.ground_angle + (linkage.body_offset or 0.0)]),
        np.empty((1, 0)),
        np.array([float(linkage.branch)]),
    )
    attached = linkage.body_offset is not None

    def at(angles: Floats) -> Timed:
        arcs = _in_order(poses, angles)[None] if poses.ordered else _arcs(angles, poses.span_max)
        ways = own.take(np.zeros(len(arcs), dtype=int))._replace(angles=arcs)
        ways = ways if attached else problem.facing(ways)
        if poses.ordered:
            return ways
        # in any order all arcs carry the samples alike, but on one of them limits may be broken that another keeps
        kept = within_limits(poses, limits, _as_it_is(problem, ways), problem.chart)
        return ways.take([int(kept.argmax())])

    if crank is not None:
        begun = at(linkage.start + crank[: poses.samples])
        if np.isfinite(_as_it_is(problem, begun).cost).all():
            return begun
    placed = problem if attached else JointProblem(replace(poses, rotation=None), problem.chart)
    begins = [at(angles) for angles in _fitting(placed, own)]
    if not begins:
        return None
    every = begins[0].joined(*begins[1:])
    return every.joined(problem.nearest(every, _SHARPER))


def _in_order(poses: Poses, angles: Floats) -> Floats:
    """Crank angles (N,) as they are where they keep what is asked of them; else pushed apart and together until they do."""
    sense = 1.0 if angles[-1] >= angles[0] else -1.0
    along = sense * (angles - angles[0])
    gap = min(_GAP, 0.01 * poses.span_max / len(along))
    if np.diff(along).min() <= 0:
        even = gap * np.arange(len(along))
        along = np.maximum.accumulate(along - even) + even
    along *= min(1.0, (1 - 1e-9) * poses.span_max / along[-1])
    return np.asarray(angles[0] + sense * along)


def _arcs(angles: Floats, span_max: float) -> Floats:
    """Crank angles (n, N) on each arc of a turn that holds them all, the shortest first, and others of at most ``span_max``."""
    within = angles % TURN
    begin = within[:, None]
    along = begin + (within - begin) % TURN
    along -= TURN * np.round(along[:, :1] / TURN)
    span = np.ptp(along, axis=1)
    order = np.argsort(span, kind="stable")
    return along[order[: max(1, np.count_nonzero(span <= span_max))]]


def _fitting(problem: JointProblem, own: Timed) -> list[Floats]:
    """Crank angles (N,) at which one linkage comes nearest to the samples, in their order for each sense of the crank."""
    poses = problem.poses
    grid = np.linspace(0.0, TURN, _GRID, endpoint=False)
    costs = problem.errors_at(own, grid[None])[0]
    closes = np.isfinite(costs[0])
    if not closes.any():
        return []
    if not poses.ordered:
        return [grid[costs.argmin(axis=1)]]
    most = min(_GRID, int(poses.span_max / (TURN / _GRID)) + 1)
    found = []
    for sense in (1, -1):
        way = np.roll(np.arange(_GRID)[::sense], 1 if sense < 0 else 0)
        begin, steps = _one_way(costs[:, way], closes[way], most)
        found.append(sense * (grid[begin] + steps * grid[1]))
    return found


def _one_way(costs: Floats, closes: NDArray[np.bool_], most: int) -> tuple[int, Ints]:
    """The place on the ring to begin at, and steps (N,) from there that never go back, of the least sum of costs (N, G)."""
    size = len(closes)
    place = (np.arange(size)[:, None] + np.arange(most)) % size
    # behind the first angle at which the loop is open there is nothing
    place = np.where(np.logical_and.accumulate(closes[place], axis=1), place, size)
    padded = np.pad(costs, ((0, 0), (0, 1)), constant_values=np.inf)
    least = np.zeros(place.shape)
    for row in padded:
        least = np.minimum.accumulate(least, axis=1) + row[place]
    begin = int(least.min(axis=1).argmin())
    rows = padded[:, place[begin]]
    best, trail = np.zeros(most), []
    for row in rows:
        lowest = np.minimum.accumulate(best)
        trail.append(np.maximum.accumulate(np.where(best <= lowest, np.arange(most), 0)))
        best = lowest + row
    steps, at = [], int(best.argmin())
    for where in reversed(trail):
        steps.append(at)
        at = int(where[at])
    return begin, np.array(steps[::-1])


# -- function generators -------------------------------------------------------------------------------------------


def refine_function(
    wanted: Wanted,
    limits: Limits,
    largest: bool,
    linkage: Linkage,
    offset: float | None,
    tolerance: float,
    work: Work,
) -> tuple[list[Generator], SearchReport]:
    """The best generator that descents from a given one lead to.

    Parameters
    ----------
    wanted : Wanted
    limits : Limits
        Lengths that are given replace those of the linkage, and zeros that are given its own.
    largest : bool
        As of `function.search.generate`.
    linkage : Linkage
    offset : float or None
        output = theta3 + offset, theta3 in (-pi, pi] at the first sample; None: the best for the root of the mean square.
    tolerance : float
    work : Work

    Returns
    -------
    generators : list of Generator
        One, within the limits; none where no descent led into them. Law: where the linkage keeps the limits itself, what is
        returned is no worse.
    report : SearchReport
    """
    if wanted.clockwise:
        other = None if offset is None else -offset
        mirrored = wanted.mirrored(), limits, largest, linkage.mirrored(), other
        made, report = refine_function(*mirrored, tolerance, work)
        return [one.mirrored() for one in made], report
    run = FunctionSearch(wanted, limits, largest, 1, tolerance, work)
    given: list[Generator] = []
    found: list[Generator] = []
    seconds = work.elapsed
    for one in (linkage, turning_fully(linkage, limits.family)):
        if found:
            break
        begin = run.candidate(one, offset)
        as_it_is = run.kept(*begin)
        if one is linkage:
            given, seconds = as_it_is, work.elapsed
        found = sorted(run.led(*begin) + as_it_is, key=lambda each: each.errors.objective)[:1]
    return found, report_of(found, given, seconds, tolerance, work)
