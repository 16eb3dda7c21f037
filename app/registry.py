"""All questions that the service and the command line answer, the four-bar's and the scenes', and their bundled requests."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any, NamedTuple

from app.fourbar import worked_example
from app.scenes import SCENES, queries_of, scene_queries

if TYPE_CHECKING:
    from app.query import Query

__all__ = ["all_examples", "all_queries", "examples_of", "queries_named", "worked_example"]


def queries_named(word: str) -> tuple[Query, ...]:
    """The queries whose commands begin with a word: one, or all of a scene."""
    if word in SCENES:
        return queries_of(word)
    return tuple(query for query in _of_the_four_bar() if query.command == word)


def _of_the_four_bar() -> tuple[Query, ...]:
    from app.fourbar.answers import QUERIES

    return QUERIES


def all_queries() -> tuple[Query, ...]:
    return (*_of_the_four_bar(), *scene_queries())


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
