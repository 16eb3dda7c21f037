"""The HTTP service: one route a query, files, the atlas, health, the page, and the OpenAPI description."""

from __future__ import annotations

import re
import warnings
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from importlib import import_module
from typing import Annotated, Any, Literal

from fastapi import FastAPI
from fastapi import Query as QueryParameters
from fastapi.routing import APIRoute
from pydantic import BaseModel, BeforeValidator, Field
from pydantic.warnings import UnsupportedFieldAttributeWarning
from starlette.requests import Request
from starlette.responses import Response

import linkage_atlas as la
from app import computed, page, problems
from app.admission import Admission
from app.bodies import Reply
from app.query import FILES, MEDIA_TYPES, Files, Query, ReplyModel, RequestModel, Resources, reply_model
from app.registry import all_queries
from app.resources import ServiceResources
from app.settings import Settings
from app.turns import Turns


def create_app(
    settings: Settings | None = None,
    resources: ServiceResources | None = None,
    make_computing: Callable[[Turns], computed.Computing] | None = None,
) -> FastAPI:
    """The application; settings come from the environment unless given, resources are made from them unless given.

    Answers are computed by threads unless ``make_computing`` says otherwise.
    """
    settings = settings or (resources.settings if resources else Settings())
    resources = resources or ServiceResources(settings)
    turns = Turns(settings.max_waiting)
    computing = make_computing(turns) if make_computing else computed.Threads(resources, turns)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        async with computing.running():
            yield

    app = FastAPI(
        title="linkage-atlas",
        version=la.__version__,
        summary="Finds planar linkages for a required motion.",
        lifespan=lifespan,
        redirect_slashes=False,
        openapi_url=None,  # its own route would make the document on the event loop
    )
    app.add_middleware(problems.BodyLimit, max_body_size=settings.max_body_bytes)
    app.add_middleware(Admission, hosts=settings.allowed_hosts)
    problems.install(app)
    app.state.turns = turns
    computed.install(app, computing, settings)
    for query in all_queries():
        _add_query(app, query)
    page.install(app)
    _add_atlas_routes(app, resources, computing)
    _add_health_routes(app, resources, computing)
    _add_heads(app)
    if settings.log_json or settings.metrics:
        observed = import_module("app.observed")  # and with it the client library of Prometheus
        observed.install(app, settings, computing)
    description = page.MadeOnce(app, "/openapi.json", lambda _: described(app), long=True)
    app.add_route("/openapi.json", description.reply, ["GET"], include_in_schema=False)
    return app


def described(app: FastAPI) -> dict[str, Any]:
    with warnings.catch_warnings():  # FastAPI's own, which it keeps quiet where models are built at once
        warnings.simplefilter("ignore", UnsupportedFieldAttributeWarning)
        document = app.openapi()
    document["components"]["schemas"]["Problem"] = problems.SCHEMA
    return document


class AtlasReply(ReplyModel):
    kind: str
    types: int
    schema_version: int
    content_sha256: str
    parameters: dict[str, int | str]
    generator: dict[str, str]
    scan_bytes: int
    load_ms: float


class AtlasTypeReply(ReplyModel):
    kind: str
    number: int
    lengths: list[int]
    family: str | None
    samples: int
    winding: int
    normalisation: Literal["mean"]
    unit: Literal["rad"]
    average: float
    details: list[float]


def _written_plainly(number: str) -> str:
    """A whole number in digits alone: ``1_0``, ``+10`` and ``010`` are no other names of type 10."""
    if not re.fullmatch("-?(0|[1-9][0-9]*)", number) and re.fullmatch(r"\s*[+-]?[0-9][0-9_]*(\.0*)?\s*", number):
        raise problems.NotFound("types are numbered in plain digits")
    return number


class OfKind(BaseModel, extra="forbid"):
    kind: Literal["four_bar", "slider_crank"] | None = None


class OfType(RequestModel):
    number: int
    kind: Literal["four_bar", "slider_crank"] | None


TypeNumber = Annotated[int, Field(ge=1, le=2**53), BeforeValidator(_written_plainly)]


