"""The question about a knotter that is made within tolerances."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Any, Literal

from pydantic import Field

from app.query import Angles, Count, Query, Resources, reply_model
from app.scenes.knotter.machine import (
    DECIMALS,
    BoundedPositive,
    PairRequest,
    Provenance,
    pair_of,
    provenance,
    unit_of,
)
from app.terminal import DEGREES, Units, table
from synthesis.scenes.knotter.mechanism import ANGULAR_DIMENSIONS, dimensions
from synthesis.scenes.knotter.study import ConditionTolerance, analyse_tolerances


class KnotterToleranceRequest(PairRequest):
    """A pair of spatial angles, and the tolerances within which the knotter is made."""

    lengths: BoundedPositive = Field(0.1, description="Half width of the tolerance of every length and coordinate.")
    angles: BoundedPositive | None = Field(
        None,
        description="Half width of the tolerance of every angle; default: 0.1 degrees.",
        json_schema_extra={"unit": "angle"},
    )
    samples: Annotated[Count, Field(ge=0, le=20_000)] = Field(
        1000, description="Number of seeded random samples from the box of the tolerances."
    )
    seed: Annotated[Count, Field(ge=0, le=2**32 - 1)] = 0


ConditionToleranceReply = reply_model(ConditionTolerance)


class KnotterToleranceReply(Provenance):
    """Verdict within the tolerances."""

    status: Literal["ties", "may fail", "fails"] = Field(
        description="ties: the knot is tied at the worse corner of each condition and in every sample. may fail: it is tied "
        "with nominal dimensions but not in all of these cases. fails: it is not tied with nominal dimensions."
    )
    alpha1: float
    alpha3: float
    share: float = Field(description="Fraction of the samples in which all conditions hold.")
    dimensions: int
    samples: int
    wrap: ConditionToleranceReply
    clearance: ConditionToleranceReply
    bite: ConditionToleranceReply


def answer_tolerance(request: KnotterToleranceRequest, resources: Resources) -> KnotterToleranceReply:
    """Check the conditions at the worse corners of the tolerances and in random samples."""
    work, angles = resources.work(), Angles(request.angle_unit, DECIMALS)
    mechanism, conditions, pair, prescribed = pair_of(request, angles)
    for condition in conditions.values():
        condition.check(mechanism)
    angular = math.radians(0.1) if request.angles is None else angles.inward(request.angles)
    tolerances = {
        name: angular if name in ANGULAR_DIMENSIONS else request.lengths
        for name in dimensions(mechanism)
        if not name.endswith(".ratio")
    }
    tolerances_of_conditions, share = analyse_tolerances(
        mechanism, conditions, tolerances, request.samples, request.seed, work
    )
    replies: dict[str, Any] = {
        name: replace(
            tolerance, sensitivity={key: x * unit_of(key, angles) for key, x in tolerance.sensitivity.items()}
        )
        for name, tolerance in tolerances_of_conditions.items()
    }
    safe = share == 1.0 and all(tolerance.corner > 0 for tolerance in tolerances_of_conditions.values())
    fails = any(tolerance.margin <= 0 for tolerance in tolerances_of_conditions.values())
    return KnotterToleranceReply(
        status="fails" if fails else "ties" if safe else "may fail",
        **{name: angles.outward(angle) for name, angle in pair.items()},
        share=share,
        dimensions=len(tolerances),
        samples=request.samples,
        **replies,
        **provenance(request, prescribed),
    )


def tolerance_table(reply: KnotterToleranceReply, units: Units = DEGREES) -> str:
    """Return a row for each condition, and the dimensions to which its margin is most sensitive."""
    rows, influences = [], []
    for name in ("wrap", "clearance", "bite"):
        tolerance = getattr(reply, name)
        factor = "-" if tolerance.factor is None else f"{tolerance.factor:.3g}"
        rows.append(
            [
                name,
                *(f"{x:+.4f}" for x in (tolerance.margin, tolerance.corner, tolerance.margin_min)),
                f"{tolerance.share:.1%}",
                factor,
            ]
        )
        largest = list(tolerance.sensitivity.items())[:4]
        influences.append(
            f"  {name}: "
            + ", ".join(f"{key} {value:+.3g}" for key, value in largest)
            + f" per {units.length or 'unit of length'} or {units.angle}"
        )
    lengths = [units.head(word, units.length) for word in ("margin", "worse corner", "smallest sample")]
    head = ["condition", *lengths, "hold", "tolerances times"]  # the last: factor by which the tolerances may grow
    pair = f"alpha1 {reply.alpha1:g}, alpha3 {reply.alpha3:g} {units.angle}"
    title = f"{pair}: {reply.status}; {reply.share:.1%} of {reply.samples} samples tie"
    return "\n".join([title, table(head, rows), "largest sensitivities of the margins:", *influences])


TOLERANCE = Query(
    command="knotter tolerance",
    summary="Check if the knot is tied within tolerances of all lengths and angles, and find the critical dimensions.",
    answer=answer_tolerance,
    table=tolerance_table,
    is_long=lambda request: request.samples > 500,
)
