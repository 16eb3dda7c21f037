"""Bodies of the knotter's requests and replies, with their limits."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from app.query import AngleUnit, Count, Number, PositiveNumber, ReplyModel, RequestModel

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
Range = Annotated[list[Bounded], Field(min_length=2, max_length=2)]
GridValues = Annotated[list[Bounded], Field(min_length=1, max_length=MAX_GRID_VALUES)]
Sense = Annotated[Literal[-1, 1], BeforeValidator(_no_boolean)]
ConditionName = Literal["wrap", "clearance", "bite"]
ParameterName = Literal["alpha1", "alpha2", "alpha3", "d1", "D", "d5", "d6", "d9", "d10"]
ANGLES = ("alpha1", "alpha2", "alpha3")


class Parameters(RequestModel):
    """Sizes of the machine; each has the published value or else an assumed one."""

    alpha2: Bounded | None = Field(
        None, description="Angle between the bill's axis k0 and k1 in the plane i1 o1 k1; published 8 degrees."
    )
    d1: Bounded | None = Field(
        None, description="Along k1, from o1 to where the disc's axis crosses the plane i1 o1 k1; assumed 136."
    )
    D: Bounded | None = Field(None, description="d2 + d4 along the disc's axis, only the sum matters; assumed 20.")
    d5: Bounded | None = Field(None, description="Between o1 and o2 along i1; published 54.")
    d6: Bounded | None = Field(None, description="From o1 to the plane i0 o0 k0; published 142.")
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
    d6: Bounded = Field(142.0, description="From o1 to the plane i0 o0 k0.")
    r1: Annotated[Number, Field(ge=0, le=MAX_LENGTH)] = Field(
        30.0, description="Radius of the holding point S0 about the disc's axis."
    )
    beta0: Bounded | None = Field(None, description="Initial phase of the disc; 15 degrees.")
    alpha2: Bounded | None = Field(
        None, description="Angle between the bill's axis k0 and k1 in the plane i1 o1 k1; 8 degrees."
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
