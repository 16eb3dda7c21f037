"""Function generation: which four-bars have a rocker whose angle is a wanted function of the crank's, and what comes back."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.answers import FINISHING, Ranked, StatusName, StoppedBy, Verdict, verdict_of
from linkage_atlas.arguments import (
    bounded,
    check_above_zero,
    check_names,
    check_top,
    column,
    kinds_among,
    number,
    one_of,
    pointing,
    radians_in,
)
from linkage_atlas.limits import read_function_limits
from linkage_atlas.linkages import AnyGuide, DriverName, KindName, Linkage, Links, guides_of
from linkage_atlas.motions import unit_notes, unwound
from linkage_atlas.notes import counted, in_percent, sentences
from linkage_atlas.records import KEPT, Record, Values, names_of
from linkage_atlas.result_notes import CUT_SHORT, LOCAL, NOWHERE
from linkage_atlas.studies import sensitivity_of
from linkage_atlas.task import seed_tables
from linkage_atlas.warm_start import FOR_STARTS, Start, StartingLinkage, check_local, pointing_to_start, read_starts
from synthesis.arrays import Floats
from synthesis.defects import faults_of, practical_faults, verdict
from synthesis.errors import FieldError
from synthesis.fourbar.determination import determinations
from synthesis.fourbar.limits import Limits
from synthesis.function.answers import Generator, exchanged, rocker_angles, to_csv, turns_back
from synthesis.function.search import best_built, generate, refit
from synthesis.function.travel_search import (
    ANGLE,
    LAWS,
    LENGTH,
    Law,
    TravelGenerator,
    TravelLimits,
    generate_travel,
    laws_for,
    travel_turns_back,
)
from synthesis.function.wanted import Wanted
from synthesis.linkage import Linkage as Plain
from synthesis.local_refinement import refine_function
from synthesis.ranking import APART, PROPORTION, Status, distinct
from synthesis.search.report import SearchReport, stopped_by
from synthesis.search.search import DEFAULT_TOLERANCE
from synthesis.sheet import csv_text
from synthesis.target import MAX_LENGTH, MAX_SAMPLES, MIN_SAMPLES, Interval, Target, make_target
from synthesis.work import Work

# -- functions with travel ----------------------------------------------------------------------------------------------

FOUR_BAR = "four_bar"
UNITS = ("deg", "rad", LENGTH)
_LIMITS = ("transmission_angle_min", "link_min", "link_max", "link_ratio_max", "links", "offset", "family", "preset")
_LINKS = {"crank": "crank", "coupler": "rod", "ground": "ground"}
"""Names of limits' links, and of the lengths that they are."""
MIN_PAIRS = 2
"""Minimum number of pairs of a function; two leave freedom, and the answers are a spread of exact linkages."""
_FEW_PAIRS = 3
"""Number of pairs up to which linkages that meet them leave freedom."""
_OTHERS = "; `input_unit` and `output_unit` say what is a length"
_SHOWN = 361
"""Places of an error curve."""
_RATIO = 500.0
"""Most that input and output of two sliders may differ in size."""


class Dial(NamedTuple):
    """What an input and an output are."""

    input: str
    """"angle" or "length"."""
    output: str

    @property
    def travels(self) -> bool:
        """Whether one of them is a length."""
        return LENGTH in self

    @property
    def span(self) -> str:
        """What the input's way from the first sample to the last is called."""
        return "crank_span" if self.input == ANGLE else "travel_span"


def read_dial(input_unit: str | None, output_unit: str | None, degrees: bool) -> Dial:
    """What input and output are, by their units; default: angles in the request's unit."""
    mine = "deg" if degrees else "rad"

    def read(name: str, unit: str | None) -> str:
        if unit is None or unit == mine:
            return ANGLE
        if one_of(name, unit, UNITS) != LENGTH:
            raise FieldError(f"/{name}", f"angles of this request are in {mine}: give {mine!r}, or {LENGTH!r}")
        return LENGTH

    return Dial(read("input_unit", input_unit), read("output_unit", output_unit))


def read_kinds(mechanisms: Sequence[str] | str | None, dial: Dial) -> list[str]:
    """The kinds that are asked for; default: the one that is built most often."""
    laws = dict.fromkeys(law.kind.value for law in LAWS if (law.input, law.output) == dial)
    known = list(laws) if dial.travels else [FOUR_BAR]
    if mechanisms is None:
        return known[:1]
    return kinds_among(
        mechanisms, known, f"from {dial.input} to {dial.output} there is {' or '.join(known)}{_OTHERS}"
    )


def read_travel_limits(
    limits: Mapping[str, Any] | None, laws: Sequence[Law], target: Target, degrees: bool
) -> TravelLimits:
    """The checked limits of linkages with sliders, angles in radians; names and preset as of other functions."""
    given = {name: value for name, value in (limits or {}).items() if value is not None}
    for name, value in given.items():
        if name not in _LIMITS:
            raise FieldError(f"/limits/{name}", f"functions with travel have {', '.join(_LIMITS)}")
        if name == "family" and value != "any":
            raise FieldError("/limits/family", "belongs to four-bars")
    kept = read_function_limits(
        {name: value for name, value in given.items() if name not in ("links", "offset")}, target, degrees
    )
    lengths: dict[str, float] = {}
    for name, value in (given.get("links") or {}).items():
        if value is None:
            continue
        if _LINKS.get(name) not in {known for law in laws for known in law.lengths}:
            kinds = ", ".join(dict.fromkeys(law.kind.value for law in laws))
            raise FieldError(f"/limits/links/{name}", f"there is none in {kinds}")
        check_above_zero(**{f"limits/links/{name}": value})
        lengths[_LINKS[name]] = float(value)
    if "offset" in given:
        if not any("offset" in law.lengths for law in laws):
            raise FieldError("/limits/offset", "belongs to slider-cranks")
        lengths["offset"] = bounded("limits/offset", given["offset"], MAX_LENGTH)
    return TravelLimits(kept, lengths)


class Scales(NamedTuple):
    """One unit of the user's input and output in that of the search: radians, or lengths over one scale."""

    length: float
    """The scale, in the user's unit."""
    input: float
    output: float

    @classmethod
    def of(cls, dial: Dial, degrees: bool, input_span: float, output_span: float) -> Scales:
        """From how far input and output go."""
        radian = radians_in(degrees)
        spans = [abs(span) for what, span in zip(dial, (input_span, output_span)) if what == LENGTH]
        length = max(spans)
        if not min(spans) > 0:
            raise FieldError("/output", "the travel is the same everywhere")
        if not length <= MAX_LENGTH:
            raise FieldError("/output", f"wanted travel of at most {MAX_LENGTH:g}")
        if length > _RATIO * min(spans):
            raise FieldError("/output", f"one travel is more than {_RATIO:g} times the other")
        sizes = (radian if what == ANGLE else 1 / length for what in dial)
        return cls(length, *sizes)


