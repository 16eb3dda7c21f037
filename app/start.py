"""Entry point of the command ``linkage-atlas``: an interrupt while modules are imported ends it without a traceback."""

from __future__ import annotations

import signal
import sys


def main() -> int:
    """Run the command line and return its exit code."""
    interrupt = signal.getsignal(signal.SIGINT)
    if interrupt is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from app import cli

    options = cli.parsed(sys.argv[1:])
    if interrupt is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)
    return cli.run(options)


if __name__ == "__main__":
    raise SystemExit(main())
