"""Requests of the queries about linkages; the replies are dataclasses of `linkage_atlas`."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, Strict

from app.fourbar.drive_models import (
    AnalysisRequest,
    DriveLoadRequest,
    DriveRequest,
    Drives,
    RockerRequest,
    Springs,
    ToleranceStudyRequest,
)
from app.fourbar.fields import (
    MAX_KEEP_OUT,
    Box,
    Curve,
    Length,
    MatchedKind,
    Mechanisms,
    PlacePair,
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
from app.query import (
    AngleUnit,
    Count,
    Flag,
    LengthUnit,
    Number,
    PositiveNumber,
    RequestModel,
)
from linkage_atlas.assemblies import FIXED_PINS, LAYERS_MOST, MOST_CORNERS, MOST_LAYERS
from linkage_atlas.geometry import DriverName
from linkage_atlas.limits import LIMITS
from linkage_atlas.motions import MAX_SAMPLES, MOST_STOCK
from linkage_atlas.part_settings import LARGEST_SCALE, LEAST_SCALE
from linkage_atlas.warm_start import MAX_STARTS


class CrankMotion(RequestModel):
    """Crank angles of a request: evenly spaced over a span, or a list."""

    crank_span: Number | None = Field(
        None,
        description="Crank angle from the first sample to the last; the samples are evenly spaced. Negative: clockwise.",
    )
    crank_angle: Curve | None = Field(
        None,
        description="Crank angles instead of `crank_span`; only their differences from the first have an effect.",
    )
    angle_unit: AngleUnit = Field("deg", description="Unit of every angle in request and reply.")

    @property
    def degrees(self) -> bool:
        """True if angles are in degrees."""
        return self.angle_unit == "deg"


class MatchRequest(CrankMotion):
    """A rotation for which the best rows of the atlas are searched."""

    rotation: Curve = Field(
        description="Rotation of the body at the samples; continuous, without jumps by full turns."
    )
    curve: Literal["coupler", "rocker"] = Field(
        "coupler",
        description="Link with this rotation: the coupler, or the rocker, whose angle is measured from the line of the pivots.",
    )
    mechanisms: Annotated[list[MatchedKind], Field(min_length=1, max_length=2)] | Literal["all"] = Field(
        ["four_bar"],
        description="Kinds of mechanisms to compare: coupler of a four-bar, connecting rod of a slider-crank.",
    )
    top: Top = Field(10, description="Number of rows to return.")
    features: Flag = Field(
        False, description="Also return the Haar average and details of the request and of each match."
    )
    budget_ms: PositiveNumber | None = Field(None, description="Return the best found within this time.")


LimitsRequest = limits_request(
    "LimitsRequest",
    "Limits that every solution satisfies.",
    LIMITS,
    "full_crank",
    "`practical`: transmission angle at least 35 degrees over the used interval and 15 degrees over the full turn, longest "
    "link at most 10 times the shortest, no link and no distance of a pivot from the centre of the motion above 10 times "
    "the extent of the motion. A limit in the request replaces the limit of the preset.",
)


# -- how it is built --------------------------------------------------------------------------------------------------

Rank = Annotated[Count, Field(ge=1, le=100)]


class AssemblyOptions(RequestModel):
    """Sizes and supports of plates and pins for layers and exports; lengths are in the unit of the linkage."""

    width: Length | None = Field(
        None, description="Width of the plates. Default: 2.5 hole diameters, rounded to whole millimetres."
    )
    hole: Length | None = Field(
        None,
        description="Diameter of the pins. Default: the largest standard diameter up to 0.3 of the shortest and 0.05 of the "
        "longest link; smaller if `body` or the pin of a rod requires it.",
    )
    thickness: Length | None = Field(
        None, description="Thickness of the plates. Default: the standard sheet nearest to half a hole diameter."
    )
    washer: Size | None = Field(
        None,
        description="Thickness of the washers between two layers. Default: a fifth of the thickness of the plates.",
    )
    clearance: Size | None = Field(
        None,
        description="Smallest gap between parts that pass each other. Default: 0.5 / 165 of the longest link.",
    )
    kerf: Size = Field(
        0.0,
        description="Width of the cut; contours of plates to cut are offset outwards by half of it, holes inwards.",
    )
    scale: Annotated[Number, Field(ge=LEAST_SCALE, le=LARGEST_SCALE)] = Field(
        1.0, description="Scale of the parts in all files; clearances and `kerf` are not scaled."
    )
    length_unit: LengthUnit | None = Field(
        None,
        description="Unit of the lengths, needed for default sizes, which are standard millimetre sizes. Default: the unit of "
        "the file, or mm.",
    )
    boards: Literal["below", "above", "both", "bar"] = Field(
        "below",
        description="Support of the fixed pins: a board below the links, a board above the links, a board on each side, or a "
        "bar, which is a plate like the links.",
    )
    pin_heads: Flag = Field(
        False, description="Give the pins heads of 1.8 pin diameters, in an additional layer at each free end."
    )
    body: Annotated[list[Point], Field(min_length=3, max_length=MOST_CORNERS + 1)] | None = Field(
        None,
        description="Outline of the body, a plate on the coupler: corners [x, y] in the frame of the body, which has the "
        "requested position and rotation (or, without a requested rotation, the axes of the ground at the first sample).",
    )
    mounts: dict[Literal[FIXED_PINS], Literal["below", "above", "below+above"]] | None = Field(
        None, description="Required supports of the fixed pins."
    )
    drive: GivenDrive | None = Field(
        None,
        description="A drive of a reply of /v2/drives. A cylinder or a latch adds two plates. A motor and its rod also add two "
        "plates, and the assembly is then checked over a full turn of the motor.",
    )
    layers_max: Annotated[Count, Field(ge=1, le=MOST_LAYERS)] = Field(
        LAYERS_MOST, description="Largest number of layers."
    )
    envelope: Box | None = Field(
        None,
        description="Box that contains all plates: xmin, ymin, xmax, ymax. Default: the envelope in the limits of the request.",
    )
    keep_out: Annotated[list[Box], Field(max_length=MAX_KEEP_OUT)] | None = Field(
        None, description="Boxes that no plate may enter. Default: the boxes in the limits of the request."
    )


def _with_defaults(options: Any) -> Any:
    """Replace true by the default options and false by no options."""
    return ({} if options else None) if isinstance(options, bool) else options


def _or_a_flag(schema: dict[str, Any]) -> None:
    schema["anyOf"].insert(0, {"type": "boolean"})


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

    rotation: SampledCurve | None = Field(
        None, description="Rotation of the body at the samples, continuous; null: not prescribed at this sample."
    )
    position: SampledPath | None = Field(
        None,
        description="Positions [x, y] of a point of the body, in any unit of length; null: not prescribed at this sample.",
    )
    points: TwoPoints | None = Field(
        None,
        description="Two points [x1, y1, x2, y2] of the body at each sample, instead of `rotation` and `position`. The first is "
        "the body point; the rotation is the direction from the first to the second.",
    )
    start_angle: Number | None = Field(
        None,
        description="Crank angle at the first sample, measured from the ground line A->B, if the crank angles are prescribed; "
        "default: optimized.",
    )
    timing: Literal["free"] | None = Field(
        None,
        description="free: the crank angles are unknown; do not give `crank_span` or `crank_angle`. Two samples are enough. "
        "Default: free if there are positions, but neither crank angles nor a travel.",
    )
    order: Literal["given", "any"] = Field(
        "given",
        description="With free timing: pass the samples in the order of the request while the crank turns in one direction, or "
        "in any order.",
    )
    closed: Flag = Field(
        False, description="With free timing: the motion continues from the last sample to the first sample."
    )
    crank_span_max: PositiveNumber | None = Field(
        None, description="With free timing: largest rotation of the crank from the first sample to the last."
    )
    travel: Travel | None = Field(
        None,
        description="Travel of the slider or extension of the cylinder at each sample, instead of crank angles, for linkages "
        "with sliders; only the differences from the first have an effect. Positive: a cylinder extends.",
    )
    travel_span: Number | None = Field(
        None,
        description="Travel from the first sample to the last; the samples are evenly spaced. Negative: a cylinder retracts.",
    )
    mechanisms: Mechanisms | None = Field(
        None,
        description="Kinds of mechanisms; default: only `four_bar`. With several kinds, the reply contains the linkages that no "
        "linkage with the same driver surpasses in error, size and transmission angle at once.",
    )
    driver: DriverName | None = Field(None, description="Kind of driver that all linkages must have.")
    weights: WeightsRequest | None = Field(None, description="Weights of the samples; default: all equal.")
    tolerances: TolerancesRequest | None = Field(
        None,
        description="Largest allowed errors; the status is `reached` if a linkage satisfies them at every sample.",
    )
    prefer: Literal["error", "balanced", "size", "transmission", "crank_span", "layers"] | None = Field(
        None,
        description="Criterion by which accurate linkages are ranked. error: smallest error. balanced: compromise between size, "
        "transmission angle and crank rotation. size: smallest links and reach. transmission: largest transmission angle. "
        "crank_span: smallest crank rotation. layers: no part passes over a fixed pivot. Default: `balanced` with free crank "
        "angles, `size` with tolerances, otherwise `error`.",
    )
    top: Annotated[Count, Field(ge=1, le=100)] = Field(10, description="Number of different linkages to return.")
    effort: Literal["atlas", "refine"] = Field(
        "refine", description="refine: optimize the linkages. atlas: return the best rows of the atlas, mounted."
    )
    limits: LimitsRequest = Field(default_factory=LimitsRequest)
    tolerance: Tolerance = Field(1e-10, description="Objective below which the search ends.")
    budget_ms: PositiveNumber | None = Field(
        None, description="Time limit of the search, which returns the best linkages found so far."
    )
    start_from: Annotated[list[GivenLinkage], Field(min_length=1, max_length=MAX_STARTS)] | None = Field(
        None,
        description="Linkages that are candidates from the first step, for example the displayed solution while a motion is "
        "edited. Each is refined within the limits: with `prefer` balanced no further than needed, otherwise to its nearest "
        "optimum. Then the search continues. `report.start_from_ranks` has the rank of each result. With free timing, a four-bar "
        "must have `mount` or `joints`, and `crank_angle` if it is known.",
    )
    refine_only: Flag = Field(
        False,
        description="Only refine the linkages of `start_from` to their nearest optima; do not search for others.",
    )
    length_scale: Length | None = Field(
        None,
        description="Length at which a position error counts as much as a rotation error of one radian. Default: the largest "
        "distance of a position from the mean position.",
    )
    round_to: Length | None = Field(
        None,
        description="Also report each solution with its links rounded to multiples of this length and its other dimensions "
        "fitted again, within the limits.",
    )
    lengths_from: Annotated[list[Length], Field(min_length=1, max_length=MOST_STOCK)] | None = Field(
        None,
        description="Stock lengths from which the links are selected in the best combination, instead of `round_to`.",
    )
    diverse: Flag = Field(
        False,
        description="For four-bars only: return solutions of different families, branches and mounting positions with at most "
        "twice the smallest objective.",
    )
    sensitivity: Flag = Field(False, description="Also report the change of the motion per unit of each length.")
    analysis: AnalysisRequest | None = Field(
        None, description="Also report velocities, accelerations and, with a load, torque and pin forces."
    )
    tolerance_study: ToleranceStudyRequest | None = Field(
        None, description="Also report the effect of manufacturing tolerances on the motion of the body."
    )
    load: DriveLoadRequest | None = Field(None, description="Load for `drives`, `springs` and `drive`.")
    drives: Drives | None = Field(None, description="Also report the best drive of each of these kinds.")
    springs: Springs | None = Field(None, description="Also report springs that balance the load.")
    drive: DriveRequest | None = Field(
        None, description="Rank solutions with such a drive before solutions without, and report the drive."
    )
    assembly: Annotated[AssemblyOptions | None, BeforeValidator(_with_defaults)] = Field(
        None,
        description="Also search for layers in which the parts of each solution do not collide, and rank solutions with such "
        "layers first; true: with default sizes.",
        json_schema_extra=_or_a_flag,
    )


# -- a linkage as a file ----------------------------------------------------------------------------------------------

Material = Literal["steel", "stainless", "aluminium", "brass", "plywood", "acrylic", "POM", "PLA", "PETG", "ABS"]


class SolidsRequest(RequestModel):
    """Fits and materials of parts."""

    fit: Literal["H7", "print"] = Field(
        "H7",
        description="H7: nominal sizes, with tolerances in the parts list. print: with clearance for a printer, 0.4 mm in holes "
        "that turn and 0.1 mm in holes that hold the pin.",
    )
    material: Material | None = Field(
        None, description="Material of plates and boards. Default: aluminium; PLA for printing."
    )
    pins: Material | None = Field(
        None, description="Material of pins, washers and heads. Default: steel; PLA for printing."
    )
    fillet: Size = Field(0.0, description="Radius at the convex corners of the body, in the unit of the lengths.")
    layout: Literal["assembled", "bed"] | None = Field(
        None,
        description="Arrangement of the parts in STEP and 3MF. Default: assembled in STEP, side by side on the print bed in 3MF.",
    )
    allow_collisions: Flag = Field(False, description="Write the file even if parts collide.")


class ExportRequest(RequestModel):
    """A motion, a linkage for it, and the format of the file."""

    request: SynthesizeRequest = Field(description="Request of /v2/synthesize; angles are in its unit.")
    linkage: GivenLinkage | None = Field(
        None, description="One of the reply's solutions, or its like. Without it the request is solved."
    )
    rank: Annotated[int, Strict(), Field(ge=1, le=100)] = Field(
        1, description="Rank of the solution, if no linkage is given."
    )
    format: Literal[
        "json", "csv", "svg", "dxf", "plates", "mjcf", "pylinkage", "step", "3mf", "stl", "urdf", "sdf", "parts"
    ] = Field(
        "json",
        description="Format of the file. stl: a zip file with a file for each part. parts: a parts list (CSV).",
    )
    length_unit: LengthUnit | None = Field(
        None,
        description="Unit of the lengths of the request, for formats with a unit. Default: the unit of its `analysis`, or mm.",
    )
    assembly: AssemblyOptions | None = Field(
        None,
        description="Sizes and supports of plates and pins, for plates and solid parts and for the masses in MJCF. Default: the "
        "options of the request.",
    )
    solids: SolidsRequest | None = Field(None, description="Fits and materials, for the same formats.")
    drive: GivenDrive | None = Field(
        None,
        description="A drive of a reply, which is written as columns of CSV, lines of SVG, a layer of DXF, the drive of MJCF, "
        "and parts. Default: the first drive of the solution, if the request has drives.",
    )


# -- what drives it, and whether it can be built ----------------------------------------------------------------------


class DrivesRequest(RequestModel):
    """A linkage and its load, for which drives and springs are searched."""

    linkage: GivenLinkage | None = Field(
        None, description="One of the `solutions` of a reply, as it came or changed."
    )
    request: SynthesizeRequest | None = Field(
        None, description="Request that the linkage answers; it defines the used interval."
    )
    crank_angle: (
        Annotated[list[Annotated[float, Field(ge=-1e9, le=1e9)]], Field(min_length=2, max_length=1024)] | None
    ) = Field(
        None, description="Crank angles, or travel of the driver, measured from the start, instead of `request`."
    )
    rocker: RockerRequest | None = Field(None, description="A link on a hinge, instead of a linkage.")
    load: DriveLoadRequest | None = Field(
        None, description="Load; without a load, drives with the largest minimum moment arm are best."
    )
    drives: Drives = Field(
        default_factory=lambda: [DriveRequest(kind=kind) for kind in ("rotary", "actuator", "dyad")],
        description="Kinds of drives to search; default: rotary, actuator and dyad.",
    )
    springs: Springs = Field(default_factory=list, description="Springs that balance the load.")
    hand_point: PlacePair | None = Field(
        None,
        description="Point of the body, at the first position, at which the hand force with springs is computed.",
    )
    top: Annotated[Count, Field(ge=1, le=50)] = Field(5, description="Number of drives of each kind to return.")
    angle_unit: AngleUnit | None = Field(
        None, description="Unit of every angle; default: the unit of `request`, or degrees."
    )
    length_unit: LengthUnit = Field("mm", description="Unit of all lengths, for the bundled catalogues.")
    budget_ms: PositiveNumber | None = Field(
        None, description="Time limit of the search, which returns the best drives found so far."
    )


class AssemblyRequest(AssemblyOptions):
    """A linkage whose plates are arranged in layers without collisions over its used interval."""

    linkage: GivenLinkage | None = Field(
        None, description="One of the solutions of a reply. Without it the request is solved."
    )
    request: SynthesizeRequest | None = Field(
        None,
        description="Request of /v2/synthesize that the linkage answers; angles are in its unit. Default: the crank makes a full "
        "turn, and angles are in degrees.",
    )
    rank: Rank = Field(1, description="Rank of the solution, if the request is solved.")