def _proportion_notes(found: Sequence[Generator], tolerance: float) -> list[str]:
    """What a user should know of a least error that lengths have which nobody makes."""
    if not found:
        return []
    best = min(found, key=lambda one: one.errors.objective)
    ratio, error = best.linkage.link_ratio, best.errors.objective
    least = min((one.errors.objective for one in found if one.linkage.link_ratio <= PROPORTION), default=np.inf)
    if ratio <= PROPORTION or least < tolerance:
        return []
    if error >= tolerance and found[0].linkage.link_ratio <= PROPORTION:
        return [OUT_OF_PROPORTION.format(ratio=ratio, error=error)]
    said = FIRST_OUT_OF_PROPORTION.format(which="exact" if error < tolerance else "best", ratio=ratio)
    return [said + (FOUND_WITHIN[0].format(least) if least < np.inf else FOUND_WITHIN[1])]


# -- what comes back --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class FunctionErrors(Record):
    """Errors of the output, in its unit."""

    rms: float
    """At the samples, weighted."""
    max: float
    """Over the whole interval for objective `max`, over the samples for `rms`."""
    alternations: int | None
    """Objective `max`: extremes of the error, of alternating sign, that are as large as the largest."""
    rms_y: float | None
    """`rms` in units of y; null without `function`."""
    max_y: float | None
    objective: float
    """What was made least: in radians, or of a travel as a part of the largest travel that is wanted."""


class ErrorCurve(NamedTuple):
    """Error of the output over the interval."""

    input: Floats
    error: Floats
    """Output got minus output wanted, in the unit of the output."""


@dataclass(frozen=True, kw_only=True)
class TravelSolution(Record):
    """A linkage with a slider or a cylinder that makes a function, and how well."""

    rank: int
    """From 1, by `errors.objective`."""
    kind: KindName
    driver: DriverName
    """What the input moves: crank, slider or cylinder."""
    lengths: dict[str, float]
    """By name: crank, rod, offset; crank, ground; rod, angle; pin_distance, slot_offset."""
    guides: list[AnyGuide]
    """What holds the body, the driven one first."""
    branch: Literal[-1, 1]
    start: float
    """The drive's coordinate at the first sample: direction of the crank, place along the rail, or length of the cylinder."""
    input_zero: float
    """The input at the first sample: the crank's angle from the rail or the ground line, or the place of slider or cylinder."""
    output_offset: float
    """output = the linkage's own + this: an angle of the crank or lever, or a place of slider or cylinder."""
    errors: FunctionErrors
    verdict: Verdict
    transmission_angle_min: float
    """Over the used interval, exactly."""
    error_curve: ErrorCurve | None
    linkage: Linkage = field(metadata=KEPT)
    """It moves, draws and saves itself."""


# -- as files ---------------------------------------------------------------------------------------------------------


def render(
    wanted: Wanted,
    scales: Scales,
    dial: Dial,
    linkage: Linkage,
    output_offset: float,
    kind: str,
    length_unit: str,
) -> str:
    """A linkage that makes a function, as the text of a file; ``output_offset`` in the output's unit."""
    radian = radians_in(linkage.degrees)
    travel = wanted.crank * (1.0 if dial.input == ANGLE else scales.length)
    if kind != "csv":
        shown = Linkage.of(linkage.plain, radian, Target(None, None, crank=travel))
        return shown.render(kind, length_unit=None if kind == "svg" else length_unit)
    if linkage.plain.is_four_bar:
        return to_csv(wanted, linkage.plain, output_offset * radian, radian)
    plain = linkage.plain
    body = plain.body(plain.start + travel)
    made = own_output(linkage, dial, np.concatenate([[0.0], travel]))[1:] + output_offset
    output = wanted.output / scales.output
    columns = {
        "input": wanted.crank / scales.input,
        "output_wanted": output,
        "output": made,
        "error": made - output,
        "transmission_angle": body.transmission_angle / radian,
        "drive": (plain.start + travel) / (radian if plain.driver.turns else 1.0),
    }
    return csv_text({name: np.asarray(values).tolist() for name, values in columns.items()})


def own_output(linkage: Linkage, dial: Dial, travel: Floats) -> Floats:
    """A linkage's own output over travel (n,) of its drive (radians or lengths), in the user's unit; angles continuous.

    Of a crank or lever its direction, in (-180, 180] degrees at the first; of a slider or cylinder its place.
    """
    plain = linkage.plain
    if dial.output == LENGTH:
        return plain.along(1, travel)
    links = plain.motions(travel)
    name = plain.link_names[2]
    direction = next(one.angle for one in links if one.name == name) if name != "block" else links[1].angle
    direction = np.unwrap(direction)
    turns = 2 * np.pi * np.round(direction[0] / (2 * np.pi))
    return (direction - turns) / radians_in(linkage.degrees)


# -- functions ----------------------------------------------------------------------------------------------------------

_CALLED = {
    "/function": "/output",
    "/function/x": "/interval",
    "/function/output_span": "/output_span",
    "/function/samples": "/samples",
}
"""Where the arguments of a callable are told of."""
_STEEP = 8.0
"""A step of the output this many times as steep as any other is called a jump."""
UNASKED = (
    "For functions the practical limits apply only if they are switched on (`limits.preset`): the verdict names those that "
    "the best linkage violates."
)
OUT_OF_PROPORTION = (
    "The linkage of least error (objective {error:.2g}) is out of all proportion: its longest link is {ratio:.2g} times the "
    "shortest. Linkages within 100 times come before it."
)
FIRST_OUT_OF_PROPORTION = (
    "The {which} linkage is out of all proportion: its longest link is {ratio:.2g} times the shortest. "
)
FOUND_WITHIN = "The best linkage within 100 times has the objective {:.2g}.", "No linkage within 100 times was found."
"""With such a linkage, and without."""
STILL_BETTER = "The error was still falling slightly when the search had used all its steps."
DOUBTFUL = (
    "Between the samples the wanted curve is a spline that is uncertain by up to {0:.2g}: more samples would make the largest "
    "error more meaningful."
)
ILL_POSED = "The problem is ill-posed: lengths that differ by {0} make this function about equally well."
FEW_PAIRS = (
    "Infinitely many linkages pass through {} pairs: the first of these transmit well and are compact. A further pair, or "
    "limits, narrow the choice."
)
SEVERAL_KINDS = "Linkages of several kinds are ordered by error only; they differ in transmission angle and size."
_STILL = 1e-12
"""Radians by which an output must move to be one."""


