"""The knotter over HTTP and on the command line: requests, replies and their limits, answers, tables and files."""

from __future__ import annotations

import itertools
import math
from contextlib import suppress
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from app.query import (
    Angles,
    AngleUnit,
    Column,
    Computed,
    Count,
    Number,
    PositiveNumber,
    Query,
    ReplyModel,
    RequestModel,
    Resources,
    reply_model,
)
from app.terminal import DEGREES, Units, table
from linkage_atlas import FieldError, OutOfTime
from synthesis.scenes.knotter import d_knotter
from synthesis.scenes.knotter.conditions import EntryStatus
from synthesis.scenes.knotter.curves import crossing_before_entry, crossing_curve, point_paths
from synthesis.scenes.knotter.d_knotter import Needle
from synthesis.scenes.knotter.fit import (
    Direction,
    Pattern,
    PrescribedVerdicts,
    directions,
    fit_pattern,
    rank,
    single_ranges,
)
from synthesis.scenes.knotter.mechanism import ANGULAR_DIMENSIONS, Linear, Table, as_array, dimensions
from synthesis.scenes.knotter.segment_triangle import CrossingCase
from synthesis.scenes.knotter.study import ConditionTolerance, analyse_tolerances, find_limits, study
from synthesis.sheet import csv_text

MAX_LENGTH = 1e9
"""Largest length, and largest angle in either unit: beyond it a double's digits no longer hold the sum of two."""
MAX_RATIO = 1000
"""Fastest a body may turn against the bill."""
MAX_TABLE_ROWS = 1000
MAX_GRID_VALUES = 1001
"""Values of one grid parameter."""
MAX_PAIRS = 20_000
"""Combinations of a grid."""
MAX_RANGE_TURNS = 2
"""Turns of the bill that one range may cover."""
LIMIT_SAMPLES = (3, 1025)
"""Fewest and most values of the parameter that the search for its limits looks at first."""


def _no_boolean(value: object) -> object:
    if isinstance(value, bool):
        raise ValueError("a sense is -1 or 1, not a truth value")
    return value


Bounded = Annotated[Number, Field(ge=-MAX_LENGTH, le=MAX_LENGTH)]
BoundedPositive = Annotated[PositiveNumber, Field(le=MAX_LENGTH)]
Point3 = Annotated[list[Bounded], Field(min_length=3, max_length=3)]
Range = Annotated[list[Bounded], Field(min_length=2, max_length=2, json_schema_extra={"parts": ["from", "to"]})]
GridValues = Annotated[list[Bounded], Field(min_length=1, max_length=MAX_GRID_VALUES)]
Sense = Annotated[Literal[-1, 1], BeforeValidator(_no_boolean)]
ConditionName = Literal["wrap", "clearance", "bite"]
ParameterName = Literal["alpha1", "alpha2", "alpha3", "d1", "D", "d5", "d6", "d9", "d10"]


class Parameters(RequestModel):
    """Sizes of the machine; each has the published value or else an assumed one."""

    alpha2: Bounded | None = Field(
        None,
        description="Turn about j from k1 to the bill's axis k0, after that of alpha3 about i; published 8 degrees.",
    )
    d1: Bounded | None = Field(
        None, description="Along k1, from o1 to where the disc's axis crosses the plane i1 o1 k1; assumed 136."
    )
    D: Bounded | None = Field(None, description="d2 + d4 along the disc's axis, only the sum matters; assumed 20.")
    d5: Bounded | None = Field(None, description="Between o1 and o2 along i1; published 54.")
    d6: Bounded | None = Field(None, description="From o1 to o0 along k0; published 142.")
    d9: Bounded | None = Field(None, description="Hinge of the jaw: from o4 to o5 along i4; assumed 12.")
    d10: Bounded | None = Field(None, description="Hinge of the jaw: from o4 to o5 along k4; assumed 24.5.")


class Senses(RequestModel):
    """Senses of rotation."""

    alpha: Sense | None = Field(None, description="Of alpha1 and alpha3; 1 is the printed one, assumed -1.")
    beta: Sense | None = Field(None, description="Of the disc; assumed -1.")


class Dwell(RequestModel):
    """Rest at one angle, an even turn, rest at another angle."""

    before: Bounded
    after: Bounded
    start: Bounded = Field(description="Bill's angle at which the turn starts.")
    end: Bounded = Field(description="Bill's angle at which the turn ends.")


class LawModel(RequestModel):
    """An angle over the bill's angle: `lead` (and `ratio`), or `table`, or `dwell`."""

    lead: Bounded | None = Field(None, description="Angle at bill angle zero.")
    ratio: Annotated[Number, Field(ge=-MAX_RATIO, le=MAX_RATIO)] | None = Field(
        None, description="Turns per turn of the bill; 0 if only the lead is given."
    )
    table: Annotated[list[Range], Field(max_length=MAX_TABLE_ROWS)] | None = Field(
        None, description="Rows of bill angle (increasing) and angle."
    )
    kind: Literal["linear", "pchip"] = Field("linear", description="How a table runs between its rows.")
    outside: Literal["hold", "error"] | None = Field(
        None,
        description="What a table says outside its rows: it holds its end angles (default of alpha4, a jaw that "
        "swings and rests) or nothing (default of beta, a disc that keeps turning).",
    )
    dwell: Dwell | None = None


