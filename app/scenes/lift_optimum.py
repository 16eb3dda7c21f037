"""The lift's optima over HTTP and on the command line: the source's problem, and designs within constraints."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from app.query import Angles, Resources
from app.scenes.lift_models import (
    MAX_BATCH_STEPS,
    MIN_MAGNITUDE,
    BatchReply,
    BatchRequest,
    BatchRow,
    ConstraintRow,
    ConstraintsModel,
    CylinderModel,
    DesignReply,
    DiscreteObjective,
    OptimizeReply,
    OptimizeRequest,
    OptimumMotion,
    PublishedReply,
    UnconstrainedReply,
)
from linkage_atlas import FieldError

if TYPE_CHECKING:
    from synthesis.lift.constraints import Built, Constraints, Row
    from synthesis.lift.motion import Motion
    from synthesis.lift.objective import Task
    from synthesis.lift.optimum import Optimum
    from synthesis.lift.pose import Cylinder
    from synthesis.lift.published import Published

SHORTEST = 0.1
"""Least length of a side with constraints, as a share of the top height, unless the request says another."""
TRANSMISSION = 30.0
"""Degrees, unless the request says another."""
NOTES = {
    "discrete": "Mean squared deviation of the platform's speed from its mean, over even heights.",
    "continuous": "Squared deviation of the platform's speed from its mean, averaged over height.",
    "normalized": "Squared deviation of the platform's speed from its mean, averaged over height, over the squared mean.",
}


def cylinder_of(model: CylinderModel) -> Cylinder:
    from synthesis.lift.pose import Cylinder

    for name, value in (("speed", model.speed), ("acceleration", model.acceleration)):
        if 0 < abs(value) < MIN_MAGNITUDE:
            message = f"too small: 0 or at least {MIN_MAGNITUDE:g}, found {value:g}"
            raise FieldError(f"/cylinder/{name}", message, constraint=name)
    return Cylinder(model.length, model.speed, model.acceleration)


def _task(cylinder: CylinderModel, request: OptimizeRequest | BatchRequest) -> Task:
    from synthesis.lift.objective import Objective, Task

    objective = Objective(**request.objective.model_dump())
    return Task(cylinder_of(cylinder), *request.stroke, objective, request.upper_bound)


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


def _constraints(request: OptimizeRequest, given: ConstraintsModel) -> Constraints:
    """The constraints of a request with what it leaves to the service."""
    from synthesis.lift.constraints import Constraints

    bound, shortest = request.upper_bound, SHORTEST * request.stroke[1]
    angle = given.transmission_angle_min
    least = math.radians(TRANSMISSION) if angle is None else Angles(request.angle_unit).inward(angle)
    if not least < 0.5 * math.pi:
        raise FieldError("/constraints/transmission_angle_min", "less than a quarter turn is wanted")

    def ranged(values: list[float | None] | None, low: float) -> tuple[float | None, float | None]:
        first, last = values or (low, bound)
        return first, bound if last is None else min(last, bound)

    closed = given.closed_length or (request.cylinder.length, bound)
    left, bottom, right, top = given.envelope
    return Constraints(
        lengths={name: ranged(getattr(given, name), shortest) for name in ("l2", "l3", "l4", "l5", "b")},
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


def _row(row: Row, radian: float, active: bool) -> ConstraintRow:
    name, unit = (row.name, 1.0) if row.name != "transmission" else ("transmission_angle", radian)
    kind = "least" if row.least else "most"
    return ConstraintRow(name=name, value=row.value / unit, kind=kind, limit=row.limit / unit, active=active)


def _within(request: OptimizeRequest, given: ConstraintsModel, resources: Resources) -> OptimizeReply:
    """The optimum within constraints, beside the optimum of the source's problem."""
    from synthesis.lift.constrained import optimize_within
    from synthesis.lift.constraints import measured, rows_of
    from synthesis.lift.optimum import optimize
    from synthesis.lift.pose import pose_at_turn

    task, limits, work = _task(request.cylinder, request), _constraints(request, given), resources.work()
    found = optimize_within(task, limits, work)
    built, radian = found.built, Angles(request.angle_unit).radian
    values = measured(built, task)
    rows = [
        _row(row, radian, f"{row.name}{'>=min' if row.least else '<=max'}" in found.active)
        for row in rows_of(limits, values)
    ]
    try:
        free = optimize(task, work)
    except FieldError:  # the source's problem has no design: the constraints have freed its closed length
        free = None
    beside = None
    if free is not None:
        missed = [row for row in rows_of(limits, measured(_built(free, task), task)) if not row.kept]
        beside = UnconstrainedReply(
            design=DesignReply(**free.design.as_dict()),
            objective=free.objective,
            breaks=[_row(row, radian, False) for row in missed],
        )
    start = pose_at_turn(built.design, built.turn)
    moved = _moved(built, task, 2)
    bottom = float(moved.velocity[0 if task.cylinder.speed > 0 else -1])
    return OptimizeReply(
        status="optimal",
        design=DesignReply(**built.design.as_dict()),
        closed_length=float(built.closed),
        objective=found.objective,
        objective_kind=task.objective.kind,
        active=list(found.active),
        slacks=found.slacks,
        equations={
            "start": float(start.height) - task.low,
            "closed length": float(start.length) - float(built.closed),
            "(33) stroke": float(built.design.l3 + built.design.l5) - task.high,
        },
        motion=OptimumMotion(
            rise_time=values["rise_time"],
            velocity_start=bottom if task.cylinder.speed > 0 else 0.0,
            velocity_bottom=bottom,
            velocity_mean=found.mean_velocity,
            dead_point_length=float(built.closed) * (1 - values["dead_point"]),
        ),
        objective_of_published=None,
        published=None,
        constraints=rows,
        unconstrained=beside,
        cost=found.objective / free.objective - 1 if free is not None and free.objective > 0 else None,
        note=NOTES[task.objective.kind],
        evaluations=found.evaluations,
    )


