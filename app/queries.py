"""All questions that the service answers."""

from __future__ import annotations

from app.query import Query
from app.scenes import scene_queries


def all_queries() -> tuple[Query, ...]:
    """Every query of the service: the four-bar's and the scenes'."""
    return scene_queries()
