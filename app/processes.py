"""The processes that compute, seen from the one that talks to the clients: who is free, who has ended, who takes its place.

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
from collections import Counter
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager
from typing import Any

from starlette.requests import Request
from starlette.responses import Response

from app import bodies, problems
from app.bodies import PIECE_BYTES, Held, Reply
from app.computed import SMALL, Question
from app.computer import LENGTH_BYTES, Head, Task, length_of, packed, processor_seconds
from app.settings import Settings
from app.turnstile import Turnstile
from linkage_atlas import OutOfTime

_BUFFER = 1 << 20
_REBIRTH_SECONDS = 0.2
_TOLD_SECONDS = 5.0
"""For the supervisor to say how a process ended."""
_ATTEMPTS = 3
"""Once to see that an answer may take long, once to see that something is to be prepared, once to answer."""
_PATIENCE = 8.0
"""Times the processor time that a request may take: longer no answer is waited for, on however busy a machine."""
log = logging.getLogger("uvicorn.error")


class _Process:
    """A process that computes."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, number: int, age: int) -> None:
        self.reader, self.writer, self.number, self.age = reader, writer, number, age
        self.asked = False
        self.status: asyncio.Future[int] = asyncio.get_running_loop().create_future()

    async def message(self) -> Any:
        return await message_of(self.reader)

    async def ask(self, task: Task) -> tuple[Head, list[bytes], Held]:
        """The reply to a task; one for which there is no memory is not read, and its process is at its end."""
        self.writer.write(packed(task))
        head, pieces = Head(*await self.message()), []
        held = Held(head.size)
        left = head.size
        while left:
            pieces.append(await self.reader.readexactly(min(left, PIECE_BYTES)))
            left -= len(pieces[-1])
        return head, pieces, held

    def kill(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.number, signal.SIGKILL)


def _ending(status: int) -> str:
    """How a process ended: the name of a signal, or its exit code."""
    code = os.waitstatus_to_exitcode(status)
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"


async def message_of(reader: asyncio.StreamReader) -> Any:
    """The next message that `app.computer.packed` made."""
    return pickle.loads(await reader.readexactly(length_of(await reader.readexactly(LENGTH_BYTES))))


