"""Requests of the queries about linkages; the replies are dataclasses of `linkage_atlas`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, get_args

from pydantic import BeforeValidator, ConfigDict, Field, Strict, WithJsonSchema, create_model

import linkage_atlas as la
from app.query import (
    AngleUnit,
    Count,
    Flag,
    LengthUnit,
    Number,
    PositiveNumber,
    RequestModel,
)
from linkage_atlas.analysis import MOST_LINK_MASSES
from linkage_atlas.arguments import LARGEST
from linkage_atlas.assemblies import FIXED_PINS, LAYERS_MOST, MOST_CORNERS, MOST_LAYERS
from linkage_atlas.catalogues import ACTUATORS, MOST_ROWS, MOST_SPRING_ROWS, SPRINGS
from linkage_atlas.drive_design.question import MAX_COUNT, MAX_DRIVES, MAX_MASSES, MAX_SPRINGS, MAX_WANTED
from linkage_atlas.functions.dials import MIN_PAIRS
from linkage_atlas.geometry import DriverName, KindName
from linkage_atlas.limits import FUNCTION_LIMITS, LIMITS
from linkage_atlas.mechanism_types import MECHANISMS
from linkage_atlas.motions import MAX_LENGTH, MAX_SAMPLES, MIN_LENGTH, MIN_POSES, MIN_SAMPLES, MOST_STOCK
from linkage_atlas.part_settings import LARGEST_SCALE, LEAST_SCALE
from linkage_atlas.tolerance_study import FEWEST_SAMPLES, MOST_SAMPLES, SAMPLES
from linkage_atlas.warm_start import MAX_STARTS

MAX_TOP = 1000


Curve = Annotated[list[Number], Field(min_length=MIN_SAMPLES, max_length=MAX_SAMPLES)]


Coordinate = Annotated[Number, Field(ge=-MAX_LENGTH, le=MAX_LENGTH)]


Length = Annotated[Number, Field(ge=MIN_LENGTH, le=MAX_LENGTH)]


Point = Annotated[list[Coordinate], Field(min_length=2, max_length=2)]


Box = Annotated[list[Coordinate], Field(min_length=4, max_length=4)]


MAX_KEEP_OUT = 20


Pairs = Annotated[list[Number], Field(min_length=MIN_PAIRS, max_length=MAX_SAMPLES)]


SampledCurve = Annotated[list[Number | None], Field(min_length=MIN_POSES, max_length=MAX_SAMPLES)]


SampledPath = Annotated[list[Point | None], Field(min_length=MIN_POSES, max_length=MAX_SAMPLES)]


Weights = Annotated[list[Annotated[Number, Field(ge=0)]], Field(min_length=MIN_POSES, max_length=MAX_SAMPLES)]


Tolerances = Annotated[list[PositiveNumber], Field(min_length=MIN_POSES, max_length=MAX_SAMPLES)]


Travel = Annotated[list[Coordinate], Field(min_length=MIN_POSES, max_length=MAX_SAMPLES)]


Mechanisms = Annotated[
    list[KindName],
    Field(min_length=1, max_length=8),
    BeforeValidator(
        lambda given: list(MECHANISMS) if given == "all" else [given] if isinstance(given, str) else given
    ),
    WithJsonSchema(
        {
            "anyOf": [
                {"const": "all", "type": "string"},
                {
                    "items": {"enum": list(get_args(KindName)), "type": "string"},
                    "maxItems": 8,
                    "minItems": 1,
                    "type": "array",
                },
            ]
        }
    ),
]


Top = Annotated[Count, Field(ge=1, le=MAX_TOP)]


Tolerance = Annotated[Number, Field(ge=0, le=1)]


MatchedKind = Literal["four_bar", "slider_crank"]
"""Kinds of mechanisms for which an atlas exists."""


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


class LinksRequest(RequestModel):
    """Prescribed lengths of links."""

    crank: Length | None = None
    coupler: Length | None = None
    rocker: Length | None = None
    ground: Length | None = Field(
        None, description="Length of the ground; required for a function generator if another length is prescribed."
    )


_FORMS: dict[str, Any] = {
    "family": Literal["full_crank", "crank_rocker", "double_crank", "any"],
    "angle": Number | None,
    "length": Length | None,
    "ratio": PositiveNumber | None,
    "links": LinksRequest | None,
    "point": Point | None,
    "box": Box | None,
    "boxes": Annotated[list[Box], Field(max_length=MAX_KEEP_OUT)] | None,
}
"""What a request may hold for a limit of each kind, see `synthesis.limits.Form`."""


def limits_request(name: str, doc: str, forms: Mapping[str, Any], family: str, preset: str) -> Any:
    """The model of limits: fields as `synthesis.limits.Limits` states them, and a set of limits by name."""
    fields: dict[str, Any] = {
        one: (_FORMS[form.kind], Field(family if one == "family" else None, description=form.says))
        for one, form in forms.items()
    }
    fields["preset"] = (Literal["practical", "none"] | None, Field(None, description=preset))
    return create_model(name, __base__=RequestModel, __module__=__name__, __doc__=doc, **fields)


LimitsRequest = limits_request(
    "LimitsRequest",
    "Limits that every solution satisfies.",
    LIMITS,
    "full_crank",
    "`practical`: transmission angle at least 35 degrees over the used interval and 15 degrees over the full turn, longest "
    "link at most 10 times the shortest, no link and no distance of a pivot from the centre of the motion above 10 times "
    "the extent of the motion. A limit in the request replaces the limit of the preset.",
)


# -- a linkage that a request brings along -----------------------------------------------------------------------------

FarLength = Annotated[Number, Field(ge=1e-100, le=1e100)]


FarCoordinate = Annotated[Number, Field(ge=-1e100, le=1e100)]


FarPoint = Annotated[list[FarCoordinate], Field(min_length=2, max_length=2)]


Angle = Annotated[Number, Field(ge=-1e9, le=1e9)]


class _ReplyPart(RequestModel):
    """Part of a reply that a client sends back; unknown fields are ignored, so that a solution can be sent unchanged."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class GivenLinks(_ReplyPart):
    crank: FarLength
    coupler: FarLength
    rocker: FarLength
    ground: FarLength


