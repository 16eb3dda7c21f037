"""A given four-bar refined for poses whose crank angles are free: shape, pose and crank angles descend together, from just there.

Data flow::

    linkage, and its crank angles at the poses or else those at which it comes nearest to them in their order
      -> joint descent without limits -> descents in which limits gain weight, moved onto those still broken
      -> the best of these and of the linkage itself that keeps the limits; where none does, the same from a full crank near it

The crank angles of a linkage whose own are not given: a grid over the turn, and over it the least sum of squared errors by
dynamic programming (the best sum up to a sample at an angle is its own error there plus the least sum up to the sample before
at or before that angle), once from each angle of the grid, both ways round; it passes no angle at which the loop is open.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.limits import Limits
from synthesis.fourbar.linkage import Linkage
from synthesis.fourbar.solution import Solution
from synthesis.free.align import squared_errors
from synthesis.free.answers import solutions_of
from synthesis.free.joint import refine
from synthesis.free.limited import refined_within
from synthesis.free.motion import chart_of
from synthesis.free.pairs import in_any_order
from synthesis.free.pool import Pool
from synthesis.free.poses import Poses
from synthesis.free.rounds import nearest
from synthesis.free.rows import JointProblem, Timed
from synthesis.local.beginning import report_of, turning_fully
from synthesis.ranking import Status
from synthesis.search.search import SearchReport
from synthesis.target import TURN
from synthesis.work import Work

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

_GRID = 120
"""Crank angles at which a linkage is compared with the poses."""
_STEPS = 1000
_SHARPER = 3
"""Steps from the grid to the crank angles between."""
_GAP = 1e-4
"""By which crank angles that coincide are pushed apart."""


def refine_poses(
    poses: Poses, limits: Limits, linkage: Linkage, crank: Floats | None, tolerance: float, work: Work
) -> tuple[list[Solution], SearchReport]:
    """The best linkage that descents from a given one lead to.

    Parameters
    ----------
    poses : Poses
    limits : Limits
    linkage : Linkage
        Mounted, or else it begins in its best pose.
    crank : ndarray, shape (N,), or None
        Its crank angles at the samples from the first one, of all samples that were asked for.
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
        pool = pool.joined(Pool.of(refine(problem, timed, _STEPS, 0.3 * tolerance, work)))
        found = solutions_of(poses, pool, chart, limits, 1, tolerance)
        if not (limits.only_family or Status.of(found, tolerance) is Status.REACHED or work.expired()):
            inside = refined_within(poses, limits, pool.timed, work)
            found = solutions_of(poses, inside.joined(pool), chart, limits, 1, tolerance)
    return found, report_of(found, given, seconds, tolerance, work)


def _as_it_is(problem: JointProblem, timed: Timed) -> Pool:
    """Candidates in their own pose."""
    return Pool(timed, problem.plain_cost(timed))


def _begun(poses: Poses, limits: Limits, linkage: Linkage, crank: Floats | None) -> Timed | None:
    """The linkage as candidates: at the crank angles given, where it closes there, else at those at which it fits best.

    None where it closes at no crank angle.
    """
    problem = JointProblem(poses, chart_of(limits.family))
    assert linkage.coupler_point is not None
    scale, (radius, angle) = poses.length_scale, linkage.coupler_point
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
        one = own._replace(angles=angles[None])
        return one if attached else problem.facing(one)

    if crank is not None:
        begun = at(_in_order(poses, linkage.start + crank[: poses.samples]))
        if np.isfinite(_as_it_is(problem, begun).cost).all():
            return begun
    placed = problem if attached else JointProblem(replace(poses, rotation=None), problem.chart)
    begins = [at(angles) for angles in _fitting(placed, own)]
    if not begins:
        return None
    every = begins[0].joined(*begins[1:])
    return every.joined(nearest(problem, every, _SHARPER))


def _in_order(poses: Poses, angles: Floats) -> Floats:
    """Crank angles (N,) as they are where they keep what is asked of them; else pushed apart and together until they do."""
    if not poses.ordered:
        return in_any_order(angles[None], TURN)[0][0]
    sense = 1.0 if angles[-1] >= angles[0] else -1.0
    along = sense * (angles - angles[0])
    gap = min(_GAP, 0.01 * poses.span_max / len(along))
    if np.diff(along).min() <= 0:
        even = gap * np.arange(len(along))
        along = np.maximum.accumulate(along - even) + even
    along *= min(1.0, (1 - 1e-9) * poses.span_max / along[-1])
    return np.asarray(angles[0] + sense * along)


def _fitting(problem: JointProblem, own: Timed) -> list[Floats]:
    """Crank angles (N,) at which one linkage comes nearest to the samples in their order, for each sense of the crank."""
    poses = problem.poses
    grid = np.linspace(0.0, TURN, _GRID, endpoint=False)
    each = own.take(np.zeros(_GRID, dtype=int))._replace(angles=grid[:, None])
    closes = np.broadcast_to(problem.turned(each, derivatives=False).body.possible, _GRID)
    if not closes.any():
        return []
    costs = np.where(closes[:, None], squared_errors(problem, each)[:, :, 0], np.inf).T
    if not poses.ordered:
        return [_in_order(poses, grid[costs.argmin(axis=1)])]
    most = min(_GRID, int(poses.span_max / (TURN / _GRID)) + 1)
    found = []
    for sense in (1, -1):
        way = np.roll(np.arange(_GRID)[::sense], 1 if sense < 0 else 0)
        begin, steps = _one_way(costs[:, way], closes[way], most)
        found.append(_in_order(poses, sense * (grid[begin] + steps * grid[1])))
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
