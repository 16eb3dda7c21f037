"""The knotter in requests and replies: its dimensions, laws, points and conditions, and the source of every value."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from app.query import Angles, AngleUnit, Number, PositiveNumber, ReplyModel, RequestModel
from app.terminal import Units
from linkage_atlas import FieldError
from synthesis.scenes.knotter import d_knotter
from synthesis.scenes.knotter.conditions import STATUS_SENTENCES, Clearance, ClearanceResult, EntryStatus
from synthesis.scenes.knotter.mechanism import Law, Linear, Mechanism, Table

MAX_LENGTH = 1e9
"""Largest length, and largest angle in either unit; the sum of two larger values loses too many digits in float64."""
MAX_RATIO = 1000
"""Largest ratio of the speed of a body to the speed of the bill."""
MAX_TABLE_ROWS = 1000
"""Largest number of rows in the table of a law."""
ANGLES = ("alpha1", "alpha2", "alpha3")
"""Names of the parameters that are angles; all others are lengths."""
MAX_RANGE_TURNS = 2
"""Largest width of a range, in turns of the bill."""
DECIMALS = 9
"""Decimals to which an angle in degrees is rounded if the rounded value is the same angle in radians."""


def _no_boolean(value: object) -> object:
    if isinstance(value, bool):
        raise ValueError("must be -1 or 1, not true or false")
    return value


Bounded = Annotated[Number, Field(ge=-MAX_LENGTH, le=MAX_LENGTH)]
BoundedPositive = Annotated[PositiveNumber, Field(le=MAX_LENGTH)]
Point3 = Annotated[list[Bounded], Field(min_length=3, max_length=3)]
Range = Annotated[list[Bounded], Field(min_length=2, max_length=2, json_schema_extra={"parts": ["from", "to"]})]
Sense = Annotated[Literal[-1, 1], BeforeValidator(_no_boolean)]
ConditionName = Literal["wrap", "clearance", "bite"]


class Parameters(RequestModel):
    """Dimensions of the machine. The default of each is its published value, or an assumed value if none is published."""

    alpha2: Bounded | None = Field(
        None,
        description="Rotation about j from k1 to the bill's axis k0, after the rotation alpha3 about i; "
        "published: 8 degrees.",
    )
    d1: Bounded | None = Field(
        None,
        description="Distance along k1 from o1 to the point where the disc's axis crosses the plane i1 o1 k1; "
        "assumed: 136.",
    )
    D: Bounded | None = Field(
        None, description="Sum d2 + d4 along the disc's axis; only the sum has an effect; assumed: 20."
    )
    d5: Bounded | None = Field(None, description="Distance from o1 to o2 along i1; published: 54.")
    d6: Bounded | None = Field(None, description="Distance from o1 to o0 along k0; published: 142.")
    d9: Bounded | None = Field(None, description="Hinge of the jaw: distance from o4 to o5 along i4; assumed: 12.")
    d10: Bounded | None = Field(None, description="Hinge of the jaw: distance from o4 to o5 along k4; assumed: 24.5.")


class Senses(RequestModel):
    """Senses of rotation."""

    alpha: Sense | None = Field(None, description="Sense of alpha1 and alpha3; the source prints 1; assumed: -1.")
    beta: Sense | None = Field(None, description="Sense of the disc; assumed: -1.")


class LawModel(RequestModel):
    """Angle of a body as a function of the angle of the bill: give `lead` (and `ratio`), or `table`."""

    lead: Bounded | None = Field(None, description="Angle of the body when the angle of the bill is zero.")
    ratio: Annotated[Number, Field(ge=-MAX_RATIO, le=MAX_RATIO)] | None = Field(
        None, description="Turns per turn of the bill; 0 if only `lead` is given."
    )
    table: Annotated[list[Range], Field(max_length=MAX_TABLE_ROWS)] | None = Field(
        None, description="Rows [angle of the bill, angle of the body]; the angles of the bill increase."
    )
    kind: Literal["linear", "pchip"] = Field("linear", description="Interpolation between the rows of a table.")
    outside: Literal["hold", "error"] | None = Field(
        None,
        description="Behaviour outside the rows of a table. hold: the body rests at the first or last angle (default of "
        "alpha4, because the jaw swings and rests). error: the request is refused (default of beta, because the disc "
        "keeps turning).",
    )


class Laws(RequestModel):
    """Laws of the bodies that follow the bill. The source gives none, so both defaults are assumed."""

    beta: LawModel | None = Field(None, description="Rope-holding disc; assumed: lead 23.5 degrees, ratio 0.5.")
    alpha4: LawModel | None = Field(
        None,
        description="Jaw, from i4 to i5; assumed: from 22.5 degrees to 0 between bill angles 270 and 337 degrees.",
    )


class Points(RequestModel):
    """Points in the frames of their bodies: S0 on the disc (u3); S8 and S10 on the jaw (u5); the others on the bill (u4)."""

    S0: Point3 | None = Field(None, description="Rope in the notch of the disc at disc angle zero; frame u3.")
    S1: Point3 | None = Field(None, description="Point of the bill on which the needle lays the rope; frame u4.")
    S3: Point3 | None = Field(
        None,
        description="First end of the generator of the bill's side on which the rope must wrap; frame u4; published.",
    )
    S4: Point3 | None = Field(None, description="Second end of this generator; frame u4; published.")
    S5: Point3 | None = Field(None, description="Third vertex of the triangle of the wrap; frame u4.")
    S7: Point3 | None = Field(None, description="End of the rope for the bite; frame u4.")
    S8: Point3 | None = Field(
        None, description="First end of the edge that the rope must cross to be bitten; frame u5."
    )
    S9: Point3 | None = Field(None, description="Second end of this edge; frame u4.")
    S10: Point3 | None = Field(
        None, description="Point of the jaw whose clearance from the disc is checked; frame u5."
    )


class Windows(RequestModel):
    """Ranges of the angle of the bill that are searched for an entry."""

    wrap: Range | None = Field(None, description="Range for the wrap; default: 0 to 180 degrees.")
    bite: Range | None = Field(None, description="Range for the bite; default: 270 to 360 degrees.")


class ClearanceOptions(RequestModel):
    """Conditions of the check that the jaw's point S10 passes the disc."""

    bill_angle: Bounded | None = Field(
        None, description="Angle of the bill at which `value` is computed; default: 270 degrees."
    )
    angle_range: Range | None = Field(
        None,
        description="Range of the angle of the bill that is searched for the worst value; default: 240 to 300 degrees. "
        "A range with equal ends gives the single sample of eq 18.",
    )
    disc_radius: BoundedPositive | None = Field(
        None, description="Radius of the disc; default: the disc is an unbounded plane."
    )
    hook: Literal["locked", "moving"] = Field(
        "locked",
        description="locked: the jaw has the angle that it has at `bill_angle` over the whole range. moving: it follows its law.",
    )


