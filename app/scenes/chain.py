"""The chain over HTTP and on the command line: requests, replies and their limits, answers, tables and files."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from app.query import (
    Angles,
    AngleUnit,
    Column,
    Computed,
    Count,
    FiniteOrNull,
    Number,
    Query,
    ReplyModel,
    RequestModel,
    Resources,
    reply_model,
)
from app.terminal import DEGREES, Units, table
from linkage_atlas import FieldError, Work
from synthesis.scenes.chain.closure import STRETCH_TOLERANCE, Chain, closing_links
from synthesis.scenes.chain.crescent import (
    LEFT_WHEEL,
    RADIUS_RATIO,
    RIGHT_WHEEL,
    UPPER_ARC,
    Crescent,
    crescent_angles,
    crescent_slot,
    critical_stadium,
    driving_segment,
    free_pin_segment,
    stadium,
)
from synthesis.scenes.chain.fit import ExactSlot, Fit, exact_slot, fit_error, fit_slot, power_basis, power_error
from synthesis.scenes.chain.groove import contours, groove, to_csv, to_dxf, to_svg
from synthesis.scenes.chain.slot import Pins, Slot, SlotReport, analyse_slot, find_slot, pins_at, wheel_conflict
from synthesis.scenes.chain.track import ChordError, Track, arc, line
from synthesis.scenes.chain.wear import (
    ToleranceCorners,
    WornChain,
    tightest_pitch_error,
    tolerance_corners,
    worn_chains,
)
from synthesis.sheet import csv_text

MAX_LINKS = 1000
"""Links of one chain."""
MAX_SAMPLES = 10_001
"""Phases of one reply or export."""
MAX_PINS = 1_000_000
"""Samples times links of one request: every pin of every sample is placed to check its chords."""
MAX_SEGMENTS = 50
"""Segments of one track."""
MIN_LENGTH, MAX_LENGTH = 1e-9, 1e9
"""Range of a length, in the user's own unit."""

Length = Annotated[Number, Field(ge=MIN_LENGTH, le=MAX_LENGTH)]
Coordinate = Annotated[Number, Field(ge=-MAX_LENGTH, le=MAX_LENGTH)]
Point = Annotated[list[Coordinate], Field(min_length=2, max_length=2)]
Links = Annotated[Count, Field(ge=3, le=MAX_LINKS)]
Samples = Annotated[Count, Field(ge=3, le=MAX_SAMPLES)]


class FitRequest(RequestModel):
    """How the slot is represented by few numbers."""

    kind: Literal["chebyshev", "spline", "fourier", "polynomial"] = "chebyshev"
    order: Annotated[Count, Field(ge=1, le=4096)] = Field(
        8,
        description="Chebyshev: degree of each piece (1 to 64). Spline: knots (4 to 4096). Fourier: harmonics "
        "(1 to 256). Polynomial: degree (1 to 100, fewer than the samples).",
    )


class SlotOptions(RequestModel):
    """What every request for a slot may say beside its track."""

    pitch: Length = Field(description="Length of a link, pin to pin.")
    samples: Samples = Field(91, description="Evenly spaced phases of the slot, both ends included.")
    fit: FitRequest | None = Field(FitRequest(), description="null: no fit.")
    power_decimals: Annotated[Count, Field(ge=0, le=15)] | None = Field(
        None, description="Decimals of the fit's coefficients by powers; null: all digits."
    )
    roller_radius: Length | None = Field(None, description="Radius of the rollers that run in the slot.")
    include: Annotated[list[Literal["pins", "outline"]], Field(max_length=2)] = Field(
        [],
        description="pins: every pin and link at every sample, in the reply and as columns of the CSV file. outline: the "
        "closed contours that are cut.",
    )
    angle_unit: AngleUnit = "deg"


class ChainSlotRequest(SlotOptions):
    """The crescent: an upper and a lower arc joined by two wheels."""

    links: Links = Field(description="Number of links.")
    upper_radius: Length = Field(description="R1, radius of the upper arc.")
    wheel_radius: Length | None = Field(None, description="R0; null: pitch/sqrt(2), four pins a turn.")
    lower_radius: Length | None = Field(None, description="R2; null: from the critical closure.")
    eccentricity: Length | None = Field(
        None,
        description="b, height of the lower arc's centre over the upper one's. Only one of lower_radius and "
        "eccentricity given: the other puts the wheels at the height of the upper arc's centre.",
    )
    phase_start: Number | None = Field(
        None, description="Angle theta1 at which the window starts; null: where the chain is least slack."
    )


