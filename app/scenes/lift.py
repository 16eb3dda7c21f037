"""The lift over HTTP and on the command line: answers made from `synthesis.lift.motion`."""

from __future__ import annotations

import csv
import io
import math
from typing import TYPE_CHECKING, Any

from app.query import Export, Query, Resources
from app.scenes.lift_models import (
    MAX_BATCH_STEPS,
    MIN_MAGNITUDE,
    Assembly,
    BatchReply,
    BatchRequest,
    BatchRow,
    ConditionModel,
    CylinderModel,
    DesignModel,
    DesignReply,
    DiscreteObjective,
    MotionReply,
    MotionRequest,
    OptimizeReply,
    OptimizeRequest,
    OptimumMotion,
    PublishedReply,
)
from synthesis.errors import FieldError

if TYPE_CHECKING:
    import numpy as np

    from synthesis.lift.motion import Motion
    from synthesis.lift.objective import Task
    from synthesis.lift.optimum import Optimum
    from synthesis.lift.pose import Cylinder, Design

TABLE_ROWS = 21
"""Times that the terminal's table shows."""


def _design(model: DesignModel) -> Design:
    from synthesis.lift.pose import Design

    return Design(model.l2, model.l3, model.l4, model.l5, model.b)


def _cylinder(model: CylinderModel) -> Cylinder:
    from synthesis.lift.pose import Cylinder

    for name, value in (("speed", model.speed), ("acceleration", model.acceleration)):
        if 0 < abs(value) < MIN_MAGNITUDE:
            raise FieldError(
                f"/cylinder/{name}", f"too small: 0 or at least {MIN_MAGNITUDE:g}, found {value:g}", constraint=name
            )
    return Cylinder(model.length, model.speed, model.acceleration)


def _move(request: MotionRequest) -> Motion:
    from synthesis.lift.motion import motion

    if request.times is not None and request.samples is not None:
        raise FieldError("/times", "give either `times` or `samples`, not both")
    design, cylinder = _design(request.design), _cylinder(request.cylinder)
    return motion(design, cylinder, request.times, request.samples or 201)


def answer_motion(request: MotionRequest, resources: Resources) -> MotionReply:
    """The motion that was asked for, and of the extras only those in ``include``."""
    from synthesis.lift.loops import condition, smallest_condition
    from synthesis.lift.pose import pose_at_turn

    moved = _move(request)
    limits, design = moved.stroke, moved.design
    rising = request.cylinder.speed > 0
    bottom, top = (float(value) for value in condition(design, [limits.turn_bottom, 0.0]))
    heights = (float(limits.height_bottom), float(limits.height_top))
    return MotionReply(
        status="ok",
        direction="rising" if rising else "lowering",
        rise_time=float(limits.duration),
        height_start=heights[0] if rising else heights[1],
        height_end=heights[1] if rising else heights[0],
        height_top=heights[1],
        dead_point_length=float(limits.length_dead),
        dead_point_height=float(pose_at_turn(design, limits.turn_dead).height),
        length_top=float(limits.length_top),
        condition=ConditionModel(
            start=bottom if rising else top, top=top, bottom=bottom, min=smallest_condition(design, limits)[0]
        ),
        angle_unit=request.angle_unit,
        time=moved.time.tolist(),
        height=moved.pose.height.tolist(),
        velocity=moved.velocity.tolist(),
        acceleration=moved.acceleration.tolist(),
        cylinder_length=moved.cylinder_length.tolist(),
        cylinder_speed=moved.cylinder_speed.tolist(),
        **_extras(request, moved),
    )


