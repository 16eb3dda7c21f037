"""Bodies of the chain's requests and replies, with their limits."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from app.query import AngleUnit, Column, Computed, Count, Number, ReplyModel, RequestModel

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
    radius_min: float | None = Field(description="Smallest curvature radius of the path; null: straight.")
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
    roller_radius_max: float | None = Field(description="The path's smallest curvature radius; null: straight.")
    roller_fits: bool | None = Field(description="null: no roller was given.")
    clearance: float | None = Field(description="Distance of the path from the segments that it does not replace.")
    condition: float | None = Field(description="Change of the free pin per change of a link; null: without bound.")
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
        description="closed: the slot's ends lie on the track. slack: they have a step."
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
