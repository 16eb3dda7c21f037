"""The knotter over HTTP and on the command line: answers made from `synthesis.knotter.d_knotter`."""

from __future__ import annotations

import itertools
import math

from app.query import Angles, Export, Query, Resources
from app.scenes.knotter_curves import CURVES
from app.scenes.knotter_fit import FIT
from app.scenes.knotter_machine import DECIMALS, condition_reply, given_fields, inward, machine_of, provenance
from app.scenes.knotter_models import (
    ANGLES,
    MAX_PAIRS,
    LimitReply,
    LimitRequest,
    LimitRow,
    NeedleReply,
    NeedleRequest,
    PairReply,
    Report,
    ScanReply,
    ScanRequest,
)
from app.scenes.knotter_tables import limit_table, needle_table, scan_csv, scan_table
from app.scenes.knotter_tolerance import TOLERANCE
from linkage_atlas import FieldError

MIN_SLOPE = 1e-12
"""Slope of eq 5 against its amplitude, below which the angle for a length is undetermined."""
LONG_PAIRS, LONG_SAMPLES = 200, 300
"""Above these an answer takes more than a fraction of a second."""


def answer_scan(request: ScanRequest, resources: Resources) -> ScanReply:
    """Every combination of the grid under the conditions that are asked for."""
    from synthesis.knotter import d_knotter
    from synthesis.knotter.study import study

    work = resources.work()
    angles = Angles(request.angle_unit, DECIMALS)
    given = given_fields(request.grid)
    grid = {
        name: given.get(name) or [angles.outward(math.radians(x)) for x in values]
        for name, values in d_knotter.GRID_DEGREES.items()
    }
    grid |= {name: values for name, values in given.items() if name not in grid}
    if twice := sorted(set(grid) & set(given_fields(request.parameters))):
        raise FieldError(f"/grid/{twice[0]}", f"{twice[0]} is given both in the grid and in the parameters")
    pairs = math.prod(len(values) for values in grid.values())
    if pairs > MAX_PAIRS:
        raise FieldError(
            "/grid",
            f"the grid has {pairs} combinations, at most {MAX_PAIRS} are allowed",
            constraint="pairs",
            amount=pairs,
        )
    mechanism, conditions = machine_of(request, angles)
    asked = [name for name in conditions if name in request.conditions]
    radians = {name: [inward(name, x, angles) for x in values] for name, values in grid.items()}
    result = study(mechanism, radians, [conditions[name] for name in asked], work)
    rows = []
    for row, values in enumerate(itertools.product(*grid.values())):
        if row % 256 == 0:
            work.go_on()
        verdicts = {
            name: condition_reply(name, conditions[name], result.conditions[name], row, angles) for name in asked
        }
        rows.append(
            PairReply.computed(
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
        **provenance(request, list(given)),
        report=Report(pairs=pairs, elapsed_ms=1e3 * work.elapsed),
    )


def answer_limit(request: LimitRequest, resources: Resources) -> LimitReply:
    """The values of one parameter at which a condition's verdict changes."""
    from synthesis.knotter.study import solve

    angles = Angles(request.angle_unit, DECIMALS)
    mechanism, conditions = machine_of(request, angles)
    condition = conditions[request.condition]
    low, high = (inward(request.parameter, x, angles) for x in request.between)
    if not low < high:
        raise FieldError("/between", "the range must run from a smaller to a larger value")
    asked = {name: value for name in ("alpha1", "alpha3") if (value := getattr(request, name)) is not None}
    if request.parameter in {*asked, *given_fields(request.parameters)}:
        raise FieldError("/parameter", f"{request.parameter} is searched for and given a value as well")
    mechanism = mechanism.with_parameters(
        **{"alpha1": math.radians(10.0), "alpha3": math.radians(25.0)}
        | {name: angles.inward(value) for name, value in asked.items()}
    )
    limits, holds = solve(mechanism, condition, request.parameter, (low, high), request.samples, resources.work())
    rows = []
    for limit in limits:
        verdict = condition_reply(request.condition, condition, limit.result, 0, angles)
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
        **provenance(request, [*asked, request.parameter]),
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
    CURVES,
    Query(
        path="/v1/knotter/scan",
        command="knotter scan",
        summary="Which spatial angles let the knot be tied: rope on the bill, jaw past the disc, jaw on the rope.",
        request=ScanRequest,
        reply=ScanReply,
        answer=answer_scan,
        table=scan_table,
        shows_units=True,
        examples={
            "reference": {},
            "wrap_only": {"conditions": ["wrap"], "grid": {"alpha1": [10], "alpha3": [20, 25, 30]}},
            "finite_disc": {"conditions": ["clearance"], "clearance": {"disc_radius": 35, "hook": "moving"}},
        },
        exports={"csv": Export("text/csv", lambda *asked: scan_csv(answer_scan(*asked)).encode())},
        is_long=lambda request: math.prod(map(len, given_fields(request.grid).values())) > LONG_PAIRS,
    ),
    Query(
        path="/v1/knotter/limit",
        command="knotter limit",
        summary="At which values of one parameter does a condition begin or cease to hold?",
        request=LimitRequest,
        reply=LimitReply,
        answer=answer_limit,
        table=limit_table,
        shows_units=True,
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
        shows_units=True,
        examples={"reference": {}, "steep": {"alpha2": 9, "d5": 57.8}},
    ),
    FIT,
    TOLERANCE,
)
