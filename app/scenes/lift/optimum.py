"""The question about the optimum design of a lift."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from app.query import Angles as Unit
from app.query import Query, Resources
from app.scenes.lift.files import drawings
from app.scenes.lift.models import (
    MIN_MAGNITUDE,
    ConstraintsModel,
    OptimizeReply,
    OptimizeRequest,
    UnconstrainedReply,
    cylinder_of,
)
from linkage_atlas import FieldError, Work
from synthesis.scenes.lift.constrained import optimize, source_limits
from synthesis.scenes.lift.constraints import ConstraintRow, Constraints, constraint_rows, measured_values
from synthesis.scenes.lift.files import design_csv
from synthesis.scenes.lift.motion import motion
from synthesis.scenes.lift.optimum import Objective, Optimum, StrokeDesign, Task, optimum_motion
from synthesis.scenes.lift.pose import LENGTHS, Design

MIN_SIDE = 0.1
"""Default of the smallest length with constraints, as a fraction of the top height."""
MIN_TRANSMISSION_ANGLE = 30.0
"""Default of the smallest transmission angle with constraints, degrees."""
NOTES = {
    "discrete": "The objective is the mean squared deviation of the platform's speed from its mean at evenly spaced heights.",
    "continuous": "The objective is the squared deviation of the platform's speed from its mean, averaged over height.",
    "normalized": "The objective is the squared deviation of the platform's speed from its mean, averaged over height and "
    "divided by the squared mean.",
}
"""Definition of each objective, for the reply."""


def _task(request: OptimizeRequest) -> Task:
    objective = Objective(**request.objective.model_dump())
    return Task(cylinder_of(request.cylinder), *request.stroke, objective, request.upper_bound)


def _constraints(request: OptimizeRequest, model: ConstraintsModel) -> Constraints:
    """Return the constraints of a request, completed by the defaults that depend on the request."""
    bound, shortest = request.upper_bound, MIN_SIDE * request.stroke[1]
    angle = model.transmission_angle_min
    min_transmission = (
        math.radians(MIN_TRANSMISSION_ANGLE) if angle is None else Unit(request.angle_unit).inward(angle)
    )
    if not min_transmission < 0.5 * math.pi:
        raise FieldError("/constraints/transmission_angle_min", "must be less than 90 degrees")

    def ranged(name: str, values: list[float | None] | None, low: float) -> tuple[float | None, float | None]:
        first, last = values or (low, bound)
        if first is not None and first > bound:
            field, quantity = f"/constraints/{name}", f"{first:.9g}"
            if values is None:
                field, quantity = "/upper_bound", f"the smallest {name}, a tenth of the top height,"
            message = f"{quantity} is larger than upper_bound, {bound:.9g}"
            raise FieldError(field, message, constraint=name, amount=first - bound)
        return first, bound if last is None else min(last, bound)

    if model.closed_length is None and request.cylinder.length > bound:
        message = f"{request.cylinder.length:.9g} is larger than upper_bound, {bound:.9g}; give a closed_length"
        amount = request.cylinder.length - bound
        raise FieldError("/cylinder/length", message, constraint="closed_length", amount=amount)
    closed = model.closed_length or (request.cylinder.length, bound)
    left, bottom, right, top = model.envelope
    return Constraints(
        lengths={name: ranged(name, getattr(model, name), shortest) for name in LENGTHS},
        closed_length=(closed[0] or MIN_MAGNITUDE, bound if closed[1] is None else closed[1]),
        rise_time=tuple(model.rise_time) if model.rise_time else (None, None),
        envelope=(left, bottom, right, top),
        transmission_min=min_transmission,
        **model.arguments(
            "extension_max", "dead_point_min", "acceleration_max", "jerk_max", "force_ratio_max", "start"
        ),
    )


def _optimum(request: OptimizeRequest, resources: Resources) -> tuple[Optimum, Task, Constraints | None]:
    task, work = _task(request), resources.work()
    if request.constraints is None:
        return _source_optimum(task, work), task, None
    limits = _constraints(request, request.constraints)
    return optimize(task, limits, work), task, limits


def _source_optimum(task: Task, work: Work) -> Optimum:
    """Solve the problem of the source; an error points at the field of the request that is to be changed."""
    try:
        return optimize(task, source_limits(task), work)
    except FieldError as error:
        if not error.field.startswith("/constraints"):
            raise
        field = "/cylinder/acceleration" if error.details["constraint"] == "stopping" else "/upper_bound"
        raise FieldError(field, error.message, **error.details) from None


def answer_optimize(request: OptimizeRequest, resources: Resources) -> OptimizeReply:
    """Optimize a design; with constraints, compare it with the optimum of the source's problem."""
    optimum, task, limits = _optimum(request, resources)
    return OptimizeReply(
        status="optimal",
        design=optimum.design,
        closed_length=float(optimum.stroke_design.closed_length),
        objective=optimum.objective,
        objective_kind=task.objective.kind,
        active=optimum.active,
        slacks=optimum.slacks,
        motion=optimum_motion(optimum, task),
        **(
            {}
            if limits is None
            else _within(optimum, task, limits, Unit(request.angle_unit).radian, resources.work())
        ),
        note=NOTES[task.objective.kind],
    )