class StadiumTrack(RequestModel):
    """Two half circles joined by lines."""

    radius: Length
    straight: Length | None = Field(None, description="Distance of the centres; null: from the critical closure.")


class LineSegment(RequestModel):
    """A straight run."""

    kind: Literal["line"]
    start: Point
    end: Point


class ArcSegment(RequestModel):
    """An arc; a positive sweep turns left."""

    kind: Literal["arc"]
    centre: Point
    radius: Length
    start_angle: Number
    sweep: Number


Segments = Annotated[
    list[Annotated[LineSegment | ArcSegment, Field(discriminator="kind")]],
    Field(min_length=1, max_length=MAX_SEGMENTS),
]


class ChainTrackRequest(SlotOptions):
    """Any closed track of tangent arcs and lines."""

    stadium: StadiumTrack | None = None
    segments: Segments | None = Field(None, description="In order of travel, each tangent to the next; or a stadium.")
    links: Links | None = Field(None, description="null: the smallest number that is not stretched.")
    driver_segment: Annotated[Count, Field(ge=0, lt=MAX_SEGMENTS)] | None = Field(
        None, description="Segment along which P1 is moved; null: the first that holds a link."
    )
    free_segment: Annotated[Count, Field(ge=0, lt=MAX_SEGMENTS)] | None = Field(
        None, description="Segment with the slot; null: the tightest arc that holds two links."
    )
    side: Literal["left", "right"] = Field("left", description="Side of a slot on a line; on an arc it is outside.")


class GeometryReply(ReplyModel):
    """The crescent."""

    wheel_radius: float
    upper_radius: float
    lower_radius: float
    eccentricity: float
    xi: float
    alpha: float
    epsilon: float = Field(description="Angle of the wheels' centres over the upper arc's centre.")
    delta_wheel: float = Field(description="Angle of one link on a wheel: the period of theta1.")
    delta_upper: float
    delta_lower: float
    phase_start: float
    tangency_residual: float
    track_length: float


class CrossingReply(ReplyModel):
    """A pin passes from one segment to the next."""

    theta1: float
    pin: int
    to: Literal["left_wheel", "lower_arc", "right_wheel", "upper_arc"]


class LocusReply(ReplyModel):
    """The free pin's path over one period."""

    xy: list[list[float]]
    slack: Column = Field(
        description="Length by which two links from the free pin's neighbour overrun the other neighbour along the bare track."
    )
    free_pin: int
    depth_max: float
    radius_min: FiniteOrNull = Field(description="Smallest curvature radius of the path; null: straight.")
    end_step: float = Field(description="Distance of the slot's ends from the bare track.")


class SlotReply(LocusReply):
    """The slot over one period."""

    theta1: list[float]
    defect_max: float = Field(description="Largest 2 delta_upper - (theta13 - theta15).")
    defect_min: float
    defect_max_theta1: float


class PowerPieceReply(ReplyModel):
    """One piece: x and y are sums of coefficients times powers of t, lowest first, t from 0 to 1 over the piece."""

    theta1: list[float] | None = Field(None, description="At t = 0 and 1; null where t counts x and not the phase.")
    position: list[float] | None = Field(None, description="The same on a track that is no crescent.")
    x: Column
    y: Column


class PowerReply(ReplyModel):
    """The fit by powers, for controls of machine tools; in the drawing's coordinates."""

    pieces: list[PowerPieceReply] | None = Field(
        description="null where powers of this degree lose the fit's digits."
    )
    max_normal: float = Field(
        description="Largest distance from the exact slot, with the coefficients as they are given."
    )
    decimals: int | None


class FitReply(ReplyModel):
    """A representation, and its errors over 9001 phases. Its phases are angles theta1, or P1's way on a track."""

    kind: str
    order: int
    unknowns: int
    condition: float
    max_normal: float
    max_chord: float
    power: PowerReply | None = Field(None, description="Of chebyshev and polynomial.")
    pieces: list[dict[str, Any]] | None = None
    coefficients: dict[str, Any] | None = None
    origin: list[float] | None = None


class WithoutSlotReply(ReplyModel):
    """What happens to a chain whose free pin is held on the bare track."""

    chord_error_max: float
    slack_max: float