def function(
    output: ArrayLike | Callable[[Any], Any] | None = None,
    crank_span: float | None = None,
    *,
    input: ArrayLike | None = None,
    interval: ArrayLike | None = None,
    output_span: float | None = None,
    samples: int | None = None,
    function: Mapping[str, Any] | None = None,
    objective: Literal["rms", "max"] = "rms",
    input_zero: float | None = None,
    output_zero: float | None = None,
    weights: ArrayLike | None = None,
    one_way: bool = False,
    degrees: bool = True,
    travel_span: float | None = None,
    input_unit: Literal["deg", "rad", "length"] | None = None,
    output_unit: Literal["deg", "rad", "length"] | None = None,
    mechanisms: Sequence[str] | Literal["all"] | None = None,
    limits: Mapping[str, Any] | None = None,
    top: int = 10,
    tolerance: float = DEFAULT_TOLERANCE,
    budget: float | None = None,
    round_to: float | None = None,
    start_from: Sequence[StartingLinkage] | None = None,
    local: bool = False,
    sensitivity: bool = False,
    curves: bool = False,
    work: Callable[[float | None], Work] = Work,
) -> FunctionResult:
    """The four-bar linkages whose rocker's angle is a wanted function of the crank's; with sliders, functions of travel too.

    Parameters
    ----------
    output : array_like, shape (N,), or callable, optional
        Rocker angles at the samples, continuous, up to a constant; falling ones turn against a rising input. 2 to 1,024.
        Or y = f(x) on two linear dials: a callable of arrays or of numbers.
    crank_span : float, optional
        Crank angle from the first sample to the last, evenly spaced; negative: clockwise.
    input : array_like, shape (N,), optional
        Crank angles in place of ``crank_span``; what counts is the increment from the first.
    interval : array_like, shape (2,), optional
        Of a callable: first and last x, which ``crank_span`` is for.
    output_span : float, optional
        Of a callable: how far the rocker turns from the least y to the largest, negative: clockwise from the first sample to
        the last.
    samples : int, optional
        Of a callable: how many, 3 to 1,024 (101).
    function : mapping, optional
        In place of ``output``: a function by ``name``, one of log10, ln, exp, power (with ``exponent``), sin, cos, tan (x in
        the unit of angle), reciprocal; ``x`` is [first, last]. Or ``table``: [[x, y], ...]. ``output_span`` and ``samples`` as
        of a callable.
    objective : {"rms", "max"}
        Make least the root of the mean square at the samples, or the largest error over the whole interval.
    input_zero, output_zero : float, optional
        The crank angle at the first sample, and the rocker angle that is wanted there, both from the ground line A->B.
        Default: as they are best.
    weights : array_like, shape (N,), optional
        At least 0: what each squared error counts, or for "max" each error, linear between the samples.
    one_way : bool
        The rocker must not turn back within the interval.
    degrees : bool
        Unit of every angle in and out; False: radians.
    travel_span : float, optional
        In place of ``crank_span`` where the input is a travel: from the first sample to the last, in the unit of length.
    input_unit, output_unit : {"deg", "rad", "length"}, optional
        "length": the input, or the output, is the travel of a slider or cylinder. Default: angles of crank and rocker.
    mechanisms : sequence of str, or "all", optional
        What makes the function: "four_bar" from angle to angle; "slider_crank", "swinging_block" (a cylinder between two pins)
        from angle to length and back; "rail_slot" (a slotted lever) from length to angle; "two_rails" (two sliders and a rod)
        from length to length. Default: the first that there is.
    limits : mapping, optional
        Of functions with travel: transmission_angle_min, link_min, link_max, link_ratio_max, links (crank, coupler for the rod,
        ground), offset (of the rail from the crank's pivot), preset. Otherwise those of `linkage_atlas.Limits` that concern
        shape and lengths. The family is any ("any": closes over the interval)
        where none is given; links are {"ground": 100, ...}: lengths that are given; a ground that is not is 1.
    top : int
        At most so many linkages, different from one another.
    tolerance : float
        The search ends once the objective is below it.
    budget : float, optional
        Seconds; the best found by then is returned.
    round_to : float, optional
        Also give each solution with its links on this grid and the zeros fitted anew; needs limits.links.ground.
    start_from : sequence of Linkage, FunctionSolution or mapping, optional
        Four-bars that are candidates from the first step; plain values are those of `FunctionSolution.to_dict`. Each is refined
        to its nearest optimum within the limits before the search begins.
    local : bool
        Search nowhere else: only the linkages of ``start_from`` are refined, which need not lead to the best linkage.
    sensitivity : bool
        Also give the change of the output per unit of each length.
    curves : bool
        Also return each solution's error over the interval, output got minus output wanted: ``error_curve``.
    work : callable
        Makes what watches over time and cancellation from a budget in seconds.

    Returns
    -------
    FunctionResult

    Raises
    ------
    FieldError
        Naming the argument.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> asked = {"name": "log10", "x": [1, 2], "output_span": 90}
    >>> found = la.function(function=asked, crank_span=60, objective="max", limits={"transmission_angle_min": 30}, top=1)
    >>> round(found.best.errors.max, 4)
    0.0469
    >>> la.function(lambda x: x**1.5, 90, interval=(1, 4), output_span=90, top=1).status
    'closest'
    """
    if objective not in ("rms", "max"):
        raise FieldError("/objective", f"wanted 'rms' or 'max', found {objective!r}")
    check_top(top)
    check_above_zero(budget=budget, round_to=round_to)
    tolerance = number("tolerance", tolerance, 0.0)
    dial = read_dial(input_unit, output_unit, degrees)
    kinds = read_kinds(mechanisms, dial)
    if dial.travels:
        asked_for = {"start_from": start_from, "round_to": round_to, "sensitivity": sensitivity or None}
        if foreign := [name for name, value in asked_for.items() if value is not None]:
            raise FieldError(f"/{foreign[0]}", "belongs to functions from angle to angle")
    elif travel_span is not None:
        raise FieldError("/travel_span", "the input is an angle: give `crank_span`, or `input_unit` 'length'")
    elif "offset" in (limits or {}) and (limits or {})["offset"] is not None:
        raise FieldError("/limits/offset", "belongs to slider-cranks: give `output_unit` or `input_unit` 'length'")
    limits = limits if dial.travels else {n: v for n, v in (limits or {}).items() if n != "offset"}
    local = check_local(local, start_from)
    starts = read_starts(start_from, degrees) or []
    tables = seed_tables()
    watch = work(budget)
    called = {"x": interval, "output_span": output_span, "samples": samples}
    if callable(output):
        if function is not None:
            raise FieldError("/output", "give either `output` or `function`")
        output, function = None, {"of": output, **called}
    elif given := [name for name, value in called.items() if value is not None]:
        name = "interval" if given[0] == "x" else given[0]
        raise FieldError(f"/{name}", "belongs to an `output` that is a callable")
    wraps: list[str] = []
    if function is None:
        if dial.output == ANGLE:
            output, wraps = unwound("output", output, degrees)
        if dial.input == ANGLE:
            input, said = unwound("input", input, degrees)
            wraps = [*wraps, *said]
    if dial.travels:
        if crank_span is not None and dial.input != ANGLE:
            raise FieldError("/crank_span", "the input is a travel: give `travel_span`")
        if travel_span is not None and dial.input == ANGLE:
            raise FieldError("/travel_span", "the input is an angle: give `crank_span`")
    wanted, dials, scales = read_wanted(
        output,
        crank_span if dial.input == ANGLE else travel_span,
        dial=dial,
        input=input,
        function=function,
        input_zero=input_zero,
        output_zero=output_zero,
        weights=weights,
        degrees=degrees,
    )
    where = "/output" if function is None else "/function"
    if not dial.travels and np.ptp(wanted.output) <= _STILL:
        raise FieldError(where, "the output is the same everywhere: a rocker that stands still follows nothing")
    if one_way:
        _check_one_way(wanted, where)
        wanted = replace(wanted, one_way=True)
    largest = objective == "max"
    asked = AskedFunction(wanted, dials, degrees, largest, tolerance, dial, scales)
    if dial.travels:
        return _with_travel(asked, kinds, limits, top, watch, curves, wraps)
    kept = read_function_limits(limits, wanted.target, degrees)
    if round_to is not None and kept.links[3] is None:
        raise FieldError("/round_to", "needs the length of the ground (`limits.links.ground`), which fixes the size")
    search = watch.extended(-FINISHING)
    refining = search if local else search.part(FOR_STARTS * search.budget)
    found, course = _refined(starts, wanted, kept, largest, tolerance, refining)
    if not local:
        more, course = generate(tables, wanted, kept, largest, max(top, 2), tolerance, search)
        merged = distinct([*found, *more], len(found) + len(more), APART)
        found = best_built(wanted, merged, max(top, 2), tolerance, kept.links[3] is not None) if starts else more
    searched, told, found = watch.elapsed, _proportion_notes(found, tolerance), found[:top]
    radian = radians_in(degrees)
    solutions: list[Any] = described(asked, found, kept, sensitivity, curves)
    if round_to is not None:
        solutions = [
            replace(one, rounded=rounded(asked, generator, round_to, watch))
            for one, generator in zip(solutions, found)
        ]
    units = unit_notes("crank", wanted.crank[[0, -1]] / radian, degrees)
    if dials is None:
        units += unit_notes("output", wanted.output / radian, degrees)
    notes = [*wraps, *units, *_notes(wanted), *([LOCAL] if local else [])]
    if not course.settled:
        notes.append(STILL_BETTER)
    if largest and found and wanted.doubt > 0.2 * found[0].errors.max:
        notes.append(DOUBTFUL.format(wanted.doubt / radian))
    notes += [] if local else told
    many = [one for one in found if one.errors.objective < tolerance]
    if wanted.crank.size <= _FEW_PAIRS and wanted.exact is None and len(many) > 1:
        notes.append(FEW_PAIRS.format("two" if wanted.crank.size == MIN_PAIRS else "three"))
        if largest:
            notes.append("Between the pairs a straight line is requested.")
    elif solutions and solutions[0].determination.ill_posed:
        notes.append(ILL_POSED.format(in_percent(solutions[0].determination.length_uncertainty)))
    return asked.result(found, solutions, limits, course, searched, watch, notes, local)


