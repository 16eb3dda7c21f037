"""Loads, drives and springs in requests."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from app.fourbar.fields import Above, Angle, Bounded, Box, FarPoint, LinkName, LinkNames, Pair, Size, Words
from app.query import Count, Flag, LengthUnit, Number, RequestModel
from linkage_atlas.analysis import MOST_LINK_MASSES
from linkage_atlas.arguments import LARGEST
from linkage_atlas.catalogues import ACTUATORS, MOST_ROWS, MOST_SPRING_ROWS, SPRINGS
from linkage_atlas.drive_design.question import MAX_COUNT, MAX_DRIVES, MAX_MASSES, MAX_SPRINGS, MAX_TARGET_VALUES
from linkage_atlas.motions import MAX_LENGTH
from linkage_atlas.tolerance_study import FEWEST_SAMPLES, MOST_SAMPLES, SAMPLES


class MassRequest(RequestModel):
    """A mass on a link."""

    link: LinkName | None = None
    """Link, as in a reply: `crank`, `coupler`, `rocker`, `body`, .. Default for drives: `body`."""
    mass: Annotated[Number, Field(ge=0, le=LARGEST)]
    """Mass in kg."""
    centre: FarPoint | None = None
    """Centre of mass [x, y] in the frame of the link. The origin is its first joint (crank: pivot A, coupler: crank pin,
    rocker: pivot B) and the x axis points to the second; the frame of the body has its point as origin and its rotation.
    Default: the origin; for drives the midpoint of the link, or the body point."""
    inertia: Annotated[Number, Field(ge=0, le=LARGEST)] | None = None
    """Moment of inertia about the centre of mass, kg times length squared."""


class PointForceRequest(RequestModel):
    """A force at a point of a link, in a direction that does not rotate with the link."""

    link: LinkName
    """Link: `crank`, `coupler`, `rocker` or `body`."""
    point: FarPoint | None = None
    """Point in the frame of the link. Default: the midpoint of the link."""
    force: Pair
    """Force [fx, fy]."""


class LoadRequest(RequestModel):
    """Load on the body and on the links, in directions that do not rotate with them."""

    force: Pair | None = None
    """Force [fx, fy] at the body point."""
    torque: Bounded | None = None
    """Torque on the body, positive counter-clockwise: force times length."""
    masses: Annotated[list[MassRequest], Field(max_length=MOST_LINK_MASSES)] | None = None
    """Masses of the links; forces are then in newtons."""
    parts: Flag = False
    """Add the weight of the plates and pins of a linkage, with their default sizes: in an `analysis` and for /v2/drives."""
    gravity: Pair | None = None
    """Gravity [gx, gy] that acts on the masses, m/s^2; default: [0, -9.81]."""
    forces: Annotated[list[PointForceRequest], Field(max_length=MAX_MASSES)] | None = None
    """For drives: forces at points of links."""
    speed: Bounded | None = None
    """For drives: constant speed of the crank, to include the inertia forces of the masses."""


class AnalysisRequest(RequestModel):
    """Speed of the crank and load of the body for an analysis."""

    crank_speed: Bounded
    """Constant speed of the crank, in units of angle per second; negative: clockwise."""
    load: LoadRequest | None = None
    """Load, to compute the torque or force of the drive and the pin forces."""
    length_unit: LengthUnit = "mm"
    """Unit of lengths, from which inertia forces are computed."""


class ToleranceStudyRequest(RequestModel):
    """Manufacturing tolerances, in the unit of the positions."""

    described_by = ("Linkage.tolerance_study",)

    links: Size = 0.0
    pivots: Size = 0.0
    clearance: Size = 0.0
    samples: Annotated[Count, Field(ge=FEWEST_SAMPLES, le=MOST_SAMPLES)] = SAMPLES
    seed: Annotated[Count, Field(ge=0, le=2**32 - 1)] = 0


class CatalogueRow(RequestModel):
    """A row of a catalogue of actuators (retracted, stroke, ...) or of springs."""

    name: Annotated[str, Field(max_length=200)] | None = None
    retracted: Above | None = None
    stroke: Above | None = None
    force: Above | None = None
    """Largest pushing force of an actuator, or force of an extended gas spring."""
    pull: Above | None = None
    """Largest pulling force of an actuator; default: its largest pushing force."""
    bore: Above | None = None
    """Bore of a cylinder; its force follows from the pressure if `force` is missing."""
    rod: Above | None = None
    """Diameter of the rod, for the pulling force of a cylinder and for buckling."""
    price: Annotated[Number, Field(ge=0, le=MAX_LENGTH)] | None = None
    stiffness: Above | None = None
    free_length: Above | None = None
    preload: Bounded | None = None
    shortest: Above | None = None
    longest: Above | None = None
    extended: Above | None = None
    progression: Above | None = None
    """Ratio of the compressed force of a gas spring to its extended force."""
    load_max: Above | None = None
    """Largest load of a compression spring."""
    rate: Above | None = None
    """Rate of a torsion spring: torque per unit of angle."""
    angle_max: Above | None = None
    """Largest twist of a torsion spring."""


Catalogue = Words | Annotated[list[CatalogueRow], Field(min_length=1, max_length=MOST_ROWS)]


class DriveRequest(RequestModel):
    """A kind of drive and its limits; docs/drives.md lists the fields of each kind."""

    kind: Literal["rotary", "actuator", "cylinder", "dyad"]
    links: LinkNames | None = None
    """Links that may be driven; default: all links on which this kind is possible."""
    base_link: LinkName | None = None
    """Link that carries the other end of an actuator; default: `ground`."""
    retracted: Above | None = None
    """Retracted length; null: optimized."""
    stroke: Above | None = None
    """Stroke; null: optimized."""
    dead_length: Size | None = None
    """Smallest retracted length minus stroke, if either is optimized; the dead length is not made larger if this costs at
    most 5 % of force."""
    catalogue: Catalogue | None = Field(
        None,
        description=f"Name of a bundled catalogue ({', '.join(ACTUATORS)}), a list of rows, or a CSV text with the names of "
        "the fields as headings.",
    )
    pressure: Above | None = None
    """Pressure in bar, for rows with a bore; default: 6."""
    rod: Above | None = None
    """Diameter of the rod, for buckling."""
    extends: Flag | None = None
    """True: the actuator extends from the first position to the last. False: it retracts."""
    ground_box: Box | None = None
    """Box for the ground point."""
    reach_max: Above | None = None
    """Largest distance of the pin from the origin of its link's frame."""
    pin_box: Box | None = None
    """Box for the pin of an actuator, in the frame of its link."""
    ground_point: FarPoint | None = None
    """Prescribed ground point of an actuator. With `pin` or `pin_on_link`, the actuator is evaluated without a search."""
    motor: FarPoint | None = None
    """Prescribed motor of a dyad. With `pin` or `pin_on_link`, the dyad is evaluated without a search."""
    pin: FarPoint | None = None
    """Prescribed pin, in the ground frame at the first position."""
    pin_on_link: FarPoint | None = None
    """Prescribed pin, in the frame of its link."""
    count: Annotated[Count, Field(ge=1, le=MAX_COUNT)] | None = None
    """Number of equal actuators side by side; forces are those of each."""
    arm_min: Size | None = None
    """Smallest moment arm, per radian of the crank."""
    time_ratio: Above | None = None
    """Ratio of the durations of the slower and the faster stroke of a motor; null: optimized."""
    motor_box: Box | None = None
    """Box for the motor."""
    pin_radius: Above | None = None
    """Distance of the rod's pin from the pivot of the link."""
    transmission_angle_min: Annotated[Number, Field(ge=0, le=90)] | None = None
    """Smallest transmission angle of a motor with a rod."""


