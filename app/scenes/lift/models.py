"""Requests and replies of the questions about the lift."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, JsonValue

from app.query import AngleUnit, Column, Count, Number, PointColumn, ReplyModel, RequestModel, reply_model
from linkage_atlas import FieldError
from synthesis.scenes.lift.constraints import ConstraintRow
from synthesis.scenes.lift.optimum import OptimumMotion
from synthesis.scenes.lift.pose import Cylinder, Design

MIN_MAGNITUDE = 1e-12
"""Smallest length, speed or acceleration other than 0; squares and cubes of smaller values underflow in float64."""
MAX_MAGNITUDE = 1e12
"""Largest length, speed or acceleration; squares and cubes of larger values overflow in float64."""
MAX_SAMPLES = 100_000
"""Largest number of times in a motion."""
DEFAULT_SAMPLES = 201
"""Default number of times in a motion."""
MAX_STEPS = 4_000
"""Largest number of height steps n of the discrete objective; a search with it takes some seconds."""


def _unit(name: str) -> dict[str, JsonValue]:
    return {"unit": name}


MM, MM_S, MM_S2, MM_S3, NEWTON, BAR = (_unit(name) for name in ("mm", "mm/s", "mm/s²", "mm/s³", "N", "bar"))
Length = Annotated[Number, Field(ge=MIN_MAGNITUDE, le=MAX_MAGNITUDE, json_schema_extra=MM)]
Rate = Annotated[Number, Field(ge=-MAX_MAGNITUDE, le=MAX_MAGNITUDE)]
Positive = Annotated[Number, Field(gt=0, le=MAX_MAGNITUDE)]
Coordinate = Annotated[Number, Field(ge=-MAX_MAGNITUDE, le=MAX_MAGNITUDE)]
Time = Annotated[Number, Field(ge=-MAX_MAGNITUDE * MAX_MAGNITUDE, le=MAX_MAGNITUDE * MAX_MAGNITUDE)]
Extra = Literal["angles", "angular_velocities", "angular_accelerations", "points"]


class DesignModel(RequestModel):
    """The five fixed lengths of a lift."""

    l2: Length = Field(description="Side AB of the triangle, from the platform to the cylinder.")
    l3: Length = Field(description="Side AC of the triangle, from the platform to the link; must be less than l5.")
    l4: Length = Field(description="Side BC of the triangle.")
    l5: Length = Field(description="Length DC of the link to the ground.")
    b: Length = Field(description="Distance from the slide to the pivot of the cylinder.")


class CylinderModel(RequestModel):
    """The cylinder that drives a lift."""

    length: Length = Field(description="Length l1' of the cylinder in the lowest position.")
    speed: Rate = Field(
        description="Extension speed at the start; a negative speed lowers the platform from the top.",
        json_schema_extra=MM_S,
    )
    acceleration: Rate = Field(0.0, description="Constant acceleration of the extension.", json_schema_extra=MM_S2)


class PneumaticsModel(RequestModel):
    """Load on the platform and dimensions of the piston; the links have no weight and the joints no friction."""

    load: Annotated[Number, Field(ge=0, le=MAX_MAGNITUDE)] = Field(
        description="Vertical load on the platform.", json_schema_extra=NEWTON
    )
    mass: Annotated[Number, Field(ge=0, le=MAX_MAGNITUDE)] = Field(
        0.0,
        description="Additional mass on the platform, with its weight and its inertia.",
        json_schema_extra=_unit("kg"),
    )
    bore: Positive = Field(description="Diameter of the piston.", json_schema_extra=MM)
    rod: Annotated[Number, Field(ge=0, le=MAX_MAGNITUDE)] = Field(
        0.0,
        description="Diameter of the rod, needed if the cylinder has to pull; must be less than the bore.",
        json_schema_extra=MM,
    )
    pressure: Positive = Field(6.0, description="Available gauge pressure.", json_schema_extra=BAR)


class MotionRequest(RequestModel):
    """A design, its cylinder, and the times at which the motion is computed."""

    design: DesignModel
    cylinder: CylinderModel
    samples: Annotated[Count, Field(ge=2, le=MAX_SAMPLES)] | None = Field(
        None, description="Number of evenly spaced times from start to end; default: 201, unless `times` is given."
    )
    times: Annotated[list[Time], Field(min_length=1, max_length=MAX_SAMPLES, fail_fast=True)] | None = Field(
        None, description="Times of the motion, instead of `samples`.", json_schema_extra=_unit("s")
    )
    pneumatics: PneumaticsModel | None = Field(
        None, description="Load and piston, to compute forces and pressure over the motion."
    )
    include: Annotated[list[Extra], Field(max_length=16)] = Field(
        [], description="Additional results to compute; results over time are also columns of the CSV file."
    )
    angle_unit: AngleUnit = "deg"


class Points(ReplyModel):
    """Positions of the joints, [x, y] at each time; O = (0, 0)."""

    A: PointColumn
    B: PointColumn
    C: PointColumn
    D: tuple[float, float]


class ForcesReply(ReplyModel):
    """Forces in N and required pressure in bar over time; a pivot force [x, y] is exerted by the ground."""

    weight: Column
    cylinder: Column
    link: Column
    slide: Column
    pressure: Column
    pivot_O: PointColumn
    pivot_D: PointColumn
    cylinder_max: float = Field(description="Largest pushing force.")
    cylinder_min: float = Field(description="Smallest force; if it is negative, the cylinder has to pull.")
    pressure_max: float
    bore_min: float = Field(description="Smallest bore that carries the load at the available pressure.")
    pressure_is_enough: bool


class MotionReply(ReplyModel):
    """Motion of a lift; a result that the request does not include is null."""

    status: Literal["ok"]
    direction: Literal["rising", "lowering"]
    rise_time: float
    height_start: float
    height_end: float
    height_top: float
    dead_point_length: float
    dead_point_height: float
    length_top: float
    angle_unit: AngleUnit
    time: Column
    height: Column
    velocity: Column
    acceleration: Column
    cylinder_length: Column
    cylinder_speed: Column
    angles: dict[str, Column] | None = Field(
        None, description="Directions `theta1` to `theta5` of the links over time."
    )
    angular_velocities: dict[str, Column] | None = Field(
        None, description="Angular velocities `link1` to `link5`, in `angle_unit` per second."
    )
    angular_accelerations: dict[str, Column] | None = Field(
        None, description="Angular accelerations `link1` to `link5`, in `angle_unit` per second squared."
    )
    points: Points | None = None
    forces: ForcesReply | None = None


class DiscreteObjective(RequestModel):
    """Mean squared deviation of the platform's speed at n + 1 evenly spaced heights."""

    kind: Literal["discrete"]
    n: Annotated[Count, Field(ge=2, le=MAX_STEPS)] = 310
    include_start: Annotated[bool, Field(strict=True)] = Field(
        True, description="False omits the lowest height, as in the printed equation (30) of the source."
    )