def _refined(
    starts: Sequence[Start], wanted: Wanted, limits: Limits, largest: bool, tolerance: float, work: Work
) -> tuple[list[Generator], SearchReport]:
    """Refine given four-bars in turn; return their nearest optima, best first, and how it went."""
    found: list[Generator] = []
    seeds, trace = 0, list[tuple[float, float]]()
    for start in starts:
        with pointing_to_start(start.field):
            results, report = refine_function(wanted, limits, largest, start.linkage, start.offset, tolerance, work)
        found += results
        seeds += report.seeds
        trace += [pair for pair in report.trace if all(pair[1] < before for _, before in trace)]
    found = distinct(found, max(1, len(found)), APART)
    return found, SearchReport(stopped_by(found, tolerance, work), trace, 0.0, seeds)


def _with_travel(
    asked: AskedFunction,
    kinds: Sequence[str],
    limits: Mapping[str, Any] | None,
    top: int,
    watch: Work,
    curves: bool,
    wraps: Sequence[str],
) -> FunctionResult:
    """The best linkages with sliders."""
    wanted, dial = asked.wanted, asked.dial
    laws = laws_for(kinds, *dial)
    kept = read_travel_limits(limits, laws, wanted.target, asked.degrees)
    within, work = kept.over(asked.scales.length), watch.extended(-FINISHING)
    found, course = generate_travel(laws, wanted, within, asked.largest, top, asked.tolerance, work)
    searched = watch.elapsed
    solutions = [described_travel(asked, one, rank, kept, curves) for rank, one in enumerate(found, 1)]
    notes = [*wraps, *(_notes(wanted) if dial.output == ANGLE else [])]
    if len(kinds) > 1:
        notes.append(SEVERAL_KINDS)
    return asked.result(found, solutions, limits, course, searched, watch, notes)


# -- what is asked ----------------------------------------------------------------------------------------------------


