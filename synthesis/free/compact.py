"""Four-bars moved to smaller merit while they stay accurate: continuation in limits on size and transmission angle.

Data flow::

    accurate four-bars -> the best by merit -> descents within a tighter limit -> those still accurate, and so on

A search ends at the smallest error, and along a flat valley that is often a huge linkage. Each step tightens the limit on the
size, or on the transmission angle, a little and begins where the step before ended, so that it costs some milliseconds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from synthesis.descents import Stage
from synthesis.errors import FieldError
from synthesis.free.dyads import chart_of
from synthesis.free.limited import limited_problem
from synthesis.free.search import solutions_of
from synthesis.limits import Limits, Reach
from synthesis.mechanism import Chart
from synthesis.poses import Poses
from synthesis.scores import size_of
from synthesis.search.prescribed import candidates_of
from synthesis.solution import Solution
from synthesis.target import Samples
from synthesis.work import Work


class Step(NamedTuple):
    """A tightening of the limits of the best four-bar."""

    size: float
    """Factor of its size."""
    transmission: float
    """Change of its smallest transmission angle that becomes the limit, in radians."""


@dataclass(frozen=True)
class CompactOptions:
    """Options of `compacted`."""

    steps: tuple[Step, ...] = (
        Step(0.75, -np.deg2rad(10.0)),
        Step(0.9, -np.deg2rad(10.0)),
        Step(1.0, np.deg2rad(8.0)),
    )
    """Tightenings that are tried in turn, until one of them lowers the merit."""
    max_steps: int = 24
    """Maximum number of tightenings in all."""
    candidates: int = 12
    """Maximum number of four-bars that descend together."""
    candidate_samples: int = 500
    """Number of candidates times samples above which fewer candidates descend."""
    min_candidates: int = 3
    gain: float = 0.01
    """Relative decrease of the merit below which a step counts as a failure."""
    descent: tuple[Stage, ...] = (Stage(15, 1e-2, 30.0), Stage(20, 1e-3, 300.0))
    """Stages of a descent within the tightened limits."""


OPTIONS = CompactOptions()


def within_size(limits: Limits, samples: Samples, extents: float) -> Limits:
    """Return limits within which no length is above a multiple of the motion's extent.

    Raises
    ------
    FieldError
        If another limit excludes that.
    """
    assert samples.position is not None
    length, reach = extents * samples.extent, limits.pivot_reach
    distances = [
        min(length, distance) if reach and (distance := getattr(reach, name)) else length
        for name in ("pivot_a", "pivot_b")
    ]
    return replace(
        limits,
        link_max=min(length, limits.link_max or np.inf),
        coupler_radius_max=min(length, limits.coupler_radius_max or np.inf),
        pivot_reach=Reach(samples.middle, distances[0], distances[1], None if reach is None else reach.body),
    )


def compacted(
    poses: Poses,
    limits: Limits,
    found: Sequence[Solution],
    best_first: Callable[[Sequence[Solution]], list[tuple[float, Solution]]],
    tolerance: float,
    work: Work,
) -> list[Solution]:
    """Return further four-bars with a smaller merit.

    Parameters
    ----------
    poses : Poses
        With positions.
    limits : Limits
    found : sequence of Solution
        To begin with.
    best_first : callable
        Returns the accurate four-bars of some with their merits, smallest first.
    tolerance : float
        Objective below which a linkage is exact.
    work : Work

    Returns
    -------
    list of Solution
        Accurate four-bars; law: none if none is better than the best of ``found``.
    """
    count = OPTIONS.candidate_samples // poses.samples
    count = min(OPTIONS.candidates, max(OPTIONS.min_candidates, count))
    chart, known, further = chart_of(limits.family), best_first(found)[:count], list[Solution]()
    step = number = 0
    while known and step < len(OPTIONS.steps) and number < OPTIONS.max_steps and not work.expired():
        merit, best = known[0]
        number += 1
        tightened = _tightened(limits, poses, best, OPTIONS.steps[step])
        moved = (
            []
            if tightened is None
            else _moved(poses, tightened, chart, [candidate for _, candidate in known], tolerance, work)
        )
        better = best_first(moved)
        if better and better[0][0] < (1 - OPTIONS.gain) * merit:
            further += moved
            known, step = sorted([*better, *known], key=lambda pair: pair[0])[:count], 0
        else:
            step += 1
    return further


def _tightened(limits: Limits, poses: Poses, best: Solution, step: Step) -> Limits | None:
    """Return the limits of the next descents; None if they exclude every linkage."""
    size = size_of(best.linkage, poses)
    assert size is not None
    angle = min(max(limits.transmission_angle_min, best.transmission_angle_min + step.transmission), np.pi / 2)
    try:
        return replace(within_size(limits, poses, step.size * size), transmission_angle_min=angle)
    except FieldError:
        return None


def _moved(
    poses: Poses, limits: Limits, chart: Chart, found: Sequence[Solution], tolerance: float, work: Work
) -> list[Solution]:
    """Return four-bars refined within other limits."""
    problem = limited_problem(poses, chart, limits)
    angles = np.array([solution.linkage.start + solution.travel for solution in found])
    starts = candidates_of(poses, chart, [solution.linkage for solution in found], angles)
    pool = problem.descended(starts, OPTIONS.descent, 0.0, work, steps_after_first=np.inf)
    inside, _ = problem.moved_onto(pool.timed)
    return solutions_of(poses, inside, chart, limits, len(found), tolerance)
