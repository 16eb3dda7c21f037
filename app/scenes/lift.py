"""The lift over HTTP and on the command line: requests, replies and their limits, answers, tables and files."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, JsonValue

from app.query import Angles as Unit
from app.query import (
    AngleUnit,
    Column,
    Computed,
    Count,
    Number,
    Numbers,
    Places,
    Query,
    ReplyModel,
    RequestModel,
    Resources,
    reply_model,
)
from linkage_atlas import FieldError, Work
from synthesis.scenes.lift.constraints import (
    ConstraintRow,
    Constraints,
    constraint_rows,
    measured_values,
    optimize_within,
)
from synthesis.scenes.lift.files import design_csv, design_dxf, design_svg, joint_columns, motion_columns
from synthesis.scenes.lift.motion import (
    Motion,
    Pneumatics,
    angular_accelerations,
    angular_velocities,
    condition,
    forces,
    largest_residual,
    link_angles,
    minimum_bore,
    motion,
    smallest_condition,
    velocity_by_instant_centre,
)
from synthesis.scenes.lift.optimum import (
    Objective,
    Optimum,
    OptimumMotion,
    Published,
    StrokeDesign,
    Task,
    optimize,
    optimize_batch,
    optimum_motion,
    published_for,
)
from synthesis.scenes.lift.pose import Cylinder, Design, joints, pose_at_turn, turns_at_length
from synthesis.sheet import csv_text

MIN_MAGNITUDE, MAX_MAGNITUDE = 1e-12, 1e12
"""Smallest and largest length, speed or acceleration (other than 0): beyond, squares and cubes leave float64."""
MAX_SAMPLES = 100_000
"""Times in one motion."""
EVEN_TIMES = 201
"""Times of a motion, unless the request says others."""
MAX_STEPS = 4_000
"""Height steps n of the discrete objective; the largest takes some seconds."""
MAX_CYLINDERS = 24
"""Cylinders in one batch."""
MAX_BATCH_STEPS = 12_000
"""Height steps n times cylinders in one batch."""


def _unit(name: str) -> dict[str, JsonValue]:
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
    include: Annotated[list[Extra], Field(max_length=16)] = Field(
        [], description="What else to compute; what is over the time stands in the CSV file too."
    )
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
        None, description="Limits of what a workshop can build; null: the source's problem as it is."
    )
    angle_unit: AngleUnit = "deg"


class BatchRequest(RequestModel):
    """Many cylinders, one stroke."""

    cylinders: Annotated[list[CylinderModel], Field(min_length=1, max_length=MAX_CYLINDERS)]
    stroke: Stroke
    objective: AnyObjective = DiscreteObjective(kind="discrete")
    upper_bound: Length = 600.0


DesignReply, PublishedReply = reply_model(Design), reply_model(Published)
ConstraintReply, MotionOfOptimum = reply_model(ConstraintRow), reply_model(OptimumMotion)


class UnconstrainedReply(ReplyModel):
    """The optimum of the source's problem for the same stroke, and the limits that it breaks."""

    design: DesignReply
    objective: float
    breaks: list[ConstraintReply]


