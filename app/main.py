"""The HTTP service: one route a query, health, and the OpenAPI description."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import cache
from importlib import import_module
from inspect import iscoroutinefunction
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

import linkage_atlas as la
from app import computed, page, problems
from app.bodies import Reply
from app.description import Description
from app.doors import Doors
from app.fourbar import export
from app.query import Export, Invalid, Query, ReplyModel
from app.registry import function_queries, motion_queries, worked_example
from app.resources import ServiceResources
from app.scenes import SCENES, queries_of
from app.settings import Settings
from app.turnstile import Turnstile


def create_app(
    settings: Settings | None = None,
    resources: ServiceResources | None = None,
    make_computing: Callable[[Turnstile], computed.Computing] | None = None,
) -> Starlette:
    """The application; settings come from the environment unless given, resources are made from them unless given.

    Answers are computed by threads unless ``make_computing`` says otherwise.
    """
    settings = settings or (resources.settings if resources else Settings())
    resources = resources or ServiceResources(settings)
    turnstile = Turnstile(settings.max_concurrent, settings.max_waiting)
    computing = make_computing(turnstile) if make_computing else computed.Threads(resources, turnstile)

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        async with computing.running():
            yield

    app = Starlette(lifespan=lifespan)
    app.router.redirect_slashes = False
    app.state.description = Description(
        title="linkage-atlas", version=la.__version__, summary="Finds planar linkages for a required motion."
    )
    app.add_middleware(problems.BodyLimit, max_body_size=settings.max_body_bytes)
    app.add_middleware(Doors, hosts=settings.allowed_hosts)
    problems.install(app)
    app.state.turnstile = turnstile
    computed.install(app, computing, settings)
    _add_queries(app, motion_queries())
    questions = app.state.questions
    questions.later("/v1/function", lambda: _add_function(app))
    for scene in SCENES:
        questions.later(f"/v1/{scene}/", lambda scene=scene: _add_queries(app, queries_of(scene)))
    export.install(app, _PROBLEM_RESPONSES, worked_example())
    page.install(app)
    _add_atlas_routes(app, resources)
    _add_health_routes(app, resources)
    app.add_route("/openapi.json", _description, ["GET"], include_in_schema=False)
    return app


def described(app: Starlette) -> dict[str, Any]:
    """The OpenAPI document of all routes."""
    app.state.questions.load()
    document: dict[str, Any] = app.state.description.document
    return document


def _description(request: Request) -> Response:  # no coroutine: made on a thread
    return JSONResponse(described(request.app))


class AtlasReply(ReplyModel):
    types: int
    schema_version: int
    content_sha256: str
    parameters: dict[str, int | str]
    generator: dict[str, str]
    scan_bytes: int
    load_ms: float


class AtlasTypeReply(ReplyModel):
    number: int
    lengths: list[int]
    family: str
    samples: int
    winding: int
    normalisation: Literal["mean"]
    unit: Literal["rad"]
    average: float
    details: list[float]


def _written_plainly(number: str) -> str:
    """A whole number in digits alone: ``1_0`` and ``+10`` are no other names of type 10."""
    if not re.fullmatch("-?[0-9]+", number) and re.fullmatch(r"\s*[+-]?[0-9][0-9_]*(\.0*)?\s*", number):
        raise problems.NotFound("types are numbered in plain digits")
    return number


TypeNumber = Annotated[int, Field(ge=1, le=2**53), BeforeValidator(_written_plainly)]


@cache
def _type_number() -> TypeAdapter[int]:
    return TypeAdapter(TypeNumber)


def _add_atlas_routes(app: Starlette, resources: ServiceResources) -> None:
    async def atlas() -> AtlasReply:
        return AtlasReply(**resources.describe_atlas())

    def dimension_type(number: TypeNumber) -> AtlasTypeReply:
        """Lengths, family and the Haar average and details of the coupler rotation over the whole turn."""
        try:
            row = _type_number().validate_python(number)
        except ValidationError as error:
            raise Invalid([{**entry, "loc": ("number",)} for entry in error.errors()]) from None
        try:
            return AtlasTypeReply(**resources.atlas.details_of(row))
        except la.FieldError as error:
            raise problems.NotFound(error.message) from None

    _add_get(app, "/v1/atlas", atlas, tags=["atlas"], summary="What is loaded.", responses=_problems(503))
    answers = _problems(404, 422, 503)
    _add_get(
        app, "/v1/types/{number}", dimension_type, tags=["atlas"], summary="One dimension type.", responses=answers
    )


def _add_health_routes(app: Starlette, resources: ServiceResources) -> None:
    async def livez() -> dict[str, str]:
        return {"status": "ok"}

    async def readyz() -> dict[str, str]:
        if resources.settings.with_atlas:
            _ = resources.atlas
        return {"status": "ready"}

    _add_get(app, "/livez", livez, tags=["health"], summary="The process answers.")
    whole = "The atlas is loaded and verified."
    _add_get(app, "/readyz", readyz, tags=["health"], summary=whole, responses=_problems(503))


def _add_get(app: Starlette, path: str, function: Callable[..., Any], **details: Any) -> None:
    """A GET route that answers with what a function of its path's parameters returns; one that is no coroutine has a thread."""

    async def answer(request: Request) -> Response:
        if iscoroutinefunction(function):
            return Reply(await function(**request.path_params))
        return Reply(await run_in_threadpool(function, **request.path_params))

    route = Route(path, answer, methods=["GET"])
    route.methods = {"GET"}  # Starlette would add HEAD, which the description does not have
    app.router.routes.append(route)
    app.state.description.add(path, function, **details)


