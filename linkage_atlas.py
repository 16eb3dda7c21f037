"""The command ``linkage-atlas``: hands each command to the floor that knows it, and imports only that one."""

from __future__ import annotations

import sys
from collections.abc import Sequence

__version__ = "0.1.0"

BATCH_COMMANDS = {
    "build": "build an atlas file",
    "verify": "read a whole atlas file and say whether it is sound",
    "info": "say what an atlas file holds",
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if arguments and arguments[0] in BATCH_COMMANDS:
        from data_build.cli import main as batch

        return batch(arguments)
    from app.cli import main as query

    return query(arguments, BATCH_COMMANDS, __version__)


if __name__ == "__main__":
    raise SystemExit(main())
