"""The most memory that each largest request takes: ``python -m benchmarks.memory [--atlas FILE] [--seconds S]``.

Each is answered by a process of `linkage-atlas serve` that has answered nothing before; its memory is that which the limit
counts (`RLIMIT_DATA`), above the idle process, looked at from outside some thousand times a second.
"""

from __future__ import annotations

import functools
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from benchmarks import report, service
from tests.oracles.largest import requests
from tests.oracles.memory import answered

MEGABYTE = 1e6


def prepared(running: service.Service) -> None:
    """Wait until a service with an atlas has prepared all that any request needs."""
    running.settle()
    rocker = requests()["match: rocker"]
    running.ask("POST", rocker.path, rocker.content)
    running.settle()


def measure(
    atlas: Annotated[Path | None, "the default atlas; built anew if not given"] = None,
    seconds: Annotated[float, "budget of each search"] = 4.0,
) -> Iterator[dict[str, Any]]:
    """All of `tests.oracles.largest`, by their routes."""
    every = {name: request._replace(seconds=seconds) for name, request in requests().items()}
    with tempfile.TemporaryDirectory() as folder:
        if atlas is None:
            atlas = Path(folder) / "atlas.h5"
            service.build(atlas)
        rows: list[dict[str, Any]] = []
        for needs, settings in ((False, {"with_atlas": False}), (True, {"atlas": atlas})):
            with service.running(service.serve_command, workers=1, **settings) as running:
                if needs:
                    prepared(running)
                for name, request in every.items():
                    if request.atlas is needs:
                        seen = answered(running.process.pid, functools.partial(running.ask, "POST"), request)
                        row = {"request": name, "route": request.path, "kilobytes": len(request.content) / 1000}
                        row |= {"status": seen.status, "seconds": seen.seconds, "megabytes": seen.peak / MEGABYTE}
                        print(row, flush=True)
                        rows.append(row)
    yield {"seconds": seconds, "requests": rows}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The largest of docs/reliability.md, and the budget of each search."""
    most = max(row["megabytes"] for row in results["requests"])
    return {"most": f"{most:.0f} MB", "seconds": f"{results['seconds']:g} s"}


if __name__ == "__main__":
    report.run(measure)