class Laws(RequestModel):
    """Laws of the bodies that follow the bill; both are assumed, the source gives none."""

    beta: LawModel | None = Field(None, description="Rope-holding disc; assumed lead 23.5 degrees, ratio 0.5.")
    alpha4: LawModel | None = Field(
        None, description="Jaw, between i4 and i5; assumed 22.5 degrees to 0 between 270 and 337 degrees."
    )


class Points(RequestModel):
    """Points, each in its body's frame: S0 on the disc (u3); S8, S10 on the jaw (u5); the rest on the bill (u4)."""

    S0: Point3 | None = Field(None, description="Rope in the notch of the disc, at disc angle zero, u3.")
    S1: Point3 | None = Field(None, description="Where the needle lays the rope on the bill, u4.")
    S3: Point3 | None = Field(
        None, description="First end of the generator of the bill's side on which the rope must wrap, u4; published."
    )
    S4: Point3 | None = Field(None, description="Second end of that generator, u4; published.")
    S5: Point3 | None = Field(None, description="Third vertex of the wrap's triangle, u4.")
    S7: Point3 | None = Field(None, description="Rope's end for the bite, u4.")
    S8: Point3 | None = Field(None, description="First end of the edge that the rope must cross to be bitten, u5.")
    S9: Point3 | None = Field(None, description="Second end of that edge, u4.")
    S10: Point3 | None = Field(None, description="Point whose clearance from the disc is checked, u5.")


class Grid(RequestModel):
    """Values of each parameter that are combined with one another; the later parameters vary faster."""

    alpha1: GridValues | None = Field(
        None, description="Angle between the disc's axis j2 and j1 in the plane j1 o1 k1; 0, 10, 20 degrees."
    )
    alpha3: GridValues | None = Field(
        None, description="Angle between the bill's axis k0 and k1 in the plane j1 o1 k1; 20, 25, 30 degrees."
    )
    alpha2: GridValues | None = None
    d1: GridValues | None = None
    D: GridValues | None = None
    d5: GridValues | None = None
    d6: GridValues | None = None
    d9: GridValues | None = None
    d10: GridValues | None = None


class Windows(RequestModel):
    """Ranges of the bill's angle in which an entry is sought."""

    wrap: Range | None = Field(None, description="0 to 180 degrees.")
    bite: Range | None = Field(None, description="270 to 360 degrees.")


class ClearanceOptions(RequestModel):
    """How the way of the jaw's point past the disc is judged."""

    at: Bounded | None = Field(None, description="Bill's angle of `value`; 270 degrees.")
    over: Range | None = Field(
        None,
        description="Range in which the worst is sought; 240 to 300 degrees. Equal ends give the sample of eq 18.",
    )
    disc_radius: BoundedPositive | None = Field(None, description="Radius of the disc; the whole plane if not given.")
    hook: Literal["locked", "moving"] = Field(
        "locked", description="Locked: the jaw keeps its angle at `at` over the range. Moving: it follows its law."
    )


class MachineRequest(RequestModel):
    """One knotter: what is not given has its published value or else an assumed one."""

    parameters: Parameters = Parameters()
    senses: Senses = Senses()
    laws: Laws = Laws()
    points: Points = Points()
    windows: Windows = Windows()
    clearance: ClearanceOptions = ClearanceOptions()
    angle_unit: AngleUnit = "deg"


class PairRequest(MachineRequest):
    """One pair of spatial angles."""

    alpha1: Bounded | None = Field(
        None, description="Of the disc's axis; 10 degrees.", json_schema_extra={"unit": "angle"}
    )
    alpha3: Bounded | None = Field(
        None, description="Of the bill's axis; 25 degrees.", json_schema_extra={"unit": "angle"}
    )


class ScanRequest(MachineRequest):
    """Which combinations of a grid let the knot be tied?"""

    grid: Grid = Grid()
    conditions: Annotated[list[ConditionName], Field(min_length=1, max_length=3)] = Field(
        ["wrap", "clearance", "bite"], description="Only these are computed."
    )


class EntryReply(ReplyModel):
    """How the rope first enters its triangle; null is what does not exist for this pair."""

    holds: bool
    status: str
    angle: float | None = Field(description="Bill's angle of the entry.")
    edge: str | None = Field(description="Edge of entry, from its first to its second point.")
    entered_by: Literal["edge", "rope end", "start"] | None = Field(
        description="Through an edge; with an end of the rope, through the plane; or inside where the range starts."
    )
    point: list[float] | None = Field(description="Crossing at the entry: E1 in u4 (wrap), E2 in u5 (bite).")
    fraction: float | None = Field(description="Where the point lies along the edge of entry, 0 to 1.")
    leave: float | None = Field(description="Bill's angle at which the rope leaves, or the range's end.")
    windows: int = Field(description="Number of separate windows in the range.")
    margin: float = Field(
        description="Length, positive if the condition holds: entry point to the nearer end of the wanted edge. Else "
        "minus the distance of the entry point to the wanted edge, or of rope and triangle if they never meet."
    )
    nearest_angle: float | None = Field(
        description="Where the rope never enters: bill's angle of the closest approach."
    )
    nearest_case: str | None = Field(description="How the rope lies to the triangle there.")
    angle_per_length: float | None = Field(description="Condition number: shift of the angle per shift of the edge.")


