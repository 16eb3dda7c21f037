"""Poses without crank angles within limits: seeds within the limits, and descents in shape, pose and all angles.

Data flow::

    windows at guessed timings in poses within the limits, and the other starting points of the search
      -> descents in which violated limits are rows of growing weight beside the rows of the samples
      -> at the resulting angles, moved onto the limits that are still violated
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from synthesis.arrays import Complexes
from synthesis.constraints import Constraints
from synthesis.descents import Pool, Timed
from synthesis.fourbar.mechanism import search_spaces
from synthesis.free.dyads import chart_of
from synthesis.free.joint import JointProblem
from synthesis.limits import Limits
from synthesis.mechanism import Boxes, Chart
from synthesis.poses import Poses
from synthesis.search.options import POLISH, SELECTED_LATE
from synthesis.search.prescribed import GivenProblem
from synthesis.search.seeds import Fits, Windows
from synthesis.target import Target
from synthesis.work import Work

_SPANS = np.deg2rad([130.0, 40.0, 260.0, 80.0, 190.0, 330.0])
"""Guesses of the crank angle from the first sample to the last."""
_SEEDS = 24
"""Windows of each guess."""
_APART = 1e-6
"""Ratio of the crank to the length scale below which there is no crank."""
_GO_IN = (*SELECTED_LATE.first, *SELECTED_LATE.continuation, *POLISH)
"""Stages that lead a candidate from far outside of the limits into them, and to convergence."""


def limited_problem(poses: Poses, chart: Chart, limits: Limits) -> JointProblem:
    """Return the problem of poses within limits."""
    constraints = Constraints(limits, poses.middle, poses.length_scale, exact=False)
    return JointProblem(poses, chart, constraints.compiled(True))


def refined_within(poses: Poses, limits: Limits, timed: Timed, work: Work) -> Pool:
    """Refine candidates within limits and move them onto the limits that they still violate; the costs are J squared."""
    problem = limited_problem(poses, chart_of(limits.family), limits)
    return problem.moved_onto(problem.descended(timed, _GO_IN, 0.0, work, steps_after_first=np.inf).timed)[0]


def placed_within(problem: JointProblem, timed: Timed, boxes: Boxes) -> tuple[Timed, NDArray[np.intp]]:
    """Move candidates into the best pose that the boxes for pivots and lengths allow.

    Returns
    -------
    candidates : Timed
        Candidates that have a crank, sorted by fit and violation of the limits.
    within : ndarray of int
        Indices of the candidates that satisfy all limits, best first.
    """
    start = timed.angles[:, 0]
    crank: Complexes = np.exp(1j * (timed.angles - start[:, None]))
    body: Complexes = np.exp(1j * problem.chart.at(timed.shape, timed.angles, timed.branch, derivatives=False).angle)
    lengths = problem.chart.shape(timed.shape).lengths
    rho = lengths[:, 0] / lengths[:, 3] * np.exp(1j * start)
    fits = Fits.of_candidates(problem.poses.position_mean, problem.poses.scaled, crank, body)
    _, pivot, ground, coupler = fits.within(rho, boxes, boxes.reach(lengths))
    apart = np.abs(ground) > _APART * lengths[:, 3] / lengths[:, 0]
    pose = np.stack([pivot, ground * lengths[:, 0] / lengths[:, 3], coupler], axis=1)
    timed = timed._replace(pose=pose).take(apart)
    squares, largest = problem.lacking(timed)
    merit = problem.measured(timed, posed=False).cost + squares
    order = np.argsort(np.where(np.isfinite(merit), merit, np.inf), kind="stable")
    return timed.take(order), np.flatnonzero(largest[order] == 0)


def guessed_windows(poses: Poses, limits: Limits, windows: Windows) -> Iterator[Timed]:
    """Yield seeds within limits at guessed crank angles, evenly along the path, for both senses of the crank, guess by guess."""
    assert poses.position is not None
    steps = np.abs(np.diff(poses.position))
    share = np.concatenate([[0.0], np.cumsum(steps + 0.3 * steps.mean())])
    share = share / share[-1]
    chart = chart_of(limits.family)
    for span in _SPANS[_SPANS <= poses.span_max]:
        both = []
        for sense in (1, -1):
            target = Target(
                None if poses.rotation is None else np.unwrap(poses.rotation),
                poses.position,
                poses.length_scale,
                poses.rotation_weights,
                poses.position_weights,
                crank=sense * span * share,
            )
            both.append(_mirrored(_seeds(target, limits, windows, chart, sense), sense))
        yield both[0].joined(both[1])


def _seeds(target: Target, limits: Limits, windows: Windows, chart: Chart, sense: int) -> Timed:
    """Return the best windows of a target; a crank of the other sense turns in a mirror."""
    if sense < 0:
        target, limits = target.mirrored(), limits.mirrored()
    direction = search_spaces(target, limits, posed=True)[0]
    problem = GivenProblem(target, direction.chart, direction.constraints, posed=True)
    found = windows.seeds(problem, direction.on_shape, direction.boxes, _SEEDS).take(slice(0, _SEEDS))
    shape = chart.unknowns(direction.chart.shape(found.shape).lengths)
    return found._replace(shape=shape, angles=found.angles + target.crank)


def _mirrored(timed: Timed, sense: int) -> Timed:
    """Mirror candidates if the crank turns clockwise."""
    if sense > 0:
        return timed
    return timed._replace(pose=np.conj(timed.pose), angles=-timed.angles, branch=-timed.branch)
