"""The four-bar's requests, field by field as the HTTP contract has them; replies are the dataclasses of the front door."""

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
"""Kinds that there are atlases of."""


class CrankMotion(RequestModel):
    """Crank angles of a request: evenly spaced over a span, or given one by one."""

    crank_span: Number | None = Field(
        None,
        description="Crank angle from the first sample to the last, both included, evenly spaced; < 0: clockwise.",
    )
    crank_angle: Curve | None = Field(
        None, description="Crank angles in place of `crank_span`; what counts is the increment from the first."
    )
    angle_unit: AngleUnit = Field("deg", description="Unit of every angle in request and reply.")

    @property
    def degrees(self) -> bool:
        return self.angle_unit == "deg"


class MatchRequest(CrankMotion):
    """Which atlas rows turn the body like this, and from which start?"""

    rotation: Curve = Field(description="Rotation of the body at the samples, continuous: no jumps by whole turns.")
    curve: Literal["coupler", "rocker"] = Field(
        "coupler", description="Which link turns so: the coupler, or the rocker, from the line of the pivots."
    )
    mechanisms: Annotated[list[MatchedKind], Field(min_length=1, max_length=2)] | Literal["all"] = Field(
        ["four_bar"],
        description="Whose rows: the coupler of a four-bar, the rod of a slider-crank; the best of all kinds.",
    )
    top: Top = Field(10, description="How many rows to return.")
    features: Flag = Field(
        False, description="Also return Haar average and details of the request and of each match."
    )
    budget_ms: PositiveNumber | None = Field(None, description="Return the best found within this time.")


class LinksRequest(RequestModel):
    """Lengths that are given."""

    crank: Length | None = None
    coupler: Length | None = None
    rocker: Length | None = None
    ground: Length | None = Field(
        None, description="Of a function generator needed where others are given; default 1."
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
    "What every solution must keep to.",
    LIMITS,
    "full_crank",
    "`practical`: transmission angle at least 35 degrees over the used interval and 15 over the turn, longest link at "
    "most 10 times the shortest, no link and no distance of a pivot from the motion's middle above 10 times the "
    "motion's extent; a field given beside it replaces its value.",
)


# -- a linkage that a request brings along -----------------------------------------------------------------------------

FarLength = Annotated[Number, Field(ge=1e-100, le=1e100)]


FarCoordinate = Annotated[Number, Field(ge=-1e100, le=1e100)]


FarPoint = Annotated[list[FarCoordinate], Field(min_length=2, max_length=2)]


Angle = Annotated[Number, Field(ge=-1e9, le=1e9)]


class _ReplyPart(RequestModel):
    """A part of a reply that is sent back: what is not needed is ignored, so that a solution can be sent as it came."""

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
    """A guide of a solution with rails or slots: what belongs to its sort is checked where it is used."""

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
    """One of the `drives` of a reply, as it came or changed."""

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
    """One of the `solutions` of a reply, or its like: a four-bar with `links` or `joints`, else with `guides` and `driver`."""

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
        """The linkage; FieldError naming the field that is missing."""
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
    """One of the `solutions` of a reply of /v1/function, or its like."""

    output_offset: FarCoordinate | None = None


class GivenMaker(GivenLinkage):
    """One of the `solutions` of a reply of /v1/function, a four-bar with `links` or one with a slider and `guides`."""

    output_offset: FarCoordinate


# -- what a designer asks of a linkage next ----------------------------------------------------------------------------

Size = Annotated[Number, Field(ge=0, le=MAX_LENGTH)]


Bounded = Annotated[Number, Field(ge=-LARGEST, le=LARGEST)]


Pair = Annotated[list[Bounded], Field(min_length=2, max_length=2)]


class LinkMassRequest(RequestModel):
    """A mass on a link."""

    link: Literal["crank", "coupler", "rocker", "body", "slider", "block", "second_slider", "second_block"]
    mass: Annotated[Number, Field(gt=0, le=LARGEST)] = Field(description="In kg.")
    at: Pair | None = Field(
        None,
        description="[x, y] of its centre in the link's frame: origin in its first joint (crank: pivot A, coupler: crank pin, "
        "rocker: pivot B), x axis to the second; of the body: its point and its rotation.",
    )
    inertia: Annotated[Number, Field(ge=0, le=LARGEST)] = Field(
        0.0, description="About its centre, kg times length squared."
    )


