"""Function generators described in the units of a user."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from linkage_atlas.functions.question import FunctionQuestion
from linkage_atlas.functions.results import (
    ErrorCurve,
    FunctionErrors,
    FunctionSolution,
    RoundedFunction,
    TravelSolution,
)
from linkage_atlas.geometry import Links, guides_of
from linkage_atlas.linkages import Linkage
from linkage_atlas.notes import fault
from linkage_atlas.solutions import Determination, verdict_of
from synthesis.defects import verdict
from synthesis.function.answers import Generator, turning_back
from synthesis.function.laws import FOUR_BAR, LENGTH, FunctionLimits
from synthesis.function.search import refit
from synthesis.limits import Limits, judged_limits
from synthesis.linkage import Linkage as Plain
from synthesis.linkage import as_lengths, with_links
from synthesis.studies.determination import Determination as Determined
from synthesis.studies.determination import uncertainties
from synthesis.studies.sensitivity import changes
from synthesis.target import Interval
from synthesis.violations import violations_of_shape
from synthesis.work import Work

_EXCHANGED = [0, 2, 1, 3]
_SHOWN = 361
"""Number of points of an error curve."""


def errors_of(question: FunctionQuestion, generator: Generator) -> FunctionErrors:
    """Return the errors of a generator in the user's units."""
    found, unit = generator.errors, question.scales.output
    y = None if question.dials is None else question.dials.y_of_radian
    rms_y, max_y = (None if y is None else error * y for error in (found.rms, found.max))
    return FunctionErrors(found.rms / unit, found.max / unit, found.alternations, rms_y, max_y, found.objective)


def described(
    question: FunctionQuestion, found: Sequence[Generator], sensitivity: bool, curves: bool
) -> list[FunctionSolution | TravelSolution]:
    """Describe generators in the units of the user, best first."""
    plains = [built(question, generator) for generator in found]
    practical = judged_limits(None, question.limits.limits)
    commons = [_common(question, *row, curves, practical) for row in zip(found, plains, itertools.count(1))]
    if question.dial.travels:
        return [_travelling(question, *row) for row in zip(found, plains, commons)]
    fixed = _determinations(question, found)
    return [_four_bar(question, *row, sensitivity) for row in zip(found, plains, commons, fixed)]


def _travelling(
    question: FunctionQuestion, generator: Generator, plain: Plain, common: dict[str, Any]
) -> TravelSolution:
    law, scales = generator.law, question.scales
    lengths = zip(law.lengths, question.limits.in_user_units(law, generator.lengths).tolist())
    used = Interval(float(question.travel.min()), float(question.travel.max()))
    return TravelSolution(
        **common,
        kind=plain.kind.value,
        driver=plain.driver.value,
        lengths={name: value / question.radian if name == "angle" else value for name, value in lengths},
        guides=guides_of(plain, question.radian, used),
        start=common["linkage"].start,
        input_zero=generator.zero / scales.input,
    )


def _common(
    question: FunctionQuestion, generator: Generator, plain: Plain, rank: int, curves: bool, practical: Limits
) -> dict[str, Any]:
    """Return the fields of solutions of all kinds."""
    function, scales, radian = question.function, question.scales, question.radian
    linkage = Linkage.of(plain, radian, question.target)
    passed = verdict(plain, plain.start + question.travel, timed=True)
    positive, turn = np.array(generator.law.positive), generator.transmission_angle_min_turn
    links = [*generator.lengths[positive].tolist(), *([1.0] if plain.is_four_bar else [])]
    violated = violations_of_shape((generator.transmission_angle_min, turn), links, practical)
    faults = [fault(measure) for measure in violated]
    back, curve = turning_back(function, generator), None
    sentences = []
    if back is not None:
        by = f" by {np.rad2deg(back[0]):.3g} degrees" if plain.is_four_bar else ""
        sentences = [f"the {'rocker' if by else 'output'} turns back{by} at {100 * back[1]:.3g} % of the interval"]
    if curves:
        shown = np.linspace(0.0, float(function.crank[-1]), _SHOWN)
        curve = ErrorCurve(shown / scales.input, (generator.output(shown) - function.curve(shown)) / scales.output)
    return {
        "rank": rank,
        "branch": 1 if plain.branch > 0 else -1,
        "output_offset": generator.offset / scales.output,
        "errors": errors_of(question, generator),
        "verdict": verdict_of(passed, None, [*passed.reasons, *sentences, *faults], practical=not faults),
        "transmission_angle_min": generator.transmission_angle_min / radian,
        "error_curve": curve,
        "linkage": linkage,
    }


