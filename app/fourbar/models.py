"""Requests of the queries about linkages; the replies are dataclasses of `linkage_atlas`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from app.fourbar.drive_models import (
    AnalysisRequest,
    DriveRequest,
    Drives,
    LoadRequest,
    RockerRequest,
    Springs,
    ToleranceStudyRequest,
)
from app.fourbar.fields import (
    MAX_KEEP_OUT,
    Box,
    Curve,
    FarPoint,
    Length,
    Mechanisms,
    Point,
    SampledCurve,
    SampledPath,
    Size,
    Tolerance,
    Tolerances,
    Top,
    Travel,
    Weights,
    limits_request,
)
from app.fourbar.parts import GivenDrive, GivenLinkage
from app.query import AngleUnit, Count, Flag, LengthUnit, Number, PositiveNumber, RequestModel
from linkage_atlas.assemblies import FIXED_PINS, LAYERS_MOST, MOST_CORNERS, MOST_LAYERS
from linkage_atlas.geometry import DriverName
from linkage_atlas.limits import LIMITS
from linkage_atlas.motions import MAX_SAMPLES, MOST_STOCK
from linkage_atlas.part_settings import LARGEST_SCALE, LEAST_SCALE
from linkage_atlas.warm_start import MAX_STARTS


class CrankMotion(RequestModel):
    """Crank angles of a request: evenly spaced over a span, or a list."""

    crank_span: Number | None = None
    crank_angle: Curve | None = None
    angle_unit: AngleUnit = "deg"
    """Unit of every angle in request and reply."""

    @property
    def degrees(self) -> bool:
        """True if angles are in degrees."""
        return self.angle_unit == "deg"


class MatchRequest(CrankMotion):
    """A rotation for which the best rows of the atlas are searched."""

    described_by = ("match",)

    rotation: Curve
    top: Top = 10
    budget_ms: PositiveNumber | None = None
    """Return the best found within this time."""


LimitsRequest = limits_request(
    "LimitsRequest",
    "Limits that every solution satisfies.",
    LIMITS,
    "`practical`: transmission angle at least 35 degrees over the used interval and 15 degrees over the full turn, longest "
    "link at most 10 times the shortest, no link and no distance of a pivot from the centre of the motion above 10 times "
    "the extent of the motion. A limit in the request replaces the limit of the preset.",
)


# -- how it is built --------------------------------------------------------------------------------------------------

Rank = Annotated[Count, Field(ge=1, le=100)]


class AssemblyOptions(RequestModel):
    """Sizes and supports of plates and pins for layers and exports; lengths are in the unit of the linkage."""

    described_by = ("Linkage.assembly", "part_settings.PartSettings")

    width: Length | None = None
    hole: Length | None = None
    thickness: Length | None = None
    washer: Size | None = None
    clearance: Size | None = None
    kerf: Size = 0.0
    scale: Annotated[Number, Field(ge=LEAST_SCALE, le=LARGEST_SCALE)] = 1.0
    length_unit: LengthUnit | None = None
    boards: Literal["below", "above", "both", "bar"] = "below"
    pin_heads: Flag = False
    body: Annotated[list[Point], Field(min_length=3, max_length=MOST_CORNERS + 1)] | None = None
    mounts: dict[Literal[FIXED_PINS], Literal["below", "above", "below+above"]] | None = None
    drive: GivenDrive | None = None
    layers_max: Annotated[Count, Field(ge=1, le=MOST_LAYERS)] = LAYERS_MOST
    envelope: Box | None = None
    keep_out: Annotated[list[Box], Field(max_length=MAX_KEEP_OUT)] | None = None


# -- rotation, positions or both ---------------------------------------------------------------------------------------


class WeightsRequest(RequestModel):
    """Weights of the samples, at least 0."""

    rotation: Weights | None = None
    position: Weights | None = None


class TolerancesRequest(RequestModel):
    """Largest allowed errors, for all samples or for each sample."""

    rotation: PositiveNumber | Tolerances | None = None
    position: PositiveNumber | Tolerances | None = None


TwoPoints = Annotated[
    list[Annotated[list[Number], Field(min_length=4, max_length=4)]], Field(min_length=2, max_length=MAX_SAMPLES)
]


class SynthesizeRequest(CrankMotion):
    """A motion of a body, for which linkages are searched, and the limits and preferences of the search."""

    described_by = ("Motion", "synthesize", "Solution.studied")

    rotation: SampledCurve | None = None
    position: SampledPath | None = None
    points: TwoPoints | None = None
    start_angle: Number | None = None
    timing: Literal["free"] | None = None
    order: Literal["given", "any"] = "given"
    closed: Flag = False
    crank_span_max: PositiveNumber | None = None
    travel: Travel | None = None
    travel_span: Number | None = None
    mechanisms: Mechanisms | None = None
    driver: DriverName | None = None
    weights: WeightsRequest | None = None
    tolerances: TolerancesRequest | None = None
    prefer: Literal["error", "balanced", "size", "transmission", "crank_span", "layers"] | None = None
    top: Annotated[Count, Field(ge=1, le=100)] = 10
    effort: Literal["atlas", "refine"] = "refine"
    limits: LimitsRequest = Field(default_factory=LimitsRequest)
    tolerance: Tolerance = 1e-10
    budget_ms: PositiveNumber | None = None
    """Time limit of the search, which returns the best linkages found so far."""
    start_from: Annotated[list[GivenLinkage], Field(min_length=1, max_length=MAX_STARTS)] | None = None
    refine_only: Flag = False
    length_scale: Length | None = None
    round_to: Length | None = None
    lengths_from: Annotated[list[Length], Field(min_length=1, max_length=MOST_STOCK)] | None = None
    diverse: Flag = False
    sensitivity: Flag = False
    analysis: AnalysisRequest | None = None
    tolerance_study: ToleranceStudyRequest | None = None
    load: LoadRequest | None = None
    drives: Drives | None = None
    springs: Springs | None = None
    drive: DriveRequest | None = None
    assembly: Annotated[
        AssemblyOptions | None,
        BeforeValidator(lambda options: ({} if options else None) if isinstance(options, bool) else options),
    ] = Field(None, json_schema_extra=lambda schema: schema["anyOf"].insert(0, {"type": "boolean"}))


# -- a linkage as a file ----------------------------------------------------------------------------------------------

Material = Literal["steel", "stainless", "aluminium", "brass", "plywood", "acrylic", "POM", "PLA", "PETG", "ABS"]


class SolidsRequest(RequestModel):
    """Fits and materials of parts."""

    described_by = ("Linkage.solids",)

    fit: Literal["H7", "print"] = "H7"
    material: Material | None = None
    pins: Material | None = None
    layout: Literal["assembled", "bed"] | None = None
    allow_collisions: Flag = False


class ExportRequest(RequestModel):
    """A motion, a linkage for it, and the format of the file."""

    request: SynthesizeRequest
    """Request of /v2/synthesize; angles are in its unit."""
    linkage: GivenLinkage | None = None
    """One of the reply's solutions, or its like. Without it the request is solved."""
    rank: Rank = 1
    """Rank of the solution, if no linkage is given."""
    format: Literal["json", "csv", "svg", "dxf", "plates", "mjcf", "step", "3mf", "stl", "parts"] = "json"
    """Format of the file. stl: a zip file with a file for each part. parts: a parts list (CSV)."""
    length_unit: LengthUnit | None = None
    """Unit of the lengths of the request, for formats with a unit. Default: the unit of its `analysis`, or mm."""
    assembly: AssemblyOptions | None = None
    """Sizes and supports of plates and pins, for plates and solid parts and for the masses in MJCF. Default: the options of
    the request."""
    solids: SolidsRequest | None = None
    """Fits and materials, for the same formats."""
    drive: GivenDrive | None = None
    """A drive of a reply, which is written as columns of CSV, lines of SVG, a layer of DXF, and parts.
    Default: the first drive of the solution, if the request has drives."""


