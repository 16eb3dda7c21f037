"""The question about the motion of a lift and the forces in it."""

from __future__ import annotations

from typing import Any

import numpy as np

from app.query import Angles as Unit
from app.query import Query, Resources
from app.scenes.lift.files import drawings
from app.scenes.lift.models import DEFAULT_SAMPLES, ForcesReply, MotionReply, MotionRequest, cylinder_of
from linkage_atlas import FieldError, Work
from synthesis.scenes.lift.files import joint_columns, motion_columns
from synthesis.scenes.lift.motion import (
    Motion,
    Pneumatics,
    angular_accelerations,
    angular_velocities,
    forces,
    link_angles,
    minimum_bore,
    motion,
)
from synthesis.scenes.lift.pose import Design, joints, pose_at_turn
from synthesis.sheet import csv_text

TABLE_ROWS = 21
"""Largest number of rows in the table of a motion."""


LONG_SAMPLES = 2000
"""Number of times above which an answer takes more than a fraction of a second."""


def _move(request: MotionRequest) -> Motion:
    if request.times is not None and request.samples is not None:
        raise FieldError("/times", "give either times or samples, but not both")
    design = Design(**request.design.model_dump())
    return motion(design, cylinder_of(request.cylinder), request.times, request.samples or DEFAULT_SAMPLES)


def answer_motion(request: MotionRequest, resources: Resources) -> MotionReply:
    """Compute the motion of a lift, and the additional results in ``include``."""
    work = resources.work()
    moved = _move(request)
    limits, design = moved.stroke, moved.pose.design
    rising = request.cylinder.speed > 0
    heights = (limits.height_bottom, limits.height_top) if rising else (limits.height_top, limits.height_bottom)
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
        angle_unit=request.angle_unit,
        **{name: column.tolist() for name, column in motion_columns(moved).items()},
        **_extras(request, moved, work),
        forces=_forces(request, moved),
    )


def _pairs(points: Any) -> list[tuple[float, float]]:
    return [(x, y) for x, y in points.tolist()]


def _forces(request: MotionRequest, moved: Motion) -> ForcesReply | None:
    model = request.pneumatics
    if model is None:
        return None
    if model.rod >= model.bore:
        raise FieldError("/pneumatics/rod", "must be less than the bore", constraint="rod")
    drive = Pneumatics(**model.model_dump())
    at_times, duration = forces(moved, drive), float(moved.stroke.duration)
    # the extremes cover the whole motion, not only the requested times
    times = np.union1d(moved.time, np.linspace(0.0, duration, DEFAULT_SAMPLES))
    everywhere = forces(motion(moved.pose.design, cylinder_of(request.cylinder), times), drive)
    largest_pressure = float(everywhere.pressure.max())
    return ForcesReply(
        **{name: getattr(at_times, name).tolist() for name in ("weight", "cylinder", "link", "slide", "pressure")},
        pivot_O=_pairs(at_times.pivot_o),
        pivot_D=_pairs(at_times.pivot_d),
        cylinder_max=float(everywhere.cylinder.max()),
        cylinder_min=float(everywhere.cylinder.min()),
        pressure_max=largest_pressure,
        bore_min=minimum_bore(everywhere, drive),
        pressure_is_enough=largest_pressure <= drive.pressure,
    )


def _extras(request: MotionRequest, moved: Motion, work: Work) -> dict[str, Any]:
    pose, speed, design = moved.pose, moved.cylinder_speed, moved.pose.design
    radian = Unit(request.angle_unit).radian

    def per_link(prefix: str, angles: Any) -> dict[str, list[float]]:
        return {f"{prefix}{k}": (column / radian).tolist() for k, column in enumerate(angles.T, 1)}

    def points() -> dict[str, Any]:
        results = {name: _pairs(z.view(float).reshape(-1, 2)) for name, z in joints(pose).items() if name in "ABC"}
        return {**results, "D": (-design.b, 0.0)}

    extras = {
        "angles": lambda: per_link("theta", link_angles(pose)),
        "angular_velocities": lambda: per_link("link", angular_velocities(pose, speed)),
        "angular_accelerations": lambda: per_link(
            "link", angular_accelerations(pose, speed, moved.cylinder_acceleration)
        ),
        "points": points,
    }
    results = {}
    for name in dict.fromkeys(request.include):
        work.go_on()
        results[name] = extras[name]()
    return results


_PER_TIME = {"angular_velocities": "_s", "angular_accelerations": "_s2"}


def motion_csv(request: MotionRequest, resources: Resources) -> bytes:
    """Return the motion as comma-separated values: a line for each time, with the requested forces and results."""
    moved = _move(request)
    rows, applied = motion_columns(moved), _forces(request, moved)
    for name, extra in _extras(request, moved, resources.work()).items():
        if name == "points":
            rows |= joint_columns(moved)
        else:
            unit = request.angle_unit + _PER_TIME.get(name, "")
            rows |= {f"{name}_{link}_{unit}": column for link, column in extra.items()}
    if applied is not None:
        rows |= {f"force_{name}": getattr(applied, name) for name in ("weight", "cylinder", "link", "slide")}
        rows["pressure"] = applied.pressure
    return csv_text(rows, "\n").encode()


def _at_bottom(request: MotionRequest, _: Resources) -> tuple[Design, float]:
    moved = _move(request)
    return moved.pose.design, float(moved.stroke.turn_bottom)


def motion_table(reply: MotionReply) -> str:
    """Return the characteristic values of a motion and a row for each of at most `TABLE_ROWS` times."""
    lines = [
        f"{reply.direction} from {reply.height_start:.6g} to {reply.height_end:.6g} mm in {reply.rise_time:.6f} s",
        f"dead point at cylinder length {reply.dead_point_length:.6g} mm (height {reply.dead_point_height:.6g} mm), "
        f"top at {reply.length_top:.6g} mm",
    ]
    if reply.forces is not None:
        lines.append(
            f"cylinder force {reply.forces.cylinder_min:.6g} to {reply.forces.cylinder_max:.6g} N, pressure up to "
            f"{reply.forces.pressure_max:.4g} bar ({'enough' if reply.forces.pressure_is_enough else 'not enough'}), "
            f"smallest bore {reply.forces.bore_min:.4g} mm"
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


MOTION = Query(
    command="lift motion",
    summary="Compute the motion of a lifting linkage that a cylinder drives.",
    answer=answer_motion,
    table=motion_table,
    shows_units=False,
    exports={"csv": motion_csv, **drawings(_at_bottom)},
    is_long=lambda request: max(request.samples or 0, len(request.times or ())) > LONG_SAMPLES,
)
