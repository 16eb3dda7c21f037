"""Functions with travel: input or output is a length, of a slider or a cylinder; the part of `la.function` for them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np

from linkage_atlas.answers import Verdict, verdict_of
from linkage_atlas.arguments import kinds_among, number, radians_in
from linkage_atlas.guided import AnyGuide, DriverName, GuidedLinkage, KindName, guides_of
from linkage_atlas.limits import PRESETS
from linkage_atlas.records import KEPT, Record
from synthesis.arrays import Floats
from synthesis.errors import FieldError
from synthesis.fourbar.limits import LINK_RATIO, TRANSMISSION_ANGLE, Limits
from synthesis.fourbar.passage import faults_of
from synthesis.function.answers import FunctionErrors as Errors
from synthesis.function.travel import ANGLE, LAWS, LENGTH, Law
from synthesis.function.travel_search import TravelGenerator, TravelLimits, laws_for, turns_back
from synthesis.function.wanted import Wanted
from synthesis.guided.passage import verdict as passing_of
from synthesis.sheet import csv_text
from synthesis.target import MAX_LENGTH, Interval, Target

FOUR_BAR = "four_bar"
UNITS = ("deg", "rad", LENGTH)
_LIMITS = ("transmission_angle_min", "link_min", "link_max", "link_ratio_max", "links", "offset", "family", "preset")
_LINKS = {"crank": "crank", "coupler": "rod", "ground": "ground"}
"""Names of limits' links, and of the lengths that they are."""
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


def read_dial(input_unit: str | None, output_unit: str | None, degrees: bool) -> Dial:
    """What input and output are, by their units; default: angles in the request's unit."""
    mine = "deg" if degrees else "rad"

    def read(name: str, unit: str | None) -> str:
        if unit is None or unit == mine:
            return ANGLE
        if unit not in UNITS:
            raise FieldError(f"/{name}", f"wanted one of {', '.join(UNITS)}, found {unit!r}")
        if unit != LENGTH:
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


def read_travel_limits(limits: Mapping[str, Any] | None, laws: Sequence[Law], degrees: bool) -> TravelLimits:
    """The checked limits of linkages with sliders, angles in radians; names and preset as of other functions."""
    given = {name: value for name, value in (limits or {}).items() if value is not None}
    for name, value in given.items():
        if name not in _LIMITS:
            raise FieldError(f"/limits/{name}", f"functions with travel have {', '.join(_LIMITS)}")
        if name == "family" and value != "any":
            raise FieldError("/limits/family", "belongs to four-bars")
    preset = given.get("preset", PRESETS[1])
    if preset not in PRESETS:
        raise FieldError("/limits/preset", f"wanted 'practical' or 'none', found {preset!r}")
    values: dict[str, Any] = {}
    if preset == PRESETS[0]:
        values = {"transmission_angle_min": TRANSMISSION_ANGLE, "link_ratio_max": LINK_RATIO}
    if "transmission_angle_min" in given:
        angle = number("limits/transmission_angle_min", given["transmission_angle_min"]) * radians_in(degrees)
        if not 0 <= angle < np.pi / 2:
            raise FieldError("/limits/transmission_angle_min", "wanted at least 0 and less than a right angle")
        values["transmission_angle_min"] = angle
    for name in ("link_min", "link_max", "link_ratio_max"):
        if name in given:
            values[name] = number(f"limits/{name}", given[name])
            if not values[name] > 0:
                raise FieldError(f"/limits/{name}", "wanted a number above 0")
    if values.get("link_min", 0.0) > values.get("link_max", np.inf):
        raise FieldError("/limits/link_max", "below link_min")
    if values.get("link_ratio_max", 1.0) < 1:
        raise FieldError("/limits/link_ratio_max", "wanted at least 1")
    lengths: dict[str, float] = {}
    for name, value in (given.get("links") or {}).items():
        if value is None:
            continue
        if _LINKS.get(name) not in {known for law in laws for known in law.lengths}:
            kinds = ", ".join(dict.fromkeys(law.kind.value for law in laws))
            raise FieldError(f"/limits/links/{name}", f"there is none in {kinds}")
        lengths[_LINKS[name]] = number(f"limits/links/{name}", value)
        if not lengths[_LINKS[name]] > 0:
            raise FieldError(f"/limits/links/{name}", "wanted a number above 0")
    if "offset" in given:
        if not any("offset" in law.lengths for law in laws):
            raise FieldError("/limits/offset", "belongs to slider-cranks")
        lengths["offset"] = number("limits/offset", given["offset"])
        if abs(lengths["offset"]) > MAX_LENGTH:
            raise FieldError("/limits/offset", f"wanted at most {MAX_LENGTH:g}, either way")
    return TravelLimits(**values, given=lengths)


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

    @classmethod
    def of(cls, errors: Errors, unit: float, y_of_unit: float | None) -> FunctionErrors:
        """A generator's errors in the user's unit of the output; ``y_of_unit``: size of y that one unit of the search's is."""
        return cls(
            errors.rms / unit,
            errors.max / unit,
            errors.alternations,
            None if y_of_unit is None else errors.rms * y_of_unit,
            None if y_of_unit is None else errors.max * y_of_unit,
            errors.objective,
        )


