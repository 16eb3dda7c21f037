"""Code of a worker process of `app.compute`, which computes an answer at a time."""

from __future__ import annotations

import logging
import os
import signal
from typing import Any

from starlette.responses import Response

import linkage_atlas as la
from app import problems
from app.bodies import read_request
from app.questions import all_questions
from app.resources import ServiceResources
from app.settings import Settings
from linkage_atlas.atlases import follow_parent

NICE = 5
"""Increment of the niceness of worker processes, so that the process that serves the clients has priority."""
_resources: ServiceResources


def start(settings: Settings, cancelled: Any) -> None:
    """Prepare the process; the shared value ``cancelled`` is nonzero if the current answer was cancelled."""
    global _resources
    follow_parent(signal.SIGINT, signal.SIGTERM)  # the service ends its workers itself
    os.nice(NICE)
    _resources = ServiceResources(settings, cancelled=lambda: bool(cancelled.value))


def ready() -> tuple[int, la.AtlasError | None]:
    """Load the atlas; return the process number and the error if the atlas cannot be used."""
    try:
        if _resources.settings.with_atlas:
            _ = _resources.atlas
    except la.AtlasError as error:
        return os.getpid(), error
    return os.getpid(), None


def answer(path: str, content: bytes) -> Response:
    """Return the reply to a body, or the problem response to its error."""
    question = all_questions()[path]
    try:
        return question.answer(read_request(content, question.model), _resources)
    except Exception as error:
        reply = problems.reply_to(error)
        if reply.status_code == 500:
            logging.getLogger("uvicorn.error").exception("A fault in %s", path)
        return reply
