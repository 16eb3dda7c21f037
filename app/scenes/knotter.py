"""The knotter over HTTP and on the command line: answers made from `synthesis.knotter.d_knotter`."""

from __future__ import annotations

import itertools
import math
from typing import Any

from app.query import Angles, Export, Query, RequestModel, Resources
from app.scenes.knotter_models import (
    ANGLES,
    MAX_PAIRS,
    MAX_RANGE_TURNS,
    ClearanceReply,
    EntryReply,
    LawModel,
    LimitReply,
    LimitRequest,
    LimitRow,
    MachineRequest,
    NeedleReply,
    NeedleRequest,
    PairReply,
    Report,
    ScanReply,
    ScanRequest,
)
from app.scenes.knotter_tables import limit_table, needle_table, scan_csv, scan_table
from linkage_atlas import FieldError

MIN_SLOPE = 1e-12
"""Slope of eq 5 against its amplitude, below which the angle for a length is undetermined."""
LONG_PAIRS, LONG_SAMPLES = 200, 300
"""Above these an answer takes more than a fraction of a second."""
DECIMALS = 9
"""Of an angle in degrees where they are the angle itself."""


def _given(model: RequestModel) -> dict[str, Any]:
    return {name: value for name in type(model).model_fields if (value := getattr(model, name)) is not None}


def _inward(name: str, value: float, angles: Angles) -> float:
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


