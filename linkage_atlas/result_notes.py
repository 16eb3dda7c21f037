"""Notes and report of a result: sentences on the search, the solutions and the limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from linkage_atlas.candidates import Candidates
from linkage_atlas.finishing import RankedSolutions
from linkage_atlas.limits import QUICK, QUICK_ROUNDS, thinned, what_excludes
from linkage_atlas.motions import Motion
from linkage_atlas.notes import counted, in_percent, limit_label, listed, sentences
from linkage_atlas.preferences import Search
from linkage_atlas.results import Report
from linkage_atlas.solutions import Solution, cognate_notes, errors_in_words, in_unit
from linkage_atlas.task import Task
from linkage_atlas.tolerance_study import study_notes
from synthesis import solution as model
from synthesis.atlas.scan import Scan
from synthesis.free.few_poses import FewPosesOptions, exact_four_bars, is_few
from synthesis.guided.search import NOTHING_ROUND
from synthesis.limits import Limits
from synthesis.poses import Poses
from synthesis.ranking import NEAR
from synthesis.search.report import SearchReport
from synthesis.simple_motions import hinge_of
from synthesis.target import TURN
from synthesis.work import Work

NUMERALS = {2: "two", 3: "three", 4: "four"}
PRACTICAL_LIMITS_OFF = (
    "{case} the practical limits apply only if they are switched on (`limits.preset`): "
    "the verdict names the limits that the best linkage violates."
)
HOPELESS = (
    "No linkage that was found comes near this motion: the error of the best is {0:.2g} times that of a body at rest"
)
IN_ANY_ORDER = (
    "The samples go back and forth. In their order the best linkage meets them with {0}; in any order a linkage was found that "
    "meets them with {1} (`order`)."
)
ILL_POSED = (
    "The problem is ill-posed: lengths that differ by {0} make this {1} about equally well "
    "(see `determination` of each solution)."
)
FEW_POSES = (
    "Infinitely many four-bars pass {0} poses exactly: the linkages listed differ clearly from each other, and the first are "
    "compact with a good transmission angle. Add a pose, or limits, to narrow the choice."
)
SINGLE_HINGE = "A single hinge at ({:.9g}, {:.9g}) also takes the body from one pose to the other, without a linkage."
SAME_LENGTHS = "{0} of {1} linkages are listed: the others have the same lengths once rounded, and a larger error."
LOCAL = (
    "Each given linkage was refined to the nearest optimum that its descent reached: linkages elsewhere were not searched and "
    "may be better."
)
NOTHING_FOUND_IN_TIME = (
    "No linkage within the limits was found before the time was up; this does not prove that there is none."
)
NO_DESCENT_WITHIN_LIMITS = (
    "No descent from a given linkage led within the limits; this does not prove that there is no such linkage."
)
TIME_UP = "The time was up: only the best {0} of {1} found are reported."
_HOPELESS = 0.5
"""Ratio to the error of a body at rest above which a linkage is not near the motion."""
_IN_ANY_ORDER = 0.5
"""Largest ratio of the error in any order to the error in the given order for which a note mentions the former."""
_BACK_AND_FORTH = 1.1
"""Smallest ratio of the path through the samples in their order to the shortest path for which they go back and forth."""
_EXACT = 1e-6
"""Objective below which a linkage passes a few poses exactly."""


def notes_of(task: Task, search: Search, candidates: Candidates, ranked: RankedSolutions) -> list[str]:
    """Return the notes of a result as whole sentences."""
    motion, solutions = task.motion, ranked.solutions
    notes = [*motion.notes(), *_envelope_notes(motion, task.limits)]
    if task.refine_only:
        notes.append(LOCAL)
    notes += candidates.report.notes
    if ranked.same_lengths:
        notes.append(SAME_LENGTHS.format(len(solutions), len(solutions) + ranked.same_lengths))
    notes += _determination_notes(task, solutions)
    notes += _hopeless_notes(solutions, motion)
    notes += [] if candidates.report.time_up else _inexact_notes(task, solutions)
    notes += _order_notes(task, solutions, search)
    notes += _unasked_notes(task, solutions)
    notes += study_notes(candidates.studies.manufacture, [solution.tolerance_study for solution in solutions])
    if task.kinds.only_four_bars and motion.samples.rotation is None:
        notes += cognate_notes(solutions)
    if not solutions:
        notes += _empty_notes(task, search, candidates, notes)
    if len(solutions) < ranked.total:
        notes.append(TIME_UP.format(len(solutions), counted(ranked.total, "linkage")))
    return sentences(notes)


def report_of(task: Task, candidates: Candidates, ranked: RankedSolutions, notes: list[str]) -> Report:
    """Return the report of a result."""
    samples = task.motion.samples
    length_scale = None if samples.position is None else samples.length_scale
    report = Report.of(candidates.report, candidates.seconds, task.work.elapsed, notes, length_scale)
    if not task.starts:
        return report
    ranks = {id(solution.origin.found): solution.rank for solution in ranked.solutions}
    return replace(report, start_from_ranks=[ranks.get(id(linkage)) for linkage in candidates.continued])


def _empty_notes(task: Task, search: Search, candidates: Candidates, notes: Sequence[str]) -> list[str]:
    """Return why a result has no solutions: the time, the given linkage, or the limits."""
    if candidates.report.time_up:
        return [NOTHING_FOUND_IN_TIME]
    if task.refine_only:
        return [NO_DESCENT_WITHIN_LIMITS]
    if task.limits.only_family or isinstance(task.source, Scan) or set(notes) & set(NOTHING_ROUND.values()):
        return []

    def quick(eased: Limits, work: Work) -> tuple[list[model.Solution], SearchReport]:
        return search(thinned(task.motion), eased, max(task.tolerance, QUICK), work, QUICK_ROUNDS, 1)

    return what_excludes(task.limits, task.motion, quick, task.work, task.named_limits)


def _determination_notes(task: Task, solutions: Sequence[Solution]) -> list[str]:
    """Return that many different lengths make the motion of the best linkage, if only four-bars were searched."""
    determination = solutions[0].determination if solutions and task.kinds.only_four_bars else None
    if determination is None or not determination.ill_posed:
        return []
    best, samples = solutions[0], task.motion.samples
    exact = best.errors.objective < max(task.tolerance, _EXACT)
    if isinstance(samples, Poses) and is_few(samples) and exact:
        return [FEW_POSES.format(NUMERALS[samples.samples]), *_single_hinge_notes(samples, task.limits)]
    return [ILL_POSED.format(in_percent(determination.length_uncertainty), "motion")]


def _single_hinge_notes(samples: Poses, limits: Limits) -> list[str]:
    """Return the point of a hinge that joins two poses by itself, if the limits allow a pivot there."""
    hinge = hinge_of(samples, min_poses=2) if samples.samples == 2 else None
    if hinge is None:
        return []
    for left, low, right, high in filter(None, (limits.box("pivot_a_box"), limits.box("pivot_b_box"))):
        if not (left <= hinge.centre.real <= right and low <= hinge.centre.imag <= high):
            return []
    digits = 4 - math.floor(math.log10(max(abs(hinge.centre), samples.extent)))
    return [SINGLE_HINGE.format(*(round(value, digits) + 0.0 for value in (hinge.centre.real, hinge.centre.imag)))]


def _hopeless_notes(solutions: Sequence[Solution], motion: Motion) -> list[str]:
    """Return that the best linkage does not make the motion, with the limits that hold it."""
    if not solutions or solutions[0].verdict.within_tolerance:
        return []
    best, at_rest = solutions[0], motion.requested.error_at_rest(modulo_turn=motion.free)
    if not at_rest or (ratio := best.errors.objective / at_rest) <= _HOPELESS:
        return []
    limits = () if best.determination is None else best.determination.active_limits
    held = f"; it is held by {listed([limit_label(name) for name in limits])}" if limits else ""
    return [f"{HOPELESS.format(ratio)}{held}."]


def _inexact_notes(task: Task, solutions: Sequence[Solution]) -> list[str]:
    """Return the limits without which exact four-bars pass a few poses, if the best linkage does not pass them."""
    samples = task.motion.samples
    if (
        not (solutions and isinstance(samples, Poses) and is_few(samples) and task.kinds.only_four_bars)
        or task.refine_only
    ):
        return []
    best = solutions[0]
    if best.errors.objective < max(task.tolerance, _EXACT) or best.verdict.within_tolerance or any(task.limits.links):
        return []

    def exact(eased: Limits, work: Work) -> tuple[list[float], None]:
        return exact_four_bars(samples, eased, work, FewPosesOptions(batches=1, rounds=0)).merit.tolist(), None

    return what_excludes(task.limits, task.motion, exact, task.work, task.named_limits, "exact four-bar")


def _order_notes(task: Task, solutions: Sequence[Solution], search: Search) -> list[str]:
    """Return the errors of a linkage that passes jumbled samples in any order, if they are much smaller."""
    motion, samples = task.motion, task.motion.samples
    if not (solutions and isinstance(samples, Poses) and samples.ordered):
        return []
    if samples.closed or motion.travel is not None:
        return []
    best = solutions[0]
    if best.verdict.within_tolerance or best.errors.objective <= NEAR or samples.detour < _BACK_AND_FORTH:
        return []
    any_order = Motion.of(replace(samples, ordered=False, span_max=TURN), motion.degrees, motion.tolerances)
    found, _ = search(any_order, task.limits, task.tolerance, task.work, None, 1)
    if not found:
        return []
    nearest = min(found, key=lambda solution: solution.errors.objective)
    if nearest.errors.objective > _IN_ANY_ORDER * best.errors.objective:
        return []
    errors = in_unit(nearest.errors, motion.radian)
    return [IN_ANY_ORDER.format(*(errors_in_words(pair, motion.degrees) for pair in (best.errors, errors)))]


def _unasked_notes(task: Task, solutions: Sequence[Solution]) -> list[str]:
    """Return that the practical limits did not apply, if the request did not choose and the best linkage violates a limit."""
    motion = task.motion
    if (motion.free and motion.travel is None) or "preset" in task.named_limits:
        return []
    if not solutions or solutions[0].verdict.practical:
        return []
    return [PRACTICAL_LIMITS_OFF.format(case=f"With given {'crank angles' if motion.travel is None else 'travel'}")]


def _envelope_notes(motion: Motion, limits: Limits) -> list[str]:
    """Return that positions lie outside the box that the body point must not leave."""
    box, samples = limits.envelope, motion.requested
    if box is None or samples.position is None:
        return []
    weights = samples.position_weights
    used = np.isfinite(samples.position) & (True if weights is None else weights > 0)
    x, y = samples.position.real, samples.position.imag
    beyond = np.hypot(
        np.maximum(np.maximum(box[0] - x, x - box[2]), 0), np.maximum(np.maximum(box[1] - y, y - box[3]), 0)
    )
    outside = np.flatnonzero(used & (beyond > 0))
    if not outside.size:
        return []
    worst = int(outside[np.argmax(beyond[outside])])
    missed = f"missed by at least {beyond[worst]:.4g} (`limits.envelope`)"
    if outside.size == 1:
        return [f"The position of sample {worst + 1} lies outside the envelope and is {missed}."]
    return [f"{outside.size} positions lie outside the envelope; sample {worst + 1} is {missed}."]
