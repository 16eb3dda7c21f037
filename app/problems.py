"""Conversion of errors to problem+json (RFC 9457); no other module knows both the errors of the domain and HTTP.

A reply never repeats the input, so it cannot contain large values or values that JSON does not allow (NaN, lone surrogates).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from http import HTTPStatus
from typing import Any
from urllib.parse import quote

from fastapi import FastAPI
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response

from app.query import MAX_ERRORS, Invalid
from linkage_atlas import AtlasError, AtlasFault, Cancelled, FieldError, OutOfTime

MAX_POINTER = 200
"""Largest length of a component of a pointer, in characters; the client may send field names of any length."""

SCHEMA: dict[str, Any] = {
    "type": "object",
    "required": ["type", "title", "status", "detail"],
    "properties": {
        "type": {"type": "string"},
        "title": {"type": "string"},
        "status": {"type": "integer"},
        "detail": {"type": "string", "description": "Description of the error."},
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
"""JSON schema of a problem, for the description of the API."""


class Problem(Exception):
    """A request that cannot be answered, with the response that says why."""

    def __init__(self, reply: Response) -> None:
        super().__init__()
        self.reply = reply


def malformed(detail: str, row_detail: str | None = None) -> Problem:
    """Return the problem of a body that cannot be read; ``row_detail``: description in the row of the error, if it differs."""
    return Problem(problem(400, detail, [{"pointer": "#", "detail": row_detail or detail}]))


def later(seconds: int, detail: str) -> Problem:
    """Return the problem of a request that may be answered some seconds later."""
    return Problem(problem(503, detail, headers={"Retry-After": str(seconds)}))


def pointer(location: Iterable[str | int]) -> str:
    """Return the JSON pointer (RFC 6901) to a value of the request, as a URI fragment."""
    parts = [str(part)[:MAX_POINTER].replace("~", "~0").replace("/", "~1") for part in location]
    return "#" + "".join("/" + quote(part, safe="!$&'()*+,;=:@", errors="replace") for part in parts)


def problem(
    status: int, detail: str, errors: list[dict[str, Any]] | None = None, headers: dict[str, str] | None = None
) -> Response:
    """Return a problem+json response.

    Parameters
    ----------
    status : int
        HTTP status.
    detail : str
        Description of the error.
    errors : list of dict, optional
        Rows ``{"pointer", "detail"}``.
    headers : dict, optional
        Additional headers.
    """
    body = {"type": "about:blank", "title": HTTPStatus(status).phrase, "status": status, "detail": detail}
    body |= {"errors": errors} if errors else {}
    return Response(
        json.dumps(body, ensure_ascii=True, allow_nan=False),  # lone surrogates cannot be encoded as UTF-8
        status_code=status,
        media_type="application/problem+json",
        headers=headers,
    )


def field_problem(error: FieldError) -> Response:
    """Return the response with status 422 for a request that is well-formed but has no answer."""
    row = {"pointer": "#" + error.field, "detail": error.message, **error.details}
    return problem(422, str(error), [row])


def http_problem(error: HTTPException) -> Response:
    """Return the response to an error of the web framework."""
    details = {
        400: "the body is not valid JSON",
        404: "there is no resource at this address; all queries begin with /v2, and the page /docs lists them",
        405: "this address does not accept this method; the page /docs lists all routes and their methods",
        413: "the body is larger than the service accepts",
    }
    detail = details.get(error.status_code, str(error.detail))
    rows = [{"pointer": "#", "detail": detail}] if error.status_code in (400, 413) else None
    return problem(error.status_code, detail, rows, dict(error.headers or {}))


def _invalid(error: Invalid) -> Response:
    rows = [{"pointer": pointer(row["loc"]), "detail": row["msg"]} for row in error.errors[:MAX_ERRORS]]
    return problem(422, str(error).partition("\n")[0], rows)


def _atlas(error: AtlasError) -> Response:
    return problem(503, str(error)) if error.fault is AtlasFault.NOT_WANTED else later(5, str(error)).reply


TOO_LONG = "the answer took longer than `budget_ms` or the limit of the service; simplify the request"
_REPLIES: dict[type[Exception], Callable[[Any], Response]] = {
    Problem: lambda error: error.reply,
    Invalid: _invalid,
    FieldError: field_problem,
    AtlasError: _atlas,
    OutOfTime: lambda _: later(5, TOO_LONG).reply,
    ClientDisconnect: lambda _: Response(status_code=499),  # 499: the client closed the connection
    Cancelled: lambda _: Response(status_code=499),
    HTTPException: http_problem,
    Exception: lambda _: problem(500, "the service has failed, not the request; the log of the service has details"),
}
"""Responses by class of the error; the most specific class applies."""


def reply_to(error: Exception) -> Response:
    """Return the response to an error."""
    return next(_REPLIES[kind] for kind in type(error).__mro__ if kind in _REPLIES)(error)


def install(app: FastAPI) -> None:
    """Register the replies on an application."""

    async def handle(request: Request, error: Exception) -> Response:
        return reply_to(error)

    for kind in _REPLIES:
        app.add_exception_handler(kind, handle)