class MachineRequest(RequestModel):
    """A knotter. The default of each value is published, or assumed if the source does not give it."""

    parameters: Parameters = Parameters()
    senses: Senses = Senses()
    laws: Laws = Laws()
    points: Points = Points()
    windows: Windows = Windows()
    clearance: ClearanceOptions = ClearanceOptions()
    angle_unit: AngleUnit = "deg"


class EntryReply(ReplyModel):
    """First entry of the rope into its triangle; a value that does not exist for this pair is null."""

    holds: bool
    status: str
    angle: float | None = Field(description="Angle of the bill at the entry.")
    edge: str | None = Field(description="Edge of entry, from its first to its second point.")
    entered_by: Literal["edge", "rope end", "start"] | None = Field(
        description="edge: the rope enters through an edge. rope end: an end of the rope passes through the plane. start: "
        "the rope is already inside at the start of the range."
    )
    point: list[float] | None = Field(description="Crossing at the entry: E1 in u4 (wrap), E2 in u5 (bite).")
    fraction: float | None = Field(description="Position of the point along the edge of entry, from 0 to 1.")
    exit_angle: float | None = Field(
        description="Angle of the bill at which the rope leaves the triangle, or the end of the range."
    )
    windows: int = Field(description="Number of separate windows in the range.")
    margin: float = Field(
        description="Length that is positive if the condition holds: distance from the entry point to the nearer end of the "
        "prescribed edge. If it fails: minus the distance from the entry point to the prescribed edge, or minus the "
        "distance between rope and triangle if they never meet."
    )
    nearest_angle: float | None = Field(
        description="Angle of the bill at the closest approach, if the rope never enters."
    )


