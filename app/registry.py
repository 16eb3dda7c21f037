"""All questions that the service and the command line answer: the four-bar's and the scenes'."""

from __future__ import annotations

import json
from importlib import import_module
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from app.fourbar import SUMMARIES
from app.scenes import SCENES, queries_of, scene_queries

if TYPE_CHECKING:
    from app.query import Query


def worked_example() -> dict[str, Any]:
    """The bundled request: the motion of type 45,185 over crank 30 to 100 degrees, mounted as in the paper."""
    return json.loads(files("app").joinpath("examples/worked_example.json").read_text())


def motion_queries() -> tuple[Query, ...]:
    """The queries for a motion."""
    import linkage_atlas as la
    from app.fourbar.answers import answer_match, answer_synthesize, is_long
    from app.fourbar.csv_request import match_from_csv, request_from_csv
    from app.fourbar.export import SYNTHESIZE_EXPORTS, synthesize_file
    from app.fourbar.models import MatchRequest, SynthesizeRequest
    from app.fourbar.tables import matches_table, synthesize_table
    from app.query import Query

    example = worked_example()
    rotation_only = {"rotation": example["rotation"], "crank_span": example["crank_span"]}
    return (
        Query(
            "/v1/match",
            "match",
            SUMMARIES["match"],
            MatchRequest,
            la.Matches,
            answer_match,
            matches_table,
            {
                "worked_example": {**rotation_only, "top": 5},
                "rocker": {**rotation_only, "curve": "rocker", "top": 5},
            },
            from_csv=match_from_csv,
            is_long=is_long,
            shows_units=True,
            reads_atlas=True,
        ),
        Query(
            "/v1/synthesize",
            "synthesize",
            SUMMARIES["synthesize"],
            SynthesizeRequest,
            la.Result,
            answer_synthesize,
            synthesize_table,
            {
                "worked_example": {**example, "top": 3},
                "atlas_rows_only": {**example, "effort": "atlas", "top": 3},
                "rotation_only": {**rotation_only, "top": 3},
                "poses": {
                    "timing": "free",
                    "position": [[0, 0], [22, 5], [41, 17], [52, 36], [50, 58]],
                    "rotation": [0, 12, 27, 45, 66],
                    "top": 3,
                },
                "within_limits": {
                    **example,
                    "top": 3,
                    "limits": {"transmission_angle_min": 40, "pivot_box": [-50, -50, 250, 250]},
                    "round_to": 0.5,
                    "sensitivity": True,
                },
            },
            SYNTHESIZE_EXPORTS,
            request_from_csv,
            is_long,
            synthesize_file,
            shows_units=True,
            reads_atlas=True,
        ),
    )


def function_queries() -> tuple[Query, ...]:
    """The query for a function; its module comes with it, and the searches that the module needs."""
    queries: tuple[Query, ...] = import_module("app.fourbar.function_export").QUERIES
    return queries


def queries_named(word: str) -> tuple[Query, ...]:
    """The queries whose commands begin with a word: one, or all of a scene."""
    if word in SCENES:
        return queries_of(word)
    return tuple(
        query for query in (function_queries if word == "function" else motion_queries)() if query.command == word
    )


def all_queries() -> tuple[Query, ...]:
    """Every query of the service."""
    return (*motion_queries(), *function_queries(), *scene_queries())
