"""The most memory that each largest request takes: ``python -m benchmarks.memory [--atlas FILE] [--seconds S]``.

Each is answered by a process of `linkage-atlas serve` that has answered nothing before; its memory is that which the limit
counts (`RLIMIT_DATA`), above the idle process, looked at from outside some thousand times a second.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import resource
import signal
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from benchmarks import largest, report, service

MEGABYTE = 1e6
_LOOK_SECONDS = 5e-5
_REBIRTH_SECONDS = 10.0


class Seen(NamedTuple):
    """What came of a request."""

    status: int
    reply: Any
    peak: int
    """Most bytes above the idle process, as the limit counts them: memory of its own that it may write to."""
    seconds: float


def prepared(running: service.Service) -> None:
    """Wait until a service with an atlas has prepared all that any request needs."""
    running.settle()
    rocker = largest.requests()["match: rocker"]
    running.ask("POST", rocker.path, rocker.content)
    running.settle()


def answered(running: service.Service, request: largest.Largest) -> Seen:
    """A request's answer by a process that has answered nothing before, and its memory; of a service with one worker."""
    process = _fresh(running)
    idle, most, over = _writable_bytes(process), 0, threading.Event()

    def look() -> None:
        nonlocal most
        while not over.is_set():
            most = max(most, _writable_bytes(process))
            time.sleep(_LOOK_SECONDS)

    looking = threading.Thread(target=look)
    looking.start()
    begin = time.perf_counter()
    try:
        status, body = running.ask("POST", request.path, request.content)
    finally:
        over.set()
        looking.join()
    reply = json.loads(body) if body[:1] == b"{" else body
    return Seen(status, reply, max(0, most - idle), time.perf_counter() - begin)


def _fresh(running: service.Service) -> int:
    """A new process that computes, ready, in the place of the one before."""
    before = running.processes()[2:]
    for process in before:
        os.kill(process, signal.SIGKILL)
    until = time.monotonic() + _REBIRTH_SECONDS
    while time.monotonic() < until:
        for process in set(running.processes()[2:]).difference(before):
            with contextlib.suppress(OSError):
                limits = Path(f"/proc/{process}/limits").read_text()
                if re.search(r"^Max data size\s+\d", limits, re.MULTILINE):
                    return process
        time.sleep(0.01)
    raise RuntimeError("no process took the place of the one before")


def _writable_bytes(process: int) -> int:
    """Memory of a process that it may write to, as its limit counts it; 0 where it has ended."""
    try:
        with open(f"/proc/{process}/statm", "rb") as file:
            return int(file.read().split()[5]) * resource.getpagesize()
    except (OSError, IndexError):
        return 0


def measure(
    atlas: Annotated[Path | None, "the default atlas; built anew if not given"] = None,
    seconds: Annotated[float, "budget of each search"] = 4.0,
) -> Iterator[dict[str, Any]]:
    """All of `largest.requests`, by their routes."""
    every = {name: request._replace(seconds=seconds) for name, request in largest.requests().items()}
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
                        seen = answered(running, request)
                        row = {"request": name, "route": request.path, "kilobytes": len(request.content) / 1000}
                        row |= {"status": seen.status, "seconds": seen.seconds, "megabytes": seen.peak / MEGABYTE}
                        print(row, flush=True)
                        rows.append(row)
    yield {"seconds": seconds, "requests": rows}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The table of docs/reliability.md, the largest first, and the largest of all."""
    rows = sorted(results["requests"], key=lambda row: -row["megabytes"])
    most = f"{rows[0]['megabytes']:.0f} MB"
    return report.tables("memory", {"requests": rows}) | {"most": most, "seconds": f"{results['seconds']:g} s"}


if __name__ == "__main__":
    report.run(measure)