class ClearanceReply(ReplyModel):
    """How the jaw's point S10 passes the disc; positive is interference."""

    holds: bool
    value: float = Field(description="At the angle `at`.")
    worst: float = Field(description="Largest over the range.")
    worst_angle: float
    margin: float


class PairReply(ReplyModel):
    """One combination of the grid; conditions that were not asked for are null."""

    alpha1: float
    alpha3: float
    parameters: dict[str, float] | None = Field(description="Values of further grid parameters.")
    wrap: EntryReply | None
    clearance: ClearanceReply | None
    bite: EntryReply | None
    feasible: bool
    margin: float = Field(description="The smallest of the conditions' margins.")


class Provenance(ReplyModel):
    """Where the values come from: an answer is worth no more than what it is made from."""

    assumed: list[str] = Field(description="Fitted so that the published pattern comes out, not data of the source.")
    published: list[str]
    given: list[str] = Field(description="Values of this request.")
    partly_published: dict[str, str] = Field(description="Assumed values of which a part is published.")
    frames: dict[str, str] = Field(description="The frame in which each point is given.")


class Report(ReplyModel):
    """What the answer cost."""

    pairs: int
    elapsed_ms: float


class ScanReply(Provenance):
    """Every combination with its verdicts, and the feasible ones."""

    status: Literal["feasible", "infeasible"]
    axes: list[str] = Field(description="The grid parameters, in the order of `feasible`.")
    pairs: list[PairReply]
    feasible: list[list[float]]
    report: Report


class LimitRequest(MachineRequest):
    """Where does one condition begin and cease to hold as one parameter changes?"""

    alpha1: Bounded | None = Field(None, description="10 degrees.")
    alpha3: Bounded | None = Field(None, description="25 degrees.")
    condition: ConditionName = "wrap"
    parameter: ParameterName = "d5"
    between: Range = Field([20.0, 120.0], description="Range of the parameter.")
    samples: Annotated[Count, Field(ge=LIMIT_SAMPLES[0], le=LIMIT_SAMPLES[1])] = 257


class LimitRow(ReplyModel):
    """One limit."""

    value: float = Field(description="Last value at which the condition holds.")
    holds: Literal["above", "below"]
    wrap: EntryReply | None
    clearance: ClearanceReply | None
    bite: EntryReply | None


class LimitReply(Provenance):
    """All limits in the range, increasing."""

    status: Literal["limited", "always", "never"]
    parameter: str
    limits: list[LimitRow]


class NeedleRequest(RequestModel):
    """The needle and the jaw's cam; every default is published."""

    S1x: Bounded = Field(22.0, description="Where the needle lays the rope: from the bill's axis along i4.")
    S1y: Bounded = Field(39.0, description="Where the needle lays the rope: from o4 along k4.")
    r0: BoundedPositive = Field(16.0, description="Largest radius of the jaw's cam.")
    D0: BoundedPositive = Field(20.0, description="Thickness of the needle.")
    d6: Bounded = Field(142.0, description="From o1 to o0 along k0.")
    r1: Annotated[Number, Field(ge=0, le=MAX_LENGTH)] = Field(
        30.0, description="Radius of the holding point S0 about the disc's axis."
    )
    beta0: Bounded | None = Field(None, description="Initial phase of the disc; 15 degrees.")
    alpha2: Bounded | None = Field(
        None, description="Turn about j from k1 to the bill's axis k0, after that of alpha3 about i; 8 degrees."
    )
    d5: Bounded = Field(54.0, description="Distance of o1 and o2 along i1 for which an angle is sought.")
    angle_unit: AngleUnit = "deg"


class NeedleReply(ReplyModel):
    """Equations 4 and 5 at the angle asked for, and their inverses."""

    status: Literal["free", "blocked"]
    clearance: float = Field(
        description="L of eq 4 at alpha2, the least distance between the needle and the jaw's cam: must be above 0."
    )
    alpha2_range: list[float] | None = Field(description="Angles between which the clearance is positive.")
    alpha2_whole_degrees: int | None = Field(description="Smallest whole degree in that range.")
    clearance_max: float
    clearance_max_angle: float
    d5: float = Field(description="Length that eq 5 wants at alpha2.")
    d5_whole: int = Field(description="The same without its fraction, as the source prints it.")
    d5_per_angle: float = Field(description="Slope of eq 5 at alpha2, per angle unit.")
    alpha2_for_d5: float | None = Field(
        description="The angle nearest to alpha2 at which eq 5 gives the d5 asked for."
    )
    alpha2_per_d5: float | None = Field(
        description="Condition number: shift of that angle per unit of d5; null where the length is the largest."
    )
    alpha2_for_d5_all: list[float]
    assumed: list[str]
    published: list[str]
    given: list[str]


DECIMALS = 9
"""Of an angle in degrees where they are the angle itself."""


def given_fields(model: RequestModel) -> dict[str, Any]:
    return {name: value for name in type(model).model_fields if (value := getattr(model, name)) is not None}


def inward(name: str, value: float, angles: Angles) -> float:
    """A parameter's value in radians if it is an angle."""
    return angles.inward(value) if name in ANGULAR_DIMENSIONS else value


