"""Requests of the query about functions."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from app.fourbar.fields import Length, Pairs, Tolerance, limits_request
from app.fourbar.parts import GivenGenerator, GivenMaker
from app.query import AngleUnit, Count, Flag, LengthUnit, Number, PositiveNumber, RequestModel
from linkage_atlas.functions.dials import MIN_PAIRS
from linkage_atlas.limits import FUNCTION_LIMITS
from linkage_atlas.motions import MAX_SAMPLES, MIN_SAMPLES
from linkage_atlas.warm_start import MAX_STARTS

OFFSET = "Prescribed distance of the rail of a slider-crank from the pivot of the crank; 0: in-line slider-crank."
NumberPair = Annotated[list[Number], Field(min_length=2, max_length=2)]


class FunctionOfX(RequestModel):
    """A function y = f(x), with linear scales for x and y."""

    name: Literal["log10", "ln", "exp", "power", "sin", "cos", "tan", "reciprocal"] | None = None
    """Name of the function; the argument of sin, cos and tan is in `angle_unit`."""
    table: Annotated[list[NumberPair], Field(min_length=MIN_PAIRS, max_length=MAX_SAMPLES)] | None = None
    """Pairs [x, y], instead of a name."""
    x: NumberPair | None = None
    """First and last x."""
    exponent: Number | None = None
    """Exponent of the function `power`."""
    output_span: Number
    """Rotation of the rocker from the smallest to the largest y; negative: clockwise from first to last sample."""
    samples: Annotated[Count, Field(ge=MIN_SAMPLES, le=MAX_SAMPLES)] | None = None
    """Number of samples of a named function; default: 101."""


FunctionLimitsRequest: Any = limits_request(
    "FunctionLimitsRequest",
    "Limits that every linkage satisfies.",
    FUNCTION_LIMITS,
    "`practical`: transmission angle at least 35 degrees over the interval and 15 degrees over the full turn, longest link "
    "at most 10 times the shortest. A limit in the request replaces the limit of the preset.",
    offset=(Annotated[Number | None, Field(description=OFFSET)], None),
)


FunctionUnit = Literal["deg", "rad", "length"]


MakerKind = Literal["four_bar", "slider_crank", "swinging_block", "rail_slot", "two_rails"]
"""Kinds of linkages that can generate functions."""


class QuickReturnRequest(RequestModel):
    """A slow forward and a fast return motion, driven by a crank that makes full turns at constant speed."""

    stroke: PositiveNumber | None = None
    """Stroke of the slider of a slider-crank."""
    swing: PositiveNumber | None = None
    """Swing of the rocker of a crank-rocker."""
    time_ratio: PositiveNumber
    """Ratio of the durations of the slow and the fast motion, at least 1."""


class SteeringRequest(RequestModel):
    """Ackermann condition for the front wheels of a car: the axes of all wheels intersect at a point."""

    track: PositiveNumber
    """Distance between the two kingpins, which is the ground of the linkage."""
    wheelbase: PositiveNumber
    """Distance between the axles."""
    angle: PositiveNumber
    """Largest steering angle of the inner wheel."""


class FunctionRequest(RequestModel):
    """A function, for which linkages are searched whose output follows it."""

    described_by = ("function",)

    output: Pairs | None = None
    crank_span: Number | None = None
    travel_span: Number | None = None
    input: Pairs | None = None
    input_unit: FunctionUnit | None = None
    output_unit: FunctionUnit | None = None
    mechanisms: Annotated[list[MakerKind], Field(min_length=1, max_length=5)] | Literal["all"] | None = None
    function: FunctionOfX | None = None
    quick_return: QuickReturnRequest | None = None
    steering: SteeringRequest | None = None
    symmetric: Flag = False
    objective: Literal["rms", "max"] = "rms"
    input_zero: Number | None = None
    output_zero: Number | None = None
    weights: (
        Annotated[list[Annotated[Number, Field(ge=0)]], Field(min_length=MIN_PAIRS, max_length=MAX_SAMPLES)] | None
    ) = None
    one_way: Flag = False
    limits: FunctionLimitsRequest = FunctionLimitsRequest()
    top: Annotated[Count, Field(ge=1, le=100)] = 10
    tolerance: Tolerance = 1e-10
    budget_ms: PositiveNumber | None = None
    """Time limit of the search, which returns the best linkages found so far."""
    round_to: Length | None = None
    start_from: Annotated[list[GivenGenerator], Field(min_length=1, max_length=MAX_STARTS)] | None = None
    refine_only: Flag = False
    sensitivity: Flag = False
    curves: Flag = False
    angle_unit: AngleUnit = "deg"
    """Unit of every angle in request and reply."""


class FunctionExportRequest(RequestModel):
    """A function, a linkage that generates it, and the format of the file."""

    request: FunctionRequest
    """Request of /v2/function; angles are in its unit."""
    linkage: GivenMaker
    format: Literal["json", "csv", "svg", "dxf", "mjcf"] = "json"
    length_unit: LengthUnit = "mm"
    """Unit of the lengths, for DXF and MJCF."""