class ChecksReply(ReplyModel):
    """What the slot does to chain and roller."""

    stretched: bool = Field(
        description="At some phase the chain lacks more length than rounding can make. Up to 1e-6 of the pitch that counts as "
        "closed; beyond it the layout is refused."
    )
    missing_length: float = Field(description="What it lacks at its worst phase; 0 where it lacks nothing.")
    slack: bool = Field(description="The ends have a step: no phase has the chain exactly on the bare track.")
    chord_error_max: float = Field(description="Over all links and all samples.")
    single_valued: bool = Field(description="The slot is a function y(x) in its own frame.")
    roller_radius_max: FiniteOrNull = Field(description="The path's smallest curvature radius; null: straight.")
    roller_fits: bool | None = Field(description="null: no roller was given.")
    clearance: FiniteOrNull = Field(description="Distance of the path from the segments that it does not replace.")
    condition: FiniteOrNull = Field(description="Change of the free pin per change of a link; null: without bound.")
    free_pin_speed: list[float] = Field(description="Least and largest, per speed of P1.")


class PinsReply(ReplyModel):
    """All pins at each sample, rows of as many as the chain has links."""

    segments: list[str] = Field(description="Names of the track's segments.")
    xy: Computed[list[list[list[float]]]]
    segment: Computed[list[list[int]]] = Field(
        description="Which segment each pin is on, from 0; the free pin hangs beside the first that the slot replaces."
    )
    theta: Computed[list[list[float]] | None] = Field(
        description="theta1 to thetaN: on a wheel from the upper arc over the top, on an arc about its centre from "
        "straight down, right positive. null on a track that is no crescent."
    )
    link_angle: Computed[list[list[float]]] = Field(
        description="Direction of the link from each pin to the next, from x; continuous over the samples."
    )


class OutlineReply(ReplyModel):
    """Closed contours as rows x, y, bulge: tan of a quarter of the turn to the next row's point, left positive."""

    path: Computed[list[list[float]]] = Field(description="Of the pins: track and slot.")
    left: Computed[list[list[float]] | None] = Field(description="Wall of the groove; null without a roller.")
    right: Computed[list[list[float]] | None]


class ClosureReply(ReplyModel):
    """What a reply says of every track."""

    status: Literal["closed", "slack"] = Field(
        description="closed: the chain is taut at some phase, though the slot may end in a step, `end_step`. slack: at none."
    )
    pitch: float
    links: int
    angle_unit: AngleUnit
    fit: FitReply | None
    pins: PinsReply | None = Field(description="null: not asked for in `include`.")
    outline: OutlineReply | None = Field(description="null: not asked for in `include`.")
    without_slot: WithoutSlotReply
    checks: ChecksReply


class ChainSlotReply(ClosureReply):
    """The crescent's slot."""

    geometry: GeometryReply
    events: list[float]
    crossings: list[CrossingReply]
    slot: SlotReply
    wheel_phase_conflict: float


class TrackCrossingReply(ReplyModel):
    """A pin passes onto a segment."""

    position: float
    pin: int
    to_segment: int


class TrackSlotReply(LocusReply):
    """The slot over one period; the phase is the way of P1 along the driving segment."""

    position: list[float]
    slack_max: float
    slack_min: float


class ChainTrackReply(ClosureReply):
    """The slot of a chain on any track."""

    track_length: float
    straight: float | None = Field(description="Of a stadium.")
    driver_segment: int
    free_segment: int
    replaced_segments: list[int]
    position_start: float
    crossings: list[TrackCrossingReply]
    slot: TrackSlotReply


CHECK_PHASES = 9001
"""Phases at which a fit's errors are measured."""
SEGMENT_NAMES = ("left_wheel", "lower_arc", "right_wheel", "upper_arc")
"""Of the crescent, in the order of travel."""
POWER_LOSS = 1e-6
"""Error, in pitches, that the change from a fit to powers may add; beyond it no coefficients are given."""
ROUNDING = 1e-11
"""Missing length, as a share of the track, that rounding alone can make."""
LISTED_PINS = 200_000
"""Pins that one reply lists."""


class PhaseAxis(NamedTuple):
    """How a reply counts the phase: as P1's angle on the left wheel, or as its way along the driving segment."""

    name: str
    unit: float
    """P1's way in one unit of the reply."""


class Shown(NamedTuple):
    """A slot in the words of its request: the phase, the segments' names, which of them is the track's first and has the slot."""

    slot: Slot
    axis: PhaseAxis
    segments: Sequence[str]
    driver: int
    free: int
    crescent: Crescent | None = None

    def pins(self, request: SlotOptions) -> tuple[Pins, Any, Any] | None:
        """All pins at the samples, their angles where the track's parts define any, and their links'; if they are asked for."""
        if "pins" not in request.include:
            return None
        pins, radian = (
            pins_at(self.slot, sample_phases(self.slot, request.samples)),
            Angles(request.angle_unit).radian,
        )
        theta = None if self.crescent is None else crescent_angles(self.crescent, self.slot, pins) / radian
        return pins, theta, pins.link_angle / radian