def _law(name: str, model: LawModel, angles: Angles) -> Any:
    field = f"/laws/{name}"
    kinds = [model.lead is not None or model.ratio is not None, model.table is not None, model.dwell is not None]
    if sum(kinds) != 1:
        raise FieldError(field, "a law is exactly one of: lead and ratio, table, dwell")
    if model.outside is not None and model.table is None:
        raise FieldError(f"{field}/outside", "only a table has rows outside of which it says something")
    if kinds[0]:
        if model.kind != "linear":
            raise FieldError(f"{field}/kind", "a lead and a ratio are linear: other laws are tables")
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


def pair_of(request: Any, angles: Angles) -> tuple[Any, dict[str, Any], dict[str, float], list[str]]:
    """As `machine_of`, with the pair of spatial angles of a request (rad), and which of the two are given.

    Where one is left out it is that of the chosen pair, (10, 25) degrees.
    """
    mechanism, conditions = machine_of(request, angles)
    given = {name: value for name in ("alpha1", "alpha3") if (value := getattr(request, name)) is not None}
    pair = {"alpha1": math.radians(10.0), "alpha3": math.radians(25.0)}
    pair |= {name: angles.inward(value) for name, value in given.items()}
    return mechanism.with_parameters(**pair), conditions, pair, list(given)


def provenance(request: MachineRequest, searched: list[str]) -> dict[str, Any]:
    """Which values are assumed, published and given, and the frames of the points."""
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
    enters = result.windows[row] > 0
    opened = int(result.entered_by[row])
    sensitivity = float(result.sensitivity[row])
    return EntryReply.computed(
        holds=bool(result.holds[row]),
        status=EntryStatus(int(result.status[row])).sentence,
        angle=angles.outward(float(result.enter[row])) if enters else None,
        edge=condition.edge_names[opened - 2] if opened >= 2 else None,
        entered_by=("start" if opened < 0 else "rope end" if opened < 2 else "edge") if enters else None,
        point=[float(x) for x in result.point[row]] if enters else None,
        fraction=float(result.fraction[row]) if opened >= 2 else None,
        leave=angles.outward(float(result.leave[row])) if enters else None,
        windows=int(result.windows[row]),
        margin=float(result.margin[row]),
        nearest_angle=None if enters else angles.outward(float(result.nearest[row])),
        nearest_case=None if enters else CrossingCase(int(result.nearest_case[row])).sentence,
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
    return angles.radian if name in ANGULAR_DIMENSIONS else 1.0


MAX_SAMPLES = 7201
MIN_STEP_DEGREES = 0.01
STILL = ("shaft", "bearing", "seat")
"""Frames that do not move."""
PATHS = ("S0", "S1", "S3", "S4", "S5", "S7", "S8", "S9", "S10", "O5")
CROSSINGS = {"E1": "wrap", "E2": "bite"}


class CurvesRequest(PairRequest):
    """One pair over a range of the bill's angle."""

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
    work, angles = resources.work(), Angles(request.angle_unit, DECIMALS)
    mechanism, conditions, pair, given = pair_of(request, angles)
    low, high = (0.0, math.tau) if request.over is None else (angles.inward(at) for at in request.over)
    if not low < high:
        raise FieldError("/over", "the range must run from a smaller to a larger angle")
    step = math.radians(2.0) if request.step is None else angles.inward(request.step)
    if step < math.radians(MIN_STEP_DEGREES) * (1 - 1e-9):
        raise FieldError("/step", f"the step must be at least {MIN_STEP_DEGREES} degrees")
    frames = {frame for frame, _ in mechanism.points.values()} | {"seat"}
    for end in (low, high):  # between its ends a law may be at rest all the time
        mechanism.require_laws(frames, end, end)
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
        moved = as_array(mechanism.transform(curve.point.T, condition.frame, request.frame, driver), driver.shape).T
        crossings[name] = RopeCrossingReply(
            frame=condition.frame,
            point=rows(curve.point),
            path=rows(moved),
            on_rope=curve.on_rope.tolist(),
            inside=curve.inside.tolist(),
            triangle=list(condition.triangle),
            corners=np.moveaxis(curve.triangle, 0, 1).tolist(),
        )
    before = crossing_before_entry(mechanism, conditions["wrap"], step)
    results = {name: condition.evaluate(mechanism, 1, work) for name, condition in conditions.items()}
    verdicts: dict[str, Any] = {
        name: condition_reply(name, conditions[name], result, 0, angles) for name, result in results.items()
    }
    radian = angles.radian
    laws = {name: np.broadcast_to(law.value(driver), driver.shape) / radian for name, law in mechanism.laws.items()}
    return CurvesReply(
        status="ties" if all(result.holds[0] for result in results.values()) else "fails",
        **{name: angles.outward(angle) for name, angle in pair.items()},
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
        **provenance(request, given),
    )


def _axes(mechanism: Any, frame: str) -> dict[str, list[list[float]]]:
    """Origin and tip of each axis, in a frame that stands still."""
    ends = {
        "shaft": ("shaft", (1.0, 0.0, 0.0)),
        "disc": ("seat", (0.0, 1.0, 0.0)),
        "bill": ("bearing", (0.0, 0.0, 1.0)),
    }
    return {
        name: [[float(x) for x in mechanism.transform(at, home, frame, 0.0)] for at in ((0.0, 0.0, 0.0), tip)]
        for name, (home, tip) in ends.items()
    }


def curves_table(reply: CurvesReply, units: Units = DEGREES) -> str:
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
    command="knotter curves",
    summary="One pair over the bill's angle: where the rope meets its triangles, the paths of the points, and the verdict.",
    answer=answer_curves,
    table=curves_table,
    exports={"csv": lambda *asked: curves_csv(answer_curves(*asked))},
    is_long=lambda request: request.samples > 1000,
)


