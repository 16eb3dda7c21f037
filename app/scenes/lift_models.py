"""Bodies of the lift's requests and replies, with their limits."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, JsonValue

from app.query import AngleUnit, Column, Computed, Count, Number, Places, ReplyModel, RequestModel

MIN_MAGNITUDE, MAX_MAGNITUDE = 1e-12, 1e12
"""Smallest and largest length, speed or acceleration (other than 0): beyond, squares and cubes leave float64."""
MAX_SAMPLES = 100_000
"""Times in one motion."""
MAX_STEPS = 4_000
"""Height steps n of the discrete objective; the largest takes some seconds."""
MAX_CYLINDERS = 24
"""Cylinders in one batch."""
MAX_BATCH_STEPS = 12_000
"""Height steps n times cylinders in one batch."""


def _unit(name: str) -> dict[str, JsonValue]:
    """The unit of a field, for its form."""
    return {"unit": name}


MM, MM_S, MM_S2, MM_S3, NEWTON, BAR = (_unit(name) for name in ("mm", "mm/s", "mm/s²", "mm/s³", "N", "bar"))
Length = Annotated[Number, Field(ge=MIN_MAGNITUDE, le=MAX_MAGNITUDE, json_schema_extra=MM)]
Rate = Annotated[Number, Field(ge=-MAX_MAGNITUDE, le=MAX_MAGNITUDE)]
Positive = Annotated[Number, Field(gt=0, le=MAX_MAGNITUDE)]
Place = Annotated[Number, Field(ge=-MAX_MAGNITUDE, le=MAX_MAGNITUDE)]
Time = Annotated[Number, Field(ge=-MAX_MAGNITUDE * MAX_MAGNITUDE, le=MAX_MAGNITUDE * MAX_MAGNITUDE)]
Extra = Literal[
    "angles",
    "angular_velocities",
    "angular_accelerations",
    "points",
    "conditions",
    "residual",
    "instant_centre",
    "assemblies",
]


class DesignModel(RequestModel):
    """The five fixed lengths."""

    l2: Length = Field(description="AB: platform to cylinder, a side of the triangle.")
    l3: Length = Field(description="AC: platform to link, a side of the triangle; less than l5.")
    l4: Length = Field(description="BC: the triangle's third side.")
    l5: Length = Field(description="DC: the link on the ground.")
    b: Length = Field(description="Distance of the slide from the cylinder's pivot.")


class CylinderModel(RequestModel):
    """The drive."""

    length: Length = Field(description="Length in the lowest position, l1'.")
    speed: Rate = Field(
        description="Speed of lengthening at the start; negative: lowering, from the top.", json_schema_extra=MM_S
    )
    acceleration: Rate = Field(0.0, description="Constant acceleration of lengthening.", json_schema_extra=MM_S2)


class PneumaticsModel(RequestModel):
    """What the platform carries, and the cylinder's piston; links and friction have no weight."""

    load: Annotated[Number, Field(ge=0, le=MAX_MAGNITUDE)] = Field(
        description="Vertical load on the platform.", json_schema_extra=NEWTON
    )
    mass: Annotated[Number, Field(ge=0, le=MAX_MAGNITUDE)] = Field(
        0.0, description="Mass on the platform besides: its weight and its inertia.", json_schema_extra=_unit("kg")
    )
    bore: Positive = Field(description="Diameter of the piston.", json_schema_extra=MM)
    rod: Annotated[Number, Field(ge=0, le=MAX_MAGNITUDE)] = Field(
        0.0,
        description="Diameter of the rod, for a cylinder that has to pull; less than the bore.",
        json_schema_extra=MM,
    )
    pressure: Positive = Field(6.0, description="Pressure available, over the surroundings.", json_schema_extra=BAR)


class MotionRequest(RequestModel):
    """A design, its cylinder, and when to look."""

    design: DesignModel
    cylinder: CylinderModel
    samples: Annotated[Count, Field(ge=2, le=MAX_SAMPLES)] | None = Field(
        None, description="Even times from start to end; 201 unless `times` are given."
    )
    times: Annotated[list[Time], Field(min_length=1, max_length=MAX_SAMPLES, fail_fast=True)] | None = Field(
        None, description="Times of your own, in place of `samples`.", json_schema_extra=_unit("s")
    )
    pneumatics: PneumaticsModel | None = Field(
        None, description="Load and piston: forces and pressure over the motion."
    )
    include: Annotated[list[Extra], Field(max_length=16)] = Field([], description="What else to compute.")
    angle_unit: AngleUnit = "deg"