def _extras(request: MotionRequest, moved: Motion) -> dict[str, Any]:
    """Only what ``include`` asks for."""
    from synthesis.lift import loops as lift_loops
    from synthesis.lift import pose as lift_pose

    wanted = set(request.include)
    design, pose, speed = moved.design, moved.pose, moved.cylinder_speed
    unit = 180 / math.pi if request.angle_unit == "deg" else 1.0

    def per_link(prefix: str, values: np.ndarray) -> dict[str, list[float]]:
        return {f"{prefix}{k + 1}": (unit * values[:, k]).tolist() for k in range(lift_loops.ANGLE_COUNT)}

    extras: dict[str, Any] = {}
    if "angles" in wanted:
        extras["angles"] = per_link("theta", lift_loops.link_angles(design, pose))
    if "angular_velocities" in wanted:
        extras["angular_velocities"] = per_link("link", lift_loops.angular_velocities(design, pose, speed))
    if "angular_accelerations" in wanted:
        rates = lift_loops.angular_accelerations(design, pose, speed, moved.cylinder_acceleration)
        extras["angular_accelerations"] = per_link("link", rates)
    if "points" in wanted:
        extras["points"] = _points(moved)
    if "conditions" in wanted:
        extras["conditions"] = lift_loops.condition(design, pose.turn).tolist()
    if "residual" in wanted:
        extras["residual"] = lift_loops.largest_residual(moved)
    if "instant_centre" in wanted:
        speeds = lift_loops.velocity_by_instant_centre(design, speed, pose.height).tolist()
        extras["instant_centre"] = [value if math.isfinite(value) else None for value in speeds]
    if "assemblies" in wanted:
        turns = lift_pose.turns_at_length(design, request.cylinder.length)
        heights = lift_pose.pose_at_turn(design, turns).height
        extras["assemblies"] = [
            Assembly(
                height=float(height),
                theta3=unit * (float(turn) + math.pi / 2),
                working=bool(turn < moved.stroke.turn_dead),
            )
            for height, turn in zip(heights, turns)
        ]
    return extras


def _points(moved: Motion) -> dict[str, Any]:
    design, pose = moved.design, moved.pose
    heights = pose.height.tolist()
    link = design.l3 * pose.sin_turn - design.b, pose.root
    return {
        "A": [(-design.b, height) for height in heights],
        "B": list(zip(pose.x.tolist(), pose.y.tolist())),
        "C": list(zip(link[0].tolist(), link[1].tolist())),
        "D": (-design.b, 0.0),
    }


def motion_table(reply: MotionReply) -> str:
    """The motion as text: the figures first, then at most `TABLE_ROWS` times."""
    lines = [
        f"{reply.direction} from {reply.height_start:.6g} to {reply.height_end:.6g} in {reply.rise_time:.6f} s",
        f"dead point at cylinder length {reply.dead_point_length:.6g} (height {reply.dead_point_height:.6g}), "
        f"top at {reply.length_top:.6g}",
        f"condition: start {reply.condition.start:.4g}, top {reply.condition.top:.4g}, min {reply.condition.min:.4g}",
    ]
    if reply.residual is not None:
        lines.append(f"largest loop residual {reply.residual:.2g}")
    for pose in reply.assemblies or []:
        lines.append(f"assembly at height {pose.height:.6g}{' (working branch)' if pose.working else ''}")
    lines += ["", f"{'time':>12} {'height':>14} {'velocity':>14} {'acceleration':>14} {'cylinder':>14}"]
    last = len(reply.time) - 1
    rows = sorted({round(k * last / (TABLE_ROWS - 1)) for k in range(TABLE_ROWS)})
    for k in rows:
        values = (reply.height[k], reply.velocity[k], reply.acceleration[k], reply.cylinder_length[k])
        lines.append(f"{reply.time[k]:12.6g} " + " ".join(f"{value:14.8g}" for value in values))
    if len(rows) <= last:
        lines.append(f"({len(rows)} of {last + 1} times; --json shows all)")
    return "\n".join(lines)


def _task(cylinder: CylinderModel, request: OptimizeRequest | BatchRequest) -> Task:
    from synthesis.lift.objective import Objective, Task

    wanted = request.objective
    if isinstance(wanted, DiscreteObjective):
        objective = Objective("discrete", wanted.n, wanted.include_start)
    else:
        objective = Objective(wanted.kind)
    return Task(_cylinder(cylinder), *request.stroke, objective, request.upper_bound)


def _design_reply(design: Design) -> DesignReply:
    return DesignReply(**design.as_dict())


def _optimum_motion(optimum: Optimum, cylinder: CylinderModel) -> OptimumMotion:
    return OptimumMotion(
        rise_time=optimum.duration,
        velocity_start=optimum.velocity_bottom if cylinder.speed > 0 else 0.0,
        velocity_bottom=optimum.velocity_bottom,
        velocity_mean=optimum.mean_velocity,
        dead_point_length=optimum.dead_point_length,
    )


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
    optimum = optimize(task, clock_of(resources))
    published = published_for(task, optimum)
    return OptimizeReply(
        status="optimal",
        design=_design_reply(optimum.design),
        objective=optimum.objective,
        objective_kind=task.objective.kind,
        active=list(optimum.active),
        slacks=optimum.slacks,
        equations=optimum.equations,
        motion=_optimum_motion(optimum, request.cylinder),
        objective_of_published=published.objective if published else None,
        published=PublishedReply(
            design=_design_reply(published.design),
            objective=published.objective,
            slope=published.slope,
            reason=published.reason,
        )
        if published
        else None,
        note=NOTES[task.objective.kind],
        evaluations=optimum.evaluations,
    )


