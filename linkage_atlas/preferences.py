"""Linkages that are better by a preferred measure: smaller, with a better transmission angle, a shorter swing or fewer layers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple, Protocol, TypeVar

import numpy as np

from linkage_atlas.assemblies import AskedAssembly, Assembly, assembled, read_assembly
from linkage_atlas.mechanism_search import Found
from linkage_atlas.motions import Motion
from linkage_atlas.pareto import UNRANKED, LayerRank, measures_of, near_enough, span_of, strays_between, target_of
from linkage_atlas.studies import Studies
from linkage_atlas.task import Prefer, Task
from synthesis.errors import FieldError
from synthesis.fourbar.limits import Limits, Reach
from synthesis.free.poses import Poses
from synthesis.search.report import SearchReport
from synthesis.target import MIN_SPAN
from synthesis.work import OutOfTime, Work

UNARRANGED = "The time was up: the layers of {0} of the {1} linkages that are near enough were not examined."
TRY_ROUNDS = 5
"""Maximum number of rounds of each search within a tighter limit, with free crank angles."""
_MAX_TRIES = 6
"""Maximum number of such searches."""
_SMALLEST = 0.5
"""Smallest size of a linkage, in extents of the motion."""
_GOAL = 0.35
"""Fraction of the tolerances at which a search ends: the largest error of a linkage is two to three times its mean."""

F = TypeVar("F", bound=Found)


class Search(Protocol):
    """A search for candidates of one task, for other motions and limits."""

    def __call__(
        self,
        motion: Motion,
        limits: Limits,
        goal: float,
        work: Work,
        rounds: int | None = None,
        max_results: int | None = None,
    ) -> tuple[list[Found], SearchReport]:
        """Return linkages and how the search went; it may end once the objective is below ``goal``."""
        ...


class Measure(NamedTuple):
    """A measure of linkages; smaller is better."""

    value: Callable[[Found], float]
    tightened: Callable[[float], tuple[Motion, Limits]]
    """The motion and limits that allow at most this value."""
    smallest: float
    """Lower bound of the values."""
    resolution: float
    """Difference of two values that count as equal: a fraction if ``smallest`` is positive, otherwise absolute."""

    def equal(self, best: float, other: float) -> bool:
        """Return whether the best value is as good as another value."""
        if self.smallest > 0:
            return best <= other * (1 + self.resolution)
        return best - other <= self.resolution


def tolerance_goal(motion: Motion, tolerance: float) -> float:
    """Return the objective at which a search for linkages inside the tolerances may end."""
    tolerances = motion.tolerances
    return tolerance if tolerances is None else max(tolerance, _GOAL * tolerances.objective(motion.samples))


def improved(
    found: Sequence[Found], smallest: float, task: Task, goal: float, search: Search, work: Work
) -> list[Found]:
    """Return linkages with a small error, of any kind: those that were found, and better ones by the preferred measure.

    The same search within a tighter limit on the measure, half-way to a value that is known to be out of reach, finds better
    linkages or none, and the next limit is tighter or looser. ``smallest``: the smallest objective.
    """
    motion, limits = task.motion, task.limits
    smallest = max(smallest, goal)
    near = near_enough(motion, smallest)
    goal = goal if motion.tolerances is not None else smallest
    stays = _staying(motion, limits)
    if any(map(stays, filter(near, found))):  # a body that strays between samples is not preferred, however small
        good_enough = near

        def near(solution: Found) -> bool:
            return good_enough(solution) and stays(solution)

    measure = measure_of(task.prefer, motion, limits)
    good = list(filter(near, found))
    best, out_of_reach = min(map(measure.value, good), default=np.inf), measure.smallest
    for _ in range(_MAX_TRIES):
        if work.expired() or not np.isfinite(best) or measure.equal(best, out_of_reach):
            break
        middle = np.sqrt(best * out_of_reach) if measure.smallest > 0 else (best + out_of_reach) / 2
        try:
            tightened = measure.tightened(float(middle))
        except FieldError:  # another limit excludes it
            more = []
        else:
            more = list(filter(near, search(*tightened, goal, work, TRY_ROUNDS)[0]))
        if more:
            good += more
            best = min(best, *map(measure.value, more))
        else:
            out_of_reach = float(middle)
    return good


def _staying(motion: Motion, limits: Limits) -> Callable[[Found], bool]:
    """Return a check whether the body stays between samples, which only the practical limits require."""
    samples = motion.samples
    if not limits.practical or not isinstance(samples, Poses) or samples.position is None:
        return lambda _: True
    return lambda solution: not strays_between([solution], samples)[0]


def measure_of(prefer: Prefer, motion: Motion, limits: Limits) -> Measure:
    """Return the measure of a preference."""
    samples = motion.samples

    def smaller(extents: float) -> tuple[Motion, Limits]:
        assert samples.position is not None
        length, reach = extents * samples.extent, limits.pivot_reach
        distances = [
            min(length, distance) if reach and (distance := getattr(reach, name)) else length
            for name in ("pivot_a", "pivot_b")
        ]
        middle = complex(samples.position_mean(samples.position))
        return motion, replace(
            limits,
            link_max=min(length, limits.link_max or np.inf),
            coupler_radius_max=min(length, limits.coupler_radius_max or np.inf),
            pivot_reach=Reach(middle, distances[0], distances[1], None if reach is None else reach.body),
        )

    def straighter(loss: float) -> tuple[Motion, Limits]:
        return motion, replace(limits, transmission_angle_min=-loss)

    def shorter(span: float) -> tuple[Motion, Limits]:
        assert isinstance(samples, Poses)
        spanned = replace(samples, span_max=span)
        return Motion.of(spanned, motion.degrees, motion.tolerances, motion.length_unit), limits

    return {
        "size": Measure(lambda found: measures_of(found, samples, 0.0).size, smaller, _SMALLEST, 0.03),
        "transmission": Measure(lambda found: -found.transmission_angle_min, straighter, -np.pi / 2, np.deg2rad(1.0)),
        "crank_span": Measure(span_of, shorter, MIN_SPAN, 0.03),
    }[prefer]


def arranged(
    found: Sequence[Found], task: Task, smallest: float, work: Work, report: SearchReport
) -> tuple[dict[int, LayerRank], Studies, SearchReport]:
    """Rank the layers of linkages with a small error.

    Returns
    -------
    ranks : dict
        By id of the solution.
    studies : Studies
        With the assemblies that were made.
    report : SearchReport
        With a note if the time was up.
    """
    motion, limits, studies = task.motion, task.limits, task.studies
    assembly = studies.assembly or read_assembly(True)
    assert assembly is not None
    within = assembly.within(limits.envelope, limits.keep_out)
    ranks, made, remaining = layers_of(found, motion, smallest, within, work)
    notes = [UNARRANGED.format(remaining, len(ranks))] if remaining else []
    report = report.ended_by(bool(notes))._replace(notes=[*report.notes, *notes])
    return ranks, studies._replace(assembly=assembly, arranged=made), report


def layers_of(
    found: Sequence[Found], motion: Motion, smallest: float, assembly: AskedAssembly, work: Work
) -> tuple[dict[int, LayerRank], dict[int, Assembly], int]:
    """Compute layers of the linkages with a small error, in their order.

    Returns the rank of all of these by id, the assemblies by id of the `linkage`, and the number of linkages that the time did
    not reach.
    """
    near = list(filter(near_enough(motion, smallest), found))
    ranks: dict[int, LayerRank] = {id(solution): UNRANKED for solution in near}
    made: dict[int, Assembly] = {}
    for k, solution in enumerate(near):
        try:
            work.go_on()
            interval = target_of(solution, motion).interval
            layers = assembled(solution.linkage, assembly, interval, motion.radian, work)
        except OutOfTime:
            return ranks, made, len(near) - k
        except FieldError:
            continue
        made[id(solution.linkage)] = layers
        crossed = sum(not shaft.both_sides for shaft in layers.shaft.values())
        ranks[id(solution)] = not layers.free, crossed, layers.count
    return ranks, made, 0