class ConditionModel(ReplyModel):
    """Condition number of the loop equations' Jacobian, lengths in units of the top height."""

    start: float
    top: float
    bottom: float
    min: float


class Angles(ReplyModel):
    """One list for each link's direction."""

    theta1: Column
    theta2: Column
    theta3: Column
    theta4: Column
    theta5: Column


class AngularRates(ReplyModel):
    """One list for each link, in `angle_unit` per second (or per second squared)."""

    link1: Column
    link2: Column
    link3: Column
    link4: Column
    link5: Column


class Points(ReplyModel):
    """Positions of the joints, [x, y] at each time; O = (0, 0)."""

    A: Places
    B: Places
    C: Places
    D: tuple[float, float]


class Assembly(ReplyModel):
    """One of the poses that have the cylinder's length in the lowest position."""

    height: float
    theta3: float
    working: bool


class ForcesReply(ReplyModel):
    """Forces in N over the time and the pressure needed in bar; pivots as [x, y], of the ground on the part."""

    weight: Column
    cylinder: Column
    link: Column
    slide: Column
    pressure: Column
    pivot_O: Places
    pivot_D: Places
    cylinder_max: float = Field(description="Largest force that pushes.")
    cylinder_min: float = Field(description="Least force; negative: the cylinder has to pull.")
    pressure_max: float
    bore_min: float = Field(description="The bore that just carries the load at the pressure available.")
    pressure_is_enough: bool


class MotionReply(ReplyModel):
    """The motion; what was not asked for is null."""

    status: Literal["ok"]
    direction: Literal["rising", "lowering"]
    rise_time: float
    height_start: float
    height_end: float
    height_top: float
    dead_point_length: float
    dead_point_height: float
    length_top: float
    condition: ConditionModel
    angle_unit: AngleUnit
    time: Column
    height: Column
    velocity: Column
    acceleration: Column
    cylinder_length: Column
    cylinder_speed: Column
    angles: Angles | None = None
    angular_velocities: AngularRates | None = None
    angular_accelerations: AngularRates | None = None
    points: Points | None = None
    conditions: Column | None = None
    residual: float | None = None
    instant_centre: Computed[list[float | None]] | None = None
    assemblies: list[Assembly] | None = None
    forces: ForcesReply | None = None


class DiscreteObjective(RequestModel):
    """Mean squared deviation of the platform's speed over n + 1 even heights."""

    kind: Literal["discrete"]
    n: Annotated[Count, Field(ge=2, le=MAX_STEPS)] = 310
    include_start: Annotated[bool, Field(strict=True)] = Field(
        True, description="False leaves the lowest height out, as the source's (30) is printed."
    )


class ContinuousObjective(RequestModel):
    """The same as an integral over height (28); not divided by the mean speed."""

    kind: Literal["continuous"]


class NormalizedObjective(RequestModel):
    """The integral (28) divided by the squared mean speed (29)."""

    kind: Literal["normalized"]


AnyObjective = Annotated[DiscreteObjective | ContinuousObjective | NormalizedObjective, Field(discriminator="kind")]
Stroke = Annotated[
    list[Length], Field(min_length=2, max_length=2, json_schema_extra={"parts": ["start", "top"], "unit": "mm"})
]
Range = Annotated[
    list[Length | None],
    Field(min_length=2, max_length=2, json_schema_extra={"parts": ["from", "to"], "unit": "mm"}),
]
Times = Annotated[
    list[Positive | None],
    Field(min_length=2, max_length=2, json_schema_extra={"parts": ["from", "to"], "unit": "s"}),
]
Box = Annotated[
    list[Place | None],
    Field(
        min_length=4,
        max_length=4,
        json_schema_extra={"parts": ["left", "bottom", "right", "top"], "unit": "mm"},
    ),
]


