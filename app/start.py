"""Entry of the command ``linkage-atlas``: until what it needs is imported an interrupt ends the process without a word."""

from __future__ import annotations

import gc
import signal
import sys


def main() -> int:
    """Run the command of the command line; returns its exit code."""
    interrupt = signal.getsignal(signal.SIGINT)
    if interrupt is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    gc.disable()  # what is imported stays: to look through it again and again takes a tenth of the start
    from app import cli

    options = cli.parsed(sys.argv[1:])
    gc.freeze()
    gc.enable()
    if interrupt is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)
    return cli.run(options)


if __name__ == "__main__":
    raise SystemExit(main())
