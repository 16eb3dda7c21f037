"""The scenes beside the four-bar: each module here holds the models and the queries of one machine.

A scene module exposes ``QUERIES``, a tuple of `app.query.Query`, with paths ``/v1/<scene>/...``. It is imported when the scene
is first asked for, with its numerics in `synthesis`, so that no scene costs another one's start.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from app.query import Query

SCENES: tuple[str, ...] = ("lift", "chain", "knotter")


def queries_of(scene: str) -> tuple[Query, ...]:
    queries: tuple[Query, ...] = import_module(f"app.scenes.{scene}").QUERIES
    return queries


def scene_queries() -> tuple[Query, ...]:
    """The queries of all scenes, in the order of `SCENES`."""
    return tuple(query for scene in SCENES for query in queries_of(scene))
