"""The processes that compute, seen from the one that talks to the clients: who is free, and what becomes of a request.

A process belongs to one request at a time. Where the client leaves, where the service ends, or where the answer does not come,
it is ended with its request, and the supervisor forks another in its place.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import pickle
import signal
import socket
import struct
from collections import Counter
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any, NamedTuple

import anyio
from starlette.requests import Request
from starlette.responses import Response

from app import bodies, problems
from app.bodies import Held, Reply
from app.computed import SMALL, Question, live_of
from app.computer import Head, Task, processor_seconds
from app.live import Lives
from app.resources import INDEX
from app.settings import Settings
from app.supervisor import MAKE
from app.turns import Place, Turns
from linkage_atlas import OutOfTime

_BUFFER = 1 << 20
_MESSAGE = 1 << 12
_LENGTH = struct.Struct("!i")
"""Before each message of `multiprocessing.connection`."""
_TOLD_SECONDS = 5.0
"""For the supervisor to say how a process ended."""
_SHORT_SECONDS = 0.2
"""For a short answer whose client has left: most end sooner than another process begins."""
_PATIENCE = 8.0
"""Times the processor time that a request may take: longer no answer is waited for, on however busy a machine."""
log = logging.getLogger("uvicorn.error")


class _Process(Place):
    """A process that computes; fresh while it shares all that the supervisor has loaded."""

    def __init__(self, number: int, connection: socket.socket, quick: bool) -> None:
        super().__init__(quick)
        self.number, self._socket = number, connection
        self._streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None
        self.end: asyncio.Future[str] = asyncio.get_running_loop().create_future()

    async def ask(self, task: Task) -> tuple[Head, list[bytes], Held]:
        """The reply to a task; one for which there is no memory is not read, and its process is at its end."""
        self._streams = self._streams or await asyncio.open_unix_connection(sock=self._socket, limit=_BUFFER)
        reader, writer = self._streams
        content = pickle.dumps(tuple(task), pickle.HIGHEST_PROTOCOL)
        writer.write(_LENGTH.pack(len(content)) + content)
        head, pieces = Head(*pickle.loads(await _message(reader))), []
        held, left = Held(head.size), head.size
        while left:
            pieces.append(await _message(reader))
            left -= len(pieces[-1])
        return head, pieces, held

    def kill(self) -> None:
        """End it, from any thread: who waits for its answer sees that."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.number, signal.SIGKILL)

    def close(self) -> None:
        """End it, and the connection to it."""
        self.kill()
        if self._streams is None:
            self._socket.close()
        else:
            self._streams[1].close()


class _Making(NamedTuple):
    """A part of the index that is being made: set once somebody does, and once it is there."""

    begun: asyncio.Event
    made: asyncio.Event


async def _message(reader: asyncio.StreamReader) -> bytes:
    return await reader.readexactly(*_LENGTH.unpack(await reader.readexactly(_LENGTH.size)))


def _ending(code: int) -> str:
    """How a process ended: the name of a signal, or its exit code."""
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"


