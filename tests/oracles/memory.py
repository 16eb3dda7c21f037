"""The memory of one request, looked at from outside: of a service of `linkage-atlas serve` with one worker."""

from __future__ import annotations

import contextlib
import json
import os
import re
import resource
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from tests.oracles.largest import Largest

_LOOK_SECONDS = 5e-5
_RESTART_SECONDS = 10.0
Ask = Callable[[str, bytes], tuple[int, bytes]]
"""``ask(path, body)`` gives status and reply."""


class Seen(NamedTuple):
    """What came of a request."""

    status: int
    reply: Any
    peak: int
    """Most bytes above the idle process, as the limit counts them: memory of its own that it may write to."""
    seconds: float


def answered(service: int, ask: Ask, request: Largest, every: float = _LOOK_SECONDS) -> Seen:
    """A request's answer by a process that has answered nothing before, and its memory.

    Parameters
    ----------
    service : int
        The number of its first process.
    ask : callable
    request : Largest
    every : float
        Seconds from look to look.
    """
    process = _fresh(service)
    idle, most, over = _writable_bytes(process), 0, threading.Event()

    def look() -> None:
        nonlocal most
        while not over.is_set():
            most = max(most, _writable_bytes(process))
            time.sleep(every)

    looking = threading.Thread(target=look)
    looking.start()
    begin = time.perf_counter()
    try:
        status, body = ask(request.path, request.content)
    finally:
        over.set()
        looking.join()
    reply = json.loads(body) if body[:1] == b"{" else body
    return Seen(status, reply, max(0, most - idle), time.perf_counter() - begin)


def _fresh(service: int) -> int:
    """A new process that computes, ready, in the place of the one before."""
    before = _computing(service)
    for process in before:
        os.kill(process, signal.SIGKILL)
    until = time.monotonic() + _RESTART_SECONDS
    while time.monotonic() < until:
        for process in set(_computing(service)).difference(before):
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


def _computing(service: int) -> list[int]:
    """Its processes that compute: all but the first child, which talks to the clients."""
    return list(map(int, Path(f"/proc/{service}/task/{service}/children").read_text().split()))[1:]
