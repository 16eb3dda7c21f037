"""Candidates as solutions in the user's units, with their verdicts and studies, in the order in which they are shown."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from linkage_atlas.candidates import Candidates
from linkage_atlas.results import status_of
from linkage_atlas.solutions import FINISHING, Solution, finished
from linkage_atlas.task import Task
from synthesis.ranking import CRITERIA, FAIR_PROPORTION, key

_CRITERIA = len(CRITERIA)


class RankedSolutions(NamedTuple):
    """Solutions, best first."""

    status: str
    solutions: list[Solution]
    total: int
    """Number of candidates for these solutions; larger than the number of solutions if the time was up."""
    same_lengths: int
    """Number of solutions left out because their rounded lengths equal the lengths of another solution."""


def finish_candidates(task: Task, candidates: Candidates) -> list[Solution]:
    """Describe the candidates as solutions: the best in any case, then those with the smallest error, the others in time."""
    found, studies, work = candidates.found, candidates.studies, task.work.extended(FINISHING)
    leaders = [*found[:1], *candidates.ranking.leaders(found)]
    ordered = sorted(found, key=lambda solution: all(solution is not leader for leader in leaders))
    type_of = None if task.atlas is None else task.atlas.type_of
    return finished(ordered, task.motion, task.limits, task.tolerance, studies, type_of, work)


def rank_solutions(task: Task, candidates: Candidates, solutions: list[Solution]) -> RankedSolutions:
    """Rank solutions by their present scores, name their status, and mark the solution with the smallest error."""
    uncertain = candidates.report.time_up or task.refine_only
    status = status_of(solutions, task.tolerance, task.motion.tolerances is not None, uncertain)
    ranked = [solution for _, solution in _with_keys(task, candidates, solutions)]
    shown = _without_equal_roundings(ranked)[: task.top] if task.rounds else ranked
    same_lengths = min(len(solutions), task.top) - len(shown) if task.rounds else 0
    total = min(len(candidates.found), task.top) - same_lengths if task.rounds else len(candidates.found)
    found = [solution.origin.found for solution in shown]
    smallest, usable = candidates.ranking.marked(found), candidates.ranking.usable(found)
    return RankedSolutions(
        status,
        [
            replace(
                solution,
                rank=number,
                has_smallest_error=solution.origin.found is smallest,
                verdict=replace(solution.verdict, works=works),
            )
            for number, (solution, works) in enumerate(zip(shown, usable), 1)
        ],
        total,
        same_lengths,
    )


def _with_keys(
    task: Task, candidates: Candidates, solutions: list[Solution]
) -> list[tuple[tuple[Any, ...], Solution]]:
    """Return solutions with their sort keys, best first: the scores of the search with layers, drives and rounded errors."""
    order = {id(found): number for number, found in enumerate(candidates.found)}
    scores = candidates.ranking.scores([solution.origin.found for solution in solutions])
    keyed = []
    for score, solution in zip(scores, solutions):
        layers = solution.verdict.assembly
        if layers is not None:
            score = replace(score, layers=(not layers.free, *score.layers[1:]))
        score = replace(score, has_drive=solution.has_drive is not False)
        own = key(score, task.prefer)
        if task.rounds:
            rounded = key(replace(score, error=_rounded_error(solution)), task.prefer)
            # rounding has little effect on large linkages
            large = task.fair is not None and score.proportion > FAIR_PROPORTION
            own = (*rounded[:_CRITERIA], large, *rounded[_CRITERIA:-1], *own[-2:])
        keyed.append(((*own, order[id(solution.origin.found)]), solution))
    return sorted(keyed, key=lambda pair: pair[0])


def _rounded_error(solution: Solution) -> float:
    """Return the error with rounded lengths to four digits; infinite if the rounded linkage does not close."""
    rounded = solution.rounded
    if rounded is None or rounded.errors is None:
        return np.inf
    return float(f"{rounded.errors.objective:.4g}")


def _without_equal_roundings(solutions: list[Solution]) -> list[Solution]:
    """Return the first of the solutions that become the same linkage by rounding."""
    first: dict[Any, Solution] = {}
    for solution in solutions:
        first.setdefault(_rounded_linkage(solution), solution)
    return list(first.values())


def _rounded_linkage(solution: Solution) -> Any:
    """Return a key that is equal for solutions that become the same linkage by rounding."""
    rounded = solution.rounded
    if rounded is None or not rounded.closes:
        return id(solution)
    lengths = tuple((rounded.lengths or {}).items())
    error = None if solution.links else _rounded_error(solution)
    return solution.kind, solution.driver, rounded.branch, lengths, error
