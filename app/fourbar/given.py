"""A linkage that a request brings along: one of a reply's solutions as it came, or changed by hand."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from app.query import Number, RequestModel
from linkage_atlas.motions import MAX_SAMPLES, MIN_POSES

FarLength = Annotated[Number, Field(ge=1e-100, le=1e100)]
Coordinate = Annotated[Number, Field(ge=-1e100, le=1e100)]
Angle = Annotated[Number, Field(ge=-1e9, le=1e9)]


class _ReplyPart(RequestModel):
    """A part of a reply that is sent back: what is not needed is ignored, so that a solution can be sent as it came."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class GivenLinks(_ReplyPart):
    crank: FarLength
    coupler: FarLength
    rocker: FarLength
    ground: FarLength


class GivenCouplerPoint(_ReplyPart):
    radius: Annotated[Number, Field(ge=0, le=1e100)]
    angle: Angle


class GivenMount(_ReplyPart):
    ground_angle: Angle
    pivot_a: Annotated[list[Coordinate], Field(min_length=2, max_length=2)]
    coupler_point: GivenCouplerPoint


class GivenSolution(_ReplyPart):
    """One of the `solutions` of a reply, as it came or changed."""

    links: GivenLinks
    branch: Literal[-1, 1]
    start_angle: Angle
    body_offset: Angle | None = None
    mount: GivenMount | None = None
    crank_angle: Annotated[list[Angle], Field(min_length=MIN_POSES, max_length=MAX_SAMPLES)] | None = None


class GivenGenerator(_ReplyPart):
    """One of the `solutions` of a reply of /v1/function, as it came or changed."""

    links: GivenLinks
    branch: Literal[-1, 1]
    start_angle: Angle
    output_offset: Angle