class OptimizeReply(ReplyModel):
    """The best that was found, by a local search. `active` names the inequalities that hold it; `slacks` says how far away the
    others are.

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
    motion: MotionOfOptimum
    objective_of_published: float | None
    published: PublishedReply | None
    constraints: list[ConstraintReply] | None = None
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
    motion: MotionOfOptimum | None = None
    objective_of_published: float | None = None
    constraint: str | None = None
    amount: float | None = None
    detail: str | None = None


class BatchReply(ReplyModel):
    """A row for each cylinder, in the order of the request."""

    status: Literal["ok"]
    rows: list[BatchRow]


SHORTEST = 0.1
"""Least length of a side with constraints, as a share of the top height, unless the request says another."""
TRANSMISSION = 30.0
"""Degrees, unless the request says another."""
NOTES = {
    "discrete": "Mean squared deviation of the platform's speed from its mean, over even heights.",
    "continuous": "Squared deviation of the platform's speed from its mean, averaged over height.",
    "normalized": "Squared deviation of the platform's speed from its mean, averaged over height, over the squared mean.",
}


def _cylinder(model: CylinderModel) -> Cylinder:
    for name, value in (("speed", model.speed), ("acceleration", model.acceleration)):
        if 0 < abs(value) < MIN_MAGNITUDE:
            message = f"too small: 0 or at least {MIN_MAGNITUDE:g}, found {value:g}"
            raise FieldError(f"/cylinder/{name}", message, constraint=name)
    return Cylinder(model.length, model.speed, model.acceleration)


def _task(cylinder: CylinderModel, request: OptimizeRequest | BatchRequest) -> Task:
    objective = Objective(**request.objective.model_dump())
    return Task(_cylinder(cylinder), *request.stroke, objective, request.upper_bound)


def _found(found: Optimum, task: Task) -> dict[str, Any]:
    """What a reply and a row of a batch say of an optimum."""
    return {
        "status": "optimal",
        "design": found.design,
        "objective": found.objective,
        "active": found.active,
        "motion": optimum_motion(found, task),
    }


def _constraints(request: OptimizeRequest, given: ConstraintsModel) -> Constraints:
    """The constraints of a request with what it leaves to the service."""
    bound, shortest = request.upper_bound, SHORTEST * request.stroke[1]
    angle = given.transmission_angle_min
    least = math.radians(TRANSMISSION) if angle is None else Unit(request.angle_unit).inward(angle)
    if not least < 0.5 * math.pi:
        raise FieldError("/constraints/transmission_angle_min", "less than a quarter turn is wanted")

    def ranged(name: str, values: list[float | None] | None, low: float) -> tuple[float | None, float | None]:
        first, last = values or (low, bound)
        if first is not None and first > bound:
            field, least = f"/constraints/{name}", f"{first:.9g}"
            if values is None:
                field, least = "/upper_bound", f"the least {name}, a tenth of the top height,"
            message = f"{least} is above `upper_bound`, {bound:.9g}"
            raise FieldError(field, message, constraint=name, amount=first - bound)
        return first, bound if last is None else min(last, bound)

    if given.closed_length is None and request.cylinder.length > bound:
        message = f"{request.cylinder.length:.9g} is above `upper_bound`, {bound:.9g}: give a `closed_length`"
        amount = request.cylinder.length - bound
        raise FieldError("/cylinder/length", message, constraint="closed_length", amount=amount)
    closed = given.closed_length or (request.cylinder.length, bound)
    left, bottom, right, top = given.envelope
    return Constraints(
        lengths={name: ranged(name, getattr(given, name), shortest) for name in ("l2", "l3", "l4", "l5", "b")},
        closed_length=(closed[0] or MIN_MAGNITUDE, bound if closed[1] is None else closed[1]),
        extension_max=given.extension_max,
        dead_point_min=given.dead_point_min,
        acceleration_max=given.acceleration_max,
        jerk_max=given.jerk_max,
        rise_time=tuple(given.rise_time) if given.rise_time else (None, None),
        envelope=(left, bottom, right, top),
        transmission_min=least,
        force_ratio_max=given.force_ratio_max,
        start=given.start,
    )


def _optimum(request: OptimizeRequest, resources: Resources) -> tuple[Optimum, Task, Constraints | None]:
    task, work = _task(request.cylinder, request), resources.work()
    if request.constraints is None:
        return optimize(task, work), task, None
    limits = _constraints(request, request.constraints)
    return optimize_within(task, limits, work), task, limits


def answer_optimize(request: OptimizeRequest, resources: Resources) -> OptimizeReply:
    """The optimum design; of the source's problem with the published one beside it, else with that of the source's problem."""
    found, task, limits = _optimum(request, resources)
    published = published_for(task, found) if limits is None else None
    return OptimizeReply(
        **_found(found, task),
        closed_length=float(found.stroke_design.closed_length),
        objective_kind=task.objective.kind,
        slacks=found.slacks,
        equations=found.equations,
        objective_of_published=published and published.objective,
        published=published,
        **({} if limits is None else _within(found, task, limits, Unit(request.angle_unit).radian, resources.work())),
        note=NOTES[task.objective.kind],
        evaluations=found.evaluations,
    )


def _within(found: Optimum, task: Task, limits: Constraints, radian: float, work: Work) -> dict[str, Any]:
    """The limits beside what the optimum has, and the optimum of the source's problem with the limits that it breaks."""

    def rows(built: StrokeDesign, active: Sequence[str] = ()) -> list[ConstraintRow]:
        found = constraint_rows(limits, measured_values(built, task), active)
        return [
            replace(row, name="transmission_angle", value=row.value / radian, limit=row.limit / radian)
            if row.name == "transmission"
            else row
            for row in found
        ]

    constraints = rows(found.stroke_design, found.active)
    try:
        free = optimize(task, work)
    except FieldError:  # the source's problem has no design: the constraints have freed its closed length
        return {"constraints": constraints}
    breaks = [replace(row, active=False) for row in rows(free.stroke_design) if not row.satisfied]
    return {
        "constraints": constraints,
        "unconstrained": UnconstrainedReply(design=free.design, objective=free.objective, breaks=breaks),
        "cost": found.objective / free.objective - 1 if free.objective > 0 else None,
    }


