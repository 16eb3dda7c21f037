"""Routes whose answers are computed: by threads of this process, or, under `linkage-atlas serve`, by processes of their own."""

from __future__ import annotations

import asyncio
import os
import threading
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Coroutine, Iterable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol
from weakref import WeakValueDictionary

import anyio
import anyio.to_thread
from fastapi import FastAPI, params
from fastapi.routing import APIRoute
from fastapi.utils import create_model_field
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response

from app import bodies, problems
from app.connections import DOUBT_SECONDS
from app.live import Lives
from app.query import RequestModel, Resources
from app.resources import ServiceResources, give_back_memory
from app.settings import Settings
from app.turns import Attended, Place, Turns

SMALL = 1 << 14
"""Bytes of a body that is parsed in half a millisecond, whatever it holds; a larger one counts as long."""
LARGE = 1 << 16
"""Bytes of a body beyond which few are received at the same time: the others stay with their senders."""


@dataclass(frozen=True)
class Question:
    """A route's question: the model of its body, how it is answered, and whether that may take long."""

    path: str
    model: type[RequestModel]
    answer: Callable[[Any, Resources], Response]
    is_long: Callable[[Any], bool]

    def timed(self, body: Any, attended: Any) -> Response:
        """The answer, with a header that says how long it waited and took."""
        begin = time.perf_counter()
        reply = self.answer(body, attended)
        give_back_memory(every=1.0)
        took = time.perf_counter() - begin
        reply.headers["Server-Timing"] = f"queue;dur={1000 * attended.queued:.1f}, answer;dur={1000 * took:.1f}"
        return reply


class Computing(Protocol):
    """Where answers are computed."""

    alive: Iterable[int]
    """Numbers of its processes."""
    ends: Counter[str]
    """How those ended that have."""
    preparing: Iterable[str]
    """Parts of the atlas's index that are being made."""

    def running(self) -> AbstractAsyncContextManager[None]:
        """Ready to answer, until the end of the block."""

    async def answer(self, request: Request, question: Question, content: bytes) -> Response:
        """The reply to a body, or the error that it is answered with."""

    def stop(self) -> None:
        """Give up what is being computed: the service ends."""


def live_of(body: RequestModel) -> str | None:
    """The id under which a request goes on from the last answer; None of those that do not."""
    return getattr(body, "live", None)


class Threads:
    """Answers computed by threads of the process that talks to the clients."""

    def __init__(self, resources: ServiceResources, turns: Turns) -> None:
        self._resources, self._turns = resources, turns
        self.alive, self.ends, self.preparing = [os.getpid()], Counter[str](), list[str]()
        self._places = resources.settings.max_concurrent
        turns.add(*(Place(quick=k == 0 and self._places > 1) for k in range(self._places)))
        self.stop = turns.stopping.set

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        self._turns.stopping.clear()  # it may begin again
        self._resources.load()
        self._resources.prepare_rest()
        self._threads, self._lives = anyio.CapacityLimiter(self._places), Lives()
        stopping = threading.Event()

        def prepare() -> None:
            self.preparing[:] = self._resources.missing()
            while self.preparing and not stopping.is_set():
                self._resources.make(self.preparing[0], stopping.is_set)
                self.preparing.pop(0)

        behind = threading.Thread(target=prepare)
        behind.start()  # the service is ready meanwhile
        try:
            yield
        finally:
            self.stop()
            stopping.set()
            behind.join()

    async def answer(self, request: Request, question: Question, content: bytes) -> Response:
        read = partial(bodies.read_request, content, question.model)
        body = read() if len(content) <= SMALL else await anyio.to_thread.run_sync(read)

        async with self._lives.turn(live_of(body)) as kept:

            async def compute(_: Place, queued: float, cancelled: Callable[[], bool]) -> Response:
                kept.begin()
                attended = Attended(self._resources, cancelled, queued, kept.state)
                reply = await anyio.to_thread.run_sync(question.timed, body, attended, limiter=self._threads)
                kept.state = attended.left.state
                return reply

            return await self._turns.turn(request, compute, question.is_long(body))  # type: ignore[no-any-return]


class LargeBodies:
    """Large bodies are received in few ``places``, at most half of them of one address; the others stay with their senders.

    One that falls `PATIENCE` seconds behind where it would be after ``seconds`` loses its place.
    """

    PATIENCE = 2.0

    def __init__(self, places: int, seconds: float) -> None:
        self._seconds, self._half, self._places = seconds, places // 2, asyncio.Semaphore(places)
        self._of_address = WeakValueDictionary[str, asyncio.Semaphore]()

    async def read(self, request: Request) -> bytes:
        """The body of a request; raises `problems.SlowBody`."""
        host, length = request.client.host if request.client else "", request.headers.get("content-length", "")
        own = self._of_address.setdefault(host, asyncio.Semaphore(self._half))
        size, body = int(length) if length.isdecimal() else LARGE, bytearray()
        try:
            with anyio.CancelScope() as wait:
                request.state.leave = wait.cancel  # the server's, where the client goes before its turn
                async with own, self._places, asyncio.timeout(self.PATIENCE) as time:
                    latest = asyncio.get_running_loop().time() + self.PATIENCE
                    async for part in request.stream():
                        body += part
                        time.reschedule(latest + self._seconds * len(body) / size)
                return bytes(body)
            raise ClientDisconnect
        except TimeoutError:
            raise problems.SlowBody from None
        finally:
            give_back_memory(every=1.0)


async def _content(request: Request) -> bytes:
    length = request.headers.get("content-length", "")
    if length.isdecimal() and int(length) <= LARGE:
        return await request.body()
    content: bytes = await request.app.state.large.read(request)
    return content


async def _stays(request: Request) -> None:
    """Raise `ClientDisconnect` where the client has closed its side, and a moment later has gone altogether."""
    for _ in range(2):
        await asyncio.sleep(0)  # it may have closed right behind its request
    if getattr(request.state, "half_closed", False):
        await asyncio.sleep(DOUBT_SECONDS)
        if await request.is_disconnected():
            raise ClientDisconnect


class _QuestionRoute(APIRoute):
    """A POST route that FastAPI describes by its models; `app.bodies` reads the body and writes the reply."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        return self.endpoint  # type: ignore[return-value]


def install(app: FastAPI, computing: Computing, settings: Settings) -> None:
    """What the routes of `add` need."""
    bodies.Held.most, bodies.Reply.turn = settings.reply_memory_bytes, asyncio.Lock()
    app.state.computing = computing
    app.state.questions = {}
    app.state.large = LargeBodies(16, settings.body_seconds)


def add(app: FastAPI, question: Question, name: str, **described: Any) -> None:
    """The route that answers a question; what is ``described`` FastAPI takes for its document."""
    app.state.questions[question.path] = question

    async def answer(request: Request) -> Response:
        request.state.begun = time.perf_counter()
        content = await _content(request)
        if content and not problems.says_json(request.headers):
            raise problems.NotJson
        await _stays(request)
        return await app.state.computing.answer(request, question, content)  # type: ignore[no-any-return]

    route = _QuestionRoute(question.path, answer, name=name, methods=["POST"], **described)
    route.body_field = create_model_field("body", question.model, field_info=params.Body(annotation=question.model))
    app.router.routes.append(route)