class GivenCouplerPoint(_ReplyPart):
    radius: Annotated[Number, Field(ge=0, le=1e100)]
    angle: Angle


class GivenMount(_ReplyPart):
    ground_angle: Angle
    pivot_a: Annotated[list[FarCoordinate], Field(min_length=2, max_length=2)]
    coupler_point: GivenCouplerPoint


class GivenJoints(_ReplyPart):
    """Joints of a four-bar at its first sample: pivots A and B, crank pin D, coupler pin C, and optionally the body point P."""

    A: FarPoint
    D: FarPoint
    C: FarPoint
    B: FarPoint
    P: FarPoint | None = None
    rotation: Angle = Field(default=0.0, description="Rotation of the body in this position.")


class GivenGuide(_ReplyPart):
    """A guide of a solution with rails or slots; the fields that its kind requires are checked when it is used."""

    guide: Literal["circle", "rail", "slot"]
    body_point: FarPoint
    pivot: FarPoint | None = None
    radius: FarLength | None = None
    point: FarPoint | None = None
    direction: Angle | None = None
    pin: FarPoint | None = None
    body_direction: Angle | None = None


class GivenSizes(_ReplyPart):
    crank: FarLength | None = None
    coupler: FarLength | None = None
    handle: FarLength | None = None
    strut: FarLength | None = None


class GivenDriveCurve(_ReplyPart):
    knee: Annotated[list[FarPoint | None], Field(max_length=2000)] | None = None


class GivenDrive(_ReplyPart):
    """A drive of a reply, unchanged or edited."""

    kind: Literal["rotary", "actuator", "dyad", "toggle"]
    link: Annotated[str, Field(max_length=40)]
    on: Annotated[str, Field(max_length=40)] | None = None
    ground_point: FarPoint | None = None
    motor: FarPoint | None = None
    pin_on_link: FarPoint | None = None
    pin: FarPoint | None = None
    retracted: FarLength | None = None
    stroke: FarLength | None = None
    extends: Flag | None = None
    six_bar: GivenSizes | None = None
    lock: GivenSizes | None = None
    curve: GivenDriveCurve | None = None


