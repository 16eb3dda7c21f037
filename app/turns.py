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


class Place:
    """Where one request at a time is computed; a ``quick`` one is kept for those that are short."""

    def __init__(self, quick: bool) -> None:
        self.quick = quick
        self.fresh = True
        """Whether it takes another request after this one."""


class Turns:
    """Lets as many requests compute at a time as there are places, and ``waiting`` more wait; one whose client has gone leaves.

    Requests are of two classes, short and long: half of the room to wait is kept free of long ones. A place goes to the class
    that has fewer places, and in turn where both have as many. Within a class the addresses of clients have turns; where there
    is no room, the one of which most wait loses its newest.
    """

    def __init__(self, waiting: int) -> None:
        self._room, self._long_room = waiting, -(-waiting // 2)
        self._free: list[Place] = []
        self._queues: dict[bool, dict[str, deque[asyncio.Future[Place]]]] = {False: {}, True: {}}
        self._running = {False: 0, True: 0}
        self._last = True
        self.stopping = threading.Event()
        """Set when the service ends: all work is cancelled."""

    @property
    def computing(self) -> int:
        """Requests that compute now."""
        return sum(self._running.values())

    @property
    def waiting(self) -> int:
        """Requests that wait for their turn."""
        return self._of_class(False) + self._of_class(True)

    def _of_class(self, long: bool) -> int:
        return sum(map(len, self._queues[long].values()))

    def add(self, *places: Place) -> None:
        """Let a request compute at each place."""
        self._free += places
        self._call()

    def remove(self, place: Place) -> bool:
        """Let no further request compute at a place; whether it was free."""
        place.fresh, free = False, place in self._free
        if free:
            self._free.remove(place)
        return free

    async def turn(
        self,
        request: Request,
        compute: Callable[[Any, float, Callable[[], bool]], Awaitable[Any]],
        long: bool = False,
    ) -> Any:
        """``await compute(place, queued, cancelled)`` once there is a place; the body of ``request`` must have been read.

        ``queued``: seconds that it waited. ``cancelled``: says whether the answer is no longer wanted. Raises
        `problems.Overloaded` when too many wait already, and `linkage_atlas.Cancelled` once the client has gone: instead of
        computing, or out of it the next time that it looks at its work.
        """
        begin, gone = time.perf_counter(), threading.Event()
        host = request.client.host if request.client else ""
        turn = self._join(long, host)
        with anyio.CancelScope() as wait:  # once it computes, a thread is not abandoned and keeps its place
            watch = asyncio.create_task(_watch(request, gone, wait))
            try:
                place = await turn
                queued = time.perf_counter() - begin
                return await compute(place, queued, lambda: gone.is_set() or self.stopping.is_set())
            except Cancelled:
                if self.stopping.is_set() and not gone.is_set():
                    raise problems.Ending from None
                raise
            finally:
                watch.cancel()
                gone.set()  # also where the server gives the request up: the thread then ends soon
                self._leave(turn, long, host)
        raise Cancelled

    def _join(self, long: bool, host: str) -> asyncio.Future[Place]:
        """A turn: done once there is a place, or refused."""
        turn: asyncio.Future[Place] = asyncio.get_running_loop().create_future()
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

    def _leave(self, turn: asyncio.Future[Place], long: bool, host: str) -> None:
        waiting = self._queues[long].get(host, ())
        if turn in waiting:
            waiting.remove(turn)
            if not waiting:
                del self._queues[long][host]
        elif turn.done() and not turn.cancelled() and turn.exception() is None:
            self._running[long] -= 1
            if turn.result().fresh:
                self._free.append(turn.result())
            self._call()

    def _call(self) -> None:
        """Give free places to those that wait: a quick one, if there is one, to what is short."""
        while True:
            fit = {long: [one for one in self._free if not (long and one.quick)] for long in (False, True)}
            may = [long for long in fit if fit[long] and self._queues[long]]
            if not may:
                return
            self._last = min(may, key=lambda long: (self._running[long], long == self._last))
            queue = self._queues[self._last]
            host = next(iter(queue))
            waiting = queue.pop(host)
            turn = waiting.popleft()
            if waiting:
                queue[host] = waiting  # behind the others
            if not turn.done():
                place = max(fit[self._last], key=lambda one: one.quick)
                self._free.remove(place)
                self._running[self._last] += 1
                turn.set_result(place)


async def _watch(request: Request, gone: threading.Event, wait: anyio.CancelScope) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        pass
    gone.set()
    wait.cancel()


class Attended:
    """Resources of one request, whose work is cancelled once the client has gone and has a budget in any case."""

    def __init__(self, resources: Any, cancelled: Callable[[], bool], queued: float, state: bytes = b"") -> None:
        self._resources, self._cancelled, self.queued = resources, cancelled, queued
        self.left = Live(state)
        """By the last answer under the request's `live`, and then by this one."""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._resources, name)

    def live(self) -> Live:
        return self.left

    def work(self, budget: float | None = None) -> Work:
        """A watch that also asks whether the client is still there."""
        longest = self._resources.max_budget_ms / 1000
        return self._resources.work(longest if budget is None else min(budget, longest), self._cancelled)