def optimum_csv(request: OptimizeRequest, resources: Resources) -> bytes:
    """The optimum design with its motion at 201 times as comma-separated values."""
    found, task, _ = _optimum(request, resources)
    closed = float(found.stroke_design.closed_length)
    return design_csv(motion(found.design, replace(task.cylinder, length=closed)), closed).encode()


def _files(
    table: Callable[..., bytes], shown: Callable[..., tuple[Design, float]]
) -> dict[str, Callable[..., bytes]]:
    """The exports of a question: its table, and the lift that it shows, at its start and its top, as drawings."""
    drawings = {"svg": design_svg, "dxf": design_dxf}
    drawn = {kind: lambda *asked, draw=draw: draw(*shown(*asked)).encode() for kind, draw in drawings.items()}
    return {"csv": table, **drawn}


def _optimal(request: OptimizeRequest, resources: Resources) -> tuple[Design, float]:
    built = _optimum(request, resources)[0].stroke_design
    return built.design, float(built.turn)


def answer_batch(request: BatchRequest, resources: Resources) -> BatchReply:
    """The optimum for each cylinder; one that has none says why and does not stop the others."""
    if isinstance(request.objective, DiscreteObjective):
        steps = request.objective.n * len(request.cylinders)
        if steps > MAX_BATCH_STEPS:
            message = f"n times cylinders must be at most {MAX_BATCH_STEPS}, found {steps}"
            raise FieldError("/objective/n", message, constraint="batch_steps", amount=steps - MAX_BATCH_STEPS)
    tasks = [_task(cylinder, request) for cylinder in request.cylinders]
    rows = []
    for cylinder, task, found in zip(request.cylinders, tasks, optimize_batch(tasks, resources.work())):
        if isinstance(found, FieldError):
            reason = {name: found.details.get(name) for name in ("constraint", "amount")}
            row = {"status": "infeasible", "detail": found.message, **reason}
        else:
            published = published_for(task, found)
            row = {**_found(found, task), "objective_of_published": published and published.objective}
        rows.append(BatchRow(cylinder=cylinder.model_dump(), **row))
    return BatchReply(status="ok", rows=rows)


TABLE_ROWS = 21
"""Times that the table of a motion shows."""
LENGTHS = ("l2", "l3", "l4", "l5", "b")


def motion_table(reply: MotionReply) -> str:
    """The motion as text: the figures first, then at most `TABLE_ROWS` times."""
    lines = [
        f"{reply.direction} from {reply.height_start:.6g} to {reply.height_end:.6g} mm in {reply.rise_time:.6f} s",
        f"dead point at cylinder length {reply.dead_point_length:.6g} mm (height {reply.dead_point_height:.6g} mm), "
        f"top at {reply.length_top:.6g} mm",
        f"condition: start {reply.condition.start:.4g}, top {reply.condition.top:.4g}, min {reply.condition.min:.4g}",
    ]
    if reply.residual is not None:
        lines.append(f"largest loop residual {reply.residual:.2g} mm")
    for pose in reply.assemblies or []:
        lines.append(f"assembly at height {pose.height:.6g} mm{' (working branch)' if pose.working else ''}")
    if reply.forces is not None:
        lines.append(
            f"cylinder force {reply.forces.cylinder_min:.6g} to {reply.forces.cylinder_max:.6g} N, pressure up to "
            f"{reply.forces.pressure_max:.4g} bar ({'enough' if reply.forces.pressure_is_enough else 'not enough'}), "
            f"least bore {reply.forces.bore_min:.4g} mm"
        )
    lines += ["", f"{'time s':>12} {'height mm':>14} {'velocity mm/s':>14} {'acc. mm/s^2':>14} {'cylinder mm':>14}"]
    last = len(reply.time) - 1
    rows = sorted({round(k * last / (TABLE_ROWS - 1)) for k in range(TABLE_ROWS)})
    for k in rows:
        values = (reply.height[k], reply.velocity[k], reply.acceleration[k], reply.cylinder_length[k])
        lines.append(f"{reply.time[k]:12.6g} " + " ".join(f"{value:14.8g}" for value in values))
    if len(rows) <= last:
        lines.append(f"({len(rows)} of {last + 1} times; --json shows all)")
    return "\n".join(lines)