MAX_UNKNOWNS, MAX_ENTRIES = 40, 200
DEFAULT_RANGES = {
    "d1": (40.0, 250.0),
    "D": (-150.0, 150.0),
    "beta.lead": (0.0, 90.0),
    "beta.ratio": (0.2, 1.1),
    "S1.j": (-30.0, 30.0),
    "S5.k": (0.0, 12.0),
    "S10.i": (20.0, 80.0),
    "S10.k": (0.0, 80.0),
}
"""Of the unknowns that decide about the source's tables 1 and 2, in degrees and mm."""
PAIRS = [(one, three) for one in (0, 10, 20) for three in (20, 25, 30)]
NO_WRAP, MEETS_DISC = ((0, 20), (10, 20)), ((0, 25), (20, 20))
PUBLISHED = [
    *({"condition": "wrap", "alpha1": a, "alpha3": b, "holds": (a, b) not in NO_WRAP} for a, b in PAIRS),
    *(
        {"condition": "clearance", "alpha1": a, "alpha3": b, "holds": (a, b) not in MEETS_DISC}
        for a, b in PAIRS
        if (a, b) not in NO_WRAP
    ),
]
"""The source's tables 1 (9 entries) and 2 (7 entries)."""

DimensionName = Annotated[str, Field(max_length=20, pattern=r"^[A-Za-z0-9]+(\.(lead|ratio|i|j|k))?$")]


class WantedEntry(RequestModel):
    """One verdict of the pattern."""

    condition: ConditionName
    alpha1: Bounded = Field(json_schema_extra={"unit": "angle"})
    alpha3: Bounded = Field(json_schema_extra={"unit": "angle"})
    holds: bool


class UnknownRange(RequestModel):
    """A dimension that is sought within a range."""

    name: DimensionName = Field(
        description="A parameter (d1), lead or ratio of a linear law (beta.lead), or a point's coordinate (S1.j)."
    )
    low: Bounded
    high: Bounded
    start: Bounded | None = Field(
        None, description="Where one more search begins; all unknowns or none must have one."
    )


class PatternFitRequest(MachineRequest):
    """Which dimensions reproduce a pattern of verdicts?"""

    unknowns: Annotated[list[UnknownRange], Field(max_length=MAX_UNKNOWNS)] | None = Field(
        None, description="blank: the eight that decide about the source's two tables."
    )
    pattern: Annotated[list[WantedEntry], Field(min_length=1, max_length=MAX_ENTRIES)] | None = Field(
        None, description="blank: the source's, 9 verdicts of the wrap and 7 of the clearance at 270 degrees."
    )
    draws: Annotated[Count, Field(ge=0, le=2000)] = Field(
        128, description="Seeded draws over the ranges; 0: only from `start`."
    )
    descents: Annotated[Count, Field(ge=0, le=20)] = Field(
        4, description="How many of the best draws are improved; 0: `start` is judged as it is."
    )
    seed: Annotated[Count, Field(ge=0, le=2**32 - 1)] = 0
    budget_ms: PositiveNumber = Field(
        20_000,
        le=600_000,
        description="After so long the best set so far is the answer, without `alone` and `directions` where no time is left.",
    )


BOUNDS_SHARE = 0.3
"""Part of the budget that the search leaves to the bounds of what it found."""
LEAST_SECONDS = 0.05
"""Of a smaller budget: one set is judged in any case, on however busy a machine."""
DirectionReply = reply_model(Direction)


class EntryMargin(ReplyModel):
    """One verdict of the pattern."""

    condition: str
    alpha1: float
    alpha3: float
    wanted: bool
    margin: float = Field(description="Positive where the verdict is the wanted one.")


class SetReply(ReplyModel):
    """One set of dimensions."""

    values: dict[str, float]
    margin: float = Field(description="The smallest of the pattern's margins; positive where all of it comes out.")


class PatternFitReply(Provenance):
    """The best set, others, and how little the pattern determines them."""

    status: Literal["reproduced", "not reproduced"]
    values: dict[str, float]
    margin: float
    entries: list[EntryMargin]
    alone: dict[str, list[float]] | None = Field(
        description="The range of each unknown in which the pattern is kept while the others stay."
    )
    directions: list[DirectionReply] | None = Field(
        description="Orthogonal, those that change the margins least first."
    )
    rank: int | None = Field(description="Directions that change the margins to first order; the others are free.")
    free: int | None = Field(description="Unknowns less the rank: directions that no margin sees to first order.")
    others: list[SetReply] = Field(description="Sets of the other starts.")
    draws: int
    draws_kept: int = Field(description="Draws over the ranges that reproduce the pattern as they are.")
    start_margin: float | None = Field(description="Smallest margin at `start`; null without one.")


