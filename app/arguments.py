"""Arguments that several commands have: the atlas, and numbers with their range."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

FILE: dict[str, str] = {}
"""What completes the name of a file in each shell: shtab's, once it is asked for a completion."""


def add_atlas(parser: Any, what: str = "the atlas") -> None:
    """Add ``--atlas`` to a parser or a group of arguments."""
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