def built(question: FunctionQuestion, generator: Generator) -> Plain:
    """Return the linkage in the user's unit of length; prescribed lengths are equal to the last bit."""
    law, limits = generator.law, question.limits
    zero = generator.zero * (limits.scale if law.input == LENGTH else 1.0)
    return law.linkage(limits.in_user_units(law, generator.lengths), generator.branch, zero, limits.scale)


def _four_bar(
    question: FunctionQuestion,
    generator: Generator,
    plain: Plain,
    common: dict[str, Any],
    determination: Determination,
    sensitivity: bool,
) -> FunctionSolution:
    radian, turn, by_length = question.radian, generator.transmission_angle_min_turn, None
    if sensitivity:
        # how a rocker's angle changes with the lengths is how the coupler's does with coupler and rocker exchanged
        exchanged = dataclasses.replace(
            with_links(plain, as_lengths(plain.links[k] for k in _EXCHANGED)), branch=-plain.branch, body_offset=None
        )
        by_length = np.array([change.rotation for change in changes(exchanged, question.function.target, radian)])
        by_length = by_length[_EXCHANGED]
    return FunctionSolution(
        **common,
        links=Links(*plain.links),
        start_angle=common["linkage"].start_angle,
        family=str(generator.linkage.family),
        transmission_angle_min_turn=None if turn is None else turn / radian,
        determination=determination,
        sensitivity=by_length,
        rounded=None,
    )


def _determinations(question: FunctionQuestion, found: Sequence[Generator]) -> list[Determination]:
    """Return how well the function fixes the lengths of each four-bar; given lengths and zeros are held."""
    target, limits = question.function, question.limits
    columns = [(*FOUR_BAR.unknowns(each.lengths), each.zero, 0.0, each.branch) for each in found]
    unknowns = np.array(columns).reshape(-1, 6)
    crank = np.broadcast_to(target.crank, (len(columns), target.crank.size))
    slope = FOUR_BAR.at(unknowns[:, :5], unknowns[:, 5], crank).slope
    by_offset = np.ones((len(columns), 1, target.crank.size))
    matrix = np.nan_to_num(np.concatenate([slope, by_offset], axis=1) * target.mean.root).transpose(0, 2, 1)
    free = [*np.isnan(limits.prescribed_in(FOUR_BAR)), target.start is None, target.offset is None]
    lengths = np.eye(5)[[0, 2, 1, 3]] * [[1.0], [1.0], [1.0], [0.0]]  # the ground is the unit of length
    resolutions = [max(generator.errors.objective, question.tolerance) for generator in found]
    fixed = map(Determined, uncertainties(matrix[:, :, free], lengths[:, free], resolutions), resolutions)
    return [Determination(each.ill_posed, each.resolution, (), each.length_uncertainty) for each in fixed]


def rounded(question: FunctionQuestion, generator: Generator, grid: float, work: Work) -> RoundedFunction:
    """Return a four-bar with its links on a grid."""
    links = np.maximum(np.round(np.array(built(question, generator).links) / grid), 1.0) * grid
    limits = FunctionLimits.of_four_bar(Limits("any", links=as_lengths(links)))
    on_grid = dataclasses.replace(question, limits=limits)
    refitted = refit(on_grid.task(work), generator)
    if refitted is None:
        return RoundedFunction(closes=False)
    linkage = Linkage.of(built(on_grid, refitted), question.radian, question.target)
    return RoundedFunction(
        closes=True,
        links=Links(*linkage.plain.links),
        start_angle=linkage.start_angle,
        output_offset=refitted.offset / question.radian,
        errors=errors_of(question, refitted),
        transmission_angle_min=refitted.transmission_angle_min / question.radian,
        linkage=linkage,
    )
