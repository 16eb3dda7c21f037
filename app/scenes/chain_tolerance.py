"""Pitch wear and tolerances of a crescent's chain, over HTTP and on the command line."""

from __future__ import annotations

from math import isfinite
from typing import Annotated, Any

from pydantic import Field

from app.query import Export, Number, Query, ReplyModel, RequestModel, Resources
from app.scenes.chain_models import MAX_LENGTH, Length, Links
from app.tables import DEGREES, Units, table
from linkage_atlas import FieldError
from synthesis.sheet import csv_text

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


class WornReply(ReplyModel):
    """A chain of one pitch error on the track and in the slot that were made for the nominal one."""

    pitch_error: float
    slack_min: float = Field(description="Least slack over the phase; negative: length that is missing.")
    slack_max: float
    stretched: bool
    depth_max: float | None = Field(
        description="How far a taut chain lifts its free pin off the bare track; null: stretched."
    )
    beyond_slot: float | None = Field(
        description="How far past the slot that is, at most: the chain is loose by it, or needs a slot that much deeper."
    )


class CornersReply(ReplyModel):
    """The layouts at all corners of the tolerances."""

    sensitivity: dict[str, float] = Field(description="Change of the least slack per change of each length.")
    slack_min: float = Field(description="The least over all corners; negative: some such layouts stretch the chain.")
    slack_max: float
    slack_min_linear: float = Field(description="The same by the sensitivities alone.")
    corners: int


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
    """Pitch wear, and the corners of the tolerances."""
    import numpy as np

    from synthesis.chain.closure import STRETCH_TOLERANCE
    from synthesis.chain.crescent import crescent_slot
    from synthesis.chain.wear import made_within, tightest_pitch_error, worn

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
    nominal, *found = worn(slot, np.array([0.0, *request.pitch_errors]), work)
    made = made_within(crescent, slot, tolerances, work)
    return ChainToleranceReply(
        status="stretched" if made.slack_min < -STRETCH_TOLERANCE * request.pitch else "kept",
        wheel_radius=crescent.wheel_radius,
        lower_radius=crescent.lower_radius,
        eccentricity=crescent.eccentricity,
        slack_min=nominal.slack_min,
        slack_max=nominal.slack_max,
        pitch_error_min=tightest_pitch_error(slot, work),
        wear=[
            WornReply(**{name: value if isfinite(value) else None for name, value in row._asdict().items()})
            for row in found
        ],
        tolerance=CornersReply(
            sensitivity=made.sensitivity,
            slack_min=made.slack_min,
            slack_max=made.slack_max,
            slack_min_linear=made.linear,
            corners=made.corners,
        ),
    )


def wear_columns(reply: ChainToleranceReply) -> dict[str, list[Any]]:
    """The pitch errors as columns."""
    return {name: [getattr(row, name) for row in reply.wear] for name in WornReply.model_fields}


def _head(name: str, units: Units) -> str:
    """The head of a column; all but what is true or not are lengths."""
    word = name.replace("_", " ")
    return word if name == "stretched" else units.head(word, units.length)


def table_tolerance(reply: ChainToleranceReply, units: Units = DEGREES) -> str:
    """Wear and tolerances as text."""
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
    path="/v1/chain/tolerance",
    command="chain tolerance",
    summary="What pitch wear and tolerances do to the slack of a crescent's chain and to the play in its slot.",
    request=ChainToleranceRequest,
    reply=ChainToleranceReply,
    answer=answer_tolerance,
    table=table_tolerance,
    shows_units=True,
    examples={
        "published": {"pitch": 131, "links": 16, "upper_radius": 181.78},
        "with_reserve": {
            "pitch": 131,
            "links": 16,
            "upper_radius": 181.78,
            "lower_radius": 381.6,
            "tolerances": {
                "wheel_radius": 0.005,
                "upper_radius": 0.005,
                "lower_radius": 0.005,
                "eccentricity": 0.005,
            },
        },
    },
    exports={
        "csv": Export(
            "text/csv; charset=utf-8", lambda *asked: csv_text(wear_columns(answer_tolerance(*asked))).encode()
        )
    },
    is_long=lambda request: len(request.pitch_errors) > 20,
)
