"""Bundled requests by name, as ``linkage-atlas example`` prints them: the page's machines and each question's own examples."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

from app.query import Query
from app.registry import all_queries
from app.tables import left_table


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


def listed() -> str:
    """The names of all examples, as a table."""
    rows = [
        (name, example.command, example.about)
        for name, example in all_examples().items()
        if not name.startswith("synthesize-")
    ]
    return left_table(("name", "answered by", "what it is"), rows)


def pretty(value: Any, indent: str = "") -> str:
    """JSON to edit: a field a line, but what holds only numbers, such as a pose, on one line."""
    inner = indent + "  "
    if isinstance(value, Mapping) and value:
        rows = [f"{inner}{json.dumps(name)}: {pretty(one, inner)}" for name, one in value.items()]
        return "{\n" + ",\n".join(rows) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(one, (list, Mapping)) for one in value):
        return "[\n" + ",\n".join(inner + pretty(one, inner) for one in value) + f"\n{indent}]"
    return json.dumps(value)
