"""Requests and replies of what a designer asks of a linkage next: its analysis, and its tolerance study."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from app.query import Count, Number, ReplyModel, RequestModel
from linkage_atlas.motions import MAX_LENGTH
from linkage_atlas.studies import FEWEST_SAMPLES, LARGEST, MOST_SAMPLES, SAMPLES

Size = Annotated[Number, Field(ge=0, le=MAX_LENGTH)]
Bounded = Annotated[Number, Field(ge=-LARGEST, le=LARGEST)]
Pair = Annotated[list[Bounded], Field(min_length=2, max_length=2)]
Vector = tuple[float, float] | None
Values = list[float | None]


class LoadRequest(RequestModel):
    """What acts on the body, in directions that do not turn with it."""

    force: Pair | None = Field(None, description="[fx, fy] at the body point.")
    torque: Bounded = Field(0.0, description="Counter-clockwise: force times length.")


class AnalysisRequest(RequestModel):
    """How fast the crank turns, and what the body carries."""

    crank_speed: Bounded = Field(
        description="Constant, in the unit of angle a second, counter-clockwise: negative for a clockwise motion."
    )
    load: LoadRequest | None = Field(None, description="With it: crank torque and pin forces.")


class ToleranceStudyRequest(RequestModel):
    """Tolerances of manufacture, in the unit of the positions."""

    links: Size = Field(0.0, description="Each length lies evenly within this of its nominal value, either way.")
    pivots: Size = Field(0.0, description="So does each coordinate of a fixed pivot.")
    clearance: Size = Field(0.0, description="Diameter of a hole less that of its pin, in all four joints.")
    samples: Annotated[Count, Field(ge=FEWEST_SAMPLES, le=MOST_SAMPLES)] = Field(
        SAMPLES, description="How many linkages are made by chance."
    )
    seed: Annotated[Count, Field(ge=0, le=2**32 - 1)] = Field(
        0, description="Which: the same seed makes the same ones."
    )


class OfLinksReply(ReplyModel):
    coupler: Values
    rocker: Values


class PinForcesReply(ReplyModel):
    pivot_a: list[Vector] = Field(description="By the ground on the crank.")
    crank_pin: list[Vector] = Field(description="By the crank on the coupler.")
    coupler_pin: list[Vector] = Field(description="By the rocker on the coupler.")
    pivot_b: list[Vector] = Field(description="By the ground on the rocker.")


class RatesReply(ReplyModel):
    """A value a crank angle; null at a dead position, where coupler and rocker lie on a line and no finite value holds."""

    crank_angle: list[float] = Field(description="From the first sample on.")
    velocity: list[Vector] | None = Field(description="Of the body point; null without positions.")
    acceleration: list[Vector] | None = Field(description="Of the body point; null without positions.")
    angular_velocity: OfLinksReply
    angular_acceleration: OfLinksReply
    transmission_angle: Values
    crank_torque: Values | None = Field(
        description="Of the drive on the crank, counter-clockwise; links without mass, no friction. Null without a load."
    )
    pin_forces: PinForcesReply | None = Field(description="Null without a load.")


class AnalysisReply(RatesReply):
    crank_speed: float
    curve: RatesReply = Field(description="The same over the used interval in steps of at most a degree.")


class QuantilesReply(ReplyModel):
    """5, 50 and 95 % of the linkages made are at most so far off; null where too many of them do not close."""

    p5: Values
    p50: Values
    p95: Values


class WorstReply(ReplyModel):
    p5: float | None
    p50: float | None
    p95: float | None


class MadeReply(QuantilesReply):
    linear: QuantilesReply = Field(
        description="To first order, for normally distributed deviations; null at a dead position."
    )
    worst: WorstReply = Field(description="Of each linkage's largest error over the samples.")


class ContributionReply(ReplyModel):
    source: str
    position: float | None = Field(description="Its part, 0 to 1, in the variance of the position to first order.")
    rotation: float = Field(description="Its part in the variance of the rotation.")


class LargestReply(ReplyModel):
    position: str | None
    rotation: str | None


class BandReply(ReplyModel):
    crank_angle: list[float]
    position: QuantilesReply | None
    rotation: QuantilesReply


class ToleranceStudyReply(ReplyModel):
    samples: int = Field(description="Linkages that were simulated.")
    seed: int
    open_share: float = Field(description="The part of them that does not close at every sample.")
    position: MadeReply | None = Field(description="Distance of the body point from where it is as designed.")
    rotation: MadeReply = Field(description="Absolute difference of the rotation from that as designed.")
    largest: LargestReply = Field(description="The source that contributes most; null where nothing does.")
    contributions: list[ContributionReply]
    band: BandReply = Field(description="The quantiles over the used interval in even steps, to be drawn.")
