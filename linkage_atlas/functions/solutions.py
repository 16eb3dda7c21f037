"""Function generators described in the units of a user."""

from __future__ import annotations

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
from linkage_atlas.solutions import Determination, verdict_of
from synthesis.arrays import Floats
from synthesis.defects import faults_of, practical_faults, verdict
from synthesis.fourbar.determination import determinations
from synthesis.function.answers import Generator, exchanged, rocker_angles, turns_back
from synthesis.function.search import refit
from synthesis.function.travel_laws import ANGLE
from synthesis.function.travel_search import TravelGenerator, TravelLimits, travel_turns_back
from synthesis.limits import Limits
from synthesis.linkage import Linkage as Plain
from synthesis.studies.sensitivity import changes
from synthesis.target import Interval, Target
from synthesis.work import Work

_EXCHANGED = [0, 2, 1, 3]
_SHOWN = 361
"""Number of points of an error curve."""


def errors_of(question: FunctionQuestion, generator: Generator | TravelGenerator) -> FunctionErrors:
    """Return the errors of a generator in the user's units."""
    found, unit = generator.errors, question.scales.output
    y = None if question.dials is None else question.dials.y_of_radian
    rms_y, max_y = (None if y is None else error * y for error in (found.rms, found.max))
    return FunctionErrors(found.rms / unit, found.max / unit, found.alternations, rms_y, max_y, found.objective)


def described_travel(
    question: FunctionQuestion, generator: TravelGenerator, rank: int, limits: TravelLimits, curves: bool
) -> TravelSolution:
    """Describe a generator with a slider in the units of the user."""
    scales, function, law = question.scales, question.function, generator.law
    plain = generator.linkage.scaled(scales.length)
    travel = function.crank * (1.0 if law.input == ANGLE else scales.length)
    target = Target(None, None, crank=travel)
    passed = verdict(plain, plain.start + travel, timed=True)
    links = generator.lengths[np.array(generator.law.positive)].tolist()
    faults = faults_of((generator.transmission_angle_min, None), links, {}, None, limits.limits)
    reasons = [*passed.reasons, *filter(None, [travel_turns_back(function, generator)]), *faults]
    linkage = Linkage.of(plain, question.radian, target)
    curve = None
    if curves:
        shown = np.linspace(0.0, float(function.crank[-1]), _SHOWN)
        curve = ErrorCurve(shown / scales.input, (generator.output(shown) - function.curve(shown)) / scales.output)
    units = [1 / question.radian if name == "angle" else scales.length for name in law.lengths]
    used = Interval(float(travel.min()), float(travel.max()))
    return TravelSolution(
        rank=rank,
        kind=plain.kind.value,
        driver=plain.driver.value,
        lengths={name: float(value * unit) for name, value, unit in zip(law.lengths, generator.lengths, units)},
        guides=guides_of(plain, question.radian, used),
        branch=1 if plain.branch > 0 else -1,
        start=linkage.start,
        input_zero=generator.zero / scales.input,
        output_offset=generator.offset / scales.output,
        errors=errors_of(question, generator),
        verdict=verdict_of(passed, None, reasons, practical=not faults),
        transmission_angle_min=generator.transmission_angle_min / question.radian,
        error_curve=curve,
        linkage=linkage,
    )


def _sensitivity(exchanged: Plain, target: Target, radian: float) -> Floats:
    """Return the change of the rocker's angle per unit of each length, of a linkage with coupler and rocker exchanged."""
    return np.array([change.rotation for change in changes(exchanged, target, radian)])[_EXCHANGED]


def described(
    question: FunctionQuestion, found: list[Generator], limits: Limits, sensitivity: bool, curves: bool
) -> list[FunctionSolution]:
    """Describe generators in the units of the user, best first."""
    if not found:
        return []
    target_function, radian = question.function, question.radian
    linkages = [generator.linkage for generator in found]
    # how a rocker's angle changes with the lengths is how the coupler's does with coupler and rocker exchanged
    exchanged_linkages = [exchanged(generator) for generator in linkages]
    resolutions = [max(generator.errors.objective, question.tolerance) for generator in found]
    fixed_lengths = [k for k, name in enumerate(_EXCHANGED[:3]) if limits.links[name] is not None]
    fixed = determinations(target_function.target, exchanged_linkages, resolutions, fixed_lengths)
    sensitivities = [
        _sensitivity(other_linkage, target_function.target, radian) if sensitivity else None
        for other_linkage in exchanged_linkages
    ]
    passed = [verdict(linkage, linkage.start + target_function.crank, timed=True) for linkage in linkages]
    back = turns_back(target_function, linkages)
    drawn = _error_curves(question, found) if curves else [None] * len(found)
    solutions = []
    for k, generator in enumerate(found):
        faults = practical_faults(generator, target_function.target, limits, target_function.interval)
        reasons = [*passed[k].reasons, *filter(None, [back[k]]), *faults]
        determined, turn = fixed[k], generator.transmission_angle_min_turn
        linkage = Linkage.of(generator.linkage, radian, question.target)
        solutions.append(
            FunctionSolution(
                rank=k + 1,
                links=_links(linkage),
                branch=1 if linkage.branch > 0 else -1,
                start_angle=linkage.start_angle,
                linkage=linkage,
                output_offset=generator.offset / radian,
                errors=errors_of(question, generator),
                family=generator.family.value,
                transmission_angle_min=generator.transmission_angle_min / radian,
                transmission_angle_min_turn=None if turn is None else turn / radian,
                verdict=verdict_of(passed[k], None, reasons, practical=not faults),
                condition=determined.condition,
                determination=Determination(
                    determined.ill_posed, determined.resolution, (), determined.length_uncertainty[_EXCHANGED]
                ),
                sensitivity=sensitivities[k],
                rounded=None,
                error_curve=drawn[k],
            )
        )
    return solutions


def _links(linkage: Linkage) -> Links:
    return Links(*linkage.links.tolist())


def _error_curves(question: FunctionQuestion, found: list[Generator]) -> list[ErrorCurve | None]:
    """Return input and error of each generator over the interval."""
    target, radian = question.function, question.radian
    shown = np.linspace(0.0, target.crank[-1], _SHOWN)
    output = (
        rocker_angles([generator.linkage for generator in found], shown)
        + np.array([generator.offset for generator in found])[:, None]
    )
    return [ErrorCurve(shown / radian, error / radian) for error in output - target.curve(shown)]


def rounded(question: FunctionQuestion, generator: Generator, grid: float, work: Work) -> RoundedFunction:
    """Return a generator with its links on a grid."""
    links = np.maximum(np.round(np.array(generator.linkage.links) / grid), 1.0) * grid
    refitted = refit(question.function, generator, links, question.largest, question.tolerance, work)
    if refitted is None:
        return RoundedFunction(closes=False)
    linkage = Linkage.of(refitted.linkage, question.radian, question.target)
    return RoundedFunction(
        closes=True,
        links=_links(linkage),
        start_angle=linkage.start_angle,
        output_offset=refitted.offset / question.radian,
        errors=errors_of(question, refitted),
        transmission_angle_min=refitted.transmission_angle_min / question.radian,
        linkage=linkage,
    )