class ClearanceReply(ReplyModel):
    """Distance of the jaw's point S10 beyond the plane of the disc; a positive value is interference."""

    holds: bool
    value: float = Field(description="Value at the angle `bill_angle`.")
    worst: float = Field(description="Largest value in the range.")
    worst_angle: float
    margin: float


class Provenance(ReplyModel):
    """Source of each value: a result is only as reliable as the values that it is computed from."""

    assumed: list[str] = Field(
        description="Values that were fitted to reproduce the published pattern; the source does not give them."
    )
    published: list[str]
    from_request: list[str] = Field(description="Values of this request.")
    partly_published: dict[str, str] = Field(description="Assumed values of which a component is published.")
    frames: dict[str, str] = Field(description="Frame of each point.")


def given_fields(model: RequestModel) -> dict[str, Any]:
    """Return the fields of a request that are not null."""
    return {name: value for name in type(model).model_fields if (value := getattr(model, name)) is not None}


def inward(name: str, value: float, angles: Angles) -> float:
    """Return a dimension in model units: radians for an angle, the same value for a length."""
    return angles.inward(value) if name in ANGLES else value


def _law(name: str, model: LawModel, angles: Angles) -> Law:
    field = f"/laws/{name}"
    is_linear = model.lead is not None or model.ratio is not None
    if is_linear == (model.table is not None):
        raise FieldError(field, "give either lead (with or without ratio) or table")
    if model.outside is not None and is_linear:
        raise FieldError(f"{field}/outside", "outside applies only to a table; leave it out or give a table")
    if model.table is None:
        if model.kind != "linear":
            raise FieldError(f"{field}/kind", "a law with lead and ratio is linear; use a table for kind pchip")
        return Linear(angles.inward(model.lead or 0.0), model.ratio or 0.0)
    outside = model.outside or ("hold" if name == "alpha4" else "error")
    columns = (tuple(angles.inward(row[k]) for row in model.table) for k in range(2))
    try:
        return Table(*columns, model.kind, outside)
    except ValueError as error:
        raise FieldError(field, f"the table of the law {name} is invalid: {error}", constraint="law_table") from error


def _range(
    field: str,
    angles_of_bill: list[float] | None,
    default: tuple[float, float],
    angles: Angles,
    may_be_empty: bool = False,
) -> tuple[float, float]:
    """Return the ends of a range of the bill's angle in radians; raise `FieldError` if they are in the wrong order."""
    if angles_of_bill is None:
        return default
    low, high = (angles.inward(angle) for angle in angles_of_bill)
    if not (low <= high if may_be_empty else low < high):
        raise FieldError(field, "the first angle of the range must be smaller than the second")
    if high - low > MAX_RANGE_TURNS * math.tau * (1 + 1e-12):
        raise FieldError(field, f"the range must cover at most {MAX_RANGE_TURNS} turns", constraint="turns")
    return low, high


