"""Function generation over HTTP and on the command line: which linkage's rocker turns as a wanted function of its crank?"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated, Any, Literal

from pydantic import Field

import linkage_atlas as la
from app.fourbar import QUESTIONS
from app.fourbar.answers import SHORT_MS, budget_of
from app.fourbar.durations import seconds_of
from app.fourbar.export import as_json, exports_of, pointing
from app.fourbar.models import (
    Curve,
    GivenGenerator,
    GivenMaker,
    Length,
    limits_request,
)
from app.fourbar.tables import function_table
from app.query import (
    AngleUnit,
    Count,
    Files,
    Flag,
    LengthUnit,
    Number,
    PositiveNumber,
    Query,
    RequestModel,
    Resources,
    bundled_requests,
)
from linkage_atlas.limits import FUNCTION_LIMITS
from linkage_atlas.motions import MAX_SAMPLES, MIN_SAMPLES
from linkage_atlas.tables import function_from_csv

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


_FunctionLimits: Any = limits_request(
    "_FunctionLimits",
    "What every linkage must keep to.",
    FUNCTION_LIMITS,
    "any",
    "Transmission angle 35 degrees (15 over the turn), link ratio 10; a field beside it replaces its value.",
)


class FunctionLimitsRequest(_FunctionLimits):
    """What every linkage must keep to."""

    offset: Number | None = Field(
        None,
        description="Of a slider-crank: distance of the rail from the crank's pivot, as it is given; 0: in line.",
    )


Unit = Literal["deg", "rad", "length"]
MakerKind = Literal["four_bar", "slider_crank", "swinging_block", "rail_slot", "two_rails"]
"""Kinds that make functions."""


class FunctionRequest(RequestModel):
    """Which linkage's output, of rocker, crank or slider, is a wanted function of its input?"""

    output: Curve | None = Field(
        None,
        description="Rocker angles, or travel, at the samples, continuous, up to a constant; falling: against a rising input.",
    )
    crank_span: Number | None = Field(
        None, description="Crank angle from the first sample to the last, evenly spaced; < 0: clockwise."
    )
    travel_span: Number | None = Field(
        None, description="Where the input is a travel: from the first sample to the last, evenly spaced."
    )
    input: Curve | None = Field(
        None,
        description="Crank angles, or travel, in place of the span; what counts is the increment from the first.",
    )
    input_unit: Unit | None = Field(
        None,
        description="`length`: the input is the travel of a slider or cylinder. Default: an angle, in `angle_unit`.",
    )
    output_unit: Unit | None = Field(
        None,
        description="`length`: the output is the travel of a slider or cylinder. Default: an angle, in `angle_unit`.",
    )
    mechanisms: Annotated[list[MakerKind], Field(min_length=1, max_length=5)] | Literal["all"] | None = Field(
        None,
        description="From angle to angle `four_bar`; from angle to length, and back, `slider_crank` and `swinging_block`; from "
        "length to angle `rail_slot` too; from length to length `two_rails`. Default: the first that there is.",
    )
    function: FunctionOfX | None = Field(None, description="A function by name or table in place of `output`.")
    objective: Literal["rms", "max"] = Field(
        "rms", description="Make least the rms error at the samples, or the largest error over the whole interval."
    )
    input_zero: Number | None = Field(
        None,
        description="Crank angle at the first sample, from the ground line A->B or the rail; or the place of slider or cylinder.",
    )
    output_zero: Number | None = Field(None, description="The output that is wanted there, measured alike.")
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
    return la.function(
        **request.given(but=("angle_unit", "budget_ms")),
        budget=budget_of(request.budget_ms, resources),
        degrees=request.angle_unit == "deg",
        work=resources.work,
    )


def is_long(request: FunctionRequest) -> bool:
    if "length" in (request.input_unit, request.output_unit):
        return request.budget_ms is None or request.budget_ms > SHORT_MS
    return request.round_to is not None or request.top > 20 or seconds_of(request) > SHORT_MS / 1000


class FunctionExportRequest(RequestModel):
    """A function, one of its linkages, and the kind of file that is wanted."""

    request: FunctionRequest = Field(description="The request of /v1/function; angles are in its unit.")
    solution: GivenMaker
    format: Literal["json", "csv", "svg", "dxf", "mjcf"] = "json"
    length_unit: LengthUnit = Field("mm", description="The unit of the lengths, for DXF and MJCF.")


def _function_file(body: FunctionExportRequest, resources: Resources) -> bytes:
    from linkage_atlas.functions import TravelMotion, read_dial, read_wanted, render_function, render_travel

    request, solution = body.request, body.solution
    if body.format == "json":
        return as_json(request, solution.model_dump(mode="json"))
    degrees = request.angle_unit == "deg"
    asked = request.given("input", "function")
    with pointing(lambda field: "/solution" + field):
        given = solution.linkage(degrees)
    with pointing(lambda field: "/request" + field):
        dial = read_dial(request.input_unit, request.output_unit, degrees)
        if dial.travels != isinstance(given, la.GuidedLinkage):
            raise la.FieldError("/output_unit", "the solution belongs to a request of another unit")
        if dial.travels:
            span = request.crank_span if dial.input == "angle" else request.travel_span
            motion = TravelMotion(request.output, span, **asked, dial=dial, degrees=degrees)
    if isinstance(given, la.GuidedLinkage):
        return render_travel(
            motion.wanted, motion.scales, dial, given, solution.output_offset, body.format, body.length_unit
        ).encode()
    with pointing(lambda field: "/request" + field):
        wanted, _ = read_wanted(request.output, request.crank_span, **asked, degrees=degrees)
    made = SimpleNamespace(linkage=given, output_offset=solution.output_offset)
    return render_function(wanted, made, body.format, body.length_unit, degrees).encode()


FUNCTION_FILES = Files(
    "/v1/function/export",
    "export_function",
    "function",
    "A function generator as a file: JSON, CSV, SVG, DXF or MJCF.",
    FunctionExportRequest,
    _function_file,
    bundled_requests()["export_function"],
)
QUERIES = (
    Query(
        "function",
        QUESTIONS["function"],
        solve_function,
        function_table,
        exports=exports_of(
            ("csv", "svg", "dxf", "mjcf"),
            lambda request, resources, kind: solve_function(request, resources).render(kind).encode(),
        ),
        from_csv=function_from_csv,
        is_long=is_long,
        files=FUNCTION_FILES,
    ),
)
