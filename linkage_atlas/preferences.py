"""Linkages that are better by a preferred measure: smaller, with a better transmission angle, a shorter swing or fewer layers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from linkage_atlas.assemblies import Assembly, assembled, read_assembly
from linkage_atlas.mechanism_search import Found
from linkage_atlas.motions import Motion
from linkage_atlas.ranking import UNRANKED, LayerRank, Ranking, everyday_tolerances
from linkage_atlas.studies import Studies
from linkage_atlas.task import Prefer, Task
from synthesis.errors import FieldError
from synthesis.free.compact import compacted, within_size
from synthesis.free.few_poses import is_few
from synthesis.limits import Limits
from synthesis.poses import Poses
from synthesis.scores import relative_size, swing_of
from synthesis.search.report import SearchReport
from synthesis.solution import Solution, target_of
from synthesis.target import MIN_SPAN
from synthesis.work import OutOfTime, Work

UNARRANGED = "The time was up: the layers of {0} of the {1} sufficiently accurate linkages were not examined."
TRY_ROUNDS = 5
"""Maximum number of rounds of each search within a tighter limit, with free crank angles."""
_MAX_TRIES = 6
"""Maximum number of such searches."""
_SMALLEST = 0.5
"""Smallest size of a linkage, in extents of the motion."""
_COMPACT = 2.2
"""Size of the linkages of the search for compact linkages, in extents of the motion."""
_COMPACT_ROUNDS = 2
"""Maximum number of rounds of that search."""
_GOAL = 0.35
"""Fraction of the tolerances at which a search ends: the largest error of a linkage is two to three times its mean."""


Search = Callable[..., Found]
"""A search for candidates of a task within another motion and limits: `linkage_atlas.candidates.CandidateSearch`."""


class Measure(NamedTuple):
    """A measure of linkages; smaller is better."""

    value: Callable[[Solution], float]
    tightened: Callable[[float], tuple[Motion, Limits]]
    """The motion and limits that allow at most this value."""
    smallest: float
    """Lower bound of the values."""
    resolution: float
    """Difference of two values that count as equal: a fraction if ``smallest`` is positive, otherwise absolute."""

    def equal(self, best: float, value: float) -> bool:
        """Return whether the best value is as good as another value."""
        if self.smallest > 0:
            return best <= value * (1 + self.resolution)
        return best - value <= self.resolution


def accuracy_goal(motion: Motion, tolerance: float, smallest: float) -> float:
    """Return the objective at which a search for accurate linkages may end; ``smallest``: the smallest known value."""
    tolerances = motion.tolerances
    if tolerances is None:
        return max(tolerance, smallest, _GOAL * everyday_tolerances(motion).objective(motion.samples))
    return max(tolerance, _GOAL * tolerances.objective(motion.samples))


def improved(found: Sequence[Solution], task: Task, ranking: Ranking, search: Search, work: Work) -> list[Solution]:
    """Return further accurate linkages with a better value of the preferred measure.

    The same search within a tighter limit on the measure, half-way to a value that is known to be out of reach, finds better
    linkages or none, and the next limit is tighter or looser.
    """
    smallest = min((solution.errors.objective for solution in found), default=np.inf)
    goal = accuracy_goal(task.motion, task.tolerance, smallest)
    measure = measure_of(task.prefer, task.motion, task.limits)
    further: list[Solution] = []
    best = min((measure.value(solution) for solution in ranking.accurate(found)), default=np.inf)
    out_of_reach = measure.smallest
    for _ in range(_MAX_TRIES):
        if work.expired() or not np.isfinite(best) or measure.equal(best, out_of_reach):
            break
        middle = np.sqrt(best * out_of_reach) if measure.smallest > 0 else (best + out_of_reach) / 2
        try:
            tightened = measure.tightened(float(middle))
        except FieldError:  # another limit excludes it
            more = []
        else:
            moved = search(*tightened, goal, work, TRY_ROUNDS)[0]
            more = [solution for _, solution in ranking.merits(moved, found)]
        if more:
            further += more
            best = min(best, *map(measure.value, more))
        else:
            out_of_reach = float(middle)
    return further


def measure_of(prefer: Prefer, motion: Motion, limits: Limits) -> Measure:
    """Return the measure of a preference."""
    samples = motion.samples

    def smaller(extents: float) -> tuple[Motion, Limits]:
        return motion, within_size(limits, samples, extents)

    def straighter(loss: float) -> tuple[Motion, Limits]:
        return motion, replace(limits, transmission_angle_min=-loss)

    def shorter(span: float) -> tuple[Motion, Limits]:
        assert isinstance(samples, Poses)
        spanned = replace(samples, span_max=span)
        return Motion.of(spanned, motion.degrees, motion.tolerances, motion.length_unit), limits

    return {
        "size": Measure(lambda found: relative_size(found, samples), smaller, _SMALLEST, 0.03),
        "transmission": Measure(lambda found: -found.transmission_angle_min, straighter, -np.pi / 2, np.deg2rad(1.0)),
        "crank_span": Measure(swing_of, shorter, MIN_SPAN, 0.03),
    }[prefer]


def balanced(found: Sequence[Solution], task: Task, ranking: Ranking, search: Search, work: Work) -> list[Solution]:
    """Return further four-bars with a smaller merit: by a short search for compact linkages, and by `compacted`."""
    motion, samples = task.motion, task.motion.samples
    if not (isinstance(samples, Poses) and samples.requested is None and samples.position is not None):
        return []
    smallest = ranking.smallest_error(found)
    if smallest is None:
        return []
    if (task.soon or is_few(samples)) and smallest.errors.objective < task.tolerance:
        return []  # exact four-bars through few poses are already sought by their merit
    further: list[Solution] = []
    sizes = [score.size for score in ranking.scores(ranking.accurate(found))]
    goal = accuracy_goal(motion, task.tolerance, smallest.errors.objective)
    if smallest.errors.objective < goal and min(sizes) > _COMPACT and not work.expired():
        try:
            compact = within_size(task.limits, samples, _COMPACT)
        except FieldError:  # another limit excludes it
            pass
        else:
            further += search(motion, compact, goal, work, _COMPACT_ROUNDS)[0]
    four_bars = [solution for solution in [*found, *further] if solution.linkage.is_four_bar]
    merits = partial(ranking.merits, beside=found)
    return [*further, *compacted(samples, task.limits, four_bars, merits, task.tolerance, work)]


def arranged(
    found: Sequence[Solution], task: Task, ranking: Ranking, work: Work, report: SearchReport
) -> tuple[Studies, SearchReport]:
    """Make the layers of the accurate linkages, by which they are ranked then.

    Returns the studies with the assemblies that were made, and the report with a note if the time was up.
    """
    assembly = task.studies.assembly or read_assembly(True)
    within, motion = assembly.within(task.limits.envelope, task.limits.keep_out), task.motion
    accurate = ranking.accurate(ranking.ordered(found))
    ranks: dict[int, LayerRank] = {id(solution): UNRANKED for solution in accurate}
    assemblies: dict[int, Assembly] = {}
    for k, solution in enumerate(accurate):
        try:
            work.go_on()
            interval = target_of(motion.samples, solution.linkage, solution.travel).interval
            layers = assembled(solution.linkage, within, interval, motion.radian, work)
        except OutOfTime:
            note = UNARRANGED.format(len(accurate) - k, len(accurate))
            report = report.ended_by(True)._replace(notes=[*report.notes, note])
            break
        except FieldError:
            continue
        assemblies[id(solution.linkage)] = layers
        crossed = sum(not shaft.both_sides for shaft in layers.pivot_supports.values())
        ranks[id(solution)] = not layers.free, crossed, layers.count
    ranking.layers = ranks
    return task.studies._replace(assembly=assembly, arranged=assemblies), report
