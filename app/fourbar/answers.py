"""The four-bar's questions, answered by the front door: the models' fields are its arguments."""

from __future__ import annotations

import math
from typing import Any

import linkage_atlas as la
from app.fourbar.durations import seconds_of
from app.fourbar.models import MatchRequest, SynthesizeRequest
from app.query import Resources
from linkage_atlas.studies import DRIVE_STUDIES

SHORT_MS = 200.0
"""What a request takes at most for which a process is kept: by its budget, or as it was measured for those of its kind."""


def answer_match(request: MatchRequest, resources: Resources) -> la.Matches:
    """The best rows by rotation alone; no pose is computed."""
    if request.curve == "rocker":
        resources.need("rockers")
    if "slider_crank" in request.mechanisms or request.mechanisms == "all":
        resources.need("slider_cranks")
    return la.match(
        request.rotation,
        request.crank_span,
        atlas=resources.atlas,
        crank_angle=request.crank_angle,
        curve=request.curve,
        mechanisms=request.mechanisms,
        degrees=request.degrees,
        top=request.top,
        features=request.features,
        budget=budget_of(request.budget_ms, resources),
        work=resources.work,
    )


def is_long(request: SynthesizeRequest | MatchRequest) -> bool:
    """Whether an answer may take more than a fraction of a second."""
    if request.budget_ms is not None and request.budget_ms <= SHORT_MS:
        return False
    if isinstance(request, MatchRequest):
        return len(request.rotation) > 256 or request.top > 100
    if request.live is not None:
        return False
    if any(getattr(request, name) is not None for name in DRIVE_STUDIES):
        return True
    studied = request.lengths_from is not None or request.tolerance_study is not None or request.round_to is not None
    studied = studied or request.assembly is not None
    wished = request.diverse or request.tolerances is not None or request.prefer not in (None, "error")
    windows = request.effort == "atlas" and request.position is not None
    kinds = request.mechanisms not in (None, ["four_bar"])
    return kinds or studied or wished or windows or request.top > 20 or seconds_of(request) > SHORT_MS / 1000


def budget_of(budget_ms: float | None, resources: Resources) -> float | None:
    """Seconds that a request may take: what it says, at most what the service allows; None where nothing limits it."""
    most = min(budget_ms or resources.max_budget_ms, resources.max_budget_ms)
    return None if math.isinf(most) else most / 1000


def answer_synthesize(request: SynthesizeRequest, resources: Resources) -> la.Result:
    """Linkages with actual dimensions and pose, best first."""
    if request.effort == "atlas" and request.position is not None:
        resources.need("positions")
    return la.synthesize(
        **motion_of(request),
        limits=request.limits.model_dump(exclude_none=True),
        **{name: getattr(request, name) for name in ("top", "effort", "prefer", "diverse", "tolerance")},
        budget=budget_of(request.budget_ms, resources),
        refine_from=None if request.refine_from is None else request.refine_from.model_dump(),
        **{name: getattr(request, name) for name in ("round_to", "lengths_from", "sensitivity")},
        analysis=analysis_of(request),
        tolerance_study=None if request.tolerance_study is None else request.tolerance_study.model_dump(),
        **drives_of(request),
        assembly=assembly_of(request),
        mechanisms=request.mechanisms,
        driver=request.driver,
        atlas=resources.atlas if request.effort == "atlas" else None,
        work=resources.work,
        live=None if request.live is None else resources.live(),
    )


def analysis_of(request: SynthesizeRequest) -> dict[str, Any] | None:
    """What a request says of an analysis."""
    return None if request.analysis is None else request.analysis.model_dump()


def drives_of(request: Any) -> dict[str, Any]:
    """What a request says of drives: arguments of `linkage_atlas.drives` and of `linkage_atlas.synthesize`."""

    def plain(part: Any) -> Any:
        if isinstance(part, list):
            return [one.model_dump(exclude_none=True) for one in part]
        return None if part is None else part.model_dump(exclude_none=True)

    return {name: plain(getattr(request, name)) for name in DRIVE_STUDIES if name in type(request).model_fields}


def assembly_of(request: SynthesizeRequest) -> dict[str, Any] | None:
    """What a request says of an assembly."""
    return None if request.assembly is None else request.assembly.model_dump(exclude_none=True)


def motion_of(request: SynthesizeRequest) -> dict[str, Any]:
    """What a request says of the motion: arguments of `linkage_atlas.Motion`."""
    names = ("rotation", "position", "crank_span", "crank_angle", "length_scale", "degrees")
    names += ("timing", "order", "closed", "crank_span_max", "travel", "travel_span")
    parts = {name: getattr(request, name) for name in ("weights", "tolerances")}
    given = {name: None if part is None else part.model_dump(exclude_none=True) for name, part in parts.items()}
    return {name: getattr(request, name) for name in names} | given