def read_wanted(
    output: ArrayLike | None = None,
    span: float | None = None,
    *,
    dial: Dial,
    input: ArrayLike | None = None,
    function: Mapping[str, Any] | None = None,
    input_zero: float | None = None,
    output_zero: float | None = None,
    weights: ArrayLike | None = None,
    degrees: bool = True,
) -> tuple[Wanted, Dials | None, Scales]:
    """A checked function in the unit of its search, its dials where it was named, and what a unit is there; see `function`."""
    if (output is None) == (function is None):
        raise FieldError("/output", "give either `output` or `function`")
    radian = radians_in(degrees)
    scales, called = Scales(1.0, radian, radian), dial.span
    if dial.travels:
        if function is None and (span is None) == (input is None):
            raise FieldError(f"/{called}", f"give either `{called}` or `input`")
        if function is not None and span is None:
            raise FieldError(f"/{called}", "needed for a `function`")
        way = number(called, span) if input is None else float(np.diff(_finite("input", input)[[0, -1]])[0])
        if function is None:
            output_way = float(np.ptp(_finite("output", output)))
        elif function.get("output_span") is None:
            raise FieldError("/function/output_span", "needed: how far the output goes")
        else:
            output_way = number("function/output_span", function["output_span"])
        scales = Scales.of(dial, degrees, way, output_way)
    with pointing(lambda field: field.replace("/crank_span", f"/{called}")):
        return *_in_radians(output, span, input, function, input_zero, output_zero, weights, degrees, scales), scales


def _in_radians(
    output: ArrayLike | None,
    crank_span: float | None,
    input: ArrayLike | None,
    function: Mapping[str, Any] | None,
    input_zero: float | None,
    output_zero: float | None,
    weights: ArrayLike | None,
    degrees: bool,
    scales: Scales,
) -> tuple[Wanted, Dials | None]:
    """A function whose input and output are read as angles, whatever they are."""
    radian, (of_input, of_output) = radians_in(degrees), scales[1:]
    if np.ndim(crank_span):  # type: ignore[arg-type]
        raise FieldError(
            "/crank_span",
            "wanted one number, the crank angle from the first sample to the last: "
            "give the crank angles of the samples as `input`",
        )
    span = None if crank_span is None else number("crank_span", crank_span) * of_input
    angles = None if input is None else column("input", input) * of_input
    dials = exact = None
    if function is not None:
        if angles is not None:
            raise FieldError("/input", "the input dial of a `function` is linear: give `crank_span`")
        if of_output != radian and "output_span" in function:  # dials take it as an angle
            function = {**function, "output_span": function["output_span"] * of_output / radian}
        called = _CALLED if "of" in function else {}
        with pointing(lambda field: called.get(field, field)):
            dials = read_dials(function, span, degrees)
        values, angles, span, exact = dials.output, dials.input, None, dials.exact
    else:
        assert output is not None
        values = column("output", output) * of_output
    given = None if weights is None else column("weights", weights)
    try:
        target = make_target(
            rotation=values, crank_span=span, crank_angle=angles, rotation_weights=given, min_samples=MIN_PAIRS
        )
    except FieldError as error:
        named = {"/rotation": "/output", "/crank_angle": "/input", "/crank_span": "/crank_span"}
        named["/weights/rotation"] = "/weights"
        at = next((old for old in named if error.field.startswith(old)), None)
        if at is None:
            raise
        whole = "/function" if function is not None and "of" not in function else named[at]
        place = named[at] if at == "/weights/rotation" else whole
        message = error.message.replace("rotation", "output").replace("crank_angle", "input")
        raise FieldError(place + error.field[len(at) :], message, **error.details) from error
    assert target.rotation is not None
    start = None if input_zero is None else number("input_zero", input_zero) * of_input
    offset = None
    if output_zero is not None:
        offset = float(target.rotation[0]) - number("output_zero", output_zero) * of_output
    return Wanted(target.crank, target.rotation, target.rotation_weights, start, offset, exact), dials


def _finite(name: str, given: ArrayLike | None) -> Floats:
    """Samples that tell how far an input or output goes."""
    values: Floats = column(name, given)  # type: ignore[arg-type]
    if values.ndim != 1 or values.size < 2 or not np.isfinite(values).all():
        raise FieldError(f"/{name}", f"wanted at least {MIN_PAIRS} finite numbers")
    return values


def _check_one_way(wanted: Wanted, where: str) -> None:
    steps = np.diff(wanted.output)
    back = steps * np.sign(wanted.output[-1] - wanted.output[0]) <= 0
    if back.any():
        place = int(np.argmax(back)) + 1
        at = f"{where}/{place}" if where == "/output" else where
        raise FieldError(
            at,
            f"the rocker must not turn back, but sample {place + 1} of the output does not go on from the one before",
        )


def _notes(wanted: Wanted) -> list[str]:
    """What a user should know about a function with a jump."""
    slope = np.abs(np.diff(wanted.output) / np.diff(wanted.crank))
    if slope.size < 4:
        return []
    place = int(np.argmax(slope))
    others = np.delete(slope, place)
    step = abs(wanted.output[place + 1] - wanted.output[place])
    if slope[place] <= _STEEP * others.max() or step <= np.deg2rad(1.0):
        return []
    steepness = slope[place] / max(others.max(), 1e-300)
    return [
        f"The output jumps from sample {place + 1} to {place + 2}, {steepness:.3g} times as steeply as anywhere else. "
        "No rocker follows a jump; if the angle wraps there by a full turn, write it without the wrap."
    ]


# -- what comes back --------------------------------------------------------------------------------------------------

_EXCHANGED = [0, 2, 1, 3]


@dataclass(frozen=True, kw_only=True)
class RoundedFunction(Record):
    """A generator whose links lie on a grid, the zeros fitted anew; null where it does not close."""

    closes: bool
    links: Links | None
    start_angle: float | None
    output_offset: float | None
    errors: FunctionErrors | None
    transmission_angle_min: float | None
    """Over the used interval; limits are not applied again."""
    linkage: Linkage | None = field(default=None, metadata=KEPT)


@dataclass(frozen=True)
class FunctionDetermination(Record):
    """How well the function fixes each length."""

    ill_posed: bool
    """A length that is not given is not even fixed to a thousandth by the function at this resolution."""
    resolution: float
    """Error that is considered: the objective, at least the tolerance."""
    length_uncertainty: Values
    """Relative change of crank, coupler, rocker, ground within that resolution, 0 if given; null: not determined at all."""


