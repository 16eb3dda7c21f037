"""What all commands share: arguments that several have, and exit codes, which tell a script of an answer it does not read."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from enum import IntEnum
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
    Exit.INFEASIBLE: "infeasible: the search ran to its end and found nothing within the limits",
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
