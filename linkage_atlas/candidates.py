"""Candidates of a task: the search, linkages of fair size, the preferred measure, and results of given linkages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from linkage_atlas.mechanism_search import Found, KindSearch, drive_of
from linkage_atlas.mechanism_types import as_poses
from linkage_atlas.motions import Motion
from linkage_atlas.preferences import accuracy_goal, arranged, balanced, improved
from linkage_atlas.ranking import Ranking, group_of
from linkage_atlas.studies import Studies
from linkage_atlas.task import Task, seed_tables
from linkage_atlas.warm_start import FOR_STARTS, Start
from synthesis.atlas.scan import Scan
from synthesis.four_bar import Family, wrap
from synthesis.free.few_poses import Obstacles, is_few
from synthesis.free.search import search_free
from synthesis.guided.local_refinement import refine_guided
from synthesis.limits import Limits
from synthesis.linkages import body_motions
from synthesis.local_refinement import nearby_motion, nearby_poses, refine_motion, refine_poses
from synthesis.poses import Poses
from synthesis.ranking import PROPORTION, Status, distinct
from synthesis.scores import proportion, size_of
from synthesis.search.atlas_rows import best_rows
from synthesis.search.multistart import search_nested
from synthesis.search.report import SearchReport, StoppedBy
from synthesis.search.search import search
from synthesis.search.seeds import SeedTables
from synthesis.solution import Solution, assess, target_of
from synthesis.violations import within
from synthesis.work import Work

OUT_OF_PROPORTION = (
    "The linkage with the smallest error (objective {error:.2g}) is out of all proportion: its largest part is {times:.2g} "
    "times the extent of the motion or the shortest link. "
    "Linkages up to {fair:g} times as large are ranked before it; to rank by error only, "
    "switch the practical limits off (`limits.preset`: 'none')."
)
FIRST_OUT_OF_PROPORTION = (
    "The {which} linkage is out of all proportion: its largest part is {times:.2g} times the extent of the motion or the "
    "shortest link. "
)
FAIR_FOUND = "The best linkage of fair size has the objective {:.2g}."
NO_FAIR_FOUND = "No linkage of fair size was found."
_ONLY_SHIFTED = 1e-9
"""Largest rotation in radians of a body that is only shifted."""
_LAYERED, _MIN_LAYERED = 3, 20
"""Linkages whose layers are compared: a multiple of the number of results, and a minimum."""
_FOR_LAYERS = 0.3
"""Fraction of the budget for the comparison of layers."""
_MIN_ROUNDED = 5
"""Minimum number of linkages that are rounded: the best linkage with rounded lengths is often not the nearest linkage."""
_POOL = 20
"""Number of additional linkages among which those in proportion are chosen."""
_BALANCED_POOL = 40
"""Minimum number of linkages for the choice of balanced linkages, so that the first one depends little on `top`."""
_VARIETY = 6
"""Multiple of the number of results among which diverse solutions are chosen."""


class Candidates(NamedTuple):
    """Linkages that were found, in the order of the preference."""

    found: Sequence[Solution]
    report: SearchReport
    studies: Studies
    """The studies of the task, with the assemblies that were made to compare layers."""
    ranking: Ranking
    seconds: float
    """Time since the task began."""
    continued: Sequence[Solution | None] = ()
    """The result of each linkage of `start_from`; None if there is none within the limits."""


@dataclass(frozen=True)
class CandidateSearch:
    """The search of a task, for any motion and limits."""

    task: Task

    @property
    def pool_size(self) -> int:
        """Number of linkages from which the results are chosen."""
        task = self.task
        if not task.kinds.only_four_bars:
            return task.top
        if task.refine_only:
            return min(task.top, len(task.starts))
        size = _VARIETY * task.top if task.diverse else task.top
        size = max(size, _MIN_ROUNDED) if task.rounds else size
        return max(size, _LAYERED * task.top, _MIN_LAYERED) if task.prefer == "layers" else size

    def __call__(
        self,
        motion: Motion,
        limits: Limits,
        goal: float,
        work: Work,
        rounds: int | None = None,
        max_results: int | None = None,
    ) -> Found:
        """Return linkages and how the search went; it may end once the objective is below ``goal``."""
        task = self.task
        if task.refine_only:
            results, report = _refine_all(task, motion, limits, goal, work)
            return [solution for solution in results if solution is not None], report
        if task.kinds.only_four_bars:
            size = self.pool_size if max_results is None else max_results
            four_bars, report = search_four_bars(task.source, motion, limits, size, goal, work, rounds)
            return list(four_bars), report

        def beside_sliders(limits: Limits, work: Work, rounds: int | None) -> Found:
            def within(limits: Limits) -> Found:
                return search_four_bars(seed_tables(), motion, limits, task.top, goal, work, rounds)

            is_request = motion is task.motion and limits is task.limits and rounds is None
            return _search_nested(within, task, ranking_of(task)) if is_request else within(limits)

        return KindSearch(task.kinds, motion, limits, goal, beside_sliders, work, rounds, task.soon).run()


def find_candidates(task: Task, search: CandidateSearch) -> Candidates:
    """Search the linkages of a task and improve them by the preferred measure."""
    ranking = ranking_of(task)
    if task.refine_only:  # each linkage keeps fair proportions if it has them
        results, report = _refine_all(task, task.motion, task.limits, task.tolerance, task.search_work())
        found, continued = _with_continued([], results, ranking, search.pool_size)
        return Candidates(found, report, task.studies, ranking, task.work.elapsed, continued)
    if task.kinds.only_four_bars:
        return _best_four_bars(task, search, ranking)
    return _best_of_kinds(task, search, ranking)


def ranking_of(task: Task) -> Ranking:
    """Return the order of the linkages of a task."""
    return Ranking(task.motion, task.prefer, task.tolerance, task.fair)


def _best_four_bars(task: Task, search: CandidateSearch, ranking: Ranking) -> Candidates:
    work, size, source = task.search_work(), search.pool_size, task.source
    goal = task.tolerance
    if task.motion.tolerances is not None and not task.by_error:
        goal = accuracy_goal(task.motion, task.tolerance, 0.0)
    first_work = task.search_work(_FOR_LAYERS if task.prefer == "layers" else 0.0)
    continued: list[Solution | None] = [_continued(task, start, goal) for start in task.starts]
    pool = size + _POOL if task.fair else size
    pool = max(pool, _BALANCED_POOL) if task.prefer == "balanced" else pool

    def within(limits: Limits) -> Found:
        return search_four_bars(source, task.motion, limits, pool, goal, first_work, obstacles=task.obstacles)

    four_bars, report = _search_nested(within, task, ranking)
    if isinstance(source, SeedTables):
        four_bars = [_drawn_near(solution, task.motion, task.limits) for solution in four_bars]
    found, studies, report = _preferred(list(four_bars), task, search, ranking, work, report)
    if isinstance(source, Scan):
        found = ranking.ordered(found)
    elif task.diverse:
        found = ranking.diverse(found, task.top, accuracy_goal(task.motion, goal, 0.0))
    else:
        found = ranking.chosen(found, task.top if task.prefer == "layers" else size)
    if continued:
        found, continued = _with_continued(found, continued, ranking, size)
    return Candidates(found, report, studies, ranking, task.work.elapsed, continued)


def _preferred(
    found: list[Solution], task: Task, search: CandidateSearch, ranking: Ranking, work: Work, report: SearchReport
) -> tuple[list[Solution], Studies, SearchReport]:
    """Add linkages that are better by the preference, or make their layers."""
    if not found or task.by_error:
        return found, task.studies, report
    if task.prefer == "layers":
        studies, report = arranged(found, task, ranking, work, report)
        return found, studies, report
    better = balanced if task.prefer == "balanced" else improved
    found = found + better(found, task, ranking, search, work)
    return found, task.studies, report.ended_by(work.expired())


def _continued(task: Task, start: Start, goal: float) -> Solution | None:
    """Continue a given linkage in its fraction of the time; return None if that leads to no linkage within the limits.

    If balanced linkages are preferred it moves no farther than needed, since the nearest optimum may be far less compact;
    through few poses it moves until it is exact, as the linkages of the search are.
    """
    work = task.search_work()
    part = work.part(FOR_STARTS * work.budget)
    found: list[Solution] = []
    if task.prefer == "balanced" and start.linkage.is_four_bar:
        few = isinstance(task.motion.samples, Poses) and is_few(task.motion.samples)
        accuracy = goal if few else accuracy_goal(task.motion, task.tolerance, 0.0)
        found = move_start(start, task.motion, task.limits, accuracy, part)
    if not found:
        found, _ = refine_start(start, task.motion, task.limits, goal, part)
    return found[0] if found else None


def _refine_all(
    task: Task, motion: Motion, limits: Limits, goal: float, work: Work
) -> tuple[list[Solution | None], SearchReport]:
    """Refine the linkages of `start_from` in turn; return their results, and how it went."""
    results: list[Solution | None] = []
    reports: list[SearchReport] = []
    fair = task.fair if limits is task.limits else None
    for start in task.starts:
        refine = partial(refine_start, start, motion, tolerance=goal, work=work)
        if fair and start.linkage.is_four_bar and proportion(start.linkage, motion.samples) <= fair:
            found, report = _search_nested(refine, replace(task, narrower=task.narrower[-1:]), ranking_of(task))
        else:
            found, report = refine(limits)
        results.append(found[0] if found else None)
        reports.append(report)
    return results, SearchReport.joined(reports)


def _with_continued(
    found: Sequence[Solution], continued: Sequence[Solution | None], ranking: Ranking, top: int
) -> tuple[list[Solution], list[Solution | None]]:
    """Return at most ``top`` linkages including ``continued``, and ``continued`` after merging.

    A linkage that was both found and continued is there once, with the smaller of its errors.
    """
    merged, held = list(found), list(continued)
    for k, solution in enumerate(held):
        if solution is None:
            continue
        group = group_of(solution)
        alike = [candidate for candidate in merged if group_of(candidate) == group]
        twin = next((candidate for candidate in alike if len(distinct([candidate, solution], 2)) == 1), None)
        if twin is not None:
            if twin.errors.objective <= solution.errors.objective:
                held[k] = twin
                continue
            merged = [candidate for candidate in merged if candidate is not twin]
            held = [solution if candidate is twin else candidate for candidate in held]
        merged.append(solution)
    merged = ranking.ordered(merged)
    searched = [candidate for candidate in merged if all(candidate is not solution for solution in held)]
    dropped = searched[max(0, len(searched) - max(0, len(merged) - top)) :]
    return [solution for solution in merged if all(solution is not candidate for candidate in dropped)], held


def _best_of_kinds(task: Task, search: CandidateSearch, ranking: Ranking) -> Candidates:
    """Find the best linkages of several kinds, or of other kinds than four-bars."""
    work, layered = task.search_work(), task.prefer == "layers"
    first_work = task.search_work(_FOR_LAYERS if layered else 0.0)
    continued: list[Solution | None] = [_continued(task, start, task.tolerance) for start in task.starts]
    found, report = search(task.motion, task.limits, task.tolerance, first_work)
    found = [*found, *(solution for solution in continued if solution is not None)]
    if layered:
        found = ranking.chosen_of_kinds(found, max(_LAYERED * task.top, _MIN_LAYERED))
    found, studies, report = _preferred(found, task, search, ranking, work, report)
    chosen = ranking.chosen_of_kinds(found, task.top)
    if continued:
        chosen, continued = _with_continued(chosen, continued, ranking, task.top)
    return Candidates(chosen, report, studies, ranking, task.work.elapsed, continued)


# -- four-bars --------------------------------------------------------------------------------------------------------


def search_four_bars(
    source: SeedTables | Scan,
    motion: Motion,
    limits: Limits,
    max_results: int,
    tolerance: float,
    work: Work,
    rounds: int | None = None,
    obstacles: Obstacles | None = None,
) -> Found:
    """Find the best four-bars: in an atlas, or by the search with free or given crank angles."""
    if isinstance(source, Scan):
        return _search_atlas(source, motion, limits, max_results, tolerance, work)
    if isinstance(motion.samples, Poses):
        return search_free(motion.samples, limits, max_results, tolerance, work, rounds, obstacles)
    return search(source, motion.samples, limits, max_results, tolerance, work)


def refine_start(start: Start, motion: Motion, limits: Limits, tolerance: float, work: Work) -> Found:
    """Refine a given linkage to its nearest optimum; there is none if no descent leads within the limits."""
    samples = motion.samples
    if not start.linkage.is_four_bar:
        drive, _ = drive_of(motion, None)
        return refine_guided(as_poses(samples), limits, start.linkage, tolerance, work, drive)
    if isinstance(samples, Poses):
        return refine_poses(samples, limits, start.linkage, start.crank, tolerance, work)
    return refine_motion(samples, limits, start.linkage, tolerance, work)


def move_start(start: Start, motion: Motion, limits: Limits, goal: float, work: Work) -> list[Solution]:
    """Move a given four-bar no farther than needed; the objective need not fall below ``goal``."""
    samples = motion.samples
    if isinstance(samples, Poses):
        return nearby_poses(samples, limits, start.linkage, start.crank, goal, work)
    return nearby_motion(samples, limits, start.linkage, goal, work)


def _search_atlas(
    scan: Scan, motion: Motion, limits: Limits, max_results: int, tolerance: float, work: Work
) -> Found:
    """Find the best rows of an atlas."""
    found, scanned = best_rows(scan, motion.target, limits, max_results, work, tolerance)
    seconds = work.elapsed
    trace = [(seconds, found[0].errors.objective)] if found else []
    ended = StoppedBy.CONVERGED if scanned.exhaustive else StoppedBy.BUDGET
    reason = StoppedBy.TOLERANCE if Status.of(found, tolerance) is Status.REACHED else ended
    return found, SearchReport(reason, trace, seconds, windows=scanned.windows, exhaustive=scanned.exhaustive)


def _drawn_near(solution: Solution, motion: Motion, limits: Limits) -> Solution:
    """Move a linkage near the motion if its body is only shifted, as a parallelogram's: any point of it has the same path.

    Returns the solution itself if the moved linkage violates a limit or is not smaller.
    """
    samples, linkage = motion.samples, solution.linkage
    if samples.position is None or linkage.family is not Family.CHANGE_POINT:
        return solution
    target = target_of(samples, linkage, solution.travel)
    angle = body_motions([linkage], target.crank).rotation[0] - (linkage.body_offset or 0.0)
    if not np.ptp(angle) <= _ONLY_SHIFTED:
        return solution
    # short vectors: crank pin to body point, and each pivot to the middle of the motion
    coupler = np.exp(1j * angle[0])
    vectors = linkage.arm * coupler, samples.middle - linkage.pivot_a, samples.middle - linkage.pivot_b
    shift = complex(np.mean(vectors))
    arm = (vectors[0] - shift) / coupler
    point = float(abs(arm)), wrap(float(np.angle(arm)))
    nearby = assess(target, [replace(linkage, pivot_a=linkage.pivot_a + shift, coupler_point_polar=point)])
    for moved in within(target, limits, nearby):
        smaller = (size_of(moved.linkage, samples) or 0.0) < (size_of(linkage, samples) or 0.0)
        if smaller and abs(moved.errors.objective - solution.errors.objective) <= _ONLY_SHIFTED:
            return moved
    return solution


def _search_nested(search: Callable[[Limits], Found], task: Task, ranking: Ranking) -> Found:
    """Search within the limits of a task; if the smallest error belongs to an unwanted linkage, narrower limits too.

    Unwanted is what cannot be used or is out of all proportion; a note explains the latter.
    """
    fair = np.inf if task.fair is None else task.fair

    def smallest_fair(found: Sequence[Solution]) -> float:
        return min((score.error for score in ranking.scores(found) if score.proportion <= fair), default=np.inf)

    def suffice(found: Sequence[Solution]) -> bool:
        best = ranking.smallest_score(found)
        in_proportion = task.fair is None or best.proportion <= PROPORTION
        return best.usable and (in_proportion or (best.error == 0 and smallest_fair(found) < np.inf))

    found, report = search_nested(search, task.limits, task.narrower, suffice)
    if task.fair is None or not found:
        return found, report
    ordered, note = ranking.ordered(found), ""
    best, first, smallest = ranking.smallest_score(found), ranking.smallest_score(ordered[:1]), smallest_fair(found)
    if best.error > 0 and best.proportion > PROPORTION >= first.proportion:
        note = OUT_OF_PROPORTION.format(error=best.error, times=best.proportion, fair=fair)
    elif first.proportion > PROPORTION and smallest > 0:
        which = "best" if best.error > 0 else "exact"
        note = FIRST_OUT_OF_PROPORTION.format(which=which, times=best.proportion)
        note += FAIR_FOUND.format(smallest) if smallest < np.inf else NO_FAIR_FOUND
    return ordered, report._replace(notes=[*report.notes, note] if note else report.notes)
