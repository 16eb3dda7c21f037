"""Notes with the answers to functions: jumps, proportions, freedom that is left."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linkage_atlas.functions.question import FunctionQuestion
from linkage_atlas.functions.results import AnyFunctionSolution, FunctionSolution
from linkage_atlas.functions.special import CRANK_ROCKERS, NO_CRANK_ROCKER, SLIDER_CRANKS, TOO_QUICK, QuickReturn
from linkage_atlas.motions import unit_notes
from linkage_atlas.notes import in_percent
from linkage_atlas.result_notes import ILL_POSED, LOCAL, NUMERALS
from synthesis.function.answers import Generator
from synthesis.function.laws import ANGLE
from synthesis.function.quick_return import (
    all_slider_cranks,
    crank_rocker_transmission,
    exact_crank_rockers,
    slider_crank_transmission,
)
from synthesis.function.target_function import TargetFunction
from synthesis.ranking import PROPORTION

_STEEP = 8.0
"""Ratio of the slope of a step to the slope of any other step from which on it is called a jump."""
OUT_OF_PROPORTION = (
    "The linkage with the smallest error (objective {error:.2g}) is out of all proportion: its longest link is {ratio:.2g} "
    "times the shortest. Linkages with a ratio of at most 100 come before it."
)
FIRST_OUT_OF_PROPORTION = (
    "The {which} linkage is out of all proportion: its longest link is {ratio:.2g} times the shortest. "
)
FOUND_WITHIN = (
    "The best linkage with a ratio of at most 100 has the objective {:.2g}.",
    "No linkage with a ratio of at most 100 was found.",
)
"""Endings of the sentence with such a linkage, and without."""
STILL_BETTER = "The error was still falling slightly when the search had used all its steps."
DOUBTFUL = (
    "Between the samples the requested curve is a spline that is uncertain by up to {0:.2g}: more samples would make the largest "
    "error more meaningful."
)
FEW_PAIRS = (
    "Infinitely many linkages pass through {} pairs: the first of these transmit well and are compact. A further pair, or "
    "limits, narrow the choice."
)
SEVERAL_KINDS = "Linkages of several kinds are ordered by error only; they differ in transmission angle and size."


def function_notes(
    question: FunctionQuestion,
    found: Sequence[Generator],
    solutions: Sequence[AnyFunctionSolution],
    settled: bool,
    refine_only: bool,
) -> list[str]:
    """Return the notes on a result. ``found``: all candidates, the first of which became solutions."""
    target, radian, quick, dial = question.function, question.radian, question.quick, question.dial
    notes = [*question.notes]
    if not dial.travels:
        notes += unit_notes("crank", target.crank[[0, -1]] / radian, question.degrees)
        notes += [] if question.dials else unit_notes("output", target.output / radian, question.degrees)
    notes += _jump_notes(target) if dial.output == ANGLE else []
    if refine_only:
        notes.append(LOCAL)
    if len(question.kinds) > 1:
        notes.append(SEVERAL_KINDS)
    if quick is not None:
        why_none = _why_no_slider_crank if dial.travels else _why_no_crank_rocker
        notes.append(quick.note if solutions else why_none(target, quick))
    if dial.travels or quick is not None:
        return notes
    if not settled:
        notes.append(STILL_BETTER)
    if question.largest and found and target.doubt > 0.2 * found[0].errors.max:
        notes.append(DOUBTFUL.format(target.doubt / radian))
    if not refine_only:
        notes += _proportion_notes(found, question.tolerance)
    exact = [solution for solution in solutions if solution.errors.objective < question.tolerance]
    free = 3 + (target.start is None) + (target.offset is None) - target.crank.size
    best = solutions[0] if solutions else None
    if free > 0 and target.exact is None and len(exact) > 1:
        notes.append(FEW_PAIRS.format(NUMERALS[target.crank.size]))
        if question.largest:
            notes.append("Between the pairs a straight line is requested.")
    elif isinstance(best, FunctionSolution) and best.determination.ill_posed:
        notes.append(ILL_POSED.format(in_percent(best.determination.length_uncertainty), "function"))
    return notes


def _why_no_slider_crank(target: TargetFunction, quick: QuickReturn) -> str:
    """Return a sentence on the lengths and transmission angles of slider-cranks without limits."""
    family = all_slider_cranks(quick.alpha)
    if not len(family.lengths) or quick.stroke is None:
        return TOO_QUICK
    crank, rod, _ = quick.stroke * family.lengths.T
    transmission = np.rad2deg(slider_crank_transmission(family).max())
    return SLIDER_CRANKS.format(crank=(crank.min(), crank.max()), rod=rod.min(), transmission=transmission)


def _why_no_crank_rocker(target: TargetFunction, quick: QuickReturn) -> str:
    """Return a sentence on the transmission angles of crank-rockers without limits."""
    lengths = exact_crank_rockers(target, quick.alpha).lengths
    transmission = np.nan_to_num(crank_rocker_transmission(lengths)).max(initial=0.0)
    return CRANK_ROCKERS.format(np.rad2deg(transmission)) if transmission > 0 else NO_CRANK_ROCKER


def _proportion_notes(found: Sequence[Generator], tolerance: float) -> list[str]:
    """Return a sentence on a linkage of least error that is out of all proportion."""
    if not found:
        return []
    best = min(found, key=lambda generator: generator.errors.objective)
    ratio, error = best.linkage.link_ratio, best.errors.objective
    smallest = min(
        (generator.errors.objective for generator in found if generator.linkage.link_ratio <= PROPORTION),
        default=np.inf,
    )
    if ratio <= PROPORTION or smallest < tolerance:
        return []
    if error >= tolerance and found[0].linkage.link_ratio <= PROPORTION:
        return [OUT_OF_PROPORTION.format(ratio=ratio, error=error)]
    said = FIRST_OUT_OF_PROPORTION.format(which="exact" if error < tolerance else "best", ratio=ratio)
    return [said + (FOUND_WITHIN[0].format(smallest) if smallest < np.inf else FOUND_WITHIN[1])]


def _jump_notes(target: TargetFunction) -> list[str]:
    """Return a sentence on a jump of the wanted output."""
    slope = np.abs(np.diff(target.output) / np.diff(target.crank))
    if slope.size < 4:
        return []
    index = int(np.argmax(slope))
    remaining = np.delete(slope, index)
    step = abs(target.output[index + 1] - target.output[index])
    if slope[index] <= _STEEP * remaining.max() or step <= np.deg2rad(1.0):
        return []
    steepness = slope[index] / max(remaining.max(), 1e-300)
    return [
        f"The output jumps from sample {index + 1} to {index + 2}, {steepness:.3g} times as steeply as anywhere else. "
        "No rocker follows a jump; if the angle wraps there by a full turn, write it without the wrap."
    ]
