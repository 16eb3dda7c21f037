"""Text for a terminal: exit codes, tables, numbers with units, and a line that shows progress."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum
from functools import reduce
from typing import Any

DELAY = 1.0
"""Seconds before progress is shown: most answers take less."""
STEP = 0.2
"""Seconds between two updates of the progress."""
BAR = 30
"""Number of characters of a progress bar."""


class Exit(IntEnum):
    """Exit codes of all commands."""

    OK = 0
    FAILED = 1
    USAGE = 2
    DAMAGED = 3
    CLOSEST = 4
    INFEASIBLE = 5
    UNKNOWN = 6
    INTERRUPTED = 130


MEANINGS = {
    Exit.OK: "success (status reached, or closest if the request has no tolerance)",
    Exit.FAILED: "failure: a file cannot be written, a port is in use, or lines of a study were refused",
    Exit.USAGE: "invalid input: the request, the command line or a file name",
    Exit.DAMAGED: "damaged atlas file",
    Exit.CLOSEST: "closest: the tolerance or tolerances of the request are not reached",
    Exit.INFEASIBLE: "infeasible, never or blocked: the search is complete, and no solution satisfies the limits",
    Exit.UNKNOWN: "unknown: no solution was found within the time limit",
    Exit.INTERRUPTED: "interrupted",
}
NOTHING = {**dict.fromkeys(("infeasible", "never", "blocked"), Exit.INFEASIBLE), "unknown": Exit.UNKNOWN}
"""Exit codes by the status of replies without an answer."""
EPILOG = "exit codes:\n" + "\n".join(f"  {code:<4} {words}" for code, words in MEANINGS.items())


def exit_of(request: Any, reply: Any) -> Exit:
    """Return the exit code for the status of a reply, and for whether the request has tolerances."""
    status = getattr(reply, "status", "")
    if status == "closest" and {"tolerance", "tolerances"} & request.model_fields_set:
        return Exit.CLOSEST
    return NOTHING.get(status, Exit.OK)


@contextmanager
def waiting(words: str, limit: float) -> Iterator[None]:
    """Show the seconds that have passed on standard error while the block runs, if it is a terminal."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield
        return
    done = threading.Event()

    def draw() -> None:
        seconds = DELAY
        while not done.wait(DELAY if seconds == DELAY else STEP):
            filled = min(int(BAR * seconds / limit), BAR)
            bar = f"[{'#' * filled}{'.' * (BAR - filled)}]"
            print(f"\r{words} {bar} {seconds:.0f} s of at most {limit:g}", end="", file=sys.stderr, flush=True)
            seconds += STEP
        if seconds > DELAY:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)

    drawing = threading.Thread(target=draw, daemon=True)
    drawing.start()
    try:
        yield
    finally:
        done.set()
        drawing.join()


@dataclass(frozen=True)
class Units:
    """Names of the units of angle and length in a table; the length's is empty if it is not known."""

    angle: str = "deg"
    length: str = ""

    def head(self, word: str, unit: str) -> str:
        """Return the heading of a column with its unit."""
        return f"{word} {unit}" if unit else word

    def behind(self, unit: str) -> str:
        """Return a unit as it follows a number."""
        return f" {unit}" if unit else ""

    def value(self, number: float | None, unit: str, digits: int = 3) -> str:
        """Return a number with its unit; a dash for None."""
        return "-" if number is None else f"{number:.{digits}g}{self.behind(unit)}"


DEGREES = Units()


def table(head: Sequence[str], rows: Sequence[Sequence[Any]], left: bool = False) -> str:
    """Lay out right-aligned or left-aligned columns under their heads."""
    cells = [[str(value) for value in row] for row in (head, *rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(head))]
    cells.insert(1, ["-" * width for width in widths])
    align = str.ljust if left else str.rjust
    return "\n".join("  ".join(map(align, row, widths)).rstrip() for row in cells)


def columns(items: Iterable[Any], *shown: tuple[str, str, str | Callable[[Any], Any]]) -> str:
    """Lay out a row for each item.

    Each column has a head, a format, and an attribute or function. None and an attribute that an item lacks are shown as a dash.
    """

    def cell(item: Any, spec: str, source: str | Callable[[Any], Any]) -> str:
        if isinstance(source, str):
            value = reduce(lambda part, name: getattr(part, name, None), source.split("."), item)
        else:
            value = source(item)
        return "-" if value is None else format(value, spec)

    return table([head for head, *_ in shown], [[cell(item, *column) for _, *column in shown] for item in items])


def number(value: float | None, digits: int = 6) -> str:
    """Format a number in as few characters as it needs; a dash for None."""
    return "-" if value is None else f"{value:.{digits}g}"
