"""Admission of requests: some compute, some wait, the others are refused; a client that disconnects cancels its work."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Any

import anyio
import anyio.to_thread
from fastapi import Request

from app import problems
from app.query import Resources
from linkage_atlas import Cancelled, Work


class Turnstile:
    """Lets ``concurrent`` requests compute at a time and ``waiting`` more wait; one whose client has gone leaves."""

    def __init__(self, concurrent: int, waiting: int) -> None:
        self._limiter = anyio.CapacityLimiter(concurrent)
        self._most = concurrent + waiting
        self._inside = 0

    @property
    def computing(self) -> int:
        """Requests that compute now."""
        return self._limiter.borrowed_tokens

    @property
    def waiting(self) -> int:
        """Requests that wait for their turn."""
        return self._limiter.statistics().tasks_waiting

    async def run(
        self, request: Request, function: Callable[[Any, Resources], Any], body: Any, resources: Resources
    ) -> Any:
        """``function(body, resources)`` on a worker thread; the body of ``request`` must have been read.

        Raises `problems.Overloaded` when too many wait already, and `linkage_atlas.Cancelled` once the client has gone:
        instead of the function, or out of it the next time that it looks at its work.
        """
        # Counted here and not asked of the limiter, which a request joins only after it has let others run: of many that
        # come at once each would see an empty queue.
        if self._inside >= self._most:
            raise problems.Overloaded
        self._inside += 1
        try:
            return await self._attend(request, function, body, resources)
        finally:
            self._inside -= 1

    async def _attend(
        self, request: Request, function: Callable[[Any, Resources], Any], body: Any, resources: Resources
    ) -> Any:
        gone = threading.Event()
        with anyio.CancelScope() as wait:  # for a turn: once there, a thread is not abandoned and keeps its place
            watch = asyncio.create_task(_watch(request, gone, wait))
            try:
                return await anyio.to_thread.run_sync(
                    function, body, _Attended(resources, gone), limiter=self._limiter
                )
            finally:
                watch.cancel()
                gone.set()  # also where the server gives the request up: the thread then ends soon
        raise Cancelled


async def _watch(request: Request, gone: threading.Event, wait: anyio.CancelScope) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        pass
    gone.set()
    wait.cancel()


class _Attended:
    """Resources of one request, whose work is cancelled once the client has gone."""

    def __init__(self, resources: Any, gone: threading.Event) -> None:
        self._resources = resources
        self._gone = gone

    def __getattr__(self, name: str) -> Any:
        return getattr(self._resources, name)

    def work(self, budget: float | None = None) -> Work:
        """A watch that also asks whether the client is still there."""
        return self._resources.work(budget, self._gone.is_set)
