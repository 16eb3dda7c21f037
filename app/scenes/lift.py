"""The lift over HTTP and on the command line: answers made from `synthesis.lift`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from app.query import Angles, Export, Query, Resources
from app.scenes.lift_models import (
    MAX_BATCH_STEPS,
    MIN_MAGNITUDE,
    Assembly,
    BatchReply,
    BatchRequest,
    BatchRow,
    ConditionModel,
    CylinderModel,
    DesignReply,
    DiscreteObjective,
    MotionReply,
    MotionRequest,
    OptimizeReply,
    OptimizeRequest,
    OptimumMotion,
    PublishedReply,
)
from app.scenes.lift_tables import batch_table, motion_table, optimize_table
from linkage_atlas import FieldError, Work

if TYPE_CHECKING:
    from synthesis.lift.motion import Motion
    from synthesis.lift.objective import Task
    from synthesis.lift.optimum import Optimum
    from synthesis.lift.pose import Cylinder
    from synthesis.lift.published import Published


def _cylinder(model: CylinderModel) -> Cylinder:
    from synthesis.lift.pose import Cylinder

    for name, value in (("speed", model.speed), ("acceleration", model.acceleration)):
        if 0 < abs(value) < MIN_MAGNITUDE:
            message = f"too small: 0 or at least {MIN_MAGNITUDE:g}, found {value:g}"
            raise FieldError(f"/cylinder/{name}", message, constraint=name)
    return Cylinder(model.length, model.speed, model.acceleration)


def _move(request: MotionRequest) -> Motion:
    from synthesis.lift.motion import motion
    from synthesis.lift.pose import Design

    if request.times is not None and request.samples is not None:
        raise FieldError("/times", "give either `times` or `samples`, not both")
    design = Design(**request.design.model_dump())
    return motion(design, _cylinder(request.cylinder), request.times, request.samples or 201)


def _columns(moved: Motion) -> dict[str, list[float]]:
    """What every reply and every file lists over the time."""
    columns = {
        "time": moved.time,
        "height": moved.pose.height,
        "velocity": moved.velocity,
        "acceleration": moved.acceleration,
        "cylinder_length": moved.cylinder_length,
        "cylinder_speed": moved.cylinder_speed,
    }
    return {name: column.tolist() for name, column in columns.items()}


def answer_motion(request: MotionRequest, resources: Resources) -> MotionReply:
    """The motion that was asked for, and of the extras only those in ``include``."""
    from synthesis.lift.loops import condition, smallest_condition
    from synthesis.lift.pose import pose_at_turn

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
        **_columns(moved),
        **_extras(request, moved, work),
    )


def _extras(request: MotionRequest, moved: Motion, work: Work) -> dict[str, Any]:
    """Only what ``include`` asks for."""
    from synthesis.lift import loops, pose

    at, speed, design = moved.pose, moved.cylinder_speed, moved.pose.design
    radian = Angles(request.angle_unit).radian

    def per_link(prefix: str, angles: Any) -> dict[str, list[float]]:
        return {f"{prefix}{k}": (column / radian).tolist() for k, column in enumerate(angles.T, 1)}

    def points() -> dict[str, Any]:
        heights, link = at.height.tolist(), design.l3 * at.sin_turn - design.b
        return {
            "A": [(-design.b, height) for height in heights],
            "B": list(zip(at.x.tolist(), at.y.tolist())),
            "C": list(zip(link.tolist(), at.root.tolist())),
            "D": (-design.b, 0.0),
        }

    def instant_centre() -> list[float | None]:
        speeds = loops.velocity_by_instant_centre(design, speed, at.height).tolist()
        return [value if math.isfinite(value) else None for value in speeds]

    def assemblies() -> list[Assembly]:
        turns = pose.turns_at_length(design, request.cylinder.length)
        rows = zip(pose.pose_at_turn(design, turns).height.tolist(), turns.tolist())
        return [
            Assembly(height=height, theta3=(turn + math.pi / 2) / radian, working=turn < moved.stroke.turn_dead)
            for height, turn in rows
        ]

    extras = {
        "angles": lambda: per_link("theta", loops.link_angles(at)),
        "angular_velocities": lambda: per_link("link", loops.angular_velocities(at, speed)),
        "angular_accelerations": lambda: per_link(
            "link", loops.angular_accelerations(at, speed, moved.cylinder_acceleration)
        ),
        "points": points,
        "conditions": lambda: loops.condition(design, at.turn).tolist(),
        "residual": lambda: loops.largest_residual(moved),
        "instant_centre": instant_centre,
        "assemblies": assemblies,
    }
    found = {}
    for name in set(request.include):
        work.go_on()
        found[name] = extras[name]()
    return found


def _task(cylinder: CylinderModel, request: OptimizeRequest | BatchRequest) -> Task:
    from synthesis.lift.objective import Objective, Task

    objective = Objective(**request.objective.model_dump())
    return Task(_cylinder(cylinder), *request.stroke, objective, request.upper_bound)


def _optimum(optimum: Optimum, published: Published | None, cylinder: CylinderModel) -> dict[str, Any]:
    """What a reply and a row of a batch say of an optimum."""
    return {
        "status": "optimal",
        "design": DesignReply(**optimum.design.as_dict()),
        "objective": optimum.objective,
        "active": list(optimum.active),
        "motion": OptimumMotion(
            rise_time=optimum.duration,
            velocity_start=optimum.velocity_bottom if cylinder.speed > 0 else 0.0,
            velocity_bottom=optimum.velocity_bottom,
            velocity_mean=optimum.mean_velocity,
            dead_point_length=optimum.dead_point_length,
        ),
        "objective_of_published": published.objective if published else None,
    }


LONG_SAMPLES = 2000

NOTES = {
    "discrete": "The sum depends on n through its sample at the start, where the platform is fastest; "
    "as n grows the optimum runs away to ever longer arms.",
    "continuous": "Rewards slowness: it falls to 0 as the arms grow, so that the upper bound decides. "
    "The normalized objective does not.",
    "normalized": "The variance of the speed in units of its squared mean: evenness alone, whatever the speed. "
    "Its optimum does not depend on n, and on the upper bound only when that is in the way.",
}


def answer_optimize(request: OptimizeRequest, resources: Resources) -> OptimizeReply:
    """The optimum design, and the published one beside it."""
    from synthesis.lift.optimum import optimize
    from synthesis.lift.published import published_for

    task = _task(request.cylinder, request)
    optimum = optimize(task, resources.work())
    published = published_for(task, optimum)
    beside = None
    if published:
        design = DesignReply(**published.design.as_dict())
        beside = PublishedReply(
            design=design, objective=published.objective, slope=published.slope, reason=published.reason
        )
    return OptimizeReply(
        **_optimum(optimum, published, request.cylinder),
        objective_kind=task.objective.kind,
        slacks=optimum.slacks,
        equations=optimum.equations,
        published=beside,
        note=NOTES[task.objective.kind],
        evaluations=optimum.evaluations,
    )


def answer_batch(request: BatchRequest, resources: Resources) -> BatchReply:
    """The optimum for each cylinder; one that has none says why and does not stop the others."""
    from synthesis.lift.optimum import optimize_batch
    from synthesis.lift.published import published_for

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
            row = _optimum(found, published_for(task, found), cylinder)
        rows.append(BatchRow(cylinder=cylinder.model_dump(), **row))
    return BatchReply(status="ok", rows=rows)


def motion_csv(request: MotionRequest, resources: Resources) -> bytes:
    """The motion as comma-separated values, one time a line."""
    from synthesis.sheet import csv_text

    return csv_text(_columns(_move(request)), "\n").encode()


INITIAL_DESIGN = {"l2": 300.0, "l3": 180.0, "l4": 240.0, "l5": 330.0, "b": 480.0}
OPTIMUM_DESIGN = {"l2": 351.9, "l3": 162.8, "l4": 351.9, "l5": 347.2, "b": 535.8}
CYLINDER = {"length": 220.0, "speed": 100.0}

QUERIES = (
    Query(
        path="/v1/lift/motion",
        command="lift motion",
        summary="Motion of a cylinder-driven lifting linkage, in closed form.",
        request=MotionRequest,
        reply=MotionReply,
        answer=answer_motion,
        table=motion_table,
        examples={
            "initial": {"design": INITIAL_DESIGN, "cylinder": CYLINDER, "samples": 21},
            "published": {
                "design": OPTIMUM_DESIGN,
                "cylinder": CYLINDER,
                "times": [0.0, 0.5, 1.0, 3.0, 5.0, 7.0],
                "include": ["angles", "residual", "assemblies"],
            },
            "lowering": {
                "design": INITIAL_DESIGN,
                "cylinder": {"length": 220.0, "speed": -120.0, "acceleration": 10.0},
                "samples": 11,
                "include": ["points"],
            },
        },
        exports={"csv": Export("text/csv; charset=utf-8", motion_csv)},
        is_long=lambda request: max(request.samples or 0, len(request.times or ())) > LONG_SAMPLES,
    ),
    Query(
        path="/v1/lift/optimize",
        command="lift optimize",
        summary="Optimum design of a lifting linkage for a cylinder and a stroke.",
        request=OptimizeRequest,
        reply=OptimizeReply,
        answer=answer_optimize,
        table=optimize_table,
        is_long=lambda _: True,
        examples={
            "published": {
                "cylinder": CYLINDER,
                "stroke": [200.0, 510.0],
                "objective": {"kind": "discrete", "n": 310},
                "upper_bound": 600.0,
            },
            "even": {"cylinder": CYLINDER, "stroke": [200.0, 510.0], "objective": {"kind": "normalized"}},
        },
    ),
    Query(
        path="/v1/lift/batch",
        command="lift batch",
        summary="Optimum designs of a lifting linkage for many cylinders.",
        request=BatchRequest,
        reply=BatchReply,
        answer=answer_batch,
        table=batch_table,
        is_long=lambda _: True,
        examples={
            "cylinders": {
                "cylinders": [
                    {"length": 200.0, "speed": 100.0},
                    {"length": 220.0, "speed": 100.0},
                    {"length": 220.0, "speed": 70.0},
                ],
                "stroke": [200.0, 510.0],
                "objective": {"kind": "discrete", "n": 310},
            },
        },
    ),
)
