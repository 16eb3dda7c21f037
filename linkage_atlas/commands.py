"""The commands of the batch job, which `data_build` runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

BATCH_COMMANDS = {
    "build": "build an atlas file",
    "verify": "read a whole atlas file and say whether it is sound",
    "info": "say what an atlas file holds",
}


def run_batch(arguments: Sequence[str]) -> int:
    """Run one batch command; returns its exit code."""
    from data_build.cli import main

    return main(arguments)


def add_batch_commands(commands: Any) -> None:
    """Add the batch's commands with all their options to the subparsers of a parser."""
    from data_build.cli import add_commands

    add_commands(commands)
