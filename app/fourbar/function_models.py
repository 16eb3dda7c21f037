"""Requests of the query about functions."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from app.fourbar.fields import Length, Pairs, Tolerance, limits_request
from app.fourbar.parts import GivenGenerator, GivenMaker
from app.query import (
    AngleUnit,
    Count,
    Flag,
    LengthUnit,
    Number,
    PositiveNumber,
    RequestModel,
)
from linkage_atlas.functions.dials import MIN_PAIRS
from linkage_atlas.limits import FUNCTION_LIMITS
from linkage_atlas.motions import MAX_SAMPLES, MIN_SAMPLES
from linkage_atlas.warm_start import MAX_STARTS

NumberPair = Annotated[list[Number], Field(min_length=2, max_length=2)]


class FunctionOfX(RequestModel):
    """A function y = f(x), with linear scales for x and y."""

    name: Literal["log10", "ln", "exp", "power", "sin", "cos", "tan", "reciprocal"] | None = Field(
        None, description="Name of the function; the argument of sin, cos and tan is in `angle_unit`."
    )
    table: Annotated[list[NumberPair], Field(min_length=MIN_PAIRS, max_length=MAX_SAMPLES)] | None = Field(
        None, description="Pairs [x, y], instead of a name."
    )
    x: NumberPair | None = Field(None, description="First and last x.")
    exponent: Number | None = Field(None, description="Exponent of the function `power`.")
    output_span: Number = Field(
        description="Rotation of the rocker from the smallest to the largest y; negative: clockwise from first to last sample."
    )
    samples: Annotated[Count, Field(ge=MIN_SAMPLES, le=MAX_SAMPLES)] | None = Field(
        None, description="Number of samples of a named function; default: 101."
    )


_FunctionLimits: Any = limits_request(
    "_FunctionLimits",
    "Limits that every linkage satisfies.",
    FUNCTION_LIMITS,
    "any",
    "`practical`: transmission angle at least 35 degrees over the interval and 15 degrees over the full turn, longest link "
    "at most 10 times the shortest. A limit in the request replaces the limit of the preset.",
)


class FunctionLimitsRequest(_FunctionLimits):
    """Limits that every linkage satisfies."""

    offset: Number | None = Field(
        None,
        description="Prescribed distance of the rail of a slider-crank from the pivot of the crank; 0: in-line slider-crank.",
    )


FunctionUnit = Literal["deg", "rad", "length"]


MakerKind = Literal["four_bar", "slider_crank", "swinging_block", "rail_slot", "two_rails"]
"""Kinds of linkages that can generate functions."""


class QuickReturnRequest(RequestModel):
    """A slow forward and a fast return motion, driven by a crank that makes full turns at constant speed."""

    stroke: PositiveNumber | None = Field(None, description="Stroke of the slider of a slider-crank.")
    swing: PositiveNumber | None = Field(None, description="Swing of the rocker of a crank-rocker.")
    time_ratio: PositiveNumber = Field(
        description="Ratio of the durations of the slow and the fast motion, at least 1."
    )


class SteeringRequest(RequestModel):
    """Ackermann condition for the front wheels of a car: the axes of all wheels intersect at a point."""

    track: PositiveNumber = Field(
        description="Distance between the two kingpins, which is the ground of the linkage."
    )
    wheelbase: PositiveNumber = Field(description="Distance between the axles.")
    angle: PositiveNumber = Field(description="Largest steering angle of the inner wheel.")


class FunctionRequest(RequestModel):
    """A function, for which linkages are searched whose output follows it."""

    output: Pairs | None = Field(
        None,
        description="Rocker angles, or travel, at the samples; continuous, up to a constant. Decreasing values mean that the "
        "output moves against an increasing input.",
    )
    crank_span: Number | None = Field(
        None,
        description="Crank angle from the first sample to the last; the samples are evenly spaced. Negative: clockwise.",
    )
    travel_span: Number | None = Field(
        None,
        description="Travel of the input from the first sample to the last, if the input is a travel; evenly spaced.",
    )
    input: Pairs | None = Field(
        None,
        description="Crank angles, or travel, instead of the span; only the differences from the first have an effect.",
    )
    input_unit: FunctionUnit | None = Field(
        None,
        description="`length`: the input is the travel of a slider or cylinder. Default: an angle, in `angle_unit`.",
    )
    output_unit: FunctionUnit | None = Field(
        None,
        description="`length`: the output is the travel of a slider or cylinder. Default: an angle, in `angle_unit`.",
    )
    mechanisms: Annotated[list[MakerKind], Field(min_length=1, max_length=5)] | Literal["all"] | None = Field(
        None,
        description="Kinds of mechanisms. Angle to angle: `four_bar`. Angle to length and length to angle: `slider_crank` and "
        "`swinging_block`; length to angle: also `rail_slot`. Length to length: `two_rails`. Default: the first possible kind.",
    )
    function: FunctionOfX | None = Field(None, description="Function by name or table, instead of `output`.")
    quick_return: QuickReturnRequest | None = Field(
        None, description="Stroke or swing and time ratio of a quick-return motion, instead of `output`."
    )
    steering: SteeringRequest | None = Field(
        None,
        description="Symmetric linkage that steers two wheels by the Ackermann condition, instead of `output`.",
    )
    symmetric: Flag = Field(
        False,
        description="The left and the right arm are mirror images, and `input` and `output` are measured from the symmetric "
        "position. The arms have 0.1 to 0.2 of the ground length, unless the limits prescribe lengths.",
    )
    objective: Literal["rms", "max"] = Field(
        "rms", description="Minimize the rms error at the samples, or the largest error over the whole interval."
    )
    input_zero: Number | None = Field(
        None,
        description="Prescribed crank angle at the first sample, measured from the ground line A->B or from the rail; or "
        "prescribed position of the slider or length of the cylinder.",
    )
    output_zero: Number | None = Field(
        None, description="Prescribed output at the first sample, measured in the same manner."
    )
    weights: (
        Annotated[list[Annotated[Number, Field(ge=0)]], Field(min_length=MIN_PAIRS, max_length=MAX_SAMPLES)] | None
    ) = Field(
        None,
        description="Weights of the squared errors; for the objective `max`, weights of the errors, interpolated linearly.",
    )
    one_way: Flag = Field(False, description="The rocker must not reverse within the interval.")
    limits: FunctionLimitsRequest = FunctionLimitsRequest()
    top: Annotated[Count, Field(ge=1, le=100)] = Field(10, description="Number of different linkages to return.")
    tolerance: Tolerance = Field(1e-10, description="Objective below which the search ends.")
    budget_ms: PositiveNumber | None = Field(
        None, description="Time limit of the search, which returns the best linkages found so far."
    )
    round_to: Length | None = Field(
        None,
        description="Also report each solution with its links rounded to multiples of this length and its zeros fitted again.",
    )
    start_from: Annotated[list[GivenGenerator], Field(min_length=1, max_length=MAX_STARTS)] | None = Field(
        None,
        description="Four-bars that are candidates from the first step. Each is refined to its nearest optimum within the "
        "limits; then the search continues.",
    )
    refine_only: Flag = Field(
        False,
        description="Only refine the linkages of `start_from` to their nearest optima; do not search for others.",
    )
    sensitivity: Flag = Field(False, description="Also report the change of the output per unit of each length.")
    curves: Flag = Field(False, description="Also report the error of each solution over the interval.")
    angle_unit: AngleUnit = Field("deg", description="Unit of every angle in request and reply.")


class FunctionExportRequest(RequestModel):
    """A function, a linkage that generates it, and the format of the file."""

    request: FunctionRequest = Field(description="Request of /v2/function; angles are in its unit.")
    linkage: GivenMaker
    format: Literal["json", "csv", "svg", "dxf", "mjcf"] = "json"
    length_unit: LengthUnit = Field("mm", description="Unit of the lengths, for DXF and MJCF.")
