"""The HTTP service: a route for each query, the atlas, health, the pages, and the OpenAPI description."""

from __future__ import annotations

import warnings
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from functools import cache
from typing import Any, Literal

from fastapi import FastAPI, params
from fastapi.routing import APIRoute
from fastapi.utils import create_model_field
from pydantic.warnings import UnsupportedFieldAttributeWarning
from starlette.middleware.gzip import GZipMiddleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import Response

import linkage_atlas as la
from app import page, problems
from app.bodies import says_json
from app.compute import Workers
from app.middleware import BodyLimit, SecurityHeaders
from app.query import ReplyModel, RequestModel, derived_from
from app.questions import Question, all_questions, problem_responses
from app.settings import Settings


def create_app(settings: Settings | None = None) -> FastAPI:
    """Create the application; by default, the settings are read from the environment."""
    settings = settings or Settings()
    workers = Workers(settings)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        async with workers.running():
            yield

    app = FastAPI(
        title="linkage-atlas",
        version=la.__version__,
        summary="Find planar linkages for a required motion.",
        lifespan=lifespan,
        redirect_slashes=False,
        openapi_url=None,
        docs_url=None,
        redoc_url=None,
    )
    app.state.workers = workers
    app.add_middleware(BodyLimit, max_body_size=settings.max_body_bytes)
    app.add_middleware(GZipMiddleware, compresslevel=6)
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=list(settings.allowed_hosts), www_redirect=False)
    app.add_middleware(SecurityHeaders)
    problems.install(app)
    for question in all_questions().values():
        _add_question(app, question, workers)
    _add_health_routes(app, workers)
    page.install(app)

    @cache
    def document() -> dict[str, Any]:
        return described(app)

    @app.get("/openapi.json", include_in_schema=False)
    def openapi() -> dict[str, Any]:
        return document()

    for route in [route for route in app.routes if isinstance(route, APIRoute) and "GET" in route.methods]:
        app.add_api_route(route.path, route.endpoint, methods=["HEAD"], include_in_schema=False, response_model=None)
    if settings.metrics:
        _add_metrics(app, workers)

    return app


def described(app: FastAPI) -> dict[str, Any]:
    """Return the OpenAPI document."""
    with warnings.catch_warnings():  # FastAPI silences these if models are built at once
        warnings.simplefilter("ignore", UnsupportedFieldAttributeWarning)
        document = app.openapi()
    schemas = document["components"]["schemas"]
    for model in derived_from(RequestModel):
        if model.__name__ in schemas:
            for field, text in model.descriptions().items():
                schemas[model.__name__]["properties"][field]["description"] = text
    schemas["Problem"] = problems.SCHEMA
    return document


# -- questions --------------------------------------------------------------------------------------------------------


class _QuestionRoute(APIRoute):
    """A POST route that FastAPI describes by its models; a worker parses the body and writes the reply."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        return self.endpoint  # type: ignore[return-value]


def _add_question(app: FastAPI, question: Question, workers: Workers) -> None:
    async def answer(request: Request) -> Response:
        content = await request.body()
        if content and not says_json(request.headers):
            detail = "the body must be JSON; send the header `Content-Type: application/json` and no Content-Encoding"
            raise problems.Problem(problems.problem(415, detail))
        return await workers.answer(request, question, content)

    route = _QuestionRoute(question.path, answer, methods=["POST"], **question.described)
    route.body_field = create_model_field("body", question.model, field_info=params.Body(annotation=question.model))
    app.router.routes.append(route)


# -- health and metrics -----------------------------------------------------------------------------------------------


class Ready(ReplyModel):
    """Reply of a service that can answer requests."""

    status: Literal["ready"] = "ready"


def _add_health_routes(app: FastAPI, workers: Workers) -> None:
    @app.get("/livez", tags=["health"], summary="Check that the process answers.")
    async def livez() -> dict[str, str]:
        return {"status": "ok"}

    about = "Check that the atlas is loaded and verified."

    @app.get("/readyz", tags=["health"], summary=about, responses=problem_responses(503))
    async def readyz() -> Ready:
        if workers.failure is not None:
            raise workers.failure
        return Ready()


def _add_metrics(app: FastAPI, workers: Workers) -> None:
    from prometheus_client import CollectorRegistry, Gauge
    from prometheus_fastapi_instrumentator import Instrumentator

    registry = CollectorRegistry()
    waiting = Gauge("linkage_atlas_waiting", "Number of requests that wait for a worker.", registry=registry)
    waiting.set_function(lambda: sum(workers.waiting.values()))
    busy = Gauge("linkage_atlas_computing", "Number of requests that a worker computes.", registry=registry)
    busy.set_function(lambda: workers.count - len(workers.idle))
    instrumentator = Instrumentator(should_group_status_codes=False, registry=registry)
    instrumentator.instrument(app).expose(app, include_in_schema=False)