class ContinuousObjective(RequestModel):
    """Integral (28) of the squared deviation over height, not divided by the mean speed."""

    kind: Literal["continuous"]


class NormalizedObjective(RequestModel):
    """The integral (28) divided by the squared mean speed (29)."""

    kind: Literal["normalized"]


AnyObjective = Annotated[DiscreteObjective | ContinuousObjective | NormalizedObjective, Field(discriminator="kind")]
Stroke = Annotated[
    list[Length], Field(min_length=2, max_length=2, json_schema_extra={"parts": ["start", "top"], "unit": "mm"})
]
Range = Annotated[
    list[Length | None], Field(min_length=2, max_length=2, json_schema_extra={"parts": ["from", "to"], "unit": "mm"})
]
Times = Annotated[
    list[Positive | None], Field(min_length=2, max_length=2, json_schema_extra={"parts": ["from", "to"], "unit": "s"})
]
Box = Annotated[
    list[Coordinate | None],
    Field(min_length=4, max_length=4, json_schema_extra={"parts": ["left", "bottom", "right", "top"], "unit": "mm"}),
]


class ConstraintsModel(RequestModel):
    """Limits of the design other than the stroke. Null removes a limit, unless its description states a default."""

    extension_max: Annotated[Number, Field(gt=1, le=100)] | None = Field(
        1.8,
        description="Largest ratio of the cylinder's length at the top to its closed length; 1.8 is the limit of a "
        "single-stage cylinder.",
    )
    dead_point_min: Annotated[Number, Field(ge=0, lt=1)] | None = Field(
        0.05,
        description="Smallest extension of the cylinder from the dead point to the start, as a fraction of the closed "
        "length.",
    )
    transmission_angle_min: Annotated[Number, Field(ge=0, lt=90, json_schema_extra=_unit("angle"))] | None = Field(
        None,
        description="Smallest angle between the cylinder and the direction in which it cannot move B; null: 30 degrees; "
        "0: no limit.",
    )
    acceleration_max: Positive | None = Field(
        1000.0, description="Largest acceleration of the platform in either direction.", json_schema_extra=MM_S2
    )
    jerk_max: Positive | None = Field(
        10_000.0, description="Largest jerk of the platform during the motion.", json_schema_extra=MM_S3
    )
    closed_length: Range | None = Field(
        None, description="Closed length of the cylinder; null: from `cylinder.length` to `upper_bound`."
    )
    l2: Range | None = Field(None, description="Length AB; null: from a tenth of the top height to `upper_bound`.")
    l3: Range | None = Field(None, description="Length AC; null: the same range as for l2.")
    l4: Range | None = Field(None, description="Length BC; null: the same range as for l2.")
    l5: Range | None = Field(None, description="Length DC; null: the same range as for l2.")
    b: Range | None = Field(None, description="Distance from the slide to the pivot; null: the same range as for l2.")
    envelope: Box = Field(
        [None, 0.0, None, None],
        description="Box that contains all joints during the whole rise; the pivot O is (0, 0).",
    )
    rise_time: Times | None = Field(None, description="Duration of the rise; null: no limit.")
    force_ratio_max: Positive | None = Field(
        None, description="Largest ratio of cylinder force to load; null: no limit."
    )
    start: Literal["any", "collinear"] = Field(
        "any", description="collinear: A, B and O are collinear at the start (31), and l3 and l4 are at most l2 (35)."
    )