def answer_fit(request: PatternFitRequest, resources: Resources) -> PatternFitReply:
    """Dimensions that reproduce a pattern, and how non-unique they are."""
    whole = resources.work(max(request.budget_ms / 1000, LEAST_SECONDS))
    work, angles = whole.extended(-BOUNDS_SHARE), Angles(request.angle_unit, DECIMALS)
    mechanism, conditions = machine_of(request, angles)
    unit_in = 1.0 if request.angle_unit == "deg" else math.radians(1.0)
    unknowns = request.unknowns
    if unknowns is None:
        scale = {name: unit_in if name == "beta.lead" else 1.0 for name in DEFAULT_RANGES}
        unknowns = [
            UnknownRange(name=name, low=scale[name] * low, high=scale[name] * high)
            for name, (low, high) in DEFAULT_RANGES.items()
        ]
    # the spatial angles are the pattern's
    known, names = sorted({*dimensions(mechanism)} - {"alpha1", "alpha3"}), [one.name for one in unknowns]
    other = [name for name in names if name not in known]
    for index, one in enumerate(unknowns):
        field = f"/unknowns/{index}"
        if one.name in other:
            message = f"no dimensions of this machine that a fit seeks: {', '.join(other)}"
            raise FieldError(f"{field}/name", message, known=known)
        if names.index(one.name) != index:
            raise FieldError(f"{field}/name", f"{one.name} is sought twice")
        if not one.low < one.high:
            raise FieldError(f"{field}/high", "the range must run from a smaller to a larger value")
        if one.start is not None and not one.low <= one.start <= one.high:
            raise FieldError(f"{field}/start", "the start must lie in the range")
    starts = [one.start for one in unknowns]
    if len({start is None for start in starts}) > 1:
        raise FieldError("/unknowns", "give a start to all unknowns or to none")
    if not unknowns or ((request.draws == 0 or request.descents == 0) and starts[0] is None):
        raise FieldError("/draws", "there is nothing to begin with: draws and descents, or a start, are wanted")
    entries = request.pattern
    if entries is None:
        rows = [{**row, "alpha1": unit_in * row["alpha1"], "alpha3": unit_in * row["alpha3"]} for row in PUBLISHED]
        entries = [WantedEntry.model_validate(row) for row in rows]
    if request.pattern is None and request.clearance.over is None:
        # the source judges the clearance at one angle
        at = conditions["clearance"].at
        conditions["clearance"] = replace(conditions["clearance"], over=(at, at))
    wanted, order = [], []
    for name, condition in conditions.items():
        part = [entry for entry in entries if entry.condition == name]
        if part:
            condition.check(mechanism)
            columns = {
                axis: np.array([angles.inward(getattr(entry, axis)) for entry in part])
                for axis in ("alpha1", "alpha3")
            }
            wanted.append(PrescribedVerdicts(condition, columns, np.array([entry.holds for entry in part])))
            order += part
    units = np.array([unit_of(name, angles) for name in names])
    ranges = {one.name: (one.low * unit, one.high * unit) for one, unit in zip(unknowns, units)}
    pattern = Pattern(mechanism, wanted, ranges)
    start = None if starts[0] is None else pattern.normalise(np.array(starts, float) * units)
    start_margin = None if start is None else float(pattern.margins(start[None], work)[0].min())
    found, kept = fit_pattern(
        pattern, request.draws if request.descents else 0, request.descents, request.seed, start, work
    )
    best = found[0]
    reproduced = best.smallest_margin > 0
    bounds: dict[str, Any] = dict.fromkeys(("alone", "directions", "rank", "free"))
    with suppress(OutOfTime):  # then they are left out
        if reproduced and best.slopes is not None:
            alone, ways = single_ranges(pattern, best.unknowns, whole), directions(pattern, best, whole)
            bounds = {
                "alone": {name: [low / u, high / u] for name, (low, high), u in zip(names, alone, units)},
                "directions": [replace(way, vector=dict(zip(names, way.vector.tolist()))) for way in ways],
                "rank": rank(ways),
                "free": len(names) - rank(ways),
            }

    def values(share: Any) -> dict[str, float]:
        return dict(zip(names, (pattern.denormalise(share) / units).tolist()))

    return PatternFitReply(
        status="reproduced" if reproduced else "not reproduced",
        values=values(best.unknowns),
        margin=best.smallest_margin,
        entries=[
            {**entry.model_dump(exclude={"holds"}), "wanted": entry.holds, "margin": float(margin)}
            for entry, margin in zip(order, best.margins)
        ],
        **bounds,
        others=[SetReply(values=values(one.unknowns), margin=one.smallest_margin) for one in found[1:]],
        draws=request.draws,
        draws_kept=kept,
        start_margin=start_margin,
        **provenance(request, names),
    )


def fit_table(reply: PatternFitReply, units: Units = DEGREES) -> str:
    held = sum(entry.margin > 0 for entry in reply.entries)
    alone = reply.alone or {}
    rows = [
        [name, f"{value:.6g}", *(f"{bound:.6g}" for bound in alone.get(name, ("", "")) if bound != "")]
        for name, value in reply.values.items()
    ]
    margin = units.value(reply.margin, units.length, 4)
    lines = [
        f"{reply.status}: {held} of {len(reply.entries)} verdicts, smallest margin {margin}",
        table(["unknown", "value", *(["kept from", "to"] if alone else [])], rows),
    ]
    if reply.directions is not None:
        ends = [f"{way.back + way.forth:.3g}" for way in reply.directions]
        lines.append(
            f"{reply.free} of {len(reply.values)} directions are free to first order; along each the pattern is kept over"
        )
        lines.append("  " + ", ".join(ends) + " of the ranges")
    lines += [
        f"another set: margin {one.margin:.4g}{units.behind(units.length)}, "
        + ", ".join(f"{k} {v:.5g}" for k, v in one.values.items())
        for one in reply.others
    ]
    return "\n".join(lines)


