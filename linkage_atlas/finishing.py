"""Candidates as solutions in the user's units, with their verdicts and studies, in the order in which they are shown."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from linkage_atlas.answers import FINISHING, AnySolution, by_rounded, finished, finished_guided, merit, status_of
from linkage_atlas.candidates import Candidates
from linkage_atlas.task import Task
from synthesis.fourbar import solution as fourbar
from synthesis.guided import solution as guided


class RankedSolutions(NamedTuple):
    """Solutions, best first."""

    status: str
    solutions: list[AnySolution]
    total: int
    """Number of candidates for these solutions; larger than the number of solutions if the time was up."""
    same_lengths: int
    """Number of solutions left out because their rounded lengths are those of another solution."""


def finish_candidates(task: Task, candidates: Candidates) -> list[AnySolution]:
    """Describe the candidates as solutions, as many as the time allows and at least one."""
    found, studies, work = candidates.found, candidates.studies, task.work.extended(FINISHING)
    four_bars = [solution for solution in found if isinstance(solution, fourbar.Solution)]
    if task.kinds.only_four_bars:
        type_of = None if task.atlas is None else task.atlas.type_of
        solutions = finished(
            four_bars, task.motion, task.limits, task.tolerance, studies, type_of, work, task.by_error
        )
        return list(solutions)
    others = [solution for solution in found if isinstance(solution, guided.GuidedSolution)]
    finished_so_far: list[AnySolution] = []
    for guides in dict.fromkeys(isinstance(solution, guided.GuidedSolution) for solution in found):
        if finished_so_far and work.expired():
            break
        if guides:  # the group of the best candidate comes first
            finished_so_far += finished_guided(others, task.motion, task.limits, studies, work)
        else:
            finished_so_far += finished(
                four_bars, task.motion, task.limits, task.tolerance, studies, None, work, by_error=False
            )
    order = {id(solution): number for number, solution in enumerate(found)}
    finished_so_far.sort(key=lambda solution: (*merit(solution), order[id(solution.origin.found)]))
    return [replace(solution, rank=number) for number, solution in enumerate(finished_so_far, 1)]


def rank_solutions(task: Task, candidates: Candidates, solutions: list[AnySolution]) -> RankedSolutions:
    """Rank solutions, those with rounded lengths by the error that remains, and name their status."""
    uncertain = candidates.report.time_up or task.local
    status = status_of(solutions, task.tolerance, task.motion.tolerances is not None, uncertain)
    if not task.rounds:
        return RankedSolutions(status, solutions, len(candidates.found), 0)
    ranked = by_rounded(solutions, task.top, task.fair is not None)
    same_lengths = min(len(solutions), task.top) - len(ranked)
    total = min(len(candidates.found), task.top) - same_lengths
    return RankedSolutions(status, ranked, total, same_lengths)
