"""Writes `good.toml`: the objective that a good answer to each everyday question has at most within the practical limits.

``python -m benchmarks.good`` asks for each without a budget, and allows a quarter more than the answer.
"""

from __future__ import annotations

import math
from pathlib import Path

from benchmarks.battery import rows
from benchmarks.everyday import ask
from benchmarks.service import running, serve_command

ABOVE = 1.25
SMALLEST = 1e-9


def rounded_up(value: float) -> str:
    """Two digits."""
    size = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / size) * size:.1e}"


def main() -> None:
    """Ask, and write."""
    lines = ["# J of a good answer within the practical limits; written by `python -m benchmarks.good`"]
    with running(serve_command) as service:
        for row in rows():
            found = ask(service, row, "preset", None)
            lines.append(f'"{row.name}" = {rounded_up(max(SMALLEST, ABOVE * found.error))}')
    (Path(__file__).parent / "good.toml").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
