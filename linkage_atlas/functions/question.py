"""Wanted functions as a user gives them: units of input and output, pairs, zeros, kinds of linkages and their limits."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.arguments import (
    Fields,
    bounded,
    build,
    column,
    kinds_among,
    number,
    one_of,
    pointing,
    positive,
    radians_in,
)
from linkage_atlas.functions.dials import MIN_PAIRS, Dials, RealFunction, read_dials
from linkage_atlas.functions.special import STEERING_NOTE, QuickReturn, read_quick_return, read_steering, with_ground
from linkage_atlas.limits import read_function_limits
from linkage_atlas.motions import unwound
from synthesis.arrays import Floats
from synthesis.errors import FieldError
from synthesis.function.laws import ANGLE, LENGTH, FunctionLimits
from synthesis.function.search import FunctionTask
from synthesis.function.target_function import TargetFunction
from synthesis.function.travel_laws import LAWS, TravelLaw, laws_for
from synthesis.search.search import DEFAULT_TOLERANCE
from synthesis.target import MAX_LENGTH, Target, make_target
from synthesis.work import Work

FOUR_BAR = "four_bar"
UNITS = ("deg", "rad", LENGTH)
_LIMITS = ("transmission_angle_min", "link_min", "link_max", "link_ratio_max", "links", "offset", "family", "preset")
_LINKS = {"crank": "crank", "coupler": "rod", "ground": "ground"}
"""Names of limits' links, and of the lengths that they are."""
_UNIT_HINT = "; set `input_unit` or `output_unit` to 'length' for a travel"
_STILL = 1e-12
"""Largest change of an output, in radians, that counts as rest."""
_CALLED = {
    "/function": "/output",
    "/function/x": "/interval",
    "/function/output_span": "/output_span",
    "/function/samples": "/samples",
}
"""Arguments of a callable that errors name, by the fields of a function."""


class Dial(NamedTuple):
    """Quantities of input and output, "angle" or "length"."""

    input: str
    """"angle" or "length"."""
    output: str

    @property
    def travels(self) -> bool:
        """True if input or output is a length."""
        return LENGTH in self

    @property
    def span(self) -> str:
        """Return the name of the input's change from the first sample to the last."""
        return "crank_span" if self.input == ANGLE else "travel_span"


def read_dial(input_unit: str | None, output_unit: str | None, degrees: bool) -> Dial:
    """Return the quantities of input and output by their units; default: angles in the unit of the request."""
    mine = "deg" if degrees else "rad"

    def read(name: str, unit: str | None) -> str:
        if unit is None or unit == mine:
            return ANGLE
        if one_of(name, unit, UNITS) != LENGTH:
            raise FieldError(f"/{name}", f"must be {mine!r}, the unit of the angles of this request, or {LENGTH!r}")
        return LENGTH

    return Dial(read("input_unit", input_unit), read("output_unit", output_unit))


def read_kinds(mechanisms: Sequence[str] | str | None, dial: Dial) -> list[str]:
    """Return the requested kinds of linkages; default: the kind that is built most often."""
    laws = dict.fromkeys(law.kind.value for law in LAWS if (law.input, law.output) == dial)
    known = list(laws) if dial.travels else [FOUR_BAR]
    if mechanisms is None:
        return known[:1]
    return kinds_among(
        mechanisms,
        known,
        f"must be {' or '.join(known)} for a function from {dial.input} to {dial.output}{_UNIT_HINT}",
    )


def read_travel_limits(
    named: Fields, laws: Sequence[TravelLaw], target: Target, degrees: bool, scale: float
) -> FunctionLimits:
    """Return the checked limits of linkages with sliders, angles in radians."""
    for name, value in named.items():
        if name not in _LIMITS:
            raise FieldError(
                f"/limits/{name}", f"does not apply to functions with travel, which have {', '.join(_LIMITS)}"
            )
        if name == "family" and value != "any":
            raise FieldError("/limits/family", "applies only to four-bars; leave it out")
    shape_limits = read_function_limits(
        {name: value for name, value in named.items() if name not in ("links", "offset")}, target, degrees
    )
    lengths: dict[str, float] = {}
    links = named.get("links")
    for name, value in links.items() if isinstance(links, Mapping) else ():
        if value is None:
            continue
        if _LINKS.get(name) not in {known for law in laws for known in law.lengths}:
            kinds = ", ".join(dict.fromkeys(law.kind.value for law in laws))
            raise FieldError(f"/limits/links/{name}", f"does not exist in {kinds}; leave it out")
        lengths[_LINKS[name]] = positive(f"limits/links/{name}", value, "number")
    if "offset" in named:
        if not any("offset" in law.lengths for law in laws):
            raise FieldError("/limits/offset", "applies only to slider-cranks; leave it out")
        lengths["offset"] = bounded("limits/offset", named["offset"], MAX_LENGTH)
    return FunctionLimits(shape_limits, lengths, scale)


