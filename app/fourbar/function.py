"""Function generation over HTTP and on the command line: which linkage's rocker turns as a wanted function of its crank?"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

import linkage_atlas as la
from app.fourbar import SUMMARIES
from app.fourbar.answers import SHORT_MS, budget_of
from app.fourbar.given import GivenGenerator
from app.fourbar.models import (
    Curve,
    Length,
    limits_request,
)
from app.query import (
    AngleUnit,
    Count,
    Export,
    Flag,
    Number,
    PositiveNumber,
    Query,
    RequestModel,
    Resources,
)
from app.tables import DEGREES, Units, number, table
from linkage_atlas.limits import FUNCTION_LIMITS
from linkage_atlas.motions import MAX_SAMPLES, MIN_SAMPLES

MEDIA_TYPES = {
    "csv": "text/csv; charset=utf-8",
    "svg": "image/svg+xml",
    "dxf": "image/vnd.dxf",
    "mjcf": "application/xml",
}
Pair = Annotated[list[Number], Field(min_length=2, max_length=2)]


class FunctionOfX(RequestModel):
    """y = f(x) on two linear dials."""

    name: Literal["log10", "ln", "exp", "power", "sin", "cos", "tan", "reciprocal"] | None = Field(
        None, description="sin, cos and tan take x in `angle_unit`."
    )
    table: Annotated[list[Pair], Field(min_length=MIN_SAMPLES, max_length=MAX_SAMPLES)] | None = Field(
        None, description="Pairs [x, y] in place of a name."
    )
    x: Pair | None = Field(None, description="First and last x.")
    exponent: Number | None = Field(None, description="Of `power`.")
    output_span: Number = Field(
        description="How far the rocker turns from the least y to the largest; < 0: clockwise from first sample to last."
    )
    samples: Annotated[Count, Field(ge=MIN_SAMPLES, le=MAX_SAMPLES)] | None = Field(
        None, description="Samples of a named function; default 101."
    )


FunctionLimitsRequest = limits_request(
    "FunctionLimitsRequest",
    "What every linkage must keep to.",
    FUNCTION_LIMITS,
    "any",
    "Transmission angle 35 degrees (15 over the turn), link ratio 10; a field beside it replaces its value.",
)


class FunctionRequest(RequestModel):
    """Which linkage's rocker turns as a wanted function of its crank?"""

    output: Curve | None = Field(
        None,
        description="Rocker angles at the samples, continuous, up to a constant; falling: against a rising input.",
    )
    crank_span: Number | None = Field(
        None, description="Crank angle from the first sample to the last, evenly spaced; < 0: clockwise."
    )
    input: Curve | None = Field(
        None, description="Crank angles in place of `crank_span`; what counts is the increment from the first."
    )
    function: FunctionOfX | None = Field(None, description="A function by name or table in place of `output`.")
    objective: Literal["rms", "max"] = Field(
        "rms", description="Make least the rms error at the samples, or the largest error over the whole interval."
    )
    input_zero: Number | None = Field(None, description="Crank angle at the first sample, from the ground line A->B.")
    output_zero: Number | None = Field(None, description="Rocker angle that is wanted there, from the ground line.")
    weights: Annotated[list[Annotated[Number, Field(ge=0)]], Field(min_length=3, max_length=MAX_SAMPLES)] | None = (
        Field(None, description="What each squared error counts; for `max` each error, linear between samples.")
    )
    one_way: Flag = Field(False, description="The rocker must not turn back within the interval.")
    limits: FunctionLimitsRequest = FunctionLimitsRequest()
    top: Annotated[Count, Field(ge=1, le=100)] = Field(10, description="How many different linkages to return.")
    tolerance: Annotated[Number, Field(ge=0)] = Field(
        1e-10, description="The search ends when the objective is below this."
    )
    budget_ms: PositiveNumber | None = Field(None, description="Return the best found within this time.")
    round_to: Length | None = Field(
        None, description="Also report each solution with its links on this grid and the zeros fitted anew."
    )
    refine_from: GivenGenerator | None = Field(
        None,
        description="Search nowhere, but refine this linkage from just there: one solution, its nearest optimum within the "
        "limits.",
    )
    sensitivity: Flag = Field(False, description="Also report the change of the output per unit of each length.")
    curves: Flag = Field(False, description="Also report each solution's error over the interval.")
    angle_unit: AngleUnit = Field("deg", description="Unit of every angle in request and reply.")


