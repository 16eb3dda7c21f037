"""Read request bodies; a body is counted before it is parsed, because parsing cannot be interrupted."""

from __future__ import annotations

import json
from typing import Any

from pydantic import ValidationError
from starlette.datastructures import Headers

from app import problems
from app.query import Invalid, RequestModel, invalid

MAX_KEYS = 2_000
"""Keys of a body: the largest request has a few hundred."""
MAX_CONTAINERS = 12_000
"""Objects and arrays of a body: a thousand rows in each table of a knotter."""
MAX_VALUES = 120_000
"""Values of a body: the times of a lift's motion are at most 100,000."""


def read_request(content: bytes, model: type[RequestModel]) -> RequestModel:
    """Parse a body.

    Raises
    ------
    problems.Problem
        For a body that is not JSON, or has an object with the same key twice.
    Invalid
        For JSON that violates the model.
    """
    check_counts(content)
    try:
        values = json.loads(content, object_pairs_hook=_unique)
    except (ValueError, RecursionError):
        raise problems.malformed("the body is not valid JSON", "not valid JSON") from None
    try:
        return model.model_validate(values)
    except ValidationError as error:
        raise invalid(error, model) from None


def check_counts(content: bytes) -> None:
    """Refuse an empty body and a body that holds too much, before it is parsed; raise as `read_request` does."""
    if not content:
        raise Invalid([{"loc": (), "msg": "the body is empty"}])
    counts = {
        "keys": (content.count(b":"), MAX_KEYS),
        "objects and arrays": (content.count(b"{") + content.count(b"["), MAX_CONTAINERS),
        "values": (content.count(b",") + 1, MAX_VALUES),
    }
    for name, (found, limit) in counts.items():
        if found > limit:
            raise problems.malformed(f"the body has more than {limit:,} {name}")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) < len(pairs):
        raise problems.malformed("an object of the body has a key twice")
    return values


def says_json(headers: Headers) -> bool:
    """Return whether the headers declare an uncompressed body in JSON."""
    if headers.get("content-encoding", "identity").strip().lower() != "identity":
        return False
    kind = headers.get("content-type", "").partition(";")[0].strip().lower()
    return kind == "application/json" or (kind.startswith("application/") and kind.endswith("+json"))