class Scales(NamedTuple):
    """Size of a unit of the user's input and output in the search, in radians or in lengths over a common scale."""

    length: float
    """The scale, in the user's unit."""
    input: float
    output: float

    @classmethod
    def of(cls, dial: Dial, degrees: bool, input_span: float, output_span: float) -> Scales:
        """Return the scales for spans of input and output in the unit of the user."""
        spans = [abs(span) for what, span in zip(dial, (input_span, output_span)) if what == LENGTH]
        if not min(spans) > 0:
            raise FieldError("/output", "must vary, but the travel is the same everywhere")
        if not max(spans) <= MAX_LENGTH:
            raise FieldError("/output", f"must have values of at most {MAX_LENGTH:g}")
        return cls(max(spans), *(radians_in(degrees) if what == ANGLE else 1 / max(spans) for what in dial))


@contextmanager
def _naming(function: str | None) -> Iterator[None]:
    """Name input, output and weights in errors of a target; ``function``: the field that defines both, if there is one."""
    named = {"/rotation": "/output", "/crank_angle": "/input", "/crank_span": "/crank_span"}
    named["/weights/rotation"] = "/weights"
    try:
        yield
    except FieldError as error:
        at = next((old for old in named if error.field.startswith(old)), None)
        if at is None:
            raise
        path = named[at] if at == "/weights/rotation" else function or named[at]
        message = error.message.replace("rotation", "output").replace("crank_angle", "input")
        raise FieldError(path + error.field[len(at) :], message, **error.details) from error


def _finite(name: str, samples: object) -> Floats:
    """Return samples of an input or output after a check that they are finite."""
    values = column(name, samples)
    if values.ndim != 1 or values.size < 2 or not np.isfinite(values).all():
        raise FieldError(f"/{name}", f"must have at least {MIN_PAIRS} finite numbers")
    return values


@dataclass(frozen=True)
class FunctionQuestion:
    """A checked question for linkages that make a function."""

    function: TargetFunction
    """In radians, or lengths over `Scales.length`."""
    dials: Dials | None
    """Dials of a function by name, a table or a callable; None for other functions."""
    dial: Dial
    scales: Scales
    kinds: list[str]
    limits: FunctionLimits
    has_preset: bool
    """True if the request chooses a preset of limits."""
    largest: bool
    """True if the largest error over the interval is minimised, and not the root mean square error at the samples."""
    tolerance: float
    degrees: bool
    quick: QuickReturn | None
    symmetric_from: tuple[float, float] | None
    """Input and output at the first sample in radians, from the position in which the linkage is its own mirror image."""
    notes: list[str]
    """Sentences on unwound angles, and on the names of the wheels of a car."""

    @property
    def radian(self) -> float:
        """Radians in a unit of angle."""
        return radians_in(self.degrees)

    @property
    def travel(self) -> Floats:
        """Travel of the drive from the first sample, in radians or in the user's unit of length."""
        return self.function.crank * (1.0 if self.dial.input == ANGLE else self.scales.length)

    @property
    def target(self) -> Target:
        """The interval, for drawings."""
        return Target(None, None, crank=self.travel)

    def task(self, work: Work) -> FunctionTask:
        """Return what a search minimizes."""
        return FunctionTask(self.function, self.limits, self.largest, self.tolerance, work)


