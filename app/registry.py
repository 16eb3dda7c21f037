"""All queries of the service and the command line, and their bundled requests."""

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
    """Return the query with a command, or all queries of a scene."""
    if word in SCENES:
        return queries_of(word)
    from app.fourbar.answers import QUERIES

    return tuple(query for query in QUERIES if query.command == word)


def all_queries() -> tuple[Query, ...]:
    """Return the queries about linkages and those of all scenes."""
    from app.fourbar.answers import QUERIES

    return (*QUERIES, *scene_queries())


class Example(NamedTuple):
    """Example request of a command."""

    command: str
    request: Mapping[str, Any]
    about: str
    """Line of help."""


@cache
def all_examples() -> dict[str, Example]:
    """Return all examples by the names that ``linkage-atlas example`` accepts.

    An example of ``synthesize`` has a short and a long name; the examples of other commands have only the long name.
    """
    return {
        name: example
        for query in sorted(all_queries(), key=lambda query: query.command != "synthesize")
        for name, example in examples_of(query).items()
        if query.command == "synthesize" or name not in query.examples
    }


def examples_of(query: Query) -> dict[str, Example]:
    """Return the examples of a query by short name and by long name, such as ``rocker`` and ``match-rocker``.

    The examples of ``synthesize`` include the machines of the page.
    """
    examples = {}
    if query.command == "synthesize":
        machines = json.loads(files(__package__).joinpath("static/examples.json").read_text())
        examples = {
            machine["name"]: Example(query.command, machine["request"], machine["title"]) for machine in machines
        }
    for name, request in query.examples.items():
        for key in (name, f"{query.command.replace(' ', '-')}-{name}"):
            examples[key] = Example(query.command, request, query.summary)
    return examples
