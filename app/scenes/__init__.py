"""The scenes beside the four-bar: each module here holds the models and the queries of one machine.

A scene module exposes ``QUERIES``, a tuple of `app.query.Query`. Its numerics live in `synthesis` and are imported
when a request of that scene is answered, so that no scene costs another one's start.
"""

from __future__ import annotations

from importlib import import_module

from app.query import Query

SCENES: tuple[str, ...] = ("lift", "chain", "knotter")


def scene_queries() -> tuple[Query, ...]:
    """The queries of all scenes, in the order of `SCENES`."""
    return tuple(query for name in SCENES for query in import_module(f"app.scenes.{name}").QUERIES)
