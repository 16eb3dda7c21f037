"""Worker processes: a queue of requests, the computation of answers, and the replacement of failed processes.

Each worker is an executor of the standard library with a single process, so that a failing process affects a single request.
At least one worker is reserved for short requests.
"""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import os
import signal
from collections.abc import AsyncIterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import asynccontextmanager, suppress

from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response

from app import problems, worker
from app.bodies import check_counts, read_request
from app.questions import Question
from app.settings import Settings
from linkage_atlas import AtlasError, OutOfTime

SMALL = 1 << 14
"""Largest body in bytes that this process parses (in half a millisecond) to estimate if the request is long. Requests with
larger bodies count as long."""
OVERTIME = 1.2
"""Factor of the longest budget after which a worker is replaced; it has at least a second more than the budget."""
GRACE_SECONDS = 10.0
"""Time for a worker to end an answer that was cancelled."""
DIED = "the process that computed this answer has ended unexpectedly; the log of the service has details"
CHECK_SECONDS = 0.5
"""Interval between two checks that idle workers are alive."""

CONTEXT = multiprocessing.get_context(
    "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
)
log = logging.getLogger("uvicorn.error")


class Worker:
    """An executor with a single process."""

    def __init__(self, settings: Settings) -> None:
        self.cancelled = CONTEXT.RawValue("b", 0)
        self.executor = ProcessPoolExecutor(1, CONTEXT, worker.start, (settings, self.cancelled))
        self.process = 0
        self.failure: AtlasError | None = None

    async def begin(self) -> Worker:
        """Start the process and have it load the atlas."""
        started = await asyncio.to_thread(self.executor.submit, worker.ready)
        self.process, self.failure = await asyncio.wrap_future(started)
        return self

    def ask(self, path: str, content: bytes) -> asyncio.Future[Response]:
        """Submit a request; raise `BrokenProcessPool` if the process has ended."""
        self.cancelled.value = 0
        reply = asyncio.wrap_future(self.executor.submit(worker.answer, path, content))
        reply.add_done_callback(lambda done: done.cancelled() or done.exception())  # the client may have left
        return reply

    def is_alive(self) -> bool:
        """Return false if the process has ended."""
        try:
            self.executor.submit(os.getpid)
        except BrokenProcessPool:
            return False
        return True

    def end(self, wait: bool = False) -> None:
        """Kill the process, and ``wait`` for the thread that supervises it, so that it does not outlive the interpreter."""
        with suppress(ProcessLookupError):
            os.kill(self.process, signal.SIGKILL)
        self.executor.shutdown(wait=wait, cancel_futures=True)


class Workers:
    """All workers and the queue of waiting requests, which is first in, first out."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.count = settings.workers or min(max(2, os.cpu_count() or 1), 4)
        budget = settings.max_budget_ms / 1000
        self.longest = max(OVERTIME * budget, budget + 1.0)
        self.idle: list[Worker] = []
        self.waiting = {False: 0, True: 0}
        """Number of waiting short (False) and long (True) requests."""
        self._background: set[asyncio.Task[None]] = set()
        self._stopping = False

    @property
    def failure(self) -> AtlasError | None:
        """Error of loading the atlas; None if the atlas can be used."""
        return self._all[0].failure

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Start the workers, and stop them after the block."""
        self._stopping = False
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        if CONTEXT.get_start_method() == "forkserver":
            CONTEXT.set_forkserver_preload([f"{__package__}.preload"])
        self._free, self._long_free = asyncio.Semaphore(self.count), asyncio.Semaphore(max(1, self.count - 1))
        self._all = list(await asyncio.gather(*(Worker(self.settings).begin() for _ in range(self.count))))
        self.idle = list(self._all)
        if self.failure is not None:
            log.error("The atlas cannot be used: %s", self.failure)
        self._in_background(self._check())
        try:
            yield
        finally:
            self._stopping = True
            for task in self._background:
                task.cancel()
            for running in self._all:
                running.end(wait=True)

    async def answer(self, request: Request, question: Question, content: bytes) -> Response:
        """Return the reply to a body, computed by a worker; the computation ends if the client disconnects.

        Raises
        ------
        problems.Problem, OutOfTime, ClientDisconnect
            The request cannot be answered.
        FieldError
            The request is invalid.
        """
        check_counts(content)
        is_long = len(content) > SMALL or question.is_long(read_request(content, question.model))
        answer = asyncio.create_task(self._answer(question.path, content, is_long))
        leaving = asyncio.create_task(_left(request))
        try:
            await asyncio.wait((answer, leaving), return_when=asyncio.FIRST_COMPLETED)
            if not answer.done():
                raise ClientDisconnect
            return answer.result()
        except asyncio.CancelledError:  # the server ends
            raise problems.later(5, "the service is shutting down; try again later") from None
        finally:
            answer.cancel()
            leaving.cancel()

    async def _answer(self, path: str, content: bytes, is_long: bool) -> Response:
        await self._wait_for_turn(is_long)
        idle, reply = self.idle.pop(), None
        try:
            reply = idle.ask(path, content)
            return await asyncio.wait_for(asyncio.shield(reply), self.longest)
        except TimeoutError:
            raise OutOfTime from None
        except BrokenProcessPool:
            raise problems.later(1, DIED) from None
        finally:
            self._in_background(self._give_back(idle, reply, is_long))

    async def _wait_for_turn(self, is_long: bool) -> None:
        """Wait until a worker is idle; raise `problems.Problem` if too many requests are waiting."""
        limit = self.settings.max_waiting
        if self._free.locked() or (is_long and self._long_free.locked()):
            if sum(self.waiting.values()) >= limit or (is_long and self.waiting[True] >= -(-limit // 2)):
                raise problems.later(1, "too many requests are waiting; try again later")
        self.waiting[is_long] += 1
        try:
            if is_long:
                await self._long_free.acquire()
            try:
                await self._free.acquire()
            except BaseException:
                if is_long:
                    self._long_free.release()
                raise
        finally:
            self.waiting[is_long] -= 1

    async def _give_back(self, used: Worker, reply: asyncio.Future[Response] | None, is_long: bool) -> None:
        """Return a worker to the idle workers when its answer has ended; replace it if it died or does not end."""
        if reply is not None and not reply.done():
            used.cancelled.value = 1
            await asyncio.wait([reply], timeout=GRACE_SECONDS)
        if self._stopping:
            return
        if reply is None or not reply.done() or isinstance(reply.exception(), BrokenProcessPool):
            used = await self._replaced(used)
        self.idle.append(used)
        self._free.release()
        if is_long:
            self._long_free.release()

    async def _replaced(self, failed: Worker) -> Worker:
        log.error("Worker %d died or did not end its answer; it is replaced", failed.process)
        failed.end()
        replacement = await Worker(self.settings).begin()
        self._all[self._all.index(failed)] = replacement
        return replacement

    async def _check(self) -> None:
        """Replace idle workers whose process has ended."""
        while True:
            await asyncio.sleep(CHECK_SECONDS)
            for dead in [idle for idle in self.idle if not idle.is_alive()]:
                await self._free.acquire()
                if dead in self.idle:
                    self.idle.remove(dead)
                    self.idle.append(await self._replaced(dead))
                self._free.release()

    def _in_background(self, work: object) -> None:
        """Run a coroutine in the background."""
        task = asyncio.create_task(work)  # type: ignore[arg-type]
        self._background.add(task)
        task.add_done_callback(self._background.discard)


async def _left(request: Request) -> None:
    """Return when the client has disconnected."""
    while (await request.receive())["type"] != "http.disconnect":
        pass