class OptimizeRequest(RequestModel):
    """A cylinder and a required stroke, for which a design is optimized."""

    cylinder: CylinderModel
    stroke: Stroke = Field(description="Height of the platform at the start and at the top.")
    objective: AnyObjective = DiscreteObjective(kind="discrete")
    upper_bound: Length = Field(600.0, description="Largest length of the design.")
    constraints: ConstraintsModel | None = Field(
        None,
        description="Limits of a design that can be built; null: the problem of the source, without these limits.",
    )
    angle_unit: AngleUnit = "deg"


DesignReply, ConstraintReply = reply_model(Design), reply_model(ConstraintRow)
MotionOfOptimum = reply_model(OptimumMotion)


class UnconstrainedReply(ReplyModel):
    """The optimum of the source's problem for the same stroke, and the limits that it violates."""

    design: DesignReply
    objective: float
    violated: list[ConstraintReply]


class OptimizeReply(ReplyModel):
    """The best design of a local search, its active inequalities and the slacks of the inactive inequalities.

    With constraints, a slack is a fraction of the limit, or of the top height if it limits a length; else it is a length.
    """

    status: Literal["optimal"]
    design: DesignReply
    closed_length: float
    objective: float
    objective_kind: Literal["discrete", "continuous", "normalized"]
    active: list[str]
    slacks: dict[str, float]
    motion: MotionOfOptimum
    constraints: list[ConstraintReply] | None = None
    unconstrained: UnconstrainedReply | None = None
    objective_increase: float | None = Field(
        None, description="Relative increase of the objective due to the constraints; null if it is undefined."
    )
    note: str


def cylinder_of(model: CylinderModel) -> Cylinder:
    """Return the cylinder of a request; raise `FieldError` if a rate is too small to be squared."""
    for name, value in (("speed", model.speed), ("acceleration", model.acceleration)):
        if 0 < abs(value) < MIN_MAGNITUDE:
            message = f"must be 0 or at least {MIN_MAGNITUDE:g} in size; it is {value:g}"
            raise FieldError(f"/cylinder/{name}", message, constraint=name)
    return Cylinder(model.length, model.speed, model.acceleration)