class Processes:
    """Answers computed by processes of their own; as `app.computed.Computing` describes.

    Parameters
    ----------
    turnstile : Turnstile
        Lets as many compute at a time as there are processes.
    settings : Settings
    count : int

    Attributes
    ----------
    supervisor : socket.socket
        Set before `running`. Each message to it is one byte: "c" with a socket asks for a process at its other end, "r" to
        prepare for rockers, "p" for positions. It says who has ended (number, status), and that it has prepared more, which new
        processes then share.
    """

    supervisor: socket.socket

    def __init__(self, turnstile: Turnstile, settings: Settings, count: int) -> None:
        self._turnstile, self._count = turnstile, count
        self._seconds = processor_seconds(settings.max_budget_ms)
        self._age = 0
        self._alive: dict[int, _Process] = {}
        self.ends: Counter[str] = Counter()
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def numbers(self) -> Iterable[int]:
        """Of those that compute."""
        return tuple(self._alive)

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        self._free: asyncio.LifoQueue[_Process] = asyncio.LifoQueue()
        self._older = asyncio.Condition()
        self._told, self._teller = await asyncio.open_unix_connection(sock=self.supervisor)
        listening = asyncio.create_task(self._listen())
        await asyncio.gather(*(self._bear() for _ in range(self._count)))
        try:
            yield
        finally:
            self.stop()
            listening.cancel()
            self._teller.close()

    def stop(self) -> None:
        self._turnstile.stop()
        for process in list(self._alive.values()):
            process.kill()

    async def answer(self, request: Request, question: Question, content: bytes) -> Response:
        long = False
        if len(content) <= SMALL:
            long = question.is_long(bodies.read_request(content, question.model))
        else:
            bodies.check_counts(content)
        for _ in range(_ATTEMPTS):
            head, *reply = await self._asked(request, question.path, content, long)
            if not head.instead:
                return Reply.relayed(head.status, head.headers, *reply)
            if head.instead == "long":  # the body was too large to be looked at here
                long = True
            else:
                await self._prepared(head.instead)
        raise problems.Died  # what it needs could not be prepared

    async def _asked(self, request: Request, path: str, content: bytes, long: bool) -> tuple[Head, list[bytes], Held]:
        async def compute(queued: float, _: Any) -> tuple[Head, list[bytes], Held]:
            process, kept = await self._next(), False
            process.asked = True
            try:
                async with asyncio.timeout(_PATIENCE * self._seconds):
                    reply = await process.ask(Task(path, content, queued, long))
                kept = not reply[0].last and process.age == self._age
                return reply
            except TimeoutError:
                raise OutOfTime from None
            except (asyncio.IncompleteReadError, ConnectionError):
                raise await self._why(process, path) from None
            finally:
                process.asked = False
                if kept:
                    self._free.put_nowait(process)
                else:
                    self._replace(process)

        return await self._turnstile.turn(request, compute, long)  # type: ignore[no-any-return]

    async def _why(self, process: _Process, path: str) -> Exception:
        """What is to be said of a process that ended before its answer."""
        if self._turnstile.stopping:
            return problems.Ending()
        try:
            how = _ending(await asyncio.wait_for(process.status, _TOLD_SECONDS))
        except TimeoutError:
            return problems.Died()
        if how == signal.SIGPROF.name:
            return OutOfTime()
        log.error("A process that computed an answer of %s ended by %s; another takes its place", path, how)
        return problems.Died()

    # -- processes that come and go ---------------------------------------------------------------------------------------

    def _replace(self, process: _Process) -> None:
        self._alive.pop(process.number, None)
        process.kill()
        process.writer.close()
        if not self._turnstile.stopping:
            task = asyncio.create_task(self._bear())
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def _bear(self) -> None:
        """Have a process forked; it is free once it has said its number."""
        while not self._turnstile.stopping:
            ours, other = socket.socketpair()
            with other:
                age = self._age
                socket.send_fds(self.supervisor, [b"c"], [other.fileno()])
            reader, writer = await asyncio.open_unix_connection(sock=ours, limit=_BUFFER)
            try:
                process = _Process(reader, writer, int(await message_of(reader)), age)
            except (asyncio.IncompleteReadError, ConnectionError):  # ended before it had begun
                writer.close()
                await asyncio.sleep(_REBIRTH_SECONDS)
                continue
            if age == self._age:
                self._alive[process.number] = process
                self._free.put_nowait(process)
                return
            process.kill()  # forked before more was prepared
            writer.close()

    async def _next(self) -> _Process:
        while (process := await self._free.get()).status.done():
            pass  # it ended while it had nothing to do, and has been replaced
        return process

    async def _listen(self) -> None:
        """Take what the supervisor says."""
        try:
            while True:
                match await message_of(self._told):
                    case ("ended", number, status):
                        self.ends[_ending(status)] += 1
                        process = self._alive.get(number)
                        if process is not None:
                            process.status.set_result(status)
                            if not process.asked:
                                self._replace(process)
                    case ("prepared",):
                        await self._renew()
        except (asyncio.IncompleteReadError, ConnectionError):
            os.kill(os.getpid(), signal.SIGTERM)  # nothing works without it

    async def _renew(self) -> None:
        self._age += 1
        while not self._free.empty():
            process = self._free.get_nowait()
            if not process.status.done():  # else it has been replaced already
                self._replace(process)
        async with self._older:
            self._older.notify_all()

    async def _prepared(self, what: str) -> None:
        """Have something prepared by the supervisor, for all processes from then on."""
        async with self._older:
            socket.send_fds(self.supervisor, [what[:1].encode()], [])
            await self._older.wait()