class LoadRequest(RequestModel):
    """What acts on the body, in directions that do not turn with it."""

    force: Pair | None = Field(None, description="[fx, fy] at the body point.")
    torque: Bounded = Field(0.0, description="Counter-clockwise: force times length.")
    masses: Annotated[list[LinkMassRequest], Field(max_length=MOST_LINK_MASSES)] | None = Field(
        None, description="Of the links; with them forces are in newtons."
    )
    parts: Flag = Field(False, description="Also what the plates and pins of each linkage weigh, made by default.")
    gravity: Pair | None = Field(None, description="Of the masses, [gx, gy] in m/s^2; default [0, -9.81].")


class AnalysisRequest(RequestModel):
    """How fast the crank turns, and what the body carries."""

    crank_speed: Bounded = Field(
        description="Constant, in the unit of angle a second, counter-clockwise: negative for a clockwise motion."
    )
    load: LoadRequest | None = Field(None, description="With it: torque or force of the drive, and pin forces.")
    length_unit: LengthUnit = Field("mm", description="The unit of lengths, which tells the forces of inertia.")


class ToleranceStudyRequest(RequestModel):
    """Tolerances of manufacture, in the unit of the positions."""

    links: Size = Field(0.0, description="Each length lies evenly within this of its nominal value, either way.")
    pivots: Size = Field(0.0, description="So does each coordinate of a fixed pivot.")
    clearance: Size = Field(0.0, description="Diameter of a hole less that of its pin, in all four joints.")
    samples: Annotated[Count, Field(ge=FEWEST_SAMPLES, le=MOST_SAMPLES)] = Field(
        SAMPLES, description="How many linkages are made by chance."
    )
    seed: Annotated[Count, Field(ge=0, le=2**32 - 1)] = Field(
        0, description="Which: the same seed makes the same ones."
    )


# -- what drives it ----------------------------------------------------------------------------------------------------

Above = Annotated[Number, Field(gt=0, le=MAX_LENGTH)]


Words = Annotated[str, Field(max_length=100_000)]


LinkName = Annotated[str, Field(max_length=40)]


LinkNames = Annotated[list[LinkName], Field(min_length=1, max_length=4)]


PlacePair = Annotated[list[FarCoordinate], Field(min_length=2, max_length=2)]


class MassRequest(RequestModel):
    """A mass on a link."""

    link: LinkName | None = Field(None, description="`body` (default), `crank`, `coupler`, `rocker`.")
    mass: Annotated[Number, Field(ge=0, le=LARGEST)]
    at: PlacePair | None = Field(
        None,
        description="In the link's frame, of the body from its point on. Default: the link's middle, the body's point.",
    )
    inertia: Annotated[Number, Field(ge=0, le=LARGEST)] | None = Field(None, description="About that place.")


class PointForceRequest(RequestModel):
    """A force at a point of a link, in a direction that does not turn with the link."""

    link: LinkName = Field(description="`crank`, `coupler`, `rocker` or `body`.")
    at: PlacePair | None = Field(None, description="In the link's frame. Default: the middle of the link.")
    force: Pair = Field(description="[fx, fy].")


class DriveLoadRequest(LoadRequest):
    """What acts on the body and on the links, in directions that do not turn with them."""

    forces: Annotated[list[PointForceRequest], Field(max_length=MAX_MASSES)] | None = Field(
        None, description="At points of any links."
    )

    torque: Bounded | None = Field(None, description="On the body, counter-clockwise: force times length.")
    masses: Annotated[list[MassRequest], Field(max_length=MAX_MASSES)] | None = None
    parts: Flag = Field(
        False, description="To /v1/drives: also what the linkage's plates and pins weigh, made by default."
    )
    speed: Bounded | None = Field(
        None, description="Of the crank, constant: then the masses resist their acceleration too."
    )


class CatalogueRow(RequestModel):
    """A row of a catalogue of actuators (retracted, stroke, ..) or of springs."""

    name: Annotated[str, Field(max_length=200)] | None = None
    retracted: Above | None = None
    stroke: Above | None = None
    force: Above | None = Field(None, description="That an actuator pushes with at most, or an extended gas spring.")
    pull: Above | None = Field(None, description="That an actuator pulls with at most; default: as it pushes.")
    bore: Above | None = Field(
        None, description="Of a cylinder: its force by the pressure, where `force` is not given."
    )
    rod: Above | None = Field(None, description="Diameter of its rod: for the pull of a cylinder, and for buckling.")
    price: Annotated[Number, Field(ge=0, le=MAX_LENGTH)] | None = None
    stiffness: Above | None = None
    free_length: Above | None = None
    preload: Bounded | None = None
    shortest: Above | None = None
    longest: Above | None = None
    extended: Above | None = None
    progression: Above | None = Field(None, description="Of a gas spring: force pushed in over force extended.")
    load_max: Above | None = Field(None, description="Largest load of a compression spring.")
    rate: Above | None = Field(None, description="Of a torsion spring: moment per unit of angle.")
    angle_max: Above | None = Field(None, description="Largest twist of a torsion spring.")


