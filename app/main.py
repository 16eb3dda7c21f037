"""The HTTP service: one route a query, health, and the OpenAPI description."""

from __future__ import annotations

import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

import anyio
import anyio.to_thread
from fastapi import FastAPI, Response
from starlette.middleware.body_limit import RequestBodyLimitMiddleware

import linkage_atlas
from app import problems
from app.queries import all_queries
from app.query import Export, Query
from app.settings import Settings


class ServiceResources:
    """What answers may ask for: the atlas, loaded and verified once, and a clock."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings

    def clock(self) -> float:
        """Seconds of a monotonic clock."""
        return time.perf_counter()


class Turnstile:
    """Lets a few requests compute at a time and a few more wait; refuses the rest at once."""

    def __init__(self, concurrent: int, waiting: int) -> None:
        self._limiter = anyio.CapacityLimiter(concurrent)
        self._waiting = waiting

    async def run(self, function: Callable[..., Any], *args: Any) -> Any:
        """``function(*args)`` on a worker thread. Raises `problems.Overloaded` when too many wait already."""
        if self._limiter.statistics().tasks_waiting >= self._waiting and self._limiter.available_tokens < 1:
            raise problems.Overloaded
        return await anyio.to_thread.run_sync(function, *args, limiter=self._limiter)


def create_app(settings: Settings | None = None) -> FastAPI:
    """The application; settings come from the environment unless given."""
    settings = settings or Settings()
    resources = ServiceResources(settings)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        app.state.turnstile = Turnstile(settings.max_concurrent, settings.max_waiting)
        yield

    app = FastAPI(
        title="linkage-atlas",
        version=linkage_atlas.__version__,
        summary="Finds planar linkages for a required motion.",
        lifespan=lifespan,
    )
    app.add_middleware(RequestBodyLimitMiddleware, max_body_size=settings.max_body_bytes)
    problems.install(app)
    for query in all_queries():
        _add_query(app, query, resources)
        for name, export in query.exports.items():
            _add_export(app, query, name, export, resources)

    @app.get("/livez", tags=["health"])
    async def livez() -> dict[str, str]:
        """The process answers."""
        return {"status": "ok"}

    return app


_PROBLEM_RESPONSES: dict[int | str, dict[str, Any]] = {
    status: {"description": text, "content": {"application/problem+json": {}}}
    for status, text in {
        400: "The body is not JSON.",
        413: "The body is too large.",
        422: "The request is malformed or has no answer; `errors` points to the fields.",
        503: "The service is not ready or too many requests wait.",
    }.items()
}


def _route_details(query: Query) -> dict[str, Any]:
    examples = {name: {"value": body} for name, body in query.examples.items()}
    return {
        "summary": query.summary,
        "tags": [query.command.split()[0]],
        "responses": _PROBLEM_RESPONSES,
        "openapi_extra": {"requestBody": {"content": {"application/json": {"examples": examples}}}},
    }


def _add_query(app: FastAPI, query: Query, resources: ServiceResources) -> None:
    async def route(body):  # type: ignore[no-untyped-def]
        return await app.state.turnstile.run(query.answer, body, resources)

    route.__annotations__ = {"body": query.request, "return": query.reply}
    route.__name__ = query.command.replace(" ", "_")
    app.post(query.path, response_model=query.reply, **_route_details(query))(route)


def _add_export(app: FastAPI, query: Query, name: str, export: Export, resources: ServiceResources) -> None:
    async def route(body):  # type: ignore[no-untyped-def]
        content = await app.state.turnstile.run(export.render, body, resources)
        return Response(content, media_type=export.media_type)

    route.__annotations__ = {"body": query.request}
    route.__name__ = f"{query.command.replace(' ', '_')}_{name}"
    details = _route_details(query)
    details["summary"] = f"{query.summary} As {name.upper()}."
    details["responses"] = {**_PROBLEM_RESPONSES, 200: {"content": {export.media_type: {}}}}
    app.post(f"{query.path}.{name}", response_class=Response, response_model=None, **details)(route)
