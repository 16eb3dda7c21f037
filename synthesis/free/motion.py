"""Motion without crank angles: the search for poses that have both a rotation and a position.

Data flow of a request::

    poses -> dyads (five and more: one SVD and a quartic; fewer: samples of the infinitely many)
      -> pairs of dyads as four-bars with crank angles -> those of the family, on one branch and in the order asked for
      -> joint refinement -> reached? otherwise dyads from starts all over the body, their pairs, refined in rounds
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from synthesis.fourbar.charts import FullCrankChart
from synthesis.fourbar.limits import in_family
from synthesis.free.dyads import Body, Dyads, landscape, linear_dyads, polished
from synthesis.free.few import sampled_dyads
from synthesis.free.joint import JointProblem, Timed, refine
from synthesis.free.pairs import in_order, pairs_of, put_in_order
from synthesis.free.pool import Pool
from synthesis.free.poses import Poses
from synthesis.target import TURN
from synthesis.work import Work

Floats = NDArray[np.float64]

FEW = 4
"""Up to so many poses infinitely many dyads fit exactly."""
_FEW_DYADS, _FEW_BATCHES = 60, 20
_ENOUGH = 60
"""Exact candidates that are enough of a choice."""


class Round(NamedTuple):
    """A descent of the best pairs."""

    most: int
    iterations: int
    reason: str


ROUNDS = (
    Round(150, 15, "pairs of dyads that each fit alone: most fall into few valleys"),
    Round(40, 40, "the best valleys"),
    Round(12, 150, "narrow ones"),
    Round(4, 1000, "what still falls, to its end"),
)
_SETTLED, _EXACT_BELOW = 1e-3, 1e-4
"""Two rounds whose best J agree to the first part end the search; not below the second, where an exact answer may lie at the
end of a narrow valley."""


def four_bars(poses: Poses, body: Body, dyads: Dyads, family: str, repair: bool = False) -> Timed:
    """The pairs of dyads that are of the family, lie on one branch and pass the poses in the order asked for.

    With ``repair`` also those that do so only nearly, their angles put in order.
    """
    pairs = pairs_of(body, dyads)
    if poses.ordered:
        angles, holds = in_order(pairs.angles, poses.span_max)
        if repair:
            angles = np.where(holds[:, None], angles, put_in_order(pairs.angles, poses.span_max))
    else:
        angles, holds = in_any_order(pairs.angles, poses.span_max)
    keep = np.flatnonzero((holds & pairs.one_branch | repair) & in_family(family, pairs.lengths))
    pairs = pairs.take(keep)
    shape = FullCrankChart().unknowns(pairs.lengths)
    return Timed(shape, pairs.pose, pairs.offset, angles[keep], pairs.branch)


def in_any_order(angles: Floats, span_max: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Crank angles (n, N) on the shortest arc that holds all, and for which that is short enough."""
    within = np.sort(angles % TURN, axis=1)
    gaps = np.diff(np.concatenate([within, within[:, :1] + TURN], axis=1), axis=1)
    largest = gaps.argmax(axis=1)
    begin = np.take_along_axis(within, ((largest + 1) % within.shape[1])[:, None], 1)
    along = begin + (angles - begin) % TURN
    along -= TURN * np.round(along[:, :1] / TURN)
    return along, TURN - gaps.max(axis=1) <= span_max * (1 + 1e-12)


def search_motion(
    poses: Poses, family: str, tolerance: float, work: Work, note: Callable[[float], None]
) -> tuple[Pool, bool]:
    """Four-bars that guide a body through poses with rotation and position.

    Parameters
    ----------
    poses : Poses
        With at least two samples that have both; the others are left out.
    family : str
        One of `limits.FAMILIES` whose crank turns fully.
    tolerance : float
        The search ends once J is below it.
    work : Work
    note : callable
        Told the best J after each round.

    Returns
    -------
    pool : Pool
        Candidates, best first.
    settled : bool
        Whether the search ran to its end: the tolerance, or the last round.
    """
    body = Body(poses)
    problem = JointProblem(poses, FullCrankChart())
    if body.position.size <= FEW:
        pool = _few(problem, body, family, work)
        note(pool.least)
        return pool, True
    exact, exact_dyads = 0.3 * tolerance, body.position.size == FEW + 1
    dyads = linear_dyads(body)
    if dyads.radius.size:
        dyads, _ = polished(body, dyads)
    pool = Pool.of(refine(problem, four_bars(poses, body, dyads, family), 25, exact, work, all_of_them=exact_dyads))
    note(pool.least)
    if pool.least < tolerance or work.expired():
        return pool.best(pool.cost.size), True
    everywhere, _ = landscape(body)
    found = Pool.measured(problem, four_bars(poses, body, everywhere.joined(dyads), family, repair=True)).joined(pool)
    before = np.inf
    for one in ROUNDS:
        found = found.best(one.most)
        found = Pool.of(refine(problem, found.timed, one.iterations, exact, work))
        note(found.least)
        if found.least < tolerance or work.expired() or _settled(found.least, before):
            break
        before = found.least
    return found.best(found.cost.size), not work.expired()


def _few(problem: JointProblem, body: Body, family: str, work: Work) -> Pool:
    """Exact four-bars through up to four poses, from dyads at random; more of them where few are usable."""
    random = np.random.default_rng(20)
    poses = problem.poses
    pool = Pool.measured(problem, four_bars(poses, body, sampled_dyads(body, _FEW_DYADS, random), family))
    for _ in range(_FEW_BATCHES - 1):
        if pool.cost.size >= _ENOUGH or work.expired():
            break
        dyads = sampled_dyads(body, _FEW_DYADS, random)
        pool = pool.joined(Pool.measured(problem, four_bars(poses, body, dyads, family)))
    return pool


def _settled(least: float, before: float) -> bool:
    return least > max((1 - _SETTLED) * before, _EXACT_BELOW)
