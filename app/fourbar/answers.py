"""The four-bar's questions, answered by the front door: the models' fields are its arguments."""

from __future__ import annotations

import math
from typing import Any

import linkage_atlas as la
from app.fourbar.durations import samples_of, seconds_of
from app.fourbar.models import AssemblyOptions, MatchRequest, SynthesizeRequest
from app.query import Resources
from linkage_atlas.studies import DRIVE_STUDIES

SHORT_MS = 200.0
"""What a request takes at most for which a process is kept: by its budget, or as it was measured for those of its kind."""
MANY_SAMPLES = 64
"""From here on a match may take longer, and what an answer under `live` does beside its search."""
SHORT_SPAN = 5.0
"""Degrees of the crank: a match over less has many rows that are alike."""
MANY_CORNERS = 12
"""Of a body that is to pass plates and pins."""
STUDIED = (*DRIVE_STUDIES, "lengths_from", "round_to", "tolerance_study", "assembly")
"""What takes long of each solution."""


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
        return len(request.rotation) > MANY_SAMPLES or request.top > 100 or abs(_span_of(request)) < SHORT_SPAN
    studied = any(getattr(request, name) is not None for name in STUDIED)
    if studied or request.live is not None:
        return studied or samples_of(request) > MANY_SAMPLES
    wished = request.diverse or request.tolerances is not None or request.prefer not in (None, "error")
    windows = request.effort == "atlas" and request.position is not None
    kinds = request.mechanisms not in (None, ["four_bar"])
    return kinds or wished or windows or request.top > 20 or seconds_of(request) > SHORT_MS / 1000


def _span_of(request: MatchRequest) -> float:
    """Degrees of the crank from the first sample to the last."""
    span = request.crank_span
    if span is None:
        span = request.crank_angle[-1] - request.crank_angle[0] if request.crank_angle else 0.0
    return span if request.degrees else math.degrees(span)


def has_much_to_arrange(assembly: AssemblyOptions | None, driver: str | None) -> bool:
    """Whether layers of a linkage, of one with sliders where it says its driver, may take more than a fraction of a second."""
    if assembly is None or assembly.body is None:
        return False
    return len(assembly.body) > MANY_CORNERS or driver is not None


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
