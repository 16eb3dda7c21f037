"""Errors to problem+json (RFC 9457): the one place that knows both the domain's errors and HTTP.

A reply never repeats the input, so hostile values (NaN, lone surrogates, megabytes) cannot break it.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError
from starlette.exceptions import HTTPException

from synthesis.errors import AtlasError, FieldError

MAX_ERRORS = 20
"""Errors listed in one reply; a request of a thousand wrong numbers needs no thousand lines."""
MAX_POINTER = 200
"""Longest pointer in characters: a field's name is the client's and may be of any length."""


class Overloaded(Exception):
    """More requests wait than the service lets wait."""


class NotFound(Exception):
    """There is no such thing; the message says what there is."""


def pointer(location: Iterable[str | int]) -> str:
    """A JSON pointer (RFC 6901) as a URI fragment, for the path of a value in the request."""
    parts = [str(part).replace("~", "~0").replace("/", "~1") for part in location]
    text = "#" + "".join(f"/{part}" for part in parts)
    return text if len(text) <= MAX_POINTER else text[: MAX_POINTER - 1] + "…"


def error_rows(errors: Sequence[Any]) -> list[dict[str, Any]]:
    """Pydantic's error list as rows ``{"pointer", "detail"}``, without the input."""
    rows = []
    for error in errors[:MAX_ERRORS]:
        location = [part for part in error["loc"] if part not in ("body",)]
        rows.append({"pointer": pointer(location), "detail": error["msg"]})
    return rows


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


def install(app: FastAPI) -> None:
    """Register the handlers on an application."""

    @app.exception_handler(RequestValidationError)
    async def _validation(_: Request, error: RequestValidationError) -> Response:
        rows = error_rows(error.errors())
        malformed = any(entry["type"] == "json_invalid" for entry in error.errors())
        if malformed:
            return problem(400, "the body is not valid JSON", [{"pointer": "#", "detail": "not valid JSON"}])
        return problem(422, rows[0]["pointer"][1:].lstrip("/") + ": " + rows[0]["detail"], rows)

    @app.exception_handler(ValidationError)
    async def _model(_: Request, error: ValidationError) -> Response:
        rows = error_rows(error.errors(include_input=False, include_url=False))
        return problem(422, rows[0]["detail"], rows)

    @app.exception_handler(FieldError)
    async def _field(_: Request, error: FieldError) -> Response:
        return field_problem(error)

    @app.exception_handler(AtlasError)
    async def _atlas(_: Request, error: AtlasError) -> Response:
        return problem(503, str(error), headers={"Retry-After": "5"})

    @app.exception_handler(NotFound)
    async def _not_found(_: Request, error: NotFound) -> Response:
        return problem(404, str(error))

    @app.exception_handler(Overloaded)
    async def _overloaded(_: Request, __: Overloaded) -> Response:
        return problem(503, "too many requests are waiting", headers={"Retry-After": "1"})

    @app.exception_handler(HTTPException)
    async def _http(_: Request, error: HTTPException) -> Response:
        details = {
            400: "the body could not be read as JSON",
            404: "there is nothing at this address",
            405: "this address does not take that method",
            413: "the body is larger than this service accepts",
        }
        detail = details.get(error.status_code, str(error.detail))
        rows = [{"pointer": "#", "detail": detail}] if error.status_code in (400, 413) else None
        return problem(error.status_code, detail, rows, dict(error.headers or {}))