def solve_function(request: FunctionRequest, resources: Resources) -> la.FunctionResult:
    """Linkages that make a function, best first."""
    names = ("output", "crank_span", "input", "objective", "input_zero", "output_zero", "weights", "one_way")
    names += ("tolerance", "round_to", "sensitivity", "curves")
    asked = None if request.function is None else request.function.model_dump(exclude_none=True)
    return la.function(
        **{name: getattr(request, name) for name in names},
        function=asked,
        refine_from=None if request.refine_from is None else request.refine_from.model_dump(),
        limits=request.limits.model_dump(exclude_none=True),
        top=request.top,
        budget=budget_of(request.budget_ms, resources),
        degrees=request.angle_unit == "deg",
        work=resources.work,
    )


def is_long(request: FunctionRequest) -> bool:
    """Whether an answer may take more than a fraction of a second."""
    if request.budget_ms is not None and request.budget_ms <= SHORT_MS:
        return False
    samples = 101 if request.function is not None else len(request.output or ())
    limited = not request.limits.model_fields_set <= {"family"} or request.round_to is not None or request.one_way
    return request.objective == "max" or limited or samples > 64 or request.top > 20


def _best(name: str) -> Any:
    def render(request: FunctionRequest, resources: Resources) -> bytes:
        return solve_function(request, resources).render(name).encode()

    return render


def function_table(reply: la.FunctionResult, units: Units = DEGREES) -> str:
    """Ranked linkages of the reply; errors in the request's unit of angle."""
    lines = [f"{reply.status}: {len(reply.solutions)} linkage{'s' if len(reply.solutions) != 1 else ''}"]
    rows = []
    for s in reply.solutions:
        links = [number(v) for v in (s.links.crank, s.links.coupler, s.links.rocker, s.links.ground)]
        errors = [
            f"{s.errors.rms:.3g}",
            f"{s.errors.max:.3g}",
            "-" if s.errors.max_y is None else f"{s.errors.max_y:.3g}",
        ]
        alternations = "-" if s.errors.alternations is None else str(s.errors.alternations)
        at = (f"{s.branch:+d}", number(s.start_angle), number(s.output_offset), s.family)
        rows.append((s.rank, *links, *at, number(s.transmission_angle_min, 4), *errors, alternations))
    if rows:
        head = ("rank", "crank", "coupler", "rocker", "ground", "branch", "start", "offset", "family", "transm.")
        errors = (units.head("rms", units.angle), units.head("max", units.angle), "max y", "alt.")
        lines += ["", table((*head, *errors), rows)]
        best = reply.solutions[0]
        if best.verdict.reasons:
            lines.append(f"rank 1: {'; '.join(best.verdict.reasons)}")
        if best.rounded is not None and best.rounded.links is not None and best.rounded.errors is not None:
            r = best.rounded.links
            rounded = " ".join(number(v) for v in (r.crank, r.coupler, r.rocker, r.ground))
            error = units.value(best.rounded.errors.max, units.angle)
            lines.append(f"rounded: {rounded}, largest error {error}")
    if trace := ", ".join(f"{ms:.1f} ms: {value:.1e}" for ms, value in reply.report.trace):
        lines += ["", f"best objective after {trace}"]
    elapsed = ", ".join(f"{name} {value:.1f} ms" for name, value in reply.report.elapsed_ms.items())
    lines.append(f"stopped by {reply.report.stopped_by}; {elapsed}")
    return "\n".join(lines) + "".join(f"\nnote: {note}" for note in reply.report.notes)


LOGARITHM = {"name": "log10", "x": [1, 2], "output_span": 90}
QUERY = Query(
    "/v1/function",
    "function",
    SUMMARIES["function"],
    FunctionRequest,
    la.FunctionResult,
    solve_function,
    function_table,
    {
        "logarithm": {
            "function": LOGARITHM,
            "crank_span": 60,
            "objective": "max",
            "limits": {"transmission_angle_min": 30},
            "top": 3,
        },
        "five_pairs": {"input": [0, 15, 35, 60, 80], "output": [0, 12, 31, 62, 90], "top": 3},
        "square_on_given_ground": {
            "function": {"name": "power", "exponent": 2, "x": [0, 1], "output_span": 90},
            "crank_span": 90,
            "limits": {"preset": "practical", "links": {"ground": 100}},
            "round_to": 0.5,
            "sensitivity": True,
            "curves": True,
            "top": 3,
        },
    },
    {name: Export(media_type, _best(name)) for name, media_type in MEDIA_TYPES.items()},
    is_long=is_long,
    shows_units=True,
)