class Processes:
    """Answers computed by processes, places in which requests have turns; as `app.computed.Computing` describes."""

    supervisor: socket.socket
    """Set before `running`: where the supervisor tells of processes and of parts of the index."""

    def __init__(self, turns: Turns, settings: Settings) -> None:
        self._turns = turns
        self._seconds = processor_seconds(settings.max_budget_ms)
        self.alive: dict[int, _Process] = {}
        self.preparing: dict[str, _Making] = {}
        self._patient, self._room = 0, settings.max_waiting
        self.ends: Counter[str] = Counter()

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        self._begun, self._lives = asyncio.Event(), Lives()
        loop = asyncio.get_running_loop()
        loop.add_reader(self.supervisor, self._listen)
        await self._begun.wait()
        try:
            yield
        finally:
            self.stop()
            loop.remove_reader(self.supervisor)

    def stop(self) -> None:
        self._turns.stopping.set()
        for process in list(self.alive.values()):
            process.kill()

    async def answer(self, request: Request, question: Question, content: bytes) -> Response:
        bodies.check_counts(content)
        # a larger one is read by those who compute, and goes on from nothing
        body = None if len(content) > SMALL else bodies.read_request(content, question.model)
        long = body is None or question.is_long(body)
        async with self._lives.turn(None if body is None else live_of(body)) as kept:
            task, waited = Task(question.path, content, 0.0, False, state=kept.state), set[str]()
            head, *reply = await self._asked(request, task, long, kept.begin)
            kept.state = head.state
        while not head.status and not task.makes:
            task = task._replace(makes=head.missing in waited)  # it could not be made
            if head.missing == INDEX or not task.makes:
                await self._made(head.missing)
            waited.add(head.missing)
            head, *reply = await self._asked(request, task, long)
        if not head.status:
            raise problems.Died
        return Reply.relayed(head.status, head.headers, *reply)

    async def _asked(
        self, request: Request, task: Task, long: bool, begin: Callable[[], None] = lambda: None
    ) -> tuple[Head, list[bytes], Held]:
        async def compute(process: _Process, queued: float, _: Any) -> tuple[Head, list[bytes], Held]:
            begin()
            kept, loop = False, asyncio.get_running_loop()
            try:
                with anyio.CancelScope(shield=not long) as stays:
                    loop.call_later(_SHORT_SECONDS, setattr, stays, "shield", False)
                    async with asyncio.timeout(_PATIENCE * self._seconds):
                        crowded = self._turns.waiting > 0
                        reply = await process.ask(task._replace(queued=queued, crowded=crowded))
                if process.fresh and reply[0].missing == INDEX:
                    self._wish(INDEX)  # whoever was making it has ended
                kept = process.fresh and not reply[0].last
                return reply
            except TimeoutError:
                raise OutOfTime from None
            except (asyncio.IncompleteReadError, ConnectionError):
                how = await self._how(process, task.path)
                if how == signal.SIGBUS.name:  # a file of the index cannot be read
                    return Head(0, [], 0, True, INDEX), [], Held(0)
                raise OutOfTime if how == signal.SIGPROF.name else problems.Died from None
            finally:
                if not kept:
                    self._end(process)

        return await self._turns.turn(request, compute, long)  # type: ignore[no-any-return]

    def _end(self, process: _Process) -> None:
        self.alive.pop(process.number, None)
        self._turns.remove(process)
        process.close()

    async def _how(self, process: _Process, path: str) -> str:
        """How a process ended before its answer; raises `problems.Ending`."""
        if self._turns.stopping.is_set():
            raise problems.Ending
        try:
            how = await asyncio.wait_for(process.end, _TOLD_SECONDS)
        except TimeoutError:
            return "unknown"
        if how != signal.SIGPROF.name:
            log.error("A process that computed an answer of %s ended by %s; another takes its place", path, how)
        return how

    def _wish(self, part: str) -> _Making:
        """Have a part of the index made, unless it is being made."""
        if part not in self.preparing:
            self.preparing[part] = _Making(asyncio.Event(), asyncio.Event())
            os.kill(os.getppid(), MAKE[part])
        return self.preparing[part]

    async def _made(self, part: str) -> None:
        """Have a part of the index made, which all processes then find; of a damaged index only wait until all do without it.

        Raises `problems.Overloaded`.
        """
        if self._patient >= self._room:  # each holds its body
            raise problems.Overloaded
        making = self._wish(part)
        self._patient += 1
        try:
            await (making.begun if part == INDEX else making.made).wait()
        finally:
            self._patient -= 1

    def _listen(self) -> None:
        """Take what the supervisor says."""
        told, files, _, _ = socket.recv_fds(self.supervisor, _MESSAGE, 1)
        match pickle.loads(told) if told else ():
            case ("computer", number, quick):
                process = self.alive[number] = _Process(number, socket.socket(fileno=files[0]), quick)
                self._turns.add(process)
                self._begun.set()
            case ("ended", number, code):
                self.ends[_ending(code)] += 1
                if process := self.alive.pop(number, None):
                    process.end.set_result(_ending(code))
                    if self._turns.remove(process):
                        process.close()
            case ("fresh",):
                for process in list(self.alive.values()):
                    if self._turns.remove(process):
                        self._end(process)
            case ("making", part):
                self.preparing.setdefault(part, _Making(asyncio.Event(), asyncio.Event())).begun.set()
            case ("made", part):
                self.preparing.pop(part).made.set()
            case _:
                os.kill(os.getpid(), signal.SIGTERM)  # it has ended: nothing works without it
                asyncio.get_running_loop().remove_reader(self.supervisor)
