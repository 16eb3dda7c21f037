"""Replies as text for a terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any


@dataclass(frozen=True)
class Units:
    """What a table calls the units of its request: of angle, and of length where that is known."""

    angle: str = "deg"
    length: str = ""

    def head(self, word: str, unit: str) -> str:
        return f"{word} {unit}" if unit else word

    def behind(self, unit: str) -> str:
        """A unit as it stands behind a number; nothing where it is not known."""
        return f" {unit}" if unit else ""

    def value(self, number: float | None, unit: str, digits: int = 3) -> str:
        """An error with its unit."""
        return "-" if number is None else f"{number:.{digits}g}{self.behind(unit)}"


DEGREES = Units()


def table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Right-aligned columns under a head."""
    cells = [[str(value) for value in row] for row in (head, *rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(head))]
    lines = ["  ".join(value.rjust(width) for value, width in zip(row, widths)) for row in cells]
    return "\n".join([lines[0], "  ".join("-" * width for width in widths), *lines[1:]])


def columns(items: Iterable[Any], *shown: tuple[str, str, str | Callable[[Any], Any]]) -> str:
    """A table with a row for each item: of each column the head, the format, and the attribute that it shows; a dash for None."""

    def cell(item: Any, spec: str, what: str | Callable[[Any], Any]) -> str:
        value = attrgetter(what)(item) if isinstance(what, str) else what(item)
        return "-" if value is None else format(value, spec)

    return table([head for head, *_ in shown], [[cell(item, *column) for _, *column in shown] for item in items])


def number(value: float | None, digits: int = 6) -> str:
    """A number in as few characters as it needs; a dash for none."""
    return "-" if value is None else f"{value:.{digits}g}"


def left_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns of words under a head, the last one as long as it likes."""
    widths = [max(len(row[k]) for row in (head, *rows)) for k in range(len(head) - 1)]
    rule = ["-" * width for width in widths] + ["-" * len(head[-1])]
    lines = [[cell.ljust(width) for cell, width in zip(row, widths)] + [row[-1]] for row in (head, rule, *rows)]
    return "\n".join("  ".join(line) for line in lines)