Catalogue = Words | Annotated[list[CatalogueRow], Field(min_length=1, max_length=MOST_ROWS)]


class DriveRequest(RequestModel):
    """A kind of drive that is wanted, and within what; which fields belong to which kind says docs/drives.md."""

    kind: Literal["rotary", "actuator", "cylinder", "dyad", "toggle"]
    links: LinkNames | None = Field(None, description="On which links; default: on each that can have it.")
    on: LinkName | None = Field(
        None, description="The link that carries the other end of an actuator; default `ground`."
    )
    retracted: Above | None = Field(None, description="Retracted length; null: as it is best.")
    stroke: Above | None = Field(None, description="Null: as it is best.")
    dead_length: Size | None = Field(
        None,
        description="Retracted length less stroke, at least, where either is free; no more where that costs at most 5 % force.",
    )
    catalogue: Catalogue | None = Field(
        None, description=f"One of {', '.join(ACTUATORS)}; rows; or a CSV text with a head of the rows' names."
    )
    pressure: Above | None = Field(None, description="Bar, for rows with a bore; default 6.")
    rod: Above | None = Field(None, description="Diameter of the rod, for buckling.")
    extends: Flag | None = Field(None, description="Whether it extends from the first position to the last.")
    ground_box: Box | None = Field(None, description="Of the ground point.")
    reach_max: Above | None = Field(
        None, description="Largest distance of the pin from the origin of its link's frame."
    )
    pin_box: Box | None = Field(None, description="Box of an actuator's pin, in the frame of its link.")
    ground_point: PlacePair | None = Field(
        None,
        description="Given end of an actuator, in the plane at the first position. With `pin` or `pin_on_link` the actuator is "
        "evaluated and not searched.",
    )
    motor: PlacePair | None = Field(
        None, description="Given motor of a dyad; with `pin` or `pin_on_link` it is evaluated and not searched."
    )
    pin: PlacePair | None = Field(None, description="Given pin, in the plane at the first position.")
    pin_on_link: PlacePair | None = Field(None, description="Given pin, in the frame of its link.")
    count: Annotated[Count, Field(ge=1, le=MAX_COUNT)] | None = Field(
        None, description="Number of equal actuators side by side; forces are those of each."
    )
    arm_min: Size | None = Field(None, description="Least moment arm, a radian of the crank.")
    time_ratio: Above | None = Field(
        None, description="Of a motor: the slower way over the other; null: as it is best."
    )
    motor_box: Box | None = None
    pin_radius: Above | None = Field(None, description="Of the rod's pin, from the link's pivot.")
    transmission_angle_min: Annotated[Number, Field(ge=0, le=90)] | None = None
    at: Literal["first", "last"] | None = Field(None, description="The end that a knee locks; default `last`.")
    over_centre: Annotated[Number, Field(ge=0, le=90)] | None = Field(
        None, description="Angle by which a knee goes beyond its line; default 5 degrees."
    )
    knee: Annotated[Number, Field(ge=0.1, le=0.9)] | None = Field(
        None, description="Length of the handle over both links; default 0.5."
    )


class HoldsRequest(RequestModel):
    """The ends at which springs hold a linkage on its stop."""

    open: Flag = Field(False, description="The last position.")
    closed: Flag = Field(False, description="The first position.")
    force_min: Above | None = Field(
        None, description="Smallest force of a hand that leaves such an end, at `hand` or else at the body point."
    )


class WantedRequest(RequestModel):
    """A curve over the motion that springs approximate: values at even steps from the first position to the last."""

    torque: Annotated[list[Number], Field(min_length=2, max_length=MAX_WANTED)] | None = Field(
        None, description="Torque of the drive."
    )
    hand_force: Annotated[list[Number], Field(min_length=2, max_length=MAX_WANTED)] | None = Field(
        None,
        description="Force of a hand along its path, at `hand` or else at the body point; positive towards the last position.",
    )


