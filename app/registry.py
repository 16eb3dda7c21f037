"""All questions that the service and the command line answer: the four-bar's and the scenes'."""

from __future__ import annotations

from app.fourbar.answers import fourbar_queries
from app.query import Query
from app.scenes import scene_queries


def all_queries() -> tuple[Query, ...]:
    """Every query of the service."""
    return (*fourbar_queries(), *scene_queries())
