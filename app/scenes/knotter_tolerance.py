"""Verdicts of a knotter that is made within tolerances, over HTTP and on the command line."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Field

from app.query import Angles, Count, Query, ReplyModel, Resources
from app.scenes.knotter_machine import DECIMALS, machine_of, pair_of, provenance, unit_of
from app.scenes.knotter_models import Bounded, BoundedPositive, MachineRequest, Provenance
from app.tables import DEGREES, Units, table


class KnotterToleranceRequest(MachineRequest):
    """One pair of a knotter that is made within tolerances."""

    alpha1: Bounded | None = Field(
        None, description="Of the disc's axis; 10 degrees.", json_schema_extra={"unit": "angle"}
    )
    alpha3: Bounded | None = Field(
        None, description="Of the bill's axis; 25 degrees.", json_schema_extra={"unit": "angle"}
    )
    lengths: BoundedPositive = Field(0.1, description="Half width of the tolerance of every length and coordinate.")
    angles: BoundedPositive | None = Field(
        None,
        description="Half width of the tolerance of every angle; 0.1 degrees.",
        json_schema_extra={"unit": "angle"},
    )
    samples: Annotated[Count, Field(ge=0, le=20_000)] = Field(
        1000, description="Seeded draws from the box of the tolerances."
    )
    seed: Annotated[Count, Field(ge=0, le=2**32 - 1)] = 0


class SpreadReply(ReplyModel):
    """One condition within the tolerances."""

    holds: bool = Field(description="With the nominal dimensions.")
    margin: float
    linear: float = Field(description="The margin less all sensitivities times their tolerances.")
    corner: float = Field(description="The margin where every dimension is off to its worse side.")
    factor: float | None = Field(
        description="The multiple of the tolerances at which that corner fails; null: beyond 64, or it fails as it is."
    )
    least: float = Field(description="The smallest margin of all samples.")
    share: float = Field(description="The share of the samples in which the condition holds.")
    sensitivity: dict[str, float] = Field(
        description="Change of the margin per unit of each dimension, largest effects first."
    )


class KnotterToleranceReply(Provenance):
    """The verdict within tolerances."""

    status: Literal["ties", "may fail", "fails"] = Field(
        description="ties: at the worse corner of each condition and in every sample. may fail: not there. fails: as it is."
    )
    alpha1: float
    alpha3: float
    share: float = Field(description="The share of the samples in which all conditions hold.")
    dimensions: int
    samples: int
    wrap: SpreadReply
    clearance: SpreadReply
    bite: SpreadReply


def answer_tolerance(request: KnotterToleranceRequest, resources: Resources) -> KnotterToleranceReply:
    """The three conditions of one pair within tolerances."""
    from synthesis.knotter.dimensions import ANGLES, dimensions
    from synthesis.knotter.tolerance import spread

    work, angles = resources.work(), Angles(request.angle_unit, DECIMALS)
    mechanism, conditions = machine_of(request, angles)
    pair = pair_of(request.alpha1, request.alpha3, angles)
    mechanism = mechanism.with_parameters(alpha1=pair[0], alpha3=pair[1])
    for condition in conditions.values():
        condition.check(mechanism)
    angular = math.radians(0.1) if request.angles is None else angles.inward(request.angles)
    tolerances = {
        name: angular if name in ANGLES else request.lengths
        for name in dimensions(mechanism)
        if not name.endswith(".ratio")
    }
    found, share = spread(mechanism, conditions, tolerances, request.samples, request.seed, work)
    replies: dict[str, Any] = {}
    for name, one in found.items():
        effects = sorted(one.sensitivity, key=lambda key: -abs(one.sensitivity[key]) * tolerances[key])
        replies[name] = SpreadReply(
            holds=one.margin > 0,
            margin=one.margin,
            linear=one.linear,
            corner=one.corner,
            factor=one.factor if math.isfinite(one.factor) else None,
            least=one.least,
            share=one.share,
            sensitivity={key: one.sensitivity[key] * unit_of(key, angles) for key in effects},
        )
    safe = share == 1.0 and all(one.corner > 0 for one in found.values())
    fails = any(one.margin <= 0 for one in found.values())
    return KnotterToleranceReply(
        status="fails" if fails else "ties" if safe else "may fail",
        alpha1=angles.outward(pair[0]),
        alpha3=angles.outward(pair[1]),
        share=share,
        dimensions=len(tolerances),
        samples=request.samples,
        **replies,
        **provenance(request, [name for name in ("alpha1", "alpha3") if getattr(request, name) is not None]),
    )


def tolerance_table(reply: KnotterToleranceReply, units: Units = DEGREES) -> str:
    """The conditions as rows, and what contributes most."""
    rows, most = [], []
    for name in ("wrap", "clearance", "bite"):
        one = getattr(reply, name)
        factor = "-" if one.factor is None else f"{one.factor:.3g}"
        rows.append([name, *(f"{x:+.4f}" for x in (one.margin, one.corner, one.least)), f"{one.share:.1%}", factor])
        leading = list(one.sensitivity.items())[:4]
        most.append(
            f"  {name}: "
            + ", ".join(f"{key} {value:+.3g}" for key, value in leading)
            + f" per {units.length or 'unit of length'} or {units.angle}"
        )
    lengths = [units.head(word, units.length) for word in ("margin", "worse corner", "least sample")]
    head = ["condition", *lengths, "hold", "tolerances times"]
    pair = f"alpha1 {reply.alpha1:g}, alpha3 {reply.alpha3:g} {units.angle}"
    title = f"{pair}: {reply.status}; {reply.share:.1%} of {reply.samples} samples tie"
    return "\n".join([title, table(head, rows), "what matters most:", *most])


TOLERANCE = Query(
    path="/v1/knotter/tolerance",
    command="knotter tolerance",
    summary="Does the knot hold within tolerances of all lengths and angles, and which of them matters?",
    request=KnotterToleranceRequest,
    reply=KnotterToleranceReply,
    answer=answer_tolerance,
    table=tolerance_table,
    shows_units=True,
    examples={
        "chosen_pair": {"alpha1": 10, "alpha3": 25},
        "coarse": {"alpha1": 10, "alpha3": 25, "lengths": 0.5, "angles": 0.5},
    },
    is_long=lambda request: request.samples > 500,
)
