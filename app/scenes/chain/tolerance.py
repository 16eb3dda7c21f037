"""The question about the slack of a worn chain and of a crescent that is made within tolerances."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import Field

from app.query import Number, Query, ReplyModel, RequestModel, Resources, reply_model
from app.scenes.chain.models import MAX_LENGTH, CrescentDimensions, Length, Links
from app.terminal import DEGREES, Units, table
from linkage_atlas import FieldError
from synthesis.scenes.chain.closure import STRETCH_TOLERANCE
from synthesis.scenes.chain.crescent import crescent_slot
from synthesis.scenes.chain.wear import (
    ToleranceCorners,
    WornChain,
    tightest_pitch_error,
    tolerance_corners,
    worn_chains,
)
from synthesis.sheet import csv_text

MAX_ERRORS = 101
"""Largest number of pitch errors in a request."""
MAX_ERROR = 0.05
"""Largest pitch error and largest tolerance, as fractions of the pitch."""

Tolerance = Annotated[Number, Field(ge=0, le=MAX_LENGTH)]


class Tolerances(RequestModel):
    """Half widths of the tolerances, in the length unit of the request."""

    wheel_radius: Tolerance = Field(0.01, description="Tolerance of R0.")
    upper_radius: Tolerance = Field(0.01, description="Tolerance of R1.")
    lower_radius: Tolerance = Field(0.01, description="Tolerance of R2.")
    eccentricity: Tolerance = Field(0.01, description="Tolerance of b.")
    pitch: Tolerance = Field(0.0, description="Tolerance of the pitch; all links deviate equally.")


class ChainToleranceRequest(CrescentDimensions):
    """A crescent whose slot is cut for the nominal chain."""

    pitch: Length = Field(131, description="Nominal length of a link, pin to pin.")
    links: Links = Field(16, description="Number of links.")
    upper_radius: Length = Field(181.78, description="R1, radius of the upper arc.")
    pitch_errors: Annotated[list[Number], Field(min_length=1, max_length=MAX_ERRORS)] = Field(
        [-0.1, -0.075, -0.05, -0.025, 0, 0.025, 0.05, 0.075, 0.1],
        description="Lengths that wear or manufacture adds to every link; at most 0.05 of the pitch.",
    )
    tolerances: Tolerances = Tolerances()


WornReply, CornersReply = reply_model(WornChain), reply_model(ToleranceCorners)


class ChainToleranceReply(ReplyModel):
    """Slack of the nominal chain, of worn chains, and at the corners of the tolerances."""

    status: str = Field(
        description="kept: the chain is not stretched at any corner of the tolerances. stretched: it is stretched at a corner."
    )
    wheel_radius: float
    lower_radius: float
    eccentricity: float
    slack_min: float = Field(description="Smallest slack of the nominal chain.")
    slack_max: float = Field(description="Largest slack of the nominal chain.")
    pitch_error_min: float = Field(description="Pitch error at which the chain begins to be stretched.")
    wear: list[WornReply]
    tolerance: CornersReply


def answer_tolerance(request: ChainToleranceRequest, resources: Resources) -> ChainToleranceReply:
    """Compute the slack of worn chains and at the corners of the tolerances of a crescent."""
    tolerances = request.tolerances.model_dump()
    largest = MAX_ERROR * request.pitch
    for field, values in (
        ("/pitch_errors", request.pitch_errors),
        *((f"/tolerances/{name}", [value]) for name, value in tolerances.items()),
    ):
        if max(map(abs, values)) > largest:
            raise FieldError(field, f"must be at most {MAX_ERROR:g} of the pitch, {largest:.6g}")
    work = resources.work()
    sizes = (request.upper_radius, request.wheel_radius, request.lower_radius, request.eccentricity)
    crescent, slot = crescent_slot(request.pitch, request.links, *sizes, work=work)
    nominal, *worn = worn_chains(slot, np.array([0.0, *request.pitch_errors]), work)
    corners = tolerance_corners(crescent, slot, tolerances, work)
    return ChainToleranceReply(
        status="stretched" if corners.slack_min < -STRETCH_TOLERANCE * request.pitch else "kept",
        wheel_radius=crescent.wheel_radius,
        lower_radius=crescent.lower_radius,
        eccentricity=crescent.eccentricity,
        slack_min=nominal.slack_min,
        slack_max=nominal.slack_max,
        pitch_error_min=tightest_pitch_error(slot, work),
        wear=worn,
        tolerance=corners,
    )


def wear_columns(reply: ChainToleranceReply) -> dict[str, list[Any]]:
    """Return the columns of the table of worn chains."""
    return {name: [getattr(row, name) for row in reply.wear] for name in WornReply.model_fields}


def _head(name: str, units: Units) -> str:
    """Return the heading of a column; all columns except ``stretched`` are lengths."""
    word = name.replace("_", " ")
    return word if name == "stretched" else units.head(word, units.length)


def table_tolerance(reply: ChainToleranceReply, units: Units = DEGREES) -> str:
    """Return a row for each pitch error, and the slack at the corners of the tolerances."""
    columns, length = wear_columns(reply), units.behind(units.length)
    rows = [
        [
            f"{value:+.6g}" if isinstance(value, float) else "-" if value is None else "yes" if value else "no"
            for value in row
        ]
        for row in zip(*columns.values())
    ]
    corners = reply.tolerance
    lines = [
        f"layout within its tolerances: {reply.status}",
        f"the chain begins to be stretched at a pitch error of {reply.pitch_error_min:+.6g}{length}",
        table([_head(name, units) for name in columns], rows),
        f"{corners.corners} corners: slack {corners.slack_min:.6g} .. {corners.slack_max:.6g}{length}; "
        f"smallest slack predicted by the sensitivities {corners.slack_min_linear:.6g}{length}",
        *(
            f"  change of the smallest slack per {name.replace('_', ' ')}: {value:+.4f}"
            for name, value in corners.sensitivity.items()
        ),
    ]
    return "\n".join(lines)


TOLERANCE = Query(
    command="chain tolerance",
    summary="Compute the effect of pitch wear and tolerances on the slack of a chain round a crescent and on its play.",
    answer=answer_tolerance,
    table=table_tolerance,
    exports={"csv": lambda request, resources: csv_text(wear_columns(answer_tolerance(request, resources))).encode()},
    is_long=lambda request: len(request.pitch_errors) > 20,
)
