"""A line on the terminal that says that a command still works, for whatever takes longer than a second."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

DELAY = 1.0
"""Seconds before a line appears: most answers are there sooner."""
STEP = 0.2
"""Seconds between two drawings."""


@contextmanager
def waiting(words: str, most: float | None = None) -> Iterator[None]:
    """Show words and seconds on standard error while the block runs, of at most so many; only on a terminal.

    A thread draws: what computes need not know of it.
    """
    if sys.stderr is None or not sys.stderr.isatty():
        yield
        return
    limit = "" if most is None else f" of at most {most:g}"
    done = threading.Event()

    def draw() -> None:
        if done.wait(DELAY):
            return
        from tqdm import tqdm

        with tqdm(
            file=sys.stderr, leave=False, bar_format=f"{words}: {{postfix[0]:.0f}} s{limit}", postfix=[DELAY]
        ) as bar:
            while not done.wait(STEP):
                bar.postfix[0] += STEP
                bar.refresh()

    drawing = threading.Thread(target=draw, daemon=True)
    drawing.start()
    try:
        yield
    finally:
        done.set()
        drawing.join()