# -- what drives it, and whether it can be built ----------------------------------------------------------------------


class DrivesRequest(RequestModel):
    """A linkage and its load, for which drives and springs are searched."""

    described_by = ("drives",)

    linkage: GivenLinkage | None = None
    request: SynthesizeRequest | None = None
    """Request that the linkage answers; it defines the used interval."""
    crank_angle: (
        Annotated[list[Annotated[float, Field(ge=-1e9, le=1e9)]], Field(min_length=2, max_length=1024)] | None
    ) = None
    rocker: RockerRequest | None = None
    load: LoadRequest | None = None
    drives: Drives = Field(
        default_factory=lambda: [DriveRequest(kind=kind) for kind in ("rotary", "actuator", "dyad")]
    )
    springs: Springs = Field(default_factory=list)
    hand_point: FarPoint | None = None
    top: Annotated[Count, Field(ge=1, le=50)] = 5
    angle_unit: AngleUnit | None = None
    """Unit of every angle; default: the unit of `request`, or degrees."""
    length_unit: LengthUnit = "mm"
    budget_ms: PositiveNumber | None = None
    """Time limit of the search, which returns the best drives found so far."""


class AssemblyRequest(AssemblyOptions):
    """A linkage whose plates are arranged in layers without collisions over its used interval."""

    linkage: GivenLinkage | None = None
    """One of the solutions of a reply. Without it the request is solved."""
    request: SynthesizeRequest | None = None
    """Request of /v2/synthesize that the linkage answers; angles are in its unit. Default: the crank makes a full turn, and
    angles are in degrees."""
    rank: Rank = 1
    """Rank of the solution, if the request is solved."""
