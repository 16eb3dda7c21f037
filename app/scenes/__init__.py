"""Machine scenes: each module contains the requests, replies and queries of a machine.

A scene exposes ``QUERIES``, a tuple of `app.query.Query` with paths ``/v2/<scene>/...``. It is imported with its numerics in
`synthesis` when the scene is first used, so that an unused scene does not slow down the start.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from app.query import Query

SCENES = {"lift": "Lift", "chain": "Chain slide", "knotter": "Knotter"}
"""Names and titles of the scenes."""


def queries_of(scene: str) -> tuple[Query, ...]:
    """Return the queries of a scene, which is imported if necessary."""
    queries: tuple[Query, ...] = import_module(f"{__package__}.{scene}").QUERIES
    return queries


def scene_queries() -> tuple[Query, ...]:
    """Return the queries of all scenes, in the order of `SCENES`."""
    return tuple(query for scene in SCENES for query in queries_of(scene))