FIT = Query(
    command="knotter fit",
    summary="Which unknown dimensions reproduce a wanted pattern of verdicts, and how little the pattern determines them?",
    answer=answer_fit,
    table=fit_table,
    is_long=lambda request: True,
)


class KnotterToleranceRequest(PairRequest):
    """One pair of a knotter that is made within tolerances."""

    lengths: BoundedPositive = Field(0.1, description="Half width of the tolerance of every length and coordinate.")
    angles: BoundedPositive | None = Field(
        None,
        description="Half width of the tolerance of every angle; 0.1 degrees.",
        json_schema_extra={"unit": "angle"},
    )
    samples: Annotated[Count, Field(ge=0, le=20_000)] = Field(
        1000, description="Seeded draws from the box of the tolerances."
    )
    seed: Annotated[Count, Field(ge=0, le=2**32 - 1)] = 0


ConditionToleranceReply = reply_model(ConditionTolerance)


class KnotterToleranceReply(Provenance):
    """The verdict within tolerances."""

    status: Literal["ties", "may fail", "fails"] = Field(
        description="ties: at the worse corner of each condition and in every sample. may fail: not there. fails: as it is."
    )
    alpha1: float
    alpha3: float
    share: float = Field(description="The share of the samples in which all conditions hold.")
    dimensions: int
    samples: int
    wrap: ConditionToleranceReply
    clearance: ConditionToleranceReply
    bite: ConditionToleranceReply


def answer_tolerance(request: KnotterToleranceRequest, resources: Resources) -> KnotterToleranceReply:
    work, angles = resources.work(), Angles(request.angle_unit, DECIMALS)
    mechanism, conditions, pair, given = pair_of(request, angles)
    for condition in conditions.values():
        condition.check(mechanism)
    angular = math.radians(0.1) if request.angles is None else angles.inward(request.angles)
    tolerances = {
        name: angular if name in ANGULAR_DIMENSIONS else request.lengths
        for name in dimensions(mechanism)
        if not name.endswith(".ratio")
    }
    found, share = analyse_tolerances(mechanism, conditions, tolerances, request.samples, request.seed, work)
    replies: dict[str, Any] = {
        name: replace(one, sensitivity={key: x * unit_of(key, angles) for key, x in one.sensitivity.items()})
        for name, one in found.items()
    }
    safe = share == 1.0 and all(one.corner > 0 for one in found.values())
    fails = any(one.margin <= 0 for one in found.values())
    return KnotterToleranceReply(
        status="fails" if fails else "ties" if safe else "may fail",
        **{name: angles.outward(angle) for name, angle in pair.items()},
        share=share,
        dimensions=len(tolerances),
        samples=request.samples,
        **replies,
        **provenance(request, given),
    )


def tolerance_table(reply: KnotterToleranceReply, units: Units = DEGREES) -> str:
    rows, most = [], []
    for name in ("wrap", "clearance", "bite"):
        one = getattr(reply, name)
        factor = "-" if one.factor is None else f"{one.factor:.3g}"
        rows.append([name, *(f"{x:+.4f}" for x in (one.margin, one.corner, one.least)), f"{one.share:.1%}", factor])
        leading = list(one.sensitivity.items())[:4]
        most.append(
            f"  {name}: "
            + ", ".join(f"{key} {value:+.3g}" for key, value in leading)
            + f" per {units.length or 'unit of length'} or {units.angle}"
        )
    lengths = [units.head(word, units.length) for word in ("margin", "worse corner", "least sample")]
    head = ["condition", *lengths, "hold", "tolerances times"]
    pair = f"alpha1 {reply.alpha1:g}, alpha3 {reply.alpha3:g} {units.angle}"
    title = f"{pair}: {reply.status}; {reply.share:.1%} of {reply.samples} samples tie"
    return "\n".join([title, table(head, rows), "what matters most:", *most])


TOLERANCE = Query(
    command="knotter tolerance",
    summary="Does the knot hold within tolerances of all lengths and angles, and which of them matters?",
    answer=answer_tolerance,
    table=tolerance_table,
    is_long=lambda request: request.samples > 500,
)


def scan_table(reply: ScanReply, units: Units = DEGREES) -> str:
    """The pairs as rows: of each condition the verdict, where, and the margin."""
    labels = ["  ".join(reply.axes), *("  ".join(f"{value:g}" for value in _place(pair)) for pair in reply.pairs)]
    width = max(map(len, labels)) + 2
    lines = [f"{labels[0]:<{width}}{'wrap':<35}{'clearance (worst)':<35}{'bite':<35}tied"]
    for label, pair in zip(labels[1:], reply.pairs):
        verdicts = "  ".join(_verdict(part) for part in (pair.wrap, pair.clearance, pair.bite))
        lines.append(f"{label:<{width}}{verdicts}  {'yes' if pair.feasible else 'no'}")
    return "\n".join(
        [*lines, f"feasible: {len(reply.feasible)} of {len(reply.pairs)}", _measured(units), _assumed(reply)]
    )


def limit_table(reply: LimitReply, units: Units = DEGREES) -> str:
    lines = [
        f"  {row.value:.9f}, holds {row.holds}  {_verdict(row.wrap or row.clearance or row.bite)}"
        for row in reply.limits
    ]
    return "\n".join([f"{reply.parameter}: {reply.status}", *lines, _measured(units), _assumed(reply)])