@dataclass(frozen=True, kw_only=True)
class FunctionSolution(Record):
    """A linkage that makes a function, and how well."""

    rank: int
    """From 1: exact ones by merit, others by `errors.objective`, uneven ones behind (function.md)."""
    links: Links
    branch: Literal[-1, 1]
    start_angle: float
    """Crank angle at the first sample, from the ground line A->B."""
    output_offset: float
    """output = rocker angle (in -180..180 degrees at the first sample, continuous) + this."""
    errors: FunctionErrors
    verdict: Verdict
    family: str
    transmission_angle_min: float
    """Over the used interval, exactly."""
    transmission_angle_min_turn: float | None
    """Over the whole turn; null if the crank cannot turn."""
    condition: float
    """Condition number of the output's derivatives by all unknowns."""
    determination: FunctionDetermination
    sensitivity: Floats | None
    """Rms change of the output per unit of crank, coupler, rocker, ground."""
    rounded: RoundedFunction | None
    error_curve: ErrorCurve | None
    linkage: Linkage = field(metadata=KEPT)
    """It moves, draws and saves itself."""


@dataclass(frozen=True)
class FunctionReport(Record):
    """How an answer came about."""

    elapsed_ms: dict[str, float]
    """Milliseconds of each stage and in total."""
    trace: list[tuple[float, float]]
    """[milliseconds, best objective] after each stage."""
    stopped_by: StoppedBy
    seeds: int
    """Starting points refined."""
    notes: list[str]


@dataclass(frozen=True)
class FunctionResult(Record, Ranked[FunctionSolution | TravelSolution]):
    """The answer to `linkage_atlas.function`: linkages, best first, and a report; indexed and iterated as ``solutions``.

    ``status`` is "reached" (the best objective is below the tolerance), "closest", "infeasible" (none within the limits),
    or "unknown" (none was found before the time was up). ``input`` and ``output`` are the samples that were asked for,
    ``x`` and ``y`` their numbers where a function was named.
    """

    status: StatusName
    solutions: list[FunctionSolution | TravelSolution]
    """Of functions from angle to angle the first, with travel the second."""
    input: Floats
    """Crank angle, or travel, at the samples, from the first."""
    output: Floats
    """Wanted rocker angle, or travel, there."""
    x: Floats | None
    """The samples' x and y, where a function was named."""
    y: Floats | None
    report: FunctionReport
    wanted: Wanted = field(repr=False, metadata=KEPT)
    degrees: bool = field(default=True, metadata=KEPT)
    dial: Dial = field(default=Dial("angle", "angle"), repr=False, metadata=KEPT)
    scales: Scales = field(default=Scales(1.0, 1.0, 1.0), repr=False, metadata=KEPT)

    @property
    def _answers(self) -> list[FunctionSolution | TravelSolution]:
        return self.solutions

    @property
    def best(self) -> Any:
        """The best solution, of either kind; IndexError where there is none."""
        return self.solutions[0]

    @property
    def linkage(self) -> Any:
        """The linkage of the best solution."""
        return self.best.linkage

    def render(self, kind: str, rank: int = 1, length_unit: str = "mm") -> str:
        """Return a solution as the text of a file: csv (the function at the samples), svg, dxf or mjcf.

        The column ``error`` of the CSV file is output got minus output wanted.
        """
        if len(self.solutions) < rank:
            raise FieldError(
                "/limits" if not self.solutions else "/rank",
                f"this reply has {counted(len(self.solutions), 'linkage')}",
            )
        chosen = self.solutions[rank - 1]
        linkage, offset = chosen.linkage, chosen.output_offset
        return render(self.wanted, self.scales, self.dial, linkage, offset, kind, length_unit)

    def __repr__(self) -> str:
        unit = ("deg" if self.degrees else "rad") if self.dial.output == "angle" else "(length)"
        rows = [f"  {s.rank}  {s.linkage!r}  within {s.errors.max:.3g} {unit}" for s in self.solutions]
        notes = [f"note: {note}" for note in self.report.notes]
        return "\n".join([f"{self.status}: {counted(len(self.solutions), 'linkage')}", *rows, *notes])


@dataclass(frozen=True)
class AskedFunction:
    """What solutions are described by."""

    wanted: Wanted
    dials: Dials | None
    degrees: bool
    largest: bool
    tolerance: float
    dial: Dial
    scales: Scales

    @property
    def radian(self) -> float:
        """Radians in one unit of angle."""
        return radians_in(self.degrees)

    @property
    def target(self) -> Target:
        """The interval, for drawings."""
        return Target(None, None, crank=self.wanted.crank)

    def errors(self, one: Generator | TravelGenerator) -> FunctionErrors:
        """A generator's errors in the user's units."""
        found, unit = one.errors, self.scales.output
        y = None if self.dials is None else self.dials.y_of_radian
        rms_y, max_y = (None if y is None else error * y for error in (found.rms, found.max))
        return FunctionErrors(found.rms / unit, found.max / unit, found.alternations, rms_y, max_y, found.objective)

    def result(
        self,
        found: Sequence[Any],
        solutions: list[Any],
        limits: Mapping[str, Any] | None,
        course: SearchReport,
        searched: float,
        watch: Work,
        notes: list[str],
        local: bool = False,
    ) -> FunctionResult:
        """Of a search that took so many seconds, or (``local``) of a descent from a given linkage, what was found."""
        if (limits or {}).get("preset") is None and solutions and not solutions[0].verdict.practical:
            notes.append(UNASKED)
        status = Status.of(found, self.tolerance).value
        if not solutions and (local or course.stopped_by == "budget"):
            status = "unknown"
            notes.append(NOWHERE if local else CUT_SHORT)
        total = watch.elapsed
        stages = {"screen": course.screen_seconds, "refine": searched - course.screen_seconds}
        stages |= {"report": total - searched, "total": total}
        report = FunctionReport(
            elapsed_ms={name: 1000 * seconds for name, seconds in stages.items()},
            trace=[(1000 * seconds, value) for seconds, value in course.trace],
            stopped_by=course.stopped_by.value,
            seeds=course.seeds,
            notes=sentences(notes),
        )
        wanted, scales = self.wanted, self.scales
        x, y = (None, None) if self.dials is None else (self.dials.x, self.dials.y)
        given = wanted.crank / scales.input, wanted.output / scales.output
        return FunctionResult(
            status, solutions, *given, x, y, report, wanted, self.degrees, dial=self.dial, scales=scales
        )