def machine_of(request: MachineRequest, angles: Angles) -> tuple[Mechanism, dict[str, Any]]:
    """Return the mechanism of a request and its three conditions by name."""
    mechanism = d_knotter.mechanism(
        {name: inward(name, value, angles) for name, value in given_fields(request.parameters).items()},
        given_fields(request.senses),
        {name: _law(name, law, angles) for name, law in given_fields(request.laws).items()},
        {name: tuple(point) for name, point in given_fields(request.points).items()},
    )
    options, windows = request.clearance, request.windows
    conditions = {
        "wrap": d_knotter.wrap(_range("/windows/wrap", windows.wrap, d_knotter.WRAP_WINDOW, angles)),
        "clearance": Clearance(
            d_knotter.CLEARANCE_AT if options.bill_angle is None else angles.inward(options.bill_angle),
            _range("/clearance/angle_range", options.angle_range, d_knotter.CLEARANCE_OVER, angles, True),
            math.inf if options.disc_radius is None else options.disc_radius,
            options.hook == "locked",
        ),
        "bite": d_knotter.bite(_range("/windows/bite", windows.bite, d_knotter.BITE_WINDOW, angles)),
    }
    return mechanism, conditions


def provenance(request: MachineRequest, searched: list[str]) -> dict[str, Any]:
    """Return the fields of `Provenance`, with ``searched`` counted among the values of the request."""
    prescribed = [*given_fields(request.parameters), *given_fields(request.laws), *given_fields(request.points)]
    prescribed += [name for name in searched if name not in prescribed]
    prescribed += [f"senses.{name}" for name in given_fields(request.senses)]
    assumed = [*d_knotter.ASSUMED_PARAMETERS, "beta", "alpha4"]
    assumed += [f"senses.{name}" for name in d_knotter.SENSES]
    assumed += [name for name in d_knotter.POINTS if name not in d_knotter.PUBLISHED_POINTS]
    published = ["alpha1", "alpha2", "alpha3", "d5", "d6", *d_knotter.PUBLISHED_POINTS]
    partly = {
        "S0": "The radius of 30 and the initial angle of 15 degrees are published; the sign of the k coordinate is assumed.",
        "S1": "The coordinates 22 along i and -39 along k are published; the j coordinate is assumed.",
    }
    return {
        "assumed": [name for name in assumed if name not in prescribed],
        "published": [name for name in published if name not in prescribed],
        "from_request": prescribed,
        "partly_published": {name: text for name, text in partly.items() if name not in prescribed},
        "frames": {**d_knotter.POINT_FRAMES, "E1": "u4", "E2": "u5"},
    }


def condition_reply(condition: Any, result: Any, row: int, angles: Angles) -> EntryReply | ClearanceReply:
    """Return the reply to a condition of a row of its results."""
    if isinstance(result, ClearanceResult):
        return ClearanceReply(
            holds=bool(result.holds[row]),
            value=float(result.value[row]),
            worst=float(result.worst[row]),
            worst_angle=angles.outward(float(result.worst_driver[row])),
            margin=float(result.margin[row]),
        )
    enters = result.windows[row] > 0
    entry = int(result.entered_by[row])
    return EntryReply(
        holds=bool(result.holds[row]),
        status=STATUS_SENTENCES[EntryStatus(int(result.status[row]))],
        angle=angles.outward(float(result.enter[row])) if enters else None,
        edge=condition.edge_names[entry - 2] if entry >= 2 else None,
        entered_by=("start" if entry < 0 else "rope end" if entry < 2 else "edge") if enters else None,
        point=[float(x) for x in result.point[row]] if enters else None,
        fraction=float(result.fraction[row]) if entry >= 2 else None,
        exit_angle=angles.outward(float(result.leave[row])) if enters else None,
        windows=int(result.windows[row]),
        margin=float(result.margin[row]),
        nearest_angle=None if enters else angles.outward(float(result.nearest[row])),
    )


def units_note(units: Units, quantities: str = "margins and lengths") -> str:
    """Return the note on the units that ends a table."""
    return f"angles in {units.angle}, {quantities} in {units.length or 'the unit of the lengths'}"
