"""One process that computes answers: a request at a time, each bounded by the system in processor time and in memory.

It is forked from a process that has loaded everything, and shares its memory. It reads a `Task` from a socket, answers with a
`Head` and the bytes of the reply in pieces, each a message of `multiprocessing.connection`, and ends with the socket's other
end, or with a request that takes more than it may: the system ends it then, wherever it is, and another takes its place.
"""

from __future__ import annotations

import contextlib
import logging
import os
import resource
import signal
import socket
import time
from collections.abc import Mapping
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

from app import bodies, problems
from app.computed import Question
from app.resources import ServiceResources, Unprepared, give_back_memory, take_working_memory
from app.turns import Attended

SHARE_OF_BUDGET = 1.2
"""Of the service's longest budget: so much processor time a request may take, with reading it and writing the reply."""
_LEAST_SECONDS = 0.5
_SHARE_OF_SEARCH = 0.8
"""Of the longest budget: so long a search goes on; the rest is for the step in which its time ends, and for finishing."""
_NICE_QUICK, _NICE, _NICE_IN_CROWD = 2, 5, 15
"""How far processes stand back from those that talk to the clients: the quick one a little, others behind it, and further while
requests wait: then short ones have their answers sooner. Where none does, other work on the machine is no reason to wait."""
_LOST_MEMORY = 1 << 25
"""Bytes that a request may leave behind; after more of them another process takes over."""


class Task(NamedTuple):
    """A body to be answered."""

    path: str
    content: bytes
    queued: float
    makes: bool
    """Whether a part of the index that is missing may be made for this answer alone."""
    crowded: bool = False
    """Whether other requests wait."""
    state: bytes = b""
    """What the last answer under the body's `live` left."""


class Head(NamedTuple):
    """What comes before the bytes of a reply."""

    status: int
    headers: list[tuple[bytes, bytes]]
    size: int
    last: bool
    """Whether the process ends after this reply."""
    missing: str = ""
    """The part of the index that must be made first, where there is no reply; `INDEX` beside one that did without."""
    state: bytes = b""
    """What this answer leaves for the next under its `live`."""


def processor_seconds(max_budget_ms: float) -> float:
    """Processor time after which the system ends the process."""
    return max(SHARE_OF_BUDGET * max_budget_ms / 1000, _LEAST_SECONDS)


class Computer:
    """The process itself, made in it; a ``quick`` one is never given a long request, and goes before those that are."""

    def __init__(
        self, connection: socket.socket, questions: Mapping[str, Question], resources: ServiceResources, quick: bool
    ) -> None:
        self._socket, self._questions, self._resources = connection, questions, resources
        self._may_stand_back, self._back = not quick, False
        self._seconds = processor_seconds(resources.max_budget_ms)
        resources.alone = True
        resources.max_budget_ms *= _SHARE_OF_SEARCH
        for ignored in (signal.SIGINT, signal.SIGTERM):  # meant for the service; this ends with its socket
            signal.signal(ignored, signal.SIG_IGN)
        signal.signal(signal.SIGPROF, signal.SIG_DFL)
        os.nice(_NICE_QUICK if quick else _NICE)
        with contextlib.suppress(OSError):
            # where the system lacks memory, this goes and not the service
            Path("/proc/self/oom_score_adj").write_text("500")
        take_working_memory()
        self._own = _writable_bytes()
        limit = self._own + resources.settings.request_memory_bytes
        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        resource.setrlimit(resource.RLIMIT_DATA, (limit if hard < 0 else min(limit, hard), hard))

    def run(self) -> None:
        """Answer until the other end is closed."""
        connection, last = Connection(self._socket.detach()), False
        with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
            while not last:
                task = Task(*connection.recv())
                if task.crowded and self._may_stand_back:
                    os.nice(_NICE_IN_CROWD - _NICE)
                    self._may_stand_back, self._back = False, True
                signal.setitimer(signal.ITIMER_PROF, self._seconds)
                head, pieces = self._replied(task)
                signal.setitimer(signal.ITIMER_PROF, 0)
                # who stands back never comes forward again: another takes its place
                last = self._left_behind() or (self._back and not task.crowded)
                connection.send(tuple(head._replace(last=last)))
                pieces.reverse()
                while pieces:
                    connection.send_bytes(pieces.pop())
                if head.size > bodies.PIECE_BYTES:
                    give_back_memory()

    def _replied(self, task: Task) -> tuple[Head, list[bytes]]:
        self._resources.makes = task.makes
        self._resources.look()
        attended, begin = Attended(self._resources, lambda: False, task.queued, task.state), time.perf_counter()
        try:
            question = self._questions[task.path]
            body = bodies.read_request(task.content, question.model)
            reply = question.timed(body, attended)
        except Unprepared as missing:
            return Head(0, [], 0, False, str(missing)), []
        except Exception as error:
            reply = problems.told(error, task.path, len(task.content), task.queued + time.perf_counter() - begin)
            if reply.status_code == 500:
                logging.getLogger("uvicorn.error").exception("A fault in %s", task.path)
        pieces = reply.pieces if isinstance(reply, bodies.Reply) else [bytes(reply.body)]
        size, missing = sum(map(len, pieces)), self._resources.missing_index
        return Head(reply.status_code, list(reply.raw_headers), size, False, missing, attended.left.state), pieces

    def _left_behind(self) -> bool:
        """Whether a request has left more memory behind than a process may keep."""
        if _writable_bytes() <= self._own + _LOST_MEMORY:
            return False
        give_back_memory()
        return _writable_bytes() > self._own + _LOST_MEMORY


def _writable_bytes() -> int:
    """Memory of this process that it may write to, as its limit counts it."""
    with open("/proc/self/statm", "rb") as file:
        return int(file.read().split()[5]) * resource.getpagesize()
