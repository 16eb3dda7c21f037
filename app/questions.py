"""Questions over HTTP: for each route the model of its request, its answer, and whether the answer may take long."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

from starlette.responses import Response

from app.query import FILES, Files, Query, RequestModel, Resources, json_of, reply_model
from app.registry import all_queries


@dataclass(frozen=True)
class Question:
    """A question, its route and its description for FastAPI."""

    path: str
    model: type[RequestModel]
    answer: Callable[[Any, Resources], Response]
    is_long: Callable[[Any], bool]
    described: Mapping[str, Any]


@cache
def all_questions() -> dict[str, Question]:
    """Return all questions by their routes."""
    return {question.path: question for query in all_queries() for question in _questions_of(query)}


# -- queries, their exports, and files of their solutions -------------------------------------------------------------

PROBLEMS: dict[int, str] = {
    400: "The body is not JSON.",
    413: "The body is too large.",
    415: "The body is not declared as JSON.",
    422: "The request is malformed or has no answer; `errors` points to the fields.",
    503: "The service is not ready or too many requests wait.",
}


def problem_responses(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Return the problems of a route for its description."""
    schema = {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}}
    return {status: {"description": PROBLEMS[status], "content": schema} for status in statuses}


def _questions_of(query: Query) -> Iterator[Question]:
    name = query.command.replace(" ", "_")

    def reply(body: Any, resources: Resources) -> Response:
        return Response(json_of(query.answer(body, resources)), media_type="application/json")

    def export(render: Callable[[Any, Resources], bytes], kind: str, body: Any, resources: Resources) -> Response:
        return Response(render(body, resources), media_type=FILES[kind].media_type)

    described = _described(query, name, query.summary, query.examples)
    described |= {"response_model": reply_model(query.reply)}
    yield Question(query.path, query.request, reply, query.is_long, described)
    for kind, render in query.exports.items():
        summary = f"{query.summary} As {kind.upper()}."
        described = _described(query, f"{name}_{kind}", summary, query.examples, FILES[kind].media_type)
        answer = partial(export, render, kind)
        yield Question(f"{query.path}.{kind}", query.request, answer, query.is_long, described)
    if query.files is not None:
        yield _files_question(query, query.files)


def _files_question(query: Query, files: Files) -> Question:
    def answer(body: Any, resources: Resources) -> Response:
        media_type, endings = FILES[body.format]
        name = f'attachment; filename="{files.stem}.{endings[-1]}"'
        content = files.render(body, resources)
        return Response(content, media_type=media_type, headers={"Content-Disposition": name})

    examples = {kind: {**files.example, "format": kind} for kind in files.formats}
    media_types = [FILES[kind].media_type for kind in files.formats]
    described = _described(query, files.name, files.summary, examples, *media_types)
    return Question(files.path, files.request, answer, files.is_long, described)


def _described(
    query: Query, name: str, summary: str, examples: Mapping[str, Any], *media_types: str
) -> dict[str, Any]:
    """Describe a route for FastAPI; a route with media types answers with a file."""
    bodies = {example: {"value": body} for example, body in examples.items()}
    details: dict[str, Any] = {
        "name": name,
        "summary": summary,
        "tags": [query.command.split()[0]],
        "responses": problem_responses(400, 413, 415, 422, 503),
        "openapi_extra": {"requestBody": {"content": {"application/json": {"examples": bodies}}}},
    }
    if media_types:
        details["responses"] |= {200: {"content": {media_type: {} for media_type in media_types}}}
        details |= {"response_class": Response, "response_model": None}
    return details
