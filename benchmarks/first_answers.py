"""Time to the first card and to the last change on the page, for the examples of its gallery.

The page repeats a search with growing budgets (``STAGES`` in `app/static/service.js`) and shows each reply. This benchmark
sends the same requests over HTTP to a service of its own, for four-bars and for all kinds of linkages.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks import report
from benchmarks.service import Service, running, serve_command
from synthesis.ranking import CRITERIA, PREFERENCES

KINDS = {"four-bars": {}, "all kinds": {"mechanisms": "all"}}
ENDED = 0.8
"""Fraction of a budget below which a search counts as completed; the page then sends no further request."""


def stages() -> list[int]:
    """Return the budgets of the page in milliseconds."""
    source = (report.ROOT / "app/static/service.js").read_text()
    found = re.search(r"const STAGES = (\[.*\]);", source)
    assert found is not None
    return list(json.loads(found[1]))


def solve(service: Service, request: dict[str, Any], budgets: list[int]) -> list[float]:
    """Return the milliseconds from Solve to each reply with a linkage."""
    begin, shown = time.perf_counter(), []
    for budget in budgets:
        reply = service.ask("POST", "/v2/synthesize", json.dumps(request | {"budget_ms": budget}).encode()).json()
        if reply["solutions"]:
            shown.append(1000 * (time.perf_counter() - begin))
        ended = reply["report"]
        if ended["stopped_by"] != "budget" and ended["elapsed_ms"]["total"] < ENDED * budget:
            break
    return shown


def measure() -> Iterator[dict[str, Any]]:
    """Solve each example for each of both kinds, after an example that is not timed."""
    examples = json.loads((report.ROOT / "app/static/examples.json").read_text())
    rows, budgets = [], stages()
    with running(serve_command, with_atlas=False) as service:
        for kinds, fields in KINDS.items():
            solve(service, examples[0]["request"] | fields, budgets)
            times = [solve(service, example["request"] | fields, budgets) for example in examples]
            first, last = (np.array([shown[index] for shown in times]) for index in (0, -1))
            rows.append(
                {
                    "kinds": kinds,
                    "cases": len(times),
                    "first": float(np.median(first)),
                    "first_max": float(first.max()),
                    "last": float(np.median(last)),
                    "last_max": float(last.max()),
                }
            )
    yield {"rows": rows}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """Return the table of the document and the table of the rule."""
    criteria = [*CRITERIA.items(), *((f"`{name}`", criterion) for name, criterion in PREFERENCES.items())]
    rule = [{"criterion": name, "rule": criterion.rule} for name, criterion in criteria]
    return report.tables("first_answers", {"rows": results["rows"], "rule": rule})


if __name__ == "__main__":
    report.run(measure)
