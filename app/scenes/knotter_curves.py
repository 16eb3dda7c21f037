"""One pair of a knotter over the bill's angle: where the rope meets its triangles, where the points are, and the verdict."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Field

from app.query import Angles, Column, Computed, Count, Export, Query, ReplyModel, Resources
from app.scenes.knotter_machine import DECIMALS, condition_reply, machine_of, pair_of, provenance
from app.scenes.knotter_models import (
    Bounded,
    BoundedPositive,
    ClearanceReply,
    EntryReply,
    MachineRequest,
    Provenance,
    Range,
)
from app.tables import DEGREES, Units, table
from linkage_atlas import FieldError
from synthesis.sheet import csv_text

MAX_SAMPLES = 7201
MIN_STEP_DEGREES = 0.01
STILL = ("shaft", "bearing", "seat")
"""Frames that do not move."""
PATHS = ("S0", "S1", "S3", "S4", "S5", "S7", "S8", "S9", "S10", "O5")
CROSSINGS = {"E1": "wrap", "E2": "bite"}


class CurvesRequest(MachineRequest):
    """One pair over a range of the bill's angle."""

    alpha1: Bounded | None = Field(
        None, description="Of the disc's axis; 10 degrees.", json_schema_extra={"unit": "angle"}
    )
    alpha3: Bounded | None = Field(
        None, description="Of the bill's axis; 25 degrees.", json_schema_extra={"unit": "angle"}
    )
    over: Range | None = Field(None, description="Range of the bill's angle; 0 to 360 degrees.")
    samples: Annotated[Count, Field(ge=2, le=MAX_SAMPLES)] = Field(181, description="Evenly spaced bill angles.")
    step: BoundedPositive | None = Field(
        None,
        description="Step of the source's scan, whose last crossing before the hit stands in its table 1; 2 degrees.",
        json_schema_extra={"unit": "angle"},
    )
    frame: Literal["shaft", "bearing", "seat", "u3", "u4", "u5"] = Field(
        "shaft",
        description="Of the paths: shaft (sigma1), bearing of the bill (sigma0), seat of the disc (sigma2), or a body's.",
    )


class RopeCrossingReply(ReplyModel):
    """Where the line of the rope meets the plane of its triangle; rows as many as samples, null where it runs parallel."""

    frame: str
    point: Computed[list[list[float] | None]] = Field(description="In the frame of the triangle.")
    path: Computed[list[list[float] | None]] = Field(description="In the frame that was asked for.")
    on_rope: Computed[list[bool]] = Field(description="Whether it lies between the rope's ends.")
    inside: Computed[list[bool]] = Field(description="Whether the rope crosses the inside of the triangle.")
    triangle: list[str]
    corners: Computed[list[list[list[float]]]] = Field(
        description="Its vertices in the frame of the triangle, sample by sample."
    )


class StepBeforeReply(ReplyModel):
    """The last crossing of a scan before its first hit."""

    step: float
    alpha: float | None = Field(description="null: no step of the scan is inside, or the first one already.")
    point: list[float] | None


class CurvesReply(Provenance):
    """Crossings, paths and verdict of one pair."""

    status: Literal["ties", "fails"]
    alpha1: float
    alpha3: float
    alpha: Column = Field(description="Bill's angles.")
    beta: Column = Field(description="Disc's angles.")
    alpha4: Column = Field(description="Jaw's angles.")
    frame: str
    E1: RopeCrossingReply = Field(description="Of the wrap, over the whole range.")
    E2: RopeCrossingReply = Field(description="Of the bite.")
    paths: dict[str, Computed[list[list[float]]]] = Field(description="Each point's path in the frame asked for.")
    axes: dict[str, list[list[float]]] | None = Field(
        description="Two points of the axes of shaft (i1), disc (j2) and bill (k0) in that frame, one apart; null if it moves."
    )
    step_before: StepBeforeReply = Field(description="Of E1.")
    wrap: EntryReply
    clearance: ClearanceReply
    bite: EntryReply