class SpringRequest(RequestModel):
    """Springs that are to carry the load."""

    kind: Literal["tension", "gas", "compression", "torsion"]
    between: Annotated[list[LinkName], Field(min_length=2, max_length=2)] | None = Field(
        None,
        description="Two links, one of which may be `ground`. Default: the best of all pairs; two springs, on the links with "
        "fixed pivots, if they are ideal or one leaves more than a tenth of the torque.",
    )
    catalogue: Words | Annotated[list[CatalogueRow], Field(min_length=1, max_length=MOST_SPRING_ROWS)] | None = Field(
        None,
        description=f"{', '.join(f'`{name}`' for name in SPRINGS.values())}, rows or a CSV text; null: ideal springs for "
        "tension, else the bundled catalogue.",
    )
    count: Annotated[Count, Field(ge=1, le=MAX_COUNT)] | None = Field(
        None, description="Number of equal springs side by side; stiffness and forces are those of each."
    )
    stiffness: Above | None = Field(None, description="Of ideal springs.")
    ground_box: Box | None = Field(None, description="Of its end on the ground.")
    reach_max: Above | None = None
    clear: Above | None = Field(None, description="Least distance of its ends from pivots.")
    holds: HoldsRequest | None = Field(
        None, description="Of springs of a catalogue: the linkage must stay at these ends without a hand or a drive."
    )
    hand_force_max: Above | None = Field(
        None,
        description="Of springs of a catalogue: largest force of a hand over the motion, at `hand` or else at the body point.",
    )
    wanted: WantedRequest | None = Field(None, description="A curve that springs of a catalogue approximate.")


Drives = Annotated[list[DriveRequest], Field(max_length=MAX_DRIVES)]


Springs = Annotated[list[SpringRequest], Field(max_length=MAX_SPRINGS)]


class RockerRequest(RequestModel):
    """A link on a hinge, in place of a linkage: a flap, a wiper, a boom."""

    pivot: PlacePair = Field(default_factory=lambda: [0.0, 0.0])
    start: Angle = Field(0.0, description="Its direction at the first position.")
    swing: Angle = Field(description="To the last one; < 0: clockwise.")
    length: Above = Field(description="To the body point.")


# -- how it is built --------------------------------------------------------------------------------------------------

Rank = Annotated[Count, Field(ge=1, le=100)]


class AssemblyOptions(RequestModel):
    """Sizes of plates and pins, the same for layers and every file, and how they are held; lengths in the unit of the linkage."""

    width: Length | None = Field(None, description="Of the plates. Default: 2.5 holes, in whole millimetres.")
    hole: Length | None = Field(
        None,
        description="Diameter of the pins. Default: a standard one up to 0.3 of the shortest link and 0.05 of the longest; less "
        "where `body` or a rod's pin needs it.",
    )
    thickness: Length | None = Field(None, description="Of the plates. Default: a standard sheet of half a hole.")
    washer: Size | None = Field(None, description="Between two layers. Default: a fifth of the thickness.")
    clearance: Size | None = Field(
        None,
        description="Least gap of parts that pass one another. Default: 0.5 / 165 of the longest link.",
    )
    kerf: Size = Field(
        0.0, description="Width of the cut: contours of plates to cut are larger by half of it, and holes smaller."
    )
    scale: Annotated[Number, Field(ge=LEAST_SCALE, le=LARGEST_SCALE)] = Field(
        1.0, description="Of a model, in every file of parts; plays and `kerf` are not scaled."
    )
    length_unit: LengthUnit | None = Field(
        None,
        description="The unit of the lengths: default sizes are standard ones in millimetres. Default: that of the file, or mm.",
    )
    boards: Literal["below", "above", "both", "bar"] = Field(
        "below",
        description="Where the fixed pins stand: in a board below or above the links, in one on each side, or in a bar, a plate "
        "like any other.",
    )
    heads: Flag = Field(
        False, description="Whether pins have heads of 1.8 diameters, in a layer more at each free end."
    )
    body: Annotated[list[Point], Field(min_length=3, max_length=MOST_CORNERS + 1)] | None = Field(
        None,
        description="Outline of the body, a plate that the coupler carries: corners [x, y] in the body's frame, from the "
        "requested position and turned with the requested rotation (without one: as at the first sample).",
    )
    mounts: dict[Literal[FIXED_PINS], Literal["below", "above", "below+above"]] | None = Field(
        None, description="How fixed pins must be held, where that matters."
    )
    drive: GivenDrive | None = Field(
        None,
        description="A drive as /v1/drives has found it: a cylinder or a knee are two more plates. So are a motor and its rod; "
        "everything is then over a turn of the motor.",
    )
    layers_most: Annotated[Count, Field(ge=1, le=MOST_LAYERS)] = Field(LAYERS_MOST, description="Layers at most.")
    envelope: Box | None = Field(
        None,
        description="A box that all plates must stay in: xmin, ymin, xmax, ymax. Default: that of the request's limits.",
    )
    keep_out: Annotated[list[Box], Field(max_length=MAX_KEEP_OUT)] | None = Field(
        None, description="Boxes that no plate may enter. Default: those of the request's limits."
    )