def _within(optimum: Optimum, task: Task, limits: Constraints, radian: float, work: Work) -> dict[str, Any]:
    """Return the values and limits of the optimum, and the unconstrained optimum with the limits that it violates."""

    def rows(built: StrokeDesign, active: Sequence[str] = ()) -> list[ConstraintRow]:
        constraint_list = constraint_rows(limits, measured_values(built, task), active)
        return [
            replace(row, name="transmission_angle", value=row.value / radian, limit=row.limit / radian)
            if row.name == "transmission"
            else row
            for row in constraint_list
        ]

    constraints = rows(optimum.stroke_design, optimum.active)
    try:
        free = _source_optimum(task, work)
    except FieldError:  # infeasible with the given closed length, which the constraints allow to vary
        return {"constraints": constraints}
    violated = [replace(row, active=False) for row in rows(free.stroke_design) if not row.satisfied]
    return {
        "constraints": constraints,
        "unconstrained": UnconstrainedReply(design=free.design, objective=free.objective, violated=violated),
        "objective_increase": optimum.objective / free.objective - 1 if free.objective > 0 else None,
    }


def optimum_csv(request: OptimizeRequest, resources: Resources) -> bytes:
    """Return the optimum design and its motion at 201 times as comma-separated values."""
    optimum, task, _ = _optimum(request, resources)
    closed = float(optimum.stroke_design.closed_length)
    return design_csv(motion(optimum.design, replace(task.cylinder, length=closed)), closed).encode()


def _optimal(request: OptimizeRequest, resources: Resources) -> tuple[Design, float]:
    built = _optimum(request, resources)[0].stroke_design
    return built.design, float(built.turn)


def optimize_table(reply: OptimizeReply) -> str:
    """Return the optimum design and its constraints."""
    lines = [f"{name:>10} {getattr(reply.design, name):14.6f}" for name in LENGTHS]
    lines.append(f"{'objective':>10} {reply.objective:14.7g}")
    lines += [
        f"{'closed l1':>10} {reply.closed_length:14.6f}",
        "",
        f"active: {', '.join(reply.active) or 'none'}",
        f"rise time {reply.motion.rise_time:.6f} s, speed at the start {reply.motion.velocity_start:.6g} mm/s, "
        f"mean over height {reply.motion.velocity_mean:.6g} mm/s",
    ]
    if reply.constraints:
        lines += ["", f"{'constraint':>20} {'is':>14}        {'limit':>14}"]
        for row in reply.constraints:
            sign = ">=" if row.kind == "minimum" else "<="
            lines.append(f"{row.name:>20} {row.value:14.7g} {sign:>6} {row.limit:14.7g}{' *' if row.active else ''}")
        lines += ["* active constraint", ""]
    if reply.unconstrained and reply.objective_increase is not None:
        broken = ", ".join(f"{row.name} {row.value:.6g}" for row in reply.unconstrained.violated)
        lines.append(
            f"without constraints the objective is {reply.unconstrained.objective:.6g} "
            f"(with constraints: {reply.objective_increase:+.1%}); "
            f"violated limits: {broken or 'none'}"
        )
    lines.append(reply.note)
    return "\n".join(lines)


OPTIMIZE = Query(
    command="lift optimize",
    summary="Optimize a lifting linkage for a cylinder and a stroke.",
    answer=answer_optimize,
    table=optimize_table,
    shows_units=False,
    is_long=lambda _: True,
    exports={"csv": optimum_csv, **drawings(_optimal)},
)
