"""All questions that the service and the command line answer, the four-bar's and the scenes', and their bundled requests."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from importlib.resources import files
from typing import TYPE_CHECKING, Any, NamedTuple

from app.fourbar import QUESTIONS, worked_example
from app.scenes import SCENES, queries_of, scene_queries

if TYPE_CHECKING:
    from app.query import Query

__all__ = ["all_examples", "all_queries", "examples_of", "queries_named", "worked_example"]


def _motion_queries() -> tuple[Query, ...]:
    from app.fourbar.answers import answer_match, answer_synthesize, is_long
    from app.fourbar.export import LINKAGE_FILES, SYNTHESIZE_EXPORTS
    from app.fourbar.tables import matches_table, synthesize_table
    from app.query import Query
    from linkage_atlas.tables import match_from_csv, request_from_csv

    example = worked_example()
    rotation_only = {"rotation": example["rotation"], "crank_span": example["crank_span"]}
    return (
        Query(
            "match",
            QUESTIONS["match"],
            answer_match,
            matches_table,
            {
                "worked_example": {**rotation_only, "top": 5},
                "rocker": {**rotation_only, "curve": "rocker", "top": 5},
                "slider_crank": {**rotation_only, "mechanisms": ["four_bar", "slider_crank"], "top": 5},
            },
            from_csv=match_from_csv,
            is_long=is_long,
            reads_atlas=True,
        ),
        Query(
            "synthesize",
            QUESTIONS["synthesize"],
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
                "sliders": {
                    "timing": "free",
                    "position": [[0, 0], [100, 20], [180, 70], [220, 150]],
                    "rotation": [0, 20, 50, 85],
                    "mechanisms": ["slider_crank", "rail_slot"],
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
            LINKAGE_FILES,
            reads_atlas=True,
        ),
    )


def queries_named(word: str) -> tuple[Query, ...]:
    """The queries whose commands begin with a word: one, or all of a scene."""
    if word in SCENES:
        return queries_of(word)
    if word in ("function", "assembly", "drive"):
        module = {"drive": "drives"}.get(word, word)
        return import_module(f"app.fourbar.{module}").QUERIES
    return tuple(query for query in _motion_queries() if query.command == word)


def all_queries() -> tuple[Query, ...]:
    return (
        *_motion_queries(),
        *queries_named("function"),
        *queries_named("assembly"),
        *queries_named("drive"),
        *scene_queries(),
    )


class Example(NamedTuple):
    """A request, the command that answers it, and a line of what it is."""

    command: str
    request: Mapping[str, Any]
    about: str


@cache
def all_examples() -> dict[str, Example]:
    """Every example by the names that ``linkage-atlas example`` takes: of all questions but one, only those that tell which."""
    return {
        name: example
        for query in sorted(all_queries(), key=lambda query: query.command != "synthesize")
        for name, example in examples_of(query).items()
        if query.command == "synthesize" or name not in query.examples
    }


def examples_of(query: Query) -> dict[str, Example]:
    """A question's examples: machines of the page, its own by their names, and by command and name as in ``match-rocker``."""
    found = {}
    if query.command == "synthesize":
        machines = json.loads(files("app").joinpath("static/examples.json").read_text())
        found = {one["name"]: Example(query.command, one["request"], one["title"]) for one in machines}
    for name, request in query.examples.items():
        for called in (name, f"{query.command.replace(' ', '-')}-{name}"):
            found[called] = Example(query.command, request, query.summary)
    return found
