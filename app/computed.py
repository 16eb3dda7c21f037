"""Routes whose answers are computed: the body is read off the event loop, the answer waits for its turn."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Coroutine
from typing import Any

import anyio
import anyio.to_thread
from fastapi import FastAPI, Request, Response
from fastapi.routing import APIRoute

from app import bodies, problems
from app.query import RequestModel, Resources
from app.resources import give_back_memory

SMALL = 4096
"""Bytes of a body that is parsed faster than it is handed to another thread."""
LARGE = 1 << 16
"""Bytes of a body beyond which few are received at the same time: the others stay with their senders."""


class Readers:
    """How many bodies are received and parsed at the same time."""

    def __init__(self) -> None:
        self.large = asyncio.Semaphore(16)
        self.threads = anyio.CapacityLimiter(1)


async def _content(request: Request) -> bytes:
    length = request.headers.get("content-length", "")
    if length.isdecimal() and int(length) <= LARGE:
        return await request.body()
    try:
        async with request.app.state.readers.large:
            return await request.body()
    finally:
        give_back_memory(every=1.0)


class _ComputedRoute(APIRoute):
    """A route that is described by the models of its endpoint and handled by its own handler."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        return self.endpoint.handle  # type: ignore[attr-defined, no-any-return]


def add(
    app: FastAPI,
    path: str,
    name: str,
    model: type[RequestModel],
    answer: Callable[[Any, Resources], Response],
    is_long: Callable[[Any], bool],
    resources: Resources,
    **details: Any,
) -> None:
    """A POST route that answers requests of a model by ``answer(request, resources)`` on a worker thread."""

    async def handle(request: Request) -> Response:
        content = await _content(request)
        if content and not problems.says_json(request.headers):
            raise problems.NotJson
        if len(content) <= SMALL:
            body = bodies.read_request(content, model)
        else:
            readers = app.state.readers
            body = await anyio.to_thread.run_sync(bodies.read_request, content, model, limiter=readers.threads)
        return await app.state.turnstile.run(request, timed, body, resources, is_long(body))

    def timed(body: Any, attended: Any) -> Response:
        begin = time.perf_counter()
        reply = answer(body, attended)
        give_back_memory(every=1.0)
        took = time.perf_counter() - begin
        reply.headers["Server-Timing"] = f"queue;dur={1000 * attended.queued:.1f}, answer;dur={1000 * took:.1f}"
        return reply

    def described(body):  # type: ignore[no-untyped-def]
        raise NotImplementedError("only described: the route has its own handler")

    described.__annotations__ = {"body": model}
    described.__name__ = name
    described.handle = handle  # type: ignore[attr-defined]
    app.router.add_api_route(path, described, methods=["POST"], route_class_override=_ComputedRoute, **details)
