"""One process that computes answers: a request at a time, each bounded by the system in processor time and in memory.

It is forked from a process that has loaded everything, and shares its memory. It reads a `Task` from a socket, answers with a
`Head` and the bytes of the reply, and ends with the socket's other end, or with a request that takes more than it may: the
system ends it then, wherever it is, and another takes its place.
"""

from __future__ import annotations

import contextlib
import logging
import os
import pickle
import resource
import signal
import socket
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO, NamedTuple

from starlette.responses import Response

from app import bodies, problems
from app.computed import Question
from app.resources import ServiceResources, Unprepared, give_back_memory, take_working_memory
from app.turnstile import Attended

SHARE_OF_BUDGET = 1.2
"""Of the service's longest budget: so much processor time a request may take, with reading it and writing the reply."""
_LEAST_SECONDS = 0.5
_SHARE_OF_SEARCH = 0.8
"""Of the longest budget: so long a search goes on; the rest is for the step in which its time ends, and for finishing."""
_NICE = 2
_LOST_MEMORY = 1 << 25
"""Bytes that a request may leave behind; after more of them another process takes over."""
_LENGTH = struct.Struct(">I")


class Task(NamedTuple):
    """A body to be answered."""

    path: str
    content: bytes
    queued: float
    may_be_long: bool
    """Whether an answer may take long; one that may and must not is not begun."""


class Head(NamedTuple):
    """What comes before the bytes of a reply."""

    status: int
    headers: list[tuple[bytes, bytes]]
    size: int
    last: bool
    """Whether the process ends after this reply."""
    instead: str = ""
    """Why there is no reply yet: "long", or what must be prepared first."""


def packed(value: Task | Head | int) -> bytes:
    """A message between the two processes."""
    content = pickle.dumps(tuple(value) if isinstance(value, tuple) else value, pickle.HIGHEST_PROTOCOL)
    return _LENGTH.pack(len(content)) + content


def length_of(head: bytes) -> int:
    """Bytes of a message that begins so."""
    return int(_LENGTH.unpack(head)[0])


LENGTH_BYTES = _LENGTH.size


def processor_seconds(max_budget_ms: float) -> float:
    """Processor time after which the system ends the process."""
    return max(SHARE_OF_BUDGET * max_budget_ms / 1000, _LEAST_SECONDS)


class Computer:
    """The process itself; made in it.

    Parameters
    ----------
    connection : socket.socket
    questions : mapping
        By the path of their route.
    resources : ServiceResources
        With everything loaded.
    """

    def __init__(
        self, connection: socket.socket, questions: Mapping[str, Question], resources: ServiceResources
    ) -> None:
        self._connection, self._questions, self._resources = connection, questions, resources
        self._seconds = processor_seconds(resources.max_budget_ms)
        resources.complete = True
        resources.max_budget_ms *= _SHARE_OF_SEARCH
        for ignored in (signal.SIGINT, signal.SIGTERM):  # meant for the service; this ends with its socket
            signal.signal(ignored, signal.SIG_IGN)
        signal.signal(signal.SIGPROF, signal.SIG_DFL)
        os.nice(_NICE)  # those who talk to the clients come first
        with contextlib.suppress(OSError):
            Path("/proc/self/oom_score_adj").write_text(
                "500"
            )  # where the system lacks memory, this goes and not the service
        take_working_memory()
        self._own = _writable_bytes()
        limit = self._own + resources.settings.request_memory_bytes
        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        resource.setrlimit(resource.RLIMIT_DATA, (limit if hard < 0 else min(limit, hard), hard))

    def run(self) -> None:
        """Answer until the other end is closed."""
        self._connection.sendall(packed(os.getpid()))
        with self._connection.makefile("rb") as received, contextlib.suppress(BrokenPipeError, ConnectionResetError):
            while (task := _read(received)) is not None:
                if not self._answer(task):
                    return

    def _answer(self, task: Task) -> bool:
        """Answer a task; whether this process may go on."""
        signal.setitimer(signal.ITIMER_PROF, self._seconds)
        try:
            head, pieces = self._replied(task)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
        last = self._left_behind()
        self._connection.sendall(packed(head._replace(last=last)))
        pieces.reverse()
        while pieces:
            self._connection.sendall(pieces.pop())
        return not last

    def _replied(self, task: Task) -> tuple[Head, list[bytes]]:
        try:
            question = self._questions[task.path]
            body = bodies.read_request(task.content, question.model)
            if not task.may_be_long and question.is_long(body):
                return Head(0, [], 0, False, "long"), []
            reply = question.timed(body, Attended(self._resources, _never, task.queued))
        except Unprepared as missing:
            return Head(0, [], 0, False, str(missing)), []
        except Exception as error:
            reply = problems.reply_to(error)
            if reply.status_code == 500:
                logging.getLogger("uvicorn.error").exception("A fault in %s", task.path)
        pieces = reply.pieces if isinstance(reply, bodies.Reply) else [bytes(reply.body)]
        return Head(reply.status_code, _headers(reply), sum(map(len, pieces)), False), pieces

    def _left_behind(self) -> bool:
        """Whether a request has left more memory behind than a process may keep."""
        if _writable_bytes() <= self._own + _LOST_MEMORY:
            return False
        give_back_memory()
        return _writable_bytes() > self._own + _LOST_MEMORY


def _headers(reply: Response) -> list[tuple[bytes, bytes]]:
    return [(bytes(name), bytes(value)) for name, value in reply.raw_headers]


def _never() -> bool:
    return False  # a process whose answer is no longer wanted is ended


def _read(received: BinaryIO) -> Task | None:
    length = received.read(LENGTH_BYTES)
    if len(length) < LENGTH_BYTES:
        return None
    content = received.read(length_of(length))
    return Task(*pickle.loads(content)) if len(content) == length_of(length) else None


def _writable_bytes() -> int:
    """Memory of this process that it may write to, as its limit counts it."""
    with open("/proc/self/statm", "rb") as file:
        return int(file.read().split()[5]) * resource.getpagesize()
