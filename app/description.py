"""The API's description: what there is to say of each route, which FastAPI makes a document of when it is first asked for.

FastAPI is imported for that alone. The routes are Starlette's, on which it builds: importing FastAPI takes a fifth of a
start, and no other request needs it.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cached_property
from typing import Any

from app import problems
from app.replies import reply_model


class Description:
    """What routes take and return, as functions in FastAPI's manner, of which only the signature counts.

    Parameters
    ----------
    about : str
        Title, version and summary of the API.
    """

    def __init__(self, **about: str) -> None:
        self._about = about
        self._routes: list[tuple[str, Callable[..., Any], dict[str, Any]]] = []

    def add(self, path: str, function: Callable[..., Any], **details: Any) -> None:
        """A route by its path: a function with its parameters and what it returns, and what FastAPI is told beyond it."""
        self._routes.append((path, function, details))

    @cached_property
    def document(self) -> dict[str, Any]:
        """The OpenAPI document."""
        from fastapi import FastAPI
        from pydantic.warnings import UnsupportedFieldAttributeWarning

        whole = FastAPI(**self._about)
        with warnings.catch_warnings():  # FastAPI's own, which it keeps quiet where models are built at once
            warnings.simplefilter("ignore", UnsupportedFieldAttributeWarning)
            for path, function, details in self._routes:
                if details.get("response_model"):
                    details = details | {"response_model": reply_model(details["response_model"])}
                whole.add_api_route(path, function, **details)
            document = whole.openapi()
        document["components"]["schemas"]["Problem"] = problems.SCHEMA
        return document