def _with_defaults(given: Any) -> Any:
    """True stands for all defaults, false for nothing."""
    return ({} if given else None) if isinstance(given, bool) else given


def _or_a_flag(schema: dict[str, Any]) -> None:
    schema["anyOf"].insert(0, {"type": "boolean"})


# -- rotation, positions or both ---------------------------------------------------------------------------------------


class WeightsRequest(RequestModel):
    """Weights of the samples, at least 0."""

    rotation: Weights | None = None
    position: Weights | None = None


class TolerancesRequest(RequestModel):
    """Largest errors allowed, for all samples or for each."""

    rotation: PositiveNumber | Tolerances | None = None
    position: PositiveNumber | Tolerances | None = None


TwoPoints = Annotated[
    list[Annotated[list[Number], Field(min_length=4, max_length=4)]], Field(min_length=2, max_length=MAX_SAMPLES)
]


class SynthesizeRequest(CrankMotion):
    """Which linkage moves a body like this: its dimensions and where it is mounted?"""

    rotation: SampledCurve | None = Field(
        None, description="Rotation of the body at the samples, continuous; null: missing at that sample."
    )
    position: SampledPath | None = Field(
        None,
        description="Positions [x, y] of a point of the body, in any unit of length; null: missing at that sample.",
    )
    points: TwoPoints | None = Field(
        None,
        description="In place of `rotation` and `position`: two points [x1, y1, x2, y2] of the body at each sample. The first is "
        "the body point, and the rotation is the direction to the second.",
    )
    start_angle: Number | None = Field(
        None,
        description="With given crank angles: the crank angle at the first sample, from the ground line A->B; default: as it is "
        "best.",
    )
    timing: Literal["free"] | None = Field(
        None,
        description="In place of `crank_span` and `crank_angle`: the crank angles are unknown; 2 samples will do.",
    )
    order: Literal["given", "any"] = Field(
        "given",
        description="With free timing: whether the crank passes the samples in the order given, turning one way.",
    )
    closed: Flag = Field(False, description="With free timing: the way leads from the last sample on to the first.")
    crank_span_max: PositiveNumber | None = Field(
        None, description="With free timing: the crank turns by no more than this from the first sample to the last."
    )
    travel: Travel | None = Field(
        None,
        description="For linkages with sliders, in place of crank angles: travel of the slider, or extension of the cylinder, at "
        "each sample; what counts is the increment from the first. Above 0 a cylinder grows longer.",
    )
    travel_span: Number | None = Field(
        None, description="The same from the first sample to the last, evenly spaced; < 0: a cylinder retracts."
    )
    mechanisms: Mechanisms | None = Field(
        None,
        description="Kinds of mechanism, default `four_bar` alone. Of several kinds those come back that no other one driven "
        "alike beats in error, size and transmission angle at once.",
    )
    driver: DriverName | None = Field(None, description="Only linkages that are driven so.")
    weights: WeightsRequest | None = Field(None, description="What each sample counts; default: all alike.")
    tolerances: TolerancesRequest | None = Field(
        None, description="Largest errors allowed; then status `reached` means that every sample keeps them."
    )
    prefer: Literal["error", "balanced", "size", "transmission", "crank_span", "layers"] | None = Field(
        None,
        description="Which of the accurate linkages come first: those with the smallest error, the best balance of size, "
        "transmission angle and swing, the smallest links and reach, the best transmission angle, the shortest swing, "
        "or layers over whose fixed pivots nothing passes. Default: `balanced` with free crank angles, `size` with tolerances, "
        "otherwise `error`.",
    )
    top: Annotated[Count, Field(ge=1, le=100)] = Field(10, description="How many different linkages to return.")
    effort: Literal["atlas", "refine"] = Field("refine", description="`atlas`: the best rows as they are, mounted.")
    limits: LimitsRequest = Field(default_factory=LimitsRequest)
    tolerance: Tolerance = Field(1e-10, description="The search ends when the objective is below this.")
    budget_ms: PositiveNumber | None = Field(None, description="Return the best found within this time.")
    start_from: Annotated[list[GivenLinkage], Field(min_length=1, max_length=MAX_STARTS)] | None = Field(
        None,
        description="Linkages that are candidates from the first step, for example the displayed solution while a motion is "
        'dragged: each is refined within the limits, with `prefer` "balanced" no farther than needed, otherwise to its nearest '
        "optimum, then the search continues. `report.continued` has the rank of each result. With free timing a four-bar needs "
        "its `mount` or `joints`, and its `crank_angle` if it has one.",
    )
    local: Flag = Field(
        False,
        description="Search nowhere else: only the linkages of `start_from` are refined to their nearest optima.",
    )
    length_scale: Length | None = Field(
        None,
        description="Weighs position errors against rotation errors in radians. Default: the largest distance of a "
        "position from the mean position.",
    )
    round_to: Length | None = Field(
        None,
        description="Also report each solution with its links rounded to this grid and the rest fitted anew, within the limits.",
    )
    lengths_from: Annotated[list[Length], Field(min_length=1, max_length=MOST_STOCK)] | None = Field(
        None, description="Instead of `round_to`: each link of one of these lengths, in the best combination."
    )
    diverse: Flag = Field(
        False,
        description="Of four-bars alone: solutions spread over families, branches and places, J at most twice the best, in place "
        "of the best ones.",
    )
    sensitivity: Flag = Field(False, description="Also report the change of the motion per unit of each length.")
    analysis: AnalysisRequest | None = Field(
        None, description="Also report velocities, accelerations and, with a load, torque and pin forces."
    )
    tolerance_study: ToleranceStudyRequest | None = Field(
        None, description="Also report what tolerances of manufacture do to the body's motion."
    )
    load: DriveLoadRequest | None = Field(None, description="Of `drives`, `springs` and `drive`.")
    drives: Drives | None = Field(None, description="Also report the best drive of each of these kinds.")
    springs: Springs | None = Field(None, description="Also report springs that carry the load.")
    drive: DriveRequest | None = Field(
        None, description="Solutions without such a drive come after those with one, which is reported."
    )
    assembly: Annotated[AssemblyOptions | None, BeforeValidator(_with_defaults)] = Field(
        None,
        description="Also look for layers in which the parts of each solution pass one another; true: with default sizes. "
        "Solutions that have some come first.",
        json_schema_extra=_or_a_flag,
    )


