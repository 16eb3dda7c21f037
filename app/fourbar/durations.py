"""What a search of the four-bar will take, by a table that was measured: the service keeps a place for what takes little.

``python -m benchmarks.durations`` makes the table, `durations.json`.
"""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files
from typing import Any

FEW_SAMPLES = 5
"""Samples with free timing that a four-bar nearly always meets exactly, within milliseconds."""
REFERENCE_SAMPLES = 12
"""Samples of the requests that the table is of; others take in proportion to a power of theirs, which is measured too."""


def kind_of(request: Any) -> str:
    """The row of the table that a request of synthesize or function belongs to."""
    if not hasattr(request, "timing"):
        words = ["function", request.objective]
    else:
        given = [name for name in ("rotation", "position") if getattr(request, name) is not None]
        known = request.rotation is not None and request.position is not None
        partial = known and (None in request.rotation or None in request.position)
        words = ["free" if request.timing else "timed", *given, *["partial"] * partial]
        words += ["few"] * (request.timing is not None and samples_of(request) <= FEW_SAMPLES)
        words += [request.order] * (request.order != "given") + ["closed"] * request.closed
    limits = request.limits.model_fields_set - {"family", "preset"}
    practical = request.limits.preset == "practical"
    words += [request.limits.family] * (request.limits.family == "any") + ["limits"] * bool(limits)
    return " ".join([*words, *["practical"] * practical])


def samples_of(request: Any) -> int:
    columns = [getattr(request, name, None) for name in ("rotation", "position", "output")]
    return max((len(column) for column in columns if column is not None), default=101)


def seconds_of(request: Any) -> float:
    """Processor seconds that the search of a request will take, its budget at most."""
    table = _table()
    found = _typical(kind_of(request)) * (samples_of(request) / REFERENCE_SAMPLES) ** table["power"]
    budget = getattr(request, "budget_ms", None)
    return float(found if budget is None else min(found, budget / 1000))


@cache
def _typical(kind: str) -> float:
    """Of a kind that was not measured: the slowest of those that have most words with it in common."""
    words = set(kind.split())
    return max((-len(words ^ set(known.split())), seconds) for known, seconds in _table()["kinds"].items())[1]


@cache
def _table() -> Any:
    return json.loads(files("app.fourbar").joinpath("durations.json").read_text())
