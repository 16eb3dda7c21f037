"""The commands of the batch job, which `data_build` runs."""

from __future__ import annotations

from collections.abc import Sequence

BATCH_COMMANDS = {
    "build": "build an atlas file",
    "verify": "read a whole atlas file and say whether it is sound",
    "info": "say what an atlas file holds",
}


def run_batch(arguments: Sequence[str]) -> int:
    """Run one batch command; returns its exit code."""
    from data_build.cli import main

    return main(arguments)