# -- a linkage as a file ----------------------------------------------------------------------------------------------

Material = Literal["steel", "stainless", "aluminium", "brass", "plywood", "acrylic", "POM", "PLA", "PETG", "ABS"]


class SolidsRequest(RequestModel):
    """What parts are made of, and how they fit."""

    fit: Literal["H7", "print"] = Field(
        "H7",
        description="`H7`: drawn at the nominal size, with tolerances in the parts list; `print`: with play for a printer, "
        "0.4 mm where a plate turns and 0.1 mm where it holds the pin.",
    )
    material: Material | None = Field(
        None, description="Of plates and boards. Default: aluminium, to be printed PLA."
    )
    pins: Material | None = Field(None, description="Of pins, washers and heads. Default: steel, to be printed PLA.")
    fillet: Size = Field(0.0, description="Radius at the convex corners of the body, in the unit of the lengths.")
    layout: Literal["assembled", "bed"] | None = Field(
        None,
        description="Where parts stand in STEP and 3MF. Default: assembled in STEP, beside one another on the bed in 3MF.",
    )
    nevertheless: Flag = Field(False, description="Also where parts would collide.")


class ExportRequest(RequestModel):
    """A motion, one of its solutions, and the kind of file that is wanted."""

    request: SynthesizeRequest = Field(description="The request of /v1/synthesize; angles are in its unit.")
    linkage: GivenLinkage | None = Field(
        None, description="One of the reply's solutions, or its like. Without it the request is solved."
    )
    rank: Annotated[int, Strict(), Field(ge=1, le=100)] = Field(
        1, description="Rank of the solution, if no linkage is given."
    )
    format: Literal[
        "json", "csv", "svg", "dxf", "plates", "mjcf", "pylinkage", "step", "3mf", "stl", "urdf", "sdf", "parts"
    ] = Field("json", description="`stl`: a zip file with a file a part; `parts`: a parts list (CSV).")
    length_unit: LengthUnit | None = Field(
        None,
        description="The unit of the request's lengths, for files that know one. Default: that of its `analysis`, or mm.",
    )
    assembly: AssemblyOptions | None = Field(
        None,
        description="From `step` on, for plates, and for masses in MJCF: sizes of plates and pins, and how they are held. "
        "Default: as in the request.",
    )
    solids: SolidsRequest | None = Field(None, description="For the same: fits and materials.")
    drive: GivenDrive | None = Field(
        None,
        description="A drive of a reply, as it came: columns of CSV, lines of SVG, a layer of DXF, the drive of MJCF, and its "
        "parts. Default: the first drive of the solution, if the request asks for drives.",
    )