def sample_phases(slot: Slot, samples: int) -> Any:
    """Evenly spaced phases of the window, both ends included."""
    return np.linspace(slot.start, slot.end, samples)


def _fit(slot: Slot, request: SlotOptions, axis: PhaseAxis) -> FitReply | None:
    if request.power_decimals is not None and getattr(request.fit, "kind", None) not in ("chebyshev", "polynomial"):
        raise FieldError("/power_decimals", "needs a `fit` of kind 'chebyshev' or 'polynomial'")
    if request.fit is None:
        return None
    fit = fit_slot(slot, request.fit.kind, request.fit.order, sample_phases(slot, request.samples))
    exact = exact_slot(slot, sample_phases(slot, CHECK_PHASES))
    error = fit_error(slot, fit, exact)
    power = _power(slot, request, fit, exact, error.normal, axis)
    data = dict(fit.data)
    if fit.kind == "chebyshev":
        for piece in data["pieces"]:
            piece[axis.name] = [bound / axis.unit for bound in piece.pop("phase")]
    else:
        if fit.kind == "polynomial":
            data["angle"] = Angles(request.angle_unit).outward(data["angle"])
        else:
            data["slope"] *= axis.unit
            data[f"{axis.name}_start"], data["period"] = slot.start / axis.unit, slot.chain.period / axis.unit
        if "phase" in data:
            data[axis.name] = [phase / axis.unit for phase in data.pop("phase")]
        data = {"coefficients": data}
    return FitReply(
        kind=fit.kind,
        order=fit.order,
        unknowns=fit.unknowns,
        condition=fit.condition,
        max_normal=error.normal,
        max_chord=error.chord,
        power=power,
        **data,
    )


def _power(
    slot: Slot, request: SlotOptions, fit: Fit, exact: ExactSlot, normal: float, axis: PhaseAxis
) -> PowerReply | None:
    """The fit by powers; no coefficients where the powers have lost the fit's digits."""
    pieces = power_basis(slot, fit)
    if not pieces or request.fit is None:
        return None
    decimals, error = request.power_decimals, power_error(slot, pieces, exact)
    lost = error > 2 * normal + POWER_LOSS * request.pitch
    if decimals is not None:
        pieces = power_basis(slot, fit, decimals)
        error = power_error(slot, pieces, exact)
    rows = [
        PowerPieceReply(
            x=piece.x.tolist(),
            y=piece.y.tolist(),
            **{axis.name: None if piece.phase is None else [bound / axis.unit for bound in piece.phase]},
        )
        for piece in pieces
    ]
    return PowerReply(pieces=None if lost else rows, max_normal=error, decimals=decimals)


def common_parts(shown: Shown, request: SlotOptions, work: Work) -> tuple[SlotReport, dict[str, Any], dict[str, Any]]:
    """The report on a slot, and the fields of reply and locus that do not depend on the kind of track."""
    slot, axis = shown.slot, shown.axis
    phases = sample_phases(slot, request.samples)
    facts, points = analyse_slot(slot, phases, work), slot.path(phases)
    work.go_on()
    slack = facts.slack_min > STRETCH_TOLERANCE * request.pitch
    roller = request.roller_radius
    common = {
        "status": "slack" if slack else "closed",
        "pitch": request.pitch,
        "links": slot.chain.links,
        "angle_unit": request.angle_unit,
        "fit": _fit(slot, request, axis),
        "pins": _pins(shown, request),
        "outline": {"left": None, "right": None, **contours(groove(slot, request.roller_radius))}
        if "outline" in request.include
        else None,
        "without_slot": WithoutSlotReply(
            chord_error_max=facts.held_chord_error, slack_max=max(facts.slack_max.value, 0.0)
        ),
        "checks": ChecksReply(
            stretched=facts.slack_min < -ROUNDING * slot.chain.track.total,
            missing_length=max(-facts.slack_min, 0.0),
            slack=slack,
            chord_error_max=facts.chord_error,
            single_valued=facts.single_valued,
            roller_radius_max=facts.radius_min,
            roller_fits=None if roller is None else roller < facts.radius_min,
            clearance=facts.clearance,
            condition=facts.condition,
            free_pin_speed=list(facts.free_speed),
        ),
    }
    locus = {
        axis.name: (phases / axis.unit).tolist(),
        "slack": slot.slack(phases).tolist(),
        "xy": [[point.real, point.imag] for point in points.tolist()],
        "free_pin": slot.free,
        "depth_max": facts.depth_max.value,
        "radius_min": facts.radius_min,
        "end_step": facts.end_step,
    }
    return facts, common, locus


