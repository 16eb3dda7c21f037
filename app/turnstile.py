"""Turns of requests that compute: short ones do not wait for long ones, and a client that disconnects cancels its work."""

from __future__ import annotations

import asyncio
import threading
import time
from collections import deque
from collections.abc import Awaitable, Callable
from typing import Any

import anyio
from starlette.requests import Request

from app import problems
from linkage_atlas import Cancelled, Work


class Turnstile:
    """Lets ``concurrent`` requests compute at a time and ``waiting`` more wait; one whose client has gone leaves.

    Requests are of two classes, short and long. One place is kept free of long ones (if there are two), and half of the room to
    wait; a free place goes to the class that has fewer places, and in turn where both have as many.
    """

    def __init__(self, concurrent: int, waiting: int) -> None:
        self.places, self._long_places = concurrent, max(1, concurrent - 1)
        self._room, self._long_room = waiting, -(-waiting // 2)
        self._queues: dict[bool, deque[asyncio.Future[None]]] = {False: deque(), True: deque()}
        self._running = {False: 0, True: 0}
        self._last = True
        self._stopping = threading.Event()

    @property
    def computing(self) -> int:
        """Requests that compute now."""
        return sum(self._running.values())

    @property
    def waiting(self) -> int:
        """Requests that wait for their turn."""
        return sum(map(len, self._queues.values()))

    @property
    def stopping(self) -> bool:
        """Whether the service ends."""
        return self._stopping.is_set()

    def start(self) -> None:
        """Let requests in: the service begins, perhaps not for the first time."""
        self._stopping.clear()

    def stop(self) -> None:
        """Cancel all work: the service ends."""
        self._stopping.set()

    async def turn(
        self,
        request: Request,
        compute: Callable[[float, Callable[[], bool]], Awaitable[Any]],
        long: bool = False,
    ) -> Any:
        """``await compute(queued, cancelled)`` once there is a place; the body of ``request`` must have been read.

        It is given the seconds that it waited and what says whether the answer is no longer wanted. Raises
        `problems.Overloaded` when too many wait already, and `linkage_atlas.Cancelled` once the client has gone: instead of
        computing, or out of it the next time that it looks at its work.
        """
        begin, gone = time.perf_counter(), threading.Event()
        turn = self._join(long)
        with anyio.CancelScope() as wait:  # once it computes, a thread is not abandoned and keeps its place
            watch = asyncio.create_task(_watch(request, gone, wait))
            try:
                await turn
                return await compute(time.perf_counter() - begin, lambda: gone.is_set() or self.stopping)
            except Cancelled:
                if self.stopping and not gone.is_set():
                    raise problems.Ending from None
                raise
            finally:
                watch.cancel()
                gone.set()  # also where the server gives the request up: the thread then ends soon
                self._leave(turn, long)
        raise Cancelled

    def _join(self, long: bool) -> asyncio.Future[None]:
        """A turn: done once there is a place."""
        turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._queues[long].append(turn)
        self._call()
        if not turn.done() and (self.waiting > self._room or (long and len(self._queues[long]) > self._long_room)):
            self._queues[long].remove(turn)
            raise problems.Overloaded
        return turn

    def _leave(self, turn: asyncio.Future[None], long: bool) -> None:
        if turn in self._queues[long]:
            self._queues[long].remove(turn)
        else:
            self._running[long] -= 1
            self._call()

    def _call(self) -> None:
        """Give free places to those that wait."""
        while self.computing < self.places:
            may = [long for long in (False, True) if self._queues[long]]
            if self._running[True] >= self._long_places:
                may = [long for long in may if not long]
            if not may:
                return
            self._last = min(may, key=lambda long: (self._running[long], long == self._last))
            self._running[self._last] += 1
            turn = self._queues[self._last].popleft()
            if not turn.done():
                turn.set_result(None)


async def _watch(request: Request, gone: threading.Event, wait: anyio.CancelScope) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        pass
    gone.set()
    wait.cancel()


class Attended:
    """Resources of one request, whose work is cancelled once the client has gone and has a budget in any case."""

    def __init__(self, resources: Any, cancelled: Callable[[], bool], queued: float) -> None:
        self._resources = resources
        self._cancelled = cancelled
        self.queued = queued

    def __getattr__(self, name: str) -> Any:
        return getattr(self._resources, name)

    def work(self, budget: float | None = None) -> Work:
        """A watch that also asks whether the client is still there."""
        longest = self._resources.max_budget_ms / 1000
        return self._resources.work(longest if budget is None else min(budget, longest), self._cancelled)