class ErrorCurve(NamedTuple):
    """The error over the interval."""

    input: Floats
    error: Floats
    """Wanted less made."""


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
    linkage: GuidedLinkage = field(metadata=KEPT)
    """It moves, draws and saves itself."""


@dataclass(frozen=True)
class TravelAsked:
    """What solutions are described by. ``y_of_output``: size of y that one unit of the search's output is."""

    wanted: Wanted
    scales: Scales
    dial: Dial
    degrees: bool
    y_of_output: float | None

    @property
    def radian(self) -> float:
        """Radians in one unit of angle."""
        return radians_in(self.degrees)

    def described(self, found: Sequence[TravelGenerator], limits: TravelLimits, curves: bool) -> list[TravelSolution]:
        """Generators as a user reads them, best first."""
        return [self._described(one, rank, limits, curves) for rank, one in enumerate(found, 1)]

    def _described(self, one: TravelGenerator, rank: int, limits: TravelLimits, curves: bool) -> TravelSolution:
        scales, wanted, law = self.scales, self.wanted, one.law
        plain = one.linkage.scaled(scales.length)
        travel = wanted.crank * (1.0 if law.input == ANGLE else scales.length)
        target = Target(None, None, crank=travel)
        passed = passing_of(plain, plain.start + travel, timed=True)
        kept = Limits(
            transmission_angle_min=limits.transmission_angle_min or 0.0, link_ratio_max=limits.link_ratio_max
        )
        links = one.lengths[np.array(one.law.positive)].tolist()
        faults = faults_of((one.transmission_angle_min, None), links, {}, None, kept)
        reasons = [*passed.reasons, *filter(None, [turns_back(wanted, one)]), *faults]
        linkage = GuidedLinkage.of(plain, self.radian, target)
        curve = None
        if curves:
            shown = np.linspace(0.0, float(wanted.crank[-1]), _SHOWN)
            curve = ErrorCurve(shown / scales.input, (wanted.curve(shown) - one.output(shown)) / scales.output)
        used = Interval(float(travel.min()), float(travel.max()))
        return TravelSolution(
            rank=rank,
            kind=plain.kind.value,
            driver=plain.driver.value,
            lengths=self._lengths(one),
            guides=guides_of(plain, self.radian, used),
            branch=1 if plain.branch > 0 else -1,
            start=linkage.start,
            input_zero=one.zero / scales.input,
            output_offset=one.offset / scales.output,
            errors=FunctionErrors.of(one.errors, scales.output, self.y_of_output),
            verdict=verdict_of(passed, None, reasons, practical=not faults),
            transmission_angle_min=one.transmission_angle_min / self.radian,
            error_curve=curve,
            linkage=linkage,
        )

    def _lengths(self, one: TravelGenerator) -> dict[str, float]:
        units = [1 / self.radian if name == "angle" else self.scales.length for name in one.law.lengths]
        return {name: float(value * unit) for name, value, unit in zip(one.law.lengths, one.lengths, units)}


def laws_of(kinds: Sequence[str], dial: Dial) -> list[Law]:
    """The laws of some kinds."""
    return laws_for(kinds, *dial)


# -- as files ---------------------------------------------------------------------------------------------------------


def render_travel(
    wanted: Wanted,
    scales: Scales,
    dial: Dial,
    linkage: GuidedLinkage,
    output_offset: float,
    kind: str,
    length_unit: str,
) -> str:
    """A linkage that makes a function, as the text of a file; ``output_offset`` in the output's unit."""
    travel = wanted.crank * (1.0 if dial.input == ANGLE else scales.length)
    plain = linkage.plain
    radian = radians_in(linkage.degrees)
    if kind != "csv":
        return GuidedLinkage.of(plain, radian, Target(None, None, crank=travel)).render(kind, length_unit=length_unit)
    body = plain.body(plain.start + travel)
    made = own_output(linkage, dial, np.concatenate([[0.0], travel]))[1:] + output_offset
    output = wanted.output / scales.output
    columns = {
        "input": wanted.crank / scales.input,
        "output_wanted": output,
        "output": made,
        "error": output - made,
        "transmission_angle": body.transmission_angle / radian,
        "drive": (plain.start + travel) / (radian if plain.driver.turns else 1.0),
    }
    return csv_text({name: np.asarray(values).tolist() for name, values in columns.items()})


def own_output(linkage: GuidedLinkage, dial: Dial, travel: Floats) -> Floats:
    """A linkage's own output over travel (n,) of its drive (radians or lengths), in the user's unit; angles continuous.

    Of a crank or lever its direction, in (-180, 180] degrees at the first; of a slider or cylinder its place.
    """
    plain = linkage.plain
    if dial.output == LENGTH:
        return plain.along(1, travel)
    links = plain.links(travel)
    name = plain.link_names[2]
    direction = next(one.direction for one in links if one.name == name) if name != "block" else links[1].direction
    direction = np.unwrap(direction)
    turns = 2 * np.pi * np.round(direction[0] / (2 * np.pi))
    return (direction - turns) / radians_in(linkage.degrees)