_PROBLEM_RESPONSES: dict[int | str, dict[str, Any]] = {
    status: {
        "description": text,
        "content": {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}},
    }
    for status, text in {
        400: "The body is not JSON.",
        404: "There is no such route or type.",
        413: "The body is too large.",
        415: "The body is not declared as JSON.",
        422: "The request is malformed or has no answer; `errors` points to the fields.",
        503: "The service is not ready or too many requests wait.",
    }.items()
}


def _problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    return {status: _PROBLEM_RESPONSES[status] for status in statuses}


def _route_details(query: Query) -> dict[str, Any]:
    examples = {name: {"value": body} for name, body in query.examples.items()}
    return {
        "summary": query.summary,
        "tags": [query.command.split()[0]],
        "responses": _problems(400, 413, 415, 422, 503),
        "openapi_extra": {"requestBody": {"content": {"application/json": {"examples": examples}}}},
    }


def _add_function(app: Starlette) -> None:
    _add_queries(app, function_queries())
    import_module("app.fourbar.function_export").install(app, _PROBLEM_RESPONSES)


def _add_queries(app: Starlette, queries: tuple[Query, ...]) -> None:
    for query in queries:
        _add_query(app, query)
        for name, rendered in query.exports.items():
            _add_export(app, query, name, rendered)


def _add_query(app: Starlette, query: Query) -> None:
    def answer(body: Any, resources: Any) -> Response:
        return Reply(query.answer(body, resources))

    name = query.command.replace(" ", "_")
    computed.add(
        app,
        query.path,
        name,
        query.request,
        answer,
        query.is_long,
        response_model=query.reply,
        **_route_details(query),
    )


def _add_export(app: Starlette, query: Query, name: str, export: Export) -> None:
    def answer(body: Any, resources: Any) -> Response:
        return Reply(export.render(body, resources), export.media_type)

    route = f"{query.command.replace(' ', '_')}_{name}"
    details = _route_details(query)
    details["summary"] = f"{query.summary} As {name.upper()}."
    details["responses"] = {**details["responses"], 200: {"content": {export.media_type: {}}}}
    details |= {"response_class": Response, "response_model": None}
    computed.add(app, f"{query.path}.{name}", route, query.request, answer, query.is_long, **details)
