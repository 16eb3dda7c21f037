"""``python -m data_build``: run the batch job; the default command is ``build``."""

from __future__ import annotations

import signal
import sys

interrupt = signal.getsignal(signal.SIGINT)
if interrupt is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # no traceback if an import is interrupted

from data_build.batch import main  # noqa: E402

signal.signal(signal.SIGINT, interrupt)

COMMANDS = ("build", "verify", "info", "-h", "--help")

if __name__ == "__main__":
    arguments = sys.argv[1:]
    if not arguments or arguments[0] not in COMMANDS:
        arguments = ["build", *arguments]
    raise SystemExit(main(arguments, prog=f"python -m {__package__}"))
