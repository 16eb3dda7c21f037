"""What all commands share: arguments that several have, exit codes that tell a script of an answer it does not read, tables."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from operator import attrgetter
from pathlib import Path
from typing import Any

FILE: dict[str, str] = {}
"""What completes the name of a file in each shell: shtab's, once it is asked for a completion."""


def add_atlas(parser: Any, what: str = "the atlas") -> None:
    parser.add_argument(
        "--atlas",
        type=Path,
        metavar="FILE",
        help=f"{what} (default: atlas.h5 here, or else the default one, built once in the cache folder)",
    ).complete = FILE


def whole_number(least: int, most: int | None = None) -> Callable[[str], int]:
    """Reads a whole number from ``least`` to ``most``, as the type of an argument."""

    def number(text: str) -> int:
        value = int(text)
        if value < least or (most is not None and value > most):
            wanted = f"at least {least}" if most is None else f"{least} to {most}"
            raise argparse.ArgumentTypeError(f"must be {wanted}, found {value}")
        return value

    return number


class Exit(IntEnum):
    """Exit codes, each with one meaning; `MEANINGS` has them in words."""

    OK = 0
    FAILED = 1
    USAGE = 2
    DAMAGED = 3
    CLOSEST = 4
    INFEASIBLE = 5
    UNKNOWN = 6
    INTERRUPTED = 130


MEANINGS = {
    Exit.OK: "answered (status reached, or closest where the request does not say what is good enough)",
    Exit.FAILED: "failed: a file cannot be written, a port is taken, some lines of a study were refused",
    Exit.USAGE: "bad input: the request, the command line or a file's name",
    Exit.DAMAGED: "an atlas file is damaged",
    Exit.CLOSEST: "closest, though the request says what is good enough (tolerance or tolerances): it is not reached",
    Exit.INFEASIBLE: "infeasible, never or blocked: the search ran to its end and found nothing within the limits",
    Exit.UNKNOWN: "unknown: nothing was found before the time was up",
    Exit.INTERRUPTED: "interrupted",
}
NOTHING = {
    "infeasible": Exit.INFEASIBLE,
    "never": Exit.INFEASIBLE,
    "blocked": Exit.INFEASIBLE,
    "unknown": Exit.UNKNOWN,
}
"""Statuses of replies that hold no answer; those of the scenes too."""
EPILOG = "exit codes:\n" + "\n".join(f"  {code:<4} {words}" for code, words in MEANINGS.items())


def exit_of(request: Any, reply: Any) -> Exit:
    """The exit code of a reply, from its status and whether the request says what is good enough."""
    status = getattr(reply, "status", "")
    if status == "closest" and {"tolerance", "tolerances"} & request.model_fields_set:
        return Exit.CLOSEST
    return NOTHING.get(status, Exit.OK)


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
