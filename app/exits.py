"""Exit codes of the command: what a script learns of an answer without reading it."""

from __future__ import annotations

from enum import IntEnum
from typing import Any


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
