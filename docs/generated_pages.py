"""Reference pages that are generated when the site is built: commands, HTTP interface, settings and messages."""

from __future__ import annotations

import json
from argparse import _SubParsersAction
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docs.messages import messages_page

FOLDER = Path(__file__).parent / "generated"
BOUNDS = {"minimum": "at least", "maximum": "at most", "exclusiveMinimum": "above", "exclusiveMaximum": "below"}
"""Keys of JSON schema in words."""


def write_pages(app: object = None) -> None:
    """Write all generated pages to the folder ``generated``."""
    FOLDER.mkdir(exist_ok=True)
    description = json.loads((Path(__file__).parent / "openapi.json").read_text())
    pages = {"command_line": command_line(), "http": http_routes(description), "settings": settings()}
    pages["messages"] = messages_page()
    for name, content in pages.items():
        (FOLDER / f"{name}.md").write_text(content)


def command_line() -> str:
    """Return the help of every command, which lists all fields of its request."""
    from app.cli import make_parser

    parser = make_parser(all_commands=True)
    commands = next(action for action in parser._actions if isinstance(action, _SubParsersAction))
    sections = [f"```text\n{parser.format_help()}```\n"]
    for name, command in commands.choices.items():
        sections.append(f"## {name}\n\n```text\n{command.format_help()}```\n")
    return "\n".join(sections)


def settings() -> str:
    """Return a table of the settings of the service."""
    from app.settings import Settings

    rows = [
        (f"`LINKAGE_ATLAS_{name.upper()}`", f"`{field.default}`", field.description or "")
        for name, field in Settings.model_fields.items()
    ]
    return _table(("environment variable", "default", "meaning"), rows)


def http_routes(description: dict[str, Any]) -> str:
    """Return a section for each route, and the fields of each object in requests and replies."""
    sections = ["## Routes\n"]
    for path, methods in description["paths"].items():
        for method, route in methods.items():
            request = _schema(route.get("requestBody", {}))
            reply = _schema(route["responses"].get("200", {}))
            sections.append(f"### {method.upper()} {path}\n\n{route.get('summary', '')}\n")
            sections += [f"Request: {_type_of(request)}.\n"] if request else []
            sections += [f"Reply: {_type_of(reply)}.\n"] if reply else []
    sections.append("## Objects\n")
    for name, schema in sorted(description["components"]["schemas"].items()):
        if "properties" in schema:
            rows = list(_fields(schema))
            sections.append(
                f"### {name}\n\n{schema.get('description', '')}\n\n" + _table(("field", "type", "meaning"), rows)
            )
    return "\n".join(sections)


def _schema(body: dict[str, Any]) -> dict[str, Any]:
    """Return the JSON schema of a request body or response; empty if it is no JSON object."""
    schema: dict[str, Any] = body.get("content", {}).get("application/json", {}).get("schema", {})
    return schema


def _fields(schema: dict[str, Any]) -> Iterator[tuple[str, str, str]]:
    """Yield the name, type and meaning of each field; required fields are marked."""
    for name, field in schema["properties"].items():
        is_required = name in schema.get("required", ())
        default = "" if field.get("default") is None else f" Default: `{json.dumps(field['default'])}`."
        meaning = " ".join(str(field.get("description", "")).split()) + default
        yield f"`{name}`{' (required)' if is_required else ''}", _type_of(field) + _bounds(field), meaning


def _bounds(field: dict[str, Any]) -> str:
    """Return the bounds of a number, or of the number of items of a list, in words."""
    for schema in (field, *field.get("anyOf", ())):
        for names, suffix in ((BOUNDS, ""), (("minItems", "maxItems"), " items")):
            bounds = [(words, schema[name]) for name, words in zip(names, BOUNDS.values()) if name in schema]
            if len(bounds) == 2 and bounds[0][1] == bounds[1][1]:
                return f", {bounds[0][1]:,g}{suffix}"
            if bounds:
                return ", " + " and ".join(f"{words} {bound:,g}" for words, bound in bounds) + suffix
    return ""


def _type_of(schema: dict[str, Any]) -> str:
    """Return the type of a JSON schema in words, with a link to the table of an object."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    for key in ("anyOf", "oneOf"):
        if key in schema:
            return " or ".join(dict.fromkeys(_type_of(branch) for branch in schema[key]))
    if "enum" in schema or "const" in schema:
        return ", ".join(f"`{json.dumps(value)}`" for value in schema.get("enum", [schema.get("const")]))
    if schema.get("type") == "array":
        items = schema.get("items") or next(iter(schema.get("prefixItems", [])), {})
        return f"list of {_type_of(items)}" if items else "list"
    return str(schema.get("type", "any value"))


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """Return a table in Markdown."""
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', '&#124;') for cell in line)} |" for line in lines) + "\n"