def _pins(shown: Shown, request: SlotOptions) -> PinsReply | None:
    links = shown.slot.chain.links
    if "pins" in request.include and request.samples * links > LISTED_PINS:
        most = LISTED_PINS // links
        raise FieldError("/samples", f"with {links} links at most {most} samples list all pins")
    found = shown.pins(request)
    if found is None:
        return None
    pins, theta, link_angle = found
    return PinsReply(
        segments=shown.segments,
        xy=[[[point.real, point.imag] for point in row] for row in pins.points.tolist()],
        segment=((pins.segment + shown.driver) % len(shown.segments)).tolist(),
        theta=None if theta is None else theta.tolist(),
        link_angle=link_angle.tolist(),
    )


def _rows(rows: list[tuple[str, str]]) -> str:
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {value}" for name, value in rows)


def _shared_rows(reply: ChainSlotReply | ChainTrackReply, length: str) -> list[tuple[str, str]]:
    checks = reply.checks
    rows = [
        ("largest depth", f"{reply.slot.depth_max:.6f}{length}"),
        ("step at the ends", f"{reply.slot.end_step:.3g}{length}"),
    ]
    radius = "straight" if reply.slot.radius_min is None else f"{reply.slot.radius_min:.6g}{length}"
    rows.append(("smallest curvature radius", radius))
    if checks.roller_fits is not None:
        rows.append(("roller", "fits" if checks.roller_fits else "too large for the slot"))
    rows.append(("slot is a function y(x)", "yes" if checks.single_valued else "no"))
    rows.append(("largest chord error", f"{checks.chord_error_max:.2g}{length}"))
    rows.append(("without the slot", f"chords {reply.without_slot.chord_error_max:.6g}{length} too short"))
    rows.append(("", f"{reply.without_slot.slack_max:.6g}{length} slack"))
    if reply.fit is not None:
        fit = reply.fit
        rows.append((f"{fit.kind} fit, order {fit.order}", f"{fit.unknowns} numbers"))
        rows.append(("", f"normal error {fit.max_normal:.3g}{length}, chord error {fit.max_chord:.3g}{length}"))
    return rows


def table_slot(reply: ChainSlotReply, units: Units = DEGREES) -> str:
    geometry, unit, length = reply.geometry, reply.angle_unit, units.behind(units.length)
    return _rows(
        [
            ("status", reply.status),
            ("links, pitch", f"{reply.links}, {reply.pitch:g}{length}"),
            ("wheel radius R0", f"{geometry.wheel_radius:.6f}{length}"),
            ("upper radius R1", f"{geometry.upper_radius:.6f}{length}"),
            ("lower radius R2", f"{geometry.lower_radius:.6f}{length}"),
            ("eccentricity b", f"{geometry.eccentricity:.6f}{length}"),
            ("xi, alpha", f"{geometry.xi:.6f}, {geometry.alpha:.6f} {unit}"),
            ("window of theta1", f"{geometry.phase_start:.6f} + {geometry.delta_wheel:.6f} {unit}"),
            ("joint crossings", ", ".join(f"{event:.4f}" for event in reply.events) + f" {unit}"),
            ("free pin", f"P{reply.slot.free_pin}"),
            ("closure defect", f"{reply.slot.defect_min:.3g} .. {reply.slot.defect_max:.6f} {unit}"),
            *_shared_rows(reply, length),
            ("wheel phase conflict", f"{reply.wheel_phase_conflict:.6g} {unit}"),
        ]
    )


def table_track(reply: ChainTrackReply, units: Units = DEGREES) -> str:
    length = units.behind(units.length)
    rows = [
        ("status", reply.status),
        ("links, pitch", f"{reply.links}, {reply.pitch:g}{length}"),
        ("track length", f"{reply.track_length:.6f}{length}"),
        ("free pin", f"P{reply.slot.free_pin} on segment {reply.free_segment}"),
        ("slack", f"{reply.slot.slack_min:.3g} .. {reply.slot.slack_max:.6g}{length}"),
        *_shared_rows(reply, length),
    ]
    if reply.straight is not None:
        rows.insert(3, ("straight", f"{reply.straight:.6f}{length}"))
    return _rows(rows)


MAX_ERRORS = 101
"""Pitch errors of one request."""
LARGEST_ERROR = 0.05
"""Largest pitch error and tolerance, in pitches."""

