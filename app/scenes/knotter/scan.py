"""The question about a grid of spatial angles."""

from __future__ import annotations

import itertools
import math
from typing import Annotated, Any, Literal

from pydantic import Field

from app.query import Angles, Query, ReplyModel, RequestModel, Resources
from app.scenes.knotter.machine import (
    DECIMALS,
    Bounded,
    ClearanceReply,
    ConditionName,
    EntryReply,
    MachineRequest,
    Provenance,
    condition_reply,
    given_fields,
    inward,
    machine_of,
    provenance,
    units_note,
)
from app.terminal import DEGREES, Units
from linkage_atlas import FieldError
from synthesis.scenes.knotter import d_knotter
from synthesis.scenes.knotter.conditions import study
from synthesis.sheet import csv_text

MAX_GRID_VALUES = 1001
"""Largest number of values of a grid parameter."""
MAX_PAIRS = 20_000
"""Largest number of combinations in a grid."""
LONG_PAIRS = 200
"""Number of combinations above which a scan takes more than a fraction of a second."""


GridValues = Annotated[list[Bounded], Field(min_length=1, max_length=MAX_GRID_VALUES)]


class Grid(RequestModel):
    """Values of each parameter. All combinations are evaluated; the last parameter varies fastest."""

    alpha1: GridValues | None = Field(
        None,
        description="Angle between the disc's axis j2 and j1 in the plane j1 o1 k1; default: 0, 10 and 20 degrees.",
    )
    alpha3: GridValues | None = Field(
        None,
        description="Angle between the bill's axis k0 and k1 in the plane j1 o1 k1; default: 20, 25 and 30 degrees.",
    )
    alpha2: GridValues | None = None
    d1: GridValues | None = None
    D: GridValues | None = None
    d5: GridValues | None = None
    d6: GridValues | None = None
    d9: GridValues | None = None
    d10: GridValues | None = None


class ScanRequest(MachineRequest):
    """Grid of parameters whose combinations are checked."""

    grid: Grid = Grid()
    conditions: Annotated[list[ConditionName], Field(min_length=1, max_length=3)] = Field(
        ["wrap", "clearance", "bite"], description="Conditions to compute."
    )


class PairReply(ReplyModel):
    """Verdicts of a combination of the grid; a condition that the request leaves out is null."""

    alpha1: float
    alpha3: float
    parameters: dict[str, float] | None = Field(description="Values of the other grid parameters.")
    wrap: EntryReply | None
    clearance: ClearanceReply | None
    bite: EntryReply | None
    feasible: bool
    margin: float = Field(description="Smallest margin of the computed conditions.")


class Report(ReplyModel):
    """Cost of the computation."""

    pairs: int
    elapsed_ms: float


class ScanReply(Provenance):
    """All combinations with their verdicts, and a list of the feasible combinations."""

    status: Literal["feasible", "infeasible"]
    axes: list[str] = Field(description="Grid parameters, in the order of the columns of `feasible`.")
    pairs: list[PairReply]
    feasible: list[list[float]]
    report: Report