def optimize_table(reply: OptimizeReply) -> str:
    """The optimum as text, the published design beside it."""
    columns: list[tuple[str, DesignReply, float]] = [("optimum", reply.design, reply.objective)]
    if reply.published:
        columns.append(("published", reply.published.design, reply.published.objective))
    lines = [f"{'':>10} " + " ".join(f"{name:>14}" for name, _, _ in columns)]
    for name in ("l2", "l3", "l4", "l5", "b"):
        lines.append(f"{name:>10} " + " ".join(f"{getattr(design, name):14.6f}" for _, design, _ in columns))
    lines.append(f"{'objective':>10} " + " ".join(f"{value:14.7g}" for _, _, value in columns))
    lines += [
        "",
        f"active: {', '.join(reply.active) or 'none'}",
        f"rise time {reply.motion.rise_time:.6f} s, speed at the start {reply.motion.velocity_start:.6g}, "
        f"mean over height {reply.motion.velocity_mean:.6g}",
    ]
    if reply.published:
        lines.append(f"published: {reply.published.reason}")
    lines.append(reply.note)
    return "\n".join(lines)


def answer_batch(request: BatchRequest, resources: Resources) -> BatchReply:
    """The optimum for each cylinder; one that has none says why and does not stop the others."""
    from synthesis.lift.optimum import optimize_batch
    from synthesis.lift.published import published_for

    if isinstance(request.objective, DiscreteObjective):
        steps = request.objective.n * len(request.cylinders)
        if steps > MAX_BATCH_STEPS:
            raise FieldError(
                "/objective/n",
                f"n times cylinders must be at most {MAX_BATCH_STEPS}, found {steps}",
                constraint="batch_steps",
                amount=steps - MAX_BATCH_STEPS,
            )
    tasks = [_task(cylinder, request) for cylinder in request.cylinders]
    rows = []
    for cylinder, task, found in zip(request.cylinders, tasks, optimize_batch(tasks, clock_of(resources))):
        if isinstance(found, FieldError):
            rows.append(
                BatchRow(
                    cylinder=cylinder.model_dump(),
                    status="infeasible",
                    constraint=found.details.get("constraint"),
                    amount=found.details.get("amount"),
                    detail=found.message,
                )
            )
            continue
        published = published_for(task, found)
        rows.append(
            BatchRow(
                cylinder=cylinder.model_dump(),
                status="optimal",
                design=_design_reply(found.design),
                objective=found.objective,
                active=list(found.active),
                motion=_optimum_motion(found, cylinder),
                objective_of_published=published.objective if published else None,
            )
        )
    return BatchReply(status="ok", rows=rows)


def batch_table(reply: BatchReply) -> str:
    """One line for each cylinder."""
    names = ("length", "speed", "l2", "l3", "l4", "l5", "b", "objective", "published", "rise time")
    lines = [" ".join(f"{name:>11}" for name in names)]
    for row in reply.rows:
        head = f"{row.cylinder['length']:11.6g} {row.cylinder['speed']:11.6g} "
        if row.design is None or row.motion is None or row.objective is None:
            lines.append(head + f"{row.constraint}: {row.detail}")
            continue
        design = row.design
        values = [f"{value:11.4f}" for value in (design.l2, design.l3, design.l4, design.l5, design.b)]
        published = "-" if row.objective_of_published is None else f"{row.objective_of_published:.4f}"
        lines.append(head + " ".join(values) + f" {row.objective:11.4f} {published:>11} {row.motion.rise_time:11.6f}")
    return "\n".join(lines)


def motion_csv(request: MotionRequest, resources: Resources) -> bytes:
    """The motion as comma-separated values, one time a line."""
    moved = _move(request)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["time", "height", "velocity", "acceleration", "cylinder_length", "cylinder_speed"])
    columns = (
        moved.time,
        moved.pose.height,
        moved.velocity,
        moved.acceleration,
        moved.cylinder_length,
        moved.cylinder_speed,
    )
    writer.writerows(zip(*(column.tolist() for column in columns)))
    return text.getvalue().encode()


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
    ),
    Query(
        path="/v1/lift/optimize",
        command="lift optimize",
        summary="Optimum design of a lifting linkage for a cylinder and a stroke.",
        request=OptimizeRequest,
        reply=OptimizeReply,
        answer=answer_optimize,
        table=optimize_table,
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


def clock_of(resources: Resources) -> Any:
    """Seconds of a watch over this request."""
    work = resources.work()
    return lambda: work.elapsed