Tolerance = Annotated[Number, Field(ge=0, le=MAX_LENGTH)]


class Tolerances(RequestModel):
    """Half widths of the tolerances, in the request's unit."""

    wheel_radius: Tolerance = Field(0.01, description="Of R0.")
    upper_radius: Tolerance = Field(0.01, description="Of R1.")
    lower_radius: Tolerance = Field(0.01, description="Of R2.")
    eccentricity: Tolerance = Field(0.01, description="Of b.")
    pitch: Tolerance = Field(0.0, description="Of every link alike.")


class ChainToleranceRequest(RequestModel):
    """A crescent whose slot is made for the nominal chain."""

    pitch: Length = Field(131, description="Nominal length of a link, pin to pin.")
    links: Links = Field(16, description="Number of links.")
    upper_radius: Length = Field(181.78, description="R1, radius of the upper arc.")
    wheel_radius: Length | None = Field(None, description="R0; null: pitch/sqrt(2), four pins a turn.")
    lower_radius: Length | None = Field(None, description="R2; null: from the critical closure.")
    eccentricity: Length | None = Field(
        None, description="b; null: from the critical closure, or wheels level with O1."
    )
    pitch_errors: Annotated[list[Number], Field(min_length=1, max_length=MAX_ERRORS)] = Field(
        [-0.1, -0.075, -0.05, -0.025, 0, 0.025, 0.05, 0.075, 0.1],
        description="What wear or manufacture adds to every link; at most 0.05 of the pitch.",
    )
    tolerances: Tolerances = Tolerances()


WornReply, CornersReply = reply_model(WornChain), reply_model(ToleranceCorners)


class ChainToleranceReply(ReplyModel):
    """What becomes of the slack."""

    status: str = Field(description="kept: no corner of the tolerances stretches the chain. stretched: some do.")
    wheel_radius: float
    lower_radius: float
    eccentricity: float
    slack_min: float = Field(description="Of the nominal chain.")
    slack_max: float
    pitch_error_min: float = Field(description="The pitch error at which the chain just begins to be stretched.")
    wear: list[WornReply]
    tolerance: CornersReply


def answer_tolerance(request: ChainToleranceRequest, resources: Resources) -> ChainToleranceReply:
    tolerances = request.tolerances.model_dump()
    largest = LARGEST_ERROR * request.pitch
    for field, values in (
        ("/pitch_errors", request.pitch_errors),
        *((f"/tolerances/{name}", [value]) for name, value in tolerances.items()),
    ):
        if max(map(abs, values)) > largest:
            raise FieldError(field, f"at most {LARGEST_ERROR:g} of the pitch is allowed, that is {largest:.6g}")
    work = resources.work()
    sizes = (request.upper_radius, request.wheel_radius, request.lower_radius, request.eccentricity)
    crescent, slot = crescent_slot(request.pitch, request.links, *sizes, work=work)
    nominal, *found = worn_chains(slot, np.array([0.0, *request.pitch_errors]), work)
    made = tolerance_corners(crescent, slot, tolerances, work)
    return ChainToleranceReply(
        status="stretched" if made.slack_min < -STRETCH_TOLERANCE * request.pitch else "kept",
        wheel_radius=crescent.wheel_radius,
        lower_radius=crescent.lower_radius,
        eccentricity=crescent.eccentricity,
        slack_min=nominal.slack_min,
        slack_max=nominal.slack_max,
        pitch_error_min=tightest_pitch_error(slot, work),
        wear=found,
        tolerance=made,
    )


def wear_columns(reply: ChainToleranceReply) -> dict[str, list[Any]]:
    return {name: [getattr(row, name) for row in reply.wear] for name in WornReply.model_fields}


def _head(name: str, units: Units) -> str:
    """The head of a column; all but what is true or not are lengths."""
    word = name.replace("_", " ")
    return word if name == "stretched" else units.head(word, units.length)


def table_tolerance(reply: ChainToleranceReply, units: Units = DEGREES) -> str:
    columns, length = wear_columns(reply), units.behind(units.length)
    rows = [
        [
            f"{value:+.6g}" if isinstance(value, float) else "-" if value is None else "yes" if value else "no"
            for value in row
        ]
        for row in zip(*columns.values())
    ]
    made = reply.tolerance
    lines = [
        f"layout within its tolerances: {reply.status}",
        f"just stretched at a pitch error of {reply.pitch_error_min:+.6g}{length}",
        table([_head(name, units) for name in columns], rows),
        f"{made.corners} corners: slack {made.slack_min:.6g} .. {made.slack_max:.6g}{length}, by the sensitivities from "
        f"{made.slack_min_linear:.6g}{length}",
        *(f"  least slack per {name.replace('_', ' ')}: {value:+.4f}" for name, value in made.sensitivity.items()),
    ]
    return "\n".join(lines)