@dataclass(frozen=True, kw_only=True)
class FunctionFields:
    """Arguments of `linkage_atlas.function` that say which function is wanted, as a user gives them."""

    output: ArrayLike | RealFunction | None = None
    crank_span: float | None = None
    input: ArrayLike | None = None
    interval: ArrayLike | None = None
    output_span: float | None = None
    samples: int | None = None
    function: Fields | None = None
    quick_return: Fields | None = None
    steering: Fields | None = None
    symmetric: bool = False
    objective: str = "rms"
    input_zero: float | None = None
    output_zero: float | None = None
    weights: ArrayLike | None = None
    one_way: bool = False
    degrees: bool = True
    travel_span: float | None = None
    input_unit: str | None = None
    output_unit: str | None = None
    mechanisms: Sequence[str] | str | None = None
    limits: Fields | None = None
    tolerance: float = DEFAULT_TOLERANCE

    @classmethod
    def of(cls, arguments: Fields) -> FunctionFields:
        """Return the arguments that belong to the question."""
        return build(cls, {field.name: arguments[field.name] for field in dataclasses.fields(cls)})

    def question(self) -> FunctionQuestion:
        """Return the checked question. Raises `FieldError` that names the argument."""
        if self.objective not in ("rms", "max"):
            raise FieldError("/objective", f"must be 'rms' or 'max'; it is {self.objective!r}")
        tolerance = number("tolerance", self.tolerance, 0.0)
        quick, fields = self._without_special()
        dial = read_dial(fields.input_unit, fields.output_unit, fields.degrees)
        kinds = read_kinds(fields.mechanisms, dial)
        if quick is not None and dial.travels and kinds != ["slider_crank"]:
            raise FieldError(
                "/mechanisms", "must be slider_crank, because a slider-crank makes a quick return with a stroke"
            )
        fields._check_spans(dial)
        fields = fields._without_callable()
        unwound_fields, notes = (fields, []) if quick is not None else fields._unwound(dial)
        if self.steering is not None:
            notes = [*notes, STEERING_NOTE]
        target, dials, scales = unwound_fields._function(dial, quick)
        named = {name: value for name, value in (fields.limits or {}).items() if value is not None}
        if dial.travels:
            laws = laws_for(kinds, *dial)
            limits = read_travel_limits(named, laws, target.target, fields.degrees, scales.length)
        else:
            limits = FunctionLimits.of_four_bar(read_function_limits(named, target.target, fields.degrees))
            if quick is not None and limits.limits.family not in ("any", "crank_rocker", "full_crank"):
                raise FieldError(
                    "/limits/family", "must be crank_rocker, because a crank-rocker makes a quick return with a swing"
                )
        return FunctionQuestion(
            target,
            dials,
            dial,
            scales,
            kinds,
            limits,
            named.get("preset") is not None,
            fields.objective == "max",
            tolerance,
            fields.degrees,
            quick,
            fields._symmetric_from() if fields.symmetric else None,
            notes,
        )

    def _without_special(self) -> tuple[QuickReturn | None, FunctionFields]:
        """Return a quick return, and the fields with pairs in place of a quick return or steering."""
        quick: QuickReturn | None = None
        fields = self
        if self.quick_return is not None:
            self._check_alone("quick_return")
            if self.objective != "rms":
                raise FieldError("/objective", "does not apply to a quick return, which is exact; leave it out")
            quick = read_quick_return(self.quick_return, self.degrees)
            fields = build(replace, quick.pairs, self)
        elif self.steering is not None:
            self._check_alone("steering")
            left, right, track = read_steering(self.steering, self.degrees)
            limits = with_ground(self.limits, track)
            fields = replace(self, input=left, output=right, symmetric=True, limits=limits)
        if fields.symmetric and (fields.output is None or fields.input is None or callable(fields.output)):
            raise FieldError("/symmetric", "needs `input` and `output`, both measured from the symmetric position")
        return quick, fields

    def _check_alone(self, name: str) -> None:
        """Refuse other fields that say which function is wanted."""
        allowed = {"objective", "degrees", "mechanisms", "limits", "tolerance", name}
        if name == "steering":
            allowed.add("symmetric")
        for field in dataclasses.fields(self):
            if field.name not in allowed and getattr(self, field.name) is not field.default:
                raise FieldError(f"/{field.name}", f"`{name}` defines the function; leave this field out")

    def _check_spans(self, dial: Dial) -> None:
        """Refuse spans and limits of the other kind of input."""
        if self.crank_span is not None and dial.input != ANGLE:
            raise FieldError("/crank_span", "the input is a travel; give `travel_span` instead")
        if self.travel_span is not None and dial.input == ANGLE:
            instead = "" if dial.travels else ", or `input_unit` 'length'"
            raise FieldError("/travel_span", f"the input is an angle: give `crank_span`{instead}")
        if not dial.travels and (self.limits or {}).get("offset") is not None:
            raise FieldError(
                "/limits/offset", "applies only to slider-cranks; set `output_unit` or `input_unit` to 'length'"
            )

    def _without_callable(self) -> FunctionFields:
        """Return the fields with a callable as a function of x."""
        called = {"x": self.interval, "output_span": self.output_span, "samples": self.samples}
        if callable(self.output):
            if self.function is not None:
                raise FieldError("/output", "give either `output` or `function`")
            return replace(self, output=None, function={"of": self.output, **called})
        if set_fields := [name for name, value in called.items() if value is not None]:
            name = "interval" if set_fields[0] == "x" else set_fields[0]
            raise FieldError(f"/{name}", "applies only if `output` is a callable; leave it out")
        return self

    def _unwound(self, dial: Dial) -> tuple[FunctionFields, list[str]]:
        """Return the fields with continuous angles, and notes on changes."""
        if self.function is not None:
            return self, []
        assert not callable(self.output)
        output, input, notes = self.output, self.input, list[str]()
        if dial.output == ANGLE:
            output, notes = unwound("output", output, self.degrees)
        if dial.input == ANGLE:
            input, input_notes = unwound("input", input, self.degrees)
            notes = [*notes, *input_notes]
        return replace(self, output=output, input=input), notes

    def _function(self, dial: Dial, quick: QuickReturn | None) -> tuple[TargetFunction, Dials | None, Scales]:
        """Return the required function in the unit of the search, its dials if it has a name, and the scales."""
        if (self.output is None) == (self.function is None):
            raise FieldError("/output", "give either `output` or `function`")
        span = self.crank_span if dial.input == ANGLE else self.travel_span
        scales = self._scales(dial, span)
        with pointing(lambda field: field.replace("/crank_span", f"/{dial.span}")):
            target, dials = self._in_radians(span, scales)
        if quick is not None:
            # between the ends the target is an even motion, from which `error_curve` shows the deviation
            ends = target.crank, target.output
            return replace(target, exact=lambda crank: np.interp(crank, *ends)), dials, scales
        field = "/output" if self.function is None else "/function"
        if not dial.travels and np.ptp(target.output) <= _STILL:
            raise FieldError(field, "must vary, but the output is the same everywhere")
        back = np.diff(target.output) * (target.output[-1] - target.output[0]) <= 0
        if self.one_way and back.any():
            index = int(np.argmax(back)) + 1
            raise FieldError(
                f"{field}/{index}" if self.function is None else field,
                f"the rocker must not reverse, but sample {index + 1} of the output continues in the other direction",
            )
        return replace(target, one_way=self.one_way), dials, scales

    def _scales(self, dial: Dial, span: float | None) -> Scales:
        """Return the scales of input and output, which for a travel follow from their spans."""
        radian, name = radians_in(self.degrees), dial.span
        if not dial.travels:
            return Scales(1.0, radian, radian)
        if self.function is None and (span is None) == (self.input is None):
            raise FieldError(f"/{name}", f"give either `{name}` or `input`")
        if self.function is not None and span is None:
            raise FieldError(f"/{name}", "is required for a `function`")
        input_span = number(name, span) if self.input is None else np.diff(_finite("input", self.input)[[0, -1]])[0]
        if self.function is None:
            output_range = float(np.ptp(_finite("output", self.output)))
        elif self.function.get("output_span") is None:
            raise FieldError("/function/output_span", "is required: the travel of the output")
        else:
            output_range = number("function/output_span", self.function["output_span"])
        return Scales.of(dial, self.degrees, float(input_span), output_range)

    def _in_radians(self, crank_span: float | None, scales: Scales) -> tuple[TargetFunction, Dials | None]:
        """Return a function whose input and output are both read as angles, and its dials if it has a name."""
        radian, function = radians_in(self.degrees), self.function
        if np.ndim(crank_span):  # type: ignore[arg-type]
            raise FieldError(
                "/crank_span",
                "must be a single number, the crank angle from the first sample to the last; to prescribe every angle, "
                "give the crank angles of the samples as `input`",
            )
        span = None if crank_span is None else number("crank_span", crank_span) * scales.input
        angles = None if self.input is None else column("input", self.input) * scales.input
        dials = None
        if function is not None:
            if angles is not None:
                raise FieldError("/input", "the input dial of a `function` is linear; give `crank_span` instead")
            if scales.output != radian and "output_span" in function:  # dials take it as an angle
                output_span = number("function/output_span", function["output_span"])
                function = {**function, "output_span": output_span * scales.output / radian}
            called = _CALLED if "of" in function else {}
            with pointing(lambda field: called.get(field, field)):
                dials = read_dials(function, span, self.degrees)
            values, angles, span = dials.output, dials.input, None
        else:
            values = column("output", self.output) * scales.output
        weights = None if self.weights is None else column("weights", self.weights)
        with _naming("/function" if function is not None and "of" not in function else None):
            target = make_target(
                rotation=values, crank_span=span, crank_angle=angles, rotation_weights=weights, min_samples=MIN_PAIRS
            )
        assert target.rotation is not None
        start = None if self.input_zero is None else number("input_zero", self.input_zero) * scales.input
        offset = None
        if self.output_zero is not None:
            offset = float(target.rotation[0]) - number("output_zero", self.output_zero) * scales.output
        exact = None if dials is None else dials.exact
        return TargetFunction(target.crank, target.rotation, target.rotation_weights, start, offset, exact), dials

    def _symmetric_from(self) -> tuple[float, float]:
        radian = radians_in(self.degrees)
        return float(np.asarray(self.input)[0]) * radian, float(np.asarray(self.output)[0]) * radian