def answer_curves(request: CurvesRequest, resources: Resources) -> CurvesReply:
    """Crossings, paths and verdict of one pair."""
    import numpy as np

    from synthesis.knotter.curves import crossing_curve, point_paths, step_before
    from synthesis.knotter.mechanism import as_array

    work, angles = resources.work(), Angles(request.angle_unit, DECIMALS)
    mechanism, conditions = machine_of(request, angles)
    pair = pair_of(request.alpha1, request.alpha3, angles)
    mechanism = mechanism.with_parameters(alpha1=pair[0], alpha3=pair[1])
    low, high = (0.0, math.tau) if request.over is None else (angles.inward(at) for at in request.over)
    if not low < high:
        raise FieldError("/over", "the range must run from a smaller to a larger angle")
    step = math.radians(2.0) if request.step is None else angles.inward(request.step)
    if step < math.radians(MIN_STEP_DEGREES) * (1 - 1e-9):
        raise FieldError("/step", f"the step must be at least {MIN_STEP_DEGREES} degrees")
    frames = {frame for frame, _ in mechanism.points.values()} | {"seat"}
    mechanism.require_laws(frames, low, high)
    for condition in conditions.values():
        condition.check(mechanism)
    driver = np.linspace(low, high, request.samples)

    def rows(points: Any) -> list[list[float] | None]:
        return [None if math.isnan(point[0]) else point for point in points.tolist()]

    crossings = {}
    for name, of in CROSSINGS.items():
        work.go_on()
        condition = conditions[of]
        curve = crossing_curve(mechanism, condition, driver)
        moved = as_array(mechanism.carry(curve.point.T, condition.frame, request.frame, driver), driver.shape).T
        crossings[name] = RopeCrossingReply(
            frame=condition.frame,
            point=rows(curve.point),
            path=rows(moved),
            on_rope=curve.on_rope.tolist(),
            inside=curve.inside.tolist(),
            triangle=list(condition.triangle),
            corners=np.moveaxis(curve.triangle, 0, 1).tolist(),
        )
    before = step_before(mechanism, conditions["wrap"], step)
    results = {name: condition.evaluate(mechanism, 1, work) for name, condition in conditions.items()}
    verdicts: dict[str, Any] = {
        name: condition_reply(name, conditions[name], result, 0, angles) for name, result in results.items()
    }
    radian = angles.radian
    laws = {name: np.broadcast_to(law.value(driver), driver.shape) / radian for name, law in mechanism.laws.items()}
    return CurvesReply(
        status="ties" if all(result.holds[0] for result in results.values()) else "fails",
        alpha1=angles.outward(pair[0]),
        alpha3=angles.outward(pair[1]),
        alpha=[angles.outward(at) for at in driver.tolist()],
        beta=laws["beta"].tolist(),
        alpha4=laws["alpha4"].tolist(),
        frame=request.frame,
        E1=crossings["E1"],
        E2=crossings["E2"],
        paths={
            name: path.tolist() for name, path in point_paths(mechanism, list(PATHS), request.frame, driver).items()
        },
        axes=_axes(mechanism, request.frame) if request.frame in STILL else None,
        step_before=StepBeforeReply(
            step=angles.outward(step),
            alpha=None if before is None else angles.outward(before[0]),
            point=None if before is None else before[1].tolist(),
        ),
        **verdicts,
        **provenance(request, [name for name in ("alpha1", "alpha3") if getattr(request, name) is not None]),
    )


def _axes(mechanism: Any, frame: str) -> dict[str, list[list[float]]]:
    """Origin and tip of each axis, in a frame that stands still."""
    ends = {
        "shaft": ("shaft", (1.0, 0.0, 0.0)),
        "disc": ("seat", (0.0, 1.0, 0.0)),
        "bill": ("bearing", (0.0, 0.0, 1.0)),
    }
    return {
        name: [[float(x) for x in mechanism.carry(at, home, frame, 0.0)] for at in ((0.0, 0.0, 0.0), tip)]
        for name, (home, tip) in ends.items()
    }


def curves_table(reply: CurvesReply, units: Units = DEGREES) -> str:
    """Verdict and crossings as text."""
    before = reply.step_before
    lines = [f"alpha1 {reply.alpha1:g}, alpha3 {reply.alpha3:g} {units.angle}: {reply.status}"]
    for name in ("wrap", "clearance", "bite"):
        part = getattr(reply, name)
        lines.append(
            f"{name:<10}{'holds' if part.holds else 'fails'}, margin {part.margin:+.4f}{units.behind(units.length)}"
        )
    if before.point is not None:
        lines.append(
            f"E1 one step of {before.step:g} before the hit: {before.alpha:g}, {before.point[1]:.4f}, {before.point[2]:.4f}"
        )
    rows = []
    for k, alpha in enumerate(reply.alpha):
        places = [crossing.point[k] if crossing.on_rope[k] else None for crossing in (reply.E1, reply.E2)]
        if any(places):
            rows.append([f"{alpha:g}", *("-" if at is None else " ".join(f"{x:.4f}" for x in at) for at in places)])
    return "\n".join(
        [
            *lines,
            table(
                [
                    units.head("alpha", units.angle),
                    *(units.head(one, units.length) for one in ("E1 in u4", "E2 in u5")),
                ],
                rows,
            ),
        ]
    )


def curves_csv(reply: CurvesReply) -> bytes:
    """Every sample as a row; empty where the rope runs parallel to the plane."""
    columns: dict[str, Any] = {name: getattr(reply, name) for name in ("alpha", "beta", "alpha4")}
    for name in CROSSINGS:
        crossing = getattr(reply, name)
        for k, axis in enumerate("ijk"):
            columns[f"{name}.{axis}"] = [None if point is None else point[k] for point in crossing.point]
        columns |= {f"{name}.on_rope": crossing.on_rope, f"{name}.inside": crossing.inside}
    for name, path in reply.paths.items():
        columns |= {f"{name}.{axis}": [point[k] for point in path] for k, axis in enumerate("ijk")}
    return csv_text(columns).encode()


CURVES = Query(
    path="/v1/knotter/curves",
    command="knotter curves",
    summary="One pair over the bill's angle: where the rope meets its triangles, the paths of the points, and the verdict.",
    request=CurvesRequest,
    reply=CurvesReply,
    answer=answer_curves,
    table=curves_table,
    shows_units=True,
    examples={
        "chosen_pair": {"alpha1": 10, "alpha3": 25},
        "fails_to_wrap": {"alpha1": 0, "alpha3": 20},
        "meets_the_disc": {"alpha1": 0, "alpha3": 25},
    },
    exports={"csv": Export("text/csv; charset=utf-8", lambda *asked: curves_csv(answer_curves(*asked)))},
    is_long=lambda request: request.samples > 1000,
)
