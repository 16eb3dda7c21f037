"""Parts of a reply that a client sends back in a request: linkages and drives."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field

import linkage_atlas as la
from app.fourbar.fields import Angle, FarCoordinate, FarLength, FarPoint
from app.query import Flag, Number, RequestModel
from linkage_atlas.arguments import pointing
from linkage_atlas.geometry import DriverName
from linkage_atlas.motions import MAX_SAMPLES, MIN_POSES


class _ReplyPart(RequestModel):
    """Part of a reply that a client sends back; unknown fields are ignored, so that a solution can be sent unchanged."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class GivenLinks(_ReplyPart):
    """Link lengths of a four-bar."""

    crank: FarLength
    coupler: FarLength
    rocker: FarLength
    ground: FarLength


class GivenCouplerPoint(_ReplyPart):
    """Coupler point in polar coordinates on the coupler."""

    radius: Annotated[Number, Field(ge=0, le=1e100)]
    angle: Angle


class GivenMount(_ReplyPart):
    """Mounting of a four-bar."""

    ground_angle: Angle
    pivot_a: FarPoint
    coupler_point_polar: GivenCouplerPoint


class GivenJoints(_ReplyPart):
    """Joints of a four-bar at its first sample: pivots A and B, crank pin D, coupler pin C, and optionally the body point P."""

    A: FarPoint
    D: FarPoint
    C: FarPoint
    B: FarPoint
    P: FarPoint | None = None
    rotation: Angle = Field(default=0.0)
    """Rotation of the body in this position."""


class GivenGuide(_ReplyPart):
    """A guide of a solution with rails or slots; the fields that its kind requires are checked when it is used."""

    guide: Literal["circle", "rail", "slot"]
    body_point: FarPoint
    pivot: FarPoint | None = None
    radius: FarLength | None = None
    point: FarPoint | None = None
    direction: Angle | None = None
    pin: FarPoint | None = None
    body_direction: Angle | None = None


class GivenSizes(_ReplyPart):
    """Lengths of the links of a motor dyad."""

    crank: FarLength | None = None
    coupler: FarLength | None = None


class GivenDrive(_ReplyPart):
    """A drive of a reply, unchanged or edited."""

    kind: Literal["rotary", "actuator", "dyad"]
    link: Annotated[str, Field(max_length=40)]
    base_link: Annotated[str, Field(max_length=40)] | None = None
    ground_point: FarPoint | None = None
    motor: FarPoint | None = None
    pin_on_link: FarPoint | None = None
    pin: FarPoint | None = None
    retracted: FarLength | None = None
    stroke: FarLength | None = None
    extends: Flag | None = None
    six_bar: GivenSizes | None = None


class GivenLinkage(_ReplyPart):
    """A solution of a reply or a linkage in the same form: a four-bar has `links` or `joints`, others `guides` and `driver`."""

    joints: GivenJoints | None = None
    links: GivenLinks | None = None
    branch: Literal[-1, 1] | None = None
    start_angle: Angle | None = None
    body_offset: Angle | None = None
    mount: GivenMount | None = None
    driver: DriverName | None = None
    guides: Annotated[list[GivenGuide], Field(min_length=2, max_length=2)] | None = None
    start: FarCoordinate | None = None
    crank_angle: Annotated[list[Angle], Field(min_length=MIN_POSES, max_length=MAX_SAMPLES)] | None = None
    travel: Annotated[list[FarCoordinate], Field(min_length=MIN_POSES, max_length=MAX_SAMPLES)] | None = None
    drives: Annotated[list[GivenDrive], Field(max_length=400)] | None = None

    def linkage(self, degrees: bool) -> la.Linkage:
        """Return the linkage; raise `FieldError` with the path of a missing field in a body with the field ``linkage``."""
        with pointing(lambda field: "/linkage" + field):
            return la.Linkage.from_dict(self.model_dump(exclude_none=True), degrees)


class GivenGenerator(GivenLinkage):
    """A solution of a reply of /v2/function, or a linkage in the same form."""

    output_offset: FarCoordinate | None = None


class GivenMaker(GivenLinkage):
    """A solution of a reply of /v2/function: a four-bar with `links`, or a linkage with a slider and `guides`."""

    output_offset: FarCoordinate