def described_travel(
    asked: AskedFunction, one: TravelGenerator, rank: int, limits: TravelLimits, curves: bool
) -> TravelSolution:
    """A generator with a slider as a user reads it."""
    scales, wanted, law = asked.scales, asked.wanted, one.law
    plain = one.linkage.scaled(scales.length)
    travel = wanted.crank * (1.0 if law.input == ANGLE else scales.length)
    target = Target(None, None, crank=travel)
    passed = verdict(plain, plain.start + travel, timed=True)
    links = one.lengths[np.array(one.law.positive)].tolist()
    faults = faults_of((one.transmission_angle_min, None), links, {}, None, limits.limits)
    reasons = [*passed.reasons, *filter(None, [travel_turns_back(wanted, one)]), *faults]
    linkage = Linkage.of(plain, asked.radian, target)
    curve = None
    if curves:
        shown = np.linspace(0.0, float(wanted.crank[-1]), _SHOWN)
        curve = ErrorCurve(shown / scales.input, (one.output(shown) - wanted.curve(shown)) / scales.output)
    units = [1 / asked.radian if name == "angle" else scales.length for name in law.lengths]
    used = Interval(float(travel.min()), float(travel.max()))
    return TravelSolution(
        rank=rank,
        kind=plain.kind.value,
        driver=plain.driver.value,
        lengths={name: float(value * unit) for name, value, unit in zip(law.lengths, one.lengths, units)},
        guides=guides_of(plain, asked.radian, used),
        branch=1 if plain.branch > 0 else -1,
        start=linkage.start,
        input_zero=one.zero / scales.input,
        output_offset=one.offset / scales.output,
        errors=asked.errors(one),
        verdict=verdict_of(passed, None, reasons, practical=not faults),
        transmission_angle_min=one.transmission_angle_min / asked.radian,
        error_curve=curve,
        linkage=linkage,
    )


def _sensitivity(exchanged: Plain, target: Target, radian: float) -> Floats:
    """Return the change of the rocker's angle per unit of each length, of a linkage with crank and rocker exchanged."""
    rotation = sensitivity_of(exchanged, target, radian).rotation
    assert rotation is not None
    return rotation[_EXCHANGED]


def described(
    asked: AskedFunction, found: list[Generator], limits: Limits, sensitivity: bool, curves: bool
) -> list[FunctionSolution]:
    """Generators as a user reads them, best first."""
    if not found:
        return []
    wanted, radian = asked.wanted, asked.radian
    linkages = [one.linkage for one in found]
    # how a rocker's angle changes with the lengths is how the coupler's does with coupler and rocker exchanged
    others = [exchanged(one) for one in linkages]
    resolutions = [max(one.errors.objective, asked.tolerance) for one in found]
    given = [k for k, name in enumerate(_EXCHANGED[:3]) if limits.links[name] is not None]
    fixed = determinations(wanted.target, others, resolutions, given)
    changes = [_sensitivity(other, wanted.target, radian) if sensitivity else None for other in others]
    passed = [verdict(linkage, linkage.start + wanted.crank, timed=True) for linkage in linkages]
    back = turns_back(wanted, linkages)
    drawn = _error_curves(asked, found) if curves else [None] * len(found)
    solutions = []
    for k, one in enumerate(found):
        faults = practical_faults(one, wanted.target, limits, wanted.interval)
        reasons = [*passed[k].reasons, *filter(None, [back[k]]), *faults]
        determined, turn = fixed[k], one.transmission_angle_min_turn
        linkage = Linkage.of(one.linkage, radian, asked.target)
        solutions.append(
            FunctionSolution(
                rank=k + 1,
                links=linkage.dimensions.links,
                branch=linkage.dimensions.branch,
                start_angle=linkage.start_angle,
                linkage=linkage,
                output_offset=one.offset / radian,
                errors=asked.errors(one),
                family=one.family.value,
                transmission_angle_min=one.transmission_angle_min / radian,
                transmission_angle_min_turn=None if turn is None else turn / radian,
                verdict=verdict_of(passed[k], None, reasons, practical=not faults),
                condition=determined.condition,
                determination=FunctionDetermination(
                    determined.ill_posed, determined.resolution, determined.length_uncertainty[_EXCHANGED]
                ),
                sensitivity=changes[k],
                rounded=None,
                error_curve=drawn[k],
            )
        )
    return solutions


def _error_curves(asked: AskedFunction, found: list[Generator]) -> list[ErrorCurve | None]:
    """Return input and error of each generator over the interval."""
    wanted, radian = asked.wanted, asked.radian
    shown = np.linspace(0.0, wanted.crank[-1], _SHOWN)
    output = rocker_angles([one.linkage for one in found], shown) + np.array([one.offset for one in found])[:, None]
    return [ErrorCurve(shown / radian, error / radian) for error in output - wanted.curve(shown)]


def rounded(asked: AskedFunction, one: Generator, grid: float, work: Work) -> RoundedFunction:
    """A generator with its links on a grid."""
    links = np.maximum(np.round(np.array(one.linkage.links) / grid), 1.0) * grid
    again = refit(asked.wanted, one, links, asked.largest, asked.tolerance, work)
    values: dict[str, Any] = dict.fromkeys(names_of(RoundedFunction)) | {"closes": False}
    if again is None:
        return RoundedFunction(**values)
    linkage = Linkage.of(again.linkage, asked.radian, asked.target)
    values |= {
        "closes": True,
        "links": linkage.dimensions.links,
        "start_angle": linkage.start_angle,
        "output_offset": again.offset / asked.radian,
        "errors": asked.errors(again),
        "transmission_angle_min": again.transmission_angle_min / asked.radian,
    }
    return RoundedFunction(**values, linkage=linkage)


# -- a function by name, or of Python, on two dials -------------------------------------------------------------------

SAMPLES = 101
LARGEST = 1e100
_RANGE = 8193
_OF_ANGLES: dict[str, Callable[[Floats], Floats]] = {"sin": np.sin, "cos": np.cos, "tan": np.tan}
_PLAIN: dict[str, Callable[[Floats], Floats]] = {
    "log10": np.log10, "ln": np.log, "exp": np.exp, "reciprocal": lambda x: 1 / x
}  # fmt: skip
NAMES = (*_PLAIN, *_OF_ANGLES, "power")
"""Functions that have a name."""
FIELDS = ("name", "table", "x", "exponent", "output_span", "samples")


@dataclass(frozen=True)
class Dials:
    """A function on its two dials, in radians.

    ``x``, ``y`` (N,): the samples. ``input``, ``output`` (N,): crank angle from the first sample, and wanted rocker
    angle from there. ``y_of_radian``: size of y that one radian of the output dial is. ``exact``: the wanted rocker
    angle at any crank angle; None for a table.
    """

    x: Floats
    y: Floats
    input: Floats
    output: Floats
    y_of_radian: float
    exact: Callable[[Floats], Floats] | None