# -- what drives it, and whether it can be built ----------------------------------------------------------------------


class DrivesRequest(RequestModel):
    """What drives this linkage over its used interval, with this load?"""

    linkage: GivenLinkage | None = Field(
        None, description="One of the `solutions` of a reply, as it came or changed."
    )
    request: SynthesizeRequest | None = Field(None, description="The request that it came from: it says the way.")
    crank_angle: (
        Annotated[list[Annotated[float, Field(ge=-1e9, le=1e9)]], Field(min_length=2, max_length=1024)] | None
    ) = Field(None, description="In place of `request`: crank angles, or travel of its drive, from the start on.")
    rocker: RockerRequest | None = Field(None, description="In place of a linkage: a link on a hinge.")
    load: DriveLoadRequest | None = Field(None, description="Without it the largest least moment arm counts.")
    drives: Drives = Field(
        default_factory=lambda: [DriveRequest(kind=kind) for kind in ("rotary", "actuator", "dyad")],
        description="Kinds of drives that are wanted; default: rotary, actuator and dyad.",
    )
    springs: Springs = Field(default_factory=list, description="Springs that are to carry the load.")
    hand: PlacePair | None = Field(
        None, description="A place on the body at the first position: springs tell the force of a hand there."
    )
    top: Annotated[Count, Field(ge=1, le=50)] = Field(5, description="How many drives of each kind to return.")
    angle_unit: AngleUnit | None = Field(
        None, description="Unit of every angle; default: that of `request`, or degrees."
    )
    length_unit: LengthUnit = Field("mm", description="The unit of all lengths, for the bundled catalogues.")
    budget_ms: PositiveNumber | None = Field(None, description="Return the best found within this time.")


class AssemblyRequest(AssemblyOptions):
    """Layers for the plates of a linkage over the interval that it is used for."""

    linkage: GivenLinkage | None = Field(
        None, description="One of the solutions of a reply. Without it the request is solved."
    )
    request: SynthesizeRequest | None = Field(
        None,
        description="The request of /v1/synthesize that it answers; angles are in its unit. Without it the crank turns fully, "
        "and angles are in degrees.",
    )
    rank: Rank = Field(1, description="Which solution, if no linkage is given.")


# -- functions --------------------------------------------------------------------------------------------------------

NumberPair = Annotated[list[Number], Field(min_length=2, max_length=2)]


class FunctionOfX(RequestModel):
    """y = f(x) on two linear dials."""

    name: Literal["log10", "ln", "exp", "power", "sin", "cos", "tan", "reciprocal"] | None = Field(
        None, description="sin, cos and tan take x in `angle_unit`."
    )
    table: Annotated[list[NumberPair], Field(min_length=MIN_PAIRS, max_length=MAX_SAMPLES)] | None = Field(
        None, description="Pairs [x, y] in place of a name."
    )
    x: NumberPair | None = Field(None, description="First and last x.")
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


FunctionUnit = Literal["deg", "rad", "length"]


MakerKind = Literal["four_bar", "slider_crank", "swinging_block", "rail_slot", "two_rails"]
"""Kinds that make functions."""


