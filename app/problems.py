"""Errors to problem+json (RFC 9457): the one place that knows both the domain's errors and HTTP.

A reply never repeats the input, so values that JSON cannot hold (NaN, lone surrogates) or that are large do not reach it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from http import HTTPStatus
from typing import Any
from urllib.parse import quote

from fastapi import FastAPI
from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response

from app.query import MAX_ERRORS, Invalid
from app.sentences import sentence
from linkage_atlas import AtlasError, AtlasFault, Cancelled, FieldError, OutOfTime

MAX_POINTER = 200
"""Longest part of a pointer in characters: a field's name is the client's and may be of any length."""

SCHEMA: dict[str, Any] = {
    "type": "object",
    "required": ["type", "title", "status", "detail"],
    "properties": {
        "type": {"type": "string"},
        "title": {"type": "string"},
        "status": {"type": "integer"},
        "detail": {"type": "string", "description": "What is wrong, as a sentence."},
        "errors": {
            "type": "array",
            "items": {
                "type": "object",
                "required": ["pointer", "detail"],
                "properties": {
                    "pointer": {"type": "string", "description": "JSON pointer to the field, as a URI fragment."},
                    "detail": {"type": "string"},
                },
            },
        },
    },
}
"""JSON schema of a problem, for the API's description."""


class Overloaded(Exception):
    """More requests wait than the service lets wait."""


class Malformed(Exception):
    """A body that cannot be read: what is wrong, and what is wrong at its place, if that is said in other words."""

    def __init__(self, detail: str, at_place: str | None = None) -> None:
        super().__init__(detail)
        self.detail, self.at_place = detail, at_place or detail


class NotJson(Exception):
    """A body that is not declared as JSON, or as packed."""


class Ending(Exception):
    """The service ends and computes no further."""


class Died(Exception):
    """The process that computed an answer ended before it was there."""


class NotFound(Exception):
    """The resource does not exist; the message says which do."""


def pointer(location: Iterable[str | int]) -> str:
    """A JSON pointer (RFC 6901) as a URI fragment, for the path of a value in the request."""
    parts = [str(part)[:MAX_POINTER].replace("~", "~0").replace("/", "~1") for part in location]
    return "#" + "".join("/" + quote(part, safe="!$&'()*+,;=:@", errors="replace") for part in parts)


def error_rows(errors: Sequence[Any]) -> list[dict[str, Any]]:
    """Return errors as rows ``{"pointer", "detail"}``."""
    return [{"pointer": pointer(error["loc"]), "detail": error["msg"]} for error in errors[:MAX_ERRORS]]


def problem(
    status: int,
    detail: str,
    errors: list[dict[str, Any]] | None = None,
    headers: dict[str, str] | None = None,
) -> Response:
    """A problem+json response. ``ensure_ascii`` keeps lone surrogates from breaking the encoder."""
    body: dict[str, Any] = {
        "type": "about:blank",
        "title": HTTPStatus(status).phrase,
        "status": status,
        "detail": detail,
    }
    if errors:
        body["errors"] = errors
    return Response(
        json.dumps(body, ensure_ascii=True, allow_nan=False),
        status_code=status,
        media_type="application/problem+json",
        headers=headers,
    )


def field_problem(error: FieldError) -> Response:
    """422 for input that is well-formed but has no answer."""
    row = {"pointer": "#" + error.field, "detail": error.message, **error.details}
    return problem(422, str(error), [row])


def http_problem(error: HTTPException) -> Response:
    """An error of the framework itself, as problem+json."""
    details = {
        400: "the body could not be read as JSON",
        404: "there is nothing at this address",
        405: "this address does not take that method",
        413: "the body is larger than this service accepts",
    }
    detail = details.get(error.status_code, str(error.detail))
    rows = [{"pointer": "#", "detail": detail}] if error.status_code in (400, 413) else None
    return problem(error.status_code, detail, rows, dict(error.headers or {}))


def _invalid(error: Invalid) -> Response:
    return problem(422, str(error).partition("\n")[0], error_rows(error.errors))


def _parameter(error: RequestValidationError) -> Response:
    """Answer wrong parameters of a route that FastAPI checks; the path of an error begins with the parameter's name."""
    rows = [
        {
            "loc": row["loc"][1:],
            "msg": "there is no such parameter" if row["type"] == "extra_forbidden" else sentence(row),
        }
        for row in error.errors()
    ]
    return _invalid(Invalid(rows))


def _model(error: ValidationError) -> Response:
    rows = [{"loc": row["loc"], "msg": sentence(row)} for row in error.errors(include_url=False)]
    return _invalid(Invalid(rows))


def _atlas(error: AtlasError) -> Response:
    later = None if error.fault is AtlasFault.NOT_WANTED else {"Retry-After": "5"}
    return problem(503, str(error), headers=later)


def _later(seconds: int, detail: str) -> Callable[[Exception], Response]:
    return lambda _: problem(503, detail, headers={"Retry-After": str(seconds)})


_REPLIES: dict[type[Exception], Callable[[Any], Response]] = {
    Invalid: _invalid,
    Malformed: lambda error: problem(400, error.detail, [{"pointer": "#", "detail": error.at_place}]),
    NotJson: lambda _: problem(
        415, "send the body with the header `Content-Type: application/json`, and without a Content-Encoding"
    ),
    ValidationError: _model,
    RequestValidationError: _parameter,
    FieldError: field_problem,
    AtlasError: _atlas,
    NotFound: lambda error: problem(404, str(error)),
    Overloaded: _later(1, "too many requests are waiting"),
    Ending: _later(5, "the service is ending"),
    OutOfTime: _later(5, "the answer took longer than its `budget_ms` or this service allows"),
    Died: _later(1, "the process that computed this answer has ended before it; the service's log says how"),
    ClientDisconnect: lambda _: Response(status_code=499),  # it left before it had said what it wanted
    Cancelled: lambda _: Response(status_code=499),  # the client is gone; 499 is what proxies log for that
    HTTPException: http_problem,
    Exception: lambda _: problem(500, "a fault of the service, not of the request; its log says more"),
}
"""What is answered to an error, by its class; the nearest one counts."""


def reply_to(error: Exception) -> Response:
    """The response that an error is answered with."""
    return next(_REPLIES[kind] for kind in type(error).__mro__ if kind in _REPLIES)(error)


def install(app: FastAPI) -> None:
    """Register the replies on an application."""

    async def handle(request: Request, error: Exception) -> Response:
        return reply_to(error)

    for kind in _REPLIES:
        app.add_exception_handler(kind, handle)