class GivenLinkage(_ReplyPart):
    """A solution of a reply or a linkage in the same form: a four-bar has `links` or `joints`, others `guides` and `driver`."""

    joints: GivenJoints | None = None
    links: GivenLinks | None = None
    branch: Literal[-1, 1] | None = None
    start_angle: Angle | None = None
    body_offset: Angle | None = None
    mount: GivenMount | None = None
    driver: DriverName | None = None
    guides: Annotated[list[GivenGuide], Field(min_length=2, max_length=2)] | None = None
    start: FarCoordinate | None = None
    crank_angle: Annotated[list[Angle], Field(min_length=MIN_POSES, max_length=MAX_SAMPLES)] | None = None
    travel: Annotated[list[FarCoordinate], Field(min_length=MIN_POSES, max_length=MAX_SAMPLES)] | None = None
    drives: Annotated[list[GivenDrive], Field(max_length=400)] | None = None

    def linkage(self, degrees: bool) -> la.Linkage:
        """Return the linkage; raise `FieldError` with the name of a missing field."""
        if self.joints is not None:
            return la.Linkage.from_dict({"joints": self.joints.model_dump()}, degrees)
        if self.links is None and self.guides is None:
            raise la.FieldError(
                "/links", "needed, or `joints`, or two `guides` with their `driver`, `branch` and `start`"
            )
        if self.links is None:
            return la.Linkage.from_dict(self.model_dump(exclude_none=True), degrees)
        for name in ("branch", "start_angle"):
            if getattr(self, name) is None:
                raise la.FieldError(f"/{name}", "needed beside `links`")
        return la.Linkage.from_dict(self.model_dump(), degrees)


class GivenGenerator(GivenLinkage):
    """A solution of a reply of /v1/function, or a linkage in the same form."""

    output_offset: FarCoordinate | None = None


class GivenMaker(GivenLinkage):
    """A solution of a reply of /v1/function: a four-bar with `links`, or a linkage with a slider and `guides`."""

    output_offset: FarCoordinate


# -- what a designer asks of a linkage next ----------------------------------------------------------------------------

Size = Annotated[Number, Field(ge=0, le=MAX_LENGTH)]


Bounded = Annotated[Number, Field(ge=-LARGEST, le=LARGEST)]


Pair = Annotated[list[Bounded], Field(min_length=2, max_length=2)]


class LinkMassRequest(RequestModel):
    """A mass on a link."""

    link: Literal["crank", "coupler", "rocker", "body", "slider", "block", "second_slider", "second_block"]
    mass: Annotated[Number, Field(gt=0, le=LARGEST)] = Field(description="Mass in kg.")
    at: Pair | None = Field(
        None,
        description="Centre of mass [x, y] in the frame of the link. The origin is its first joint (crank: pivot A, coupler: "
        "crank pin, rocker: pivot B) and the x axis points to the second; the frame of the body has its point as origin and "
        "its rotation.",
    )
    inertia: Annotated[Number, Field(ge=0, le=LARGEST)] = Field(
        0.0, description="Moment of inertia about the centre of mass, kg times length squared."
    )


class LoadRequest(RequestModel):
    """Load on the body, in directions that do not rotate with it."""

    force: Pair | None = Field(None, description="Force [fx, fy] at the body point.")
    torque: Bounded = Field(0.0, description="Torque, positive counter-clockwise: force times length.")
    masses: Annotated[list[LinkMassRequest], Field(max_length=MOST_LINK_MASSES)] | None = Field(
        None, description="Masses of the links; forces are then in newtons."
    )
    parts: Flag = Field(
        False, description="Add the weight of the plates and pins of each linkage, with their default sizes."
    )
    gravity: Pair | None = Field(
        None, description="Gravity [gx, gy] that acts on the masses, m/s^2; default: [0, -9.81]."
    )


class AnalysisRequest(RequestModel):
    """Speed of the crank and load of the body for an analysis."""

    crank_speed: Bounded = Field(
        description="Constant speed of the crank, in units of angle per second; negative: clockwise."
    )
    load: LoadRequest | None = Field(None, description="Load, to compute the torque or force of the drive and the pin forces.")
    length_unit: LengthUnit = Field("mm", description="Unit of lengths, from which inertia forces are computed.")