TOLERANCE = Query(
    command="chain tolerance",
    summary="What pitch wear and tolerances do to the slack of a crescent's chain and to the play in its slot.",
    answer=answer_tolerance,
    table=table_tolerance,
    exports={"csv": lambda *asked: csv_text(wear_columns(answer_tolerance(*asked))).encode()},
    is_long=lambda request: len(request.pitch_errors) > 20,
)


LONG_SAMPLES = 1000


def _check_size(request: SlotOptions, links: int) -> None:
    if request.samples * links > MAX_PINS:
        most = MAX_PINS // links
        raise FieldError("/samples", f"with {links} links at most {most} samples are computed in one request")


def is_long(request: SlotOptions) -> bool:
    return request.samples > LONG_SAMPLES or (request.fit is not None and request.fit.order > LONG_SAMPLES)


def _crescent(request: ChainSlotRequest, work: Work) -> Shown:
    _check_size(request, request.links)
    angles, start = Angles(request.angle_unit), request.phase_start
    crescent, slot = crescent_slot(
        request.pitch,
        request.links,
        request.upper_radius,
        request.wheel_radius,
        request.lower_radius,
        request.eccentricity,
        None if start is None else angles.inward(start),
        work,
    )
    axis = PhaseAxis("theta1", crescent.wheel_radius * angles.radian)
    return Shown(slot, axis, SEGMENT_NAMES, LEFT_WHEEL, UPPER_ARC, crescent)


def answer_slot(request: ChainSlotRequest, resources: Resources) -> ChainSlotReply:
    work = resources.work()
    shown = _crescent(request, work)
    slot, axis, crescent, angle = shown.slot, shown.axis, shown.crescent, Angles(request.angle_unit).outward
    facts, common, locus = common_parts(shown, request, work)
    wheel, upper, lower = crescent.link_angles(request.pitch)
    theta1 = [crossing.phase / axis.unit for crossing in slot.crossings]
    return ChainSlotReply(
        **common,
        geometry=GeometryReply(
            wheel_radius=crescent.wheel_radius,
            upper_radius=crescent.upper_radius,
            lower_radius=crescent.lower_radius,
            eccentricity=crescent.eccentricity,
            xi=angle(crescent.xi),
            alpha=angle(crescent.alpha),
            epsilon=angle(crescent.eps),
            delta_wheel=angle(wheel),
            delta_upper=angle(upper),
            delta_lower=angle(lower),
            phase_start=slot.start / axis.unit,
            tangency_residual=crescent.tangency_residual,
            track_length=slot.chain.track.total,
        ),
        events=theta1,
        crossings=[
            CrossingReply(theta1=at, pin=crossing.pin, to=SEGMENT_NAMES[crossing.segment])
            for at, crossing in zip(theta1, slot.crossings)
        ],
        slot=SlotReply(
            **locus,
            defect_max=angle(facts.slack_max.value / crescent.upper_radius),
            defect_min=angle(facts.slack_min / crescent.upper_radius),
            defect_max_theta1=facts.slack_max.phase / axis.unit,
        ),
        wheel_phase_conflict=angle(wheel_conflict(slot, RIGHT_WHEEL).value * wheel),
    )


def _track(request: ChainTrackRequest, work: Work) -> Track:
    if (request.stadium is None) == (request.segments is None):
        raise FieldError("/segments", "either 'segments' or 'stadium' is wanted, and not both")
    if request.stadium is not None:
        if request.stadium.straight is not None:
            return stadium(request.stadium.radius, request.stadium.straight)
        if request.links is None:
            raise FieldError("/links", "the critical straight of a stadium needs the number of links")
        return critical_stadium(request.pitch, request.links, request.stadium.radius, work)
    rows, unit = [], Angles(request.angle_unit).radian
    for index, part in enumerate(request.segments or ()):
        if isinstance(part, LineSegment):
            rows.append(line(*part.start, *part.end))
        elif not 0 < abs(part.sweep * unit) <= 2 * pi * (1 + 1e-12):
            raise FieldError(f"/segments/{index}/sweep", "an arc turns by more than 0 and at most once round")
        else:
            rows.append(arc(*part.centre, part.radius, part.start_angle * unit, part.sweep * unit))
    return Track(rows)