class ConstraintsModel(RequestModel):
    """What the design must keep to besides the stroke. Null takes a limit away, where nothing else is said."""

    extension_max: Annotated[Number, Field(gt=1, le=100)] | None = Field(
        1.8, description="Cylinder at the top over its closed length; 1.8 is what a single stage can."
    )
    dead_point_min: Annotated[Number, Field(ge=0, lt=1)] | None = Field(
        0.05, description="Cylinder length from the dead point up to the start, as a share of the closed length."
    )
    transmission_angle_min: Annotated[Number, Field(ge=0, lt=90, json_schema_extra=_unit("angle"))] | None = Field(
        None,
        description="Of the cylinder against the direction in which it cannot move B; null: 30 degrees, 0: none.",
    )
    acceleration_max: Positive | None = Field(
        1000.0, description="Largest acceleration of the platform, up or down.", json_schema_extra=MM_S2
    )
    jerk_max: Positive | None = Field(
        10_000.0, description="Largest jerk of the platform while it runs.", json_schema_extra=MM_S3
    )
    closed_length: Range | None = Field(
        None, description="Closed length of the cylinder; null: from the cylinder's own to `upper_bound`."
    )
    l2: Range | None = Field(None, description="AB; null: from a tenth of the top height to `upper_bound`.")
    l3: Range | None = Field(None, description="AC; null: as l2.")
    l4: Range | None = Field(None, description="BC; null: as l2.")
    l5: Range | None = Field(None, description="DC; null: as l2.")
    b: Range | None = Field(None, description="Slide to pivot; null: as l2.")
    envelope: Box = Field(
        [None, 0.0, None, None], description="Box of all joints from start to top; the pivot O is (0, 0)."
    )
    rise_time: Times | None = Field(None, description="Time of the rise; null: any.")
    force_ratio_max: Positive | None = Field(None, description="Cylinder force over load; null: any.")
    start: Literal["any", "collinear"] = Field(
        "any", description="Collinear: A, B and O in a line at the start (31), and l3, l4 at most l2 (35)."
    )


class OptimizeRequest(RequestModel):
    """A cylinder and the stroke wanted of it."""

    cylinder: CylinderModel
    stroke: Stroke = Field(description="Height of the platform at the start and at the top.")
    objective: AnyObjective = DiscreteObjective(kind="discrete")
    upper_bound: Length = Field(600.0, description="No length of the design is larger.")
    constraints: ConstraintsModel | None = Field(
        None, description="Limits that make the design buildable; null: the source's problem as it is."
    )
    angle_unit: AngleUnit = "deg"


class BatchRequest(RequestModel):
    """Many cylinders, one stroke."""

    cylinders: Annotated[list[CylinderModel], Field(min_length=1, max_length=MAX_CYLINDERS)]
    stroke: Stroke
    objective: AnyObjective = DiscreteObjective(kind="discrete")
    upper_bound: Length = 600.0


class DesignReply(ReplyModel):
    """The five fixed lengths."""

    l2: float
    l3: float
    l4: float
    l5: float
    b: float


class OptimumMotion(ReplyModel):
    """How the optimum moves."""

    rise_time: float
    velocity_start: float
    velocity_bottom: float
    velocity_mean: float
    dead_point_length: float


class PublishedReply(ReplyModel):
    """The published design, put back on the constraints that its printed digits miss by their rounding."""

    design: DesignReply
    objective: float
    slope: float = Field(description="df/dl2 along l4 = l2.")
    reason: str
    source: Literal["printed", "fitted"] = Field(description="Fitted: a digit that is lost in print is inferred.")


class ConstraintRow(ReplyModel):
    """One limit: what the design has beside it, over 2,001 poses, and whether it holds the design."""

    name: str
    value: float
    kind: Literal["least", "most"]
    limit: float
    active: bool


class UnconstrainedReply(ReplyModel):
    """The optimum of the source's problem for the same stroke, and the limits that it breaks."""

    design: DesignReply
    objective: float
    breaks: list[ConstraintRow]


class OptimizeReply(ReplyModel):
    """The optimum. `active` names the inequalities that hold it; `slacks` says how far away the others are.

    With constraints a slack is a share of the limit, of a length a share of the top height; else a length.
    """

    status: Literal["optimal"]
    design: DesignReply
    closed_length: float
    objective: float
    objective_kind: Literal["discrete", "continuous", "normalized"]
    active: list[str]
    slacks: dict[str, float]
    equations: dict[str, float]
    motion: OptimumMotion
    objective_of_published: float | None
    published: PublishedReply | None
    constraints: list[ConstraintRow] | None = None
    unconstrained: UnconstrainedReply | None = None
    cost: float | None = Field(None, description="Objective over the unconstrained one's, less 1.")
    note: str
    evaluations: int


class BatchRow(ReplyModel):
    """One cylinder's optimum, or the constraint that it fails."""

    cylinder: dict[str, float]
    status: Literal["optimal", "infeasible"]
    design: DesignReply | None = None
    objective: float | None = None
    active: list[str] | None = None
    motion: OptimumMotion | None = None
    objective_of_published: float | None = None
    constraint: str | None = None
    amount: float | None = None
    detail: str | None = None


class BatchReply(ReplyModel):
    """A row for each cylinder, in the order of the request."""

    status: Literal["ok"]
    rows: list[BatchRow]
