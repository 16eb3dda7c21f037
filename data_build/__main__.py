"""``python -m data_build``: the batch; without a command it builds."""

from __future__ import annotations

import sys

from data_build.cli import main

COMMANDS = ("build", "verify", "info", "-h", "--help")

if __name__ == "__main__":
    arguments = sys.argv[1:]
    if not arguments or arguments[0] not in COMMANDS:
        arguments = ["build", *arguments]
    raise SystemExit(main(arguments, prog="python -m data_build"))