class ToleranceStudyRequest(RequestModel):
    """Manufacturing tolerances, in the unit of the positions."""

    links: Size = Field(
        0.0, description="Half width of the uniform distribution of each length about its nominal value."
    )
    pivots: Size = Field(0.0, description="Half width of the distribution of each coordinate of a fixed pivot.")
    clearance: Size = Field(
        0.0, description="Clearance of all four joints: diameter of the hole minus diameter of the pin."
    )
    samples: Annotated[Count, Field(ge=FEWEST_SAMPLES, le=MOST_SAMPLES)] = Field(
        SAMPLES, description="Number of random linkages."
    )
    seed: Annotated[Count, Field(ge=0, le=2**32 - 1)] = Field(
        0, description="Seed of the random numbers; equal seeds give equal results."
    )


# -- what drives it ----------------------------------------------------------------------------------------------------

Above = Annotated[Number, Field(gt=0, le=MAX_LENGTH)]


Words = Annotated[str, Field(max_length=100_000)]


LinkName = Annotated[str, Field(max_length=40)]


LinkNames = Annotated[list[LinkName], Field(min_length=1, max_length=4)]


PlacePair = Annotated[list[FarCoordinate], Field(min_length=2, max_length=2)]


class MassRequest(RequestModel):
    """A mass on a link."""

    link: LinkName | None = Field(None, description="Link: `body` (default), `crank`, `coupler` or `rocker`.")
    mass: Annotated[Number, Field(ge=0, le=LARGEST)]
    at: PlacePair | None = Field(
        None,
        description="Centre of mass in the frame of the link; the origin of the body's frame is the body point. Default: the "
        "midpoint of the link, or the body point.",
    )
    inertia: Annotated[Number, Field(ge=0, le=LARGEST)] | None = Field(
        None, description="Moment of inertia about the centre of mass."
    )


class PointForceRequest(RequestModel):
    """A force at a point of a link, in a direction that does not rotate with the link."""

    link: LinkName = Field(description="Link: `crank`, `coupler`, `rocker` or `body`.")
    at: PlacePair | None = Field(
        None, description="Point in the frame of the link. Default: the midpoint of the link."
    )
    force: Pair = Field(description="Force [fx, fy].")


class DriveLoadRequest(LoadRequest):
    """Load on the body and on the links, in directions that do not rotate with them."""

    forces: Annotated[list[PointForceRequest], Field(max_length=MAX_MASSES)] | None = Field(
        None, description="Forces at points of links."
    )

    torque: Bounded | None = Field(
        None, description="Torque on the body, positive counter-clockwise: force times length."
    )
    masses: Annotated[list[MassRequest], Field(max_length=MAX_MASSES)] | None = None
    parts: Flag = Field(
        False, description="For /v1/drives: add the weight of the plates and pins of the linkage, with default sizes."
    )
    speed: Bounded | None = Field(
        None, description="Constant speed of the crank, to include the inertia forces of the masses."
    )


class CatalogueRow(RequestModel):
    """A row of a catalogue of actuators (retracted, stroke, ...) or of springs."""

    name: Annotated[str, Field(max_length=200)] | None = None
    retracted: Above | None = None
    stroke: Above | None = None
    force: Above | None = Field(
        None, description="Largest pushing force of an actuator, or force of an extended gas spring."
    )
    pull: Above | None = Field(
        None, description="Largest pulling force of an actuator; default: its largest pushing force."
    )
    bore: Above | None = Field(
        None, description="Bore of a cylinder; its force follows from the pressure if `force` is missing."
    )
    rod: Above | None = Field(
        None, description="Diameter of the rod, for the pulling force of a cylinder and for buckling."
    )
    price: Annotated[Number, Field(ge=0, le=MAX_LENGTH)] | None = None
    stiffness: Above | None = None
    free_length: Above | None = None
    preload: Bounded | None = None
    shortest: Above | None = None
    longest: Above | None = None
    extended: Above | None = None
    progression: Above | None = Field(
        None, description="Ratio of the compressed force of a gas spring to its extended force."
    )
    load_max: Above | None = Field(None, description="Largest load of a compression spring.")
    rate: Above | None = Field(None, description="Rate of a torsion spring: torque per unit of angle.")
    angle_max: Above | None = Field(None, description="Largest twist of a torsion spring.")


Catalogue = Words | Annotated[list[CatalogueRow], Field(min_length=1, max_length=MOST_ROWS)]