def needle_table(reply: NeedleReply, units: Units = DEGREES) -> str:
    rows = reply.model_dump(exclude={"assumed", "published", "given"})
    return "\n".join([*(f"{name:<22}{value}" for name, value in rows.items()), _measured(units, "lengths")])


def scan_csv(reply: ScanReply) -> str:
    """The pairs as comma-separated values; empty where something does not exist."""
    columns: dict[str, Any] = dict(zip(reply.axes, zip(*map(_place, reply.pairs))))
    for name in ("wrap", "clearance", "bite"):
        parts = [getattr(pair, name) for pair in reply.pairs]
        for field in () if parts[0] is None else type(parts[0]).model_fields:
            columns[f"{name}.{field}"] = [_cell(getattr(part, field)) for part in parts]
    columns |= {field: [getattr(pair, field) for pair in reply.pairs] for field in ("feasible", "margin")}
    return csv_text(columns, "\n")


def _place(pair: PairReply) -> list[float]:
    """Where in the grid a pair lies, in the order of its axes."""
    return [pair.alpha1, pair.alpha3, *(pair.parameters or {}).values()]


def _cell(value: Any) -> Any:
    return " ".join(map(repr, value)) if isinstance(value, list) else value


def _measured(units: Units, what: str = "margins and lengths") -> str:
    return f"angles in {units.angle}, {what} in {units.length or 'the unit of the lengths'}"


def _assumed(reply: ScanReply | LimitReply) -> str:
    return f"assumed, not published: {', '.join(reply.assumed) or 'nothing'}"


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


MIN_SLOPE = 1e-12
"""Slope of eq 5 against its amplitude, below which the angle for a length is undetermined."""
LONG_PAIRS, LONG_SAMPLES = 200, 300
"""Above these an answer takes more than a fraction of a second."""


def answer_scan(request: ScanRequest, resources: Resources) -> ScanReply:
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
    angles = Angles(request.angle_unit, DECIMALS)
    mechanism, conditions, _, given = pair_of(request, angles)
    condition = conditions[request.condition]
    low, high = (inward(request.parameter, x, angles) for x in request.between)
    if not low < high:
        raise FieldError("/between", "the range must run from a smaller to a larger value")
    if request.parameter in {*given, *given_fields(request.parameters)}:
        raise FieldError("/parameter", f"{request.parameter} is searched for and given a value as well")
    limits, holds = find_limits(
        mechanism, condition, request.parameter, (low, high), request.samples, resources.work()
    )
    rows = []
    for limit in limits:
        verdict = condition_reply(request.condition, condition, limit.result, 0, angles)
        rows.append(
            LimitRow(
                value=angles.outward(limit.value) if request.parameter in ANGULAR_DIMENSIONS else limit.value,
                holds="above" if limit.holds_above else "below",
                **{name: verdict if name == request.condition else None for name in conditions},
            )
        )
    return LimitReply(
        status="limited" if limits else "always" if holds else "never",
        parameter=request.parameter,
        limits=rows,
        **provenance(request, [*given, request.parameter]),
    )


def answer_needle(request: NeedleRequest, _: Resources) -> NeedleReply:
    """Clearance and length at the angle alpha2, and the angles for a given clearance or length."""
    angles = Angles(request.angle_unit, DECIMALS)
    alpha2 = d_knotter.ALPHA2 if request.alpha2 is None else angles.inward(request.alpha2)
    if not abs(alpha2) < math.radians(90.0):
        raise FieldError("/alpha2", "alpha2 must lie between -90 and 90 degrees", constraint="range")

    needle = Needle(
        **{name: getattr(request, name) for name in ("S1x", "S1y", "r0", "D0", "d6", "r1")},
        beta0=d_knotter.BETA0 if request.beta0 is None else angles.inward(request.beta0),
    )
    clearance, length, best = float(needle.clearance(alpha2)), float(needle.d5(alpha2)), needle.best_angle()
    free = needle.free_range()
    whole = needle.smallest_whole_degree()
    for_length = needle.angles_for_d5(request.d5)
    nearest = min(for_length, key=lambda at: abs(at - alpha2), default=None)
    slope = 0.0 if nearest is None else float(needle.d5_slope(nearest)) * angles.inward(1.0)
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
        d5_per_angle=float(needle.d5_slope(alpha2)) * angles.inward(1.0),
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
        command="knotter scan",
        summary="Which spatial angles let the knot be tied: rope on the bill, jaw past the disc, jaw on the rope.",
        answer=answer_scan,
        table=scan_table,
        exports={"csv": lambda *asked: scan_csv(answer_scan(*asked)).encode()},
        is_long=lambda request: math.prod(map(len, given_fields(request.grid).values())) > LONG_PAIRS,
    ),
    Query(
        command="knotter limit",
        summary="At which values of one parameter does a condition begin or cease to hold?",
        answer=answer_limit,
        table=limit_table,
        is_long=lambda request: request.samples > LONG_SAMPLES,
    ),
    Query(
        command="knotter needle",
        summary="Where the needle clears the jaw's cam, and the length d5 that lays the rope on the disc.",
        answer=answer_needle,
        table=needle_table,
    ),
    FIT,
    TOLERANCE,
)
