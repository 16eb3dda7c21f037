"""``python -m tests.prose``: lower the stored counts of unidiomatic phrases to those of the tree.

With ``--check`` (part of ``make lint``) nothing is written: it fails if a file has more phrases or vague names than were
counted last. A file that is not listed may have a phrase in each 150 words.
A phrase is a place to look at, not a verdict: each pattern is grammatical English that a native engineer seldom writes.
"""

from __future__ import annotations

import ast
import io
import json
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
COUNTS = Path(__file__).with_name("prose.json")
SUMMARY = re.compile(
    r"(They|Them|Those|That|It|These|Its|Their|Some|All of them|The same|The rest|Such|Others)\b"
    r"|(What|Whether|How|Where|Why|Who|Which|In which|By how|From which|With which|Within what)\s"
)
"""Beginnings of a docstring that name no subject."""
PHRASES = tuple(
    map(
        re.compile,
        (
            r"(?:^|[.;:]\s+)Of (?:a|an|the|it|its|each|all|both|them|one|two|several|those|these|such|which|what"
            r"|some|any|so)\b",
            r"(?:^|[ ,;:(])[Ww]here (?:there|it|that|they|none|one|no|nothing|these|those|any|all|each|this|some"
            r"|both|not|what)\b",
            r"\bas of\b",
            r"\b(?:[Pp]art of itself|parts? by which|a part of it|this part of|by a smaller part)\b",
            r"\b[Ss]o (?:many|much|far|often|few)\b|\bas many\b",
            r"\balone\b",
            r"\b(?:those|what) (?:of|which|is|are|it|they|was|were|has|have|there|others)\b|\bthat of\b",
            r"\bones?\b(?! (?:of|or|by|at|hundred|thousand|third|half))",
            r"\b(?:stands?|stood|standing)\b",
            r"\b(?:go|goes|going|gone|went) on\b",
            r"\b(?:told|tells?|says|asked)\b",
            r"\b(?:but for|all but|nor|else than|perhaps|hardly|anew|nobody|by itself|by themselves|for itself|seldom|thereby"
            r"|likewise|shall)\b",
            r"\b[Bb]y how|\b[Hh]ow (?:far|near|late)\b",
            r"\b(?:break|breaks|broken|keep|keeps|kept) (?:the |a |its |all |no |those |these |some |of the )?"
            r"(?:limits?|tolerances?)\b",
        ),
    )
)
VAGUE_NAMES = frozenset(
    "one other others some every rest told asked given wanted kept led stood place places way ways least most far near looked"
    " followed made whole alone again anew begun began goes went comes came stands".split()
)


def python_prose(text: str, nodes: list[ast.AST]) -> Iterator[tuple[str, bool]]:
    """Yield the docstrings (True) and comments (False) of a module."""
    for node in nodes:
        body = getattr(node, "body", None)
        for statement in body if isinstance(body, list) else ():
            value = getattr(statement, "value", None)
            if isinstance(statement, ast.Expr) and isinstance(value, ast.Constant) and isinstance(value.value, str):
                yield value.value, True
    for token in tokenize.generate_tokens(io.StringIO(text).readline) if "#" in text else ():
        if token.type == tokenize.COMMENT and "noqa" not in token.string and "type:" not in token.string:
            yield token.string.lstrip("# "), False


def markdown_prose(text: str) -> Iterator[tuple[str, bool]]:
    """Yield the paragraphs of a document, without code, tables and pictures."""
    for line in re.sub(r"^\s*```.*?^\s*```", "", text, flags=re.MULTILINE | re.DOTALL).splitlines():
        if line.strip() and not line.startswith(("    ", "|", "<", "!")):
            yield re.sub(r"`[^`]*`", "x", line), False


def vague_names(nodes: list[ast.AST]) -> int:
    """Count the functions, classes, arguments and variables with a vague name."""
    names = []
    for node in nodes:
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.append(node.id)
        elif isinstance(node, ast.arg):
            names.append(node.arg)
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.append(node.name)
    return sum(name.strip("_").lower() in VAGUE_NAMES for name in names)


def count(path: Path) -> tuple[int, int, int]:
    """Count the words of a file, its unidiomatic phrases and its vague names."""
    text = path.read_text()
    nodes = list(ast.walk(ast.parse(text))) if path.suffix == ".py" else []
    words = phrases = 0
    for prose, is_docstring in python_prose(text, nodes) if nodes else markdown_prose(text):
        flat = " ".join(prose.split())
        words += len(flat.split())
        phrases += bool(is_docstring and SUMMARY.match(flat)) + sum(len(pattern.findall(flat)) for pattern in PHRASES)
    return words, phrases, vague_names(nodes)


def files() -> list[str]:
    """List the Python and Markdown files of the repository that exist in the working tree."""
    listed = subprocess.run(["git", "ls-files", "*.py", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True)
    return [name for name in listed.stdout.split() if (ROOT / name).exists()]


def measure() -> dict[str, list[int]]:
    """Count the phrases and vague names of each file that has any."""
    found = {name: list(count(ROOT / name)[1:]) for name in files()}
    return {name: counts for name, counts in found.items() if any(counts)}


def check() -> None:
    """Fail if a file reads worse than when it was last counted."""
    stored = json.loads(COUNTS.read_text())
    worse = []
    for name in files():
        words, *found = count(ROOT / name)
        allowed = stored.get(name, [1 + words // 150, 0])
        if found[0] > allowed[0] or found[1] > allowed[1]:
            worse.append(f"{name}: {found} phrases and vague names, at most {allowed}")
    if worse:
        sys.exit("\n".join([*worse, "rewrite the text, then lower the counts with python -m tests.prose"]))


def lower() -> None:
    """Lower the stored counts, and drop files that are gone or clean; a count never rises."""
    stored = json.loads(COUNTS.read_text()) if COUNTS.exists() else None
    found = measure()
    if stored is not None:
        found = {
            name: [min(pair) for pair in zip(found[name], stored[name])] for name in found.keys() & stored.keys()
        }
    lines = (f" {json.dumps(name)}: {json.dumps(found[name])}" for name in sorted(found))
    COUNTS.write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    check() if sys.argv[1:] == ["--check"] else lower()