class HoldsRequest(RequestModel):
    """End positions at which springs hold a linkage against its stop."""

    open: Flag = False
    """Hold the linkage at the last position."""
    closed: Flag = False
    """Hold the linkage at the first position."""
    force_min: Above | None = None
    """Smallest hand force that moves the linkage away from such an end, at `hand_point` or at the body point."""


class TargetCurveRequest(RequestModel):
    """A curve that springs approximate: evenly spaced values from the first position to the last."""

    torque: Annotated[list[Number], Field(min_length=2, max_length=MAX_TARGET_VALUES)] | None = None
    """Torque of the drive."""
    hand_force: Annotated[list[Number], Field(min_length=2, max_length=MAX_TARGET_VALUES)] | None = None
    """Hand force along the path of `hand_point` or of the body point; positive towards the last position."""


class SpringRequest(RequestModel):
    """Springs that balance the load."""

    kind: Literal["tension", "gas", "compression", "torsion"]
    between: Annotated[list[LinkName], Field(min_length=2, max_length=2)] | None = None
    """The two links that the spring connects; a link may be `ground`. Default: the best pair. Two springs, on the links with
    fixed pivots, are used if they are ideal or if a single spring leaves more than a tenth of the torque."""
    catalogue: Words | Annotated[list[CatalogueRow], Field(min_length=1, max_length=MOST_SPRING_ROWS)] | None = Field(
        None,
        description=f"Name of a bundled catalogue ({', '.join(f'`{name}`' for name in SPRINGS.values())}), a list of rows or "
        "a CSV text; null: ideal springs for tension, otherwise the bundled catalogue.",
    )
    count: Annotated[Count, Field(ge=1, le=MAX_COUNT)] | None = None
    """Number of equal springs side by side; stiffness and forces are those of each."""
    stiffness: Above | None = None
    """Stiffness of ideal springs."""
    ground_box: Box | None = None
    """For catalogue springs: box for the end on the ground. It does not apply to a spring between two moving links; set
    `between` to exclude these."""
    reach_max: Above | None = None
    """Largest distance of an end from the origin of the frame of its link."""
    pivot_distance_min: Above | None = None
    """Smallest distance of the ends from pivots."""
    holds: HoldsRequest | None = None
    """For catalogue springs: end positions at which the linkage stays without a hand or a drive."""
    hand_force_max: Above | None = None
    """For catalogue springs: largest hand force over the motion, at `hand_point` or at the body point."""
    target: TargetCurveRequest | None = None
    """For catalogue springs: curve that the springs approximate."""


Drives = Annotated[list[DriveRequest], Field(max_length=MAX_DRIVES)]


Springs = Annotated[list[SpringRequest], Field(max_length=MAX_SPRINGS)]


class RockerRequest(RequestModel):
    """A link on a hinge, instead of a linkage: a flap, a wiper, a boom."""

    pivot: FarPoint = Field(default_factory=lambda: [0.0, 0.0])
    start: Angle = 0.0
    """Direction of the link at the first position."""
    swing: Angle
    """Angle from the first to the last position; negative: clockwise."""
    length: Above
    """Distance from the pivot to the body point."""
