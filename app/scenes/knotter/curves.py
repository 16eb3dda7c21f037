"""The question about a single pair of spatial angles over a range of the angle of the bill."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from app.query import Angles, Column, Computed, Count, Query, ReplyModel, Resources
from app.scenes.knotter.machine import (
    DECIMALS,
    Bounded,
    ClearanceReply,
    EntryReply,
    MachineRequest,
    Provenance,
    Range,
    condition_reply,
    machine_of,
    provenance,
)
from app.terminal import DEGREES, Units, table
from linkage_atlas import FieldError
from synthesis.scenes.knotter.conditions import crossing_curve
from synthesis.scenes.knotter.mechanism import FRAMES, as_array
from synthesis.sheet import csv_text

MAX_SAMPLES = 7201
"""Largest number of bill angles in a reply."""
FIXED_FRAMES = ("shaft", "bearing", "seat")
"""Frames that do not move."""
DEFAULT_PAIR = {"alpha1": math.radians(10.0), "alpha3": math.radians(25.0)}
"""Spatial angles of a request that gives none, rad."""
ORIGIN = (0.0, 0.0, 0.0)
AXES = {"shaft": ("shaft", (1.0, 0.0, 0.0)), "disc": ("seat", (0.0, 1.0, 0.0)), "bill": ("bearing", (0.0, 0.0, 1.0))}
"""Frame and unit vector of each axis."""
CROSSINGS = {"E1": "wrap", "E2": "bite"}
"""Condition of each crossing of the rope with a triangle."""


class CurvesRequest(MachineRequest):
    """A pair of spatial angles and a range of the angle of the bill."""

    alpha1: Bounded | None = Field(
        None, description="Angle of the disc's axis; default: 10 degrees.", json_schema_extra={"unit": "angle"}
    )
    alpha3: Bounded | None = Field(
        None, description="Angle of the bill's axis; default: 25 degrees.", json_schema_extra={"unit": "angle"}
    )
    angle_range: Range | None = Field(None, description="Range of the angle of the bill; default: 0 to 360 degrees.")
    samples: Annotated[Count, Field(ge=2, le=MAX_SAMPLES)] = Field(
        181, description="Number of evenly spaced angles of the bill."
    )
    frame: Literal["shaft", "bearing", "seat", "u3", "u4", "u5"] = Field(
        "shaft",
        description="Frame of the paths: shaft (sigma1), bearing of the bill (sigma0), seat of the disc (sigma2), or a body.",
    )


class RopeCrossingReply(ReplyModel):
    """Intersection of the line of the rope with the plane of its triangle at each sample; null if they are parallel."""

    frame: str
    point: Computed[list[list[float] | None]] = Field(description="Intersection in the frame of the triangle.")
    path: Computed[list[list[float] | None]] = Field(description="Intersection in the frame of the request.")
    on_rope: Computed[list[bool]] = Field(description="True if the intersection lies between the ends of the rope.")
    inside: Computed[list[bool]] = Field(description="True if the rope crosses the interior of the triangle.")
    triangle: list[str]
    corners: Computed[list[list[list[float]]]] = Field(
        description="Vertices of the triangle in its own frame, for each sample."
    )


class CurvesReply(Provenance):
    """Crossings, paths and verdicts of a pair."""

    status: Literal["ties", "fails"]
    alpha1: float
    alpha3: float
    alpha: Column = Field(description="Angles of the bill.")
    beta: Column = Field(description="Angles of the disc.")
    alpha4: Column = Field(description="Angles of the jaw.")
    frame: str
    E1: RopeCrossingReply = Field(description="Crossing of the wrap over the whole range.")
    E2: RopeCrossingReply = Field(description="Crossing of the bite over the whole range.")
    paths: dict[str, Computed[list[list[float]]]] = Field(
        description="Path of each point in the frame of the request."
    )
    axes: dict[str, list[list[float]]] | None = Field(
        description="Two points at unit distance on each of the axes of shaft (i1), disc (j2) and bill (k0), in the frame "
        "of the request; null if this frame moves."
    )
    wrap: EntryReply
    clearance: ClearanceReply
    bite: EntryReply


def answer_curves(request: CurvesRequest, resources: Resources) -> CurvesReply:
    """Compute crossings, paths and verdicts of a pair over a range of the angle of the bill."""
    work, angles = resources.work(), Angles(request.angle_unit, DECIMALS)
    mechanism, conditions = machine_of(request, angles)
    prescribed = {name: value for name in DEFAULT_PAIR if (value := getattr(request, name)) is not None}
    pair = DEFAULT_PAIR | {name: angles.inward(value) for name, value in prescribed.items()}
    mechanism = mechanism.with_parameters(**pair)
    low, high = map(angles.inward, request.angle_range) if request.angle_range else (0.0, math.tau)
    if not low < high:
        raise FieldError("/angle_range", "the first angle of the range must be smaller than the second")
    for end in (low, high):  # tested separately: the laws may be constant over the range
        mechanism.require_laws(set(FRAMES), end, end)
    for condition in conditions.values():
        condition.check(mechanism)
    driver = np.linspace(low, high, request.samples)

    def rows(points: Any) -> list[list[float] | None]:
        return [None if math.isnan(point[0]) else point for point in points.tolist()]

    def moved(points: Any, frame: str) -> Any:
        return as_array(mechanism.transform(points, frame, request.frame, driver), driver.shape).T

    crossings = {}
    for name, condition_name in CROSSINGS.items():
        work.go_on()
        condition = conditions[condition_name]
        curve = crossing_curve(mechanism, condition, driver)
        crossings[name] = RopeCrossingReply(
            frame=condition.frame,
            point=rows(curve.point),
            path=rows(moved(curve.point.T, condition.frame)),
            on_rope=curve.on_rope.tolist(),
            inside=curve.inside.tolist(),
            triangle=list(condition.triangle),
            corners=np.moveaxis(curve.triangle, 0, 1).tolist(),
        )
    results = {name: condition.evaluate(mechanism, 1, work) for name, condition in conditions.items()}
    verdicts: dict[str, Any] = {
        name: condition_reply(conditions[name], result, 0, angles) for name, result in results.items()
    }
    laws = {
        name: (np.broadcast_to(law.value(driver), driver.shape) / angles.radian).tolist()
        for name, law in mechanism.laws.items()
    }
    axes = {
        name: [as_array(mechanism.transform(point, home, request.frame, 0.0), ()).tolist() for point in (ORIGIN, tip)]
        for name, (home, tip) in AXES.items()
    }
    return CurvesReply(
        status="ties" if all(result.holds[0] for result in results.values()) else "fails",
        **{name: angles.outward(angle) for name, angle in pair.items()},
        alpha=[angles.outward(angle) for angle in driver.tolist()],
        **laws,
        frame=request.frame,
        **crossings,
        paths={name: moved(xyz, home).tolist() for name, (home, xyz) in mechanism.points.items()},
        axes=axes if request.frame in FIXED_FRAMES else None,
        **verdicts,
        **provenance(request, list(prescribed)),
    )


def curves_table(reply: CurvesReply, units: Units = DEGREES) -> str:
    """Return the verdicts, and a row for each sample at which the rope itself meets a plane."""
    lines = [f"alpha1 {reply.alpha1:g}, alpha3 {reply.alpha3:g} {units.angle}: {reply.status}"]
    for name in ("wrap", "clearance", "bite"):
        condition = getattr(reply, name)
        lines.append(
            f"{name:<10}{'holds' if condition.holds else 'fails'}, margin {condition.margin:+.4f}{units.behind(units.length)}"
        )
    rows = []
    for k, alpha in enumerate(reply.alpha):
        points = [crossing.point[k] if crossing.on_rope[k] else None for crossing in (reply.E1, reply.E2)]
        if any(points):
            rows.append(
                [f"{alpha:g}", *("-" if point is None else " ".join(f"{x:.4f}" for x in point) for point in points)]
            )
    heads = [units.head("alpha", units.angle), *(units.head(name, units.length) for name in ("E1 in u4", "E2 in u5"))]
    return "\n".join([*lines, table(heads, rows)])


def curves_csv(reply: CurvesReply) -> bytes:
    """Return a row for each sample; a cell is empty if the rope is parallel to the plane."""
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
    command="knotter curves",
    summary="Compute a pair over the angle of the bill: crossings of the rope, paths of the points, and verdicts.",
    answer=answer_curves,
    table=curves_table,
    exports={"csv": lambda request, resources: curves_csv(answer_curves(request, resources))},
    is_long=lambda request: request.samples > 1000,
)