class DriveRequest(RequestModel):
    """A kind of drive and its limits; docs/drives.md lists the fields of each kind."""

    kind: Literal["rotary", "actuator", "cylinder", "dyad", "toggle"]
    links: LinkNames | None = Field(
        None, description="Links that may be driven; default: all links on which this kind is possible."
    )
    on: LinkName | None = Field(
        None, description="Link that carries the other end of an actuator; default: `ground`."
    )
    retracted: Above | None = Field(None, description="Retracted length; null: optimized.")
    stroke: Above | None = Field(None, description="Stroke; null: optimized.")
    dead_length: Size | None = Field(
        None,
        description="Smallest retracted length minus stroke, if either is optimized; the dead length is not made larger if "
        "this costs at most 5 % of force.",
    )
    catalogue: Catalogue | None = Field(
        None,
        description=f"Name of a bundled catalogue ({', '.join(ACTUATORS)}), a list of rows, or a CSV text with the names of "
        "the fields as headings.",
    )
    pressure: Above | None = Field(None, description="Pressure in bar, for rows with a bore; default: 6.")
    rod: Above | None = Field(None, description="Diameter of the rod, for buckling.")
    extends: Flag | None = Field(
        None, description="True: the actuator extends from the first position to the last. False: it retracts."
    )
    ground_box: Box | None = Field(None, description="Box for the ground point.")
    reach_max: Above | None = Field(
        None, description="Largest distance of the pin from the origin of its link's frame."
    )
    pin_box: Box | None = Field(None, description="Box for the pin of an actuator, in the frame of its link.")
    ground_point: PlacePair | None = Field(
        None,
        description="Prescribed ground point of an actuator. With `pin` or `pin_on_link`, the actuator is evaluated without a "
        "search.",
    )
    motor: PlacePair | None = Field(
        None,
        description="Prescribed motor of a dyad. With `pin` or `pin_on_link`, the dyad is evaluated without a search.",
    )
    pin: PlacePair | None = Field(None, description="Prescribed pin, in the ground frame at the first position.")
    pin_on_link: PlacePair | None = Field(None, description="Prescribed pin, in the frame of its link.")
    count: Annotated[Count, Field(ge=1, le=MAX_COUNT)] | None = Field(
        None, description="Number of equal actuators side by side; forces are those of each."
    )
    arm_min: Size | None = Field(None, description="Smallest moment arm, per radian of the crank.")
    time_ratio: Above | None = Field(
        None, description="Ratio of the durations of the slower and the faster stroke of a motor; null: optimized."
    )
    motor_box: Box | None = Field(None, description="Box for the motor.")
    pin_radius: Above | None = Field(None, description="Distance of the rod's pin from the pivot of the link.")
    transmission_angle_min: Annotated[Number, Field(ge=0, le=90)] | None = Field(
        None, description="Smallest transmission angle of a motor with a rod."
    )
    at: Literal["first", "last"] | None = Field(
        None, description="Position that an over-centre latch locks; default: `last`."
    )
    over_centre: Annotated[Number, Field(ge=0, le=90)] | None = Field(
        None, description="Angle by which a latch passes its dead centre; default: 5 degrees."
    )
    knee: Annotated[Number, Field(ge=0.1, le=0.9)] | None = Field(
        None, description="Length of the handle of a latch as a fraction of handle plus strut; default: 0.5."
    )


class HoldsRequest(RequestModel):
    """End positions at which springs hold a linkage against its stop."""

    open: Flag = Field(False, description="Hold the linkage at the last position.")
    closed: Flag = Field(False, description="Hold the linkage at the first position.")
    force_min: Above | None = Field(
        None,
        description="Smallest hand force that moves the linkage away from such an end, at `hand` or at the body point.",
    )


class WantedRequest(RequestModel):
    """A curve that springs approximate: evenly spaced values from the first position to the last."""

    torque: Annotated[list[Number], Field(min_length=2, max_length=MAX_WANTED)] | None = Field(
        None, description="Torque of the drive."
    )
    hand_force: Annotated[list[Number], Field(min_length=2, max_length=MAX_WANTED)] | None = Field(
        None,
        description="Hand force along the path of `hand` or of the body point; positive towards the last position.",
    )