def answer_scan(request: ScanRequest, resources: Resources) -> ScanReply:
    """Check the conditions for all combinations of the grid."""
    work = resources.work()
    angles = Angles(request.angle_unit, DECIMALS)
    prescribed = given_fields(request.grid)
    grid = {
        name: prescribed.get(name) or [angles.outward(math.radians(x)) for x in values]
        for name, values in d_knotter.GRID_DEGREES.items()
    }
    grid |= {name: values for name, values in prescribed.items() if name not in grid}
    if repeated := sorted(set(grid) & set(given_fields(request.parameters))):
        message = f"{repeated[0]} has values in the grid and in the parameters; remove one of the two"
        raise FieldError(f"/grid/{repeated[0]}", message)
    pairs = math.prod(len(values) for values in grid.values())
    if pairs > MAX_PAIRS:
        raise FieldError(
            "/grid",
            f"the grid has {pairs} combinations; at most {MAX_PAIRS} are allowed",
            constraint="pairs",
            amount=pairs,
        )
    mechanism, conditions = machine_of(request, angles)
    conditions_to_check = [name for name in conditions if name in request.conditions]
    radians = {name: [inward(name, x, angles) for x in values] for name, values in grid.items()}
    result = study(mechanism, radians, [conditions[name] for name in conditions_to_check], work)
    rows = []
    for row, values in enumerate(itertools.product(*grid.values())):
        if row % 256 == 0:
            work.go_on()
        verdicts = {
            name: condition_reply(conditions[name], result.conditions[name], row, angles)
            for name in conditions_to_check
        }
        rows.append(
            PairReply(
                alpha1=values[0],
                alpha3=values[1],
                parameters=dict(list(zip(grid, values))[2:]) or None,
                **{name: verdicts.get(name) for name in conditions},
                feasible=bool(result.feasible[row]),
                margin=float(result.margin[row]),
            )
        )
    feasible = [list(values) for row, values in zip(rows, itertools.product(*grid.values())) if row.feasible]
    return ScanReply(
        status="feasible" if feasible else "infeasible",
        axes=list(grid),
        pairs=rows,
        feasible=feasible,
        **provenance(request, list(prescribed)),
        report=Report(pairs=pairs, elapsed_ms=1e3 * work.elapsed),
    )


def scan_table(reply: ScanReply, units: Units = DEGREES) -> str:
    """Return a row for each pair with the verdict, position and margin of each condition."""
    labels = [
        "  ".join(reply.axes),
        *("  ".join(f"{value:g}" for value in _coordinates(pair)) for pair in reply.pairs),
    ]
    width = max(map(len, labels)) + 2
    lines = [f"{labels[0]:<{width}}{'wrap':<35}{'clearance (worst)':<35}{'bite':<35}tied"]
    for label, pair in zip(labels[1:], reply.pairs):
        verdicts = "  ".join(map(_verdict, (pair.wrap, pair.clearance, pair.bite)))
        lines.append(f"{label:<{width}}{verdicts}  {'yes' if pair.feasible else 'no'}")
    return "\n".join(
        [
            *lines,
            f"feasible: {len(reply.feasible)} of {len(reply.pairs)}",
            units_note(units),
            f"assumed, not published: {', '.join(reply.assumed) or 'nothing'}",
        ]
    )


def scan_csv(reply: ScanReply) -> str:
    """Return the pairs as comma-separated values; a value that does not exist is an empty cell."""
    columns: dict[str, Any] = dict(zip(reply.axes, zip(*map(_coordinates, reply.pairs))))
    for name in ("wrap", "clearance", "bite"):
        parts = [getattr(pair, name) for pair in reply.pairs]
        for field in () if parts[0] is None else type(parts[0]).model_fields:
            columns[f"{name}.{field}"] = [_cell(getattr(part, field)) for part in parts]
    columns |= {field: [getattr(pair, field) for pair in reply.pairs] for field in ("feasible", "margin")}
    return csv_text(columns, "\n")


def _coordinates(pair: PairReply) -> list[float]:
    """Return the coordinates of a pair in the grid, in the order of its axes."""
    return [pair.alpha1, pair.alpha3, *(pair.parameters or {}).values()]


def _cell(value: Any) -> Any:
    return " ".join(map(repr, value)) if isinstance(value, list) else value


def _verdict(condition: EntryReply | ClearanceReply | None) -> str:
    if condition is None:
        return f"{'':33}"
    if isinstance(condition, ClearanceReply):
        where = f"{condition.worst:+.4f} at {condition.worst_angle:.4f}"
    elif condition.angle is None:
        where = "never"
    else:
        where = f"{condition.angle:.6f} {condition.edge or condition.entered_by}"
    return f"{'yes' if condition.holds else 'no ':<3} {where:<20} {condition.margin:+9.3f}"


SCAN = Query(
    command="knotter scan",
    summary="Check for which spatial angles the knot is tied: rope on the bill, jaw past the disc, jaw on the rope.",
    answer=answer_scan,
    table=scan_table,
    exports={"csv": lambda request, resources: scan_csv(answer_scan(request, resources)).encode()},
    is_long=lambda request: math.prod(map(len, given_fields(request.grid).values())) > LONG_PAIRS,
)