def _built(found: Optimum, task: Task) -> Built:
    """The optimum of the source's problem as a design whose closed length is known."""
    from synthesis.lift.constraints import Built
    from synthesis.lift.pose import pose_at_height, shape

    pose = pose_at_height(found.design, task.low)
    return Built(found.design, shape(found.design).gamma, pose.turn, task.cylinder.length)


def _moved(built: Built, task: Task, samples: int) -> Motion:
    from synthesis.lift.motion import motion

    return motion(built.design, replace(task.cylinder, length=float(built.closed)), None, samples)


def _design(request: OptimizeRequest, resources: Resources) -> tuple[Built, Task]:
    """The optimum design alone: what the files show."""
    from synthesis.lift.constrained import optimize_within
    from synthesis.lift.optimum import optimize

    task = _task(request.cylinder, request)
    if request.constraints is not None:
        limits = _constraints(request, request.constraints)
        return optimize_within(task, limits, resources.work()).built, task
    return _built(optimize(task, resources.work()), task), task


def optimum_csv(request: OptimizeRequest, resources: Resources) -> bytes:
    """The optimum design with its motion at 201 times as comma-separated values."""
    from synthesis.lift.files import design_csv

    built, task = _design(request, resources)
    return design_csv(_moved(built, task, 201), float(built.closed)).encode()


def optimum_svg(request: OptimizeRequest, resources: Resources) -> bytes:
    """The optimum design at its start and its top as a drawing."""
    from synthesis.lift.files import design_svg

    built, _ = _design(request, resources)
    return design_svg(built.design, float(built.turn)).encode()


def optimum_dxf(request: OptimizeRequest, resources: Resources) -> bytes:
    """The optimum design at its start and its top for CAD."""
    from synthesis.lift.files import design_dxf

    built, _ = _design(request, resources)
    return design_dxf(built.design, float(built.turn)).encode()


def answer_optimize(request: OptimizeRequest, resources: Resources) -> OptimizeReply:
    """The optimum design; of the source's problem with the published one beside it."""
    from synthesis.lift.optimum import optimize
    from synthesis.lift.published import published_for

    if request.constraints is not None:
        return _within(request, request.constraints, resources)
    task = _task(request.cylinder, request)
    optimum = optimize(task, resources.work())
    published = published_for(task, optimum)
    beside = None
    if published:
        beside = PublishedReply(
            design=DesignReply(**published.design.as_dict()),
            objective=published.objective,
            slope=published.slope,
            reason=published.reason,
            source=published.source,
        )
    return OptimizeReply(
        **_optimum(optimum, published, request.cylinder),
        closed_length=request.cylinder.length,
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