def _on_track(request: ChainTrackRequest, work: Work) -> Shown:
    if request.links is not None:
        _check_size(request, request.links)
    track = _track(request, work)
    if track.total > RADIUS_RATIO * request.pitch:
        raise FieldError(
            "/pitch",
            f"the track may be at most {RADIUS_RATIO:.0e} pitches long, found {track.total / request.pitch:.6g}",
        )
    for name in ("driver_segment", "free_segment"):
        chosen = getattr(request, name)
        if chosen is not None and chosen >= track.count:
            raise FieldError(f"/{name}", f"the track has {track.count} segments, numbered from 0; found {chosen}")
    driver = request.driver_segment
    driver = driving_segment(track, request.pitch) if driver is None else driver
    if not track.link_lengths(request.pitch)[driver] <= track.length[driver]:
        raise FieldError("/driver_segment", "the driving segment must be long enough for one link")
    free = request.free_segment
    free = free_pin_segment(track, request.pitch, driver) if free is None else free
    turned = track.starting_at(driver)
    links = request.links
    if links is None:
        try:
            links = closing_links(turned, request.pitch, work)
        except ChordError as error:
            raise FieldError("/pitch", error.message, constraint=error.fault.name.lower()) from None
        if not 3 <= links <= MAX_LINKS:
            raise FieldError("/links", f"{links} links close; between 3 and {MAX_LINKS} are computed")
        _check_size(request, links)
    index = (free - driver) % track.count
    middle = float(turned.joints[index] + 0.5 * turned.length[index])
    side = 1 if request.side == "left" else -1
    slot = find_slot(Chain(turned, request.pitch, links), middle, side, work=work)
    return Shown(slot, PhaseAxis("position", 1.0), [f"segment {k}" for k in range(track.count)], driver, free)


def answer_track(request: ChainTrackRequest, resources: Resources) -> ChainTrackReply:
    work = resources.work()
    shown = _on_track(request, work)
    facts, common, locus = common_parts(shown, request, work)
    slot, driver = shown.slot, shown.driver
    track = slot.chain.track
    straight = None
    if request.stadium is not None:
        straight = max(segment.length for segment in track.segments if segment.curvature == 0)
    return ChainTrackReply(
        **common,
        track_length=track.total,
        straight=straight,
        driver_segment=driver,
        free_segment=shown.free,
        replaced_segments=[(segment + driver) % track.count for segment, _ in slot.base],
        position_start=slot.start,
        crossings=[
            TrackCrossingReply(
                position=crossing.phase, pin=crossing.pin, to_segment=(crossing.segment + driver) % track.count
            )
            for crossing in slot.crossings
        ],
        slot=TrackSlotReply(**locus, slack_max=facts.slack_max.value, slack_min=facts.slack_min),
    )


def _shown(request: Any, resources: Resources) -> Shown:
    found = _crescent if isinstance(request, ChainSlotRequest) else _on_track
    return found(request, resources.work())


def render_csv(request: Any, resources: Resources) -> bytes:
    """The slot, a roller's walls and, if asked for, all pins as a table."""
    shown = _shown(request, resources)
    phases, unit = sample_phases(shown.slot, request.samples), request.angle_unit
    columns, found = {}, shown.pins(request)
    if found is not None:
        pins, theta, link_angle = found
        for pin in range(shown.slot.chain.links):
            columns |= {f"P{pin + 1}_x": pins.points[:, pin].real, f"P{pin + 1}_y": pins.points[:, pin].imag}
            if theta is not None:
                columns[f"theta{pin + 1}_{unit}"] = theta[:, pin]
            columns[f"link{pin + 1}_{unit}"] = link_angle[:, pin]
    name = shown.axis.name if shown.crescent is None else f"theta1_{unit}"
    return to_csv(shown.slot, phases, name, shown.axis.unit, request.roller_radius, columns).encode()


EXPORTS = {
    "csv": render_csv,
    "svg": lambda *asked: to_svg(_shown(*asked).slot, asked[0].roller_radius).encode(),
    "dxf": lambda *asked: to_dxf(_shown(*asked).slot, asked[0].roller_radius).encode(),
}

QUERIES = (
    Query(
        command="chain slot",
        summary="The slot that lets a constant-pitch chain run round a crescent of two arcs and two wheels.",
        answer=answer_slot,
        table=table_slot,
        exports=EXPORTS,
        is_long=is_long,
    ),
    Query(
        command="chain track",
        summary="The slot of a constant-pitch chain on any closed track of tangent arcs and lines.",
        answer=answer_track,
        table=table_track,
        exports=EXPORTS,
        is_long=is_long,
    ),
    TOLERANCE,
)