def _add_atlas_routes(app: FastAPI, resources: ServiceResources, computing: computed.Computing) -> None:
    loaded = page.MadeOnce(app, "/v1/atlas", lambda resources: resources.describe_atlas())

    @app.get(
        "/v1/atlas", tags=["atlas"], summary="What is loaded.", response_model=AtlasReply, responses=_problems(503)
    )
    async def atlas(request: Request) -> Response:
        return await loaded.reply(request)

    path, about = "/v1/types/{number}", "One dimension type."
    question = computed.Question(path, OfType, _details, lambda _: False)
    app.state.questions[path] = (
        question  # its row is unpacked from the file: milliseconds that the front does not have
    )

    @app.get(path, tags=["atlas"], summary=about, response_model=AtlasTypeReply, responses=_problems(404, 422, 503))
    async def dimension_type(
        number: TypeNumber, of: Annotated[OfKind, QueryParameters()], request: Request
    ) -> Response:
        """Lengths, family and the Haar average and details of the body's rotation over the whole turn, of a kind (four_bar)."""
        content = OfType(number=number, kind=of.kind).model_dump_json()
        return await computing.answer(request, question, content.encode())


def _details(of: OfType, resources: Resources) -> Reply:
    try:
        return Reply(AtlasTypeReply(**resources.atlas.of(of.kind or resources.atlas.kind).details_of(of.number)))
    except la.FieldError as error:
        raise problems.NotFound(error.message) from None


class Ready(ReplyModel):
    status: Literal["ready"] = "ready"
    preparing: list[str] = Field(description="Always empty: nothing is prepared in the background.")


def _add_health_routes(app: FastAPI, resources: ServiceResources, computing: computed.Computing) -> None:
    @app.get("/livez", tags=["health"], summary="The process answers.")
    async def livez() -> dict[str, str]:
        return {"status": "ok"}

    whole = "The atlas is loaded and verified."

    @app.get("/readyz", tags=["health"], summary=whole, responses=_problems(503))
    async def readyz() -> Ready:
        if resources.settings.with_atlas:
            _ = resources.atlas
        return Ready(preparing=list(computing.preparing))


def _add_heads(app: FastAPI) -> None:
    """What can be got can be asked for its head alone (RFC 9110, 9.1)."""
    for route in [one for one in app.routes if isinstance(one, APIRoute) and "GET" in one.methods]:
        app.add_api_route(route.path, route.endpoint, methods=["HEAD"], include_in_schema=False, response_model=None)


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


def _described(summary: str, query: Query, examples: Mapping[str, Any], *media_types: str) -> dict[str, Any]:
    """What is said of a route beside its models; with media types it answers with a file."""
    bodies = {name: {"value": body} for name, body in examples.items()}
    details = {
        "summary": summary,
        "tags": [query.command.split()[0]],
        "responses": _problems(400, 413, 415, 422, 503),
        "openapi_extra": {"requestBody": {"content": {"application/json": {"examples": bodies}}}},
    }
    if media_types:
        details["responses"] |= {200: {"content": {media_type: {} for media_type in media_types}}}
        details |= {"response_class": Response, "response_model": None}
    return details


def _add_query(app: FastAPI, query: Query) -> None:
    """The routes of a question: its reply, its exports, and files of the reply's solutions."""
    name = query.command.replace(" ", "_")

    def add(path: str, name: str, answer: Callable[[Any, Any], Response], **described: Any) -> None:
        computed.add(app, computed.Question(path, query.request, answer, query.is_long), name, **described)

    add(
        query.path,
        name,
        lambda body, resources: Reply(query.answer(body, resources)),
        response_model=reply_model(query.reply),
        **_described(query.summary, query, query.examples),
    )
    for kind, render in query.exports.items():
        add(
            f"{query.path}.{kind}",
            f"{name}_{kind}",
            lambda body, resources, render=render, kind=kind: Reply(render(body, resources), MEDIA_TYPES[kind]),
            **_described(f"{query.summary} As {kind.upper()}.", query, query.examples, MEDIA_TYPES[kind]),
        )
    if query.files is not None:
        _add_files(app, query, query.files)


def _add_files(app: FastAPI, query: Query, files: Files) -> None:
    def answer(body: Any, resources: Any) -> Response:
        media_type, endings = FILES[body.format]
        name = f'attachment; filename="{files.stem}.{endings[-1]}"'
        return Reply(files.render(body, resources), media_type, {"Content-Disposition": name})

    examples = {kind: {**files.example, "format": kind} for kind in files.formats}
    media_types = [FILES[kind].media_type for kind in files.formats]
    question = computed.Question(files.path, files.request, answer, files.is_long)
    computed.add(app, question, files.name, **_described(files.summary, query, examples, *media_types))
