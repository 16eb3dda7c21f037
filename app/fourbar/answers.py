"""The four-bar's questions, answered by the front door: the models' fields are its arguments."""

from __future__ import annotations

from typing import Any

import linkage_atlas as la
from app.fourbar.models import MatchesReply, MatchRequest, SynthesizeReply, SynthesizeRequest
from app.query import Resources


def answer_match(request: MatchRequest, resources: Resources) -> MatchesReply:
    """The best rows by rotation alone; no pose is computed."""
    found = la.match(
        request.rotation,
        request.crank_span,
        atlas=resources.atlas,
        crank_angle=request.crank_angle,
        curve=request.curve,
        degrees=request.degrees,
        top=request.top,
        features=request.features,
        work=resources.work,
    )
    return MatchesReply.model_validate(found.to_dict())


def answer_synthesize(request: SynthesizeRequest, resources: Resources) -> SynthesizeReply:
    """Linkages with actual dimensions and pose, best first."""
    return SynthesizeReply.model_validate(solve(request, resources).to_dict())


def solve(request: SynthesizeRequest, resources: Resources) -> la.Result:
    """The front door's answer to a request."""
    budget_ms = min(request.budget_ms or resources.max_budget_ms, resources.max_budget_ms)
    return la.synthesize(
        **motion_of(request),
        tolerances=None if request.tolerances is None else request.tolerances.model_dump(exclude_none=True),
        limits=request.limits.model_dump(),
        top=request.top,
        effort=request.effort,
        tolerance=request.tolerance,
        budget=budget_ms / 1000,
        round_to=request.round_to,
        sensitivity=request.sensitivity,
        atlas=resources.atlas if request.effort == "atlas" else None,
        work=resources.work,
    )


def motion_of(request: SynthesizeRequest) -> dict[str, Any]:
    """What a request says of the motion: arguments of the front door and of its `Motion`."""
    names = ("rotation", "position", "crank_span", "crank_angle", "length_scale", "degrees")
    names += ("timing", "order", "closed", "crank_span_max")
    weights = None if request.weights is None else request.weights.model_dump(exclude_none=True)
    return {name: getattr(request, name) for name in names} | {"weights": weights}
