"""The four-bar's questions, answered by the front door: the models' fields are its arguments."""

from __future__ import annotations

import math

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
        **request.given(but=("angle_unit", "budget_ms")),
        atlas=resources.atlas,
        degrees=request.degrees,
        budget=budget_of(request.budget_ms, resources),
        work=resources.work,
    )


def is_long(request: SynthesizeRequest | MatchRequest) -> bool:
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
    asked = request.given(but=("angle_unit", "budget_ms", "live"))
    if "family" not in request.limits.model_fields_set:  # what was not asked for may be told of
        del asked["limits"]["family"]
    return la.synthesize(
        **asked,
        degrees=request.degrees,
        budget=budget_of(request.budget_ms, resources),
        atlas=resources.atlas if request.effort == "atlas" else None,
        work=resources.work,
        live=None if request.live is None else resources.live(),
    )


MOTION = ("rotation", "position", "crank_span", "crank_angle", "length_scale", "timing", "order", "closed")
MOTION += ("crank_span_max", "travel", "travel_span", "weights", "tolerances")
"""Fields of the motion that is asked for."""


def motion_of(request: SynthesizeRequest) -> la.Motion:
    return la.Motion(**request.given(*MOTION), degrees=request.degrees)