class QuickReturnRequest(RequestModel):
    """A slow motion one way and a fast one back, driven by a crank that turns evenly and fully."""

    stroke: PositiveNumber | None = Field(None, description="Travel of a slider: a slider-crank is wanted.")
    swing: PositiveNumber | None = Field(None, description="Angle of a rocker: a crank-rocker is wanted.")
    time_ratio: PositiveNumber = Field(
        description="Duration of the slow motion over that of the fast one, at least 1."
    )


class SteeringRequest(RequestModel):
    """Ackermann's condition for the front wheels of a car: the axes of all wheels meet in one point."""

    track: PositiveNumber = Field(description="Distance of the two kingpins: the ground of the linkage.")
    wheelbase: PositiveNumber = Field(description="Distance of the axles.")
    angle: PositiveNumber = Field(description="Largest angle of an inner wheel from straight ahead.")


class FunctionRequest(RequestModel):
    """Which linkage's output, of rocker, crank or slider, is a wanted function of its input?"""

    output: Pairs | None = Field(
        None,
        description="Rocker angles, or travel, at the samples, continuous, up to a constant; falling: against a rising input.",
    )
    crank_span: Number | None = Field(
        None, description="Crank angle from the first sample to the last, evenly spaced; < 0: clockwise."
    )
    travel_span: Number | None = Field(
        None, description="Where the input is a travel: from the first sample to the last, evenly spaced."
    )
    input: Pairs | None = Field(
        None,
        description="Crank angles, or travel, in place of the span; what counts is the increment from the first.",
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
        description="From angle to angle `four_bar`; from angle to length, and back, `slider_crank` and `swinging_block`; from "
        "length to angle `rail_slot` too; from length to length `two_rails`. Default: the first that there is.",
    )
    function: FunctionOfX | None = Field(None, description="A function by name or table in place of `output`.")
    quick_return: QuickReturnRequest | None = Field(
        None, description="In place of `output`: a stroke or swing, and the time ratio of both motions."
    )
    steering: SteeringRequest | None = Field(
        None, description="In place of `output`: a symmetric linkage that steers two wheels by Ackermann's condition."
    )
    symmetric: Flag = Field(
        False,
        description="Left and right arm are mirror images; `input` and `output` are measured from the symmetric position. Arms "
        "between 0.08 and 0.3 of the ground unless the limits give lengths.",
    )
    objective: Literal["rms", "max"] = Field(
        "rms", description="Make least the rms error at the samples, or the largest error over the whole interval."
    )
    input_zero: Number | None = Field(
        None,
        description="Crank angle at the first sample, from the ground line A->B or the rail; or the place of slider or cylinder.",
    )
    output_zero: Number | None = Field(None, description="The output that is wanted there, measured alike.")
    weights: (
        Annotated[list[Annotated[Number, Field(ge=0)]], Field(min_length=MIN_PAIRS, max_length=MAX_SAMPLES)] | None
    ) = Field(None, description="What each squared error counts; for `max` each error, linear between samples.")
    one_way: Flag = Field(False, description="The rocker must not turn back within the interval.")
    limits: FunctionLimitsRequest = FunctionLimitsRequest()
    top: Annotated[Count, Field(ge=1, le=100)] = Field(10, description="How many different linkages to return.")
    tolerance: Tolerance = Field(1e-10, description="The search ends when the objective is below this.")
    budget_ms: PositiveNumber | None = Field(None, description="Return the best found within this time.")
    round_to: Length | None = Field(
        None, description="Also report each solution with its links on this grid and the zeros fitted anew."
    )
    start_from: Annotated[list[GivenGenerator], Field(min_length=1, max_length=MAX_STARTS)] | None = Field(
        None,
        description="Four-bars that are candidates from the first step: each is refined to its nearest optimum within the "
        "limits, then the search continues.",
    )
    local: Flag = Field(
        False,
        description="Search nowhere else: only the linkages of `start_from` are refined to their nearest optima.",
    )
    sensitivity: Flag = Field(False, description="Also report the change of the output per unit of each length.")
    curves: Flag = Field(False, description="Also report each solution's error over the interval.")
    angle_unit: AngleUnit = Field("deg", description="Unit of every angle in request and reply.")


class FunctionExportRequest(RequestModel):
    """A function, one of its linkages, and the kind of file that is wanted."""

    request: FunctionRequest = Field(description="The request of /v1/function; angles are in its unit.")
    linkage: GivenMaker
    format: Literal["json", "csv", "svg", "dxf", "mjcf"] = "json"
    length_unit: LengthUnit = Field("mm", description="The unit of the lengths, for DXF and MJCF.")
