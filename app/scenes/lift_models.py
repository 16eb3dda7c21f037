"""Bodies of the lift's requests and replies, with their limits."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from app.query import AngleUnit, Column, Computed, Count, Number, ReplyModel, RequestModel

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

Length = Annotated[Number, Field(ge=MIN_MAGNITUDE, le=MAX_MAGNITUDE)]
Rate = Annotated[Number, Field(ge=-MAX_MAGNITUDE, le=MAX_MAGNITUDE)]
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
    speed: Rate = Field(description="Speed of lengthening at the start; negative: lowering, from the top.")
    acceleration: Rate = Field(0.0, description="Constant acceleration of lengthening.")


class MotionRequest(RequestModel):
    """A design, its cylinder, and when to look."""

    design: DesignModel
    cylinder: CylinderModel
    samples: Annotated[Count, Field(ge=2, le=MAX_SAMPLES)] | None = Field(
        None, description="Even times from start to end; 201 unless `times` are given."
    )
    times: Annotated[list[Time], Field(min_length=1, max_length=MAX_SAMPLES, fail_fast=True)] | None = Field(
        None, description="Times of your own, in place of `samples`."
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

    A: Computed[list[tuple[float, float]]]
    B: Computed[list[tuple[float, float]]]
    C: Computed[list[tuple[float, float]]]
    D: tuple[float, float]


class Assembly(ReplyModel):
    """One of the poses that have the cylinder's length in the lowest position."""

    height: float
    theta3: float
    working: bool


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


class DiscreteObjective(RequestModel):
    """Mean squared deviation of the platform's speed over n + 1 even heights."""

    kind: Literal["discrete"]
    n: Annotated[Count, Field(ge=2, le=MAX_STEPS)] = 310
    include_start: Annotated[bool, Field(strict=True)] = Field(
        True, description="False leaves the lowest height out, as the source's (30) is printed."
    )


class ContinuousObjective(RequestModel):
    """The same as an integral over height. Rewards slowness: its optimum is always on the upper bound."""

    kind: Literal["continuous"]


class NormalizedObjective(RequestModel):
    """The integral divided by the squared mean speed: has an interior optimum, whatever the bound."""

    kind: Literal["normalized"]


AnyObjective = Annotated[DiscreteObjective | ContinuousObjective | NormalizedObjective, Field(discriminator="kind")]
Stroke = Annotated[list[Length], Field(min_length=2, max_length=2)]


class OptimizeRequest(RequestModel):
    """A cylinder and the stroke wanted of it."""

    cylinder: CylinderModel
    stroke: Stroke = Field(description="Height of the platform at the start and at the top.")
    objective: AnyObjective = DiscreteObjective(kind="discrete")
    upper_bound: Length = Field(600.0, description="No length of the design is larger.")


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
    slope: float = Field(description="df/dl2 along l4 = l2; 0 at an interior optimum.")
    reason: str


class OptimizeReply(ReplyModel):
    """The optimum. `active` names the inequalities that hold it; `slacks` says how far away the others are."""

    status: Literal["optimal"]
    design: DesignReply
    objective: float
    objective_kind: Literal["discrete", "continuous", "normalized"]
    active: list[str]
    slacks: dict[str, float]
    equations: dict[str, float]
    motion: OptimumMotion
    objective_of_published: float | None
    published: PublishedReply | None
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
