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
from linkage_atlas import Cancelled, Live, Work


class Turnstile:
    """Lets ``concurrent`` requests compute at a time and ``waiting`` more wait; one whose client has gone leaves.

    Requests are of two classes, short and long. One place is kept free of long ones (if there are two), and half of the room to
    wait; a free place goes to the class that has fewer places, and in turn where both have as many. Within a class the addresses
    of clients have turns; where there is no room, the one of which most wait loses its newest.
    """

    def __init__(self, concurrent: int, waiting: int) -> None:
        self.places, self._long_places = concurrent, max(1, concurrent - 1)
        self._room, self._long_room = waiting, -(-waiting // 2)
        self._queues: dict[bool, dict[str, deque[asyncio.Future[None]]]] = {False: {}, True: {}}
        self._running: dict[bool, set[asyncio.Future[None]]] = {False: set(), True: set()}
        self._last = True
        self.stopping = threading.Event()
        """Set when the service ends: all work is cancelled."""

    @property
    def computing(self) -> int:
        """Requests that compute now."""
        return sum(map(len, self._running.values()))

    @property
    def waiting(self) -> int:
        """Requests that wait for their turn."""
        return self._of_class(False) + self._of_class(True)

    def _of_class(self, long: bool) -> int:
        return sum(map(len, self._queues[long].values()))

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
        host = request.client.host if request.client else ""
        turn = self._join(long, host)
        with anyio.CancelScope() as wait:  # once it computes, a thread is not abandoned and keeps its place
            watch = asyncio.create_task(_watch(request, gone, wait))
            try:
                await turn
                return await compute(time.perf_counter() - begin, lambda: gone.is_set() or self.stopping.is_set())
            except Cancelled:
                if self.stopping.is_set() and not gone.is_set():
                    raise problems.Ending from None
                raise
            finally:
                watch.cancel()
                gone.set()  # also where the server gives the request up: the thread then ends soon
                self._leave(turn, long, host)
        raise Cancelled

    def _join(self, long: bool, host: str) -> asyncio.Future[None]:
        """A turn: done once there is a place, or refused."""
        turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        queue = self._queues[long]
        queue.setdefault(host, deque()).append(turn)
        self._call()
        if self.waiting > self._room or (long and self._of_class(long) > self._long_room):
            most = max(queue, key=lambda one: (len(queue[one]), one == host))
            refused = queue[most][-1]
            self._leave(refused, long, most)
            if not refused.done():  # its client may just have gone
                refused.set_exception(problems.Overloaded)
                refused.exception()  # it may go before it hears of it
        return turn

    def _leave(self, turn: asyncio.Future[None], long: bool, host: str) -> None:
        waiting = self._queues[long].get(host, ())
        if turn in self._running[long]:
            self._running[long].remove(turn)
            self._call()
        elif turn in waiting:
            waiting.remove(turn)
            if not waiting:
                del self._queues[long][host]

    def _call(self) -> None:
        """Give free places to those that wait."""
        while self.computing < self.places:
            may = [long for long in (False, True) if self._queues[long]]
            if len(self._running[True]) >= self._long_places:
                may = [long for long in may if not long]
            if not may:
                return
            self._last = min(may, key=lambda long: (len(self._running[long]), long == self._last))
            queue = self._queues[self._last]
            host = next(iter(queue))
            waiting = queue.pop(host)
            turn = waiting.popleft()
            if waiting:
                queue[host] = waiting  # behind the others
            self._running[self._last].add(turn)
            if not turn.done():
                turn.set_result(None)


async def _watch(request: Request, gone: threading.Event, wait: anyio.CancelScope) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        pass
    gone.set()
    wait.cancel()


class Attended:
    """Resources of one request, whose work is cancelled once the client has gone and has a budget in any case.

    ``state``: of the last answer under the request's `live`, and then of this one.
    """

    def __init__(self, resources: Any, cancelled: Callable[[], bool], queued: float, state: bytes = b"") -> None:
        self._live: Live | None = None
        self._state = state
        self._resources = resources
        self._cancelled = cancelled
        self.queued = queued

    def __getattr__(self, name: str) -> Any:
        return getattr(self._resources, name)

    def live(self) -> Live:
        """What the last answer left, and what this one leaves."""
        self._live = Live(self._state)
        return self._live

    @property
    def state(self) -> bytes:
        """That it leaves."""
        return self._state if self._live is None else self._live.state

    def work(self, budget: float | None = None) -> Work:
        """A watch that also asks whether the client is still there."""
        longest = self._resources.max_budget_ms / 1000
        return self._resources.work(longest if budget is None else min(budget, longest), self._cancelled)
