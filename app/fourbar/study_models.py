"""Requests of what a designer asks of a linkage next: its analysis, and its tolerance study."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from app.query import Count, Number, RequestModel
from linkage_atlas.motions import MAX_LENGTH
from linkage_atlas.studies import FEWEST_SAMPLES, LARGEST, MOST_SAMPLES, SAMPLES

Size = Annotated[Number, Field(ge=0, le=MAX_LENGTH)]
Bounded = Annotated[Number, Field(ge=-LARGEST, le=LARGEST)]
Pair = Annotated[list[Bounded], Field(min_length=2, max_length=2)]


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
