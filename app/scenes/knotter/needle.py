"""The question about the needle: its clearance from the cam of the jaw, and the length that lays the rope on the disc."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from app.query import Angles, AngleUnit, Number, Query, ReplyModel, RequestModel, Resources
from app.scenes.knotter.machine import DECIMALS, MAX_LENGTH, Bounded, BoundedPositive, units_note
from app.terminal import DEGREES, Units
from linkage_atlas import FieldError
from synthesis.scenes.knotter import d_knotter
from synthesis.scenes.knotter.d_knotter import Needle


class NeedleRequest(RequestModel):
    """The needle and the cam of the jaw; every default is published."""

    S1x: Bounded = Field(
        22.0, description="Point at which the needle lays the rope: distance from the bill's axis along i4."
    )
    S1y: Bounded = Field(39.0, description="Point at which the needle lays the rope: distance from o4 along k4.")
    r0: BoundedPositive = Field(16.0, description="Largest radius of the jaw's cam.")
    D0: BoundedPositive = Field(20.0, description="Thickness of the needle.")
    d6: Bounded = Field(142.0, description="Distance from o1 to o0 along k0.")
    r1: Annotated[Number, Field(ge=0, le=MAX_LENGTH)] = Field(
        30.0, description="Distance of the holding point S0 from the disc's axis."
    )
    beta0: Bounded | None = Field(None, description="Initial phase of the disc; default: 15 degrees.")
    alpha2: Bounded | None = Field(
        None,
        description="Rotation about j from k1 to the bill's axis k0, after the rotation alpha3 about i; "
        "default: 8 degrees.",
    )
    d5: Bounded = Field(54.0, description="Distance from o1 to o2 along i1 for which alpha2 is computed.")
    angle_unit: AngleUnit = "deg"


class NeedleReply(ReplyModel):
    """Equations 4 and 5 at the angle alpha2, and their inverses."""

    status: Literal["free", "blocked"]
    clearance: float = Field(
        description="L of eq 4 at alpha2: smallest distance between the needle and the jaw's cam; must be positive."
    )
    alpha2_range: list[float] | None = Field(description="Ends of the range of alpha2 with positive clearance.")
    alpha2_whole_degrees: int | None = Field(description="Smallest whole number of degrees in this range.")
    clearance_max: float
    clearance_max_angle: float
    d5: float = Field(description="Length d5 that satisfies eq 5 at alpha2.")
    d5_whole: int = Field(description="This length truncated to an integer, as the source prints it.")
    alpha2_for_d5: float | None = Field(
        description="Angle nearest to alpha2 at which eq 5 gives the d5 of the request."
    )


def answer_needle(request: NeedleRequest, _: Resources) -> NeedleReply:
    """Compute the clearance and the length d5 at the angle alpha2, the range of free angles, and the angles for a given d5.

    Without ``alpha2`` and ``beta0`` the published angles are used.
    """
    angles = Angles(request.angle_unit, DECIMALS)
    alpha2 = d_knotter.ALPHA2 if request.alpha2 is None else angles.inward(request.alpha2)
    if not abs(alpha2) < math.radians(90.0):
        raise FieldError("/alpha2", "must be between -90 and 90 degrees", constraint="range")
    needle = Needle(
        **{name: getattr(request, name) for name in ("S1x", "S1y", "r0", "D0", "d6", "r1")},
        beta0=d_knotter.BETA0 if request.beta0 is None else angles.inward(request.beta0),
    )
    clearance, d5, best_angle = float(needle.clearance(alpha2)), float(needle.d5(alpha2)), needle.best_angle()
    free_range = needle.free_range()
    nearest = min(needle.angles_for_d5(request.d5), key=lambda angle: abs(angle - alpha2), default=None)
    return NeedleReply(
        status="free" if clearance > 0 else "blocked",
        clearance=clearance,
        alpha2_range=None if free_range is None else [angles.outward(angle) for angle in free_range],
        alpha2_whole_degrees=needle.smallest_whole_degree(),
        clearance_max=float(needle.clearance(best_angle)),
        clearance_max_angle=angles.outward(best_angle),
        d5=d5,
        d5_whole=math.trunc(d5),
        alpha2_for_d5=None if nearest is None else angles.outward(nearest),
    )


def needle_table(reply: NeedleReply, units: Units = DEGREES) -> str:
    """Return a line for each field of the reply."""
    rows = reply.model_dump()
    return "\n".join([*(f"{name:<22}{value}" for name, value in rows.items()), units_note(units, "lengths")])


NEEDLE = Query(
    command="knotter needle",
    summary="Compute where the needle clears the jaw's cam, and the length d5 that lays the rope on the disc.",
    answer=answer_needle,
    table=needle_table,
)
