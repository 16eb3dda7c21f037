"""Table of the messages that users can see, for the reference: read from the syntax trees of the sources, for review."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("app", "linkage_atlas", "synthesis")
MIN_WORDS = 3
"""Number of words from which a string outside of a ``raise`` statement or refusal counts as a message."""
WORD = re.compile(r"(?<![\w.{])[A-Za-z][a-z]+(?=[\s,.:;!?)]|$)|(?<!\S)a(?!\S)")
DESCRIPTIONS = {
    *("description", "summary", "help", "epilog", "metavar", "title", "operation_description", "examples", "dtype"),
    *("pattern", "alias", "responses"),
}
"""Keyword arguments that document a field or command: other pages of the reference show them."""
REFUSALS = re.compile(r"error|refus|malformed|invalid|no_such|notfound|notclosing|exit")
"""Names of exceptions and functions, in lower case, whose arguments are messages of any length."""
TEMPLATE = re.compile(r'"((?:[^"\\\n]|\\.)*)"|`((?:[^`\\]|\\.)*)`', re.DOTALL)
"""Literals of a script in double quotes or backticks, as its formatter writes them."""
PATTERN = re.compile(r"(?<=[(,=])\s*/(?:\[(?:[^\]\\\n]|\\.)*\]|[^/\\\[\n]|\\.)+/[dgimsuvy]*(?=[\s,.;)])")
"""Regular expressions of a script: the quotes in them open no text."""
CODE = re.compile(r"</?\w|^[\w-]+(?: [\w-]+-[\w-]+)+$|^[MLAZ]\d|=>|\$\{[^}]*$|^\s*[,)]|px\b|'none';")
"""Markup, styles and lists of their classes, paths of drawings, and code between two templates."""


def messages_page() -> str:
    """Return all messages by package, each with the module that it comes from."""
    sections = []
    for package in PACKAGES:
        rows = [
            (path.relative_to(ROOT).as_posix(), text)
            for path in sorted((ROOT / package).rglob("*.py"))
            for text in dict.fromkeys(python_messages(path.read_text()))
        ]
        sections.append(_section(package, rows))
    rows = [
        (path.relative_to(ROOT).as_posix(), text)
        for path in sorted((ROOT / "app" / "static").glob("*.js"))
        for text in dict.fromkeys(script_messages(path.read_text()))
    ]
    return "\n".join([*sections, _section("The page", rows)])


def python_messages(source: str) -> Iterator[str]:
    """Yield the messages of a module in Python, with placeholders in braces."""
    yield from _visit(ast.parse(source), False)


def script_messages(source: str) -> Iterator[str]:
    """Yield the sentences among the string literals of a script, with placeholders in braces."""
    code = PATTERN.sub("", re.sub(r"/\*.*?\*/|(?<![:\"'`\w])//[^\n]*", "", source, flags=re.DOTALL))
    for match in TEMPLATE.finditer(code):
        text = re.sub(r"\$\{((?:[^{}]|\{[^}]*\})*)\}", r"{\1}", match[1] or match[2] or "")
        if not CODE.search(text) and len(WORD.findall(re.sub(r"\{[^}]*\}", "", text))) >= MIN_WORDS:
            yield text


def _visit(node: ast.AST, is_refusal: bool) -> Iterator[str]:
    """Yield the messages below a node of the syntax tree; ``is_refusal`` if it lies in a statement that refuses."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):  # a docstring
        return
    if isinstance(node, ast.keyword) and node.arg in DESCRIPTIONS:
        return
    text = _text(node)
    if text is not None:
        words = len(WORD.findall(re.sub(r"\{[^}]*\}", "", text)))
        if words >= (1 if is_refusal and " " in text.strip() else MIN_WORDS) and not CODE.search(text):
            yield text
        return
    if isinstance(node, ast.Call):
        is_refusal = is_refusal or bool(REFUSALS.search(ast.unparse(node.func).lower()))
    for child in ast.iter_child_nodes(node):
        yield from _visit(child, is_refusal or isinstance(node, ast.Raise))


def _text(node: ast.AST) -> str | None:
    """Return the text of a string or formatted string; None for any other node."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else None
    if not isinstance(node, ast.JoinedStr):
        return None
    parts = []
    for value in node.values:
        if isinstance(value, ast.FormattedValue):
            parts.append(f"{{{ast.unparse(value.value)}}}")
        else:
            parts.append(_text(value) or "")
    return "".join(parts)


def _section(title: str, rows: list[tuple[str, str]]) -> str:
    """Return a heading and the table of a package in Markdown."""
    lines = ["| module | message |", "| --- | --- |"]
    for module, text in rows:
        shown = " ".join(text.split()).replace("\\", "\\\\").replace("|", "&#124;").replace("<", "&lt;")
        escaped = re.sub(r"([]*_`$~^[])", r"\\\1", shown)
        lines.append(f"| `{module}` | {escaped} |")
    return f"## {title}\n\n" + "\n".join(lines) + "\n"
