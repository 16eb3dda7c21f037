"""Bundled requests by name, as ``linkage-atlas example`` prints them: the page's machines and each question's own examples."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

from app.registry import all_queries
from app.tables import left_table


class Example(NamedTuple):
    """A request, the command that answers it, and a line of what it is."""

    command: str
    request: Mapping[str, Any]
    about: str


@cache
def all_examples() -> dict[str, Example]:
    """Every example by a name of its own: that of a machine of the page, or command and name as in ``match-rocker``."""
    found = {
        entry["name"]: Example("synthesize", entry["request"], entry["title"])
        for entry in json.loads(files("app").joinpath("static/examples.json").read_text())
    }
    for query in all_queries():
        for name, request in query.examples.items():
            found[f"{query.command.replace(' ', '-')}-{name}"] = Example(query.command, request, query.summary)
    return found


def listed() -> str:
    """The names of all examples, as a table."""
    rows = [(name, example.command, example.about) for name, example in all_examples().items()]
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