class SpringRequest(RequestModel):
    """Springs that balance the load."""

    kind: Literal["tension", "gas", "compression", "torsion"]
    between: Annotated[list[LinkName], Field(min_length=2, max_length=2)] | None = Field(
        None,
        description="The two links that the spring connects; a link may be `ground`. Default: the best pair. Two springs, on "
        "the links with fixed pivots, are used if they are ideal or if a single spring leaves more than a tenth of the torque.",
    )
    catalogue: Words | Annotated[list[CatalogueRow], Field(min_length=1, max_length=MOST_SPRING_ROWS)] | None = Field(
        None,
        description=f"Name of a bundled catalogue ({', '.join(f'`{name}`' for name in SPRINGS.values())}), a list of rows or "
        "a CSV text; null: ideal springs for tension, otherwise the bundled catalogue.",
    )
    count: Annotated[Count, Field(ge=1, le=MAX_COUNT)] | None = Field(
        None, description="Number of equal springs side by side; stiffness and forces are those of each."
    )
    stiffness: Above | None = Field(None, description="Stiffness of ideal springs.")
    ground_box: Box | None = Field(None, description="Box for the end on the ground.")
    reach_max: Above | None = Field(
        None, description="Largest distance of an end from the origin of the frame of its link."
    )
    clear: Above | None = Field(None, description="Smallest distance of the ends from pivots.")
    holds: HoldsRequest | None = Field(
        None, description="For catalogue springs: end positions at which the linkage stays without a hand or a drive."
    )
    hand_force_max: Above | None = Field(
        None,
        description="For catalogue springs: largest hand force over the motion, at `hand` or at the body point.",
    )
    wanted: WantedRequest | None = Field(
        None, description="For catalogue springs: curve that the springs approximate."
    )


Drives = Annotated[list[DriveRequest], Field(max_length=MAX_DRIVES)]


Springs = Annotated[list[SpringRequest], Field(max_length=MAX_SPRINGS)]


class RockerRequest(RequestModel):
    """A link on a hinge, instead of a linkage: a flap, a wiper, a boom."""

    pivot: PlacePair = Field(default_factory=lambda: [0.0, 0.0])
    start: Angle = Field(0.0, description="Direction of the link at the first position.")
    swing: Angle = Field(description="Angle from the first to the last position; negative: clockwise.")
    length: Above = Field(description="Distance from the pivot to the body point.")


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
    heads: Flag = Field(
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
        description="A drive of a reply of /v1/drives. A cylinder or a latch adds two plates. A motor and its rod also add two "
        "plates, and the assembly is then checked over a full turn of the motor.",
    )
    layers_most: Annotated[Count, Field(ge=1, le=MOST_LAYERS)] = Field(
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
        description="free: the crank angles are unknown; do not give `crank_span` or `crank_angle`. Two samples are enough.",
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
        "optimum. Then the search continues. `report.continued` has the rank of each result. With free timing, a four-bar "
        "must have `mount` or `joints`, and `crank_angle` if it is known.",
    )
    local: Flag = Field(
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
    nevertheless: Flag = Field(False, description="Write the file even if parts collide.")


class ExportRequest(RequestModel):
    """A motion, a linkage for it, and the format of the file."""

    request: SynthesizeRequest = Field(description="Request of /v1/synthesize; angles are in its unit.")
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
    hand: PlacePair | None = Field(
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
        description="Request of /v1/synthesize that the linkage answers; angles are in its unit. Default: the crank makes a full "
        "turn, and angles are in degrees.",
    )
    rank: Rank = Field(1, description="Rank of the solution, if the request is solved.")


# -- functions --------------------------------------------------------------------------------------------------------

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
        "position. The arms have 0.08 to 0.3 of the ground length, unless the limits prescribe lengths.",
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
    local: Flag = Field(
        False,
        description="Only refine the linkages of `start_from` to their nearest optima; do not search for others.",
    )
    sensitivity: Flag = Field(False, description="Also report the change of the output per unit of each length.")
    curves: Flag = Field(False, description="Also report the error of each solution over the interval.")
    angle_unit: AngleUnit = Field("deg", description="Unit of every angle in request and reply.")


class FunctionExportRequest(RequestModel):
    """A function, a linkage that generates it, and the format of the file."""

    request: FunctionRequest = Field(description="Request of /v1/function; angles are in its unit.")
    linkage: GivenMaker
    format: Literal["json", "csv", "svg", "dxf", "mjcf"] = "json"
    length_unit: LengthUnit = Field("mm", description="Unit of the lengths, for DXF and MJCF.")