def _machine(request: MachineRequest, angles: Angles) -> tuple[Any, dict[str, Any]]:
    """The mechanism of a request and its three conditions by name."""
    from synthesis.knotter import d_knotter

    mechanism = d_knotter.mechanism(
        {name: _inward(name, value, angles) for name, value in _given(request.parameters).items()},
        _given(request.senses),
        {name: _law(name, law, angles) for name, law in _given(request.laws).items()},
        {name: tuple(point) for name, point in _given(request.points).items()},
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


def _provenance(request: MachineRequest, searched: list[str]) -> dict[str, Any]:
    from synthesis.knotter import d_knotter

    given = [*_given(request.parameters), *_given(request.laws), *_given(request.points)]
    given += [name for name in searched if name not in given]
    given += [f"senses.{name}" for name in _given(request.senses)]
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
    return EntryReply(
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


def _condition(name: str, condition: Any, result: Any, row: int, angles: Angles) -> EntryReply | ClearanceReply:
    if name != "clearance":
        return _entry(condition, result, row, angles)
    return ClearanceReply(
        holds=bool(result.holds[row]),
        value=float(result.value[row]),
        worst=float(result.worst[row]),
        worst_angle=angles.outward(float(result.worst_driver[row])),
        margin=float(result.margin[row]),
    )


def answer_scan(request: ScanRequest, resources: Resources) -> ScanReply:
    """Every combination of the grid under the conditions that are asked for."""
    from synthesis.knotter import d_knotter
    from synthesis.knotter.study import study

    work = resources.work()
    angles = Angles(request.angle_unit, DECIMALS)
    given = _given(request.grid)
    grid = {
        name: given.get(name) or [angles.outward(math.radians(x)) for x in values]
        for name, values in d_knotter.GRID_DEGREES.items()
    }
    grid |= {name: values for name, values in given.items() if name not in grid}
    if twice := sorted(set(grid) & set(_given(request.parameters))):
        raise FieldError(f"/grid/{twice[0]}", f"{twice[0]} is given both in the grid and in the parameters")
    pairs = math.prod(len(values) for values in grid.values())
    if pairs > MAX_PAIRS:
        raise FieldError(
            "/grid",
            f"the grid has {pairs} combinations, at most {MAX_PAIRS} are allowed",
            constraint="pairs",
            amount=pairs,
        )
    mechanism, conditions = _machine(request, angles)
    asked = [name for name in conditions if name in request.conditions]
    inward = {name: [_inward(name, x, angles) for x in values] for name, values in grid.items()}
    result = study(mechanism, inward, [conditions[name] for name in asked], work)
    rows = []
    for row, values in enumerate(itertools.product(*grid.values())):
        if row % 256 == 0:
            work.go_on()
        verdicts = {name: _condition(name, conditions[name], result.conditions[name], row, angles) for name in asked}
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
        **_provenance(request, list(given)),
        report=Report(pairs=pairs, elapsed_ms=1e3 * work.elapsed),
    )


def answer_limit(request: LimitRequest, resources: Resources) -> LimitReply:
    """The values of one parameter at which a condition's verdict changes."""
    from synthesis.knotter.study import solve

    angles = Angles(request.angle_unit, DECIMALS)
    mechanism, conditions = _machine(request, angles)
    condition = conditions[request.condition]
    low, high = (_inward(request.parameter, x, angles) for x in request.between)
    if not low < high:
        raise FieldError("/between", "the range must run from a smaller to a larger value")
    asked = {name: value for name in ("alpha1", "alpha3") if (value := getattr(request, name)) is not None}
    if request.parameter in {*asked, *_given(request.parameters)}:
        raise FieldError("/parameter", f"{request.parameter} is searched for and given a value as well")
    mechanism = mechanism.with_parameters(
        **{"alpha1": math.radians(10.0), "alpha3": math.radians(25.0)}
        | {name: angles.inward(value) for name, value in asked.items()}
    )
    limits, holds = solve(mechanism, condition, request.parameter, (low, high), request.samples, resources.work())
    rows = []
    for limit in limits:
        verdict = _condition(request.condition, condition, limit.result, 0, angles)
        rows.append(
            LimitRow(
                value=angles.outward(limit.value) if request.parameter in ANGLES else limit.value,
                holds="above" if limit.holds_above else "below",
                **{name: verdict if name == request.condition else None for name in conditions},
            )
        )
    return LimitReply(
        status="limited" if limits else "always" if holds else "never",
        parameter=request.parameter,
        limits=rows,
        **_provenance(request, [*asked, request.parameter]),
    )


def answer_needle(request: NeedleRequest, _: Resources) -> NeedleReply:
    """Clearance and length at the angle alpha2, and the angles for a given clearance or length."""
    from synthesis.knotter import d_knotter

    angles = Angles(request.angle_unit, DECIMALS)
    alpha2 = d_knotter.ALPHA2 if request.alpha2 is None else angles.inward(request.alpha2)
    if not abs(alpha2) < math.radians(90.0):
        raise FieldError("/alpha2", "alpha2 must lie between -90 and 90 degrees", constraint="range")
    from synthesis.knotter.needle import Needle

    needle = Needle(
        **{name: getattr(request, name) for name in ("S1x", "S1y", "r0", "D0", "d6", "r1")},
        beta0=d_knotter.BETA0 if request.beta0 is None else angles.inward(request.beta0),
    )
    clearance, length, best = float(needle.clearance(alpha2)), float(needle.lay(alpha2)), needle.best()
    free = needle.free_range()
    whole = needle.smallest_whole_degree()
    for_length = needle.angles_for_lay(request.d5)
    nearest = min(for_length, key=lambda at: abs(at - alpha2), default=None)
    slope = 0.0 if nearest is None else float(needle.lay_slope(nearest)) * angles.inward(1.0)
    names = [name for name in NeedleRequest.model_fields if name != "angle_unit"]
    given = [name for name in names if name in request.model_fields_set and getattr(request, name) is not None]
    return NeedleReply(
        status="free" if clearance > 0 else "blocked",
        clearance=clearance,
        alpha2_range=None if free is None else [angles.outward(at) for at in free],
        alpha2_whole_degrees=whole,
        clearance_max=float(needle.clearance(best)),
        clearance_max_angle=angles.outward(best),
        d5=length,
        d5_whole=math.trunc(length),
        d5_per_angle=float(needle.lay_slope(alpha2)) * angles.inward(1.0),
        alpha2_for_d5=None if nearest is None else angles.outward(nearest),
        alpha2_per_d5=1.0 / slope
        if abs(slope) > MIN_SLOPE * math.hypot(request.S1x, request.d6 + request.S1y)
        else None,
        alpha2_for_d5_all=[angles.outward(at) for at in for_length],
        assumed=[],
        published=[name for name in names if name not in given],
        given=given,
    )


QUERIES = (
    Query(
        path="/v1/knotter/scan",
        command="knotter scan",
        summary="Which spatial angles let the knot be tied: rope on the bill, jaw past the disc, jaw on the rope.",
        request=ScanRequest,
        reply=ScanReply,
        answer=answer_scan,
        table=scan_table,
        examples={
            "reference": {},
            "wrap_only": {"conditions": ["wrap"], "grid": {"alpha1": [10], "alpha3": [20, 25, 30]}},
            "finite_disc": {"conditions": ["clearance"], "clearance": {"disc_radius": 35, "hook": "moving"}},
        },
        exports={"csv": Export("text/csv", lambda *asked: scan_csv(answer_scan(*asked)).encode())},
        is_long=lambda request: math.prod(map(len, _given(request.grid).values())) > LONG_PAIRS,
    ),
    Query(
        path="/v1/knotter/limit",
        command="knotter limit",
        summary="At which values of one parameter does a condition begin or cease to hold?",
        request=LimitRequest,
        reply=LimitReply,
        answer=answer_limit,
        table=limit_table,
        examples={
            "reference": {},
            "bill_angle": {"condition": "clearance", "parameter": "alpha3", "between": [15, 35]},
        },
        is_long=lambda request: request.samples > LONG_SAMPLES,
    ),
    Query(
        path="/v1/knotter/needle",
        command="knotter needle",
        summary="Where the needle clears the jaw's cam, and the length d5 that lays the rope on the disc.",
        request=NeedleRequest,
        reply=NeedleReply,
        answer=answer_needle,
        table=needle_table,
        examples={"reference": {}, "steep": {"alpha2": 9, "d5": 57.8}},
    ),
)