def read_dials(function: Mapping[str, Any], crank_span: float | None, degrees: bool) -> Dials:
    """The checked dials of a function by name or table; ``crank_span`` in radians. See `linkage_atlas.function`.

    In place of a name ``of`` may be a callable.
    """
    given = {name: value for name, value in function.items() if value is not None}
    check_names("/function", (name for name in given if name != "of"), FIELDS)
    if crank_span is None:
        raise FieldError("/crank_span", "needed for a `function`")
    if "output_span" not in given:
        raise FieldError("/function/output_span", "needed: how far the rocker turns")
    span = number("function/output_span", given["output_span"]) * radians_in(degrees)
    if not 0 < abs(span) <= 20 * np.pi:
        raise FieldError("/function/output_span", "wanted an angle other than 0, of at most ten turns")
    if ("name" in given) + ("table" in given) + ("of" in given) != 1:
        raise FieldError("/function/name", "give either `name` or `table`")
    if "table" in given:
        for name in ("x", "exponent", "samples"):
            if name in given:
                raise FieldError(f"/function/{name}", "belongs to a function by name, not to a table")
        x, y = _table(given["table"])
        of = None
    else:
        x, y, of = _sampled(given, degrees)
    # of a named function the dial is as long as the function is high, however it is sampled
    every = y if of is None else of(np.linspace(x[0], x[-1], _RANGE))
    low, high = float(every.min()), float(every.max())
    if not high > low:
        raise FieldError("/function", "y is the same everywhere: the rocker would not turn")
    # where it ends as high as it began, the rocker turns the way that y grows
    way = -1.0 if y[0] - y[-1] > 1e-9 * (high - low) else 1.0
    scale, first = way * span / (high - low), float(y[0])
    crank = (x - x[0]) / (x[-1] - x[0]) * crank_span
    exact = None
    if of is not None:
        curve, begin, end = of, float(x[0]), float(x[-1])

        def exact(crank: Floats) -> Floats:
            share = np.clip(crank / crank_span, 0.0, 1.0)
            return scale * (curve(begin * (1 - share) + end * share) - first)

    return Dials(x, y, crank, scale * (y - first), (high - low) / abs(span), exact)


def _table(table: Any) -> tuple[Floats, Floats]:
    rows = column("function/table", table)
    if rows.ndim != 2 or rows.shape[1] != 2 or not MIN_PAIRS <= len(rows) <= MAX_SAMPLES:
        raise FieldError("/function/table", f"wanted {MIN_PAIRS} to {MAX_SAMPLES} pairs [x, y]")
    if np.any(bad := ~np.isfinite(rows).all(axis=1)):
        raise FieldError(f"/function/table/{int(np.argmax(bad))}", "wanted finite numbers")
    x, y = rows.T
    steps = np.diff(x) * np.sign(x[-1] - x[0])
    if np.any(back := steps <= 1e-9 * abs(x[-1] - x[0])):
        place = int(np.argmax(back)) + 1
        raise FieldError(
            f"/function/table/{place}", "x must increase from sample to sample, or decrease: this value does not"
        )
    return x.copy(), y.copy()


def _sampled(given: Mapping[str, Any], degrees: bool) -> tuple[Floats, Floats, Callable[[Floats], Floats]]:
    one_of("function/name", given.get("name", NAMES[0]), NAMES)
    if "x" not in given:
        raise FieldError("/function/x", "needed: [first, last]")
    ends = column("function/x", given["x"])
    if ends.shape != (2,) or not np.all(np.isfinite(ends)) or ends[0] == ends[1]:
        raise FieldError("/function/x", "wanted two different finite numbers [first, last]")
    samples = given.get("samples", SAMPLES)
    if not isinstance(samples, (int, np.integer)) or not MIN_SAMPLES <= samples <= MAX_SAMPLES:
        raise FieldError("/function/samples", f"wanted a whole number from {MIN_SAMPLES} to {MAX_SAMPLES}")
    of = partial(_called, given["of"]) if "of" in given else _named(given, ends, degrees)
    x = np.linspace(ends[0], ends[1], samples)
    with np.errstate(all="ignore"):
        y = of(x)
    if not np.all(np.isfinite(y)) or np.abs(y).max() > LARGEST:
        raise FieldError("/function/x", "the function is too large here")
    return x, y, of


def _called(of: Callable[[Any], Any], x: Floats) -> Floats:
    """A callable at many places, whether it takes arrays or only numbers; FieldError where it gives no finite ones."""
    with np.errstate(all="ignore"):
        try:
            y = np.asarray(of(x))
        except Exception:  # told of the number at which it fails, if it does there too
            y = np.empty(0)
        if y.shape != x.shape or y.dtype.kind not in "iuf":
            y = np.array([_value(of, one) for one in x.ravel().tolist()]).reshape(x.shape)
    if np.any(bad := ~(np.abs(y) <= LARGEST)):
        found, at = y[bad].flat[0], x[bad].flat[0]
        raise FieldError("/output", f"wanted finite numbers of at most {LARGEST:g}, found {found:g} at x = {at:g}")
    return y.astype(float)


def _value(of: Callable[[Any], Any], x: float) -> float:
    try:
        return float(of(x))
    except Exception as error:
        raise FieldError("/output", f"the function fails at x = {x:g}: {error}") from error


def _named(given: Mapping[str, Any], ends: Floats, degrees: bool) -> Callable[[Floats], Floats]:
    name = given["name"]
    if (name == "power") != ("exponent" in given):
        raise FieldError("/function/exponent", "belongs to the function 'power', which needs it")
    exponent, radian = number("function/exponent", given.get("exponent", 0.0)), radians_in(degrees)
    turns = np.floor(ends * radian / np.pi - 0.5)
    if name == "tan" and turns[0] != turns[1]:
        raise FieldError("/function/x", "tan has a pole between these ends")
    low, high = sorted(ends)
    if name in ("log10", "ln") and low <= 0:
        raise FieldError("/function/x", f"{name} needs x above 0")
    if low <= 0 <= high and (name == "reciprocal" or (name == "power" and exponent < 0)):
        raise FieldError("/function/x", "the function has a pole at 0, between these ends")
    if low < 0 and name == "power" and exponent != np.round(exponent):
        raise FieldError("/function/x", "a power that is no whole number needs x of at least 0")
    if name == "power":
        return lambda x: np.asarray(np.power(x, exponent))
    return (lambda x: _OF_ANGLES[name](x * radian)) if name in _OF_ANGLES else _PLAIN[name]
