"""A request of a knotter as a mechanism with its three conditions, and what every reply says of them."""

from __future__ import annotations

import math
from typing import Any

from app.query import Angles, RequestModel
from app.scenes.knotter_models import (
    ANGLES,
    MAX_RANGE_TURNS,
    ClearanceReply,
    EntryReply,
    LawModel,
    MachineRequest,
)
from linkage_atlas import FieldError

DECIMALS = 9
"""Of an angle in degrees where they are the angle itself."""


def given_fields(model: RequestModel) -> dict[str, Any]:
    """The fields of a model that have a value."""
    return {name: value for name in type(model).model_fields if (value := getattr(model, name)) is not None}


def inward(name: str, value: float, angles: Angles) -> float:
    """A parameter's value in radians if it is an angle."""
    return angles.inward(value) if name in ANGLES else value


def _law(name: str, model: LawModel, angles: Angles) -> Any:
    from synthesis.knotter.mechanism import Linear, Table

    field = f"/laws/{name}"
    kinds = [model.lead is not None or model.ratio is not None, model.table is not None, model.dwell is not None]
    if sum(kinds) != 1:
        raise FieldError(field, "a law is exactly one of: lead and ratio, table, dwell")
    if model.lead is not None or model.ratio is not None:
        return Linear(angles.inward(model.lead or 0.0), model.ratio or 0.0)
    outside = model.outside or ("hold" if name == "alpha4" else "error")
    rows = model.table
    if model.dwell is not None:
        rows = [[model.dwell.start, model.dwell.before], [model.dwell.end, model.dwell.after]]
        outside = "hold"
    try:
        columns = ([angles.inward(row[0]) for row in rows], [angles.inward(row[1]) for row in rows])
        return Table(*map(tuple, columns), model.kind, outside)
    except ValueError as error:
        raise FieldError(field, f"the law {name} is not defined: {error}", constraint="law_table") from error


def _range(
    field: str, found: list[float] | None, default: tuple[float, float], angles: Angles, may_be_empty: bool = False
) -> tuple[float, float]:
    if found is None:
        return default
    low, high = (angles.inward(at) for at in found)
    if not (low <= high if may_be_empty else low < high):
        raise FieldError(field, "the range must run from a smaller to a larger angle")
    if high - low > MAX_RANGE_TURNS * math.tau * (1 + 1e-12):
        raise FieldError(field, f"the range covers more than {MAX_RANGE_TURNS} turns", constraint="turns")
    return low, high


def machine_of(request: MachineRequest, angles: Angles) -> tuple[Any, dict[str, Any]]:
    """The mechanism of a request and its three conditions by name."""
    from synthesis.knotter import d_knotter

    mechanism = d_knotter.mechanism(
        {name: inward(name, value, angles) for name, value in given_fields(request.parameters).items()},
        given_fields(request.senses),
        {name: _law(name, law, angles) for name, law in given_fields(request.laws).items()},
        {name: tuple(point) for name, point in given_fields(request.points).items()},
    )
    options, windows = request.clearance, request.windows
    conditions = {
        "wrap": d_knotter.wrap(_range("/windows/wrap", windows.wrap, d_knotter.WRAP_WINDOW, angles)),
        "clearance": d_knotter.clearance(
            d_knotter.CLEARANCE_AT if options.at is None else angles.inward(options.at),
            _range("/clearance/over", options.over, d_knotter.CLEARANCE_OVER, angles, True),
            math.inf if options.disc_radius is None else options.disc_radius,
            options.hook == "locked",
        ),
        "bite": d_knotter.bite(_range("/windows/bite", windows.bite, d_knotter.BITE_WINDOW, angles)),
    }
    return mechanism, conditions


def pair_of(alpha1: float | None, alpha3: float | None, angles: Angles) -> tuple[float, float]:
    """The pair of spatial angles of a request in radians; the chosen pair, (10, 25) degrees, where one is left out."""
    return (
        math.radians(10.0) if alpha1 is None else angles.inward(alpha1),
        math.radians(25.0) if alpha3 is None else angles.inward(alpha3),
    )


def provenance(request: MachineRequest, searched: list[str]) -> dict[str, Any]:
    """Which values are assumed, published and given, and the frames of the points."""
    from synthesis.knotter import d_knotter

    given = [*given_fields(request.parameters), *given_fields(request.laws), *given_fields(request.points)]
    given += [name for name in searched if name not in given]
    given += [f"senses.{name}" for name in given_fields(request.senses)]
    assumed = [*d_knotter.ASSUMED_PARAMETERS, "beta", "alpha4"]
    assumed += [f"senses.{name}" for name in d_knotter.SENSES]
    assumed += [name for name in d_knotter.POINTS if name not in d_knotter.PUBLISHED_POINTS]
    published = ["alpha1", "alpha2", "alpha3", "d5", "d6", *d_knotter.PUBLISHED_POINTS]
    partly = {
        "S0": "radius 30 and starting angle 15 degrees are published, the sign of its k coordinate is assumed",
        "S1": "22 along i and -39 along k are published, its j coordinate is assumed",
    }
    return {
        "assumed": [name for name in assumed if name not in given],
        "published": [name for name in published if name not in given],
        "given": given,
        "partly_published": {name: text for name, text in partly.items() if name not in given},
        "frames": {**d_knotter.POINT_FRAMES, "E1": "u4", "E2": "u5"},
    }


def _entry(condition: Any, result: Any, row: int, angles: Angles) -> EntryReply:
    from synthesis.knotter.entry import Found
    from synthesis.knotter.segment_triangle import Crossing

    enters = result.windows[row] > 0
    opened = int(result.opened_by[row])
    sensitivity = float(result.sensitivity[row])
    return EntryReply.computed(
        holds=bool(result.holds[row]),
        status=Found(int(result.found[row])).sentence,
        angle=angles.outward(float(result.enter[row])) if enters else None,
        edge=condition.edge_names[opened - 2] if opened >= 2 else None,
        entered_by=("start" if opened < 0 else "rope end" if opened < 2 else "edge") if enters else None,
        point=[float(x) for x in result.point[row]] if enters else None,
        fraction=float(result.fraction[row]) if opened >= 2 else None,
        leave=angles.outward(float(result.leave[row])) if enters else None,
        windows=int(result.windows[row]),
        margin=float(result.margin[row]),
        nearest_angle=None if enters else angles.outward(float(result.nearest[row])),
        nearest_case=None if enters else Crossing(int(result.nearest_case[row])).sentence,
        angle_per_length=angles.outward(sensitivity) if math.isfinite(sensitivity) else None,
    )


def condition_reply(name: str, condition: Any, result: Any, row: int, angles: Angles) -> EntryReply | ClearanceReply:
    """One condition of one item as the reply says it."""
    if name != "clearance":
        return _entry(condition, result, row, angles)
    return ClearanceReply.computed(
        holds=bool(result.holds[row]),
        value=float(result.value[row]),
        worst=float(result.worst[row]),
        worst_angle=angles.outward(float(result.worst_driver[row])),
        margin=float(result.margin[row]),
    )


def unit_of(name: str, angles: Angles) -> float:
    """Radians in one unit of a dimension that is an angle; 1 for the others."""
    from synthesis.knotter.dimensions import ANGLES

    return angles.radian if name in ANGLES else 1.0