def optimize_table(reply: OptimizeReply) -> str:
    columns: list[tuple[str, DesignReply, float]] = [("optimum", reply.design, reply.objective)]
    if reply.published:
        columns.append(("published", reply.published.design, reply.published.objective))
    lines = [f"{'mm':>10} " + " ".join(f"{name:>14}" for name, _, _ in columns)]
    for name in LENGTHS:
        lines.append(f"{name:>10} " + " ".join(f"{getattr(design, name):14.6f}" for _, design, _ in columns))
    lines.append(f"{'objective':>10} " + " ".join(f"{value:14.7g}" for _, _, value in columns))
    lines += [
        f"{'closed l1':>10} {reply.closed_length:14.6f}",
        "",
        f"active: {', '.join(reply.active) or 'none'}",
        f"rise time {reply.motion.rise_time:.6f} s, speed at the start {reply.motion.velocity_start:.6g} mm/s, "
        f"mean over height {reply.motion.velocity_mean:.6g} mm/s",
    ]
    if reply.published:
        lines.append(f"published: {reply.published.reason}")
    if reply.constraints:
        lines += ["", f"{'constraint':>20} {'is':>14}        {'limit':>14}"]
        for row in reply.constraints:
            sign = ">=" if row.kind == "least" else "<="
            lines.append(f"{row.name:>20} {row.value:14.7g} {sign:>6} {row.limit:14.7g}{' *' if row.active else ''}")
        lines += ["* holds the design", ""]
    if reply.unconstrained and reply.cost is not None:
        broken = ", ".join(f"{row.name} {row.value:.6g}" for row in reply.unconstrained.breaks)
        lines.append(
            f"the source's problem has the objective {reply.unconstrained.objective:.6g} (this one: {reply.cost:+.1%}) "
            f"and is outside of: {broken or 'no limit'}"
        )
    lines.append(reply.note)
    return "\n".join(lines)


def batch_table(reply: BatchReply) -> str:
    names = ("length", "speed", *LENGTHS, "objective", "published", "rise time")
    lines = [" ".join(f"{name:>11}" for name in names)]
    for row in reply.rows:
        head = f"{row.cylinder['length']:11.6g} {row.cylinder['speed']:11.6g} "
        if row.design is None or row.motion is None or row.objective is None:
            lines.append(head + f"{row.constraint}: {row.detail}")
            continue
        values = [f"{getattr(row.design, name):11.4f}" for name in LENGTHS]
        published = "-" if row.objective_of_published is None else f"{row.objective_of_published:.4f}"
        lines.append(head + " ".join(values) + f" {row.objective:11.4f} {published:>11} {row.motion.rise_time:11.6f}")
    return "\n".join(lines)


LONG_SAMPLES = 2000


def _move(request: MotionRequest) -> Motion:
    if request.times is not None and request.samples is not None:
        raise FieldError("/times", "give either `times` or `samples`, not both")
    design = Design(**request.design.model_dump())
    return motion(design, _cylinder(request.cylinder), request.times, request.samples or EVEN_TIMES)


def answer_motion(request: MotionRequest, resources: Resources) -> MotionReply:
    """The motion that was asked for, and of the extras only those in ``include``."""
    work = resources.work()
    moved = _move(request)
    limits, design = moved.stroke, moved.pose.design
    # from the start to the end of the motion
    ends = [(limits.height_bottom, limits.turn_bottom), (limits.height_top, 0.0)]
    rising = request.cylinder.speed > 0
    heights, turns = zip(*(ends if rising else ends[::-1]))
    start, end = (float(value) for value in condition(design, turns))
    bottom, top = (start, end) if rising else (end, start)
    return MotionReply(
        status="ok",
        direction="rising" if rising else "lowering",
        rise_time=float(limits.duration),
        height_start=float(heights[0]),
        height_end=float(heights[1]),
        height_top=float(limits.height_top),
        dead_point_length=float(limits.length_dead),
        dead_point_height=float(pose_at_turn(design, limits.turn_dead).height),
        length_top=float(limits.length_top),
        condition=ConditionModel(start=start, top=top, bottom=bottom, min=smallest_condition(design, limits)[0]),
        angle_unit=request.angle_unit,
        **{name: Numbers(column) for name, column in motion_columns(moved).items()},
        **_extras(request, moved, work),
        forces=_forces(request, moved),
    )


