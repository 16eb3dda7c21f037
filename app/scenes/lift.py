"""The lift over HTTP and on the command line: its motion, and the questions of the scene; optima: `app.scenes.lift_optimum`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from app.query import Angles, Export, Numbers, Query, Resources
from app.scenes.lift_models import (
    Assembly,
    BatchReply,
    BatchRequest,
    ConditionModel,
    ForcesReply,
    MotionReply,
    MotionRequest,
    OptimizeReply,
    OptimizeRequest,
)
from app.scenes.lift_optimum import (
    answer_batch,
    answer_optimize,
    cylinder_of,
    optimum_csv,
    optimum_dxf,
    optimum_svg,
)
from app.scenes.lift_tables import batch_table, motion_table, optimize_table
from linkage_atlas import FieldError, Work

if TYPE_CHECKING:
    from synthesis.lift.forces import Drive
    from synthesis.lift.motion import Motion

LONG_SAMPLES = 2000


def _move(request: MotionRequest) -> Motion:
    from synthesis.lift.motion import motion
    from synthesis.lift.pose import Design

    if request.times is not None and request.samples is not None:
        raise FieldError("/times", "give either `times` or `samples`, not both")
    design = Design(**request.design.model_dump())
    return motion(design, cylinder_of(request.cylinder), request.times, request.samples or 201)


def answer_motion(request: MotionRequest, resources: Resources) -> MotionReply:
    """The motion that was asked for, and of the extras only those in ``include``."""
    from synthesis.lift.files import columns
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
        **{name: Numbers(column) for name, column in columns(moved).items()},
        **_extras(request, moved, work),
        forces=_forces(request, moved),
    )


def _drive(request: MotionRequest) -> Drive | None:
    from synthesis.lift.forces import Drive

    if request.pneumatics is None:
        return None
    if request.pneumatics.rod >= request.pneumatics.bore:
        raise FieldError("/pneumatics/rod", "the rod must be thinner than the bore", constraint="rod")
    return Drive(**request.pneumatics.model_dump())


def _forces(request: MotionRequest, moved: Motion) -> ForcesReply | None:
    from synthesis.lift.forces import forces, least_bore

    drive = _drive(request)
    if drive is None:
        return None
    found = forces(moved, drive)
    lists = ("weight", "cylinder", "link", "slide", "pressure")
    most = float(found.pressure.max())
    return ForcesReply(
        **{name: Numbers(getattr(found, name)) for name in lists},
        pivot_O=Numbers(found.pivot_o),
        pivot_D=Numbers(found.pivot_d),
        cylinder_max=float(found.cylinder.max()),
        cylinder_min=float(found.cylinder.min()),
        pressure_max=most,
        bore_min=least_bore(found, drive),
        pressure_is_enough=most <= drive.pressure,
    )


def _extras(request: MotionRequest, moved: Motion, work: Work) -> dict[str, Any]:
    """Only what ``include`` asks for."""
    from synthesis.lift import loops, pose
    from synthesis.lift.files import joints

    at, speed, design = moved.pose, moved.cylinder_speed, moved.pose.design
    radian = Angles(request.angle_unit).radian

    def per_link(prefix: str, angles: Any) -> dict[str, Numbers]:
        return {f"{prefix}{k}": Numbers(column / radian) for k, column in enumerate(angles.T, 1)}

    def points() -> dict[str, Any]:
        found = {name: Numbers(z.view(float).reshape(-1, 2)) for name, z in joints(at).items() if name in "ABC"}
        return {**found, "D": (-design.b, 0.0)}

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
        "conditions": lambda: Numbers(loops.condition(design, at.turn)),
        "residual": lambda: loops.largest_residual(moved),
        "instant_centre": instant_centre,
        "assemblies": assemblies,
    }
    found = {}
    for name in set(request.include):
        work.go_on()
        found[name] = extras[name]()
    return found


def motion_csv(request: MotionRequest, resources: Resources) -> bytes:
    """The motion as comma-separated values, one time a line, with the forces where they are asked for."""
    from synthesis.lift.files import columns
    from synthesis.sheet import csv_text

    moved = _move(request)
    rows, found = columns(moved), _forces(request, moved)
    if found is not None:
        rows |= {f"force_{name}": getattr(found, name) for name in ("weight", "cylinder", "link", "slide")}
        rows["pressure"] = found.pressure
    return csv_text(rows, "\n").encode()


def motion_svg(request: MotionRequest, resources: Resources) -> bytes:
    """The lift at its start and its top as a drawing."""
    from synthesis.lift.files import design_svg

    moved = _move(request)
    return design_svg(moved.pose.design, float(moved.stroke.turn_bottom)).encode()


def motion_dxf(request: MotionRequest, resources: Resources) -> bytes:
    """The lift at its start and its top for CAD."""
    from synthesis.lift.files import design_dxf

    moved = _move(request)
    return design_dxf(moved.pose.design, float(moved.stroke.turn_bottom)).encode()


INITIAL_DESIGN = {"l2": 300.0, "l3": 180.0, "l4": 240.0, "l5": 330.0, "b": 480.0}
OPTIMUM_DESIGN = {"l2": 351.9, "l3": 162.8, "l4": 351.9, "l5": 347.2, "b": 535.8}
BUILDABLE_DESIGN = {"l2": 130.5, "l3": 165.5, "l4": 223.5, "l5": 344.5, "b": 560.3}
"""The optimum within the default constraints, rounded to 0.1 mm."""
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
            "forces": {
                "design": BUILDABLE_DESIGN,
                "cylinder": {"length": 482.2, "speed": 100.0},
                "samples": 51,
                "pneumatics": {"load": 1000.0, "mass": 20.0, "bore": 63.0, "rod": 20.0, "pressure": 6.0},
            },
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
        exports={
            "csv": Export("text/csv; charset=utf-8", motion_csv),
            "svg": Export("image/svg+xml", motion_svg),
            "dxf": Export("image/vnd.dxf", motion_dxf),
        },
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
        exports={
            "csv": Export("text/csv; charset=utf-8", optimum_csv),
            "svg": Export("image/svg+xml", optimum_svg),
            "dxf": Export("image/vnd.dxf", optimum_dxf),
        },
        examples={
            "buildable": {
                "cylinder": CYLINDER,
                "stroke": [200.0, 510.0],
                "objective": {"kind": "normalized"},
                "upper_bound": 600.0,
                "constraints": {"extension_max": 1.8, "dead_point_min": 0.05},
            },
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
