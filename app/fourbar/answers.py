"""The four-bar's questions, answered by the front door: the models' fields are its arguments."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any

import linkage_atlas as la
from app.fourbar.export import SYNTHESIZE_EXPORTS, solve
from app.fourbar.models import MatchesReply, MatchRequest, SynthesizeReply, SynthesizeRequest
from app.fourbar.tables import matches_table, synthesize_table
from app.query import Query, Resources


def answer_match(request: MatchRequest, resources: Resources) -> MatchesReply:
    """The best rows by rotation alone; no pose is computed."""
    found = la.match(
        request.rotation,
        request.crank_span,
        atlas=resources.atlas,
        crank_angle=request.crank_angle,
        degrees=request.degrees,
        top=request.top,
        features=request.features,
        work=resources.work,
    )
    return MatchesReply.model_validate(found.to_dict())


def answer_synthesize(request: SynthesizeRequest, resources: Resources) -> SynthesizeReply:
    """Linkages with actual dimensions and pose, best first."""
    return SynthesizeReply.model_validate(solve(request, resources).to_dict())


def worked_example() -> dict[str, Any]:
    """The bundled request: the motion of type 45,185 over crank 30 to 100 degrees, mounted as in the paper."""
    return json.loads(files("app").joinpath("examples/worked_example.json").read_text())


def fourbar_queries() -> tuple[Query, ...]:
    """The four-bar's queries."""
    example = worked_example()
    rotation_only = {"rotation": example["rotation"], "crank_span": example["crank_span"]}
    return (
        Query(
            "/v1/match",
            "match",
            "Rotation only: which atlas rows, at which start?",
            MatchRequest,
            MatchesReply,
            answer_match,
            matches_table,
            {"worked_example": {**rotation_only, "top": 5}},
        ),
        Query(
            "/v1/synthesize",
            "synthesize",
            "Rotation, positions or both: actual dimensions and mounting pose.",
            SynthesizeRequest,
            SynthesizeReply,
            answer_synthesize,
            synthesize_table,
            {
                "worked_example": {**example, "top": 3},
                "atlas_rows_only": {**example, "effort": "atlas", "top": 3},
                "rotation_only": {**rotation_only, "top": 3},
                "within_limits": {
                    **example,
                    "top": 3,
                    "limits": {"transmission_angle_min": 40, "pivot_box": [-50, -50, 250, 250]},
                    "round_to": 0.5,
                    "sensitivity": True,
                },
            },
            SYNTHESIZE_EXPORTS,
        ),
    )