def _forces(request: MotionRequest, moved: Motion) -> ForcesReply | None:
    given = request.pneumatics
    if given is None:
        return None
    if given.rod >= given.bore:
        raise FieldError("/pneumatics/rod", "the rod must be thinner than the bore", constraint="rod")
    drive = Pneumatics(**given.model_dump())
    found, duration = forces(moved, drive), float(moved.stroke.duration)
    # the largest ones are of the whole motion, however few times are asked for
    times = np.union1d(moved.time, np.linspace(0.0, duration, EVEN_TIMES))
    every = forces(motion(moved.pose.design, _cylinder(request.cylinder), times), drive)
    most = float(every.pressure.max())
    return ForcesReply(
        **{name: Numbers(getattr(found, name)) for name in ("weight", "cylinder", "link", "slide", "pressure")},
        pivot_O=Numbers(found.pivot_o),
        pivot_D=Numbers(found.pivot_d),
        cylinder_max=float(every.cylinder.max()),
        cylinder_min=float(every.cylinder.min()),
        pressure_max=most,
        bore_min=minimum_bore(every, drive),
        pressure_is_enough=most <= drive.pressure,
    )


def _extras(request: MotionRequest, moved: Motion, work: Work) -> dict[str, Any]:
    at, speed, design = moved.pose, moved.cylinder_speed, moved.pose.design
    radian = Unit(request.angle_unit).radian

    def per_link(prefix: str, angles: Any) -> dict[str, Numbers]:
        return {f"{prefix}{k}": Numbers(column / radian) for k, column in enumerate(angles.T, 1)}

    def points() -> dict[str, Any]:
        found = {name: Numbers(z.view(float).reshape(-1, 2)) for name, z in joints(at).items() if name in "ABC"}
        return {**found, "D": (-design.b, 0.0)}

    def instant_centre() -> list[float | None]:
        speeds = velocity_by_instant_centre(design, speed, at.height).tolist()
        return [value if math.isfinite(value) else None for value in speeds]

    def assemblies() -> list[Assembly]:
        turns = turns_at_length(design, request.cylinder.length)
        rows = zip(pose_at_turn(design, turns).height.tolist(), turns.tolist())
        return [
            Assembly(height=height, theta3=(turn + math.pi / 2) / radian, working=turn < moved.stroke.turn_dead)
            for height, turn in rows
        ]

    extras = {
        "angles": lambda: per_link("theta", link_angles(at)),
        "angular_velocities": lambda: per_link("link", angular_velocities(at, speed)),
        "angular_accelerations": lambda: per_link(
            "link", angular_accelerations(at, speed, moved.cylinder_acceleration)
        ),
        "points": points,
        "conditions": lambda: Numbers(condition(design, at.turn)),
        "residual": lambda: largest_residual(moved),
        "instant_centre": instant_centre,
        "assemblies": assemblies,
    }
    found = {}
    for name in dict.fromkeys(request.include):
        work.go_on()
        found[name] = extras[name]()
    return found


_PER_TIME = {"angular_velocities": "_s", "angular_accelerations": "_s2"}


def motion_csv(request: MotionRequest, resources: Resources) -> bytes:
    """The motion as comma-separated values, one time a line, with the forces and extras where they are asked for."""
    moved = _move(request)
    rows, found = motion_columns(moved), _forces(request, moved)
    for name, extra in _extras(request, moved, resources.work()).items():
        if name == "points":
            rows |= joint_columns(moved)
        elif isinstance(extra, dict):
            unit = request.angle_unit + _PER_TIME.get(name, "")
            rows |= {f"{name}_{link}_{unit}": column for link, column in extra.items()}
        elif name in ("conditions", "instant_centre"):
            rows[name] = extra
    if found is not None:
        rows |= {f"force_{name}": getattr(found, name) for name in ("weight", "cylinder", "link", "slide")}
        rows["pressure"] = found.pressure
    return csv_text(rows, "\n").encode()


def _moved(request: MotionRequest, _: Resources) -> tuple[Design, float]:
    moved = _move(request)
    return moved.pose.design, float(moved.stroke.turn_bottom)


QUERIES = (
    Query(
        command="lift motion",
        summary="Motion of a cylinder-driven lifting linkage, in closed form.",
        answer=answer_motion,
        table=motion_table,
        shows_units=False,
        exports=_files(motion_csv, _moved),
        is_long=lambda request: max(request.samples or 0, len(request.times or ())) > LONG_SAMPLES,
    ),
    Query(
        command="lift optimize",
        summary="Optimum design of a lifting linkage for a cylinder and a stroke.",
        answer=answer_optimize,
        table=optimize_table,
        shows_units=False,
        is_long=lambda _: True,
        exports=_files(optimum_csv, _optimal),
    ),
    Query(
        command="lift batch",
        summary="Optimum designs of a lifting linkage for many cylinders.",
        answer=answer_batch,
        table=batch_table,
        shows_units=False,
        is_long=lambda _: True,
    ),
)
