"""Requests and replies of the question about the slot of a chain."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from app.query import AngleUnit, Column, Computed, Count, Number, ReplyModel, RequestModel

MAX_LINKS = 1000
"""Largest number of links of a chain."""
MAX_SAMPLES = 10_001
"""Largest number of phases in a reply or export."""
MAX_PINS = 200_000
"""Largest number of samples times links in a request; every pin is computed at every sample to check the chords."""
MIN_LENGTH = 1e-9
"""Smallest length, in the unit of the request."""
MAX_LENGTH = 1e9
"""Largest length, in the unit of the request."""

Length = Annotated[Number, Field(ge=MIN_LENGTH, le=MAX_LENGTH)]
Rows = Computed[list[list[float]]]
Segment = Literal["left_wheel", "lower_arc", "right_wheel", "upper_arc"]


class ChainSlotRequest(RequestModel):
    """A chain on a crescent: an upper and a lower arc joined by two wheels. Missing dimensions are computed."""

    pitch: Length = Field(description="Length of a link, pin to pin.")
    links: Annotated[Count, Field(ge=3, le=MAX_LINKS)] = Field(description="Number of links.")
    upper_radius: Length = Field(description="R1, radius of the upper arc.")
    wheel_radius: Length | None = Field(
        None, description="R0, radius of the wheels; null: pitch/sqrt(2), four pins per turn."
    )
    lower_radius: Length | None = Field(
        None, description="R2, radius of the lower arc; null: computed from the critical closure."
    )
    eccentricity: Length | None = Field(
        None,
        description="b, height of the lower arc's centre above the upper arc's centre. If the request has only one of "
        "lower_radius and eccentricity, the missing value places the wheels level with the upper arc's centre.",
    )
    phase_start: Number | None = Field(
        None, description="Angle theta1 at which the window starts; null: the angle with the smallest slack."
    )
    samples: Annotated[Count, Field(ge=3, le=MAX_SAMPLES)] = Field(
        91, description="Number of evenly spaced phases of the slot, both ends included."
    )
    roller_radius: Length | None = Field(None, description="Radius of the rollers that run in the slot.")
    include: Annotated[list[Literal["pins", "outline"]], Field(max_length=2)] = Field(
        [],
        description="pins: all pins at every sample, in the reply and as columns of the CSV file. outline: the closed "
        "contours to cut.",
    )
    angle_unit: AngleUnit = "deg"


class GeometryReply(ReplyModel):
    """Dimensions of the crescent."""

    wheel_radius: float
    upper_radius: float
    lower_radius: float
    eccentricity: float
    xi: float
    alpha: float
    epsilon: float = Field(description="Elevation of the wheels' centres, seen from the upper arc's centre.")
    delta_wheel: float = Field(description="Angle of a link on a wheel; the period of theta1.")
    delta_upper: float
    delta_lower: float
    phase_start: float
    tangency_residual: float
    track_length: float


class CrossingReply(ReplyModel):
    """Passage of a pin from one segment to the next."""

    theta1: float
    pin: int
    to: Segment


class SlotReply(ReplyModel):
    """Path of the free pin over one period."""

    theta1: list[float]
    xy: list[list[float]]
    slack: Column = Field(
        description="Slack: length by which two links, laid along the bare track from one neighbour of the free pin, extend "
        "past its other neighbour."
    )
    free_pin: int
    depth_max: float
    radius_min: float = Field(description="Smallest radius of curvature of the path, which limits the roller.")
    end_step: float = Field(description="Distance of the ends of the slot from the bare track.")
    slack_max: float = Field(description="Largest slack: the loose length of a chain without a slot.")
    defect_max: float = Field(description="Largest 2 delta_upper - (theta13 - theta15).")
    defect_min: float
    defect_max_theta1: float


class ChecksReply(ReplyModel):
    """Checks of chain, slot and roller."""

    missing_length: float = Field(
        description="Length that the chain lacks at its worst phase; 0 if it lacks none. Up to 1e-6 of the pitch, the chain "
        "counts as closed; a layout that lacks more length is refused."
    )
    chord_error_max: float = Field(description="Largest chord error of all links at all samples.")
    roller_fits: bool | None = Field(description="True if the roller fits into the slot; null without a roller.")
    clearance: float = Field(description="Distance from the path to the wheels and the lower arc.")


class PinsReply(ReplyModel):
    """Positions of all pins; a row for each sample with an entry for each pin."""

    segments: list[str] = Field(description="Names of the segments of the track.")
    xy: Computed[list[list[list[float]]]]
    segment: Computed[list[list[int]]] = Field(
        description="Index of the segment of each pin, from 0; for the free pin, the index of the upper arc."
    )
    theta: Rows = Field(
        description="Angles theta1 to thetaN. On a wheel they count from the upper arc over the top; on an arc they count "
        "about its centre from straight down, positive to the right."
    )


class OutlineReply(ReplyModel):
    """Closed contours as rows x, y, bulge; the bulge is tan(sweep / 4) of the arc to the next point, positive to the left."""

    path: Rows = Field(description="Path of the pins: track and slot.")
    left: Rows | None = Field(None, description="Left wall of the groove; null without a roller.")
    right: Rows | None = Field(None, description="Right wall of the groove; null without a roller.")


class ChainSlotReply(ReplyModel):
    """Slot of a chain on a crescent."""

    status: Literal["closed", "slack"] = Field(
        description="closed: the chain is taut at some phase; the slot may still end in a step, see `end_step`. slack: the "
        "chain is not taut at any phase."
    )
    pitch: float
    links: int
    angle_unit: AngleUnit
    geometry: GeometryReply
    crossings: list[CrossingReply]
    slot: SlotReply
    pins: PinsReply | None = Field(description="null unless `include` contains pins.")
    outline: OutlineReply | None = Field(description="null unless `include` contains outline.")
    checks: ChecksReply
    wheel_phase_conflict: float
