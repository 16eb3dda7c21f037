"""``python -m docs.data_model``: draw the data model, docs/img/data_model.svg, from the fields of the classes."""

from __future__ import annotations

import dataclasses
import sys
from html import escape
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

PICTURE = Path(__file__).parent / "img" / "data_model.svg"
WIDTH, GAP, LINE, TOP, MAX_FIELDS = 190, 40, 16, 56, 12
COLUMNS = (
    ("request", ("linkage_atlas.motions.Motion", "synthesis.limits.Limits", "linkage_atlas.task.SearchOptions")),
    ("task, in radians", ("linkage_atlas.task.Task", "synthesis.target.Target", "synthesis.poses.Poses")),
    ("search", ("linkage_atlas.candidates.Candidates", "synthesis.solution.Solution")),
    ("reply", ("linkage_atlas.results.Result", "linkage_atlas.solutions.Solution", "linkage_atlas.results.Report")),
    (
        "linkage of both solutions",
        ("synthesis.linkage.Linkage", *(f"synthesis.guides.{name}" for name in ("Circle", "Rail", "Slot"))),
    ),
)
"""Heads of the columns, from left to right, and the classes in each."""
ARROWS = (
    ("Motion", "Task", "read_task"),
    ("Task", "Candidates", "find_candidates"),
    ("Candidates", "Result", "finish_candidates"),
)


class Box(NamedTuple):
    """A class with its position in the picture."""

    name: str
    module: str
    rows: list[str]
    x: float
    y: float

    @property
    def height(self) -> float:
        """Height of the box."""
        return 44 + LINE * len(self.rows)


def fields_of(path: str) -> list[str]:
    """Return the names of the fields of a class, at most `MAX_FIELDS`."""
    module, _, name = path.rpartition(".")
    kind = getattr(import_module(module), name)
    names = (
        [field.name for field in dataclasses.fields(kind)]
        if dataclasses.is_dataclass(kind)
        else list(kind.__annotations__)
    )
    shown = [name for name in names if not name.startswith("_")]
    return (
        shown if len(shown) <= MAX_FIELDS else [*shown[: MAX_FIELDS - 1], f"and {len(shown) - MAX_FIELDS + 1} more"]
    )


def boxes() -> list[Box]:
    """Return the boxes of all classes, column by column."""
    placed = []
    for k, (_, paths) in enumerate(COLUMNS):
        y = float(TOP)
        for path in paths:
            module, _, name = path.rpartition(".")
            box = Box(name, module, fields_of(path), 16 + k * (WIDTH + GAP), y)
            placed.append(box)
            y += box.height + 18
    return placed


def picture() -> str:
    """Return the picture as SVG."""
    placed = boxes()
    width, height = 16 + len(COLUMNS) * (WIDTH + GAP), max(box.y + box.height for box in placed) + 16
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" font-family="Helvetica, Arial, sans-serif">',
        "<title>The data model: classes with their fields, and the stages between them</title>",
        "<style>.t{font-size:14px;font-weight:bold;fill:#1b2430}.m{font-size:11px;fill:#5a6878}.l{font-size:12px;fill:#33404f}"
        ".h{font-size:13px;font-weight:bold;fill:#5a6878}.a{stroke:#1f5fa8;stroke-width:1.6;fill:none;marker-end:url(#h)}"
        ".s{font-size:11px;font-style:italic;fill:#1f5fa8;text-anchor:middle}</style>",
        '<defs><marker id="h" markerWidth="9" markerHeight="9" refX="7" refY="4" orient="auto">'
        '<path d="M0 0 L8 4 L0 8 z" fill="#1f5fa8"/></marker></defs>',
        f'<rect width="{width:g}" height="{height:g}" fill="#ffffff"/>',
    ]
    for k, (head, _) in enumerate(COLUMNS):
        parts.append(f'<text x="{16 + k * (WIDTH + GAP)}" y="24" class="h">{head}</text>')
    for box in placed:
        parts.append(
            f'<rect x="{box.x:g}" y="{box.y:g}" width="{WIDTH}" height="{box.height:g}" rx="8" fill="#f4f6f9" stroke="#44546a"/>'
        )
        parts.append(f'<text x="{box.x + 10:g}" y="{box.y + 18:g}" class="t">{escape(box.name)}</text>')
        parts.append(f'<text x="{box.x + 10:g}" y="{box.y + 33:g}" class="m">{escape(box.module)}</text>')
        for k, row in enumerate(box.rows):
            parts.append(f'<text x="{box.x + 10:g}" y="{box.y + 50 + LINE * k:g}" class="l">{escape(row)}</text>')
    for begin, end, stage in ARROWS:
        first = next(box for box in placed if box.name == begin)
        last = next(box for box in placed if box.name == end and box.x > first.x)
        x, y, to = first.x + WIDTH, first.y + 12, last.x
        parts.append(f'<path d="M{x:g} {y:g} H{to - 2:g}" class="a"/>')
        parts.append(f'<text x="{(x + to) / 2:g}" y="{y - 16:g}" class="s">{escape(stage)}</text>')
    return "\n".join([*parts, "</svg>", ""])


def main() -> int:
    """Write the picture."""
    PICTURE.write_text(picture())
    return 0


if __name__ == "__main__":
    sys.exit(main())
